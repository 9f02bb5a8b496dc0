"""The referee and the oracle against the definition and brute force, and all back ends against the oracle.

What they find in the examples is among the recordings.
"""

from fractions import Fraction

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import Shape, random_plan
from robust.errors import InputError, SolverError
from robust.pike_bridge import knowledge
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.builder import act, build, choose, k_intents, parallel, sequence
from robust.pike_bridge.compile import Checking, Compiling, Measuring, PlanVerdict, Temporal
from robust.pike_bridge.cross_check import (
    Crossing,
    ExaminedBackend,
    cross_check,
    differing,
    propositional,
    shrink,
    subjects,
)
from robust.pike_bridge.knowledge import Registration
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import ALWAYS, Activity, Assignment, Condition, Effect, TeamPlan, guard
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.pike_bridge.theory import Require
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import broken_constraints, correct_scenarios, holds, is_met
from tests.pike_bridge.online.examples import kitchen
from tests.pike_bridge.plans import P, network, plans, tiny_plans


@settings(max_examples=200)
@given(plans, st.data())
def test_unmet_conditions_are_those_of_the_definition(plan, data):
    scenario = {choice.name: data.draw(st.sampled_from(choice.domain)) for choice in plan.network.choices}
    activated = [each.name for each in plan.network.events if holds(each.guard, scenario)]
    times = st.integers(0, 4).map(lambda half: Fraction(half, 2))
    schedule = {name: data.draw(times) for name in activated}
    found = faults(plan, Execution(scenario, schedule))
    broken = {fault.constraint for fault in found if not hasattr(fault, "condition")}
    assert broken == broken_constraints(plan.network, scenario, schedule)
    # A condition whose end is before its start breaks its activity's duration, and nothing more can be said of it.
    due = [
        each for each in plan.conditions if holds(each.guard, scenario) and schedule[each.first] <= schedule[each.last]
    ]
    unmet = {fault.condition for fault in found if hasattr(fault, "condition")} & set(due)
    assert unmet == {each for each in due if not is_met(plan, scenario, each, schedule)}
    event(f"{len(unmet)} of {len(due)} conditions unmet")


def small_plan():
    """`make` ends with p, `use` needs p throughout and ends without it, `spoil` may end at the same event as `use`."""
    spoiling = guard({"x": "spoil"})
    activities = (
        Activity("(make)", "s1", "e1", Fraction(1), Fraction(1)),
        Activity("(use)", "s2", "e2", Fraction(1), Fraction(2)),
        Activity("(spoil)", "s1", "e2", Fraction(1), None, guard=spoiling),
    )
    choices = [("x", ("spoil", "wait"), "s1")]
    return TeamPlan(
        network("s1 e1 s2 e2", ("e1", "s2", 0, 5), choices=choices, activities=activities),
        (Condition(P, "s2", "e2", ALWAYS, 1),),
        (Effect(P, "e1", ALWAYS, 0), Effect(P.negation, "e2", ALWAYS, 1), Effect(P.negation, "e2", spoiling, 2)),
    )


@pytest.mark.parametrize(
    ("choice", "times", "expected"),
    [
        ("wait", (0, 1, 2, 3), []),  # an activity may end what it needs
        ("spoil", (0, 1, 2, 3), ["(use) needs (p) at 3, but e2 makes (not (p)) true"]),  # another one may not
        ("wait", (0, 1, 1, 2), ["(use) needs (p) at 1, but nothing has established it"]),  # too late
        (
            "wait",
            (0, 2, 8, 9),
            ["s2 is 6 after e1; expected between 0 and 5", "e1 is 2 after s1; expected between 1 and 1"],
        ),
    ],
)
def test_faults_have_words(choice, times, expected):
    schedule = dict(zip(("s1", "e1", "s2", "e2"), map(Fraction, times), strict=True))
    assert [str(fault) for fault in faults(small_plan(), Execution({"x": choice}, schedule))] == expected


@pytest.mark.parametrize(
    ("scenario", "schedule", "message"),
    [
        ({}, {}, "choice x has value None; expected one of spoil, wait"),
        ({"x": "sp"}, {}, "choice x has value sp"),
        ({"x": "wait"}, {"s1": 0, "e1": 1, "s2": 2}, "activated event e2 has no time"),
        ({"x": "wait"}, {"s1": 0, "e1": 1, "s2": 2, "e2": 3, "e9": 4}, "event e9 has a time, but is not activated"),
    ],
)
def test_what_is_no_execution_is_an_error(scenario, schedule, message):
    with pytest.raises(InputError, match=message):
        faults(small_plan(), Execution(scenario, {name: Fraction(time) for name, time in schedule.items()}))


def scenarios_of(oracle, environment=ALWAYS):
    """Each found once, and with a correct execution."""
    found = {}
    for execution in oracle.scenarios(environment):
        assert faults(oracle.plan, execution) == ()
        assert guard(execution.scenario) not in found
        found[guard(execution.scenario)] = execution
    return found.keys()


@settings(max_examples=150)
@given(plans)
def test_scenarios_are_those_of_brute_force(plan):
    correct = correct_scenarios(plan)
    assert scenarios_of(Oracle(plan)) == correct
    event(f"{min(2, len(correct))} correct")


@settings(max_examples=40)
@given(tiny_plans)
def test_cvc5_agrees(plan):
    assert Oracle(plan, solver="cvc5").decide().verdict is Oracle(plan).decide().verdict


@settings(max_examples=60)
@given(plans)
def test_deciding_under_assumptions_is_looking_among_scenarios(plan):
    oracle = Oracle(plan)
    correct = scenarios_of(oracle)
    for environment in (guard({choice.name: value}) for choice in plan.network.choices for value in choice.domain):
        with_value = {scenario for scenario in correct if environment <= scenario}
        assert (oracle.decide(environment).verdict is ExecutionExistence.EXISTS) == bool(with_value)
        assert scenarios_of(oracle, environment) == with_value


def threatened_plan():
    """`make` produces p for `use`; a parallel `spoil` makes it false in one of two branches."""
    threatened = build(
        "threatened",
        parallel(
            sequence(act("(make)", 1, 1), act("(use)", 1, 2)),
            choose("x", {"spoil": act("(spoil)", 1, 1), "wait": sequence()}),
        ),
    )
    make, use, spoil = threatened.activities
    return TeamPlan(
        threatened,
        (Condition(P, use.source, use.source, use.guard, 1),),
        (Effect(P, make.target, make.guard, 0), Effect(P.negation, spoil.target, spoil.guard, 2)),
    )


def test_what_is_not_executed_yet_lies_in_the_future():
    plan = threatened_plan()
    make, oracle = plan.network.activities[0], Oracle(plan)
    begun = {"e1": Fraction(-1), make.source: Fraction(0), make.target: Fraction(1)}
    witness = oracle.decide(schedule=begun, now=Fraction(7)).witness
    assert all(time >= 7 for event, time in witness.schedule.items() if event not in begun)
    del begun["e1"]
    assert oracle.decide(schedule=begun).verdict is ExecutionExistence.EXISTS
    assert oracle.decide(schedule=begun, now=Fraction(7)).verdict is ExecutionExistence.NONE


def test_events_that_are_executed_are_activated():
    plan = threatened_plan()
    spoil, oracle = plan.network.activities[2], Oracle(plan)
    assert oracle.decide(guard({"x": "wait"}), {spoil.source: Fraction(0)}).verdict is ExecutionExistence.NONE
    witness = oracle.decide(schedule={spoil.source: Fraction(3)}).witness
    assert (witness.scenario, witness.schedule[spoil.source]) == ({"x": "spoil"}, 3)


def test_unknown_names_are_errors_and_without_time_there_is_no_verdict():
    oracle = Oracle(threatened_plan())
    with pytest.raises(InputError, match="unknown assignment x = spill; did you mean"):
        oracle.decide(guard({"x": "spill"}))
    with pytest.raises(InputError, match="the schedule gives a time to nowhere"):
        oracle.decide(schedule={"nowhere": Fraction(0)})
    with pytest.raises(SolverError, match="unknown solver"):
        Oracle(threatened_plan(), solver="abacus")
    assert oracle.decide(deadline=Deadline.after(0)).verdict is ExecutionExistence.UNKNOWN
    with pytest.raises(OutOfTimeError):
        list(oracle.scenarios(deadline=Deadline.after(0)))


def test_a_plan_without_events_is_correct():
    answer = Oracle(TeamPlan(network(""), (), ())).decide()
    assert (answer.verdict, answer.witness) == (ExecutionExistence.EXISTS, Execution({}, {}))


BACKENDS = ("bdd", "pitms", "atms", "sat")
SMALL = Shape(top=4, inner=2, inner_share=0.4)


def correct(plan):
    return {guard(execution.scenario) for execution in Oracle(plan).scenarios()}


@pytest.mark.parametrize("backend", BACKENDS)
def test_random_plans_as_the_oracle_has_them(backend):
    verdicts = set()
    for index in range(12):
        plan = random_plan(3, index, SMALL).plan()
        found = Checking(plan, backend, all_scenarios=True).run()
        assert set(map(guard, found.scenarios or ())) == correct(plan)
        assert (found.execution is None) == (found.verdict is PlanVerdict.REFUTED)
        assert found.execution is None or faults(plan, found.execution) == ()
        verdicts.add(found.verdict)
    assert verdicts == {PlanVerdict.PROVED, PlanVerdict.REFUTED}


@pytest.mark.parametrize("backend", ["oracle", *BACKENDS])
def test_out_of_time_and_interrupted(backend):
    late = Checking(kitchen(), backend, all_scenarios=True, deadline=Deadline.after(0)).run()
    assert (late.verdict, late.complete, late.scenarios) == (PlanVerdict.UNKNOWN, False, [])

    def interrupt(stage):
        if stage == "search":
            raise KeyboardInterrupt

    stopped = Checking(kitchen(), backend, on_stage=interrupt).run()
    assert (stopped.verdict, stopped.interrupted) == (PlanVerdict.UNKNOWN, True)


def test_interrupted_with_and_without_anything_known():
    def interrupt(_stage):
        raise KeyboardInterrupt

    sizes = Measuring(kitchen(), "bdd", on_stage=interrupt).run()
    assert (sizes.status, sizes.cut_short, sizes.satisfiable) == ("interrupted", True, None)
    crossing = Crossing(kitchen(), on_stage=interrupt)
    with pytest.raises(KeyboardInterrupt):
        crossing.run()
    assert crossing.so_far(timed_out=True) is None
    late = Crossing(kitchen(), deadline=Deadline.after(0)).run()
    assert (late.status, late.outcome) == ("timeout", None)


def test_compilation_keeps_what_it_has_found():
    def late(stage):
        if stage == "conflicts":
            raise OutOfTimeError

    compiling = Compiling(kitchen(), "pitms", on_stage=late)
    with pytest.raises(OutOfTimeError):
        compiling.compile()
    assert compiling.counts.keys() & {"links", "temporal_conflicts"} == {"links"}
    assert set(compiling.seconds) == {"precedence", "links"}


@pytest.mark.parametrize(
    ("seed", "count", "samples"),
    [(7, 6, 4), *(pytest.param(seed, 30, 10, marks=pytest.mark.slow) for seed in range(10, 20))],
)
def test_all_agree_on_random_plans(seed, count, samples):
    asked = scenarios = late = 0
    for index in range(count):
        plan = random_plan(seed, index, SMALL).plan()
        outcome = cross_check(plan, tuple(subjects(BACKENDS)), samples=samples, limit=60)
        assert outcome.agree, (seed, index, [str(one) for one in outcome.disagreements])
        # Labels may become too large for the time limit; then their back end has not been asked, or not everything.
        assert {one.split()[0] for one in outcome.out_of_time} <= {"atms", "pitms"}
        late += bool(outcome.out_of_time)
        asked += sum(outcome.questions.values())
        scenarios += outcome.scenarios
    assert late <= count // 30
    assert asked > 100 * count
    assert scenarios > count


class Forgetful(SatKnowledgeBase):
    """Refuses the second option of the first choice, whatever is asked."""

    def could_commit(self, commitments, deadline=Deadline()):  # noqa: B008
        refused = Assignment("y1", "2")
        if any(isinstance(one, Require) and refused in one.environment for one in commitments):
            return False
        return super().could_commit(commitments, deadline)


def test_a_wrong_back_end_is_found_out_and_the_plan_shrunk(monkeypatch, tmp_path):
    home = Registration(__name__, "Forgetful", frozenset({"network", "solver"}))
    monkeypatch.setitem(knowledge._REGISTRY, "forgetful", home)
    liar = ExaminedBackend("forgetful", Temporal.LAZY)
    plan = k_intents((2,)).instance.plan()
    outcome = cross_check(plan, [ExaminedBackend("bdd", Temporal.LAZY), liar], samples=3)
    assert {one.backend for one in outcome.disagreements} == {"forgetful (lazy)"}

    def shows(smaller):
        return differing(smaller, liar, solver="z3", seed=0, limit=20)

    smallest = shrink(plan, shows, Deadline.after(60))
    assert shows(smallest)
    assert [choice.name for choice in smallest.network.choices] == ["y1"]
    assert (smallest.network.activities, smallest.conditions) == ((), ())
    assert shows(load_team_plan(propositional(smallest).write(tmp_path)))


@pytest.mark.parametrize("index", range(8))
def test_plans_written_from_memory_mean_the_same(index, tmp_path):
    plan = random_plan(5, index, SMALL).plan()
    again = load_team_plan(propositional(plan).write(tmp_path))
    assert correct(again) == correct(plan)


def test_cross_checks_out_of_time():
    plan = k_intents((3, 3, 3)).instance.plan()
    with pytest.raises(OutOfTimeError):
        cross_check(plan, [], deadline=Deadline.after(0))
    late = cross_check(plan, [ExaminedBackend("pitms", Temporal.APSP)], limit=0)
    assert late.out_of_time == ["pitms (apsp)"]
    assert late.scenarios == 27
    assert Oracle(plan).decide().verdict is ExecutionExistence.EXISTS


@pytest.mark.parametrize("search", [Measuring, Checking])
def test_what_becomes_too_large_is_not_called_out_of_time(search, monkeypatch):
    monkeypatch.setattr(PiTms.__init__, "__kwdefaults__", {"largest_goal": 20})
    result = search(kitchen(), "pitms").run()
    assert (result.cut_short, result.reason) == (True, "what is compiled became too large")
    assert result.as_dict().get("status", "unknown") == "unknown"
    assert "what is compiled became too large" in str(result)
    assert "out of time" not in str(result)
