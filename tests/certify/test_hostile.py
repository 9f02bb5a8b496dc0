"""Certificates that are small and cost much: each is refused in little time, with little memory."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import pytest
from sympy import primerange

from robust.certify.verify import FOLDER
from tests.certify import tools
from tests.certify.adversary import LONGER

LARGEST, SECONDS, MEMORY_MB = 100_000, 5, 300
LONG = 3_900_000
"""Bytes: about as many as the checker unpacks of a certificate of that size."""
TABLE = Path(__file__).with_name("data").joinpath("hostile.json").read_text(encoding="utf-8")
TABLE = TABLE.replace("{4000 nines}", "9" * 4000).replace("{4000 sevens}", "7" * 4000)
FIRST = {"box": [["0", True, "9", True]], "narrow": [["3", True, "9", True]]}
BAD: list[Any] = [[[["k", "-1"], ["", "3"]], True]]


def lines(kind: str, *more: Any) -> str:
    """A certificate of JSON, of a text with one part again and again, and of the same lines again and again."""
    first = ["robust/certificate/2", "box" if kind in FIRST else kind.partition(",")[0], FIRST.get(kind)]
    return dumped(first) + ("\n" * (kind != "plan, unended")) + "".join(map(repeated, more))


def dumped(line: Any) -> str:
    return json.dumps(line, separators=(",", ":"))


def repeated(line: Any) -> str:
    if isinstance(line, list):
        return f"{dumped(line)}\n"
    if "lines" in line:
        return "".join(f"{dumped(one)}\n" for one in line["lines"]) * line["times"]
    before, part, after = line["before"], line["part"], line["after"] or ""
    times = line.get("times", (LONG - len(before) - len(after)) // len(part))
    return before + part * times + after + "\n" * (line["after"] is not None)


def coprime() -> str:
    """Sides of a polyhedron, and multiples of them, whose denominators have nothing in common."""
    primes: Iterator[int] = primerange(1000, 10**6)
    bad = [[[["k", f"-1/{next(primes)}"], ["", f"1/{next(primes)}"]], True] for _ in range(3000)]
    return lines("region", ["bad", bad], ["cycle", [0, 2], [[index, 1] for index in range(3000)]])


def long_numbers() -> str:
    """The sum of multiples of one fact each with a thousand digits."""
    factors = [[0, f"{10**998 + 2 * index + 1}/{10**997 * 3 + 7 * index}"] for index in range(1000)]
    return lines("region", ["bad", BAD * 1000], ["cycle", [0, 2], factors])


def cycles() -> str:
    """Bad values in one polyhedron after the other, all of them different."""
    bad = (["bad", [*BAD, [[["k", "1"], ["", str(number)]], True]]] for number in range(1, 35_000))
    return lines("region", *(line for piece in bad for line in (piece, ["cycle", [0, 2], [[0, 1]]])))


HOSTILE: dict[str, Callable[[], str]] = {
    "coprime denominators": coprime,
    "long numbers": long_numbers,
    "bad values in many polyhedra": cycles,
    "a bomb": lambda: "\0" * 90_000_000,
    **{name: partial(lines, *content) for name, content in json.loads(TABLE).items()},
}
QUICK = {"empty lists", "a walk of six million steps", "coprime denominators"}
MEASURE = """import resource, subprocess, sys
ended = subprocess.run(sys.argv[1:], capture_output=True, text=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(ended.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, ended.stdout, ended.stderr)"""
"""In a process of its own: what a child is said to have in memory is not less than what its parent had."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in HOSTILE]
)
def test_what_costs_much_is_refused_cheaply(name: str, tmp_path: Path) -> None:
    """With as much that is never read as may be unpacked of it."""
    packed = gzip.compress(HOSTILE[name]().encode())
    packed += gzip.compress(Random(1).randbytes(max(LARGEST - len(packed) - 100, 0)))
    assert len(packed) <= LARGEST
    path = tools.kept(tmp_path / "hostile.cert", packed)
    words = [sys.executable, "-m", FOLDER.name, path, *map(str, tools.written(LONGER, tmp_path))]
    measured = [sys.executable, "-I", "-c", MEASURE, *words]
    ended = subprocess.run(measured, cwd=FOLDER.parent, capture_output=True, text=True, check=True)
    code, seconds, megabytes, said = ended.stdout.split(maxsplit=3)
    assert code in "1234"
    assert len(said.strip().splitlines()) == 1
    assert float(seconds) <= SECONDS
    assert float(megabytes) <= MEMORY_MB
