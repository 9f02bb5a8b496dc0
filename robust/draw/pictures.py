"""The picture of each kind of result; `plot` of results loads this."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path

from matplotlib.figure import Figure

from robust.draw.gantt import plot_team_run
from robust.draw.plane import plot_comparison, plot_region, plot_team_envelope, plot_team_region
from robust.draw.plots import plot_envelope, plot_risk
from robust.errors import InputError
from robust.irr.compare import Comparison
from robust.irr.search import EnvelopeResult
from robust.options.declare import names, place_of, plot_file
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
from robust.pike_bridge.online.world import ExecutionRecord
from robust.probability.risk import RiskResult
from robust.qe.compute import RegionResult
from robust.show.presenting import noun


@singledispatch
def picture(result: object, path: Path | None, axes: Sequence[str]) -> Figure:
    """A figure of a result, with the parameters `axes` where it has any, written to the path if there is one.

    Raises:
        InputError: if there is nothing to draw, or the file cannot be written.
    """
    drawn = sorted({noun(kind) for kind in picture.registry if kind is not object})
    found = noun(type(result))
    raise InputError(f"found {found}, expected something to draw: {', '.join(drawn)}", place_of("plot"))


picture.register(EnvelopeResult, lambda result, path, _: plot_envelope(result, path))
picture.register(RegionResult, plot_region)
picture.register(Comparison, plot_comparison)
picture.register(RiskResult, lambda result, path, _: plot_risk(result, path))
picture.register(ExecutionRecord, lambda record, path, _: plot_team_run(record, path))
picture.register(LabeledRegion, plot_team_region)
picture.register(TeamEnvelope, plot_team_envelope)


def draw(result: object, path: str | os.PathLike[str] | None, axes: str | Sequence[str]) -> Figure:
    """The picture, of arguments as people give them."""
    written = None if path is None else plot_file(Path(path), place_of("path"))
    return picture(result, written, names(axes, place_of("axes")) if axes else ())
