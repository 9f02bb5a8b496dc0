"""Which constraints of a converted plan its validity does not need, one at a time, and why they are there.

A constraint is one bound on one distance. It is removable if the plan without it, and with all others, is still proved
valid for every schedule. Either the other bounds imply it, so that no schedule is gained by removing it, or schedules
are gained, and the network could have been less constrained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import partial

from robust.execute.convert import Conversion, check_plan
from robust.execute.distances import Edge, Paths
from robust.irr.check import Answer, CheckResult
from robust.plan.model import ZERO, Bound, ParametrizedPlan, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs
from robust.smt.limits import Deadline


class Kind(Enum):
    """What a constraint is for."""

    DURATION = "duration"
    SEPARATION = "separation of mutex time points"
    LITERAL = "before or after a timed literal"
    PROTECTION = "over-all condition"
    NUMBERS = "bound that numbers need"


class Removal(Enum):
    """What becomes of the plan without a constraint."""

    NEEDED = "needed"
    IMPLIED = "implied by others"
    NEEDLESS = "not needed"
    UNKNOWN = "unknown"

    @property
    def removable(self) -> bool:
        return self in {Removal.IMPLIED, Removal.NEEDLESS}


@dataclass(frozen=True, slots=True)
class Judgement:
    """One bound, and whether the plan needs it."""

    edge: Edge
    kind: Kind
    removal: Removal


def judge_constraints(conversion: Conversion, epsilon: Fraction, solver: str, deadline: Deadline) -> list[Judgement]:
    """Remove each bound of a converted plan in turn; the plan must have no parameters.

    Raises:
        KeyboardInterrupt: if interrupted.
    """
    edges = list(edges_of(conversion.plan))
    check = partial(check_plan, epsilon=epsilon, solver=solver, deadline=deadline)
    return [Judgement(one, _kind(conversion, one), _removal(conversion.plan, edges, one, check)) for one in edges]


def edges_of(plan: ParametrizedPlan) -> Iterator[Edge]:
    """Both sides of every constraint as lower bounds.

    Raises:
        ValueError: if a bound has parameters.
    """
    for one in plan.constraints:
        if one.lower is not None:
            yield Edge(one.source, one.target, _value(one.lower))
        if one.upper is not None:
            yield Edge(one.target, one.source, -_value(one.upper))


def _value(bound: Bound) -> Fraction:
    if any(bound.terms):
        raise ValueError(f"{bound} is not a number; constraints are judged without parameters")
    return bound.constant_term


def _removal(
    plan: ParametrizedPlan, edges: Sequence[Edge], one: Edge, check: Callable[[ParametrizedPlan], CheckResult]
) -> Removal:
    others = [other for other in edges if other is not one]
    points = [point for point in plan.time_points if point.time is None]
    nonnegative = [Edge(ZERO, point, Fraction(0)) for point in points if point != ZERO]
    implied = Paths(points, (*nonnegative, *others)).implied(one.source, one.target)
    if implied is not None and implied >= one.weight:
        return Removal.IMPLIED
    constraints = tuple(
        TemporalConstraint(other.source, other.target, Polynomial.constant(other.weight), None) for other in others
    )
    match check(replace(plan, constraints=constraints)).answer:
        case Answer.PROVED:
            return Removal.NEEDLESS
        case Answer.REFUTED:
            return Removal.NEEDED
        case Answer.UNKNOWN:
            return Removal.UNKNOWN


def _kind(conversion: Conversion, one: Edge) -> Kind:
    pair = {one.source, one.target}
    if one in {tightening.edge for tightening in conversion.tightened}:
        return Kind.NUMBERS
    if one.source.instance is not None and one.source.instance == one.target.instance:
        return Kind.DURATION
    if ZERO in pair:
        return Kind.LITERAL
    if any(pair == set(mutex) for mutex in mutex_pairs(conversion.plan)):
        return Kind.SEPARATION
    return Kind.PROTECTION
