"""One simulated execution from beginning to end, as a record: what happened, what was inferred, and why it failed."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import partial

from robust.errors import SolverError
from robust.execute.drive import run_in_world
from robust.pike_bridge.execution import Execution, faults
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.companion import Accompanied
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.explain import Fact, conflict
from robust.pike_bridge.online.messages import Chosen, Decision, Failed, Message, Succeeded, Violated
from robust.pike_bridge.online.narration import StepReasons, step_reasons
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.online.reasoners import SMT, make_reasoner
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import SimulatedTeam, Story
from robust.smt.limits import Deadline, OutOfTimeError


class Ending(Enum):
    """How an execution ended; WAITING: nothing more will happen, but something was still awaited."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    WAITING = "waiting"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class Step:
    """A moment at which something was reported or decided."""

    time: Fraction
    messages: tuple[Message, ...]
    decisions: tuple[Decision, ...]
    inferred: Mapping[str, tuple[str, ...]]
    """The values still possible of choices that are not made, where that has changed."""
    seconds: float
    """That the executive took to decide."""
    reasons: StepReasons | None = None
    """Of the decisions and inferences, if they were asked for."""


@dataclass(frozen=True)
class Record:
    """An execution. `conflict` are the facts that contradict each other, of one that failed."""

    ending: Ending
    time: Fraction
    steps: tuple[Step, ...]
    choices: Mapping[str, str]
    schedule: Mapping[str, Fraction]
    conflict: tuple[Fact, ...] = ()


@dataclass
class Rehearsal:
    """Executes a plan with a simulated team; `so_far` is what has happened at any moment.

    Args:
        plan: the plan.
        story: what is known beforehand of the team and the world.
        seed: decides the rest.
        infer: whether the values of open choices are found out after each step.
        solver: `z3` or `cvc5`.
        backend: who decides what is executed, of :func:`robust.pike_bridge.online.reasoners.reasoner_names`.
        on_step: called after each step.
        explain: whether the reasons of each step are found out, after it was taken.
    """

    plan: TeamPlan
    story: Story = Story()  # noqa: RUF009 - immutable
    seed: int = 0
    infer: bool = True
    solver: str = "z3"
    backend: str = SMT
    deadline: Deadline = Deadline()  # noqa: RUF009 - immutable
    on_step: Callable[[Step], None] | None = None
    explain: bool = False
    _steps: list[Step] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self._known = dict(self.plan.network.domains)

    def run(self) -> Record:
        """Execute; a deadline or Ctrl-C ends it with what has happened.

        Raises:
            InputError: if there is no such back end.
            OutOfTimeError: if the deadline passes before the first step.
            SolverError: if the solver is unknown, or an execution that ended well is not correct.
        """
        deciding = make_reasoner(self.backend, solver=self.solver, deadline=self.deadline)
        self._executive = PlanExecutive(self.plan, partial(self._reasoner, deciding), deadline=self.deadline)
        world = SimulatedTeam(self.plan, self._executive, self._judge, self.story, seed=self.seed)
        try:
            run_in_world(_Recorded(self), world)
        except OutOfTimeError:
            return self.so_far(Ending.TIMEOUT)
        except KeyboardInterrupt:
            return self.so_far(Ending.INTERRUPTED)
        match self._executive.outcome:
            case Succeeded():
                self._confirm()
                return self.so_far(Ending.SUCCEEDED)
            case Failed():
                return self.so_far(Ending.FAILED)
            case None:
                return self.so_far(Ending.WAITING)

    def so_far(self, ending: Ending) -> Record:
        """What has happened by now, under the given heading."""
        progress = self._executive.progress
        facts = conflict(progress, solver=self.solver) if ending is Ending.FAILED else None
        return Record(
            ending, progress.now, tuple(self._steps), dict(progress.chosen), dict(progress.times), facts or ()
        )

    def step(self, now: Fraction, messages: Sequence[Message]) -> list[Decision]:
        """One step of the executive, recorded."""
        started = time.perf_counter()
        decisions = self._executive.step(now, messages)
        seconds = time.perf_counter() - started
        changed = any(isinstance(each, Chosen | Violated) for each in decisions)
        inferred = self._inferred() if self.infer and changed and not self._executive.ended else {}
        step = Step(now, tuple(messages), tuple(decisions), inferred, seconds)
        if messages or decisions:
            self._steps.append(step)
            if self.explain:
                reasons = step_reasons(self._executive, decisions, inferred, solver=self.solver, deadline=self.deadline)
                step = self._steps[-1] = replace(step, reasons=reasons)
            if self.on_step is not None:
                self.on_step(step)
        return decisions

    @property
    def started(self) -> bool:
        """Whether there is anything to tell."""
        return bool(self._steps)

    @property
    def executive(self) -> PlanExecutive:
        """What decides."""
        return self._executive

    def _reasoner(self, deciding: Callable[[Progress], Reasoner], progress: Progress) -> Reasoner:
        """Who decides; the team is advised by semantics of its own, or by the same where that is what decides."""
        self._judge = SemanticReasoner(progress, solver=self.solver)
        return self._judge if self.backend == SMT else Accompanied(deciding(progress), self._judge)

    def _inferred(self) -> dict[str, tuple[str, ...]]:
        changed: dict[str, tuple[str, ...]] = {}
        for choice, before in self._known.items():
            if choice not in self._executive.progress.chosen and len(before) > 1:
                values = self._executive.possible_values(choice)
                if values != before:
                    changed[choice] = values
        self._known.update(changed)
        return changed

    def _confirm(self) -> None:
        """The referee's word on an execution without disturbances, whose choices are complete where they matter."""
        progress = self._executive.progress
        if progress.void:
            return
        scenario = {name: domain[0] for name, domain in self.plan.network.domains.items()} | progress.chosen
        guards = progress.structure.guards
        activated = {
            name for name, guard in guards.items() if all(scenario[each.variable] == each.value for each in guard)
        }
        if activated != progress.times.keys():
            return  # a choice that was never made decides about events of its own
        found = faults(self.plan, Execution(scenario, progress.times))
        if found:
            raise SolverError(f"the execution is not correct: {found[0]}; please report this")


class _Recorded:
    """A rehearsal as what :func:`simulate` drives."""

    def __init__(self, rehearsal: Rehearsal) -> None:
        self._rehearsal = rehearsal

    def step(self, now: Fraction, messages: Sequence[Message]) -> list[Decision]:
        return self._rehearsal.step(now, messages)

    @property
    def wake(self) -> Fraction | None:
        return self._rehearsal.executive.wake

    @property
    def ended(self) -> bool:
        return self._rehearsal.executive.ended
