"""The relational encoding against the concrete simulator, on drawn plans and sampled schedules."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.api import check
from robust.encode.encoding import RelationalEncoding, Stage
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer, CheckResult
from robust.plan.model import (
    ZERO,
    And,
    Assignment,
    AtomEffect,
    Comparison,
    Holds,
    NumericEffect,
    Or,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedLiteral,
    TimePoint,
)
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Interval
from tests.plan.building import ALL, END, START, TRUE, F, G, P, action, flow, number, plan_of, value
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

RANDOM = st.randoms(use_true_random=True)
Schedule = Mapping[TimePoint, Fraction]


def drawn(examples: int) -> settings:
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )


@st.composite
def loosened(draw, **options) -> ParametrizedPlan:
    """A plan that lost some of its temporal constraints, so that more time points are unordered."""
    plan = draw(plans(linear=True, **options))
    kept = tuple(item for item in plan.constraints if draw(st.integers(0, 2)))
    return replace(plan, constraints=kept)


@st.composite
def tangled(draw) -> ParametrizedPlan:
    """Unordered actions whose effects read what the others write: who comes first decides what a fluent is."""
    k = Polynomial.variable(ParameterReference("k"))
    leaf = st.builds(
        lambda left, right, constant, relation: Comparison(left - right + number(constant), relation),
        st.sampled_from([value(F), value(G)]),
        st.sampled_from([value(F), value(G), k, number(0)]),
        st.integers(-2, 2),
        st.sampled_from(Relation),
    )
    condition = st.one_of(
        leaf,
        st.sampled_from([Holds(P), Holds(P, False)]),
        st.builds(lambda a, b: Or((a, b)), leaf, leaf),
        st.builds(lambda a, b: And((a, b)), leaf, leaf),
    )
    amount = st.builds(
        lambda fluent, factor, constant: fluent.scaled(factor) + constant,
        st.sampled_from([value(F), value(G), k]),
        st.sampled_from([Fraction(1), Fraction(-1), Fraction(1, 2), Fraction(0)]),
        st.integers(-1, 2),
    )
    when = st.one_of(st.just(TRUE), st.just(TRUE), condition)
    timing = st.sampled_from([START, END])
    numeric = st.builds(NumericEffect, timing, st.sampled_from([F, G]), st.sampled_from(Assignment), amount, when)
    atoms = st.builds(AtomEffect, timing, st.just(P), st.booleans(), when)
    flows = st.builds(flow, st.sampled_from([F, G]), st.sampled_from([-1, 1, 2]))
    condition_of = st.tuples(st.sampled_from([START, END, ALL]), condition)
    instances = []
    for index in range(draw(st.integers(2, 3))):
        pieces = [draw(numeric), *draw(st.lists(st.one_of(numeric, atoms, flows, condition_of), max_size=2))]
        instances.append(action(f"i{index}", *pieces))
    constraints = []
    for instance in instances:
        length = number(draw(st.integers(1, 2)))
        constraints.append(
            TemporalConstraint(instance.start, instance.end, length, draw(st.sampled_from([length, k + 2])))
        )
        constraints.append(TemporalConstraint(ZERO, instance.start, number(draw(st.integers(0, 2))), number(3)))
    if draw(st.booleans()):
        constraints.append(TemporalConstraint(instances[0].end, instances[1].start, number(1), None))
    literals = (TimedLiteral(Fraction(2), F, Fraction(1)),) if draw(st.integers(0, 3)) == 0 else ()
    return plan_of(
        *instances,
        atoms=(P,),
        f=draw(st.sampled_from([0, 1, k])),
        g=draw(st.integers(-1, 1)),
        goal=draw(condition),
        literals=literals,
        constraints=tuple(constraints),
        parameters=(Parameter("k", Fraction(1), lower=Fraction(0)),),
    )


KINDS = {
    "anything linear": plans(linear=True),
    "mostly valid": plans(linear=True, tame=True),
    "mostly broken": plans(linear=True, tame=False, atoms=1),
    "continuous": plans(linear=True, tame=True, instances=3, durative_only=True, atoms=1, fluents=1),
    "loosened": loosened(tame=True, instances=3),
    "tangled": tangled(),
}


def compare(
    plan: ParametrizedPlan, at: dict[str, Fraction], random: Random, solver: str, count: int = 8
) -> Counter[object]:
    """Compare both forms of `check` at one parameter point with simulations; what came out, for statistics."""
    network = Network(plan, at)
    try:
        stopped, full = (check(plan, at=at, every=every, solver=solver) for every in (False, True))
    except InputError as error:
        if network.consistent:
            raise AssertionError("there is a schedule") from error
        return Counter(["no schedule anywhere"])
    assert stopped.answer is full.answer
    if not network.consistent:
        assert full.answer is Answer.REFUTED
        assert not full.counterexamples
        assert full.reason
        return Counter(["no schedule here"])
    assert full.reason is None
    _compare_schedules(plan, at, sample_schedules(plan, at, random, count), full)
    _confirm_counterexamples(plan, at, full)
    _confirm_counterexamples(plan, at, stopped)
    assert len(stopped.counterexamples) == (stopped.answer is Answer.REFUTED)
    return Counter([full.answer, *(f"{answer.value} obligation" for answer in full.obligations.values())])


def _compare_schedules(
    plan: ParametrizedPlan, at: dict[str, Fraction], schedules: list[dict[TimePoint, Fraction]], result: CheckResult
) -> None:
    stage = {obligation.name: obligation.stage for obligation in RelationalEncoding(plan).obligations}
    assert result.answer in {Answer.PROVED, Answer.REFUTED}
    assert set(result.obligations) == set(stage)
    for schedule in schedules:
        simulation = simulate(plan, at, schedule)
        assert simulation.network_violations == ()
        broken = {violation.obligation for violation in simulation.violations}
        assert broken <= set(stage), "the encoding lacks an obligation"
        earliest = min((stage[name].value for name in broken), default=Stage.CONDITION.value)
        for name in broken:
            # Later stages are judged over the schedules that respect the earlier ones.
            if stage[name].value == earliest:
                assert result.obligations[name] is Answer.REFUTED, (name, schedule)


def _confirm_counterexamples(plan: ParametrizedPlan, at: dict[str, Fraction], result: CheckResult) -> None:
    refuted = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
    assert set(result.counterexamples) == refuted
    assert (result.answer is Answer.REFUTED) == bool(refuted)
    for name, example in result.counterexamples.items():
        simulation = simulate(plan, example.parameters, example.schedule)
        assert example.parameters == at
        assert simulation.network_violations == ()
        assert name in {violation.obligation for violation in simulation.violations}


def points(plan: ParametrizedPlan, random: Random) -> list[dict[str, Fraction]]:
    sampled = sample_parameters(plan, random)
    return [plan.nominal] if sampled == plan.nominal else [plan.nominal, sampled]


@pytest.mark.parametrize(("kind", "solver"), [*((kind, "z3") for kind in KINDS), ("anything linear", "cvc5")])
def test_check_agrees_with_simulations(kind, solver) -> None:
    outcomes: Counter[object] = Counter()

    @drawn(25 if solver == "z3" else 10)
    @given(KINDS[kind], RANDOM)
    def run(plan, random) -> None:
        for at in points(plan, random):
            outcomes.update(compare(plan, at, random, solver))

    run()
    assert outcomes["refuted obligation"] >= 5, outcomes
    assert outcomes["proved obligation"] >= 5, outcomes


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize("kind", KINDS)
def test_check_agrees_with_many_simulations(kind, solver) -> None:
    @settings(drawn(1500), derandomize=False)
    @given(KINDS[kind], RANDOM)
    def run(plan, random) -> None:
        for at in points(plan, random):
            compare(plan, at, random, solver, count=20)

    run()


def test_products_are_decided_or_refused() -> None:
    outcomes: Counter[object] = Counter()

    @drawn(30)
    @given(plans(linear=False), RANDOM)
    def run(plan, random) -> None:
        try:
            outcomes.update(compare(plan, plan.nominal, random, "z3"))
        except UnsupportedError:
            outcomes["unsupported"] += 1

    run()
    assert outcomes[Answer.PROVED] + outcomes[Answer.REFUTED] >= 10, outcomes
    assert outcomes["unsupported"] >= 1, outcomes


def test_solvers_and_verdicts_of_every_obligation_agree() -> None:
    verdicts: Counter[Answer] = Counter()

    @drawn(12)
    @given(plans(linear=True, instances=3, infeasible=False))
    def run(plan) -> None:
        try:
            z3, cvc5 = (check(plan, every=True, solver=solver) for solver in ("z3", "cvc5"))
        except InputError:
            return
        assert z3.obligations == cvc5.obligations
        verdicts.update(z3.obligations.values())

    run()
    assert verdicts[Answer.PROVED] >= 10
    assert verdicts[Answer.REFUTED] >= 2


@drawn(15)
@given(plans(linear=True), RANDOM)
def test_a_box_is_proved_only_if_its_points_are(plan, random) -> None:
    a, b = sample_parameters(plan, random), sample_parameters(plan, random)
    ends = {name: (min(a[name], b[name]), max(a[name], b[name])) for name in a}
    try:
        answer = check(plan, at={name: Interval(*pair) for name, pair in ends.items()}).answer
        inside = [{name: random.choice([*pair, sum(pair) / 2]) for name, pair in ends.items()} for _ in range(3)]
        answers = [check(plan, at=point).answer for point in inside]
    except InputError:
        return
    if answer is Answer.PROVED:
        assert set(answers) <= {Answer.PROVED}
    if Answer.REFUTED in answers:
        assert answer is Answer.REFUTED
