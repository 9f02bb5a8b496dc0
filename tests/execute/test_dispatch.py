"""The dispatcher: its decisions, what reveals parameters, every way in which observations go wrong, and its promise."""

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from benchmarks.irr.figure4 import recorded_instances
from robust.api import envelope
from robust.errors import InputError
from robust.execute.dispatchable import Blex, Dreex, Guarantee, make_dispatchable, parse_executor
from robust.execute.dispatcher import (
    Completed,
    Dispatch,
    Dispatcher,
    DispatchFailed,
    DispatchSucceeded,
    LeftBox,
    MessageRejected,
    Observed,
    Phase,
    Started,
    StateEstimate,
)
from robust.execute.drive import run_in_world
from robust.execute.worlds import Luck, SimulatedWorld
from robust.plan.load import load_plan
from robust.plan.model import Atom, Fluent, Parameter, ParameterReference
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from tests.execute.plans import (
    PLAN,
    PLANS,
    drawn,
    drawn_plan,
    fixed,
    interval,
    nothing_else,
    tasks,
    tasks_dispatchable,
    with_box,
    working,
)

F = Fraction
EPSILON = F(1, 1000)


def told(dispatcher, now, *messages):
    """The decisions of one step as texts; rejections and endings as they are."""
    plain = Dispatch | DispatchSucceeded
    return [str(one) if isinstance(one, plain) else one for one in dispatcher.step(F(now), messages)]


def after(dispatcher, *steps):
    """The decisions of the last of these steps: each is a time with the messages that arrive then."""
    return [told(dispatcher, now, *messages) for now, *messages in steps][-1]


WORKED = Completed("w1", F(7))
FETCHED = ((7, WORKED), (8,), (10, Completed("f", F(10))))


def begun(**options):
    dispatcher = Dispatcher(tasks_dispatchable(), **options)
    assert told(dispatcher, 0) == ["start w1"]
    return dispatcher


def test_a_plan_is_carried_out():
    dispatcher = begun()
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC
    # 60 is the end of everything, 5 + 2 and two gaps come before it; 20 and ε is when the observation is overdue
    assert dispatcher.wake == 20 + EPSILON
    start = dispatcher.dispatchable.plan.instance["w2"].start
    assert dispatcher.window(start) == (6 + 2 * EPSILON, F(55)), "certainly and possibly, within the box 4 ... 20"
    assert told(dispatcher, 7, WORKED) == []
    assert (dispatcher.observed, dispatcher.wake) == ({"first": 7}, 7 + EPSILON)
    assert dispatcher.window(start) == (9 + 2 * EPSILON, F(55))
    assert told(dispatcher, 7 + EPSILON) == ["start f", "start c"]
    assert told(dispatcher, 9 + EPSILON, Completed("f", 9 + EPSILON)) == []
    assert told(dispatcher, 9 + 2 * EPSILON) == ["start w2"]
    assert (dispatcher.running, dispatcher.wake) == (("w2",), 14 + 2 * EPSILON)
    assert told(dispatcher, 14 + 2 * EPSILON) == ["end w2", "all done"]
    assert (dispatcher.ended, dispatcher.wake, dispatcher.ending) == (True, None, None)
    assert dispatcher.times[dispatcher.dispatchable.plan.instance["w2"].end] == 14 + 2 * EPSILON


def test_what_reveals_each_parameter():
    def shown(dispatchable):
        return {(one.parameter, one.means.value, str(one.point)) for one in dispatchable.revelations}

    assert ("a1.use", "level", "a1.end") in shown(with_box(*PLANS[2]))
    assert shown(with_box(*PLANS[5])) == {("yield", "level", "sun.end"), ("on_1", "time", "use_1.end")}
    assert ("start_1", "time", "pour_1.start") in shown(with_box(*PLANS[3]))
    assert shown(make_dispatchable(tasks(PLAN, "level=fluent:(stock)", "need=fluent:(need b)"))) == {
        ("first", "time", "w1.end"), ("level", "initial level", ".zero"), ("need", "level", "f.end"),
    }  # fmt: skip
    assert shown(make_dispatchable(tasks(PLAN, "need=fluent:(need a)"))) == {("first", "time", "w1.end")}


def test_an_observation_above_the_box_ends_the_plan_when_it_is_overdue():
    dispatcher = begun()
    assert told(dispatcher, 20) == []
    (left,) = told(dispatcher, 20 + EPSILON)
    assert left == LeftBox("first", "first", None, Interval(F(4), F(20)), 20 + EPSILON)
    assert str(left) == "first exceeds 20"
    assert (dispatcher.phase, dispatcher.ended) == (Phase.DRAINING, False)
    assert told(dispatcher, 31, Completed("w1", F(31))) == []
    assert dispatcher.ended
    assert [(one.value, one.inside) for one in dispatcher.observations] == [(31, False)]


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
    options = {"need": False, "first": (), **options}
    need, first = options.pop("need"), options.pop("first")
    needed = tasks_dispatchable({"first": (4, 20), "need": (1, 6)}, PLAN, "need=fluent:(need b)")
    dispatcher = Dispatcher(needed if need else tasks_dispatchable(), **options)
    decisions = after(dispatcher, (0, *first), *steps)
    assert ([str(one) for one in decisions], dispatcher.ended) == (said, ended)


def test_messages_out_of_order_are_put_in_order():
    dispatcher = Dispatcher(with_box(*PLANS[3]))
    after(dispatcher, (0,), (40, Completed("pour_1", F(32)), Started("pour_1", F(20))))
    assert (dispatcher.observed, dispatcher.rejected) == ({"start_1": 20}, [])


def test_a_late_message_counts_from_when_it_was_sent_and_the_same_twice_as_one():
    dispatcher = begun()
    assert told(dispatcher, 12, WORKED) == ["start f", "start c"]
    assert told(dispatcher, 12, WORKED, Observed("first", F(7))) == []
    assert dispatcher.observed == {"first": 7}
    assert dispatcher.times[dispatcher.dispatchable.plan.instance["f"].start] == 12


def test_a_value_that_is_seen_bounds_what_else_it_stands_for():
    plan = working("w2.start - w1.end in [first, 10]", "w2.end - w2.start in [5, 8]")
    dispatchable = tasks_dispatchable({"first": (4, 20)}, plan)
    assert dispatchable.guarantee is Guarantee.WEAK
    dispatcher = Dispatcher(dispatchable)
    start = dispatchable.plan.instance["w2"].start
    assert told(dispatcher, 0) == ["start w1"]
    assert dispatcher.window(start) == (8, 30)
    told(dispatcher, 7, WORKED)
    assert dispatcher.window(start) == (14, 17)


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
        (7, Started("w2", F(7)), "w2.start is the dispatcher's to choose"),
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
        told(dispatcher, 7, WORKED)
    before = dispatcher.times
    (rejected,) = told(dispatcher, now, message)
    assert isinstance(rejected, MessageRejected)
    assert (rejected.reason, "\n" in str(rejected)) == (reason, False)
    assert (dispatcher.times, dispatcher.phase, dispatcher.rejected) == (before, Phase.DISPATCHING, [rejected])


def test_executors_by_name():
    assert parse_executor("dreex") == Dreex()
    for text, share in (("BLEX:30", "3/10"), ("blex:0", "0"), ("blex:12.5", "1/8"), ("blex:100", "1")):
        assert parse_executor(text) == Blex(F(share))
    for text in ("drex", "blex", "blex:", "blex:x", "blex:101", "blex:-1", "dreex:3"):
        with pytest.raises(InputError, match="--executor"):
            parse_executor(text)


def test_blex_accepts_a_share_of_every_duration_and_finds_out_when_it_is_too_late():
    dispatchable = make_dispatchable(tasks(), executor=Blex(F(1, 2)))
    assert dispatchable.guarantee is Guarantee.NONE
    assert dispatchable.box == Box({"first": Interval(F(5), F(15))})
    for ends, ending in ((3, "the time from f.start to f.end exceeds 3"), (1, "None")):
        dispatcher = Dispatcher(dispatchable)
        fetched = [Completed("f", F(17))] if ends == 1 else []
        after(dispatcher, (0,), (15, Completed("w1", F(15))), (16,), (16 + ends + EPSILON, *fetched))
        assert str(dispatcher.ending) == ending
    dispatcher = Dispatcher(make_dispatchable(tasks(PLAN.replace("default 10", "default 50")), executor=Blex(F(1, 5))))
    # 56 leaves no time for the rest; DREEX would have been told by its box
    assert after(dispatcher, (0,), (56, Completed("w1", F(56)))) == []
    assert "start f" in told(dispatcher, 57)


@pytest.mark.parametrize(
    ("factors", "constant", "intervals", "expected"),
    [
        ((1,), 0, ("(4, 20]",), "(4, 20]"),
        ((1,), 0, ("[4, 20)",), "[4, 20)"),
        ((1,), 0, ("[4, inf)",), "[4, inf)"),
        ((-1,), 30, ("(4, 20]",), "[10, 26)"),
        ((1, 1), 0, ("(4, 20]", "[1, 2]"), "(5, 22]"),
        ((1, -1), 9, ("[4, 20)", "[1, 2)"), "(11, 28)"),
    ],
)
def test_lengths_that_nature_may_choose_end_as_the_box_does(factors, constant, intervals, expected):
    plan = tasks(working(on="a"))
    parameters = tuple(Parameter(f"p{i}", F(5)) for i in range(len(factors)))
    terms = (Polynomial.variable(ParameterReference(f"p{i}")).scaled(factor) for i, factor in enumerate(factors))
    length = sum(terms, Polynomial.constant(constant))
    (constraint,) = plan.constraints
    plan = replace(plan, parameters=parameters, constraints=(replace(constraint, lower=length, upper=length),))
    dispatchable = make_dispatchable(plan, Box({f"p{i}": interval(text) for i, text in enumerate(intervals)}))
    (link,) = dispatchable.network.natural.values()
    assert link.allowed == interval(expected)


def test_boxes_must_be_those_of_the_plan():
    with pytest.raises(InputError, match="no interval for parameter 'first'"):
        make_dispatchable(tasks(), Box({}))
    with pytest.raises(InputError, match="expected a parameter of the plan"):
        make_dispatchable(tasks(), Box({"second": Interval(F(1), F(2))}))


def test_a_wait_is_kept_and_ended_by_the_observation():
    """w2 has to end within 3 of w1's end, and lasts for 5 to 8: it starts before w1 ends, but not too early."""
    plan = tasks(
        working("w1.start - .zero in [0, 0]", "w2.end - w2.start in [5, 8]", "w2.end - w1.end in [0, 3]"),
        problem=nothing_else("ab"),
    )
    succeeds(make_dispatchable(plan, Box({"first": Interval(F(8), F(13))})), 9, Random(9))  # noqa: S311 - reproducible
    wide = make_dispatchable(plan, Box({"first": Interval(F(1), F(30))}))
    assert wide.guarantee is Guarantee.WEAK


def succeeds(dispatchable, runs, random):
    """Executes with values from all over the box, often at its corners; the simulator judges each execution."""
    assert dispatchable.guarantee is Guarantee.DYNAMIC
    for seed in range(runs):
        values = drawn(dispatchable.box, random)
        dispatcher = Dispatcher(dispatchable)
        run_in_world(dispatcher, SimulatedWorld(dispatchable, Luck(fixed(values), seed)))
        assert (dispatcher.ended, dispatcher.ending, dispatcher.rejected) == (True, None, []), (seed, values)
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)


@pytest.mark.parametrize("runs", [25, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_every_execution_succeeds(plan, runs):
    succeeds(with_box(*plan), runs, Random(runs))  # noqa: S311 - reproducible


@pytest.mark.slow
@pytest.mark.parametrize("index", range(27))
def test_inside_the_box_of_a_recorded_plan_every_execution_succeeds(dataset, index, tmp_path):
    """A hundred and fifty executions of each: with those above, more than ten thousand."""
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    plan = load_plan(*instances[index].write(tmp_path))
    succeeds(make_dispatchable(plan, envelope(plan).box), 150, Random(index))  # noqa: S311 - reproducible


@pytest.mark.parametrize("seed", range(40))
def test_inside_the_box_of_a_drawn_plan_every_execution_succeeds(seed):
    """Nothing disturbs the tasks."""
    random = Random(f"plans {seed}")  # noqa: S311 - reproducible
    plan = drawn_plan(random, tasks_at_most=6, loose=True)
    count = len(plan.instances)
    box = Box({one.name: Interval(F(1), F(200 - 3 * count, count)) for one in plan.parameters})
    succeeds(make_dispatchable(plan, box), 5, random)
