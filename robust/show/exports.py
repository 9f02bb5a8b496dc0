"""Envelopes for other tools: what PlanSys2's executor needs to know, CSV, and YAML."""

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from io import StringIO
from typing import Any

from robust import __version__, errors
from robust.irr.overruns import FIXED, ActionOverrun, Overrun, action_overruns, overruns
from robust.irr.search import EnvelopeResult
from robust.numbers import one_line, readable
from robust.options.declare import place_of
from robust.options.verbs import EXPORTS
from robust.plan.model import ParametrizedPlan
from robust.show import plan_documents
from robust.show.text import percentage

_UNIT = Fraction(1, 10**6)
_MOST = Fraction(10**12)
"""Of percentages: what is proved of more is proved of this."""
COLUMNS = (
    "name", "action", "nominal", "lower", "upper", "lower_closed", "upper_closed",
    "stopped_below", "stopped_above", "percent_below", "percent_above",
)  # fmt: skip
"""Of each parameter; numbers are exact, an end that is none is inf or -inf, and `action` is whose duration it is."""
_PLAIN_KEY = re.compile(r"[a-z][a-z0-9_-]*")
_WORDS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false", "null"})
"""What YAML reads as something else than a text."""


def export(plan: ParametrizedPlan, result: EnvelopeResult, form: str, *, controllable: str | None = None) -> str:
    """An envelope as a file for other tools.

    Args:
        plan: the plan that the envelope is of.
        result: what :func:`robust.envelope` found.
        form: `plansys2`: the parameters of PlanSys2's executor, with the percentage by which each action may exceed its
            planned duration; `csv`: a line for each parameter; `yaml`: both as one document.
        controllable: `dynamic` or `strong` if the box is known to be so controllable; the file for PlanSys2 says it.

    Raises:
        InputError: for another form, or an envelope that is not verified: nothing is proved then; for PlanSys2, if it
            does not hold the planned durations, of which percentages are, or if no action needs a limit: the executor
            does not start on a list of no actions.
        UnsupportedError: if PlanSys2 has no place for an action.
    """
    if form not in EXPORTS:
        raise errors.InputError(f"unknown form {form!r}, expected {', '.join(EXPORTS)}")
    if not result.verified:
        raise errors.InputError(f"found an envelope that is {result.status.value}, expected a verified one to export")
    if form == "plansys2":
        return plansys2(plan, result, controllable)
    return (csv_rows if form == "csv" else yaml_document)(plan, result)


# -- percentages -------------------------------------------------------------------------------------------------------


def percentage_text(percent: Fraction, *, closed: bool) -> str:
    """A decimal that is not above what is proved, and below it where that is not `closed`; nor is its nearest double.

    It is at most 1e-6 below, but for percentages beyond 1e12.
    """
    steps = math.floor(min(percent, _MOST) / _UNIT)
    if not closed and steps * _UNIT == percent:
        steps -= 1
    value = Decimal(steps) / 10**6
    double = float(value)
    if Fraction(double) > percent or (not closed and Fraction(double) == percent):
        value = Decimal(repr(math.nextafter(double, -math.inf)))
    text = format(value, "f")
    integer, _, digits = text.partition(".")
    return f"{integer}.{digits.rstrip('0') or '0'}"


# -- PlanSys2 ----------------------------------------------------------------------------------------------------------


def plansys2(plan: ParametrizedPlan, result: EnvelopeResult, controllable: str | None = None) -> str:
    """`action_timeouts` of PlanSys2's executor, in its YAML, with what is proved in comments."""
    if not _holds_plan(plan, result):
        raise errors.InputError(
            "found an envelope without the nominal values, expected one around them for percentages"
        )
    limits = action_overruns(plan, result.box)
    listed = [limit for limit in limits if limit.percent is not None]
    if not listed:
        names = ", ".join(limit.action for limit in limits)
        why = f"any longer duration of {names} is proved" if limits else "no action of the plan has a duration"
        raise errors.InputError(
            f"found no action that needs a limit, expected one to export: {why}", place_of("export")
        )
    for limit in listed:
        if limit.action == "actions":
            raise errors.UnsupportedError(
                "found an action named 'actions', expected another name: PlanSys2 needs it itself"
            )
    lines = [*_obligation(result, controllable), ""]
    for limit in limits:
        if limit.percent is None:
            lines += [f"# {limit.action}: left out, which is no limit; any longer duration is proved as well."]
            lines += _instances(limit)
    lines += ["executor:", "  ros__parameters:", "    action_timeouts:"]
    lines += ["      actions:", *(f"        - {_key(limit.action)}" for limit in listed)]
    for limit in listed:
        lines += [f"      # {line}" for line in _explained(limit)]
        text = percentage_text(limit.percent or Fraction(0), closed=limit.closed)
        lines += [f"      {_key(limit.action)}:", f"        duration_overrun_percentage: {text}"]
    return "\n".join(lines) + "\n"


def _holds_plan(plan: ParametrizedPlan, result: EnvelopeResult) -> bool:
    """Whether there are planned durations, and the box is around them."""
    return plan.has_nominal and all(value in result.box[name] for name, value in plan.nominal.items())


_KNOWN = {
    "weak": "has to know durations beforehand (else: --controllability dynamic)",
    "dynamic": "has to see each duration when its action has ended: the box is dynamically controllable",
    "strong": "need not know any duration: the box is strongly controllable",
}
"""What somebody who keeps to the network has to know of the values in a box."""


def _obligation(result: EnvelopeResult, controllable: str | None) -> list[str]:
    """The claim, and the conditions under which it holds."""
    lines = [
        f"Written by robust {__version__}: by how much actions may exceed their planned durations, proved.",
        "Proof obligation: the plan is valid for every duration of every action from the planned one to the limit",
        "that its percentage gives, all of them at once and independently. The envelope is a product of intervals, so",
        "each instance of an action may take any duration in its own. PlanSys2 knows one percentage for each action:",
        "the least of its instances, which is at most what is proved for each. Rounded down, never up.",
        "Presupposed: durations as in this plan, time points within its network (the executor does not check that",
        "either), and no action shorter than is proved below: PlanSys2 has no limit for that. Whoever keeps to the",
        f"network {_KNOWN[controllable or 'weak']}.",
        "PlanSys2 enforces a limit only if the behaviour tree of its action has a CheckTimeout node, and measures in",
        "seconds: that has to be the unit of time of the plan.",
    ]
    if result.status.value != "complete":
        lines.append(f"The search was {result.status.value}: what is here is proved, but more may be possible.")
    return [f"# {line}" for line in lines]


def _explained(limit: ActionOverrun) -> Iterator[str]:
    """Above an action: the exact percentage, why, and its instances."""
    percent, decisive = limit.percent, limit.decisive
    if percent is None or decisive is None:
        return
    exact = f"{percent} %" if limit.closed else f"less than {percent} %"
    count = len(limit.overruns)
    of = "" if count == 1 else f", the least of {count} instances: {decisive.instance.identifier}"
    yield one_line(f"{limit.action}: exactly {exact}{of}")
    if decisive.reason == FIXED:
        yield one_line(f"for more: --parameter duration:{limit.action}")
    yield from (line.removeprefix("# ") for line in _instances(limit))


def _instances(limit: ActionOverrun) -> list[str]:
    return [f"#   {one_line(_instance(overrun))}" for overrun in limit.overruns]


def _instance(overrun: Overrun) -> str:
    """`n0 (move dock shelf): planned 20, proved up to 24 (20 %)`."""
    planned = "no planned duration" if overrun.planned is None else f"planned {readable(overrun.planned)}"
    shortest = readable(overrun.shortest or Fraction(0))
    if overrun.proved is None:
        proved = f"proved from {shortest}"
    elif overrun.reason is not None:
        proved = f"nothing more: {overrun.reason}"
    else:
        limit = "up to" if overrun.closed else "below"
        share = "" if overrun.percent is None else f" ({percentage(overrun.percent)})"
        proved = f"proved {limit} {readable(overrun.proved)}{share}, and from {shortest}"
    return f"{overrun.instance.identifier} {overrun.instance}: {planned}, {proved}"


def _key(name: str) -> str:
    return name if _PLAIN_KEY.fullmatch(name) and name not in _WORDS else quoted(name)


# -- CSV and YAML ------------------------------------------------------------------------------------------------------


def _parameters(plan: ParametrizedPlan, result: EnvelopeResult) -> list[dict[str, Any]]:
    """A row for each parameter, by the names of the columns."""
    within = plan_documents.envelope(result)["parameters"]
    actions: dict[str, list[str]] = {}
    for overrun in overruns(plan, result.box):
        for name in overrun.parameters:
            actions.setdefault(name, []).append(f"{overrun.instance.identifier} {overrun.instance}")
    rows = (
        {"name": name, "action": "; ".join(actions.get(name, [])) or None, **facts} for name, facts in within.items()
    )
    return [{column: row[column] for column in COLUMNS} for row in rows]


def csv_rows(plan: ParametrizedPlan, result: EnvelopeResult) -> str:
    """A line for each parameter, and a head."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in _parameters(plan, result):
        writer.writerow([_cell(row[column]) for column in COLUMNS])
    return text.getvalue()


def _cell(value: object) -> object:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def yaml_document(plan: ParametrizedPlan, result: EnvelopeResult) -> str:
    """The parameters with their intervals, and the percentages of the actions."""
    actions = [
        {
            "action": limit.action,
            "overrun_percentage": None if limit.percent is None else str(limit.percent),
            "overrun_percentage_closed": limit.closed,
            "instances": [_instance(overrun) for overrun in limit.overruns],
        }
        for limit in (action_overruns(plan, result.box) if _holds_plan(plan, result) else ())
    ]
    answer = {
        "schema": "robust/envelope-export/1",
        "robust": __version__,
        "status": result.status.value,
        "method": result.method,
        "parameters": _parameters(plan, result),
        "actions": actions,
    }
    return "\n".join(yaml_lines(answer)) + "\n"


def yaml_lines(value: Mapping[str, Any] | Sequence[Any]) -> Iterator[str]:
    """Dictionaries, lists, texts, truth values and null as YAML, in blocks; texts are always quoted."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if isinstance(inner, Mapping | list) and inner:
                yield f"{_key(key)}:"
                yield from (f"  {line}" for line in yaml_lines(inner))
            else:
                yield f"{_key(key)}: {_scalar(inner)}"
        return
    for inner in value:
        if isinstance(inner, Mapping | list) and inner:
            first, *others = yaml_lines(inner)
            yield f"- {first}"
            yield from (f"  {line}" for line in others)
        else:
            yield f"- {_scalar(inner)}"


def _scalar(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case str():
            return quoted(value)
        case []:
            return "[]"
        case {}:
            return "{}"
        case _:
            raise TypeError(f"found {type(value).__name__}, expected a text, a truth value or nothing")


def quoted(text: str) -> str:
    """A text in double quotes, in one line."""
    return f'"{"".join(map(_escaped, text))}"'


def _escaped(character: str) -> str:
    if character in {'"', "\\"}:
        return f"\\{character}"
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\u{code:04x}" if code < 2**16 else f"\\U{code:08x}"
