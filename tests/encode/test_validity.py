"""enc_valid: which parameter values leave a schedule, against its definition with quantifiers and at single points."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import product
from random import Random
from unittest.mock import Mock

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.backends import ENCODINGS
from robust.encode import create_encoding
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import Encoding, Facet, Grid, Range, is_over_parameters
from robust.encode.positions.encoding import PositionsEncoding
from robust.plan import model
from robust.plan.model import ZERO, DurationConstraint, Parameter, ParametrizedPlan, Relation, TimedLiteral
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Satisfiability, Session
from tests.encode.asking import follows, sampled, unless_hidden
from tests.plan import building
from tests.plan.building import DURATION, RANDOM, START, P, at, between, drawn, instant, number, plan_of, reference
from tests.sampling import Network, bound_value

SIDES = [(1, Relation.AT_LEAST), (-1, Relation.AT_LEAST), (1, Relation.EQUAL)]
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
            rules = [DurationConstraint(START, condition, "rule 0")]
        instances.append(building.action(f"i{index}", *rules, durative=bool(rules) or draw(st.booleans())))
    time_points = st.sampled_from([ZERO, *(point for instance in instances for point in instance.time_points)])
    for _ in range(draw(st.integers(1, 6))):
        source, target = draw(time_points), draw(time_points)
        lower, upper = (bound() if draw(st.booleans()) else None for _ in range(2))
        if draw(st.integers(0, 3)) == 0:
            lower = upper = bound()
        if source != target:
            constraints.append(between(source, target, lower, upper))
    literals = (TimedLiteral(Fraction(2), P, True),) if draw(st.integers(0, 4)) == 0 else ()
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
                exact = rule.condition.relation is Relation.EQUAL
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
            if instance.durative and is_over_parameters(
                encoding.places[instance.end] - encoding.places[instance.start]
            ):
                rule = f"{instance.identifier} {instance.action}: non-negative duration"
                assert all(keeps_rule(plan, values, rule) for values in sampled(ranges, random, 8))
        return f"none{by}"
    assert is_over_parameters(facet.expression)
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


@drawn(40)
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
FIRST, THEN, K = instant("i"), instant("j"), reference("k")
EDGES = between(FIRST.start, THEN.start, K), between(FIRST.start, THEN.start, None, K + 1)
CIRCLE = (between(ZERO, FIRST.start, 2, 3), *EDGES)
WORST_APART = plan_of(FIRST, THEN, constraints=CIRCLE, parameters=(Parameter("k", Fraction(1)),))


def test_edges_at_their_worst_at_different_points_of_the_box() -> None:
    encoding, low = RelationalEncoding(WORST_APART), Fraction(-4)
    for high in (Fraction(1000), None):
        assert ask(encoding, {"k": (low, high)}) is None
    broken = ask(encoding, {"k": (low - 1, Fraction(1000))})
    assert isinstance(broken, Facet)
    assert bound_value(broken.expression, {"k": low}) == 0
    assert isinstance(ask(encoding, {"k": (None, Fraction(0))}), Facet)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_out_of_time_is_unknown_and_spoils_nothing(encoding) -> None:
    box = {"k": (Fraction(-4), Fraction(1000))}
    asked = create_encoding(encoding, WORST_APART)
    assert ask(asked, box, Deadline.after(0)) is Satisfiability.UNKNOWN
    assert ask(asked, box) is None


def test_the_statements_that_contradict_each_other_at_a_point() -> None:
    constraints = (between(ZERO, FIRST.start, K), between(ZERO, FIRST.start, None, 3))
    parameters = (Parameter("k", Fraction(1), upper=Fraction(9)),)
    validity = RelationalEncoding(plan_of(FIRST, constraints=constraints, parameters=parameters)).validity
    assert validity.contradiction({"k": Fraction(3)}) is None
    facet = validity.contradiction({"k": Fraction(5)})
    assert facet is not None
    assert set(facet.origins) == set(map(str, constraints))
    assert bound_value(facet.expression, {"k": Fraction(5)}) == -2
    assert validity.contradiction({"k": Fraction(10)}) == Facet(number(9) - K, ("parameter k ub 9",))
    facet = ask(RelationalEncoding(plan_of(FIRST, constraints=(between(ZERO, FIRST.start, 3, 2),))), {})
    assert isinstance(facet, Facet)
    assert facet.expression == number(-1), "a plan without parameters has facets without variables"
    # Equalities of one point contradict each other, or one and the time of a timed literal.
    timed = TimedLiteral(Fraction(2), P, True)
    for other, statements in ((at(FIRST.start, 2), 2), (at(timed.point, 1), 1), (at(timed.point, 3), 1)):
        constraints = (at(FIRST.start, 1), other)
        plan = plan_of(FIRST, constraints=constraints, literals=(timed,))
        facet = RelationalEncoding(plan).validity.contradiction({})
        assert len(set(facet.origins) & set(map(str, constraints))) == statements


@pytest.mark.parametrize("shift", [0, -100])
def test_crowded_bounds_are_thinned_by_a_solver(shift: int) -> None:
    """Tangents of k², none of which another one covers, and lines between them that only two together cover."""
    tangents = [K.scaled(2 * n) - n * n for n in range(-4, 5)]
    covered = [K.scaled(2 * n + 1) - n * (n + 1) - Fraction(3, 5) for n in range(-4, 4)]
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
