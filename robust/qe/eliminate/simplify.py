"""Simplification of normal forms by what the constraints around them say."""

from __future__ import annotations

from fractions import Fraction

from robust.qe.constraint import Coefficients, LinearConstraint, Sense
from robust.qe.nnf import FALSE, TRUE, Junction, Literal, Nnf, conjunction, disjunction, rebuild

Side = tuple[Fraction, bool]
"""An upper bound of a linear form, and whether it is strict."""


class Facts:
    """Upper bounds of linear forms and values of Booleans that hold where a subformula is looked at."""

    def __init__(self) -> None:
        self.bounds: dict[Coefficients, Side] = {}
        self.booleans: dict[str, bool] = {}

    @staticmethod
    def of(leaves: list[LinearConstraint | Literal]) -> Facts:
        facts = Facts()
        for leaf in leaves:
            match leaf:
                case Literal(name, value):
                    facts.booleans[name] = value
                case LinearConstraint():
                    for half in leaf.halves():
                        facts._learn(half)
        return facts

    def _learn(self, half: LinearConstraint) -> None:
        known = self.bounds.get(half.coefficients)
        if known is None or (half.constant, not half.is_strict) < (known[0], not known[1]):
            self.bounds[half.coefficients] = (half.constant, half.is_strict)

    def __bool__(self) -> bool:
        return bool(self.bounds or self.booleans)

    def apply(self, leaf: LinearConstraint | Literal) -> Nnf:
        """The leaf, or its truth where the facts decide it."""
        if isinstance(leaf, Literal):
            known = self.booleans.get(leaf.name)
            return leaf if known is None else (TRUE if known is leaf.value else FALSE)
        halves = [self._half(half) for half in leaf.halves()]
        if any(half is FALSE for half in halves):
            return FALSE
        if all(half is TRUE for half in halves):
            return TRUE
        return leaf

    def _half(self, half: LinearConstraint) -> Nnf:
        above = self.bounds.get(half.coefficients)
        # Lexicographically: a smaller bound is tighter, and of equal ones a strict one is.
        if above is not None and (above[0], not above[1]) <= (half.constant, not half.is_strict):
            return TRUE
        other = half.opposite(Sense.AT_MOST)
        below = self.bounds.get(other.coefficients)
        if below is not None:
            # form ≥ −bound contradicts form ≤ constant
            floor = -below[0]
            if floor > half.constant or (floor == half.constant and (below[1] or half.is_strict)):
                return FALSE
        return half


def simplified(root: Nnf) -> Nnf:
    """An equivalent formula in which the constraints of each junction have been used in its other operands.

    In a conjunction the other operands may assume a constraint, in a disjunction they may assume its negation.
    """
    if not isinstance(root, Junction):
        return root
    leaves = [operand for operand in root.operands if not isinstance(operand, Junction)]
    facts = Facts.of([fact for leaf in leaves for fact in _assumed(leaf, root.conjunctive)])
    nested = (operand for operand in root.operands if isinstance(operand, Junction))
    build = conjunction if root.conjunctive else disjunction
    return build((*leaves, *(simplified(rebuild(n, facts.apply) if facts else n) for n in nested)))


def _assumed(leaf: LinearConstraint | Literal, conjunctive: bool) -> list[LinearConstraint | Literal]:
    """What other operands may assume of a leaf: itself in a conjunction, in a disjunction its negation, if one leaf."""
    if conjunctive:
        return [leaf]
    if isinstance(leaf, Literal):
        return [Literal(leaf.name, not leaf.value)]
    return [] if leaf.is_equality else list(leaf.negation())
