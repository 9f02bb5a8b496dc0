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
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.encode import create_encoding, interface
from robust.execute.causal import CausalNetwork, Tightener, Tightening, UndecidedError, at_least, named_bounds
from robust.execute.distances import DistanceEdge
from robust.execute.esterel import esterel_edges
from robust.irr import check, exact, widen
from robust.plan import model
from robust.plan.polynomial import Polynomial
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
    """

    causal: CausalNetwork
    base: tuple[DistanceEdge, ...]
    varying: Collection[str]
    tightener: Tightener
    parametrized: Callable[[Iterable[DistanceEdge]], model.ParametrizedPlan]

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

    @property
    def _plan(self) -> model.ParametrizedPlan:
        return self.tightener.original.plan

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
        return create_encoding("relational", self.parametrized(edges), tightener.original.epsilon, tightener.deadline)

    def _ties(self) -> Iterator[DistanceEdge]:
        """Each start follows its critical predecessor by the plan's own distance."""
        times = self.tightener.original.times
        before: dict[model.TimePoint, list[DistanceEdge]] = {}
        for edge in (*self.causal.edges, *self.causal.certain):
            if edge.source.instance != edge.target.instance:
                before.setdefault(edge.target, []).append(edge)

        def slack(edge: DistanceEdge) -> tuple[Fraction, bool, bool, Fraction]:
            start = times[edge.source]
            varies = edge.source.instance in self.varying
            return times[edge.target] - start - edge.weight, edge.source == model.ZERO, not varies, -start

        for instance in self._plan.instances:
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
        loose = dict(zip(named_bounds(bounds), bounds, strict=True))
        loose = {name: bound for name, bound in loose.items() if not self._is_order(bound.edge)}
        firm = [bound for bound in bounds if bound not in loose.values()]
        yield from firm
        if not loose:
            return
        last = self._widened(loose, firm, box)
        for name, bound in loose.items():
            end = last[name].lower
            if end is not None:
                # where the end does not belong to it, a little above, or the plan's own
                least = end if last[name].lower_closed else min(end + self.tightener.original.gap, bound.edge.weight)
                yield replace(bound, edge=bound.edge._replace(weight=least))

    def _widened(self, loose: dict[str, Tightening], firm: Sequence[Tightening], box: Box) -> Box:
        """The box with an interval for each loose distance; in less time, what is known by then."""
        tightener = self.tightener.in_less_time
        plan = self.parametrized((*self.base, *(bound.edge for bound in firm)))
        free = [model.Parameter(name, bound.edge.weight, upper=bound.edge.weight) for name, bound in loose.items()]
        variables = {name: Polynomial.variable(model.ParameterReference(name)) for name in loose}
        bounds = [at_least(bound.edge, variables[name]) for name, bound in loose.items()]
        plan = replace(plan, parameters=(*plan.parameters, *free), constraints=(*plan.constraints, *bounds))
        start = Box({**box.intervals, **Box.nominal(free).intervals})
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
