"""enc_valid of the positions encoding: ∃t. enc_tn by elimination of the times, one after the other [IRR §4, line 1].

Fourier–Motzkin elimination of a variable of a difference network joins every lower bound with every upper bound, which
are edges of a graph: `t_target − t_source ≥ weight`, weight over parameters. Between two nodes there may be many
weights; those that never matter within the box in question are redundant. What remains on loops are the facets.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from robust.encode.interface import Facet
from robust.encode.network import Difference, TemporalNetwork
from robust.encode.variables import Grid, is_over_parameters, least, variable
from robust.plan.model import ZERO, ParameterReference, TimePoint
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms

CROWDED = 6
"""With more weights than this between two nodes a solver is asked which of them are redundant."""


class Projection:
    """Decides boxes against enc_valid by elimination within the box; facets found are kept and tried first."""

    def __init__(self, network: TemporalNetwork, terms: Terms) -> None:
        self._terms = terms
        self._edges: list[Difference] = []
        self.facets: list[Facet] = []
        for inequality in network.inequalities:
            if is_over_parameters(inequality.expression):
                self.facets.append(Facet(inequality.expression, inequality.origins))
            else:
                self._edges.append(inequality.as_difference())

    def broken_facet(
        self, box: Grid, make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Verdict | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time.

        `make_session` opens a solver session over the same terms, only if it comes to that.
        """
        if (known := self.known_facet(box)) is not None:
            return known
        try:
            broken = _Elimination(self._edges, box, self._terms, make_session, deadline).broken_loop()
        except OutOfTimeError:
            return Verdict.UNKNOWN
        if broken is not None:
            self.facets.append(broken)
        return broken

    def known_facet(self, box: Grid) -> Facet | None:
        """A facet that some point of the box breaks, of those that a search has met."""
        return next((facet for facet in self.facets if facet.breaks_in(box)), None)

    def contradiction(self, values: Mapping[str, Fraction]) -> Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""
        ranges = {name: (value, value) for name, value in values.items()}
        found = self.broken_facet(Grid(ranges), lambda: Session(self._terms), NEVER)
        return found if isinstance(found, Facet) else None


class _Elimination:
    """One elimination of all time variables; redundancy is judged within the box only."""

    def __init__(
        self,
        edges: list[Difference],
        box: Grid,
        terms: Terms,
        make_session: Callable[[], Session],
        deadline: Deadline,
    ) -> None:
        self._box = box
        self._terms = terms
        self._make_session = make_session
        self._deadline = deadline
        self._session: Session | None = None
        self._outgoing: dict[TimePoint, dict[TimePoint, list[Difference]]] = defaultdict(dict)
        self._incoming: dict[TimePoint, set[TimePoint]] = defaultdict(set)
        self._broken: Facet | None = None
        for edge in edges:
            self._join(edge.source, edge.target, [edge])

    def broken_loop(self) -> Facet | None:
        """The first facet that breaks in the box.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        waiting = {node for node in (*self._outgoing, *self._incoming) if node != ZERO}
        while waiting and self._broken is None:
            # The variable with the fewest joins; by name among equals, so that runs repeat.
            node = min(waiting, key=lambda n: (len(self._outgoing[n]) * len(self._incoming[n]), n))
            waiting.remove(node)
            self._eliminate(node)
        return self._broken

    def _eliminate(self, node: TimePoint) -> None:
        after = self._outgoing.pop(node)
        before = {source: self._outgoing[source].pop(node) for source in self._incoming.pop(node)}
        for target in after:
            self._incoming[target].discard(node)
        for source, firsts in before.items():
            for target, seconds in after.items():
                self._join(source, target, list(self._sums(firsts, seconds)))
                if self._broken is not None:
                    return

    def _sums(self, firsts: list[Difference], seconds: list[Difference]) -> Iterator[Difference]:
        for first in firsts:
            self._deadline.enforce()
            for second in seconds:
                origins = tuple(dict.fromkeys((*first.origins, *second.origins)))
                yield Difference(first.source, second.target, first.weight + second.weight, origins)

    def _join(self, source: TimePoint, target: TimePoint, edges: list[Difference]) -> None:
        if source == target:
            facets = (Facet(-edge.weight, edge.origins) for edge in edges)
            self._broken = self._broken or next((facet for facet in facets if facet.breaks_in(self._box)), None)
            return
        known = self._outgoing[source].setdefault(target, [])
        self._incoming[target].add(source)
        for edge in edges:
            self._deadline.enforce()
            if not any(self._is_covered(edge, by) for by in known):
                known[:] = [*(other for other in known if not self._is_covered(other, edge)), edge]
        if len(known) > CROWDED:
            self._outgoing[source][target] = list(self._without_redundant(known))

    def _is_covered(self, edge: Difference, by: Difference) -> bool:
        """Whether the weight of `by` is at least as great all over the box."""
        margin = least(by.weight - edge.weight, self._box.ranges)
        return margin is not None and margin >= 0

    def _without_redundant(self, edges: list[Difference]) -> Iterator[Difference]:
        """Leave out every edge whose weight nowhere in the box exceeds all the others that are left."""
        session = self._session = self._session or self._open_session()
        left = list(edges)
        for edge in edges:
            others = [other for other in left if other is not edge]
            with session.frame(*(self._terms.greater(edge.weight - other.weight) for other in others)):
                verdict = session.check("enc_valid: a redundant bound", self._deadline)
            if verdict is Verdict.UNKNOWN:
                raise OutOfTimeError
            if verdict is Verdict.UNSATISFIABLE:
                left = others
            else:
                yield edge

    def _open_session(self) -> Session:
        session = self._make_session()
        for name, (low, high) in self._box.ranges.items():
            value = variable(ParameterReference(name))
            if low is not None:
                session.add(self._terms.at_least(value - low))
            if high is not None:
                session.add(self._terms.at_least(-value + high))
        return session
