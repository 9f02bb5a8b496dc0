"""Pictures of probabilities of success: valid values with the density over them, and a bar for each obligation."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from robust.draw.plane import draw_plane
from robust.draw.style import HATCHES, LIGHT, VERMILION, entries, save, without_frame, wrapped
from robust.numbers import readable
from robust.probability.blame import Share
from robust.probability.risk import RiskResult
from robust.qe.region import Region
from robust.show.probabilities import bounds_text, places_for
from robust.show.words import Words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHARES = (0.01, 0.1, 0.3, 0.6, 0.9)
"""Lines of equal density, as shares of the greatest."""
_FINE = 120
"""Points of a density to either side."""


def plot_risk(result: RiskResult, path: Path | None, _axes: Sequence[str] = ()) -> Figure:
    """Draw the region with the density over it, for two parameters; and a bar for each obligation.

    Raises:
        InputError: if the file cannot be written.
    """
    return save(lambda: _figure(result), path)


def _figure(result: RiskResult) -> Figure:
    moving = [name for name, one in result.distributions.items() if one.settled.kind != "constant"]
    plane = len(moving) == 2 and result.region is not None
    shown = _shown(result)
    words = Words(result.plan)
    names = [wrapped(words.obligation(one.name), 40) for one in shown]
    lines = sum(name.count("\n") + 1 for name in names)
    height = max(4.6 if plane else 2.4, 1.6 + 0.16 * lines + 0.16 * len(names))
    figure = Figure(figsize=(13.0 if plane else 8.5, height), layout="constrained")
    figure.suptitle(_title(result, words), fontsize=10, x=0.01, ha="left")
    if plane:
        left, right = figure.subplots(1, 2, width_ratios=[1.1, 1])
        _draw_region(left, result, moving, words)
    else:
        right = figure.subplots()
    _draw_shares(right, shown, names)
    explained = entries(figure.axes)
    figure.legend(explained.values(), explained.keys(), loc="outside lower left", ncols=3, fontsize=8, frameon=False)
    return figure


def _title(result: RiskResult, words: Words) -> str:
    """The probability, and the values of what is no random number."""
    found = f"Probability that the plan succeeds: {bounds_text(result.probability, places_for(result.within))}"
    fixed = ", ".join(
        f"{words.parameters[name]} = {readable(one.settled.numbers['value'])}"
        for name, one in result.distributions.items()
        if one.settled.kind == "constant"
    )
    return wrapped(f"{found}\nfixed: {fixed}" if fixed else found, 120)


def _draw_region(canvas: Axes, result: RiskResult, moving: Sequence[str], words: Words) -> None:
    if result.region is None:
        return
    ends = tuple(_view(result, name) for name in moving)
    fixed = {name: one.settled.numbers["value"] for name, one in result.distributions.items() if name not in moving}
    found = result.region.region.slice(fixed)
    boxes = {} if result.best is None else {"the most probable of those compared": result.best.result.box}
    exact = result.region.is_exact
    shown = Region(tuple(moving), found.pieces, found.base)
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


def _shown(result: RiskResult) -> list[Share]:
    """The obligations that matter, the most probable last."""
    found = [one for one in result.shares or () if one.probability.upper >= result.within]
    return sorted(found, key=lambda one: one.probability.upper)


def _draw_shares(canvas: Axes, shown: Sequence[Share], names: Sequence[str]) -> None:
    """A bar for each obligation: what is certain in full colour, what is possible lighter and hatched."""
    for row, one in enumerate(shown):
        possible: Any = {
            "color": LIGHT[5],
            "edgecolor": VERMILION,
            "hatch": HATCHES[1],
            "label": "possibly (upper bound)",
        }
        canvas.barh(row, float(one.probability.upper), height=0.55, **possible)
        canvas.barh(row, float(one.probability.lower), height=0.55, color=VERMILION, label="certainly (lower bound)")
    canvas.set_yticks(range(len(shown)), names, fontsize=8)
    canvas.set_xlabel("probability that this is the first to break")
    canvas.set_title("What fails first", fontsize=9, loc="left")
    if not shown:
        canvas.text(0.5, 0.5, "nothing that matters", ha="center", va="center", transform=canvas.transAxes)
        canvas.set_xticks([])
    without_frame(canvas)
