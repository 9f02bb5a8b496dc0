"""`robust watch`: what happens to a plan comes in as lines of JSON, what is ahead of it goes out as lines of JSON.

Another plan, while the run goes on, is asked for in the background, proved, and kept in the journal.
"""

from __future__ import annotations

import gc
import json
import queue
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import floor
from typing import TYPE_CHECKING, Any

from robust.cli import output, plans
from robust.cli.guard import Run, action
from robust.cli.lines import LineReader, LineWriter, listening
from robust.errors import UNDECIDED, InputError, Location, RobustError
from robust.execute.drive import WallClock
from robust.execute.forecast import Prospect
from robust.execute.messages import MessageKind, MonitorMessage, message_of, read_journal, read_message
from robust.execute.monitor import Monitor, Outlook
from robust.execute.situation import NewPlan, OpenProblem, deadline_of, new_plan, read_again, run_state
from robust.json_text import JsonTypes, Object
from robust.options.batch import WatchCommand
from robust.plan.parameters import parse_parameter_file, specifications
from robust.plan.stn import parse_stn
from robust.reading import conversion_settings, domain_and_problem
from robust.show.execution import not_a_message, outlook_line
from robust.smt.limits import NEVER, Deadline, OutOfTimeError, from_copy

if TYPE_CHECKING:
    from robust.cli.page import PageServer
    from robust.execute.planners.interface import Planner
    from robust.plan.model import ParametrizedPlan
    from robust.probability.distributions import Distribution
    from robust.records import RecordFile

    Heard = MonitorMessage | InputError | str
    """A message, why a line is none, or that another plan is asked for."""

REPLANS = 10
"""Plans that are asked for before something happens again."""
ASK = "replan"
"""The key of the message that asks for another plan, and of its record."""


def asks_for_plan(text: bytes) -> bool:
    """Whether a line of the input is `{"replan": true}`."""
    try:
        return ASK.encode() in text and json.loads(text) == {ASK: True}
    except ValueError:
        return False


class Replanning:
    """Asks a planner from where a run is, in a copy of this process; one question at a time.

    Args:
        options: of the command.
        plan: the first plan, whose deadline holds for all.
    """

    def __init__(self, options: WatchCommand, plan: ParametrizedPlan) -> None:
        from robust.execute.planners import create_planner

        self.seconds = float(options.planner_limit)
        rate = Fraction(options.rate or 1)
        given = options.planning_time
        self._time = Fraction(self.seconds) / rate if given is None else Fraction(given)
        self._domain, self._problem = domain_and_problem(options.domain, options.problem)
        self._planner: Planner | None = None
        if options.planner is not None:
            self._planner = create_planner(options.planner, epsilon=options.separation)
        specs, _ = specifications(options.parameter or ("duration:*",), options.parameters)
        self._deadline = deadline_of(plan)
        known = conversion_settings(options, specs, None, None)  # another plan becomes a network as the first
        self._settings = replace(known, deadline=self._deadline, tolerance=None)
        self._epsilon = options.separation
        self._thread: threading.Thread | None = None
        self._open = False
        self._asked: OpenProblem | None = None
        """What is left where a plan was asked for last."""
        self.after = 0
        """The number of the last message before that."""
        self.tries = 0

    @property
    def possible(self) -> bool:
        """Whether there is someone to ask."""
        return self._planner is not None

    @property
    def busy(self) -> bool:
        """Whether a plan has been asked for and there is no answer yet."""
        return self._open

    def over(self) -> None:
        """The answer has come."""
        self._open = False

    def wait(self, seconds: float) -> None:
        """Let the answer come."""
        if self._thread is not None:
            self._thread.join(seconds)

    def note(self, monitor: Monitor) -> OpenProblem:
        """What is left where the run is now."""
        self.after = monitor.count
        known = (self._domain, self._problem, run_state(monitor), self._time, self._epsilon, self._deadline)
        self._asked = OpenProblem(*known)
        return self._asked

    def ask(self, monitor: Monitor, done: Callable[[NewPlan | str], None]) -> Fraction:
        """Ask, and return when a plan would begin; `done` gets it, or why there is none, in another thread.

        Raises:
            RobustError: if no planner can be asked about where the run is.
        """
        remainder = self.note(monitor)
        begins = remainder.origin
        self.tries += 1
        self._open = True
        self._thread = threading.Thread(target=lambda: done(self._answer(remainder)), daemon=True)
        self._thread.start()
        return begins

    def _answer(self, remainder: OpenProblem) -> NewPlan | str:
        def plan() -> NewPlan | str:
            try:
                found = new_plan(remainder, self._planner, self.seconds, self._settings)
            except RobustError as error:
                return " ".join(str(error).split())
            return found if found.texts else ""  # which are written there, not here

        try:
            return from_copy(plan, Deadline.after(self.seconds + 1), "planning")
        except OutOfTimeError:
            return f"no plan that is proved within {self.seconds:g} s"
        except RobustError as error:
            return str(error)

    def resumed(self, line: Object, monitor: Monitor) -> Monitor | None:
        """The monitor after a record about plans; None if it is about something else."""
        if ASK in line.members:
            self.note(monitor)
            return monitor
        if "plan" not in line.members or self._asked is None:
            return None
        types, asked, self._asked = JsonTypes({}), self._asked, None
        network = types.member(str | None, line, "plan")
        if network is None:
            return monitor
        specs = parse_parameter_file(types.member(str, line, "parameters"))
        plan = read_again(*asked.true, parse_stn(network), specs)
        continued = monitor.continued(plan, self.after)
        if continued is None:
            raise InputError("found a plan that does not fit what happened before, expected one that does")
        return continued

    @property
    def is_unanswered(self) -> bool:
        """Whether a journal ends where a plan had been asked for."""
        return self._asked is not None and self._thread is None


def record(found: NewPlan | None) -> Mapping[str, Any]:
    """What a journal says of a plan; None: there is none."""
    return {"plan": None} if found is None else {key: found.texts[key] for key in ("plan", "parameters")}


LOOK = 0.05
"""Seconds between two looks for signals and the time limit, in real time."""
BACKLOG = 1 << 26
"""Bytes of answers that wait for who reads them, where time passes by messages alone."""
EVERY_DURATION = ("duration:*",)
NETWORKS = {".stn"}
"""Suffixes of plans whose orders are statements, and not what a planner happened to choose."""


@action(WatchCommand)
def watch(options: WatchCommand, run: Run) -> int:
    """Follow a plan while others execute it: what may start, how long steps may still take, when nothing is left.

    A line for each message: {"start": "drive r1 a b", "at": 12.5}, end, failed, cancelled; {"tick": 13}; {"retract": 4}
    takes the fourth message back. After each, and before the first, a line says what is ahead.
    """
    given = options if options.parameter or options.parameters else options.changed(parameter=EVERY_DURATION)

    def prepare() -> tuple[Monitor, Replanning, ParametrizedPlan]:
        plan = plans.load(given, run)
        steps = options.plan.suffix.lower() not in NETWORKS
        lateness, seconds = Fraction(options.lateness), float(options.answer_limit)
        chances = distributions(options, plan)
        eager = options.clock == "given"
        monitor = Monitor(plan, options.separation, lateness, seconds, steps, chances, eager)
        monitor.assess()  # loads all that later answers need, too
        return monitor, Replanning(given, plan), plan

    monitor, replanning, plan = run.only(prepare)
    gc.freeze()  # garbage collection looks at nothing of this again, so that its pauses are short
    if sys.stdin is None:  # closed by the caller
        raise InputError("found no standard input, expected lines of JSON", Location("stdin"))
    path = options.journal
    page = None
    if options.page is not None:
        from robust.cli.page import page_for

        page = page_for(run, options.page, options.page_host, f"{plan.name}: what is ahead")
    server = _WatchServer(options, run, monitor, replanning, page)
    if path is not None:
        server.journal = run.only(lambda: read_journal(path, plan, options.separation, server.resume))
    try:
        server.serve()
    except BrokenPipeError as error:
        output.drop_output(error)
    finally:
        if page is not None:
            page.close()
        if server.journal is not None:
            server.journal.close()
    prospect = server.monitor.assess(Deadline.after(float(options.answer_limit))).prospect.value
    return {"done": 0, "broken": 1}.get(prospect, UNDECIDED)


def distributions(options: WatchCommand, plan: ParametrizedPlan) -> Mapping[str, Distribution]:
    """The distributions of durations, if any are asked for."""
    if not options.distribution and options.world is None:
        return {}
    from robust.api import randomness_of

    known = randomness_of(plan, options.distribution, world=options.world)
    if known.factors or known.joints:
        raise InputError("found durations that depend on each other, expected independent ones", Location("--world"))
    return known.distributions


class _WatchServer:
    """Answers one message after the other; other plans arrive in another thread, between two of them."""

    def __init__(
        self, options: WatchCommand, run: Run, monitor: Monitor, replanning: Replanning, page: PageServer | None
    ) -> None:
        self._options, self._run, self.monitor, self._replanning = options, run, monitor, replanning
        self.journal: RecordFile | None = None
        self._deadline = Deadline.after(run.remaining)
        self._reader = LineReader(sys.stdin.fileno())
        sys.stdout.flush()
        room = BACKLOG if options.clock == "given" else 0  # by a clock, only the last answer is about the present
        self._writer = LineWriter(sys.stdout.fileno(), lambda: run.guard.cause is not None, self._deadline, room)
        self._busy = threading.RLock()
        self._before: Outlook | None = None
        self._assessed: Outlook | None = None
        """The last answer that lacked nothing, or to which no more is said."""
        self._failure: BaseException | None = None
        self._page = None if page is None else _WatchPage(page, options)

    def resume(self, line: Object) -> None:
        """Take a record of the journal."""
        other = self._replanning.resumed(line, self.monitor)
        if other is None:
            self.monitor.take(message_of(line))
        else:
            self.monitor = other

    def serve(self) -> None:
        """Until the input ends, and a plan that was asked for has come.

        Raises:
            KeyboardInterrupt, OutOfTimeError: if that is earlier; all that was said is answered and in the journal.
        """
        with self._busy:
            self._say(self.monitor.outlook())
            if self._replanning.is_unanswered and self._replanning.possible:
                self._ask_again()
        if self._options.clock == "given":
            while True:
                while self._writer.is_behind and not self._reader.wait(LOOK):
                    self._go_on()
                with self._run.working():
                    heard = self._hear(None)
                if heard is None:
                    break
                self._answer(heard)
        else:
            self._serve_real_time()
        while self._is_waiting():
            self._go_on()
            self._replanning.wait(LOOK)
        self._writer.finish()

    def _is_waiting(self) -> bool:
        with self._busy:  # an answer that has come is said first
            self._raise_failure()
            return self._replanning.busy

    def _raise_failure(self) -> None:
        """Raise what went wrong in the other thread."""
        if self._failure is not None:
            raise self._failure

    def _go_on(self) -> None:
        """Raise what ends the run; say what has not been read."""
        self._raise_failure()
        self._run.enforce(self._deadline)
        with self._busy:
            self._writer.go_on()

    def _say(self, outlook: Outlook, news: Mapping[str, Any] | None = None) -> None:
        before, self._before = self._before, outlook
        line = outlook_line(outlook, self._options.numbers, self._options.coming, news)
        self._writer.offer(line, stays=news is not None)  # things happen while nobody reads
        if self._page is not None:
            self._page.show(self.monitor, outlook, before, news)

    def _answer(self, heard: Heard) -> None:
        with self._busy:
            self._raise_failure()
            if isinstance(heard, InputError):
                self._complain(str(heard))
                return
            if isinstance(heard, str):
                self._ask()
                return
            if self.journal is not None:
                self.journal.append(heard.as_dict())
            before = self._before
            self._say(self.monitor.tell(heard))
            if heard.kind is not MessageKind.TICK:
                self._replanning.tries = 0
            broke = before is not None and before.prospect is not Prospect.BROKEN
            if broke and self._replanning.possible:
                self._ask_if_broken()

    def _complain(self, error: str) -> None:
        self._writer.offer(not_a_message(error), stays=True)
        if self._page is not None:
            self._page.complain(self.monitor, error)

    # -- other plans ---------------------------------------------------------------------------------------------------

    def _ask_if_broken(self) -> None:
        if self._before is not None and self._before.prospect is Prospect.BROKEN and not self._replanning.busy:
            self._ask()

    def _ask(self) -> None:
        """Ask for another plan, and say that, or why not."""
        if not self._replanning.possible:
            self._complain("found a message that asks for another plan, expected it with --planner NAME")
        elif self._replanning.busy:
            self._complain("another plan has been asked for already; expected its answer first")
        elif self._replanning.tries >= REPLANS:
            self._news({"status": "failed", "reason": f"gave up after {REPLANS} plans since something happened"})
        else:
            if self.journal is not None:
                self.journal.append({ASK: self.monitor.count})
            self._ask_again()

    def _ask_again(self) -> None:
        try:
            begins = self._replanning.ask(self.monitor, self._take_plan)
        except RobustError as error:
            self._news({"status": "failed", "reason": str(error)})
        else:
            self._news({"status": "asked", "begins": begins, "limit_s": self._replanning.seconds})

    def _news(self, news: Mapping[str, Any]) -> None:
        self._say(self.monitor.outlook(), news)

    def _take_plan(self, found: NewPlan | str) -> None:
        """Go on with another plan, between two answers; what goes wrong is for the main thread."""
        try:
            with self._busy:
                self._adopt(found)
        except (RobustError, OSError, KeyboardInterrupt, OutOfTimeError) as error:
            self._failure = error

    def _adopt(self, found: NewPlan | str) -> None:
        self._replanning.over()
        try:
            other = None if isinstance(found, str) else self.monitor.continued(found.plan, self._replanning.after)
        except RobustError as error:
            found, other = str(error), None
        if isinstance(found, str):
            if self.journal is not None:
                self.journal.append(record(None))
            self._news({"status": "failed", "reason": found})
        elif other is None:
            self._news({"status": "overtaken", "reason": "something happened that the plan does not know of"})
            self._ask()
        else:
            if self.journal is not None:
                self.journal.append(record(found))
            self.monitor = other
            self._news(found.as_news)
            self._ask_if_broken()

    def _hear(self, clock: WallClock | None) -> Heard | None:
        """The next message, or what is wrong with its line; None at the end."""
        while True:
            try:
                line = self._reader.read(self._deadline if clock is None else NEVER)
                if line is None:
                    return None
                if asks_for_plan(line):
                    return ASK
                if line.strip():
                    return read_message(line, self._reader.number, None if clock is None else _on_grid(clock.now()))
            except InputError as error:
                return error

    def _assess(self, clock: WallClock, idle: Callable[[], bool]) -> None:
        """Say what the last answer did not wait for: whether other orders are left, and, if nothing is heard and no
        answer is due before that is known, how probable success is, and how wide a promise may be."""
        before = self._before
        if before is None or before is self._assessed:
            return
        with self._busy:
            if before.prospect is Prospect.UNDECIDED and not before.replan:
                self._say_more(Deadline.after(self.monitor.seconds))
            elif (self.monitor.distributions or not before.exact) and idle():
                wake = None if before.wake is None else max(0, clock.seconds_until(before.wake))
                due = min((time for time in (wake, self._deadline.remaining) if time is not None), default=None)
                self._say_more(replace(Deadline.after(due), idle=idle))

    def _say_more(self, deadline: Deadline) -> None:
        before, outlook = self._before, self.monitor.assess(deadline)
        if before is not None and outlook != replace(before, refused=None):
            self._say(outlook)
            if self._replanning.possible:
                self._ask_if_broken()
        self._assessed = self._before

    def _serve_real_time(self) -> None:
        """What has come is heard, as of when it came, before time passes."""
        clock = WallClock(Fraction(self._options.rate or 1), self.monitor.time)
        inbox = listening(partial(self._hear, clock))
        while True:
            self._go_on()
            self._assess(clock, inbox.empty)
            wake = None if self._before is None else self._before.wake
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


class _WatchPage:
    """What the page shows of a plan that is watched."""

    def __init__(self, page: PageServer, options: WatchCommand) -> None:
        from robust.draw.live import LastWords

        self._page, self._words = page, LastWords()
        self._rate = Fraction(options.rate or 1) if options.clock == "real" else None
        self._outlook: Outlook | None = None

    def show(self, monitor: Monitor, outlook: Outlook, before: Outlook | None, news: Mapping[str, Any] | None) -> None:
        """Show what is ahead; where nothing is, what was ahead before."""
        from robust.draw.live import KINDS, of_broken

        if outlook.refused is not None:
            self._words.add(outlook.time, f"refused: {outlook.refused}", "open")
        for text in outlook.assumed:
            if before is None or text not in before.assumed:
                self._words.add(outlook.time, f"assumed: {text}", "open")
        if before is not None and outlook.prospect is not before.prospect:
            self._words.add(outlook.time, outlook.prospect.value, KINDS[outlook.prospect.value])
        if news is not None:
            self._words.add(outlook.time, f"another plan: {news['status']} {news.get('reason', '')}".strip())
        self._outlook = of_broken(outlook, self._outlook)
        self._show(monitor)

    def complain(self, monitor: Monitor, error: str) -> None:
        """Show that a line was no message."""
        self._words.add(monitor.time, error, "bad")
        self._show(monitor)

    def _show(self, monitor: Monitor) -> None:
        from robust.draw.live import watched

        outlook, ended, words = self._outlook, monitor.ended, self._words.newest_first
        if outlook is not None:
            self._page.show(lambda: watched(outlook, ended, self._rate, words))


def _on_grid(time: Fraction) -> Fraction:
    """In thousandths, rounded down."""
    return Fraction(floor(time * 1000), 1000)
