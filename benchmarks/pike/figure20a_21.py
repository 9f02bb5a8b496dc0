"""`robust bench figure20a` and `figure21`: compiling random plans with choices by every back end [PIKE §6.2.2].

Every run is a whole process with a limit of its own, from files to the answer. The plans are generated from a seed.
Figure 20a is the time of compilation over the number of candidate subplans; Figure 21 the number
of prime implicants over that of models, for the plans that admit a correct execution. The paper's plans are mostly
infeasible; a second family is feasible, and in many ways.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import count, islice
from math import log10
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, TypeVar

from robust.draw.style import BLACK, BLUE
from robust.errors import UNDECIDED, InputError
from robust.numbers import plural
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.compile import candidate_subplans
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.sweeps.batch import COMMAND, complaint, measured

from ..catalogue import Figure20aOptions, Figure21Options
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import COLOURS, NOTHING, Columns, Panel, Series, Table, family, middle, number, quantile
from ..generators.team_plans import DEFAULT, FEASIBLE, random_plan

GRACE = 5.0
"""Seconds after its own limit until a process is ended."""
STAGES = ("precedence", "links", "conflicts", "knowledge", "search")
FEWEST, MOST = 50, 120
"""Activities of the plans that are feasible in many ways."""
Found = TypeVar("Found")

CONTENDERS: Mapping[str, tuple[str, ...]] = {
    "oracle": ("check", "--backend", "oracle"),
    "sat": ("check", "--backend", "sat"),
    **{backend: ("compile", "--backend", backend) for backend in ("bdd", "pitms", "atms")},
    "pitms-whole": ("compile", "--backend", "pitms", "--no-shortcut"),
    "paper": ("compile", "--backend", "pitms", "--temporal", "apsp", "--no-shortcut", "--no-models"),
}
"""Ways to answer, by their names in the tables: a command and its options. `paper` is the configuration of [PIKE]:
labeled shortest paths, and prime implicants of every theory, also of those that have no model."""
SHORTCUT = ("pitms", "atms")
"""For them, a solver recognises theories without models before anything is compiled."""


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

    @property
    def text(self) -> str:
        """What was found, and how long it took."""
        outcome = self.message or {True: "exists", False: "none", None: "out of time"}[self.satisfiable]
        return f"{outcome}, {self.seconds:.2f} s"


def instance_name(seed: int, index: int, feasible: bool = False) -> str:
    """Of a random plan."""
    return f"{'feasible' if feasible else 'random'}_{seed}_{index:03}"


def drawn(seed: int, index: int, feasible: bool) -> Instance:
    """A random plan of one of the families."""
    return random_plan(seed, index, FEASIBLE if feasible else DEFAULT)


def indices(options: Figure21Options) -> Sequence[int]:
    """Which plans of the family are asked for."""
    return _feasible(options.seed, options.instances) if options.feasible else range(options.instances)


@cache
def _feasible(seed: int, instances: int) -> tuple[int, ...]:
    """The first large plans that admit a correct execution, as the semantic oracle has it."""

    def counts(index: int) -> bool:
        instance = drawn(seed, index, True)
        large = FEWEST <= len(instance.network.activities) <= MOST
        return large and Oracle(instance.plan()).decide().verdict is ExecutionExistence.EXISTS

    return tuple(islice(filter(counts, count()), instances))


def run_contender(seed: int, index: int, contender: str, limit: float, feasible: bool = False) -> TeamRun:
    """Generate the plan, and let the contender answer."""
    command, *options = CONTENDERS[contender]
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        drawn(seed, index, feasible).write(Path(directory))
        words = ("pike", command, f"{directory}/plan.tpnu.json", *options, "--json", "--timeout", str(limit))
        found = measured((*COMMAND, *words), limit=limit + GRACE)
    answer = json.loads(found.stdout) if found.stdout and not found.timed_out else {}
    satisfiable = answer.get("satisfiable")
    if command == "check":
        satisfiable = {"proved": True, "refuted": False}.get(answer.get("verdict", ""))
    late = found.timed_out or found.exit_code == UNDECIDED
    counts = {name: answer.get(name) for name in ("candidate_subplans", "prime_implicants", "models")}
    return TeamRun(
        contender=contender,
        instance=instance_name(seed, index, feasible),
        seconds=round(found.cpu_s, 3),
        memory_mb=round(found.memory_mb, 1),
        satisfiable=satisfiable,
        stages=answer.get("seconds", {}),
        message=None if late or satisfiable is not None else complaint(found),
        **counts,
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


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Timing:
    """What a contender did with some plans; times are those of the solved ones, in ascending order."""

    name: str
    runs: Sequence[TeamRun]

    @property
    def spared(self) -> str:
        """How many plans a solver refuted, so that nothing was compiled."""
        if self.name not in SHORTCUT:
            return NOTHING
        count = sum(run.satisfiable is False for run in self.runs)
        return f"{count} ({count / len(self.runs):.0%})" if self.runs else NOTHING

    @property
    def times(self) -> list[float]:
        return sorted(run.seconds for run in self.runs if run.solved)

    def stage(self, name: str) -> float | None:
        """Mean seconds of a stage, over the runs that finished."""
        told = [run.stages[name] for run in self.runs if run.solved and name in run.stages]
        return mean(told) if told else None


SOLVED: Columns[Timing] = {
    "back end": lambda one: one.name,
    "solved": lambda one: len(one.times),
    "of": lambda one: len(one.runs),
    "refuted by a shortcut": lambda one: one.spared,
    "median, s": lambda one: middle(one.times),
    "90 %, s": lambda one: quantile(one.times, 0.9),
    "slowest, s": lambda one: max(one.times, default=None),
    "out of time": lambda one: sum(not run.solved and run.message is None for run in one.runs),
    "greatest MiB": lambda one: number(max((run.memory_mb for run in one.runs), default=None), 0),
}
STAGE_MEANS: Columns[Timing] = {
    "back end": lambda one: one.name,
    **family("{}, s", STAGES, lambda stage, one: number(one.stage(stage), 3)),
}
SIZES: Columns[Timing] = {
    "candidate subplans": lambda one: one.name,
    "plans": lambda one: len(one.runs),
    "solved": lambda one: len(one.times),
    "median, s": lambda one: middle(one.times),
    "slowest, s": lambda one: max(one.times, default=None),
}


def decades(values: Iterable[Found], size: Callable[[Found], int]) -> Iterator[tuple[int, list[Found]]]:
    """Values by the order of magnitude of their sizes, with the least size of each order that there is."""
    found: dict[int, list[Found]] = {}
    for value in values:
        found.setdefault(10 ** (len(str(size(value))) - 1), []).append(value)
    return iter(sorted(found.items(), key=lambda each: each[0]))


class TeamReport(Report[TeamRun]):
    """Random plans of [PIKE §6.2.2], Figures 20a and 21 (`robust bench figure20a`). The paper compiled 376 of its 500
    plans (75.2 %) within 30 minutes; 94 of them admitted a correct execution. A plan counts as solved once it is known
    whether a correct execution exists. `paper` is the paper's configuration: labeled shortest paths, and the πTMS for
    every theory; unlike the paper's, its times include the shortest paths. For `pitms` and `atms` as we use them a
    solver finds theories without models first: a shortcut, by which plans are refuted without being compiled. Prime
    implicants and models are of plans that admit a correct execution.
    """

    TITLE = "Plans with choices"
    SETTINGS: ClassVar[Mapping[str, str]] = {"seed": "seed", "limit": "limit", "jobs": "jobs"}
    ROWS = "runs"
    RAN = (("backends", "contender"),)
    FACTS = TeamPlans
    NOTED = False
    LAYOUT = (3.2, 4.2, "upper left")

    @property
    def timings(self) -> list[Timing]:
        """By contender, in the order of all."""
        chosen = self.options.backends or CONTENDERS
        return [Timing(name, self.of(contender=name)) for name in CONTENDERS if name in chosen]

    @cached_property
    def subplans(self) -> dict[str, int]:
        """The candidate subplans of each plan."""
        return {plan.instance: plan.candidate_subplans for plan in self.facts.plans}

    @cached_property
    def _verdicts(self) -> dict[str, set[bool | None]]:
        found: dict[str, set[bool | None]] = {plan.instance: set() for plan in self.facts.plans}
        for run in self.of(solved=True):
            found[run.instance].add(run.satisfiable)
        return found

    @property
    def contradicted(self) -> list[str]:
        """Plans on which two contenders differ."""
        return [name for name, verdicts in self._verdicts.items() if len(verdicts) > 1]

    def sound(self) -> bool:
        """Whether nothing failed, and nobody contradicts anybody; too late is not wrong."""
        return not self.contradicted and all(run.message is None for run in self.rows)

    def findings(self) -> Mapping[str, Any]:
        return {"contradicted": self.contradicted}

    def remarks(self) -> Sequence[str]:
        activities = [plan.activities for plan in self.facts.plans]
        decided = [verdicts for verdicts in self._verdicts.values() if len(verdicts) == 1]
        failures = dict.fromkeys(f"{run.contender}, {run.instance}: {run.message}" for run in self.rows if run.message)
        return [
            f"{plural(len(activities), 'plan')} of seed {self.options.seed}: {mean(activities):.1f} activities "
            f"on average, {max(activities)} at most; {sum(True in one for one in decided)} of {len(decided)} decided "
            "ones admit a correct execution",
            f"processor seconds of whole processes on this machine, stopped at {self.options.limit:g} s of wall time",
            *([f"contradicting answers: {', '.join(self.contradicted)}"] if self.contradicted else []),
            *list(failures)[:5],
        ]

    @cached_property
    def compact(self) -> list[tuple[int, int]]:
        """Models and prime implicants of each plan that admits a correct execution, where both were counted."""
        found = {run.instance: run for run in reversed(self.rows) if run.satisfiable and run.models}
        return [(run.models or 0, run.prime_implicants) for run in found.values() if run.prime_implicants is not None]

    def conclusions(self) -> Sequence[str]:
        more = sum(implicants > models for models, implicants in self.compact)
        inner = sorted(sum(run.stages.values()) for run in self.of(contender="oracle"))
        oracle = "the semantic oracle's own share of its time, without start and reading"
        return [
            f"more implicants than models: {more} of {len(self.compact)} plans",
            *([f"{oracle}: {median(inner):.2f} s median, {inner[-1]:.2f} s at most"] if inner else []),
        ]

    @property
    def compilation(self) -> list[Table]:
        """Who decided how many plans in what time; stages; and time by orders of magnitude of the number of candidate
        subplans [PIKE, Figure 20a]."""
        return [
            Table.of("Compilation of random plans with choices", SOLVED, self.timings),
            Table.of("Mean seconds by stage, of runs that finished", STAGE_MEANS, self.timings),
            *map(self._sizes, self.timings),
        ]

    def _sizes(self, one: Timing) -> Table:
        by_size = decades(one.runs, lambda run: self.subplans[run.instance])
        groups = [Timing(f"{low:,} to {low * 10 - 1:,}", runs) for low, runs in by_size]
        return Table.of(f"{one.name}: time over candidate subplans", SIZES, groups)

    @property
    def implicants(self) -> Table:
        """Prime implicants by orders of magnitude of the number of models [PIKE, Figure 21]."""
        columns: Columns[tuple[int, list[tuple[int, int]]]] = {
            "models": lambda one: f"{one[0]:.0e}".replace("e+0", "e").replace("e+", "e"),
            "plans": lambda one: len(one[1]),
            "implicants, median": lambda one: f"{median(implicants for _, implicants in one[1]):g}",
            "implicants, most": lambda one: max(implicants for _, implicants in one[1]),
            "greatest share of models": lambda one: f"{max(found / models for models, found in one[1]):.2g}",
        }
        title = "Prime implicants and models of plans that admit a correct execution"
        return Table.of(title, columns, decades(self.compact, lambda each: each[0]))

    def page_contents(self) -> list[Table]:
        return [*self.compilation, self.implicants]


class Figure20aReport(TeamReport):
    # Time over candidate subplans.

    def contents(self) -> list[Table]:
        return self.compilation

    def panels(self) -> list[Panel]:
        """Seconds over candidate subplans, one panel for each back end; crosses at the limit ran out of time."""
        return [self._panel(place, one) for place, one in enumerate(self.timings)]

    def _panel(self, place: int, one: Timing) -> Panel:
        limit, colour = self.options.limit, COLOURS[place % len(COLOURS)]

        def dots(satisfiable: bool) -> list[tuple[float, float]]:
            return [(self.subplans[run.instance], run.seconds) for run in one.runs if run.satisfiable is satisfiable]

        late = [(self.subplans[run.instance], limit) for run in one.runs if not run.solved]
        ends = [(size, limit) for size in (1, max(self.subplans.values(), default=1))]
        lines = [
            Series(dots(True), "a correct execution exists", colour, marker="o", look={"markerfacecolor": "none"}),
            Series(dots(False), "none exists", colour, marker=".", size=3),
            Series(late, marker="x"),
            Series(ends, line=":"),
        ]
        title = f"{one.name}: {len(one.times)} of {len(one.runs)}"
        return Panel(title, lines, "candidate subplans", "seconds from files to answer", log="xy")


class Figure21Report(TeamReport):
    # Prime implicants over models.

    def contents(self) -> list[Table]:
        return [self.implicants]

    def panels(self) -> list[Panel]:
        """Prime implicants over models; the line is where they are as many."""
        # Logarithms taken here, because the numbers may be larger than any float.
        dots = [(log10(models), log10(implicants or 1)) for models, implicants in self.compact]
        end = max((models for models, _ in dots), default=0.0)
        lines = [
            Series(dots, None, BLUE, marker="o", look={"markerfacecolor": "none"}),
            Series([(0, 0), (end, end)], "as many implicants as models", BLACK, ":"),
        ]

        def power(value: float) -> str:
            return f"$10^{{{value:g}}}$"

        return [Panel("", lines, "models", "prime implicants", units={"x": power, "y": power})]


def _prepare(options: Figure21Options, _: object) -> TeamPlans:
    if options.instances < 1:
        raise InputError(f"instances is {options.instances}; expected at least 1")
    for name in options.backends:
        if name not in CONTENDERS:
            raise InputError(f"--backend: found {name!r}, expected one of {', '.join(CONTENDERS)}")
    plans = []
    for index in indices(options):
        network = drawn(options.seed, index, options.feasible).network
        size = len(network.activities), candidate_subplans(network)
        plans.append(TeamPlanSize(instance_name(options.seed, index, options.feasible), *size))
    return TeamPlans(tuple(plans))


def _tasks(options: Figure21Options, _: object) -> list[Task]:
    return [
        Task(
            f"{instance_name(options.seed, index, options.feasible)}, {name}",
            (options.seed, index, name, options.limit or 60.0, options.feasible),
        )
        for index in indices(options)
        for name in CONTENDERS
        if not options.backends or name in options.backends
    ]


def _experiment(name: str, options: type[Figure21Options], report: type[TeamReport]) -> Experiment:
    return Experiment(name, options, _tasks, run_contender, report, lambda run: run.text, prepare=_prepare)


FIGURE20A = _experiment("figure20a", Figure20aOptions, Figure20aReport)
FIGURE21 = _experiment("figure21", Figure21Options, Figure21Report)
