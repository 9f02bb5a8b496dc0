"""Simulated worlds: distributions, world files, luck, and what becomes of actions."""

import math
from fractions import Fraction
from random import Random
from statistics import fmean

import pytest

from robust.errors import InputError
from robust.execute.dispatch.dispatcher import Completed, Contradicted, Dispatch, Dispatcher, Failed, Observed
from robust.execute.drive import run_in_world
from robust.execute.worlds.rules import Below, Luck, Rule, Rules, Subject, parse_rules
from robust.execute.worlds.world import Outcome, Setting, SimulatedWorld
from robust.plan.model import Atom, Fluent
from tests.execute.execution import PLAN, constant, tasks_dispatchable

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


def rule(distribution, below=Below.FOLD, **numbers):
    return Rule(Subject.PARAMETER, "p", distribution, {key: F(value) for key, value in numbers.items()}, below)


def many(rule, count=4000):
    random = Random(7)  # noqa: S311 - reproducible
    return [rule.draw(F(0), random) for _ in range(count)]


# -- distributions -----------------------------------------------------------------------------------------------------


def test_draws_are_exact_and_on_a_grid():
    for one in (
        rule("uniform", lower=1, upper=2),
        rule("normal", mean=5, deviation=1),
        rule("half-normal", origin=3, deviation=2),
    ):
        assert all(isinstance(value, Fraction) and 1000 % value.denominator == 0 for value in many(one, 50))
    assert many(rule("constant", value=F(1, 3)), 2) == [F(1, 3), F(1, 3)]


def test_uniform_stays_between_its_ends_and_fills_them():
    values = many(rule("uniform", lower=F(1, 3), upper=F(2, 3)))
    assert F(1, 3) <= min(values) < F(34, 100)
    assert F(66, 100) < max(values) <= F(2, 3)


def test_a_normal_with_a_minimum_is_folded_up_or_clipped():
    plain = many(rule("normal", mean=10, deviation=5))
    folded = many(rule("normal", mean=10, deviation=5, minimum=8))
    clipped = many(rule("normal", Below.CLIP, mean=10, deviation=5, minimum=8))
    for value, up, flat in zip(plain, folded, clipped, strict=True):
        assert up == (value if value >= 8 else 16 - value)
        assert flat == max(value, F(8))
    assert abs(fmean(map(float, plain)) - 10) < 0.3


def test_a_half_normal_has_its_mean():
    values = many(rule("half-normal", origin=2, deviation=3))
    assert min(values) >= 2
    assert abs(fmean(map(float, values)) - (2 + 3 * math.sqrt(2 / math.pi))) < 0.15


# -- world files -------------------------------------------------------------------------------------------------------


def test_a_world_file_is_read_exactly():
    rules = parse_rules(FILE)
    instances = tasks_dispatchable().plan.instance
    assert rules.duration(instances["w1"]).of(F(10)) == {"mean": 10, "deviation": F(5, 2), "minimum": 4}
    assert rules.duration(instances["w1"]).below is Below.CLIP
    assert rules.duration(instances["f"]).of(F(2)) == {"lower": 1, "upper": F(7, 3)}
    assert rules.duration(instances["w2"]) is None
    assert rules.consumption(Fluent("need", ("b",))).of(F(4)) == {"lower": 2, "upper": 6}
    assert rules.parameter("first").of(F(10)) == {"origin": 10, "deviation": 3}
    assert rules.consumption(Fluent("need", ("b",))).of(F(-4)) == {"lower": -6, "upper": -2}
    assert rules.parameter("second") is None


def test_the_first_rule_that_fits_counts():
    both = parse_rules(
        '[[draw]]\nduration = "w1"\ndistribution = "constant"\nvalue = 3\n'
        '[[draw]]\nduration = "work"\ndistribution = "constant"\nvalue = 5\n'
    )
    instances = tasks_dispatchable().plan.instance
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
        ("[[draw]", "found no TOML"),
    ],
)
def test_wrong_world_files_say_what_is_wrong(text, message):
    with pytest.raises(InputError, match=message) as raised:
        parse_rules(text, "world.toml")
    assert str(raised.value).startswith("world.toml")
    assert "\n" not in str(raised.value)


# -- luck --------------------------------------------------------------------------------------------------------------


def test_luck_does_not_depend_on_the_order_of_draws():
    rules = parse_rules(FILE)
    instances = tasks_dispatchable().plan.instance
    one, other = Luck(rules, 5), Luck(rules, 5)
    first = (one.duration(instances["w1"], F(10)), one.duration(instances["f"], F(2)))
    second = (other.duration(instances["f"], F(2)), other.duration(instances["w1"], F(10)))
    assert first == second[::-1]
    assert one.duration(instances["f"], F(2)) != first[1]
    assert Luck(rules, 6).duration(instances["f"], F(2)) != first[1]
    assert one.duration(instances["w2"], F(6)) is None


def test_what_is_drawn_once_stays():
    luck = Luck(parse_rules(FILE), 1)
    assert luck.parameter("first", F(1), once=True) == luck.parameter("first", F(1), once=True)
    assert luck.parameter("first", F(1), once=False) != luck.parameter("first", F(1), once=False)


# -- worlds ------------------------------------------------------------------------------------------------------------


def world_of(*rules, specs=(), box=None):
    dispatchable = tasks_dispatchable(box, PLAN, *specs)
    return dispatchable, SimulatedWorld(Setting(dispatchable), Luck(Rules(rules), 0))


def executed(*rules, **options):
    """A dispatcher that has ended, and its world."""
    dispatchable, world = world_of(*rules, **options)
    dispatcher = Dispatcher(dispatchable)
    run_in_world(dispatcher, world)
    return dispatcher, world


def test_without_rules_nature_does_what_is_planned():
    dispatcher, world = executed()
    assert dispatcher.ending is None
    assert {name: (one.outcome, one.end - one.start) for name, one in world.executed.items()} == {
        "w1": (Outcome.DONE, 10),
        "f": (Outcome.DONE, 2),
        "w2": (Outcome.DONE, 5),
        "c": (Outcome.DONE, 0),
    }
    assert world.state.fluents[Fluent("stock")] == 6
    assert Atom("done", ("b",)) in world.state.atoms


def test_an_action_whose_condition_does_not_hold_does_not_start():
    _, world = world_of()
    plan = world.setting.dispatchable.plan
    world.receive(F(1), [Dispatch(plan.instance["w2"].start, F(1))])
    assert world.messages(F(1)) == [Failed("w2", F(1), "(ready b) does not hold")]
    assert world.executed == {}


def test_an_action_whose_condition_stops_to_hold_fails():
    dispatchable, world = world_of(constant(Subject.DURATION, "w1", 80), box={"first": (4, 100)})
    start = dispatchable.plan.instance["w1"].start
    world.receive(F(0), [Dispatch(start, F(0))])
    assert world.next_time == 60
    assert world.messages(F(60)) == [Failed("w1", F(60), "(open) does not hold")]
    assert (world.executed["w1"].outcome, world.executed["w1"].end) == (Outcome.FAILED, 60)
    assert world.messages(F(90)) == []
    assert Atom("done", ("a",)) not in world.state.atoms


def test_an_action_may_end_at_the_very_moment():
    dispatchable, world = world_of(constant(Subject.DURATION, "w1", 60), box={"first": (4, 100)})
    world.receive(F(0), [Dispatch(dispatchable.plan.instance["w1"].start, F(0))])
    assert world.messages(F(60)) == [Completed("w1", F(60))]


def test_consumption_is_drawn_and_shown():
    rule = constant(Subject.CONSUMPTION, "need", 5)
    dispatcher, world = executed(rule, specs=("need=fluent:(need b)",), box={"first": (4, 20), "need": (1, 6)})
    assert dispatcher.ending is None
    assert dispatcher.observed["need"] == 5
    assert world.state.fluents[Fluent("stock")] == 5
    assert world.state.fluents[Fluent("need", ("b",))] == 4  # what is expected of the next time


def test_what_an_action_really_needs_decides_whether_it_starts():
    rule = constant(Subject.PARAMETER, "need", 11)
    dispatcher, _ = executed(rule, specs=("need=fluent:(need b)",), box={"first": (4, 20), "need": (1, 12)})
    assert isinstance(dispatcher.ending, Contradicted)
    assert "(>= (stock) (need b)) does not hold" in str(dispatcher.ending)


def test_initial_levels_are_drawn_and_shown_at_the_beginning():
    rule = constant(Subject.PARAMETER, "level", 8)
    dispatchable, world = world_of(rule, specs=("level=fluent:(stock)",), box={"first": (4, 20), "level": (5, 12)})
    assert world.messages(F(0)) == [Observed("level", F(8))]
    assert world.initial[Fluent("stock")] == 8
    known = SimulatedWorld(Setting(dispatchable), Luck(Rules((rule,)), 0), levels_known=True)
    assert known.initial[Fluent("stock")] == 10
