"""Formulas in negation normal form over linear constraints: what the eliminators work on.

Nodes are shared; every traversal is a loop over the nodes, children first. Booleans occur as literals, reals by name in
constraints, whether they are parameters, time points or auxiliaries.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import lru_cache
from itertools import chain, repeat
from math import lcm, prod
from typing import Any, TypeVar, assert_never

from pysmt import operators

from robust.errors import UnsupportedError
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.smt.session import Formula, Terms

Image = TypeVar("Image")
Model = Mapping[str, Fraction | bool]
"""A value for every symbol that matters, by name."""


@dataclass(frozen=True, slots=True)
class BoolLeaf:
    """A Boolean symbol has this value."""

    name: str
    value: bool

    @property
    def parameters(self) -> tuple[str, ...]:
        """The symbol, as of a constraint."""
        return (self.name,)


Leaf = LinearConstraint | BoolLeaf


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


Nnf = LinearConstraint | BoolLeaf | Junction
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
            case BoolLeaf(name, value):
                if BoolLeaf(name, not value) in flat:
                    return None
                flat[operand] = None
    return list(flat)


def postorder(root: Nnf, known: Container[Nnf] = ()) -> Iterator[Nnf]:
    """Every node once, children before parents; without those known and what only they consist of."""
    done: set[Nnf] = set()
    stack: list[tuple[Nnf, bool]] = [(root, False)]
    while stack:
        node, ready = stack.pop()
        if node in done or node in known:
            continue
        if ready or not isinstance(node, Junction):
            done.add(node)
            yield node
        else:
            stack.append((node, True))
            stack.extend((operand, False) for operand in reversed(node.operands) if operand not in done)


def fold(
    root: Nnf,
    leaf: Callable[[Leaf], Image],
    junction: Callable[[Junction, list[Image]], Image],
    images: dict[Nnf, Image] | None = None,
) -> Image:
    """What a formula becomes, from what its leaves and its junctions become; `images` remembers it between calls."""
    images = {} if images is None else images
    if root not in images:
        for node in postorder(root, images):
            if isinstance(node, Junction):
                images[node] = junction(node, [images[operand] for operand in node.operands])
            else:
                images[node] = leaf(node)
    return images[root]


def rebuild(root: Nnf, leaf: Callable[[Leaf], Nnf]) -> Nnf:
    """Replace every leaf."""

    def junction(node: Junction, operands: list[Nnf]) -> Nnf:
        if all(new is old for new, old in zip(operands, node.operands, strict=True)):
            return node
        return conjunction(operands) if node.conjunctive else disjunction(operands)

    return fold(root, leaf, junction)


def negation(root: Nnf) -> Nnf:
    """The negation, in negation normal form again."""

    def leaf(node: Leaf) -> Nnf:
        return BoolLeaf(node.name, not node.value) if isinstance(node, BoolLeaf) else disjunction(node.negation())

    return fold(root, leaf, lambda node, parts: disjunction(parts) if node.conjunctive else conjunction(parts))


def names_in(root: Nnf) -> frozenset[str]:
    """Names of all symbols that occur."""
    leaves = (node for node in postorder(root) if not isinstance(node, Junction))
    return frozenset(name for leaf in leaves for name in leaf.parameters)


def booleans_in(root: Nnf) -> frozenset[str]:
    """Names of the Boolean symbols that occur."""
    return frozenset(node.name for node in postorder(root) if isinstance(node, BoolLeaf))


@dataclass(frozen=True, slots=True)
class NodeOrder:
    """The nodes of a formula, children first, with the positions of their operands; the root is the last."""

    nodes: tuple[Nnf, ...]
    operands: tuple[tuple[int, ...], ...]
    names: frozenset[str]

    def truths(self, model: Model) -> list[bool]:
        """The truth of every node under values of all symbols; symbols without a value are 0, or false."""
        values: dict[str, Any] = {name: model.get(name, Fraction(0)) for name in self.names}
        # A truth value is a whole number as well, so one denominator is enough for all.
        unit = lcm(*(value.denominator for value in values.values()))
        whole = {name: value.numerator * (unit // value.denominator) for name, value in values.items()}
        truth: list[bool] = []
        for node, operands in zip(self.nodes, self.operands, strict=True):
            match node:
                case LinearConstraint(coefficients, relation, constant):
                    total = sum([factor * whole[name] for name, factor in coefficients])
                    truth.append(relation.holds(total * constant.denominator, constant.numerator * unit))
                case BoolLeaf(name, value):
                    truth.append(bool(values[name]) is value)
                case Junction(conjunctive, _):
                    truth.append(all(truth[i] for i in operands) if conjunctive else any(truth[i] for i in operands))
                case _:
                    assert_never(node)
        return truth


@lru_cache(maxsize=4096)
def layout(root: Nnf) -> NodeOrder:
    """The nodes of a formula in a row; remembered, because implicants are asked for again and again."""
    nodes = tuple(postorder(root))
    position = {node: index for index, node in enumerate(nodes)}
    operands = tuple(
        tuple(position[operand] for operand in node.operands) if isinstance(node, Junction) else () for node in nodes
    )
    return NodeOrder(nodes, operands, names_in(root))


def implicant(root: Nnf, model: Model, chosen: dict[Leaf, None]) -> bool:
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


Operator = Enum(
    "Operator",
    "AND OR NOT IMPLIES IFF CHOICE AT_MOST LESS AT_LEAST GREATER EQUAL DIFFERENT SUM DIFFERENCE PRODUCT NUMBER SYMBOL",
)
"""What the nodes of a solver's expressions can be: Boolean, relations, arithmetic, and what stands alone.

Constants are conjunctions or disjunctions of nothing; NUMBER and SYMBOL have a fraction or a name as operand.
"""
Shape = tuple[Operator, Sequence[Any]]
"""What a node is, and its operands."""

_RELATIONS = {
    Operator.AT_MOST: (Sense.AT_MOST, 1),
    Operator.LESS: (Sense.LESS, 1),
    Operator.AT_LEAST: (Sense.AT_MOST, -1),
    Operator.GREATER: (Sense.LESS, -1),
    Operator.EQUAL: (Sense.EQUAL, 1),
    Operator.DIFFERENT: (Sense.EQUAL, 1),
}
_Form = tuple[dict[str, Fraction], Fraction]
"""Coefficients and constant of a linear term."""


class ExpressionReader:
    """Reads quantifier-free formulas of linear real arithmetic; remembers what it has read.

    Args:
        shape: what a node is; raises UnsupportedError for anything else. A negated term is a difference of one operand.
        key: what identifies a node for as long as its formula lives.
    """

    def __init__(self, shape: Callable[[Any], Shape], key: Callable[[Any], Hashable] = lambda node: node) -> None:
        self._shape = shape
        self._key = key
        self._read: dict[tuple[Hashable, bool], Nnf] = {}
        self._forms: dict[Hashable, _Form] = {}

    def read(self, root: Any) -> Nnf:
        """The negation normal form of a formula.

        Raises:
            UnsupportedError: if it is anything but quantifier-free linear real arithmetic.
        """
        stack = [(root, True)]
        while stack:
            node, positive = stack[-1]
            key = self._key(node), positive
            if key in self._read:
                stack.pop()
                continue
            shape = self._shape(node)
            parts = _parts(shape, positive)
            missing = [(part, sign) for part, sign in parts if (self._key(part), sign) not in self._read]
            if missing:
                stack += missing
            else:
                images = [self._read[self._key(part), sign] for part, sign in parts]
                self._read[key] = self._image(node, shape, images, positive)
                stack.pop()
        return self._read[self._key(root), True]

    def _image(self, node: Any, shape: Shape, parts: list[Nnf], positive: bool) -> Nnf:
        operator, operands = shape
        match operator:
            case Operator.NOT:
                return parts[0]
            case Operator.AND | Operator.OR | Operator.IMPLIES:
                return conjunction(parts) if (operator is Operator.AND) is positive else disjunction(parts)
            case Operator.IFF | Operator.CHOICE:
                condition, otherwise, first, second = parts
                return conjunction((disjunction((otherwise, first)), disjunction((condition, second))))
            case Operator.SYMBOL:
                return BoolLeaf(operands[0], positive)
        if operator not in _RELATIONS:
            raise UnsupportedError(f"found {node}, expected a comparison of linear real terms")
        sense, sign = _RELATIONS[operator]
        form, constant = _added([self._form(operands[0]), self._form(operands[1])], (sign, -sign))
        constraint = LinearConstraint.of(form, sense, -constant)
        return constraint if positive is not (operator is Operator.DIFFERENT) else negation(constraint)

    def _form(self, term: Any) -> _Form:
        """Coefficients and constant of a term; terms are sums of products, never deep."""
        key = self._key(term)
        if key not in self._forms:
            self._forms[key] = self._new_form(term)
        return self._forms[key]

    def _new_form(self, term: Any) -> _Form:
        operator, operands = self._shape(term)
        match operator:
            case Operator.NUMBER:
                return {}, operands[0]
            case Operator.SYMBOL:
                return {operands[0]: Fraction(1)}, Fraction(0)
            case Operator.SUM:
                return _added(map(self._form, operands), repeat(1))
            case Operator.DIFFERENCE:
                signs = chain((1,), repeat(-1)) if len(operands) > 1 else (-1,)
                return _added(map(self._form, operands), signs)
            case Operator.PRODUCT:
                forms = [self._form(operand) for operand in operands]
                scale = prod((constant for form, constant in forms if not form), start=Fraction(1))
                linear = [form for form in forms if form[0]] or [({}, Fraction(1))]
                if len(linear) > 1:
                    raise UnsupportedError(f"found {term}, expected a product with at most one factor not constant")
                return _added(linear, (scale,))
        raise UnsupportedError(f"found {term}, expected a linear real term")


def _parts(shape: Shape, positive: bool) -> list[tuple[Any, bool]]:
    """The Boolean operands of a node, each with whether it or its negation is needed."""
    operator, operands = shape
    match operator:
        case Operator.NOT:
            return [(operands[0], not positive)]
        case Operator.AND | Operator.OR:
            return [(operand, positive) for operand in operands]
        case Operator.IMPLIES:
            return [(operands[0], not positive), (operands[1], positive)]
        case Operator.IFF:
            return [(operands[0], True), (operands[0], False), (operands[1], positive), (operands[1], not positive)]
        case Operator.CHOICE:
            return [(operands[0], True), (operands[0], False), (operands[1], positive), (operands[2], positive)]
    return []


def _added(forms: Iterable[_Form], factors: Iterable[Fraction | int]) -> _Form:
    """The sum of linear forms, each times its factor."""
    total: dict[str, Fraction] = {}
    constant = Fraction(0)
    for (form, number), factor in zip(forms, factors, strict=False):
        constant += factor * number
        for name, coefficient in form.items():
            total[name] = total.get(name, Fraction(0)) + factor * coefficient
    return total, constant


_SHAPES = {
    operators.AND: Operator.AND,
    operators.OR: Operator.OR,
    operators.NOT: Operator.NOT,
    operators.IMPLIES: Operator.IMPLIES,
    operators.IFF: Operator.IFF,
    operators.ITE: Operator.CHOICE,
    operators.LE: Operator.AT_MOST,
    operators.LT: Operator.LESS,
    operators.EQUALS: Operator.EQUAL,
    operators.PLUS: Operator.SUM,
    operators.MINUS: Operator.DIFFERENCE,
    operators.TIMES: Operator.PRODUCT,
}


def _shape(node: Formula) -> Shape:
    if node.is_symbol():
        return Operator.SYMBOL, (node.symbol_name(),)
    if node.is_bool_constant():
        return (Operator.AND if node.constant_value() else Operator.OR), ()
    if node.is_constant():
        value = node.constant_value()
        return Operator.NUMBER, (Fraction(value.numerator, value.denominator),)
    if node.node_type() not in _SHAPES:
        raise UnsupportedError(f"found {node}, expected a formula of linear real arithmetic")
    return _SHAPES[node.node_type()], node.args()


class FormulaReader(ExpressionReader):
    """Translates between the formulas of one `Terms` and their normal forms."""

    def __init__(self, terms: Terms) -> None:
        super().__init__(_shape)
        self._terms = terms
        self._written: dict[Nnf, Formula] = {}
        self._outside: dict[int, tuple[tuple[LinearConstraint, ...], Formula]] = {}

    def write(self, root: Nnf) -> Formula:
        """The formula of a normal form."""
        terms = self._terms

        def leaf(node: Leaf) -> Formula:
            if isinstance(node, LinearConstraint):
                return node.to_formula(terms)
            symbol = terms.manager.Symbol(node.name)
            return symbol if node.value else terms.negation(symbol)

        def junction(node: Junction, operands: list[Formula]) -> Formula:
            return terms.conjunction(operands) if node.conjunctive else terms.disjunction(operands)

        return fold(root, leaf, junction, self._written)

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


def alternatives_of(node: Nnf) -> list[tuple[LinearConstraint, ...]] | None:
    """The conjunctions of which one holds; None if it is not simply that."""
    if node in (TRUE, FALSE):
        return [()] if node is TRUE else []
    parts = node.operands if isinstance(node, Junction) and not node.conjunctive else (node,)
    alternatives: list[tuple[LinearConstraint, ...]] = []
    for part in parts:
        operands = part.operands if isinstance(part, Junction) and part.conjunctive else (part,)
        constraints = tuple(operand for operand in operands if isinstance(operand, LinearConstraint))
        if len(constraints) < len(operands):
            return None
        alternatives.append(constraints)
    return alternatives
