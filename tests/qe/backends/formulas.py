"""Random elimination problems, and z3's own decision of whether an answer to one is right."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import z3
from hypothesis import strategies as st

from robust.plan.model import ParametrizedPlan
from robust.qe.compute import RegionResult, RegionSearch
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.eliminate.interface import Context, Query
from robust.qe.eliminate.z3_tactics import to_z3
from robust.qe.nnf import Literal, Nnf, Reader, booleans_in, conjunction, disjunction
from robust.smt.terms import Terms

KEPT = ("a", "b")
REALS = ("x", "y", "z")


def context() -> Context:
    terms = Terms()
    return Context(terms, Reader(terms))


@st.composite
def constraints(draw: st.DrawFn, names: tuple[str, ...] = (*KEPT, *REALS)) -> LinearConstraint:
    used = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    factors = {name: draw(st.sampled_from([1, -1, 1, -1, 2, -2, Fraction(1, 3)])) for name in used}
    sense = draw(st.sampled_from([Sense.AT_MOST, Sense.AT_MOST, Sense.LESS, Sense.EQUAL]))
    return LinearConstraint.of(factors, sense, draw(st.sampled_from([0, 1, -1, 2, 5, Fraction(-3, 2)])))


def formulas(*, booleans: bool = False) -> st.SearchStrategy[Nnf]:
    """Negation normal forms of depth three or so over kept and other symbols."""
    leaves: st.SearchStrategy[Nnf] = constraints()
    if booleans:
        leaves = st.one_of(leaves, leaves, st.builds(Literal, st.sampled_from(["p", "q"]), st.booleans()))
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.lists(inner, min_size=2, max_size=4).map(conjunction),
            st.lists(inner, min_size=2, max_size=3).map(disjunction),
        ),
        max_leaves=9,
    )


def query(formula: Nnf, network: Conjunction = ()) -> Query:
    return Query("random", KEPT, network, formula)


def wrong(asked: Query, pieces: Iterable[Conjunction], known: Iterable[Conjunction] = ()) -> str | None:
    """Where pieces, together with what was known, differ from the query, if anywhere."""
    formula = asked.formula
    booleans = booleans_in(formula)
    bound = [(z3.Bool if name in booleans else z3.Real)(name) for name in sorted(asked.eliminated)]
    body = to_z3(formula)
    expected = z3.Exists(bound, body) if bound else body
    pieces, known = list(pieces), list(known)
    assert all(set(c.parameters) <= set(KEPT) for piece in pieces for c in piece)
    union = z3.Or([to_z3(conjunction(piece)) for piece in [*pieces, *known]])
    target = z3.Or(expected, z3.Or([to_z3(conjunction(piece)) for piece in known]))
    solver = z3.SolverFor("LRA")
    solver.add(union != target)
    verdict = solver.check()
    assert verdict != z3.unknown
    return None if verdict == z3.unsat else f"{solver.model()} separates {pieces} from {formula}"


def region(plan: ParametrizedPlan, **options: Any) -> RegionResult:
    return RegionSearch(plan, **options).run()
