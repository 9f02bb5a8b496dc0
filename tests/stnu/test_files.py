"""Files of networks: what is read, what is written and read again, and what is wrong with others, by its place."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree

import pytest

from robust import InputError, InputWarning, RobustError, UnsupportedError, stnu
from robust.stnu import Link
from robust.stnu.graphml import graphml, parse_graphml
from robust.stnu.network import ChoicePoint
from robust.stnu.network_json import network_json, parse_network_json
from tests.stnu.networks import drawn, network

DATA = Path(__file__).with_name("data")
TOOL = (DATA / "small.stnu").read_text(encoding="utf-8")
LINKS = (
    Link("A", "C", Fraction(1), Fraction(10), True),
    Link("C", "D", Fraction(1), Fraction(2)),
    Link("A", "D", None, Fraction(12)),
)
JSON = (DATA / "small.json").read_text(encoding="utf-8")


def test_graphml_of_the_tool():
    found = parse_graphml(TOOL, "small.stnu")
    assert (found.nodes, found.origin, found.links) == (("Z", "A", "C", "D"), "Z", LINKS)
    assert (found.layout, [link.place.line for link in found.links]) == ({"Z": ("10.5", "20")}, [18, 20, 22])
    assert stnu.check(found).is_controllable


def test_contingent_edges_with_values_instead_of_labels():
    older = TOOL.replace("LabeledValue", "Value").replace("LC(C):1<", "10<").replace("UC(C):-10", "-1")
    assert parse_graphml(older, "small.stnu").links == LINKS
    both = TOOL.replace("LC(C):1</data>", 'LC(C):1</data><data key="Value">10</data>')
    assert parse_graphml(both, "small.stnu").links == LINKS
    with pytest.raises(InputError, match=r"^small.stnu:18:1: found a Value that is not that of A => C in \[1, 10\]"):
        parse_graphml(both.replace('"Value">10<', '"Value">11<'), "small.stnu")


def test_json():
    found = parse_network_json(JSON, "small.json")
    assert (found.nodes, found.origin) == (("0", "1", "2"), "0")
    assert found.links == (Link("0", "1", Fraction(1, 10), Fraction(40), True), Link("1", "2", Fraction(-3), None))


def edges(found):
    """What the links of a network say, whichever way round."""
    requirements = [link for link in found.links if not link.is_contingent]
    upwards = {(link.source, link.target, link.upper) for link in requirements if link.upper is not None}
    downwards = {(link.target, link.source, -link.lower) for link in requirements if link.lower is not None}
    return set(found.contingents), upwards | downwards


def test_networks_written_and_read_again(tmp_path):
    """The verdict is the same, and what has been read is written as it was."""
    for seed, _, drawn_network in drawn(range(60), 4, 3, 6, 6):
        found = replace(drawn_network, origin="x0" if seed % 3 == 0 and "x0" in drawn_network.nodes else None)
        verdict = stnu.check(found).verdict
        again = parse_network_json(network_json(found), "again")
        assert stnu.check(again).verdict is verdict
        if found.origin is None:
            assert (again.nodes, again.links) == (found.nodes, found.links)
        else:
            assert (again.origin, len(again.links)) == ("0", len(found.links))
        text, scale = graphml(found)
        (tmp_path / "again.stnu").write_text(text, encoding="utf-8")
        again = stnu.load(tmp_path / "again.stnu")
        assert (scale, len(again.nodes)) == (1, len(found.nodes))
        lengths = [[(link.lower, link.upper) for link in one.contingents] for one in (again, found)]
        assert lengths[0] == lengths[1]
        assert (again.origin, found.origin) in {("Z", "x0"), (None, None)}
        assert stnu.check(again).verdict is verdict
        assert graphml(again)[0].replace("again.stnu", "test") == graphml(parse_graphml(text, "test"))[0]
        assert edges(parse_graphml(graphml(again)[0], "again")) == edges(again)
    thirds = network(("1", "2", Fraction(1, 3), Fraction(22, 7), "contingent"), ("2", "a b", None, "0.5"))
    assert parse_network_json(network_json(thirds), "again").links == thirds.links


def test_graphml_is_what_other_readers_expect():
    text, _ = graphml(parse_graphml(TOOL, "dir/small.stnu"))
    top = ElementTree.fromstring(text.replace(' xmlns="', ' xmlns:n="'))  # noqa: S314 - our own
    declared = {(key.get("id"), key.get("for")) for key in top.findall("key")}
    data = {one.get("key"): one.text for one in top.findall("graph/data")}
    assert data == {"NetworkType": "STNU", "nEdges": "5", "nVertices": "4", "nContingent": "1", "Name": "small.stnu"}
    used = {(one.get("key"), kind) for kind in ("node", "edge") for one in top.findall(f"graph/{kind}/data")}
    assert used | {(key, "graph") for key in data} <= declared
    edges = [(one.get("source"), one.get("target"), *(text.text for text in one)) for one in top.findall("graph/edge")]
    assert edges[:2] == [("A", "C", "contingent", "LC(C):1"), ("C", "A", "contingent", "UC(C):-10")]
    assert ("D", "C", "requirement", "-1") in edges


def test_the_tool_reads_whole_numbers():
    halves = network(("A", "C", "0.5", "1.25", "contingent"), ("C", "D", None, 3))
    text, scale = graphml(halves)
    assert scale == 4
    assert [(link.lower, link.upper) for link in parse_graphml(text, "again").links] == [(2, 5), (None, 12)]
    with pytest.raises(UnsupportedError, match="has no upper bound"):
        graphml(network(("A", "C", 1, None, "contingent")))
    with pytest.raises(InputError, match=r"'a\.txt', expected a name that ends in \.stnu or \.json"):
        stnu.write(halves, Path("a.txt"))


def test_the_origin_has_the_name_that_the_format_gives_it():
    found = parse_graphml(TOOL, "small.stnu")
    assert parse_network_json(network_json(found), "small.json").nodes == ("0", "A", "C", "D")
    assert parse_graphml(graphml(parse_network_json(JSON, "n.json"))[0], "n.stnu").nodes == ("Z", "1", "2")
    for name, write in (("Z", graphml), ("0", network_json)):
        with pytest.raises(UnsupportedError, match=f"found node '{name}' that is not the origin"):
            write(network((name, "A", 0, 5)))


WRONG_GRAPHML = (
    ("broken XML", "</graphml>\n", "", r"^n.stnu:25:1: found broken XML \(no element found\), expected GraphML$"),
    ("broken in the middle", '<node id="A"/>', '<node id="A">', r"^n.stnu:24:3: found broken XML \(mismatched tag\)"),
    ("unknown type", ">derived<", ">derivd<", r"^n.stnu:23:.*: found type 'derivd', expected that of an edge; did"),
    ("no value", '<data key="Value">2</data>', "", "^n.stnu:20:1: found no Value, expected a number$"),
    ("no number", ">12<", ">twelve<", "^n.stnu:22:.*: found 'twelve', expected a number"),
    ("unknown node", 'target="D"', 'target="E"', "^n.stnu:20:1: found unknown node 'E', expected one of the nodes$"),
    ("no target", ' target="D"', "", "^n.stnu:20:1: found an edge without target, expected one$"),
    ("second node", '<node id="A"/>', '<node id="A"/><node id="A"/>', "found a second node 'A'"),
    ("half a link", ">UC(C):-10<", "><", "^n.stnu:18:1: found only an LC value, expected LC and UC"),
    ("one edge", '<edge id="CA" source="C" target="A">', '<edge id="CA" source="C" target="Z">', "found no contingent"),
    ("wrong end", "UC(C)", "UC(A)", r"^n.stnu:19:.*: found UC\(A\), expected UC\(C\) on this edge$"),
    ("no case", "UC(C):-10", "-10", r"^n.stnu:19:.*: found '-10', expected LC\(NODE\):NUMBER or UC"),
    ("empty link", "UC(C):-10", "UC(C):0", r"^n.stnu:18:1: found A => C in \[1, 0\], expected a lower bound"),
    ("document type", "<graphml", "<!DOCTYPE x []>\n<graphml", "^n.stnu:2:.*: found a document type"),
    ("not directed", 'edgedefault="directed"', "edgedefault='undirected'", "^n.stnu:8:1: found a graph that"),
    ("edge not directed", '<edge id="AD"', '<edge directed="false" id="AD"', "^n.stnu:22:1: found an edge that is not"),
    ("hyperedge", "</graph>", "<hyperedge/></graph>", "^n.stnu:24:1: found a hyperedge, expected edges between"),
    ("value twice", ">12</data>", '>12</data><data key="Value">1</data>', "^n.stnu:22:.*: found a second Value"),
)


@pytest.mark.parametrize(("_what", "old", "new", "says"), WRONG_GRAPHML, ids=lambda text: None)
def test_wrong_graphml(_what, old, new, says):
    assert old in TOOL
    with pytest.raises(InputError, match=says) as caught:
        parse_graphml(TOOL.replace(old, new, 1), "n.stnu")
    assert "\n" not in str(caught.value)


def test_graphml_without_a_graph_or_edges():
    without = TOOL[: TOOL.index("<edge")] + "</graph></graphml>"
    with pytest.raises(InputError, match=r"^n.stnu:8:1: found no edges, expected at least one$"):
        parse_graphml(without, "n.stnu")
    with pytest.raises(InputError, match=r"^n.stnu:1:1: found no graph, expected GraphML with one$"):
        parse_graphml("<svg/>", "n.stnu")


def test_labels_that_cannot_be_read():
    observed = TOOL.replace('<node id="A"/>', '<node id="A"><data key="Obs">p</data></node>')
    assert parse_graphml(observed, "n.stnu").choices == (ChoicePoint("p", ("true", "false"), "A"),)
    for key, text in (("Label", "¬q"), ("Label", "pq")):
        node = f'<node id="A"><data key="Obs">p</data><data key="{key}">{text}</data></node>'
        with pytest.raises(
            InputError, match=rf"^n.stnu:15:.*: found label '{text}', expected propositions that are obs"
        ):
            parse_graphml(TOOL.replace('<node id="A"/>', node), "n.stnu")
    for value in ("{(12, p) }", "{(12)}", "12", "{(12, ⊡) 3}", "{(C, 12, ⊡)}"):
        labeled = TOOL.replace('"Value">12<', f'"LabeledValues">{value}<')
        with pytest.raises(InputError, match=r"^n.stnu:22:.*: found (label 'p'|LabeledValues .*), expected"):
            parse_graphml(labeled, "n.stnu")


def test_labeled_values_whose_labels_are_all_empty():
    """What the tool writes of a network that it took for one with observations, in the orders of its versions."""
    labeled = (
        TOOL.replace('"LabeledValue">LC(C):1<', '"LowerCaseLabeledValues">{(C, 1, ⊡) }<')
        .replace('"LabeledValue">UC(C):-10<', '"UpperCaseLabeledValues">{(⊡, C, -10)}<')
        .replace('"Value">2<', '"LabeledValues">{(2, ⊡) }<')
        .replace('"Value">-1<', '"Value">-1</data><data key="LabeledValues">{(⊡, -1) }<')
        .replace('<node id="A"/>', '<node id="A"><data key="Label">⊡</data><data key="Obs"></data></node>')
        .replace('"Type">derived<', '"LabeledValues">{}</data><data key="Type">derived<')
    )
    assert (labeled.count("Labeled"), parse_graphml(labeled, "n.stnu").links) == (5, LINKS)
    both_hold = parse_graphml(labeled.replace("(⊡, -1)", "(⊡, -2)"), "n.stnu").links
    assert both_hold == (LINKS[0], replace(LINKS[1], lower=Fraction(2)), LINKS[2])
    two = labeled.replace("{(C, 1, ⊡) }", "{(C, 1, ⊡) (C, 2, ⊡)}")
    with pytest.raises(
        InputError, match=r"^n.stnu:18:1: found two different values of a contingent edge, expected one$"
    ):
        parse_graphml(two, "n.stnu")


def test_keys_with_names_of_their_own():
    """Most writers of GraphML number the keys and say in the header what each is called."""
    other = TOOL
    for number, key in enumerate(("Type", "Value", "LabeledValue")):
        other = other.replace(f'key="{key}"', f'key="d{number}"')
        other = other.replace("<graph ", f'<key id="d{number}" for="edge" attr.name="{key}"/>\n<graph ')
    assert (other.count("attr.name"), parse_graphml(other, "n.stnu").links) == (3, LINKS)
    with (
        pytest.warns(InputWarning, match="^n.stnu: passed over what has no meaning for networks: 'd2' of edges$"),
        pytest.raises(InputError, match="found a contingent edge without finite values, expected LC and UC, or Value"),
    ):
        parse_graphml(other.replace('id="d2"', 'id="d3"'), "n.stnu")


def test_texts_are_networks_as_well(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = '{"nodes": [1, 2], "constraints": [{"first_node": 1, "second_node": 2, "lb": 0, "ub": 3}]}'
    for given in (text, f"\n{text}", "STN\nA B\nA 3 B\n", "<graphml><graph><node id='A'/></graph></graphml>"):
        if "graphml" in given:
            with pytest.raises(InputError, match=r"^<network>:1:10: found no edges, expected at least one"):
                stnu.load(given)
        else:
            assert stnu.check(given).is_controllable
    Path("{a}").write_text(text, encoding="utf-8")
    assert stnu.load("{a}").name == "{a}"
    for wrong, says in (("no.json", "no.json: found no such file"), (3, "expected a network, a path or a text")):
        with pytest.raises(InputError, match=says):
            stnu.check(wrong)


def test_what_is_said_without_bounding_anything():
    """Infinite values, and requirements of a time point with itself that hold anyway."""
    for infinite in ("∞", "+∞", "inf", "INFINITY"):
        unbounded = parse_graphml(TOOL.replace('"Value">12<', f'"Value">{infinite}<'), "n.stnu")
        assert unbounded.links == LINKS[:2]
    itself = TOOL.replace("</graph>", '<edge source="D" target="D"><data key="Value">0</data></edge></graph>')
    assert parse_graphml(itself, "n.stnu").links == LINKS
    before_itself = parse_graphml(itself.replace('"Value">0<', '"Value">-1<'), "n.stnu")
    assert stnu.check(before_itself).reason == "contradiction: D -> D in [-inf, -1]"
    found = parse_network_json(document(constraint(1, 2), constraint(3, 3)), "n.json")
    assert (len(found.nodes), len(found.links)) == (3, 1)


def test_names_that_graphml_cannot_hold():
    odd = network(("a\x01", "b", 0, 5))
    assert parse_network_json(network_json(odd), "n.json").links == odd.links
    with pytest.raises(UnsupportedError, match=r"found node 'a\\x01', expected a name that XML can hold"):
        graphml(odd)


def constraint(first, second, kind="stc", low="0", high="5"):
    ends = f'"first_node": {first}, "second_node": {second}'
    return f'{{{ends}, "type": "{kind}", "min_duration": {low}, "max_duration": {high}}}'


def document(*constraints):
    lines = ",\n".join(constraints)
    return f'{{"nodes": [{{"node_id": 1}}, {{"node_id": 2}}, {{"node_id": 3}}], "constraints": [\n{lines}]}}'


WRONG_JSON = {
    "broken": ('{"nodes": [', "^n.json:1:12: found the end of the file"),
    "no object": ("[]", "^n.json:1:1: found an empty list, expected an object"),
    "two spellings": ('{"nodes": [], "edges": [], "links": []}', "^n.json:1:1: found both 'edges' and 'links'"),
    "no constraints key": ('{"nodes": []}', "^n.json:1:1: found no 'constraints'"),
    "no constraints": (document(), "found no constraints, expected at least one"),
    "missing value": (document('{"first_node": 1, "second_node": 2, "type": "stc"}'), "^n.json:2:1: found no 'min_dur"),
    "unknown type": (document(constraint(1, 2, "stp")), "^n.json:2:45: found type 'stp', expected stc, stcu or pstc$"),
    "unknown node": (document(constraint(1, 4)), "^n.json:2:34: found unknown node '4', expected one of the nodes$"),
    "no bound": (document(constraint(1, 2, low="[]")), "found an empty list, expected a number.*, or -inf$"),
    "wrong infinity": (document(constraint(1, 2, low='"inf"')), "found 'inf', expected a number.*, or -inf$"),
    "empty": (document(constraint(1, 2, "stcu", "6")), r"^n.json:2:1: found 1 => 2 in \[6, 5\], expected a lower"),
    "two contingent links with one end": (
        document(constraint(1, 2, "stcu"), constraint(3, 2, "stcu")),
        "^n.json:3:1: found contingent link 3 => 2, expected 2 to end 1 => 2 only$",
    ),
    "contingent circle": (
        document(constraint(1, 2, "stcu"), constraint(2, 3, "stcu"), constraint(3, 1, "stcu")),
        "^n.json:2:1: found contingent links in a circle",
    ),
    "contingent without least length": (document(constraint(1, 2, "stcu", '"-inf"')), "expected a finite lower bound$"),
    "link to itself": (document(constraint(1, 1, "stcu")), "^n.json:2:1: found contingent link 1 => 1, expected two"),
    "second node": ('{"nodes": [{"node_id": 1}, {"node_id": 1}], "constraints": []}', "found a second node '1'"),
    "no name": ('{"nodes": [{"node_id": null}], "constraints": []}', "found null, expected the name or number"),
}


@pytest.mark.parametrize(("text", "says"), WRONG_JSON.values(), ids=WRONG_JSON)
def test_wrong_json(text, says):
    with pytest.raises(RobustError, match=says) as caught:
        parse_network_json(text, "n.json")
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
