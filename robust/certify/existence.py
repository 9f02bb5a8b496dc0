"""Schedules over a box, as expressions over the parameters: why some schedule exists for every value in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.certify.ground import GroundPlan
from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, least, variable
from robust.errors import UnsupportedError
from robust.plan.model import ParameterReference
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

Times = dict[TimeVariable, Linear]
"""Free time points over the parameters."""


@dataclass(frozen=True, slots=True)
class Edge:
    """`t_target − t_source ≥ weight` between free time points; None is zero."""

    source: TimeVariable | None
    target: TimeVariable | None
    weight: Linear


def schedule_over(
    ground: GroundPlan,
    ranges: Mapping[str, Range],
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> list[Linear]:
    """A time for each time point, over the parameters, such that the network is kept all over the box.

    First free time points get constant times by Bellman–Ford with every bound at its worst; if that is not possible,
    times that are linear in the parameters, found by a solver.

    Args:
        ground: the plan.
        ranges: the box.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Raises:
        UnsupportedError: if no such expressions exist, although each point of the box may have a schedule.
        OutOfTimeError: if the deadline passes.
    """
    edges = list(dict.fromkeys(_edges(ground)))
    free = [v for place in ground.places.values() for v in place.variables if isinstance(v, TimeVariable)]
    free = list(dict.fromkeys(free))
    times = _constant_times(free, edges, ranges)
    if times is None:
        times = _linear_times(free, edges, ranges, solver, deadline)
    return [_placed(ground.places[index], times) for index in sorted(ground.places)]


def _placed(place: Linear, times: Times) -> Linear:
    return place.substitute(lambda unknown: times[unknown] if isinstance(unknown, TimeVariable) else variable(unknown))


def _edges(ground: GroundPlan) -> Iterator[Edge]:
    zero = constant(0)
    statements = [(0, point, zero) for point in ground.places]
    statements += [side[1:] for bound in ground.bounds for side in bound.sides()]
    for source, target, distance in statements:
        expression = ground.places[target] - ground.places[source] - distance
        ends: dict[bool, TimeVariable] = {}
        weight = constant(-expression.constant_term)
        for unknown, factor in expression.coefficients():
            if isinstance(unknown, TimeVariable):
                ends[factor > 0] = unknown
            else:
                weight -= variable(unknown).scaled(factor)
        if ends:
            yield Edge(ends.get(False), ends.get(True), weight)


def _constant_times(free: Sequence[TimeVariable], edges: Sequence[Edge], ranges: Mapping[str, Range]) -> Times | None:
    """The earliest times that suit the worst weight of each edge; None if there are none."""
    worst = [(edge, least(-edge.weight, ranges)) for edge in edges]
    if any(floor is None for _, floor in worst):
        return None
    times: dict[TimeVariable | None, Fraction] = dict.fromkeys((None, *free), Fraction(0))
    for _ in range(len(times) + 1):
        changed = False
        for edge, floor in worst:
            reached = times[edge.source] - (floor or 0)
            if reached > times[edge.target]:
                if edge.target is None:
                    return None
                times[edge.target], changed = reached, True
        if not changed:
            return {point: constant(times[point]) for point in free}
    return None


def _linear_times(
    free: Sequence[TimeVariable],
    edges: Sequence[Edge],
    ranges: Mapping[str, Range],
    solver: str,
    deadline: Deadline,
) -> Times:
    """Times that are linear in the parameters: least values over the box are linear in the coefficients sought."""
    terms = Terms()
    names = list(ranges)
    unknowns = {
        point: [variable(Auxiliary("coefficient", index * (len(names) + 1) + place)) for place in range(len(names) + 1)]
        for index, point in enumerate(free)
    }
    conditions: list[Formula] = []
    shares = 0
    for edge in edges:
        total = constant(-edge.weight.constant_term)
        slopes = {name: constant(0) for name in names}
        for parameter, factor in edge.weight.coefficients():
            slopes[str(parameter)] -= factor
        for point, sign in ((edge.target, 1), (edge.source, -1)):
            if point is not None:
                total += unknowns[point][0].scaled(sign)
                for name, coefficient in zip(names, unknowns[point][1:], strict=True):
                    slopes[name] += coefficient.scaled(sign)
        for name, slope in ((name, slope) for name, slope in slopes.items() if slope != constant(0)):
            low, high = ranges[name]
            share = variable(Auxiliary("share", shares))
            shares += 1
            total += share
            for end, side in ((low, slope), (high, -slope)):
                # An infinite end leaves the slope no choice of sign.
                conditions.append(terms.at_least(side if end is None else slope.scaled(end) - share))
            if low is None and high is None:
                conditions.append(terms.equal(share))
            if (low is None) is not (high is None):
                conditions.append(terms.at_least(slope.scaled((low if high is None else high) or Fraction(0)) - share))
        conditions.append(terms.at_least(total))
    session = Session(terms, solver=solver)
    session.add_all(conditions, deadline)
    match session.check("a schedule linear in the parameters", deadline):
        case Verdict.UNKNOWN:
            raise OutOfTimeError
        case Verdict.UNSATISFIABLE:
            raise UnsupportedError(
                "no schedule that is linear in the parameters suits the whole box; expected one for a certificate, "
                "try a smaller box"
            )
        case Verdict.SATISFIABLE:
            pass
    symbols = [terms.real(each) for row in unknowns.values() for term in row for each in term.variables]
    values = session.values(symbols)

    def value(term: Linear) -> Fraction:
        return Fraction(values.get(str(next(iter(term.variables))), 0))

    return {
        point: sum(
            (variable(ParameterReference(name)).scaled(value(term)) for name, term in zip(names, row[1:], strict=True)),
            constant(value(row[0])),
        )
        for point, row in unknowns.items()
    }
