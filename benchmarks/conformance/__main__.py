"""Hold an executive of plans with choices against what every correct one must do.

    python benchmarks/conformance 'COMMAND with {plan}' [--level LEVEL] [--case NAME] [--limit SECONDS]
        [--cases DIRECTORY]

COMMAND starts an executive that speaks lines of JSON over standard input and output, as docs/formats.md has it
("Executives as services"); `{plan}` stands for the path of a .tpnu.json file. README.md says what cases are. Only the
standard library is needed. The exit code is 0 if the executive passes all cases, 1 if not, 2 if it cannot be started.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, TypeAlias

HERE = Path(__file__).parent
LEVELS = ("core", "reports", "patient")
"""What executives may be able to do; each level includes those before it."""
LAST = ("wake", "end", "error")
"""With these, the answer to a line ends."""
MOST = 2000
"""Lines that are sent at most."""
Line: TypeAlias = dict[str, Any]


class ProtocolError(Exception):
    """The executive has not kept to the protocol."""


class Executive:
    """A process that is asked line by line."""

    def __init__(self, command: Sequence[str], limit: float) -> None:
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )
        self._limit = limit
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self._lines.put(line)
        self._lines.put(None)

    def ask(self, line: str | None) -> list[Line]:
        """The answer to a line; without one, what is said at first."""
        if line is not None and self._process.stdin is not None:
            try:
                self._process.stdin.write(line + "\n")
                self._process.stdin.flush()
            except OSError:
                raise ProtocolError("it has exited") from None
        answer: list[Line] = []
        while not answer or answer[-1].get("kind") not in LAST:
            try:
                text = self._lines.get(timeout=self._limit)
            except Empty:
                raise ProtocolError(f"no answer within {self._limit:g} s to {line}") from None
            if text is None:
                raise ProtocolError(f"it has exited without an answer to {line}")
            try:
                told = json.loads(text)
            except ValueError:
                raise ProtocolError(f"found {text.strip()!r}, expected one JSON object") from None
            if not isinstance(told, dict) or "kind" not in told:
                raise ProtocolError(f"found {text.strip()!r}, expected an object with a kind")
            answer.append(told)
        return answer

    def close(self) -> None:
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):  # it has exited before it has read everything
                self._process.stdin.close()
        try:
            self._process.wait(timeout=self._limit)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()


@dataclass
class Trace:
    """What was said: decisions with the number of the line that they answer, and the time of each line."""

    decisions: list[tuple[int, Line]] = field(default_factory=list)
    times: list[Fraction] = field(default_factory=list)
    reports: set[int] = field(default_factory=set)
    """Lines that were more than the time."""
    complaints: list[str] = field(default_factory=list)
    outcome: str = "waiting"

    def of(self, kind: str) -> Iterator[tuple[int, Line]]:
        return ((number, told) for number, told in self.decisions if told["kind"] == kind)


@dataclass
class Due:
    """Something that the world says at a time; `cause` is the decision that it follows."""

    time: Fraction
    order: int
    event: Mapping[str, Any]
    cause: Line


class World:
    """Plays a case: says what its world says, and tells the time whenever the executive wants to know it."""

    def __init__(self, case: Mapping[str, Any], executive: Executive) -> None:
        self._case, self._executive = case, executive
        self._due: list[Due] = []
        self._waits = [event for event in case["world"] if "when" in event]
        self.trace = Trace()
        for event in case["world"]:
            if "time" in event:
                self._plan(Fraction(event["time"]), event, {})

    def _plan(self, time: Fraction, event: Mapping[str, Any], cause: Line) -> None:
        self._due.append(Due(time, len(self._due), event, cause))
        self._due.sort(key=lambda due: (due.time, due.order))

    def play(self) -> Trace:
        hello = self._executive.ask(None)
        if hello[0]["kind"] != "hello":
            raise ProtocolError(f"found {hello[0]['kind']}, expected hello at first")
        now, wake = Fraction(0), Fraction(0)
        until = Fraction(self._case.get("until", 40))
        for _ in range(MOST):
            if self._due and self._due[0].time <= now:
                answer = self._say(self._due.pop(0), now)
            else:
                answer = self._told({"kind": "tick", "time": str(now)}, now, report=False)
            last = answer[-1]
            wake = Fraction(last["time"]) if last["kind"] == "wake" and last["time"] is not None else until
            moments = [due.time for due in self._due]
            if last["kind"] != "end":
                moments += [wake, Fraction(int(now) + 1)] if wake > now or answer[:-1] else [Fraction(int(now) + 1)]
            if not moments or min(moments) > until:
                return self.trace
            now = max(now, min(moments))
        raise ProtocolError(f"it wants to be asked again and again at {now}")

    def _say(self, due: Due, now: Fraction) -> list[Line]:
        if "line" in due.event:
            answer = self._told(due.event["line"], now)
        else:
            messages = [_filled(message, now, due.cause) for message in due.event["messages"]]
            if len(messages) == 1:
                answer = self._told({**messages[0], "time": str(now)}, now)
            else:
                answer = self._told({"kind": "together", "time": str(now), "messages": messages}, now)
        kinds = {told["kind"] for told in answer}
        wanted = due.event.get("answer")
        if wanted is not None and not kinds & set(wanted):
            said = due.event.get("line") or due.event["messages"]
            self.trace.complaints.append(f"at {now}: {said} was not answered by {' or '.join(wanted)}")
        return answer

    def _told(self, line: Line | str, now: Fraction, *, report: bool = True) -> list[Line]:
        answer = self._executive.ask(line if isinstance(line, str) else json.dumps(line))
        number = len(self.trace.times)
        self.trace.times.append(now)
        if report:
            self.trace.reports.add(number)
        for told in answer:
            self.trace.decisions.append((number, told))
            if told["kind"] in ("succeeded", "failed"):
                self.trace.outcome = told["kind"]
            elif told["kind"] in ("executed", "dispatched", "resumed") and self.trace.outcome == "failed":
                self.trace.outcome = "waiting"
            for event in list(self._waits):
                if _fits(told, event["when"]):
                    if not event.get("always"):
                        self._waits.remove(event)
                    self._plan(now + Fraction(event.get("after", 0)), event, told)
        return answer


def _filled(message: Mapping[str, Any], now: Fraction, cause: Line) -> Line:
    """With the goal of the dispatch, and times ago."""
    filled = dict(message)
    if filled.get("goal") == "$goal":
        filled["goal"] = cause["goal"]
    if "ago" in filled:
        filled["at"] = str(now - Fraction(filled.pop("ago")))
    return filled


def _fits(told: Line, pattern: Mapping[str, Any]) -> bool:
    return all(told.get(key) == value for key, value in pattern.items())


# -- what is required --------------------------------------------------------------------------------------------------


def faults(case: Mapping[str, Any], plan: Mapping[str, Any], trace: Trace) -> Iterator[str]:
    """What is wrong with an execution."""
    yield from trace.complaints
    if trace.outcome not in case["outcome"]:
        yield f"the execution is {trace.outcome}, expected {' or '.join(case['outcome'])}"
    for wanted in case.get("must", ()):
        found = [told for number, told in trace.decisions if _meets(wanted, told, trace.times[number])]
        if not found:
            yield f"nothing like {json.dumps(wanted)}"
    for unwanted in case.get("must not", ()):
        for number, told in trace.decisions:
            if _meets(unwanted, told, trace.times[number]):
                said = f"{json.dumps(told)} at {trace.times[number]}"
                yield f"{said}, although there must be nothing like {json.dumps(unwanted)}"
    yield from _disorder(trace)
    if trace.outcome == "succeeded":
        yield from _violations(plan, trace, deviates=bool(case.get("deviates")))


def _meets(pattern: Mapping[str, Any], told: Line, time: Fraction) -> bool:
    plain = {key: value for key, value in pattern.items() if key not in ("from", "until")}
    early = "from" in pattern and time < Fraction(pattern["from"])
    late = "until" in pattern and time > Fraction(pattern["until"])
    return not early and not late and _fits(told, plain)


def _disorder(trace: Trace) -> Iterator[str]:
    """What no executive may do in any plan."""
    dispatched: set[str] = set()
    for number, told in trace.of("dispatched"):
        key = told.get("goal") or told["end"]
        if key in dispatched:
            yield f"{told['action']} is dispatched twice"
        dispatched.add(key)
        if Fraction(told["time"]) != trace.times[number]:
            yield f"{told['action']} is dispatched at {trace.times[number]} for {told['time']}"
    for number, told in trace.of("executed"):
        time = Fraction(told["time"])
        if time > trace.times[number] or (time < trace.times[number] and number not in trace.reports):
            yield f"{told['event']} is executed at {trace.times[number]} for {told['time']}"
    ended: int | None = None
    for number, told in trace.decisions:
        if told["kind"] == "failed":
            ended = number
        elif told["kind"] == "dispatched" and ended is not None:
            revived = any(ended < report <= number for report in trace.reports)
            yield from [] if revived else [f"{told['action']} is dispatched although everything has failed"]


def _violations(plan: Mapping[str, Any], trace: Trace, *, deviates: bool) -> Iterator[str]:
    """Which constraints of the plan an execution does not keep that is said to be correct.

    `deviates`: activities took other times than they may; then their durations are not looked at.
    """
    chosen: dict[str, str] = {}
    for _, told in trace.decisions:
        for name in told.get("released", ()):  # what nobody has acted upon is open again after a failure
            chosen.pop(name, None)
        if told["kind"] == "chosen":
            if chosen.get(told["choice"], told["value"]) != told["value"]:
                yield f"{told['choice']} has two values"
            chosen[told["choice"]] = told["value"]
    times = {told["event"]: Fraction(told["time"]) for _, told in trace.of("executed")}
    dispatched = {told["end"] for _, told in trace.of("dispatched")}

    def active(thing: Mapping[str, Any]) -> bool:
        return all(chosen.get(name) == value for name, value in thing.get("guard", {}).items())

    for event in plan["events"]:
        if active(event) and event["name"] not in times:
            yield f"{event['name']} was not executed"
        if not active(event) and event["name"] in times:
            yield f"{event['name']} was executed, which {json.dumps(chosen)} excludes"
    bounds = [*plan.get("constraints", ()), *([] if deviates else plan.get("activities", ()))]
    for bound in bounds:
        if active(bound) and bound["from"] in times and bound["to"] in times:
            took = times[bound["to"]] - times[bound["from"]]
            lower, upper = bound.get("lower"), bound.get("upper")
            if (lower is not None and took < Fraction(str(lower))) or (
                upper is not None and took > Fraction(str(upper))
            ):
                yield f"{took} from {bound['from']} to {bound['to']}, expected {lower} to {upper}"
    for activity in plan.get("activities", ()):
        if active(activity) and activity["to"] in times and activity["to"] not in dispatched and not deviates:
            yield f"{activity['action']} was never dispatched"


# -- all cases ---------------------------------------------------------------------------------------------------------


def cases(level: str, name: str | None, directory: Path = HERE) -> list[Mapping[str, Any]]:
    """The cases up to a level, or the one of that name."""
    found: list[Mapping[str, Any]] = []
    for path in sorted((directory / "cases").glob("*.json")):
        case = {"name": path.stem, **json.loads(path.read_text(encoding="utf-8"))}
        if name in (None, case["name"]) and (name or LEVELS.index(case["level"]) <= LEVELS.index(level)):
            found.append(case)
    return found


def examine(command: str, case: Mapping[str, Any], limit: float, directory: Path = HERE) -> list[str]:
    """What is wrong with an executive in a case."""
    path = directory / "plans" / case["plan"] / f"{case['plan']}.tpnu.json"
    plan = json.loads(path.read_text(encoding="utf-8"))
    executive = Executive([word.replace("{plan}", str(path)) for word in shlex.split(command)], limit)
    try:
        return list(dict.fromkeys(faults(case, plan, World(case, executive).play())))
    except ProtocolError as broken:
        return [str(broken)]
    finally:
        executive.close()


def main() -> int:
    parser = argparse.ArgumentParser(description="Hold an executive against what every correct one must do.")
    parser.add_argument("command", help="starts the executive; {plan} stands for the path of the plan")
    parser.add_argument("--level", choices=LEVELS, default=LEVELS[-1], help="what the executive is able to do")
    parser.add_argument("--case", help="only this one")
    parser.add_argument("--cases", type=Path, default=HERE, metavar="DIRECTORY", help="with cases/ and plans/")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each answer")
    given = parser.parse_args()
    if "{plan}" not in given.command:
        parser.error("expected {plan} in the command, for the path of the plan")
    failed = 0
    chosen = cases(given.level, given.case, given.cases)
    for case in chosen:
        try:
            found = examine(given.command, case, given.limit, given.cases)
        except OSError as error:
            sys.stderr.write(f"cannot start the executive: {error}\n")
            return 2
        failed += bool(found)
        sys.stdout.write(f"{'FAILED' if found else 'passed'}  {case['name']}: {case['about']}\n")
        sys.stdout.writelines(f"        {fault}\n" for fault in found)
    sys.stdout.write(f"{len(chosen) - failed} of {len(chosen)} cases passed\n")
    return int(failed > 0 or not chosen)


if __name__ == "__main__":
    sys.exit(main())
