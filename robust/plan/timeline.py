"""The states that one concrete schedule of a plan passes through, exactly [docs/semantics.md; PDDL 2.1].

Part of the concrete simulator (:mod:`robust.plan.simulate`). Time points with equal times form one happening: all their
effects read the state just before it and take place together. Between two happenings every fluent is linear in time.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NoReturn, assert_never

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.numbers import format_number
from robust.plan import model
from robust.plan.polynomial import Polynomial


@dataclass(frozen=True, slots=True)
class State:
    """The true atoms and the values of the fluents that have one."""

    atoms: frozenset[model.Atom]
    fluents: Mapping[model.Fluent, Fraction]


@dataclass(frozen=True, slots=True)
class Happening:
    """All that happens at one time; `slopes` are the changes per unit of time until the next happening."""

    time: Fraction
    points: tuple[model.TimePoint, ...]
    before: State
    after: State
    slopes: Mapping[model.Fluent, Fraction]

    def just_before(self, time: Fraction) -> State:
        """The state at `time`, between this happening and the next, before any effect at `time`."""
        if not self.slopes:
            return self.after
        fluents = dict(self.after.fluents)
        for fluent, slope in self.slopes.items():
            fluents[fluent] += slope * (time - self.time)
        return State(self.after.atoms, fluents)


@dataclass(frozen=True, slots=True)
class Reading:
    """Evaluates expressions and conditions in one state, under parameter values, for an instance of known duration.

    `duration` is None where `?duration` has no meaning (goals, initial values). Raises InputError for a fluent without
    a value, an unknown parameter and a `?duration` without meaning.
    """

    state: State
    parameters: Mapping[str, Fraction]
    duration: Fraction | None = None

    def variable(self, variable: model.NumericVariable) -> Fraction:
        match variable:
            case model.Fluent():
                value = self.state.fluents.get(variable)
            case model.ParameterReference(name):
                value = self.parameters.get(name)
            case model.Duration():
                value = self.duration
            case _:
                assert_never(variable)
        return self._unknown(variable) if value is None else value

    def _unknown(self, variable: model.NumericVariable) -> NoReturn:
        match variable:
            case model.Fluent():
                what, remedy = f"numeric fluent {variable}", "give it one in :init"
            case model.ParameterReference(name):
                what, remedy = f"parameter '{name}'", f"pass a value for it{did_you_mean(name, self.parameters)}"
            case model.Duration():
                what, remedy = "?duration", "use it inside durative actions only"
        raise InputError(f"{what} is read but has no value here; {remedy}")

    def expression(self, expression: model.Expression) -> Fraction:
        return expression.evaluate({variable: self.variable(variable) for variable in expression.variables})

    def leaf(self, leaf: model.Leaf) -> bool:
        match leaf:
            case model.Truth(value):
                return value
            case model.Holds(atom, value):
                return (atom in self.state.atoms) is value
            case model.NumericCondition(expression, relation):
                return relation.holds(self.expression(expression))
        assert_never(leaf)

    def failures(self, condition: model.Condition) -> tuple[model.Leaf, ...]:
        """The false leaves that make the condition false; empty if it holds. All of the condition is read."""
        results: list[tuple[model.Leaf, ...]] = []
        pending: list[tuple[model.Condition, bool]] = [(condition, False)]
        while pending:
            node, operands_done = pending.pop()
            if not isinstance(node, model.And | model.Or):
                results.append(() if self.leaf(node) else (node,))
            elif not operands_done:
                pending.append((node, True))
                pending.extend((operand, False) for operand in reversed(node.operands))
            else:
                cut = len(results) - len(node.operands)
                parts, results = results[cut:], results[:cut]
                results.append(_combined(node, parts))
        return results[0]

    def holds(self, condition: model.Condition) -> bool:
        return not self.failures(condition)


def _combined(node: model.And | model.Or, parts: list[tuple[model.Leaf, ...]]) -> tuple[model.Leaf, ...]:
    joined = tuple(leaf for part in parts for leaf in part)
    if isinstance(node, model.And):
        return joined
    if not parts:
        return (model.Truth(False),)
    return joined if all(parts) else ()


class TimedExecution:
    """One plan under parameter values and times: its happenings, and how to read a condition of an instance.

    `times` gives every time point of the plan its time, and `durations` what instances read as `?duration` if that is
    not the time from start to end. What was `observed` is so right after all that happens at its time, whatever the
    plan has it be, which is in `expected`; of several values the last one counts. Raises InputError where a fluent
    without a value is read, and UnsupportedError where a continuous effect's rate changes while it acts.
    """

    def __init__(
        self,
        plan: model.ParametrizedPlan,
        parameters: Mapping[str, Fraction],
        times: Mapping[model.TimePoint, Fraction],
        durations: Mapping[str, Fraction] | None = None,
        observed: Iterable[model.TimedLiteral] = (),
    ) -> None:
        self.plan = plan
        self.parameters = parameters
        self.times = times
        self._durations = durations or {}
        self._observed: dict[Fraction, list[model.TimedLiteral]] = {}
        for literal in observed:
            self._observed.setdefault(literal.time, []).append(literal)
        self.expected: dict[Fraction, State] = {}
        self._rates: dict[tuple[str, int], Fraction] = {}
        self.disagreements: list[tuple[model.TimePoint, str]] = []
        """The time points at which an assigned fluent is changed twice by one action, and how."""
        self.happenings = tuple(self._run())

    @cached_property
    def _before(self) -> Mapping[model.TimePoint, State]:
        return {point: happening.before for happening in self.happenings for point in happening.points}

    def before(self, point: model.TimePoint) -> State:
        """The state that conditions at a time point read."""
        return self._before[point]

    def at(self, time: Fraction) -> Happening:
        """The happening at a time at which something happens."""
        return self.happenings[bisect_left(self.happenings, time, key=lambda happening: happening.time)]

    def steps(self, start: Fraction, end: Fraction) -> Iterator[tuple[Happening, Happening]]:
        """The happenings from a time on and before another one, each with the one that follows it."""
        first = bisect_left(self.happenings, start, key=lambda happening: happening.time)
        for index in range(first, len(self.happenings) - 1):
            if self.happenings[index].time >= end:
                break
            yield self.happenings[index], self.happenings[index + 1]

    def duration(self, instance: model.ActionInstance) -> Fraction:
        """What the instance reads as `?duration`."""
        known = self._durations.get(instance.identifier)
        return self.times[instance.end] - self.times[instance.start] if known is None else known

    def reading(self, state: State, instance: model.ActionInstance | None = None) -> Reading:
        """How `instance`, or the goal, reads the state."""
        return Reading(state, self.parameters, self.duration(instance) if instance else None)

    def _run(self) -> Iterator[Happening]:
        at: dict[Fraction, list[model.TimePoint]] = {time: [] for time in self._observed}
        for point in self.plan.time_points:
            at.setdefault(self.times[point], []).append(point)
        flowing = [instance for instance in self.plan.instances if instance.continuous_effects]
        previous: Happening | None = None
        for time in sorted(at):
            before = self._initial() if previous is None else previous.just_before(time)
            after = self._after(at[time], before)
            if time in self._observed:
                self.expected[time] = after
                after = _as_observed(after, self._observed[time])
            previous = Happening(time, tuple(at[time]), before, after, self._slopes(time, after, flowing))
            yield previous

    def _initial(self) -> State:
        reading = Reading(State(frozenset(), {}), self.parameters)
        fluents = {fluent: reading.expression(value) for fluent, value in self.plan.initial_fluents.items()}
        return State(self.plan.initial_atoms, fluents)

    def _after(self, points: list[model.TimePoint], before: State) -> State:
        change = _Change(before)
        for point in points:
            if point.kind is model.TimePointKind.TIMED_LITERAL:
                self._add_timed_literals(point, change)
            elif point.instance is not None:
                self._add_effects(self.plan.instance[point.instance], point, change)
        return change.result()

    def _add_timed_literals(self, point: model.TimePoint, change: _Change) -> None:
        for literal in self.plan.timed_literals:
            if literal.time == point.time:
                change.set(literal)

    def _add_effects(self, instance: model.ActionInstance, point: model.TimePoint, change: _Change) -> None:
        reading = self.reading(change.before, instance)
        timing = model.Timing.AT_END if point.kind is model.TimePointKind.END else model.Timing.AT_START
        for added in instance.atom_effects:
            if added.timing is timing and reading.holds(added.condition):
                change.write(added.atom, added.value)
        changed: dict[model.Fluent, list[tuple[model.AssignmentKind, Fraction]]] = {}
        for effect in instance.numeric_effects:
            if effect.timing is timing and reading.holds(effect.condition):
                amount = reading.expression(effect.expression)
                changed.setdefault(effect.fluent, []).append((effect.operator, amount))
                if effect.operator is model.AssignmentKind.ASSIGN:
                    change.assignments[effect.fluent] = amount
                else:
                    change.increases.append((effect.fluent, amount))
        self.disagreements += ((point, text) for text in _disagreements(changed))

    def _slopes(
        self, time: Fraction, after: State, flowing: list[model.ActionInstance]
    ) -> dict[model.Fluent, Fraction]:
        """The changes per unit of time right after `time`."""
        slopes: dict[model.Fluent, Fraction] = {}
        acting = [i for i in flowing if self.times[i.start] <= time < self.times[i.end]]
        for instance in acting:
            reading = self.reading(after, instance)
            for index, effect in enumerate(instance.continuous_effects):
                rate = reading.expression(effect.rate)
                if self._rates.setdefault((instance.identifier, index), rate) != rate:
                    raise UnsupportedError(_moving_rate(instance, effect.fluent))
                reading.variable(effect.fluent)
                slopes[effect.fluent] = slopes.get(effect.fluent, Fraction(0)) + rate
        for instance in acting:
            for effect in instance.continuous_effects:
                if any(
                    isinstance(variable, model.Fluent) and slopes.get(variable) for variable in effect.rate.variables
                ):
                    raise UnsupportedError(_moving_rate(instance, effect.fluent))
        return slopes


def _as_observed(state: State, observed: Iterable[model.TimedLiteral]) -> State:
    change = _Change(state)
    for literal in observed:
        change.set(literal)
    return change.result()


def _disagreements(changed: Mapping[model.Fluent, list[tuple[model.AssignmentKind, Fraction]]]) -> Iterator[str]:
    """The fluents that do not have one value after changes by one action, in words."""
    for fluent, changes in changed.items():
        if len(changes) > 1 and any(operator is model.AssignmentKind.ASSIGN for operator, _ in changes):
            words = (f"{_CHANGED[operator]} {format_number(amount)}" for operator, amount in changes)
            yield f"{fluent} is {' and '.join(words)}"


_CHANGED = {model.AssignmentKind.ASSIGN: "assigned", model.AssignmentKind.INCREASE: "increased by"}


def _moving_rate(instance: model.ActionInstance, fluent: model.Fluent) -> str:
    return (
        f"instance {instance.identifier} {instance}: the rate of its continuous effect on {fluent} changes while it "
        "acts; only rates that stay constant from start to end are supported"
    )


class _Change:
    """The effects of one happening, collected before they take place together."""

    def __init__(self, before: State) -> None:
        self.before = before
        self.adds: set[model.Atom] = set()
        self.deletes: set[model.Atom] = set()
        self.assignments: dict[model.Fluent, Fraction] = {}
        self.increases: list[tuple[model.Fluent, Fraction]] = []

    def set(self, literal: model.TimedLiteral) -> None:
        if isinstance(literal.target, model.Atom):
            self.write(literal.target, bool(literal.value))
        else:
            self.assignments[literal.target] = Fraction(literal.value)

    def write(self, atom: model.Atom, value: bool) -> None:
        (self.adds if value else self.deletes).add(atom)

    def result(self) -> State:
        """Deletes, then adds; assignments, then increases. Where these contradict each other the value means nothing:
        the last assignment stands, and an obligation is broken.
        """
        atoms = self.before.atoms
        if self.adds or self.deletes:
            atoms = (atoms - self.deletes) | self.adds
        if not self.assignments and not self.increases:
            return State(atoms, self.before.fluents)
        fluents = {**self.before.fluents, **self.assignments}
        for fluent, amount in self.increases:
            if fluent not in fluents:
                raise InputError(f"numeric fluent {fluent} is increased but has no value here; give it one in :init")
            fluents[fluent] += amount
        return State(atoms, fluents)


def over_time(
    expression: model.Expression, reading: Reading, slopes: Mapping[model.Fluent, Fraction]
) -> tuple[Fraction, Fraction]:
    """Value now and change per unit of time of an expression between two happenings.

    Raises UnsupportedError where it is not linear in time (a product of several changing fluents).
    """

    def moving(variable: model.NumericVariable) -> Polynomial[str]:
        slope = slopes.get(variable, Fraction(0)) if isinstance(variable, model.Fluent) else Fraction(0)
        return Polynomial({(): reading.variable(variable), ("#t",): slope})

    polynomial = expression.substitute(moving)
    if not polynomial.is_linear:
        raise UnsupportedError(
            f"{expression} multiplies fluents that change continuously at the same time; "
            "over-all conditions must be linear in time between two happenings"
        )
    return polynomial.constant_term, polynomial.terms.get(("#t",), Fraction(0))
