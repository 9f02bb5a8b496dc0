"""Formulas of linear real arithmetic over polynomials, with constants folded before any solver sees them.

pySMT, and z3 with it, is loaded with the first one: questions that shortest paths answer build none.
"""

from collections.abc import Callable, Hashable, Iterable
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, TypeAlias

from robust.errors import UnsupportedError
from robust.plan.model import Relation
from robust.plan.polynomial import Polynomial

Formula: TypeAlias = Any
"""A node of pySMT, which declares no types."""
Build: TypeAlias = Callable[[list[Formula]], Formula]


@cache
def _environment_class() -> Any:
    """pySMT's, but what works on formulas is made when it is first needed: making it all takes longer than most use."""
    from pysmt.environment import Environment  # noqa: PLC0415 - imports z3

    class LazyEnvironment(Environment):  # type: ignore[misc]
        simplifier = cached_property(Environment.SimplifierClass)
        substituter = cached_property(Environment.SubstituterClass)
        serializer = cached_property(Environment.HRSerializerClass)
        qfo = cached_property(Environment.QuantifierOracleClass)
        theoryo = cached_property(Environment.TheoryOracleClass)
        fvo = cached_property(Environment.FreeVarsOracleClass)
        sizeo = cached_property(Environment.SizeOracleClass)
        ao = cached_property(Environment.AtomsOracleClass)
        typeso = cached_property(Environment.TypesOracleClass)

        # What pySMT would make at once, in attributes that the properties above take the place of.
        SimplifierClass = SubstituterClass = HRSerializerClass = QuantifierOracleClass = staticmethod(lambda _: None)
        FreeVarsOracleClass = SizeOracleClass = AtomsOracleClass = TypesOracleClass = SimplifierClass
        TheoryOracleClass = SimplifierClass

    return LazyEnvironment


class Terms:
    """Builds pySMT formulas in an environment of its own; symbols stand for any printable variables."""

    def __init__(self) -> None:
        self._symbols: dict[Hashable, Formula] = {}
        self.translations: dict[str, Any] = {}
        """What solvers have translated of this environment's formulas already, by solver."""
        self._variables: dict[Formula, frozenset[Formula]] = {}
        self._sizes: dict[Formula, int] = {}
        self._comparisons: dict[tuple[Polynomial[Hashable], Relation], Formula] = {}

    @cached_property
    def environment(self) -> Any:
        """pySMT's home of these formulas."""
        return _environment_class()()

    @cached_property
    def manager(self) -> Any:
        """Makes the nodes."""
        manager = self.environment.formula_manager
        # Terms are of the right type by construction; checking every node takes longer than making it.
        manager._do_type_check = lambda _node: None
        return manager

    @cached_property
    def _types(self) -> Any:
        from pysmt import typing  # noqa: PLC0415 - loaded with the first formula

        return typing

    @cached_property
    def true(self) -> Formula:
        """The constant."""
        return self.manager.TRUE()

    @cached_property
    def false(self) -> Formula:
        """The constant."""
        return self.manager.FALSE()

    def real(self, variable: Hashable) -> Formula:
        """The real-valued symbol of a variable, named after it."""
        if variable not in self._symbols:
            self._symbols[variable] = self.manager.Symbol(str(variable), self._types.REAL)
        return self._symbols[variable]

    def fresh_boolean(self, name: str) -> Formula:
        return self.manager.FreshSymbol(self._types.BOOL, f"{name}%d")

    def truth(self, value: bool) -> Formula:
        return self.true if value else self.false

    def negation(self, formula: Formula) -> Formula:
        if formula is self.true:
            return self.false
        if formula is self.false:
            return self.true
        return formula.arg(0) if formula.is_not() else self.manager.Not(formula)

    def conjunction(self, formulas: Iterable[Formula]) -> Formula:
        return self._junction(formulas, self.true, self.false, self.manager.And)

    def disjunction(self, formulas: Iterable[Formula]) -> Formula:
        return self._junction(formulas, self.false, self.true, self.manager.Or)

    def _junction(self, formulas: Iterable[Formula], neutral: Formula, absorbing: Formula, build: Build) -> Formula:
        operands: dict[Formula, None] = {}
        for formula in formulas:
            if formula is absorbing:
                return absorbing
            if formula is not neutral:
                operands[formula] = None
        if not operands:
            return neutral
        if len(operands) == 1:
            return next(iter(operands))
        return build(list(operands))

    def implication(self, condition: Formula, consequence: Formula) -> Formula:
        return self.disjunction((self.negation(condition), consequence))

    def equivalence(self, left: Formula, right: Formula) -> Formula:
        return self.manager.Iff(left, right)

    def number(self, value: Fraction) -> Formula:
        return self.manager.Real(value)

    def linear(self, expression: Polynomial[Hashable]) -> Formula:
        """A linear polynomial as a real term.

        Raises:
            UnsupportedError: if a product of variables is left.
        """
        if not expression.is_linear:
            raise UnsupportedError(
                f"non-linear arithmetic: {expression} multiplies unknowns; expected a product with at most one factor "
                "that is not constant"
            )
        terms = [
            self.real(variable) if factor == 1 else self.manager.Times(self.number(factor), self.real(variable))
            for variable, factor in expression.coefficients()
        ]
        if expression.constant_term or not terms:
            terms.append(self.number(expression.constant_term))
        return terms[0] if len(terms) == 1 else self.manager.Plus(terms)

    def compare(self, expression: Polynomial[Hashable], relation: Relation) -> Formula:
        """`expression relation 0`; a constant expression is decided here."""
        if expression.is_constant:
            return self.truth(relation.holds(expression.constant_term))
        key = (expression, relation)
        if key not in self._comparisons:
            build = {
                Relation.AT_LEAST: self.manager.GE,
                Relation.GREATER: self.manager.GT,
                Relation.EQUAL: self.manager.Equals,
                Relation.DIFFERENT: self.manager.NotEquals,
            }[relation]
            self._comparisons[key] = build(self.linear(expression), self.number(Fraction(0)))
        return self._comparisons[key]

    def at_least(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.AT_LEAST)

    def greater(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.GREATER)

    def equal(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.EQUAL)

    def size(self, formula: Formula) -> int:
        """The number of distinct nodes of a formula."""
        if formula not in self._sizes:
            seen, queue = {formula}, [formula]
            for node in queue:
                new = [argument for argument in node.args() if argument not in seen]
                seen.update(new)
                queue += new
            self._sizes[formula] = len(seen)
        return self._sizes[formula]

    def variables(self, formula: Formula) -> frozenset[Formula]:
        """The symbols that occur in a formula."""
        if formula not in self._variables:
            self._variables[formula] = frozenset(self.environment.fvo.get_free_variables(formula))
        return self._variables[formula]
