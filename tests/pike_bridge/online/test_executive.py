"""The executive, step by step against the semantic oracle, and what it makes of faults."""

from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.execute.drive import run_in_world
from robust.pike_bridge.builder import act, build, parallel
from robust.pike_bridge.model import Assignment, TeamPlan, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.explain import About, conflict
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
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Ending, Human, Pace, Rehearsal, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, Existence, Oracle, faults
from robust.smt.limits import Deadline
from tests.pike_bridge.online.examples import (
    BROKEN,
    MUG,
    SOLVABLE,
    TOASTER,
    Compared,
    drawn,
    fetching,
    kitchen,
    started,
    tale,
    watch,
)


def rehearse(story):
    return Rehearsal(kitchen(), story).run()


def decisions(record, kind):
    return [each for step in record.steps for each in step.decisions if isinstance(each, kind)]


def told(record):
    """The choices in the order in which they were made."""
    return [(each.choice, each.value, each.observed) for each in decisions(record, Chosen)]


# -- the stories of the paper ------------------------------------------------------------------------------------------


def test_mug_means_coffee_grounds_and_then_cereal_with_milk():
    record = rehearse(MUG)
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
    record = rehearse(tale(BROKEN, xA1="glass"))
    assert record.ending is Ending.SUCCEEDED
    (violation,) = decisions(record, Violated)
    assert violation.atom == TOASTER
    assert violation.consumers == ("(toast-bagel human)",)
    step = next(step for step in record.steps if violation in step.decisions)
    assert step.inferred == {"xA3": ("cereal",), "xR2": ("milk",), "xA4": ("cereal",)}
    assert record.choices["xA3"] == "cereal"


def test_without_the_disturbance_a_bagel_is_possible():
    assert rehearse(tale(xA1="glass", xA3="bagel")).choices["xA3"] == "bagel"


def test_a_wrong_choice_fails_at_once_and_says_why():
    record = rehearse(tale(xA1="mug", xA3="bagel"))
    assert record.ending is Ending.FAILED
    assert told(record)[-1] == ("xA3", "bagel", True)
    assert {(fact.kind, fact.text) for fact in record.conflict} == {
        (About.CHOICE, "xA2 = coffee"),
        (About.CHOICE, "xA3 = bagel"),
    }
    for name, value in (("xA2", "coffee"), ("xA3", "bagel")):
        assert Oracle(kitchen()).decide(guard({name: value})).verdict is Existence.EXISTS
    both = guard({"xA2": "coffee", "xA3": "bagel"})
    assert Oracle(kitchen()).decide(both).verdict is Existence.NONE


# -- correct after every step (Theorem 4.7) ----------------------------------------------------------------------------


def check_against_the_oracle(plan, story, seed):
    """Run, and ask the oracle after each step; how many steps there were, and how it ended."""
    oracle, steps = Oracle(plan), []

    def confirm(executive, now, _found):
        progress = executive.progress
        answer = oracle.decide(guard(progress.chosen), progress.times, now=progress.now)
        expected = Existence.NONE if isinstance(executive.outcome, Failed) else Existence.EXISTS
        assert answer.verdict is expected, (plan.name, seed, now)
        steps.append(now)

    executive = PlanExecutive(plan, SemanticReasoner)
    watch(executive, confirm, story=story, seed=seed)
    if isinstance(executive.outcome, Succeeded):
        scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | executive.progress.chosen
        assert faults(plan, Execution(scenario, executive.progress.times)) == ()
    return len(steps), executive.outcome


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
    record = rehearse(MUG)
    resumed = PlanExecutive(plan, SemanticReasoner)
    for step in record.steps[:cut]:
        resumed.repeat(step.time, step.messages, step.decisions)
    for step in record.steps[cut:]:
        assert tuple(resumed.step(step.time, step.messages)) == step.decisions
    assert dict(resumed.progress.times) == record.schedule
    assert isinstance(resumed.outcome, Succeeded)


def test_a_repeated_failure_stays_one():
    record = rehearse(tale(xA1="mug", xA3="bagel"))
    resumed = PlanExecutive(kitchen(), SemanticReasoner)
    for step in record.steps:
        resumed.repeat(step.time, step.messages, step.decisions)
    assert isinstance(resumed.outcome, Failed)


# -- faults ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def before_a_choice():
    return started()


@pytest.fixture
def running():
    return fetching()


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
def test_messages_that_make_no_sense_change_nothing(before_a_choice, message, reason):
    before = dict(before_a_choice.progress.times), dict(before_a_choice.progress.chosen)
    found = before_a_choice.step(before_a_choice.progress.now, [message])
    assert reason in only(found, Rejected).reason
    assert (dict(before_a_choice.progress.times), dict(before_a_choice.progress.chosen)) == before
    assert not before_a_choice.ended


def test_a_repeated_outcome_is_ignored_and_another_one_contradicts_it(before_a_choice):
    before_a_choice.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
    assert only(before_a_choice.step(Fraction(1, 1000), [Outcome("xA1", "mug")]), Rejected).reason == "known already"
    second = only(before_a_choice.step(Fraction(1, 1000), [Outcome("xA1", "glass")]), Rejected)
    assert second.reason == "xA1 = mug was observed before"
    assert before_a_choice.progress.chosen["xA1"] == "mug"


def test_an_activity_ends_only_once(running):
    begun = running.progress.now
    completion = Completion("(get human mug)")
    assert only(running.step(begun + 1, [completion]), Executed).reported
    assert only(running.step(begun + 1, [completion]), Rejected).reason == "it is not running"


@pytest.mark.parametrize("late", [False, True], ids=["early", "late"])
def test_an_activity_that_ends_outside_its_bounds_is_a_failure(running, late):
    begun = running.progress.now
    time = begun + (Fraction(21, 10) if late else Fraction(1, 10))
    found = running.step(time, [Completion("(get human mug)")])
    assert isinstance(found[-1], Failed)
    assert conflict(running.progress)


def test_an_activity_that_never_ends_is_noticed_as_soon_as_it_is_too_late(running):
    begun = running.progress.now
    while not running.ended:
        wake = running.wake
        assert wake is not None
        running.step(wake)
    assert isinstance(running.outcome, Failed)
    assert running.outcome.time == begun + 2 + Fraction(1, 1000)


def test_a_clock_that_goes_back_is_said_and_stands_still(running):
    now = running.progress.now
    assert "went back" in only(running.step(Fraction(0)), Rejected).reason
    assert running.progress.now == now


def test_a_clock_that_jumps_ahead_misses_what_was_due(running):
    assert isinstance(running.step(Fraction(1000))[-1], Failed)


def test_nothing_counts_after_the_end(before_a_choice):
    before_a_choice.step(Fraction(1000))
    found = before_a_choice.step(Fraction(1001), [Outcome("xA1", "mug")])
    assert only(found, Rejected).reason == "the execution has ended"


class Anything(Reasoner):
    """Nothing is impossible: what executives do by themselves."""

    name = "anything"

    def __init__(self, progress):
        super().__init__(progress)
        self.told = []

    def observed(self, assignment):
        self.told.append(str(assignment))

    def executed(self, event):
        self.told.append(event)

    def voided(self, effect, condition):
        self.told.append("voided")

    def advanced(self):
        self.told.append("advanced")

    def possible(self, deadline):
        return True

    def executable(self, event, deadline):
        return True

    def could(self, environment, deadline):
        return True

    def next_time(self, deadline):
        return None


def test_the_same_action_twice_at_a_time():
    plan = TeamPlan(build("twice", parallel(act("(a)", 1, 9), act("(a)", 2, 9))), (), ())
    executive = PlanExecutive(plan, Anything)
    assert executive.prepare()
    first, second = (each.target for each in plan.network.activities)
    for now in range(4):
        executive.step(Fraction(now))
    assert sorted(executive.running) == [0, 1]
    rejected = only(executive.step(Fraction(3), [Completion("(a)")]), Rejected)
    assert rejected.reason == "several run; say at which event it ends"
    assert only(executive.step(Fraction(3), [Completion("(a)", "e99")]), Rejected).reason == "it is not running"
    assert executive.step(Fraction(4), [Completion("(a)", second)])[0] == Executed(second, Fraction(4), reported=True)
    assert sorted(executive.running) == [0]
    assert executive.step(Fraction(4), [Completion("(a)")])[0] == Executed(first, Fraction(4), reported=True)
    assert not executive.running


def test_only_a_later_time_is_news():
    executive = PlanExecutive(kitchen(), Anything)
    executive.step(Fraction(0))
    assert "advanced" not in executive.reasoner.told
    executive.step(Fraction(1))
    executive.step(Fraction(1))
    assert executive.reasoner.told.count("advanced") == 1
    assert executive.progress.now == 1


def test_planned_changes_are_no_violations():
    """What an activity is meant to undo is seen to be undone: nothing is announced."""
    record = rehearse(tale(xA1="glass"))
    assert decisions(record, Violated) == []


def test_a_plan_without_correct_execution_fails_in_the_first_step():
    plan = drawn(1)
    assert Oracle(plan).decide().verdict is Existence.NONE
    executive = PlanExecutive(plan, SemanticReasoner)
    assert not executive.prepare()
    assert isinstance(executive.step(Fraction(0))[-1], Failed)
    assert conflict(executive.progress) == ()


def test_possible_values_are_those_of_the_oracle(before_a_choice):
    oracle = Oracle(kitchen())
    for choice in kitchen().network.choices:
        expected = tuple(
            value
            for value in choice.domain
            if oracle.decide(
                guard(before_a_choice.progress.chosen) | {Assignment(choice.name, value)},
                before_a_choice.progress.times,
                now=before_a_choice.progress.now,
            ).verdict
            is Existence.EXISTS
        )
        assert before_a_choice.possible_values(choice.name) == expected


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
    plain = rehearse(MUG)
    assert not asked
    record = Rehearsal(kitchen(), MUG, backend="listening").run()
    assert asked
    assert record.schedule == plain.schedule
    assert record.choices == plain.choices


def test_a_back_end_that_does_not_exist():
    with pytest.raises(InputError, match="unknown reasoner 'smtt'; did you mean 'smt'"):
        Rehearsal(kitchen(), backend="smtt").run()
