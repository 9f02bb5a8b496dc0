"""Exact projection of polyhedra by Fourier–Motzkin elimination."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from math import lcm
from typing import Protocol

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.qe.constraint import LinearConstraint, Sense, trim
from robust.qe.simplex import IntegerForm, Optimum, Supremum, Tableau, extend, integer_form, supremum, tableau, violates
from robust.smt.terms import Formula, Terms


def eliminate(
    parameters: Sequence[str], constraints: Iterable[LinearConstraint], names: Iterable[str]
) -> tuple[LinearConstraint, ...]:
    """Constraints on the other parameters that hold exactly where some values of `names` satisfy all constraints.

    Equalities are used as substitutions; of the inequalities, redundant ones are removed after every parameter, which
    keeps the doubly exponential growth of the plain method away.
    """
    remaining = [name for name in parameters if name not in set(names)]
    doomed = [name for name in parameters if name not in remaining]
    current = tuple(constraints)
    left = list(parameters)
    while doomed:
        form = normal_form(left, current)
        if form is None:
            return (LinearConstraint.false(),)
        current, doomed, left = _without_equalities(form.constraints, doomed, left)
        if doomed:
            name = min(doomed, key=lambda name: _growth(current, name))
            current = _combined(current, name)
            doomed.remove(name)
            left.remove(name)
    return trim(current)


def _without_equalities(
    constraints: Iterable[LinearConstraint], doomed: Sequence[str], left: Sequence[str]
) -> tuple[tuple[LinearConstraint, ...], list[str], list[str]]:
    """Use up equalities that determine a parameter to be eliminated."""
    current = list(constraints)
    doomed, left = list(doomed), list(left)
    while True:
        usable = ((c, n) for c in current if c.is_equality for n in c.parameters if n in doomed)
        equality, name = next(usable, (None, ""))
        if equality is None:
            return trim(current), doomed, left
        current.remove(equality)
        current = [substitute_equality(constraint, equality, name) for constraint in current]
        doomed.remove(name)
        left.remove(name)


def _growth(constraints: Iterable[LinearConstraint], name: str) -> int:
    """By how many constraints the elimination of a parameter changes their number, at most."""
    factors = [dict(constraint.coefficients).get(name, 0) for constraint in constraints]
    above, below = sum(factor > 0 for factor in factors), sum(factor < 0 for factor in factors)
    return above * below - above - below


def _combined(constraints: Iterable[LinearConstraint], name: str) -> tuple[LinearConstraint, ...]:
    """Every upper bound of a parameter, which no equality mentions, paired with every lower bound."""
    result: list[LinearConstraint] = []
    above: list[tuple[LinearConstraint, Fraction]] = []
    below: list[tuple[LinearConstraint, Fraction]] = []
    for constraint in constraints:
        factor = dict(constraint.coefficients).get(name)
        if not factor:
            result.append(constraint)
        else:
            (above if factor > 0 else below).append((constraint, abs(factor)))
    for upper, high in above:
        for lower, low in below:
            relation = Sense.LESS if upper.is_strict or lower.is_strict else Sense.AT_MOST
            result.append(combine(upper, 1 / high, lower, 1 / low, relation))
    return trim(result)


@dataclass(frozen=True, slots=True)
class NormalForm:
    """A polyhedron that is not empty.

    Each of `equalities` determines one parameter (`pivots`, in the same order) that occurs nowhere else. `inequalities`
    are over the other parameters, in which the polyhedron is full-dimensional, and none of them can be left out.
    `interior` is a point that satisfies all of them strictly.
    """

    parameters: tuple[str, ...]
    equalities: tuple[LinearConstraint, ...]
    pivots: tuple[str, ...]
    inequalities: tuple[LinearConstraint, ...]
    interior: dict[str, Fraction]

    @property
    def free(self) -> tuple[str, ...]:
        """The parameters that the equalities do not determine."""
        return tuple(name for name in self.parameters if name not in self.pivots)

    @property
    def constraints(self) -> tuple[LinearConstraint, ...]:
        return self.equalities + self.inequalities

    def complete(self, free: dict[str, Fraction]) -> dict[str, Fraction]:
        """The point of the affine hull with these values of the free parameters."""
        values = dict(free)
        for name, equality in zip(self.pivots, self.equalities, strict=True):
            rest = equality.substitute(free)
            values[name] = rest.constant / dict(rest.coefficients)[name]
        return {name: values[name] for name in self.parameters}


def normal_form(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> NormalForm | None:
    """The normal form of a polyhedron; None if it is empty."""
    solved = _Equalities()
    pending = list(trim(constraints))
    while True:
        solved.absorb(constraint for constraint in pending if constraint.is_equality)
        inequalities = trim(solved.reduce(constraint) for constraint in pending if not constraint.is_equality)
        if solved.contradictory or any(constraint.is_false for constraint in inequalities):
            return None
        free = [name for name in parameters if name not in solved.by_pivot]
        attempt = Tableau(len(free))
        slacks = extend(attempt, free, (constraint.with_relation(Sense.LESS) for constraint in inequalities))
        if attempt.restore():
            interior = attempt.point()
            break
        tight = [c for slack, c in zip(slacks, inequalities, strict=True) if slack in attempt.conflict]
        if not attempt.only_strictly or any(constraint.is_strict for constraint in tight):
            return None
        # A combination of these with positive weights says 0 ≤ 0, so each of them holds with equality.
        pending = [c.with_relation(Sense.EQUAL) if c in tight else c for c in inequalities]
    kept = irredundant(free, inequalities, interior)
    pivots = tuple(name for name in parameters if name in solved.by_pivot)
    equalities = tuple(solved.by_pivot[name] for name in pivots)
    form = NormalForm(tuple(parameters), equalities, pivots, kept, {})
    completed = form.complete(dict(zip(free, interior, strict=True)))
    return NormalForm(tuple(parameters), equalities, pivots, kept, completed)


def combine(
    left: LinearConstraint, left_weight: Fraction, right: LinearConstraint, right_weight: Fraction, relation: Sense
) -> LinearConstraint:
    """`left_weight · left + right_weight · right  relation  …`."""
    total = {name: left_weight * factor for name, factor in left.coefficients}
    for name, factor in right.coefficients:
        total[name] = total.get(name, Fraction(0)) + right_weight * factor
    constant = left_weight * left.constant + right_weight * right.constant
    return LinearConstraint(tuple(total.items()), relation, constant)


def substitute_equality(constraint: LinearConstraint, equality: LinearConstraint, name: str) -> LinearConstraint:
    """The constraint without `name`, which the equality determines."""
    factor = dict(constraint.coefficients).get(name)
    if not factor:
        return constraint
    weight = -factor / dict(equality.coefficients)[name]
    return combine(constraint, Fraction(1), equality, weight, constraint.relation)


class _Equalities:
    """A system of equalities in reduced form: each determines one parameter, which no other mentions."""

    def __init__(self) -> None:
        self.by_pivot: dict[str, LinearConstraint] = {}
        self.contradictory = False

    def absorb(self, equalities: Iterable[LinearConstraint]) -> None:
        for equality in equalities:
            new = self.reduce(equality)
            self.contradictory = self.contradictory or new.is_false
            if new.coefficients:
                pivot = new.coefficients[0][0]
                self.by_pivot = {n: substitute_equality(old, new, pivot) for n, old in self.by_pivot.items()}
                self.by_pivot[pivot] = new

    def reduce(self, constraint: LinearConstraint) -> LinearConstraint:
        """The constraint without the parameters that are determined."""
        for name in constraint.parameters:
            if name in self.by_pivot:
                constraint = substitute_equality(constraint, self.by_pivot[name], name)
        return constraint


def irredundant(
    parameters: Sequence[str], inequalities: Sequence[LinearConstraint], interior: Sequence[Fraction]
) -> tuple[LinearConstraint, ...]:
    """The inequalities that are needed, of a full-dimensional polyhedron without parallel duplicates.

    The facets of the closure are found first. A strict inequality without a facet of its own may still cut off a lower
    face; those that do are kept as well.
    """
    facets = _facets(parameters, inequalities, interior)
    if len(facets) == len(inequalities):
        return tuple(inequalities)
    candidates = [c for i, c in enumerate(inequalities) if i not in facets and c.is_strict]
    kept = [inequalities[i] for i in sorted(facets)]
    for candidate in list(candidates):
        others = [other for other in candidates if other is not candidate]
        if not _cuts(parameters, [*kept, *others], candidate):
            candidates = others
    return tuple(c for i, c in enumerate(inequalities) if i in facets or c in candidates)


def _cuts(parameters: Sequence[str], others: Iterable[LinearConstraint], candidate: LinearConstraint) -> bool:
    """Whether some point satisfies the others but not the candidate."""
    solved = tableau(parameters, others)
    form, _ = integer_form(candidate, parameters)
    return solved.restore() and violates(solved.maximize(form), candidate)


def _facets(
    parameters: Sequence[str], inequalities: Sequence[LinearConstraint], interior: Sequence[Fraction]
) -> set[int]:
    """Indices of the inequalities that define facets, by Clarkson's method.

    Each inequality is only compared with the facets known so far. If those do not imply it, a point that they allow and
    it does not lies beyond some facet, which is the first that the segment from the interior point crosses.
    """
    forms = [integer_form(constraint, parameters) for constraint in inequalities]
    centre = _homogeneous(interior)
    known = Tableau(len(parameters))
    facets: set[int] = set()
    unknown = dict.fromkeys(range(len(forms)))
    while unknown:
        index = next(iter(unknown))
        form, constant = forms[index]
        optimum = known.maximize(form, above=Fraction(constant))
        if optimum.value is not None and optimum.value <= constant:
            del unknown[index]
            continue
        beyond = _homogeneous(_beyond(optimum, form, constant))
        found = min(
            (i for i in unknown if _distance(forms[i], beyond) < 0), key=lambda i: _crossing(forms[i], centre, beyond)
        )
        facets.add(found)
        del unknown[found]
        known.add(*_as_row(forms[found]))
        known.restore()
    return facets


def _as_row(form: IntegerForm) -> tuple[tuple[int, ...], Sense, int]:
    return form[0], Sense.AT_MOST, form[1]


def _beyond(optimum: Optimum, form: Sequence[int], constant: int) -> Sequence[Fraction]:
    """A point that the optimum shows to violate `form ≤ constant`."""
    if optimum.ray is None:
        return optimum.point
    start = sum((c * x for c, x in zip(form, optimum.point, strict=True)), Fraction(0))
    speed = sum((c * x for c, x in zip(form, optimum.ray, strict=True)), Fraction(0))
    steps = max(Fraction(0), (constant - start) / speed) + 1
    return [x + steps * d for x, d in zip(optimum.point, optimum.ray, strict=True)]


def _homogeneous(point: Sequence[Fraction]) -> tuple[list[int], int]:
    """Numerators over one common denominator."""
    scale = lcm(*(value.denominator for value in point))
    return [int(value * scale) for value in point], scale


def _distance(form: IntegerForm, point: tuple[list[int], int]) -> int:
    """`constant − form · point`, times the point's denominator."""
    return form[1] * point[1] - sum(c * x for c, x in zip(form[0], point[0], strict=True))


def _crossing(form: IntegerForm, centre: tuple[list[int], int], beyond: tuple[list[int], int]) -> list[Fraction]:
    """How soon the segment from the centre crosses the hyperplane, as a key.

    The centre is moved by a symbolic (ε, ε², …), so that no two hyperplanes are crossed together: what is crossed first
    is a facet, never a hyperplane that only touches.
    """
    weight = -_distance(form, beyond)
    return [Fraction(_distance(form, centre), weight), *(Fraction(-factor, weight) for factor in form[0])]


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


ZERO, ONE = Fraction(0), Fraction(1)


def volume(polyhedron: Polyhedron) -> Fraction | None:
    """The volume of a polyhedron; None if infinite."""
    form = polyhedron.normal_form
    if form is None or form.equalities:
        return ZERO
    if not form.parameters:
        return ONE
    if not polyhedron.is_bounded:
        return None
    # With the origin inside, all terms of the formula are positive and facets through it drop out.
    centre = form.interior
    shifted = [
        LinearConstraint(c.coefficients, c.relation, c.constant - c.value(centre)).closed() for c in form.inequalities
    ]
    return _lasserre(form.parameters, trim(shifted))


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
        total += sum((volume(part) or ZERO for part in rest), ZERO)
    return total
