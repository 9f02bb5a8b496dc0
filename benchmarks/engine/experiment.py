"""What an experiment is, and how it is run: options → tasks → records → a report as text, JSON, Markdown and figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import getdoc
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar, get_type_hints

from robust.errors import RobustError
from robust.json_text import plain
from robust.sweeps.sweep import Progress, Sweep, Task, TaskFailure, Work, restored, run_sweep

from .show import Panel, Table, bullets, draw, page

__all__ = ["Experiment", "Report", "Results", "Task"]

Row = TypeVar("Row")
Results = Sequence[tuple[Task, Any]]
"""Tasks with their records."""


@dataclass(frozen=True)
class Report(Generic[Row]):
    """What came of an experiment; `finished` is false where Ctrl-C came before the last of `total` tasks.

    An experiment says by a class of reports what its tables, figures and notes are; the docstring of the class is what
    the page with results says before them. The class attributes say how it looks as JSON, from which
    :meth:`Experiment.read` makes it again.
    """

    TITLE: ClassVar[str] = ""
    """On the page with results."""
    SETTINGS: ClassVar[Mapping[str, str]] = {"limit_s": "limit", "jobs": "jobs"}
    """Options that the JSON repeats: its names for them, and ours."""
    ROWS: ClassVar[str] = "rows"
    ROW: ClassVar[Any] = None
    """The type of a row, if that is not a record."""
    RAN: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Options that name what ran, and the fields of rows that do."""
    FACTS: ClassVar[Any] = None
    """The type of `facts` where the JSON holds its fields."""
    NOTED: ClassVar[bool] = True
    """Whether notes are in the JSON."""
    LAYOUT: ClassVar[tuple[float, float, str]] = (5, 4, "best")
    """Width and height of each panel of the figure, and where the legend is."""

    experiment: Experiment
    options: Any
    facts: Any
    rows: tuple[Row, ...]
    failures: tuple[TaskFailure, ...] = ()
    finished: bool = True
    total: int = 0
    sweep_notes: tuple[str, ...] = ()

    def of(self, **fields: Any) -> list[Row]:
        """The rows whose fields have these values."""
        return [row for row in self.rows if all(getattr(row, name) == value for name, value in fields.items())]

    @property
    def complete(self) -> bool:
        return self.finished

    @property
    def agrees(self) -> bool:
        """Whether everything was run, and is as it should be."""
        return self.complete and not self.failures and self.sound()

    def sound(self) -> bool:
        """Whether what was run is as it should be."""
        return True

    def remarks(self) -> Sequence[str]:
        """What a reader of the figures has to know."""
        return ()

    @property
    def notes(self) -> tuple[str, ...]:
        """The same, what more than one process at a time does to timings, and what is missing."""
        jobs = self.options.jobs
        disturbed = [f"{jobs} processes ran at a time and disturbed each other's timings"] if jobs > 1 else []
        of = f" of {self.total}" if self.total > len(self.rows) else ""
        missing = [f"incomplete: interrupted after {len(self.rows)}{of} {self.experiment.unit}"]
        if self.complete or self.sweep_notes:
            missing = []
        return tuple(dict.fromkeys((*self.remarks(), *disturbed, *self.sweep_notes, *missing)))

    def findings(self) -> Mapping[str, Any]:
        """What the JSON says besides rows and settings."""
        return {}

    def contents(self) -> Sequence[Table]:
        """Tables for people, without notes."""
        raise NotImplementedError

    def conclusions(self) -> Sequence[str]:
        """What can be said about them in sentences."""
        return ()

    @property
    def tables(self) -> list[Table]:
        """The tables, with notes and conclusions below the last one."""
        *others, last = self.contents()
        return [*others, replace(last, notes=(*self.notes, *self.conclusions()))]

    def panels(self) -> Sequence[Panel]:
        """The figure; empty if there is nothing to draw."""
        return ()

    def plot(self) -> None:
        """Draw the figure where the options say, if there is anything to draw; InputError if it cannot be written."""
        path: Path | None = getattr(self.options, "plot", None)
        if path is not None and (panels := self.panels()):
            width, height, legend = self.LAYOUT
            draw(path, panels, width, height, legend=legend)

    def page_contents(self) -> Sequence[Table]:
        """The tables of the page with results."""
        return self.contents()

    def section(self, date: str | None = None, *, level: int = 2) -> str:
        """A section of the page with results."""
        about = " ".join((getdoc(type(self)) or "").split())
        if date is not None:
            about += f" Measured on {date}."
        shown: list[str] = []
        for table in self.page_contents():
            shown += [f"{table.title}:" if table.title else "", table.markdown]
        missing = "" if self.complete and not self.failures else "NOT all was run."
        title = f"{'#' * level} {self.TITLE}"
        return page(title, about, missing, bullets(self.notes), *shown, bullets(self.conclusions()))

    def printed(self, row: Row) -> Any:
        """A row as JSON."""
        return plain(row)

    def settings(self) -> Mapping[str, Any]:
        """Options as JSON."""
        return {name: plain(getattr(self.options, ours)) for name, ours in self.SETTINGS.items()}

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        """Options by name, from JSON."""
        ran = {ours: tuple(dict.fromkeys(row[name] for row in answer[cls.ROWS])) for ours, name in cls.RAN}
        return {**{ours: answer[name] for name, ours in cls.SETTINGS.items()}, **ran}

    @classmethod
    def read_facts(cls, answer: Mapping[str, Any]) -> Any:
        """Facts, from JSON."""
        return None if cls.FACTS is None else restored(answer, cls.FACTS)

    def as_dict(self) -> dict[str, Any]:
        """What `--json` prints; times in seconds, memory in MiB, boxes and widths as exact text."""
        settings = dict(self.settings())
        answer: dict[str, Any] = {"schema": self.experiment.schema}
        if "suite" in settings:
            answer["suite"] = settings.pop("suite")
        answer |= {"complete": self.complete, "agrees": self.agrees, **settings}
        if self.NOTED:
            answer["notes"] = list(self.notes)
        if self.experiment.lenient:
            answer["failures"] = plain(self.failures)
        facts = plain(self.facts) if self.FACTS is not None else {}
        return {**answer, **facts, **plain(self.findings()), self.ROWS: [self.printed(row) for row in self.rows]}


@dataclass(frozen=True)
class Experiment:
    """An experiment: how tasks are made of options, what is done with one, and what its report is.

    Attributes:
        tasks: from options and facts.
        measure: a function at the top of a module, from the arguments of a task to a record of the type that it names.
        report: the class of its reports.
        describe: some words about a record, for those who watch.
        prepare: what is found out before, such as a data set that is read; with the options and the progress.
        collect: the rows of the report, of options, facts, and tasks with records; without, these are the records, or
            what is in them if they are tuples.
        settled: see :func:`run_sweep`.
        lenient: whether tasks may fail; else the first failure is an error.
        unit: what its tasks are called.
    """

    name: str
    options: type
    tasks: Callable[[Any, Any], Sequence[Task]]
    measure: Work
    report: type[Report[Any]]
    describe: Callable[[Any], str]
    prepare: Callable[[Any, Progress | None], Any] = field(default=lambda _options, _progress: None)
    collect: Callable[[Any, Any, Results], Sequence[Any]] = field(default=lambda *given: _flat(given[-1]))
    settled: Callable[[Task, Sequence[Any]], Any | None] | None = None
    lenient: bool = False
    unit: str = "runs"

    @property
    def schema(self) -> str:
        return f"robust/bench-{self.name}/1"

    @property
    def record(self) -> Any:
        """The type of the records."""
        return get_type_hints(self.measure)["return"]

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
        sweep: Sweep = run_sweep(
            tasks,
            self.measure,
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
        notes = sweep.notes if self.lenient or hasattr(options, "store") else ()
        return self.report(self, options, facts, rows, sweep.failures, sweep.complete, sweep.total, notes)

    def read(self, answer: Mapping[str, Any]) -> Report[Any]:
        """The report that was printed as JSON.

        Raises:
            msgspec.ValidationError: if it was not.
            KeyError: likewise.
        """
        kind = self.report
        rows: tuple[Any, ...] = restored(answer[kind.ROWS], tuple[kind.ROW or self.record, ...])  # type: ignore[misc]
        options, facts = self.options(**kind.read_options(answer)), kind.read_facts(answer)
        failures: tuple[TaskFailure, ...] = restored(answer.get("failures", []), tuple[TaskFailure, ...])
        notes = tuple(answer.get("notes", ()))
        return kind(self, options, facts, rows, failures, answer["complete"], len(rows), notes)


def _flat(results: Results) -> list[Any]:
    return [row for _, record in results for row in (record if isinstance(record, tuple) else (record,))]
