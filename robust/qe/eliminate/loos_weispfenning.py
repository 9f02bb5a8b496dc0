"""Quantifier elimination by virtual substitution [Loos and Weispfenning 1993].

∃x. φ is the disjunction of φ at −∞, at every value that a non-strict lower bound of x gives, and infinitesimally above
every value that a strict one gives (or all of that upside down, whichever has fewer cases). No disjunctive normal form
of φ is needed. Where an equality determines x, its value alone is substituted; a quantifier moves inwards past whatever
does not mention x; results are simplified on the way, and large ones lose disjuncts that are contradictory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.eliminate.conjunctions import Conjunction
from robust.qe.eliminate.enumerate import polyhedra_of, satisfiable
from robust.qe.eliminate.interface import Eliminator, Query, without
from robust.qe.eliminate.simplify import simplified
from robust.qe.nnf import (
    FALSE,
    TRUE,
    Junction,
    Literal,
    Nnf,
    booleans_in,
    conjunction,
    disjunction,
    names_in,
    postorder,
    rebuild,
)
from robust.qe.reduction import substitute_equality
from robust.smt.limits import Deadline

LARGE = 30
"""How many leaves make it worth asking a solver whether a disjunct is contradictory."""


@dataclass(frozen=True, slots=True)
class VirtualValue:
    """A virtual value of x: what an equality over x says (moved up or down infinitesimally), or infinity if None."""

    equality: LinearConstraint | None
    direction: int
    """−1: just below, or −∞; 0: exactly; 1: just above, or +∞."""


class LoosWeispfenning(Eliminator):
    """Virtual substitution."""

    name = "loos-weispfenning"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, known = self.context, list(known)
        session = context.session()
        session.add(context.reader.write(without(TRUE, known)))

        def possible(formula: Nnf) -> bool:
            with session.frame(context.reader.write(formula)):
                return satisfiable(session, f"{query.name}: a disjunct", deadline)

        run = _Run(possible, deadline)
        result = run.eliminate_all(query.formula, query.eliminated)
        yield from polyhedra_of(result, context.session, context.reader, deadline, known)


class _Run:
    def __init__(self, possible: Callable[[Nnf], bool], deadline: Deadline) -> None:
        self._possible = possible
        self._deadline = deadline

    def eliminate_all(self, formula: Nnf, names: Iterable[str]) -> Nnf:
        """Eliminate one symbol after the other, the one with the fewest cases first."""
        open_ = set(names)
        booleans = booleans_in(formula)
        for name in sorted(open_ & booleans):
            formula = simplified(disjunction(_with_boolean(formula, name, value) for value in (False, True)))
        open_ -= booleans
        while open_ := open_ & names_in(formula):
            name = min(open_, key=lambda n: (_occurrences(formula, n), n))
            formula = simplified(self._eliminate(formula, name))
        return formula

    def _eliminate(self, formula: Nnf, name: str) -> Nnf:
        """∃ name. formula."""
        self._deadline.enforce()
        if name not in names_in(formula):
            return formula
        if not isinstance(formula, Junction):
            return TRUE
        if not formula.conjunctive:
            return disjunction(self._eliminate(operand, name) for operand in formula.operands)
        about = [operand for operand in formula.operands if name in names_in(operand)]
        free = [operand for operand in formula.operands if name not in names_in(operand)]
        if len(about) == 1:
            return conjunction((*free, self._eliminate(about[0], name)))
        equality = next((o for o in about if isinstance(o, LinearConstraint) and o.is_equality), None)
        body = conjunction(about)
        if equality is not None:
            return conjunction((*free, substitute(body, name, VirtualValue(equality, 0))))
        cases = []
        for point in virtual_values(body, name):
            self._deadline.enforce()
            case = simplified(conjunction((*free, substitute(body, name, point))))
            if case is not FALSE and (_size(case) < LARGE or self._possible(case)):
                cases.append(case)
        return disjunction(cases)


def _with_boolean(formula: Nnf, name: str, value: bool) -> Nnf:
    def leaf(node: LinearConstraint | Literal) -> Nnf:
        if isinstance(node, Literal) and node.name == name:
            return TRUE if node.value is value else FALSE
        return node

    return rebuild(formula, leaf)


def virtual_values(formula: Nnf, name: str) -> list[VirtualValue]:
    """Virtual values of which one satisfies the formula if any value does: from below or from above."""
    below: dict[VirtualValue, None] = {}
    above: dict[VirtualValue, None] = {}
    for node in postorder(formula):
        if isinstance(node, LinearConstraint) and name in node.parameters:
            at = node.with_relation(Sense.EQUAL)
            if node.is_equality:
                below[VirtualValue(at, 0)] = above[VirtualValue(at, 0)] = None
            elif dict(node.coefficients)[name] < 0:
                below[VirtualValue(at, int(node.is_strict))] = None
            else:
                above[VirtualValue(at, -int(node.is_strict))] = None
    if len(below) <= len(above):
        return [VirtualValue(None, -1), *below]
    return [VirtualValue(None, 1), *above]


def substitute(formula: Nnf, name: str, point: VirtualValue) -> Nnf:
    """The formula with a virtual value for a variable."""

    def leaf(node: LinearConstraint | Literal) -> Nnf:
        if isinstance(node, Literal) or name not in node.parameters:
            return node
        factor = dict(node.coefficients)[name]
        if point.equality is None:
            # At infinity the sign of the coefficient decides.
            return TRUE if not node.is_equality and factor * point.direction < 0 else FALSE
        if node.is_equality and point.direction:
            return FALSE
        if point.direction:
            # a·(x ± ε) + … ≤ c: the infinitesimal makes it strict, or makes it hold on the boundary.
            node = node.with_relation(Sense.LESS if factor * point.direction > 0 else Sense.AT_MOST)
        return substitute_equality(node, point.equality, name)

    return rebuild(formula, leaf)


def _occurrences(formula: Nnf, name: str) -> int:
    return sum(1 for node in postorder(formula) if isinstance(node, LinearConstraint) and name in node.parameters)


def _size(formula: Nnf) -> int:
    return sum(1 for node in postorder(formula) if not isinstance(node, Junction))
