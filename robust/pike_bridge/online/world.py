"""Simulated humans and worlds for executives: seeded, and on the grid of the plan's numbers.

A world decides uncontrollable choices, how long activities take, and what goes wrong with the state.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import partial
from heapq import heappop, heappush
from math import ceil, floor
from random import Random
from typing import Protocol, TypeAlias

from robust import backends, errors
from robust.execute.drive import run_in_world
from robust.pike_bridge.likelihood import ChanceBounds, IntentChance, LikelyChoices, probabilities
from robust.pike_bridge.model import ALWAYS, Assignment, Choice, Literal, TeamPlan
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online import reasoners, semantic, service
from robust.pike_bridge.online.executive import PlanExecutive, Thrift
from robust.pike_bridge.online.explain import Fact, conflict
from robust.pike_bridge.online.inquiry import Inquiry, StepReasons
from robust.pike_bridge.semantics import Execution, faults, holds
from robust.presented import Presented, VerdictEnum
from robust.searching import DECIDED, Searching, Status
from robust.smt.limits import NEVER, Deadline


class Human(Enum):
    """How uncontrollable choices are made: among what remains correct, anyhow, or by the probabilities of the plan."""

    RATIONAL = "rational"
    CARELESS = "careless"
    LIKELY = "likely"


class Pace(Enum):
    """How long activities take, between their bounds.

    Agents that cooperate end their activities while that leaves a correct execution, if there is such a time, and act
    otherwise than they meant to when something else has happened; PIKE counts on them [PIKE, Definition 2.8].
    """

    COOPERATIVE = "cooperative"
    LEAST = "least"
    RANDOM = "random"


@dataclass(frozen=True, slots=True)
class Disturbance:
    """From a time on, in the plan's unit, until an effect says otherwise, the literal holds, whatever was planned."""

    time: Fraction
    literal: Literal


@dataclass(frozen=True, slots=True)
class Story:
    """What is known beforehand of an execution, in the plan's unit of time; the seed decides the rest.

    Attributes:
        outcomes: values of uncontrollable choices, and when they are made known; the time None leaves that open.
        disturbances: what goes wrong.
        slack: how much longer than its least duration an activity without an upper bound takes at most.
        delay: how long after a choice is possible it is made at most.
    """

    human: Human = Human.RATIONAL
    pace: Pace = Pace.COOPERATIVE
    outcomes: Mapping[str, tuple[str, Fraction | None]] | None = None
    disturbances: tuple[Disturbance, ...] = ()
    slack: Fraction = Fraction(5)
    delay: Fraction = Fraction(0)


Planned: TypeAlias = said.Message | Callable[[Fraction], said.Message | None]
"""What is told at a time; it may depend on what has happened by then."""


class Watched(Protocol):
    """What a team, and who rehearses with it, sees of an executive."""

    @property
    def progress(self) -> said.Progress: ...

    @property
    def reasoner(self) -> semantic.Reasoner: ...

    @property
    def wake(self) -> Fraction | None: ...

    @property
    def ended(self) -> bool: ...

    @property
    def outcome(self) -> said.Failed | said.Succeeded | None: ...

    def prepare(self) -> bool: ...


@dataclass(eq=False)
class SimulatedTeam:
    """The world of one execution, a :class:`robust.execute.drive.World`.

    An uncontrollable choice is made once all events before its own have been executed. Rational humans and cooperative
    agents are advised by `judge`, which knows what happens, and reasons about the semantics; it is asked only when they
    act.
    """

    plan: TeamPlan
    executive: Watched
    judge: semantic.Reasoner
    story: Story = Story()
    _: KW_ONLY
    seed: int = 0

    def __post_init__(self) -> None:
        self._random = Random(self.seed)  # noqa: S311 - reproducible
        self._agenda: list[tuple[Fraction, int, Planned]] = []
        self._due: set[str] = set()
        self._running: dict[str, said.Completion] = {}
        """What cooperative agents do, by the event at which it ends."""
        self._waiting: list[str] = []
        """Activities that cannot end before something else has happened."""
        self._advised = True
        self._number = 0
        for disturbance in self.story.disturbances:
            atoms, positive = frozenset({disturbance.literal.atom}), disturbance.literal.positive
            self._plan_for(disturbance.time, said.Estimate(true=atoms) if positive else said.Estimate(false=atoms))
        for name, (value, moment) in (self.story.outcomes or {}).items():
            if moment is not None:
                self._due.add(name)
                self._plan_for(moment, said.Outcome(name, value))

    def receive(self, now: Fraction, decisions: Sequence[said.Decision]) -> None:
        """Begin what was dispatched, and make choices whose time has come."""
        self._advised = False
        if decisions:
            for end in self._waiting:
                self._plan_for(now, partial(self._complete, end))
            self._waiting.clear()
        for decision in decisions:
            if isinstance(decision, said.Dispatched):
                self._begin(now, decision)
        for choice in self.plan.network.choices:
            if not choice.controllable and choice.name not in self._due and self._is_due(choice):
                self._due.add(choice.name)
                self._plan_for(now + self._drawn(self.story.delay), partial(self._choose, choice.name))

    def _is_due(self, choice: Choice) -> bool:
        """Whether a choice can be made now."""
        return self.executive.progress.comes_next(choice.event)

    @property
    def _advice(self) -> semantic.SemanticReasoner:
        return self.judge.under_way()

    @property
    def next_time(self) -> Fraction | None:
        if not self._advised and self._running:
            self._hurry()
        self._advised = True
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[said.Message]:
        found: list[said.Message] = []
        while self._agenda and self._agenda[0][0] <= now:
            planned = heappop(self._agenda)[2]
            message = planned(now) if callable(planned) else planned
            if message is not None:
                found.append(message)
        return found

    def _begin(self, now: Fraction, activity: said.Dispatched) -> None:
        completion = said.Completion(activity.action, activity.end)
        first = now + activity.lower
        last = first + self.story.slack if activity.upper is None else now + activity.upper
        match self.story.pace:
            case Pace.LEAST:
                self._plan_for(first, completion)
            case Pace.RANDOM:
                self._plan_for(first + self._drawn(last - first), completion)
            case Pace.COOPERATIVE:
                times = self._advice.times_of(activity.end, now, NEVER)
                if times is not None:
                    first, last = times[0], min(last, times[1] or last)
                time = first + self._drawn(max(last - first, Fraction(0)))
                self._running[activity.end] = completion
                self._plan_for(time, partial(self._complete, activity.end))

    def _complete(self, end: str, now: Fraction) -> said.Message | None:
        """End an activity, unless that is better done later, or is done already."""
        if end in self._running and not self._advice.allows(now, ALWAYS, end, NEVER):
            times = self._advice.times_of(end, now, NEVER, first=True)
            if times is not None:
                self._plan_for(times[0], partial(self._complete, end))
                return None
            if self._advice.possible(NEVER):
                self._waiting.append(end)
                return None
        return self._running.pop(end, None)

    def _hurry(self) -> None:
        """End an activity before it was meant to, where nothing correct would be left if all waited for the next."""
        wake = self.executive.wake
        if self.executive.ended or (self._agenda and self._advice.allows(self._agenda[0][0], ALWAYS, None, NEVER)):
            return
        latest = self._advice.quiet_until(NEVER)
        if wake is not None and (latest is None or wake <= latest):
            return
        for end in self._running:
            span = self._advice.times_of(end, self.executive.progress.now, NEVER, first=True)
            if span is not None:
                times = span[:1] if latest is None else (min(latest, span[1] or latest), span[0])
                time = next((each for each in times if self._advice.allows(each, ALWAYS, end, NEVER)), None)
                if time is not None:
                    self._plan_for(time, partial(self._complete, end))
                    return

    def _choose(self, choice: str, now: Fraction) -> said.Message:
        wanted = (self.story.outcomes or {}).get(choice)
        if wanted is not None:
            return said.Outcome(choice, wanted[0])
        values: Sequence[str] = self.plan.network.domains[choice]
        if self.story.human is Human.LIKELY:
            made = next(each for each in self.plan.network.choices if each.name == choice)
            shares = probabilities(made, self.executive.progress.chosen)
            return said.Outcome(
                choice, self._random.choices(list(shares), [float(share) for share in shares.values()])[0]
            )
        if self.story.human is Human.RATIONAL:
            values = [value for value in values if self._is_correct(Assignment(choice, value), now)] or values
        return said.Outcome(choice, self._random.choice(values))

    def _is_correct(self, made: Assignment, now: Fraction) -> bool:
        """Whether something correct is left if a choice is made now."""
        return self._advice.allows(now, frozenset({made}), None, NEVER)

    def _drawn(self, greatest: Fraction) -> Fraction:
        """A random time on the grid, from 0 to the greatest."""
        grid = self.executive.progress.grid
        return self._random.randint(0, floor(greatest / grid)) * grid

    def _plan_for(self, time: Fraction, planned: Planned) -> None:
        self._number += 1
        grid = self.executive.progress.grid
        heappush(self._agenda, (ceil(time / grid) * grid, self._number, planned))


class Ending(VerdictEnum):
    """How an execution ended; WAITING: nothing more will happen, but something was still awaited."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    WAITING = "waiting"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class ExecutionStep(service.JournalStep):
    """A step, with the inferences and reasons that followed from it."""

    inferred: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The values still possible of choices that are not made, where that has changed."""
    seconds: float = 0.0
    """That the executive took to decide."""
    reasons: StepReasons | None = None
    """Of the decisions and inferences, if they were asked for."""
    success: ChanceBounds | None = None
    """How likely success is from here, where that has changed and was asked for."""
    intents: tuple[IntentChance, ...] = ()
    """What people may still choose, with how likely that is, beside `success`."""
    guess: Mapping[str, str] = field(default_factory=dict)
    """What Kirk takes all choices to be from now on, where it has guessed."""


@dataclass(frozen=True)
class ExecutionRecord(Presented, ask="ending"):
    """An execution, in the plan's unit of time. `conflict` are the facts that contradict each other, if it failed.

    `faults` are why one that Drake took for a success is none. `plan`, `seed`, `backend` and `reasoner` are what was
    executed, and by whom; `explained` says whether steps have their reasons.
    """

    ending: Ending
    time: Fraction
    steps: tuple[ExecutionStep, ...]
    choices: Mapping[str, str]
    schedule: Mapping[str, Fraction]
    plan: TeamPlan = field(repr=False, compare=False)
    seed: int
    reasoner: str
    backend: str
    explained: bool = False
    conflict: tuple[Fact, ...] = ()
    faults: tuple[str, ...] = ()
    thrift: Thrift = field(default_factory=Thrift)
    """What the budget of the steps gave away."""
    replans: int | None = None
    """How often Kirk guessed anew; None: another executive."""
    recovered: Fraction = Fraction(0)
    """The time of all of Kirk's recovery activities."""

    @property
    def cut_short(self) -> bool:
        """Whether something ended the execution before it was done."""
        return self.ending in {Ending.TIMEOUT, Ending.INTERRUPTED}


@dataclass
class Rehearsal(Searching[ExecutionRecord]):
    """Executes a plan with a simulated team.

    Args:
        plan: the plan.
        story: what is known beforehand of the team and the world.
        seed: decides the rest.
        infer: whether the values of open choices are found out after each step.
        solver: `z3` or `cvc5`.
        backend: the reasoner that decides, one of :func:`robust.pike_bridge.online.reasoners.reasoner_names`.
        on_step: called after each step.
        explain: whether the reasons of each step are found out, after it was taken.
        patience: as of :class:`~robust.pike_bridge.online.executive.PlanExecutive`.
        flexible: as of :class:`~robust.pike_bridge.online.executive.PlanExecutive`.
        budget: of each step, as of :class:`~robust.pike_bridge.online.executive.PlanExecutive`.
        chance: how likely success is to stay, by :class:`~robust.pike_bridge.likelihood.LikelyChoices`; None: the
            executive knows of no probabilities.
        drake: whether executive and team know nothing of what activities need and do, as
            :func:`~robust.pike_bridge.online.reasoners.without_states` has it. What ends well for them is failed if it
            is not correct.
    """

    plan: TeamPlan
    story: Story = Story()
    seed: int = 0
    infer: bool = True
    solver: str = "z3"
    backend: str = backends.SMT
    deadline: Deadline = NEVER
    on_step: Callable[[ExecutionStep], None] = lambda _step: None
    explain: bool = False
    patience: Fraction | None = Fraction(0)
    flexible: bool = False
    budget: float | None = None
    chance: Fraction | None = None
    drake: bool = False
    _steps: list[ExecutionStep] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self._known = dict(self.plan.network.domains)
        self._likely: LikelyChoices | None = None

    def run(self) -> ExecutionRecord:
        """Execute the plan; a deadline or Ctrl-C ends that with what has happened, if anything has.

        Raises:
            InputError: if there is no such back end.
            OutOfTimeError: if the deadline passes before the first step.
            SolverError: if the solver is unknown, or an execution that ended well is not correct.
        """
        self._meet()
        return super().run()

    def _meet(self) -> None:
        """Make the executive and the team."""
        deciding = self._deciding()
        seen = reasoners.without_states(self.plan) if self.drake else self.plan
        if self.chance is not None:
            self._likely = LikelyChoices(self.plan, self.chance, solver=self.solver, deadline=self.deadline)
        self._executive = PlanExecutive(
            seen,
            deciding,
            preference=self._likely,
            patience=self.patience,
            flexible=self.flexible,
            solver=self.solver,
            budget=self.budget,
            deadline=self.deadline,
        )
        self._driven: Watched = self._executive
        self._world = SimulatedTeam(seen, self._executive, self._judge(), self.story, seed=self.seed)

    @property
    def _begun(self) -> bool:
        return bool(self._steps)

    def _search(self) -> None:
        self._driven.prepare()  # what is loaded and stated before the first step takes none of its time
        run_in_world(self, self._world)

    def _result(self, status: Status, reason: str | None = None) -> ExecutionRecord:
        if status not in DECIDED:
            return self._record(Ending(status.value))
        outcome = self._driven.outcome
        wrong = self._faults() if isinstance(outcome, said.Succeeded) else ()
        if wrong and not self.drake:
            raise errors.SolverError(f"the execution is not correct: {wrong[0]}; please report this")
        if wrong:
            return replace(self._record(Ending.SUCCEEDED), ending=Ending.FAILED, faults=wrong)
        return self._record(Ending.WAITING if outcome is None else Ending(outcome.kind()))

    def _record(self, ending: Ending) -> ExecutionRecord:
        progress = self._executive.progress
        facts = conflict(progress, solver=self.solver) if ending is Ending.FAILED else None
        return ExecutionRecord(
            ending,
            progress.now,
            tuple(self._steps),
            dict(progress.chosen),
            dict(progress.times),
            plan=self.plan,
            seed=self.seed,
            reasoner=backends.DRAKE
            if self.drake
            else backends.SMT
            if self.backend == backends.SMT
            else backends.WINDOWS,
            backend=self.backend,
            explained=self.explain,
            conflict=facts or (),
            thrift=replace(self._executive.thrift),
        )

    def step(self, now: Fraction, messages: Sequence[said.Message]) -> list[said.Decision]:
        """One step of the executive, recorded."""
        started = time.perf_counter()
        decisions = self._executive.step(now, messages)
        seconds = time.perf_counter() - started
        changed = any(isinstance(decision, said.Chosen | said.Violated) for decision in decisions)
        inferred = self._inferred() if self.infer and changed and not self._executive.ended else {}
        undecided = self._executive.undecided
        step = ExecutionStep(now, tuple(messages), tuple(decisions), undecided, inferred, seconds)
        if self._likely is not None and (not self._steps or any(isinstance(each, said.Chosen) for each in decisions)):
            forecast = self._likely.forecast(self._executive.progress.chosen)
            step = replace(step, success=forecast.success, intents=tuple(forecast.intents()))
        if messages or decisions:
            self._steps.append(step)
            if self.explain:
                inquiry = Inquiry(self._executive.progress, solver=self.solver, deadline=self.deadline)
                step = self._steps[-1] = replace(step, reasons=inquiry.step(decisions, inferred))
            self.on_step(step)
        return decisions

    @property
    def wake(self) -> Fraction | None:
        """When the executive is to step again."""
        return self._driven.wake

    @property
    def ended(self) -> bool:
        """Whether the execution has succeeded or failed."""
        return self._driven.ended

    def _deciding(self) -> Callable[[said.Progress], semantic.Reasoner]:
        """What makes the reasoner that decides."""
        return reasoners.make_reasoner(self.backend, solver=self.solver, deadline=self.deadline)

    def _judge(self) -> semantic.Reasoner:
        """The semantic reasoner that advises the team: the one that decides, if it is semantic, or one beside it."""
        own = self._driven.reasoner
        if self.backend == backends.SMT and own.view is not None:
            return own
        return reasoners.make_semantic(self._driven.progress, solver=self.solver, deadline=self.deadline)

    def _inferred(self) -> dict[str, tuple[str, ...]]:
        chosen = self._executive.progress.chosen
        known = {choice: values for choice, values in self._known.items() if choice not in chosen and len(values) > 1}
        possible = {choice: self._executive.possible_values(choice) for choice in known}
        changed = {choice: values for choice, values in possible.items() if values != known[choice]}
        self._known.update(changed)
        return changed

    def _faults(self) -> tuple[str, ...]:
        """The referee's word on an execution without disturbances, whose choices are complete where they matter."""
        progress = self._executive.progress
        if progress.void:
            return ()
        scenario = {name: domain[0] for name, domain in self.plan.network.domains.items()} | progress.chosen
        activated = {name for name, guard in progress.structure.guards.items() if holds(guard, scenario)}
        if activated != progress.times.keys():
            return ()  # a choice that was never made decides about events of its own
        wrong = faults(self.plan, Execution(scenario, progress.times), reported=progress.reported)
        return tuple(map(str, wrong))
