"""The dispatcher: its decisions, what reveals parameters, every way in which observations go wrong, and its promise."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import pytest

from benchmarks.irr.figure4 import recorded_instances
from robust import Box, InputError, envelope
from robust.execute import dispatcher as told
from robust.execute.controllable_boxes import Dynamically, ends_of, parametric_stnu
from robust.execute.dispatchable import (
    Blex,
    Dreex,
    Guarantee,
    Slice,
    dispatch_network,
    first_windows,
    make_dispatchable,
    parse_executor,
)
from robust.execute.dispatcher import Completed, Dispatcher, DispatchFailed, Observed, Phase, StateEstimate
from robust.execute.drive import run_in_world
from robust.execute.replan import ReplanningOptions, prepare_plan
from robust.execute.slices import Observations, SliceAnswer, continued
from robust.execute.worlds import Luck, SimulatedWorld
from robust.network.dispatchable import Windows
from robust.plan.model import ZERO, Atom, Fluent, Parameter
from robust.plan.simulate import simulate
from robust.qe.compute import RegionSearch
from robust.reading import load_plan
from robust.smt.limits import NEVER
from tests.execute import plans
from tests.execute.plans import EPSILON, PLAN, PLANS, box_of, interval, tasks, tasks_dispatchable, with_box, working
from tests.plan.building import at, between, reference
from tests.sampling import Network, often

F = Fraction


def decided(dispatcher, now, *messages):
    """The decisions of one step as texts; rejections and endings as they are."""
    plain = told.Dispatch | told.DispatchSucceeded
    decisions = dispatcher.step(F(now), messages)
    return [str(decision) if isinstance(decision, plain) else decision for decision in decisions]


def after(dispatcher, *steps):
    """The decisions of the last of these steps: each is a time with the messages that arrive then."""
    return [decided(dispatcher, now, *messages) for now, *messages in steps][-1]


WORKED = Completed("w1", F(7))
FETCHED = ((7, WORKED), (8,), (10, Completed("f", F(10))))


def begun(*needed, **options):
    dispatcher = Dispatcher(tasks_dispatchable(*needed), **options)
    assert decided(dispatcher, 0) == ["start w1"]
    return dispatcher


def test_a_plan_is_carried_out():
    dispatcher = begun()
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC
    # 60 is the end of everything, 5 + 2 and two gaps come before it; 20 and ε is when the observation is overdue
    assert dispatcher.wake == 20 + EPSILON
    work = dispatcher.dispatchable.plan.instance["w2"]
    assert dispatcher.window(work.start) == (6 + 2 * EPSILON, F(55)), "certainly and possibly, within the box 4 ... 20"
    assert decided(dispatcher, 7, WORKED) == []
    assert (dispatcher.observed, dispatcher.wake) == ({"first": 7}, 7 + EPSILON)
    assert dispatcher.window(work.start) == (9 + 2 * EPSILON, F(55))
    assert decided(dispatcher, 7 + EPSILON) == ["start f", "start c"]
    assert decided(dispatcher, 9 + EPSILON, Completed("f", 9 + EPSILON)) == []
    assert decided(dispatcher, 9 + 2 * EPSILON) == ["start w2"]
    assert (dispatcher.running, dispatcher.wake) == (("w2",), 14 + 2 * EPSILON)
    assert decided(dispatcher, 14 + 2 * EPSILON) == ["end w2", "all done"]
    assert (dispatcher.ended, dispatcher.wake, dispatcher.ending) == (True, None, None)
    assert dispatcher.times[work.end] == 14 + 2 * EPSILON


def revealed(dispatchable):
    return {(shown.parameter, shown.means.value, str(shown.point)) for shown in dispatchable.revelations}


def test_what_reveals_each_parameter():
    assert ("a1.use", "level", "a1.end") in revealed(with_box(*PLANS[2]))
    assert revealed(with_box(*PLANS[5])) == {("yield", "level", "sun.end"), ("on_1", "time", "use_1.end")}
    assert ("start_1", "time", "pour_1.start") in revealed(with_box(*PLANS[3]))
    first = ("first", "time", "w1.end")
    levels = {("level", "initial level", ".zero"), ("need", "level", "f.end")}
    assert revealed(make_dispatchable(tasks(PLAN, "level=fluent:(stock)", "need=fluent:(need b)"))) == {first, *levels}
    assert revealed(make_dispatchable(tasks(PLAN, "need=fluent:(need a)"))) == {first}


def test_an_observation_above_the_box_ends_the_plan_when_it_is_overdue():
    dispatcher = begun()
    assert decided(dispatcher, 20) == []
    ending = told.LeftBox("first", "first", None, interval((4, 20)), 20 + EPSILON)
    assert (decided(dispatcher, 20 + EPSILON), str(ending)) == ([ending], "first exceeds 20")
    assert (dispatcher.phase, dispatcher.ended) == (Phase.DRAINING, False)
    assert (decided(dispatcher, 31, Completed("w1", F(31))), dispatcher.ended) == ([], True)
    assert [(observation.value, observation.inside) for observation in dispatcher.observations] == [(31, False)]


CALLED = 12, DispatchFailed("c", F(12), "nobody answers")
OBSERVED = (7, WORKED), (8,), (10, Completed("f", F(10)), Observed("need", F(5), "f"))
ELSEWHERE = (7, WORKED), (8,), (10, Completed("f", F(10)), Observed("need", F(5), "c"))
POOR = StateEstimate(F(8), frozenset({Atom("open")}), {Fluent("stock"): F(3), Fluent("need", ("b",)): F(4)})
READY = StateEstimate(F(0), frozenset({Atom("ready", ("a",))}))


@pytest.mark.parametrize(
    ("options", "steps", "said", "ended"),
    [
        # outside of the box, which is known at once or when it is overdue; w1 is running then
        ({}, [(3, Completed("w1", F(3)))], ["first = 3 is outside [4, 20]"], True),
        ({"need": True}, [(1, Observed("need", F(7)))], ["need = 7 is outside [1, 6]"], False),
        ({"drain": False}, [(20 + EPSILON,)], ["first exceeds 20"], True),
        ({"drain": False}, [(3, Completed("w1", F(3))), (4, Completed("w1", F(4)))], [], True),
        # what nature runs is waited for, and what is ours is ended: w2 began at 11 and lasts for 5 at least
        ({}, [*FETCHED, (11,), CALLED], ["c failed: nobody answers"], False),
        ({}, [*FETCHED, (11,), CALLED, (16,)], ["end w2"], True),
        ({}, [*FETCHED, (56,)], ["w2.start missed: possible until 55, because of .zero"], True),
        # levels that are waited for
        ({"need": True}, [*OBSERVED, (11,), (16,)], ["end w2", "all done"], True),
        ({"need": True, "patience": F(1, 2)}, [*FETCHED, (F(21, 2),)], ["need was not observed by 10"], True),
        ({"need": True, "patience": F(1, 2)}, [*ELSEWHERE, (F(21, 2),)], ["need was not observed by 10"], True),
        # states that contradict the plan, until the next event
        ({}, [(7, WORKED), (8, POOR)], ["f failed: (>= (stock) (need b)) does not hold"], True),
        ({"first": [StateEstimate(F(0), frozenset())]}, [], ["w1 failed: (ready a) does not hold"], True),
        ({"first": [READY]}, [], ["start w1"], False),
        ({"first": [READY]}, [(7, WORKED), (8,)], ["start f", "start c"], False),
    ],
)
def test_stories(options, steps, said, ended):
    given = dict(options)
    need, first = given.pop("need", False), given.pop("first", ())
    needed = {"first": (4, 20), "need": (1, 6)}, PLAN, "need=fluent:(need b)"
    dispatcher = Dispatcher(tasks_dispatchable(*needed if need else ()), **given)
    decisions = after(dispatcher, (0, *first), *steps)
    assert (list(map(str, decisions)), dispatcher.ended) == (said, ended)


def test_messages_come_late_and_out_of_order_and_twice():
    dispatcher = Dispatcher(with_box(*PLANS[3]))
    after(dispatcher, (0,), (40, Completed("pour_1", F(32)), told.Started("pour_1", F(20))))
    assert (dispatcher.observed, dispatcher.rejected) == ({"start_1": 20}, [])
    dispatcher = begun()
    assert decided(dispatcher, 12, WORKED) == ["start f", "start c"]
    assert decided(dispatcher, 12, WORKED, Observed("first", F(7))) == []
    assert dispatcher.observed == {"first": 7}
    assert dispatcher.times[dispatcher.dispatchable.plan.instance["f"].start] == 12


def test_a_value_that_is_seen_bounds_what_else_it_stands_for():
    plan = working("w2.start - w1.end in [first, 10]", "w2.end - w2.start in [5, 8]")
    dispatcher = begun({"first": (4, 20)}, plan)
    assert dispatcher.dispatchable.guarantee is Guarantee.WEAK
    start = dispatcher.dispatchable.plan.instance["w2"].start
    assert dispatcher.window(start) == (8, 30)
    assert (decided(dispatcher, 7, WORKED), dispatcher.window(start)) == ([], (14, 17))


@pytest.mark.parametrize(
    ("now", "message", "reason"),
    [
        (5, Completed("w1", F(6)), "found time 6, which is yet to come"),
        (5, Completed("w1", F(-1)), "found time -1, expected one from 0 on"),
        (5, Observed("first", F(7)), "first is revealed by the time of w1.end, which has not happened"),
        (7, Completed("w1", F(8)), "w1.end has happened at 7 already; the first time stands"),
        (7, Completed("w2", F(7)), "w2.end cannot happen before w2.start"),
        (7, Completed("w1", float("nan")), "found time nan, expected an exact number"),
        (7, Completed("w9", F(7)), "found instance 'w9', expected one of the plan; known are c, f, w1, w2"),
        (7, told.Started("w2", F(7)), "w2.start is the dispatcher's to choose"),
        (7, Observed("frist", F(1)), "found parameter 'frist', expected one of the plan; did you mean 'first'?"),
        (7, Observed("first", float("nan")), "found nan for 'first', expected an exact number"),
        (7, Observed("first", "7"), "found '7' for 'first', expected an exact number"),
        (7, Observed("first", True), "found True for 'first', expected an exact number"),
        (7, Observed("first", F(9)), "first = 7 was observed already; the first value stands"),
        (7, StateEstimate(F(99), frozenset()), "found time 99, which is yet to come"),
        (7, DispatchFailed("w1", F(7), "late"), "w1 has ended already"),
        (7, "hello", "found str, expected a message"),
    ],
)
def test_faulty_messages_are_rejected_in_one_line_and_change_nothing(now, message, reason):
    dispatcher = begun()
    if now == 7:
        decided(dispatcher, 7, WORKED)
    before = dispatcher.times
    (rejected,) = decided(dispatcher, now, message)
    assert isinstance(rejected, told.MessageRejected)
    assert (rejected.reason, "\n" in str(rejected)) == (reason, False)
    assert (dispatcher.times, dispatcher.phase, dispatcher.rejected) == (before, Phase.DISPATCHING, [rejected])


def test_executors_by_name():
    assert parse_executor("dreex") == Dreex()
    assert (parse_executor("slice"), parse_executor("slice:2")) == (Slice(0.05), Slice(2.0))
    for text, share in (("BLEX:30", "3/10"), ("blex:0", "0"), ("blex:12.5", "1/8"), ("blex:100", "1")):
        assert parse_executor(text) == Blex(F(share))
    for message, texts in (
        ("--executor", "drex blex blex: blex:x blex:101 blex:-1 dreex:3"),
        ("seconds", "slice: slice:0 slice:-1 slice:x"),
    ):
        for text in texts.split():
            with pytest.raises(InputError, match=message):
                parse_executor(text)


def test_blex_accepts_a_share_of_every_duration_and_finds_out_when_it_is_too_late():
    dispatchable = make_dispatchable(tasks(), executor=Blex(F(1, 2)))
    assert dispatchable.guarantee is Guarantee.NONE
    assert dispatchable.box == box_of(first=(5, 15))
    for ends, ending in ((3, "the time from f.start to f.end exceeds 3"), (1, "None")):
        dispatcher = Dispatcher(dispatchable)
        fetched = [Completed("f", F(17))] if ends == 1 else []
        after(dispatcher, (0,), (15, Completed("w1", F(15))), (16,), (16 + ends + EPSILON, *fetched))
        assert str(dispatcher.ending) == ending
    dispatcher = Dispatcher(make_dispatchable(tasks(PLAN.replace("default 10", "default 50")), executor=Blex(F(1, 5))))
    # 56 leaves no time for the rest; DREEX would have been told by its box
    assert after(dispatcher, (0,), (56, Completed("w1", F(56)))) == []
    assert "start f" in decided(dispatcher, 57)


@pytest.mark.parametrize(
    ("length", "intervals", "expected"),
    [
        (reference("p"), {"p": "(4, 20]"}, "(4, 20]"),
        (reference("p"), {"p": "[4, inf)"}, "[4, inf)"),
        (-reference("p") + 30, {"p": "(4, 20]"}, "[10, 26)"),
        (reference("p") + reference("q"), {"p": "(4, 20]", "q": "[1, 2]"}, "(5, 22]"),
        (reference("p") - reference("q") + 9, {"p": "[4, 20)", "q": "[1, 2)"}, "(11, 28)"),
    ],
)
def test_lengths_that_nature_may_choose_end_as_the_box_does(length, intervals, expected):
    plan = tasks(working(on="a"))
    (constraint,) = (replace(constraint, lower=length, upper=length) for constraint in plan.constraints)
    plan = replace(plan, parameters=tuple(Parameter(name, F(5)) for name in intervals), constraints=(constraint,))
    (link,) = make_dispatchable(plan, box_of(**intervals)).network.natural.values()
    assert link.allowed == interval(expected)


def test_boxes_must_be_those_of_the_plan():
    for box, message in ((Box({}), "no interval for 'first'"), (box_of(second=(1, 2)), "expected a parameter")):
        with pytest.raises(InputError, match=message.replace("for", "for parameter")):
            make_dispatchable(tasks(), box)


def test_a_wait_is_kept_and_ended_by_the_observation():
    """w2 has to end within 3 of w1's end, and lasts for 5 to 8: it starts before w1 ends, but not too early."""
    constraints = ("w1.start - .zero in [0, 0]", "w2.end - w2.start in [5, 8]", "w2.end - w1.end in [0, 3]")
    plan = tasks(working(*constraints), problem=plans.nothing_else("ab"))
    succeeds(make_dispatchable(plan, box_of(first=(8, 13))), 9, Random(9))  # noqa: S311 - reproducible
    assert make_dispatchable(plan, box_of(first=(1, 30))).guarantee is Guarantee.WEAK


def succeeds(dispatchable, runs, random):
    """Executes with values from all over the box, often at its corners; the simulator judges each execution."""
    assert dispatchable.guarantee is Guarantee.DYNAMIC
    for seed in range(runs):
        values = plans.drawn(dispatchable.box, random)
        dispatcher = Dispatcher(dispatchable)
        run_in_world(dispatcher, SimulatedWorld(dispatchable, Luck(plans.fixed(values), seed)))
        assert (dispatcher.ended, dispatcher.ending, dispatcher.rejected) == (True, None, []), (seed, values)
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)


@pytest.mark.parametrize("runs", [8, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_every_execution_succeeds(plan, runs):
    succeeds(with_box(*plan), runs, Random(runs))  # noqa: S311 - reproducible


@pytest.mark.slow
@pytest.mark.parametrize("index", range(27))
def test_inside_the_box_of_a_recorded_plan_every_execution_succeeds(dataset, index, tmp_path):
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    plan = load_plan(*instances[index].write(tmp_path))
    succeeds(make_dispatchable(plan, envelope(plan).box), 150, Random(index))  # noqa: S311 - reproducible


@pytest.mark.parametrize("seed", range(often(14, 25)))
def test_inside_the_box_of_a_drawn_plan_every_execution_succeeds(seed):
    random = Random(f"plans {seed}")  # noqa: S311 - reproducible
    plan = plans.drawn_plan(random, tasks_at_most=6, loose=True)
    count = len(plan.instances)
    box = box_of(**dict.fromkeys(plan.nominal, (1, F(200 - 3 * count, count))))
    succeeds(make_dispatchable(plan, box), 5, random)


def sliced(dispatchable, *, seconds=None, timeout=None):
    """With the region of its plan."""
    result = RegionSearch(dispatchable.plan, timeout=timeout).run()
    return dispatchable.sliced(result.inner(), exact=result.is_exact, seconds=seconds)


AFTER = "w2.start - w1.end in [0.001, inf]", "w2.end - .zero in [0, 30]"


@cache
def in_series(length="second", declared="parameter second default 10;"):
    """Two tasks one after the other, each planned for 10, that have to be done by 30."""
    text = declared + working(f"w2.end - w2.start in [{length}, {length}]", *AFTER)
    plan = tasks(text, problem=plans.nothing_else("ab"))
    return prepare_plan(plan, ReplanningOptions(executor=Slice(None))).dispatchable


def slicing(*steps, dispatchable=None):
    """A dispatcher of it after some steps."""
    dispatcher = Dispatcher(dispatchable or in_series())
    after(dispatcher, (0,), *steps)
    return dispatcher


def looks(dispatcher):
    return [(look.after, look.answer, look.box, look.kept) for look in dispatcher.remainders]


FIRST_IN_FOUR = (4, Completed("w1", F(4))), (F(4001, 1000),)


def test_what_the_first_task_leaves_is_the_seconds():
    assert in_series().guarantee is Guarantee.DYNAMIC
    assert in_series().box == box_of(first="[1, 29999/2000]", second="[1, 29999/2000]")
    dispatcher = slicing(FIRST_IN_FOUR[0])
    grown = box_of(first="[4, 4]", second="[1, 25999/1000]")
    assert looks(dispatcher) == [("first = 4", SliceAnswer.PROMISED, grown, True)]
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC
    after(dispatcher, FIRST_IN_FOUR[1], (30, Completed("w2", F(30))))
    assert (dispatcher.ended, dispatcher.ending) == (True, None)
    assert dispatcher.observed == {"first": 4, "second": F(25999, 1000)}


def test_an_action_that_takes_longer_than_its_interval_leaves_less_to_the_next():
    dispatcher = slicing()
    assert dispatcher.wake == F(150005, 10000), "when it is overdue: at the end of its interval and the patience"
    dispatcher.step(dispatcher.wake)
    # 14.9985 are left, 4.9985 more than the second is planned for: both share them
    shared = box_of(first="[30001/2000, 69999/4000]", second="[1, 49997/4000]")
    assert looks(dispatcher) == [("first exceeds 14.9995", SliceAnswer.PROMISED, shared, False)]
    dispatcher.step(F(16), [Completed("w1", F(16))])
    grown = box_of(first="[16, 16]", second="[1, 13999/1000]")  # from 12.49925
    assert looks(dispatcher)[-1][2:] == (grown, True)


def test_nothing_is_left_once_the_second_task_cannot_be_in_time():
    dispatcher, now = slicing(), F(0)
    while not dispatcher.ended and not dispatcher.ending:
        now = dispatcher.wake
        dispatcher.step(now)
    assert isinstance(dispatcher.ending, told.LeftBox)
    assert F(28999, 1000) < now < 29, "the second task takes at least 1"
    *before, last = (look.answer for look in dispatcher.remainders)
    assert (set(before), last) == ({SliceAnswer.PROMISED}, SliceAnswer.NOTHING)
    assert len(before) < 29, "each time half of what was left"


@pytest.mark.parametrize("failed", [F(30), F(300005, 10000)])
def test_what_fails_because_it_lasts_too_long_has_left_its_interval(failed):
    dispatcher = slicing(*FIRST_IN_FOUR, (failed, DispatchFailed("w2", failed, "closed")))
    assert str(dispatcher.ending) == "second exceeds 25.999", "it is not overdue before 30.001"


def test_without_time_only_the_box_counts():
    hasty = replace(in_series(), slices=replace(in_series().slices, seconds=0.0))
    dispatcher, late = slicing(FIRST_IN_FOUR[0], dispatchable=hasty), slicing(dispatchable=hasty)
    assert ([look.answer for look in dispatcher.remainders], dispatcher.ending) == ([SliceAnswer.OUT_OF_TIME], None)
    late.step(late.wake)
    assert isinstance(late.ending, told.LeftBox)


def test_a_box_that_is_not_controllable_is_replaced_at_the_beginning():
    """The second task must start from 1 to 2 before the first ends, which cannot be known: lengths may differ by 1."""
    constraints = ("w1.end - w2.start in [1, 2]", "w2.end - w2.start in [4, 4]", "w2.end - .zero in [0, 90]")
    plan = tasks(working(*constraints), problem=plans.nothing_else("ab"))
    weak = make_dispatchable(plan, box_of(first="[1, 20]"))
    assert weak.guarantee is Guarantee.WEAK
    dispatcher = slicing(dispatchable=sliced(weak))
    assert looks(dispatcher) == [("the beginning", SliceAnswer.PROMISED, box_of(first="[19/2, 21/2]"), False)]
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC


def test_a_parameter_of_several_actions_keeps_an_interval_until_the_last():
    dispatcher = slicing((12, Completed("w1", F(12))), dispatchable=in_series("first", ""))
    assert looks(dispatcher)[-1][2] == in_series("first", "").box == box_of(first="[1, 29999/2000]")
    after(dispatcher, (F(12001, 1000),), (F(14001, 1000), Completed("w2", F(14001, 1000))))
    assert looks(dispatcher)[-1][2] == box_of(first="[2, 12]")


def can_go_on(plan, values, times, now):
    """Whether a schedule can be continued, by shortest paths from the plan's own statements."""
    points = (point for point in plan.time_points if point.time is None)
    facts = [at(point, times[point]) if point in times else between(ZERO, point, max(F(0), now)) for point in points]
    return Network(replace(plan, constraints=(*plan.constraints, *facts)), values).consistent


def executed(dispatchable, values, seed):
    """One execution: what was promised must hold, what succeeds must be valid, and what is given up must be lost."""
    dispatcher = Dispatcher(dispatchable, drain=False)
    run_in_world(dispatcher, SimulatedWorld(dispatchable, Luck(plans.fixed(values), seed)))
    assert dispatcher.ended, (seed, values)
    assert not dispatcher.rejected
    promised = [look for look in dispatcher.remainders if look.box is not None and values in look.box]
    if dispatcher.ending is None:
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)
        return "succeeded" if all(seen.inside for seen in dispatcher.observations) else "outside of its box"
    assert not promised, (seed, values, promised)
    assert values not in dispatcher.dispatchable.box
    slices = dispatchable.slices
    if slices.exact and isinstance(dispatcher.ending, told.LeftBox):
        assert dispatcher.remainders[-1].answer is SliceAnswer.NOTHING
        now = dispatcher.ending.time
        assert values not in slices.region or not can_go_on(dispatchable.plan, values, dispatcher.times, now), values
    return "lost"


def around(box, random):
    """Values inside of a box and up to half its width beyond; infinite sides are cut."""
    values = plans.drawn(box, random)
    for name, allowed in box.intervals.items():
        width = F(20) if allowed.width is None else allowed.width
        values[name] = max(F(0), values[name] + width * F(random.randint(-30, 50), 100) * random.choice([0, 0, 1]))
    return values


@pytest.mark.parametrize("runs", [2, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_what_is_promised_is_kept(plan, runs):
    dispatchable, random = sliced(with_box(*plan), timeout=3), Random(f"slices {runs}")  # noqa: S311 - reproducible
    outcomes = {executed(dispatchable, around(dispatchable.box, random), seed) for seed in range(runs)}
    assert outcomes != {"lost"}


@pytest.mark.parametrize("runs", [4, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", range(often(12, 20)))
def test_what_is_promised_in_drawn_plans_is_kept(seed, runs):
    random = Random(f"sliced plans {seed}")  # noqa: S311 - reproducible
    plan, box = plans.drawn_with_box(random)
    dispatchable = sliced(make_dispatchable(plan, box))
    for run in range(runs):
        executed(dispatchable, around(box, random), run)


@pytest.mark.parametrize("seed", range(often(15, 30)))
def test_the_network_with_what_has_happened_is_the_plans(seed):
    """At random points, a schedule that was begun at random can be continued if the plan's own statements allow it."""
    random = Random(f"continued {seed}")  # noqa: S311 - reproducible
    plan = plans.drawn_plan(random)
    for _ in range(20):
        values = {name: F(random.randint(1, 15)) for name in plan.nominal}
        now, times = F(random.randint(0, 40)), {ZERO: F(0)}
        for instance in plan.instances:
            start = F(random.randint(0, 40))
            end = start + values["first" if instance.identifier == "w1" else f"d{instance.identifier[1:]}"]
            times |= {point: time for point, time in ((instance.start, start), (instance.end, end)) if time <= now}
        box = Box.point(values)
        facts = Observations(now=now, seen=box.intervals, settled=frozenset(values), times=times)
        stnu = continued(parametric_stnu(plan, Box.nominal(plan.parameters)), facts)
        assert (Dynamically(stnu, NEVER).reason(ends_of(box)) is None) == can_go_on(plan, values, times, now)


@pytest.mark.parametrize("name", PLANS)
def test_first_windows_are_those_of_all_tables(name):
    dispatchable = with_box(*name)
    for box in (dispatchable.box, Box.nominal(dispatchable.plan.parameters)):
        stnu = parametric_stnu(dispatchable.plan, box)
        tables, guarantee = dispatch_network(stnu, box, Dreex())
        windows = Windows(tables)
        windows.happened(0, Fraction(0))
        expected = {point: windows.window(number) for number, point in enumerate(tables.points) if number}
        assert guarantee is Guarantee.DYNAMIC
        assert {point: found for point, found in first_windows(stnu, box).items() if point != ZERO} == expected
