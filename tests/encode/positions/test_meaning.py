"""What plans mean in the positions encoding, case by case [docs/semantics.md]."""

from __future__ import annotations

from fractions import Fraction

import pytest

from robust.api import check
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer, CheckResult
from robust.plan.model import (
    ZERO,
    And,
    Comparison,
    Condition,
    Holds,
    Or,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    TimePoint,
)
from robust.plan.polynomial import Polynomial
from tests.plan.building import (
    ALL,
    DURATION,
    END,
    START,
    F,
    G,
    P,
    Q,
    above,
    action,
    add,
    assign,
    at_least,
    at_most,
    delete,
    different,
    flow,
    increase,
    instant,
    number,
    plan_of,
    value,
)


def between(source: TimePoint, target: TimePoint, lower: int | None, upper: int | None) -> TemporalConstraint:
    low, high = (None if bound is None else number(bound) for bound in (lower, upper))
    return TemporalConstraint(source, target, low, high)


def at(point: TimePoint, time: int) -> TemporalConstraint:
    return between(ZERO, point, time, time)


def decide(plan: ParametrizedPlan, **at_values: int) -> CheckResult:
    return check(plan, encoding="positions", every=True, at={n: Fraction(v) for n, v in at_values.items()})


def refuted(plan: ParametrizedPlan, **at_values: int) -> list[str]:
    """The obligations that break, each with a counterexample that the simulator confirms."""
    result = decide(plan, **at_values)
    broken = [name for name, answer in result.obligations.items() if answer is Answer.REFUTED]
    assert broken == list(result.counterexamples)
    assert Answer.UNKNOWN not in result.obligations.values()
    return broken


# -- one happening ---------------------------------------------------------------------------------------------------


def test_simultaneous_increases_all_count() -> None:
    points = [instant(f"i{n}", increase(F, n)) for n in (1, 2, 3)]
    times = tuple(at(i.start, 1) for i in points)
    exactly = Comparison(value(F) - 6, Relation.EQUAL)
    assert refuted(plan_of(*points, constraints=times, goal=exactly)) == []


def test_an_add_wins_over_a_delete_of_the_same_point() -> None:
    both = instant("i", delete(P), add(P))
    assert refuted(plan_of(both, goal=Holds(P))) == []
    assert refuted(plan_of(both, atoms=(P,), goal=Holds(P))) == []


def test_an_increase_comes_after_an_assignment_of_the_same_point() -> None:
    both = instant("i", increase(F, 2), assign(F, 5))
    assert refuted(plan_of(both, f=1, goal=Comparison(value(F) - 7, Relation.EQUAL))) == []


def test_effects_read_the_state_before_their_happening() -> None:
    swap = instant("i", assign(F, value(G)), assign(G, value(F)))
    goal = And((Comparison(value(F) - 2, Relation.EQUAL), Comparison(value(G) - 1, Relation.EQUAL)))
    assert refuted(plan_of(swap, f=1, g=2, goal=goal)) == []


def test_conditions_of_later_positions_read_the_state_before_the_first_of_their_time() -> None:
    early, late = instant("a", add(P)), instant("b", (START, Holds(P)))
    apart = plan_of(early, late, constraints=(at(early.start, 1), at(late.start, 2)))
    assert refuted(apart) == []
    together = plan_of(early, late, constraints=(at(early.start, 1), at(late.start, 1)))
    assert refuted(together) == ["separation: a, b"]


@pytest.mark.parametrize("watcher_first", [True, False])
def test_over_all_conditions_begin_after_the_happening_of_the_start(watcher_first: bool) -> None:
    adder, watcher = instant("a", add(P)), action("w", (ALL, Holds(P)))
    pair = (watcher, adder) if watcher_first else (adder, watcher)
    times = (at(adder.start, 1), at(watcher.start, 1), at(watcher.end, 3))
    assert refuted(plan_of(*pair, constraints=times)) == []


def test_conditional_effects_chain_through_happenings() -> None:
    first, second = instant("a", add(P)), instant("b", add(Q, condition=Holds(P)))
    ordered = (at(first.start, 1), between(first.start, second.start, 1, None))
    assert refuted(plan_of(first, second, constraints=ordered, goal=Holds(Q))) == []
    free = (at(first.start, 1), between(ZERO, second.start, 0, 2))
    assert refuted(plan_of(first, second, constraints=free, goal=Holds(Q))) == ["separation: a, b", "goal: goal"]


# -- orders ----------------------------------------------------------------------------------------------------------


def test_unordered_points_are_tried_in_every_order() -> None:
    adder, deleter = instant("a", add(P)), instant("d", delete(P))
    reader = action("r", (ALL, Holds(P)))
    assert "goal: goal" in refuted(plan_of(adder, deleter, goal=Holds(P)))
    following = (between(deleter.start, adder.start, 1, None),)
    assert refuted(plan_of(adder, deleter, constraints=following, goal=Holds(P))) == []
    kept = (at(adder.start, 1), between(adder.start, reader.start, 1, 5), between(reader.start, reader.end, 1, 5))
    plan = plan_of(adder, reader, deleter, constraints=(*kept, at(deleter.start, 9)))
    assert refuted(plan) == ["r act: over all c0"]
    plan = plan_of(adder, reader, deleter, constraints=(*kept, at(deleter.start, 11)))
    assert refuted(plan) == []


def test_timed_literals_happen_at_their_times() -> None:
    window = (TimedLiteral(Fraction(2), P, True), TimedLiteral(Fraction(4), P, False))
    user = instant("u", (START, Holds(P)))
    inside = plan_of(user, literals=window, constraints=(between(ZERO, user.start, 3, 3),))
    assert refuted(inside) == []
    late = plan_of(user, literals=window, constraints=(between(ZERO, user.start, 3, 5),))
    assert refuted(late) == ["separation: u, @4", "u act: c0"]


# -- continuous change -----------------------------------------------------------------------------------------------


def tank(*pieces: Condition, rate: int = -1, f: int = 3, length: int = 3) -> ParametrizedPlan:
    run = action("r", *((ALL, piece) for piece in pieces), flow(F, rate))
    return plan_of(run, f=f, constraints=(at(run.start, 1), between(run.start, run.end, length, length)))


@pytest.mark.parametrize(
    ("condition", "length", "holds"),
    [
        (at_least(value(F), 0), 3, True),
        (at_least(value(F), 0), 4, False),
        (above(value(F), 0), 3, True),
        (above(value(F), 0), 4, False),
        (different(value(F), 0), 3, True),
        (different(value(F), 0), 4, False),
        (different(value(F), 3), 3, True),
        (Comparison(value(F) - 3, Relation.EQUAL), 3, False),
        (Or((above(value(F), 2), Holds(P))), 1, True),
        (Or((above(value(F), 2), Holds(P))), 2, False),
        (Or((above(value(F), 2), at_most(value(F), 2))), 3, True),
        (Or((above(value(F), 2), above(number(2) - value(F), 0))), 3, False),
        (Or((above(value(F), 2), above(number(2) - value(F), 0))), 1, True),
    ],
)
def test_over_all_conditions_hold_throughout_the_open_interval(condition: Condition, length: int, holds: bool) -> None:
    assert refuted(tank(condition, length=length)) == ([] if holds else ["r act: over all c0"])


def test_a_strict_condition_must_hold_at_happenings_inside() -> None:
    """It falls to zero exactly when it starts to rise again: an instant of the interval."""
    fall, rise, watch = action("a", flow(F, -1)), action("b", flow(F, 1)), action("w", (ALL, above(value(F), 0)))
    times = (at(watch.start, 0), at(watch.end, 9), at(fall.start, 1), at(fall.end, 4))
    apart = (*times, at(rise.start, 5), at(rise.end, 8))
    assert refuted(plan_of(watch, fall, rise, f=3, constraints=apart)) == ["w act: over all c0"]
    touching = (*times, between(ZERO, rise.start, 3, 3), at(rise.end, 8))
    assert refuted(plan_of(watch, fall, rise, f=3, constraints=touching)) == []


def test_rates_of_simultaneous_effects_add_up() -> None:
    one, two = action("a", flow(F, 1)), action("b", flow(F, 2))
    times = (at(one.start, 1), at(one.end, 5), between(ZERO, two.start, 2, 3), between(two.start, two.end, 1, 1))
    assert refuted(plan_of(one, two, constraints=times, goal=Comparison(value(F) - 6, Relation.EQUAL))) == []


def test_assignments_interrupt_continuous_change() -> None:
    run, reset = action("r", flow(F, 1)), instant("s", assign(F, 10))
    times = (at(run.start, 1), at(run.end, 6), between(ZERO, reset.start, 3, 4))
    goal = And((at_least(value(F), 12), at_most(value(F), 13)))
    assert refuted(plan_of(run, reset, constraints=times, goal=goal)) == []
    assert refuted(plan_of(run, reset, constraints=times, goal=at_least(value(F), 13))) == ["goal: goal"]


def test_a_rate_may_be_a_parameter_where_elapsed_times_are_fixed() -> None:
    rate = Polynomial.variable(ParameterReference("k"))
    run, read = action("r", flow(F, rate)), instant("x", (START, at_most(value(F), 4)))
    parameters = (Parameter("k", Fraction(1)),)
    times = (at(run.start, 1), at(run.end, 6), at(read.start, 3))
    plan = plan_of(run, read, constraints=times, goal=at_most(value(F), 10), parameters=parameters)
    assert refuted(plan, k=2) == []
    assert refuted(plan, k=3) == ["x act: c0", "goal: goal"]
    floating = (*times[:2], between(ZERO, read.start, 2, 3))
    with pytest.raises(UnsupportedError, match="rate k times an elapsed time that is not constant"):
        decide(plan_of(run, read, constraints=floating, goal=at_most(value(F), 10), parameters=parameters))


def test_a_rate_that_changes_is_not_supported() -> None:
    run, write = action("r", flow(F, value(G))), instant("w", increase(G, 1))
    with pytest.raises(UnsupportedError, match=r"its rate reads \(g\), which the plan changes"):
        decide(plan_of(run, write, goal=at_least(value(F), 0)))


# -- durations and errors --------------------------------------------------------------------------------------------


def test_duration_is_the_time_between_start_and_end() -> None:
    run = action("r", (END, at_most(DURATION, 4)), increase(F, DURATION, END))
    plan = plan_of(run, constraints=(between(run.start, run.end, 2, 5),), goal=at_least(value(F), 3))
    assert refuted(plan) == ["r act: at end c0", "goal: goal"]


def test_a_negative_duration_breaks_its_own_obligation_only() -> None:
    run = action("r", (ALL, Holds(P)), flow(F, 1))
    plan = plan_of(run, constraints=(at(run.start, 5), at(run.end, 3)), goal=at_least(value(F), 1))
    assert refuted(plan) == ["r act: non-negative duration"]


def test_a_fluent_without_a_value_is_an_error() -> None:
    with pytest.raises(InputError, match=r"\(f\) has no initial value"):
        decide(plan_of(instant("i", (START, at_least(value(F), 0)), increase(F, 1)), f=None))


def test_a_plan_without_instances_has_its_initial_state() -> None:
    assert refuted(plan_of(goal=Holds(P))) == ["goal: goal"]
    assert refuted(plan_of(atoms=(P,), goal=Holds(P))) == []
