"""The temporal network: solved equalities, what is left to assert, mutex pairs, independent parts, and known orders."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from robust.encode.conditions import duration_rules
from robust.encode.mutex import mutex_pairs
from robust.encode.network import Orders, Slices, TemporalNetwork, common_scale
from robust.encode.variables import Auxiliary, TimeVariable, constant, least, parameters_in, variable
from robust.plan.model import (
    ZERO,
    Atom,
    Comparison,
    DurationConstraint,
    Parameter,
    ParameterReference,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    TimePoint,
    TimePointKind,
)
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs as simulated_mutex_pairs
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms
from tests.plan.building import DURATION, START, above, action, at_least, at_most, different, instant, number, plan_of
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

RANDOM = st.randoms(use_true_random=True)
K = Polynomial.variable(ParameterReference("k"))
X, Y, Z, W = (variable(Auxiliary(name, 0)) for name in "xyzw")


def drawn(examples: int) -> settings:
    return settings(
        max_examples=examples, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
    )


def fixed(source, target, length) -> TemporalConstraint:
    bound = number(length) if isinstance(length, int) else length
    return TemporalConstraint(source, target, bound, bound)


def test_time_points_are_tied_along_equalities() -> None:
    i, j, free = action("i"), action("j"), instant("free")
    constraints = (
        fixed(ZERO, i.start, 2),
        fixed(i.start, i.end, K),
        fixed(j.end, free.start, 1),
        TemporalConstraint(i.end, j.start, number(0), None),
    )
    network = TemporalNetwork(plan_of(i, j, free, constraints=constraints, parameters=(Parameter("k", Fraction(1)),)))
    k = variable(ParameterReference("k"))
    assert network.position(i.start) == constant(2)
    assert network.position(i.end) == k + 2
    assert network.position(j.start) == variable(TimeVariable(j.start))
    assert network.position(free.start) == variable(TimeVariable(j.end)) + 1
    assert network.position(ZERO) == constant(0)


def test_what_is_unsaid_comes_last_and_says_of_which_time_point() -> None:
    i, j = instant("i"), instant("j")
    network = TemporalNetwork(plan_of(i, j, constraints=(TemporalConstraint(i.start, j.start, number(1), None),)))
    assert [(one.not_before_zero, one.expression) for one in network.inequalities] == [
        (None, variable(TimeVariable(j.start)) - variable(TimeVariable(i.start)) - 1),
        (i.start, variable(TimeVariable(i.start))),
        (j.start, variable(TimeVariable(j.start))),
    ]


def test_equalities_are_followed_backwards_and_through_timed_literals() -> None:
    i = instant("i")
    literal = TimedLiteral(Fraction(7, 2), Atom("p"), True)
    plan = plan_of(i, literals=(literal,), constraints=(fixed(i.start, literal.point, 1),))
    network = TemporalNetwork(plan)
    assert network.position(i.start) == constant(Fraction(5, 2))
    assert network.position(literal.point) == constant(Fraction(7, 2))


def test_a_circle_of_equalities_is_an_equation_over_parameters() -> None:
    i, j = instant("i"), instant("j")
    constraints = (fixed(i.start, j.start, K), fixed(j.start, i.start, -3))
    network = TemporalNetwork(plan_of(i, j, constraints=constraints, parameters=(Parameter("k", Fraction(3)),)))
    k = variable(ParameterReference("k"))
    expressions = {inequality.expression for inequality in network.inequalities}
    assert {k - 3, -k + 3} <= expressions
    assert network.position(j.start) - network.position(i.start) in {k, constant(3)}


def test_a_circle_that_always_closes_says_nothing() -> None:
    i, j = instant("i"), instant("j")
    constraints = (fixed(ZERO, i.start, 1), fixed(i.start, j.start, K), fixed(j.start, i.start, -K))
    network = TemporalNetwork(plan_of(i, j, constraints=constraints, parameters=(Parameter("k", Fraction(3)),)))
    assert {inequality.expression for inequality in network.inequalities} == {variable(ParameterReference("k")) + 1}


def test_declared_bounds_are_inequalities() -> None:
    plan = plan_of(instant("i"), parameters=(Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(4)),))
    k = variable(ParameterReference("k"))
    bounds = [inequality.expression for inequality in TemporalNetwork(plan).bounds_of_parameters()]
    assert bounds == [k - 1, -k + 4]
    assert TemporalNetwork(plan).surely_at_least(k.scaled(-2)) == -8


def test_least_value_of_an_expression_over_a_box() -> None:
    k, m = (variable(ParameterReference(name)) for name in "km")
    ranges = {"k": (Fraction(1), Fraction(3)), "m": (None, Fraction(2))}
    assert least(k.scaled(2) - m + 1, ranges) == 1
    assert least(k + m, ranges) is None
    assert least(m.scaled(0) + k, ranges) == 1
    assert least(k + X, ranges) is None
    assert least(variable(ParameterReference("other")), ranges) is None
    assert least(constant(5), {}) == 5
    assert parameters_in(k - m + X) == {"k", "m"}


@drawn(30)
@given(plans(linear=True), RANDOM)
def test_sampled_schedules_satisfy_the_network_and_its_positions(plan, random) -> None:
    network = TemporalNetwork(plan)
    for at in (plan.nominal, sample_parameters(plan, random)):
        for schedule in sample_schedules(plan, at, random, 3):
            values = {ParameterReference(name): value for name, value in at.items()}
            values.update({TimeVariable(point): time for point, time in schedule.items()})
            for point, place in network.positions.items():
                assert place.evaluate(values) == schedule[point]
            assert all(inequality.expression.evaluate(values) >= 0 for inequality in network.inequalities)


def test_the_network_as_formulas_has_a_model_exactly_if_there_is_a_schedule() -> None:
    found: Counter[Verdict] = Counter()

    @drawn(30)
    @given(plans(linear=True), RANDOM)
    def run(plan, random) -> None:
        network, terms = TemporalNetwork(plan), Terms()
        at = sample_parameters(plan, random, spread=Fraction(4))
        session = Session(terms)
        session.add(*(terms.at_least(inequality.expression) for inequality in network.inequalities))
        session.add(*(terms.equal(variable(ParameterReference(name)) - value) for name, value in at.items()))
        verdict = session.check("network")
        assert (verdict is Verdict.SATISFIABLE) == Network(plan, at).consistent
        found[verdict] += 1

    run()
    assert found[Verdict.SATISFIABLE] >= 5
    assert found[Verdict.UNSATISFIABLE] >= 1


def test_mutex_pairs_are_those_of_the_simulator() -> None:
    kinds: Counter[TimePointKind] = Counter()

    @drawn(80)
    @given(plans(tame=False))
    def run(plan) -> None:
        pairs = mutex_pairs(plan)
        assert [(pair.first, pair.second) for pair in pairs] == list(simulated_mutex_pairs(plan))
        kinds.update(point.kind for pair in pairs for point in (pair.first, pair.second))
        for pair in pairs:
            assert pair.label == f"separation: {pair.first}, {pair.second}"

    run()
    assert set(kinds) == set(TimePointKind) - {TimePointKind.ZERO}


# --- slices -----------------------------------------------------------------------------------------------------------


def test_slices_join_what_shares_an_unknown() -> None:
    terms = Terms()
    chain = [X - Y, Y - 1, Z, constant(-1)]
    slices = Slices(terms, [*chain, W, X - Y])
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
    kept = Slices(terms, expressions).touching([asked])
    left_out = [terms.at_least(e) for e in expressions if terms.at_least(e) not in kept and e.variables]
    inside = terms.variables(terms.conjunction([asked, *kept]))
    assert inside.isdisjoint(terms.variables(terms.conjunction(left_out)))
    assert {terms.at_least(e) for e in expressions if not e.variables and e.constant_term < 0} <= set(kept)


POINTS = [TimePoint(TimePointKind.INSTANT, name) for name in "abcde"]
A, B, C = POINTS[:3]
WEIGHTS = st.fractions(-3, 2, max_denominator=6)
EDGES = st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), WEIGHTS), max_size=12)
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


def orders_of(edges, *more) -> Orders:
    return Orders(POINTS, edges, common_scale(weight for _, _, weight in (*edges, *more)))


def assert_same(orders: Orders, known: Known) -> None:
    for a, b in product(POINTS, POINTS):
        assert orders.least(a, b) == known.get((a, b))
        assert orders.surely_before(a, b) == (known.get((a, b), Fraction(-1)) > 0)
        assert orders.surely_not_after(a, b) == (known.get((a, b), Fraction(-1)) >= 0)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(EDGES)
def test_bounds_are_longest_paths(edges) -> None:
    known = longest(edges)
    orders = orders_of(edges)
    assert orders.consistent == (known is not None)
    if known is not None:
        assert_same(orders, known)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(EDGES, st.lists(st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), WEIGHTS), min_size=1, max_size=5))
def test_learning_is_the_same_as_having_known(edges, lessons) -> None:
    known = longest(edges)
    assume(known is not None)
    orders = orders_of(edges, *lessons)
    for lesson in lessons:
        first, second, weight = lesson
        together = longest([*edges, lesson])
        is_new = known.get((first, second)) is None or known[first, second] < weight
        assert orders.learn(*lesson) == (is_new and together is not None)
        if together is not None:
            known, edges = together, [*edges, lesson]
        assert_same(orders, known)


def test_equal_times_are_not_before_each_other() -> None:
    orders = orders_of([(A, B, Fraction(0)), (B, A, Fraction(0))])
    assert orders.surely_not_after(A, B)
    assert orders.surely_not_after(B, A)
    assert not orders.surely_before(A, B)
    assert orders.surely_not_after(C, C)
    assert orders.least(A, C) is None


def test_a_contradiction_is_told_and_not_learnt() -> None:
    assert not orders_of([(A, B, Fraction(1)), (B, A, Fraction(-1, 2))]).consistent
    orders = orders_of([(A, B, Fraction(1))])
    assert not orders.learn(B, A, Fraction(0))
    assert orders.least(B, A) is None
    assert orders.least(A, B) == 1


@pytest.mark.parametrize(("numbers", "scale"), [([], 1), ([Fraction(1, 4), Fraction(5, 6)], 12), ([Fraction(-3)], 1)])
def test_common_scale(numbers, scale) -> None:
    assert common_scale(numbers) == scale


@pytest.mark.parametrize(
    ("condition", "bounds", "exact"),
    [
        (at_least(DURATION, 4), [(False, 4)], True),
        (at_least(DURATION.scaled(Fraction(2)), 8), [(False, 4)], True),
        (above(DURATION, 4), [(False, 4)], False),
        (at_most(DURATION, 4), [(True, -4)], True),
        (above(number(4), DURATION), [(True, -4)], False),
        (Comparison(DURATION - 4, Relation.EQUAL), [(False, 4), (True, -4)], True),
        (different(DURATION, 4), [], False),
        (at_least(DURATION * DURATION, 4), [], False),
        (at_least(number(4), 4), [], False),
    ],
)
def test_what_duration_constraints_say_of_start_and_end(condition, bounds, exact) -> None:
    a = action("a", DurationConstraint(START, condition, "d"))
    not_negative, rule = duration_rules(plan_of(a))
    assert [(d.source, d.target, d.weight) for d in not_negative.bounds] == [(a.start, a.end, constant(0))]
    assert (not_negative.exact, not_negative.name) == (True, "a act: non-negative duration")
    assert [(d.source == a.end, d.weight) for d in rule.bounds] == [(back, constant(weight)) for back, weight in bounds]
    assert all({d.source, d.target} == {a.start, a.end} for d in rule.bounds)
    assert rule.exact is exact
