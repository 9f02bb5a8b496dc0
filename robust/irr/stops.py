"""What ends each side of a box, and what to type where an action's own duration leaves no room.

A side ends at a declared bound; else at statements of the network, if some values just beyond leave no schedule; else
at all obligations that break just beyond: as near as one likes for exact boxes, and for IRR within its last attempt.
What ends a tolerance, the share by which all durations may deviate at once, is a chain of steps and a demand.
"""

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from robust.numbers import format_number
from robust.plan import model
from robust.plan.model import Bound, Parameter, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Side


@dataclass(frozen=True, slots=True)
class Stop:
    """What ends a side: obligations or a bound by name, or statements of the network, in the order of time.

    `also` are the obligations after the first, in the plan's order.
    """

    name: str
    statements: tuple[str, ...] = ()
    also: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join(self.statements)}" if self.statements else self.name

    @property
    def every(self) -> tuple[str, ...]:
        """All that end the side."""
        return (str(self), *self.also)

    @property
    def short(self) -> str:
        """With the first of many obligations, and the first and the last of many statements: mostly when it begins, and
        by when it is to end.
        """
        if len(self.also) > MANY:
            return f"{'; '.join(self.every[:MANY])}; {len(self.every) - MANY} more (--json lists them)"
        if len(self.statements) <= MANY:
            return "; ".join(self.every)
        first, *others, last = self.statements
        return f"{self.name}: {first}; {len(others)} more of the network (--json lists them); {last}"


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The largest λ such that all durations that are parameters may be anywhere in nominal · (1 ± λ) at once.

    `attained` says whether they may be at both ends; `chain` what ends it: steps in the order of time, then a demand.
    """

    ratio: Fraction
    attained: bool
    chain: tuple[str, ...]

    def __str__(self) -> str:
        exact = "" if self.ratio * 1000 % 1 == 0 else f" (exactly {self.ratio})"
        bound = f"{'up to' if self.attained else 'less than'} {rounded_percent(self.ratio)}{exact}"
        return f"each duration may be {bound} longer or shorter, all at once; what ends it: {self.what}"

    @property
    def what(self) -> str:
        """The chain in one line, without the middle of a long one."""
        if len(self.chain) <= LINKS:
            return ", ".join(self.chain)
        first, *others, last, demand = self.chain
        return f"{first}, {len(others)} more (--json lists them), {last}, {demand}"


def rounded_percent(ratio: Fraction) -> str:
    """A share in per cent, down to a tenth."""
    return f"{format_number(Fraction(ratio * 1000 // 1, 10))} %"


LINKS = 8
"""Of a chain that is told link by link."""
MANY = 5
"""Statements or obligations that are all shown to people."""
NO_SCHEDULE = "no schedule"
CUT_SHORT = Stop("not reached: the search was cut short")
NOT_EXAMINED = Stop("not examined: no time was left")
APPROACHED = Stop("nothing next to it: there is no widest box, and this one is close to those that are wider")
JUST = Fraction(1, 1000)
"""How far beyond a side to look first for what ends it."""


def declared_stop(parameter: Parameter, side: Side, end: Fraction) -> Stop | None:
    """The declared bound, if the side ends there."""
    limit, word = (parameter.upper, "ub") if side is Side.UPPER else (parameter.lower, "lb")
    return Stop(f"declared bound: {word} {format_number(end)}") if end == limit else None


# -- durations that plan and domain both fix ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Advice:
    """Why some parameters have no room although they were meant to vary, and the options to type in order to change it.

    `options` are texts for `--parameter`.
    """

    parameters: tuple[str, ...]
    reason: str
    options: tuple[str, ...]

    def __str__(self) -> str:
        typed = " ".join(f"--parameter {shlex.quote(option)}" for option in self.options)
        return f"{', '.join(self.parameters)}: {self.reason}: {typed}"


@dataclass(frozen=True, slots=True)
class _Fixed:
    """An instance whose duration is `length` in the plan, and is demanded to be something else by the domain."""

    instance: model.ActionInstance
    constraint: model.DurationConstraint
    length: Bound
    parameters: frozenset[str]


def advice(plan: ParametrizedPlan, box: Box, broken: str | None = None) -> tuple[Advice, ...]:
    """What to type for parameters without room in a box, where durations of actions are why.

    Args:
        plan: the plan.
        box: what was found.
        broken: the obligation that breaks at the nominal values, if the plan is invalid.
    """
    groups: dict[bool, list[_Fixed]] = {}
    for fixed in _fixed_twice(plan):
        stuck = any(box[name].width == 0 for name in fixed.parameters)
        if fixed.instance.label(fixed.constraint) == broken or (broken is None and stuck):
            groups.setdefault(bool(fixed.length.variables), []).append(fixed)
    return tuple(_advice(plan, group) for group in groups.values())


def _fixed_twice(plan: ParametrizedPlan) -> Iterator[_Fixed]:
    """Durations that parameters are about, which the network fixes at one expression and the domain at another."""
    lengths: dict[tuple[object, object], Bound] = {}
    for item in plan.constraints:
        if item.lower is not None and item.lower == item.upper:
            lengths[item.source, item.target] = item.lower
            lengths[item.target, item.source] = -item.lower
    for instance in plan.instances:
        length = lengths.get((instance.start, instance.end))
        if length is None:
            continue
        for constraint in instance.fixing[:1]:
            gap = _with_values(constraint.condition.expression, length, plan)
            names = frozenset(known.name for known in gap.variables if isinstance(known, model.ParameterReference))
            if names:
                yield _Fixed(instance, constraint, length, names)


def _with_values(expression: model.Expression, length: Bound, plan: ParametrizedPlan) -> model.Expression:
    """The expression with the length for `?duration`, and initial values for fluents."""

    def value(unknown: model.NumericVariable) -> model.Expression:
        match unknown:
            case model.Duration():
                return length
            case model.Fluent():
                return plan.initial_fluents[unknown]
            case model.ParameterReference():
                return Polynomial.variable(unknown)

    return expression.substitute(value)


def _advice(plan: ParametrizedPlan, group: list[_Fixed]) -> Advice:
    first = group[0]
    names = tuple(name for name in plan.nominal if any(name in fixed.parameters for fixed in group))
    demand = f"{first.constraint.text} of {first.instance.identifier}{' and the like' if len(group) > 1 else ''}"
    if first.length.variables:
        reason = f"the plan makes parameters of durations, but the domain still demands {demand}"
        remedy = "to vary what the domain demands as well, type"
    else:
        reason = f"the plan fixes durations that follow from them in the domain, by {demand}"
        remedy = "to vary the durations themselves instead, type"
    return Advice(names, f"no room, because {reason}; {remedy}", tuple(_options(plan, group)))


def _options(plan: ParametrizedPlan, group: list[_Fixed]) -> Iterator[str]:
    """`duration:ACTION` for several instances that are all of that action, else `duration:ID` for each."""
    by_action: dict[str, list[str]] = {}
    for fixed in group:
        by_action.setdefault(fixed.instance.action, []).append(fixed.instance.identifier)
    for action, identifiers in by_action.items():
        all_of_them = sum(1 for instance in plan.instances if instance.action == action) == len(identifiers) > 1
        names = [action] if all_of_them and action not in plan.instance else identifiers
        yield from (f"duration:{name}" for name in names)
