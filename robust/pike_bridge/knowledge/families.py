"""Sets of environments as decision diagrams over finite-domain variables, in which variables may stay unassigned.

A zero-suppressed diagram (Minato, 1993) with one branch for each value and one for "not assigned": it shares what
environments have in common, so that sets of any size may be small.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Hashable, Iterator
from typing import Final, NamedTuple, TypeVar

from robust.smt.limits import Deadline

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")

NOTHING: Final = 0
"""The empty set."""
UNIT: Final = 1
"""The set of the empty environment."""


class Branching(NamedTuple):
    """Environments that do not assign a variable, and those that do, by value."""

    variable: int
    unassigned: int
    assigned: tuple[int, ...]


def evaluate(key: Key, known: dict[Key, Value], step: Callable[[Key], Value | list[Key]], deadline: Deadline) -> Value:
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


_CONSTANT: Final = Branching(sys.maxsize, NOTHING, ())
"""In place of the constants, after all variables."""


class Families:
    """Sets of environments, each by a number; equal sets have equal numbers. Variables are numbered in their order."""

    def __init__(self) -> None:
        self._branchings: list[Branching] = [_CONSTANT, _CONSTANT]
        self._numbers: dict[Branching, int] = {}
        self._differences: dict[tuple[int, int], int] = {}
        self._counts: dict[int, int] = {NOTHING: 0, UNIT: 1}

    def __len__(self) -> int:
        return len(self._branchings)

    def branch(self, variable: int, unassigned: int, assigned: tuple[int, ...]) -> int:
        """The set with these parts, which mention later variables only."""
        if not any(assigned):
            return unassigned
        branching = Branching(variable, unassigned, assigned)
        if branching not in self._numbers:
            self._numbers[branching] = len(self._branchings)
            self._branchings.append(branching)
        return self._numbers[branching]

    def difference(self, first: int, second: int, deadline: Deadline) -> int:
        """The environments of the first set that are not in the second."""
        return evaluate((first, second), self._differences, self._difference, deadline)

    def count(self, family: int, deadline: Deadline) -> int:
        """How many environments a set has."""

        def step(one: int) -> int | list[int]:
            branching = self._branchings[one]
            parts = (branching.unassigned, *branching.assigned)
            missing = [part for part in parts if part not in self._counts]
            return missing or sum(map(self._counts.__getitem__, parts))

        return evaluate(family, self._counts, step, deadline)

    def environments(self, family: int) -> Iterator[tuple[tuple[int, int], ...]]:
        """Each environment of a set, once, as variables with the numbers of their values."""
        stack: list[tuple[int, tuple[tuple[int, int], ...]]] = [(family, ())]
        while stack:
            one, made = stack.pop()
            if one in (NOTHING, UNIT):
                if one == UNIT:
                    yield made
                continue
            branching = self._branchings[one]
            stack.append((branching.unassigned, made))
            for number, part in enumerate(branching.assigned):
                stack.append((part, (*made, (branching.variable, number))))

    def _difference(self, pair: tuple[int, int]) -> int | list[tuple[int, int]]:
        first, second = pair
        if first in (NOTHING, second):
            return NOTHING
        if second == NOTHING:
            return first
        left, right = self._branchings[first], self._branchings[second]
        if left.variable < right.variable:
            pairs = [(left.unassigned, second)]
        elif right.variable < left.variable:
            pairs = [(first, right.unassigned)]
        else:
            pairs = [(left.unassigned, right.unassigned), *zip(left.assigned, right.assigned, strict=True)]
        missing = [each for each in pairs if each not in self._differences]
        if missing:
            return missing
        unassigned, *assigned = map(self._differences.__getitem__, pairs)
        if right.variable < left.variable:
            return unassigned
        return self.branch(left.variable, unassigned, tuple(assigned) or left.assigned)
