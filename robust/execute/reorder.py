"""The rest of a plan judged anew from where it is, in whatever order of its steps succeeds.

What has happened stands: a condition that did not hold cannot be mended. From the state that is reached, a solver
looks for times and durations with which all that is still to come keeps every obligation. The simulator executes what
it finds before it counts, and the orders of its happenings become the network that is followed from then on. If the
solver finds nothing, no order of these steps succeeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import constant, variable
from robust.errors import InputError, SolverError, UnsupportedError
from robust.execute.causal import at_least, causal_network
from robust.execute.distances import Original, with_literals
from robust.execute.forecast import OPEN, FollowedPlan, Forecaster, Prospect
from robust.execute.remaining import History, remaining_plan
from robust.network.slack import OutsideFragmentError
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.eliminate.enumerate import satisfiable
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session


@dataclass(frozen=True, slots=True)
class Reordered:
    """What is ahead from where a plan is: a forecaster unless it is broken, or undecided; `reasons` say what broke.

    `in_order` says whether the plan's order still does, `pending` whether others were not looked for.
    """

    prospect: Prospect
    forecaster: Forecaster | None = None
    reasons: tuple[str, ...] = ()
    in_order: bool = False
    pending: bool = False


def reordered(
    history: History,
    make: Callable[[FollowedPlan], Forecaster],
    epsilon: Fraction,
    *,
    free: bool,
    in_order: bool,
    searching: bool,
    deadline: Deadline,
) -> Reordered:
    """Judge the rest of a plan.

    Args:
        history: what has happened.
        make: makes forecasters.
        epsilon: the separation of mutex time points.
        free: whether any order of steps will do.
        in_order: whether the plan's order may still do.
        searching: whether to ask a solver, which takes longer than all else.
        deadline: when to stop, undecided.
    """
    running = {name: step for name, step in history.steps.items() if step.is_running}
    known = history.plan.lasting, history.planned, running
    try:
        breaches = history.breaches(epsilon)
        if breaches:
            return Reordered(Prospect.BROKEN, reasons=tuple(breaches))
        if in_order:
            with suppress(OutsideFragmentError, UnsupportedError, InputError):  # if planned durations will not do
                rest = make(FollowedPlan(remaining_plan(history, epsilon, ordered=True), epsilon, *known))
                _tell_later(rest, history)
                if rest.look(history.time, deadline).prospect in OPEN:
                    return Reordered(Prospect.ON_TRACK, rest, in_order=True)
        if not searching:
            return Reordered(Prospect.UNDECIDED, pending=True)
        unordered = remaining_plan(history, epsilon, ordered=not free)
        found = _schedule(unordered, epsilon, deadline)
        if found is None:
            return Reordered(Prospect.BROKEN)
        rest = make(FollowedPlan(_in_order_of(unordered, epsilon, *found), epsilon, *known))
        _tell_later(rest, history)
        return Reordered(Prospect.AT_RISK, rest)
    except (OutsideFragmentError, UnsupportedError, InputError, SolverError, OutOfTimeError):
        return Reordered(Prospect.UNDECIDED)


def _tell_later(rest: Forecaster, history: History) -> None:
    """Tell a forecaster of the rest of a plan what is known to happen later."""
    rest.pass_time(history.time)
    for step, known in history.known.items():
        if known != history.steps[step]:
            rest.follow(step, known)


def _schedule(
    plan: model.ParametrizedPlan, epsilon: Fraction, deadline: Deadline
) -> tuple[Mapping[str, Fraction], Mapping[model.TimePoint, Fraction]] | None:
    """Parameter values and a valid schedule; None if there are none.

    If steps can take as long as planned, they do; if not, they take some time if they can.

    Raises:
        OutOfTimeError: if the deadline passes, or the solver gives up.
        SolverError: if the simulator does not confirm what was found.
    """
    encoding = RelationalEncoding(plan, epsilon)
    session = Session(encoding.terms)
    session.add_all(encoding.valid_formulas(encoding.obligations), deadline)
    if not satisfiable(session, "some order succeeds", deadline):
        return None
    found = session.values(encoding.unknowns())
    terms, places = encoding.terms, encoding.places
    planned = [
        terms.at_least(variable(model.ParameterReference(name)) - constant(length))
        for name, length in plan.nominal.items()
    ]
    lasting = [terms.greater(places[each.end] - places[each.start]) for each in plan.instances if each.durative]
    for wish in ([*planned, *lasting], lasting):
        with session.frame(*wish):
            if session.check("steps take time", deadline) is Satisfiability.SATISFIABLE:
                found = session.values(encoding.unknowns())
                break
    values = {name: Fraction(value) for name, value in found.items()}
    schedule = encoding.schedule(values)
    parameters = plan.nominal | {name: value for name, value in values.items() if name in plan.nominal}
    if simulate(plan, parameters, schedule, epsilon=epsilon).violations:
        raise SolverError("found a schedule that the simulator does not confirm, expected a valid one")
    return parameters, schedule


def _in_order_of(
    plan: model.ParametrizedPlan,
    epsilon: Fraction,
    values: Mapping[str, Fraction],
    schedule: Mapping[model.TimePoint, Fraction],
) -> model.ParametrizedPlan:
    """The plan with the orders that a schedule chooses, and its durations as nominal ones."""
    parameters = tuple(replace(known, nominal=values[known.name]) for known in plan.parameters)
    plan = replace(plan, parameters=parameters)
    bare = replace(model.at_values(plan, values), constraints=())
    edges = causal_network(Original(bare, with_literals(bare, schedule), epsilon)).edges
    orders = (at_least(edge, Polynomial.constant(edge.weight)) for edge in edges)
    return replace(plan, constraints=(*plan.constraints, *orders))
