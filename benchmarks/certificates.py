"""Certificates of all plans and boxes of a data set: how long solving, producing and checking take, and their sizes.

`python -m benchmarks.certificates --suite DIRECTORY` certifies each recorded plan at its nominal values (`plan`), all
over the box that widening finds (`box`), and that no valid box contains that one (`maximal`), checks each certificate,
and prints what it took as JSON, of which :mod:`benchmarks.results` makes a part of its page.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.machinery import SourceFileLoader
from math import fsum
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, ClassVar

from robust.api import check, envelope
from robust.certify.document import mismatch
from robust.certify.produce import PlanCertificate, digests
from robust.certify.verify import checker_path
from robust.encode import create_encoding
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box
from robust.smt.limits import NEVER

from .catalogue import RecordedOptions
from .engine.experiment import Experiment, Report, Task
from .engine.measure import COMMAND, Files
from .engine.show import Columns, Table, family
from .suite import read_deliveries, read_suite

KINDS = ("plan", "box", "maximal")
SLOWEST, LARGEST = 3.0, 10_000_000


@dataclass(frozen=True, slots=True)
class Measured:
    """One certificate: seconds in one process that has started already, seconds of whole processes, and its bytes.

    `solve` is the shortest way to the verdict without a certificate: checking the plan (`plan`) or the given box
    (`box`), or widening (`maximal`). `produce` makes the certificate, the search for the box excluded. `rejected` is
    why the checker, or the comparison with the input files, does not accept it.
    """

    instance: str
    kind: str
    parameters: int
    solve: float
    produce: float
    check: float
    size: int
    established: int
    folded: int
    rejected: str | None = None
    solve_process: float | None = None
    check_process: float | None = None

    @property
    def ratio(self) -> float:
        return self.check / self.solve

    @property
    def text(self) -> str:
        """Seconds of solving, producing and checking, the ratio, and the size."""
        if self.rejected:
            return "rejected"
        seconds = f"{self.solve:.3f}, {self.produce:.3f}, {self.check:.3f}"
        return f"{seconds}; {self.ratio:.2f}; {self.size / 1000:.0f} kB"


def measure(name: str, files: Files, processes: bool = True) -> tuple[Measured, ...]:
    """The certificates of one plan."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        return tuple(_measure(name, files, Path(directory), processes))


def _measure(name: str, files: Files, directory: Path, processes: bool) -> Iterator[Measured]:
    plan = load_plan(*files)
    point_s, _ = _timed(lambda: check(plan))
    widening_s, found = _timed(lambda: envelope(plan))
    box_s, _ = _timed(lambda: check(plan, at=found.box.intervals))
    boxes = {"plan": Box.nominal(plan.parameters), "box": found.box, "maximal": found.box}
    for kind, solve in zip(KINDS, (point_s, box_s, widening_s), strict=True):
        path = directory / f"{name}-{kind}.cert"
        made, size = _timed(partial(produce, plan, files, kind, boxes[kind], path))
        checked, (lines, rejected) = _timed(partial(run_checker, path, files))
        verb = "check" if kind == "plan" else "envelope"
        yield Measured(
            instance=name,
            kind=kind,
            parameters=len(plan.parameters),
            solve=solve,
            produce=made,
            check=checked,
            size=size,
            established=sum(line.startswith("established") for line in lines),
            folded=sum(json.loads(line)[0] == "folded" for line in list(_CHECKER.lines_of(str(path)))[1:]),
            rejected=rejected or mismatch(path, plan, NEVER),
            solve_process=_process([*COMMAND, verb, *map(str, files), "--quiet"]) if processes else None,
            check_process=_process([sys.executable, "-I", str(checker_path()), str(path)]) if processes else None,
        )


def produce(plan: ParametrizedPlan, files: Files, kind: str, box: Box, path: Path) -> int:
    """Write a certificate; its size in bytes."""
    inputs = digests(dict(zip(("domain", "problem", "plan"), files, strict=True)))
    made = PlanCertificate(create_encoding("relational", plan), kind=kind, inputs=inputs, box=box)
    made.add_box()
    if kind == "maximal":
        made.add_witnesses()
    return made.writer.save(path)


def run_checker(path: Path, files: Files) -> tuple[list[str], str | None]:
    """What the checker says in this process, and why it rejects."""
    given = {name: str(file) for name, file in zip(("domain", "problem", "plan"), files, strict=True)}
    try:
        return _CHECKER.check(str(path), given), None
    except _CHECKER.Rejected as error:
        return [], str(error)


def _load_checker() -> Any:
    loader = SourceFileLoader("certificate_checker", str(checker_path()))
    module = ModuleType(loader.name)
    loader.exec_module(module)
    return module


_CHECKER = _load_checker()


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    started = time.perf_counter()
    found = work()
    return time.perf_counter() - started, found


def _process(command: Sequence[str]) -> float:
    return _timed(lambda: subprocess.run(command, check=True, capture_output=True))[0]


# -- the report --------------------------------------------------------------------------------------------------------


TOTALS: Columns[Sequence[Measured]] = {
    "kind": lambda found: found[0].kind,
    "certificates": len,
    **family("{} s", ("solve", "produce", "check"), lambda name, found: fsum(getattr(each, name) for each in found)),
    "check / solve": lambda found: median(each.ratio for each in found),
    "greatest": lambda found: max(each.ratio for each in found),
    "MB": lambda found: sum(each.size for each in found) / 1e6,
    "largest MB": lambda found: max(each.size for each in found) / 1e6,
}


BY_PLAN: Columns[Sequence[Measured]] = {
    "instance": lambda found: found[0].instance,
    "parameters": lambda found: found[0].parameters,
    **family("{}", KINDS, lambda kind, found: next((each.text for each in found if each.kind == kind), None)),
}


class CertificateReport(Report[Measured]):
    """All plans and boxes of the recorded data, relational encoding (`python -m benchmarks.certificates`).
    *plan*: valid at the nominal values. *box*: all over the box that widening finds. *maximal*: and no valid box
    contains it. Solving is the shortest way to the same verdict without a certificate: checking the plan, checking the
    given box, widening. Solving and checking are timed in one process that has started already, so that no start-up
    hides what they take; reading PDDL is left out. Every certificate is checked with its input files, and compared with
    what these become in the encoding.
    """

    TITLE = "Certificates"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", "jobs": "jobs"}
    ROW = Measured

    def sound(self) -> bool:
        return not any(each.rejected for each in self.rows)

    def contents(self) -> list[Table]:
        """By kind, and by plan: seconds of solving, producing and checking; checking / solving; kilobytes."""
        kinds = [found for kind in KINDS if (found := self.of(kind=kind))]
        plans = [self.of(instance=name) for name in dict.fromkeys(each.instance for each in self.rows)]
        title = "Each plan: seconds of solving, producing and checking; checking / solving; kilobytes"
        return [Table.of("All certificates", TOTALS, kinds), Table.of(title, BY_PLAN, plans)]

    def remarks(self) -> Sequence[str]:
        rejected = [each for each in self.rows if each.rejected]
        slowest = max(self.rows, key=lambda each: each.ratio)
        largest = max(self.rows, key=lambda each: each.size)
        plans = len({each.instance for each in self.rows})
        pairs = [(each.check_process, each.solve_process) for each in self.rows]
        processes = "whole processes, from start to end, `robust check` or `robust envelope` against the checker"
        whole = [check / solve for check, solve in pairs if check and solve]
        return [
            f"{len(self.rows) - len(rejected)} of {len(self.rows)} certificates of {plans} plans are accepted",
            f"the greatest ratio of checking to solving is {slowest.ratio:.2f} ({slowest.instance}, {slowest.kind}); "
            f"aim: less than {SLOWEST:g}",
            f"the largest certificate has {largest.size / 1e6:.2f} MB ({largest.instance}, {largest.kind}); aim: less "
            f"than {LARGEST / 1e6:g} MB",
            *([f"{processes}: {max(whole):.2f} at most, {median(whole):.2f} median"] if whole else []),
            *(f"not accepted: {each.instance}, {each.kind}: {each.rejected}" for each in rejected),
        ]


def _prepare(options: RecordedOptions, _: object) -> list[tuple[str, Files]]:
    plans = [(one.name, one.files) for one in read_suite(options.suite)]
    plans += [(one.instance, files) for one, files in read_deliveries(options.suite)]
    measure(*plans[0], processes=False)  # so that everything is loaded
    return plans


CERTIFICATES = Experiment(
    "certificates",
    RecordedOptions,
    lambda _, plans: [Task(name, (name, files)) for name, files in plans],
    measure,
    CertificateReport,
    lambda found: ", ".join(f"{each.kind} {each.text}" for each in found),
    prepare=_prepare,
)

if __name__ == "__main__":
    shown = CERTIFICATES.run(suite=Path(sys.argv[-1]), on_result=lambda *line: print(*line, file=sys.stderr))
    print(json.dumps(shown.as_dict()))
