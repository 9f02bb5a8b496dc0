"""Projection of conjunctions of linear constraints: exactly, or at a point.

Exact: equalities are solved for what is eliminated; what is left goes by Fourier–Motzkin elimination [Fourier 1826;
Schrijver 1998, §12.2], one variable at a time, with redundancy removed by linear programming whenever combinations
pile up. At a point: Loos–Weispfenning substitution of the one bound that is tight at a model [Loos and Weispfenning
1993; Komuravelli, Gurfinkel and Chaki 2014], which never makes a conjunction longer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from importlib import import_module

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.qe.nnf import TRUE, Nnf, Reader, booleans_in, conjunction, disjunction, names_in
from robust.qe.polyhedron import combine, normal_form, substitute_equality
from robust.smt.limits import Deadline
from robust.smt.session import Session, Statistics
from robust.smt.terms import Terms

Conjunction = tuple[LinearConstraint, ...]

CROWD = 12
"""From how many constraints on redundancy is looked for between two steps."""


def solve_equalities(constraints: Iterable[LinearConstraint], eliminated: Collection[str]) -> Conjunction:
    """Use every equality over an eliminated variable to substitute that variable."""
    pending, gone = list(trim(constraints)), set(eliminated)
    while True:
        found = next(
            ((c, n) for c in pending if c.is_equality for n in c.parameters if n in gone),
            None,
        )
        if found is None:
            return tuple(pending)
        equality, name = found
        gone.discard(name)
        pending = list(trim(substitute_equality(c, equality, name) for c in pending if c is not equality))


def project(
    constraints: Iterable[LinearConstraint], eliminated: Collection[str], deadline: Deadline
) -> Conjunction | None:
    """The constraints on the other variables that say the same of them, irredundant; None if nothing satisfies them.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    rest = solve_equalities(constraints, eliminated)
    while True:
        deadline.enforce()
        if any(constraint.is_false for constraint in rest):
            return None
        name = _cheapest(rest, eliminated)
        if name is None:
            break
        rest = _eliminate(rest, name, deadline)
        if len(rest) > CROWD:
            reduced = irredundant(rest)
            if reduced is None:
                return None
            # Redundancy removal can bring equalities to light.
            rest = solve_equalities(reduced, eliminated)
    return irredundant(rest)


def irredundant(constraints: Iterable[LinearConstraint]) -> Conjunction | None:
    """The normal form of a conjunction; None if nothing satisfies it."""
    listed = list(constraints)
    form = normal_form(variables_of(listed), listed)
    return None if form is None else form.constraints


def variables_of(constraints: Iterable[LinearConstraint]) -> list[str]:
    return list(dict.fromkeys(name for constraint in constraints for name in constraint.parameters))


def _cheapest(constraints: Sequence[LinearConstraint], eliminated: Collection[str]) -> str | None:
    """The variable whose elimination adds the fewest constraints; None if none is left."""
    below: dict[str, int] = {}
    above: dict[str, int] = {}
    for constraint in constraints:
        for name, factor in constraint.coefficients:
            if name in eliminated:
                side = above if factor > 0 else below
                side[name] = side.get(name, 0) + 1
    names = {**below, **above}
    return min(
        names,
        key=lambda n: (below.get(n, 0) * above.get(n, 0) - below.get(n, 0) - above.get(n, 0), n),
        default=None,
    )


def _eliminate(constraints: Sequence[LinearConstraint], name: str, deadline: Deadline) -> Conjunction:
    """One step: every lower bound of the variable is at most every upper bound."""
    below, above, rest = bounds(constraints, name)
    for low, low_factor in below:
        deadline.enforce()
        for high, high_factor in above:
            strict = low.is_strict or high.is_strict
            relation = Sense.LESS if strict else Sense.AT_MOST
            rest.append(combine(low, high_factor, high, -low_factor, relation))
    return trim(rest)


Bounds = list[tuple[LinearConstraint, Fraction]]


def bounds(constraints: Iterable[LinearConstraint], name: str) -> tuple[Bounds, Bounds, list[LinearConstraint]]:
    """Lower and upper bounds of a variable with its coefficients there, and the constraints without it."""
    below: Bounds = []
    above: Bounds = []
    rest: list[LinearConstraint] = []
    for constraint in constraints:
        factor = dict(constraint.coefficients).get(name)
        if not factor:
            rest.append(constraint)
            continue
        for half in constraint.halves():
            slope = dict(half.coefficients)[name]
            (above if slope > 0 else below).append((half, slope))
    return below, above, rest


def project_at(
    constraints: Iterable[LinearConstraint], eliminated: Collection[str], point: Mapping[str, Fraction]
) -> Conjunction:
    """Constraints on the other variables that the point satisfies and that imply the exact projection.

    `point` satisfies the constraints. Each variable is put at its greatest lower bound at the point (just above it, if
    strict), or at the least upper bound if it has fewer of those.
    """
    rest = solve_equalities(constraints, eliminated)
    while (name := _cheapest(rest, eliminated)) is not None:
        below, above, free = bounds(rest, name)
        if below and above:
            near, far = (below, above) if len(below) <= len(above) else (above, below)
            tight, factor = max(near, key=lambda bound: _tightness(bound, name, point))
            for other, slope in near:
                if other is not tight:
                    relation = Sense.LESS if other.is_strict and not tight.is_strict else Sense.AT_MOST
                    free.append(combine(other, 1 / abs(slope), tight, -1 / abs(factor), relation))
            for other, slope in far:
                relation = Sense.LESS if other.is_strict or tight.is_strict else Sense.AT_MOST
                free.append(combine(other, 1 / abs(slope), tight, 1 / abs(factor), relation))
        rest = trim(free)
    return rest


def _tightness(
    bound: tuple[LinearConstraint, Fraction], name: str, point: Mapping[str, Fraction]
) -> tuple[Fraction, bool]:
    """How far the bound reaches towards the feasible side at the point, strict bounds further."""
    constraint, factor = bound
    others = sum((c * point[n] for n, c in constraint.coefficients if n != name), Fraction(0))
    limit = (constraint.constant - others) / factor
    return (limit if factor < 0 else -limit), constraint.is_strict


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
class Context:
    """What back ends may use: the door to the solvers, and where to count."""

    terms: Terms
    reader: Reader
    solver: str = "z3"
    statistics: Statistics = field(default_factory=Statistics)

    def session(self) -> Session:
        return Session(self.terms, solver=self.solver, statistics=self.statistics)


class Eliminator(ABC):
    """One way of eliminating quantifiers."""

    name: str
    alternation = False
    """Whether it takes formulas with both quantifiers."""

    def __init__(self, context: Context) -> None:
        self.context = context

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
        """As `eliminate`, for `query ∨ ¬exists` as one formula with both quantifiers; only with `alternation`."""
        raise UnsupportedError(f"back end {self.name!r} does not take both quantifiers at once; back end 'z3' does")


def without(formula: Nnf, known: Iterable[Conjunction]) -> Nnf:
    """The formula outside of what is known already."""
    return conjunction((formula, *(outside(piece) for piece in known)))


def outside(piece: Iterable[LinearConstraint]) -> Nnf:
    """The complement of a conjunction of constraints."""
    return disjunction(half for constraint in piece for half in constraint.negation())


def require_reals(formula: Nnf, name: str) -> None:
    """UnsupportedError if Boolean symbols occur, for back ends of pure arithmetic."""
    booleans = booleans_in(formula)
    if booleans:
        raise UnsupportedError(
            f"back end {name!r} found the Boolean symbol {min(booleans)!r}, expected real symbols only; "
            "back ends 'project', 'fourier-motzkin', 'loos-weispfenning' and 'z3' take both"
        )


ELIMINATORS = {
    "project": ("robust.qe.eliminate.enumerate", "Project"),
    "fourier-motzkin": ("robust.qe.eliminate.enumerate", "FourierMotzkin"),
    "loos-weispfenning": ("robust.qe.eliminate.loos_weispfenning", "LoosWeispfenning"),
    "z3": ("robust.qe.eliminate.z3_tactics", "Z3Tactic"),
    "z3-qe": ("robust.qe.eliminate.z3_tactics", "Z3OldTactic"),
    "cvc5": ("robust.qe.eliminate.cvc5_native", "Cvc5Disjuncts"),
    "cvc5-whole": ("robust.qe.eliminate.cvc5_native", "Cvc5Whole"),
}
"""Where each back end lives; imported only when chosen."""


def require_eliminator(name: str) -> None:
    """InputError if there is no such back end."""
    if name not in ELIMINATORS:
        raise InputError(f"unknown back end {name!r}{did_you_mean(name, ELIMINATORS)}")


def create_eliminator(name: str, context: Context) -> Eliminator:
    """The back end of that name.

    Raises:
        InputError: if there is no such back end.
        SolverError: if what it needs is not installed.
    """
    require_eliminator(name)
    module, attribute = ELIMINATORS[name]
    made = getattr(import_module(module), attribute)(context)
    if not isinstance(made, Eliminator):
        raise TypeError(f"{attribute} is not an elimination back end")
    return made
