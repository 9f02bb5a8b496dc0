"""What a claim is about: nothing without a meaning is claimed, and all that a claim rests on is said."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robust.certify.checker import reader
from robust.certify.tape import good_lines, header
from robust.errors import RefutedError, RobustError
from robust.pike_bridge.action_model import load_team_plan
from robust.qe.box import Box
from robust.smt.limits import Deadline
from tests.certify import networks, tools
from tests.certify.adversary import BESIDE, PLAIN
from tests.certify.texts import Texts

DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g) (h) (unset))
 (:durative-action a :parameters () :duration (and (>= ?duration 1) (<= ?duration 2)) :condition ()
  :effect (and {})))"""
PROBLEM = "(define (problem x) (:domain d) (:init (p) (= (f) 0) (= (g) 1) (= (h) 0)) (:goal (and)))"
ONE = "durative-action instance i : (a); c: i.start - .zero in [1, 1]; c: i.end - i.start in [1, 2];"
TWO = ONE + "durative-action instance j : (a); c: j.start - i.start in [{0}, {0}]; c: j.end - j.start in [1, 2];"


def claim(effects: str, epsilon: Fraction = tools.EPSILON, plan: str = ONE) -> Any:
    """What the checker says of the certificate that is as honest as one can be."""
    ground = reader.ground(DOMAIN.format(effects), PROBLEM, plan)
    lines = good_lines(ground, epsilon, Box({}), solver="z3", deadline=Deadline.after(60))
    return tools.judged([header("plan"), *lines], ground, epsilon=epsilon)


UNDEFINED = """
(at end (assign (f) (unset)))
(at end (increase (f) (unset)))
(at end (increase (unset) 1))
(at end (assign (unset) 1))
(at end (assign (f) (/ 1 (h))))
(at end (increase (f) (/ (g) 0)))
(at end (scale-down (f) (- 1 (g))))
(at end (when (q) (assign (f) (/ 1 0))))
(at end (when (not (p)) (increase (f) (unset))))
(at end (when (> (unset) 1) (q)))
(when (at end (= (/ 1 (h)) 1)) (at end (not (q))))
(increase (unset) (* #t 1))
(increase (f) (* #t (/ 1 (h))))
(at start (assign (f) 1)) (at start (assign (f) 2))
(at end (assign (f) 1)) (at end (increase (f) 2))
(at end (scale-up (f) 2)) (at end (decrease (f) 2))
(at end (when (= 1 1) (assign (f) 1))) (at end (when (= 1 1) (assign (f) 1)))
"""
"""Effects of which nothing reads what they change, and which have no meaning."""


@pytest.mark.parametrize("effect", UNDEFINED.strip().splitlines())
@pytest.mark.parametrize("epsilon", [Fraction(0), tools.EPSILON])
def test_effects_that_nothing_reads_have_a_meaning(effect: str, epsilon: Fraction) -> None:
    with pytest.raises((reader.Unsupported, RefutedError)):
        claim(effect, epsilon)
    texts = Texts(DOMAIN.format(effect), PROBLEM, ONE)
    if "0)" in effect:  # a division by zero is refused where it is read
        with pytest.raises(reader.Unsupported):
            reader.ground(*texts)
        return
    ground = reader.ground(*texts)
    kept: list[Any] = ["kept", *[[] for _ in ground.edges]]
    times = [[["", "1"]], [["", "2"]]]
    for refuted in range(5):
        for schedule in (times, times[1:], []):
            refutations = [["refute", [[], [0, [1, 0]]]]] * refuted
            forged = [header("plan"), ["orders"], ["schedule", *schedule], kept, *refutations]
            assert isinstance(tools.judged(forged, ground, epsilon=epsilon), str)


@pytest.mark.parametrize("conditions", [("(p)", "(p)"), ("(p)", "(not (q))"), ("(>= (g) 1)", "(and)"), ("(p)", "(q)")])
def test_two_changes_in_one_happening_are_a_conflict(conditions: tuple[str, str]) -> None:
    """Whether they are in force together is an obligation of its own."""
    effects = [f"(at end (when {condition} (assign (f) {value})))" for value, condition in enumerate(conditions)]
    if conditions == ("(p)", "(q)"):  # never
        assert not isinstance(claim(" ".join(effects)), str)
    else:
        with pytest.raises((RefutedError, reader.Unsupported)):
            claim(" ".join(effects))


@pytest.mark.parametrize("effect", ["(at start (assign (f) 1))", "(at start (q)) (at end (not (q)))"])
def test_without_a_separation_two_points_are_still_at_two_times(effect: str) -> None:
    """With epsilon 0, time points that are mutex never coincide."""
    for away, holds in (("0", "assign" not in effect), ("1/1000000", True), ("1", "assign" in effect)):
        plan = TWO.format(away).replace("[1, 2]", "[1, 1]")
        if holds:
            assert not isinstance(claim(effect, Fraction(0), plan), str)
        else:
            with pytest.raises(RefutedError):
                claim(effect, Fraction(0), plan)


# -- what the claim says -----------------------------------------------------------------------------------------------

LASTING = Texts(
    "(define (domain d) (:durative-action d :parameters () :duration (= ?duration 10) :condition () :effect ()))",
    PLAIN.problem,
    "parameter k default 5 lb 0; durative-action instance i : (d); c: i.end - i.start in [k, k];",
)


@pytest.mark.parametrize(
    ("texts", "beside", "said"),
    [
        (*BESIDE, ", where x is (f) (1 in the problem), epsilon"),
        (LASTING, '[parameters.k]\nduration = "i"\n', ", where k is the duration of i (10 in the domain), epsilon"),
    ],
)
def test_the_claim_says_what_parameters_stand_for(texts: Texts, beside: str, said: str, tmp_path: Path) -> None:
    files = tools.written(texts, tmp_path)
    files[2].with_suffix(".toml").write_text(beside, encoding="utf-8")
    code, answer = tools.command(tools.made(files, "plan"), tmp_path / "cert", files)
    assert code == 0
    assert said in answer["claim"]


def test_the_claim_names_files_that_the_network_names(tmp_path: Path) -> None:
    path = networks.files(tmp_path, networks.patched({"domain": "./domain.pddl"}))
    code, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    assert code == 0
    assert ", of domain './domain.pddl' and problem 'problem.pddl', epsilon = 1/1000" in answer["claim"]


@pytest.mark.parametrize(
    "value",
    ["a\nestablished: all", "a\x1b[2K\x1b[1Aestablished", "a\x7f", "a\u2028b", "a\u202eb", "a, e9 at 7", "ä\ud800"],
)
@pytest.mark.parametrize("old", ['"x"', '"a"', '"e2"', '"small"', '"domain.pddl"'])
def test_names_never_reach_a_terminal_as_they_are(value: str, old: str, tmp_path: Path) -> None:
    """One line of ASCII, in which a name that could be taken for something else is quoted."""
    path = networks.files(tmp_path, json.dumps(networks.DOCUMENT).replace(old, json.dumps(value)))
    _, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    said = answer.get("claim") or answer["reason"]
    assert said.isascii()
    assert said.isprintable()
    assert value not in said or f"{value}'" in said


# -- plans with choices ------------------------------------------------------------------------------------------------


def test_networks_that_this_package_refuses(tmp_path: Path) -> None:
    """Nothing is proved of them, nor of others that the checker does not know."""
    for kind in ("refused", "unknown"):
        for number, changes in enumerate(networks.TABLES[kind]):
            path = networks.files(tmp_path / f"{kind}-{number}", networks.patched(changes))
            if kind == "refused":
                with pytest.raises(RobustError):
                    load_team_plan(path)
            assert tools.command(networks.OUT_OF_NOTHING, tmp_path / "cert", [path])[0] == 4, changes
            code = tools.command(networks.EXECUTION, tmp_path / "cert", [path])[0]
            assert code in ((1, 4) if kind == "refused" else (4,)), changes


def spoilt(seed: int, directory: Path) -> Path:
    """A random network with some of its members exchanged."""
    random = Random(seed)
    path = networks.random_network(seed, directory)
    document = json.loads(path.read_text(encoding="utf-8"))
    events = [event["name"] for event in document["events"]]
    document["choices"].append({"name": "y", "domain": ["1", "2"], "controllable": True, "at": random.choice(events)})
    for _ in range(random.choice([1, 1, 2])):
        member = random.choice(document[random.choice(["choices", "events", "constraints", "activities"])])
        key = random.choice(sorted(member))
        guard = random.choice([{}, {"x": "1"}, {"x": "2"}, {"y": "1"}, {"x": "1", "y": "1"}, {"x": "3"}, {"z": "1"}])
        member[key] = random.choice(
            {
                "at": [*events, "e_initial", "nowhere"], "from": [*events, "e_goal"], "to": [*events, "e_initial"],
                "guard": [guard], "lower": [0, 1, 2, -1, "5/2", None], "upper": [0, 2, None, "1/2", -1, "x"],
            }.get(key, [member[key], member[key], "", 1, True, None])
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
