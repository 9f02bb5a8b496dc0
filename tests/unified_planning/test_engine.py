"""The engine of unified-planning, beside its built-in validators, and plans of all three kinds there and back."""

from fractions import Fraction
from importlib import import_module

import pytest

import robust
from robust.execute.convert import convert
from robust.plan.stn import STNPlan
from robust.unified_planning import from_unified_planning, register, to_unified_planning
from tests.unified_planning.test_convert import deliveries, plan_of

up = pytest.importorskip("unified_planning.shortcuts")
examples = pytest.importorskip("unified_planning.test.examples")
plans = pytest.importorskip("unified_planning.plans")
results = pytest.importorskip("unified_planning.engines.results")
pytestmark = pytest.mark.filterwarnings("ignore")

Reason = results.FailedValidationReason
KINDS = (plans.PlanKind.SEQUENTIAL_PLAN, plans.PlanKind.TIME_TRIGGERED_PLAN)

DIFFERENT = {
    "temporal_conditional": "an action reads at its end what another one deletes at the same time",
    "logistic": "a robot is loaded at the time at which it leaves",
    "basic_undef_numeric": "the goal is a value of 1, and the plan increases it from 1",
}
"""Plans that are listed as valid, and break what PDDL 2.1 demands."""


@pytest.fixture(autouse=True)
def engine():
    up.get_environment().credits_stream = None
    register()


def judged(problem, plan, **parameters):
    with up.PlanValidator(name="robust", params=parameters) as validator:
        return validator.validate(problem, plan)


def of_examples():
    for name, one in examples.get_example_problems().items():
        for valid, every in ((True, one.valid_plans), (False, one.invalid_plans)):
            yield from (pytest.param(name, one.problem, plan, valid) for plan in every if plan.kind in KINDS)


def counting(most, kind=None):
    """A problem whose only action counts, within the bounds of a type beside a constant of one, and that action."""
    problem = up.Problem("counting") if kind is None else kind("counting")
    count, done = up.Fluent("count", up.IntType(0, most)), up.Fluent("done")
    problem.add_fluent(up.Fluent("limit", up.IntType(0, 9)), default_initial_value=9)
    problem.add_fluent(count, default_initial_value=0)
    problem.add_fluent(done, default_initial_value=False)
    action = up.InstantaneousAction("tick")
    action.add_increase_effect(count, 1)
    action.add_effect(done, value=True)
    problem.add_action(action)
    problem.add_goal(done)
    return problem, plans.ActionInstance(action)


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_values_stay_in_the_bounds_of_their_types(steps):
    problem, tick = counting(2)
    plan = plans.SequentialPlan([plans.ActionInstance(tick.action) for _ in range(steps)])
    found = judged(problem, plan)
    with up.PlanValidator(name="sequential_plan_validator") as other:
        assert found.status is other.validate(problem, plan).status
    if steps > 2:
        assert [each.message for each in found.log_messages] == [
            "(count) = 3 at 3, expected a value in [0, 2], its type"
        ]
    with pytest.raises(robust.UnsupportedError, match="found bounds of the type of fluent 'count'"):
        from_unified_planning(problem, plan)
    node = plans.stn_plan.STNPlanNode
    network = plans.STNPlan(
        [(node(up.TimepointKind.GLOBAL_START), Fraction(1), Fraction(2), node(up.TimepointKind.START, tick))]
    )
    assert judged(problem, network).status is results.ValidationResultStatus.UNKNOWN


def test_other_problems_are_unknown():
    """Tasks to be decomposed and unknown facts are more than what a plan's actions do."""
    kinds = import_module("unified_planning.model.htn"), import_module("unified_planning.model.contingent_problem")
    tasks, tick = counting(2, kinds[0].HierarchicalProblem)
    tasks.task_network.add_subtask(tasks.add_task("all"))
    sensing, _ = counting(2, kinds[1].ContingentProblem)
    for problem in (tasks, sensing):
        found = judged(problem, plans.SequentialPlan([tick]))
        assert found.status is results.ValidationResultStatus.UNKNOWN
        with pytest.raises(robust.UnsupportedError, match="without tasks and unknown facts"):
            from_unified_planning(problem, plans.SequentialPlan([]))
    with pytest.raises(robust.UnsupportedError, match="found a int, expected a Problem"):
        from_unified_planning(3, plans.TimeTriggeredPlan([]))
    with pytest.raises(robust.InputError, match="found a int, expected a plan with a network, or with times"):
        to_unified_planning(3, tasks)


def test_engines_are_added_once():
    engines = list(up.get_environment().factory.engines)
    register()
    assert list(up.get_environment().factory.engines) == engines


@pytest.mark.parametrize(("name", "problem", "plan", "valid"), list(of_examples()))
def test_problems_of_unified_planning(name, problem, plan, valid):
    found = judged(problem, plan)
    if found.status is results.ValidationResultStatus.UNKNOWN:
        (message,) = found.log_messages
        assert "expected" in message.message or "supported" in message.message
        return
    assert bool(found) is (valid and name not in DIFFERENT)
    assert (found.reason is None) is bool(found)


def test_traces_are_those_of_the_built_in_validator():
    compared = 0
    for name, one in examples.get_example_problems().items():
        for plan in one.valid_plans:
            found = judged(one.problem, plan) if plan.kind is plans.PlanKind.SEQUENTIAL_PLAN else None
            if found and name != "basic_undef_bool":
                with up.PlanValidator(problem_kind=one.problem.kind, plan_kind=plan.kind) as validator:
                    expected = validator.validate(one.problem, plan).trace
                fluents = list(one.problem.initial_values)
                for ours, theirs in zip(found.trace, expected, strict=True):
                    values = [[state.get_value(each).constant_value() for each in fluents] for state in (ours, theirs)]
                    assert values[0] == values[1]
                compared += 1
    assert compared > 20


@pytest.mark.parametrize("gap", [Fraction(1, 100), Fraction(1, 100_000)])
@pytest.mark.parametrize("epsilon", [Fraction(1, 10), Fraction(1, 1000), None])
def test_separation_is_the_problem_s_own(gap, epsilon):
    a, b = up.Fluent("a"), up.Fluent("b")
    first = up.DurativeAction("first")
    first.set_fixed_duration(1)
    first.add_effect(up.EndTiming(), a, True)
    second = up.DurativeAction("second")
    second.set_fixed_duration(1)
    second.add_condition(up.StartTiming(), a)
    second.add_effect(up.EndTiming(), b, True)
    problem = up.Problem("two", initial_defaults={up.BoolType(): False})
    problem.add_fluents([a, b])
    problem.add_actions([first, second])
    problem.add_goal(b)
    problem.epsilon = epsilon
    steps = [(Fraction(0), first(), Fraction(1)), (1 + gap, second(), Fraction(1))]
    found = judged(problem, plans.TimeTriggeredPlan(steps))
    assert bool(found) is (gap >= (epsilon or Fraction(1, 1000)))
    assert found.reason is (None if found else Reason.MUTEX_CONFLICT)
    assert bool(judged(problem, plans.TimeTriggeredPlan(steps), epsilon="1/50")) is (
        gap >= (epsilon or Fraction(1, 50))
    )


def test_reasons_actions_and_traces():
    problem, late = deliveries(), deliveries(deadline=Fraction(2))
    plan = plan_of(problem)
    assert judged(problem, plan)
    dark = judged(late, plan_of(late))
    assert (dark.reason, dark.inapplicable_action.action.name) == (Reason.INAPPLICABLE_ACTION, "Drive")
    assert list(dark.trace) == [-1, Fraction(1, 3), 2]
    assert "(lit)" in dark.log_messages[0].message
    short = plans.TimeTriggeredPlan(plan.timed_actions[:1])
    unheard = judged(problem, short)
    assert (unheard.reason, unheard.inapplicable_action) == (Reason.UNSATISFIED_GOALS, None)
    assert judged(problem, plans.TimeTriggeredPlan([], problem.environment)).reason is Reason.UNSATISFIED_GOALS


def test_networks_are_judged_for_every_schedule():
    problem = deliveries()
    found = convert(*from_unified_planning(problem, plan_of(problem)))
    network = to_unified_planning(found.stn, problem)
    assert judged(problem, network)
    # The same network, but driving may take longer than the fuel lasts.
    edges = [
        (source, lower, 7 if upper == 6 else upper, target)
        for source, others in network.get_constraints().items()
        for lower, upper, target in others
    ]
    longer = plans.STNPlan([(a, lower, None if upper is None else Fraction(upper), b) for a, lower, upper, b in edges])
    refuted = judged(problem, longer)
    assert refuted.reason is Reason.INAPPLICABLE_ACTION
    assert "the plan allows this schedule: start of (drive home shop) at" in refuted.log_messages[0].message
    assert judged(problem, longer, timeout=0.0).status is results.ValidationResultStatus.UNKNOWN
    never = plans.STNPlan([*edges, (edges[0][0], Fraction(5), Fraction(4), edges[0][3])])
    assert judged(problem, never).log_messages[0].message == "the plan's network has no schedule"


@pytest.mark.parametrize("end", [None, Fraction(4)])
def test_the_end_of_the_plan_bounds_its_actions(end):
    problem = deliveries(deadline=Fraction(5))
    ours = convert(*from_unified_planning(problem, plan_of(problem, start=Fraction(1)))).stn
    network = to_unified_planning(ours, problem)
    kinds = up.TimepointKind
    constraints = network.get_constraints()
    nodes = {one for source in constraints for one in (source, *(target for _, _, target in constraints[source]))}
    plan_start = next(one for one in nodes if one.kind is kinds.GLOBAL_START)
    plan_end = plans.stn_plan.STNPlanNode(kinds.GLOBAL_END)
    actions = [one for one in nodes if one.action_instance is not None]
    drive = {one.kind: one for one in actions if one.action_instance.action.name == "Drive"}
    (honk,) = (one for one in actions if one.action_instance.action.name == "honk")
    loose = [
        (drive[kinds.START], Fraction(1), Fraction(6), drive[kinds.END]),
        (drive[kinds.END], Fraction(1, 10), None, honk),
        (plan_start, Fraction(0), end, plan_end),
    ]
    # In the dark there is no driving; only an end of the plan by 4 keeps the drive in the light.
    assert bool(judged(problem, plans.STNPlan(loose))) is (end is not None)


def bounds(plan):
    constraints = plan.get_constraints()
    return {(str(source), *bounds[:2], str(bounds[2])) for source in constraints for bounds in constraints[source]}


def test_plans_of_all_kinds_there_and_back():
    problem = deliveries()
    timed = plan_of(problem)
    assert to_unified_planning(from_unified_planning(problem, timed)[2], problem).timed_actions[0][0] == Fraction(1, 3)
    basic = examples.get_example_problems()["robot_loader"]
    sequential = basic.valid_plans[0]
    again = to_unified_planning(from_unified_planning(basic.problem, sequential)[2], basic.problem)
    assert str(again) == str(sequential)
    network = to_unified_planning(convert(*from_unified_planning(problem, timed)).stn, problem)
    read = from_unified_planning(problem, network)[2]
    assert isinstance(read, STNPlan)
    assert bounds(to_unified_planning(read, problem)) == bounds(network)
    assert robust.to_unified_planning is to_unified_planning


def test_what_is_wrong_with_parameters_of_the_engine():
    with pytest.raises(robust.InputError, match="epsilon: found 0, expected a number above 0"):
        up.PlanValidator(name="robust", params={"epsilon": 0})
