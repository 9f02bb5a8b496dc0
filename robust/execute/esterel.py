"""Conversion as the plans of the paper were made: by the Esterel transformer [IRR §3, Figure 1].

The nodes (starts, ends, instantaneous actions) are visited in order of time. An end follows its start by the
duration. A node follows the most recent supporter of each of its conditions, and every earlier node that its effects
contradict; a timed literal that will break a condition is a deadline for it. A node without any of these follows
zero.

Where the recorded networks do not show what the transformer does, this is what is done here:

- A disjunctive condition counts by all of its literals that hold in the schedule; a comparison is supported by the most
  recent change of each of its fluents, and changes of a fluent contradict comparisons with it.
- Edges are [ε, ∞), but never so long that they exclude the plan itself: an over-all condition may hold from the very
  moment on that it begins to matter, and a plan may begin before ε.
- A condition at a start or an end is ε before a timed literal that would break it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.distances import Edge, Original, edge
from robust.plan import model


def esterel_edges(original: Original) -> tuple[Edge, ...]:
    """The network of the transformer as lower bounds; the original schedule satisfies all of them."""
    return tuple(_Transformer(original).edges())


@dataclass(frozen=True, slots=True)
class _Node:
    point: model.TimePoint
    instance: model.ActionInstance

    @property
    def is_end(self) -> bool:
        return self.point.kind is model.TimePointKind.END


class _Transformer:
    def __init__(self, original: Original) -> None:
        self.original = original
        nodes = [_Node(point, one) for one in original.plan.instances for point in one.time_points]
        self.nodes = sorted(nodes, key=lambda node: (original.times[node.point], not node.is_end))

    def edges(self) -> Iterator[Edge]:
        for index, node in enumerate(self.nodes):
            if node.is_end:
                duration = self.original.distance(node.instance.start, node.point)
                yield Edge(node.instance.start, node.point, duration)
                yield Edge(node.point, node.instance.start, -duration)
            causes = [*self._supporters(node), *self._contradicted(node, self.nodes[:index]), *self._deadlines(node)]
            if not causes:
                causes = [self._after(model.ZERO, node.point)]
            yield from causes

    def _after(self, source: model.TimePoint, target: model.TimePoint) -> Edge:
        """`target` follows `source`, by ε unless the plan itself is quicker."""
        return edge(source, target, min(self.original.epsilon, self.original.distance(source, target)))

    # -- supporters ------------------------------------------------------------------------------------------------

    def _supporters(self, node: _Node) -> Iterator[Edge]:
        for leaf, over_all in self._literals(node):
            supporter = self._most_recent(leaf, node.point, over_all)
            if supporter is None or supporter == node.point:
                continue
            yield self._after(supporter, node.point)

    def _literals(self, node: _Node) -> Iterator[tuple[model.Leaf, bool]]:
        """What the node needs, and whether from then on: over-all conditions belong to the start."""
        for part in node.instance.conditions:
            over_all = part.timing is model.Timing.OVER_ALL
            if (node.instance.start if over_all else node.instance.at(part.timing)) != node.point:
                continue
            for leaf in self._holding(node, part):
                yield leaf, over_all

    def _holding(self, node: _Node, part: model.TimedCondition) -> Iterator[model.Leaf]:
        """The literals of a condition that hold when the node happens, or right after it."""
        execution = self.original.execution
        time = self.original.times[node.point]
        happening = next(one for one in execution.happenings if one.time == time)
        state = happening.after if part.timing is model.Timing.OVER_ALL else happening.before
        reading = execution.reading(state, node.instance)
        return (leaf for leaf in model.leaves(part.condition) if reading.leaf(leaf))

    def _most_recent(self, leaf: model.Leaf, point: model.TimePoint, over_all: bool) -> model.TimePoint | None:
        """The last change before the time point that makes the literal true; for over-all ones also at its time."""
        limit = self.original.times[point]
        if isinstance(leaf, model.Holds):
            changes = [(one.time, one.point) for one in self.original.writes(leaf.atom) if one.value is leaf.value]
        elif isinstance(leaf, model.Comparison):
            changes = [change for fluent in _fluents(leaf) for change in self._changes(fluent)]
        else:
            changes = []
        past = [(time, one) for time, one in changes if time < limit or (over_all and time == limit)]
        if not past:
            return None
        latest = max(time for time, _ in past)
        candidates = [one for time, one in past if time == latest]
        return point if point in candidates else candidates[0]

    def _changes(self, fluent: model.Fluent) -> Iterator[tuple[Fraction, model.TimePoint]]:
        times = self.original.times
        for instance in self.original.plan.instances:
            for effect in instance.numeric_effects:
                if effect.fluent == fluent:
                    yield times[instance.at(effect.timing)], instance.at(effect.timing)
            if any(effect.fluent == fluent for effect in instance.continuous_effects):
                yield times[instance.start], instance.start
                yield times[instance.end], instance.end
        for literal in self.original.plan.timed_literals:
            if literal.target == fluent:
                yield literal.time, literal.point

    # -- contradictions --------------------------------------------------------------------------------------------

    def _contradicted(self, node: _Node, earlier: list[_Node]) -> Iterator[Edge]:
        atoms, fluents = self._effects(node)
        for other in earlier:
            if other.instance is not node.instance and self._contradicts(atoms, fluents, other):
                yield self._after(other.point, node.point)

    def _effects(self, node: _Node) -> tuple[dict[model.Atom, bool], set[model.Fluent]]:
        """The atoms that a node writes (an add wins over a delete), and the fluents that it changes."""
        atoms: dict[model.Atom, bool] = {}
        instance = node.instance
        for effect in instance.atom_effects:
            if instance.at(effect.timing) == node.point:
                atoms[effect.atom] = atoms.get(effect.atom, False) or effect.value
        fluents = {one.fluent for one in instance.numeric_effects if instance.at(one.timing) == node.point}
        return atoms, fluents | {one.fluent for one in instance.continuous_effects}

    def _contradicts(self, atoms: dict[model.Atom, bool], fluents: set[model.Fluent], other: _Node) -> bool:
        """Whether effects contradict another node's effects, its conditions or, for an end, the over-all ones."""
        written, _ = self._effects(other)
        if any(atoms.get(atom, value) is not value for atom, value in written.items()):
            return True
        for leaf in _conditions(other):
            if isinstance(leaf, model.Holds) and atoms.get(leaf.atom, leaf.value) is not leaf.value:
                return True
            if isinstance(leaf, model.Comparison) and not fluents.isdisjoint(_fluents(leaf)):
                return True
        return False

    # -- timed literals --------------------------------------------------------------------------------------------

    def _deadlines(self, node: _Node) -> Iterator[Edge]:
        """Later timed literals that would break a condition: those of over-all conditions are for the end to meet."""
        for part in node.instance.conditions:
            point = node.instance.end if part.timing is model.Timing.OVER_ALL else node.instance.at(part.timing)
            if point != node.point:
                continue
            for leaf in model.leaves(part.condition):
                breaking = self._breaking(leaf, point, part.timing is model.Timing.OVER_ALL)
                if breaking:
                    separation = Fraction(0) if part.timing is model.Timing.OVER_ALL else self.original.epsilon
                    yield edge(point, min(breaking, key=self.original.times.__getitem__), separation)
                    yield self._after(model.ZERO, point)

    def _breaking(self, leaf: model.Leaf, point: model.TimePoint, over_all: bool) -> list[model.TimePoint]:
        if not isinstance(leaf, model.Holds):
            return []
        time = self.original.times[point]
        return [
            one.point
            for one in self.original.writes(leaf.atom)
            if one.point.time is not None
            and one.value is not leaf.value
            and (one.time > time or (over_all and one.time == time))
        ]


def _conditions(node: _Node) -> Iterator[model.Leaf]:
    """The literals of the conditions that belong to a node; for an end, the over-all ones too."""
    for part in node.instance.conditions:
        over_all = part.timing is model.Timing.OVER_ALL
        if node.is_end if over_all else node.instance.at(part.timing) == node.point:
            yield from model.leaves(part.condition)


def _fluents(condition: model.Condition) -> set[model.Fluent]:
    return {fluent for one in model.comparisons(condition) for fluent in model.fluents_in(one.expression)}
