"""Short ways to write plans, and schedules whose outcome is known by hand [docs/semantics.md]."""

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from robust.errors import RobustError
from robust.plan import model
from robust.plan.pddl.grounding import ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Simulation, Violation, simulate
from tests.sampling import often

P, Q = model.Atom("p"), model.Atom("q")
F, G = model.Fluent("f"), model.Fluent("g")
START, END, ALL = model.Timing.AT_START, model.Timing.AT_END, model.Timing.OVER_ALL
DURATION: model.Expression = Polynomial.variable(model.Duration())
EPSILON = Fraction(1, 1000)
TRUE = model.Truth(True)
RANDOM = st.randoms(use_true_random=True)
value, number = Polynomial.variable, Polynomial.constant
Amount = model.Expression | Fraction | int


def drawn(quick: int, thorough: int | None = None) -> settings:
    """Repeatable examples, however long it takes to draw them; others and more of them where slow tests run as well."""
    count = quick if thorough is None else often(quick, thorough)
    repeatable = count == quick
    return settings(max_examples=count, deadline=None, derandomize=repeatable, suppress_health_check=list(HealthCheck))


def reference(name: str) -> model.Expression:
    """The parameter of that name."""
    return Polynomial.variable(model.ParameterReference(name))


def expression_of(amount: Amount) -> model.Expression:
    return amount if isinstance(amount, Polynomial) else number(amount)


def compared(relation: model.Relation, left: Amount, right: Amount) -> model.NumericCondition:
    return model.NumericCondition(expression_of(left) - expression_of(right), relation)


at_least, above, equal, different = (
    partial(compared, getattr(model.Relation, name)) for name in ("AT_LEAST", "GREATER", "EQUAL", "DIFFERENT")
)


def at_most(left: Amount, right: Amount) -> model.NumericCondition:
    return at_least(right, left)


def add(atom, timing=START, condition=TRUE, value=True):
    return model.AtomEffect(timing, atom, value, condition)


def assign(fluent, amount, timing=START, kind=model.AssignmentKind.ASSIGN):
    return model.NumericEffect(timing, fluent, kind, expression_of(amount))


delete, increase = partial(add, value=False), partial(assign, kind=model.AssignmentKind.INCREASE)


def flow(fluent: model.Fluent, rate: Amount) -> model.ContinuousEffect:
    return model.ContinuousEffect(fluent, expression_of(rate))


def between(source, target, lower=None, upper=None):
    bounds = (None if bound is None else expression_of(bound) for bound in (lower, upper))
    return model.TemporalConstraint(source, target, *bounds)


def at(point: model.TimePoint, time: Amount) -> model.TemporalConstraint:
    return between(model.ZERO, point, time, time)


def action(name: str, *pieces: object, durative: bool = True) -> model.ActionInstance:
    """An action of conditions with their timing, effects and duration constraints."""

    kinds = model.DurationConstraint, model.AtomEffect, model.NumericEffect, model.ContinuousEffect
    durations, *effects = (tuple(piece for piece in pieces if isinstance(piece, kind)) for kind in kinds)
    conditions = [model.TimedCondition(*p, f"c{i}") for i, p in enumerate(pieces) if isinstance(p, tuple)]
    return model.ActionInstance(name, "act", (), durative, durations, tuple(conditions), *effects)


def instant(name: str, *pieces: object) -> model.ActionInstance:
    return action(name, *pieces, durative=False)


def plan_of(*instances, atoms=(), f=0, g=0, goal=None, literals=(), constraints=(), parameters=()):
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


def pinned(plan, schedule, bounds=({"lower", "upper"},)) -> model.ParametrizedPlan:
    """The plan with every time point at its time."""
    points = [(point, time) for point, time in schedule.items() if point != model.ZERO and point.time is None]
    times = (between(model.ZERO, p, **dict.fromkeys(ends, time)) for p, time in points for ends in bounds)
    return replace(plan, constraints=(*plan.constraints, *times))


def windows(plan, schedule) -> model.ParametrizedPlan:
    """The plan with every time point at its time, said in a way that leaves all time variables in place."""
    return pinned(plan, schedule, (["lower"], ["upper"]))


def error_of(call: Callable[[], object]) -> RobustError | None:
    """The error of the package that the call ends with, if any, in one line; other errors are not caught."""
    try:
        call()
    except RobustError as error:
        assert "\n" not in str(error)  # noqa: PT017
        return error
    return None


def refused(call: Callable[[], object], place: str, parts: Iterable[str], exit_code: int = 2) -> None:
    """The call fails at that place, with all these parts in its message, and says what was expected."""
    error = error_of(call)
    assert error is not None
    assert str(error).startswith(place), error
    assert [part for part in (*parts, "expected") if part not in str(error)] == [], error
    assert error.exit_code == exit_code


f, g = value(F), value(G)


class Example(NamedTuple):
    """A plan with the times of its instances, and the obligations that break, in order, some with all that is said."""

    plan: model.ParametrizedPlan
    times: Times
    broken: tuple[str | Violation, ...]
    parameters: Mapping[str, Fraction]


UP, DOWN, G_UP = action("u", flow(F, 1)), action("d", flow(F, -1)), action("gu", flow(G, 1))
JUMP_UP, RESET = instant("j", increase(F, 3)), instant("j", assign(F, 0))
STRICT, ADDER, DELETER = above(f, 0), instant("a", add(P)), instant("b", delete(P))
CONTRADICTORY = plan_of(ADDER, DELETER)
TEXTS = Path(__file__).parent / "texts"
EVERYTHING, TOUR = ((TEXTS / f"{name}.pddl").read_text(encoding="utf-8") for name in ("everything", "tour"))
"""A domain and a problem that use every construct."""
BELOW, STEEPLY, FLAT = instant("j", assign(F, -1)), action("u", flow(F, 2)), action("z", flow(F, 0))
OTHERS = {"d": DOWN, "u": UP, "gu": G_UP, "steep": STEEPLY, "flat": FLAT, "j": JUMP_UP, "reset": RESET, "below": BELOW}
OTHERS |= {"a": ADDER, "b": DELETER, "c": instant("c", add(P))}


def groups(path: Path) -> dict[str, str]:
    """The parts of a file of texts, each below its headline `== NAME`."""
    _, *parts = re.split(r"^== (.*)\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {headline: text.rstrip("\n") for headline, text in zip(parts[::2], parts[1::2], strict=True)}


def joined(conditions: Iterable[model.Condition]) -> model.Condition | None:
    parts = tuple(conditions)
    return model.And(parts) if len(parts) > 1 else parts[0] if parts else None


def read_plan(actions: str, init="", goal="()", times="", **options: Any) -> model.ParametrizedPlan:
    """A plan of one instance of each action, its conditions named by numbers; times: `SOURCE TARGET LOWER UPPER, …`."""
    declared = "(:predicates (p) (q)) (:functions (f) (g)) (:synth-parameters ?k)"
    domain = parse_domain(f"(define (domain d) {declared} {actions})")
    problem = parse_problem(f"(define (problem x) (:domain d) (:init {init}) (:goal {goal}))", domain)
    instances = []
    for name, schema in domain.actions.items():
        ground = ground_action(domain, problem, name, name, [], schema.durative, None)
        conditions = tuple(replace(timed, text=f"c{i}") for i, timed in enumerate(ground.conditions))
        instances.append(replace(ground, action="act", conditions=conditions))
    goal = joined(part.condition for part in ground_goal(domain, problem))
    plan = plan_of(*instances, atoms=problem.atoms, literals=problem.timed_literals, goal=goal, **options)
    fluents = {fluent: number(amount) for fluent, amount in problem.fluents.items()}
    points, constraints = {str(point): point for point in plan.time_points}, []
    for source, target, *ends in map(str.split, times.split(", ") if times else ()):
        bounds = (None if end == "-" else Fraction(end) for end in ends)
        constraints.append(between(points[source], points[target], *bounds))
    return replace(plan, initial_fluents=plan.initial_fluents | fluents, constraints=tuple(constraints))


def times_of(text: str) -> Times:
    times = {name: tuple(map(Fraction, when)) for name, *when in map(str.split, text.split(", ") if text else ())}
    return {name: when if len(when) == 2 else when[0] for name, when in times.items()}


def example(text: str) -> Example:
    said: defaultdict[str, list[str]] = defaultdict(list)
    for line in text.splitlines():
        word, _, rest = line.partition(" ")
        said["actions" if line[0] == "(" else word].append(line if line[0] == "(" else rest)
    violations = []
    for name, *details in (line.split(" | ") for line in said["breaks"]):
        time, detail, amount = details or (None,) * 3
        amount = None if amount in {None, "None"} else Fraction(amount)
        violations.append(Violation(name, Fraction(time), detail, amount) if time else name)
    values = {name: Fraction(number) for name, number in map(str.split, said["parameter"])}
    parts = " ".join(said["actions"]), " ".join(said["init"]), *said["goal"]
    plan = read_plan(*parts, parameters=tuple(model.Parameter(name, Fraction(1)) for name in values))
    return Example(plan, times_of(*said["times"]), tuple(violations), values)


def delicate(case: str) -> tuple[model.ParametrizedPlan, Times, bool]:
    """What i requires over all from 2 to 6, the others with their times, whether it holds, and f at first."""
    _, condition, others, verdict, level = case.split(" | ")
    required = read_plan(f"(:durative-action i :duration () :condition (over all {condition}))").instances[0].conditions
    condition = joined(timed.condition for timed in required)
    times = times_of(others)
    instances = [action("i", (ALL, condition)), *map(OTHERS.get, times)]
    named = {instance.identifier: when for instance, when in zip(instances[1:], times.values(), strict=True)}
    return plan_of(*instances, f=int(level)), {"i": (2, 6), **named}, verdict == "holds"


EXAMPLES = {name: example(text) for name, text in groups(TEXTS / "examples.txt").items()}
EMPTY = Violation("goal: goal", Fraction(0), "the condition is false")
EXAMPLES["an empty disjunction"] = Example(plan_of(goal=model.Or(())), {}, (EMPTY,), {})
BOTH = plan_of(instant("a", increase(F, 3), assign(F, 5)))
EXAMPLES["an assignment and an increase, which no text may say"] = Example(BOTH, {"a": 1}, ("effects of a agree",), {})
OVER_ALL = (TEXTS / "over_all.txt").read_text(encoding="utf-8").splitlines()
