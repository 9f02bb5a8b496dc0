"""Formulas in negation normal form over linear constraints: what the eliminators work on.

Nodes are shared; every traversal is a loop over the nodes, children first. Booleans occur as literals, reals by name in
constraints, whether they are parameters, time points or auxiliaries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, assert_never

from robust.errors import UnsupportedError
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.smt.terms import Formula, Terms

Model = Mapping[str, Fraction | bool]
"""A value for every symbol that matters, by name."""


@dataclass(frozen=True, slots=True)
class Literal:
    """A Boolean symbol has this value."""

    name: str
    value: bool


@dataclass(frozen=True, slots=True, eq=False)
class Junction:
    """A conjunction, or a disjunction; equal only to itself. Build with :func:`conjunction` and :func:`disjunction`."""

    conjunctive: bool
    operands: tuple[Nnf, ...]

    def __reduce__(self) -> tuple[Callable[[bool, tuple[Nnf, ...]], Junction], tuple[bool, tuple[Nnf, ...]]]:
        """Copies of the constants are the constants."""
        return _restored, (self.conjunctive, self.operands)


def _restored(conjunctive: bool, operands: tuple[Nnf, ...]) -> Junction:
    if operands:
        return Junction(conjunctive, operands)
    return TRUE if conjunctive else FALSE


Nnf = LinearConstraint | Literal | Junction
TRUE = Junction(True, ())
FALSE = Junction(False, ())


def conjunction(operands: Iterable[Nnf]) -> Nnf:
    """The conjunction, flattened, without duplicates; of parallel inequalities only the tightest."""
    flat = _flattened(operands, True)
    if flat is None:
        return FALSE
    constraints = trim(node for node in flat if isinstance(node, LinearConstraint))
    if any(constraint.is_false for constraint in constraints):
        return FALSE
    return _junction(True, [*constraints, *(node for node in flat if not isinstance(node, LinearConstraint))])


def disjunction(operands: Iterable[Nnf]) -> Nnf:
    """The disjunction, flattened, without duplicates; of parallel inequalities only the loosest."""
    flat = _flattened(operands, False)
    if flat is None:
        return TRUE
    equalities = [node for node in flat if isinstance(node, LinearConstraint) and node.is_equality]
    others = [node for node in flat if not isinstance(node, LinearConstraint)]
    opposites = trim(node.negation()[0] for node in flat if isinstance(node, LinearConstraint) and not node.is_equality)
    if any(opposite.is_false for opposite in opposites):
        return TRUE
    return _junction(False, [*(opposite.negation()[0] for opposite in opposites), *equalities, *others])


def _junction(conjunctive: bool, operands: list[Nnf]) -> Nnf:
    if not operands:
        return TRUE if conjunctive else FALSE
    return operands[0] if len(operands) == 1 else Junction(conjunctive, tuple(operands))


def _flattened(operands: Iterable[Nnf], conjunctive: bool) -> list[Nnf] | None:
    """Operands of nested junctions of the same kind; None if one of them decides the whole."""
    flat: dict[Nnf, None] = {}
    for operand in operands:
        match operand:
            case Junction(kind, parts):
                if kind is conjunctive:
                    flat.update(dict.fromkeys(parts))
                elif not parts:
                    return None
                else:
                    flat[operand] = None
            case LinearConstraint():
                if operand.is_false if conjunctive else operand.is_true:
                    return None
                if operand.coefficients:
                    flat[operand] = None
            case Literal(name, value):
                if Literal(name, not value) in flat:
                    return None
                flat[operand] = None
    return list(flat)


def postorder(root: Nnf) -> Iterator[Nnf]:
    """Every node once, children before parents."""
    done: set[Nnf] = set()
    stack: list[tuple[Nnf, bool]] = [(root, False)]
    while stack:
        node, ready = stack.pop()
        if node in done:
            continue
        if ready or not isinstance(node, Junction):
            done.add(node)
            yield node
        else:
            stack.append((node, True))
            stack.extend((operand, False) for operand in reversed(node.operands) if operand not in done)


def rebuild(root: Nnf, leaf: Callable[[LinearConstraint | Literal], Nnf]) -> Nnf:
    """Replace every leaf."""
    images: dict[Nnf, Nnf] = {}
    for node in postorder(root):
        if isinstance(node, Junction):
            operands = [images[operand] for operand in node.operands]
            if all(new is old for new, old in zip(operands, node.operands, strict=True)):
                images[node] = node
            else:
                images[node] = conjunction(operands) if node.conjunctive else disjunction(operands)
        else:
            images[node] = leaf(node)
    return images[root]


def negation(root: Nnf) -> Nnf:
    """The negation, in negation normal form again."""
    images: dict[Nnf, Nnf] = {}
    for node in postorder(root):
        match node:
            case Junction(conjunctive, operands):
                parts = [images[operand] for operand in operands]
                images[node] = disjunction(parts) if conjunctive else conjunction(parts)
            case LinearConstraint():
                images[node] = disjunction(node.negation())
            case Literal(name, value):
                images[node] = Literal(name, not value)
            case _:
                assert_never(node)
    return images[root]


def names_in(root: Nnf) -> frozenset[str]:
    """Names of all symbols that occur."""
    names: set[str] = set()
    for node in postorder(root):
        match node:
            case LinearConstraint():
                names.update(node.parameters)
            case Literal(name):
                names.add(name)
            case Junction():
                pass
    return frozenset(names)


def booleans_in(root: Nnf) -> frozenset[str]:
    """Names of the Boolean symbols that occur."""
    return frozenset(node.name for node in postorder(root) if isinstance(node, Literal))


@dataclass(frozen=True, slots=True)
class Layout:
    """The nodes of a formula, children first, with the positions of their operands; the root is the last."""

    nodes: tuple[Nnf, ...]
    operands: tuple[tuple[int, ...], ...]
    names: frozenset[str]

    def truths(self, model: Model) -> list[bool]:
        """The truth of every node under values of all symbols; symbols without a value are 0, or false."""
        values: dict[str, Any] = {name: model.get(name, Fraction(0)) for name in self.names}
        truth: list[bool] = []
        for node, operands in zip(self.nodes, self.operands, strict=True):
            match node:
                case LinearConstraint():
                    truth.append(node.evaluate(values))
                case Literal(name, value):
                    truth.append(bool(values[name]) is value)
                case Junction(conjunctive, _):
                    truth.append(all(truth[i] for i in operands) if conjunctive else any(truth[i] for i in operands))
                case _:
                    assert_never(node)
        return truth


@lru_cache(maxsize=4096)
def layout(root: Nnf) -> Layout:
    """The nodes of a formula in a row; remembered, because implicants are asked for again and again."""
    nodes = tuple(postorder(root))
    position = {node: index for index, node in enumerate(nodes)}
    operands = tuple(
        tuple(position[operand] for operand in node.operands) if isinstance(node, Junction) else () for node in nodes
    )
    return Layout(nodes, operands, names_in(root))


def implicant(root: Nnf, model: Model, chosen: dict[LinearConstraint | Literal, None]) -> bool:
    """Add leaves that are true in the model and entail the formula to `chosen`; False if the formula is false there.

    Of the disjuncts that are true one is taken that needs few leaves besides those chosen already.
    """
    plan = layout(root)
    truth = plan.truths(model)
    if not truth[-1]:
        return False
    cost: list[int] = []
    for node, operands, holds in zip(plan.nodes, plan.operands, truth, strict=True):
        if not holds:
            cost.append(0)
        elif not isinstance(node, Junction):
            cost.append(0 if node in chosen else 1)
        elif node.conjunctive:
            cost.append(sum(cost[i] for i in operands))
        else:
            cost.append(min(cost[i] for i in operands if truth[i]))
    stack = [len(truth) - 1]
    while stack:
        index = stack.pop()
        node = plan.nodes[index]
        if not isinstance(node, Junction):
            chosen[node] = None
        elif node.conjunctive:
            stack.extend(reversed(plan.operands[index]))
        else:
            stack.append(min((i for i in plan.operands[index] if truth[i]), key=cost.__getitem__))
    return True


class Reader:
    """Translates between the formulas of one `Terms` and their normal forms; remembers what it has read."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._read: dict[tuple[Formula, bool], Nnf] = {}
        self._forms: dict[Formula, tuple[dict[str, Fraction], Fraction]] = {}
        self._written: dict[Nnf, Formula] = {}
        self._outside: dict[int, tuple[tuple[LinearConstraint, ...], Formula]] = {}

    def read(self, formula: Formula) -> Nnf:
        """The negation normal form of a quantifier-free formula of linear real arithmetic.

        Raises:
            UnsupportedError: if it contains anything else.
        """
        stack = [(formula, True)]
        while stack:
            key = stack[-1]
            if key in self._read:
                stack.pop()
                continue
            missing = [part for part in self._parts(*key) if part not in self._read]
            if missing:
                stack += missing
            else:
                self._read[key] = self._node(*key)
                stack.pop()
        return self._read[formula, True]

    def _parts(self, node: Formula, positive: bool) -> list[tuple[Formula, bool]]:
        if node.is_not():
            return [(node.arg(0), not positive)]
        if node.is_and() or node.is_or():
            return [(argument, positive) for argument in node.args()]
        if node.is_implies():
            return [(node.arg(0), not positive), (node.arg(1), positive)]
        if node.is_iff():
            return [(argument, sign) for argument in node.args() for sign in (True, False)]
        return []

    def _node(self, node: Formula, positive: bool) -> Nnf:
        parts = [self._read[part] for part in self._parts(node, positive)]
        if node.is_not():
            return parts[0]
        if node.is_and() or node.is_or() or node.is_implies():
            return conjunction(parts) if node.is_and() is positive else disjunction(parts)
        if node.is_iff():
            left, not_left, right, not_right = parts
            if not positive:
                right, not_right = not_right, right
            return conjunction((disjunction((not_left, right)), disjunction((left, not_right))))
        if node.is_bool_constant():
            return TRUE if node.constant_value() is positive else FALSE
        if node.is_symbol() and node.symbol_type().is_bool_type():
            return Literal(node.symbol_name(), positive)
        constraint = self._constraint(node)
        return constraint if positive else disjunction(constraint.negation())

    def _constraint(self, node: Formula) -> LinearConstraint:
        senses = ((node.is_le(), Sense.AT_MOST), (node.is_lt(), Sense.LESS), (node.is_equals(), Sense.EQUAL))
        sense = next((sense for applies, sense in senses if applies), None)
        if sense is None:
            raise UnsupportedError(f"found {node}, expected a comparison of linear real terms")
        left, right = self._form(node.arg(0)), self._form(node.arg(1))
        total = dict(left[0])
        for name, factor in right[0].items():
            total[name] = total.get(name, Fraction(0)) - factor
        return LinearConstraint(tuple(total.items()), sense, right[1] - left[1])

    def _form(self, term: Formula) -> tuple[dict[str, Fraction], Fraction]:
        """Coefficients and constant of a term; terms are sums of products, never deep."""
        if term not in self._forms:
            self._forms[term] = self._new_form(term)
        return self._forms[term]

    def _new_form(self, term: Formula) -> tuple[dict[str, Fraction], Fraction]:
        if term.is_constant():
            value = term.constant_value()
            return {}, Fraction(value.numerator, value.denominator)
        if term.is_symbol():
            return {term.symbol_name(): Fraction(1)}, Fraction(0)
        parts = [self._form(argument) for argument in term.args()]
        if term.is_times():
            scale = Fraction(1)
            form: tuple[dict[str, Fraction], Fraction] = ({}, Fraction(1))
            for part in parts:
                if part[0] and form[0]:
                    raise UnsupportedError(f"found {term}, expected a product with at most one factor not constant")
                if part[0]:
                    form = (part[0], part[1])
                else:
                    scale *= part[1]
            return {name: factor * scale for name, factor in form[0].items()}, form[1] * scale
        if term.is_plus() or term.is_minus():
            total: dict[str, Fraction] = {}
            constant = Fraction(0)
            for index, part in enumerate(parts):
                sign = -1 if index and term.is_minus() else 1
                constant += sign * part[1]
                for name, factor in part[0].items():
                    total[name] = total.get(name, Fraction(0)) + sign * factor
            return total, constant
        raise UnsupportedError(f"found {term}, expected a linear real term")

    def write(self, root: Nnf) -> Formula:
        """The formula of a normal form."""
        if root in self._written:
            return self._written[root]
        for node in postorder(root):
            if node in self._written:
                continue
            match node:
                case LinearConstraint():
                    self._written[node] = node.to_formula(self._terms)
                case Literal(name, value):
                    symbol = self._terms.manager.Symbol(name)
                    self._written[node] = symbol if value else self._terms.negation(symbol)
                case Junction(conjunctive, operands):
                    build = self._terms.conjunction if conjunctive else self._terms.disjunction
                    self._written[node] = build(self._written[operand] for operand in operands)
                case _:
                    assert_never(node)
        return self._written[root]

    def symbols(self, names: Iterable[str]) -> list[Formula]:
        """The symbols of these names that formulas have been made of."""
        known = self._terms.manager.symbols
        return [known[name] for name in names if name in known]

    def outside(self, piece: tuple[LinearConstraint, ...]) -> Formula:
        """The complement of a polyhedron; remembered, because many sessions exclude the same pieces."""
        if id(piece) not in self._outside:
            halves = (half for constraint in piece for half in constraint.negation())
            self._outside[id(piece)] = (piece, self.write(disjunction(halves)))
        return self._outside[id(piece)][1]
