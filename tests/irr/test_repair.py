"""Repairs of plans: the result is proved, no cheaper one exists, and what has none says why."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import HealthCheck, assume, given, seed, settings
from hypothesis import strategies as st

import robust
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON
from robust.errors import InputError, SolverError
from robust.irr import repair as repairs
from robust.irr.check import Answer, Checker, CheckResult
from robust.irr.conflicts import RepairStatus
from robust.irr.quantities import Changeable, Cost
from robust.irr.repair import RepairSearch
from robust.plan.load import load_plan
from robust.plan.model import Bound, ParametrizedPlan, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, OutOfTimeError
from tests.irr.building import EXAMPLES
from tests.plan.building import action, at, between, plan_of
from tests.strategies import plans

AMOUNTS = [Fraction(1, 4), Fraction(1, 2), Fraction(1), Fraction(3, 2), Fraction(2), Fraction(3), Fraction(5)]
RANGE = Fraction(10)
SIDES = ("lower", "upper")


def navigation(plan: str) -> ParametrizedPlan:
    folder = EXAMPLES / "two_sample_navigation"
    return load_plan(folder / "domain.pddl", folder / "problem.pddl", folder / plan)


def is_proved(plan: ParametrizedPlan, box: Box | None = None) -> bool:
    """By the check alone; a network without any schedule is no proof."""
    try:
        found = Checker(RelationalEncoding(plan), box or Box.nominal(plan.parameters)).run()
    except InputError:
        return False
    return found.answer is Answer.PROVED


def with_bound(plan: ParametrizedPlan, index: int, side: str, value: Fraction) -> ParametrizedPlan | None:
    """The plan with another bound; None if lower and upper one would be the wrong way round."""
    bound: Bound = Polynomial.constant(value)
    moved: TemporalConstraint = replace(plan.constraints[index], **{side: bound})
    low, high = moved.lower, moved.upper
    if low is not None and high is not None and (high - low).is_constant and (high - low).constant_term < 0:
        return None
    return replace(plan, constraints=(*plan.constraints[:index], moved, *plan.constraints[index + 1 :]))


def cheaper(plan: ParametrizedPlan, limit: Fraction, *, reorder: bool) -> Iterator[ParametrizedPlan]:
    """Every plan of a grid in which one bound differs by less than the limit."""
    for index, constraint in enumerate(plan.constraints):
        for side in SIDES:
            bound = getattr(constraint, side)
            if bound is None or not bound.is_constant:
                continue
            old, sign = bound.constant_term, 1 if side == "upper" else -1
            for step in (amount * way for amount in AMOUNTS if amount < limit for way in (1, -1)):
                turns = old * sign <= 0 and (old + step) * sign > -min(abs(old), EPSILON)
                if (reorder or not turns) and (other := with_bound(plan, index, side, old + step)) is not None:
                    yield other


@st.composite
def broken(draw: st.DrawFn) -> ParametrizedPlan:
    """A plan with a few bounds moved, mostly outwards, that is refuted."""
    plan = draw(plans(linear=True, tame=True, infeasible=False, instances=3))
    assume(plan.constraints)
    for _ in range(draw(st.integers(1, 3))):
        index, side = draw(st.integers(0, len(plan.constraints) - 1)), draw(st.sampled_from(SIDES))
        bound = getattr(plan.constraints[index], side)
        if bound is not None and bound.is_constant:
            amount = draw(st.sampled_from([Fraction(1, 2), Fraction(1), Fraction(2), Fraction(4), Fraction(-1)]))
            outwards = amount if side == "upper" else -amount
            plan = with_bound(plan, index, side, bound.constant_term + outwards) or plan
    assume(not is_proved(plan))
    return plan


COUNTS = [5, pytest.param(50, marks=pytest.mark.slow)]


def holds_for(count: int, statement: Callable[..., None], *strategies: st.SearchStrategy[object]) -> None:
    """The statement holds for so many drawn examples."""
    settings(max_examples=count, deadline=None)(given(*strategies)(statement))()


@given(broken(), st.booleans(), st.booleans())
@settings(max_examples=6, deadline=None)
def test_repairs_are_proved_and_no_change_of_one_bound_is_cheaper(plan, count, reorder) -> None:
    confirm_repair(plan, count=count, reorder=reorder)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_two_hundred_repairs(number) -> None:
    """Twenty times ten, since plans that are drawn one after the other are often alike."""

    @seed(number)
    @settings(max_examples=10, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(broken(), st.booleans(), st.booleans())
    def ten(plan, count, reorder) -> None:
        confirm_repair(plan, count=count, reorder=reorder)

    ten()


def confirm_repair(plan: ParametrizedPlan, *, count: bool, reorder: bool) -> None:
    """The result is proved, and no plan of the grid that costs less is."""
    found = RepairSearch(plan, count=count, reorder=reorder).run()
    assert found.status in {RepairStatus.OPTIMAL, RepairStatus.IMPOSSIBLE}
    limit, single = RANGE, 1 if count else 0
    if found.cost is not None:
        assert found.plan is not None
        assert is_proved(found.plan)
        assert all(change.serves for change in found.changes)
        assert found.bound.count == found.cost.count
        assert found.bound.total == found.cost.total or not found.attained
        limit = found.bound.total if found.cost.count <= single else RANGE
    else:
        assert found.contradiction
    assert not any(map(is_proved, cheaper(plan, limit, reorder=reorder)))


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_called_impossible_at_once_is_so_after_a_search(count) -> None:
    """Where no schedule keeps all obligations, whatever is changed."""
    holds_for(count, confirm_impossible, broken(), st.data())


def confirm_impossible(plan, data) -> None:
    required = {}
    for one in plan.parameters:
        if data.draw(st.booleans(), label=f"require {one.name}"):
            far = data.draw(st.sampled_from([Fraction(1), Fraction(8), Fraction(64)]), label="how far")
            required[one.name] = Interval(one.nominal, one.nominal + far)
    quick = RepairSearch(plan, require=required).run()
    searching = RepairSearch(plan, require=required)
    searching._hopeful = True
    slow = searching.run()
    assert (quick.status, quick.cost, quick.bound) == (slow.status, slow.cost, slow.bound)
    assert bool(quick.contradiction) == (quick.status is RepairStatus.IMPOSSIBLE)


def test_what_no_schedule_keeps_is_impossible_without_a_search() -> None:
    found = robust.repair(navigation("plan-flexible-wait.stn"), require=["to_crater=38:900"])
    assert (found.status, found.candidates) == (RepairStatus.IMPOSSIBLE, 1)
    assert found.contradiction == ("drive_2 drive: over all (daylight)",)


def test_an_end_that_is_not_required_is_no_point_to_ask_about() -> None:
    required = {"a": Interval(Fraction(1), Fraction(5), upper_closed=False), "b": Interval(Fraction(2), None)}
    low, high = repairs._ends(required)
    assert (low["a"], low["b"]) == (1, 2)
    assert all(value in required[name] for name, value in high.items())


@pytest.mark.parametrize("count", COUNTS)
def test_fewest_changes_are_no_more_and_least_sums_cost_no_more(count) -> None:
    holds_for(count, confirm_fewest, broken())


def confirm_fewest(plan) -> None:
    least, fewest = RepairSearch(plan).run(), RepairSearch(plan, count=True).run()
    assert (least.plan is None) == (fewest.plan is None)
    if least.plan is not None and least.cost is not None and fewest.cost is not None:
        assert len(fewest.changes) <= len(least.changes)
        # A bound that was infinite comes for nothing in the sum, but not where as few as possible are made finite.
        assert any(one.cost is None for one in fewest.changes) or least.bound.total <= fewest.cost.total


def test_one_bound_repairs_the_flexible_wait() -> None:
    found = robust.repair(navigation("plan-flexible-wait.stn"))
    assert found.status is RepairStatus.OPTIMAL
    assert found.cost == found.bound == Cost(0, Fraction(4))
    (change,) = found.changes
    assert change.words == "drive_2.start at most 16 after sample_1.end instead of 20"
    assert str(change) == "c: drive_2.start - sample_1.end in [1, 20] (line 17): upper bound 20 to 16"
    assert change.serves == ("drive_3 drive: over all (daylight)",)
    assert (change.part, change.location and change.location.line) == ("upper", 17)
    assert found.check is not None
    assert found.check.answer is Answer.PROVED
    assert not found.cut_short


def test_nominal_values_change_by_weight_and_within_their_bounds() -> None:
    plan = navigation("plan-flexible-wait.stn")
    heavy = [replace(one, weight=Fraction(3 if one.name == "to_crater" else 1)) for one in plan.parameters]
    found = robust.repair(replace(plan, parameters=tuple(heavy)), change="nominal")
    assert [change.words for change in found.changes] == ["to_ridge 26 instead of 30"]
    kept = [replace(one, lower=Fraction(28)) if one.name == "to_ridge" else one for one in heavy]
    found = robust.repair(replace(plan, parameters=tuple(kept)), change="nominal")
    assert found.cost == Cost(0, Fraction(2 + 2 * 3))
    fewest = robust.repair(replace(plan, parameters=tuple(kept)), change="nominal", count=True)
    assert fewest.cost == Cost(1, Fraction(12))


def test_what_is_required_holds() -> None:
    plan = navigation("plan.stn")
    assert robust.repair(plan).status is RepairStatus.UNNEEDED
    required = {"to_crater": Interval(Fraction(35), Fraction(60))}
    found = robust.repair(plan, require=required)
    box = Box.nominal(plan.parameters).replace("to_crater", required["to_crater"])
    if found.plan is None:
        assert found.contradiction
        assert not is_proved(plan, box)
    else:
        assert is_proved(found.plan, box)
        assert not is_proved(plan, box)
    flexible = navigation("plan-flexible-wait.stn")
    wide = robust.repair(flexible, require=["to_crater=38:44", "to_ridge=25:35"])
    assert [change.words for change in wide.changes] == ["drive_2.start at most 7 after sample_1.end instead of 20"]
    both = robust.repair(flexible, require={"to_crater": 44}, change="nominal")
    assert [change.quantity.name for change in both.changes] == ["to_ridge"]


def test_an_endless_wait_gets_a_limit_as_wide_as_can_be() -> None:
    plan = navigation("plan-flexible-wait.stn")
    index = next(i for i, one in enumerate(plan.constraints) if one.upper == Polynomial.constant(Fraction(20)))
    endless = replace(plan.constraints[index], upper=None)
    plan = replace(plan, constraints=(*plan.constraints[:index], endless, *plan.constraints[index + 1 :]))
    found = robust.repair(plan)
    assert found.cost == Cost(1, Fraction(0))
    assert [change.words for change in found.changes] == [
        "drive_2.start at most 16 after sample_1.end, where there was no limit"
    ]
    assert found.changes[0].cost is None


def test_a_network_without_schedule_is_repaired_too() -> None:
    i = action("i")
    plan = plan_of(i, constraints=(at(i.start, 2), between(i.start, i.end, 3, 4), at(i.end, 1)))
    found = RepairSearch(plan, kinds=(Changeable.BOUND,)).run()
    assert found.status is RepairStatus.OPTIMAL
    assert found.cost == Cost(0, Fraction(4))
    assert found.plan is not None
    assert is_proved(found.plan)
    assert all(text.startswith("no schedule: ") for change in found.changes for text in change.serves)


def test_what_cannot_be_repaired_names_what_contradicts() -> None:
    plan = navigation("plan-flexible-wait.stn")
    required = {"to_crater": Interval(Fraction(0), Fraction(1000))}
    found = robust.repair(plan, require=required)
    assert found.status is RepairStatus.IMPOSSIBLE
    assert found.plan is None
    assert not found.changes
    assert found.contradiction
    declared = replace(plan, parameters=tuple(replace(one, upper=Fraction(50)) for one in plan.parameters))
    found = robust.repair(declared, require=required)
    assert any("ub 50" in reason for reason in found.contradiction)


def test_out_of_time_and_interrupted(monkeypatch) -> None:
    plan = navigation("plan-flexible-wait.stn")
    found = robust.repair(plan, timeout=0)
    assert found.status is RepairStatus.UNKNOWN
    assert found.cut_short
    assert not found.interrupted
    monkeypatch.setattr(RepairSearch, "best_known", _interrupt)
    found = robust.repair(plan)
    assert found.interrupted
    assert found.status is RepairStatus.UNKNOWN


def _interrupt(_search: RepairSearch) -> None:
    raise KeyboardInterrupt


def test_the_best_so_far_has_a_gap(monkeypatch) -> None:
    """The first dive ends with a repair; then time is out."""
    original = RepairSearch.best_known

    def once(search: RepairSearch):
        if search.best is not None:
            raise OutOfTimeError
        return original(search)

    monkeypatch.setattr(RepairSearch, "best_known", once)
    costs: list[Cost] = []
    search = RepairSearch(navigation("plan-flexible-wait.stn"), on_repair=costs.append, deadline=Deadline.after(60))
    found = search.run()
    assert found.status is RepairStatus.FEASIBLE
    assert found.bound == Cost()
    assert found.cost == costs[-1]
    assert search.so_far(timed_out=True).status is RepairStatus.FEASIBLE


@pytest.mark.parametrize("count", COUNTS)
def test_whenever_time_is_out_the_gap_holds(count) -> None:
    """The least cost is between the bound and the cost of the best repair so far, which is proved."""
    holds_for(count, confirm_gap, broken(), st.integers(1, 12))


def confirm_gap(plan, steps) -> None:
    least, left = RepairSearch(plan).run(), steps
    search = RepairSearch(plan)
    original = search.violated

    def until(candidate):
        nonlocal left
        left -= 1
        if left < 0:
            raise OutOfTimeError
        return original(candidate)

    search.violated = until
    found = search.run()
    if left >= 0:
        assert (found.status, found.bound) == (least.status, least.bound)
        return
    assert found.cut_short
    if least.cost is not None:
        assert found.bound <= least.bound
    if found.plan is not None:
        assert found.cost is not None
        assert least.bound <= found.cost
        assert is_proved(found.plan)


def test_a_check_that_disagrees_is_an_error(monkeypatch) -> None:
    def refuting(self) -> CheckResult:
        return CheckResult(Answer.REFUTED, self.box, {}, {}, 0.0, reason="no reason")

    monkeypatch.setattr(repairs.Checker, "run", refuting)
    with pytest.raises(SolverError, match="does not confirm a repair"):
        robust.repair(navigation("plan-flexible-wait.stn"))


def test_wrong_options() -> None:
    plan = navigation("plan.stn")
    with pytest.raises(InputError, match="unknown parameter 'to_crate'"):
        robust.repair(plan, require={"to_crate": 1})
    with pytest.raises(InputError, match="expected LOW:HIGH with LOW not above HIGH"):
        robust.repair(plan, require=["to_crater=3:1"])
    with pytest.raises(InputError, match="unknown change"):
        robust.repair(plan, change="all")
