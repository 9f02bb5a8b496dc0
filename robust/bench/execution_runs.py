"""`robust bench table1` and `table2`: every executor on the delivery problems, in the same simulated worlds [IRR §5].

Table 1: the durations of some preparation steps are uncertain, those of the longest steps first. The world draws them
from a normal distribution around the nominal duration, folded up at a minimum. Table 2: the consumption of every action
is uncertain. In one case all executors begin with the same plan, nature draws the same values for the same actions, and
executors that come to the same state get the same plan there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.bench.batch import Progress
from robust.bench.execution_tables import DREEX, EXECUTORS, TABLE1, TABLE2, ExecutionReport, ExecutionRow, TableDesign
from robust.bench.sweep import run_sweep
from robust.errors import InputError
from robust.execute.delivery import PREPARATIONS, TASKS, DeliveryVariant, TableProblem, delivery_domain, table_problems
from robust.execute.delivery.domain import preparation_action
from robust.execute.dispatch.messages import LeftBox
from robust.execute.dispatch.network import Guarantee, parse_executor
from robust.execute.planners.interface import RememberingPlanner
from robust.execute.planners.registry import create_planner
from robust.execute.replan import (
    PLANNER_SECONDS,
    REPLANS,
    Mission,
    Options,
    Run,
    RunStatus,
    Segment,
    execute,
    prepare_timed,
)
from robust.execute.worlds.rules import Rules, parse_rules
from robust.plan.parameters import ParameterSpec, parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import TimedPlan
from robust.smt.limits import Deadline

PREPARATION_S = 30.0
"""For conversion and box, each."""
DURATION_DEVIATION = 70
SHORTEST = 30
"""Seconds that every uncertain step takes at least; the paper does not give its minimum."""
CONSUMPTION_DEVIATION = "6.5"
BATTERY = Fraction(520)
"""What the robot begins with; the paper does not give its own. Under DREEX it re-plans 0.1 times on average: about one
run in ten leaves the first envelope. The nearer order takes 293 in 14 actions. With 2.5 deviations (16.25) more for
each of them, which makes 520.5, all of them are inside with probability 0.916."""
PLANNERS = {1: "aries", 2: "kairos"}
DRAINS = {1: False, 2: True}
"""A step of uncertain duration that takes too long is given up; what was consumed is known when an action starts."""


@dataclass(frozen=True, slots=True)
class ExecutionTask:
    """One case: a problem by its number, one column of a table by its number from 0, and the seed of the world."""

    table: int
    column: int
    problem: int
    seed: int
    executors: tuple[str, ...]
    planner: str
    planner_s: float
    drain: bool
    battery: Fraction

    @property
    def label(self) -> str:
        return f"{_design(self.table).columns[self.column]}, problem {self.problem}, seed {self.seed}"


def run_table(
    table: int,
    *,
    problems: int = 100,
    runs: int = 1,
    columns: Sequence[int] | None = None,
    executors: Sequence[str] = EXECUTORS,
    planner: str | None = None,
    planner_s: float = PLANNER_SECONDS,
    drain: bool | None = None,
    battery: Fraction = BATTERY,
    seed: int = 0,
    jobs: int = 1,
    cluster: str | None = None,
    store: Path | None = None,
    on_result: Progress | None = None,
) -> ExecutionReport:
    """Run executors on the delivery problems.

    Args:
        table: 1 for uncertain durations, 2 for uncertain consumption.
        problems: how many of the hundred problems, spread over both deadlines.
        runs: worlds for each problem and column.
        columns: numbers of uncertain durations, from 1; None is all. Table 2 has one column.
        executors: which, DREEX among them.
        planner: who plans, see :func:`robust.execute.planners.registry.create_planner`; None is Aries for table 1, and
            Kairos for table 2, where levels are not integers.
        planner_s: seconds for each plan.
        drain: whether actions that run when a plan is given up are waited for; else they are stopped, and what they
            would have achieved is lost. None is stopped for table 1, waited for in table 2.
        battery: the charge at the beginning, for table 2.
        seed: which worlds.
        jobs: processes at a time.
        cluster: the address of a Dask scheduler whose workers do it instead.
        store: a file from which an interrupted run resumes.
        on_result: called after each case with the number done, their total and a line about it.

    Returns:
        A report; after Ctrl-C of what is there, marked incomplete.

    Raises:
        InputError: wrong options.
        UnsupportedError: if the planner, or the cluster, is wanted and not installed.
    """
    design = _design(table)
    chosen = tuple(range(1, len(design.columns) + 1)) if columns is None else tuple(columns)
    _check(design, problems, runs, chosen, executors)
    planner = PLANNERS[table] if planner is None else planner
    drain = DRAINS[table] if drain is None else drain
    create_planner(planner)  # before anything runs for long
    numbers = sorted(i * 37 % 100 for i in range(problems))  # spread over the deadlines of both orders
    tasks = [
        ExecutionTask(table, column - 1, number, seed + run, tuple(executors), planner, planner_s, drain, battery)
        for column in chosen
        for run in range(runs)
        for number in numbers
    ]
    sweep = run_sweep(tasks, run_case, store=store, jobs=jobs, cluster=cluster, describe=_describe, on_result=on_result)
    settings = {
        "problems": problems,
        "runs": runs,
        "planner": planner,
        "planner_s": planner_s,
        "drain": drain,
        "battery": str(battery) if table == TABLE2.number else None,
        "seed": seed,
    }
    return ExecutionReport(
        design,
        tuple(executors),
        tuple(ExecutionRow(**row) for _, rows in sweep.results for row in rows),
        tuple((one.task.label, one.reason) for one in sweep.failures),
        sweep.complete,
        settings,
        sweep.notes,
    )


def _check(design: TableDesign, problems: int, runs: int, columns: tuple[int, ...], executors: Sequence[str]) -> None:
    if not 1 <= problems <= 100:
        raise InputError(f"problems is {problems}; expected 1 to 100")
    if runs < 1:
        raise InputError(f"runs is {runs}; expected at least 1")
    for column in columns:
        if not 1 <= column <= len(design.columns):
            raise InputError(f"found column {column}, expected 1 to {len(design.columns)} in table {design.number}")
    if not executors or executors[0] != DREEX or set(executors) - set(EXECUTORS):
        raise InputError(f"found executors {', '.join(executors)}, expected dreex and then some of {EXECUTORS[1:]}")


def run_case(task: ExecutionTask) -> list[dict[str, Any]]:
    """All executors in one case: their rows as JSON.

    Raises:
        RobustError: if the planner has no plan to begin with, or an executor cannot make it ready.
    """
    problem = _problems(task.table, task.battery)[task.problem]
    planner = RememberingPlanner(create_planner(task.planner))
    domain = parse_domain(delivery_domain(problem.options.variant))
    parsed = parse_problem(problem.text, domain)
    answer = planner.solve(domain, parsed, Deadline.after(task.planner_s))
    rules = uncertain_rules(task.table, task.column + 1)
    specs = uncertain_specs(task.table, task.column + 1)
    rows = []
    for name in task.executors:
        options = Options(executor=parse_executor(name), specs=specs, timeout=PREPARATION_S)
        mission = Mission(
            domain, parsed, planner, rules, options, replans=REPLANS, planner_seconds=task.planner_s, drain=task.drain
        )
        run = _run(mission, answer.plan, f"{task.problem}/{task.seed}")
        row = ExecutionRow(
            column=_design(task.table).columns[task.column],
            executor=name,
            problem=problem.name,
            seed=task.seed,
            succeeded=run is not None and run.status is RunStatus.SUCCEEDED,
            replans=0 if run is None else run.replans,
            promises=0 if run is None else sum(_promises(one) for one in run.segments),
            broken=0 if run is None else broken_promises(run),
            seconds=0.0 if run is None else run.seconds,
            reason=f"{answer.status.value}: {answer.message}" if run is None else run.reason,
        )
        rows.append(row.as_dict())
    return rows


def _run(mission: Mission, timed: TimedPlan | None, seed: str) -> Run | None:
    """None if there is no plan to begin with: the run fails before it begins."""
    if timed is None:
        return None
    return execute(mission, seed, prepare_timed(mission.domain, mission.problem, timed, mission.options))


def broken_promises(run: Run) -> int:
    """Plans that were given up or failed although every observation was inside a dynamically controllable box."""
    carried_out = [one for one in run.segments if _promises(one) and one.ending is None]
    given_up = sum(_promises(one) and one.ending is not None for one in run.segments)
    return given_up + (len(carried_out) if run.status is RunStatus.FAILED else 0)


def _promises(segment: Segment) -> bool:
    left = isinstance(segment.ending, LeftBox) or not all(one.inside for one in segment.observations)
    return segment.guarantee is Guarantee.DYNAMIC and not left


def uncertain_specs(table: int, count: int) -> tuple[ParameterSpec, ...]:
    """What the plans have as parameters."""
    if table == TABLE1.number:
        return parse_specs([f"duration:{preparation_action(step)}" for step in _uncertain(count)])
    return parse_specs([f"fluent:(battery_use {task}),lb=0" for task in TASKS])


def uncertain_rules(table: int, count: int) -> Rules:
    """What the world draws."""
    if table == TABLE1.number:
        numbers = f"deviation = {DURATION_DEVIATION}\nminimum = {SHORTEST}\n"
        subjects = [f'duration = "{preparation_action(step)}"' for step in _uncertain(count)]
    else:
        numbers = f"deviation = {CONSUMPTION_DEVIATION}\nminimum = 0\n"
        subjects = ['consumption = "battery_use"']
    return parse_rules("".join(f'[[draw]]\n{one}\ndistribution = "normal"\n{numbers}' for one in subjects))


def _uncertain(count: int) -> list[str]:
    """The preparation steps that take longest: those that the end of the preparation depends on."""
    return sorted(PREPARATIONS, key=lambda step: PREPARATIONS[step], reverse=True)[:count]


def _problems(table: int, battery: Fraction) -> tuple[TableProblem, ...]:
    if table == TABLE1.number:
        return table_problems(DeliveryVariant.DURATIONS)
    return table_problems(DeliveryVariant.BATTERY, battery=battery)


def _design(table: int) -> TableDesign:
    for design in (TABLE1, TABLE2):
        if design.number == table:
            return design
    raise InputError(f"found table {table}, expected 1 or 2")


def _describe(task: ExecutionTask, rows: Sequence[Mapping[str, Any]]) -> str:
    done = [row["executor"] for row in rows if row["succeeded"]]
    return f"{task.label}: {', '.join(done) or 'nobody'} succeeded"
