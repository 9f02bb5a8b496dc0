"""Drawings of plans with choices as SVG, PNG or PDF, in the manner of [PIKE, Figure 1].

Circles are events, double circles choices (shaded: not the executive's), boxes activities in the colour of their agent,
arrows constraints. What is always so is not written: ε-ordering constraints have no bounds, those that other arrows
imply are left out, and an arrow names only the assignments that its guard adds to that of the event it comes from.
Causal links are wires over the plan, as in a circuit diagram: up from the producer, along a track of its own with the
label, and down to the consumer, between the columns of nodes; wires are joined where there is a dot.

A plan is cut into tiles between columns, where few arrows are cut, and tiles are set on lines like words on a page. One
arrow goes on from a tile to the next; what else is cut says at both ends where the other one is. In a browser, the
lines of an SVG are as wide as its window, and a click folds a tile.

Lengths are inches, as floats: nothing of the layout is a number of a plan.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import accumulate, pairwise
from typing import Any, Final, NamedTuple, TypeAlias

import networkx
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Curve
from matplotlib.transforms import Affine2D

from robust.draw.layers import GAP, Placement, Point, columns_of, layered
from robust.draw.style import BLUE, DARK_GREY, GREEN, LIGHT, PALE, SHADE, Spans, cut, free_row, part, save, script_json
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
_PAGE = 10.6
"""The width of a line, if no tile is wider."""
_HANDY = 5.5
"""The width of a tile that fits narrow windows; a wider one is worth as much as an arrow that is cut for each inch."""


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
    drawing = _NetworkDrawing(network, epsilon, drawn)
    save(drawing.figure, path, longest=_LONGEST, script=drawing.script)


@dataclass(frozen=True, slots=True)
class _Arrow:
    """An edge of the drawing between events or activities' boxes; its label is written at its beginning."""

    source: str | int
    target: str | int
    label: str
    dashed: bool = False


class _Port(NamedTuple):
    """Where the arrow of this number leaves a tile, or enters it."""

    arrow: int
    leaves: bool


_Node: TypeAlias = str | int | _Port
"""Events are known by their names, activities by their places in the network."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """What is set on lines like a word: its width, its height above and below the line, and what draws it.

    Attributes:
        name: in an SVG.
        begins: a line.
        folded: what is written instead of it; "" if it cannot be folded.
    """

    name: str
    width: float
    above: float
    below: float
    draw: Callable[[Axes], None]
    begins: bool = False
    folded: str = ""


class _NetworkDrawing:
    """The plan as it is drawn: arrows, looks, tiles, and what is on the page."""

    def __init__(self, network: Tpnu, epsilon: Fraction, links: Sequence[DrawnLink] = ()) -> None:
        self.network = network
        self._links = links
        self._epsilon = epsilon
        self._guards = network.guards
        self.choices: dict[str | None, list[Choice]] = {}
        for choice in network.choices:
            self.choices.setdefault(choice.event, []).append(choice)
        self.arrows = [*self._of_activities(), *self._of_constraints()]
        self.sizes: dict[str | int, tuple[float, float]] = {event.name: (2 * _RADIUS, 0.62) for event in network.events}
        self.sizes |= {at: (_width(activity), 0.52) for at, activity in enumerate(network.activities)}
        agents = dict.fromkeys(activity.agent for activity in network.activities if activity.agent is not None)
        self.looks: dict[str | None, dict[str, Any]] = {
            agent: {"facecolor": LIGHT[at % len(LIGHT)], "edgecolor": DARK_GREY, **_OUTLINES[at % len(_OUTLINES)]}
            for at, agent in enumerate(agents)
        }
        self.tiles = self._tiles()
        self._pieces = [
            *self._head(),
            *(tile.piece(f"tile-{at}", begins=at == 0) for at, tile in enumerate(self.tiles)),
        ]
        widest = max(piece.width for piece in self._pieces)
        self._places, self._height = _set(self._pieces, max(widest, _PAGE))
        self._width = max(x + piece.width for piece, (x, _) in zip(self._pieces, self._places, strict=True))

    # -- what is drawn -------------------------------------------------------------------------------------------

    def _of_activities(self) -> Iterable[_Arrow]:
        for at, activity in enumerate(self.network.activities):
            yield _Arrow(activity.source, at, guard_text(activity.guard - self._guards[activity.source]))
            yield _Arrow(at, activity.target, "")

    def _of_constraints(self) -> Iterable[_Arrow]:
        known = self.network.temporal_constraints
        orders = [order for order in known if order.lower is not None and order.lower >= self._epsilon]
        for constraint in self.network.constraints:
            if not _is_implied(constraint, orders, self._epsilon):
                plain = constraint.upper is None and constraint.lower == self._epsilon
                texts = [guard_text(constraint.guard - self._guards[constraint.source])]
                texts.append("" if plain else _bounds(constraint.lower, constraint.upper))
                label = "\n".join(filter(None, texts))
                yield _Arrow(constraint.source, constraint.target, label, dashed=constraint.upper is not None)

    def _tiles(self) -> list[_Tile]:
        nodes = list(self.sizes)
        number = {node: at for at, node in enumerate(nodes)}
        ends = [(number[arrow.source], number[arrow.target]) for arrow in self.arrows]
        columns = columns_of(len(nodes), ends)
        count = max(columns, default=-1) + 1
        widths, gaps = [0.0] * count, [GAP] * count
        for node, column in zip(nodes, columns, strict=True):
            widths[column] = max(widths[column], self.sizes[node][0])
        for arrow, (source, _) in zip(self.arrows, ends, strict=True):
            gaps[columns[source]] = max(gaps[columns[source]], _room(arrow.label))
        reaches = [tuple(sorted((columns[source], columns[target]))) for source, target in ends]
        starts = _cuts([width + gap for width, gap in zip(widths, gaps, strict=True)], reaches)
        which = {
            column: at for at, (start, end) in enumerate(pairwise([*starts, count])) for column in range(start, end)
        }
        places = {node: which[column] for node, column in zip(nodes, columns, strict=True)}
        # An arrow from a tile to the next goes on over the border, where there is no room for a label.
        joints: dict[int, int] = {}
        for at, arrow in enumerate(self.arrows):
            if not arrow.label and places[arrow.target] == places[arrow.source] + 1:
                joints.setdefault(places[arrow.source], at)
        return [
            _Tile(self, [node for node in nodes if places[node] == at], joints.get(at - 1), joints.get(at), self._links)
            for at in range(len(starts))
        ]

    # -- the page ------------------------------------------------------------------------------------------------

    def figure(self) -> Figure:
        margin = 0.2
        width, height = self._width + 2 * margin, self._height + 2 * margin
        figure = Figure(figsize=(width, height))
        for piece, (x, y) in zip(self._pieces, self._places, strict=True):
            bottom = height - margin - y - piece.below
            high = piece.above + piece.below
            axes = figure.add_axes(((x + margin) / width, bottom / height, piece.width / width, high / height))
            axes.set_xlim(0, piece.width)
            axes.set_ylim(-piece.below, piece.above)
            axes.axis("off")
            axes.set_gid(piece.name)
            piece.draw(axes)
        return figure

    def script(self) -> str:
        """What makes an SVG follow the width of its window, and folds tiles."""
        told = [
            {"name": piece.name, "x": x, "y": y, "width": piece.width, "above": piece.above, "below": piece.below,
             "begins": piece.begins, "folded": piece.folded}
            for piece, (x, y) in zip(self._pieces, self._places, strict=True)
        ]  # fmt: skip
        return part("fold.js").replace("PIECES", script_json(told))

    def _head(self) -> Iterator[_Piece]:
        """The title and the legend."""
        title = f"{cut(self.network.name, 60)}: what happens when, for which choices"
        yield _Piece("title", 0.09 * len(title), 0.2, 0.2, partial(_write, text=title))
        for at, (text, artists) in enumerate(self._entries()):
            draw = partial(_explain, text=text, artists=artists)
            yield _Piece(f"legend-{at}", _LETTER * len(text) + 0.55, 0.13, 0.13, draw, begins=at == 0)

    def _entries(self) -> list[tuple[str, Sequence[Artist]]]:
        """What the legend says, each with its picture around the origin."""
        entries: list[tuple[str, Sequence[Artist]]] = []
        if self.network.events:
            entries.append(("event", [Circle((0, 0), 0.09, facecolor="white", edgecolor="black", linewidth=0.7)]))
        for choice in _kinds(self.network.choices):
            face = "white" if choice.controllable else SHADE
            rings = [
                Circle((0, 0), radius, facecolor=face, edgecolor="black", linewidth=0.7) for radius in (0.09, 0.06)
            ]
            entries.append(("choice" if choice.controllable else "choice of others", rings))
        for agent, look in self.looks.items():
            entries.append((f"activity of {agent}", [Rectangle((-0.1, -0.06), 0.2, 0.12, **look)]))
        line: dict[str, Any] = {"color": DARK_GREY, "linewidth": 0.8}
        if any(not arrow.dashed for arrow in self.arrows):
            entries.append(("before, or activity", [Line2D([-0.12, 0.12], [0, 0], **line)]))
        if any(arrow.dashed for arrow in self.arrows):
            entries.append(("before, with an upper bound", [Line2D([-0.12, 0.12], [0, 0], linestyle="--", **line)]))
        if self._links:
            entries.append(("causal link", [Line2D([-0.12, 0.12], [0, 0], color=GREEN, **_DOTTED)]))
        return entries


def _write(axes: Axes, text: str) -> None:
    axes.text(0, 0, text, fontsize=10, ha="left", va="center")


def _explain(axes: Axes, text: str, artists: Sequence[Artist]) -> None:
    for artist in artists:
        artist.set_transform(Affine2D().translate(0.13, 0) + axes.transData)
        axes.add_artist(artist)
    axes.text(0.32, 0, text, fontsize=7, ha="left", va="center")


def _cuts(widths: Sequence[float], reaches: Sequence[Sequence[int]]) -> list[int]:
    """Where tiles begin, so that few arrows are cut and tiles are handy, none wider than a page if columns allow it.

    Args:
        widths: of the columns.
        reaches: of each arrow, its first and its last column.
    """
    until = [0.0, *accumulate(widths)]
    best: list[tuple[float, int]] = [(0.0, 0)]
    for end in range(1, len(widths) + 1):
        costs = []
        for start in range(end - 1, -1, -1):
            width = until[end] - until[start]
            if width > _PAGE - 1 and start < end - 1:
                break
            severed = sum((start <= first < end) != (start <= last < end) for first, last in reaches)
            costs.append((best[start][0] + severed + 1 + max(0.0, width - _HANDY), start))
        best.append(min(costs))
    starts: list[int] = []
    end = len(widths)
    while end:
        end = best[end][1]
        starts.append(end)
    return starts[::-1]


def _set(pieces: Sequence[_Piece], room: float) -> tuple[list[tuple[float, float]], float]:
    """Where each piece begins, and how far its line is from the top; and how high all lines are."""
    lines: list[list[_Piece]] = []
    left = 0.0
    for piece in pieces:
        if not lines or piece.begins or left + piece.width > room:
            lines.append([])
            left = 0.0
        lines[-1].append(piece)
        left += piece.width
    places, top = [], 0.0
    for line in lines:
        above, below = max(piece.above for piece in line), max(piece.below for piece in line)
        lefts = accumulate((piece.width for piece in line[:-1]), initial=0.0)
        places += [(x, top + above) for x in lefts]
        top += above + below
    return places, top


class _Tile:
    """Some nodes of the plan with the arrows among them, and ports for those that lead on or come from elsewhere.

    Attributes:
        layout: where nodes are; the line of the page is where the arrow from the tile before and that to the next are.
    """

    def __init__(
        self,
        plan: _NetworkDrawing,
        nodes: Sequence[str | int],
        before: int | None,
        after: int | None,
        links: Sequence[DrawnLink],
    ) -> None:
        """`before` and `after` are the arrows that lead from the tile before to this one, and from it to the next."""
        self._plan = plan
        self._before, self._after = before, after
        self.sizes: dict[_Node, tuple[float, float]] = {node: plan.sizes[node] for node in nodes}
        self._arrows: list[tuple[_Arrow, _Node, _Node]] = []
        for at, arrow in enumerate(plan.arrows):
            here = arrow.source in self.sizes, arrow.target in self.sizes
            if any(here):
                source: _Node = arrow.source if here[0] else _Port(at, leaves=False)
                target: _Node = arrow.target if here[1] else _Port(at, leaves=True)
                self._arrows.append((arrow, source, target))
        for _, *nodes_of in self._arrows:
            for port in nodes_of:
                if isinstance(port, _Port):
                    self.sizes[port] = (_LETTER * len(self._says(port)) * 0.9 + 0.05, 0.24)
        self._links = [
            DrawnLink(self._if_here(link.producer), self._if_here(link.consumer), self._wire_label(link))
            for link in links
            if link.producer in self.sizes or link.consumer in self.sizes
        ]
        rooms = [_room(arrow.label) for arrow, *_ in self._arrows]
        self.layout = self._placed(rooms)
        self.wiring = self._wired()
        if self._links:
            # Which columns wires are between is known now; there they need room beside one another.
            upright = [*self.wiring.rises.values(), *self.wiring.falls.values()]
            columns = sorted({x for x, _ in self.layout.places.values()})
            counts = {start: sum(start < x < end for x in upright) for start, end in pairwise([*columns, float("inf")])}
            wires = [_WIRE * (counts[self.layout.places[source][0]] + 1) for _, source, _ in self._arrows]
            self.layout = self._placed(list(map(max, rooms, wires)))
            self.wiring = self._wired()

    def _placed(self, rooms: Sequence[float]) -> Placement[_Node]:
        edges = [(source, target) for _, source, target in self._arrows]
        late = [node for node in self.sizes if isinstance(node, _Port) and not node.leaves]
        return layered(self.sizes, edges, rooms, late=late)

    def _wired(self) -> Wires:
        return Wires.of(self._links, self.layout.places, {node: width for node, (width, _) in self.sizes.items()})

    def _says(self, port: _Port) -> str:
        """What is written at a port: where the other end is."""
        if port.arrow == (self._after if port.leaves else self._before):
            return ""
        arrow = self._plan.arrows[port.arrow]
        other = arrow.target if port.leaves else arrow.source
        name = self._plan.network.activities[other].action.strip("()") if isinstance(other, int) else other
        return f"to {name}" if port.leaves else f"from {name}"

    def _if_here(self, event: str) -> str:
        return event if event in self.sizes else ""

    def _wire_label(self, link: DrawnLink) -> str:
        if link.producer not in self.sizes:
            return f"from {link.producer}: {link.label}"
        return link.label if link.consumer in self.sizes else f"to {link.consumer}: {link.label}"

    # -- how -----------------------------------------------------------------------------------------------------

    def piece(self, name: str, *, begins: bool) -> _Piece:
        """The tile as a piece, whose line is that of the arrows to its neighbours."""
        places, wiring = self.layout.places, self.wiring
        points = [point for route in self.layout.routes for point in route] + [*places.values()]
        low, high = min((y for _, y in points), default=0.0) - 0.5, max((y for _, y in points), default=0.0) + 0.6
        ends = [x + side * self.sizes[node][0] / 2 for node, (x, _) in places.items() for side in (-1, 1)]
        ends += [*(x for x, _ in points), *wiring.rises.values(), *wiring.falls.values()]
        ends += [end for link in wiring.tracks for end in wiring.span(link)]
        left, right = min(ends, default=0.0) - 0.15, max(ends, default=0.0) + 0.15
        joints = [_Port(at, leaves) for at, leaves in ((self._after, True), (self._before, False)) if at is not None]
        line = places[joints[0]][1] if joints else (low + high) / 2
        top = high + _TRACK * (wiring.count + 1) * bool(self._links)

        def draw(axes: Axes) -> None:
            axes.set_xlim(left, right)
            axes.set_ylim(low, top)
            self._draw(axes, high, (left, line), (right, line))

        return _Piece(name, right - left, top - line, line - low, draw, begins, self._summary())

    def _summary(self) -> str:
        """What is written instead of the tile."""
        events = [node for node in self.sizes if isinstance(node, str)]
        activities = sum(isinstance(node, int) for node in self.sizes)
        choices = [choice.name for event in events for choice in self._plan.choices.get(event, ())]
        texts = [f"{events[0]} … {events[-1]}" if len(events) > 1 else "".join(events)]
        texts += [f"choice of {', '.join(choices)}"] * bool(choices) + [
            "1 activity" if activities == 1 else f"{activities} activities"
        ] * bool(activities)
        return cut(", ".join(filter(None, texts)), 80)

    def _draw(self, axes: Axes, high: float, start: Point, end: Point) -> None:
        for (arrow, source, target), route in zip(self._arrows, self.layout.routes, strict=True):
            if isinstance(source, _Port) and source.arrow == self._before:
                self._arrow(axes, arrow, source, target, (start, *route[1:]))
            elif isinstance(target, _Port) and target.arrow == self._after:
                self._arrow(axes, arrow, source, target, (*route[:-1], end))
            else:
                self._arrow(axes, arrow, source, target, route)
        for node, place in self.layout.places.items():
            match node:
                case _Port():
                    axes.text(
                        *place, self._says(node), fontsize=6, color=DARK_GREY, ha="center", va="center", style="italic"
                    )
                case int():
                    self._box(axes, self._plan.network.activities[node], place, self.sizes[node][0])
                case str():
                    self._event(axes, node, place)
        self._wires(axes, high)

    def _arrow(self, axes: Axes, arrow: _Arrow, source: _Node, target: _Node, route: Sequence[Point]) -> None:
        if source == target:
            x, y = route[0]
            route = ((x - _RADIUS, y), (x - 0.25, y + 0.5), (x + 0.25, y + 0.5), (x + _RADIUS, y))
        else:
            first = self._border(source, route[0], route[1])
            route = (first, *route[1:-1], self._border(target, route[-1], route[-2]))
        look: dict[str, Any] = {"linewidth": 0.8, "linestyle": "--" if arrow.dashed else "-", "color": DARK_GREY}
        if isinstance(target, _Port) and target.arrow == self._after:
            axes.plot(*zip(*route, strict=True), zorder=1, **look)
        else:
            axes.add_patch(FancyArrowPatch(path=Curve(route), **look, **_TIP))
        if arrow.label:
            (x, y), (towards, up) = route[0], route[1]
            _note(axes, (x + (towards - x) * 0.5, y + (up - y) * 0.5), arrow.label, BLUE, zorder=4)

    def _border(self, node: _Node, place: Point, towards: Point) -> Point:
        """Where a line from the middle of a node leaves it."""
        (x, y), (to_x, to_y) = place, towards
        if isinstance(node, str):
            length = ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5 or 1.0
            radius = _RADIUS + (0.05 if node in self._plan.choices else 0.0)
            return (x + (to_x - x) * radius / length, y + (to_y - y) * radius / length)
        half = self.sizes[node][0] / 2 if isinstance(node, int) or self._says(node) else 0.0
        return (x + half if to_x > x else x - half, y)

    def _box(self, axes: Axes, activity: Activity, place: Point, width: float) -> None:
        x, y = place
        corner, style = (x - width / 2 + 0.04, y - 0.15), "round,pad=0.04,rounding_size=0.06"
        look = self._plan.looks.get(activity.agent, {"facecolor": PALE, "edgecolor": DARK_GREY, **_OUTLINES[0]})
        axes.add_patch(FancyBboxPatch(corner, width - 0.08, 0.3, boxstyle=style, zorder=3, **look))
        axes.text(x, y, _text(activity), fontsize=7, ha="center", va="center", linespacing=1.1, zorder=4)

    def _event(self, axes: Axes, name: str, place: Point) -> None:
        x, y = place
        choices = self._plan.choices.get(name, ())
        shaded = any(not choice.controllable for choice in choices)
        look = {"facecolor": SHADE if shaded else "white", "edgecolor": "black", "linewidth": 0.9, "zorder": 3}
        if choices:
            axes.add_patch(Circle((x, y), _RADIUS + 0.05, **look))
            names = ", ".join(choice.name for choice in choices)
            axes.text(x, y + _RADIUS + 0.1, names, fontsize=7, ha="center", va="bottom", weight="bold", zorder=5)
        axes.add_patch(Circle((x, y), _RADIUS, **look))
        inside = len(name) <= 4
        below = y - _RADIUS - (0.12 if choices else 0.07)
        where = (x, y) if inside else (x, below)
        axes.text(*where, name, fontsize=6, ha="center", va="center" if inside else "top", zorder=5)

    # -- causal links --------------------------------------------------------------------------------------------

    def _wires(self, axes: Axes, high: float) -> None:
        wiring = self.wiring
        wire = {"color": GREEN, "zorder": 2, **_DOTTED}
        levels = {link: high + _TRACK * (number + 0.5) for link, number in wiring.tracks.items()}
        for event, across in wiring.rises.items():
            x, y = self.layout.places[event]
            top = max(level for link, level in levels.items() if link.producer == event)
            axes.plot([x + 0.85 * _RADIUS, across, across], [y + 0.55 * _RADIUS, y + _STUB, top], **wire)
        for event, across in wiring.falls.items():
            x, y = self.layout.places[event]
            top = max(level for link, level in levels.items() if link.consumer == event)
            axes.plot([across, across], [top, y + _STUB], **wire)
            tip = (x - 0.85 * _RADIUS, y + 0.55 * _RADIUS)
            arrow = FancyArrowPatch((across, y + _STUB), tip, shrinkA=0, shrinkB=0, color=GREEN, zorder=3, **_TIP)
            axes.add_patch(arrow)
        for link, level in levels.items():
            rise, fall = wiring.rises.get(link.producer), wiring.falls.get(link.consumer)
            dots = [across for across in (rise, fall) if across is not None]
            axes.plot(dots, [level] * len(dots), marker="o", markersize=2.5, **wire)
            if rise is None or fall is None:
                side = "left" if fall is None else "right"
                place = (dots[0] + (0.07 if fall is None else -0.07), level)
                _note(axes, place, link.label, GREEN, zorder=5, side=side)
            else:
                above = 0.09 if _LABEL * len(link.label) > abs(rise - fall) - 0.1 else 0.0
                _note(axes, ((rise + fall) / 2, level + above), link.label, GREEN, zorder=5)


@dataclass(frozen=True, slots=True)
class Wires:
    """Where the wires of causal links are: upwards by producer, downwards by consumer, along tracks by link."""

    rises: Mapping[str, float]
    falls: Mapping[str, float]
    tracks: Mapping[DrawnLink, int]
    count: int

    def span(self, link: DrawnLink) -> tuple[float, float]:
        """From where to where a track reaches: as far as its label, at least."""
        rise, fall = self.rises.get(link.producer), self.falls.get(link.consumer)
        long = _LABEL * len(link.label)
        if fall is None:
            rise = rise or 0.0
            return rise, rise + long + 0.1
        if rise is None:
            return fall - long - 0.1, fall
        half = max(abs(rise - fall), long) / 2
        return (rise + fall) / 2 - half, (rise + fall) / 2 + half

    @staticmethod
    def of(links: Iterable[DrawnLink], places: Mapping[_Node, Point], widths: Mapping[_Node, float]) -> Wires:
        """Wires between columns: after that of the producer, before that of the consumer; links between the same two
        events are one wire with all labels. The name of an event that is elsewhere is empty."""
        labels: dict[tuple[str, str, str], list[str]] = {}
        for producer, consumer, label in links:
            apart = "" if producer and consumer else label
            labels.setdefault((producer, consumer, apart), []).append(label)
        joined = [DrawnLink(*ends[:2], ", ".join(dict.fromkeys(texts))) for ends, texts in labels.items()]
        edges: dict[float, float] = {}
        for node, (x, _) in places.items():
            edges[x] = max(edges.get(x, 0.0), widths[node] / 2)
        columns = sorted(edges)
        after: dict[float, list[tuple[str, bool]]] = {}
        for producer in dict.fromkeys(link.producer for link in joined if link.producer):
            after.setdefault(places[producer][0], []).append((producer, True))
        for consumer in dict.fromkeys(link.consumer for link in joined if link.consumer):
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
        untracked, taken = Wires(rises, falls, {}, 0), list[Spans]()
        spans = {link: untracked.span(link) for link in joined}
        tracks = {
            link: free_row(taken, start - 0.05, end + 0.05)
            for link, (start, end) in sorted(spans.items(), key=lambda known: known[1][1] - known[1][0])
        }
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


def _note(axes: Axes, place: Point, text: str, colour: str, *, zorder: int, side: str = "center") -> None:
    """Write what belongs to a line over it, on white."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
    axes.text(*place, text, fontsize=6, color=colour, ha=side, va="center", bbox=box, zorder=zorder)


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
