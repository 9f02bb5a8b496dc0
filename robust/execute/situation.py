"""Planning from where an execution is: what runs, what has happened, and what may still come, as a planning problem.

Planning takes time, in which the world does not stand still. So a new plan begins at a later moment, by which what runs
may have ended, and timed literals have come. Until then and beyond, steps that run are kept: each becomes a step
`running--NAME` that can only begin at once, lasts as long as is left, keeps what the step needs until its end, and has
its effects at the end. The goal asks for its end, so that it is part of every plan.

A planner is asked about the problem in which time begins at that moment. Its answer is then made a network in the time
of the run, where steps that run have the start that they had; that network is proved before it is handed out. Of
several plans it is the one that bears most (λ*, :func:`robust.irr.proposals.tolerance`), then the one that ends first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import ceil
from operator import attrgetter
from typing import Any

from robust import errors
from robust.encode.interface import EPSILON
from robust.execute.convert import ConversionEnd, Settings, convert
from robust.execute.monitor import Monitor
from robust.execute.parametrization import DEADLINE, write_specs
from robust.execute.planners.interface import Planner, PlannerAnswer
from robust.execute.worlds import WorldState
from robust.irr.proposals import tolerance
from robust.irr.stops import Tolerance
from robust.plan import load, model, stn, timeline
from robust.plan.parameters import ParameterSpec, Target
from robust.plan.pddl import syntax, write
from robust.plan.timed import TimedPlan, TimedStep
from robust.presented import NoTruthValue
from robust.smt.limits import Deadline

RUNNING, ENDED, LEFT = "running--", "ended--", "left--"
"""What the names of actions, predicates and functions for steps that run begin with."""
IN_TIME = "in--time"
"""What is true until a deadline."""
GRACE = 10
"""Separations in a step of the grid on which plans begin; by one, steps that run may begin late in a planner's plan."""
PLANNING = 0.75
"""The share of the time that the planner has; the rest is for the proof."""


@dataclass(frozen=True, slots=True)
class RunningStep:
    """A step that has started and not ended; as planned it ends at `expected`, in the time of the problem."""

    step: str
    action: str
    arguments: tuple[str, ...]
    since: Fraction
    expected: Fraction


@dataclass(frozen=True, slots=True)
class RunState:
    """Where an execution is.

    Attributes:
        time: the moment, in the time of the problem.
        state: what is true then; effects at the ends of steps that run are still to come.
        running: steps that run.
        used: identifiers that steps of another plan must not have.
    """

    time: Fraction
    state: timeline.State
    running: tuple[RunningStep, ...] = ()
    used: frozenset[str] = frozenset()


class NoPlanError(errors.RobustError):
    """The planner found no plan that can be executed."""

    exit_code = 1


@dataclass(frozen=True)
class NewPlan(NoTruthValue, ask="plan"):
    """A plan from a situation on, proved.

    Attributes:
        plan: in the time of the run; what runs keeps its identifier and its start.
        network: as it is written; with `domain`, `problem` and `specs` it reads as the plan.
        domain: with the actions for steps that run.
        problem: in the time of the run, with the state of the situation.
        specs: parameters that the network cannot hold by itself.
        begins: nothing that the plan adds starts before, in the time of the run.
        ends: when it ends as planned, in the same time.
        bears: by which share all durations may differ at once; None if that is no single number.
        found: how many valid plans came back.
        planner: who found it.
        seconds: how long the planner took, by the clock.
    """

    plan: model.ParametrizedPlan
    network: stn.STNPlan
    domain: syntax.Domain
    problem: syntax.Problem
    specs: tuple[ParameterSpec, ...]
    begins: Fraction
    ends: Fraction
    bears: Tolerance | None
    found: int
    planner: str
    seconds: float

    @property
    def as_news(self) -> dict[str, Any]:
        """What the run is told."""
        bears = None if self.bears is None else self.bears.ratio
        figures = {"begins": self.begins, "planner": self.planner, "seconds": round(self.seconds, 3)}
        return {"status": "found", **figures, "plans": self.found, "tolerance": bears, **self.texts}

    @cached_property
    def texts(self) -> dict[str, str]:
        """The domain, the problem, the plan and its parameters as files hold them."""
        return {
            "domain": write.domain_text(self.domain),
            "problem": write.problem_text(self.problem, self.domain),
            "plan": stn.write_stn(self.network),
            "parameters": write_specs(self.specs),
        }


# -- the situation -----------------------------------------------------------------------------------------------------


def run_state(monitor: Monitor) -> RunState:
    """Where the execution of a plan is by what its monitor has been told; steps that failed had their first effects."""
    plan, known = monitor.plan, monitor.state
    running = []
    for step, since in sorted(known.running.items(), key=lambda each: each[1]):
        instance = plan.instance[step]
        expected = since + monitor.planned[step]
        running.append(RunningStep(step, instance.action, instance.arguments, since, expected))
    state = timeline.State(known.atoms, known.fluents)
    return RunState(known.time, state, tuple(running), monitor.retired | plan.instance.keys())


def deadline_of(plan: model.ParametrizedPlan) -> Fraction | None:
    """By when all must end, if that was asked for beside the plan."""
    named = (bound.upper for bound in plan.constraints if bound.name == DEADLINE)
    return min((upper.constant_term for upper in named if upper is not None), default=None)


# -- the problem that is left ------------------------------------------------------------------------------------------


def origin_after(now: Fraction, literals: Iterable[model.TimedLiteral], epsilon: Fraction) -> Fraction:
    """When the next plan may begin: ε after the last event, and after any timed literal that comes just before then.

    What starts at time zero of the next plan may be mutex with what has just happened. If ε is 0 it begins a little
    later, because that has to be at another time.
    """
    gap = epsilon or EPSILON
    origin = now + gap
    for literal in sorted(literals, key=_moment):
        if origin - gap < literal.time <= origin:
            origin = literal.time + gap
    return origin


def remaining_problem(problem: syntax.Problem, state: timeline.State, origin: Fraction) -> syntax.Problem:
    """The problem from `origin` on, in the time of `problem`, with the state that is reached there.

    Timed literals that are still to come keep their moments; those that have passed are part of the state. Deadlines
    that are timed literals move with them.
    """
    coming = (literal for literal in problem.timed_literals if literal.time > origin)
    later = tuple(replace(literal, time=literal.time - origin) for literal in coming)
    return replace(problem, atoms=frozenset(state.atoms), fluents=dict(state.fluents), timed_literals=later)


@dataclass(frozen=True)
class OpenProblem:
    """What is left of a problem in a situation, once planning has taken its time.

    Args:
        domain: the domain of the run.
        problem: its problem, with all its timed literals.
        situation: where the run is, whose state may mention more than the problem does.
        planning_time: how long planning takes, in the unit of time.
        epsilon: the separation of mutex time points.
        deadline: by when all must end, in the time of the run; None is never.
    """

    domain: syntax.Domain
    problem: syntax.Problem
    situation: RunState
    planning_time: Fraction
    epsilon: Fraction
    deadline: Fraction | None = None

    def __post_init__(self) -> None:
        steps = [(running.action, running.arguments) for running in self.situation.running]
        if len(set(steps)) < len(steps):
            raise errors.UnsupportedError("cannot plan from here: an action runs twice at once")

    @cached_property
    def _grid(self) -> Fraction:
        return GRACE * (self.epsilon or EPSILON)

    @cached_property
    def origin(self) -> Fraction:
        """When the new plan begins; on a grid, since some planners count time."""
        gap, literals = self.epsilon or EPSILON, self.problem.timed_literals
        moment = self.situation.time + self.planning_time
        while True:
            origin = ceil(origin_after(moment, literals, self.epsilon) / self._grid) * self._grid
            if origin_after(origin - gap, literals, self.epsilon) == origin:
                return origin
            moment = origin

    def expected(self, running: RunningStep) -> Fraction:
        """When a step ends as planned; what is late may end as soon as the plan begins."""
        return self.origin + max(ceil((running.expected - self.origin) / self._grid), 1) * self._grid

    @cached_property
    def asked(self) -> tuple[syntax.Domain, syntax.Problem]:
        """For planners: time begins at the origin."""
        state = WorldState(self._known.atoms, self._known.fluents)
        for literal in sorted(self.problem.timed_literals, key=_moment):
            if self.situation.time < literal.time <= self.origin:
                state.pass_literal(literal)
        problem = remaining_problem(self.problem, state.snapshot(), self.origin)
        left = {running: self.expected(running) - self.origin for running in self.situation.running}
        limit = tuple(model.TimedLiteral(self._grid, _atom(RUNNING, running), value=False) for running in left)
        problem = replace(problem, timed_literals=tuple(sorted((*limit, *problem.timed_literals), key=_moment)))
        domain, problem = self._kept(problem, left, syntax.Comparator.EQUAL)
        if self.deadline is None:
            return domain, problem
        return _limited(domain, problem, (self.deadline - self.origin) // self._grid * self._grid)

    @cached_property
    def true(self) -> tuple[syntax.Domain, syntax.Problem]:
        """In the time of the run, with the state of the situation."""
        coming = tuple(each for each in self.problem.timed_literals if each.time > self.situation.time)
        known = replace(self.problem, atoms=self._known.atoms, fluents=self._known.fluents, timed_literals=coming)
        elapsed = {running: self.situation.time - running.since for running in self.situation.running}
        return self._kept(known, elapsed, syntax.Comparator.AT_LEAST)

    @cached_property
    def _known(self) -> timeline.State:
        """The state without what an earlier remainder added to it."""
        state, domain = self.situation.state, self.domain
        fluents = {fluent: value for fluent, value in state.fluents.items() if fluent.function in domain.functions}
        return timeline.State(frozenset(a for a in state.atoms if a.predicate in domain.predicates), fluents)

    def _kept(
        self, problem: syntax.Problem, lasts: dict[RunningStep, Fraction], comparator: syntax.Comparator
    ) -> tuple[syntax.Domain, syntax.Problem]:
        """With an action for each step that runs: how long it lasts compares so with these durations."""
        domain, where = self.domain, self.domain.location
        predicates, functions, actions = dict(domain.predicates), dict(domain.functions), dict(domain.actions)
        goals = [problem.goal]
        for running in lasts:
            name, schema = running.action, domain.actions[running.action]
            for mark in (RUNNING + name, ENDED + name):
                predicates[mark] = syntax.Signature(mark, schema.parameters, where)
            functions[LEFT + name] = syntax.Signature(LEFT + name, schema.parameters, where)
            actions[RUNNING + name] = _rest(schema, comparator)
            terms = tuple(syntax.Term(argument, False, where) for argument in running.arguments)
            goals.append(syntax.Proposition(ENDED + name, terms, where))
        left = {model.Fluent(LEFT + running.action, running.arguments): time for running, time in lasts.items()}
        kept = replace(
            problem,
            atoms=problem.atoms | {_atom(RUNNING, running) for running in lasts},
            fluents={**problem.fluents, **left},
            goal=syntax.Conjunction(tuple(goals), where),
        )
        return replace(domain, predicates=predicates, functions=functions, actions=actions), kept

    def in_run(self, timed: TimedPlan) -> TimedPlan:
        """A plan for what was asked in the time of the run; steps that run first, where they began."""
        runs = {(RUNNING + each.action, each.arguments): each for each in self.situation.running}
        number = _numbers(self.situation.used)
        named: list[tuple[TimedStep, str]] = []
        for step in timed.steps:
            time, running = self.origin + step.time, runs.get((step.action, step.arguments))
            if running is None:
                named.append((replace(step, time=time), next(number)))
                continue
            length = time + (step.duration or 0) - running.since
            named.append((replace(step, time=running.since, duration=length, printed=("", "")), running.step))
        return replace(timed, steps=tuple(step for step, _ in named), names=tuple(name for _, name in named))


def _limited(domain: syntax.Domain, problem: syntax.Problem, latest: Fraction) -> tuple[syntax.Domain, syntax.Problem]:
    """With a deadline: an atom that becomes false then, and that each action needs when it ends."""
    if latest <= 0:
        raise NoPlanError("the deadline is over before another plan could begin")
    where, mark = domain.location, model.Atom(IN_TIME)
    needed = syntax.Proposition(IN_TIME, (), where)
    actions = {}
    for name, schema in domain.actions.items():
        timing = model.Timing.AT_END if schema.durative else model.Timing.AT_START
        demand = syntax.TimedLiftedCondition(timing, needed)
        actions[name] = replace(schema, conditions=(*schema.conditions, demand))
    predicates = {**domain.predicates, IN_TIME: syntax.Signature(IN_TIME, (), where)}
    literals = sorted((*problem.timed_literals, model.TimedLiteral(latest, mark, value=False)), key=_moment)
    limited = replace(problem, atoms=problem.atoms | {mark}, timed_literals=tuple(literals))
    return replace(domain, predicates=predicates, actions=actions), limited


_moment = attrgetter("time")


def _atom(mark: str, running: RunningStep) -> model.Atom:
    return model.Atom(mark + running.action, running.arguments)


def _numbers(used: frozenset[str]) -> Iterator[str]:
    number = 0
    while True:
        if f"n{number}" not in used:
            yield f"n{number}"
        number += 1


def _rest(schema: syntax.ActionSchema, comparator: syntax.Comparator) -> syntax.ActionSchema:
    """What is left of an action that runs; its rates have been at work, which no state at one moment says."""
    where, start, end = schema.location, model.Timing.AT_START, model.Timing.AT_END
    terms = tuple(syntax.Term(parameter.name, True, where) for parameter in schema.parameters)
    if any(isinstance(effect, syntax.ContinuousUpdate) for effect in syntax.primitive(schema.effects)):
        raise errors.UnsupportedError(f"cannot plan from here: {schema.name} runs, which has continuous effects", where)

    def later(effect: syntax.LiftedEffect) -> bool:
        return all(getattr(part, "timing", start) is end for part in syntax.primitive([effect]))

    mark = syntax.Proposition(RUNNING + schema.name, terms, where)
    ended = syntax.Proposition(ENDED + schema.name, terms, where)
    effects = (effect for effect in schema.effects if later(effect))
    length = syntax.FunctionTerm(LEFT + schema.name, terms, where)
    return replace(
        schema,
        name=RUNNING + schema.name,
        durations=(syntax.DurationBound(start, comparator, length, where),),
        conditions=(
            syntax.TimedLiftedCondition(start, mark),
            *(part for part in schema.conditions if part.timing is not start),
        ),
        effects=(syntax.LiteralEffect(start, mark, False), *effects, syntax.LiteralEffect(end, ended, True)),
    )


# -- planning ----------------------------------------------------------------------------------------------------------


def plans_for(
    planner: Planner | None, domain: syntax.Domain, problem: syntax.Problem, deadline: Deadline
) -> tuple[PlannerAnswer, Sequence[TimedPlan]]:
    """The answer of a planner, and the valid plans in it, the last one first.

    Raises:
        NoPlanError: if there is none, with the reason in one line.
    """
    if planner is None:
        raise NoPlanError("there is no planner to ask for another plan")
    try:
        answer = planner.solve(domain, problem, deadline)
    except errors.RobustError as error:
        raise NoPlanError(str(error)) from None
    if answer.plan is None:
        raise NoPlanError(f"{answer.planner}: {answer.status.value}: {answer.message}".rstrip(": "))
    return answer, (answer.plan, *answer.others)


def new_plan(remainder: OpenProblem, planner: Planner | None, seconds: float | None, settings: Settings) -> NewPlan:
    """A plan for what is left, proved; the best if several come back.

    Args:
        remainder: what is left.
        planner: who is asked.
        seconds: how long planning and the proof may take; None without limit.
        settings: how steps become a network, in the time of the run.

    Raises:
        NoPlanError: if none was found, or none that is proved, with the reason in one line.
    """
    deadline = Deadline.after(seconds)
    answer, plans = plans_for(
        planner, *remainder.asked, Deadline.after(None if seconds is None else seconds * PLANNING)
    )
    proved: list[NewPlan] = []
    wrong = ""
    for timed in plans:
        if proved and deadline.passed:
            break
        try:
            proved.append(_proved(remainder, answer, remainder.in_run(timed), deadline, settings))
        except errors.RobustError as error:
            wrong = wrong or str(error)
    if not proved:
        raise NoPlanError(f"{answer.planner}: no plan that is proved: {wrong}")
    return replace(max(proved, key=_merit), found=len(proved))


def _merit(found: NewPlan) -> tuple[Fraction, Fraction]:
    """The greater the better, as for :class:`robust.sweeps.rank.RankedPlan`."""
    return Fraction(-1) if found.bears is None else found.bears.ratio, -found.ends


def _proved(
    remainder: OpenProblem, answer: PlannerAnswer, timed: TimedPlan, deadline: Deadline, settings: Settings
) -> NewPlan:
    """A plan in the time of the run as a network, in which nothing new starts before the plan begins."""
    domain, problem = remainder.true
    specs = fitting(_specs(settings.specs), timed)
    conversion = convert(domain, problem, timed, replace(settings, specs=specs, timeout=deadline.remaining))
    if conversion.ended is ConversionEnd.INTERRUPTED:
        raise KeyboardInterrupt
    since = {running.step: running.since for running in remainder.situation.running}
    limits = []
    for instance in conversion.stn.instances:
        at = since.get(instance.identifier)
        first = min(conversion.schedule[instance.start], remainder.origin) if at is None else at
        limits.append(stn.STNConstraint(instance.start, model.ZERO, first, at))
    network = replace(conversion.stn, constraints=(*conversion.stn.constraints, *limits))
    plan = read_again(domain, problem, network, conversion.beside)
    borne = tolerance(plan, settings.epsilon, deadline, settings.solver)
    ends = max(conversion.schedule[instance.end] for instance in conversion.stn.instances)
    found = (remainder.origin, ends, borne, 1, answer.planner, answer.seconds)
    return NewPlan(plan, network, domain, problem, conversion.beside, *found)


def read_again(
    domain: syntax.Domain, problem: syntax.Problem, network: stn.STNPlan, specs: Sequence[ParameterSpec]
) -> model.ParametrizedPlan:
    """The plan of a network for a remainder, in which steps that run have the names that they began with."""
    plan = load.assemble(domain, problem, network, specs)
    named = (replace(each, action=each.action.removeprefix(RUNNING)) for each in plan.instances)
    return replace(plan, instances=tuple(named))


def fitting(specs: Iterable[ParameterSpec], timed: TimedPlan) -> tuple[ParameterSpec, ...]:
    """The specifications that are about fluents, or about instances and actions that a plan has."""
    known = {"*", *timed.identifiers}
    known |= {name for step in timed.steps for name in (step.action, f"({' '.join((step.action, *step.arguments))})")}
    durations = {Target.DURATION, Target.SHARED, Target.START}
    return tuple(spec for spec in specs if spec.target not in durations or spec.subject in known)


def _specs(specs: Iterable[ParameterSpec]) -> Iterator[ParameterSpec]:
    """Specifications for another plan: those of actions also for steps that run, and nominal values are its own."""
    for spec in specs:
        attributes = {word: value for word, value in spec.attributes.items() if word != "default"}
        if spec.target is Target.EXISTING:
            continue
        yield replace(spec, attributes=attributes)
        if spec.target in {Target.DURATION, Target.SHARED} and spec.subject != "*":
            opening = "(" if spec.subject.startswith("(") else ""
            subject = f"{opening}{RUNNING}{spec.subject.removeprefix('(')}"
            yield ParameterSpec(Target.DURATION, subject, None, attributes, spec.location)
