"""Hypothesis strategies for small parametrized plans, built as model objects without any reader.

`plans()` draws a reference schedule first and a temporal network around it, so that most networks are consistent at
nominal values. About half of the plans are then *tamed*: conditions that sampled schedules break are negated or dropped
and mutex time points are ordered, which leaves a good share of plans valid for every schedule. Schedules and parameter
values come from :mod:`tests.sampling`.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import assert_never

from hypothesis import strategies as st

from robust.plan import model
from robust.plan.model import ParameterReference, ParametrizedPlan, Relation, Timing
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from tests.pddl_text import condition_text
from tests.sampling import sample_schedules

ATOMS = (model.Atom("p"), model.Atom("q", ("a",)), model.Atom("r", ("a", "b")))
FLUENTS = (model.Fluent("f"), model.Fluent("g", ("a",)))
HALF = Fraction(1, 2)
TRUE = model.Truth(True)


@dataclass(frozen=True, slots=True)
class Features:
    """What the plans may contain; numbers are maxima.

    linear: no products of parameters, fluents and `?duration`, and constant rates, so that with times as variables
    every expression stays linear. dyadic: all numbers are multiples of 1/8, so that binary floats are exact.
    equalities: comparisons with = and != outside of duration constraints. infeasible: rare networks without schedule at
    nominal values. zero_durations: rare instances that may start and end at once. tame: None mixes both kinds.
    """

    instances: int = 4
    atoms: int = 3
    fluents: int = 2
    parameters: int = 3
    linear: bool = False
    dyadic: bool = False
    continuous: bool = True
    conditional: bool = True
    timed_literals: bool = True
    duration_in_conditions: bool = True
    equalities: bool = True
    durative_only: bool = False
    zero_durations: bool = True
    infeasible: bool = True
    tame: bool | None = None


@st.composite
def plans(draw, **options):
    """Small plans with the default features, or with some changed by keyword: `plans(linear=True)`."""
    return _Builder(draw, Features(**options)).plan()


class _Builder:
    """Draws one plan; `times` is its reference schedule."""

    def __init__(self, draw, features):
        self._draw = draw
        self.features = features
        self.tame = self.chance(0.65) if features.tame is None else features.tame
        self.atoms = ATOMS[: self.between(1, features.atoms)]
        self.fluents = FLUENTS[: self.between(0, features.fluents)]
        self.moving = tuple(f for f in self.fluents if f == FLUENTS[0] or self.chance(0.5))
        self.parameters = tuple(self._parameter(i) for i in range(self.between(0, features.parameters)))
        self.times = {model.ZERO: Fraction(0)}

    def pick(self, *values):
        return self._draw(st.sampled_from(values))

    def between(self, lower, upper):
        return self._draw(st.integers(lower, upper))

    def chance(self, probability):
        """True with about that probability; shrinks to False."""
        return self.between(0, 99) >= 100 * (1 - probability)

    def many(self, upper, make):
        return tuple(make() for _ in range(self.between(0, upper)))

    def number(self):
        values = [Fraction(v) for v in (0, 1, -1, 2, -2, 3, 5)] + [HALF, Fraction(3, 2)]
        return self.pick(*values) if self.features.dyadic else self.pick(*values, Fraction(1, 3), Fraction(7, 5))

    def _parameter(self, index):
        third = () if self.features.dyadic else (Fraction(1, 3), Fraction(5, 3))
        nominal = self.pick(*(Fraction(n, 2) for n in (2, 0, 1, 3, 4, 6)), *third)
        lower = nominal - self.pick(Fraction(0), HALF, Fraction(1), Fraction(3)) if self.chance(0.3) else None
        upper = nominal + self.pick(Fraction(0), HALF, Fraction(1), Fraction(3)) if self.chance(0.3) else None
        return model.Parameter(f"k{index}", nominal, self.pick(Fraction(1), Fraction(2)), lower, upper)

    def variable(self, duration):
        references = [ParameterReference(parameter.name) for parameter in self.parameters]
        choices = [*self.fluents, *references, *([model.Duration()] if duration else [])]
        return self.pick(*choices) if choices else None

    def expression(self, *, duration):
        """A number, or up to two terms and a number."""
        total = Polynomial.constant(self.number())
        for _ in range(self.pick(0, 0, 1, 1, 2)):
            variable = self.variable(duration)
            if variable is not None:
                term = Polynomial({(variable,): self.pick(*map(Fraction, (1, -1)), HALF, Fraction(2))})
                if not self.features.linear and self.parameters and self.chance(0.15):
                    term = term * self.parameter()
                total = total + term
        return total

    def parameter(self):
        return Polynomial.variable(ParameterReference(self.pick(*self.parameters).name))

    def rate(self):
        """A number, a parameter, or a fluent that nothing writes."""
        still = [fluent for fluent in self.fluents if fluent not in self.moving]
        if not self.features.linear and self.parameters and self.chance(0.3):
            return self.parameter()
        if not self.features.linear and still and self.chance(0.4):
            return Polynomial.variable(still[0])
        return Polynomial.constant(self.pick(*(Fraction(v) for v in (1, -1, 2)), HALF, -HALF))

    def leaf(self, *, duration):
        if self.chance(0.03):
            return model.Truth(self.chance(0.5))
        if not self.fluents or self.chance(0.45):
            return model.Holds(self.pick(*self.atoms), self.pick(True, True, False))
        fluent = Polynomial.variable(self.pick(*self.fluents))
        difference = fluent - self.expression(duration=duration and self.features.duration_in_conditions)
        relations = [Relation.AT_LEAST, Relation.AT_LEAST, Relation.GREATER]
        relations += [Relation.EQUAL, Relation.DIFFERENT] if self.features.equalities else []
        return model.NumericCondition(difference if self.chance(0.5) else -difference, self.pick(*relations))

    def condition(self, *, duration):
        """A literal, a comparison, or a disjunction or conjunction of some, nested once at most."""
        if self.chance(0.7):
            return self.leaf(duration=duration)
        operands = [self.leaf(duration=duration) for _ in range(self.between(2, 3))]
        if self.chance(0.3):
            operands[0] = model.And((operands[0], self.leaf(duration=duration)))
        either = self.chance(0.8)
        return model.Or(tuple(operands)) if either else model.And((model.Or(tuple(operands[1:])), operands[0]))

    def when(self, duration):
        return self.condition(duration=duration) if self.features.conditional and self.chance(0.2) else TRUE

    def timed_condition(self, durative):
        over_all = (Timing.OVER_ALL, Timing.OVER_ALL)
        timing = self.pick(Timing.AT_START, Timing.AT_END, *over_all) if durative else Timing.AT_START
        condition = self.condition(duration=durative)
        return model.TimedCondition(timing, condition, condition_text(condition))

    def instance(self, index):
        durative = self.features.durative_only or self.chance(0.7)
        name = f"i{index}"
        shell = model.ActionInstance(name, f"act{index}", self.pick((), ("a",)), durative)
        self._place(shell)
        conditions = self.many(2, lambda: self.timed_condition(durative))
        moving = bool(self.moving)
        return replace(
            shell,
            durations=self._durations(shell) if durative else (),
            conditions=tuple({shell.label(part): part for part in conditions}.values()),
            atom_effects=tuple(dict.fromkeys(self.many(2, lambda: self.atom_effect(durative)))),
            numeric_effects=self.many(1, lambda: self.numeric_effect(durative)) if moving else (),
            continuous_effects=self.many(1, self.continuous_effect)
            if moving and durative and self.features.continuous
            else (),
        )

    def _timing(self, durative):
        return self.pick(Timing.AT_START, Timing.AT_END) if durative else Timing.AT_START

    def atom_effect(self, durative):
        timing, atom, value = self._timing(durative), self.pick(*self.atoms), self.pick(True, True, False)
        return model.AtomEffect(timing, atom, value, self.when(durative))

    def numeric_effect(self, durative):
        expression = self.expression(duration=durative)
        timing, fluent = self._timing(durative), self.pick(*self.moving)
        increase = model.AssignmentKind.INCREASE
        operator = self.pick(increase, increase, model.AssignmentKind.ASSIGN)
        return model.NumericEffect(timing, fluent, operator, expression, self.when(durative))

    def continuous_effect(self):
        return model.ContinuousEffect(self.pick(*self.moving), self.rate())

    def _durations(self, shell):
        constraints = self.many(2, lambda: self._duration_constraint(self.times[shell.end] - self.times[shell.start]))
        return tuple({part.text: part for part in constraints}.values())

    def _duration_constraint(self, reference):
        """A bound near the reference duration, or any expression."""
        duration = Polynomial.variable(model.Duration())
        slack = self.pick(Fraction(0), HALF, Fraction(2))
        symbol, sign = self.pick((">=", 1), ("<=", -1), ("=", 1))
        near = self._parametric(reference - sign * (slack if symbol != "=" else 0))
        bound = near if self.chance(0.8) else self.expression(duration=False)
        relation = Relation.EQUAL if symbol == "=" else Relation.AT_LEAST
        timing = self.pick(Timing.AT_START, Timing.AT_START, Timing.AT_END)
        return model.DurationConstraint(
            timing, model.NumericCondition((duration - bound).scaled(sign), relation), f"{symbol} {bound}"
        )

    def _time(self, lower, upper):
        """A multiple of a half; in tame plans one that no time point has yet."""
        time = Fraction(self.between(lower, upper), 2)
        while self.tame and time in self.times.values():
            time += HALF
        return time

    def _place(self, shell):
        start = self.times[shell.start] = self._time(0, 12)
        if shell.durative:
            shortest = 0 if self.features.zero_durations and self.chance(0.1) else 1
            self.times[shell.end] = self._time(int(2 * start) + shortest, int(2 * start) + 8)

    def _parametric(self, value):
        """A bound that has this value at the nominal parameters."""
        if not self.parameters or self.chance(0.6):
            return Polynomial.constant(value)
        parameter = self.pick(*self.parameters)
        factor = self.pick(Fraction(1), Fraction(1), Fraction(-1), Fraction(2))
        return Polynomial({(ParameterReference(parameter.name),): factor}) + (value - factor * parameter.nominal)

    def constraint(self, source, target, *, bounded):
        """A constraint that the reference schedule satisfies."""
        distance = self.times[target] - self.times[source]
        if self.chance(0.3):
            fixed = self._parametric(distance)
            return model.TemporalConstraint(source, target, fixed, fixed)
        slack = [Fraction(0), HALF, Fraction(1), Fraction(2)]
        lower = self._parametric(distance - self.pick(*slack))
        upper = self._parametric(distance + self.pick(*slack))
        if not bounded and self.chance(0.6):
            lower, upper = self.pick((lower, None), (None, upper))
        return model.TemporalConstraint(source, target, lower, upper)

    def _network(self, instances):
        points = [point for instance in instances for point in instance.time_points]
        constraints = []
        for instance in instances:
            anchor = model.ZERO if self.chance(0.7) else self.pick(model.ZERO, *points)
            if anchor not in instance.time_points:
                constraints.append(self.constraint(anchor, instance.start, bounded=self.chance(0.8)))
            if instance.durative:
                constraints.append(self.constraint(instance.start, instance.end, bounded=self.chance(0.8)))
        for _ in range(self.between(0, 2)):
            source, target = self.pick(model.ZERO, *points), self.pick(*points)
            if source != target:
                constraints.append(self.constraint(source, target, bounded=False))
        if self.features.infeasible and self.chance(0.05):
            constraints.append(model.TemporalConstraint(model.ZERO, points[-1], None, self._parametric(-HALF)))
        return tuple(constraints)

    def timed_literal(self):
        time = Fraction(self.between(1, 14), 2)
        self.times[model.TimedLiteral(time, ATOMS[0], True).point] = time
        if self.moving and self.chance(0.4):
            return model.TimedLiteral(time, self.pick(*self.moving), self.number())
        return model.TimedLiteral(time, self.pick(*self.atoms), self.pick(True, False))

    def _timed_literals(self):
        some = self.features.timed_literals and self.chance(0.4)
        literals = (self.timed_literal(), *self.many(1, self.timed_literal)) if some else ()
        return tuple({(literal.time, literal.target): literal for literal in literals}.values())

    def _initial_value(self):
        return self.parameter() if self.parameters and self.chance(0.2) else Polynomial.constant(self.number())

    def plan(self):
        timed_literals = self._timed_literals()
        instances = tuple(self.instance(index) for index in range(self.between(1, self.features.instances)))
        goals = self.many(2, lambda: self.condition(duration=False))
        plan = ParametrizedPlan(
            "drawn",
            self.parameters,
            instances,
            self._network(instances),
            frozenset(atom for atom in self.atoms if self.chance(0.5)),
            {fluent: self._initial_value() for fluent in self.fluents},
            timed_literals,
            tuple(model.GoalCondition(goal, condition_text(goal)) for goal in dict.fromkeys(goals)),
        )
        return tamed(plan, self.times, self._draw(st.randoms(use_true_random=True))) if self.tame else plan


ROUNDS, SAMPLES = 4, 4
SEPARATION = Fraction(1, 4)
_OPPOSITE = {
    Relation.AT_LEAST: Relation.GREATER,
    Relation.GREATER: Relation.AT_LEAST,
    Relation.EQUAL: Relation.DIFFERENT,
    Relation.DIFFERENT: Relation.EQUAL,
}


def tamed(plan, times, random):
    """The plan with fewer ways to fail at nominal parameter values; `times` says how to order mutex time points.

    Broken conditions are negated or dropped, broken duration constraints dropped, until sampled schedules break none of
    the obligations. The result is not guaranteed to be valid: that is for the code under test to find out.
    """
    for attempt in range(ROUNDS):
        schedules = sample_schedules(plan, plan.nominal, random, SAMPLES)
        simulations = (simulate(plan, plan.nominal, schedule) for schedule in schedules)
        broken = {violation.obligation for simulation in simulations for violation in simulation.violations}
        if not broken:
            break
        negate = attempt == 0 and random.random() < 0.5
        plan = replace(
            plan,
            instances=tuple(_repaired(instance, broken, negate) for instance in plan.instances),
            constraints=(*plan.constraints, *_orders(plan, times, broken)),
            goal=tuple(_kept(((goal, goal.label) for goal in plan.goal), broken, negate)),
        )
    return plan


def _repaired(instance, broken, negate):
    conditions = _kept(((part, instance.label(part)) for part in instance.conditions), broken, negate)
    by_label = {instance.label(part): part for part in conditions}
    durations = tuple(part for part in instance.durations if instance.label(part) not in broken)
    return replace(instance, durations=durations, conditions=tuple(by_label.values()))


def _kept(parts, broken, negate):
    for part, label in parts:
        if label not in broken:
            yield part
        elif negate:
            condition = negation(part.condition)
            yield replace(part, condition=condition, text=condition_text(condition))


def _orders(plan, times, broken):
    for instance in plan.instances:
        if f"{instance.identifier} {instance.action}: non-negative duration" in broken:
            yield model.TemporalConstraint(instance.start, instance.end, Polynomial.constant(0), None)
    for a in plan.time_points:
        for b in plan.time_points:
            if f"separation: {a}, {b}" in broken:
                yield _order(*((a, b) if times[a] <= times[b] else (b, a)))


def _order(first, second):
    """First before second, said without timed literals, which plan files cannot name."""
    if first.time is not None:
        return model.TemporalConstraint(model.ZERO, second, Polynomial.constant(first.time + SEPARATION), None)
    if second.time is not None:
        return model.TemporalConstraint(model.ZERO, first, None, Polynomial.constant(second.time - SEPARATION))
    return model.TemporalConstraint(first, second, Polynomial.constant(SEPARATION), None)


def negation(condition):
    """The negation, in negation normal form."""
    match condition:
        case model.Truth(value):
            return model.Truth(not value)
        case model.Holds(atom, value):
            return model.Holds(atom, not value)
        case model.NumericCondition(expression, relation):
            reversed_sign = relation in {Relation.AT_LEAST, Relation.GREATER}
            return model.NumericCondition(-expression if reversed_sign else expression, _OPPOSITE[relation])
        case model.And(operands):
            return model.Or(tuple(negation(operand) for operand in operands))
        case model.Or(operands):
            return model.And(tuple(negation(operand) for operand in operands))
    assert_never(condition)
