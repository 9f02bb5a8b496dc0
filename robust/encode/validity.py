"""enc_valid: for which parameter values some schedule exists [IRR §4, Algorithm 1 line 1], exactly and lazily.

The network has a schedule if and only if no cycle of its lower bounds has a positive sum; each cycle is one linear
inequality over the parameters, a facet. There can be exponentially many, so only those are produced that a box breaks.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.network import TemporalNetwork
from robust.encode.variables import (
    Auxiliary,
    Linear,
    Range,
    TimeVariable,
    constant,
    is_over_parameters,
    least,
    parameters_in,
    variable,
)
from robust.plan.model import ParameterReference
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class Facet:
    """`expression ≥ 0` over parameters, necessary for a schedule, with the statements whose sum it is."""

    expression: Linear
    origins: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Edge:
    """`slack = t_target − t_source − weight ≥ 0` between time variables; None is the zero point."""

    source: TimeVariable | None
    target: TimeVariable | None
    weight: Linear
    origin: str


class Validity:
    """Decides boxes against enc_valid; facets found are kept and tried first."""

    def __init__(self, network: TemporalNetwork, terms: Terms) -> None:
        self._terms = terms
        self.facets: list[Facet] = []
        self._edges: list[_Edge] = []
        for inequality in network.inequalities:
            if is_over_parameters([inequality.expression]):
                self.facets.append(Facet(inequality.expression, (inequality.origin,)))
            else:
                self._edges.append(_edge(inequality.expression, inequality.origin))
        self._flows = [variable(Auxiliary("flow", index)) for index in range(len(self._edges))]

    def broken_facet(
        self, ranges: Mapping[str, Range], make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Verdict | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time.

        `ranges` is the box; `make_session` opens a solver session over the same terms, only if it comes to that.
        """
        for facet in self.facets:
            if _breaks(facet, ranges):
                return facet
        while self._may_have_broken_cycle(ranges):
            session = make_session()
            session.add(self._circulation(ranges))
            verdict = session.check("enc_valid: a cycle that the box breaks", deadline)
            if verdict is Verdict.UNKNOWN:
                return verdict
            if verdict is Verdict.UNSATISFIABLE:
                return None
            values = session.values([self._terms.real(_only(flow)) for flow in self._flows])
            flows = [Fraction(values.get(str(_only(flow)), 0)) for flow in self._flows]
            found = [facet for facet in self._cycles(flows) if _breaks(facet, ranges)]
            self.facets += found
            return found[0]
        return None

    # -- a quick sufficient test -----------------------------------------------------------------------------------

    def _may_have_broken_cycle(self, ranges: Mapping[str, Range]) -> bool:
        """False only if the network has a schedule even when every bound is at its worst independently.

        Longest paths from a virtual source: if they settle within as many rounds as there are nodes, no cycle is
        positive. An unbounded weight counts only if its edge lies on a cycle.
        """
        worst: list[tuple[_Edge, Fraction]] = []
        for edge in self._edges:
            floor = least(-edge.weight, ranges)
            if floor is not None:
                worst.append((edge, -floor))
            elif self._reaches(edge.target, edge.source):
                return True
        nodes = {node for edge in self._edges for node in (edge.source, edge.target)}
        distance = dict.fromkeys(nodes, Fraction(0))
        for _ in range(len(nodes) + 1):
            changed = False
            for edge, weight in worst:
                reached = distance[edge.source] + weight
                if reached > distance[edge.target]:
                    distance[edge.target] = reached
                    changed = True
            if not changed:
                return False
        return True

    def _reaches(self, start: TimeVariable | None, goal: TimeVariable | None) -> bool:
        successors: dict[TimeVariable | None, list[TimeVariable | None]] = defaultdict(list)
        for edge in self._edges:
            successors[edge.source].append(edge.target)
        seen, queue = {start}, [start]
        for node in queue:
            new = [target for target in successors[node] if target not in seen]
            seen.update(new)
            queue += new
        return goal in seen

    # -- the exact test --------------------------------------------------------------------------------------------

    def _circulation(self, ranges: Mapping[str, Range]) -> Formula:
        """A non-negative circulation over the edges whose slack is negative at the worst point of the box.

        By Farkas' lemma one exists if and only if some point of the box has no schedule. The slack of a circulation is
        linear in each parameter, so its worst point is known from the signs of its coefficients.
        """
        terms = self._terms
        total, coefficients = constant(0), defaultdict[str, Linear](lambda: constant(0))
        balance: dict[TimeVariable | None, Linear] = defaultdict(lambda: constant(0))
        for edge, flow in zip(self._edges, self._flows, strict=True):
            balance[edge.source] += flow
            balance[edge.target] -= flow
            total -= flow.scaled(edge.weight.constant_term)
            for unknown, factor in edge.weight.coefficients():
                if isinstance(unknown, ParameterReference):
                    coefficients[unknown.name] -= flow.scaled(factor)
        conditions = [terms.at_least(flow) for flow in self._flows]
        conditions += [terms.equal(node) for node in balance.values()]
        escapes = []
        for index, (name, slope) in enumerate(sorted(coefficients.items(), key=lambda item: item[0])):
            low, high = ranges.get(name, (None, None))
            worst = variable(Auxiliary("worst", index))
            for side, extreme in ((terms.at_least(slope), low), (terms.at_least(-slope), high)):
                contribution = constant(0) if extreme is None else slope.scaled(extreme)
                conditions.append(terms.implication(side, terms.at_least(worst - contribution)))
            if low is None:
                escapes.append(terms.greater(slope))
            if high is None:
                escapes.append(terms.greater(-slope))
            total += worst
        return terms.conjunction((*conditions, terms.disjunction((*escapes, terms.greater(-total)))))

    def _cycles(self, flows: list[Fraction]) -> Iterator[Facet]:
        """Split a circulation into simple cycles."""
        remaining = dict(enumerate(flows))
        while True:
            outgoing = {self._edges[index].source: index for index, flow in remaining.items() if flow > 0}
            if not outgoing:
                return
            path: list[int] = []
            node = next(iter(outgoing))
            visited: dict[TimeVariable | None, int] = {}
            while node not in visited:
                visited[node] = len(path)
                path.append(outgoing[node])
                node = self._edges[outgoing[node]].target
            cycle = path[visited[node] :]
            amount = min(remaining[index] for index in cycle)
            for index in cycle:
                remaining[index] -= amount
            weights = [self._edges[index].weight for index in cycle]
            origins = tuple(dict.fromkeys(self._edges[index].origin for index in cycle))
            yield Facet(-sum(weights, constant(0)), origins)


def _edge(expression: Linear, origin: str) -> _Edge:
    source: TimeVariable | None = None
    target: TimeVariable | None = None
    weight = constant(-expression.constant_term)
    for unknown, factor in expression.coefficients():
        match unknown:
            case TimeVariable():
                source, target = (unknown, target) if factor < 0 else (source, unknown)
            case ParameterReference() | Auxiliary():
                weight -= variable(unknown).scaled(factor)
    return _Edge(source, target, weight, origin)


def _breaks(facet: Facet, ranges: Mapping[str, Range]) -> bool:
    floor = least(facet.expression, ranges)
    return floor is None or floor < 0


def _only(expression: Linear) -> Auxiliary:
    (unknown,) = expression.variables
    if not isinstance(unknown, Auxiliary):
        raise TypeError(f"expected an auxiliary, found {unknown}")
    return unknown


def facet_parameters(facet: Facet) -> frozenset[str]:
    """The parameters that a facet restricts."""
    return parameters_in(facet.expression)
