"""Regions and boxes for people: inequalities, how far parameters may deviate, what ends that, and how it was found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from html import escape
from itertools import islice
from typing import TYPE_CHECKING

from robust.irr.check import Counterexample
from robust.irr.compare import Comparison, Entry, FaceGap, RatioBounds
from robust.irr.search import EnvelopeResult
from robust.numbers import duration, end, plural, readable
from robust.plan.model import Parameter
from robust.qe import inner, lifted
from robust.qe.box import Box, Interval, Side, interval_text
from robust.qe.compute import RegionResult
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region, absorb, signed_sum
from robust.searching import Status
from robust.show import text as texts
from robust.show.console import Console, Text, printing
from robust.show.documents import bounds_text, decimal
from robust.show.tables import show_table, table
from robust.show.text import Words, percentage, percentages, print_advice, print_tolerance, stopped, words_of

if TYPE_CHECKING:
    from rich.table import Table

    from robust.execute.controllability import ControllabilityReport
    from robust.probability.measure import Bounds

MANY = 20
"""Pieces up to which a region is shown as a union by default."""
NOTHING_EXCLUDED = "No parameter values are known by now for which the plan can fail."
"""Of an outer bound that bounds nothing."""
HUGE = 300
"""Pieces up to which those that others contain are left out of a difference."""


# -- forms -----------------------------------------------------------------------------------------------------------


def in_form(region: Region, form: str | None) -> Region:
    """The region simplified, as a `union` or a `difference`; None: a union if that takes no more than a few pieces.

    Raises:
        UnsupportedError: if a form is asked for that a region of difference constraints is too long for.
    """
    if isinstance(region, lifted.LiftedRegion):
        return region if form is None else Region.difference(region.base, ())
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


@printing.register(RegionResult)
def _(out: Console, result: RegionResult, *, quiet: bool) -> None:
    """A region as it was found, in the form in which it is shown."""
    print_region(out, formed(result), quiet=quiet)


def print_region(out: Console, result: RegionResult, *, quiet: bool) -> None:
    """Inequalities, and what they mean; unless `quiet` also how they were found."""
    if isinstance(result.region, lifted.LiftedRegion):
        out.lines(_lifted_lines(result.region, {} if result.plan is None else result.plan.nominal))
        if not quiet:
            out.print()
            out.line(_summary(result))
        return
    ordered = result.is_exact and len(result.region.pieces) > MANY and any(factor.symmetry for factor in result.factors)
    exact = result.is_exact
    lines = _ordered_lines(result.factors) if ordered else region_lines(result.region, exact=exact)
    out.lines(lines)
    out.lines(() if exact else _inner_lines(result))
    if not quiet:
        out.print()
    if not exact:
        why = stopped(result.status, result.reason)
        text = f"{why}: an outer bound of the envelope; outside the plan can fail, inside it may"
        out.line(text, "yellow")
        out.line(_open_text(result), "yellow")
    if not quiet:
        out.line(_summary(result))


def _lifted_lines(region: lifted.LiftedRegion, nominal: Point) -> Iterator[str]:
    """The constraints, and how far each parameter may go alone."""
    if region.is_empty:
        yield "The plan is valid for no parameter values."
        return
    yield "The plan is valid if and only if there are times with"
    yield from (f"  {line}" for line in polyhedron_lines(region.demands))
    times = [c for c in region.constraints if not set(region.times).isdisjoint(c.parameters)]
    yield from (f"  {_difference_line(constraint, region.times)}" for constraint in times)
    if set(region.parameters) <= nominal.keys() and nominal in region:
        yield ""
        yield "With all other parameters as planned, it is valid for"
        for name in region.parameters:
            interval = region.interval(name, nominal)
            if interval is not None:
                yield f"  {name} ∈ {interval_text(interval)}"


def _difference_line(constraint: LinearConstraint, times: Sequence[str]) -> str:
    """A constraint on times, with what comes later on the left."""
    known = {name: Fraction(factor) for name, factor in constraint.coefficients if name in times}
    sign = -1 if min(known.values()) < 0 else 1
    relation = {(-1, False): "≥", (1, False): "≤"}.get((sign, constraint.is_equality), "=")
    left = sorted(((name, sign * factor) for name, factor in known.items()), key=lambda term: -term[1])
    rest = [(name, -sign * Fraction(f)) for name, f in constraint.coefficients if name not in times]
    total = sign * constraint.constant
    right = signed_sum(rest, "−", readable)
    if right and total:
        right += f" {'+' if total > 0 else '−'} {readable(abs(total))}"
    return f"{signed_sum(left, '−', readable)} {relation} {right or readable(total)}"


def _ordered_lines(factors: Sequence[inner.EnvelopeFactor]) -> Iterator[str]:
    """The region up to permutations of parameters, for each group of them; all have to hold."""
    for index, factor in enumerate(factors):
        yield from ("",) if index else ()
        yield from _ordering(factor)
        yield from region_lines(in_form(factor.outer, None), exact=True)


def _ordering(factor: inner.EnvelopeFactor) -> Iterator[str]:
    for names in factor.symmetry.classes:
        yield f"In ascending order of {', '.join(names)}, which are interchangeable:"


def _inner_lines(result: RegionResult) -> Iterator[str]:
    """The proved part: a box, and group by group of parameters; or nothing."""
    if result.box is not None:
        yield ""
        yield f"The plan is certain to be valid for {_intervals(result.box)}"
    if not any(factor.inner.pieces or factor.inner.base is not None for factor in result.factors):
        return
    for factor in result.factors:
        yield ""
        yield from _ordering(factor)
        among = f" as to {', '.join(factor.parameters)}" if len(result.factors) > 1 else ""
        if factor.inner.base is not None:
            yield from region_lines(in_form(factor.inner, None), exact=True)
            continue
        yield f"The plan is certain to be valid{among} if all lines of one of these groups hold"
        yield from _groups(factor.inner.pieces)


def _groups(pieces: Sequence[Polyhedron]) -> Iterator[str]:
    """The inequalities of each polyhedron, numbered."""
    for index, piece in enumerate(pieces, start=1):
        yield f"  {index}."
        yield from (f"     {line}" for line in polyhedron_lines(piece) or ["no condition"])


def _open_text(result: RegionResult) -> str:
    """The volume between both bounds, as text."""
    cells = sum(len(factor.inner.pieces) for factor in result.factors)
    proved = f"proved valid: {_polyhedra(cells)}"
    share = result.open_share
    if share is None:
        return proved
    ends = f"{_percent(share.value)}"
    if share.confidence is not None:
        between = f"{_percent(share.lower)} to {_percent(share.upper)}"
        ends = f"about {ends} ({between} with confidence {_percent(share.confidence)}, {share.points} random points)"
    return f"{proved}; open: {ends} of {_intervals(share.box)}"


def _intervals(box: Box) -> str:
    return ", ".join(f"{name} ∈ {interval_text(interval)}" for name, interval in box.intervals.items())


def _summary(result: RegionResult) -> Text:
    text = Text()
    if result.is_exact:
        text.append("complete", style="green")
        text.append(": the exact envelope; ")
    if result.lifted is not None:
        count = plural(len(result.lifted.constraints), "constraint")
        text.append(f"{count} between times, in one order for all values, {duration(result.seconds)}.")
        return text
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
    yield from _groups(region.pieces)


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
    parameters, words = {parameter.name: parameter for parameter in result.plan.parameters}, Words(result.plan)
    return [
        (METHOD_NAMES[entry.method], *_face_cells(face, parameters[face.parameter].percent(face.end), words))
        for entry in result.entries
        for face in entry.faces
    ]


def _face_cells(face: FaceGap, percent: Fraction | None, words: Words) -> Row:
    signs = "<≤" if face.side is Side.UPPER else ">≥"
    sign = signs[face.closed]
    witness = face.witness
    point = "" if witness is None else ", ".join(f"{name} = {readable(v)}" for name, v in witness.values.items())
    gap = "∞" if face.gap is None else readable(face.gap)
    end = f"{readable(face.end)}{'' if percent is None else f' ({percentage(percent)})'}"
    return (
        f"{words.parameters[face.parameter]} {sign} {end}",
        gap,
        words.told(witness.obligation) if witness else "",
        point,
    )


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


@printing.register(Comparison)
def print_comparison(out: Console, result: Comparison, *, quiet: bool) -> None:
    """The region, the boxes, and unless `quiet` what stops each face."""
    if result.region is not None:
        out.lines(_compared_lines(result.region))
        out.print()
    show_table(out, table(_BOXES, box_rows(result), right=_BOXES[2:]))
    for entry in result.entries:
        out.print()
        out.line(f"{METHOD_NAMES[entry.method]}: {_box_text(entry)}")
    if quiet:
        return
    rows = face_rows(result)
    if rows:
        out.print()
        show_table(out, table(_FACES, rows, right=("gap",)))
    print_advice(out, dict.fromkeys(advice for entry in result.entries for advice in entry.result.advice))
    out.print()
    out.line(_compare_summary(result))


def _compared_lines(region: RegionResult) -> Iterator[str]:
    if isinstance(region.region, lifted.LiftedRegion):
        return _lifted_lines(region.region, {})
    return region_lines(in_form(region.region, None), exact=region.is_exact)


def _box_text(entry: Entry) -> str:
    if not entry.result.verified:
        return entry.result.reason or "no box is known"
    return _intervals(entry.result.box) or "no parameters"


def _compare_summary(result: Comparison) -> str:
    words = {
        Status.COMPLETE: "complete: shares are of the exact envelope, and of its bounding box",
        Status.INVALID: "the plan can fail at the nominal values",
        Status.TIMEOUT: "out of time: gaps are at most those shown, shares at least",
        Status.INTERRUPTED: "interrupted: what was known by then",
        Status.UNKNOWN: "a solver failed: gaps are at most those shown, shares at least",
    }
    region = "" if result.region is None else f"; region {duration(result.region.seconds)}"
    ended = words[result.status]
    if result.status is Status.UNKNOWN and result.region is not None and result.region.sliced:
        ended = f"{result.region.reason}: gaps are at most those shown; no other methods are known"
    return f"{ended}{region}, {duration(result.seconds)} in all."


def comparison_details(result: Comparison) -> str:
    """The inequalities and all tables as HTML."""
    lines = ["not computed"] if result.region is None else _compared_lines(result.region)
    ends = (f"{METHOD_NAMES[entry.method]}: {_box_text(entry)}" for entry in result.entries)
    inequalities = escape("\n".join(lines))
    known = (entry.result.tolerance for entry in result.entries)
    tolerances = "".join(f"<p>Tolerance: {escape(str(tolerance))}.</p>" for tolerance in known if tolerance is not None)
    return (
        f"<p>{escape(_compare_summary(result))}</p>{tolerances}<h2>Exact envelope</h2><pre>{inequalities}</pre>"
        f"<h2>Boxes</h2>{_html_table(_BOXES, box_rows(result))}"
        f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in ends)}</ul>"
        f"<h2>What stops each face</h2>{_html_table(_FACES, face_rows(result))}"
    )


def _html_table(head: Row, rows: list[Row]) -> str:
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><tr>{cells}</tr>{body}</table>"


# -- boxes -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Beside:
    """Findings of a command in addition to a box: `counterexample` shows what breaks at the nominal point,
    `controllability` what a dispatcher need not know of the values in the box, `probability` how probable they are."""

    counterexample: Counterexample | None = None
    controllability: ControllabilityReport | None = None
    probability: Bounds | None = None


NOTHING_BESIDE = Beside()


@printing.register(EnvelopeResult)
def print_envelope(out: Console, result: EnvelopeResult, beside: Beside = NOTHING_BESIDE, *, quiet: bool) -> None:
    """The box, or why there is none; unless `quiet` also how it was found. What was asked for beside comes last."""
    _print_box(out, result, beside.counterexample, quiet)
    if beside.controllability is not None:
        from robust.show.execution import print_controllability  # noqa: PLC0415 - much, and for few only

        print_controllability(out, beside.controllability, quiet=quiet)
    if beside.probability is not None:
        out.line(_greatest_text(result, beside.probability))


def _greatest_text(result: EnvelopeResult, probability: Bounds) -> str:
    """The probability of a box, and the greatest that another may have."""
    text = f"probability of the box: {bounds_text(probability, 4)}"
    if result.bound is None:
        return f"{text}; {'' if result.cut_short else 'a local optimum: '}how probable others may be is not known"
    return f"{text}; no box has more than {decimal(min(Fraction(1), result.bound), 4, up=True)}"


def _promise(result: EnvelopeResult) -> str:
    """The property that a complete box has."""
    if result.inner is not None:
        return _nearness(result)
    if result.beta is not None:
        gap = result.beta * 2 if result.doubling else result.beta
        return f"no end can move outwards by {readable(gap)} or more"
    if result.method == "optimal":
        where = "around the nominal values" if result.contain_nominal else "in the envelope"
        return f"no box {where} is wider"
    return "no valid box contains this one"


def _nearness(result: EnvelopeResult) -> str:
    """That a box is an inner one, and how far counterexamples are from its sides."""
    inner = "a sound inner box"
    points = () if result.inner is None else result.inner.outer
    if not points:
        return inner
    sizes = {parameter.name: abs(parameter.nominal) or Fraction(1) for parameter in result.parameters}
    share = max(point.gap / sizes[point.parameter] for point in points)
    confirmed = sum(point.counterexample is not None for point in points)
    counted = f"{plural(len(points), 'side')}, {confirmed} confirmed by execution"
    return f"{inner}: at most {readable(share * 100)} % of nominal values farther are counterexamples ({counted})"


def _print_box(out: Console, result: EnvelopeResult, counterexample: Counterexample | None, quiet: bool) -> None:
    if result.status is Status.INVALID:
        where = "the plan can fail at the nominal values: " if result.values else ""
        out.line(Text.assemble(("invalid", "bold red"), f": {where}{result.reason}"))
        if counterexample is not None and not quiet:
            texts.print_counterexample(out, counterexample, words_of(result.plan))
        if not quiet:
            print_advice(out, result.advice)
        return
    if not result.verified:
        word = stopped(result.status, result.reason)
        out.print(Text(f"{word}; the nominal values are not decided, no box is known", style="yellow"))
        return
    if result.parameters:
        show_table(out, envelope_table(result))
    else:
        out.print(Text("The plan is valid, and has no parameters that could vary; --parameter declares some."))
    if result.parameters and not quiet:
        _print_stops(out, result)
        print_advice(out, result.advice)
        out.print()
    if result.shape is not None:
        rows = ((name, interval_text(interval)) for name, interval in result.shape.bounded.items())
        show_table(out, table([result.shape.name, "between"], rows))
        out.print()
    if result.status is not Status.COMPLETE:
        word = stopped(result.status, result.reason)
        out.line(f"{word}: the best box so far; sound, not maximal", "yellow")
    if not quiet:
        print_tolerance(out, result.tolerance)
        out.line(_box_summary(result))


SIDES = 6
"""Sides with one end that are shown one by one."""
NOT_NEGATIVE = ": non-negative duration"
ROWS = 20
"""Parameters up to which a box has a row for each."""
_COLUMNS = ("parameter", "name", "nominal", "lower", "upper", "may fall by", "may rise by", "in per cent")


def envelope_table(result: EnvelopeResult) -> Table:
    """One row for each parameter: nominal value, interval, and how far it may deviate to either side.

    Many parameters have a row for each group: those of one action that may deviate by as many per cent.
    """
    words = words_of(result.plan)
    rows = []
    for parameter in result.parameters:
        name, *cells = _envelope_cells(parameter, result.box[parameter.name])
        rows.append((words.parameters.get(name, name), name, *cells))
    if len(rows) > ROWS:
        rows = list(_grouped(rows))
    kept = [i for i, column in enumerate(_COLUMNS) if i in {0, 2} or any(row[i] for row in rows)]
    kept = [i for i in kept if i != 1 or any(row[0] != row[1] for row in rows)]
    return table([_COLUMNS[i] for i in kept], ([row[i] for i in kept] for row in rows), right=_COLUMNS[2:])


def _grouped(rows: Sequence[Row]) -> Iterator[Row]:
    """Rows of one action and one share as one; a row that is alone stays as it is."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row[0].split()[0], row[-1] or row[0]), []).append(row)
    for (action, share), members in groups.items():
        if len(members) == 1:
            yield members[0]
        else:
            nominal = dict.fromkeys(row[2] for row in members)
            yield (
                f"{action}, {len(members)} steps",
                "",
                ", ".join(islice(nominal, 3)) + ", …" * (len(nominal) > 3),
                *[next(iter(cells)) if len(cells := {row[i] for row in members}) == 1 else "" for i in range(3, 7)],
                share,
            )


def _envelope_cells(parameter: Parameter, interval: Interval) -> Sequence[str]:
    nominal = parameter.nominal
    lower = end(interval.lower, upper=False, closed=interval.lower_closed)
    upper = end(interval.upper, upper=True, closed=interval.upper_closed)
    if not parameter.has_nominal:
        return parameter.name, "–", lower, upper, "", "", ""
    fall = None if interval.lower is None else nominal - interval.lower
    rise = None if interval.upper is None else interval.upper - nominal
    return (
        parameter.name,
        readable(nominal),
        lower,
        upper,
        end(fall, upper=True, closed=interval.lower_closed),
        end(rise, upper=True, closed=interval.upper_closed),
        percentages(parameter, interval),
    )


def _print_stops(out: Console, result: EnvelopeResult) -> None:
    """Print what limits the sides, those with the same limit together."""
    sides: dict[str, dict[str, None]] = {}
    words = words_of(result.plan)
    for (name, side), stop in result.stops.items():
        reason = "no duration is negative" if stop.name.endswith(NOT_NEGATIVE) and not stop.also else stop.short
        sides.setdefault(words.told(reason), {})[_side(result, name, side, words)] = None
    if sides:
        out.print()
        out.print("What ends each side:")
    for reason, ended in sides.items():
        more = f" and {plural(len(ended) - SIDES, 'more side')}" if len(ended) > SIDES else ""
        out.line(f"  {', '.join(islice(ended, SIDES))}{more}: {reason}")


def _side(result: EnvelopeResult, name: str, side: Side, words: Words) -> str:
    """`drive r1 a b ≤ 36`; `drive r1 a b = 36` for both sides if nothing is between and both end at the same."""
    interval = result.box[name]
    both = {result.stops.get((name, end)) for end in Side}
    sign = (
        "="
        if interval.width == 0 and len(both) == 1
        else ("<≤" if side is Side.UPPER else ">≥")[interval.is_closed_at(side)]
    )
    return f"{words.parameters.get(name, name)} {sign} {readable(interval.end(side) or Fraction(0))}"


def _box_summary(result: EnvelopeResult) -> Text:
    parts = [plural(result.checks, "check"), duration(result.seconds)]
    if result.first_widening_seconds is not None:
        parts.append(f"first widening after {duration(result.first_widening_seconds)}")
    text = Text()
    if result.status is Status.COMPLETE and result.parameters:
        text.append("complete", style="green")
        text.append(f": {_promise(result)}{_total(result)}; ")
    if result.fallback is not None:
        parts.append(f"by a solver: {result.fallback}")
    text.append(f"{', '.join(parts)}.")
    return text


def _total(result: EnvelopeResult) -> str:
    """The total width of an optimal box, where there is one."""
    if result.bound is None or result.method != "optimal":
        return ""
    weighted = any(parameter.weight != 1 for parameter in result.parameters)
    return f": total {'weighted ' if weighted else ''}width {readable(result.bound)}"
