"""Dynamic controllability of networks, with a witness that few lines can check; their dispatch; their repair.

The witness is a semi-reducible negative cycle of the distance graph (Morris, 2006: *A structural characterization of
temporal dynamic controllability*): its length is negative, and after each lower-case edge comes a piece of negative
length without the upper-case edge of the same contingent link. :func:`refutes` checks one from the bounds of the
network alone; it shares no code with the search that finds it.

A repair is the least change of bounds after which a network is dynamically controllable. Requirements are relaxed, a
lower bound down or an upper bound up; contingent links are tightened, a lower bound up or an upper bound down. Each
unit of a change costs the weight of its link. The search follows conflicts (Yu, Fang and Williams, 2014: *Resolving
uncontrollable conditional temporal problems using continuous relaxations*): a network with a witness is not
controllable as long as the whole walk and the pieces after its lower-case edges are negative; each length is linear in
the changes, so in every repair one of them is at least 0. That is a clause for :mod:`robust.irr.conflicts`, which finds
the cheapest changes.
"""

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf
from random import Random
from typing import Any

from robust import errors, searching
from robust.errors import InputError, RefutedError
from robust.irr.conflicts import Candidate, Clause, Point, RepairStatus, WeightedRepairSearching
from robust.network import dispatchable, uncertain
from robust.network.uncertain import EdgeStep, NegativeCycle, Way, dynamic, explain
from robust.numbers import Number, exact, format_number
from robust.plan.model import ZERO, TimePoint
from robust.presented import NoTruthValue, Presented, VerdictEnum
from robust.qe import constraint
from robust.qe.box import Side
from robust.smt import limits
from robust.smt.limits import OutOfTimeError
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import ConditionalNetwork, Edge, Link, Network, Role, edges_of, instant

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

    network: Network | ConditionalNetwork
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
        """Whether it is known to be dynamically controllable [Morris 2014]."""
        return self.verdict is NetworkVerdict.CONTROLLABLE


def check(network: Source, *, timeout: Number | None = None) -> NetworkCheck:
    """Whether a network is dynamically controllable, by backward propagation from negative nodes (Morris, 2014).

    Reaction at the moment of an observation is allowed; where time must pass, a requirement says so.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Returns:
        CONTROLLABLE, UNCONTROLLABLE with a closed walk that refutes it, or UNKNOWN.

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
    """Whether edges are a closed walk through the distance graph of the network that refutes controllability.

    Args:
        network: the network.
        cycle: the edges of a `CheckResult`, or anybody's.

    Returns:
        True if the walk is semi-reducible and its length is negative (Morris, 2014).
    """
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
    """An execution with drawn lengths of contingent links, by their ends; `violated` are requirements.

    Lengths and times are in the unit of the network.
    """

    seed: int
    lengths: Mapping[str, Fraction]
    events: tuple[Occurrence, ...]
    violated: tuple[str, ...]


@dataclass(frozen=True)
class DispatchResult(Presented, ask="checked"):
    """A minimal dispatchable network: requirements and waits, in its unit; empty for one that is not controllable.

    `derived` is how many ordinary edges follow from the network in all.
    """

    network: Network
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
    """The minimal dispatchable form of a network (Morris, 2014); only the verdict if it is not controllable.

    Args:
        network: a network, or the path of one.
        timeout: seconds after which the verdict is UNKNOWN.

    Returns:
        Edges and waits that a dispatcher needs, in the unit of time of the network.

    Raises:
        InputError: if there is anything wrong in the file.
    """
    started = time.perf_counter()
    network = network_of(network)
    checked, answer = _decided(network, timeout)
    if answer is None or not checked.is_controllable:
        return DispatchResult(network, checked, (), (), 0, None, time.perf_counter() - started)
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
    return DispatchResult(network, checked, requirements, waits, derived, tables, time.perf_counter() - started)


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


Bound = tuple[int, Side]
"""A bound of a link, by its number."""
Form = Mapping[Bound, int]
"""A length as a sum of multiples of bounds."""


@dataclass(frozen=True, slots=True)
class LinkChange:
    """One bound of a link moves by `amount`; `serves` are the conflicts that make it necessary, in words."""

    link: Link
    side: Side
    new: Fraction
    amount: Fraction
    cost: Fraction
    serves: tuple[str, ...]

    @property
    def old(self) -> Fraction:
        """The bound before."""
        return self.link.bound(self.side) or _NOTHING

    def __str__(self) -> str:
        return f"{self.link.ends}: {self.side.value} bound {format_number(self.old)} to {format_number(self.new)}"


@dataclass(frozen=True)
class NetworkRepair(Presented, ask="status"):
    """The result of a search: `network` is the repaired one, None if there is none; no repair costs less than `bound`.

    `conflicts` and `candidates` are how many were met and examined; `name` is that of the network.
    """

    status: RepairStatus
    network: Network | None
    changes: tuple[LinkChange, ...]
    bound: Fraction
    conflicts: int
    candidates: int
    seconds: float
    interrupted: bool = False
    name: str = ""

    @property
    def cost(self) -> Fraction | None:
        """The sum of all changes, each times its weight."""
        return None if self.network is None else sum((change.cost for change in self.changes), _NOTHING)

    @property
    def gap(self) -> Fraction | None:
        """The greatest possible saving of another repair."""
        return None if self.cost is None else self.cost - self.bound

    @property
    def cut_short(self) -> bool:
        """Whether the search ended before it had an answer."""
        return self.status.is_open


def repair(
    network: Source,
    *,
    requirement: Number | None = 1,
    contingent: Number | None = 1,
    weights: Mapping[tuple[str, str], Number | None] | None = None,
    timeout: Number | None = None,
) -> NetworkRepair:
    """The cheapest repair of a network.

    Args:
        network: a network, or the path of one.
        requirement: what a unit of change costs of each requirement, above 0; None: they stay as they are.
        contingent: what a unit of change costs of each contingent link.
        weights: what it costs of links between two time points, by the names of both.
        timeout: seconds after which the best repair so far is returned.

    Returns:
        The changed bounds with their cost, whether that is the least, or why there is none.

    Raises:
        InputError: if there is anything wrong in the file, a weight is not above 0, or of a link that there is not.
    """
    whole = network_of(network)
    single = {ends: _weight(weight, "weights") for ends, weight in (weights or {}).items()}
    unknown = single.keys() - {(link.source, link.target) for link in whole.links}
    if unknown:
        raise errors.InputError(
            f"found no link {min(unknown)}, expected one of the network", errors.Location("weights")
        )
    every = _weight(requirement, "requirement"), _weight(contingent, "contingent")
    return NetworkRepairSearch(whole, *every, single, deadline(timeout)).run()


def _weight(value: Number | None, name: str) -> Fraction | None:
    """A weight; None is infinite."""
    if value is None:
        return None
    weight = exact(value, errors.Location(name))
    if weight <= 0:
        raise errors.InputError(f"found {weight}, expected a number above 0", errors.Location(name))
    return weight


class NetworkRepairSearch(WeightedRepairSearching[NetworkRepair]):
    """One search for the least change of a network; a point has the change of each bound."""

    def __init__(
        self,
        network: Network,
        requirement: Fraction | None,
        contingent: Fraction | None,
        weights: Mapping[tuple[str, str], Fraction | None],
        deadline: limits.Deadline,
    ) -> None:
        super().__init__(solver="z3", deadline=deadline)
        self._network = network
        self._bound_of: dict[str, Bound] = {}
        for number, link in enumerate(network.links):
            weight = weights.get((link.source, link.target), contingent if link.is_contingent else requirement)
            for side in Side:
                if weight is not None and link.bound(side) is not None:
                    name = _name((number, side))
                    self.weight[name], self._bound_of[name] = weight, (number, side)

    # -- the search ----------------------------------------------------------------------------------------------------

    def rank(self, name: str) -> int:
        """Of equal costs, a requirement is easier to change than nature."""
        return int(self._link(name).is_contingent)

    def _link(self, name: str) -> Link:
        return self._network.links[self._bound_of[name][0]]

    def room(self, name: str, point: Point) -> Fraction | float:
        """The distance that a bound may still move: a contingent link keeps a length."""
        number, link = self._bound_of[name][0], self._link(name)
        if not link.is_contingent or link.lower is None or link.upper is None:
            return inf
        taken = (point.get(_name((number, side)), _NOTHING) for side in Side)
        return link.upper - link.lower - sum(taken, _NOTHING)

    def conflict_at(self, candidate: Candidate[Fraction]) -> Clause | None:
        """The conflict in the changed network; None if it is controllable."""
        network = self._changed(candidate.point)
        answer = dynamic(network.examined.stnu, self.deadline)
        if answer.cycle is None:
            return None
        choices = tuple(dict.fromkeys(self._choices(network, answer.cycle)))
        return Clause(choices, explain(network.examined.stnu, answer.cycle))

    def _choices(self, network: Network, cycle: NegativeCycle) -> Iterator[constraint.LinearConstraint]:
        """For each negative piece that changes can help, that it is at least 0.

        It may be these changes that made the piece negative; then fewer of them help.
        """
        for piece in cycle.pieces:
            if any(_is_endless(network, step) for step in piece):
                continue
            form: Counter[Bound] = Counter()
            for step in piece:
                for bound, factor in _form(network, step).items():
                    form[bound] += factor
            length, coefficients = _NOTHING, {}
            for (number, side), factor in form.items():
                length += factor * (self._network.links[number].bound(side) or 0)
                name = _name((number, side))
                if factor and name in self.weight:
                    coefficients[name] = factor * _direction(self._network.links[number], side)
            if length >= 0 or any(factor > 0 for factor in coefficients.values()):
                yield constraint.LinearConstraint.of(coefficients, ">=", -length)

    def limits(self, names: Sequence[str]) -> Iterator[constraint.LinearConstraint]:
        """Contingent links keep some length."""
        for name in names:
            number, _ = self._bound_of[name]
            link = self._network.links[number]
            if link.is_contingent and link.lower is not None and link.upper is not None:
                both = {_name((number, side)): 1 for side in Side if _name((number, side)) in names}
                yield constraint.LinearConstraint.of(both, "<=", link.upper - link.lower)

    # -- results -------------------------------------------------------------------------------------------------------

    def _changed(self, point: Point) -> Network:
        links = list(self._network.links)
        for name, amount in point.items():
            number, side = self._bound_of[name]
            moved = (links[number].bound(side) or 0) + _direction(links[number], side) * amount
            bounds: dict[str, Any] = {side.value: moved}
            links[number] = replace(links[number], **bounds)
        return self._network.with_links(links)

    def _result(self, status: searching.Status, reason: str | None = None) -> NetworkRepair:
        return NetworkRepair(
            self.repaired(status),
            None if self.best is None else self._changed(self.best.point),
            () if self.best is None else tuple(self._changes(self.best)),
            self.lowest or _NOTHING,
            len(self.clauses),
            self.examined,
            self._seconds(),
            status is searching.Status.INTERRUPTED,
            self._network.name,
        )

    def _changes(self, repair: Candidate[Fraction]) -> Iterator[LinkChange]:
        for name, amount in sorted(repair.point.items(), key=lambda item: self._bound_of[item[0]][0]):
            link, side = self._link(name), self._bound_of[name][1]
            chosen = repair.chosen.items()
            serves = dict.fromkeys(self.clauses[known].reason for known, choice in chosen if name in choice.parameters)
            new = (link.bound(side) or _NOTHING) + _direction(link, side) * amount
            yield LinkChange(link, side, new, amount, amount * self.weight[name], tuple(serves))


def _name(bound: Bound) -> str:
    return f"{bound[0]}.{bound[1].value}"


def _direction(link: Link, side: Side) -> int:
    """Which way a bound may move."""
    return 1 if (side is Side.UPPER) != link.is_contingent else -1


def _is_endless(network: Network, step: EdgeStep) -> bool:
    """Whether an edge is infinitely negative, whatever is changed."""
    return step.way is Way.LONGEST and network.examined.stnu.links[step.link].upper is None


def _form(network: Network, step: EdgeStep) -> Form:
    """The length of an edge in terms of the bounds of the network's links."""
    role, number = network.examined.roles[step.link]
    lower, upper = (number, Side.LOWER), (number, Side.UPPER)
    sign = 1 if step.way.is_forwards else -1
    at_upper = step.way in {Way.AT_MOST, Way.LONGEST}
    match role:
        case Role.IMPLICIT:
            return {}
        case Role.SETTLED:
            return {lower: -sign}
        case Role.SPAN:
            return {upper: sign, lower: -sign} if at_upper else {}
        case Role.WHOLE:
            return {upper if at_upper else lower: sign}
