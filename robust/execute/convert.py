"""Conversion of time-triggered plans to parametrized STN plans [IRR §3, Figure 1]."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction

from robust.encode.interface import EPSILON
from robust.errors import Location, SolverError
from robust.execute.causal import causal_network
from robust.execute.distances import Edge, constraints_of, irredundant, is_implied
from robust.execute.esterel import esterel_edges
from robust.execute.original import Original, declarations, schedule_of, validated
from robust.execute.parametrization import Parametrization, parametrization
from robust.execute.tighten import Tightener, Tightening, check_plan
from robust.irr.check import Answer, CheckResult
from robust.plan.load import assemble
from robust.plan.model import ZERO, ParametrizedPlan, TimePoint
from robust.plan.parametrize import ParameterSpec
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.simulate import simulate
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan
from robust.smt.interrupts import noticing_interrupts
from robust.smt.limits import Deadline


class Mode(Enum):
    """How the network is made: the least constrained one that is proved, or that of the paper's transformer."""

    CAUSAL = "causal"
    ESTEREL = "esterel"


@dataclass(frozen=True)
class Conversion:
    """A plan with a temporal network that allows the schedule it was made from.

    `stn` is the plan to write, and `plan` what reading it gives. `beside` are the parameters that the plan file cannot
    hold by itself: initial values of fluents, and durations that the domain fixes. `schedule` is that of the
    time-triggered plan, `check` the verdict about all schedules at nominal values; PROVED in mode CAUSAL. `tightened`
    says which bounds were needed beyond what keeps atoms true, and `redundant` how many edges the others implied, or
    the proof did not need.
    """

    mode: Mode
    stn: STNPlan
    plan: ParametrizedPlan
    beside: tuple[ParameterSpec, ...]
    schedule: Mapping[TimePoint, Fraction]
    check: CheckResult
    tightened: tuple[Tightening, ...] = ()
    redundant: int = 0


@noticing_interrupts()
def convert(
    domain: Domain,
    problem: Problem,
    timed: TimedPlan,
    *,
    mode: Mode = Mode.CAUSAL,
    specs: Iterable[ParameterSpec] = (),
    epsilon: Fraction = EPSILON,
    solver: str = "z3",
    timeout: float | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Conversion:
    """The time-triggered plan as an STN plan whose network allows its schedule [IRR §3].

    In mode CAUSAL the network is proved valid. Both the proof and the plan's own schedule (executed by the simulator,
    and compared with every constraint) are checked on the very plan that is returned, before it is returned.

    Args:
        domain: the domain, see :func:`robust.plan.pddl.reader.read_domain`.
        problem: the problem.
        timed: the time-triggered plan.
        mode: how the network is made.
        specs: what becomes a parameter, see :mod:`robust.plan.parametrize`; nominal values of durations and starts are
            those of the plan.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        timeout: seconds after which nothing is proved or loosened any more; None never.
        on_progress: called with what is being done.

    Raises:
        InputError: if the plan is empty, or does not fit the domain and problem, or a specification does not fit it.
        InvalidPlanError: if the time-triggered plan breaks an obligation.
        UnsupportedError: for an expression that is not linear.
        SolverError: in mode CAUSAL, if validity is not decided, or not in time.
        KeyboardInterrupt: if interrupted.
    """
    say = on_progress or _silent
    say("executing the plan")
    instances = declarations(timed, domain, epsilon)
    times = schedule_of(timed, instances)
    chosen = parametrization(domain, problem, STNPlan((), instances, (), timed.file), times, specs)
    bare = assemble(domain, problem, chosen.bare, chosen.fluents)
    original = validated(bare, times, epsilon, timed.file)
    deadline = Deadline.after(timeout)
    if mode is Mode.ESTEREL:
        network = _Network(esterel_edges(original))
    else:
        network = _causal(original, chosen, Tightener(original, solver, deadline, say))
    stn = _written(original, chosen, network)
    plan = assemble(domain, problem, stn, chosen.beside)
    say("proving the plan")
    result = check_plan(plan, epsilon, solver, deadline)
    _assert_allowed(plan, original, timed)
    if mode is Mode.CAUSAL and result.answer is not Answer.PROVED:
        raise _not_proved(result)
    return Conversion(mode, stn, plan, chosen.beside, original.times, result, network.tightened, network.redundant)


@dataclass(frozen=True, slots=True)
class _Network:
    edges: tuple[Edge, ...]
    tightened: tuple[Tightening, ...] = ()
    redundant: int = 0


def _causal(original: Original, chosen: Parametrization, tightener: Tightener) -> _Network:
    """The least constrained network: causal edges, then bounds, without what the others imply for all parameters.

    What the proof does not need goes as well, unless there are parameters: other values of them might need it.
    """
    causal = causal_network(original, chosen.pinned_durations)
    fixed = (*causal.durations, *chosen.pinned_starts(original.times))
    needed = irredundant(causal.points, causal.certain, causal.edges)
    tightened = tightener.tighten((*fixed, *needed))
    bounds = [one.edge for one in tightened]
    every = list(dict.fromkeys((*causal.edges, *bounds)))
    kept = every
    if not (chosen.parameters or chosen.beside):
        kept = tightener.without_removable(fixed, every, {*causal.links, *bounds})
    edges = irredundant(causal.points, causal.certain, kept)
    if not (chosen.parameters or chosen.beside):
        fixed = _without_implied_ranges(fixed, edges)
    redundant = len(every) - len(edges)
    return _Network((*fixed, *edges), tuple(one for one in tightened if one.edge in edges), redundant)


def _without_implied_ranges(durations: tuple[Edge, ...], edges: Sequence[Edge]) -> tuple[Edge, ...]:
    """The bounds of durations without those of ranges that all the others imply; a fixed duration keeps both."""
    kept = list(durations)
    for one in durations:
        others = [other for other in kept if other != one]
        if Edge(one.target, one.source, -one.weight) not in kept and is_implied(one, (*others, *edges)):
            kept = others
    return tuple(kept)


def _written(original: Original, chosen: Parametrization, network: _Network) -> STNPlan:
    """The plan with the network, durations first; where a parameter is a distance, nothing else is said about it."""
    points = sorted(original.plan.time_points, key=lambda point: (point != ZERO, original.times[point]))
    plain = constraints_of(network.edges, {point: i for i, point in enumerate(points)})
    every = [*(one for one in plain if not chosen.says_all_about(one)), *chosen.constraints]
    constraints = tuple(sorted(every, key=lambda one: one.source.instance != one.target.instance))
    return replace(chosen.bare, parameters=chosen.parameters, constraints=constraints)


def _assert_allowed(plan: ParametrizedPlan, original: Original, timed: TimedPlan) -> None:
    """That the schedule of the time-triggered plan is one of the network's, and breaks nothing."""
    simulation = simulate(plan, plan.nominal, original.times, epsilon=original.epsilon)
    if not simulation.valid:
        reasons = [*simulation.network_violations, *(one.obligation for one in simulation.violations)]
        raise SolverError(
            f"found a network that excludes the plan itself ({reasons[0]}), expected one that allows it; "
            "please report this plan as a bug",
            Location(timed.file),
        )


def _not_proved(result: CheckResult) -> SolverError:
    broken = next(iter(result.counterexamples), None)
    what = f"{broken!r} broken" if broken else "obligations undecided"
    return SolverError(f"found {what} in the converted plan, expected a proof; allow more time or another solver")


def _silent(_what: str) -> None:
    """Nobody watches."""
