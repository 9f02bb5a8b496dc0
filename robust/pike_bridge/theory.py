"""Propositional state logic: formulas over assignments to finite-domain variables [PIKE §5.3]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias, assert_never

from robust.pike_bridge.model import Assignment, Guard


@dataclass(frozen=True, slots=True)
class Is:
    """`variable = value`."""

    assignment: Assignment


@dataclass(frozen=True, slots=True)
class Not:
    operand: Formula


@dataclass(frozen=True, slots=True)
class All:
    """A conjunction; true without operands."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """A disjunction; false without operands."""

    operands: tuple[Formula, ...]


Formula: TypeAlias = Is | Not | All | Some


def conjunction(guard: Guard) -> All:
    """The conjunction of a guard's assignments, in sorted order."""
    return All(tuple(Is(assignment) for assignment in sorted(guard)))


def implies(condition: Formula, consequence: Formula) -> Formula:
    return Some((Not(condition), consequence))


@dataclass(frozen=True, slots=True)
class Theory:
    """Constraints over finite-domain variables; conflicts are environments that must not hold.

    A model is an assignment to all variables that satisfies every constraint and resolves every conflict.
    """

    domains: Mapping[str, tuple[str, ...]]
    constraints: tuple[Formula, ...] = ()
    conflicts: tuple[Guard, ...] = ()


def satisfies(scenario: Mapping[str, str], formula: Formula) -> bool:
    """Whether a full assignment satisfies a formula."""
    match formula:
        case Is(assignment):
            return scenario[assignment.variable] == assignment.value
        case Not(operand):
            return not satisfies(scenario, operand)
        case All(operands):
            return all(satisfies(scenario, operand) for operand in operands)
        case Some(operands):
            return any(satisfies(scenario, operand) for operand in operands)
        case _:
            assert_never(formula)


def is_model(scenario: Mapping[str, str], theory: Theory) -> bool:
    """Whether a full assignment is a model of a theory, by looking at each constraint and conflict."""
    return all(satisfies(scenario, constraint) for constraint in theory.constraints) and not any(
        all(scenario[variable] == value for variable, value in conflict) for conflict in theory.conflicts
    )
