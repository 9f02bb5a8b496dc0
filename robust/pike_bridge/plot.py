"""Drawings of plans with choices as SVG, PNG or PDF, in the manner of [PIKE, Figure 1].

Circles are events, double circles choices (shaded: not the executive's), boxes activities in the colour of their agent,
arrows constraints. What is always so is not written: ε-ordering constraints have no bounds, those that other arrows
imply are left out, and an arrow names only the assignments that its guard adds to that of the event it comes from.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from robust.errors import InputError, Location
from robust.numbers import format_number, shorten
from robust.pike_bridge.layout import Layout, Point, layered
from robust.pike_bridge.model import EPSILON, Activity, Choice, Constraint, Tpnu, guard_text
from robust.pike_bridge.scenarios import contradicts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES: Final = (".svg", ".png", ".pdf")

# Okabe and Ito, lightened: distinguishable without colour vision, and black text is readable on them.
_AGENTS = ("#A6D8F5", "#F7CE7B", "#9FDCC6", "#E8B9D3", "#F5EE9B", "#F2AE7E", "#A8C8E8")
_NOBODY = "0.93"
_SHADE = "0.72"
_LINK = "#009E73"
_GUARD = "#0072B2"
_RADIUS = 0.17
_LETTER = 0.066
"""The width of a letter of a box's text, roughly."""
_LONGEST = 18000
"""Pixels of a side, beyond which resolution is reduced."""
_DPI = 160


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
        InputError: if the suffix is unknown, a link names an unknown event, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        message = f"found {shorten(str(path))}, expected a name that ends in {', '.join(SUFFIXES)}"
        raise InputError(message, Location(str(path)))
    known = network.guards
    drawn = [Link(*link) for link in links]
    for link in drawn:
        for event in (link.producer, link.consumer):
            if event not in known:
                raise InputError(f"found a causal link at event {shorten(event)}, expected an event of the plan")

    import matplotlib as mpl  # noqa: PLC0415 (takes half a second)

    # Texts stay texts in an SVG; names must not be read as formulas.
    with mpl.rc_context({"svg.fonttype": "none", "text.parse_math": False}):
        figure = _Drawing(network, epsilon).figure(drawn)
        try:
            figure.savefig(target, dpi=min(_DPI, _LONGEST / max(figure.get_size_inches())))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise InputError(f"cannot write the drawing: {reason}", Location(str(path))) from None


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
        implied = _Implied(self._network, self._epsilon)
        for constraint in self._network.constraints:
            if not implied.elsewhere(constraint):
                plain = constraint.upper is None and constraint.lower == self._epsilon
                texts = [guard_text(constraint.guard - self._guards[constraint.source])]
                texts.append("" if plain else _bounds(constraint.lower, constraint.upper))
                label = "\n".join(filter(None, texts))
                yield _Arrow(constraint.source, constraint.target, label, dashed=constraint.upper is not None)

    # -- how -----------------------------------------------------------------------------------------------------

    def figure(self, links: Sequence[Link]) -> Figure:
        from matplotlib.figure import Figure  # noqa: PLC0415 (as above)

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
        from matplotlib.patches import FancyArrowPatch  # noqa: PLC0415 (as above)
        from matplotlib.path import Path as Curve  # noqa: PLC0415 (as above)

        if arrow.source == arrow.target:
            x, y = route[0]
            route = ((x - _RADIUS, y), (x - 0.25, y + 0.5), (x + 0.25, y + 0.5), (x + _RADIUS, y))
        else:
            first = self._border(arrow.source, route[0], route[1])
            route = (first, *route[1:-1], self._border(arrow.target, route[-1], route[-2]))
        style = "--" if arrow.dashed else "-"
        axes.add_patch(
            FancyArrowPatch(
                path=Curve(route), arrowstyle="-|>", mutation_scale=8, linewidth=0.8, linestyle=style, color="0.25"
            )
        )
        if arrow.label:
            (x, y), (towards, up) = route[0], route[1]
            place = (x + (towards - x) * 0.5, y + (up - y) * 0.5)
            axes.text(
                *place,
                arrow.label,
                fontsize=6,
                color=_GUARD,
                ha="center",
                va="center",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85},
                zorder=4,
            )

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
        from matplotlib.patches import FancyBboxPatch  # noqa: PLC0415 (as above)

        x, y = place
        shape = FancyBboxPatch(
            (x - width / 2 + 0.04, y - 0.15),
            width - 0.08,
            0.3,
            boxstyle="round,pad=0.04,rounding_size=0.06",
            facecolor=self._colours().get(activity.agent, _NOBODY),
            edgecolor="0.25",
            linewidth=0.8,
            zorder=3,
        )
        axes.add_patch(shape)
        axes.text(x, y, _text(activity), fontsize=7, ha="center", va="center", linespacing=1.1, zorder=4)

    def _events(self, axes: Axes) -> None:
        from matplotlib.patches import Circle  # noqa: PLC0415 (as above)

        for event in self._network.events:
            x, y = self._layout.places[event.name]
            choices = [choice for choice in self._network.choices if choice.event == event.name]
            shaded = any(not choice.controllable for choice in choices)
            face = _SHADE if shaded else "white"
            if choices:
                axes.add_patch(
                    Circle((x, y), _RADIUS + 0.05, facecolor=face, edgecolor="black", linewidth=0.9, zorder=3)
                )
                names = ", ".join(choice.name for choice in choices)
                axes.text(x, y + _RADIUS + 0.1, names, fontsize=7, ha="center", va="bottom", weight="bold", zorder=5)
            axes.add_patch(Circle((x, y), _RADIUS, facecolor=face, edgecolor="black", linewidth=0.9, zorder=3))
            inside = len(event.name) <= 4
            below = y - _RADIUS - (0.12 if choices else 0.07)
            place = (x, y) if inside else (x, below)
            axes.text(*place, event.name, fontsize=6, ha="center", va="center" if inside else "top", zorder=5)

    def _link(self, axes: Axes, link: Link) -> None:
        from matplotlib.patches import FancyArrowPatch  # noqa: PLC0415 (as above)

        (x, y), (to_x, to_y) = self._layout.places[link.producer], self._layout.places[link.consumer]
        bend = 0.25 if to_x >= x else -0.25
        arc = FancyArrowPatch(
            (x, y + _RADIUS),
            (to_x, to_y + _RADIUS),
            connectionstyle=f"arc3,rad={-bend}",
            arrowstyle="-|>",
            mutation_scale=8,
            linestyle=":",
            linewidth=1.2,
            color=_LINK,
            zorder=2,
        )
        axes.add_patch(arc)
        # The middle of the arc, whose control point is `bend` times the distance above the middle of its ends.
        top = ((x + to_x) / 2 - (to_y - y) * bend / 2, (y + to_y) / 2 + _RADIUS + (to_x - x) * bend / 2)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.85}
        axes.text(*top, link.label, fontsize=6, color=_LINK, ha="center", va="center", bbox=box, zorder=5)

    # -- legend --------------------------------------------------------------------------------------------------

    def _colours(self) -> dict[str | None, str]:
        agents = dict.fromkeys(activity.agent for activity in self._network.activities if activity.agent is not None)
        return {agent: _AGENTS[at % len(_AGENTS)] for at, agent in enumerate(agents)}

    def _legend(self, axes: Axes, place: Point, *, links: bool) -> None:
        from matplotlib.patches import Circle, Rectangle  # noqa: PLC0415 (as above)

        x, y = place
        for choice in _kinds(self._network.choices):
            face = "white" if choice.controllable else _SHADE
            for radius in (0.09, 0.06):
                axes.add_patch(Circle((x, y), radius, facecolor=face, edgecolor="black", linewidth=0.7))
            x = _entry(axes, (x, y), "choice" if choice.controllable else "choice of others")
        for agent, colour in self._colours().items():
            axes.add_patch(Rectangle((x - 0.1, y - 0.06), 0.2, 0.12, facecolor=colour, edgecolor="0.25", linewidth=0.7))
            x = _entry(axes, (x, y), f"{agent}")
        if links:
            axes.plot([x - 0.12, x + 0.1], [y, y], linestyle=":", linewidth=1.2, color=_LINK)
            _entry(axes, (x, y), "causal link")


class _Implied:
    """Whether other constraints order events as one does."""

    def __init__(self, network: Tpnu, epsilon: Fraction) -> None:
        self._epsilon = epsilon
        self._after: dict[str, list[Constraint]] = {}
        for constraint in network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= epsilon:
                self._after.setdefault(constraint.source, []).append(constraint)

    def elsewhere(self, constraint: Constraint) -> bool:
        """Whether the constraint only orders its events, and some path of others does, too, for compatible choices."""
        if constraint.upper is not None or constraint.lower is None or constraint.lower > self._epsilon:
            return False
        found, pending = set[str](), [constraint.source]
        while pending:
            event = pending.pop()
            for other in self._after.get(event, ()):
                direct = event == constraint.source and other.target == constraint.target
                if direct or other.target in found or contradicts(other.guard, constraint.guard):
                    continue
                found.add(other.target)
                pending.append(other.target)
        return constraint.target in found


def _kinds(choices: Iterable[Choice]) -> Iterable[Choice]:
    """One choice of each kind, controllable first."""
    return sorted({choice.controllable: choice for choice in choices}.values(), key=lambda one: not one.controllable)


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
