"""Pictures of envelopes of plans with choices: where which combinations of choices are possible, and boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.draw.plane import clip_to, corners_of
from robust.draw.style import DARK_GREY, HATCHES, LIGHT, NOMINAL, box_line, cut, entries, hatch_outside, save, wrapped
from robust.errors import InputError, did_you_mean
from robust.numbers import plural, readable
from robust.options.declare import place_of
from robust.pike_bridge.envelopes.parameters import ParametricPlan, TeamParameter
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
from robust.pike_bridge.model import guard_text
from robust.qe.box import Box
from robust.qe.region import Region
from robust.show.pike_envelopes import Cells, cells_of, promise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMED = 4
"""Combinations of choices that the legend names of an area."""


def plotted(plan: ParametricPlan, axes: Sequence[str]) -> tuple[TeamParameter, TeamParameter]:
    """The two parameters to draw: those asked for, or the first two.

    Raises:
        InputError: if there are not two, or one is unknown.
    """
    names = tuple(axes) or plan.names[:2]
    for name in names:
        if name not in plan.names:
            raise InputError(f"found unknown parameter {name!r}{did_you_mean(name, plan.names)}", place_of("axes"))
    if len(names) != 2 or names[0] == names[1]:
        raise InputError(f"found {plural(len(names), 'parameter')} to draw, expected two", place_of("plot"))
    known = {one.name: one for one in plan.parameters}
    return known[names[0]], known[names[1]]


Layers = Sequence[tuple[str, Region]]


def plot_region(found: LabeledRegion, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw which combinations are possible where."""
    return plot_cells(found, cells_of(found), path, axes)


def plot_cells(found: LabeledRegion, cells: Cells | None, path: Path | None, axes: Sequence[str]) -> Figure:
    """The same where the cells are known, or there was no time to find them."""
    return plot_layers(found.plan, region_layers(found, cells), path, axes)


def plot_envelope(found: TeamEnvelope, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw for which values what is promised is so, and the box.

    Raises:
        InputError: if nothing of that is known.
    """
    if not found.combinations:
        raise InputError("found an envelope of which nothing is known, expected something to draw", place_of("plot"))
    return plot_layers(found.plan, [(promise(found), found.region)], path, axes, found.box if found.verified else None)


def region_layers(found: LabeledRegion, cells: Cells | None) -> Layers:
    """What is drawn of a labeled region: where exactly which combinations are possible, else where each is."""
    if cells is None:
        return [
            (guard_text(each.choices), found.region(dict(each.choices))) for each in found.combinations if each.pieces
        ]
    return [
        ("\n".join(_few([guard_text(one.choices) or "any choices" for one in possible])), cell)
        for possible, cell in cells
        if possible
    ]


def _few(labels: Sequence[str]) -> Sequence[str]:
    """The labels, of many the first ones."""
    shown = [cut(one, 80) for one in labels[:_NAMED]]
    return shown if len(labels) <= _NAMED else [*shown, f"and {len(labels) - _NAMED} more"]


def plot_layers(
    plan: ParametricPlan, layers: Layers, path: Path | None, axes: Sequence[str], box: Box | None = None
) -> Figure:
    """Draw regions of two parameters, the others at their nominal values, and perhaps a box."""
    shown = plotted(plan, axes)
    names = tuple(one.name for one in shown)
    rest = {name: value for name, value in plan.nominal.items() if name not in names}
    sliced = [(label, Region.union_of(names, region.slice(rest).as_union().pieces)) for label, region in layers]
    return save(lambda: _figure(plan, shown, sliced, box), path)


def _figure(
    plan: ParametricPlan, shown: tuple[TeamParameter, TeamParameter], layers: Layers, box: Box | None
) -> Figure:
    from matplotlib.figure import Figure  # noqa: PLC0415

    lines = sum(label.count("\n") + 1 for label, _ in layers)
    figure = Figure(figsize=(8.4, 4.8 + 0.15 * lines), layout="constrained")
    canvas = figure.add_subplot()
    figure.suptitle(_title(plan, shown, box), fontsize=10, x=0.01, ha="left")
    frame = {one.name: _view(one, layers, box) for one in shown}
    view = clip_to(tuple(frame), tuple(frame.values()))
    for number, (label, region) in enumerate(layers):
        look: dict[str, Any] = {
            "facecolor": LIGHT[number % len(LIGHT)], "edgecolor": DARK_GREY, "linewidth": 0.5,
            "hatch": HATCHES[number % len(HATCHES)],
        }  # fmt: skip
        for piece in region.pieces:
            corners = [(float(x), float(y)) for x, y in corners_of(piece.restricted(view))]
            if len(corners) > 2:
                canvas.fill(*zip(*corners, strict=True), label=label, **look)
    hatch_outside(canvas, "no correct execution found")
    if box is not None:
        _draw_box(canvas, box, frame)
    nominal = [float(one.parameter.nominal) for one in shown]
    canvas.plot([nominal[0]], [nominal[1]], zorder=8, label="nominal values", **NOMINAL)
    _finish(canvas, shown, frame)
    return figure


def _title(plan: ParametricPlan, shown: Sequence[TeamParameter], box: Box | None) -> str:
    """What is drawn, and the values of what is not."""
    what = (
        "Which choices are possible, by the values of two parameters"
        if box is None
        else "Values in the box, and around it"
    )
    fixed = ", ".join(f"{one.words} = {readable(one.parameter.nominal)}" for one in plan.parameters if one not in shown)
    return wrapped(f"{what}\nfixed: {fixed}" if fixed else what, 110)


def _draw_box(canvas: Axes, box: Box, frame: Mapping[str, tuple[Fraction, Fraction]]) -> None:
    """The outline of a box; a side that is not bounded lies beyond the view."""
    sides = []
    for name, (low, high) in frame.items():
        lower, upper = box[name].lower, box[name].upper
        far = high - low
        sides.append((low - far if lower is None else lower, high + far if upper is None else upper))
    (left, right), (bottom, top) = ((float(low), float(high)) for low, high in sides)
    xs, ys = [left, right, right, left, left], [bottom, bottom, top, top, bottom]
    canvas.plot(xs, ys, label="box", zorder=6, **box_line(0, 1))


def _finish(canvas: Axes, shown: Sequence[TeamParameter], frame: Mapping[str, tuple[Fraction, Fraction]]) -> None:
    across, up = shown
    canvas.set_xlabel(wrapped(f"{across.words}: {across.meaning}", 80))
    canvas.set_ylabel(wrapped(f"{up.words}: {up.meaning}", 48))
    canvas.set_xlim(*map(float, frame[across.name]))
    canvas.set_ylim(*map(float, frame[up.name]))
    once = entries([canvas])
    texts = [wrapped(label, 60) for label in once]
    canvas.figure.legend(once.values(), texts, loc="outside lower center", fontsize="small", frameon=False, ncols=2)


def _view(one: TeamParameter, layers: Layers, box: Box | None) -> tuple[Fraction, Fraction]:
    """The values that are shown: those at which something happens, and the nominal one, with a margin."""
    values = [one.parameter.nominal]
    for _, region in layers:
        for piece in region.pieces:
            values += [vertex[one.name] for vertex in piece.closure().vertices()]
    if box is not None:
        values += [end for end in (box[one.name].lower, box[one.name].upper) if end is not None]
    low, high = min(values), max(values)
    margin = (high - low) / 5 or Fraction(1)
    lowest = low - margin if one.parameter.lower is None else max(one.parameter.lower, low - margin)
    return lowest, high + margin
