"""Changes a random plan until sampled schedules break none of its obligations.

Broken conditions are negated or dropped, broken duration constraints dropped, and mutex time points put in the order
of a reference schedule. The result is not guaranteed to be valid: that is for the code under test to find out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from random import Random
from typing import TypeVar, assert_never

from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Comparison,
    Condition,
    GoalCondition,
    Holds,
    Or,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedCondition,
    TimePoint,
    Truth,
)
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from tests.pddl_text import condition_text
from tests.sampling import sample_schedules

ROUNDS, SAMPLES = 4, 4
SEPARATION = Fraction(1, 4)
_OPPOSITE = {
    Relation.AT_LEAST: Relation.GREATER,
    Relation.GREATER: Relation.AT_LEAST,
    Relation.EQUAL: Relation.DIFFERENT,
    Relation.DIFFERENT: Relation.EQUAL,
}
Part = TypeVar("Part", TimedCondition, GoalCondition)


def tamed(plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction], random: Random) -> ParametrizedPlan:
    """The plan with fewer ways to fail at nominal parameter values; `times` says how to order mutex time points."""
    for attempt in range(ROUNDS):
        schedules = sample_schedules(plan, plan.nominal, random, SAMPLES)
        simulations = (simulate(plan, plan.nominal, schedule) for schedule in schedules)
        broken = {violation.obligation for simulation in simulations for violation in simulation.violations}
        if not broken:
            break
        negate = attempt == 0 and random.random() < 0.5
        plan = replace(
            plan,
            instances=tuple(_repaired(instance, broken, negate) for instance in plan.instances),
            constraints=(*plan.constraints, *_orders(plan, times, broken)),
            goal=tuple(_kept(((goal, goal.label) for goal in plan.goal), broken, negate)),
        )
    return plan


def _repaired(instance: ActionInstance, broken: set[str], negate: bool) -> ActionInstance:
    conditions = _kept(((part, instance.label(part)) for part in instance.conditions), broken, negate)
    by_label = {instance.label(part): part for part in conditions}
    durations = tuple(part for part in instance.durations if instance.label(part) not in broken)
    return replace(instance, durations=durations, conditions=tuple(by_label.values()))


def _kept(parts: Iterable[tuple[Part, str]], broken: set[str], negate: bool) -> list[Part]:
    kept: list[Part] = []
    for part, label in parts:
        if label not in broken:
            kept.append(part)
        elif negate:
            condition = negation(part.condition)
            kept.append(replace(part, condition=condition, text=condition_text(condition)))
    return kept


def _orders(
    plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction], broken: set[str]
) -> Iterable[TemporalConstraint]:
    for instance in plan.instances:
        if f"{instance.identifier} {instance.action}: non-negative duration" in broken:
            yield TemporalConstraint(instance.start, instance.end, Polynomial.constant(0), None)
    for a in plan.time_points:
        for b in plan.time_points:
            if f"separation: {a}, {b}" in broken:
                yield _order(*((a, b) if times[a] <= times[b] else (b, a)))


def _order(first: TimePoint, second: TimePoint) -> TemporalConstraint:
    """First before second, said without timed literals, which plan files cannot name."""
    if first.time is not None:
        return TemporalConstraint(ZERO, second, Polynomial.constant(first.time + SEPARATION), None)
    if second.time is not None:
        return TemporalConstraint(ZERO, first, None, Polynomial.constant(second.time - SEPARATION))
    return TemporalConstraint(first, second, Polynomial.constant(SEPARATION), None)


def negation(condition: Condition) -> Condition:
    """The negation, in negation normal form."""
    match condition:
        case Truth(value):
            return Truth(not value)
        case Holds(atom, value):
            return Holds(atom, not value)
        case Comparison(expression, relation):
            reversed_sign = relation in {Relation.AT_LEAST, Relation.GREATER}
            return Comparison(-expression if reversed_sign else expression, _OPPOSITE[relation])
        case And(operands):
            return Or(tuple(negation(operand) for operand in operands))
        case Or(operands):
            return And(tuple(negation(operand) for operand in operands))
    assert_never(condition)
