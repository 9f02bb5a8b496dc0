"""Pages for a browser, one file each, which load nothing: that of a comparison, and the table of a batch.

The page of a comparison has sliders for parameters, the verdict there, a slice of the envelope and a Gantt chart.
Python writes what is known, exactly: the region's polyhedra, the boxes, the network, and where each obligation breaks.
The page decides every point by itself, with fractions (`web/exact.js`); nothing in it is a grid or rounded.

The table of a batch is sorted by its headings, and readable without scripts. Names from files cannot break a page.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from html import escape
from math import ceil
from string import Template
from typing import Any

from robust.draw.style import LIGHT, STRONG, part, script_json
from robust.irr.compare import Comparison
from robust.plan.model import ZERO, Bound, Parameter, ParameterReference, ParametrizedPlan
from robust.qe.box import Box
from robust.qe.compute import Breaks
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import Status
from robust.show import console, regions
from robust.show.batch import NAMES, answer_lines, ratio, summary_lines
from robust.show.text import Words
from robust.sweeps.batch import Batch, BatchRow, PlanRun


def self_contained(
    title: str, body: str, *, scripts: Sequence[str] = (), data: Mapping[str, Any] | None = None, connects: bool = False
) -> str:
    """A whole page.

    Args:
        title: as text.
        body: as HTML, in which names from files are escaped.
        scripts: files of `robust/draw/web`, in the order in which they are run.
        data: what the scripts read from the element `data`, as JSON.
        connects: whether the scripts ask the server that the page comes from.
    """
    parts = [] if data is None else [f'<script type="application/json" id="data">{script_json(data)}</script>']
    parts += [f"<script>\n{part(name)}</script>" for name in scripts]
    return Template(part("page.html")).substitute(
        title=escape(title),
        style=_palette() + part("page.css"),
        body=body,
        scripts="\n".join(parts),
        connects="; connect-src 'self'" if connects else "",
    )


def _palette() -> str:
    """The colours of all pictures as variables."""
    named = [f"--strong-{at}:{colour}" for at, colour in enumerate(STRONG)]
    named += [f"--light-{at}:{colour}" for at, colour in enumerate(LIGHT)]
    return f":root{{{';'.join(named)}}}\n"


# -- a table of many plans ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell: what is shown, by what it is sorted (a number, or its text), and lines to be unfolded."""

    text: str
    order: float | None = None
    more: Sequence[str] = ()
    kind: str = ""

    @property
    def html(self) -> str:
        order = "" if self.order is None else f' data-order="{self.order!r}"'
        kind = f' class="{self.kind}"' if self.kind else ""
        shown = escape(self.text)
        if self.more:
            lines = escape("\n".join(self.more))
            shown = f"<details><summary>{shown}</summary><pre>{lines}</pre></details>"
        return f"<td{order}{kind}>{shown}</td>"


_COLOURS = {"green": "good", "bold red": "bad"}
_NOTHING = Cell("–", -1.0)
"""Before all numbers."""


def batch_page(batch: Batch) -> str:
    """The page of a batch."""
    head = ["plan"]
    for asked in batch.asked:
        before = f"{NAMES[asked.name]}: " if batch.verb == "compare" else ""
        head += [f"{before}{word}" for word in ("answer", "seconds", "what it says")]
    head += ["volume IRR/CCMMZ", "width IRR/CCMMZ"] if batch.verb == "compare" else []
    headings = "".join(f'<th scope="col"><button type="button">{escape(cell)}</button></th>' for cell in head)
    rows = "\n".join(f"<tr>{''.join(cell.html for cell in _cells(batch, row))}</tr>" for row in batch.plans)
    summary = "".join(f"<li>{escape(line)}</li>" for line in summary_lines(batch))
    title = f"robust batch {batch.verb}"
    body = f"""<header><h1>{escape(title)}</h1><p>{escape(batch.suite)}</p></header>
<ul>{summary}</ul>
<table class="sorted"><thead><tr>{headings}</tr></thead>
<tbody>
{rows}
</tbody></table>"""
    return self_contained(title, body, scripts=["batch.js"])


def _cells(batch: Batch, row: BatchRow) -> list[Cell]:
    instance = row.instance
    cells = [Cell(instance.name, more=[instance.domain, instance.problem, instance.plan])]
    for asked in batch.asked:
        cells += _answer(row.runs.get(asked.name))
    if batch.verb == "compare":
        cells += [_share(row.volume_ratio), _share(row.width_ratio)]
    return cells


def _share(share: Fraction | None) -> Cell:
    return _NOTHING if share is None else Cell(ratio(share), float(share), [str(share)], "number")


def _answer(run: PlanRun | None) -> list[Cell]:
    if run is None:
        return [_NOTHING] * 3
    lines = answer_lines(run)
    said = Cell(lines[0], more=lines) if len(lines) > 1 else Cell("".join(lines))
    kind = _COLOURS.get(console.colour_of(run.status), "open")
    return [Cell(run.status, kind=kind), Cell(f"{run.seconds:.2f}", run.seconds, kind="number"), said]


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
    body = (
        part("compare.html")
        .replace("{{title}}", escape(title))
        .replace("{{details}}", regions.comparison_details(result))
    )
    data = comparison_data(result, breaks, words)
    return self_contained(title, body, scripts=("exact.js", "compare.js"), data=data)


def shown_region(result: Comparison) -> tuple[Region | None, str]:
    """The region that a page can decide with; else why there is none, as a sentence."""
    if result.region is None:
        why = _ENDED[Status.INTERRUPTED if result.interrupted else Status.TIMEOUT]
    elif not result.region.is_exact:
        why = _ENDED[result.region.status]
    else:
        region = regions.in_form(result.region.region, None)
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
    for constraint in plan.constraints:
        concerned = {point.instance for point in (constraint.source, constraint.target) if point.instance is not None}
        bounds = [bound for bound in (constraint.lower, constraint.upper) if bound is not None]
        if len(concerned) == 1 and not all(bound.is_constant for bound in bounds):
            varying |= concerned
    shown = breaks if region is not None else None
    return {
        "parameters": [
            {
                "name": parameter.name,
                "words": words.parameters[parameter.name],
                "nominal": str(parameter.nominal),
                "lower": _text(parameter.lower),
                "upper": _text(parameter.upper),
                **_slider(parameter, region, list(boxes.values())),
            }
            for parameter in plan.parameters
        ],
        "region": None if region is None else _region(region),
        "missing": why,
        "boxes": [
            {"method": regions.METHOD_NAMES[method], "intervals": _intervals(box)} for method, box in boxes.items()
        ],
        "points": len(points),
        "network": list(_network(plan, words)),
        "actions": [
            {
                "id": instance.identifier,
                "words": words.actions[instance.identifier],
                "start": points[instance.start],
                "end": points[instance.end],
                "varies": instance.identifier in varying,
            }
            for instance in plan.instances
        ],
        "obligations": [
            {
                "words": words.obligation(obligation.obligation),
                "name": obligation.obligation,
                "actions": list(words.concerned(obligation.obligation)),
                "demand": obligation.demand,
                "pieces": [_constraints(piece) for piece in obligation.pieces],
            }
            for obligation in (shown.obligations if shown is not None else ())
        ],
        "complete": shown is not None and shown.complete,
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
    ends = ((name, asdict(interval)) for name, interval in box.intervals.items())
    return {name: {**end, "lower": _text(end["lower"]), "upper": _text(end["upper"])} for name, end in ends}


def _network(plan: ParametrizedPlan, words: Words) -> Iterator[dict[str, Any]]:
    """Statements about the time between two time points, by their numbers."""
    number = {point: index for index, point in enumerate(plan.time_points)}
    for constraint in plan.constraints:
        yield {
            "source": number[constraint.source],
            "target": number[constraint.target],
            "lower": _bound(constraint.lower),
            "upper": _bound(constraint.upper),
            "words": words.statement(constraint),
        }
    for time in sorted({literal.time for literal in plan.timed_literals}):
        at = {"constant": str(time), "coefficients": {}}
        point = next(point for point in plan.time_points if point.time == time)
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
