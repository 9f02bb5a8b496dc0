"""The strategy behind dynamic controllability, for people and dispatchers: who waits for whom, and how long."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from math import lcm

from robust.execute.controllability.stnu import (
    ContingentLink,
    NegativeCycle,
    RequirementLink,
    Step,
    Stnu,
    Way,
    negative_cycle,
    weight_in,
)
from robust.numbers import format_number
from robust.plan.model import TimePoint
from robust.smt.limits import Deadline


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


def waits(answer: DynamicAnswer) -> tuple[Wait, ...]:
    """The conditional waits with which a dispatcher satisfies a controllable network, in the order of its time points.

    Waits that the others and the requirements imply are left out: what comes after another time point need not say that
    it waits as long, and what comes after the end of a link waits for it anyway.
    """
    form = answer.form
    points, executable = form.stnu.points, set(form.stnu.executable)
    every = [edge for edge in (*form.edges, *answer.derived) if edge.case is not Case.LOWER]
    distance = _distances(form.size, [edge for edge in every if edge.case is Case.ORDINARY])
    link_of = {node: form.stnu.links[index] for index, node in form.start.items()}
    found = []
    for start, link in link_of.items():
        waiting = {edge.source: edge.weight for edge in every if edge.case is Case.UPPER and edge.target == start}
        for edge in every:
            if edge.case is Case.UPPER and edge.target == start:
                waiting[edge.source] = min(edge.weight, waiting[edge.source])
        for node in sorted(waiting, key=lambda node: -node):
            if node >= len(points) or points[node] not in executable:
                continue
            if _is_implied(node, start, waiting, distance):
                del waiting[node]
            elif isinstance(link, ContingentLink):
                length = form.length(waiting[node])
                delay = None if length is None else link.lower - length
                found.append(Wait(points[node], link.source, delay, link.target))
    return tuple(sorted(found, key=lambda wait: (points.index(wait.point), points.index(wait.end))))


def _is_implied(node: int, start: int, waiting: dict[int, int], distance: list[list[int | None]]) -> bool:
    row, weight = distance[node], waiting[node]
    without = row[start]
    if without is not None and without <= weight:
        return True
    others = ((row[other], beyond) for other, beyond in waiting.items() if other != node)
    # Only what happens before the time point has waited when the time point looks.
    return any(before is not None and before <= 0 and before + beyond <= weight for before, beyond in others)


def _distances(size: int, edges: Iterable[Edge]) -> list[list[int | None]]:
    """Shortest paths between all nodes; None where there is none."""
    table: list[list[int | None]] = [[0 if a == b else None for b in range(size)] for a in range(size)]
    for edge in edges:
        known = table[edge.source][edge.target]
        table[edge.source][edge.target] = edge.weight if known is None else min(known, edge.weight)
    for middle, after in enumerate(table):
        reached = [(b, weight) for b, weight in enumerate(after) if weight is not None]
        for row in table:
            first = row[middle]
            if first is not None:
                for b, weight in reached:
                    known = row[b]
                    if known is None or first + weight < known:
                        row[b] = first + weight
    return table


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
