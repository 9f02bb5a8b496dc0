"""Waiting for people: the exact definition on small plans, the stories, and executions against another check."""

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robust.pike_bridge.model import Assignment, Choice, Constraint, Event, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.executive import LatestMoments, PlanExecutive
from robust.pike_bridge.online.inquiry import Inquiry, Obstacle, why_not
from robust.pike_bridge.online.patience import JOINT, intents
from robust.pike_bridge.online.progress import Chosen, Excluded, Executed, Failed, Outcome, Progress, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Pace
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from tests.pike_bridge import stories
from tests.pike_bridge.online.delays import Continuations, execute, joint_values, possible_intents
from tests.pike_bridge.online.examples import SOLVABLE, confirming, drawn, is_correct
from tests.pike_bridge.plans import random_plan as small_plan

ZERO = Fraction(0)
U = Choice("u", ("1", "2"), False, "ask")
R = Choice("r", ("1", "2"), True, "act")
NEVER_BOTH = [
    Constraint("begin", "end", Fraction(100), None, guard({"u": mine, "r": other}))
    for mine, other in (("1", "2"), ("2", "1"))
]
"""The executive's choice must be the same as that of the others, or the end is too late."""


def bound(source, target, lower=0, upper=None, **given):
    return Constraint(source, target, Fraction(lower), None if upper is None else Fraction(upper), guard(given))


def asking(*constraints, choices=(U, R), events=()):
    """Someone decides u at `ask` within 20, we the same of r at `act` within 10."""
    names = [Event("begin"), Event("ask"), Event("act"), Event("end"), *events]
    always = [
        bound("begin", "ask", upper=20),
        bound("begin", "act", upper=10),
        bound("begin", "end", upper=50),
        bound("act", "end"),
        bound("ask", "end"),
    ]
    return TeamPlan(Tpnu("asking", choices, tuple(names), (*always, *NEVER_BOTH, *constraints), ()), (), ())


def left_alone(plan, patience=ZERO, reasoner=SemanticReasoner):
    """When `act` is executed if nobody ever says anything, and what that excludes."""
    executive = PlanExecutive(plan, reasoner, patience=patience)
    now, told = ZERO, []
    while now is not None and not executive.ended and "act" not in executive.progress.times:
        told = [each for each in executive.step(now) if isinstance(each, Excluded)]
        now = executive.wake
    return executive.progress.times.get("act"), told


@pytest.mark.parametrize(("patience", "moment"), [(ZERO, 10), (Fraction(3), 7), (Fraction(99), 0), (None, 0)])
def test_what_excludes_a_choice_waits_until_the_last_moment_less_the_margin(patience, moment):
    found, told = left_alone(asking(), patience)
    assert found == moment
    if patience is None:
        assert told == []
    else:
        [excluded] = told
        assert (excluded.event, excluded.time, excluded.lost, excluded.spared) == (
            "act",
            moment,
            ("u = 2",),
            ("u = 1",),
        )
        assert excluded.reason == "after 10 it would be too late for u = 1"


def test_a_choice_that_comes_while_we_wait_is_heeded():
    executive = PlanExecutive(asking(), SemanticReasoner)
    executive.step(ZERO)
    assert executive.withheld == {"act"}
    assert executive.withheld_until == executive.wake == 10
    told = executive.step(Fraction(19, 2), [Outcome("u", "2")])
    assert Chosen("r", "2", Fraction(19, 2)) in told
    assert not any(isinstance(each, Excluded) for each in told)
    assert isinstance(executive.outcome, Succeeded)


@pytest.mark.parametrize("least", [0, 1])
def test_those_who_wait_for_us_are_not_waited_for(least):
    found, [excluded] = left_alone(asking(bound("act", "ask", least)))
    assert found == 0
    assert (excluded.lost, excluded.spared) == (("u = 2",), ())
    assert excluded.reason == "nobody decides u while this is withheld"


def test_what_lapses_by_itself_is_no_reason_to_act():
    found, told = left_alone(asking(bound("begin", "ask", upper=5, u="1")))
    assert found == 5  # whoever says u = 1 has said so by now; u = 2 excludes nothing
    assert told == []


def test_waiting_leaves_something_to_wait_for():
    """Nobody can decide any more after 10, but without `act` nothing would be left."""
    plan = asking(bound("begin", "ask", upper=10), choices=(U, R, Choice("s", ("1", "2"), True, "skip")))
    skip = Event("skip")
    plan = TeamPlan(
        Tpnu("skipping", plan.network.choices, (*plan.network.events, skip), plan.network.constraints, ()), (), ()
    )
    executive = PlanExecutive(plan, SemanticReasoner)
    now = ZERO
    while now is not None and now < 10:
        executive.step(now)
        now = executive.wake
    executive.step(now, [Outcome("u", "2")])
    assert executive.progress.chosen["r"] == "2"
    assert not isinstance(executive.outcome, Failed)


def alternatives():
    """The executive decides with c whether u or w comes up."""
    choices = (
        Choice("c", ("1", "2"), True, "fork"),
        Choice("u", ("1", "2"), False, "left"),
        Choice("v", ("1", "2"), False, "below"),
        Choice("w", ("1", "2"), False, "right"),
    )
    left, right = guard({"c": "1"}), guard({"c": "2"})
    events = (Event("fork"), Event("left", left), Event("below", left | guard({"u": "1"})), Event("right", right))
    constraints = (
        bound("fork", "left", 1, c="1"),
        bound("fork", "right", 1, c="2"),
        bound("left", "below", 1, c="1", u="1"),
    )
    return TeamPlan(Tpnu("alternatives", choices, events, constraints, ()), (), ())


def test_intents_miss_no_value_that_can_be_chosen():
    """Choices that exclude each other are in different intents; those below a choice only where they are made."""
    plan = alternatives()
    people = [each for each in plan.network.choices if not each.controllable]
    found = {each.values for each in intents(people, Progress(plan))}
    expected = [{"u": "1", "v": "1"}, {"u": "1", "v": "2"}, {"u": "2"}, {"w": "1"}, {"w": "2"}]
    assert found == {guard(each) for each in expected}
    progress = Progress(plan, chosen={"c": "2"})
    assert {each.values for each in intents(people, progress)} == {guard({"w": value}) for value in "12"}


def test_of_too_many_intents_each_value_is_kept():
    names = [f"x{place}" for place in range(7)]
    choices = tuple(Choice(name, ("1", "2"), False, name) for name in names)
    plan = TeamPlan(Tpnu("many", choices, tuple(map(Event, names)), (), ()), (), ())
    assert 2 ** len(names) > JOINT
    found = [each.values for each in intents(choices, Progress(plan))]
    assert found == [frozenset({Assignment(name, value)}) for name in names for value in "12"]


def test_what_makes_a_choice_possible_is_preferred_but_nobody_waits_for_it():
    executive = PlanExecutive(alternatives(), SemanticReasoner)
    told = executive.step(ZERO)
    [excluded] = [each for each in told if isinstance(each, Excluded)]
    assert executive.progress.chosen["c"] == "1"
    assert excluded.lost == ("w = 1", "w = 2")


@pytest.mark.parametrize("backend", ["bdd", "pitms"])
def test_every_back_end_is_as_patient(backend):
    assert left_alone(asking(), reasoner=make_reasoner(backend)) == left_alone(asking())


# -- words -------------------------------------------------------------------------------------------------------------


def test_what_is_withheld_and_what_is_excluded_is_explained():
    executive = PlanExecutive(asking(), SemanticReasoner)
    executive.step(ZERO)
    waits = why_not(executive, "act")
    assert waits.obstacle is Obstacle.WITHHELD
    assert waits.text == "the choice of r waits until 10: it would exclude what others may still choose"
    told = executive.step(Fraction(10))
    reasons = Inquiry(executive.progress).step(told, {})
    [(decision, reason)] = [pair for pair in zip(told, reasons.decisions, strict=True) if isinstance(pair[0], Excluded)]
    assert reason.reason == decision.reason
    assert reason.lines[0] == "not u = 2, as r = 1:"
    assert "at least 100 from the beginning (begin) to the end (end) (r = 1, u = 2)" in reason.text


def test_until_when_people_can_choose():
    found = LatestMoments(asking(bound("begin", "ask", upper=5, u="1"))).run()
    assert (found.feasible, found.status) == (True, "complete")
    assert found.moments == [("u", "1", True, 5), ("u", "2", True, 20)]
    decided = LatestMoments(asking(), assume=guard({"r": "1"})).run()
    assert decided.moments == [("u", "1", True, 20), ("u", "2", False, None)]
    impossible = LatestMoments(asking(bound("begin", "end", 51))).run()
    assert impossible.feasible is False


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_the_latest_moments_are_those_of_the_oracle(name):
    """There is a correct execution with the choice at that time, and none later."""
    plan = getattr(stories, name)().plan()
    oracle, events = Oracle(plan), {each.name: each.event for each in plan.network.choices}
    begin = {"e_initial": ZERO, "e1": plan.epsilon}
    for choice, value, possible, latest in LatestMoments(plan).run().moments:
        assert possible
        made = guard({choice: value})
        for moment, verdict in ((latest, ExecutionExistence.EXISTS), (latest + plan.epsilon, ExecutionExistence.NONE)):
            assert oracle.decide(made, {**begin, events[choice]: moment}).verdict is verdict


# -- stories -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "delay", "eager"),
    [
        ("kitchen", "1/10", 1),
        ("kitchen", "1/4", 1),
        ("kitchen", "1/2", 1),
        pytest.param("wing", "20", 1, marks=pytest.mark.slow),
    ],
)
def test_people_may_hesitate_whatever_they_mean(name, delay, eager):
    plan = getattr(stories, name)().plan()
    meant = possible_intents(plan)
    outcomes = {
        patience: [type(execute(plan, each, Fraction(delay), patience=patience).outcome) for each in meant]
        for patience in (ZERO, None)
    }
    assert outcomes[ZERO] == [Succeeded] * len(meant)
    assert outcomes[None].count(Succeeded) == eager


@pytest.mark.slow
@pytest.mark.parametrize("delay", [1, 5, 10, 15])
def test_people_may_hesitate_at_the_wing(delay):
    plan = stories.wing().plan()
    for each in possible_intents(plan):
        assert isinstance(execute(plan, each, Fraction(delay), patience=ZERO).outcome, Succeeded)


# -- against another check ---------------------------------------------------------------------------------------------


class Watched:
    """Checks after each step that what people may mean is lost if, and only if, that is said.

    The check is by the definition of correct executions; broken links are beyond it.
    """

    def __init__(self, plan):
        self.plan, self.check = plan, Continuations(plan)
        self.meant = list(self._meant())
        self.people = {each.name for each in plan.network.choices if not each.controllable}
        self.chosen, self.times = {}, {}
        self.acts = self.excluded = 0
        self.confirm = confirming(plan, [])

    def __call__(self, executive, told):
        progress = executive.progress
        chosen = self.chosen | {each.choice: each.value for each in told if isinstance(each, Chosen) and each.observed}
        times = self.times | {each.event: each.time for each in told if isinstance(each, Executed) and each.reported}
        ends = {each.target for each in self.plan.network.activities}
        lost = [
            dict(each.split(" = ") for each in text.split(", "))
            for each in told
            if isinstance(each, Excluded)
            for text in each.lost
        ]
        self.acts += len(progress.times) - len(times)
        self.excluded += bool(lost)
        if not executive.ended:
            self.confirm(executive, progress.now, told)
        for intent in self.meant if len(progress.times) > len(times) else ():
            known = self.people & intent.keys() & chosen.keys()  # what is known is not open
            before = not known and self.check.possible(intent, chosen, times, progress.now)
            if before and not self.check.possible(intent, progress.chosen, progress.times, progress.now):
                assert any(intent.items() >= each.items() for each in lost), (self.plan.name, progress.now, intent)
        # Who executes what is the end of an activity in some scenarios has decided against these.
        told_of = {each.event for each in told if isinstance(each, Excluded)}
        for each in lost if told_of.isdisjoint(ends) else ():
            activated = frozenset().union(*(self._guard(name) for name in each))
            assert not self.check.possible(dict(activated) | each, progress.chosen, progress.times, progress.now)
        self.chosen, self.times = dict(progress.chosen), dict(progress.times)

    def _meant(self):
        """Single values, and those of all choices together, where the choices come up."""
        people = [each for each in self.plan.network.choices if not each.controllable and each.event is not None]
        single = [{each.name: value} for each in people for value in each.domain]
        names = {each.name for each in people}
        joint = ({name: value for name, value in each.items() if name in names} for each in joint_values(self.plan))
        for values in [*single, *joint]:
            whole = guard(values).union(*(self._guard(name) for name in values))
            if len(dict(whole)) == len(whole):
                yield dict(whole)

    def _guard(self, choice):
        return next(self.plan.network.guards[each.event] for each in self.plan.network.choices if each.name == choice)


def watched(plan, number):
    """One patient execution with people who mean something, possible or not, hesitate, and take any time."""
    random = Random(number)  # noqa: S311 - reproducible
    watch, meant = Watched(plan), random.choice(list(joint_values(plan)))
    delay, pace = random.choice((ZERO, Fraction(1, 4), Fraction(2))), random.choice(list(Pace))
    executive = execute(plan, meant, delay, patience=random.choice((ZERO, Fraction(1))), pace=pace, observe=watch)
    if isinstance(executive.outcome, Succeeded):
        assert not executive.progress.void
        assert is_correct(plan, executive.progress)
    return watch


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_the_stories_lose_nothing_without_a_word(name):
    assert watched(getattr(stories, name)().plan(), 1).acts > 5


def test_drawn_plans_lose_nothing_without_a_word():
    found = [watched(drawn(each), place) for place, each in enumerate((SOLVABLE[0], SOLVABLE[3]))]
    assert sum(each.acts for each in found) > 20


def test_small_contested_plans_lose_nothing_without_a_word():
    found = [watched(contested(seed), seed) for seed in range(25)]
    assert any(each.excluded for each in found)


def contested(number):
    """A small plan without much structure, each choice made at some event."""
    random = Random(number)  # noqa: S311 - reproducible
    plan = small_plan(random, events=8)
    guards = plan.network.guards

    def apart(name):
        return [event for event, label in guards.items() if name not in dict(label)] or [None]

    choices = tuple(replace(each, event=random.choice(apart(each.name))) for each in plan.network.choices)
    return replace(plan, network=replace(plan.network, choices=choices))


@pytest.mark.slow
def test_many_executions_lose_nothing_without_a_word():
    found = [watched(contested(seed), seed) for seed in range(25, 900)]
    found += [watched(drawn(each), place) for each in SOLVABLE for place in range(5)]
    found += [watched(getattr(stories, name)().plan(), seed) for name in ("kitchen", "wing") for seed in range(15)]
    assert sum(each.excluded for each in found) > 20
