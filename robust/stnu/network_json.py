"""JSON of nodes and constraints: as HEATlab's networks with uncertainty are kept, and those of pstnlib.

HEATlab: `nodes` with `node_id`, and `constraints` with `first_node`, `second_node`, `min_duration`, `max_duration` and
`type`: `stc` for a requirement, `stcu` for a contingent link, `pstc` for one of random length, which has a
`distribution` such as `{"name": "N_30_5"}`, a normal one by mean and deviation, or `U_20_40`, a uniform one. Node 0 is
the origin, whether it is listed or not; `min_domain` and `max_domain` of a node are bounds from it.

pstnlib: `time_points` with `id`, and `constraints` with `source`, `sink`, `type` and `duration_bound`, `lb` and `ub`,
or `distribution`, `mean` and `sd`.

Keys of the two may be mixed, and there are other spellings of them. A random length without an interval may be all that
its distribution allows, from 0 on; :func:`with_quantile` has narrower ones.
"""

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from robust.errors import InputError
from robust.json_text import Array, Constant, Json, JsonText, Numeral, Object, as_object, describe, parse_json
from robust.numbers import EXPECTED_NUMBER, format_number, is_number, parse_number, shorten
from robust.probability.distributions import Below, Distribution, require_possible
from robust.stnu.graphml import INFINITE
from robust.stnu.network import Link, Network, normal, note_unused, with_origin

ORIGIN = "0"
_LISTS = {"nodes": ("nodes", "time_points", "timepoints", "vertices"), "constraints": ("constraints", "edges", "links")}
_NODE = {"id": ("node_id", "id", "name", "label")}
_DOMAIN = {"min": ("min_domain",), "max": ("max_domain",)}
_CONSTRAINT = {
    "source": ("first_node", "source", "from", "start"),
    "target": ("second_node", "sink", "target", "to", "end"),
    "type": ("type",),
    "lower": ("min_duration", "lb", "lower", "lower_bound", "min"),
    "upper": ("max_duration", "ub", "upper", "upper_bound", "max"),
    "distribution": ("distribution", "dist", "probability_distribution"),
}
_NESTED = ("duration_bound", "intervals", "interval", "bounds", "bound", "duration")
"""Objects, or pairs, which may hold the bounds of a constraint."""
_MEANINGLESS = ("name", "label", "owner_id", "local_id", "num_agents", "controllable", "executed", "description")
"""Keys that say nothing about times."""
_KINDS = {
    **dict.fromkeys(("stc", "requirement", "req", "constraint"), "requirement"),
    **dict.fromkeys(("stcu", "contingent", "ctg"), "contingent"),
    **dict.fromkeys(("pstc", "probabilistic"), "random"),
}
_NUMBERS = {
    "mean": ("mean", "mu", "average", "loc"),
    "deviation": ("sd", "std", "std_dev", "stddev", "stdev", "sigma", "deviation", "standard_deviation", "scale"),
    "variance": ("variance", "var"),
    "lower": ("lower", "lb", "min", "low", "a"),
    "upper": ("upper", "ub", "max", "high", "b"),
}
_FORMS = {"normal": ("n", "norm", "normal", "gaussian", "gauss"), "uniform": ("u", "uniform")}


def parse_network_json(text: str, file: str) -> Network:
    """The network that a JSON text describes; `file` is its name in messages.

    Raises:
        InputError: at the place of whatever is wrong.
    """
    return _Reader(file).network(as_object(parse_json(text, file, infinite=True)))


class _Reader:
    """Collects nodes, constraints, and keys that have no meaning here."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._unused: dict[str, None] = {}
        self._nodes: dict[str, None] = {}

    def network(self, top: Object) -> Network:
        parts = {name: self._member(top, name, _LISTS) for name in _LISTS}
        for name, value in parts.items():
            if value is None:
                raise InputError(f"found no {name!r}, expected lists {' and '.join(map(repr, _LISTS))}", top.location)
        self._pass_over(top, "the file", *(key for keys in _LISTS.values() for key in keys))
        nodes, constraints = (_list(value) for value in parts.values() if value is not None)
        bounds = [bound for value in nodes for bound in self._node(value)]
        links = [link for value in constraints for link in self._constraint(value)]
        if not (constraints or bounds):
            place = top.location if parts["constraints"] is None else parts["constraints"].location
            raise InputError("found no constraints, expected at least one", place)
        note_unused(self._file, self._unused)
        known = dict.fromkeys(self._nodes)
        if ORIGIN not in known and any(ORIGIN in {link.source, link.target} for link in (*bounds, *links)):
            known = {ORIGIN: None, **known}
        telling = [link for link in (*bounds, *links) if not _says_nothing(link)]
        first = {link: at for at, link in reversed(list(enumerate(telling)))}
        once = tuple(link for at, link in enumerate(telling) if not link.is_contingent or first[link] == at)
        return Network(self._file, tuple(known), once, ORIGIN if ORIGIN in known else None)

    def _node(self, value: Json) -> Iterator[Link]:
        """Make a node known; its domain are bounds from the origin."""
        named = self._member(value, "id", _NODE) if isinstance(value, Object) else value
        if named is None:
            raise InputError("found no 'node_id', expected the name or number of a node", value.location)
        name = _name(named)
        if name in self._nodes:
            raise InputError(f"found a second node {shorten(name)}, expected one", named.location)
        self._nodes[name] = None
        if isinstance(value, Object):
            self._pass_over(value, "nodes", *_NODE["id"], *_DOMAIN["min"], *_DOMAIN["max"])
            ends = [self._member(value, key, _DOMAIN) for key in _DOMAIN]
            lower, upper = (None if end is None else _bound(end, sign) for end, sign in zip(ends, (-1, 1), strict=True))
            if name != ORIGIN and (upper is not None or (lower is not None and lower > 0)):
                yield Link(ORIGIN, name, lower, upper, place=value.location)

    def _constraint(self, value: Json) -> Iterator[Link]:
        fields = as_object(value)
        source, target = (self._end(fields, key) for key in ("source", "target"))
        given = self._member(fields, "distribution", _CONSTRAINT)
        random = None if given is None or isinstance(given, Constant) else given
        kind = self._kind(fields, "random" if random is not None else "requirement")
        ends = dict[str, Fraction | None]()
        for nested in (fields, *self._nested(fields)):
            for key, sign in (("lower", -1), ("upper", 1)):
                if (end := self._member(nested, key, _CONSTRAINT)) is not None:
                    ends[key] = _bound(end, sign)
        own = [key for keys in _CONSTRAINT.values() for key in keys]
        self._pass_over(fields, "constraints", *own, *_NESTED)
        lower, upper = ends.get("lower"), ends.get("upper")
        if len(ends) < 2 and random is None:
            lacking = _CONSTRAINT["upper" if "lower" in ends else "lower"][0]
            raise InputError(f"found no {lacking!r}, expected bounds of the constraint", value.location)
        if kind == "requirement":
            yield Link(source, target, lower, upper, place=value.location)
            return
        distribution = None if random is None else _distribution(random, required=lower is None or upper is None)
        if distribution is not None and kind == "random":
            support = distribution.support
            lower = lower if lower is not None else max(Fraction(0), support[0] or Fraction(0))
            if upper is None:
                lower, upper = max(lower, support[0] or lower), support[1]
        yield Link(source, target, lower, upper, True, value.location, distribution)

    def _end(self, fields: Object, key: str) -> str:
        value = self._member(fields, key, _CONSTRAINT)
        if value is None:
            raise InputError(f"found no {_CONSTRAINT[key][0]!r}, expected two nodes of the constraint", fields.location)
        if isinstance(value, Object):  # a time point as a whole
            value = self._member(value, "id", _NODE) or value
        name = _name(value)
        if name not in self._nodes and name != ORIGIN:
            raise InputError(f"found unknown node {shorten(name)}, expected one of the nodes", value.location)
        return name

    def _kind(self, fields: Object, default: str) -> str:
        value = self._member(fields, "type", _CONSTRAINT)
        if value is None:
            return default
        kind = _KINDS.get(value.value.lower()) if isinstance(value, JsonText) else None
        if kind is None:
            raise InputError(f"found type {describe(value)}, expected stc, stcu or pstc", value.location)
        return kind

    def _nested(self, fields: Object) -> Iterator[Object]:
        for key in _NESTED:
            match fields.members.get(key):
                case Object() as bounds:
                    self._pass_over(bounds, "constraints", *_CONSTRAINT["lower"], *_CONSTRAINT["upper"])
                    yield bounds
                case Array((lower, upper)) as pair:
                    yield Object({"lb": lower, "ub": upper}, (), pair.location)
                case None:
                    pass
                case other:
                    raise InputError(f"found {describe(other)}, expected bounds, lb and ub", other.location)

    def _member(self, value: Object, name: str, spellings: Mapping[str, Sequence[str]]) -> Json | None:
        """The member by any of its spellings; two of them would leave open which counts."""
        found = [key for key in spellings[name] if key in value.members]
        if len(found) > 1 and name != "id":
            raise InputError(f"found both {found[0]!r} and {found[1]!r}, expected one of them", value.location)
        return value.members[found[0]] if found else None

    def _pass_over(self, value: Object, of: str, *known: str) -> None:
        for key in value.members:
            if key not in known and key not in _MEANINGLESS:
                self._unused[f"{shorten(key)} of {of}"] = None


def _says_nothing(link: Link) -> bool:
    """Is this the requirement that a time point is not before and not after itself?"""
    above, below = link.lower is not None and link.lower > 0, link.upper is not None and link.upper < 0
    return link.source == link.target and not (link.is_contingent or above or below)


def _bound(value: Json, sign: int) -> Fraction | None:
    """A number, or None for infinity on the side of that sign."""
    if isinstance(value, Constant) and value.value is None:
        return None
    text = _text(value)
    if INFINITE.get(text.lower()) == sign:
        return None
    if not is_number(text):
        infinite = "inf" if sign > 0 else "-inf"
        raise InputError(f"found {describe(value)}, expected {EXPECTED_NUMBER}, or {infinite}", value.location)
    return parse_number(text, value.location)


def _text(value: Json) -> str:
    return value.text if isinstance(value, Numeral) else value.value.strip() if isinstance(value, JsonText) else ""


def _name(value: Json) -> str:
    text = _text(value)
    if not text:
        raise InputError(f"found {describe(value)}, expected the name or number of a node", value.location)
    return re.sub(r"\.0+$", "", text) if isinstance(value, Numeral) else text


def _list(value: Json) -> Sequence[Json]:
    if not isinstance(value, Array):
        raise InputError(f"found {describe(value)}, expected a list", value.location)
    return value.items


# -- distributions -----------------------------------------------------------------------------------------------------


def _distribution(value: Json, *, required: bool) -> Distribution | None:
    """A distribution, by its name such as `N_30_5`, or by its numbers; None for another one that is not needed."""
    parts = value.members if isinstance(value, Object) else {}
    written = value if not isinstance(value, Object) else parts.get("name") or parts.get("type")
    kind, *texts = ("" if written is None else _text(written)).split("_")
    form = next((name for name, names in _FORMS.items() if kind.lower() in names), None)
    numbers = _numbers(parts)
    if form is not None and len(texts) == 2 and all(map(is_number, texts)):
        keys = ("mean", "deviation") if form == "normal" else ("lower", "upper")
        numbers = dict(zip(keys, (parse_number(text, value.location) for text in texts), strict=True))
    elif form is None and numbers.keys() == {"mean", "deviation"}:
        form = "normal"
    needed = {"normal": {"mean", "deviation"}, "uniform": {"lower", "upper"}}
    if form is None or numbers.keys() != needed[form]:
        if not required:
            return None
        expected = "a normal one (N_MEAN_DEVIATION, or mean and sd) or a uniform one (U_LOWER_UPPER)"
        raise InputError(f"found distribution {describe(written or value)}, expected {expected}", value.location)
    require_possible(form, numbers, value.location)
    return (
        normal(numbers["mean"], numbers["deviation"]) if form == "normal" else Distribution(form, numbers, Below.CLIP)
    )


def _numbers(parts: Mapping[str, Json]) -> dict[str, Fraction]:
    """The numbers of a distribution by their usual names; a variance as the deviation, if that is rational."""
    numbers: dict[str, Fraction] = {}
    for name, spellings in _NUMBERS.items():
        for key in spellings:
            if key in parts and is_number(_text(parts[key])):
                numbers[name] = parse_number(_text(parts[key]), parts[key].location)
    if (variance := numbers.pop("variance", None)) is not None and variance >= 0:
        numbers.setdefault("deviation", Fraction(str(float(variance) ** 0.5)).limit_denominator(10**9))
    return numbers


# -- writing -----------------------------------------------------------------------------------------------------------


def network_json(network: Network) -> str:
    """A network as JSON, with node 0 as its origin; a number that is no finite decimal is a text such as "1/3".

    Raises:
        UnsupportedError: for a node 0 that is not the origin.
    """
    network = with_origin(network, ORIGIN)

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


def _listed(items: Collection[str]) -> list[str]:
    return [f"  {item}{',' if number < len(items) else ''}" for number, item in enumerate(items, start=1)]
