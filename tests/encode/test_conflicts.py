"""Effects that contradict each other, and ε = 0: what cannot happen at one time breaks a plan in every encoding.

The simulator decides single schedules; all schedules on a grid, ties among them, decide small plans by brute force. A
few lines of their own find the effects of one happening that contradict each other, whatever a plan's text says first.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product
from random import Random

import pytest

from robust.api import check, region
from robust.backends import ENCODINGS
from robust.encode import create_encoding
from robust.encode.interface import Stage
from robust.irr.check import Answer
from robust.plan import model
from robust.plan.load import assemble
from robust.plan.model import ZERO, AssignmentKind, Holds, NumericEffect, ParametrizedPlan, TimePoint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.simulate import simulate
from robust.plan.stn import parse_stn
from tests.encode.asking import refuted
from tests.plan import building
from tests.plan.building import END, START, F, G, P, Q, action, at, between, instant, plan_of, value

by_both = pytest.mark.parametrize("encoding", ENCODINGS)
ONCE = {Fraction(0): "at different times", Fraction(1, 4): "a quarter apart"}
f = value(F)


def assign(amount: building.Amount, condition: model.Condition = building.TRUE, timing: model.Timing = START):
    return replace(building.assign(F, amount, timing), condition=condition)


def broken(plan: ParametrizedPlan, encoding: str, epsilon: int | Fraction = 0) -> list[str]:
    return refuted(check(plan, encoding=encoding, epsilon=epsilon, every=True))


# -- one action, one time --------------------------------------------------------------------------------------------

DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f))
 (:durative-action a :parameters () :duration (= ?duration 2) :condition () :effect (and {})))"""
PROBLEM = "(define (problem x) (:domain d) (:init (= (f) 0) {}) (:goal (= (f) {})))"
STEPS = "durative-action instance n0 : (a);\nc: n0.start - .zero in [1, 2];\nc: n0.end - n0.start in [2, 2];\n"
ONE, TWO = (f"(at end (when ({atom}) (assign (f) {number})))" for atom, number in (("p", 1), ("q", 2)))


@by_both
@pytest.mark.parametrize(
    ("initially", "number", "expected"),
    [
        ("(p) (q)", 1, ["effects of n0.end agree"]),
        ("(p) (q)", 2, ["effects of n0.end agree"]),
        ("(p)", 1, []),
        ("(q)", 2, []),
        ("(q)", 1, ["goal: (= (f) 1)"]),
    ],
)
def test_the_order_of_effects_decides_nothing(encoding, initially, number, expected) -> None:
    for effects in (ONE + TWO, TWO + ONE):
        domain = parse_domain(DOMAIN.format(effects))
        plan = assemble(domain, parse_problem(PROBLEM.format(initially, number), domain), parse_stn(STEPS))
        assert broken(plan, encoding, Fraction(1, 1000)) == expected


@by_both
def test_the_obligation_comes_before_conditions(encoding) -> None:
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


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Holds(P), Holds(P, False)),
        (building.at_least(f, 1), building.above(building.number(1), f)),
        (model.And((Holds(Q), Holds(P))), Holds(P, False)),
        (model.Or((Holds(P), Holds(Q))), model.And((Holds(P, False), Holds(Q, False)))),
    ],
)
def test_conditions_that_exclude_each_other_need_no_proof(one, other) -> None:
    for pair in ((one, other), (other, one)):
        assert instant("a", *(assign(1, condition) for condition in pair)).agreements == ()
    assert len(instant("a", assign(1, one), assign(1, Holds(model.Atom("r")))).agreements) == 1


@by_both
def test_a_fluent_may_be_reset_before_it_flows(encoding) -> None:
    """A continuous effect acts between start and end: what its own action assigns there is no conflict."""
    timer = action("a", assign(0), building.flow(F, 1), assign(5, timing=END))
    fixed = (at(timer.start, 1), at(timer.end, 3))
    assert broken(plan_of(timer, f=7, constraints=fixed, goal=building.equal(f, 5)), encoding) == []


# -- ε = 0 -----------------------------------------------------------------------------------------------------------

SETTER, OTHER = instant("i", assign(1)), instant("j", assign(1))
TIMER = action("r", building.flow(F, 1))
LASTS = between(TIMER.start, TIMER.end, 1)
READER = instant("u", (START, Holds(P)))
AT_TWO = (model.TimedLiteral(Fraction(2), P, True),)


@by_both
@pytest.mark.parametrize(
    ("plan", "expected"),
    [
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, 0, 0),)), ["separation: i, j"]),
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, 0, 1),)), ["separation: i, j"]),
        (plan_of(SETTER, OTHER, constraints=(between(SETTER.start, OTHER.start, Fraction(1, 9)),)), []),
        (plan_of(SETTER, OTHER), ["separation: i, j"]),
        (plan_of(TIMER, SETTER, constraints=(LASTS, between(TIMER.end, SETTER.start, 0))), ["separation: r.end, i"]),
        (plan_of(TIMER, SETTER, constraints=(at(TIMER.start, 1), at(TIMER.end, 3), at(SETTER.start, 2))), []),
        (plan_of(READER, literals=AT_TWO, constraints=(at(READER.start, 2),)), ["separation: u, @2", "u act: c0"]),
    ],
)
def test_mutex_time_points_never_coincide(plan, expected, encoding) -> None:
    answers = check(plan, encoding=encoding, epsilon=0, every=True)
    early = [name for name in refuted(answers) if name.startswith("separation")]
    assert early == [name for name in expected if name.startswith("separation")]
    assert (answers.answer is Answer.PROVED) == (not expected)


@by_both
def test_the_envelope_has_a_hole_where_points_coincide(encoding) -> None:
    parameters = (model.Parameter("k", Fraction(1), lower=Fraction(0), upper=Fraction(3)),)
    times = (at(SETTER.start, 2), at(OTHER.start, building.reference("k")))
    plan = plan_of(SETTER, OTHER, constraints=times, parameters=parameters)
    envelope = region(plan, epsilon=0, encoding=encoding).region
    for number in map(Fraction, (0, 1, Fraction(1999, 1000), 2, Fraction(2001, 1000), 3)):
        answer = check(plan, epsilon=0, encoding=encoding, at={"k": number}).answer
        assert ({"k": number} in envelope) == (answer is Answer.PROVED) == (number != 2)


# -- a hunt ----------------------------------------------------------------------------------------------------------


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
    for time in sorted({times[point] for point, _ in effects}):
        now = [(point, e) for point, e in effects if times[point] == time and holds(e.condition, atoms, values)]
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


def backwards(plan: ParametrizedPlan) -> ParametrizedPlan:
    """The plan whose actions say their effects in the opposite order."""
    turned = (replace(one, numeric_effects=one.numeric_effects[::-1]) for one in plan.instances)
    return replace(plan, instances=tuple(turned))


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
    for encoding in ENCODINGS:
        found = check(plan, encoding=encoding, epsilon=epsilon, every=True)
        answers[encoding] = found.answer
        stage = {one.name: one.stage.value for one in create_encoding(encoding, plan, epsilon).obligations}
        for _, labels in schedules:
            first = min((stage[label] for label in labels), default=None)
            assert all(found.obligations[one] is Answer.REFUTED for one in labels if stage[one] == first)
        yield from (f"{name.partition(' ')[0]} {answer.value}" for name, answer in found.obligations.items())
        turned = check(backwards(plan), encoding=encoding, epsilon=epsilon, every=True)
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
