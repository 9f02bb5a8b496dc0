"""Rounded times made exact: the least shift against feasibility of difference constraints, on networks and on plans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from math import floor
from random import Random
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.encode.interface import EPSILON
from robust.execute.convert import convert
from robust.execute.distances import InvalidPlanError
from robust.execute.snap import NearSchedules, least_shift
from robust.irr.check import Answer
from robust.numbers import format_number
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import parse_timed_plan
from tests.execute.plans import text_of
from tests.network.oracles import has_schedule

Constraint = tuple[int, int, Fraction]
"""(a, b, w): t_b − t_a ≥ w; point 0 is time zero."""


def within(printed: Sequence[Fraction], shifts: Sequence[Fraction]) -> list[Constraint]:
    """Every point within its distance of where it was printed."""
    near = list(enumerate(zip(printed[1:], shifts, strict=True), start=1))
    return [*((0, i, time - shift) for i, (time, shift) in near), *((i, 0, -time - shift) for i, (time, shift) in near)]


def near(constraints: Sequence[Constraint], printed: Sequence[Fraction], shift: Fraction) -> bool:
    """Whether there is a schedule in which every point is that near to where it was printed."""
    return has_schedule(range(len(printed)), [*constraints, *within(printed, [shift] * (len(printed) - 1))])


# -- networks ----------------------------------------------------------------------------------------------------------


@st.composite
def networks(draw):
    """Printed times, even ones, and bounds that some times satisfy, mostly."""
    size = draw(st.integers(2, 6))
    times = [0, *(draw(st.integers(0, 20)) for _ in range(size - 1))]
    printed = [0, *(2 * draw(st.integers(max(0, time // 2 - 3), time // 2 + 3)) for time in times[1:])]
    points, slack = st.integers(0, size - 1), st.integers(-1, 6)
    drawn = draw(st.lists(st.tuples(points, points, slack), max_size=3 * size))
    return printed, [(a, b, times[b] - times[a] - less) for a, b, less in drawn if a != b]


@settings(max_examples=400, deadline=None, derandomize=True)
@given(networks())
def test_the_least_shift_is_feasible_and_nothing_below_it_is(drawn):
    printed, bounds = drawn
    shift = least_shift(bounds, printed)
    if shift is None:
        assert not has_schedule(range(len(printed)), bounds)
        return
    assert near(bounds, printed, shift)
    assert not shift or not near(bounds, printed, shift - 1)
    low, high = ([0, *(time + sign * shift for time in printed[1:])] for sign in (-1, 1))
    windows = NearSchedules(bounds, low, high)
    assert windows.possible
    times = windows.place(printed)
    assert all(times[b] - times[a] >= weight for a, b, weight in bounds)
    assert max(abs(a - b) for a, b in zip(times, printed, strict=True)) == shift


# -- plans -------------------------------------------------------------------------------------------------------------


class Step(NamedTuple):
    """A step at its exact times; an instantaneous one has no duration."""

    start: Fraction
    text: str
    duration: Fraction | None


def drawn_plan(random: Random) -> tuple[str, list[Step], list[tuple[int, int]]]:
    """Jobs on machines, each after another one, as early as they can be or a little later: a valid plan, exactly.

    The problem, the steps, and pairs of steps the first of which ends ε or more before the other starts.
    """
    count, machines = random.randint(2, 7), random.randint(1, 3)
    speeds = [random.choice([1, 2, 3, 7, 9, Fraction(5, 2), 11]) for _ in range(machines)]
    work = [Fraction(random.randint(1, 400), random.choice([1, 1, 10])) for _ in range(count)]
    begin = Fraction(random.choice([0, 0, 1, 1000, 9999]))
    steps = [Step(begin, "(light)", None)]
    pairs, facts = [], ["(done j0)", "(= (work j0) 0)"]
    for job in range(1, count + 1):
        machine, parent = random.randrange(machines), random.randrange(job)
        earlier = [place for place in range(1, job) if f" m{machine} " in steps[place].text]
        before = {*(earlier[-1:]), *([parent] if parent else [])}
        ends = [steps[place].start + (steps[place].duration or 0) for place in before]
        gap = random.choice([EPSILON, EPSILON, EPSILON * 2, Fraction(random.randint(1, 2000), 700)])
        start = max([begin, *(end + max(gap, EPSILON) for end in ends)])
        steps.append(Step(start, f"(do j{job} m{machine} j{parent})", work[job - 1] / speeds[machine]))
        pairs += [(place, job) for place in before]
        facts.append(f"(= (work j{job}) {format_number(work[job - 1])})")
    facts += [f"(= (speed m{i}) {format_number(Fraction(speed))}) (free m{i})" for i, speed in enumerate(speeds)]
    jobs, names = (
        " ".join(f"{kind}{i}" for i in range(number)) for kind, number in (("j", count + 1), ("m", machines))
    )
    goal = " ".join(f"(done j{i})" for i in range(1, count + 1))
    problem = f"(define (problem day) (:domain workshop) (:objects {jobs} - job {names} - machine)"
    return f"{problem} (:init {' '.join(facts)}) (:goal (and {goal})))", steps, pairs


def shown(value: Fraction, decimals: int, *, truncated: bool) -> str:
    """With this number of decimals, or, if it is zero, six significant digits filled up to eight decimals."""
    kept = decimals or next((places for places in range(8) if value * 10**places >= 10**5), 8)
    whole = floor(value * 10**kept + (0 if truncated else Fraction(1, 2)))
    text = str(whole).rjust(kept + 1, "0")
    return f"{text[: len(text) - kept]}.{text[len(text) - kept :]}".ljust(0 if decimals else len(text) + 9 - kept, "0")


def rounded_plan(seed: int) -> str:
    """Draw a plan, print it, read and convert it, and compare the shift; says what became of it."""
    random = Random(seed)  # noqa: S311 (not for secrets)
    problem_text, steps, pairs = drawn_plan(random)
    decimals, truncated = random.choice([0, 0, 3, 3, 3, 4, 5, 8]), random.random() < 0.5
    text = ""
    for step in steps:
        length = "" if step.duration is None else f" [{shown(step.duration, decimals, truncated=truncated)}]"
        text += f"{shown(step.start, decimals, truncated=truncated)}: {step.text}{length}\n"
    timed = parse_timed_plan(text)
    # Node i + 1 is the start of step i; durations are exact, and what was printed first comes first, ends at a tie.
    lengths = [step.duration or Fraction(0) for step in steps]
    printed = [Fraction(0), *(step.time for step in timed.steps)]
    order: list[Constraint] = [(0, node, Fraction(0)) for node in range(1, len(printed))]
    order += [(early + 1, late + 1, EPSILON + lengths[early]) for early, late in pairs]
    order += within(printed, [min(unit, EPSILON) for unit, _ in timed.units])
    kept = all(printed[early + 1] + (timed.steps[early].duration or 0) <= printed[late + 1] for early, late in pairs)
    domain = parse_domain(text_of("workshop.pddl"))
    problem = parse_problem(problem_text, domain)
    if not kept or not has_schedule(range(len(printed)), order):
        with pytest.raises(InvalidPlanError):
            convert(domain, problem, timed)
        return "refused"
    conversion = convert(domain, problem, timed)
    assert conversion.check.answer is Answer.PROVED
    instances, times = conversion.plan.instances, conversion.schedule
    starts = [times[instance.start] for instance in instances]
    for length, instance in zip(lengths, instances, strict=True):
        assert not instance.durative or times[instance.end] - times[instance.start] == length
    assert all(starts[late] - starts[early] >= EPSILON + lengths[early] for early, late in pairs)
    shift = max(abs(a - b) for a, b in zip(starts, printed[1:], strict=True))
    assert near(order, printed, shift)
    assert not shift or not near(order, printed, shift - Fraction(1, 10**12))
    change = max(abs(length - (step.duration or 0)) for length, step in zip(lengths, timed.steps, strict=True))
    assert conversion.snapped.shift == max(shift, change)
    return "moved" if shift else "as printed"


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(100), 20), pytest.param(range(100, 600), 100, marks=pytest.mark.slow)]
)
def test_roundings(seeds, least):
    assert Counter(map(rounded_plan, seeds))["moved"] >= least
