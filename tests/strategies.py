"""Hypothesis strategies for small parametrized plans, built as model objects without any reader.

`plans()` draws a reference schedule first and a temporal network around it, so that most networks are consistent at
nominal values. About half of the plans are then *tamed*: conditions that sampled schedules break are negated or dropped
and mutex time points are ordered, which leaves a good share of plans valid for every schedule. Schedules and parameter
values come from :mod:`tests.sampling`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from hypothesis import strategies as st

from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Assignment,
    Atom,
    AtomEffect,
    Comparison,
    Condition,
    ContinuousEffect,
    Duration,
    DurationConstraint,
    Expression,
    Fluent,
    GoalCondition,
    Holds,
    NumericEffect,
    NumericVariable,
    Or,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimedCondition,
    TimedLiteral,
    TimePoint,
    Timing,
    Truth,
)
from robust.plan.polynomial import Polynomial
from tests.pddl_text import condition_text
from tests.taming import tamed

T = TypeVar("T")
ATOMS = (Atom("p"), Atom("q", ("a",)), Atom("r", ("a", "b")))
FLUENTS = (Fluent("f"), Fluent("g", ("a",)))
HALF = Fraction(1, 2)
TRUE = Truth(True)


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
    disjunctive: bool = True
    over_all: bool = True
    numeric_over_all: bool = True
    timed_literals: bool = True
    duration_in_conditions: bool = True
    equalities: bool = True
    assignments: bool = True
    durative_only: bool = False
    zero_durations: bool = True
    infeasible: bool = True
    tame: bool | None = None


def plans(features: Features | None = None, **options: int | bool | None) -> st.SearchStrategy[ParametrizedPlan]:
    """Small plans with the given features, or with the default ones changed by keyword: `plans(linear=True)`."""
    chosen = features or Features(**options)  # type: ignore[arg-type]
    return _plans(chosen)


@st.composite
def _plans(draw: st.DrawFn, features: Features) -> ParametrizedPlan:
    return _Builder(draw, features).plan()


class _Builder:
    """Draws one plan; `times` is its reference schedule."""

    def __init__(self, draw: st.DrawFn, features: Features) -> None:
        self._draw = draw
        self.features = features
        self.tame = self.chance(0.65) if features.tame is None else features.tame
        self.atoms = ATOMS[: self.between(1, features.atoms)]
        self.fluents = FLUENTS[: self.between(0, features.fluents)]
        self.moving = tuple(f for f in self.fluents if f == FLUENTS[0] or self.chance(0.5))
        self.parameters = tuple(self._parameter(i) for i in range(self.between(0, features.parameters)))
        self.times: dict[TimePoint, Fraction] = {ZERO: Fraction(0)}

    def pick(self, *values: T) -> T:
        return self._draw(st.sampled_from(values))

    def between(self, lower: int, upper: int) -> int:
        return self._draw(st.integers(lower, upper))

    def chance(self, probability: float) -> bool:
        """True with about that probability; shrinks to False."""
        return self.between(0, 99) >= 100 * (1 - probability)

    def many(self, upper: int, make: Callable[[], T]) -> tuple[T, ...]:
        return tuple(make() for _ in range(self.between(0, upper)))

    # --- numbers and expressions -------------------------------------------------------------------------------------

    def number(self) -> Fraction:
        values = [Fraction(v) for v in (0, 1, -1, 2, -2, 3, 5)] + [HALF, Fraction(3, 2)]
        return self.pick(*values) if self.features.dyadic else self.pick(*values, Fraction(1, 3), Fraction(7, 5))

    def _parameter(self, index: int) -> Parameter:
        third = () if self.features.dyadic else (Fraction(1, 3), Fraction(5, 3))
        nominal = self.pick(*(Fraction(n, 2) for n in (2, 0, 1, 3, 4, 6)), *third)
        lower = nominal - self.pick(Fraction(0), HALF, Fraction(1), Fraction(3)) if self.chance(0.3) else None
        upper = nominal + self.pick(Fraction(0), HALF, Fraction(1), Fraction(3)) if self.chance(0.3) else None
        return Parameter(f"k{index}", nominal, self.pick(Fraction(1), Fraction(2)), lower, upper)

    def variable(self, duration: bool) -> NumericVariable | None:
        references = [ParameterReference(parameter.name) for parameter in self.parameters]
        choices: list[NumericVariable] = [*self.fluents, *references, *([Duration()] if duration else [])]
        return self.pick(*choices) if choices else None

    def expression(self, *, duration: bool) -> Expression:
        """A number, or up to two terms and a number."""
        total: Expression = Polynomial.constant(self.number())
        for _ in range(self.pick(0, 0, 1, 1, 2)):
            variable = self.variable(duration)
            if variable is not None:
                term: Expression = Polynomial({(variable,): self.pick(Fraction(1), Fraction(-1), HALF, Fraction(2))})
                if not self.features.linear and self.parameters and self.chance(0.15):
                    term = term * Polynomial.variable(ParameterReference(self.pick(*self.parameters).name))
                total = total + term
        return total

    def rate(self) -> Expression:
        """A number, a parameter, or a fluent that nothing writes."""
        still = [fluent for fluent in self.fluents if fluent not in self.moving]
        if not self.features.linear and self.parameters and self.chance(0.3):
            return Polynomial.variable(ParameterReference(self.pick(*self.parameters).name))
        if not self.features.linear and still and self.chance(0.4):
            return Polynomial.variable(still[0])
        return Polynomial.constant(self.pick(*(Fraction(v) for v in (1, -1, 2)), HALF, -HALF))

    # --- conditions --------------------------------------------------------------------------------------------------

    def leaf(self, *, duration: bool, numeric: bool = True) -> Condition:
        if self.chance(0.03):
            return Truth(self.chance(0.5))
        if not (self.fluents and numeric) or self.chance(0.45):
            return Holds(self.pick(*self.atoms), self.pick(True, True, False))
        fluent: Expression = Polynomial.variable(self.pick(*self.fluents))
        difference = fluent - self.expression(duration=duration and self.features.duration_in_conditions)
        relations = [Relation.AT_LEAST, Relation.AT_LEAST, Relation.GREATER]
        relations += [Relation.EQUAL, Relation.DIFFERENT] if self.features.equalities else []
        return Comparison(difference if self.chance(0.5) else -difference, self.pick(*relations))

    def condition(self, *, duration: bool, numeric: bool = True) -> Condition:
        """A literal, a comparison, or a disjunction or conjunction of some, nested once at most."""
        if not self.features.disjunctive or self.chance(0.7):
            return self.leaf(duration=duration, numeric=numeric)
        operands = [self.leaf(duration=duration, numeric=numeric) for _ in range(self.between(2, 3))]
        if self.chance(0.3):
            operands[0] = And((operands[0], self.leaf(duration=duration, numeric=numeric)))
        return Or(tuple(operands)) if self.chance(0.8) else And((Or(tuple(operands[1:])), operands[0]))

    def when(self, duration: bool) -> Condition:
        return self.condition(duration=duration) if self.features.conditional and self.chance(0.2) else TRUE

    def timed_condition(self, durative: bool) -> TimedCondition:
        timings = [Timing.AT_START] if not durative else [Timing.AT_START, Timing.AT_END]
        if durative and self.features.over_all:
            timings += [Timing.OVER_ALL, Timing.OVER_ALL]
        timing = self.pick(*timings)
        numeric = timing is not Timing.OVER_ALL or self.features.numeric_over_all
        condition = self.condition(duration=durative, numeric=numeric)
        return TimedCondition(timing, condition, condition_text(condition))

    # --- instances ---------------------------------------------------------------------------------------------------

    def instance(self, index: int) -> ActionInstance:
        durative = self.features.durative_only or self.chance(0.7)
        name = f"i{index}"
        shell = ActionInstance(name, f"act{index}", self.pick((), ("a",)), durative)
        self._place(shell)
        conditions = self.many(2, lambda: self.timed_condition(durative))
        moving = bool(self.moving)
        return ActionInstance(
            name,
            shell.action,
            shell.arguments,
            durative,
            self._durations(shell) if durative else (),
            tuple({shell.label(part): part for part in conditions}.values()),
            tuple(dict.fromkeys(self.many(2, lambda: self.atom_effect(durative)))),
            self.many(1, lambda: self.numeric_effect(durative)) if moving else (),
            self.many(1, self.continuous_effect) if moving and durative and self.features.continuous else (),
        )

    def _timing(self, durative: bool) -> Timing:
        return self.pick(Timing.AT_START, Timing.AT_END) if durative else Timing.AT_START

    def atom_effect(self, durative: bool) -> AtomEffect:
        return AtomEffect(
            self._timing(durative), self.pick(*self.atoms), self.pick(True, True, False), self.when(durative)
        )

    def numeric_effect(self, durative: bool) -> NumericEffect:
        operators = [Assignment.INCREASE, Assignment.INCREASE] + [Assignment.ASSIGN] * self.features.assignments
        expression = self.expression(duration=durative)
        timing, fluent = self._timing(durative), self.pick(*self.moving)
        return NumericEffect(timing, fluent, self.pick(*operators), expression, self.when(durative))

    def continuous_effect(self) -> ContinuousEffect:
        return ContinuousEffect(self.pick(*self.moving), self.rate())

    def _durations(self, shell: ActionInstance) -> tuple[DurationConstraint, ...]:
        constraints = self.many(2, lambda: self._duration_constraint(self.times[shell.end] - self.times[shell.start]))
        return tuple({part.text: part for part in constraints}.values())

    def _duration_constraint(self, reference: Fraction) -> DurationConstraint:
        """A bound near the reference duration, or any expression."""
        duration: Expression = Polynomial.variable(Duration())
        slack = self.pick(Fraction(0), HALF, Fraction(2))
        symbol, sign = self.pick((">=", 1), ("<=", -1), ("=", 1))
        near = self._parametric(reference - sign * (slack if symbol != "=" else 0))
        bound = near if self.chance(0.8) else self.expression(duration=False)
        relation = Relation.EQUAL if symbol == "=" else Relation.AT_LEAST
        timing = self.pick(Timing.AT_START, Timing.AT_START, Timing.AT_END)
        return DurationConstraint(timing, Comparison((duration - bound).scaled(sign), relation), f"{symbol} {bound}")

    # --- network -----------------------------------------------------------------------------------------------------

    def _time(self, lower: int, upper: int) -> Fraction:
        """A multiple of a half; in tame plans one that no time point has yet."""
        time = Fraction(self.between(lower, upper), 2)
        while self.tame and time in self.times.values():
            time += HALF
        return time

    def _place(self, shell: ActionInstance) -> None:
        start = self.times[shell.start] = self._time(0, 12)
        if shell.durative:
            shortest = 0 if self.features.zero_durations and self.chance(0.1) else 1
            self.times[shell.end] = self._time(int(2 * start) + shortest, int(2 * start) + 8)

    def _parametric(self, value: Fraction) -> Expression:
        """A bound that has this value at the nominal parameters."""
        if not self.parameters or self.chance(0.6):
            return Polynomial.constant(value)
        parameter = self.pick(*self.parameters)
        factor = self.pick(Fraction(1), Fraction(1), Fraction(-1), Fraction(2))
        return Polynomial({(ParameterReference(parameter.name),): factor}) + (value - factor * parameter.nominal)

    def constraint(self, source: TimePoint, target: TimePoint, *, bounded: bool) -> TemporalConstraint:
        """A constraint that the reference schedule satisfies."""
        distance = self.times[target] - self.times[source]
        if self.chance(0.3):
            fixed = self._parametric(distance)
            return TemporalConstraint(source, target, fixed, fixed)
        slack = [Fraction(0), HALF, Fraction(1), Fraction(2)]
        lower: Expression | None = self._parametric(distance - self.pick(*slack))
        upper: Expression | None = self._parametric(distance + self.pick(*slack))
        if not bounded and self.chance(0.6):
            lower, upper = self.pick((lower, None), (None, upper))
        return TemporalConstraint(source, target, lower, upper)

    def _network(self, instances: tuple[ActionInstance, ...]) -> tuple[TemporalConstraint, ...]:
        points = [point for instance in instances for point in instance.time_points]
        constraints: list[TemporalConstraint] = []
        for instance in instances:
            anchor = ZERO if self.chance(0.7) else self.pick(ZERO, *points)
            if anchor not in instance.time_points:
                constraints.append(self.constraint(anchor, instance.start, bounded=self.chance(0.8)))
            if instance.durative:
                constraints.append(self.constraint(instance.start, instance.end, bounded=self.chance(0.8)))
        for _ in range(self.between(0, 2)):
            source, target = self.pick(ZERO, *points), self.pick(*points)
            if source != target:
                constraints.append(self.constraint(source, target, bounded=False))
        if self.features.infeasible and self.chance(0.05):
            constraints.append(TemporalConstraint(ZERO, points[-1], None, self._parametric(-HALF)))
        return tuple(constraints)

    # --- plan --------------------------------------------------------------------------------------------------------

    def timed_literal(self) -> TimedLiteral:
        time = Fraction(self.between(1, 14), 2)
        self.times[TimedLiteral(time, ATOMS[0], True).point] = time
        if self.moving and self.features.assignments and self.chance(0.4):
            return TimedLiteral(time, self.pick(*self.moving), self.number())
        return TimedLiteral(time, self.pick(*self.atoms), self.pick(True, False))

    def _timed_literals(self) -> tuple[TimedLiteral, ...]:
        if not self.features.timed_literals or not self.chance(0.4):
            return ()
        literals = (self.timed_literal(), *self.many(1, self.timed_literal))
        return tuple({(literal.time, literal.target): literal for literal in literals}.values())

    def _initial_value(self) -> Expression:
        if self.parameters and self.chance(0.2):
            return Polynomial.variable(ParameterReference(self.pick(*self.parameters).name))
        return Polynomial.constant(self.number())

    def plan(self) -> ParametrizedPlan:
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
            tuple(GoalCondition(goal, condition_text(goal)) for goal in dict.fromkeys(goals)),
        )
        if not self.tame:
            return plan
        return tamed(plan, self.times, self._draw(st.randoms(use_true_random=True)))
