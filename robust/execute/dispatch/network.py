"""Which deviations an executor accepts before it re-plans [IRR §5].

DREEX accepts what a box of parameter values allows that is proved to be inside the robustness envelope. BLEX(x), the
baseline, accepts any duration or consumption within x per cent of what was planned, and proves nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import lcm

from robust.errors import InputError, Location, did_you_mean
from robust.execute.controllability.dynamic import Case, DynamicAnswer, dynamic
from robust.execute.controllability.dynamic import Edge as NormalEdge
from robust.execute.controllability.stnu import ContingentLink, Stnu
from robust.execute.controllability.strong import (
    ParametricLink,
    ParametricStnu,
    ends_of,
    finite_value,
    greatest,
    least,
)
from robust.execute.distances import Edge, Paths
from robust.irr.box import Box, Interval
from robust.numbers import format_number, is_number, parse_number, shorten
from robust.plan.model import ParametrizedPlan, TimePoint
from robust.plan.polynomial import Polynomial

_PLACE = Location("--executor")


@dataclass(frozen=True, slots=True)
class Dreex:
    """The executor that is guided by an envelope."""

    @property
    def name(self) -> str:
        return "dreex"


@dataclass(frozen=True, slots=True)
class Blex:
    """The optimistic baseline: `share` is the deviation that it accepts, 0.3 for BLEX(30)."""

    share: Fraction

    @property
    def name(self) -> str:
        return f"blex:{format_number(self.share * 100)}"

    def interval(self, value: Fraction) -> Interval:
        """[(1 − x)·v, (1 + x)·v]."""
        ends = sorted((value * (1 - self.share), value * (1 + self.share)))
        return Interval(ends[0], ends[1])

    def box(self, plan: ParametrizedPlan) -> Box:
        """The interval of every parameter, around its nominal value."""
        return Box({one.name: self.interval(one.nominal) for one in plan.parameters})


Executor = Dreex | Blex


def parse_executor(text: str) -> Executor:
    """`dreex`, or `blex:30` for 30 per cent; InputError for anything else."""
    name, colon, share = (part.strip() for part in text.lower().partition(":"))
    if name == "dreex" and not colon:
        return Dreex()
    if name != "blex":
        message = f"found {shorten(text)}, expected dreex or blex:PER_CENT{did_you_mean(name, ('dreex', 'blex'))}"
        raise InputError(message, _PLACE)
    if not is_number(share):
        raise InputError(f"found {shorten(text)}, expected a number of per cent such as blex:30", _PLACE)
    value = parse_number(share, _PLACE)
    if not 0 <= value <= 100:
        raise InputError(f"found {shorten(text)}, expected from 0 to 100 per cent", _PLACE)
    return Blex(value / 100)


class Guarantee(Enum):
    """What is known when execution begins, for as long as all observations are inside the box."""

    DYNAMIC = "dynamic"
    """The plan succeeds."""
    WEAK = "weak"
    """For all values there is a schedule that succeeds, but no strategy is certain to find it."""
    NONE = "none"
    """Nothing has been proved."""


@dataclass(frozen=True, slots=True)
class NaturalLink:
    """A distance that is not the dispatcher's to choose: `target` is waited for once `source` has happened.

    `length` is a linear expression over parameters; `allowed` are the lengths that are accepted.
    """

    source: TimePoint
    target: TimePoint
    length: Polynomial[str]
    allowed: Interval

    @property
    def parameter(self) -> str | None:
        """The parameter that the length reveals, if it is only one."""
        variables = self.length.variables
        return next(iter(variables)) if len(variables) == 1 else None

    def revealed(self, length: Fraction) -> Fraction:
        """The value of that parameter."""
        ((_, factor),) = self.length.coefficients()
        return (length - self.length.constant_term) / factor


@dataclass(frozen=True, slots=True)
class ConditionalWait:
    """`point` waits until `delay` after `activation` unless `end` has happened; None: however long that takes."""

    point: int
    activation: int
    end: int
    delay: int | None


@dataclass(frozen=True)
class Tables:
    """Bounds between time points by number, in units of 1/`scale`.

    `above[x]` has `(y, w)` for t_y ≤ t_x + w, `below[x]` has `(y, w)` for t_y ≥ t_x + w.
    """

    scale: int
    above: tuple[tuple[tuple[int, int], ...], ...]
    below: tuple[tuple[tuple[int, int], ...], ...]
    waits: tuple[ConditionalWait, ...]


class DispatchNetwork:
    """Tables of a plan's network, made once and read by any number of executions."""

    def __init__(
        self,
        points: Sequence[TimePoint],
        links: Iterable[NaturalLink],
        edges: Iterable[tuple[int, int, Fraction]],
        waits: Iterable[tuple[int, int, int, Fraction | None]],
        *,
        closed: bool,
    ) -> None:
        """`edges` are `(x, y, w)` for t_y − t_x ≤ w; `waits` are point, activation, end and delay."""
        self.points = tuple(points)
        self.index: Mapping[TimePoint, int] = {point: i for i, point in enumerate(self.points)}
        self.natural: Mapping[TimePoint, NaturalLink] = {link.target: link for link in links}
        self.closed = closed
        self._edges = _strongest(edges)
        self._waits = tuple(waits)
        delays = [delay for *_, delay in self._waits if delay is not None]
        if closed:
            self._edges = _closure(self.points, self._edges)
        self._denominator = lcm(*(weight.denominator for weight in (*self._edges.values(), *delays)))
        self._tables: dict[int, Tables] = {}

    @property
    def edges(self) -> Mapping[tuple[int, int], Fraction]:
        """`(x, y)` to the strongest known w with t_y − t_x ≤ w."""
        return self._edges

    @cached_property
    def blockers(self) -> tuple[frozenset[int], ...]:
        """For each time point those that must have happened first.

        A time point that may coincide with a natural one waits for it: whoever starts first could be wrong.
        """
        found: list[set[int]] = [set() for _ in self.points]
        for (x, y), weight in self._edges.items():
            if weight < 0 or (weight == 0 and self.points[y] in self.natural and self.points[x] not in self.natural):
                found[x].add(y)
        for point, activation, _, _ in self._waits:
            found[point].add(activation)
        return tuple(map(frozenset, found))

    def scaled(self, denominator: int = 1) -> Tables:
        """The tables in units that divide 1/`denominator` and all numbers of the network."""
        scale = lcm(self._denominator, denominator)
        if scale not in self._tables:
            self._tables[scale] = self._scaled(scale)
        return self._tables[scale]

    def _scaled(self, scale: int) -> Tables:
        above: list[list[tuple[int, int]]] = [[] for _ in self.points]
        below: list[list[tuple[int, int]]] = [[] for _ in self.points]
        for (x, y), weight in self._edges.items():
            ticks = int(weight * scale)
            above[x].append((y, ticks))
            below[y].append((x, -ticks))
        waits = tuple(ConditionalWait(p, a, e, None if d is None else int(d * scale)) for p, a, e, d in self._waits)
        return Tables(scale, tuple(map(tuple, above)), tuple(map(tuple, below)), waits)

    def tightened(self, edges: Iterable[tuple[int, int, Fraction]]) -> DispatchNetwork:
        """The network with more edges, such as those of a parameter that has been observed."""
        every = [*((x, y, w) for (x, y), w in self._edges.items()), *edges]
        return DispatchNetwork(self.points, self.natural.values(), every, self._waits, closed=self.closed)


def _strongest(edges: Iterable[tuple[int, int, Fraction]]) -> dict[tuple[int, int], Fraction]:
    found: dict[tuple[int, int], Fraction] = {}
    for x, y, weight in edges:
        if x != y:
            found[x, y] = min(weight, found.get((x, y), weight))
        elif weight < 0:
            raise InputError("the network has no schedule; expected one for every value in the box")
    return found


def _closure(points: Sequence[TimePoint], edges: Mapping[tuple[int, int], Fraction]) -> dict[tuple[int, int], Fraction]:
    """All that follows from edges.

    Raises:
        InputError: if there is no schedule.
    """
    paths = Paths(points, [Edge(points[y], points[x], -weight) for (x, y), weight in edges.items()])
    found = {}
    for x, source in enumerate(points):
        for y, target in enumerate(points):
            implied = paths.implied(target, source)
            if x == y and implied is not None and implied > 0:
                raise InputError("the network has no schedule; expected one for every value in the box")
            if x != y and implied is not None:
                found[x, y] = -implied
    return found


# -- from a plan -------------------------------------------------------------------------------------------------------


def dispatch_network(network: ParametricStnu, box: Box, executor: Executor) -> tuple[DispatchNetwork, Guarantee]:
    """The network of a plan under a box, and what is known of the executions that it leads to.

    Raises:
        InputError: if there is no schedule, whatever nature chooses.
    """
    links = [_natural(link, box, executor) for link in network.links if link.is_contingent]
    if isinstance(executor, Blex):
        edges = _possible_edges(network, box, links)
        return DispatchNetwork(network.points, links, edges, (), closed=False), Guarantee.NONE
    certain = _certain(network, box, links)
    if certain is not None:
        return certain, Guarantee.DYNAMIC
    edges = _possible_edges(network, box, links)
    return DispatchNetwork(network.points, links, edges, (), closed=True), Guarantee.WEAK


def _natural(link: ParametricLink, box: Box, executor: Executor) -> NaturalLink:
    length = link.lower or Polynomial({})
    if isinstance(executor, Blex) and length.is_constant:
        return NaturalLink(link.source, link.target, length, executor.interval(length.constant_term))
    ends = ends_of(box)
    lower, upper = finite_value(least(length), ends), finite_value(greatest(length), ends)
    sides = [box[name] for name, _ in length.coefficients()]
    # With several parameters, an open end makes the end of the sum open.
    closed = all(side.lower_closed and side.upper_closed for side in sides)
    if len(sides) == 1:
        turned = next(factor for _, factor in length.coefficients()) < 0
        ends_closed = (sides[0].lower_closed, sides[0].upper_closed)
        closed_below, closed_above = ends_closed[::-1] if turned else ends_closed
    else:
        closed_below = closed_above = closed
    interval = Interval(
        lower, upper, lower_closed=closed_below and lower is not None, upper_closed=closed_above and upper is not None
    )
    return NaturalLink(link.source, link.target, length, interval)


def _possible_edges(
    network: ParametricStnu, box: Box, links: Sequence[NaturalLink]
) -> Iterable[tuple[int, int, Fraction]]:
    """What holds for some values in the box: bounds are as weak as the box makes them."""
    index = {point: i for i, point in enumerate(network.points)}
    ends = ends_of(box)
    for link in network.links:
        if link.is_contingent:
            continue
        lower = None if link.lower is None else finite_value(least(link.lower), ends)
        upper = None if link.upper is None else finite_value(greatest(link.upper), ends)
        yield from _edges(index[link.source], index[link.target], lower, upper)
    for natural in links:
        allowed = natural.allowed
        yield from _edges(index[natural.source], index[natural.target], allowed.lower, allowed.upper)


def _edges(
    source: int, target: int, lower: Fraction | None, upper: Fraction | None
) -> Iterable[tuple[int, int, Fraction]]:
    if upper is not None:
        yield source, target, upper
    if lower is not None:
        yield target, source, -lower


def _certain(network: ParametricStnu, box: Box, links: Sequence[NaturalLink]) -> DispatchNetwork | None:
    """The network with all that follows from reductions; None if it is not dynamically controllable."""
    try:
        stnu = network.at(ends_of(box))
    except InputError:  # a face is infinitely far out, or a link may end before it starts: no strategy is certain
        return None
    answer = dynamic(stnu)
    if not answer.is_controllable:
        return None
    derived = (*answer.form.edges, *answer.derived)
    edges = [_between_points(answer, one) for one in derived if one.case is Case.ORDINARY]
    contingent = [
        bound
        for one in stnu.contingents
        for bound in _edges(stnu.points.index(one.source), stnu.points.index(one.target), one.lower, one.upper)
    ]
    finite = [edge for edge in edges if edge is not None]
    return DispatchNetwork(network.points, links, (*finite, *contingent), _waits(answer, stnu), closed=True)


def _between_points(answer: DynamicAnswer, one: NormalEdge) -> tuple[int, int, Fraction] | None:
    """An edge of the normal form, whose starts A′ = A + x are replaced by A; None if it is infinitely long."""
    weight = answer.form.length(one.weight)
    if weight is None:
        return None
    source, before = _place(answer, one.source)
    target, after = _place(answer, one.target)
    # t_target + after − t_source − before ≤ weight
    return source, target, weight + before - after


def _place(answer: DynamicAnswer, node: int) -> tuple[int, Fraction]:
    """A node as a time point and a time after it."""
    points = answer.form.stnu.points
    if node < len(points):
        return node, Fraction(0)
    index = next(index for index, start in answer.form.start.items() if start == node)
    link = answer.form.stnu.links[index]
    return points.index(link.source), link.lower or Fraction(0)


def _waits(answer: DynamicAnswer, stnu: Stnu) -> Iterable[tuple[int, int, int, Fraction | None]]:
    natural = {stnu.points.index(link.target) for link in stnu.contingents}
    for one in (*answer.form.edges, *answer.derived):
        if one.case is not Case.UPPER or one.label is None or one.weight >= 0:
            continue
        link = stnu.links[one.label]
        if not isinstance(link, ContingentLink) or one.source >= len(stnu.points) or one.source in natural:
            continue
        length = answer.form.length(one.weight)
        activation, begin = _place(answer, one.target)
        delay = None if length is None else begin - length
        yield one.source, activation, stnu.points.index(link.target), delay
