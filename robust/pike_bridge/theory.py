"""Propositional state logic: formulas and theories over assignments to finite-domain variables [PIKE §5.3].

Formulas may be very deep, so that everything here goes through them without recursion, by :func:`fold`.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias, TypeVar, assert_never

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment, Guard
from robust.smt.limits import Deadline

T = TypeVar("T")
Key = TypeVar("Key", bound=Hashable)


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


def evaluate(key: Key, known: dict[Key, T], step: Callable[[Key], T | list[Key]], deadline: Deadline) -> T:
    """The value of a key, by depth-first search without recursion.

    Args:
        known: values so far, to which all new ones are added.
        step: the value of a key, or the keys whose values must be known first.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [key]
    while stack:
        deadline.enforce()
        one = stack[-1]
        if one in known:
            stack.pop()
            continue
        result = step(one)
        if isinstance(result, list):
            stack += result
        else:
            known[one] = result
            stack.pop()
    return known[key]


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


def joined(kind: type[All | Some], formulas: Iterable[Formula]) -> Formula:
    """All or some of the formulas, with constants folded and nested junctions of the same kind flattened."""
    parts: list[Formula] = []
    for formula in formulas:
        if formula == (FALSE if kind is All else TRUE):
            return formula
        parts.extend(formula.operands if isinstance(formula, kind) else (formula,))
    return parts[0] if len(parts) == 1 else kind(tuple(parts))


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
        lambda pairs: (joined(All, (each[0] for each in pairs)), joined(Some, (each[1] for each in pairs))),
        lambda pairs: (joined(Some, (each[0] for each in pairs)), joined(All, (each[1] for each in pairs))),
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
