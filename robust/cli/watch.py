"""`robust watch`: what happens to a plan comes in as lines of JSON, what is ahead of it goes out as lines of JSON."""

from __future__ import annotations

import queue
import sys
import threading
from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING, Any

from robust.cli import output, plans
from robust.cli.guard import action
from robust.cli.lines import LineReader, LineWriter
from robust.errors import UNDECIDED, InputError, Location
from robust.options.batch import WatchCommand
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.cli.guard import Run
    from robust.execute.drive import WallClock
    from robust.execute.monitor import Monitor, MonitorMessage, Outlook
    from robust.plan.model import ParametrizedPlan

    Heard = MonitorMessage | InputError

LOOK = 0.05
"""Seconds between two looks for signals and the time limit, in real time."""
EVERY_DURATION = ("duration:*",)


@action(WatchCommand)
def watch(options: WatchCommand, run: Run) -> int:
    """Follow a plan while others execute it: what may start, how long steps may still take, when nothing is left.

    A line for each message: {"start": "drive r1 a b", "at": 12.5}, end, failed, cancelled; {"tick": 13}; {"retract": 4}
    takes the fourth message back. After each, and before the first, a line says what is ahead.
    """
    from robust.execute.monitor import Monitor, read_journal

    def prepare() -> tuple[Monitor, ParametrizedPlan]:
        given = options if options.parameter or options.parameters else options.changed(parameter=EVERY_DURATION)
        plan = plans.load(given, run)
        return Monitor(plan, options.separation, Fraction(options.lateness)), plan

    monitor, plan = run.only(prepare)
    if sys.stdin is None:  # closed by the caller
        raise InputError("found no standard input, expected lines of JSON", Location("stdin"))
    path = options.journal
    journal = None if path is None else run.only(lambda: read_journal(path, plan, monitor))
    server = _WatchServer(options, run, monitor, journal)
    try:
        server.serve()
    except BrokenPipeError as error:
        output.drop_output(error)
    finally:
        if journal is not None:
            journal.close()
    prospect = monitor.outlook().prospect.value
    return {"done": 0, "broken": 1}.get(prospect, UNDECIDED)


class _WatchServer:
    def __init__(self, options: WatchCommand, run: Run, monitor: Monitor, journal: Any) -> None:
        self._options, self._run, self._monitor, self._journal = options, run, monitor, journal
        self._deadline = Deadline.after(run.remaining)
        self._reader = LineReader(sys.stdin.fileno())
        sys.stdout.flush()
        self._writer = LineWriter(sys.stdout.fileno(), lambda: run.guard.cause is not None, self._deadline)

    def serve(self) -> None:
        """Until the input ends.

        Raises:
            KeyboardInterrupt, OutOfTimeError: if that is earlier; all that was said is answered and in the journal.
        """
        self._say(self._monitor.outlook())
        if self._options.clock == "given":
            while True:
                with self._run.working():
                    heard = self._hear(None)
                if heard is None:
                    return
                self._answer(heard)
        self._serve_real_time()

    def _say(self, outlook: Outlook) -> None:
        from robust.show.execution import outlook_line

        self._writer.write(outlook_line(outlook, self._options.numbers, self._options.coming))

    def _answer(self, heard: Heard) -> None:
        if isinstance(heard, InputError):
            from robust.show.execution import not_a_message

            self._writer.write(not_a_message(str(heard)))
            return
        if self._journal is not None:
            self._journal.append(heard.as_dict())
        self._say(self._monitor.tell(heard))

    def _hear(self, clock: WallClock | None) -> Heard | None:
        """The next message, or what is wrong with its line; None at the end."""
        from robust.execute.monitor import read_message

        while True:
            try:
                line = self._reader.read(self._deadline if clock is None else NEVER)
                if line is None:
                    return None
                if line.strip():
                    return read_message(line, self._reader.number, None if clock is None else _on_grid(clock.now()))
            except InputError as error:
                return error

    def _serve_real_time(self) -> None:
        """What has come is heard, as of when it came, before time passes."""
        from robust.execute.drive import WallClock
        from robust.execute.monitor import MessageKind, MonitorMessage

        clock = WallClock(Fraction(self._options.rate or 1), self._monitor.time)
        inbox: queue.SimpleQueue[Heard | OSError | None] = queue.SimpleQueue()

        def listen() -> None:
            try:
                while (heard := self._hear(clock)) is not None:
                    inbox.put(heard)
                inbox.put(None)
            except OSError as error:
                inbox.put(error)

        threading.Thread(target=listen, daemon=True).start()
        wake = self._monitor.outlook().wake
        while True:
            if self._run.guard.cause is not None:
                raise KeyboardInterrupt
            if self._deadline.passed:
                raise OutOfTimeError
            try:
                heard = inbox.get(timeout=LOOK if wake is None else min(LOOK, max(0, clock.seconds_until(wake))))
            except queue.Empty:
                if wake is None or clock.now() < wake:
                    continue
                heard = MonitorMessage(MessageKind.TICK, at=_on_grid(clock.now()))
            if heard is None:
                return
            if isinstance(heard, OSError):
                raise heard
            self._answer(heard)
            wake = self._monitor.outlook().wake


def _on_grid(time: Fraction) -> Fraction:
    """In thousandths, rounded down."""
    return Fraction(floor(time * 1000), 1000)
