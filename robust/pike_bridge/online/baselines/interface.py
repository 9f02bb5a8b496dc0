"""Executives by mode: PIKE's own, and those that it is compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from fractions import Fraction
from typing import Protocol, assert_never

from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.online.baselines.drake import without_causes
from robust.pike_bridge.online.baselines.kirk import FREE, Kirk, KirkDecision
from robust.pike_bridge.online.executive import PlanExecutive, Ranking, as_written
from robust.pike_bridge.online.progress import Failed, Message, Progress, Succeeded
from robust.pike_bridge.online.reasoner import Reasoner
from robust.pike_bridge.semantics import Execution, faults
from robust.smt.limits import Deadline


class Mode(Enum):
    """PIKE keeps all hypotheses; DRAKE does so without causal links; KIRK follows one guess and plans anew."""

    PIKE = "pike"
    DRAKE = "drake"
    KIRK = "kirk"


class TeamExecutive(Protocol):
    """What executes a plan with choices: an :class:`robust.execute.drive.Executive` that can be looked at."""

    @property
    def progress(self) -> Progress:
        """What has been executed, of the plan as the executive sees it; its event names are those of the plan."""

    @property
    def assumed(self) -> Mapping[str, str]:
        """Uncontrollable choices that it does not wait for, with the values that it counts on."""

    @property
    def replans(self) -> int: ...

    @property
    def recovered(self) -> Fraction:
        """How long recovery activities take that were planned so far."""

    @property
    def outcome(self) -> Failed | Succeeded | None: ...

    @property
    def ended(self) -> bool: ...

    @property
    def wake(self) -> Fraction | None: ...

    def prepare(self) -> bool: ...

    def step(self, now: Fraction, messages: Sequence[Message] = ()) -> Sequence[KirkDecision]: ...


class Concurrent(PlanExecutive):
    """PIKE's executive as one among others: it assumes nothing, and never plans anew."""

    replans = 0
    recovered = Fraction(0)

    @property
    def assumed(self) -> Mapping[str, str]:
        return {}


def make_executive(
    mode: Mode,
    plan: TeamPlan,
    reasoner: Callable[[Progress], Reasoner],
    *,
    recovery: Mapping[str, Fraction] = FREE,
    ranking: Ranking = as_written,
    monitor: bool = True,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> TeamExecutive:
    """The executive of a mode.

    Args:
        reasoner: as :func:`robust.pike_bridge.online.reasoners.make_reasoner` makes it.
        recovery: for KIRK, how long it takes to undo each action that was begun.
        ranking: in which order events, values and guesses are tried.
        monitor: whether state estimates are compared with what later activities need; never so for DRAKE.
        solver: for KIRK, with which candidates are found.

    Raises:
        SolverError: if the solver is unknown or not installed.
        OutOfTimeError: if the deadline passes before the first guess of KIRK.
    """
    match mode:
        case Mode.PIKE:
            return Concurrent(plan, reasoner, ranking=ranking, monitor=monitor, deadline=deadline)
        case Mode.DRAKE:
            return Concurrent(without_causes(plan), reasoner, ranking=ranking, monitor=False, deadline=deadline)
        case Mode.KIRK:
            return Kirk(
                plan,
                reasoner,
                recovery=recovery,
                ranking=ranking,
                monitor=monitor,
                solver=solver,
                deadline=deadline,
            )
        case _:
            assert_never(mode)


def execution_faults(plan: TeamPlan, executive: TeamExecutive) -> tuple[str, ...]:
    """What is wrong, by the whole plan, with an execution that its executive takes for a success.

    Choices that were not made count as their first value; recovery activities are no part of the plan.
    """
    if not isinstance(executive.outcome, Succeeded):
        return ()
    scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | dict(executive.outcome.scenario)
    events = plan.network.guards
    times = {event: time for event, time in executive.progress.times.items() if event in events}
    return tuple(str(fault) for fault in faults(plan, Execution(scenario, times)))
