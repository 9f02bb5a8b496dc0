"""Simple temporal networks with uncertainty as people exchange them: time points, requirement and contingent links.

A contingent link whose least length is negative may end before its source happens. Then the time of the source has to
be settled beforehand: it happens a fixed time after it was decided, and the link begins with the decision. In the
network that is examined, the decision is a time point of its own, `commit(A,C)`, `−lower` before A; from it to C,
between 0 and `upper − lower` pass. This is what the extended normal form of Morris (2014) says of such a link.

An origin, where a file names one, happens first: no other time point of the file happens before it.

:func:`network_of_plan` is the network of a plan under a box of parameter values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property

from robust.errors import InputError, Location
from robust.execute.controllable_boxes import ends_of, parametric_stnu
from robust.network import uncertain
from robust.numbers import format_number, plural, shorten
from robust.plan.model import ZERO, ParametrizedPlan, TimePoint, TimePointKind
from robust.qe.box import Box, Side

_NOTHING = Fraction(0)


@dataclass(frozen=True, slots=True)
class Link:
    """`lower ≤ target − source ≤ upper`: for the dispatcher to satisfy, or if contingent, what nature may choose.

    None is an infinite bound. `place` is where it was read.
    """

    source: str
    target: str
    lower: Fraction | None
    upper: Fraction | None
    is_contingent: bool = False
    place: Location | None = field(default=None, compare=False)

    def bound(self, side: Side) -> Fraction | None:
        return self.lower if side is Side.LOWER else self.upper

    def __str__(self) -> str:
        return f"{self.ends} in {bounds_text(self.lower, self.upper)}"

    @property
    def ends(self) -> str:
        """`A -> B`, or `A => B` if it is contingent."""
        return f"{self.source} {'=>' if self.is_contingent else '->'} {self.target}"


def bounds_text(lower: Fraction | None, upper: Fraction | None) -> str:
    """`[0.5, inf]`."""
    return f"[{'-inf' if lower is None else format_number(lower)}, {'inf' if upper is None else format_number(upper)}]"


class Role(Enum):
    """Roles of links of the examined network."""

    WHOLE = "whole"
    """A link of the network itself."""
    SETTLED = "settled"
    """From the decision to the source of a contingent link with a negative least length."""
    SPAN = "span"
    """From the decision to the end of such a link."""
    IMPLICIT = "implicit"
    """Nothing happens before the execution begins, or before the origin."""


@dataclass(frozen=True)
class Examined:
    """The network in which every contingent link has a least length of at least 0; `roles` has, for each of its links,
    what it stands for and the link of the file by number, -1 for none.
    """

    stnu: uncertain.Stnu
    roles: tuple[tuple[Role, int], ...]


@dataclass(frozen=True)
class Network:
    """A network of a file.

    Args:
        name: what messages call it, such as the name of its file.
        nodes: the names of all time points.
        links: requirement and contingent links between them.
        origin: the time point that happens first, if there is one.
        layout: where a drawing has its time points, as text.

    Raises:
        InputError: at the link that is wrong: between unknown time points, empty, contingent and without a least
            length, contingent with the same end as another one, in a circle of contingent links, or against another.
    """

    name: str
    nodes: tuple[str, ...]
    links: tuple[Link, ...]
    origin: str | None = None
    layout: Mapping[str, tuple[str, str]] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        known = set(self.nodes)
        before: dict[str, Link] = {}
        for link in self.links:
            for end in (link.source, link.target):
                if end not in known:
                    raise self.fault(link, f"found unknown time point {shorten(end)}, expected one of the nodes")
            if link.source == link.target:
                raise self.fault(link, f"found a link from {shorten(link.source)} to itself, expected two time points")
            if link.lower is not None and link.upper is not None and link.lower > link.upper:
                raise self.fault(link, f"found {link}, expected a lower bound that is not above the upper bound")
            if link.is_contingent:
                self._check_contingent(link, before)
                before[link.target] = link
        for link in before.values():
            self._check_circle(link, before)
        self._check_parallel()

    def fault(self, link: Link, message: str) -> InputError:
        """An error about a link, at its place."""
        return InputError(message, link.place or Location(self.name))

    def _check_contingent(self, link: Link, before: Mapping[str, Link]) -> None:
        if link.lower is None:
            raise self.fault(link, f"found contingent link {link}, expected a finite lower bound")
        if link.target in before:
            other = before[link.target]
            message = f"found contingent link {link.ends}, expected {link.target} to end {other.ends} only"
            raise self.fault(link, message)

    def _check_circle(self, link: Link, before: Mapping[str, Link]) -> None:
        seen, point = {link.target}, link.source
        while point in before and point not in seen:
            seen.add(point)
            point = before[point].source
        if point == link.target:
            names = " => ".join([*sorted(seen), min(seen)])
            raise self.fault(link, f"found contingent links in a circle, {names}; expected each to have a beginning")

    def _check_parallel(self) -> None:
        """Requirements between the same two time points that contradict each other."""
        ends: dict[tuple[str, str], tuple[Fraction, Link]] = {}
        for link in self.links:
            if link.is_contingent:
                continue
            for key, most in (
                ((link.source, link.target), link.upper),
                ((link.target, link.source), None if link.lower is None else -link.lower),
            ):
                if most is not None and (key not in ends or most < ends[key][0]):
                    ends[key] = most, link
        for (source, target), (most, link) in ends.items():
            if (target, source) in ends and most + ends[target, source][0] < 0:
                other = ends[target, source][1]
                message = f"found a contradiction, {link} and {other}; expected bounds that some times satisfy"
                raise self.fault(link, message)

    @property
    def contingents(self) -> tuple[Link, ...]:
        return tuple(link for link in self.links if link.is_contingent)

    @property
    def size(self) -> str:
        """`5 time points, 4 links, 2 contingent`."""
        count = plural(len(self.links), "link")
        return f"{plural(len(self.nodes), 'time point')}, {count}, {len(self.contingents)} contingent"

    def with_links(self, links: Sequence[Link]) -> Network:
        """A copy with other links."""
        return Network(self.name, self.nodes, tuple(links), self.origin, self.layout)

    @cached_property
    def decisions(self) -> Mapping[str, str]:
        """For the end of each contingent link with a negative least length, the time point at which its source is
        settled: `commit(A,C)`, with as many primes as tell it from all other time points.
        """
        taken, decisions = set(self.nodes), {}
        for link in self.contingents:
            if link.lower is not None and link.lower < 0:
                name = f"commit({link.source},{link.target})"
                while name in taken:
                    name += "'"
                taken.add(name)
                decisions[link.target] = name
        return decisions

    @cached_property
    def examined(self) -> Examined:
        """The network whose controllability is decided; the execution begins at time zero of it."""
        points = {name: instant(name) for name in (*self.nodes, *self.decisions.values())}
        links = tuple(self._examined_links(points))
        stnu = uncertain.Stnu((ZERO, *points.values()), tuple(link for _, link in links))
        return Examined(stnu, tuple(role for role, _ in links))

    def _examined_links(
        self, points: Mapping[str, TimePoint]
    ) -> Iterator[tuple[tuple[Role, int], uncertain.UncertainLink[Fraction]]]:
        make = uncertain.UncertainLink[Fraction]
        for number, link in enumerate(self.links):
            source, target, low, high = points[link.source], points[link.target], link.lower, link.upper
            if link.is_contingent and low is not None and low < 0:
                decision, width = points[self.decisions[link.target]], None if high is None else high - low
                yield (Role.SETTLED, number), make(decision, source, -low, -low, origin=str(link))
                yield (Role.SPAN, number), make(decision, target, _NOTHING, width, True, link.ends, str(link))
            else:
                name = link.ends if link.is_contingent else ""
                yield (Role.WHOLE, number), make(source, target, low, high, link.is_contingent, name, str(link))
        for name, point in points.items():
            yield (Role.IMPLICIT, -1), make(ZERO, point, _NOTHING, None, origin=f"{name} >= 0")
        for name in self.nodes:
            if self.origin is not None and name != self.origin:
                first = f"{name} not before {self.origin}"
                yield (Role.IMPLICIT, -1), make(points[self.origin], points[name], _NOTHING, None, origin=first)


def instant(name: str) -> TimePoint:
    """The time point of that name."""
    return TimePoint(TimePointKind.INSTANT, name)


# -- distance graphs ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Edge:
    """`target − source ≤ value`, an edge of the distance graph; `case` is `lower` or `upper` for the lower-case and the
    upper-case edge of a contingent link, else `ordinary`. A value of None is an infinite length, minus infinity.

    `link` is what it stands for.
    """

    source: str
    target: str
    value: Fraction | None
    case: str
    link: str

    def __str__(self) -> str:
        value = "-inf" if self.value is None else format_number(self.value)
        how = {"lower": ", as short as may be", "upper": ", as long as may be"}.get(self.case, "")
        return f"{self.target} - {self.source} <= {value}  ({self.link}{how})"


_CASES = {uncertain.Way.SHORTEST: "lower", uncertain.Way.LONGEST: "upper"}


def edges_of(network: Network, steps: Sequence[uncertain.EdgeStep]) -> Iterator[Edge]:
    """Steps of a walk through the distance graph of the examined network, by names."""
    examined = network.examined
    for step in steps:
        source, target = examined.stnu.ends(step)
        link = examined.stnu.links[step.link]
        bound = link.upper if step.way in {uncertain.Way.AT_MOST, uncertain.Way.LONGEST} else link.lower
        value = None if bound is None else bound if step.way.is_forwards else -bound
        yield Edge(str(source), str(target), value, _CASES.get(step.way, "ordinary"), link.origin)


def network_of_plan(plan: ParametrizedPlan, box: Box, name: str, origin: str = "Z") -> Network:
    """A network that is controllable if a dispatcher can carry out the plan for all values in the box.

    Durations are contingent links. Time zero is `origin`. What no network with uncertainty can express, such as a
    parameter that several links share, is taken to be independent and hidden, so the network may demand more.

    Raises:
        InputError: if an infinite end of the box makes a requirement infinitely strong, a duration may be negative, or
            requirements contradict each other for some values in the box.
        UnsupportedError: for a bound that is not linear in the parameters.
    """
    stnu = parametric_stnu(plan, box).at(ends_of(box))

    def node(point: TimePoint) -> str:
        return origin if point == ZERO else str(point)

    names = [node(point) for point in stnu.points]
    if len(set(names)) < len(names):
        raise InputError(f"found a time point called {origin!r} in the plan, expected other names")
    links = tuple(
        Link(node(link.source), node(link.target), link.lower, link.upper, link.is_contingent)
        for link in stnu.links
        if link.source != link.target and (link.lower is not None or link.upper is not None)
    )
    return Network(name, tuple(names), links, origin)
