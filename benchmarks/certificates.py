"""Certificates of all plans and boxes of a data set: how long solving, producing and checking take, and their sizes.

`python -m benchmarks.certificates --suite DIRECTORY` certifies each recorded plan at its nominal values (`plan`), all
over the box that widening finds (`box`), and that no valid box contains that one (`maximal`), checks each certificate,
and writes `parts/6-certificates.md`. `--json FILE` keeps the figures; `--from FILE` writes the part from such a file.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from robust.api import check, envelope
from robust.certify.document import mismatch
from robust.certify.produce import PlanCertificate, digests
from robust.certify.verify import checker_path
from robust.encode import create_encoding
from robust.errors import RobustError
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box
from robust.smt.limits import NEVER

from .engine.measure import COMMAND, Files
from .engine.show import markdown, page
from .irr.figure4 import recorded_instances
from .suite import read_suite

KINDS = ("plan", "box", "maximal")
PART = "6-certificates.md"
SLOWEST, LARGEST = 3.0, 10_000_000
PARTS = Path(__file__).with_name("parts")


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


def instances(suite: Path, directory: Path) -> Iterator[tuple[str, Files]]:
    """All recorded plans of a data set, by name; those that come as texts are written into `directory`."""
    for recorded in read_suite(suite):
        yield recorded.name, recorded.files
    for each in recorded_instances(suite):
        place = directory / each.name
        place.mkdir()
        yield each.name, each.write(place)


def measure(name: str, files: Files, directory: Path, *, processes: bool = True) -> Iterator[Measured]:
    """The certificates of one plan."""
    plan = load_plan(*files)
    started = time.perf_counter()
    check(plan)
    point_s = time.perf_counter() - started
    started = time.perf_counter()
    found = envelope(plan)
    widening_s = time.perf_counter() - started
    started = time.perf_counter()
    check(plan, at=found.box.intervals)
    box_s = time.perf_counter() - started
    boxes = {"plan": Box.nominal(plan.parameters), "box": found.box, "maximal": found.box}
    for kind, solve in zip(KINDS, (point_s, box_s, widening_s), strict=True):
        path = directory / f"{name}-{kind}.cert"
        started = time.perf_counter()
        size = produce(plan, files, kind, boxes[kind], path)
        made = time.perf_counter() - started
        started = time.perf_counter()
        lines, rejected = run_checker(path, files)
        checked = time.perf_counter() - started
        yield Measured(
            instance=name,
            kind=kind,
            parameters=len(plan.parameters),
            solve=solve,
            produce=made,
            check=checked,
            size=size,
            established=sum(line.startswith("established") for line in lines),
            folded=sum(json.loads(line)[0] == "folded" for line in _lines(path)[1:]),
            rejected=rejected or mismatch(path, plan, NEVER),
            solve_process=_process(_solving(kind, files)) if processes else None,
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
    spec = importlib.util.spec_from_file_location("certificate_checker", checker_path())
    if spec is None or spec.loader is None:
        raise RobustError(f"cannot load {checker_path()}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_CHECKER = _load_checker()


def _lines(path: Path) -> list[bytes]:
    return list(_CHECKER.lines_of(str(path)))


def _solving(kind: str, files: Files) -> list[str]:
    """The command that answers without a certificate."""
    verb = "check" if kind == "plan" else "envelope"
    return [*COMMAND, verb, *map(str, files), "--quiet"]


def _process(command: Sequence[str]) -> float:
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - started


# -- the part of the results page ------------------------------------------------------------------------------------


def part(found: Sequence[Measured], date: str) -> str:
    """The part of the results page about certificates."""
    names = list(dict.fromkeys(each.instance for each in found))
    intro = (
        f"All plans and boxes of the recorded data, relational encoding, measured on {date} by `python -m "
        "benchmarks.certificates --suite DIRECTORY`. *plan*: valid at the nominal values. *box*: all over the box that "
        "widening finds. *maximal*: and no valid box contains it. Solving is the shortest way to the same verdict "
        "without a certificate: checking the plan, checking the given box, widening. Solving and checking are timed in "
        "one process that has started already, so that no start-up hides what they take; reading PDDL is left out. "
        "Every certificate is checked with its input files, and compared with what these become in the encoding."
    )
    blocks = ["## Certificates", intro, *_summary(found)]
    blocks.append(markdown(HEADINGS, (row(kind, [each for each in found if each.kind == kind]) for kind in KINDS)))
    blocks.append("Each plan: seconds of solving, producing and checking; checking / solving; kilobytes.")
    headings = ("plan", "parameters", *KINDS)
    rows = []
    for name in names:
        mine = {each.kind: each for each in found if each.instance == name}
        cells = [cell(mine[kind]) if kind in mine else "–" for kind in KINDS]
        rows.append((name, str(next(iter(mine.values())).parameters), *cells))
    blocks.append(markdown(headings, rows))
    return page(*blocks)


def _summary(found: Sequence[Measured]) -> Iterator[str]:
    rejected = [each for each in found if each.rejected]
    slowest = max(found, key=lambda each: each.ratio)
    largest = max(found, key=lambda each: each.size)
    plans = len({each.instance for each in found})
    text = (
        f"{len(found) - len(rejected)} of {len(found)} certificates of {plans} plans are accepted. The greatest ratio "
        f"of checking to solving is {slowest.ratio:.2f} ({slowest.instance}, {slowest.kind}); aim: less than "
        f"{SLOWEST:g}. The largest certificate has {largest.size / 1e6:.2f} MB ({largest.instance}, {largest.kind}); "
        f"aim: less than {LARGEST / 1e6:g} MB."
    )
    whole = [each.check_process / each.solve_process for each in found if each.solve_process and each.check_process]
    if whole:
        text += (
            " Whole processes, from start to end, `robust check` or `robust envelope` against the checker: "
            f"{max(whole):.2f} at most, {median(whole):.2f} median."
        )
    yield text
    for each in rejected:
        yield f"Not accepted: {each.instance}, {each.kind}: {each.rejected}"


HEADINGS = ("kind", "certificates", "solve s", "produce s", "check s", "check / solve", "greatest", "MB", "largest MB")


def row(kind: str, found: Sequence[Measured]) -> tuple[str, ...]:
    """Totals of one kind, the median and greatest ratio, and the sizes."""
    solve, made, checked = (sum(getattr(each, name) for each in found) for name in ("solve", "produce", "check"))
    sizes = [each.size / 1e6 for each in found]
    ratios = [each.ratio for each in found] or [0.0]
    figures = (solve, made, checked, median(ratios), max(ratios), sum(sizes), max(sizes, default=0.0))
    return (kind, str(len(found)), *(f"{figure:.2f}" for figure in figures))


def cell(each: Measured) -> str:
    """Seconds of solving, producing and checking, the ratio, and the size."""
    if each.rejected:
        return "rejected"
    seconds = f"{each.solve:.3f}, {each.produce:.3f}, {each.check:.3f}"
    return f"{seconds}; {each.ratio:.2f}; {each.size / 1000:.0f} kB"


def run(
    suite: Path, *, limit: int | None = None, processes: bool = True, on_result: Callable[[Measured], None]
) -> list[Measured]:
    """Measure all recorded plans, or the first `limit`; the first plan is done twice, so that everything is loaded."""
    found: list[Measured] = []
    with TemporaryDirectory() as name:
        directory = Path(name)
        plans = list(instances(suite, directory))[:limit]
        list(measure(*plans[0], directory, processes=False))
        for plan, files in plans:
            for each in measure(plan, files, directory, processes=processes):
                found.append(each)
                on_result(each)
    return found


def _progress(each: Measured) -> None:
    verdict = each.rejected or "accepted"
    print(f"{each.instance}, {each.kind}: {cell(each)}, {verdict}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.certificates", description=__doc__)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--suite", type=Path, metavar="DIRECTORY", help="the data set")
    source.add_argument("--from", type=Path, metavar="FILE", dest="earlier", help="figures of an earlier run")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to keep the figures")
    parser.add_argument("--output", type=Path, default=PARTS / PART, metavar="FILE", help=f"default: parts/{PART}")
    options = parser.parse_args(arguments)
    try:
        if options.earlier is None:
            found = run(options.suite, on_result=_progress)
        else:
            found = [Measured(**each) for each in json.loads(options.earlier.read_text(encoding="utf-8"))]
        if options.json is not None:
            options.json.write_text(json.dumps([asdict(each) for each in found], indent=1) + "\n", encoding="utf-8")
        text = part(found, datetime.now(UTC).date().isoformat())
        options.output.write_text(text + "\n", encoding="utf-8")
    except (OSError, ValueError, TypeError, RobustError) as error:
        parser.error(str(error))
    print(options.output)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
