"""The probability that a plan succeeds whose durations are random: weakly, dynamically, and by a fixed schedule.

Which orders and which values of single durations the longest paths need is read off the slack graph; that every
schedule within them is valid is proved once, by the obligations themselves. Bounds of the rest are those of
:mod:`robust.probability.lateness`; a fixed schedule has an exact product of probabilities.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from math import floor

import numpy as np

from robust.encode import create_encoding
from robust.irr.containment import Containment
from robust.irr.proposals import SlackPlan
from robust.network.slack import FaceBound, OutsideFragmentError, SlackRequirement
from robust.plan import model
from robust.plan.model import within as restricted
from robust.plan.polynomial import Polynomial
from robust.probability import lattice, packing
from robust.probability.distributions import UNIT, Distribution, product, quotient
from robust.probability.lateness import SINK, LatenessGraph, PathBounds, PathEdge, lateness_graph
from robust.probability.lattice import Array, Node
from robust.probability.measure import Bounds, SuccessProbabilities, interval_probability
from robust.probability.random_durations import RandomDuration, drawn
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline


class Lateness:
    """The probability of success of a plan whose parameters are durations.

    Args:
        plan: the plan.
        distributions: of all parameters.
        epsilon: the separation of mutex time points.
        deadline: when to stop.
        solver: `z3` or `cvc5`.

    Raises:
        OutsideFragmentError: if there is more to the plan than longest paths.
        OutOfTimeError: if the deadline passes first.
    """

    def __init__(
        self,
        plan: model.ParametrizedPlan,
        distributions: Mapping[str, Distribution],
        epsilon: Fraction,
        deadline: Deadline,
        *,
        solver: str,
    ) -> None:
        self._plan = plan
        self._slack = SlackPlan(plan, epsilon)
        self._distributions = {name: known.settled for name, known in distributions.items()}
        self._deadline = deadline
        intervals, orders = self._demands()
        durations = {name: RandomDuration(name, known, intervals[name]) for name, known in self._distributions.items()}
        self._mass = (UNIT, UNIT)
        for known in durations.values():
            self._mass = product(self._mass, known.mass)
        if not self._mass[0]:
            raise OutsideFragmentError("hardly any duration is as it has to be")
        self._unordered = sum((self._disorder(order) for order in orders), Fraction(0))
        self.graph = lateness_graph(self._slack, durations)
        self._prove(Box(intervals), orders, epsilon, solver)
        self.probabilities: SuccessProbabilities | None = None
        self.passing: Mapping[str, float] = {}
        self.cells = 0

    # -- what is demanded of single durations, and of orders ----------------------------------------------------------

    def _demands(self) -> tuple[dict[str, Interval], list[SlackRequirement]]:
        """Where each parameter has to be, and orders of points that have to follow."""
        scale = self._slack.scale
        parameters = self._plan.parameters
        ends: list[list[Fraction | None]] = [[None, None] for _ in parameters]

        def demand(number: int, side: int, value: Fraction) -> None:
            known = ends[number][side]
            ends[number][side] = value if known is None else (min if side else max)(known, value)

        lengths = {}
        for bound in self._slack.bounds:
            if bound.face is not None and not bound.face & 1:
                constant = Fraction(bound.weight, scale) - parameters[bound.face >> 1].nominal
                lengths[bound.source, bound.target] = bound.face >> 1, constant
                demand(bound.face >> 1, 0, -constant)  # no length is negative, and no start before zero
        for form in self._slack.forms:
            if len(form.factors) > 1:
                raise OutsideFragmentError(f"{form.name!r} compares several parameters")
            for face, factor in form.factors.items():
                room = form.budget / factor / scale
                demand(face >> 1, face & 1, parameters[face >> 1].nominal + (room if face & 1 else -room))
        orders = []
        for requirement in self._slack.open_requirements():
            length = lengths.get((requirement.source, requirement.target))
            if length is None:
                orders.append(requirement)
            else:
                demand(length[0], 0, Fraction(requirement.weight, scale) - length[1])
        return {
            known.name: Interval(ends[number][0], ends[number][1]) for number, known in enumerate(parameters)
        }, orders

    def _disorder(self, order: SlackRequirement) -> Fraction:
        """How probably points come in another order, at most: the duration of some action between them is too short."""
        weight = Fraction(order.weight, self._slack.scale)
        leaving: dict[int, list[FaceBound]] = defaultdict(list)
        for bound in self._slack.bounds:
            if bound.weight >= 0 and (bound.face is None or not bound.face & 1):
                leaving[bound.source].append(bound)
        least = {order.source: Fraction(1)}
        waiting = [order.source]
        while waiting:
            point = waiting.pop()
            for bound in leaving[point]:
                risk = least[point]
                if bound.face is not None:
                    name = self._plan.parameters[bound.face >> 1].name
                    short = interval_probability(Interval(None, weight), self._distributions[name])[1]
                    risk = min(risk, Fraction(short, UNIT))
                if bound.target not in least or risk < least[bound.target]:
                    least[bound.target] = risk
                    waiting.append(bound.target)
        return least.get(order.target, Fraction(1))

    def _prove(self, box: Box, orders: Sequence[SlackRequirement], epsilon: Fraction, solver: str) -> None:
        """That every schedule with these orders is valid wherever durations are in the box."""
        points = self._plan.time_points
        ordered = [
            model.TemporalConstraint(
                points[order.source],
                points[order.target],
                Polynomial.constant(Fraction(order.weight, self._slack.scale)),
                None,
            )
            for order in orders
        ]
        plan = replace(self._plan, constraints=(*self._plan.constraints, *ordered))
        encoding = create_encoding("relational", restricted(plan, box.ranges), epsilon, self._deadline)
        if not Containment(encoding, solver=solver).keeps(box, self._deadline):
            raise OutsideFragmentError("some schedule breaks an obligation")

    # -- probabilities -----------------------------------------------------------------------------------------------

    def run(self, within: Fraction, on_bounds: Callable[[Bounds], None]) -> None:
        """Bounds of the three probabilities; those of success are told as they become closer.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        graph = self.graph
        fixed, starts = FixedSchedules(graph, self._slack).best()
        strong = self._of_all(*fixed)
        on_bounds(Bounds(strong.lower, Fraction(1)))
        weak, dynamic = Bounds(strong.lower, Fraction(1)), Bounds(strong.lower, Fraction(1))
        known: dict[tuple[PathEdge, ...], PathBounds] = {}

        def tell() -> None:
            nonlocal weak, dynamic
            least, most, policy = (known.get(edges) for edges in sides)
            lower = max(0.0 if least is None else least.lower, 0.0 if policy is None else policy.lower)
            bounds = self._of_all(lower, 1.0 if most is None else most.upper)
            weak = Bounds(max(weak.lower, bounds.lower), min(weak.upper, bounds.upper))
            if policy is not None:
                bounds = self._of_all(policy.lower, policy.upper)
                dynamic = Bounds(max(dynamic.lower, bounds.lower), min(dynamic.upper, bounds.upper, weak.upper))
            strong_ = Bounds(strong.lower, min(strong.upper, dynamic.upper))
            self.probabilities = SuccessProbabilities(weak, dynamic, strong_, starts)
            self.cells = sum(path.cells for path in known.values())
            on_bounds(weak)

        sides = graph.with_waits(free=False), graph.edges, graph.with_waits(free=True)
        for edges in sides:
            if edges not in known:
                known[edges] = PathBounds(edges, graph.durations, graph.latest)
                known[edges].run(float(within * Fraction(999, 1000)), tell, self._deadline)
        tell()
        self.passing = known[graph.edges].passing

    def _of_all(self, lower: float, upper: float) -> Bounds:
        """Bounds without the condition that each duration is where it has to be, and orders are kept."""
        least, most = (Fraction(part, UNIT) for part in self._mass)
        return Bounds(
            max(Fraction(0), Fraction(lower) * least - self._unordered),
            min(Fraction(1), Fraction(upper) * most + self._unordered),
        )

    def draw(self, count: int) -> packing.LatenessDraws:
        """Random draws, always the same: how often, and along which durations, a schedule is too late."""
        graph, random = self.graph, np.random.default_rng(0)
        lengths = {name: drawn(known.distribution, random, count) for name, known in graph.durations.items()}
        inside = np.ones(count, dtype=bool)
        for name, known in graph.durations.items():
            low, high = known.interval.lower, known.interval.upper
            inside &= lengths[name] >= (-np.inf if low is None else float(low))
            inside &= lengths[name] <= (np.inf if high is None else float(high))
        edges = [
            (
                edge.source,
                edge.target,
                float(edge.constant) + sum((lengths[name] for name in edge.names), np.zeros(count)),
            )
            for edge in graph.edges
        ]
        edges += [
            (wait.source, wait.target, float(wait.constant) - lengths[wait.name])
            for wait in graph.waiting
            if not wait.free
        ]
        names = [edge.names for edge in graph.edges] + [()] * (len(edges) - len(graph.edges))
        order, entering, _ = lattice.topology((source, target) for source, target, _ in edges) or ([], {}, {})
        times: dict[Node, Array] = {}
        for node in order:
            ways = [times[edges[number][0]] + edges[number][2] for number in entering[node]]
            times[node] = np.max([np.zeros(count), *ways], axis=0)
        late = times[SINK] - float(graph.latest)
        margin = 1e-9 * max(1.0, float(graph.latest))
        critical = {node: np.zeros(count, dtype=bool) for node in order}
        critical[SINK] = inside & (late > margin)
        points: dict[str, float] = defaultdict(float)
        durations: dict[str, float] = defaultdict(float)
        for node in reversed(order):
            rest = critical[node].copy()
            for number in entering[node]:
                source, _, length = edges[number]
                chosen = rest & (times[source] + length >= times[node] - margin)
                rest &= ~chosen
                critical[source] |= chosen
                share = float(chosen.mean())
                if node == SINK and share:
                    points[graph.due[source]] += share
                for name in names[number]:
                    durations[name] += share
        successes = inside & (late <= margin)
        passing = {name: Fraction(at_most) for name, at_most in self.passing.items()}
        return packing.LatenessDraws(
            count,
            int(successes.sum()),
            float((inside & (late > margin) & (late <= 1 + margin)).mean()),
            tuple(packing.LateShare(name, share) for name, share in sorted(points.items(), key=lambda item: -item[1])),
            tuple(
                packing.LateShare(name, share, passing.get(name))
                for name, share in sorted(durations.items(), key=lambda item: -item[1])
                if share
            ),
        )


# -- fixed schedules ---------------------------------------------------------------------------------------------------

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
        order, entering, _ = lattice.topology((edge.source, edge.target) for edge in edges) or ([], {}, {})
        self._steps = [(node, [edges[number] for number in entering[node]]) for node in order]
        self._names = sorted({name for edge in edges for name in edge.names})

    def best(self) -> tuple[tuple[float, float], dict[str, Fraction]]:
        """The probability of success of the best schedule that was found, from both sides, and its times.

        Allowances for durations, all equally probable to suffice at first, make a schedule; then those are made more
        probable, or less, that pay.
        """
        best = self.success(self._planned())
        times = self._planned()
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
            if found[0] > current:
                current, weights = found[0], trials[-1]
            if found[0] > best[0]:
                best, times = found, schedule
        points = self._slack.plan.time_points
        ends = self._graph.links
        return best, {
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
        constants = {edge: float(edge.constant) for _, entering in self._steps for edge in entering}
        low, high, latest = 0.0, 1.0, float(self._graph.latest)
        for _ in range(14):
            middle = (low + high) / 2
            allowances = self._allowances(weights, middle)
            times: dict[Node, float] = {}
            for node, entering in self._steps:
                ways = (times[e.source] + constants[e] + sum(allowances[name] for name in e.names) for e in entering)
                times[node] = max(ways, default=0.0)
            low, high = (middle, high) if times[SINK] <= latest else (low, middle)
        exact = {name: Fraction(floor(value * 4096), 4096) for name, value in self._allowances(weights, low).items()}
        schedule: dict[Node, Fraction] = {}
        for node, entering in self._steps:
            arrivals = (schedule[e.source] + e.constant + sum(exact[name] for name in e.names) for e in entering)
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

    def success(self, times: Mapping[Node, Fraction]) -> tuple[float, float]:
        """The probability that all durations fit between fixed times, from both sides.

        Where two durations that end by themselves follow each other, a time in between is what both have to keep.
        """
        links = self._graph.links
        lower: dict[str, list[Fraction | None]] = {name: [None, None] for name in self._graph.durations}
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
                return 0.0, 0.0
            for ends in sides:
                if edge.source in links:
                    middle = times[edge.source] if edge.target in links else due - edge.constant
                    keep(ends, edge.source, 1, middle)
                if edge.target in links:
                    keep(ends, edge.target, 0, arrival)
        result = []
        for ends, side in ((lower, 0), (upper, 1)):
            total = (UNIT, UNIT)
            for name, (low, high) in ends.items():
                known = self._graph.durations[name]
                both = Interval(
                    max((end for end in (low, known.interval.lower) if end is not None), default=None),
                    min((end for end in (high, known.interval.upper) if end is not None), default=None),
                )
                if both.lower is not None and both.upper is not None and both.lower > both.upper:
                    total = (0, 0)
                    break
                inside = interval_probability(both, known.distribution)
                total = product(total, quotient(inside, known.mass))
            result.append(total[side] / UNIT * (1 - 2.0**-50 if side == 0 else 1 + 2.0**-50))
        return result[0], min(1.0, result[1])
