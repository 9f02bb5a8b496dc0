"""Linear constraints over named parameters, in a normal form that makes equal half-spaces equal objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from math import gcd, lcm
from typing import Any

from robust.errors import InputError, UnsupportedError
from robust.plan.model import ParameterReference, Relation
from robust.plan.polynomial import Polynomial
from robust.smt.session import Formula, Terms

Coefficients = tuple[tuple[str, int], ...]
"""Non-zero coefficients by parameter, in the order of the names."""

ZERO, ONE = Fraction(0), Fraction(1)


class Sense(Enum):
    """How the linear form of a constraint relates to its constant."""

    AT_MOST = "<="
    LESS = "<"
    EQUAL = "="

    def holds(self, left: Fraction | int, right: Fraction | int) -> bool:
        """Whether `left sense right`."""
        if self is Sense.EQUAL:
            return left == right
        return left < right if self is Sense.LESS else left <= right


_RELATIONS = {Sense.AT_MOST: Relation.AT_LEAST, Sense.LESS: Relation.GREATER, Sense.EQUAL: Relation.EQUAL}
"""What `constant − form` is compared with 0 by."""


@dataclass(frozen=True, slots=True)
class LinearConstraint:
    """`Σ coefficient · parameter  relation  constant`.

    Coefficients are coprime integers in the order of the parameters' names, whatever multiple of them is given, and the
    first one of an equality is positive; so constraints of one half-space or hyperplane are equal and hash alike. A
    constraint without parameters is `0 <= 0` if it holds and `0 <= -1` if it does not.

    Raises:
        InputError: if a parameter is named twice.
    """

    coefficients: Coefficients
    relation: Sense
    constant: Fraction

    def __post_init__(self) -> None:
        items = self.coefficients.items() if isinstance(self.coefficients, Mapping) else self.coefficients
        given: list[tuple[str, Fraction | int]] = [(name, factor) for name, factor in items if factor]
        if len({name for name, _ in given}) < len(given):
            names = ", ".join(sorted(name for name, _ in given))
            raise InputError(f"a constraint names a parameter twice: {names}; expected one coefficient for each")
        scale = lcm(*(factor.denominator for _, factor in given))
        whole = [(name, factor.numerator * (scale // factor.denominator)) for name, factor in given]
        self._settle(whole, Sense(self.relation), _fraction(self.constant) * scale)

    def _settle(self, factors: Iterable[tuple[str, int]], relation: Sense, constant: Fraction) -> None:
        """Take the normal form of a constraint whose coefficients are integers, none of them zero."""
        pairs = sorted(factors)
        if not pairs:
            constant = ZERO if relation.holds(ZERO, constant) else -ONE
            relation = Sense.AT_MOST
        else:
            divisor = gcd(*(factor for _, factor in pairs))
            if relation is Sense.EQUAL and pairs[0][1] < 0:
                divisor = -divisor
            if divisor != 1:
                pairs = [(name, factor // divisor) for name, factor in pairs]
                constant /= divisor
        object.__setattr__(self, "coefficients", tuple(pairs))
        object.__setattr__(self, "relation", relation)
        object.__setattr__(self, "constant", constant)

    @staticmethod
    def of(
        coefficients: Mapping[str, Fraction | int], relation: Sense | str, constant: Fraction | int
    ) -> LinearConstraint:
        """A constraint from a mapping; `relation` may be given by its sign, `<=`, `<`, `=`, `>=` or `>`."""
        if relation in (">=", ">"):
            negated = {name: -factor for name, factor in coefficients.items()}
            return LinearConstraint.of(negated, "<=" if relation == ">=" else "<", -constant)
        return LinearConstraint(tuple(coefficients.items()), Sense(relation), Fraction(constant))  # type: ignore[arg-type]

    @staticmethod
    def from_polynomial(expression: Polynomial[Any], relation: Relation) -> LinearConstraint:
        """`expression relation 0` over parameter references.

        Raises:
            UnsupportedError: if the expression is not linear, mentions something other than parameters, or the
                relation is a disequality (not one constraint, but the union of two).
        """
        strange = [unknown for unknown in expression.variables if not isinstance(unknown, ParameterReference)]
        if strange or not expression.is_linear or relation is Relation.DIFFERENT:
            raise UnsupportedError(
                f"{expression} {relation.value} 0 is not a constraint of a polyhedron; expected a linear expression "
                "over parameters, and >=, > or ="
            )
        sense = next(sense for sense, known in _RELATIONS.items() if known is relation)
        return LinearConstraint.of(
            {unknown.name: -factor for unknown, factor in expression.coefficients()}, sense, expression.constant_term
        )

    @staticmethod
    def false() -> LinearConstraint:
        """The constraint that nothing satisfies."""
        return LinearConstraint((), Sense.AT_MOST, -ONE)

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.coefficients)

    def factor(self, name: str) -> int:
        """The coefficient of a parameter."""
        return next((factor for known, factor in self.coefficients if known == name), 0)

    @property
    def is_true(self) -> bool:
        """Whether it holds everywhere."""
        return not self.coefficients and self.constant >= 0

    @property
    def is_false(self) -> bool:
        """Whether it holds nowhere."""
        return not self.coefficients and self.constant < 0

    @property
    def is_strict(self) -> bool:
        return self.relation is Sense.LESS

    @property
    def is_equality(self) -> bool:
        return self.relation is Sense.EQUAL

    def value(self, point: Mapping[str, Fraction]) -> Fraction:
        """The linear form at a point; KeyError if the point lacks a parameter."""
        return sum((factor * point[name] for name, factor in self.coefficients), ZERO)

    def evaluate(self, point: Mapping[str, Fraction]) -> bool:
        """Whether the point satisfies the constraint."""
        return self.relation.holds(self.value(point), self.constant)

    def negation(self) -> list[LinearConstraint]:
        """Constraints whose union is the complement: one half-space, or two disjoint ones for an equality."""
        if self.is_equality:
            return [self.with_relation(Sense.LESS), self.opposite(Sense.LESS)]
        return [self.opposite(Sense.AT_MOST if self.is_strict else Sense.LESS)]

    def halves(self) -> list[LinearConstraint]:
        """An equality as two inequalities; an inequality as it is."""
        if not self.is_equality:
            return [self]
        return [self.with_relation(Sense.AT_MOST), self.opposite(Sense.AT_MOST)]

    def with_relation(self, relation: Sense) -> LinearConstraint:
        """The constraint with its linear form and constant, but another relation."""
        return self if relation is self.relation else _settled(self.coefficients, relation, self.constant)

    def opposite(self, relation: Sense) -> LinearConstraint:
        """`−form relation −constant`: the other side of the same hyperplane."""
        return _settled(((n, -c) for n, c in self.coefficients), relation, -self.constant)

    def closed(self) -> LinearConstraint:
        """The constraint including its boundary."""
        return self.with_relation(Sense.AT_MOST) if self.is_strict else self

    def substitute(self, values: Mapping[str, Fraction]) -> LinearConstraint:
        """The constraint on the remaining parameters once some are fixed."""
        rest = tuple((name, factor) for name, factor in self.coefficients if name not in values)
        fixed = sum((factor * values[name] for name, factor in self.coefficients if name in values), ZERO)
        return LinearConstraint(rest, self.relation, self.constant - fixed)

    def as_polynomial(self) -> Polynomial[ParameterReference]:
        """`constant − form`: the constraint says that it is ≥ 0, > 0 or = 0."""
        terms: dict[tuple[ParameterReference, ...], Fraction] = {(): self.constant}
        terms.update({(ParameterReference(name),): Fraction(-factor) for name, factor in self.coefficients})
        return Polynomial(terms)

    def to_formula(self, terms: Terms) -> Formula:
        """The constraint over the symbols of parameter references."""
        return terms.compare(self.as_polynomial(), _RELATIONS[self.relation])

    def as_dict(self) -> dict[str, Any]:
        """The constraint of a `robust/region/1` document; rationals are strings."""
        return {
            "coefficients": {name: str(factor) for name, factor in self.coefficients},
            "relation": self.relation.value,
            "constant": str(self.constant),
        }

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> LinearConstraint:
        """Read what `as_dict` writes.

        Raises:
            InputError: if a key is missing, or a relation or number cannot be read.
        """
        try:
            coefficients = {str(name): _exact(factor) for name, factor in document["coefficients"].items()}
            return LinearConstraint.of(coefficients, Sense(document["relation"]), _exact(document["constant"]))
        except (KeyError, ValueError, TypeError, AttributeError, ZeroDivisionError) as error:
            raise InputError(
                f"cannot read the constraint {document!r}: expected "
                '{"coefficients": {"name": "1/2"}, "relation": "<=", "<" or "=", "constant": "3"}'
            ) from error

    def __str__(self) -> str:
        """`2·x − y ≤ 7/4`; with a positive first coefficient, so possibly turned round."""
        if not self.coefficients:
            return "true" if self.is_true else "false"
        terms, sign, constant = self.oriented()
        return f"{Polynomial({(name,): factor for name, factor in terms})} {sign} {constant}"

    def oriented(self) -> tuple[list[tuple[str, Fraction]], str, Fraction]:
        """Form, sign (≤, ≥, <, > or =) and constant, turned round so that the first coefficient is positive."""
        signs = {Sense.AT_MOST: "≤≥", Sense.LESS: "<>", Sense.EQUAL: "=="}[self.relation]
        flip = self.coefficients[0][1] < 0
        factor = -1 if flip else 1
        return [(name, Fraction(factor * c)) for name, c in self.coefficients], signs[flip], factor * self.constant


def _fraction(value: Fraction | int) -> Fraction:
    return value if type(value) is Fraction else Fraction(value)


def _exact(value: Any) -> Fraction:
    """A rational from a document; a JSON number with a fraction is already rounded, so it must be a string."""
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise TypeError(value)
    return Fraction(value)


def trim(constraints: Iterable[LinearConstraint]) -> tuple[LinearConstraint, ...]:
    """Without duplicates and constraints that hold everywhere; of parallel inequalities only the tightest.

    A constraint that holds nowhere makes it the only one.
    """
    tightest: dict[tuple[bool, Coefficients], LinearConstraint] = {}
    for constraint in constraints:
        if constraint.is_false:
            return (constraint,)
        if constraint.is_true:
            continue
        key = constraint.is_equality, constraint.coefficients
        known = tightest.get(key)
        if known is None or (constraint.constant, not constraint.is_strict) < (known.constant, not known.is_strict):
            if known is not None and constraint.is_equality:
                return (LinearConstraint.false(),)
            tightest[key] = constraint
        elif constraint.is_equality and constraint.constant != known.constant:
            return (LinearConstraint.false(),)
    return tuple(tightest.values())


def _settled(factors: Iterable[tuple[str, int]], relation: Sense, constant: Fraction) -> LinearConstraint:
    """A constraint of integer coefficients, none of which is zero or of the same parameter as another."""
    bare = object.__new__(LinearConstraint)
    bare._settle(factors, relation, constant)
    return bare


def combine(
    left: LinearConstraint, left_weight: int, right: LinearConstraint, right_weight: int, relation: Sense
) -> LinearConstraint:
    """`left_weight · left + right_weight · right  relation  …`."""
    total = {name: left_weight * factor for name, factor in left.coefficients}
    for name, factor in right.coefficients:
        total[name] = total.get(name, 0) + right_weight * factor
    low, high = left.constant, right.constant
    constant = Fraction(
        left_weight * low.numerator * high.denominator + right_weight * high.numerator * low.denominator,
        low.denominator * high.denominator,
    )
    return _settled(((name, factor) for name, factor in total.items() if factor), relation, constant)


def substitute_equality(constraint: LinearConstraint, equality: LinearConstraint, name: str) -> LinearConstraint:
    """The constraint without `name`, which the equality determines."""
    factor = constraint.factor(name)
    if not factor:
        return constraint
    known = equality.factor(name)
    return combine(constraint, abs(known), equality, -factor if known > 0 else factor, constraint.relation)
