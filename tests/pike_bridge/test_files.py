"""Reading and writing `.tpnu.json`: nothing is lost, every mistake is pointed at, and the schema says the same."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.json_text import Array, Constant, Json, Numeral, Object, Text, parse_json
from robust.pike_bridge import files as documents
from robust.pike_bridge.action_model import load_network, load_team_plan, team_plan_of
from robust.pike_bridge.builder import act, build
from robust.pike_bridge.files import SCHEMA_FILE, parse_tpnu, read_tpnu, tpnu_text, write_tpnu
from robust.pike_bridge.model import Activity, Choice, Constraint, Event, Tpnu, guard
from tests.pike_bridge.kitchen import DOMAIN, PROBLEM, kitchen
from tests.pike_bridge.plans import programs

SCHEMA = jsonschema.Draft202012Validator(json.loads(SCHEMA_FILE.read_text(encoding="utf-8")))
BASE = json.loads(tpnu_text(kitchen(), domain="kitchen.pddl", problem="problem.pddl"))

exact = st.fractions(max_denominator=10**6)
names = st.text(
    st.characters(exclude_categories=("Cc", "Cs"), exclude_characters="\u2028\u2029"), min_size=1, max_size=4
)
guards = st.dictionaries(names, names, max_size=2).map(guard)
words = st.text("abc-?_1", min_size=1, max_size=4)
networks = st.builds(
    Tpnu,
    names,
    st.lists(
        st.builds(Choice, names, st.lists(names, min_size=1, max_size=3, unique=True).map(tuple), st.booleans(), names),
        max_size=2,
    ).map(tuple),
    st.lists(st.builds(Event, names, guards), max_size=3).map(tuple),
    st.lists(st.builds(Constraint, names, names, st.none() | exact, st.none() | exact, guards), max_size=3).map(tuple),
    st.lists(
        st.builds(
            Activity,
            st.lists(words, min_size=1, max_size=3).map(lambda parts: f"({' '.join(parts)})"),
            names,
            names,
            exact,
            st.none() | exact,
            st.none() | names,
            guards,
        ),
        max_size=2,
    ).map(tuple),
)


@given(networks)
def test_what_is_written_is_read_again(network):
    document = parse_tpnu(tpnu_text(network, domain="d.pddl", problem="p.pddl"))
    assert document.network == network
    assert (document.domain, document.problem) == ("d.pddl", "p.pddl")
    SCHEMA.validate(json.loads(tpnu_text(network, domain="d.pddl", problem="p.pddl")))


@given(programs())
def test_built_plans_survive_files(network):
    assert parse_tpnu(tpnu_text(network, domain="d", problem="p")).network == network


def test_files(tmp_path):
    path = tmp_path / "kitchen.tpnu.json"
    write_tpnu(path, kitchen(), domain="pddl/kitchen.pddl", problem="p.pddl")
    document = read_tpnu(path)
    assert document.network == kitchen()
    assert document.beside(document.domain) == tmp_path / "pddl" / "kitchen.pddl"
    with pytest.raises(InputError, match="cannot write"):
        write_tpnu(tmp_path / "missing" / "x.tpnu.json", kitchen(), domain="d", problem="p")
    with pytest.raises(InputError, match="no such file"):
        read_tpnu(tmp_path / "kitchn.tpnu.json")


def document_with(**changes):
    return json.dumps({**BASE, **changes})


@pytest.mark.parametrize(
    ("written", "value"),
    [("0.001", "1/1000"), ('"1/3"', "1/3"), ('"0.1"', "1/10"), ("1e-3", "1/1000"), ("-2.50", "-5/2"), ("1E2", "100")],
)
def test_numbers_are_exact(written, value):
    text = document_with(constraints=[{"from": "e1", "to": "e2", "lower": 987, "upper": None}])
    constraint = parse_tpnu(text.replace("987", written)).network.constraints[0]
    assert constraint.lower == Fraction(value)
    assert constraint.upper is None


MISTAKES = {
    '{"format": "tpnu/2", "name": "n", "domain": "d", "problem": "p", "events": []}': "1:12: found 'tpnu/2'",
    '{"format": "tpnu/1",\n "nam": "n"}': "2:2: found key 'nam', expected one of a plan with choices; did you mean",
    '{"format": "tpnu/1"}': "1:1: found a plan with choices without 'name'",
    "[]": "1:1: found an empty list, expected a plan with choices",
    '{"format": "tpnu/1",\n "format": 1}': "2:2: found a second 'format', expected one; the first is in line 1",
    '{"name": "a\nb"}': "1:10: found a string without an end",
    '{"name": "\\q"}': "1:11: found an invalid escape",
    '{"name": "\\ud800"}': "1:10: found half a surrogate pair",
    '{"name": nul}': "1:10: found 'nul', expected a JSON value",
    '{"name": 01}': "1:10: found '01'",
    '{"a": [1, 2': "1:12: found the end of the file, expected ',' or ']' to end what begins in line 1",
    "[1,]": "1:4: found ']', expected another value",
    "{} {}": "1:4: found '{', expected the end of the document",
    "": "1:1: found an empty file",
    "[" * 100_000: "1:101: found values nested more than 100 deep",
    '{"a":' * 100_000: "nested more than 100 deep",
}


@pytest.mark.parametrize(("text", "message"), MISTAKES.items(), ids=[*MISTAKES.values()])
def test_mistakes_are_pointed_at(text, message):
    with pytest.raises(InputError) as caught:
        parse_tpnu(text, "plan.json")
    assert f"plan.json:{message}" in str(caught.value) or message in str(caught.value)
    assert caught.value.location.line is not None
    assert "\n" not in str(caught.value)


WRONG_PARTS = [
    ({"events": [{"name": "e", "guard": {"x": 1}}]}, "found 1, expected a text in quotes"),
    ({"events": [{"name": ""}]}, "expected a text that is not empty"),
    ({"events": [{"name": "e", "guard": []}]}, "expected a guard: an object"),
    ({"events": {}}, "found an empty object, expected a list"),
    ({"choices": [{"name": "x", "domain": [], "controllable": True, "at": "e1"}]}, "at least one value to choose"),
    ({"choices": [{"name": "x", "domain": ["a", "a"], "controllable": True, "at": "e1"}]}, "found a second 'a'"),
    ({"choices": [{"name": "x", "domain": ["a"], "controllable": 1, "at": "e1"}]}, "found 1, expected true or false"),
    ({"choices": [{"name": "x", "domain": ["a"], "controllable": True}]}, "found a choice without 'at'"),
    ({"constraints": [{"from": "a", "to": "b", "lower": "soon", "upper": 1}]}, "found 'soon', expected a number"),
    ({"constraints": [{"from": "a", "to": "b", "lower": "1/0", "upper": 1}]}, "denominator is not 0"),
    ({"constraints": [{"from": "a", "to": "b", "lower": True, "upper": 1}]}, "found true, expected a number, or null"),
    ({"activities": [{"action": "get", "from": "a", "to": "b", "lower": 1, "upper": 1}]}, "expected a ground action"),
    (
        {"activities": [{"action": "(a)", "from": "a", "to": "b", "lower": None, "upper": 1}]},
        "found null, expected a num",
    ),
]


@pytest.mark.parametrize(("changes", "message"), WRONG_PARTS)
def test_wrong_parts(changes, message):
    with pytest.raises(InputError, match="<tpnu>:1:") as caught:
        parse_tpnu(document_with(**changes))
    assert message in str(caught.value)


def test_enormous_numbers_are_refused_quickly():
    text = document_with(constraints=[{"from": "e1", "to": "e2", "lower": 987, "upper": None}])
    for number in ("1e999999999", "9" * 10_000, '"1e-99999"'):
        with pytest.raises(InputError, match="300 digits"):
            parse_tpnu(text.replace("987", number))


def test_actions_are_normalised():
    activity = {"action": "( Get  Human Mug )", "from": "e1", "to": "e2", "lower": 1, "upper": None}
    assert parse_tpnu(document_with(activities=[activity])).network.activities[0].action == "(get human mug)"


@pytest.mark.parametrize(
    "network",
    [
        Tpnu("n", (Choice("x", ("a",), True, None),), (), (), ()),
        Tpnu("n", (), (Event("e", frozenset(guard({"x": "a"}) | guard({"x": "b"}))),), (), ()),
        Tpnu("n", (), (), (), (Activity("(GET)", "a", "b", Fraction(1), None),)),
        Tpnu("", (), (), (), ()),
    ],
)
def test_what_files_cannot_say_is_not_written(network):
    with pytest.raises(InputError):
        tpnu_text(network, domain="d", problem="p")


def test_places():
    places = parse_tpnu(
        '{"format": "tpnu/1", "name": "n", "domain": "d", "problem": "p",\n "events": [{"name": "e"}]}'
    ).places
    assert str(places.of("events", 0, "name")) == "<tpnu>:2:22"
    assert str(places.of("events", 0, "guard", "x")) == "<tpnu>:2:13"


# -- the schema ------------------------------------------------------------------------------------------------------

values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.sampled_from((0.5, 1e-5, "", "e1", "a\nb", "1/2", "1/2\n", "+.5e3", "5.", "(a b)", "( a  b )", "(a (b))", "()")),
    st.sampled_from(("(a\tb)", "(a\u00a0b)", "\u2028", "1_0", "\u0661", "tpnu/1", [], {}, [[]], ["a"], ["a", "a"])),
    st.dictionaries(st.sampled_from(("x", "name", "guard", "", "\x7f")), st.sampled_from(("a", "", 1)), max_size=2),
)


@st.composite
def mutated(draw):
    # Copies, because what is drawn may be one object for all examples, and the next change may be inside of it.
    document = copy.deepcopy(BASE)
    for _ in range(draw(st.integers(1, 2))):
        node = document
        while True:
            keys = list(node) if isinstance(node, dict) else list(range(len(node)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if isinstance(node[key], (dict, list)) and node[key] and draw(st.integers(0, 3)):
                node = node[key]
                continue
            change = draw(st.sampled_from(("replace", "replace", "remove", "add")))
            if change == "replace":
                node[key] = copy.deepcopy(draw(values))
            elif change == "remove":
                del node[key]
            elif isinstance(node, dict):
                node[draw(st.sampled_from(("guard", "agent", "lower", "other")))] = copy.deepcopy(draw(values))
            else:
                node.append(copy.deepcopy(draw(values)))
            break
    return document


@given(mutated())
def test_reader_and_schema_accept_the_same(document):
    try:
        parse_tpnu(json.dumps(document))
        accepted = True
    except InputError:
        accepted = False
    assert accepted == SCHEMA.is_valid(document)


@pytest.mark.parametrize("key", ["choices", "events", "constraints", "activities", None])
def test_schema_has_the_members_that_are_read_and_written(key):
    part, schema = documents._DOCUMENT, SCHEMA.schema
    if key is not None:
        part = documents._LISTS[key]
        schema = schema["$defs"][schema["properties"][key]["items"]["$ref"].rpartition("/")[2]]
    assert set(schema["properties"]) == {member.key for member in part.members}
    assert schema["required"] == [member.key for member in part.members if member.required]


def test_schema_is_a_schema_and_packaged():
    jsonschema.Draft202012Validator.check_schema(SCHEMA.schema)
    assert Path(SCHEMA_FILE).parent.name == "pike_bridge"


# -- JSON ------------------------------------------------------------------------------------------------------------


def plain(value: Json):
    match value:
        case Text(text):
            return text
        case Numeral(text):
            return json.loads(text)
        case Constant(constant):
            return constant
        case Array(items):
            return [plain(item) for item in items]
        case Object(members):
            return {key: plain(member) for key, member in members.items()}


any_json = st.deferred(
    lambda: st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.text(),
        st.lists(any_json, max_size=4),
        st.dictionaries(st.text(), any_json, max_size=4),
    )
)


@given(any_json)
def test_json_is_read_as_the_standard_library_does(value):
    for indent in (None, 1):
        assert plain(parse_json(json.dumps(value, indent=indent), "f")) == value
        assert plain(parse_json(json.dumps(value, ensure_ascii=False, indent=indent), "f")) == value


@given(st.lists(st.sampled_from([*'{}[],:"\\0129eE+-. \nnb\t', '"a"', '"b"', "null", "true", "1.5"]), max_size=12))
def test_no_other_text_is_json(parts):
    text = "".join(parts)

    def unique(pairs):
        if len(dict(pairs)) < len(pairs):
            raise ValueError("repeated key")
        return dict(pairs)

    try:
        expected = json.loads(text, object_pairs_hook=unique)
    except ValueError:
        with pytest.raises(InputError):
            parse_json(text, "f")
    else:
        assert plain(parse_json(text, "f")) == expected


def test_one_activity_reads_well():
    text = tpnu_text(build("one", act("(wait)", "1/3", "2.5")), domain="d.pddl", problem="p.pddl")
    assert text == (
        '{\n  "format": "tpnu/1",\n  "name": "one",\n  "domain": "d.pddl",\n  "problem": "p.pddl",\n  "choices": [],\n'
        '  "events": [\n    {"name": "e1"},\n    {"name": "e2"}\n  ],\n  "constraints": [],\n  "activities": [\n'
        '    {"action": "(wait)", "from": "e1", "to": "e2", "lower": "1/3", "upper": 2.5}\n  ]\n}\n'
    )


@pytest.fixture
def files(tmp_path):
    (tmp_path / "pddl").mkdir()
    (tmp_path / "pddl" / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    (tmp_path / "pddl" / "problem.pddl").write_text(PROBLEM, encoding="utf-8")
    path = tmp_path / "kitchen.tpnu.json"
    write_tpnu(path, kitchen(), domain="pddl/domain.pddl", problem="pddl/problem.pddl")
    return path


def edit(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")


def test_a_plan_from_files_is_that_in_memory(files):
    assert load_team_plan(files) == team_plan_of(kitchen(), DOMAIN, PROBLEM)
    assert load_network(files) == kitchen()


def test_actions_are_located(files):
    edit(files, "(get human glass)", "(grab human glass)")
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:16: found action 'grab', expected one of domain"):
        load_team_plan(files)
    edit(files, "(grab human glass)", "(get human bagel)")
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:16: found 'bagel' of type food"):
        load_team_plan(files)
    edit(
        files,
        '(get human bagel)", "from": "e4", "to": "e5", "lower": 0.5, "upper": 2',
        '(get human glass)", "from": "e4", "to": "e5", "lower": 11, "upper": 12',
    )
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:5: found activity .* with bounds \[11, 12\]"):
        load_team_plan(files)


def test_networks_are_checked_first(files):
    edit(files, '"at": "e1"', '"at": "e99"')
    for load in (load_team_plan, load_network):
        with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:\d+: found event 'e99'"):
            load(files)


def test_missing_files(files):
    (files.parent / "pddl" / "problem.pddl").unlink()
    with pytest.raises(InputError, match=r"pddl/problem.pddl: found no such file"):
        load_team_plan(files)
    load_network(files)
    with pytest.raises(InputError, match="no such file"):
        load_team_plan(files.with_name("other.tpnu.json"))


def test_unsupported_domains_are_located(files):
    edit(files.parent / "pddl" / "domain.pddl", "(over all (taken ?v))", "(over all (or (taken ?v) (filled ?v)))")
    with pytest.raises(UnsupportedError, match=r"domain.pddl:\d+:\d+: found a disjunction .* of \(pour robot mug\)"):
        load_team_plan(files)
