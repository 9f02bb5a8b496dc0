"""enc_valid of the positions encoding: elimination of times against the definition, decided with quantifiers."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from random import Random

import pytest
import z3

from robust.encode.interface import Facet
from robust.encode.positions.encoding import PositionsEncoding
from robust.encode.variables import Range
from robust.plan.model import ZERO, Parameter, ParameterReference, ParametrizedPlan, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from tests.encode.positions.asking import hidden, in_z3
from tests.plan.building import instant, number, plan_of


def random_network(random: Random, points: int, parameters: int, constraints: int) -> ParametrizedPlan:
    """Constraints between any points, half of the bounds over parameters."""
    instances = [instant(f"i{n}") for n in range(points)]
    names = [f"k{n}" for n in range(parameters)]
    ends = [ZERO, *(instance.start for instance in instances)]

    def bound(offset: int) -> Polynomial[ParameterReference]:
        base = number(random.randint(0, 4) + offset)
        if random.random() < 0.5:
            factor = random.choice([1, 1, -1, 2])
            base = base + Polynomial.variable(ParameterReference(random.choice(names))).scaled(factor)
        return base

    chosen = []
    for _ in range(constraints):
        source, target = random.sample(ends, 2)
        lower, upper = random.choice([(bound(-4), None), (None, bound(2)), (bound(-6), bound(3))])
        chosen.append(TemporalConstraint(source, target, lower, upper))
    return plan_of(
        *instances, constraints=tuple(chosen), parameters=tuple(Parameter(name, Fraction(1)) for name in names)
    )


def random_range(random: Random) -> Range:
    low, high = sorted(Fraction(random.randint(-8, 16), 4) for _ in range(2))
    return (None if random.random() < 0.1 else low, None if random.random() < 0.1 else high)


def some_point_has_no_schedule(encoding: PositionsEncoding, ranges: dict[str, Range]) -> bool:
    network = encoding.network_formulas()
    solver = z3.Tactic("qsat").solver()
    for name, (low, high) in ranges.items():
        solver.add(*([z3.Real(name) >= z3.Q(low.numerator, low.denominator)] if low is not None else []))
        solver.add(*([z3.Real(name) <= z3.Q(high.numerator, high.denominator)] if high is not None else []))
    times = hidden(encoding, network)
    body = z3.Not(in_z3(encoding, network))
    solver.add(z3.ForAll(times, body) if times else body)
    answer = solver.check()
    assert answer != z3.unknown
    return bool(answer == z3.sat)


@pytest.mark.parametrize("seed", range(12))
def test_decides_boxes_as_the_definition_does(seed: int) -> None:
    random = Random(seed)  # noqa: S311 - a test's choices
    encoding = PositionsEncoding(random_network(random, 4, 2, 9))
    for _ in range(8):
        ranges = {name: random_range(random) for name in encoding.plan.nominal}
        found = encoding.validity.broken_facet(ranges, lambda: Session(encoding.terms), Deadline())
        assert isinstance(found, Facet) == some_point_has_no_schedule(encoding, ranges)
        if isinstance(found, Facet):
            assert found.breaks_in(ranges)
            assert found.obligation is None
            assert found.origins
            session = Session(encoding.terms)
            session.add(*encoding.network_formulas(), encoding.terms.greater(-found.expression))
            assert session.check("a facet follows from the network") is Verdict.UNSATISFIABLE


@pytest.mark.parametrize("shift", [0, -100])
def test_crowded_bounds_are_thinned_by_a_solver(shift: int) -> None:
    """Tangents of k², none of which another one covers, and lines between them that only two together cover."""
    a, b = instant("a"), instant("b")
    k = Polynomial.variable(ParameterReference("k"))
    tangents = [k.scaled(2 * n) - n * n for n in range(-4, 5)]
    covered = [k.scaled(2 * n + 1) - n * (n + 1) - Fraction(3, 5) for n in range(-4, 4)]
    constraints = [TemporalConstraint(a.start, b.start, bound + shift, None) for bound in (*covered, *tangents)]
    top = TemporalConstraint(a.start, b.start, None, number(16 + shift))
    plan = plan_of(a, b, constraints=(*constraints, top), parameters=(Parameter("k", Fraction(0)),))
    encoding = PositionsEncoding(plan)
    opened = []

    def session() -> Session:
        opened.append(Session(encoding.terms))
        return opened[-1]

    inside = {"k": (Fraction(-4), Fraction(4))}
    assert encoding.validity.broken_facet(inside, session, Deadline()) is None
    assert opened
    for low, high in product((-5, 0), (0, 5)):
        box = {"k": (Fraction(low), Fraction(high))}
        broken = encoding.validity.broken_facet(box, session, Deadline())
        assert (broken is None) == ((low, high) == (0, 0))
    for unbounded in ((None, Fraction(4)), (Fraction(-4), None)):
        fresh = PositionsEncoding(plan)
        broken = fresh.validity.broken_facet({"k": unbounded}, lambda to=fresh: Session(to.terms), Deadline())
        assert isinstance(broken, Facet)


def test_out_of_time_is_unknown() -> None:
    encoding = PositionsEncoding(random_network(Random(1), 4, 2, 9))  # noqa: S311 - a test's choices
    box: dict[str, Range] = {"k0": (Fraction(1), Fraction(1)), "k1": (Fraction(1), Fraction(1))}
    answer = encoding.validity.broken_facet(box, lambda: Session(encoding.terms), Deadline.after(0))
    assert answer is Verdict.UNKNOWN
