"""Which time points of a plan are mutex: the no-moving-targets rule of PDDL 2.1, for the simulator [docs/semantics.md].

Reads are syntactic on the ground conditions. Over-all conditions do not count. A continuous effect increases its fluent
at both ends of its action and its rate is read there. A time point that adds and deletes the same atom does both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

from robust.plan.model import (
    ZERO,
    ActionInstance,
    Assignment,
    Atom,
    Comparison,
    Condition,
    DurationConstraint,
    Expression,
    Fluent,
    Holds,
    ParametrizedPlan,
    TimedCondition,
    TimedLiteral,
    TimePoint,
    TimePointKind,
    Timing,
)
from robust.plan.timeline import leaves


@dataclass(slots=True)
class _Footprint:
    """What one time point reads and writes."""

    atoms_read: set[Atom] = field(default_factory=set)
    adds: set[Atom] = field(default_factory=set)
    deletes: set[Atom] = field(default_factory=set)
    fluents_read: set[Fluent] = field(default_factory=set)
    assigns: set[Fluent] = field(default_factory=set)
    increases: set[Fluent] = field(default_factory=set)

    def read_expression(self, expression: Expression) -> None:
        self.fluents_read.update(variable for variable in expression.variables if isinstance(variable, Fluent))

    def read(self, condition: Condition) -> None:
        for leaf in leaves(condition):
            if isinstance(leaf, Holds):
                self.atoms_read.add(leaf.atom)
            elif isinstance(leaf, Comparison):
                self.read_expression(leaf.expression)


def mutex_pairs(plan: ParametrizedPlan) -> Iterator[tuple[TimePoint, TimePoint]]:
    """The pairs of distinct time points that must be separated, each in the order of `plan.time_points`.

    Neither is zero, and timed literals are not mutex among themselves.
    """
    footprints = {point: _Footprint() for point in plan.time_points if point != ZERO}
    for instance in plan.instances:
        for point in instance.time_points:
            _enter_instance(footprints[point], instance, point)
    for literal in plan.timed_literals:
        _enter_timed_literal(footprints[literal.point], literal)
    for (a, of_a), (b, of_b) in combinations(footprints.items(), 2):
        both_timed = a.kind is b.kind is TimePointKind.TIMED_LITERAL
        if not both_timed and (_disturbs(of_a, of_b) or _disturbs(of_b, of_a)):
            yield a, b


def _enter_instance(footprint: _Footprint, instance: ActionInstance, point: TimePoint) -> None:
    """Add what `instance` reads and writes at `point`, its start or its end."""
    parts: tuple[DurationConstraint | TimedCondition, ...] = (*instance.durations, *instance.conditions)
    for part in parts:
        if part.timing is not Timing.OVER_ALL and instance.at(part.timing) == point:
            footprint.read(part.condition)
    for atom_effect in instance.atom_effects:
        if instance.at(atom_effect.timing) == point:
            footprint.read(atom_effect.condition)
            (footprint.adds if atom_effect.value else footprint.deletes).add(atom_effect.atom)
    for effect in instance.numeric_effects:
        if instance.at(effect.timing) == point:
            footprint.read(effect.condition)
            footprint.read_expression(effect.expression)
            assigns = effect.operator is Assignment.ASSIGN
            (footprint.assigns if assigns else footprint.increases).add(effect.fluent)
    for continuous in instance.continuous_effects:
        footprint.read_expression(continuous.rate)
        footprint.increases.add(continuous.fluent)


def _enter_timed_literal(footprint: _Footprint, literal: TimedLiteral) -> None:
    if isinstance(literal.target, Fluent):
        footprint.assigns.add(literal.target)
    else:
        (footprint.adds if literal.value else footprint.deletes).add(literal.target)


def _disturbs(writer: _Footprint, other: _Footprint) -> bool:
    """Whether what `writer` writes touches what `other` reads or writes (the half of the rule seen from one side)."""
    return bool(
        (writer.adds | writer.deletes) & other.atoms_read
        or writer.adds & other.deletes
        or (writer.assigns | writer.increases) & other.fluents_read
        or writer.assigns & (other.assigns | other.increases)
    )
