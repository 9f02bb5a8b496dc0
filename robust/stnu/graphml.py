"""Networks as GraphML, as the CSTNU tool writes and reads them: STNs, STNUs, and conditional ones, CSTNs and CSTNUs.

Nodes by `id`; an edge from A to B with `Value` w says `B − A ≤ w`. The contingent link from A to C of length [x, y] is
a pair of edges of `Type` contingent, A → C with `LabeledValue` LC(C):x and C → A with UC(C):−y; an older form without
labels has `Value` y and −x. Node `Z` is the origin. Edges that the tool derived are not read: they follow from the
others. The tool reads whole numbers only, so other numbers are written in a smaller unit.

In conditional networks, `Obs` p of a node is the proposition that is observed there, `Label` says in which scenarios
the node exists, and edges have sets of labeled values, `{(w, p¬q) (v, ⊡)}`, with the node's name as well for the lower
and upper case of a contingent link; ⊡ is the empty label, p¬q that p is true and q false.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm
from pathlib import Path
from typing import TypeAlias
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from robust.errors import InputError, Location, UnsupportedError, did_you_mean
from robust.numbers import is_number, parse_number, plural, shorten
from robust.stnu.network import ChoicePoint, ConditionalNetwork, Label, Link, Network, note_unused, with_origin


@dataclass(slots=True)
class Element:
    """A tag without its namespace, its attributes, what is in it, its text without blanks around, and its place."""

    tag: str
    attributes: Mapping[str, str]
    place: Location
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def within(self) -> Iterator[Element]:
        """The element itself and all that are inside of it, in the order of the file."""
        pending = [self]
        while pending:
            yield (element := pending.pop())
            pending.extend(reversed(element.children))


def parse_markup(text: str, file: str, expected: str) -> Element:
    """The outermost element of an XML text.

    Args:
        file: its name in messages.
        expected: the format, for messages.

    Raises:
        InputError: at the place where it is no XML, or declares a document type, which could define anything.
    """
    parser = expat.ParserCreate()
    open_elements: list[Element] = []
    texts: list[list[str]] = []
    done: list[Element] = []

    def place() -> Location:
        return Location(file, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def doctype(*_: object) -> None:
        raise InputError(f"found a document type, expected {expected} without one", place())

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag.rpartition(":")[2], attributes, place())
        if open_elements:
            open_elements[-1].children.append(element)
        open_elements.append(element)
        texts.append([])

    def end(_: str) -> None:
        done.append(open_elements.pop())
        done[-1].text = "".join(texts.pop()).strip()

    def characters(data: str) -> None:
        texts[-1].append(data)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = characters, doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        where = Location(file, error.lineno, error.offset + 1)
        raise InputError(f"found broken XML ({reason}), expected {expected}", where) from None
    except ValueError as error:  # an encoding that it names and Python lacks
        raise InputError(f"found broken XML ({error}), expected {expected}", Location(file)) from None
    return done[-1]


ORIGIN = "Z"
_GREATEST = ("1.7976931348623157e+308", "1.7976931348623157e308")
"""The greatest float, which stands for infinity where there is none."""
INFINITE = {
    f"{sign}{text}": -1 if sign == "-" else 1
    for text in ("inf", "infinity", "∞", *_GREATEST)
    for sign in ("", "+", "-")
}

# -- reading -----------------------------------------------------------------------------------------------------------

_EDGE_KEYS = ("Type", "Value", "LabeledValue", "LabeledValues", "UpperCaseLabeledValues", "LowerCaseLabeledValues")
_NODE_KEYS = ("x", "y", "Obs", "Label", "Potential", "LabeledPotential")
_GRAPH_KEYS = ("NetworkType", "nEdges", "nVertices", "nContingent", "nObservedProposition", "Name")
_AN = {"node": "a node", "edge": "an edge", "graph": "a graph"}
_KEYS = {"node": _NODE_KEYS, "edge": _EDGE_KEYS, "graph": _GRAPH_KEYS}
_REQUIREMENTS = ("requirement", "normal", "constraint")
_DERIVED = ("derived", "internal", "qloopFinder")
_EDGE_TYPES = (*_REQUIREMENTS, "contingent", *_DERIVED)
_CASE = re.compile(r"(UC|LC)\((.*)\)\s*:(.*)", re.DOTALL)
_LABELED = {"LabeledValues": "", "LowerCaseLabeledValues": "LC", "UpperCaseLabeledValues": "UC"}
_ENTRY = re.compile(r"\(([^()]*)\)[\s,;]*")
_EMPTY_LABELS = ("", "⊡", "□")
_NEGATIONS = "¬!~"
_BOTH_WAYS = "¿"
"""Before a proposition whose value may be either, in values that the tool derived."""


@dataclass(slots=True)
class _Item:
    """A node, an edge or the graph: its attributes, its data by key, and where it begins."""

    kind: str
    attributes: Mapping[str, str]
    place: Location
    data: dict[str, tuple[str, Location]] = field(default_factory=dict)

    def text(self, key: str) -> str:
        return self.data[key][0] if key in self.data else ""


Values: TypeAlias = Mapping[Label, Sequence[_Item]]
"""Edges with single values, by the label of these."""


def _items(top: Element, file: str) -> Iterator[_Item]:
    """The graph, its nodes and its edges, in the order of the file."""
    names, graphs, unused = dict[tuple[str, str], str](), 0, dict[str, None]()
    for element in top.within():
        if element.tag == "hyperedge":
            raise InputError("found a hyperedge, expected edges between two nodes", element.place)
        if element.tag == "key":
            names |= _declared(element)
        if element.tag not in _KEYS:
            continue
        graphs += element.tag == "graph"
        if graphs > 1:
            raise InputError("found a second graph, expected one", element.place)
        if element.attributes.get("edgedefault") == "undirected" or element.attributes.get("directed") == "false":
            raise InputError(f"found {_AN[element.tag]} that is not directed, expected directed edges", element.place)
        item = _Item(element.tag, element.attributes, element.place)
        for data in element.children:
            if data.tag == "data":
                key = data.attributes.get("key", "")
                key = names.get((item.kind, key), key)
                if key not in _KEYS[item.kind]:
                    unused[f"{shorten(key)} of {item.kind}s"] = None
                elif key in item.data:
                    raise InputError(f"found a second {key}, expected one", data.place)
                item.data[key] = data.text, data.place
        yield item
    if not graphs:
        raise InputError("found no graph, expected GraphML with one", top.place)
    note_unused(file, unused)


def _declared(key: Element) -> dict[tuple[str, str], str]:
    """A key that has another name than its identifier, as most writers of GraphML give it."""
    identifier, name = key.attributes.get("id"), key.attributes.get("attr.name")
    if identifier is None or name is None:
        return {}
    owner = key.attributes.get("for", "all")
    return {(kind, identifier): name for kind in (_KEYS if owner == "all" else (owner,))}


def parse_graphml(text: str, file: str) -> Network | ConditionalNetwork:
    """The network that a GraphML text describes; `file` is its name in messages."""
    return read_graphml(parse_markup(text, file, "GraphML"), file)


def read_graphml(top: Element, file: str) -> Network | ConditionalNetwork:
    """The network of the outermost element of a GraphML text; conditional if any label is not empty."""
    items = list(_items(top, file))
    layout, nodes = dict[str, tuple[str, str]](), dict[str, _Item]()
    for node in items:
        if node.kind != "node":
            continue
        name = node.attributes.get("id", "")
        if not name or name in nodes:
            wrong = f"a second node {shorten(name)}" if name else "a node without id"
            raise InputError(f"found {wrong}, expected each to have an id of its own", node.place)
        nodes[name] = node
        if "x" in node.data and "y" in node.data:
            layout[name] = node.text("x"), node.text("y")
    edges = [item for item in items if item.kind == "edge"]
    if not edges:
        raise InputError("found no edges, expected at least one", items[0].place)
    observed = _observed(nodes)
    labels = {name: _label(node.text("Label"), observed, node.data.get("Label")) for name, node in nodes.items()}
    values = _by_label(edges, nodes, observed)
    origin = ORIGIN if ORIGIN in nodes else None
    links = [(link, label or frozenset()) for label, group in values.items() for link in _links(group, nodes)]
    if not (observed or any(labels.values()) or any(values)):
        return Network(file, tuple(nodes), tuple(link for link, _ in links), origin, layout)
    choices = tuple(ChoicePoint(p, ("true", "false"), node) for p, node in observed.items())
    known = {name: label or frozenset() for name, label in labels.items()}
    return ConditionalNetwork(file, known, tuple(links), choices, origin)


def _observed(nodes: Mapping[str, _Item]) -> dict[str, str]:
    """The time point at which each proposition is observed."""
    observed: dict[str, str] = {}
    for name, node in nodes.items():
        if proposition := node.text("Obs"):
            if proposition in observed:
                found = f"found {shorten(proposition)} observed at {observed[proposition]} and at {name}"
                raise InputError(f"{found}, expected one observation", node.data["Obs"][1])
            observed[proposition] = name
    return observed


def _label(text: str, observed: Collection[str], at: tuple[str, Location] | None) -> Label | None:
    """A conjunction of literals, such as `p¬q`; None if it never holds."""
    text = text.strip()
    if text in _EMPTY_LABELS:
        return frozenset()
    place = None if at is None else at[1]
    names = "|".join(re.escape(name) for name in sorted(observed, key=len, reverse=True)) or "(?!)"
    pattern = re.compile(rf"\s*([{_NEGATIONS}{_BOTH_WAYS}]?)\s*({names})[\s∧&]*")
    literals, begin = dict[str, str](), 0
    while begin < len(text):
        match = pattern.match(text, begin)
        if match is None:
            wrong = f"found label {shorten(text)}, expected propositions that are observed"
            raise InputError(wrong + did_you_mean(text[begin:].strip(_NEGATIONS), observed), place)
        sign, name = match.groups()
        value = "false" if sign and sign in _NEGATIONS else "true"
        if sign == _BOTH_WAYS or literals.setdefault(name, value) != value:
            return None
        begin = match.end()
    return frozenset(literals.items())


def _by_label(edges: Sequence[_Item], nodes: Mapping[str, _Item], observed: Collection[str]) -> Values:
    """Edges with one plain value each, by the label under which they hold; what is derived is left out."""
    groups: dict[Label, list[_Item]] = {}
    for edge in edges:
        kind = edge.text("Type") or ("contingent" if edge.text("LabeledValue") else "requirement")
        if kind not in _EDGE_TYPES:
            hint = did_you_mean(kind, _EDGE_TYPES)
            raise InputError(f"found type {shorten(kind)}, expected that of an edge{hint}", edge.data["Type"][1])
        if kind in _DERIVED:
            continue
        plain = {key: edge.data[key] for key in ("Value", "LabeledValue") if edge.text(key)}
        found: dict[Label, list[tuple[str, tuple[str, Location]]]] = {frozenset(): list(plain.items())}
        for key, case in _LABELED.items():
            text, place = edge.data.get(key, ("", edge.place))
            for number, node, written in _entries(text, case, nodes, place, key):
                label = _label(written, observed, (text, place))
                if label is not None:
                    name, value = ("LabeledValue", f"{case}({node}):{number}") if case else ("Value", number)
                    found.setdefault(label, []).append((name, (value, place)))
        if kind != "contingent" and not plain and not any(key in edge.data for key in _LABELED):
            raise InputError("found no Value, expected a number", edge.place)
        for label, data in found.items():
            distinct = {(name, value): (name, (value, place)) for name, (value, place) in data}.values()
            alone = [dict([pair]) for pair in distinct] if kind != "contingent" else [dict(distinct)]
            if kind == "contingent" and len(alone[0]) < len(distinct):
                raise InputError("found two different values of a contingent edge, expected one", edge.place)
            if data or (kind == "contingent" and len(found) == 1):
                groups.setdefault(label, []).extend(_Item(kind, edge.attributes, edge.place, one) for one in alone)
    return groups


def _entries(text: str, case: str, nodes: Collection[str], place: Location, key: str) -> Iterator[tuple[str, str, str]]:
    """Number, node and label of each labeled value: `{(5, ⊡) (3, p¬q)}`, `{(C, -9, ⊡)}`, in any order of versions."""
    inner = text.strip().removeprefix("{").removesuffix("}").strip()
    if _ENTRY.sub("", inner):
        form = "NODE, NUMBER, LABEL" if case else "NUMBER, LABEL"
        raise InputError(f"found {key} {shorten(text)}, expected {{({form}) ...}}", place)
    for entry in _ENTRY.findall(inner):
        parts = [part.strip() for part in entry.split(",")]
        number = next((part for part in parts if is_number(part) or part.lower() in INFINITE), None)
        rest = list(parts)
        if number is not None:
            rest.remove(number)
        node = next((part for part in rest if part in nodes), None) if case else ""
        if case and node is not None:
            rest.remove(node)
        if number is None or node is None or len(rest) != 1:
            form = "NODE, NUMBER, LABEL" if case else "NUMBER, LABEL"
            raise InputError(f"found {key} ({shorten(entry)}), expected ({form})", place)
        yield number, node, rest[0]


def _links(edges: Sequence[_Item], nodes: Collection[str]) -> tuple[Link, ...]:
    """Requirements, two edges between the same time points as one link, and contingent links of two edges each."""
    most: dict[tuple[str, str], tuple[Fraction, Location]] = {}
    contingent: dict[tuple[str, str], _Item] = {}
    for edge in edges:
        ends = _ends(edge, nodes)
        if edge.kind == "contingent":
            if ends in contingent:
                message = f"found a second contingent edge from {ends[0]} to {ends[1]}, expected one"
                raise InputError(message, edge.place)
            contingent[ends] = edge
            continue
        if edge.text("LabeledValue"):
            place = edge.data["LabeledValue"][1]
            raise InputError("found a LabeledValue of a requirement edge, expected it of contingent edges", place)
        value = _value(edge)
        if value is None or (ends[0] == ends[1] and value >= 0):
            continue  # what is not infinitely later, and what is not before itself, is any time point
        if ends not in most or value < most[ends][0]:
            most[ends] = value, edge.place
    links: list[Link] = []
    while contingent:
        ends, edge = next(iter(contingent.items()))
        back = contingent.get((ends[1], ends[0]))
        if back is None:
            missing = f"found no contingent edge from {ends[1]} to {ends[0]}, expected one beside that from {ends[0]}"
            raise InputError(missing, edge.place)
        links.append(_contingent(ends, edge, back))
        del contingent[ends], contingent[ends[1], ends[0]]
    return (*links, *_requirements(most))


def _requirements(most: Mapping[tuple[str, str], tuple[Fraction, Location]]) -> list[Link]:
    """A link for each pair of time points, from the one that comes first in the file or has an upper bound."""
    links, done = [], set()
    for (source, target), (value, place) in most.items():
        if (source, target) in done:
            continue
        back = most.get((target, source))
        done |= {(source, target), (target, source)}
        if source == target:
            links.append(Link(source, target, None, value, place=place))
        elif value < 0 or (back is not None and back[0] > value):
            upper = None if back is None else back[0]
            links.append(Link(target, source, -value, upper, place=place))
        else:
            links.append(Link(source, target, None if back is None else -back[0], value, place=place))
    return links


def _ends(edge: _Item, nodes: Collection[str]) -> tuple[str, str]:
    ends = []
    for name in ("source", "target"):
        node = edge.attributes.get(name)
        if node is None:
            raise InputError(f"found an edge without {name}, expected one", edge.place)
        if node not in nodes:
            raise InputError(f"found unknown node {shorten(node)}, expected one of the nodes", edge.place)
        ends.append(node)
    return ends[0], ends[1]


def _value(edge: _Item) -> Fraction | None:
    """The number of an edge; None if there is none, or infinity, which bounds nothing."""
    text = edge.text("Value")
    if not text or INFINITE.get(text.lower()) == 1:
        return None
    return parse_number(text, edge.data["Value"][1])


def _contingent(ends: tuple[str, str], edge: _Item, back: _Item) -> Link:
    """The contingent link of two edges; labels say where it ends, or else the signs of the values."""
    cases: dict[str, tuple[Fraction, str]] = {}
    for half, (source, target) in ((edge, ends), (back, (ends[1], ends[0]))):
        if not half.text("LabeledValue"):
            continue
        text, place = half.data["LabeledValue"]
        match = _CASE.fullmatch(text)
        if match is None:
            raise InputError(f"found {shorten(text)}, expected LC(NODE):NUMBER or UC(NODE):NUMBER", place)
        case, end, number = match.groups()
        expected = target if case == "LC" else source
        if end != expected:
            raise InputError(f"found {case}({end}), expected {case}({expected}) on this edge", place)
        if case in cases:
            raise InputError(f"found a second {case} value, expected one of each", place)
        cases[case] = parse_number(number.strip(), place), end
    if cases and len(cases) < 2:
        (case,) = cases
        raise InputError(f"found only an {case} value, expected LC and UC on a contingent link", edge.place)
    values = {ends: _value(edge), (ends[1], ends[0]): _value(back)}
    if cases:
        end = cases["LC"][1]
        if cases["UC"][1] != end:
            raise InputError("found LC and UC of different nodes, expected both of the link's end", edge.place)
        source = next(node for node in ends if node != end)
        link = Link(source, end, cases["LC"][0], -cases["UC"][0], True, edge.place)
        given = (values[source, end], link.upper), (values[end, source], -cases["LC"][0])
        if any(value is not None and value != implied for value, implied in given):
            message = f"found a Value that is not that of {link}, expected it left out or the same"
            raise InputError(message, edge.place)
        return link
    forth, returned = values[ends], values[ends[1], ends[0]]
    if forth is None or returned is None:
        raise InputError("found a contingent edge without finite values, expected LC and UC, or Value", edge.place)
    if forth < returned:
        ends, forth, returned = (ends[1], ends[0]), returned, forth
    return Link(ends[0], ends[1], -returned, forth, True, edge.place)


# -- writing -----------------------------------------------------------------------------------------------------------

_NOT_OF_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_HEADER = """\
<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns/graphml" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xsi:schemaLocation="http://graphml.graphdrawing.org/xmlns/graphml">
"""
_DECLARED = (
    ("nContingent", "graph", "Number of contingents in the graph", "0"),
    ("NetworkType", "graph", "Network Type", "STNU"),
    ("nEdges", "graph", "Number of edges in the graph", "0"),
    ("nVertices", "graph", "Number of vertices in the graph", "0"),
    ("Name", "graph", "Graph Name", ""),
    ("x", "node", "The x coordinate for the visualization. A positive value.", "0"),
    ("y", "node", "The y coordinate for the visualization. A positive value.", "0"),
    ("Type", "edge", "Type: Possible values: requirement|contingent|derived|internal.", "requirement"),
    ("Value", "edge", "Value for STN edge. Format: 'integer'", ""),
    ("LabeledValue", "edge", "Case Value. Format: 'LC(NodeName):integer' or 'UC(NodeName):integer'", ""),
)


def graphml(network: Network) -> tuple[str, int]:
    """A network as GraphML in whole numbers, and the factor by which its times are multiplied.

    Raises:
        UnsupportedError: for a contingent link without an upper bound and a name with characters that XML does not
            have, neither of which the format can say, and for a node Z that is not the origin.
    """
    network = with_origin(network, ORIGIN)
    for node in network.nodes:
        if _NOT_OF_XML.search(node):
            raise UnsupportedError(f"found node {shorten(node)}, expected a name that XML can hold, or a .json file")
    for link in network.contingents:
        if link.upper is None:
            raise UnsupportedError(f"contingent link {link} has no upper bound; expected one, or a .json file")
    bounds = [bound for link in network.links for bound in (link.lower, link.upper) if bound is not None]
    scale = lcm(*(bound.denominator for bound in bounds))
    edges = [text for number, link in enumerate(network.links) for text in _edges(link, number, scale)]
    counts = {
        "NetworkType": "STNU",
        "nEdges": len(edges),
        "nVertices": len(network.nodes),
        "nContingent": len(network.contingents),
        "Name": escape(Path(network.name).name),
    }
    lines = [_HEADER.rstrip("\n")]
    for key, owner, text, default in _DECLARED:
        lines.append(f'<key id="{key}" for="{owner}"><desc>{escape(text)}</desc><default>{default}</default></key>')
    lines.append('<graph edgedefault="directed">')
    lines += [f'<data key="{key}">{value}</data>' for key, value in counts.items()]
    for node in network.nodes:
        at = network.layout.get(node, ())
        place = "".join(f'<data key="{axis}">{escape(text)}</data>' for axis, text in zip("xy", at, strict=False))
        lines.append(f"<node id={quoteattr(node)}>{place}</node>")
    return "\n".join([*lines, *edges, "</graph>", "</graphml>", ""]), scale


def _edges(link: Link, number: int, scale: int) -> list[str]:
    """The two edges of a link, or the one that is not infinite."""

    def edge(source: str, target: str, kind: str, key: str, text: str) -> str:
        ends = f"source={quoteattr(source)} target={quoteattr(target)}"
        name = f"e{number}{'' if source == link.source else 'r'}"
        data = f'<data key="Type">{kind}</data><data key="{key}">{escape(text)}</data>'
        return f'<edge id="{name}" {ends}>{data}</edge>'

    source, target = link.source, link.target
    upper = None if link.upper is None else int(link.upper * scale)
    lower = None if link.lower is None else int(link.lower * scale)
    if link.is_contingent and upper is not None:
        return [
            edge(source, target, "contingent", "LabeledValue", f"LC({target}):{lower}"),
            edge(target, source, "contingent", "LabeledValue", f"UC({target}):{-upper}"),
        ]
    edges = [] if upper is None else [edge(source, target, "requirement", "Value", str(upper))]
    return edges if lower is None else [*edges, edge(target, source, "requirement", "Value", str(-lower))]


def scaled(path: Path, scale: int) -> str:
    """A note on a file whose times are multiplied."""
    units = f"times are in units of 1/{scale}: the CSTNU tool reads whole numbers ({plural(scale, 'unit')} for 1)"
    return f"{path}: {units}"
