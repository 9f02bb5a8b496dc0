"""What a claim is about: nothing without a meaning is claimed, and all that a claim rests on is said."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robust.certify.checker import reader
from robust.certify.tape import good_lines, header, write
from robust.errors import RefutedError, RobustError
from robust.pike_bridge.action_model import load_team_plan
from robust.qe.box import Box
from robust.smt.limits import Deadline
from tests.certify import forgeries, networks, tools
from tests.certify.texts import Texts

DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g) (h) (unset))
 (:durative-action a :parameters () :duration (and (>= ?duration 1) (<= ?duration 2)) :condition ()
  :effect (and {})))"""
PROBLEM = "(define (problem x) (:domain d) (:init (p) (= (f) 0) (= (g) 1) (= (h) 0)) (:goal (and)))"
ONE = "durative-action instance i : (a); c: i.start - .zero in [1, 1]; c: i.end - i.start in [1, 2];"
TWO = ONE + "durative-action instance j : (a); c: j.start - i.start in [{0}, {0}]; c: j.end - j.start in [1, 2];"


def made(texts: Texts, epsilon: Fraction) -> Any:
    """What the checker says of the certificate that is as honest as one can be."""
    ground = reader.ground(*texts)
    lines = good_lines(ground, epsilon, Box({}), solver="z3", deadline=Deadline.after(60))
    return tools.judged([header("plan"), *lines], ground, epsilon=epsilon)


UNDEFINED = [
    "(at end (assign (f) (unset)))",
    "(at end (increase (f) (unset)))",
    "(at end (increase (unset) 1))",
    "(at end (assign (unset) 1))",
    "(at end (assign (f) (/ 1 (h))))",
    "(at end (increase (f) (/ (g) 0)))",
    "(at end (scale-down (f) (- 1 (g))))",
    "(at end (when (q) (assign (f) (/ 1 0))))",
    "(at end (when (not (p)) (increase (f) (unset))))",
    "(at end (when (> (unset) 1) (q)))",
    "(when (at end (= (/ 1 (h)) 1)) (at end (not (q))))",
    "(increase (unset) (* #t 1))",
    "(increase (f) (* #t (/ 1 (h))))",
    "(at start (assign (f) 1)) (at start (assign (f) 2))",
    "(at end (assign (f) 1)) (at end (increase (f) 2))",
    "(at end (scale-up (f) 2)) (at end (decrease (f) 2))",
    "(at end (when (= 1 1) (assign (f) 1))) (at end (when (= 1 1) (assign (f) 1)))",
]
"""Effects of which nothing reads what they change, and which have no meaning."""


@pytest.mark.parametrize("effect", UNDEFINED)
@pytest.mark.parametrize("epsilon", [Fraction(0), Fraction(1, 1000)])
def test_effects_that_nothing_reads_have_a_meaning(effect: str, epsilon: Fraction) -> None:
    texts = Texts(DOMAIN.format(effect), PROBLEM, ONE)
    with pytest.raises((reader.Unsupported, RefutedError)):
        made(texts, epsilon)
    if "0)" in effect:  # a division by zero is refused where it is read
        with pytest.raises(reader.Unsupported):
            reader.ground(*texts)
        return
    ground = reader.ground(*texts)
    kept: list[Any] = ["kept", *[[] for _ in ground.edges]]
    times = [[["", "1"]], [["", "2"]]]
    for refuted in range(5):
        forged = [header("plan"), ["orders"], ["schedule", *times], kept, *[["refute", [[], [0, [1, 0]]]]] * refuted]
        for schedule in (times, times[1:], []):
            forged[2] = ["schedule", *schedule]
            assert isinstance(tools.judged(forged, ground, epsilon=epsilon), str)


@pytest.mark.parametrize("conditions", [("(p)", "(p)"), ("(p)", "(not (q))"), ("(>= (g) 1)", "(and)")])
def test_two_changes_in_one_happening_are_a_conflict(conditions: tuple[str, str]) -> None:
    """Whether they are in force together is an obligation of its own."""
    effects = [f"(at end (when {condition} (assign (f) {value})))" for value, condition in enumerate(conditions)]
    with pytest.raises((RefutedError, reader.Unsupported)):
        made(Texts(DOMAIN.format(" ".join(effects)), PROBLEM, ONE), tools.EPSILON)
    apart = [f"(at end (when {condition} (assign (f) {value})))" for value, condition in enumerate(["(p)", "(q)"])]
    assert not isinstance(made(Texts(DOMAIN.format(" ".join(apart)), PROBLEM, ONE), tools.EPSILON), str)


@pytest.mark.parametrize("effect", ["(at start (assign (f) 1))", "(at start (q)) (at end (not (q)))"])
def test_without_a_separation_two_points_are_still_at_two_times(effect: str) -> None:
    """With epsilon 0, time points that are mutex never coincide."""
    domain = DOMAIN.format(effect)
    for away, holds in (("0", "assign" not in effect), ("1/1000000", True), ("1", "assign" in effect)):
        texts = Texts(domain, PROBLEM, TWO.format(away).replace("[1, 2]", "[1, 1]"))
        if holds:
            assert not isinstance(made(texts, Fraction(0)), str)
        else:
            with pytest.raises(RefutedError):
                made(texts, Fraction(0))


# -- what the claim says -----------------------------------------------------------------------------------------------


def test_the_claim_says_what_parameters_stand_for(tmp_path: Path) -> None:
    texts = forgeries.BESIDE[0]
    files = tools.written(texts, tmp_path)
    files[2].with_suffix(".toml").write_text(forgeries.BESIDE[1], encoding="utf-8")
    code, answer = tools.command(tools.made(files, "plan"), tmp_path / "cert", files)
    assert code == 0
    assert ", where x is (f) (1 in the problem), epsilon" in answer["claim"]
    domain = (
        "(define (domain d) (:durative-action d :parameters () :duration (= ?duration 10) :condition () :effect ()))"
    )
    plan = "parameter k default 5 lb 0; durative-action instance i : (d); c: i.end - i.start in [k, k];"
    files = tools.written(Texts(domain, forgeries.PLAIN.problem, plan), tmp_path)
    files[2].with_suffix(".toml").write_text('[parameters.k]\nduration = "i"\n', encoding="utf-8")
    code, answer = tools.command(tools.made(files, "plan"), tmp_path / "cert", files)
    assert code == 0
    assert ", where k is the duration of i (10 in the domain), epsilon" in answer["claim"]


def test_the_claim_names_files_that_the_network_names(tmp_path: Path) -> None:
    document = {**networks.document(), "domain": "./domain.pddl"}
    path = networks.files(tmp_path, document, networks.DOMAIN, networks.PROBLEM)
    code, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    assert code == 0
    assert ", of domain './domain.pddl' and problem 'problem.pddl', epsilon = 1/1000" in answer["claim"]


@pytest.mark.parametrize(
    "value",
    ["a\nestablished: all", "a\x1b[2K\x1b[1Aestablished", "a\x7f", "a\u2028b", "a\u202eb", "a, e9 at 7", "ä\ud800"],
)
@pytest.mark.parametrize("where", ["choice", "value", "event", "name", "domain"])
def test_names_never_reach_a_terminal_as_they_are(value: str, where: str, tmp_path: Path) -> None:
    """One line of ASCII, in which a name that could be taken for something else is quoted."""
    text = json.dumps(networks.document())
    old = {"choice": '"x"', "value": '"a"', "event": '"e2"', "name": '"small"', "domain": '"domain.pddl"'}[where]
    path = networks.files(tmp_path, text.replace(old, json.dumps(value)), networks.DOMAIN, networks.PROBLEM)
    _, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    said = answer.get("claim") or answer["reason"]
    assert said.isascii()
    assert said.isprintable()
    assert value not in said or f"{value}'" in said


@pytest.mark.parametrize(
    "box",
    [
        '{"to_ridge": {"lower": "30", "upper": "29"}}',
        '{"to_ridge": {"lower": "30", "upper": "30", "upper_closed": false}}',
        '{"to_ridge": {"lower": "30", "upper": "30", "lower_closed": false}}',
        '{"to_ridge": {"lower": "0", "upper": "99"}, "to_ridge": {"lower": "30", "upper": "30"}}',
        '{"to_ridge": {"lower": NaN, "upper": "30"}}',
        '{"to_ridge": {"lower": "30", "upper": Infinity}}',
        '{"to_ridge": {"lower": 1e400, "upper": "30"}}',
        '{"to_ridge": {"lower": "30"}}',
    ],
)
def test_boxes_that_are_demanded_hold_something(box: str, tmp_path: Path) -> None:
    path = tmp_path / "box.cert"
    write(tools.made(tools.NAVIGATION, "box"), path)
    assert tools.ask(path, tools.NAVIGATION, box='{"to_ridge": {"lower": "30", "upper": "30"}}')[0] == 0
    assert tools.ask(path, tools.NAVIGATION, box=box)[0] != 0


# -- plans with choices ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        lambda one: one["choices"][0].update(at="nowhere"),
        lambda one: one["choices"][0].update(at="e3"),
        lambda one: one["choices"][0].update(at="e2"),
        lambda one: one["choices"][0].update(at="e_initial"),
        lambda one: one["choices"][0].update(name=7),
        lambda one: one["choices"][0].update(controllable=1),
        lambda one: one["choices"][0].update(domain=["a", True]),
        lambda one: (
            one["choices"].append({"name": "y", "domain": ["1"], "controllable": True, "at": "e3"})
            or one["events"].append({"name": "e4", "guard": {"y": "1"}})
        ),
        lambda one: one["events"][0].update(name=1),
        lambda one: one["events"][2].update(guard={"x": 1}),
        lambda one: one["constraints"][0].update(lower=4, upper=3),
        lambda one: one["activities"][0].update(lower=0),
        lambda one: one["activities"][0].update(lower="4", upper="4"),
        lambda one: one["activities"][0].update(agent=7),
        lambda one: one["activities"][0].update(action="go o"),
        lambda one: one["activities"][0].update(to="e_goal"),
        lambda one: one.pop("name"),
        lambda one: one.pop("events"),
        lambda one: one.update(name=""),
    ],
)
def test_networks_that_this_package_refuses(change: Any, tmp_path: Path) -> None:
    document = networks.document()
    change(document)
    path = networks.files(tmp_path, document, networks.DOMAIN, networks.PROBLEM)
    with pytest.raises(RobustError):
        load_team_plan(path)
    assert tools.command(networks.EXECUTION, tmp_path / "cert", [path])[0] in (1, 4)
    assert tools.command(networks.OUT_OF_NOTHING, tmp_path / "cert", [path])[0] == 4


def spoilt(seed: int, directory: Path) -> Path:
    """A random network with some of its members exchanged."""
    random = Random(seed)
    path = networks.random_network(seed, directory)
    document = json.loads(path.read_text(encoding="utf-8"))
    events = [each["name"] for each in document["events"]]
    document["choices"].append({"name": "y", "domain": ["1", "2"], "controllable": True, "at": random.choice(events)})
    for _ in range(random.choice([1, 1, 2])):
        kind = random.choice(["choices", "events", "constraints", "activities"])
        one = random.choice(document[kind])
        key = random.choice(sorted(one))
        guard = random.choice([{}, {"x": "1"}, {"x": "2"}, {"y": "1"}, {"x": "1", "y": "1"}, {"x": "3"}, {"z": "1"}])
        one[key] = random.choice(
            {
                "at": [*events, "e_initial", "nowhere"], "from": [*events, "e_goal"], "to": [*events, "e_initial"],
                "guard": [guard], "lower": [0, 1, 2, -1, "5/2", None], "upper": [0, 2, None, "1/2", -1, "x"],
            }.get(key, [one[key], one[key], "", 1, True, None])
        )  # fmt: skip
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("seeds", [range(120), pytest.param(range(120, 4000), marks=pytest.mark.slow)], ids=str)
def test_whatever_this_package_refuses_the_checker_does_not_know(seeds: range, tmp_path: Path) -> None:
    refused = 0
    for seed in seeds:
        path = spoilt(seed, tmp_path / str(seed))
        try:
            load_team_plan(path)
        except RobustError:
            refused += 1
            with pytest.raises((reader.Unsupported, *tools.MALFORMED)):
                networks.stated(tools.CHECKER, path, None)
    assert refused > len(seeds) / 4
