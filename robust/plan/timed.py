"""Time-triggered plans, and where they stand in what planners print.

::

    ; Plan found with metric 10.001
    0.000: (load truck crate) [5.0]
    5.001: (beep truck)

A step is a start time, an action and, for durative actions, a duration. The layouts of POPF and OPTIC, TFD, LPG
(`[D:5.0; C:0.1]`), PlanSys2 (with the prefixes of ROS), Aries, Kairos and unified-planning (`load(truck, crate)`) are
read. Numbers are exact and in the problem's unit; names are lower-cased. A log may print several plans: a plan ends
where a line is neither a step nor blank nor a comment, at a comment that announces another one, and at a blank line
after which time starts again. Everything else in a log is skipped, but a line that looks like a damaged step is an
error, because a step that goes unread would silently make another plan.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, DecimalTuple
from fractions import Fraction
from os import PathLike

from robust.errors import InputError, Location
from robust.numbers import format_number, is_number, parse_number, plural, shorten
from robust.plan.model import TimePoint
from robust.plan.pddl.forms import read_plan_text
from robust.plan.stn import is_network

_DURATION = r"(?:\s*\[(?P<duration>[^\[\]]*)\])?"
_TIMED = r"(?P<time>[^\s:()]+)\s*:\s*"
_STEP = re.compile(
    rf"{_TIMED}(?:\((?P<lisp>[^()]*)\)|(?P<name>[\w-]+)\s*\((?P<arguments>[^()]*)\)){_DURATION}\s*(?:;.*)?"
)
_NAMED = re.compile(rf"(?:{_TIMED})?(?P<name>[\w-]+)(?:\((?P<arguments>[^()]*)\))?{_DURATION}\s*")
"""A step below a headline of unified-planning, which leaves out the brackets of no arguments."""
_HEADLINE = re.compile(r"(?P<kind>TimeTriggered|Sequential)Plan:")
_ANNOUNCEMENT = re.compile(
    r";+\s*(?:plan found|solution found|time:? \d|cost:|states evaluated|makespan)", re.IGNORECASE
)
_PREFIX = re.compile(r"(?:\[[^\[\]]*\][:\s]*)+")
"""What ROS writes before each line."""
_COLOUR = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
_LEADING = r"[-+]?[\d.][\d.eE/+-]*"
_DAMAGED = re.compile(rf"{_LEADING}\s*:\s*(?:\(|[A-Za-z][\w-]*\s*\()")
"""What is meant for a step, wherever it stands."""
_SUSPICIOUS = re.compile(
    rf"(?:{_LEADING}\s*)?\(\s*[A-Za-z][^|]*|{_LEADING}\s*:\s*[A-Za-z({{].*|{_TIMED}\([^|]*\)\s*\[[D:\s]*\d[^|]*\]"
)
"""What is meant for a step if it stands next to one."""
_DEFINITION = re.compile(r"^\s*\(\s*define\b", re.IGNORECASE | re.MULTILINE)
"""What begins a domain or a problem."""
_SYMBOL = re.compile(r"[A-Za-z0-9_-]+")
_LABELLED = re.compile(r"\s*D\s*:\s*(?P<duration>[^;]*?)\s*;.*")
_EXPECTED = "a step such as '12.001: (goto r1 a b) [5.0]', or a comment after ';'"
_SIGNIFICANT = 6
"""Digits that some planners print before they fill up with zeros."""


@dataclass(frozen=True, slots=True)
class TimedStep:
    """One action at a time ≥ 0; `duration` is None for an instantaneous action.

    `printed` are time and duration as they were printed; empty texts if they were not.
    """

    time: Fraction
    action: str
    arguments: tuple[str, ...]
    duration: Fraction | None = None
    location: Location | None = field(default=None, compare=False)
    printed: tuple[str, str] = field(default=("", ""), compare=False)

    def __str__(self) -> str:
        duration = "" if self.duration is None else f" [{format_number(self.duration)}]"
        return f"{format_number(self.time)}: ({' '.join((self.action, *self.arguments))}){duration}"


@dataclass(frozen=True, slots=True)
class TimedPlan:
    """The steps in the order of the file; `note` says what of the file was picked and skipped, if not all was read.

    `names` are the identifiers of steps where they have some already. `ties` are time points that stay as far apart as
    they are in every network of the plan: the second one happens so much after the first.
    """

    steps: tuple[TimedStep, ...]
    file: str = field(default="<plan>", compare=False)
    note: str = field(default="", compare=False)
    names: tuple[str, ...] = ()
    ties: tuple[tuple[TimePoint, TimePoint, Fraction], ...] = ()

    @property
    def identifiers(self) -> tuple[str, ...]:
        """The identifiers of the steps: `n0`, `n1`, … if they have no names."""
        return self.names or tuple(f"n{number}" for number in range(len(self.steps)))

    @property
    def units(self) -> tuple[tuple[Fraction, Fraction], ...]:
        """How far time and duration of each step may be from what the planner meant: one unit of the last digit.

        Some planners print six significant digits and fill up with zeros, of times or of durations or of both; then the
        last digit is the sixth. Numbers that were not printed, and fractions, are exact.
        """
        times, durations = zip(*(step.printed for step in self.steps), strict=True)
        return tuple(zip(_units(times), _units(durations), strict=True))


def parse_timed_plan(text: str, file: str = "<plan>", number: int | None = None) -> TimedPlan:
    """The plan in a text, the last one or the one of a number from 1.

    Raises:
        InputError: with line and column, for a line that is meant for a step and is none, for no step, and for a
            number that no plan has.
    """
    log = _Log(file)
    log.read(text)
    if not log.plans:
        raise _no_plan(text, file)
    if number is not None and not 1 <= number <= len(log.plans):
        raise InputError(f"found {plural(len(log.plans), 'plan')}, expected one with number {number}", Location(file))
    picked = len(log.plans) if number is None else number
    steps = log.plans[picked - 1]
    return TimedPlan(tuple(steps), file, _note(steps, picked, len(log.plans), log.skipped))


def plans_in(text: str, file: str = "<plan>") -> Iterator[TimedPlan | InputError]:
    """The plans in a text, the last one first: planners that go on looking improve on them.

    The text is read up to the first line that is wrong, such as the last line of a planner that was ended; what is
    wrong with it comes first, and the plan that it belongs to is left out.
    """
    log = _Log(file)
    try:
        log.read(text)
    except InputError as error:
        yield error
        del log.plans[len(log.plans) - log.is_open :]
    yield from (TimedPlan(tuple(steps), file) for steps in reversed(log.plans))


def read_timed_plan(path: str | PathLike[str]) -> TimedPlan:
    """The plan in a file, the last one; InputError if it cannot be read or has none."""
    return parse_timed_plan(*read_plan_text(path))


def write_timed_plan(plan: TimedPlan) -> str:
    """The plan as text, one step a line; reading the text gives an equal plan."""
    return "".join(f"{step}\n" for step in plan.steps)


def _note(steps: list[TimedStep], picked: int, plans: int, skipped: int) -> str:
    parts = []
    if plans > 1:
        places = [step.location.line for step in steps if step.location and step.location.line]
        first, last = min(places), max(places)
        lines = f"line {first}" if first == last else f"lines {first} to {last}"
        parts.append(f"picked plan {picked} of {plans} ({lines})")
    if skipped:
        parts.append(f"skipped {plural(skipped, 'line')} that {'is' if skipped == 1 else 'are'} no step")
    return "; ".join(parts)


class _Log:
    """The plans in a text, line by line."""

    def __init__(self, file: str) -> None:
        self.plans: list[list[TimedStep]] = []
        self.skipped = 0
        self.is_open = False
        """Whether the next step belongs to the last plan."""
        self._file = file
        self._headline = ""
        self._after_blank = False
        self._strange: tuple[str, Location] | None = None
        """A line that is meant for a step if the next one is a step."""

    def read(self, text: str) -> None:
        for number, line in enumerate(text.split("\n"), start=1):
            plain = _COLOUR.sub("", line)
            content = plain.strip()
            if not content.startswith(";") and (prefix := _PREFIX.match(content)):
                content = content[prefix.end() :]
            if content:
                self._line(content, Location(self._file, number, plain.rfind(content) + 1))
            self._after_blank = not content

    def _line(self, content: str, place: Location) -> None:
        if content.startswith(";"):
            self.is_open = self.is_open and not _ANNOUNCEMENT.match(content)
            self._strange = None
            return
        pattern = _NAMED if self._headline else _STEP
        match = pattern.fullmatch(content) or _STEP.fullmatch(content)
        if match is None or (match["time"] is not None and not match["time"][0].isdigit() and not self._in_plan(match)):
            self._other(content, place)
            return
        if self._strange is not None:
            raise _no_step(*self._strange)
        step = _step(match, place, len(self.plans[-1]) if self.is_open else 0)
        if not self.is_open or (self._after_blank and step.time < self.plans[-1][-1].time):
            self.plans.append([])
            self.is_open = True
        self.plans[-1].append(step)

    def _in_plan(self, match: re.Match[str]) -> bool:
        """Whether a line that has the form of a step, but not its time, is a damaged one."""
        return self.is_open or match["time"][0] in "-+."

    def _other(self, content: str, place: Location) -> None:
        headline = _HEADLINE.match(content)
        self._headline = headline["kind"] if headline else ""
        self._strange = None
        if headline is None:
            if _DAMAGED.match(content) or (self.is_open and _SUSPICIOUS.match(content)):
                raise _no_step(content, place)
            if _SUSPICIOUS.match(content):
                self._strange = content, place
            self.skipped += 1
        self.is_open = False


def _no_plan(text: str, file: str) -> InputError:
    """There is no step; the message says what there is if that is known."""
    if is_network(text):
        message = f"found a plan that has a network already, expected {_EXPECTED}; `robust check` takes it as it is"
        return InputError(message, Location(file))
    hint = "; are the files in the right order?" if _DEFINITION.search(text) else ""
    return InputError(f"empty plan: found no step, expected {_EXPECTED}{hint}", Location(file, text.count("\n") + 1))


def _no_step(content: str, place: Location) -> InputError:
    return InputError(f"found {shorten(content)}, expected {_EXPECTED}", place)


def _step(match: re.Match[str], place: Location, index: int) -> TimedStep:
    time, printed = Fraction(index), match["time"] or ""  # in a sequence only the order counts
    if printed:
        time = _amount(match, "time", printed, place)
    name, arguments = match["name"], match["arguments"]
    symbols = match["lisp"].split() if name is None else [name, *_objects(arguments or "")]
    bad = next((symbol for symbol in symbols if not _SYMBOL.fullmatch(symbol)), None)
    if not symbols or bad is not None:
        found = "an empty action" if bad is None else shorten(bad)
        where = _at(place, match.start("lisp" if name is None else "name"))
        raise InputError(f"found {found}, expected an action name and objects", where)
    duration, text = None, match["duration"]
    if text is not None:
        labelled = _LABELLED.fullmatch(text)
        text = (labelled["duration"] if labelled else text).strip()
        duration = _amount(match, "duration", text, place)
    action, *objects = (symbol.lower() for symbol in symbols)
    return TimedStep(time, action, tuple(objects), duration, place, (printed, text or ""))


def _objects(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")] if text.strip() else []


def _at(place: Location, offset: int) -> Location:
    return Location(place.file, place.line, (place.column or 1) + offset)


def _amount(match: re.Match[str], what: str, text: str, line: Location) -> Fraction:
    """The time or duration of a step, at least 0."""
    place = _at(line, match.start(what))
    if not is_number(text):
        raise InputError(f"found {shorten(text)} as {what}, expected a number ≥ 0 such as 12.001", place)
    value = parse_number(text, place)
    if value < 0:
        raise InputError(f"found {what} {shorten(text)}, expected a number ≥ 0", place)
    return value


def _units(texts: Sequence[str]) -> list[Fraction]:
    """One unit of the last digit that was printed on purpose, of numbers that were printed in the same way."""
    numbers = [Decimal(text).as_tuple() if text and "/" not in text else None for text in texts]
    filled = all(number is None or not any(number.digits[_SIGNIFICANT:]) for number in numbers)
    return [Fraction(0) if number is None else Fraction(10) ** _last(number, filled) for number in numbers]


def _last(number: DecimalTuple, filled: bool) -> int:
    """The exponent of the last digit."""
    surplus = len(number.digits) - _SIGNIFICANT if filled and any(number.digits) else 0
    return int(number.exponent) + max(surplus, 0)
