"""Boxes of every method: known ones, and on drawn plans inside the envelope and maximal, or near its border for IRR."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import pairwise, product
from random import Random

import pytest
from hypothesis import given, settings

from robust import Answer, EnvelopeResult, InputError, Status, UnsupportedError, check
from robust.api import envelope as any_envelope
from robust.encode.encoding import RelationalEncoding
from robust.irr.containment import Containment
from robust.plan.model import ZERO, Or, ParametrizedPlan
from robust.plan.simulate import simulate
from robust.probability.risk import METHODS
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import NEVER
from tests.encode.asking import Judge, sampled
from tests.irr.building import ask_solvers, fail_at_query, lasts, parameter, parametric, shipped, timed, weighted
from tests.plan import building as b
from tests.plan.building import DURATION, END, START, F, action, at, at_least, at_most, between, drawn, number, plan_of
from tests.sampling import Network, sample_schedules

BETA = Fraction(1, 2)
TINY = Fraction(1, 10**6)
MOST_CHECKS = 200
NAVIGATION = shipped("two_sample_navigation")
VALID, BROKEN = (timed(parameter("k", nominal), pieces=lasts(3, 11)) for nominal in (6, 2))
k, m = b.reference("k"), b.reference("m")
envelope = partial(any_envelope, method="irr")
both_solvers = pytest.mark.parametrize("solver", ["z3", "cvc5"])
either_way = pytest.mark.parametrize("doubling", [False, True])


def run_irr(plan: ParametrizedPlan, **options) -> EnvelopeResult | None:
    """The result; None if no parameter values leave a schedule."""
    try:
        return envelope(plan, beta=BETA, on_step=_stop, **options)
    except InputError:
        assert not Network(plan, plan.nominal).consistent
        return None


def _stop(step) -> None:
    if step.check >= MOST_CHECKS:
        raise KeyboardInterrupt


def assert_inside(plan: ParametrizedPlan, box: Box, random: Random, count: int = 4) -> None:
    points = sampled(box.ranges, random, 1)
    for point in random.sample(points, min(count, len(points))):
        schedules = sample_schedules(plan, point, random, 4)
        assert schedules, f"no schedule at {point} of {box}"
        for schedule in schedules:
            assert simulate(plan, point, schedule).valid, (point, schedule)
        assert check(plan, at=point).answer is Answer.PROVED, point


def assert_trace_is_monotone(plan: ParametrizedPlan, result: EnvelopeResult, accepted: list[Box]) -> None:
    for smaller, larger in pairwise([Box.nominal(plan.parameters), *accepted, result.box]):
        assert all(interval.is_within(larger[name]) for name, interval in smaller.intervals.items())
    assert [step.check for step in result.trace] == list(range(1, result.checks + 1))
    for before, step in pairwise(result.trace):
        # A query about an unbounded direction may follow an accepted step, never a failed one.
        assert step.accepted or step.box == before.box or before.accepted
    for one in plan.parameters:
        assert result.box[one.name].is_within(Interval(one.lower, one.upper))
        assert one.nominal in result.box[one.name]


def assert_faces_are_near_the_border(plan: ParametrizedPlan, result: EnvelopeResult, gap: Fraction) -> int:
    """Grow each side by `gap`; how many faces there were to grow."""
    faces = 0
    for one, side in product(plan.parameters, Side):
        end = result.box[one.name].end(side)
        if end is not None and end != (one.upper if side is Side.UPPER else one.lower):
            faces += 1
            grown = result.box.moved((one.name, side), end + side.sign * gap)
            assert check(plan, at=grown.intervals).answer is Answer.REFUTED, grown
    return faces


def judge(plan: ParametrizedPlan, random: Random, *, shuffled: bool = False, **options) -> str:
    names = [one.name for one in plan.parameters]
    if shuffled:
        random.shuffle(names)
        options["order"] = names[: random.randint(1, len(names))]
    result = run_irr(plan, **options)
    if result is None:
        return "no schedule"
    nominal = check(plan)
    if result.status is Status.INVALID:
        assert nominal.answer is Answer.REFUTED
        assert (result.verified, result.values) == (False, plan.nominal)
        assert result.reason in {*nominal.obligations, nominal.reason} or "no schedule" in result.reason
        return "invalid"
    assert nominal.answer is Answer.PROVED
    assert result.verified
    accepted = [step.box for step in result.trace if step.accepted]
    assert_trace_is_monotone(plan, result, accepted)
    assert result.trace == () or result.trace[0].parameter == names[0]
    assert list(result.box.intervals) == [one.name for one in plan.parameters]
    for box in [result.box, *random.sample(accepted, min(2, len(accepted)))]:
        assert_inside(plan, box, random)
    if result.status is not Status.COMPLETE:
        return result.status.value
    faces = assert_faces_are_near_the_border(plan, result, 2 * BETA if "doubling" in options else BETA)
    return f"complete{', faces' if faces else ''}"


@pytest.mark.parametrize(
    ("count", "options"),
    [
        (14, {}),
        (6, {"solver": "cvc5"}),
        (10, {"doubling": True}),
        (10, {"shuffled": True}),
        pytest.param(1500, {}, marks=pytest.mark.slow),
    ],
    ids=["plain", "cvc5", "doubling", "any order", "many"],
)
def test_boxes_of_irr_are_inside_and_reach_the_border(count, options) -> None:
    outcomes: Counter[str] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(parametric(), b.RANDOM)
    def run(plan, random) -> None:
        outcomes[judge(plan, random, **options)] += 1

    run()
    assert outcomes["complete, faces"] >= 1 < outcomes["complete, faces"] + outcomes["complete"], outcomes
    assert count > 100 or "interrupted" not in outcomes, "a run on a small plan needs too many checks"


@drawn(6, 10)
@given(parametric(instances=2))
def test_solvers_take_the_same_steps(plan) -> None:
    """Answers do not depend on which counterexample a solver finds, so neither does the search."""
    one, two = (run_irr(plan, solver=solver) for solver in ("z3", "cvc5"))
    if one is None or two is None:
        assert one is two
        return
    first, second = ((each.status, each.box, each.checks, each.unbounded_checks) for each in (one, two))
    assert first == second
    assert [replace(step, seconds=0) for step in one.trace] == [replace(step, seconds=0) for step in two.trace]


def test_refutations_are_in_the_box_and_real() -> None:
    """Containment answers a sequence of boxes, remembering: each refutation is checked from scratch."""
    outcomes: Counter[bool] = Counter()

    def around(nominal: Fraction, random: Random) -> Interval:
        ends = nominal - Fraction(random.randint(0, 4), 2), nominal + Fraction(random.randint(0, 4), 2)
        return Interval(*(None if random.random() < 0.1 else end for end in ends))

    @drawn(12, 200)
    @given(parametric(), b.RANDOM)
    def run(plan, random) -> None:
        containment = Containment(RelationalEncoding(plan))
        for _ in range(4):
            box = Box({one.name: around(one.nominal, random) for one in plan.parameters})
            refutation = containment.refute(box, NEVER)
            outcomes[refutation is None] += 1
            if refutation is None:
                assert_inside(plan, box, random, count=2)
                continue
            assert refutation.values in box
            try:
                result = check(plan, at=refutation.values)
            except InputError:
                assert refutation.facet is not None
                continue
            assert result.answer is Answer.REFUTED, refutation
            assert Network(plan, refutation.values).consistent or not result.counterexamples

    run()
    assert min(outcomes[True], outcomes[False]) >= 3, outcomes


def searched(plan: ParametrizedPlan, method: str, **options: object) -> EnvelopeResult | None:
    """A complete result; None if the plan is invalid."""
    try:
        result = any_envelope(plan, method=method, timeout=20, **options)  # type: ignore[arg-type]
    except InputError:
        return None
    return result if result.status is Status.COMPLETE and result.verified else None


def wider(box: Box) -> Iterator[Box]:
    """Each finite face a tiny bit farther out; open ends closed."""
    for (name, interval), side in product(box.intervals.items(), Side):
        end = interval.end(side)
        if end is not None:
            yield box.moved((name, side), end + side.sign * TINY)
            if not interval.is_closed_at(side):
                yield box.moved((name, side), end)


def assert_maximal(plan: ParametrizedPlan, box: Box) -> None:
    judge = Judge(plan)
    assert judge.contains(box), f"{box} is not inside"
    for more in wider(box):
        assert not judge.contains(more), f"{box} is not maximal: {more}"


@pytest.mark.parametrize("ordered", [False, True])
@drawn(10, 300)
@given(parametric())
def test_the_box_is_inside_and_maximal(ordered, plan) -> None:
    result = searched(plan, "widen", order=[one.name for one in reversed(plan.parameters)] if ordered else ())
    if result is not None:
        assert plan.nominal in result.box
        assert_maximal(plan, result.box)


@drawn(8, 100)
@given(parametric())
def test_no_other_box_is_wider(plan) -> None:
    best = searched(plan, "optimal")
    around = searched(plan, "optimal", contain_nominal=True)
    if best is None:
        return
    judge, width = Judge(plan), weighted(plan, best.box)
    assert judge.contains(best.box)
    assert around is None or plan.nominal in around.box
    for other in (searched(plan, "widen"), searched(plan, "irr"), around):
        if other is not None:
            assert judge.contains(other.box)
            own = weighted(plan, other.box)
            # An optimum that is only approached is given up to a millionth.
            assert width is None or width >= own - max(own, Fraction(1)) / 10**6
            assert width is None or best.bound is None or best.bound >= own


# With weights, both upper ends move until to_ridge + 2 to_crater ≤ 128 stops them at 30 + 2λ and 40 + λ: λ = 9/2;
# the lower ones until to_ridge + to_crater ≥ 60 does, at λ = 10/3.
# In the other order to_crater goes from 30 (60 − 30) to 49 ((128 − 30) / 2); to_ridge then has no room on either side.
@pytest.mark.parametrize(
    ("specs", "options", "ridge", "crater"),
    [
        ((), {"solver": "z3"}, (25, 36), (35, 46)),
        ((), {"solver": "cvc5"}, (25, 36), (35, 46)),
        (("to_ridge,weight=2",), {}, (Fraction(70, 3), 39), (Fraction(110, 3), Fraction(89, 2))),
        ((), {"order": ["to_ridge"]}, (20, 45), (40, 40)),
        ((), {"order": ["to_crater"]}, (30, 30), (30, 49)),
        (("to_ridge,lb=28,ub=31",), {}, (28, 31), (32, Fraction(97, 2))),
        (("to_ridge,lb=30,ub=30", "to_crater,lb=40,ub=40"), {}, (30, 30), (40, 40)),
        (("to_ridge,lb=30,ub=30", "to_crater,lb=38,ub=41"), {"method": "optimal"}, (30, 30), (38, 41)),
    ],
)
def test_known_boxes(specs, options, ridge, crater) -> None:
    plan = shipped("two_sample_navigation", *specs)
    boxes: list[Box] = []
    result = any_envelope(plan, **options, on_step=lambda step: boxes.append(step.box))
    assert (result.status, result.beta) == (Status.COMPLETE, None)
    assert (result.bound is None) == ("method" not in options)
    assert result.box.ranges == {"to_ridge": ridge, "to_crater": crater}
    assert boxes
    assert sorted(boxes, key=lambda box: box.total_width) == boxes
    if not specs:
        assert_maximal(plan, result.box)


def test_generator() -> None:
    """Optimal is either square, or the long strip that crosses both: all have total width 92."""
    plan = shipped("generator")
    result = any_envelope(plan)
    assert result.box.ranges == {"start_1": (4, 50), "start_2": (40, 86)}
    assert_maximal(plan, result.box)
    best = any_envelope(plan, method="optimal")
    assert (best.bound, best.box.total_width) == (92, 92)
    assert Judge(plan).contains(best.box)


def test_unbounded_and_declared_beside_the_plan() -> None:
    plan = shipped("two_sample_navigation", "fluent:(charge scout),lb=0")
    box = any_envelope(plan).box
    assert box["charge_scout"].upper is None
    assert_maximal(plan, box)
    best = any_envelope(plan, method="optimal", timeout=30)
    assert (best.box["charge_scout"].upper, best.bound) == (None, None)


def in_pentagon(ridge: Fraction, crater: Fraction) -> bool:
    return 20 <= ridge <= 50 and 60 <= ridge + crater <= 85 and ridge + 2 * crater <= 128


@both_solvers
def test_navigation_is_valid_exactly_in_the_pentagon(solver) -> None:
    containment = Containment(RelationalEncoding(NAVIGATION), solver=solver)
    corners = [(20, 40), (20, 54), (42, 43), (50, 10), (50, 35), (32, 48)]
    steps = list(product((-Fraction(1, 1000), 0, Fraction(1, 1000)), repeat=2))
    points = [*product(range(15, 60, 5), range(0, 60, 5)), *((r + dr, c + dc) for r, c in corners for dr, dc in steps)]
    inside = 0
    for ridge, crater in points:
        point = {"to_ridge": Fraction(ridge), "to_crater": Fraction(crater)}
        is_inside = containment.refute(Box.point(point), NEVER) is None
        assert is_inside == in_pentagon(ridge, crater), point
        inside += is_inside
    assert 20 < inside < len(points)


@pytest.mark.parametrize("order", [(), ("to_crater",), ("to_ridge", "to_crater")])
@either_way
def test_navigation_boxes_have_their_corners_in_the_pentagon(doubling, order) -> None:
    beta = Fraction(1, 16)
    result = envelope(NAVIGATION, beta=beta, doubling=doubling, order=order)
    assert result.status is Status.COMPLETE
    assert all(in_pentagon(*corner) for corner in product(*result.box.ranges.values()))
    for name, side in product(result.box.intervals, Side):
        beyond = result.box[name].end(side) + side.sign * (2 * beta if doubling else beta)
        grown = result.box.moved((name, side), beyond)
        assert not all(in_pentagon(*corner) for corner in product(*grown.ranges.values()))


@either_way
def test_declared_bounds_stop_the_search_where_the_envelope_goes_on(doubling) -> None:
    plan = timed(parameter("k", 6, 5, 9), pieces=lasts(3, 11))
    box = envelope(plan, beta=Fraction(1, 8), doubling=doubling).box["k"]
    assert box.is_within(Interval(Fraction(5), Fraction(9)))
    assert doubling or (box.lower, box.upper) == (5, 9)


@either_way
@pytest.mark.parametrize("bounds", [((6, 6), (3, 11)), ((None, None), (6, 6))])
def test_nothing_widens_around_the_only_value(bounds, doubling) -> None:
    plan = timed(parameter("k", 6, *bounds[0]), pieces=lasts(*bounds[1]))
    result = envelope(plan, beta=Fraction(1, 4), doubling=doubling)
    assert (result.status, result.box) == (Status.COMPLETE, Box.point({"k": Fraction(6)}))
    assert not any(step.accepted for step in result.trace)
    assert (result.first_widening_seconds, result.convergence()) == (None, ())
    two = envelope(timed(parameter("k", 6, 6, 6), parameter("m", 1), pieces=lasts(3, 11)), beta=Fraction(1, 4))
    assert (two.status, two.box["k"], two.box["m"].upper) == (Status.COMPLETE, Interval(Fraction(6), Fraction(6)), 5)


@both_solvers
def test_values_of_a_refutation_lie_within_open_ends(solver) -> None:
    """i starts between 0 and k: no schedule below 0. The box (−3, 1] does not hold its worst end."""
    i = action("i")
    constraints = (between(ZERO, i.start, 0, k), between(i.start, i.end, 1, 2))
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    containment = Containment(RelationalEncoding(plan), solver=solver)
    broken = Box({"k": Interval(Fraction(-3), Fraction(1), False, True)})
    refutation = containment.refute(broken, NEVER)
    assert refutation.values in broken
    assert refutation.values["k"] < 0
    assert containment.refute(Box({"k": Interval(Fraction(0), Fraction(1), False, False)}), NEVER) is None


@both_solvers
@either_way
def test_unbounded_directions_end_and_say_so(solver, doubling) -> None:
    options = {"doubling": doubling, "solver": solver}
    up = timed(parameter("k", 6), pieces=((END, at_least(DURATION, 2)),))
    box = envelope(up, beta=Fraction(1, 4), **options).box["k"]
    assert box.upper is None
    assert 2 <= box.lower < Fraction(5, 2)
    result = envelope(timed(parameter("k", 0), length=number(3)), **options)
    assert (result.box["k"], result.unbounded_checks, result.convergence()) == (Interval(None, None), 2, ())
    # f = 2k − m must be at least 0: k may grow for ever, m only until 2k.
    goal = {"f": k.scaled(2) - m, "goal": at_least(b.value(F), 0)}
    one = envelope(
        timed(parameter("k", 3), parameter("m", 2), length=number(1), **goal), beta=Fraction(1, 8), **options
    )
    assert (one.status, one.box["k"].upper, one.box["m"].lower) == (Status.COMPLETE, None, None)
    assert 0 <= 2 * one.box["k"].lower - one.box["m"].upper < Fraction(1, 2 if doubling else 4)


def test_no_parameters() -> None:
    result = envelope(timed(length=number(4), pieces=lasts(3, 5)))
    assert (result.status, result.box, result.checks) == (Status.COMPLETE, Box({}), 0)
    broken = envelope(timed(length=number(6), pieces=lasts(3, 5)))
    assert (broken.status, broken.reason is None) == (Status.INVALID, False)


def test_an_envelope_in_two_parts_stays_in_the_nominal_one() -> None:
    apart = ((END, Or((at_most(DURATION, 4), at_least(DURATION, 7)))),)
    near, far = (timed(parameter("k", nominal), pieces=apart) for nominal in (2, 9))
    low, high = (envelope(plan, beta=Fraction(1, 8)).box["k"] for plan in (near, far))
    assert 4 - Fraction(1, 8) < low.upper <= 4
    assert high.upper is None
    assert 7 <= high.lower < 7 + Fraction(1, 8)
    assert check(far, at={"k": Interval(Fraction(3), Fraction(8))}).answer is Answer.REFUTED


def test_rates_over_a_fixed_schedule_are_linear() -> None:
    """A tank of 10 drains by k for 4, and by 1 more at once: k ≤ 9/4."""
    pieces = (b.flow(F, -k), b.increase(F, -1, START), (END, at_least(b.value(F), 0)))
    box = envelope(timed(parameter("k", 1), length=number(4), pieces=pieces, f=10), beta=Fraction(1, 64)).box["k"]
    assert Fraction(9, 4) - Fraction(1, 64) < box.upper <= Fraction(9, 4)
    assert box.lower is None
    with pytest.raises(UnsupportedError, match="non-linear"):
        envelope(timed(parameter("k", 1), pieces=pieces, f=10))


@pytest.mark.parametrize("explicit", [False, True])
def test_a_point_that_only_zero_keeps_in_place_stays_there(explicit) -> None:
    """i starts at 0 and ends whenever: that its end is not before 0 must reach every query."""
    i = action("i", (END, at_least(DURATION, 0)))
    plan = plan_of(i, constraints=(at(i.start, 0), *([between(i.start, i.end, 0)] if explicit else [])))
    assert check(plan).answer is Answer.PROVED
    assert envelope(plan).status is Status.COMPLETE


@pytest.mark.parametrize("every", [False, True])
def test_values_without_a_schedule_are_refuted_with_a_reason(every) -> None:
    """i lasts k: with k = −1 it would end before 0, so there is no schedule that shows the negative duration."""
    i = action("i")
    constraints = (between(ZERO, i.start, 0, Fraction(1, 2)), between(i.start, i.end, k, k))
    plan = plan_of(i, parameters=(parameter("k", 1),), constraints=constraints)
    result = check(plan, at={"k": Fraction(-1)}, every=every)
    assert (result.answer, result.counterexamples) == (Answer.REFUTED, {})
    assert "k = -1" in result.reason


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("plan", [VALID, BROKEN], ids=["valid", "invalid"])
def test_no_time_at_all_claims_nothing(monkeypatch, plan, method) -> None:
    ask_solvers(monkeypatch)
    result = any_envelope(plan, method=method, timeout=0)
    assert (result.status, result.verified, result.trace) == (Status.TIMEOUT, False, ())
    assert check(plan, timeout=0).answer is Answer.UNKNOWN


@pytest.mark.parametrize("error", [KeyboardInterrupt, "time"])
@pytest.mark.parametrize("at", [1, 2, 5, 9])
def test_what_was_accepted_survives_an_early_end(monkeypatch, error, at) -> None:
    complete = envelope(VALID, beta=Fraction(1, 8))
    steps = []
    fail_at_query(monkeypatch, at, error)
    result = envelope(VALID, beta=Fraction(1, 8), on_step=steps.append)
    assert result.status is (Status.TIMEOUT if error == "time" else Status.INTERRUPTED)
    assert list(result.trace) == steps
    seen = [(s.side, s.accepted, s.box) for s in steps]
    assert seen == [(s.side, s.accepted, s.box) for s in complete.trace[: len(steps)]]
    start = Box.point({"k": Fraction(6)}) if result.verified else Box.nothing(VALID.parameters)
    assert result.box == (steps[-1].box if steps else start)
    assert result.verified or not steps
    assert at != 1 or not result.verified


def test_an_interrupted_check_says_what_it_knows(monkeypatch) -> None:
    fail_at_query(monkeypatch, 2, KeyboardInterrupt)
    result = check(VALID, at={"k": Interval(Fraction(4), Fraction(5))})
    assert (result.interrupted, result.answer) == (True, Answer.UNKNOWN)
    assert Answer.UNKNOWN in result.obligations.values()


def test_ctrl_c_in_a_callback_keeps_the_step_that_was_reported() -> None:
    def stop(step) -> None:
        if step.accepted:
            raise KeyboardInterrupt

    result = envelope(VALID, on_step=stop)
    assert (result.status, result.verified) == (Status.INTERRUPTED, True)
    assert result.box == result.trace[-1].box != Box.point({"k": Fraction(6)})


@pytest.mark.parametrize(
    ("search", "options", "message"),
    [
        (envelope, {"order": ["kk"]}, r"unknown parameter 'kk'.*'k'"),
        (any_envelope, {"order": ["kk"]}, "unknown parameter"),
        (envelope, {"order": ["k", "k"]}, "more than once"),
        (check, {"at": {"kk": Fraction(1)}}, r"unknown parameter 'kk'.*'k'"),
    ],
)
def test_parameters_are_known_and_named_once(search, options, message) -> None:
    with pytest.raises(InputError, match=message):
        search(VALID, **options)


def test_steps_alternate_between_parameters_and_count() -> None:
    result = envelope(timed(parameter("k", 3), parameter("m", 3), pieces=lasts(3, 11)), order=["m"])
    assert [step.parameter for step in result.trace[:4]] == ["m", "k", "m", "k"]
    assert (result.trace[0].side, result.checks) == (Side.UPPER, len(result.trace))
    shares = [share for _, share in result.convergence()]
    assert (shares, shares[-1]) == (sorted(shares), 1)
