"""Propositional state logic: formulas and theories over assignments to finite-domain variables [PIKE §5.3].

Formulas may be very deep, so that everything here goes through them without recursion, by :func:`fold`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias, TypeVar, assert_never

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment, Guard

T = TypeVar("T")


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


TRUE: Final = All(())
FALSE: Final = Some(())


def operands(formula: Formula) -> tuple[Formula, ...]:
    """The immediate subformulas."""
    match formula:
        case Is():
            return ()
        case Not(operand):
            return (operand,)
        case All(parts) | Some(parts):
            return parts
        case _:
            assert_never(formula)


def _bottom_up(formula: Formula) -> list[Formula]:
    """All subformulas, each after its operands; repeated ones as often as they occur."""
    order: list[Formula] = []
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        order.append(one)
        stack.extend(operands(one))
    return order[::-1]


def fold(formula: Formula, combine: Callable[[Formula, list[T]], T]) -> T:
    """The value of a formula, computed from those of its operands, bottom up."""
    values: dict[int, T] = {}  # by identity: hashing a deep formula would recurse
    for one in _bottom_up(formula):
        if id(one) not in values:
            values[id(one)] = combine(one, [values[id(operand)] for operand in operands(one)])
    return values[id(formula)]


def interpret(
    formula: Formula,
    assignment: Callable[[Assignment], T],
    negation: Callable[[T], T],
    conjunction: Callable[[list[T]], T],
    disjunction: Callable[[list[T]], T],
) -> T:
    """The value of a formula, where each connective is given by what it does to values."""

    def combine(one: Formula, parts: list[T]) -> T:
        match one:
            case Is(made):
                return assignment(made)
            case Not():
                return negation(parts[0])
            case All():
                return conjunction(parts)
            case Some():
                return disjunction(parts)
            case _:
                assert_never(one)

    return fold(formula, combine)


def satisfies(scenario: Mapping[str, str], formula: Formula) -> bool:
    """Whether a full assignment satisfies a formula."""
    return interpret(formula, lambda made: scenario[made.variable] == made.value, lambda one: not one, all, any)


def is_model(scenario: Mapping[str, str], theory: Theory) -> bool:
    """Whether a full assignment is a model of a theory, by looking at each constraint and conflict."""
    return all(satisfies(scenario, constraint) for constraint in theory.constraints) and not any(
        all(scenario[variable] == value for variable, value in conflict) for conflict in theory.conflicts
    )


def conjunction_of(formulas: Iterable[Formula]) -> Formula:
    """All of the formulas, with constants folded and nested conjunctions flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == FALSE:
            return FALSE
        parts.extend(formula.operands if isinstance(formula, All) else (formula,))
    return parts[0] if len(parts) == 1 else All(tuple(parts))


def disjunction_of(formulas: Iterable[Formula]) -> Formula:
    """Some of the formulas, with constants folded and nested disjunctions flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == TRUE:
            return TRUE
        parts.extend(formula.operands if isinstance(formula, Some) else (formula,))
    return parts[0] if len(parts) == 1 else Some(tuple(parts))


def normal_form(formula: Formula, literal: Callable[[Assignment, bool], Formula]) -> Formula:
    """The formula with negations pushed inwards by De Morgan's laws, and constants folded [PIKE §5.3].

    Args:
        literal: what an assignment (True) or its negation (False) becomes.
    """
    # The value of a formula is its normal form with that of its negation.
    both: tuple[Formula, Formula] = interpret(
        formula,
        lambda made: (literal(made, True), literal(made, False)),
        lambda pair: (pair[1], pair[0]),
        lambda pairs: (conjunction_of(each[0] for each in pairs), disjunction_of(each[1] for each in pairs)),
        lambda pairs: (disjunction_of(each[0] for each in pairs), conjunction_of(each[1] for each in pairs)),
    )
    return both[0]


def assignments_of(formula: Formula) -> set[Assignment]:
    """Every assignment that a formula mentions."""
    return {one.assignment for one in _bottom_up(formula) if isinstance(one, Is)}


def is_consistent(environment: Guard) -> bool:
    """Whether no variable has two values."""
    return len({assignment.variable for assignment in environment}) == len(environment)


def check_assignments(assignments: Iterable[Assignment], theory: Theory, where: str) -> None:
    """Reject what is not an assignment to a variable of the theory.

    Raises:
        InputError: naming the first such variable or value.
    """
    for variable, value in sorted(assignments):
        if variable not in theory.domains:
            raise InputError(f"{where} mentions unknown variable {variable!r}{did_you_mean(variable, theory.domains)}")
        if value not in theory.domains[variable]:
            hint = did_you_mean(value, theory.domains[variable])
            raise InputError(f"{where} has {variable} = {value}, but {value!r} is not a value of {variable}{hint}")


def check_theory(theory: Theory) -> None:
    """Reject theories whose variables have no values or repeat them, and formulas about other variables or values.

    Raises:
        InputError: naming what is wrong.
    """
    for variable, values in theory.domains.items():
        if not values or len(set(values)) < len(values):
            raise InputError(f"variable {variable!r} has the values {values!r}; expected at least one, all different")
    for formula in theory.constraints:
        check_assignments(assignments_of(formula), theory, "a constraint")
    for conflict in theory.conflicts:
        check_assignments(conflict, theory, "a conflict")
