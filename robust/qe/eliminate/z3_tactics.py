"""Quantifier elimination by z3's tactics: `qe2`, model-based, or the older `qe`; both take alternating quantifiers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Any, assert_never

from robust.errors import SolverError, UnsupportedError
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.eliminate.cvc5_native import stream_from_copy
from robust.qe.eliminate.enumerate import polyhedra_of
from robust.qe.eliminate.interface import Conjunction, Eliminator, Query, without
from robust.qe.nnf import (
    FALSE,
    TRUE,
    Junction,
    Literal,
    Nnf,
    booleans_in,
    conjunction,
    disjunction,
    negation,
    postorder,
)
from robust.smt.limits import Deadline

try:
    import z3
except ImportError as error:
    raise SolverError("z3 is not installed; expected the Python package z3-solver") from error


class Z3Tactic(Eliminator):
    """z3's `qe2`."""

    name = "z3"
    tactic = "qe2"
    alternation = True

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        known = list(known)
        formula = without(query.formula, known)
        yield from self._eliminate(lambda: _exists(formula, query.eliminated), known, deadline)

    def eliminate_nested(self, query: Query, exists: Query, deadline: Deadline) -> Iterator[Conjunction]:
        def build() -> Any:
            inner = _exists(exists.formula, exists.eliminated)
            return z3.Or(_exists(query.formula, query.eliminated), z3.Not(inner))

        yield from self._eliminate(build, [], deadline)

    def _eliminate(
        self, build: Callable[[], Any], known: list[Conjunction], deadline: Deadline
    ) -> Iterator[Conjunction]:
        def work() -> Iterator[Nnf]:
            expression = z3.simplify(build())
            if not _has_quantifier(expression):
                # `qe2` answers "true" to formulas without a quantifier.
                yield from_z3(expression)
                return
            goals = z3.Then(self.tactic, "simplify")(expression)
            yield disjunction(conjunction(from_z3(part) for part in goal) for goal in goals)

        for result in stream_from_copy(work, deadline):
            context = self.context
            yield from polyhedra_of(result, context.session, context.reader, deadline, known)


class Z3OldTactic(Z3Tactic):
    """z3's `qe`."""

    name = "z3-qe"
    tactic = "qe"


def _exists(formula: Nnf, names: Iterable[str]) -> Any:
    booleans = booleans_in(formula)
    bound = [(z3.Bool if name in booleans else z3.Real)(name) for name in sorted(names)]
    body = to_z3(formula)
    return z3.Exists(bound, body) if bound else body


def _has_quantifier(root: Any) -> bool:
    seen: set[int] = set()
    stack = [root]
    while stack:
        node = stack.pop()
        if z3.is_quantifier(node):
            return True
        if node.get_id() not in seen:
            seen.add(node.get_id())
            stack += node.children()
    return False


def to_z3(root: Nnf) -> Any:
    """The formula as an expression of z3."""
    images: dict[Nnf, Any] = {}
    for node in postorder(root):
        match node:
            case LinearConstraint():
                images[node] = _constraint(node)
            case Literal(name, value):
                images[node] = z3.Bool(name) if value else z3.Not(z3.Bool(name))
            case Junction(conjunctive, operands):
                images[node] = (z3.And if conjunctive else z3.Or)([images[operand] for operand in operands])
            case _:
                assert_never(node)
    return images[root]


def _constraint(node: LinearConstraint) -> Any:
    # Whole numbers only: the constant's denominator goes to the other side.
    scale = node.constant.denominator
    form = z3.Sum([z3.RealVal(int(c * scale)) * z3.Real(n) for n, c in node.coefficients])
    constant = z3.RealVal(node.constant.numerator)
    match node.relation:
        case Sense.AT_MOST:
            return form <= constant
        case Sense.LESS:
            return form < constant
        case Sense.EQUAL:
            return form == constant


def from_z3(root: Any) -> Nnf:
    """A quantifier-free expression of z3 as a formula.

    Raises:
        UnsupportedError: if a quantifier or anything but linear arithmetic is left.
    """
    images: dict[int, Nnf] = {}
    kept: list[Any] = []
    stack = [root]
    while stack:
        node = stack[-1]
        children = [] if _is_atom(node) else node.children()
        missing = [child for child in children if child.get_id() not in images]
        if missing:
            stack += missing
            continue
        stack.pop()
        kept.append(node)  # identifiers are only unique while the expressions live
        images[node.get_id()] = _image(node, [images[child.get_id()] for child in children])
    return images[root.get_id()]


def _is_atom(node: Any) -> bool:
    return z3.is_const(node) or (z3.is_app(node) and any(z3.is_arith(child) for child in node.children()))


def _image(node: Any, parts: list[Nnf]) -> Nnf:  # noqa: PLR0911 - one way out for each kind
    if z3.is_true(node):
        return TRUE
    if z3.is_false(node):
        return FALSE
    if z3.is_and(node):
        return conjunction(parts)
    if z3.is_or(node):
        return disjunction(parts)
    if z3.is_not(node):
        return negation(parts[0])
    if z3.is_implies(node):
        return disjunction((negation(parts[0]), parts[1]))
    if z3.is_eq(node) and parts:
        left, right = parts
        return disjunction((conjunction((left, right)), conjunction((negation(left), negation(right)))))
    if z3.is_const(node) and z3.is_bool(node):
        return Literal(node.decl().name(), True)
    if _is_atom(node):
        return _atom(node)
    raise UnsupportedError(f"z3 left {node.decl()} in its result; back ends 'project' and 'loos-weispfenning' do not")


RELATIONS = {
    z3.Z3_OP_LE: (Sense.AT_MOST, 1),
    z3.Z3_OP_LT: (Sense.LESS, 1),
    z3.Z3_OP_GE: (Sense.AT_MOST, -1),
    z3.Z3_OP_GT: (Sense.LESS, -1),
    z3.Z3_OP_EQ: (Sense.EQUAL, 1),
    z3.Z3_OP_DISTINCT: (Sense.EQUAL, 1),
}


def _atom(node: Any) -> Nnf:
    kind = node.decl().kind()
    if kind not in RELATIONS:
        raise UnsupportedError(f"z3 left {node.decl()} in its result; back ends 'project' and 'cvc5' do not")
    sense, sign = RELATIONS[kind]
    total: dict[str, Fraction] = {}
    constant = Fraction(0)
    for weight, side in ((sign, node.arg(0)), (-sign, node.arg(1))):
        for name, factor in _terms(side, Fraction(weight)):
            if name is None:
                constant -= factor
            else:
                total[name] = total.get(name, Fraction(0)) + factor
    constraint = LinearConstraint(tuple(total.items()), sense, constant)
    return negation(constraint) if kind == z3.Z3_OP_DISTINCT else constraint


def _terms(term: Any, weight: Fraction) -> Iterator[tuple[str | None, Fraction]]:
    """Names with their coefficients, and numbers without a name."""
    stack = [(term, weight)]
    while stack:
        node, factor = stack.pop()
        if z3.is_rational_value(node):
            yield None, factor * node.as_fraction()
        elif z3.is_add(node):
            stack += [(child, factor) for child in node.children()]
        elif z3.is_sub(node):
            stack += [(child, factor if index == 0 else -factor) for index, child in enumerate(node.children())]
        elif node.decl().kind() == z3.Z3_OP_UMINUS:
            stack.append((node.arg(0), -factor))
        elif z3.is_mul(node):
            numbers = [child for child in node.children() if z3.is_rational_value(child)]
            rest = [child for child in node.children() if not z3.is_rational_value(child)]
            product = math.prod((child.as_fraction() for child in numbers), start=factor)
            if len(rest) > 1:
                raise UnsupportedError(f"z3 left the product {node} in its result")
            if rest:
                stack.append((rest[0], product))
            else:
                yield None, product
        elif z3.is_const(node):
            yield node.decl().name(), factor
        else:
            raise UnsupportedError(f"z3 left the term {node} in its result")
