"""Executions that follow a strategy: all of them succeed, whatever people choose and however long activities take."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from benchmarks.generators.team_plans import blocks
from robust import pike
from robust.errors import RefutedError, UnsupportedError
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.following import StrategyRehearsal, find_strategy
from robust.pike_bridge.online.world import Human, Pace, Story
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.pike_bridge.game.minimax import limited, longest, small_plan
from tests.pike_bridge.game.test_controllability import depending, matching
from tests.sampling import often


def followed(plan, seeds, human=Human.CARELESS, delay=Fraction(0), deadline=NEVER):
    """Random executions, none of which leaves the strategy; the times at which they end."""
    strategy = find_strategy(plan, human=human, delay=delay, deadline=deadline)
    ends = Counter()
    for seed in seeds:
        story = Story(human=human, pace=Pace.RANDOM, delay=delay)
        rehearsal = StrategyRehearsal(plan, story, seed, infer=False, known_strategy=strategy)
        record = rehearsal.run()
        assert record.ending is pike.Ending.SUCCEEDED, seed
        assert record.reasoner == "strategy"
        assert rehearsal.was_followed, seed
        ends[record.time] += 1
    return ends


def test_the_wing_succeeds_whatever_happens():
    ends = followed(pike.load("robust/examples/wing/wing.tpnu.json"), range(often(4, 200)))
    assert len(ends) > 3
    assert max(ends) <= 300


def test_the_kitchen_succeeds_with_rational_people_and_time_enough():
    plan = pike.load("robust/examples/kitchen/kitchen.tpnu.json")
    constraints = (replace(each, upper=each.upper and Fraction("14.517")) for each in plan.network.constraints)
    plan = replace(plan, network=replace(plan.network, constraints=tuple(constraints)))
    assert max(followed(plan, range(often(4, 200)), Human.RATIONAL)) <= Fraction("14.517")


def test_blocks_succeed_part_by_part():
    plan = blocks(2, slack=Fraction("1.01")).plan()
    assert max(followed(plan, range(often(3, 100)), Human.RATIONAL)) <= Fraction("24.24")


def test_small_controllable_plans_succeed():
    assert len(followed(depending(2, 4), range(8))) > 1
    followed(matching(), range(4))
    count = 0
    for seed in range(often(150, 4000)):
        random = Random(f"follow/{seed}")  # noqa: S311 - reproducible
        plan = small_plan(random)
        if len(plan.network.events) > 16 or not plan.network.choices or not plan.network.activities:
            continue
        plan = limited(plan, random.randint(longest(plan) // 2, longest(plan)))
        delay, human = Fraction(random.choice((0, 0, 1))), random.choice((Human.CARELESS, Human.RATIONAL))
        try:
            followed(plan, range(3), human, delay, Deadline.after(60))
        except (RefutedError, UnsupportedError, OutOfTimeError):
            continue
        count += 1
    assert count >= 3


def test_without_a_strategy_it_says_so():
    with pytest.raises(RefutedError, match="the plan is not controllable; robust pike check --controllable says why"):
        pike.run("robust/examples/kitchen/kitchen.tpnu.json", strategy=True)


def test_interrupted_while_it_looks_for_a_strategy_it_says_no_more_than_that(monkeypatch):
    def interrupted(_search):
        raise KeyboardInterrupt

    monkeypatch.setattr(DecidingControllability, "_search", interrupted)
    with pytest.raises(KeyboardInterrupt):
        pike.run("robust/examples/wing/wing.tpnu.json", strategy=True)


def test_once_people_do_otherwise_the_solver_decides():
    """The strategy counts on an immediate answer; the person answers later, and the execution succeeds nevertheless."""
    plan = pike.load("robust/examples/wing/wing.tpnu.json")
    record = pike.run(plan, strategy=True, outcome={"h1": ("both", 60)}, pace="least", infer=False)
    assert record.ending is pike.Ending.SUCCEEDED
