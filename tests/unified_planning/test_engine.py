"""Problems and plans of unified-planning in and out, with exact numbers, and its engine beside built-in validators."""

import ast
import re
import sys
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import pytest

import robust
from robust import Answer, InputError, InvalidPlanError, UnsupportedError, validate
from robust.execute.convert import Settings, convert
from robust.plan.load import assemble
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.parameters import parse_specs
from robust.plan.stn import STNPlan
from robust.unified_planning import from_unified_planning, register, to_unified_planning

up = pytest.importorskip("unified_planning.shortcuts")
plans = pytest.importorskip("unified_planning.plans")
examples = pytest.importorskip("unified_planning.test.examples")
results = pytest.importorskip("unified_planning.engines.results")
pytestmark = pytest.mark.filterwarnings("ignore")

Reason, Status = results.FailedValidationReason, results.ValidationResultStatus
KINDS = (plans.PlanKind.SEQUENTIAL_PLAN, plans.PlanKind.TIME_TRIGGERED_PLAN)
THIRD = Fraction(1, 3)
DIFFERENT = {
    "temporal_conditional": "an action reads at its end what another one deletes at the same time",
    "logistic": "a robot is loaded at the time at which it leaves",
    "basic_undef_numeric": "the goal is a value of 1, and the plan increases it from 1",
}
"""Plans that are listed as valid, and break what PDDL 2.1 demands."""


def deliveries(deadline=Fraction(20)):
    """A van drives and honks; driving takes a third of a minute a mile and burns fuel all the while."""
    place = up.UserType("Place")
    at = up.Fluent("at", up.BoolType(), p=place)
    lit, heard = (up.Fluent(name, up.BoolType()) for name in ("lit", "heard"))
    fuel, miles = up.Fluent("fuel", up.RealType()), up.Fluent("miles", up.RealType(), a=place, b=place)
    drive = up.DurativeAction("Drive", a=place, b=place)
    a, b = drive.parameter("a"), drive.parameter("b")
    drive.set_closed_duration_interval(up.Times(THIRD, miles(a, b)), up.Times(2, miles(a, b)))
    drive.add_condition(up.StartTiming(), at(a))
    drive.add_condition(up.OpenTimeInterval(up.StartTiming(), up.EndTiming()), lit)
    drive.add_condition(up.OpenTimeInterval(up.StartTiming(), up.EndTiming()), up.GE(fuel, THIRD))
    drive.add_effect(up.StartTiming(), at(a), False)
    drive.add_effect(up.EndTiming(), at(b), True)
    drive.add_decrease_continuous_effect(up.ClosedTimeInterval(up.StartTiming(), up.EndTiming()), fuel, 1)
    honk = up.InstantaneousAction("honk", a=place)
    honk.add_precondition(at(honk.parameter("a")))
    honk.add_precondition(up.Not(heard))
    honk.add_effect(heard, True)
    problem = up.Problem("deliveries", initial_defaults={up.BoolType(): False})
    problem.add_fluents([at, lit, heard, fuel, miles])
    problem.add_actions([drive, honk])
    home, shop = problem.add_objects([up.Object("home", place), up.Object("Shop", place)]) or problem.all_objects
    initial = {at(home): True, lit: True, fuel: Fraction(22, 3)}
    initial |= {miles(x, y): 3 for x in (home, shop) for y in (home, shop)}
    for fluent, value in initial.items():
        problem.set_initial_value(fluent, value)
    problem.add_timed_effect(up.GlobalStartTiming(deadline), lit, False)
    problem.add_goal(heard)
    problem.add_goal(at(shop))
    return problem


def plan_of(problem, start=THIRD, duration=Fraction(7, 3)):
    home, shop = (up.ObjectExp(one) for one in problem.all_objects)
    steps = [
        (start, plans.ActionInstance(problem.action("Drive"), (home, shop)), duration),
        (start + duration + THIRD, plans.ActionInstance(problem.action("honk"), (shop,)), None),
    ]
    return plans.TimeTriggeredPlan(steps)


def converted(problem, **options):
    return convert(*from_unified_planning(problem, plan_of(problem)), Settings(**options))


def edges(network):
    """(source, lower, upper, target) of a plan with a network."""
    return [(source, *one) for source, others in network.get_constraints().items() for one in others]


def test_numbers_stay_exact():
    problem = deliveries(deadline=Fraction(61, 3))
    domain, read, timed = from_unified_planning(problem, plan_of(problem))
    assert [(one.time, one.duration) for one in timed.steps] == [(THIRD, Fraction(7, 3)), (Fraction(3), None)]
    assert [(one.action, one.arguments) for one in timed.steps] == [("drive", ("home", "shop")), ("honk", ("shop",))]
    assert (read.atoms, read.fluents[Fluent("fuel")]) == ({Atom("at", ("home",)), Atom("lit")}, Fraction(22, 3))
    assert read.timed_literals == (TimedLiteral(Fraction(61, 3), Atom("lit"), False),)
    assert set(domain.actions) == {"drive", "honk"}


def test_conversion_there_and_back():
    problem = deliveries()
    assert validate(*from_unified_planning(problem, plan_of(problem))).valid
    conversion = converted(problem, free_durations=True)
    assert conversion.check.answer is Answer.PROVED
    returned = to_unified_planning(conversion.stn, problem)
    bounds = {
        tuple(f"{node.action_instance.action.name} {node.kind.name}" for node in (source, target)): (lower, upper)
        for source, lower, upper, target in edges(returned)
        if source.action_instance and target.action_instance
    }
    # From above, fuel: 22/3 - d >= 1/3; the domain allows 1 to 6.
    assert bounds["Drive START", "Drive END"] == (Fraction(1), Fraction(6))
    assert bounds["Drive END", "honk START"][0] == Fraction(1, 1000)
    assert returned.is_consistent()
    parametrized = converted(problem, specs=parse_specs(["duration:drive"])).stn
    assert [one.name for one in parametrized.parameters] == ["dur_n0"]
    exact = to_unified_planning(parametrized, problem, {"dur_n0": Fraction(10, 7)})
    assert Fraction(10, 7) in {bound for _, lower, upper, _ in edges(exact) for bound in (lower, upper)}


def test_plans_of_all_kinds_there_and_back():
    problem = deliveries()
    timed = plan_of(problem)
    assert to_unified_planning(from_unified_planning(problem, timed)[2], problem).timed_actions[0][0] == THIRD
    basic = examples.get_example_problems()["robot_loader"]
    sequential = basic.valid_plans[0]
    again = to_unified_planning(from_unified_planning(basic.problem, sequential)[2], basic.problem)
    assert str(again) == str(sequential)
    network = to_unified_planning(converted(problem, free_durations=True).stn, problem)
    read = from_unified_planning(problem, network)[2]
    assert isinstance(read, STNPlan)
    before, after = (
        {(str(source), lower, upper, str(target)) for source, lower, upper, target in edges(one)}
        for one in (network, to_unified_planning(read, problem))
    )
    assert before == after
    assert robust.to_unified_planning is to_unified_planning


def test_what_cannot_be_converted_is_refused(monkeypatch):
    problem = deliveries()
    environment = problem.environment
    # Which unified-planning finds valid.
    with pytest.raises(InvalidPlanError, match=r"invalid plan: found 'n0 drive: over all \(lit\)' broken at time 2"):
        converted(deliveries(deadline=Fraction(2)))
    with pytest.raises(InputError, match="found a ContingentPlan, expected a sequential, "):
        from_unified_planning(problem, plans.ContingentPlan(None, environment))
    with pytest.raises(InputError, match="empty plan: found no step"):
        convert(*from_unified_planning(problem, plans.TimeTriggeredPlan([], environment)))
    with pytest.raises(InputError, match="found action 'drive', expected one of the problem"):
        to_unified_planning(converted(problem).stn, up.Problem("empty"))
    problem.add_timed_goal(up.GlobalEndTiming(), problem.fluent("lit")())
    with pytest.raises(
        UnsupportedError, match=r"found a timed goal over '\[end\]', expected times after the plan's st"
    ):
        from_unified_planning(problem, plan_of(problem))
    monkeypatch.setitem(sys.modules, "unified_planning.plans", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'robust-plans\[up\]'"):
        from_unified_planning(None, None)


@pytest.fixture(autouse=True)
def engine():
    """Added once, however often it is registered."""
    up.get_environment().credits_stream = None
    register()
    engines = list(up.get_environment().factory.engines)
    register()
    assert list(up.get_environment().factory.engines) == engines


def judged(problem, plan, **parameters):
    with up.PlanValidator(name="robust", params=parameters) as validator:
        return validator.validate(problem, plan)


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
    verdict = judged(problem, plan)
    with up.PlanValidator(name="sequential_plan_validator") as other:
        assert verdict.status is other.validate(problem, plan).status
    if steps > 2:
        said = [each.message for each in verdict.log_messages]
        assert said == ["(count) = 3 at 3, expected a value in [0, 2], its type"]
    if steps < 3:
        assert robust.convert(*from_unified_planning(problem, plan)).check.answer is Answer.PROVED
    else:
        with pytest.raises(InvalidPlanError, match=r"\(<= \(\+ \(count\) 1\) 2\)"):
            robust.convert(*from_unified_planning(problem, plan))
    node, zero = plans.stn_plan.STNPlanNode, plans.stn_plan.STNPlanNode(up.TimepointKind.GLOBAL_START)
    ticks = [node(up.TimepointKind.START, plans.ActionInstance(tick.action)) for _ in range(steps)]
    apart = plans.STNPlan(
        [(zero, Fraction(n), Fraction(n) + Fraction(1, 2), one) for n, one in enumerate(ticks, start=1)]
    )
    assert judged(problem, apart).status is (Status.VALID if steps < 3 else Status.INVALID)
    if steps == 2:  # at once they are as good, which conditions do not say
        close = plans.STNPlan([(zero, Fraction(1), Fraction(2), one) for one in ticks])
        assert "bounds of types that are not decided" in judged(problem, close).log_messages[0].message


TIMED = [
    name
    for name, one in examples.get_example_problems().items()
    if any(plan.kind is plans.PlanKind.TIME_TRIGGERED_PLAN for plan in one.valid_plans)
]


@pytest.mark.parametrize("name", TIMED)
def test_round_trips_of_examples(name):
    """Plan, network, STN plan, verdict: the simultaneous happenings of two examples are moved apart by ε."""
    one = examples.get_example_problems()[name]
    epsilon = one.problem.epsilon or Fraction(1, 1000)
    plan = one.valid_plans[0]
    if name == "robot_non_linear_continuous_1":
        with pytest.raises(
            UnsupportedError, match=r"n0 \(move l1 l2\): the rate of its continuous effect on \(battery_ch"
        ):
            robust.convert(*from_unified_planning(one.problem, plan))
        return
    conversion = robust.convert(*from_unified_planning(one.problem, plan), epsilon=epsilon, tolerance=epsilon)
    network = to_unified_planning(conversion.stn, one.problem)
    actions = {node.action_instance.action for node in network.get_constraints() if node.action_instance is not None}
    assert actions <= set(one.problem.actions)
    assert judged(one.problem, network).status is Status.VALID


def relay(needed, deadline=None):
    """An action of 6 gives up what it holds after 1.5, has it again 2 before its end, and needs light on the way."""
    held, lit, warm = up.Fluent("held"), up.Fluent("lit"), up.Fluent("warm")
    pass_on = up.DurativeAction("pass_on")
    pass_on.set_fixed_duration(6)
    pass_on.add_condition(up.StartTiming(), held)
    pass_on.add_condition(needed, lit)
    pass_on.add_effect(up.StartTiming() + Fraction(3, 2), held, False)
    pass_on.add_effect(up.EndTiming() - 2, held, True)
    pass_on.add_effect(up.EndTiming(), warm, True)
    problem = up.Problem("relay", initial_defaults={up.BoolType(): False})
    problem.add_fluents([held, lit, warm])
    problem.set_initial_value(held, True)
    problem.set_initial_value(lit, True)
    problem.add_action(pass_on)
    problem.add_timed_effect(up.GlobalStartTiming(Fraction(17, 2)), lit, False)
    problem.add_goal(warm)
    if deadline is not None:
        problem.add_timed_goal(up.GlobalStartTiming(deadline), warm)
    return problem, pass_on


@pytest.mark.parametrize("begin", [Fraction(half, 2) + THIRD for half in range(1, 18)])
def test_what_happens_in_the_middle_of_actions(begin):
    """Against the built-in validator: the second action begins anywhere in or after the first one."""
    needed = up.LeftOpenTimeInterval(up.StartTiming() + 1, up.EndTiming() - 1)
    for deadline in (None, Fraction(13, 2), Fraction(11, 2)):
        problem, pass_on = relay(needed, deadline)
        steps = [(start, plans.ActionInstance(pass_on), Fraction(6)) for start in (Fraction(1, 4), begin)]
        plan = plans.TimeTriggeredPlan(steps)
        verdict = judged(problem, plan, epsilon="1/100")
        with up.PlanValidator(problem_kind=problem.kind, plan_kind=plan.kind) as other:
            assert verdict.status is other.validate(problem, plan).status, (begin, deadline)
        if verdict.status is not Status.VALID:
            assert verdict.reason in {Reason.INAPPLICABLE_ACTION, Reason.UNSATISFIED_GOALS}
            continue
        network = to_unified_planning(robust.convert(*from_unified_planning(problem, plan)).stn, problem)
        assert judged(problem, network).status is Status.VALID


ANML = """
type Place; instance Place hall, yard;
fluent boolean at(Place p); fluent boolean dry; fluent boolean shut;
action go(Place a, Place b) {
  duration := 10;
  [start] at(a); [start + 2] at(a) := false;
  [start + 3] dry == true; [end] at(b) := true;
};
[start] { at(hall) := true; at(yard) := false; dry := true; shut := false; };
[4] dry := false;
[end] at(yard);
"""


def test_problems_in_anml_are_called_as_their_files(tmp_path):
    """It has to be dry 3 after the way begins, and is so until 4: who begins at 3/2 is late."""
    file = tmp_path / "-Round trip.anml"
    file.write_text(ANML, encoding="utf-8")
    problem = pytest.importorskip("unified_planning.io").ANMLReader().parse_problem(str(file))
    hall, yard = (up.ObjectExp(problem.object(name)) for name in ("hall", "yard"))
    go = plans.ActionInstance(problem.action("go"), (hall, yard))
    for begin, status in ((Fraction(1, 2), Status.VALID), (Fraction(3, 2), Status.INVALID)):
        assert judged(problem, plans.TimeTriggeredPlan([(begin, go, Fraction(10))])).status is status
    network = robust.convert(
        *from_unified_planning(problem, plans.TimeTriggeredPlan([(Fraction(0), go, Fraction(10))]))
    )
    assert judged(problem, to_unified_planning(network.stn, problem)).status is Status.VALID


def test_partial_orders_are_judged_by_their_sequences():
    """Loading needs an open door, which closing ends."""
    opened, loaded = up.Fluent("opened"), up.Fluent("loaded")
    problem = up.Problem("door", initial_defaults={up.BoolType(): False})
    problem.add_fluents([opened, loaded])
    made = {}
    for name, before, effect, value in (
        ("open", None, opened, True),
        ("load", opened, loaded, True),
        ("close", None, opened, False),
    ):
        action = up.InstantaneousAction(name)
        if before is not None:
            action.add_precondition(before)
        action.add_effect(effect, value)
        problem.add_action(action)
        made[name] = plans.ActionInstance(action)
    problem.add_goal(loaded)
    problem.add_goal(up.Not(opened))
    ordered = plans.PartialOrderPlan({made["open"]: [made["load"]], made["load"]: [made["close"]], made["close"]: []})
    assert judged(problem, ordered).log_messages[0].message == "valid in each of 1 order"
    loose = plans.PartialOrderPlan({made["open"]: [made["load"], made["close"]]})
    verdict = judged(problem, loose)
    assert (verdict.status, verdict.inapplicable_action) == (Status.INVALID, made["load"])
    domain, read, network = from_unified_planning(problem, ordered)
    assert robust.check(assemble(domain, read, network)).answer is Answer.PROVED
    assert robust.check(assemble(*from_unified_planning(problem, loose))).answer is Answer.REFUTED


def test_other_problems_are_unknown():
    """Tasks to be decomposed and unknown facts are more than what a plan's actions do."""
    tasks, tick = counting(2, import_module("unified_planning.model.htn").HierarchicalProblem)
    tasks.task_network.add_subtask(tasks.add_task("all"))
    sensing, _ = counting(2, import_module("unified_planning.model.contingent_problem").ContingentProblem)
    for problem in (tasks, sensing):
        assert judged(problem, plans.SequentialPlan([tick])).status is Status.UNKNOWN
        with pytest.raises(UnsupportedError, match="without tasks and unknown facts"):
            from_unified_planning(problem, plans.SequentialPlan([]))
    with pytest.raises(UnsupportedError, match="found a int, expected a Problem"):
        from_unified_planning(3, plans.TimeTriggeredPlan([]))
    with pytest.raises(InputError, match="found a int, expected a plan with a network, or with times"):
        to_unified_planning(3, tasks)
    with pytest.raises(InputError, match="epsilon: found 0, expected a number above 0"):
        up.PlanValidator(name="robust", params={"epsilon": 0})


def test_examples_of_unified_planning_and_their_traces():
    """Verdicts are those that are listed, traces those of the built-in validator."""
    traces = 0
    for name, one in examples.get_example_problems().items():
        for plan in (*one.valid_plans, *one.invalid_plans):
            if plan.kind not in KINDS:
                continue
            verdict = judged(one.problem, plan)
            if verdict.status is Status.UNKNOWN:
                (message,) = verdict.log_messages
                assert "expected" in message.message or "supported" in message.message
                continue
            valid = any(plan is other for other in one.valid_plans) and name not in DIFFERENT
            assert (bool(verdict), verdict.reason is None) == (valid, valid), name
            if verdict and plan.kind is KINDS[0] and name != "basic_undef_bool":
                with up.PlanValidator(problem_kind=one.problem.kind, plan_kind=plan.kind) as validator:
                    expected = validator.validate(one.problem, plan).trace
                for states in zip(verdict.trace, expected, strict=True):
                    ours, theirs = (
                        [s.get_value(f).constant_value() for f in one.problem.initial_values] for s in states
                    )
                    assert ours == theirs, name
                traces += 1
    assert traces > 20


@pytest.mark.parametrize("gap", [Fraction(1, 100), Fraction(1, 100_000)])
@pytest.mark.parametrize("epsilon", [Fraction(1, 10), Fraction(1, 1000), None])
def test_separation_is_the_problem_s_own(gap, epsilon):
    a, b = up.Fluent("a"), up.Fluent("b")
    first, second = up.DurativeAction("first"), up.DurativeAction("second")
    for action, effect in ((first, a), (second, b)):
        action.set_fixed_duration(1)
        action.add_effect(up.EndTiming(), effect, True)
    second.add_condition(up.StartTiming(), a)
    problem = up.Problem("two", initial_defaults={up.BoolType(): False})
    problem.add_fluents([a, b])
    problem.add_actions([first, second])
    problem.add_goal(b)
    problem.epsilon = epsilon
    plan = plans.TimeTriggeredPlan([(Fraction(0), first(), Fraction(1)), (1 + gap, second(), Fraction(1))])
    verdict = judged(problem, plan)
    assert bool(verdict) is (gap >= (epsilon or Fraction(1, 1000)))
    assert verdict.reason is (None if verdict else Reason.MUTEX_CONFLICT)
    assert bool(judged(problem, plan, epsilon="1/50")) is (gap >= (epsilon or Fraction(1, 50)))


def test_reasons_actions_and_traces():
    problem, late = deliveries(), deliveries(deadline=Fraction(2))
    plan = plan_of(problem)
    assert judged(problem, plan)
    dark = judged(late, plan_of(late))
    assert (dark.reason, dark.inapplicable_action.action.name) == (Reason.INAPPLICABLE_ACTION, "Drive")
    assert list(dark.trace) == [-1, THIRD, 2]
    assert "(lit)" in dark.log_messages[0].message
    unheard = judged(problem, plans.TimeTriggeredPlan(plan.timed_actions[:1]))
    assert (unheard.reason, unheard.inapplicable_action) == (Reason.UNSATISFIED_GOALS, None)
    assert judged(problem, plans.TimeTriggeredPlan([], problem.environment)).reason is Reason.UNSATISFIED_GOALS


def test_networks_are_judged_for_every_schedule():
    problem = deliveries()
    network = to_unified_planning(converted(problem, free_durations=True).stn, problem)
    assert judged(problem, network)
    # The same network, but driving may take longer than the fuel lasts.
    looser = [(a, lower, Fraction(7) if upper == 6 else upper, b) for a, lower, upper, b in edges(network)]
    longer = plans.STNPlan(looser)
    refuted = judged(problem, longer)
    assert refuted.reason is Reason.INAPPLICABLE_ACTION
    assert "the plan allows this schedule: start of (drive home shop) at" in refuted.log_messages[0].message
    assert judged(problem, longer, timeout=0.0).status is Status.UNKNOWN
    never = plans.STNPlan([*looser, (looser[0][0], Fraction(5), Fraction(4), looser[0][3])])
    assert judged(problem, never).log_messages[0].message == "the plan's network has no schedule"


@pytest.mark.parametrize("end", [None, Fraction(4)])
def test_the_end_of_the_plan_bounds_its_actions(end):
    problem = deliveries(deadline=Fraction(5))
    network = to_unified_planning(converted(problem, free_durations=True).stn, problem)
    kinds = up.TimepointKind
    nodes = {node for source, _, _, target in edges(network) for node in (source, target)}
    by_action = {(one.action_instance and one.action_instance.action.name, one.kind): one for one in nodes}
    drive = [by_action["Drive", kind] for kind in (kinds.START, kinds.END)]
    plan_end = plans.stn_plan.STNPlanNode(kinds.GLOBAL_END)
    loose = [
        (drive[0], Fraction(1), Fraction(6), drive[1]),
        (drive[1], Fraction(1, 10), None, by_action["honk", kinds.START]),
        (by_action[None, kinds.GLOBAL_START], Fraction(0), end, plan_end),
    ]
    # In the dark there is no driving; only an end of the plan by 4 keeps the drive in the light.
    assert bool(judged(problem, plans.STNPlan(loose))) is (end is not None)


def test_the_documented_way_from_a_problem_to_an_envelope():
    """Each line `expression  # value` of the page is so."""
    page = (Path(robust.__file__).parents[1] / "docs/unified-planning.md").read_text(encoding="utf-8")
    (block,) = (
        each for each in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL) if "UserType" in each
    )
    names, compared = {}, 0
    for statement in ast.parse(block).body:
        after = block.splitlines()[statement.end_lineno - 1][statement.end_col_offset :]
        code, (_, said, claimed) = ast.get_source_segment(block, statement), after.partition("  # ")
        if said:
            assert str(eval(code, names)) == claimed, code  # noqa: S307 - our own documentation
            compared += 1
        else:
            exec(code, names)  # noqa: S102 - likewise
    assert compared == 3
