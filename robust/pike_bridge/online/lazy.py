"""Times of one scenario of a plan that is being executed: the earliest that are left, or why there are none.

In one scenario what is left of a plan is a simple temporal network, in which all executed events are one: the origin,
from which each constraint with an executed event is shifted by its time [Dechter, Meiri and Pearl 1991]. If it has
no schedule, the guards on a negative cycle make a conflict; it is one for good, unless the cycle uses what was only
assumed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from robust.pike_bridge.compile import Compilation
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Assignment, Condition, Effect, Environment, Guard, Tpnu, entails
from robust.pike_bridge.online.dispatching import Facts, external
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import WitnessedReasoner
from robust.pike_bridge.semantics import Execution
from robust.pike_bridge.temporal.distance_graph import Edge, distance_graph
from robust.pike_bridge.temporal.schedule import Cycle, earliest_times
from robust.smt.limits import Deadline

_FACT = -1
_ASSUMED = -2
"""In place of the number of a constraint: that pending events are not in the past, and what is asked about."""


@dataclass(frozen=True, slots=True)
class Later:
    """In an environment, an event comes after a moment, by ε at least."""

    event: str
    environment: Environment


@dataclass(frozen=True, slots=True)
class Assumption:
    """What is asked about, beyond the facts.

    Attributes:
        soonest: a time before which nothing pending is.
        event: an event that comes first, when nothing pending is earlier; at `soonest` exactly, unless `open_end`.
        later: what must come after that event.
        open_end: whether the event may come later than `soonest`.
        latest: the greatest time of the event, if it may come later.
    """

    soonest: Fraction
    event: str | None = None
    later: tuple[Later, ...] = ()
    open_end: bool = False
    latest: Fraction | None = None


@dataclass(frozen=True, slots=True)
class Contradiction:
    """An environment without schedule; only under the assumption, or for good."""

    environment: Environment
    assumed: bool


class ScenarioTimes:
    """The constraints between events as far as these have not been executed."""

    def __init__(self, network: Tpnu, epsilon: Fraction) -> None:
        graph = distance_graph(network)
        self._graph = graph
        self._places = graph.places
        self._scale = graph.scale
        self._edges: list[Edge] = list(graph.edges)
        self._times: dict[int, Fraction] = {}
        self._origin = len(graph.events)
        self._first = self._origin + 1
        self.now = Fraction(0)
        self._epsilon = epsilon
        self._refine(epsilon)

    def guard(self, event: str) -> Environment:
        """When the event is activated."""
        return self._graph.guards[self._places[event]]

    def executed(self, event: str, time: Fraction) -> Iterator[Environment]:
        """Fix a time; the environments in which it contradicts another time."""
        place = self._places[event]
        self._times[place] = time
        self._refine(time)
        left: list[Edge] = []
        for edge in self._edges:
            source, target = self._times.get(edge.source), self._times.get(edge.target)
            if place not in (edge.source, edge.target) or source is None or target is None:
                left.append(edge)
            elif (target - source) * self._scale > edge.weight:
                yield edge.label
        self._edges = left

    def earliest(self, scenario: Environment, assumed: Assumption) -> dict[str, Fraction] | Contradiction:
        """The earliest times of all activated events under an assumption, or a contradiction that the scenario entails.

        If an event is assumed to come first, its time is the least that is possible, too.
        """
        for moment in (self.now, assumed.soonest, assumed.latest):
            if moment is not None:
                self._refine(moment)
        edges = [*self._left(scenario), *self._floors(scenario, assumed), *self._assumed(scenario, assumed)]
        found = earliest_times(self._first + 1, edges)
        if isinstance(found, Cycle):
            return Contradiction(found.label, any(edge.constraint == _ASSUMED for edge in found.edges))
        times = {
            name: Fraction(found[place], self._scale)
            for name, place in self._places.items()
            if entails(scenario, self._graph.guards[place])
        }
        return times | {
            self._graph.events[place]: time
            for place, time in self._times.items()
            if entails(scenario, self._graph.guards[place])
        }

    def deadline(self, scenario: Environment) -> Fraction | None:
        """Until when nothing need be executed in a scenario that has a schedule; None if that is forever."""
        bounds: dict[int, int] = {self._origin: 0}
        edges = self._left(scenario)
        changed = True
        while changed:
            changed = False
            for source, target, weight, _, _ in edges:
                known = bounds.get(source)
                if known is not None and (target not in bounds or bounds[target] > known + weight):
                    bounds[target] = known + weight
                    changed = True
        least = min((bound for place, bound in bounds.items() if place != self._origin), default=None)
        return None if least is None else Fraction(least, self._scale)

    def _left(self, scenario: Environment) -> list[Edge]:
        """The constraints that hold, as seen from the origin where an event has been executed."""
        times, origin = self._times, self._origin
        found: list[Edge] = []
        for edge in self._edges:
            if edge.label & scenario != edge.label:
                continue
            source, target, weight, label, constraint = edge
            if source in times:
                found.append(Edge(origin, target, weight + self._scaled(times[source]), label, constraint))
            elif target in times:
                found.append(Edge(source, origin, weight - self._scaled(times[target]), label, constraint))
            else:
                found.append(edge)
        return found

    def _pending(self, scenario: Environment) -> Iterator[tuple[int, Environment]]:
        for place, guard in enumerate(self._graph.guards):
            if place not in self._times and scenario & guard == guard:
                yield place, guard

    def _floors(self, scenario: Environment, assumed: Assumption) -> Iterator[Edge]:
        now, soonest = self._scaled(self.now), self._scaled(assumed.soonest)
        for place, guard in self._pending(scenario):
            yield Edge(place, self._origin, -now, guard, _FACT)
            if soonest > now:
                yield Edge(place, self._origin, -soonest, guard, _ASSUMED)

    def _assumed(self, scenario: Environment, assumed: Assumption) -> Iterator[Edge]:
        if assumed.event is None:
            return
        place, first, epsilon = self._places[assumed.event], self._first, self._scaled(self._epsilon)
        guard = self._graph.guards[place]
        yield Edge(place, first, 0, guard, _ASSUMED)
        yield Edge(first, place, 0, guard, _ASSUMED)
        yield Edge(first, self._origin, -self._scaled(assumed.soonest), 0, _ASSUMED)
        latest = assumed.latest if assumed.open_end else assumed.soonest
        if latest is not None:
            yield Edge(self._origin, first, self._scaled(latest), 0, _ASSUMED)
        if assumed.open_end:
            for other, other_guard in self._pending(scenario):
                yield Edge(other, first, 0, other_guard, _ASSUMED)
        for each in assumed.later:
            label = each.environment | self.guard(each.event)
            if entails(scenario, label):
                yield Edge(self._places[each.event], first, -epsilon, label, _ASSUMED)

    def _scaled(self, time: Fraction) -> int:
        return time.numerator * (self._scale // time.denominator)

    def _refine(self, time: Fraction) -> None:
        """Count in units of which the time is a multiple."""
        if self._scale % time.denominator:
            factor = lcm(self._scale, time.denominator) // self._scale
            self._scale *= factor
            self._edges = [edge._replace(weight=edge.weight * factor) for edge in self._edges]


class LazyReasoner(WitnessedReasoner):
    """Answers from a knowledge base and the times of single scenarios."""

    def __init__(self, progress: Progress, compilation: Compilation) -> None:
        super().__init__(progress)
        self.name = compilation.backend
        self._facts = Facts(compilation, progress)
        self._times = ScenarioTimes(compilation.augmented.network, progress.plan.epsilon)
        self._choices = tuple(progress.plan.network.domains)
        self._preferred: dict[str, str] = {}
        """The last model that had times."""

    def observed(self, assignment: Assignment) -> None:
        super().observed(assignment)
        self._facts.require(frozenset({assignment}))

    def executed(self, event: str) -> None:
        super().executed(event)
        self._facts.require(self.progress.structure.guards[event])
        self._facts.exclude(self._times.executed(event, self.progress.now))

    def voided(self, effect: Effect, condition: Condition) -> None:
        super().voided(effect, condition)
        self._facts.void(effect, condition)

    def advanced(self) -> None:
        super().advanced()
        self._times.now = self.progress.now

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        earliest = self._earliest_execution(deadline)
        if earliest is not None:
            return self._opening(earliest)
        last = self._last(deadline)
        return None if last is None else self._closing(last)

    def _find_continuation(self, environment: Guard, deadline: Deadline) -> bool:
        return self._witnessed(self._find([Require(environment)], Assumption(self.progress.now), deadline))

    def _find_execution(self, event: str, deadline: Deadline) -> bool:
        asked = self._ours(event)
        if asked is None:
            return False
        assumed = Assumption(self.progress.now, event, self._later(event))
        return self._witnessed(self._find(asked, assumed, deadline))

    def _witnessed(self, found: Execution | None) -> bool:
        if found is None:
            return False
        choices = {name: found.scenario[name] for name in self._choices}
        self._witness = Execution(choices, found.schedule)
        return True

    def _find(self, asked: Iterable[Commitment], assumed: Assumption, deadline: Deadline) -> Execution | None:
        """A model of all variables with times, under an assumption; None if there is none."""
        commitments = list(asked)
        while True:
            deadline.enforce()
            self._facts.settle(deadline)
            model = self._facts.knowledge.find_model(commitments, self._preferred, deadline)
            if model is None:
                return None
            times = self._times.earliest(self._scenario(model), assumed)
            if not isinstance(times, Contradiction):
                self._preferred = dict(model)
                return Execution(model, times)
            if times.assumed:
                commitments.append(Exclude(self._facts.vocabulary.decode(times.environment)))
            else:
                self._facts.exclude([times.environment])

    def _scenario(self, model: Mapping[str, str]) -> Environment:
        return self._facts.vocabulary.encode(Assignment(*item) for item in model.items())

    def _ours(self, event: str) -> list[Commitment] | None:
        """That the event is activated and the executive's to execute; None if it is not."""
        guard = self.progress.structure.guards[event]
        labels = external(self.progress, self._facts.vocabulary, event)
        excluded = self._facts.excluding(labels, self._facts.vocabulary.encode(guard))
        return None if excluded is None else [Require(guard), *excluded]

    def _later(self, event: str) -> tuple[Later, ...]:
        """What comes after the event if that is executed, because it is not the executive's to execute."""
        return tuple(
            Later(other, label)
            for other in self.progress.pending
            if other != event
            for label in external(self.progress, self._facts.vocabulary, other)
        )

    def _earliest_execution(self, deadline: Deadline) -> Fraction | None:
        """The least time after now at which an event is executable if nothing happens before."""
        soonest = self.progress.now + self.progress.grid
        best: Fraction | None = None
        candidates = [event for event in self.progress.frontier if self.progress.ours(event)]
        for event in sorted(candidates, key=lambda each: self.progress.earliest(each) or soonest):
            least = max(self.progress.earliest(event) or soonest, soonest)
            asked = self._ours(event)
            while asked is not None and (best is None or best > least):
                latest = None if best is None else best - self.progress.grid
                assumed = Assumption(soonest, event, self._later(event), open_end=True, latest=latest)
                found = self._find(asked, assumed, deadline)
                if found is None:
                    break
                best = found.schedule[event]
        return best

    def _last(self, deadline: Deadline) -> Fraction | None:
        """The greatest time before which nothing need be executed; None if there is none."""
        best, soonest = None, self.progress.now
        while True:
            found = self._find([], Assumption(soonest), deadline)
            if found is None:
                return best
            best = self._times.deadline(self._scenario(found.scenario))
            if best is None:
                return None
            soonest = best + self.progress.grid
