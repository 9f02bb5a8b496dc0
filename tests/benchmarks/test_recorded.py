"""Data sets, and `bench recorded`: agreement, every kind of disagreement, limits and interruption."""

from __future__ import annotations

import json
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from benchmarks.engine.measure import Ending
from benchmarks.suite import read_suite
from robust.errors import InputError
from tests.benchmarks.conftest import MakeSuite, Stand, checked, navigation, rendered, run

TYPE = "print(json.dumps(ANSWER))"
IRR = {"status": "ok", "wall_s": 1.0, "memory_mb": 10, "checks": 3}


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in navigation().items() if name != key}


# -- data sets ---------------------------------------------------------------------------------------------------------


def test_all_fields(make_suite: MakeSuite) -> None:
    (instance,) = read_suite(make_suite(navigation(irr_box={"a": ["-inf", "1/3"]})))
    assert instance.name == "navigation"
    assert all(path.is_file() for path in instance.files)
    assert instance.order == ("to_ridge", "to_crater")
    assert instance.irr is not None
    assert (instance.irr.checks, instance.irr.solved) == (26, True)
    assert instance.ccmmz is not None
    assert not instance.ccmmz.solved
    assert instance.box is not None
    assert (instance.box["a"].lower, instance.box["a"].upper) == (None, Fraction(1, 3))


def test_paths_are_relative_to_the_data_set(make_suite: MakeSuite) -> None:
    directory = make_suite({"instance": "x", "domain": "d.pddl", "problem": "p.pddl", "plan": "s/p.stn"})
    (directory / "s").mkdir()
    files = tuple(directory / name for name in ("d.pddl", "p.pddl", "s/p.stn"))
    for path in files:
        path.write_text("", encoding="utf-8")
    (instance,) = read_suite(directory)
    assert instance.files == files
    assert (instance.irr, instance.box, instance.order, instance.ccmmz) == (None, None, (), None)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (without("instance"), "instance 1: has no 'instance'"),
        (without("domain"), r"instance 1 \('navigation'\): has no 'domain', expected a text"),
        ({**without("plan"), "plans": "x"}, "has no 'plan', expected a text; did you mean 'plans'"),
        (navigation(problem=3), "'problem' is a number, expected a text"),
        (navigation(plan=""), "'plan' is an empty text"),
        (navigation(plan="absent.stn"), "'plan' names .*absent.stn', expected a file that exists"),
        (navigation(plan="x" * 5000), "expected a file that exists"),
        (navigation(plan="nul\0"), "expected a file that exists"),
        (navigation(domain="."), "'domain' names .*expected a file that exists"),
        (navigation(irr=[]), "'irr' is an empty list, expected an object"),
        (navigation(irr={}), "'irr': has no 'status'"),
        (navigation(irr={"status": "ok", "wall_s": "1"}), "'irr': 'wall_s' is '1', expected a number"),
        (navigation(irr={"status": "ok", "wall_s": -1}), "'wall_s' is -1, expected a number that is not negative"),
        (navigation(irr={"status": "ok", "wall_s": float("nan")}), "'wall_s' is nan"),
        (navigation(irr={"status": "ok", "wall_s": True}), "'wall_s' is True"),
        (navigation(irr={"status": "ok", "checks": 1.5}), "'checks' is 1.5, expected an integer"),
        (navigation(ccmmz="ok"), "'ccmmz' is a text, expected an object"),
        (navigation(irr_box=[1]), "'irr_box' is a list, expected an object"),
        (navigation(irr_box={"a": ["1"]}), "'irr_box': 'a' is .*expected two numbers as text"),
        (navigation(irr_box={"a": [1, 2]}), "expected two numbers as text"),
        (navigation(irr_box={"a": ["1", "two"]}), "'a': found 'two', expected a number"),
        (navigation(irr_box={"a": ["1", "1/0"]}), "denominator is not 0"),
        (navigation(irr_box={"a": ["1", "1e999999999"]}), "at most 300 digits"),
        (navigation(irr_order="a"), "'irr_order' is a text, expected a list"),
        (navigation(irr_order=["a", 1]), "'irr_order' is a list, expected a list of parameter names"),
        ("text", "instance 1 is a text, expected an object"),
        (None, "instance 1 is null, expected an object"),
    ],
)
def test_wrong_entries(make_suite: MakeSuite, entry: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_suite(make_suite(entry))
    assert "recorded-results.json" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1:1: not JSON"),
        ("[\n{", "2:2: not JSON"),
        ("{}", "found an object, expected a list of at least one instance"),
        ("[]", "found an empty list"),
        ("null", "found null"),
        ("[" * 100_000, "nested too deeply|not JSON"),
        ("[" + "9" * 5000 + "]", "enormous number"),
        ("\0", "binary data"),
    ],
)
def test_wrong_lists(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "recorded-results.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as error:
        read_suite(tmp_path)
    assert "\n" not in str(error.value)


def test_missing_directories_and_names_that_occur_twice(tmp_path: Path, make_suite: MakeSuite) -> None:
    with pytest.raises(InputError, match=r"found nothing, expected a directory with recorded-results\.json"):
        read_suite(tmp_path / "absent")
    with pytest.raises(InputError, match=r"recorded-results\.json: found no such file"):
        read_suite(tmp_path)
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="found a file, expected a directory"):
        read_suite(tmp_path / "file")
    with pytest.raises(InputError, match="found instance 'navigation' twice"):
        read_suite(make_suite(navigation(), navigation()))


def test_the_data_set_is_read(dataset: Path) -> None:
    instances = read_suite(dataset)
    raw = json.loads((dataset / "recorded-results.json").read_text(encoding="utf-8"))
    assert [instance.name for instance in instances] == [entry["instance"] for entry in raw]
    assert all(instance.box is not None and instance.irr is not None for instance in instances)


# -- comparison --------------------------------------------------------------------------------------------------------


def test_agreement_by_the_real_command(make_suite: MakeSuite) -> None:
    report = run("recorded", suite=make_suite(navigation()), limit=300)
    (row,) = report.rows
    assert row.ours.status is Ending.COMPLETE, row.ours.message
    assert (row.box_agrees, row.checks_agree, row.agrees, row.differences) == (True, True, True, ())
    assert row.ours.memory_mb > 10
    assert 0 < row.ours.first_widening_wall_s <= row.ours.seconds
    value = checked(report)
    assert value["rows"][0]["ours"]["box"] == {"to_ridge": ["30", "45"], "to_crater": ["30", "40"]}
    assert value["totals"]["agreeing"] == value["totals"]["compared"] == 1
    other = navigation(irr_order=["to_crater", "to_ridge"])  # the order matters
    (row,) = run("recorded", suite=make_suite(other), limit=300).rows
    assert row.ours.status is Ending.COMPLETE, row.ours.message
    assert row.agrees is False


@pytest.mark.parametrize(
    ("change", "box", "irr", "differences", "agree"),
    [
        (
            "",
            {"a": ["1/3", "2"], "b": ["0", "1"]},
            IRR,
            ["a upper: inf instead of 2", "b lower: absent instead of 0", "b upper: absent instead of 1"],
            (False, False, True),
        ),
        (
            "ANSWER['parameters']['a'].update(lower='0.50', upper='2/4', upper_closed=True)",
            {"a": ["1/2", "0.5"]},
            IRR,
            [],
            (True, True, True),
        ),
        (
            "ANSWER['parameters']['a'].update(upper='2')",
            {"a": ["1/3", "2"]},
            IRR,
            ["a upper: 2 (open) instead of 2"],
            (False, False, True),
        ),
        ("", {"a": ["1/3", "inf"]}, {**IRR, "checks": 26}, [], (False, True, False)),
        ("", None, None, [], (None, None, None)),
        ("", None, {"status": "out of time", "wall_s": 3600.1, "memory_mb": 9}, [], (None, None, None)),
    ],
)
def test_what_agrees(
    make_suite: MakeSuite, stand: Stand, change: str, box: Any, irr: Any, differences: list[str], agree: Any
) -> None:
    stand(change + "\n" + TYPE)
    report = run("recorded", suite=make_suite(navigation(irr_box=box, irr=irr)))
    (row,) = report.rows
    assert [str(one) for one in row.differences] == differences
    assert (row.agrees, row.box_agrees, row.checks_agree) == agree
    assert report.agrees == (agree[0] is not False)
    expected = (
        "; ".join(differences)
        or {
            (True, True, True): "equal",
            (False, True, False): "equal box, other number of checks",
            (None, None, None): "nothing recorded",
        }[agree]
    )
    assert row.verdict == expected
    assert expected.split(";")[0] in rendered(report.tables)
    value = checked(report)
    assert value["totals"]["compared"] == (0 if agree[0] is None else 1)
    assert [one["parameter"] for one in value["rows"][0]["differences"]] == [text[0] for text in differences]


def test_the_options_of_each_run(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    stand(f"open({str(tmp_path / 'argv')!r}, 'w').write(json.dumps(sys.argv[1:]))\n" + TYPE)
    run("recorded", suite=make_suite(navigation(irr_order=["-b", "a"])))
    argv = json.loads((tmp_path / "argv").read_text(encoding="utf-8"))
    paths = [navigation()[key] for key in ("domain", "problem", "plan")]
    assert argv == ["envelope", *paths, "--method", "irr", "--beta", "1", "--doubling", "--order=-b,a", "--json"]


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("sys.exit('robust: p.pddl:3: wrong')", "robust: p.pddl:3: wrong"),
        ("os.abort()", "exit code -6 without a message"),
        ("print(json.dumps({'error': {'message': 'p.pddl:3: wrong'}})); sys.exit(2)", "p.pddl:3: wrong"),
        ("print('[]')", "not that of `robust envelope --json`"),
        ("print('{')", "not that of `robust envelope --json`"),
        ("print('null')", "not that of `robust envelope --json`"),
        ("ANSWER['status'] = 'fine'\n" + TYPE, "'fine' is not a valid Ending"),
        ("del ANSWER['checks']\n" + TYPE, "KeyError: 'checks'"),
        ("ANSWER['parameters']['a']['lower'] = 'x'\n" + TYPE, "found 'x', expected a number"),
        ("ANSWER['parameters']['a']['lower'] = 3\n" + TYPE, "TypeError"),
        ("ANSWER['parameters'] = 3\n" + TYPE, "AttributeError"),
        ("ANSWER.update(status='invalid', reason='[goal] breaks', first_widening_s=None)\n" + TYPE, "[goal] breaks"),
    ],
)
def test_failures_are_rows(make_suite: MakeSuite, stand: Stand, script: str, message: str) -> None:
    stand(script)
    report = run("recorded", suite=make_suite(navigation()))
    (row,) = report.rows
    assert row.ours.status is (Ending.INVALID if "[goal]" in message else Ending.ERROR)
    assert message in (row.ours.message or "")
    assert (row.agrees, report.agrees, report.complete) == (False, False, True)
    assert checked(report)["totals"]["errors"] == (0 if "[goal]" in message else 1)
    assert message[:8] in rendered(report.tables)


def test_the_limit_is_for_each_instance(make_suite: MakeSuite, stand: Stand) -> None:
    stand("if sys.argv[-2] == '--order=slow': time.sleep(60)\n" + TYPE)
    quick = navigation("quick", irr_box={"a": ["1/3", "inf"]}, irr=IRR)
    report = run("recorded", suite=make_suite(navigation("slow", irr_order=["slow"]), quick), limit=3)
    assert [row.ours.status for row in report.rows] == [Ending.TIMEOUT, Ending.COMPLETE]
    assert 3 <= report.rows[0].ours.seconds < 20
    assert report.complete
    assert not report.agrees
    totals = checked(report)["totals"]
    assert (totals["timeouts"], totals["agreeing"], totals["solved"]["ours"]) == (1, 1, 1)
    assert totals["seconds"]["instances"] == 1
    assert "timeout" in rendered(report.tables)


def test_two_jobs_run_at_the_same_time_and_keep_the_order(make_suite: MakeSuite, stand: Stand, tmp_path: Path) -> None:
    meet = f"""
mine, other = sys.argv[-2][-1], {{"1": "2", "2": "1"}}[sys.argv[-2][-1]]
open({str(tmp_path)!r} + "/here" + mine, "w").close()
while not os.path.exists({str(tmp_path)!r} + "/here" + other): time.sleep(0.01)
if mine == "1": time.sleep(2)
"""
    stand(meet + TYPE)
    done: list[str] = []
    suite = make_suite(*(navigation(f"n{i}", irr_order=[f"p{i}"], irr_box=None) for i in (1, 2)))
    report = run("recorded", suite=suite, jobs=2, limit=60, on_result=lambda _n, _total, text: done.append(text[:2]))
    assert [row.instance.name for row in report.rows] == ["n1", "n2"]
    assert [row.ours.status for row in report.rows] == [Ending.COMPLETE] * 2
    assert done == ["n2", "n1"]
    assert "2 processes ran at a time and disturbed each other's timings" in report.notes
    assert checked(report)["jobs"] == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interruption_keeps_what_is_there(make_suite: MakeSuite, stand: Stand, jobs: int) -> None:
    stand("if sys.argv[-2] != '--order=quick': time.sleep(60)\n" + TYPE)

    def interrupt(_done: int, _total: int, _text: str) -> None:
        raise KeyboardInterrupt

    slow = (navigation(f"slow{i}", irr_order=["slow"]) for i in range(3))
    started = time.monotonic()
    suite = make_suite(navigation("quick", irr_order=["quick"], irr_box=None), *slow)
    report = run("recorded", suite=suite, jobs=jobs, on_result=interrupt)
    assert time.monotonic() - started < 50
    assert [row.instance.name for row in report.rows] == ["quick"]
    assert not report.complete
    assert not report.agrees
    assert "incomplete: interrupted after 1 of 4 instances" in rendered(report.tables)
    assert checked(report)["complete"] is False


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_plot(make_suite: MakeSuite, stand: Stand, tmp_path: Path, suffix: str) -> None:
    stand(TYPE)
    plot = tmp_path / f"plot{suffix}"
    run("recorded", suite=make_suite(navigation(), navigation("other", irr=None, ccmmz=None)), plot=plot)
    assert plot.read_bytes().startswith(b"\x89PNG" if suffix == ".png" else b"<?xml")
    stand("sys.exit(2)")  # nothing is solved
    plot.unlink()
    run("recorded", suite=make_suite(navigation(irr=None, ccmmz=None)), plot=plot)
    assert plot.stat().st_size > 0
