"""One ε for all: what "before" means to the oracle, the referee, the knowledge bases and the executive."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import chain, product
from random import Random

import pytest

from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.compile import Temporal
from robust.pike_bridge.cross_check import BACKENDS, ExaminedBackend, cross_check
from robust.pike_bridge.model import ALWAYS, Condition, Constraint, Effect, Event, Literal, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Failed, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Human, Pace, Story
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults, holds
from robust.plan.model import Atom
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import KITCHEN, working
from tests.pike_bridge.plans import STEP, random_plan

SIZES = (0, "1/1000", "1/8", "1/3", "1/2", 1)
P = Literal(Atom("p"))


def drawn(number, epsilon):
    plan = random_plan(Random(number), events=6)  # noqa: S311 - reproducible
    return replace(plan, epsilon=Fraction(epsilon))


def is_correct(plan, scenario, times):
    """By the definition, pair by pair: a third reading beside formula and referee."""

    def before(one, other):
        return times[other] - times[one] >= plan.epsilon and times[other] > times[one]

    def supports(producer, condition, threats):
        own = condition.first != condition.last and producer.event == condition.first
        own = own and producer.activity is not None and producer.activity == condition.activity
        return (own or before(producer.event, condition.first)) and all(
            before(each.event, producer.event) or before(condition.last, each.event) for each in threats
        )

    for each in plan.network.temporal_constraints:
        difference = times.get(each.target, 0) - times.get(each.source, 0)
        if holds(each.guard, scenario) and (
            (each.lower is not None and difference < each.lower) or (each.upper is not None and difference > each.upper)
        ):
            return False
    effects = [each for each in plan.effects if holds(each.guard, scenario)]
    for condition in plan.conditions:
        if holds(condition.guard, scenario):
            producers = [each for each in effects if each.literal == condition.literal]
            threats = [
                each
                for each in effects
                if each.literal == condition.literal.negation
                and not (
                    each.activity is not None and each.activity == condition.activity and each.event == condition.last
                )
            ]
            if not any(supports(each, condition, threats) for each in producers):
                return False
    return True


def executions(plan, random, most):
    """Scenarios with random times for what they activate, many of them closer than ε."""
    for values in product(*(each.domain for each in plan.network.choices)):
        scenario = dict(zip((each.name for each in plan.network.choices), values, strict=True))
        activated = [each.name for each in plan.network.events if holds(each.guard, scenario)]
        for _ in range(most):
            yield scenario, {name: Fraction(random.randint(0, 24), random.choice((8, 6))) for name in activated}


@pytest.mark.parametrize("epsilon", SIZES)
def test_oracle_and_referee_mean_the_same_by_before(epsilon):
    seen, random = Counter(), Random(1)  # noqa: S311 - reproducible
    for number in range(12):
        plan = drawn(number, epsilon)
        oracle = Oracle(plan)
        for scenario, times in executions(plan, random, 4):
            correct = is_correct(plan, scenario, times)
            assert (faults(plan, Execution(scenario, times)) == ()) == correct
            assert (oracle.decide(guard(scenario), times).verdict is ExecutionExistence.EXISTS) == correct
            seen[correct] += 1
    assert seen[False] > 20
    assert seen[True] > 3


def agree(number, epsilon, samples):
    plan = drawn(number, epsilon)
    backend, temporal = BACKENDS[number % len(BACKENDS)], list(Temporal)[number // len(BACKENDS) % 2]
    outcome = cross_check(plan, [ExaminedBackend(backend, temporal)], seed=number, samples=samples)
    assert outcome.disagreements == [], number
    return outcome.scenarios


@pytest.mark.parametrize("epsilon", SIZES)
def test_knowledge_bases_mean_the_same_by_before(epsilon):
    assert sum(agree(number, epsilon, 2) for number in range(16)) > 0


def near(plan, random):
    """Times of a correct execution, some of them moved by about ε: correct or not."""
    witness = Oracle(plan).decide().witness
    for _ in range(4) if witness is not None else ():
        times = dict(witness.schedule)
        for event in random.sample(sorted(times), min(2, len(times))):
            times[event] += random.choice((-1, 1)) * random.choice((plan.epsilon, plan.epsilon / 2, STEP))
        yield witness.scenario, times


def refereed(number, epsilon):
    """How many executions are correct: by the oracle, the referee and the definition alike."""
    plan, random = drawn(number, epsilon), Random(number)  # noqa: S311 - reproducible
    oracle, found = Oracle(plan), 0
    for scenario, times in chain(executions(plan, random, 1), near(plan, random)):
        correct = is_correct(plan, scenario, times)
        assert (faults(plan, Execution(scenario, times)) == ()) == correct, number
        assert (oracle.decide(guard(scenario), times).verdict is ExecutionExistence.EXISTS) == correct, number
        found += correct
    return found


def carried_out(number, epsilon):
    """The end of an execution, after each step of which a correct one is left by the definition, unless it failed."""
    plan, names = drawn(number, epsilon), reasoner_names()
    patience = Fraction(0) if number // len(names) % 2 else None
    executive = PlanExecutive(plan, make_reasoner(names[number % len(names)]), patience=patience)
    possible = Oracle(plan).decide().verdict is ExecutionExistence.EXISTS
    assert executive.prepare() == possible, number

    def check(executive, now, _found):
        ended, progress = executive.outcome, executive.progress
        if isinstance(ended, Succeeded):
            assert examples.is_correct(plan, progress), (number, now)
        else:
            assert examples.is_left(plan, progress) != isinstance(ended, Failed), (number, now)

    story = Story(human=list(Human)[number % 2], pace=list(Pace)[number % 3], delay=Fraction(number % 5, 4))
    if possible:
        examples.watch(
            executive,
            check,
            judge=SemanticReasoner(executive.progress),
            story=story,
            seed=number,
            horizon=Fraction(100),
        )
    return executive.outcome


def test_executives_and_the_referee_mean_the_same_by_before():
    correct = sum(refereed(number, SIZES[number % len(SIZES)]) for number in range(24))
    ended = Counter(type(carried_out(number, SIZES[number % len(SIZES)])) for number in range(48))
    assert correct > 20
    assert ended[Succeeded] > 10


@pytest.mark.slow
@pytest.mark.parametrize("first", range(16, 2016, 250))
def test_many_plans_mean_the_same_by_before(first):
    seen = Counter()
    for number in range(first, first + 250):
        epsilon = SIZES[number % len(SIZES)]
        seen["scenarios"] += agree(number, epsilon, 2)
        seen["correct"] += refereed(number, epsilon)
        seen[type(carried_out(number, epsilon))] += 1
    assert min(seen["scenarios"], seen["correct"], seen[Succeeded]) > 50


def close(*bounds, epsilon):
    """A producer p, a consumer c and a threat t, in this order by bounds."""
    names = ("p", "c", "t")
    constraints = tuple(
        Constraint(source, target, Fraction(bound), Fraction(bound))
        for source, target, bound in zip(names, names[1:], bounds, strict=False)
    )
    network = Tpnu("close", (), tuple(map(Event, names)), constraints, ())
    condition = Condition(P, "c", "c", ALWAYS, None)
    effects = (Effect(P, "p", ALWAYS, None), Effect(P.negation, "t", ALWAYS, None))
    return TeamPlan(network, (condition,), effects, Fraction(epsilon))


@pytest.mark.parametrize(
    ("bounds", "epsilon", "possible"),
    [
        ((1, 1), 1, True),
        (("999/1000", 1), 1, False),  # the producer is too close
        ((1, "999/1000"), 1, False),  # the threat is
        (("1/1000000", "1/1000000"), 0, True),
        ((0, 1), 0, False),
        ((1, 0), 0, False),
    ],
)
def test_before_is_by_epsilon_or_strictly(bounds, epsilon, possible):
    plan = close(*bounds, epsilon=epsilon)
    assert (Oracle(plan).decide().verdict is ExecutionExistence.EXISTS) == possible
    subjects = [ExaminedBackend(backend, temporal) for backend in BACKENDS for temporal in Temporal]
    outcome = cross_check(plan, subjects, samples=1)
    assert outcome.scenarios == possible
    assert outcome.disagreements == []
    executive = PlanExecutive(plan, make_reasoner("smt"))
    now = Fraction(0)
    while now is not None and not executive.ended:
        executive.step(now)
        now = executive.wake
    assert isinstance(executive.outcome, Succeeded) == possible


@pytest.mark.parametrize("epsilon", [0, "1/1000", "1/10"])
def test_the_kitchen_is_possible_with_every_epsilon(epsilon):
    plan = load_team_plan(KITCHEN, epsilon=Fraction(epsilon))
    witness = Oracle(plan).decide().witness
    assert faults(plan, witness) == ()


def observed(epsilon):
    """What `(work)` establishes at its end is needed at `own`, and undone by what somebody else ends, `(undo)`."""
    plan = working(Constraint("end", "own", Fraction(0), None))
    undo = replace(plan.network.activities[0], action="(undo)", source="begin", target="undone")
    events = (*plan.network.events, Event("undone"))
    network = replace(plan.network, events=events, activities=(*plan.network.activities, undo))
    effects = (Effect(P, "end", ALWAYS, 0), Effect(P.negation, "undone", ALWAYS, 1))
    return TeamPlan(network, (Condition(P, "own", "own", ALWAYS, None),), effects, Fraction(epsilon))


@pytest.mark.parametrize("backend", reasoner_names())
@pytest.mark.parametrize(("later", "outcome"), [("1/3", Succeeded), (0, Failed)])
def test_what_is_observed_is_ordered_by_arrival(backend, later, outcome):
    """The two ends are closer than ε; which was first is known, unless they are at one time."""
    plan = observed(1)
    executive = PlanExecutive(plan, make_reasoner(backend))
    executive.step(Fraction(0))
    executive.step(Fraction(2), [Completion("(undo)")])
    executive.step(Fraction(2) + Fraction(later), [Completion("(work)")])
    while not executive.ended and executive.wake is not None:
        executive.step(executive.wake)
    assert isinstance(executive.outcome, outcome)
    if outcome is Succeeded:
        times = executive.progress.times
        assert times["own"] == times["end"] + 1  # ε is for what is still to come
        assert faults(plan, Execution({}, times)) != ()
        assert faults(plan, Execution({}, times), reported=executive.progress.reported) == ()
