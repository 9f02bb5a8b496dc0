"""Strong controllability: one schedule of what the dispatcher executes that suits all lengths that nature may choose.

Each time point happens at an expression over parameters after the last time point before it that the dispatcher
executes. So each requirement is a difference between two such time points that has to be at least the worst value of an
expression over the box, and strong controllability is consistency of a simple temporal network (Vidal and Fargier,
1999). This decides it exactly, also if several links share a parameter or requirements mention some: nothing is
revealed to a fixed schedule.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.controllability.parametric import (
    Ends,
    Form,
    Length,
    ParametricStnu,
    finite_value,
    greatest,
)
from robust.irr.faces import Face
from robust.plan.model import TimePoint
from robust.plan.polynomial import Polynomial


@dataclass(frozen=True, slots=True)
class Difference:
    """`t_target − t_source ≥ form` between time points that the dispatcher executes; `origin` is the requirement."""

    source: TimePoint
    target: TimePoint
    form: Form
    origin: str


@dataclass(frozen=True)
class StrongAnswer:
    """A schedule of the dispatcher's time points, or a cycle of differences whose sum is positive.

    `endless` are faces that are infinitely far out although a difference grows with them: each may be at any finite
    place as far as that difference is concerned, but not infinitely far out.
    """

    schedule: Mapping[TimePoint, Fraction] | None
    cycle: tuple[Difference, ...]
    endless: frozenset[Face]

    @property
    def is_controllable(self) -> bool:
        return self.schedule is not None


def differences(network: ParametricStnu) -> tuple[Difference, ...]:
    """The requirements with the worst lengths of contingent links, for every box."""
    base = {point: (point, Polynomial[str]({})) for point in network.points}
    into = {link.target: link for link in network.links if link.is_contingent}

    def place(point: TimePoint) -> tuple[TimePoint, Length]:
        offset = Polynomial[str]({})
        while point in into:
            link = into[point]
            offset = offset + (link.lower or 0)
            point = link.source
        return point, offset

    base = {point: place(point) for point in network.points}
    found: dict[tuple[TimePoint, TimePoint, Form], Difference] = {}
    for link in network.links:
        if not link.is_contingent:
            (a, before), (b, after) = base[link.source], base[link.target]
            if link.lower is not None:
                form = greatest(link.lower + before - after)
                found.setdefault((a, b, form), Difference(a, b, form, link.origin))
            if link.upper is not None:
                form = greatest(after - before - link.upper)
                found.setdefault((b, a, form), Difference(b, a, form, link.origin))
    return tuple(found.values())


def strong(network: ParametricStnu, ends: Ends) -> StrongAnswer:
    """Whether one schedule suits all parameter values in a box with these ends."""
    return solve(network.points, differences(network), ends)


def solve(points: Iterable[TimePoint], needed: Iterable[Difference], ends: Ends) -> StrongAnswer:
    """The earliest schedule that satisfies the differences, or why there is none."""
    needed = tuple(needed)
    endless = frozenset(_endless(needed, ends))
    if endless:
        first = next(one for one in needed if any(face in endless for face, _ in one.form.coefficients()))
        return StrongAnswer(None, (first,), endless)
    weighted = [(one, finite_value(one.form, ends) or Fraction(0)) for one in needed]
    times = dict.fromkeys((point for one in needed for point in (one.source, one.target)), Fraction(0))
    why: dict[TimePoint, Difference] = {}
    for _ in range(len(times) + 1):
        late = None
        for one, weight in weighted:
            if times[one.source] + weight > times[one.target]:
                times[one.target] = times[one.source] + weight
                why[one.target] = one
                late = one.target
        if late is None:
            origin = times[next(iter(points))]
            return StrongAnswer({point: time - origin for point, time in times.items()}, (), frozenset())
    return StrongAnswer(None, _cycle(why, late), frozenset()) if late is not None else StrongAnswer({}, (), frozenset())


def _endless(needed: Iterable[Difference], ends: Ends) -> Iterator[Face]:
    for one in needed:
        for face, _ in one.form.coefficients():
            if ends[face] is None:
                yield face


def _cycle(why: Mapping[TimePoint, Difference], late: TimePoint) -> tuple[Difference, ...]:
    """The cycle of last causes behind a time point that never settles."""
    seen: list[TimePoint] = []
    point = late
    while point not in seen:
        seen.append(point)
        point = why[point].source
    members = seen[seen.index(point) :]
    return tuple(why[member] for member in reversed(members))
