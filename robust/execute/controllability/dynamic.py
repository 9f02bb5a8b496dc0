"""Dynamic controllability in O(n³) steps: backward propagation from negative nodes.

Source: P. Morris (2014), *Dynamic controllability and dispatchability relationships*, CPAIOR. In the extended normal
form each contingent link A ⇒ C of length [x, y] starts at a time point of its own, A′ = A + x, and has length
[0, y − x]: its lower-case edge A′ → C has length 0, its upper-case edge C → A′ has length x − y. From each time point
into which a negative edge leads, paths are followed backwards as long as they are negative; what comes out as not
negative becomes an ordinary edge, so that paths through the time point need not be followed again. If a path gets back
to a time point from where the search is still on, the network is not dynamically controllable. A piece that passes the
lower-case edge of a link is negative at that moment, which is what the lower-case and cross-case reductions ask for,
and never passes one when it began with the upper-case edge of the same link.

Numbers are integers in units of a common denominator. An infinite length is larger than all sums that occur.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from math import lcm

from robust.execute.controllability.stnu import ContingentLink, RequirementLink, Step, Stnu, Way
from robust.execute.controllability.walks import NegativeCycle, negative_cycle, weight_in
from robust.smt.limits import Deadline


class Case(Enum):
    """What an edge says: always, if a contingent link is as short as it may be, or unless it has ended."""

    ORDINARY = "ordinary"
    LOWER = "lower-case"
    UPPER = "upper-case"


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """`t_target − t_source ≤ weight` between numbered nodes; `label` is the contingent link of a cased edge.

    `steps` is where an edge of the network itself comes from; derived edges have a `search` that found them.
    """

    source: int
    target: int
    weight: int
    case: Case = Case.ORDINARY
    label: int | None = None
    steps: tuple[Step, ...] = ()
    search: Search | None = None


@dataclass(slots=True, eq=False)
class Search:
    """The backward search from one negative node: `next` is the edge on the shortest path from each node to it."""

    source: int
    label: int | None
    queue: list[tuple[int, int]] = field(default_factory=list)
    distance: dict[int, int] = field(default_factory=dict)
    next: dict[int, Edge] = field(default_factory=dict)
    done: set[int] = field(default_factory=set)


@dataclass(frozen=True)
class NormalForm:
    """The distance graph of the extended normal form.

    Nodes are numbered: the network's time points in order, then the starts A′ of contingent links. `start` is the node
    A′ of a contingent link, by its index in the network's links. `infinity` is what an infinite length amounts to.
    """

    stnu: Stnu
    scale: int
    infinity: int
    start: dict[int, int]
    edges: tuple[Edge, ...]

    @property
    def size(self) -> int:
        return len(self.stnu.points) + len(self.start)

    def length(self, weight: int) -> Fraction | None:
        """A weight in the network's unit; None if it is infinite, one way or the other."""
        return None if 2 * abs(weight) > self.infinity else Fraction(weight, self.scale)


@dataclass(frozen=True)
class DynamicAnswer:
    """Whether a network is dynamically controllable: `cycle` is why not; None if it is.

    `derived` are the edges that follow from reductions, with which a dispatcher can execute the network.
    """

    form: NormalForm
    cycle: NegativeCycle | None
    derived: tuple[Edge, ...]

    @property
    def is_controllable(self) -> bool:
        return self.cycle is None


def dynamic(stnu: Stnu, deadline: Deadline = Deadline()) -> DynamicAnswer:  # noqa: B008 - immutable
    """Whether a dispatcher that sees contingent links end can always satisfy all requirements.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    form = normal_form(stnu)
    propagation = _Propagation(form, deadline)
    walk = propagation.run()
    cycle = None if walk is None else negative_cycle(walk, weight_in(stnu))
    return DynamicAnswer(form, cycle, tuple(propagation.derived))


def normal_form(stnu: Stnu) -> NormalForm:
    """The distance graph of a network in extended normal form."""
    bounds = [bound for link in stnu.links for bound in (link.lower, link.upper) if bound is not None]
    scale = lcm(*(bound.denominator for bound in bounds))
    uncertain = [i for i, link in enumerate(stnu.links) if isinstance(link, ContingentLink) and not link.is_fixed]
    start = {index: len(stnu.points) + count for count, index in enumerate(uncertain)}
    # A cycle that matters passes each edge at most 2^(K+1) times, K being the number of contingent links.
    infinity = scale * (1 + sum(abs(int(bound * scale)) for bound in bounds)) << (len(start) + 2)
    node = {point: number for number, point in enumerate(stnu.points)}
    edges: list[Edge] = []
    for index, link in enumerate(stnu.links):
        source, target = node[link.source], node[link.target]
        if isinstance(link, RequirementLink) or index not in start:
            if link.upper is not None:
                edges.append(Edge(source, target, int(link.upper * scale), steps=(Step(index, Way.AT_MOST),)))
            if link.lower is not None:
                edges.append(Edge(target, source, -int(link.lower * scale), steps=(Step(index, Way.AT_LEAST),)))
            continue
        middle, low = start[index], int((link.lower or 0) * scale)
        high = infinity if link.upper is None else int(link.upper * scale)
        edges += [
            Edge(source, middle, low),
            Edge(middle, source, -low),
            Edge(middle, target, 0, Case.LOWER, index, (Step(index, Way.SHORTEST),)),
            Edge(target, middle, low - high, Case.UPPER, index, (Step(index, Way.LONGEST),)),
        ]
    return NormalForm(stnu, scale, infinity, start, tuple(edges))


class _Propagation:
    """One run of the algorithm, with a stack of its own: plans may be longer than Python's."""

    def __init__(self, form: NormalForm, deadline: Deadline) -> None:
        self._deadline = deadline
        self._into: list[list[Edge]] = [[] for _ in range(form.size)]
        for edge in form.edges:
            self._into[edge.target].append(edge)
        self._label = {node: index for index, node in form.start.items()}
        self._negative = {edge.target for edge in form.edges if edge.weight < 0}
        self._finished: set[int] = set()
        self.derived: list[Edge] = []

    def run(self) -> list[Step] | None:
        """A closed walk that refutes dynamic controllability; None if there is none."""
        for node in sorted(self._negative):
            if node not in self._finished:
                walk = self._from(node)
                if walk is not None:
                    return walk
        return None

    def _from(self, node: int) -> list[Step] | None:
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

    def _search(self, node: int) -> Search:
        search = Search(node, self._label.get(node))
        for edge in self._into[node]:
            if edge.weight < 0:
                self._relax(search, edge, 0)
        return search

    def _relax(self, search: Search, edge: Edge, beyond: int) -> None:
        distance = beyond + edge.weight
        known = search.distance.get(edge.source)
        if known is None or distance < known:
            search.distance[edge.source] = distance
            search.next[edge.source] = edge
            heapq.heappush(search.queue, (distance, edge.source))

    def _continue(self, search: Search) -> int | None:
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

    def _derive(self, search: Search, node: int, distance: int) -> None:
        """Remember that the node is so far from the source; not negative, it is an edge to go on with."""
        if node == search.source or search.next[node].target == search.source:
            return
        if distance >= 0:
            edge = Edge(node, search.source, distance, search=search)
            self._into[search.source].append(edge)
        else:
            case = Case.ORDINARY if search.label is None else Case.UPPER
            edge = Edge(node, search.source, distance, case, search.label, search=search)
        self.derived.append(edge)


def _closed_walk(stack: list[Search], node: int) -> list[Step]:
    """The walk from the node where the search got stuck, back through the searches that are on, to that node."""
    first = next(index for index, search in enumerate(stack) if search.source == node)
    edges: list[Edge] = []
    begin = node
    for search in reversed(stack[first:]):
        edges += _path(search, begin)
        begin = search.source
    return list(_steps(edges))


def _path(search: Search, node: int) -> list[Edge]:
    path: list[Edge] = []
    while not path or node != search.source:
        edge = search.next[node]
        path.append(edge)
        node = edge.target
    return path


def _steps(edges: list[Edge]) -> Iterator[Step]:
    """The edges of the network of which a path is made. A′ counts as A, which changes no closed walk's length."""
    todo = list(reversed(edges))
    while todo:
        edge = todo.pop()
        if edge.search is None:
            yield from edge.steps
        else:
            todo += reversed(_path(edge.search, edge.source))
