"""Waiting for people: the exact definition on small plans, the stories, and executions against another check."""

from fractions import Fraction
from random import Random

import pytest

from robust.pike import Pace, make_reasoner
from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.continuations import Continuation
from robust.pike_bridge.online.executive import LatestMoments, PlanExecutive
from robust.pike_bridge.online.inquiry import Inquiry, Obstacle, why_not
from robust.pike_bridge.online.patience import JOINT, intents
from robust.pike_bridge.online.progress import Chosen, Excluded, Executed, Failed, Outcome, Progress, Succeeded
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Rehearsal, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle, faults, holds
from tests.pike_bridge import stories
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import SOLVABLE, drawn, hesitate, joint_values, kitchen
from tests.sampling import often

ZERO = Fraction(0)
U, R, S = (Choice(name, ("1", "2"), name != "u", event) for name, event in (("u", "ask"), ("r", "act"), ("s", "skip")))


def bound(source, target, lower=0, upper=None, **given):
    return Constraint(source, target, Fraction(lower), None if upper is None else Fraction(upper), guard(given))


def plan_of(events, choices, *constraints):
    events = tuple(Event(name, guard(dict(label))) for name, label in events.items())
    return TeamPlan(Tpnu("small", tuple(choices), events, constraints, ()), (), ())


def asking(*constraints, choices=(U, R), events=()):
    """Someone decides u at `ask` within 20, we the same of r at `act` within 10, or the end is too late."""
    always = [bound("begin", name, upper=upper) for name, upper in (("ask", 20), ("act", 10), ("end", 50))]
    always += [bound(name, "end") for name in ("act", "ask")]
    always += [bound("begin", "end", 100, u=theirs, r=ours) for theirs, ours in ("12", "21")]
    return plan_of(dict.fromkeys(("begin", "ask", "act", "end", *events), ()), choices, *always, *constraints)


def steps(executive, until=None):
    """Steps at which nobody says anything, until a time, an end, or `act`; what the last one excludes."""
    now, excluded = ZERO, []
    while now is not None and not executive.ended and "act" not in executive.progress.times and now != until:
        excluded = [each for each in executive.step(now) if isinstance(each, Excluded)]
        now = executive.wake
    return excluded


def left_alone(plan, patience=ZERO, reasoner=SemanticReasoner):
    """When `act` is executed if nobody ever says anything, and what that excludes."""
    executive = PlanExecutive(plan, reasoner, patience=patience)
    excluded = steps(executive)
    return executive.progress.times.get("act"), excluded


@pytest.mark.parametrize(("patience", "moment"), [(ZERO, 10), (Fraction(3), 7), (Fraction(99), 0), (None, 0)])
def test_what_excludes_a_choice_waits_until_the_last_moment_less_the_margin(patience, moment):
    time, excluded = left_alone(asking(), patience)
    reason = "after 10 it would be too late for u = 1"
    expected = Excluded("act", Fraction(moment), ("u = 2",), ("u = 1",), reason)
    assert (time, excluded) == (moment, [] if patience is None else [expected])


def test_a_choice_that_comes_while_we_wait_is_heeded_and_something_is_left_for_it():
    executive = PlanExecutive(asking(), SemanticReasoner)
    executive.step(ZERO)
    assert executive.withheld == {"act"}
    assert executive.withheld_until == executive.wake == 10
    decisions = executive.step(Fraction(19, 2), [Outcome("u", "2")])
    assert Chosen("r", "2", Fraction(19, 2)) in decisions
    assert not any(isinstance(each, Excluded) for each in decisions)
    assert isinstance(executive.outcome, Succeeded)
    # Nobody can decide any more after 10, but without `act` nothing would be left.
    executive = PlanExecutive(
        asking(bound("begin", "ask", upper=10), choices=(U, R, S), events=["skip"]), SemanticReasoner
    )
    steps(executive, until=10)
    executive.step(executive.wake, [Outcome("u", "2")])
    assert executive.progress.chosen["r"] == "2"
    assert not isinstance(executive.outcome, Failed)


@pytest.mark.parametrize("least", [0, 1])
def test_those_who_wait_for_us_are_not_waited_for(least):
    time, [excluded] = left_alone(asking(bound("act", "ask", least)))
    assert (time, excluded.lost, excluded.spared) == (0, ("u = 2",), ())
    assert excluded.reason == "nobody decides u while this is withheld"


def test_what_lapses_by_itself_is_no_reason_to_act_and_every_back_end_is_as_patient():
    """Whoever says u = 1 has said so by 5; then u = 2 excludes nothing."""
    assert left_alone(asking(bound("begin", "ask", upper=5, u="1"))) == (5, [])
    for backend in ("bdd", "pitms"):
        assert left_alone(asking(), reasoner=make_reasoner(backend)) == left_alone(asking())


def alternatives():
    """The executive decides with c whether u or w comes up."""
    left, right, below = {"c": "1"}, {"c": "2"}, {"c": "1", "u": "1"}
    events = {"fork": {}, "left": left, "below": below, "right": right}
    choices = [Choice(name, ("1", "2"), name == "c", event) for name, event in zip("cuvw", events, strict=True)]
    orders = bound("fork", "left", 1, **left), bound("fork", "right", 1, **right), bound("left", "below", 1, **below)
    return plan_of(events, choices, *orders)


def test_intents_miss_no_value_and_what_makes_a_choice_possible_is_preferred():
    """Choices that exclude each other are in different intents; those below a choice only where they are made."""
    plan = alternatives()
    people = [each for each in plan.network.choices if not each.controllable]
    expected = [{"u": "1", "v": "1"}, {"u": "1", "v": "2"}, {"u": "2"}, {"w": "1"}, {"w": "2"}]
    assert {each.values for each in intents(people, Progress(plan))} == set(map(guard, expected))
    progress = Progress(plan, chosen={"c": "2"})
    assert {each.values for each in intents(people, progress)} == {guard({"w": value}) for value in "12"}
    # Of too many, each value is kept.
    names = [f"x{place}" for place in range(7)]
    choices = tuple(Choice(name, ("1", "2"), False, name) for name in names)
    assert 2 ** len(names) > JOINT
    answer = [each.values for each in intents(choices, Progress(plan_of(dict.fromkeys(names, ()), choices)))]
    assert answer == [frozenset({Assignment(name, value)}) for name in names for value in "12"]
    executive = PlanExecutive(alternatives(), SemanticReasoner)
    [excluded] = [each for each in executive.step(ZERO) if isinstance(each, Excluded)]
    assert executive.progress.chosen["c"] == "1"
    assert excluded.lost == ("w = 1", "w = 2")


def test_what_is_withheld_and_excluded_is_explained_and_until_when_people_can_choose():
    executive = PlanExecutive(asking(), SemanticReasoner)
    executive.step(ZERO)
    waits = why_not(executive, "act")
    assert waits.obstacle is Obstacle.WITHHELD
    assert waits.text == "the choice of r waits until 10: it would exclude what others may still choose"
    decisions = executive.step(Fraction(10))
    reasons = Inquiry(executive.progress).step(decisions, {}).decisions
    [(decision, reason)] = [each for each in zip(decisions, reasons, strict=True) if isinstance(each[0], Excluded)]
    assert reason.reason == decision.reason
    assert reason.lines[0] == "not u = 2, as r = 1:"
    assert "at least 100 from the beginning (begin) to the end (end) (r = 1, u = 2)" in reason.text
    answer = LatestMoments(asking(bound("begin", "ask", upper=5, u="1"))).run()
    assert (answer.feasible, answer.status) == (True, "complete")
    assert answer.moments == [("u", "1", True, 5), ("u", "2", True, 20)]
    decided = LatestMoments(asking(), assume=guard({"r": "1"})).run()
    assert decided.moments == [("u", "1", True, 20), ("u", "2", False, None)]
    assert LatestMoments(asking(bound("begin", "end", 51))).run().feasible is False


def story(name):
    return getattr(stories, name)().plan()


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_the_latest_moments_are_those_of_the_oracle(name):
    """There is a correct execution with the choice at that time, and none later."""
    plan = story(name)
    oracle, events = Oracle(plan), {each.name: each.event for each in plan.network.choices}
    begin = {"e_initial": ZERO, "e1": plan.epsilon}
    for choice, value, possible, latest in LatestMoments(plan).run().moments:
        assert possible
        for moment, verdict in ((latest, ExecutionExistence.EXISTS), (latest + plan.epsilon, ExecutionExistence.NONE)):
            answer = oracle.decide(guard({choice: value}), {**begin, events[choice]: moment})
            assert answer.verdict is verdict


@pytest.mark.parametrize(
    ("name", "delay", "eager"),
    [
        ("kitchen", "1/2", 1),
        *(pytest.param("kitchen", delay, 1, marks=pytest.mark.slow) for delay in ("1/10", "1/4")),
        pytest.param("wing", "20", 1, marks=pytest.mark.slow),
        *(pytest.param("wing", delay, None, marks=pytest.mark.slow) for delay in (1, 5, 10, 15)),
    ],
)
def test_people_may_hesitate_whatever_they_mean(name, delay, eager):
    """Not with an eager executive, if that is known."""
    plan = story(name)
    oracle = Oracle(plan)
    meant = [each for each in joint_values(plan) if examples.exists(oracle.decide(guard(each)))]

    def successes(patience):
        outcomes = (hesitate(plan, each, Fraction(delay), patience=patience).outcome for each in meant)
        return sum(isinstance(outcome, Succeeded) for outcome in outcomes)

    assert successes(ZERO) == len(meant)
    assert eager is None or successes(None) == eager


class Watched:
    """Checks after each step that what people may mean is lost if, and only if, that is said.

    The check is by the definition of correct executions; broken links are beyond it.
    """

    def __init__(self, plan):
        self.plan, self.check = plan, examples.Continuations(plan)
        self.people = [each for each in plan.network.choices if not each.controllable]
        self.guards = {each.name: plan.network.guards[each.event] for each in self.people if each.event is not None}
        self.ends = {each.target for each in plan.network.activities}
        self.meant = list(self._meant())
        self.chosen, self.times = {}, {}
        self.acts = self.excluded = 0
        self.confirm = examples.confirming(plan, [])

    def __call__(self, executive, _now, decisions):
        progress = executive.progress
        observed = [each for each in decisions if isinstance(each, Chosen) and each.observed]
        reported = [each for each in decisions if isinstance(each, Executed) and each.reported]
        exclusions = [each for each in decisions if isinstance(each, Excluded)]
        chosen = self.chosen | {each.choice: each.value for each in observed}
        times = self.times | {each.event: each.time for each in reported}
        lost = [dict(pair.split(" = ") for pair in text.split(", ")) for each in exclusions for text in each.lost]
        self.acts += len(progress.times) - len(times)
        self.excluded += bool(lost)
        if not executive.ended:
            self.confirm(executive, progress.now, decisions)
        known = {each.name for each in self.people} & chosen.keys()  # what is known is not open
        for intent in self.meant if len(progress.times) > len(times) else ():
            before = not known & intent.keys() and self.check.possible(intent, chosen, times, progress.now)
            if before and not self.check.possible(intent, progress.chosen, progress.times, progress.now):
                assert any(intent.items() >= each.items() for each in lost), (self.plan.name, progress.now, intent)
        # Who executes what is the end of an activity in some scenarios has decided against these.
        for each in lost if self.ends.isdisjoint(each.event for each in exclusions) else ():
            whole = dict(frozenset().union(*map(self.guards.get, each))) | each
            assert not self.check.possible(whole, progress.chosen, progress.times, progress.now)
        self.chosen, self.times = dict(progress.chosen), dict(progress.times)

    def _meant(self):
        """Single values, and those of all choices together, where the choices come up."""
        single = [{each.name: value} for each in self.people if each.name in self.guards for value in each.domain]
        joint = ({name: each[name] for name in each if name in self.guards} for each in joint_values(self.plan))
        for values in (*single, *joint):
            whole = guard(values).union(*map(self.guards.get, values))
            if len(dict(whole)) == len(whole):
                yield dict(whole)


def watched(plan, number):
    """One patient execution with people who mean something, possible or not, hesitate, and take any time."""
    random = Random(number)  # noqa: S311 - reproducible
    watch, meant = Watched(plan), random.choice(list(joint_values(plan)))
    delay, pace = random.choice((ZERO, Fraction(1, 4), Fraction(2))), random.choice(list(Pace))
    executive = hesitate(plan, meant, delay, patience=random.choice((ZERO, Fraction(1))), pace=pace, after=watch)
    if isinstance(executive.outcome, Succeeded):
        assert not executive.progress.void
        assert examples.is_correct(plan, executive.progress)
    return watch


def test_executions_lose_nothing_without_a_word():
    """Of stories, of drawn plans and of small contested ones."""
    assert watched(story("kitchen"), 1).acts > 5
    assert watched(drawn(SOLVABLE[3]), 1).acts > 10
    assert sum(watched(examples.contested(seed), seed).excluded for seed in range(often(15, 900))) > 0
    for seed in range(often(0, 15)):
        for plan in (story("kitchen"), story("wing"), drawn(SOLVABLE[seed])):
            watched(plan, seed)


def test_known_continuations_are_correct_at_other_times_too(monkeypatch):
    retimed, found = Continuation.retimed, []

    def checked(continuation, **options):
        again = retimed(continuation, **options)
        if again is not None:
            progress = continuation.alike.progress
            found.append(again)
            assert not faults(progress.plan, again, reported=progress.reported)
            assert holds(guard(progress.chosen), again.scenario)
            assert all(again.schedule[event] == time for event, time in progress.times.items())
            coming = progress.pending & again.schedule.keys()
            assert all(again.schedule[event] >= progress.now for event in coming)
            if options.get("late"):
                theirs = {event for event in coming if progress.theirs(event, again.scenario)}
                assert all(again.schedule[event] >= progress.now + progress.plan.separation for event in theirs)
                assert again.lasts()
        return again

    monkeypatch.setattr(Continuation, "retimed", checked)
    for plan in (kitchen(), drawn(SOLVABLE[0]), drawn(SOLVABLE[1])):
        Rehearsal(plan, Story(pace=Pace.RANDOM), seed=1, infer=False).run()
    assert len(found) > 10
