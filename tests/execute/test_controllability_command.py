"""`robust envelope --controllability`: verdicts and the controllable part as text and JSON."""

import json

import jsonschema
import pytest

from robust.show.schemas import schema
from tests.cli import inputs
from tests.cli.running import command, example
from tests.execute.plans import durative

FETCH = durative("fetch", ">= 0", "(at start (idle))", "(at end (guest))")
BREW = durative("brew", "2", "(at start (idle))", "(at end (tea))")
DOMAIN = f"(define (domain visit) (:requirements :durative-actions) (:predicates (idle) (guest) (tea)) {FETCH} {BREW})"
PROBLEM = "(define (problem one_guest) (:domain visit) (:init (idle)) (:goal (and (guest) (tea))))"
PLAN = """\
parameter trip default 10 lb 4 ub 20;
durative-action instance f : (fetch);
durative-action instance b : (brew);
c: f.end - f.start in [trip, trip];
c: f.start - .zero in [1, 1];
c: b.end - b.start in [2, 2];
c: f.end - b.end in [LOW, 5];
"""
"""The tea is to be ready when the guest comes, but not long before."""


@pytest.fixture
def visit(tmp_path):
    def write(low="1"):
        return inputs.write(tmp_path, DOMAIN, PROBLEM, PLAN.replace("LOW", low)).files

    return write


def answer_of(*arguments, code=0):
    ended = command("envelope", *arguments, "--json")
    assert (ended.code, ended.err) == (code, "")
    answer = json.loads(ended.out)
    jsonschema.validate(answer, schema("robust/envelope/1"), cls=jsonschema.Draft202012Validator)
    return answer


def test_text_says_what_is_lost_and_why(visit):
    ended = command("envelope", *visit(), "--controllability", "dynamic")
    assert (ended.code, ended.err) == (0, "")
    _, text = ended.out.split("first widening", 1)
    lines = [" ".join(line.split()) for line in text.splitlines()[2:] if line.strip(" ─")]
    assert lines[:2] == [
        "controllable: weakly",
        "not controllable: dynamically; trip as long as 20, trip as short as 4 cannot be met with "
        "c: f.end - b.end in [1, 5] (line 7)",
    ]
    assert lines[2].startswith("not controllable: strongly; no schedule suits all values of trip: ")
    assert lines[3:] == [
        "parameter box dynamically controllable lost below lost above",
        "trip [4, 20] [8, 12] 4 8",
        "no dynamically controllable part of the box contains this one; 75.0% of the total width is lost.",
    ]


def test_json(visit):
    answer = answer_of(*visit(), "--controllability", "dynamic")
    assert (answer["parameters"]["trip"]["lower"], answer["parameters"]["trip"]["upper"]) == ("4", "20")
    found = answer["controllability"]
    assert [found[kind]["verdict"] for kind in ("weak", "dynamic", "strong")] == [
        "controllable", "not controllable", "not controllable",
    ]  # fmt: skip
    assert (found["wanted"], found["lost_share"], found["failure"], found["waits"]) == ("dynamic", "3/4", None, [])
    assert found["parameters"]["trip"] == {
        "lower": "8", "upper": "12", "lower_closed": True, "upper_closed": True, "lost_below": "4", "lost_above": "8",
    }  # fmt: skip


def test_waits_are_shown(visit):
    plan = visit("-3")
    found = answer_of(*plan, "--controllability", "dynamic")["controllability"]
    assert found["parameters"]["trip"]["lost_above"] == found["parameters"]["trip"]["lost_below"] == "0"
    assert found["waits"] == ["b.start waits for f.end, at most 13 after f.start"]
    shown = command("envelope", *plan, "--controllability", "dynamic").out.splitlines()
    assert shown[-1] == found["waits"][0]
    quiet = command("envelope", *plan, "--controllability", "dynamic", "--quiet").out.splitlines()
    assert quiet[-3:] == ["controllable: weakly", "controllable: dynamically", "not controllable: strongly"]


def test_what_is_wanted_decides_the_part():
    lower = {}
    for kind in ("weak", "dynamic", "strong"):
        found = answer_of(*example(), "--controllability", kind)["controllability"]
        lower[kind] = found["parameters"]["to_ridge"]["lower"]
    assert lower == {"weak": "25", "dynamic": "25", "strong": "30"}


def test_nothing_is_said_unless_asked():
    assert "controllability" not in answer_of(*example())
    assert "controllable" not in command("envelope", *example()).out


def test_an_invalid_plan_has_no_verdict():
    asked = (*example("plan-flexible-wait.stn"), "--controllability", "dynamic")
    answer = answer_of(*asked, code=1)
    assert (answer["status"], answer["controllability"]) == ("invalid", None)
    assert "controllable" not in command("envelope", *asked).out


def test_an_unknown_kind_is_refused():
    ended = command("envelope", *example(), "--controllability", "medium")
    assert ended.code == 2
    assert "medium" in ended.err
