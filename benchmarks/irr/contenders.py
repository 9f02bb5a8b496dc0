"""What the comparisons run: ways to an envelope, and reports about which of them solves how much within which time."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..engine.experiment import Report, Results
from ..engine.measure import FAILURES, Files, Run, run_robust
from ..engine.show import NOTHING, Columns, Table, family, middle, number

BACKENDS = ("project", "z3", "cvc5", "fourier-motzkin", "loos-weispfenning")
"""The elimination back ends that are compared; each has another idea behind it."""
MARKS = (0.5, 1, 2, 5, 10, 60, 600, 3600)
"""Seconds at which the tables count what is solved."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A way to an envelope: the verb and the options of the command line."""

    name: str
    label: str
    verb: str
    options: tuple[str, ...]

    def run(self, files: Files, *, limit: float | None = None, extra: Sequence[str] = ()) -> Run:
        """Run the command on the files as a process of its own."""
        return run_robust(self.verb, files, [*self.options, *extra], limit=limit)


IRR = Contender("irr", "IRR", "envelope", ("--method", "irr", "--beta", "1", "--doubling"))
WIDEN = Contender("widen", "exact widening", "envelope", ("--method", "widen"))
OPTIMAL = Contender("optimal", "optimal box", "envelope", ("--method", "optimal"))
RECORDED_BOX = Contender("recorded-box", "recorded IRR box, checked", "check", ())
"""Not a way to an envelope: a proof that the recorded box is inside it, which needs no region."""
REGIONS = tuple(
    Contender(name, f"region, {name}", "region", ("--backend", name, "--form", "difference")) for name in BACKENDS
)
"""The form is the one in which the region is computed: turning it into another would be measured as well."""
OURS = (IRR, WIDEN)
BASELINE = (OPTIMAL, *REGIONS)
"""What CCMMZ computed: exact regions, by several back ends, and the widest box."""


def run_cell(run: Run | None) -> str:
    """Processor seconds of a complete run, else how it ended."""
    if run is None:
        return NOTHING
    return number(run.cpu_s) if run.complete else run.status.value.replace("timeout", "out of time")


@dataclass(frozen=True, slots=True)
class Curve:
    """Processor seconds of the solved instances in ascending order, of one method in one group of instances."""

    name: str
    label: str
    times: tuple[float, ...]
    recorded: bool = False

    @staticmethod
    def of(name: str, label: str, times: Iterable[float | None], *, recorded: bool = False) -> Curve:
        """Without times that are not known."""
        return Curve(name, label, tuple(sorted(time for time in times if time is not None)), recorded)

    def solved_within(self, seconds: float) -> int:
        return sum(time <= seconds for time in self.times)


class ContendersReport(Report[Any]):
    """Of some contenders, or all of them."""

    CONTENDERS: ClassVar[tuple[Contender, ...]] = ()

    @property
    def contenders(self) -> tuple[Contender, ...]:
        chosen: tuple[Contender, ...] | None = self.options.contenders
        return self.CONTENDERS if chosen is None else chosen


class MethodsReport(ContendersReport):
    """Rows with a `group`, and `runs` by the names of the contenders."""

    @property
    def groups(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(row.group for row in self.rows))

    @property
    def wrong(self) -> list[str]:
        """Runs that ended in an error."""
        runs = ((row.name, name, run) for row in self.rows for name, run in row.runs.items())
        return [f"{instance}, {name}: {run.text}" for instance, name, run in runs if run.status in FAILURES]

    def runs(self, group: str, method: str) -> list[Run]:
        return [row.runs[method] for row in self.of(group=group) if method in row.runs]

    def curves(self, group: str) -> list[Curve]:
        """Of all ways to an envelope, in the order of the contenders."""
        return [
            Curve.of(one.name, one.label, [run.cpu_s for run in self.runs(group, one.name) if run.complete])
            for one in self.contenders
            if one.verb != "check"
        ]

    def solved(self, group: str, marks: Collection[float] = MARKS) -> Table:
        """For each method, how many instances are solved within which time."""
        columns: Columns[Curve] = {
            "method": lambda one: one.label,
            **family("{:g} s", marks, lambda mark, one: one.solved_within(mark)),
            "median, s": lambda one: middle(one.times),
            "slowest solved, s": lambda one: max(one.times, default=None),
        }
        title = f"{group}: solved within, of {len(self.of(group=group))}"
        return Table.of(title, columns, self.curves(group), whole=False)


def by_instance(results: Results) -> dict[str, dict[str, Any]]:
    """Records by the name of the instance, and of the contender; these are what tasks begin with."""
    found: dict[str, dict[str, Any]] = {}
    for task, record in results:
        instance, contender, *_ = task.given
        found.setdefault(instance.name, {})[contender.name] = record
    return found


def limits_text(limit: float | None, own: Mapping[str, float]) -> str:
    """Limits of runs in words: that of all, and those of some."""
    text = "no limit" if limit is None else f"a limit of {limit:g} s"
    return text + " each" + "".join(f", {name} {seconds:g} s" for name, seconds in own.items())
