"""`robust batch`: one question about many plans.

`robust bench NAME`: the experiments of the package `benchmarks`, or `robust_benchmarks` where it is installed.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from robust import errors, records
from robust.cli.build import Command
from robust.cli.guard import Action, Run, action
from robust.options import batch
from robust.options.declare import place_of

if TYPE_CHECKING:
    from robust.show.console import Console

EPILOG = (
    "Exit codes: 1 if a plan is refuted; else 2 if one cannot be read; else 4 if one is not supported; else 3 if one "
    "is undecided, out of time or missing; else 0."
)


_SUITE = """
SUITE is a folder of plans with problem.pddl and domain.pddl beside or above them, or a list: lines of DOMAIN PROBLEM
PLAN, a .json or a .csv file. What is wrong with one plan is its answer, and the others go on. Ctrl-C and time limits
keep what is answered; with --store the same command goes on from there.
"""
CarryOut = TypeVar("CarryOut", bound=Callable[..., int])


def _about_suites(carry_out: CarryOut) -> CarryOut:
    """Say in its help what a suite is."""
    carry_out.__doc__ = f"{inspect.cleandoc(carry_out.__doc__ or '')}\n{_SUITE}"
    return carry_out


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


@action(batch.BatchCheckCommand, epilog=EPILOG)
@_about_suites
def check(options: batch.BatchCheckCommand, run: Run) -> int:
    """Is each plan of a suite valid for every schedule that its network allows?"""
    return _carry_out("check", options, run)


@action(batch.BatchEnvelopeCommand, epilog=EPILOG)
@_about_suites
def envelope(options: batch.BatchEnvelopeCommand, run: Run) -> int:
    """How far may the parameters of each plan of a suite deviate?"""
    return _carry_out("envelope", options, run)


@action(batch.BatchRegionCommand, epilog=EPILOG)
@_about_suites
def region(options: batch.BatchRegionCommand, run: Run) -> int:
    """For exactly which parameter values is each plan of a suite valid?"""
    return _carry_out("region", options, run)


@action(batch.BatchCompareCommand, epilog=EPILOG)
@_about_suites
def compare(options: batch.BatchCompareCommand, run: Run) -> int:
    """CCMMZ against IRR on each plan of a suite: who answers, in which time, and whose box is how large.

    IRR is incremental robustification (robust envelope --method irr); CCMMZ asks for the box of greatest total width
    (robust envelope --method optimal), which here is found exactly; each is a process of its own with the same limit.
    """
    return _carry_out("compare", options, run)


@dataclass(frozen=True, slots=True)
class ExperimentCommand(Command):
    """The command of one experiment, which is loaded when it is run."""

    entry: Any

    def load(self) -> Action[Any]:
        def carry_out(options: Any, run: Run) -> int:
            return _measure(self.entry, options, run)

        carry_out.__doc__ = self.entry.help
        return Action(self.entry.options, carry_out, None)


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
