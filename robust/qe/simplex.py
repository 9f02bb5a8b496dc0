"""An exact simplex tableau over free rational variables, with integer rows and a symbolic infinitesimal.

A strict inequality `a·x < b` is `a·x ≤ b − δ` for an infinitesimal δ > 0: every constant is a pair (rational part,
multiple of δ), ordered lexicographically. Rows are lists of integers over a common denominator, because integer
arithmetic is an order of magnitude quicker than that of fractions. All pivots follow Bland's least-index rule, so every
run ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm

from robust.qe.constraint import LinearConstraint, Sense

Row = list[int]
"""`[denominator, constant, multiple of δ, coefficient of each column...]`; the denominator is positive."""

FIRST = 3
"""Where the coefficients of a row begin."""
OBJECTIVE = -1


@dataclass(frozen=True, slots=True)
class Optimum:
    """The least upper bound of a linear form.

    `value` is None if the form is unbounded. `slope` is the multiple of δ at the optimum: negative if and only if
    strict constraints keep the bound from being attained. `point` attains the bound on the closure (of an unbounded
    form: the point where the search stopped), and `ray` is a direction along which an unbounded form grows.
    """

    value: Fraction | None
    slope: Fraction
    vertex: tuple[tuple[int, int], ...]
    """The point, as numerators and denominators: most are never looked at."""
    ray: tuple[Fraction, ...] | None = None

    @property
    def point(self) -> tuple[Fraction, ...]:
        return tuple(Fraction(*ratio) for ratio in self.vertex)

    @property
    def is_attained(self) -> bool:
        return self.value is not None and not self.slope


class Tableau:
    """Constraints over `dimension` free variables, added one at a time; `restore` finds a point that satisfies them.

    Slack variables are numbered from `dimension` in the order in which constraints were added. Rows of slacks never
    depend on a variable that is still free and nonbasic.
    """

    def __init__(self, dimension: int) -> None:
        self.dimension = dimension
        self._columns = list(range(dimension))
        self._rows: dict[int, Row] = {}
        self._next = dimension
        self._dead: set[int] = set()
        """Positions of columns that equalities fix at zero."""
        self._hopeless: frozenset[int] = frozenset()
        self.conflict: frozenset[int] = frozenset()
        """Slacks whose constraints contradict each other, once `restore` has failed."""
        self.weights: dict[int, int] = {}
        """Positive multiples of inequalities that add up to the conflict [Farkas 1902], if it rests on no equality."""
        self.only_strictly = False
        """Whether the conflict vanishes if its constraints include their boundaries."""

    def copy(self) -> Tableau:
        """An independent tableau in the same state."""
        twin = Tableau(self.dimension)
        twin._columns, twin._dead = list(self._columns), set(self._dead)
        twin._rows = {variable: list(row) for variable, row in self._rows.items()}
        twin._next, twin._hopeless, twin.conflict = self._next, self._hopeless, self.conflict
        return twin

    def add(self, form: Sequence[int], sense: Sense, constant: int) -> int:
        """Add `form · x  sense  constant` and return its slack variable; feasibility is not restored yet."""
        slack = self._next
        self._next += 1
        row = self._express([-factor for factor in form])
        row[1] += constant * row[0]
        if sense is Sense.LESS:
            row[2] -= row[0]
        self._rows[slack] = _reduced(row)
        if sense is Sense.EQUAL:
            self._fix(slack)
        else:
            column = self._free_column(self._rows[slack])
            if column is not None:
                self._pivot(slack, column)
        return slack

    def _fix(self, slack: int) -> None:
        """Make the slack zero for good."""
        row = self._rows[slack]
        column = self._free_column(row)
        if column is None:
            column = next((j for j in range(self.dimension) if row[FIRST + j]), None)
        if column is None:
            if row[1] or row[2]:
                self._hopeless = frozenset((slack,))
            del self._rows[slack]
            return
        self._pivot(slack, column)
        self._dead.add(column)
        for other in self._rows.values():
            other[FIRST + column] = 0

    def _free_column(self, row: Row) -> int | None:
        for j, variable in enumerate(self._columns):
            if row[FIRST + j] and variable < self.dimension:
                return j
        return None

    def _express(self, form: Sequence[int]) -> Row:
        """`form · x` over the present columns."""
        total = [1] + [0] * (2 + self.dimension)
        for variable, factor in enumerate(form):
            if factor:
                total = _sum(total, factor, self._row_of(variable))
        return total

    def _row_of(self, variable: int) -> Row:
        row = self._rows.get(variable)
        if row is None:
            row = [1] + [0] * (2 + self.dimension)
            row[FIRST + self._columns.index(variable)] = 1
        return row

    @property
    def tight(self) -> list[int]:
        """The slacks that are zero at the present vertex and, with the free variables that are too, determine it."""
        return [variable for variable in self._columns if variable >= self.dimension]

    def restore(self) -> bool:
        """Pivot until every slack is non-negative; False, with `conflict` set, if the constraints are contradictory."""
        if self._hopeless:
            self.conflict, self.only_strictly = self._hopeless, False
            return False
        while True:
            leaving = self._first_violated()
            if leaving is None:
                return True
            row = self._rows[leaving]
            entering = self._least_column(row)
            if entering is None:
                self.weights = {v: -row[FIRST + j] for j, v in enumerate(self._columns) if row[FIRST + j]}
                self.weights[leaving] = row[0]
                self.conflict = frozenset(self.weights)
                self.only_strictly = row[1] == 0
                return False
            self._pivot(leaving, entering)

    def _first_violated(self) -> int | None:
        """The violated slack of least index."""
        negative = [
            variable
            for variable, row in self._rows.items()
            if (row[1] < 0 or (row[1] == 0 and row[2] < 0)) and variable >= self.dimension
        ]
        return min(negative, default=None)

    def _least_column(self, row: Row) -> int | None:
        """The column of least variable with a positive coefficient."""
        best: int | None = None
        for j in range(self.dimension):
            if row[FIRST + j] > 0 and (best is None or self._columns[j] < self._columns[best]):
                best = j
        return best

    def maximize(self, form: Sequence[int], *, above: Fraction | None = None) -> Optimum:
        """The least upper bound of `form · x` on the constraints, which `restore` has found to be satisfiable.

        With `above` the search may stop at any value greater than that; the result is then a lower bound.
        """
        row = _reduced(self._express(form))
        free = self._free_column(row)
        if free is not None:
            return self._unbounded(free, 1 if row[FIRST + free] > 0 else -1)
        self._rows[OBJECTIVE] = row
        try:
            return self._climb(above)
        finally:
            del self._rows[OBJECTIVE]

    def _climb(self, above: Fraction | None) -> Optimum:
        while True:
            row = self._rows[OBJECTIVE]
            stop = above is not None and row[1] * above.denominator > above.numerator * row[0]
            entering = None if stop else self._least_column(row)
            if entering is None:
                return Optimum(Fraction(row[1], row[0]), Fraction(row[2], row[0]), self._vertex())
            leaving = self._ratio_test(entering)
            if leaving is None:
                return self._unbounded(entering, 1)
            self._pivot(leaving, entering)

    def _ratio_test(self, column: int) -> int | None:
        """The slack that first becomes zero as the column's variable grows; None if none does."""
        best: int | None = None
        size = constant = delta = 0
        for variable, row in self._rows.items():
            factor = -row[FIRST + column]
            if factor <= 0 or variable < self.dimension:
                continue
            if best is not None:
                order = row[1] * size - constant * factor or row[2] * size - delta * factor or variable - best
                if order > 0:
                    continue
            best, size, constant, delta = variable, factor, row[1], row[2]
        return best

    def _unbounded(self, column: int, sign: int) -> Optimum:
        ray = []
        for variable in range(self.dimension):
            row = self._row_of(variable)
            ray.append(Fraction(sign * row[FIRST + column], row[0]))
        return Optimum(None, Fraction(0), self._vertex(), tuple(ray))

    def _pivot(self, leaving: int, column: int) -> None:
        """Exchange a basic variable and the variable of a column."""
        row = self._rows.pop(leaving)
        position = FIRST + column
        factor = row[position]
        if factor > 0:
            solved = [-entry for entry in row]
            solved[0], solved[position] = factor, row[0]
        else:
            solved = list(row)
            solved[0], solved[position] = -factor, -row[0]
        solved = _reduced(solved)
        scale = solved[0]
        for variable, other in self._rows.items():
            weight = other[position]
            if weight:
                other[position] = 0
                mixed = [scale * entry + weight * term for entry, term in zip(other, solved, strict=True)]
                mixed[0] = scale * other[0]
                self._rows[variable] = _reduced(mixed)
        entering = self._columns[column]
        self._columns[column] = leaving
        self._rows[entering] = solved

    def _vertex(self) -> tuple[tuple[int, int], ...]:
        """The present vertex with δ = 0: in the closure of the constraints."""
        rows = (self._rows.get(variable) for variable in range(self.dimension))
        return tuple((0, 1) if row is None else (row[1], row[0]) for row in rows)

    def point(self) -> tuple[Fraction, ...]:
        """A point that satisfies every constraint, strict ones included, after a successful `restore`."""
        delta = Fraction(1)
        for variable, row in self._rows.items():
            if variable >= self.dimension and row[2] < 0:
                delta = min(delta, Fraction(row[1], -row[2]))
        return self._evaluate(delta)

    def _evaluate(self, delta: Fraction) -> tuple[Fraction, ...]:
        values = []
        for variable in range(self.dimension):
            row = self._rows.get(variable)
            values.append(Fraction(0) if row is None else (row[1] + row[2] * delta) / Fraction(row[0]))
        return tuple(values)


def _reduced(row: Row) -> Row:
    divisor = gcd(*row)
    return row if divisor == 1 else [entry // divisor for entry in row]


def _sum(left: Row, factor: int, right: Row) -> Row:
    """`left + factor · right` over a common denominator."""
    a, b = right[0], left[0] * factor
    total = [a * x + b * y for x, y in zip(left, right, strict=True)]
    total[0] = left[0] * right[0]
    return _reduced(total)


IntegerForm = tuple[tuple[int, ...], int]
"""Coefficients in the order of the parameters, and a constant."""


@dataclass(frozen=True, slots=True)
class Supremum:
    """The least upper bound of a linear form over a polyhedron that is not empty.

    `value` is None if the form is unbounded; `attained` tells whether some point of the polyhedron has the value.
    `point` is a point of the closure with that value (if unbounded: any), not of the polyhedron unless attained there.
    """

    value: Fraction | None
    attained: bool
    point: dict[str, Fraction]
    ray: dict[str, Fraction] | None = field(default=None, repr=False, compare=False)
    """If the form is unbounded, a direction in which it grows for ever."""


def integer_form(constraint: LinearConstraint, parameters: Sequence[str]) -> IntegerForm:
    """The constraint's coefficients and constant, scaled to integers."""
    by_name = dict(constraint.coefficients)
    scale = constraint.constant.denominator
    form = tuple(by_name[name] * scale if name in by_name else 0 for name in parameters)
    return form, constraint.constant.numerator


def tableau(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> Tableau:
    """A tableau of the constraints, equalities first; feasibility is not restored yet."""
    result = Tableau(len(parameters))
    extend(result, parameters, sorted(constraints, key=lambda constraint: not constraint.is_equality))
    return result


def extend(target: Tableau, parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> list[int]:
    """Add constraints to a tableau; their slack variables."""
    slacks = []
    for constraint in constraints:
        form, constant = integer_form(constraint, parameters)
        slacks.append(target.add(form, constraint.relation, constant))
    return slacks


def feasible_point(parameters: Sequence[str], constraints: Iterable[LinearConstraint]) -> dict[str, Fraction] | None:
    """A point that satisfies every constraint, strict ones included; None if there is none."""
    solved = tableau(parameters, constraints)
    return dict(zip(parameters, solved.point(), strict=True)) if solved.restore() else None


def maximize(
    parameters: Sequence[str], constraints: Iterable[LinearConstraint], objective: Mapping[str, Fraction]
) -> Supremum | None:
    """The least upper bound of `Σ objective · parameter` under the constraints; None if they have no solution."""
    solved = tableau(parameters, constraints)
    return supremum(solved, parameters, objective) if solved.restore() else None


def supremum(solved: Tableau, parameters: Sequence[str], objective: Mapping[str, Fraction]) -> Supremum:
    """The least upper bound of `Σ objective · parameter` on a tableau whose feasibility has been restored."""
    scale = lcm(*(Fraction(factor).denominator for factor in objective.values()))
    form = [int(objective.get(name, 0) * scale) for name in parameters]
    optimum = solved.maximize(form)
    point = dict(zip(parameters, optimum.point, strict=True))
    ray = None if optimum.ray is None else dict(zip(parameters, optimum.ray, strict=True))
    value = None if optimum.value is None else optimum.value / scale
    return Supremum(value, optimum.is_attained, point, ray)


def violates(optimum: Optimum, constraint: LinearConstraint) -> bool:
    """Whether some point goes beyond an inequality, given the optimum of its integer form.

    A strict inequality is also violated by a point on its boundary.
    """
    if optimum.value is None or optimum.value > constraint.constant.numerator:
        return True
    return constraint.is_strict and optimum.is_attained and optimum.value == constraint.constant.numerator
