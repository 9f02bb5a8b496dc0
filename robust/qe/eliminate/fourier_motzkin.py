"""Fourier–Motzkin elimination on the implicants of a formula [Fourier 1826; Monniaux 2008].

A formula is a disjunction of conjunctions; these are enumerated lazily by satisfiability queries, each is projected by
itself, and what the projection covers is excluded from the rest, so that only a small part of the disjunctive normal
form is ever looked at. Definitions of symbols that an implicant does not mention are left out of it: they can be
satisfied anyway, and would only cut its projection into pieces. Unlike in the default back end nothing is generalised.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robust.qe.constraint import LinearConstraint, trim
from robust.qe.eliminate.conjunctions import Conjunction, project
from robust.qe.eliminate.enumerate import QueryImplicant, model_of, satisfiable
from robust.qe.eliminate.interface import Eliminator, Query, without
from robust.qe.nnf import names_in
from robust.smt.limits import Deadline


class FourierMotzkin(Eliminator):
    """Implicants, projected one at a time."""

    name = "fourier-motzkin"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, formula = self.context, query.formula
        session = context.session()
        session.add_all([context.reader.write(without(formula, known))], deadline)
        names, eliminated = names_in(formula), query.eliminated
        while satisfiable(session, query.name, deadline):
            found = QueryImplicant.at(query, model_of(session, context.reader, names))
            leaves = (*query.network, *found.chosen, *found.support)
            constraints = trim(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
            piece = project(constraints, eliminated, deadline)
            if piece is None:
                raise AssertionError(f"{query.name}: an implicant with a model has an empty projection")
            yield piece
            session.add(context.reader.outside(piece))
