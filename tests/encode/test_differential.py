"""Both encodings against the concrete simulator, on drawn plans and sampled schedules, and against each other."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.api import check, envelope
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import Stage
from robust.encode.positions.encoding import PositionsEncoding
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer, CheckResult
from robust.plan import model
from robust.plan.load import load_plan
from robust.plan.model import (
    ZERO,
    And,
    AssignmentKind,
    AtomEffect,
    Holds,
    NumericCondition,
    NumericEffect,
    Or,
    ParametrizedPlan,
)
from robust.plan.simulate import simulate
from robust.qe.box import Interval
from robust.searching import Status
from robust.smt.session import Satisfiability
from tests.encode.asking import both, difference, first_broken, is_broken
from tests.plan import building
from tests.plan.building import ALL, END, RANDOM, START, TRUE, F, G, P, action, between, drawn, flow, number, value
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

# -- the relational encoding -----------------------------------------------------------------------------------------


@st.composite
def loosened(draw, **options) -> ParametrizedPlan:
    """A plan that lost some of its temporal constraints, so that more time points are unordered."""
    plan = draw(plans(linear=True, **options))
    kept = tuple(item for item in plan.constraints if draw(st.integers(0, 2)))
    return replace(plan, constraints=kept)


@st.composite
def tangled(draw) -> ParametrizedPlan:
    """Unordered actions whose effects read what the others write: who comes first decides what a fluent is."""
    k = building.reference("k")
    leaf = st.builds(
        lambda left, right, constant, relation: NumericCondition(left - right + number(constant), relation),
        st.sampled_from([value(F), value(G)]),
        st.sampled_from([value(F), value(G), k, number(0)]),
        st.integers(-2, 2),
        st.sampled_from(model.Relation),
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
    numeric = st.builds(NumericEffect, timing, st.sampled_from([F, G]), st.sampled_from(AssignmentKind), amount, when)
    atoms = st.builds(AtomEffect, timing, st.just(P), st.booleans(), when)
    flows = st.builds(flow, st.sampled_from([F, G]), st.sampled_from([-1, 1, 2]))
    condition_of = st.tuples(st.sampled_from([START, END, ALL]), condition)
    instances = []
    for index in range(draw(st.integers(2, 3))):
        pieces = [draw(numeric), *draw(st.lists(st.one_of(numeric, atoms, flows, condition_of), max_size=2))]
        instances.append(action(f"i{index}", *pieces))
    constraints = []
    for instance in instances:
        length = draw(st.integers(1, 2))
        constraints.append(between(instance.start, instance.end, length, draw(st.sampled_from([length, k + 2]))))
        constraints.append(between(ZERO, instance.start, draw(st.integers(0, 2)), 3))
    if draw(st.booleans()):
        constraints.append(between(instances[0].end, instances[1].start, 1))
    literals = (model.TimedLiteral(Fraction(2), F, Fraction(1)),) if draw(st.integers(0, 3)) == 0 else ()
    return building.plan_of(
        *instances,
        atoms=(P,),
        f=draw(st.sampled_from([0, 1, k])),
        g=draw(st.integers(-1, 1)),
        goal=draw(condition),
        literals=literals,
        constraints=tuple(constraints),
        parameters=(model.Parameter("k", Fraction(1), lower=Fraction(0)),),
    )


KINDS = {
    "anything linear": plans(linear=True),
    "products": plans(linear=False),
    "mostly valid": plans(linear=True, tame=True),
    "mostly broken": plans(linear=True, tame=False, atoms=1),
    "continuous": plans(linear=True, tame=True, instances=3, durative_only=True, atoms=1, fluents=1),
    "loosened": loosened(tame=True, instances=3),
    "tangled": tangled(),
}


def compare(plan: ParametrizedPlan, at: dict[str, Fraction], random: Random, solver: str) -> Counter[object]:
    """Compare both forms of `check` at one parameter point with simulations; what came out, for statistics."""
    network = Network(plan, at)
    try:
        stopped, full = (check(plan, at=at, every=every, solver=solver) for every in (False, True))
    except InputError as error:
        if network.consistent:
            raise AssertionError("there is a schedule") from error
        return Counter(["no schedule anywhere"])
    except UnsupportedError:
        return Counter(["unsupported"])
    assert stopped.answer is full.answer
    if not network.consistent:
        assert full.answer is Answer.REFUTED
        assert not full.counterexamples
        assert full.reason
        return Counter(["no schedule here"])
    assert full.reason is None
    _compare_schedules(plan, at, sample_schedules(plan, at, random, 8), full)
    _confirm_counterexamples(plan, at, full)
    _confirm_counterexamples(plan, at, stopped)
    assert len(stopped.counterexamples) == (stopped.answer is Answer.REFUTED)
    return Counter([full.answer, *(f"{answer.value} obligation" for answer in full.obligations.values())])


def _compare_schedules(
    plan: ParametrizedPlan,
    at: dict[str, Fraction],
    schedules: list[dict[model.TimePoint, Fraction]],
    result: CheckResult,
) -> None:
    assert result.answer in {Answer.PROVED, Answer.REFUTED}
    names = (obligation.name for obligation in RelationalEncoding(plan).obligations)
    assert list(result.obligations) == list(dict.fromkeys(names)), "goals that are drawn may say a thing twice"
    for schedule in schedules:
        simulation = simulate(plan, at, schedule)
        assert simulation.network_violations == ()
        broken = {violation.obligation for violation in simulation.violations}
        assert broken <= set(result.obligations), "the encoding lacks an obligation"
        for name in first_broken(plan, broken):
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


@pytest.mark.parametrize(
    ("kind", "solver", "count"),
    [
        *((kind, "z3", 15) for kind in KINDS),
        ("anything linear", "cvc5", 10),
        *(pytest.param(*pair, 1500, marks=pytest.mark.slow) for pair in product(KINDS, ("z3", "cvc5"))),
    ],
)
def test_check_agrees_with_simulations(kind, solver, count) -> None:
    outcomes: Counter[object] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(KINDS[kind], RANDOM)
    def run(plan, random) -> None:
        for at in points(plan, random):
            outcomes.update(compare(plan, at, random, solver))

    run()
    assert outcomes["refuted obligation"] >= 5, outcomes
    assert outcomes["proved obligation"] >= 5, outcomes
    assert (outcomes["unsupported"] > 0) == (kind == "products"), outcomes


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


# -- the encoding with positions -------------------------------------------------------------------------------------


EPSILON = Fraction(1, 8)


def compare_obligations(plan: ParametrizedPlan, random: Random, agreed: Counter[bool]) -> None:
    """Every obligation that a schedule reaches, having respected the earlier stages; until something is unsupported."""
    with suppress(UnsupportedError):
        encoding = PositionsEncoding(plan, EPSILON)
        early = {o.name for o in encoding.obligations if o.stage is not Stage.CONDITION}
        for values in (plan.nominal, sample_parameters(plan, random)):
            for schedule in sample_schedules(plan, values, random, 3, epsilon=EPSILON):
                simulation = simulate(plan, values, schedule, epsilon=EPSILON)
                broken = {violation.obligation for violation in simulation.violations}
                for obligation in encoding.obligations if not broken & early else ():
                    answer = is_broken(encoding, obligation, values, schedule)
                    assert answer == (obligation.name in broken), f"{obligation.name} {values} {schedule}"
                    agreed[answer] += 1


OPTIONS = [{"linear": True}, {"linear": True, "instances": 3, "atoms": 1, "fluents": 1, "durative_only": True}]
SLOW = pytest.mark.slow
THOROUGH = [(200, one) for one in (*OPTIONS, {}, {"instances": 6, "linear": True, "tame": True})]


@pytest.mark.parametrize(
    ("count", "options"), [*((25, one) for one in OPTIONS), *(pytest.param(*one, marks=SLOW) for one in THOROUGH)]
)
def test_agrees_with_the_simulator(count: int, options: dict[str, bool | int]) -> None:
    agreed: Counter[bool] = Counter()

    @drawn(count)
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        compare_obligations(plan, random, agreed)

    run()
    assert agreed[True] > 1
    assert agreed[False] > 50


# -- against the other encoding ---------------------------------------------------------------------------------------

VERY_SMALL = {"linear": True, "instances": 2, "atoms": 2, "fluents": 1, "parameters": 2}


def verdict(
    plan: ParametrizedPlan, encoding: str, at: Mapping[str, Fraction], every: bool = False
) -> CheckResult | type[Exception]:
    """The result, with every counterexample confirmed by the simulator, or the kind of error."""
    try:
        return check(plan, encoding=encoding, at=at, every=every)
    except (InputError, UnsupportedError) as error:
        return type(error)


@pytest.mark.parametrize(
    ("count", "options"),
    [
        (15, {}),
        (30, {"linear": True}),
        *(
            pytest.param(200, options, marks=SLOW)
            for options in ({}, {"linear": True}, {"linear": True, "instances": 5}, {"linear": True, "tame": True})
        ),
    ],
)
def test_same_verdicts(count: int, options: dict[str, bool | int]) -> None:
    seen: Counter[Answer] = Counter()

    @drawn(count)
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        same_verdict(plan, random)
        same_obligations(plan, seen)

    run()
    if options == {"linear": True}:
        assert seen[Answer.PROVED] > 20
        assert seen[Answer.REFUTED] > 2


def same_verdict(plan: ParametrizedPlan, random: Random) -> None:
    for at in (plan.nominal, sample_parameters(plan, random)):
        found = [verdict(plan, encoding, at) for encoding in ("relational", "positions")]
        if UnsupportedError not in found:
            one, other = (result.answer if isinstance(result, CheckResult) else result for result in found)
            assert one is other


def same_obligations(plan: ParametrizedPlan, seen: Counter[Answer]) -> None:
    """The relational encoding assumes less of the earlier stages: where one of them breaks it may refute more."""
    one, other = (verdict(plan, name, {}, every=True) for name in ("relational", "positions"))
    if not (isinstance(one, CheckResult) and isinstance(other, CheckResult)) or one.reason or other.reason:
        return
    assert check(plan, every=True, solver="cvc5").obligations == one.obligations
    stages = {o.name: o.stage for o in both(plan)[1].obligations}
    assert list(one.obligations) == list(other.obligations) == list(stages)
    broken = any(one.obligations[name] is Answer.REFUTED for name in stages if stages[name] is not Stage.CONDITION)
    for name, answer in one.obligations.items():
        if broken and answer is Answer.REFUTED and stages[name] is not Stage.DURATION:
            continue
        assert answer is other.obligations[name], name
        seen[answer] += 1


def same_envelope(plan: ParametrizedPlan) -> Satisfiability:
    """Equivalence for all parameter values, by quantifiers; UNKNOWN if the solver gives up."""
    relational, positions = both(plan)
    try:
        answers = [difference(relational, positions), difference(positions, relational)]
    except UnsupportedError:
        return Satisfiability.UNKNOWN
    assert Satisfiability.SATISFIABLE not in answers
    return answers[0] if Satisfiability.UNKNOWN not in answers else Satisfiability.UNKNOWN


@pytest.mark.parametrize(
    ("count", "options"), [(15, {}), *(pytest.param(150, one, marks=SLOW) for one in ({}, {"tame": True}))]
)
def test_same_envelopes(count: int, options: dict[str, bool]) -> None:
    seen: Counter[Satisfiability] = Counter()

    @drawn(count)
    @given(plan=plans(**VERY_SMALL, **options))
    def run(plan: ParametrizedPlan) -> None:
        seen[same_envelope(plan)] += 1

    run()
    assert seen[Satisfiability.UNSATISFIABLE] > 10


# -- boxes of recorded instances: those of the original runs, and of the other encoding -------------------------------

QUICK = [
    *(f"auv_mission_10_0_{n}" for n in range(3)),
    *(f"generator_linear_05_{n}" for n in (1, 2)),
    *("solar_rover_01_1", "solar_rover_01_4", "solar_rover_02_1", "solar_rover_03_1"),
]
LATER = [
    *(f"auv_mission_10_0_{n}" for n in range(3, 6)),
    *(f"generator_linear_0{size}_{n}" for size in (6, 7) for n in (1, 2)),
    *(f"solar_rover_0{size}_{n}" for size in (1, 2, 3) for n in (2, 3, 4) if (size, n) != (1, 4)),
]


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=SLOW) for name in LATER)])
def test_reproduces_recorded_boxes(dataset: Path, name: str) -> None:
    records: list[dict[str, Any]] = json.loads((dataset / "recorded-results.json").read_text())
    record = next(record for record in records if record["instance"] == name)
    plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
    order = record["irr_order"]
    results = [
        envelope(plan, method="irr", doubling=True, order=order, encoding=name) for name in ("relational", "positions")
    ]
    boxes = [{name: (i.lower, i.upper) for name, i in result.box.intervals.items()} for result in results]
    assert [result.status for result in results] == [Status.COMPLETE] * 2
    assert boxes[0] == boxes[1]
    assert results[0].checks == results[1].checks
    if "irr_box" in record:
        assert boxes[1] == {name: (Fraction(low), Fraction(high)) for name, (low, high) in record["irr_box"].items()}
        assert results[1].checks == record["irr"]["checks"]
