"""Networks of differences between times whose bounds are linear in parameters: when do they have a solution?

By elimination of the times, one after the other, each path through an event becomes an edge past it. What is left are
the cycles, each of which must not be negative: linear inequalities of the parameters. Edges between two events of
which one is never tighter within the parameters' bounds are dropped as they come up; what cycles say about single
parameters narrows these bounds on the way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, product
from math import lcm
from typing import NamedTuple

from robust.network.differences import Elimination
from robust.plan.model import Parameter
from robust.qe.constraint import LinearConstraint
from robust.smt.limits import NEVER, Deadline

Range = tuple[Fraction | int | None, Fraction | int | None]


class ParametricEdge(NamedTuple):
    """`t(target) − t(source) ≤ constant + Σ factor · parameter`, or < if it is strict."""

    source: str
    target: str
    constant: Fraction
    factors: Mapping[str, int]
    strict: bool
    origin: int
    """What says so, for whoever asks which statements a cycle is made of."""


@dataclass(frozen=True, slots=True)
class CycleCondition:
    """An inequality that the parameters must satisfy, and the origins of the edges that it comes from."""

    constraint: LinearConstraint
    origins: tuple[int, ...]


class _Weight(NamedTuple):
    """A bound in integers: the constant first, then a factor for each parameter."""

    form: tuple[int, ...]
    strict: bool
    origins: tuple[int, ...]

    def then(self, other: _Weight) -> _Weight:
        """Of a path along both edges."""
        form = tuple([a + b for a, b in zip(self.form, other.form, strict=True)])
        return _Weight(form, self.strict or other.strict, self.origins + other.origins)


class _ParametricElimination(Elimination[list[_Weight]]):
    """Edges by both ends; of several between two events, those that are the tightest somewhere."""

    def __init__(self, size: int, ranges: list[Range]) -> None:
        super().__init__(size)
        self.ranges = ranges
        self.cycles: list[_Weight] = []
        self.ends: dict[tuple[int, bool], _Weight] = {}
        """The cycles that `ranges` come from, by the parameter and whether it is the lower end."""

    def put(self, source: int, target: int, weight: _Weight) -> None:
        """Add an edge, or a cycle."""
        if source != target:
            self._keep(self.after[source].get(target) or self.connect(source, target, []), weight)
        elif not self._never_below_zero(weight) and not self._tighten(weight):
            self._keep(self.cycles, weight)

    def join(self, source: int, first: list[_Weight], node: int, second: list[_Weight], target: int) -> None:
        for weight, other in product(first, second):
            self.put(source, target, weight.then(other))

    def _keep(self, edges: list[_Weight], weight: _Weight) -> None:
        if any(self._implies(one, weight) for one in edges):
            return
        edges[:] = [one for one in edges if not self._implies(weight, one)]
        edges.append(weight)

    def _tighten(self, cycle: _Weight) -> bool:
        """Whether a cycle is about one parameter alone: then it makes all later comparisons stronger."""
        told = [(at, factor) for at, factor in enumerate(cycle.form[1:]) if factor]
        if len(told) != 1:
            return False
        [(at, factor)] = told
        lower, upper = self.ranges[at]
        end = Fraction(-cycle.form[0], factor)
        if factor > 0:
            self.ranges[at] = (end if lower is None else max(lower, end), upper)
        else:
            self.ranges[at] = (lower, end if upper is None else min(upper, end))
        self.ends[at, factor > 0] = cycle
        return True

    def cost(self, event: int) -> int:
        """How many edges eliminating an event makes, about."""
        return sum(map(len, self.before[event].values())) * sum(map(len, self.after[event].values()))

    def _implies(self, one: _Weight, other: _Weight) -> bool:
        """Whether the first bound is at least as tight as the second wherever the parameters may be."""
        greatest = self._greatest([a - b for a, b in zip(one.form, other.form, strict=True)])
        return greatest is not None and (greatest < 0 or (greatest == 0 and (one.strict or not other.strict)))

    def _never_below_zero(self, cycle: _Weight) -> bool:
        greatest = self._greatest([-factor for factor in cycle.form])
        return greatest is not None and (greatest < 0 or (greatest == 0 and not cycle.strict))

    def _greatest(self, form: Sequence[int]) -> Fraction | int | None:
        """The greatest value of a form within the parameters' bounds; None if there is none."""
        total: Fraction | int = form[0]
        for factor, (lower, upper) in zip(form[1:], self.ranges, strict=True):
            if factor:
                end = upper if factor > 0 else lower
                if end is None:
                    return None
                total += factor * end
        return total


def cycles(
    edges: Iterable[ParametricEdge], parameters: Sequence[Parameter], deadline: Deadline = NEVER
) -> tuple[CycleCondition, ...]:
    """The inequalities over the parameters, within their bounds, under which the network has a solution.

    Those that hold throughout the bounds are left out; one that never holds is `0 ≤ −1`.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    edges = list(edges)
    limits = [end for one in parameters for end in (one.lower, one.upper) if end is not None]
    unit = lcm(*(number.denominator for number in (*(edge.constant for edge in edges), *limits)))

    def scaled(end: Fraction | None) -> int | None:
        return None if end is None else int(end * unit)

    same = _representatives(edges)
    ends = [(same.get(edge.source, edge.source), same.get(edge.target, edge.target)) for edge in edges]
    numbers = {event: number for number, event in enumerate(dict.fromkeys(chain(*ends)))}
    graph = _ParametricElimination(len(numbers), [(scaled(one.lower), scaled(one.upper)) for one in parameters])
    for edge, (source, target) in zip(edges, ends, strict=True):
        form = (int(edge.constant * unit), *(edge.factors.get(one.name, 0) for one in parameters))
        graph.put(numbers[source], numbers[target], _Weight(form, edge.strict, (edge.origin,)))
    while graph.remaining:
        deadline.enforce()
        graph.eliminate(min(graph.remaining, key=graph.cost))
    return tuple(_cycle(found, parameters, unit) for found in (*graph.ends.values(), *graph.cycles))


def _representatives(edges: Iterable[ParametricEdge]) -> dict[str, str]:
    """For each event that is at the same time as another, one for all of those."""
    at_most = {
        (edge.source, edge.target) for edge in edges if not (edge.constant or edge.strict or any(edge.factors.values()))
    }
    groups: dict[str, list[str]] = {}
    for one, other in at_most:
        if one < other and (other, one) in at_most:
            first, second = groups.setdefault(one, [one]), groups.setdefault(other, [other])
            if first is not second:
                first += second
                groups.update(dict.fromkeys(second, first))
    return {name: group[0] for name, group in groups.items()}


def _cycle(found: _Weight, parameters: Sequence[Parameter], unit: int) -> CycleCondition:
    """With scaled parameters and scaled constant, factors are as they were."""
    factors = {one.name: factor for one, factor in zip(parameters, found.form[1:], strict=True)}
    constraint = LinearConstraint.of(factors, ">" if found.strict else ">=", -Fraction(found.form[0], unit))
    return CycleCondition(constraint, tuple(dict.fromkeys(found.origins)))
