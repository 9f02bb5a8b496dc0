"""Messages and decisions as JSON objects and back, and what is said of objects that are neither."""

import json
from dataclasses import fields, replace
from fractions import Fraction
from typing import get_args

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError
from robust.json_text import parse_line
from robust.pike_bridge.model import ALWAYS, Activity, Assignment, Choice, Condition, Effect, Literal, TeamPlan, guard
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.progress import JSON
from robust.pike_bridge.online.service import (
    CLOSING,
    AskChance,
    AskPossible,
    AskState,
    AskWhy,
    News,
    Query,
    Tick,
    Together,
)
from robust.plan.model import Atom
from robust.records import in_line
from tests.pike_bridge.plans import network
from tests.schemas import schema

WORDS = st.text(st.characters(exclude_categories=["Cs", "Z", "C", "Lu", "Lt"], exclude_characters="()"), min_size=1)
ATOMS = st.builds(Atom, WORDS, st.lists(WORDS, max_size=3).map(tuple)).filter(
    lambda atom: str(atom) == str(atom).lower() and len(str(atom).split()) == 1 + len(atom.arguments)
)
NAMES = st.text(st.characters(exclude_categories=["Cs"]))
TIMES = st.fractions()
MAYBE, WHEN = st.none() | NAMES, st.none() | TIMES
REPORTS = [
    st.builds(said.Outcome, NAMES, NAMES, WHEN),
    st.builds(said.Began, NAMES, MAYBE, MAYBE, WHEN),
    st.builds(said.Completion, NAMES, MAYBE, MAYBE, WHEN, st.dictionaries(NAMES, NAMES)),
    *(st.builds(kind, NAMES, MAYBE, MAYBE, WHEN) for kind in said.NOT_ACHIEVED),
    st.builds(said.Estimate, st.frozensets(ATOMS), st.frozensets(ATOMS), st.booleans(), WHEN),
]
MESSAGES = st.one_of(*REPORTS, st.builds(said.Retract, st.one_of(REPORTS)))
TEXTS = st.lists(NAMES).map(tuple)
SCENARIOS = st.dictionaries(NAMES, NAMES).map(lambda chosen: tuple(Assignment(*item) for item in chosen.items()))
DECISIONS = st.one_of(
    st.builds(said.Executed, NAMES, TIMES, st.booleans()),
    st.builds(said.Dispatched, NAMES, MAYBE, TIMES, NAMES, TIMES, WHEN, NAMES),
    st.builds(said.Cancel, NAMES, MAYBE, TIMES, NAMES),
    st.builds(said.Deviated, NAMES, TIMES, TIMES, TIMES, WHEN, WHEN),
    st.builds(said.Resumed, TIMES, TEXTS, st.booleans()),
    st.builds(said.Chosen, NAMES, NAMES, TIMES, st.booleans()),
    st.builds(said.Excluded, NAMES, TIMES, TEXTS, TEXTS, NAMES),
    st.builds(said.Violated, ATOMS, st.booleans(), NAMES, TEXTS, TIMES),
    st.builds(said.Rejected, NAMES, NAMES, TIMES),
    st.builds(said.Failed, TIMES, NAMES),
    st.builds(said.Succeeded, TIMES, SCENARIOS),
)
REQUESTS = st.one_of(
    st.builds(Together, st.lists(MESSAGES).map(tuple)),
    st.builds(AskWhy, st.dictionaries(NAMES, NAMES)),
    st.sampled_from([Tick(), AskPossible(), AskState(), AskChance()]),
)
SCHEMAS = {name: schema(f"robust/pike-stdio{name}/1") for name in ("", "-input")}
SHAPES = {
    name: {each["properties"]["kind"]["const"]: each for each in whole["oneOf"]} for name, whole in SCHEMAS.items()
}


@settings(max_examples=120)
@given(st.one_of(MESSAGES, DECISIONS, REQUESTS))
def test_what_is_written_is_as_published_and_comes_back_as_it_was(value):
    """But for what a service adds: times of requests, and numbers of steps."""
    for kind in said.Message, said.Decision:
        if isinstance(value, kind):
            assert JSON.read(kind, parse_line(json.dumps(JSON.write(kind, value)), "line")) == value
    answers = isinstance(value, said.Decision)
    written = JSON.write(type(value), value) | ({"step": 1} if answers else {})
    whole, shape = (each["" if answers else "-input"] for each in (SCHEMAS, SHAPES))
    shape = shape[value.kind()]
    valid = jsonschema.Draft202012Validator({**whole, "oneOf": [shape]}).is_valid
    assert valid(written)
    assert not any(valid(written | {name: {"": 0}}) for name in written)
    assert written.keys() == shape["properties"].keys() - ({"repeated"} if answers else {"time"})
    needed = {each.metadata.get("json", each.name) for each in fields(value) if each.default is each.default_factory}
    assert set(shape["required"]) == (written.keys() if answers else {"kind", *needed})


def test_published_schemas_and_strategies_miss_no_kind():
    for union, strategy in ((said.Message, MESSAGES), (said.Decision, DECISIONS)):
        assert len(get_args(union)) == len(strategy.original_strategies)
    assert {each.kind() for each in get_args(News | Query)} == SHAPES["-input"].keys()
    assert {each.kind() for each in get_args(said.Decision)} == SHAPES[""].keys() - {"hello", *CLOSING}
    parts = [each["properties"]["kind"]["const"] for each in SCHEMAS["-input"]["$defs"]["message"]["oneOf"]]
    assert parts == [each.kind() for each in get_args(said.Message)]


KINDS = "outcome, started, completion, failed, aborted, cancelled, estimate, retract"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "input:7: found an empty line, expected a JSON object"),
        ("{}", "input:7:1: found no field 'kind', expected a text"),
        ('{"kind": 3}', "input:7:10: found 3, expected a text for 'kind'"),
        ('{"kind": "outcom"}', f"input:7:10: found kind 'outcom', expected one of {KINDS}; did you mean 'outcome'?"),
        ('{"kind": "outcome", "choice": "a"}', "input:7:1: found no field 'value', expected a text"),
        ('{"kind": "retract"}', "input:7:1: found no field 'message', expected an object"),
        ('{"kind": "retract", "kind": "retract"}', "input:7:21: found a second 'kind', expected one"),
        (
            '{"kind": "outcome", "choice": "a", "value": "b", "valu": 1}',
            "input:7:50: found unknown field 'valu', expected only kind, choice, value, at; did you mean 'value'?",
        ),
        ('{"kind": "estimate", "true": "(a)"}', "input:7:30: found '(a)', expected a list for 'true'"),
        ('{"kind": "estimate", "true": ["a"]}', "input:7:31: found 'a', expected an atom such as '(at cup table)'"),
        ('{"kind": "estimate", "true": [1]}', "input:7:31: found 1, expected a text"),
        ('{"kind": "estimate", "complete": "yes"}', "input:7:34: found 'yes', expected true or false for 'complete'"),
    ],
)
def test_what_is_no_message(text, expected):
    with pytest.raises(InputError) as caught, in_line("input", 7):
        JSON.read(said.Message, parse_line(text, "input"))
    assert str(caught.value).startswith(expected)


TOAST, HOT = Literal(Atom("toast")), Literal(Atom("hot"))
X1, X2 = guard({"x": "1"}), guard({"x": "2"})
NETWORK = network(
    {"begin": {}, "end": {}, "own": {}, "more": {"x": "1"}, "less": {"x": "2"}},
    ("begin", "own", 1, 9),
    ("end", "own", 0, None),
    ("own", "more", "1/2", 3, X1),
    ("begin", "less", 4, None, X2),
    activities=[Activity("(work)", "begin", "end", Fraction(2), Fraction(5), agent="human")],
)
NETWORK = replace(NETWORK, choices=(Choice("x", ("1", "2"), False, "own"),))


def small(**times):
    """Events at times, the last of which is now."""
    moments = {name: Fraction(str(time)) for name, time in times.items()}
    return said.Progress(TeamPlan(NETWORK, (), ()), max(moments.values(), default=Fraction(0)), moments)


def test_bounds_and_numbers_are_exact_and_copies_stay_as_they_are():
    for event, times, now, blocked in (
        ("begin", {}, 0, False),
        ("own", {}, 0, True),  # it is later than the beginning, which is to come
        ("own", {"begin": 2}, "2.9", True),
        ("own", {"begin": 2}, 3, True),  # it waits for the end, which somebody else reports
        ("own", {"begin": 2, "end": 3}, 3, False),
        ("end", {"begin": 2}, "3.9", True),
        ("end", {"begin": 2}, 4, False),
    ):
        progress = small(**times)
        progress.now = Fraction(now)
        assert progress.blocked(event) is blocked
    assert small().earliest("own") is None
    begun = small(begin=2)
    assert [begun.earliest(event) for event in ("own", "end", "less", "more")] == [3, 4, 6, None]
    assert small(begin=2, end=5).earliest("own") == 5
    assert small(begin=2, end=5, own=6).earliest("more") == Fraction("6.5")
    found = parse_line('{"a": 0.1, "b": "1/3", "c": 1e-3}', "line")
    assert [JSON.member(Fraction, found, name) for name in "abc"] == [Fraction(each) for each in ("0.1", "1/3", "1e-3")]
    progress = small(begin=0, end=2)
    progress.chosen["x"] = "1"
    del progress.pending["more"]  # as impossible, which facts alone do not tell
    copied = progress.copy()
    assert copied == progress
    progress.times["own"] = progress.now = Fraction(3)
    progress.chosen["x"] = "2"
    del progress.pending["own"]
    assert (copied.now, "own" in copied.times, copied.chosen) == (2, False, {"x": "1"})
    assert list(copied.pending) == ["own", "less"]
    earlier = progress.rewound(Fraction(1), {"begin": Fraction(0)}, {"x": "2"})
    assert (earlier.now, list(earlier.pending)) == (1, ["end", "own", "less"])


def test_whose_turn_it_is_and_orders_that_always_hold():
    """Events at one time do not wait for one another."""
    progress = small(begin=0)
    assert (progress.certain(X1), progress.certain(X1, X1), progress.compatible(X1)) == (False, True, True)
    assert list(progress.frontier) == ["end", "less"]
    assert [progress.ours(event) for event in ("begin", "end", "own")] == [True, False, False]
    assert (progress.external("begin"), progress.external("end"), progress.external("own")) == ([], [ALWAYS], [ALWAYS])
    progress.chosen["x"] = "1"
    assert (progress.external("own"), progress.ours("own")) == ([], True)
    assert (progress.certain(X1), progress.compatible(X1), progress.compatible(X2)) == (True, True, False)
    extra = replace(NETWORK, activities=(*NETWORK.activities, Activity("(extra)", "begin", "end", 1, 2, guard=X2)))
    progress = said.Progress(TeamPlan(extra, (), ()))
    assert progress.external("end") == [ALWAYS, X2]
    progress.chosen["x"] = "1"
    assert progress.external("end") == [ALWAYS]
    structure = small().structure
    orders = (structure.before, structure.not_before)
    before, not_before = ({event: set(earlier) for event, earlier in order.items()} for order in orders)
    assert before == {"begin": set(), "end": {"begin"}, "own": {"begin"}, "more": {"own"}, "less": {"begin"}}
    assert not_before == before | {"own": {"begin", "end"}}
    same = network("one other", ("one", "other", 0, 0))
    assert list(said.Progress(TeamPlan(same, (), ())).frontier) == ["one", "other"]


MADE = (Effect(TOAST, "begin", ALWAYS, 0), Effect(HOT.negation, "begin", ALWAYS, 0))
NEEDED = (
    Condition(TOAST, "own", "own", ALWAYS, 0),
    Condition(TOAST, "own", "more", X1, None),
    Condition(HOT.negation, "own", "own", ALWAYS, 0),
)


def announced(happened, *estimates, effects=MADE, conditions=NEEDED, **chosen):
    """Of each estimate, after events: by default toast is made for our event and, where x = 1, until there is more."""
    progress = said.Progress(TeamPlan(NETWORK, conditions, effects))
    monitor = said.ExecutionMonitor(progress)
    for event in happened.split():
        del progress.pending[event]
        monitor.executed(event)
    progress.chosen.update(chosen)
    return [[(str(each.atom), each.consumers) for each, _ in monitor.compare(seen)] for seen in estimates]


TOASTED, TOAST_GONE = said.Estimate(true=frozenset({TOAST.atom})), said.Estimate(false=frozenset({TOAST.atom}))


@pytest.mark.parametrize(
    ("happened", "seen", "expected"),
    [
        ("begin", said.Estimate(), []),
        ("begin", TOASTED, []),
        ("begin", said.Estimate(false=frozenset({HOT.atom})), []),
        ("begin", replace(TOASTED, complete=True), []),
        ("begin", TOAST_GONE, [("(toast)", ("(work)", "the goal"))]),
        ("begin", said.Estimate(complete=True), [("(toast)", ("(work)", "the goal"))]),
        ("begin", said.Estimate(true=frozenset({HOT.atom})), [("(hot)", ("(work)",))]),
        ("", TOAST_GONE, []),  # nothing has made it yet
        ("begin own", TOAST_GONE, [("(toast)", ("the goal",))]),
        ("begin own more", TOAST_GONE, []),
    ],
)
def test_what_is_seen_otherwise_and_still_needed_breaks_links_once(happened, seen, expected):
    assert announced(happened, seen, seen) == [expected, []]


def test_what_is_not_chosen_is_not_needed_and_an_activity_that_undoes_and_does_has_done():
    assert announced("begin own", TOAST_GONE, x="2") == [[]]
    effects = (MADE[0], Effect(TOAST.negation, "begin", ALWAYS, 0), Effect(HOT, "begin", X1, 0))
    expected = [[], [("(toast)", ("(work)",))]]
    assert announced("begin", TOASTED, TOAST_GONE, effects=effects, conditions=NEEDED[:1]) == expected
