"""Which time points an obligation depends on: its own, and those of all changes that what it reads comes from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from robust.plan.interference import mutex_pairs
from robust.plan.model import (
    ActionInstance,
    Atom,
    Comparison,
    Condition,
    Duration,
    Expression,
    Fluent,
    Holds,
    ParametrizedPlan,
    TimePoint,
    Timing,
)
from robust.plan.timeline import leaves

Variable = Atom | Fluent


@dataclass(frozen=True, slots=True)
class _Use:
    """What is read, and where: `points` matter by themselves, `variables` by who changes them."""

    points: frozenset[TimePoint]
    variables: frozenset[Variable]


def influences(plan: ParametrizedPlan, obligation: str) -> frozenset[TimePoint]:
    """The time points on whose distances it depends whether a schedule breaks the obligation of that name.

    All time points for a name that is not known here.
    """
    use = _obligation(plan, obligation)
    if use is None:
        return frozenset(plan.time_points)
    writers = _writers(plan)
    points, known = set(use.points), set(use.variables)
    pending = list(use.variables)
    while pending:
        for written in writers.get(pending.pop(), ()):
            points |= written.points
            new = written.variables - known
            known |= new
            pending.extend(new)
    return frozenset(points)


def _obligation(plan: ParametrizedPlan, name: str) -> _Use | None:
    for goal in plan.goal:
        if goal.label == name:
            return _use((), None, [goal.condition], ())
    for instance in plan.instances:
        for part in instance.durations:
            if instance.label(part) == name:
                return _use(instance.time_points, instance, [part.condition], ())
        for condition in instance.conditions:
            if instance.label(condition) == name:
                over_all = condition.timing is Timing.OVER_ALL
                points = instance.time_points if over_all else (instance.at(condition.timing),)
                return _use(points, instance, [condition.condition], ())
    pair = next((pair for pair in mutex_pairs(plan) if f"separation: {pair[0]}, {pair[1]}" == name), None)
    return None if pair is None else _Use(frozenset(pair), frozenset())


def _writers(plan: ParametrizedPlan) -> dict[Variable, list[_Use]]:
    """For every atom and fluent, the changes of it: when they happen and what they depend on."""
    found: dict[Variable, list[_Use]] = {}
    for instance in plan.instances:
        for effect in instance.atom_effects:
            use = _use((instance.at(effect.timing),), instance, [effect.condition], ())
            found.setdefault(effect.atom, []).append(use)
        for numeric in instance.numeric_effects:
            use = _use((instance.at(numeric.timing),), instance, [numeric.condition], [numeric.expression])
            found.setdefault(numeric.fluent, []).append(use)
        for continuous in instance.continuous_effects:
            use = _use(instance.time_points, instance, (), [continuous.rate])
            found.setdefault(continuous.fluent, []).append(use)
    for literal in plan.timed_literals:
        found.setdefault(literal.target, []).append(_Use(frozenset({literal.point}), frozenset()))
    return found


def _use(
    points: Iterable[TimePoint],
    instance: ActionInstance | None,
    conditions: Iterable[Condition],
    expressions: Iterable[Expression],
) -> _Use:
    used = set(points)
    variables: set[Variable] = set()
    for condition in conditions:
        variables |= {leaf.atom for leaf in leaves(condition) if isinstance(leaf, Holds)}
    for expression in (*expressions, *_compared(conditions)):
        variables |= {variable for variable in expression.variables if isinstance(variable, Fluent)}
        if instance is not None and any(isinstance(variable, Duration) for variable in expression.variables):
            used |= set(instance.time_points)
    return _Use(frozenset(used), frozenset(variables))


def _compared(conditions: Iterable[Condition]) -> Iterator[Expression]:
    for condition in conditions:
        for leaf in leaves(condition):
            if isinstance(leaf, Comparison):
                yield leaf.expression
