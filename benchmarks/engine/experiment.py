"""What an experiment is, and how it is run: options → tasks → records → a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from robust.errors import RobustError

from .codec import plain, restored
from .pool import Work
from .show import Table
from .sweep import Failure, Progress, Sweep, run_sweep

Row = TypeVar("Row")
Results = Sequence[tuple[Any, Any]]
"""Tasks with their records."""


@dataclass(frozen=True)
class Report(Generic[Row]):
    """What came of an experiment; `finished` is false where Ctrl-C came before the last of `total` tasks.

    An experiment says by a class of reports what its tables, figures and notes are. The class attributes say how it
    looks as JSON, from which :meth:`Experiment.read` makes it again.
    """

    SETTINGS: ClassVar[Mapping[str, str]] = {"limit_s": "limit", "jobs": "jobs"}
    """Options that the JSON repeats: its names for them, and ours."""
    ROWS: ClassVar[str] = "rows"
    ROW: ClassVar[Any] = Any
    FACTS: ClassVar[Any] = None
    """The type of `facts` where the JSON holds its fields."""
    NOTED: ClassVar[bool] = True
    """Whether notes are in the JSON."""

    experiment: Experiment
    options: Any
    facts: Any
    rows: tuple[Row, ...]
    failures: tuple[Failure, ...] = ()
    finished: bool = True
    total: int = 0
    sweep_notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        return self.finished

    @property
    def agrees(self) -> bool:
        """Whether everything was run, and is as it should be."""
        return self.complete and not self.failures

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures has to know."""
        return self.sweep_notes

    @property
    def findings(self) -> Mapping[str, Any]:
        """What the JSON says besides rows and settings."""
        return {}

    @property
    def tables(self) -> Sequence[Table]:
        """Tables for people."""
        raise NotImplementedError

    @property
    def shown(self) -> bool:
        """Whether there is something to draw."""
        return bool(self.rows)

    def draw(self, path: Path) -> None:
        """Draw the figure, if something is shown."""

    def printed(self, row: Row) -> Any:
        """A row as JSON."""
        return plain(row)

    @property
    def settings(self) -> Mapping[str, Any]:
        """Options as JSON."""
        return {name: plain(getattr(self.options, ours)) for name, ours in self.SETTINGS.items()}

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        """Options by name, from JSON."""
        return {ours: answer[name] for name, ours in cls.SETTINGS.items()}

    @classmethod
    def read_facts(cls, answer: Mapping[str, Any]) -> Any:
        """Facts, from JSON."""
        return None if cls.FACTS is None else restored(answer, cls.FACTS)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB, boxes and widths as exact text."""
        settings = dict(self.settings)
        answer: dict[str, Any] = {"schema": self.experiment.schema}
        if "suite" in settings:
            answer["suite"] = settings.pop("suite")
        answer |= {"complete": self.complete, "agrees": self.agrees, **settings}
        if self.NOTED:
            answer["notes"] = list(self.notes)
        if self.experiment.lenient:
            answer["failures"] = plain(self.failures)
        facts = plain(self.facts) if self.FACTS is not None else {}
        return {**answer, **facts, **plain(self.findings), self.ROWS: [self.printed(row) for row in self.rows]}

    @property
    def jobs_notes(self) -> list[str]:
        """What more than one process at a time does to timings."""
        jobs = self.options.jobs
        return [f"{jobs} processes ran at a time and disturbed each other's timings"] if jobs > 1 else []


@dataclass(frozen=True)
class Experiment:
    """An experiment: how tasks are made of options, what is done with one, and what its report is.

    Attributes:
        tasks: from options and facts.
        work: a function at the top of a module, from a task to a record.
        record: the type of the records.
        report: the class of its reports.
        describe: one line about a task and its record, for those who watch.
        prepare: what is found out before, such as a data set that is read; with the options and the progress.
        collect: the rows of the report, of options, facts, and tasks with records; without, these are the records.
        settled: see :func:`run_sweep`.
        lenient: whether tasks may fail; else the first failure is an error.
    """

    name: str
    options: type
    tasks: Callable[[Any, Any], Sequence[Any]]
    work: Work
    record: Any
    report: type[Report[Any]]
    describe: Callable[[Any, Any], str]
    prepare: Callable[[Any, Progress | None], Any] = field(default=lambda _options, _progress: None)
    collect: Callable[[Any, Any, Results], Sequence[Any]] = field(
        default=lambda _options, _facts, results: [record for _, record in results]
    )
    settled: Callable[[Any, Sequence[Any]], Any | None] | None = None
    lenient: bool = False

    @property
    def schema(self) -> str:
        return f"robust/bench-{self.name}/1"

    def run(self, options: Any = None, /, *, on_result: Progress | None = None, **given: Any) -> Report[Any]:
        """Run it with these options, or with those `given` by name.

        Returns:
            A report; after Ctrl-C, which ends what is running, of what is there.

        Raises:
            InputError: wrong options, or a data set that is missing or malformed.
            UnsupportedError: if something that the options ask for is not installed.
            RobustError: if a task failed that must not.
        """
        options = self.options(**given) if options is None else options
        facts = self.prepare(options, on_result)
        tasks = self.tasks(options, facts)
        sweep: Sweep[Any] = run_sweep(
            tasks,
            self.work,
            record=self.record,
            store=getattr(options, "store", None),
            jobs=options.jobs,
            cluster=getattr(options, "cluster", None),
            describe=self.describe,
            on_result=on_result,
            settled=self.settled,
        )
        if sweep.failures and not self.lenient:
            raise RobustError(f"{sweep.failures[0].task}: {sweep.failures[0].reason}")
        rows = tuple(self.collect(options, facts, sweep.results))
        report = self.report(
            self, options, facts, rows, sweep.failures, sweep.complete, sweep.total, sweep.notes if self.lenient else ()
        )
        plot = getattr(options, "plot", None)
        if plot is not None and report.shown:
            report.draw(plot)
        return report

    def read(self, answer: Mapping[str, Any]) -> Report[Any]:
        """The report that was printed as JSON.

        Raises:
            msgspec.ValidationError: if it was not.
            KeyError: likewise.
        """
        kind = self.report
        rows: tuple[Any, ...] = restored(answer[kind.ROWS], tuple[kind.ROW, ...])  # type: ignore[name-defined]
        return kind(
            self,
            self.options(**kind.read_options(answer)),
            kind.read_facts(answer),
            rows,
            restored(answer.get("failures", []), tuple[Failure, ...]),
            answer["complete"],
            len(rows),
            tuple(answer.get("notes", ())),
        )
