"""The suite for executives of plans with choices: the executive passes it, and wrong ones do not."""

import ast
import csv
import shlex
import sys
from collections import Counter
from itertools import islice

import pytest

from benchmarks.conformance import __main__ as suite
from benchmarks.conformance import counted, mutants
from tests.sampling import often

EXECUTIVE = shlex.join([sys.executable, "-m", "robust", "pike", "run", "{plan}", "--stdio", "-q"])
CASES = {case["name"]: case for case in suite.cases("patient", None)}
QUICK = ("order", "retract", "too-late", "completion-with-outcome", "outcome-patient")
CAUGHT = {
    "deaf-to-outcomes": "outcome-first",
    "deaf-to-completions": "completion",
    "deaf-to-failures": "aborted",
    "deaf-to-beginnings": "started",
    "deaf-to-observations": "estimate-broken",
    "deaf-to-retractions": "retract",
    "deaf-to-several": "together",
    "timeless": "completion-late",
    "confused": "outcome-first",
    "hasty": "completion",
    "sleepy": "completion",
    "never-dispatches": "completion",
    "never-cancels": "failed",
    "never-says-what-broke": "estimate-broken",
    "dispatches-twice": "completion",
    "glad": "impossible",
    "stubborn": "impossible",
    "credulous": "malformed",
}
"""Of each mutant, a case that it fails."""


def examined(command, case):
    return suite.examine(command, CASES[case], 60)


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_the_executive_does_what_it_must(case):
    assert examined(EXECUTIVE, case) == []


@pytest.mark.slow
@pytest.mark.parametrize("reasoner", ["windows", "drake"])
def test_other_reasoners(reasoner):
    """Drake knows nothing of what activities need: it takes for possible what is not."""
    failed = {
        case
        for case in CASES
        if CASES[case]["level"] == "core" and examined(f"{EXECUTIVE} --reasoner {reasoner}", case)
    }
    assert ("nothing-makes-it" in failed) == (reasoner == "drake")
    assert reasoner == "drake" or not failed


@pytest.mark.parametrize(
    "mutant",
    [pytest.param(name, marks=[] if name in {"hasty", "never-cancels"} else pytest.mark.slow) for name in CAUGHT],
)
def test_wrong_executives_are_caught(mutant):
    through = shlex.join([sys.executable, mutants.__file__, mutant])
    assert examined(f"{through} {EXECUTIVE}", CAUGHT[mutant])


def test_all_mutants_and_all_kinds_of_messages_occur():
    assert set(CAUGHT) == set(mutants.MUTANTS)
    said = {
        message["kind"] for case in CASES.values() for event in case["world"] for message in event.get("messages", ())
    }
    assert {"started", "completion", "failed", "aborted", "cancelled", "estimate", "retract", "outcome"} <= said


@pytest.mark.parametrize("module", [suite, mutants])
def test_the_runner_needs_the_standard_library_only(module):
    with open(module.__file__, encoding="utf-8") as file:
        tree = ast.parse(file.read())
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "." for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} <= sys.stdlib_module_names


def test_an_executive_that_breaks_the_protocol_is_told_so():
    for command, fault in (
        ("true {plan}", "it has exited"),
        ("echo {plan}", "expected one JSON object"),
        ("""echo '{"kind": "wake", "time": null}' '{plan}'""", "expected one JSON object"),
    ):
        (found,) = examined(command, "completion")
        assert fault in found


def test_what_is_open_again_after_a_failure_gets_its_value_later():
    """With the one that it had, what was executed is excluded."""
    plan = {"events": [{"name": "first"}, {"name": "other", "guard": {"x": "b"}}]}
    told = [
        {"kind": "executed", "event": "first", "time": "0"},
        {"kind": "chosen", "choice": "x", "value": "a"},
        {"kind": "resumed", "released": ["x"]},
        {"kind": "chosen", "choice": "x", "value": "b"},
        {"kind": "executed", "event": "other", "time": "0"},
        {"kind": "succeeded"},
    ]

    def faults(lines):
        trace = suite.Trace([(0, line) for line in lines], [0], outcome="succeeded")
        return list(suite.faults({"outcome": ["succeeded"]}, plan, trace))

    assert faults(told) == []
    assert faults([*told[:2], *told[3:]]) == ["x has two values"]
    assert faults([*told[:3], *told[4:]]) == ["other was executed, which {} excludes"]


def test_plans_that_were_counted_are_cases(tmp_path, monkeypatch):
    """One with a correct execution and one without; who is glad about all is wrong about that."""
    chosen = dict(islice(counted.plans(), 2))
    monkeypatch.setattr(counted, "plans", lambda _families: chosen.items())
    counted.write(tmp_path, counted.FAMILIES)
    found = suite.cases("core", None, tmp_path)
    assert [case["name"] for case in found] == sorted(chosen)
    for case in found:
        assert suite.examine(EXECUTIVE, case, 60, tmp_path) == []
    assert [case["outcome"] for case in found] == [["succeeded", "failed"], ["failed"]]
    glad = shlex.join([sys.executable, mutants.__file__, "glad"])
    assert suite.examine(f"{glad} {EXECUTIVE}", found[1], 60, tmp_path)


def test_plans_are_those_that_were_counted():
    with counted.COUNTS.open(encoding="utf-8", newline="") as file:
        rows = {row["plan"]: row for row in csv.DictReader(file)}
    assert sum(row["exists"] == "true" for name, row in rows.items() if "random" <= name < "random-500") == 85
    complete = Counter(name.split("-")[0] for name, row in rows.items() if row["answers"] in counted.COMPLETE)
    assert (complete["random"], complete["few"]) == (counted.RANDOM, counted.CHOSEN)
    agreed = (each for each in counted.plans() if rows[each[0]]["answers"] == "5/5/3")
    for name, instance in islice(agreed, often(2, 200)):
        assert rows[name]["digest"] == counted.digest(instance)
        found = counted.answers(instance.plan(), 20)
        assert found.agree
        assert {**rows[name], **found.row} == rows[name]
