"""Dynamic controllability of networks, with a witness that few lines can check, and their dispatch.

The witness is a semi-reducible negative cycle of the distance graph (Morris, 2006: *A structural characterization of
temporal dynamic controllability*): its length is negative, and after each lower-case edge comes a piece of negative
length without the upper-case edge of the same contingent link. :func:`refutes` checks one from the bounds of the
network alone; it shares no code with the search that finds it.
"""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random

from robust.errors import InputError, RefutedError
from robust.network import dispatchable, uncertain
from robust.numbers import Number
from robust.plan.model import ZERO, TimePoint
from robust.presented import NoTruthValue, Presented, VerdictEnum
from robust.smt.limits import OutOfTimeError
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import Edge, Network, edges_of, instant

_NOTHING = Fraction(0)
GRAIN = 10**6
"""Drawn durations are multiples of this part of a contingent link's width."""
UNBOUNDED = 10
"""Lengths of a link without an upper bound are drawn up to this multiple of its least length plus 1 above it."""


class NetworkVerdict(VerdictEnum):
    """Whether a dispatcher that sees contingent links end can satisfy all requirements."""

    CONTROLLABLE = "controllable"
    UNCONTROLLABLE = "uncontrollable"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class NetworkCheck(Presented, ask="verdict"):
    """The verdict about a network; `cycle` is the witness of an uncontrollable one, `reason` the witness in words, or
    why there is no verdict.
    """

    network: Network
    verdict: NetworkVerdict
    cycle: tuple[Edge, ...]
    reason: str | None
    seconds: float

    @property
    def name(self) -> str:
        """Name of the network."""
        return self.network.name

    @property
    def is_controllable(self) -> bool:
        return self.verdict is NetworkVerdict.CONTROLLABLE


def check(network: Source, *, timeout: Number | None = None) -> NetworkCheck:
    """Whether a network is dynamically controllable.

    Reaction at the moment of an observation is allowed; where time must pass, a requirement says so.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Raises:
        InputError: if there is anything wrong in the file.
        RuntimeError: if the witness does not hold, which is an error of the program.
    """
    return _decided(network_of(network), timeout)[0]


def _decided(network: Network, timeout: Number | None) -> tuple[NetworkCheck, uncertain.DynamicAnswer | None]:
    """The verdict, and the answer with which a controllable network is executed."""
    started = time.perf_counter()
    verdict, cycle, reason = NetworkVerdict.CONTROLLABLE, tuple[Edge, ...](), None
    try:
        answer = uncertain.dynamic(network.examined.stnu, deadline(timeout))
    except OutOfTimeError:
        answer, verdict, reason = None, NetworkVerdict.UNKNOWN, "out of time"
    if answer is not None and answer.cycle is not None:
        verdict, reason = NetworkVerdict.UNCONTROLLABLE, uncertain.explain(network.examined.stnu, answer.cycle)
        cycle = tuple(edges_of(network, answer.cycle.steps))
        if not refutes(network, cycle):
            raise RuntimeError(f"the witness for {network.name} does not hold")
    return NetworkCheck(network, verdict, cycle, reason, time.perf_counter() - started), answer


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
    """The number of infinitely negative edges, negated, and the sum of the others."""
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


# -- dispatch ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Requirement:
    """`target − source ≤ bound`, an ordinary edge of a dispatchable network."""

    source: str
    target: str
    bound: Fraction


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A time point happens: executed by the dispatcher, or observed."""

    time: Fraction
    point: str
    observed: bool


@dataclass(frozen=True, slots=True)
class NetworkExecution(NoTruthValue, ask="violated"):
    """An execution with drawn lengths of contingent links, by their ends; `violated` are requirements."""

    seed: int
    lengths: Mapping[str, Fraction]
    events: tuple[Occurrence, ...]
    violated: tuple[str, ...]


@dataclass(frozen=True)
class DispatchResult(Presented, ask="checked"):
    """A minimal dispatchable network: requirements and waits; empty for a network that is not controllable.

    `derived` is how many ordinary edges follow from the network in all.
    """

    checked: NetworkCheck
    requirements: tuple[Requirement, ...]
    waits: tuple[uncertain.Wait, ...]
    derived: int
    tables: dispatchable.DispatchNetwork[uncertain.UncertainLink[Fraction]] | None
    seconds: float

    @property
    def name(self) -> str:
        """Name of the network."""
        return self.network.name

    @property
    def network(self) -> Network:
        return self.checked.network

    def execute(self, seed: int = 0) -> NetworkExecution:
        """An execution as early as possible; lengths of contingent links are drawn uniformly.

        Raises:
            RefutedError: if the network is not controllable.
        """
        draw = Random(seed)  # noqa: S311 - a simulation
        links = () if self.tables is None else self.tables.natural.values()
        return self.execute_with({link.target: _drawn(draw, link) for link in links}, seed)

    def execute_with(
        self, lengths: Mapping[TimePoint, Fraction] | Mapping[str, Fraction], seed: int = 0
    ) -> NetworkExecution:
        """An execution as early as possible with given lengths of contingent links, by their ends.

        Raises:
            InputError: unless there is a length of each contingent link, and of nothing else.
            RefutedError: if the network is not controllable.
        """
        if self.tables is None:
            raise RefutedError(f"{self.network.name} is not controllable; expected a controllable network")
        lengths = {instant(end) if isinstance(end, str) else end: length for end, length in lengths.items()}
        if lengths.keys() != self.tables.natural.keys():
            given, expected = (", ".join(map(str, ends)) or "none" for ends in (lengths, self.tables.natural))
            raise InputError(f"found lengths of {given}, expected those of the contingent links: {expected}")
        times = dict(run_early(self.tables, lengths))
        order = {point: number for number, point in enumerate(times)}
        events = tuple(
            Occurrence(moment, str(point), point in self.tables.natural)
            for point, moment in sorted(times.items(), key=lambda item: (item[1], order[item[0]]))
            if point != ZERO
        )
        return NetworkExecution(seed, {str(end): size for end, size in lengths.items()}, events, self._violated(times))

    def _violated(self, times: Mapping[TimePoint, Fraction]) -> tuple[str, ...]:
        return tuple(
            str(link)
            for link in self.network.examined.stnu.links
            for length in (times[link.target] - times[link.source],)
            if not link.is_contingent
            and ((link.lower is not None and length < link.lower) or (link.upper is not None and length > link.upper))
        )


def dispatch(network: Source, *, timeout: Number | None = None) -> DispatchResult:
    """The minimal dispatchable form of a network; only the verdict if it is not controllable.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Raises:
        InputError: if there is anything wrong in the file.
    """
    started = time.perf_counter()
    network = network_of(network)
    checked, answer = _decided(network, timeout)
    if answer is None or not checked.is_controllable:
        return DispatchResult(checked, (), (), 0, None, time.perf_counter() - started)
    full = dispatchable.strategy(answer, answer.form.stnu.contingents)
    index = full.index
    natural = [
        edge
        for link in full.natural.values()
        for edge in dispatchable.edges_between(index[link.source], index[link.target], link.lower, link.upper)
    ]
    kept, waits = tuple(dispatchable.minimal_edges(full)), tuple(dispatchable.needed_waits(full))
    tables = dispatchable.DispatchNetwork(
        full.points,
        full.natural.values(),
        [*kept, *natural],
        ((index[wait.point], index[wait.activation], index[wait.end], wait.delay) for wait in waits),
        closed=False,
    )
    requirements = tuple(
        Requirement(str(full.points[a]), str(full.points[b]), weight)
        for a, b, weight in kept
        if (a, b, weight) not in natural and not (full.points[b] == ZERO and weight >= 0)
    )
    derived = sum(map(len, full.above))
    return DispatchResult(checked, requirements, waits, derived, tables, time.perf_counter() - started)


# -- executions --------------------------------------------------------------------------------------------------------


def _drawn(draw: Random, link: uncertain.UncertainLink[Fraction]) -> Fraction:
    low = link.lower or _NOTHING
    width = UNBOUNDED * (low + 1) if link.upper is None else link.upper - low
    return low + width * Fraction(draw.randint(0, GRAIN), GRAIN)


def run_early(
    tables: dispatchable.DispatchNetwork[uncertain.UncertainLink[Fraction]], lengths: Mapping[TimePoint, Fraction]
) -> Iterable[tuple[TimePoint, Fraction]]:
    """The times of time points if all happen as early as they may.

    Raises:
        RuntimeError: if nothing may happen although something has to, which is an error of the network.
    """
    windows = dispatchable.Windows(tables)
    waiting = {point for point in tables.points if point not in tables.natural}
    now = _NOTHING
    coming: dict[TimePoint, Fraction] = {}

    def happen(point: TimePoint) -> tuple[TimePoint, Fraction]:
        windows.happened(tables.index[point], now)
        for link in tables.natural.values():
            if link.source == point:
                coming[link.target] = now + lengths[link.target]
        return point, now

    waiting.discard(ZERO)
    yield happen(ZERO)
    while waiting or coming:
        ended = next((point for point, moment in sorted(coming.items()) if moment == now), None)
        if ended is not None:
            del coming[ended]
            yield happen(ended)
            continue
        ready = {point: windows.ready(tables.index[point]) for point in waiting}
        chosen = next((point for point in sorted(waiting) if (at := ready[point]) is not None and at <= now), None)
        if chosen is not None:
            waiting.discard(chosen)
            yield happen(chosen)
            continue
        moments = [moment for moment in (*ready.values(), *coming.values()) if moment is not None]
        if not moments:
            raise RuntimeError(f"nothing may happen, but {', '.join(sorted(map(str, waiting)))} have to")
        now = min(moments)
