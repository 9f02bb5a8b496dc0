"""`robust batch`: one question about many plans.

`robust bench NAME`: the experiments of the package `benchmarks`, or `robust_benchmarks` where it is installed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust import errors, records
from robust.cli.build import Command
from robust.cli.guard import Action, Run
from robust.options import batch
from robust.options.declare import place_of

if TYPE_CHECKING:
    from robust.show.console import Console

EPILOG = (
    "Exit codes: 1 if a plan is refuted; else 2 if one cannot be read; else 4 if one is not supported; else 3 if one "
    "is undecided, out of time or missing; else 0."
)
_SUITE = """\
SUITE is a folder of plans with problem.pddl and domain.pddl beside or above them, or a list: lines of DOMAIN PROBLEM
PLAN, a .json or a .csv file. What is wrong with one plan is its answer, and the others go on. Ctrl-C and time limits
keep what is answered; with --store the same command goes on from there."""


def _carry_out(verb: str, options: batch.BatchCommand, run: Run) -> int:
    with run.guard.working():
        from robust.api import run_batch
        from robust.show import batch as shown
    run.display.say("asking")
    with run.guard.handed_over():
        result = run_batch(verb, options.suite, options.changed(on_result=run.display.batch))
    run.answer(lambda: shown.batch_document(result), lambda out: shown.print_batch(out, result, quiet=options.quiet))
    if (table := options.csv) is not None:
        run.write(lambda: records.atomic_write(table, shown.csv_text(result), place_of("csv")))
    if (page := options.html) is not None:
        from robust.draw.interactive import batch_page

        run.write(lambda: records.atomic_write(page, batch_page(result), place_of("html")))
    return result.exit_code


def _asking(verb: str, options: type[batch.BatchCommand], help: str) -> Action[Any]:
    return Action(options, partial(_carry_out, verb), EPILOG, f"{help}\n\n{_SUITE}")


check = _asking(
    "check", batch.BatchCheckCommand, "Is each plan of a suite valid for every schedule that its network allows?"
)
envelope = _asking(
    "envelope", batch.BatchEnvelopeCommand, "How far may the parameters of each plan of a suite deviate?"
)
region = _asking(
    "region", batch.BatchRegionCommand, "For exactly which parameter values is each plan of a suite valid?"
)
compare = _asking(
    "compare",
    batch.BatchCompareCommand,
    """CCMMZ against IRR on each plan of a suite: who answers, in which time, and whose box is how large.

IRR is incremental robustification (robust envelope --method irr); CCMMZ asks for the box of greatest total width
(robust envelope --method optimal), which here is found exactly; each is a process of its own with the same limit.""",
)


@dataclass(frozen=True, slots=True)
class ExperimentCommand(Command):
    """The command of one experiment, which is loaded when it is run."""

    entry: Any

    def load(self) -> Action[Any]:
        return Action(self.entry.options, partial(_measure, self.entry), None, self.entry.help)


def _measure(entry: Any, options: Any, run: Run) -> int:
    with run.guard.working():
        experiment = entry.load()
    run.display.say("running")
    with run.guard.handed_over():
        report = experiment.run(options, on_result=run.display.batch)

    def tell(out: Console) -> None:
        for table in report.tables:
            out.print(table.rich(), markup=True)

    run.answer(report.as_dict, tell)
    run.write(report.plot)
    if not report.complete:
        return errors.UNDECIDED
    return 0 if report.agrees else 1


def _catalogue() -> Mapping[str, Any]:
    """The experiments beside this package, or else those that are installed with it."""
    root = Path(__file__).parents[2]
    if not (root / "benchmarks" / "catalogue.py").is_file():
        name = "robust_benchmarks"
    else:
        name = "benchmarks"
        if name not in sys.modules:
            sys.path.insert(0, str(root))  # before any other package of that name
    experiments: Mapping[str, Any] = import_module(f"{name}.catalogue").EXPERIMENTS
    return experiments


EXPERIMENTS = {name: ExperimentCommand(entry.summary, "", entry) for name, entry in _catalogue().items()}
