"""Simplification of normal forms by what the constraints around them say, and recursion without a deep stack."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from fractions import Fraction

from robust.qe.constraint import Coefficients, LinearConstraint
from robust.qe.eliminate.enumerate import Leaf
from robust.qe.nnf import FALSE, TRUE, Junction, Literal, Nnf, conjunction, disjunction
from robust.smt.limits import Deadline

Side = tuple[Fraction, bool]
"""An upper bound of a linear form, and whether it is strict."""

Task = Generator["Task", Nnf, Nnf]
"""A computation of a formula that yields the tasks whose results it needs; see :func:`perform`."""


def perform(task: Task, deadline: Deadline) -> Nnf:
    """The result of a task: recursion that the interpreter's stack does not limit [Ganz, Friedman and Wand 1999].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [task]
    result: Nnf | None = None
    while stack:
        deadline.enforce()
        try:
            needed = next(stack[-1]) if result is None else stack[-1].send(result)
        except StopIteration as stop:
            stack.pop()
            result = stop.value
        else:
            stack.append(needed)
            result = None
    if result is None:
        raise AssertionError("a task ended without a result")
    return result


class Facts:
    """Upper bounds of linear forms and values of Booleans that hold where a subformula is looked at.

    What has been learnt since a mark can be taken back.
    """

    def __init__(self, leaves: Iterable[Leaf] = ()) -> None:
        self._bounds: dict[Coefficients, Side] = {}
        self._booleans: dict[str, bool] = {}
        self._before: list[tuple[Coefficients | str, Side | bool | None]] = []
        for leaf in leaves:
            self.learn(leaf)

    @property
    def mark(self) -> int:
        return len(self._before)

    def learn(self, leaf: Leaf) -> None:
        if isinstance(leaf, Literal):
            self._before.append((leaf.name, self._booleans.get(leaf.name)))
            self._booleans[leaf.name] = leaf.value
            return
        for half in leaf.halves():
            known = self._bounds.get(half.coefficients)
            if known is None or (half.constant, not half.is_strict) < (known[0], not known[1]):
                self._before.append((half.coefficients, known))
                self._bounds[half.coefficients] = (half.constant, half.is_strict)

    def forget(self, mark: int) -> None:
        """Take back what has been learnt since the mark."""
        while len(self._before) > mark:
            key, before = self._before.pop()
            if isinstance(key, str):
                del self._booleans[key]
                if isinstance(before, bool):
                    self._booleans[key] = before
            else:
                del self._bounds[key]
                if isinstance(before, tuple):
                    self._bounds[key] = before

    def apply(self, leaf: Leaf) -> Nnf:
        """The leaf, or its truth where the facts decide it."""
        if isinstance(leaf, Literal):
            known = self._booleans.get(leaf.name)
            return leaf if known is None else (TRUE if known is leaf.value else FALSE)
        if not self._bounds:
            return leaf
        halves = [self._half(half) for half in leaf.halves()]
        if any(half is FALSE for half in halves):
            return FALSE
        if all(half is TRUE for half in halves):
            return TRUE
        return leaf

    def _half(self, half: LinearConstraint) -> Nnf:
        above = self._bounds.get(half.coefficients)
        # Lexicographically: a smaller bound is tighter, and of equal ones a strict one is.
        if above is not None and (above[0], not above[1]) <= (half.constant, not half.is_strict):
            return TRUE
        below = self._bounds.get(tuple((name, -factor) for name, factor in half.coefficients))
        if below is not None:
            # form ≥ −bound contradicts form ≤ constant
            floor = -below[0]
            if floor > half.constant or (floor == half.constant and (below[1] or half.is_strict)):
                return FALSE
        return half


def simplified(root: Nnf, assumed: Iterable[Leaf] = (), deadline: Deadline | None = None) -> Nnf:
    """A formula that is equivalent wherever what is assumed holds, simplified by what surrounds each of its parts.

    In a conjunction the other operands may assume a constraint, in a disjunction they may assume its negation [Dolzmann
    and Sturm 1997, "Simplification of quantifier-free formulae over ordered fields"].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return perform(_simplify(root, Facts(assumed)), deadline or Deadline.after(None))


def _simplify(node: Nnf, facts: Facts) -> Task:
    if not isinstance(node, Junction):
        return facts.apply(node)
    conjunctive, mark = node.conjunctive, facts.mark
    absorbing = FALSE if conjunctive else TRUE
    while isinstance(node, Junction) and node.conjunctive is conjunctive:
        nested = [operand for operand in node.operands if isinstance(operand, Junction)]
        leaves = [operand for operand in node.operands if not isinstance(operand, Junction)]
        # Equalities say most in a conjunction, and nothing that can be used in a disjunction.
        leaves.sort(key=lambda leaf: _is_equality(leaf) is not conjunctive)
        parts: list[Nnf] = []
        for leaf in leaves:
            parts.append(facts.apply(leaf))
            _assume(parts[-1], conjunctive, facts)
        found = 0
        for operand in nested:
            if absorbing in parts:
                break
            parts.append((yield _simplify(operand, facts)))
            found += _assume(parts[-1], conjunctive, facts)
        facts.forget(mark)
        node = conjunction(parts) if conjunctive else disjunction(parts)
        # Constraints that came to light may say something of the operands before them.
        if not found or len(nested) == 1:
            break
    return node


def _is_equality(leaf: Leaf) -> bool:
    return isinstance(leaf, LinearConstraint) and leaf.is_equality


def _assume(node: Nnf, conjunctive: bool, facts: Facts) -> int:
    """Learn what other operands may assume of one that is a leaf or consists of leaves; how many leaves there were.

    That is the leaf itself in a conjunction; in a disjunction its negation, if that is one leaf.
    """
    if isinstance(node, Junction):
        leaves = [o for o in node.operands if not isinstance(o, Junction)] if node.conjunctive is conjunctive else []
    else:
        leaves = [node]
    for leaf in leaves:
        if conjunctive:
            facts.learn(leaf)
        elif isinstance(leaf, Literal):
            facts.learn(Literal(leaf.name, not leaf.value))
        elif not leaf.is_equality:
            facts.learn(leaf.negation()[0])
    return len(leaves)
