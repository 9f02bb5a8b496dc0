"""Commitments in the form in which knowledge bases use them: one environment and some conflicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import assert_never

from robust.pike_bridge.knowledge.formulas import check_assignments
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import Theory


@dataclass(frozen=True, slots=True)
class Narrowing:
    """What commitments come to: the conjunction of all assignments, and the conflicts that it does not resolve."""

    required: Mapping[str, str]
    conflicts: tuple[Guard, ...]
    """Without what is required already; a conflict that is manifested has become the empty environment."""
    consistent: bool
    """Whether no variable got two values, and no conflict is manifested."""


def narrowing(commitments: Sequence[Commitment], theory: Theory) -> Narrowing:
    """The conjunction of commitments.

    Raises:
        InputError: if a variable or a value is unknown.
    """
    required: dict[str, str] = {}
    excluded: list[Guard] = []
    consistent = True
    for commitment in commitments:
        check_assignments(commitment.environment, theory, "a commitment")
        match commitment:
            case Require(environment):
                for variable, value in environment:
                    consistent = required.setdefault(variable, value) == value and consistent
            case Exclude(environment):
                if is_consistent(environment):
                    excluded.append(environment)
            case _:
                assert_never(commitment)
    conflicts = tuple(dict.fromkeys(_left(each, required) for each in excluded if not _resolves(required, each)))
    return Narrowing(required, conflicts, consistent and frozenset() not in conflicts)


def is_consistent(environment: Guard) -> bool:
    """Whether no variable has two values."""
    return len({assignment.variable for assignment in environment}) == len(environment)


def _resolves(required: Mapping[str, str], conflict: Guard) -> bool:
    return any(required.get(variable, value) != value for variable, value in conflict)


def _left(conflict: Guard, required: Mapping[str, str]) -> Guard:
    return frozenset(Assignment(variable, value) for variable, value in conflict if variable not in required)
