"""The default back end: lazy enumeration of implicants, generalised before and after their exact projection.

As in [Monniaux 2008, 2010]: every model of the formula is generalised to a conjunction of constraints that implies it;
the conjunction is projected onto the kept symbols; what it covers is excluded; until nothing is left. What is added to
that:

- Definitions are asked only for the symbols that the implicant mentions: the others have a value anyway.
- Once definitions are substituted, constraints that the violation does not need are dropped, by queries to a second
  session in which `network ∧ definitions ∧ ¬violation` is asserted (so times stay as they are while it is asked).
- After projection, constraints that only cut off what is known already are dropped as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import cached_property

from robust.qe.constraint import LinearConstraint, trim
from robust.qe.eliminate.conjunctions import Conjunction, project, project_at, solve_equalities, variables_of
from robust.qe.eliminate.enumerate import Leaf, Outlook, QueryImplicant, minimal, model_of, satisfiable
from robust.qe.eliminate.interface import Context, Eliminator, Query, outside
from robust.qe.nnf import Literal, Model, names_in, negation
from robust.smt.limits import Deadline

CROWDED = 40
"""With more constraints than this on eliminated variables, projection is at the model only."""


class Project(Eliminator):
    """Lazy enumeration; see the module."""

    name = "project"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        search = _Search(self.context, query, deadline)
        for piece in known:
            search.exclude(piece)
        while (found := search.next_piece()) is not None:
            yield found
            search.exclude(found)


class _Search:
    """The sessions of one query: where pieces come from, what they must not lose, and what is known already."""

    def __init__(self, context: Context, query: Query, deadline: Deadline) -> None:
        self._context = context
        self._reader = context.reader
        self._query = query
        self._deadline = deadline
        self._definition = {definition.symbol: definition.formula for definition in query.definitions}
        self._names = names_in(query.formula)
        self._asked = context.session()
        self._asked.add_all([self._reader.write(query.formula)], deadline)
        self._projects = bool(query.network or self._names - set(query.kept) - self._definition.keys())
        self._excluded: list[Conjunction] = []

    def exclude(self, piece: Conjunction) -> None:
        self._asked.add(self._reader.outside(piece))
        self._excluded.append(piece)
        for outlook in ("_needs", "_known"):
            if outlook in self.__dict__:
                self.__dict__[outlook].exclude(piece)

    @cached_property
    def _needs(self) -> Outlook:
        """Where a conjunction stays inside the query or what is excluded; opened once there is something to find."""
        made = self._known_only()
        made.add(*self._query.network, *self._definition.values(), negation(self._query.core))
        return made

    @cached_property
    def _known(self) -> Outlook:
        """Where a conjunction stays inside what is excluded."""
        return self._known_only()

    def _known_only(self) -> Outlook:
        made = Outlook(self._context.session(), self._reader, self._deadline)
        for piece in self._excluded:
            made.exclude(piece)
        return made

    def next_piece(self) -> Conjunction | None:
        """A polyhedron of kept symbols that the query covers and that is not covered yet; None if there is none.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if not satisfiable(self._asked, self._query.name, self._deadline):
            return None
        model = model_of(self._asked, self._reader, self._names)
        leaves = self._needs.generalize(self._implicant(model))
        constraints = tuple(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        if not self._projects:
            return constraints
        piece = self._projection(trim((*constraints, *self._query.network)), model)
        return minimal(piece, lambda part: self._known.excludes(part, outside(piece)))

    def _implicant(self, model: Model) -> tuple[Leaf, ...]:
        """Leaves without defined symbols that imply the query, within its network."""
        found = QueryImplicant.at(self._query, model)
        # What the violation itself says comes last, where fewer constraints are dropped.
        leaves = (*found.support, *found.chosen)
        constraints = (leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        literals = (leaf for leaf in leaves if isinstance(leaf, Literal))
        return (*dict.fromkeys(literals), *solve_equalities(constraints, found.defined))

    def _projection(self, constraints: Conjunction, model: Model) -> Conjunction:
        eliminated = set(variables_of(constraints)) - set(self._query.kept)
        if sum(1 for c in constraints if not eliminated.isdisjoint(c.parameters)) > CROWDED:
            point = {name: Fraction(model.get(name, 0)) for name in variables_of(constraints)}
            return project_at(constraints, eliminated, point)
        return project(constraints, eliminated, self._deadline) or ()
