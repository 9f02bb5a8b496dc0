"""Messages and decisions as JSON objects and back, and what is said of objects that are neither."""

import json
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.json_text import parse_line
from robust.pike_bridge.model import (
    ALWAYS,
    Activity,
    Assignment,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Literal,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.progress import JSON
from robust.pike_bridge.online.service import News, Query
from robust.plan.model import Atom
from robust.records import in_line
from robust.show.schemas import schema

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


def again(kind, value):
    return JSON.read(kind, parse_line(json.dumps(JSON.write(kind, value)), "line"))


@given(MESSAGES)
def test_messages_come_back_as_they_were(message):
    assert again(said.Message, message) == message


@given(DECISIONS)
def test_decisions_come_back_as_they_were(decision):
    assert again(said.Decision, decision) == decision


def test_every_kind_is_there():
    """The strategies above miss no kind."""
    for union, strategy in ((said.Message, MESSAGES), (said.Decision, DECISIONS)):
        assert len(union.__args__) == len(strategy.original_strategies)


def bare(shape, parts):
    """A published schema without descriptions, with its parts in place."""
    if isinstance(shape, list):
        return [bare(each, parts) for each in shape]
    if not isinstance(shape, dict):
        return shape
    if "$ref" in shape:
        return bare(parts[shape["$ref"].removeprefix("#/$defs/")], parts)
    return {key: bare(each, parts) for key, each in shape.items() if key != "description"}


def test_published_schemas_are_those_of_the_types():
    """But for what a service adds: times of requests, and numbers of steps."""
    requests, answers = (schema(f"robust/pike-stdio{each}/1") for each in ("-input", ""))
    assert bare(requests["$defs"]["message"], requests["$defs"]) == JSON.schema(said.Message, written=False)
    published = bare(requests["oneOf"], requests["$defs"])
    for each in published:
        each["properties"].pop("time", None)
    assert published == JSON.schema(News | Query, written=False)["oneOf"]
    expected = JSON.schema(said.Decision, written=True)["oneOf"]
    published = bare(answers["oneOf"], answers["$defs"])[1 : 1 + len(expected)]
    for each, of_type in zip(published, expected, strict=True):
        assert each["properties"].pop("step") == {"type": "integer", "minimum": 1}
        assert each["properties"].pop("repeated") == {"const": True}
        assert (each["properties"], sorted(each["required"])) == (
            of_type["properties"],
            sorted([*of_type["required"], "step"]),
        )


def test_numbers_are_read_exactly():
    found = parse_line('{"a": 0.1, "b": "1/3", "c": 1e-3}', "line")
    assert [JSON.member(Fraction, found, name) for name in "abc"] == [
        Fraction(1, 10),
        Fraction(1, 3),
        Fraction(1, 1000),
    ]


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
    with pytest.raises(InputError) as caught, in_line("input", 7):
        JSON.read(said.Message, parse_line(text, "input"))
    assert str(caught.value).startswith(expected)


# -- how far an execution has come -------------------------------------------------------------------------------------

TOAST, HOT = Literal(Atom("toast")), Literal(Atom("hot"))
X1, X2 = guard({"x": "1"}), guard({"x": "2"})
NETWORK = Tpnu(
    "small",
    (Choice("x", ("1", "2"), False, "own"),),
    (*tuple(Event(name) for name in ("begin", "end", "own")), Event("more", X1), Event("less", X2)),
    (
        Constraint("begin", "own", Fraction(1), Fraction(9)),
        Constraint("end", "own", Fraction(0), None),
        Constraint("own", "more", Fraction(1, 2), Fraction(3), X1),
        Constraint("begin", "less", Fraction(4), None, X2),
    ),
    (Activity("(work)", "begin", "end", Fraction(2), Fraction(5), agent="human"),),
)


def small(**times):
    """Events at times, the last of which is now."""
    moments = {name: Fraction(str(time)) for name, time in times.items()}
    return said.Progress(TeamPlan(NETWORK, (), ()), max(moments.values(), default=Fraction(0)), moments)


def at(progress, now):
    progress.now = Fraction(now)
    return progress


def test_what_one_constraint_tells_about_now():
    assert not small().blocked("begin")
    assert small().blocked("own")  # it is later than the beginning, which is to come
    assert at(small(begin=2), "2.9").blocked("own")
    assert not at(small(begin=2), 3).blocked("own")  # the end may be at the same time
    assert at(small(begin=2), "3.9").blocked("end")
    assert not at(small(begin=2), 4).blocked("end")


def test_bounds_to_what_was_executed():
    assert (small().earliest("own"), small().latest()) == (None, None)
    begun = small(begin=2)
    assert (begun.earliest("own"), begun.earliest("end"), begun.latest()) == (3, 4, 7)
    assert begun.earliest("less") == 6
    assert begun.earliest("more") is None
    ended = small(begin=2, end=5)
    assert (ended.earliest("own"), ended.latest()) == (5, 11)
    done = small(begin=2, end=5, own=6)
    assert (done.earliest("more"), done.latest()) == (Fraction("6.5"), None)  # whether there is more is not known
    done.chosen["x"] = "1"
    assert done.latest() == 9


def test_whose_turn_it_is():
    progress = small(begin=0)
    assert (list(progress.frontier), progress.waits("own"), progress.waits("end")) == (["end", "less"], True, False)
    assert [progress.ours(event) for event in ("begin", "end", "own")] == [True, False, False]
    assert (progress.external("begin"), progress.external("end"), progress.external("own")) == ([], [ALWAYS], [ALWAYS])
    progress.chosen["x"] = "1"
    assert progress.external("own") == []
    assert (progress.ours("own"), progress.waits("more"), progress.waits("own")) == (True, False, True)
    assert not small(begin=0, end=2).waits("own")
    extra = replace(NETWORK, activities=(*NETWORK.activities, Activity("(extra)", "begin", "end", 1, 2, guard=X2)))
    progress = said.Progress(TeamPlan(extra, (), ()))
    assert progress.external("end") == [ALWAYS, X2]
    progress.chosen["x"] = "1"
    assert progress.external("end") == [ALWAYS]


def test_what_is_certain_and_what_is_compatible():
    progress = small()
    assert (progress.certain(X1), progress.certain(X1, X1), progress.certain(ALWAYS)) == (False, True, True)
    assert progress.compatible(X1)
    progress.chosen["x"] = "2"
    assert (progress.certain(X2), progress.compatible(X1), progress.compatible(X2)) == (True, False, True)


def test_copies_stay_as_they_are_and_can_be_rewound():
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


def test_orders_that_always_hold():
    structure = small().structure
    before = {event: set(earlier) for event, earlier in structure.before.items()}
    assert before == {"begin": set(), "end": {"begin"}, "own": {"begin"}, "more": {"own"}, "less": {"begin"}}
    not_before = {event: set(earlier) for event, earlier in structure.not_before.items()}
    assert not_before == before | {"own": {"begin", "end"}}


def test_events_at_one_time_do_not_wait_for_one_another():
    same = Constraint("one", "other", Fraction(0), Fraction(0))
    network = Tpnu("same", (), (Event("one"), Event("other")), (same,), ())
    assert list(said.Progress(TeamPlan(network, (), ())).frontier) == ["one", "other"]


def test_the_grid_divides_every_number():
    assert small().grid == Fraction(1, 1000)


# -- what is seen against what is needed later -------------------------------------------------------------------------


def monitored(*happened, effects=None, conditions=None):
    """Toast is made at the beginning, for our event and, where x = 1, until there is more."""
    effects = effects or (Effect(TOAST, "begin", ALWAYS, 0), Effect(HOT.negation, "begin", ALWAYS, 0))
    conditions = conditions or (
        Condition(TOAST, "own", "own", ALWAYS, 0),
        Condition(TOAST, "own", "more", X1, None),
        Condition(HOT.negation, "own", "own", ALWAYS, 0),
    )
    progress = said.Progress(TeamPlan(NETWORK, conditions, effects))
    monitor = said.Monitor(progress)
    for event in happened:
        del progress.pending[event]
        monitor.executed(event)
    return progress, monitor


def announced(monitor, **seen):
    return [(str(each.decision.atom), each.decision.consumers) for each in monitor.compare(said.Estimate(**seen))]


TOAST_GONE = {"false": frozenset({TOAST.atom})}


def test_what_is_expected_and_seen_or_not_mentioned_is_no_violation():
    _, monitor = monitored("begin")
    assert announced(monitor) == announced(monitor, true=frozenset({TOAST.atom})) == []
    assert announced(monitor, false=frozenset({HOT.atom})) == []
    assert announced(monitor, true=frozenset({TOAST.atom}), complete=True) == []


def test_what_is_seen_otherwise_breaks_all_links_once():
    _, monitor = monitored("begin")
    assert announced(monitor, **TOAST_GONE) == [("(toast)", ("(work)", "the goal"))]
    assert announced(monitor, **TOAST_GONE) == []
    assert announced(monitor, true=frozenset({HOT.atom})) == [("(hot)", ("(work)",))]
    _, monitor = monitored("begin")
    assert announced(monitor, complete=True) == [("(toast)", ("(work)", "the goal"))]


def test_only_what_is_still_needed_counts():
    assert announced(monitored()[1], **TOAST_GONE) == []  # nothing has made it yet
    assert announced(monitored("begin", "own")[1], **TOAST_GONE) == [("(toast)", ("the goal",))]
    assert announced(monitored("begin", "own", "more")[1], **TOAST_GONE) == []
    progress, monitor = monitored("begin", "own")
    progress.chosen["x"] = "2"
    assert announced(monitor, **TOAST_GONE) == []


def test_an_activity_that_undoes_and_does_has_done():
    effects = (
        Effect(TOAST, "begin", ALWAYS, 0),
        Effect(TOAST.negation, "begin", ALWAYS, 0),
        Effect(HOT, "begin", X1, 0),
    )
    _, monitor = monitored("begin", effects=effects, conditions=(Condition(TOAST, "own", "own", ALWAYS, 0),))
    assert announced(monitor, true=frozenset({TOAST.atom})) == []
    assert announced(monitor, **TOAST_GONE) == [("(toast)", ("(work)",))]
