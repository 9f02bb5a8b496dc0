"""What the comparisons run: methods and back ends as command lines, and what each process answered."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robust.bench import process
from robust.bench.process import Measured, Processes
from robust.bench.run import EnvelopeRun, Outcome, run_envelope
from robust.errors import RobustError
from robust.qe.region import Region

BACKENDS = ("project", "z3", "cvc5", "fourier-motzkin", "loos-weispfenning")
"""The elimination back ends that are compared; each has another idea behind it."""

_UNSUPPORTED = 4


@dataclass(frozen=True, slots=True)
class RegionRun:
    """One process of `robust region`: its cost, and its answer where there is one.

    `region` is the exact envelope, and None unless the run is COMPLETE; `search_s` is what the process itself reported.
    """

    outcome: Outcome
    seconds: float
    cpu_s: float
    memory_mb: float
    search_s: float | None = None
    region: Region | None = None
    message: str | None = None

    @property
    def polyhedra(self) -> int | None:
        """How many polyhedra the answer consists of."""
        return None if self.region is None else len(self.region.pieces) + (self.region.base is not None)

    @property
    def text(self) -> str:
        """How the run ended, for people."""
        return f"{self.outcome.value}: {self.message}" if self.message else str(self.outcome.value)


@dataclass(frozen=True, slots=True)
class CheckRun:
    """One process of `robust check`: its cost, and its verdict where there is one; COMPLETE is proved or refuted."""

    outcome: Outcome
    seconds: float
    cpu_s: float
    memory_mb: float
    search_s: float | None = None
    verdict: str | None = None
    message: str | None = None

    @property
    def proved(self) -> bool | None:
        """Whether the plan is valid for all the values; None if that is not known."""
        return {"proved": True, "refuted": False}.get(self.verdict or "")

    @property
    def text(self) -> str:
        """The verdict, or how the run ended, for people."""
        return self.verdict or (f"{self.outcome.value}: {self.message}" if self.message else str(self.outcome.value))


Run = EnvelopeRun | RegionRun | CheckRun


def cost_as_dict(run: Run) -> dict[str, Any]:
    """What all runs have in common."""
    return {
        "status": run.outcome.value,
        "seconds": round(run.seconds, 4),
        "cpu_s": round(run.cpu_s, 4),
        "memory_mb": round(run.memory_mb, 1),
        "search_s": run.search_s,
        "message": run.message,
    }


@dataclass(frozen=True, slots=True)
class Contender:
    """A way to an envelope: the verb and the options of the command line."""

    name: str
    label: str
    verb: str
    options: tuple[str, ...]

    def run(
        self,
        processes: Processes,
        files: tuple[Path, Path, Path],
        *,
        limit: float | None = None,
        extra: Sequence[str] = (),
    ) -> Run:
        """Run the command on the files as a process of its own."""
        if self.verb == "envelope":
            return run_envelope(processes, files, [*self.options, *extra], limit=limit)
        if self.verb == "check":
            return run_check(processes, files, [*self.options, *extra], limit=limit)
        return run_region(processes, files, [*self.options, *extra], limit=limit)


IRR = Contender("irr", "IRR", "envelope", ("--method", "irr", "--beta", "1", "--doubling"))
WIDEN = Contender("widen", "exact widening", "envelope", ("--method", "widen"))
OPTIMAL = Contender("optimal", "optimal box", "envelope", ("--method", "optimal"))
RECORDED_BOX = Contender("recorded-box", "recorded IRR box, checked", "check", ())
"""Not a way to an envelope: a proof that the recorded box is inside it, which needs no region."""

REGIONS = tuple(
    Contender(name, f"region, {name}", "region", ("--backend", name, "--form", "difference")) for name in BACKENDS
)
"""The form is the one in which the region is computed: turning it into another would be measured as well."""


def run_region(
    processes: Processes,
    files: tuple[Path, Path, Path],
    options: Sequence[str],
    *,
    limit: float | None = None,
) -> RegionRun:
    """Run `robust region DOMAIN PROBLEM PLAN OPTIONS --json` and read its answer."""
    command = [*process.COMMAND, "region", *(str(path.resolve()) for path in files), *options, "--json"]
    return read_region_run(processes.run(command, limit=limit))


def read_region_run(measured: Measured) -> RegionRun:
    """The answer of a process that has ended; anything but an answer becomes ERROR with the reason."""
    cost = (measured.seconds, measured.cpu_s, measured.memory_mb)
    if measured.timed_out:
        return RegionRun(Outcome.TIMEOUT, *cost)
    if not measured.stdout.strip():
        return RegionRun(Outcome.ERROR, *cost, message=measured.last_error)
    try:
        answer = json.loads(measured.stdout)
        if "error" in answer:
            outcome = Outcome.UNSUPPORTED if measured.exit_code == _UNSUPPORTED else Outcome.ERROR
            return RegionRun(outcome, *cost, message=answer["error"]["message"])
        outcome = Outcome(answer["status"])
        region = Region.from_dict(answer) if outcome is Outcome.COMPLETE else None
        return RegionRun(outcome, *cost, search_s=answer.get("seconds"), region=region, message=answer.get("reason"))
    except (ValueError, KeyError, TypeError, AttributeError, RobustError) as error:
        message = f"the answer is not that of `robust region --json` ({type(error).__name__}: {error})"
        return RegionRun(Outcome.ERROR, *cost, message=message)


def run_check(
    processes: Processes,
    files: tuple[Path, Path, Path],
    options: Sequence[str],
    *,
    limit: float | None = None,
) -> CheckRun:
    """Run `robust check DOMAIN PROBLEM PLAN OPTIONS --json` and read its answer."""
    command = [*process.COMMAND, "check", *(str(path.resolve()) for path in files), *options, "--json"]
    measured = processes.run(command, limit=limit)
    cost = (measured.seconds, measured.cpu_s, measured.memory_mb)
    if measured.timed_out:
        return CheckRun(Outcome.TIMEOUT, *cost)
    try:
        answer = json.loads(measured.stdout)
        if "error" in answer:
            return CheckRun(Outcome.ERROR, *cost, message=answer["error"]["message"])
        verdict = str(answer["verdict"])
        outcome = Outcome.TIMEOUT if verdict == "unknown" else Outcome.COMPLETE
        return CheckRun(outcome, *cost, search_s=answer.get("seconds"), verdict=verdict)
    except (ValueError, KeyError, TypeError):
        return CheckRun(Outcome.ERROR, *cost, message=measured.last_error)
