"""Simulated worlds: distributions, files, luck and actions; and executives in them, simulated and in real time."""

import asyncio
import math
from fractions import Fraction
from random import Random
from statistics import fmean

import pytest

from robust.errors import InputError
from robust.execute.dispatcher import Completed, Dispatch, Dispatcher, DispatchFailed, Observed
from robust.execute.drive import WallClock, drive, run_in_world
from robust.execute.worlds import Below, InstanceOutcome, Luck, Rule, Rules, SimulatedWorld, Subject, parse_rules
from robust.plan.model import Atom, Fluent
from tests.execute.plans import PLAN, constant, tasks_dispatchable

F = Fraction
FILE = """
[[draw]]
duration = "w1"
distribution = "normal"
deviation = 2.5
minimum = 4
below = "clip"

[[draw]]
duration = "(fetch b)"
distribution = "uniform"
lower = 1
upper = "7/3"

[[draw]]
consumption = "need"
distribution = "uniform"
lower = 0.5
upper = 1.5
relative = true

[[draw]]
parameter = "first"
distribution = "half-normal"
deviation = 3
"""


CONSTANTS = ("w1", 3), ("work", 5)


def rule(distribution, below=Below.FOLD, **numbers):
    return Rule(Subject.PARAMETER, "p", distribution, {key: F(value) for key, value in numbers.items()}, below)


def many(rule, count=4000):
    random = Random(7)  # noqa: S311 - reproducible
    return [rule.about(F(0)).draw(random) for _ in range(count)]


def test_draws_are_exact_and_fill_their_distributions():
    assert many(rule("constant", value=F(1, 3)), 2) == [F(1, 3), F(1, 3)]
    uniform = many(rule("uniform", lower=F(1, 3), upper=F(2, 3)))
    assert F(1, 3) <= min(uniform) < F(34, 100)
    assert F(66, 100) < max(uniform) <= F(2, 3)
    half = many(rule("half-normal", origin=2, deviation=3))
    assert min(half) >= 2
    assert abs(fmean(map(float, half)) - (2 + 3 * math.sqrt(2 / math.pi))) < 0.15
    plain = many(rule("normal", mean=10, deviation=5))
    assert abs(fmean(map(float, plain)) - 10) < 0.3
    assert all(isinstance(value, Fraction) and 1000 % value.denominator == 0 for value in (*plain, *half))
    folded = many(rule("normal", mean=10, deviation=5, minimum=8))
    assert folded == [value if value >= 8 else 16 - value for value in plain]
    clipped = many(rule("normal", Below.CLIP, mean=10, deviation=5, minimum=8))
    assert clipped == [max(value, F(8)) for value in plain]


def test_a_world_file_is_read_exactly():
    rules, instances = parse_rules(FILE), tasks_dispatchable().plan.instance
    w1, f = rules.duration(instances["w1"]), rules.duration(instances["f"])
    assert (w1.of(F(10)), w1.below) == ({"mean": 10, "deviation": F(5, 2), "minimum": 4}, Below.CLIP)
    assert f.of(F(2)) == {"lower": 1, "upper": F(7, 3)}
    need = rules.consumption(Fluent("need", ("b",)))
    assert (need.of(F(4)), need.of(F(-4))) == ({"lower": 2, "upper": 6}, {"lower": -6, "upper": -2})
    assert rules.parameter("first").of(F(10)) == {"origin": 10, "deviation": 3}
    assert rules.duration(instances["w2"]) is rules.parameter("second") is None
    # The first rule that fits counts.
    constants = (f'[[draw]]\nduration = "{name}"\ndistribution = "constant"\nvalue = {n}\n' for name, n in CONSTANTS)
    both = parse_rules("".join(constants))
    assert [both.duration(instances[name]).of(F(1)) for name in ("w1", "w2")] == [{"value": 3}, {"value": 5}]


DURATION, PARAMETER = ("[[draw]]\n" + what + ' = "a"\n' for what in ("duration", "parameter"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1", "found key 'x', expected only tables \\[\\[draw\\]\\]"),
        ("draw = 1", "found a value for 'draw'"),
        ("[[draw]]", "draw 1: found none, expected one of duration, consumption and parameter"),
        (DURATION + 'parameter = "b"', "found duration and parameter"),
        ("[[draw]]\nduration = 3", "found '3' for 'duration', expected a name"),
        (DURATION + 'distribution = "gamma"', "found distribution 'gamma', expected one of constant"),
        (DURATION + 'distribution = "normal"\nminimum = 0', "found no 'deviation'"),
        (DURATION + 'distribution = "normal"\ndeviation = 1', "found no minimum of a duration"),
        (DURATION + 'distribution = "uniform"\nlower = 3\nupper = 2', "lower above upper"),
        (DURATION + 'distribution = "uniform"\nlower = -3\nupper = 2', "found lower -3 of a duration"),
        (DURATION + 'distribution = "constant"\nvale = 2', "found key 'vale'.*did you mean 'value'"),
        (DURATION + 'distribution = "constant"\nvalue = nan', "found 'nan'"),
        (DURATION + 'distribution = "constant"\nvalue = true', "expected a number"),
        (PARAMETER + 'distribution = "half-normal"\ndeviation = -1', "found deviation -1"),
        (PARAMETER + 'distribution = "constant"\nrelative = 1', "expected true or false"),
        (PARAMETER + 'distribution = "normal"\ndeviation = 1\nbelow = "drop"', "expected fold or clip"),
        ("[[draw]", "found text that is not TOML"),
    ],
)
def test_wrong_world_files_say_what_is_wrong(text, message):
    with pytest.raises(InputError, match=message) as raised:
        parse_rules(text, "world.toml")
    assert str(raised.value).startswith("world.toml")
    assert "\n" not in str(raised.value)


def test_luck_does_not_depend_on_the_order_of_draws():
    rules = parse_rules(FILE)
    instances = tasks_dispatchable().plan.instance
    one, other, another = (Luck(rules, seed) for seed in (5, 5, 6))
    w1, f = one.duration(instances["w1"], F(10)), one.duration(instances["f"], F(2))
    assert (other.duration(instances["f"], F(2)), other.duration(instances["w1"], F(10))) == (f, w1)
    assert f not in {one.duration(instances["f"], F(2)), another.duration(instances["f"], F(2))}
    assert one.duration(instances["w2"], F(6)) is None
    assert one.parameter("first", F(1), once=True) == one.parameter("first", F(1), once=True)
    assert one.parameter("first", F(1), once=False) != one.parameter("first", F(1), once=False)


NEED = {"specs": ("need=fluent:(need b)",), "box": {"first": (4, 20), "need": (1, 12)}}


def world_of(*rules, specs=(), box=None):
    dispatchable = tasks_dispatchable(box, PLAN, *specs)
    return dispatchable, SimulatedWorld(dispatchable, Luck(Rules(rules), 0))


def executed(*rules, **options):
    """A dispatcher that has ended, and its world."""
    dispatchable, world = world_of(*rules, **options)
    dispatcher = Dispatcher(dispatchable)
    run_in_world(dispatcher, world)
    return dispatcher, world


def test_without_rules_nature_does_what_is_planned():
    dispatcher, world = executed()
    assert dispatcher.ending is None
    lengths = {name: one.end - one.start for name, one in world.executed.items()}
    assert lengths == {"w1": 10, "f": 2, "w2": 5, "c": 0}
    assert {one.outcome for one in world.executed.values()} == {InstanceOutcome.DONE}
    assert world.state.fluents[Fluent("stock")] == 6
    assert Atom("done", ("b",)) in world.state.atoms


def test_an_action_whose_condition_does_not_hold_does_not_start():
    _, world = world_of()
    plan = world.dispatchable.plan
    world.receive(F(1), [Dispatch(plan.instance["w2"].start, F(1))])
    assert world.messages(F(1)) == [DispatchFailed("w2", F(1), "(ready b) does not hold")]
    assert world.executed == {}


@pytest.mark.parametrize(("length", "fails"), [(60, False), (80, True)])
def test_an_action_whose_condition_stops_to_hold_at_60_fails(length, fails):
    dispatchable, world = world_of(constant(Subject.DURATION, "w1", length), box={"first": (4, 100)})
    world.receive(F(0), [Dispatch(dispatchable.plan.instance["w1"].start, F(0))])
    assert world.next_time == 60
    said = DispatchFailed("w1", F(60), "(open) does not hold") if fails else Completed("w1", F(60))
    assert world.messages(F(60)) == [said]
    assert (world.executed["w1"].outcome, world.executed["w1"].end) == (
        InstanceOutcome.FAILED if fails else InstanceOutcome.DONE,
        60,
    )
    assert world.messages(F(90)) == []
    assert (Atom("done", ("a",)) in world.state.atoms) is not fails


def test_consumption_is_drawn_and_shown():
    dispatcher, world = executed(constant(Subject.CONSUMPTION, "need", 5), **NEED)
    assert (dispatcher.ending, dispatcher.observed["need"]) == (None, 5)
    assert world.state.fluents[Fluent("stock")] == 5
    assert world.state.fluents[Fluent("need", ("b",))] == 4  # what is expected of the next time
    # What an action really needs decides whether it starts.
    dispatcher, _ = executed(constant(Subject.PARAMETER, "need", 11), **NEED)
    assert isinstance(dispatcher.ending, DispatchFailed)
    assert "(>= (stock) (need b)) does not hold" in str(dispatcher.ending)


def test_initial_levels_are_drawn_and_shown_at_the_beginning():
    rule = constant(Subject.PARAMETER, "level", 8)
    dispatchable, world = world_of(rule, specs=("level=fluent:(stock)",), box={"first": (4, 20), "level": (5, 12)})
    assert world.messages(F(0)) == [Observed("level", F(8))]
    assert world.initial[Fluent("stock")] == 8
    known = SimulatedWorld(dispatchable, Luck(Rules((rule,)), 0), levels_known=True)
    assert known.initial[Fluent("stock")] == 10


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
    executive, moment = Echo(), Fraction(3, 200)
    assert run_in_world(executive, Shout(moment)) == Fraction(2, 100)
    told = [(Fraction(1, 100), ()), (moment, ("a",)), (moment, ("b",)), (Fraction(2, 100), ())]
    assert executive.steps == [(Fraction(0), ()), *told]


def test_simulation_stops_at_the_horizon():
    executive = Echo()
    assert run_in_world(executive, Shout(Fraction(5)), horizon=Fraction(19, 1000)) == Fraction(19, 1000)
    assert [moment for moment, _ in executive.steps] == [0, Fraction(1, 100)]


def driven(executive, *messages):
    """What is announced if these messages are there from the beginning."""

    async def run():
        announced, inbox = [], asyncio.Queue()
        for message in messages:
            inbox.put_nowait(message)
        await drive(executive, inbox, lambda now, decisions: announced.extend(decisions), WallClock())
        return announced

    return asyncio.run(run())


def test_real_time_wakes_the_executive_and_hands_over_messages():
    executive = Echo()
    assert driven(executive, "a", "b") == ["a!", "b!"]
    times = [moment for moment, _ in executive.steps]
    assert times == sorted(times)
    assert times[-1] >= Fraction(2, 100)
    assert executive.steps[1][1] == ("a", "b")
    endless = Echo()
    endless.wakes = [Fraction(1000)]
    driven(endless, "a", None)  # the inbox is closed
    assert [messages for _, messages in endless.steps] == [(), ("a",)]
