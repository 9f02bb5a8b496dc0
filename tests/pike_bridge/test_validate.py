"""What a network must satisfy: each rule broken once, and plans that break none."""

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given

from robust.errors import InputError
from robust.pike_bridge.files import parse_tpnu, tpnu_text
from robust.pike_bridge.model import GOAL, INITIAL, Activity, Assignment, Choice, Constraint, Event, Tpnu, guard
from robust.pike_bridge.validate import validate
from tests.pike_bridge.kitchen import kitchen
from tests.pike_bridge.plans import programs

A, B = guard({"x": "a"}), guard({"x": "b"})
ZERO, ONE = Fraction(0), Fraction(1)
BASE = Tpnu(
    "base",
    (Choice("x", ("a", "b"), False, "c"), Choice("y", ("1", "2"), True, "d")),
    (Event("c"), Event("d", A), Event("e", A | guard({"y": "1"})), Event("f")),
    (Constraint("c", "d", ZERO, None, A), Constraint("c", "f", None, Fraction(9))),
    (Activity("(go)", "d", "e", ONE, Fraction(2), None, A | guard({"y": "1"})),),
)


def test_the_base_is_right():
    validate(BASE)


@given(programs())
def test_built_plans_are_right(network):
    validate(network)


def with_event(*events):
    return {"events": (*BASE.events, *events)}


def with_constraint(*args):
    return {"constraints": (*BASE.constraints, Constraint(*args))}


def with_activity(*args, label=frozenset()):
    return {"activities": (*BASE.activities, Activity(*args, guard=label))}


BROKEN = [
    ({"choices": (*BASE.choices, Choice("x", ("a",), True, "c"))}, "found a second choice 'x', expected each once"),
    (with_event(Event("c")), "found a second event 'c', expected each once"),
    ({"choices": (*BASE.choices, Choice("z", ("a",), True, "cc"))}, "found event 'cc', expected one of the plan; did"),
    ({"choices": (*BASE.choices, Choice("z", (), True, "c"))}, "found no values for choice 'z'"),
    ({"choices": (*BASE.choices, Choice("z", ("a", "a"), True, "c"))}, "found a, a for choice 'z'"),
    (with_constraint("c", "g", ONE, None), "found event 'g', expected one of the plan"),
    (with_activity("(go)", "gg", "c", ONE, None), "found event 'gg', expected one of the plan"),
    (with_event(Event(GOAL, A)), "found guard {x = a} of e_goal, expected none"),
    (with_event(Event("g", guard({"z": "a"}))), "found choice 'z' in the guard of event g, expected one of the plan"),
    (with_event(Event("g", guard({"x": "c"}))), "found x = 'c' in the guard of event g, expected a value of x"),
    (with_event(Event("g", A | B)), "found x = a and x = b in the guard of event g, expected one value of a choice"),
    (with_constraint("c", "d", ONE, None), "found the constraint from c to d without x = a in its guard, expected all"),
    (with_activity("(run)", "d", "f", ONE, None), "found activity (run) without x = a in its guard"),
    (with_constraint("c", "f", ONE, ZERO), "found bounds [1, 0] of the constraint from c to f"),
    (with_activity("(run)", "c", "f", ONE, Fraction(1, 2)), "found bounds [1, 0.5] of activity (run)"),
    (with_activity("(run)", "c", "f", ZERO, None), "found lower bound 0 of activity (run), expected one above 0"),
    (with_activity("(run)", "c", "c", ONE, None), "found activity (run) from c to the same event"),
    (
        {**with_event(Event(INITIAL)), **with_activity("(run)", INITIAL, "f", ONE, None)},
        "found activity (run) at e_initial, expected an event of its own",
    ),
    (with_event(Event("g", guard({"y": "1"}))), "found y in the guard of event g without x = a, expected that too"),
    (with_event(Event("g", B | guard({"y": "1"}))), "of event g, which never holds: event d, where y is chosen, needs"),
    (with_event(Event("g", A)), "found choice x in the guard of event g, which may come before the choice"),
    (
        {**with_event(Event("g", A)), **with_constraint("c", "g", Fraction(-1), None, A)},
        "add a constraint from c to g with lower bound 0",
    ),
    (with_activity("(run)", "f", "c", ONE, None, label=A), "found choice x in the guard of activity (run), which is"),
    (
        {**with_event(Event("g", A)), **with_constraint("g", "c", ONE, None, A)},
        "which is ordered before the choice, expected event c first: let the constraints put c before g",
    ),
    (
        {"events": (Event("c", guard({"y": "1"})), *BASE.events[1:])},
        "found choice 'x' at event c, whose guard depends on the choice itself (x needs y needs x)",
    ),
    ({"events": (Event("c", A), *BASE.events[1:])}, "found the constraint from c to f without x = a in its guard"),
]


@pytest.mark.parametrize(("changes", "message"), BROKEN, ids=[message for _, message in BROKEN])
def test_broken_rules(changes, message):
    network = replace(BASE, **changes)
    if "'x' at event c" in message:  # nothing else about it is wrong
        network = Tpnu("n", network.choices, network.events, (), ())
        network = replace(network, events=(Event("c", guard({"y": "1"})), Event("d", A)))
    with pytest.raises(InputError) as caught:
        validate(network)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_choice_at_an_event_that_depends_on_it():
    network = Tpnu("n", (Choice("x", ("a", "b"), True, "c"),), (Event("c", A),), (), ())
    with pytest.raises(InputError, match="x needs x"):
        validate(network)


ALLOWED = [
    with_constraint("f", "c", None, None),
    with_constraint("f", "f", ONE, ONE),  # can never be met, which checking says
    with_constraint("c", "f", Fraction(10), None),  # contradicts another constraint, likewise
    {"choices": (*BASE.choices, Choice("z", ("a",), True, "c"))},  # two choices at one event
    {**with_event(Event("g", A)), **with_constraint("g", "c", None, ZERO, A)},
    {"choices": (*BASE.choices, Choice("z", ("1",), True, None)), **with_event(Event("g", guard({"z": "1"})))},
    {
        **with_event(Event(INITIAL), Event("g", guard({"z": "1"}))),
        "choices": (*BASE.choices, Choice("z", ("1",), True, INITIAL)),
    },
]


@pytest.mark.parametrize("changes", ALLOWED)
def test_what_is_allowed(changes):
    validate(replace(BASE, **changes))


def test_order_through_alternatives():
    # g is after x in either case of y, which its guard does not mention.
    y1, y2 = guard({"y": "1"}), guard({"y": "2"})
    network = Tpnu(
        "n",
        (Choice("x", ("a", "b"), True, "c"), Choice("y", ("1", "2"), True, "c")),
        (Event("c"), Event("l", y1), Event("r", y2), Event("g", A)),
        (
            Constraint("c", "l", ONE, None, y1),
            Constraint("c", "r", ONE, None, y2),
            Constraint("l", "g", ONE, None, y1 | A),
            Constraint("r", "g", ONE, None, y2 | A),
        ),
        (),
    )
    validate(network)


def test_errors_point_into_files():
    text = tpnu_text(kitchen(), domain="d", problem="p").replace(
        '"lower": 1, "upper": 3', '"lower": 1, "upper": "2/3"', 1
    )
    document = parse_tpnu(text, "kitchen.tpnu.json")
    with pytest.raises(InputError) as caught:
        validate(document.network, document.places)
    line = next(at for at, row in enumerate(text.split("\n"), 1) if "2/3" in row)
    assert str(caught.value).startswith(
        f"kitchen.tpnu.json:{line}:5: found bounds [1, 2/3] of activity (pour robot mug)"
    )
    text = text.replace('"2/3"', "3").replace(
        '"name": "e3", "guard": {"xA1": "mug"}', '"name": "e3", "guard": {"xA": "mug"}'
    )
    document = parse_tpnu(text, "kitchen.tpnu.json")
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:36: found choice 'xA' .* did you mean 'xA2' or 'xA1'"):
        validate(document.network, document.places)


def test_values_of_assignments_are_compared_exactly():
    network = replace(BASE, events=(*BASE.events, Event("g", frozenset({Assignment("x", "A")}))))
    with pytest.raises(InputError, match=r"found x = 'A' .* known are a, b"):
        validate(network)
