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
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from math import fsum
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robust.api import check, envelope
from robust.certify.checker.__main__ import Inputs, report
from robust.certify.produce import PlanCertificate
from robust.certify.tape import write
from robust.certify.verify import verify
from robust.encode import create_encoding
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box

from .catalogue import RecordedOptions
from .engine.experiment import Experiment, Report, Task
from .engine.measure import COMMAND, Files
from .engine.show import Columns, Table, family
from .suite import read_deliveries, read_suite

KINDS = ("plan", "box", "maximal")
EPSILON = Fraction(1, 1000)
MEDIAN, SLOWEST, COSTLIEST, LARGEST = 0.5, 1.0, 3.0, 100_000
"""The median of checking / solving; seconds to check a box; producing / solving for boxes; bytes."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One certificate: seconds in one process that has started already, seconds of whole processes, and its bytes.

    `solve` is the shortest way to the verdict without a certificate: checking the plan (`plan`), or widening (`box`,
    `maximal`). `produce` makes the certificate, the search for the box excluded. `refuted` of the obligations are not
    constant by what the checker folds. `rejected` is why the checker does not accept the certificate.
    """

    instance: str
    kind: str
    parameters: int
    solve: float
    produce: float
    check: float
    size: int
    obligations: int
    refuted: int
    rejected: str | None = None
    solve_process: float | None = None
    check_process: float | None = None

    @property
    def ratio(self) -> float:
        return self.check / self.solve

    @property
    def cost(self) -> float:
        """Producing as a multiple of solving."""
        return self.produce / self.solve

    @property
    def text(self) -> str:
        """Seconds of solving, producing and checking, the ratio, obligations and how many of them are not constant,
        and the size."""
        if self.rejected:
            return "rejected"
        seconds = f"{self.solve:.3f}, {self.produce:.3f}, {self.check:.3f}"
        return f"{seconds}; {self.ratio:.2f}; {self.refuted} of {self.obligations}; {self.size / 1000:.1f} kB"


def measure(name: str, files: Files, processes: bool = True) -> tuple[Measured, ...]:
    """The certificates of one plan."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        return tuple(_measure(name, files, Path(directory), processes))


def _measure(name: str, files: Files, directory: Path, processes: bool) -> Iterator[Measured]:
    plan = load_plan(*files)
    point_s, _ = _timed(lambda: check(plan))
    widening_s, found = _timed(lambda: envelope(plan))
    solving = {"plan": point_s, "box": widening_s, "maximal": widening_s}
    for kind, solve in solving.items():
        path = directory / f"{name}-{kind}.cert"
        made, size = _timed(partial(produce, plan, files, kind, found.box, path))
        checked, answer = _timed(partial(run_checker, path, files))
        verb = "check" if kind == "plan" else "envelope"
        yield Measured(
            instance=name,
            kind=kind,
            parameters=len(plan.parameters),
            solve=solve,
            produce=made,
            check=checked,
            size=size,
            obligations=answer.get("obligations", 0),
            refuted=answer.get("refuted", 0),
            rejected=answer.get("reason"),
            solve_process=_process([*COMMAND, verb, *map(str, files), "--quiet"]) if processes else None,
            check_process=_timed(partial(verify, path, files, epsilon=EPSILON))[0] if processes else None,
        )


def produce(plan: ParametrizedPlan, files: Files, kind: str, box: Box, path: Path) -> int:
    """Write a certificate; its size in bytes."""
    made = PlanCertificate(files, create_encoding("relational", plan))
    lines = made.of_plan() if kind == "plan" else made.of_box(box, maximal=kind == "maximal")
    return write(lines, path)


def run_checker(path: Path, files: Files) -> dict[str, Any]:
    """What the checker says in this process."""
    demanded = Namespace(certificate=str(path), files=[*map(str, files)], kind=None, box=None, epsilon=str(EPSILON))
    return report(demanded, Inputs())[1]


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
    "produce / solve": lambda found: median(each.cost for each in found),
    "obligations": lambda found: sum(each.obligations for each in found),
    "not constant": lambda found: sum(each.refuted for each in found),
    "largest kB": lambda found: max(each.size for each in found) / 1e3,
}


BY_PLAN: Columns[Sequence[Measured]] = {
    "instance": lambda found: found[0].instance,
    "parameters": lambda found: found[0].parameters,
    **family("{}", KINDS, lambda kind, found: next((each.text for each in found if each.kind == kind), None)),
}


class CertificateReport(Report[Measured]):
    """All plans and boxes of the recorded data, relational encoding (`python -m benchmarks.certificates`).
    *plan*: valid at the nominal values. *box*: all over the box that widening finds. *maximal*: and no valid box
    contains it. Solving is the shortest way to the same verdict without a certificate: checking the plan, or widening.
    Solving and checking are timed in one process that has started already, so that no start-up hides what they take;
    checking includes the reading of the files.
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
        boxes = [each for each in self.rows if each.kind != "plan"]
        slowest, costliest = max(boxes, key=lambda each: each.check), max(boxes, key=lambda each: each.cost)
        largest = max(self.rows, key=lambda each: each.size)
        plans = len({each.instance for each in self.rows})
        pairs = [(each.check_process, each.solve_process) for each in self.rows]
        processes = "whole processes, from start to end, `robust check` or `robust envelope` against the checker"
        whole = [check / solve for check, solve in pairs if check and solve]
        return [
            f"{len(self.rows) - len(rejected)} of {len(self.rows)} certificates of {plans} plans are accepted",
            f"the median of checking / solving is {median(each.ratio for each in self.rows):.2f}; aim: {MEDIAN:g}",
            f"no box takes longer to check than {slowest.check:.2f} s ({slowest.instance}); aim: {SLOWEST:g} s",
            f"producing takes at most {costliest.cost:.1f} times solving ({costliest.instance}, {costliest.kind}); "
            f"aim: {COSTLIEST:g} for boxes",
            f"the largest certificate has {largest.size / 1e3:.1f} kB ({largest.instance}, {largest.kind}); aim: less "
            f"than {LARGEST / 1e3:g} kB",
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
