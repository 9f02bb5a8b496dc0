"""The referee and the oracle against the definition and brute force, all back ends against the oracle; and what
"before" means to all of them and to the executive: one ε."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import Shape, random_plan
from robust.errors import InputError, SolverError
from robust.pike_bridge import action_model, builder, compile, knowledge, theory
from robust.pike_bridge import cross_check as crossing
from robust.pike_bridge.cross_check import BACKENDS, ExaminedBackend, cross_check
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import ALWAYS, Activity, Assignment, Condition, Constraint, Effect, Event, TeamPlan, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Failed, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Human, Pace, Story
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import broken_constraints, correct_scenarios, holds, is_correct, is_met, scenarios
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import kitchen
from tests.pike_bridge.plans import STEP, P, network, plans, tiny_plans
from tests.pike_bridge.plans import random_plan as small_plan
from tests.sampling import often
from tests.tables import tables

TABLES = tables(__file__)


@settings(max_examples=often(60, 130))
@given(plans, st.data())
def test_unmet_conditions_are_those_of_the_definition(plan, data):
    scenario = {choice.name: data.draw(st.sampled_from(choice.domain)) for choice in plan.network.choices}
    activated = [each.name for each in plan.network.events if holds(each.guard, scenario)]
    times = st.integers(0, 4).map(lambda half: Fraction(half, 2))
    schedule = {name: data.draw(times) for name in activated}
    all_faults = faults(plan, Execution(scenario, schedule))
    broken = {fault.constraint for fault in all_faults if not hasattr(fault, "condition")}
    assert broken == broken_constraints(plan.network, scenario, schedule)
    # A condition whose end is before its start breaks its activity's duration, and nothing more can be said of it.
    due = [
        each for each in plan.conditions if holds(each.guard, scenario) and schedule[each.first] <= schedule[each.last]
    ]
    unmet = {fault.condition for fault in all_faults if hasattr(fault, "condition")} & set(due)
    assert unmet == {each for each in due if not is_met(plan, scenario, each, schedule)}


SPOILING = guard({"x": "spoil"})
SPOILED = TeamPlan(
    network(
        "s1 e1 s2 e2",
        ("e1", "s2", 0, 5),
        choices=[("x", ("spoil", "wait"), "s1")],
        activities=(
            Activity("(make)", "s1", "e1", Fraction(1), Fraction(1)),
            Activity("(use)", "s2", "e2", Fraction(1), Fraction(2)),
            Activity("(spoil)", "s1", "e2", Fraction(1), None, guard=SPOILING),
        ),
    ),
    (Condition(P, "s2", "e2", ALWAYS, 1),),
    (Effect(P, "e1", ALWAYS, 0), Effect(P.negation, "e2", ALWAYS, 1), Effect(P.negation, "e2", SPOILING, 2)),
)
"""`make` ends with p, `use` needs p throughout and ends without it, `spoil` may end at the same event as `use`."""


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
        ("spoil", (0, 3, 2, 2), [..., "(use) needs (p) at 2, but nothing has established it"]),  # nothing is undone
    ],
)
def test_faults_have_words(choice, times, expected):
    schedule = dict(zip(("s1", "e1", "s2", "e2"), map(Fraction, times), strict=True))
    words = list(map(str, faults(SPOILED, Execution({"x": choice}, schedule))))
    assert (words if ... not in expected else [..., words[-1]]) == expected


@pytest.mark.parametrize(("scenario", "schedule", "message"), TABLES["what is no execution is an error"])
def test_what_is_no_execution_is_an_error(scenario, schedule, message):
    with pytest.raises(InputError, match=message):
        faults(SPOILED, Execution(scenario, {name: Fraction(time) for name, time in schedule.items()}))


def scenarios_of(oracle, environment=ALWAYS):
    """Each appears once, and with a correct execution."""
    executions = list(oracle.scenarios(environment))
    assert all(faults(oracle.plan, execution) == () for execution in executions)
    scenarios = {guard(execution.scenario) for execution in executions}
    assert len(scenarios) == len(executions)
    return scenarios


@settings(max_examples=often(20, 40))
@given(plans)
def test_scenarios_and_verdicts_are_those_of_brute_force(plan):
    oracle, correct = Oracle(plan), correct_scenarios(plan)
    assert scenarios_of(oracle) == correct
    for environment in (guard({choice.name: value}) for choice in plan.network.choices for value in choice.domain):
        with_value = {scenario for scenario in correct if environment <= scenario}
        assert examples.exists(oracle.decide(environment)) == bool(with_value)
        assert scenarios_of(oracle, environment) == with_value


@settings(max_examples=often(6, 12))
@given(tiny_plans)
def test_cvc5_agrees(plan):
    assert Oracle(plan, solver="cvc5").decide().verdict is Oracle(plan).decide().verdict


def threatened_plan():
    """`make` produces p for `use`; a parallel `spoil` makes it false in one of two branches."""
    made_and_used = builder.sequence(builder.act("(make)", 1, 1), builder.act("(use)", 1, 2))
    spoiled = builder.choose("x", {"spoil": builder.act("(spoil)", 1, 1), "wait": builder.sequence()})
    threatened = builder.build("threatened", builder.parallel(made_and_used, spoiled))
    make, use, spoil = threatened.activities
    effects = (Effect(P, make.target, make.guard, 0), Effect(P.negation, spoil.target, spoil.guard, 2))
    return TeamPlan(threatened, (Condition(P, use.source, use.source, use.guard, 1),), effects)


def test_what_is_executed_is_activated_and_the_rest_lies_in_the_future_and_questions_without_names_or_time():
    plan = threatened_plan()
    (make, _, spoil), oracle = plan.network.activities, Oracle(plan)
    begun = {"e1": Fraction(-1), make.source: Fraction(0), make.target: Fraction(1)}
    witness = oracle.decide(schedule=begun, now=Fraction(7)).witness
    assert all(time >= 7 for event, time in witness.schedule.items() if event not in begun)
    del begun["e1"]
    assert examples.exists(oracle.decide(schedule=begun))
    assert oracle.decide(schedule=begun, now=Fraction(7)).verdict is ExecutionExistence.NONE
    assert oracle.decide(guard({"x": "wait"}), {spoil.source: Fraction(0)}).verdict is ExecutionExistence.NONE
    witness = oracle.decide(schedule={spoil.source: Fraction(3)}).witness
    assert (witness.scenario, witness.schedule[spoil.source]) == ({"x": "spoil"}, 3)
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
    answer = Oracle(TeamPlan(network(""), (), ())).decide()
    assert (answer.verdict, answer.witness) == (ExecutionExistence.EXISTS, Execution({}, {}))


SMALL = Shape(top=4, inner=2, inner_share=0.4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_random_plans_as_the_oracle_has_them(backend):
    verdicts = set()
    for plan in (random_plan(3, index, SMALL).plan() for index in range(often(7, 12))):
        answer = compile.Checking(plan, backend, all_scenarios=True).run()
        # A solver counts by listing, unless decision diagrams have counted before.
        subjects = [
            ExaminedBackend(name, each) for name in dict.fromkeys(("bdd", backend)) for each in compile.Temporal
        ]
        asked = cross_check(plan, subjects, samples=2)
        assert (asked.agree, asked.out_of_time) == (True, [])
        assert set(map(guard, answer.scenarios or ())) == scenarios_of(Oracle(plan))
        assert (answer.execution is None) == (answer.verdict is compile.PlanVerdict.REFUTED)
        assert answer.execution is None or faults(plan, answer.execution) == ()
        verdicts.add(answer.verdict)
    assert verdicts == {compile.PlanVerdict.PROVED, compile.PlanVerdict.REFUTED}


def raising(error, at=None):
    """For `on_stage`: at a stage, or at any."""

    def on_stage(stage):
        if at in {None, stage}:
            raise error

    return on_stage


@pytest.mark.parametrize("backend", ["oracle", *BACKENDS])
def test_out_of_time_and_interrupted(backend):
    late = compile.Checking(kitchen(), backend, all_scenarios=True, deadline=Deadline.after(0)).run()
    assert (late.verdict, late.complete, late.scenarios) == (compile.PlanVerdict.UNKNOWN, False, [])
    stopped = compile.Checking(kitchen(), backend, on_stage=raising(KeyboardInterrupt, "search")).run()
    assert (stopped.verdict, stopped.interrupted) == (compile.PlanVerdict.UNKNOWN, True)


class Forgetful(SatKnowledgeBase):
    """Refuses the second option of the first choice, whatever is asked."""

    def could_commit(self, commitments, deadline=Deadline()):  # noqa: B008
        refused = Assignment("y1", "2")
        if any(isinstance(each, theory.Require) and refused in each.environment for each in commitments):
            return False
        return super().could_commit(commitments, deadline)


def test_a_wrong_back_end_is_found_out_and_the_plan_shrunk(monkeypatch, tmp_path):
    home = knowledge.Registration(__name__, "Forgetful", frozenset({"network", "solver"}))
    monkeypatch.setitem(knowledge._REGISTRY, "forgetful", home)
    liar = ExaminedBackend("forgetful", compile.Temporal.LAZY)
    plan = builder.k_intents((2,)).instance.plan()
    outcome = cross_check(plan, [ExaminedBackend("bdd", compile.Temporal.LAZY), liar], samples=3)
    assert {each.backend for each in outcome.disagreements} == {"forgetful (lazy)"}

    def shows(smaller):
        return crossing.differing(smaller, liar, solver="z3", seed=0, limit=20)

    smallest = crossing.shrink(plan, shows, Deadline.after(60))
    assert shows(smallest)
    assert [choice.name for choice in smallest.network.choices] == ["y1"]
    assert (smallest.network.activities, smallest.conditions) == ((), ())
    assert shows(action_model.load_team_plan(crossing.propositional(smallest).write(tmp_path)))


@pytest.mark.parametrize("index", range(often(5, 8)))
def test_plans_written_from_memory_mean_the_same(index, tmp_path):
    plan = random_plan(5, index, SMALL).plan()
    again = action_model.load_team_plan(crossing.propositional(plan).write(tmp_path))
    assert scenarios_of(Oracle(again)) == scenarios_of(Oracle(plan))


def test_what_is_known_when_cross_checks_and_compilations_end_early():
    plan = builder.k_intents((3, 3, 3)).instance.plan()
    with pytest.raises(OutOfTimeError):
        cross_check(plan, [], deadline=Deadline.after(0))
    late = cross_check(plan, [ExaminedBackend("pitms", compile.Temporal.APSP)], limit=0)
    assert (late.out_of_time, late.scenarios) == (["pitms (apsp)"], 27)
    sizes = compile.Measuring(kitchen(), "bdd", on_stage=raising(KeyboardInterrupt)).run()
    assert (sizes.status, sizes.cut_short, sizes.satisfiable) == ("interrupted", True, None)
    interrupted = crossing.Crossing(kitchen(), on_stage=raising(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        interrupted.run()
    assert interrupted.so_far(timed_out=True) is None
    late = crossing.Crossing(kitchen(), deadline=Deadline.after(0)).run()
    assert (late.status, late.outcome) == ("timeout", None)
    compiling = compile.Compiling(kitchen(), "pitms", on_stage=raising(OutOfTimeError, "conflicts"))
    with pytest.raises(OutOfTimeError):
        compiling.compile()
    assert compiling.counts.keys() & {"links", "temporal_conflicts"} == {"links"}
    assert set(compiling.seconds) == {"precedence", "links"}


@pytest.mark.parametrize("search", [compile.Measuring, compile.Checking])
def test_what_becomes_too_large_is_not_called_out_of_time(search, monkeypatch):
    monkeypatch.setattr(PiTms.__init__, "__kwdefaults__", {"largest_goal": 20})
    result = search(kitchen(), "pitms").run()
    assert (result.cut_short, result.reason) == (True, "what is compiled became too large")
    assert result.as_dict().get("status", "unknown") == "unknown"
    assert "what is compiled became too large" in str(result)
    assert "out of time" not in str(result)


SIZES = tuple(map(Fraction, ("0", "1/1000", "1/8", "1/3", "1/2", "1")))


def small_with_epsilon(number):
    return replace(small_plan(Random(number), events=6), epsilon=SIZES[number % len(SIZES)])  # noqa: S311


def agree(number, samples=2):
    """How many scenarios there are, for a back end as for the oracle."""
    # The size of ε changes with each number, so that the back end must change with the rounds.
    place = number // len(SIZES)
    subject = ExaminedBackend(BACKENDS[place % len(BACKENDS)], list(compile.Temporal)[place // len(BACKENDS) % 2])
    outcome = cross_check(small_with_epsilon(number), [subject], seed=number, samples=samples)
    assert outcome.disagreements == [], number
    return outcome.scenarios


def executions(plan, random, most):
    """Scenarios with random times for what they activate, many of them closer than ε."""
    for scenario in scenarios(plan.network.domains):
        activated = [each.name for each in plan.network.events if holds(each.guard, scenario)]
        for _ in range(most):
            yield scenario, {name: Fraction(random.randint(0, 24), random.choice((8, 6))) for name in activated}


def near(plan, random):
    """Times of a correct execution, some of them moved by about ε: correct or not."""
    witness = Oracle(plan).decide().witness
    for _ in range(4) if witness is not None else ():
        times = dict(witness.schedule)
        for event in random.sample(sorted(times), min(2, len(times))):
            times[event] += random.choice((-1, 1)) * random.choice((plan.epsilon, plan.epsilon / 2, STEP))
        yield witness.scenario, times


def refereed(number, most=1):
    """How many executions are correct or not: by the oracle, the referee and the definition alike."""
    plan, random, seen = small_with_epsilon(number), Random(number), Counter()  # noqa: S311 - reproducible
    oracle = Oracle(plan)
    for scenario, times in chain(executions(plan, random, most), near(plan, random)):
        correct = is_correct(plan, scenario, times, plan.epsilon)
        assert (faults(plan, Execution(scenario, times)) == ()) == correct, number
        assert examples.exists(oracle.decide(guard(scenario), times)) == correct, number
        seen[correct] += 1
    return seen


def carried_out(number):
    """The end of an execution, after each step of which a correct one is left by the definition, unless it failed."""
    plan, names = small_with_epsilon(number), reasoner_names()
    patience = Fraction(0) if number // len(names) % 2 else None
    executive = PlanExecutive(plan, make_reasoner(names[number % len(names)]), patience=patience)
    possible = examples.possible(plan)
    assert executive.prepare() == possible, number
    story = Story(human=list(Human)[number % 2], pace=list(Pace)[number % 3], delay=Fraction(number % 5, 4))
    if possible:
        judge = SemanticReasoner(executive.progress)
        options = {"judge": judge, "story": story, "seed": number, "horizon": Fraction(100)}
        examples.watch(executive, lambda executive, *_: examples.check_against_definition(executive), **options)
    return type(executive.outcome)


def test_all_mean_the_same_by_before():
    assert sum(agree(number) for number in range(24)) > 6
    seen = sum((refereed(number, 2) for number in range(15)), Counter())
    assert seen[False] > 40
    assert seen[True] > 12
    assert Counter(map(carried_out, range(18)))[Succeeded] > 3


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 2000, 250))
def test_many_plans_mean_the_same_by_before(first):
    numbers = range(first, first + 250)
    seen = sum(map(refereed, numbers), Counter())
    assert min(seen[True], sum(map(agree, numbers)), Counter(map(carried_out, numbers))[Succeeded]) > 50


@pytest.mark.parametrize(("bounds", "epsilon", "possible"), TABLES["before is by epsilon or strictly"])
def test_before_is_by_epsilon_or_strictly(bounds, epsilon, possible):
    """A producer p, a consumer c and a threat t, in this order by bounds."""
    line = network("p c t", *((*pair, bound, bound) for pair, bound in zip(("pc", "ct"), bounds, strict=True)))
    effects = (Effect(P, "p", ALWAYS, None), Effect(P.negation, "t", ALWAYS, None))
    plan = TeamPlan(line, (Condition(P, "c", "c", ALWAYS, None),), effects, Fraction(epsilon))
    assert examples.possible(plan) == possible
    subjects = [ExaminedBackend(backend, temporal) for backend in BACKENDS for temporal in compile.Temporal]
    outcome = cross_check(plan, subjects, samples=1)
    assert (outcome.scenarios, outcome.disagreements) == (possible, [])
    executive = PlanExecutive(plan, make_reasoner("smt"))
    carried_on(executive, Fraction(0))
    assert isinstance(executive.outcome, Succeeded) == possible
    cooking = action_model.load_team_plan(examples.KITCHEN, epsilon=Fraction(epsilon) / 10)
    assert faults(cooking, Oracle(cooking).decide().witness) == ()


def carried_on(executive, now):
    """The executive after all its steps, from a time on."""
    while now is not None and not executive.ended:
        executive.step(now)
        now = executive.wake
    return executive


@pytest.mark.parametrize("backend", reasoner_names())
@pytest.mark.parametrize(("later", "outcome"), [("1/3", Succeeded), (0, Failed)])
def test_what_is_observed_is_ordered_by_arrival(backend, later, outcome):
    """The two ends are closer than ε; which was first is known, unless they are at one time.

    What `(work)` establishes at its end is needed at `own`, and undone by what somebody else ends, `(undo)`.
    """
    plan = examples.working(Constraint("end", "own", Fraction(0), None))
    undo = replace(plan.network.activities[0], action="(undo)", source="begin", target="undone")
    activities, events = (*plan.network.activities, undo), (*plan.network.events, Event("undone"))
    effects = (Effect(P, "end", ALWAYS, 0), Effect(P.negation, "undone", ALWAYS, 1))
    needed = (Condition(P, "own", "own", ALWAYS, None),)
    plan = TeamPlan(replace(plan.network, events=events, activities=activities), needed, effects, Fraction(1))
    executive = PlanExecutive(plan, make_reasoner(backend))
    executive.step(Fraction(0))
    executive.step(Fraction(2), [Completion("(undo)")])
    executive.step(Fraction(2) + Fraction(later), [Completion("(work)")])
    assert isinstance(carried_on(executive, executive.wake).outcome, outcome)
    if outcome is Succeeded:
        times = executive.progress.times
        assert times["own"] == times["end"] + 1  # ε is for what is still to come
        assert faults(plan, Execution({}, times)) != ()
        assert faults(plan, Execution({}, times), reported=executive.progress.reported) == ()
