"""`robust bench figure20a` and `figure21`: compiling random plans with choices by every back end [PIKE §6.2.2].

Every run is a whole process with a limit of its own, from files to the answer. The plans are generated from a seed.
Figure 20a is the time of compilation over the number of candidate subplans; Figure 21 the number
of prime implicants over that of models, for the plans that admit a correct execution.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import log10
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robust.errors import InputError
from robust.pike_bridge.generators.random_plans import random_plan
from robust.pike_bridge.scenarios import candidate_subplans

from ..catalogue import Figure20aOptions, Figure21Options
from ..engine import measure
from ..engine.experiment import Experiment, Report
from ..engine.show import BLACK, BLUE, COLOURS, Cells, Table, canvas, number, quantile

GRACE = 5.0
"""Seconds after its own limit until a process is ended."""
STAGES = ("precedence", "links", "conflicts", "knowledge", "search")
_OUT_OF_TIME = 3


@dataclass(frozen=True, slots=True)
class TeamContender:
    """One way to answer: a command, its options, and a name for the tables."""

    name: str
    command: str
    options: tuple[str, ...]


CONTENDERS = {
    one.name: one
    for one in (
        TeamContender("oracle", "check", ("--backend", "oracle")),
        TeamContender("sat", "check", ("--backend", "sat")),
        *(TeamContender(backend, "compile", ("--backend", backend)) for backend in ("bdd", "pitms", "atms")),
        TeamContender("pitms-whole", "compile", ("--backend", "pitms", "--no-shortcut")),
        TeamContender("pitms-apsp", "compile", ("--backend", "pitms", "--temporal", "apsp")),
    )
}


@dataclass(frozen=True, slots=True)
class TeamTask:
    """One contender on one plan."""

    seed: int
    index: int
    contender: TeamContender
    limit: float

    @property
    def label(self) -> str:
        return f"{instance_name(self.seed, self.index)}, {self.contender.name}"


@dataclass(frozen=True)
class TeamRun:
    """One contender on one plan. `satisfiable` is None if it did not finish; `message` is what went wrong, if it was
    not the limit."""

    contender: str
    instance: str
    seconds: float
    memory_mb: float
    satisfiable: bool | None
    candidate_subplans: int | None
    prime_implicants: int | None
    models: int | None
    stages: dict[str, float]
    message: str | None

    @property
    def solved(self) -> bool:
        return self.satisfiable is not None


def instance_name(seed: int, index: int) -> str:
    """Of a random plan."""
    return f"random_{seed}_{index:03}"


def run_contender(task: TeamTask) -> TeamRun:
    """Generate the plan, and let the contender answer."""
    contender = task.contender
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        random_plan(task.seed, task.index).write(Path(directory))
        words = ("pike", contender.command, str(Path(directory) / "plan.tpnu.json"), *contender.options)
        command = (*measure.COMMAND, *words, "--json", "--timeout", str(task.limit))
        found = measure.measured(command, limit=task.limit + GRACE)
    answer = json.loads(found.stdout) if found.stdout and not found.timed_out else {}
    satisfiable = answer.get("satisfiable")
    if contender.command == "check":
        satisfiable = {"proved": True, "refuted": False}.get(answer.get("verdict", ""))
    late = found.timed_out or found.exit_code == _OUT_OF_TIME
    return TeamRun(
        contender=contender.name,
        instance=instance_name(task.seed, task.index),
        seconds=round(found.seconds, 3),
        memory_mb=found.memory_mb,
        satisfiable=satisfiable,
        candidate_subplans=answer.get("candidate_subplans"),
        prime_implicants=answer.get("prime_implicants"),
        models=answer.get("models"),
        stages=answer.get("seconds", {}),
        message=None if late or satisfiable is not None else found.last_error,
    )


@dataclass(frozen=True, slots=True)
class TeamPlanSize:
    """One of the plans."""

    instance: str
    activities: int
    candidate_subplans: int


@dataclass(frozen=True, slots=True)
class TeamPlans:
    """All of them."""

    plans: tuple[TeamPlanSize, ...]


class TeamReport(Report[TeamRun]):
    """All runs."""

    SETTINGS: ClassVar[Mapping[str, str]] = {"seed": "seed", "limit": "limit", "jobs": "jobs"}
    ROWS = "runs"
    ROW = TeamRun
    FACTS = TeamPlans
    NOTED = False

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        ran = tuple(dict.fromkeys(run["contender"] for run in answer["runs"]))
        return {**super().read_options(answer), "backends": ran}

    @property
    def contenders(self) -> list[str]:
        """By name, in the order of all."""
        return [name for name in CONTENDERS if not self.options.backends or name in self.options.backends]

    @property
    def plans(self) -> tuple[TeamPlanSize, ...]:
        plans: tuple[TeamPlanSize, ...] = self.facts.plans
        return plans

    @cached_property
    def subplans(self) -> dict[str, int]:
        """The candidate subplans of each plan."""
        return {plan.instance: plan.candidate_subplans for plan in self.plans}

    def of(self, contender: str) -> list[TeamRun]:
        return [run for run in self.rows if run.contender == contender]

    @cached_property
    def _verdicts(self) -> dict[str, set[bool | None]]:
        found: dict[str, set[bool | None]] = {plan.instance: set() for plan in self.plans}
        for run in self.rows:
            found[run.instance].add(run.satisfiable)
        return {name: verdicts - {None} for name, verdicts in found.items()}

    @property
    def contradicted(self) -> list[str]:
        """Plans on which two contenders differ."""
        return [name for name, verdicts in self._verdicts.items() if len(verdicts) > 1]

    @property
    def agrees(self) -> bool:
        """Whether everything was run, nothing failed, and nobody contradicts anybody; too late is not wrong."""
        return self.complete and not self.contradicted and all(run.message is None for run in self.rows)

    @property
    def findings(self) -> Mapping[str, Any]:
        return {"contradicted": self.contradicted}

    @property
    def notes(self) -> tuple[str, ...]:
        activities = [plan.activities for plan in self.plans]
        decided = [verdicts for verdicts in self._verdicts.values() if len(verdicts) == 1]
        lines = [
            f"{len(activities)} plans of seed {self.options.seed}: {mean(activities):.1f} activities on average, "
            f"{max(activities)} at most; {sum(True in one for one in decided)} of {len(decided)} decided ones admit a "
            "correct execution",
            f"seconds of whole processes on this machine, stopped at {self.options.limit:g} s",
        ]
        if self.contradicted:
            lines.append(f"contradicting answers: {', '.join(self.contradicted)}")
        failures = dict.fromkeys(f"{run.contender}, {run.instance}: {run.message}" for run in self.rows if run.message)
        lines += [*list(failures)[:5], *self.jobs_notes]
        if not self.complete:
            lines.append("incomplete: interrupted")
        return tuple(lines)

    @property
    def solved(self) -> Table:
        """How many plans each contender decided, and the seconds of whole processes that did."""
        rows: list[Cells] = []
        for name in self.contenders:
            runs = self.of(name)
            times = sorted(run.seconds for run in runs if run.solved)
            rows.append(
                (
                    name,
                    str(len(times)),
                    str(len(runs)),
                    number(median(times) if times else None),
                    number(quantile(times, 0.9)),
                    number(times[-1] if times else None),
                    str(len(runs) - len(times)),
                    number(max((run.memory_mb for run in runs), default=None), 0),
                )
            )
        headings = ["back end", "solved", "of", "median, s", "90 %, s", "slowest, s", "out of time", "greatest MiB"]
        return Table("Compilation of random plans with choices", tuple(headings), rows)

    @property
    def stages(self) -> Table:
        """Mean seconds of each stage, over the runs that finished."""
        rows: list[Cells] = []
        for name in self.contenders:
            runs = [run for run in self.of(name) if run.solved]
            told = {stage: [run.stages[stage] for run in runs if stage in run.stages] for stage in STAGES}
            rows.append((name, *(number(mean(found) if found else None, 3) for found in told.values())))
        headings = ("back end", *(f"{stage}, s" for stage in STAGES))
        return Table("Mean seconds by stage, of runs that finished", headings, rows)

    def sizes(self, contender: str) -> Table:
        """By orders of magnitude of the number of candidate subplans [PIKE, Figure 20a]."""
        rows: list[Cells] = []
        low = 1
        while low <= max(self.subplans.values(), default=1):
            runs = [run for run in self.of(contender) if low <= self.subplans[run.instance] < low * 10]
            if runs:
                times = sorted(run.seconds for run in runs if run.solved)
                slowest = (number(median(times)), number(times[-1])) if times else (number(None),) * 2
                rows.append((f"{low:,} to {low * 10 - 1:,}", str(len(runs)), str(len(times)), *slowest))
            low *= 10
        headings = ("candidate subplans", "plans", "solved", "median, s", "slowest, s")
        return Table(f"{contender}: time over candidate subplans", headings, rows)

    @cached_property
    def compact(self) -> list[tuple[int, int]]:
        """Models and prime implicants of each plan that admits a correct execution, where both were counted."""
        found = {run.instance: run for run in reversed(self.rows) if run.satisfiable and run.models}
        return [(run.models or 0, run.prime_implicants) for run in found.values() if run.prime_implicants is not None]

    @property
    def more_implicants(self) -> int:
        """Plans with more prime implicants than models."""
        return sum(implicants > models for models, implicants in self.compact)

    def implicants(self, *notes: str) -> Table:
        """Prime implicants by orders of magnitude of the number of models [PIKE, Figure 21]."""
        rows: list[Cells] = []
        low = 1
        while self.compact and low <= max(models for models, _ in self.compact):
            here = [(models, implicants) for models, implicants in self.compact if low <= models < low * 10]
            if here:
                sizes = [implicants for _, implicants in here]
                share = max(implicants / models for models, implicants in here)
                power = f"{low:.0e}".replace("e+0", "e").replace("e+", "e")
                rows.append((power, str(len(here)), f"{median(sizes):g}", str(max(sizes)), f"{share:.2g}"))
            low *= 10
        headings = ("models", "plans", "implicants, median", "implicants, most", "greatest share of models")
        title = "Prime implicants and models of plans that admit a correct execution"
        return Table(title, headings, rows, notes)


class Figure20aReport(TeamReport):
    """Time over candidate subplans."""

    @property
    def tables(self) -> list[Table]:
        """Who decided how many plans in what time; stages; and time over candidate subplans."""
        tables = [self.solved, self.stages, *map(self.sizes, self.contenders)]
        return [*tables[:-1], replace(tables[-1], notes=self.notes)]

    def draw(self, path: Path) -> None:
        """Seconds over candidate subplans, one panel for each back end; crosses at the limit ran out of time."""
        names, limit = self.contenders, self.options.limit
        with canvas(path, max(5.5, 3.2 * len(names)), 4.2, len(names)) as (_, panels):
            for place, (axes, name) in enumerate(zip(panels, names, strict=True)):
                runs = self.of(name)
                colour = COLOURS[place % len(COLOURS)]
                for satisfiable, marker, size, text in ((True, "o", 5, "admits one"), (False, ".", 3, "admits none")):
                    found = [run for run in runs if run.satisfiable is satisfiable]
                    axes.plot(
                        [self.subplans[run.instance] for run in found],
                        [run.seconds for run in found],
                        marker,
                        color=colour,
                        markerfacecolor="none" if satisfiable else None,
                        markersize=size,
                        label=text,
                    )
                late = [self.subplans[run.instance] for run in runs if not run.solved]
                axes.plot(late, [limit] * len(late), "x", color=BLACK)
                axes.axhline(limit, color=BLACK, linewidth=0.6, linestyle=":")
                axes.set(xscale="log", yscale="log", xlabel="candidate subplans")
                axes.set_title(f"{name}: {len(runs) - len(late)} of {len(runs)}")
            panels[0].set_ylabel("seconds from files to answer")
            panels[0].legend(title="correct execution", loc="upper left", fontsize="small")


class Figure21Report(TeamReport):
    """Prime implicants over models."""

    @property
    def tables(self) -> list[Table]:
        return [self.implicants(*self.notes, f"more implicants than models: {self.more_implicants} plans")]

    def draw(self, path: Path) -> None:
        """Prime implicants over models; the line is where they are as many."""
        from matplotlib.ticker import FuncFormatter  # noqa: PLC0415 - only where something is drawn

        # Logarithms taken here, because the numbers may be larger than any float.
        models = [log10(found) for found, _ in self.compact]
        implicants = [log10(found or 1) for _, found in self.compact]
        with canvas(path, 5.5, 4.6) as (_, [axes]):
            axes.plot(models, implicants, "o", color=BLUE, markerfacecolor="none")
            if models:
                ends = [0.0, max(models)]
                axes.plot(ends, ends, color=BLACK, linewidth=0.6, linestyle=":", label="as many implicants as models")
                axes.legend(loc="upper left")
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"$10^{{{value:g}}}$"))
            axes.set(xlabel="models", ylabel="prime implicants")


def _prepare(options: Figure21Options, _: object) -> TeamPlans:
    if options.instances < 1:
        raise InputError(f"instances is {options.instances}; expected at least 1")
    for name in options.backends:
        if name not in CONTENDERS:
            raise InputError(f"--backend: found {name!r}, expected one of {', '.join(CONTENDERS)}")
    networks = [random_plan(options.seed, index).network for index in range(options.instances)]
    return TeamPlans(
        tuple(
            TeamPlanSize(instance_name(options.seed, index), len(one.activities), candidate_subplans(one))
            for index, one in enumerate(networks)
        )
    )


def _tasks(options: Figure21Options, _: object) -> list[TeamTask]:
    return [
        TeamTask(options.seed, index, contender, options.limit or 60.0)
        for index in range(options.instances)
        for name, contender in CONTENDERS.items()
        if not options.backends or name in options.backends
    ]


def _describe(task: TeamTask, run: TeamRun) -> str:
    outcome = run.message or "out of time"
    if run.satisfiable is not None:
        outcome = "exists" if run.satisfiable else "none"
    return f"{task.label}: {outcome}, {run.seconds:.2f} s"


def _experiment(name: str, options: type[Figure21Options], report: type[TeamReport]) -> Experiment:
    return Experiment(name, options, _tasks, run_contender, TeamRun, report, _describe, prepare=_prepare)


FIGURE20A = _experiment("figure20a", Figure20aOptions, Figure20aReport)
FIGURE21 = _experiment("figure21", Figure21Options, Figure21Report)
