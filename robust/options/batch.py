"""Options of what is asked about many plans at once: of :func:`robust.batch`, and of the commands of `robust batch`."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from robust.backends import OFFERED
from robust.errors import InputError, Location
from robust.numbers import Number
from robust.options.declare import argument, option, ordinal, place_of, positive, seconds, typed, writable
from robust.options.shared import (
    DRAWING,
    LIMIT,
    SOLVING,
    AnyBoxOptions,
    BoxOptions,
    Encoded,
    Output,
    PlanningOutput,
    PlanParameters,
    Separation,
    Solver,
)
from robust.options.verbs import Elimination

Question = tuple[str, str, tuple[str, ...]]
"""Its name, and what is typed: the verb, and options."""
PLACES = SOLVING
"""Rank of where and how many at a time."""


def _table_file(path: Path, place: Location) -> Path:
    return writable(Path(path), place, "the table")


def _file(path: str | Path, _: Location) -> Path:
    return Path(path)


class BatchOptions(Separation, PlanningOutput, PlanParameters, Encoded, Solver):
    """What all questions about many plans have in common; those of single plans have the same meaning there."""

    jobs: int = option(
        1, "processes at a time on this machine; more than 1 disturbs timings", metavar="N", read=ordinal, rank=PLACES
    )
    cluster: str | None = option(
        None,
        "run on the workers of this Dask scheduler instead, which get the texts of the files (extra cluster)",
        metavar="ADDRESS",
        rank=PLACES,
    )
    store: Path | None = option(
        None,
        "keep answers as they arrive; the same command with the same FILE asks only what is not there",
        metavar="FILE",
        path=True,
        read=_file,
        rank=PLACES,
    )
    limit: Number | None = option(
        None,
        "seconds for each plan, after which what is known of it is its answer",
        metavar="S",
        read=seconds,
        rank=LIMIT,
    )
    timeout: Number | None = option(
        None,
        "seconds for all plans, after which those that are answered are shown",
        metavar="S",
        read=seconds,
        rank=LIMIT,
    )
    on_result: Callable[[int, int, str], None] | None = option(
        None, "called after each answer with their number, the total and a line about it", shown=False
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.cluster is not None and self.jobs != 1:
            raise InputError("found it with a cluster, expected one of the two", place_of("jobs"))

    @property
    def asked(self) -> tuple[Question, ...]:
        """What is asked about each plan."""
        return (self._ask("check"),)

    def _ask(self, verb: str, *words: str, name: str | None = None) -> Question:
        return name or verb, verb, (*typed(self, Separation, Solver, Encoded, PlanningOutput, PlanParameters), *words)


class BatchCheckOptions(BatchOptions):
    """Of `robust.batch("check", ...)`."""


class BatchEnvelopeOptions(BatchOptions, AnyBoxOptions):
    """Of `robust.batch("envelope", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("envelope", *typed(self, AnyBoxOptions)),)


class BatchRegionOptions(BatchOptions, Elimination):
    """Of `robust.batch("region", ...)`."""

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._ask("region", *typed(self, Elimination)),)


class BatchCompareOptions(BatchOptions):
    """Of `robust.batch("compare", ...)`."""

    beta: Number | None = option("1", "the precision of IRR", metavar="B", read=positive)
    doubling: bool = option(True, "whether steps of IRR double until the first failure, as in its published runs")
    region: str | None = option(
        None,
        "also compute the exact region of each plan, with which CCMMZ begins: the quantifier-elimination back end",
        choices=OFFERED,
    )

    @property
    def asked(self) -> tuple[Question, ...]:
        irr = BoxOptions(method="irr", beta=self.beta, doubling=self.doubling)
        found = (
            self._ask("envelope", *typed(irr, BoxOptions), name="irr"),
            self._ask("envelope", "--method=optimal", name="ccmmz"),
        )
        return found if self.region is None else (*found, self._ask("region", f"--backend={self.region}"))


class AnyBatchOptions(BatchEnvelopeOptions, BatchRegionOptions, BatchCompareOptions):
    """What :func:`robust.batch` takes for one verb or another; each verb takes its own only."""


BATCHES: dict[str, type[BatchOptions]] = {
    "check": BatchCheckOptions,
    "envelope": BatchEnvelopeOptions,
    "region": BatchRegionOptions,
    "compare": BatchCompareOptions,
}
"""Options by verb."""


class BatchCommand(BatchOptions, Output):
    """What all commands of `robust batch` have."""

    suite: Path = argument(
        ..., "folder of plans with their problems and domains, or a list of them (lines, .json, .csv)", "SUITE"
    )
    csv: Path | None = option(
        None, "write a line for each plan as CSV", metavar="FILE", path=True, read=_table_file, rank=DRAWING
    )
    html: Path | None = option(
        None,
        "write the table as one HTML page that needs no network",
        metavar="FILE",
        path=True,
        read=_table_file,
        rank=DRAWING,
    )


class BatchCheckCommand(BatchCheckOptions, BatchCommand):
    """Of `robust batch check`."""


class BatchEnvelopeCommand(BatchEnvelopeOptions, BatchCommand):
    """Of `robust batch envelope`."""


class BatchRegionCommand(BatchRegionOptions, BatchCommand):
    """Of `robust batch region`."""


class BatchCompareCommand(BatchCompareOptions, BatchCommand):
    """Of `robust batch compare`."""
