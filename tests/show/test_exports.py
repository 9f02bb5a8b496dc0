"""Envelopes for other tools: numbers are rounded to the safe side, files are read as what they say."""

import csv
import json
import re
from dataclasses import replace
from fractions import Fraction

import pytest

import robust
from robust.errors import InputError, UnsupportedError
from robust.show.exports import action_overruns, export, percentage_text, quoted, yaml_lines
from tests.cli.running import command, example
from tests.recordings.recordings import INPUTS

OPTIONS = ["--parameter", "duration:drive_3", "--parameter", "duration:take-sample"]
TRICKY = ["", "plain", 'a "b" \\ c', "line\nbreak", "tab\t: # [x]", "≥ é 😀", "\x85\u2028\x00"]
TRICKY += ["yes", "1", "- x", "{a: b}"]


def with_actions(plan, **changed):
    """The plan with other names or arguments of its actions."""
    return replace(plan, instances=tuple(replace(instance, **changed) for instance in plan.instances))


@pytest.fixture(scope="module")
def solved():
    plan = robust.load_plan(*example(), parameters=OPTIONS[1::2])
    return plan, robust.envelope(plan)


@pytest.mark.parametrize("closed", [True, False])
def test_no_double_is_above_what_is_proved(closed):
    assert {percentage_text(Fraction(10) ** power, closed=True) for power in (12, 300)} == {"1000000000000.0"}
    for numerator in range(1, 1500):
        for denominator in (1, 3, 7, 10, 100, 1000):
            percent = Fraction(numerator, denominator)
            text = percentage_text(percent, closed=closed)
            assert re.fullmatch(r"[0-9]+\.[0-9]+", text)
            for read in (Fraction(text), Fraction(float(text))):
                assert read <= percent if closed else read < percent
                assert percent - read <= Fraction(2, 10**6)


def parameters_of(text):
    """What a ROS 2 node reads, without a library: blocks of keys, and one list."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert lines[:3] == ["executor:", "  ros__parameters:", "    action_timeouts:"]
    listed = [line.removeprefix("        - ") for line in lines if line.startswith("        - ")]
    assert lines[3] == "      actions:"
    assert listed, "a sequence without elements has no type, and no node that reads it starts"
    blocks = lines[4 + len(listed) :]
    assert len(blocks) == 2 * len(listed)
    heads = [re.fullmatch(r" {6}(\S+):", head)[1] for head in blocks[::2]]
    values = [re.fullmatch(r" {8}duration_overrun_percentage: (\S+)", value)[1] for value in blocks[1::2]]
    assert heads == listed
    return dict(zip(heads, values, strict=True))


def test_what_plansys2_reads(solved):
    plan, envelope = solved
    text = export(plan, envelope, "plansys2")
    read = parameters_of(text)
    actions = {entry.action: entry for entry in action_overruns(plan, envelope.box)}
    assert set(read) == set(actions) == {"drive", "take-sample"}
    values = {}
    for action, entry in actions.items():
        assert 0 <= entry.percent - Fraction(read[action]) <= Fraction(1, 10**6)
        assert f"# {action}: exactly {entry.percent} %, the least of" in text
        for overrun in entry.overruns:
            values[overrun.parameters[0]] = overrun.planned * (1 + Fraction(read[action]) / 100)
    assert robust.check(plan, at=values).answer is robust.Answer.PROVED


def test_a_yaml_library_reads_the_same_and_texts_are_quoted_in_one_line(solved):
    for value in TRICKY:
        text = quoted(value)
        assert text.isprintable()
        assert not value.isascii() or json.loads(text) == value
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


def test_names_that_yaml_reads_otherwise(solved):
    plan, envelope = solved
    instances = tuple(replace(each, action={"drive": "no"}.get(each.action, each.action)) for each in plan.instances)
    text = export(replace(plan, instances=instances), envelope, "plansys2")
    assert '        - "no"\n' in text
    assert '      "no":\n' in text
    with pytest.raises(UnsupportedError, match="named 'actions'"):
        export(with_actions(plan, action="actions"), envelope, "plansys2")
    parameters_of(export(with_actions(plan, arguments=("a\nexecutor: 1",)), envelope, "plansys2"))


def test_where_no_action_needs_a_limit_there_is_no_file():
    plan = robust.load_plan(*(INPUTS / "waiting" / name for name in ("domain.pddl", "problem.pddl", "wait.stn")))
    with pytest.raises(InputError, match=r"^export: found no action that needs a limit"):
        export(plan, robust.envelope(plan), "plansys2")


def test_percentages_are_of_planned_durations_in_the_box(solved):
    plan, envelope = solved
    moved = tuple(replace(one, nominal=envelope.box[one.name].upper + 1) for one in plan.parameters)
    elsewhere = replace(plan, parameters=moved)
    with pytest.raises(InputError, match="found an envelope without the nominal values"):
        export(elsewhere, envelope, "plansys2")
    assert export(elsewhere, envelope, "yaml").endswith("\nactions: []\n")
    unplanned = replace(plan, parameters=tuple(replace(one, has_nominal=False) for one in plan.parameters))
    with pytest.raises(InputError, match="found an envelope without the nominal values"):
        export(unplanned, envelope, "plansys2")


def exported(*words, files=None):
    """An envelope that is exported by the command."""
    return command("envelope", *(files or example()), *OPTIONS, "--export", *words)


def test_the_command_prints_what_the_function_returns_or_the_part_that_is_controllable(solved):
    printed = exported("plansys2")
    assert (printed.code, printed.out) == (0, export(*solved, "plansys2"))
    dynamic = exported("plansys2", "--controllability", "dynamic").out
    assert parameters_of(dynamic) == parameters_of(export(*solved, "plansys2"))
    assert "the box is dynamically controllable." in dynamic
    assert "has to know durations beforehand" in export(*solved, "plansys2")
    strong = command("envelope", *example(), "--export", "csv", "--controllability", "strong").out
    first = dict(zip(*csv.reader(strong.splitlines()[:2]), strict=True))
    assert (first["name"], first["lower"], first["upper"], first["stopped_above"]) == ("to_ridge", "30", "30", "")


def test_nothing_is_exported_where_nothing_is_known_of_an_invalid_plan_or_in_an_unknown_form(tmp_path, monkeypatch):
    monkeypatch.setattr("robust.execute.controllability.assess", lambda *_, **__: None)
    ended = exported("csv", "-o", tmp_path / "x.csv", "--controllability", "dynamic")
    assert ended.code == 3
    reason = "nothing is exported: no part of the box is known that is controllable as wanted (no time was left)"
    assert reason in ended.err
    assert not (tmp_path / "x.csv").exists()
    invalid, path = example("plan-flexible-wait.stn"), tmp_path / "timeouts.yaml"
    assert exported("plansys2", "-o", path, files=invalid).code == 1
    assert not path.exists()
    plan = robust.load_plan(*invalid)
    with pytest.raises(InputError, match="found an envelope that is invalid, expected a verified one"):
        export(plan, robust.envelope(plan), "csv")
    with pytest.raises(InputError, match="unknown form 'xml', expected plansys2, csv, yaml"):
        export(plan, robust.envelope(plan), "xml")
