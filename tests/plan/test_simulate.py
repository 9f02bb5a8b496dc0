"""The simulator on plans whose outcome is known by hand, and which time points it separates [docs/semantics.md]."""

from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.plan import model
from robust.plan.simulate import Violation, simulate
from robust.plan.timeline import TimedExecution
from tests.plan.building import (
    ALL,
    CONTRADICTORY,
    DURATION,
    END,
    EXAMPLES,
    OVER_ALL,
    START,
    F,
    G,
    P,
    Q,
    action,
    add,
    assign,
    at_least,
    between,
    broken,
    delete,
    delicate,
    flow,
    increase,
    instant,
    plan_of,
    reference,
    run,
    schedule_of,
    value,
)


@pytest.mark.parametrize("example", EXAMPLES, ids=[example.name for example in EXAMPLES])
def test_examples(example):
    result = simulate(example.plan, example.parameters, schedule_of(example.plan, example.times))
    assert result.network_violations == ()
    assert result.valid == (not example.broken)
    assert len(result.violations) == len(example.broken)
    for violation, expected in zip(result.violations, example.broken, strict=True):
        assert (violation if isinstance(expected, Violation) else violation.obligation) == expected


@pytest.mark.parametrize("case", OVER_ALL, ids=[case.name for case in OVER_ALL])
def test_delicate_over_all_conditions(case):
    plan, times = delicate(case)
    assert ("i act: over all c0" not in broken(run(plan, times))) is case.holds


def test_epsilon_says_how_far_apart():
    schedule = schedule_of(CONTRADICTORY, {"a": 1, "b": 2})
    assert simulate(CONTRADICTORY, {}, schedule, epsilon=Fraction(1)).valid
    assert broken(simulate(CONTRADICTORY, {}, schedule, epsilon=Fraction(3, 2))) == ["separation: a, b"]


def test_over_all_that_is_not_linear_in_time_is_unsupported():
    plan = plan_of(action("a", (ALL, at_least(value(F) * value(G), 0)), flow(F, 1), flow(G, 1)))
    with pytest.raises(UnsupportedError, match="linear in time"):
        run(plan, {"a": (0, 1)})


def test_a_rate_is_read_after_the_start_effects():
    plan = plan_of(action("a", assign(G, 3), flow(F, value(G))), goal=at_least(value(F), 6))
    assert run(plan, {"a": (0, 2)}).valid


@pytest.mark.parametrize("other", [instant("b", increase(G, 1)), action("b", flow(G, 1))])
def test_rate_that_changes_while_it_acts_is_unsupported(other):
    plan = plan_of(action("a", flow(F, value(G))), other)
    with pytest.raises(UnsupportedError, match="a \\(act\\): the rate"):
        run(plan, {"a": (0, 3), "b": (1, 2) if other.durative else 1})


def test_network_violations_are_not_obligations():
    a, literal = instant("a"), model.TimedLiteral(Fraction(2), P, True)
    plan = plan_of(
        a,
        constraints=(between(model.ZERO, a.start, 2, reference("k") + 1),),
        parameters=(model.Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(5)),),
        literals=(literal,),
    )
    assert run(plan, {"a": 4}, k=3).valid
    for time, k, violations in (
        (5, 3, ("a - .zero = 5 > k + 1 = 4",)),
        (1, 3, ("a - .zero = 1 < 2",)),
        (2, 6, ("parameter k = 6 > upper bound 5",)),
        (0, 0, ("parameter k = 0 < lower bound 1", "a - .zero = 0 < 2")),
    ):
        assert run(plan, {"a": time}, k=k).network_violations == violations
    shifted = {a.start: Fraction(-1), literal.point: Fraction(3), model.ZERO: Fraction(1)}
    result = simulate(plan, {"k": Fraction(3)}, shifted)
    assert result.network_violations[:3] == (".zero = 1, expected 0", "a = -1 < 0", "@2 = 3, expected 2")
    assert result.violations == ()
    assert not result.valid


def test_trace_lists_what_changed_at_each_happening():
    plan = plan_of(action("a", add(P), delete(Q), flow(F, 2), increase(G, 1, END)), atoms=(Q,), g=5)
    start, end = plan.instances[0].time_points
    steps = run(plan, {"a": (1, 3)}).trace
    assert [(step.time, step.points) for step in steps] == [(0, (model.ZERO,)), (1, (start,)), (3, (end,))]
    assert [step.atoms_changed for step in steps] == [(), ((P, True), (Q, False)), ()]
    assert [dict(step.fluents) for step in steps] == [{F: 0, G: 5}, {}, {F: 4, G: 6}]


def test_reading_a_fluent_without_value_is_an_error():
    condition = instant("a", (START, model.Or((model.Truth(True), at_least(value(F), 0)))))
    for pieces in (condition, instant("a", increase(F, 1)), instant("a", assign(G, value(F))), action("a", flow(F, 1))):
        plan = plan_of(pieces, f=None)
        with pytest.raises(InputError, match=r"numeric fluent \(f\) .* no value"):
            run(plan, {"a": (1, 2) if pieces.durative else 1})
    assert run(plan_of(instant("a", assign(F, 1)), f=None, goal=at_least(value(F), 1)), {"a": 1}).valid


@pytest.mark.parametrize(
    ("times", "parameters", "message"),
    [
        ({}, {"k": 1}, "no value for time point 'abc'"),
        ({"abc": 1}, {}, "no value for parameter 'k'"),
        ({"abc": 1}, {"k": 1, "kk": 1}, "unknown parameter 'kk'; did you mean 'k'"),
        ({"abd": 1}, {"k": 1}, "unknown time point 'abd'; did you mean 'abc'"),
    ],
)
def test_missing_and_unknown_names_are_errors(times, parameters, message):
    schedule = {model.TimePoint(model.TimePointKind.INSTANT, name): Fraction(time) for name, time in times.items()}
    with pytest.raises(InputError, match=message):
        simulate(plan_of(instant("abc"), parameters=(model.Parameter("k", Fraction(1)),)), parameters, schedule)


def test_duration_outside_of_an_action_is_an_error():
    with pytest.raises(InputError, match=r"\?duration"):
        run(plan_of(goal=at_least(DURATION, 0)), {})


def test_a_deep_condition_does_not_exhaust_the_stack():
    deep: model.Condition = model.Holds(P)
    for _ in range(3000):
        deep = model.Or((model.And((deep, model.Truth(True))),))
    plan = plan_of(instant("a", (START, deep)), atoms=(P,))
    assert run(plan, {"a": 1}).valid
    assert (
        TimedExecution(plan, {}, {model.ZERO: Fraction(0), plan.instances[0].start: Fraction(1)}).happenings[0].time
        == 0
    )


POURING, WAITING = action("a", flow(F, 1)), instant("w", (START, at_least(value(F), 0)))
BOUNDED = action("a", model.DurationConstraint(START, at_least(DURATION, value(F)), ">= (f)"))
KEEPING = action("a", (ALL, model.And((model.Holds(P), at_least(value(F), 0)))))


def separated(*instances: model.ActionInstance, literals: tuple[model.TimedLiteral, ...] = ()) -> list[str]:
    """The mutex pairs of a plan, found by putting everything at one time."""
    time = literals[0].time if literals else Fraction(1)
    plan = plan_of(*instances, atoms=(P, Q), literals=literals)
    schedule = {point: time for i in plan.instances for point in i.time_points}
    labels = broken(simulate(plan, {}, schedule))
    return [label.removeprefix("separation: ") for label in labels if label.startswith("separation")]


@pytest.mark.parametrize(
    ("a", "b", "pairs"),
    [
        (instant("a", (START, model.Holds(P))), instant("b", add(P)), ["a, b"]),
        (instant("a", (START, model.Holds(P, False))), instant("b", delete(P)), ["a, b"]),
        (instant("a", (START, model.Or((model.Holds(Q), model.Holds(P))))), instant("b", add(P)), ["a, b"]),
        (instant("a", add(P)), instant("b", delete(P)), ["a, b"]),
        (instant("a", add(P), delete(P)), instant("b", add(P)), ["a, b"]),
        (instant("a", add(Q, START, model.Holds(P))), instant("b", add(P)), ["a, b"]),
        (instant("a", add(P, START, at_least(value(F), 9))), instant("b", delete(P)), ["a, b"]),
        (instant("a", assign(F, 1)), instant("b", assign(F, 1)), ["a, b"]),
        (instant("a", assign(F, 1)), instant("b", increase(F, 1)), ["a, b"]),
        (instant("a", (START, at_least(value(F), -9))), instant("b", increase(F, 1)), ["a, b"]),
        (instant("a", increase(G, value(F))), instant("b", increase(F, 1)), ["a, b"]),
        (instant("a", add(P, START, at_least(value(F), 0))), instant("b", increase(F, 1)), ["a, b"]),
        (instant("a", add(P)), instant("b", add(P)), []),
        (instant("a", delete(P)), instant("b", delete(P)), []),
        (instant("a", (START, model.Holds(P))), instant("b", (START, model.Holds(P, False)), add(Q)), []),
        (instant("a", increase(F, 1)), instant("b", increase(F, -2)), []),
        (instant("a", assign(F, 1)), instant("b", assign(G, 1)), []),
        (instant("a", (START, at_least(value(F), 0))), instant("b", increase(G, value(F))), []),
        (KEEPING, instant("b", delete(P), assign(F, 1)), []),
        (action("a", (END, model.Holds(P))), instant("b", delete(P)), ["a.end, b"]),
        (BOUNDED, instant("b", increase(F, 1)), ["a.start, b"]),
        (POURING, instant("b", increase(F, 1)), []),
        (POURING, action("b", flow(F, 1)), []),
        (POURING, instant("b", assign(F, 1)), ["a.start, b", "a.end, b"]),
        (POURING, WAITING, ["a.start, w", "a.end, w"]),
        (action("a", flow(F, value(G))), instant("b", increase(G, 1)), ["a.start, b", "a.end, b"]),
    ],
)
def test_mutex_pairs(a, b, pairs):
    assert separated(a, b) == pairs


def test_timed_literals_are_mutex_with_actions_but_not_with_each_other():
    reader = instant("a", (START, model.Holds(P)), (START, at_least(value(F), 0)))
    at_two = (
        model.TimedLiteral(Fraction(2), P, False),
        model.TimedLiteral(Fraction(2), P, True),
        model.TimedLiteral(Fraction(2), F, Fraction(4)),
    )
    assert separated(reader, literals=at_two) == ["a, @2"]
    assert separated(instant("a", increase(F, 1)), literals=at_two[2:]) == ["a, @2"]
    assert separated(instant("a", add(P)), literals=at_two[1:2]) == []
    assert separated(instant("a", delete(P)), literals=at_two[1:2]) == ["a, @2"]
