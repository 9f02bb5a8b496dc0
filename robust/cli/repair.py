"""`robust repair`: the least change after which a plan is valid, and its text with that change."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.plans import load
from robust.errors import InputError, exit_code_of
from robust.files import atomic_write
from robust.options.declare import place_of
from robust.options.verbs import RepairCommand

if TYPE_CHECKING:
    from pathlib import Path

    from robust.cli.guard import Run
    from robust.irr.quantities import Change, Cost
    from robust.irr.repair import Repair, RepairSearch


@action(RepairCommand)
def repair(options: RepairCommand, run: Run) -> int:
    """What is the least change after which a plan is valid for every schedule that its network then allows?

    What changes are bounds of the network, nominal values, or both; with --require, the plan is valid for all these
    values of parameters as well. Ctrl-C prints the best repair so far.
    """
    from robust.api import searching_repair
    from robust.plan.pddl.forms import read_plan_text
    from robust.plan.stn import is_network
    from robust.show import repairs as show

    source = "" if options.output is None else read_plan_text(options.plan)[0]
    if options.output is not None and not is_network(source, str(options.plan)):
        raise InputError(
            f"found steps in {options.plan}, expected a network (.stn): convert them first by robust convert",
            place_of("output"),
        )

    def begin() -> RepairSearch:
        plan = load(options, run)
        run.display.say("encoding")
        return searching_repair(plan, options.changed(timeout=run.remaining, on_repair=better))

    def better(cost: Cost) -> None:
        run.display.say(f"best so far: {show.price(cost, options.count)}")

    def tell(found: Repair) -> None:
        written = None if options.output is None or found.plan is None else options.output
        run.answer(
            lambda: show.repair_document(found, written),
            lambda out: show.print_repair(out, found, written, quiet=options.quiet),
        )

    found = run.best(begin, tell)
    tell(found)
    if options.output is not None and found.plan is not None:
        text = _text(source, options.plan, found.changes)
        run.write(partial(atomic_write, options.output, text, place_of("output")))
    return exit_code_of(found.status.value)


def _text(source: str, file: Path, changes: tuple[Change, ...]) -> str:
    """The plan as it was written, but for what changes."""
    from robust.plan.rewrite import Number, rewritten

    return rewritten(source, str(file), {Number(one.location, one.part): one.new for one in changes})
