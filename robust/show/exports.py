"""Envelopes for other tools: what PlanSys2's executor needs to know, CSV, and YAML.

PlanSys2 asks by how much each action may exceed its planned duration. A box is a product: each parameter may have any
of its values, whatever the others have. So if no parameter of the duration of an instance is used for anything else,
each instance may take any duration up to what the box allows it, whatever the others take. If an executor knows one
share per action, then the least of its instances holds for all.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from io import StringIO
from typing import Any

from robust import __version__, errors
from robust.encode import network
from robust.irr.search import EnvelopeResult
from robust.numbers import one_line, readable
from robust.options.declare import place_of
from robust.options.verbs import EXPORTS
from robust.plan import model
from robust.plan.model import ActionInstance, HasPlan, ParameterReference, ParametrizedPlan, plan_itself
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box
from robust.show import plan_documents
from robust.show.text import percentage

Limit = Polynomial[Any]
"""Over parameters only."""

FIXED = "its duration is no parameter"


@dataclass(frozen=True, slots=True)
class Overrun:
    """The greatest duration of an instance: as planned, and as proved.

    Attributes:
        planned: at the nominal values; None if nothing limits it, and then no share of it is proved.
        proved: None: any.
        closed: whether that duration itself is proved, or only all shorter ones.
        reason: why no more than the planned duration is proved, where that is not the box.
        parameters: what the duration depends on.
        shortest: below it nothing is proved; None where no more than the planned duration is.
    """

    instance: ActionInstance
    planned: Fraction | None
    proved: Fraction | None
    closed: bool = True
    reason: str | None = None
    parameters: tuple[str, ...] = ()
    shortest: Fraction | None = None

    @property
    def percent(self) -> Fraction | None:
        """By how much it may exceed the planned one, in per cent; None if by any, or if that is some share of 0."""
        if self.proved is None or self.planned == 0:
            return None
        if self.planned is None:
            return Fraction(0)
        return (self.proved - self.planned) / self.planned * 100


@dataclass(frozen=True, slots=True)
class ActionOverrun:
    """The least share of all instances of an action, or None if none of them limits it.

    `decisive` is the instance whose share that is, and `closed` whether the share itself is proved.
    """

    action: str
    overruns: tuple[Overrun, ...]
    percent: Fraction | None
    closed: bool
    decisive: Overrun | None


def action_overruns(plan: ParametrizedPlan, box: Box) -> tuple[ActionOverrun, ...]:
    """For each durative action of the plan, in the order of their first instances."""
    by_action: dict[str, list[Overrun]] = {}
    for overrun in overruns(plan, box):
        by_action.setdefault(overrun.instance.action, []).append(overrun)
    return tuple(_of_action(action, tuple(members)) for action, members in by_action.items())


def _of_action(action: str, members: tuple[Overrun, ...]) -> ActionOverrun:
    known = [(overrun.percent, overrun.closed, overrun) for overrun in members if overrun.percent is not None]
    if known:
        percent, closed, decisive = min(known, key=lambda share: (share[0], share[1]))
        return ActionOverrun(action, members, percent, closed, decisive)
    # Any share of a planned duration of 0 is 0.
    empty = next((overrun for overrun in members if overrun.proved is not None), None)
    return ActionOverrun(action, members, None if empty is None else Fraction(0), True, empty)


def overruns(plan: ParametrizedPlan, box: Box) -> Iterator[Overrun]:
    """For each durative instance; the box is one of values for which the plan is valid."""
    limits = _limits(plan)
    uses = {parameter.name: _uses(plan, parameter.name) for parameter in plan.parameters}
    for instance in plan.instances:
        if instance.durative:
            yield _overrun(plan, box, instance, limits[instance.identifier], uses)


def _overrun(
    plan: ParametrizedPlan, box: Box, instance: ActionInstance, bounds: Limits, uses: Mapping[str, set[str]]
) -> Overrun:
    limits = bounds.most
    nominal = {ParameterReference(name): value for name, value in plan.nominal.items()}
    planned = min((limit.evaluate(nominal) for limit in limits), default=None)
    if planned is None:
        return Overrun(instance, None, Fraction(0), reason="nothing says how long it takes")
    constants = [limit.constant_term for limit in limits if limit.is_constant]
    moving = list(dict.fromkeys(limit for limit in limits if not limit.is_constant))
    names = tuple(sorted({reference.name for limit in moving for reference in limit.variables}))

    def fixed(reason: str) -> Overrun:
        return Overrun(instance, planned, planned, reason=reason, parameters=names)

    if not moving:
        return fixed(FIXED)
    if len(moving) > 1 or not moving[0].is_linear:
        return fixed("its duration is not one sum of parameters")
    for name in names:
        if others := sorted(uses[name] - {_duration(instance)}):
            return fixed(f"parameter {name} also stands for {' and '.join(others)}, and is proved only for all at once")
    longest = box.values_of(moving[0].coefficients(), moving[0].constant_term)
    proved, closed = longest.upper, longest.upper_closed
    least = min(constants, default=None)
    if least is not None and (proved is None or least < proved):
        proved, closed = least, True
    below = (box.values_of(limit.coefficients(), limit.constant_term).lower for limit in bounds.least)
    shortest = max((least for least in below if least is not None), default=Fraction(0))
    return Overrun(instance, planned, proved, closed, None, names, shortest)


@dataclass(slots=True)
class Limits:
    """The greatest and the least value of a duration."""

    most: list[Limit] = field(default_factory=list)
    least: list[Limit] = field(default_factory=list)


def _limits(plan: ParametrizedPlan) -> dict[str, Limits]:
    """What the network, and the domain without regard to the state, say of durations; by instance."""
    limits = {instance.identifier: Limits() for instance in plan.instances}
    durative = (instance for instance in plan.instances if instance.durative)
    ends = {(instance.start, instance.end): limits[instance.identifier] for instance in durative}

    def add(source: model.TimePoint, target: model.TimePoint, least: Limit) -> None:
        """The target is at least so much after the source."""
        if (source, target) in ends:
            ends[source, target].least.append(least)
        if (target, source) in ends:
            ends[target, source].most.append(-least)

    for item in plan.constraints:
        if item.lower is not None:
            add(item.source, item.target, item.lower)
        if item.upper is not None:
            add(item.target, item.source, -item.upper)
    for rule in network.duration_rules(plan, network.Writes(plan)):
        for bound in rule.bounds:
            add(bound.source, bound.target, bound.weight)
    return limits


# -- what parameters stand for -----------------------------------------------------------------------------------------


def _duration(instance: ActionInstance) -> str:
    return f"the duration of {instance.identifier}"


def _uses(plan: ParametrizedPlan, name: str) -> set[str]:
    """What changes with a parameter, in words: durations, other statements of the network, conditions and effects."""
    reference = ParameterReference(name)
    ends = {frozenset((instance.start, instance.end)): instance for instance in plan.instances if instance.durative}
    words = set()
    for item in plan.constraints:
        if any(bound is not None and reference in bound.variables for bound in (item.lower, item.upper)):
            instance = ends.get(frozenset((item.source, item.target)))
            words.add(f"`{item}`" if instance is None else _duration(instance))
    fluents = {fluent for fluent, value in plan.initial_fluents.items() if reference in value.variables}

    def uses(expressions: Iterable[model.Expression]) -> bool:
        return any(
            reference in expression.variables or not fluents.isdisjoint(model.fluents_in(expression))
            for expression in expressions
        )

    for instance in plan.instances:
        if uses(duration.condition.expression for duration in instance.durations):
            words.add(_duration(instance))
        conditions = (condition.condition for condition in instance.conditions)
        if uses(_of_conditions(conditions)) or uses(_of_effects(instance)):
            words.add(f"what {instance.identifier} reads or writes")
    if uses(_of_conditions(goal.condition for goal in plan.goal)):
        words.add("the goal")
    return words


def _of_conditions(conditions: Iterable[model.Condition]) -> Iterator[model.Expression]:
    return (comparison.expression for condition in conditions for comparison in model.comparisons(condition))


def _of_effects(instance: ActionInstance) -> Iterator[model.Expression]:
    for effect in instance.numeric_effects:
        yield effect.expression
        yield Polynomial.variable(effect.fluent)
        yield from _of_conditions((effect.condition,))
    for atom in instance.atom_effects:
        yield from _of_conditions((atom.condition,))
    for continuous in instance.continuous_effects:
        yield continuous.rate
        yield Polynomial.variable(continuous.fluent)


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


def export(
    plan: ParametrizedPlan | HasPlan, result: EnvelopeResult, form: str, *, controllable: str | None = None
) -> str:
    """An envelope as a file for other tools.

    Args:
        plan: the plan that the envelope is of, or a conversion.
        result: what :func:`robust.envelope` found.
        form: `plansys2`: the parameters of PlanSys2's executor, with the percentage by which each action may exceed its
            planned duration; `csv`: a line for each parameter; `yaml`: both as one document.
        controllable: `dynamic` or `strong` if the box is known to be so controllable; the file for PlanSys2 says it.

    Returns:
        The text of the file. Percentages are of planned durations; all else is in the units of the plan.

    Raises:
        InputError: for another form, or an envelope that is not verified: nothing is proved then; for PlanSys2, if it
            does not hold the planned durations, of which percentages are, or if no action needs a limit: the executor
            does not start on a list of no actions.
        UnsupportedError: if PlanSys2 has no place for an action.
    """
    plan = plan_itself(plan)
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
