"""One executive, simulated and in real time."""

import asyncio
from fractions import Fraction

from robust.execute.drive import WallClock, drive, run_in_world


class Echo:
    """Answers every message, asks to be woken twice, and ends after the second time."""

    def __init__(self):
        self.steps = []
        self.wakes = [Fraction(1, 100), Fraction(2, 100)]

    def step(self, now, messages):
        self.steps.append((now, tuple(messages)))
        while self.wakes and self.wakes[0] <= now:
            self.wakes.pop(0)
        return [f"{message}!" for message in messages]

    @property
    def wake(self):
        return self.wakes[0] if self.wakes else None

    @property
    def ended(self):
        return not self.wakes


class Shout:
    """Says one thing at a set time, and another at once when it is answered."""

    def __init__(self, moment):
        self.pending = [(moment, "a")]

    def receive(self, now, decisions):
        self.pending += [(now, "b") for decision in decisions if decision == "a!"]

    @property
    def next_time(self):
        return min((moment for moment, _ in self.pending), default=None)

    def messages(self, now):
        due = [text for moment, text in self.pending if moment <= now]
        self.pending = [entry for entry in self.pending if entry[0] > now]
        return due


def test_simulation_steps_at_messages_and_wakes_and_delivers_consequences_at_the_same_time():
    executive = Echo()
    last = run_in_world(executive, Shout(Fraction(3, 200)))
    moment = Fraction(3, 200)
    assert executive.steps == [
        (Fraction(0), ()),
        (Fraction(1, 100), ()),
        (moment, ("a",)),
        (moment, ("b",)),
        (Fraction(2, 100), ()),
    ]
    assert last == Fraction(2, 100)


def test_simulation_stops_at_the_horizon():
    executive = Echo()
    assert run_in_world(executive, Shout(Fraction(5)), horizon=Fraction(1, 50) - Fraction(1, 1000)) == Fraction(
        19, 1000
    )
    assert [moment for moment, _ in executive.steps] == [0, Fraction(1, 100)]


def test_real_time_wakes_the_executive_and_hands_over_messages():
    async def run():
        executive, announced = Echo(), []
        inbox = asyncio.Queue()
        inbox.put_nowait("a")
        inbox.put_nowait("b")
        await drive(executive, inbox, lambda now, decisions: announced.extend(decisions), WallClock())
        return executive, announced

    executive, announced = asyncio.run(run())
    assert announced == ["a!", "b!"]
    times = [moment for moment, _ in executive.steps]
    assert times == sorted(times)
    assert times[-1] >= Fraction(2, 100)
    assert executive.steps[1][1] == ("a", "b")


def test_real_time_ends_when_the_inbox_is_closed():
    async def run():
        executive, inbox = Echo(), asyncio.Queue()
        executive.wakes = [Fraction(1000)]
        inbox.put_nowait("a")
        inbox.put_nowait(None)
        await drive(executive, inbox, lambda now, decisions: None, WallClock())
        return executive

    executive = asyncio.run(run())
    assert [messages for _, messages in executive.steps] == [(), ("a",)]
