"""Executives that decide part by part, step by step against those that look at the whole plan."""

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from benchmarks.generators.team_plans import blocks, longest, precedence
from robust.pike import (
    Disturbance,
    Human,
    Pace,
    PlanExecutive,
    Story,
    act,
    build,
    choose,
    make_reasoner,
    parallel,
    sequence,
    within,
)
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.model import Constraint, guard
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.divided import DividedReasoner
from robust.pike_bridge.online.executive import PAUSES
from robust.pike_bridge.online.parts import Division
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.semantics import Execution, faults
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.smt.limits import OutOfTimeError
from tests.pike_bridge.online import examples
from tests.sampling import often

WITHHOLDING = 16
"""The number of an execution in which something is withheld."""


class Drawing:
    """A chain of two to four parts, each of some choices side by side and activities that use what others made."""

    def __init__(self, number):
        self.random = Random(number)  # noqa: S311 - reproducible
        self.count = self.choices = 0
        self.needs = {}

    def activity(self):
        self.count += 1
        lower = self.random.randint(1, 3)
        return act(f"(a{self.count})", lower, lower + self.random.randint(0, 2))

    def branch(self):
        return sequence(*(self.activity() for _ in range(self.random.choice((1, 1, 2)))))

    def choice(self):
        self.choices += 1
        values = {str(value): self.branch() for value in range(1, 3)}
        return choose(f"x{self.choices}", values, controllable=self.random.random() < 0.45)

    def matching(self):
        """Someone takes a thing, the executive a tool, and someone uses both, which have to match."""
        names = []
        for controllable in (False, True, False):
            self.choices += 1
            names.append([{value: self.activity() for value in "12"}, f"x{self.choices}", controllable])
        taken, tools, uses = (branches for branches, _, _ in names)
        for value in "12":
            self.needs[uses[value].action] = [(taken[value].action, f"(t{self.count}-{value})")]
            self.needs[uses[value].action] += [(tools[value].action, f"(m{self.count}-{value})")]
        first, second, last = (choose(name, branches, controllable=own) for branches, name, own in names)
        return sequence(parallel(first, second), last, self.activity())

    def part(self):
        if self.random.random() < 0.4:
            return self.matching()
        element = self.random.choice((self.choice, self.choice, self.branch))
        if self.random.random() < 0.5:
            return sequence(parallel(self.choice(), element()), self.activity())
        return sequence(self.choice(), element())

    def plan(self):
        random = self.random
        parts = [self.part() for _ in range(random.choice((2, 2, 3, 4)))]
        actions, initial, predicates, texts = [], [], [], []
        shared = random.random() < 0.4
        for part in parts:
            inside, _ = precedence(part)
            actions += inside
            conditions, effects = {each: [] for each in inside}, {each: [] for each in inside}
            for action, producer, atom in ((one, *each) for one in inside for each in self.needs.get(one, ())):
                predicates.append(atom)
                conditions[action].append(atom)
                effects[producer].append(atom)
            for action in inside:
                if random.random() < 0.4:
                    atom = f"(p{len(predicates)})"
                    predicates.append(atom)
                    conditions[action].append(atom)
                    candidates = [each for each in inside if each != action]
                    for producer in random.sample(candidates, min(len(candidates), random.choice((1, 2, 3)))):
                        effects[producer].append(atom)
                    initial += [atom] * (random.random() < 0.3 or not candidates)
                    if candidates and random.random() < 0.15:
                        effects[random.choice(candidates)].append(f"(not {atom})")
                if shared and random.random() < 0.4:
                    conditions[action].append("(shared)")
                if shared and random.random() < 0.25:
                    effects[action].append(random.choice(("(shared)", "(not (shared))")))
            texts += [
                ActionText(
                    each.strip("()"), at_start=tuple(conditions[each]), end_effects=tuple(dict.fromkeys(effects[each]))
                )
                for each in inside
            ]
        limit = longest(sequence(*parts)) + random.randint(0, 9)
        predicates.append("(shared)")
        initial += ["(shared)"]
        network = build("chain", within(sequence(*parts), upper=limit if random.random() < 0.8 else None))
        return Instance(
            network, sketched_domain("chain", predicates, texts), sketched_problem("chain", "chain", initial, ())
        ).plan()


def divided(progress):
    division = Division(progress.plan, progress.structure)
    return DividedReasoner(progress, division) if len(division.nodes) > 2 else SemanticReasoner(progress)


def said_of(executive):
    """What an executive announces besides its decisions."""
    open_choices = [each.name for each in executive.plan.network.choices if each.name not in executive.progress.chosen]
    return (
        executive.wake,
        executive.withheld,
        executive.withheld_until,
        executive.ended,
        () if executive.ended else [executive.possible_values(name) for name in open_choices],
    )


def compare(plan, number, patience):
    """One execution by both: how many steps were the same, and of how many something was withheld."""
    random = Random(number)  # noqa: S311 - reproducible
    executive, whole = (PlanExecutive(plan, make, patience=patience) for make in (divided, SemanticReasoner))
    steps = []

    def after(one, now, decisions):
        others = whole.step(now, told[-1])
        assert without_words(decisions) == without_words(others), f"step {len(steps)} of {number}"
        assert said_of(one) == said_of(whole), f"step {len(steps)} of {number}"
        steps.append(bool(one.withheld))

    told, step = [], executive.step

    def noting(now, messages=()):
        told.append(messages)
        return step(now, messages)

    executive.step = noting
    story = Story(
        human=random.choice((Human.RATIONAL, Human.RATIONAL, *Human)),
        pace=random.choice(list(Pace)),
        delay=Fraction(random.choice((0, 1, 2, 3))),
        disturbances=disturbances(plan, random),
    )
    examples.watch(
        executive, after, judge=SemanticReasoner(executive.progress), story=story, seed=number, horizon=Fraction(99)
    )
    return len(steps), sum(steps), type(executive.outcome)


def disturbances(plan, random):
    if random.random() < 0.7:
        return ()
    literals = sorted({each.literal for each in plan.effects})
    return (Disturbance(Fraction(random.randint(1, 9)), random.choice(literals)),)


def without_words(decisions):
    """Decisions without the reason for giving up what people may still decide."""
    return [(each.event, each.time) if isinstance(each, said.Excluded) else each for each in decisions]


@pytest.mark.parametrize("number", range(often(8, 400)))
def test_parts_decide_what_the_whole_does(number):
    """Every decision, what is withheld and until when, when to look again, and what people may still choose."""
    compare(Drawing(number).plan(), number, (Fraction(0), Fraction(0), None, Fraction(1))[number % 4])


def test_drawn_plans_have_several_parts_and_something_is_withheld_in_some():
    """Numbers at which the premises of the comparison hold: parts, atoms in several of them, and patience."""
    plans = [Drawing(number).plan() for number in range(60)]
    divisions = [Division(plan, said.Progress(plan).structure) for plan in plans]
    assert all(len(each.nodes) > 2 for each in divisions)
    shared = [each for each in divisions if any(len(parts) > 1 for parts in each._atom_in.values())]
    assert len(shared) > 5
    assert compare(plans[WITHHOLDING], WITHHOLDING, Fraction(0))[1] > 0


@pytest.mark.parametrize("share", [False, True])
def test_a_large_plan_is_carried_out_block_by_block(share):
    """Each step asks about thirteen activities of 104, and who looks at the whole plan takes seconds for some."""
    plan = blocks(8, share=share).plan()
    executive = PlanExecutive(plan, make_reasoner("smt"))
    assert isinstance(executive.reasoner, DividedReasoner)
    assert len(executive.reasoner.division.nodes) > 8
    judge = executive.reasoner
    outcome = examples.watch(executive, judge=judge, story=Story(pace=Pace.RANDOM), seed=1)
    assert isinstance(outcome, said.Succeeded)
    progress = executive.progress
    scenario = {each.name: each.domain[0] for each in plan.network.choices} | progress.chosen
    assert not faults(plan, Execution(scenario, progress.times), reported=progress.reported)


def test_what_is_in_two_parts_at_once_keeps_them_together():
    """Two choices; a bound from inside of one to inside of the other, a condition, or an atom whose value is open."""

    def nodes(*more, initial=("(p)",), **effects):
        parts = [choose(name, {each: act(f"({name}-{each})", 1, 2) for each in "12"}) for name in "xy"]
        after = (sequence(each, act(f"(after-{n})", 1, 2)) for n, each in enumerate(parts))
        network = build("two", sequence(*after))
        network = replace(network, constraints=(*network.constraints, *more))
        names = [each.action.strip("()") for each in network.activities]
        texts = [
            ActionText(
                each, at_start=("(p)",) if each == "y-1" else (), end_effects=effects.get(each.replace("-", ""), ())
            )
            for each in names
        ]
        plan = Instance(
            network, sketched_domain("two", ["(p)"], texts), sketched_problem("two", "two", initial, ())
        ).plan()
        return len(Division(plan, said.Progress(plan).structure).nodes)

    apart = nodes()
    assert apart > 3
    assert nodes(x1=("(p)",)) == apart  # true before and after
    unknown = nodes(x1=("(not (p))",))  # nobody knows which until y is over
    assert unknown < nodes(x1=("(not (p))",), after0=("(p)",)) < apart  # true again before y, whatever x
    assert nodes(Constraint("e3", "e11", None, Fraction(5), guard({"x": "1", "y": "1"}))) < apart


# -- answers in time ---------------------------------------------------------------------------------------------------


class Slow(SemanticReasoner):
    """Runs out of time at every question for which there is not enough of it, as if it took long; no clock is asked."""

    def __init__(self, progress, patience=0):
        super().__init__(progress)
        self.left, self.asked = patience, 0

    def _check(self, deadline):
        if deadline.remaining is not None:
            self.asked += 1
            if self.left <= 0:
                raise OutOfTimeError
            self.left -= 1
        return super()._check(deadline)


def ending(plan, each_step, number):
    """An executive whose steps may ask few questions, after an execution."""
    executive = PlanExecutive(plan, Slow, budget=1e6)
    assert executive.prepare()
    step = executive.step

    def limited(now, messages=()):
        executive.reasoner.left = each_step
        return step(now, messages)

    executive.step = limited
    judge = SemanticReasoner(executive.progress)
    examples.watch(executive, judge=judge, seed=number, horizon=Fraction(99))
    return executive


@pytest.mark.parametrize("each_step", [5, 9])
@pytest.mark.parametrize("number", range(often(1, 8)))
def test_nothing_is_done_that_is_not_proved_and_no_execution_fails_for_want_of_time(each_step, number):
    """Steps with few questions, one after the other, come to what one step with many comes to, or to as good an end."""
    plan = blocks(1).plan()
    executive = ending(plan, each_step, number)
    assert isinstance(executive.outcome, said.Succeeded)
    assert executive.thrift.undecided > 0
    progress = executive.progress
    scenario = {each.name: each.domain[0] for each in plan.network.choices} | progress.chosen
    assert not faults(plan, Execution(scenario, progress.times), reported=progress.reported)


class Stuck(SemanticReasoner):
    """Out of time at every question, once it is stuck."""

    stuck = False

    def executable(self, event, deadline):
        if self.stuck:
            raise OutOfTimeError
        return super().executable(event, deadline)

    def could(self, environment, deadline, more=()):
        if self.stuck:
            raise OutOfTimeError
        return super().could(environment, deadline, more)


@pytest.mark.parametrize("punctual", [True, False])
def test_without_time_what_is_known_to_be_correct_is_followed_at_the_last_moment(punctual):
    """What is not urgent waits, and an execution fails when that is proved, not before."""
    plan = examples.working(Constraint("begin", "own", Fraction(1), Fraction(1)), most=9)
    executive = PlanExecutive(plan, Stuck, budget=1e6)
    executive.step(Fraction(0))
    assert executive.reasoner.known.schedule["own"] == 1
    executive.reasoner.stuck = True
    assert executive.step(Fraction(1, 2)) == []
    assert executive.undecided
    assert executive.wake == Fraction(1, 2)
    now = Fraction(1) if punctual else Fraction(2)
    assert executive.step(now) == ([said.Executed("own", now)] if punctual else [])
    assert not executive.ended
    assert executive.thrift.followed == punctual
    executive.reasoner.stuck = False
    decisions = executive.step(now)
    assert [type(each) for each in decisions] == ([] if punctual else [said.Failed])


def test_time_goes_on_after_some_steps_that_decide_nothing():
    executive = PlanExecutive(examples.working(), Stuck, budget=1e6)
    executive.reasoner.stuck = True
    wakes = []
    for _ in range(2 * PAUSES):
        executive.step(executive.wake or Fraction(0) if wakes else Fraction(0))
        wakes.append(executive.wake)
    assert wakes.count(0) == PAUSES
    assert wakes[PAUSES:] == [executive.progress.grid * number for number in range(1, PAUSES + 1)]
    assert executive.thrift.stretched == PAUSES


def test_a_budget_that_is_too_small_is_stretched_until_something_is_decided():
    """Executions succeed however small it is, and say that it was."""
    executive = PlanExecutive(blocks(2).plan(), SemanticReasoner, budget=1e-5)
    examples.watch(executive, judge=SemanticReasoner(executive.progress), seed=3)
    assert isinstance(executive.outcome, said.Succeeded)
    assert 0 < executive.thrift.stretched < executive.thrift.undecided < executive.thrift.steps


def test_enough_time_changes_nothing():
    plan = blocks(2).plan()
    ends = []
    for budget in (None, 1e6):
        executive = PlanExecutive(plan, SemanticReasoner, budget=budget)
        examples.watch(executive, judge=SemanticReasoner(executive.progress), seed=3)
        ends.append((executive.outcome, executive.progress.times))
        assert not executive.thrift.anything
    assert ends[0] == ends[1]
