"""Time limits and Ctrl-C end the positions encoding cleanly, while formulas are built and while they are solved."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from fractions import Fraction
from typing import TypeVar

import pytest

from robust.api import check, envelope
from robust.encode.positions.encoding import PositionsEncoding
from robust.irr.check import Answer
from robust.irr.search import Status
from robust.options import METHODS
from robust.plan.model import ZERO, Parameter, ParametrizedPlan, TemporalConstraint
from robust.smt.limits import Deadline, OutOfTimeError
from tests.plan.building import ALL, F, action, at_least, at_most, increase, instant, number, plan_of, value


def unordered(count: int) -> ParametrizedPlan:
    """Increases in any order below a cap: far too many orders to search, and very many formulas."""
    watcher = action("w", (ALL, at_most(value(F), count)))
    steps = [instant(f"i{n}", increase(F, 1)) for n in range(count)]
    constraints = (
        TemporalConstraint(ZERO, watcher.start, number(0), number(0)),
        TemporalConstraint(watcher.start, watcher.end, number(50), number(50)),
        *(TemporalConstraint(ZERO, step.start, number(1), number(40)) for step in steps),
    )
    parameters = (Parameter("k", Fraction(1)),)
    goal = at_least(value(F), count)
    return plan_of(watcher, *steps, constraints=constraints, goal=goal, parameters=parameters)


T = TypeVar("T")
SOLVING, BUILDING = unordered(11), unordered(70)


def test_building_polls_the_deadline() -> None:
    encoding = PositionsEncoding(BUILDING, deadline=Deadline.after(0.2))
    started = time.monotonic()
    with pytest.raises(OutOfTimeError):
        encoding.query(encoding.obligations[-1])
    assert time.monotonic() - started < 20


@pytest.mark.parametrize("plan", [SOLVING, BUILDING])
def test_a_time_limit_leaves_the_verdict_open(plan: ParametrizedPlan) -> None:
    started = time.monotonic()
    result = check(plan, encoding="positions", timeout=0.5)
    assert result.answer is Answer.UNKNOWN
    assert not result.interrupted
    assert time.monotonic() - started < 20


@pytest.mark.parametrize("method", METHODS)
def test_a_time_limit_ends_the_search_for_a_box(method: str) -> None:
    assert envelope(BUILDING, method=method, encoding="positions", timeout=0.5).status is Status.TIMEOUT


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # lost in a finaliser, then noticed
@pytest.mark.parametrize("plan", [SOLVING, BUILDING])
def test_ctrl_c_leaves_the_verdict_open(plan: ParametrizedPlan) -> None:
    result = interrupted(lambda: check(plan, encoding="positions", timeout=60))
    assert result.answer is Answer.UNKNOWN
    assert result.interrupted


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # lost in a finaliser, then noticed
@pytest.mark.parametrize("method", METHODS)
def test_ctrl_c_ends_the_search_for_a_box(method: str) -> None:
    result = interrupted(lambda: envelope(BUILDING, method=method, encoding="positions", timeout=30))
    assert result.status is Status.INTERRUPTED


def interrupted(run: Callable[[], T]) -> T:
    """The result of a run that Ctrl-C interrupts soon, and that ends soon after."""
    timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
    started = time.monotonic()
    timer.start()
    try:
        return run()
    finally:
        timer.cancel()
        assert time.monotonic() - started < 10
