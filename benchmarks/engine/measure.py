"""Whole processes of `robust`, as a user runs them: wall time, peak memory, a time limit, and what they answered."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from robust.errors import UNSUPPORTED, RobustError
from robust.json_text import plain
from robust.processes import ProcessEnd
from robust.qe.box import Interval
from robust.qe.region import Region
from robust.sweeps.batch import COMMAND, Ends, complaint, ends_of, measured

Files = tuple[Path, Path, Path]
"""Domain, problem and plan."""
NAMES = ("domain.pddl", "problem.pddl", "plan.stn")
COST = ("status", "seconds", "cpu_s", "memory_mb", "search_s", "message")
"""What all runs have in common."""


def write_files(directory: Path, texts: tuple[str, str, str], names: tuple[str, str, str] = NAMES) -> Files:
    """Write domain, problem and plan into a directory."""
    domain, problem, plan = (directory / name for name in names)
    for path, text in zip((domain, problem, plan), texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return domain, problem, plan


class Ending(Enum):
    """How a run ended; ERROR is any end without a readable answer, UNSUPPORTED is for elimination back ends only."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    INVALID = "invalid"
    ERROR = "error"
    UNSUPPORTED = "unsupported"


FAILURES = frozenset({Ending.ERROR, Ending.INVALID})
"""Being late, or unsupported, is not wrong."""


@dataclass(frozen=True)
class Run:
    """One process of `robust envelope`, `region` or `check`: its cost, and its answer where there is one.

    `seconds` is the wall time of the whole process, `cpu_s` its processor time; `search_s` and `first_widening_s` count
    from the start of the search, as the process itself reported them. `message` explains ERROR and INVALID. A check is
    COMPLETE if it proves or refutes. `region` is the exact envelope, as printed, of a COMPLETE region.
    """

    status: Ending
    seconds: float
    cpu_s: float
    memory_mb: float
    search_s: float | None = None
    message: str | None = None
    checks: int | None = None
    queries: int | None = None
    solver_s: float | None = None
    """The part of the search that was spent in solvers."""
    first_widening_s: float | None = None
    first_widening_wall_s: float | None = None
    """From the start of the process to the first wider box, at most: the end of the process counts too."""
    box: dict[str, Ends] | None = None
    convergence: tuple[tuple[int, float], ...] = ()
    """After each check, the total width as a share of the final one; empty if that is zero or infinite."""
    verdict: str | None = None
    region: dict[str, Any] | None = None
    polyhedra: int | None = None
    unbounded: tuple[str, ...] = ()
    """Directions in which the box has no end, `above a`, `below b`, where somebody asked for them."""
    capped: tuple[str, ...] = ()
    """Directions that nothing but the number in the duration constraint of an action ends."""

    @property
    def complete(self) -> bool:
        return self.status is Ending.COMPLETE

    @property
    def first_widening_cpu_s(self) -> float | None:
        """Processor time to the first wider box, at most."""
        return None if self.first_widening_wall_s is None else min(self.first_widening_wall_s, self.cpu_s)

    @property
    def text(self) -> str:
        """The verdict, or how the run ended, for people."""
        return self.verdict or (f"{self.status.value}: {self.message}" if self.message else str(self.status.value))

    @property
    def line(self) -> str:
        """The same, and how long it took."""
        return f"{self.text}, {self.cpu_s:.2f} s"

    def printed(self, *names: str) -> dict[str, Any]:
        """Some of the fields as JSON."""
        found: dict[str, Any] = plain({name: getattr(self, name) for name in names})
        return found


def run_robust(verb: str, files: Files, options: Sequence[str], *, limit: float | None = None) -> Run:
    """Run `robust VERB DOMAIN PROBLEM PLAN OPTIONS --json` and read its answer."""
    command = [*COMMAND, verb, *(str(path.resolve()) for path in files), *options, "--json"]
    return read_run(verb, measured(command, limit=limit))


def read_run(verb: str, found: ProcessEnd) -> Run:
    """The answer of a process that has ended; anything but an answer becomes ERROR with the reason."""
    cost = (round(found.seconds, 4), round(found.cpu_s, 4), round(found.memory_mb, 1))
    if found.timed_out:
        return Run(Ending.TIMEOUT, *cost)
    if not found.stdout.strip():
        return Run(Ending.ERROR, *cost, message=complaint(found))
    try:
        answer = json.loads(found.stdout)
        if "error" in answer:
            unsupported = verb == "region" and found.exit_code == UNSUPPORTED
            status = Ending.UNSUPPORTED if unsupported else Ending.ERROR
            return Run(status, *cost, message=answer["error"]["message"])
        status, facts = _READERS[verb](answer, found)
        return Run(status, *cost, **facts)
    except (ValueError, KeyError, TypeError, AttributeError, RobustError) as error:
        message = f"the answer is not that of `robust {verb} --json` ({type(error).__name__}: {error})"
        return Run(Ending.ERROR, *cost, message=message)


def _envelope(answer: Mapping[str, Any], found: ProcessEnd) -> tuple[Ending, dict[str, Any]]:
    statistics = answer.get("statistics")
    statistics = statistics if isinstance(statistics, dict) else {"queries": answer.get("queries")}
    search, first = answer["seconds"], answer["first_widening_s"]
    late = None if search is None or first is None else round(found.seconds - search + first, 4)
    return Ending(answer["status"]), {
        "search_s": search,
        "message": answer.get("reason"),
        "checks": answer["checks"],
        "queries": statistics.get("queries"),
        "solver_s": statistics.get("seconds"),
        "first_widening_s": first,
        "first_widening_wall_s": late,
        "box": {name: ends_of(Interval.from_dict(ends)) for name, ends in answer["parameters"].items()},
        "convergence": tuple((int(one["check"]), float(one["share"])) for one in answer.get("convergence") or ()),
    }


def _region(answer: Mapping[str, Any], _: ProcessEnd) -> tuple[Ending, dict[str, Any]]:
    status = Ending(answer["status"])
    facts: dict[str, Any] = {"search_s": answer.get("seconds"), "message": answer.get("reason")}
    if status is Ending.COMPLETE:
        region = Region.from_dict(answer)
        facts |= {"region": answer, "polyhedra": len(region.pieces) + (region.base is not None)}
    return status, facts


def _check(answer: Mapping[str, Any], _: ProcessEnd) -> tuple[Ending, dict[str, Any]]:
    verdict = str(answer["verdict"])
    status = Ending.TIMEOUT if verdict == "unknown" else Ending.COMPLETE
    return status, {"search_s": answer.get("seconds"), "verdict": verdict}


_READERS = {"envelope": _envelope, "region": _region, "check": _check}
