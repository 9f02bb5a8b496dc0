"""Execution with re-planning: plans are dispatched in a simulated world until one succeeds or nothing helps.

[IRR, Figure 1]: planner → time-triggered plan → network → parameters → box → dispatch → observation outside of the box
→ planner. When a plan is given up, the actions that run are waited for (or stopped, as the mission says); the next plan
begins ε after the last of them has ended, in the state that the world is in then. Planning takes no time in the world
unless the mission says so.

What really happened is judged by the concrete simulator: one plan of all that was executed, on the original problem. It
shares nothing with the world that simulated the run but the values that were drawn and the times.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from time import monotonic
from typing import TypeVar

from robust import errors, presented, searching
from robust.encode import create_encoding
from robust.execute import drive, slices
from robust.execute.controllability import Control, shrink
from robust.execute.convert import ConversionEnd, Settings, convert
from robust.execute.dispatchable import Blex, Dispatchable, Dreex, Executor, Guarantee, Slice, make_dispatchable
from robust.execute.dispatcher import Dispatcher, Ending, LeftBox, MessageRejected, Observation
from robust.execute.planners.interface import Planner
from robust.execute.rules import Rules
from robust.execute.situation import NoPlanError, fitting, origin_after, plans_for, remaining_problem
from robust.execute.worlds import ExecutedInstance, InstanceOutcome, Luck, SimulatedWorld
from robust.irr.exact import BoxMethod
from robust.numbers import format_number
from robust.plan import model, timeline
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Simulation, simulate
from robust.plan.timed import TimedPlan
from robust.qe import compute
from robust.qe.box import Box
from robust.smt.limits import Deadline, OutOfTimeError, one_question

Event = TypeVar("Event", Observation, MessageRejected, slices.Remainder)


class RunStatus(presented.VerdictEnum):
    """Status of a run."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"


@dataclass(frozen=True)
class Segment:
    """The execution of one plan, from `start` to `end`.

    `box` and `guarantee` are those with which it began. `remainders` are what was left of the envelope after
    observations, for executors that look, and `promised` is the guarantee of the last promise. `ending` is why it was
    given up at `given_up`; None if it was carried out. `executed` are its instances in the order of their starts, with
    times from the beginning of the run.
    """

    plan: model.ParametrizedPlan
    box: Box
    guarantee: Guarantee
    start: Fraction
    end: Fraction
    executed: tuple[ExecutedInstance, ...]
    observations: tuple[Observation, ...]
    rejected: tuple[MessageRejected, ...]
    ending: Ending | None
    given_up: Fraction | None
    remainders: tuple[slices.Remainder, ...] = ()
    promised: Guarantee = Guarantee.NONE
    planner_seconds: float = 0.0
    preparation_seconds: float = 0.0


@dataclass(frozen=True)
class ReplanningRun(presented.NoTruthValue, ask="status"):
    """One run. `reason` says in one line why it failed.

    `inside` says whether every observation was inside its box. `seconds` is wall time.
    """

    status: RunStatus
    reason: str
    segments: tuple[Segment, ...]
    seconds: float
    seed: int | str

    @property
    def replans(self) -> int:
        """Number of plans that were begun after the first."""
        return max(0, len(self.segments) - 1)

    @property
    def inside(self) -> bool:
        return not any(isinstance(segment.ending, LeftBox) for segment in self.segments)

    @property
    def end(self) -> Fraction:
        """When the run ended."""
        return self.segments[-1].end if self.segments else Fraction(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanningOptions(Settings):
    """Preparation of plans: how steps become a network, and the executor and the method for the box.

    `method` finds the box, around the nominal point. `timeout` limits conversion and box, each, in seconds; out of
    time, a box is as large as it has become. `controllability` is `dynamic` or `strong` if the box is to be shrunk to
    its part that is so; None leaves it.
    """

    executor: Executor = field(default_factory=Dreex)
    method: BoxMethod = field(default_factory=BoxMethod)
    controllability: str | None = None


@dataclass(frozen=True)
class Prepared:
    """A plan ready to be executed, in any number of simulated runs; `seconds` is what it took to get there.

    `planner_seconds` are those of the planner that was asked for it in a run.
    """

    dispatchable: Dispatchable
    seconds: float
    planner_seconds: float = 0.0


def prepare_timed(
    domain: Domain,
    problem: Problem,
    timed: TimedPlan,
    options: ReplanningOptions,
    *,
    on_note: Callable[[str], None] | None = None,
) -> Prepared:
    """A time-triggered plan, converted to the least constrained network, with its box.

    Specifications of instances and actions that the plan does not have are passed over: another plan may have them.

    Raises:
        RobustError: if the plan is invalid, cannot be converted or has no box.
    """
    begun = monotonic()
    conversion = convert(domain, problem, timed, replace(options, specs=fitting(options.specs, timed)))
    if conversion.ended is ConversionEnd.INTERRUPTED:
        raise KeyboardInterrupt
    if on_note is not None and (notes := conversion.notes(timed)):
        on_note(f"{timed.file}: {'; '.join(notes)}")
    return prepare_plan(conversion.plan, options, begun=begun)


def prepare_plan(
    plan: model.ParametrizedPlan, options: ReplanningOptions, *, box: Box | None = None, begun: float | None = None
) -> Prepared:
    """A plan with its box, which is computed unless it is given.

    Raises:
        RefutedError: if the plan is not valid at its nominal point.
        SolverError: if no box was proved in time.
        InputError: if there is no schedule.
        UnsupportedError: for an expression that is not linear.
    """
    begun = monotonic() if begun is None else begun
    guided = not isinstance(options.executor, Blex)
    if box is None and guided:
        box = computed_box(plan, options)
    dispatchable = make_dispatchable(plan, box, options.executor, epsilon=options.epsilon)
    if isinstance(options.executor, Slice):
        dispatchable = _sliced(dispatchable, options.executor, options)
    return Prepared(dispatchable, monotonic() - begun)


REGION_SECONDS = 5.0
"""For the envelope, unless options allow less."""


def _sliced(dispatchable: Dispatchable, executor: Slice, options: ReplanningOptions) -> Dispatchable:
    """A dispatchable plan that slices the envelope; where that takes too long, the part of it that was proved."""
    plan = dispatchable.plan
    seconds = REGION_SECONDS if options.timeout is None else min(options.timeout, REGION_SECONDS)
    search = compute.RegionSearch(plan, epsilon=options.epsilon, solver=options.solver, timeout=seconds).run()
    if search.status is searching.Status.INTERRUPTED:
        raise KeyboardInterrupt
    region, exact = slices.sliceable(search, lambda: dispatchable.box)
    return dispatchable.sliced(region, exact=exact, seconds=executor.seconds)


@one_question()
def computed_box(plan: model.ParametrizedPlan, options: ReplanningOptions) -> Box:
    """The box of a plan; errors as for :func:`prepare_plan`."""
    deadline = Deadline.after(options.timeout)
    formulas = create_encoding("relational", plan, options.epsilon, deadline)
    envelope = options.method.search(formulas, solver=options.solver, deadline=deadline).run()
    if envelope.status is searching.Status.INVALID:
        raise errors.RefutedError(f"invalid plan: {envelope.reason}")
    if not envelope.verified:
        raise errors.SolverError("no box was proved in time; expected one, allow more time")
    if options.controllability is None:
        return envelope.box
    try:  # the part in which a strategy is certain to find the schedules that the box promises
        return shrink(plan, envelope.box, Control(options.controllability), deadline=Deadline.after(options.timeout))
    except OutOfTimeError:
        raise errors.SolverError(
            "no controllable part of the box was found in time; expected one, allow more time"
        ) from None


def judged(start: model.ParametrizedPlan, executed: Sequence[ExecutedInstance], epsilon: Fraction) -> Simulation:
    """The execution of everything that was executed, at the times at which it was; `start` is the :func:`beginning`.

    Durations that were not the dispatcher's to choose are facts, and break no duration constraint. An instance that
    failed or was stopped has its effects at the start, and continuous ones until it ended, and no conditions.
    """
    instances: list[model.ActionInstance] = []
    schedule: dict[model.TimePoint, Fraction] = {}
    for number, execution in enumerate(executed):
        instance = _as_it_was(execution, f"{number}.{execution.instance.identifier}")
        instances.append(instance)
        schedule[instance.start] = execution.start
        if instance.durative:
            schedule[instance.end] = execution.start if execution.end is None else execution.end
    return simulate(replace(start, instances=tuple(instances)), {}, schedule, epsilon=epsilon)


def _as_it_was(executed: ExecutedInstance, identifier: str) -> model.ActionInstance:
    done = executed.outcome is InstanceOutcome.DONE
    instance = replace(executed.instance, identifier=identifier)
    if executed.natural or not done:
        instance = replace(instance, durations=())
    if done:
        return instance
    atoms = tuple(effect for effect in instance.atom_effects if effect.timing is model.Timing.AT_START)
    numbers = tuple(effect for effect in instance.numeric_effects if effect.timing is model.Timing.AT_START)
    return replace(instance, conditions=(), atom_effects=atoms, numeric_effects=numbers)


REPLANS = 10
PLANNER_SECONDS = 7.0
"""Defaults: re-plans of a run, and seconds of the planner for each plan."""


@dataclass(frozen=True)
class Mission:
    """The problem to execute, and how it is executed.

    Args:
        domain: the domain.
        problem: the problem.
        planner: the source of plans; with None, giving up a plan ends the run.
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
    options: ReplanningOptions = ReplanningOptions()
    replans: int = REPLANS
    planner_seconds: float = PLANNER_SECONDS
    planning_time: Fraction = Fraction(0)
    drain: bool = True


def first_plan(mission: Mission) -> Prepared:
    """The plan with which every run begins, asked of the planner; runs of one mission can share it.

    Raises:
        NoPlanError: a RobustError that says in one line why there is none.
    """
    return _planned(mission, mission.problem)


def execute(mission: Mission, seed: int | str, prepared: Prepared | None = None) -> ReplanningRun:
    """One simulated run.

    Args:
        mission: what is to be executed.
        seed: of what nature draws: the same seed gives the same run.
        prepared: the first plan, ready for dispatch; the planner is asked if None.

    Returns:
        What happened. The run has succeeded only if the simulator, told all that was executed and drawn, finds the
        goal reached and nothing broken; also when a plan is given up at the end of all that it was for. That a planner
        finds nothing, or that a plan cannot be made ready, ends the run
        as failed.

    Raises:
        InputError: for a rule about a duration that the dispatcher chooses.
    """
    return _Running(mission, seed).run(prepared)


class _Running:
    def __init__(self, mission: Mission, seed: int | str) -> None:
        self._mission = mission
        self._seed = seed
        self._luck = Luck(mission.rules, seed)
        self._begun = monotonic()
        self._segments: list[Segment] = []
        self._beginning: model.ParametrizedPlan | None = None

    def run(self, prepared: Prepared | None) -> ReplanningRun:
        problem, origin = self._mission.problem, Fraction(0)
        while True:
            try:
                if prepared is None:
                    prepared = _planned(self._mission, problem)
            except NoPlanError as error:
                return self._result(RunStatus.FAILED, self._because(str(error)))
            check_rules(prepared, self._mission.rules)
            dispatcher = Dispatcher(prepared.dispatchable, drain=self._mission.drain)
            world = SimulatedWorld(prepared.dispatchable, self._luck, levels_known=bool(self._segments))
            if self._beginning is None:
                self._beginning = beginning(prepared.dispatchable.plan, world)
            last = drive.run_in_world(dispatcher, world)
            if not self._mission.drain:
                world.stop(last)
            self._segments.append(_segment(dispatcher, prepared, world, origin, last))
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

    def _finished(self, dispatcher: Dispatcher) -> ReplanningRun:
        if not dispatcher.ended:
            waiting = ", ".join(dispatcher.running) or "an observation"
            return self._result(RunStatus.FAILED, f"waits for ever for {waiting}")
        fault = self._fault()
        return self._result(RunStatus.SUCCEEDED if fault is None else RunStatus.FAILED, fault or "")

    def _achieved(self, world: SimulatedWorld) -> bool:
        """Whether a plan was given up when all had been done: the goal is reached [IRR, Alg. 2, line 16]."""
        reading = timeline.Reading(world.state.snapshot(), {})
        goal = () if self._beginning is None else self._beginning.goal
        return all(reading.holds(demand.condition) for demand in goal) and self._fault() is None

    def _fault(self) -> str | None:
        """The first violation in a simulation of everything that was executed and drawn; None if there is none."""
        executed = [execution for segment in self._segments for execution in segment.executed]
        if self._beginning is None or any(execution.outcome is InstanceOutcome.RUNNING for execution in executed):
            return "an instance did not end"
        violations = judged(self._beginning, executed, self._mission.options.epsilon).violations
        if not violations:
            return None
        first = min(violations, key=lambda violation: violation.time)
        return f"broke {first.obligation!r} at {format_number(first.time)}: {first.detail}"

    def _because(self, text: str) -> str:
        last = self._segments[-1].ending if self._segments else None
        return text if last is None else f"{last}; {text}"

    def _result(self, status: RunStatus, reason: str) -> ReplanningRun:
        return ReplanningRun(status, reason, tuple(self._segments), monotonic() - self._begun, self._seed)


def check_rules(prepared: Prepared, rules: Rules) -> None:
    """InputError for a rule about a duration that the dispatcher chooses: nature has no say in it."""
    dispatchable = prepared.dispatchable
    for number in dispatchable.ours:
        point = dispatchable.network.points[number]
        instance = dispatchable.plan.instance[point.instance or ""]
        if point.kind is model.TimePointKind.END and rules.is_random(instance):
            fault = f"found a rule for the duration of {instance.identifier} {instance}, which the dispatcher chooses"
            message = f"{fault}; expected one that is fixed or a parameter: --parameter duration:{instance.action}"
            raise errors.InputError(message)


def beginning(plan: model.ParametrizedPlan, world: SimulatedWorld) -> model.ParametrizedPlan:
    """Where a run begins, as things really are, and what it is for: a plan without actions."""
    return model.ParametrizedPlan(
        name="execution",
        parameters=(),
        instances=(),
        constraints=(),
        initial_atoms=plan.initial_atoms,
        initial_fluents={fluent: Polynomial.constant(value) for fluent, value in world.initial.items()},
        timed_literals=plan.timed_literals,
        goal=model.with_values(plan.goal, world.values),
    )


def _segment(
    dispatcher: Dispatcher, prepared: Prepared, world: SimulatedWorld, origin: Fraction, last: Fraction
) -> Segment:
    """The record of the execution of one plan."""

    def moved(events: Iterable[Event]) -> tuple[Event, ...]:
        return tuple(replace(event, time=origin + event.time) for event in events)

    return Segment(
        plan=dispatcher.dispatchable.plan,
        box=prepared.dispatchable.box,
        guarantee=prepared.dispatchable.guarantee,
        start=origin,
        end=origin + last,
        executed=tuple(
            replace(run, start=origin + run.start, end=None if run.end is None else origin + run.end)
            for run in world.executed.values()
        ),
        observations=moved(dispatcher.observations),
        rejected=moved(dispatcher.rejected),
        ending=dispatcher.ending,
        given_up=None if dispatcher.ending is None else origin + dispatcher.ending.time,
        remainders=moved(dispatcher.remainders),
        promised=dispatcher.dispatchable.guarantee,
        planner_seconds=prepared.planner_seconds,
        preparation_seconds=prepared.seconds,
    )


def _planned(mission: Mission, problem: Problem) -> Prepared:
    """A plan for a problem, ready for dispatch."""
    limit = Deadline.after(mission.planner_seconds)
    answer, (last, *_) = plans_for(mission.planner, mission.domain, problem, limit)
    try:
        prepared = prepare_timed(mission.domain, problem, last, mission.options)
        return replace(prepared, planner_seconds=answer.seconds)
    except errors.RobustError as error:
        raise NoPlanError(str(error)) from None
