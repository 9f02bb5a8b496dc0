"""Simple temporal networks with uncertainty, and their dynamic controllability in O(n³) steps.

Definitions as in Vidal and Fargier (1999) and Morris, Muscettola and Vidal (2001), with the choices that plans need: a
contingent link may have length zero or a fixed length, its length may have no upper bound, and a dispatcher may react
to an observation at the moment of the observation. Where time must pass between the two, a requirement link says so.

Dynamic controllability is decided by backward propagation from negative nodes; source: P. Morris (2014), *Dynamic
controllability and dispatchability relationships*, CPAIOR. In the extended normal form each contingent link A ⇒ C of
length [x, y] starts at a time point of its own, A′ = A + x, and has length [0, y − x]: its lower-case edge A′ → C has
length 0, its upper-case edge C → A′ has length x − y. From each time point into which a negative edge leads, paths are
followed backwards as long as they are negative; what comes out as not negative becomes an ordinary edge, so that paths
through the time point need not be followed again. If a path gets back to a time point from where the search is still
on, the network is not dynamically controllable. A piece that passes the lower-case edge of a link is negative at that
moment, which is what the lower-case and cross-case reductions ask for, and never passes one when it began with the
upper-case edge of the same link.

Numbers are integers in units of a common denominator. An infinite length is larger than all sums that occur.

Why a network is not: a closed walk of negative length through the distance graph refutes dynamic controllability if
each of its lower-case edges is followed by a piece of negative length, up to the first such piece without the
upper-case edge of the same contingent link: what comes after it has to be decided before the link's length is known
(Morris, 2006: *A structural characterization of temporal dynamic controllability*; reaction at the moment of an
observation is allowed).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from itertools import accumulate
from math import lcm
from typing import Generic, NamedTuple, TypeVar

from robust import errors, presented
from robust.numbers import format_number
from robust.plan.model import ZERO, TimePoint
from robust.smt.limits import NEVER, Deadline

B = TypeVar("B")


@dataclass(frozen=True)
class UncertainLink(Generic[B]):
    """`lower ≤ t_target − t_source ≤ upper`, for the dispatcher to satisfy; None is an infinite bound.

    If it is contingent, `t_target = t_source + d` for a length d that nature chooses between the bounds, which is
    observed when the target happens; `name` says whose length it is, such as the parameter. `origin` is what people
    know the link by.
    """

    source: TimePoint
    target: TimePoint
    lower: B | None
    upper: B | None
    is_contingent: bool = False
    name: str = ""
    origin: str = ""

    def __str__(self) -> str:
        length = f"= {self.name} in" if self.is_contingent else "in"
        return self.origin or f"{self.target} - {self.source} {length} {bounds_text(self.lower, self.upper)}"


def bounds_text(lower: object, upper: object) -> str:
    """`[1/3, inf]`."""
    return f"[{'-inf' if lower is None else lower}, {'inf' if upper is None else upper}]"


class Way(Enum):
    """The bound of a link that an edge of the distance graph stands for; `x → y` of weight w is `t_y − t_x ≤ w`."""

    AT_MOST = "at most"
    """source → target, the upper bound of a requirement, or of a link of fixed length."""
    AT_LEAST = "at least"
    """target → source, minus the lower bound."""
    SHORTEST = "as short as"
    """source → target, the least length of a contingent link: the lower-case edge."""
    LONGEST = "as long as"
    """target → source, minus the greatest length of a contingent link: the upper-case edge."""

    @property
    def is_forwards(self) -> bool:
        return self in {Way.AT_MOST, Way.SHORTEST}


class EdgeStep(NamedTuple):
    """An edge of the distance graph: the index of its link in :attr:`Stnu.links`, and its bound."""

    link: int
    way: Way


@dataclass(frozen=True)
class Stnu:
    """A network; every time point but the ends of contingent links is the dispatcher's to execute.

    Args:
        points: all time points, :data:`robust.plan.model.ZERO` first: it happens at time zero.
        links: requirement and contingent links between them.

    Raises:
        InputError: for a link between unknown points, a contingent link that is empty or may end before it starts, two
            contingent links that end together, or contingent links that go round in a circle.
    """

    points: tuple[TimePoint, ...]
    links: tuple[UncertainLink[Fraction], ...]

    def __post_init__(self) -> None:
        known = set(self.points)
        if not self.points or self.points[0] != ZERO:
            raise errors.InputError(f"the network begins with {self.points[:1]}; expected {ZERO}")
        before: dict[TimePoint, TimePoint] = {}
        for link in self.links:
            if link.source not in known or link.target not in known:
                raise errors.InputError(f"link {link} joins time points that are not in the network")
            if link.is_contingent:
                _check_contingent(link, before)
                before[link.target] = link.source
        for end in before:
            seen, point = {end}, end
            while point in before:
                point = before[point]
                if point in seen:
                    raise errors.InputError(f"contingent links go round in a circle at {point}")
                seen.add(point)

    @property
    def contingents(self) -> tuple[UncertainLink[Fraction], ...]:
        return tuple(link for link in self.links if link.is_contingent)

    @property
    def executable(self) -> tuple[TimePoint, ...]:
        """The time points that the dispatcher executes, zero first."""
        ends = {link.target for link in self.contingents}
        return tuple(point for point in self.points if point not in ends)

    def ends(self, step: EdgeStep) -> tuple[TimePoint, TimePoint]:
        """The time points at which an edge of the distance graph begins and ends."""
        link = self.links[step.link]
        return (link.source, link.target) if step.way.is_forwards else (link.target, link.source)


def _check_contingent(link: UncertainLink[Fraction], before: Mapping[TimePoint, TimePoint]) -> None:
    if link.lower is None or link.lower < 0 or (link.upper is not None and link.upper < link.lower):
        bounds = bounds_text(link.lower, link.upper)
        raise errors.InputError(f"contingent link {link} has length {bounds}; expected 0 <= lower <= upper")
    if link.target in before:
        raise errors.InputError(f"contingent link {link} ends at {link.target}, where another one ends already")
    if link.target == ZERO:
        raise errors.InputError(f"contingent link {link} ends at {ZERO}, which happens at time zero")


Weight = Callable[[EdgeStep], tuple[Fraction, Fraction]]
"""An edge's length as (how often infinity, the rest)."""
_ZERO = (Fraction(0), Fraction(0))


@dataclass(frozen=True, slots=True)
class NegativeCycle:
    """A closed walk, and for each lower-case edge in it, by position, how many of the next steps are negative together.

    A network is not dynamically controllable as long as the whole walk and all these pieces are negative.
    """

    steps: tuple[EdgeStep, ...]
    moats: tuple[tuple[int, int], ...]

    @property
    def pieces(self) -> tuple[tuple[EdgeStep, ...], ...]:
        """The whole walk, and the piece after each lower-case edge; equal ones once."""
        twice = self.steps + self.steps
        pieces = [self.steps, *(twice[at + 1 : at + 1 + length] for at, length in self.moats)]
        return tuple(dict.fromkeys(pieces))


def weight_in(stnu: Stnu) -> Weight:
    """The lengths of edges in a network."""

    def weight(step: EdgeStep) -> tuple[Fraction, Fraction]:
        link = stnu.links[step.link]
        bound = link.upper if step.way in {Way.AT_MOST, Way.LONGEST} else link.lower
        if bound is None:
            return (Fraction(-1 if step.way is Way.LONGEST else 1), Fraction(0))
        return (Fraction(0), bound if step.way.is_forwards else -bound)

    return weight


def total(steps: Iterable[EdgeStep], weight: Weight) -> tuple[Fraction, Fraction]:
    """The length of a walk."""
    infinite, finite = zip(_ZERO, *map(weight, steps), strict=True)
    return sum(infinite, Fraction(0)), sum(finite, Fraction(0))


def negative_cycle(steps: Sequence[EdgeStep], weight: Weight) -> NegativeCycle:
    """The negative cycle of a closed walk, without circles at a contingent link that do not make it shorter.

    Raises:
        ValueError: if the walk does not refute dynamic controllability.
    """
    walk = list(steps)
    while True:
        if total(walk, weight) >= _ZERO:
            raise ValueError("the walk is not negative")
        moats = [(at, _moat(walk, at, weight)) for at, step in enumerate(walk) if step.way is Way.SHORTEST]
        breaches = (at for at, moat in moats if EdgeStep(walk[at].link, Way.LONGEST) in _after(walk, at)[:moat])
        breach = next(breaches, None)
        if breach is None:
            return NegativeCycle(tuple(walk), tuple(moats))
        # without its part from a lower-case edge to the upper-case edge of the same link, a circle
        rest = _after(walk, breach)
        walk = rest[rest.index(EdgeStep(walk[breach].link, Way.LONGEST)) + 1 : -1]


def _moat(walk: Sequence[EdgeStep], at: int, weight: Weight) -> int:
    """The number of steps after a position that first have negative length."""
    lengths = accumulate(map(weight, _after(walk, at)), lambda before, step: (before[0] + step[0], before[1] + step[1]))
    for count, length in enumerate(lengths, start=1):
        if length < _ZERO:
            return count
    raise ValueError("a lower-case edge cannot be reduced away")


def _after(walk: Sequence[EdgeStep], at: int) -> list[EdgeStep]:
    """The closed walk from behind a position round to that position."""
    return [*walk[at + 1 :], *walk[: at + 1]]


def explain(stnu: Stnu, cycle: NegativeCycle) -> str:
    """A sentence about a cycle: the lengths and requirements that contradict each other."""
    lengths, bounds = [], []
    for step in dict.fromkeys(cycle.steps):
        link = stnu.links[step.link]
        if step.way in {Way.SHORTEST, Way.LONGEST}:
            bound = link.lower if step.way is Way.SHORTEST else link.upper
            size = "is unbounded" if bound is None else f"{step.way.value} {format_number(bound)}"
            lengths.append(f"{link.name} {size}")
        else:
            bounds.append(str(link))
    short = ", ".join(sorted(lengths))
    needed = "; ".join(dict.fromkeys(bounds))
    return f"{short} cannot be met with {needed}" if lengths else f"contradiction: {needed}"


@dataclass(frozen=True, slots=True)
class Wait:
    """A time point waits until `delay` after `activation`, or until `end` has happened, whichever comes first.

    A delay of None waits for the end however long it takes.
    """

    point: TimePoint
    activation: TimePoint
    delay: Fraction | None
    end: TimePoint

    def __str__(self) -> str:
        if self.delay is None:
            return f"{self.point} waits for {self.end}"
        return f"{self.point} waits for {self.end}, at most {format_number(self.delay)} after {self.activation}"


def _in_units(number: Fraction | int, scale: int) -> int:
    """A number times a multiple of its denominator."""
    return number.numerator * (scale // number.denominator)


class Case(Enum):
    """When an edge holds: always, if a contingent link is as short as it may be, or unless the link has ended."""

    ORDINARY = "ordinary"
    LOWER = "lower-case"
    UPPER = "upper-case"


@dataclass(slots=True, eq=False)
class CasedEdge:
    """`t_target − t_source ≤ weight` between numbered nodes; `label` is the contingent link of a cased edge.

    `steps` is where an edge of the network itself comes from; derived edges have a `search` that found them.
    """

    source: int
    target: int
    weight: int
    case: Case = Case.ORDINARY
    label: int | None = None
    steps: tuple[EdgeStep, ...] = ()
    search: BackwardSearch | None = None


@dataclass(slots=True, eq=False)
class BackwardSearch:
    """The backward search from one negative node: `next` is the edge on the shortest path from each node to it."""

    source: int
    label: int | None
    queue: list[tuple[int, int]] = field(default_factory=list)
    distance: dict[int, int] = field(default_factory=dict)
    next: dict[int, CasedEdge] = field(default_factory=dict)
    done: set[int] = field(default_factory=set)


@dataclass(frozen=True)
class ExtendedForm:
    """The distance graph of the extended normal form.

    Nodes are numbered: the network's time points in order, then the starts A′ of contingent links. `start` is the node
    A′ of a contingent link, by its index in the network's links. `infinity` is what an infinite length amounts to.
    """

    stnu: Stnu
    scale: int
    infinity: int
    start: dict[int, int]
    edges: tuple[CasedEdge, ...]

    @property
    def size(self) -> int:
        return len(self.stnu.points) + len(self.start)

    def length(self, weight: int) -> Fraction | None:
        """A weight in the network's unit; None if it is infinite, one way or the other."""
        return None if 2 * abs(weight) > self.infinity else Fraction(weight, self.scale)


@dataclass(frozen=True)
class DynamicAnswer(presented.NoTruthValue, ask="is_controllable"):
    """Whether a network is dynamically controllable; `cycle` is a counterexample, None if it is.

    `derived` are the edges that follow from reductions, with which a dispatcher can execute the network.
    """

    form: ExtendedForm
    cycle: NegativeCycle | None
    derived: tuple[CasedEdge, ...]

    @property
    def is_controllable(self) -> bool:
        return self.cycle is None


def dynamic(stnu: Stnu, deadline: Deadline = NEVER) -> DynamicAnswer:
    """Whether a dispatcher that sees contingent links end can always satisfy all requirements.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    form = normal_form(stnu)
    propagation = _Propagation(form, deadline)
    walk = propagation.run()
    cycle = None if walk is None else negative_cycle(walk, weight_in(stnu))
    return DynamicAnswer(form, cycle, tuple(propagation.derived))


def normal_form(stnu: Stnu) -> ExtendedForm:
    """The distance graph of a network in extended normal form."""
    bounds = [bound for link in stnu.links for bound in (link.lower, link.upper) if bound is not None]
    scale = lcm(*(bound.denominator for bound in bounds))
    uncertain = [i for i, link in enumerate(stnu.links) if link.is_contingent and link.lower != link.upper]
    start = {index: len(stnu.points) + count for count, index in enumerate(uncertain)}
    # A cycle that matters passes each edge at most 2^(K+1) times, K being the number of contingent links.
    infinity = scale * (1 + sum(abs(_in_units(bound, scale)) for bound in bounds)) << (len(start) + 2)
    node = {point: number for number, point in enumerate(stnu.points)}
    edges: list[CasedEdge] = []
    for index, link in enumerate(stnu.links):
        source, target = node[link.source], node[link.target]
        if index not in start:
            if link.upper is not None:
                most = _in_units(link.upper, scale)
                edges.append(CasedEdge(source, target, most, steps=(EdgeStep(index, Way.AT_MOST),)))
            if link.lower is not None:
                least = _in_units(link.lower, scale)
                edges.append(CasedEdge(target, source, -least, steps=(EdgeStep(index, Way.AT_LEAST),)))
            continue
        middle, low = start[index], _in_units(link.lower or 0, scale)
        high = infinity if link.upper is None else _in_units(link.upper, scale)
        edges += [
            CasedEdge(source, middle, low),
            CasedEdge(middle, source, -low),
            CasedEdge(middle, target, 0, Case.LOWER, index, (EdgeStep(index, Way.SHORTEST),)),
            CasedEdge(target, middle, low - high, Case.UPPER, index, (EdgeStep(index, Way.LONGEST),)),
        ]
    return ExtendedForm(stnu, scale, infinity, start, tuple(edges))


class _Propagation:
    """One run of the algorithm, with a stack of its own: plans may be longer than Python's."""

    def __init__(self, form: ExtendedForm, deadline: Deadline) -> None:
        self._deadline = deadline
        self._into: list[list[CasedEdge]] = [[] for _ in range(form.size)]
        for edge in form.edges:
            self._into[edge.target].append(edge)
        self._label = {node: index for index, node in form.start.items()}
        self._negative = {edge.target for edge in form.edges if edge.weight < 0}
        self._finished: set[int] = set()
        self.derived: list[CasedEdge] = []

    def run(self) -> list[EdgeStep] | None:
        """A closed walk that refutes dynamic controllability; None if there is none."""
        for node in sorted(self._negative):
            if node not in self._finished:
                walk = self._from(node)
                if walk is not None:
                    return walk
        return None

    def _from(self, node: int) -> list[EdgeStep] | None:
        stack = [self._search(node)]
        active = {node}
        while stack:
            self._deadline.enforce()
            search = stack[-1]
            blocked = self._continue(search)
            if blocked is None:
                self._finished.add(search.source)
                active.discard(search.source)
                stack.pop()
            elif blocked in active:
                return _closed_walk(stack, blocked)
            else:
                active.add(blocked)
                stack.append(self._search(blocked))
        return None

    def _search(self, node: int) -> BackwardSearch:
        search = BackwardSearch(node, self._label.get(node))
        for edge in self._into[node]:
            if edge.weight < 0:
                self._relax(search, edge, 0)
        return search

    def _relax(self, search: BackwardSearch, edge: CasedEdge, beyond: int) -> None:
        distance = beyond + edge.weight
        known = search.distance.get(edge.source)
        if known is None or distance < known:
            search.distance[edge.source] = distance
            search.next[edge.source] = edge
            heapq.heappush(search.queue, (distance, edge.source))

    def _continue(self, search: BackwardSearch) -> int | None:
        """Go on until the search is done, or until a negative node has to be searched from first: that node."""
        while search.queue:
            distance, node = search.queue[0]
            if node in search.done or distance > search.distance[node]:
                heapq.heappop(search.queue)
                continue
            if distance < 0 and node in self._negative and node not in self._finished:
                return node
            heapq.heappop(search.queue)
            search.done.add(node)
            self._derive(search, node, distance)
            if distance < 0:
                for edge in self._into[node]:
                    unsuitable = edge.case is Case.LOWER and edge.label == search.label
                    if edge.weight >= 0 and not unsuitable:
                        self._relax(search, edge, distance)
        return None

    def _derive(self, search: BackwardSearch, node: int, distance: int) -> None:
        """Remember that the node is so far from the source; not negative, it is an edge to go on with."""
        if node == search.source or search.next[node].target == search.source:
            return
        if distance >= 0:
            edge = CasedEdge(node, search.source, distance, search=search)
            self._into[search.source].append(edge)
        else:
            case = Case.ORDINARY if search.label is None else Case.UPPER
            edge = CasedEdge(node, search.source, distance, case, search.label, search=search)
        self.derived.append(edge)


def _closed_walk(stack: list[BackwardSearch], node: int) -> list[EdgeStep]:
    """The walk from the node where the search got stuck, back through the searches that are on, to that node."""
    first = next(index for index, search in enumerate(stack) if search.source == node)
    edges: list[CasedEdge] = []
    begin = node
    for search in reversed(stack[first:]):
        edges += _path(search, begin)
        begin = search.source
    return list(_steps(edges))


def _path(search: BackwardSearch, node: int) -> list[CasedEdge]:
    path = [search.next[node]]
    while path[-1].target != search.source:
        path.append(search.next[path[-1].target])
    return path


def _steps(edges: list[CasedEdge]) -> Iterator[EdgeStep]:
    """The edges of the network of which a path is made. A′ counts as A, which changes no closed walk's length."""
    todo = list(reversed(edges))
    while todo:
        edge = todo.pop()
        if edge.search is None:
            yield from edge.steps
        else:
            todo += reversed(_path(edge.search, edge.source))
