"""Options of what is asked about many plans at once: of :func:`robust.batch`, and of the commands of `robust batch`."""

from __future__ import annotations

from collections.abc import Callable, Collection
from fractions import Fraction
from pathlib import Path

from robust.backends import OFFERED
from robust.errors import InputError, Location
from robust.numbers import Number
from robust.options.declare import argument, option, ordinal, place_of, positive, seconds, writable
from robust.options.shared import (
    DRAWING,
    LIMIT,
    SOLVING,
    Output,
    PlanningOutput,
    PlanParameters,
    Separation,
    beta_option,
    doubling_option,
    encoding_option,
    method_option,
    solver_option,
)

Question = tuple[str, str, tuple[str, ...]]
"""Its name, and what is typed: the verb, and options."""
PLACES = SOLVING
"""Rank of where and how many at a time."""


def _table_file(path: Path, place: Location) -> Path:
    return writable(Path(path), place, "the table")


def _file(path: str | Path, _: Location) -> Path:
    return Path(path)


class BatchOptions(Separation, PlanningOutput, PlanParameters):
    """What all questions about many plans have in common; those of single plans have the same meaning there."""

    solver: str = solver_option()
    encoding: str = encoding_option()
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
    def common(self) -> list[str]:
        """What is typed for each plan, whatever is asked."""
        texts = [f"--epsilon={self.epsilon}", f"--solver={self.solver}", f"--encoding={self.encoding}"]
        texts += [f"--parameter={spec}" for spec in self.parameter]
        texts += [] if self.plan_number is None else [f"--plan-number={self.plan_number}"]
        texts += [] if self.tolerance is None else [f"--tolerance={self.tolerance}"]
        return texts

    @property
    def asked(self) -> tuple[Question, ...]:
        """What is asked about each plan."""
        return (self._one("check"),)

    def _one(self, verb: str, *more: str, name: str | None = None) -> Question:
        return name or verb, verb, (*self.common, *more)


class BatchCheckOptions(BatchOptions):
    """Of `robust.batch("check", ...)`."""


class BatchEnvelopeOptions(BatchOptions):
    """Of `robust.batch("envelope", ...)`."""

    method: str = method_option()
    beta: Number | None = beta_option()
    doubling: bool = doubling_option()

    @property
    def asked(self) -> tuple[Question, ...]:
        more = [f"--method={self.method}"]
        more += [] if self.beta is None else [f"--beta={Fraction(self.beta)}"]
        more += ["--doubling"] if self.doubling else []
        return (self._one("envelope", *more),)


class BatchRegionOptions(BatchOptions):
    """Of `robust.batch("region", ...)`."""

    backend: str = option("project", "who eliminates time points", choices=OFFERED)

    @property
    def asked(self) -> tuple[Question, ...]:
        return (self._one("region", f"--backend={self.backend}"),)


class BatchCompareOptions(BatchOptions):
    """Of `robust.batch("compare", ...)`."""

    beta: Number | None = option("1", "the precision of IRR", metavar="B", read=positive)
    doubling: bool = option(True, "whether steps of IRR double until the first failure, as in its published runs")
    region: str | None = option(
        None,
        "also compute the exact region of each plan, with which CCMMZ begins: who eliminates time points",
        choices=OFFERED,
    )

    @property
    def asked(self) -> tuple[Question, ...]:
        doubling = ["--doubling"] if self.doubling else []
        found = [
            self._one("envelope", "--method=irr", f"--beta={Fraction(self.beta or 1)}", *doubling, name="irr"),
            self._one("envelope", "--method=optimal", name="ccmmz"),
        ]
        return (*found, self._one("region", f"--backend={self.region}")) if self.region else tuple(found)


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
