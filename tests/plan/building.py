"""Short ways to write down plans, schedules and expected violations for the simulator's tests."""

from __future__ import annotations

from fractions import Fraction

from robust.plan.model import (
    ActionInstance,
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
    NumericEffect,
    Parameter,
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
from robust.plan.simulate import Simulation, simulate

P, Q = Atom("p"), Atom("q")
F, G = Fluent("f"), Fluent("g")
START, END, ALL = Timing.AT_START, Timing.AT_END, Timing.OVER_ALL
DURATION: Expression = Polynomial.variable(Duration())
EPSILON = Fraction(1, 1000)
TRUE = Truth(True)


def value(fluent: Fluent) -> Expression:
    return Polynomial.variable(fluent)


def number(amount: Fraction | int) -> Expression:
    return Polynomial.constant(amount)


def at_least(left: Expression, right: Expression | int) -> Comparison:
    return Comparison(left - right, Relation.AT_LEAST)


def above(left: Expression, right: Expression | int) -> Comparison:
    return Comparison(left - right, Relation.GREATER)


def at_most(left: Expression, right: int) -> Comparison:
    return Comparison(number(right) - left, Relation.AT_LEAST)


def different(left: Expression, right: int) -> Comparison:
    return Comparison(left - right, Relation.DIFFERENT)


def add(atom: Atom, timing: Timing = START, condition: Condition = TRUE) -> AtomEffect:
    return AtomEffect(timing, atom, True, condition)


def delete(atom: Atom, timing: Timing = START, condition: Condition = TRUE) -> AtomEffect:
    return AtomEffect(timing, atom, False, condition)


def assign(fluent: Fluent, amount: Expression | int, timing: Timing = START) -> NumericEffect:
    expression = number(amount) if isinstance(amount, int) else amount
    return NumericEffect(timing, fluent, Assignment.ASSIGN, expression)


def increase(fluent: Fluent, amount: Expression | int, timing: Timing = START) -> NumericEffect:
    expression = number(amount) if isinstance(amount, int) else amount
    return NumericEffect(timing, fluent, Assignment.INCREASE, expression)


def flow(fluent: Fluent, rate: Expression | int) -> ContinuousEffect:
    return ContinuousEffect(fluent, number(rate) if isinstance(rate, int) else rate)


Piece = tuple[Timing, Condition] | AtomEffect | NumericEffect | ContinuousEffect | DurationConstraint


def action(name: str, *pieces: Piece, durative: bool = True) -> ActionInstance:
    conditions = [TimedCondition(p[0], p[1], f"c{i}") for i, p in enumerate(pieces) if isinstance(p, tuple)]
    return ActionInstance(
        name,
        "act",
        (),
        durative,
        tuple(p for p in pieces if isinstance(p, DurationConstraint)),
        tuple(conditions),
        tuple(p for p in pieces if isinstance(p, AtomEffect)),
        tuple(p for p in pieces if isinstance(p, NumericEffect)),
        tuple(p for p in pieces if isinstance(p, ContinuousEffect)),
    )


def instant(name: str, *pieces: Piece) -> ActionInstance:
    return action(name, *pieces, durative=False)


def plan_of(
    *instances: ActionInstance,
    atoms: tuple[Atom, ...] = (),
    f: Expression | int | None = 0,
    g: Expression | int | None = 0,
    goal: Condition | None = None,
    literals: tuple[TimedLiteral, ...] = (),
    constraints: tuple[TemporalConstraint, ...] = (),
    parameters: tuple[Parameter, ...] = (),
) -> ParametrizedPlan:
    initial = {fluent: number(x) if isinstance(x, int) else x for fluent, x in ((F, f), (G, g)) if x is not None}
    goals = (GoalCondition(goal, "goal"),) if goal else ()
    return ParametrizedPlan("test", parameters, instances, constraints, frozenset(atoms), initial, literals, goals)


Times = dict[str, int | Fraction | tuple[int | Fraction, int | Fraction]]


def run(plan: ParametrizedPlan, times: Times, **parameters: int) -> Simulation:
    """Simulate with instances at `times`: a time, or start and end."""
    return simulate(plan, {n: Fraction(v) for n, v in parameters.items()}, schedule_of(plan, times))


def schedule_of(plan: ParametrizedPlan, times: Times) -> dict[TimePoint, Fraction]:
    schedule: dict[TimePoint, Fraction] = {}
    for name, when in times.items():
        pair = when if isinstance(when, tuple) else (when,)
        schedule.update(zip(plan.instance[name].time_points, map(Fraction, pair), strict=True))
    return schedule


def broken(simulation: Simulation) -> list[str]:
    return [violation.obligation for violation in simulation.violations]


def separated(*instances: ActionInstance, literals: tuple[TimedLiteral, ...] = ()) -> list[str]:
    """The mutex pairs of a plan, found by putting everything at one time."""
    time = literals[0].time if literals else Fraction(1)
    plan = plan_of(*instances, atoms=(P, Q), literals=literals)
    schedule = {point: time for i in plan.instances for point in i.time_points}
    labels = broken(simulate(plan, {}, schedule))
    return [label.removeprefix("separation: ") for label in labels if label.startswith("separation")]
