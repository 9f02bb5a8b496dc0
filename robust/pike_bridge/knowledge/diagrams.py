"""Decision diagrams over finite-domain variables: functions, sets of environments, and the one's prime implicants as
one of the others.

Variables are numbered in their order, and so are the values of each. A node is numbered once for all: what is equal has
equal numbers. All algorithms remember what they found, and none recurses.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import prod
from typing import Final, NamedTuple, TypeAlias

from robust.pike_bridge.knowledge.interface import OutOfSpaceError
from robust.pike_bridge.theory import evaluate
from robust.smt.limits import NEVER, Deadline

Choice: TypeAlias = tuple[int, int]
"""A variable and one of its values, both by number."""

FALSE: Final = 0
TRUE: Final = 1
"""The constant functions."""
_LEAF: Final = sys.maxsize
"""In place of a variable, after all of them."""
_UNKNOWN: Final = -1


class Functions:
    """Truth values that depend on variables, each function by a number.

    Args:
        sizes: how many values each variable has.
        largest: how many nodes and results may be remembered; OutOfSpaceError beyond.
    """

    def __init__(self, sizes: Sequence[int], largest: int = sys.maxsize) -> None:
        self.sizes = tuple(sizes)
        self.largest = largest
        self._variables = [_LEAF, _LEAF]
        self._parts: list[tuple[int, ...]] = [(), ()]
        self._numbers: dict[tuple[int, tuple[int, ...]], int] = {}
        self._conjunctions: dict[tuple[int, int], int] = {}
        self._primes: dict[int, int] = {FALSE: NOTHING, TRUE: UNIT}
        self.families = Families()

    def branch(self, variable: int, parts: tuple[int, ...]) -> int:
        """The function that is one of the parts, by the value of a variable; these depend on later variables only."""
        if parts.count(parts[0]) == len(parts):
            return parts[0]
        number = self._numbers.get((variable, parts))
        if number is None:
            number = self._numbers[variable, parts] = len(self._parts)
            self._variables.append(variable)
            self._parts.append(parts)
        return number

    def assigned(self, variable: int, number: int) -> int:
        """That a variable has a value."""
        return self.branch(variable, tuple(int(each == number) for each in range(self.sizes[variable])))

    def excluded(self, environment: Iterable[Choice]) -> int:
        """That not all assignments of a consistent environment hold."""
        function = FALSE
        for variable, number in sorted(environment, reverse=True):
            parts = [TRUE] * self.sizes[variable]
            parts[number] = function
            function = self.branch(variable, tuple(parts))
        return function

    def some(self, environments: Iterable[Collection[Choice]], deadline: Deadline = NEVER) -> int:
        """That all assignments of at least one environment hold."""

        def step(left: frozenset[tuple[Choice, ...]]) -> int | list[frozenset[tuple[Choice, ...]]]:
            if () in left or not left:
                return TRUE if left else FALSE
            variable = min(one[0][0] for one in left)
            parts = []
            for number in range(self.sizes[variable]):
                kept = (one for one in left if one[0][0] != variable or one[0][1] == number)
                parts.append(frozenset(one[1:] if one[0][0] == variable else one for one in kept))
            missing = [part for part in parts if part not in known]
            return missing or self.branch(variable, tuple(known[part] for part in parts))

        known: dict[frozenset[tuple[Choice, ...]], int] = {}
        return evaluate(frozenset(tuple(sorted(each)) for each in environments), known, step, deadline)

    def all(self, functions: Sequence[int], deadline: Deadline = NEVER) -> int:
        """The conjunction; neighbours are joined first, so that they should be about much the same variables.

        Raises:
            OutOfTimeError: if the deadline passes, or there is too much to remember.
        """
        left = list(functions) or [TRUE]
        while len(left) > 1:
            pairs = zip(left[::2], left[1::2], strict=False)
            odd = left[-1:] if len(left) % 2 else []
            left = [self.both(first, second, deadline) for first, second in pairs] + odd
        return left[0]

    def both(self, first: int, second: int, deadline: Deadline = NEVER) -> int:
        """The conjunction of two; errors as of :meth:`all`."""
        known = self._meet(first, second)
        if known != _UNKNOWN:
            return known
        return evaluate((min(first, second), max(first, second)), self._conjunctions, self._both, deadline)

    def _both(self, pair: tuple[int, int]) -> int | list[tuple[int, int]]:
        first, second = pair
        variable = min(self._variables[first], self._variables[second])
        pairs = zip(self._at(first, variable), self._at(second, variable), strict=True)
        missing, parts = [], []
        for one, other in pairs:
            known = self._meet(one, other)
            parts.append(known)
            if known == _UNKNOWN:
                missing.append((one, other) if one < other else (other, one))
        self._look(len(self._conjunctions))
        return missing or self.branch(variable, tuple(parts))

    def _look(self, remembered: int) -> None:
        if len(self._parts) + remembered > self.largest:
            raise OutOfSpaceError

    def _meet(self, first: int, second: int) -> int:
        """The conjunction if it is known already."""
        if first > second:
            first, second = second, first
        if first in (FALSE, second):
            return first
        return second if first == TRUE else self._conjunctions.get((first, second), _UNKNOWN)

    def _at(self, function: int, variable: int) -> tuple[int, ...]:
        """What is left of a function for each value of a variable that nothing before it depends on."""
        if self._variables[function] == variable:
            return self._parts[function]
        return (function,) * self.sizes[variable]

    def size(self, functions: Iterable[int]) -> int:
        """How many nodes some functions have together."""
        seen = set(functions)
        stack = list(seen)
        while stack:
            new = set(self._parts[stack.pop()]) - seen
            seen |= new
            stack += new
        return len(seen)

    def find(
        self, function: int, forbidden: Collection[Choice], preferred: Mapping[int, int], deadline: Deadline = NEVER
    ) -> dict[int, int] | None:
        """Assignments that a function is true of, whatever variables without one are; None if there are none.

        Args:
            forbidden: what none of them may be.
            preferred: a value of every variable, which it gets if that is possible, given those of earlier variables.
        """
        stack: list[tuple[int, tuple[Choice, ...]]] = [(function, ())]
        refuted: set[int] = {FALSE}
        while stack:
            deadline.enforce()
            one, made = stack.pop()
            if one == TRUE:
                return dict(made)
            if one not in refuted:
                refuted.add(one)  # when it is met again: all that is on top of the stack is looked at before
                variable = self._variables[one]
                first = preferred[variable]
                choices = [(variable, number) for number in range(self.sizes[variable]) if number != first]
                for choice in (*reversed(choices), (variable, first)):
                    if choice not in forbidden:
                        stack.append((self._parts[one][choice[1]], (*made, choice)))
        return None

    def count(self, function: int, deadline: Deadline = NEVER) -> int:
        """Of how many assignments to all variables a function is true."""
        known = {FALSE: 0, TRUE: 1}
        ends = len(self.sizes)

        def place(one: int) -> int:
            return min(self._variables[one], ends)

        def step(one: int) -> int | list[int]:
            parts = self._parts[one]
            missing = [part for part in parts if part not in known]
            after = place(one) + 1
            return missing or sum(known[part] * prod(self.sizes[after : place(part)]) for part in parts)

        return evaluate(function, known, step, deadline) * prod(self.sizes[: place(function)])

    def primes(self, function: int, deadline: Deadline = NEVER) -> int:
        """The prime implicants of a function, as one of `families`; errors as of :meth:`all`.

        Those that do not assign the first variable are the prime implicants of what holds whatever it is. Those that
        do are the prime implicants of what is left for that value, without these (Coudert and Madre, 1992).
        """

        def step(one: int) -> int | list[int]:
            parts = self._parts[one]
            always = self.all(sorted(set(parts)), deadline)
            self._look(len(self._conjunctions) + self.families.remembered)
            missing = [each for each in (always, *parts) if each not in self._primes]
            if missing:
                return missing
            without = self._primes[always]
            own = (self.families.difference(self._primes[part], without, deadline) for part in parts)
            return self.families.branch(self._variables[one], without, tuple(own))

        return evaluate(function, self._primes, step, deadline)


NOTHING: Final = 0
"""The empty set."""
UNIT: Final = 1
"""The set of the empty environment."""


class Branching(NamedTuple):
    """Environments that do not assign a variable, and those that do, by value."""

    variable: int
    unassigned: int
    assigned: tuple[int, ...]


_CONSTANT: Final = Branching(_LEAF, NOTHING, ())
"""In place of the constants."""


class Families:
    """Sets of environments, each by a number."""

    def __init__(self) -> None:
        self._branchings: list[Branching] = [_CONSTANT, _CONSTANT]
        self._numbers: dict[Branching, int] = {}
        self._differences: dict[tuple[int, int], int] = {}
        self._counts: dict[int, int] = {NOTHING: 0, UNIT: 1}

    def __len__(self) -> int:
        return len(self._branchings)

    @property
    def remembered(self) -> int:
        """How many sets and differences of two are known."""
        return len(self._branchings) + len(self._differences)

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
        known = self._known_difference(first, second)
        if known != _UNKNOWN:
            return known
        return evaluate((first, second), self._differences, self._difference, deadline)

    def count(self, family: int, deadline: Deadline) -> int:
        """How many environments a set has."""

        def step(one: int) -> int | list[int]:
            branching = self._branchings[one]
            parts = (branching.unassigned, *branching.assigned)
            missing = [part for part in parts if part not in self._counts]
            return missing or sum(map(self._counts.__getitem__, parts))

        return evaluate(family, self._counts, step, deadline)

    def environments(self, families: Sequence[int]) -> Iterator[tuple[Choice, ...]]:
        """Each union of one environment of each set, once; no two of the sets are about the same variable."""
        stack: list[tuple[tuple[int, ...], tuple[Choice, ...]]] = [(tuple(families), ())]
        while stack:
            left, made = stack.pop()
            if not left:
                yield made
                continue
            one, *others = left
            rest = tuple(others)
            if one == UNIT:
                stack.append((rest, made))
            elif one != NOTHING:
                branching = self._branchings[one]
                stack.append(((branching.unassigned, *rest), made))
                for number, part in reversed(list(enumerate(branching.assigned))):
                    stack.append(((part, *rest), (*made, (branching.variable, number))))

    def _known_difference(self, first: int, second: int) -> int:
        if first in (NOTHING, second):
            return NOTHING
        return first if second == NOTHING else self._differences.get((first, second), _UNKNOWN)

    def _difference(self, pair: tuple[int, int]) -> int | list[tuple[int, int]]:
        first, second = pair
        left, right = self._branchings[first], self._branchings[second]
        if left.variable < right.variable:
            pairs = [(left.unassigned, second)]
        elif right.variable < left.variable:
            pairs = [(first, right.unassigned)]
        else:
            pairs = [(left.unassigned, right.unassigned), *zip(left.assigned, right.assigned, strict=True)]
        known = [self._known_difference(*each) for each in pairs]
        missing = [each for each, value in zip(pairs, known, strict=True) if value == _UNKNOWN]
        if missing:
            return missing
        unassigned, *assigned = known
        if right.variable < left.variable:
            return unassigned
        return self.branch(left.variable, unassigned, tuple(assigned) or left.assigned)
