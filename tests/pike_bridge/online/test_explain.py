"""Reasons: minimal conflicts are conflicts and minimal, supporting schedules are correct, and the words tell why."""

from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.pike_bridge.generators.stories import figure_6b, figure_7b
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.explain import About, Situation
from robust.pike_bridge.online.inquiry import (
    Inquiry,
    Obstacle,
    WhyChosen,
    WhyExecuted,
    WhyNot,
    why,
    why_failed,
    why_not,
)
from robust.pike_bridge.online.progress import Completion, Outcome
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Ending, Human, Rehearsal, Story
from robust.pike_bridge.semantics import faults
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from tests.pike_bridge.online.examples import BROKEN, MUG, SOLVABLE, drawn, fetching, kitchen, started, tale, watch

PLANS = {
    "kitchen": kitchen,
    "figure 6b": lambda: figure_6b().plan(),
    "figure 7b": lambda: figure_7b().plan(),
    **{f"drawn {index}": lambda index=index: drawn(index) for index in SOLVABLE[:5]},
}
THOROUGH = ("drawn 4", "drawn 5", "drawn 16", "drawn 17")


# -- truth -------------------------------------------------------------------------------------------------------------


def contradict(situation, statements):
    """Asked of another solver, from scratch."""
    session = Session(situation.semantics.terms, solver="cvc5")
    session.add(*situation.semantics.domains, *(each.formula for each in statements))
    verdict = session.check("a test")
    assert verdict is not Verdict.UNKNOWN
    return verdict is Verdict.UNSATISFIABLE


def check_minimal(situation, conflict):
    assert contradict(situation, conflict)
    for left_out in range(len(conflict)):
        fewer = [each for at, each in enumerate(conflict) if at != left_out]
        assert not contradict(situation, fewer), [each.fact.text for each in conflict]


def check_moment(executive):
    """All questions about one moment; how many conflicts there were."""
    plan, conflicts = executive.plan, 0
    situation = Situation(executive.progress)
    questions = [
        situation.assignments(About.ASSUMPTION, [Assignment(choice.name, value)])
        for choice in plan.network.choices
        for value in choice.domain
    ]
    questions += [[situation.executed_now(event), *situation.unreported()] for event in executive.progress.frontier]
    for hypotheses in questions:
        conflict = situation.conflict(hypotheses)
        continuation = situation.continuation(hypotheses)
        assert (conflict is None) == (continuation is not None)
        if conflict is None:
            assert faults(plan, continuation) == ()
            assert executive.progress.times.items() <= continuation.schedule.items()
            assert executive.progress.chosen.items() <= continuation.scenario.items()
        else:
            check_minimal(situation, conflict)
            conflicts += 1
    return conflicts


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.slow if each in THOROUGH else ()) for each in PLANS]
)
def test_conflicts_are_minimal_and_schedules_correct(name):
    moments, conflicts = [], []

    def look(executive, now, found):
        if found and len(moments) < 12:
            moments.append(now)
            if len(moments) % 4 == 0:
                conflicts.append(check_moment(executive))

    executive = PlanExecutive(PLANS[name](), SemanticReasoner)
    watch(executive, look, story=Story(human=Human.CARELESS), seed=1)
    assert sum(conflicts) + check_moment(executive)


def test_a_conflict_of_a_situation_is_about_the_moment_at_which_it_was_made():
    executive = PlanExecutive(kitchen(), SemanticReasoner)
    inquiry = Inquiry(executive.progress)
    executive.step(Fraction(0))
    executive.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
    assert inquiry.why_not_assignment(Assignment("xA2", "juice")).obstacle is Obstacle.NONE


# -- words -------------------------------------------------------------------------------------------------------------


def explained(*disturbances, **outcomes):
    return Rehearsal(kitchen(), tale(*disturbances, **outcomes), explain=True).run()


def inferences(record):
    return {choice: why for step in record.steps for choice, why in step.reasons.inferences.items()}


def test_mug_means_coffee_and_grounds_and_then_no_time_for_a_bagel():
    found = inferences(explained(xA1="mug"))
    assert found["xA2"].text.splitlines() == [
        "not juice, as xA1 = mug:",
        "  (pour-juice human) needs (have glass), which only (get human glass) establishes, if xA1 = glass",
    ]
    assert found["xR1"].text.splitlines() == [
        "not juice, as xA2 = coffee:",
        "  (make-coffee human) needs (have grounds), which only (get robot grounds) establishes, if xR1 = grounds",
    ]
    assert "(toast-bagel human) 2.5, (spread human) 0.5: 7.2 in all" in found["xA3"].text
    assert "but at most 7 from the beginning (e1) to the end (e44)" in found["xA3"].text
    assert found["xR2"].text.splitlines()[0] in {
        "not cream-cheese, as xA4 = cereal:",
        "not cream-cheese, as xA3 = cereal:",
    }


def test_a_broken_toaster_is_the_reason_for_cereal():
    found = inferences(explained(BROKEN, xA1="glass"))
    lines = found["xA4"].text.splitlines()
    assert lines[0] == "not bagel:"
    assert "(working toaster) from the initial state does not hold any more for (toast-bagel human)" in lines[1]
    assert "(toast-bagel human) needs (working toaster), which only the initial state establishes" in lines[2]


def test_a_failure_is_explained_by_the_plan_as_well():
    record = explained(xA1="mug", xA3="bagel")
    assert record.ending is Ending.FAILED
    why = record.steps[-1].reasons.decisions[-1]
    assert why.obstacle is Obstacle.ENDED
    assert {"xA3 = bagel", "xA2 = coffee"} <= {fact.text for fact in why.conflict.facts}
    assert "at most 7" in why.text


def test_each_dispatch_says_what_it_is_for():
    record = explained(xA1="mug")
    texts = [why.text for step in record.steps for why in step.reasons.decisions if isinstance(why, WhyExecuted)]
    assert any(
        "establishes (brewed) for (pour-coffee human); uses (have grounds) from (get robot grounds); not later" in each
        for each in texts
    )
    for step in record.steps:
        assert faults(kitchen(), step.reasons.continuation) == ()


def test_reasons_change_no_decision():
    with_reasons, without = (Rehearsal(kitchen(), MUG, explain=each).run() for each in (True, False))
    assert [each.decisions for each in with_reasons.steps] == [each.decisions for each in without.steps]


# -- questions at any time ---------------------------------------------------------------------------------------------


@pytest.fixture
def early():
    return started()


@pytest.fixture
def running():
    return fetching()


def test_why_not_yet(early):
    assert why_not(early, "e1").obstacle is Obstacle.DONE
    waiting = why_not(early, "e2")
    assert (waiting.obstacle, waiting.text) == (Obstacle.AWAITED, "waiting to learn xA1, which is not for us to choose")
    later = why_not(early, "e14")
    assert later.obstacle is Obstacle.EARLY
    assert "still to come" in later.text


def test_why_not_while_an_activity_runs(running):
    begun = running.progress.times["e3"]
    assert why_not(running, "e4").text == "waiting for (get human mug) to end, begun at 0.003"
    assert begun == Fraction(3, 1000)
    assert why_not(running, "e5").text == "start of (get human glass) is not done, as xA1 = mug"


def test_why_not_a_value(running):
    assert why_not(running, Assignment("xA1", "glass")).text == "xA1 = mug has been decided"
    found = why_not(running, Assignment("xA3", "bagel"))
    assert found.obstacle is Obstacle.CONFLICT
    assert found.as_dict()["conflict"]
    assert why_not(running, Assignment("xA3", "cereal")).obstacle is Obstacle.NONE


def test_why(running):
    begun = why(running, "e3")
    assert isinstance(begun, WhyExecuted)
    assert begun.latest is not None
    assert begun.latest > running.progress.times["e3"]
    chosen = why(running, Assignment("xR1", "grounds"))
    assert isinstance(chosen, WhyChosen)
    assert set(chosen.impossible) == {"juice"}
    inferred = why(running, Assignment("xA3", "cereal"))
    assert isinstance(inferred, WhyChosen)
    assert set(inferred.impossible) == {"bagel"}
    assert isinstance(why(running, Assignment("xA3", "bagel")), WhyNot)
    assert why_failed(running).obstacle is Obstacle.NONE


def test_the_latest_time_is_one_that_leaves_a_correct_execution(running):
    """Held against the executive: it fails if that time is missed."""
    latest = why(running, "e3").latest
    for late, ends in ((Fraction(0), False), (Fraction(1, 1000), True)):
        executive = started()
        executive.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
        executive.step(Fraction(2, 1000))
        executive.step(latest + late)
        assert executive.ended is ends


def test_why_it_failed(running):
    running.step(running.progress.now + Fraction(1, 10), [Completion("(get human mug)")])
    found = why_not(running, "e7")
    assert found.obstacle is Obstacle.ENDED
    assert "(get human mug) takes at least 0.5" in found.text
    assert "end of (get human mug) at 0.103" in found.text


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ("e99", "unknown event e99"),
        (Assignment("xA9", "mug"), "unknown choice"),
        (Assignment("xA1", "x"), "no value x"),
    ],
)
def test_questions_about_what_is_not_in_the_plan(early, question, said):
    for ask in (why, why_not):
        with pytest.raises(InputError, match=said):
            ask(early, question)


def test_a_passed_deadline_ends_the_question(early):
    with pytest.raises(OutOfTimeError):
        why_not(early, Assignment("xA3", "bagel"), deadline=Deadline.after(0))
