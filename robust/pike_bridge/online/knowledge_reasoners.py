"""Reasoners with a knowledge base: facts of an execution become assignments and conflicts [PIKE §3, §5.7].

The *window* reasoner keeps labeled execution windows, which each execution tightens. The *lazy* one looks at the times
of one scenario after the other: there what is left of a plan is a simple temporal network, in which all executed events
are one: the origin, from which each constraint with an executed event is shifted by its time [Dechter, Meiri and Pearl
1991]. If it has no schedule, the guards on a negative cycle make a conflict; it is one for good, unless the cycle uses
what was only assumed.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import NamedTuple

from robust.pike_bridge.compile import Compilation
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import (
    Assignment,
    Condition,
    Effect,
    Environment,
    Guard,
    Tpnu,
    Vocabulary,
    entails,
    may_produce,
)
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner, WitnessedReasoner
from robust.pike_bridge.semantics import Execution
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, LabeledValueSet, distance_graph
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances
from robust.pike_bridge.temporal.schedule import Cycle, earliest_times
from robust.smt.limits import Deadline


class ExecutionFacts:
    """What a knowledge base is told of one execution.

    Facts wait until something is asked, because only questions have deadlines.
    """

    def __init__(self, compilation: Compilation, progress: Progress) -> None:
        self._progress = progress
        self.knowledge = compilation.knowledge
        self.vocabulary = Vocabulary(compilation.augmented.network.domains)
        self.known: Environment = 0
        """All assignments that hold by what has happened."""
        self._conflicts: list[Environment] = []
        self._waiting: list[Commitment] = []
        self._links: dict[tuple[str, Guard], list[tuple[Condition, Environment]]] = {}
        for link in compilation.augmented.links:
            # A condition without support variable has this support only, so that it cannot be met at all.
            chosen = self.vocabulary.encode(link.selection | link.consumer.guard)
            broken = self._links.setdefault((link.producer.event, link.producer.guard), [])
            broken += ((condition, chosen) for condition in link.consumer.conditions)

    def require(self, environment: Guard) -> None:
        """All assignments of the environment hold."""
        encoded = self.vocabulary.encode(environment)
        if self.known & encoded != encoded:
            self.known |= encoded
            self._waiting.append(Require(environment))

    def exclude(self, labels: Iterable[Environment]) -> None:
        """None of the environments holds."""
        for label in labels:
            if self.possible(label) and not any(label & each == each for each in self._conflicts):
                self._conflicts = [each for each in self._conflicts if each & label != label]
                self._conflicts.append(label)
                self._waiting.append(Exclude(self.vocabulary.decode(label)))

    def void(self, effect: Effect, condition: Condition) -> None:
        """The effect does not support the condition; a link is broken once no effect at its event does."""
        alike = [
            each
            for each in self._progress.plan.effects
            if (each.event, each.guard) == (effect.event, effect.guard) and may_produce(each, condition)
        ]
        if all((each, condition) in self._progress.void for each in alike):
            links = self._links.get((effect.event, effect.guard), ())
            self.exclude(chosen for each, chosen in links if each == condition)

    def possible(self, environment: Environment) -> bool:
        """Whether the assignments that are known do not contradict the environment."""
        return self.vocabulary.consistent(self.known | environment)

    def settle(self, deadline: Deadline) -> None:
        """Tell the knowledge base what waits.

        Raises:
            OutOfTimeError: if the deadline passes; then it goes on waiting.
        """
        if self._waiting:
            self.knowledge.commit(self._waiting, deadline)
            self._waiting = []

    def excluding(self, labels: Iterable[Environment], given: Environment) -> list[Commitment] | None:
        """As commitments that none of the labels holds, when `given` does; None if that cannot be."""
        whole = self.known | given
        left = (label & ~whole & self.vocabulary.made for label in labels if self.vocabulary.consistent(whole | label))
        open_labels: list[Environment] = []
        for label in sorted(left, key=int.bit_count):
            if not label:
                return None
            if not any(label & each == each for each in open_labels):
                open_labels.append(label)
        return [Exclude(self.vocabulary.decode(label)) for label in open_labels]

    def external(self, event: str) -> list[Environment]:
        """In which environments an event is not the executive's to execute."""
        return [self.vocabulary.encode(label) for label in self._progress.external(event)]


class Reach(NamedTuple):
    """A labeled distance to or from an event; the label is without the guards of both ends."""

    event: str
    distance: Fraction
    label: Environment


class DistanceTable:
    """All labeled distances of a network, so that none has to be found while it is executed.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """

    def __init__(self, network: Tpnu, distances: LabeledDistances, deadline: Deadline) -> None:
        self.vocabulary: Vocabulary = distances.vocabulary
        self.guards: Mapping[str, Environment] = {
            event.name: self.vocabulary.encode(event.guard) for event in network.events
        }
        self.after: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(event, other) for every other event."""
        self.before: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(other, event) for every other event."""
        for source in self.guards:
            deadline.enforce()
            for target in self.guards:
                if source != target:
                    for distance, label in distances.labeled(source, target):
                        self.after[source].append(Reach(target, distance, label))
                        self.before[target].append(Reach(source, distance, label))


class LabeledWindows:
    """Execution windows of pending events: labeled value sets that each execution tightens.

    Bounds are absolute times; labels are without the guard of the event itself.
    """

    def __init__(self, table: DistanceTable) -> None:
        self._table = table
        self.lower: dict[str, LabeledValueSet[Fraction]] = {}
        """(l, φ): in φ, the event is at l or later."""
        self.upper: dict[str, LabeledValueSet[Fraction]] = {}
        """(u, φ): in φ, the event is at u or earlier."""
        for event in table.guards:
            self.lower[event] = LabeledValueSet(table.vocabulary, operator.gt)
            self.upper[event] = LabeledValueSet(table.vocabulary, operator.lt)

    def executed(self, event: str, time: Fraction, known: Environment) -> None:
        """Propagate a time to the windows of all other events [PIKE, Equation 1]; what is known not to be is left out.

        `known` says which assignments hold for certain; labels are kept without them.
        """
        del self.lower[event], self.upper[event]
        for windows, reaches, sign in ((self.upper, self._table.after, 1), (self.lower, self._table.before, -1)):
            for other, distance, label in reaches[event]:
                window = windows.get(other)
                if window is not None and self._table.vocabulary.consistent(label | known):
                    window.add(time + sign * distance, label & ~known)

    def drop(self, event: str) -> None:
        """The event is not activated."""
        self.lower.pop(event, None)
        self.upper.pop(event, None)

    def missed(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event would have had to be executed before now [PIKE, Algorithm 1, line 6]."""
        guard = self._table.guards[event]
        for bound, label in self.upper.get(event, ()):
            if bound < now:
                yield label | guard

    def early(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event must not be executed yet [PIKE §3, constraint 3]."""
        guard = self._table.guards[event]
        for bound, label in self.lower.get(event, ()):
            if bound > now:
                yield label | guard


class WindowReasoner(Reasoner):
    """Answers from a knowledge base and execution windows."""

    def __init__(self, progress: Progress, compilation: Compilation, table: DistanceTable) -> None:
        super().__init__(progress)
        self.name = compilation.backend
        self._facts = ExecutionFacts(compilation, progress)
        self._table = table
        self._windows = LabeledWindows(table)
        self._epsilon = progress.plan.epsilon

    def observed(self, assignment: Assignment) -> None:
        self._facts.require(frozenset({assignment}))

    def executed(self, event: str) -> None:
        facts, now = self._facts, self.progress.now
        facts.require(self.progress.structure.guards[event])
        facts.exclude(self._windows.early(event, now))
        facts.exclude(self._windows.missed(event, now))
        self._windows.executed(event, now, facts.known)
        self._miss()

    def voided(self, effect: Effect, condition: Condition) -> None:
        self._facts.void(effect, condition)

    def advanced(self) -> None:
        self._miss()

    def possible(self, deadline: Deadline) -> bool:
        self._facts.settle(deadline)
        return self._facts.knowledge.satisfiable(deadline)

    def executable(self, event: str, deadline: Deadline) -> bool:
        return self._executable_at(event, self.progress.now, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        if not self.progress.compatible(environment):
            return False
        return self._ask([Require(environment)], deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        soonest = self.progress.now + self.progress.grid
        openings = {
            (max(bound, soonest), event)
            for event in self.progress.frontier
            if self.progress.ours(event)
            for bound, label in self._windows.lower[event]
            if bound > self.progress.now and self._facts.possible(label | self._table.guards[event])
        }
        for moment, event in sorted(openings):
            if self._executable_at(event, moment, deadline):
                return self._opening(moment)
        return self._too_late(deadline)

    def _too_late(self, deadline: Deadline) -> Fraction | None:
        """The least time by which nothing is left if nothing happens before; None if there is always something."""
        closings = sorted(
            {
                bound
                for event in self.progress.pending
                for bound, label in self._windows.upper[event]
                if self._facts.possible(label | self._table.guards[event])
            }
        )
        first, last = 0, len(closings)
        # The answer is among closings[first:last + 1], where that after the last one is never.
        while first < last:
            middle = (first + last) // 2
            if self._possible_after(closings[middle], deadline):
                first = middle + 1
            else:
                last = middle
        return None if first == len(closings) else self._closing(closings[first])

    def _possible_after(self, moment: Fraction, deadline: Deadline) -> bool:
        """Whether there is a continuation in which nothing happens until after a time."""
        excluded = self._facts.excluding(self._missed(moment + self.progress.grid), 0)
        return excluded is not None and self._ask(excluded, deadline)

    def _executable_at(self, event: str, moment: Fraction, deadline: Deadline) -> bool:
        """CanExecuteEventNow?, if nothing happens before a time that is not in the past [PIKE, Algorithm 2]."""
        guard = self._table.guards[event]
        if not self._facts.possible(guard):
            return False
        excluded = self._facts.excluding(self._required(event, moment), guard)
        if excluded is None:
            return False
        return self._ask([Require(self.progress.structure.guards[event]), *excluded], deadline)

    def _required(self, event: str, moment: Fraction) -> Iterator[Environment]:
        """GetConstraintsRequiredToExecute: what must not hold [PIKE §3, constraints 2 to 6]."""
        yield from self._facts.external(event)
        yield from self._windows.early(event, moment)
        if moment > self.progress.now:
            yield from self._missed(moment)
        theirs = {
            other: labels
            for other in self.progress.pending
            if other != event and (labels := self._facts.external(other))
        }
        for other, labels in theirs.items():
            for label in self._windows.missed(other, moment + self._epsilon):
                yield from (label | each for each in labels)
        for other, distance, label in self._table.after[event]:
            if distance < self._epsilon and other in self.progress.pending:
                whole = label | self._table.guards[other]
                if distance < 0:
                    yield whole
                else:
                    yield from (whole | each for each in theirs.get(other, ()))

    def _missed(self, moment: Fraction) -> Iterator[Environment]:
        for event in self.progress.pending:
            yield from self._windows.missed(event, moment)

    def _miss(self) -> None:
        """Windows that are missed by now [PIKE, Algorithm 1, line 6]."""
        self._facts.exclude(self._missed(self.progress.now))

    def _ask(self, commitments: list[Commitment], deadline: Deadline) -> bool:
        self._facts.settle(deadline)
        return self._facts.knowledge.could_commit(commitments, deadline)


_FACT = -1
_ASSUMED = -2
"""In place of the number of a constraint: that pending events are not in the past, and what is asked about."""


@dataclass(frozen=True, slots=True)
class Later:
    """In an environment, an event comes after a moment, by ε at least."""

    event: str
    environment: Environment


@dataclass(frozen=True, slots=True)
class Hypothesis:
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
class NoSchedule:
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
        self._edges: list[DistanceEdge] = list(graph.edges)
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
        left: list[DistanceEdge] = []
        for edge in self._edges:
            source, target = self._times.get(edge.source), self._times.get(edge.target)
            if place not in (edge.source, edge.target) or source is None or target is None:
                left.append(edge)
            elif (target - source) * self._scale > edge.weight:
                yield edge.label
        self._edges = left

    def earliest(self, scenario: Environment, assumed: Hypothesis) -> dict[str, Fraction] | NoSchedule:
        """The earliest times of all activated events under an assumption, or a contradiction that the scenario entails.

        If an event is assumed to come first, its time is the least that is possible, too.
        """
        for moment in (self.now, assumed.soonest, assumed.latest):
            if moment is not None:
                self._refine(moment)
        edges = [*self._left(scenario), *self._floors(scenario, assumed), *self._assumed(scenario, assumed)]
        found = earliest_times(self._first + 1, edges)
        if isinstance(found, Cycle):
            return NoSchedule(found.label, any(edge.constraint == _ASSUMED for edge in found.edges))
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

    def _left(self, scenario: Environment) -> list[DistanceEdge]:
        """The constraints that hold, as seen from the origin where an event has been executed."""
        times, origin = self._times, self._origin
        found: list[DistanceEdge] = []
        for edge in self._edges:
            if edge.label & scenario != edge.label:
                continue
            source, target, weight, label, constraint = edge
            if source in times:
                found.append(DistanceEdge(origin, target, weight + self._scaled(times[source]), label, constraint))
            elif target in times:
                found.append(DistanceEdge(source, origin, weight - self._scaled(times[target]), label, constraint))
            else:
                found.append(edge)
        return found

    def _pending(self, scenario: Environment) -> Iterator[tuple[int, Environment]]:
        for place, guard in enumerate(self._graph.guards):
            if place not in self._times and scenario & guard == guard:
                yield place, guard

    def _floors(self, scenario: Environment, assumed: Hypothesis) -> Iterator[DistanceEdge]:
        now, soonest = self._scaled(self.now), self._scaled(assumed.soonest)
        for place, guard in self._pending(scenario):
            yield DistanceEdge(place, self._origin, -now, guard, _FACT)
            if soonest > now:
                yield DistanceEdge(place, self._origin, -soonest, guard, _ASSUMED)

    def _assumed(self, scenario: Environment, assumed: Hypothesis) -> Iterator[DistanceEdge]:
        if assumed.event is None:
            return
        place, first, epsilon = self._places[assumed.event], self._first, self._scaled(self._epsilon)
        guard = self._graph.guards[place]
        yield DistanceEdge(place, first, 0, guard, _ASSUMED)
        yield DistanceEdge(first, place, 0, guard, _ASSUMED)
        yield DistanceEdge(first, self._origin, -self._scaled(assumed.soonest), 0, _ASSUMED)
        latest = assumed.latest if assumed.open_end else assumed.soonest
        if latest is not None:
            yield DistanceEdge(self._origin, first, self._scaled(latest), 0, _ASSUMED)
        if assumed.open_end:
            for other, other_guard in self._pending(scenario):
                yield DistanceEdge(other, first, 0, other_guard, _ASSUMED)
        for each in assumed.later:
            label = each.environment | self.guard(each.event)
            if entails(scenario, label):
                yield DistanceEdge(self._places[each.event], first, -epsilon, label, _ASSUMED)

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
        self._facts = ExecutionFacts(compilation, progress)
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

    def _find_continuation(self, environment: Guard, deadline: Deadline) -> bool:
        return self._witnessed(self._find([Require(environment)], Hypothesis(self.progress.now), deadline))

    def _find_execution(self, event: str, deadline: Deadline) -> bool:
        asked = self._ours(event)
        if asked is None:
            return False
        assumed = Hypothesis(self.progress.now, event, self._later(event))
        return self._witnessed(self._find(asked, assumed, deadline))

    def _witnessed(self, found: Execution | None) -> bool:
        if found is None:
            return False
        choices = {name: found.scenario[name] for name in self._choices}
        self._witness = Execution(choices, found.schedule)
        return True

    def _find(self, asked: Iterable[Commitment], assumed: Hypothesis, deadline: Deadline) -> Execution | None:
        """A model of all variables with times, under an assumption; None if there is none."""
        commitments = list(asked)
        while True:
            deadline.enforce()
            self._facts.settle(deadline)
            model = self._facts.knowledge.find_model(commitments, self._preferred, deadline)
            if model is None:
                return None
            times = self._times.earliest(self._scenario(model), assumed)
            if not isinstance(times, NoSchedule):
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
        labels = self._facts.external(event)
        excluded = self._facts.excluding(labels, self._facts.vocabulary.encode(guard))
        return None if excluded is None else [Require(guard), *excluded]

    def _later(self, event: str) -> tuple[Later, ...]:
        """What comes after the event if that is executed, because it is not the executive's to execute."""
        return tuple(
            Later(other, label)
            for other in self.progress.pending
            if other != event
            for label in self._facts.external(other)
        )

    def _earliest_execution(self, deadline: Deadline) -> Fraction | None:
        soonest = self.progress.now + self.progress.grid
        best: Fraction | None = None
        candidates = [event for event in self.progress.frontier if self.progress.ours(event)]
        for event in sorted(candidates, key=lambda each: self.progress.earliest(each) or soonest):
            least = max(self.progress.earliest(event) or soonest, soonest)
            asked = self._ours(event)
            while asked is not None and (best is None or best > least):
                latest = None if best is None else best - self.progress.grid
                assumed = Hypothesis(soonest, event, self._later(event), open_end=True, latest=latest)
                found = self._find(asked, assumed, deadline)
                if found is None:
                    break
                best = found.schedule[event]
        return best

    def quiet_until(self, deadline: Deadline) -> Fraction | None:
        best, soonest = None, self.progress.now
        while True:
            found = self._find([], Hypothesis(soonest), deadline)
            if found is None:
                return best
            best = self._times.deadline(self._scenario(found.scenario))
            if best is None:
                return None
            soonest = best + self.progress.grid
