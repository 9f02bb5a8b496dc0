"""What ends each side of a box, what to type for room, and by how much actions may exceed their planned durations."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given

from robust import Answer, EnvelopeResult, InputError, ParametrizedPlan, Status, check, envelope, load_plan
from robust.irr.stops import APPROACHED, CUT_SHORT, NOT_EXAMINED, Stop
from robust.qe.box import Box, Interval, Side
from robust.show.exports import FIXED, action_overruns, overruns
from robust.smt.limits import OutOfTimeError
from tests.cli.running import EXAMPLES, example
from tests.irr.building import assembled, fail_at_query, loose, parameter, parametric, shipped, timed
from tests.plan.building import drawn
from tests.sampling import Network
from tests.tables import tables

TABLES = tables(__file__)

DATA = Path(__file__).with_name("data")
BETA = Fraction(1, 2)
LOWER, UPPER = Side.LOWER, Side.UPPER
every_method = pytest.mark.parametrize("method", ["widen", "irr", "optimal"])


CRATER = "sample_2 take-sample: over all (lit crater)"
RIDGE = "sample_1 take-sample: over all (lit ridge)"
CHARGE = "drive_3 drive: over all (>= (charge scout) (reserve scout))"
NIGHT = "drive_3 drive: over all (daylight)"
LB, UB = "declared bound: lb 27.5", "declared bound: ub 31"


@pytest.mark.parametrize(
    ("method", "specs", "ends"),
    [
        ("widen", (), [(25, CRATER), (36, CHARGE), (35, CRATER), (46, CHARGE)]),
        ("irr", (), [(30, CRATER), (45, NIGHT), (30, CRATER), (40, NIGHT)]),
        ("optimal", (), [(20, RIDGE), (45, NIGHT), (40, CRATER), (40, NIGHT)]),
        ("widen", ["to_ridge,lb=27.5"], [(27.5, LB), (36, CHARGE), (32.5, CRATER), (46, CHARGE)]),
        ("irr", ["to_ridge,ub=31"], [(20.625, RIDGE), (31, UB), (39.375, CRATER), (48.125, CHARGE)]),
    ],
)
def test_known_sides(monkeypatch, method, specs, ends) -> None:
    plan = shipped("two_sample_navigation", *specs)
    result = envelope(plan, method=method)
    faces = product(("to_ridge", "to_crater"), (LOWER, UPPER))
    assert [(result.box[face[0]].end(face[1]), str(result.stops[face])) for face in faces] == ends
    assert result.advice == ()
    # A query finds what no known polyhedron says.
    monkeypatch.setattr("robust.irr.widen.touching", lambda *_: iter(()))
    assert envelope(plan, method=method).stops == result.stops


@every_method
@pytest.mark.parametrize("encoding", ["relational", "positions"])
def test_all_statements_of_the_network_are_named(method, encoding) -> None:
    """i lasts at least 1 from k on, and ends by k + 2 at the latest: only k ≥ 0 is demanded, by the network."""
    result = envelope(loose(3), method=method, encoding=encoding)
    ((face, stop),) = result.stops.items()
    assert (face, str(stop)) == (("k", LOWER), f"no schedule: {'; '.join(stop.statements)}")
    assert any("[k, inf]" in one or "i.start ≥ 0" in one for one in stop.statements)


def test_unbounded_sides_have_no_end() -> None:
    result = envelope(timed(parameter("k", 2)))
    assert {face: str(stop) for face, stop in result.stops.items()} == {("k", LOWER): "i act: non-negative duration"}
    assert result.box["k"].upper is None


def test_of_many_statements_the_first_and_the_last_are_shown() -> None:
    assert Stop("x").short == "x"
    few = Stop("no schedule", tuple("abcde"))
    assert few.short == str(few) == "no schedule: a; b; c; d; e"
    many = Stop("no schedule", tuple("abcdef"))
    assert many.short == "no schedule: a; 4 more of the network (--json lists them); f"


@pytest.mark.parametrize("method", ["widen", "irr"])
def test_a_search_that_is_cut_short_says_so(monkeypatch, method) -> None:
    plan = shipped("two_sample_navigation")
    with monkeypatch.context() as patched:
        fail_at_query(patched, 30, "time")
        result = envelope(plan, method=method)
    assert (result.status, result.verified, len(result.stops)) == (Status.TIMEOUT, True, 4)
    assert CUT_SHORT in result.stops.values()
    assert NOT_EXAMINED not in result.stops.values()
    fail_at_query(monkeypatch, 1, "time")
    nothing = envelope(plan, method=method)
    assert (nothing.verified, nothing.stops, nothing.advice) == (False, {}, ())


@pytest.mark.parametrize("error", [OutOfTimeError, KeyboardInterrupt])
def test_a_complete_box_stays_complete_if_its_sides_are_not_examined(monkeypatch, error) -> None:
    """The optimal box is known, but for one of its sides a query is needed that does not come back."""
    plan = shipped("two_sample_navigation")
    complete = envelope(plan, method="optimal")
    asked = []

    def failing(_self, box, *_):
        asked.append(box)
        raise error

    monkeypatch.setattr("robust.irr.widen.DiscoveredBadSet.ended_by", failing)
    result = envelope(plan, method="optimal")
    assert (result.status, result.box, len(asked)) == (Status.COMPLETE, complete.box, 1)
    assert set(result.stops.values()) == {NOT_EXAMINED}


def assert_contradictory(plan: ParametrizedPlan, stop: Stop, box: Box) -> None:
    """The statements are the plan's, and alone leave no schedule somewhere in the box."""
    said = [one for one in plan.constraints if str(one) in stop.statements]
    literals = [one for one in plan.timed_literals if f"timed initial literal {one.point}" in stop.statements]
    known = {*map(str, said), *(f"timed initial literal {one.point}" for one in literals)}
    known |= {f"{point} ≥ 0" for point in plan.time_points}
    known |= {f"parameter {one.name} {key} {end}" for one in plan.parameters
              for key, end in (("lb", one.lower), ("ub", one.upper))}  # fmt: skip
    assert set(stop.statements) <= known, stop
    reduced = replace(plan, constraints=tuple(said), timed_literals=tuple(literals), goal=())
    ends = ([end for end in pair if end is not None] or [Fraction(0)] for pair in box.ranges.values())
    corners = (dict(zip(box.intervals, values, strict=True)) for values in product(*ends))
    assert any(not Network(reduced, corner).consistent for corner in corners), (str(stop), box)


def judge(plan: ParametrizedPlan, method: str) -> Iterator[str]:
    """What each side of a complete box ends at, confirmed by the checker a little beyond it."""
    try:
        result = envelope(plan, method=method, beta=BETA if method == "irr" else None, timeout=20)
    except InputError:
        return
    if result.status is not Status.COMPLETE:
        return
    finite = {(name, side) for name, one in result.box.intervals.items() for side in Side if one.end(side) is not None}
    assert set(result.stops) == finite
    for face, stop in result.stops.items():
        name, side = face
        end = result.box[name].end(side)
        if stop.name.startswith("declared bound"):
            (declared,) = (one for one in plan.parameters if one.name == name)
            assert end == (declared.upper if side is UPPER else declared.lower)
            continue
        if stop == APPROACHED:
            assert method == "optimal"
            continue
        moved = result.box.moved(face, end + side.sign * (BETA if method == "irr" else Fraction(1, 1000)))
        beyond = check(plan, at=moved.intervals, every=True)
        assert beyond.answer is Answer.REFUTED, stop
        if stop.statements:
            assert_contradictory(plan, stop, moved)
            yield "network"
        elif beyond.reason is None:
            broken = [one for one, verdict in beyond.obligations.items() if verdict is Answer.REFUTED]
            assert stop.every == tuple(one for one in broken if one in stop.every), stop
            if method != "irr":
                near = result.box.moved(face, end + side.sign * Fraction(1, 10**9))
                verdicts = check(plan, at=near.intervals, every=True).obligations
                assert stop.every == tuple(one for one, verdict in verdicts.items() if verdict is Answer.REFUTED), stop
            yield "obligation"


@every_method
def test_what_ends_a_side_breaks_just_beyond(method) -> None:
    outcomes: Counter[str] = Counter()

    @drawn(9, 15)
    @given(parametric())
    def run(plan) -> None:
        outcomes.update(judge(plan, method))

    run()
    assert outcomes["obligation"] > 3, outcomes


TRIPS = (DATA / "trips-domain.pddl").read_text(encoding="utf-8")
TRIP = (DATA / "trips-problem.pddl").read_text(encoding="utf-8")
STEPS = (DATA / "trips.stn").read_text(encoding="utf-8")


def trips(lengths: str, *specs: str, **nominal: int) -> ParametrizedPlan:
    """The steps with the lengths of m1, m2, p and look, and parameters."""
    bounds = zip(("m1", "m2", "p", "look"), lengths.split(), strict=True)
    plan = "".join(f"parameter {name} default {value};" for name, value in nominal.items()) + STEPS
    plan += "".join(f"c: {step}.end - {step}.start in [{length}, {length}];" for step, length in bounds)
    return assembled(TRIPS, TRIP, plan, *specs)


def with_room(result: EnvelopeResult) -> list[str]:
    return [name for name, interval in result.box.intervals.items() if interval.width != 0]


@every_method
@pytest.mark.parametrize(("lengths", "nominal", "options"), TABLES["what is to be typed gives room"])
def test_what_is_to_be_typed_gives_room(method, lengths, nominal, options) -> None:
    """Parameters of the plan that the domain's durations hold at one value; `look` is an instance and an action."""
    result = envelope(trips(lengths, **nominal), method=method)
    assert with_room(result) == []
    (advice,) = result.advice
    assert (list(advice.parameters), list(advice.options)) == (list(nominal), options)
    assert "the domain still demands (" in advice.reason
    assert str(advice).endswith(" ".join(f"--parameter {option}" for option in options))
    typed = envelope(trips(lengths, *advice.options, **nominal), method=method)
    assert (with_room(typed), typed.advice) == (list(typed.box.intervals), ())


def test_what_is_to_be_typed_where_fluents_or_nominal_values_leave_no_room() -> None:
    roomy = envelope(trips("5 5 2 3", "duration:move", "duration:p", "duration:look"))
    assert (with_room(roomy), roomy.advice) == (["dur_m1", "dur_m2", "dur_p", "dur_look"], ())
    fluents = envelope(trips("5 5 2 3", "fluent:(way)", "fluent:(rest)"))
    assert (with_room(fluents), list(fluents.box.intervals)) == ([], ["way", "rest"])
    (advice,) = fluents.advice
    assert (advice.parameters, advice.options) == (("way", "rest"), ("duration:p", "duration:look"))
    assert "the plan fixes durations that follow from them in the domain" in advice.reason
    assert envelope(trips("5 5 2 3", "fluent:(way)", *advice.options)).advice == ()
    excluded = envelope(trips("u 5 2 3", u=6))
    assert (excluded.status, excluded.reason) == (Status.INVALID, "m1 move: duration (= ?duration 5)")
    assert [one.options for one in excluded.advice] == [("duration:m1",)]
    assert envelope(trips("u 5 2 3", "duration:m1", u=6)).status is Status.COMPLETE


def test_the_shipped_delivery_says_what_to_type() -> None:
    texts = [(EXAMPLES / "delivery" / name).read_text() for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    result = envelope(assembled(*texts))
    (advice,) = result.advice
    assert with_room(result) == []
    typed = envelope(assembled(*texts, *advice.options))
    assert with_room(typed) == list(typed.box.intervals)


DOMAIN = (DATA / "overruns-domain.pddl").read_text(encoding="utf-8")
PROBLEM = (DATA / "overruns-problem.pddl").read_text(encoding="utf-8")


def acting(actions: str, constraints: str = "", *specs: str, **nominal: int) -> ParametrizedPlan:
    """Instances that are named after the first letters of their actions, and durations of some."""
    plan = "".join(f"parameter {name} default {value};\n" for name, value in nominal.items())
    for number, name in enumerate(actions.split()):
        plan += f"durative-action instance {name[0]}{number} : ({name});\n"
    for text in filter(None, constraints.split("; ")):
        point, _, bounds = text.partition(" in ")
        target = point if "." in point else f"{point}.end - {point}.start"
        plan += f"c: {target} in {bounds};\n"
    return assembled(DOMAIN, PROBLEM, plan, *specs)


def box(**ends):
    return Box({
        name: Interval(Fraction(lower), None if upper is None else Fraction(upper), upper_closed=upper is not None)
        for name, (lower, upper) in ends.items()
    })  # fmt: skip


@pytest.mark.parametrize(("name", "specs"), TABLES["durations within the percentages are valid and more is not"])
def test_durations_within_the_percentages_are_valid_and_more_is_not(name, specs):
    plan = load_plan(*example(directory=EXAMPLES / name), parameters=specs)
    widest = envelope(plan).box
    parameter_of = {one.instance.identifier: one.parameters for one in overruns(plan, widest)}
    actions = action_overruns(plan, widest)
    scaled, tight = {}, 0
    for action in actions:
        for one in action.overruns:
            if one.reason is None:
                (scaled_by,) = parameter_of[one.instance.identifier]
                scaled[scaled_by] = one.planned * (1 + action.percent / 100)
        decisive = action.decisive
        if decisive is not None and decisive.reason is None and action.percent:
            (longer,) = parameter_of[decisive.instance.identifier]
            # The others at the values at which the box ends: a box that cannot be widened is stopped by some corner.
            beyond = decisive.planned * (1 + (action.percent + Fraction(1, 10**6)) / 100)
            assert beyond > widest[longer].upper
            assert check(plan, at={**widest.intervals, longer: beyond}).answer is Answer.REFUTED
            tight += 1
    assert tight
    assert set(scaled) == {one.name for one in plan.parameters}
    # All durations from the planned ones up to those, in any combination.
    ranges = {name: Interval(plan.nominal[name], value) for name, value in scaled.items()}
    assert check(plan, at=ranges).answer is Answer.PROVED


def test_the_least_of_several_instances():
    plan = acting("move move load", "m0 in [a, a]; m1 in [b, b]; l2 in [c, c]", a=10, b=20, c=30)
    move, load = action_overruns(plan, box(a=(0, 15), b=(0, 25), c=(0, 33)))
    assert (move.action, move.percent, move.decisive.instance.identifier) == ("move", 25, "m1")
    assert [one.percent for one in move.overruns] == [50, 25]
    assert [one.shortest for one in action_overruns(plan, box(a=(4, 15), b=(0, 25), c=(0, 33)))[0].overruns] == [4, 0]
    assert (load.action, load.percent) == ("load", 10)
    # what the domain says ends it before the box does
    assert action_overruns(plan, box(a=(0, 15), b=(0, None), c=(0, None)))[1].percent == Fraction(100, 3)
    ends = {"a": Interval(Fraction(0), Fraction(12), upper_closed=False), "b": Interval(Fraction(0), Fraction(24))}
    (move, _) = action_overruns(
        acting("move move load", "m0 in [a, a]; m1 in [b, b]; l2 in [3, 3]", a=10, b=20), Box(ends)
    )
    assert (move.percent, move.closed) == (20, False)
    plan = acting("move move load", "m0 in [a, a]; m1 in [b, b]; l2 in [0, 0]", a=0, b=10)
    (move, load) = action_overruns(plan, box(a=(0, 5), b=(0, 15)))
    assert (move.percent, move.decisive.instance.identifier) == (50, "m1")  # any share of nothing is nothing
    assert load.percent == 0


@pytest.mark.parametrize(("bound", "ends", "percent"), TABLES["bounds of durations"])
def test_bounds_of_durations(bound, ends, percent):
    (move, load) = action_overruns(acting("move load", f"m0 in {bound}; l1 in [3, 3]", a=10), box(a=ends))
    assert (move.percent, load.percent, load.decisive.reason) == (percent, 0, FIXED)


@pytest.mark.parametrize(("constraints", "reason"), TABLES["parameters that stand for more than one duration"])
def test_parameters_that_stand_for_more_than_one_duration(constraints, reason):
    (move, _) = action_overruns(acting("move move load", f"{constraints}; l2 in [3, 3]", a=10), box(a=(5, 20)))
    assert (move.percent, move.overruns[0].planned, move.overruns[0].proved) == (0, 10, 10)
    assert reason in move.overruns[0].reason


@pytest.mark.parametrize(("action", "percent"), [("pass", 20), ("slow", 10), ("rest", 40)])
def test_durations_of_fluents_that_are_parameters(action, percent):
    """Of (pace), 5, which may be from 1 to 6: as much; 10 and twice as much; 15 less as much."""
    (only,) = action_overruns(acting(action, "", "fluent:(pace)"), box(pace=(1, 6)))
    assert (only.percent, only.overruns[0].parameters) == (percent, ("pace",))


def test_a_fluent_that_another_action_uses_is_no_duration():
    (first, use) = action_overruns(acting("pass use", "", "fluent:(pace)"), box(pace=(1, 6)))
    assert (first.percent, use.percent) == (0, 0)
    assert "what u1 reads or writes" in first.overruns[0].reason
    assert use.overruns[0].reason == "nothing says how long it takes"
    ring = assembled(DOMAIN, PROBLEM, "action instance r : (ring);\nc: r - .zero in [1, 1];\n")
    assert action_overruns(ring, Box({})) == ()  # instantaneous actions have no duration
