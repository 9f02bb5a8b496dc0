"""From a planner's answer to a plan ready for dispatch: convert, make parameters, compute the box [IRR, Figure 1]."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from time import monotonic

from robust.encode.interface import EPSILON, create_encoding
from robust.errors import RefutedError, SolverError
from robust.execute.controllability.parametric import parametric_stnu
from robust.execute.controllability.shrink import Dynamically, Strongly, shrink
from robust.execute.convert import convert
from robust.execute.dispatch.executors import Dreex, Executor
from robust.execute.dispatch.prepare import Dispatchable, make_dispatchable
from robust.execute.worlds.world import Setting
from robust.irr.box import Box
from robust.irr.containment import Containment
from robust.irr.irr import IncrementalRobustification
from robust.irr.methods import ExactSearch
from robust.irr.result import EnvelopeResult, Status
from robust.plan.model import ParametrizedPlan
from robust.plan.parametrize import ParameterSpec, Target
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.timed import TimedPlan
from robust.smt.interrupts import noticing_interrupts
from robust.smt.limits import Deadline, OutOfTimeError


@dataclass(frozen=True, slots=True)
class Options:
    """How plans are made ready: which executor, which parameters, how the box is computed, and how long that may take.

    `method` is `widen`, `irr` (with β = 1) or `optimal` (of the boxes that contain the nominal point).
    `timeout` limits conversion and box, each, in seconds; out of time, a box is as large as it has become.
    `controllability` is `dynamic` or `strong` if the box is to be shrunk to its part that is so; None leaves it.
    """

    executor: Executor = field(default_factory=Dreex)
    specs: tuple[ParameterSpec, ...] = ()
    method: str = "widen"
    epsilon: Fraction = EPSILON
    solver: str = "z3"
    timeout: float | None = None
    controllability: str | None = None


@dataclass(frozen=True)
class Prepared:
    """A plan ready to be executed, in any number of simulated runs; `seconds` is what it took to get there."""

    dispatchable: Dispatchable
    setting: Setting
    seconds: float


def prepare_timed(domain: Domain, problem: Problem, timed: TimedPlan, options: Options) -> Prepared:
    """A time-triggered plan, converted to the least constrained network, with its box.

    Specifications of instances and actions that the plan does not have are passed over: another plan may have them.

    Raises:
        RobustError: if the plan is invalid, cannot be converted or has no box.
    """
    begun = monotonic()
    conversion = convert(
        domain,
        problem,
        timed,
        specs=fitting(options.specs, timed),
        epsilon=options.epsilon,
        solver=options.solver,
        timeout=options.timeout,
    )
    return prepare_plan(conversion.plan, options, begun=begun)


def prepare_plan(
    plan: ParametrizedPlan, options: Options, *, box: Box | None = None, begun: float | None = None
) -> Prepared:
    """A plan with its box, which is computed unless it is given.

    Raises:
        RefutedError: if the plan is not valid at its nominal point.
        SolverError: if no box was proved in time.
        InputError: if there is no schedule.
        UnsupportedError: for an expression that is not linear.
    """
    begun = monotonic() if begun is None else begun
    if box is None and isinstance(options.executor, Dreex):
        box = computed_box(plan, options)
    dispatchable = make_dispatchable(plan, box, options.executor, epsilon=options.epsilon)
    return Prepared(dispatchable, Setting(dispatchable), monotonic() - begun)


def computed_box(plan: ParametrizedPlan, options: Options) -> Box:
    """The box of a plan; errors as for :func:`prepare_plan`."""
    found = _search(plan, options)
    if found.status is Status.INVALID:
        raise RefutedError(f"invalid plan: {found.reason}")
    if not found.verified:
        raise SolverError("no box was proved in time; expected one, allow more time")
    return found.box if options.controllability is None else _shrunk(plan, found.box, options)


@noticing_interrupts()
def _search(plan: ParametrizedPlan, options: Options) -> EnvelopeResult:
    deadline = Deadline.after(options.timeout)
    formulas = create_encoding("relational", plan, options.epsilon, deadline)
    if options.method == "irr":
        containment = Containment(formulas, solver=options.solver)
        return IncrementalRobustification(containment, deadline=deadline).run()
    search = ExactSearch(formulas, solver=options.solver, deadline=deadline)
    return search.optimal(contain_nominal=True) if options.method == "optimal" else search.widen(())


def _shrunk(plan: ParametrizedPlan, box: Box, options: Options) -> Box:
    """The part of a box in which a strategy is certain to find the schedules that the box promises."""
    network = parametric_stnu(plan, box)
    deadline = Deadline.after(options.timeout)
    wanted = Dynamically(network, deadline) if options.controllability == "dynamic" else Strongly(network, deadline)
    try:
        return shrink(plan.parameters, box, wanted).box
    except OutOfTimeError:
        raise SolverError("no controllable part of the box was found in time; expected one, allow more time") from None


def fitting(specs: Iterable[ParameterSpec], timed: TimedPlan) -> tuple[ParameterSpec, ...]:
    """The specifications that are about fluents, or about instances and actions that a plan has."""
    known = {f"n{number}" for number in range(len(timed.steps))} | {step.action for step in timed.steps}
    durations = {Target.DURATION, Target.START}
    return tuple(spec for spec in specs if spec.target not in durations or spec.subject in known)
