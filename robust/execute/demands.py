"""What is asked of a plan in addition to what it says: to end by a deadline, and sides that move in proportion."""

import re
from dataclasses import replace
from fractions import Fraction

from robust.errors import InputError, Location
from robust.network.differences import Distances
from robust.numbers import Number, exact, is_number, shorten
from robust.plan import model, stn

DEADLINE = "deadline"
"""The name of the demand."""
_LATER = re.compile(r"\s*\+\s*(?P<percent>[^%]+?)\s*%\s*")


def latest_end(deadline: Number, end: Fraction, place: Location) -> Fraction:
    """The time of a deadline: a number, or `+P%` for P per cent later than a plan ends.

    Raises:
        InputError: for any other text.
    """
    later = _LATER.fullmatch(deadline) if isinstance(deadline, str) else None
    if later is not None and is_number(later["percent"]):
        return end * (1 + exact(later["percent"], place) / 100)
    if isinstance(deadline, str) and (deadline.strip().startswith("+") or not is_number(deadline)):
        message = f"found {shorten(deadline)}, expected a time such as 90, or +10% for later than the plan ends"
        raise InputError(message, place)
    return exact(deadline, place)


def with_deadline(
    plan: stn.STNPlan, deadline: Number | None, place: Location, end: Fraction | None = None
) -> stn.STNPlan:
    """The plan with the demand that every action ends by a time.

    Args:
        plan: the plan, with or without constraints.
        deadline: as :func:`latest_end` reads it; None is none.
        place: where it was given.
        end: when the plan ends; the least time that its network allows at nominal values if not given.

    Raises:
        InputError: for a deadline that cannot be read, or a network without schedule.
    """
    if deadline is None:
        return plan
    latest = latest_end(deadline, earliest_end(plan) if end is None else end, place)
    ends = (stn.STNConstraint(instance.end, model.ZERO, None, latest, name=DEADLINE) for instance in plan.instances)
    return replace(plan, constraints=(*plan.constraints, *ends))


def earliest_end(plan: stn.STNPlan) -> Fraction:
    """The least end of a network at nominal values; InputError if it has no schedule there."""
    nominal = {parameter.name: parameter.default for parameter in plan.parameters}
    points = [model.ZERO, *(point for instance in plan.instances for point in instance.time_points)]
    bounds = [(model.ZERO, point, Fraction(0)) for point in points]

    def number(bound: stn.STNBound) -> Fraction | None:
        return nominal[bound.name] if isinstance(bound, model.ParameterReference) else bound

    for item in plan.constraints:
        lower, upper = number(item.lower), number(item.upper)
        bounds += [] if lower is None else [(item.source, item.target, lower)]
        bounds += [] if upper is None else [(item.target, item.source, -upper)]
    distances = Distances(points, bounds)
    if distances.network.schedule is None or distances.times[model.ZERO]:
        message = "found a network without schedule at nominal values, expected one that ends some time"
        raise InputError(message, Location(plan.file))
    return max(distances.times.values())


def with_relative_widths(plan: model.ParametrizedPlan) -> model.ParametrizedPlan:
    """The plan with weights in proportion to nominal values; a parameter of nominal value 0 keeps its weight."""
    weighted = (replace(known, weight=_relative(known.weight, known.nominal)) for known in plan.parameters)
    return replace(plan, parameters=tuple(weighted))


def with_relative_weights(plan: stn.STNPlan) -> stn.STNPlan:
    """As :func:`with_relative_widths`, of a plan as it is written."""
    weighted = (replace(known, weight=_relative(known.weight, known.default)) for known in plan.parameters)
    return replace(plan, parameters=tuple(weighted))


def _relative(weight: Fraction, nominal: Fraction | None) -> Fraction:
    return weight * abs(nominal) if nominal else weight
