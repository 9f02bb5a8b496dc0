"""Quantifier elimination by z3's tactic `qe2`, which is model-based and takes alternating quantifiers."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from robust.errors import SolverError, UnsupportedError
from robust.qe import constraint, nnf
from robust.qe.conjunctions import Conjunction
from robust.qe.eliminate import enumerate, interface
from robust.qe.nnf import BoolLeaf, Leaf, Nnf, Operator, Shape
from robust.smt.limits import Deadline, stream_from_copy

try:
    import z3
except ImportError as error:
    raise SolverError("z3 is not installed; expected the Python package z3-solver") from error


class Z3Tactic(interface.Eliminator):
    """z3's `qe2`."""

    name = "z3"
    tactic = "qe2"
    alternation = True

    def eliminate(
        self, query: interface.Query, known: Iterable[Conjunction], deadline: Deadline
    ) -> Iterator[Conjunction]:
        known = list(known)
        formula = interface.without(query.formula, known)
        yield from self._eliminate(lambda: _exists(formula, query.eliminated), known, deadline)

    def eliminate_nested(
        self, query: interface.Query, exists: interface.Query, deadline: Deadline
    ) -> Iterator[Conjunction]:
        def build() -> Any:
            inner = _exists(exists.formula, exists.eliminated)
            return z3.Or(_exists(query.formula, query.eliminated), z3.Not(inner))

        yield from self._eliminate(build, [], deadline)

    def _eliminate(
        self, build: Callable[[], Any], known: list[Conjunction], deadline: Deadline
    ) -> Iterator[Conjunction]:
        def work() -> Iterator[Nnf]:
            expression = z3.simplify(build())
            if not z3.Probe("has-quantifiers")(expression):
                # `qe2` answers "true" to formulas without a quantifier.
                yield from_z3(expression)
                return
            goals = z3.Then(self.tactic, "simplify")(expression)
            yield nnf.disjunction(nnf.conjunction(from_z3(part) for part in goal) for goal in goals)

        for result in stream_from_copy(work, deadline, "quantifier elimination"):
            yield from enumerate.polyhedra_of(result, self.context, deadline, known)


def _exists(formula: Nnf, names: Iterable[str]) -> Any:
    booleans = nnf.booleans_in(formula)
    bound = [(z3.Bool if name in booleans else z3.Real)(name) for name in sorted(names)]
    body = to_z3(formula)
    return z3.Exists(bound, body) if bound else body


def to_z3(root: Nnf) -> Any:
    """The formula as an expression of z3."""

    def leaf(node: Leaf) -> Any:
        if isinstance(node, BoolLeaf):
            return z3.Bool(node.name) if node.value else z3.Not(z3.Bool(node.name))
        # Whole numbers only: the constant's denominator goes to the other side.
        scale = node.constant.denominator
        form = z3.Sum([z3.RealVal(int(c * scale)) * z3.Real(n) for n, c in node.coefficients])
        constant = z3.RealVal(node.constant.numerator)
        match node.relation:
            case constraint.Sense.AT_MOST:
                return form <= constant
            case constraint.Sense.LESS:
                return form < constant
            case constraint.Sense.EQUAL:
                return form == constant

    return nnf.fold(root, leaf, lambda node, operands: (z3.And if node.conjunctive else z3.Or)(operands))


def from_z3(root: Any) -> Nnf:
    """A quantifier-free expression of z3 as a formula.

    Raises:
        UnsupportedError: if a quantifier or anything but linear arithmetic is left.
    """
    return nnf.ExpressionReader(_shape, key=lambda node: node.get_id()).read(root)


_SHAPES = {
    z3.Z3_OP_TRUE: Operator.AND,
    z3.Z3_OP_FALSE: Operator.OR,
    z3.Z3_OP_AND: Operator.AND,
    z3.Z3_OP_OR: Operator.OR,
    z3.Z3_OP_NOT: Operator.NOT,
    z3.Z3_OP_IMPLIES: Operator.IMPLIES,
    z3.Z3_OP_LE: Operator.AT_MOST,
    z3.Z3_OP_LT: Operator.LESS,
    z3.Z3_OP_GE: Operator.AT_LEAST,
    z3.Z3_OP_GT: Operator.GREATER,
    z3.Z3_OP_EQ: Operator.EQUAL,
    z3.Z3_OP_DISTINCT: Operator.DIFFERENT,
    z3.Z3_OP_ADD: Operator.SUM,
    z3.Z3_OP_SUB: Operator.DIFFERENCE,
    z3.Z3_OP_UMINUS: Operator.DIFFERENCE,
    z3.Z3_OP_MUL: Operator.PRODUCT,
}


def _shape(node: Any) -> Shape:
    kind = node.decl().kind() if z3.is_app(node) else None
    if z3.is_rational_value(node):
        return Operator.NUMBER, (node.as_fraction(),)
    if kind == z3.Z3_OP_UNINTERPRETED and not node.num_args():
        return Operator.SYMBOL, (node.decl().name(),)
    if kind == z3.Z3_OP_EQ and z3.is_bool(node.arg(0)):
        return Operator.IFF, node.children()
    if kind not in _SHAPES:
        raise UnsupportedError(f"z3 left {node} in its result, expected linear arithmetic; choose another back end")
    return _SHAPES[kind], node.children()
