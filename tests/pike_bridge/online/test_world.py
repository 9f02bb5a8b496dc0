"""Teams that cooperate: PIKE counts on them, so with them a plan that admits a correct execution has one."""

from fractions import Fraction

import pytest

from robust.execute.drive import run_in_world
from robust.pike_bridge.builder import act, build, parallel, sequence, within
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Failed
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Ending, Rehearsal, SimulatedTeam, Story
from tests.pike_bridge.online.examples import SOLVABLE


def without_conditions(element):
    return TeamPlan(build("small", element), (), ())


def cooperates(plan, seed):
    return Rehearsal(plan, Story(), seed=seed, infer=False).run().ending is Ending.SUCCEEDED


@pytest.mark.parametrize("index", [26, 122])
def test_drawn_plans_with_tight_deadlines_succeed(index):
    """Number 26 has activities that must end before others can, and both have bounds that ε does not divide."""
    assert cooperates(random_plan(0, index).plan(), seed=index)


@pytest.mark.slow
@pytest.mark.parametrize("index", SOLVABLE)
def test_every_drawn_plan_succeeds_with_every_luck(index):
    plan = random_plan(0, index).plan()
    assert all(cooperates(plan, seed) for seed in range(10))


@pytest.mark.parametrize("seed", range(5))
def test_who_takes_long_leaves_time_to_others(seed):
    """Either may take up to 9, both together 10."""
    one_after_the_other = within(sequence(act("(a)", 1, 9), act("(b)", 1, 9)), upper=10)
    at_the_same_time = parallel(one_after_the_other, act("(c)", 2, 12))
    assert cooperates(without_conditions(within(at_the_same_time, upper=11)), seed)


def test_the_grid_is_that_of_all_numbers():
    plan = without_conditions(within(act("(a)", "0.5", 3), upper="2.00025"))
    executive = PlanExecutive(plan, SemanticReasoner)
    assert executive.progress.grid == Fraction(1, 4000)


def test_a_limit_between_two_multiples_of_epsilon_can_be_used_up_and_not_more():
    plan = without_conditions(within(act("(a)", "0.5", 3), upper="2.00025"))

    def run(takes):
        executive = PlanExecutive(plan, SemanticReasoner)
        team = _Slow(plan, executive, takes)
        run_in_world(executive, team)
        return executive.outcome, executive.progress

    outcome, progress = run(Fraction("2.00025"))
    assert not isinstance(outcome, Failed)
    outcome, progress = run(None)
    assert isinstance(outcome, Failed)
    start = progress.times[plan.network.activities[0].source]
    assert outcome.time - start == Fraction("2.00025") + progress.grid


class _Slow(SimulatedTeam):
    """Takes as long as told for everything; None: never ends anything."""

    def __init__(self, plan, executive, takes):
        super().__init__(plan, executive, executive.reasoner, Story())
        self._takes = takes

    def receive(self, now, decisions):
        if self._takes is not None:
            super().receive(now, decisions)

    def _begin(self, now, activity):
        self._plan_for(now + self._takes, lambda _: Completion(activity.action, activity.end))
