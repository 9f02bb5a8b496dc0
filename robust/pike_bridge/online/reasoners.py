"""Reasoners by name, and those with a knowledge base: facts become assignments and conflicts [PIKE §3, §5.7].

The *window* reasoner keeps labeled execution windows, which each execution tightens. The *lazy* one looks at the times
of one scenario after the other: there a plan is a simple temporal network [Dechter, Meiri and Pearl 1991] in which
executed events are where they are. If it has no schedule, the guards on a negative cycle make a conflict; it is one for
good, unless the cycle uses what was only assumed.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm
from time import perf_counter
from typing import NamedTuple

import networkx

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.compile import Compilation, Compiling, Temporal
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
from robust.pike_bridge.online import SMT, reasoner_names
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import News, Reasoner, WitnessedReasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.semantics import Execution
from robust.pike_bridge.temporal.distance_graph import DistanceEdge, LabeledValueSet, distance_graph
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances
from robust.pike_bridge.temporal.schedule import Cycle, earliest_times, most_general
from robust.smt.limits import NEVER, Deadline
from robust.smt.terms import Terms

__all__ = ["SMT", "CompiledReasoners", "make_reasoner", "reasoner_names"]


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

    def learn(self, news: News) -> None:
        """Choices are made, events were executed, and effects support conditions no more."""
        guards = self._progress.structure.guards
        environment = news.chosen.union(*(guards[event] for event in news.times))
        encoded = self.vocabulary.encode(environment)
        if not entails(self.known, encoded):
            self.known |= encoded
            self._waiting.append(Require(environment))
        for effect, condition in news.void:
            self._void(effect, condition)

    def exclude(self, labels: Iterable[Environment]) -> None:
        """None of the environments holds."""
        for label in labels:
            if self.possible(label) and not any(entails(label, each) for each in self._conflicts):
                self._conflicts = [each for each in self._conflicts if not entails(each, label)]
                self._conflicts.append(label)
                self._waiting.append(Exclude(self.vocabulary.decode(label)))

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
        general = most_general(sorted(left, key=int.bit_count))
        return None if 0 in general else [Exclude(self.vocabulary.decode(label)) for label in general]

    def external(self, event: str) -> list[Environment]:
        """In which environments an event is not the executive's to execute."""
        return [self.vocabulary.encode(label) for label in self._progress.external(event)]

    def _void(self, effect: Effect, condition: Condition) -> None:
        """A link is broken once no effect at its event, of the same guard, supports the condition."""
        alike = [
            each
            for each in self._progress.plan.effects
            if (each.event, each.guard) == (effect.event, effect.guard) and may_produce(each, condition)
        ]
        if all((each, condition) in self._progress.void for each in alike):
            links = self._links.get((effect.event, effect.guard), ())
            self.exclude(chosen for each, chosen in links if each == condition)


class Reach(NamedTuple):
    """A labeled distance to or from an event; the label is without the guards of both ends."""

    event: str
    distance: Fraction
    label: Environment


class LabeledWindows:
    """Execution windows of pending events: labeled value sets that each execution tightens.

    Bounds are absolute times, lower ones negated; labels are without the guard of the event itself. All labeled
    distances of the network are found beforehand, so that none has to be while it is executed; OutOfTimeError if the
    deadline passes first.
    """

    def __init__(self, network: Tpnu, distances: LabeledDistances, deadline: Deadline) -> None:
        self.vocabulary: Vocabulary = distances.vocabulary
        self.guards: Mapping[str, Environment] = {
            event.name: self.vocabulary.encode(event.guard) for event in network.events
        }
        self.after: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(event, other) for every other event."""
        self._before: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(other, event) for every other event."""
        self.lower = {event: LabeledValueSet[Fraction](self.vocabulary) for event in self.guards}
        """(−l, φ): in φ, the event is at l or later."""
        self.upper = {event: LabeledValueSet[Fraction](self.vocabulary) for event in self.guards}
        """(u, φ): in φ, the event is at u or earlier."""
        for source in self.guards:
            deadline.enforce()
            for target in self.guards:
                for distance, label in distances.labeled(source, target) if source != target else ():
                    self.after[source].append(Reach(target, distance, label))
                    self._before[target].append(Reach(source, distance, label))

    def executed(self, event: str, time: Fraction, known: Environment) -> None:
        """Propagate a time to the windows of all other events [PIKE, Equation 1]; what is known not to be is left out.

        `known` says which assignments hold for certain; labels are kept without them.
        """
        del self.lower[event], self.upper[event]
        for windows, reaches, sign in ((self.upper, self.after, 1), (self.lower, self._before, -1)):
            for other, distance, label in reaches[event]:
                window = windows.get(other)
                if window is not None and self.vocabulary.consistent(label | known):
                    window.add(sign * time + distance, label & ~known)

    def missed(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event would have had to be executed before now [PIKE, Algorithm 1, line 6]."""
        return (label | self.guards[event] for bound, label in self.upper[event] if bound < now)

    def early(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event must not be executed yet [PIKE §3, constraint 3]."""
        return (label | self.guards[event] for bound, label in self.lower[event] if -bound > now)


class WindowReasoner(Reasoner):
    """Answers from a knowledge base and execution windows."""

    def __init__(self, progress: Progress, compilation: Compilation, deadline: Deadline) -> None:
        super().__init__(progress)
        self.name = compilation.backend
        network = compilation.augmented.network
        # A back end that reasons about time itself needs no conflicts, and so had no distances.
        distances = compilation.distances or LabeledDistances(network, deadline)
        self._facts = ExecutionFacts(compilation, progress)
        self._windows = LabeledWindows(network, distances, deadline)
        self._epsilon = progress.plan.separation

    def _learn(self, news: News) -> None:
        facts, windows = self._facts, self._windows
        facts.learn(news)
        for event, time in news.times.items():
            facts.exclude([*windows.early(event, time), *windows.missed(event, time)])
            windows.executed(event, time, facts.known)
        facts.exclude(self._missed(self.progress.now))  # windows that are missed by now [PIKE, Algorithm 1, line 6]

    def executable(self, event: str, deadline: Deadline) -> bool:
        self.catch_up()
        return self._executable_at(event, self.progress.now, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        return self.progress.compatible(environment) and self._ask([Require(environment)], deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        self.catch_up()
        soonest = self.progress.now + self.progress.grid
        openings = {
            (max(-bound, soonest), event)
            for event in self.progress.frontier
            if self.progress.ours(event)
            for bound, label in self._windows.lower[event]
            if -bound > self.progress.now and self._facts.possible(label | self._windows.guards[event])
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
                if self._facts.possible(label | self._windows.guards[event])
            }
        )
        first = bisect_left(closings, True, key=lambda moment: not self._possible_after(moment, deadline))
        return None if first == len(closings) else self._closing(closings[first])

    def _possible_after(self, moment: Fraction, deadline: Deadline) -> bool:
        """Whether there is a continuation in which nothing happens until after a time."""
        excluded = self._facts.excluding(self._missed(moment + self.progress.grid), 0)
        return excluded is not None and self._ask(excluded, deadline)

    def _executable_at(self, event: str, moment: Fraction, deadline: Deadline) -> bool:
        """CanExecuteEventNow?, if nothing happens before a time that is not in the past [PIKE, Algorithm 2]."""
        guard = self._windows.guards[event]
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
        for other, distance, label in self._windows.after[event]:
            if distance < self._epsilon and other in self.progress.pending:
                whole = label | self._windows.guards[other]
                if distance < 0:
                    yield whole
                else:
                    yield from (whole | each for each in theirs.get(other, ()))

    def _missed(self, moment: Fraction) -> Iterator[Environment]:
        for event in self.progress.pending:
            yield from self._windows.missed(event, moment)

    def _ask(self, commitments: list[Commitment], deadline: Deadline) -> bool:
        self.catch_up()
        self._facts.settle(deadline)
        return self._facts.knowledge.could_commit(commitments, deadline)


_FACT = -1
_ASSUMED = -2
"""In place of the number of a constraint: that pending events are not in the past, and what is asked about."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What is asked about, beyond the facts.

    Attributes:
        soonest: a time before which nothing pending is.
        event: an event that comes first, when nothing pending is earlier.
        later: what must come after that event, by ε at least, and in which environments.
        latest: the greatest time of the event; None if there is none.
    """

    soonest: Fraction
    event: str | None = None
    later: tuple[tuple[str, Environment], ...] = ()
    latest: Fraction | None = None


class ScenarioTimes:
    """The constraints between events in single scenarios; the origin, time 0, holds executed events where they are."""

    def __init__(self, network: Tpnu, progress: Progress) -> None:
        self._graph = distance_graph(network)
        self._progress = progress
        self._places = self._graph.places
        self._names = list(self._places)
        self._orders = range(len(progress.plan.network.constraints), len(network.constraints))
        """The constraints that conditions have added."""
        self._scale = self._graph.scale
        self._edges: list[DistanceEdge] = list(self._graph.edges)
        self._origin = len(self._places)
        self._first = self._origin + 1
        self._refine(progress.plan.separation)

    def earliest(self, scenario: Environment, assumed: Hypothesis) -> dict[str, Fraction] | Cycle:
        """The earliest times of all activated events under an assumption, or a contradiction that the scenario entails.

        If an event is assumed to come first, its time is the least that is possible, too.
        """
        for moment in (self._progress.now, assumed.soonest, assumed.latest, *self._progress.times.values()):
            if moment is not None:
                self._refine(moment)
        edges = [*self._holding(scenario), *self._floors(scenario, assumed), *self._assumed(scenario, assumed)]
        found = earliest_times(self._first + 1, edges)
        if isinstance(found, Cycle):
            return found
        return {
            name: Fraction(found[place], self._scale)
            for name, place in self._places.items()
            if entails(scenario, self._graph.guards[place])
        }

    def deadline(self, scenario: Environment) -> Fraction | None:
        """Until when nothing need be executed in a scenario that has a schedule; None if that is forever."""
        graph = networkx.MultiDiGraph()
        graph.add_node(self._origin)
        graph.add_weighted_edges_from(edge[:3] for edge in self._holding(scenario))
        bounds = networkx.single_source_bellman_ford_path_length(graph, self._origin)
        least = min((bounds[place] for place, _ in self._pending(scenario) if place in bounds), default=None)
        return None if least is None else Fraction(least, self._scale)

    def _holding(self, scenario: Environment) -> Iterator[DistanceEdge]:
        """The constraints that hold, and the times of executed events."""
        for edge in self._edges:
            if entails(scenario, edge.label) and not self._settled(edge):
                yield edge
        for event, moment in self._progress.times.items():
            yield DistanceEdge(self._origin, self._places[event], self._scaled(moment), 0, _FACT)
            yield DistanceEdge(self._places[event], self._origin, -self._scaled(moment), 0, _FACT)

    def _settled(self, edge: DistanceEdge) -> bool:
        """Whether it is an order that an observation has settled, by less than ε."""
        if edge.constraint not in self._orders or not self._progress.reported:
            return False
        return self._progress.settled(self._names[edge.target], self._names[edge.source])

    def _pending(self, scenario: Environment) -> Iterator[tuple[int, Environment]]:
        for event, place in self._places.items():
            if event not in self._progress.times and entails(scenario, self._graph.guards[place]):
                yield place, self._graph.guards[place]

    def _floors(self, scenario: Environment, assumed: Hypothesis) -> Iterator[DistanceEdge]:
        now, soonest = self._scaled(self._progress.now), self._scaled(assumed.soonest)
        for place, guard in self._pending(scenario):
            yield DistanceEdge(place, self._origin, -now, guard, _FACT)
            if soonest > now:
                yield DistanceEdge(place, self._origin, -soonest, guard, _ASSUMED)

    def _assumed(self, scenario: Environment, assumed: Hypothesis) -> Iterator[DistanceEdge]:
        if assumed.event is None:
            return
        place, first, epsilon = self._places[assumed.event], self._first, self._scaled(self._progress.plan.separation)
        yield DistanceEdge(place, first, 0, self._graph.guards[place], _ASSUMED)
        yield DistanceEdge(first, place, 0, self._graph.guards[place], _ASSUMED)
        yield DistanceEdge(first, self._origin, -self._scaled(assumed.soonest), 0, _ASSUMED)
        if assumed.latest is not None:
            yield DistanceEdge(self._origin, first, self._scaled(assumed.latest), 0, _ASSUMED)
        if assumed.latest != assumed.soonest:
            for other, guard in self._pending(scenario):
                yield DistanceEdge(other, first, 0, guard, _ASSUMED)
        for event, environment in assumed.later:
            label = environment | self._graph.guards[self._places[event]]
            if entails(scenario, label):
                yield DistanceEdge(self._places[event], first, -epsilon, label, _ASSUMED)

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
        self._times = ScenarioTimes(compilation.augmented.network, progress)
        self._preferred: dict[str, str] = {}
        """The last model that had times."""

    def _learn(self, news: News) -> None:
        super()._learn(news)
        self._facts.learn(news)

    def _find_continuation(self, environment: Guard, deadline: Deadline) -> bool:
        return self._witnessed(self._find([Require(environment)], Hypothesis(self.progress.now), deadline))

    def _find_execution(self, event: str, deadline: Deadline) -> bool:
        asked = self._ours(event)
        if asked is None:
            return False
        assumed = Hypothesis(self.progress.now, event, self._later(event), self.progress.now)
        return self._witnessed(self._find(asked, assumed, deadline))

    def _witnessed(self, found: Execution | None) -> bool:
        if found is None:
            return False
        choices = {name: found.scenario[name] for name in self.progress.plan.network.domains}
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
            if not isinstance(times, Cycle):
                self._preferred = dict(model)
                return Execution(model, times)
            if any(edge.constraint == _ASSUMED for edge in times.edges):
                commitments.append(Exclude(self._facts.vocabulary.decode(times.label)))
            else:
                self._facts.exclude([times.label])

    def _scenario(self, model: Mapping[str, str]) -> Environment:
        return self._facts.vocabulary.encode(Assignment(*item) for item in model.items())

    def _ours(self, event: str) -> list[Commitment] | None:
        """That the event is activated and the executive's to execute; None if it is not."""
        guard = self.progress.structure.guards[event]
        labels = self._facts.external(event)
        excluded = self._facts.excluding(labels, self._facts.vocabulary.encode(guard))
        return None if excluded is None else [Require(guard), *excluded]

    def _later(self, event: str) -> tuple[tuple[str, Environment], ...]:
        """What comes after the event if that is executed, because it is not the executive's to execute."""
        return tuple(
            (other, label) for other in self.progress.pending if other != event for label in self._facts.external(other)
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
                assumed = Hypothesis(soonest, event, self._later(event), latest)
                found = self._find(asked, assumed, deadline)
                if found is None:
                    break
                best = found.schedule[event]
        return best

    def quiet_until(self, deadline: Deadline) -> Fraction | None:
        self.catch_up()
        best, soonest = None, self.progress.now
        while True:
            found = self._find([], Hypothesis(soonest), deadline)
            if found is None:
                return best
            best = self._times.deadline(self._scenario(found.scenario))
            if best is None:
                return None
            soonest = best + self.progress.grid


@dataclass
class CompiledReasoners:
    """Makes reasoners that compile the plan first, each anew, because executions narrow what is compiled.

    Args:
        backend: the name of a knowledge base.
        temporal: LAZY looks at the times of one scenario after the other; APSP keeps labeled execution windows
            [PIKE §3], for which the labeled distances of the augmented plan are computed. They decide the same.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        deadline: for compiling.

    Making a reasoner raises OutOfTimeError if the deadline passes, and InputError if the back end or the solver is
    unknown; afterwards `compilation` and `seconds` are those of the last one.
    """

    backend: str
    temporal: Temporal = Temporal.LAZY
    solver: str = "z3"
    deadline: Deadline = NEVER
    compilation: Compilation | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By stage: those of :class:`~robust.pike_bridge.compile.Compiling`, and windows."""

    def __call__(self, progress: Progress) -> Reasoner:
        compiling = Compiling(
            progress.plan, self.backend, temporal=self.temporal, solver=self.solver, deadline=self.deadline
        )
        self.seconds = compiling.seconds
        self.compilation = compiling.compile()
        if self.temporal is Temporal.LAZY:
            return LazyReasoner(progress, self.compilation)
        started = perf_counter()
        try:
            return WindowReasoner(progress, self.compilation, self.deadline)
        finally:
            compiling.seconds["windows"] = perf_counter() - started


def make_reasoner(
    name: str, *, solver: str = "z3", temporal: Temporal = Temporal.LAZY, deadline: Deadline = NEVER
) -> Callable[[Progress], Reasoner]:
    """What makes the reasoner of that name for an execution.

    Args:
        name: one of :func:`reasoner_names`; for all but `smt` it is a :class:`CompiledReasoners`.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        temporal: how compiled reasoners find out about time.
        deadline: for what is compiled before; the reasoner is not made, with OutOfTimeError, if it passes.

    Raises:
        InputError: if there is no such reasoner.
    """
    if name not in reasoner_names():
        raise InputError(f"unknown reasoner {name!r}{did_you_mean(name, reasoner_names())}")
    if name != SMT:
        return CompiledReasoners(name, temporal=temporal, solver=solver, deadline=deadline)
    terms = Terms()  # shared: executives that plan anew ask about one candidate after the other
    return lambda progress: SemanticReasoner(progress, solver=solver, terms=terms)
