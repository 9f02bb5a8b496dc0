"""`robust envelope` as a process, and what it answered."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.bench import process
from robust.bench.process import Measured, Processes
from robust.errors import InputError
from robust.irr.box import Interval, Side
from robust.numbers import parse_number

Intervals = Mapping[str, Interval]


class Outcome(Enum):
    """How a run ended; ERROR is any end without a readable answer, UNSUPPORTED is for elimination back ends only."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    INVALID = "invalid"
    ERROR = "error"
    UNSUPPORTED = "unsupported"


@dataclass(frozen=True, slots=True)
class EnvelopeRun:
    """One process: its cost, and its answer where there is one.

    `seconds` is the wall time of the whole process, `cpu_s` its processor time; `search_s` and `first_widening_s` count
    from the start of the search, as the process itself reported them. `message` explains ERROR and INVALID.
    """

    outcome: Outcome
    seconds: float
    cpu_s: float
    memory_mb: float
    checks: int | None = None
    queries: int | None = None
    search_s: float | None = None
    first_widening_s: float | None = None
    box: Intervals = field(default_factory=dict)
    message: str | None = None
    convergence: tuple[tuple[int, float], ...] = ()
    """After each check, the total width as a share of the final one; empty if that is zero or infinite."""

    @property
    def first_widening_wall_s(self) -> float | None:
        """Seconds from the start of the process to the first wider box, at most: the end of the process counts too."""
        if self.first_widening_s is None or self.search_s is None:
            return None
        return self.seconds - self.search_s + self.first_widening_s

    @property
    def text(self) -> str:
        """How the run ended, for people."""
        return f"{self.outcome.value}: {self.message}" if self.message else str(self.outcome.value)

    def as_dict(self) -> dict[str, Any]:
        return {
            "status": self.outcome.value,
            "seconds": round(self.seconds, 4),
            "cpu_s": round(self.cpu_s, 4),
            "memory_mb": round(self.memory_mb, 1),
            "checks": self.checks,
            "queries": self.queries,
            "search_s": self.search_s,
            "first_widening_s": self.first_widening_s,
            "first_widening_wall_s": _rounded(self.first_widening_wall_s),
            "box": box_as_dict(self.box),
            "message": self.message,
        }


def run_envelope(
    processes: Processes,
    files: tuple[Path, Path, Path],
    options: Sequence[str],
    *,
    limit: float | None = None,
) -> EnvelopeRun:
    """Run `robust envelope DOMAIN PROBLEM PLAN OPTIONS --json` and read its answer."""
    command = [*process.COMMAND, "envelope", *(str(path.resolve()) for path in files), *options, "--json"]
    return read_run(processes.run(command, limit=limit))


def read_run(measured: Measured) -> EnvelopeRun:
    """The answer of a process that has ended; anything but an answer becomes ERROR with the reason."""
    cost = (measured.seconds, measured.cpu_s, measured.memory_mb)
    if measured.timed_out:
        return EnvelopeRun(Outcome.TIMEOUT, *cost)
    if not measured.stdout.strip():
        return EnvelopeRun(Outcome.ERROR, *cost, message=measured.last_error)
    try:
        answer = json.loads(measured.stdout)
        if "error" in answer:
            return EnvelopeRun(Outcome.ERROR, *cost, message=answer["error"]["message"])
        return EnvelopeRun(
            Outcome(answer["status"]),
            *cost,
            checks=answer["checks"],
            queries=_queries(answer),
            search_s=answer["seconds"],
            first_widening_s=answer["first_widening_s"],
            box={name: _interval(ends) for name, ends in answer["parameters"].items()},
            message=answer.get("reason"),
            convergence=tuple((int(one["check"]), float(one["share"])) for one in answer.get("convergence") or ()),
        )
    except (ValueError, KeyError, TypeError, AttributeError, InputError) as error:
        message = f"the answer is not that of `robust envelope --json` ({type(error).__name__}: {error})"
        return EnvelopeRun(Outcome.ERROR, *cost, message=message)


def _queries(answer: Mapping[str, Any]) -> int | None:
    statistics = answer.get("statistics")
    return statistics.get("queries") if isinstance(statistics, dict) else answer.get("queries")


def _interval(ends: Mapping[str, Any]) -> Interval:
    return Interval(
        parse_end(ends["lower"]),
        parse_end(ends["upper"]),
        lower_closed=bool(ends.get("lower_closed", True)),
        upper_closed=bool(ends.get("upper_closed", True)),
    )


def parse_end(text: str) -> Fraction | None:
    """The end of an interval: a number, or None for an infinite one."""
    return None if text in {"inf", "+inf", "-inf"} else parse_number(text)


def side_text(interval: Interval, side: Side) -> str:
    """One end of an interval, exactly: `7/4`, `7/4 (open)`, `inf`; equal ends have equal texts."""
    upper = side is Side.UPPER
    end = interval.upper if upper else interval.lower
    if end is None:
        return "inf" if upper else "-inf"
    closed = interval.upper_closed if upper else interval.lower_closed
    return str(end) if closed else f"{end} (open)"


def box_as_dict(box: Intervals) -> dict[str, list[str]]:
    return {name: [side_text(interval, Side.LOWER), side_text(interval, Side.UPPER)] for name, interval in box.items()}


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 4)
