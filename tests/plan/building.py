"""Short ways to write plans, and schedules whose outcome is known by hand [docs/semantics.md]."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import NamedTuple

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from robust.errors import RobustError
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Simulation, Violation, simulate

P, Q = model.Atom("p"), model.Atom("q")
F, G = model.Fluent("f"), model.Fluent("g")
START, END, ALL = model.Timing.AT_START, model.Timing.AT_END, model.Timing.OVER_ALL
DURATION: model.Expression = Polynomial.variable(model.Duration())
EPSILON = Fraction(1, 1000)
TRUE = model.Truth(True)
RANDOM = st.randoms(use_true_random=True)
value, number = Polynomial.variable, Polynomial.constant
Amount = model.Expression | Fraction | int


def drawn(examples: int) -> settings:
    """Repeatable examples, however long it takes to draw them."""
    return settings(max_examples=examples, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def reference(name: str) -> model.Expression:
    """The parameter of that name."""
    return Polynomial.variable(model.ParameterReference(name))


def expression_of(amount: Amount) -> model.Expression:
    return amount if isinstance(amount, Polynomial) else number(amount)


def compared(relation: model.Relation, left: Amount, right: Amount) -> model.NumericCondition:
    return model.NumericCondition(expression_of(left) - expression_of(right), relation)


at_least, above = partial(compared, model.Relation.AT_LEAST), partial(compared, model.Relation.GREATER)
equal, different = partial(compared, model.Relation.EQUAL), partial(compared, model.Relation.DIFFERENT)


def at_most(left: Amount, right: Amount) -> model.NumericCondition:
    return at_least(right, left)


def _atom_effect(
    value: bool, atom: model.Atom, timing: model.Timing = START, condition: model.Condition = TRUE
) -> model.AtomEffect:
    return model.AtomEffect(timing, atom, value, condition)


def _changed(
    how: model.AssignmentKind, fluent: model.Fluent, amount: Amount, timing: model.Timing = START
) -> model.NumericEffect:
    return model.NumericEffect(timing, fluent, how, expression_of(amount))


add, delete = partial(_atom_effect, True), partial(_atom_effect, False)
assign, increase = partial(_changed, model.AssignmentKind.ASSIGN), partial(_changed, model.AssignmentKind.INCREASE)


def flow(fluent: model.Fluent, rate: Amount) -> model.ContinuousEffect:
    return model.ContinuousEffect(fluent, expression_of(rate))


def between(
    source: model.TimePoint, target: model.TimePoint, lower: Amount | None = None, upper: Amount | None = None
) -> model.TemporalConstraint:
    bounds = (None if bound is None else expression_of(bound) for bound in (lower, upper))
    return model.TemporalConstraint(source, target, *bounds)


def at(point: model.TimePoint, time: Amount) -> model.TemporalConstraint:
    return between(model.ZERO, point, time, time)


def action(name: str, *pieces: object, durative: bool = True) -> model.ActionInstance:
    """An action of conditions with their timing, effects and duration constraints."""

    def of(kind: type) -> tuple:
        return tuple(piece for piece in pieces if isinstance(piece, kind))

    conditions = [model.TimedCondition(p[0], p[1], f"c{i}") for i, p in enumerate(pieces) if isinstance(p, tuple)]
    effects = (of(kind) for kind in (model.AtomEffect, model.NumericEffect, model.ContinuousEffect))
    return model.ActionInstance(name, "act", (), durative, of(model.DurationConstraint), tuple(conditions), *effects)


def instant(name: str, *pieces: object) -> model.ActionInstance:
    return action(name, *pieces, durative=False)


def plan_of(
    *instances: model.ActionInstance,
    atoms: tuple[model.Atom, ...] = (),
    f: Amount | None = 0,
    g: Amount | None = 0,
    goal: model.Condition | None = None,
    literals: tuple[model.TimedLiteral, ...] = (),
    constraints: tuple[model.TemporalConstraint, ...] = (),
    parameters: tuple[model.Parameter, ...] = (),
) -> model.ParametrizedPlan:
    initial = {fluent: expression_of(x) for fluent, x in ((F, f), (G, g)) if x is not None}
    goals = (model.GoalCondition(goal, "goal"),) if goal else ()
    return model.ParametrizedPlan(
        "test", parameters, instances, constraints, frozenset(atoms), initial, literals, goals
    )


Times = dict[str, int | Fraction | tuple[int | Fraction, int | Fraction]]


def run(plan: model.ParametrizedPlan, times: Times, **parameters: int) -> Simulation:
    """Simulate with instances at `times`: a time, or start and end."""
    return simulate(plan, {n: Fraction(v) for n, v in parameters.items()}, schedule_of(plan, times))


def schedule_of(plan: model.ParametrizedPlan, times: Times) -> dict[model.TimePoint, Fraction]:
    schedule: dict[model.TimePoint, Fraction] = {}
    for name, when in times.items():
        pair = when if isinstance(when, tuple) else (when,)
        schedule.update(zip(plan.instance[name].time_points, map(Fraction, pair), strict=True))
    return schedule


def broken(simulation: Simulation) -> list[str]:
    return [violation.obligation for violation in simulation.violations]


def pinned(plan: model.ParametrizedPlan, schedule: dict[model.TimePoint, Fraction]) -> model.ParametrizedPlan:
    """The plan with every time point at its time."""
    times = tuple(at(point, time) for point, time in schedule.items() if point != model.ZERO and point.time is None)
    return replace(plan, constraints=(*plan.constraints, *times))


def windows(plan: model.ParametrizedPlan, schedule: dict[model.TimePoint, Fraction]) -> model.ParametrizedPlan:
    """The plan with every time point at its time, said in a way that leaves all time variables in place."""
    constraints = list(plan.constraints)
    for point, time in schedule.items():
        if point != model.ZERO and point.time is None:
            constraints += [between(model.ZERO, point, time, None), between(model.ZERO, point, None, time)]
    return replace(plan, constraints=tuple(constraints))


# -- refusals ----------------------------------------------------------------------------------------------------------


def error_of(call: Callable[[], object]) -> RobustError | None:
    """The error of the package that the call ends with, if any, in one line; other errors are not caught."""
    raised = None
    try:
        call()
    except RobustError as error:
        raised = error
    assert "\n" not in str(raised)
    return raised


def refused(call: Callable[[], object], place: str, parts: Iterable[str], exit_code: int = 2) -> None:
    """The call fails at that place, with all these parts in its message, and says what was expected."""
    error = error_of(call)
    assert error is not None
    assert str(error).startswith(place), error
    assert [part for part in (*parts, "expected") if part not in str(error)] == [], error
    assert error.exit_code == exit_code


# -- examples ----------------------------------------------------------------------------------------------------------

f, g = value(F), value(G)


class Example(NamedTuple):
    """A plan with the times of its instances, and the obligations that break, in order, some with all that is said."""

    name: str
    plan: model.ParametrizedPlan
    times: Times
    broken: tuple[str | Violation, ...] = ()
    parameters: Mapping[str, Fraction] = {}


def _limited(timing: model.Timing) -> model.ParametrizedPlan:
    return plan_of(
        action("a", model.DurationConstraint(timing, at_most(DURATION - f, 0), "<= (f)"), increase(F, 1)), f=2
    )


UP, DOWN, G_UP = action("u", flow(F, 1)), action("d", flow(F, -1)), action("gu", flow(G, 1))
JUMP_UP, RESET = instant("j", increase(F, 3)), instant("j", assign(F, 0))
STRICT, WEAK = above(f, 0), at_least(f, 0)
ADDER, DELETER, READER = instant("a", add(P)), instant("b", delete(P)), instant("b", (START, model.Holds(P)))
READ, CONTRADICTORY = plan_of(ADDER, READER), plan_of(ADDER, DELETER)
OWN = action("a", (START, model.Holds(P, False)), (END, model.Holds(P)), add(P))
AT_ENDS = (START, equal(f, 0)), (END, equal(f, 4))
JUST_BEFORE = plan_of(action("a", *AT_ENDS, flow(F, 1), increase(F, 10, END)), goal=equal(f, 14))
LEVEL = plan_of(action("a", (END, at_least(f, 6)), flow(F, 2)))
SWAP = plan_of(instant("a", assign(F, g), assign(G, f)), f=1, g=2, goal=model.And((equal(f, 2), equal(g, 1))))
BOTH = instant("a", increase(F, 3), assign(F, 5))
EITHER = instant("a", *(replace(assign(F, 5), condition=model.Holds(atom)) for atom in (P, Q)))
DISAGREES = "effects of a agree"
ONE_TO_THREE = tuple(instant(f"i{n}", increase(F, n)) for n in (1, 2, 3))
ADD_DELETE, DELETE_ADD = instant("a", add(P), delete(P)), instant("a", delete(P), add(P))
NEED_Q = instant("a", add(Q), add(P, START, model.Holds(Q)))
LATE_EFFECT = model.NumericEffect(END, G, model.AssignmentKind.ASSIGN, number(1), at_least(f, 4))
LATE = plan_of(action("a", LATE_EFFECT, flow(F, 2)), goal=at_least(g, 1))
WATCH, NEVER = action("a", (ALL, model.Holds(P))), plan_of(action("a", (ALL, model.Truth(False))))
BY_ITSELF, HELPER = action("a", (ALL, model.Holds(P)), add(P), delete(P, END)), instant("b", add(P))
WATCHED = plan_of(WATCH, DELETER, atoms=(P,))
INTERRUPTED = plan_of(WATCH, DELETER, instant("c", add(P)), atoms=(P,))
STEEP, UP_3, WATCH_ONE = action("d", flow(F, -2)), action("u", flow(F, 3)), action("w", (ALL, at_least(f, 1)))
TOUCHING = plan_of(DOWN, UP, action("w", (ALL, STRICT)), f=1)
HOLE = plan_of(action("a", (ALL, model.Or((above(number(1), f), above(f, 1)))), flow(F, 1)))
PRODUCT = plan_of(action("a", (ALL, at_least(f * g, 0)), flow(F, 1)), g=2)
TIMED = plan_of(action("a", (START, at_least(f, DURATION)), increase(G, DURATION, END)), f=3, goal=at_least(g, 3))
RESTARTED = plan_of(action("a", flow(F, 1)), instant("b", assign(F, 10)), goal=equal(f, 12))
LITERALS = (model.TimedLiteral(Fraction(2), P, True), model.TimedLiteral(Fraction(2), F, Fraction(7)))
LITERALLY = plan_of(instant("a", (START, model.Holds(P)), (START, at_least(f, 7))), literals=LITERALS)
CLOSE = (model.TimedLiteral(Fraction(2), P, False), model.TimedLiteral(Fraction(20001, 10000), P, True))
UNDONE = plan_of(ADDER, goal=model.Holds(P), literals=(model.TimedLiteral(Fraction(9), P, False),))
RATED = action("a", flow(F, reference("k") * g))
BACKWARDS = plan_of(action("a", (ALL, model.Holds(P)), flow(F, 1)), goal=at_least(f, 1))
BRIEF = plan_of(action("a", add(P), (END, model.Holds(P))))

FALLS_SHORT = Violation("a act: at end c0", Fraction(29, 10), "(f) = 5.8 < 6", Fraction(1, 5))
DELETED_AT_START = Violation("a act: over all c0", Fraction(3, 2), "(p) is false")
DELETED_INSIDE = Violation("a act: over all c0", Fraction(2), "(p) is false")
TOUCHED = Violation("w act: over all c0", Fraction(1), "(f) = 0 <= 0", Fraction(0))
TOO_LOW = Violation("w act: over all c0", Fraction(7, 4), "(f) = 0.5 < 1", Fraction(1, 2))
NEITHER = Violation("a act: over all c0", Fraction(1), "1 <= (f) = 1 and (f) = 1 <= 1")
TOO_LONG = Violation("a act: at start c0", Fraction(1), "(f) = 3 < ?duration = 4", Fraction(1))
TOO_LONG_AT_START = Violation("a act: duration <= (f)", Fraction(0), "?duration = 3 > (f) = 2", Fraction(1))
EMPTY = Violation("goal: goal", Fraction(0), "the condition is false")
APART = "a = 1.0005 and b = 1 are 0.0005 apart, less than 0.001"
TOO_CLOSE = Violation("separation: a, b", Fraction(2001, 2000), APART, Fraction(1, 2000))
SLOPES: Times = {"d": (0, 2), "u": (2, 3), "w": (1, 4)}
TOUCH: Times = {"d": (0, 1), "u": (Fraction(11, 10), 2)}
TENTHS = Fraction(11, 10), Fraction(29, 10)

EXAMPLES = [
    # -- reading just before
    Example("an effect at its own time", READ, {"a": 1, "b": 1}, ("b act: c0", "separation: a, b")),
    Example("an earlier effect", READ, {"a": 1, "b": 1 + EPSILON}),
    Example("its own start effect at its end only", plan_of(OWN), {"a": (0, 1)}),
    Example("continuous change up to the end", LEVEL, {"a": (0, 3)}),
    Example("conditions read the state just before", JUST_BEFORE, {"a": (3, 7)}),
    Example("continuous change that falls short", LEVEL, {"a": (0, TENTHS[1])}, (FALLS_SHORT,)),
    Example("simultaneous effects read the state before", SWAP, {"a": 1}),
    Example("an assignment and an increase", plan_of(BOTH), {"a": 1}, (DISAGREES,)),
    Example("two assignments of one value", plan_of(EITHER, atoms=(P, Q)), {"a": 1}, (DISAGREES,)),
    Example("one of two assignments", plan_of(EITHER, atoms=(Q,), goal=equal(f, 5)), {"a": 1}),
    Example("increases at one time", plan_of(*ONE_TO_THREE, goal=equal(f, 6)), {"i1": 1, "i2": 1, "i3": 1}),
    Example("an add wins over a delete", plan_of(ADD_DELETE, goal=model.Holds(P)), {"a": 1}),
    Example("an add wins, from true", plan_of(DELETE_ADD, goal=model.Holds(P), atoms=(P,)), {"a": 1}),
    Example("both by others", plan_of(ADDER, DELETER, goal=model.Holds(P)), {"a": 1, "b": 1}, ("separation: a, b",)),
    Example("a conditional effect without", plan_of(NEED_Q, goal=model.Holds(P)), {"a": 1}, ("goal: goal",)),
    Example("a conditional effect", plan_of(NEED_Q, atoms=(Q,), goal=model.Holds(P)), {"a": 1}),
    Example("a conditional effect at end, enough", LATE, {"a": (0, 2)}),
    Example("a conditional effect at end, too early", LATE, {"a": (0, 1)}, ("goal: goal",)),
    # -- over all
    Example("over all by its own start", plan_of(BY_ITSELF), {"a": (0, 1)}),
    Example("over all, deleted at its start", WATCHED, {"a": (1, 2), "b": 1}, (DELETED_AT_START,)),
    Example("over all, added at its start", plan_of(WATCH, HELPER), {"a": (1, 3), "b": 1}),
    Example("over all, added at its start by the first", plan_of(HELPER, WATCH), {"a": (1, 3), "b": 1}),
    Example("over all, deleted after its end", WATCHED, {"a": (1, 2), "b": 3}),
    Example("over all, deleted inside", INTERRUPTED, {"a": (1, 3), "b": 2, "c": 2 + EPSILON}, (DELETED_INSIDE,)),
    Example("over all of nothing", NEVER, {"a": (1, 1)}),
    Example("over all of less than nothing", NEVER, {"a": (2, 1)}, ("a act: non-negative duration",)),
    Example("over all of something", NEVER, {"a": (1, 2)}, ("a act: over all c0",)),
    Example("a strict bound touched inside", TOUCHING, {**TOUCH, "w": (0, 2)}, (TOUCHED,)),
    Example("a minimum between slopes", plan_of(STEEP, UP_3, WATCH_ONE, f=5), SLOPES),
    Example("a minimum between slopes, too low", plan_of(STEEP, UP_3, WATCH_ONE, f=4), SLOPES, (TOO_LOW,)),
    Example("concurrent flows add up", plan_of(UP_3, DOWN, goal=equal(f, 2)), {"u": (0, 2), "d": (1, 5)}),
    Example("both reasons fail at one instant", HOLE, {"a": (0, 2)}, (NEITHER,)),
    Example("one factor moves", PRODUCT, {"a": (0, 1)}),
    # -- durations and rates
    Example("?duration in conditions and effects", TIMED, {"a": (1, 4)}),
    Example("?duration too long", TIMED, {"a": (1, 5)}, (TOO_LONG,)),
    Example("a duration read at start", _limited(START), {"a": (0, 3)}, (TOO_LONG_AT_START,)),
    Example("a duration read at end", _limited(END), {"a": (0, 3)}),
    Example("mutex ends", BRIEF, {"a": (1, 1)}, ("a act: at end c1", "separation: a.start, a.end")),
    Example("ends that are not mutex", plan_of(action("a", add(P))), {"a": (1, 1)}),
    Example("a negative duration", BACKWARDS, {"a": (5, 3)}, ("a act: non-negative duration", "goal: goal")),
    Example("an assignment restarts a moving fluent", RESTARTED, {"a": (0, 5), "b": 3}),
    Example(
        "a rate over a parameter and a fluent",
        plan_of(RATED, g=2, goal=equal(f, 12), parameters=(model.Parameter("k", Fraction(1)),)),
        {"a": (0, 2)},
        parameters={"k": Fraction(3)},
    ),
    # -- timed literals, goals and separation
    Example("timed literals", LITERALLY, {"a": 3}),
    Example("before timed literals", LITERALLY, {"a": 1}, ("a act: c0", "a act: c1")),
    Example("timed literals close to each other", plan_of(atoms=(P,), literals=CLOSE, goal=model.Holds(P)), {}),
    Example("a goal undone by a literal", UNDONE, {"a": 1}, ("goal: goal",)),
    Example("a goal of nothing done", plan_of(goal=model.Holds(P, False)), {}),
    Example("a goal that was true", plan_of(goal=model.Holds(P), atoms=(P,)), {}),
    Example("an empty disjunction", plan_of(goal=model.Or(())), {}, (EMPTY,)),
    Example("apart by epsilon", CONTRADICTORY, {"a": 1 + EPSILON, "b": 1}),
    Example("apart by less", CONTRADICTORY, {"a": 1 + EPSILON / 2, "b": 1}, (TOO_CLOSE,)),
]


# -- over-all conditions where they are delicate -----------------------------------------------------------------------


class Case(NamedTuple):
    """What i requires over all between 2 and 6, the others with their times, whether it holds, and f at first."""

    name: str
    condition: model.Condition
    others: Mapping[model.ActionInstance, int | tuple[int, int]]
    holds: bool
    f: int = 0


OVER_ALL = [
    Case("strict bound touched at the open end", STRICT, {DOWN: (2, 6)}, True, 4),
    Case("strict bound touched at the open start", STRICT, {UP: (2, 6)}, True),
    Case("strict bound touched at both ends only", STRICT, {UP: (2, 4), DOWN: (4, 6)}, True),
    Case("strict bound touched inside", STRICT, {DOWN: (2, 4), UP: (4, 6)}, False, 2),
    Case("bound touched inside", WEAK, {DOWN: (2, 4), UP: (4, 6)}, True, 2),
    Case("bound crossed inside and back", WEAK, {DOWN: (2, 4), UP: (4, 6)}, False, 1),
    Case("bound crossed just before the end", WEAK, {DOWN: (2, 7)}, False, 3),
    Case("bound left just after the end", WEAK, {DOWN: (2, 7)}, True, 4),
    Case("flat at a strict bound", STRICT, {DOWN: (6, 7)}, False),
    Case("flat at a bound", WEAK, {DOWN: (6, 7)}, True),
    Case("flat at a strict bound, then up", STRICT, {UP: (4, 7)}, False),
    Case("up from a strict bound, then flat above", STRICT, {UP: (2, 4)}, True),
    Case("down to a strict bound, then flat", STRICT, {DOWN: (2, 5)}, False, 3),
    Case("two flows that cancel, at a strict bound", STRICT, {UP: (2, 6), DOWN: (2, 6)}, False),
    Case("two flows that cancel inside, at a strict bound", STRICT, {UP: (3, 5), DOWN: (3, 5)}, False),
    Case("a flow of rate 0 inside, at a strict bound", STRICT, {action("z", flow(F, 0)): (3, 7)}, False),
    Case("the slope only drops inside", STRICT, {action("u", flow(F, 2)): (1, 4), DOWN: (3, 6)}, True),
    Case("one falls when another stops rising", WEAK, {UP: (2, 4), DOWN: (4, 7)}, True),
    Case("a jump up at a bound that was touched", STRICT, {DOWN: (2, 4), JUMP_UP: 4}, False, 2),
    Case("a jump up in time", STRICT, {DOWN: (2, 6), JUMP_UP: 3}, True, 2),
    Case("a jump down to the bound, then up", STRICT, {UP: (1, 7), RESET: 4}, False, 5),
    Case("a jump down to the bound at the end", STRICT, {UP: (1, 7), RESET: 6}, True, 5),
    Case("a jump down to the bound at the start", STRICT, {UP: (1, 7), RESET: 2}, True, 5),
    Case("a jump below at the start", WEAK, {UP: (1, 7), instant("j", assign(F, -1)): 2}, False, 5),
    Case("equal throughout", equal(f, 2), {UP: (1, 2)}, True, 1),
    Case("equal at both ends only", equal(f, 0), {UP: (2, 4), DOWN: (4, 6)}, False),
    Case("different but for one instant", different(f, 2), {UP: (2, 6)}, False),
    Case("different but at the end", different(f, 4), {UP: (2, 6)}, True),
    Case("different but at the start", different(f, 0), {UP: (2, 6)}, True),
    Case("one of two, without a gap", model.Or((at_least(f, 2), at_least(-f, -2))), {UP: (2, 6)}, True),
    Case("one of two, but for one instant", model.Or((above(f, 2), above(-f, -2))), {UP: (2, 6)}, False),
    Case("one of two, with a gap inside", model.Or((at_least(f, 3), at_least(-f, -2))), {UP: (2, 6)}, False),
    Case("both of two", model.And((STRICT, above(-f, -4))), {UP: (2, 6)}, True),
    Case("two fluents, one just in time", model.Or((STRICT, above(g, 0))), {DOWN: (2, 5), G_UP: (4, 6)}, True, 3),
    Case("two fluents, one in good time", model.Or((STRICT, above(g, 0))), {DOWN: (2, 6), G_UP: (3, 6)}, True, 2),
    Case(
        "two fluents, both at the bound once", model.Or((STRICT, above(g, 0))), {DOWN: (2, 4), G_UP: (4, 6)}, False, 2
    ),
    Case("an atom helps where the fluent fails", model.Or((STRICT, model.Holds(P))), {DOWN: (2, 5), ADDER: 4}, True, 3),
    Case("an atom comes when the fluent fails", model.Or((STRICT, model.Holds(P))), {DOWN: (2, 4), ADDER: 4}, False, 2),
    Case(
        "an atom comes when the fluent still holds", model.Or((WEAK, model.Holds(P))), {DOWN: (2, 5), ADDER: 4}, True, 2
    ),
    Case("an atom is deleted and added at once", model.Holds(P), {ADDER: 2, DELETER: 6}, True),
    Case("an atom is deleted inside", model.Holds(P), {ADDER: 1, DELETER: 4, instant("c", add(P)): 5}, False),
    Case("elapsed time counts, not the clock", at_least(f - DURATION, 0), {UP: (2, 6)}, True, 4),
]


def delicate(case: Case) -> tuple[model.ParametrizedPlan, Times]:
    """The plan and the times of a case."""
    times = {instance.identifier: when for instance, when in case.others.items()}
    return plan_of(action("i", (ALL, case.condition)), *case.others, f=case.f), {"i": (2, 6), **times}


# -- texts -------------------------------------------------------------------------------------------------------------

TEXTS = Path(__file__).parent / "texts"
EVERYTHING, TOUR = ((TEXTS / f"{name}.pddl").read_text(encoding="utf-8") for name in ("everything", "tour"))
"""A domain and a problem that use every construct."""


def groups(path: Path) -> dict[str, str]:
    """The parts of a file of texts, each below its headline `== NAME`."""
    _, *parts = re.split(r"^== (.*)\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {headline: text.rstrip("\n") for headline, text in zip(parts[::2], parts[1::2], strict=True)}
