"""Reasoners with knowledge bases, question by question against the semantic one, in whole executions."""

from fractions import Fraction
from functools import cache
from random import Random

import pytest

from benchmarks.generators.pike import k_intents
from robust.errors import InputError
from robust.pike_bridge.compile import Temporal
from robust.pike_bridge.generators import stories as figures
from robust.pike_bridge.generators.stories import wing
from robust.pike_bridge.model import ALWAYS, Activity, Choice, Constraint, Event, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Executed, Failed, Progress
from robust.pike_bridge.online.reasoner import Accompanied
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Disturbance, Human, Pace, Story
from robust.pike_bridge.semantics import Existence, Oracle
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.pike_bridge import sweeps
from tests.pike_bridge.online.examples import BROKEN, SOLVABLE, Compared, drawn, kitchen, tale, watch

BACKENDS = tuple(name for name in reasoner_names() if name != "smt")
WAYS = [(backend, temporal) for backend in BACKENDS for temporal in Temporal]
each_way = pytest.mark.parametrize(
    ("backend", "temporal"), WAYS, ids=[f"{backend}-{temporal.value}" for backend, temporal in WAYS]
)


@cache
def named(name):
    match name:
        case "kitchen":
            return kitchen()
        case "wing":
            return wing().plan()
        case "k-intents":
            return k_intents((2, 3)).instance.plan()
        case "figure_23":
            return figures.figure_23(4).plan()
        case _:
            return getattr(figures, name)().plan()


def contested(number):
    """A small plan without much structure, whose threats may come on either side of links."""
    return sweeps.random_plan(Random(number), events=8)  # noqa: S311 - reproducible


class Exactly(Compared):
    """Looks again when the companion would, too, not earlier."""

    def next_time(self, deadline):
        ours, theirs = self.deciding.next_time(deadline), self.companion.next_time(deadline)
        assert ours == theirs
        return ours


def execute(plan, way, number, *, told=None, compared=True, after_step=lambda executive: None):
    """One simulated execution, decided by a reasoner that is compared with `smt` in every question: all decisions.

    Args:
        way: the name of a reasoner, and how it finds out about time.
        number: decides about the story, chance and ties.
        compared: whether `smt` only advises the team instead.
    """
    make, decisions = make_reasoner(way[0], temporal=way[1]), []

    def both(progress):
        return (Exactly if compared else Accompanied)(make(progress), SemanticReasoner(progress))

    def note(executive, now, found):
        decisions.append((now, tuple(found)))
        after_step(executive)

    executive = PlanExecutive(plan, both, ranking=shuffled(number))
    judge = executive.reasoner.companion
    watch(executive, note, judge=judge, story=told or story(plan, number), seed=number, horizon=Fraction(500))
    return executive, decisions


def infer(executive):
    """Ask, and compare, which values choices may still have."""
    if not executive.ended:
        for choice in executive.plan.network.choices:
            assert executive.possible_values(choice.name)


def shuffled(seed):
    """Ties are broken anyhow, but always in the same way."""
    random = Random(seed)  # noqa: S311 - reproducible

    def rank(alternatives):
        found = list(alternatives)
        random.shuffle(found)
        return found

    return rank


def story(plan, seed):
    """Rational or careless humans, steady or random paces, and now and then a disturbance."""
    random = Random(seed)  # noqa: S311 - reproducible
    literals = [effect.literal.negation for effect in plan.effects] or [None]
    broken = [
        Disturbance(Fraction(random.randint(0, 40), 4), random.choice(literals))
        for _ in range(random.choice((0, 0, 1, 2)) if plan.effects else 0)
    ]
    return Story(
        human=random.choice(list(Human)),
        pace=random.choice(list(Pace)),
        disturbances=tuple(broken),
        delay=random.choice((Fraction(0), Fraction(0), Fraction(2))),
    )


PLANS = ("kitchen", "k-intents", "figure_8", "figure_9", "figure_11", "figure_13", "figure_23")


@each_way
@pytest.mark.parametrize("name", PLANS)
def test_answers_about_examples_are_those_of_the_semantics(name, backend, temporal):
    plan = named(name)
    for seed in range(2):
        assert len(execute(plan, (backend, temporal), seed)[1]) > 1


@pytest.mark.parametrize(
    ("backend", "temporal"), [("pitms", Temporal.LAZY), ("sat", Temporal.LAZY), ("bdd", Temporal.APSP)]
)
def test_answers_about_the_wing_are_those_of_the_semantics(backend, temporal):
    assert len(execute(named("wing"), (backend, temporal), 1)[1]) > 5


@each_way
def test_answers_about_drawn_plans_are_those_of_the_semantics(backend, temporal):
    steps = [len(execute(drawn(each), (backend, temporal), place)[1]) for place, each in enumerate(SOLVABLE[6:10])]
    assert sum(steps) > 40


@each_way
def test_answers_about_small_contested_plans_are_those_of_the_semantics(backend, temporal):
    ended = set()
    for seed in range(30):
        executive, _ = execute(contested(seed), (backend, temporal), seed, after_step=infer)
        ended.add(type(executive.outcome).__name__)
    assert {"Succeeded", "Failed"} <= ended


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_all_reasoners_decide_the_same(name):
    plan = named(name)
    ways = WAYS if name == "kitchen" else [way for way in WAYS if way[1] is Temporal.LAZY]
    told = [execute(plan, way, 3, compared=False)[1] for way in (*ways, ("smt", Temporal.LAZY))]
    assert all(each == told[0] for each in told)
    assert len(told[0]) > 5


@pytest.mark.parametrize("temporal", Temporal)
def test_broken_links_are_left(temporal):
    """A toaster that breaks leaves cereal, whoever reasons."""
    for backend in BACKENDS:
        told = tale(BROKEN, xA1="glass")
        executive, _ = execute(kitchen(), (backend, temporal), 0, told=told, after_step=infer)
        assert executive.progress.void
        assert executive.progress.chosen["xA3"] == "cereal"


def network(*constraints, choices=()):
    """Someone works from `begin` to `end`; the event `own` is ours."""
    events = tuple(Event(name, ALWAYS) for name in ("begin", "end", "own"))
    work = Activity("(work)", "begin", "end", Fraction(2), Fraction(5), agent="human")
    return TeamPlan(Tpnu("work", choices, events, constraints, (work,)), (), ())


def compared_executive(plan, way):
    """After its first step."""
    make = make_reasoner(way[0], temporal=way[1])
    executive = PlanExecutive(plan, lambda progress: Compared(make(progress), SemanticReasoner(progress)))
    executive.step(Fraction(0))
    return executive


def compare_at(plan, way, moment):
    """The decisions at a moment at which nothing has been reported."""
    executive = compared_executive(plan, way)
    found = executive.step(Fraction(moment))
    assert not executive.ended
    return {each.event for each in found if isinstance(each, Executed)}


@each_way
def test_nothing_happens_with_what_is_due_but_not_reported(backend, temporal):
    """At 5, the work must end, but has not; what is ours comes later than that, or never."""
    plan = network(
        Constraint("begin", "own", Fraction(1), None, ALWAYS), Constraint("begin", "own", None, Fraction(9), ALWAYS)
    )
    assert compare_at(plan, (backend, temporal), 4) == {"own"}
    assert compare_at(plan, (backend, temporal), 5) == set()


@each_way
def test_nothing_happens_before_what_is_to_be_reported(backend, temporal):
    """Only x = 1 has times, although nobody has chosen it; then the work has ended when our event happens."""
    first, second = (guard({"x": value}) for value in "12")
    plan = network(
        Constraint("begin", "own", Fraction(1), None, ALWAYS),
        Constraint("end", "own", Fraction(0), None, first),
        Constraint("begin", "own", Fraction(5), None, second),
        Constraint("begin", "own", None, Fraction(4), second),
        choices=(Choice("x", ("1", "2"), True, None),),
    )
    assert compare_at(plan, (backend, temporal), 3) == set()


@each_way
def test_what_is_due_first_is_looked_for_first(backend, temporal):
    plan = network(Constraint("begin", "own", Fraction(7), None, ALWAYS))
    executive = PlanExecutive(plan, make_reasoner(backend, temporal=temporal))
    executive.step(Fraction(0))
    assert executive.wake == 5 + plan.epsilon
    executive.step(Fraction(3), [Completion("(work)")])
    assert executive.wake == 7


@each_way
def test_times_off_the_grid_are_exact(backend, temporal):
    """As a clock has them: thirds of a second, which no unit of the plan divides."""
    executive = compared_executive(kitchen(), (backend, temporal))
    for third in range(1, 9):
        executive.step(Fraction(third, 3))
        executive.reasoner.deciding.next_time(NEVER)
    assert len(executive.progress.times) > 1


@each_way
def test_compiling_ends_at_the_deadline(backend, temporal):
    make = make_reasoner(backend, temporal=temporal, deadline=Deadline.after(0))
    with pytest.raises(OutOfTimeError):
        make(Progress(kitchen()))


@each_way
def test_what_was_compiled_can_be_seen(backend, temporal):
    make = make_reasoner(backend, temporal=temporal)
    reasoner = make(Progress(kitchen()))
    assert reasoner.name == make.compilation.backend == backend
    assert set(make.seconds) >= {"precedence", "links", "knowledge"}
    assert ("windows" in make.seconds) == (temporal is Temporal.APSP)


@each_way
def test_a_question_that_runs_out_of_time_changes_nothing(backend, temporal):
    executive = PlanExecutive(kitchen(), make_reasoner(backend, temporal=temporal))
    executive.step(Fraction(0))
    values = [guard({"xA1": value}) for value in ("mug", "glass")]
    # A continuation that is known already may answer for one of the values without looking at any clock.
    with pytest.raises(OutOfTimeError):
        [executive.reasoner.could(value, Deadline.after(0)) for value in values]
    assert all(executive.reasoner.could(value, NEVER) for value in values)
    assert not executive.reasoner.could(guard({"xA1": "mug", "xA2": "juice"}), NEVER)


def test_unknown_reasoners_are_named():
    with pytest.raises(InputError, match="unknown reasoner 'bbd'; did you mean 'bdd'"):
        make_reasoner("bbd")


# -- correct after every step (Theorem 4.7) ----------------------------------------------------------------------------


class Confirmed:
    """The oracle's word on the partial execution after each step; broken links are beyond it."""

    def __init__(self, plan):
        self._oracle = Oracle(plan)
        self.asked = 0

    def __call__(self, executive):
        progress = executive.progress
        if progress.void:
            return
        answer = self._oracle.decide(guard(progress.chosen), progress.times, now=progress.now)
        assert answer.verdict is (Existence.NONE if isinstance(executive.outcome, Failed) else Existence.EXISTS)
        self.asked += 1


@pytest.mark.slow
@each_way
def test_many_executions_stay_correct_until_they_fail(backend, temporal):
    plans = [(number, contested(number)) for number in range(1000)]
    plans = [(number, plan) for number, plan in plans if Oracle(plan).decide().verdict is Existence.EXISTS]
    plans += [(number, drawn(index)) for index in SOLVABLE for number in range(3)]
    asked = 0
    for number, plan in plans:
        confirmed = Confirmed(plan)
        execute(plan, (backend, temporal), number, after_step=confirmed)
        asked += confirmed.asked
    assert len(plans) > 400
    assert asked > 1500
