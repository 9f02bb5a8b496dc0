"""The simulator on plans whose outcome is known by hand, and which time points it separates [docs/semantics.md]."""

from __future__ import annotations

from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Assignment,
    Comparison,
    Condition,
    DurationConstraint,
    Expression,
    Holds,
    NumericEffect,
    Or,
    Parameter,
    ParameterReference,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    TimePoint,
    TimePointKind,
    Timing,
    Truth,
)
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Violation, simulate
from robust.plan.timeline import Execution
from tests.plan.building import (
    ALL,
    DURATION,
    END,
    EPSILON,
    START,
    F,
    G,
    P,
    Q,
    Times,
    above,
    action,
    add,
    assign,
    at_least,
    at_most,
    broken,
    delete,
    different,
    flow,
    increase,
    instant,
    number,
    plan_of,
    run,
    schedule_of,
    separated,
    value,
)

# --- reading just before ----------------------------------------------------------------------------------------------


def test_condition_does_not_see_an_effect_at_its_own_time():
    plan = plan_of(instant("a", add(P)), instant("b", (START, Holds(P))))
    assert broken(run(plan, {"a": 1, "b": 1})) == ["b act: c0", "separation: a, b"]


def test_condition_sees_an_earlier_effect():
    plan = plan_of(instant("a", add(P)), instant("b", (START, Holds(P))))
    assert run(plan, {"a": 1, "b": Fraction(1001, 1000)}).valid


def test_action_does_not_see_its_own_start_effect_at_start_but_at_its_end():
    plan = plan_of(action("a", (START, Holds(P, False)), (END, Holds(P)), add(P)))
    assert run(plan, {"a": (0, 1)}).valid


def test_continuous_change_up_to_the_time_point_is_read():
    plan = plan_of(action("a", (END, at_least(value(F), 6)), flow(F, 2)))
    assert run(plan, {"a": (0, 3)}).valid
    assert run(plan, {"a": (0, Fraction(29, 10))}).violations == (
        Violation("a act: at end c0", Fraction(29, 10), "(f) = 29/5 < 6"),
    )


def test_simultaneous_effects_all_read_the_state_just_before():
    swap = plan_of(
        instant("a", assign(F, value(G)), assign(G, value(F))),
        f=1,
        g=2,
        goal=And((at_least(value(F), 2), at_most(value(G), 1))),
    )
    assert run(swap, {"a": 1}).valid


def test_assignments_come_before_increases():
    plan = plan_of(instant("a", increase(F, 3), assign(F, 5)), goal=Comparison(value(F) - 8, Relation.EQUAL))
    assert run(plan, {"a": 1}).valid


def test_an_add_wins_over_a_delete():
    assert run(plan_of(instant("a", add(P), delete(P)), goal=Holds(P)), {"a": 1}).valid
    both = plan_of(instant("a", add(P)), instant("b", delete(P)), goal=Holds(P))
    assert broken(run(both, {"a": 1, "b": 1})) == ["separation: a, b"]


def test_conditional_effects_read_their_condition_just_before():
    plan = plan_of(instant("a", add(Q), add(P, START, Holds(Q))), goal=Holds(P))
    assert broken(run(plan, {"a": 1})) == ["goal: goal"]
    assert run(plan_of(*plan.instances, atoms=(Q,), goal=Holds(P)), {"a": 1}).valid


def test_conditional_numeric_effect_at_end_reads_continuous_change():
    effect = NumericEffect(END, G, Assignment.ASSIGN, number(1), at_least(value(F), 4))
    plan = plan_of(action("a", effect, flow(F, 2)), goal=at_least(value(G), 1))
    assert run(plan, {"a": (0, 2)}).valid
    assert broken(run(plan, {"a": (0, 1)})) == ["goal: goal"]


# --- over all ---------------------------------------------------------------------------------------------------------


def test_over_all_holds_by_the_start_effect_of_the_action_itself():
    plan = plan_of(action("a", (ALL, Holds(P)), add(P), delete(P, END)))
    assert run(plan, {"a": (0, 1)}).valid


def test_over_all_sees_effects_of_others_at_its_start():
    plan = plan_of(action("a", (ALL, Holds(P))), instant("b", delete(P)), atoms=(P,))
    assert run(plan, {"a": (1, 2), "b": 1}).violations == (
        Violation("a act: over all c0", Fraction(3, 2), "(p) is false"),
    )


def test_over_all_does_not_see_effects_at_its_end():
    plan = plan_of(action("a", (ALL, Holds(P))), instant("b", delete(P)), atoms=(P,))
    assert run(plan, {"a": (1, 2), "b": 2}).valid
    assert run(plan, {"a": (1, 2), "b": 3}).valid


def test_over_all_sees_happenings_inside():
    plan = plan_of(action("a", (ALL, Holds(P))), instant("b", delete(P)), instant("c", add(P)), atoms=(P,))
    inside = run(plan, {"a": (1, 3), "b": 2, "c": Fraction(2001, 1000)})
    assert broken(inside) == ["a act: over all c0"]
    assert inside.violations[0].time == 2


def test_over_all_is_vacuous_without_an_interior():
    plan = plan_of(action("a", (ALL, Truth(False))))
    assert run(plan, {"a": (1, 1)}).valid
    assert broken(run(plan, {"a": (2, 1)})) == ["a act: non-negative duration"]
    assert broken(run(plan, {"a": (1, 2)})) == ["a act: over all c0"]


@pytest.mark.parametrize(
    ("initial", "rate", "condition", "holds"),
    [
        (0, 1, above(value(F), 0), True),  # 0 only in the limit at start
        (2, -1, above(value(F), 0), True),  # 0 only in the limit at end
        (2, -1, above(value(F), Polynomial.constant(Fraction(1, 100))), False),
        (0, 0, above(value(F), 0), False),  # 0 throughout
        (-1, 1, different(value(F), 0), False),  # passes 0 in the middle
        (0, 1, different(value(F), 0), True),
        (-2, 1, different(value(F), 0), True),
        (-1, 1, Comparison(value(F), Relation.EQUAL), False),
        (0, 0, Comparison(value(F), Relation.EQUAL), True),
        (0, 2, at_most(value(F), 4), True),
        (0, 2, at_most(value(F), 3), False),
    ],
)
def test_over_all_with_continuous_change_on_an_open_interval(initial, rate, condition, holds):
    plan = plan_of(action("a", (ALL, condition), flow(F, rate)), f=initial)
    assert run(plan, {"a": (1, 3)}).valid is holds


def test_strict_bound_touched_at_a_happening_inside_is_violated():
    down, up = action("down", flow(F, -1)), action("up", flow(F, 1))
    watch = action("watch", (ALL, above(value(F), 0)))
    plan = plan_of(down, up, watch, f=1)
    times: Times = {"down": (0, 1), "up": (Fraction(11, 10), 2), "watch": (0, 2)}
    assert run(plan, times).violations == (Violation("watch act: over all c0", Fraction(1), "(f) = 0 <= 0"),)
    assert run(plan, {**times, "watch": (0, 1)}).valid


def test_breakpoint_between_two_slopes_is_the_minimum():
    down, up = action("down", flow(F, -2)), action("up", flow(F, 3))
    watch = action("watch", (ALL, at_least(value(F), 1)))
    times: Times = {"down": (0, 2), "up": (2, 3), "watch": (1, 4)}
    assert broken(run(plan_of(down, up, watch, f=5), times)) == []
    failing = run(plan_of(down, up, watch, f=4), times)
    assert [(v.obligation, v.time) for v in failing.violations] == [("watch act: over all c0", Fraction(7, 4))]


def test_concurrent_continuous_effects_add_up():
    fill, drain = action("fill", flow(F, 3)), action("drain", flow(F, -1))
    plan = plan_of(fill, drain, goal=Comparison(value(F) - 2, Relation.EQUAL))
    assert run(plan, {"fill": (0, 2), "drain": (1, 5)}).valid


def test_disjunctive_over_all_may_change_its_reason():
    either = Or((at_most(value(F), 1), at_least(value(F), 1)))
    gap = Or((at_most(value(F), 1), at_least(value(F), number(Fraction(101, 100)))))
    hole = Or((above(number(1), value(F)), above(value(F), 1)))
    for condition, holds in ((either, True), (gap, False), (hole, False)):
        assert run(plan_of(action("a", (ALL, condition), flow(F, 1))), {"a": (0, 2)}).valid is holds
    assert run(plan_of(action("a", (ALL, hole), flow(F, 1))), {"a": (0, 2)}).violations == (
        Violation("a act: over all c0", Fraction(1), "1 <= (f) = 1 and (f) = 1 <= 1"),
    )


def test_disjunction_of_an_atom_and_a_moving_fluent():
    watch = action("a", (ALL, Or((Holds(P), at_most(value(F), 1)))), flow(F, 1))
    plan = plan_of(watch, instant("b", add(P)))
    assert run(plan, {"a": (0, 4), "b": 1}).valid
    assert broken(run(plan, {"a": (0, 4), "b": Fraction(11, 10)})) == ["a act: over all c0"]


def test_over_all_that_is_not_linear_in_time_is_unsupported():
    plan = plan_of(action("a", (ALL, at_least(value(F) * value(G), 0)), flow(F, 1), flow(G, 1)))
    with pytest.raises(UnsupportedError, match="linear in time"):
        run(plan, {"a": (0, 1)})
    one_moving = plan_of(action("a", (ALL, at_least(value(F) * value(G), 0)), flow(F, 1)), g=2)
    assert run(one_moving, {"a": (0, 1)}).valid


# --- durations and rates ----------------------------------------------------------------------------------------------


def test_duration_is_end_minus_start_in_conditions_and_effects():
    plan = plan_of(
        action("a", (START, at_least(value(F), DURATION)), increase(G, DURATION, END)), f=3, goal=at_least(value(G), 3)
    )
    assert run(plan, {"a": (1, 4)}).valid
    assert run(plan, {"a": (1, 5)}).violations == (
        Violation("a act: at start c0", Fraction(1), "(f) = 3 < ?duration = 4"),
    )


def test_duration_constraints_read_fluents_at_their_timing():
    def limited(timing: Timing) -> ActionInstance:
        return action("a", DurationConstraint(timing, at_most(DURATION - value(F), 0), "<= (f)"), increase(F, 1))

    assert broken(run(plan_of(limited(START), f=2), {"a": (0, 3)})) == ["a act: duration <= (f)"]
    assert run(plan_of(limited(END), f=2), {"a": (0, 3)}).valid


def test_zero_length_action_separates_its_own_mutex_ends():
    plan = plan_of(action("a", add(P), (END, Holds(P))))
    assert broken(run(plan, {"a": (1, 1)})) == ["a act: at end c1", "separation: a.start, a.end"]
    assert run(plan_of(action("a", add(P))), {"a": (1, 1)}).valid


def test_an_assignment_restarts_a_continuously_changing_fluent():
    plan = plan_of(action("a", flow(F, 1)), instant("b", assign(F, 10)), goal=Comparison(value(F) - 12, Relation.EQUAL))
    assert run(plan, {"a": (0, 5), "b": 3}).valid


def test_rate_may_be_a_parameter_or_a_constant_fluent():
    rate: Expression = Polynomial.variable(ParameterReference("k")) * value(G)
    goal = Comparison(value(F) - 12, Relation.EQUAL)
    plan = plan_of(action("a", flow(F, rate)), g=2, goal=goal, parameters=(Parameter("k", Fraction(3)),))
    assert run(plan, {"a": (0, 2)}, k=3).valid


def test_rate_is_read_after_the_start_effects():
    plan = plan_of(action("a", assign(G, 3), flow(F, value(G))), goal=at_least(value(F), 6))
    assert run(plan, {"a": (0, 2)}).valid


@pytest.mark.parametrize("other", [instant("b", increase(G, 1)), action("b", flow(G, 1))])
def test_rate_that_changes_while_it_acts_is_unsupported(other):
    plan = plan_of(action("a", flow(F, value(G))), other)
    with pytest.raises(UnsupportedError, match="a \\(act\\): the rate"):
        run(plan, {"a": (0, 3), "b": (1, 2) if other.durative else 1})


# --- timed literals, goal, network ------------------------------------------------------------------------------------


def test_timed_literals_change_atoms_and_fluents():
    literals = (TimedLiteral(Fraction(2), P, True), TimedLiteral(Fraction(2), F, Fraction(7)))
    plan = plan_of(instant("a", (START, Holds(P)), (START, at_least(value(F), 7))), literals=literals)
    assert run(plan, {"a": 3}).valid
    assert broken(run(plan, {"a": 1})) == ["a act: c0", "a act: c1"]


def test_goal_is_read_after_all_time_points():
    literal = TimedLiteral(Fraction(9), P, False)
    assert broken(run(plan_of(instant("a", add(P)), goal=Holds(P), literals=(literal,)), {"a": 1})) == ["goal: goal"]
    assert run(plan_of(instant("a", add(P)), goal=Holds(P)), {"a": 1}).valid
    assert run(plan_of(goal=Holds(P, False)), {}).valid


def test_network_violations_are_not_obligations():
    k: Expression = Polynomial.variable(ParameterReference("k"))
    a = instant("a")
    literal = TimedLiteral(Fraction(2), P, True)
    plan = plan_of(
        a,
        constraints=(TemporalConstraint(ZERO, a.start, number(2), k + 1),),
        parameters=(Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(5)),),
        literals=(literal,),
    )
    assert run(plan, {"a": 4}, k=3).valid
    assert run(plan, {"a": 5}, k=3).network_violations == ("a - .zero = 5 > k + 1 = 4",)
    assert run(plan, {"a": 1}, k=3).network_violations == ("a - .zero = 1 < 2",)
    assert run(plan, {"a": 2}, k=6).network_violations == ("parameter k = 6 > upper bound 5",)
    assert run(plan, {"a": 0}, k=0).network_violations == (
        "parameter k = 0 < lower bound 1",
        "a - .zero = 0 < 2",
    )
    shifted = {a.start: Fraction(-1), literal.point: Fraction(3), ZERO: Fraction(1)}
    result = simulate(plan, {"k": Fraction(3)}, shifted)
    assert result.network_violations[:3] == (".zero = 1, expected 0", "a = -1 < 0", "@2 = 3, expected 2")
    assert result.violations == ()
    assert not result.valid


# --- trace and errors -------------------------------------------------------------------------------------------------


def test_trace_lists_what_changed_at_each_happening():
    plan = plan_of(action("a", add(P), delete(Q), flow(F, 2), increase(G, 1, END)), atoms=(Q,), g=5)
    start, end = plan.instances[0].time_points
    steps = run(plan, {"a": (1, 3)}).trace
    assert [(step.time, step.points) for step in steps] == [(0, (ZERO,)), (1, (start,)), (3, (end,))]
    assert [step.atoms_changed for step in steps] == [(), ((P, True), (Q, False)), ()]
    assert [dict(step.fluents) for step in steps] == [{F: 0, G: 5}, {}, {F: 4, G: 6}]


def test_reading_a_fluent_without_value_is_an_error():
    condition = instant("a", (START, Or((Truth(True), at_least(value(F), 0)))))
    for pieces in (condition, instant("a", increase(F, 1)), instant("a", assign(G, value(F))), action("a", flow(F, 1))):
        plan = plan_of(pieces, f=None)
        with pytest.raises(InputError, match=r"numeric fluent \(f\) .* no value"):
            run(plan, {"a": (1, 2) if pieces.durative else 1})
    assert run(plan_of(instant("a", assign(F, 1)), f=None, goal=at_least(value(F), 1)), {"a": 1}).valid


def test_missing_and_unknown_names_are_errors():
    plan = plan_of(instant("abc"), parameters=(Parameter("k", Fraction(1)),))
    with pytest.raises(InputError, match="no value for time point 'abc'"):
        run(plan, {}, k=1)
    with pytest.raises(InputError, match="no value for parameter 'k'"):
        run(plan, {"abc": 1})
    with pytest.raises(InputError, match="unknown parameter 'kk'; did you mean 'k'"):
        run(plan, {"abc": 1}, k=1, kk=1)
    with pytest.raises(InputError, match="unknown time point 'abd'; did you mean 'abc'"):
        simulate(plan, {"k": Fraction(1)}, {TimePoint(TimePointKind.INSTANT, "abd"): Fraction(1)})


def test_duration_outside_of_an_action_is_an_error():
    with pytest.raises(InputError, match=r"\?duration"):
        run(plan_of(goal=at_least(DURATION, 0)), {})


def test_a_deep_condition_does_not_exhaust_the_stack():
    deep: Condition = Holds(P)
    for _ in range(3000):
        deep = Or((And((deep, Truth(True))),))
    plan = plan_of(instant("a", (START, deep)), atoms=(P,))
    assert run(plan, {"a": 1}).valid
    assert Execution(plan, {}, {ZERO: Fraction(0), plan.instances[0].start: Fraction(1)}).happenings[0].time == 0


def test_an_empty_disjunction_is_false():
    assert run(plan_of(goal=Or(())), {}).violations == (Violation("goal: goal", Fraction(0), "the condition is false"),)


WAITING = instant("w", (START, at_least(value(F), 0)))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (instant("a", (START, Holds(P))), instant("b", add(P))),
        (instant("a", (START, Holds(P, False))), instant("b", delete(P))),
        (instant("a", (START, Or((Holds(Q), Holds(P))))), instant("b", add(P))),
        (instant("a", add(P)), instant("b", delete(P))),
        (instant("a", add(P), delete(P)), instant("b", add(P))),
        (instant("a", add(Q, START, Holds(P))), instant("b", add(P))),
        (instant("a", add(P, START, at_least(value(F), 9))), instant("b", delete(P))),
        (instant("a", assign(F, 1)), instant("b", assign(F, 1))),
        (instant("a", assign(F, 1)), instant("b", increase(F, 1))),
        (instant("a", (START, at_least(value(F), -9))), instant("b", increase(F, 1))),
        (instant("a", increase(G, value(F))), instant("b", increase(F, 1))),
        (instant("a", add(P, START, at_least(value(F), 0))), instant("b", increase(F, 1))),
    ],
)
def test_mutex_of_instantaneous_actions(a, b):
    assert separated(a, b) == ["a, b"]


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (instant("a", add(P)), instant("b", add(P))),
        (instant("a", delete(P)), instant("b", delete(P))),
        (instant("a", (START, Holds(P))), instant("b", (START, Holds(P, False)), add(Q))),
        (instant("a", increase(F, 1)), instant("b", increase(F, -2))),
        (instant("a", assign(F, 1)), instant("b", assign(G, 1))),
        (instant("a", (START, at_least(value(F), 0))), instant("b", increase(G, value(F)))),
    ],
)
def test_commuting_actions_are_not_mutex(a, b):
    assert separated(a, b) == []


def test_over_all_conditions_are_no_reads():
    assert (
        separated(action("a", (ALL, And((Holds(P), at_least(value(F), 0))))), instant("b", delete(P), assign(F, 1)))
        == []
    )


def test_end_conditions_read_at_the_end_only():
    assert separated(action("a", (END, Holds(P))), instant("b", delete(P))) == ["a.end, b"]


def test_duration_constraints_read_at_their_timing():
    duration = DurationConstraint(START, at_least(DURATION, value(F)), ">= (f)")
    assert separated(action("a", duration), instant("b", increase(F, 1))) == ["a.start, b"]


def test_continuous_effects_increase_at_both_ends():
    pouring = action("a", flow(F, 1))
    assert separated(pouring, instant("b", increase(F, 1))) == []
    assert separated(pouring, action("b", flow(F, 1))) == []
    assert separated(pouring, instant("b", assign(F, 1))) == ["a.start, b", "a.end, b"]
    assert separated(pouring, WAITING) == ["a.start, w", "a.end, w"]


def test_rates_are_read_at_both_ends():
    assert separated(action("a", flow(F, value(G))), instant("b", increase(G, 1))) == ["a.start, b", "a.end, b"]


def test_timed_literals_are_mutex_with_actions_but_not_with_each_other():
    reader = instant("a", (START, Holds(P)), (START, at_least(value(F), 0)))
    at_two = (
        TimedLiteral(Fraction(2), P, False),
        TimedLiteral(Fraction(2), P, True),
        TimedLiteral(Fraction(2), F, Fraction(4)),
    )
    assert separated(reader, literals=at_two) == ["a, @2"]
    assert separated(instant("a", increase(F, 1)), literals=at_two[2:]) == ["a, @2"]
    near = (at_two[0], TimedLiteral(Fraction(20001, 10000), P, True))
    assert run(plan_of(atoms=(P,), literals=near, goal=Holds(P)), {}).valid


def test_separation_of_exactly_epsilon_is_enough():
    plan = plan_of(instant("a", add(P)), instant("b", delete(P)))
    assert run(plan, {"a": 1 + EPSILON, "b": 1}).valid
    close = run(plan, {"a": 1 + EPSILON / 2, "b": 1})
    detail = "a = 2001/2000 and b = 1 are 1/2000 apart, less than 1/1000"
    assert close.violations == (Violation("separation: a, b", Fraction(2001, 2000), detail),)
    schedule = schedule_of(plan, {"a": 1, "b": 2})
    assert broken(simulate(plan, {}, schedule, epsilon=Fraction(3, 2))) == ["separation: a, b"]
