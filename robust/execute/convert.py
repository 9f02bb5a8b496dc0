"""Conversion of time-triggered plans to parametrized STN plans [IRR §3, Figure 1].

The causal network (:mod:`robust.execute.causal`) comes first: only what keeps every condition true, in the order of the
plan. What comparisons of numbers ask of distances in time is added as counterexamples need it; where there are
parameters, :mod:`robust.execute.room` sees to it that the network takes nothing from them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from robust.encode.interface import EPSILON
from robust.errors import Location, SolverError, UnsupportedError
from robust.execute import causal as causality
from robust.execute import distances, snap
from robust.execute.causal import Tightener, Tightening, UndecidedError, check_plan, undecided, verdict_of
from robust.execute.parametrization import Parametrization, parametrization, with_deadline, with_relative_weights
from robust.execute.room import esterel_edges
from robust.irr.check import Answer, CheckResult
from robust.numbers import Number, format_number, plural
from robust.plan import load, model, parameters
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.simulate import simulate
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan
from robust.presented import Presented, VerdictEnum
from robust.qe.box import Box
from robust.smt.limits import Deadline, OutOfTimeError, one_question


class Mode(Enum):
    """Method of conversion: all room to the parameters first, the least constrained network that is proved at their
    nominal values, or the network of the paper's transformer."""

    ROOM = "room"
    CAUSAL = "causal"
    ESTEREL = "esterel"


class ConversionEnd(VerdictEnum):
    """Status of a conversion; unless complete, its network is proved, but not the least constrained one."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    UNDECIDED = "undecided"


_ENDINGS = {
    ConversionEnd.TIMEOUT: "out of time",
    ConversionEnd.INTERRUPTED: "interrupted",
    ConversionEnd.UNDECIDED: "the solver could not decide about it",
}


@dataclass(frozen=True)
class Conversion(Presented, ask="check"):
    """A plan with a temporal network that allows the schedule it was made from; taken wherever a plan is.

    `stn` is the plan to write, and `plan` what reading it gives. `beside` are the parameters that the plan file cannot
    hold by itself: initial values of fluents, and durations that the domain fixes. `schedule` is that of the
    time-triggered plan, `check` the verdict about all schedules at nominal values; PROVED in mode CAUSAL. `tightened`
    says which bounds were needed beyond what keeps atoms true, and `redundant` how many edges the others implied, or
    the proof did not need. `epsilon` and `solver` are as they were asked for; `gap` is how far apart the network keeps
    mutex time points if ε is 0, where one network cannot allow all that is valid. Times are in the plan's unit.
    """

    mode: Mode
    stn: STNPlan
    plan: model.ParametrizedPlan
    beside: tuple[parameters.ParameterSpec, ...]
    schedule: Mapping[model.TimePoint, Fraction]
    snapped: snap.Snapped
    check: CheckResult
    tightened: tuple[Tightening, ...] = ()
    redundant: int = 0
    ended: ConversionEnd = ConversionEnd.COMPLETE
    epsilon: Fraction = EPSILON
    solver: str = "z3"
    gap: Fraction = EPSILON

    def __repr__(self) -> str:
        size = f"{plural(len(self.stn.instances), 'step')}, {plural(len(self.stn.constraints), 'constraint')}"
        return f"<Conversion: {size}, {self.check.answer.value}; taken where a plan is; print() shows it>"

    @property
    def cut_short(self) -> bool:
        """Whether something ended the conversion before the network was as loose as can be."""
        return self.ended is not ConversionEnd.COMPLETE

    def notes(self, timed: TimedPlan) -> tuple[str, ...]:
        """Notes for the user: parts of the text that were skipped, times that were moved, and limits of the network."""
        missing = f"not the least constrained network: {_ENDINGS[self.ended]}" if self.cut_short else ""
        taken = ""
        if self.plan.parameters and self.tightened and (self.mode is Mode.CAUSAL or self.cut_short):
            taken = "distances that the network asks for may have used up room of the parameters"
            taken += "; --mode room gives them all there is" if self.mode is Mode.CAUSAL else ""
        gap = f"a network cannot say 'at different times': dependent times are {format_number(self.gap)} apart or more"
        return tuple(filter(None, (timed.note, str(self.snapped), missing, taken, "" if self.epsilon else gap)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings of a conversion.

    Attributes:
        mode: how the network is made.
        free_durations: in mode ROOM, let durations vary that the domain leaves open; else all are as planned.
        specs: what becomes a parameter, see :mod:`robust.plan.parameters`; nominal values of durations and starts are
            those of the plan.
        deadline: by when every action must end, as :func:`robust.execute.parametrization.latest_end` reads it;
            None is never.
        relative: weights of parameters are in proportion to nominal values.
        epsilon: the separation of mutex time points, in the plan's unit of time.
        tolerance: how far exact times may be from the printed ones; None is one unit of the last digit that was
            printed, and at most ε.
        solver: `z3` or `cvc5`.
        timeout: seconds after which nothing is proved or loosened any more; None never.
        on_progress: called with what is being done.
    """

    mode: Mode = Mode.ROOM
    free_durations: bool = False
    specs: Sequence[parameters.ParameterSpec] = ()
    deadline: Number | None = None
    relative: bool = False
    epsilon: Fraction = EPSILON
    tolerance: Fraction | None = None
    solver: str = "z3"
    timeout: float | None = None
    on_progress: Callable[[str], None] | None = None


@dataclass
class Converting:
    """A conversion that knows at any moment the best network that is proved: at worst one with a single schedule.

    The fields are the arguments of :func:`convert`.
    """

    domain: Domain
    problem: Problem
    timed: TimedPlan
    settings: Settings = Settings()

    def __post_init__(self) -> None:
        self._deadline = Deadline.after(self.settings.timeout)
        self._say = self.settings.on_progress or (lambda _: None)
        self._proved: _Network | None = None

    def run(self) -> Conversion:
        """The conversion, or the best one so far on a timeout or an interrupt; raises what `convert` does."""
        self._say("executing the plan")
        original, _, _ = self._original
        try:
            if self.settings.mode is Mode.ESTEREL:
                network = _Network(
                    (*esterel_edges(original), *self._ties), check=verdict_of(original.plan, Answer.UNKNOWN)
                )
                self._proved = network
            else:
                network = self._causal()
            stn, plan = self._written(network)
            self._say("proving the plan")
            result = check_plan(plan, self.settings.epsilon, self.settings.solver, self._deadline)
            if self.settings.mode is not Mode.ESTEREL:
                _assert_proved(result)
        except (UndecidedError, OutOfTimeError):
            return self._best(ConversionEnd.UNDECIDED if self._deadline.moment is None else ConversionEnd.TIMEOUT)
        except KeyboardInterrupt:
            return self._best(ConversionEnd.INTERRUPTED)
        return self._conversion(network, stn, plan, result, ConversionEnd.COMPLETE)

    def so_far(self, *, timed_out: bool) -> Conversion | None:
        """The best conversion so far; None while the plan itself is being executed."""
        if "_original" not in vars(self):
            return None
        return self._best(ConversionEnd.TIMEOUT if timed_out else ConversionEnd.INTERRUPTED)

    @cached_property
    def _original(self) -> tuple[distances.Original, Parametrization, snap.Snapped]:
        """The plan at exact times, executed; its parameters; and how far its times moved."""
        timed, epsilon = self.timed, self.settings.epsilon
        instances = distances.declarations(timed, self.domain, epsilon)
        times = distances.schedule_of(timed, instances)
        untimed = STNPlan((), instances, (), timed.file)

        def ground(times: Mapping[model.TimePoint, Fraction]) -> tuple[Parametrization, model.ParametrizedPlan]:
            chosen = parametrization(self.domain, self.problem, untimed, times, self.settings.specs)
            return chosen, load.assemble(self.domain, self.problem, chosen.bare, chosen.fluents)

        chosen, bare = ground(times)
        reach = distances.tolerances(timed, instances, epsilon, Fraction(0) if timed.ties else self.settings.tolerance)
        snapped = distances.snapped(bare, times, reach, epsilon, timed.file)
        if str(snapped):
            times = dict(snapped.times)
            chosen, bare = ground(times)
        return distances.validated(bare, times, epsilon, timed.file), chosen, snapped

    def _causal(self) -> _Network:
        """The least constrained network: causal edges, then bounds, without what others imply for all parameters.

        What the proof does not need goes as well, unless there are parameters: other values of them might need it.
        """
        original, chosen, _ = self._original
        has_parameters = bool(chosen.parameters or chosen.beside)
        tightener = Tightener(original, self.settings.solver, self._deadline, self._say)
        causal = causality.causal_network(original, self._pinned, chosen.pinned_durations)
        fixed = (*causal.durations, *chosen.pinned_starts(original.times), *self._ties)
        network = distances.EdgeNetwork(causal.points, (*causal.certain, *causal.edges))
        irredundant = network.needed(causal.edges, causal.certain)
        needed = (*fixed, *irredundant)
        forced, proof = tightener.forced(needed)
        self._proved = _Network((*needed, *(bound.edge for bound in forced)), tuple(forced), check=proof)
        tightened: tuple[Tightening, ...] = ()
        if not (self.settings.mode is Mode.ROOM and has_parameters):
            tightened = tightener.loosened(needed, forced)
        elif forced or _compares_over_time(original.plan):
            from robust.execute.room import RoomFirst  # noqa: PLC0415 - searches for boxes, which few plans need
            from robust.irr.rates import multiplied  # noqa: PLC0415

            room = RoomFirst(causal, needed, chosen.pinned_durations, tightener, self._parametrized)
            try:
                tightened = room.bounds(forced)
            except UnsupportedError:  # rates times durations that vary: the room is that of durations at nominal rates
                rates = multiplied(self._parametrized(needed))
                if not rates:
                    raise
                tightened = replace(room, held=rates).bounds(forced)
        bounds = [tightening.edge for tightening in tightened]
        every = list(dict.fromkeys((*causal.edges, *bounds)))
        kept = every
        if not (has_parameters or (not bounds and _is_propositional(original.plan))):
            tightener.say("dropping edges")
            kept = tightener.in_less_time.without_removable(fixed, every, {*causal.links, *bounds})
        edges = irredundant
        if kept != list(causal.edges):
            edges = distances.EdgeNetwork(causal.points, (*causal.certain, *kept)).needed(kept, causal.certain)
        if not has_parameters:
            fixed = _without_implied_ranges(fixed, edges)
        redundant = len(every) - len(edges)
        needed_bounds = tuple(bound for bound in tightened if bound.edge in edges)
        return _Network((*fixed, *edges), needed_bounds, redundant)

    @property
    def _ties(self) -> tuple[distances.DistanceEdge, ...]:
        """What keeps time points as far apart as they are."""
        pairs = (
            (first, second, apart)
            for one, other, size in self.timed.ties
            for first, second, apart in ((one, other, size), (other, one, -size))
        )
        return tuple(distances.DistanceEdge(*pair) for pair in pairs)

    @property
    def _pinned(self) -> Collection[str]:
        """The instances whose durations are as planned."""
        original, chosen, _ = self._original
        if self.settings.mode is Mode.CAUSAL or self.settings.free_durations:
            return chosen.pinned_durations
        return [instance.identifier for instance in original.plan.instances if instance.durative]

    def _parametrized(self, edges: Iterable[distances.DistanceEdge]) -> model.ParametrizedPlan:
        return self._written(_Network(tuple(edges)))[1]

    def _best(self, ended: ConversionEnd) -> Conversion:
        """The network that was proved last, or the one whose only schedule is the plan's own; esterel: as it is."""
        network = self._proved or _rigid(self._original[0])
        stn, plan = self._written(network)
        proof = verdict_of(plan, Answer.PROVED) if network.check is None else network.check
        return self._conversion(network, stn, plan, replace(proof, box=Box.nominal(plan.parameters)), ended)

    def _written(self, network: _Network) -> tuple[STNPlan, model.ParametrizedPlan]:
        """The plan with the network, durations first; a distance that is a parameter has no other bounds."""
        original, chosen, _ = self._original
        points = sorted(original.plan.time_points, key=lambda point: (point != model.ZERO, original.times[point]))
        plain = distances.constraints_of(network.edges, {point: i for i, point in enumerate(points)})
        said = {frozenset((bound.source, bound.target)) for bound in chosen.constraints}
        every = [*(bound for bound in plain if {bound.source, bound.target} not in said), *chosen.constraints]
        constraints = tuple(sorted(every, key=lambda bound: bound.source.instance != bound.target.instance))
        stn = replace(chosen.bare, parameters=chosen.parameters, constraints=constraints)
        end = max(original.times[instance.end] for instance in stn.instances)
        stn = with_deadline(stn, self.settings.deadline, Location("--deadline"), end)
        stn = with_relative_weights(stn) if self.settings.relative else stn
        return stn, load.assemble(self.domain, self.problem, stn, chosen.beside)

    def _conversion(
        self, network: _Network, stn: STNPlan, plan: model.ParametrizedPlan, check: CheckResult, ended: ConversionEnd
    ) -> Conversion:
        """The conversion, once the simulator has confirmed that the network allows the plan's own schedule."""
        original, chosen, snapped = self._original
        said = tuple(bound for bound in plan.constraints if bound.name is None)  # its own end may be too late
        simulation = simulate(replace(plan, constraints=said), plan.nominal, original.times, epsilon=original.epsilon)
        if not simulation.valid:
            reasons = [*simulation.network_violations, *(violation.obligation for violation in simulation.violations)]
            raise SolverError(
                f"found a network that excludes the plan itself ({reasons[0]}), expected one that allows it; "
                "please report this plan as a bug",
                Location(self.timed.file),
            )
        return Conversion(
            self.settings.mode, stn, plan, chosen.beside, original.times, snapped, check, network.tightened,
            network.redundant, ended, self.settings.epsilon, self.settings.solver, original.gap,
        )  # fmt: skip


@one_question()
def convert(domain: Domain, problem: Problem, timed: TimedPlan, settings: Settings = Settings()) -> Conversion:
    """The time-triggered plan as an STN plan whose network allows its schedule [IRR §3].

    In mode CAUSAL the network is proved valid. Both the proof and the plan's own schedule (executed by the simulator,
    and compared with every constraint) are checked on the very plan that is returned, before it is returned.

    Args:
        domain: the domain, see :func:`robust.plan.pddl.reader.read_domain`.
        problem: the problem.
        timed: the time-triggered plan.
        settings: how its steps become a network.

    Raises:
        InputError: if the plan is empty, or does not fit the domain and problem, or a specification does not fit it.
        InvalidPlanError: if the time-triggered plan breaks an obligation.
        UnsupportedError: for an expression that is not linear.

    Out of time, interrupted, or where the solver cannot decide, the conversion says so (`ended`), and its network is
    the last one that was proved: at worst that which allows the plan's own schedule only.
    """
    return Converting(domain, problem, timed, settings).run()


@dataclass(frozen=True, slots=True)
class _Network:
    """Edges of a plan; `check` is whether they are valid, where that was asked."""

    edges: tuple[distances.DistanceEdge, ...]
    tightened: tuple[Tightening, ...] = ()
    redundant: int = 0
    check: CheckResult | None = None


def _rigid(original: distances.Original) -> _Network:
    """Every time point where the plan has it, one after the other; the plan's own execution is the proof."""
    points = sorted((point for point in original.times if point.time is None), key=original.times.__getitem__)
    edges = []
    for earlier, later in pairwise(points):
        length = original.distance(earlier, later)
        edges += [distances.DistanceEdge(earlier, later, length), distances.DistanceEdge(later, earlier, -length)]
    return _Network(tuple(edges))


def _compares_over_time(plan: model.ParametrizedPlan) -> bool:
    """Whether distances in time decide comparisons: by continuous effects, or over-all conditions over numbers."""
    return any(
        instance.continuous_effects
        or any(
            part.timing is model.Timing.OVER_ALL and next(model.comparisons(part.condition), None) is not None
            for part in instance.conditions
        )
        for instance in plan.instances
    )


def _is_propositional(plan: model.ParametrizedPlan) -> bool:
    """Whether every over-all condition is a conjunction of literals: then each link is needed, or implied."""
    parts = (part for instance in plan.instances for part in instance.conditions)
    over_all = (part.condition for part in parts if part.timing is model.Timing.OVER_ALL)
    return all(isinstance(leaf, model.Holds) for condition in over_all for leaf in model.conjuncts(condition))


def _without_implied_ranges(
    durations: tuple[distances.DistanceEdge, ...], edges: Sequence[distances.DistanceEdge]
) -> tuple[distances.DistanceEdge, ...]:
    """The bounds of durations without those of ranges that all the others imply; a fixed duration keeps both."""
    kept = dict.fromkeys(durations)
    for duration in durations:
        if distances.DistanceEdge(duration.target, duration.source, -duration.weight) not in kept:
            others = [other for other in kept if other != duration]
            if distances.is_implied(duration, (*others, *edges)):
                del kept[duration]
    return tuple(kept)


def _assert_proved(result: CheckResult) -> None:
    broken = next(iter(result.counterexamples), None)
    if broken is not None:
        raise SolverError(f"found {broken!r} broken in the converted plan, expected a proof; please report it as a bug")
    if result.answer is not Answer.PROVED:
        raise UndecidedError(f"found {undecided(result)!r} undecided in the converted plan, expected a proof")
