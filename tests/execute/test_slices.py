"""What is left of the envelope: small cases by hand, and the promise put to the test in simulated worlds."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import pytest

from robust.errors import InputError
from robust.execute.controllable_boxes import Dynamically, ends_of, parametric_stnu
from robust.execute.dispatchable import Dispatchable, Guarantee, Slice, make_dispatchable, parse_executor
from robust.execute.dispatcher import Completed, Dispatcher, DispatchFailed, LeftBox
from robust.execute.drive import run_in_world
from robust.execute.replan import ReplanningOptions, prepare_plan
from robust.execute.slices import Observations, SliceAnswer, continued
from robust.execute.worlds import Luck, SimulatedWorld
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from robust.qe.compute import RegionSearch
from robust.smt.limits import NEVER
from tests.execute.plans import (
    PLANS,
    drawn,
    drawn_plan,
    drawn_with_box,
    fixed,
    interval,
    nothing_else,
    tasks,
    with_box,
    working,
)

F = Fraction

CHAIN = ("w2.end - w2.start in [second, second]", "w2.start - w1.end in [0.001, inf]", "w2.end - .zero in [0, 30]")


def sliced(dispatchable: Dispatchable, *, seconds: float | None = None, timeout: float | None = None) -> Dispatchable:
    """With the region of its plan."""
    found = RegionSearch(dispatchable.plan, timeout=timeout).run()
    return dispatchable.sliced(found.inner(), exact=found.is_exact, seconds=seconds)


@cache
def in_series():
    """Two tasks one after the other, each planned for 10, that have to be done by 30."""
    plan = tasks("parameter second default 10;" + working(*CHAIN), problem=nothing_else("ab"))
    return prepare_plan(plan, ReplanningOptions(executor=Slice(None))).dispatchable


def boxes_of(dispatcher):
    return [(one.after, one.answer, one.box and {n: str(i) for n, i in one.box.intervals.items()}, one.kept)
            for one in dispatcher.remainders]  # fmt: skip


def test_the_executor_is_named():
    assert (parse_executor("slice"), parse_executor("slice:2")) == (Slice(0.05), Slice(2.0))
    for wrong in ("slice:", "slice:0", "slice:-1", "slice:x"):
        with pytest.raises(InputError, match="seconds"):
            parse_executor(wrong)
    assert in_series().guarantee is Guarantee.DYNAMIC
    assert in_series().box == Box({"first": interval("[1, 29999/2000]"), "second": interval("[1, 29999/2000]")})


def test_what_the_first_task_leaves_is_the_seconds():
    dispatcher = Dispatcher(in_series())
    dispatcher.step(F(0))
    dispatcher.step(F(4), [Completed("w1", F(4))])
    grown = {"first": "[4, 4]", "second": "[1, 25999/1000]"}
    assert boxes_of(dispatcher) == [("first = 4", SliceAnswer.PROMISED, grown, True)]
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC
    dispatcher.step(F(4001, 1000))
    dispatcher.step(F(30), [Completed("w2", F(30))])
    assert (dispatcher.ended, dispatcher.ending) == (True, None)
    assert dispatcher.observed == {"first": 4, "second": F(25999, 1000)}


def test_an_action_that_takes_longer_than_its_interval_leaves_less_to_the_next():
    dispatcher = Dispatcher(in_series())
    dispatcher.step(F(0))
    assert dispatcher.wake == F(150005, 10000), "when it is overdue: at the end of its interval and the patience"
    dispatcher.step(dispatcher.wake)
    # 14.9985 are left, 4.9985 more than the second is planned for: both share them
    (look,) = boxes_of(dispatcher)
    assert look[:2] == ("first exceeds 14.9995", SliceAnswer.PROMISED)
    assert (look[2], look[3]) == ({"first": "[30001/2000, 69999/4000]", "second": "[1, 49997/4000]"}, False)
    dispatcher.step(F(16), [Completed("w1", F(16))])
    assert dispatcher.remainders[-1].box == Box({"first": interval("[16, 16]"), "second": interval("[1, 13999/1000]")})
    assert dispatcher.remainders[-1].kept, "grown from 12.49925"


def test_nothing_is_left_once_the_second_task_cannot_be_in_time():
    dispatcher = Dispatcher(in_series())
    dispatcher.step(F(0))
    now = F(0)
    while not dispatcher.ended and not dispatcher.ending:
        now = dispatcher.wake
        dispatcher.step(now)
    assert isinstance(dispatcher.ending, LeftBox)
    assert F(28999, 1000) < now < 29, "the second task takes at least 1"
    assert Counter(one.answer for one in dispatcher.remainders[:-1]).keys() == {SliceAnswer.PROMISED}
    assert dispatcher.remainders[-1].answer is SliceAnswer.NOTHING
    assert len(dispatcher.remainders) < 30, "each time half of what was left"


@pytest.mark.parametrize("failed", [F(30), F(300005, 10000)])
def test_what_fails_because_it_lasts_too_long_has_left_its_interval(failed):
    dispatcher = Dispatcher(in_series())
    dispatcher.step(F(0))
    dispatcher.step(F(4), [Completed("w1", F(4))])
    dispatcher.step(F(4001, 1000))
    dispatcher.step(failed, [DispatchFailed("w2", failed, "closed")])
    assert str(dispatcher.ending) == "second exceeds 25.999", "it is not overdue before 30.001"


def test_without_time_only_the_box_counts():
    dispatcher = Dispatcher(replace(in_series(), slices=replace(in_series().slices, seconds=0.0)))
    dispatcher.step(F(0))
    dispatcher.step(F(4), [Completed("w1", F(4))])
    assert [one.answer for one in dispatcher.remainders] == [SliceAnswer.OUT_OF_TIME]
    assert dispatcher.ending is None
    late = Dispatcher(replace(in_series(), slices=replace(in_series().slices, seconds=0.0)))
    late.step(F(0))
    late.step(late.wake)
    assert isinstance(late.ending, LeftBox)


def test_a_box_that_is_not_controllable_is_replaced_at_the_beginning():
    """The second task must start from 1 to 2 before the first ends, which cannot be known: lengths may differ by 1."""
    constraints = ("w1.end - w2.start in [1, 2]", "w2.end - w2.start in [4, 4]", "w2.end - .zero in [0, 90]")
    plan = tasks(working(*constraints), problem=nothing_else("ab"))
    weak = make_dispatchable(plan, Box({"first": interval("[1, 20]")}))
    assert weak.guarantee is Guarantee.WEAK
    dispatcher = Dispatcher(sliced(weak))
    dispatcher.step(F(0))
    assert boxes_of(dispatcher) == [("the beginning", SliceAnswer.PROMISED, {"first": "[19/2, 21/2]"}, False)]
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC


def test_a_parameter_of_several_actions_keeps_an_interval_until_the_last():
    constraints = (
        "w2.end - w2.start in [first, first]",
        "w2.start - w1.end in [0.001, inf]",
        "w2.end - .zero in [0, 30]",
    )
    plan = tasks(working(*constraints), problem=nothing_else("ab"))
    dispatchable = prepare_plan(plan, ReplanningOptions(executor=Slice(None))).dispatchable
    dispatcher = Dispatcher(dispatchable)
    dispatcher.step(F(0))
    dispatcher.step(F(12), [Completed("w1", F(12))])
    assert dispatcher.remainders[-1].box == dispatchable.box == Box({"first": interval("[1, 29999/2000]")})
    dispatcher.step(F(12001, 1000))
    dispatcher.step(F(14001, 1000), [Completed("w2", F(14001, 1000))])
    assert dispatcher.remainders[-1].box == Box({"first": interval("[2, 12]")})


def consistent(plan, values, times, now):
    """Whether a schedule can be continued, by Bellman and Ford from the plan's own statements."""
    points = plan.time_points
    index = {point: number for number, point in enumerate(points)}
    edges = []

    def between(source, target, lower, upper):
        if upper is not None:
            edges.append((index[source], index[target], upper))
        if lower is not None:
            edges.append((index[target], index[source], -lower))

    for point in points:
        if point.time is not None:
            between(points[0], point, point.time, point.time)
        known = times.get(point)
        between(points[0], point, max(F(0), now) if known is None else known, known)
    ends = {variable: values[variable.name] for item in plan.constraints for bound in (item.lower, item.upper) if bound
            for variable in bound.variables}  # fmt: skip
    for item in plan.constraints:
        lower, upper = (None if bound is None else bound.evaluate(ends) for bound in (item.lower, item.upper))
        between(item.source, item.target, lower, upper)
    distance = [F(0)] * len(points)
    for _ in points:
        for source, target, weight in edges:
            distance[target] = min(distance[target], distance[source] + weight)
    return all(distance[source] + weight >= distance[target] for source, target, weight in edges)


def executed(dispatchable, values, seed):
    """One execution: what was promised must hold, what succeeds must be valid, and what is given up must be lost."""
    dispatcher = Dispatcher(dispatchable, drain=False)
    run_in_world(dispatcher, SimulatedWorld(dispatchable, Luck(fixed(values), seed)))
    assert dispatcher.ended, (seed, values)
    assert not dispatcher.rejected
    promised = [one for one in dispatcher.remainders if one.box is not None and values in one.box]
    if dispatcher.ending is None:
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)
        return "succeeded" if all(one.inside for one in dispatcher.observations) else "outside of its box"
    assert not promised, (seed, values, promised)
    assert values not in dispatcher.dispatchable.box
    slices = dispatchable.slices
    if slices.exact and isinstance(dispatcher.ending, LeftBox):
        assert dispatcher.remainders[-1].answer is SliceAnswer.NOTHING
        now = dispatcher.ending.time
        assert values not in slices.region or not consistent(dispatchable.plan, values, dispatcher.times, now), values
    return "lost"


def around(box, random):
    """Values inside of a box and up to half its width beyond; infinite sides are cut."""
    found = drawn(box, random)
    for name, one in box.intervals.items():
        width = F(20) if one.width is None else one.width
        found[name] = max(F(0), found[name] + width * F(random.randint(-30, 50), 100) * random.choice([0, 0, 1]))
    return found


@cache
def sliced_plan(*plan):
    return sliced(with_box(*plan), timeout=3)


@pytest.mark.parametrize("runs", [5, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_what_is_promised_is_kept(plan, runs):
    dispatchable, random = sliced_plan(*plan), Random(f"slices {runs}")  # noqa: S311 - reproducible
    found = Counter(executed(dispatchable, around(dispatchable.box, random), seed) for seed in range(runs))
    assert found["succeeded"] or found["outside of its box"]


@pytest.mark.parametrize("runs", [4, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", range(20))
def test_what_is_promised_in_drawn_plans_is_kept(seed, runs):
    """Ten thousand executions, and a sample."""
    random = Random(f"sliced plans {seed}")  # noqa: S311 - reproducible
    plan, box = drawn_with_box(random)
    dispatchable = sliced(make_dispatchable(plan, box))
    for run in range(runs):
        executed(dispatchable, around(box, random), run)


@pytest.mark.parametrize("seed", range(30))
def test_the_network_with_what_has_happened_is_the_plans(seed):
    """At random points, a schedule that was begun at random can be continued if the plan's own statements allow it."""
    random = Random(f"continued {seed}")  # noqa: S311 - reproducible
    plan = drawn_plan(random)
    nominal = Box.nominal(plan.parameters)
    for _ in range(20):
        values = {one.name: F(random.randint(1, 15)) for one in plan.parameters}
        box = Box.point(values)
        now, times = F(random.randint(0, 40)), {plan.time_points[0]: F(0)}
        for one in plan.instances:
            start = F(random.randint(0, 40))
            if start <= now:
                times[one.start] = start
                length = values["first" if one.identifier == "w1" else f"d{one.identifier[1:]}"]
                if start + length <= now:
                    times[one.end] = start + length
        seen = {name: Interval(value, value) for name, value in values.items()}
        facts = Observations(now=now, seen=seen, settled=frozenset(values), times=times)
        stnu = continued(parametric_stnu(plan, nominal), facts)
        assert (Dynamically(stnu, NEVER).reason(ends_of(box)) is None) == consistent(plan, values, times, now)
