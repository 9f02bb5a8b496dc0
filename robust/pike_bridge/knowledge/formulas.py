"""Traversals of propositional formulas that no depth can break, and their normal forms."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar, assert_never

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory

T = TypeVar("T")

TRUE = All(())
FALSE = Some(())


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


def fold(formula: Formula, combine: Callable[[Formula, list[T]], T]) -> T:
    """The value of a formula, computed from those of its operands, bottom up."""
    order: list[Formula] = []
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        order.append(one)
        stack.extend(operands(one))
    values: dict[int, T] = {}  # by identity: hashing a deep formula would recurse
    for one in reversed(order):
        if id(one) not in values:
            values[id(one)] = combine(one, [values[id(operand)] for operand in operands(one)])
    return values[id(formula)]


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

    def both(one: Formula, parts: list[tuple[Formula, Formula]]) -> tuple[Formula, Formula]:
        """The normal forms of a formula and of its negation."""
        match one:
            case Is(assignment):
                return literal(assignment, True), literal(assignment, False)
            case Not():
                return parts[0][1], parts[0][0]
            case All():
                return conjunction_of(part[0] for part in parts), disjunction_of(part[1] for part in parts)
            case Some():
                return disjunction_of(part[0] for part in parts), conjunction_of(part[1] for part in parts)
            case _:
                assert_never(one)

    return fold(formula, both)[0]


def assignments_of(formula: Formula) -> set[Assignment]:
    """Every assignment that a formula mentions."""
    found: set[Assignment] = set()
    stack = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, Is):
            found.add(one.assignment)
        stack.extend(operands(one))
    return found


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
