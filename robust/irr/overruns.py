"""By how much each action may exceed its planned duration, as far as an envelope proves it.

A box is a product: each parameter may have any of its values, whatever the others have. So if no parameter of the
duration of an instance is used for anything else, each instance may take any duration up to what the box allows it,
whatever the others take. If an executor knows one share per action, then the least of its instances holds for all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from robust.encode import network
from robust.plan import model
from robust.plan.model import ActionInstance, ParameterReference, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box

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
    """Of all instances of an action: the least share, or None if none of them limits it.

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
    """What a duration is at most, and at least."""

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
