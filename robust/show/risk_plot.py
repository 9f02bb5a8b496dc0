"""Pictures of probabilities of success: valid values with the density over them, and a bar for each obligation."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from robust.probability.risk import RiskResult
from robust.qe.region import Region
from robust.show.drawing import LIGHT, VERMILION, cut, save, without_frame
from robust.show.probabilities import bounds_text, places_for
from robust.show.region_plot import draw_plane

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FINE = 120
"""Points of a density to either side."""


def plot_risk(result: RiskResult, path: Path) -> None:
    """Draw the region with the density over it, for two parameters; and a bar for each obligation.

    Raises:
        InputError: if the file cannot be written.
    """
    save(lambda: _figure(result), path)


def _figure(result: RiskResult) -> Figure:
    moving = [name for name, one in result.distributions.items() if one.settled.kind != "constant"]
    plane = len(moving) == 2 and result.region is not None
    figure = Figure(figsize=(11.5 if plane else 7.5, 4.2), layout="constrained")
    places = places_for(result.within)
    figure.suptitle(
        f"Probability of success: {bounds_text(result.probability, places)}", fontsize=11, x=0.01, ha="left"
    )
    if plane:
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.15])
        _draw_region(left, result, moving)
    else:
        right = figure.subplots()
    _draw_shares(right, result)
    return figure


def _draw_region(canvas: Axes, result: RiskResult, moving: Sequence[str]) -> None:
    if result.region is None:
        return
    ends = tuple(_view(result, name) for name in moving)
    fixed = {name: one.settled.numbers["value"] for name, one in result.distributions.items() if name not in moving}
    found = result.region.region.slice(fixed)
    boxes = {} if result.best is None else {"box": result.best.result.box}
    draw_plane(canvas, Region(tuple(moving), found.pieces, found.base), ends, boxes, {})
    grids = [[low + (high - low) * Fraction(step, _FINE) for step in range(_FINE + 1)] for low, high in ends]
    across, up = (
        [result.distributions[name].settled.density(value) for value in grid]
        for name, grid in zip(moving, grids, strict=True)
    )
    density = [[a * b for a in across] for b in up]
    levels = [max(map(max, density)) * share for share in (0.01, 0.1, 0.3, 0.6, 0.9)]
    if levels[0] < levels[-1]:
        xs, ys = ([float(value) for value in grid] for grid in grids)
        canvas.contour(xs, ys, density, levels=levels, colors=VERMILION, linewidths=0.9)
    canvas.set_title("valid values, their density, the most probable box compared", fontsize=9, loc="left")


def _view(result: RiskResult, name: str) -> tuple[Fraction, Fraction]:
    """Where almost all values are."""
    distribution = result.distributions[name].settled
    lower, upper = distribution.support
    reach = distribution.scale * Fraction(7, 2)
    low = distribution.centre - reach if lower is None else max(lower, distribution.centre - reach)
    high = distribution.centre + reach if upper is None else min(upper, distribution.centre + reach)
    return low, high


def _draw_shares(canvas: Axes, result: RiskResult) -> None:
    """A bar for each obligation that matters: certain in full colour, possible lighter."""
    shown = [one for one in result.shares or () if one.probability.upper >= result.within]
    shown.sort(key=lambda one: one.probability.upper)
    for row, one in enumerate(shown):
        canvas.barh(row, float(one.probability.upper), color=LIGHT[5], height=0.55)
        canvas.barh(row, float(one.probability.lower), color=VERMILION, height=0.55)
    canvas.set_yticks(range(len(shown)), [cut(one.name, 48) for one in shown], fontsize=8)
    canvas.set_xlabel("probability")
    canvas.set_title("What fails first", fontsize=9, loc="left")
    if not shown:
        canvas.text(0.5, 0.5, "nothing that matters", ha="center", va="center", transform=canvas.transAxes)
    without_frame(canvas)
