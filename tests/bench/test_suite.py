"""Data sets are read completely before anything runs, and whatever is wrong is one clear line."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from robust.bench.recorded import run_recorded
from robust.bench.suite import read_suite
from robust.errors import InputError
from tests.bench.conftest import MakeSuite, navigation


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in navigation().items() if name != key}


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
    for name in ("d.pddl", "p.pddl", "s/p.stn"):
        (directory / name).write_text("", encoding="utf-8")
    (instance,) = read_suite(directory)
    assert instance.files == (directory / "d.pddl", directory / "p.pddl", directory / "s" / "p.stn")
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


def test_missing_directory_and_list(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found nothing, expected a directory with recorded-results\.json"):
        read_suite(tmp_path / "absent")
    with pytest.raises(InputError, match=r"recorded-results\.json: found no such file"):
        read_suite(tmp_path)
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="found a file, expected a directory"):
        read_suite(tmp_path / "file")


def test_names_must_differ(make_suite: MakeSuite) -> None:
    with pytest.raises(InputError, match="found instance 'navigation' twice"):
        read_suite(make_suite(navigation(), navigation()))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"jobs": 0}, "jobs is 0"),
        ({"limit": 0}, "the limit is 0"),
        ({"limit": -1.0}, "the limit is -1"),
        ({"limit": float("nan")}, "the limit is nan"),
        ({"limit": float("inf")}, "the limit is inf"),
        ({"plot": Path("plot.txt")}, "expected a name that ends in .svg, .png, .pdf"),
        ({"plot": Path("absent/plot.svg")}, "no directory 'absent'"),
    ],
)
def test_wrong_options(make_suite: MakeSuite, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run_recorded(make_suite(navigation()), **options)


def test_the_data_set_is_read(dataset: Path) -> None:
    instances = read_suite(dataset)
    raw = json.loads((dataset / "recorded-results.json").read_text(encoding="utf-8"))
    assert [instance.name for instance in instances] == [entry["instance"] for entry in raw]
    assert all(instance.box is not None and instance.irr is not None for instance in instances)
