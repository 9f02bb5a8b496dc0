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

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from robust.execute.distances import DistanceEdge, Original, TruthWrite, edge
from robust.plan import model


def esterel_edges(original: Original) -> tuple[DistanceEdge, ...]:
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
        nodes = [_Node(point, instance) for instance in original.plan.instances for point in instance.time_points]
        self.nodes = sorted(nodes, key=lambda node: (original.times[node.point], not node.is_end))

    def edges(self) -> Iterator[DistanceEdge]:
        for index, node in enumerate(self.nodes):
            if node.is_end:
                duration = self.original.distance(node.instance.start, node.point)
                yield DistanceEdge(node.instance.start, node.point, duration)
                yield DistanceEdge(node.point, node.instance.start, -duration)
            causes = [*self._supporters(node), *self._contradicted(node, self.nodes[:index]), *self._deadlines(node)]
            if not causes:
                causes = [self._after(model.ZERO, node.point)]
            yield from causes

    def _after(self, source: model.TimePoint, target: model.TimePoint) -> DistanceEdge:
        """`target` follows `source`, by ε unless the plan itself is quicker."""
        return edge(source, target, min(self.original.gap, self.original.distance(source, target)))

    # -- supporters ------------------------------------------------------------------------------------------------

    def _supporters(self, node: _Node) -> Iterator[DistanceEdge]:
        """From what a node needs; conditions over all count from its start on."""
        for part in _parts(node, node.instance.start):
            for leaf in self._holding(node, part):
                supporter = self._most_recent(leaf, node.point, part.timing is model.Timing.OVER_ALL)
                if supporter is not None and supporter != node.point:
                    yield self._after(supporter, node.point)

    def _holding(self, node: _Node, part: model.TimedCondition) -> Iterator[model.Leaf]:
        """The literals of a condition that hold when the node happens, or right after it."""
        execution = self.original.execution
        time = self.original.times[node.point]
        happening = next(candidate for candidate in execution.happenings if candidate.time == time)
        state = happening.after if part.timing is model.Timing.OVER_ALL else happening.before
        reading = execution.reading(state, node.instance)
        return (leaf for leaf in model.leaves(part.condition) if reading.leaf(leaf))

    def _most_recent(self, leaf: model.Leaf, point: model.TimePoint, over_all: bool) -> model.TimePoint | None:
        """The last change before the time point that makes the literal true; for over-all ones also at its time."""
        times, limit = self.original.times, self.original.times[point]
        changes: list[model.TimePoint] = []
        if isinstance(leaf, model.Holds):
            changes = [write.point for write in self.original.writes(leaf.atom) if write.value is leaf.value]
        elif isinstance(leaf, model.NumericCondition):
            changes = [change for fluent in _fluents(leaf) for change in self._changes(fluent)]
        past = [change for change in changes if times[change] < limit or (over_all and times[change] == limit)]
        latest = max((times[moment] for moment in past), default=limit)
        candidates = [moment for moment in past if times[moment] == latest]
        return point if point in candidates else next(iter(candidates), None)

    def _changes(self, fluent: model.Fluent) -> Iterator[model.TimePoint]:
        for instance in self.original.plan.instances:
            yield from (instance.at(effect.timing) for effect in instance.numeric_effects if effect.fluent == fluent)
            if any(effect.fluent == fluent for effect in instance.continuous_effects):
                yield from (instance.start, instance.end)
        yield from (literal.point for literal in self.original.plan.timed_literals if literal.target == fluent)

    # -- contradictions --------------------------------------------------------------------------------------------

    def _contradicted(self, node: _Node, earlier: list[_Node]) -> Iterator[DistanceEdge]:
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
        fluents = {numeric.fluent for numeric in instance.numeric_effects if instance.at(numeric.timing) == node.point}
        return atoms, fluents | {numeric.fluent for numeric in instance.continuous_effects}

    def _contradicts(self, atoms: dict[model.Atom, bool], fluents: set[model.Fluent], other: _Node) -> bool:
        """Whether effects contradict another node's effects, its conditions or, for an end, the over-all ones."""
        written, _ = self._effects(other)
        if any(atoms.get(atom, value) is not value for atom, value in written.items()):
            return True
        parts = _parts(other, other.instance.end)
        for leaf in (leaf for part in parts for leaf in model.leaves(part.condition)):
            if isinstance(leaf, model.Holds) and atoms.get(leaf.atom, leaf.value) is not leaf.value:
                return True
            if isinstance(leaf, model.NumericCondition) and not fluents.isdisjoint(_fluents(leaf)):
                return True
        mentioned = {name for name, point in other.instance.mentioned() if point == other.point}
        return not mentioned.isdisjoint(atoms.keys() | fluents)

    # -- timed literals --------------------------------------------------------------------------------------------

    def _deadlines(self, node: _Node) -> Iterator[DistanceEdge]:
        """Later timed literals that would break a condition: those of over-all conditions are for the end to meet."""
        time = self.original.times[node.point]
        for part in _parts(node, node.instance.end):
            over_all = part.timing is model.Timing.OVER_ALL
            for leaf in model.leaves(part.condition):
                writes = self.original.writes(leaf.atom) if isinstance(leaf, model.Holds) else ()
                breaking = next((write for write in writes if self._breaks(write, leaf, time, over_all)), None)
                if breaking is not None:
                    yield edge(node.point, breaking.point, Fraction(0) if over_all else self.original.gap)
                    yield self._after(model.ZERO, node.point)

    def _breaks(self, write: TruthWrite, leaf: model.Leaf, time: Fraction, over_all: bool) -> bool:
        contrary = isinstance(leaf, model.Holds) and write.value is not leaf.value
        later = write.time > time or (over_all and write.time == time)
        return write.point.time is not None and contrary and later


def _parts(node: _Node, over_all: model.TimePoint) -> Iterator[model.TimedCondition]:
    """The conditions that belong to a node; those over all belong to `over_all`, the start or the end."""
    for part in node.instance.conditions:
        point = over_all if part.timing is model.Timing.OVER_ALL else node.instance.at(part.timing)
        if point == node.point:
            yield part


def _fluents(condition: model.Condition) -> set[model.Fluent]:
    return {fluent for comparison in model.comparisons(condition) for fluent in model.fluents_in(comparison.expression)}
