"""Reasoners with knowledge bases, question by question against the semantic one, in whole executions."""

from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError
from robust.pike import Disturbance, Human, Pace, PlanExecutive, Story, k_intents, make_reasoner, reasoner_names
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import Choice, Constraint, guard
from robust.pike_bridge.online.progress import Completion, Executed, Progress
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.theory import Exclude, Require
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.pike_bridge import stories as figures
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import SOLVABLE, Compared, drawn, kitchen, working
from tests.pike_bridge.plans import random_plan as small_plan
from tests.sampling import often

BACKENDS = tuple(name for name in reasoner_names() if name != "smt")
each_backend = pytest.mark.parametrize("backend", BACKENDS)
PLANS = {
    "k-intents": lambda: k_intents((2, 3)).instance,
    "kitchen": figures.kitchen,
    "wing": figures.wing,
    "figure 23": lambda: figures.figure_23(4),
    **{f"figure {name}": lambda name=name: figures.figure(name) for name in ("8", "9", "11", "13")},
}


class Exactly(Compared):
    """Looks again when the companion would, too, not earlier."""

    def next_time(self, deadline):
        return self._same("next_time", deadline)


def execute(plan, backend, number, *, after_step=lambda *_: None):
    """One simulated execution, decided by a reasoner that is compared with `smt` in every question: times of decisions.

    The number decides about the story, chance and ties.
    """
    make, decided, ties = make_reasoner(backend), [], Random(number)  # noqa: S311 - reproducible

    def both(progress):
        return Exactly(make(progress), SemanticReasoner(progress))

    def note(executive, now, decisions):
        decided.append(now)
        after_step(executive, now, decisions)

    executive = PlanExecutive(plan, both, ranking=lambda values: ties.sample(list(values), len(values)))
    options = {"judge": executive.reasoner.companion, "story": story(plan, number), "horizon": Fraction(500)}
    examples.watch(executive, note, seed=number, **options)
    return executive, decided


def infer(executive, _now, _decisions):
    """Ask, and compare, which values choices may still have."""
    if not executive.ended:
        assert all(executive.possible_values(choice.name) for choice in executive.plan.network.choices)


def story(plan, seed):
    """Rational or careless humans, steady or random paces, and now and then a disturbance."""
    random = Random(seed)  # noqa: S311 - reproducible
    literals = [effect.literal.negation for effect in plan.effects]
    broken = [
        Disturbance(Fraction(random.randint(0, 40), 4), random.choice(literals))
        for _ in range(random.choice((0, 0, 1, 2)) if literals else 0)
    ]
    human, pace = random.choice(list(Human)), random.choice(list(Pace))
    return Story(human=human, pace=pace, disturbances=tuple(broken), delay=Fraction(random.choice((0, 0, 2))))


EXAMPLES = [(name, backend) for name in PLANS if name != "wing" for backend in BACKENDS]
DRAWN = [(SOLVABLE[6 + at % 2 * 2 + more], backend) for at, backend in enumerate(BACKENDS) for more in (0, 1)]


@pytest.mark.parametrize(("name", "backend"), [*EXAMPLES, *DRAWN, pytest.param("wing", "bdd", marks=pytest.mark.slow)])
def test_answers_are_those_of_the_semantics(name, backend):
    """About stories and figures, and about drawn plans, which are numbered."""
    plan, most = (drawn(name), 7) if isinstance(name, int) else (PLANS[name]().plan(), 1)
    seed = 1 if name == "wing" else BACKENDS.index(backend) % 2 * (2 if most > 1 else 1)
    assert len(execute(plan, backend, seed)[1]) > most


def contested(number):
    """A small plan without much structure, whose threats may come on either side of links."""
    return small_plan(Random(number), events=8)  # noqa: S311 - reproducible


@each_backend
def test_answers_about_small_contested_plans_are_those_of_the_semantics(backend):
    executives = [execute(contested(seed), backend, seed, after_step=infer)[0] for seed in range(often(8, 15))]
    assert {"Succeeded", "Failed"} <= {type(executive.outcome).__name__ for executive in executives}


def bound(lower, upper, label=frozenset(), source="begin"):
    lower, upper = (None if each is None else Fraction(each) for each in (lower, upper))
    return Constraint(source, "own", lower, upper, label)


X = (Choice("x", ("1", "2"), True, None),)
FIRST, SECOND = (guard({"x": value}) for value in "12")
DUE = working(bound(1, 9))
"""At 5, the work must end, but has not; what is ours comes later than that, or never."""
REPORTED = working(
    bound(1, None), bound(0, None, FIRST, "end"), bound(5, None, SECOND), bound(None, 4, SECOND), choices=X
)
"""Only x = 1 has times, although nobody has chosen it; then the work has ended when our event happens."""


@each_backend
@pytest.mark.parametrize(("plan", "moment", "ours"), [(DUE, 4, {"own"}), (DUE, 5, set()), (REPORTED, 3, set())])
def test_nothing_happens_before_or_with_what_is_to_be_reported(plan, moment, ours, backend):
    make = make_reasoner(backend)
    executive = PlanExecutive(plan, lambda progress: Compared(make(progress), SemanticReasoner(progress)))
    executive.step(Fraction(0))
    decisions = executive.step(Fraction(moment))
    assert not executive.ended
    assert {each.event for each in decisions if isinstance(each, Executed)} == ours


@each_backend
def test_what_is_due_first_is_looked_for_first(backend):
    plan = working(bound(7, None))
    executive = PlanExecutive(plan, make_reasoner(backend))
    executive.step(Fraction(0))
    assert executive.wake == 5 + plan.epsilon
    executive.step(Fraction(3), [Completion("(work)")])
    assert executive.wake == 7


@each_backend
def test_what_could_be_executed_but_was_not_is_due_next(backend):
    progress = Progress(working(bound(3, 4)), Fraction(3), {"begin": Fraction(0)})
    reasoner, semantic = make_reasoner(backend)(progress), SemanticReasoner(progress)
    assert reasoner.executable("own", NEVER)
    assert reasoner.next_time(NEVER) == semantic.next_time(NEVER) == 3 + progress.grid


def test_a_knowledge_base_is_known_and_not_asked_about_what_it_was_told(monkeypatch):
    """With x = 1 it is too late at 5, of which it is told once."""
    commit, could_commit, heard = PiTms.commit, PiTms.could_commit, {"commit": [], "could": []}

    def told(knowledge, commitments, *deadline):
        heard["commit"] += commitments
        return commit(knowledge, commitments, *deadline)

    def asked(knowledge, commitments, *deadline):
        heard["could"] += commitments
        return could_commit(knowledge, commitments, *deadline)

    monkeypatch.setattr(PiTms, "commit", told)
    monkeypatch.setattr(PiTms, "could_commit", asked)
    plan = working(bound(1, 4, FIRST), bound(1, 9, SECOND), choices=X)
    reasoner = make_reasoner("pitms")(Progress(plan, Fraction(5), {"begin": Fraction(0), "end": Fraction(2)}))
    assert reasoner.executable("own", NEVER)
    assert Exclude(FIRST) in heard["commit"]
    assert Require(frozenset()) in heard["could"]
    assert Exclude(FIRST) not in heard["could"]
    with pytest.raises(InputError, match="unknown reasoner 'bbd'; did you mean 'bdd'"):
        make_reasoner("bbd")


@each_backend
def test_what_was_compiled_can_be_seen_and_a_question_out_of_time_changes_nothing(backend):
    make = make_reasoner(backend)
    assert make(Progress(kitchen())).name == make.compilation.backend == backend
    assert set(make.seconds) >= {"precedence", "links", "knowledge", "windows"}
    with pytest.raises(OutOfTimeError):
        make_reasoner(backend, deadline=Deadline.after(0))(Progress(kitchen()))
    executive = PlanExecutive(kitchen(), make_reasoner(backend))
    executive.step(Fraction(0))
    values = [guard({"xA1": value}) for value in ("mug", "glass")]
    # A continuation that is known already may answer for one of the values without looking at any clock.
    with pytest.raises(OutOfTimeError):
        [executive.reasoner.could(value, Deadline.after(0)) for value in values]
    assert all(executive.reasoner.could(value, NEVER) for value in values)
    assert not executive.reasoner.could(guard({"xA1": "mug", "xA2": "juice"}), NEVER)


@pytest.mark.slow
@each_backend
def test_many_executions_stay_correct_until_they_fail(backend):
    numbered = ((number, contested(number)) for number in range(1000))
    plans = [(number, plan) for number, plan in numbered if examples.possible(plan)]
    plans += [(number, drawn(index)) for index in SOLVABLE for number in range(3)]
    asked = []
    for number, plan in plans:
        execute(plan, backend, number, after_step=examples.confirming(plan, asked))
    assert len(plans) > 400
    assert len(asked) > 1500
