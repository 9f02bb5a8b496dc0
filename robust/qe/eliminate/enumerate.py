"""The satisfying points of quantifier-free formulas as polyhedra, found lazily by satisfiability queries.

Every model is generalised to a conjunction of constraints that implies the formula; constraints that the implication
does not need are dropped one by one, so that few and large pieces cover the formula (prime implicants in the sense of
Quine, modulo linear arithmetic).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

from robust.qe.constraint import LinearConstraint, trim
from robust.qe.eliminate.conjunctions import Conjunction, irredundant
from robust.qe.eliminate.interface import Query
from robust.qe.nnf import Literal, Model, Nnf, Reader, implicant, names_in, negation
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict

Leaf = LinearConstraint | Literal
L = TypeVar("L", bound=Leaf)


class Outlook:
    """A session in which nothing must be left: whether a conjunction stays inside what its assertions exclude."""

    def __init__(self, session: Session, reader: Reader, deadline: Deadline) -> None:
        self._session = session
        self._reader = reader
        self._deadline = deadline

    def add(self, *formulas: Nnf) -> None:
        for formula in formulas:
            self._session.add(self._reader.write(formula))

    def exclude(self, piece: Conjunction) -> None:
        self._session.add(self._reader.outside(piece))

    def excludes(self, constraints: Iterable[Leaf], *extra: Nnf) -> bool:
        """Whether no point of the conjunction satisfies the assertions.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._session.frame(*(self._reader.write(part) for part in (*constraints, *extra))):
            return not satisfiable(self._session, "a generalised piece stays inside", self._deadline)

    def generalize(self, leaves: tuple[L, ...]) -> tuple[L, ...]:
        """A part of the conjunction that is still excluded, of which nothing more can be left out."""
        return minimal(leaves, self.excludes)


def minimal(leaves: tuple[L, ...], enough: Callable[[tuple[L, ...]], bool]) -> tuple[L, ...]:
    """A part of the leaves that is still enough, of which no single one can be left out [Junker 2004, QuickXplain].

    All of them together are enough; those in front are dropped rather than those behind.
    """

    def search(fixed: tuple[L, ...], open_: tuple[L, ...], changed: bool) -> tuple[L, ...]:
        if changed and enough(fixed):
            return ()
        if len(open_) <= 1:
            return open_
        middle = len(open_) // 2
        front, back = open_[:middle], open_[middle:]
        needed_front = search((*fixed, *back), front, True)
        needed_back = search((*fixed, *needed_front), back, bool(needed_front))
        return (*needed_front, *needed_back)

    return search((), leaves, True)


def satisfiable(session: Session, question: str, deadline: Deadline) -> bool:
    """The verdict of a session as a truth value.

    Raises:
        OutOfTimeError: if the solver does not decide before the deadline.
    """
    verdict = session.check(question, deadline)
    if verdict is Verdict.UNKNOWN:
        raise OutOfTimeError
    return verdict is Verdict.SATISFIABLE


def model_of(session: Session, reader: Reader, names: Iterable[str]) -> Model:
    """The values of the named symbols in the last model."""
    return session.values(reader.symbols(names))


@dataclass(frozen=True)
class QueryImplicant:
    """Leaves that are true in a model of a query and imply, within its network, that the query is satisfiable.

    `chosen` implies all but the definitions; `support` implies those of the symbols `defined`, which are all that these
    leaves mention. Other definitions have a value anyway and need not be looked at.
    """

    chosen: tuple[Leaf, ...]
    support: tuple[Leaf, ...]
    defined: frozenset[str]

    @staticmethod
    def at(query: Query, model: Model) -> QueryImplicant:
        definition = {definition.symbol: definition.formula for definition in query.definitions}
        chosen: dict[Leaf, None] = {}
        support: dict[Leaf, None] = {}
        implicant(query.core, model, chosen)
        pending = _mentioned(chosen) & definition.keys()
        done: set[str] = set()
        while pending:
            symbol = min(pending)
            done.add(symbol)
            implicant(definition[symbol], model, support)
            pending = (_mentioned({**chosen, **support}) & definition.keys()) - done
        return QueryImplicant(tuple(chosen), tuple(support), frozenset(done))


def _mentioned(leaves: Mapping[Leaf, None]) -> set[str]:
    return {
        name for leaf in leaves for name in (leaf.parameters if isinstance(leaf, LinearConstraint) else (leaf.name,))
    }


def polyhedra_of(
    formula: Nnf,
    make_session: Callable[[], Session],
    reader: Reader,
    deadline: Deadline,
    known: Iterable[Conjunction] = (),
) -> Iterator[Conjunction]:
    """Conjunctions, over the formula's own real symbols, whose union is the formula; points of `known` may be skipped.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    asked, complement = make_session(), Outlook(make_session(), reader, deadline)
    asked.add(reader.write(formula))
    complement.add(negation(formula))
    for piece in known:
        asked.add(reader.outside(piece))
        complement.exclude(piece)
    names = names_in(formula)
    while satisfiable(asked, "another polyhedron", deadline):
        chosen: dict[LinearConstraint | Literal, None] = {}
        implicant(formula, model_of(asked, reader, names), chosen)
        leaves = trim(leaf for leaf in chosen if isinstance(leaf, LinearConstraint))
        piece = irredundant(complement.generalize(leaves)) or ()
        yield piece
        asked.add(reader.outside(piece))
        complement.exclude(piece)
