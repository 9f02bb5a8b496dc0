"""Layered layouts of graphs, left to right: columns by longest paths, few crossings, edges as straight as they can be.

Lengths are inches, as floats.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, TypeAlias, TypeVar

import networkx

N = TypeVar("N", bound=Hashable)
Point: TypeAlias = tuple[float, float]

_SWEEPS = 12
_BEND = 0.14
"""Half of the height that an edge takes where it passes a column."""

GAP = 0.3
"""Between columns, at least."""


@dataclass(frozen=True, slots=True)
class Placement(Generic[N]):
    """Where nodes are, and through which points each edge goes, in the order in which edges were given."""

    places: Mapping[N, Point]
    routes: tuple[tuple[Point, ...], ...]


def layered(
    sizes: Mapping[N, tuple[float, float]],
    edges: Sequence[tuple[N, N]],
    labels: Sequence[float],
    *,
    late: Collection[N] = (),
) -> Placement[N]:
    """Place nodes of the given widths and heights in columns, with room after each for the labels of its edges.

    Edges that close a cycle are allowed, and drawn straight.

    Args:
        late: nodes to which no edge leads, which are placed in the column before that of the first one they lead to.
    """
    return _Layering(sizes, edges, labels, late).layout()


class _Layering(Generic[N]):
    """Nodes are numbers here; those after the given ones are bends of long edges."""

    def __init__(
        self,
        sizes: Mapping[N, tuple[float, float]],
        edges: Sequence[tuple[N, N]],
        labels: Sequence[float],
        late: Collection[N],
    ) -> None:
        self._names = list(sizes)
        number = {name: at for at, name in enumerate(self._names)}
        self._edges = [(number[source], number[target]) for source, target in edges]
        self._labels = labels
        self._widths = [width for width, _ in sizes.values()]
        self._halves = [height / 2 for _, height in sizes.values()]
        self._columns = columns_of(len(self._names), self._edges)
        for source in map(number.__getitem__, late):
            self._columns[source] = min(self._columns[target] for node, target in self._edges if node == source) - 1
        self._before: list[list[int]] = [[] for _ in self._names]
        self._after: list[list[int]] = [[] for _ in self._names]
        self._chains = [self._chain(source, target) for source, target in self._edges]
        self._layers: list[list[int]] = [[] for _ in range(max(self._columns, default=-1) + 1)]
        for node, column in enumerate(self._columns):
            self._layers[column].append(node)

    def layout(self) -> Placement[N]:
        self._sort()
        horizontal = self._horizontal()
        vertical = self._vertical()
        points = [(horizontal[column], vertical[node]) for node, column in enumerate(self._columns)]
        return Placement(
            {name: points[node] for node, name in enumerate(self._names)},
            tuple(tuple(points[node] for node in chain) for chain in self._chains),
        )

    def _chain(self, source: int, target: int) -> list[int]:
        """The nodes of an edge, with a bend in each column that it passes."""
        chain = [source]
        for column in range(self._columns[source] + 1, self._columns[target]):
            chain.append(len(self._columns))
            self._columns.append(column)
            self._widths.append(0.0)
            self._halves.append(_BEND)
            self._before.append([])
            self._after.append([])
        chain.append(target)
        if self._columns[source] < self._columns[target]:
            for node, other in pairwise(chain):
                self._after[node].append(other)
                self._before[other].append(node)
        return chain

    def _sort(self) -> None:
        """Order each column by the mean place of the neighbours in the column before, then after, and again."""
        for sweep in range(_SWEEPS):
            forward = sweep % 2 == 0
            neighbours = self._before if forward else self._after
            for layer in self._layers if forward else reversed(self._layers):
                place = {node: at / max(1, len(layer) - 1) for layer in self._layers for at, node in enumerate(layer)}
                layer.sort(key=lambda node: _mean((place[neighbour] for neighbour in neighbours[node]), place[node]))

    def _horizontal(self) -> list[float]:
        """The middle of each column."""
        gaps = [GAP] * len(self._layers)
        for (source, _), room in zip(self._edges, self._labels, strict=True):
            gaps[self._columns[source]] = max(gaps[self._columns[source]], room)
        middles, edge = [], 0.0
        for layer, gap in zip(self._layers, gaps, strict=True):
            width = max(self._widths[node] for node in layer)
            middles.append(edge + width / 2)
            edge += width + gap
        return middles

    def _vertical(self) -> list[float]:
        """Each node as near to the mean of its neighbours as order and heights allow."""
        heights = [0.0] * len(self._columns)
        for layer in self._layers:
            self._place(layer, heights, dict.fromkeys(layer, 0.0))
        for sweep in range(_SWEEPS):
            neighbours = self._before if sweep % 2 == 0 else self._after
            for layer in self._layers if sweep % 2 == 0 else reversed(self._layers):
                wanted = {
                    node: _mean((heights[neighbour] for neighbour in neighbours[node]), heights[node]) for node in layer
                }
                self._place(layer, heights, wanted)
        return [-height for height in heights]

    def _place(self, layer: Sequence[int], heights: list[float], wanted: Mapping[int, float]) -> None:
        """The heights nearest to the wanted ones, in the sense of least squares, that keep order and distances."""
        offset, offsets = 0.0, []
        for at, node in enumerate(layer):
            offset += self._halves[layer[at - 1]] + self._halves[node] if at else 0.0
            offsets.append(offset)
        # Without the offsets, what is asked for is the nearest sequence that does not decrease: pool its violators.
        blocks: list[tuple[float, int]] = []
        for node, offset in zip(layer, offsets, strict=True):
            total, count = wanted[node] - offset, 1
            while blocks and blocks[-1][0] / blocks[-1][1] > total / count:
                before, many = blocks.pop()
                total, count = total + before, count + many
            blocks.append((total, count))
        levels = [total / count for total, count in blocks for _ in range(count)]
        for node, offset, level in zip(layer, offsets, levels, strict=True):
            heights[node] = level + offset


def columns_of(count: int, edges: Iterable[tuple[int, int]]) -> list[int]:
    """The longest path to each node; on a cycle, edges to earlier nodes do not count."""
    graph = networkx.DiGraph(edges)
    graph.add_nodes_from(range(count))
    for members in list(networkx.strongly_connected_components(graph)):
        graph.remove_edges_from([(source, other) for source, other in graph.subgraph(members).edges if other <= source])
    columns = [0] * count
    for column, nodes in enumerate(networkx.topological_generations(graph)):
        for node in nodes:
            columns[node] = column
    return columns


def _mean(values: Iterable[float], default: float) -> float:
    known = list(values)
    return sum(known) / len(known) if known else default
