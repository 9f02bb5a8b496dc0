"""The dispatcher: what it decides, what reveals parameters, and every way in which observations can go wrong."""

from dataclasses import replace
from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.execute.dispatch.dispatcher import (
    Completed,
    Contradicted,
    Dispatch,
    Dispatcher,
    Failed,
    Finish,
    LeftBox,
    Missed,
    Observed,
    Phase,
    Rejected,
    Started,
    StateEstimate,
    Succeeded,
    Unobserved,
)
from robust.execute.dispatch.network import Blex, Dreex, Guarantee, make_dispatchable, parse_executor
from robust.execute.drive import run_in_world
from robust.execute.worlds.rules import Luck
from robust.execute.worlds.world import Setting, SimulatedWorld
from robust.plan.model import Atom, Fluent, Parameter, ParameterReference
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from tests.execute.execution import PLAN, PLANS, fixed, interval, tasks, tasks_dispatchable, with_box

F = Fraction
EPSILON = F(1, 1000)


def told(dispatcher, now, *messages):
    """The decisions of one step as texts; rejections and endings as they are."""
    plain = Dispatch | Finish | Succeeded
    return [str(one) if isinstance(one, plain) else one for one in dispatcher.step(F(now), messages)]


def after(dispatcher, *steps):
    """The decisions of the last of these steps: each is a time with the messages that arrive then."""
    return [told(dispatcher, now, *messages) for now, *messages in steps][-1]


WORKED = Completed("w1", F(7))
FETCHED = ((7, WORKED), (8,), (10, Completed("f", F(10))))


def with_need(**options):
    """A dispatcher that waits for what `f` reveals, too."""
    dispatchable = tasks_dispatchable({"first": (4, 20), "need": (1, 6)}, PLAN, "need=fluent:(need b)")
    dispatcher = Dispatcher(dispatchable, **options)
    told(dispatcher, 0)
    return dispatcher


def begun(**options):
    dispatcher = Dispatcher(tasks_dispatchable(), **options)
    assert told(dispatcher, 0) == ["start w1"]
    return dispatcher


# -- what goes well ----------------------------------------------------------------------------------------------------


def test_a_plan_is_carried_out():
    dispatcher = begun()
    assert dispatcher.dispatchable.guarantee is Guarantee.DYNAMIC
    # 60 is the end of everything, 5 + 2 and two gaps come before it; 20 and ε is when the observation is overdue
    assert dispatcher.wake == 20 + EPSILON
    assert told(dispatcher, 7, Completed("w1", F(7))) == []
    assert dispatcher.observed == {"first": 7}
    assert dispatcher.wake == 7 + EPSILON
    assert told(dispatcher, 7 + EPSILON) == ["start f", "start c"]
    assert told(dispatcher, 9 + EPSILON, Completed("f", 9 + EPSILON)) == []
    assert told(dispatcher, 9 + 2 * EPSILON) == ["start w2"]
    assert dispatcher.running == ("w2",)
    assert dispatcher.wake == 14 + 2 * EPSILON
    assert told(dispatcher, 14 + 2 * EPSILON) == ["end w2", "all done"]
    assert (dispatcher.ended, dispatcher.wake, dispatcher.ending) == (True, None, None)
    times = {str(point): time for point, time in dispatcher.times.items()}
    assert times["w2.end"] == 14 + 2 * EPSILON


def test_windows_follow_observations():
    dispatcher = begun()
    plan = dispatcher.dispatchable.plan
    start = plan.instance["w2"].start
    # within the box 4 ... 20 of the first duration, certainly and possibly
    assert dispatcher.window(start) == (6 + 2 * EPSILON, F(55))
    told(dispatcher, 20, Completed("w1", F(20)))
    assert dispatcher.window(start) == (22 + 2 * EPSILON, F(55))


def test_what_reveals_each_parameter():
    shown = {one.parameter: str(one) for one in with_box(*PLANS[2]).observability.revelations}
    assert shown["a1.use"] == "a1.use is revealed by the level right after a1.end"
    rate = with_box(*PLANS[5])
    assert {str(one) for one in rate.observability.revelations} == {
        "yield is revealed by the level right after sun.end",
        "on_1 is revealed by the time of use_1.end",
    }
    starts = with_box(*PLANS[3]).observability.revelations
    assert "start_1 is revealed by the time of pour_1.start" in {str(one) for one in starts}
    level = make_dispatchable(tasks(PLAN, "level=fluent:(stock)", "need=fluent:(need b)"))
    assert {str(one) for one in level.observability.by_level} == {
        "level is revealed by the level at the beginning",
        "need is revealed by the level right after f.end",
    }
    assert level.notes == ()


def test_what_cannot_be_revealed_is_said_at_the_beginning():
    hidden = make_dispatchable(tasks(PLAN, "need=fluent:(need a)"))
    (note,) = hidden.notes
    assert note.startswith("need stands in conditions or bounds only")
    assert note.endswith("it cannot be observed")


def test_observed_levels_are_waited_for():
    dispatcher = with_need()
    seen = Completed("f", 9 + EPSILON), Observed("need", F(5), "f")
    after(dispatcher, (7, WORKED), (7 + EPSILON,), (9 + EPSILON, *seen))
    assert dispatcher.observed == {"first": 7, "need": 5}
    assert after(dispatcher, (9 + 2 * EPSILON,), (14 + 2 * EPSILON,))[-1] == "all done"


# -- what leaves the box, and faults -------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("now", "message", "text"),
    [
        (3, Completed("w1", F(3)), "first = 3 is outside [4, 20]"),
        (1, Observed("need", F(7)), "need = 7 is outside [1, 6]"),
    ],
)
def test_an_observation_outside_of_the_box_ends_the_plan_at_once(now, message, text):
    dispatcher = with_need()
    (left,) = told(dispatcher, now, message)
    assert str(left) == text
    assert dispatcher.ended is isinstance(message, Completed)  # else w1 is running


def test_stopping_does_not_wait():
    dispatcher = begun(drain=False)
    told(dispatcher, 20 + EPSILON)
    assert dispatcher.ended


def test_running_actions_are_waited_for_and_those_of_ours_ended():
    dispatcher = begun()
    (failed,) = after(dispatcher, *FETCHED, (11,), (12, Failed("c", F(12), "nobody answers")))
    assert str(failed) == "c failed: nobody answers"
    assert dispatcher.wake == 16  # w2 began at 11 and lasts for 5 at least
    assert told(dispatcher, 16) == ["end w2"]
    assert dispatcher.ended


def test_a_late_message_counts_from_when_it_was_sent():
    dispatcher = begun()
    assert told(dispatcher, 12, Completed("w1", F(7))) == ["start f", "start c"]
    assert dispatcher.observed == {"first": 7}
    assert dispatcher.times[dispatcher.dispatchable.plan.instance["f"].start] == 12


@pytest.mark.parametrize("seen", [(), (Observed("need", F(5), "c"),)], ids=["unseen", "seen elsewhere"])
def test_a_missing_level_ends_the_plan(seen):
    dispatcher = with_need(patience=F(1, 2))
    *before, fetched = FETCHED
    assert Unobserved("need", F(10), F(21, 2)) in after(dispatcher, *before, (*fetched, *seen), (F(21, 2),))
    assert str(dispatcher.ending) == "need was not observed by 10"


def test_a_value_that_is_seen_bounds_what_else_it_stands_for():
    plan = """
parameter first default 6;
durative-action instance w1 : (work a);
durative-action instance w2 : (work b);
c: w1.end - w1.start in [first, first];
c: w2.start - w1.end in [first, 10];
c: w2.end - w2.start in [5, 8];
"""
    dispatchable = tasks_dispatchable({"first": (4, 20)}, plan)
    assert dispatchable.guarantee is Guarantee.WEAK
    dispatcher = Dispatcher(dispatchable)
    start = dispatchable.plan.instance["w2"].start
    assert told(dispatcher, 0) == ["start w1"]
    assert dispatcher.window(start) == (8, 30)
    told(dispatcher, 7, Completed("w1", F(7)))
    assert dispatcher.window(start) == (14, 17)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Completed("w1", F(8)), "w1.end has happened at 7 already; the first time stands"),
        (Completed("w2", F(7)), "w2.end cannot happen before w2.start"),
        (Completed("w1", float("nan")), "found time nan, expected an exact number"),
        (Completed("w9", F(7)), "found instance 'w9', expected one of the plan; known are c, f, w1, w2"),
        (Completed("f", F(9)), "f.end cannot happen before f.start"),
        (Started("w2", F(7)), "w2.start is the dispatcher's to choose"),
        (Observed("frist", F(1)), "found parameter 'frist', expected one of the plan; did you mean 'first'?"),
        (Observed("first", float("nan")), "found nan for 'first', expected an exact number"),
        (Observed("first", "7"), "found '7' for 'first', expected an exact number"),
        (Observed("first", True), "found True for 'first', expected an exact number"),
        (Observed("first", F(9)), "first = 7 was observed already; the first value stands"),
        (StateEstimate(F(99), frozenset()), "found time 99, which is yet to come"),
        (Failed("w1", F(7), "late"), "w1 has ended already"),
        ("hello", "found str, expected a message"),
    ],
)
def test_faulty_messages_are_rejected_in_one_line_and_change_nothing(message, reason):
    dispatcher = begun()
    told(dispatcher, 7, Completed("w1", F(7)))
    before = dispatcher.times
    (rejected,) = told(dispatcher, 7, message)
    assert isinstance(rejected, Rejected)
    assert (rejected.reason, "\n" in str(rejected)) == (reason, False)
    assert (dispatcher.times, dispatcher.phase) == (before, Phase.DISPATCHING)
    assert dispatcher.rejected == [rejected]


def test_messages_about_the_future_and_the_past_are_rejected():
    dispatcher = begun()
    for time, reason in ((6, "found time 6, which is yet to come"), (-1, "found time -1, expected one from 0 on")):
        (rejected,) = told(dispatcher, 5, Completed("w1", F(time)))
        assert rejected.reason == reason


def test_the_same_message_twice_is_ignored():
    dispatcher = begun()
    assert told(dispatcher, 7, WORKED, WORKED) == []
    assert told(dispatcher, 7, WORKED, Observed("first", F(7))) == []


def test_a_duration_cannot_be_observed_before_it_is_over():
    dispatcher = begun()
    (rejected,) = told(dispatcher, 5, Observed("first", F(7)))
    assert rejected.reason == "first is revealed by the time of w1.end, which has not happened"


def test_messages_out_of_order_are_put_in_order():
    dispatchable = with_box(*PLANS[3])
    dispatcher = Dispatcher(dispatchable)
    told(dispatcher, 0)
    assert told(dispatcher, 40, Completed("pour_1", F(32)), Started("pour_1", F(20))) == []
    assert dispatcher.observed == {"start_1": 20}


def test_a_state_that_contradicts_the_plan_ends_it():
    complete = StateEstimate(
        7 + EPSILON, frozenset({Atom("open")}), {Fluent("stock"): F(3), Fluent("need", ("b",)): F(4)}
    )
    (contradicted,) = after(begun(), (7, WORKED), (7 + EPSILON, complete))
    assert contradicted == Contradicted("f", "(>= (stock) (need b)) does not hold", 7 + EPSILON)


def test_a_state_does_not_outlast_the_next_event():
    dispatcher = Dispatcher(tasks_dispatchable())
    assert told(dispatcher, 0, StateEstimate(F(0), frozenset({Atom("ready", ("a",))}))) == ["start w1"]
    assert "start f" in after(dispatcher, (7, WORKED), (7 + EPSILON,))
    (contradicted,) = told(Dispatcher(tasks_dispatchable()), 0, StateEstimate(F(0), frozenset()))
    assert str(contradicted) == "w1 failed: (ready a) does not hold"


def test_a_time_point_that_is_dispatched_too_late_is_missed():
    (missed,) = after(begun(), *FETCHED, (56,))
    assert isinstance(missed, Missed)
    assert str(missed) == "w2.start missed: possible until 55, because of .zero"


def test_nothing_is_decided_after_the_end():
    dispatcher = begun(drain=False)
    told(dispatcher, 3, Completed("w1", F(3)))
    assert dispatcher.step(F(4), [Completed("w1", F(4))]) == []


# -- executors ---------------------------------------------------------------------------------------------------------


def test_executors_by_name():
    assert parse_executor("dreex") == Dreex()
    assert parse_executor("BLEX:30") == Blex(F(3, 10))
    for text in ("blex:0", "blex:12.5", "blex:100"):
        assert parse_executor(text).name == text
    for text in ("drex", "blex", "blex:", "blex:x", "blex:101", "blex:-1", "dreex:3"):
        with pytest.raises(InputError, match="--executor"):
            parse_executor(text)


def test_blex_accepts_a_share_of_every_duration():
    dispatchable = make_dispatchable(tasks(), executor=Blex(F(1, 2)))
    assert dispatchable.guarantee is Guarantee.NONE
    assert dispatchable.box == Box({"first": Interval(F(5), F(15))})
    for ends, ending in ((3, "the time from f.start to f.end exceeds 3"), (1, None)):
        dispatcher = Dispatcher(dispatchable)
        fetched = [Completed("f", F(16 + ends))] if ending is None else []
        after(dispatcher, (0,), (15, Completed("w1", F(15))), (16,), (16 + ends + EPSILON, *fetched))
        assert (None if dispatcher.ending is None else str(dispatcher.ending)) == ending


def test_blex_finds_out_when_it_is_too_late():
    late = PLAN.replace("default 10", "default 50")
    dispatcher = Dispatcher(make_dispatchable(tasks(late), executor=Blex(F(1, 5))))
    told(dispatcher, 0)
    # 56 leaves no time for the rest; DREEX would have been told by its box
    assert told(dispatcher, 56, Completed("w1", F(56))) == []
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
    plan = tasks("parameter p0 default 5;\ndurative-action instance w1 : (work a);\nc: w1.end - w1.start in [p0, p0];")
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


# -- guarantees --------------------------------------------------------------------------------------------------------


def test_a_wait_is_kept_and_ended_by_the_observation():
    """w2 has to end within 3 of w1's end, and lasts for 5 to 8: it starts before w1 ends, but not too early."""
    plan = tasks(
        """
parameter first default 10;
durative-action instance w1 : (work a);
durative-action instance w2 : (work b);
c: w1.end - w1.start in [first, first];
c: w1.start - .zero in [0, 0];
c: w2.end - w2.start in [5, 8];
c: w2.end - w1.end in [0, 3];
""",
        problem="""(define (problem p) (:domain tasks) (:objects a b - task)
  (:init (ready a) (ready b) (open) (= (stock) 0)) (:goal (and (done a) (done b))))""",
    )
    dispatchable = make_dispatchable(plan, Box({"first": Interval(F(8), F(13))}))
    assert dispatchable.guarantee is Guarantee.DYNAMIC
    setting = Setting(dispatchable)
    for value in map(F, ("8", "9.5", "13")):
        dispatcher = Dispatcher(dispatchable)
        run_in_world(dispatcher, SimulatedWorld(setting, Luck(fixed({"first": value}), 0)))
        assert dispatcher.ending is None
        assert not simulate(plan, {"first": value}, dispatcher.times).network_violations
    wide = make_dispatchable(plan, Box({"first": Interval(F(1), F(30))}))
    assert wide.guarantee is Guarantee.WEAK
