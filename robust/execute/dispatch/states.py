"""Conditions looked up in an estimate of the world's state."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from robust.execute.dispatch.messages import StateEstimate
from robust.plan.model import ActionInstance, Comparison, Condition, Duration, Fluent, Timing
from robust.plan.timeline import Reading, State, leaves


def unmet(
    instance: ActionInstance, estimate: StateEstimate, parameters: Mapping[str, Fraction], *, numbers: bool
) -> str | None:
    """The first condition at the start of an instance that does not hold in a state, as it is written in PDDL.

    Conditions on `?duration`, on fluents that the estimate has no value of and, unless `numbers` is given, on any
    fluents are passed over: nothing contradicts them.
    """
    reading = Reading(State(estimate.atoms, estimate.fluents), parameters)
    for part in instance.conditions:
        readable = part.timing is Timing.AT_START and _is_readable(part.condition, estimate, numbers=numbers)
        if readable and not reading.holds(part.condition):
            return f"{part.text} does not hold"
    return None


def _is_readable(condition: Condition, estimate: StateEstimate, *, numbers: bool) -> bool:
    for leaf in leaves(condition):
        if isinstance(leaf, Comparison):
            fluents = [one for one in leaf.expression.variables if isinstance(one, Fluent)]
            if any(isinstance(one, Duration) for one in leaf.expression.variables):
                return False
            if fluents and (not numbers or not estimate.fluents.keys() >= set(fluents)):
                return False
    return True
