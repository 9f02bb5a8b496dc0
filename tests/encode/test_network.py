"""Times: solved equalities, what is left to assert, durations, independent parts, known orders, and mutex pairs."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robust.encode.effects import Writes, mutex_pairs
from robust.encode.interface import Auxiliary, Linear, TimeVariable, constant, least, variable
from robust.encode.network import Difference, IndependentParts, Inequality, Orders, TemporalNetwork, duration_rules
from robust.plan import model
from robust.plan.model import ZERO, DurationConstraint, Parameter, ParameterReference, TimePoint, TimePointKind
from robust.plan.simulate import mutex_pairs as simulated_mutex_pairs
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Terms
from tests.plan import building
from tests.plan.building import DURATION, RANDOM, above, action, at, at_least, between, drawn, instant, number, plan_of
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

PARAMETERS = (Parameter("k", Fraction(3)),)
ONE, TWO, LONG = instant("i"), instant("j"), action("l")
k = building.reference("k")
X, Y, Z, W = (variable(Auxiliary(name, 0)) for name in "xyzw")
LITERAL = model.TimedLiteral(Fraction(7, 2), building.P, True)


def free(point: TimePoint) -> Linear:
    return variable(TimeVariable(point))


t_i, t_j = free(ONE.start), free(TWO.start)


@pytest.mark.parametrize(
    ("constraints", "places"),
    [
        (
            (at(ONE.start, 2), between(ONE.start, TWO.start, k, k)),
            {ZERO: constant(0), ONE.start: constant(2), TWO.start: k + 2},
        ),
        (
            (between(LONG.end, TWO.start, 1, 1), between(TWO.start, ONE.start, 0)),
            {LONG.start: free(LONG.start), TWO.start: free(LONG.end) + 1},
        ),
        (
            (between(ONE.start, LITERAL.point, 1, 1),),
            {LITERAL.point: constant(LITERAL.time), ONE.start: constant(Fraction(5, 2))},
        ),
    ],
    ids=["along equalities", "from points that nothing ties", "backwards and through timed literals"],
)
def test_time_points_are_tied(constraints, places) -> None:
    network = TemporalNetwork(
        plan_of(LONG, TWO, ONE, constraints=constraints, literals=(LITERAL,), parameters=PARAMETERS)
    )
    assert {point: network.places[point] for point in places} == places


@pytest.mark.parametrize(
    ("constraints", "expressions"),
    [
        ((between(ONE.start, TWO.start, 1),), [(t_j - t_i - 1, None), (t_i, ONE.start), (t_j, TWO.start)]),
        (
            (between(ONE.start, TWO.start, k, k), between(TWO.start, ONE.start, -3, -3)),
            [(-k + 3, None), (k - 3, None), (t_i, ONE.start), (t_i + k, TWO.start)],
        ),
        (
            (at(ONE.start, 1), between(ONE.start, TWO.start, k, k), between(TWO.start, ONE.start, -k, -k)),
            [(k + 1, TWO.start)],
        ),
    ],
    ids=["unsaid last", "a circle is an equation", "a circle that closes says nothing"],
)
def test_what_is_left_to_say(constraints, expressions) -> None:
    network = TemporalNetwork(plan_of(ONE, TWO, constraints=constraints, parameters=PARAMETERS))
    assert [(one.expression, one.not_before_zero) for one in network.inequalities] == expressions


def test_declared_bounds_are_inequalities() -> None:
    plan = plan_of(ONE, parameters=(Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(4)),))
    network = TemporalNetwork(plan)
    bounds = [Inequality(k - 1, ("parameter k lb 1",)), Inequality(-k + 4, ("parameter k ub 4",))]
    assert list(network.bounds_of_parameters()) == bounds
    unbounded = variable(ParameterReference("m"))
    differences = [Difference(ZERO, ONE.start, weight, ()) for weight in (k.scaled(-2), unbounded)]
    assert list(network.bounds(differences)) == [(ZERO, ONE.start, -8)]
    assert network.slack(differences[0]) == t_i + k.scaled(2)


def test_inequalities_as_differences() -> None:
    for expression, source, target, weight in (
        (t_j - t_i - k + 2, ONE.start, TWO.start, k - 2),
        (-t_i + 2, ONE.start, ZERO, constant(-2)),
        (t_i, ZERO, ONE.start, constant(0)),
    ):
        assert Inequality(expression, ("said",)).as_difference() == Difference(source, target, weight, ("said",))


def test_least_value_of_an_expression_over_a_box() -> None:
    m = variable(ParameterReference("m"))
    ranges = {"k": (Fraction(1), Fraction(3)), "m": (None, Fraction(2))}
    expected: dict[Linear, int | None] = {
        k.scaled(2) - m + 1: 1,
        k + m: None,
        m.scaled(0) + k: 1,
        k + X: None,
        variable(ParameterReference("other")): None,
        constant(5): 5,
    }
    assert {expression: least(expression, ranges) for expression in expected} == expected


@drawn(30)
@given(plans(linear=True), RANDOM)
def test_sampled_schedules_satisfy_the_network_and_its_places(plan, random) -> None:
    network = TemporalNetwork(plan)
    for values in (plan.nominal, sample_parameters(plan, random)):
        for schedule in sample_schedules(plan, values, random, 3):
            unknowns = {ParameterReference(name): value for name, value in values.items()}
            unknowns.update({TimeVariable(point): time for point, time in schedule.items()})
            assert {point: place.evaluate(unknowns) for point, place in network.places.items()} == schedule
            assert all(inequality.expression.evaluate(unknowns) >= 0 for inequality in network.inequalities)


def test_the_network_as_formulas_has_a_model_exactly_if_there_is_a_schedule() -> None:
    found: Counter[Satisfiability] = Counter()

    @drawn(30)
    @given(plans(linear=True), RANDOM)
    def run(plan, random) -> None:
        network, terms = TemporalNetwork(plan), Terms()
        values = sample_parameters(plan, random, spread=Fraction(4))
        session = Session(terms)
        session.add(*(terms.at_least(inequality.expression) for inequality in network.inequalities))
        session.add(*(terms.equal(variable(ParameterReference(name)) - value) for name, value in values.items()))
        verdict = session.check("network")
        assert (verdict is Satisfiability.SATISFIABLE) == Network(plan, values).consistent
        found[verdict] += 1

    run()
    assert found[Satisfiability.SATISFIABLE] >= 5
    assert found[Satisfiability.UNSATISFIABLE] >= 1


def test_mutex_pairs_are_those_of_the_simulator() -> None:
    kinds: Counter[TimePointKind] = Counter()

    @drawn(80)
    @given(plans(tame=False))
    def run(plan) -> None:
        pairs = mutex_pairs(plan)
        assert list(pairs) == list(simulated_mutex_pairs(plan))
        kinds.update(point.kind for pair in pairs for point in pair)

    run()
    assert set(kinds) == set(TimePointKind) - {TimePointKind.ZERO}


@pytest.mark.parametrize(
    ("condition", "bounds", "exact"),
    [
        (at_least(DURATION, 4), [(False, 4)], True),
        (at_least(DURATION.scaled(Fraction(2)), 8), [(False, 4)], True),
        (above(DURATION, 4), [(False, 4)], False),
        (building.at_most(DURATION, 4), [(True, -4)], True),
        (above(number(4), DURATION), [(True, -4)], False),
        (building.equal(DURATION, 4), [(False, 4), (True, -4)], True),
        (building.different(DURATION, 4), [], False),
        (at_least(DURATION * DURATION, 4), [], False),
        (at_least(number(4), 4), [], False),
    ],
)
def test_what_duration_constraints_say_of_start_and_end(condition, bounds, exact) -> None:
    a = action("a", DurationConstraint(building.START, condition, "d"))
    plan = plan_of(a)
    not_negative, rule = duration_rules(plan, Writes(plan))
    name = "a act: non-negative duration"
    assert (not_negative.name, not_negative.exact) == (name, True)
    assert not_negative.bounds == (Difference(a.start, a.end, constant(0), (name,)),)
    ends = {False: (a.start, a.end), True: (a.end, a.start)}
    expected = tuple(Difference(*ends[back], constant(weight), ("a act: duration d",)) for back, weight in bounds)
    assert (rule.bounds, rule.exact) == (expected, exact)


# --- slices -----------------------------------------------------------------------------------------------------------


def test_slices_join_what_shares_an_unknown() -> None:
    terms = Terms()
    slices = IndependentParts(terms, [X - Y, Y - 1, Z, constant(-1), W, X - Y])
    of_x = slices.touching([terms.greater(X)])
    assert sorted(map(str, of_x)) == sorted(str(terms.at_least(e)) for e in (X - Y, Y - 1, constant(-1)))
    assert slices.touching([terms.greater(Z + W)]) == [terms.false, terms.at_least(W), terms.at_least(Z)]
    assert slices.touching([terms.true]) == [terms.false]


@drawn(80)
@given(st.lists(st.tuples(*[st.integers(-1, 1)] * 5), max_size=6), st.tuples(*[st.integers(-1, 1)] * 5))
def test_what_a_slice_leaves_out_shares_nothing_with_it(rows, question) -> None:
    def expression(row):
        return sum((v.scaled(f) for v, f in zip((X, Y, Z, W), row, strict=False)), constant(row[-1]))

    terms = Terms()
    expressions = [expression(row) for row in rows]
    asked = terms.greater(expression(question))
    kept = IndependentParts(terms, expressions).touching([asked])
    left_out = [terms.at_least(e) for e in expressions if terms.at_least(e) not in kept and e.variables]
    inside = terms.variables(terms.conjunction([asked, *kept]))
    assert inside.isdisjoint(terms.variables(terms.conjunction(left_out)))
    assert {terms.at_least(e) for e in expressions if not e.variables and e.constant_term < 0} <= set(kept)


# --- orders -----------------------------------------------------------------------------------------------------------

POINTS = [TimePoint(TimePointKind.INSTANT, name) for name in "abcde"]
A, B, C = POINTS[:3]
EDGE = st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), st.fractions(-3, 2, max_denominator=6))
Known = dict[tuple[TimePoint, TimePoint], Fraction]


def longest(edges: list[tuple[TimePoint, TimePoint, Fraction]]) -> Known | None:
    """Longest paths; None if there is a positive cycle."""
    known: Known = {(point, point): Fraction(0) for point in POINTS}
    for a, b, weight in edges:
        known[a, b] = max(weight, known.get((a, b), weight))
    for middle, a, b in product(POINTS, POINTS, POINTS):
        if (a, middle) in known and (middle, b) in known:
            through = known[a, middle] + known[middle, b]
            known[a, b] = max(through, known.get((a, b), through))
    return None if any(known[point, point] > 0 for point in POINTS) else known


def assert_same(orders: Orders, known: Known) -> None:
    for a, b in product(POINTS, POINTS):
        assert orders.least(a, b) == known.get((a, b))
        assert orders.surely_before(a, b) == (known.get((a, b), Fraction(-1)) > 0)
        assert orders.surely_not_after(a, b) == (known.get((a, b), Fraction(-1)) >= 0)


@drawn(80)
@given(st.lists(EDGE, max_size=12), st.lists(EDGE, min_size=1, max_size=5))
def test_bounds_are_longest_paths_and_learning_is_the_same_as_having_known(edges, lessons) -> None:
    known = longest(edges)
    orders = Orders(POINTS, edges, [weight for _, _, weight in lessons])
    assert orders.consistent == (known is not None)
    assume(known is not None)
    assert_same(orders, known)
    for lesson in lessons:
        first, second, weight = lesson
        together = longest([*edges, lesson])
        is_new = known.get((first, second)) is None or known[first, second] < weight
        assert orders.learn(*lesson) == (is_new and together is not None)
        if together is not None:
            known, edges = together, [*edges, lesson]
        assert_same(orders, known)


def test_pairs_in_known_order_are_separated_until_nothing_is_new() -> None:
    """That b follows a by 1 lets c follow b, and both let c follow a by 2."""
    bounds = [(A, B, Fraction(0)), (A, C, Fraction(1, 2)), (B, C, Fraction(-3, 2)), (C, POINTS[3], Fraction(-1))]
    orders = Orders(POINTS, bounds, [Fraction(1)])
    pairs = [(A, POINTS[4]), (C, POINTS[3]), (C, B), (B, A)]
    assert list(orders.separate(pairs, Fraction(1))) == [(A, B)]
    assert orders.least(A, C) == Fraction(1, 2)
    assert orders.learn(B, C, Fraction(-1, 2))
    assert list(orders.separate(pairs, Fraction(1))) == [(B, C)]
    assert orders.least(A, C) == 2
