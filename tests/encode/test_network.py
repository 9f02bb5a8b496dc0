"""Times: solved equalities, what is left to assert, durations, independent parts, known orders, and mutex pairs."""

from collections import Counter
from contextlib import suppress
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from robust.encode import create_encoding, encoding, network
from robust.encode.effects import Writes, mutex_pairs
from robust.encode.interface import Auxiliary, Linear, TimeVariable, constant, least, variable
from robust.encode.network import Difference, Inequality, Orders, TemporalNetwork
from robust.encode.settled import proved
from robust.errors import UnsupportedError
from robust.plan.model import ZERO, DurationConstraint, Parameter, ParameterReference, TimedLiteral, TimePoint
from robust.plan.model import TimePointKind as Kind
from robust.plan.simulate import mutex_pairs as simulated_mutex_pairs
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Terms
from tests.plan import building
from tests.plan.building import DURATION, RANDOM, action, at, at_least, between, drawn, instant, plan_of
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

K = (Parameter("k", Fraction(3)),)
ONE, TWO, LONG = instant("i"), instant("j"), action("l")
k = building.reference("k")
X, Y, Z, W = (variable(Auxiliary(name, 0)) for name in "xyzw")
LITERAL = TimedLiteral(Fraction(7, 2), building.P, True)
t_i, t_j, t_start, t_end = (variable(TimeVariable(point)) for point in (ONE.start, TWO.start, LONG.start, LONG.end))
TIED, AFTER_LONG = between(ONE.start, TWO.start, k, k), between(LONG.end, TWO.start, 1, 1)
BEFORE_LITERAL, BACK = between(ONE.start, LITERAL.point, 1, 1), between(TWO.start, ONE.start, -3, -3)


@pytest.mark.parametrize(
    ("constraints", "places"),
    [
        ((at(ONE.start, 2), TIED), {ZERO: constant(0), ONE.start: constant(2), TWO.start: k + 2}),
        ((AFTER_LONG, between(TWO.start, ONE.start, 0)), {LONG.start: t_start, TWO.start: t_end + 1}),
        ((BEFORE_LITERAL,), {LITERAL.point: constant(LITERAL.time), ONE.start: constant(Fraction(5, 2))}),
    ],
)
def test_time_points_are_tied(constraints, places) -> None:
    """Along equalities, from points that nothing ties, backwards and through timed literals."""
    tied = TemporalNetwork(plan_of(LONG, TWO, ONE, constraints=constraints, literals=(LITERAL,), parameters=K))
    assert {point: tied.places[point] for point in places} == places


@pytest.mark.parametrize(
    ("constraints", "expressions"),
    [
        ((between(ONE.start, TWO.start, 1),), [(t_j - t_i - 1, None), (t_i, ONE.start), (t_j, TWO.start)]),
        ((TIED, BACK), [(-k + 3, None), (k - 3, None), (t_i, ONE.start), (t_i + k, TWO.start)]),
        ((at(ONE.start, 1), TIED, between(TWO.start, ONE.start, -k, -k)), [(k + 1, TWO.start)]),
    ],
)
def test_what_is_left_to_say(constraints, expressions) -> None:
    """What is unsaid comes last; a circle is an equation; one that closes says nothing."""
    inequalities = TemporalNetwork(plan_of(ONE, TWO, constraints=constraints, parameters=K)).inequalities
    assert [(inequality.expression, inequality.not_before_zero) for inequality in inequalities] == expressions


def test_declared_bounds_are_inequalities_and_inequalities_differences() -> None:
    plan = plan_of(ONE, parameters=(Parameter("k", Fraction(3), lower=Fraction(1), upper=Fraction(4)),))
    tied = TemporalNetwork(plan)
    bounds = [Inequality(k - 1, ("parameter k lb 1",)), Inequality(-k + 4, ("parameter k ub 4",))]
    assert list(tied.bounds_of_parameters()) == bounds
    unbounded = variable(ParameterReference("m"))
    differences = [Difference(ZERO, ONE.start, weight, ()) for weight in (k.scaled(-2), unbounded)]
    assert list(tied.bounds(differences)) == [(ZERO, ONE.start, -8)]
    assert tied.slack(differences[0]) == t_i + k.scaled(2)
    for expression, source, target, weight in (
        (t_j - t_i - k + 2, ONE.start, TWO.start, k - 2),
        (-t_i + 2, ONE.start, ZERO, constant(-2)),
        (t_i, ZERO, ONE.start, constant(0)),
    ):
        assert Inequality(expression, ("said",)).as_difference() == Difference(source, target, weight, ("said",))


def test_least_value_of_an_expression_over_a_box() -> None:
    m, other = variable(ParameterReference("m")), variable(ParameterReference("other"))
    ranges = {"k": (Fraction(1), Fraction(3)), "m": (None, Fraction(2))}
    expressions = {k.scaled(2) - m + 1: 1, k + m: None, m.scaled(0) + k: 1, k + X: None, other: None, constant(5): 5}
    assert {expression: least(expression, ranges) for expression in expressions} == expressions


def test_the_network_has_the_schedules_that_shortest_paths_find() -> None:
    """Sampled ones satisfy it and its places, and its formulas have a model exactly if there is one."""
    verdicts: Counter[Satisfiability] = Counter()

    @drawn(30)
    @given(plans(linear=True), RANDOM)
    def run(plan, random) -> None:
        tied, terms = TemporalNetwork(plan), Terms()
        for values in (plan.nominal, sample_parameters(plan, random, spread=Fraction(4))):
            for schedule in sample_schedules(plan, values, random, 2):
                unknowns = {ParameterReference(name): value for name, value in values.items()}
                unknowns.update({TimeVariable(point): time for point, time in schedule.items()})
                assert {point: place.evaluate(unknowns) for point, place in tied.places.items()} == schedule
                assert all(inequality.expression.evaluate(unknowns) >= 0 for inequality in tied.inequalities)
        session = Session(terms)
        session.add(*(terms.at_least(inequality.expression) for inequality in tied.inequalities))
        session.add(*(terms.equal(variable(ParameterReference(name)) - value) for name, value in values.items()))
        verdict = session.check("network")
        assert (verdict is Satisfiability.SATISFIABLE) == Network(plan, values).consistent
        verdicts[verdict] += 1

    run()
    assert verdicts[Satisfiability.SATISFIABLE] >= 5
    assert verdicts[Satisfiability.UNSATISFIABLE] >= 1


def test_mutex_pairs_are_those_of_the_simulator() -> None:
    kinds = set()

    @drawn(50)
    @given(plans(tame=False))
    def run(plan) -> None:
        pairs = mutex_pairs(plan)
        assert list(pairs) == list(simulated_mutex_pairs(plan))
        kinds.update(point.kind for pair in pairs for point in pair)

    run()
    assert set(kinds) == set(Kind) - {Kind.ZERO}


OTHERS = building.different(DURATION, 4), at_least(DURATION * DURATION, 4), at_least(4, 4)


@pytest.mark.parametrize(
    ("condition", "bounds", "exact"),
    [
        (at_least(DURATION, 4), [(False, 4)], True),
        (at_least(DURATION.scaled(Fraction(2)), 8), [(False, 4)], True),
        (building.above(DURATION, 4), [(False, 4)], False),
        (building.at_most(DURATION, 4), [(True, -4)], True),
        (building.above(4, DURATION), [(True, -4)], False),
        (building.equal(DURATION, 4), [(False, 4), (True, -4)], True),
        *((condition, [], False) for condition in OTHERS),
    ],
)
def test_what_duration_constraints_say_of_start_and_end(condition, bounds, exact) -> None:
    a = action("a", DurationConstraint(building.START, condition, "d"))
    plan = plan_of(a)
    not_negative, rule = network.duration_rules(plan, Writes(plan))
    name = "a act: non-negative duration"
    assert (not_negative.name, not_negative.exact) == (name, True)
    assert not_negative.bounds == (Difference(a.start, a.end, constant(0), (name,)),)
    ends = {False: (a.start, a.end), True: (a.end, a.start)}
    expected = tuple(Difference(*ends[back], constant(weight), ("a act: duration d",)) for back, weight in bounds)
    assert (rule.bounds, rule.exact) == (expected, exact)


def test_parts_join_what_shares_an_unknown() -> None:
    terms = Terms()
    parts = network.IndependentParts(terms, [X - Y, Y - 1, Z, constant(-1), W, X - Y])
    of_x = parts.touching([terms.greater(X)])
    assert sorted(map(str, of_x)) == sorted(str(terms.at_least(e)) for e in (X - Y, Y - 1, constant(-1)))
    assert parts.touching([terms.greater(Z + W)]) == [terms.false, terms.at_least(W), terms.at_least(Z)]
    assert parts.touching([terms.true]) == [terms.false]


ROW = st.tuples(*[st.integers(-1, 1)] * 5)


@drawn(80)
@given(st.lists(ROW, max_size=6), ROW)
def test_what_a_part_leaves_out_shares_nothing_with_it(rows, question) -> None:
    def expression(row) -> Linear:
        return sum((v.scaled(f) for v, f in zip((X, Y, Z, W), row, strict=False)), constant(row[-1]))

    terms, expressions = Terms(), [expression(row) for row in rows]
    asked = terms.greater(expression(question))
    kept = network.IndependentParts(terms, expressions).touching([asked])
    others = [terms.at_least(e) for e in expressions if terms.at_least(e) not in kept and e.variables]
    inside = terms.variables(terms.conjunction([asked, *kept]))
    assert inside.isdisjoint(terms.variables(terms.conjunction(others)))
    assert {terms.at_least(e) for e in expressions if not e.variables and e.constant_term < 0} <= set(kept)


POINTS = [TimePoint(Kind.INSTANT, name) for name in "abcde"]
A, B, C, D, E = POINTS
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


@drawn(50)
@given(st.lists(EDGE, max_size=12), st.lists(EDGE, min_size=1, max_size=5))
def test_bounds_are_longest_paths_and_learning_is_the_same_as_having_known(edges, lessons) -> None:
    known = longest(edges)
    orders = Orders(POINTS, edges, [weight for _, _, weight in lessons])
    assert orders.consistent == (known is not None)
    assume(known is not None)
    assert_same(orders, known)
    for first, second, weight in lessons:
        lesson = first, second, weight
        together = longest([*edges, lesson])
        is_new = known.get((first, second)) is None or known[first, second] < weight
        assert orders.learn(*lesson) == (is_new and together is not None)
        if together is not None:
            known, edges = together, [*edges, lesson]
        assert_same(orders, known)


def test_pairs_in_known_order_are_separated_until_nothing_is_new() -> None:
    """That b follows a by 1 lets c follow b, and both let c follow a by 2."""
    bounds = [(A, B, Fraction(0)), (A, C, Fraction(1, 2)), (B, C, Fraction(-3, 2)), (C, D, Fraction(-1))]
    orders = Orders(POINTS, bounds, [Fraction(1)])
    pairs = [(A, E), (C, D), (C, B), (B, A)]
    assert list(orders.separate(pairs, Fraction(1))) == [(A, B)]
    assert orders.least(A, C) == Fraction(1, 2)
    assert orders.learn(B, C, Fraction(-1, 2))
    assert list(orders.separate(pairs, Fraction(1))) == [(B, C)]
    assert orders.least(A, C) == 2


@pytest.mark.parametrize("count", [60, pytest.param(4000, marks=pytest.mark.slow)])
def test_the_solver_proves_what_paths_prove(count, monkeypatch) -> None:
    epsilon = Fraction(1, 1000)
    obligations: Counter[bool] = Counter()
    monkeypatch.setattr(encoding, "proved", lambda *_: frozenset())

    @settings(drawn(count), phases=[Phase.generate], database=None)
    @given(plans(linear=True))
    def run(plan) -> None:
        names = proved(plan, epsilon, mutex_pairs(plan))
        with suppress(UnsupportedError):
            alone = create_encoding("relational", plan, epsilon)
            assert names <= {obligation.name for obligation in alone.obligations}
            session = Session(alone.terms)
            for obligation in alone.obligations:
                if obligation.name in names:
                    with session.frame(*alone.full_query(obligation)):
                        assert session.check("proved by paths") is Satisfiability.UNSATISFIABLE, obligation.name
                obligations[obligation.name in names] += 1

    run()
    assert obligations[True] > count
    assert obligations[False] > count / 10
