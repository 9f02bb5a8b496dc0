"""Quantifier elimination by cvc5, one disjunct after the other."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import Any

from robust.errors import SolverError, UnsupportedError
from robust.qe import constraint, nnf
from robust.qe.conjunctions import Conjunction
from robust.qe.eliminate import enumerate, interface
from robust.qe.nnf import FALSE, BoolLeaf, Junction, Leaf, Nnf, Operator, Shape, names_in
from robust.smt.limits import Deadline, stream_from_copy

try:
    import cvc5
    from cvc5 import Kind
except ImportError as error:
    raise SolverError("cvc5 is not installed; expected the Python package cvc5") from error


class Cvc5Disjuncts(interface.Eliminator):
    """`getQuantifierEliminationDisjunct`, until nothing is left."""

    name = "cvc5"
    booleans = False

    def eliminate(
        self, query: interface.Query, known: Iterable[Conjunction], deadline: Deadline
    ) -> Iterator[Conjunction]:
        said = list(known)
        formula = interface.without(query.formula, said)
        if booleans := nnf.booleans_in(formula):
            raise self.unable("booleans", f"the Boolean symbol {min(booleans)!r}")
        for result in stream_from_copy(
            lambda: self._work(formula, query.eliminated), deadline, "quantifier elimination"
        ):
            for piece in enumerate.polyhedra_of(result, self.context, deadline, said):
                yield piece
                said.append(piece)

    def _work(self, formula: Nnf, eliminated: Iterable[str]) -> Iterator[Nnf]:
        native = _Native(formula)
        quantified = native.exists(formula, eliminated)
        while True:
            disjunct = native.solver.getQuantifierEliminationDisjunct(quantified)
            result = nnf.ExpressionReader(_shape).read(disjunct)
            if result is FALSE:
                return
            yield result
            if result is nnf.TRUE:
                return
            native.solver.assertFormula(native.manager.mkTerm(Kind.NOT, disjunct))


class _Native:
    """One solver of cvc5 with the symbols of a formula."""

    def __init__(self, formula: Nnf) -> None:
        self.manager = cvc5.TermManager()
        self.solver = cvc5.Solver(self.manager)
        self.solver.setLogic("LRA")
        self._real = self.manager.getRealSort()
        self._symbols = {name: self.manager.mkConst(self._real, name) for name in sorted(names_in(formula))}

    def exists(self, formula: Nnf, eliminated: Iterable[str]) -> Any:
        bound = {name: self.manager.mkVar(self._real, name) for name in sorted(eliminated)}
        body = self._write(formula, {**self._symbols, **bound})
        # Without a variable to eliminate, a dummy one keeps it a quantified formula.
        variables = list(bound.values()) or [self.manager.mkVar(self._real, "nothing")]
        return self.manager.mkTerm(Kind.EXISTS, self.manager.mkTerm(Kind.VARIABLE_LIST, *variables), body)

    def _write(self, root: Nnf, symbols: dict[str, Any]) -> Any:
        manager = self.manager

        def number(value: Fraction | int) -> Any:
            return manager.mkReal(value.numerator, value.denominator)

        def joined(kind: Kind, parts: list[Any]) -> Any:
            return parts[0] if len(parts) == 1 else manager.mkTerm(kind, *parts)

        def leaf(node: Leaf) -> Any:
            if isinstance(node, BoolLeaf):
                raise TypeError(f"{node.name!r} is no real symbol")
            parts = [manager.mkTerm(Kind.MULT, number(c), symbols[name]) for name, c in node.coefficients]
            kind = {
                constraint.Sense.AT_MOST: Kind.LEQ,
                constraint.Sense.LESS: Kind.LT,
                constraint.Sense.EQUAL: Kind.EQUAL,
            }[node.relation]
            return manager.mkTerm(kind, joined(Kind.ADD, parts), number(node.constant))

        def junction(node: Junction, operands: list[Any]) -> Any:
            if not operands:
                return manager.mkBoolean(node.conjunctive)
            return joined(Kind.AND if node.conjunctive else Kind.OR, operands)

        return nnf.fold(root, leaf, junction)


_SHAPES = {
    Kind.AND: Operator.AND,
    Kind.OR: Operator.OR,
    Kind.NOT: Operator.NOT,
    Kind.IMPLIES: Operator.IMPLIES,
    Kind.ITE: Operator.CHOICE,
    Kind.LEQ: Operator.AT_MOST,
    Kind.LT: Operator.LESS,
    Kind.GEQ: Operator.AT_LEAST,
    Kind.GT: Operator.GREATER,
    Kind.EQUAL: Operator.EQUAL,
    Kind.DISTINCT: Operator.DIFFERENT,
    Kind.ADD: Operator.SUM,
    Kind.TO_REAL: Operator.SUM,
    Kind.SUB: Operator.DIFFERENCE,
    Kind.NEG: Operator.DIFFERENCE,
    Kind.MULT: Operator.PRODUCT,
}


def _shape(node: Any) -> Shape:
    kind = node.getKind()
    if kind == Kind.CONST_BOOLEAN:
        return (Operator.AND if node.getBooleanValue() else Operator.OR), ()
    if node.isRealValue() or node.isIntegerValue():
        return Operator.NUMBER, (Fraction(node.getRealValue() if node.isRealValue() else node.getIntegerValue()),)
    if kind == Kind.CONSTANT:
        return Operator.SYMBOL, (node.getSymbol(),)
    if kind == Kind.EQUAL and node[0].getSort().isBoolean():
        return Operator.IFF, list(node)
    if kind not in _SHAPES:
        raise UnsupportedError(f"cvc5 left {node} in its result, expected linear arithmetic; choose another back end")
    return _SHAPES[kind], list(node)
