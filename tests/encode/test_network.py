"""Times: solved equalities, orders, mutex pairs; enc_valid: which parameter values leave a schedule, by quantifiers."""

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product
from random import Random
from unittest.mock import Mock

import pytest
import z3
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from robust.backends import ENCODINGS
from robust.encode import create_encoding, interface, network, settled
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import Auxiliary, Encoding, Facet, Grid, Range, TimeVariable, constant, variable
from robust.encode.network import Difference, Inequality, Orders, TemporalNetwork
from robust.encode.positions import PositionsEncoding
from robust.errors import UnsupportedError
from robust.plan import model
from robust.plan.model import ZERO, DurationConstraint, Parameter, ParameterReference, ParametrizedPlan, TimedLiteral
from robust.plan.model import TimePointKind as Kind
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs as simulated_mutex_pairs
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Satisfiability, Session, Terms
from tests.encode.asking import follows, sampled, unless_hidden
from tests.network import oracles
from tests.plan import building
from tests.plan.building import (
    DURATION,
    RANDOM,
    action,
    at,
    at_least,
    between,
    drawn,
    instant,
    number,
    plan_of,
    reference,
)
from tests.sampling import Network, bound_value, sample_parameters, sample_schedules
from tests.strategies import plans

K = (Parameter("k", Fraction(3)),)
ONE, TWO, LONG = instant("i"), instant("j"), action("l")
k = building.reference("k")
X, Y, Z, W = (variable(Auxiliary(name, 0)) for name in "xyzw")
LITERAL = TimedLiteral(Fraction(7, 2), building.P, True)
t_i, t_j, t_start, t_end = (variable(TimeVariable(point)) for point in (ONE.start, TWO.start, LONG.start, LONG.end))
TIED, AFTER_LONG = between(ONE.start, TWO.start, k, k), between(LONG.end, TWO.start, 1, 1)
BEFORE_LITERAL, BACK = between(ONE.start, LITERAL.point, 1, 1), between(TWO.start, ONE.start, -3, -3)


def test_time_points_are_tied():
    """Along equalities, from points that nothing ties, backwards and through timed literals."""
    for constraints, places in (
        ((at(ONE.start, 2), TIED), {ZERO: constant(0), ONE.start: constant(2), TWO.start: k + 2}),
        ((AFTER_LONG, between(TWO.start, ONE.start, 0)), {LONG.start: t_start, TWO.start: t_end + 1}),
        ((BEFORE_LITERAL,), {LITERAL.point: constant(LITERAL.time), ONE.start: constant(Fraction(5, 2))}),
    ):
        tied = TemporalNetwork(plan_of(LONG, TWO, ONE, constraints=constraints, literals=(LITERAL,), parameters=K))
        assert {point: tied.places[point] for point in places} == places


def test_what_is_left_to_say():
    """What is unsaid comes last; a circle is an equation; one that closes says nothing."""
    for constraints, expressions in (
        ((between(ONE.start, TWO.start, 1),), [(t_j - t_i - 1, None), (t_i, ONE.start), (t_j, TWO.start)]),
        ((TIED, BACK), [(-k + 3, None), (k - 3, None), (t_i, ONE.start), (t_i + k, TWO.start)]),
        ((at(ONE.start, 1), TIED, between(TWO.start, ONE.start, -k, -k)), [(k + 1, TWO.start)]),
    ):
        inequalities = TemporalNetwork(plan_of(ONE, TWO, constraints=constraints, parameters=K)).inequalities
        assert [(inequality.expression, inequality.not_before_zero) for inequality in inequalities] == expressions


def test_declared_bounds_inequalities_as_differences_and_least_values_over_a_box() -> None:
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
    m, other = variable(ParameterReference("m")), variable(ParameterReference("other"))
    ranges = {"k": (Fraction(1), Fraction(3)), "m": (None, Fraction(2))}
    expressions = {k.scaled(2) - m + 1: 1, k + m: None, m.scaled(0) + k: 1, k + X: None, other: None, constant(5): 5}
    assert {expression: interface.least(expression, ranges) for expression in expressions} == expressions


def test_the_network_has_the_schedules_that_shortest_paths_find() -> None:
    """Sampled ones satisfy it and its places, and its formulas have a model exactly if there is one."""
    verdicts: Counter[Satisfiability] = Counter()

    @drawn(20, 30)
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

    @drawn(50, 500)
    @given(plans(tame=False))
    def run(plan) -> None:
        pairs = network.mutex_pairs(plan)
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
    not_negative, rule = network.duration_rules(plan, network.Writes(plan))
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


@drawn(40, 80)
@given(st.lists(ROW, max_size=6), ROW)
def test_what_a_part_leaves_out_shares_nothing_with_it(rows, question) -> None:
    def expression(row) -> interface.Linear:
        return sum((v.scaled(f) for v, f in zip((X, Y, Z, W), row, strict=False)), constant(row[-1]))

    terms, expressions = Terms(), [expression(row) for row in rows]
    asked = terms.greater(expression(question))
    kept = network.IndependentParts(terms, expressions).touching([asked])
    others = [terms.at_least(e) for e in expressions if terms.at_least(e) not in kept and e.variables]
    inside = terms.variables(terms.conjunction([asked, *kept]))
    assert inside.isdisjoint(terms.variables(terms.conjunction(others)))
    assert {terms.at_least(e) for e in expressions if not e.variables and e.constant_term < 0} <= set(kept)


POINTS = [model.TimePoint(Kind.INSTANT, name) for name in "abcde"]
A, B, C, D, E = POINTS
EDGE = st.tuples(st.sampled_from(POINTS), st.sampled_from(POINTS), st.fractions(-3, 2, max_denominator=6))
Known = dict[tuple[model.TimePoint, model.TimePoint], Fraction]


def longest(edges: list[tuple[model.TimePoint, model.TimePoint, Fraction]]) -> Known | None:
    """Longest paths; None if there is a positive cycle."""
    known: Known = oracles.closure(POINTS, edges)
    return None if any(known[point, point] > 0 for point in POINTS) else known


def assert_same(orders: Orders, known: Known) -> None:
    for a, b in product(POINTS, POINTS):
        assert orders.least(a, b) == known.get((a, b))
        assert orders.surely_before(a, b) == (known.get((a, b), Fraction(-1)) > 0)
        assert orders.surely_not_after(a, b) == (known.get((a, b), Fraction(-1)) >= 0)


@drawn(25, 50)
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


@pytest.mark.parametrize("count", [30, pytest.param(4000, marks=pytest.mark.slow)])
def test_the_solver_proves_what_paths_prove(count, monkeypatch) -> None:
    epsilon = Fraction(1, 1000)
    obligations: Counter[bool] = Counter()
    proved = settled.proved
    monkeypatch.setattr(settled, "proved", lambda *_: frozenset())

    @settings(drawn(count), phases=[Phase.generate], database=None)
    @given(plans(linear=True))
    def run(plan) -> None:
        names = proved(plan, epsilon, network.mutex_pairs(plan))
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


SIDES = [(1, model.Relation.AT_LEAST), (-1, model.Relation.AT_LEAST), (1, model.Relation.EQUAL)]
DECLARED = [(None, None), (None, None), (Fraction(-1), None), (Fraction(-2), Fraction(4))]


@st.composite
def networks(draw) -> tuple[ParametrizedPlan, dict[str, Range]]:
    """A network of few instances whose bounds mention the same parameters again and again, and a box."""
    names = [f"k{index}" for index in range(draw(st.integers(1, 3)))]
    small = st.integers(-2, 5).map(lambda n: Fraction(n, 2))

    def bound() -> Polynomial:
        terms = st.lists(st.tuples(st.sampled_from(names), st.sampled_from([1, 1, -1, 2])), max_size=2)
        return sum((reference(name).scaled(factor) for name, factor in draw(terms)), number(draw(small)))

    instances, constraints = [], []
    for index in range(draw(st.integers(1, 3))):
        rules = []
        if draw(st.booleans()):
            sign, relation = draw(st.sampled_from(SIDES))
            condition = model.NumericCondition((DURATION - bound()).scaled(sign), relation)
            rules = [DurationConstraint(building.START, condition, "rule 0")]
        instances.append(building.action(f"i{index}", *rules, durative=bool(rules) or draw(st.booleans())))
    time_points = st.sampled_from([ZERO, *(point for instance in instances for point in instance.time_points)])
    for _ in range(draw(st.integers(1, 6))):
        source, target = draw(time_points), draw(time_points)
        lower, upper = (bound() if draw(st.booleans()) else None for _ in range(2))
        if draw(st.integers(0, 3)) == 0:
            lower = upper = bound()
        if source != target:
            constraints.append(between(source, target, lower, upper))
    literals = (TimedLiteral(Fraction(2), building.P, True),) if draw(st.integers(0, 4)) == 0 else ()
    parameters = []
    ranges: dict[str, Range] = {}
    for name in names:
        middle, half = draw(small), draw(st.sampled_from([Fraction(0), Fraction(1, 2), Fraction(2)]))
        lower, upper = draw(st.sampled_from(DECLARED))
        parameters.append(Parameter(name, middle, lower=lower, upper=upper))
        low, high = middle - half, middle + half
        infinite = draw(st.integers(0, 6)) == 0
        ranges[name] = draw(st.sampled_from([(None, high), (low, None), (None, None)])) if infinite else (low, high)
    plan = plan_of(*instances, constraints=tuple(constraints), literals=literals, parameters=tuple(parameters))
    return plan, ranges


def keeps_rule(plan: ParametrizedPlan, values: dict[str, Fraction], name: str) -> bool:
    """Whether some schedule of the network keeps the one duration obligation of that name."""
    extra = []
    for instance in plan.instances:
        if name == f"{instance.identifier} {instance.action}: non-negative duration":
            extra.append(between(instance.start, instance.end, 0))
        for rule in instance.durations:
            if instance.label(rule) == name:
                factor = rule.condition.expression.terms[(next(iter(DURATION.variables)),)]
                limit = DURATION - rule.condition.expression.scaled(1 / factor)
                exact = rule.condition.relation is model.Relation.EQUAL
                low, high = (limit if side > 0 or exact else None for side in (factor, -factor))
                extra.append(between(instance.start, instance.end, low, high))
    assert extra, f"no such obligation: {name}"
    return Network(replace(plan, constraints=(*plan.constraints, *extra)), values).consistent


def some_point_has_no_schedule(encoding: Encoding, ranges: dict[str, Range]) -> bool:
    """By the definition, with quantifiers."""
    network = encoding.network_formulas()
    solver = z3.Tactic("qsat").solver()
    for name, (low, high) in ranges.items():
        solver.add(*([] if low is None else [z3.Real(name) >= z3.Q(low.numerator, low.denominator)]))
        solver.add(*([] if high is None else [z3.Real(name) <= z3.Q(high.numerator, high.denominator)]))
    solver.add(unless_hidden(encoding, network))
    answer = solver.check()
    assert answer != z3.unknown
    return bool(answer == z3.sat)


def judge(plan: ParametrizedPlan, ranges: dict[str, Range], random: Random, name: str, solver: str) -> str:
    encoding = create_encoding(name, plan)
    make_session = Mock(wraps=lambda: Session(encoding.terms, solver=solver))
    facet = encoding.validity.broken_facet(Grid(ranges), make_session, NEVER)
    assert not isinstance(facet, Satisfiability)
    by = ", by solver" if make_session.called else ""
    if facet is None or facet.obligation is None:
        assert (facet is not None) == some_point_has_no_schedule(encoding, ranges)
    if facet is None:
        # What None also claims: parameters alone do not force a negative duration.
        for instance in plan.instances if name == "relational" else ():
            if instance.durative and interface.is_over_parameters(
                encoding.places[instance.end] - encoding.places[instance.start]
            ):
                rule = f"{instance.identifier} {instance.action}: non-negative duration"
                assert all(keeps_rule(plan, values, rule) for values in sampled(ranges, random, 8))
        return f"none{by}"
    assert interface.is_over_parameters(facet.expression)
    points = [*sampled(ranges, random, 8), *sampled({name: (Fraction(-6), Fraction(6)) for name in ranges}, random, 20)]
    outside = [values for values in points if bound_value(facet.expression, values) < 0]
    assert outside, "some sampled corner of the box lies outside the facet"
    if facet.obligation is None:
        follows(encoding, facet, ranges)
        assert not any(Network(plan, values).consistent for values in outside)
    else:
        assert facet.breaks_in(Grid(ranges))
        assert not any(keeps_rule(plan, values, facet.obligation) for values in outside)
    if any(low is None or high is None for low, high in ranges.values()):
        return "facet of an infinite box"
    return ("facet" if facet.obligation is None else "obligation") + by


@pytest.mark.parametrize(
    ("encoding", "solver", "count"),
    [
        ("relational", "z3", 70),
        ("relational", "cvc5", 50),
        ("positions", "z3", 60),
        *(pytest.param(encoding, "z3", 20_000, marks=pytest.mark.slow) for encoding in ENCODINGS),
    ],
)
def test_broken_facets_are_right(encoding, solver, count) -> None:
    outcomes: Counter[str] = Counter()

    @settings(drawn(count), derandomize=count < 1000)
    @given(networks(), RANDOM)
    def run(network, random) -> None:
        outcomes[judge(*network, random, encoding, solver)] += 1

    run()
    assert outcomes["none"] >= 5, outcomes
    assert outcomes["facet"] >= 5, outcomes
    assert outcomes["obligation"] + outcomes["facet of an infinite box"] >= 1, outcomes


def ask(encoding: Encoding, box: dict[str, Range], deadline: Deadline = NEVER) -> Facet | Satisfiability | None:
    return encoding.validity.broken_facet(Grid(box), lambda: Session(encoding.terms), deadline)


@drawn(40, 300)
@given(networks(), st.lists(st.fractions(-4, 4, max_denominator=2), min_size=6, max_size=6))
def test_what_was_asked_before_changes_no_answer(network, ends) -> None:
    plan, ranges = network
    others = {name: tuple(sorted(ends[2 * i : 2 * i + 2])) for i, name in enumerate(ranges)}
    encoding = RelationalEncoding(plan)
    ask(encoding, others)
    for box in (ranges, others, ranges):
        assert (ask(encoding, box) is None) == (ask(RelationalEncoding(plan), box) is None)


# A cycle through k on both sides: its edges are at their worst at different ends, the sum is never positive.
# i starts between 2 and 3, and starts j after k as j starts k + 1 after i at most.
FIRST, THEN, LEVEL = instant("i"), instant("j"), reference("k")
EDGES = between(FIRST.start, THEN.start, LEVEL), between(FIRST.start, THEN.start, None, LEVEL + 1)
CIRCLE = (between(ZERO, FIRST.start, 2, 3), *EDGES)
WORST_APART = plan_of(FIRST, THEN, constraints=CIRCLE, parameters=(Parameter("k", Fraction(1)),))


def test_edges_at_their_worst_at_different_points_of_the_box(monkeypatch) -> None:
    """Out of time the answer is unknown, and spoils nothing."""
    for name in ENCODINGS:
        encoding, box = create_encoding(name, WORST_APART), {"k": (Fraction(-4), Fraction(1000))}
        with monkeypatch.context() as patch:
            patch.setattr("robust.encode.validity.Validity._has_no_simple_cycle", lambda *_: False)
            assert ask(encoding, box, Deadline.after(0)) is Satisfiability.UNKNOWN
        assert ask(encoding, box) is None
    encoding, low = RelationalEncoding(WORST_APART), Fraction(-4)
    assert ask(encoding, {"k": (low, Fraction(1000))}) is ask(encoding, {"k": (low, None)}) is None
    broken = ask(encoding, {"k": (low - 1, Fraction(1000))})
    assert isinstance(broken, Facet)
    assert bound_value(broken.expression, {"k": low}) == 0
    assert isinstance(ask(encoding, {"k": (None, Fraction(0))}), Facet)


def test_the_statements_that_contradict_each_other_at_a_point() -> None:
    constraints = (between(ZERO, FIRST.start, LEVEL), between(ZERO, FIRST.start, None, 3))
    parameters = (Parameter("k", Fraction(1), upper=Fraction(9)),)
    validity = RelationalEncoding(plan_of(FIRST, constraints=constraints, parameters=parameters)).validity
    assert validity.contradiction({"k": Fraction(3)}) is None
    facet = validity.contradiction({"k": Fraction(5)})
    assert facet is not None
    assert set(facet.origins) == set(map(str, constraints))
    assert bound_value(facet.expression, {"k": Fraction(5)}) == -2
    assert validity.contradiction({"k": Fraction(10)}) == Facet(number(9) - LEVEL, ("parameter k ub 9",))
    facet = ask(RelationalEncoding(plan_of(FIRST, constraints=(between(ZERO, FIRST.start, 3, 2),))), {})
    assert isinstance(facet, Facet)
    assert facet.expression == number(-1), "a plan without parameters has facets without variables"
    # Equalities of one point contradict each other, or one and the time of a timed literal.
    timed = TimedLiteral(Fraction(2), building.P, True)
    for other, statements in ((at(FIRST.start, 2), 2), (at(timed.point, 1), 1), (at(timed.point, 3), 1)):
        constraints = (at(FIRST.start, 1), other)
        plan = plan_of(FIRST, constraints=constraints, literals=(timed,))
        facet = RelationalEncoding(plan).validity.contradiction({})
        assert len(set(facet.origins) & set(map(str, constraints))) == statements


@pytest.mark.parametrize("shift", [0, -100])
def test_crowded_bounds_are_thinned_by_a_solver(shift: int) -> None:
    """Tangents of k², none of which another one covers, and lines between them that only two together cover."""
    tangents = [LEVEL.scaled(2 * n) - n * n for n in range(-4, 5)]
    covered = [LEVEL.scaled(2 * n + 1) - n * (n + 1) - Fraction(3, 5) for n in range(-4, 4)]
    constraints = [between(FIRST.start, THEN.start, bound + shift) for bound in (*covered, *tangents)]
    top = between(FIRST.start, THEN.start, None, 16 + shift)
    plan = plan_of(FIRST, THEN, constraints=(*constraints, top), parameters=(Parameter("k", Fraction(0)),))
    encoding = PositionsEncoding(plan)
    session = Mock(wraps=lambda: Session(encoding.terms))
    for low, high in ((-4, 4), *product((-5, 0), (0, 5))):
        box = {"k": (Fraction(low), Fraction(high))}
        broken = encoding.validity.broken_facet(Grid(box), session, NEVER)
        assert (broken is None) == (low >= -4 and high <= 4)
        assert session.called
    for unbounded in ((None, Fraction(4)), (Fraction(-4), None)):
        assert isinstance(ask(PositionsEncoding(plan), {"k": unbounded}), Facet)


def test_simple_cycles_decide_as_solvers_do_where_distances_are_parameters(monkeypatch) -> None:
    """Actions whose durations are parameters, in some order, with deadlines and greatest distances."""
    random = Random(7)  # noqa: S311 - no secret
    decided = Counter[tuple[bool, bool]]()
    for _ in range(400):
        points = [instant(f"i{index}").start for index in range(random.randint(3, 7))]
        names = [f"k{index}" for index in range(len(points) // 2)]
        pairs = zip(names, points[::2], points[1::2], strict=False)
        constraints = [between(*pair, reference(name), reference(name)) for name, *pair in pairs]
        ordered = (pair for pair in pairwise(points) if random.random() < 0.8)
        constraints += [between(*pair, Fraction(random.randint(-2, 1))) for pair in ordered]
        latest = [random.sample([ZERO, *points], 2) for _ in range(random.randint(1, 3))]
        constraints += [between(*pair, None, Fraction(random.randint(0, 12))) for pair in latest]
        parameters = tuple(Parameter(name, Fraction(2)) for name in names)
        instances = [instant(f"{point}") for point in points]
        plan = plan_of(*instances, constraints=tuple(constraints), parameters=parameters)
        box = {name: (Fraction(random.randint(0, 2)), Fraction(random.randint(2, 5))) for name in names}
        found = ask(RelationalEncoding(plan), box)
        sessions: list[Session] = []
        with monkeypatch.context() as patch:
            patch.setattr("robust.encode.validity.Validity._has_no_simple_cycle", lambda *_: False)
            expected = asking(RelationalEncoding(plan), box, sessions)
        assert (found is None) == (expected is None)
        decided[expected is None, bool(sessions)] += 1
    assert min(decided[True, True], decided[False, False], decided[True, False]) >= 10, decided


def asking(encoding: Encoding, box: dict[str, Range], sessions: list[Session]) -> Facet | Satisfiability | None:
    """What is found, with the solver's sessions that it took."""

    def make() -> Session:
        sessions.append(Session(encoding.terms))
        return sessions[-1]

    return encoding.validity.broken_facet(Grid(box), make, NEVER)
