"""enc_valid against brute force: which parameter values leave a schedule, decided by Bellman–Ford at single points."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.encode.encoding import RelationalEncoding
from robust.encode.validity import Facet
from robust.encode.variables import Range
from robust.plan.model import (
    ZERO,
    Comparison,
    DurationConstraint,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    Timing,
)
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from tests.plan.building import DURATION, P, action, instant, number, plan_of

FAR = Fraction(50)
"""Stands for an infinite end when points are sampled; bounds and factors of drawn networks are much smaller."""


def reference(name: str) -> Polynomial:
    return Polynomial.variable(ParameterReference(name))


@st.composite
def networks(draw) -> tuple[ParametrizedPlan, dict[str, Range]]:
    """A network of few instances whose bounds mention the same parameters again and again, and a box."""
    names = [f"k{index}" for index in range(draw(st.integers(1, 3)))]
    small = st.integers(-2, 5).map(lambda n: Fraction(n, 2))

    def bound() -> Polynomial:
        total = number(draw(small))
        for _ in range(draw(st.integers(0, 2))):
            total = total + reference(draw(st.sampled_from(names))).scaled(draw(st.sampled_from([1, 1, -1, 2])))
        return total

    instances = []
    for index in range(draw(st.integers(1, 3))):
        rules = []
        for rule in range(draw(st.integers(0, 1))):
            sign, relation = draw(
                st.sampled_from([(1, Relation.AT_LEAST), (-1, Relation.AT_LEAST), (1, Relation.EQUAL)])
            )
            condition = Comparison((DURATION - bound()).scaled(sign), relation)
            rules.append(DurationConstraint(Timing.AT_START, condition, f"rule {rule}"))
        durative = draw(st.booleans()) or bool(rules)
        instances.append(action(f"i{index}", *rules) if durative else instant(f"i{index}"))
    time_points = [ZERO, *(point for instance in instances for point in instance.time_points)]
    constraints = []
    for _ in range(draw(st.integers(1, 6))):
        source, target = draw(st.sampled_from(time_points)), draw(st.sampled_from(time_points))
        lower = bound() if draw(st.booleans()) else None
        upper = bound() if draw(st.booleans()) else None
        if draw(st.integers(0, 3)) == 0:
            lower = upper = bound()
        if source != target:
            constraints.append(TemporalConstraint(source, target, lower, upper))
    literals = (TimedLiteral(Fraction(2), P, True),) if draw(st.integers(0, 4)) == 0 else ()
    parameters = []
    ranges: dict[str, Range] = {}
    for name in names:
        middle, half = draw(small), draw(st.sampled_from([Fraction(0), Fraction(1, 2), Fraction(2)]))
        declared = draw(
            st.sampled_from([(None, None), (None, None), (Fraction(-1), None), (Fraction(-2), Fraction(4))])
        )
        parameters.append(Parameter(name, middle, lower=declared[0], upper=declared[1]))
        low: Fraction | None = middle - half
        high: Fraction | None = middle + half
        if draw(st.integers(0, 6)) == 0:
            low, high = draw(st.sampled_from([(None, high), (low, None), (None, None)]))
        ranges[name] = (low, high)
    plan = plan_of(*instances, constraints=tuple(constraints), literals=literals, parameters=tuple(parameters))
    return plan, ranges


def has_schedule(plan: ParametrizedPlan, values: dict[str, Fraction]) -> bool:
    """Bellman–Ford over upper bounds `t_b − t_a ≤ w`."""
    at = {ParameterReference(name): value for name, value in values.items()}
    for parameter in plan.parameters:
        value = values[parameter.name]
        if (parameter.lower is not None and value < parameter.lower) or (
            parameter.upper is not None and value > parameter.upper
        ):
            return False
    edges = [(point, ZERO, Fraction(0)) for point in plan.time_points]
    for literal in plan.timed_literals:
        edges += [(ZERO, literal.point, literal.time), (literal.point, ZERO, -literal.time)]
    for item in plan.constraints:
        if item.upper is not None:
            edges.append((item.source, item.target, item.upper.evaluate(at)))
        if item.lower is not None:
            edges.append((item.target, item.source, -item.lower.evaluate(at)))
    distance = dict.fromkeys(plan.time_points, Fraction(0))
    for _ in plan.time_points:
        changed = False
        for source, target, weight in edges:
            if distance[source] + weight < distance[target]:
                distance[target] = distance[source] + weight
                changed = True
        if not changed:
            return True
    return False


def keeps_rules(plan: ParametrizedPlan, values: dict[str, Fraction], name: str) -> bool:
    """Whether some schedule of the network keeps the one duration obligation of that name."""
    extra = []
    for instance in plan.instances:
        if name == f"{instance.identifier} {instance.action}: non-negative duration":
            extra.append(TemporalConstraint(instance.start, instance.end, number(0), None))
        for rule in instance.durations:
            if instance.label(rule) == name:
                factor = rule.condition.expression.terms[(next(iter(DURATION.variables)),)]
                limit = DURATION - rule.condition.expression.scaled(1 / factor)
                exact = rule.condition.relation is Relation.EQUAL
                extra.append(
                    TemporalConstraint(
                        instance.start,
                        instance.end,
                        limit if factor > 0 or exact else None,
                        limit if factor < 0 or exact else None,
                    )
                )
    assert extra, f"no such obligation: {name}"
    constraints = (*plan.constraints, *extra)
    return has_schedule(
        plan_of(*plan.instances, constraints=constraints, literals=plan.timed_literals, parameters=plan.parameters),
        values,
    )


def sampled(ranges: dict[str, Range], random: Random, count: int) -> list[dict[str, Fraction]]:
    """Corners (far out where the box is infinite), the middle, and points in between."""
    ends = {name: _ends(*pair) for name, pair in ranges.items()}
    corners = [dict(zip(ends, corner, strict=True)) for corner in product(*ends.values())]
    middle = {name: (low + high) / 2 for name, (low, high) in ends.items()}
    inside = [
        {name: low + (high - low) * Fraction(random.randint(0, 16), 16) for name, (low, high) in ends.items()}
        for _ in range(count)
    ]
    return [*corners, middle, *inside]


def _ends(low: Fraction | None, high: Fraction | None) -> tuple[Fraction, Fraction]:
    low = low if low is not None else (high if high is not None else Fraction(0)) - FAR
    return low, high if high is not None else low + 2 * FAR


def value_at(facet: Facet, values: dict[str, Fraction]) -> Fraction:
    return facet.expression.evaluate({ParameterReference(name): value for name, value in values.items()})


def judge(plan: ParametrizedPlan, ranges: dict[str, Range], random: Random, solver: str) -> str:
    encoding = RelationalEncoding(plan)
    sessions = []

    def make_session() -> Session:
        sessions.append(Session(encoding.terms, solver=solver))
        return sessions[-1]

    facet = encoding.validity.broken_facet(ranges, make_session, Deadline())
    inside = sampled(ranges, random, 8)
    if facet is None:
        for values in inside:
            assert has_schedule(plan, values), values
            for instance in plan.instances:
                if instance.durative:
                    # What None also claims: parameters alone do not force a negative duration.
                    name = f"{instance.identifier} {instance.action}: non-negative duration"
                    end = encoding.network.position(instance.end) - encoding.network.position(instance.start)
                    if all(isinstance(unknown, ParameterReference) for unknown in end.variables):
                        assert keeps_rules(plan, values, name)
        return "none, by solver" if sessions else "none"
    assert isinstance(facet, Facet)
    assert all(isinstance(unknown, ParameterReference) for unknown in facet.expression.variables)
    assert facet.origins
    assert facet.breaks_in(ranges)
    elsewhere = sampled({name: (Fraction(-6), Fraction(6)) for name in ranges}, random, 20)
    broken = 0
    for values in [*inside, *elsewhere]:
        if value_at(facet, values) < 0:
            broken += 1
            if facet.obligation is None:
                assert not has_schedule(plan, values), (facet, values)
            else:
                assert not keeps_rules(plan, values, facet.obligation), (facet, values)
    assert broken, "some sampled corner of the box lies outside the facet"
    if any(low is None or high is None for low, high in ranges.values()):
        return "facet of an infinite box"
    return ("facet" if facet.obligation is None else "obligation") + (", by solver" if sessions else "")


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_broken_facets_are_right(solver) -> None:
    outcomes: Counter[str] = Counter()

    @settings(max_examples=250 if solver == "z3" else 80, deadline=None, derandomize=True)
    @given(networks(), st.randoms(use_true_random=True))
    def run(drawn, random) -> None:
        outcomes[judge(*drawn, random, solver)] += 1

    run()
    assert outcomes["none"] >= 5, outcomes
    assert outcomes["facet"] >= 5, outcomes
    assert outcomes["obligation"] + outcomes["facet of an infinite box"] >= 5, outcomes


@pytest.mark.slow
@settings(max_examples=20_000, deadline=None)
@given(networks(), st.randoms(use_true_random=True))
def test_many_broken_facets_are_right(drawn, random) -> None:
    judge(*drawn, random, "z3")


@settings(max_examples=40, deadline=None, derandomize=True)
@given(networks(), st.lists(st.fractions(-4, 4, max_denominator=2), min_size=6, max_size=6), st.randoms())
def test_what_was_asked_before_changes_no_answer(drawn, ends, random) -> None:
    plan, ranges = drawn
    others = {name: tuple(sorted(ends[2 * i : 2 * i + 2])) for i, name in enumerate(ranges)}
    encoding = RelationalEncoding(plan)

    def ask(encoding: RelationalEncoding, box: dict[str, Range]) -> bool:
        return encoding.validity.broken_facet(box, lambda: Session(encoding.terms), Deadline()) is None

    ask(encoding, others)
    answers = [ask(encoding, box) for box in (ranges, others, ranges)]
    assert answers == [ask(RelationalEncoding(plan), box) for box in (ranges, others, ranges)]


def worst_at_different_points() -> tuple[ParametrizedPlan, RelationalEncoding]:
    """A cycle through k on both sides: its edges are at their worst at different ends, the sum is never positive.

    i starts between 2 and 3, and starts j after k as j starts k + 1 after i at most.
    """
    k = reference("k")
    i, j = instant("i"), instant("j")
    constraints = (
        TemporalConstraint(ZERO, i.start, number(2), number(3)),
        TemporalConstraint(i.start, j.start, k, None),
        TemporalConstraint(i.start, j.start, None, k + 1),
    )
    plan = plan_of(i, j, constraints=constraints, parameters=(Parameter("k", Fraction(1)),))
    return plan, RelationalEncoding(plan)


def test_edges_at_their_worst_at_different_points_of_the_box() -> None:
    _, encoding = worst_at_different_points()

    def ask(low: int | None, high: int | None) -> object:
        box = {"k": (None if low is None else Fraction(low), None if high is None else Fraction(high))}
        return encoding.validity.broken_facet(box, lambda: Session(encoding.terms), Deadline())

    assert ask(-4, 1000) is None
    assert ask(-4, None) is None
    broken = ask(-5, 1000)
    assert isinstance(broken, Facet)
    assert value_at(broken, {"k": Fraction(-4)}) == 0
    assert isinstance(ask(None, 0), Facet)


def test_out_of_time_is_unknown_and_spoils_nothing() -> None:
    _, encoding = worst_at_different_points()
    box = {"k": (Fraction(-4), Fraction(1000))}
    answers = [
        encoding.validity.broken_facet(box, lambda: Session(encoding.terms), Deadline.after(seconds))
        for seconds in (0, None)
    ]
    assert answers[0] in {None, Verdict.UNKNOWN}
    assert answers[1] is None


def test_a_plan_without_parameters_has_facets_without_variables() -> None:
    i = instant("i")
    plan = plan_of(i, constraints=(TemporalConstraint(ZERO, i.start, number(3), number(2)),))
    encoding = RelationalEncoding(plan)
    facet = encoding.validity.broken_facet({}, lambda: Session(encoding.terms), Deadline())
    assert isinstance(facet, Facet)
    assert facet.expression.is_constant
    assert facet.expression.constant_term == -1


def test_the_statements_that_contradict_each_other_at_a_point() -> None:
    i = instant("i")
    k = Polynomial.variable(ParameterReference("k"))
    constraints = (TemporalConstraint(ZERO, i.start, k, None), TemporalConstraint(ZERO, i.start, None, number(3)))
    plan = plan_of(i, constraints=constraints, parameters=(Parameter("k", Fraction(1), upper=Fraction(9)),))
    validity = RelationalEncoding(plan).validity
    assert validity.contradiction({"k": Fraction(3)}) is None
    facet = validity.contradiction({"k": Fraction(5)})
    assert facet is not None
    assert len(facet.origins) == 2
    assert value_at(facet, {"k": Fraction(5)}) == -2
    beyond = validity.contradiction({"k": Fraction(10)})
    assert beyond is not None
    assert len(beyond.origins) == 1
