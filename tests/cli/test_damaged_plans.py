"""Damaged output of planners: one line that names file and line, what was found and what was expected."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.cli.running import assert_one_line, command

DOMAIN = """\
(define (domain delivery)
  (:requirements :typing :durative-actions :fluents)
  (:types place van)
  (:predicates (at ?v - van ?p - place) (rung))
  (:durative-action go :parameters (?v - van ?from ?to - place) :duration (= ?duration 5)
    :condition (at start (at ?v ?from)) :effect (and (at start (not (at ?v ?from))) (at end (at ?v ?to))))
  (:action ring :parameters (?v - van) :precondition () :effect (rung)))
"""
PROBLEM = """\
(define (problem trip) (:domain delivery) (:objects a b c - place v - van)
  (:init (at v a)) (:goal (and (at v c) (rung))))
"""
LOG = """\
; Plan found with metric 11.002
0.000: (go v a b) [5.000]
5.001: (go v b c) [5.000]
10.002: (ring v)
"""
NETWORK = "durative-action instance n0 : (go v a b);\nc: n0.end - n0.start in [5, 5];\n"
REVERSED = "\n".join(reversed(LOG.splitlines())) + "\n"


class Damage(NamedTuple):
    """`old` in the log becomes `new`; all of it if there is no `old`. The message has all of `said`, in this order."""

    name: str
    old: str
    new: str
    said: tuple[str, ...]
    code: int = 2
    file: str = "planner.log"
    verb: str = "check"


STEP = "expected a step such as '12.001: (goto r1 a b) [5.0]', or a comment after ';'"
NUMBER = "expected a number ≥ 0"
BROKEN = "expected a plan that breaks nothing"
NO_STEP = "empty plan: found no step"
SECOND = "5.001: (go v b c) [5.000]"
DAMAGES = (
    Damage("truncated line", " [5.000]\n10.002: (ring v)\n", " [5.0", (":3:1: found '5.001: (go v b c) [5.0'", STEP)),
    Damage("truncated action", "b c) [5.000]\n10.002: (ring v)\n", "b", (":3:1: found '5.001: (go v b'", STEP)),
    Damage("missing bracket", "b c)", "b c", (":3:1: found '5.001: (go v b c [5.000]'", STEP)),
    Damage("missing opening bracket", "(ring", "ring", (":4:1: found '10.002: ring v)'", STEP)),
    Damage("missing square bracket", "[5.000]\n5", "[5.000\n5", (":2:1: found '0.000: (go v a b) [5.000'", STEP)),
    Damage("other brackets", "(go v b c)", "{go v b c}", (":3:1: found '5.001: {go v b c} [5.000]'", STEP)),
    Damage("negative time", "5.001", "-5.001", (":3:1: found time '-5.001'", NUMBER)),
    Damage("negative duration", "[5.000]", "[-5.000]", (":2:20: found duration '-5.000'", NUMBER)),
    Damage("letters in a time", "5.001", "5.o01", (":3:1: found '5.o01' as time", NUMBER)),
    Damage("letters in the first time", "0.000", "O.OOO", (":2:1: found 'O.OOO: (go v a b) [5.000]'", STEP)),
    Damage("letters in a duration", "[5.000]", "[5.00O]", (":2:20: found '5.00O' as duration", NUMBER)),
    Damage("decimal comma", "5.001", "5,001", (":3:1: found '5,001' as time", NUMBER)),
    Damage("no time", "5.001: ", "", (":3:1: found '(go v b c) [5.000]'", STEP)),
    Damage("no colon", "5.001:", "5.001", (":3:1: found '5.001 (go v b c) [5.000]'", STEP)),
    Damage("unknown action", "(go v b", "(gp v b", (":3:1: found action 'gp'", "known are go, ring")),
    Damage("arity", "(go v b c)", "(go v b)", (":3:1: found 'go' with 2 arguments", "(go ?v ?from ?to)")),
    Damage("unknown object", "b c)", "b d)", (":3:1: found 'd'", "expected an object of problem 'trip'")),
    Damage("wrong type", "(go v b", "(go b v", (":3:1: found 'b' of type place", "expected type van for ?v")),
    Damage("empty action", "(ring v)", "()", (":4:10: found an empty action", "expected an action name")),
    Damage("variable", "(ring v)", "(ring ?v)", (":4:10: found '?v'", "expected an action name and objects")),
    Damage("duration too many", "(ring v)", "(ring v) [5]", (":4:1: found 'ring' used as a durative", "domain.pddl:7")),
    Damage("no duration", "c) [5.000]", "c)", (":3:1: found 'go' used as an instantaneous action", "domain.pddl:5")),
    Damage("empty duration", "[5.000]", "[]", (":2:20: found '' as duration", NUMBER)),
    Damage("labelled duration", "[5.000]", "[D:x; C:1]", (":2:20: found 'x' as duration", NUMBER)),
    Damage("empty", "", "", (f":1: {NO_STEP}", STEP)),
    Damage("comments", "", "; Plan found\n; Time 1\n", (f":3: {NO_STEP}", STEP)),
    Damage("prose", "", "Problem unsolvable\n", (f":2: {NO_STEP}", STEP)),
    Damage("prefix without step", "", "[INFO] [1.2] [robot]:\n[INFO] [1.3] [a]: done\n", (f":3: {NO_STEP}", STEP)),
    Damage("headline without steps", "", "TimeTriggeredPlan:\n\n", (f":3: {NO_STEP}", STEP)),
    Damage("headline", "", "TimeTriggeredPlan:\n    0.0: go(v, a b) [5.0]\n", (":2:10: found 'a b'", "action name")),
    Damage("a domain", "", DOMAIN, (NO_STEP, "are the files in the right order?")),
    Damage("last of two plans", "", LOG * 2 + "0: (go v a", (":9:1: found '0: (go v a'", STEP)),
    Damage("CRLF", "", LOG.replace("5.001", "5.x01").replace("\n", "\r\n"), (":3:1: found '5.x01' as time", NUMBER)),
    Damage("tabs", SECOND, "\t5.001:\t(go\tv\tb\td)\t[5.000]", (":3:2: found 'd'", "expected an object")),
    Damage("byte order mark", "", "\ufeff" + LOG.replace("a b)", "a b"), (":2:1: found '0.000: (go v a b [", STEP)),
    Damage("binary", "", "0.000: \0\1", (": found binary data, expected a UTF-8 text file",)),
    Damage("enormous", "5.001", "1e99999999", (":3:1: found '1e99999999'", "expected a number of at most 300 digits")),
    Damage("long duration", "[5.000]", "[1e9]", (":2:1: invalid plan:", "?duration = 1000000000 != 5", BROKEN), 1),
    Damage("short duration", "[5.000]", "[1e-9]", (":2:1: invalid plan:", "would have to change by 5"), 1),
    Damage("too near", "5.001", "5.000000001", (":3:1: invalid plan: found 'separation: n0.end, n1",), 1),
    Damage("NaN", "5.001", "NaN", (":3:1: found 'NaN' as time", NUMBER)),
    Damage("infinite", "[5.000]", "[inf]", (":2:20: found 'inf' as duration", NUMBER)),
    Damage("order", "0.000", "6.001", (":3:1: invalid plan: found 'n1 go: at start (at v b)'", BROKEN), 1),
    Damage("a step twice", SECOND, f"{SECOND}\n{SECOND}", (":4:1: invalid plan: found 'n2 go: at start", BROKEN), 1),
    Damage("a step missing", "10.002: (ring v)\n", "", (": invalid plan: found 'goal: (rung)' broken", BROKEN), 1),
    Damage("rounded too much", "[5.000]", "[5.1]", (":2:1: invalid plan:", ", which --tolerance 0.1 allows"), 1),
    Damage("another domain", "", "0: (fly x) [3]\n", (":1:1: found action 'fly', expected one of domain 'delivery'",)),
    Damage("a network", "", NETWORK, (": found a plan that has a network already", STEP), verb="convert"),
    Damage("named .stn", "", LOG, (":2: found a step", "the name .stn", "rename the file"), file="planner.stn"),
)  # fmt: skip


@pytest.fixture
def answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., object]:
    """Runs a command on this text, as the plan of the domain and problem above."""
    monkeypatch.chdir(tmp_path)
    Path("domain.pddl").write_text(DOMAIN)
    Path("problem.pddl").write_text(PROBLEM)

    def run(verb: str, file: str, text: str | bytes | None, *options: str) -> object:
        if text is not None:
            Path(file).write_bytes(text.encode() if isinstance(text, str) else text)
        return command(verb, "domain.pddl", "problem.pddl", file, *options)

    return run


@pytest.mark.parametrize("damage", DAMAGES, ids=[one.name for one in DAMAGES])
def test_damage_is_named_in_one_line(damage, answer):
    assert damage.old in LOG
    ended = answer(damage.verb, damage.file, LOG.replace(damage.old, damage.new, 1) if damage.old else damage.new)
    assert_one_line(ended, damage.code)
    pattern = ".*".join(map(re.escape, damage.said))
    assert re.fullmatch(f"robust: error: {re.escape(damage.file)}.*?{pattern}.*\n", ended.err), ended.err


def test_files_that_are_none(answer):
    for file, text, said in (
        (".", None, ".: found a directory, expected a readable text file"),
        ("planer.log", None, "planer.log: found no such file, expected a readable text file"),
        (
            "planner.log",
            LOG.encode() + b"; caf\xe9\n",
            "planner.log: found byte 0xe9 in line 5, expected a UTF-8 text file",
        ),
    ):
        ended = answer("check", file, text)
        assert_one_line(ended)
        assert said in ended.err


@pytest.mark.parametrize(
    "text",
    [
        LOG,
        LOG.replace("\n", "\r\n"),
        "\ufeff" + LOG,
        LOG.replace(" ", "\t"),
        REVERSED,
        LOG.replace("10.002", "1e9"),
        LOG.upper(),
        f"Time: (none) so far\n{LOG}",
        f"b (10.0 | 0.5)b (9.0 | 5.5)\nStates: 12 [10%] [20%]\n{LOG}",
    ],
)
def test_what_is_no_damage(text, answer):
    assert answer("check", "planner.log", text).code == 0
    assert answer("check", "planner.log", text, "--timeout", "0.001").code == 0
