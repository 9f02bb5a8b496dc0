"""What the checker needs in memory, whatever it is given: measured by the system, from outside."""

import gzip
import json
import os
import subprocess
import sys
from itertools import chain, count, cycle, repeat
from subprocess import PIPE, STDOUT

import pytest

from robust.certify.verify import checker_path

MOST = 1 << 30  # bytes
LENGTH = 100 << 20  # bytes, of a greedy certificate
KNOWLEDGE = {"format": "robust/certificate/1", "kind": "knowledge", "inputs": {}}
POLYHEDRA = {**KNOWLEDGE, "kind": "region", "parameters": [["p", None, None]], "encoding": "relational"}
LITERALS = [["a", [[1, "x"]], False], ["a", [[-1, "x"], [-1]], False]]
ABOUT_P = [["a", [[1, "p"]], False], ["a", [[-1, "p"], [-1]], False]]
POINTS = [["point", "start"], ["point", "end"]]
EMPTY = [
    ["outside", [[[[1, "p"]], False], [[[-1, "p"], [-1]], False]]],
    ["obligation", "none"],
    ["root", 1, "w", 0],
    ["root", 2, "w", 1],
    ["qed", [0, 1, -1]],
]

GREEDY = {
    "nodes": (KNOWLEDGE, [], (["a", [[1, f"x{number}"]], True] for number in count())),
    "wide nodes": (KNOWLEDGE, [], (["a", [[1, f"{n}x{k}"] for k in range(999)], True] for n in count())),
    "great numbers": (KNOWLEDGE, [], (["a", [["9" * 4000 + f"/{number + 7}", "x"]], True] for number in count())),
    "conjunctions": (KNOWLEDGE, LITERALS, repeat(["g", [1, -2] * 500])),
    "empty conjunctions": (KNOWLEDGE, [], repeat(["g", []])),
    "lemmas": (KNOWLEDGE, LITERALS, repeat(["lemma", [-1, -2], [1, 1]])),
    "clauses": (
        KNOWLEDGE,
        [["g", []], ["obligation", "correct execution"], ["root", -1, "t"]],
        repeat(["derive", [1], [[1, 0], 0]]),
    ),
    "constraints": (POLYHEDRA, POINTS, (["constraint", 1, 2, [[number, "p"]]] for number in count(1))),
    "conditions": (POLYHEDRA, POINTS, (["condition", 1, None, ["h", f"a{number}", True], ""] for number in count())),
    "effects": (POLYHEDRA, POINTS, (["effect", 1, "add", f"a{number}", [], True] for number in count())),
    "rates": (POLYHEDRA, POINTS, (["rate", 1, 2, f"f{number}", [[1]]] for number in count())),
    "folded": (POLYHEDRA, POINTS, (["folded", f"o{number}"] for number in count())),
    "polyhedra": (POLYHEDRA, [*ABOUT_P, ["lemma", [-1, -2], [1, 1]]], cycle(EMPTY)),
}


def greedy(path, name, length=LENGTH):
    """A certificate that goes on for longer than the checker may remember."""
    header, lines, more = GREEDY[name]
    left = length
    with gzip.open(path, "wb", compresslevel=1) as file:
        for line in chain([header], lines, more):
            text = json.dumps(line, separators=(",", ":")).encode() + b"\n"
            left -= file.write(text)
            if left < 0:
                break


def checked(path):
    """What the checker says, with its exit code, and the greatest memory it had."""
    with subprocess.Popen([sys.executable, "-I", checker_path(), path], stdout=PIPE, stderr=STDOUT, text=True) as run:
        said = run.stdout.read()
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    return run.returncode, said, used.ru_maxrss * 1024


def assert_bounded(tmp_path, name):
    path = tmp_path / "greedy.cert"
    greedy(path, name)
    code, said, memory = checked(path)
    assert (code, said.count("\n")) == (1, 1), said
    assert "more work or memory than its size may need" in said
    assert memory < MOST


@pytest.mark.parametrize("name", ["conjunctions", "great numbers"])
def test_memory_is_bounded(tmp_path, name):
    assert_bounded(tmp_path, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", GREEDY)
def test_memory_is_bounded_whatever_is_stated(tmp_path, name):
    assert_bounded(tmp_path, name)


def test_the_system_ends_what_the_count_does_not(tmp_path):
    """With less memory than that, the certificate is rejected, too."""
    path = tmp_path / "greedy.cert"
    greedy(path, "nodes", length=10 << 20)
    limited = f"ulimit -v {60 << 10}; exec {sys.executable} -I {checker_path()} {path}"
    done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    assert "malformed (MemoryError)" in done.stdout
