"""`.cctp` files: controllable conditional temporal problems in XML (Yu, Fang and Williams, 2014).

Events have an `ID` and a `NAME`. A constraint has `START` and `END`, `LOWERBOUND` and `UPPERBOUND`, and a `TYPE`:
controllable ones are requirements, uncontrollable ones are contingent, with `MEAN` and `VARIANCE` if their lengths are
random. A `GUARD` names values of decision variables, with which alone a constraint holds. The executive decides these,
unless they are said to be uncontrollable. What relaxing bounds costs, and what values are worth, is passed over.

Names of elements may be in any case, with `-` and `_` or without, and attributes stand for elements of these names.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import parse_number, plural, shorten
from robust.stnu.graphml import INFINITE, Element
from robust.stnu.network import ChoicePoint, ConditionalNetwork, Label, Link, Network, normal, note_unused

_EVENTS = ("event", "timepoint", "node")
_CONSTRAINTS = ("constraint", "temporalconstraint", "episode", "activity", "link")
_VARIABLES = ("decisionvariable", "variable", "choice", "observationvariable")
_SOURCE = ("start", "from", "source", "startevent", "fromevent", "startid")
_TARGET = ("end", "to", "target", "endevent", "toevent", "endid")
_LOWER = ("lowerbound", "lower", "lb", "min")
_UPPER = ("upperbound", "upper", "ub", "max")
_NAMES = ("id", "name")
_VALUES = ("valuename", "value", "assignment", "domainvalue")
_AT = ("decisionevent", "atevent", "observationevent", "at", "event")
_GUARD_VARIABLE = ("guardvariable", "variable", "decisionvariable", "variablename", "guardvariablename", "choice")
_GUARD_VALUE = ("guardvalue", "value", "valuename", "guardvaluename")
_GUARDS = ("guard", "guards", "condition")
_PASSED_OVER = ("utility", "cost", "relaxable", "reward", "description", "weight", "desired")
"""Elements with one of these in their names say nothing about what is possible."""


def _plain(name: str) -> str:
    return re.sub("[-_ ]", "", name).lower()


def _texts(element: Element, names: Sequence[str]) -> Iterator[tuple[str, Location]]:
    """The texts of attributes and elements of these names within an element, those of the first name first."""
    for name in names:
        for key, value in element.attributes.items():
            if _plain(key) == name:
                yield value.strip(), element.place
        for child in element.within():
            if child is not element and _plain(child.tag) == name and child.text:
                yield child.text, child.place


def _text(element: Element, names: Sequence[str], default: str = "") -> tuple[str, Location]:
    return next(_texts(element, names), (default, element.place))


def read_cctp(top: Element, file: str) -> Network | ConditionalNetwork:
    """The network of the outermost element of a `.cctp` text.

    Raises:
        InputError: at the place of whatever is wrong.
    """
    parts = [(_plain(child.tag), child) for child in _parts(top)]
    aliases, nodes = dict[str, str](), dict[str, None]()
    for kind, element in parts:
        if kind in _EVENTS:
            names = [text for text, _ in _texts(element, _NAMES)] or [element.text]
            if not names[0] or names[0] in nodes:
                wrong = f"a second event {shorten(names[0])}" if names[0] else "an event without a name"
                raise InputError(f"found {wrong}, expected each to have an ID of its own", element.place)
            nodes[names[0]] = None
            aliases |= {name: names[0] for name in reversed(names) if name == names[0] or name not in aliases}
    constraints = [element for kind, element in parts if kind in _CONSTRAINTS]
    if not constraints:
        raise InputError("found no constraints, expected a network as GraphML, CCTP or JSON", top.place)
    start = next((aliases[text] for text, _ in _top_texts(top, _SOURCE) if text in aliases), None)
    variables = [element for kind, element in parts if kind in _VARIABLES]
    choices = tuple(_choice(element, aliases, start or next(iter(nodes), "")) for element in variables)
    known = {name: choice for element, choice in zip(variables, choices, strict=True) for name in _named(element)}
    links = [(_link(element, aliases), _guard(element, known)) for element in constraints]
    unused = {shorten(element.tag): None for kind, element in parts if not _is_known(kind)}
    note_unused(file, unused)
    if not choices:
        return Network(file, tuple(nodes), tuple(link for link, _ in links), start)
    return ConditionalNetwork(file, dict.fromkeys(nodes, frozenset()), tuple(links), choices, start)


def _is_known(kind: str) -> bool:
    known = (*_EVENTS, *_CONSTRAINTS, *_VARIABLES, *_NAMES, *_SOURCE, *_TARGET)
    return kind in known or any(word in kind for word in _PASSED_OVER)


def _parts(top: Element) -> Iterator[Element]:
    """Events, constraints and variables, in whatever lists they are."""
    for child in top.children:
        kind = _plain(child.tag)
        is_list = kind.removesuffix("s") in {*_EVENTS, *_CONSTRAINTS, *_VARIABLES} and kind.endswith("s")
        yield from _parts(child) if is_list or kind == "cctp" else (child,)


def _top_texts(top: Element, names: Sequence[str]) -> Iterator[tuple[str, Location]]:
    return ((child.text, child.place) for child in top.children if _plain(child.tag) in names)


def _named(element: Element) -> list[str]:
    """What a decision variable is called: its own ID and NAME, not those of its values."""
    own = Element(element.tag, element.attributes, element.place, [e for e in element.children if not e.children])
    return [text for text, _ in _texts(own, ("name", "id"))]


def _choice(element: Element, aliases: dict[str, str], start: str) -> ChoicePoint:
    names = _named(element)
    if not names:
        raise InputError("found a decision variable without a name, expected one", element.place)
    values = []
    for child in element.within():
        if _plain(child.tag) in _VALUES:
            text = child.text or _text(child, ("valuename", "name", "id"))[0]
            if text and text not in values:
                values.append(text)
    if not values:
        raise InputError(f"found no values of {shorten(names[0])}, expected at least one", element.place)
    at, place = _text(element, _AT, start)
    if at not in aliases:
        raise InputError(f"found unknown event {shorten(at)}{did_you_mean(at, aliases)}", place)
    kind, _ = _text(element, ("type",))
    nature = _plain(element.tag).startswith("observation") or "uncontrollable" in kind.lower()
    return ChoicePoint(names[0], tuple(values), aliases[at], not nature)


def _guard(element: Element, known: dict[str, ChoicePoint]) -> Label:
    """The values of decision variables under which a constraint holds."""
    literals = dict[str, str]()
    for guard in (each for each in element.within() if _plain(each.tag) in _GUARDS):
        pairs = re.findall(r"([^\s=&∧,;()]+)\s*==?\s*([^\s=&∧,;()]+)", guard.text)
        variables = [text for text, _ in _some(guard, _GUARD_VARIABLE)]
        values = [text for text, _ in _some(guard, _GUARD_VALUE)]
        if len(variables) != len(values) or not (pairs or variables or not (guard.text or guard.children)):
            found = f"found {plural(len(variables), 'variable')} and {plural(len(values), 'value')} in a guard"
            raise InputError(f"{found}, expected a value for each variable", guard.place)
        for variable, value in (*pairs, *zip(variables, values, strict=True)):
            if variable not in known:
                hint = did_you_mean(variable, known)
                raise InputError(
                    f"found unknown variable {shorten(variable)}, expected a declared one{hint}", guard.place
                )
            choice = known[variable]
            if value not in choice.values:
                hint = did_you_mean(value, choice.values)
                message = f"found {choice.name} = {shorten(value)}, expected one of its values{hint}"
                raise InputError(message, guard.place)
            if literals.setdefault(choice.name, value) != value:
                message = f"found {choice.name} = {literals[choice.name]} and {value}, expected one value"
                raise InputError(message, guard.place)
    return frozenset(literals.items())


def _some(element: Element, names: Collection[str]) -> list[tuple[str, Location]]:
    """Texts of the elements and attributes with these names, in the order of the file."""
    found = [(value, element.place) for key, value in element.attributes.items() if _plain(key) in names]
    for child in element.children:
        if _plain(child.tag) in names and child.text:
            found.append((child.text, child.place))
        else:
            found += _some(child, names)
    return found


def _link(element: Element, aliases: dict[str, str]) -> Link:
    ends = []
    for names, which in ((_SOURCE, "START"), (_TARGET, "END")):
        text, place = _text(element, names)
        if text not in aliases:
            wrong = f"unknown event {shorten(text)}" if text else f"no {which}"
            raise InputError(f"found {wrong}, expected one of the events{did_you_mean(text, aliases)}", place)
        ends.append(aliases[text])
    kind, place = _text(element, ("type",), "controllable")
    is_contingent = any(word in kind.lower() for word in ("uncontrollable", "contingent", "probabilistic"))
    lower, upper = _bound(element, _LOWER, -1), _bound(element, _UPPER, 1)
    distribution = None
    if is_contingent and "probabilistic" in kind.lower():
        mean, variance = (_text(element, names) for names in (("mean",), ("variance", "var")))
        if not mean[0] or not variance[0]:
            raise InputError(f"found type {shorten(kind)} without MEAN and VARIANCE, expected both", place)
        if (spread := parse_number(*variance)) < 0:
            raise InputError(f"found variance {spread}, expected at least 0", variance[1])
        deviation = Fraction(str(float(spread) ** 0.5)).limit_denominator(10**9)
        distribution = normal(parse_number(*mean), deviation)
        lower = Fraction(0) if lower is None else lower
    return Link(ends[0], ends[1], lower, upper, is_contingent, element.place, distribution)


def _bound(element: Element, names: Sequence[str], sign: int) -> Fraction | None:
    text, place = _text(element, names)
    return None if not text or INFINITE.get(text.lower()) == sign else parse_number(text, place)
