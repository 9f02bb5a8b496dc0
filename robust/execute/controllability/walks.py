"""Why a network is not dynamically controllable: a semi-reducible negative cycle, which anybody can check.

A closed walk of negative length through the distance graph refutes dynamic controllability if each of its lower-case
edges is followed by a piece of negative length, up to the first such piece without the upper-case edge of the same
contingent link: what comes after it has to be decided before the link's length is known (Morris, 2006: *A structural
characterization of temporal dynamic controllability*; reaction at the moment of an observation is allowed).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.controllability.stnu import ContingentLink, Step, Stnu, Way
from robust.plan.numerals import format_number

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
