"""Validation of one schedule, as VAL judges it: violations, their times and amounts, and remedies.

Printed numbers stand for intervals (:mod:`robust.execute.snap`). A plan is valid if what is printed breaks nothing, or
else if there is a schedule within the tolerance, in the printed order, that breaks nothing. If there is none, what
breaks is told of the schedule that comes nearest: the exact one if starts and durations were near enough for one, else
that of the printed starts, with exact durations where these are near enough. Separations in it that are too short by no
more than rounding explains are left out, unless nothing else is wrong.

What would help is found by judging again, and so is true as printed: a tolerance, and the greatest ε of three digits.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location
from robust.execute import distances
from robust.execute.snap import Snapped, Snapping, TooFarError
from robust.numbers import decimal_at, decimal_index, format_number, plural, readable, readable_values, round_up
from robust.plan import load, stn
from robust.plan.model import ActionInstance, Atom, Condition, Holds, ParametrizedPlan, TimePoint, TimePointKind, Timing
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.simulate import Simulation, Violation, mutex_pairs, simulate
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.presented import Presented

_SEPARATION = "separation: "


@dataclass(frozen=True, slots=True)
class Breach:
    """An obligation that a schedule breaks.

    Attributes:
        time: when it is broken, in the plan's unit of time.
        since: when that begins, for conditions over all; null for others.
        obligation: its name, as in answers of :func:`robust.check`; steps are called `n0`, `n1`, ….
        demand: the same in words.
        detail: what is so instead, with exact values.
        amount: how far a number is from what is demanded; None where no single number decides.
        lines: where the steps that it is about stand in the plan.
    """

    time: Fraction
    obligation: str
    demand: str
    detail: str
    amount: Fraction | None
    lines: tuple[int, ...]
    since: Fraction | None = None

    def __str__(self) -> str:
        if self.since is None or self.since == self.time:
            return f"at {readable(self.time)}: {self.words}"
        return f"from {readable(self.since)} on, for instance at {readable(self.time)}: {self.words}"

    @property
    def words(self) -> str:
        """The demand, the fact that contradicts it, and the difference."""
        amount = f", by {readable(self.amount)}" if self.amount and not _separates(self) else ""
        where = f" ({_lines(self.lines)})" if self.lines else ""
        return f"{self.demand}, but {readable_values(self.detail)}{amount}{where}"


def _separates(breach: Breach | Violation) -> bool:
    return breach.obligation.startswith(_SEPARATION)


def _lines(lines: tuple[int, ...]) -> str:
    return f"line {lines[0]}" if len(lines) == 1 else f"lines {', '.join(map(str, lines))}"


@dataclass(frozen=True, slots=True)
class Remedies:
    """Options that make a schedule valid, each by itself; None where no value in the printed order does.

    Attributes:
        tolerance: with exact times so far from the printed ones: at most a fifth of the shortest duration, or ten ε.
        epsilon: the greatest separation, of at most three significant digits, that happenings keep.
    """

    tolerance: Fraction | None = None
    epsilon: Fraction | None = None

    @property
    def named(self) -> Mapping[str, Fraction]:
        """The remedies that exist, by name."""
        every = {"tolerance": self.tolerance, "epsilon": self.epsilon}
        return {name: value for name, value in every.items() if value is not None}


@dataclass(frozen=True)
class Verdict(Presented, ask="valid"):
    """The verdict about a plan as it was printed [docs/semantics.md]; all times are in the plan's unit.

    Attributes:
        plan: its name.
        steps: how many it has.
        end: when the last one ends.
        violations: what breaks, by time; none if the plan is valid.
        snapped: the exact schedule that is meant by the printed one; None where no time had to move, or none is near
            enough.
        remedies: what would make it valid.
        note: what of the file was picked and skipped, if not all was read.
        epsilon: the separation that was asked for.
        tolerance: the tolerance that was asked for; None is what printed digits say.
    """

    plan: str
    steps: int
    end: Fraction
    violations: tuple[Breach, ...] = ()
    snapped: Snapped | None = None
    remedies: Remedies = Remedies()
    note: str = ""
    epsilon: Fraction = EPSILON
    tolerance: Fraction | None = None

    @property
    def valid(self) -> bool:
        """Whether it breaks nothing."""
        return not self.violations

    @property
    def shift(self) -> Fraction:
        """The greatest change of a start or a duration, in the plan's unit of time."""
        return Fraction(0) if self.snapped is None else self.snapped.shift

    def __str__(self) -> str:
        """Verdict, then a line for each violation, then what would help."""
        helps = (f"{name}={format_number(value)} would make it valid" for name, value in self.remedies.named.items())
        lines = (f"{'valid' if self.valid else 'invalid'}: {self.size}", *map(str, self.violations), *helps)
        return "\n  ".join(lines)

    @property
    def size(self) -> str:
        """Number of steps, end, and number of violations, in words."""
        parts = [f"{plural(self.steps, 'step')}, ends at {readable(self.end)}"]
        if self.snapped is not None:
            parts.append(str(self.snapped))
        if self.violations:
            parts.append(plural(len(self.violations), "violation"))
        return "; ".join(parts)


def read_plan(text: str, file: str, number: int | None = None) -> TimedPlan:
    """The time-triggered plan in a text, as :func:`robust.plan.timed.parse_timed_plan`.

    Raises:
        InputError: as there, and for a plan with a temporal network, which has no single schedule.
    """
    if stn.is_network(text, file):
        raise InputError(
            "found a plan with a temporal network, expected one schedule as planners print it; "
            f"robust check DOMAIN PROBLEM {file} judges all schedules of the network",
            Location(file),
        )
    return parse_timed_plan(text, file, number)


def validate(
    domain: Domain,
    problem: Problem,
    timed: TimedPlan,
    *,
    epsilon: Fraction = Fraction(1, 1000),
    tolerance: Fraction | None = None,
) -> Verdict:
    """Judge the schedule of a time-triggered plan.

    Args:
        domain: the domain, see :func:`robust.plan.pddl.reader.read_domain`.
        problem: the problem.
        timed: the plan.
        epsilon: the separation of mutex time points.
        tolerance: how far exact times and durations may be from the printed ones; None is one unit of the last digit
            that was printed, and at most ε.

    Raises:
        InputError: if the plan does not fit the domain and problem.
        UnsupportedError: if the simulator cannot decide an over-all condition or a continuous effect.
    """
    judge = _Judge.of(domain, problem, timed, epsilon)
    outcome = judge.outcome(epsilon, tolerance)
    broken = sorted(_unexplained(judge, outcome), key=lambda violation: (violation.time, not _separates(violation)))
    words, remedies = _Words(judge, outcome, epsilon), Remedies()
    if broken:
        remedies = Remedies(_tolerance(judge, outcome, epsilon), _epsilon(judge, outcome, epsilon, tolerance))
    return Verdict(
        plan=timed.file,
        steps=len(timed.steps),
        end=max(time for point, time in outcome.times.items() if point.time is None),
        violations=tuple(map(words.breach, broken)),
        snapped=outcome.snapped if outcome.snapped is not None and str(outcome.snapped) else None,
        remedies=remedies,
        note=timed.note,
        epsilon=epsilon,
        tolerance=tolerance,
    )


# -- judging -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Outcome:
    """The simulation of a schedule; `times` are those of the exact schedule, or of the nearest attempt at one.

    `rounding` says how far each start and each duration, by end, may be from what was printed. `shift` would be far
    enough, where that is not.
    """

    times: Mapping[TimePoint, Fraction]
    simulation: Simulation
    rounding: Mapping[TimePoint, Fraction]
    snapped: Snapped | None = None
    shift: Fraction | None = None

    @property
    def valid(self) -> bool:
        return not self.violations

    @property
    def violations(self) -> tuple[Violation, ...]:
        return self.simulation.violations


@dataclass(frozen=True)
class _Judge:
    """Judges a ground plan at the times that were printed."""

    timed: TimedPlan
    declared: tuple[stn.InstanceDeclaration, ...]
    plan: ParametrizedPlan
    printed: Mapping[TimePoint, Fraction]

    @classmethod
    def of(cls, domain: Domain, problem: Problem, timed: TimedPlan, epsilon: Fraction) -> _Judge:
        declared = distances.declarations(timed, domain, epsilon)
        for step in timed.steps:
            if min(step.time, step.duration or 0) < 0:
                message = f"found {step}, expected a time and a duration of at least 0"
                raise InputError(message, step.location or Location(timed.file))
        plan = load.assemble(domain, problem, stn.STNPlan((), declared, (), timed.file))
        printed = distances.with_literals(plan, distances.schedule_of(timed, declared))
        return cls(timed, declared, plan, printed)

    def outcome(self, epsilon: Fraction, tolerance: Fraction | None) -> _Outcome:
        """The outcome of the printed schedule, or of the exact one that it stands for."""
        rounding = distances.tolerances(self.timed, self.declared, epsilon, tolerance)
        printed = _Outcome(self.printed, self._simulated(self.printed, epsilon), rounding)
        if printed.valid or not any(rounding.values()):
            return printed
        try:
            snapped = Snapping(self.plan, self.printed, rounding, self._pairs, epsilon).run()
        except TooFarError as error:
            nearest = self._simulated(error.times, epsilon)
            stretched = self._stretched(error.times) if not nearest.violations else None
            return _Outcome(error.times, nearest, rounding, stretched, error.shift)
        return _Outcome(snapped.times, self._simulated(snapped.times, epsilon), rounding, snapped)

    def _stretched(self, times: Mapping[TimePoint, Fraction]) -> Snapped:
        """Times that differ from the printed ones in durations only."""
        changes = [change for point, time in times.items() if (change := abs(time - self.printed[point]))]
        return Snapped(times, len(changes), 0, max(changes, default=Fraction(0)))

    def shift(self, epsilon: Fraction) -> Fraction | None:
        """The least shift of times that satisfies durations and separations; None if no times do."""
        try:
            Snapping(self.plan, self.printed, {}, self._pairs, epsilon).run()
        except TooFarError as error:
            return error.shift
        return None

    @property
    def least_epsilon(self) -> Fraction:
        """The durations of instantaneous actions, which were passed over, are at most ε."""
        steps = zip(self.timed.steps, self.declared, strict=True)
        return max(
            [step.duration or Fraction(0) for step, instance in steps if not instance.durative], default=Fraction(0)
        )

    def separated(self, violation: Violation) -> tuple[TimePoint, ...]:
        """The two time points that a separation is about."""
        return tuple(self._points[name] for name in violation.obligation.removeprefix(_SEPARATION).split(", "))

    @cached_property
    def _points(self) -> Mapping[str, TimePoint]:
        return {str(point): point for point in self.plan.time_points}

    @cached_property
    def _pairs(self) -> tuple[tuple[TimePoint, TimePoint], ...]:
        return tuple(mutex_pairs(self.plan))

    def _simulated(self, times: Mapping[TimePoint, Fraction], epsilon: Fraction) -> Simulation:
        return simulate(self.plan, self.plan.nominal, times, epsilon=epsilon)


def _unexplained(judge: _Judge, outcome: _Outcome) -> list[Violation]:
    """The violations without separations that fail by no more than rounding, if there are others."""
    beyond = []
    for violation in outcome.violations:
        points = judge.separated(violation) if _separates(violation) else ()
        reach = sum(_rounding(outcome, point) for point in points)
        if not reach or (violation.amount or 0) > reach:
            beyond.append(violation)
    return beyond or list(outcome.violations)


def _rounding(outcome: _Outcome, point: TimePoint) -> Fraction:
    """Tolerance of a time point; that of an end is the sum of those of start and duration."""
    if point.kind is TimePointKind.END:
        start = TimePoint(TimePointKind.START, point.instance)
        return outcome.rounding[start] + outcome.rounding[point]
    return outcome.rounding.get(point, Fraction(0))


# -- in words ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Words:
    """Violations in the words of the plan."""

    judge: _Judge
    outcome: _Outcome
    epsilon: Fraction

    def breach(self, violation: Violation) -> Breach:
        """A violation with what is demanded, and by which lines of the plan."""
        if _separates(violation):
            times, instances = self.outcome.times, self.judge.plan.instance
            pair = sorted(self.judge.separated(violation), key=times.__getitem__)
            apart = f"{format_number(self.epsilon)} apart" if self.epsilon else "at different times"
            demand = f"{' and '.join(map(self._name, pair))} have to be {apart}"
            distance = times[pair[1]] - times[pair[0]]
            detail = f"are {format_number(distance)} apart" if distance else "are at the same time"
            owners = [instances[point.instance] for point in pair if point.instance is not None]
        else:
            demand, condition, owners = self._demands[violation.obligation]
            detail = violation.detail + self._period(condition, violation.time)
        places = [owner.location.line for owner in owners if owner.location is not None]
        lines = tuple(dict.fromkeys(line for line in places if line is not None))
        return Breach(violation.time, violation.obligation, demand, detail, violation.amount, lines, violation.since)

    def _name(self, point: TimePoint) -> str:
        if point.instance is None:
            return f"what :init says of time {format_number(point.time or Fraction(0))}"
        instance = self.judge.plan.instance[point.instance]
        return f"the {point.kind.value} of {instance}" if instance.durative else str(instance)

    def _period(self, condition: Condition, time: Fraction) -> str:
        """Since when, and until when, a literal is false that is false at a time; nothing of other conditions."""
        if not isinstance(condition, Holds):
            return ""
        changes = self._changes.get(condition.atom, ())
        since = max((at for at, value in changes if at <= time and value is not condition.value), default=None)
        until = min((at for at, value in changes if at >= time and value is condition.value), default=None)
        ends = (("since", since), ("until", until))
        return "".join(f" {word} {format_number(end)}" for word, end in ends if end is not None)

    @cached_property
    def _changes(self) -> Mapping[Atom, list[tuple[Fraction, bool]]]:
        """When an atom changed to which truth value."""
        changes: dict[Atom, list[tuple[Fraction, bool]]] = {}
        for step in self.outcome.simulation.trace:
            for atom, value in step.atoms_changed:
                changes.setdefault(atom, []).append((step.time, value))
        return changes

    @cached_property
    def _demands(self) -> Mapping[str, tuple[str, Condition, list[ActionInstance]]]:
        """The demand of each obligation but separations, in words and as a condition, and its instances."""
        demands: dict[str, tuple[str, Condition, list[ActionInstance]]] = {}
        for instance in self.judge.plan.instances:
            for constraint in instance.durations:
                demand = f"{instance} demands {constraint.text}"
                demands[instance.label(constraint)] = demand, constraint.condition, [instance]
            for part in instance.demands:
                when = f" {_WHEN[part.timing]}" if instance.durative else ""
                demands[instance.label(part)] = f"{instance} demands {part.text}{when}", part.condition, [instance]
        for goal in self.judge.plan.goal:
            demands[goal.label] = f"the goal demands {goal.text}", goal.condition, []
        return demands


_WHEN = {Timing.AT_START: "at its start", Timing.OVER_ALL: "throughout", Timing.AT_END: "at its end"}


# -- what would help ---------------------------------------------------------------------------------------------------


def _tolerance(judge: _Judge, outcome: _Outcome, epsilon: Fraction) -> Fraction | None:
    """A tolerance with which the plan is valid; with a smaller one of three digits, times cannot be exact.

    None above a fifth of the shortest duration, or ten ε: what would have to move farther was not rounded.
    """
    tried = Fraction(0)
    lasting = [step.duration for step in judge.timed.steps if step.duration is not None and step.duration > epsilon]
    largest = max(10 * epsilon, min(lasting, default=Fraction(0)) / 5)
    shift = outcome.shift if any(outcome.rounding.values()) else judge.shift(epsilon)
    while shift is not None and tried < shift <= largest:
        tried = round_up(shift)
        again = judge.outcome(epsilon, tried)
        if again.valid:
            return tried
        shift = again.shift
    return None


def _epsilon(judge: _Judge, outcome: _Outcome, epsilon: Fraction, tolerance: Fraction | None) -> Fraction | None:
    """The greatest ε of three digits with which the plan is valid."""

    def fails(index: int) -> bool:
        candidate = decimal_at(index)
        return candidate < judge.least_epsilon or not judge.outcome(candidate, tolerance).valid

    near = [epsilon - (violation.amount or 0) for violation in outcome.violations if _separates(violation)]
    if not near or not epsilon:
        return None
    least = decimal_index(min(near) or epsilon / 1000)
    if fails(least):
        return None
    if fails(least + 1):
        return decimal_at(least)
    above = range(least + 2, decimal_index(round_up(epsilon)))
    return decimal_at(least + 1 + bisect_left(above, True, key=fails))
