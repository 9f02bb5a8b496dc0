"""Simple temporal networks with uncertainty as people exchange them: time points, requirement and contingent links.

A contingent link whose least length is negative may end before its source happens. Then the time of the source has to
be settled beforehand: it happens a fixed time after it was decided, and the link begins with the decision. In the
network that is examined, the decision is a time point of its own, `commit(A,C)`, `−lower` before A; from it to C,
between 0 and `upper − lower` pass. This is what the extended normal form of Morris (2014) says of such a link.

An origin, where a file names one, happens first: no other time point of the file happens before it.

:func:`network_of_plan` is the network of a plan under a box of parameter values.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import TypeVar

from robust.errors import InputError, InputWarning, Location, UnsupportedError
from robust.execute.controllable_boxes import ends_of, parametric_stnu
from robust.network import uncertain
from robust.numbers import format_number, plural, shorten
from robust.plan.model import ZERO, ParametrizedPlan, TimePoint, TimePointKind
from robust.probability.distributions import Below, Distribution
from robust.qe.box import Box, Side

_NOTHING = Fraction(0)


@dataclass(frozen=True, slots=True)
class Link:
    """`lower ≤ target − source ≤ upper`: for the dispatcher to satisfy, or if contingent, what nature may choose.

    None is an infinite bound; bounds are in the unit of the file. `place` is where it was read; `distribution` is that
    of a random length, if it is known.
    """

    source: str
    target: str
    lower: Fraction | None
    upper: Fraction | None
    is_contingent: bool = False
    place: Location | None = field(default=None, compare=False)
    distribution: Distribution | None = None

    def bound(self, side: Side) -> Fraction | None:
        """The bound on one side; None is infinite."""
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


Label = frozenset[tuple[str, str]]
"""A conjunction of propositions or choices with their values."""


@dataclass(frozen=True, slots=True)
class ChoicePoint:
    """A choice with its values, made at a time point: observed there or, if `is_controllable`, the executive's."""

    name: str
    values: tuple[str, ...]
    node: str
    is_controllable: bool = False


@dataclass(frozen=True)
class ConditionalNetwork:
    """A network of which time points and links exist only where their labels hold: a CSTN, CSTNU or CCTP.

    Args:
        name: what messages call it, such as the name of its file.
        nodes: all time points, with their labels.
        links: requirement and contingent links, with their labels.
        choices: what labels are about.
        origin: the time point that happens first, if there is one.
    """

    name: str
    nodes: Mapping[str, Label]
    links: tuple[tuple[Link, Label], ...]
    choices: tuple[ChoicePoint, ...]
    origin: str | None = None

    @property
    def size(self) -> str:
        """`5 time points, 4 links, 2 contingent, 1 choice`."""
        count = f"{plural(len(self.nodes), 'time point')}, {plural(len(self.links), 'link')}"
        return f"{count}, {len(self.contingents)} contingent, {plural(len(self.choices), 'choice')}"

    @property
    def contingents(self) -> tuple[Link, ...]:
        """The contingent links, whatever their labels."""
        return tuple(link for link, _ in self.links if link.is_contingent)

    def mapped(self, change: Callable[[Link], Link]) -> ConditionalNetwork:
        """A copy with each link changed."""
        return replace(self, links=tuple((change(link), label) for link, label in self.links))


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
        InputError: at the link that is wrong: between unknown time points, or contingent and empty, without a least
            length, with the same end as another one, or in a circle of contingent links. Requirements may contradict
            each other: then the network is not controllable.
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
            if link.is_contingent:
                self._check_contingent(link, before)
                before[link.target] = link
        for link in before.values():
            self._check_circle(link, before)

    def __repr__(self) -> str:
        return f"<network {self.name!r}: {self.size}>"

    def fault(self, link: Link, message: str) -> InputError:
        """An error about a link, at its place."""
        return InputError(message, link.place or Location(self.name))

    def _check_contingent(self, link: Link, before: Mapping[str, Link]) -> None:
        if link.source == link.target:
            raise self.fault(link, f"found contingent link {link.ends}, expected two time points")
        if link.lower is None:
            raise self.fault(link, f"found contingent link {link}, expected a finite lower bound")
        if link.upper is not None and link.lower > link.upper:
            raise self.fault(link, f"found {link}, expected a lower bound that is not above the upper bound")
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

    @property
    def contingents(self) -> tuple[Link, ...]:
        """The contingent links."""
        return tuple(link for link in self.links if link.is_contingent)

    @property
    def size(self) -> str:
        """`5 time points, 4 links, 2 contingent`."""
        count = plural(len(self.links), "link")
        return f"{plural(len(self.nodes), 'time point')}, {count}, {len(self.contingents)} contingent"

    def mapped(self, change: Callable[[Link], Link]) -> Network:
        """A copy with each link changed."""
        return self.with_links(tuple(map(change, self.links)))

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
        InputError: if an infinite end of the box makes a requirement infinitely strong, or a duration may be negative.
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


Asked = TypeVar("Asked", Network, ConditionalNetwork, Network | ConditionalNetwork)

# -- what formats share ------------------------------------------------------------------------------------------------


def note_unused(file: str, keys: Collection[str]) -> None:
    """Say once what of a file was passed over."""
    if keys:
        passed = f"passed over what has no meaning for networks: {', '.join(keys)}"
        warnings.warn(InputWarning(f"{Location(file)}: {passed}"), stacklevel=4)


def with_origin(network: Network, name: str) -> Network:
    """A network whose origin has the name that a format gives it.

    Raises:
        UnsupportedError: if another node has that name.
    """
    if network.origin == name:
        return network
    if name in network.nodes:
        raise UnsupportedError(f"found node {name!r} that is not the origin, expected another name in this format")
    if network.origin is None:
        return network
    new = {node: name if node == network.origin else node for node in network.nodes}
    links = tuple(replace(link, source=new[link.source], target=new[link.target]) for link in network.links)
    layout = {new[node]: at for node, at in network.layout.items()}
    return Network(network.name, tuple(new.values()), links, name, layout)


def normal(mean: Fraction, deviation: Fraction) -> Distribution:
    """The distribution of a length with that mean and deviation, never below 0; without deviation, the one length."""
    if deviation == 0:
        return Distribution("constant", {"value": max(mean, Fraction(0))}, Below.CLIP)
    return Distribution("normal", {"mean": mean, "deviation": deviation, "minimum": Fraction(0)}, Below.CLIP)


def with_quantile(network: Asked, quantile: Fraction) -> Asked:
    """A network whose random lengths are between two quantiles of their distributions.

    Each length is below its interval with probability `quantile` at most, and above it as well; intervals are as narrow
    as multiples of a millionth of a distribution's width allow.

    Args:
        network: the network, with or without choices.
        quantile: how probable it is at most that a length is below its interval; 0: the interval is the whole support.

    Returns:
        The network with such intervals, and without distributions.

    Raises:
        InputError: unless the quantile is at least 0 and below 1/2.
    """
    if not 0 <= quantile < Fraction(1, 2):
        raise InputError(f"found {quantile}, expected a quantile of at least 0 and below 1/2", Location("quantile"))

    def narrowed(link: Link) -> Link:
        if not link.is_contingent or link.distribution is None or quantile == 0:
            return link
        lower, upper = link.distribution.interval(quantile)
        return replace(link, lower=lower, upper=upper)

    return network.mapped(narrowed)
