"""What elimination back ends are given and give back."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

from robust.errors import UnsupportedError
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import TRUE, FormulaReader, Nnf, conjunction, disjunction, names_in
from robust.smt.limits import Deadline
from robust.smt.session import Session, Statistics, Terms


@dataclass(frozen=True, eq=False)
class Definition:
    """A formula that for all values of the other symbols has a value of `symbol` that satisfies it."""

    symbol: str
    formula: Nnf


@dataclass(frozen=True, eq=False)
class Query:
    """`∃ eliminated. network ∧ violation ∧ remainder ∧ definitions`, over the kept symbols.

    The conjunction can be handed over as a whole. Its parts serve those who enumerate it: `network` is a conjunction of
    inequalities without defined symbols; `definitions` are acyclic, so what mentions none of their symbols does not
    depend on them; `remainder` is all else.
    """

    name: str
    kept: tuple[str, ...]
    network: Conjunction
    violation: Nnf
    definitions: tuple[Definition, ...] = ()
    remainder: Nnf = TRUE

    @property
    def formula(self) -> Nnf:
        """All of it as one formula."""
        definitions = (definition.formula for definition in self.definitions)
        return conjunction((*self.network, self.violation, self.remainder, *definitions))

    @cached_property
    def core(self) -> Nnf:
        """What neither the network nor the definitions say; always the same object."""
        return conjunction((self.violation, self.remainder))

    @property
    def eliminated(self) -> frozenset[str]:
        return names_in(self.formula) - frozenset(self.kept)


@dataclass
class Solvers:
    """What back ends may use: the door to the solvers, and where to count."""

    terms: Terms
    reader: FormulaReader
    solver: str = "z3"
    statistics: Statistics = field(default_factory=Statistics)

    def session(self) -> Session:
        return Session(self.terms, solver=self.solver, statistics=self.statistics)


class Eliminator(ABC):
    """One way of eliminating quantifiers, and what it is capable of.

    Args:
        context: the solvers.
        capable: the names of the installed back ends that have a capability, for messages.
    """

    name: ClassVar[str]
    booleans: ClassVar[bool] = True
    """Whether it takes formulas with Boolean symbols."""
    alternation: ClassVar[bool] = False
    """Whether it takes formulas with both quantifiers."""

    def __init__(self, context: Solvers, capable: Callable[[str], Iterable[str]]) -> None:
        self.context = context
        self._capable = capable

    @abstractmethod
    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        """Conjunctions over the kept symbols, as they are found; their union is what the query says.

        Nothing has to be said, but may be, about points of the `known` conjunctions, which are all in the union that
        the caller is after; results may overlap. KeyboardInterrupt ends the iteration at once.

        Raises:
            OutOfTimeError: if the deadline passes; what has been yielded is part of the union.
            UnsupportedError: if the back end cannot handle the formula; the message says which one could.
        """

    def eliminate_nested(self, query: Query, exists: Query, deadline: Deadline) -> Iterator[Conjunction]:
        """Eliminate the quantifiers of `query ∨ ¬exists`, one formula with both kinds; only with `alternation`."""
        raise self.unable("alternation", "both quantifiers at once")

    def unable(self, capability: str, what: str) -> UnsupportedError:
        """The error that this back end lacks a capability, with the back ends that have it."""
        capable = ", ".join(map(repr, self._capable(capability)))
        return UnsupportedError(f"back end {self.name!r} does not take {what}; choose one of the back ends {capable}")


def without(formula: Nnf, known: Iterable[Conjunction]) -> Nnf:
    """The formula outside of what is known already."""
    return conjunction((formula, *(outside(piece) for piece in known)))


def outside(piece: Iterable[LinearConstraint]) -> Nnf:
    """The complement of a conjunction of constraints."""
    return disjunction(half for constraint in piece for half in constraint.negation())
