"""Replays of planners' plans with durations of a robot: a monitor says the same as oracles that start from scratch.

Drawn often and very often: see tests/sampling.py; tests/execute/replays.py draws as many as are asked for.
"""

import pytest

from tests.execute.replays import SMALL, cases, replay_in_any_order, replay_in_order
from tests.sampling import often


@pytest.mark.parametrize(
    "case", [case for case in cases() if case.steps <= often(SMALL, 75)], ids=lambda case: case.name
)
def test_answers_in_the_order_of_the_plan_are_those_of_oracles(case):
    replays = [replay_in_order(case, seed, solver=seed % 4 == 0) for seed in range(often(1, 20))]
    assert [text for replay in replays for text in replay.differences] == []
    assert any(replay.seconds for replay in replays)  # a first message may end it


@pytest.mark.parametrize("first", range(4, often(12, 204), 4))
def test_nothing_is_left_in_any_order_when_a_solver_says_so(first):
    known = [case for case in cases() if case.steps <= SMALL and case.is_converted]
    replays = [replay_in_any_order(known[seed % len(known)], seed) for seed in range(first, first + 4)]
    assert [text for replay in replays for text in replay.differences] == []


def test_what_has_not_been_heard_of_may_have_happened_as_long_ago_as_messages_are_late():
    (case,) = (case for case in cases() if case.name == "workshop")
    replays = [replay_in_any_order(case, seed) for seed in range(often(8, 200))]
    assert [text for replay in replays for text in replay.differences] == []
    assert {replay.kind for replay in replays} == {"any order", "any order, late"}
