"""`robust bench table1` and `table2`: every executor on the delivery problems, in the same simulated worlds [IRR §5].

Table 1: the durations of some preparation steps are uncertain, those of the longest steps first. The world draws them
from a normal distribution around the nominal duration, folded up at a minimum. Table 2: the consumption of every action
is uncertain. A case is a problem, a column (how much is uncertain) and a seed of the world; every executor runs every
case, so that executors can be compared in pairs. In one case all begin with the same plan, nature draws the same values
for the same actions, and executors that come to the same state get the same plan there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from typing import Any, ClassVar

from robust.errors import InputError
from robust.execute.dispatch.dispatcher import LeftBox
from robust.execute.dispatch.network import Guarantee, parse_executor
from robust.execute.planners.interface import RememberingPlanner
from robust.execute.planners.registry import create_planner
from robust.execute.replan import (
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
from robust.smt.limits import Deadline

from ..catalogue import BATTERY, Table1Options, Table2Options, TableOptions
from ..engine.codec import plain
from ..engine.experiment import Experiment, Report, Results
from ..engine.show import NOTHING, Table, number
from ..engine.stats import Mean, Pairing, Proportion
from ..generators.delivery import (
    PREPARATIONS,
    TASKS,
    DeliveryVariant,
    TableProblem,
    delivery_domain,
    preparation_action,
    table_problems,
)

DREEX = "dreex"
EXECUTORS = (DREEX, *(f"blex:{share}" for share in range(0, 70, 10)))
FEW_REPLANS = 0.3
"""Successful runs under DREEX are to take fewer re-plans than this on average."""
PREPARATION_S = 30.0
"""For conversion and box, each."""
DURATION_DEVIATION = 70
SHORTEST = 30
"""Seconds that every uncertain step takes at least; the paper does not give its minimum."""
CONSUMPTION_DEVIATION = "6.5"


@dataclass(frozen=True, slots=True)
class PaperCell:
    """What the paper reports: coverage in per cent, and average re-plans of successful runs (None: no such run)."""

    coverage: float
    replans: float | None


@dataclass(frozen=True, slots=True)
class Design:
    """One of the tables: its columns by name, the paper's figures by executor, and what holds unless options say else.

    A step of uncertain duration that takes too long is given up; what was consumed is known when an action starts, so
    that actions that run are waited for (`drain`). Kairos plans where levels are not integers.
    """

    number: int
    title: str
    columns: tuple[str, ...]
    paper: Mapping[str, tuple[PaperCell, ...]]
    planner: str
    drain: bool

    def paper_cell(self, executor: str, column: str) -> PaperCell:
        return self.paper[executor][self.columns.index(column)]


def _paper(coverage: str, replans: str) -> Mapping[str, tuple[PaperCell, ...]]:
    """Of lines for each executor, with a number for each column."""
    lines = zip(EXECUTORS, coverage.split("\n"), replans.split("\n"), strict=True)
    return {
        executor: tuple(
            PaperCell(float(share), None if mean == "–" else float(mean))
            for share, mean in zip(shares.split(), means.split(), strict=True)
        )
        for executor, shares, means in lines
    }


TABLE1_DESIGN = Design(
    1,
    "uncertain durations",
    ("1 parameter", "2 parameters", "3 parameters", "4 parameters", "5 parameters"),
    _paper(
        """\
92.2 85.8 83.2 72.8 63.0
0.0  0.0  0.0  0.0  0.0
24.5 4.8  0.8  0.2  0.0
44.4 19.9 6.3  2.4  0.8
58.9 34.0 18.8 9.2  4.5
68.8 52.2 34.7 23.8 11.8
75.0 62.2 49.0 37.8 27.9
78.8 69.0 59.4 53.4 44.5""",
        """\
0.1 0.2 0.2 0.1 0.1
–   –   –   –   –
1.0 1.0 1.2 0.8 –
0.8 1.0 1.0 1.6 1.9
0.7 0.9 1.2 1.2 1.4
0.6 0.8 1.0 1.1 1.5
0.5 0.7 0.9 1.1 1.2
0.4 0.5 0.7 0.9 1.1""",
    ),
    "aries",
    drain=False,
)
TABLE2_DESIGN = Design(
    2,
    "uncertain consumption",
    ("battery",),
    _paper(
        "99.2\n1.0\n25.6\n50.7\n66.4\n77.9\n82.1\n86.8",
        "0.1\n2.0\n0.1\n0.1\n0.1\n0.1\n0.1\n0.1",
    ),
    "kairos",
    drain=True,
)
DESIGNS = {design.number: design for design in (TABLE1_DESIGN, TABLE2_DESIGN)}


def label(executor: str) -> str:
    """As the paper writes it: DREEX, BLEX(30)."""
    name, _, share = executor.partition(":")
    return f"{name.upper()}({share})" if share else name.upper()


# -- one case ----------------------------------------------------------------------------------------------------------


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
        return f"{DESIGNS[self.table].columns[self.column]}, problem {self.problem}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class ExecutionRow:
    """One run of one executor in one case.

    `promises` counts the plans of the run all of whose observations were inside a dynamically controllable box in the
    envelope, so that they had to succeed; `broken` are those of them that did not.
    """

    column: str
    executor: str
    problem: str
    seed: int
    succeeded: bool
    replans: int
    promises: int
    broken: int
    seconds: float
    reason: str = ""

    @property
    def case(self) -> tuple[str, str, int]:
        return self.column, self.problem, self.seed


def run_case(task: ExecutionTask) -> tuple[ExecutionRow, ...]:
    """All executors in one case.

    Raises:
        RobustError: if an executor cannot make the first plan ready.
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
        run = None
        if answer.plan is not None:
            run = execute(mission, f"{task.problem}/{task.seed}", prepare_timed(domain, parsed, answer.plan, options))
        row = ExecutionRow(
            column=DESIGNS[task.table].columns[task.column],
            executor=name,
            problem=problem.name,
            seed=task.seed,
            succeeded=run is not None and run.status is RunStatus.SUCCEEDED,
            replans=0 if run is None else run.replans,
            promises=0 if run is None else sum(_promises(one) for one in run.segments),
            broken=0 if run is None else broken_promises(run),
            seconds=0.0 if run is None else round(run.seconds, 4),
            reason=f"{answer.status.value}: {answer.message}" if run is None else run.reason,
        )
        rows.append(row)
    return tuple(rows)


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
    if table == TABLE1_DESIGN.number:
        return parse_specs([f"duration:{preparation_action(step)}" for step in _uncertain(count)])
    return parse_specs([f"fluent:(battery_use {task}),lb=0" for task in TASKS])


def uncertain_rules(table: int, count: int) -> Rules:
    """What the world draws."""
    if table == TABLE1_DESIGN.number:
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
    if table == TABLE1_DESIGN.number:
        return table_problems(DeliveryVariant.DURATIONS)
    return table_problems(DeliveryVariant.BATTERY, battery=battery)


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """One executor in one column: coverage, re-plans of successful runs, and the pairing of DREEX with it."""

    coverage: Proportion
    replans: Mean | None
    against: Pairing | None
    paper: PaperCell

    @property
    def facts(self) -> dict[str, Any]:
        """As JSON; coverage between 0 and 1, the paper's in per cent."""
        interval = None if self.replans is None else self.replans.interval
        return {
            "runs": self.coverage.trials,
            "succeeded": self.coverage.successes,
            "coverage": [round(end, 4) for end in self.coverage.interval],
            "replans": None if self.replans is None else round(self.replans.value, 4),
            "replans_interval": None if interval is None else [round(end, 4) for end in interval],
            "dreex_only": None if self.against is None else self.against.first,
            "this_only": None if self.against is None else self.against.second,
            "p_value": None if self.against is None else float(f"{self.against.p_value:.3g}"),
            "paper_coverage": self.paper.coverage,
            "paper_replans": self.paper.replans,
        }

    @property
    def covers(self) -> str:
        """Ours with its interval, and the paper's."""
        lower, upper = (round(100 * end) for end in self.coverage.interval)
        return f"{100 * float(self.coverage.share):.1f} % [{lower}–{upper}] / {self.paper.coverage:.1f} %"

    def replanned(self, digits: int) -> str:
        """Ours and the paper's."""
        ours = None if self.replans is None else self.replans.value
        return f"{number(ours, digits)} / {number(self.paper.replans, 1)}"


class ExecutionReport(Report[ExecutionRow]):
    """All runs; `facts` are the settings."""

    SETTINGS: ClassVar[Mapping[str, str]] = {}
    ROW = ExecutionRow
    DESIGN: ClassVar[Design]

    @property
    def executors(self) -> tuple[str, ...]:
        return self.options.executors or EXECUTORS

    @cached_property
    def _success(self) -> Mapping[str, Mapping[tuple[str, str, int], bool]]:
        found: dict[str, dict[tuple[str, str, int], bool]] = {}
        for row in self.rows:
            found.setdefault(row.executor, {})[row.case] = row.succeeded
        return found

    def cell(self, executor: str, column: str) -> Cell | None:
        """None where there was no run."""
        rows = [row for row in self.rows if row.executor == executor and row.column == column]
        if not rows:
            return None
        ours, theirs = self._success.get(DREEX, {}), self._success.get(executor, {})
        cases = [case for case in ours if case[0] == column and case in theirs]
        pairs = Pairing.of((ours[case], theirs[case]) for case in cases)
        successful = [row for row in rows if row.succeeded]
        return Cell(
            Proportion(len(successful), len(rows)),
            Mean.of(float(row.replans) for row in successful),
            None if executor == DREEX or not cases else pairs,
            self.DESIGN.paper_cell(executor, column),
        )

    @property
    def broken_promises(self) -> list[ExecutionRow]:
        """Counterexamples to the guarantee: there must be none."""
        return [row for row in self.rows if row.broken]

    def is_above(self, column: str) -> bool | None:
        """Whether DREEX covers more than every other executor in a column; None if it was not run there."""
        mine = self.cell(DREEX, column)
        others = [cell for one in self.executors if one != DREEX and (cell := self.cell(one, column)) is not None]
        if mine is None or not others:
            return None
        return all(mine.coverage.share > other.coverage.share for other in others)

    def has_few_replans(self, column: str) -> bool | None:
        """Whether DREEX's successful runs re-plan seldom; None without such runs."""
        mine = self.cell(DREEX, column)
        return None if mine is None or mine.replans is None else mine.replans.value < FEW_REPLANS

    @property
    def agrees(self) -> bool:
        """Whether all was run, no promise was broken, and what the paper claims of DREEX holds in every column."""
        claims = [claim(column) for column in self.DESIGN.columns for claim in (self.is_above, self.has_few_replans)]
        return super().agrees and not self.broken_promises and False not in claims

    @property
    def notes(self) -> tuple[str, ...]:
        promises = sum(row.promises for row in self.rows)
        broken = self.broken_promises
        notes = [
            "coverage with 95 % intervals (Wilson); re-plans: mean of successful runs; p: McNemar's exact test",
            f"{promises} plans had to succeed, because all was observed inside dynamically controllable boxes: "
            f"{sum(row.broken for row in broken)} did not",
        ]
        notes += [f"broken promise: {row.executor}, {row.problem}, seed {row.seed}" for row in broken[:5]]
        columns = self.DESIGN.columns
        notes += [f"{one}: DREEX is not above every other" for one in columns if self.is_above(one) is False]
        few = f"DREEX re-plans {FEW_REPLANS} times or more"
        notes += [f"{one}: {few}" for one in columns if self.has_few_replans(one) is False]
        return (*notes, *self.sweep_notes)

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        executors = tuple(dict.fromkeys(row["executor"] for row in answer["rows"]))
        names = ("problems", "runs", "planner", "drain", "seed")
        return {"executors": executors, **{name: answer["settings"][name] for name in names}}

    @classmethod
    def read_facts(cls, answer: Mapping[str, Any]) -> Any:
        return answer["settings"]

    @property
    def settings(self) -> Mapping[str, Any]:
        names = ("problems", "runs", "planner", "planner_s", "drain", "battery", "seed")
        values = {**vars(self.options), **self.facts}
        return {"settings": plain({name: values[name] for name in names})}

    @property
    def findings(self) -> Mapping[str, Any]:
        columns = []
        for column in self.DESIGN.columns:
            cells = {one: cell.facts for one in self.executors if (cell := self.cell(one, column)) is not None}
            claims = {"dreex_above_all": self.is_above(column), "few_replans": self.has_few_replans(column)}
            columns.append({"column": column, **claims, "cells": cells})
        return {"columns": columns}

    def by_column(self, executors: Sequence[str], text: Callable[[Cell], str]) -> list[tuple[str, ...]]:
        """A row for each executor."""
        columns = self.DESIGN.columns
        cells = {one: [self.cell(one, column) for column in columns] for one in executors}
        return [
            (label(one), *(NOTHING if cell is None else text(cell) for cell in found)) for one, found in cells.items()
        ]

    def coverage(self, text: Callable[[Cell], str]) -> Table:
        """In the paper's form, ours with intervals, and the paper's."""
        title = f"Table {self.DESIGN.number}, {self.DESIGN.title}: coverage [95 %] and re-plans, ours / the paper's"
        return Table(title, ("executor", *self.DESIGN.columns), self.by_column(self.executors, text), self.notes)

    @property
    def pairs(self) -> Table:
        """DREEX against each other executor."""

        def pair(cell: Cell) -> str:
            if cell.against is None:
                return NOTHING
            p = cell.against.p_value
            return f"{cell.against.first} : {cell.against.second}, {'< 0.0001' if p < 0.0001 else f'{p:.4f}'}"

        rows = self.by_column(self.executors[1:], pair)
        return Table("Cases that only DREEX solves : only the other, p", ("against", *self.DESIGN.columns), rows)

    @property
    def tables(self) -> list[Table]:
        return [self.coverage(lambda cell: f"{cell.covers}\n{cell.replanned(2)}"), self.pairs]


class Table1Report(ExecutionReport):
    """Of uncertain durations."""

    DESIGN = TABLE1_DESIGN


class Table2Report(ExecutionReport):
    """Of uncertain consumption."""

    DESIGN = TABLE2_DESIGN


# -- the experiments ---------------------------------------------------------------------------------------------------


def _prepare(design: Design, options: TableOptions, _: object) -> Mapping[str, Any]:
    """What the options leave open."""
    columns = options.columns or tuple(range(1, len(design.columns) + 1))
    executors = options.executors or EXECUTORS
    if not 1 <= options.problems <= 100:
        raise InputError(f"problems is {options.problems}; expected 1 to 100")
    if options.runs < 1:
        raise InputError(f"runs is {options.runs}; expected at least 1")
    for column in columns:
        if not 1 <= column <= len(design.columns):
            raise InputError(f"found column {column}, expected 1 to {len(design.columns)} in table {design.number}")
    if executors[0] != DREEX or set(executors) - set(EXECUTORS):
        raise InputError(f"found executors {', '.join(executors)}, expected dreex and then some of {EXECUTORS[1:]}")
    planner = design.planner if options.planner is None else options.planner
    create_planner(planner)  # before anything runs for long
    battery = BATTERY if options.battery is None else options.battery
    return {
        "columns": columns,
        "planner": planner,
        "planner_s": options.planner_limit,
        "drain": design.drain if options.drain is None else options.drain,
        "battery": battery if design is TABLE2_DESIGN else None,
    }


def _tasks(design: Design, options: TableOptions, facts: Mapping[str, Any]) -> list[ExecutionTask]:
    numbers = sorted(i * 37 % 100 for i in range(options.problems))  # spread over the deadlines of both orders
    return [
        ExecutionTask(
            design.number,
            column - 1,
            problem,
            options.seed + run,
            tuple(options.executors or EXECUTORS),
            facts["planner"],
            facts["planner_s"],
            facts["drain"],
            facts["battery"] or BATTERY,
        )
        for column in facts["columns"]
        for run in range(options.runs)
        for problem in numbers
    ]


def _rows(_options: TableOptions, _facts: object, results: Results) -> list[ExecutionRow]:
    return [row for _, rows in results for row in rows]


def _describe(task: ExecutionTask, rows: Sequence[ExecutionRow]) -> str:
    done = [row.executor for row in rows if row.succeeded]
    return f"{task.label}: {', '.join(done) or 'nobody'} succeeded"


def _experiment(design: Design, options: type[TableOptions], report: type[ExecutionReport]) -> Experiment:
    return Experiment(
        f"table{design.number}",
        options,
        partial(_tasks, design),
        run_case,
        tuple[ExecutionRow, ...],
        report,
        _describe,
        prepare=partial(_prepare, design),
        collect=_rows,
        lenient=True,
    )


TABLE1 = _experiment(TABLE1_DESIGN, Table1Options, Table1Report)
TABLE2 = _experiment(TABLE2_DESIGN, Table2Options, Table2Report)
