"""Repairs of plans: the result is proved, no cheaper one exists, and what has none says why."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import HealthCheck, assume, given, seed, settings
from hypothesis import strategies as st

import robust
from robust import Box, InputError, Interval, ParametrizedPlan, RepairStatus, SolverError
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON
from robust.irr import repair as repairs
from robust.irr.check import Answer, Checker, CheckResult
from robust.irr.quantities import Changeable, Cost
from robust.irr.repair import RepairSearch
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError
from tests.irr.building import shipped
from tests.plan.building import action, at, between, plan_of
from tests.strategies import plans

AMOUNTS = [Fraction(1, 4), Fraction(1, 2), Fraction(1), Fraction(3, 2), Fraction(2), Fraction(3), Fraction(5)]
RANGE = Fraction(10)
SIDES = ("lower", "upper")
VALID = shipped("two_sample_navigation")
FLEXIBLE = shipped("two_sample_navigation", plan="plan-flexible-wait.stn")
NIGHT = "drive_3 drive: over all (daylight)"


def is_proved(plan: ParametrizedPlan, box: Box | None = None) -> bool:
    """By the check alone; a network without any schedule is no proof."""
    try:
        return Checker(RelationalEncoding(plan), box or Box.nominal(plan.parameters)).run().answer is Answer.PROVED
    except InputError:
        return False


def with_bound(plan: ParametrizedPlan, index: int, side: str, value: Fraction) -> ParametrizedPlan | None:
    """The plan with another bound; None if lower and upper one would be the wrong way round."""
    moved = replace(plan.constraints[index], **{side: Polynomial.constant(value)})
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


def confirm_repair(plan: ParametrizedPlan, count: bool, reorder: bool) -> None:
    """The result is proved, and no plan of the grid that costs less is."""
    repair = RepairSearch(plan, count=count, reorder=reorder).run()
    assert repair.status in {RepairStatus.OPTIMAL, RepairStatus.IMPOSSIBLE}
    limit, single = RANGE, 1 if count else 0
    if repair.cost is not None:
        assert is_proved(repair.plan)
        assert all(change.serves for change in repair.changes)
        assert repair.bound.count == repair.cost.count
        assert repair.bound.total == repair.cost.total or not repair.attained
        limit = repair.bound.total if repair.cost.count <= single else RANGE
    else:
        assert repair.contradiction
    assert not any(map(is_proved, cheaper(plan, limit, reorder=reorder)))


def confirm_impossible(plan: ParametrizedPlan, data: st.DataObject) -> None:
    """Where no schedule keeps all obligations, whatever is changed, a search ends there as well."""
    required = {}
    for one in plan.parameters:
        if data.draw(st.booleans(), label=f"require {one.name}"):
            far = data.draw(st.sampled_from([Fraction(1), Fraction(8), Fraction(64)]), label="how far")
            required[one.name] = Interval(one.nominal, one.nominal + far)
    quick = RepairSearch(plan, require=required).run()
    searching = RepairSearch(plan, require=required)
    searching._hopeful = True
    slow = searching.run()
    assert (quick.status, quick.cost) == (slow.status, slow.cost)
    # How far a bound rose before nothing was left depends on the models that a solver happens to find.
    assert quick.bound == slow.bound or quick.status is RepairStatus.IMPOSSIBLE
    assert bool(quick.contradiction) == (quick.status is RepairStatus.IMPOSSIBLE)


def confirm_fewest(plan: ParametrizedPlan) -> None:
    """Fewest changes are no more, and least sums cost no more."""
    least, fewest = RepairSearch(plan).run(), RepairSearch(plan, count=True).run()
    assert (least.plan is None) == (fewest.plan is None)
    if least.plan is not None and least.cost is not None and fewest.cost is not None:
        assert len(fewest.changes) <= len(least.changes)
        # A bound that was infinite comes for nothing in the sum, but not where as few as possible are made finite.
        assert any(one.cost is None for one in fewest.changes) or least.bound.total <= fewest.cost.total


def confirm_gap(plan: ParametrizedPlan, steps: int) -> None:
    """When time is out, the least cost is between the bound and the cost of the best repair so far, which is proved."""
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
    repair = search.run()
    if left >= 0:
        assert (repair.status, repair.bound) == (least.status, least.bound)
        return
    assert repair.cut_short
    assert least.cost is None or repair.bound <= least.bound
    if repair.plan is not None:
        assert least.bound <= repair.cost
        assert is_proved(repair.plan)


@pytest.mark.parametrize("count", [4, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("statement", "strategies"),
    [
        (confirm_repair, (broken(), st.booleans(), st.booleans())),
        (confirm_impossible, (broken(), st.data())),
        (confirm_fewest, (broken(),)),
        (confirm_gap, (broken(), st.integers(1, 12))),
    ],
)
def test_repairs_of_drawn_plans(statement: Callable[..., None], strategies, count) -> None:
    settings(max_examples=count, deadline=None)(given(*strategies)(statement))()


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_two_hundred_repairs(number) -> None:
    """Twenty times ten, since plans that are drawn one after the other are often alike."""
    health = {"database": None, "suppress_health_check": list(HealthCheck)}
    asked = given(broken(), st.booleans(), st.booleans())(confirm_repair)
    seed(number)(settings(max_examples=10, deadline=None, **health)(asked))()


def test_one_bound_repairs_the_flexible_wait() -> None:
    repair = robust.repair(FLEXIBLE)
    assert (repair.status, repair.check.answer, repair.cut_short) == (RepairStatus.OPTIMAL, Answer.PROVED, False)
    assert repair.cost == repair.bound == Cost(0, Fraction(4))
    (change,) = repair.changes
    assert change.words == "drive_2.start at most 16 after sample_1.end instead of 20"
    assert str(change) == "c: drive_2.start - sample_1.end in [1, 20] (line 17): upper bound 20 to 16"
    assert (change.part, change.location.line, change.serves) == ("upper", 17, (NIGHT,))


def test_an_endless_wait_gets_a_limit_as_wide_as_can_be() -> None:
    index = next(i for i, one in enumerate(FLEXIBLE.constraints) if one.upper == Polynomial.constant(Fraction(20)))
    endless = replace(FLEXIBLE.constraints[index], upper=None)
    constraints = (*FLEXIBLE.constraints[:index], endless, *FLEXIBLE.constraints[index + 1 :])
    repair = robust.repair(replace(FLEXIBLE, constraints=constraints))
    (change,) = repair.changes
    assert (repair.cost, change.cost) == (Cost(1, Fraction(0)), None)
    assert change.words == "drive_2.start at most 16 after sample_1.end, where there was no limit"


def test_nominal_values_change_by_weight_and_within_their_bounds() -> None:
    ridge, crater = (replace(one, weight=Fraction(w)) for one, w in zip(FLEXIBLE.parameters, (1, 3), strict=True))
    repair = robust.repair(replace(FLEXIBLE, parameters=(ridge, crater)), change="nominal")
    assert [change.words for change in repair.changes] == ["to_ridge 26 instead of 30"]
    kept = replace(FLEXIBLE, parameters=(replace(ridge, lower=Fraction(28)), crater))
    assert robust.repair(kept, change="nominal").cost == Cost(0, Fraction(2 + 2 * 3))
    assert robust.repair(kept, change="nominal", count=True).cost == Cost(1, Fraction(12))


def test_what_is_required_holds() -> None:
    assert robust.repair(VALID).status is RepairStatus.UNNEEDED
    required = {"to_crater": Interval(Fraction(35), Fraction(60))}
    repair = robust.repair(VALID, require=required)
    box = Box.nominal(VALID.parameters).replace("to_crater", required["to_crater"])
    assert not is_proved(VALID, box)
    assert repair.contradiction if repair.plan is None else is_proved(repair.plan, box)
    wide = robust.repair(FLEXIBLE, require=["to_crater=38:44", "to_ridge=25:35"])
    assert [change.words for change in wide.changes] == ["drive_2.start at most 7 after sample_1.end instead of 20"]
    both = robust.repair(FLEXIBLE, require={"to_crater": 44}, change="nominal")
    assert [change.quantity.name for change in both.changes] == ["to_ridge"]


def test_an_end_that_is_not_required_is_no_point_to_ask_about() -> None:
    required = {"a": Interval(Fraction(1), Fraction(5), upper_closed=False), "b": Interval(Fraction(2), None)}
    low, high = repairs._ends(required)
    assert (low["a"], low["b"]) == (1, 2)
    assert all(value in required[name] for name, value in high.items())


def test_a_network_without_schedule_is_repaired_too() -> None:
    i = action("i")
    plan = plan_of(i, constraints=(at(i.start, 2), between(i.start, i.end, 3, 4), at(i.end, 1)))
    repair = RepairSearch(plan, kinds=(Changeable.BOUND,)).run()
    assert (repair.status, repair.cost) == (RepairStatus.OPTIMAL, Cost(0, Fraction(4)))
    assert is_proved(repair.plan)
    assert all(text.startswith("no schedule: ") for change in repair.changes for text in change.serves)


def test_what_cannot_be_repaired_names_what_contradicts() -> None:
    at_once = robust.repair(FLEXIBLE, require=["to_crater=38:900"])
    assert (at_once.status, at_once.candidates) == (RepairStatus.IMPOSSIBLE, 1)
    assert (at_once.plan, list(at_once.changes)) == (None, [])
    assert at_once.contradiction == ("drive_2 drive: over all (daylight)",)
    declared = replace(FLEXIBLE, parameters=tuple(replace(one, upper=Fraction(50)) for one in FLEXIBLE.parameters))
    repair = robust.repair(declared, require={"to_crater": Interval(Fraction(0), Fraction(1000))})
    assert any("ub 50" in reason for reason in repair.contradiction)


def test_out_of_time_and_interrupted(monkeypatch) -> None:
    late = robust.repair(FLEXIBLE, timeout=0)
    assert (late.status, late.cut_short, late.interrupted) == (RepairStatus.UNKNOWN, True, False)

    def interrupt(_search: RepairSearch) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(RepairSearch, "best_known", interrupt)
    ended = robust.repair(FLEXIBLE)
    assert (ended.status, ended.interrupted) == (RepairStatus.UNKNOWN, True)


def test_the_best_so_far_has_a_gap(monkeypatch) -> None:
    """The first dive ends with a repair; then time is out."""
    original = RepairSearch.best_known

    def once(search: RepairSearch):
        if search.best is not None:
            raise OutOfTimeError
        return original(search)

    monkeypatch.setattr(RepairSearch, "best_known", once)
    costs: list[Cost] = []
    search = RepairSearch(FLEXIBLE, on_repair=costs.append, deadline=Deadline.after(60))
    repair = search.run()
    assert (repair.status, repair.bound, repair.cost) == (RepairStatus.FEASIBLE, Cost(), costs[-1])
    assert search.so_far(timed_out=True).status is RepairStatus.FEASIBLE


def test_a_check_that_disagrees_is_an_error(monkeypatch) -> None:
    def refuting(self) -> CheckResult:
        return CheckResult(Answer.REFUTED, self.box, {}, {}, 0.0, reason="no reason")

    monkeypatch.setattr(repairs.Checker, "run", refuting)
    with pytest.raises(SolverError, match="does not confirm a repair"):
        robust.repair(FLEXIBLE)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"require": {"to_crate": 1}}, "unknown parameter 'to_crate'"),
        ({"require": ["to_crater=3:1"]}, "expected LOW:HIGH with LOW not above HIGH"),
        ({"change": "all"}, "unknown change"),
    ],
)
def test_wrong_options(options, message) -> None:
    with pytest.raises(InputError, match=message):
        robust.repair(VALID, **options)
