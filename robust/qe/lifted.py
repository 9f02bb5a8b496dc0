"""Envelopes where one order is left: a network of difference constraints whose bounds depend on parameters.

Where the network proves, for all parameter values, everything but demands on parameters alone, a value is in the
envelope iff it meets these demands and the network has a schedule: the envelope is the projection of one polyhedron in
parameters and times. That has few inequalities, one for each bound; its projection has one for each cycle of the
network, and may have exponentially many. So it stays as it is: a value is a member iff no cycle of bounds is positive
there, and linear programming is given inequalities of cycles only when a solution breaks one [Kelley 1960].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib.util import find_spec
from math import lcm
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import Linear, TimeVariable, Unknown, constant, variable
from robust.errors import InputError, UnsupportedError
from robust.network.differences import Cycle, Elimination, delay, following, reachable, strong_components
from robust.plan.model import TimePoint
from robust.qe.box import Box, Interval
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import FormulaReader, alternatives_of, names_in
from robust.qe.polyhedron import Point, Polyhedron, check_known, check_names, extent_by
from robust.qe.region import SCHEMA, Region
from robust.qe.simplex import Supremum, extend, supremum, tableau
from robust.smt.limits import Deadline, raise_if_interrupted

if TYPE_CHECKING:
    import numpy as np

SHORT = 60
"""Inequalities up to which a region is written without times, unless it is asked for as it is."""
MOST = 1000
"""Inequalities up to which it is, where only that will do."""
CHUNK = 4096
"""Points that are looked at together."""
LARGEST = 1 << 62
"""Above this integers are not those of machines."""


@dataclass(frozen=True, slots=True)
class _Bound:
    """t_target − t_source ≥ constant + Σ factor · parameter, by numbers of points and parameters; 0 is time zero."""

    source: int
    target: int
    constant: int
    factors: tuple[tuple[int, int], ...]

    def at(self, values: Sequence[int], unit: int) -> int:
        """The weight where each parameter has this multiple of 1 / unit, in units as much smaller."""
        return self.constant * unit + sum(factor * values[number] for number, factor in self.factors)


class LiftedRegion(Region):
    """The parameter values for which some times satisfy constraints: a polyhedron, projected only where it has to be.

    Membership, schedules, slices, optima and extents take shortest paths and linear programming. Whatever else is asked
    of it as a region needs its projection, and raises an UnsupportedError if that has too many inequalities.

    Args:
        parameters: their names.
        times: names of the times.
        constraints: linear constraints over parameters and times; a constraint has at most two times, with opposite
            signs, and is not strict if it has any.
        origins: for each constraint the statements that it is made of, if they are known.
        places: for time points their times, over parameters and times of the region.

    Raises:
        InputError: if a name occurs twice, or a constraint is no difference constraint.
    """

    times: tuple[str, ...]
    constraints: tuple[LinearConstraint, ...]
    places: Mapping[TimePoint, Linear]

    def __init__(
        self,
        parameters: Iterable[str],
        times: Iterable[str],
        constraints: Iterable[LinearConstraint],
        origins: Sequence[tuple[str, ...]] = (),
        places: Mapping[TimePoint, Linear] = MappingProxyType({}),
    ) -> None:
        known = tuple(parameters), tuple(times), tuple(constraints)
        check_names((*known[0], *known[1]))
        for name, value in zip(("parameters", "times", "constraints"), known, strict=True):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "pieces", ())
        object.__setattr__(self, "places", places)
        object.__setattr__(self, "_origins", origins or [()] * len(known[2]))
        self._bounds  # noqa: B018 - wrong constraints are refused at once

    __eq__ = object.__eq__
    __hash__ = object.__hash__
    _origins: Sequence[tuple[str, ...]]

    # -- what it is made of --------------------------------------------------------------------------------------------

    @cached_property
    def demands(self) -> Polyhedron:
        """The constraints on parameters alone."""
        return Polyhedron(self.parameters, tuple(self.demanded))

    @cached_property
    def demanded(self) -> Mapping[LinearConstraint, Sequence[str]]:
        """The constraints on parameters alone, with the statements that they come from."""
        times = set(self.times)
        known = zip(self.constraints, self._origins, strict=True)
        return {c: origins for c, origins in known if times.isdisjoint(c.parameters)}

    @cached_property
    def _differences(self) -> list[tuple[int, int, int, LinearConstraint, tuple[str, ...]]]:
        """Source, target, and the factor of the times of each constraint that has any; with its origins."""
        index = {name: number for number, name in enumerate(self.times, start=1)}
        differences = []
        for given, origins in zip(self.constraints, self._origins, strict=True):
            for constraint in given.halves():
                ends = {factor: index[name] for name, factor in constraint.coefficients if name in index}
                if not ends:
                    continue
                size = abs(next(iter(ends)))
                count = sum(1 for name in constraint.parameters if name in index)
                if count > len(ends) or not ends.keys() <= {size, -size} or constraint.is_strict:
                    raise InputError(f"{constraint} is no difference constraint; expected the difference of two times")
                differences.append((ends.get(size, 0), ends.get(-size, 0), size, constraint, origins))
        return differences

    @cached_property
    def _scale(self) -> int:
        """Weights are multiples of 1 / scale."""
        return lcm(*(size * constraint.constant.denominator for _, _, size, constraint, _ in self._differences))

    @cached_property
    def _bounds(self) -> list[_Bound]:
        number = {name: position for position, name in enumerate(self.parameters)}
        bounds = []
        for source, target, size, constraint, _ in self._differences:
            scale = self._scale // size
            factors = tuple((number[n], factor * scale) for n, factor in constraint.coefficients if n in number)
            bounds.append(_Bound(source, target, int(-constraint.constant * scale), factors))
        return bounds

    @cached_property
    def _cyclic(self) -> list[int]:
        """The bounds that are on any cycle."""
        steps: list[list[int]] = [[] for _ in range(len(self.times) + 1)]
        for bound in self._bounds:
            steps[bound.source].append(bound.target)
        component = strong_components(steps)
        return [n for n, bound in enumerate(self._bounds) if component[bound.source] == component[bound.target]]

    @cached_property
    def _cuts(self) -> dict[LinearConstraint, Cycle]:
        """The cycles that have been met, as inequalities."""
        return {}

    @property
    def form(self) -> str:
        return "lifted"

    # -- points --------------------------------------------------------------------------------------------------------

    def _settled(self, weights: Iterable[int], numbers: Sequence[int]) -> tuple[list[int], Cycle | None]:
        """The least times that these bounds demand with these weights; and a positive cycle if there is one."""
        times = [0] * (len(self.times) + 1)
        ends = ((self._bounds[number].source, self._bounds[number].target) for number in numbers)
        bounds = following(len(times), ((*pair, weight) for pair, weight in zip(ends, weights, strict=True)))
        cycle = delay(times, bounds, range(len(times)))
        return times, None if cycle is None else Cycle(tuple(numbers[origin] for origin in cycle.origins))

    def _scaled(self, point: Point) -> tuple[list[int], int]:
        """The values of all parameters as multiples of 1 / unit, and that unit."""
        values = [point[name] for name in self.parameters]
        unit = lcm(*(value.denominator for value in values))
        return [value.numerator * (unit // value.denominator) for value in values], unit

    def _times_at(self, point: Point) -> tuple[list[int], int]:
        """The least times at a point of the region as multiples of 1 / (unit · scale), and that unit."""
        scaled, unit = self._scaled(point)
        times, _ = self._settled([bound.at(scaled, unit) for bound in self._bounds], range(len(self._bounds)))
        return times, unit

    def _cut(self, cycle: Cycle) -> LinearConstraint:
        """What a cycle says about parameters."""
        factors: dict[str, int] = defaultdict(int)
        for number in cycle.origins:
            for position, factor in self._bounds[number].factors:
                factors[self.parameters[position]] += factor
        total = sum(self._bounds[number].constant for number in cycle.origins)
        cut = LinearConstraint.of(factors, "<=", -total)
        self._cuts.setdefault(cut, cycle)
        return cut

    def _broken_cut(self, point: Point, *, homogeneous: bool = False) -> LinearConstraint | None:
        """An inequality of a cycle that a point breaks; `homogeneous`: along which the point, a direction, leaves."""
        scaled, unit = self._scaled(point)
        weights = [self._bounds[number].at(scaled, unit) for number in self._cyclic]
        if homogeneous:
            weights = [w - self._bounds[n].constant * unit for w, n in zip(weights, self._cyclic, strict=True)]
        _, cycle = self._settled(weights, self._cyclic)
        return None if cycle is None else self._cut(cycle)

    def __contains__(self, point: Point) -> bool:
        return (
            point in self.demands and all(cut.evaluate(point) for cut in self._cuts) and self._broken_cut(point) is None
        )

    def contains_many(self, points: Sequence[Sequence[int]], denominator: int = 1) -> list[bool]:
        """Which of many points are in the region; exact, and much quicker than one by one where numpy is installed.

        Args:
            points: for each point, or row of an array, a numerator for each parameter, in their order.
            denominator: of all of them.
        """
        if find_spec("numpy") is not None and len(points) and self.parameters:
            import numpy as np  # noqa: PLC0415 - takes a tenth of a second to import, and need not be installed

            array = np.asarray(points)
            if array.dtype.kind in "iu" and self._fits(int(abs(array.astype(object)).max()), denominator):
                rows = np.ascontiguousarray(array.astype(np.int64).T)
                parts = [self._contain(rows[:, at : at + CHUNK], denominator) for at in range(0, len(points), CHUNK)]
                return [bool(inside) for part in parts for inside in part]
        return [
            dict(zip(self.parameters, (Fraction(int(value), denominator) for value in point), strict=True)) in self
            for point in points
        ]

    def _fits(self, largest: int, denominator: int) -> bool:
        """Whether integers of machines hold all that is computed of numerators as large as this."""
        sizes = [abs(b.constant) * denominator + sum(abs(f) for _, f in b.factors) * largest for b in self._bounds]
        walk = max(sizes, default=0) * (len(sizes) + 1) * (len(self.times) + 2)
        sums = [
            sum(abs(f) for _, f in c.coefficients) * largest * c.constant.denominator
            + abs(c.constant.numerator) * denominator
            for c in self.demands.constraints
        ]
        return max(walk, *sums, 0) < LARGEST

    def _contain(self, values: np.ndarray[Any, Any], unit: int) -> np.ndarray[Any, Any]:
        """Which columns are in the region: sweeps over all bounds in an order of time, until nothing is delayed."""
        import numpy as np  # noqa: PLC0415 - see above

        count = values.shape[1]
        inside = np.ones(count, dtype=bool)
        position = {name: number for number, name in enumerate(self.parameters)}
        for constraint in self.demands.constraints:
            scale = constraint.constant.denominator
            total = sum(factor * scale * values[position[name]] for name, factor in constraint.coefficients)
            inside &= constraint.relation.holds(total, constraint.constant.numerator * unit)
        open_ = np.flatnonzero(inside)
        ordered = [self._bounds[number] for number in self._sweep]
        weights = []
        for bound in ordered:
            weight = np.full(len(open_), bound.constant * unit, dtype=np.int64)
            for number, factor in bound.factors:
                weight += factor * values[number][open_]
            weights.append(weight)
        times = np.zeros((len(self.times) + 1, len(open_)), dtype=np.int64)
        for _ in range(len(self.times) + 2):
            if not len(open_):
                return inside
            before = times.copy()
            for bound, weight in zip(ordered, weights, strict=True):
                np.maximum(times[bound.target], times[bound.source] + weight, out=times[bound.target])
            late = times[0] > 0 if self._is_grounded else np.zeros(len(open_), dtype=bool)
            inside[open_[late]] = False
            going = (times != before).any(axis=0) & ~late
            if not going.all():
                open_, times = open_[going], times[:, going]
                weights = [weight[going] for weight in weights]
        inside[open_] = False
        return inside

    @cached_property
    def _is_grounded(self) -> bool:
        """Whether no time on a cycle may be before zero: whatever delays zero is on a positive cycle then."""
        leaving: dict[int, list[int]] = defaultdict(list)
        for bound in self._bounds:
            if self._is_least_zero(bound.constant, dict(bound.factors)):
                leaving[bound.source].append(bound.target)
        grounded = reachable(leaving, 0)
        return all(self._bounds[number].source in grounded for number in self._cyclic)

    @cached_property
    def _ranges(self) -> list[tuple[Fraction | None, Fraction | None]]:
        """What demands on single parameters say of each."""
        ends: dict[tuple[str, bool], list[Fraction]] = defaultdict(list)
        for constraint in self.demands.constraints:
            for half in constraint.halves():
                if len(half.coefficients) == 1:  # of which the factor is 1 or −1
                    ((name, factor),) = half.coefficients
                    ends[name, factor > 0].append(half.constant * factor)
        return [(max(ends[name, False], default=None), min(ends[name, True], default=None)) for name in self.parameters]

    def _is_least_zero(self, total: int, factors: Mapping[int, int]) -> bool:
        """Whether a weight is at least zero wherever demands on single parameters hold."""
        least = Fraction(total)
        for number, factor in factors.items():
            end = self._ranges[number][factor < 0]
            if factor and end is None:
                return False
            least += factor * (end or 0)
        return least >= 0

    def reduced(self) -> LiftedRegion:
        """The region without constraints that one or two others with times imply."""
        kept = dict(enumerate(self._bounds))
        leaving: dict[int, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
        for number, bound in kept.items():
            leaving[bound.source][bound.target].append(number)
        for number, bound in [*kept.items()]:
            between = leaving[bound.source]
            pairs = [[other] for other in between[bound.target] if other != number]
            pairs += [
                [first, second]
                for middle, firsts in [*between.items()]
                for second in leaving[middle].get(bound.target, ())
                for first in firsts
                if number not in (first, second)
            ]
            if any(self._implies([kept[other] for other in pair], bound) for pair in pairs):
                between[bound.target].remove(number)
                del kept[number]
        lost = [self._differences[number] for number in range(len(self._bounds)) if number not in kept]
        gone = {constraint for *_, constraint, _ in lost}
        rest = {c: origins for c, origins in zip(self.constraints, self._origins, strict=True) if c not in gone}
        return LiftedRegion(self.parameters, self.times, rest, list(rest.values()), self.places)

    def _implies(self, path: Sequence[_Bound], bound: _Bound) -> bool:
        """Whether a path is at least as long as a bound, wherever demands on single parameters hold."""
        factors: dict[int, int] = defaultdict(int)
        for sign, part in ((-1, bound), *((1, step) for step in path)):
            for number, factor in part.factors:
                factors[number] += sign * factor
        return self._is_least_zero(sum(step.constant for step in path) - bound.constant, factors)

    @cached_property
    def _sweep(self) -> list[int]:
        """The bounds on cycles, in the order of time of some schedule."""
        point = self.some_point()
        if point is None:
            return self._cyclic
        times, _ = self._times_at(point)
        return sorted(self._cyclic, key=lambda number: times[self._bounds[number].source])

    def schedule(self, point: Point) -> dict[TimePoint, Fraction] | None:
        """The least times at a point; None if it is not in the region.

        Raises:
            InputError: if the region was read without time points.
        """
        if self.times and not self.places:
            raise InputError("the region was read from a document without its time points; expected one of a plan")
        if point not in self:
            return None
        times, unit = self._times_at(point)
        known = dict(zip(self.times, (Fraction(time, unit * self._scale) for time in times[1:]), strict=True))
        known |= {name: point[name] for name in self.parameters}
        return {
            place: where.evaluate({unknown: known[str(unknown)] for unknown in where.variables})
            for place, where in self.places.items()
        }

    def contradiction(self, point: Point) -> tuple[str, ...]:
        """Statements that cannot hold together at a point, or a demand that it breaks; none if it is in the region."""
        for given, origins in zip(self.constraints, self._origins, strict=True):
            if set(given.parameters) <= set(self.parameters) and not given.evaluate(point):
                return origins or (str(given),)
        cut = self._broken_cut(point)
        if cut is None:
            return ()
        known = [self._differences[number] for number in self._cuts[cut].origins]
        return tuple(dict.fromkeys(o for *_, constraint, origins in known for o in (origins or (str(constraint),))))

    # -- optima --------------------------------------------------------------------------------------------------------

    def maximize(self, objective: Mapping[str, Fraction]) -> Supremum | None:
        """The least upper bound of a linear form; None if the region is empty."""
        solved = tableau(self.parameters, [*self.demands.constraints, *self._cuts])
        while solved.restore():
            raise_if_interrupted()
            best = supremum(solved, self.parameters, objective)
            cut = self._broken_cut(best.point)
            if cut is None and best.ray is not None:
                cut = self._broken_cut(best.ray, homogeneous=True)
            if cut is None:
                return best
            extend(solved, self.parameters, [cut])
        return None

    def extent(self, name: str) -> Interval | None:
        """The interval of values that a parameter takes; None if the region is empty."""
        check_known((name,), self.parameters)
        return extent_by(self.maximize, name)

    def interval(self, name: str, at: Point) -> Interval | None:
        """The values of one parameter where the others are as at a point; None if there are none."""
        return self._fixed({other: at[other] for other in self.parameters if other != name}).extent(name)

    def some_point(self) -> dict[str, Fraction] | None:
        names = self.parameters
        solved = tableau(names, [*self.demands.constraints, *self._cuts])
        while solved.restore():
            raise_if_interrupted()
            point = dict(zip(names, solved.point(), strict=True))
            cut = self._broken_cut(point)
            if cut is None:
                return point
            extend(solved, names, [cut])
        return None

    def satisfies(self, constraint: LinearConstraint) -> bool:
        """Whether every point satisfies a constraint."""
        for half in constraint.halves():
            best = self.maximize({name: Fraction(factor) for name, factor in half.coefficients})
            if best is not None and (
                best.value is None
                or best.value > half.constant
                or (half.is_strict and best.attained and best.value == half.constant)
            ):
                return False
        return True

    def point_outside(self, of: Region | None = None) -> dict[str, Fraction] | None:
        if of is None or isinstance(of, LiftedRegion) or any(removed for _, removed in of.parts()):
            return super().point_outside(of)
        for piece, _ in of.parts():
            box = piece.bounding_box()
            if box is None:
                continue
            cycle, certain = self._worst_cycle(box)
            for cut in (*self.demands.constraints, *(() if cycle is None else (self._cut(cycle),))):
                for beyond in cut.negation():
                    point = piece.restricted([beyond]).some_point()
                    if point is not None:
                        return point
            if not certain:
                return super().point_outside(of)
        return None

    def contains_box(self, box: Box) -> bool:
        if box.is_empty or not box.intervals.keys() >= set(self.parameters):
            return super().contains_box(box)
        cycle, certain = self._worst_cycle(box.intervals)
        if cycle is not None:
            self._cut(cycle)
        if any(side.meets(box) for side in self.known_sides()):
            return False
        return certain or super().contains_box(box)

    def _worst_cycle(self, box: Mapping[str, Interval]) -> tuple[Cycle | None, bool]:
        """A cycle that is positive where each bound is as large as it gets in a box; and whether none is certain."""
        numbers, weights = [], []
        for number in self._cyclic:
            bound = self._bounds[number]
            ends = [
                (box[self.parameters[n]].upper if f > 0 else box[self.parameters[n]].lower, f) for n, f in bound.factors
            ]
            if any(end is None for end, _ in ends):
                return None, False
            numbers.append(number)
            weights.append(bound.constant + sum((end * factor for end, factor in ends if end is not None), Fraction(0)))
        unit = lcm(*(weight.denominator for weight in weights))
        _, cycle = self._settled([int(weight * unit) for weight in weights], numbers)
        return cycle, cycle is None

    # -- slices and projections ----------------------------------------------------------------------------------------

    def _fixed(self, values: Point) -> LiftedRegion:
        """The region over the parameters that have no value yet."""
        check_known(values, self.parameters)
        known = {name: constant(value) for name, value in values.items()}
        rest = (name for name in self.parameters if name not in values)

        def place(unknown: Unknown) -> Linear:
            return known[str(unknown)] if str(unknown) in known else variable(unknown)

        places = {point: where.substitute(place) for point, where in self.places.items()}
        constraints = (constraint.substitute(values) for constraint in self.constraints)
        return LiftedRegion(rest, self.times, constraints, self._origins, places)

    def slice(self, values: Point) -> Region:
        """Fix some parameters at values; the region over the rest, without times if that is short."""
        return self._fixed(values).explicit(SHORT)

    def explicit(self, most: int) -> Region:
        """The region without times if it has at most this many inequalities, else as it is."""
        try:
            return Region.difference(self._projected(most).simplified(), ())
        except UnsupportedError:
            return self

    @cached_property
    def base(self) -> Polyhedron:
        """The projection to parameters.

        Raises:
            UnsupportedError: if it has too many inequalities.
        """
        return self._projected(MOST)

    def _projected(self, most: int) -> Polyhedron:
        """The inequalities of all cycles, but for some that others imply."""
        paths = _Paths(self, most)
        return Polyhedron(self.parameters, (*self.demands.constraints, *paths.inequalities()))

    def known_sides(self) -> list[Polyhedron]:
        """Half-spaces outside of the region: beyond its demands, and beyond the inequalities that have been met."""
        sides = [side for c in (*self.demands.constraints, *self._cuts) for side in c.negation()]
        return [Polyhedron(self.parameters, (side,)) for side in sides]

    # -- documents -----------------------------------------------------------------------------------------------------

    def as_dict(self) -> dict[str, Any]:
        """The region's part of a `robust/region/1` document."""
        known = {"schema": SCHEMA, "parameters": list(self.parameters), "form": self.form}
        return {**known, "lifted": self.lifted_dict()}

    def lifted_dict(self) -> dict[str, Any]:
        """Names of the times, and all constraints."""
        return {"times": list(self.times), "constraints": [constraint.as_dict() for constraint in self.constraints]}

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> LiftedRegion:
        """Read what `as_dict` writes, or `lifted` of a `robust/region/1` document; InputError if it cannot be read."""
        try:
            known = document["lifted"]
            constraints = map(LinearConstraint.from_dict, known["constraints"])
            return LiftedRegion(document["parameters"], known["times"], constraints)
        except (KeyError, TypeError) as error:
            message = "cannot read a region: expected lists `parameters`, and `times` and `constraints` under `lifted`"
            raise InputError(message) from error

    def __str__(self) -> str:
        lines = " ∧ ".join(map(str, self.constraints)) or "true"
        return f"{{ {lines} }} for some {', '.join(self.times)}" if self.times else f"{{ {lines} }}"


_Form = tuple[tuple[int, ...], int]
"""Factors of the parameters, and a constant, with parameters counted from their lower bounds."""


class _Paths(Elimination[list[_Form]]):
    """The cycles of a region's network, by elimination of its times [Dechter, Meiri and Pearl 1991].

    An edge has all forms of paths that it stands for, but for those that are never longer than another one: factors of
    parameters with a lower bound are at most as large, other factors the same, and so is the constant.
    """

    def __init__(self, region: LiftedRegion, most: int) -> None:
        super().__init__(len(region.times) + 1)
        self._region = region
        self._most = most
        self._count = 0
        self._cycles: list[_Form] = []
        self._least = [least for least, _ in region._ranges]
        self._unit = lcm(*(least.denominator for least in self._least if least is not None))
        for number in region._cyclic:
            bound = region._bounds[number]
            factors = [0] * len(region.parameters)
            total = bound.constant * self._unit
            for position, factor in bound.factors:
                factors[position] = factor * self._unit
                total += int(factor * (self._least[position] or 0) * self._unit)
            self._add(bound.source, bound.target, [(tuple(factors), total)])

    def _is_within(self, form: _Form, other: _Form) -> bool:
        """Whether a form is certain to be at most as large as another one."""
        return form[1] <= other[1] and all(
            mine <= its if least is not None else mine == its
            for mine, its, least in zip(form[0], other[0], self._least, strict=True)
        )

    def _longest(self, forms: Iterable[_Form]) -> list[_Form]:
        kept: list[_Form] = []
        for form in dict.fromkeys(forms):
            if not any(self._is_within(form, other) for other in kept):
                kept = [other for other in kept if not self._is_within(other, form)]
                kept.append(form)
        return kept

    def _add(self, source: int, target: int, forms: Collection[_Form]) -> None:
        raise_if_interrupted()
        if source == target:
            zero = (0,) * len(self._least), 0
            self._cycles = self._longest([*self._cycles, *(form for form in forms if not self._is_within(form, zero))])
            self._check(len(self._cycles))
            return
        kept = self._longest([*self.after[source].get(target, ()), *forms])
        self._check(len(kept))
        self.connect(source, target, kept)

    def _check(self, count: int) -> None:
        if count > self._most:
            raise UnsupportedError(
                f"a region with more than {self._most} inequalities between parameters; "
                "expected fewer: fix some parameters, or use the region as it is with its times"
            )

    def join(self, source: int, first: list[_Form], node: int, second: list[_Form], target: int) -> None:
        self._check(len(first) * len(second) // 50)
        sums = [(tuple(map(int.__add__, one, other)), total + more) for one, total in first for other, more in second]
        self._add(source, target, sums)

    def inequalities(self) -> list[LinearConstraint]:
        while len(self.remaining) > 1:
            self.eliminate(min(self.remaining - {0}, key=self._effort))
        return [self._inequality(form) for form in self._cycles]

    def _effort(self, node: int) -> tuple[int, int]:
        return sum(map(len, self.before[node].values())) * sum(map(len, self.after[node].values())), node

    def _inequality(self, form: _Form) -> LinearConstraint:
        moved = sum(
            (f * least for f, least in zip(form[0], self._least, strict=True) if least is not None), Fraction(0)
        )
        return LinearConstraint.of(dict(zip(self._region.parameters, form[0], strict=True)), "<=", moved - form[1])


# -- plans -------------------------------------------------------------------------------------------------------------


def lifted_envelope(encoding: RelationalEncoding, reader: FormulaReader, deadline: Deadline) -> LiftedRegion | None:
    """The envelope of a plan if one order is left; None if some obligation is about times, or has alternatives.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    plan = encoding.plan
    names = tuple(parameter.name for parameter in plan.parameters)
    demands: list[tuple[Conjunction, str]] = []
    for obligation in encoding.obligations:
        deadline.enforce()
        if obligation.violation is None:
            continue
        violation = reader.read(obligation.violation)
        if not names_in(violation) <= set(names) or len(encoding.query(obligation)) > 1:
            return None
        if (alternatives := alternatives_of(violation)) is None:
            return None
        demands += [(alternative, obligation.name) for alternative in alternatives]
    return _of_network(encoding, names, demands)


def _of_network(
    encoding: RelationalEncoding, names: tuple[str, ...], demands: Iterable[tuple[Conjunction, str]]
) -> LiftedRegion | None:
    """The region of a network where no alternative of all these may hold, if that is convex as far as they tell."""
    constraints: dict[LinearConstraint, tuple[str, ...]] = {}
    for inequality in encoding.network.inequalities:
        given = {str(unknown): -factor for unknown, factor in inequality.expression.coefficients()}
        side = LinearConstraint.of(given, "<=", inequality.expression.constant_term)
        constraints.setdefault(side, inequality.origins)
    waiting = list(demands)
    while waiting:
        left = []
        for alternative, origin in waiting:
            rest = _unsettled(alternative, constraints)
            if rest is None:
                continue
            if len(rest) > 1 or (rest and rest[0].is_equality):
                left.append((rest, origin))
            else:
                side = rest[0].negation()[0] if rest else LinearConstraint.false()
                constraints.setdefault(side, (origin,))
        if len(left) == len(waiting):
            return None
        waiting = left
    places = encoding.places
    times = dict.fromkeys(
        str(unknown) for place in places.values() for unknown in place.variables if isinstance(unknown, TimeVariable)
    )
    if not times.keys().isdisjoint(names):
        return None
    return LiftedRegion(names, times, constraints, list(constraints.values()), places).reduced()


def _unsettled(alternative: Conjunction, known: Iterable[LinearConstraint]) -> Conjunction | None:
    """An alternative without what constraints on its own parameters imply; None if these exclude it."""
    names = tuple(sorted({name for constraint in alternative for name in constraint.parameters}))
    around = Polyhedron(names, tuple(constraint for constraint in known if set(constraint.parameters) <= set(names)))
    if around.restricted(alternative).is_empty:
        return None
    return tuple(constraint for constraint in alternative if not around.satisfies(constraint))
