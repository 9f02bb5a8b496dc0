"""Formulas as circuits: conjunctions over linear atoms, each built once.

A node is a positive number, a literal a node or its negative. Node kinds are those that certificates know; a
disjunction is a negated conjunction, an equation the conjunction of two inequalities, a proposition the atom that a
variable of its own is above zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from robust.certify.linear import PROPOSITION, Atom, atom_of
from robust.errors import UnsupportedError
from robust.smt.terms import Formula, Terms

Linear = tuple[dict[str, Fraction], Fraction]
"""Coefficients by variable, and a constant."""


@dataclass(frozen=True, slots=True)
class Conjunction:
    """True if all its inputs are; the empty one is true."""

    inputs: tuple[int, ...]


Node = Atom | Conjunction


@dataclass
class Circuit:
    """Nodes, numbered from 1; equal nodes have one number."""

    nodes: list[Node] = field(default_factory=list)
    _numbers: dict[Node, int] = field(default_factory=dict)

    def node(self, literal: int) -> Node:
        return self.nodes[abs(literal) - 1]

    def add(self, node: Node) -> int:
        """The number of a node."""
        if node not in self._numbers:
            self.nodes.append(node)
            self._numbers[node] = len(self.nodes)
        return self._numbers[node]

    @property
    def true(self) -> int:
        return self.add(Conjunction(()))

    def conjunction(self, literals: Iterable[int]) -> int:
        """The literal of a conjunction, folded where constants or contradictions decide it."""
        inputs = dict.fromkeys(literal for literal in literals if literal != self.true)
        if -self.true in inputs or any(-literal in inputs for literal in inputs):
            return -self.true
        if len(inputs) == 1:
            (only,) = inputs
            return only
        return self.add(Conjunction(tuple(inputs)))

    def disjunction(self, literals: Iterable[int]) -> int:
        return -self.conjunction(-literal for literal in literals)

    def equivalence(self, left: int, right: int) -> int:
        return self.conjunction((self.disjunction((-left, right)), self.disjunction((left, -right))))

    def proposition(self, name: str) -> int:
        return -self.at_most({PROPOSITION + name: Fraction(1)}, Fraction(0))

    def at_most(self, coefficients: Mapping[str, Fraction], bound: Fraction, *, strict: bool = False) -> int:
        """`Σ coefficient · variable ≤ bound`, or `<` if strict."""
        if not any(coefficients.values()):
            return self.true if bound > 0 or (bound == 0 and not strict) else -self.true
        atom, positive = atom_of(coefficients, strict, bound)
        number = self.add(atom)
        return number if positive else -number


def conjuncts(circuit: Circuit, literals: Iterable[int]) -> list[int]:
    """Literals whose conjunction is that of the given ones, none of which is a conjunction itself."""
    pending = list(literals)[::-1]
    found: dict[int, None] = {}
    while pending:
        literal = pending.pop()
        node = circuit.node(literal)
        if isinstance(node, Conjunction) and literal > 0:
            pending += reversed(node.inputs)
        else:
            found[literal] = None
    return list(found)


class Translator:
    """From formulas of one environment to literals of a circuit."""

    def __init__(self, terms: Terms, circuit: Circuit) -> None:
        self._terms = terms
        self.circuit = circuit
        self._literals: dict[Formula, int] = {}
        self._linear: dict[Formula, Linear] = {}

    def literal(self, formula: Formula) -> int:
        """The literal that a formula becomes.

        Raises:
            UnsupportedError: for a kind of formula that the encodings do not build.
        """
        pending = [formula]
        while pending:
            node = pending[-1]
            if node in self._literals:
                pending.pop()
                continue
            missing = [] if node.is_theory_relation() else [a for a in node.args() if a not in self._literals]
            if missing:
                pending += missing
                continue
            pending.pop()
            self._literals[node] = self._translate(node)
        return self._literals[formula]

    def _translate(self, node: Formula) -> int:  # noqa: PLR0911 - one return for each kind
        circuit = self.circuit
        inputs = [] if node.is_theory_relation() else [self._literals[argument] for argument in node.args()]
        if node.is_true() or node.is_false():
            return circuit.true if node.is_true() else -circuit.true
        if node.is_and():
            return circuit.conjunction(inputs)
        if node.is_or():
            return circuit.disjunction(inputs)
        if node.is_not():
            return -inputs[0]
        if node.is_iff():
            return circuit.equivalence(*inputs)
        if node.is_implies():
            return circuit.disjunction((-inputs[0], inputs[1]))
        if node.is_symbol() and not node.is_theory_relation():
            return circuit.proposition(node.symbol_name())
        if node.is_le() or node.is_lt() or node.is_equals():
            return self._comparison(node)
        raise UnsupportedError(f"found a formula of kind {node.node_type()}, expected one over linear atoms")

    def _comparison(self, node: Formula) -> int:
        left, right = map(self.linear, node.args())
        difference = dict(left[0])
        for name, factor in right[0].items():
            difference[name] = difference.get(name, Fraction(0)) - factor
        bound = right[1] - left[1]
        if not node.is_equals():
            return self.circuit.at_most(difference, bound, strict=node.is_lt())
        opposite = {name: -factor for name, factor in difference.items()}
        halves = (self.circuit.at_most(difference, bound), self.circuit.at_most(opposite, -bound))
        return self.circuit.conjunction(halves)

    def linear(self, term: Formula) -> Linear:
        """A real term as coefficients and a constant."""
        pending = [term]
        while pending:
            node = pending[-1]
            missing = [argument for argument in node.args() if argument not in self._linear]
            if node not in self._linear and missing:
                pending += missing
                continue
            pending.pop()
            if node not in self._linear:
                self._linear[node] = self._combine(node, [self._linear[argument] for argument in node.args()])
        return self._linear[term]

    def _combine(self, node: Formula, parts: list[Linear]) -> Linear:
        if node.is_symbol():
            return {node.symbol_name(): Fraction(1)}, Fraction(0)
        if node.is_real_constant() or node.is_int_constant():
            return {}, Fraction(node.constant_value())
        if node.is_plus():
            return _sum(parts)
        if node.is_minus():
            return _sum([parts[0], _scaled(parts[1], Fraction(-1))])
        if node.is_times():
            result: Linear = ({}, Fraction(1))
            for part in parts:
                if part[0] and result[0]:
                    raise UnsupportedError("found a product of unknowns, expected linear arithmetic")
                result = _scaled(part, result[1]) if part[0] or not result[0] else _scaled(result, part[1])
            return result
        if node.is_toreal():
            return parts[0]
        raise UnsupportedError(f"found a term of kind {node.node_type()}, expected linear arithmetic")


def _sum(parts: list[Linear]) -> Linear:
    total: dict[str, Fraction] = {}
    constant = Fraction(0)
    for coefficients, value in parts:
        constant += value
        for name, factor in coefficients.items():
            total[name] = total.get(name, Fraction(0)) + factor
    return total, constant


def _scaled(part: Linear, factor: Fraction) -> Linear:
    return {name: value * factor for name, value in part[0].items()}, part[1] * factor
