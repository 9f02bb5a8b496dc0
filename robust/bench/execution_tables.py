"""Tables 1 and 2 of the paper: coverage and re-plans of each executor [IRR §5], beside the paper's own figures.

A case is a problem, a column (how much is uncertain) and a seed of the world; every executor runs every case, so that
executors can be compared in pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from robust.bench.execution_statistics import Mean, Pairing, Proportion

if TYPE_CHECKING:
    from rich.table import Table

DREEX = "dreex"
SHARES = tuple(range(0, 70, 10))
EXECUTORS = (DREEX, *(f"blex:{share}" for share in SHARES))
FEW_REPLANS = 0.3
"""Successful runs under DREEX are to take fewer re-plans than this on average."""


@dataclass(frozen=True, slots=True)
class PaperCell:
    """What the paper reports: coverage in per cent, and average re-plans of successful runs (None: no such run)."""

    coverage: float
    replans: float | None


@dataclass(frozen=True, slots=True)
class TableDesign:
    """One of the tables: its columns by name, and the paper's figures by executor in the order of the columns."""

    number: int
    title: str
    columns: tuple[str, ...]
    paper: Mapping[str, tuple[PaperCell, ...]]

    @property
    def schema(self) -> str:
        return f"robust/bench-table{self.number}/1"

    def paper_cell(self, executor: str, column: str) -> PaperCell:
        return self.paper[executor][self.columns.index(column)]


def _cells(*pairs: tuple[float, float | None]) -> tuple[PaperCell, ...]:
    return tuple(PaperCell(coverage, replans) for coverage, replans in pairs)


TABLE1 = TableDesign(
    1,
    "uncertain durations",
    ("1 parameter", "2 parameters", "3 parameters", "4 parameters", "5 parameters"),
    {
        DREEX: _cells((92.2, 0.1), (85.8, 0.2), (83.2, 0.2), (72.8, 0.1), (63.0, 0.1)),
        "blex:0": _cells((0.0, None), (0.0, None), (0.0, None), (0.0, None), (0.0, None)),
        "blex:10": _cells((24.5, 1.0), (4.8, 1.0), (0.8, 1.2), (0.2, 0.8), (0.0, None)),
        "blex:20": _cells((44.4, 0.8), (19.9, 1.0), (6.3, 1.0), (2.4, 1.6), (0.8, 1.9)),
        "blex:30": _cells((58.9, 0.7), (34.0, 0.9), (18.8, 1.2), (9.2, 1.2), (4.5, 1.4)),
        "blex:40": _cells((68.8, 0.6), (52.2, 0.8), (34.7, 1.0), (23.8, 1.1), (11.8, 1.5)),
        "blex:50": _cells((75.0, 0.5), (62.2, 0.7), (49.0, 0.9), (37.8, 1.1), (27.9, 1.2)),
        "blex:60": _cells((78.8, 0.4), (69.0, 0.5), (59.4, 0.7), (53.4, 0.9), (44.5, 1.1)),
    },
)
TABLE2 = TableDesign(
    2,
    "uncertain consumption",
    ("battery",),
    {
        DREEX: _cells((99.2, 0.1)),
        "blex:0": _cells((1.0, 2.0)),
        "blex:10": _cells((25.6, 0.1)),
        "blex:20": _cells((50.7, 0.1)),
        "blex:30": _cells((66.4, 0.1)),
        "blex:40": _cells((77.9, 0.1)),
        "blex:50": _cells((82.1, 0.1)),
        "blex:60": _cells((86.8, 0.1)),
    },
)


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

    def as_dict(self) -> dict[str, Any]:
        return {
            "column": self.column,
            "executor": self.executor,
            "problem": self.problem,
            "seed": self.seed,
            "succeeded": self.succeeded,
            "replans": self.replans,
            "promises": self.promises,
            "broken": self.broken,
            "seconds": round(self.seconds, 4),
            "reason": self.reason,
        }


@dataclass(frozen=True)
class Cell:
    """One executor in one column: coverage, re-plans of successful runs, and the pairing of DREEX with it."""

    coverage: Proportion
    replans: Mean | None
    against: Pairing | None
    paper: PaperCell

    def as_dict(self) -> dict[str, Any]:
        lower, upper = self.coverage.interval()
        interval = None if self.replans is None else self.replans.interval
        return {
            "runs": self.coverage.trials,
            "succeeded": self.coverage.successes,
            "coverage": [round(lower, 4), round(upper, 4)],
            "replans": None if self.replans is None else round(self.replans.value, 4),
            "replans_interval": None if interval is None else [round(end, 4) for end in interval],
            "dreex_only": None if self.against is None else self.against.first,
            "this_only": None if self.against is None else self.against.second,
            "p_value": None if self.against is None else float(f"{float(self.against.p_value):.3g}"),
            "paper_coverage": self.paper.coverage,
            "paper_replans": self.paper.replans,
        }


@dataclass(frozen=True)
class ExecutionReport:
    """All runs; `complete` is false where Ctrl-C came before the last one."""

    design: TableDesign
    executors: tuple[str, ...]
    rows: tuple[ExecutionRow, ...]
    failures: tuple[tuple[str, str], ...]
    complete: bool
    settings: Mapping[str, Any]
    sweep_notes: tuple[str, ...] = ()

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
        successful = [row for row in rows if row.succeeded]
        return Cell(
            Proportion(len(successful), len(rows)),
            Mean.of(float(row.replans) for row in successful),
            self._against(executor, column),
            self.design.paper_cell(executor, column),
        )

    def _against(self, executor: str, column: str) -> Pairing | None:
        ours, theirs = self._success.get(DREEX, {}), self._success.get(executor, {})
        cases = [case for case in ours if case[0] == column and case in theirs]
        if executor == DREEX or not cases:
            return None
        return Pairing.of((ours[case], theirs[case]) for case in cases)

    @property
    def broken_promises(self) -> tuple[ExecutionRow, ...]:
        """Counterexamples to the guarantee: there must be none."""
        return tuple(row for row in self.rows if row.broken)

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
        claims = [claim(column) for column in self.design.columns for claim in (self.is_above, self.has_few_replans)]
        return self.complete and not self.failures and not self.broken_promises and False not in claims

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        promises = sum(row.promises for row in self.rows)
        notes = [
            "coverage with 95 % intervals (Wilson); re-plans: mean of successful runs; p: McNemar's exact test",
            f"{promises} plans had to succeed, because all was observed inside dynamically controllable boxes: "
            f"{sum(row.broken for row in self.broken_promises)} did not",
        ]
        notes += [f"broken promise: {row.executor}, {row.problem}, seed {row.seed}" for row in self.broken_promises[:5]]
        notes += [f"{column}: DREEX is not above every other" for column in self._where(self.is_above)]
        notes += [
            f"{column}: DREEX re-plans {FEW_REPLANS} times or more" for column in self._where(self.has_few_replans)
        ]
        return (*notes, *self.sweep_notes)

    def _where(self, claim: Callable[[str], bool | None]) -> Sequence[str]:
        return [column for column in self.design.columns if claim(column) is False]

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; coverage between 0 and 1, the paper's in per cent."""
        return {
            "schema": self.design.schema,
            "complete": self.complete,
            "agrees": self.agrees,
            "settings": dict(self.settings),
            "notes": list(self.notes),
            "failures": [{"task": task, "reason": reason} for task, reason in self.failures],
            "columns": [
                {
                    "column": column,
                    "dreex_above_all": self.is_above(column),
                    "few_replans": self.has_few_replans(column),
                    "cells": {
                        one: cell.as_dict() for one in self.executors if (cell := self.cell(one, column)) is not None
                    },
                }
                for column in self.design.columns
            ],
            "rows": [row.as_dict() for row in self.rows],
        }

    def tables(self) -> list[Table]:
        """In the paper's form, ours and the paper's figures; and the paired comparison."""
        from robust.bench.execution_layout import execution_tables  # noqa: PLC0415 - rich only when shown

        return execution_tables(self)


def share_of(executor: str) -> Fraction | None:
    """What deviation a BLEX accepts; None for DREEX."""
    return None if executor == DREEX else Fraction(int(executor.removeprefix("blex:")), 100)
