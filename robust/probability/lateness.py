"""Every duration random: the probability that a longest path is in time, in a network of least distances and deadlines.

A schedule exists if and only if the longest path to each deadline is in time:

- edges that another path implies for almost all durations go, and chains become one edge;
- an edge through which some path is late with probability δ at most may go, if δ is taken off the lower bound. The
  forward law of what leads to it and the backward law of what follows are independent, since no edge is before and
  after it: δ = 1 − P(before + edge + after ≤ D). So the edges that hardly matter go first, until little is shared;
- laws of the rest are computed by :mod:`robust.probability.lattice`: cells on a coarse lattice, and from them on a
  lattice on which rounding hardly counts.

What ends by itself may have to wait for something else, too: if E is S plus a duration d and E ≥ u + c, then
S ≥ u + c − d. An executor that does not know d yet waits for u + c less the least value of d: with such waits the graph
gives a lower bound for all who know more. Without them nobody does better than in the graph.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, gcd, lcm
from typing import NamedTuple, TypeVar

import numpy as np

from robust.irr.proposals import SlackPlan
from robust.network.differences import reachable
from robust.network.slack import OutsideFragmentError
from robust.probability import lattice
from robust.probability.convolution import Array, Increments
from robust.probability.distributions import DISCRETE, Distribution
from robust.probability.lattice import CellSearch, LatticeEdge, LongestPath, Node
from robust.probability.random_durations import RandomDuration
from robust.smt.limits import Deadline, raise_if_interrupted

SIZES = (2048, 8192, 32768, 131072)
"""Cells of a lattice up to the last deadline, one after the other."""
FINE = 8
"""Chains are summed on a lattice that is finer by this."""
WORK = 2 * 10**8
"""Most places of laws that are computed on one lattice, which bounds time in the same way on every machine."""
ROUNDS = 4
"""With a time limit: how often four times as much work is done while bounds are not close."""
CUTS = 8
"""Most durations that have cells."""
SINK = "deadlines"

# -- the graph ---------------------------------------------------------------------------------------------------------


class PathEdge(NamedTuple):
    """t_target ≥ t_source + constant + the sum of durations."""

    source: Node
    target: Node
    constant: Fraction
    names: tuple[str, ...] = ()


class WaitingEdge(NamedTuple):
    """t_target ≥ t_source + constant − a duration, which begins at the target; `free` if nothing else follows it."""

    source: Node
    target: Node
    constant: Fraction
    name: str
    free: bool


Durations = Mapping[str, RandomDuration]


@dataclass(frozen=True)
class LatenessGraph:
    """Least distances from time zero to the sink, which is in time at `latest`; `due` says what demands a point.

    `links` are the starts, offsets and names of durations by their ends, `waiting` what an end has to wait for.
    """

    edges: tuple[PathEdge, ...]
    links: Mapping[Node, tuple[Node, Fraction, str]]
    waiting: tuple[WaitingEdge, ...]
    durations: Durations
    latest: Fraction
    due: Mapping[Node, str]

    def with_waits(self, *, free: bool) -> tuple[PathEdge, ...]:
        """With the edges of waits, each for the least value of its duration; those that are `free` only if asked."""
        waits = [
            PathEdge(wait.source, wait.target, max(Fraction(0), wait.constant - self.durations[wait.name].least))
            for wait in self.waiting
            if free or not wait.free
        ]
        return tuple(necessary([*self.edges, *waits], self.durations)) if waits else self.edges


def lateness_graph(slack: SlackPlan, durations: Durations) -> LatenessGraph:
    """The graph of a plan's network.

    Raises:
        OutsideFragmentError: if there is more to the network than least distances, durations and deadlines.
    """
    parameters = slack.plan.parameters
    lasting: dict[int, list[tuple[int, int, Fraction]]] = {}
    due: dict[Node, tuple[Fraction, str]] = {}
    paths: list[PathEdge] = []
    limits: list[PathEdge] = []
    for bound in slack.bounds:
        weight = Fraction(bound.weight, slack.scale)
        if bound.face is not None:
            ends = (bound.target, bound.source) if bound.face & 1 else (bound.source, bound.target)
            constant = (-weight if bound.face & 1 else weight) - parameters[bound.face >> 1].nominal
            lasting.setdefault(bound.face >> 1, []).append((*ends, constant))
        elif bound.target == 0 and bound.source != 0:
            if bound.source not in due or -weight < due[bound.source][0]:
                due[bound.source] = -weight, bound.origin
        elif bound.source != bound.target:
            (paths if weight >= 0 else limits).append(PathEdge(bound.source, bound.target, weight))
    links: dict[Node, tuple[Node, Fraction, str]] = {}
    for number, using in lasting.items():
        source, target, constant = using[0]
        if len(using) != 2 or using[0] != using[1] or target in links or target == 0 or constant < 0:
            raise OutsideFragmentError(f"{parameters[number].name} is not the length of one distance of its own")
        links[target] = source, constant, parameters[number].name
    return graph_of(paths, limits, links, due, durations)


def graph_of(
    distances: Iterable[PathEdge],
    limits: Sequence[PathEdge],
    links: Mapping[Node, tuple[Node, Fraction, str]],
    due: Mapping[Node, tuple[Fraction, str]],
    durations: Durations,
) -> LatenessGraph:
    """The graph of distances and durations; `due` says when points have to happen, and what demands it.

    Raises:
        OutsideFragmentError: if there is no deadline, or a limit, which is a distance below zero, is not implied.
    """
    if not due:
        raise OutsideFragmentError("there is no deadline")
    latest = max(time for time, _ in due.values())
    lasting = (PathEdge(start, end, constant, (name,)) for end, (start, constant, name) in links.items())
    ends = (PathEdge(point, SINK, latest - time) for point, (time, _) in due.items())
    paths = necessary([*distances, *lasting, *ends], durations, limits)
    follows = {edge.source for edge in paths if not edge.names} | {
        edge.source for edge in paths if edge.names and links[edge.target][0] != edge.source
    }
    waiting = []
    for edge in paths:
        if edge.target in links and not edge.names:
            start, constant, name = links[edge.target]
            waiting.append(WaitingEdge(edge.source, start, edge.constant - constant, name, start not in follows))
    return LatenessGraph(
        tuple(paths), links, tuple(waiting), durations, latest, {point: origin for point, (_, origin) in due.items()}
    )


def necessary(edges: Sequence[PathEdge], durations: Durations, limits: Sequence[PathEdge] = ()) -> list[PathEdge]:
    """Edges that lead to the sink and that no other path implies while all durations are in their ranges.

    Raises:
        OutsideFragmentError: if there is a cycle, or one of the limits is not implied.
    """
    known = lattice.topology(edges)
    if known is None:
        raise OutsideFragmentError("points of the network come one after the other in a circle")
    place = {node: number for number, node in enumerate(known.order)}
    scale = 1024 * lcm(*(edge.constant.denominator for edge in (*edges, *limits)))
    least = {name: floor(known.least * scale) for name, known in durations.items()}
    most = {name: ceil(known.most * scale) for name, known in durations.items()}
    leaving: dict[int, dict[PathEdge, int]] = {number: {} for number in range(len(place))}
    for edge in dict.fromkeys(edges):
        leaving[place[edge.source]][edge] = int(edge.constant * scale) + sum(least[name] for name in edge.names)

    def is_implied(edge: PathEdge) -> bool:
        first, last = place[edge.source], place[edge.target]
        weight = int(edge.constant * scale) + sum(most[name] for name in edge.names)
        longest = {first: 0}
        for number in range(first, last):
            if number in longest:
                for other, length in leaving[number].items():
                    at = place[other.target]
                    if at <= last and other != edge:
                        longest[at] = max(longest.get(at, length), longest[number] + length)
        return longest.get(last, weight - 1) >= weight

    for limit in limits:
        if not is_implied(limit):
            raise OutsideFragmentError("there is an upper bound between two points that move")
    for edge in sorted(dict.fromkeys(edges), key=lambda edge: place[edge.source] - place[edge.target]):
        if is_implied(edge):
            del leaving[place[edge.source]][edge]
    return connected([edge for edges in leaving.values() for edge in edges], known.order[0])


Edge = TypeVar("Edge", PathEdge, LatticeEdge)


def connected(edges: Sequence[Edge], root: Node = 0) -> list[Edge]:
    """Edges on paths from the root to the sink."""
    before, after = _linked(edges, SINK, root)
    return [edge for edge in edges if edge.source in after and edge.target in before]


def through(edges: Sequence[PathEdge], edge: PathEdge) -> list[PathEdge]:
    """An edge with all paths to it and from it."""
    before, after = _linked(edges, edge.source, edge.target)
    return [edge, *(e for e in edges if e.target in before or e.source in after)]


def _linked(edges: Iterable[PathEdge | LatticeEdge], end: Node, start: Node) -> tuple[set[Node], set[Node]]:
    """The nodes from which paths lead to an end, and those to which paths lead from a start; these themselves, too."""
    forth: dict[Node, list[Node]] = defaultdict(list)
    back: dict[Node, list[Node]] = defaultdict(list)
    for edge in edges:
        forth[edge.source].append(edge.target)
        back[edge.target].append(edge.source)
    return reachable(back, end), reachable(forth, start)


def chains(edges: Sequence[PathEdge]) -> list[PathEdge]:
    """Nodes with one edge in and one out are passed over."""
    known = list(edges)
    while True:
        entering: dict[Node, list[PathEdge]] = defaultdict(list)
        leaving: dict[Node, list[PathEdge]] = defaultdict(list)
        for edge in known:
            entering[edge.target].append(edge)
            leaving[edge.source].append(edge)
        node = next((node for node in entering if len(entering[node]) == len(leaving[node]) == 1), None)
        if node is None:
            return known
        (first,), (second,) = entering[node], leaving[node]
        whole = PathEdge(first.source, second.target, first.constant + second.constant, first.names + second.names)
        known = [edge for edge in known if edge is not first and edge is not second] + [whole]


# -- bounds ------------------------------------------------------------------------------------------------------------

Laws = list[LatticeEdge]


class ChainLaws:
    """Laws of edges on lattices up to the last deadline; a chain is summed on a finer lattice.

    Args:
        durations: of all names.
        latest: the greatest length that is in time.
    """

    def __init__(self, durations: Durations, latest: Fraction) -> None:
        self.durations = durations
        self.latest = latest
        self._known: dict[tuple[PathEdge, int, int, bool], Array] = {}

    def of(self, edges: Sequence[PathEdge], size: int, fine: int, *, upper: bool) -> Laws:
        """The edges with laws."""
        return [
            LatticeEdge(edge.source, edge.target, self._law(edge, size, fine, upper=upper), edge.names or None)
            for edge in edges
        ]

    def _law(self, edge: PathEdge, size: int, fine: int, *, upper: bool) -> Array:
        key = (edge, size, fine, upper)
        if key not in self._known:
            unit = self.latest / (size - 1) / fine
            first, law = 0, np.ones(1)
            for name in edge.names:
                begin, own = self.durations[name].law(unit, size * fine, upper=upper)
                law = lattice.in_full_series(law, own, size * fine, upper=upper) if len(law) > 1 else own
                first += begin
            shift = edge.constant / unit
            places = np.arange(size) * fine - first
            places = places + fine - 1 - floor(shift) if upper else places - ceil(shift)
            self._known[key] = np.where(places >= 0, law[np.clip(places, 0, len(law) - 1)], 0.0)
        return self._known[key]


class PathBounds:
    """Bounds of the probability that the longest path is in time, closer and closer.

    Args:
        edges: from 0 to the sink.
        laws: of all durations, with the greatest length that is in time.
    """

    def __init__(self, edges: Sequence[PathEdge], laws: ChainLaws) -> None:
        self._edges = chains(edges)
        self._known = laws
        self.lower, self.upper = 0.0, 1.0
        self.cells = 0
        self.passing: dict[str, float] = {}
        """With which probability a path that a duration is on is late, at most."""
        names = {name for edge in self._edges for name in edge.names}
        self._tail = sum(known.tail for known in laws.durations.values())
        self._sizes, self._fine = self._lattices([laws.durations[name].distribution for name in names])

    def _lattices(self, distributions: Sequence[Distribution]) -> tuple[Sequence[int], int]:
        """A lattice that all values are on, if there is one; else several."""
        if all(known.kind in DISCRETE for known in distributions):
            latest = self._known.latest
            values = [latest, *(edge.constant for edge in self._edges)]
            values += [value for known in distributions for value, _ in known.atoms]
            scale = lcm(*(value.denominator for value in values))
            cells = latest * scale / gcd(*(int(value * scale) for value in values)) + 1
            if cells <= SIZES[-1]:
                return (max(2, int(cells)),), 1
        return SIZES, FINE

    def _laws(self, edges: Sequence[PathEdge], size: int, *, upper: bool) -> Laws:
        return self._known.of(edges, size, self._fine, upper=upper)

    def run(self, within: float, on_bounds: Callable[[], None], deadline: Deadline, work: float = WORK) -> None:
        """Raise the lower and lower the upper bound until they are close, or no more is to be had for so much work.

        Raises:
            OutOfTimeError: if the deadline passes first; the bounds hold.
        """
        first = self._sizes[0]
        edges, spent = self._edges, 0.0
        for share in (10, 4, 2):  # a larger part of the bounds only where much stays shared
            deadline.enforce()
            numbers, spent, costs = pruned(self._laws(self._edges, first, upper=False), within / share)
            edges = [self._edges[number] for number in numbers]
            self.passing = {
                name: min(1.0, costs[number]) for number, edge in enumerate(self._edges) for name in edge.names
            }
            if not edges or len(_turned(self._laws(edges, first, upper=True))[1].shared) <= 1:
                break
        spent += self._tail
        if not edges:
            self.lower = max(0.0, 1 - spent - lattice.STEP)
            return
        self._search(edges, spent, within, on_bounds, deadline, work=work)

    def _search(
        self,
        edges: Sequence[PathEdge],
        spent: float,
        within: float,
        on_bounds: Callable[[], None],
        deadline: Deadline,
        *,
        work: float,
    ) -> None:
        """Cells on the coarsest lattice first, and from them, on a finer one."""

        def check() -> None:
            raise_if_interrupted()
            deadline.enforce()

        def tell(search: CellSearch) -> None:
            self.lower = max(self.lower, search.lower - spent - lattice.STEP)
            self.upper = min(self.upper, search.upper + lattice.STEP)
            on_bounds()

        def start(size: int, cells: Iterable[tuple[lattice.Ends, ...]] | None) -> CellSearch:
            check()
            backwards, core = _turned(self._laws(edges, size, upper=True))
            lower = lattice.reduced(_reversed(self._laws(edges, size, upper=False), backwards), upper=False)
            return CellSearch(*_with_cells(core, LongestPath(lower), self.passing), cells, check)

        enough = within * 0.97
        search = start(self._sizes[0], None)
        rounding = search.upper - search.lower - search.open
        tell(search)
        on_finer = 0
        for _ in range(ROUNDS):
            chosen: tuple[float, int, list[tuple[lattice.Ends, ...]]] | None = None
            while True:
                # On a finer lattice: what is close enough with the least work; or else what is closest.
                cells = search.current
                affordable = [size for size in self._sizes[1:] if len(cells) * size * search.width <= work]
                for size in affordable:
                    gap = search.open + rounding * self._sizes[0] / size
                    if chosen is None or (gap < chosen[0] and chosen[0] > enough):
                        chosen = gap, size, cells
                explored = search.cells * self._sizes[0] * search.width
                if search.is_done or explored > work or search.open <= within / 8:
                    break
                if chosen is not None and chosen[0] <= enough:
                    break
                check()
                search.step()
                tell(search)
            if chosen is not None and self.upper - self.lower > within:
                _, size, cells = chosen
                takes_long = len(cells) * size * search.width > WORK / 2
                for own in (size // 4, size)[not takes_long or size == self._sizes[1] :]:  # so that less is known soon
                    finer = start(own, search.on_finer(cells, own // self._sizes[0]))
                    on_finer += finer.cells
                    tell(finer)
            self.cells = search.cells + on_finer
            if self.upper - self.lower <= within or deadline.moment is None or chosen is None or work < WORK:
                return
            work *= 4


def pruned(edges: Laws, budget: float) -> tuple[list[int], float, list[float]]:
    """The numbers of edges that stay, what is to be taken off the lower bound, and what each edge would cost."""
    order, entering, leaving = lattice.ordered(edges)
    size = len(edges[0].law)
    own = [Increments(edge.law) for edge in edges]
    forward: dict[Node, Array] = {}
    backward: dict[Node, Array] = {}
    along: list[Array] = [np.ones(size)] * len(edges)
    for node in order:
        forward[node] = np.ones(size)
        for number in entering[node]:
            along[number] = lattice.lowered(own[number].convolved(forward[edges[number].source]))
            forward[node] = lattice.parallel(forward[node], along[number], upper=False)
    for node in reversed(order):
        backward[node] = np.ones(size)
        for number in leaving[node]:
            after = lattice.lowered(own[number].convolved(backward[edges[number].target]))
            backward[node] = lattice.parallel(backward[node], after, upper=False)
    reserve = 4 * size * 2.0**-52 + lattice.STEP
    costs = [
        max(0.0, 1 - float(law[::-1] @ lattice.differences(backward[edge.target]))) + reserve
        for law, edge in zip(along, edges, strict=True)
    ]
    spent, gone = 0.0, set()
    for number in sorted(range(len(edges)), key=costs.__getitem__):
        if spent + costs[number] > budget:
            break
        spent += costs[number]
        gone.add(number)
    rest = connected([edge for number, edge in enumerate(edges) if number not in gone])
    kept = {id(edge) for edge in rest}
    return [number for number, edge in enumerate(edges) if id(edge) in kept], spent, costs


def _reversed(edges: Laws, backwards: bool) -> Laws:
    return [edge._replace(source=edge.target, target=edge.source) for edge in edges] if backwards else edges


def _turned(upper: Laws) -> tuple[bool, LongestPath]:
    """Whether less is shared when paths are followed from the end; and the graph in that direction."""
    ways = [LongestPath(lattice.reduced(_reversed(upper, back), upper=True)) for back in (False, True)]
    back = len(ways[1].shared) < len(ways[0].shared)
    return back, ways[back]


def _with_cells(
    upper: LongestPath, lower: LongestPath, passing: Mapping[str, float]
) -> tuple[LongestPath, LongestPath]:
    """With cells for what is shared and matters most."""

    def cost(name: Hashable) -> float:
        return max(map(cost, name), default=0.0) if isinstance(name, tuple) else passing.get(str(name), 0.0)

    places = np.arange(upper.size)

    def merit(name: Hashable) -> tuple[float, str]:
        law = lattice.differences(upper.law[name])
        mean = float(places @ law) / max(float(law.sum()), 0.5)
        spread = max(0.0, float((places - mean) ** 2 @ law)) ** 0.5
        return -cost(name) * spread, str(name)

    cut = sorted((name for name in upper.shared if name in lower.law), key=merit)[:CUTS]
    return LongestPath(upper.edges, cut), LongestPath(lower.edges, cut)
