"""Reasoners with knowledge bases, question by question against the semantic one, in whole executions."""

from fractions import Fraction
from functools import cache
from random import Random

import pytest

from robust.errors import InputError
from robust.pike_bridge.builder import k_intents
from robust.pike_bridge.model import Choice, Constraint, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Executed, Progress
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Disturbance, Human, Pace, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.pike_bridge import stories as figures
from tests.pike_bridge.online.examples import SOLVABLE, Compared, confirming, drawn, kitchen, watch, working
from tests.pike_bridge.plans import random_plan as small_plan

BACKENDS = tuple(name for name in reasoner_names() if name != "smt")
each_backend = pytest.mark.parametrize("backend", BACKENDS)

PLANS = {
    "kitchen": figures.kitchen,
    "wing": figures.wing,
    "k-intents": lambda: k_intents((2, 3)).instance,
    "figure_23": lambda: figures.figure_23(4),
    **{each.__name__: each for each in (figures.figure_8, figures.figure_9, figures.figure_11, figures.figure_13)},
}


@cache
def named(name):
    return PLANS[name]().plan()


def contested(number):
    """A small plan without much structure, whose threats may come on either side of links."""
    return small_plan(Random(number), events=8)  # noqa: S311 - reproducible


class Exactly(Compared):
    """Looks again when the companion would, too, not earlier."""

    def next_time(self, deadline):
        return self._same("next_time", deadline)


def execute(plan, backend, number, *, after_step=lambda *_: None):
    """One simulated execution, decided by a reasoner that is compared with `smt` in every question: times of decisions.

    Args:
        number: decides about the story, chance and ties.
    """
    make, decided, judges = make_reasoner(backend), [], []

    def both(progress):
        judges.append(SemanticReasoner(progress))
        return Exactly(make(progress), judges[0])

    def note(executive, now, found):
        decided.append(now)
        after_step(executive, now, found)

    executive = PlanExecutive(plan, both, ranking=shuffled(number))
    watch(executive, note, judge=judges[0], story=story(plan, number), seed=number, horizon=Fraction(500))
    return executive, decided


def infer(executive, _now, _found):
    """Ask, and compare, which values choices may still have."""
    if not executive.ended:
        for choice in executive.plan.network.choices:
            assert executive.possible_values(choice.name)


def shuffled(seed):
    """Ties are broken anyhow, but always in the same way."""
    random = Random(seed)  # noqa: S311 - reproducible

    def rank(alternatives):
        return random.sample(list(alternatives), len(alternatives))

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


EXAMPLES = [(name, backend) for name in PLANS for backend in (BACKENDS if name != "wing" else ("bdd",))]


@pytest.mark.parametrize(("name", "backend"), EXAMPLES)
def test_answers_about_examples_are_those_of_the_semantics(name, backend):
    seed = 1 if name == "wing" else BACKENDS.index(backend) % 2
    assert len(execute(named(name), backend, seed)[1]) > 1


@each_backend
def test_answers_about_drawn_plans_are_those_of_the_semantics(backend):
    place = 2 * (BACKENDS.index(backend) % 2)
    steps = [len(execute(drawn(each), backend, place)[1]) for each in SOLVABLE[6 + place : 8 + place]]
    assert sum(steps) > 20


@each_backend
def test_answers_about_small_contested_plans_are_those_of_the_semantics(backend):
    ended = set()
    for seed in range(15):
        executive, _ = execute(contested(seed), backend, seed, after_step=infer)
        ended.add(type(executive.outcome).__name__)
    assert {"Succeeded", "Failed"} <= ended


def compared_executive(plan, backend):
    """After its first step."""
    make = make_reasoner(backend)
    executive = PlanExecutive(plan, lambda progress: Compared(make(progress), SemanticReasoner(progress)))
    executive.step(Fraction(0))
    return executive


DUE = working(Constraint("begin", "own", Fraction(1), Fraction(9)))
"""At 5, the work must end, but has not; what is ours comes later than that, or never."""
FIRST, SECOND = (guard({"x": value}) for value in "12")
REPORTED = working(
    Constraint("begin", "own", Fraction(1), None),
    Constraint("end", "own", Fraction(0), None, FIRST),
    Constraint("begin", "own", Fraction(5), None, SECOND),
    Constraint("begin", "own", None, Fraction(4), SECOND),
    choices=(Choice("x", ("1", "2"), True, None),),
)
"""Only x = 1 has times, although nobody has chosen it; then the work has ended when our event happens."""


@each_backend
@pytest.mark.parametrize(("plan", "moment", "ours"), [(DUE, 4, {"own"}), (DUE, 5, set()), (REPORTED, 3, set())])
def test_nothing_happens_before_or_with_what_is_to_be_reported(plan, moment, ours, backend):
    executive = compared_executive(plan, backend)
    found = executive.step(Fraction(moment))
    assert not executive.ended
    assert {each.event for each in found if isinstance(each, Executed)} == ours


@each_backend
def test_what_is_due_first_is_looked_for_first(backend):
    plan = working(Constraint("begin", "own", Fraction(7), None))
    executive = PlanExecutive(plan, make_reasoner(backend))
    executive.step(Fraction(0))
    assert executive.wake == 5 + plan.epsilon
    executive.step(Fraction(3), [Completion("(work)")])
    assert executive.wake == 7


@each_backend
def test_times_off_the_grid_are_exact(backend):
    """As a clock has them: thirds of a second, which no unit of the plan divides."""
    executive = compared_executive(kitchen(), backend)
    for third in range(1, 9):
        executive.step(Fraction(third, 3))
        executive.reasoner.deciding.next_time(NEVER)
    assert len(executive.progress.times) > 1


@each_backend
def test_what_was_compiled_can_be_seen(backend):
    make = make_reasoner(backend)
    reasoner = make(Progress(kitchen()))
    assert reasoner.name == make.compilation.backend == backend
    assert set(make.seconds) >= {"precedence", "links", "knowledge", "windows"}
    with pytest.raises(OutOfTimeError):
        make_reasoner(backend, deadline=Deadline.after(0))(Progress(kitchen()))


@each_backend
def test_a_question_that_runs_out_of_time_changes_nothing(backend):
    executive = PlanExecutive(kitchen(), make_reasoner(backend))
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


@pytest.mark.slow
@each_backend
def test_many_executions_stay_correct_until_they_fail(backend):
    plans = [(number, contested(number)) for number in range(1000)]
    plans = [(number, plan) for number, plan in plans if Oracle(plan).decide().verdict is ExecutionExistence.EXISTS]
    plans += [(number, drawn(index)) for index in SOLVABLE for number in range(3)]
    asked = []
    for number, plan in plans:
        execute(plan, backend, number, after_step=confirming(plan, asked))
    assert len(plans) > 400
    assert len(asked) > 1500
