"""Elimination in networks of differences against Fourier–Motzkin elimination, which knows nothing of networks."""

from fractions import Fraction

import pytest

from robust.pike_bridge.envelopes.pieces import ParametricEdge, cycles
from robust.plan.model import Parameter
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.envelopes.examples import seeded


def random_edges(draw, names, events=5):
    points = [f"t{at}" for at in range(draw.randint(2, events))]
    for number in range(draw.randint(3, 9)):
        source, target = draw.sample(points, 2)
        factors = {name: draw.choice((-1, 1)) for name in names if draw.random() < 0.35}
        yield ParametricEdge(source, target, Fraction(draw.randint(-4, 6), 2), factors, draw.random() < 0.3, number)


def by_fourier_motzkin(edges, parameters, bounds):
    times = sorted({end for edge in edges for end in (edge.source, edge.target)})
    names = tuple(one.name for one in parameters)
    constraints = list(bounds)
    for edge in edges:
        form = {edge.target: 1, edge.source: -1, **{name: -factor for name, factor in edge.factors.items()}}
        constraints.append(LinearConstraint.of(form, "<" if edge.strict else "<=", edge.constant))
    return Polyhedron((*names, *times), tuple(constraints)).project(names)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_cycles_are_the_projection_within_the_bounds(count):
    draw = seeded(f"differences/{count}")
    empty = 0
    for _ in range(120):
        parameters = [
            Parameter(
                f"p{at}", Fraction(1), lower=draw.choice((None, Fraction(0))), upper=draw.choice((None, Fraction(4)))
            )
            for at in range(count)
        ]
        bounds = [
            LinearConstraint.of({one.name: 1}, sign, end)
            for one in parameters
            for sign, end in ((">=", one.lower), ("<=", one.upper))
            if end is not None
        ]
        edges = list(random_edges(draw, [one.name for one in parameters]))
        expected = by_fourier_motzkin(edges, parameters, bounds)
        found = [one.constraint for one in cycles(edges, parameters)]
        polyhedron = Polyhedron(tuple(one.name for one in parameters), (*found, *bounds))
        assert polyhedron.equals(expected), edges
        empty += expected.is_empty
    assert 5 < empty < 115


def test_origins_are_edges_that_say_so_by_themselves():
    draw = seeded("origins")
    parameters = [Parameter("p0", Fraction(1)), Parameter("p1", Fraction(1), lower=Fraction(0))]
    told = 0
    for _ in range(80):
        edges = list(random_edges(draw, ["p0", "p1"]))
        for cycle in cycles(edges, parameters):
            behind = [edge for edge in edges if edge.origin in cycle.origins]
            assert by_fourier_motzkin(behind, parameters, ()).satisfies(cycle.constraint)
            told += 1
    assert told > 30


def test_events_at_the_same_time_are_one():
    same = [ParametricEdge("a", "b", Fraction(0), {}, False, 0), ParametricEdge("b", "a", Fraction(0), {}, False, 1)]
    between = [
        ParametricEdge("a", "c", Fraction(0), {"p": 1}, False, 2),
        ParametricEdge("c", "b", Fraction(-3), {}, False, 3),
    ]
    [found] = cycles([*same, *between], [Parameter("p", Fraction(1))])
    assert str(found.constraint) == "p ≥ 3"
    strictly = [ParametricEdge("a", "b", Fraction(0), {}, True, 0), same[1]]
    assert [one.constraint.is_false for one in cycles(strictly, [])] == [True]


def test_elimination_heeds_a_deadline():
    edges = [ParametricEdge("a", "b", Fraction(1), {}, False, 0), ParametricEdge("b", "a", Fraction(0), {}, False, 1)]
    with pytest.raises(OutOfTimeError):
        cycles(edges, [], Deadline.after(0))
