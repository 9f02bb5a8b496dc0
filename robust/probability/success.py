"""The probability that a plan succeeds whose durations are random: weakly, dynamically, and by a fixed schedule.

Which orders and which values of single durations the longest paths need is read off the slack graph; that every
schedule within them is valid is proved once, by the obligations themselves. Bounds of the rest are those of
:mod:`robust.probability.lateness`; a fixed schedule has an exact product of probabilities.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from robust.encode import create_encoding
from robust.irr.containment import Containment
from robust.irr.proposals import SlackPlan
from robust.network.slack import FaceBound, OutsideFragmentError, SlackRequirement
from robust.plan import model
from robust.plan.model import within as restricted
from robust.plan.polynomial import Polynomial
from robust.probability import lateness, lattice, packing
from robust.probability.averages import Conditional, SharedAverage, draw_factors
from robust.probability.convolution import Array
from robust.probability.distributions import UNIT, Distribution, product_of
from robust.probability.lateness import SINK, WORK, ChainLaws, LatenessGraph, PathBounds, PathEdge, lateness_graph
from robust.probability.lattice import Node
from robust.probability.measure import Bounds, SuccessProbabilities, interval_probability
from robust.probability.random_durations import RandomDuration, drawn
from robust.probability.schedules import FixedSchedules, FlowBound, Windows, conditionally, fitting, too_short
from robust.probability.sharing import Given, Joint, SharedFactor, deviation, influenced, root, shared_range
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, raise_if_interrupted

SHARE = 0.5
"""The part of the distance of bounds that is left to each value of factors."""
CLOSE = 0.005
"""How close bounds of a fixed schedule with factors are to be."""


class Lateness:
    """The probability of success of a plan whose parameters are durations.

    Args:
        plan: the plan.
        distributions: of all parameters.
        epsilon: the separation of mutex time points.
        deadline: when to stop.
        solver: `z3` or `cvc5`.
        factors: what durations share; independent.
        joints: jointly normal durations.
        certain: whether a schedule is known to exist for all values that can be drawn.

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
        factors: Sequence[SharedFactor] = (),
        joints: Sequence[Joint] = (),
        certain: bool = False,
    ) -> None:
        self._plan = plan
        self._certain = certain
        self._slack = SlackPlan(plan, epsilon)
        self._distributions = {name: known.settled for name, known in distributions.items()}
        self._factors, self._joints = factors, joints
        self._deadline = deadline
        self._intervals, orders = self._demands()
        self._unordered = sum((self._disorder(order) for order in orders), Fraction(0))
        self._given = GivenDurations(self._distributions, self._intervals)
        if not factors and not self._given.mass[0]:
            raise OutsideFragmentError("hardly any duration is as it has to be")
        ranges = {
            name: _ranging(RandomDuration(name, known, self._intervals[name]), factors)
            for name, known in self._distributions.items()
        }
        self.graph = replace(lateness_graph(self._slack, ranges), durations=self._given.durations)
        self._given.graph = self.graph
        self._prove(Box(self._intervals), orders, epsilon, solver)
        self.probabilities: SuccessProbabilities | None = None
        self.cells = 0
        self._certified: dict[str, Bounds] = {}
        self._gain: Bounds | None = None

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
        """Prove that every schedule with these orders is valid wherever durations are in the box."""
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
        close = float(within * Fraction(999, 1000))
        schedules = FixedSchedules(self.graph, self._slack)
        found, starts = schedules.best()
        strong = self._strong(schedules, found, close)
        on_bounds(Bounds(strong.lower, Fraction(1)))
        best = min(strong.upper if self._factors else Fraction(1), Fraction(1))
        if not self._factors:
            best = self._bounds(0, Fraction(FlowBound(self.graph).least()) * Fraction(self._given.mass[1], UNIT)).upper
        weak = Bounds(Fraction(1) if self._certain else strong.lower, Fraction(1))
        dynamic = Bounds(Fraction(0), Fraction(1))
        self.probabilities = None

        def learn(lower: Fraction | float, upper: Fraction | float, *, is_policy: bool) -> None:
            nonlocal weak, dynamic
            bounds = self._bounds(lower, upper)
            if is_policy:
                dynamic = dynamic.within(bounds)
            else:
                weak = weak.within(bounds)
            weak = Bounds(max(weak.lower, dynamic.lower), weak.upper)
            dynamic = Bounds(dynamic.lower, min(dynamic.upper, weak.upper)) if self.graph.waiting else weak
            most = weak.upper if self._factors else min(best, weak.upper)
            self.probabilities = SuccessProbabilities(
                weak,
                dynamic,
                Bounds(strong.lower, min(strong.upper, most)),
                Bounds(max(dynamic.lower, strong.lower), weak.upper),
                Bounds(strong.lower, most),
                starts,
            )
            on_bounds(weak)

        if self._certain:
            learn(1, 1, is_policy=False)
        for is_policy in (False, True)[self._certain : 1 + bool(self.graph.waiting)]:
            if self._joints:
                learn(*self._by_single_paths(is_policy), is_policy=is_policy)
            elif self._factors:
                self._average(is_policy, close, learn)
            else:

                def tell(is_policy: bool = is_policy) -> None:
                    self.cells = self._given.cells
                    learn(*self._given.bounds(is_policy), is_policy=is_policy)

                self._given.run(tell, is_policy, close, self._deadline)

    def _average(self, is_policy: bool, within: float, learn: Callable[..., None]) -> None:
        """Bounds over all values of the factors."""
        rising = all(factor.is_rising for factor in self._factors)

        def at(values: Given) -> Conditional:
            durations = GivenDurations(self._for(values), self._intervals, self.graph)
            if not durations.mass[0]:
                return Conditional(0.0, durations.mass[1] / UNIT + durations.short, durations.short)
            durations.run(lambda: None, is_policy, within * SHARE, self._deadline)
            self.cells += durations.cells
            least, most = durations.bounds(is_policy)
            short = durations.short if rising else 0.0
            return Conditional(float(least) * (1 - 2.0**-50), float(most) * (1 + 2.0**-50) + short, short)

        mean = SharedAverage(self._factors, self._distributions, at, self._check)
        mean.run(within, lambda: learn(mean.lower, mean.upper, is_policy=is_policy))

    def _strong(self, schedules: FixedSchedules, times: Mapping[Node, Fraction], within: float) -> Bounds:
        """How probably a fixed schedule succeeds."""
        windows = schedules.windows(times)
        if self._joints:
            parts = [
                [interval_probability(window, self._given.durations[name].distribution) for name, window in one.items()]
                for one in windows
                if one is not None
            ]
            if len(parts) < 2:
                return self._bounds(0, 0)
            outside = sum((1 - Fraction(low, UNIT) for low, _ in parts[0]), Fraction(0))
            return self._bounds(1 - outside, Fraction(min(high for _, high in parts[1]), UNIT))
        if not self._factors:
            return self._bounds(*(fitting(one, self._given.durations)[side] for side, one in enumerate(windows)))
        ends = []
        for side, inside in enumerate(windows):

            def at(values: Given, inside: Windows | None = inside) -> Conditional:
                return conditionally(inside, self._for(values), self._factors)

            mean = SharedAverage(self._factors, self._distributions, at, self._check)
            mean.run(max(within, CLOSE))
            ends.append((mean.lower, mean.upper)[side])
        return self._bounds(*ends)

    def _by_single_paths(self, is_policy: bool) -> tuple[Fraction, Fraction]:
        """Bounds where durations are correlated in other ways: each path has a law, of all together little is known.

        What durations of a path add up to that are jointly normal is normal. All paths are in time at least as probably
        as none is late by the union of what can happen; with covariances that are not negative, at least as probably
        as if paths were independent [Pitt 1982]; and at most as probably as the one that is most often late.
        """
        graph, durations = self.graph, self._given.durations
        short = Fraction(0)
        for known in durations.values():
            short += 1 - Fraction(known.mass[0], UNIT)
        plain = set(graph.edges)
        positive = all(entry >= 0 for joint in self._joints for row in joint.matrix for entry in row)
        total, product_, most = Fraction(0), Fraction(1), Fraction(1)
        for number, path in enumerate(_paths(graph.with_waits(free=True))):
            self._check()
            if number >= PATHS:
                return Fraction(0), most
            names = [name for edge in path for name in edge.names]
            lengths = {name: durations[name] for name in names}
            merged = []
            for at, joint in enumerate(self._joints):
                inside = [row for row, name in enumerate(joint.names) if name in lengths]
                if inside:
                    mean = sum((lengths.pop(joint.names[row]).distribution.centre for row in inside), Fraction(0))
                    variance = sum((joint.matrix[row][column] for row in inside for column in inside), Fraction(0))
                    normal = Distribution("normal", {"mean": mean, "deviation": deviation(variance)}).settled
                    merged.append(RandomDuration(f"joint {at}", normal, Interval(Fraction(0), None)))
            for one in merged:
                lengths[one.name] = one
            constant = sum((edge.constant for edge in path), Fraction(0))
            bounds = PathBounds([PathEdge(0, SINK, constant, tuple(lengths))], ChainLaws(lengths, graph.latest))
            bounds.run(1e-6, lambda: None, self._deadline)
            below = sum((1 - Fraction(one.mass[0], UNIT) for one in lengths.values()), Fraction(0))
            lower = max(Fraction(0), Fraction(bounds.lower) - below)
            total, product_ = total + 1 - lower, product_ * lower
            if is_policy or set(path) <= plain:
                most = min(most, Fraction(bounds.upper) + below)
        return max(1 - total, product_ if positive else Fraction(0)) - short, most

    def _for(self, values: Given) -> dict[str, Distribution]:
        return {name: influenced(own, name, values) for name, own in self._distributions.items()}

    def _check(self) -> None:
        raise_if_interrupted()
        self._deadline.enforce()

    def _bounds(self, lower: Fraction | float, upper: Fraction | float) -> Bounds:
        """Bounds without the condition that orders are kept."""
        return Bounds(
            max(Fraction(0), Fraction(lower) - self._unordered), min(Fraction(1), Fraction(upper) + self._unordered)
        )

    def draw(self, count: int) -> packing.LatenessDraws:
        """Random draws, always the same: how often, and along which durations, a schedule is too late."""
        graph, random = self.graph, np.random.default_rng(0)
        change = draw_factors(self._factors, random, count) if self._factors else None
        lengths = {name: drawn(known.distribution, random, count) for name, known in graph.durations.items()}
        for joint in self._joints:
            normals = np.array(root(joint.matrix)) @ random.standard_normal((len(joint.names), count))
            for name, values in zip(joint.names, normals, strict=True):
                lengths[name] = values + float(graph.durations[name].distribution.centre)
        if change is not None:
            lengths = {name: change(name, own) for name, own in lengths.items()}
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
        order, entering, _ = lattice.ordered(edges)
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
        certified = self._certified
        return packing.LatenessDraws(
            count,
            int(successes.sum()),
            float((inside & (late > margin) & (late <= 1 + margin)).mean()),
            tuple(packing.LateShare(name, share, certified.get(name)) for name, share in _greatest(points)),
            tuple(packing.LateShare(name, share, certified.get(name)) for name, share in _greatest(durations)),
            self._gain,
        )

    # -- shares --------------------------------------------------------------------------------------------------------

    def attribute(self, late: packing.LatenessDraws, within: Fraction) -> None:
        """Certify how probably chains to what is most often late in draws are late, and those along durations.

        Also how much more probable success is with a unit of time more. Chains through an edge are a graph of their
        own: what leads to it, the edge, and what follows.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        if self._factors or self._joints:
            return
        close = float(max(within, SHARES))
        graph = self.graph
        more = GivenDurations(self._distributions, self._intervals, replace(graph, latest=graph.latest + 1))
        more.run(lambda: None, False, float(within), self._deadline, work=WORK / 10)
        before, after = self._given.bounds(False), more.bounds(False)
        least, most = after[0] - before[1] - 2 * self._unordered, after[1] - before[0] + 2 * self._unordered
        self._gain = Bounds(max(Fraction(0), least), min(Fraction(1), most))
        names = {share.name for share in (*late.points[:SHOWN], *late.durations[:SHOWN])}
        for edge in graph.edges:
            about = {*edge.names, *((graph.due[edge.source],) if edge.target == SINK else ())} & names
            if about:
                paths = PathBounds(lateness.through(graph.edges, edge), self._given.laws)
                paths.run(close, lambda: None, self._deadline, WORK / 100)
                inside = Fraction(self._given.mass[0], UNIT)
                bounds = max(Fraction(0), 1 - Fraction(paths.upper)) * inside, 1 - Fraction(paths.lower) * inside
                for name in about:
                    known = self._certified.get(name, Bounds(Fraction(0), Fraction(0)))
                    upper = min(Fraction(1), known.upper + bounds[1])
                    self._certified[name] = Bounds(max(known.lower, bounds[0]), upper)


SHOWN = 8
"""Obligations, and durations, of which shares are certified."""
SHARES = Fraction(1, 200)
"""How close bounds of shares are to be."""


def _greatest(shares: Mapping[str, float]) -> list[tuple[str, float]]:
    return [(name, share) for name, share in sorted(shares.items(), key=lambda item: -item[1]) if share]


PATHS = 300
"""Most paths that are looked at one by one."""


def _paths(edges: Sequence[PathEdge]) -> Iterator[tuple[PathEdge, ...]]:
    """All paths from time zero to the deadlines."""
    leaving: dict[Node, list[PathEdge]] = defaultdict(list)
    for edge in edges:
        leaving[edge.source].append(edge)
    waiting: list[tuple[PathEdge, ...]] = [(edge,) for edge in leaving[0]]
    while waiting:
        path = waiting.pop()
        if path[-1].target == SINK:
            yield path
        waiting += [(*path, edge) for edge in leaving[path[-1].target]]


class GivenDurations:
    """Independent durations, for given values of what they share, and how probably all of them are in time.

    Args:
        distributions: of the durations.
        intervals: where each has to be.
        graph: what has to be waited for, if it is known.
    """

    def __init__(
        self,
        distributions: Mapping[str, Distribution],
        intervals: Mapping[str, Interval],
        graph: LatenessGraph | None = None,
    ) -> None:
        self._distributions = distributions
        self.durations = {name: RandomDuration(name, known, intervals[name]) for name, known in distributions.items()}
        self.mass = product_of(known.mass for known in self.durations.values())
        self.graph = graph if graph is None else replace(graph, durations=self.durations)
        self._edges: dict[bool, tuple[tuple[PathEdge, ...], ...]] = {}
        self._paths: dict[tuple[PathEdge, ...], PathBounds] = {}

    @cached_property
    def laws(self) -> ChainLaws:
        """The laws of edges of the graph."""
        return ChainLaws(self.durations, Fraction(0) if self.graph is None else self.graph.latest)

    @property
    def short(self) -> float:
        """How probably some duration is shorter than it may be, at most."""
        return too_short({n: each.interval for n, each in self.durations.items()}, self._distributions)

    @property
    def cells(self) -> int:
        """How many cells were looked at."""
        return sum(paths.cells for paths in self._paths.values())

    def run(
        self, tell: Callable[[], None], is_policy: bool, within: float, deadline: Deadline, *, work: float = WORK
    ) -> None:
        """Bounds of how probably a schedule exists, or of how probably our dispatcher finds one."""
        for edges in self._sides(is_policy):
            if edges not in self._paths and self.graph is not None:
                self._paths[edges] = PathBounds(edges, self.laws)
                self._paths[edges].run(within, tell, deadline, work)
        tell()

    def _sides(self, is_policy: bool) -> tuple[tuple[PathEdge, ...], ...]:
        """The edges that bound the probability from below, and from above."""
        if self.graph is None:
            return ((),)
        if is_policy not in self._edges:
            waits = self.graph.with_waits(free=is_policy)
            self._edges[is_policy] = (waits,) if is_policy else (waits, self.graph.edges)
        return self._edges[is_policy]

    def bounds(self, is_policy: bool) -> tuple[Fraction, Fraction]:
        """What is known of the probability."""
        sides = self._sides(is_policy)
        least, most = (self._paths.get(edges) for edges in (sides[0], sides[-1]))
        return (
            Fraction(0 if least is None else least.lower) * Fraction(self.mass[0], UNIT),
            Fraction(1 if most is None else most.upper) * Fraction(self.mass[1], UNIT),
        )


def _ranging(own: RandomDuration, factors: Sequence[SharedFactor]) -> RandomDuration:
    """A duration with the range that factors give it."""
    if not any(own.name in factor.parameters for factor in factors):
        return own

    def range_of(known: Distribution) -> Interval:
        return RandomDuration("", known.settled, Interval(None, None)).range

    whole = shared_range(factors, range_of(own.distribution), own.name, range_of)
    least, most = whole.lower or Fraction(0), whole.upper or Fraction(0)
    return RandomDuration(own.name, Distribution("uniform", {"lower": least, "upper": most}), own.interval)
