"""Reading and writing `.tpnu.json`: nothing is lost, every mistake is pointed at, and the schema says the same."""

import copy
import json
from contextlib import nullcontext
from fractions import Fraction
from itertools import product

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.json_text import Array, Constant, JsonText, Numeral, Object, parse_json
from robust.pike_bridge import action_model, builder, model
from robust.pike_bridge import files as documents
from robust.pike_bridge.files import SCHEMA_FILE, parse_tpnu, read_tpnu, tpnu_text, write_tpnu
from tests.pike_bridge.plans import DOMAIN, PROBLEM, kitchen
from tests.sampling import often
from tests.tables import tables

TABLES = tables(__file__)

SCHEMA = jsonschema.Draft202012Validator(json.loads(SCHEMA_FILE.read_text(encoding="utf-8")))
BASE = json.loads(tpnu_text(kitchen(), domain="kitchen.pddl", problem="problem.pddl"))

exact = st.fractions(max_denominator=10**6)
names = st.text(
    st.characters(exclude_categories=("Cc", "Cs"), exclude_characters="\u2028\u2029"), min_size=1, max_size=4
)
guards = st.dictionaries(names, names, max_size=2).map(model.guard)
actions = st.lists(st.text("abc-?_1", min_size=1, max_size=4), min_size=1, max_size=3).map(
    lambda parts: f"({' '.join(parts)})"
)


def several(kind, *parts, most):
    return st.lists(st.builds(kind, *parts), max_size=most).map(tuple)


domains = st.lists(names, min_size=1, max_size=3, unique=True).map(tuple)
networks = st.builds(
    model.Tpnu,
    names,
    several(model.Choice, names, domains, st.booleans(), names, most=2),
    several(model.Event, names, guards, most=3),
    several(model.Constraint, names, names, st.none() | exact, st.none() | exact, guards, most=3),
    several(model.Activity, actions, names, names, exact, st.none() | exact, st.none() | names, guards, most=2),
)


@given(networks)
def test_what_is_written_is_read_again(network):
    text = tpnu_text(network, domain="d.pddl", problem="p.pddl")
    document = parse_tpnu(text)
    assert (document.network, document.domain, document.problem) == (network, "d.pddl", "p.pddl")
    SCHEMA.validate(json.loads(text))


def document_with(**changes):
    return json.dumps({**BASE, **changes})


BOUNDED = document_with(constraints=[{"from": "e1", "to": "e2", "lower": 987, "upper": None}])


@pytest.mark.parametrize(
    ("written", "value"),
    [("0.001", "1/1000"), ('"1/3"', "1/3"), ('"0.1"', "1/10"), ("1e-3", "1/1000"), ("-2.50", "-5/2"), ("1E2", "100")],
)
def test_numbers_are_exact(written, value):
    network = parse_tpnu(BOUNDED.replace("987", written)).network
    assert network.constraints == (model.Constraint("e1", "e2", Fraction(value), None),)


CHOICE = {"name": "x", "domain": ["a"], "controllable": True, "at": "e1"}
CONSTRAINT = {"from": "a", "to": "b", "lower": 1, "upper": 1}
ACTIVITY = {"action": "(a)", **CONSTRAINT}
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
    document_with(events=[{"name": "e", "guard": {"x": 1}}]): "found 1, expected a text in quotes",
    document_with(events=[{"name": ""}]): "expected a text that is not empty",
    document_with(events=[{"name": "e", "guard": []}]): "expected a guard: an object",
    document_with(events={}): "found an empty object, expected a list",
    document_with(choices=[CHOICE | {"domain": []}]): "at least one value to choose",
    document_with(choices=[CHOICE | {"domain": ["a", "a"]}]): "found a second 'a'",
    document_with(choices=[CHOICE | {"controllable": 1}]): "found 1, expected true or false",
    document_with(choices=[{key: CHOICE[key] for key in CHOICE if key != "at"}]): "found a choice without 'at'",
    document_with(constraints=[CONSTRAINT | {"lower": "soon"}]): "found 'soon', expected a number",
    document_with(constraints=[CONSTRAINT | {"lower": "1/0"}]): "denominator is not 0",
    document_with(constraints=[CONSTRAINT | {"lower": True}]): "found true, expected a number, or null",
    document_with(activities=[ACTIVITY | {"action": "get"}]): "expected a ground action",
    document_with(activities=[ACTIVITY | {"lower": None}]): "found null, expected a num",
    **{BOUNDED.replace("987", number): "300 digits" for number in ("1e999999999", "9" * 10_000, '"1e-99999"')},
}


@pytest.mark.parametrize(("text", "message"), MISTAKES.items(), ids=range(len(MISTAKES)))
def test_mistakes_are_pointed_at(text, message):
    with pytest.raises(InputError, match=r"plan.json:\d+:\d+: ") as caught:
        parse_tpnu(text, "plan.json")
    assert f"plan.json:{message}" in str(caught.value) or message in str(caught.value)
    assert caught.value.location.line is not None
    assert "\n" not in str(caught.value)


def test_actions_are_normalised_places_known_and_one_activity_reads_well():
    document = document_with(activities=[ACTIVITY | {"action": "( Get  Human Mug )"}])
    assert parse_tpnu(document).network.activities[0].action == "(get human mug)"
    events = '"events": [{"name": "e"}]'
    places = parse_tpnu(f'{{"format": "tpnu/1", "name": "n", "domain": "d", "problem": "p",\n {events}}}').places
    assert str(places.of("events", 0, "name")) == "<tpnu>:2:22"
    assert str(places.of("events", 0, "guard", "x")) == "<tpnu>:2:13"
    text = tpnu_text(builder.build("one", builder.act("(wait)", "1/3", "2.5")), domain="d.pddl", problem="p.pddl")
    assert text == (
        '{\n  "format": "tpnu/1",\n  "name": "one",\n  "domain": "d.pddl",\n  "problem": "p.pddl",\n  "choices": [],\n'
        '  "events": [\n    {"name": "e1"},\n    {"name": "e2"}\n  ],\n  "constraints": [],\n  "activities": [\n'
        '    {"action": "(wait)", "from": "e1", "to": "e2", "lower": "1/3", "upper": 2.5}\n  ]\n}\n'
    )


@pytest.mark.parametrize(
    "network",
    [
        model.Tpnu("n", (model.Choice("x", ("a",), True, None),), (), (), ()),
        model.Tpnu("n", (), (model.Event("e", frozenset(model.guard({"x": "a"}) | model.guard({"x": "b"}))),), (), ()),
        model.Tpnu("n", (), (), (), (model.Activity("(GET)", "a", "b", Fraction(1), None),)),
        model.Tpnu("", (), (), (), ()),
    ],
)
def test_what_files_cannot_say_is_not_written(network):
    with pytest.raises(InputError):
        tpnu_text(network, domain="d", problem="p")


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
        while keys := list(node) if isinstance(node, dict) else list(range(len(node))):
            key = draw(st.sampled_from(keys))
            if not (isinstance(node[key], (dict, list)) and node[key] and draw(st.integers(0, 3))):
                break
            node = node[key]
        change = draw(st.sampled_from(("replace", "replace", "remove", "add"))) if keys else "nothing"
        if change == "replace":
            node[key] = copy.deepcopy(draw(values))
        elif change == "remove":
            del node[key]
        elif change == "add" and isinstance(node, dict):
            node[draw(st.sampled_from(("guard", "agent", "lower", "other")))] = copy.deepcopy(draw(values))
        elif change == "add":
            node.append(copy.deepcopy(draw(values)))
    return document


@given(mutated())
def test_reader_and_schema_accept_the_same(document):
    with nullcontext() if SCHEMA.is_valid(document) else pytest.raises(InputError):
        parse_tpnu(json.dumps(document))


@pytest.mark.parametrize("key", ["choices", "events", "constraints", "activities", None])
def test_schema_has_the_members_that_are_read_and_written(key):
    part, schema = documents._DOCUMENT, SCHEMA.schema
    if key is not None:
        part = documents._LISTS[key]
        schema = schema["$defs"][schema["properties"][key]["items"]["$ref"].rpartition("/")[2]]
    assert set(schema["properties"]) == {*part.required, *part.optional}
    assert schema["required"] == [*part.required]
    jsonschema.Draft202012Validator.check_schema(SCHEMA.schema)


def plain(value):
    match value:
        case JsonText(text):
            return text
        case Numeral(text):
            return json.loads(text)
        case Constant(constant):
            return constant
        case Array(items):
            return [plain(item) for item in items]
        case Object(members):
            return {key: plain(member) for key, member in members.items()}


any_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
)


@settings(max_examples=often(20, 40))
@given(any_json)
def test_json_is_read_as_the_standard_library_does(value):
    for indent, ascii_only in product((None, 1), (True, False)):
        assert plain(parse_json(json.dumps(value, ensure_ascii=ascii_only, indent=indent), "f")) == value


@given(st.lists(st.sampled_from([*'{}[],:"\\0129eE+-. \nnb\t', '"a"', '"b"', "null", "true", "1.5"]), max_size=12))
def test_no_other_text_is_json(parts):
    text = "".join(parts)

    def unique(pairs):
        return dict(pairs) if len(dict(pairs)) == len(pairs) else json.loads("")

    try:
        expected = json.loads(text, object_pairs_hook=unique)
    except ValueError:
        with pytest.raises(InputError):
            parse_json(text, "f")
    else:
        assert plain(parse_json(text, "f")) == expected


@pytest.fixture
def files(tmp_path):
    (tmp_path / "pddl").mkdir()
    (tmp_path / "pddl" / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    (tmp_path / "pddl" / "problem.pddl").write_text(PROBLEM, encoding="utf-8")
    path = tmp_path / "kitchen.tpnu.json"
    write_tpnu(path, kitchen(), domain="pddl/domain.pddl", problem="pddl/problem.pddl")
    return path


def test_a_plan_from_files_is_that_in_memory(files, tmp_path):
    assert action_model.load_team_plan(files) == action_model.Instance(kitchen(), DOMAIN, PROBLEM).plan()
    document = read_tpnu(files)
    assert document.network == kitchen()
    assert document.beside(document.domain) == tmp_path / "pddl" / "domain.pddl"
    with pytest.raises(InputError, match="cannot write"):
        write_tpnu(tmp_path / "missing" / "x.tpnu.json", kitchen(), domain="d", problem="p")
    with pytest.raises(InputError, match="no such file"):
        read_tpnu(tmp_path / "kitchn.tpnu.json")
    (tmp_path / "pddl" / "problem.pddl").unlink()
    with pytest.raises(InputError, match=r"pddl/problem.pddl: found no such file"):
        action_model.load_team_plan(files)


@pytest.mark.parametrize(("before", "after", "message"), TABLES["mistakes are located"])
def test_mistakes_are_located(files, before, after, message):
    documents = (files, files.parent / "pddl" / "domain.pddl")
    [path] = [path for path in documents if before in path.read_text(encoding="utf-8")]
    path.write_text(path.read_text(encoding="utf-8").replace(before, after, 1), encoding="utf-8")
    with pytest.raises((InputError, UnsupportedError), match=f"{path.name}:{message}"):
        action_model.load_team_plan(files)
