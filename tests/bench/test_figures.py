"""`bench figure3` and `bench figure5`: answers by the real command, and every comparison by stand-ins."""

from __future__ import annotations

import json
from fractions import Fraction
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from robust.bench.contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN
from robust.bench.figure3 import CONTENDERS, Figure3Report, WidthComparison, compare_widths, run_figure3
from robust.bench.figure5 import SCHEDULES, Figure5Report, run_figure5
from robust.bench.run import Outcome
from robust.errors import InputError
from robust.irr.box import Box, Interval
from tests.bench.conftest import MakeSuite, Stand, navigation, rendered

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


def schema(name: str) -> Any:
    return json.loads(files("robust.bench").joinpath(f"schemas/{name}.schema.json").read_text(encoding="utf-8"))


def checked(report: Figure3Report | Figure5Report, name: str) -> dict[str, Any]:
    """The report as JSON that has passed through text and the schema."""
    value: dict[str, Any] = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, schema(name))
    return value


def recorded(**fields: Any) -> dict[str, Any]:
    irr = {"status": "ok", "wall_s": 5.0, "first_widening_s": 0.4, "checks": 3}
    return navigation("toy_01_1", irr=irr, irr_box={"a": ["0", "2"]}, irr_order=["a"], **fields)


# -- figure 3 ----------------------------------------------------------------------------------------------------------


def test_figure3_by_the_real_command(make_suite: MakeSuite, tmp_path: Path) -> None:
    lines: list[str] = []
    plot = tmp_path / "plot.svg"
    contenders = (IRR, WIDEN, OPTIMAL, REGIONS[0], RECORDED_BOX)
    report = run_figure3(
        make_suite(navigation(ccmmz_box={"to_ridge": ["30", "50"], "to_crater": ["30", "35"]})),
        limit=120,
        plot=plot,
        contenders=contenders,
        on_result=lambda _done, _total, text: lines.append(text),
    )
    (row,) = report.rows
    assert {name: run.text for name, run in row.runs.items()} == {
        **dict.fromkeys([contender.name for contender in contenders[:4]], "complete"),
        "recorded-box": "proved",
    }
    checks = row.checks
    assert (checks.recorded_inside, checks.irr_inside, checks.widening_inside, checks.optimal_inside) == (True,) * 4
    assert checks.recorded_proved is True
    assert checks.recorded_width == 25
    assert checks.optimal_width is not None
    assert checks.optimal_width >= 25
    assert report.agrees
    assert len(lines) == 5
    assert plot.stat().st_size > 0
    value = checked(report, "bench-figure3")
    assert value["totals"]["recorded_box_in_region"] == {"holds": 1, "of": 1}
    text = rendered(report.tables())
    assert "navigation: solved within, of 1" in text
    assert "CCMMZ (recorded)" in text


def test_domains_and_curves(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand(STAND + "time.sleep(60) if NAME == 'cvc5' else None\n" + TYPE)
    plot = tmp_path / "plot.png"
    ccmmz = {"status": "ok", "wall_s": 700.0}
    suite = make_suite(recorded(ccmmz=ccmmz), navigation("other", irr=None, irr_box=None, ccmmz=None))
    report = run_figure3(suite, limit=60, own_limits={"cvc5": 0.5}, jobs=2, plot=plot)
    assert report.domains == ("toy", "other")
    assert report.agrees
    curves = {curve.name: curve for curve in report.curves("toy")}
    assert set(curves) == {
        *(contender.name for contender in CONTENDERS if contender is not RECORDED_BOX),
        "irr-first",
        "recorded-irr",
        "recorded-irr-first",
        "recorded-ccmmz",
    }
    assert len(curves["irr"].times) == len(curves["irr-first"].times) == 1
    assert curves["irr-first"].times < curves["irr"].times
    assert curves["cvc5"].times == ()
    assert curves["recorded-ccmmz"].times == (700.0,)
    assert [curves["recorded-ccmmz"].solved_within(limit) for limit in (600, 700)] == [0, 1]
    assert {curve.name: len(curve.times) for curve in report.curves("other") if curve.recorded} == {
        "recorded-irr": 0,
        "recorded-irr-first": 0,
        "recorded-ccmmz": 0,
    }
    value = checked(report, "bench-figure3")
    assert value["rows"][0]["runs"]["cvc5"]["status"] == "timeout"
    assert "cvc5 0.5 s" in value["notes"][0]
    assert plot.stat().st_size > 0


def test_the_order_of_turns_goes_to_irr_only(make_suite: MakeSuite, stand: Stand) -> None:
    stand(STAND + "assert ('--order=a' in sys.argv) == (NAME == 'irr'), sys.argv\n" + TYPE)
    assert run_figure3(make_suite(recorded())).agrees


@pytest.mark.parametrize(("verdict", "proved"), [("proved", True), ("refuted", False), ("unknown", None)])
def test_recorded_boxes_are_checked_without_the_region(
    make_suite: MakeSuite, stand: Stand, verdict: str, proved: bool | None
) -> None:
    stand(STAND + f"assert sys.argv[5] == '--at=a=1/3:inf', sys.argv\nVERDICT['verdict'] = {verdict!r}\n" + TYPE)
    suite = make_suite({**recorded(), "irr_box": {"a": ["1/3", "inf"]}}, navigation("no_box", irr_box=None))
    report = run_figure3(suite, contenders=(RECORDED_BOX,))
    assert report.rows[0].checks.recorded_proved is proved
    assert len(report.rows) == 1  # there is nothing to check about the other
    assert report.agrees == (proved is not False)
    checked(report, "bench-figure3")


def test_checks_that_fail_are_errors(make_suite: MakeSuite, stand: Stand) -> None:
    stand("sys.exit('broken')")
    report = run_figure3(make_suite(recorded()), contenders=(RECORDED_BOX,))
    assert report.rows[0].runs["recorded-box"].text == "error: broken"
    assert not report.agrees


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
    report = run_figure3(make_suite({**recorded(), **fields}), contenders=(IRR, WIDEN, OPTIMAL, REGIONS[0]))
    value = checked(report, "bench-figure3")
    assert not report.agrees
    checks = value["rows"][0]["checks"]
    assert [name for name in checks if checks[name] is False] == [key]
    assert "NO" in rendered(report.tables())


def test_a_wider_recorded_box_contradicts_the_optimum(make_suite: MakeSuite, stand: Stand) -> None:
    stand(STAND + TYPE)
    for upper, kind in (("2", "equal"), ("3/2", "recorded not optimal"), ("5/2", "recorded wider")):
        report = run_figure3(make_suite(recorded(ccmmz_box={"a": ["0", upper]})), contenders=(OPTIMAL,))
        assert checked(report, "bench-figure3")["rows"][0]["checks"]["widths"] == kind
        assert report.agrees == (kind != "recorded wider")


def test_infinite_widths_are_the_greatest() -> None:
    finite, infinite = Box({"a": Interval(Fraction(0), Fraction(1))}), Box({"a": Interval(Fraction(0), None)})
    assert compare_widths(infinite, infinite) is WidthComparison.EQUAL
    assert compare_widths(infinite, finite) is WidthComparison.NOT_OPTIMAL
    assert compare_widths(finite, infinite) is WidthComparison.WIDER


def test_unsupported_is_told_from_errors(make_suite: MakeSuite, stand: Stand) -> None:
    fail = "print(json.dumps({'schema': 'robust/error/1', 'error': {'message': 'not this one'}}))\nsys.exit(CODE)\n"
    for code, outcome in ((4, Outcome.UNSUPPORTED), (2, Outcome.ERROR)):
        stand(STAND + fail.replace("CODE", str(code)))
        report = run_figure3(make_suite(recorded()), contenders=REGIONS[:1])
        run = report.rows[0].runs["project"]
        assert (run.outcome, run.message) == (outcome, "not this one")
        assert report.agrees == (outcome is Outcome.UNSUPPORTED)
        checked(report, "bench-figure3")


@pytest.mark.parametrize("answer", ["[]", "nonsense", '{"status": "complete"}', '{"status": "finished"}'])
def test_unreadable_regions_are_errors(make_suite: MakeSuite, stand: Stand, answer: str) -> None:
    stand(f"print({answer!r})")
    report = run_figure3(make_suite(recorded()), contenders=REGIONS[:1])
    assert report.rows[0].runs["project"].outcome is Outcome.ERROR
    assert "not that of `robust region --json`" in str(report.rows[0].runs["project"].message)
    assert not report.agrees


# -- figure 5 ----------------------------------------------------------------------------------------------------------


def test_figure5_by_the_real_command(make_suite: MakeSuite, tmp_path: Path) -> None:
    plot = tmp_path / "plot.svg"
    report = run_figure5(make_suite(navigation()), limit=120, plot=plot)
    doubling, default = report.rows
    assert doubling.run.text == default.run.text == "complete"
    # By hand: 5 of 15 minutes are gained for to_ridge first, then 10 for to_crater.
    shares = [share for _, share in doubling.run.convergence]
    assert doubling.steps == 26
    assert sorted(set(shares)) == pytest.approx([0, 0.6, 1], abs=1e-5)
    assert doubling.share_at(1) == 0
    assert doubling.share_at(26) == doubling.share_at(1000) == 1
    assert report.agrees
    assert [report.claim_holds(schedule) for schedule in SCHEDULES] == [True, True]
    value = checked(report, "bench-figure5")
    assert [one["running"] for one in value["schedules"][0]["steps"]] == [1, 1, 1, 1, 0, 0, 0]
    assert "in all cases holds for 1 runs" in value["notes"][0]
    assert "poorest" in rendered(report.tables())
    assert plot.stat().st_size > 0


def test_poorest_best_and_the_claim(make_suite: MakeSuite, stand: Stand) -> None:
    change = "ANSWER['convergence'][0]['share'] = 0.75 if 'plan-b.stn' in sys.argv[4] else 0.25\n"
    suite = make_suite(navigation("x_1"), navigation("x_2"))
    other = suite / "plan-b.stn"
    other.write_text("", encoding="utf-8")
    suite = make_suite(navigation("x_1"), navigation("x_2", plan=str(other)))
    stand(STAND + change + TYPE)
    report = run_figure5(suite, schedules=SCHEDULES[:1], jobs=2)
    (fifty,) = report.summary(SCHEDULES[0], [50])
    assert (fifty.poorest, fifty.best, fifty.running) == (0.25, 0.75, 2)
    assert report.claim_holds(SCHEDULES[0]) is False
    assert "does not hold for 2 runs; the poorest is x_1 with 25.0%" in report.notes[0]
    assert report.agrees  # the paper's observation is reported, not required
    checked(report, "bench-figure5")


def test_runs_without_convergence_are_left_out(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand(STAND + "ANSWER['convergence'] = []\n" + TYPE)
    report = run_figure5(make_suite(navigation()), plot=tmp_path / "plot.svg")
    assert report.claim_holds(SCHEDULES[0]) is None
    assert report.summary(SCHEDULES[0]) == ()
    assert any("left out: navigation (zero or infinite width)" in note for note in report.notes)
    checked(report, "bench-figure5")
    stand("sys.exit('broken')")
    report = run_figure5(make_suite(navigation()))
    assert not report.agrees
    assert any("navigation (error)" in note for note in report.notes)
    checked(report, "bench-figure5")


@pytest.mark.parametrize("run", [run_figure3, run_figure5])
def test_wrong_options(make_suite: MakeSuite, run: Any) -> None:
    suite = make_suite(navigation())
    with pytest.raises(InputError, match="jobs is 0"):
        run(suite, jobs=0)
    with pytest.raises(InputError, match="the limit is -1"):
        run(suite, limit=-1)
    with pytest.raises(InputError, match="expected a name that ends in"):
        run(suite, plot=Path("plot.xyz"))
    with pytest.raises(InputError, match="the limit is 0"):
        run_figure3(suite, own_limits={"irr": 0})
