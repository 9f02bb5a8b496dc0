"""`robust batch`: one question about many plans."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from robust.cli.build import action
from robust.files import atomic_write
from robust.options.batch import (
    BatchCheckCommand,
    BatchCommand,
    BatchCompareCommand,
    BatchEnvelopeCommand,
    BatchRegionCommand,
)
from robust.options.declare import place_of

if TYPE_CHECKING:
    from robust.cli.guard import Run

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


def _carry_out(verb: str, options: BatchCommand, run: Run) -> int:
    with run.guard.working():
        from robust.api import run_batch
        from robust.show import batch as shown
    run.display.say("asking")
    with run.guard.handed_over():
        found = run_batch(verb, options.suite, options.changed(on_result=run.display.batch))
    run.answer(lambda: shown.batch(found), lambda out: shown.print_batch(out, found, quiet=options.quiet))
    if (table := options.csv) is not None:
        run.write(lambda: atomic_write(table, shown.csv_text(found), place_of("csv")))
    if (page := options.html) is not None:
        from robust.draw.pages import batch_page

        run.write(lambda: atomic_write(page, batch_page(found), place_of("html")))
    return found.exit_code


@action(BatchCheckCommand, epilog=EPILOG)
@_about_suites
def check(options: BatchCheckCommand, run: Run) -> int:
    """Is each plan of a suite valid for every schedule that its network allows?"""
    return _carry_out("check", options, run)


@action(BatchEnvelopeCommand, epilog=EPILOG)
@_about_suites
def envelope(options: BatchEnvelopeCommand, run: Run) -> int:
    """How far may the parameters of each plan of a suite deviate?"""
    return _carry_out("envelope", options, run)


@action(BatchRegionCommand, epilog=EPILOG)
@_about_suites
def region(options: BatchRegionCommand, run: Run) -> int:
    """For exactly which parameter values is each plan of a suite valid?"""
    return _carry_out("region", options, run)


@action(BatchCompareCommand, epilog=EPILOG)
@_about_suites
def compare(options: BatchCompareCommand, run: Run) -> int:
    """CCMMZ against IRR on each plan of a suite: who answers, in which time, and whose box is how large.

    IRR is incremental robustification (robust envelope --method irr); CCMMZ asks for the box of greatest total width
    (robust envelope --method optimal), which here is found exactly; each is a process of its own with the same limit.
    """
    return _carry_out("compare", options, run)
