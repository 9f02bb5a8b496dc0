"""Boxes for people: how far parameters may deviate, what ends them, and how they were found."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from rich.console import Console
from rich.table import Table
from rich.text import Text

from robust.irr.check import Counterexample
from robust.irr.search import EnvelopeResult
from robust.numbers import duration, end, plural, readable
from robust.plan.model import Parameter
from robust.qe.box import Interval, Side
from robust.searching import Status
from robust.show.console import show_table, table
from robust.show.documents import NOTHING_BESIDE, Beside
from robust.show.probabilities import greatest_text
from robust.show.text import percentages, print_advice, print_counterexample, stopped


def print_envelope(out: Console, result: EnvelopeResult, beside: Beside = NOTHING_BESIDE, *, quiet: bool) -> None:
    """The box, or why there is none; unless `quiet` also how it was found. What was asked for beside comes last."""
    _print_box(out, result, beside.counterexample, quiet)
    if beside.controllability is not None:
        from robust.show.execution import print_controllability  # noqa: PLC0415 - much, and for few only

        print_controllability(out, beside.controllability, quiet=quiet)
    if beside.probability is not None:
        out.print(greatest_text(result, beside.probability), soft_wrap=True)


def _promise(result: EnvelopeResult) -> str:
    """What a complete box is."""
    if result.beta is not None:
        gap = result.beta * 2 if result.doubling else result.beta
        return f"no end can move outwards by {readable(gap)} or more"
    if result.method == "optimal":
        where = "around the nominal values" if result.contain_nominal else "in the envelope"
        return f"no box {where} is wider"
    return "no valid box contains this one"


def _print_box(out: Console, result: EnvelopeResult, counterexample: Counterexample | None, quiet: bool) -> None:
    if result.status is Status.INVALID:
        where = "the plan can fail at the nominal values: " if result.values else ""
        out.print(Text.assemble(("invalid", "bold red"), f": {where}{result.reason}"), soft_wrap=True)
        if counterexample is not None and not quiet:
            print_counterexample(out, counterexample)
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
    if result.status is not Status.COMPLETE:
        word = stopped(result.status, result.reason)
        out.print(Text(f"{word}: the best box so far; sound, not maximal", style="yellow"), soft_wrap=True)
    if not quiet:
        out.print(_summary(result), soft_wrap=True)


def envelope_table(result: EnvelopeResult) -> Table:
    """One row for each parameter: nominal value, interval, and how far it may deviate to either side."""
    columns = ("parameter", "nominal", "lower", "upper", "may fall by", "may rise by", "in per cent")
    rows = [_envelope_cells(parameter, result.box[parameter.name]) for parameter in result.parameters]
    shown = columns if any(row[-1] for row in rows) else columns[:-1]
    return table(shown, (row[: len(shown)] for row in rows), right=columns[1:])


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
    """What ends the sides, those that end at the same together."""
    sides: dict[str, dict[str, None]] = {}
    for (name, side), stop in result.stops.items():
        sides.setdefault(stop.short, {})[_side(result, name, side)] = None
    if sides:
        out.print()
        out.print("What ends each side:")
    for reason, ended in sides.items():
        out.print(Text(f"  {', '.join(ended)}: {reason}"), soft_wrap=True)


def _side(result: EnvelopeResult, name: str, side: Side) -> str:
    """`to_ridge ≤ 36`; `to_ridge = 36` for both sides if nothing is between and both end at the same."""
    interval = result.box[name]
    both = {result.stops.get((name, one)) for one in Side}
    sign = (
        "="
        if interval.width == 0 and len(both) == 1
        else ("<≤" if side is Side.UPPER else ">≥")[interval.is_closed_at(side)]
    )
    return f"{name} {sign} {readable(interval.end(side) or Fraction(0))}"


def _summary(result: EnvelopeResult) -> Text:
    parts = [plural(result.checks, "check"), duration(result.seconds)]
    if result.first_widening_seconds is not None:
        parts.append(f"first widening after {duration(result.first_widening_seconds)}")
    text = Text()
    if result.status is Status.COMPLETE and result.parameters:
        text.append("complete", style="green")
        text.append(f": {_promise(result)}{_total(result)}; ")
    text.append(f"{', '.join(parts)}.")
    return text


def _total(result: EnvelopeResult) -> str:
    """The total width of an optimal box, where there is one."""
    if result.bound is None or result.method != "optimal":
        return ""
    weighted = any(parameter.weight != 1 for parameter in result.parameters)
    return f": total {'weighted ' if weighted else ''}width {readable(result.bound)}"
