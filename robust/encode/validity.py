"""enc_valid of the relational encoding: for which parameter values some schedule exists.

The network is a graph of lower bounds, and every cycle must sum to at most zero if a schedule is to exist.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from math import lcm

from robust.encode import interface
from robust.encode.network import Difference, DurationRule, TemporalNetwork, is_never_negative
from robust.network.differences import Cycle, delay, forward_only
from robust.plan.model import ZERO, ParameterReference, TimePoint
from robust.smt.limits import Deadline
from robust.smt.session import Formula, Satisfiability, Session, Terms

BRANCHES = 128
"""Sets of cycles that are looked at one by one before a solver is asked."""


def facet_of(cycle: Iterable[Difference]) -> interface.Facet:
    """The inequality that a cycle stands for, with what it says in the order of time from zero on."""
    following = {edge.source: edge for edge in cycle}
    place = ZERO if ZERO in following else next(iter(following))
    edges = []
    for _ in following:
        edges.append(following[place])
        place = edges[-1].target
    origins = dict.fromkeys(origin for edge in edges for origin in edge.origins)
    return interface.Facet(-sum((edge.weight for edge in edges), interface.constant(0)), tuple(origins))


class Cycles:
    """The cycles of a network whose weights depend on parameters, in integers."""

    def __init__(self, edges: Sequence[Difference], *, forward: bool = False) -> None:
        nodes = dict.fromkeys(node for edge in edges for node in (edge.source, edge.target))
        index = {node: number for number, node in enumerate(nodes)}
        ends = [(index[edge.source], index[edge.target]) for edge in edges]
        if forward:
            signs = [_signed(edge) for edge in edges]
            marked = [(*pair, sign and sign[0]) for pair, sign in zip(ends, signs, strict=True)]
            ways = list(forward_only(len(nodes), marked))
            edges = [edges[number] for _, _, number in ways]
            ends = [(source, target) for source, target, _ in ways]
        self._edges = edges
        self._ends = ends
        scale = lcm(*(factor.denominator for edge in edges for factor in edge.weight.terms.values()))
        self._slopes = [interface.IntegerForm(-edge.weight, scale) for edge in edges]
        self._times = [0] * (max(map(max, ends), default=-1) + 1)
        """Of the last proof; with these the next one begins."""
        self._unit = 1

    def suspicious(
        self, grid: interface.Grid, without: frozenset[tuple[str, int]] = frozenset()
    ) -> list[Difference] | None:
        """A cycle with a positive sum when every edge has its worst weight in the box; None if there is none.

        Edges that are a parameter of this name and sign, and some number, may be left out.

        None proves that every point of the box has a schedule. A cycle need not be positive at any single point, since
        its edges may be at their worst at different ones.
        """
        worst: list[tuple[int, int]] = []
        for number, slope in enumerate(self._slopes):
            if without and self._signs[number] in without:
                continue
            floor = slope.least(grid) if slope.factors else slope.constant * grid.unit
            if floor is not None:
                worst.append((number, -floor))
            else:
                edge = self._edges[number]
                back = self._path(self._ends[number][1], self._ends[number][0])
                if back is not None:
                    return [edge, *back]
        cycle = self._contradiction(worst, grid.unit)
        return None if cycle is None else [self._edges[number] for number in cycle.origins]

    @cached_property
    def _signs(self) -> list[tuple[str, int] | None]:
        return [_signed(edge) for edge in self._edges]

    def _contradiction(self, worst: Sequence[tuple[int, int]], unit: int) -> Cycle | None:
        """A cycle of edges with these weights; None, and the times of a schedule are remembered, if there is none."""
        times = self._times
        if unit != self._unit:
            # Whatever times a search begins with, it ends with a schedule if there is one.
            times = [time * unit // self._unit for time in times]
        late = []
        following: list[list[tuple[int, int, int]]] = [[] for _ in times]
        for number, weight in worst:
            source, target = self._ends[number]
            following[source].append((target, weight, number))
            if times[target] < times[source] + weight:
                late.append(source)
        if late:
            times = list(times)
            cycle = delay(times, following, dict.fromkeys(late))
            if cycle is not None:
                return cycle
        self._times, self._unit = times, unit
        return None

    def _path(self, start: int, goal: int) -> list[Difference] | None:
        """Edges from `start` to `goal`, breadth first; empty if they are the same."""
        outgoing: dict[int, list[int]] = defaultdict(list)
        for number, (source, _) in enumerate(self._ends):
            outgoing[source].append(number)
        arrival: dict[int, int | None] = {start: None}
        queue = [start]
        for node in queue:
            for number in outgoing[node]:
                target = self._ends[number][1]
                if target not in arrival:
                    arrival[target] = number
                    queue.append(target)
        if goal not in arrival:
            return None
        path = []
        while (step := arrival[goal]) is not None:
            path.append(self._edges[step])
            goal = self._ends[step][0]
        return path


def _signed(edge: Difference) -> tuple[str, int] | None:
    """The only parameter of a bound, and whether it is added or taken away."""
    uses = list(edge.weight.coefficients())
    return (str(uses[0][0]), 1 if uses[0][1] > 0 else -1) if len(uses) == 1 else None


def simple_cycles(edges: Sequence[Difference], flows: Sequence[Fraction]) -> Iterator[list[Difference]]:
    """Split a circulation into simple cycles."""
    remaining = dict(enumerate(flows))
    while outgoing := {edges[index].source: index for index, flow in remaining.items() if flow > 0}:
        path: list[int] = []
        visited: dict[TimePoint, int] = {}
        node = next(iter(outgoing))
        while node not in visited:
            visited[node] = len(path)
            path.append(outgoing[node])
            node = edges[outgoing[node]].target
        cycle = path[visited[node] :]
        amount = min(remaining[index] for index in cycle)
        for index in cycle:
            remaining[index] -= amount
        yield [edges[index] for index in cycle]


class Validity:
    """Decides boxes against enc_valid; facets found are kept and tried first.

    Duration obligations over parameters alone are facets as well: they are necessary for membership in the envelope.
    """

    def __init__(self, network: TemporalNetwork, rules: Iterable[DurationRule], terms: Terms) -> None:
        self._network = network
        self._terms = terms
        self.facets: list[interface.Facet] = [
            interface.Facet(inequality.expression, inequality.origins)
            for inequality in network.inequalities
            if interface.is_over_parameters(inequality.expression)
        ]
        for rule in rules:
            for bound in rule.bounds:
                expression = network.slack(bound)
                if interface.is_over_parameters(expression) and not is_never_negative(expression):
                    self.facets.append(interface.Facet(expression, (rule.name,), rule.name))

    def broken_facet(
        self, box: interface.Grid, make_session: Callable[[], Session], deadline: Deadline
    ) -> interface.Facet | Satisfiability | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time.

        `make_session` opens a solver session over the same terms, only if it comes to that.
        """
        for facet in self.facets:
            if facet.breaks_in(box):
                return facet
        cycle = self._cycles.suspicious(box)
        if cycle is None:
            return None
        facet = facet_of(cycle)
        if facet.breaks_in(box):
            self.facets.append(facet)
            return facet
        if self._has_no_simple_cycle(box):
            return None
        return self._broken_by_some_circulation(box, make_session(), deadline)

    def known_facet(self, box: interface.Grid) -> interface.Facet | None:
        """A facet of the network alone that some point of the box breaks, of those that a search has met."""
        return next((facet for facet in self.facets if facet.obligation is None and facet.breaks_in(box)), None)

    def contradiction(self, values: Mapping[str, Fraction]) -> interface.Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""
        grid = interface.Grid({name: (value, value) for name, value in values.items()})
        for bound in self._network.bounds_of_parameters():
            facet = interface.Facet(bound.expression, bound.origins)
            if facet.breaks_in(grid):
                return facet
        cycle = self._all_cycles.suspicious(grid)
        return None if cycle is None else facet_of(cycle)

    @cached_property
    def _all_cycles(self) -> Cycles:
        """Over all time points, also those that equalities tie together: the equalities may be what contradicts."""
        return Cycles(self._network.differences)

    @cached_property
    def _edges(self) -> list[Difference]:
        """The network between free time points."""
        inequalities = self._network.inequalities
        return [
            inequality.as_difference()
            for inequality in inequalities
            if not interface.is_over_parameters(inequality.expression)
        ]

    @cached_property
    def _cycles(self) -> Cycles:
        return Cycles(self._edges)

    def _has_no_simple_cycle(self, box: interface.Grid) -> bool:
        """Whether no simple cycle is suspicious: none leads both ways along a distance, so these are told apart."""
        branches: list[frozenset[tuple[str, int]]] = [frozenset()]
        for branch in branches:
            cycle = self._forward_cycles.suspicious(box, branch)
            if cycle is not None:
                signs = {_signed(edge) for edge in cycle} - {None}
                name = next((sign[0] for sign in signs if sign and (sign[0], -sign[1]) in signs), None)
                if name is None or len(branches) > BRANCHES:
                    return False
                branches += [branch | {(name, sign)} for sign in (1, -1)]
        return True

    @cached_property
    def _forward_cycles(self) -> Cycles:
        """The cycles of all time points that turn back on no distance: no simple cycle does."""
        return Cycles(self._network.differences, forward=True)

    def _broken_by_some_circulation(
        self, box: interface.Grid, session: Session, deadline: Deadline
    ) -> interface.Facet | Satisfiability | None:
        flows = [interface.variable(interface.Auxiliary("flow", index)) for index in range(len(self._edges))]
        symbols = [self._terms.real(interface.Auxiliary("flow", index)) for index in range(len(self._edges))]
        session.add(self._circulation(flows, box.ranges))
        verdict = session.check("enc_valid: a cycle that the box breaks", deadline)
        if verdict is Satisfiability.UNSATISFIABLE:
            return None
        if verdict is Satisfiability.UNKNOWN:
            return verdict
        values = session.values(symbols)
        amounts = [Fraction(values.get(symbol.symbol_name(), 0)) for symbol in symbols]
        # The circulation breaks at some point of the box, so one of the cycles that it consists of does.
        cycles = map(facet_of, simple_cycles(self._edges, amounts))
        broken = [facet for facet in cycles if facet.breaks_in(box)]
        self.facets += broken
        return broken[0]

    def _circulation(self, flows: list[interface.Linear], ranges: Mapping[str, interface.Range]) -> Formula:
        """A non-negative circulation over the edges whose sum of slacks is negative at the worst point of the box.

        By Farkas' lemma one exists if and only if some point of the box has no schedule. The sum is linear in each
        parameter, so its worst point is known from the signs of its coefficients.
        """
        terms = self._terms
        slack, balance = interface.constant(0), defaultdict[TimePoint, interface.Linear](lambda: interface.constant(0))
        slopes = defaultdict[str, interface.Linear](lambda: interface.constant(0))
        for candidate, flow in zip(self._edges, flows, strict=True):
            balance[candidate.source] += flow
            balance[candidate.target] -= flow
            slack -= flow.scaled(candidate.weight.constant_term)
            for unknown, factor in candidate.weight.coefficients():
                if isinstance(unknown, ParameterReference):
                    slopes[unknown.name] -= flow.scaled(factor)
        conditions = [*map(terms.at_least, flows), *map(terms.equal, balance.values())]
        escapes = []
        for index, (name, slope) in enumerate(sorted(slopes.items(), key=lambda item: item[0])):
            worst = interface.variable(interface.Auxiliary("worst", index))
            slack += worst
            for side, extreme in zip((slope, -slope), ranges.get(name, (None, None)), strict=True):
                if extreme is None:
                    escapes.append(terms.greater(side))
                share = worst if extreme is None else worst - slope.scaled(extreme)
                conditions.append(terms.implication(terms.at_least(side), terms.at_least(share)))
        return terms.conjunction((*conditions, terms.disjunction((*escapes, terms.greater(-slack)))))
