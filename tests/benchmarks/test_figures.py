"""Figures 3, 4 and 5 and the studies of growth: every comparison by stand-ins, and plans that are known by hand."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from benchmarks.engine.measure import Ending
from benchmarks.generators.sizes import (
    envelope_sum,
    time_points,
    unordered_instance,
    write_instance,
    write_unordered,
)
from benchmarks.irr.contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN
from benchmarks.irr.figure3 import CONTENDERS, WidthComparison, compare_widths
from benchmarks.irr.figure4 import (
    CONTROLLABILITY,
    DeliveryInstance,
    Figure4Task,
    Origin,
    do,
    loss,
    own_instance,
    recorded_instances,
    unbounded,
)
from benchmarks.irr.figure5 import SCHEDULES
from benchmarks.irr.growth import ENCODINGS_BY_NAME, PARAMETERS, POINTS, WRITERS
from benchmarks.irr.scaling import SERIES, Series
from robust.api import check, envelope
from robust.errors import InputError
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.qe.box import Box, Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from tests.benchmarks.conftest import MakeSuite, Stand, checked, example, navigation, rendered, run

BOX = {"lower": "0", "upper": "2", "lower_closed": True, "upper_closed": True}
CONVERGENCE = [{"check": 1, "seconds": 0.1, "share": 0.0}, {"check": 60, "seconds": 0.2, "share": 1.0}]
STAND = f"""
BOX = {BOX!r}
ANSWER.update(parameters={{"a": BOX}}, convergence={CONVERGENCE!r})
REGION = {{"schema": "robust/region/1", "status": "complete", "seconds": 0.5, "parameters": ["a"], "form": "difference",
    "base": [{{"coefficients": {{"a": "1"}}, "relation": "<=", "constant": "3"}}], "minus": []}}
KIND = sys.argv[1]
OPTION = {{"envelope": "--method", "region": "--backend"}}.get(KIND)
NAME = sys.argv[sys.argv.index(OPTION) + 1] if OPTION else "recorded-box"
VERDICT = {{"schema": "robust/check/1", "verdict": "proved", "seconds": 0.1}}
"""
TYPE = "print(json.dumps({'envelope': ANSWER, 'region': REGION, 'check': VERDICT}[KIND]))\n"


def recorded(**fields: Any) -> dict[str, Any]:
    irr = {"status": "ok", "wall_s": 5.0, "first_widening_s": 0.4, "checks": 3}
    return navigation("toy_01_1", **{"irr": irr, "irr_box": {"a": ["0", "2"]}, "irr_order": ["a"], **fields})


# -- figure 3 ----------------------------------------------------------------------------------------------------------


def test_figure3_by_the_real_command(make_suite: MakeSuite) -> None:
    ccmmz = {"to_ridge": ["30", "50"], "to_crater": ["30", "35"]}
    contenders = (IRR, WIDEN, OPTIMAL, REGIONS[0], RECORDED_BOX)
    report = run("figure3", suite=make_suite(navigation(ccmmz_box=ccmmz)), limit=300, contenders=contenders)
    (row,) = report.rows
    names = [contender.name for contender in contenders[:4]]
    ended = {name: run.text for name, run in row.runs.items()}
    assert ended == {**dict.fromkeys(names, "complete"), "recorded-box": "proved"}
    assert set(row.checks.boxes.values()) == {True}
    assert row.checks.recorded_ccmmz_width == 25
    assert row.checks.optimal_width >= 25
    assert report.agrees
    assert checked(report)["totals"]["recorded_box_in_region"] == {"holds": 1, "of": 1}
    assert "navigation: solved within, of 1" in rendered(report.tables)


def test_domains_and_curves(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand(STAND + "time.sleep(60) if NAME == 'cvc5' else None\n" + TYPE)
    plot = tmp_path / "plot.png"
    ccmmz = {"status": "ok", "wall_s": 700.0}
    suite = make_suite(recorded(ccmmz=ccmmz), navigation("other", irr=None, irr_box=None, ccmmz=None))
    report = run("figure3", suite=suite, limit=60, own_limits={"cvc5": 0.5}, jobs=2, plot=plot)
    assert report.domains == ("toy", "other")
    assert report.agrees
    curves = {curve.name: curve for curve in report.curves("toy")}
    recordings = {"recorded-irr", "recorded-irr-first", "recorded-ccmmz"}
    assert set(curves) == {*(one.name for one in CONTENDERS if one is not RECORDED_BOX), "irr-first", *recordings}
    assert len(curves["irr"].times) == len(curves["irr-first"].times) == 1
    assert curves["irr-first"].times < curves["irr"].times
    assert curves["cvc5"].times == ()
    assert curves["recorded-ccmmz"].times == (700.0,)
    assert [curves["recorded-ccmmz"].solved_within(limit) for limit in (600, 700)] == [0, 1]
    others = {curve.name: len(curve.times) for curve in report.curves("other") if curve.recorded}
    assert others == dict.fromkeys(recordings, 0)
    value = checked(report)
    assert value["rows"][0]["runs"]["cvc5"]["status"] == "timeout"
    assert "cvc5 0.5 s" in value["notes"][0]
    assert plot.stat().st_size > 0


def test_the_order_of_turns_goes_to_irr_only(make_suite: MakeSuite, stand: Stand) -> None:
    stand(STAND + "assert ('--order=a' in sys.argv) == (NAME == 'irr'), sys.argv\n" + TYPE)
    assert run("figure3", suite=make_suite(recorded())).agrees


@pytest.mark.parametrize(("verdict", "proved"), [("proved", True), ("refuted", False), ("unknown", None)])
def test_recorded_boxes_are_checked_without_the_region(
    make_suite: MakeSuite, stand: Stand, verdict: str, proved: bool | None
) -> None:
    stand(STAND + f"assert sys.argv[5] == '--at=a=1/3:inf', sys.argv\nVERDICT['verdict'] = {verdict!r}\n" + TYPE)
    suite = make_suite(recorded(irr_box={"a": ["1/3", "inf"]}), navigation("no_box", irr_box=None))
    report = run("figure3", suite=suite, contenders=(RECORDED_BOX,))
    assert report.rows[0].checks.recorded_box_proved is proved
    assert len(report.rows) == 1  # there is nothing to check about the other
    assert report.agrees == (proved is not False)
    checked(report)


@pytest.mark.parametrize(
    ("change", "fields", "key"),
    [
        ("", {"irr_box": {"a": ["0", "4"]}}, "recorded_box_in_region"),
        ("", {"irr_box": {"b": ["0", "1"]}}, "recorded_box_in_region"),
        ("BOX['upper'] = '4' if NAME == 'irr' else '2'\n", {}, "irr_in_region"),
        ("BOX['upper'] = 'inf' if NAME == 'widen' else '2'\n", {}, "widening_in_region"),
        ("BOX['upper'] = '7/2' if NAME == 'optimal' else '2'\n", {}, "optimal_in_region"),
    ],
)
def test_boxes_outside_the_region_are_noticed(
    make_suite: MakeSuite, stand: Stand, change: str, fields: dict[str, Any], key: str
) -> None:
    stand(STAND + change + TYPE)
    report = run("figure3", suite=make_suite(recorded(**fields)), contenders=(IRR, WIDEN, OPTIMAL, REGIONS[0]))
    assert not report.agrees
    checks = checked(report)["rows"][0]["checks"]
    assert [name for name in checks if checks[name] is False] == [key]
    assert "NO" in rendered(report.tables)


@pytest.mark.parametrize(
    ("upper", "kind"), [("2", "equal"), ("3/2", "recorded not optimal"), ("5/2", "recorded wider")]
)
def test_a_wider_recorded_box_contradicts_the_optimum(
    make_suite: MakeSuite, stand: Stand, upper: str, kind: str
) -> None:
    stand(STAND + TYPE)
    report = run("figure3", suite=make_suite(recorded(ccmmz_box={"a": ["0", upper]})), contenders=(OPTIMAL,))
    assert checked(report)["rows"][0]["checks"]["widths"] == kind
    assert report.agrees == (kind != "recorded wider")


def test_infinite_widths_are_the_greatest() -> None:
    finite, infinite = Box({"a": Interval(Fraction(0), Fraction(1))}), Box({"a": Interval(Fraction(0), None)})
    assert compare_widths(infinite, infinite) is WidthComparison.EQUAL
    assert compare_widths(infinite, finite) is WidthComparison.NOT_OPTIMAL
    assert compare_widths(finite, infinite) is WidthComparison.WIDER


FAIL = "print(json.dumps({'schema': 'robust/error/1', 'error': {'message': 'not this one'}}))\nsys.exit(CODE)\n"


@pytest.mark.parametrize(
    ("script", "contender", "status", "message"),
    [
        (FAIL.replace("CODE", "4"), REGIONS[0], Ending.UNSUPPORTED, "not this one"),
        (FAIL.replace("CODE", "2"), REGIONS[0], Ending.ERROR, "not this one"),
        ("sys.exit('broken')", RECORDED_BOX, Ending.ERROR, "broken"),
        *(
            (f"print({answer!r})", REGIONS[0], Ending.ERROR, "not that of `robust region --json`")
            for answer in ("[]", "nonsense", '{"status": "complete"}', '{"status": "finished"}')
        ),
    ],
)
def test_unsupported_is_told_from_errors(
    make_suite: MakeSuite, stand: Stand, script: str, contender: Any, status: Ending, message: str
) -> None:
    stand(script)
    report = run("figure3", suite=make_suite(recorded()), contenders=(contender,))
    found = report.rows[0].runs[contender.name]
    assert found.status is status
    assert message in found.message
    assert report.agrees == (status is Ending.UNSUPPORTED)
    checked(report)


# -- figure 5 ----------------------------------------------------------------------------------------------------------


def test_figure5_by_the_real_command(make_suite: MakeSuite) -> None:
    report = run("figure5", suite=make_suite(navigation()), limit=300)
    doubling, default = report.rows
    assert doubling.run.text == default.run.text == "complete"
    # By hand: 5 of 15 minutes are gained for to_ridge first, then 10 for to_crater.
    shares = [share for _, share in doubling.run.convergence]
    assert doubling.steps == 26
    assert sorted(set(shares)) == pytest.approx([0, 0.6, 1], abs=1e-5)
    assert doubling.share_at(1) == 0
    assert doubling.share_at(26) == doubling.share_at(1000) == 1
    assert [report.claim_holds(schedule) for schedule in SCHEDULES] == [True, True]
    value = checked(report)
    assert [one["running"] for one in value["schedules"][0]["steps"]] == [1, 1, 1, 1, 0, 0, 0]
    assert "in all cases holds for 1 runs" in value["notes"][0]


def test_poorest_best_and_the_claim(make_suite: MakeSuite, stand: Stand) -> None:
    other = make_suite() / "plan-b.stn"
    other.write_text("", encoding="utf-8")
    suite = make_suite(navigation("x_1"), navigation("x_2", plan=str(other)))
    change = "ANSWER['convergence'][0]['share'] = 0.75 if 'plan-b.stn' in sys.argv[4] else 0.25\n"
    stand(STAND + change + TYPE)
    report = run("figure5", suite=suite, schedules=SCHEDULES[:1])
    (fifty,) = report.summary(SCHEDULES[0], [50])
    assert (fifty.poorest, fifty.best, fifty.running) == (0.25, 0.75, 2)
    assert report.claim_holds(SCHEDULES[0]) is False
    assert "does not hold for 2 runs; the poorest is x_1 with 25.0%" in report.notes[0]
    assert report.agrees  # the paper's observation is reported, not required
    checked(report)


@pytest.mark.parametrize(
    ("script", "reason", "agrees"),
    [(STAND + "ANSWER['convergence'] = []\n" + TYPE, "zero or infinite width", True), ("sys.exit(1)", "error", False)],
)
def test_runs_without_convergence_are_left_out(
    make_suite: MakeSuite, stand: Stand, tmp_path: Path, script: str, reason: str, agrees: bool
) -> None:
    stand(script)
    report = run("figure5", suite=make_suite(navigation()), plot=tmp_path / "plot.svg")
    assert report.claim_holds(SCHEDULES[0]) is None
    assert report.summary(SCHEDULES[0]) == []
    assert any(f"left out: navigation ({reason})" in note for note in report.notes)
    assert report.agrees == agrees
    checked(report)


# -- scaling and growth ------------------------------------------------------------------------------------------------


def expected_region(parameters: int) -> Region:
    """The envelope that the generator of unordered jobs promises."""
    names = tuple(f"d{i}" for i in range(1, parameters + 1))

    def at_most(coefficients: dict[str, str], constant: int) -> LinearConstraint:
        return LinearConstraint.from_dict(
            {"coefficients": coefficients, "relation": "<=", "constant": str(constant)},
        )

    sides = [at_most({name: "-1"}, 0) for name in names]
    total = at_most(dict.fromkeys(names, "1"), envelope_sum(parameters))
    return Region(names, (Polyhedron(names, (*sides, total)),))


def test_backends_find_the_known_envelope() -> None:
    series = (replace(PARAMETERS, sizes=(1, 2)),)
    report = run("backends", limit=300, series=series, contenders=REGIONS[:2])
    assert [(row.contender, row.size) for row in report.rows] == [("project", 1), ("z3", 1), ("project", 2), ("z3", 2)]
    for row in report.rows:
        assert row.done, row.run and row.run.text
        assert Region.from_dict(row.run.region).equals(expected_region(row.size))
    assert all(row["polyhedra"] >= 1 for row in checked(report)["rows"])
    assert "fourier" not in rendered(report.tables)


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_too_late_is_not_tried_any_larger(stand: Stand, tmp_path: Path, jobs: int) -> None:
    stand("'positions' in sys.argv and time.sleep(60)\nprint(json.dumps(ANSWER))")
    ladders = (replace(POINTS, name="first", sizes=(2, 4, 6)), replace(POINTS, name="second", sizes=(2,)))
    report = run("encodings", limit=4, series=ladders, plot=tmp_path / "plot.svg", jobs=jobs)
    found = {(row.series, row.contender, row.size): row.run and row.run.status for row in report.rows}
    assert found["first", "positions", 2] is found["second", "positions", 2] is Ending.TIMEOUT
    assert found["first", "relational", 6] is Ending.COMPLETE
    assert report.agrees  # too late is not wrong
    statuses = [row["status"] for row in checked(report)["rows"][:6]]
    if jobs == 1:
        assert statuses == ["complete", "timeout", "complete", "not run", "complete", "not run"]
    text = " ".join(rendered(report.tables).split())
    assert "out of time" in text
    assert "stopped at 4 s" in text


def test_failures_are_reported(stand: Stand) -> None:
    stand("sys.exit('no such thing')")
    report = run("backends", series=(replace(POINTS, sizes=(2,)),), contenders=REGIONS[:1])
    assert not report.agrees
    assert "project: error: no such thing" in report.notes
    checked(report)
    report = run("scaling", series=(Series("refuels", "One", ((1, 1),)),))
    assert report.rows[0].ours.text == "error: no such thing"
    assert not report.agrees
    checked(report)
    stand("time.sleep(60)")
    report = run("scaling", series=(Series("refuels", "One", ((1, 1),)),), limit=0.5)
    assert report.rows[0].ours.status is Ending.TIMEOUT
    assert report.agrees  # too late is not wrong


def test_all_sizes_can_be_generated_and_read(tmp_path: Path) -> None:
    for refuels, parameters in (point for series in SERIES for point in series.points):
        plan = load_plan(*write_instance(tmp_path, refuels, parameters))
        assert (len(plan.parameters), len(plan.instances)) == (parameters, refuels + 1)
    for size in POINTS.sizes:
        plan = load_plan(*WRITERS["points"](tmp_path / "points", size))
        assert time_points(len(plan.instances) - 1) == size
    for jobs, parameters in ((0, 1), (2, 0), (2, 3)):
        with pytest.raises(ValueError, match="expected"):
            unordered_instance(jobs, parameters)
    assert [contender.name for contender in ENCODINGS_BY_NAME] == ["relational", "positions"]


@pytest.mark.parametrize(("jobs", "parameters"), [(1, 1), (3, 2)])
def test_the_generated_envelope_by_widening(jobs: int, parameters: int, tmp_path: Path) -> None:
    result = envelope(load_plan(*write_unordered(tmp_path, jobs, parameters)), method="widen")
    assert result.status.value == "complete"
    uppers = [interval.upper for interval in result.box.intervals.values()]
    assert sum((upper for upper in uppers if upper is not None), Fraction(0)) == envelope_sum(parameters)
    assert {interval.lower for interval in result.box.intervals.values()} == {0}
    assert expected_region(parameters).contains_box(result.box)


# -- figure 4 ----------------------------------------------------------------------------------------------------------


def delivery(**fields: Any) -> list[Any]:
    """The shipped example in place of a delivery plan."""
    return [{"instance": "navigation", "parameters": 2, **example(), **fields}]


@pytest.mark.parametrize("parameters", [1, 4, 7])
def test_own_instances_have_their_parameters_and_are_valid(parameters: int, tmp_path: Path) -> None:
    instance = own_instance(parameters, 1)
    assert instance == own_instance(parameters, 1) != own_instance(parameters, 2)
    options = [one.removeprefix("--parameter=") for one in instance.options]
    plan = load_plan(*instance.write(tmp_path), parameters=options)
    assert len(plan.parameters) == parameters == instance.parameters
    assert check(plan).answer is Answer.PROVED


def test_recorded_instances(make_suite: MakeSuite, tmp_path: Path) -> None:
    [instance] = recorded_instances(make_suite(delivery=delivery()))
    assert (instance.name, instance.origin, instance.parameters) == ("navigation", Origin.RECORDED, 2)
    assert instance.texts[2] == Path(example()["plan"]).read_text(encoding="utf-8")
    for wrong in (delivery(parameters="2"), delivery(plan=""), [3], delivery(instance=None)):
        with pytest.raises(InputError, match="entry 1: expected an object"):
            recorded_instances(make_suite(delivery=wrong))
    with pytest.raises(InputError, match="at least one instance"):
        recorded_instances(make_suite(delivery=[]))
    with pytest.raises(InputError, match="nowhere"):
        recorded_instances(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"missing\.stn"):
        recorded_instances(make_suite(delivery=delivery(plan="missing.stn")))


def test_the_recorded_plans_are_read(dataset: Path) -> None:
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    assert {one.parameters for one in instances} >= {4, 23}


def test_the_known_box_and_its_controllability(make_suite: MakeSuite) -> None:
    suite = make_suite(delivery=delivery())
    report = run("figure4", suite=suite, sizes=(), limit=300, baseline_limit=300, contenders=(IRR, WIDEN, REGIONS[0]))
    assert report.agrees
    [row] = report.rows
    # The box that is known by hand, see conftest.navigation.
    assert row.runs["irr"].box == {"to_ridge": ("30", "45"), "to_crater": ("30", "40")}
    assert row.runs["widen"].unbounded == ()
    assert row.runs["project"].polyhedra >= 1
    assert (row.controllability.dynamic, row.controllability.kept) == ("controllable", 1)
    assert checked(report)["solved"][0]["methods"]["widen"] == 1
    assert "100.0 %" in rendered(report.tables)


def test_runs_that_are_late_or_fail(make_suite: MakeSuite, stand: Stand) -> None:
    given: dict[str, Any] = {"suite": make_suite(delivery=delivery()), "sizes": ()}
    stand("time.sleep(30)")
    late = run("figure4", **given, limit=0.3, contenders=(WIDEN,))
    assert late.rows[0].runs["widen"].status is Ending.TIMEOUT
    assert not late.agrees
    assert late.rows[0].seconds("widen") is None
    checked(late)
    stand("sys.exit('broken')")
    failed = run("figure4", **given, contenders=(OPTIMAL,))
    assert not failed.agrees
    assert "navigation, optimal: error: broken" in failed.notes
    rendered(failed.tables)
    # The others may be late: the paper's were.
    stand("time.sleep(30) if '--method' not in sys.argv else print(json.dumps(ANSWER))")
    mixed = run("figure4", **given, limit=60, baseline_limit=0.3, contenders=(WIDEN, REGIONS[0]))
    assert mixed.agrees
    assert mixed.rows[0].runs["widen"].unbounded == ("above a",)
    checked(mixed)


def test_a_plan_that_cannot_be_read_is_a_failure(make_suite: MakeSuite, tmp_path: Path) -> None:
    broken = tmp_path / "broken.stn"
    broken.write_text("nonsense", encoding="utf-8")
    report = run("figure4", suite=make_suite(delivery=delivery(plan=str(broken))), sizes=(), contenders=())
    assert not report.agrees
    assert report.failures[0].reason.startswith("InputError")
    assert checked(report)["rows"] == []


TWO = """(define (domain two) (:requirements :durative-actions :duration-inequalities :timed-initial-literals)
  (:predicates (done-a) (done-b) (window))
  (:durative-action a :parameters () :duration {} :condition (and) :effect (at end (done-a)))
  (:durative-action b :parameters () :duration {} :condition {} :effect (at end (done-b))))"""
BOTH = "(define (problem p) (:domain two) (:init {}) (:goal (and (done-a) (done-b))))"
PLAN = """durative-action instance a : (a);
durative-action instance b : (b);
c: a.end - a.start in [x, x];
c: b.end - b.start in [y, y];
"""


def test_a_box_that_is_not_dynamically_controllable() -> None:
    """Start b so that it ends 0 to 4 after a.

    b must start at x + s − y for some s in [0, 4], and as x + s − y ≥ 0 is known only later, some values of x and y
    have a start of b before a has ended that fits none of the others.
    """
    plan = "parameter x default 10 lb 5 ub 15;\nparameter y default 10 lb 5 ub 15;\n" + PLAN
    plan += "c: a.start - .zero in [0, 0];\nc: b.end - a.end in [0, 4];\n"
    texts = (TWO.format("(>= ?duration 0)", "(>= ?duration 0)", "(and)"), BOTH.format(""), plan)
    instance = DeliveryInstance("two", Origin.OWN, 2, texts)
    found = do(Figure4Task(instance, CONTROLLABILITY, 60)).assessment
    assert found is not None
    assert (found.status, found.dynamic, found.strong) == ("complete", "not controllable", "not controllable")
    assert found.kept is not None
    assert 0 < found.kept < 1
    assert found.reason


def test_faces_that_only_the_domain_bounds() -> None:
    """x may be as long as the domain says, y only as long as the window is open."""
    plan = "parameter x default 10 lb 5;\nparameter y default 10 lb 5;\n" + PLAN + "c: b.start - .zero in [0, 0];\n"
    domain = TWO.format("(<= ?duration 100)", "(<= ?duration 100)", "(over all (window))")
    texts = (domain, BOTH.format("(window) (at 50 (not (window)))"), plan)
    found = do(Figure4Task(DeliveryInstance("two", Origin.OWN, 2, texts), "widen", 60)).run
    assert found is not None
    assert found.box == {"x": ("5", "100"), "y": ("5", "50")}
    assert (found.unbounded, found.capped) == ((), ("above x",))


def test_losses() -> None:
    def box(**uppers: int | None) -> Box:
        lowers = {"a": uppers.pop("lower") or 0, "d": 1}
        ends = {name: None if upper is None else Fraction(upper) for name, upper in uppers.items()}
        return Box({name: Interval(Fraction(lowers.get(name, 0)), upper) for name, upper in ends.items()})

    whole = box(lower=0, a=10, b=None, c=None, d=1, e=4)
    assert loss(whole, box(lower=5, a=10, b=7, c=1000000, d=1, e=4), {"c"}) == {"kept": 0.75, "bounded": 1, "cut": 1}
    assert unbounded(whole) == ("above b", "above c")
    assert unbounded(Box({"a": Interval(None, Fraction(1))})) == ("below a",)
