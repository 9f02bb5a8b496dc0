"""Reasoners by name: that of the paper, with execution windows and a knowledge base, and the semantic one.

Labeled execution windows come from the labeled shortest paths of the augmented plan, and each execution tightens them
[PIKE §3, Equation 1]; facts become assignments and conflicts of the knowledge base [PIKE §5.7].
"""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from robust.backends import SMT
from robust.errors import InputError, did_you_mean
from robust.pike_bridge import compile, distance_graph, labeled_apsp, model
from robust.pike_bridge.knowledge import knowledge_bases
from robust.pike_bridge.online.divided import DividedReasoner
from robust.pike_bridge.online.parts import Division
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import News, Reasoner, SemanticReasoner
from robust.pike_bridge.theory import Commitment, Exclude, Require
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Terms

NOTHING_MORE = Require(model.ALWAYS)


class LabeledReach(NamedTuple):
    """A labeled distance to or from an event; the label is without the guards of both ends."""

    event: str
    distance: Fraction
    label: model.Environment


class LabeledWindows:
    """Execution windows of pending events: labeled value sets that each execution tightens.

    Bounds are absolute times, lower ones negated; labels are without the guard of the event itself. All labeled
    distances of the network are found beforehand, so that none has to be while it is executed; OutOfTimeError if the
    deadline passes first.
    """

    def __init__(self, network: model.Tpnu, distances: labeled_apsp.LabeledDistances, deadline: Deadline) -> None:
        self.vocabulary: model.AssignmentVocabulary = distances.vocabulary
        self.guards: Mapping[str, model.Environment] = {
            event.name: self.vocabulary.encode(event.guard) for event in network.events
        }
        self.after: dict[str, list[LabeledReach]] = {event: [] for event in self.guards}
        """D(event, other) for every other event."""
        self._before: dict[str, list[LabeledReach]] = {event: [] for event in self.guards}
        """D(other, event) for every other event."""
        self.lower = {event: distance_graph.LabeledValueSet[Fraction](self.vocabulary) for event in self.guards}
        """(−l, φ): in φ, the event is at l or later."""
        self.upper = {event: distance_graph.LabeledValueSet[Fraction](self.vocabulary) for event in self.guards}
        """(u, φ): in φ, the event is at u or earlier."""
        for source in self.guards:
            deadline.enforce()
            for target in self.guards:
                for distance, label in distances.labeled(source, target) if source != target else ():
                    self.after[source].append(LabeledReach(target, distance, label))
                    self._before[target].append(LabeledReach(source, distance, label))

    def executed(self, event: str, time: Fraction, known: model.Environment) -> None:
        """Propagate a time to the windows of all other events [PIKE, Equation 1]; what is known not to be is left out.

        `known` says which assignments hold for certain; labels are kept without them.
        """
        del self.lower[event], self.upper[event]
        for windows, reaches, sign in ((self.upper, self.after, 1), (self.lower, self._before, -1)):
            for other, distance, label in reaches[event]:
                window = windows.get(other)
                if window is not None and self.vocabulary.consistent(label | known):
                    window.add(sign * time + distance, label & ~known)

    def missed(self, event: str, now: Fraction) -> Iterator[model.Environment]:
        """Where the event would have had to be executed before now [PIKE, Algorithm 1, line 6]."""
        return (label | self.guards[event] for bound, label in self.upper[event] if bound < now)

    def early(self, event: str, now: Fraction) -> Iterator[model.Environment]:
        """Where the event must not be executed yet [PIKE §3, constraint 3]."""
        return (label | self.guards[event] for bound, label in self.lower[event] if -bound > now)


class WindowReasoner(Reasoner):
    """Answers from a knowledge base and execution windows.

    Both hold ε against all events. Once something was reported less than ε after another event, which was before it
    all the same, they would exclude too much, and the semantic reasoner answers instead.

    What has happened becomes commitments, which wait until something is asked, because only questions have deadlines.
    """

    def __init__(
        self, progress: Progress, compilation: compile.Compilation, deadline: Deadline, solver: str = "z3"
    ) -> None:
        super().__init__(progress)
        self._solver = solver
        self._instead: SemanticReasoner | None = None
        self.name = compilation.backend
        self._knowledge = compilation.knowledge
        network = compilation.augmented.network
        # A back end that reasons about time itself needs no conflicts, and so had no distances.
        distances = compilation.distances or labeled_apsp.LabeledDistances(network, deadline)
        self._windows = LabeledWindows(network, distances, deadline)
        self._vocabulary = self._windows.vocabulary
        self._epsilon = progress.plan.separation
        self._known: model.Environment = 0
        """All assignments that hold by what has happened."""
        self._conflicts: list[model.Environment] = []
        self._waiting: list[Commitment] = []
        self._links: dict[tuple[str, model.Guard], list[tuple[model.Condition, model.Environment]]] = defaultdict(list)
        for link in compilation.augmented.links:
            # A condition without support variable has this support only, so that it cannot be met at all.
            chosen = self._vocabulary.encode(link.selection | link.consumer.guard)
            self._links[link.producer] += ((condition, chosen) for condition in link.consumer.conditions)

    # -- what has happened -------------------------------------------------------------------------------------------

    def _learn(self, news: News) -> None:
        if self._instead is None and self.progress.close(news.times):
            self._instead = SemanticReasoner(self.progress, solver=self._solver)
        if self._instead is not None:
            return
        guards, windows = self.progress.structure.guards, self._windows
        environment = news.chosen.union(*(guards[event] for event in news.times))
        encoded = self._vocabulary.encode(environment)
        if not model.entails(self._known, encoded):
            self._known |= encoded
            self._waiting.append(Require(environment))
        for effect, condition in news.void:
            self._void(effect, condition)
        for event, time in news.times.items():
            self._exclude([*windows.early(event, time), *windows.missed(event, time)])
            windows.executed(event, time, self._known)
        self._exclude(self._missed(self.progress.now))  # windows that are missed by now [PIKE, Algorithm 1, line 6]

    def _exclude(self, labels: Iterable[model.Environment]) -> None:
        """None of the environments holds."""
        for label in labels:
            if self._possible(label) and not any(model.entails(label, conflict) for conflict in self._conflicts):
                self._conflicts = [conflict for conflict in self._conflicts if not model.entails(conflict, label)]
                self._conflicts.append(label)
                self._waiting.append(Exclude(self._vocabulary.decode(label)))

    def _void(self, effect: model.Effect, condition: model.Condition) -> None:
        """A link is broken once no effect at its event, of the same guard, supports the condition."""
        alike = [
            each
            for each in self.progress.plan.effects
            if (each.event, each.guard) == (effect.event, effect.guard) and model.may_produce(each, condition)
        ]
        if all((effect, condition) in self.progress.void for effect in alike):
            self._exclude(chosen for each, chosen in self._links[effect.event, effect.guard] if each == condition)

    def _possible(self, environment: model.Environment) -> bool:
        """Whether the assignments that are known do not contradict the environment."""
        return self._vocabulary.consistent(self._known | environment)

    # -- questions ---------------------------------------------------------------------------------------------------

    def executable(self, event: str, deadline: Deadline) -> bool:
        self.catch_up()
        if self._instead is not None:
            return self._instead.executable(event, deadline)
        return self._executable_at(event, self.progress.now, deadline)

    def could(self, environment: model.Guard, deadline: Deadline) -> bool:
        self.catch_up()
        if self._instead is not None:
            return self._instead.could(environment, deadline)
        return self.progress.compatible(environment) and self._ask(deadline, Require(environment))

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        self.catch_up()
        if self._instead is not None:
            return self._instead.next_time(deadline)
        soonest = self.progress.now + self.progress.grid
        candidates = self._candidates()
        openings = {(soonest, event) for event in candidates}  # what could be executed now may have been withheld
        openings |= {
            (-bound, event)
            for event in candidates
            for bound, label in self._windows.lower[event]
            if -bound > soonest and self._possible(label | self._windows.guards[event])
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
                if self._possible(label | self._windows.guards[event])
            }
        )

        def lost(moment: Fraction) -> bool:
            """Whether there is no continuation in which nothing happens until after a time."""
            return not self._ask(deadline, excluded=self._missed(moment + self.progress.grid))

        first = bisect_left(closings, True, key=lost)
        return None if first == len(closings) else self._closing(closings[first])

    def _executable_at(self, event: str, moment: Fraction, deadline: Deadline) -> bool:
        """CanExecuteEventNow?, if nothing happens before a time that is not in the past [PIKE, Algorithm 2]."""
        if not self._possible(self._windows.guards[event]):
            return False
        guard = self.progress.structure.guards[event]
        return self._ask(deadline, Require(guard), self._required(event, moment))

    def _required(self, event: str, moment: Fraction) -> Iterator[model.Environment]:
        """GetConstraintsRequiredToExecute: what must not hold [PIKE §3, constraints 2 to 6]."""
        yield from self._external(event)
        yield from self._windows.early(event, moment)
        if moment > self.progress.now:
            yield from self._missed(moment)
        theirs = {
            other: labels for other in self.progress.pending if other != event and (labels := self._external(other))
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

    def _missed(self, moment: Fraction) -> Iterator[model.Environment]:
        for event in self.progress.pending:
            yield from self._windows.missed(event, moment)

    def _external(self, event: str) -> list[model.Environment]:
        """The environments in which an event is not the executive's to execute."""
        return [self._vocabulary.encode(label) for label in self.progress.external(event)]

    def _ask(
        self, deadline: Deadline, given: Require = NOTHING_MORE, excluded: Iterable[model.Environment] = ()
    ) -> bool:
        """Whether something is left in an environment where none of the labels holds.

        Raises:
            OutOfTimeError: if the deadline passes; what waits goes on waiting then, unless it was committed to.
        """
        made, consistent = self._vocabulary.made, self._vocabulary.consistent
        whole = self._known | self._vocabulary.encode(given.environment)
        remainders = (label & ~whole & made for label in excluded if consistent(whole | label))
        labels = labeled_apsp.most_general(sorted(remainders, key=int.bit_count))
        if 0 in labels:
            return False
        if self._waiting:
            self._knowledge.commit(self._waiting, deadline)
            self._waiting = []
        asked: list[Commitment] = [given, *(Exclude(self._vocabulary.decode(label)) for label in labels)]
        return self._knowledge.could_commit(asked, deadline)


@dataclass
class CompiledReasoners:
    """Makes reasoners that compile the plan first, each anew, because executions narrow what is compiled.

    Args:
        backend: the name of a knowledge base.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        deadline: for compiling.

    Making a reasoner raises OutOfTimeError if the deadline passes, and InputError if the back end or the solver is
    unknown; afterwards `compilation` and `seconds` are those of the last one.
    """

    backend: str
    solver: str = "z3"
    deadline: Deadline = NEVER
    compilation: compile.Compilation | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By stage: those of :class:`~robust.pike_bridge.compile.Compiling`, and windows."""

    def __call__(self, progress: Progress) -> Reasoner:
        compiling = compile.Compiling(
            progress.plan, self.backend, temporal=compile.Temporal.APSP, solver=self.solver, deadline=self.deadline
        )
        self.seconds = compiling.seconds
        self.compilation = compiling.compile()
        with compiling.stage("windows"):
            return WindowReasoner(progress, self.compilation, self.deadline, self.solver)


def reasoner_names() -> tuple[str, ...]:
    """What :func:`make_reasoner` knows.

    Returns:
        `smt`, and the knowledge bases that windows ask.
    """
    return (SMT, *knowledge_bases())


def make_reasoner(name: str, *, solver: str = "z3", deadline: Deadline = NEVER) -> Callable[[Progress], Reasoner]:
    """What makes the reasoner of that name for an execution.

    Args:
        name: one of :func:`reasoner_names`: `smt` asks the semantic oracle's formula, and compiles nothing; with the
            name of a knowledge base it is that of the paper, as :class:`CompiledReasoners` makes it. Both decide the
            same.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        deadline: for what is compiled before; the reasoner is not made, with OutOfTimeError, if it passes.

    Returns:
        A function from what has happened so far to a reasoner, for `reasoner` of :class:`PlanExecutive`.

    Raises:
        InputError: if there is no such reasoner.
    """
    if name not in reasoner_names():
        raise InputError(f"unknown reasoner {name!r}{did_you_mean(name, reasoner_names())}")
    if name != SMT:
        return CompiledReasoners(name, solver=solver, deadline=deadline)
    terms = Terms()  # shared: executives that plan anew ask about one candidate after the other
    return lambda progress: make_semantic(progress, solver=solver, terms=terms, deadline=deadline)


DIVIDED_FROM = 40
"""Activities; smaller plans are decided as quickly in one piece."""


def make_semantic(
    progress: Progress, *, solver: str = "z3", terms: Terms | None = None, deadline: Deadline = NEVER
) -> SemanticReasoner | DividedReasoner:
    """Semantic reasoning, part by part if the plan is large and can be cut.

    Raises:
        OutOfTimeError: if the deadline passes before the parts are measured.
        SolverError: if the solver is unknown or not installed.
    """
    if len(progress.plan.network.activities) >= DIVIDED_FROM:
        division = Division(progress.plan, progress.structure)
        if len(division.nodes) > 2:
            return DividedReasoner(progress, division, solver=solver, terms=terms, deadline=deadline)
    return SemanticReasoner(progress, solver=solver, terms=terms)


def without_states(plan: model.TeamPlan) -> model.TeamPlan:
    """A plan as Drake sees it: choices and times, without what activities need, do or are to reach, so that there are
    no causal links and nothing to monitor [PIKE §1.2, §3; Conrad and Williams 2011].
    """
    return replace(plan, conditions=(), effects=())
