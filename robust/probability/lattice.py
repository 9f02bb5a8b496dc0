"""Bounds of the probability that a longest path is in time: laws on a lattice, convolved, with every rounding outwards.

A law is an array F: F[k] bounds P(X ≤ k·h) from one side. Lower laws belong to a variable on the lattice that is
stochastically at least X/h: F[k] ≤ P(X ≤ k·h). Upper laws belong to one that is at most ⌊X/h⌋: F[k] ≥ P(X < (k+1)·h).
Sums and maxima are monotone in every variable, so that lower laws of parts give lower laws of what is made of them, and
upper laws upper ones. Values of n and more are late, whatever they are, since no length is negative.

**Rounding.** After each operation a step of `STEP` = 2⁻²⁹ to the safe side covers all of its rounding: 3/5 of that
bound what convolutions are wrong by, see :mod:`robust.probability.convolution`, and a product of two numbers up to 1
is rounded by u = 2⁻⁵³. Laws of a variable in a cell are quotients of differences and wrong by 3u of their size. Sums of
n ≤ 2¹⁷ products that are 1 at most together are wrong by n·u, in whatever order they are added.

**Branches that meet.** Laws of T(v) − T(d) are kept, d the dominator of v, so that what all paths to v have in common
counts once. Branches may still share variables. From below the product of their laws is a bound all the same: they are
nondecreasing functions of independent variables, hence associated [Esary, Proschan and Walkup 1967]. From above it is
one if they share nothing. For what they share there are cells: with X in an interval, P(A ≤ s, B ≤ t) differs from
P(A ≤ s) P(B ≤ t) by the covariance of two functions of X, at most a quarter of the product of their ranges [Grüss
1935], and ranges are differences between the ends of the interval. Of branches that share what has no cells the least
of the laws is a bound.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from robust.probability.convolution import Array, Increments

STEP = 2.0**-29
"""What one operation adds to the error, with a reserve."""
BATCH = 24
"""Cells that are looked at together."""
Node = Hashable


class LatticeEdge(NamedTuple):
    """A length between two nodes with a law; `name` is that of its random variable, None if it is fixed."""

    source: Node
    target: Node
    law: Array
    name: Hashable | None


class Topology(NamedTuple):
    """Nodes in an order in which edges lead forwards, and the numbers of edges that enter and leave each."""

    order: list[Node]
    entering: dict[Node, list[int]]
    leaving: dict[Node, list[int]]


def topology(edges: Iterable[tuple[Node, Node, *tuple[Any, ...]]]) -> Topology | None:
    """Of edges that begin with source and target; None if there is a cycle."""
    entering: dict[Node, list[int]] = {}
    leaving: dict[Node, list[int]] = {}
    for number, (source, target, *_) in enumerate(edges):
        entering.setdefault(target, []).append(number)
        entering.setdefault(source, [])
        leaving.setdefault(source, []).append(number)
        leaving.setdefault(target, [])
    targets = {number: node for node, numbers in entering.items() for number in numbers}
    missing = {node: len(numbers) for node, numbers in entering.items()}
    ready = [node for node, count in missing.items() if not count]
    order = []
    while ready:
        node = ready.pop()
        order.append(node)
        for number in leaving[node]:
            target = targets[number]
            missing[target] -= 1
            if not missing[target]:
                ready.append(target)
    return Topology(order, entering, leaving) if len(order) == len(missing) else None


def ordered(edges: Iterable[tuple[Node, Node, *tuple[Any, ...]]]) -> Topology:
    """The topology of edges without a cycle."""
    known = topology(edges)
    if known is None:
        raise ValueError("a longest path needs edges without a cycle")
    return known


# -- laws --------------------------------------------------------------------------------------------------------------


def differences(law: Array) -> Array:
    """The probability of each value."""
    return np.diff(law, prepend=0.0, axis=-1)


def lowered(law: Array) -> Array:
    """A step down, and monotone again."""
    law = np.maximum.accumulate(law - STEP, axis=-1)
    return np.maximum(law, 0, out=law)


def raised(law: Array) -> Array:
    """A step up, and monotone again."""
    law = np.minimum.accumulate((law + STEP)[..., ::-1], axis=-1)[..., ::-1]
    return np.minimum(law, 1, out=law)


def in_series(first: Array, second: Array, *, upper: bool) -> Array:
    """The law of a sum."""
    return (raised if upper else lowered)(Increments(second).convolved(first))


def in_full_series(first: Array, second: Array, size: int, *, upper: bool) -> Array:
    """The law of a sum, up to the greatest or to a size; what follows the end of a law is as at its end."""
    size = min(size, len(first) + len(second) - 1)
    ended = [np.concatenate([law[:size], np.full(max(0, size - len(law)), law[-1])]) for law in (first, second)]
    return in_series(*ended, upper=upper)


def parallel(first: Array, second: Array, *, upper: bool) -> Array:
    """The law of the maximum of independent lengths: a product, which is monotone however it is rounded, and a step."""
    law = first * second
    law += STEP if upper else -STEP
    return np.minimum(law, 1, out=law) if upper else np.maximum(law, 0, out=law)


def reduced(edges: Sequence[LatticeEdge], *, upper: bool) -> list[LatticeEdge]:
    """Series and parallel edges replaced by one each; lengths must be independent."""
    known = list(edges)
    while True:
        _, entering, leaving = ordered(known)
        pair = next(_pairs(known, entering, leaving), None)
        if pair is None:
            return known
        first, second = (known[number] for number in pair)
        rest = [edge for number, edge in enumerate(known) if number not in pair]
        name = (first.name, second.name) if first.name and second.name else first.name or second.name
        if first.target == second.source:
            law = in_series(first.law, second.law, upper=upper)
            known = [*rest, LatticeEdge(first.source, second.target, law, name)]
        else:
            law = parallel(first.law, second.law, upper=upper)
            known = [*rest, LatticeEdge(first.source, first.target, law, ("or", name) if name else None)]


def _pairs(
    edges: Sequence[LatticeEdge], entering: dict[Node, list[int]], leaving: dict[Node, list[int]]
) -> Iterator[tuple[int, int]]:
    for node, numbers in entering.items():
        if len(numbers) == 1 and len(leaving[node]) == 1:
            yield numbers[0], leaving[node][0]
        sources: dict[Node, int] = {}
        for number in numbers:
            source = edges[number].source
            if source in sources:
                yield sources[source], number
            sources[source] = number


# -- longest paths -----------------------------------------------------------------------------------------------------

Ends = tuple[int, int]
"""The first and the last value of a variable in a cell."""


class _Laws(NamedTuple):
    """Of a node in cells: from below, from above, and from above with all variables that have cells at either end."""

    lower: Array
    upper: Array
    best: Array
    worst: Array
    names: frozenset[Hashable]


class LongestPath:
    """Laws of the longest path from the first node to the last, on one side, with cells for some variables.

    Args:
        edges: of a graph with one first and one last node; each name is another independent variable.
        cut: the names of variables that have cells.
    """

    def __init__(self, edges: Sequence[LatticeEdge], cut: Sequence[Hashable] = ()) -> None:
        self.edges, self.cut = list(edges), tuple(cut)
        self.size = len(edges[0].law)
        self.order, self._entering, _ = ordered(edges)
        self.law = {edge.name: edge.law for edge in edges if edge.name is not None}
        self._lengths = [Increments(edge.law) for edge in edges]
        self._dominator: dict[Node, Node] = {self.order[0]: self.order[0]}
        self._behind: dict[Node, list[frozenset[Hashable]]] = {}
        self.shared: set[Hashable] = set()
        """Variables that branches which meet have in common."""
        self._families: dict[Node, list[list[int]]] = {}
        self._sums: dict[tuple[Node, Node], _Laws] = {}
        now = np.ones((1, self.size))
        self._start = _Laws(now, now, now, now, frozenset())
        self._find_dominators()

    def _find_dominators(self) -> None:
        place = {node: number for number, node in enumerate(self.order)}
        ancestors: dict[Node, frozenset[Hashable]] = {self.order[0]: frozenset()}
        for node in self.order[1:]:
            entering = [self.edges[number] for number in self._entering[node]]
            meet = entering[0].source
            for edge in entering[1:]:
                other = edge.source
                while meet != other:
                    if place[meet] > place[other]:
                        meet = self._dominator[meet]
                    else:
                        other = self._dominator[other]
            self._dominator[node] = meet
            own = [frozenset() if edge.name is None else frozenset((edge.name,)) for edge in entering]
            behind = [
                (ancestors[edge.source] | name) - ancestors[meet] for edge, name in zip(entering, own, strict=True)
            ]
            seen: frozenset[Hashable] = frozenset()
            for names in behind:
                self.shared |= seen & names
                seen |= names
            ancestors[node] = ancestors[meet] | seen
            self._behind[node] = behind
            self._families[node] = self._disjoint([names - set(self.cut) for names in behind])

    @staticmethod
    def _disjoint(behind: Sequence[frozenset[Hashable]]) -> list[list[int]]:
        """Families of branches that share nothing without cells, each as large as it gets; every branch is in one."""
        families: dict[tuple[int, ...], None] = {}
        for first, names in enumerate(behind):
            family, used = [first], names
            for other, more in enumerate(behind):
                if other != first and not used & more:
                    family.append(other)
                    used |= more
            families[tuple(sorted(family))] = None
        return [list(family) for family in families]

    def mass(self, number: int, ends: Ends) -> float:
        """The probability of an interval of values of a variable that has cells."""
        law = self.law[self.cut[number]]
        low, high = max(0, ends[0]), min(ends[1], self.size - 1)
        return float(law[high] - (law[low - 1] if low else 0.0)) if low <= high else 0.0

    def _conditional(self, number: int, cells: Sequence[Sequence[Ends]]) -> Array:
        """The law of a variable in each cell, but for rounding."""
        law, places = self.law[self.cut[number]], np.arange(self.size)
        rows = []
        for cell in cells:
            low, high = max(0, cell[number][0]), min(cell[number][1], self.size - 1)
            before = law[low - 1] if low else 0.0
            mass = max(self.mass(number, cell[number]), STEP)
            rows.append(np.where(places < low, 0.0, np.clip((law - before) / mass, 0, 1)))
            if high < self.size:
                rows[-1][high:] = rows[-1][high]
        return np.array(rows)

    def weights(self, cells: Sequence[Sequence[Ends]]) -> list[float]:
        """The probability of each cell."""
        return [float(np.prod([self.mass(number, ends) for number, ends in enumerate(cell)])) for cell in cells]

    def bounds(self, cells: Sequence[Sequence[Ends]], *, only_lower: bool) -> tuple[Array, Array]:
        """Of the probability to be in time in each cell, conditional on it; from above only where that is asked."""
        given: dict[Hashable, tuple[Array, Array, Array]] = {}
        for number, name in enumerate(self.cut):
            low, high = (np.array([cell[number][end] for cell in cells]) for end in (0, 1))
            given[name] = self._conditional(number, cells), low, high
        laws: dict[Node, _Laws] = {}
        self._sums.clear()
        last = self.order[-1]
        for node in self.order[1:]:
            branches = [self._branch(number, laws, given, only_lower) for number in self._entering[node]]
            laws[node] = self._meeting(node, branches, only_lower)
        ends = [(laws[last].lower, laws[last].upper)]
        before = self._since(self._dominator[last], self.order[0], laws, only_lower)
        if before is not None:  # of the sum only what is in time
            ends.append((before.lower, before.upper))
        self._sums.clear()
        sums = [
            np.einsum("...k,...k->...", sides[0][..., ::-1], differences(sides[1])) if before else sides[0][..., -1]
            for sides in zip(*ends, strict=True)
        ]
        reserve = 4 * self.size * 2.0**-52 + STEP
        lower, upper = (np.broadcast_to(total, (len(cells),)) for total in sums)
        return np.clip(lower - reserve, 0, 1), np.clip(upper + reserve, 0, 1)

    def _since(self, node: Node, dominator: Node, laws: dict[Node, _Laws], only_lower: bool) -> _Laws | None:
        """Laws of the time from a dominator to a node; None if they are the same."""
        if node == dominator:
            return None
        if (node, dominator) not in self._sums:
            before = self._since(self._dominator[node], dominator, laws, only_lower)
            self._sums[node, dominator] = laws[node] if before is None else _sum(before, laws[node], only_lower)
        return self._sums[node, dominator]

    def _branch(
        self, number: int, laws: dict[Node, _Laws], given: dict[Hashable, tuple[Array, Array, Array]], only_lower: bool
    ) -> _Laws:
        """Laws of the time from the dominator of an edge's target along that edge."""
        edge = self.edges[number]
        before = self._since(edge.source, self._dominator[edge.target], laws, only_lower)
        names = frozenset[Hashable]() if before is None else before.names
        if edge.name in given:
            law, *corners = given[edge.name]
            if before is None:
                before, lower, upper = self._start, law, law
            else:
                own = Increments(law)
                lower = lowered(own.convolved(before.lower))
                upper = lower if only_lower else raised(own.convolved(before.upper))
            if only_lower:
                return _Laws(lower, lower, lower, lower, names)
            ends = _shifted(before.best, corners[0]), _shifted(before.worst, corners[1])
            return _Laws(lower, upper, *ends, names | {edge.name})
        if before is None:
            own_law = edge.law[None]
            return _Laws(own_law, own_law, own_law, own_law, names)
        length = self._lengths[number]

        def along(law: Array, finish: Callable[[Array], Array]) -> Array:
            return _shifted(law, np.array([length.first])) if length.is_fixed else finish(length.convolved(law))

        lower = along(before.lower, lowered)
        if only_lower:
            return _Laws(lower, lower, lower, lower, names)
        upper = along(before.upper, raised)
        if not names:
            return _Laws(lower, upper, upper, lower, names)
        return _Laws(lower, upper, along(before.best, raised), along(before.worst, lowered), names)

    def _meeting(self, node: Node, branches: Sequence[_Laws], only_lower: bool) -> _Laws:
        """Laws of the maximum of branches."""
        if len(branches) == 1:
            return branches[0]
        lower = branches[0].lower
        for branch in branches[1:]:
            lower = parallel(lower, branch.lower, upper=False)
        names = frozenset().union(*(branch.names for branch in branches))
        if only_lower:
            return _Laws(lower, lower, lower, lower, names)
        upper = best = np.ones((1, self.size))
        for family in self._families[node]:
            joint, *others = (branches[number] for number in family)
            for branch in others:
                joint = _joint(joint, branch)
            upper, best = np.minimum(upper, joint.upper), np.minimum(best, joint.best)
        if not names:
            return _Laws(lower, upper, upper, lower, names)
        worst = branches[0].worst
        for branch in branches[1:]:
            worst = parallel(worst, branch.worst, upper=False)
        return _Laws(lower, upper, best, worst, names)


def _sum(first: _Laws, second: _Laws, only_lower: bool) -> _Laws:
    """Of two times that share nothing."""

    def along(law: Array, other: Array) -> Array:
        return Increments(other).convolved(law)

    lower = lowered(along(first.lower, second.lower))
    if only_lower:
        return first._replace(lower=lower)
    upper = raised(along(first.upper, second.upper))
    names = first.names | second.names
    if not names:
        return _Laws(lower, upper, upper, lower, names)
    return _Laws(lower, upper, raised(along(first.best, second.best)), lowered(along(first.worst, second.worst)), names)


def _joint(first: _Laws, second: _Laws) -> _Laws:
    """The maximum of two branches that share nothing but what has cells [Grüss 1935]."""
    upper = first.upper * second.upper
    if first.names & second.names:
        ranges = [np.maximum(branch.best - branch.worst, 0) for branch in (first, second)]
        upper = np.minimum(upper + 0.25 * ranges[0] * ranges[1], np.minimum(first.upper, second.upper))
    best = parallel(first.best, second.best, upper=True)
    worst = parallel(first.worst, second.worst, upper=False)
    upper = np.minimum(raised(upper), best)
    return _Laws(first.lower, upper, best, worst, first.names | second.names)


def _shifted(law: Array, places: npt.NDArray[np.int64] | Array) -> Array:
    """The law plus a fixed number, one for all cells or one for each."""
    size = law.shape[-1]
    count = max(len(places), len(law))
    moved = np.zeros((count, size))
    for row in range(count):
        place = min(size, int(places[row if len(places) > 1 else 0]))
        moved[row, place:] = law[row if len(law) > 1 else 0, : size - place]
    return moved


# -- cells -------------------------------------------------------------------------------------------------------------


class CellSearch:
    """Bounds that become narrower with each step: the cells in which they are farthest apart are halved.

    Args:
        upper: with upper laws.
        lower: with lower laws, and cells for the same variables; the same cells are moved to where its laws are.
        cells: to begin with; all values in one if not given.
        check: called now and then, to raise what ends the search.
    """

    def __init__(
        self,
        upper: LongestPath,
        lower: LongestPath,
        cells: Iterable[tuple[Ends, ...]] | None = None,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self._upper, self._lower = upper, lower
        self._whole = [(0, upper.size - 1)] * len(upper.cut)
        self._moves = [
            round(float((upper.law[name] - lower.law[name]).sum()) / max(float(upper.law[name][-1]), 0.5))
            for name in upper.cut
        ]
        supports = (self._support(number, ends) for number, ends in enumerate(self._whole))
        self._widths = [max(1, last - first) for first, last in supports]
        self.cells = 0
        """How many cells were looked at."""
        self._heap: list[tuple[float, int, tuple[Ends, ...], float, float]] = []
        self.lower = self.upper = 0.0
        begin = [tuple(self._whole)] if cells is None else list(cells)
        for first in range(0, len(begin), BATCH):
            check()
            self._add(begin[first : first + BATCH])
        self._gain = [1.0] * len(self._whole)
        if cells is None:
            self._learn()

    @property
    def current(self) -> list[tuple[Ends, ...]]:
        """The cells into which the values are divided."""
        return [entry[2] for entry in sorted(self._heap)]

    @property
    def width(self) -> int:
        """Laws that are computed for each cell, about."""
        return 4 * sum(edge.name is not None for edge in self._upper.edges)

    @property
    def is_done(self) -> bool:
        """Whether cells cannot bring the bounds closer."""
        return not self._heap or self._heap[0][0] >= 0 or not self._whole

    @property
    def open(self) -> float:
        """By how much smaller cells may bring the bounds closer, at most."""
        return -sum(entry[0] for entry in self._heap)

    def on_finer(self, cells: Iterable[tuple[Ends, ...]], factor: int) -> Iterator[tuple[Ends, ...]]:
        """Cells of this search, on a lattice that is finer by a factor."""
        for cell in cells:
            yield tuple((low * factor, (high + 1) * factor - 1) for low, high in cell)

    def _support(self, number: int, ends: Ends) -> Ends:
        """The part of an interval outside of which the variable has no probability; its first value if it has none."""
        law = self._upper.law[self._upper.cut[number]]
        rising = np.flatnonzero(differences(law)[ends[0] : ends[1] + 1] > 0)
        return (ends[0] + int(rising[0]), ends[0] + int(rising[-1])) if len(rising) else (ends[0], ends[0])

    def _moved(self, cell: Sequence[Ends]) -> tuple[Ends, ...]:
        """A cell for the lower laws: all values are in one, as they are for the upper laws."""
        moved = []
        for (low, high), move in zip(cell, self._moves, strict=True):
            last = self._upper.size - 1
            moved.append((low + move if low else 0, last if high == last else high + move))
        return tuple(moved)

    def _add(self, cells: Sequence[tuple[Ends, ...]]) -> list[tuple[float, float]]:
        """Look at cells; their parts of the bounds."""
        inner = [tuple(self._support(number, ends) for number, ends in enumerate(cell)) for cell in cells]
        least, most = self._upper.bounds(inner, only_lower=False)
        weights = self._upper.weights(inner)
        moved = [self._moved(cell) for cell in cells]
        certain, _ = self._lower.bounds(moved, only_lower=True)
        parts = []
        for number, (cell, weight, mass) in enumerate(zip(cells, weights, self._lower.weights(moved), strict=True)):
            self.cells += 1
            gap = weight * max(0.0, float(most[number] - least[number]))
            lower = max(0.0, mass * float(certain[number]) - STEP)
            upper = weight * float(most[number]) + STEP
            heappush(self._heap, (-gap, self.cells, cell, lower, upper))
            self.lower, self.upper = self.lower + lower, self.upper + upper
            parts.append((lower, upper))
        return parts

    def _halves(self, cell: tuple[Ends, ...], number: int) -> list[tuple[Ends, ...]]:
        low, high = cell[number]
        law = self._upper.law[self._upper.cut[number]]
        before = float(law[low - 1]) if low else 0.0
        middle = min(int(np.searchsorted(law, (before + float(law[high])) / 2)), high - 1)
        middle = max(low, middle)
        return [(*cell[:number], ends, *cell[number + 1 :]) for ends in ((low, middle), (middle + 1, high))]

    def _learn(self) -> None:
        """How much each variable's halves would bring, seen from the whole."""
        if len(self._whole) < 2 or len(self._heap) != 1:
            return
        cell, gap = self._heap[0][2], -self._heap[0][0]
        for number in range(len(cell)):
            if self._widths[number] > 1:
                halves = self._halves(cell, number)
                least, most = self._upper.bounds(halves, only_lower=False)
                weights = self._upper.weights(halves)
                left = sum(weight * float(gap_) for weight, gap_ in zip(weights, most - least, strict=True))
                self._gain[number] = max(1e-9, gap - left)

    def step(self) -> None:
        """Halve the cells with the widest bounds."""
        cells: list[tuple[Ends, ...]] = []
        gone = [0.0, 0.0]
        kept = []
        while self._heap and len(cells) < 2 * BATCH and self._heap[0][0] < 0:
            entry = heappop(self._heap)
            _, made, cell, lower, upper = entry
            inner = [self._support(number, ends) for number, ends in enumerate(cell)]
            reach = [
                gain * ((last - first) / width) ** 2
                for gain, (first, last), width in zip(self._gain, inner, self._widths, strict=True)
            ]
            axis = max(range(len(cell)), key=reach.__getitem__)
            if not reach[axis]:
                kept.append((0.0, made, cell, lower, upper))
                continue
            cells += self._halves(cell, axis)
            gone = [gone[0] + lower, gone[1] + upper]
        self.lower, self.upper = self.lower - gone[0], self.upper - gone[1]
        for entry in kept:
            heappush(self._heap, entry)
        if cells:
            self._add(cells)
