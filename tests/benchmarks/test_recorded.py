"""Data sets, `bench recorded`, and the recorded instances: boxes fraction by fraction, and the number of checks."""

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from benchmarks import certificates
from benchmarks.catalogue import RecordedOptions
from benchmarks.engine.measure import Ending
from benchmarks.irr.recorded import RECORDED
from benchmarks.suite import RecordedInstance, RecordedRun, read_suite
from robust import InputError, ParametrizedPlan, Status, envelope
from robust.encode.encoding import RelationalEncoding
from robust.irr.containment import Containment
from robust.qe.box import Box, Interval, Side
from robust.reading import load_plan
from robust.smt.limits import NEVER
from tests.benchmarks.conftest import example, navigation, rendered, run
from tests.certify import tools

IRR = {"status": "ok", "wall_s": 1.0, "memory_mb": 10, "checks": 3}


def test_what_is_read(make_suite):
    directory = make_suite(
        navigation(irr_box={"a": ["-inf", "1/3"]}),
        {"instance": "x", "domain": "d.pddl", "problem": "p.pddl", "plan": "s/p.stn"},
    )
    (directory / "s").mkdir()
    files = tuple(directory / name for name in ("d.pddl", "p.pddl", "s/p.stn"))
    for path in files:
        path.write_text("", encoding="utf-8")
    first, second = read_suite(directory)
    runs = (RecordedRun("ok", 2.5, 50, 0.5, 26), RecordedRun("out of time", 3600.5, 9000))
    box = Box({"a": Interval(None, Fraction(1, 3))})
    assert first == RecordedInstance("navigation", first.files, runs[0], box, ("to_ridge", "to_crater"), runs[1])
    assert ([run.solved for run in runs], second) == ([True, False], RecordedInstance("x", files))


@pytest.mark.parametrize(
    ("listed", "message"),
    [
        ([example()], r"missing required field `instance` - at `\$\[0\]`"),
        ([navigation(problem=3)], r"Expected `str`, got `int` - at `\$\[0\]\.problem`"),
        ([navigation(plan="")], r"length >= 1 - at `\$\[0\]\.plan`"),
        *(
            ([navigation(plan=plan)], "'navigation' names .*expected a file that exists")
            for plan in ("absent.stn", "x" * 5000, "nul\0", ".")
        ),
        ([navigation(irr={"status": "ok", "wall_s": -1})], "Expected `float` >= 0"),
        ([navigation(irr={"status": "ok", "wall_s": float("nan")})], "malformed"),
        ([navigation(irr={"status": "ok", "checks": 1.5})], r"Expected `int \| null`, got `float`"),
        ([navigation(irr_box={"a": ["1"]})], "Expected `array` of length 2"),
        ([navigation(irr_box={"a": ["1", "two"]})], "box of 'navigation': found 'two', expected a number"),
        ([navigation(irr_box={"a": ["1", "1e999999999"]})], "at most 300 digits"),
        ([navigation(irr_box={"a": ["2", "1"]})], "is empty"),
        ([None], "Expected `object`, got `null`"),
        ([navigation(), navigation()], "found instance 'navigation' twice"),
        ([], "found an empty list"),
        ("", "truncated"),
        ("{}", "Expected `array`, got `object`"),
        ("[" * 100_000, "recursion|nested|truncated|Expected"),
        ("[" + "9" * 5000 + "]", "Expected|malformed|range"),
        ("\0", "binary data"),
    ],
)
def test_wrong_lists(make_suite, listed, message):
    directory = make_suite(*listed)
    if isinstance(listed, str):
        (directory / "recorded-results.json").write_text(listed, encoding="utf-8")
    with pytest.raises(InputError, match=message) as error:
        read_suite(directory)
    assert "recorded-results.json" in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_data_set(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match=r"found no recorded-results\.json, expected a directory with it"):
        read_suite(tmp_path)
    with pytest.raises(InputError, match="found a file, expected a directory"):
        read_suite(tmp_path / "file")


def test_a_data_set_lies_one_level_away(make_suite):
    directory = make_suite(navigation())
    (inside := directory / "inside").mkdir()
    assert read_suite(directory.parent) == read_suite(directory) == read_suite(inside)
    (other := directory.parent / "other").mkdir()
    (other / "recorded-results.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match=f"found recorded-results.json in other and in {directory.name}"):
        read_suite(directory.parent)


ENDLESS = ["a upper: inf instead of 2", "b lower: absent instead of 0", "b upper: absent instead of 1"]
OPEN = ["a upper: 2 (open) instead of 2"]
TWO = {"a": ["0", "2"]}
LATE = {"status": "out of time", "wall_s": 3600.1, "memory_mb": 9}


@pytest.mark.parametrize(
    ("change", "box", "irr", "differences", "agree"),
    [
        ("BOX.update(upper='inf')", TWO | {"b": ["0", "1"]}, IRR, ENDLESS, (False, False, True)),
        ("BOX.update(lower='0.50', upper='2/4')", {"a": ["1/2", "0.5"]}, IRR, [], (True, True, True)),
        ("BOX.update(upper_closed=False)", TWO, IRR, OPEN, (False, False, True)),
        ("", TWO, {**IRR, "checks": 26}, [], (False, True, False)),
        ("", None, None, [], (None, None, None)),
        ("", None, LATE, [], (None, None, None)),
    ],
)
def test_what_agrees(trial, change, box, irr, differences, agree):
    report = trial("recorded", change, navigation(irr_box=box, irr=irr))
    (row,) = report.rows
    assert [str(one) for one in row.differences] == differences
    assert ((row.agrees, row.box_agrees, row.checks_agree), report.agrees) == (agree, agree[0] is not False)
    verdicts = {None: "nothing recorded", True: "equal", False: "equal box, other number of checks"}
    assert row.verdict == ("; ".join(differences) or verdicts[agree[0]])
    assert row.verdict.split(";")[0] in rendered(report.tables)
    value = report.as_dict()
    assert value["totals"]["compared"] == (0 if agree[0] is None else 1)
    assert [one["parameter"] for one in value["rows"][0]["differences"]] == [text[0] for text in differences]


def test_the_options_of_each_run(trial, tmp_path):
    instance = navigation(irr_order=["-b", "a"])
    trial("recorded", f"open({str(tmp_path / 'argv')!r}, 'w').write(json.dumps(sys.argv[1:]))", instance)
    argv = json.loads((tmp_path / "argv").read_text(encoding="utf-8"))
    paths = [instance[key] for key in ("domain", "problem", "plan")]
    assert argv == ["envelope", *paths, "--method", "irr", "--beta", "1", "--doubling", "--order=-b,a", "--json"]


def test_the_limit_is_for_each_instance(trial):
    slow = navigation("slow", irr_order=["slow"])
    quick = navigation("quick", irr_box={"a": ["0", "2"]}, irr=IRR)
    report = trial("recorded", "if sys.argv[-2] == '--order=slow': time.sleep(60)", slow, quick, limit=3)
    assert [row.ours.status for row in report.rows] == [Ending.TIMEOUT, Ending.COMPLETE]
    assert 2.5 < report.rows[0].ours.seconds < 20
    assert (report.complete, report.agrees) == (True, False)
    totals = report.as_dict()["totals"]
    assert (totals["timeouts"], totals["agreeing"], totals["solved"]["ours"]) == (1, 1, 1)
    assert totals["seconds"]["instances"] == 1


def test_an_interruption_keeps_what_is_there(trial):
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    instances = (navigation(name, irr_box=None) for name in ("first", "second"))
    report = trial("recorded", "", *instances, on_result=interrupt)
    assert ([row.instance.name for row in report.rows], report.complete, report.agrees) == (["first"], False, False)
    assert "incomplete: interrupted after 1 of 2 instances" in rendered(report.tables)


@pytest.mark.parametrize(("count", "expected"), [(None, 5), (1, 1), (2, 2), (5, 5), (9, 5)])
def test_some_instances_are_spread_over_the_data_set(count, expected, make_suite):
    suite = make_suite(*(navigation(f"n{number}") for number in range(5)))
    options = RecordedOptions(suite=suite, instances=count)
    names = [one.name for one in RECORDED.prepare(options, None)]
    assert names == sorted(set(names))
    assert (len(names), names[0]) == (expected, "n0")
    assert count != 2 or names == ["n0", "n2"]


BETA = Fraction(1)


def test_a_small_instance_by_the_real_command(dataset, make_suite):
    (entry,) = (
        {
            **dict(zip(("domain", "problem", "plan"), (str(path.resolve()) for path in one.files), strict=True)),
            "instance": one.name,
            "irr": asdict(one.irr),
            "irr_box": {name: [str(end) for end in ends] for name, ends in one.box.ranges.items()},
            "irr_order": list(one.order),
        }
        for one in read_suite(dataset)
        if one.name == "solar_rover_01_3"
    )
    report = run("recorded", suite=make_suite(entry), limit=300)
    (row,) = report.rows
    assert (row.instance.name, row.verdict) == ("solar_rover_01_3", "equal")
    assert row.ours.memory_mb > 10
    assert 0 < row.ours.first_widening_wall_s <= row.ours.seconds


def reproduced(dataset: Path, **options: Any) -> Iterator[tuple[RecordedInstance, ParametrizedPlan, Box]]:
    """The instances whose boxes and checks were compared with those of the recorded schedule."""
    for instance in read_suite(dataset):
        assert instance.irr is not None
        plan = load_plan(*instance.files)
        result = envelope(plan, method="irr", beta=BETA, doubling=True, order=instance.order, **options)
        found = (result.status, result.box, result.checks)
        assert found == (Status.COMPLETE, instance.box, instance.irr.checks), instance.name
        yield instance, plan, result.box


def test_all_instances_in_process(dataset):
    assert len(list(reproduced(dataset))) == 34


def is_inside(plan: ParametrizedPlan, box: Box, solver: str) -> bool:
    """By a containment check that knows nothing of the search: no proof or refutation is remembered."""
    return Containment(RelationalEncoding(plan), solver=solver).refute(box, NEVER) is None


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "other"), [("z3", "cvc5"), ("cvc5", "z3")])
def test_boxes_of_each_solver_are_confirmed_by_the_other(dataset, solver, other):
    for instance, plan, box in reproduced(dataset, solver=solver):
        assert is_inside(plan, box, other), instance.name


@pytest.mark.slow
def test_the_default_schedule_keeps_its_promise(dataset):
    """No side can grow by β unless it is at a declared bound, by z3 and by cvc5."""
    for instance in read_suite(dataset):
        plan = load_plan(*instance.files)
        result = envelope(plan, method="irr", beta=BETA)
        assert result.status is Status.COMPLETE
        for solver in ("z3", "cvc5"):
            assert is_inside(plan, result.box, solver), (instance.name, solver)
            for one, side in product(plan.parameters, Side):
                end = result.box[one.name].end(side)
                if end is not None and end != (one.upper if side is Side.UPPER else one.lower):
                    grown = result.box.moved((one.name, side), end + side.sign * BETA)
                    assert not is_inside(plan, grown, solver), (instance.name, solver, one.name, side)


def test_one_plan_is_measured():
    found = certificates.measure("generator", tools.GENERATOR, processes=False)
    assert [(each.kind, each.rejected) for each in found] == [(kind, None) for kind in certificates.KINDS]
    assert min(min(each.solve, each.produce, each.check, each.size) for each in found) > 0


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_a_plan_with_choices_is_measured(name):
    found = certificates.measure_choices(name, certificates.EXAMPLES / name / f"{name}.tpnu.json")
    assert [(each.kind, each.rejected) for each in found] == [(kind, None) for kind in certificates.OF_CHOICES]


@pytest.mark.slow
def test_all_recorded_plans_and_boxes_have_small_certificates_that_are_checked_quickly(dataset):
    report = certificates.CERTIFICATES.run(suite=dataset)
    assert len(report.rows) == 4 * 61 + 4
    assert report.agrees
    report = replace(report, rows=tuple(each for each in report.rows if each.kind in ("plan", "box", "maximal")))
    assert len(report.accepted) == 3 * 61
    assert median(each.ratio for each in report.rows) < certificates.MEDIAN
    assert median(each.cost for each in report.rows if each.kind == "box") < certificates.COSTLIEST
    assert max(each.check for each in report.rows if each.kind != "plan") < certificates.SLOWEST
    assert max(each.size for each in report.rows) < certificates.LARGEST
