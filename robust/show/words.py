"""Plans in words: what a parameter, a time point, a statement of the network and an obligation are about.

Names such as `dur_n3` and `n3 move: at start (at rover base)` say where something stands in the files; people know the
actions. Where an action occurs more than once, its occurrences are counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import cached_property

from robust.numbers import format_number
from robust.plan.model import (
    ZERO,
    ParameterReference,
    ParametrizedPlan,
    TemporalConstraint,
    TimedCondition,
    TimePoint,
    TimePointKind,
    Timing,
    as_written,
    concerned,
)
from robust.plan.polynomial import Polynomial

_WHEN = {Timing.AT_START: "when it starts", Timing.OVER_ALL: "all the time", Timing.AT_END: "when it ends"}


class Words:
    """What the names of one plan mean.

    Args:
        plan: the plan.
        epsilon: the separation of mutex time points, where it is to be named.
    """

    def __init__(self, plan: ParametrizedPlan, epsilon: Fraction | None = None) -> None:
        self._plan = plan
        self._epsilon = epsilon

    @cached_property
    def actions(self) -> Mapping[str, str]:
        """By identifier: `move dock pharmacy`, and `(2nd)` and the like where the plan has it more than once."""
        texts = {one.identifier: str(one)[1:-1] for one in self._plan.instances}
        every = list(texts.values())
        seen: dict[str, int] = {}
        found = {}
        for identifier, text in texts.items():
            seen[text] = seen.get(text, 0) + 1
            found[identifier] = text if every.count(text) == 1 else f"{text} ({_ordinal(seen[text])})"
        return found

    @cached_property
    def parameters(self) -> Mapping[str, str]:
        """By name, all different: a duration is its action, others say what they are; the name where nothing does."""
        found = {}
        for parameter in self._plan.parameters:
            uses = dict.fromkeys(self._uses(parameter.name))
            found[parameter.name] = next(iter(uses)) if len(uses) == 1 else parameter.name
        texts = list(found.values())
        return {name: text if texts.count(text) == 1 else f"{text} ({name})" for name, text in found.items()}

    def _uses(self, name: str) -> Iterator[str]:
        """What a parameter stands for, as often as it does."""
        itself = Polynomial.variable(ParameterReference(name))
        mentioned = False
        for one in self._plan.constraints:
            ends = one.lower == itself, one.upper == itself
            if any(ends):
                yield self._between(one.source, one.target, ends)
            elif any(
                bound is not None and ParameterReference(name) in bound.variables for bound in (one.lower, one.upper)
            ):
                mentioned = True
        if mentioned:
            yield name
        for fluent, value in self._plan.initial_fluents.items():
            if value == itself:
                yield f"{str(fluent)[1:-1]} at the beginning"

    def _between(self, source: TimePoint, target: TimePoint, ends: tuple[bool, bool]) -> str:
        """What a time between two time points is, or a bound of it."""
        kinds = source.kind, target.kind
        if source.instance == target.instance and kinds == (TimePointKind.START, TimePointKind.END):
            least, most, what = "shortest ", "longest ", self.actions[f"{target.instance}"]
        elif source == ZERO:
            least, most, what = "earliest ", "latest ", self.point(target)
        else:
            least, most, what = "least ", "greatest ", f"time from {self.point(source)} to {self.point(target)}"
        return f"{ {(True, False): least, (False, True): most}.get(ends, '') }{what}"

    def point(self, point: TimePoint) -> str:
        """`end of move dock pharmacy`."""
        match point.kind:
            case TimePointKind.ZERO:
                return "beginning"
            case TimePointKind.TIMED_LITERAL:
                return f"timed event at {format_number(point.time or Fraction(0))}"
            case TimePointKind.INSTANT:
                return self.actions[f"{point.instance}"]
        return f"{point.kind.value} of {self.actions[f'{point.instance}']}"

    def statement(self, one: TemporalConstraint) -> str:
        """A constraint of the network, with its line."""
        lower, upper = (None if bound is None else as_written(bound) for bound in (one.lower, one.upper))
        line = f" (line {one.location.line})" if one.location and one.location.line else ""
        if lower is not None and lower == upper:
            demand = f"is {lower}"
        else:
            demand = (
                " and ".join(filter(None, (lower and f"at least {lower}", upper and f"at most {upper}"))) or "is any"
            )
        what = self._between(one.source, one.target, (True, True))
        if one.source.instance == one.target.instance:
            what = f"duration of {what}"
        return f"{what}: {demand}{line}"

    def obligation(self, name: str) -> str:
        """What an obligation demands; its name where that is not one of the plan's obligations."""
        return self._obligations.get(name) or self._separation(name) or name

    @cached_property
    def _obligations(self) -> Mapping[str, str]:
        found = {one.label: f"the goal {one.text} must hold at the end" for one in self._plan.goal}
        for instance in self._plan.instances:
            action = self.actions[instance.identifier]
            found[f"{instance.identifier} {instance.action}: non-negative duration"] = (
                f"{action} must not end before it starts"
            )
            for constraint in instance.durations:
                found[instance.label(constraint)] = (
                    f"the duration of {action} must be as the domain says: {constraint.text}"
                )
            for condition in instance.demands:
                found[instance.label(condition)] = (
                    f"{action} needs {condition.text}{self._when(instance.durative, condition)}"
                )
        return found

    @staticmethod
    def _when(durative: bool, condition: TimedCondition) -> str:
        return f" {_WHEN[condition.timing]}" if durative else ""

    def _separation(self, name: str) -> str | None:
        pair = self._separated(name)
        apart = f"at least {format_number(self._epsilon)} apart" if self._epsilon else "at different times"
        return f"{' and '.join(map(self.point, pair))} must be {apart}" if pair else None

    def _separated(self, name: str) -> tuple[TimePoint, ...]:
        """The two time points that an obligation separates; none if it is another one."""
        kind, _, pair = name.partition(": ")
        known = {str(point): point for point in self._plan.time_points}
        found = tuple(known[one] for one in pair.split(", ") if one in known)
        return found if kind == "separation" and len(found) == 2 else ()

    def concerned(self, name: str) -> tuple[str, ...]:
        """The identifiers of the instances that an obligation is about; none for goals."""
        known = name in self._obligations or self._separated(name)
        return tuple(one for one in concerned(name) if known and one in self._plan.instance)


def named(name: str, words: Mapping[str, str] | None) -> str:
    """A parameter for an axis: its words, with the name to type in parentheses."""
    text = (words or {}).get(name, name)
    return text if name in text else f"{text} ({name})"


def _ordinal(number: int) -> str:
    suffix = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{suffix}"
