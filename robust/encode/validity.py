"""enc_valid: for which parameter values some schedule exists [IRR §4, Algorithm 1 line 1], exactly and lazily.

The network has a schedule if and only if no cycle of its lower bounds has a positive sum; each cycle is one linear
inequality over the parameters, a facet. There can be exponentially many, so only those are produced that a box breaks.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import cached_property

from robust.encode.cycles import Edge, Node, edge, facet_of, simple_cycles, suspicious_cycle, without_implied
from robust.encode.durations import DurationRule
from robust.encode.interface import Facet
from robust.encode.network import Difference, TemporalNetwork
from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, is_over_parameters, variable
from robust.plan.model import ZERO, ParameterReference, TimePoint
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms


class Validity:
    """Decides boxes against enc_valid; facets found are kept and tried first.

    Duration obligations over parameters alone are facets as well: they are necessary for membership in the envelope,
    and what they say makes most of the network's edges redundant.
    """

    def __init__(self, network: TemporalNetwork, rules: Iterable[DurationRule], terms: Terms) -> None:
        self._network = network
        self._terms = terms
        self._facts: list[Difference] = []
        self.facets: list[Facet] = [
            Facet(inequality.expression, (inequality.origin,))
            for inequality in network.inequalities
            if is_over_parameters([inequality.expression])
        ]
        for rule in rules:
            for bound in rule.bounds:
                expression = network.distance(bound)
                if is_over_parameters([expression]):
                    self._facts.append(bound)
                    if not (expression.is_constant and expression.constant_term >= 0):
                        self.facets.append(Facet(expression, (rule.name,), rule.name))

    def broken_facet(
        self, ranges: Mapping[str, Range], make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Verdict | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time.

        `ranges` is the box; `make_session` opens a solver session over the same terms, only if it comes to that.
        """
        for facet in self.facets:
            if facet.breaks_in(ranges):
                return facet
        cycle = suspicious_cycle(self._edges, ranges)
        if cycle is None:
            return None
        facet = facet_of(cycle)
        if facet.breaks_in(ranges):
            self.facets.append(facet)
            return facet
        return self._broken_by_some_circulation(ranges, make_session(), deadline)

    def contradiction(self, values: Mapping[str, Fraction]) -> Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""
        ranges: dict[str, Range] = {name: (value, value) for name, value in values.items()}
        for bound in self._network.bounds_of_parameters():
            facet = Facet(bound.expression, (bound.origin,))
            if facet.breaks_in(ranges):
                return facet
        # All time points, also those that equalities tie together: the equalities may be what contradicts.
        edges = [Edge(_node(d.source), _node(d.target), d.weight, d.origin) for d in self._network.differences]
        cycle = suspicious_cycle(edges, ranges)
        return None if cycle is None else facet_of(cycle)

    @cached_property
    def _edges(self) -> list[Edge]:
        """The network between free time points, without what the rest and the facts imply."""
        network = self._network
        weights = {d: network.surely_at_least(d.weight) for d in (*network.differences, *self._facts)}
        kept = without_implied(network.differences, self._facts, weights)
        expressions = {network.distance(difference): difference.origin for difference in kept}
        return [edge(e, origin) for e, origin in expressions.items() if not is_over_parameters([e])]

    def _broken_by_some_circulation(
        self, ranges: Mapping[str, Range], session: Session, deadline: Deadline
    ) -> Facet | Verdict | None:
        flows = [variable(Auxiliary("flow", index)) for index in range(len(self._edges))]
        symbols = [self._terms.real(Auxiliary("flow", index)) for index in range(len(self._edges))]
        session.add(self._circulation(flows, ranges))
        verdict = session.check("enc_valid: a cycle that the box breaks", deadline)
        if verdict is Verdict.UNSATISFIABLE:
            return None
        if verdict is Verdict.UNKNOWN:
            return verdict
        values = session.values(symbols)
        amounts = [Fraction(values.get(symbol.symbol_name(), 0)) for symbol in symbols]
        # The circulation breaks at some point of the box, so one of the cycles that it consists of does.
        cycles = map(facet_of, simple_cycles(self._edges, amounts))
        broken = [facet for facet in cycles if facet.breaks_in(ranges)]
        self.facets += broken
        return broken[0]

    def _circulation(self, flows: list[Linear], ranges: Mapping[str, Range]) -> Formula:
        """A non-negative circulation over the edges whose sum of slacks is negative at the worst point of the box.

        By Farkas' lemma one exists if and only if some point of the box has no schedule. The sum is linear in each
        parameter, so its worst point is known from the signs of its coefficients.
        """
        terms = self._terms
        slack, balance = constant(0), defaultdict[Node, Linear](lambda: constant(0))
        slopes = defaultdict[str, Linear](lambda: constant(0))
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
            worst = variable(Auxiliary("worst", index))
            slack += worst
            for side, extreme in zip((slope, -slope), ranges.get(name, (None, None)), strict=True):
                if extreme is None:
                    escapes.append(terms.greater(side))
                share = worst if extreme is None else worst - slope.scaled(extreme)
                conditions.append(terms.implication(terms.at_least(side), terms.at_least(share)))
        return terms.conjunction((*conditions, terms.disjunction((*escapes, terms.greater(-slack)))))


def _node(point: TimePoint) -> Node:
    return None if point == ZERO else TimeVariable(point)
