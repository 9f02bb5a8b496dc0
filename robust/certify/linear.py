"""Linear constraints in the form that certificates write, and why a set of them contradicts itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.lp import feasible_point
from robust.qe.simplex import Tableau

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
