"""Runs of actions in logs: how long each took, and how it ended.

Four kinds of files are read, recognised by their content:

- CSV with a header: `action`; `duration`, or `start` and `end`; `status`, if runs may have failed. Delimiters are
  commas, semicolons or tabs; other columns are ignored.
- messages of PlanSys2's `ActionExecutionInfo`: as `ros2 topic echo` prints them, with `--csv` as well, or as lines of
  JSON or CSV, which tools export from bags. Messages are repeated: the first that says how a run ended counts.
- what `robust execute --json` prints.
- journals of `robust pike run --stdio`.

Durations are seconds if a unit is named, in the header (`duration_ms`) or behind numbers (`350 ms`), otherwise in the
unit of the log. The last record of a log may be cut off; it is left out with a warning.
"""

import csv
import json
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from itertools import chain
from os import PathLike, fspath
from typing import Any, Final, NamedTuple, TypeAlias

from robust.errors import InputError, InputWarning, Location
from robust.numbers import EXPECTED_NUMBER, is_number, parse_number, plural, shorten
from robust.plan.pddl.forms import read_text
from robust.presented import VerdictEnum

LARGEST = 2**29
"""Bytes of a log."""
Amount: TypeAlias = Decimal | Fraction
"""An exact number: decimals are compared much faster than fractions."""
Moment: TypeAlias = datetime | Amount


class RunEnding(VerdictEnum):
    """How a run ended: well, badly, not in the log; or the clock was set back during it."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    UNFINISHED = "unfinished"
    CLOCK_RESET = "clock reset"


class ActionRun(NamedTuple):
    """A run of an action: when it began, if the log says so; how long it took, in seconds if `in_seconds`."""

    action: str
    start: Moment | None
    duration: Amount
    ending: RunEnding
    file: str
    line: int
    in_seconds: bool = False


_WORDS: Final = {
    RunEnding.SUCCEEDED: "success succeeded successful done complete completed ok true",
    RunEnding.FAILED: "failed failure fatal aborted canceled cancelled preempted error timeout rejected lost false",
    RunEnding.UNFINISHED: "running executing active started",
}
_ENDINGS: Final = {word: ending for ending, words in _WORDS.items() for word in words.split()}
_SECONDS: Final = {"ms": Decimal("0.001"), "s": Decimal(1), "sec": Decimal(1), "min": Decimal(60), "h": Decimal(3600)}
_UNIT: Final = rf"({'|'.join(_SECONDS)})"
_COLUMNS: Final = {
    "action": "action name task edge",
    "start": "start started begin start_time",
    "end": "end ended finish end_time",
    "duration": "duration elapsed",
    "status": "status outcome result",
}
_MESSAGE: Final = ("start_stamp_sec", "start_stamp_nanosec", "status_stamp_sec", "status_stamp_nanosec", "status")
"""The fields of a message that are numbers; `action_full_name` comes next."""
_KINDS: Final = (
    "a log: CSV with a header (action; duration, or start and end; status), ActionExecutionInfo as ros2 topic echo "
    "prints it or as rosbag2 exports it, what robust execute --json prints, or a journal of robust pike run --stdio"
)
_ZERO: Final = Decimal(0)
_HUGE: Final = Decimal("1e30")
_CHECKED_WITHIN: Final = 2
"""Seconds by which a duration may differ from the time between stamps, which may be whole seconds; or by 1 per cent."""


def read_runs(path: str | PathLike[str]) -> list[ActionRun]:
    """The runs in a log, in its order.

    Raises:
        InputError: at the line of whatever is not as expected: a negative duration, a status that is not known.
    """
    text, file = read_text(path, LARGEST), fspath(path)
    head = text.lstrip()[:4096]
    if not head:
        raise _wrong("an empty file", _KINDS, file)
    if head[0] == "{":
        runs = _from_json(text, file)
    elif re.search(r"^(start_stamp|status_stamp|action_full_name):", head, re.MULTILINE):
        runs = _from_messages(echoed(text, file), file)
    elif re.match(r"(\d+,){5}", head):
        runs = _from_messages(_headless(text), file)
    else:
        runs = _from_csv(text, file)
    found = list(runs)
    if not found:
        raise _wrong("no run of an action", "at least one", file)
    known = {run.in_seconds: run for run in reversed(found) if run.ending is RunEnding.SUCCEEDED}
    if len(known) == 2:
        found_in = f"a duration without a unit, but one with a unit in line {known[True].line}"
        raise _wrong(found_in, "one of both", file, known[False].line)
    return found


def _wrong(found: str, expected: str, file: str, line: int | None = None) -> InputError:
    return InputError(f"found {found}, expected {expected}", Location(file, line))


def _note(message: str, file: str, line: int | None = None) -> None:
    warnings.warn(InputWarning(f"{Location(file, line)}: {message}"), stacklevel=3)


# -- CSV ---------------------------------------------------------------------------------------------------------------


def _from_csv(text: str, file: str) -> Iterator[ActionRun]:
    first = text.lstrip().partition("\n")[0]
    rows = csv.reader(text.split("\n"), delimiter=max(",;\t", key=first.count), strict=True)
    words = {word for names in _COLUMNS.values() for word in names.split()} | {"action_full_name"}
    if words.isdisjoint(re.sub(rf"_{_UNIT}$", "", name) for name in re.findall(r"\w+", first.lower())):
        line = next(number for number, row in enumerate(text.split("\n"), start=1) if row.strip())
        raise _wrong(shorten(first.strip()), _KINDS, file, line)
    try:
        header = next(row for row in rows if row)
        names = [re.sub(r"\W+", "_", name.strip().lower()).strip("_") for name in header]
        if "action_full_name" in names:
            messages = ((dict(zip(names, row, strict=False)), rows.line_num) for row in rows if row)
            yield from _from_messages(messages, file)
        else:
            yield from _Table(names, file, rows.line_num).runs(rows)
    except csv.Error as error:
        open_quote = (line for line, row in enumerate(text.split("\n"), start=1) if row.count('"') % 2)
        place = Location(file, next(open_quote, rows.line_num))
        raise InputError(f"found a row that is no CSV ({error}), expected one", place) from None


class _Table:
    """A table of runs, by the names of its columns."""

    def __init__(self, names: Sequence[str], file: str, line: int) -> None:
        self._file = file
        self._at: dict[str, int] = {}
        self._unit: Decimal | None = None
        for number, name in enumerate(names):
            plain = re.sub(rf"_{_UNIT}$", "", name) if name.startswith(("duration", "elapsed")) else name
            for column, words in _COLUMNS.items():
                if plain in words.split() and column not in self._at:
                    self._at[column] = number
                    if plain != name:
                        self._unit = _SECONDS[name.rpartition("_")[2]]
        if "action" not in self._at or not self._at.keys() & {"duration", "end"}:
            lacking = "action" if "action" not in self._at else "duration"
            message = f"found no column {lacking!r} in {shorten(','.join(names))}, expected a header with action; "
            raise InputError(f"{message}duration, or start and end; and status", Location(file, line))
        if "duration" not in self._at and "start" not in self._at:
            raise _wrong("column 'end' without 'start'", "both, or 'duration'", file, line)

    def runs(self, rows: Any) -> Iterator[ActionRun]:
        """The runs in the rows of `csv.reader`."""
        last = max(self._at.values())
        action, start, end = self._at["action"], self._at.get("start"), self._at.get("end")
        duration, status = self._at.get("duration"), self._at.get("status")
        names: dict[str, str] = {}
        endings: dict[str, RunEnding] = {}
        for row in rows:
            if len(row) <= last:
                if any(row):
                    self._short(row, last, rows)
                continue
            line = rows.line_num
            given, word = row[action], "success" if status is None else row[status]
            if given not in names:
                names[given] = self._action(given, line)
            if word not in endings:
                endings[word] = self._ending(word, line)
            ending = endings[word]
            began = None if start is None else self._moment(row[start], line)
            ended = row[end] if end is not None else ""
            took: Amount = _ZERO
            in_seconds = False
            if duration is not None and (row[duration] or ending is RunEnding.SUCCEEDED):
                took, in_seconds = self._duration(row[duration], line)
            elif ending is RunEnding.SUCCEEDED and not ended:
                raise _wrong("no end of a run that succeeded", "one", self._file, line)
            if ended and began is not None:
                between = _between(began, self._moment(ended, line), Location(self._file, line))
                if between < 0:
                    ending = RunEnding.CLOCK_RESET
                elif duration is None:
                    took, in_seconds = between, isinstance(began, datetime)
                elif ending is RunEnding.SUCCEEDED:
                    self._compare(took, between, line)
            yield ActionRun(names[given], began, took, ending, self._file, line, in_seconds)

    def _ending(self, given: str, line: int) -> RunEnding:
        word = given.strip().lower()
        if word not in _ENDINGS:
            raise _wrong(f"status {shorten(given)}", f"one of {', '.join(_ENDINGS)}", self._file, line)
        return _ENDINGS[word]

    def _short(self, row: Sequence[str], last: int, rows: Any) -> None:
        """Leave out the last row if it is cut off."""
        line = rows.line_num
        if next(rows, None) is not None:
            raise _wrong(f"{plural(len(row), 'column')}", f"at least {last + 1}", self._file, line)
        _note("the last row is cut off, and left out", self._file, line)

    def _action(self, given: str, line: int) -> str:
        name = action_name(given)
        if not name.strip("() ") or not name.isprintable():
            raise _wrong(f"action {shorten(given)}", "a name without control characters", self._file, line)
        return name

    def _moment(self, text: str, line: int) -> Moment:
        try:
            if "-" in text:  # what has none is a number, though 10101010 is a date as well
                return datetime.fromisoformat(text)
        except ValueError:
            pass
        if (plain := _decimal(text)) is not None:
            return plain
        if not is_number(text.strip()):
            raise _wrong(
                f"time {shorten(text)}", "a date and time such as 2024-05-23 18:45:47, or a number", self._file, line
            )
        return _amount(text.strip(), Location(self._file, line))

    def _duration(self, text: str, line: int) -> tuple[Amount, bool]:
        """A duration, and whether its unit is known to be seconds."""
        unit = self._unit
        if (plain := _decimal(text)) is not None:
            return (plain, False) if unit is None else (plain * unit, True)
        match = re.fullmatch(rf"(.*?)\s*{_UNIT}?", text.strip())
        number = match[1] if match else text
        if not is_number(number):
            raise _wrong(f"duration {shorten(text)}", EXPECTED_NUMBER, self._file, line)
        took = _amount(number, Location(self._file, line))
        if match and match[2]:
            unit = _SECONDS[match[2]]
        if took < 0:
            raise _wrong(f"duration {shorten(text)}", "at least 0", self._file, line)
        if unit is None:
            return took, False
        return (took * unit if isinstance(took, Decimal) else took * Fraction(unit)), True

    def _compare(self, took: Amount, between: Amount, line: int) -> None:
        """InputError if stamps say that a run took another time than it says."""
        said, measured = Fraction(took), Fraction(between)
        if abs(said - measured) > max(Fraction(_CHECKED_WITHIN), measured / 100):
            found = f"duration {float(said):g} of a run that took {float(measured):g} from start to end"
            raise _wrong(found, "both in one unit", self._file, line)


def action_name(text: str) -> str:
    """`(Drive  r1 A)` and PlanSys2's `(drive r1 a):0` as `(drive r1 a)`; other names as they are."""
    name = text.strip()
    if not name.startswith("("):
        return name
    return f"({' '.join(name[1:].partition(')')[0].lower().split())})"


def _decimal(text: str) -> Decimal | None:
    """The value of what most numbers in logs look like, a decimal of ordinary size; None for other texts."""
    try:
        value = Decimal(text)
        is_usual = _ZERO <= value < _HUGE and "_" not in text
    except InvalidOperation:  # of what cannot be compared, too: nan
        return None
    return value if is_usual else None


def _amount(text: str, place: Location) -> Amount:
    value = parse_number(text, place)
    return value if "/" in text else Decimal(text)


def _between(start: Moment, end: Moment, place: Location) -> Amount:
    """The time from start to end, in seconds if they are dates."""
    try:
        difference: Any = end - start  # type: ignore[operator]
    except TypeError:
        raise InputError(
            "found times of two forms, expected one: dates with zones, without, or numbers", place
        ) from None
    if isinstance(start, datetime):
        return Decimal(difference.days * 86400 + difference.seconds) + Decimal(difference.microseconds).scaleb(-6)
    exact: Amount = difference
    return exact


# -- messages of PlanSys2 ----------------------------------------------------------------------------------------------


class ExecutionInfo(NamedTuple):
    """What a message says: the executor's name of an action, nanoseconds on its clock, and the status.

    That is 0: not executed, 1: executing, 2: failed, 3: succeeded, 4: cancelled.
    """

    name: str
    start: int
    stamp: int
    status: int


def execution_info(message: Mapping[str, Any], place: Location) -> ExecutionInfo | None:
    """What a message with fields such as `start_stamp_sec` says; None if it lacks some.

    Raises:
        InputError: for a stamp that is no whole number, or a status that is none.
    """
    full = str(message.get("action_full_name", ""))
    if not (set(_MESSAGE) <= message.keys() and full) or (full[0] == "(" and ")" not in full):
        return None
    try:
        values = [int(message[name]) for name in _MESSAGE]
    except (TypeError, ValueError):
        raise InputError("found no whole number for a stamp or status, expected one", place) from None
    if values[4] not in range(5):
        raise InputError(f"found status {values[4]}, expected 0 to 4, as in ActionExecutionInfo", place)
    return ExecutionInfo(full, values[0] * 10**9 + values[1], values[2] * 10**9 + values[3], values[4])


def _from_messages(messages: Iterable[tuple[Mapping[str, Any], int]], file: str) -> Iterator[ActionRun]:
    """The runs that messages are about; each is a mapping with its line."""
    running: dict[tuple[str, int], int] = {}
    ended: set[tuple[str, int]] = set()
    cut = None
    for message, line in messages:
        if cut is not None:
            fields = ", ".join(name for name in (*_MESSAGE, "action_full_name") if name not in cut[0])
            raise _wrong(f"a message without {fields}", "ActionExecutionInfo", file, cut[1])
        info = execution_info(message, Location(file, line))
        if info is None:
            cut = message, line  # only the last one may be
            continue
        run = info.name, info.start
        if info.status == 0 or run in ended:  # not executed
            continue
        if info.status == 1:
            running.setdefault(run, line)
            continue
        ended.add(run)
        running.pop(run, None)
        ending = RunEnding.SUCCEEDED if info.status == 3 else RunEnding.FAILED
        if info.stamp < info.start:
            ending = RunEnding.CLOCK_RESET
        start, took = Decimal(info.start).scaleb(-9), Decimal(info.stamp - info.start).scaleb(-9)
        yield ActionRun(action_name(info.name), start, took, ending, file, line, True)
    if cut is not None:
        _note("the last message is cut off, and left out", file, cut[1])
    for (full, _), line in running.items():
        yield ActionRun(action_name(full), None, _ZERO, RunEnding.UNFINISHED, file, line, True)


def echoed(text: str, file: str) -> Iterator[tuple[dict[str, str], int]]:
    """Messages as `ros2 topic echo` prints them; what is no field, such as a note of losses, is skipped."""
    message: dict[str, str] = {}
    begin, outer, match = 1, "", None
    for line, row in enumerate(text.split("\n"), start=1):
        if row.startswith("---"):
            if message:
                yield message, begin
            message, begin = {}, line + 1
            continue
        match = re.match(r"( *)(\w+):(?: +(.*\S))?\s*$", row)
        if match is None:
            continue
        name, value = match[2], (match[3] or "").strip("'\"")
        outer = outer if match[1] else name
        message[f"{outer}_{name}" if match[1] else name] = value
    if message and match is not None and not match[1] and not text.endswith("\n"):
        message.pop(match[2])  # it may be cut off
    if message:
        yield message, begin


def _headless(text: str) -> Iterator[tuple[dict[str, str], int]]:
    """Messages as `ros2 topic echo --csv` prints them."""
    for line, row in enumerate(text.split("\n"), start=1):
        if row.strip():
            fields = row.split(",")[:-1]  # the last one does not count, and may be cut off
            yield dict(zip((*_MESSAGE, "action_full_name"), fields, strict=False)), line


# -- JSON --------------------------------------------------------------------------------------------------------------


def _from_json(text: str, file: str) -> Iterator[ActionRun]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = None
    if isinstance(document, dict) and document.get("schema") == "robust/execute/1":
        return _from_executions(document, file)
    lines = _json_lines(text, file)
    first, line = next(lines)
    if first.get("schema") == "robust/pike-journal/1":
        return _from_journal(lines, file)
    if "schema" in first:
        raise _wrong(shorten(str(first["schema"])), _KINDS, file, line)
    return _from_messages(_exported(chain([(first, line)], lines)), file)


def _json_lines(text: str, file: str) -> Iterator[tuple[dict[str, Any], int]]:
    rows = [(row, line) for line, row in enumerate(text.split("\n"), start=1) if row.strip()]
    for row, line in rows:
        try:
            value = json.loads(row)
        except (ValueError, RecursionError):
            if row is rows[-1][0] and len(rows) > 1:
                _note("the last line is cut off, and left out", file, line)
                return
            value = None
        if not isinstance(value, dict):
            raise _wrong(f"{shorten(row)}", "a JSON object on each line", file, line)
        yield value, line


def _exported(lines: Iterable[tuple[dict[str, Any], int]]) -> Iterator[tuple[dict[str, Any], int]]:
    """Messages with their fields in one level; tools put messages under a key of their own."""
    for message, line in lines:
        inner = next(
            (message[key] for key in ("data", "message", "msg") if isinstance(message.get(key), dict)), message
        )
        flat: dict[str, Any] = {}
        for name, value in inner.items():
            flat |= {f"{name}_{key}": part for key, part in value.items()} if isinstance(value, dict) else {name: value}
        yield flat, line


def _from_executions(document: Mapping[str, Any], file: str) -> Iterator[ActionRun]:
    """The runs of actions in what `robust execute --json` prints; instantaneous ones take no time."""
    endings = {"done": RunEnding.SUCCEEDED, "running": RunEnding.UNFINISHED}
    try:
        for run in document["runs"]:
            for plan in run["plans"]:
                for step in plan["executed"]:
                    ending = endings.get(step["outcome"], RunEnding.FAILED)
                    took = _ZERO if step["end"] is None else Fraction(step["end"]) - Fraction(step["start"])
                    if took or ending is not RunEnding.SUCCEEDED:
                        yield ActionRun(action_name(step["action"]), None, took, ending, file, 1)
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        message = f"found a document that is not robust/execute/1 ({type(error).__name__}: {error})"
        raise InputError(f"{message}, expected one", Location(file)) from None


def _from_journal(lines: Iterator[tuple[dict[str, Any], int]], file: str) -> Iterator[ActionRun]:
    """The runs of activities in a journal: from being dispatched until their end is reported."""
    open_runs: dict[str, tuple[str, Fraction, int]] = {}
    for step, line in lines:
        try:
            for decision in step["decisions"]:
                if decision["kind"] == "dispatched":
                    open_runs[decision["end"]] = decision["action"], Fraction(decision["time"]), line
                elif decision["kind"] == "executed" and decision["event"] in open_runs:
                    action, start, _ = open_runs.pop(decision["event"])
                    yield ActionRun(
                        action_name(action), None, Fraction(decision["time"]) - start, RunEnding.SUCCEEDED, file, line
                    )
        except (KeyError, TypeError, ValueError, ZeroDivisionError):
            raise _wrong("no step of a journal", "one with decisions", file, line) from None
    for action, _, line in open_runs.values():
        yield ActionRun(action_name(action), None, _ZERO, RunEnding.UNFINISHED, file, line)
