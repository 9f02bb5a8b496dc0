"""The executive, step by step against the semantic oracle, and what it makes of faults."""

from fractions import Fraction
from functools import cache

import pytest

from robust.errors import InputError
from robust.execute.drive import run_in_world
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.model import Assignment, Literal, guard
from robust.pike_bridge.online.companion import Compared
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.explain import Kind, conflict
from robust.pike_bridge.online.progress import (
    Chosen,
    Completion,
    Dispatched,
    Estimate,
    Executed,
    Failed,
    Outcome,
    Rejected,
    Succeeded,
    Violated,
)
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Disturbance, Ending, Human, Pace, Rehearsal, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, Existence, Oracle, faults
from robust.plan.model import Atom
from robust.smt.limits import Deadline
from tests.pike_bridge.online.examples import KITCHEN, SOLVABLE

STEADY = Story()
TOASTER = Atom("working", ("toaster",))


@cache
def kitchen():
    return load_team_plan(KITCHEN)


@cache
def drawn(index):
    return random_plan(0, index).plan()


def rehearse(plan, story=STEADY, seed=0):
    return Rehearsal(plan, story, seed=seed).run()


def decisions(record, kind):
    return [each for step in record.steps for each in step.decisions if isinstance(each, kind)]


def told(record):
    """The choices in the order in which they were made."""
    return [(each.choice, each.value, each.observed) for each in decisions(record, Chosen)]


# -- the stories of the paper ------------------------------------------------------------------------------------------


def test_mug_means_coffee_grounds_and_then_cereal_with_milk():
    record = rehearse(kitchen(), Story(outcomes={"xA1": ("mug", None)}))
    assert record.ending is Ending.SUCCEEDED
    first = next(step for step in record.steps if step.inferred)
    assert first.inferred == {
        "xR1": ("grounds",),
        "xA2": ("coffee",),
        "xA3": ("cereal",),
        "xR2": ("milk",),
        "xA4": ("cereal",),
    }
    assert told(record) == [
        ("xA1", "mug", True),
        ("xR1", "grounds", False),
        ("xA2", "coffee", True),
        ("xA3", "cereal", True),
        ("xR2", "milk", False),
        ("xA4", "cereal", True),
    ]
    begun = {each.action for each in decisions(record, Dispatched)}
    assert {"(get robot grounds)", "(make-coffee human)", "(get robot milk)", "(mix-cereal human)"} <= begun


def test_a_broken_toaster_leaves_cereal():
    broken = Disturbance(Fraction(1), Literal(TOASTER, False))
    record = rehearse(kitchen(), Story(outcomes={"xA1": ("glass", None)}, disturbances=(broken,)))
    assert record.ending is Ending.SUCCEEDED
    (violation,) = decisions(record, Violated)
    assert violation.atom == TOASTER
    assert violation.consumers == ("(toast-bagel human)",)
    step = next(step for step in record.steps if violation in step.decisions)
    assert step.inferred == {"xA3": ("cereal",), "xR2": ("milk",), "xA4": ("cereal",)}
    assert record.choices["xA3"] == "cereal"


def test_without_the_disturbance_a_bagel_is_possible():
    story = Story(outcomes={"xA1": ("glass", None), "xA3": ("bagel", None)})
    assert rehearse(kitchen(), story).choices["xA3"] == "bagel"


def test_a_wrong_choice_fails_at_once_and_says_why():
    story = Story(outcomes={"xA1": ("mug", None), "xA3": ("bagel", None)})
    record = rehearse(kitchen(), story)
    assert record.ending is Ending.FAILED
    assert told(record)[-1] == ("xA3", "bagel", True)
    assert {(fact.kind, fact.text) for fact in record.conflict} == {
        (Kind.CHOICE, "xA2 = coffee"),
        (Kind.CHOICE, "xA3 = bagel"),
    }
    for name, value in (("xA2", "coffee"), ("xA3", "bagel")):
        assert Oracle(kitchen()).decide(guard({name: value})).verdict is Existence.EXISTS
    both = guard({"xA2": "coffee", "xA3": "bagel"})
    assert Oracle(kitchen()).decide(both).verdict is Existence.NONE


# -- correct after every step (Theorem 4.7) ----------------------------------------------------------------------------


def check_against_the_oracle(plan, story, seed):
    """Run, and ask the oracle after each step; how many steps there were, and how it ended."""
    oracle, steps = Oracle(plan), 0
    executive = PlanExecutive(plan, SemanticReasoner)
    decide = executive.step

    def step(now, messages=()):
        nonlocal steps
        found = decide(now, messages)
        progress = executive.progress
        answer = oracle.decide(guard(progress.chosen), progress.times, now=progress.now)
        expected = Existence.NONE if isinstance(executive.outcome, Failed) else Existence.EXISTS
        assert answer.verdict is expected, (plan.name, seed, now)
        steps += 1
        return found

    executive.step = step
    run_in_world(executive, SimulatedTeam(plan, executive, executive.reasoner, story, seed=seed))
    if isinstance(executive.outcome, Succeeded):
        scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | executive.progress.chosen
        assert faults(plan, Execution(scenario, executive.progress.times)) == ()
    return steps, executive.outcome


STORIES = (Story(), Story(human=Human.CARELESS), Story(pace=Pace.RANDOM), Story(delay=Fraction(3)))


@pytest.mark.parametrize("story", STORIES, ids=["rational", "careless", "random pace", "hesitant"])
def test_the_kitchen_stays_correct_until_it_fails(story):
    outcomes = [check_against_the_oracle(kitchen(), story, seed) for seed in range(4)]
    assert sum(steps for steps, _ in outcomes) > 30
    if story.human is Human.RATIONAL and story.pace is Pace.COOPERATIVE and not story.delay:
        assert all(isinstance(outcome, Succeeded) for _, outcome in outcomes)


@pytest.mark.parametrize("index", SOLVABLE[:4])
def test_drawn_plans_stay_correct_until_they_fail(index):
    steps, outcome = check_against_the_oracle(drawn(index), Story(), 0)
    assert steps > 5
    assert outcome is not None


@pytest.mark.slow
@pytest.mark.parametrize("index", SOLVABLE)
def test_many_drawn_plans_stay_correct_until_they_fail(index):
    for seed, story in enumerate(STORIES * 2):
        steps, _ = check_against_the_oracle(drawn(index), story, seed)
        assert steps


def test_two_solvers_allow_the_same():
    plan = kitchen()

    def both(progress):
        return Compared(SemanticReasoner(progress), SemanticReasoner(progress, solver="cvc5"))

    executive = PlanExecutive(plan, both)
    judge = executive.reasoner.deciding
    run_in_world(executive, SimulatedTeam(plan, executive, judge, Story(), seed=1))
    assert isinstance(executive.outcome, Succeeded)


class Abridged(SemanticReasoner):
    """Asks a second time when something is executable first, without what the witness and single constraints say."""

    whole = False

    def _earliest_execution(self, deadline):
        found = super()._earliest_execution(deadline)
        self.whole, self.progress.waits = True, lambda event: False
        try:
            assert super()._earliest_execution(deadline) == found
        finally:
            self.whole = False
            del self.progress.waits
        return found

    def _executes_at(self, event, moment):
        return not self.whole and super()._executes_at(event, moment)


@pytest.mark.parametrize("index", [None, *SOLVABLE[:3]])
def test_what_the_witness_answers_is_what_the_solver_says(index):
    plan = kitchen() if index is None else drawn(index)
    executive = PlanExecutive(plan, Abridged)
    run_in_world(executive, SimulatedTeam(plan, executive, executive.reasoner, Story(), seed=1))
    assert executive.outcome is not None
    assert len(executive.progress.times) > 5


# -- resuming ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", [1, 5, 9])
def test_a_repeated_record_goes_on_as_the_original_did(cut):
    plan = kitchen()
    record = rehearse(plan, Story(outcomes={"xA1": ("mug", None)}))
    resumed = PlanExecutive(plan, SemanticReasoner)
    for step in record.steps[:cut]:
        resumed.repeat(step.time, step.messages, step.decisions)
    for step in record.steps[cut:]:
        assert tuple(resumed.step(step.time, step.messages)) == step.decisions
    assert dict(resumed.progress.times) == record.schedule
    assert isinstance(resumed.outcome, Succeeded)


def test_a_repeated_failure_stays_one():
    record = rehearse(kitchen(), Story(outcomes={"xA1": ("mug", None), "xA3": ("bagel", None)}))
    resumed = PlanExecutive(kitchen(), SemanticReasoner)
    for step in record.steps:
        resumed.repeat(step.time, step.messages, step.decisions)
    assert isinstance(resumed.outcome, Failed)


# -- faults ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def started():
    """The kitchen after the first two moments: the human is about to choose a vessel."""
    executive = PlanExecutive(kitchen(), SemanticReasoner)
    executive.step(Fraction(0))
    executive.step(Fraction(1, 1000))
    return executive


def only(found, kind):
    matching = [each for each in found if isinstance(each, kind)]
    assert len(matching) == 1, found
    return matching[0]


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Outcome("xA9", "mug"), "there is no choice 'xA9'"),
        (Outcome("xA1", "bucket"), "expected one of mug, glass"),
        (Outcome("xR1", "grounds"), "xR1 is for the executive to choose"),
        (Completion("(fly human)"), "there is no such activity"),
        (Completion("(get human mug)"), "it is not running"),
        (Estimate(true=frozenset({TOASTER}), false=frozenset({TOASTER})), "is said to be both true and false"),
    ],
    ids=["unknown choice", "unknown value", "not theirs", "unknown activity", "not running", "contradiction"],
)
def test_messages_that_make_no_sense_change_nothing(started, message, reason):
    before = dict(started.progress.times), dict(started.progress.chosen)
    found = started.step(started.progress.now, [message])
    assert reason in only(found, Rejected).reason
    assert (dict(started.progress.times), dict(started.progress.chosen)) == before
    assert not started.ended


def test_a_repeated_outcome_is_ignored_and_another_one_contradicts_it(started):
    started.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
    assert only(started.step(Fraction(1, 1000), [Outcome("xA1", "mug")]), Rejected).reason == "known already"
    second = only(started.step(Fraction(1, 1000), [Outcome("xA1", "glass")]), Rejected)
    assert second.reason == "xA1 = mug was observed before"
    assert started.progress.chosen["xA1"] == "mug"


def begin_to_get_the_mug(executive):
    executive.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
    while not executive.running:
        executive.step(executive.wake)
    return executive.progress.now


def test_an_activity_ends_only_once(started):
    begun = begin_to_get_the_mug(started)
    completion = Completion("(get human mug)")
    assert only(started.step(begun + 1, [completion]), Executed).reported
    assert only(started.step(begun + 1, [completion]), Rejected).reason == "it is not running"


@pytest.mark.parametrize("late", [False, True], ids=["early", "late"])
def test_an_activity_that_ends_outside_its_bounds_is_a_failure(started, late):
    begun = begin_to_get_the_mug(started)
    time = begun + (Fraction(21, 10) if late else Fraction(1, 10))
    found = started.step(time, [Completion("(get human mug)")])
    assert isinstance(found[-1], Failed)
    assert conflict(started.progress)


def test_an_activity_that_never_ends_is_noticed_as_soon_as_it_is_too_late(started):
    begun = begin_to_get_the_mug(started)
    while not started.ended:
        wake = started.wake
        assert wake is not None
        started.step(wake)
    assert isinstance(started.outcome, Failed)
    assert started.outcome.time == begun + 2 + Fraction(1, 1000)


def test_a_clock_that_goes_back_is_said_and_stands_still(started):
    begin_to_get_the_mug(started)
    now = started.progress.now
    assert "went back" in only(started.step(Fraction(0)), Rejected).reason
    assert started.progress.now == now


def test_a_clock_that_jumps_ahead_misses_what_was_due(started):
    begin_to_get_the_mug(started)
    assert isinstance(started.step(Fraction(1000))[-1], Failed)


def test_nothing_counts_after_the_end(started):
    started.step(Fraction(1000))
    found = started.step(Fraction(1001), [Outcome("xA1", "mug")])
    assert only(found, Rejected).reason == "the execution has ended"


def test_planned_changes_are_no_violations():
    """What an activity is meant to undo is seen to be undone: nothing is announced."""
    record = rehearse(kitchen(), Story(outcomes={"xA1": ("glass", None)}))
    assert decisions(record, Violated) == []


def test_a_plan_without_correct_execution_fails_in_the_first_step():
    plan = random_plan(0, 1).plan()
    assert Oracle(plan).decide().verdict is Existence.NONE
    executive = PlanExecutive(plan, SemanticReasoner)
    assert not executive.prepare()
    assert isinstance(executive.step(Fraction(0))[-1], Failed)
    assert conflict(executive.progress) == ()


def test_possible_values_are_those_of_the_oracle(started):
    oracle = Oracle(kitchen())
    for choice in kitchen().network.choices:
        expected = tuple(
            value
            for value in choice.domain
            if oracle.decide(
                guard(started.progress.chosen) | {Assignment(choice.name, value)},
                started.progress.times,
                now=started.progress.now,
            ).verdict
            is Existence.EXISTS
        )
        assert started.possible_values(choice.name) == expected


def test_a_passed_deadline_ends_the_rehearsal_with_what_has_happened():
    record = Rehearsal(kitchen(), deadline=Deadline.after(0)).run()
    assert record.ending is Ending.TIMEOUT
    assert record.steps == ()


# -- who decides -------------------------------------------------------------------------------------------------------


def test_a_back_end_decides_and_the_team_has_a_judge_of_its_own(monkeypatch):
    """A back end that differs from the judge: what it is told and asked is recorded."""
    asked = []

    class Listening(SemanticReasoner):
        name = "listening"

        def executable(self, event, deadline):
            asked.append(event)
            return super().executable(event, deadline)

    monkeypatch.setattr("robust.pike_bridge.online.world.make_reasoner", lambda name, *, solver, deadline: Listening)
    story = Story(outcomes={"xA1": ("mug", None)})
    plain = Rehearsal(kitchen(), story).run()
    assert not asked
    record = Rehearsal(kitchen(), story, backend="listening").run()
    assert asked
    assert record.schedule == plain.schedule
    assert record.choices == plain.choices


def test_a_back_end_that_does_not_exist():
    with pytest.raises(InputError, match="unknown reasoner 'smtt'; did you mean 'smt'"):
        Rehearsal(kitchen(), backend="smtt").run()
