"""Linear constraints in the form that certificates write, and why a set of them contradicts itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm

from robust.errors import UnsupportedError
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.simplex import Tableau, feasible_point
from robust.smt.terms import Formula, Terms

Multipliers = tuple[int, ...]

PROPOSITION = "boolean "
"""How the names of variables begin that stand for propositions: true if they are above zero."""


@dataclass(frozen=True, slots=True)
class Atom:
    """`Σ factor · variable ≤ bound`, or `<` if strict; integers without common divisor, the first factor positive.

    A constraint or its negation has this form, so that a constraint and its negation share an atom.
    """

    coefficients: tuple[tuple[str, int], ...]
    strict: bool
    bound: int

    @property
    def is_proposition(self) -> bool:
        """Whether it is about a proposition, so that only other bounds of one variable can contradict it."""
        return self.coefficients[0][0].startswith(PROPOSITION)


def atom_of(coefficients: Mapping[str, Fraction], strict: bool, bound: Fraction) -> tuple[Atom, bool]:
    """`Σ factor · variable ≤ bound` as an atom, and whether it is the atom itself rather than its negation."""
    nonzero = sorted((name, factor) for name, factor in coefficients.items() if factor)
    scale = Fraction(lcm(bound.denominator, *(factor.denominator for _, factor in nonzero)))
    whole = [int(factor * scale) for _, factor in nonzero]
    constant = int(bound * scale)
    divisor = gcd(constant, *whole)
    whole, constant = [factor // divisor for factor in whole], constant // divisor
    names = [name for name, _ in nonzero]
    if whole[0] > 0:
        return Atom(tuple(zip(names, whole, strict=True)), strict, constant), True
    # −a·x ≤ b is a·x ≥ −b, the negation of a·x < −b.
    return Atom(tuple(zip(names, (-factor for factor in whole), strict=True)), not strict, -constant), False


@dataclass(frozen=True, slots=True)
class Constraint:
    """`Σ factor · variable ≤ bound`, or `<` if strict: an atom, or the negation of one."""

    coefficients: tuple[tuple[str, int], ...]
    strict: bool
    bound: int


def constraint(atom: Atom, value: bool) -> Constraint:
    """What an atom says if it is true, or if it is false."""
    if value:
        return Constraint(atom.coefficients, atom.strict, atom.bound)
    return Constraint(tuple((name, -factor) for name, factor in atom.coefficients), not atom.strict, -atom.bound)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Which of some constraints contradict each other: positive multiples of them add up to `0 < 0` or `0 ≤ −1`."""

    indices: tuple[int, ...]
    multipliers: Multipliers


def contradiction(constraints: Sequence[Constraint]) -> Contradiction | None:
    """A minimal contradictory subset with its multipliers [Farkas 1902]; None if some point satisfies all."""
    names = {name: index for index, name in enumerate(dict.fromkeys(n for c in constraints for n, _ in c.coefficients))}
    tableau = Tableau(len(names))
    slacks: dict[int, int] = {}
    for index, each in enumerate(constraints):
        form = [0] * len(names)
        for name, factor in each.coefficients:
            form[names[name]] = factor
        slacks[tableau.add(form, Sense.LESS if each.strict else Sense.AT_MOST, each.bound)] = index
    if tableau.restore():
        return None
    indices = tuple(sorted(slacks[slack] for slack in tableau.conflict))
    return _weighed(constraints, indices)


def _weighed(constraints: Sequence[Constraint], indices: Sequence[int]) -> Contradiction:
    """Multipliers for constraints that contradict each other."""
    weights = {f"w{index}": index for index in indices}
    sums: dict[str, dict[str, Fraction]] = {}
    for weight, index in weights.items():
        for name, factor in constraints[index].coefficients:
            sums.setdefault(name, {})[weight] = Fraction(factor)
    conditions = [LinearConstraint.of(terms, "=", 0) for terms in sums.values()]
    conditions += [LinearConstraint.of({weight: 1}, ">=", 0) for weight in weights]
    bounds = {weight: Fraction(constraints[index].bound) for weight, index in weights.items()}
    strict = {weight: Fraction(1) for weight, index in weights.items() if constraints[index].strict}
    found = feasible_point(list(weights), [*conditions, LinearConstraint.of(bounds, "<=", -1)])
    if found is None:
        ends = [LinearConstraint.of(bounds, "<=", 0), LinearConstraint.of(strict, ">=", 1)]
        found = feasible_point(list(weights), [*conditions, *ends])
    if found is None:
        raise ValueError("the constraints do not contradict each other")
    scale = lcm(*(value.denominator for value in found.values()))
    whole = {weights[name]: int(value * scale) for name, value in found.items() if value}
    divisor = gcd(*whole.values())
    return Contradiction(tuple(whole), tuple(value // divisor for value in whole.values()))


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
