"""Convex polyhedra with rational coefficients, each side with or without its boundary."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import Protocol

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.qe.lp import Supremum, extend, integer_form, supremum, tableau, violates
from robust.qe.projection import eliminate
from robust.qe.reduction import NormalForm, normal_form
from robust.qe.simplex import Tableau
from robust.smt.terms import Formula, Terms

Point = Mapping[str, Fraction]


class IntervalLike(Protocol):
    """An interval of a box; None is an infinite end."""

    @property
    def lower(self) -> Fraction | None: ...
    @property
    def upper(self) -> Fraction | None: ...
    @property
    def lower_closed(self) -> bool: ...
    @property
    def upper_closed(self) -> bool: ...


class BoxLike(Protocol):
    """An interval for each parameter, as the boxes of :mod:`robust.irr` (which this package does not import)."""

    @property
    def intervals(self) -> Mapping[str, IntervalLike]: ...


@dataclass(frozen=True, slots=True)
class Extent:
    """The values that one parameter takes; None is an infinite end, which is open."""

    lower: Fraction | None
    upper: Fraction | None
    lower_closed: bool
    upper_closed: bool


@dataclass(frozen=True)
class Polyhedron:
    """The points that satisfy all constraints; without parameters either the empty tuple or nothing.

    Objects are equal if their parameters and constraints are; `equals` compares the sets of points.

    Raises:
        InputError: if a parameter occurs twice, or a constraint mentions one that is not among them.
    """

    parameters: tuple[str, ...]
    constraints: tuple[LinearConstraint, ...] = ()

    def __post_init__(self) -> None:
        names = tuple(self.parameters)
        check_names(names)
        known = set(names)
        kept = trim(self.constraints)
        for constraint in kept:
            strange = [name for name in constraint.parameters if name not in known]
            if strange:
                raise InputError(
                    f"constraint {constraint} mentions {strange[0]!r}, which is not a parameter of the polyhedron"
                    + did_you_mean(strange[0], names)
                )
        object.__setattr__(self, "parameters", names)
        object.__setattr__(self, "constraints", kept)

    @staticmethod
    def universe(parameters: Iterable[str]) -> Polyhedron:
        """Every point."""
        return Polyhedron(tuple(parameters))

    @staticmethod
    def nothing(parameters: Iterable[str]) -> Polyhedron:
        """No point."""
        return Polyhedron(tuple(parameters), (LinearConstraint.false(),))

    @staticmethod
    def of_box(parameters: Iterable[str], box: BoxLike) -> Polyhedron:
        """The points of a box; parameters that the box does not name are unbounded."""
        return Polyhedron(tuple(parameters), tuple(interval_constraints(box)))

    def __contains__(self, point: Point) -> bool:
        return all(constraint.evaluate(point) for constraint in self.constraints)

    @cached_property
    def is_empty(self) -> bool:
        return self._solved is None

    @cached_property
    def _solved(self) -> Tableau | None:
        """A tableau of the constraints, to be copied, never changed; None if there is no point."""
        solved = tableau(self.parameters, self.constraints)
        return solved if solved.restore() else None

    @cached_property
    def normal_form(self) -> NormalForm | None:
        """Affine hull, irredundant inequalities and a relative interior point; None if empty."""
        return normal_form(self.parameters, self.constraints)

    def some_point(self) -> dict[str, Fraction] | None:
        """A point, or None."""
        return None if self._solved is None else dict(zip(self.parameters, self._solved.point(), strict=True))

    def interior_point(self) -> dict[str, Fraction] | None:
        """A point of the relative interior: it satisfies every inequality that is not always tight strictly."""
        return None if self.normal_form is None else dict(self.normal_form.interior)

    @property
    def dimension(self) -> int:
        """The dimension of the affine hull; −1 if empty."""
        return -1 if self.normal_form is None else len(self.normal_form.free)

    @property
    def is_full_dimensional(self) -> bool:
        return self.dimension == len(self.parameters)

    @property
    def is_universal(self) -> bool:
        return self.normal_form is not None and not self.normal_form.constraints

    def simplified(self) -> Polyhedron:
        """The same points with no constraint that could be left out, and all implied equalities explicit."""
        form = self.normal_form
        return Polyhedron.nothing(self.parameters) if form is None else Polyhedron(self.parameters, form.constraints)

    def closure(self) -> Polyhedron:
        """With its boundary; empty if the polyhedron is."""
        if self.is_empty:
            return Polyhedron.nothing(self.parameters)
        return Polyhedron(self.parameters, tuple(constraint.closed() for constraint in self.constraints))

    def satisfies(self, constraint: LinearConstraint) -> bool:
        """Whether every point satisfies the constraint."""
        if self._solved is None or constraint.is_true or constraint in self.constraints:
            return True
        solved = self._solved.copy()
        for half in constraint.halves():
            form, scaled = integer_form(half, self.parameters)
            if violates(solved.maximize(form, above=Fraction(scaled)), half):
                return False
        return True

    def is_subset_of(self, other: Polyhedron) -> bool:
        check_same(self.parameters, other.parameters)
        return all(self.satisfies(constraint) for constraint in other.constraints)

    def equals(self, other: Polyhedron) -> bool:
        """Whether both have the same points."""
        return self.is_subset_of(other) and other.is_subset_of(self)

    def restricted(self, constraints: Iterable[LinearConstraint]) -> Polyhedron:
        """The points that also satisfy these constraints."""
        result = Polyhedron(self.parameters, (*self.constraints, *constraints))
        if self._solved is None or result.constraints == self.constraints:
            return Polyhedron.nothing(self.parameters) if self._solved is None else self
        # The tableau is at hand: adding rows to it is quicker than starting again. Constraints that were there before
        # are still the same objects, and identities are quicker to compare than fractions.
        known = {id(constraint) for constraint in self.constraints}
        solved = self._solved.copy()
        extend(solved, self.parameters, (c for c in result.constraints if id(c) not in known))
        result.__dict__["_solved"] = solved if solved.restore() else None
        return result

    def intersection(self, other: Polyhedron) -> Polyhedron:
        check_same(self.parameters, other.parameters)
        return self.restricted(other.constraints)

    def is_disjoint_from(self, other: Polyhedron) -> bool:
        return self.intersection(other).is_empty

    def minus(self, other: Polyhedron) -> list[Polyhedron]:
        """Disjoint polyhedra whose union is this one without the other."""
        if self.is_disjoint_from(other):
            return [] if self.is_empty else [self]
        pieces, rest = [], self
        for constraint in other.simplified().constraints:
            beyond = [rest.restricted([side]) for side in constraint.negation()]
            pieces += [piece for piece in beyond if not piece.is_empty]
            rest = rest.restricted([constraint])
        return pieces

    def complement(self) -> list[Polyhedron]:
        """Half-spaces (and sides of hyperplanes) whose union is everything outside; they may overlap."""
        form = self.normal_form
        if form is None:
            return [Polyhedron.universe(self.parameters)]
        return [Polyhedron(self.parameters, (side,)) for c in form.constraints for side in c.negation()]

    def maximize(self, objective: Mapping[str, Fraction]) -> Supremum | None:
        """The least upper bound of a linear form; None if the polyhedron is empty."""
        return None if self._solved is None else supremum(self._solved.copy(), self.parameters, objective)

    def extent(self, name: str) -> Extent | None:
        """The interval of values that a parameter takes; None if the polyhedron is empty."""
        high, low = self.maximize({name: Fraction(1)}), self.maximize({name: Fraction(-1)})
        if high is None or low is None:
            return None
        return Extent(None if low.value is None else -low.value, high.value, low.attained, high.attained)

    def bounding_box(self) -> dict[str, Extent] | None:
        """The smallest box around the polyhedron, with open, closed and infinite ends; None if empty."""
        extents = {name: self.extent(name) for name in self.parameters}
        if self.is_empty:
            return None
        return {name: extent for name, extent in extents.items() if extent is not None}

    @property
    def is_bounded(self) -> bool:
        box = self.bounding_box() or {}
        return all(extent.lower is not None and extent.upper is not None for extent in box.values())

    def vertices(self) -> list[dict[str, Fraction]]:
        """The vertices of the closure, in lexicographic order of the parameters.

        Raises:
            UnsupportedError: if the dimension is above 3.
        """
        form = self.normal_form
        if form is None:
            return []
        if len(form.free) > 3:
            raise UnsupportedError(
                f"vertices of a polyhedron of dimension {len(form.free)}; expected at most 3: slice or project it first"
            )
        closed = [constraint.closed() for constraint in form.inequalities]
        found: dict[tuple[Fraction, ...], dict[str, Fraction]] = {}
        for tight in combinations(closed, len(form.free)):
            point = _solution(form.free, tight)
            if point is not None and all(constraint.evaluate(point) for constraint in closed):
                vertex = form.complete(point)
                found[tuple(vertex.values())] = vertex
        return [found[key] for key in sorted(found)]

    def project(self, names: Iterable[str]) -> Polyhedron:
        """The values of the named parameters that some values of the others complete to a point.

        Raises:
            InputError: if a name is not a parameter.
        """
        kept = tuple(names)
        check_known(kept, self.parameters)
        others = [name for name in self.parameters if name not in kept]
        return Polyhedron(kept, eliminate(self.parameters, self.constraints, others)).simplified()

    def slice(self, values: Point) -> Polyhedron:
        """Fix parameters at values; the polyhedron over the rest.

        Raises:
            InputError: if a name is not a parameter.
        """
        check_known(values, self.parameters)
        rest = tuple(name for name in self.parameters if name not in values)
        return Polyhedron(rest, tuple(constraint.substitute(values) for constraint in self.constraints))

    def volume(self) -> Fraction | None:
        """The exact volume over all parameters, in the product of their units; None if infinite.

        Lower-dimensional polyhedra have none; without parameters a point counts 1. The time grows with the factorial of
        the dimension.
        """
        from robust.qe.volume import volume  # noqa: PLC0415 - the module builds on this one

        return volume(self)

    def to_formula(self, terms: Terms) -> Formula:
        """The conjunction of the constraints over the symbols of parameter references."""
        return terms.conjunction(constraint.to_formula(terms) for constraint in self.constraints)

    def __str__(self) -> str:
        return " ∧ ".join(str(constraint) for constraint in self.constraints) or "true"


def interval_constraints(box: BoxLike) -> Iterable[LinearConstraint]:
    """The constraints of a box."""
    for name, interval in box.intervals.items():
        if interval.lower is not None:
            relation = Sense.AT_MOST if interval.lower_closed else Sense.LESS
            yield LinearConstraint(((name, Fraction(-1)),), relation, -interval.lower)
        if interval.upper is not None:
            relation = Sense.AT_MOST if interval.upper_closed else Sense.LESS
            yield LinearConstraint(((name, Fraction(1)),), relation, interval.upper)


def check_names(names: tuple[str, ...]) -> None:
    """Raise an InputError if a name occurs twice."""
    if len(set(names)) != len(names):
        raise InputError(f"parameters {', '.join(names)}: a name occurs twice; expected distinct names")


def check_same(left: tuple[str, ...], right: tuple[str, ...]) -> None:
    """Raise an InputError unless both sets live in the same space."""
    if set(left) != set(right):
        raise InputError(
            f"cannot combine sets over ({', '.join(left)}) and ({', '.join(right)}); expected the same parameters"
        )


def check_known(names: Iterable[str], parameters: tuple[str, ...]) -> None:
    """Raise an InputError if a name is not among the parameters."""
    for name in names:
        if name not in parameters:
            raise InputError(f"{name!r} is not a parameter{did_you_mean(name, parameters)}")


def _solution(names: tuple[str, ...], equations: Iterable[LinearConstraint]) -> dict[str, Fraction] | None:
    """The only common point of hyperplanes; None if there is no such point."""
    form = normal_form(names, [constraint.with_relation(Sense.EQUAL) for constraint in equations])
    return None if form is None or form.free else form.interior
