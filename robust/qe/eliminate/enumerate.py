"""The satisfying points of quantifier-free formulas as polyhedra, found lazily by satisfiability queries.

Every model is generalised to a conjunction of constraints that implies the formula; constraints that the implication
does not need are dropped one by one, so that few and large pieces cover the formula (prime implicants in the sense of
Quine, modulo linear arithmetic).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from robust.qe.conjunctions import Conjunction, irredundant, project, project_at, solve_equalities, variables_of
from robust.qe.constraint import LinearConstraint, trim
from robust.qe.eliminate.interface import Eliminator, Query, Solvers, outside, without
from robust.qe.nnf import BoolLeaf, Leaf, Model, Nnf, implicant, names_in, negation
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session

L = TypeVar("L", bound=Leaf)
Part = TypeVar("Part")


class ExclusionSession:
    """A session in which nothing must be left: whether a conjunction stays inside what its assertions exclude.

    It is opened when it is first asked.

    Args:
        context: the solvers.
        deadline: when to stop.
        formulas: the first assertions.
    """

    def __init__(self, context: Solvers, deadline: Deadline, *formulas: Nnf) -> None:
        self._context = context
        self._deadline = deadline
        self._formulas = formulas
        self._excluded: list[Conjunction] = []
        self._asserted = 0
        self._session: Session | None = None

    def exclude(self, piece: Conjunction) -> None:
        self._excluded.append(piece)

    def excludes(self, constraints: Iterable[Leaf], *extra: Nnf) -> bool:
        """Whether no point of the conjunction satisfies the assertions.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        reader = self._context.reader
        if self._session is None:
            self._session = self._context.session()
            self._session.add(*map(reader.write, self._formulas))
        self._session.add(*map(reader.outside, self._excluded[self._asserted :]))
        self._asserted = len(self._excluded)
        with self._session.frame(*(reader.write(part) for part in (*constraints, *extra))):
            return not satisfiable(self._session, "a generalised piece stays inside", self._deadline)

    def generalize(self, leaves: tuple[L, ...]) -> tuple[L, ...]:
        """A part of the conjunction that is still excluded, of which nothing more can be left out."""
        return minimal(leaves, self.excludes)


def minimal(leaves: tuple[Part, ...], enough: Callable[[tuple[Part, ...]], bool]) -> tuple[Part, ...]:
    """A part of the leaves that is still enough, of which no single one can be left out [Junker 2004, QuickXplain].

    All of them together are enough; those in front are dropped rather than those behind.
    """

    def search(fixed: tuple[Part, ...], open_: tuple[Part, ...], changed: bool) -> tuple[Part, ...]:
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
        OutOfTimeError: if the solver does not decide before the deadline, or fails.
    """
    verdict = session.check(question, deadline)
    if verdict is Satisfiability.UNKNOWN:
        raise OutOfTimeError(session.failure)
    return verdict is Satisfiability.SATISFIABLE


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
    return {name for leaf in leaves for name in leaf.parameters}


def polyhedra_of(
    formula: Nnf, context: Solvers, deadline: Deadline, known: Iterable[Conjunction] = ()
) -> Iterator[Conjunction]:
    """Conjunctions, over the formula's own real symbols, whose union is the formula; points of `known` may be skipped.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    reader, asked, complement = (
        context.reader,
        context.session(),
        ExclusionSession(context, deadline, negation(formula)),
    )
    asked.add(reader.write(formula))
    for piece in known:
        asked.add(reader.outside(piece))
        complement.exclude(piece)
    names = names_in(formula)
    while satisfiable(asked, "another polyhedron", deadline):
        chosen: dict[Leaf, None] = {}
        implicant(formula, asked.values(reader.symbols(names)), chosen)
        leaves = trim(leaf for leaf in chosen if isinstance(leaf, LinearConstraint))
        piece = irredundant(complement.generalize(leaves)) or ()
        yield piece
        asked.add(reader.outside(piece))
        complement.exclude(piece)


CROWDED = 40
"""With more constraints than this on eliminated variables, projection is at the model only."""


class Project(Eliminator):
    """Lazy enumeration; see the module."""

    name = "project"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        search = PieceSearch(self.context, query, deadline)
        for excluded in known:
            search.exclude(excluded)
        while (piece := search.next_piece()) is not None:
            yield piece
            search.exclude(piece)


class PieceSearch:
    """The sessions of one query: where pieces come from, what they must not lose, and what is known already."""

    def __init__(self, context: Solvers, query: Query, deadline: Deadline) -> None:
        self._reader = context.reader
        self._query = query
        self._deadline = deadline
        definition = {definition.symbol: definition.formula for definition in query.definitions}
        self._names = names_in(query.formula)
        self._asked = context.session()
        self._asked.add_all([self._reader.write(query.formula)], deadline)
        self._projects = bool(query.network or self._names - set(query.kept) - definition.keys())
        self._known = ExclusionSession(context, deadline)
        """Where a conjunction stays inside what is excluded."""
        self._needs = ExclusionSession(context, deadline, *query.network, *definition.values(), negation(query.core))
        """Where it stays inside the query or what is excluded."""

    def exclude(self, piece: Conjunction) -> None:
        self._asked.add(self._reader.outside(piece))
        self._known.exclude(piece)
        self._needs.exclude(piece)

    def next_piece(self, within: Iterable[LinearConstraint] = ()) -> Conjunction | None:
        """A polyhedron of kept symbols that the query covers and that is not covered yet; None if there is none.

        With `within` it has a point that satisfies these constraints, but does not end there.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        sides = [self._reader.write(constraint) for constraint in within]
        with self._asked.frame(*sides) if sides else nullcontext():
            if not satisfiable(self._asked, self._query.name, self._deadline):
                return None
            model = self._asked.values(self._reader.symbols(self._names))
        leaves = self._needs.generalize(self._implicant(model))
        constraints = tuple(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        if not self._projects:
            return constraints
        whole = trim((*constraints, *self._query.network))
        piece = projected(whole, self._query.kept, model, self._deadline) or ()
        return minimal(piece, lambda part: self._known.excludes(part, outside(piece)))

    def _implicant(self, model: Model) -> tuple[Leaf, ...]:
        """Leaves without defined symbols that imply the query, within its network."""
        implicant = QueryImplicant.at(self._query, model)
        # What the violation itself says comes last, where fewer constraints are dropped.
        leaves = (*implicant.support, *implicant.chosen)
        constraints = (leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        literals = (leaf for leaf in leaves if isinstance(leaf, BoolLeaf))
        return (*dict.fromkeys(literals), *solve_equalities(constraints, implicant.defined))


def projected(
    constraints: Sequence[LinearConstraint], kept: Iterable[str], model: Model, deadline: Deadline
) -> Conjunction | None:
    """What constraints say of what is kept, or if there is much to eliminate, a part of it that has the model.

    None if nothing satisfies them.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    names = variables_of(constraints)
    eliminated = set(names).difference(kept)
    if sum(1 for constraint in constraints if not eliminated.isdisjoint(constraint.parameters)) > CROWDED:
        return project_at(constraints, eliminated, {name: Fraction(model.get(name, 0)) for name in names})
    return project(constraints, eliminated, deadline)


class FourierMotzkin(Eliminator):
    """Implicants, projected one at a time."""

    name = "fourier-motzkin"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, formula = self.context, query.formula
        session = context.session()
        session.add_all([context.reader.write(without(formula, known))], deadline)
        names, eliminated = names_in(formula), query.eliminated
        while satisfiable(session, query.name, deadline):
            implicant = QueryImplicant.at(query, session.values(context.reader.symbols(names)))
            leaves = (*query.network, *implicant.chosen, *implicant.support)
            constraints = trim(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
            piece = project(constraints, eliminated, deadline)
            if piece is None:
                raise AssertionError(f"{query.name}: an implicant with a model has an empty projection")
            yield piece
            session.add(context.reader.outside(piece))
