"""Messages and decisions as JSON objects and back, and what is said of objects that are neither."""

import json
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.wire import (
    Fields,
    check_message,
    decode_decision,
    decode_message,
    encode_decision,
    encode_message,
    in_line,
    parse_line,
)
from robust.plan.model import Atom
from tests.pike_bridge.online.examples import KITCHEN

WORDS = st.text(st.characters(exclude_categories=["Cs", "Z", "C", "Lu", "Lt"], exclude_characters="()"), min_size=1)
ATOMS = st.builds(Atom, WORDS, st.lists(WORDS, max_size=3).map(tuple)).filter(
    lambda atom: str(atom) == str(atom).lower() and len(str(atom).split()) == 1 + len(atom.arguments)
)
NAMES = st.text(st.characters(exclude_categories=["Cs"]))
TIMES = st.fractions()
MESSAGES = st.one_of(
    st.builds(said.Outcome, NAMES, NAMES),
    st.builds(said.Completion, NAMES, st.none() | NAMES),
    st.builds(said.Estimate, st.frozensets(ATOMS), st.frozensets(ATOMS), st.booleans()),
)
DECISIONS = st.one_of(
    st.builds(said.Executed, NAMES, TIMES, st.booleans()),
    st.builds(said.Dispatched, NAMES, st.none() | NAMES, TIMES, NAMES, TIMES, st.none() | TIMES),
    st.builds(said.Chosen, NAMES, NAMES, TIMES, st.booleans()),
    st.builds(said.Violated, ATOMS, st.booleans(), NAMES, st.lists(NAMES).map(tuple), TIMES),
    st.builds(said.Rejected, NAMES, NAMES, TIMES),
    st.builds(said.Failed, TIMES, NAMES),
    st.builds(
        said.Succeeded,
        TIMES,
        st.dictionaries(NAMES, NAMES).map(lambda chosen: tuple(Assignment(*item) for item in chosen.items())),
    ),
)


def again(encoded):
    return Fields(parse_line(json.dumps(encoded), "line"))


@given(MESSAGES)
def test_messages_come_back_as_they_were(message):
    fields = again(encode_message(message))
    assert decode_message(fields) == message
    fields.end()


@given(DECISIONS)
def test_decisions_come_back_as_they_were(decision):
    assert decode_decision(again(encode_decision(decision))) == decision


def test_every_kind_is_there():
    """The strategies above miss no kind."""
    for union, strategy in ((said.Message, MESSAGES), (said.Decision, DECISIONS)):
        assert len(union.__args__) == len(strategy.original_strategies)


def test_numbers_are_read_exactly():
    fields = Fields(parse_line('{"a": 0.1, "b": "1/3", "c": 1e-3}', "line"))
    assert [fields.number(name) for name in "abc"] == [Fraction(1, 10), Fraction(1, 3), Fraction(1, 1000)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "input:7: found an empty line, expected a JSON object"),
        ("[1]", "input:7:1: found a list, expected a JSON object"),
        ('{"kind": ', "input:7:10: found the end of the file, expected a JSON value"),
        ("{}", "input:7:1: found no field 'kind', expected a text"),
        ('{"kind": 3}', "input:7:10: found 3, expected a text for 'kind'"),
        (
            '{"kind": "outcom", "choice": "a", "value": "b"}',
            "input:7:10: found kind 'outcom', expected one of outcome, completion, estimate; did you mean 'outcome'?",
        ),
        ('{"kind": "outcome", "choice": "a"}', "input:7:1: found no field 'value', expected a text"),
        (
            '{"kind": "outcome", "choice": "a", "value": "b", "valu": 1}',
            "input:7:50: found unknown field 'valu', expected only kind, choice, value; did you mean 'value'?",
        ),
        ('{"kind": "outcome", "choice": "a", "choice": "a"}', "input:7:36: found a second 'choice', expected one"),
        ('{"kind": "estimate", "true": "(a)"}', "input:7:30: found '(a)', expected a list for 'true'"),
        ('{"kind": "estimate", "true": ["a"]}', "input:7:31: found 'a', expected an atom such as '(at cup table)'"),
        ('{"kind": "estimate", "true": [1]}', "input:7:31: found 1, expected a text"),
        ('{"kind": "estimate", "complete": "yes"}', "input:7:34: found 'yes', expected true or false for 'complete'"),
        ('{"kind": "estimate", "true": NaN}', "input:7:30: found 'NaN', expected a JSON value"),
    ],
)
def test_what_is_no_message(text, expected):
    def decode():
        with in_line("input", 7):
            fields = Fields(parse_line(text, "input"))
            decode_message(fields)
            fields.end()

    with pytest.raises(InputError) as caught:
        decode()
    assert str(caught.value).startswith(expected)


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (said.Outcome("xA9", "mug"), "found unknown choice 'xA9', expected one of the plan; did you mean"),
        (said.Outcome("xA1", "cup"), "found xA1 = 'cup', expected one of mug, glass"),
        (said.Outcome("xR1", "juice"), "found choice xR1, expected one that is not for the executive to make"),
        (said.Completion("(get human mugs)"), "found unknown activity '(get human mugs)', expected one of the plan"),
        (said.Completion("(get human mug)", "e1"), "found event 'e1', expected where (get human mug) ends: e4"),
    ],
)
def test_what_no_plan_knows(message, expected):
    with pytest.raises(InputError) as caught:
        check_message(load_team_plan(KITCHEN), message)
    assert str(caught.value).startswith(expected)


def test_what_the_plan_knows():
    plan = load_team_plan(KITCHEN)
    check_message(plan, said.Outcome("xA1", "mug"))
    check_message(plan, said.Completion("(get human mug)", "e4"))
    check_message(plan, said.Estimate(true=frozenset({Atom("raining")})))
