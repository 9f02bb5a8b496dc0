"""The page of a comparison: sliders for parameters, the verdict there, a slice of the envelope, a Gantt chart.

Python writes what is known, exactly: the region's polyhedra, the boxes, the network, and where each obligation breaks.
The page decides every point by itself, with fractions (`web/exact.js`); nothing in it is a grid or rounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from html import escape
from math import ceil
from typing import Any

from robust.draw.pages import part, self_contained
from robust.irr.compare import Comparison
from robust.plan.model import ZERO, Bound, Parameter, ParameterReference, ParametrizedPlan
from robust.qe.box import Box
from robust.qe.broken import Breaks
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import Status
from robust.show.regions import METHOD_NAMES, comparison_details, in_form
from robust.show.words import Words

MOST = 600
"""Polyhedra of a region up to which it is put into a page."""
_STEPS = 200
"""Of a slider, at least."""
_ENDED = {
    Status.TIMEOUT: "the time limit ended its computation",
    Status.INTERRUPTED: "an interruption ended its computation",
    Status.UNKNOWN: "a solver failed in its computation",
}


def comparison_page(result: Comparison, breaks: Breaks | None, *, name: str, epsilon: Fraction) -> str:
    """One file of HTML.

    Args:
        result: what is shown.
        breaks: where each obligation breaks; None where that was not asked, or the region is not in the page.
        name: of the plan, for the title.
        epsilon: the separation of mutex time points, for words.
    """
    words = Words(result.plan, epsilon)
    title = f"How far may “{name}” deviate?"
    body = part("compare.html").replace("{{title}}", escape(title)).replace("{{details}}", comparison_details(result))
    data = comparison_data(result, breaks, words)
    return self_contained(title, body, scripts=("exact.js", "compare.js"), data=data)


def shown_region(result: Comparison) -> tuple[Region | None, str]:
    """The region that a page can decide with; else why there is none, as a sentence."""
    if result.region is None:
        why = _ENDED[Status.INTERRUPTED if result.interrupted else Status.TIMEOUT]
    elif not result.region.is_exact:
        why = _ENDED[result.region.status]
    else:
        region = in_form(result.region.region, None)
        if len(region.pieces) <= MOST:
            return region, ""
        why = f"it takes {len(region.pieces)} polyhedra"
    return None, f"The exact envelope is not in this page: {why}. A point is known to be valid only in a box."


# -- the document ------------------------------------------------------------------------------------------------------


def comparison_data(result: Comparison, breaks: Breaks | None, words: Words) -> dict[str, Any]:
    """What the page's scripts read: numbers as texts of exact fractions."""
    plan = result.plan
    region, why = shown_region(result)
    boxes = {entry.method: entry.result.box for entry in result.entries if entry.result.verified}
    points = {point: number for number, point in enumerate(plan.time_points)}
    varying: set[str] = set()
    for one in plan.constraints:
        concerned = {point.instance for point in (one.source, one.target) if point.instance is not None}
        if len(concerned) == 1 and not all(bound is None or bound.is_constant for bound in (one.lower, one.upper)):
            varying |= concerned
    found = breaks if region is not None else None
    return {
        "parameters": [
            {
                "name": one.name,
                "words": words.parameters[one.name],
                "nominal": str(one.nominal),
                "lower": _text(one.lower),
                "upper": _text(one.upper),
                **_slider(one, region, list(boxes.values())),
            }
            for one in plan.parameters
        ],
        "region": None if region is None else _region(region),
        "missing": why,
        "boxes": [{"method": METHOD_NAMES[method], "intervals": _intervals(box)} for method, box in boxes.items()],
        "points": len(points),
        "network": list(_network(plan, words)),
        "actions": [
            {
                "id": one.identifier,
                "words": words.actions[one.identifier],
                "start": points[one.start],
                "end": points[one.end],
                "varies": one.identifier in varying,
            }
            for one in plan.instances
        ],
        "obligations": [
            {
                "words": words.obligation(one.obligation),
                "name": one.obligation,
                "actions": list(words.concerned(one.obligation)),
                "demand": one.demand,
                "pieces": [_constraints(piece) for piece in one.pieces],
            }
            for one in (found.found if found is not None else ())
        ],
        "complete": found is not None and found.complete,
    }


def _text(value: Fraction | None) -> str | None:
    return None if value is None else str(value)


def _constraints(piece: Polyhedron) -> list[dict[str, Any]]:
    return [constraint.as_dict() for constraint in piece.constraints]


def _region(region: Region) -> dict[str, Any]:
    return {
        "base": None if region.base is None else _constraints(region.base),
        "pieces": [_constraints(piece) for piece in region.pieces],
    }


def _intervals(box: Box) -> dict[str, Any]:
    return {
        name: {
            "lower": _text(one.lower),
            "upper": _text(one.upper),
            "lower_closed": one.lower_closed,
            "upper_closed": one.upper_closed,
        }
        for name, one in box.intervals.items()
    }


def _network(plan: ParametrizedPlan, words: Words) -> Iterator[dict[str, Any]]:
    """Statements about the time between two time points, by their numbers."""
    number = {point: index for index, point in enumerate(plan.time_points)}
    for one in plan.constraints:
        yield {
            "source": number[one.source],
            "target": number[one.target],
            "lower": _bound(one.lower),
            "upper": _bound(one.upper),
            "words": words.statement(one),
        }
    for time in sorted({literal.time for literal in plan.timed_literals}):
        at = {"constant": str(time), "coefficients": {}}
        point = next(one for one in plan.time_points if one.time == time)
        yield {"source": number[ZERO], "target": number[point], "lower": at, "upper": at, "words": words.point(point)}


def _bound(bound: Bound | None) -> dict[str, Any] | None:
    """A bound, which is linear wherever there is an envelope."""
    if bound is None:
        return None
    named = (
        (unknown.name, factor) for unknown, factor in bound.coefficients() if isinstance(unknown, ParameterReference)
    )
    return {"constant": str(bound.constant_term), "coefficients": {name: str(factor) for name, factor in named}}


# -- sliders -----------------------------------------------------------------------------------------------------------


def _slider(parameter: Parameter, region: Region | None, boxes: list[Box]) -> dict[str, Any]:
    """The first value of a slider, the step and how many: around all that ends there, through the nominal value."""
    low, high = _range(parameter, region, boxes)
    step = _round_step((high - low) / _STEPS)
    below = ceil((parameter.nominal - low) / step)
    above = ceil((high - parameter.nominal) / step)
    return {"first": str(parameter.nominal - below * step), "step": str(step), "steps": below + above}


def _range(parameter: Parameter, region: Region | None, boxes: list[Box]) -> tuple[Fraction, Fraction]:
    """From the least to the greatest value at which something ends, and a margin."""
    name = parameter.name
    ends = [parameter.nominal, parameter.lower, parameter.upper]
    ends += [end for box in boxes for end in (box[name].lower, box[name].upper)]
    for piece in () if region is None else (region.base,) if region.base is not None else region.pieces:
        extent = piece.extent(name)
        ends += () if extent is None else (extent.lower, extent.upper)
    known = [end for end in ends if end is not None]
    low, high = min(known), max(known)
    margin = (high - low) * Fraction(3, 20) or max(abs(low) / 4, Fraction(1))
    return low - margin, high + margin


def _round_step(most: Fraction) -> Fraction:
    """The greatest of 1, 2 and 5 times a power of ten that is not above a value > 0."""
    power = Fraction(1)
    while power > most:
        power /= 10
    while power * 10 <= most:
        power *= 10
    return max(power * factor for factor in (1, 2, 5) if power * factor <= most)
