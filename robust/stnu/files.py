"""Files of networks: GraphML as the CSTNU tool writes and reads (`.stnu`), and JSON of nodes and constraints.

GraphML: nodes by `id`; an edge from A to B with `Value` w says `B − A ≤ w`. The contingent link from A to C of length
[x, y] is a pair of edges of `Type` contingent, A → C with `LabeledValue` LC(C):x and C → A with UC(C):−y; an older form
without labels has `Value` y and −x, and one of networks with observations labeled values, whose labels are empty here.
Node `Z` is the origin. Edges that the tool derived are not read: they follow from the others. The tool reads whole
numbers only, so other numbers are written in a smaller unit.

JSON: `nodes` with `node_id`, and `constraints` with `first_node`, `second_node`, `min_duration`, `max_duration` and
`type`, `stc` for a requirement, `stcu` for a contingent link. Node 0 is the origin.
"""

import json
import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import lcm
from pathlib import Path
from typing import Any, TypeAlias
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from robust.errors import InputError, Location, UnsupportedError, did_you_mean
from robust.json_text import Array, Json, JsonText, Numeral, Object, describe, parse_json
from robust.numbers import EXPECTED_NUMBER, Number, exact, format_number, is_number, parse_number, plural, shorten
from robust.plan.pddl.forms import read_text
from robust.smt.limits import Deadline
from robust.stnu.network import Link, Network

_NO_BOUND = ("inf", "infinity", "∞")
INFINITE = {sign + text: -1 if sign == "-" else 1 for text in _NO_BOUND for sign in ("", "+", "-")}


def load(path: str | os.PathLike[str]) -> Network:
    """The network in a file, GraphML or JSON by its content.

    Raises:
        InputError: at the place of whatever is wrong.
        UnsupportedError: for a network with choices or observations.
    """
    text, file = read_text(path), os.fspath(path)
    begin = text.lstrip()[:1]
    if begin not in {"<", "{"}:
        start = shorten(text.split("\n", 1)[0]) if begin else "an empty file"
        raise InputError(f"found {start}, expected a network as GraphML (.stnu) or JSON", Location(file, 1))
    return parse_graphml(text, file) if begin == "<" else parse_network_json(text, file)


Source: TypeAlias = Network | str | os.PathLike[str]
"""A network, or the path of one."""


def network_of(source: Source) -> Network:
    """A network itself, or the network in a file; errors as of :func:`load`."""
    if isinstance(source, Network):
        return source
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"found {shorten(repr(source))}, expected a network or a path", Location("network"))
    return load(source)


def deadline(timeout: Number | None) -> Deadline:
    """The end of seconds from now; InputError unless they are a number of at least 0."""
    if timeout is None:
        return Deadline.after(None)
    seconds = exact(timeout, Location("timeout"))
    if seconds < 0:
        raise InputError(f"found {shorten(str(timeout))}, expected a number of at least 0", Location("timeout"))
    return Deadline.after(float(seconds))


def write(network: Network, path: str | os.PathLike[str]) -> tuple[str, int]:
    """The text of a network in the format of a suffix, and the factor of its times, which is 1 but in GraphML.

    Raises:
        InputError: for a suffix that is neither `.json` nor that of GraphML.
    """
    match Path(path).suffix.lower():
        case ".json":
            return network_json(network), 1
        case ".stnu" | ".graphml" | ".xml":
            return graphml(network)
    raise InputError(f"found {shorten(str(path))}, expected a name that ends in .stnu or .json")


# -- JSON --------------------------------------------------------------------------------------------------------------

_CONSTRAINT = ("first_node", "second_node", "type", "min_duration", "max_duration")
_TYPES = {"stc": False, "stcu": True}


def parse_network_json(text: str, file: str) -> Network:
    """The network that a JSON text describes; `file` is its name in messages."""
    top = _fields(parse_json(text, file), ("nodes", "constraints"))
    known: dict[str, None] = {}
    for item in _items(top["nodes"]):
        value = _fields(item, ("node_id",))["node_id"]
        name = _node(value)
        if name in known:
            raise InputError(f"found a second node {shorten(name)}, expected one", value.location)
        known[name] = None
    links = [_constraint(item, known) for item in _items(top["constraints"])]
    if not links:
        raise InputError("found no constraints, expected at least one", top["constraints"].location)
    telling = tuple(link for link in links if not _says_nothing(link))
    return Network(file, tuple(known), telling, "0" if "0" in known else None)


def _says_nothing(link: Link) -> bool:
    """Is this the requirement that a time point is not before and not after itself?"""
    above, below = link.lower is not None and link.lower > 0, link.upper is not None and link.upper < 0
    return link.source == link.target and not (link.is_contingent or above or below)


def _constraint(value: Json, known: Collection[str]) -> Link:
    fields = _fields(value, _CONSTRAINT)
    ends = []
    for key in ("first_node", "second_node"):
        ends.append(_node(fields[key]))
        if ends[-1] not in known:
            raise InputError(f"found unknown node {shorten(ends[-1])}, expected one of the nodes", fields[key].location)
    kind = fields["type"]
    if not isinstance(kind, JsonText) or kind.value not in _TYPES:
        raise InputError(f"found type {describe(kind)}, expected stc or stcu", kind.location)
    lower, upper = _bound(fields["min_duration"], -1), _bound(fields["max_duration"], 1)
    return Link(ends[0], ends[1], lower, upper, _TYPES[kind.value], value.location)


def _bound(value: Json, sign: int) -> Fraction | None:
    """A number, or None for infinity on the side of that sign."""
    text = value.text if isinstance(value, Numeral) else value.value if isinstance(value, JsonText) else ""
    if INFINITE.get(text.lower()) == sign:
        return None
    if not is_number(text):
        infinite = "inf" if sign > 0 else "-inf"
        raise InputError(f"found {describe(value)}, expected {EXPECTED_NUMBER}, or {infinite}", value.location)
    return parse_number(text, value.location)


def _node(value: Json) -> str:
    match value:
        case JsonText(text) if text:
            return text
        case Numeral(text):
            return text
    raise InputError(f"found {describe(value)}, expected the name or number of a node", value.location)


def _items(value: Json) -> Sequence[Json]:
    if not isinstance(value, Array):
        raise InputError(f"found {describe(value)}, expected a list", value.location)
    return value.items


def _fields(value: Json, names: Sequence[str]) -> Mapping[str, Json]:
    """The members of an object, which are these."""
    if not isinstance(value, Object):
        raise InputError(f"found {describe(value)}, expected an object", value.location)
    for key in value.keys:
        if key.value not in names:
            message = f"found unknown key {shorten(key.value)}, expected {', '.join(names)}"
            raise InputError(message, key.location)
    for name in names:
        if name not in value.members:
            raise InputError(f"found no {name!r}, expected {', '.join(names)}", value.location)
    return value.members


def network_json(network: Network) -> str:
    """A network as JSON, with node 0 as its origin; a number that is no finite decimal is a text such as "1/3".

    Raises:
        UnsupportedError: for a node 0 that is not the origin.
    """
    network = _with_origin(network, "0")

    def name(node: str) -> Any:
        return int(node) if re.fullmatch("0|-?[1-9][0-9]{0,17}", node) else node

    def bound(value: Fraction | None, infinite: str) -> str:
        text = infinite if value is None else format_number(value)
        return text if value is not None and "/" not in text else json.dumps(text)

    nodes = [json.dumps({"node_id": name(node)}) for node in network.nodes]
    constraints = [
        f'{{"first_node": {json.dumps(name(link.source))}, "second_node": {json.dumps(name(link.target))}, '
        f'"type": "{"stcu" if link.is_contingent else "stc"}", "min_duration": {bound(link.lower, "-inf")}, '
        f'"max_duration": {bound(link.upper, "inf")}}}'
        for link in network.links
    ]
    lines = ['{"nodes": [', *_listed(nodes), '], "constraints": [', *_listed(constraints), "]}"]
    return "\n".join([*lines, ""])


def _listed(items: Sequence[str]) -> list[str]:
    return [f"  {item}{',' if number < len(items) else ''}" for number, item in enumerate(items, start=1)]


def _with_origin(network: Network, name: str) -> Network:
    """A network whose origin has the name that a format gives it."""
    if network.origin == name:
        return network
    if name in network.nodes:
        raise UnsupportedError(f"found node {name!r} that is not the origin, expected another name in this format")
    if network.origin is None:
        return network
    new = {node: name if node == network.origin else node for node in network.nodes}
    links = tuple(replace(link, source=new[link.source], target=new[link.target]) for link in network.links)
    layout = {new[node]: at for node, at in network.layout.items()}
    return Network(network.name, tuple(new.values()), links, name, layout)


# -- GraphML: reading --------------------------------------------------------------------------------------------------

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
_ENTRY = re.compile(r"\((.*?)\)\s*(?=\(|$)", re.DOTALL)
_EMPTY_LABELS = ("", "⊡")


@dataclass(slots=True)
class _Element:
    """A node, an edge or the graph: its attributes, its data by key, and where it begins."""

    kind: str
    attributes: Mapping[str, str]
    place: Location
    data: dict[str, tuple[str, Location]] = field(default_factory=dict)

    def text(self, key: str) -> str:
        return self.data[key][0] if key in self.data else ""


class _Reader:
    """Collects nodes, edges and their data with the places of all of them."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.nodes: list[_Element] = []
        self.edges: list[_Element] = []
        self.graph: _Element | None = None
        self._names: dict[tuple[str, str], str] = {}
        self._open: list[_Element] = []
        self._key: str | None = None
        self._text: list[str] = []
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text.append
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self, text: str) -> None:
        try:
            self._parser.Parse(text, True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            place = Location(self.file, error.lineno, error.offset + 1)
            raise InputError(f"found broken XML ({reason}), expected GraphML", place) from None
        if self.graph is None:
            raise InputError("found no graph, expected GraphML with one", Location(self.file))

    def _place(self) -> Location:
        return Location(self.file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _doctype(self, *_: object) -> None:
        raise InputError("found a document type, expected GraphML without one", self._place())

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if tag in _KEYS:
            if tag == "graph" and self.graph is not None:
                raise InputError("found a second graph, expected one", self._place())
            if attributes.get("edgedefault") == "undirected" or attributes.get("directed") == "false":
                raise InputError(f"found {_AN[tag]} that is not directed, expected directed edges", self._place())
            self._open.append(_Element(tag, attributes, self._place()))
            if tag == "graph":
                self.graph = self._open[-1]
        elif tag == "hyperedge":
            raise InputError("found a hyperedge, expected edges between two nodes", self._place())
        elif tag == "key":
            self._declare(attributes)
        elif tag == "data" and self._open:
            kind, key = self._open[-1].kind, attributes.get("key", "")
            self._key = self._names.get((kind, key), key)
            if self._key not in _KEYS[kind]:
                wrong = f"found unknown key {shorten(self._key)} of {_AN[kind]}"
                raise InputError(f"{wrong}, expected one of {', '.join(_KEYS[kind])}", self._place())
        self._text.clear()

    def _declare(self, attributes: Mapping[str, str]) -> None:
        """A key that has another name than its identifier, as most writers of GraphML give it."""
        key, name = attributes.get("id"), attributes.get("attr.name")
        if key is not None and name is not None:
            owner = attributes.get("for", "all")
            for kind in _KEYS if owner == "all" else (owner,):
                self._names[kind, key] = name

    def _end(self, tag: str) -> None:
        tag = tag.rpartition(":")[2]
        if tag == "data" and self._open and self._key is not None:
            if self._key in self._open[-1].data:
                raise InputError(f"found a second {self._key}, expected one", self._place())
            self._open[-1].data[self._key] = "".join(self._text).strip(), self._place()
        elif tag in _KEYS:
            done = self._open.pop()
            if tag != "graph":
                (self.nodes if tag == "node" else self.edges).append(done)


def parse_graphml(text: str, file: str) -> Network:
    """The network that a GraphML text describes; `file` is its name in messages."""
    reader = _Reader(file)
    reader.read(text)
    for node in reader.nodes:
        for key in ("Obs", "Label"):
            if node.text(key) not in _EMPTY_LABELS:
                raise _observes(key, node.text(key), node.data[key][1])
    for edge in reader.edges:
        _without_labels(edge)
    layout, nodes = {}, dict[str, None]()
    for node in reader.nodes:
        name = node.attributes.get("id", "")
        if not name or name in nodes:
            wrong = f"a second node {shorten(name)}" if name else "a node without id"
            raise InputError(f"found {wrong}, expected each to have an id of its own", node.place)
        nodes[name] = None
        if "x" in node.data and "y" in node.data:
            layout[name] = node.text("x"), node.text("y")
    if not reader.edges:
        raise InputError("found no edges, expected at least one", Location(file))
    links = _links(reader.edges, nodes)
    return Network(file, tuple(nodes), links, "Z" if "Z" in nodes else None, layout)


def _observes(key: str, text: str, place: Location) -> UnsupportedError:
    return UnsupportedError(f"found {key} {shorten(text)}: a network with observations, expected an STNU", place)


def _without_labels(edge: _Element) -> None:
    """Labeled values as the plain ones that they are where all labels are empty: `{(5, ⊡)}`, `{(C, -9, ⊡)}`."""
    for key, case in _LABELED.items():
        if key not in edge.data:
            continue
        text, place = edge.data[key]
        inner = text.removeprefix("{").removesuffix("}").strip()
        entries = _ENTRY.findall(inner)
        if _ENTRY.sub("", inner) or len(entries) > 1:
            raise _observes(key, text, place)
        for entry in entries:
            parts = [part.strip() for part in entry.split(",")]
            labels = [part for part in parts if part in _EMPTY_LABELS]
            rest = [part for part in parts if part not in _EMPTY_LABELS]
            if len(labels) != 1 or len(rest) != (2 if case else 1):
                raise _observes(key, text, place)
            plain, value = ("LabeledValue", f"{case}({rest[0]}):{rest[1]}") if case else ("Value", rest[0])
            if edge.data.setdefault(plain, (value, place))[0] != value:
                raise InputError(f"found {key} and a different {plain}, expected one of them", place)


def _links(edges: Sequence[_Element], nodes: Collection[str]) -> tuple[Link, ...]:
    """Requirements, two edges between the same time points as one link, and contingent links of two edges each."""
    most: dict[tuple[str, str], tuple[Fraction, Location]] = {}
    contingent: dict[tuple[str, str], _Element] = {}
    for edge in edges:
        ends = _ends(edge, nodes)
        kind = edge.text("Type") or ("contingent" if edge.text("LabeledValue") else "requirement")
        if kind not in _EDGE_TYPES:
            place = edge.data["Type"][1]
            raise InputError(f"found type {shorten(kind)}{did_you_mean(kind, _EDGE_TYPES)}", place)
        if kind == "contingent":
            if ends in contingent:
                message = f"found a second contingent edge from {ends[0]} to {ends[1]}, expected one"
                raise InputError(message, edge.place)
            contingent[ends] = edge
        elif kind in _REQUIREMENTS:
            if edge.text("LabeledValue"):
                place = edge.data["LabeledValue"][1]
                raise InputError(f"found a LabeledValue of a {kind} edge, expected it of contingent edges", place)
            if not edge.text("Value"):
                raise InputError("found no Value, expected a number", edge.place)
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
        if value < 0 or (back is not None and back[0] > value):
            upper = None if back is None else back[0]
            links.append(Link(target, source, -value, upper, place=place))
        else:
            links.append(Link(source, target, None if back is None else -back[0], value, place=place))
    return links


def _ends(edge: _Element, nodes: Collection[str]) -> tuple[str, str]:
    ends = []
    for name in ("source", "target"):
        node = edge.attributes.get(name)
        if node is None:
            raise InputError(f"found an edge without {name}, expected one", edge.place)
        if node not in nodes:
            raise InputError(f"found unknown node {shorten(node)}, expected one of the nodes", edge.place)
        ends.append(node)
    return ends[0], ends[1]


def _value(edge: _Element) -> Fraction | None:
    """The number of an edge; None if there is none, or infinity, which bounds nothing."""
    text = edge.text("Value")
    if not text or INFINITE.get(text.lower()) == 1:
        return None
    return parse_number(text, edge.data["Value"][1])


def _contingent(ends: tuple[str, str], edge: _Element, back: _Element) -> Link:
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


# -- GraphML: writing --------------------------------------------------------------------------------------------------

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
    network = _with_origin(network, "Z")
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
