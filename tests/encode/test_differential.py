"""Both encodings against the concrete simulator, on drawn plans and sampled schedules, and against each other."""

import json
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust import Answer, CheckResult, InputError, Interval, Status, UnsupportedError, check, envelope
from robust.backends import ENCODINGS
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import Stage
from robust.encode.positions import PositionsEncoding
from robust.plan import model
from robust.plan.model import ZERO, Holds, NumericCondition, ParametrizedPlan
from robust.plan.simulate import simulate
from robust.reading import load_plan
from robust.smt.session import Satisfiability
from tests.encode.asking import Point, both, difference, first_broken, refuted, where_broken
from tests.plan import building
from tests.plan.building import ALL, END, RANDOM, START, TRUE, F, G, P, action, between, drawn, flow, pinned, value
from tests.sampling import Network, sample_parameters, sample_schedules
from tests.strategies import plans

SLOW = pytest.mark.slow


@st.composite
def loosened(draw, **options) -> ParametrizedPlan:
    """A plan that lost some of its temporal constraints, so that more time points are unordered."""
    plan = draw(plans(linear=True, **options))
    return replace(plan, constraints=tuple(item for item in plan.constraints if draw(st.integers(0, 2))))


@st.composite
def tangled(draw) -> ParametrizedPlan:
    """Unordered actions whose effects read what the others write: who comes first decides what a fluent is."""
    k = building.reference("k")
    fluents, numbers = st.sampled_from([F, G]), st.sampled_from([value(F), value(G), k])
    left, right = st.sampled_from([value(F), value(G)]), numbers | st.just(building.number(0))
    sums = st.builds(lambda left, right, constant: left - right + constant, left, right, st.integers(-2, 2))
    leaf = st.builds(NumericCondition, sums, st.sampled_from(model.Relation))
    pairs = st.tuples(leaf, leaf)
    condition = leaf | st.sampled_from([Holds(P), Holds(P, False)]) | pairs.map(model.Or) | pairs.map(model.And)
    factors = st.sampled_from([Fraction(1), Fraction(-1), Fraction(1, 2), Fraction(0)])
    amount = st.builds(lambda number, factor, add: number.scaled(factor) + add, numbers, factors, st.integers(-1, 2))
    when, timing = st.one_of(st.just(TRUE), st.just(TRUE), condition), st.sampled_from([START, END])
    numeric = st.builds(model.NumericEffect, timing, fluents, st.sampled_from(model.AssignmentKind), amount, when)
    atoms = st.builds(model.AtomEffect, timing, st.just(P), st.booleans(), when)
    flows = st.builds(flow, fluents, st.sampled_from([-1, 1, 2]))
    conditions = st.tuples(st.sampled_from([START, END, ALL]), condition)
    instances, constraints = [], []
    for index in range(draw(st.integers(2, 3))):
        pieces = [draw(numeric), *draw(st.lists(st.one_of(numeric, atoms, flows, conditions), max_size=2))]
        instance, length = action(f"i{index}", *pieces), draw(st.integers(1, 2))
        instances.append(instance)
        constraints.append(between(instance.start, instance.end, length, draw(st.sampled_from([length, k + 2]))))
        constraints.append(between(ZERO, instance.start, draw(st.integers(0, 2)), 3))
    if draw(st.booleans()):
        constraints.append(between(instances[0].end, instances[1].start, 1))
    said = {"parameters": (model.Parameter("k", Fraction(1), lower=Fraction(0)),), "constraints": tuple(constraints)}
    said["literals"] = (model.TimedLiteral(Fraction(2), F, Fraction(1)),) if draw(st.integers(0, 3)) == 0 else ()
    f, g = draw(st.sampled_from([0, 1, k])), draw(st.integers(-1, 1))
    return building.plan_of(*instances, atoms=(P,), f=f, g=g, goal=draw(condition), **said)


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
    except UnsupportedError:
        return Counter(["unsupported"])
    except InputError:
        return Counter([("there is a schedule" if network.consistent else "no schedule anywhere")])
    assert stopped.answer is full.answer
    if not network.consistent:
        assert (full.answer, full.counterexamples) == (Answer.REFUTED, {})
        assert full.reason
        return Counter(["no schedule here"])
    assert full.reason is None
    fixed = model.at_values(plan, at)
    names = (obligation.name for obligation in RelationalEncoding(fixed).obligations)
    assert list(full.obligations) == list(dict.fromkeys(names)), "goals that are drawn may say a thing twice"
    for schedule in sample_schedules(plan, at, random, 8):
        labels = breaks(plan, at, schedule)
        assert labels <= set(full.obligations), "the encoding lacks an obligation"
        assert all(full.obligations[name] is Answer.REFUTED for name in first_broken(fixed, labels)), schedule
    for result in (full, stopped):
        assert result.answer in {Answer.PROVED, Answer.REFUTED}
        labels = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
        assert set(result.counterexamples) == labels
        assert (result.answer is Answer.REFUTED) == bool(labels)
        for name, example in result.counterexamples.items():
            assert example.parameters == at
            assert name in breaks(plan, at, example.schedule)
    assert len(stopped.counterexamples) == (stopped.answer is Answer.REFUTED)
    return Counter([full.answer, *(f"{answer.value} obligation" for answer in full.obligations.values())])


def breaks(plan, at, schedule):
    """The obligations that a schedule of the network breaks, as the simulator says."""
    simulation = simulate(plan, at, schedule)
    assert simulation.network_violations == ()
    return {violation.obligation for violation in simulation.violations}


@pytest.mark.parametrize(
    ("kind", "solver", "count"),
    [
        *((kind, "z3", 20 if kind == "products" else 10) for kind in KINDS),
        ("anything linear", "cvc5", 5),
        *(pytest.param(*pair, 1500, marks=SLOW) for pair in product(KINDS, ("z3", "cvc5"))),
    ],
)
def test_check_agrees_with_simulations(kind, solver, count) -> None:
    outcomes: Counter[object] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(KINDS[kind], RANDOM)
    def run(plan, random) -> None:
        sampled = sample_parameters(plan, random)
        for at in [plan.nominal] if sampled == plan.nominal else [plan.nominal, sampled]:
            outcomes.update(compare(plan, at, random, solver))

    run()
    assert outcomes["refuted obligation"] >= 2, outcomes
    assert outcomes["proved obligation"] >= 5, outcomes
    assert outcomes["unsupported"] == 0 or kind == "products", outcomes
    assert "there is a schedule" not in outcomes


@pytest.mark.parametrize("count", [30, pytest.param(4000, marks=SLOW)])
def test_fixed_schedules_break_exactly_what_the_simulator_says(count) -> None:
    outcomes: Counter[bool] = Counter()

    @settings(drawn(count), derandomize=count < 100)
    @given(plans(linear=True, infeasible=False), RANDOM)
    def run(plan, random) -> None:
        at = sample_parameters(plan, random)
        for schedule in sample_schedules(plan, at, random, 1):
            fixed = random.choice([pinned, building.windows])(plan, schedule)
            labels = breaks(plan, at, schedule)
            assert set(refuted(check(fixed, at=at, every=True))) == set(first_broken(fixed, labels)), schedule
            outcomes[bool(labels)] += 1

    run()
    assert outcomes[False] >= 3, outcomes
    assert outcomes[True] >= 6, outcomes


@drawn(5, 100)
@given(plans(linear=True), RANDOM)
def test_a_box_is_proved_only_if_its_points_are(plan, random) -> None:
    a, b = sample_parameters(plan, random), sample_parameters(plan, random)
    ends = {name: sorted((a[name], b[name])) for name in a}
    with suppress(InputError):
        answer = check(plan, at={name: Interval(*pair) for name, pair in ends.items()}).answer
        inside = [{name: random.choice([*pair, sum(pair) / 2]) for name, pair in ends.items()} for _ in range(3)]
        answers = {check(plan, at=point).answer for point in inside}
        assert answer is not Answer.PROVED or answers == {Answer.PROVED}
        assert answer is Answer.REFUTED or Answer.REFUTED not in answers


EPSILON = Fraction(1, 8)
CONTINUOUS = {"linear": True, "instances": 3, "atoms": 1, "fluents": 1, "durative_only": True}
LINEAR, UNTAMED = {"linear": True}, {"linear": True, "tame": False, "atoms": 1}
LARGE = {"instances": 6, "linear": True, "tame": True}


def counts(*quick, slow=200, later) -> pytest.MarkDecorator:
    """How many plans to draw with which options, now and in the long run."""
    cases = [*quick, *(pytest.param(slow, options, marks=SLOW) for options in later)]
    return pytest.mark.parametrize(("count", "options"), cases)


@counts((10, LINEAR), (10, CONTINUOUS), later=(LINEAR, CONTINUOUS, {}, LARGE))
def test_positions_agree_with_the_simulator(count: int, options: dict[str, bool | int]) -> None:
    """Every obligation that a schedule reaches, having respected the earlier stages; until something is unsupported."""
    agreed: Counter[bool] = Counter()

    @drawn(count)
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        with suppress(UnsupportedError):
            encoding = PositionsEncoding(plan, EPSILON)
            early = {o.name for o in encoding.obligations if o.stage is not Stage.CONDITION}
            violations: list[tuple[Point, set[str]]] = []
            for values in (plan.nominal, sample_parameters(plan, random)):
                for schedule in sample_schedules(plan, values, random, 3, epsilon=EPSILON):
                    simulation = simulate(plan, values, schedule, epsilon=EPSILON)
                    labels = {violation.obligation for violation in simulation.violations}
                    if not labels & early:
                        violations.append(((values, schedule), labels))
            for obligation in encoding.obligations:
                answers = where_broken(encoding, obligation, [point for point, _ in violations])
                assert answers == [obligation.name in labels for _, labels in violations], obligation.name
                agreed.update(answers)

    run()
    assert agreed[True] or options == CONTINUOUS
    assert agreed[False] > 2 * count


@counts((5, {}), (8, LINEAR), (5, UNTAMED), later=({}, LINEAR, {**LINEAR, "instances": 5}, LARGE))
def test_same_verdicts(count: int, options: dict[str, bool | int]) -> None:
    answers: Counter[Answer] = Counter()

    @drawn(count)
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        for at in (plan.nominal, sample_parameters(plan, random)):
            relational, positions = (verdict(plan, encoding, at) for encoding in ENCODINGS)
            if UnsupportedError not in (relational, positions):
                assert getattr(relational, "answer", relational) is getattr(positions, "answer", positions)
        same_obligations(plan, answers)

    run()
    assert answers[Answer.PROVED] > 0.6 * count or options != LINEAR
    assert answers[Answer.REFUTED] > 0.2 * count or options != UNTAMED


def verdict(plan, encoding, at, every=False):
    """The result, with every counterexample confirmed by the simulator, or the kind of error."""
    try:
        return check(plan, encoding=encoding, at=at, every=every)
    except (InputError, UnsupportedError) as error:
        return type(error)


def same_obligations(plan: ParametrizedPlan, answers: Counter[Answer]) -> None:
    """The relational encoding assumes less of the earlier stages: where one of them breaks it may refute more."""
    relational, positions = (verdict(plan, name, {}, every=True) for name in ENCODINGS)
    if not (isinstance(relational, CheckResult) and isinstance(positions, CheckResult)):
        return
    if relational.reason or positions.reason:
        return
    assert check(plan, every=True, solver="cvc5").obligations == relational.obligations
    stages = {o.name: o.stage for o in both(plan)[1].obligations}
    assert list(relational.obligations) == list(positions.obligations) == list(stages)
    early = any(stages[name] is not Stage.CONDITION for name in refuted(relational))
    for name, answer in relational.obligations.items():
        if not early or answer is not Answer.REFUTED or stages[name] is Stage.DURATION:
            assert answer is positions.obligations[name], name
            answers[answer] += 1


@counts((8, {}), slow=150, later=({}, {"tame": True}))
def test_same_envelopes(count: int, options: dict[str, bool]) -> None:
    """Equivalence for all parameter values, by quantifiers, unless the solver gives up."""
    answers: Counter[Satisfiability] = Counter()

    @drawn(count)
    @given(plan=plans(linear=True, instances=2, atoms=2, fluents=1, parameters=2, **options))
    def run(plan: ParametrizedPlan) -> None:
        with suppress(UnsupportedError):
            relational, positions = both(plan)
            pair = {difference(relational, positions), difference(positions, relational)}
            assert Satisfiability.SATISFIABLE not in pair
            answers[min(pair, key=lambda answer: answer is Satisfiability.UNSATISFIABLE)] += 1

    run()
    assert answers[Satisfiability.UNSATISFIABLE] > 5


QUICK = [f"solar_rover_0{name}" for name in ("1_1", "1_4", "2_1", "3_1")]
QUICK += [*(f"auv_mission_10_0_{n}" for n in range(3)), "generator_linear_05_1", "generator_linear_05_2"]
LATER = [f"solar_rover_0{name}" for name in ["1_2", "1_3", "2_2", "2_3", "2_4", "3_2", "3_3", "3_4"]]
LATER += [
    *(f"auv_mission_10_0_{n}" for n in (3, 4, 5)),
    *(f"generator_linear_{n}" for n in ["06_1", "06_2", "07_1", "07_2"]),
]


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=SLOW) for name in LATER)])
def test_reproduces_recorded_boxes(dataset: Path, name: str) -> None:
    """Those of the original runs; the relational encoding finds all of them in tests/benchmarks/test_recorded.py."""
    records = json.loads((dataset / "recorded-results.json").read_text())
    (record,) = (record for record in records if record["instance"] == name)
    plan = load_plan(dataset / record["domain"], dataset / record["problem"], dataset / record["plan"])
    positions = envelope(plan, method="irr", doubling=True, order=record["irr_order"], encoding="positions")
    ends = {name: [str(end) for end in ends] for name, ends in positions.box.ranges.items()}
    recorded = (Status.COMPLETE, record["irr_box"], record["irr"]["checks"])
    assert (positions.status, ends, positions.checks) == recorded
