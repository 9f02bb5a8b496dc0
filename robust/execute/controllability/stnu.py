"""Simple temporal networks with uncertainty: requirement links, and contingent links whose length nature chooses.

Definitions as in Vidal and Fargier (1999) and Morris, Muscettola and Vidal (2001), with the choices that plans need:
a contingent link may have length zero or a fixed length, its length may have no upper bound, and a dispatcher may react
to an observation at the moment of the observation. Where time must pass between the two, a requirement link says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from robust.errors import InputError
from robust.numbers import format_number
from robust.plan.model import ZERO, TimePoint


@dataclass(frozen=True, slots=True)
class RequirementLink:
    """`lower ≤ t_target − t_source ≤ upper`, for the dispatcher to satisfy; None is an infinite bound."""

    source: TimePoint
    target: TimePoint
    lower: Fraction | None
    upper: Fraction | None
    origin: str = ""

    def holds(self, times: Mapping[TimePoint, Fraction]) -> bool:
        """Whether a schedule satisfies it."""
        distance = times[self.target] - times[self.source]
        return (self.lower is None or distance >= self.lower) and (self.upper is None or distance <= self.upper)

    def __str__(self) -> str:
        return self.origin or f"{self.target} - {self.source} in {bounds_text(self.lower, self.upper)}"


@dataclass(frozen=True, slots=True)
class ContingentLink:
    """`t_target = t_source + d` for a length d that nature chooses in [lower, upper]; None is no upper bound.

    `name` says whose length it is, such as the parameter; it is observed when the target happens.
    """

    source: TimePoint
    target: TimePoint
    lower: Fraction
    upper: Fraction | None
    name: str = ""
    origin: str = ""

    @property
    def is_fixed(self) -> bool:
        """Whether there is only one length."""
        return self.lower == self.upper

    def allows(self, length: Fraction) -> bool:
        """Whether nature may choose this length."""
        return length >= self.lower and (self.upper is None or length <= self.upper)

    def __str__(self) -> str:
        return self.origin or f"{self.target} - {self.source} = {self.name} in {bounds_text(self.lower, self.upper)}"


Link = RequirementLink | ContingentLink


def bounds_text(lower: Fraction | None, upper: Fraction | None) -> str:
    """`[1/3, inf]`."""
    return f"[{'-inf' if lower is None else lower}, {'inf' if upper is None else upper}]"


class Way(Enum):
    """Which bound of a link an edge of the distance graph stands for; `x → y` of weight w is `t_y − t_x ≤ w`."""

    AT_MOST = "at most"
    """source → target, the upper bound of a requirement, or of a link of fixed length."""
    AT_LEAST = "at least"
    """target → source, minus the lower bound."""
    SHORTEST = "as short as"
    """source → target, the least length of a contingent link: the lower-case edge."""
    LONGEST = "as long as"
    """target → source, minus the greatest length of a contingent link: the upper-case edge."""

    @property
    def is_forwards(self) -> bool:
        return self in {Way.AT_MOST, Way.SHORTEST}


@dataclass(frozen=True, slots=True)
class Step:
    """An edge of the distance graph: which link, by its index in :attr:`Stnu.links`, and which way."""

    link: int
    way: Way


@dataclass(frozen=True)
class Stnu:
    """A network; every time point but the ends of contingent links is the dispatcher's to execute.

    Args:
        points: all time points, :data:`robust.plan.model.ZERO` first: it happens at time zero.
        links: requirement and contingent links between them.

    Raises:
        InputError: for a link between unknown points, a contingent link that is empty or may end before it starts, two
            contingent links that end together, or contingent links that go round in a circle.
    """

    points: tuple[TimePoint, ...]
    links: tuple[Link, ...]

    def __post_init__(self) -> None:
        known = set(self.points)
        if not self.points or self.points[0] != ZERO:
            raise InputError(f"the network begins with {self.points[:1]}; expected {ZERO}")
        before: dict[TimePoint, TimePoint] = {}
        for link in self.links:
            if link.source not in known or link.target not in known:
                raise InputError(f"link {link} joins time points that are not in the network")
            if isinstance(link, ContingentLink):
                _check_contingent(link, before)
                before[link.target] = link.source
        for end in before:
            seen, point = {end}, end
            while point in before:
                point = before[point]
                if point in seen:
                    raise InputError(f"contingent links go round in a circle at {point}")
                seen.add(point)

    @property
    def contingents(self) -> tuple[ContingentLink, ...]:
        return tuple(link for link in self.links if isinstance(link, ContingentLink))

    @property
    def executable(self) -> tuple[TimePoint, ...]:
        """The time points that the dispatcher executes, zero first."""
        ends = {link.target for link in self.contingents}
        return tuple(point for point in self.points if point not in ends)

    def ends(self, step: Step) -> tuple[TimePoint, TimePoint]:
        """Where an edge of the distance graph begins and ends."""
        link = self.links[step.link]
        return (link.source, link.target) if step.way.is_forwards else (link.target, link.source)


def _check_contingent(link: ContingentLink, before: Mapping[TimePoint, TimePoint]) -> None:
    if link.lower < 0 or (link.upper is not None and link.upper < link.lower):
        bounds = bounds_text(link.lower, link.upper)
        raise InputError(f"contingent link {link} has length {bounds}; expected 0 <= lower <= upper")
    if link.target in before:
        raise InputError(f"contingent link {link} ends at {link.target}, where another one ends already")
    if link.target == ZERO:
        raise InputError(f"contingent link {link} ends at {ZERO}, which happens at time zero")


Weight = Callable[[Step], tuple[Fraction, Fraction]]
"""An edge's length as (how often infinity, the rest)."""
_ZERO = (Fraction(0), Fraction(0))


@dataclass(frozen=True, slots=True)
class NegativeCycle:
    """A closed walk, and for each lower-case edge in it, by position, how many of the next steps are negative together.

    A network is not dynamically controllable as long as the whole walk and all these pieces are negative.
    """

    steps: tuple[Step, ...]
    moats: tuple[tuple[int, int], ...]

    @property
    def pieces(self) -> tuple[tuple[Step, ...], ...]:
        """The whole walk, and the piece after each lower-case edge; equal ones once."""
        twice = self.steps + self.steps
        pieces = [self.steps, *(twice[at + 1 : at + 1 + length] for at, length in self.moats)]
        return tuple(dict.fromkeys(pieces))


def weight_in(stnu: Stnu) -> Weight:
    """The lengths of edges in a network."""

    def weight(step: Step) -> tuple[Fraction, Fraction]:
        link = stnu.links[step.link]
        bound = link.upper if step.way in {Way.AT_MOST, Way.LONGEST} else link.lower
        if bound is None:
            return (Fraction(-1 if step.way is Way.LONGEST else 1), Fraction(0))
        return (Fraction(0), bound if step.way.is_forwards else -bound)

    return weight


def total(steps: Iterable[Step], weight: Weight) -> tuple[Fraction, Fraction]:
    """The length of a walk."""
    infinite, finite = _ZERO
    for step in steps:
        more, rest = weight(step)
        infinite, finite = infinite + more, finite + rest
    return infinite, finite


def negative_cycle(steps: Sequence[Step], weight: Weight) -> NegativeCycle:
    """The cycle that a closed walk is, without circles at a contingent link that do not make it shorter.

    Raises:
        ValueError: if the walk does not refute dynamic controllability.
    """
    walk = list(steps)
    while True:
        if total(walk, weight) >= _ZERO:
            raise ValueError("the walk is not negative")
        moats = [(at, _moat(walk, at, weight)) for at, step in enumerate(walk) if step.way is Way.SHORTEST]
        breach = next((moat for moat in moats if _breaks(walk, *moat)), None)
        if breach is None:
            return NegativeCycle(tuple(walk), tuple(moats))
        walk = _without_circle(walk, breach[0])


def _moat(walk: Sequence[Step], at: int, weight: Weight) -> int:
    """The number of steps after a position that first have negative length."""
    infinite, finite = _ZERO
    for length in range(1, len(walk) + 1):
        more, rest = weight(walk[(at + length) % len(walk)])
        infinite, finite = infinite + more, finite + rest
        if (infinite, finite) < _ZERO:
            return length
    raise ValueError("a lower-case edge cannot be reduced away")


def _breaks(walk: Sequence[Step], at: int, length: int) -> bool:
    longest = Step(walk[at].link, Way.LONGEST)
    return any(walk[(at + i) % len(walk)] == longest for i in range(1, length + 1))


def _without_circle(walk: Sequence[Step], at: int) -> list[Step]:
    """The walk without its part from a lower-case edge to the upper-case edge of the same link, a circle."""
    turned = [*walk[at:], *walk[:at]]
    back = turned.index(Step(turned[0].link, Way.LONGEST))
    return turned[back + 1 :]


def explain(stnu: Stnu, cycle: NegativeCycle) -> str:
    """The cycle as a sentence: which lengths and which requirements contradict each other."""
    lengths, bounds = [], []
    for step in dict.fromkeys(cycle.steps):
        link = stnu.links[step.link]
        if isinstance(link, ContingentLink) and step.way in {Way.SHORTEST, Way.LONGEST}:
            bound = link.lower if step.way is Way.SHORTEST else link.upper
            size = "is unbounded" if bound is None else f"{step.way.value} {format_number(bound)}"
            lengths.append(f"{link.name} {size}")
        else:
            bounds.append(str(link))
    short = ", ".join(sorted(lengths))
    needed = "; ".join(dict.fromkeys(bounds))
    return f"{short} cannot be met with {needed}" if lengths else f"contradiction: {needed}"
