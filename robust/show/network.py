"""Drawings of plans with choices as SVG, PNG or PDF, in the manner of [PIKE, Figure 1].

Circles are events, double circles choices (shaded: not the executive's), boxes activities in the colour of their agent,
arrows constraints. What is always so is not written: ε-ordering constraints have no bounds, those that other arrows
imply are left out, and an arrow names only the assignments that its guard adds to that of the event it comes from.

The layout is layered, left to right: columns by longest paths, few crossings, edges as straight as they can be. Lengths
are inches, as floats: nothing of the layout is a number of a plan.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, Final, Generic, NamedTuple, TypeAlias, TypeVar

import networkx
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Curve

from robust.errors import InputError
from robust.numbers import format_number, shorten
from robust.pike_bridge.model import EPSILON, Activity, Choice, Constraint, Tpnu, contradicts, guard_text
from robust.show.drawing import BLUE, DARK_GREY, GREEN, LIGHT, PALE, SHADE, save

_TIP: Final[dict[str, Any]] = {"arrowstyle": "-|>", "mutation_scale": 8}
_DOTTED: Final[dict[str, Any]] = {"linestyle": ":", "linewidth": 1.2}
_EDGE: Final[dict[str, Any]] = {"edgecolor": DARK_GREY, "linewidth": 0.8}
_RADIUS = 0.17
_LETTER = 0.066
"""The width of a letter of a box's text, roughly."""
_LONGEST = 18000
"""Pixels of a side, beyond which resolution is reduced."""


class Link(NamedTuple):
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
    """Draw a network, and causal links as dotted arcs.

    Args:
        path: the file to write; its suffix names the format.
        links: producer's event, consumer's event and label of each causal link.
        epsilon: the lower bound of constraints that only order events.

    Raises:
        InputError: if a link names an unknown event, or the file cannot be written.
    """
    known = network.guards
    drawn = [Link(*link) for link in links]
    for link in drawn:
        for event in (link.producer, link.consumer):
            if event not in known:
                raise InputError(f"found a causal link at event {shorten(event)}, expected an event of the plan")
    save(lambda: _Drawing(network, epsilon).figure(drawn), path, longest=_LONGEST)


@dataclass(frozen=True, slots=True)
class _Arrow:
    """An edge of the drawing between events or activities' boxes; its label is written at its beginning."""

    source: str | int
    target: str | int
    label: str
    dashed: bool = False


class _Drawing:
    """Events are known by their names, activities by their places in the network."""

    def __init__(self, network: Tpnu, epsilon: Fraction) -> None:
        self._network = network
        self._epsilon = epsilon
        self._guards = network.guards
        self._arrows = [*self._of_activities(), *self._of_constraints()]
        sizes: dict[str | int, tuple[float, float]] = {event.name: (2 * _RADIUS, 0.62) for event in network.events}
        for at, activity in enumerate(network.activities):
            sizes[at] = (_width(activity), 0.52)
        self._sizes = sizes
        edges = [(arrow.source, arrow.target) for arrow in self._arrows]
        self._layout: Layout[str | int] = layered(sizes, edges, [_room(arrow.label) for arrow in self._arrows])

    # -- what is drawn -------------------------------------------------------------------------------------------

    def _of_activities(self) -> Iterable[_Arrow]:
        for at, activity in enumerate(self._network.activities):
            yield _Arrow(activity.source, at, guard_text(activity.guard - self._guards[activity.source]))
            yield _Arrow(at, activity.target, "")

    def _of_constraints(self) -> Iterable[_Arrow]:
        known = self._network.temporal_constraints
        orders = [one for one in known if one.lower is not None and one.lower >= self._epsilon]
        for constraint in self._network.constraints:
            if not _is_implied(constraint, orders, self._epsilon):
                plain = constraint.upper is None and constraint.lower == self._epsilon
                texts = [guard_text(constraint.guard - self._guards[constraint.source])]
                texts.append("" if plain else _bounds(constraint.lower, constraint.upper))
                label = "\n".join(filter(None, texts))
                yield _Arrow(constraint.source, constraint.target, label, dashed=constraint.upper is not None)

    # -- how -----------------------------------------------------------------------------------------------------

    def figure(self, links: Sequence[Link]) -> Figure:
        points = [point for route in self._layout.routes for point in route] + [*self._layout.places.values()]
        left, right = min((x for x, _ in points), default=0) - 0.6, max((x for x, _ in points), default=0) + 0.6
        low, high = min((y for _, y in points), default=0) - 0.6, max((y for _, y in points), default=0) + 0.6
        legend = 0.45
        arcs = 0.5 if links else 0.0
        width, height = max(right - left, 6.0), high - low + legend + arcs
        figure = Figure(figsize=(width, height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(left, left + width)
        axes.set_ylim(low - legend, high + arcs)
        axes.set_aspect("equal")
        axes.axis("off")
        for arrow, route in zip(self._arrows, self._layout.routes, strict=True):
            self._arrow(axes, arrow, route)
        for at, activity in enumerate(self._network.activities):
            self._box(axes, activity, self._layout.places[at], self._sizes[at][0])
        self._events(axes)
        for link in links:
            self._link(axes, link)
        self._legend(axes, (left + 0.3, low - legend / 2), links=bool(links))
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
        face = self._colours().get(activity.agent, PALE)
        axes.add_patch(FancyBboxPatch(corner, width - 0.08, 0.3, boxstyle=style, facecolor=face, zorder=3, **_EDGE))
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

    def _link(self, axes: Axes, link: Link) -> None:
        (x, y), (to_x, to_y) = self._layout.places[link.producer], self._layout.places[link.consumer]
        bend = 0.25 if to_x >= x else -0.25
        start, end = (x, y + _RADIUS), (to_x, to_y + _RADIUS)
        arc = f"arc3,rad={-bend}"
        axes.add_patch(FancyArrowPatch(start, end, connectionstyle=arc, color=GREEN, zorder=2, **{**_DOTTED, **_TIP}))
        # The middle of the arc, whose control point is `bend` times the distance above the middle of its ends.
        top = ((x + to_x) / 2 - (to_y - y) * bend / 2, (y + to_y) / 2 + _RADIUS + (to_x - x) * bend / 2)
        _note(axes, top, link.label, GREEN, zorder=5)

    # -- legend --------------------------------------------------------------------------------------------------

    def _colours(self) -> dict[str | None, str]:
        agents = dict.fromkeys(activity.agent for activity in self._network.activities if activity.agent is not None)
        return {agent: LIGHT[at % len(LIGHT)] for at, agent in enumerate(agents)}

    def _legend(self, axes: Axes, place: Point, *, links: bool) -> None:
        x, y = place
        for choice in _kinds(self._network.choices):
            face = "white" if choice.controllable else SHADE
            for radius in (0.09, 0.06):
                axes.add_patch(Circle((x, y), radius, facecolor=face, edgecolor="black", linewidth=0.7))
            x = _entry(axes, (x, y), "choice" if choice.controllable else "choice of others")
        for agent, colour in self._colours().items():
            axes.add_patch(Rectangle((x - 0.1, y - 0.06), 0.2, 0.12, facecolor=colour, **_EDGE))
            x = _entry(axes, (x, y), f"{agent}")
        if links:
            axes.plot([x - 0.12, x + 0.1], [y, y], color=GREEN, **_DOTTED)
            _entry(axes, (x, y), "causal link")


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
    return sorted({choice.controllable: choice for choice in choices}.values(), key=lambda one: not one.controllable)


def _note(axes: Axes, place: Point, text: str, colour: str, *, zorder: int) -> None:
    """Write what belongs to a line over it, on white."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    axes.text(*place, text, fontsize=6, color=colour, ha="center", va="center", bbox=box, zorder=zorder)


def _entry(axes: Axes, place: Point, text: str) -> float:
    """Write a legend's text; where the next entry begins."""
    x, y = place
    axes.text(x + 0.17, y, text, fontsize=7, ha="left", va="center")
    return x + 0.45 + _LETTER * len(text)


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
class Layout(Generic[N]):
    """Where nodes are, and through which points each edge goes, in the order in which edges were given."""

    places: Mapping[N, Point]
    routes: tuple[tuple[Point, ...], ...]


def layered(sizes: Mapping[N, tuple[float, float]], edges: Sequence[tuple[N, N]], labels: Sequence[float]) -> Layout[N]:
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

    def layout(self) -> Layout[N]:
        self._sort()
        horizontal = self._horizontal()
        vertical = self._vertical()
        points = [(horizontal[column], vertical[node]) for node, column in enumerate(self._columns)]
        return Layout(
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
            for one, other in pairwise(chain):
                self._after[one].append(other)
                self._before[other].append(one)
        return chain

    def _sort(self) -> None:
        """Order each column by the mean place of the neighbours in the column before, then after, and again."""
        for sweep in range(_SWEEPS):
            forward = sweep % 2 == 0
            neighbours = self._before if forward else self._after
            for layer in self._layers if forward else reversed(self._layers):
                place = {node: at / max(1, len(one) - 1) for one in self._layers for at, node in enumerate(one)}
                layer.sort(key=lambda node: _mean((place[one] for one in neighbours[node]), place[node]))

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
                wanted = {node: _mean((heights[one] for one in neighbours[node]), heights[node]) for node in layer}
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
        graph.remove_edges_from([(one, other) for one, other in graph.subgraph(members).edges if other <= one])
    columns = [0] * count
    for column, nodes in enumerate(networkx.topological_generations(graph)):
        for node in nodes:
            columns[node] = column
    return columns


def _mean(values: Iterable[float], default: float) -> float:
    known = list(values)
    return sum(known) / len(known) if known else default
