"""Regions and risks do not depend on what else the process was asked before."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import seed as hypothesis_seed

import robust
from robust import InputError, ParametrizedPlan, Region
from tests.irr.building import parametric
from tests.plan.building import drawn

ASKED = """
import json, sys
from tests.qe.test_history import answers, drawn_plans
order, seed, count = map(int, sys.argv[1:])
for answer in answers(order, drawn_plans(seed, count)):
    print(json.dumps(answer))
"""
Questions = Iterator[tuple[int, str, dict[str, Any] | None]]


def drawn_plans(seed: int, count: int) -> list[ParametrizedPlan]:
    """Plans with parameters, valid or not; the same for the same seed, as long as the same modules are imported."""
    plans: list[ParametrizedPlan] = []

    @hypothesis_seed(seed)
    @settings(drawn(count), database=None)
    @given(parametric(parameters=3))
    def draw(plan: ParametrizedPlan) -> None:
        plans.append(plan)

    draw()
    return plans


def answer(plan: ParametrizedPlan, verb: str) -> dict[str, Any] | None:
    """What a verb says of a plan; None if that takes too long."""
    try:
        if verb == "region":
            region = robust.region(plan, timeout=20)
            return {"region": region.region.as_dict()} if region.is_exact else None
        spread = {one.name: f"uniform:{one.nominal - 2}:{one.nominal + 2}" for one in plan.parameters}
        risk = robust.risk(plan, spread, within="1/100", timeout=20)
    except InputError as error:
        return {"error": str(error)}
    bounds = {share.name: share.probability for share in risk.shares or ()} | {"success": risk.probability}
    # Of several boxes that are as wide the optimal one is any.
    bounds |= {kept.method: kept.probability for kept in risk.kept if kept.method != "optimal"}
    return None if risk.cut_short else {name: [str(one.lower), str(one.upper)] for name, one in bounds.items()}


def answers(order: int, plans: list[ParametrizedPlan]) -> Questions:
    """What verbs say of plans, asked in some order and, in every other order, about boxes in between."""
    questions = [(number, verb) for number in range(len(plans)) for verb in ("region", "risk")]
    Random(order).shuffle(questions)  # noqa: S311 - reproducible orders
    for number, verb in questions:
        if order % 2:
            with suppress(InputError):
                robust.check(plans[number], every=True)
                robust.envelope(plans[number], timeout=20)
        yield number, verb, answer(plans[number], verb)


def same(verb: str, before: dict[str, Any], after: dict[str, Any]) -> bool:
    """A region is one set of points, however it is described; bounds on one probability overlap."""
    if "error" in before or "error" in after:
        return before == after
    if verb == "region":
        return Region.from_dict(before["region"]).equals(Region.from_dict(after["region"]))
    bounds = (map(Fraction, (*before.get(name, "00"), *after.get(name, "00"))) for name in {**before, **after})
    return all(max(low, other) <= min(high, most) for low, high, other, most in bounds)


def assert_same(first: Questions, second: Questions, least: int) -> None:
    """No question has two answers; at least that many have any."""
    known = {(number, verb): said for number, verb, said in first}
    pairs = [(verb, known.get((number, verb)), said) for number, verb, said in second]
    both = [(verb, before, after) for verb, before, after in pairs if before is not None and after is not None]
    assert [pair for pair in both if not same(*pair)] == []
    assert len(both) >= least


def test_regions_and_risks_do_not_depend_on_what_was_asked_before() -> None:
    plans = drawn_plans(3, 4)
    assert_same(answers(0, plans), answers(1, plans), 6)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("seed", range(1, 4))
def test_fresh_processes_agree(seed: int, order: int) -> None:
    """They ask in different orders, and hash in other ways."""

    def asked(order: int) -> Questions:
        words = [sys.executable, "-c", ASKED, str(order), str(seed), "60"]
        environment = {**os.environ, "PYTHONHASHSEED": str(order)}
        return map(json.loads, subprocess.check_output(words, text=True, env=environment).splitlines())

    assert_same(asked(0), asked(order), 100)
