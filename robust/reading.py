"""Plans from files: read, validated as they stand, and converted to networks."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

from robust.errors import InputError
from robust.numbers import Number, exact, plural, shorten
from robust.options import declare, shared, verbs
from robust.plan.load import File, assemble
from robust.plan.model import HasPlan, ParametrizedPlan, plan_itself
from robust.plan.parameters import ParameterSpec, specifications
from robust.plan.pddl.forms import is_text, plan_text
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import STNPlan, is_network, parse_stn
from robust.plan.timed import TimedPlan, parse_timed_plan

if TYPE_CHECKING:
    from robust.execute.convert import Conversion, Mode, Settings
    from robust.execute.monitor import Monitor
    from robust.execute.planners.interface import Planner
    from robust.execute.situation import NewPlan, RunState
    from robust.execute.validate import Verdict
    from robust.options.batch import CertifyCommand, ConvertCommand, WatchCommand

Plan: TypeAlias = "ParametrizedPlan | HasPlan | Sequence[File | Domain | Problem | TimedPlan | STNPlan]"
"""What :func:`load_plan` or :func:`convert` returns, or a domain, a problem and a plan: three paths or texts."""
WHEN_READ = ("parameters", "parameter_file", "deadline", "widths", "plan_number", "tolerance", "mode", "free_durations")
"""Arguments of :func:`load_plan` that decide what is asked about."""


def load_plan(
    domain: File | Domain,
    problem: File | Problem,
    plan: File | TimedPlan | STNPlan,
    *,
    parameters: str | Sequence[str] = (),
    parameter_file: File | None = None,
    nominal_needed: bool = True,
    deadline: Number | None = None,
    widths: str = "equal",
    plan_number: int | None = None,
    tolerance: Number | None = None,
    mode: str | Mode = "room",
    free_durations: bool = False,
    epsilon: Number = "1/1000",
    solver: str = "z3",
    timeout: Number | None = None,
    on_note: Callable[[str], None] | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> ParametrizedPlan:
    """Read a PDDL domain and problem and a plan: a network (`.stn`), or steps as planners print them.

    Steps are made a network first, which is proved valid: see :func:`robust.convert`. Each of the three is a path, a
    text (a string with a line break or a parenthesis, unless a file has that name), or what reading one gives.

    Args:
        domain: the PDDL domain.
        problem: the PDDL problem.
        plan: the plan; "-" is standard input.
        parameters: what is made a parameter, see :mod:`robust.plan.parameters`.
        parameter_file: more of them, in a TOML file; if not given, one of the plan's name that is beside it.
        nominal_needed: whether each parameter must have a nominal value; regions and optimal boxes need none.
        deadline: every action must end by this time, or with `+P%` by P per cent after the planned end.
        widths: sides of boxes move at `equal` speed, or `relative` to nominal values.
        plan_number: which plan of a log that holds several, from 1; the last one if not given.
        tolerance: how far exact times may be from the printed ones; None is one unit of the last printed digit, and at
            most ε.
        mode: how steps are made a network, see :func:`robust.convert`.
        free_durations: in mode `room`, let durations vary that the domain leaves open.
        epsilon: the separation of mutex time points.
        solver: who is asked about a network of steps, `z3` or `cvc5`.
        timeout: seconds after which the network of steps is left as it is.
        on_note: called with what was picked, skipped, moved and made on the way.
        on_progress: called with what is being done.

    Returns:
        The ground plan with its parameters, in its own unit of time. `repr` of it is a line, `str` a screen.

    Raises:
        InputError: for anything wrong in them.
        InvalidPlanError: if steps break an obligation as they stand.
        UnsupportedError: for steps with an expression that is not linear.
        KeyboardInterrupt: if interrupted.
    """
    say = on_note or (lambda _: None)
    reading = ReadOptions(
        deadline=deadline,
        widths=widths,
        plan_number=plan_number,
        tolerance=tolerance,
        mode=_name_of(mode),
        free_durations=free_durations,
        epsilon=epsilon,
        solver=solver,
        timeout=timeout,
    )
    parsed_domain, parsed_problem = domain_and_problem(domain, problem)
    file = None if is_text(plan) or isinstance(plan, TimedPlan | STNPlan) else plan
    specs, beside = specifications(declare.texts(parameters, declare.place_of("parameters")), parameter_file, file)
    if beside is not None:
        say(f"took the parameters of {beside}")
    steps = plan_in(plan, reading.plan_number)
    if isinstance(steps, STNPlan):
        network = steps
        if deadline is None and not reading.relative:
            return assemble(parsed_domain, parsed_problem, network, specs, nominal_needed=nominal_needed)
        from robust.execute.parametrization import with_deadline, with_relative_widths

        network = with_deadline(network, deadline, declare.place_of("deadline"))
        made = assemble(parsed_domain, parsed_problem, network, specs, nominal_needed=nominal_needed)
        return with_relative_widths(made) if reading.relative else made

    from robust.execute.convert import ConversionEnd, convert

    settings = conversion_settings(reading, specs, reading.limit, on_progress)
    conversion = convert(parsed_domain, parsed_problem, steps, settings)
    if conversion.ended is ConversionEnd.INTERRUPTED:
        raise KeyboardInterrupt
    note = f"made a network of {plural(len(conversion.stn.constraints), 'constraint')}"
    say(f"{steps.file}: {'; '.join((*conversion.notes(steps), note))}")
    return conversion.plan


class ReadOptions(shared.Demands, shared.FromSteps, shared.Separation, shared.Solving):
    """Options for reading a plan."""


def conversion_settings(
    options: ReadOptions | ConvertCommand | CertifyCommand | WatchCommand,
    specs: Sequence[ParameterSpec],
    timeout: float | None,
    on_progress: Callable[[str], None] | None,
) -> Settings:
    """The settings for converting steps to a network, of options for that."""
    from robust.execute.convert import Mode, Settings

    return Settings(
        mode=Mode(options.mode),
        free_durations=options.free_durations,
        specs=specs,
        deadline=options.deadline,
        relative=options.relative,
        epsilon=options.separation,
        tolerance=options.rounding,
        solver=options.solver,
        timeout=timeout,
        on_progress=on_progress,
    )


def _name_of(mode: str | Mode) -> str:
    return mode if isinstance(mode, str) else mode.value


def domain_of(domain: File | Domain) -> Domain:
    """The domain that a path or a text holds, or itself."""
    if isinstance(domain, Domain):
        return domain
    _require_path("domain", domain)
    return parse_domain(domain) if is_text(domain) else read_domain(domain)


def domain_and_problem(domain: File | Domain, problem: File | Problem) -> tuple[Domain, Problem]:
    """The domain and problem that paths or texts hold, or themselves."""
    domain = domain_of(domain)
    if isinstance(problem, Problem):
        return domain, problem
    _require_path("problem", problem)
    return domain, parse_problem(problem, domain) if is_text(problem) else read_problem(problem, domain)


def plan_in(plan: File | TimedPlan | STNPlan, number: int | None = None) -> TimedPlan | STNPlan:
    """The network or the steps that a path or a text holds, or themselves."""
    if isinstance(plan, TimedPlan | STNPlan):
        return plan
    _require_path("plan", plan)
    text, name = plan_text(plan)
    return parse_stn(text, name) if is_network(text, name) else parse_timed_plan(text, name, number)


def _require_path(name: str, source: object) -> None:
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"found {shorten(repr(source))}, expected a path or a text", declare.place_of(name))


def plan_of(plan: Plan, epsilon: Number = "1/1000") -> ParametrizedPlan:
    """A plan as it is, that of a conversion, or the one of three paths or texts: domain, problem and plan.

    Raises:
        InputError: for anything else, or anything wrong in the files.
    """
    if isinstance(plan, ParametrizedPlan) or hasattr(plan, "plan"):
        return plan_itself(plan)
    if isinstance(plan, str | bytes) or not isinstance(plan, Sequence) or len(plan) != 3:
        expected = "a plan of load_plan(), or a domain, a problem and a plan: three paths or texts"
        raise InputError(f"found {shorten(repr(plan))}, expected {expected}", declare.place_of("plan"))
    sources: Sequence[Any] = plan
    return load_plan(*sources, nominal_needed=False, epsilon=epsilon)


# -- single schedules --------------------------------------------------------------------------------------------------


def validate(
    domain: File | Domain,
    problem: File | Problem,
    plan: File | TimedPlan,
    *,
    epsilon: Number | None = None,
    tolerance: Number | None = None,
    plan_number: int | None = None,
) -> Verdict:
    """Decide whether one schedule is valid as printed, as VAL does; :func:`check` judges all schedules of a network.

    Each of the three is a path, a text, or what reading one gives, as for :func:`load_plan`.

    Args:
        domain: the PDDL domain.
        problem: the PDDL problem.
        plan: a time-triggered plan, or the log of a planner.
        epsilon: separation of mutex time points, in the plan's unit of time; 1/1000 if not given.
        tolerance: how far exact times and durations may be from printed ones, 0 for exactness; if not given, one unit
            of the last printed digit, and at most epsilon.
        plan_number: which plan of a log that holds several, from 1; the last one if not given.

    Returns:
        A verdict, with what breaks and what would help; `str` of it is for people.

    Raises:
        InputError: what cannot be read, or does not fit together; also a plan with a temporal network.
        UnsupportedError: an over-all condition or a continuous effect that cannot be decided.
    """
    from robust.execute.validate import read_plan, validate

    separation = verbs.ValidateOptions.declarations["epsilon"].default if epsilon is None else epsilon
    options = verbs.ValidateOptions(epsilon=separation, tolerance=tolerance, plan_number=plan_number)
    parsed = domain_and_problem(domain, problem)
    if not isinstance(plan, TimedPlan):
        _require_path("plan", plan)
        plan = read_plan(*plan_text(plan), options.plan_number)
    return validate(*parsed, plan, epsilon=options.separation, tolerance=options.rounding)


# -- convert -----------------------------------------------------------------------------------------------------------


def convert(
    domain: File | Domain,
    problem: File | Problem,
    plan: File | TimedPlan,
    *,
    mode: str | Mode = "room",
    free_durations: bool = False,
    parameters: str | Sequence[str] = (),
    parameter_file: File | None = None,
    deadline: Number | None = None,
    widths: str = "equal",
    epsilon: Number = "1/1000",
    tolerance: Number | None = None,
    plan_number: int | None = None,
    solver: str = "z3",
    timeout: Number | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Conversion:
    """A time-triggered plan as one with a temporal network that allows its schedule [IRR §3].

    Each of the three is a path, a text, or what reading one gives, as for :func:`load_plan`.

    Args:
        domain: the PDDL domain.
        problem: the PDDL problem.
        plan: a time-triggered plan, or the log of a planner.
        mode: `room`: all room goes to the parameters, and durations are as planned; `causal`: the least constrained
            network that is proved at nominal values; `esterel`: that of the Esterel transformer.
        free_durations: in mode `room`, let durations vary that the domain leaves open.
        parameters: what is made a parameter, see :mod:`robust.plan.parameters`.
        parameter_file: more of them, in a TOML file.
        deadline: every action must end by this time, or with `+P%` by P per cent after the planned end.
        widths: weights of parameters are `equal`, or `relative` to nominal values.
        epsilon: the separation of mutex time points, in the plan's unit of time.
        tolerance: how far exact times may be from the printed ones; None is one unit of the last printed digit, and at
            most epsilon.
        plan_number: which plan of a log that holds several, from 1; the last one if not given.
        solver: `z3` or `cvc5`.
        timeout: seconds after which nothing is proved or loosened any more.
        on_progress: called with what is being done.

    Returns:
        The plan, with the proof; out of time or after Ctrl-C the last network that was proved (`ended`).

    Raises:
        InputError: if a file cannot be read, or they do not fit together.
        InvalidPlanError: if the time-triggered plan breaks an obligation.
        UnsupportedError: for an expression that is not linear.
    """
    from robust.execute.convert import convert

    reading = ReadOptions(
        deadline=deadline,
        widths=widths,
        plan_number=plan_number,
        tolerance=tolerance,
        mode=_name_of(mode),
        free_durations=free_durations,
        epsilon=epsilon,
        solver=solver,
        timeout=timeout,
    )
    specs, _ = specifications(declare.texts(parameters, declare.place_of("parameters")), parameter_file)
    parsed = domain_and_problem(domain, problem)
    if not isinstance(plan, TimedPlan):
        _require_path("plan", plan)
        plan = parse_timed_plan(*plan_text(plan), reading.plan_number)
    return convert(*parsed, plan, conversion_settings(reading, specs, reading.limit, on_progress))


# -- from here on ------------------------------------------------------------------------------------------------------


def replan(
    state: Monitor | RunState,
    domain: File | Domain,
    problem: File | Problem,
    *,
    planner: str | Planner = "aries",
    limit: Number | None = 7,
    planning_time: Number | None = None,
    mode: str | Mode = "room",
    free_durations: bool = False,
    parameters: str | Sequence[str] = "duration:*",
    parameter_file: File | None = None,
    deadline: Number | None = None,
    epsilon: Number = "1/1000",
    solver: str = "z3",
) -> NewPlan:
    """Another plan from where an execution is, proved, in which steps that run are kept.

    What is handed over is in the time of the run: timed literals and the deadline keep their moments.

    Args:
        state: a monitor, or the moment, what is true then, and what runs.
        domain: the PDDL domain: a path, a text, or what reading one gives.
        problem: the PDDL problem that the run began with, likewise.
        planner: `aries`, `kairos`, `command:TEMPLATE`, or any object that plans.
        limit: seconds for planning and the proof.
        planning_time: how long after the state the plan begins, in its unit of time; `limit` if not given.
        mode: how steps are made a network, see :func:`robust.convert`.
        free_durations: in mode `room`, let durations vary that the domain leaves open.
        parameters: what is made a parameter, see :mod:`robust.plan.parameters`.
        parameter_file: more of them, in a TOML file.
        deadline: when all must end at the latest; that of the monitor's plan if not given.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.

    Returns:
        The plan; of several that the planner printed, that which bears most.

    Raises:
        NoPlanError: a RobustError that says in one line why there is none.
        InputError: if a file cannot be read, or a setting is wrong.
        UnsupportedError: if no planner can be asked: an action runs that has continuous effects, or runs twice.
    """
    from robust.execute.monitor import Monitor
    from robust.execute.planners import create_planner
    from robust.execute.situation import OpenProblem, deadline_of, new_plan, run_state

    asked: dict[str, Any] = {"mode": _name_of(mode), "free_durations": free_durations, "solver": solver}
    reading = ReadOptions(deadline=deadline, epsilon=epsilon, timeout=limit, **asked)
    specs, _ = specifications(declare.texts(parameters, declare.place_of("parameters")), parameter_file)
    latest = None if deadline is None else exact(deadline, declare.place_of("deadline"))
    if isinstance(state, Monitor):
        latest = deadline_of(state.plan) if latest is None else latest
        state = run_state(state)
    passed = declare.not_negative(
        planning_time if planning_time is not None else limit or 0, declare.place_of("planning_time")
    )
    remainder = OpenProblem(*domain_and_problem(domain, problem), state, passed, reading.separation, latest)
    if isinstance(planner, str):
        planner = create_planner(planner, epsilon=reading.separation)
    settings = replace(conversion_settings(reading, specs, reading.limit, None), deadline=latest)
    return new_plan(remainder, planner, reading.limit, settings)
