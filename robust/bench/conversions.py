"""`robust bench conversions`: time-triggered plans converted to the least constrained network, and what is left in it.

Plans are drawn at random, generated for the delivery domain, or made by a planner for problems of that domain
(:mod:`robust.bench.conversion_plans`). Each is converted in mode `causal`. The network must be proved valid and allow
the plan's own schedule, which the simulator executes; then each bound is removed in turn, and the plan proved or
refuted without it (:mod:`robust.bench.removals`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any, assert_never

from robust.bench.batch import Progress
from robust.bench.conversion_plans import PlanTexts, delivery_order, delivery_plan, drawn_plan
from robust.bench.options import check_limit
from robust.bench.removals import Judgement, Kind, Removal, judge_constraints
from robust.bench.sweep import Failure, run_sweep
from robust.encode.interface import EPSILON
from robust.errors import InputError, RobustError
from robust.execute.convert import Conversion, convert
from robust.execute.planners.interface import Planner
from robust.irr.check import Answer
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.simulate import simulate
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.smt.limits import Deadline

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "robust/bench-conversions/1"
LIMIT = 60.0
PLANNING_S = 20.0
"""What a planner has for a problem."""
PROBLEMS = 10
"""Problems that are tried until the planner finds a plan."""


class Source(Enum):
    """Where a plan comes from."""

    DRAWN = "drawn"
    DELIVERY = "delivery"
    PLANNED = "planned"


@dataclass(frozen=True, slots=True)
class ConversionTask:
    """One plan, and the `planner` of one that is planned; `limit` seconds to convert it, and to judge it."""

    source: Source
    seed: int
    limit: float | None
    planner: str | None = None

    @property
    def label(self) -> str:
        return f"{self.source.value} {self.seed}"


@dataclass(frozen=True)
class ConversionRow:
    """One plan and what was found.

    `allowed` says whether the plan's own schedule is one of the network's and breaks nothing. `bounds` counts the
    bounds by what they are for and what becomes of the plan without one.
    """

    task: ConversionTask
    plan: str
    steps: int
    proved: bool
    allowed: bool
    tightened: int
    bounds: Mapping[tuple[Kind, Removal], int]
    removable: tuple[str, ...]
    convert_s: float
    judge_s: float

    def count(self, kind: Kind, *removals: Removal) -> int:
        return sum(number for (of, removal), number in self.bounds.items() if of is kind and removal in removals)

    @property
    def holds(self) -> bool:
        """Whether the network is proved, allows the plan, and holds nothing that is known not to be needed."""
        return self.proved and self.allowed and not self.removable

    @staticmethod
    def of(task: ConversionTask, result: Mapping[str, Any]) -> ConversionRow:
        """From what :func:`convert_and_judge` returned."""
        bounds = {(Kind(one["kind"]), Removal(one["removal"])): int(one["bounds"]) for one in result["bounds"]}
        fields = ("plan", "steps", "proved", "allowed", "tightened", "convert_s", "judge_s")
        return ConversionRow(
            task=task, bounds=bounds, removable=tuple(result["removable"]), **{name: result[name] for name in fields}
        )

    def as_dict(self) -> dict[str, Any]:
        return {"source": self.task.source.value, "seed": self.task.seed, **_facts(self)}


@dataclass(frozen=True)
class ConversionReport:
    """All plans; `complete` is false where Ctrl-C came before the last one."""

    rows: tuple[ConversionRow, ...]
    failures: tuple[Failure[ConversionTask], ...]
    complete: bool
    limit: float | None
    sweep_notes: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """Whether each plan was converted to a network that is proved, allows the plan, and needs all of its bounds."""
        return self.complete and not self.failures and all(row.holds and not _undecided(row) for row in self.rows)

    @property
    def sources(self) -> tuple[Source, ...]:
        return tuple(dict.fromkeys(row.task.source for row in self.rows))

    def rows_of(self, source: Source) -> tuple[ConversionRow, ...]:
        return tuple(row for row in self.rows if row.task.source is source)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        notes = [f"{row.task.label}: {text}" for row in self.rows for text in row.removable][:5]
        planners = dict.fromkeys(row.task.planner for row in self.rows if row.task.planner is not None)
        notes += [f"planned by {name}, which may find other plans next time" for name in planners]
        return (*notes, *self.sweep_notes)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds."""
        return {
            "schema": SCHEMA,
            "complete": self.complete,
            "agrees": self.agrees,
            "limit_s": self.limit,
            "notes": list(self.notes),
            "failures": [{"task": one.task.label, "reason": one.reason} for one in self.failures],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """Plans by source, and bounds by kind."""
        from robust.bench.conversion_tables import conversion_tables  # noqa: PLC0415 - rich only when shown

        return conversion_tables(self)


def run_conversions(
    *,
    drawn: int = 150,
    delivery: int = 50,
    planned: int = 100,
    planner: str = "aries",
    seed: int = 0,
    limit: float | None = LIMIT,
    jobs: int = 1,
    cluster: str | None = None,
    store: Path | None = None,
    on_result: Progress | None = None,
) -> ConversionReport:
    """Convert plans, and look for constraints that they do not need.

    Args:
        drawn: how many plans are drawn.
        delivery: how many plans are generated for the delivery domain.
        planned: how many plans a planner makes for that domain.
        planner: which planner, see :func:`robust.execute.planners.registry.create_planner`.
        seed: which plans and problems.
        limit: seconds to convert a plan, and as many to judge its bounds; None without end.
        jobs: processes at a time.
        cluster: the address of a Dask scheduler whose workers do it instead.
        store: a file from which an interrupted run resumes.
        on_result: called after each plan with the number done, their total and a line about the plan.

    Returns:
        A report; after Ctrl-C of what is there, marked incomplete.

    Raises:
        InputError: wrong options.
        UnsupportedError: if the planner, or the cluster, is wanted and not installed.
    """
    check_limit(limit)
    if min(drawn, delivery, planned) < 0 or drawn + delivery + planned == 0:
        raise InputError(f"found {drawn}, {delivery} and {planned} as numbers of plans, expected at least one plan")
    if planned:
        _planner(planner)  # before anything runs for long
    tasks = [ConversionTask(Source.DRAWN, seed + i, limit) for i in range(drawn)]
    tasks += [ConversionTask(Source.DELIVERY, seed + i, limit) for i in range(delivery)]
    tasks += [ConversionTask(Source.PLANNED, seed + i, limit, planner) for i in range(planned)]
    sweep = run_sweep(
        tasks, convert_and_judge, store=store, jobs=jobs, cluster=cluster, describe=_describe, on_result=on_result
    )
    rows = tuple(ConversionRow.of(task, result) for task, result in sweep.results)
    return ConversionReport(rows, sweep.failures, sweep.complete, limit, sweep.notes)


def convert_and_judge(task: ConversionTask) -> dict[str, Any]:
    """Convert one plan and judge its bounds: a row as JSON.

    Raises:
        RobustError: if there is no plan, or it cannot be converted.
    """
    texts = _texts(task)
    started = time.perf_counter()
    domain = parse_domain(texts.domain)
    problem = parse_problem(texts.problem, domain)
    timed = parse_timed_plan(texts.plan)
    conversion = convert(domain, problem, timed, timeout=task.limit)
    converted = time.perf_counter()
    judgements = judge_constraints(conversion, EPSILON, "z3", Deadline.after(task.limit))
    row = ConversionRow(
        task=task,
        plan=texts.plan,
        steps=len(timed.steps),
        proved=conversion.check.answer is Answer.PROVED,
        allowed=_allowed(conversion, timed),
        tightened=len(conversion.tightened),
        bounds=Counter((one.kind, one.removal) for one in judgements),
        removable=tuple(_text(one) for one in judgements if one.removal.removable),
        convert_s=round(converted - started, 4),
        judge_s=round(time.perf_counter() - converted, 4),
    )
    return _facts(row)


def _facts(row: ConversionRow) -> dict[str, Any]:
    return {
        "plan": row.plan,
        "steps": row.steps,
        "proved": row.proved,
        "allowed": row.allowed,
        "tightened": row.tightened,
        "bounds": [
            {"kind": kind.value, "removal": removal.value, "bounds": number}
            for (kind, removal), number in row.bounds.items()
        ],
        "removable": list(row.removable),
        "convert_s": row.convert_s,
        "judge_s": row.judge_s,
    }


def _allowed(conversion: Conversion, timed: TimedPlan) -> bool:
    """Whether the times of the steps as they were given, and no others, satisfy the network and break nothing."""
    times = dict(conversion.schedule)
    for step, instance in zip(timed.steps, conversion.plan.instances, strict=True):
        if times[instance.start] != step.time or times[instance.end] != step.time + (step.duration or 0):
            return False
    return simulate(conversion.plan, conversion.plan.nominal, times, epsilon=EPSILON).valid


def _texts(task: ConversionTask) -> PlanTexts:
    match task.source:
        case Source.DRAWN:
            return drawn_plan(task.seed)
        case Source.DELIVERY:
            return delivery_plan(task.seed)
        case Source.PLANNED:
            return _planned(task.planner or "", task.seed)
        case _:
            assert_never(task.source)


def _planned(name: str, seed: int) -> PlanTexts:
    """A planner's plan for the first of some problems for which it finds one."""
    planner = _planner(name)
    reason = "no problem was tried"
    for number in range(seed * PROBLEMS, (seed + 1) * PROBLEMS):
        texts = delivery_order(number)
        domain = parse_domain(texts[0])
        answer = planner.solve(domain, parse_problem(texts[1], domain), Deadline.after(PLANNING_S))
        if answer.plan is not None:
            return PlanTexts(*texts, "".join(f"{step}\n" for step in answer.plan.steps))
        reason = answer.message
    raise RobustError(f"planner {name!r} found no plan for {PROBLEMS} problems, expected one; the last one: {reason}")


def _planner(name: str) -> Planner:
    from robust.execute.planners.registry import create_planner  # noqa: PLC0415 - only where plans are made

    return create_planner(name)


def _text(one: Judgement) -> str:
    return f"{one.edge} ({one.kind.value}, {one.removal.value})"


def _undecided(row: ConversionRow) -> bool:
    return any(number for (_, removal), number in row.bounds.items() if removal is Removal.UNKNOWN)


def _describe(task: ConversionTask, result: Mapping[str, Any]) -> str:
    row = ConversionRow.of(task, result)
    verdict = "proved" if row.proved and row.allowed else "NOT proved or excludes its plan"
    return f"{task.label}: {row.steps} steps, {verdict}, {len(row.removable)} of {_bounds(row)} bounds removable"


def _bounds(row: ConversionRow) -> int:
    return sum(row.bounds.values())
