"""`robust bench figure20a` and `figure21`: compiling random plans with choices by every back end [PIKE §6.2.2].

Every run is a whole process with a limit of its own, from files to the answer. The plans are generated from a seed.
Figure 20a is the time of compilation over the number of candidate subplans; Figure 21 the number
of prime implicants over that of models, for the plans that admit a correct execution.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from robust.bench.batch import Progress, run_batch
from robust.bench.options import check_limit, plotting
from robust.bench.process import COMMAND, Measured, Processes
from robust.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

FIGURES = {"figure20a": "robust/bench-figure20a/1", "figure21": "robust/bench-figure21/1"}
FIGURE20A = FIGURES["figure20a"]
LIMIT = 60.0
INSTANCES = 500
GRACE = 5.0
"""Seconds after its own limit until a process is ended."""
STAGES = ("precedence", "links", "conflicts", "knowledge")


@dataclass(frozen=True, slots=True)
class TeamContender:
    """One way to answer: a command, its options, and a name for the tables."""

    name: str
    command: str
    options: tuple[str, ...]


ORACLE = TeamContender("oracle", "check", ("--backend", "oracle"))
SAT = TeamContender("sat", "check", ("--backend", "sat"))
COMPILED = tuple(TeamContender(backend, "compile", ("--backend", backend)) for backend in ("bdd", "pitms", "atms"))
WHOLE = TeamContender("pitms-whole", "compile", ("--backend", "pitms", "--no-shortcut"))
APSP = TeamContender("pitms-apsp", "compile", ("--backend", "pitms", "--temporal", "apsp"))
CONTENDERS = (ORACLE, SAT, *COMPILED, WHOLE, APSP)


@dataclass(frozen=True, slots=True)
class TeamRun:
    """One contender on one plan. `satisfiable` is None if it did not finish."""

    contender: str
    instance: str
    seconds: float
    memory_mb: float
    satisfiable: bool | None
    stages: Mapping[str, float]
    candidate_subplans: int | None = None
    prime_implicants: int | None = None
    models: int | None = None
    message: str | None = None
    """What went wrong, if it was not the limit."""

    @property
    def solved(self) -> bool:
        return self.satisfiable is not None

    def as_dict(self) -> dict[str, Any]:
        return {
            "contender": self.contender,
            "instance": self.instance,
            "seconds": round(self.seconds, 3),
            "memory_mb": round(self.memory_mb, 1),
            "satisfiable": self.satisfiable,
            "candidate_subplans": self.candidate_subplans,
            "prime_implicants": self.prime_implicants,
            "models": self.models,
            "stages": dict(self.stages),
            "message": self.message,
        }


@dataclass(frozen=True)
class TeamReport:
    """All runs; `complete` is false where Ctrl-C came before the last one."""

    schema: str
    contenders: tuple[TeamContender, ...]
    activities: Mapping[str, int]
    """Of each plan."""
    subplans: Mapping[str, int]
    """The candidate subplans of each plan."""
    runs: tuple[TeamRun, ...]
    complete: bool
    limit: float
    seed: int
    jobs: int

    def of(self, contender: TeamContender) -> list[TeamRun]:
        return [run for run in self.runs if run.contender == contender.name]

    def verdict(self, instance: str) -> bool | None:
        """What those who finished say of a plan; None if nobody did."""
        found = {run.satisfiable for run in self.runs if run.instance == instance} - {None}
        return None if len(found) != 1 else found.pop()

    @property
    def contradicted(self) -> list[str]:
        """Plans on which two contenders differ."""
        names = dict.fromkeys(run.instance for run in self.runs)
        return [
            name for name in names if {run.satisfiable for run in self.runs if run.instance == name} >= {True, False}
        ]

    @property
    def agrees(self) -> bool:
        """Whether everything was run, nothing failed, and nobody contradicts anybody; too late is not wrong."""
        return self.complete and not self.contradicted and all(run.message is None for run in self.runs)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB."""
        return {
            "schema": self.schema,
            "complete": self.complete,
            "agrees": self.agrees,
            "seed": self.seed,
            "limit": self.limit,
            "jobs": self.jobs,
            "contradicted": self.contradicted,
            "plans": [
                {"instance": name, "activities": count, "candidate_subplans": self.subplans[name]}
                for name, count in self.activities.items()
            ],
            "runs": [run.as_dict() for run in self.runs],
        }

    def tables(self) -> Sequence[Table]:
        """Tables for people."""
        from robust.bench.team_tables import figure20a_tables, figure21_tables  # noqa: PLC0415 - not needed for JSON

        return figure20a_tables(self) if self.schema == FIGURE20A else figure21_tables(self)


def chosen(names: Sequence[str]) -> tuple[TeamContender, ...]:
    """The contenders of these names, all without names.

    Raises:
        InputError: if there is no such contender.
    """
    known = {contender.name: contender for contender in CONTENDERS}
    for name in names:
        if name not in known:
            raise InputError(f"--backend: found {name!r}, expected one of {', '.join(known)}")
    return tuple(contender for contender in CONTENDERS if not names or contender.name in names)


def run_team_plans(
    *,
    figure: str,
    contenders: Sequence[TeamContender] = CONTENDERS,
    instances: int = INSTANCES,
    seed: int = 0,
    limit: float | None = LIMIT,
    jobs: int = 1,
    plot: Path | None = None,
    on_result: Progress | None = None,
) -> TeamReport:
    """Generate plans, and let each contender answer each of them.

    Args:
        figure: `figure20a` or `figure21`: what is tabulated and drawn.

    Raises:
        InputError: wrong options.
    """
    check_limit(limit)
    if instances < 1:
        raise InputError(f"instances is {instances}; expected at least 1")
    limit = limit or LIMIT
    drawing = plotting(plot, "robust.bench.team_plots")
    from robust.pike_bridge.generators.random_plans import random_plan  # noqa: PLC0415 - imports the grammar
    from robust.pike_bridge.scenarios import candidate_subplans  # noqa: PLC0415

    with TemporaryDirectory(prefix="robust-") as directory:
        names = [f"random_{seed}_{index:03}" for index in range(instances)]
        activities, subplans = {}, {}
        for index, name in enumerate(names):
            generated = random_plan(seed, index)
            generated.write(Path(directory) / name)
            activities[name] = len(generated.network.activities)
            subplans[name] = candidate_subplans(generated.network)
        work = [(name, contender) for name in names for contender in contenders]

        def one(processes: Processes, index: int) -> TeamRun:
            name, contender = work[index]
            return _run(processes, Path(directory) / name / "plan.tpnu.json", name, contender, limit)

        batch = run_batch(len(work), one, jobs=jobs, describe=_describe, on_result=on_result)
    report = TeamReport(
        FIGURES[figure], tuple(contenders), activities, subplans, batch.results, batch.complete, limit, seed, jobs
    )
    if drawing is not None and plot is not None:
        (drawing.plot_figure20a if report.schema == FIGURE20A else drawing.plot_figure21)(report, plot)
    return report


def _run(processes: Processes, file: Path, name: str, contender: TeamContender, limit: float) -> TeamRun:
    command = (*COMMAND, "pike", contender.command, str(file), *contender.options, "--json", "--timeout", str(limit))
    return _read(processes.run(command, limit=limit + GRACE), name, contender)


def _read(measured: Measured, name: str, contender: TeamContender) -> TeamRun:
    late = measured.timed_out or measured.exit_code == 3
    answer = json.loads(measured.stdout) if measured.stdout and not measured.timed_out else {}
    satisfiable = answer.get("satisfiable")
    if contender.command == "check":
        satisfiable = {"proved": True, "refuted": False}.get(answer.get("verdict", ""))
    return TeamRun(
        contender=contender.name,
        instance=name,
        seconds=measured.seconds,
        memory_mb=measured.memory_mb,
        satisfiable=satisfiable,
        stages=answer.get("seconds", {}),
        candidate_subplans=answer.get("candidate_subplans"),
        prime_implicants=answer.get("prime_implicants"),
        models=answer.get("models"),
        message=None if late or satisfiable is not None else measured.last_error,
    )


def _describe(run: TeamRun) -> str:
    outcome = run.message or "out of time"
    if run.satisfiable is not None:
        outcome = "exists" if run.satisfiable else "none"
    return f"{run.instance}, {run.contender}: {outcome}, {run.seconds:.2f} s"
