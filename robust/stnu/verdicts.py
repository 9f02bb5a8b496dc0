"""Is a network dynamically controllable, and if not, why not: a witness that a few lines can check.

The witness is a semi-reducible negative cycle of the distance graph (Morris, 2006: *A structural characterization of
temporal dynamic controllability*): its length is negative, and after each lower-case edge comes a piece of negative
length without the upper-case edge of the same contingent link. :func:`refutes` checks one from the bounds of the
network alone; it shares no code with the search that finds it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.network.uncertain import dynamic, explain
from robust.numbers import Number
from robust.presented import Presented, VerdictEnum
from robust.smt.limits import OutOfTimeError
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import Edge, Network, edges_of


class Verdict(VerdictEnum):
    """Whether a dispatcher that sees contingent links end can satisfy all requirements."""

    CONTROLLABLE = "controllable"
    UNCONTROLLABLE = "uncontrollable"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class CheckResult(Presented, ask="verdict"):
    """The verdict about a network; `cycle` is the witness of an uncontrollable one, `reason` the same in words, or why
    there is no verdict.
    """

    network: Network
    verdict: Verdict
    cycle: tuple[Edge, ...]
    reason: str | None
    seconds: float

    @property
    def name(self) -> str:
        """Of the network."""
        return self.network.name

    @property
    def is_controllable(self) -> bool:
        return self.verdict is Verdict.CONTROLLABLE


def check(network: Source, *, timeout: Number | None = None) -> CheckResult:
    """Whether a network is dynamically controllable.

    Reaction at the moment of an observation is allowed; where time must pass, a requirement says so.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Raises:
        InputError: if there is anything wrong in the file.
        RuntimeError: if the witness does not hold, which is an error of the program.
    """
    started = time.perf_counter()
    network = network_of(network)
    try:
        answer = dynamic(network.examined.stnu, deadline(timeout))
    except OutOfTimeError:
        return CheckResult(network, Verdict.UNKNOWN, (), "out of time", time.perf_counter() - started)
    if answer.cycle is None:
        return CheckResult(network, Verdict.CONTROLLABLE, (), None, time.perf_counter() - started)
    cycle = tuple(edges_of(network, answer.cycle.steps))
    if not refutes(network, cycle):
        raise RuntimeError(f"the witness for {network.name} does not hold")
    reason = explain(network.examined.stnu, answer.cycle)
    return CheckResult(network, Verdict.UNCONTROLLABLE, cycle, reason, time.perf_counter() - started)


def refutes(network: Network, cycle: Sequence[Edge]) -> bool:
    """Whether edges are a closed walk through the distance graph of the network that refutes controllability."""
    known = set(_distance_graph(network))
    closed = all(cycle[at - 1].target == edge.source for at, edge in enumerate(cycle))
    if not cycle or not closed or any(_key(edge) not in known for edge in cycle) or _length(cycle) >= (0, 0):
        return False
    return all(_is_followed(cycle, at) for at, edge in enumerate(cycle) if edge.case == "lower")


_Key = tuple[str, str, Fraction | None, str]


def _key(edge: Edge) -> _Key:
    return edge.source, edge.target, edge.value, edge.case


def _is_followed(cycle: Sequence[Edge], at: int) -> bool:
    """Whether a lower-case edge is followed by a negative piece without the upper-case edge of the same link."""
    end, piece = cycle[at].target, []
    for edge in (*cycle[at + 1 :], *cycle[:at]):
        if edge.case == "upper" and edge.source == end:
            return False
        piece.append(edge)
        if _length(piece) < (0, 0):
            return True
    return False


def _length(walk: Sequence[Edge]) -> tuple[int, Fraction]:
    """How often minus infinity occurs, negated, and the sum of the rest."""
    finite = [edge.value for edge in walk if edge.value is not None]
    return len(finite) - len(walk), sum(finite, Fraction(0))


def _distance_graph(network: Network) -> Iterator[_Key]:
    for link in network.links:
        begin, low, high = link.source, link.lower, link.upper
        if link.is_contingent and low is not None:
            if low < 0:
                begin = network.decisions[link.target]
                yield begin, link.source, -low, "ordinary"
                yield link.source, begin, low, "ordinary"
                low, high = Fraction(0), None if high is None else high - low
            yield begin, link.target, low, "lower"
            yield link.target, begin, None if high is None else -high, "upper"
        if high is not None:
            yield begin, link.target, high, "ordinary"
        if low is not None:
            yield link.target, begin, -low, "ordinary"
    if network.origin is not None:
        for node in network.nodes:
            yield node, network.origin, Fraction(0), "ordinary"
