"""Simulated worlds: they carry out a dispatcher's decisions, and report what happens.

The durations of actions, their consumption and the times of events that no one decides are drawn; all else is as the
model says. An action whose condition does not hold fails: at its start, it does not happen at all; later, it ends there
and then, without its effects at the end. Conditions over all are looked at when something happens, and once between any
two such moments. The state is a convenience of the simulation: whether a whole execution was valid is for
:mod:`robust.plan.simulate` to say.

World files say which quantities are drawn from which distributions. They are TOML with one table for each rule; of
several rules that fit, the first counts. Numbers are exact, and may be written as texts such as "1/3". Without a rule,
nature does what the plan expects::

    [[draw]]
    duration = "prepare"          # an action, a ground action "(prepare first cap)", an instance of the plan, or "*"
    distribution = "normal"       # or constant, uniform, half-normal, truncated-normal, triangular, exponential
    mean = 150                    # the planned value if left out
    deviation = 70                # or "15%" of the planned value
    minimum = 20                  # none if left out
    below = "fold"                # what becomes of draws below the minimum; or "clip"

    [[draw]]
    consumption = "use"           # ground fluents that nothing changes, such as (use a b): anew for each instance
    distribution = "uniform"
    lower = 0.8
    upper = "4/3"
    relative = true               # numbers are multiples of the planned value

    [[draw]]
    parameter = "handling"        # a parameter of the plan, or "*": once for each run
    distribution = "half-normal"
    origin = 5                    # the planned value if left out
    deviation = 1

    [[draw]]
    duration = "carry"
    distribution = "empirical"    # what was observed
    values = [41, 43.5, 60]
    weights = [7, 2, 1]           # how often; once each if left out

What durations share is said beside these. A factor is drawn once for each run; durations it scales are their own draw,
or as planned, times the factor, and those it shifts that plus the factor. Durations with a covariance matrix are
jointly normal around their planned values, or `means`::

    [[factor]]
    name = "weather"
    scales = ["drive", "(fly d1 a b)"]  # or shifts
    distribution = "triangular"
    lower = 0.9
    mode = 1
    upper = 1.4

    [[covariance]]
    durations = ["(drive a b)", "(drive b c)"]  # each one step
    matrix = [[4, 2], [2, 9]]

Draws are multiples of 1/1000, except for constants and observed values. Every draw has a random number of its own, made
of the run's seed, what is drawn, and how often that has been drawn before. So two executors that meet in the same world
with the same seed have the same luck, whatever order they do things in: results can be compared pair by pair.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import count
from os import PathLike
from random import Random
from typing import Final

from robust.errors import InputError, Location, closest, did_you_mean
from robust.execute import dispatcher
from robust.execute.dispatchable import Dispatchable, Means, NaturalLink
from robust.numbers import shorten
from robust.plan import model, parameters, timeline
from robust.plan.pddl.forms import read_text
from robust.presented import VerdictEnum
from robust.probability.distributions import (
    KEYS,
    LISTS,
    OPTIONAL,
    PLANNED,
    Amount,
    Below,
    Distribution,
    DistributionForm,
    on_grid,
    parse_amount,
    require_possible,
)
from robust.probability.sharing import Matrix, require_covariance, root


class Luck:
    """The draws of one run; durations are never below 0."""

    def __init__(self, rules: Rules, seed: int | str) -> None:
        self.rules = rules
        self._seed = seed
        self._count: Counter[str] = Counter()
        self._kept: dict[str, Fraction] = {}

    def duration(self, instance: model.ActionInstance, planned: Fraction) -> Fraction | None:
        """The duration of an instance this time; None without a rule."""
        names = _names(instance)
        joint = next((part for rule in self.rules.covariances for part in rule.parts(names)), None)
        if joint is None:
            drawn = self._draw(self.rules.duration(instance), f"duration {instance}", planned)
        else:
            drawn = on_grid(sum(share * self._normal(what) for what, share in joint.shares)) + (
                planned if joint.mean is None else joint.mean
            )
        for rule in self.rules.factors:
            if names.intersection(rule.subjects):
                own, factor = planned if drawn is None else drawn, self._factor(rule)
                drawn = own * factor if rule.scales else own + factor
        return None if drawn is None else max(drawn, Fraction(0))

    def _factor(self, rule: FactorRule) -> Fraction:
        """The value of a factor in this run."""
        key = f"factor {rule.name}"
        if key not in self._kept:
            self._kept[key] = rule.distribution.draw(Random(f"{self._seed}/{key}"))  # noqa: S311 - a simulation
        return self._kept[key]

    def _normal(self, what: str) -> float:
        """A standard normal value of this run."""
        return Random(f"{self._seed}/{what}").gauss(0, 1)  # noqa: S311 - a simulation

    def consumption(self, instance: model.ActionInstance, fluent: model.Fluent, planned: Fraction) -> Fraction | None:
        """The value of a fluent for an instance; None without a rule."""
        return self._draw(self.rules.consumption(fluent), f"{fluent} of {instance}", planned)

    def parameter(self, name: str, planned: Fraction, *, once: bool) -> Fraction | None:
        """The value of a parameter; None without a rule. With `once` it stays what it was when it was drawn first."""
        if once and name in self._kept:
            return self._kept[name]
        drawn = self._draw(self.rules.parameter(name), f"parameter {name}", planned)
        if once and drawn is not None:
            self._kept[name] = drawn
        return drawn

    def _draw(self, rule: Rule | None, what: str, planned: Fraction) -> Fraction | None:
        if rule is None:
            return None
        number = self._count[what]
        self._count[what] += 1
        return rule.about(planned).draw(Random(f"{self._seed}/{what}/{number}"))  # noqa: S311 - no secrets here


class Subject(Enum):
    """Quantities that rules are about."""

    DURATION = "duration"
    CONSUMPTION = "consumption"
    PARAMETER = "parameter"


@dataclass(frozen=True, slots=True)
class Rule:
    """A distribution as the file says it, and of which quantities."""

    subject: Subject
    name: str
    form: DistributionForm

    def about(self, planned: Fraction) -> Distribution:
        """The distribution of a quantity with this planned value."""
        return self.form.at(planned, Location(self.name))


@dataclass(frozen=True)
class FactorRule:
    """A factor that durations of these names share; it multiplies them, or is added."""

    name: str
    distribution: Distribution
    subjects: tuple[str, ...]
    scales: bool


@dataclass(frozen=True)
class JointPart:
    """A duration as its mean plus multiples of standard normal values; None for a mean as planned."""

    mean: Fraction | None
    shares: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class CovarianceRule:
    """Jointly normal durations, by what they are called."""

    subjects: tuple[str, ...]
    matrix: Matrix
    means: tuple[Fraction, ...] | None = None

    def parts(self, names: Collection[str]) -> Iterator[JointPart]:
        """What it says about a duration with these names."""
        for number, subject in enumerate(self.subjects):
            if subject in names:
                shares = tuple(
                    (f"normal {self.subjects[column]}", share) for column, share in enumerate(root(self.matrix)[number])
                )
                yield JointPart(None if self.means is None else self.means[number], shares)


@dataclass(frozen=True)
class Rules:
    """All rules of a world."""

    rules: tuple[Rule, ...] = ()
    factors: tuple[FactorRule, ...] = ()
    covariances: tuple[CovarianceRule, ...] = ()

    def is_random(self, instance: model.ActionInstance) -> bool:
        """Whether something is said about the duration of an instance."""
        subjects = {name for rule in self.factors for name in rule.subjects}
        subjects |= {name for rule in self.covariances for name in rule.subjects}
        return self.duration(instance) is not None or not subjects.isdisjoint(_names(instance))

    def duration(self, instance: model.ActionInstance) -> Rule | None:
        """The rule for the duration of an instance."""
        return self._first(Subject.DURATION, _names(instance))

    def consumption(self, fluent: model.Fluent) -> Rule | None:
        """The rule for the value of a fluent that nothing changes."""
        return self._first(Subject.CONSUMPTION, {fluent.function, str(fluent)})

    def parameter(self, name: str) -> Rule | None:
        return self._first(Subject.PARAMETER, {name, "*"})

    def _first(self, subject: Subject, names: set[str]) -> Rule | None:
        return next((rule for rule in self.rules if rule.subject is subject and rule.name in names), None)


def _names(instance: model.ActionInstance) -> set[str]:
    return {*parameters.names_of(instance), "*"}


def read_rules(path: str | PathLike[str]) -> Rules:
    """The rules in a world file; InputError if it cannot be read or is wrong."""
    return parse_rules(read_text(path), str(path))


def parse_rules(text: str, file: str = "<world>") -> Rules:
    """The rules in a text; InputError names the rule and the key that is wrong."""
    document = parameters.toml_document(text, file, "tables [[draw]]")
    kinds = ("draw", "factor", "covariance")
    for key in document.keys() - set(kinds):
        expected = "expected only tables [[draw]], [[factor]] and [[covariance]]"
        raise InputError(f"found key {shorten(key)}, {expected}{did_you_mean(key, kinds)}", Location(file))
    found: dict[str, list[tuple[Mapping[str, object], str]]] = {}
    for kind in kinds:
        tables = document.get(kind, [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise InputError(f"found a value for {kind!r}, expected tables [[{kind}]]", Location(file))
        found[kind] = [(table, f"{file}, {kind} {number}") for number, table in enumerate(tables, start=1)]
    rules, factors, covariances = (found[kind] for kind in kinds)
    return Rules(
        tuple(_rule(*one) for one in rules),
        tuple(_factor_rule(*one) for one in factors),
        tuple(_covariance_rule(*one) for one in covariances),
    )


def _rule(table: Mapping[str, object], place: str) -> Rule:
    location = Location(place)
    subjects = [subject for subject in Subject if subject.value in table]
    if len(subjects) != 1:
        named = "none" if not subjects else " and ".join(subject.value for subject in subjects)
        raise InputError(f"found {named}, expected one of duration, consumption and parameter", location)
    subject = subjects[0]
    name = table[subject.value]
    if not isinstance(name, str) or not name.strip():
        raise InputError(f"found {shorten(str(name))} for {subject.value!r}, expected a name", location)
    rule = Rule(subject, _normal_name(subject, name), _form(table, {subject.value, "relative"}, location))
    _check_numbers(rule, location)
    return rule


def _factor_rule(table: Mapping[str, object], place: str) -> FactorRule:
    location = Location(place)
    effects = [key for key in ("scales", "shifts") if key in table]
    if len(effects) != 1:
        raise InputError(f"found {' and '.join(effects) or 'none'}, expected one of scales and shifts", location)
    form = _form(table, {"name", *effects}, location)
    name = table.get("name")
    if not isinstance(name, str) or not name.strip():
        raise InputError(f"found {shorten(str(name))} for 'name', expected a name", location)
    return factor_rule(name, _subjects(table, effects[0], location), form, scales=effects == ["scales"], place=location)


def factor_rule(
    name: str, subjects: Sequence[str], form: DistributionForm, *, scales: bool, place: Location
) -> FactorRule:
    """A factor; InputError if it cannot be one."""
    for key in KEYS[form.kind]:
        if key not in form.amounts and key not in OPTIONAL - PLANNED:
            raise InputError(f"found no {key!r}, expected a number for a {form.kind} distribution", place)
    distribution = form.at(None, place)
    require_possible(form.kind, distribution.numbers, place)
    least = distribution.support[0]
    if scales and (least is None or least <= 0):
        found = "no minimum" if least is None else f"least value {least}"
        raise InputError(f"found {found} of a factor that scales durations, expected one above 0", place)
    return FactorRule(name.strip(), distribution.settled, tuple(map(normal_name, subjects)), scales)


def _subjects(table: Mapping[str, object], key: str, location: Location) -> list[str]:
    names = table.get(key)
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name.strip() for name in names):
        raise InputError(f"found {shorten(str(names))} for {key!r}, expected a list of names", location)
    return names


def _covariance_rule(table: Mapping[str, object], place: str) -> CovarianceRule:
    location = Location(place)
    keys = {"durations", "matrix", "means"}
    for key in (key for key in table if key not in keys):
        raise InputError(f"found key {shorten(key)}, expected another{did_you_mean(key, keys)}", location)
    subjects = tuple(map(normal_name, _subjects(table, "durations", location)))
    rows = table.get("matrix")
    if not isinstance(rows, list) or [len(row) if isinstance(row, list) else 0 for row in rows] != [
        len(subjects)
    ] * len(subjects):
        raise InputError(f"found no matrix with {len(subjects)} rows and columns, expected one", location)
    matrix = tuple(tuple(_amount(one, "matrix", location, relative=False).value for one in row) for row in rows)
    require_covariance(matrix, location)
    means = table.get("means")
    if means is not None and (not isinstance(means, list) or len(means) != len(subjects)):
        raise InputError(f"found {shorten(str(means))} for 'means', expected {len(subjects)} numbers", location)
    centres = None if means is None else tuple(_amount(one, "means", location, relative=False).value for one in means)
    return CovarianceRule(subjects, matrix, centres)


def _form(table: Mapping[str, object], others: Collection[str], location: Location) -> DistributionForm:
    """The distribution of a table with some other keys."""
    kind = table.get("distribution")
    if not isinstance(kind, str) or kind not in KEYS:
        hint = closest(str(kind), KEYS)
        raise InputError(f"found distribution {shorten(str(kind))}, expected one of {', '.join(KEYS)}{hint}", location)
    known = {"distribution", *others, *KEYS[kind]}
    for key in (key for key in table if key not in known):
        raise InputError(f"found key {shorten(key)}, expected another{did_you_mean(key, known)}", location)
    below, relative = table.get("below", "fold"), table.get("relative", False)
    if not isinstance(relative, bool):
        raise InputError(f"found {shorten(str(relative))} for 'relative', expected true or false", location)
    if below not in {"fold", "clip"}:
        raise InputError(f"found {shorten(str(below))} for 'below', expected fold or clip", location)
    amounts: dict[str, tuple[Amount, ...]] = {}
    for key in (key for key in KEYS[kind] if key != "below" and key in table):
        given = table[key] if key in LISTS else [table[key]]
        if not isinstance(given, list):
            raise InputError(f"found {shorten(str(given))} for {key!r}, expected a list of numbers", location)
        amounts[key] = tuple(_amount(one, key, location, relative=relative and key != "weights") for one in given)
    return DistributionForm(kind, amounts, Below(below))


def _normal_name(subject: Subject, name: str) -> str:
    """Ground actions and fluents as they are written elsewhere; identifiers keep their case."""
    text = normal_name(name)
    return text.lower() if subject is Subject.CONSUMPTION else text


def normal_name(name: str) -> str:
    """`( Drive  r1 A )` as `(drive r1 a)`; other names as they are."""
    text = name.strip()
    return f"({' '.join(text[1:-1].lower().split())})" if text.startswith("(") and text.endswith(")") else text


def _amount(value: object, key: str, location: Location, *, relative: bool) -> Amount:
    if isinstance(value, int) and not isinstance(value, bool):
        return Amount(Fraction(value), relative)
    if isinstance(value, str | parameters.DecimalText):
        amount = parse_amount(str(value), location)
        return Amount(amount.value, amount.relative or relative)
    raise InputError(f"found {shorten(str(value))} for {key!r}, expected a number", location)


_LEAST: Final = {
    "uniform": "lower",
    "constant": "value",
    "half-normal": "origin",
    "triangular": "lower",
    "exponential": "minimum",
}
"""The key of the least value that is drawn, by distribution."""


def _check_numbers(rule: Rule, location: Location) -> None:
    kind, amounts = rule.form.kind, rule.form.amounts
    for key in KEYS[kind]:
        if key not in amounts and key not in OPTIONAL:
            raise InputError(f"found no {key!r}, expected a number for a {kind} distribution", location)
    numbers = {key: given.value for key, (given, *_) in amounts.items() if key not in LISTS}
    if kind == "empirical":
        rule.form.at(Fraction(1), location)
    if len({given.relative for (given, *_) in amounts.values()}) == 1:  # others can be compared with a planned value
        require_possible(kind, numbers, location)
    if rule.subject is Subject.DURATION:
        least = numbers.get(_LEAST.get(kind, ""), Fraction(0))
        least = min((least, *(given.value for given in amounts.get("values", ()))))
        if least < 0:
            raise InputError(f"found {_LEAST.get(kind, 'value')} {least} of a duration, expected at least 0", location)
        if kind in {"normal", "truncated-normal"} and numbers.get("minimum", Fraction(-1)) < 0:
            minimum = "no minimum" if "minimum" not in numbers else f"minimum {numbers['minimum']}"
            raise InputError(f"found {minimum} of a duration, expected one of at least 0", location)


# -- carrying out ------------------------------------------------------------------------------------------------------


class WorldState:
    """Atoms, fluents and the moment; `flows` are the rates of running instances by their identifier."""

    def __init__(
        self, atoms: Iterable[model.Atom], fluents: Mapping[model.Fluent, Fraction], time: Fraction = Fraction(0)
    ) -> None:
        self.atoms = set(atoms)
        self.fluents = dict(fluents)
        self.time = time
        self.flows: dict[str, tuple[tuple[model.Fluent, Fraction], ...]] = {}

    def snapshot(self) -> timeline.State:
        """A copy that does not change any more."""
        return timeline.State(frozenset(self.atoms), dict(self.fluents))

    def advance(self, time: Fraction) -> None:
        """Let time pass: fluents change continuously."""
        if self.flows and time > self.time:
            for flow in self.flows.values():
                for fluent, rate in flow:
                    self.fluents[fluent] += rate * (time - self.time)
        self.time = max(self.time, time)

    def unmet(
        self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None
    ) -> str | None:
        """The first condition of an instance, of a given timing, that is false now, as a reason; None if all hold.

        Conditions that read `?duration` hold until the duration is known.
        """

        def is_known(variables: Collection[model.NumericVariable]) -> bool:
            return duration is not None or model.Duration() not in variables

        return dispatcher.unmet(instance, timing, self._reading(duration), is_known)

    def apply(self, instance: model.ActionInstance, timing: model.Timing, duration: Fraction | None = None) -> None:
        """The effects of an instance at one of its time points; all of them read the state before any."""
        reading = self._reading(duration)
        writes = [part for part in instance.atom_effects if part.timing is timing and reading.holds(part.condition)]
        updates = [part for part in instance.numeric_effects if part.timing is timing and reading.holds(part.condition)]
        changes = [(update, reading.expression(update.expression)) for update in updates]
        self.atoms.difference_update([write.atom for write in writes if not write.value])
        self.atoms.update([write.atom for write in writes if write.value])
        for effect, value in sorted(changes, key=lambda change: change[0].operator is model.AssignmentKind.INCREASE):
            if effect.operator is model.AssignmentKind.ASSIGN:
                self.fluents[effect.fluent] = value
            else:
                self.fluents[effect.fluent] = reading.variable(effect.fluent) + value

    def begin_flows(self, instance: model.ActionInstance, duration: Fraction | None) -> None:
        """Continuous effects set in; their rates stay as they are now."""
        reading = self._reading(duration)
        flow = tuple((effect.fluent, reading.expression(effect.rate)) for effect in instance.continuous_effects)
        self.flows.update({instance.identifier: flow} if flow else {})

    def pass_literal(self, literal: model.TimedLiteral) -> None:
        """A timed initial literal takes effect."""
        match literal.target:
            case model.Fluent():
                self.fluents[literal.target] = Fraction(literal.value)
            case atom if literal.value:
                self.atoms.add(atom)
            case atom:
                self.atoms.discard(atom)

    def _reading(self, duration: Fraction | None) -> timeline.Reading:
        return timeline.Reading(timeline.State(frozenset(self.atoms), self.fluents), {}, duration)


class InstanceOutcome(VerdictEnum):
    """Outcome of an instance."""

    DONE = "done"
    FAILED = "failed"
    """A condition stopped to hold."""
    STOPPED = "stopped"
    """The instance was running when the plan was given up, and was not waited for."""
    RUNNING = "running"


@dataclass(slots=True)
class ExecutedInstance:
    """The execution of one instance with actual values: parameters are replaced in `instance`.

    Times are from the beginning of the plan. `natural` says that the duration was not the dispatcher's to choose.
    """

    instance: model.ActionInstance
    start: Fraction
    end: Fraction | None
    outcome: InstanceOutcome
    natural: bool


class SimulatedWorld:
    """One run of a plan in a world; see :class:`robust.execute.drive.World`. Time begins at 0.

    Args:
        dispatchable: the plan.
        luck: what nature draws.
        levels_known: whether initial levels are facts, as in a plan for the state that another one has reached; else
            those that are parameters are drawn.
    """

    def __init__(self, dispatchable: Dispatchable, luck: Luck, *, levels_known: bool = False) -> None:
        self.dispatchable = dispatchable
        self.executed: dict[str, ExecutedInstance] = {}
        plan = dispatchable.plan
        self._luck = luck
        self._values = {drawn.name: self._drawn(drawn, levels_known=levels_known) for drawn in plan.parameters}
        self._consumed: dict[tuple[str, model.Fluent], Fraction] = {}
        self._due: dict[str, Fraction] = {}
        """When what is running will end, where that is known."""
        self._changed = True
        self._given_up = False
        self._messages: list[dispatcher.Message] = []
        self._agenda: list[tuple[Fraction, int, Callable[[Fraction], None]]] = []
        self._order = count()
        self.initial = self._initial_levels()
        """The fluents at time 0 as they really are."""
        self.state = WorldState(plan.initial_atoms, self.initial)
        for literal in plan.timed_literals:
            self._plan_for(literal.time, lambda _, literal=literal: self.state.pass_literal(literal))  # type: ignore[misc]
        self._follow(model.ZERO, Fraction(0))

    @property
    def values(self) -> dict[model.NumericVariable, Fraction]:
        """The actual values of parameters; a duration has its value from the start of its action on."""
        return {model.ParameterReference(name): value for name, value in self._values.items()}

    # -- the world ---------------------------------------------------------------------------------------------------

    def receive(self, now: Fraction, decisions: Sequence[dispatcher.Decision]) -> None:
        for decision in decisions:
            match decision:
                case dispatcher.Dispatch(point) if point.kind is model.TimePointKind.END:
                    self._end(point.instance or "", now)
                case dispatcher.Dispatch(point):
                    self._start(point, now)
                case _:
                    self._given_up |= isinstance(decision, dispatcher.Ending)

    @property
    def next_time(self) -> Fraction | None:
        if self._messages:
            return self.state.time
        return self._agenda[0][0] if self._agenda else None

    def messages(self, now: Fraction) -> Sequence[dispatcher.Message]:
        self.pass_until(now)
        messages, self._messages = self._messages, []
        return messages

    def pass_until(self, now: Fraction) -> None:
        """Let everything happen that happens by itself up to a moment, and let time pass."""
        while self._agenda and self._agenda[0][0] <= now:
            time, _, act = heapq.heappop(self._agenda)
            self._pass(time)
            self._check_at(time)
            act(time)
            self._check_at(time)
        self._pass(now)

    def stop(self, now: Fraction) -> None:
        """End what is running, there and then."""
        self.pass_until(now)
        for execution in self._running:
            self._finish(execution, now, InstanceOutcome.STOPPED)

    # -- instances ---------------------------------------------------------------------------------------------------

    def _start(self, point: model.TimePoint, now: Fraction) -> None:
        self._pass(now)
        identifier = point.instance or ""
        planned = self.dispatchable.plan.instance[identifier]
        ending = next((link for link in self.dispatchable.followers.get(point, ()) if link.target == planned.end), None)
        duration = None if ending is None or not planned.durative else self._length(ending)
        instance = self._actual(planned, duration)
        unmet = self.state.unmet(instance, model.Timing.AT_START, duration)
        if unmet is not None:
            self._messages.append(dispatcher.DispatchFailed(identifier, now, unmet))
            return
        self.state.apply(instance, model.Timing.AT_START, duration)
        run = ExecutedInstance(instance, now, None, InstanceOutcome.RUNNING, duration is not None)
        self.executed[identifier] = run
        if planned.durative:
            self.state.begin_flows(instance, duration)
        else:
            self._finish(run, now, InstanceOutcome.DONE)
        self._check_at(now)
        self._reveal(point)
        if duration is not None:
            self._due[identifier] = now + duration
            self._plan_for(now + duration, lambda time: self._complete(identifier, time))
        self._follow(point, now)

    def _complete(self, identifier: str, time: Fraction) -> None:
        if self.executed[identifier].outcome is InstanceOutcome.RUNNING and self._end(identifier, time):
            self._messages.append(dispatcher.Completed(identifier, time))

    def _end(self, identifier: str, now: Fraction) -> bool:
        """Whether the instance ended as it should."""
        execution = self.executed.get(identifier)
        if execution is None or execution.outcome is not InstanceOutcome.RUNNING:
            return False
        self._pass(now)
        duration = now - execution.start
        unmet = self.state.unmet(execution.instance, model.Timing.AT_END, duration)
        if unmet is not None:
            self._fail(execution, now, unmet)
            return False
        self._finish(execution, now, InstanceOutcome.DONE)
        self.state.apply(execution.instance, model.Timing.AT_END, duration)
        self._check_at(now)
        point = self.dispatchable.plan.instance[identifier].end
        self._reveal(point)
        self._follow(point, now)
        return True

    def _finish(self, execution: ExecutedInstance, now: Fraction, outcome: InstanceOutcome) -> None:
        self.state.flows.pop(execution.instance.identifier, None)
        execution.end, execution.outcome = now, outcome

    def _fail(self, running: ExecutedInstance, now: Fraction, reason: str) -> None:
        self._finish(running, now, InstanceOutcome.FAILED)
        self._messages.append(dispatcher.DispatchFailed(running.instance.identifier, now, reason))

    # -- conditions over all -----------------------------------------------------------------------------------------

    def _pass(self, time: Fraction) -> None:
        """Let time pass. What is running has conditions in between, wherever it ends."""
        begin = self.state.time
        if time <= begin:
            return
        if self._changed or self.state.flows:
            self.state.advance((begin + time) / 2)
            broken = self._broken(self._running)
            self.state.advance(time)
            self._changed = False
            for instance, reason in broken:
                self._fail(instance, time, reason)
        self.state.advance(time)

    def _check_at(self, now: Fraction) -> None:
        """Check over-all conditions at a moment, of instances that are known to run before and after it."""
        self._changed = True
        inside = [run for run in self._running if run.start < now < self._due.get(run.instance.identifier, now)]
        for instance, reason in self._broken(inside):
            self._fail(instance, now, reason)

    @property
    def _running(self) -> list[ExecutedInstance]:
        return [execution for execution in self.executed.values() if execution.outcome is InstanceOutcome.RUNNING]

    def _broken(self, running: Sequence[ExecutedInstance]) -> list[tuple[ExecutedInstance, str]]:
        reasons = ((execution, self.state.unmet(execution.instance, model.Timing.OVER_ALL)) for execution in running)
        return [(execution, reason) for execution, reason in reasons if reason is not None]

    # -- nature ------------------------------------------------------------------------------------------------------

    def _plan_for(self, time: Fraction, act: Callable[[Fraction], None]) -> None:
        heapq.heappush(self._agenda, (time, next(self._order), act))

    def _follow(self, point: model.TimePoint, now: Fraction) -> None:
        """Starts that happen by themselves after a time point; ends follow from starts."""
        for link in self.dispatchable.followers.get(point, ()):
            if link.target.kind is not model.TimePointKind.END:
                self._plan_for(now + self._length(link), lambda time, link=link: self._begin(link.target, time))  # type: ignore[misc]

    def _begin(self, point: model.TimePoint, time: Fraction) -> None:
        if self._given_up:
            return
        self._messages.append(dispatcher.Started(point.instance or "", time))
        self._start(point, time)

    def _length(self, link: NaturalLink) -> Fraction:
        """The actual length of a distance; the parameter that it reveals gets the value that it has then."""
        nominal = link.length.evaluate(self.dispatchable.plan.nominal)
        instance = self.dispatchable.plan.instance[link.target.instance or ""]
        is_duration = link.source == instance.start and link.target == instance.end
        drawn = self._luck.duration(instance, nominal) if is_duration else None
        if drawn is None:
            return max(link.length.evaluate(self._values), Fraction(0))
        if link.parameter is not None:
            self._values[link.parameter] = link.revealed(drawn)
        return drawn

    def _drawn(self, parameter: model.Parameter, *, levels_known: bool) -> Fraction:
        means = self.dispatchable.means.get(parameter.name)
        if means is Means.INITIAL and levels_known:
            return parameter.nominal
        drawn = self._luck.parameter(parameter.name, parameter.nominal, once=means is not Means.TIME)
        return parameter.nominal if drawn is None else drawn

    def _initial_levels(self) -> dict[model.Fluent, Fraction]:
        """Levels as they are; fluents that nothing changes keep the values that the plan expects."""
        levels = dict(self.dispatchable.levels)
        plan = self.dispatchable.plan
        reading = timeline.Reading(timeline.State(frozenset(), {}), self._values)
        for revelation in self.dispatchable.expected.get(model.ZERO, ()):
            for fluent, value in plan.initial_fluents.items():
                if model.ParameterReference(revelation.parameter) in value.variables:
                    levels[fluent] = reading.expression(value)
            self._messages.append(dispatcher.Observed(revelation.parameter, self._values[revelation.parameter]))
        return levels

    def _actual(self, instance: model.ActionInstance, duration: Fraction | None) -> model.ActionInstance:
        """The instance with what it will really need and consume."""
        values = self.values
        plan = self.dispatchable.plan
        for fluent in self.dispatchable.varying[instance.identifier]:
            drawn = self._luck.consumption(instance, fluent, self.dispatchable.levels[fluent])
            if drawn is None and not plan.initial_fluents[fluent].is_constant:
                drawn = plan.initial_fluents[fluent].evaluate(self.values)
            if drawn is not None:
                values[fluent] = drawn
                self._consumed[instance.identifier, fluent] = drawn
        if duration is not None:
            values[model.Duration()] = duration
        if self.dispatchable.reads[instance.identifier].isdisjoint(values):
            return instance
        return model.with_values(instance, values)

    def _reveal(self, point: model.TimePoint) -> None:
        for revelation in self.dispatchable.expected.get(point, ()):
            name, instance = revelation.parameter, revelation.instance
            self._messages.append(dispatcher.Observed(name, self._revealed(name, instance), instance))

    def _revealed(self, name: str, identifier: str | None) -> Fraction:
        """The value that an instance shows of a parameter: it may have been drawn for this instance alone."""
        plan = self.dispatchable.plan
        reference = model.ParameterReference(name)
        for fluent in self.dispatchable.varying.get(identifier or "", ()):
            value = plan.initial_fluents[fluent]
            if reference in value.variables and value.is_linear and (identifier or "", fluent) in self._consumed:
                factor = dict(value.coefficients())[reference]
                return (self._consumed[identifier or "", fluent] - value.constant_term) / factor
        return self._values[name]
