"""The picture of each kind of result, which `plot` of results loads; those of boxes and of probabilities are here.

A box is drawn with how the search came to it, a probability of success with what fails first or is late.

Rows of a box are deviations from the nominal values, so that parameters of different size can share one axis; where
deviations differ by orders of magnitude, the axis is logarithmic on both sides of zero.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import singledispatch
from math import floor, log10
from pathlib import Path
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

from robust import errors, searching
from robust.draw import gantt, style
from robust.draw.plane import draw_plane, plot_comparison, plot_region, plot_shape, plot_team_envelope, plot_team_region
from robust.draw.style import EDGE, VALID, VERMILION, save, wrapped
from robust.irr.compare import Comparison
from robust.irr.search import EnvelopeResult
from robust.numbers import approximate, end, readable
from robust.options.declare import names, place_of, plot_file
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
from robust.pike_bridge.online.world import ExecutionRecord
from robust.probability.measure import Bounds
from robust.probability.risk import RiskResult
from robust.qe.box import Box
from robust.qe.compute import RegionResult
from robust.qe.region import Region
from robust.show.documents import bounds_text, places_for
from robust.show.risk import SHOWN
from robust.show.text import Words

_TALLEST = 4.5
"""Inches up to which the convergence curve is as tall as the box."""
_WIDE = 100
"""A ratio of deviations from which a linear axis would hide the small ones."""
_SHARES = (0.01, 0.1, 0.3, 0.6, 0.9)
"""Lines of equal density, as shares of the greatest."""
_FINE = 120
"""Points of a density to either side."""


@dataclass(frozen=True, slots=True)
class _Row:
    """One parameter with its nominal value, deviations below and above (None: unbounded), the texts beside them."""

    name: str
    below: float | None
    above: float | None
    lower: str
    upper: str


def _picture_of_envelope(result: EnvelopeResult, path: Path | None, axes: Sequence[str]) -> Figure:
    if result.shape is None or len(result.parameters) < 2:
        return plot_envelope(result, path)
    return plot_shape(result, result.shape, path, axes)


def plot_envelope(result: EnvelopeResult, path: Path | None) -> Figure:
    """Draw the box and the convergence curve.

    Raises:
        InputError: if there is no box around nominal values, or the file cannot be written.
    """
    if not result.verified or not all(parameter.has_nominal for parameter in result.parameters):
        lacking = "a parameter without a nominal value" if result.verified else "no box"
        raise errors.InputError(f"found {lacking}, expected a box around nominal values", place_of("plot"))
    words = {} if result.plan is None else Words(result.plan).parameters
    return save(lambda: _figure(result, _rows(result, words)), path)


def _figure(result: EnvelopeResult, rows: Sequence[_Row]) -> Figure:
    lines = sum(row.name.count("\n") + 1 for row in rows)
    height = max(3.0, 1.9 + 0.26 * len(rows) + 0.17 * lines)
    figure = Figure(figsize=(11.5, height), layout="constrained")
    # With many parameters the curve stays at the top and keeps its proportions.
    curve = min(height, _TALLEST)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.75, 1], height_ratios=[curve, max(height - curve, 1e-3)])
    tall = height > _TALLEST
    _draw_box(figure.add_subplot(grid[:, 0] if tall else grid[0, 0]), rows)
    _draw_convergence(figure.add_subplot(grid[0, 1]), result)
    figure.suptitle(_title(result), fontsize=10, x=0.01, ha="left")
    shown = style.entries(figure.axes[:1])
    figure.legend(shown.values(), shown.keys(), loc="outside lower left", ncols=4, fontsize=8, frameon=False)
    return figure


def _title(result: EnvelopeResult) -> str:
    ends = {
        searching.Status.COMPLETE: "complete",
        searching.Status.TIMEOUT: "out of time: best box so far",
        searching.Status.INTERRUPTED: "interrupted: best box so far",
        searching.Status.INVALID: "invalid",
        searching.Status.UNKNOWN: "a solver failed: best box so far",
    }
    method = {"irr": "IRR", "widen": "exact widening", "optimal": "greatest total width", "risk": "most probable"}[
        result.method
    ]
    if result.method == "widen" and result.inner is not None:
        method = "inner box"
    precision = "" if result.beta is None else f", β = {readable(result.beta)}"
    search = f"{method}{precision}; {ends[result.status]}"
    return f"The plan is valid for all values in this box ({search})"


def _rows(result: EnvelopeResult, words: Mapping[str, str]) -> list[_Row]:
    rows = []
    for parameter in result.parameters:
        interval = result.box[parameter.name]
        below = None if interval.lower is None else approximate(parameter.nominal - interval.lower)
        above = None if interval.upper is None else approximate(interval.upper - parameter.nominal)
        lower = end(interval.lower, upper=False, closed=interval.lower_closed)
        upper = end(interval.upper, upper=True, closed=interval.upper_closed)
        name = wrapped(f"{words.get(parameter.name, parameter.name)} = {readable(parameter.nominal)}", 34)
        rows.append(_Row(name, below, above, lower, upper))
    return rows


# -- the box ---------------------------------------------------------------------------------------------------------


def _draw_box(axes: Axes, rows: Sequence[_Row]) -> None:
    ends = _scale(axes, rows)
    for index, row in enumerate(rows):
        left = -ends[0] if row.below is None else -row.below
        right = ends[1] if row.above is None else row.above
        axes.barh(index, right - left, left=left, height=0.5, color=VALID, edgecolor=EDGE, linewidth=1, zorder=2,
                  label="all values in the box, together")  # fmt: skip
        axes.plot(0, index, zorder=4, label="nominal value", **style.NOMINAL)
        if row.below != 0 or row.above != 0:
            _draw_end(axes, (left, index), row.lower, infinite=row.below is None, side=-1)
        _draw_end(axes, (right, index), row.upper, infinite=row.above is None, side=1)
    axes.axvline(0, color=style.BLACK, linewidth=0.8, zorder=1)
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("deviation from the nominal value")
    axes.set_title("Box: values at its ends", fontsize=10, loc="left")
    axes.tick_params(axis="y", length=0)
    _tidy(axes, grid="x")


def _draw_end(axes: Axes, place: tuple[float, float], text: str, *, infinite: bool, side: int) -> None:
    """The value beside an end, and an arrow where there is no end; `side` is −1 or 1."""
    if infinite:
        marker = "<" if side < 0 else ">"
        label = "no end on this side"
        axes.plot(*place, marker=marker, markersize=11, color=EDGE, linestyle="", clip_on=False, zorder=5, label=label)
    beside: Any = {"xytext": (side * (9 if infinite else 4), 0), "textcoords": "offset points"}
    aligned: Any = {"ha": "left" if side > 0 else "right", "va": "center", "fontsize": 8}
    axes.annotate(text, place, annotation_clip=False, zorder=6, **beside, **aligned)


def _scale(axes: Axes, rows: Sequence[_Row]) -> tuple[float, float]:
    """Set the horizontal axis; returns how far to the left and to the right unbounded ends are drawn."""
    sides = [[row.below for row in rows], [row.above for row in rows]]
    finite = [reach for side in sides for reach in side if reach]
    largest, smallest = max(finite, default=1.0), min(finite, default=1.0)
    wide = largest / smallest > _WIDE
    if wide:
        _logarithmic(axes, smallest, largest)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(7))
        axes.xaxis.set_major_formatter(FuncFormatter(_tick))
    ends, limits = [], []
    for side in sides:
        reach = max((reach for reach in side if reach), default=0.0)
        ends.append((reach or largest) * (3 if wide else 1.25))
        shown = ends[-1] if None in side else reach
        # Room for the labels beside the bars.
        limits.append(max(shown * 8, smallest) if wide else shown + largest * 0.25)
    axes.set_xlim(-limits[0], limits[1])
    return ends[0], ends[1]


def _logarithmic(axes: Axes, smallest: float, largest: float) -> None:
    linear = 10.0 ** floor(log10(smallest))
    axes.set_xscale("symlog", linthresh=linear, linscale=0.6)
    decades = floor(log10(largest / linear)) + 1
    ticks = [linear * 10.0**power for power in range(0, decades + 1, 1 if decades < 4 else 2 if decades < 9 else 4)]
    axes.set_xticks([*(-tick for tick in reversed(ticks)), 0, *ticks])
    axes.xaxis.set_major_formatter(FuncFormatter(_tick))
    axes.xaxis.set_minor_locator(NullLocator())


def _tick(value: float, _position: object = None) -> str:
    return "0" if not value else f"{value:+g}".replace("-", "−")


# -- convergence -----------------------------------------------------------------------------------------------------


def _draw_convergence(axes: Axes, result: EnvelopeResult) -> None:
    checks, shares, note = _convergence(result)
    axes.set_title("Convergence: width of the box found so far", fontsize=10, loc="left")
    axes.set_xlabel("containment check")
    axes.set_ylabel(f"total width{note}, share of final")
    if len(checks) > 1:
        axes.step(checks, shares, where="post", color=EDGE, linewidth=1.8)
        axes.fill_between(checks, shares, step="post", color=VALID, alpha=0.5, linewidth=0)
        axes.set_xlim(0, checks[-1])
        axes.set_ylim(0, 1.05)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{share:.0%}"))
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    else:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_ylabel("")
        place = axes.transAxes
        axes.text(0.5, 0.5, "no finite width", ha="center", va="center", color=style.GREY, transform=place)
    _tidy(axes, grid="both")


def _convergence(result: EnvelopeResult) -> tuple[list[int], list[float], str]:
    """Checks and shares, beginning at the nominal point; over the parameters that are bounded in the end."""
    bounded = [name for name, interval in result.box.intervals.items() if interval.width is not None]
    final = _width(result.box, bounded)
    if not final:
        return [], [], ""
    note = "" if len(bounded) == len(result.box.intervals) else " of the bounded"
    checks, shares = [0], [0.0]
    for step in result.trace:
        checks.append(step.check)
        shares.append(approximate(_width(step.box, bounded) / final))
    return checks, shares, note


def _width(box: Box, names: Sequence[str]) -> Fraction:
    return Box({name: box[name] for name in names}).total_width or Fraction(0)


def _tidy(axes: Axes, *, grid: Literal["x", "both"]) -> None:
    style.without_frame(axes)
    axes.grid(axis=grid, color=style.GRID, linewidth=0.8, zorder=0)
    axes.tick_params(labelsize=8)


# -- probabilities ---------------------------------------------------------------------------------------------------


def plot_risk(result: RiskResult, path: Path | None) -> Figure:
    """Draw the region with the density over it, for two parameters; and a bar for each obligation.

    Raises:
        InputError: if the file cannot be written.
    """
    return save(lambda: _risk_figure(result), path)


def _risk_figure(result: RiskResult) -> Figure:
    moving = [name for name, distribution in result.distributions.items() if distribution.settled.kind != "constant"]
    plane = len(moving) == 2 and result.region is not None
    words = Words(result.plan)
    shown = _shown(result, words)
    names = [wrapped(bar.name, 40) for bar in shown]
    lines = sum(name.count("\n") + 1 for name in names)
    height = max(4.6 if plane else 2.4, 1.6 + 0.16 * lines + 0.16 * len(names))
    figure = Figure(figsize=(13.0 if plane else 8.5, height), layout="constrained")
    figure.suptitle(_risk_title(result, words), fontsize=10, x=0.01, ha="left")
    if plane:
        left, right = figure.subplots(1, 2, width_ratios=[1.1, 1])
        _draw_region(left, result, moving, words)
    else:
        right = figure.subplots()
    _draw_shares(right, shown, names, late=_is_late(result))
    explained = style.entries(figure.axes)
    figure.legend(explained.values(), explained.keys(), loc="outside lower left", ncols=3, fontsize=8, frameon=False)
    return figure


def _risk_title(result: RiskResult, words: Words) -> str:
    """The probability, and the values of what is no random number."""
    text = f"Probability that the plan succeeds: {bounds_text(result.probability, places_for(result.within))}"
    fixed = ", ".join(
        f"{words.parameters[name]} = {readable(distribution.settled.numbers['value'])}"
        for name, distribution in result.distributions.items()
        if distribution.settled.kind == "constant"
    )
    return wrapped(f"{text}\nfixed: {fixed}" if fixed else text, 120)


def _draw_region(canvas: Axes, result: RiskResult, moving: Sequence[str], words: Words) -> None:
    if result.region is None:
        return
    ends = tuple(_view(result, name) for name in moving)
    constant = {name: known.settled for name, known in result.distributions.items() if name not in moving}
    fixed = {name: distribution.numbers["value"] for name, distribution in constant.items()}
    region = result.region.region.slice(fixed)
    boxes = {} if result.best is None else {"the most probable of those compared": result.best.result.box}
    exact = result.region.is_exact
    shown = Region(tuple(moving), region.pieces, region.base)
    draw_plane(canvas, shown, ends, boxes, {}, words=words.parameters, exact=exact)
    grids = [[low + (high - low) * Fraction(step, _FINE) for step in range(_FINE + 1)] for low, high in ends]
    across, up = (
        [result.distributions[name].settled.density(value) for value in grid]
        for name, grid in zip(moving, grids, strict=True)
    )
    density = [[a * b for a in across] for b in up]
    levels = [max(map(max, density)) * share for share in _SHARES]
    if levels[0] < levels[-1]:
        xs, ys = ([float(value) for value in grid] for grid in grids)
        canvas.contour(xs, ys, density, levels=levels, colors=VERMILION, linewidths=0.9, zorder=5)
        percent = ", ".join(f"{share:.0%}" for share in _SHARES)
        canvas.plot([], [], color=VERMILION, linewidth=0.9, label=f"density: {percent} of the greatest")
    canvas.set_title("Valid values, and how probable values are", fontsize=9, loc="left")


def _view(result: RiskResult, name: str) -> tuple[Fraction, Fraction]:
    """Where almost all values are."""
    distribution = result.distributions[name].settled
    lower, upper = distribution.support
    reach = distribution.scale * Fraction(7, 2)
    low = distribution.centre - reach if lower is None else max(lower, distribution.centre - reach)
    high = distribution.centre + reach if upper is None else min(upper, distribution.centre + reach)
    return low, high


@dataclass(frozen=True, slots=True)
class _ShareBar:
    """What fails or is late, how probably by certified bounds, and in which share of random draws."""

    name: str
    certified: Bounds | None
    drawn: float | None = None


def _is_late(result: RiskResult) -> bool:
    """Whether what is late is known, instead of what fails first."""
    return not result.shares and result.late is not None


def _shown(result: RiskResult, words: Words) -> list[_ShareBar]:
    """What matters: obligations, the most probable last; or durations on chains that are late, and what they delay."""
    if result.late is not None and _is_late(result):
        delayed = [(words.obligation(share.name), share) for share in result.late.points[:SHOWN]]
        along = [(words.parameters.get(share.name, share.name), share) for share in result.late.durations[:SHOWN]]
        return [_ShareBar(name, share.certified, share.estimate) for name, share in (*delayed, *along)][::-1]
    shares = [share for share in result.shares or () if share.probability.upper >= result.within]
    shares.sort(key=lambda share: share.probability.upper)
    return [_ShareBar(words.obligation(share.name), share.probability) for share in shares]


def _draw_shares(canvas: Axes, shown: Sequence[_ShareBar], names: Sequence[str], *, late: bool) -> None:
    """A bar for each: what is certain in full colour, what is possible lighter and hatched, draws as a dot."""
    for row, bar in enumerate(shown):
        if bar.certified is not None:
            possible: Any = {"color": style.LIGHT[5], "edgecolor": VERMILION, "hatch": style.HATCHES[1]}
            canvas.barh(row, float(bar.certified.upper), height=0.55, label="possibly (upper bound)", **possible)
            certain = float(bar.certified.lower)
            canvas.barh(row, certain, height=0.55, color=VERMILION, label="certainly (lower bound)")
        if bar.drawn is not None:
            canvas.plot(bar.drawn, row, "o", color=EDGE, markersize=5, label="share of draws in which it is latest")
    canvas.set_yticks(range(len(shown)), names, fontsize=8)
    canvas.set_xlim(left=0)
    if late:
        canvas.set_xlabel("probability that some chain of actions that ends there, or has it, is late")
        canvas.set_title("What is late", fontsize=9, loc="left")
    else:
        canvas.set_xlabel("probability that this is the first to break")
        canvas.set_title("What fails first", fontsize=9, loc="left")
    if not shown:
        canvas.text(0.5, 0.5, "nothing that matters", ha="center", va="center", transform=canvas.transAxes)
        canvas.set_xticks([])
    style.without_frame(canvas)


@singledispatch
def picture(result: object, path: Path | None, axes: Sequence[str]) -> Figure:
    """A figure of a result, with the parameters `axes` where it has any, written to the path if there is one.

    Raises:
        InputError: if there is nothing to draw, or the file cannot be written.
    """
    drawn = sorted(kind.__name__ for kind in picture.registry if kind is not object)
    raise errors.InputError(
        f"found {type(result).__name__}, expected one of {', '.join(drawn)} to draw", place_of("plot")
    )


picture.register(EnvelopeResult, _picture_of_envelope)
picture.register(RegionResult, plot_region)
picture.register(Comparison, plot_comparison)
picture.register(RiskResult, lambda result, path, _: plot_risk(result, path))
picture.register(ExecutionRecord, lambda record, path, _: gantt.plot_team_run(record, path))
picture.register(LabeledRegion, plot_team_region)
picture.register(TeamEnvelope, plot_team_envelope)


def draw(result: object, path: str | os.PathLike[str] | None, axes: str | Sequence[str]) -> Figure:
    """The picture, of arguments as people give them."""
    written = None if path is None else plot_file(Path(path), place_of("path"))
    return picture(result, written, names(axes, place_of("axes")) if axes else ())
