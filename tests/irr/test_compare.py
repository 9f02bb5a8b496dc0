"""Comparisons of known plans as a whole and after Ctrl-C; recorded instances, face by face and beyond their boxes."""

import json
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product, repeat
from pathlib import Path

import pytest

import robust
from robust.encode.encoding import RelationalEncoding
from robust.irr.compare import METHODS, Comparing, Comparison, RatioBounds, volume_share, width_share
from robust.irr.containment import Containment
from robust.plan.model import Or, ParametrizedPlan
from robust.qe.box import Box, Interval, Side
from robust.qe.compute import RegionStatus
from robust.qe.estimate import VolumeBounds
from robust.searching import Status
from robust.smt.limits import Deadline
from robust.smt.session import Session
from tests.irr.building import ask_solvers, lasts, parameter, shipped, timed
from tests.plan.building import DURATION, END, START, F, above, at_least, at_most, increase, number, value

BETA = Fraction(1)


STEP = Fraction(2)
"""The doubling schedule with β = 1 leaves less than this between a face and the envelope."""


def planned(dataset: Path, instance: dict) -> ParametrizedPlan:
    return robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))


def faces_of(comparison: Comparison, entry) -> Iterator[list[str]]:
    """The gap of each face and what breaks just beyond it, at a point outside the box and the region."""
    for face in entry.faces:
        name, side = face.parameter, face.side
        interval = entry.result.box[name]
        assert (face.end, face.closed) == (interval.end(side), interval.is_closed_at(side))
        farther = face.end + side.sign * (face.gap + Fraction(1, 1000))
        assert face.witness.values in entry.result.box.moved((name, side), farther)
        assert face.witness.values not in entry.result.box
        assert face.witness.values not in comparison.region.region
        yield [str(face.gap), face.witness.obligation.partition(" cannot hold")[0]]


def assert_explained(comparison: Comparison) -> int:
    """Each face has a gap of 0, or below β for IRR, and a point just beyond it that breaks a named obligation."""
    assert comparison.status is Status.COMPLETE
    faces = [(entry.method, *face) for entry in comparison.entries for face in faces_of(comparison, entry)]
    for method, gap, obligation in faces:
        assert Fraction(gap) < BETA if method == "irr" else gap == "0"
        assert obligation
    return len(faces)


def finite_faces(comparison: Comparison) -> int:
    ranges = [ends for entry in comparison.entries for ends in entry.result.box.ranges.values()]
    return sum(end is not None for ends in ranges for end in ends)


def instances(dataset: Path) -> list[dict]:
    return json.loads((dataset / "recorded-results.json").read_text())


@pytest.mark.parametrize(
    ("names", "least"),
    [
        *(([name], 0) for name in ("auv_mission_10_0_2", "generator_linear_05_2", "solar_rover_02_3")),
        pytest.param([], 700, marks=pytest.mark.slow),
    ],
)
def test_faces_of_recorded_instances_are_explained(dataset: Path, names: list[str], least: int) -> None:
    total = 0
    for instance in instances(dataset):
        if not names or instance["instance"] in names:
            comparison = robust.compare(planned(dataset, instance), beta=BETA)
            faces = assert_explained(comparison)
            assert faces == finite_faces(comparison), instance["instance"]
            total += faces
    assert total > least


@pytest.mark.parametrize("every", [8, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans_are_proved_and_points_outside_their_boxes_refuted(dataset: Path, every: int) -> None:
    shown = 0
    recorded = instances(dataset)[::every]
    for instance in recorded:
        plan = planned(dataset, instance)
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]
        box = Box({name: Interval(Fraction(low), Fraction(high)) for name, (low, high) in instance["irr_box"].items()})
        containment = Containment(RelationalEncoding(plan))
        for name, side in product(box.intervals, Side):
            wider = box.moved((name, side), box[name].end(side) + side.sign * STEP)
            outside = containment.refute(wider, Deadline())
            assert outside is not None, (instance["instance"], name, side)
            assert outside.values in wider
            assert outside.values not in box
            result = robust.check(plan, at=outside.values)
            assert result.answer is robust.Answer.REFUTED, (instance["instance"], outside)
            # Each counterexample has been executed by the simulator; without one there is no schedule at all.
            assert result.counterexamples or "no schedule" in (result.reason or "")
            shown += len(result.counterexamples)
    assert shown > len(recorded)


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_delivery_plans_are_proved(dataset: Path, every: int) -> None:
    delivery = json.loads((dataset / "robot-delivery" / "instances.json").read_text())
    assert len(delivery) == 27
    for instance in delivery[::every]:
        plan = planned(dataset, instance)
        assert len(plan.parameters) == instance["parameters"]
        assert robust.check(plan).answer is robust.Answer.PROVED, instance["instance"]


# -- known comparisons -------------------------------------------------------------------------------------------------

NAVIGATION = shipped("two_sample_navigation")
OPEN = timed(parameter("k", 4), parameter("m", 1, 0, 6), pieces=((END, above(number(8), DURATION)),))
SPLIT = (END, Or((at_most(DURATION, 4), at_least(DURATION, 7))))
APART = timed(parameter("k", 5, 0, 9), pieces=(SPLIT,))
CUBE = timed(*(parameter(name, 1, 0, 4) for name in "abc"), pieces=(SPLIT,))
SEPARATED = timed(parameter("k", 2), pieces=(increase(F, 1, START), (END, at_least(value(F), 1))))
SETTINGS = {"beta": Fraction(2), "epsilon": Fraction(1, 4), "solver": "cvc5"}
LATE, EARLY = "i act: at end c0", ["0", "i act: non-negative duration"]
LOW_K, LOW_M = (["0", f"no schedule with {name} = -1/1000: parameter {name} lb 0"] for name in "km")
NIGHT = ["0", "drive_3 drive: over all (daylight)"]
CHARGE = ["0", "drive_3 drive: over all (>= (charge scout) (reserve scout))"]
RIDGE, CRATER = (["0", f"sample_{i} take-sample: over all (lit {at})"] for i, at in ((1, "ridge"), (2, "crater")))
WIDEST = ["to_ridge ∈ [20, 45], to_crater ∈ [40, 40]", "0", "25/74", NIGHT, RIDGE, NIGHT, CRATER]


def told(comparison: Comparison) -> dict[str, list]:
    """For each method the box, the shares, and the faces."""

    def share(of: RatioBounds | None) -> str | None:
        return of and (str(of.lower) if of.is_exact else f"{of.lower} to {of.upper}")

    return {
        entry.method: [
            str(entry.result.box),
            share(entry.volume_share),
            share(entry.width_share),
            *faces_of(comparison, entry),
        ]
        for entry in comparison.entries
    }


@pytest.mark.parametrize(
    ("plan", "options", "status", "volume", "boxes"),
    [
        pytest.param(
            NAVIGATION,
            {},
            Status.COMPLETE,
            (629, 629),
            {
                "irr": ["to_ridge ∈ [30, 45], to_crater ∈ [30, 40]", "150/629", "25/74", *[NIGHT, CRATER] * 2],
                "widen": ["to_ridge ∈ [25, 36], to_crater ∈ [35, 46]", "121/629", "11/37", *[CHARGE, CRATER] * 2],
                "optimal": WIDEST,
                "optimal-nominal": WIDEST,
            },
            id="closed",
        ),
        pytest.param(
            OPEN,
            {},
            Status.COMPLETE,
            (48, 48),
            {
                "irr": ["k ∈ [0, 4], m ∈ [0, 7/2]", "7/24", "3/8", ["1/2", LATE], EARLY, ["1/2", LATE], LOW_M],
                "widen": ["k ∈ [0, 11/2], m ∈ [0, 5/2)", "55/192", "2/5", ["0", LATE], EARLY, ["0", LATE], LOW_M],
            },
            id="open",
        ),
        pytest.param(
            APART,
            {},
            Status.INVALID,
            (6, 6),
            {
                "irr": ["k ∈ (5, 5)", None, None],
                "widen": ["k ∈ (5, 5)", None, None],
                "optimal": ["k ∈ [0, 4]", "2/3", "4/9", ["0", LATE], LOW_K],
                "optimal-nominal": ["k ∈ (5, 5)", None, None],
            },
            id="apart",
        ),
        *(
            pytest.param(
                SEPARATED,
                {**SETTINGS, "encoding": encoding},
                Status.COMPLETE,
                (0, None),
                {
                    "irr": ["k ∈ [1, inf)", None, None, ["3/4", "separation: i.start, i.end"]],
                    **{key: ["k ∈ [1/4, inf)", None, None, ["0", "separation: i.start, i.end"]] for key in METHODS[1:]},
                },
                id=f"unbounded, {encoding}",
            )
            for encoding in ("relational", "positions")
        ),
        pytest.param(
            timed(length=number(4), pieces=lasts(3, 5)),
            {},
            Status.COMPLETE,
            (1, 1),
            {key: ["(no parameters)", None, None] for key in METHODS},
            id="nothing",
        ),
    ],
)
def test_known_comparisons(plan, options, status, volume, boxes) -> None:
    stages: list[str] = []
    comparison = robust.compare(plan, **options, on_stage=stages.append)
    assert (comparison.plan, comparison.beta) == (plan, options.get("beta", 1))
    assert (comparison.status, comparison.cut_short, comparison.interrupted) == (status, False, False)
    assert comparison.volume == VolumeBounds(*volume)
    found = told(comparison)
    assert list(found) == list(METHODS)
    assert {**found, **boxes} == found
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
    bounds = VolumeBounds(Fraction(4), Fraction(12))
    assert volume_share(box, bounds, exact=True) == RatioBounds(Fraction(1, 2), Fraction(1))
    assert volume_share(box, VolumeBounds(Fraction(8), Fraction(12)), exact=True) == RatioBounds(
        Fraction(1, 2), Fraction(3, 4)
    )
    assert volume_share(box, bounds, exact=False) == RatioBounds(Fraction(1, 2), None)
    assert volume_share(Box.point({"k": Fraction(1)}), VolumeBounds(Fraction(0), Fraction(0)), exact=True) is None
    flat = Box.point({"k": Fraction(1)}).replace("m", Interval(None, None))
    assert volume_share(flat, VolumeBounds(Fraction(0), Fraction(5)), exact=True) == RatioBounds(Fraction(0), None)
    assert width_share(box, Fraction(10), exact=True) == RatioBounds(Fraction(1, 2), Fraction(1, 2))
    assert width_share(box, Fraction(10), exact=False) == RatioBounds(Fraction(1, 2), None)
    assert width_share(box, Fraction(0), exact=True) is None


# -- time and interruptions --------------------------------------------------------------------------------------------


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
