"""Time-triggered plans as planners print them: a start time, an action and, for durative actions, a duration.

::

    ; a comment
    0.000: (load truck crate) [5.0]
    5.001: (beep truck)

Times and durations are exact and in the problem's unit; names are lower-cased. Blank lines and comments are skipped;
any other line is an error, because a step that goes unread would silently make another plan.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from os import PathLike

from robust.errors import InputError, Location
from robust.numbers import format_number, is_number, parse_number, shorten
from robust.plan.pddl.forms import read_text

_STEP = re.compile(r"(?P<time>[^\s:]+)\s*:\s*\((?P<action>[^()]*)\)\s*(?:\[(?P<duration>[^\[\]]*)\])?\s*")
_SYMBOL = re.compile(r"[A-Za-z0-9_-]+")
_EXPECTED = "a step such as '12.001: (goto r1 a b) [5.0]', or a comment after ';'"


@dataclass(frozen=True, slots=True)
class TimedStep:
    """One action at a time ≥ 0; `duration` is None for an instantaneous action."""

    time: Fraction
    action: str
    arguments: tuple[str, ...]
    duration: Fraction | None = None
    location: Location | None = field(default=None, compare=False)

    def __str__(self) -> str:
        duration = "" if self.duration is None else f" [{format_number(self.duration)}]"
        return f"{format_number(self.time)}: ({' '.join((self.action, *self.arguments))}){duration}"


@dataclass(frozen=True, slots=True)
class TimedPlan:
    """The steps in the order of the file."""

    steps: tuple[TimedStep, ...]
    file: str = field(default="<plan>", compare=False)


def parse_timed_plan(text: str, file: str = "<plan>") -> TimedPlan:
    """The plan that a text describes; InputError with line and column for a line that is no step, and for no steps."""
    lines = text.split("\n")
    steps = [
        _step(line, Location(file, number, len(line) - len(line.lstrip()) + 1))
        for number, line in enumerate(lines, start=1)
        if _content(line)
    ]
    if not steps:
        raise InputError(f"empty plan: found no step, expected {_EXPECTED}", Location(file, len(lines)))
    return TimedPlan(tuple(steps), file)


def read_timed_plan(path: str | PathLike[str]) -> TimedPlan:
    """The plan in a file; InputError if it cannot be read or is not a plan."""
    return parse_timed_plan(read_text(path), str(path))


def write_timed_plan(plan: TimedPlan) -> str:
    """The plan as text, one step a line; reading the text gives an equal plan."""
    return "".join(f"{step}\n" for step in plan.steps)


def _content(line: str) -> str:
    return line.partition(";")[0].strip()


def _step(line: str, location: Location) -> TimedStep:
    content = _content(line)
    match = _STEP.fullmatch(content)
    if match is None:
        raise InputError(f"found {shorten(content)}, expected {_EXPECTED}", location)
    offset = location.column or 1
    time = _amount(match, "time", location, offset)
    symbols = match["action"].split()
    bad = next((symbol for symbol in symbols if not _SYMBOL.fullmatch(symbol)), None)
    if not symbols or bad is not None:
        found = "an empty action" if bad is None else shorten(bad)
        place = Location(location.file, location.line, offset + match.start("action"))
        raise InputError(f"found {found}, expected an action name and objects", place)
    duration = None if match["duration"] is None else _amount(match, "duration", location, offset)
    action, *arguments = (symbol.lower() for symbol in symbols)
    return TimedStep(time, action, tuple(arguments), duration, location)


def _amount(match: re.Match[str], what: str, line: Location, offset: int) -> Fraction:
    """The time or duration of a step, at least 0."""
    text = match[what].strip()
    place = Location(line.file, line.line, offset + match.start(what))
    if not is_number(text):
        raise InputError(f"found {shorten(text)} as {what}, expected a number ≥ 0 such as 12.001", place)
    value = parse_number(text, place)
    if value < 0:
        raise InputError(f"found {what} {shorten(text)}, expected a number ≥ 0", place)
    return value
