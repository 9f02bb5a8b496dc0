"""The concrete simulator: what becomes of one schedule of a plan, exactly, and why [docs/semantics.md].

Mutex pairs follow PDDL 2.1's rule of no moving targets. Reads are all that a text mentions, even where it cancels;
over-all conditions do not count. A continuous effect increases its fluent at both ends of its action and its rate is
read there. A time point that adds and deletes the same atom does both.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import combinations, islice, pairwise
from typing import assert_never

from robust.errors import InputError, did_you_mean
from robust.numbers import format_number
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.timeline import Happening, Reading, State, TimedExecution, over_time
from robust.presented import NoTruthValue


@dataclass(slots=True)
class _Footprint:
    """What one time point reads and writes."""

    reads: set[model.Atom | model.Fluent] = field(default_factory=set)
    adds: set[model.Atom] = field(default_factory=set)
    deletes: set[model.Atom] = field(default_factory=set)
    assigns: set[model.Fluent] = field(default_factory=set)
    increases: set[model.Fluent] = field(default_factory=set)

    @property
    def names(self) -> set[model.Atom | model.Fluent]:
        """All that is touched."""
        return self.reads | self.adds | self.deletes | self.assigns | self.increases

    def read(self, condition: model.Condition) -> None:
        for leaf in model.leaves(condition):
            if isinstance(leaf, model.Holds):
                self.reads.add(leaf.atom)
            elif isinstance(leaf, model.NumericCondition):
                self.reads.update(model.fluents_in(leaf.expression))


def mutex_pairs(plan: model.ParametrizedPlan) -> Iterator[tuple[model.TimePoint, model.TimePoint]]:
    """The pairs of distinct time points that must be separated, each in the order of `plan.time_points`.

    Neither is zero, and timed literals are not mutex among themselves.
    """
    touching: dict[model.Atom | model.Fluent, list[int]] = {}
    footprints = _footprints(plan)
    points = list(footprints)
    for number, footprint in enumerate(footprints.values()):
        for name in footprint.names:
            touching.setdefault(name, []).append(number)
    candidates = {pair for numbers in touching.values() for pair in combinations(numbers, 2)}
    for a, b in sorted(candidates):
        if _is_mutex((points[a], footprints[points[a]]), (points[b], footprints[points[b]])):
            yield points[a], points[b]


def _footprints(plan: model.ParametrizedPlan) -> dict[model.TimePoint, _Footprint]:
    footprints = {point: _Footprint() for point in plan.time_points if point != model.ZERO}
    for instance in plan.instances:
        for point in instance.time_points:
            _enter_instance(footprints[point], instance, point)
    for literal in plan.timed_literals:
        footprint = footprints[literal.point]
        if isinstance(literal.target, model.Fluent):
            footprint.assigns.add(literal.target)
        else:
            (footprint.adds if literal.value else footprint.deletes).add(literal.target)
    return footprints


def _is_mutex(a: tuple[model.TimePoint, _Footprint], b: tuple[model.TimePoint, _Footprint]) -> bool:
    both_timed = a[0].kind is b[0].kind is model.TimePointKind.TIMED_LITERAL
    return not both_timed and (_disturbs(a[1], b[1]) or _disturbs(b[1], a[1]))


def _enter_instance(footprint: _Footprint, instance: model.ActionInstance, point: model.TimePoint) -> None:
    """Add what `instance` reads and writes at `point`, its start or its end."""
    parts: tuple[model.DurationConstraint | model.TimedCondition, ...] = (*instance.durations, *instance.conditions)
    for part in parts:
        if part.timing is not model.Timing.OVER_ALL and instance.at(part.timing) == point:
            footprint.read(part.condition)
    for atom_effect in instance.atom_effects:
        if instance.at(atom_effect.timing) == point:
            footprint.read(atom_effect.condition)
            (footprint.adds if atom_effect.value else footprint.deletes).add(atom_effect.atom)
    for effect in instance.numeric_effects:
        if instance.at(effect.timing) == point:
            footprint.read(effect.condition)
            footprint.reads.update(model.fluents_in(effect.expression))
            assigns = effect.operator is model.AssignmentKind.ASSIGN
            (footprint.assigns if assigns else footprint.increases).add(effect.fluent)
    for continuous in instance.continuous_effects:
        footprint.reads.update(model.fluents_in(continuous.rate))
        footprint.increases.add(continuous.fluent)
    footprint.reads.update(name for name, where in instance.mentioned() if where == point)


def _disturbs(writer: _Footprint, other: _Footprint) -> bool:
    """Whether what `writer` writes touches what `other` reads or writes (the half of the rule seen from one side)."""
    return bool(
        (writer.adds | writer.deletes | writer.assigns | writer.increases) & other.reads
        or writer.adds & other.deletes
        or writer.assigns & (other.assigns | other.increases)
    )


_VIOLATED = {
    model.Relation.AT_LEAST: "<",
    model.Relation.GREATER: "<=",
    model.Relation.EQUAL: "!=",
    model.Relation.DIFFERENT: "=",
}


@dataclass(frozen=True, slots=True)
class Violation:
    """A broken obligation of a schedule: its label, a time at which it is broken, and why, with actual values.

    `amount` is how far a number is from what is demanded; None where no single number decides. `since` is when it
    begins to be broken, which may be just before any time at which it is.
    """

    obligation: str
    time: Fraction
    detail: str
    amount: Fraction | None = None
    since: Fraction | None = None


@dataclass(frozen=True, slots=True)
class TraceStep:
    """One happening: its time points, the atoms that it changed, and the fluents that changed since the last step.

    `fluents` are values right after the happening and include continuous change; the first step lists all fluents.
    """

    time: Fraction
    points: tuple[model.TimePoint, ...]
    atoms_changed: tuple[tuple[model.Atom, bool], ...]
    fluents: Mapping[model.Fluent, Fraction]


@dataclass(frozen=True)
class Simulation(NoTruthValue, ask="valid"):
    """What became of one schedule.

    `network_violations` say why the schedule is not one that the plan allows (its preconditions, `enc_tn`);
    `violations` are the broken obligations (`enc_proofs`). Both are computed in any case.
    """

    trace: tuple[TraceStep, ...]
    violations: tuple[Violation, ...]
    network_violations: tuple[str, ...]

    @property
    def constants(self) -> frozenset[model.Fluent]:
        """Fluents that never change: distances and the like. What breaks is said with their values."""
        first, *later = self.trace
        changing = {fluent for step in later for fluent in step.fluents}
        return frozenset(fluent for fluent in first.fluents if fluent not in changing)

    @property
    def valid(self) -> bool:
        """The schedule is allowed and breaks no obligation."""
        return not self.violations and not self.network_violations


def simulate(
    plan: model.ParametrizedPlan,
    parameters: Mapping[str, Fraction],
    schedule: Mapping[model.TimePoint, Fraction],
    *,
    epsilon: Fraction = Fraction(1, 1000),
) -> Simulation:
    """Execute `plan` with the given parameter values at the given times.

    `schedule` gives every time point its time; zero (0) and timed literals (their own time) may be left out. `epsilon`
    is the separation of mutex time points, in the plan's unit of time; if it is 0 they are at different times.

    Raises InputError if a parameter or time point is missing or unknown, or a fluent is read that has no value;
    UnsupportedError if an over-all condition is not linear in time between two happenings or a rate is not constant.
    """
    _check_names({parameter.name for parameter in plan.parameters}, set(parameters), "parameter")
    execution = TimedExecution(plan, parameters, _times(plan, schedule))
    violations = tuple(violations_of(execution, epsilon))
    return Simulation(tuple(_trace(execution.happenings)), violations, tuple(_network_violations(execution)))


def violations_of(execution: TimedExecution, epsilon: Fraction) -> Iterator[Violation]:
    """The broken obligations of an execution.

    Raises:
        UnsupportedError: as :func:`simulate`.
    """
    for instance in execution.plan.instances:
        yield from _instance_violations(execution, instance)
    yield from _separation_violations(execution.plan, execution.times, epsilon)
    yield from _goal_violations(execution)


def _times(
    plan: model.ParametrizedPlan, schedule: Mapping[model.TimePoint, Fraction]
) -> dict[model.TimePoint, Fraction]:
    times = {model.ZERO: Fraction(0)}
    times.update({literal.point: literal.time for literal in plan.timed_literals})
    times.update(schedule)
    _check_names({str(point) for point in plan.time_points}, {str(point) for point in times}, "time point")
    return times


def _check_names(expected: set[str], found: set[str], kind: str) -> None:
    for name in sorted(found - expected):
        raise InputError(f"unknown {kind} '{name}'{did_you_mean(name, expected)}")
    for name in sorted(expected - found):
        raise InputError(f"no value for {kind} '{name}'; give every {kind} of the plan a value")


def _network_violations(execution: TimedExecution) -> Iterator[str]:
    """Why the schedule and the parameter values are not among those that the plan allows."""
    times = execution.times
    if times[model.ZERO] != 0:
        yield f"{model.ZERO} = {format_number(times[model.ZERO])}, expected 0"
    for point in execution.plan.time_points:
        if times[point] < 0:
            yield f"{point} = {format_number(times[point])} < 0"
        if point.time is not None and times[point] != point.time:
            yield f"{point} = {format_number(times[point])}, expected {format_number(point.time)}"
    for parameter in execution.plan.parameters:
        value = execution.parameters[parameter.name]
        found = f"parameter {parameter.name} = {format_number(value)}"
        if parameter.lower is not None and value < parameter.lower:
            yield f"{found} < lower bound {format_number(parameter.lower)}"
        if parameter.upper is not None and value > parameter.upper:
            yield f"{found} > upper bound {format_number(parameter.upper)}"
    reading = execution.reading(State(frozenset(), {}))
    for constraint in execution.plan.constraints:
        yield from _constraint_violations(constraint, times, reading)


def _constraint_violations(
    constraint: model.TemporalConstraint, times: Mapping[model.TimePoint, Fraction], reading: Reading
) -> Iterator[str]:
    distance = times[constraint.target] - times[constraint.source]
    found = f"{constraint.target} - {constraint.source} = {format_number(distance)}"
    if constraint.lower is not None and distance < reading.expression(constraint.lower):
        yield f"{found} < {_side(constraint.lower, reading)}"
    if constraint.upper is not None and distance > reading.expression(constraint.upper):
        yield f"{found} > {_side(constraint.upper, reading)}"


def _instance_violations(execution: TimedExecution, instance: model.ActionInstance) -> Iterator[Violation]:
    """Duration constraints, non-negative duration, effects that disagree and all conditions of one instance."""
    duration = execution.duration(instance)
    if duration < 0:
        label = f"{instance.identifier} {instance.action}: non-negative duration"
        detail = f"?duration = {format_number(duration)} < 0"
        yield Violation(label, execution.times[instance.end], detail, -duration)
    for constraint in instance.durations:
        yield from _duration_violation(execution, instance, constraint)
    for point in instance.time_points:
        details = [text for where, text in execution.disagreements if where == point]
        if details:
            yield Violation(f"effects of {point} agree", execution.times[point], ", ".join(details))
    for part in instance.conditions:
        if part.timing is model.Timing.OVER_ALL:
            yield from _over_all_violation(execution, instance, part)
        else:
            point = instance.at(part.timing)
            reading = execution.reading(execution.before(point), instance)
            yield from _violation(instance.label(part), execution.times[point], part.condition, reading)


def _duration_violation(
    execution: TimedExecution, instance: model.ActionInstance, part: model.DurationConstraint
) -> Iterator[Violation]:
    """The duration, and on the other side of the comparison what bounds it."""
    point = instance.at(part.timing)
    reading = execution.reading(execution.before(point), instance)
    expression, relation = part.condition.expression, part.condition.relation
    value = reading.expression(expression)
    if not relation.holds(value):
        duration: model.Expression = Polynomial.variable(model.Duration())
        factor = expression.terms[(model.Duration(),)]
        bound, violated = duration - expression.scaled(1 / factor), _VIOLATED[relation]
        violated = violated if factor > 0 else violated.replace("<", ">")
        detail = f"{_side(duration, reading)} {violated} {_side(bound, reading)}"
        yield Violation(instance.label(part), execution.times[point], detail, abs(value / factor))


def _over_all_violation(
    execution: TimedExecution, instance: model.ActionInstance, part: model.TimedCondition
) -> Iterator[Violation]:
    """The first tested instant of the open interval (start, end) at which the condition does not hold, if any."""
    label = instance.label(part)
    violations = (
        replace(violation, since=since)
        for since, time, state in _instants(execution, instance, part.condition)
        for violation in _violation(label, time, part.condition, execution.reading(state, instance))
    )
    yield from islice(violations, 1)


def _instants(
    execution: TimedExecution, instance: model.ActionInstance, condition: model.Condition
) -> Iterator[tuple[Fraction, Fraction, State]]:
    """Instants of (start, end) that decide an over-all condition, with the state at each, in order of time.

    Before each stands since when what it says is so.

    Between two happenings all comparisons have constant truth between the roots of their expressions, so the roots and
    one instant between any two neighbours decide. The states just before and just after a happening inside the interval
    belong to it; the limits at start and at end do not.
    """
    start, end = execution.times[instance.start], execution.times[instance.end]
    may_move = any(isinstance(leaf, model.NumericCondition) for leaf in model.leaves(condition))
    for happening, following in execution.steps(start, end):
        if happening.time > start:
            yield happening.time, happening.time, happening.after
            if not may_move:
                continue
        reading = execution.reading(happening.after, instance)
        for since, time in _interior_instants(reading, happening, following, condition):
            yield since, time, happening.just_before(time)
        if following.time < end:
            yield following.time, following.time, following.before


def _interior_instants(
    reading: Reading, happening: Happening, following: Happening, condition: model.Condition
) -> Iterator[tuple[Fraction, Fraction]]:
    """Between two happenings: every root of a comparison, and one instant in each of the intervals that they leave.

    Each comes after the root, or the beginning of the interval.
    """
    roots: set[Fraction] = set()
    for comparison in model.comparisons(condition):
        value, slope = over_time(comparison.expression, reading, happening.slopes)
        if slope:
            roots.add(happening.time - value / slope)
    borders = [happening.time, *sorted(r for r in roots if happening.time < r < following.time), following.time]
    for left, right in pairwise(borders):
        if left != happening.time:
            yield left, left
        yield left, (left + right) / 2


def _separation_violations(
    plan: model.ParametrizedPlan, times: Mapping[model.TimePoint, Fraction], epsilon: Fraction
) -> Iterator[Violation]:
    footprints = _footprints(plan)
    rank = {point: number for number, point in enumerate(footprints)}
    ordered = sorted(footprints, key=times.__getitem__)
    near: list[tuple[int, int, model.TimePoint, model.TimePoint]] = []
    for index, early in enumerate(ordered):
        for late in ordered[index + 1 :]:
            if times[late] - times[early] >= epsilon and times[late] > times[early]:
                break
            if _is_mutex((early, footprints[early]), (late, footprints[late])):
                a, b = sorted((early, late), key=rank.__getitem__)
                near.append((rank[a], rank[b], a, b))
    for _, _, a, b in sorted(near):
        distance = abs(times[a] - times[b])
        found = f"{a} = {format_number(times[a])} and {b} = {format_number(times[b])}"
        detail = f"{found} are {format_number(distance)} apart, less than {format_number(epsilon)}"
        if not epsilon:
            detail = f"{found} are at the same time"
        yield Violation(f"separation: {a}, {b}", max(times[a], times[b]), detail, epsilon - distance or None)


def _goal_violations(execution: TimedExecution) -> Iterator[Violation]:
    final = execution.happenings[-1]
    for goal in execution.plan.goal:
        yield from _violation(goal.label, final.time, goal.condition, execution.reading(final.after))


def _violation(label: str, time: Fraction, condition: model.Condition, reading: Reading) -> Iterator[Violation]:
    """Why the condition does not hold, with actual values; nothing if it does."""
    failures = reading.failures(condition)
    if failures:
        detail = " and ".join(dict.fromkeys(_reason(leaf, reading) for leaf in failures))
        yield Violation(label, time, detail, _amount(failures, reading))


def _amount(failures: tuple[model.Leaf, ...], reading: Reading) -> Fraction | None:
    match failures:
        case (model.NumericCondition(expression, relation),) if relation is not model.Relation.DIFFERENT:
            return abs(reading.expression(expression))
    return None


def _reason(leaf: model.Leaf, reading: Reading) -> str:
    match leaf:
        case model.Truth():
            return "the condition is false"
        case model.Holds(atom, value):
            return f"{atom} is {'false' if value else 'true'}"
        case model.NumericCondition(expression, relation):
            left = {monomial: factor for monomial, factor in expression.terms.items() if factor > 0}
            right = {monomial: -factor for monomial, factor in expression.terms.items() if factor < 0}
            return f"{_side(Polynomial(left), reading)} {_VIOLATED[relation]} {_side(Polynomial(right), reading)}"
    assert_never(leaf)


def _side(expression: model.Expression, reading: Reading) -> str:
    """One side of a comparison, with its value unless it is a number."""
    value = format_number(reading.expression(expression))
    return value if expression.is_constant else f"{expression} = {value}"


def _trace(happenings: tuple[Happening, ...]) -> Iterator[TraceStep]:
    known: Mapping[model.Fluent, Fraction] = {}
    for happening in happenings:
        before, after = happening.before.atoms, happening.after
        changed = tuple((atom, atom in after.atoms) for atom in sorted(before ^ after.atoms))
        fluents = {fluent: value for fluent, value in after.fluents.items() if known.get(fluent) != value}
        yield TraceStep(happening.time, happening.points, changed, fluents)
        known = after.fluents
