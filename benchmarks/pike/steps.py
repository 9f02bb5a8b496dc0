"""`robust bench steps`: large plans with choices, step by step; how long each takes, and what its budget gives away.

Two people and a robot work through blocks of 13 activities, with one limit over all; or all blocks use one table, so
that an atom is used throughout. Plans are decided part by part, or as one, which is what becomes of a large plan
without joins. People choose what remains correct, and activities take any time within their bounds.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from time import process_time
from typing import ClassVar

from robust.execute.drive import run_in_world
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.reasoners import make_semantic
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Pace, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, faults
from robust.smt.limits import Deadline, OutOfTimeError

from ..catalogue import StepsOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table, middle
from ..engine.show import number as rounded
from ..generators.team_plans import blocks
from .baselines import Timed

BUDGET = 0.1
"""Seconds of each step."""
BLOCKS = 13
"""Activities of each."""
SIZES = (4, 8, 16, 31)
"""Blocks of the plans."""
PARTS, WHOLE = "by parts", "as one"


@dataclass(frozen=True, slots=True)
class SteppedRun:
    """One execution.

    Attributes:
        manner: whether the plan is decided by parts or as one.
        succeeded: whether it did, which a referee has confirmed; None: out of time.
        preparation: seconds before the first step.
        slowest: seconds of the slowest step, with the question when to take the next one.
        middle: seconds of the median step.
        late: how many steps took more than their budget.
        thrift: what the budget gave away, as executives count it.
    """

    plan: str
    activities: int
    patient: bool
    manner: str
    succeeded: bool | None
    preparation: float
    slowest: float
    middle: float
    late: int
    thrift: Mapping[str, int]


class Whole(Timed[said.Decision]):
    """Counts the question when to take the next step as part of the step."""

    @property
    def wake(self) -> Fraction | None:
        wake = super().wake
        self.steps[-1] += self.wakes.pop()
        return wake


def measure(size: tuple[int, bool], patient: bool, manner: str, seed: int, limit: float) -> SteppedRun:
    """One execution.

    Args:
        size: how many blocks the plan has, and whether they share an atom.
    """
    plan = blocks(size[0], share=size[1]).plan()
    started = process_time()
    executive = PlanExecutive(
        plan,
        make_semantic if manner == PARTS else SemanticReasoner,
        patience=Fraction(0) if patient else None,
        budget=BUDGET,
        deadline=Deadline.after(limit),
    )
    timed, preparation = Whole(executive), 0.0
    judge = make_semantic(executive.progress)
    gc.collect()
    gc.freeze()
    try:
        executive.prepare()
        preparation = process_time() - started
        run_in_world(timed, SimulatedTeam(plan, executive, judge, Story(pace=Pace.RANDOM), seed=seed))
        succeeded: bool | None = isinstance(executive.outcome, said.Succeeded) and not _wrong(plan, executive)
    except OutOfTimeError:
        succeeded = None
    finally:
        gc.unfreeze()
    return SteppedRun(
        plan.name,
        len(plan.network.activities),
        patient,
        manner,
        succeeded,
        round(preparation, 4),
        round(max(timed.steps, default=0.0), 5),
        round(middle(timed.steps) or 0.0, 5),
        sum(each > BUDGET for each in timed.steps),
        asdict(executive.thrift),
    )


def _wrong(plan: TeamPlan, executive: PlanExecutive) -> bool:
    progress = executive.progress
    scenario = {each.name: each.domain[0] for each in plan.network.choices} | progress.chosen
    return bool(faults(plan, Execution(scenario, progress.times), reported=progress.reported))


# -- the report --------------------------------------------------------------------------------------------------------

COLUMNS: Columns[SteppedRun] = {
    "plan": lambda one: one.plan,
    "activities": lambda one: str(one.activities),
    "decided": lambda one: one.manner,
    "patient": lambda one: "yes" if one.patient else "no",
    "succeeded": lambda one: {True: "yes", False: "no", None: "out of time"}[one.succeeded],
    "preparation, s": lambda one: rounded(one.preparation, 2),
    "steps": lambda one: str(one.thrift["steps"]),
    "median step, ms": lambda one: rounded(1000 * one.middle, 1),
    "slowest, ms": lambda one: rounded(1000 * one.slowest, 1),
    "over budget": lambda one: str(one.late),
    "undecided": lambda one: str(one.thrift["undecided"]),
    "followed": lambda one: str(one.thrift["followed"]),
    "stretched": lambda one: str(one.thrift["stretched"]),
    "woken early": lambda one: str(one.thrift["early"]),
}


class StepsReport(Report[SteppedRun]):
    """Steps of executions of large plans with choices (`robust bench steps`). Blocks of two people's choices, one of
    the robot and a use, with one limit over all; `shared`: all blocks use one table. Each step has 0.1 s of processor
    time, with the question when to take the next one. *Undecided* steps ended before all was decided and went on in
    the next; *followed* are events executed as a known continuation has them; *stretched* steps had more time than the
    budget; *woken early*: at a time before which nothing can be done. Seconds are of the processor.
    """

    TITLE = "Steps in time"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in ("seed", "limit", "jobs", "blocks")}
    ROWS = "executions"

    def sound(self) -> bool:
        """Whether every execution that had time succeeded."""
        return not any(run.succeeded is False for run in self.rows)

    def remarks(self) -> Sequence[str]:
        late = sum(run.late for run in self.rows)
        return [f"{sum(run.thrift['steps'] for run in self.rows)} steps, of which {late} took more than {BUDGET:g} s"]

    def contents(self) -> list[Table]:
        return [Table.of("Steps of executions of large plans", COLUMNS, self.rows)]


def _tasks(options: StepsOptions, _: object) -> list[Task]:
    manners = [(PARTS, patient) for patient in (True, False)] + [(WHOLE, True)]
    return [
        Task(
            f"{count} blocks{', shared' if share else ''}, {manner}{'' if patient else ', eager'}",
            ((count, share), patient, manner, options.seed, options.limit or 60.0),
        )
        for count in options.blocks or SIZES
        for share in (False, True)
        for manner, patient in manners
    ]


def _describe(run: SteppedRun) -> str:
    return f"{run.thrift['steps']} steps, slowest {1000 * run.slowest:.1f} ms"


STEPS = Experiment("steps", StepsOptions, _tasks, measure, StepsReport, _describe)
