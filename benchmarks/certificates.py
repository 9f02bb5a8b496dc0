"""Certificates of all plans and boxes of a data set: how long solving, producing and checking take, and their sizes.

`python -m benchmarks.certificates --suite DIRECTORY` certifies each recorded plan at its nominal values (`plan`), all
over the box that widening finds (`box`), that no valid box contains that one (`maximal`), and its robustness envelope
(`region`); of the plans with choices among the examples, an execution and that there is none with some choices. It
checks each certificate, and prints what it took as JSON, of which :mod:`benchmarks.results` makes a part of its page.
"""

from __future__ import annotations

import gc
import json
import resource
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from math import fsum
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robust.api import check, envelope, region
from robust.certify import Demanded, verify
from robust.certify.checker.__main__ import Inputs, report
from robust.certify.hints import Line
from robust.certify.produce import PlanCertificate, execution, knowledge
from robust.certify.tape import write
from robust.errors import RobustError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.compile import checked_assumptions
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.reading import load_plan
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.sweeps.batch import COMMAND

from .catalogue import SuiteOptions
from .engine.experiment import Experiment, Report, Task
from .engine.measure import Files
from .engine.show import Columns, Table, family
from .suite import read_deliveries, read_suite

KINDS = ("plan", "box", "maximal", "region")
OF_CHOICES = ("execution", "knowledge")
EXAMPLES = Path(__file__).parents[1] / "robust" / "examples"
IMPOSSIBLE = {"kitchen": {"xA1": "glass", "xA2": "coffee"}, "wing": {"h1": "both", "b1": "cleco"}}
"""The examples with choices, each with choices that no correct execution makes."""
EPSILON = Fraction(1, 1000)
REGION = 10.0
LONGER = {"generator_linear_07_4": 200.0}
"""Seconds of the clock to find an envelope, and as many to certify it; the largest of the generators gets more."""
MEDIAN, SLOWEST, COSTLIEST, LARGEST = 0.5, 1.0, 3.0, 100_000
"""The median of checking / solving; seconds to check a box; producing / solving for boxes; bytes."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One certificate: seconds of processor time, in one process that has started already and of whole processes, and
    its bytes.

    `solve` is the shortest way to the verdict without a certificate: checking the plan (`plan`), widening (`box`,
    `maximal`), eliminating the times (`region`), or the oracle (`execution`, `knowledge`). `produce` makes the
    certificate, that search excluded. `refuted` of the obligations are not constant by what the checker folds.
    `rejected` is why the checker does not accept the certificate, or why there is none.
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
            return "rejected" if self.size else f"none after {self.solve + self.produce:.0f} s"
        seconds = f"{self.solve:.3f}, {self.produce:.3f}, {self.check:.3f}"
        return f"{seconds}; {self.ratio:.2f}; {self.refuted} of {self.obligations}; {self.size / 1000:.1f} kB"


def measure(name: str, files: Files, processes: bool = True, seconds: float = REGION) -> tuple[Measured, ...]:
    """The certificates of one plan; `seconds` are for its region."""
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        return tuple(_measure(name, files, Path(directory), processes, seconds))


def _measure(name: str, files: Files, directory: Path, processes: bool, seconds: float) -> Iterator[Measured]:
    plan = load_plan(*files)
    point_s, _ = _timed(lambda: check(plan))
    widening_s, found = _timed(lambda: envelope(plan))
    region_s, whole = _timed(lambda: region(plan, timeout=seconds))

    def lines(kind: str) -> list[Line]:
        made = PlanCertificate(files, plan, deadline=Deadline.after(seconds) if kind == "region" else NEVER)
        if kind == "region":
            if not whole.is_exact:
                raise OutOfTimeError
            return made.of_region(whole.region)
        return made.of_plan() if kind == "plan" else made.of_box(found.box, maximal=kind == "maximal")

    solving = {"plan": point_s, "box": widening_s, "maximal": widening_s, "region": region_s}
    for kind, solve in solving.items():
        verb = {"plan": "check", "region": None}.get(kind, "envelope") if processes else None
        about = Measured(name, kind, len(plan.parameters), solve, 0, 0, 0, 0, 0)
        yield _certified(about, partial(lines, kind), directory, files, verb)


def measure_choices(name: str, network: Path) -> tuple[Measured, ...]:
    """An execution of a plan with choices, and that there is none with some of them."""
    plan = load_team_plan(network)
    made = IMPOSSIBLE[name]
    some_s, some = _timed(lambda: Oracle(plan).decide())
    none_s, none = _timed(lambda: Oracle(plan).decide(checked_assumptions(plan, made)))
    if some.witness is None or none.verdict is not ExecutionExistence.NONE:
        raise RobustError(f"found {some.verdict}, {none.verdict}, expected executions of {name}, and none with {made}")
    witness = some.witness
    ways = {
        "execution": (some_s, lambda: execution(network, EPSILON, witness.scenario, witness.schedule)),
        "knowledge": (none_s, lambda: knowledge(network, EPSILON, NEVER, made)),
    }
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        return tuple(
            _certified(Measured(name, kind, 0, solve, 0, 0, 0, 0, 0), lines, Path(directory), (network,))
            for kind, (solve, lines) in ways.items()
        )


def _certified(
    about: Measured, lines: Callable[[], list[Line]], directory: Path, files: tuple[Path, ...], verb: str | None = None
) -> Measured:
    """Make a certificate and check it; `verb` is the command that solves the same, as a process, if it is to run."""
    path = directory / f"{about.instance}-{about.kind}.cert"
    made, size = _timed(lambda: _written(lines, path))
    about = replace(about, produce=made, size=size or 0)
    if size is None:
        return replace(about, rejected="out of time")
    checked, answer = _timed(partial(run_checker, path, files))
    return replace(
        about,
        check=checked,
        obligations=answer.get("obligations", 0),
        refuted=answer.get("refuted", 0),
        rejected=answer.get("reason"),
        solve_process=None if verb is None else _process([*COMMAND, verb, *map(str, files), "--quiet"]),
        check_process=None if verb is None else _timed(partial(verify, path, files, Demanded(EPSILON)))[0],
    )


def _written(lines: Callable[[], list[Line]], path: Path) -> int | None:
    """Its bytes; None if it is not ready in time."""
    try:
        return write(lines(), path)
    except OutOfTimeError:
        return None


def run_checker(path: Path, files: tuple[Path, ...]) -> dict[str, Any]:
    """What the checker says in this process."""
    demanded: dict[str, Any] = {"kind": None, "box": None, "assume": [], "epsilon": str(EPSILON)}
    return report(Namespace(certificate=str(path), files=[*map(str, files)], **demanded), Inputs())[1]


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of processor time, of this process and of those that it has ended, and what came of the work."""
    gc.collect()  # or a pause for what was made before falls into whatever comes next
    started = _used()
    found = work()
    return _used() - started, found


def _used() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return fsum(each.ru_utime + each.ru_stime for each in both)


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
BY_NETWORK: Columns[Sequence[Measured]] = {
    "instance": lambda found: found[0].instance,
    **family("{}", OF_CHOICES, lambda kind, found: next((each.text for each in found if each.kind == kind), None)),
}


class CertificateReport(Report[Measured]):
    """All plans and boxes of the recorded data, relational encoding (`python -m benchmarks.certificates`).
    *plan*: valid at the nominal values. *box*: all over the box that widening finds. *maximal*: and no valid box
    contains it. *region*: exactly the robustness envelope. *execution*: of a plan with choices, a correct execution;
    *knowledge*: that there is none with two of its choices as assumed. Solving is the shortest way to the same verdict
    without a certificate: checking the plan, widening, eliminating the times, or the oracle. Solving, producing and
    checking are timed in one process that has started already, so that no start-up hides what they take; checking
    includes the reading of the files. Seconds are of processor time.
    """

    TITLE = "Certificates"
    SETTINGS: ClassVar[Mapping[str, str]] = {"suite": "suite", "jobs": "jobs"}
    ROW = Measured

    @property
    def accepted(self) -> list[Measured]:
        return [each for each in self.rows if not each.rejected]

    def sound(self) -> bool:
        return not any(each.rejected and each.size for each in self.rows)

    def contents(self) -> list[Table]:
        """By kind, and by plan: seconds of solving, producing and checking; checking / solving; kilobytes."""
        made = self.accepted
        kinds = [found for kind in (*KINDS, *OF_CHOICES) if (found := [each for each in made if each.kind == kind])]
        columns = "seconds of solving, producing and checking; checking / solving; not constant of all obligations; kB"
        return [
            Table.of("All certificates", TOTALS, kinds),
            Table.of(f"Each plan: {columns}", BY_PLAN, _grouped(self.rows)),
            Table.of(f"Plans with choices: {columns}", BY_NETWORK, _grouped(self.rows, OF_CHOICES)),
        ]

    def remarks(self) -> Sequence[str]:
        made = self.accepted
        late = [each.instance for each in self.rows if each.rejected and not each.size]
        longer = ", ".join(f"{name}: {seconds:g} s" for name, seconds in LONGER.items())
        boxes = [each for each in made if each.kind in ("box", "maximal")]
        slowest, costliest = max(boxes, key=lambda each: each.check), max(boxes, key=lambda each: each.cost)
        largest = max(boxes, key=lambda each: each.size)
        plans = len({each.instance for each in self.rows})
        pairs = [(each.check_process, each.solve_process) for each in made]
        processes = "whole processes, from start to end, `robust check` or `robust envelope` against the checker"
        whole = [check / solve for check, solve in pairs if check and solve]
        return [
            f"{len(made)} of {len(self.rows)} certificates of {plans} plans are accepted",
            f"the median of checking / solving is {median(each.ratio for each in made):.2f}; aim: {MEDIAN:g}",
            f"no box takes longer to check than {slowest.check:.2f} s ({slowest.instance}); aim: {SLOWEST:g} s",
            f"producing takes at most {costliest.cost:.1f} times solving ({costliest.instance}, {costliest.kind}); "
            f"aim: {COSTLIEST:g} for boxes",
            f"the largest certificate of a box has {largest.size / 1e3:.1f} kB ({largest.instance}, {largest.kind}); "
            f"aim: less than {LARGEST / 1e3:g} kB",
            *_of_regions([each for each in made if each.kind == "region"]),
            *([f"{processes}: {max(whole):.2f} at most, {median(whole):.2f} median"] if whole else []),
            *(
                [f"no certificate of the region in {REGION:g} s of the clock ({longer}): {', '.join(late)}"]
                if late
                else []
            ),
            *(
                f"not accepted: {each.instance}, {each.kind}: {each.rejected}"
                for each in self.rows
                if each.size and each.rejected
            ),
        ]


def _grouped(rows: Sequence[Measured], kinds: Sequence[str] = KINDS) -> list[list[Measured]]:
    found: dict[str, list[Measured]] = {}
    for each in rows:
        if each.kind in kinds:
            found.setdefault(each.instance, []).append(each)
    return list(found.values())


def _of_regions(regions: Sequence[Measured]) -> Iterator[str]:
    if regions:
        slowest, largest = max(regions, key=lambda each: each.check), max(regions, key=lambda each: each.size)
        yield (
            f"of {len(regions)} regions none takes longer to check than {slowest.check:.2f} s ({slowest.instance}), "
            f"and the largest certificate has {largest.size / 1e3:.1f} kB ({largest.instance})"
        )


def _prepare(options: SuiteOptions, _: object) -> list[tuple[str, Files]]:
    plans = [(one.name, one.files) for one in read_suite(options.suite)]
    plans += [(one.instance, files) for one, files in read_deliveries(options.suite)]
    measure(*plans[0], processes=False)  # so that everything is loaded
    return plans


def _tasks(plans: Sequence[tuple[str, Files]]) -> list[Task]:
    networks = [(name, (EXAMPLES / name / f"{name}.tpnu.json",)) for name in IMPOSSIBLE]
    return [Task(name, (name, files)) for name, files in (*plans, *networks)]


def work(name: str, files: tuple[Path, ...]) -> tuple[Measured, ...]:
    """The certificates of one plan, or plan with choices."""
    if len(files) == 1:
        return measure_choices(name, *files)
    return measure(name, (files[0], files[1], files[2]), seconds=LONGER.get(name, REGION))


CERTIFICATES = Experiment(
    "certificates",
    SuiteOptions,
    lambda _, plans: _tasks(plans),
    work,
    CertificateReport,
    lambda found: ", ".join(f"{each.kind} {each.text}" for each in found),
    prepare=_prepare,
)


def main() -> int:
    parser = ArgumentParser(prog="python -m benchmarks.certificates", description=__doc__.splitlines()[0])
    parser.add_argument("--suite", type=Path, required=True, metavar="DIRECTORY", help="a data set with recorded plans")
    try:
        shown = CERTIFICATES.run(suite=parser.parse_args().suite, on_result=lambda *line: print(*line, file=sys.stderr))
    except RobustError as error:
        parser.error(str(error))
    print(json.dumps(shown.as_dict()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
