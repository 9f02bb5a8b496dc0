"""Certificates that are small and cost much: each is refused in little time, with little memory."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robust.certify.verify import FOLDER
from tests.certify import tools
from tests.certify.forgeries import FORMAT, LONGER, NOT_NEGATIVE, over

LARGEST, SECONDS, MEMORY_MB = 100_000, 5, 300


def lines(*more: Any) -> bytes:
    return "".join(
        f"{each if isinstance(each, str) else json.dumps(each, separators=(',', ':'))}\n" for each in more
    ).encode()


def primes(least: int) -> Iterator[int]:
    found = [2]
    for number in range(3, 10**6, 2):
        if all(number % each for each in found if each * each <= number):
            found.append(number)
            if number >= least:
                yield number


def coprime() -> bytes:
    """Sides of a polyhedron, and multiples of them, whose denominators have nothing in common."""
    source = primes(1000)
    bad = [[[["k", f"-1/{next(source)}"], ["", f"1/{next(source)}"]], True] for _ in range(3000)]
    return lines([FORMAT, "region", None], ["bad", bad], ["cycle", [0, 2], [[index, 1] for index in range(3000)]])


def long_numbers() -> bytes:
    """The sum of multiples of one fact each with a thousand digits."""
    factors = [[0, f"{10**998 + 2 * index + 1}/{10**997 * 3 + 7 * index}"] for index in range(1000)]
    return region(["bad", [[[["k", "-1"], ["", "3"]], True]] * 1000], ["cycle", [0, 2], factors])


def region(*more: Any) -> bytes:
    return lines([FORMAT, "region", None], *more)


START: list[Any] = [over("3", "9"), ["orders"], ["schedule", []], ["kept", [[0, 1]], [], [], [], [[0, 1]]]]
BAD: list[Any] = [["bad", [[[["k", "-1"], ["", "3"]], True]]], ["cycle", [0, 2], [[0, 1]]]]
LONG = 3_900_000
"""Bytes: about as many as the checker unpacks of a certificate of that size."""


def filled(before: str, part: str, after: str) -> str:
    """A line with one part again and again."""
    return before + part * ((LONG - len(before) - len(after)) // len(part)) + after


def refuting(part: str, before: str = "[[],[", after: str = "0]]") -> bytes:
    return lines(*START, filled(f'["refute",{before}', part, f"{after}]"))


def cycles() -> bytes:
    """Bad values in one polyhedron after the other, all of them different."""
    pieces = (["bad", [[[["k", "-1"], ["", "3"]], True], [[["k", "1"], ["", str(n)]], True]]] for n in range(1, 35_000))
    return region(*(line for piece in pieces for line in (piece, ["cycle", [0, 2], [[0, 1]]])))


def broken() -> bytes:
    """Another schedule of each."""
    return region(*[BAD[0], ["broken", 1, [[], [["k", "1"]]], [[], [], [], [], []], None], ["refute"]] * 30_000)


def endless() -> bytes:
    """Clauses that follow, each by as many hints as there are."""
    return refuting("[[2],[1],[[0,1]]],", "", "[[],[0]]")


HOSTILE: dict[str, Callable[[], bytes]] = {
    "coprime denominators": coprime,
    "long numbers": long_numbers,
    "a long walk": lambda: region(BAD[0], filled('["cycle",[', "0,1,", "0],[[0,1]]]")),
    "a walk of six million steps": lambda: region(BAD[0], ["cycle", [0, 1] * 3_000_000, [[0, 1]]]),
    "empty lists": lambda: lines([FORMAT, "plan", None], filled("[", "[],", "[]]")),
    "twenty million empty lists": lambda: lines([FORMAT, "plan", None], "[" + "[]," * 20_000_000 + "[]]"),
    "empty objects": lambda: lines([FORMAT, "plan", None], filled("[", "{},", "{}]")),
    "short texts": lambda: lines([FORMAT, "plan", None], filled("[", '"ab",', "0]")),
    "lists in lists": lambda: lines([FORMAT, "plan", None], filled("[", "[[[[[[[]]]]]]],", "[]]")),
    "lists as lemmas": lambda: lines(over("0", "9"), filled('["orders",', "[],", "0]")),
    "deep lists": lambda: lines([FORMAT, "plan", None], filled("", "[", "]")),
    "blank lines": lambda: lines(over("0", "9")) + b"\n" * LONG,
    "a line without end": lambda: lines([FORMAT, "plan", None])[:-1] + b" " * 90_000_000,
    "a huge whole number": lambda: lines(over("0", "9"), filled('["orders",', "9", "]")),
    "whole numbers of 4,000 digits": lambda: lines(
        *START, ["refute", *[[[2], [int("9" * 4000)], [[0, int("7" * 4000)]]]] * 450]
    ),
    "a clause of one literal": lambda: refuting("2,", "[[", "2],[0]]"),
    "one hint again and again": lambda: refuting("0,"),
    "gates again and again": lambda: refuting("[1,0],"),
    "one multiple again and again": lambda: refuting("[0,1],", "[[2],[1],[", "[0,1]]]"),
    "clauses that are true": endless,
    "orders again and again": lambda: lines(over("0", "9"), filled('["orders",', '[1,2,[0],"0",[[0,1]]],', "0]")),
    "a long path": lambda: lines(over("0", "9"), filled('["orders",[1,2,[', "0,1,", '0],"0",[[0,1]]]]')),
    "bad values again and again": lambda: region(*BAD * 56_000),
    "bad values in many polyhedra": cycles,
    "bad schedules": broken,
    "pieces again and again": lambda: region(
        *BAD, ["good"], ["orders"], NOT_NEGATIVE,
        *[["piece", []], ["schedule", []], ["kept", [[2, 1]], [], [], [], [[0, 1]]]] * 50_000,
    ),
    "sums of many terms": lambda: region(filled('["bad",[[[', '["k","1"],', '["k","1"]],true]]]')),
    "many sides": lambda: region(filled('["bad",[', '[[["k","1"]],true],', '[[["k","1"]],true]]]')),
    "a bomb": lambda: b"\0" * 90_000_000,
}  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return [*tools.written(LONGER, tmp_path_factory.mktemp("plan"))]


MEASURE = """import resource, subprocess, sys
ended = subprocess.run(sys.argv[1:], capture_output=True, text=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(ended.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, ended.stdout, ended.stderr)"""
"""In a process of its own: what a child is said to have in memory is not less than what its parent had."""


def cost(content: bytes, directory: Path, files: list[Path]) -> tuple[int, float, float, str]:
    """Exit code, seconds of processor time, megabytes, and what is printed, of one run of the checker."""
    path = directory / "hostile.cert"
    path.write_bytes(content)
    words = [sys.executable, "-I", "-c", MEASURE, sys.executable, "-m", FOLDER.name, str(path), *map(str, files)]
    ended = subprocess.run(words, cwd=FOLDER.parent, capture_output=True, text=True, check=True)
    code, seconds, megabytes, said = ended.stdout.split(maxsplit=3)
    return int(code), float(seconds), float(megabytes), said.strip()


def full(content: bytes) -> bytes:
    """A certificate with as much that is never read as may be unpacked of it."""
    packed = gzip.compress(content)
    return packed + gzip.compress(Random(1).randbytes(max(LARGEST - len(packed) - 100, 0)))


QUICK = {"empty lists", "a walk of six million steps", "coprime denominators", "bad values again and again"}


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in HOSTILE]
)
def test_what_costs_much_is_refused_cheaply(name: str, tmp_path: Path, files: list[Path]) -> None:
    content = full(HOSTILE[name]())
    assert len(content) <= LARGEST
    code, seconds, megabytes, said = cost(content, tmp_path, files)
    assert code in (1, 2, 3, 4)
    assert len(said.splitlines()) == 1
    assert seconds <= SECONDS
    assert megabytes <= MEMORY_MB
