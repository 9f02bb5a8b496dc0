"""Exact regions, alone and beside boxes: as sentences and inequalities, pictures, and a page of HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from robust.irr.compare import Comparison, Entry, FaceGap, RatioBounds
from robust.numbers import duration, readable
from robust.qe.box import Side, interval_text
from robust.qe.compute import RegionResult
from robust.qe.constraint import Sense
from robust.qe.inner import EnvelopeFactor
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, absorb
from robust.qe.render import signed_sum
from robust.searching import Status
from robust.show.console import show_table, table
from robust.show.text import percentage, print_advice, stopped

if TYPE_CHECKING:
    pass

MANY = 20
"""Pieces up to which a region is shown as a union by default."""
NOTHING_EXCLUDED = "No parameter values are known by now for which the plan can fail."
"""Of an outer bound that bounds nothing."""
HUGE = 300
"""Pieces up to which those that others contain are left out of a difference."""


# -- forms -----------------------------------------------------------------------------------------------------------


def in_form(region: Region, form: str | None) -> Region:
    """The region simplified, as a `union` or a `difference`; None: a union if that takes no more than a few pieces."""
    match form:
        case "union":
            return region.as_union().simplified()
        case "difference":
            return tidied(region.as_difference())
        case _:
            return region.short_union(MANY) or tidied(region)


def formed(result: RegionResult, form: str | None = None) -> RegionResult:
    """A result with its region in that form."""
    return replace(result, region=in_form(result.region, form))


def tidied(region: Region) -> Region:
    """The region simplified; of many pieces only those that others contain are left out, and of very many none."""
    if len(region.pieces) <= MANY or region.base is None:
        return region.simplified()
    return region if len(region.pieces) > HUGE else Region.difference(region.base, absorb(region.pieces))


# -- output ----------------------------------------------------------------------------------------------------------


def print_latex(out: Console, result: RegionResult) -> None:
    """A formula; what it is, if not the envelope, in a comment."""
    if not result.is_exact:
        out.print(Text(f"% {stopped(result.status, result.reason)}: {result.meaning}"), soft_wrap=True, no_wrap=True)
    out.print(Text(result.region.to_latex()), soft_wrap=True, no_wrap=True)


def print_formed(out: Console, result: RegionResult, *, quiet: bool) -> None:
    """A region as it was found, in the form in which it is shown."""
    print_region(out, formed(result), quiet=quiet)


def print_region(out: Console, result: RegionResult, *, quiet: bool) -> None:
    """Inequalities, and what they mean; unless `quiet` also how they were found."""
    ordered = result.is_exact and len(result.region.pieces) > MANY and any(one.symmetry for one in result.factors)
    exact = result.is_exact
    lines = _ordered_lines(result.factors) if ordered else region_lines(result.region, exact=exact)
    for line in lines:
        out.print(Text(line), soft_wrap=True)
    for line in () if exact else _inner_lines(result):
        out.print(Text(line), soft_wrap=True)
    if not quiet:
        out.print()
    if not exact:
        why = stopped(result.status, result.reason)
        text = f"{why}: an outer bound of the envelope; outside the plan can fail, inside it may"
        out.print(Text(text, style="yellow"), soft_wrap=True)
        out.print(Text(_open_text(result), style="yellow"), soft_wrap=True)
    if not quiet:
        out.print(_summary(result), soft_wrap=True)


def _ordered_lines(factors: Sequence[EnvelopeFactor]) -> Iterator[str]:
    """The region up to permutations of parameters, for each group of them; all have to hold."""
    for index, one in enumerate(factors):
        yield from ("",) if index else ()
        yield from _ordering(one)
        yield from region_lines(in_form(one.outer, None), exact=True)


def _ordering(factor: EnvelopeFactor) -> Iterator[str]:
    for names in factor.symmetry.classes:
        yield f"In ascending order of {', '.join(names)}, which are interchangeable:"


def _inner_lines(result: RegionResult) -> Iterator[str]:
    """What is proved, group by group of parameters, or nothing."""
    if not any(one.inner.pieces or one.inner.base is not None for one in result.factors):
        return
    for one in result.factors:
        yield ""
        yield from _ordering(one)
        among = f" as to {', '.join(one.parameters)}" if len(result.factors) > 1 else ""
        if one.inner.base is not None:
            yield from region_lines(in_form(one.inner, None), exact=True)
            continue
        yield f"The plan is certain to be valid{among} if all lines of one of these groups hold"
        for index, piece in enumerate(one.inner.pieces, start=1):
            yield f"  {index}."
            yield from (f"     {line}" for line in polyhedron_lines(piece) or ["no condition"])


def _open_text(result: RegionResult) -> str:
    """How much lies between both bounds."""
    cells = sum(len(one.inner.pieces) for one in result.factors)
    proved = f"proved valid: {_polyhedra(cells)}"
    share = result.open_share
    if share is None:
        return proved
    ends = f"{_percent(share.value)}"
    if share.confidence is not None:
        between = f"{_percent(share.lower)} to {_percent(share.upper)}"
        ends = f"about {ends} ({between} with confidence {_percent(share.confidence)}, {share.points} random points)"
    box = ", ".join(f"{name} ∈ {interval_text(one)}" for name, one in share.box.intervals.items())
    return f"{proved}; open: {ends} of {box}"


def _summary(result: RegionResult) -> Text:
    text = Text()
    if result.is_exact:
        text.append("complete", style="green")
        text.append(": the exact envelope; ")
    text.append(f"{_polyhedra(result.pieces)} of bad values, {result.backend}, {duration(result.seconds)}.")
    return text


def _polyhedra(count: int) -> str:
    return "1 polyhedron" if count == 1 else f"{count} polyhedra"


def region_lines(region: Region, *, exact: bool) -> Iterator[str]:
    """The region as sentences over lines of inequalities."""
    valid = "The plan is valid if and only if" if exact else "The plan can be valid only if"
    region = region if region.base is None or region.pieces else Region.union_of(region.parameters, (region.base,))
    if not region.parameters:
        if region.some_point() is None:
            yield "The plan is not valid; it has no parameters."
        else:
            yield f"{'The plan is valid' if exact else 'Whether the plan is valid is not known'}; it has no parameters."
        return
    if region.base is None and not region.pieces:
        yield "The plan is valid for no parameter values."
        return
    if region.base is None and len(region.pieces) == 1:
        lines = polyhedron_lines(region.pieces[0])
        if lines:
            yield valid
            yield from (f"  {line}" for line in lines)
        elif exact:
            yield "The plan is valid for all parameter values."
        else:
            yield NOTHING_EXCLUDED
        return
    if region.base is None:
        yield f"{valid} all lines of one of these {len(region.pieces)} groups hold"
    else:
        yield valid
        yield from (f"  {line}" for line in polyhedron_lines(region.base) or ["(no condition)"])
        yield f"and not all lines of {'this group' if len(region.pieces) == 1 else 'one of these groups'} hold"
    for index, piece in enumerate(region.pieces, start=1):
        yield f"  {index}."
        yield from (f"     {line}" for line in polyhedron_lines(piece) or ["no condition"])


def polyhedron_lines(piece: Polyhedron) -> list[str]:
    """One line for each linear form: `2 ≤ a + b < 5`."""
    lower: dict[str, str] = {}
    upper: dict[str, str] = {}
    for constraint in piece.constraints:
        if not constraint.coefficients:
            if constraint.is_false:
                return ["0 = 1"]
            continue
        terms, sign, constant = constraint.oriented()
        form, number = signed_sum(terms, "−", readable), readable(constant)
        if constraint.relation is Sense.EQUAL:
            upper[form], lower[form] = f" = {number}", ""
        elif sign in "≤<":
            lower.setdefault(form, "")
            upper[form] = f" {sign} {number}"
        else:
            lower[form] = f"{number} {'≤' if sign == '≥' else '<'} "
    return [_line(form, before, upper.get(form, "")) for form, before in lower.items()]


def _line(form: str, before: str, after: str) -> str:
    if before and not after:
        number, sign = before.split()
        return f"{form} {'≥' if sign == '≤' else '>'} {number}"
    return f"{before}{form}{after}"


# -- comparisons -----------------------------------------------------------------------------------------------------

METHOD_NAMES = {
    "irr": "IRR",
    "widen": "widening",
    "optimal": "optimal",
    "optimal-nominal": "optimal around the nominal values",
}

Row = tuple[str, ...]
_BOXES = ("method", "status", "volume", "total width", "time")
_FACES = ("method", "face", "gap", "breaks just outside", "at")


def box_rows(result: Comparison) -> list[Row]:
    """One row for each method."""
    return [
        (
            METHOD_NAMES[entry.method],
            entry.result.status.value,
            _share(entry.volume_share),
            _share(entry.width_share),
            duration(entry.result.seconds),
        )
        for entry in result.entries
    ]


def face_rows(result: Comparison) -> list[Row]:
    """One row for each finite face of each box."""
    parameters = {one.name: one for one in result.plan.parameters}
    return [
        (METHOD_NAMES[entry.method], *_face_cells(face, parameters[face.parameter].percent(face.end)))
        for entry in result.entries
        for face in entry.faces
    ]


def _face_cells(face: FaceGap, percent: Fraction | None) -> Row:
    signs = "<≤" if face.side is Side.UPPER else ">≥"
    sign = signs[face.closed]
    witness = face.witness
    point = "" if witness is None else ", ".join(f"{name} = {readable(v)}" for name, v in witness.values.items())
    gap = "∞" if face.gap is None else readable(face.gap)
    end = f"{readable(face.end)}{'' if percent is None else f' ({percentage(percent)})'}"
    return f"{face.parameter} {sign} {end}", gap, witness.obligation if witness else "", point


def _share(share: RatioBounds | None) -> str:
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
    show_table(out, table(_BOXES, box_rows(result), right=_BOXES[2:]))
    for entry in result.entries:
        out.print()
        out.print(Text(f"{METHOD_NAMES[entry.method]}: {_box_text(entry)}"), soft_wrap=True)
    if quiet:
        return
    rows = face_rows(result)
    if rows:
        out.print()
        show_table(out, table(_FACES, rows, right=("gap",)))
    print_advice(out, dict.fromkeys(one for entry in result.entries for one in entry.result.advice))
    out.print()
    out.print(Text(_compare_summary(result)), soft_wrap=True)


def _box_text(entry: Entry) -> str:
    if not entry.result.verified:
        return entry.result.reason or "no box is known"
    box = entry.result.box.intervals.items()
    return ", ".join(f"{name} ∈ {interval_text(interval)}" for name, interval in box) or "no parameters"


def _compare_summary(result: Comparison) -> str:
    words = {
        Status.COMPLETE: "complete: shares are of the exact envelope, and of its bounding box",
        Status.INVALID: "the plan can fail at the nominal values",
        Status.TIMEOUT: "out of time: gaps are at most those shown, shares at least",
        Status.INTERRUPTED: "interrupted: what was known by then",
        Status.UNKNOWN: "a solver failed: gaps are at most those shown, shares at least",
    }
    region = "" if result.region is None else f"; region {duration(result.region.seconds)}"
    return f"{words[result.status]}{region}, {duration(result.seconds)} in all."


def comparison_details(result: Comparison) -> str:
    """The inequalities and all tables as HTML."""
    lines = ["not computed"]
    if result.region is not None:
        lines = list(region_lines(in_form(result.region.region, None), exact=result.region.is_exact))
    ends = (f"{METHOD_NAMES[entry.method]}: {_box_text(entry)}" for entry in result.entries)
    inequalities = escape("\n".join(lines))
    return (
        f"<p>{escape(_compare_summary(result))}</p><h2>Exact envelope</h2><pre>{inequalities}</pre>"
        f"<h2>Boxes</h2>{_html_table(_BOXES, box_rows(result))}"
        f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in ends)}</ul>"
        f"<h2>What stops each face</h2>{_html_table(_FACES, face_rows(result))}"
    )


def _html_table(head: Row, rows: list[Row]) -> str:
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><tr>{cells}</tr>{body}</table>"
