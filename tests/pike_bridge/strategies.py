"""Hypothesis strategies for small networks with choices, well-formed in the sense of [PIKE, Definition 2.1].

`networks()` draws unstructured ones: events with random guards over choices, of which some are nested, and constraints
between them whose guards entail those of their events. `structured()` draws programs for the builder.
"""

from __future__ import annotations

from fractions import Fraction

from hypothesis import strategies as st

from robust.pike_bridge.builder import Element, act, build, choose, parallel, sequence, within
from robust.pike_bridge.model import ALWAYS, Assignment, Choice, Constraint, Event, Guard, Tpnu

NAMES = ("x", "y", "z")
VALUES = ("1", "2", "3")

bounds = st.one_of(st.integers(-4, 6).map(Fraction), st.fractions(min_value=-4, max_value=6, max_denominator=4))


@st.composite
def choices(draw: st.DrawFn, most: int = 3) -> tuple[Choice, ...]:
    """Up to three choices of one to three values."""
    count = draw(st.integers(1, most))
    return tuple(
        Choice(NAMES[at], VALUES[: draw(st.sampled_from((2, 2, 2, 3, 1)))], draw(st.booleans()), None)
        for at in range(count)
    )


@st.composite
def guards(draw: st.DrawFn, drawn: tuple[Choice, ...], base: Guard = ALWAYS) -> Guard:
    """Assignments to some variables, on top of those of `base`."""
    taken = {assignment.variable for assignment in base}
    result = set(base)
    for choice in drawn:
        if choice.name not in taken and draw(st.sampled_from((True, False, False))):
            result.add(Assignment(choice.name, draw(st.sampled_from(choice.domain))))
    return frozenset(result)


@st.composite
def networks(draw: st.DrawFn, events: int = 5, constraints: int = 9) -> Tpnu:
    """Up to three choices, a handful of events with random guards, and random constraints between them."""
    drawn = draw(choices())
    points = tuple(Event(f"e{at}", draw(guards(drawn))) for at in range(draw(st.integers(1, events))))
    constraint = constraints_between(drawn, points)
    found = draw(st.lists(constraint, min_size=1, max_size=constraints))
    return Tpnu("drawn", drawn, points, tuple(entry for entry in found if entry is not None), ())


@st.composite
def constraints_between(draw: st.DrawFn, drawn: tuple[Choice, ...], points: tuple[Event, ...]) -> Constraint | None:
    """A constraint between two of the events; None if their guards contradict each other."""
    source, target = draw(st.sampled_from(points)), draw(st.sampled_from(points))
    both = source.guard | target.guard
    if len({assignment.variable for assignment in both}) < len(both):
        return None
    lower, upper = draw(st.tuples(st.none() | bounds, st.none() | bounds))
    if lower is not None and upper is not None and lower > upper:
        lower, upper = upper, lower
    return Constraint(source.name, target.name, lower, upper, draw(guards(drawn, both)))


@st.composite
def structured(draw: st.DrawFn, activities: int = 6, most: int = 3) -> Tpnu:
    """A program with up to three choices, nested or not, built into a network."""
    names = iter(NAMES[:most])
    element = _element(draw, draw(st.integers(1, activities)), names)
    upper = draw(st.none() | st.integers(1, 12))
    return build("drawn", element if upper is None else within(element, upper=upper), epsilon=Fraction(1, 4))


def _element(draw: st.DrawFn, size: int, names: object) -> Element:
    if size <= 1:
        lower = draw(st.integers(1, 4))
        return act("(move)", lower, draw(st.none() | st.integers(lower, 6)))
    left = draw(st.integers(1, size - 1))
    kind = draw(st.sampled_from(("sequence", "parallel", "choice", "choice")))
    name = next(names, None) if kind == "choice" else None  # type: ignore[call-overload]
    first, second = _element(draw, left, names), _element(draw, size - left, names)
    if name is not None:
        element: Element = choose(name, {"1": first, "2": second})
    else:
        element = parallel(first, second) if kind == "parallel" else sequence(first, second)
    upper = draw(st.none() | st.none() | st.integers(2, 8))
    return element if upper is None else within(element, upper=upper)
