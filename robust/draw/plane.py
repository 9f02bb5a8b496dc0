"""Pictures of regions over one or two parameters, of slices and projections of others, and of boxes in them.

Regions become polygons exactly; only what is handed to matplotlib are floats.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from math import atan2
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robust.draw import style
from robust.draw.style import DARK_GREY, EDGE, GREEN, VALID, cut, save, wrapped
from robust.errors import InputError, did_you_mean
from robust.irr import compare, search, templates
from robust.numbers import plural, readable
from robust.options.declare import place_of
from robust.pike_bridge.envelopes.parameters import ParametricPlan, TeamParameter
from robust.pike_bridge.envelopes.pieces import Combination
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope
from robust.pike_bridge.model import guard_text
from robust.plan import load, model
from robust.qe import compute, constraint
from robust.qe.box import Box
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region
from robust.show import pike_envelopes, text
from robust.show.regions import METHOD_NAMES

Corner = tuple[Fraction, Fraction]
Segment = tuple[Corner, Corner]
Rectangle = tuple[tuple[Fraction, Fraction], ...]
"""The part of the plane (or line) that is shown: lower and upper end by axis."""

THIN = Fraction(1, 150)
"""Slabs narrower than this share of the view are drawn as lines, so that they stay visible."""
_POSSIBLE = "Which choices are possible, by the values of two parameters"
_NAMED = 4
"""Combinations of choices that the legend names of an area."""


# -- regions and comparisons -------------------------------------------------------------------------------------------


def plot_region(result: compute.RegionResult, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw a region, and what is proved of one that is not complete."""
    if result.plan is None:
        raise InputError("the region has no plan to draw it with; give the result of a search", place_of("plot"))
    inner, exact = (None, True) if result.is_exact else (result.inner, False)
    return _plot(result.region, result.plan, path, axes, inner=inner, exact=exact)


def plot_comparison(result: compare.Comparison, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw the region with all boxes in it.

    Raises:
        InputError: if there is no region, or nothing to draw of it.
    """
    if result.region is None:
        raise InputError("the comparison has no region to draw; give it more time", place_of("plot"))
    boxes = {METHOD_NAMES[entry.method]: entry.result.box for entry in result.entries if entry.result.verified}
    return _plot(result.region.region, result.plan, path, axes, boxes=boxes, exact=result.region.is_exact)


def plot_shape(result: search.EnvelopeResult, shape: templates.Shape, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw the region with the box and the shape around it."""
    if result.plan is None:
        raise InputError("the shape has no plan to draw it with; give the result of a search", place_of("plot"))
    shapes = {shape.name: Region.union_of(shape.parameters, [shape.polyhedron])}
    return _plot(shape.region, result.plan, path, axes, boxes={result.method: result.box}, shapes=shapes)


def shown_axes(plan: model.ParametrizedPlan, axes: Sequence[str]) -> tuple[str, ...]:
    """The one or two parameters that are drawn: those that were asked for, or the first two.

    Raises:
        InputError: if there is nothing to draw, the axes are none, or there is no nominal value for one not drawn.
    """
    known = [parameter.name for parameter in plan.parameters]
    if not known:
        raise InputError("the plan has no parameters to draw; name some with --parameter", place_of("plot"))
    _require_known(axes, known)
    if len(axes) > 2 or len(set(axes)) < len(axes):
        raise InputError(f"found {','.join(axes)}, expected one or two different parameters", place_of("axes"))
    shown = tuple(axes) or tuple(known[:2])
    load.require_nominal_values(parameter for parameter in plan.parameters if parameter.name not in shown)
    return shown


def _require_known(axes: Sequence[str], known: Sequence[str]) -> None:
    for name in axes:
        if name not in known:
            raise InputError(f"found unknown parameter {name!r}{did_you_mean(name, known)}", place_of("axes"))


def _plot(
    region: Region,
    plan: model.ParametrizedPlan,
    path: Path | None,
    axes: Sequence[str],
    *,
    boxes: Mapping[str, Box] | None = None,
    shapes: Mapping[str, Region] | None = None,
    inner: Callable[[Point], Region] | None = None,
    exact: bool = True,
) -> Figure:
    """Draw one or two parameters, the others at their nominal values; also an inner bound, if there is one."""
    shown = shown_axes(plan, axes)
    nominal = {name: value for name, value in plan.nominal.items() if name in region.parameters}
    rest = {name: value for name, value in nominal.items() if name not in shown}
    proved = None if inner is None else inner(rest)
    words = text.Words(plan).parameters
    points = {"nominal values": nominal} if plan.has_nominal else {}
    return save(
        lambda: draw_region(
            region, shown, at=rest, boxes=boxes, shapes=shapes, points=points, inner=proved, words=words, exact=exact
        ),
        path,
    )


def draw_region(
    region: Region,
    axes: Sequence[str],
    *,
    at: Point | None = None,
    boxes: Mapping[str, Box] | None = None,
    shapes: Mapping[str, Region] | None = None,
    points: Mapping[str, Point] | None = None,
    inner: Region | None = None,
    words: Mapping[str, str] | None = None,
    exact: bool = True,
) -> Figure:
    """A drawing of one or two parameters, as a figure that belongs to no window.

    Args:
        region: what is drawn, as far as it is near what is bounded in it, the boxes and the points.
        axes: the parameters to show.
        at: values for parameters that are not shown; the region is sliced there, and projected along the rest.
        inner: an inner bound over the parameters that are shown, if the region is an outer one.
        boxes, points: what to draw on top, by the name to show in the legend; only their shown parameters matter, but a
            box that does not hold the values of those that are fixed is in the legend alone.
        shapes: convex sets of parameter values whose outlines are drawn, if two parameters are shown.
        words: what parameters are called; their names where they are not in it.
        exact: whether the region is the envelope itself, or an outer bound of it.
    """
    shown = _shown(region, tuple(axes), at or {})
    points = points or {}
    sliced = {label: box if _holds(box, at or {}) else None for label, box in (boxes or {}).items()}
    here = [box for box in sliced.values() if box is not None]
    rectangle = tuple(_range([shown], name, here, list(points.values())) for name in shown.parameters)
    flat = len(shown.parameters) == 1
    figure = Figure(figsize=(8.6, 2.0 + 0.35 * len(sliced) if flat else 5.0), layout="constrained")
    canvas = figure.add_subplot()
    (_draw_line if flat else draw_plane)(canvas, shown, rectangle, sliced, points, words=words, exact=exact)
    clip = Polyhedron(shown.parameters, tuple(_clip_to(shown.parameters, rectangle)))
    view = Region.union_of(shown.parameters, [clip])
    for order, (label, shape) in enumerate((shapes or {}).items() if not flat else ()):
        for piece in _shown(shape, tuple(axes), at or {}).intersection(view).as_union().pieces:
            look = style.box_line(order + len(sliced), len(sliced) + len(shapes or {}))
            _draw_box(canvas, piece, rectangle, {**look, "zorder": 12 + order, "label": label})
    if inner is not None:
        _draw_inner(canvas, inner, shown.parameters, rectangle)
    what = "Values for which the plan is valid" if exact else "Outer bound: outside the plan can fail, inside it may"
    title = _title(what, (((words or {}).get(name, name), value) for name, value in (at or {}).items()))
    if shown.intersection(view).is_empty:
        title += "\nnone of them in this view"
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    _legend(canvas)
    return figure


def _holds(box: Box, at: Point) -> bool:
    """Whether the values are in the box, as far as it speaks of them."""
    return all(value in box[name] for name, value in at.items() if name in box.intervals)


def _title(what: str, fixed: Iterable[tuple[str, Fraction]]) -> str:
    """What is drawn, and the values of what is not."""
    values = ", ".join(f"{name} = {readable(value)}" for name, value in fixed)
    return wrapped(f"{what}\nfixed: {values}" if values else what, 112)


def _legend(canvas: Axes) -> None:
    """Everything with a label, beside the drawing."""
    shown = style.entries([canvas])
    texts = [wrapped(label, 34) for label in shown]
    canvas.legend(shown.values(), texts, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small",
                  frameon=False, handlelength=2.6)  # fmt: skip


def _shown(region: Region, names: tuple[str, ...], at: Point) -> Region:
    sliced = region.slice(at) if at else region
    if set(sliced.parameters) == set(names):
        return Region(names, sliced.pieces, sliced.base)
    return sliced.project(names)


def _range(
    regions: Sequence[Region], name: str, boxes: Sequence[Box], points: Sequence[Point]
) -> tuple[Fraction, Fraction]:
    """The values of a parameter that are shown, around everything finite."""
    overlays = [end for box in boxes for end in (box.intervals[name].lower, box.intervals[name].upper)]
    overlays += [point[name] for point in points]
    values = [value for value in overlays if value is not None]
    values += [value for region in regions for value in _landmarks(region, name)]
    low, high = min(values, default=Fraction(0)), max(values, default=Fraction(0))
    margin = (high - low) * Fraction(2, 25) or max(abs(low) / 4, Fraction(1))
    return low - margin, high + margin


def _landmarks(region: Region, name: str) -> list[Fraction]:
    """Ends and coordinates of vertices; they show where something happens even if the region is unbounded."""
    bases = [base for base, _ in region.parts()]
    bases += [base.intersection(piece) for base, removed in region.parts() for piece in removed]
    extents = [extent for extent in (base.extent(name) for base in bases) if extent is not None]
    ends = [end for extent in extents for end in (extent.lower, extent.upper) if end is not None]
    return ends + [vertex[name] for base in bases for vertex in base.vertices()]


def _clip_to(names: Sequence[str], rectangle: Rectangle) -> list[constraint.LinearConstraint]:
    """The view as constraints."""
    clip = []
    for name, (lower, upper) in zip(names, rectangle, strict=True):
        clip.append(constraint.LinearConstraint(((name, 1),), constraint.Sense.AT_MOST, upper))
        clip.append(constraint.LinearConstraint(((name, -1),), constraint.Sense.AT_MOST, -lower))
    return clip


def draw_plane(
    canvas: Axes,
    region: Region,
    rectangle: Rectangle,
    boxes: Mapping[str, Box | None],
    points: Mapping[str, Point],
    *,
    words: Mapping[str, str] | None = None,
    exact: bool = True,
) -> None:
    """Pieces are filled without outline, so that no seam shows between them; only edges of the whole are drawn."""
    names = region.parameters
    clip = _clip_to(names, rectangle)
    parts = [(base.restricted(clip), removed) for base, removed in region.parts()]
    cuts = [base.intersection(piece) for base, removed in parts for piece in removed]
    disjoint = [base for base, removed in parts if not removed]
    for base, removed in parts:
        if removed:
            disjoint += Region.difference(base, removed).as_union(disjoint=True).pieces
    area = "valid" if exact else "not known to fail"
    for piece in disjoint:
        _show(canvas, piece, area)
    for piece in [*(base for base, _ in parts), *cuts]:
        _outline(canvas, piece, region, rectangle)
    for slab in cuts:
        _mark_thin(canvas, slab, rectangle)
    for order, (label, box) in enumerate(_labelled(boxes)):
        shape = Polyhedron.nothing(names) if box is None else Polyhedron(names, _sides(names, box)).restricted(clip)
        _draw_box(canvas, shape, rectangle, {**style.box_line(order, len(boxes)), "zorder": 6 + order, "label": label})
    style.hatch_outside(canvas, "not valid")
    _finish(canvas, rectangle, [text.named(name, words) for name in names],
            {label: (point[names[0]], point[names[1]]) for label, point in points.items()})  # fmt: skip


def _finish(canvas: Axes, rectangle: Rectangle, words: Sequence[str], points: Mapping[str, Corner]) -> None:
    """Mark points, and say what the axes are and where they end."""
    for label, point in points.items():
        canvas.plot(*_floats([point]), label=label, zorder=16, **style.NOMINAL)
    canvas.set_xlim(*map(float, rectangle[0]))
    canvas.set_ylim(*map(float, rectangle[1]))
    canvas.set_xlabel(wrapped(words[0], 70))
    canvas.set_ylabel(wrapped(words[1], 48))


def _draw_box(canvas: Axes, shape: Polyhedron, rectangle: Rectangle, look: dict[str, Any]) -> None:
    """The outline of a box, but no side of the view; without any width in some direction, all there is of it."""
    corners = _corners_of(shape)
    strokes = [corners] if 0 < len(corners) < 3 else [_corners_of(side) for side, _ in _edges(shape, rectangle)]
    marker = "s" if len(corners) == 1 else ""
    # A box that fills the view, or is far from it, has no side to be seen: its line stands in the legend alone.
    for stroke in strokes or [[]]:
        canvas.plot(*_floats(stroke), marker=marker, fillstyle="none", solid_capstyle="projecting", **look)


def _draw_inner(canvas: Axes, inner: Region, names: tuple[str, ...], rectangle: Rectangle) -> None:
    """What is proved, darker than what is not known to be bad."""
    label = "proved valid"
    for piece in (Polyhedron(names, (*piece.constraints, *_clip_to(names, rectangle))) for piece in inner.pieces):
        if len(names) == 1:
            _bar(canvas, piece, rectangle, 0, GREEN, label=label)
        else:
            _fill(canvas, piece, facecolor=GREEN, edgecolor=GREEN, linewidth=0.4, zorder=2, label=label)
        label = "_" + label.lstrip("_")


def _labelled(boxes: Mapping[str, Box | None]) -> Iterable[tuple[str, Box | None]]:
    """Boxes with what the legend says of them: which are the same, and which do not hold the values that are fixed."""
    items = list(boxes.items())
    for place, (label, box) in enumerate(items):
        twin = next((other for other, same in items[:place] if box is not None and same == box), None)
        note = "" if twin is None else f" (the same as {twin})"
        yield f"box: {label}{' (not in this slice)' if box is None else note}", box


def _sides(names: Sequence[str], box: Box) -> tuple[constraint.LinearConstraint, ...]:
    """The constraints of a box on the shown parameters."""
    return tuple(side for side in box.constraints() if side.parameters[0] in names)


def _corners_of(piece: Polyhedron) -> list[Corner]:
    """Vertices of a bounded polygon, a segment or a point, in circular order."""
    corners = [(vertex[piece.parameters[0]], vertex[piece.parameters[1]]) for vertex in piece.vertices()]
    if len(corners) < 3:
        return corners
    centre = [sum(values) / len(corners) for values in zip(*corners, strict=True)]
    # Normalised to the polygon's extent: in a very thin one floats would confuse the angles.
    size = [max(abs(corner[axis] - centre[axis]) for corner in corners) for axis in (0, 1)]
    return sorted(
        corners, key=lambda c: atan2(float((c[1] - centre[1]) / size[1]), float((c[0] - centre[0]) / size[0]))
    )


def _floats(corners: Iterable[Corner]) -> tuple[list[float], list[float]]:
    """Where corners are, across and up."""
    listed = list(corners)
    return [float(x) for x, _ in listed], [float(y) for _, y in listed]


def _fill(canvas: Axes, piece: Polyhedron, **look: Any) -> None:
    """Fill a polygon, if it has an area."""
    if len(corners := _corners_of(piece)) > 2:
        canvas.fill(*_floats(corners), **look)


def _show(canvas: Axes, piece: Polyhedron, label: str) -> None:
    """Fill a polygon; what is lower-dimensional becomes a line or a dot."""
    corners = _corners_of(piece)
    if 0 < len(corners) < 3:
        look: dict[str, Any] = (
            {"marker": "o", "markersize": 4, "linestyle": ""} if len(corners) == 1 else {"linewidth": 1.6}
        )
        canvas.plot(*_floats(corners), color=EDGE, zorder=3, label=label, **look)
    # A hair-thin line of the same colour closes the gap that antialiasing leaves between neighbours.
    _fill(canvas, piece, facecolor=VALID, edgecolor=VALID, linewidth=0.4, zorder=1, label=label)


def _edges(piece: Polyhedron, rectangle: Rectangle) -> list[tuple[Polyhedron, bool]]:
    """The sides of a polygon that are not sides of the view, as segments, and whether they are open."""
    form = piece.normal_form
    if form is None or len(form.free) < 2:
        return []
    frame = set(_clip_to(piece.parameters, rectangle))
    closure = piece.closure()
    return [
        (closure.restricted([side.with_relation(constraint.Sense.EQUAL)]), side.is_strict)
        for side in form.inequalities
        if side not in frame
    ]


def _outline(canvas: Axes, piece: Polyhedron, region: Region, rectangle: Rectangle) -> None:
    """Draw those parts of a polygon's sides that bound the region: solid if they belong to it, else dashed."""
    for side, _ in _edges(piece, rectangle):
        corners = _corners_of(side)
        if len(corners) == 2:
            for stroke, dashed in _boundary((corners[0], corners[1]), region):
                style: Any = (0, (4, 3)) if dashed else "-"
                label = "edge that does not belong to it" if dashed else "edge that belongs to it"
                canvas.plot(*_floats(stroke), color=EDGE, linestyle=style, linewidth=1.1, zorder=4, label=label)


def _boundary(segment: Segment, region: Region) -> list[tuple[Segment, bool]]:
    """The parts of a side that the region's boundary contains, and whether they are outside the region.

    Between two points where sides of any polyhedra cross the segment, all points are alike: the middle one decides.
    """
    names, (start, end) = region.parameters, segment
    sides = [c for base, removed in region.parts() for polyhedron in (base, *removed) for c in polyhedron.constraints]
    marks = {Fraction(0), Fraction(1)}
    for side in sides:
        first, last = (side.constant - side.value(dict(zip(names, corner, strict=True))) for corner in segment)
        if first * last < 0:
            marks.add(first / (first - last))
    ordered = sorted(marks)
    strokes: list[tuple[Segment, bool]] = []
    for low, high in pairwise(ordered):
        middle = dict(zip(names, _between(start, end, (low + high) / 2), strict=True))
        normal = dict(zip(names, (start[1] - end[1], end[0] - start[0]), strict=True))
        if _is_boundary(middle, normal, sides, region):
            stroke, is_open = (_between(start, end, low), _between(start, end, high)), middle not in region
            if strokes and strokes[-1][0][1] == stroke[0] and strokes[-1][1] == is_open:
                stroke = (strokes.pop()[0][0], stroke[1])
            strokes.append((stroke, is_open))
    return strokes


def _between(start: Corner, end: Corner, share: Fraction) -> Corner:
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def _is_boundary(middle: Point, normal: Point, sides: Iterable[constraint.LinearConstraint], region: Region) -> bool:
    """Whether a point and what is just to both sides of it are not all in the region, nor all outside."""
    step = Fraction(1)
    for side in sides:
        slack, speed = abs(side.constant - side.value(middle)), abs(side.value(normal))
        if slack and speed:
            step = min(step, slack / speed / 2)
    near = [{n: middle[n] + sign * step * normal[n] for n in region.parameters} for sign in (-1, 0, 1)]
    return len({place in region for place in near}) == 2


def _mark_thin(canvas: Axes, slab: Polyhedron, rectangle: Rectangle) -> None:
    """A removed slab too thin to be seen, or without any width, as a line of its own colour."""
    corners = _corners_of(slab)
    if len(corners) < 2:
        return
    scaled = [
        tuple((value - low) / (high - low) for value, (low, high) in zip(corner, rectangle, strict=True))
        for corner in corners
    ]
    ends = max(
        ((a, b) for a in range(len(corners)) for b in range(a)),
        key=lambda pair: sum((x - y) ** 2 for x, y in zip(scaled[pair[0]], scaled[pair[1]], strict=True)),
    )
    (ax, ay), (bx, by) = scaled[ends[0]], scaled[ends[1]]
    length = float((ax - bx) ** 2 + (ay - by) ** 2) ** 0.5
    away = max(abs(float((x - ax) * (by - ay) - (y - ay) * (bx - ax))) for x, y in scaled)
    if length and away / length < float(THIN):
        line = _floats(corners[end] for end in ends)
        canvas.plot(*line, color=style.REMOVED, linewidth=1.2, zorder=5, label="left out: a thin slab")


def _draw_line(
    canvas: Axes,
    region: Region,
    rectangle: Rectangle,
    boxes: Mapping[str, Box | None],
    points: Mapping[str, Point],
    *,
    words: Mapping[str, str] | None = None,
    exact: bool = True,
) -> None:
    """Intervals as bars: the region below, one row for each box; filled ends belong to the set, hollow ones do not."""
    (name,) = region.parameters
    clip = _clip_to(region.parameters, rectangle)
    pieces = (
        Region.union_of((name,), (piece.restricted(clip) for piece in region.as_union().pieces)).simplified().pieces
    )
    area = "valid" if exact else "not known to fail"
    for piece in pieces:
        _bar(canvas, piece, rectangle, 0, EDGE)
    rows = [area]
    for row, (label, box) in enumerate(_labelled(boxes), start=1):
        colour = style.BOX_LINES[(row - 1) % len(style.BOX_LINES)]["color"]
        if box is not None:
            _bar(canvas, Polyhedron((name,), (*_sides((name,), box), *clip)), rectangle, row, colour)
        rows.append(wrapped(label, 34))
    for label, point in points.items():
        canvas.axvline(float(point[name]), color=style.BLACK, linewidth=1, linestyle=":", label=label)
    canvas.plot([], [], "o", color=EDGE, label="end that belongs to it")
    canvas.plot([], [], "o", color=EDGE, markerfacecolor="white", label="end that does not")
    canvas.set_xlim(*map(float, rectangle[0]))
    canvas.set_ylim(-0.6, len(boxes) + 0.6)
    canvas.set_yticks(range(len(rows)), rows, fontsize="small")
    canvas.set_xlabel(wrapped(text.named(name, words), 70))


def _bar(
    canvas: Axes, piece: Polyhedron, rectangle: Rectangle, row: int, colour: str, *, label: str | None = None
) -> None:
    extent = piece.extent(piece.parameters[0])
    if extent is None or extent.lower is None or extent.upper is None:
        return
    canvas.plot([float(extent.lower), float(extent.upper)], [row, row], color=colour, linewidth=5, label=label,
                solid_capstyle="butt")  # fmt: skip
    for end, closed in ((extent.lower, extent.lower_closed), (extent.upper, extent.upper_closed)):
        if end not in rectangle[0]:
            canvas.plot(
                [float(end)], [row], "o", color=colour, markersize=7, markerfacecolor=colour if closed else "white"
            )


# -- regions of plans with choices -------------------------------------------------------------------------------------


def shown_team_axes(plan: ParametricPlan, axes: Sequence[str]) -> tuple[TeamParameter, TeamParameter]:
    """The two parameters that are drawn: those that were asked for, or the first two.

    Raises:
        InputError: if there are not two, or one is unknown.
    """
    names = tuple(axes) or plan.names[:2]
    _require_known(names, plan.names)
    if len(names) != 2 or names[0] == names[1]:
        raise InputError(f"found {plural(len(names), 'parameter')} to draw, expected two", place_of("plot"))
    known = {parameter.name: parameter for parameter in plan.parameters}
    return known[names[0]], known[names[1]]


def plot_team_region(region: LabeledRegion, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw which combinations of choices are possible where."""
    return plot_cells(region, pike_envelopes.cells_of(region), path, axes)


def plot_cells(
    region: LabeledRegion, cells: pike_envelopes.Cells | None, path: Path | None, axes: Sequence[str]
) -> Figure:
    """Draw the same where the cells are known; without them, where each combination is possible."""
    if cells is None:
        parts = [combination for combination in region.combinations if combination.pieces]
        layers = [(guard_text(combination.choices), region.region(dict(combination.choices))) for combination in parts]
    else:
        layers = [(_combinations_text(possible), cell) for possible, cell in cells if possible]
    return _plot_layers(_POSSIBLE, region.plan, layers, path, axes)


def plot_team_envelope(envelope: TeamEnvelope, path: Path | None, axes: Sequence[str]) -> Figure:
    """Draw for which values what is promised is so, and the box.

    Raises:
        InputError: if nothing of that is known.
    """
    if not envelope.combinations:
        raise InputError("found an envelope of which nothing is known, expected something to draw", place_of("plot"))
    box, what = (envelope.box, "Values in the box, and around it") if envelope.verified else (None, _POSSIBLE)
    return _plot_layers(what, envelope.plan, [(pike_envelopes.promise(envelope), envelope.region)], path, axes, box=box)


def _combinations_text(possible: Sequence[Combination]) -> str:
    """The choices of an area for the legend; of many combinations, the first ones."""
    labels = [guard_text(combination.choices) or "any choices" for combination in possible]
    rest = [f"and {len(labels) - _NAMED} more"] if len(labels) > _NAMED else []
    return "\n".join([*(cut(label, 80) for label in labels[:_NAMED]), *rest])


def _plot_layers(
    what: str,
    plan: ParametricPlan,
    layers: Sequence[tuple[str, Region]],
    path: Path | None,
    axes: Sequence[str],
    *,
    box: Box | None = None,
) -> Figure:
    """Draw regions of two parameters, the others at their nominal values, and perhaps a box."""
    shown = shown_team_axes(plan, axes)
    names = tuple(axis.name for axis in shown)
    rest = {name: value for name, value in plan.nominal.items() if name not in names}
    sliced = [(label, Region.union_of(names, region.slice(rest).as_union().pieces)) for label, region in layers]
    fixed = [(parameter.words, parameter.parameter.nominal) for parameter in plan.parameters if parameter not in shown]
    title = _title(what, fixed)
    return save(lambda: _draw_layers(title, shown, sliced, box), path)


def _draw_layers(
    title: str, shown: tuple[TeamParameter, TeamParameter], layers: Sequence[tuple[str, Region]], box: Box | None
) -> Figure:
    lines = sum(label.count("\n") + 1 for label, _ in layers)
    figure = Figure(figsize=(8.4, 4.8 + 0.15 * lines), layout="constrained")
    canvas = figure.add_subplot()
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    names, nominal = tuple(axis.name for axis in shown), {axis.name: axis.parameter.nominal for axis in shown}
    regions, boxes = [region for _, region in layers], [] if box is None else [box]
    ranges = [(_range(regions, axis.name, boxes, [nominal]), axis.parameter.lower) for axis in shown]
    view = tuple((low if least is None else max(low, least), high) for (low, high), least in ranges)
    clip = _clip_to(names, view)
    for number, (label, region) in enumerate(layers):
        look: dict[str, Any] = {
            "facecolor": style.LIGHT[number % len(style.LIGHT)],
            "hatch": style.HATCHES[number % len(style.HATCHES)],
        }
        for piece in region.pieces:
            _fill(canvas, piece.restricted(clip), edgecolor=DARK_GREY, linewidth=0.5, label=label, **look)
    style.hatch_outside(canvas, "no correct execution found")
    for shown_box in boxes:
        _draw_box(canvas, Polyhedron(names, (*_sides(names, shown_box), *clip)), view,
                  {**style.box_line(0, 1), "zorder": 6, "label": "box"})  # fmt: skip
    words, point = [f"{axis.words}: {axis.meaning}" for axis in shown], (nominal[names[0]], nominal[names[1]])
    _finish(canvas, view, words, {"nominal values": point})
    once = style.entries([canvas])
    texts = [wrapped(label, 60) for label in once]
    figure.legend(once.values(), texts, loc="outside lower center", fontsize="small", frameon=False, ncols=2)
    return figure
