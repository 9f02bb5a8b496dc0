"""Executives and the time they run in: one core for simulated and for real time.

An executive is a state machine that never looks at a clock: it is told what happened and how late it is, answers with
what it decided, and says when it wants to be asked again. :func:`run_in_world` runs it against a world that knows its
own future, at once and the same each time; :func:`drive` runs it against a queue of messages in the time of a clock.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Protocol, TypeVar

Message = TypeVar("Message")
Decision = TypeVar("Decision")
_Message_co = TypeVar("_Message_co", covariant=True)
_Message_contra = TypeVar("_Message_contra", contravariant=True)
_Decision_co = TypeVar("_Decision_co", covariant=True)
_Decision_contra = TypeVar("_Decision_contra", contravariant=True)


class Executive(Protocol[_Message_contra, _Decision_co]):
    """A decision maker. Times are in the plan's unit and never decrease from call to call."""

    def step(self, now: Fraction, messages: Sequence[_Message_contra]) -> Sequence[_Decision_co]:
        """Take note of messages that arrived since the last step, and decide what is done now."""

    @property
    def wake(self) -> Fraction | None:
        """Time of the next step if no message comes before; None if there is none. Later than the last step, unless
        that was too short to decide everything."""

    @property
    def ended(self) -> bool:
        """Whether there is nothing left to decide, for good or for ill."""


class World(Protocol[_Message_co, _Decision_contra]):
    """The environment: it receives decisions and produces messages."""

    def receive(self, now: Fraction, decisions: Sequence[_Decision_contra]) -> None:
        """Decisions take effect."""

    @property
    def next_time(self) -> Fraction | None:
        """Time of the next messages if nothing else is decided; None if none come."""

    def messages(self, now: Fraction) -> Sequence[_Message_co]:
        """The messages of this moment; each is returned once."""


class WallClock:
    """Real time, from 0 at the start of the execution: one unit of the plan lasts a number of seconds.

    It never goes back, whatever is done to the computer's clock.
    """

    def __init__(self, unit_seconds: Fraction = Fraction(1), start: Fraction = Fraction(0)) -> None:
        self._unit = unit_seconds
        self._start = start
        self._origin = time.monotonic_ns()

    def now(self) -> Fraction:
        """The time, in the plan's unit."""
        return self._start + Fraction(time.monotonic_ns() - self._origin, 10**9) / self._unit

    def seconds_until(self, moment: Fraction) -> float:
        """Seconds to sleep until a moment; below 0 once it has passed."""
        return float((moment - self.now()) * self._unit)


def run_in_world(
    executive: Executive[Message, Decision],
    world: World[Message, Decision],
    *,
    start: Fraction = Fraction(0),
    horizon: Fraction | None = None,
) -> Fraction:
    """Run until the executive has ended, nothing more will happen, or the horizon has passed.

    Messages that a decision causes at once are delivered in another step of the same time.

    Args:
        executive: what decides, such as :class:`robust.pike.PlanExecutive`.
        world: what sends messages and receives decisions.
        start: the time of the first step, in the plan's unit.
        horizon: the time after which there is no step; None: none.

    Returns:
        The time of the last step, or the horizon.
    """
    now = start
    while True:
        world.receive(now, executive.step(now, world.messages(now)))
        if executive.ended:
            return now
        coming = world.next_time
        if coming is None or coming > now:  # else there is no need to ask, which may take long
            times = [moment for moment in (executive.wake, coming) if moment is not None]
            if not times:
                return now
            now = max(now, min(times))
        if horizon is not None and now > horizon:
            return horizon


async def drive(
    executive: Executive[Message, Decision],
    inbox: asyncio.Queue[Message | None],
    announce: Callable[[Fraction, Sequence[Decision]], None],
    clock: WallClock,
) -> Fraction:
    """Run in the time of a clock until the executive has ended or None closes the inbox.

    The executive decides in a thread of its own, one step at a time, so that the event loop goes on meanwhile.

    Args:
        executive: what decides, such as :class:`robust.pike.PlanExecutive`.
        inbox: the messages as they come; None is the last.
        announce: called with the time of each step, in the plan's unit, and what was decided.
        clock: tells the time.

    Returns:
        The time of the last step.
    """
    messages: list[Message] = []
    closed = False
    while True:
        now = clock.now()
        announce(now, await asyncio.to_thread(executive.step, now, messages))
        if closed or executive.ended:
            return now
        messages = []
        wake = await asyncio.to_thread(lambda: executive.wake)
        timeout = None if wake is None else max(0.0, clock.seconds_until(wake))
        arrived: list[Message | None] = []
        if inbox.empty():  # what has come is heard even if the next step is overdue
            try:
                arrived.append(await asyncio.wait_for(inbox.get(), timeout))
            except TimeoutError:
                continue
        while not inbox.empty():
            arrived.append(inbox.get_nowait())
        closed = None in arrived
        messages = [message for message in arrived if message is not None]
