"""What plans mean in both encodings, case by case [docs/semantics.md]; over-all conditions where they are delicate."""

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path
from random import Random

import pytest

from robust import Answer, InputError, Status, UnsupportedError, check, envelope, region
from robust.backends import ENCODINGS
from robust.encode import create_encoding
from robust.encode.interface import Stage
from robust.encode.positions import PositionsEncoding
from robust.plan import model
from robust.plan.model import ZERO, AssignmentKind, Holds, NumericEffect, Or, ParametrizedPlan, TimePoint
from robust.plan.simulate import simulate
from robust.probability.risk import METHODS
from robust.smt.limits import Deadline, OutOfTimeError
from tests.children import interrupted_after
from tests.encode.asking import first_broken, refuted
from tests.plan import building
from tests.plan.building import START, F, G, P, action, at, at_least, between, flow, increase, instant, plan_of, value

by_both = pytest.mark.parametrize("encoding", ENCODINGS)
f, Parameter, TimedLiteral = value(F), model.Parameter, model.TimedLiteral
ALL, END, Q, UP = building.ALL, building.END, building.Q, building.UP
USER, FLOWING = instant("u", (START, Holds(P))), action("r", flow(F, 1))
FIXES = (building.pinned, building.windows)
TWO_SIDED = Or((building.STRICT, building.above(-f, 0)))


def broken(plan: ParametrizedPlan, encoding: str, epsilon: Fraction = building.EPSILON, **values: int) -> list[str]:
    values = {name: Fraction(number) for name, number in values.items()}
    return refuted(check(plan, encoding=encoding, every=True, epsilon=epsilon, at=values))


# A rate that is a parameter needs a schedule without time variables.
FIXED = [(n, fix) for n, one in building.EXAMPLES.items() for fix in FIXES if fix is FIXES[0] or not one.parameters]


@by_both
@pytest.mark.parametrize(("name", "fix"), FIXED)
def test_examples(name, fix, encoding) -> None:
    example = building.EXAMPLES[name]
    plan = fix(example.plan, building.schedule_of(example.plan, example.times))
    labels = [one if isinstance(one, str) else one.obligation for one in example.broken]
    assert broken(plan, encoding, **example.parameters) == first_broken(plan, labels)


@by_both
def test_obligations_have_names_and_an_order(encoding) -> None:
    plan = plan_of(action("a", (START, Holds(P)), (ALL, Holds(P)), building.add(Q)), atoms=(P,), goal=Holds(Q))
    names = ["a act: non-negative duration", "a act: at start c0", "a act: over all c1", "goal: goal"]
    created = create_encoding(encoding, plan, Fraction(1, 2))
    assert (created.name, created.epsilon) == (encoding, Fraction(1, 2))
    assert [one.name for one in created.obligations] == names
    assert check(plan, encoding=encoding).answer is Answer.REFUTED
    result = envelope(plan, encoding=encoding)
    assert (result.encoding, result.status) == (encoding, Status.INVALID)
    with pytest.raises(InputError, match=f"unknown encoding '{encoding[:-1]}'; did you mean '{encoding}'"):
        create_encoding(encoding[:-1], plan)
    pieces = (START, Holds(P)), assign(1, Holds(P)), assign(2, Holds(Q)), assign(3, timing=END), assign(4, timing=END)
    created = create_encoding(encoding, plan_of(action("a", *pieces), atoms=(P, Q), goal=Holds(P)))
    assert [(one.name, one.stage) for one in created.obligations] == [
        ("a act: non-negative duration", Stage.DURATION),
        ("separation: a.start, a.end", Stage.SEPARATION),
        ("effects of a.start agree", Stage.AGREEMENT),
        ("effects of a.end agree", Stage.AGREEMENT),
        ("a act: at start c0", Stage.CONDITION),
        ("goal: goal", Stage.CONDITION),
    ]


ORDERS = Path(__file__).with_name("orders.txt").read_text(encoding="utf-8").splitlines()


@by_both
@pytest.mark.parametrize("row", ORDERS)
def test_unordered_points_are_tried_in_every_order(row, encoding) -> None:
    *plan, expected = map(str.strip, row.split("|"))
    assert broken(building.read_plan(*plan), encoding) == (expected.split("; ") if expected != "nothing" else [])


@by_both
def test_a_rate_may_be_a_parameter_whether_elapsed_times_are_fixed_or_not(encoding) -> None:
    run, read = action("r", flow(F, building.reference("k"))), instant("x", (START, building.at_most(f, 4)))

    def plan(latest: int) -> ParametrizedPlan:
        times = (at(run.start, 1), at(run.end, 6), between(ZERO, read.start, 3, latest))
        parameters = (Parameter("k", Fraction(1)),)
        return plan_of(run, read, constraints=times, goal=building.at_most(f, 10), parameters=parameters)

    assert broken(plan(3), encoding, k=2) == []
    assert broken(plan(3), encoding, k=3) == ["x act: c0", "goal: goal"]
    assert [broken(plan(4), encoding, k=rate) for rate in (1, 2)] == [[], ["x act: c0"]]


@by_both
def test_what_is_not_supported(encoding) -> None:
    moving = plan_of(action("r", flow(F, value(G))), instant("w", increase(G, 1)), goal=at_least(f, 0))
    with pytest.raises(UnsupportedError, match=r"its rate reads \(g\), which the plan changes"):
        broken(moving, encoding)
    with pytest.raises(InputError, match=r"\(f\) has no initial value"):
        broken(plan_of(instant("i", (START, at_least(f, 0)), increase(F, 1)), f=None), encoding)


@pytest.mark.parametrize(
    ("encoding", "solver", "fix"),
    [*product(("relational", "positions"), ("z3",), FIXES), ("relational", "cvc5", building.windows)],
)
@pytest.mark.parametrize("case", building.OVER_ALL)
def test_delicate_conditions(case, fix, encoding, solver) -> None:
    """Mutex time points happen at once in some of the cases, so separation is 0."""
    plan, times, holds_here = building.delicate(case)
    fixed = fix(plan, building.schedule_of(plan, times))
    result = check(fixed, epsilon=Fraction(0), encoding=encoding, solver=solver, every=True)
    assert result.obligations["i act: over all c0"] is (Answer.PROVED if holds_here else Answer.REFUTED)


@pytest.mark.parametrize(
    ("condition", "latest"), [(building.STRICT, 0), *((c, 5) for c in (building.different(f, 0), TWO_SIDED, Holds(P)))]
)
def test_what_changes_with_the_schedule_is_seen(condition, latest) -> None:
    """u may start any time from 2 to 4, its limit falls inside i or not, so does the literal."""
    i = action("i", (ALL, condition))
    plan = plan_of(i, UP)
    schedule = building.schedule_of(plan, {"i": (3, 3), "u": (3, 5)})
    assert simulate(plan, {}, schedule).valid, "nothing lies inside an action of no duration"
    assert {check(fix(plan, schedule)).answer for fix in FIXES} == {Answer.PROVED}
    for end in (Fraction(5), Fraction(51, 10)) if latest else (Fraction(2),):
        times = (at(i.start, 1), at(i.end, end), between(ZERO, UP.start, 2, 4), between(UP.start, UP.end, 6, 6))
        literals = (TimedLiteral(Fraction(5), P, False),)
        plan = plan_of(i, UP, atoms=(P,), f=-3, literals=literals, constraints=times)
        assert check(plan).answer is (Answer.PROVED if end <= latest else Answer.REFUTED)


def unordered(count: int) -> ParametrizedPlan:
    """Increases in any order below a cap: far too many orders to search, and very many formulas."""
    watcher = action("w", (ALL, building.at_most(value(F), count)))
    steps = [instant(f"i{n}", increase(F, 1)) for n in range(count)]
    constraints = (at(watcher.start, 0), at(watcher.end, 50), *(between(ZERO, step.start, 1, 40) for step in steps))
    parameters = (Parameter("k", Fraction(1)),)
    return plan_of(watcher, *steps, constraints=constraints, goal=at_least(value(F), count), parameters=parameters)


SOLVING, BUILDING = unordered(11), unordered(70)


@contextmanager
def soon() -> Iterator[None]:
    started = time.monotonic()
    yield
    assert time.monotonic() - started < 15


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of finalisers
@pytest.mark.parametrize(
    ("verb", "interrupted"), [*product((SOLVING, BUILDING, "irr"), (False, True)), ("widen", True), ("optimal", True)]
)
def test_verdicts_and_searches_are_left_open(verb, interrupted) -> None:
    """Time limits and Ctrl-C end the positions encoding, while building formulas and while solving them."""
    encoding = PositionsEncoding(BUILDING, deadline=Deadline.after(0.1))
    with soon(), pytest.raises(OutOfTimeError):
        encoding.query(encoding.obligations[-1])
    options = {"encoding": "positions", "timeout": 30 if interrupted else 0.2}
    with soon(), interrupted_after(0.3) if interrupted else nullcontext():
        if verb in METHODS:
            result = envelope(BUILDING, method=verb, **options).status
            assert result is (Status.INTERRUPTED if interrupted else Status.TIMEOUT)
        else:
            result = check(verb, **options)
            assert (result.answer, result.interrupted) == (Answer.UNKNOWN, interrupted)


ONCE = {Fraction(0): "at different times", Fraction(1, 4): "a quarter apart"}


def assign(amount: building.Amount, condition: model.Condition = building.TRUE, timing: model.Timing = START):
    return replace(building.assign(F, amount, timing), condition=condition)


ONE, TWO = (f"(at end (when ({atom}) (assign (f) {number})))" for atom, number in (("p", 1), ("q", 2)))


@by_both
@pytest.mark.parametrize(
    ("initially", "number", "expected"),
    [
        *(("(p) (q)", number, ["effects of a.end agree"]) for number in (1, 2)),
        *((initially, number, []) for initially, number in (("(p)", 1), ("(q)", 2))),
        ("(q)", 1, ["goal: goal"]),
    ],
)
def test_the_order_of_effects_decides_nothing(encoding, initially, number, expected) -> None:
    for effects in (ONE + TWO, TWO + ONE):
        act = f"(:durative-action a :duration (= ?duration 2) :effect (and {effects}))"
        plan = building.read_plan(act, initially, f"(= (f) {number})", ".zero a.start 1 2, a.start a.end 2 2")
        assert broken(plan, encoding) == expected


def test_conditions_that_exclude_each_other_need_no_proof():
    for one, other in (
        (Holds(P), Holds(P, False)),
        (building.at_least(f, 1), building.above(building.number(1), f)),
        (model.And((Holds(Q), Holds(P))), Holds(P, False)),
        (model.Or((Holds(P), Holds(Q))), model.And((Holds(P, False), Holds(Q, False)))),
    ):
        for pair in ((one, other), (other, one)):
            assert instant("a", *(assign(1, condition) for condition in pair)).agreements == ()
        assert len(instant("a", assign(1, one), assign(1, Holds(model.Atom("r")))).agreements) == 1


SETTER, OTHER = instant("i", assign(1)), instant("j", assign(1))
LASTS = (between(FLOWING.start, FLOWING.end, 1), between(FLOWING.end, SETTER.start, 0))
AT_TWO = (TimedLiteral(Fraction(2), P, True),)


@by_both
@pytest.mark.parametrize(
    ("plan", "expected"),
    [
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, 0, 0),)), ["separation: i, j"]),
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, 0, 1),)), ["separation: i, j"]),
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, Fraction(1, 9)),)), []),
        (plan_of(SETTER, OTHER), ["separation: i, j"]),
        (plan_of(FLOWING, SETTER, constraints=LASTS), ["separation: r.end, i"]),
        (plan_of(FLOWING, SETTER, constraints=(at(FLOWING.start, 1), at(FLOWING.end, 3), at(SETTER.start, 2))), []),
        (plan_of(USER, literals=AT_TWO, constraints=(at(USER.start, 2),)), ["separation: u, @2", "u act: c0"]),
    ],
)
def test_mutex_time_points_never_coincide(plan, expected, encoding) -> None:
    answers = check(plan, encoding=encoding, epsilon=0, every=True)
    early = [name for name in refuted(answers) if name.startswith("separation")]
    assert early == [name for name in expected if name.startswith("separation")]
    assert (answers.answer is Answer.PROVED) == (not expected)


@by_both
def test_the_envelope_has_a_hole_where_points_coincide_but_for_those_of_one_flow(encoding) -> None:
    """A continuous effect acts between start and end: what its own action assigns there is no conflict."""
    timer = action("a", assign(0), flow(F, 1), assign(5, timing=END))
    fixed = (at(timer.start, 1), at(timer.end, 3))
    assert broken(plan_of(timer, f=7, constraints=fixed, goal=building.equal(f, 5)), encoding, Fraction(0)) == []
    parameters = (model.Parameter("k", Fraction(1), lower=Fraction(0), upper=Fraction(3)),)
    times = (at(SETTER.start, 2), at(OTHER.start, building.reference("k")))
    plan = plan_of(SETTER, OTHER, constraints=times, parameters=parameters)
    envelope = region(plan, epsilon=0, encoding=encoding).region
    for number in map(Fraction, (0, 1, Fraction(1999, 1000), 2, Fraction(2001, 1000), 3)):
        answer = check(plan, epsilon=0, encoding=encoding, at={"k": number}).answer
        assert ({"k": number} in envelope) == (answer is Answer.PROVED) == (number != 2)


class Drawing:
    """Small plans of conditional assignments in windows one unit wide, so that many of their time points may tie."""

    def __init__(self, random: Random) -> None:
        self.random, self.pick = random, random.choice

    def plan(self) -> ParametrizedPlan:
        instances = [self._instance(f"i{number}") for number in range(self.pick([1, 2, 2, 3]))]
        constraints = []
        for instance in instances:
            earliest = self.pick([0, 1])
            constraints.append(between(ZERO, instance.start, earliest, earliest + self.pick([0, 1, 1])))
            if instance.durative:
                constraints.append(between(instance.start, instance.end, *[self.pick([0, 1, 1])] * 2))
        if len(instances) > 1 and self._chance(0.4):
            constraints.append(between(instances[0].end, instances[1].start, self.pick([0, 0, Fraction(1, 4)]), 1))
        literals = (model.TimedLiteral(Fraction(1), F, Fraction(2)),) if self._chance(0.2) else ()
        goal = self._condition() if self._chance(0.5) else None
        atoms = tuple(atom for atom in (P, Q) if self._chance(0.5))
        return plan_of(*instances, atoms=atoms, goal=goal, literals=literals, constraints=tuple(constraints))

    def _chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def _instance(self, name: str) -> model.ActionInstance:
        durative = self._chance(0.4)
        pieces: list[object] = [self._effect(durative) for _ in range(self.pick([1, 2, 2, 3]))]
        if self._chance(0.3):
            pieces.append(model.AtomEffect(START, self.pick([P, Q]), self._chance(0.5), self._guard()))
        return action(name, *pieces, durative=durative)

    def _effect(self, durative: bool) -> NumericEffect:
        amount = self.pick([value(F), value(G), building.number(0)]) + self.pick([0, 1, 1, 2])
        timing = self.pick([START, END]) if durative else START
        operator = self.pick([AssignmentKind.ASSIGN, AssignmentKind.ASSIGN, AssignmentKind.INCREASE])
        return NumericEffect(timing, self.pick([F, F, G]), operator, amount, self._guard())

    def _guard(self) -> model.Condition:
        return self._condition() if self._chance(0.7) else building.TRUE

    def _condition(self) -> model.Condition:
        leaves: list[model.Condition] = [
            Holds(self.pick([P, Q]), self._chance(0.6)),
            building.at_least(value(self.pick([F, G])), self.pick([0, 1, 2])),
            building.equal(value(F), self.pick([0, 1, 2])),
        ]
        return self.pick([*leaves, model.Or(tuple(leaves[:2])), model.And(tuple(leaves[:2]))])


def on_a_grid(plan: ParametrizedPlan) -> Iterator[dict[TimePoint, Fraction]]:
    """All schedules of the network in which starts are multiples of a quarter; durations are fixed."""
    ends = {(c.source, c.target): [e.constant_term for e in (c.lower, c.upper) if e] for c in plan.constraints}
    windows = [ends[ZERO, instance.start] for instance in plan.instances]
    choices = [[low + Fraction(step, 4) for step in range(int((high - low) * 4) + 1)] for low, high in windows]
    for starts in product(*choices):
        schedule = {}
        for instance, start in zip(plan.instances, starts, strict=True):
            schedule[instance.start] = start
            if instance.durative:
                schedule[instance.end] = start + ends[instance.start, instance.end][0]
        yield schedule


def contradictory(plan: ParametrizedPlan, schedule: dict[TimePoint, Fraction]) -> tuple[set[TimePoint], bool]:
    """Where an action contradicts itself until something does, and whether anything does; the first such time only."""
    atoms, values = set(plan.initial_atoms), {name: one.constant_term for name, one in plan.initial_fluents.items()}
    effects = [(i.at(e.timing), e) for i in plan.instances for e in (*i.atom_effects, *i.numeric_effects)]
    for literal in plan.timed_literals:  # all of them assign
        amount = building.number(Fraction(literal.value))
        effects.append((literal.point, NumericEffect(START, literal.target, AssignmentKind.ASSIGN, amount)))
    times = {literal.point: literal.time for literal in plan.timed_literals} | schedule
    for moment in sorted({times[point] for point, _ in effects}):
        now = [(point, e) for point, e in effects if times[point] == moment and holds(e.condition, atoms, values)]
        numeric = [(point, effect) for point, effect in now if isinstance(effect, NumericEffect)]
        pairs = [
            {a, b}
            for (a, one), (b, other) in combinations(numeric, 2)
            if one.fluent == other.fluent and AssignmentKind.ASSIGN in (one.operator, other.operator)
        ]
        if pairs:
            return {point for pair in pairs if len(pair) == 1 for point in pair}, True
        amounts = [(effect, effect.expression.evaluate(dict(values))) for _, effect in numeric]
        for effect, amount in amounts:
            values[effect.fluent] = amount + values[effect.fluent] * (effect.operator is AssignmentKind.INCREASE)
        writes = [effect for _, effect in now if isinstance(effect, model.AtomEffect)]
        atoms = (atoms - {e.atom for e in writes if not e.value}) | {e.atom for e in writes if e.value}
    return set(), False


def holds(condition: model.Condition, atoms: set[model.Atom], values: dict[model.Fluent, Fraction]) -> bool:
    match condition:
        case model.Truth(truth):
            return truth
        case Holds(atom, truth):
            return (atom in atoms) is truth
        case model.NumericCondition(expression, relation):
            return relation.holds(expression.evaluate(dict(values)))
        case model.And(operands) | model.Or(operands):
            quantifier = all if isinstance(condition, model.And) else any
            return quantifier(holds(operand, atoms, values) for operand in operands)


def hunt(plan: ParametrizedPlan, epsilon: Fraction) -> Iterator[object]:
    """Compare brute force with the simulator and with both encodings; what came out, for statistics."""
    schedules = []
    for schedule in on_a_grid(plan):
        simulation = simulate(plan, {}, schedule, epsilon=epsilon)
        if simulation.network_violations:
            continue
        labels = {one.obligation for one in simulation.violations}
        schedules.append((schedule, labels))
        points, contradicts = contradictory(plan, schedule)
        assert {f"effects of {point} agree" for point in points} <= labels
        assert not contradicts or labels, "a conflict of two actions breaks a separation"
    if not schedules:
        return
    answers = {}
    turned = (replace(instance, numeric_effects=instance.numeric_effects[::-1]) for instance in plan.instances)
    backwards = replace(plan, instances=tuple(turned))
    for encoding in ENCODINGS:
        found = check(plan, encoding=encoding, epsilon=epsilon, every=True)
        answers[encoding] = found.answer
        stage = {one.name: one.stage.value for one in create_encoding(encoding, plan, epsilon).obligations}
        for _, labels in schedules:
            first = min((stage[label] for label in labels), default=None)
            assert all(found.obligations[one] is Answer.REFUTED for one in labels if stage[one] == first)
        yield from (f"{name.partition(' ')[0]} {answer.value}" for name, answer in found.obligations.items())
        turned = check(backwards, encoding=encoding, epsilon=epsilon, every=True)
        early = [name for name in stage if stage[name] < Stage.AGREEMENT.value]
        assert [found.obligations[name] for name in early] == [turned.obligations[name] for name in early]
        assert found.answer is turned.answer
    assert len(set(answers.values())) == 1, answers
    yield answers["relational"]


@pytest.mark.parametrize("count", [12, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("epsilon", ONCE, ids=ONCE.values())
def test_both_encodings_agree_with_brute_force(count, epsilon) -> None:
    outcomes: Counter[object] = Counter()
    for seed in range(count):
        outcomes.update(hunt(Drawing(Random(seed)).plan(), epsilon))  # noqa: S311 - no secret
    assert min(outcomes[Answer.PROVED], outcomes[Answer.REFUTED]) >= count / 12, outcomes
    rare = ("effects refuted", "effects proved", "separation: refuted")
    assert min(outcomes[kind] for kind in rare) >= count / 12, outcomes
