"""Conjunctions of linear constraints: normal forms without redundancy, and projections, exactly or at a point.

Exact: equalities are solved for what is eliminated; what is left goes by Fourier–Motzkin elimination [Fourier 1826;
Schrijver 1998, §12.2], one variable at a time, with redundancy removed by linear programming whenever combinations
pile up. At a point: Loos–Weispfenning substitution of the one bound that is tight at a model [Loos and Weispfenning
1993; Komuravelli, Gurfinkel and Chaki 2014], which never makes a conjunction longer.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from math import lcm
from typing import TypeVar

from robust.qe.constraint import LinearConstraint, Sense, combine, substitute_equality, trim
from robust.qe.simplex import IntegerForm, Optimum, Tableau, extend, integer_form, tableau, violates
from robust.smt.limits import NEVER, Deadline

Conjunction = tuple[LinearConstraint, ...]


def half_space(piece: Conjunction) -> LinearConstraint | None:
    """The only constraint, if the conjunction is one inequality."""
    return piece[0] if len(piece) == 1 and not piece[0].is_equality else None


CROWD = 12
"""From how many constraints on redundancy is looked for between two steps."""


def solve_equalities(constraints: Iterable[LinearConstraint], eliminated: Collection[str]) -> Conjunction:
    """Use every equality over an eliminated variable to substitute that variable."""
    gone = set(eliminated)
    pending: list[LinearConstraint | None] = list(trim(constraints))
    mentions: dict[str, list[int]] = defaultdict(list)
    for place, constraint in enumerate(pending):
        for name in constraint.parameters if constraint is not None else ():
            mentions[name].append(place)
    waiting = list(range(len(pending)))  # a heap: of equalities that can be used the first one is
    while waiting:
        place = heappop(waiting)
        equality = pending[place]
        if equality is None or not equality.is_equality:
            continue
        solved = next((name for name in equality.parameters if name in gone), None)
        if solved is None:
            continue
        gone.discard(solved)
        pending[place] = None
        for other in dict.fromkeys(mentions[solved]):
            old = pending[other]
            if old is not None and old.factor(solved):
                pending[other] = replaced = substitute_equality(old, equality, solved)
                for new in equality.parameters:
                    mentions[new].append(other)
                if replaced.is_equality:
                    heappush(waiting, other)
    return trim(constraint for constraint in pending if constraint is not None)


def project(
    constraints: Iterable[LinearConstraint], eliminated: Collection[str], deadline: Deadline = NEVER
) -> Conjunction | None:
    """The constraints on the other variables that say the same of them, irredundant; None if nothing satisfies them.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    rest = solve_equalities(constraints, eliminated)
    while True:
        deadline.enforce()
        if any(constraint.is_false for constraint in rest):
            return None
        name = _cheapest(rest, eliminated)
        if name is None:
            break
        rest = _eliminate(rest, name, deadline)
        if len(rest) > CROWD:
            reduced = irredundant(rest)
            if reduced is None:
                return None
            # Redundancy removal can bring equalities to light.
            rest = solve_equalities(reduced, eliminated)
    return irredundant(rest)


def irredundant(constraints: Iterable[LinearConstraint]) -> Conjunction | None:
    """The normal form of a conjunction; None if nothing satisfies it."""
    listed = list(constraints)
    form = normal_form(variables_of(listed), listed)
    return None if form is None else form.constraints


NameT = TypeVar("NameT", str, int)


def linked(statements: Iterable[Iterable[NameT]]) -> dict[NameT, frozenset[NameT]]:
    """By name, all names that statements link with it, directly or by others."""
    groups: dict[NameT, frozenset[NameT]] = {}
    for names in statements:
        known = frozenset(names)
        met = {groups.get(name, frozenset({name})) for name in known}
        if len(met) > 1 or not known <= groups.keys():
            group = frozenset().union(*met)
            groups |= dict.fromkeys(sorted(group), group)
    return groups


Part = TypeVar("Part")


def without_spare(
    parts: Sequence[Part], is_spare: Callable[[Part, list[Part]], bool], order: Iterable[Part] | None = None
) -> list[Part]:
    """The parts without those that can be spared beside the others that are left, tried one by one."""
    kept = list(parts)
    for part in parts if order is None else order:
        others = [other for other in kept if other is not part]
        if is_spare(part, others):
            kept = others
    return kept


def variables_of(constraints: Iterable[LinearConstraint]) -> list[str]:
    return list(dict.fromkeys(name for constraint in constraints for name in constraint.parameters))


def _cheapest(constraints: Sequence[LinearConstraint], eliminated: Collection[str]) -> str | None:
    """The variable whose elimination adds the fewest constraints; None if none is left."""
    below: dict[str, int] = {}
    above: dict[str, int] = {}
    for constraint in constraints:
        for name, factor in constraint.coefficients:
            if name in eliminated:
                side = above if factor > 0 else below
                side[name] = side.get(name, 0) + 1

    def growth(name: str) -> tuple[int, str]:
        low, high = below.get(name, 0), above.get(name, 0)
        return low * high - low - high, name

    return min({**below, **above}, key=growth, default=None)


def _eliminate(constraints: Sequence[LinearConstraint], name: str, deadline: Deadline) -> Conjunction:
    """One step: every lower bound of the variable is at most every upper bound."""
    below, above, rest = bounds(constraints, name)
    for low, low_factor in below:
        deadline.enforce()
        for high, high_factor in above:
            strict = low.is_strict or high.is_strict
            relation = Sense.LESS if strict else Sense.AT_MOST
            rest.append(combine(low, high_factor, high, -low_factor, relation))
    return trim(rest)


Bounds = list[tuple[LinearConstraint, int]]


def bounds(constraints: Iterable[LinearConstraint], name: str) -> tuple[Bounds, Bounds, list[LinearConstraint]]:
    """Lower and upper bounds of a variable with its coefficients there, and the constraints without it."""
    below: Bounds = []
    above: Bounds = []
    rest: list[LinearConstraint] = []
    for constraint in constraints:
        if not constraint.factor(name):
            rest.append(constraint)
            continue
        for half in constraint.halves():
            slope = half.factor(name)
            (above if slope > 0 else below).append((half, slope))
    return below, above, rest


def project_at(
    constraints: Iterable[LinearConstraint], eliminated: Collection[str], point: Mapping[str, Fraction]
) -> Conjunction:
    """Constraints on the other variables that the point satisfies and that imply the exact projection.

    `point` satisfies the constraints. Each variable is put at its greatest lower bound at the point (just above it, if
    strict), or at the least upper bound if it has fewer of those.
    """
    rest = solve_equalities(constraints, eliminated)
    while (name := _cheapest(rest, eliminated)) is not None:
        below, above, free = bounds(rest, name)
        if below and above:
            near, far = (below, above) if len(below) <= len(above) else (above, below)
            tight, factor = max(near, key=lambda bound: _tightness(bound, name, point))
            for other, slope in near:
                if other is not tight:
                    relation = Sense.LESS if other.is_strict and not tight.is_strict else Sense.AT_MOST
                    free.append(combine(other, abs(factor), tight, -abs(slope), relation))
            for other, slope in far:
                relation = Sense.LESS if other.is_strict or tight.is_strict else Sense.AT_MOST
                free.append(combine(other, abs(factor), tight, abs(slope), relation))
        rest = trim(free)
    return rest


def _tightness(bound: tuple[LinearConstraint, int], name: str, point: Mapping[str, Fraction]) -> tuple[Fraction, bool]:
    """How far the bound reaches towards the feasible side at the point, strict bounds further."""
    constraint, factor = bound
    others = sum((c * point[n] for n, c in constraint.coefficients if n != name), Fraction(0))
    limit = (constraint.constant - others) / factor
    return (limit if factor < 0 else -limit), constraint.is_strict


@dataclass(frozen=True, slots=True)
class SolvedForm:
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
            values[name] = rest.constant / rest.factor(name)
        return {name: values[name] for name in self.parameters}


def normal_form(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> SolvedForm | None:
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
    kept = _needed(free, inequalities, interior)
    pivots = tuple(name for name in parameters if name in solved.by_pivot)
    equalities = tuple(solved.by_pivot[name] for name in pivots)
    form = SolvedForm(tuple(parameters), equalities, pivots, kept, {})
    completed = form.complete(dict(zip(free, interior, strict=True)))
    return SolvedForm(tuple(parameters), equalities, pivots, kept, completed)


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


def _needed(
    parameters: Sequence[str], inequalities: Sequence[LinearConstraint], interior: Sequence[Fraction]
) -> tuple[LinearConstraint, ...]:
    """The inequalities that are needed, of a full-dimensional polyhedron without parallel duplicates.

    The facets of the closure are found first. A strict inequality without a facet of its own may still cut off a lower
    face; those that do are kept as well.
    """
    facets = _facets(parameters, inequalities, interior)
    if len(facets) == len(inequalities):
        return tuple(inequalities)
    kept = [inequalities[i] for i in sorted(facets)]
    around = tableau(parameters, kept)
    around.restore()
    candidates = [c for i, c in enumerate(inequalities) if i not in facets and c.is_strict]
    candidates = [c for c in candidates if violates(around.maximize(integer_form(c, parameters)[0]), c)]
    candidates = without_spare(candidates, lambda each, others: not _cuts(parameters, [*kept, *others], each))
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
        crossed = _first_crossed({i: forms[i] for i in unknown}, centre, beyond)
        facets.add(crossed)
        del unknown[crossed]
        known.add(forms[crossed][0], Sense.AT_MOST, forms[crossed][1])
        known.restore()
    return facets


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


def _first_crossed(
    forms: Mapping[int, IntegerForm], centre: tuple[list[int], int], beyond: tuple[list[int], int]
) -> int:
    """Which hyperplane the segment from the centre crosses first, of those that the other end is beyond.

    The centre is moved by a symbolic (ε, ε², …), so that no two hyperplanes are crossed together: what is crossed first
    is a facet, never a hyperplane that only touches.
    """
    weights = {index: -distance for index, form in forms.items() if (distance := _distance(form, beyond)) < 0}
    times = {index: Fraction(_distance(forms[index], centre), weight) for index, weight in weights.items()}
    soonest = min(times.values())
    together = [index for index, time in times.items() if time == soonest]
    if len(together) == 1:
        return together[0]
    return min(together, key=lambda index: [Fraction(-factor, weights[index]) for factor in forms[index][0]])
