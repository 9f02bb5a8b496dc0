"""`robust pike region` and `robust pike envelope`: how far durations and limits of plans with choices may deviate."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.cli.build import action
from robust.cli.guard import Run
from robust.cli.pike import ASSUME, PikeOptions, assumed
from robust.errors import InputError, Location, exit_code_of
from robust.options.declare import names, option, place_of
from robust.options.shared import Slice
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.api import Search
    from robust.pike_bridge.envelopes.parameters import ParametricPlan
    from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
    from robust.show.pike_envelopes import Cells


class ParametricOptions(PikeOptions, Slice):
    """Which bounds are parameters."""

    parameter: tuple[str, ...] = option(
        (),
        "make a bound a parameter: [NAME=]duration:ACTIVITY, at-least: or at-most:ACTIVITY or FROM:TO (events), or "
        "hesitation:CHOICE; then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
        metavar="SPEC",
        many=True,
    )
    parameters: Path | None = option(None, "more parameters, in a TOML file", metavar="FILE", path=True)
    assume: tuple[str, ...] = ASSUME

    def parametric(self) -> ParametricPlan:
        """The plan with its parameters: those in its own file, in the TOML file, and of options.

        Raises:
            InputError: if there are none, or one is wrong.
        """
        from robust.pike_bridge.envelopes.parameters import parametrize, specifications
        from robust.pike_bridge.files import read_tpnu

        plan = self.load()
        specs = specifications(self.parameter, self.parameters, read_tpnu(self.file).parameters)
        if not specs:
            raise InputError(
                "found no parameters, expected some: --parameter duration:ACTIVITY, or a file", place_of("parameter")
            )
        found = parametrize(plan, specs)
        if self.plot is not None:
            from robust.show.pike_envelope_plots import plotted

            plotted(found, self.drawn)
        return found

    @property
    def drawn(self) -> Sequence[str]:
        """The parameters that were asked to be drawn."""
        return tuple(self.axes or ())


def _names_or_none(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Names, or none of them."""
    return names(value, place) if value else ()


class PikeRegionCommand(ParametricOptions):
    """Of `robust pike region`."""

    choices: Any = option(
        None,
        "the choices that are told apart, else those of people and nature; '' for none",
        metavar="A,B",
        read=_names_or_none,
    )


class PikeEnvelopeCommand(ParametricOptions):
    """Of `robust pike envelope`."""

    for_all: Any = option(
        (), "choices of which every combination of values must lead to a correct execution", metavar="A,B", read=names
    )
    patience: bool = option(False, "with --for-all: what is chosen becomes known only then, and the team waits for it")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.patience and not self.for_all:
            raise InputError("expected only together with --for-all", place_of("patience"))


@action(PikeRegionCommand)
def region(options: PikeRegionCommand, run: Run) -> int:
    """For which durations and limits of a plan with choices does which choice lead to a correct execution?"""
    from robust.pike_bridge.envelopes.search import LabeledRegionSearch
    from robust.show import pike_envelopes as show

    count = 0

    def on_piece(_piece: object) -> None:
        nonlocal count
        count += 1
        run.display.say(f"polyhedra: {count}")

    def begin() -> Search[LabeledRegion]:
        plan = options.parametric()
        return LabeledRegionSearch(
            plan,
            options.choices,
            assume=assumed(plan.plan, options.assume),
            solver=options.solver,
            deadline=Deadline.after(run.remaining),
            on_piece=on_piece,
        )

    cells: Cells | None = None

    def answer(found: LabeledRegion) -> None:
        run.answer(
            lambda: show.region_document(found, cells),
            lambda out: show.print_region(out, found, quiet=options.quiet),
        )

    found = run.best(begin, answer)
    if not found.cut_short and (options.json or options.plot is not None):
        cells = run.also("cutting", lambda: _cells(found, run))
    answer(found)
    if options.plot is not None:
        from robust.show.pike_envelope_plots import plot_cells

        run.write(partial(plot_cells, found, cells, options.plot, options.drawn))
    if found.cut_short:
        return exit_code_of(found.status.value)
    return 0 if found.pieces else 1


def _cells(found: LabeledRegion, run: Run) -> Cells | None:
    """The region cut by what is possible; None if there is no time."""
    try:
        return found.exactly(Deadline.after(run.remaining))
    except OutOfTimeError:
        return None


@action(PikeEnvelopeCommand)
def envelope(options: PikeEnvelopeCommand, run: Run) -> int:
    """How far may durations and limits of a plan with choices deviate: for some choices, or whatever people choose?"""
    from robust.pike_bridge.envelopes.search import TeamEnvelopeSearch

    def begin() -> Search[TeamEnvelope]:
        plan = options.parametric()
        return TeamEnvelopeSearch(
            plan,
            assume=assumed(plan.plan, options.assume),
            for_all=options.for_all or (),
            waiting=options.patience,
            solver=options.solver,
            deadline=Deadline.after(run.remaining),
            on_stage=run.display.say,
        )

    found = run.reply(begin)
    if options.plot is not None and found.combinations:
        run.write(partial(found.plot, options.plot, axes=options.drawn))
    return exit_code_of(found.status.value)
