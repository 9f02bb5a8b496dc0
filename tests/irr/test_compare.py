"""Comparisons of known plans as a whole and after Ctrl-C; recorded instances, face by face and beyond their boxes."""

import json
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product, repeat
from pathlib import Path

import pytest

import robust
from robust import RegionStatus, Status
from robust.encode.encoding import RelationalEncoding
from robust.irr.compare import METHODS, Comparing, Comparison, RatioBounds, volume_share, width_share
from robust.irr.containment import Containment
from robust.plan.model import Or, ParametrizedPlan
from robust.qe.box import Box, Interval, Side
from robust.qe.estimate import VolumeBounds
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Session
from tests.irr.building import ask_solvers, lasts, parameter, shipped, timed
from tests.plan.building import DURATION, END, START, F, above, at_least, at_most, increase, number, value

BETA = Fraction(1)
STEP = Fraction(2)
"""The doubling schedule with β = 1 leaves less than this between a face and the envelope."""


def instances(dataset: Path, file: str = "recorded-results.json") -> list[tuple[dict, ParametrizedPlan]]:
    listed = json.loads((dataset / file).read_text())
    return [(one, robust.load_plan(*(dataset / one[key] for key in ("domain", "problem", "plan")))) for one in listed]


def faces_of(comparison: Comparison, entry) -> Iterator[list[str]]:
    """The gap of each face and what breaks just beyond it, at a point outside the box and the region."""
    for face in entry.faces:
        name, side, box = face.parameter, face.side, entry.result.box
        assert (face.end, face.closed) == (box[name].end(side), box[name].is_closed_at(side))
        farther = face.end + side.sign * (face.gap + Fraction(1, 1000))
        assert face.witness.values in box.moved((name, side), farther)
        assert face.witness.values not in box
        assert face.witness.values not in comparison.region.region
        yield [str(face.gap), face.witness.obligation.partition(" cannot hold")[0]]


@pytest.mark.parametrize(
    ("names", "least"),
    [
        (("auv_mission_10_0_2", "generator_linear_05_2", "solar_rover_02_3"), 0),
        pytest.param((), 700, marks=pytest.mark.slow),
    ],
)
def test_faces_of_recorded_instances_are_explained(dataset, names: tuple[str, ...], least: int) -> None:
    """Each face has a gap of 0, or below β for IRR, and a point just beyond it that breaks a named obligation."""
    total = 0
    for instance, plan in instances(dataset):
        if not names or instance["instance"] in names:
            comparison = robust.compare(plan, beta=BETA)
            assert comparison.status is Status.COMPLETE
            for entry in comparison.entries:
                faces = list(faces_of(comparison, entry))
                for gap, obligation in faces:
                    assert Fraction(gap) < BETA if entry.method == "irr" else gap == "0"
                    assert obligation
                ends = [end for pair in entry.result.box.ranges.values() for end in pair]
                assert len(faces) == len(ends) - ends.count(None), instance["instance"]
                total += len(faces)
    assert total > least


@pytest.mark.parametrize("every", [16, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans_are_proved_and_points_outside_their_boxes_refuted(dataset, every: int) -> None:
    shown = 0
    for instance, plan in instances(dataset)[::every]:
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]
        box = Box({name: Interval(Fraction(low), Fraction(high)) for name, (low, high) in instance["irr_box"].items()})
        containment = Containment(RelationalEncoding(plan))
        for name, side in product(box.intervals, Side):
            wider = box.moved((name, side), box[name].end(side) + side.sign * STEP)
            outside = containment.refute(wider, NEVER)
            assert outside is not None, (instance["instance"], name, side)
            assert outside.values in wider
            assert outside.values not in box
            result = robust.check(plan, at=outside.values)
            assert result.answer is robust.Answer.REFUTED, (instance["instance"], outside)
            # Each counterexample has been executed by the simulator; without one there is no schedule at all.
            assert result.counterexamples or "no schedule" in (result.reason or "")
            shown += len(result.counterexamples)
    assert shown > 4
    delivery = instances(dataset, "robot-delivery/instances.json")
    assert len(delivery) == 27
    for instance, plan in delivery[:: (every + 3) // 4]:
        assert len(plan.parameters) == instance["parameters"]
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]


SPLIT = (END, Or((at_most(DURATION, 4), at_least(DURATION, 7))))
OPEN = timed(parameter("k", 4), parameter("m", 1, 0, 6), pieces=((END, above(number(8), DURATION)),))
APART = timed(parameter("k", 5, 0, 9), pieces=(SPLIT,))
CUBE = timed(*(parameter(name, 1, 0, 4) for name in "abc"), pieces=(SPLIT,))
SEPARATED = timed(parameter("k", 2), pieces=(increase(F, 1, START), (END, at_least(value(F), 1))))
NOTHING = timed(length=number(4), pieces=lasts(3, 5))
SETTINGS = {"beta": Fraction(2), "epsilon": Fraction(1, 4), "solver": "cvc5"}
LATE, EARLY = "i act: at end c0", ["0", "i act: non-negative duration"]
LOW_K, LOW_M = (["0", f"no schedule with {name} = -1/1000: parameter {name} lb 0"] for name in "km")
NIGHT = ["0", "drive_3 drive: over all (daylight)"]
CHARGE = ["0", "drive_3 drive: over all (>= (charge scout) (reserve scout))"]
RIDGE, CRATER = (["0", f"sample_{i} take-sample: over all (lit {at})"] for i, at in ((1, "ridge"), (2, "crater")))
APPROACHED = ["k ∈ [1/4, inf)", None, None, ["0", "separation: i.start, i.end"]]
WIDEST = ["to_ridge ∈ [20, 45], to_crater ∈ [40, 40]", "0", "25/74", NIGHT, RIDGE, NIGHT, CRATER]
# By method: the box, its shares of volume and width, and the faces.
CLOSED_BOXES = {
    "irr": ["to_ridge ∈ [30, 45], to_crater ∈ [30, 40]", "150/629", "25/74", *[NIGHT, CRATER] * 2],
    "widen": ["to_ridge ∈ [25, 36], to_crater ∈ [35, 46]", "121/629", "11/37", *[CHARGE, CRATER] * 2],
    "optimal": WIDEST,
    "optimal-nominal": WIDEST,
}
OPEN_BOXES = {
    "irr": ["k ∈ [0, 4], m ∈ [0, 7/2]", "7/24", "3/8", ["1/2", LATE], EARLY, ["1/2", LATE], LOW_M],
    "widen": ["k ∈ [0, 11/2], m ∈ [0, 5/2)", "55/192", "2/5", ["0", LATE], EARLY, ["0", LATE], LOW_M],
}
APART_BOXES = {
    **{key: ["k ∈ (5, 5)", None, None] for key in ("irr", "widen", "optimal-nominal")},
    "optimal": ["k ∈ [0, 4]", "2/3", "4/9", ["0", LATE], LOW_K],
}
SEPARATED_BOXES = {
    **dict.fromkeys(METHODS, APPROACHED),
    "irr": ["k ∈ [1, inf)", None, None, ["3/4", "separation: i.start, i.end"]],
}


def share(of: RatioBounds | None) -> str | None:
    return of and (str(of.lower) if of.is_exact else f"{of.lower} to {of.upper}")


@pytest.mark.parametrize(
    ("plan", "options", "volume", "boxes"),
    [
        (shipped("two_sample_navigation"), {}, (629, 629), CLOSED_BOXES),
        (OPEN, {}, (48, 48), OPEN_BOXES),
        (APART, {}, (6, 6), APART_BOXES),
        (SEPARATED, {**SETTINGS, "encoding": "relational"}, (0, None), SEPARATED_BOXES),
        (SEPARATED, {**SETTINGS, "encoding": "positions"}, (0, None), SEPARATED_BOXES),
        (NOTHING, {}, (1, 1), {key: ["(no parameters)", None, None] for key in METHODS}),
    ],
    ids=["closed", "open", "apart", "unbounded, relational", "unbounded, positions", "nothing"],
)
def test_known_comparisons(plan, options, volume, boxes) -> None:
    stages: list[str] = []
    comparison = robust.compare(plan, **options, on_stage=stages.append)
    assert (comparison.plan, comparison.beta) == (plan, options.get("beta", 1))
    status = Status.INVALID if plan is APART else Status.COMPLETE
    assert (comparison.status, comparison.cut_short, comparison.interrupted) == (status, False, False)
    assert comparison.volume == VolumeBounds(*volume)
    entries = {
        one.method: [str(one.result.box), share(one.volume_share), share(one.width_share), *faces_of(comparison, one)]
        for one in comparison.entries
    }
    assert (list(entries), {**entries, **boxes}) == (list(METHODS), entries)
    assert stages == [*METHODS, "region", "faces and witnesses"]
    for result in (*(entry.result for entry in comparison.entries), comparison.region):
        settings = (options.get("encoding", "relational"), options.get("solver", "z3"))
        assert (result.encoding, result.solver) == settings
        assert 0 < result.seconds < comparison.seconds


def test_volumes_of_three_parameters_are_exact() -> None:
    """Of the cube of 4: a corner of 4³/6, and what is not below 7: 64 − (7³ − 3·3³)/6."""
    assert robust.compare(CUBE).volume == VolumeBounds(Fraction(31), Fraction(31))


def test_shares_of_what_is_not_known_exactly() -> None:
    """The region is at least as large as the box; an outer bound may be too large, which makes shares too small."""
    box = Box({"k": Interval(Fraction(0), Fraction(2)), "m": Interval(Fraction(1), Fraction(4))})
    point = Box.point({"k": Fraction(1)})
    flat = point.replace("m", Interval(None, None))
    for other, volumes, exact, expected in (
        (box, (4, 12), True, (Fraction(1, 2), 1)),
        (box, (8, 12), True, (Fraction(1, 2), Fraction(3, 4))),
        (box, (4, 12), False, (Fraction(1, 2), None)),
        (point, (0, 0), True, None),
        (flat, (0, 5), True, (0, None)),
    ):
        bounds = VolumeBounds(*map(Fraction, volumes))
        assert volume_share(other, bounds, exact=exact) == (expected and RatioBounds(*expected))
    assert width_share(box, Fraction(10), exact=True) == RatioBounds(Fraction(1, 2), Fraction(1, 2))
    assert width_share(box, Fraction(10), exact=False) == RatioBounds(Fraction(1, 2), None)
    assert width_share(box, Fraction(0), exact=True) is None


def test_the_region_may_use_half_of_the_time_and_others_equal_parts_of_what_is_left(monkeypatch) -> None:
    stages: list[str] = []
    given: list[float | None] = []
    monkeypatch.setattr("robust.searching.time.perf_counter", repeat(5.0).__next__)
    monkeypatch.setattr(Deadline, "after", staticmethod(lambda seconds: given.append(seconds) or Deadline()))
    assert robust.compare(APART, timeout=600, on_stage=stages.append).status is Status.INVALID
    assert stages == ["region", *METHODS, "faces and witnesses"]
    parts = [300.0, 120.0, 150.0, 200.0, 300.0, 600.0]
    assert [one for one in given if one in parts] == parts


@pytest.mark.parametrize("query", [False, True])
@pytest.mark.parametrize("stage", [*METHODS, "region", "faces and witnesses"])
def test_interrupted_at_any_stage(monkeypatch, stage: str, query: bool) -> None:
    """Before it begins, or by its first query."""

    ask_solvers(monkeypatch)

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    def interrupt(begun: str) -> None:
        if begun == stage:
            monkeypatch.setattr(Session, "check", stop) if query else stop()

    comparison = Comparing(timed(parameter("k", 2, 0, 9), pieces=(SPLIT,)), on_stage=interrupt).run()
    assert (comparison.status, comparison.interrupted, comparison.cut_short) == (Status.INTERRUPTED, True, True)
    finished = METHODS[: METHODS.index(stage)] if stage in METHODS else METHODS
    begun = [(stage, Status.INTERRUPTED, False)] if query and stage in METHODS else []
    entries = [(entry.method, entry.result.status, entry.result.verified) for entry in comparison.entries]
    assert entries == [*((method, Status.COMPLETE, True) for method in finished), *begun]
    assert not any(entry.faces for entry in comparison.entries)
    regions = {"region": RegionStatus.INTERRUPTED if query else None, "faces and witnesses": RegionStatus.COMPLETE}
    assert (None if comparison.region is None else comparison.region.status) is regions.get(stage)


@pytest.mark.parametrize("timed_out", [False, True])
def test_a_comparison_that_is_given_up_says_why(timed_out: bool) -> None:
    comparison = Comparing(OPEN, beta=Fraction(3)).so_far(timed_out=timed_out)
    assert replace(comparison, seconds=0.0) == Comparison(OPEN, Fraction(3), None, None, (), not timed_out, 0.0)
    assert (comparison.status, comparison.cut_short) == (Status.TIMEOUT if timed_out else Status.INTERRUPTED, True)
