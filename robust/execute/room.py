"""Room first: a network that takes nothing from the parameters, and then as loose as their box allows.

Conditions over numbers may ask for distances in time. A distance that gives way keeps as much from a parameter: whoever
may charge for 15 minutes instead of the planned 20 has less battery for a drive that lasts longer. So parameters come
first. All networks here keep the causal orders and allow the plan's own schedule:

- the loosest has nothing else;
- orders: also those that the Esterel transformer reads off changes of fluents;
- ties: each start also follows what it waits for in the plan (the predecessor with least slack, the end of a parameter
  first) by the plan's own distance.

The box to keep is the widest box of orders or of ties, whichever has more room, or that of the loosest network if it
contains it. Then the loosest network gets, one by one, the edges that counterexamples in this box ask for, loses those
that it can do without, and the distances that are left are loosened together while the box stands still.

Esterel's own network [IRR §3, Figure 1] is made as the plans of the paper were. The nodes (starts, ends, instantaneous
actions) are visited in order of time. An end follows its start by the duration. A node follows the most recent
supporter of each of its conditions, and every earlier node that its effects contradict; a timed literal that will break
a condition is a deadline for it. A node without any of these follows zero. Where the recorded networks do not show what
the transformer does, this is what is done here:

- A disjunctive condition counts by all of its literals that hold in the schedule; a comparison is supported by the most
  recent change of each of its fluents, and changes of a fluent contradict comparisons with it.
- Edges are [ε, ∞), but never so long that they exclude the plan itself: an over-all condition may hold from the very
  moment on that it begins to matter, and a plan may begin before ε.
- A condition at a start or an end is ε before a timed literal that would break it.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.encode import create_encoding, interface
from robust.encode.network import changes
from robust.execute import distances
from robust.execute.causal import (
    CausalNetwork,
    Tightener,
    Tightening,
    UndecidedError,
    at_lower_ends,
    named_bounds,
    with_free_bounds,
)
from robust.execute.distances import DistanceEdge, Original, TruthWrite
from robust.irr import check, exact, widen
from robust.plan import model
from robust.qe.box import Box, Side
from robust.searching import Status
from robust.smt.limits import OutOfTimeError


@dataclass(frozen=True, slots=True)
class Rung:
    """A network, its widest box around the nominal values, and the bounds that these values themselves asked for."""

    edges: tuple[DistanceEdge, ...]
    box: Box
    forced: tuple[Tightening, ...]


@dataclass(frozen=True)
class RoomFirst:
    """The search for the bounds that a network needs beside its causal orders.

    Args:
        causal: the causal network.
        base: the edges that every network has: durations, starts that are parameters, irredundant orders.
        varying: the instances whose durations are parameters.
        tightener: proves networks; it knows the plan, the solver and the deadline.
        parametrized: the plan with its parameters and a network.
        held: the parameters that keep their nominal values in the search.
    """

    causal: CausalNetwork
    base: tuple[DistanceEdge, ...]
    varying: Collection[str]
    tightener: Tightener
    parametrized: Callable[[Iterable[DistanceEdge]], model.ParametrizedPlan]
    held: Collection[str] = ()

    def bounds(self, forced: Sequence[Tightening]) -> tuple[Tightening, ...]:
        """The bounds beside the base, as few and as loose as the widest box allows; with the `forced` ones the base is
        valid at the nominal values.

        Raises:
            OutOfTimeError: if the deadline passes first.
            UndecidedError: if the solver cannot decide.
            KeyboardInterrupt: if interrupted.
        """
        chosen = self._roomiest(self._rung((), forced))
        self.tightener.say("looking for the distances that the box needs")
        needed = self._needed(chosen)
        self.tightener.say("loosening distances")
        return tuple(self._loosened(needed, chosen.box))

    def _roomiest(self, loosest: Rung) -> Rung:
        orders, ties = self._rung(esterel_edges(self.tightener.original)), self._rung(self._ties())
        chosen = ties if _size(ties.box) > _size(orders.box) else orders
        return loosest if chosen.box.is_within(loosest.box) else chosen

    def _rung(self, edges: Iterable[DistanceEdge], forced: Sequence[Tightening] = ()) -> Rung:
        """The base with more edges, and bounds against counterexamples if the nominal values break something."""
        self.tightener.say("looking for room")
        network = tuple(dict.fromkeys((*self.base, *edges, *(bound.edge for bound in forced))))
        box = self._widest(network)
        if box is None and not forced:
            return self._rung(edges, self.tightener.forced(network)[0])
        if box is None:
            raise UndecidedError("found no box of a network that is proved at the nominal values, expected one")
        return Rung(network, box, tuple(forced))

    def _widest(self, edges: Iterable[DistanceEdge]) -> Box | None:
        """The widest box around the nominal values; None if they break something themselves."""
        tightener = self.tightener
        result = exact.ExactSearch(self._encoded(edges), solver=tightener.solver, deadline=tightener.deadline).run()
        match result.status:
            case Status.COMPLETE:
                return result.box
            case Status.INVALID:
                return None
            case Status.INTERRUPTED:
                raise KeyboardInterrupt
            case Status.TIMEOUT:
                raise OutOfTimeError
            case _:
                raise UndecidedError(f"found the widest box undecided ({result.reason}), expected one")

    def _encoded(self, edges: Iterable[DistanceEdge]) -> interface.Encoding:
        tightener = self.tightener
        return create_encoding("relational", self._varied(edges), tightener.original.epsilon, tightener.deadline)

    def _varied(self, edges: Iterable[DistanceEdge]) -> model.ParametrizedPlan:
        plan = self.parametrized(edges)
        return model.at_values(plan, {name: plan.nominal[name] for name in self.held})

    def _ties(self) -> Iterator[DistanceEdge]:
        """Each start follows its critical predecessor by the plan's own distance."""
        original, times = self.tightener.original, self.tightener.original.times
        before: dict[model.TimePoint, list[DistanceEdge]] = {}
        for edge in (*self.causal.edges, *self.causal.certain):
            if edge.source.instance != edge.target.instance:
                before.setdefault(edge.target, []).append(edge)

        def slack(edge: DistanceEdge) -> tuple[Fraction, bool, bool, Fraction]:
            start = times[edge.source]
            varies = edge.source.instance in self.varying
            return times[edge.target] - start - edge.weight, edge.source == model.ZERO, not varies, -start

        for instance in original.plan.instances:
            if edges := before.get(instance.start):
                source = min(edges, key=slack).source
                gap = times[instance.start] - times[source]
                yield DistanceEdge(source, instance.start, gap)
                yield DistanceEdge(instance.start, source, -gap)

    # -- what the box needs ------------------------------------------------------------------------------------------

    def _needed(self, rung: Rung) -> list[Tightening]:
        """Edges of a rung without which the base is not valid all over its box."""
        order = {edge: number for number, edge in enumerate(rung.edges)}
        kept: list[Tightening] = []
        reasons = {bound.edge: bound.obligation for bound in rung.forced}
        candidates = [edge for edge in rung.edges if edge not in self.base]
        schedules = []
        while (example := self._breach(kept, rung.box)) is not None:
            schedules.append(example.schedule)
            breaking = [edge for edge in candidates if _breaks(example.schedule, edge)]
            if not breaking:
                raise UndecidedError(
                    f"found {example.obligation!r} broken by no edge of a proved network, expected one"
                )

            def merit(edge: DistanceEdge) -> tuple[bool, bool, int, int]:
                broken = sum(_breaks(schedule, edge) for schedule in schedules)
                return self._is_order(edge), model.ZERO not in edge[:2], broken, -order[edge]

            edge = max(breaking, key=merit)
            candidates.remove(edge)
            own = self.tightener.original.distance(edge.source, edge.target)
            kept.append(Tightening(edge, own, reasons.get(edge, example.obligation)))
        for bound in reversed(list(kept)):
            rest = [other for other in kept if other != bound]
            if all(any(_breaks(schedule, other.edge) for other in rest) for schedule in schedules):
                example = self._breach(rest, rung.box)
                if example is None:
                    kept = rest
                else:
                    schedules.append(example.schedule)
        return kept

    def _breach(self, bounds: Sequence[Tightening], box: Box) -> check.Counterexample | None:
        """A schedule that breaks something for values in the box; None if nothing does."""
        tightener = self.tightener
        encoding = self._encoded((*self.base, *(bound.edge for bound in bounds)))
        result = check.Checker(encoding, box, solver=tightener.solver, deadline=tightener.deadline).run()
        if result.answer is check.Answer.PROVED:
            return None
        if result.interrupted:
            raise KeyboardInterrupt
        if result.timed_out:
            raise OutOfTimeError
        if not result.counterexamples:
            raise UndecidedError(f"found the box undecided ({result.reason}), expected a proof or a counterexample")
        return next(iter(result.counterexamples.values()))

    def _is_order(self, edge: DistanceEdge) -> bool:
        """Whether an edge asks for no distance but the separation."""
        return 0 <= edge.weight <= self.tightener.original.gap

    # -- less of it --------------------------------------------------------------------------------------------------

    def _loosened(self, bounds: Sequence[Tightening], box: Box) -> Iterator[Tightening]:
        """The distances among the bounds, lowered together as far as the box stays proved."""
        loose = {name: bound for name, bound in named_bounds(bounds).items() if not self._is_order(bound.edge)}
        firm = [bound for bound in bounds if bound not in loose.values()]
        yield from firm
        if loose:
            yield from at_lower_ends(loose, self._widened(loose, firm, box), self.tightener.original.gap)

    def _widened(self, loose: dict[str, Tightening], firm: Sequence[Tightening], box: Box) -> Box:
        """The box with an interval for each loose distance; in less time, what is known by then."""
        tightener = self.tightener.in_less_time
        plan = with_free_bounds(self._varied((*self.base, *(bound.edge for bound in firm))), loose)
        start = box.changed(Box.point({name: bound.edge.weight for name, bound in loose.items()}).intervals)
        boxes = [start]
        encoding = create_encoding("relational", plan, tightener.original.epsilon, tightener.deadline)
        try:
            widen.Widening(
                bad=widen.DiscoveredBadSet(encoding, solver=tightener.solver),
                parameters=plan.parameters,
                pieces=[],
                groups=[[(name, Side.LOWER) for name in loose]],
                deadline=tightener.deadline,
                on_box=boxes.append,
                start=start,
            ).run()
        except OutOfTimeError:
            tightener.say("out of time for looser distances")
        return boxes[-1]


def _size(box: Box) -> tuple[int, Fraction]:
    """The number of infinite widths and the sum of the others; a box has more than those that it contains."""
    widths = [interval.width for interval in box.intervals.values()]
    return widths.count(None), sum((width for width in widths if width is not None), Fraction(0))


def _breaks(schedule: Mapping[model.TimePoint, Fraction], edge: DistanceEdge) -> bool:
    return schedule[edge.target] - schedule[edge.source] < edge.weight


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
        return distances.edge(source, target, min(self.original.gap, self.original.distance(source, target)))

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
        known: list[model.TimePoint] = []
        if isinstance(leaf, model.Holds):
            known = [write.point for write in self.original.writes(leaf.atom) if write.value is leaf.value]
        elif isinstance(leaf, model.NumericCondition):
            fluents = _fluents(leaf)
            known = [moment for name, moment in changes(self.original.plan) if name in fluents]
        past = [change for change in known if times[change] < limit or (over_all and times[change] == limit)]
        latest = max((times[moment] for moment in past), default=limit)
        candidates = [moment for moment in past if times[moment] == latest]
        return point if point in candidates else next(iter(candidates), None)

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
                    yield distances.edge(node.point, breaking.point, Fraction(0) if over_all else self.original.gap)
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
