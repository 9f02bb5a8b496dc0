"""Polyhedra: conjunctions of linear constraints as sets of points, strict sides included."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.qe.box import Box, Interval, Slabs
from robust.qe.conjunctions import SolvedForm, normal_form, project
from robust.qe.constraint import ONE, ZERO, LinearConstraint, Sense, substitute_equality, trim
from robust.qe.simplex import Supremum, Tableau, extend, feasible_point, integer_form, supremum, tableau, violates
from robust.smt.session import Formula, Terms

Point = Mapping[str, Fraction]


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
    def of_box(parameters: Iterable[str], box: Box) -> Polyhedron:
        """The points of a box; parameters that the box does not name are unbounded."""
        return Polyhedron(tuple(parameters), tuple(box.constraints()))

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
    def normal_form(self) -> SolvedForm | None:
        """Affine hull, irredundant inequalities and a relative interior point; None if empty."""
        return normal_form(self.parameters, self.constraints)

    @cached_property
    def mentioned(self) -> frozenset[str]:
        """The parameters that constraints mention."""
        return frozenset(name for constraint in self.constraints for name in constraint.parameters)

    @cached_property
    def slabs(self) -> Slabs:
        """The constraints against boxes."""
        return Slabs(self.constraints)

    def meets(self, box: Box) -> bool:
        """Whether some point is in a box."""
        if not self.slabs.all_kept_in(box):
            return False
        return self.slabs.exact or feasible_point(self.parameters, [*self.constraints, *box.constraints()]) is not None

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
        """The polyhedron without redundant constraints, and with all implied equalities explicit."""
        form = self.normal_form
        return Polyhedron.nothing(self.parameters) if form is None else Polyhedron(self.parameters, form.constraints)

    def closure(self) -> Polyhedron:
        """The polyhedron with its boundary; empty if the polyhedron is."""
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

    def extent(self, name: str) -> Interval | None:
        """The interval of values that a parameter takes; None if the polyhedron is empty."""
        return extent_by(self.maximize, name)

    def bounding_box(self) -> dict[str, Interval] | None:
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
        vertices: dict[tuple[Fraction, ...], dict[str, Fraction]] = {}
        for tight in combinations(closed, len(form.free)):
            point = _solution(form.free, tight)
            if point is not None and all(constraint.evaluate(point) for constraint in closed):
                vertex = form.complete(point)
                vertices[tuple(vertex.values())] = vertex
        return [vertices[key] for key in sorted(vertices)]

    def project(self, names: Iterable[str]) -> Polyhedron:
        """The values of the named parameters that some values of the others complete to a point.

        Raises:
            InputError: if a name is not a parameter.
        """
        kept = tuple(names)
        check_known(kept, self.parameters)
        projected = project(self.constraints, set(self.parameters).difference(kept))
        return Polyhedron.nothing(kept) if projected is None else Polyhedron(kept, projected).simplified()

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
        form = self.normal_form
        if form is None or form.equalities:
            return ZERO
        if not form.parameters:
            return ONE
        if not self.is_bounded:
            return None
        # With the origin inside, all terms of the formula are positive and facets through it drop out.
        centre = form.interior
        shifted = [
            LinearConstraint(c.coefficients, c.relation, c.constant - c.value(centre)).closed()
            for c in form.inequalities
        ]
        return _lasserre(form.parameters, trim(shifted))

    def to_formula(self, terms: Terms) -> Formula:
        """The conjunction of the constraints over the symbols of parameter references."""
        return terms.conjunction(constraint.to_formula(terms) for constraint in self.constraints)

    def __str__(self) -> str:
        return " ∧ ".join(str(constraint) for constraint in self.constraints) or "true"


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


def extent_by(maximize: Callable[[Mapping[str, Fraction]], Supremum | None], name: str) -> Interval | None:
    """The interval of values that a parameter takes in a convex set with these maxima; None if there are none."""
    high, low = maximize({name: Fraction(1)}), maximize({name: Fraction(-1)})
    if high is None or low is None:
        return None
    return Interval(None if low.value is None else -low.value, high.value, low.attained, high.attained)


def _solution(names: tuple[str, ...], equations: Iterable[LinearConstraint]) -> dict[str, Fraction] | None:
    """The only common point of hyperplanes; None if there is no such point."""
    form = normal_form(names, [constraint.with_relation(Sense.EQUAL) for constraint in equations])
    return None if form is None or form.free else form.interior


def _lasserre(names: Sequence[str], constraints: Sequence[LinearConstraint]) -> Fraction:
    """Lasserre's formula: a polytope is the sum of pyramids over its facets with their apex at the origin.

    `vol(P) = 1/n · Σ_i b_i / |a_ij| · vol(P_i)`, where P_i is facet i projected along a coordinate j with a_ij ≠ 0. The
    constraints are bounded and without parallel duplicates; redundant ones contribute nothing.
    """
    if any(constraint.is_false for constraint in constraints):
        return ZERO
    if len(names) == 1:
        return _length(constraints)
    total = ZERO
    for facet in constraints:
        if facet.constant:
            name, factor = max(facet.coefficients, key=lambda pair: abs(pair[1]))
            others = trim(substitute_equality(other, facet, name) for other in constraints if other is not facet)
            rest = [other for other in names if other != name]
            total += facet.constant / abs(factor) * _lasserre(rest, others)
    return total / len(names)


def _length(constraints: Sequence[LinearConstraint]) -> Fraction:
    """The length of a bounded interval."""
    upper = min(c.constant / c.coefficients[0][1] for c in constraints if c.coefficients[0][1] > 0)
    lower = max(c.constant / c.coefficients[0][1] for c in constraints if c.coefficients[0][1] < 0)
    return max(ZERO, upper - lower)


def union_volume(pieces: Sequence[Polyhedron]) -> Fraction | None:
    """The volume of a union; None if infinite.

    Each piece counts without the earlier ones, which are cut out by splitting; splinters without volume are dropped.
    """
    solid = [piece for piece in pieces if piece.is_full_dimensional]
    if any(not piece.is_bounded for piece in solid):
        return None
    total = ZERO
    for index, piece in enumerate(solid):
        rest = [piece]
        for earlier in solid[:index]:
            rest = [part for old in rest for part in old.minus(earlier) if part.is_full_dimensional]
        total += sum((part.volume() or ZERO for part in rest), ZERO)
    return total
