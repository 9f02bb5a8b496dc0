"""The exact schedule that a planner meant by rounded times: the nearest one that its domain allows.

Planners print a few decimals. What is printed stands for an interval: durations are what the domain demands, exactly,
the order of happenings is the printed one, mutex time points are ε apart, and starts move as little as they must. Where
only differences of times are bounded the least greatest shift has a closed form: with L the least schedule that is not
before the printed times, it is half of the greatest L − printed, unless zero or a timed literal asks for more; half,
because a chain of steps may begin as much earlier as it ends later.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import lcm
from operator import le

from robust.encode.network import changes
from robust.errors import RefutedError
from robust.network.differences import Bound, delay, following
from robust.numbers import format_number, plural, round_up
from robust.plan import model, timeline
from robust.plan.model import ZERO, ActionInstance, ParametrizedPlan, TimePoint
from robust.plan.polynomial import Polynomial


class NearSchedules:
    """Times within windows that satisfy bounds between points; point 0 is zero, at time 0.

    Bounds are kept by propagation of the least and, negated, the greatest times of each point; both are schedules. None
    of this has a meaning once :attr:`possible` is False.
    """

    def __init__(self, bounds: Sequence[Bound], low: Sequence[int], high: Sequence[int]) -> None:
        size = len(low)
        self._after = following(size, bounds)
        self._before = following(size, [(target, source, weight) for source, target, weight in bounds])
        self.low, self._below = list(low), [-end for end in high]
        cycle = delay(self.low, self._after, range(size))
        self.possible = cycle is None and all(map(le, self.low, high))
        if self.possible:
            delay(self._below, self._before, range(size))

    def place(self, wished: Sequence[int]) -> list[int]:
        """A schedule in which points, the earlier ones first, are as near to their wished times as they can."""
        for point in sorted(range(1, len(wished)), key=wished.__getitem__):
            time = min(max(wished[point], self.low[point]), -self._below[point])
            for times, end, steps in ((self.low, time, self._after), (self._below, -time, self._before)):
                if times[point] != end:
                    times[point] = end
                    delay(times, steps, [point])
        return self.low


def least_shift(bounds: Sequence[Bound], printed: Sequence[int]) -> int | None:
    """The least d such that times within d of the printed ones satisfy the bounds; None if no times do.

    Times must be even numbers, because a shift may have halves: that of an odd distance is rounded up.
    """
    size = len(printed)
    between = following(size, (bound for bound in bounds if 0 not in bound[:2]))
    never = min(0, *printed) - sum(abs(weight) for _, _, weight in bounds)
    later, forced = list(printed), [0, *[never] * (size - 1)]
    if delay(later, between, range(size)) is not None or delay(forced, following(size, bounds), [0]) is not None:
        return None
    shift = 0
    for point in range(1, size):
        shift = max(shift, -((printed[point] - later[point]) // 2), forced[point] - printed[point])
    return max([shift, *(later[source] + weight for source, target, weight in bounds if source and not target)])


# -- plans -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Snapped:
    """The times of a plan made exact; `shift` is how far a start, or an end whose duration may vary, moved at most."""

    times: Mapping[TimePoint, Fraction]
    durations: int
    """Number of durations that differ from the printed ones."""
    starts: int
    shift: Fraction

    def __str__(self) -> str:
        """A summary of the moves; empty if nothing moved."""
        moved = [plural(count, what) for count, what in ((self.durations, "duration"), (self.starts, "start")) if count]
        return f"{' and '.join(moved)} moved, by at most {format_number(round_up(self.shift))}" if moved else ""


Demands = Mapping[str, tuple[Fraction, Fraction | None]]
"""The least and the greatest duration of each instance that the domain allows."""
_CONTRADICTION = "durations and separations contradict each other in the printed order"


class TooFarError(RefutedError):
    """No schedule near enough to the printed times does what the domain demands.

    `times` are the printed starts, with exact durations where these are near enough: they show what breaks. `shift` is
    near enough, if any is.
    """

    def __init__(self, message: str, times: Mapping[TimePoint, Fraction], shift: Fraction | None = None) -> None:
        super().__init__(message)
        self.times = times
        self.shift = shift


@dataclass(frozen=True)
class Snapping:
    """The search for the nearest schedule with the durations that the domain demands, the printed order, and mutex
    points ε apart.

    Args:
        plan: the ground plan, without constraints; parameters have their nominal values.
        printed: the time of every time point.
        tolerances: how far each start, and each end, may be from where it was printed.
        pairs: the mutex pairs of the plan.
        epsilon: their separation; 0 is at different times, as little apart as that can be said of them all.
    """

    plan: ParametrizedPlan
    printed: Mapping[TimePoint, Fraction]
    tolerances: Mapping[TimePoint, Fraction]
    pairs: Sequence[tuple[TimePoint, TimePoint]]
    epsilon: Fraction

    @cached_property
    def _order(self) -> dict[TimePoint, int]:
        """The time points in the printed order; of what is printed at one time, ends come before starts."""
        starts = {instance.start for instance in self.plan.instances if instance.durative}
        ordered = sorted(self.plan.time_points, key=lambda point: (self.printed[point], point in starts))
        return {point: number for number, point in enumerate(ordered)}

    def run(self) -> Snapped:
        """The schedule.

        Raises:
            TooFarError: if there is none.
            InputError: if a fluent is read that has no value.
        """
        demands = self._demands()
        self._check_durations(demands)
        nodes: dict[TimePoint, tuple[int, Fraction]] = {}
        """The node of the network that a time point belongs to, and how long after it the time point is."""
        points: list[TimePoint] = [ZERO]
        for point in self.plan.time_points:
            if point == ZERO or point.time is not None:
                nodes[point] = 0, point.time or Fraction(0)
        for instance in self.plan.instances:
            nodes[instance.start] = len(points), Fraction(0)
            points.append(instance.start)
            if instance.durative:
                low, high = demands[instance.identifier]
                if low == high:
                    nodes[instance.end] = nodes[instance.start][0], low
                else:
                    nodes[instance.end] = len(points), Fraction(0)
                    points.append(instance.end)
        bounds = [(nodes[source], nodes[target], weight) for source, target, weight in self._bounds(demands)]
        numbers = [self.epsilon, *(weight for _, _, weight in bounds), *(after for _, after in nodes.values())]
        reach = [self.tolerances.get(point, Fraction(0)) for point in points]
        numbers += [*(self.printed[point] for point in points), *reach]
        scale = 2 * lcm(*(number.denominator for number in numbers))
        if not self.epsilon:
            # All numbers are multiples of 2 / scale, and less than all steps of this length together.
            scale *= len(points) + 1
        gap = self.epsilon or Fraction(2, scale)
        for pair in self.pairs:
            early, late = sorted(pair, key=self._order.__getitem__)
            bounds.append((nodes[early], nodes[late], gap))
        network = [
            (source, target, int((weight + before - after) * scale))
            for (source, before), (target, after), weight in bounds
            if source != target or weight + before - after > 0
        ]
        wished = [int(self.printed[point] * scale) for point in points]
        if any(source == target for source, target, _ in network):
            raise TooFarError(_CONTRADICTION, self._with_durations(demands))
        times = self._placed(network, wished, [int(distance * scale) for distance in reach], scale, demands)
        exact = {point: Fraction(times[node], scale) + after for point, (node, after) in nodes.items()}
        return self._result(exact, max(abs(a - b) for a, b in zip(times, wished, strict=True)), scale)

    def _placed(
        self, network: list[Bound], wished: list[int], near: list[int], scale: int, demands: Demands
    ) -> list[int]:
        """The schedule nearest to the printed times, each time within its own tolerance."""
        shift = least_shift(network, wished)
        if shift is None:
            raise TooFarError(_CONTRADICTION, self._with_durations(demands))

        def windows(reach: int) -> NearSchedules:
            both = [(wish, min(reach, limit)) for wish, limit in zip(wished, near, strict=True)]
            return NearSchedules(network, [wish - most for wish, most in both], [wish + most for wish, most in both])

        greatest = max(near)
        if not windows(greatest).possible:
            needed = Fraction(shift, scale)
            wrong = f"starts would have to move by up to {format_number(round_up(needed))}"
            raise TooFarError(wrong, self._with_durations(demands), needed)
        # Where some may move less than that, the others have to make up for it.
        reach = shift if windows(shift).possible else greatest
        while shift < reach:
            middle = (shift + reach) // 2
            shift, reach = (shift, middle) if windows(middle).possible else (middle + 1, reach)
        return windows(reach).place(wished)

    def _bounds(self, demands: Demands) -> Iterator[tuple[TimePoint, TimePoint, Fraction]]:
        for instance in self.plan.instances:
            yield ZERO, instance.start, Fraction(0)
            if instance.durative:
                low, high = demands[instance.identifier]
                yield instance.start, instance.end, low
                if high is not None:
                    yield instance.end, instance.start, -high
        writers: dict[model.Atom | model.Fluent, set[TimePoint]] = {}
        for name, point in changes(self.plan):
            writers.setdefault(name, set()).add(point)
        for instance in self.plan.instances:
            for part in instance.conditions:
                if part.timing is model.Timing.OVER_ALL:
                    for name in model.names_in(part.condition):
                        for point in writers.get(name, ()):
                            yield from self._outside(instance, point)

    def _outside(self, instance: ActionInstance, point: TimePoint) -> Iterator[tuple[TimePoint, TimePoint, Fraction]]:
        """A writer of what has to hold over all of an instance stays before, within or after it, as it was printed.

        One that was printed so shortly before the end that it may be after it is taken to be that.
        """
        if point in instance.time_points:
            return
        start, end = self.printed[instance.start], self.printed[instance.end]
        near = self.tolerances.get(point, Fraction(0)) + self.tolerances.get(instance.end, Fraction(0))
        if self.printed[point] <= start:
            yield point, instance.start, Fraction(0)
        elif self.printed[point] >= end - near:
            yield instance.end, point, Fraction(0)
        else:
            yield instance.start, point, Fraction(0)
            yield point, instance.end, Fraction(0)

    def _demands(self) -> dict[str, tuple[Fraction, Fraction | None]]:
        """The least and the greatest duration of each instance that the domain allows, in the printed order.

        What a duration reads may come from effects that depend on durations, so these are read again until they stay.
        """
        demands: dict[str, tuple[Fraction, Fraction | None]] = {}
        times = self._spread()
        durations = {
            instance.identifier: self.printed[instance.end] - self.printed[instance.start]
            for instance in self.plan.instances
        }
        for _ in range(len(durations) + 1):
            execution = timeline.TimedExecution(self.plan, self.plan.nominal, times, durations)
            demands = {
                instance.identifier: duration_range(instance, read_before(execution, instance))
                for instance in self.plan.instances
                if instance.durative
            }
            exact = {name: _nearest(durations[name], *limits) for name, limits in demands.items()}
            if exact.items() <= durations.items():
                break
            durations |= exact
        return demands

    def _check_durations(self, demands: Demands) -> None:
        """Check that demanded durations are the printed ones but for rounding."""
        too_far = [(away, instance) for instance, away in self._changes(demands) if abs(away) > self._reach(instance)]
        if too_far:
            away, instance = max(too_far, key=lambda change: abs(change[0]))
            wrong = f"the duration of {instance} would have to change by {format_number(round_up(abs(away)))}"
            raise TooFarError(wrong, self._with_durations(demands), abs(away))

    def _changes(self, demands: Demands) -> Iterator[tuple[ActionInstance, Fraction]]:
        """Differences between the durations that the domain demands and the printed ones."""
        for instance in self.plan.instances:
            if instance.durative:
                printed = self.printed[instance.end] - self.printed[instance.start]
                yield instance, _nearest(printed, *demands[instance.identifier]) - printed

    def _reach(self, instance: ActionInstance) -> Fraction:
        """Tolerance of a duration."""
        return self.tolerances.get(instance.end, Fraction(0))

    def _with_durations(self, demands: Demands) -> dict[TimePoint, Fraction]:
        """The printed starts, and ends by exact durations where these are near enough."""
        times = dict(self.printed)
        for instance, change in self._changes(demands):
            if abs(change) <= self._reach(instance):
                times[instance.end] += change
        return times

    def _spread(self) -> dict[TimePoint, Fraction]:
        """The printed times with mutex points that share one a little apart, in their order."""
        tied = {point for pair in self.pairs for point in pair if self.printed[pair[0]] == self.printed[pair[1]]}
        little = Fraction(1, 10**12)
        return {
            point: time + little * self._order[point] if point in tied and point.time is None else time
            for point, time in self.printed.items()
        }

    def _result(self, times: Mapping[TimePoint, Fraction], shift: int, scale: int) -> Snapped:
        printed, instances = self.printed, self.plan.instances
        changes = [
            (times[instance.end] - times[instance.start]) - (printed[instance.end] - printed[instance.start])
            for instance in instances
            if instance.durative
        ]
        starts = sum(times[instance.start] != printed[instance.start] for instance in instances)
        return Snapped(times, sum(map(bool, changes)), starts, max([Fraction(shift, scale), *map(abs, changes)]))


Known = Callable[[model.DurationConstraint], model.Expression]
"""The expression of a duration constraint, with a number for each variable but `?duration` that has a known value."""


def duration_range(instance: ActionInstance, known: Known) -> tuple[Fraction, Fraction | None]:
    """The least and the greatest duration that the constraints of an instance allow, strict bounds included.

    Constraints that are not linear in `?duration`, or read anything else that is not known, are left out.
    """
    low, high = Fraction(0), None
    for constraint in instance.durations:
        expression = known(constraint)
        if expression.variables == {model.Duration()} and expression.is_linear:
            ((_, slope),) = expression.coefficients()
            limit, equal = -expression.constant_term / slope, constraint.condition.relation is model.Relation.EQUAL
            if equal or slope > 0:
                low = max(low, limit)
            if equal or slope < 0:
                high = limit if high is None else min(high, limit)
    return low, high


def read_before(execution: timeline.TimedExecution, instance: ActionInstance) -> Known:
    """The expressions of duration constraints, with values from the states of an execution."""

    def known(constraint: model.DurationConstraint) -> model.Expression:
        reading = execution.reading(execution.before(instance.at(constraint.timing)), instance)

        def value(variable: model.NumericVariable) -> model.Expression:
            length = isinstance(variable, model.Duration)
            return Polynomial.variable(variable) if length else Polynomial.constant(reading.variable(variable))

        return constraint.condition.expression.substitute(value)

    return known


def _nearest(value: Fraction, low: Fraction, high: Fraction | None) -> Fraction:
    return max(low, value if high is None else min(value, high))
