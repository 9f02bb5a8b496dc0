"""Environments as bit masks: conjunctions of assignments to finite-domain variables in one integer each.

Of an environment over a vocabulary with n assignments, bit i says that assignment i is made, and bit n + i that
assignment i is excluded, because its variable has another value. So conjunction is `a | b`, entailment is containment
of bits, and an environment is self-consistent if no assignment is both made and excluded. Source: [PIKE, Definitions
2.2 to 2.4].
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from typing import Final, TypeAlias

from robust.pike_bridge.model import Assignment, Guard

Environment: TypeAlias = int
"""A conjunction of assignments, as a bit mask of some :class:`Vocabulary`."""

EMPTY: Final[Environment] = 0
"""The environment that assigns nothing: true."""


def entails(specific: Environment, general: Environment) -> bool:
    """Whether every scenario of the first environment is one of the second's."""
    return specific & general == general


class Vocabulary:
    """The assignments to a fixed list of variables, and their environments."""

    def __init__(self, domains: Mapping[str, Sequence[str]]) -> None:
        self.variables: Final = tuple(domains)
        self.domains: Final = {variable: tuple(values) for variable, values in domains.items()}
        self.assignments: Final = tuple(
            Assignment(variable, value) for variable, values in self.domains.items() for value in values
        )
        self.width: Final = len(self.assignments)
        self.made: Final = (1 << self.width) - 1
        """The bits of assignments made, without those of assignments excluded."""
        self._bits: dict[Assignment, Environment] = {}
        self._fields: dict[str, int] = {}
        position = 0
        for variable, values in self.domains.items():
            field = ((1 << len(values)) - 1) << position
            self._fields[variable] = field
            for value in values:
                bit = 1 << position
                self._bits[Assignment(variable, value)] = bit | (field ^ bit) << self.width
                position += 1

    def assign(self, variable: str, value: str) -> Environment:
        """The environment of one assignment; KeyError if there is no such assignment."""
        return self._bits[Assignment(variable, value)]

    def field(self, variable: str) -> int:
        """The bits of all assignments to a variable, among `made`."""
        return self._fields[variable]

    def encode(self, assignments: Guard | Iterable[Assignment]) -> Environment:
        """The conjunction of assignments, which may be inconsistent; KeyError for an unknown one."""
        environment = EMPTY
        for assignment in assignments:
            environment |= self._bits[assignment]
        return environment

    def decode(self, environment: Environment) -> Guard:
        """The assignments that an environment makes."""
        return frozenset(self.assignments[position] for position in bits(environment & self.made))

    def consistent(self, environment: Environment) -> bool:
        """Whether no variable has two values."""
        return not environment & environment >> self.width & self.made

    def disjoint(self, first: Environment, second: Environment) -> bool:
        """Whether no scenario belongs to both: some variable has different values in them."""
        return not self.consistent(first | second)

    def assigned(self, environment: Environment) -> tuple[str, ...]:
        """The variables that have a value, in the order of the vocabulary."""
        return tuple(self.assignments[position].variable for position in bits(environment & self.made))

    def mentions(self, environment: Environment, variable: str) -> bool:
        """Whether the environment assigns the variable."""
        return bool(environment & self._fields[variable])

    def without(self, environment: Environment, variable: str) -> Environment:
        """The environment with the assignment to a variable, if any, removed."""
        field = self._fields[variable]
        return environment & ~(field | field << self.width)

    def scenarios(self, environment: Environment = EMPTY) -> Iterator[Environment]:
        """Every full assignment that entails the environment [PIKE, Definition 2.4]."""
        free = [variable for variable in self.variables if not self.mentions(environment, variable)]
        for values in product(*(self.domains[variable] for variable in free)):
            scenario = environment
            for variable, value in zip(free, values, strict=True):
                scenario |= self._bits[Assignment(variable, value)]
            yield scenario

    def count(self, environment: Environment = EMPTY) -> int:
        """How many scenarios entail the (self-consistent) environment."""
        return prod(
            len(values) for variable, values in self.domains.items() if not self.mentions(environment, variable)
        )

    def text(self, environment: Environment) -> str:
        """`{x = 1, y = 2}`, in the order of the vocabulary."""
        return "{" + ", ".join(str(self.assignments[at]) for at in bits(environment & self.made)) + "}"


def bits(mask: int) -> Iterator[int]:
    """The positions of the bits that are set, from the lowest."""
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
