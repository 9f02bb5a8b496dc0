"""`robust compare`: one report over one plan, as text, JSON and one HTML file."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from fractions import Fraction
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from rich.console import Console
from rich.text import Text

from robust.errors import InputError, Location
from robust.irr.box import Side, Status
from robust.irr.compare import Comparing, Comparison, Entry, FaceGap, Share, Witness
from robust.plan.model import ParametrizedPlan
from robust.report import options
from robust.report.guard import Cause, GivenUpError, Guard
from robust.report.numbers import duration, exact_end, interval_text, readable
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.report.regions import in_form, plot_slice, region_lines, shown_axes
from robust.report.terminal import console, show_table, table_of

_CODES = {Status.COMPLETE: 0, Status.INVALID: 1, Status.TIMEOUT: 3, Status.INTERRUPTED: 3}
_NAMES = {
    "irr": "IRR",
    "widen": "widening",
    "optimal": "optimal",
    "optimal-nominal": "optimal around the nominal values",
}


@dataclass(frozen=True)
class CompareRequest:
    """The options as they were typed."""

    files: tuple[Path, Path, Path]
    beta: str = "1"
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    epsilon: str = "1/1000"
    encoding: str = "relational"
    solver: str = "z3"
    timeout: str | None = None
    plot: Path | None = None
    axes: str | None = None
    html: Path | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


def run_compare(request: CompareRequest, guard: Guard) -> int:
    """Compare and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted while files were being read.
    """
    with Display(shown=request.progress, what="reading") as display:
        beta = options.positive(request.beta, "--beta")
        epsilon = options.not_negative(request.epsilon, "--epsilon")
        limit = options.seconds(request.timeout, "--timeout")
        axes = options.names(request.axes, "--axes")
        plot, html = options.plot_file(request.plot), _html_file(request.html)
        comparing: Comparing | None = None

        def on_stuck() -> bool:
            display.stop()
            if comparing is not None:
                _print(comparing.so_far(), request)
            return comparing is not None

        try:
            with guard.working(limit, on_stuck):
                from robust.plan.load import load_plan  # noqa: PLC0415 - imports the grammar

                plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
                if plot is not None:
                    shown_axes(plan, axes)
                comparing = Comparing(
                    plan,
                    beta=beta,
                    epsilon=epsilon,
                    encoding=request.encoding,
                    solver=request.solver,
                    timeout=guard.remaining(limit),
                    on_stage=display.say,
                )
                result = comparing.run()
        except KeyboardInterrupt:
            if comparing is None:
                raise GivenUpError from None
            result = comparing.so_far()
    _print(result, request)
    if plot is not None and result.region is not None:
        _plot(result, plot, axes)
    if html is not None:
        _write(html, html_report(result, axes))
    if result.status is Status.INTERRUPTED and guard.cause is Cause.TIMEOUT:
        return _CODES[Status.TIMEOUT]
    return _CODES[result.status]


def _html_file(path: Path | None) -> Path | None:
    if path is not None and not path.parent.is_dir():
        raise InputError(f"found no directory {str(path.parent)!r}, expected one to write to", Location("--html"))
    return path


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {error.strerror}", Location("--html")) from None


def _print(result: Comparison, request: CompareRequest) -> None:
    if request.json:
        print_json(compare_answer(result))
        return
    with answering():
        print_comparison(console(), result, quiet=request.quiet)


# -- JSON ------------------------------------------------------------------------------------------------------------


def compare_answer(result: Comparison) -> dict[str, Any]:
    """`robust/compare/1`."""
    region = result.region
    return {
        "schema": "robust/compare/1",
        "status": result.status.value,
        "beta": str(result.beta),
        "parameters": {parameter.name: str(parameter.nominal) for parameter in result.plan.parameters},
        "region": None
        if region is None
        else {"status": region.status.value, "meaning": region.meaning, "pieces": region.pieces,
              "seconds": round(region.seconds, 6),
              "volume": None if result.volume is None else
              {"lower": str(result.volume.lower), "upper": exact_end(result.volume.upper, upper=True)}},
        "boxes": [_entry_answer(entry) for entry in result.entries],
        "seconds": round(result.seconds, 6),
    }  # fmt: skip


def _entry_answer(entry: Entry) -> dict[str, Any]:
    result = entry.result
    return {
        "method": entry.method,
        "status": result.status.value,
        "verified": result.verified,
        "reason": result.reason,
        "box": {
            name: {
                "lower": exact_end(interval.lower, upper=False),
                "upper": exact_end(interval.upper, upper=True),
                "lower_closed": interval.lower is not None and interval.lower_closed,
                "upper_closed": interval.upper is not None and interval.upper_closed,
            }
            for name, interval in result.box.intervals.items()
        },
        "volume_ratio": _share_answer(entry.volume_share),
        "width_ratio": _share_answer(entry.width_share),
        "faces": [
            {
                "parameter": face.parameter,
                "side": face.side.value,
                "end": str(face.end),
                "closed": face.closed,
                "gap": exact_end(face.gap, upper=True),
                "witness": None if face.witness is None else _witness_answer(face.witness),
            }
            for face in entry.faces
        ],
        "seconds": round(result.seconds, 6),
    }


def _share_answer(share: Share | None) -> dict[str, Any] | None:
    if share is None:
        return None
    return {"lower": str(share.lower), "upper": None if share.upper is None else str(share.upper)}


def _witness_answer(witness: Witness) -> dict[str, Any]:
    return {"parameters": {n: str(v) for n, v in witness.values.items()}, "obligation": witness.obligation}


# -- text ------------------------------------------------------------------------------------------------------------

Row = tuple[str, ...]
_BOXES = ("method", "status", "volume", "total width", "time")
_FACES = ("method", "face", "gap", "breaks just outside", "at")


def box_rows(result: Comparison) -> list[Row]:
    """One row for each method."""
    return [
        (
            _NAMES[entry.method],
            entry.result.status.value,
            _share(entry.volume_share),
            _share(entry.width_share),
            duration(entry.result.seconds),
        )
        for entry in result.entries
    ]


def face_rows(result: Comparison) -> list[Row]:
    """One row for each finite face of each box."""
    return [(_NAMES[entry.method], *_face_cells(face)) for entry in result.entries for face in entry.faces]


def _face_cells(face: FaceGap) -> Row:
    signs = "<≤" if face.side is Side.UPPER else ">≥"
    sign = signs[face.closed]
    witness = face.witness
    point = "" if witness is None else ", ".join(f"{name} = {readable(v)}" for name, v in witness.values.items())
    gap = "∞" if face.gap is None else readable(face.gap)
    return f"{face.parameter} {sign} {readable(face.end)}", gap, witness.obligation if witness else "", point


def _share(share: Share | None) -> str:
    if share is None:
        return "–"
    if share.is_exact:
        return _percent(share.lower)
    if share.upper is None:
        return f"at least {_percent(share.lower)}"
    return f"{_percent(share.lower)} to {_percent(share.upper)}"


def _percent(value: Fraction) -> str:
    return f"{float(value * 100):.1f} %"


def print_comparison(out: Console, result: Comparison, *, quiet: bool) -> None:
    """The region, the boxes, and unless `quiet` what stops each face."""
    if result.region is not None:
        for line in region_lines(in_form(result.region.region, None), exact=result.region.is_exact):
            out.print(Text(line), soft_wrap=True)
        out.print()
    boxes = table_of(_BOXES, box_rows(result), right=_BOXES[2:])
    show_table(out, boxes)
    for entry in result.entries:
        out.print()
        out.print(Text(f"{_NAMES[entry.method]}: {_box_text(entry)}"), soft_wrap=True)
    if quiet:
        return
    rows = face_rows(result)
    if rows:
        out.print()
        show_table(out, table_of(_FACES, rows, right=("gap",)))
    out.print()
    out.print(Text(_summary(result)), soft_wrap=True)


def _box_text(entry: Entry) -> str:
    if not entry.result.verified:
        return entry.result.reason or "no box is known"
    box = entry.result.box.intervals.items()
    return ", ".join(f"{name} ∈ {interval_text(interval)}" for name, interval in box) or "no parameters"


def _summary(result: Comparison) -> str:
    words = {
        Status.COMPLETE: "complete: shares are of the exact envelope, and of its bounding box",
        Status.INVALID: "the plan can fail at the nominal values",
        Status.TIMEOUT: "out of time: gaps are at most those shown, shares at least",
        Status.INTERRUPTED: "interrupted: what was known by then",
    }
    region = "" if result.region is None else f"; region {duration(result.region.seconds)}"
    return f"{words[result.status]}{region}, {duration(result.seconds)} in all."


# -- drawing and HTML ------------------------------------------------------------------------------------------------


def _plot(result: Comparison, path: Path, axes: tuple[str, ...]) -> None:
    if result.region is None:
        return
    boxes = {_NAMES[entry.method]: entry.result.box for entry in result.entries if entry.result.verified}
    plot_slice(result.region.region, result.plan, path, axes, boxes=boxes)


_PAGE = Template("""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
<style>body{font:15px/1.45 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse}
th,td{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:left}pre{background:#f6f6f6;padding:.8em}
svg{max-width:100%;height:auto}</style></head><body>
<h1>$title</h1><p>$summary</p><h2>Exact envelope</h2><pre>$region</pre>$figure
<h2>Boxes</h2>$boxes<ul>$ends</ul><h2>What stops each face</h2>$faces</body></html>
""")


def html_report(result: Comparison, axes: tuple[str, ...] = ()) -> str:
    """One static page with the drawing in it."""
    lines = ["not computed"]
    if result.region is not None:
        lines = list(region_lines(in_form(result.region.region, None), exact=result.region.is_exact))
    ends = (f"{_NAMES[entry.method]}: {_box_text(entry)}" for entry in result.entries)
    return _PAGE.substitute(
        title=escape(f"Envelopes of {_title(result.plan)}"),
        summary=escape(_summary(result)),
        region=escape("\n".join(lines)),
        figure=_figure(result, axes),
        boxes=_html_table(_BOXES, box_rows(result)),
        ends="".join(f"<li>{escape(text)}</li>" for text in ends),
        faces=_html_table(_FACES, face_rows(result)),
    )


def _title(plan: ParametrizedPlan) -> str:
    return ", ".join(parameter.name for parameter in plan.parameters) or "a plan without parameters"


def _figure(result: Comparison, axes: tuple[str, ...]) -> str:
    if result.region is None or not result.plan.parameters:
        return ""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "figure.svg"
        _plot(result, path, axes)
        svg = path.read_text(encoding="utf-8")
    return svg[svg.index("<svg") :]


def _html_table(head: Row, rows: list[Row]) -> str:
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><tr>{cells}</tr>{body}</table>"
