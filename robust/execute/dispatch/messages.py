"""What a dispatcher is told, and what it decides. Times are in the plan's unit, exact, from the plan's time zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from robust.irr.box import Interval
from robust.numbers import format_number
from robust.plan.model import Atom, Fluent, TimePoint

# -- messages ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Started:
    """An instance whose start is not the dispatcher's to choose has started."""

    instance: str
    time: Fraction


@dataclass(frozen=True, slots=True)
class Completed:
    """An instance has ended."""

    instance: str
    time: Fraction


@dataclass(frozen=True, slots=True)
class Failed:
    """An instance could not start, or was ended by a condition that does not hold: `reason` says which."""

    instance: str
    time: Fraction
    reason: str


@dataclass(frozen=True, slots=True)
class Observed:
    """The value of a parameter; `instance` is the one that revealed it, where several may."""

    parameter: str
    value: Fraction
    instance: str | None = None


@dataclass(frozen=True, slots=True)
class StateEstimate:
    """The state of the world at a moment; conditions of what starts at that moment are looked up in it."""

    time: Fraction
    atoms: frozenset[Atom]
    fluents: Mapping[Fluent, Fraction] = field(default_factory=dict)


Message = Started | Completed | Failed | Observed | StateEstimate

# -- what is kept of them ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Observation:
    """A value that was taken note of at `time`: of a parameter, or of a duration that is not as planned.

    `inside` says whether the box allows it.
    """

    time: Fraction
    what: str
    value: Fraction
    inside: bool


# -- decisions ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Dispatch:
    """An instance starts now."""

    point: TimePoint
    time: Fraction

    def __str__(self) -> str:
        return f"start {self.point.instance}"


@dataclass(frozen=True, slots=True)
class Finish:
    """An instance whose duration is the dispatcher's to choose ends now."""

    point: TimePoint
    time: Fraction

    def __str__(self) -> str:
        return f"end {self.point.instance}"


@dataclass(frozen=True, slots=True)
class LeftBox:
    """An observation is outside of the box: the plan is no longer guaranteed to succeed.

    `parameter` is None for a duration that is no parameter; `what` names either for people. `value` is None if all that
    is known is that it exceeds the upper end, because the observation is overdue.
    """

    parameter: str | None
    what: str
    value: Fraction | None
    interval: Interval
    time: Fraction

    def __str__(self) -> str:
        if self.value is None:
            bound = "no end" if self.interval.upper is None else format_number(self.interval.upper)
            return f"{self.what} exceeds {bound}"
        return f"{self.what} = {format_number(self.value)} is outside {interval_text(self.interval)}"


@dataclass(frozen=True, slots=True)
class Missed:
    """A time point can no longer happen, or has happened, within what the network allows; `constraint` says why."""

    point: TimePoint
    constraint: str
    time: Fraction

    def __str__(self) -> str:
        return f"{self.point} missed: {self.constraint}"


@dataclass(frozen=True, slots=True)
class Unobserved:
    """A parameter should have been revealed by `due`, and was not."""

    parameter: str
    due: Fraction
    time: Fraction

    def __str__(self) -> str:
        return f"{self.parameter} was not observed by {format_number(self.due)}"


@dataclass(frozen=True, slots=True)
class Contradicted:
    """The world is in a state in which an instance cannot start, or has failed."""

    instance: str
    reason: str
    time: Fraction

    def __str__(self) -> str:
        return f"{self.instance} failed: {self.reason}"


@dataclass(frozen=True, slots=True)
class Rejected:
    """A message that changes nothing, and why; execution goes on."""

    message: str
    reason: str
    time: Fraction

    def __str__(self) -> str:
        return f"rejected {self.message}: {self.reason}"


@dataclass(frozen=True, slots=True)
class Succeeded:
    """All time points have happened, and every observation was inside the box."""

    time: Fraction

    def __str__(self) -> str:
        return "all done"


Ending = LeftBox | Missed | Unobserved | Contradicted
"""Why a plan is given up."""
Decision = Dispatch | Finish | Ending | Rejected | Succeeded


def interval_text(interval: Interval) -> str:
    """`[1/3, inf)`, with numbers as they are written elsewhere."""
    lower = "-inf" if interval.lower is None else format_number(interval.lower)
    upper = "inf" if interval.upper is None else format_number(interval.upper)
    opening = "[" if interval.lower is not None and interval.lower_closed else "("
    closing = "]" if interval.upper is not None and interval.upper_closed else ")"
    return f"{opening}{lower}, {upper}{closing}"
