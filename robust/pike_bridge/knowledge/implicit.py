"""All prime implicants of a decision diagram, as another one, without listing them.

The recursion of Coudert and Madre ("Implicit and incremental computation of primes and essential primes of Boolean
functions", 1992), for variables with any number of values: a prime implicant that does not mention x is one of the
conjunction of all cofactors, and one with x = v is one of that cofactor, unless it does without x.
"""

from __future__ import annotations

from functools import reduce
from typing import Any, Protocol

from robust.pike_bridge.knowledge.families import NOTHING, UNIT, Families, evaluate
from robust.smt.limits import Deadline


class Functions(Protocol):
    """Functions over finite-domain variables, which can be compared, hashed, and conjoined by `&`."""

    def top(self, function: Any) -> int | None:
        """The first variable that a function depends on; None for constants."""

    def cofactors(self, function: Any, variable: int) -> list[Any]:
        """What is left of a function for each value of a variable."""

    def is_false(self, function: Any) -> bool:
        """Whether a function is the constant."""


def primes(root: Any, functions: Functions, families: Families, deadline: Deadline) -> int:
    """The prime implicants of a function, as one of the families.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    known: dict[Any, int] = {}

    def step(function: Any) -> int | list[Any]:
        variable = functions.top(function)
        if variable is None:
            return NOTHING if functions.is_false(function) else UNIT
        parts = functions.cofactors(function, variable)
        always = reduce(lambda first, second: first & second, parts)
        missing = [each for each in (always, *parts) if each not in known]
        if missing:
            return missing
        without = known[always]
        assigned = tuple(families.difference(known[part], without, deadline) for part in parts)
        return families.branch(variable, without, assigned)

    return evaluate(root, known, step, deadline)
