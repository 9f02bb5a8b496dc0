"""Drawings of plans with choices as SVG, PNG or PDF, in the manner of [PIKE, Figure 1].

Circles are events, double circles choices (shaded: not the executive's), boxes activities in the colour of their agent,
arrows constraints. What is always so is not written: ε-ordering constraints have no bounds, those that other arrows
imply are left out, and an arrow names only the assignments that its guard adds to that of the event it comes from.
Causal links are wires over the plan, as in a circuit diagram: up from the producer, along a track of its own with the
label, and down to the consumer, between the columns of nodes; wires are joined where there is a dot.

The layout is layered, left to right: columns by longest paths, few crossings, edges as straight as they can be. Lengths
are inches, as floats: nothing of the layout is a number of a plan.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import inf
from typing import Any, Final, Generic, NamedTuple, TypeAlias, TypeVar

import networkx
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Curve
from matplotlib.transforms import Affine2D

from robust.draw.style import BLUE, DARK_GREY, GREEN, LIGHT, PALE, SHADE, Spans, cut, free_row, save
from robust.errors import InputError
from robust.numbers import format_number, shorten
from robust.pike_bridge.model import EPSILON, Activity, Choice, Constraint, Tpnu, contradicts, guard_text

_TIP: Final[dict[str, Any]] = {"arrowstyle": "-|>", "mutation_scale": 8}
_DOTTED: Final[dict[str, Any]] = {"linestyle": ":", "linewidth": 1.2}
_OUTLINES: Final[tuple[dict[str, Any], ...]] = (
    {"linewidth": 0.8},
    {"linewidth": 1.8},
    {"linewidth": 1.2, "linestyle": "--"},
    {"linewidth": 1.2, "linestyle": ":"},
)
_TRACK, _WIRE, _STUB, _LABEL = 0.2, 0.12, 0.24, 0.055
"""Between tracks of causal links, between their wires, from an event up to its wire, and of a letter of a label."""
_RADIUS = 0.17
_LETTER = 0.066
"""The width of a letter of a box's text, roughly."""
_LONGEST = 18000
"""Pixels of a side, beyond which resolution is reduced."""


class DrawnLink(NamedTuple):
    """A causal link to be drawn: from the event of the producer to that of the consumer."""

    producer: str
    consumer: str
    label: str


def plot_network(
    network: Tpnu,
    path: str | os.PathLike[str],
    *,
    links: Iterable[tuple[str, str, str]] = (),
    epsilon: Fraction = EPSILON,
) -> None:
    """Draw a network, and causal links as dotted wires.

    Args:
        path: the file to write; its suffix names the format.
        links: producer's event, consumer's event and label of each causal link.
        epsilon: the lower bound of constraints that only order events.

    Raises:
        InputError: if a link names an unknown event, or the file cannot be written.
    """
    known = network.guards
    drawn = [DrawnLink(*link) for link in links]
    for link in drawn:
        for event in (link.producer, link.consumer):
            if event not in known:
                raise InputError(f"found a causal link at event {shorten(event)}, expected an event of the plan")
    save(lambda: _NetworkDrawing(network, epsilon, drawn).figure(), path, longest=_LONGEST)


@dataclass(frozen=True, slots=True)
class _Arrow:
    """An edge of the drawing between events or activities' boxes; its label is written at its beginning."""

    source: str | int
    target: str | int
    label: str
    dashed: bool = False


class _NetworkDrawing:
    """Events are known by their names, activities by their places in the network."""

    def __init__(self, network: Tpnu, epsilon: Fraction, links: Sequence[DrawnLink] = ()) -> None:
        self._links = links
        self._network = network
        self._epsilon = epsilon
        self._guards = network.guards
        self._arrows = [*self._of_activities(), *self._of_constraints()]
        sizes: dict[str | int, tuple[float, float]] = {event.name: (2 * _RADIUS, 0.62) for event in network.events}
        for at, activity in enumerate(network.activities):
            sizes[at] = (_width(activity), 0.52)
        self._sizes = sizes
        edges = [(arrow.source, arrow.target) for arrow in self._arrows]
        rooms = [_room(arrow.label) for arrow in self._arrows]
        self._layout: Placement[str | int] = layered(sizes, edges, rooms)
        if links:
            # Which columns wires are between is known now; there they need room beside one another.
            self._wiring = self._wired()
            ends = [*self._wiring.rises.values(), *self._wiring.falls.values()]
            columns = sorted({x for x, _ in self._layout.places.values()})
            gaps = list(zip(columns, [*columns[1:], inf], strict=True))
            counts = {start: sum(1 for x in ends if start < x < end) for start, end in gaps}
            wires = [_WIRE * (counts[self._layout.places[source][0]] + 1) for source, _ in edges]
            self._layout = layered(sizes, edges, list(map(max, rooms, wires)))
        self._wiring = self._wired()

    # -- what is drawn -------------------------------------------------------------------------------------------

    def _of_activities(self) -> Iterable[_Arrow]:
        for at, activity in enumerate(self._network.activities):
            yield _Arrow(activity.source, at, guard_text(activity.guard - self._guards[activity.source]))
            yield _Arrow(at, activity.target, "")

    def _of_constraints(self) -> Iterable[_Arrow]:
        known = self._network.temporal_constraints
        orders = [order for order in known if order.lower is not None and order.lower >= self._epsilon]
        for constraint in self._network.constraints:
            if not _is_implied(constraint, orders, self._epsilon):
                plain = constraint.upper is None and constraint.lower == self._epsilon
                texts = [guard_text(constraint.guard - self._guards[constraint.source])]
                texts.append("" if plain else _bounds(constraint.lower, constraint.upper))
                label = "\n".join(filter(None, texts))
                yield _Arrow(constraint.source, constraint.target, label, dashed=constraint.upper is not None)

    def _wired(self) -> Wires:
        return Wires.of(self._links, self._layout.places, {name: width for name, (width, _) in self._sizes.items()})

    # -- how -----------------------------------------------------------------------------------------------------

    def figure(self) -> Figure:
        points = [point for route in self._layout.routes for point in route] + [*self._layout.places.values()]
        low, high = min((y for _, y in points), default=0) - 0.6, max((y for _, y in points), default=0) + 0.6
        wiring, links = self._wiring, bool(self._links)
        ends = [*(x for x, _ in points), *wiring.rises.values(), *wiring.falls.values()]
        ends += [end for _, left, right, _ in self._tracks(wiring) for end in (left, right)]
        left, right = min(ends, default=0) - 0.6, max(ends, default=0) + 0.6
        width = max(right - left, 6.0)
        entries = self._entries(links=links)
        rows = _rows_of([_LETTER * len(text) + 0.45 for text, _ in entries], width - 0.6)
        legend, title = 0.3 + 0.25 * len(rows), 0.4
        height = high - low + legend + title + _TRACK * (wiring.count + 1) * links
        figure = Figure(figsize=(width, height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(left, left + width)
        axes.set_ylim(low - legend, low - legend + height)
        axes.set_aspect("equal")
        axes.axis("off")
        texts = f"{cut(self._network.name, 60)}: what happens when, for which choices"
        axes.text(left + 0.3, low - legend + height - 0.2, texts, fontsize=10, ha="left", va="center")
        for arrow, route in zip(self._arrows, self._layout.routes, strict=True):
            self._arrow(axes, arrow, route)
        for at, activity in enumerate(self._network.activities):
            self._box(axes, activity, self._layout.places[at], self._sizes[at][0])
        self._events(axes)
        self._wires(axes, wiring, high)
        for number, row in enumerate(rows):
            self._legend(axes, (left + 0.4, low - 0.2 - 0.25 * number), [entries[at] for at in row])
        return figure

    def _arrow(self, axes: Axes, arrow: _Arrow, route: tuple[Point, ...]) -> None:
        if arrow.source == arrow.target:
            x, y = route[0]
            route = ((x - _RADIUS, y), (x - 0.25, y + 0.5), (x + 0.25, y + 0.5), (x + _RADIUS, y))
        else:
            first = self._border(arrow.source, route[0], route[1])
            route = (first, *route[1:-1], self._border(arrow.target, route[-1], route[-2]))
        dashes = "--" if arrow.dashed else "-"
        axes.add_patch(FancyArrowPatch(path=Curve(route), linewidth=0.8, linestyle=dashes, color=DARK_GREY, **_TIP))
        if arrow.label:
            (x, y), (towards, up) = route[0], route[1]
            _note(axes, (x + (towards - x) * 0.5, y + (up - y) * 0.5), arrow.label, BLUE, zorder=4)

    def _border(self, node: str | int, place: Point, towards: Point) -> Point:
        """Where a line from the middle of a node leaves it."""
        (x, y), (to_x, to_y) = place, towards
        if isinstance(node, int):
            half = self._sizes[node][0] / 2
            return (x + half if to_x > x else x - half, y)
        length = ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5 or 1.0
        radius = _RADIUS + (0.05 if any(choice.event == node for choice in self._network.choices) else 0.0)
        return (x + (to_x - x) * radius / length, y + (to_y - y) * radius / length)

    def _box(self, axes: Axes, activity: Activity, place: Point, width: float) -> None:
        x, y = place
        corner, style = (x - width / 2 + 0.04, y - 0.15), "round,pad=0.04,rounding_size=0.06"
        look = self._looks().get(activity.agent, {"facecolor": PALE, "edgecolor": DARK_GREY, **_OUTLINES[0]})
        axes.add_patch(FancyBboxPatch(corner, width - 0.08, 0.3, boxstyle=style, zorder=3, **look))
        axes.text(x, y, _text(activity), fontsize=7, ha="center", va="center", linespacing=1.1, zorder=4)

    def _events(self, axes: Axes) -> None:
        for event in self._network.events:
            x, y = self._layout.places[event.name]
            choices = [choice for choice in self._network.choices if choice.event == event.name]
            shaded = any(not choice.controllable for choice in choices)
            look = {"facecolor": SHADE if shaded else "white", "edgecolor": "black", "linewidth": 0.9, "zorder": 3}
            if choices:
                axes.add_patch(Circle((x, y), _RADIUS + 0.05, **look))
                names = ", ".join(choice.name for choice in choices)
                axes.text(x, y + _RADIUS + 0.1, names, fontsize=7, ha="center", va="bottom", weight="bold", zorder=5)
            axes.add_patch(Circle((x, y), _RADIUS, **look))
            inside = len(event.name) <= 4
            below = y - _RADIUS - (0.12 if choices else 0.07)
            place = (x, y) if inside else (x, below)
            axes.text(*place, event.name, fontsize=6, ha="center", va="center" if inside else "top", zorder=5)

    # -- causal links --------------------------------------------------------------------------------------------

    def _tracks(self, wiring: Wires) -> Iterator[tuple[int, float, float, str]]:
        """Of each track with its label: its number, and from where to where it reaches, its label included."""
        for link, number in wiring.tracks.items():
            start, other = sorted((wiring.rises[link.producer], wiring.falls[link.consumer]))
            middle, half = (start + other) / 2, max(other - start, _LABEL * len(link.label)) / 2
            yield number, middle - half, middle + half, link.label

    def _wires(self, axes: Axes, wiring: Wires, high: float) -> None:
        wire = {"color": GREEN, "zorder": 2, **_DOTTED}
        levels = {link: high + _TRACK * (number + 0.5) for link, number in wiring.tracks.items()}
        for event, across in wiring.rises.items():
            x, y = self._layout.places[event]
            top = max(level for link, level in levels.items() if link.producer == event)
            axes.plot([x + 0.85 * _RADIUS, across, across], [y + 0.55 * _RADIUS, y + _STUB, top], **wire)
        for event, across in wiring.falls.items():
            x, y = self._layout.places[event]
            top = max(level for link, level in levels.items() if link.consumer == event)
            axes.plot([across, across], [top, y + _STUB], **wire)
            tip = (x - 0.85 * _RADIUS, y + 0.55 * _RADIUS)
            arrow = FancyArrowPatch((across, y + _STUB), tip, shrinkA=0, shrinkB=0, color=GREEN, zorder=3, **_TIP)
            axes.add_patch(arrow)
        for link, level in levels.items():
            ends = wiring.rises[link.producer], wiring.falls[link.consumer]
            axes.plot(ends, (level, level), marker="o", markersize=2.5, **wire)
            above = 0.09 if _LABEL * len(link.label) > abs(ends[0] - ends[1]) - 0.1 else 0.0
            _note(axes, (sum(ends) / 2, level + above), link.label, GREEN, zorder=5)

    # -- legend --------------------------------------------------------------------------------------------------

    def _looks(self) -> dict[str | None, dict[str, Any]]:
        """The boxes of each agent: colours, and outlines, which are distinguishable without colours."""
        agents = dict.fromkeys(activity.agent for activity in self._network.activities if activity.agent is not None)
        return {
            agent: {"facecolor": LIGHT[at % len(LIGHT)], "edgecolor": DARK_GREY, **_OUTLINES[at % len(_OUTLINES)]}
            for at, agent in enumerate(agents)
        }

    def _entries(self, *, links: bool) -> list[tuple[str, Sequence[Artist]]]:
        """What the legend says, each with its picture around the origin."""
        entries: list[tuple[str, Sequence[Artist]]] = []
        if self._network.events:
            entries.append(("event", [Circle((0, 0), 0.09, facecolor="white", edgecolor="black", linewidth=0.7)]))
        for choice in _kinds(self._network.choices):
            face = "white" if choice.controllable else SHADE
            rings = [
                Circle((0, 0), radius, facecolor=face, edgecolor="black", linewidth=0.7) for radius in (0.09, 0.06)
            ]
            entries.append(("choice" if choice.controllable else "choice of others", rings))
        for agent, look in self._looks().items():
            entries.append((f"activity of {agent}", [Rectangle((-0.1, -0.06), 0.2, 0.12, **look)]))
        line: dict[str, Any] = {"color": DARK_GREY, "linewidth": 0.8}
        if any(not arrow.dashed for arrow in self._arrows):
            entries.append(("before, or activity", [Line2D([-0.12, 0.12], [0, 0], **line)]))
        if any(arrow.dashed for arrow in self._arrows):
            entries.append(("before, with an upper bound", [Line2D([-0.12, 0.12], [0, 0], linestyle="--", **line)]))
        if links:
            entries.append(("causal link", [Line2D([-0.12, 0.12], [0, 0], color=GREEN, **_DOTTED)]))
        return entries

    def _legend(self, axes: Axes, place: Point, entries: Sequence[tuple[str, Sequence[Artist]]]) -> None:
        x, y = place
        for text, artists in entries:
            for artist in artists:
                artist.set_transform(Affine2D().translate(x, y) + axes.transData)
                axes.add_artist(artist)
            axes.text(x + 0.17, y, text, fontsize=7, ha="left", va="center")
            x += _LETTER * len(text) + 0.45


def _rows_of(widths: Sequence[float], room: float) -> list[list[int]]:
    """Numbers of things in rows that are no wider than the room, if one thing is not."""
    rows: list[list[int]] = []
    left = 0.0
    for number, width in enumerate(widths):
        if not rows or width > left:
            rows.append([])
            left = room
        rows[-1].append(number)
        left -= width
    return rows


@dataclass(frozen=True, slots=True)
class Wires:
    """Where the wires of causal links are: upwards by producer, downwards by consumer, along tracks by link."""

    rises: Mapping[str, float]
    falls: Mapping[str, float]
    tracks: Mapping[DrawnLink, int]
    count: int

    @staticmethod
    def of(links: Iterable[DrawnLink], places: Mapping[str | int, Point], widths: Mapping[str | int, float]) -> Wires:
        """Wires between columns: after that of the producer, before that of the consumer; links between the same two
        events are one wire with all labels."""
        labels: dict[tuple[str, str], list[str]] = {}
        for producer, consumer, label in links:
            labels.setdefault((producer, consumer), []).append(label)
        joined = [DrawnLink(*ends, ", ".join(dict.fromkeys(texts))) for ends, texts in labels.items()]
        edges: dict[float, float] = {}
        for node, (x, _) in places.items():
            edges[x] = max(edges.get(x, 0.0), widths[node] / 2)
        columns = sorted(edges)
        after: dict[float, list[tuple[str, bool]]] = {}
        for producer in dict.fromkeys(link.producer for link in joined):
            after.setdefault(places[producer][0], []).append((producer, True))
        for consumer in dict.fromkeys(link.consumer for link in joined):
            at = columns.index(places[consumer][0])
            after.setdefault(columns[at - 1] if at else columns[0] - 1.0, []).append((consumer, False))
        across: dict[tuple[str, bool], float] = {}
        for column, wires in after.items():
            right = next((later for later in columns if later > column), column + edges.get(column, 0.0) + 0.6)
            start, end = column + edges.get(column, 0.0) + 0.05, right - edges.get(right, 0.0) - 0.05
            # Those that come from far below are nearer to their nodes: fewer wires cross there.
            for number, wire in enumerate(sorted(wires, key=lambda wire: (not wire[1], places[wire[0]][1])), start=1):
                across[wire] = start + (end - start) * number / (len(wires) + 1)
        rises = {event: x for (event, up), x in across.items() if up}
        falls = {event: x for (event, up), x in across.items() if not up}
        tracks: dict[DrawnLink, int] = {}
        taken: list[Spans] = []
        for link in sorted(joined, key=lambda link: abs(rises[link.producer] - falls[link.consumer])):
            first, other = sorted((rises[link.producer], falls[link.consumer]))
            half = max(other - first, _LABEL * len(link.label)) / 2 + 0.05
            tracks[link] = free_row(taken, (first + other) / 2 - half, (first + other) / 2 + half)
        return Wires(rises, falls, tracks, len(taken))


def _is_implied(constraint: Constraint, orders: Iterable[Constraint], epsilon: Fraction) -> bool:
    """Whether the constraint only orders its events, and some path of others does, too, for compatible choices."""
    if constraint.upper is not None or constraint.lower is None or constraint.lower > epsilon:
        return False
    ends = (constraint.source, constraint.target)
    paths = networkx.DiGraph(
        (other.source, other.target)
        for other in orders
        if (other.source, other.target) != ends and not contradicts(other.guard, constraint.guard)
    )
    paths.add_nodes_from(ends)
    return bool(networkx.has_path(paths, *ends))


def _kinds(choices: Iterable[Choice]) -> Iterable[Choice]:
    """One choice of each kind, controllable first."""
    kinds = {choice.controllable: choice for choice in choices}
    return sorted(kinds.values(), key=lambda choice: not choice.controllable)


def _note(axes: Axes, place: Point, text: str, colour: str, *, zorder: int) -> None:
    """Write what belongs to a line over it, on white."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    axes.text(*place, text, fontsize=6, color=colour, ha="center", va="center", bbox=box, zorder=zorder)


def _room(label: str) -> float:
    """Inches between the ends of an arrow for its label."""
    return min(1.5, 0.85 * _LETTER * max(map(len, label.split("\n"))) + 0.15)


def _text(activity: Activity) -> str:
    return f"{activity.action.strip('()')}\n{_bounds(activity.lower, activity.upper)}"


def _width(activity: Activity) -> float:
    return max(map(len, _text(activity).split("\n"))) * _LETTER + 0.2


def _bounds(lower: Fraction | None, upper: Fraction | None) -> str:
    if lower is None:
        return "" if upper is None else f"≤ {format_number(upper)}"
    return f"[{format_number(lower)}, {'∞' if upper is None else format_number(upper)}]"


N = TypeVar("N", bound=Hashable)
Point: TypeAlias = tuple[float, float]

_SWEEPS = 12
_BEND = 0.14
"""Half of the height that an edge takes where it passes a column."""

_GAP = 0.3
"""Between columns, at least."""


@dataclass(frozen=True, slots=True)
class Placement(Generic[N]):
    """Where nodes are, and through which points each edge goes, in the order in which edges were given."""

    places: Mapping[N, Point]
    routes: tuple[tuple[Point, ...], ...]


def layered(
    sizes: Mapping[N, tuple[float, float]], edges: Sequence[tuple[N, N]], labels: Sequence[float]
) -> Placement[N]:
    """Place nodes of the given widths and heights in columns, with room after each for the labels of its edges.

    Edges that close a cycle are allowed, and drawn straight.
    """
    return _Layering(sizes, edges, labels).layout()


class _Layering(Generic[N]):
    """Nodes are numbers here; those after the given ones are bends of long edges."""

    def __init__(
        self, sizes: Mapping[N, tuple[float, float]], edges: Sequence[tuple[N, N]], labels: Sequence[float]
    ) -> None:
        self._names = list(sizes)
        number = {name: at for at, name in enumerate(self._names)}
        self._edges = [(number[source], number[target]) for source, target in edges]
        self._labels = labels
        self._widths = [width for width, _ in sizes.values()]
        self._halves = [height / 2 for _, height in sizes.values()]
        self._columns = _columns(len(self._names), self._edges)
        self._before: list[list[int]] = [[] for _ in self._names]
        self._after: list[list[int]] = [[] for _ in self._names]
        self._chains = [self._chain(source, target) for source, target in self._edges]
        self._layers: list[list[int]] = [[] for _ in range(max(self._columns, default=-1) + 1)]
        for node, column in enumerate(self._columns):
            self._layers[column].append(node)

    def layout(self) -> Placement[N]:
        self._sort()
        horizontal = self._horizontal()
        vertical = self._vertical()
        points = [(horizontal[column], vertical[node]) for node, column in enumerate(self._columns)]
        return Placement(
            {name: points[node] for node, name in enumerate(self._names)},
            tuple(tuple(points[node] for node in chain) for chain in self._chains),
        )

    def _chain(self, source: int, target: int) -> list[int]:
        """The nodes of an edge, with a bend in each column that it passes."""
        chain = [source]
        for column in range(self._columns[source] + 1, self._columns[target]):
            chain.append(len(self._columns))
            self._columns.append(column)
            self._widths.append(0.0)
            self._halves.append(_BEND)
            self._before.append([])
            self._after.append([])
        chain.append(target)
        if self._columns[source] < self._columns[target]:
            for node, other in pairwise(chain):
                self._after[node].append(other)
                self._before[other].append(node)
        return chain

    def _sort(self) -> None:
        """Order each column by the mean place of the neighbours in the column before, then after, and again."""
        for sweep in range(_SWEEPS):
            forward = sweep % 2 == 0
            neighbours = self._before if forward else self._after
            for layer in self._layers if forward else reversed(self._layers):
                place = {node: at / max(1, len(layer) - 1) for layer in self._layers for at, node in enumerate(layer)}
                layer.sort(key=lambda node: _mean((place[neighbour] for neighbour in neighbours[node]), place[node]))

    def _horizontal(self) -> list[float]:
        """The middle of each column."""
        gaps = [_GAP] * len(self._layers)
        for (source, _), room in zip(self._edges, self._labels, strict=True):
            gaps[self._columns[source]] = max(gaps[self._columns[source]], room)
        middles, edge = [], 0.0
        for layer, gap in zip(self._layers, gaps, strict=True):
            width = max(self._widths[node] for node in layer)
            middles.append(edge + width / 2)
            edge += width + gap
        return middles

    def _vertical(self) -> list[float]:
        """Each node as near to the mean of its neighbours as order and heights allow."""
        heights = [0.0] * len(self._columns)
        for layer in self._layers:
            self._place(layer, heights, dict.fromkeys(layer, 0.0))
        for sweep in range(_SWEEPS):
            neighbours = self._before if sweep % 2 == 0 else self._after
            for layer in self._layers if sweep % 2 == 0 else reversed(self._layers):
                wanted = {
                    node: _mean((heights[neighbour] for neighbour in neighbours[node]), heights[node]) for node in layer
                }
                self._place(layer, heights, wanted)
        return [-height for height in heights]

    def _place(self, layer: Sequence[int], heights: list[float], wanted: Mapping[int, float]) -> None:
        """The heights nearest to the wanted ones, in the sense of least squares, that keep order and distances."""
        offset, offsets = 0.0, []
        for at, node in enumerate(layer):
            offset += self._halves[layer[at - 1]] + self._halves[node] if at else 0.0
            offsets.append(offset)
        # Without the offsets, what is asked for is the nearest sequence that does not decrease: pool its violators.
        blocks: list[tuple[float, int]] = []
        for node, offset in zip(layer, offsets, strict=True):
            total, count = wanted[node] - offset, 1
            while blocks and blocks[-1][0] / blocks[-1][1] > total / count:
                before, many = blocks.pop()
                total, count = total + before, count + many
            blocks.append((total, count))
        levels = [total / count for total, count in blocks for _ in range(count)]
        for node, offset, level in zip(layer, offsets, levels, strict=True):
            heights[node] = level + offset


def _columns(count: int, edges: Iterable[tuple[int, int]]) -> list[int]:
    """The longest path to each node; on a cycle, edges to earlier nodes do not count."""
    graph = networkx.DiGraph(edges)
    graph.add_nodes_from(range(count))
    for members in list(networkx.strongly_connected_components(graph)):
        graph.remove_edges_from([(source, other) for source, other in graph.subgraph(members).edges if other <= source])
    columns = [0] * count
    for column, nodes in enumerate(networkx.topological_generations(graph)):
        for node in nodes:
            columns[node] = column
    return columns


def _mean(values: Iterable[float], default: float) -> float:
    known = list(values)
    return sum(known) / len(known) if known else default
