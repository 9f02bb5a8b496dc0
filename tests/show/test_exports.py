"""Envelopes for other tools: numbers are rounded to the safe side, files are read as what they say."""

import csv
import json
import re
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from io import StringIO
from pathlib import Path

import pytest

import robust
from robust.cli.main import run_command
from robust.errors import InputError, UnsupportedError
from robust.irr.overruns import action_overruns
from robust.show.exports import COLUMNS, export, percentage_text, quoted, yaml_lines
from tests.cli import running

ROOT = Path(__file__).parents[2]
NAVIGATION = ROOT / "robust" / "examples" / "two_sample_navigation"
FILES = [str(NAVIGATION / name) for name in ("domain.pddl", "problem.pddl", "plan.stn")]
OPTIONS = ["--parameter", "duration:drive_3", "--parameter", "duration:take-sample"]
TRICKY = [
    "",
    "plain",
    'a "b" \\ c',
    "line\nbreak",
    "tab\t: # [x]",
    "≥ é 😀",
    "\x85\u2028\x00",
    "yes",
    "1",
    "- x",
    "{a: b}",
]


@pytest.fixture(scope="module")
def solved():
    plan = robust.load_plan(*FILES, parameters=OPTIONS[1::2])
    return plan, robust.envelope(plan)


# -- percentages -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("percent", "closed", "text"),
    [
        ("20", True, "20.0"),
        ("20", False, "19.999999"),
        ("100/3", True, "33.333333"),
        ("100/3", False, "33.333333"),
        ("0", True, "0.0"),
        ("1/2000000", True, "0.0"),
        ("1e12", True, "1000000000000.0"),
        ("1e300", True, "1000000000000.0"),
    ],
)
def test_percentages_are_rounded_down(percent, closed, text):
    assert percentage_text(Fraction(percent), closed=closed) == text


@pytest.mark.parametrize("closed", [True, False])
def test_no_double_is_above_what_is_proved(closed):
    for numerator in range(1, 3000):
        for denominator in (1, 3, 7, 10, 100, 1000):
            percent = Fraction(numerator, denominator)
            text = percentage_text(percent, closed=closed)
            assert re.fullmatch(r"[0-9]+\.[0-9]+", text)
            for read in (Fraction(text), Fraction(float(text))):
                assert read <= percent if closed else read < percent
                assert percent - read <= Fraction(2, 10**6)


# -- PlanSys2 ----------------------------------------------------------------------------------------------------------


def parameters_of(text):
    """What a ROS 2 node reads, without a library: blocks of keys, and one list."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert lines[:3] == ["executor:", "  ros__parameters:", "    action_timeouts:"]
    listed = [line.removeprefix("        - ") for line in lines if line.startswith("        - ")]
    assert lines[3] == "      actions:"
    assert listed, "a sequence without elements has no type, and no node that reads it starts"
    blocks = lines[4 + len(listed) :]
    assert len(blocks) == 2 * len(listed)
    found = {}
    for head, value in zip(blocks[::2], blocks[1::2], strict=True):
        name, text = (
            re.fullmatch(r" {6}(\S+):", head)[1],
            re.fullmatch(r" {8}duration_overrun_percentage: (\S+)", value)[1],
        )
        found[name] = text
    assert list(found) == listed
    return found


def test_what_plansys2_reads(solved):
    plan, found = solved
    text = export(plan, found, "plansys2")
    read = parameters_of(text)
    proved = {one.action: one.percent for one in action_overruns(plan, found.box)}
    assert set(read) == set(proved) == {"drive", "take-sample"}
    for action, percent in proved.items():
        assert 0 <= percent - Fraction(read[action]) <= Fraction(1, 10**6)
        assert f"# {action}: exactly {percent} %, the least of" in text
    values = {}
    for one in action_overruns(plan, found.box):
        for each in one.overruns:
            values[each.parameters[0]] = each.planned * (1 + Fraction(read[one.action]) / 100)
    assert robust.check(plan, at=values).answer.value == "proved"


def test_a_yaml_library_reads_the_same(solved):
    yaml = pytest.importorskip("yaml")
    text = export(*solved, "plansys2")
    timeouts = yaml.safe_load(text)["executor"]["ros__parameters"]["action_timeouts"]
    expected = {name: {"duration_overrun_percentage": float(value)} for name, value in parameters_of(text).items()}
    assert timeouts == {"actions": list(expected), **expected}
    document = yaml.safe_load(export(*solved, "yaml"))
    assert [one["name"] for one in document["parameters"]] == [one.name for one in solved[0].parameters]
    assert document["actions"][0]["action"] == "drive"
    for value in TRICKY:
        assert yaml.safe_load(quoted(value)) == value
    nested = {"texts": TRICKY, "empty": [], "inner": [{"a": None, "b": [True, False]}, ["x"], {}]}
    assert yaml.safe_load("\n".join(yaml_lines(nested))) == nested


def test_texts_are_quoted_in_one_line():
    for value in TRICKY:
        text = quoted(value)
        assert text.isprintable()
        if value.isascii():
            assert json.loads(text) == value


def test_names_that_yaml_reads_otherwise(solved):
    plan, found = solved
    instances = tuple(replace(one, action={"drive": "no"}.get(one.action, one.action)) for one in plan.instances)
    text = export(replace(plan, instances=instances), found, "plansys2")
    assert '        - "no"\n' in text
    assert '      "no":\n' in text
    instances = tuple(replace(one, action="actions") for one in plan.instances)
    with pytest.raises(UnsupportedError, match="named 'actions'"):
        export(replace(plan, instances=instances), found, "plansys2")


def test_names_do_not_end_comments(solved):
    plan, found = solved
    instances = tuple(replace(one, arguments=("a\nexecutor: 1",)) for one in plan.instances)
    parameters_of(export(replace(plan, instances=instances), found, "plansys2"))


WAITING = {
    "d.pddl": """(define (domain d) (:requirements :durative-actions :duration-inequalities) (:predicates (done))
(:durative-action wait :parameters () :duration (>= ?duration 0) :condition () :effect (at end (done)))
(:durative-action go :parameters () :duration (= ?duration 2) :condition () :effect ())
(:action look :parameters () :precondition () :effect (done)))""",
    "p.pddl": "(define (problem p) (:domain d) (:init) (:goal (done)))",
    "wait.stn": "parameter a default 1;\ndurative-action instance w : (wait);\nc: w.end - w.start in [a, a];\n",
    "look.stn": "parameter a default 1;\naction instance l : (look);\nc: l - .zero in [a, a];\n",
    "none.stn": "durative-action instance g : (go);\nc: g.end - g.start in [2, 2];\naction instance l : (look);\n",
}


@pytest.fixture
def waiting(tmp_path):
    """Where the files of plans are in which any or no action has a limit."""
    for name, text in WAITING.items():
        (tmp_path / name).write_text(text)
    both = WAITING["wait.stn"] + "durative-action instance g : (go);\nc: g.end - g.start in [2, 2];\n"
    (tmp_path / "both.stn").write_text(both)
    return lambda plan: [str(tmp_path / name) for name in ("d.pddl", "p.pddl", plan)]


def test_an_action_without_limit_is_left_out(waiting):
    plan = robust.load_plan(*waiting("both.stn"))
    text = export(plan, robust.envelope(plan), "plansys2")
    assert parameters_of(text) == {"go": "0.0"}
    assert "# wait: left out, which is no limit; any longer duration is proved as well." in text


@pytest.mark.parametrize(
    ("name", "why"),
    [("wait.stn", "any longer duration of wait is proved"), ("look.stn", "no action of the plan has a duration")],
)
def test_where_no_action_needs_a_limit_there_is_no_file(waiting, tmp_path, name, why):
    ended = running.command("envelope", *waiting(name), "--export", "plansys2", "-o", tmp_path / "timeouts.yaml")
    running.assert_one_line(ended)
    assert "--export: found no action that needs a limit" in ended.err
    assert why in ended.err
    assert not (tmp_path / "timeouts.yaml").exists()
    plan = robust.load_plan(*waiting(name))
    with pytest.raises(InputError, match=r"^export: found no action that needs a limit"):
        export(plan, robust.envelope(plan), "plansys2")


def test_tables_without_rows_are_tables(waiting):
    """Of a plan without parameters CSV is its heading, and YAML has a list of none."""
    plan = robust.load_plan(*waiting("none.stn"))
    found = robust.envelope(plan)
    assert list(csv.reader(StringIO(export(plan, found, "csv")))) == [list(COLUMNS)]
    text = export(plan, found, "yaml")
    assert "\nparameters: []\n" in text
    assert parameters_of(export(plan, found, "plansys2")) == {"go": "0.0"}


def test_percentages_are_of_planned_durations_in_the_box(solved):
    plan, found = solved
    moved = tuple(replace(one, nominal=found.box[one.name].upper + 1) for one in plan.parameters)
    elsewhere = replace(plan, parameters=moved)
    with pytest.raises(InputError, match="found an envelope without the nominal values"):
        export(elsewhere, found, "plansys2")
    assert export(elsewhere, found, "yaml").endswith("\nactions: []\n")
    unplanned = replace(plan, parameters=tuple(replace(one, has_nominal=False) for one in plan.parameters))
    with pytest.raises(InputError, match="found an envelope without the nominal values"):
        export(unplanned, found, "plansys2")


# -- CSV ---------------------------------------------------------------------------------------------------------------


def test_csv(solved):
    plan, found = solved
    head, *rows = csv.reader(StringIO(export(plan, found, "csv")))
    assert tuple(head) == COLUMNS
    assert [row[0] for row in rows] == [one.name for one in plan.parameters]
    for row in (dict(zip(head, each, strict=True)) for each in rows):
        interval = found.box[row["name"]]
        assert (Fraction(row["lower"]), Fraction(row["upper"])) == (interval.lower, interval.upper)
        assert row["upper_closed"] == "true"
        nominal = Fraction(row["nominal"])
        assert (Fraction(row["upper"]) - nominal) / nominal * 100 == Fraction(row["percent_above"])
        assert row["stopped_above"]
        assert row["action"]


# -- the command -------------------------------------------------------------------------------------------------------


def command(*words):
    return subprocess.run(
        [sys.executable, "-m", "robust", "envelope", *words], capture_output=True, text=True, check=False, cwd=ROOT
    )


def test_to_stdout_or_to_a_file(tmp_path, solved):
    printed = command(*FILES, *OPTIONS, "--export", "plansys2")
    assert (printed.returncode, printed.stdout) == (0, export(*solved, "plansys2"))
    path = tmp_path / "timeouts.yaml"
    written = command(*FILES, *OPTIONS, "--export", "plansys2", "-o", str(path), "--json")
    assert json.loads(written.stdout)["status"] == "complete"
    assert path.read_text() == printed.stdout


def test_of_a_box_that_is_to_be_controllable_the_part_that_is(solved):
    dynamic = command(*FILES, *OPTIONS, "--export", "plansys2", "--controllability", "dynamic")
    assert parameters_of(dynamic.stdout) == parameters_of(export(*solved, "plansys2"))
    assert "the box is dynamically controllable." in dynamic.stdout
    assert "has to know durations beforehand" in export(*solved, "plansys2")
    strong = command(*FILES, "--export", "csv", "--controllability", "strong")
    first = dict(zip(*csv.reader(strong.stdout.splitlines()[:2]), strict=True))
    assert (first["name"], first["lower"], first["upper"], first["stopped_above"]) == ("to_ridge", "30", "30", "")


def test_nothing_is_exported_where_no_controllable_part_is_known(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("robust.execute.controllability.assess", lambda *_, **__: None)
    words = ["envelope", *FILES, "--export", "csv", "-o", str(tmp_path / "x.csv"), "--controllability", "dynamic"]
    assert run_command(words) == 3
    said = "nothing is exported: no part of the box is known that is controllable as wanted (no time was left)"
    assert said in capsys.readouterr().err
    assert not (tmp_path / "x.csv").exists()


def test_nothing_is_exported_of_an_invalid_plan(tmp_path):
    invalid = [*FILES[:2], str(NAVIGATION / "plan-flexible-wait.stn")]
    path = tmp_path / "timeouts.yaml"
    found = command(*invalid, "--export", "plansys2", "-o", str(path))
    assert found.returncode == 1
    assert not path.exists()
    plan = robust.load_plan(*invalid)
    with pytest.raises(InputError, match="found an envelope that is invalid, expected a verified one"):
        export(plan, robust.envelope(plan), "csv")


def test_unknown_forms(solved):
    with pytest.raises(InputError, match="unknown form 'xml', expected plansys2, csv, yaml"):
        export(*solved, "xml")
