"""Runs: dispatch a plan in a simulated world, re-plan from the state reached, until it succeeds or nothing helps.

[IRR, Figure 1]: planner → time-triggered plan → network → parameters → box → dispatch → observation outside of the box
→ planner. When a plan is given up, the actions that run are waited for (or stopped, as the mission says); the next plan
begins ε after the last of them has ended, in the state that the world is in then. Planning takes no time in the world
unless the mission says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from time import monotonic

from robust.errors import InputError, RobustError
from robust.execute.dispatch.dispatcher import Dispatcher
from robust.execute.drive import run_in_world
from robust.execute.planners.interface import Planner
from robust.execute.replanning.judge import Beginning, judged
from robust.execute.replanning.plans import Options, Prepared, prepare_timed
from robust.execute.replanning.problem import origin_after, remaining_problem
from robust.execute.replanning.record import Run, RunStatus, Segment
from robust.execute.worlds.actual import condition_with
from robust.execute.worlds.luck import Luck
from robust.execute.worlds.rules import Rules
from robust.execute.worlds.world import Executed, Outcome, SimulatedWorld
from robust.plan.model import GoalCondition, TimePointKind
from robust.plan.numerals import format_number
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.timeline import Reading
from robust.smt.limits import Deadline

REPLANS = 10
PLANNER_SECONDS = 7.0
"""What a run is allowed unless told otherwise, and its planner each time."""


@dataclass(frozen=True)
class Mission:
    """What is to be executed, and how.

    Args:
        domain: the domain.
        problem: the problem.
        planner: who is asked for plans; None if there is nobody to ask, so that a plan that is given up is the end.
        rules: what nature draws.
        options: how plans are made ready.
        replans: how often another plan may be begun.
        planner_seconds: wall time that the planner has for each plan.
        planning_time: how long planning takes in the world, in the plan's unit.
        drain: whether running actions are waited for when a plan is given up; else they are stopped.
    """

    domain: Domain
    problem: Problem
    planner: Planner | None = None
    rules: Rules = Rules()  # noqa: RUF009 - immutable
    options: Options = Options()  # noqa: RUF009 - immutable
    replans: int = REPLANS
    planner_seconds: float = PLANNER_SECONDS
    planning_time: Fraction = Fraction(0)
    drain: bool = True


class _NoPlanError(Exception):
    """There is no plan to go on with; the text says why."""


def first_plan(mission: Mission) -> Prepared:
    """The plan with which every run begins, asked of the planner; runs of one mission can share it.

    Raises:
        NoPlanError: a RobustError that says in one line why there is none.
    """
    try:
        return _planned(mission, mission.problem)[0]
    except _NoPlanError as error:
        raise NoPlanError(str(error)) from None


class NoPlanError(RobustError):
    """The planner found no plan that can be executed."""

    exit_code = 1


def execute(
    mission: Mission,
    seed: int | str,
    prepared: Prepared | None = None,
    *,
    on_segment: Callable[[Segment], None] | None = None,
) -> Run:
    """One simulated run.

    Args:
        mission: what is to be executed.
        seed: of what nature draws: the same seed gives the same run.
        prepared: the first plan, ready for dispatch; the planner is asked if None.
        on_segment: called when a plan has been carried out or given up.

    Returns:
        What happened. The run has succeeded only if the simulator, told all that was executed and drawn, finds the
        goal reached and nothing broken; also when a plan is given up at the end of all that it was for. That a planner
        finds nothing, or that a plan cannot be made ready, ends the run
        as failed.

    Raises:
        InputError: for a rule about a duration that the dispatcher chooses.
    """
    return _Running(mission, seed, on_segment or _silent).run(prepared)


class _Running:
    def __init__(self, mission: Mission, seed: int | str, on_segment: Callable[[Segment], None]) -> None:
        self._mission = mission
        self._seed = seed
        self._luck = Luck(mission.rules, seed)
        self._on_segment = on_segment
        self._begun = monotonic()
        self._segments: list[Segment] = []
        self._beginning: Beginning | None = None

    def run(self, prepared: Prepared | None) -> Run:
        problem, origin = self._mission.problem, Fraction(0)
        planner_seconds = 0.0
        while True:
            try:
                if prepared is None:
                    prepared, planner_seconds = _planned(self._mission, problem)
            except _NoPlanError as error:
                return self._result(RunStatus.FAILED, self._because(str(error)))
            check_rules(prepared, self._mission.rules)
            dispatcher = Dispatcher(prepared.dispatchable, drain=self._mission.drain)
            world = SimulatedWorld(prepared.setting, self._luck, levels_known=bool(self._segments))
            self._begin(prepared, world)
            last = run_in_world(dispatcher, world)
            if not self._mission.drain:
                world.stop(last)
            spent = (planner_seconds, prepared.seconds)
            self._note(dispatcher, world, origin, last, spent)
            if dispatcher.ending is None or not dispatcher.ended:
                return self._finished(dispatcher)
            if self._achieved(world):
                return self._result(RunStatus.SUCCEEDED, "")
            if len(self._segments) > self._mission.replans:
                return self._result(RunStatus.FAILED, self._because(f"gave up after {self._mission.replans} re-plans"))
            epsilon = self._mission.options.epsilon
            begin = origin_after(last + self._mission.planning_time, problem.timed_literals, epsilon)
            world.pass_until(begin)
            problem = remaining_problem(problem, world.state.snapshot(), begin)
            origin += begin
            prepared = None

    def _begin(self, prepared: Prepared, world: SimulatedWorld) -> None:
        """Remember where the run began, for the judge."""
        if self._beginning is None:
            plan = prepared.dispatchable.plan
            goal = tuple(GoalCondition(condition_with(one.condition, world.values), one.text) for one in plan.goal)
            self._beginning = Beginning(plan.initial_atoms, world.initial, plan.timed_literals, goal)

    def _note(
        self,
        dispatcher: Dispatcher,
        world: SimulatedWorld,
        origin: Fraction,
        last: Fraction,
        spent: tuple[float, float],
    ) -> None:
        """Keep what became of a plan; `spent` are seconds of the planner, and of making the plan ready."""
        dispatchable = dispatcher.dispatchable
        ending = dispatcher.ending
        segment = Segment(
            plan=dispatchable.plan,
            box=dispatchable.box,
            guarantee=dispatchable.guarantee,
            start=origin,
            end=origin + last,
            executed=tuple(_moved(one, origin) for one in world.executed.values()),
            observations=tuple(replace(one, time=one.time + origin) for one in dispatcher.observations),
            rejected=tuple(replace(one, time=one.time + origin) for one in dispatcher.rejected),
            ending=ending,
            given_up=None if ending is None else origin + ending.time,
            planner_seconds=spent[0],
            preparation_seconds=spent[1],
        )
        self._segments.append(segment)
        self._on_segment(segment)

    def _finished(self, dispatcher: Dispatcher) -> Run:
        if not dispatcher.ended:
            waiting = ", ".join(dispatcher.running) or "an observation"
            return self._result(RunStatus.FAILED, f"waits for ever for {waiting}")
        fault = self._fault()
        return self._result(RunStatus.SUCCEEDED if fault is None else RunStatus.FAILED, fault or "")

    def _achieved(self, world: SimulatedWorld) -> bool:
        """Whether a plan was given up when all had been done: the goal is reached [IRR, Alg. 2, line 16]."""
        reading = Reading(world.state.snapshot(), {})
        goal = self._beginning.goal if self._beginning is not None else ()
        return all(reading.holds(one.condition) for one in goal) and self._fault() is None

    def _fault(self) -> str | None:
        """What the simulator, told all that was executed and drawn, finds broken."""
        executed = [one for segment in self._segments for one in segment.executed]
        if self._beginning is None or any(one.outcome is Outcome.RUNNING for one in executed):
            return "an instance did not end"
        violations = judged(self._beginning, executed, self._mission.options.epsilon).violations
        if not violations:
            return None
        first = min(violations, key=lambda violation: violation.time)
        return f"broke {first.obligation!r} at {format_number(first.time)}: {first.detail}"

    def _because(self, text: str) -> str:
        last = self._segments[-1].ending if self._segments else None
        return text if last is None else f"{last}; {text}"

    def _result(self, status: RunStatus, reason: str) -> Run:
        return Run(status, reason, tuple(self._segments), monotonic() - self._begun, self._seed)


def check_rules(prepared: Prepared, rules: Rules) -> None:
    """InputError for a rule about a duration that the dispatcher chooses: nature has no say in it."""
    dispatchable = prepared.dispatchable
    for number in dispatchable.ours:
        point = dispatchable.network.points[number]
        instance = dispatchable.plan.instance[point.instance or ""]
        if point.kind is TimePointKind.END and rules.duration(instance) is not None:
            found = f"found a rule for the duration of {instance.identifier} {instance}, which the dispatcher chooses"
            message = f"{found}; expected one that is fixed or a parameter: --parametrize duration:{instance.action}"
            raise InputError(message)


def _moved(one: Executed, origin: Fraction) -> Executed:
    return replace(one, start=one.start + origin, end=None if one.end is None else one.end + origin)


def _planned(mission: Mission, problem: Problem) -> tuple[Prepared, float]:
    """A plan for a problem, ready for dispatch, and the planner's seconds."""
    if mission.planner is None:
        raise _NoPlanError("there is no planner to ask for another plan")
    try:
        answer = mission.planner.solve(mission.domain, problem, Deadline.after(mission.planner_seconds))
        if answer.plan is None:
            raise _NoPlanError(f"{answer.planner}: {answer.status.value}: {answer.message}".rstrip(": "))
        return prepare_timed(mission.domain, problem, answer.plan, mission.options), answer.seconds
    except RobustError as error:
        raise _NoPlanError(str(error)) from None


def _silent(_segment: Segment) -> None:
    """Nobody watches."""
