"""Concrete parameter values and schedules of a parametrized plan, drawn with a given random generator.

The temporal network is solved here by shortest paths of its own, so that what is sampled does not depend on the code
under test. Every function is deterministic in its `random`.
"""

import os
from fractions import Fraction
from itertools import product
from math import lcm

from robust.plan.model import ZERO, ParameterReference

QUANTUM = Fraction(1, 8)
HORIZON = Fraction(6)
"""How far beyond its earliest time an unbounded time point is put at most."""


def often(quick, thorough):
    """How many examples to draw: more where slow tests run as well."""
    return thorough if "ROBUST_THOROUGH" in os.environ else quick


def sample_parameters(plan, random, *, spread=Fraction(2)):
    """A value per parameter: its nominal value, a declared bound, or a multiple of `QUANTUM` within `spread` of it."""
    steps, values = int(spread / QUANTUM), {}
    for parameter in plan.parameters:
        near = parameter.nominal + QUANTUM * random.randint(-steps, steps)
        near = near if parameter.lower is None else max(near, parameter.lower)
        near = near if parameter.upper is None else min(near, parameter.upper)
        choices = [parameter.nominal, near, near, parameter.lower, parameter.upper]
        values[parameter.name] = random.choice([value for value in choices if value is not None])
    return values


def sample_schedule(plan, parameters, random):
    """A schedule of all time points that satisfies the network under `parameters`; None if there is none."""
    return next(iter(sample_schedules(plan, parameters, random, 1)), None)


def sample_schedules(plan, parameters, random, count, *, epsilon=Fraction(1, 1000)):
    """`count` schedules that satisfy the network under `parameters`, without repetitions; empty if there is none.

    Points are fixed one by one, in random order, at an end of the window that is left to them, at the time of a point
    already fixed, `epsilon` beside it, or a multiple of `QUANTUM` above the window's lower end.
    """
    network = Network(plan, parameters, (epsilon, QUANTUM))
    if not network.consistent:
        return []
    schedules = []
    for _ in range(count):
        schedule = network.sample(random, epsilon)
        if schedule not in schedules:
            schedules.append(schedule)
    return schedules


class Network:
    """The temporal network under parameter values, closed under shortest paths, parameter bounds included.

    `consistent` says whether it has a schedule. All times are integers in units of `1 / scale`, a common denominator of
    all bounds and of `steps`.
    """

    def __init__(self, plan, parameters, steps=()):
        self.points = plan.time_points
        edges = _edges(plan, parameters)
        self.scale = lcm(*(number.denominator for number in (*steps, HORIZON, *(edge[2] for edge in edges))))
        self.distances = self._closed(edges)
        negative = any((row[i] or 0) < 0 for i, row in enumerate(self.distances))
        self.consistent = not negative and all(
            (parameter.lower is None or parameter.lower <= parameters[parameter.name])
            and (parameter.upper is None or parameters[parameter.name] <= parameter.upper)
            for parameter in plan.parameters
        )

    def _closed(self, edges):
        index = {point: i for i, point in enumerate(self.points)}
        size = range(len(self.points))
        distances = [[0 if a == b else None for b in size] for a in size]

        def lower(a, b, distance):
            known = distances[a][b]
            distances[a][b] = distance if known is None else min(known, distance)

        for source, target, bound in edges:
            lower(index[source], index[target], self._units(bound))
        for middle, a in product(size, size):
            before = distances[a][middle]
            if before is not None:
                for b, after in enumerate(distances[middle]):
                    if after is not None:
                        lower(a, b, before + after)
        return distances

    def _units(self, time):
        return int(time * self.scale)

    def sample(self, random, epsilon):
        """One schedule; see :func:`sample_schedules`. Closed distances make any choice within a window extensible."""
        fixed = {0: 0}
        waiting = list(range(1, len(self.points)))
        random.shuffle(waiting)
        for point in waiting:
            to_fixed = [(time, self.distances[point][other]) for other, time in fixed.items()]
            from_fixed = [(time, self.distances[other][point]) for other, time in fixed.items()]
            lower = max(time - distance for time, distance in to_fixed if distance is not None)
            uppers = [time + distance for time, distance in from_fixed if distance is not None]
            upper = min(uppers, default=lower + self._units(HORIZON))
            other = random.choice(list(fixed.values()))
            beside = [other, other - self._units(epsilon), other + self._units(epsilon)]
            step = self._units(QUANTUM)
            between = lower + step * random.randint(0, (upper - lower) // step)
            inside = [time for time in beside if lower <= time <= upper]
            fixed[point] = random.choice([lower, upper, between, between, *inside])
        return {point: Fraction(fixed[i], self.scale) for i, point in enumerate(self.points)}


def _edges(plan, parameters):
    """`(a, b, w)`: t_b − t_a ≤ w."""
    edges = [(point, ZERO, Fraction(0)) for point in plan.time_points]
    for point in plan.time_points:
        if point.time is not None:
            edges += [(ZERO, point, point.time), (point, ZERO, -point.time)]
    for constraint in plan.constraints:
        if constraint.upper is not None:
            edges.append((constraint.source, constraint.target, bound_value(constraint.upper, parameters)))
        if constraint.lower is not None:
            edges.append((constraint.target, constraint.source, -bound_value(constraint.lower, parameters)))
    return edges


def bound_value(bound, parameters):
    """The value of a temporal bound or another polynomial over parameters only."""
    return bound.evaluate({ParameterReference(name): value for name, value in parameters.items()})
