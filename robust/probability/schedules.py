"""Fixed schedules: one time for each point that an executor chooses, and how probably all durations fit in between.

The best one is looked for from two sides. A schedule leaves each duration a window, and succeeds with the product of
the probabilities of windows. From above: let a flow y ≥ 0 go through the network from time zero to the deadlines; then
the logarithm of the product is at most Σ max over w of (log P(X ≤ w) − y w) + y_total · deadline − Σ y · constant,
since windows along each path of the flow are no longer than there is time [Lagrangian duality]. With log-concave laws
the least of these bounds is attained by the best schedule.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from math import ceil, exp, floor

import numpy as np

from robust.irr.proposals import SlackPlan
from robust.probability import lattice
from robust.probability.averages import Conditional
from robust.probability.convolution import Array
from robust.probability.distributions import UNIT, Distribution, product_of
from robust.probability.lateness import SINK, LatenessGraph, PathEdge
from robust.probability.lattice import Node
from robust.probability.measure import interval_probability
from robust.probability.random_durations import RandomDuration
from robust.probability.sharing import SharedFactor
from robust.qe.box import Interval

Windows = dict[str, Interval]

TRIALS = 120
"""Fixed schedules that are tried."""


class FixedSchedules:
    """One time for each point that an executor chooses; durations end when they end.

    Args:
        graph: what has to be waited for, and deadlines.
        slack: the plan, with a schedule of its own.
    """

    def __init__(self, graph: LatenessGraph, slack: SlackPlan) -> None:
        self._graph = graph
        self._slack = slack
        edges = graph.with_waits(free=True)
        self._steps = _steps(edges)
        self._ways = [(n, [(e.source, float(e.constant), e.names) for e in entering]) for n, entering in self._steps]
        self._names = sorted({name for edge in edges for name in edge.names})

    def best(self) -> tuple[dict[Node, Fraction], dict[str, Fraction]]:
        """The best schedule that was found; and its times by the names of points that are chosen.

        Allowances for durations, all equally probable to suffice at first, make a schedule; then those are made more
        probable, or less, that pay.
        """
        longest = self._timed({name: self._graph.durations[name].most for name in self._names})
        times = max(self._planned(), longest or self._planned(), key=self.success)
        best = self.success(times)
        weights = dict.fromkeys(self._names, 1.0)
        trials = [dict(weights)]
        step, current = 2.0, -1.0
        for number in range(TRIALS):
            if number:
                name = self._names[number // 2 % len(self._names)]
                trials.append({**weights, name: weights[name] * (step if number % 2 else 1 / step)})
            schedule = self._earliest(trials[-1])
            if schedule is None:
                break
            found = self.success(schedule)
            if found > current:
                current, weights = found, trials[-1]
            if found > best:
                best, times = found, schedule
        points = self._slack.plan.time_points
        ends = self._graph.links
        return times, {
            str(points[int(str(node))]): time for node, time in times.items() if node not in ends and node != SINK
        }

    def _planned(self) -> dict[Node, Fraction]:
        """The schedule of the network at nominal values."""
        return {
            node: Fraction(self._slack.times[int(str(node))], self._slack.scale)
            for node, _ in self._steps
            if node != SINK
        }

    def _earliest(self, weights: Mapping[str, float]) -> dict[Node, Fraction] | None:
        """The earliest schedule for allowances with the greatest probabilities q^weight that are in time."""
        low, high, latest = 0.0, 1.0, float(self._graph.latest)
        for _ in range(14):
            middle = (low + high) / 2
            allowances = self._allowances(weights, middle)
            times: dict[Node, float] = {}
            for node, ways in self._ways:
                arrivals = (
                    times[source] + constant + sum([allowances[name] for name in names])
                    for source, constant, names in ways
                )
                times[node] = max(arrivals, default=0.0)
            low, high = (middle, high) if times[SINK] <= latest else (low, middle)
        return self._timed(
            {name: Fraction(floor(value * 4096), 4096) for name, value in self._allowances(weights, low).items()}
        )

    def _timed(self, allowances: Mapping[str, Fraction]) -> dict[Node, Fraction] | None:
        """The earliest schedule that leaves durations this long, if it is in time."""
        schedule: dict[Node, Fraction] = {}
        for node, entering in self._steps:
            arrivals = (schedule[e.source] + e.constant + sum(allowances[name] for name in e.names) for e in entering)
            schedule[node] = max(arrivals, default=Fraction(0))
        return schedule if schedule[SINK] <= self._graph.latest else None

    def _allowances(self, weights: Mapping[str, float], share: float) -> dict[str, float]:
        return {
            name: float(np.interp(share ** weights[name], law, values)) for name, (values, law) in self._laws.items()
        }

    @cached_property
    def _laws(self) -> dict[str, tuple[Array, Array]]:
        laws = {}
        for name in self._names:
            known = self._graph.durations[name]
            size = 512
            unit = max(known.most, Fraction(1, 10**6)) / (size - 1)
            first, law = known.law(unit, size, upper=False)
            laws[name] = (np.arange(first, first + len(law)).astype(np.float64) * float(unit), law)
        return laws

    def success(self, times: Mapping[Node, Fraction]) -> float:
        """The probability that all durations fit between fixed times, at least."""
        return float(fitting(self.windows(times)[0], self._graph.durations)[0])

    def windows(self, times: Mapping[Node, Fraction]) -> tuple[Windows | None, Windows | None]:
        """Where durations have to be for success, and where they are if there is success; None if there is none.

        Where two durations that end by themselves follow each other, a time in between is what both have to keep.
        """
        links = self._graph.links
        lower: dict[str, list[Fraction | None]] = {
            name: [known.interval.lower, known.interval.upper] for name, known in self._graph.durations.items()
        }
        upper = {name: list(ends) for name, ends in lower.items()}

        def keep(ends: dict[str, list[Fraction | None]], point: Node, side: int, time: Fraction) -> None:
            start, constant, name = links[point]
            value, known = time - times[start] - constant, ends[name][side]
            ends[name][side] = value if known is None else (min if side else max)(known, value)

        for edge in self._graph.edges:
            if edge.names:
                continue
            sides = (lower,) if edge.source in links and edge.target in links else (lower, upper)
            arrival = times[edge.source] + edge.constant
            due = self._graph.latest if edge.target == SINK else times[edge.target]
            if edge.source not in links and edge.target not in links and arrival > due:
                return None, None
            for ends in sides:
                if edge.source in links:
                    middle = times[edge.source] if edge.target in links else due - edge.constant
                    keep(ends, edge.source, 1, middle)
                if edge.target in links:
                    keep(ends, edge.target, 0, arrival)
        return _intervals(lower), _intervals(upper)


def _steps(edges: Sequence[PathEdge]) -> list[tuple[Node, list[PathEdge]]]:
    """Nodes in an order in which edges lead forwards, with the edges that enter each."""
    order, entering, _ = lattice.ordered(edges)
    return [(node, [edges[number] for number in entering[node]]) for node in order]


def _intervals(windows: Mapping[str, Sequence[Fraction | None]]) -> Windows | None:
    if any(low is not None and high is not None and low > high for low, high in windows.values()):
        return None
    return {name: Interval(low, high) for name, (low, high) in windows.items()}


def fitting(windows: Windows | None, durations: Mapping[str, RandomDuration]) -> tuple[Fraction, Fraction]:
    """The probability that each duration is in its window, from both sides."""
    if windows is None:
        return Fraction(0), Fraction(0)
    total = product_of(interval_probability(window, durations[n].distribution) for n, window in windows.items())
    return Fraction(total[0], UNIT), Fraction(min(UNIT, total[1]), UNIT)


def conditionally(
    windows: Windows | None, distributions: Mapping[str, Distribution], factors: Sequence[SharedFactor]
) -> Conditional:
    """How probably durations with given factors fit in."""
    if windows is None:
        return Conditional(0.0, 0.0)
    least, most = product_of(interval_probability(window, distributions[n]) for n, window in windows.items())
    charge = too_short(windows, distributions) if all(factor.is_rising for factor in factors) else 0.0
    return Conditional(least / UNIT * (1 - 2.0**-50), min(1.0, most / UNIT * (1 + 2.0**-50) + charge), charge)


def too_short(windows: Windows, distributions: Mapping[str, Distribution]) -> float:
    """How probably some duration is shorter than its window allows, at most."""
    least = ((each.lower, distributions[n]) for n, each in windows.items() if each.lower is not None)
    total = sum(interval_probability(Interval(None, end, upper_closed=False), known)[1] for end, known in least)
    return min(1.0, total / UNIT * (1 + 2.0**-50))


GRID = 2048
"""Values of each duration that windows are compared at."""
SWEEPS = 12
"""How often what goes along each path is made better."""


class FlowBound:
    """The least bound on how probably any fixed schedule succeeds, under the condition of the durations' intervals.

    The flow goes along paths without time left; what it carries along each is what makes the bound least. See the
    module's text.
    """

    def __init__(self, graph: LatenessGraph) -> None:
        self._latest = float(graph.latest)
        edges = [edge for edge in graph.edges if edge.names or edge.target not in graph.links]
        self._steps = _steps(edges)
        self._laws = {name: self._law(graph.durations[name]) for edge in edges for name in edge.names}
        self._flow = dict.fromkeys(self._laws, 0.0)
        self._carried: dict[tuple[PathEdge, ...], float] = {}

    @staticmethod
    def _law(known: RandomDuration) -> tuple[Array, Array]:
        """Values, and the logarithm of an upper bound of what is at most the next one."""
        unit = max((known.most - known.least) / GRID, Fraction(1, 10**6))
        first, law = known.law(unit, ceil(known.most / unit) + 2, upper=True)
        law[-1] = 1.0
        values = np.arange(first, first + len(law)) * float(unit) * (1 - 2.0**-50)
        return np.asarray(values, dtype=np.float64), np.asarray(np.log(np.maximum(law, 1e-300)))

    def _window(self, name: str) -> float:
        values, law = self._laws[name]
        return float(values[int(np.argmax(law - self._flow[name] * values))])

    def least(self) -> float:
        """The bound, at most 1."""
        best = 1.0
        for _ in range(SWEEPS):
            path = self._longest({name: self._window(name) for name in self._laws})
            self._carried.setdefault(path, 0.0)
            for known in list(self._carried):
                self._improve(known)
            best = min(best, self._bound())
        return best

    def _longest(self, windows: Mapping[str, float]) -> tuple[PathEdge, ...]:
        ends: dict[Node, tuple[float, tuple[PathEdge, ...]]] = {}
        for node, entering in self._steps:
            arrivals = [
                (ends[e.source][0] + float(e.constant) + sum(windows[n] for n in e.names), (*ends[e.source][1], e))
                for e in entering
            ]
            ends[node] = max(arrivals, key=lambda arrival: arrival[0], default=(0.0, ()))
        return ends[SINK][1]

    def _improve(self, path: tuple[PathEdge, ...]) -> None:
        """What goes along a path, so that windows along it take all the time there is, if it is positive."""
        names = [name for edge in path for name in edge.names]
        room = self._latest - float(sum(edge.constant for edge in path))
        before = self._carried[path]
        low, high = -before, 1.0
        rest = {name: self._flow[name] for name in names}

        def total(more: float) -> float:
            for name in names:
                self._flow[name] = max(0.0, rest[name] + more)
            return sum(self._window(name) for name in names)

        while total(high) > room and high < 2.0**40:
            high *= 4
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if total(middle) > room else (low, middle)
        more = low if total(low) <= room else high
        total(more)
        self._carried[path] = before + more

    def _bound(self) -> float:
        """By the flow, which is computed again from what goes along paths; rounded up."""
        flow = dict.fromkeys(self._laws, 0.0)
        total = 0.0
        size = 1.0
        for path, carried in self._carried.items():
            amount = max(0.0, carried)
            room = self._latest - float(sum(edge.constant for edge in path))
            total += amount * room
            size += amount * self._latest
            for edge in path:
                for name in edge.names:
                    flow[name] += amount
        for name, (values, law) in self._laws.items():
            total += float(np.max(law - flow[name] * values))
            size += flow[name] * float(values[-1])
        return min(1.0, exp(min(0.0, total + size * len(self._carried) * 2.0**-45)) * (1 + 2.0**-50))
