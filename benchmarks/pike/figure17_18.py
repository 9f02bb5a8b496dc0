"""`robust bench figure17` and `figure18`: PIKE against a Kirk that guesses intents, on the k-intents domain.

Both figures of [PIKE §6.2.1] come from the same executions. Each problem is executed once by PIKE and once by Kirk,
with the same human choices and the same durations. Figure 17 is the number of Kirk's re-plans; Figure 18 the time to
completion. Executions that fail count as such, and are left out of what is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import log, prod
from random import Random
from statistics import fmean
from typing import Any, ClassVar

from robust.draw.style import BLACK, BLUE, VERMILION
from robust.errors import InputError
from robust.execute.drive import run_in_world
from robust.json_text import plain
from robust.pike_bridge.builder import KIntents, k_intents
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.kirk_world import execution_faults
from robust.pike_bridge.online.progress import Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.smt.limits import Deadline, OutOfTimeError

from ..catalogue import Figure17Options, Figure18Options
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import NOTHING, Columns, Panel, Series, Table, number
from ..engine.stats import LineFit, Mean
from .baselines import Mode, Script, ScriptedTeam, TeamExecutive, Timed, draw_script, make_executive

SMALLEST = 2
REPEATED = ("seed", "problems", "largest", "reasoner", "limit", "jobs")
PAPER = {"improvement": 0.134, "free_recovery": 0.022}
"""Mean improvement of PIKE over Kirk, and the same without the time of recoveries [PIKE §6.2.1]."""

LARGEST = 10_000
"""Numbers of intents are drawn up to this; the paper's range is in a figure only."""


def random_k_intents(seed: int, index: int = 0, largest: int = LARGEST) -> KIntents:
    """A problem with a random number of intents, uniform on a logarithmic scale, and a random order of its choices."""
    random = Random(f"k-intents/{seed}/{index}")  # noqa: S311 - reproducible
    wanted = 2 ** random.uniform(1, log(largest, 2))
    structure = closest_factors(wanted)
    random.shuffle(structure)
    return k_intents(structure, seed=random.randrange(2**32))


def closest_factors(wanted: float) -> list[int]:
    """Twos and threes whose product is closest to a number of at least 2; of equally close ones the smaller."""
    twos = range(int(log(wanted, 2)) + 2)
    threes = range(int(log(wanted, 3)) + 2)
    candidates = [(a, b) for a in twos for b in threes if a + b > 0]
    a, b = min(candidates, key=lambda each: (abs(2 ** each[0] * 3 ** each[1] - wanted), 2 ** each[0] * 3 ** each[1]))
    return [2] * a + [3] * b


# -- one problem, executed by both in the same world -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class TeamExecution:
    """One execution: how it ended, after how much time of the plan and of which recoveries, and what it computed.

    `outcome` is succeeded, failed, waiting, timeout, or incorrect: a success that the referee rejects. `seconds` is the
    computing during execution: steps, re-plans, and finding out when to look again. What is computed before, such as
    the first guess, does not count [PIKE §6.2.1].
    """

    outcome: str
    time: Fraction
    replans: int
    recovery: Fraction
    seconds: float

    @property
    def succeeded(self) -> bool:
        return self.outcome == "succeeded"


@dataclass(frozen=True, slots=True)
class KIntentsRun:
    """Both executions of one problem."""

    index: int
    structure: tuple[int, ...]
    pike: TeamExecution
    kirk: TeamExecution

    @property
    def intents(self) -> int:
        return prod(self.structure)

    @property
    def choices(self) -> int:
        """How many uncontrollable choices there are."""
        return len(self.structure)

    @property
    def wrong_guesses(self) -> Fraction:
        """How many guesses are wrong on average, for a human who chooses uniformly."""
        return sum((1 - Fraction(1, options) for options in self.structure), Fraction(0))

    @property
    def compared(self) -> bool:
        return self.pike.succeeded and self.kirk.succeeded

    @property
    def improvement(self) -> float:
        """The share of Kirk's time that PIKE saves, in the time of the plan."""
        return float(1 - self.pike.time / self.kirk.time)

    def with_computing(self, kirk: Fraction) -> float:
        """The same share with the computing of both added, for a time of Kirk; the unit of the plan is a second."""
        return 1 - (float(self.pike.time) + self.pike.seconds) / (float(kirk) + self.kirk.seconds)


def run_problem(seed: int, index: int, largest: int, reasoner: str, limit: float | None = None) -> KIntentsRun:
    """Draw a problem and its world, and execute it by both, each of which has `limit` seconds for it."""
    problem = random_k_intents(seed, index, largest)
    plan = problem.instance.plan()
    script = draw_script(plan, f"{seed}/{index}")
    ours, theirs = (
        execute(mode, plan, script, reasoner, recovery=problem.recovery, limit=limit) for mode in (Mode.PIKE, Mode.KIRK)
    )
    return KIntentsRun(index, problem.structure, ours, theirs)


def execute(
    mode: Mode, plan: TeamPlan, script: Script, reasoner: str, *, recovery: Mapping[str, Fraction], limit: float | None
) -> TeamExecution:
    """One execution by the executive of a mode, which has `limit` seconds for it."""
    deadline = Deadline.after(limit)
    make = make_reasoner(reasoner, deadline=deadline)
    executive: TeamExecutive | None = None
    seconds = 0.0
    try:
        executive = make_executive(mode, plan, make, recovery=recovery, deadline=deadline)
        executive.prepare()
        timed = Timed(executive)
        run_in_world(timed, ScriptedTeam(plan, executive, script))
        seconds = sum(timed.steps) + sum(timed.wakes)
    except OutOfTimeError:
        outcome = "timeout"
    else:
        outcome = "waiting" if executive.outcome is None else type(executive.outcome).__name__.lower()
        if isinstance(executive.outcome, Succeeded) and execution_faults(plan, executive):
            outcome = "incorrect"
    if executive is None:
        return TeamExecution(outcome, Fraction(0), 0, Fraction(0), 0.0)
    return TeamExecution(outcome, executive.progress.now, executive.replans, executive.recovered, round(seconds, 4))


# -- the report --------------------------------------------------------------------------------------------------------


class KIntentsReport(Report[KIntentsRun]):
    """Problems of the k-intents domain [PIKE §6.2.1], Figures 17 and 18 (`robust bench figure17` and `figure18`). Kirk
    guesses one intent, executes the candidate subplan for it, and plans anew when a human chooses otherwise, after a
    recovery of half the least duration of the wrong activity. PIKE and Kirk meet the same humans, who choose uniformly,
    and the same durations, uniform between their bounds. The expected number of re-plans is that of wrong guesses, 1 −
    1/N for each choice with N options. Times are in units of the plan, computing in seconds. The time of the plan is
    exact: Kirk is later by its recoveries. With computing, the seconds in which each of the two decides, plans anew and
    finds out when to look again are added, one second to a unit of the plan; what is done before execution is not. The
    paper's figures are those of its own implementation.
    """

    TITLE = "Guessing intents"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in REPEATED}
    ROWS = "runs"
    LAYOUT = (6.5, 4.6, "upper left")

    @cached_property
    def compared(self) -> list[KIntentsRun]:
        return self.of(compared=True)

    def sound(self) -> bool:
        """Whether PIKE never failed nor planned anew, Kirk always arrived, and nothing else went wrong."""
        ended = all(one.outcome in {"succeeded", "timeout"} for run in self.rows for one in (run.pike, run.kirk))
        return ended and not any(run.pike.replans for run in self.rows)

    @property
    def pike_failures(self) -> int:
        """Executions that PIKE would have to plan anew, or that it planned anew."""
        return sum(run.pike.outcome in {"failed", "incorrect", "waiting"} or run.pike.replans > 0 for run in self.rows)

    @property
    def by_choices(self) -> dict[int, list[KIntentsRun]]:
        """What is compared, by the number of uncontrollable choices."""
        counts = sorted({run.choices for run in self.compared})
        return {count: [run for run in self.compared if run.choices == count] for count in counts}

    def mean(self, value: Callable[[KIntentsRun], float]) -> Mean | None:
        """Over the problems that are compared."""
        return Mean.of(map(value, self.compared))

    @cached_property
    def fit(self) -> LineFit | None:
        """Kirk's re-plans over the number of uncontrollable choices, problem by problem."""
        return LineFit.of([(run.choices, run.kirk.replans) for run in self.compared])

    @property
    def fit_of_means(self) -> LineFit | None:
        """The same for the means of each number of choices."""
        return LineFit.of([(count, fmean(run.kirk.replans for run in runs)) for count, runs in self.by_choices.items()])

    @property
    def saved_of_totals(self) -> float | None:
        """The share of the sum of Kirk's times that PIKE saves."""
        kirk = sum((run.kirk.time for run in self.compared), Fraction(0))
        return float(1 - sum((run.pike.time for run in self.compared), Fraction(0)) / kirk) if kirk else None

    def findings(self) -> Mapping[str, Any]:
        means = {name: self.mean(saving.share) for name, saving in SAVINGS.items()}
        return {
            "pike_failures": self.pike_failures,
            "fit": self.fit,
            "fit_of_means": self.fit_of_means,
            "means": {**means, "replans": self.mean(lambda run: run.kirk.replans)},
            "improvement_of_totals": self.saved_of_totals,
            "paper": PAPER,
        }

    def printed(self, row: KIntentsRun) -> Any:
        return plain({name: getattr(row, name) for name in ("index", "structure", "intents", "pike", "kirk")})

    def conclusions(self) -> Sequence[str]:
        """What was run, and what the domain's numbers say about it.

        With w = 1/4 on average, a recovery takes (1 + w) / 2 = 5/8 and two activities 2 · (3/2 + w) = 7/2 if durations
        are uniform, or 2 · (1 + w) = 5/2 if they are least.
        """
        options, runs = self.options, self.rows
        lost = sum(run.kirk.outcome not in {"succeeded", "timeout"} for run in runs)
        late = sum("timeout" in {run.pike.outcome, run.kirk.outcome} for run in runs)
        choices = sum(run.choices for run in self.compared)
        wrong = float(sum(run.wrong_guesses for run in self.compared)) / choices if choices else 0.0
        uniform, least = (wrong * 0.625 / (two + wrong * 0.625) for two in (3.5, 2.5))
        saved = None if self.saved_of_totals is None else self.saved_of_totals * 100
        return [
            f"{len(runs)} problems of seed {options.seed}, up to {options.largest} intents; reasoner "
            f"{options.reasoner}; the same choices and durations for both",
            f"PIKE: {self.pike_failures} failures or re-plans in {len(runs)} executions",
            *([f"Kirk: {lost} executions did not succeed"] if lost else []),
            *([f"out of time: {late} problems"] if late else []),
            f"re-plans, by problems: {fit_text(self.fit)}",
            f"re-plans, by means: {fit_text(self.fit_of_means)}",
            f"of the sum of all of Kirk's times PIKE saves {number(saved, 1)} %",
            f"on average {wrong:.3f} of the guesses are wrong; a recovery takes 0.625 on average, and two activities "
            f"3.5, so that long problems save {uniform:.1%} of Kirk's time; if all activities took their least time it "
            f"would be {least:.1%}: the paper does not say which durations its simulation draws",
        ]

    @property
    def replans(self) -> Table:
        """Re-plans by the number of uncontrollable choices [PIKE, Figure 17]."""
        return Table.of("Re-plans on the k-intents domain", REPLANS, self.by_choices.values())

    @property
    def times(self) -> Table:
        """Mean times to completion by the number of uncontrollable choices [PIKE, Figure 18]."""
        return Table.of("Time to completion on the k-intents domain", TIMES, self.by_choices.values())

    @property
    def improvements(self) -> Table:
        """What PIKE saves, beside the paper's figures, which include its implementation's computing."""
        saved = {one: Mean.of(one.share(run) * 100 for run in self.compared) for one in SAVINGS.values()}
        columns: Columns[Saving] = {
            "saved by PIKE": lambda one: one.label,
            "mean, %": lambda one: number(mean.value, 1) if (mean := saved[one]) else None,
            "95 %": lambda one: _interval(saved[one], 1),
            "paper, %": lambda one: number(None if one.paper is None else PAPER[one.paper] * 100, 1),
        }
        return Table.of("Improvement, mean of all problems", columns, SAVINGS.values())

    def page_contents(self) -> list[Table]:
        return [self.replans, self.times, self.improvements]


def _interval(mean: Mean | None, digits: int) -> str:
    if mean is None or mean.interval is None:
        return NOTHING
    return f"{mean.interval[0]:.{digits}f} to {mean.interval[1]:.{digits}f}"


def _saved(runs: Sequence[KIntentsRun]) -> list[float]:
    return [run.improvement * 100 for run in runs]


BY_CHOICES: Columns[Sequence[KIntentsRun]] = {"human choices": lambda runs: runs[0].choices, "problems": len}
REPLANS: Columns[Sequence[KIntentsRun]] = {
    **BY_CHOICES,
    "Kirk's re-plans": lambda runs: fmean(run.kirk.replans for run in runs),
    "95 %": lambda runs: _interval(Mean.of(run.kirk.replans for run in runs), 2),
    "most": lambda runs: max(run.kirk.replans for run in runs),
    "expected": lambda runs: float(sum(run.wrong_guesses for run in runs) / len(runs)),
    "PIKE's re-plans": lambda runs: sum(run.pike.replans for run in runs),
}
TIMES: Columns[Sequence[KIntentsRun]] = {
    **BY_CHOICES,
    "PIKE": lambda runs: fmean(float(run.pike.time) for run in runs),
    "Kirk": lambda runs: fmean(float(run.kirk.time) for run in runs),
    "saved, %": lambda runs: number(fmean(_saved(runs)), 1),
    "95 %": lambda runs: _interval(Mean.of(_saved(runs)), 1),
    "least": lambda runs: number(min(_saved(runs)), 1),
    "most": lambda runs: number(max(_saved(runs)), 1),
    "PIKE, s": lambda runs: number(fmean(run.pike.seconds for run in runs), 3),
    "Kirk, s": lambda runs: number(fmean(run.kirk.seconds for run in runs), 3),
}


@dataclass(frozen=True, slots=True)
class Saving:
    """A way to count what PIKE saves, and which of the paper's figures is beside it."""

    label: str
    share: Callable[[KIntentsRun], float]
    paper: str | None = None


SAVINGS = {
    "improvement": Saving("of Kirk's time", lambda run: run.improvement, "improvement"),
    "improvement_over_pike": Saving(
        "difference as a share of PIKE's time", lambda run: float(run.kirk.time / run.pike.time - 1)
    ),
    "improvement_with_computing": Saving(
        "of Kirk's time, with computing", lambda run: run.with_computing(run.kirk.time), "improvement"
    ),
    # In this domain nothing else changes with the time that recoveries take.
    "improvement_with_free_recovery": Saving(
        "the same, recovery taking no time",
        lambda run: run.with_computing(run.kirk.time - run.kirk.recovery),
        "free_recovery",
    ),
}
"""By their names in JSON."""


def fit_text(fit: LineFit | None) -> str:
    """Slope with its interval, intercept and R²."""
    if fit is None:
        return "no line: all problems have the same number of human choices"
    interval = "" if fit.interval is None else f" ({fit.interval[0]:.3f} to {fit.interval[1]:.3f})"
    slope = f"{fit.slope:.3f}{interval} more with each human choice"
    return f"{slope}, {fit.intercept:.2f} for none; R² {fit.r_squared:.3f}"


class Figure17Report(KIntentsReport):
    # Re-plans over the number of human choices, and the line through them.

    def contents(self) -> list[Table]:
        return [self.replans]

    def panels(self) -> list[Panel]:
        """Re-plans over the number of intents, a dot for each problem, and the number of wrong guesses expected."""
        runs = sorted(self.compared, key=lambda run: run.intents)
        dots = [(run.intents, run.kirk.replans) for run in runs]
        expected = [(run.intents, float(run.wrong_guesses)) for run in runs]
        most = max((run.pike.replans for run in runs), default=0)
        lines = [
            Series(dots, "Kirk", BLUE, marker=".", look={"alpha": 0.25}),
            Series(sorted(dict(expected).items()), "Kirk, expected", BLACK, "-"),
            Series([(size, most) for size, _ in dots], "PIKE, most", VERMILION, ":", look={"linewidth": 2}),
        ]
        return [Panel("", lines, "number of intents k", "re-plans", log="x")] if runs else []


class Figure18Report(KIntentsReport):
    # Times to completion, and what PIKE saves.

    def contents(self) -> list[Table]:
        return [self.times, self.improvements]

    def panels(self) -> list[Panel]:
        """PIKE's time to completion over Kirk's, shaded by the number of intents; the line is where they are equal."""
        dots = [(float(run.kirk.time), float(run.pike.time)) for run in self.compared]
        end = max((kirk for kirk, _ in dots), default=0)
        shades = [run.intents for run in self.compared]
        shaded = Series(dots, "number of intents k", size=6, shades=shades)
        lines = [shaded, Series([(0, 0), (end, end)], "as long", line=":")]
        return [Panel("", lines, "Kirk: time to completion", "PIKE: time to completion")] if dots else []


def _tasks(options: Figure17Options, _: object) -> list[Task]:
    if options.problems < 1:
        raise InputError(f"problems is {options.problems}; expected at least 1")
    if options.largest < SMALLEST:
        raise InputError(f"the largest number of intents is {options.largest}; expected at least {SMALLEST}")
    make_reasoner(options.reasoner)  # an unknown one is better found now
    how = (options.largest, options.reasoner, options.limit)
    numbers = range(options.problems)
    return [Task(f"k-intents {options.seed}/{index}", (options.seed, index, *how)) for index in numbers]


def _describe(run: KIntentsRun) -> str:
    if not run.compared:
        return f"PIKE {run.pike.outcome}, Kirk {run.kirk.outcome}"
    return f"{run.intents} intents, {run.kirk.replans} re-plans, {run.improvement:.1%} saved"


def _experiment(name: str, options: type[Figure17Options], report: type[KIntentsReport]) -> Experiment:
    return Experiment(name, options, _tasks, run_problem, report, _describe, lenient=True)


FIGURE17 = _experiment("figure17", Figure17Options, Figure17Report)
FIGURE18 = _experiment("figure18", Figure18Options, Figure18Report)
