"""`.tpnu.json` files of plans with choices: reading, checking and writing.

The tables at the end say what each object of the format consists of; files are read and written by them. A published
JSON Schema says the same. Everything that was read keeps its place, so that messages about networks that are not
well-formed [PIKE, Definition 2.1] say where the fault is written.
"""

import json
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeAlias, TypeVar

from robust.errors import InputError, Location, did_you_mean
from robust.json_text import Array, Constant, Json, JsonPath, JsonText, Key, Numeral, Object, describe, parse_json, walk
from robust.network.differences import reachable
from robust.numbers import EXPECTED_NUMBER, format_number, is_number, parse_number, shorten
from robust.pike_bridge import model
from robust.pike_bridge.envelopes.parameters import TeamParameterSpec, of_members
from robust.plan.pddl.forms import read_text
from robust.records import atomic_write


@dataclass(frozen=True, slots=True)
class Places:
    """The location of each value of a document by its path, such as `("events", 3, "guard", "x")`."""

    file: str | None = None
    locations: Mapping[JsonPath, Location] = field(default_factory=lambda: MappingProxyType({}))

    def of(self, *path: Key) -> Location | None:
        """The location of a value, or of the innermost value around it that is written; None without a file."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.locations:
                return self.locations[path[:length]]
        return None


NOWHERE: Final = Places()
"""The name of plans that were built in memory."""


def validate(network: model.Tpnu, places: Places = NOWHERE) -> None:
    """Check a network; `places` says where its parts are written.

    Raises:
        InputError: at the first thing that is wrong.
    """
    checks = _Checks(network, places)
    for check in (checks.names, checks.guards, checks.edges, checks.containment, checks.timeliness):
        check()


@dataclass(frozen=True, slots=True)
class _Guarded:
    """Something with a guard: what it is called, where it is written, and at which event its guard must be decided."""

    name: str
    guard: model.Guard
    path: tuple[Key, ...]
    event: str | None


class _Checks:
    def __init__(self, network: model.Tpnu, places: Places) -> None:
        self._network = network
        self._places = places
        self._choices = {choice.name: choice for choice in network.choices}
        self._guards = network.guards

    # -- names ---------------------------------------------------------------------------------------------------

    def names(self) -> None:
        """Names are unique, all that is mentioned exists, and each choice has values, all different."""
        for kind, plural, parts in (
            ("choice", "choices", self._network.choices),
            ("event", "events", self._network.events),
        ):
            self._unique(kind, plural, [part.name for part in parts])
        for at, choice in enumerate(self._network.choices):
            if choice.event is not None:
                self._event(choice.event, "choices", at, "at")
        for edge, _, kind, at in self._edges():
            self._event(edge.source, kind, at, "from")
            self._event(edge.target, kind, at, "to")
        for at, event in enumerate(self._network.events):
            if event.name in {model.INITIAL, model.GOAL} and event.guard:
                message = f"found guard {{{model.guard_text(event.guard)}}} of {event.name}, expected none"
                raise self._fault(f"{message}: it always happens", "events", at, "guard")
        for at, choice in enumerate(self._network.choices):
            if not choice.domain or len(set(choice.domain)) < len(choice.domain):
                values = ", ".join(choice.domain) or "no values"
                message = f"found {values} for choice {choice.name!r}, expected at least one value and each once"
                raise self._fault(message, "choices", at, "domain")
            if choice.probability:
                self._probabilities(choice, at)

    def _probabilities(self, choice: model.Choice, at: int) -> None:
        """Tables are of choices of people, say something of each value, add up to 1, and one row always holds."""
        place = ("choices", at, "probability")
        if choice.controllable:
            raise self._fault(
                f"found probabilities of {choice.name!r}, expected none: the executive decides it", *place
            )
        for row in choice.probability:
            values = dict(row.values)
            if values.keys() != set(choice.domain):
                found = f"found probabilities of {', '.join(values)}"
                raise self._fault(f"{found}, expected one for each of {', '.join(choice.domain)}", *place)
            if sum(values.values()) != 1 or min(values.values()) < 0:
                numbers = ", ".join(map(format_number, values.values()))
                raise self._fault(
                    f"found probabilities {numbers}, expected numbers of at least 0 that add up to 1", *place
                )
            for variable, value in row.guard:
                self._assignment(
                    _Guarded(f"the probabilities of {choice.name}", row.guard, place, None), variable, value
                )
        if any(not row.guard for row in choice.probability[:-1]) or choice.probability[-1].guard:
            raise self._fault(
                "found no last row without guard, expected one, for all other cases, and only there", *place
            )

    def _unique(self, kind: str, plural: str, names: list[str]) -> None:
        seen: set[str] = set()
        for at, name in enumerate(names):
            if name in seen:
                raise self._fault(f"found a second {kind} {shorten(name)}, expected each once", plural, at, "name")
            seen.add(name)

    def _event(self, name: str, *path: Key) -> None:
        if name not in self._guards:
            hint = did_you_mean(name, self._guards)
            raise self._fault(f"found event {shorten(name)}, expected one of the plan{hint}", *path)

    # -- guards --------------------------------------------------------------------------------------------------

    def guards(self) -> None:
        """Guards mention choices and values that exist, and only one value of each choice."""
        for guarded in self._guarded():
            values: dict[str, str] = {}
            for variable, value in sorted(guarded.guard):
                self._assignment(guarded, variable, value)
                other = values.setdefault(variable, value)
                if other != value:
                    message = f"found {variable} = {other} and {variable} = {value} in the guard of {guarded.name}"
                    raise self._fault(f"{message}, expected one value of a choice", *guarded.path, "guard")

    def _assignment(self, one: _Guarded, variable: str, value: str) -> None:
        choice = self._choices.get(variable)
        if choice is None:
            hint = did_you_mean(variable, self._choices)
            message = f"found choice {shorten(variable)} in the guard of {one.name}, expected one of the plan{hint}"
            raise self._fault(message, *one.path, "guard", variable)
        if value not in choice.domain:
            hint = did_you_mean(value, choice.domain)
            message = f"found {variable} = {shorten(value)} in the guard of {one.name}"
            raise self._fault(f"{message}, expected a value of {variable}{hint}", *one.path, "guard", variable)

    def _guarded(self) -> Iterator[_Guarded]:
        """All that has a guard."""
        for at, event in enumerate(self._network.events):
            yield _Guarded(f"event {event.name}", event.guard, ("events", at), event.name)
        for edge, name, kind, at in self._edges():
            yield _Guarded(name, edge.guard, (kind, at), edge.source if isinstance(edge, model.Activity) else None)

    def _edges(self) -> Iterator[tuple[model.Constraint | model.Activity, str, str, int]]:
        """Constraints and activities, what they are called, and where they are written."""
        for at, constraint in enumerate(self._network.constraints):
            yield constraint, f"the constraint from {constraint.source} to {constraint.target}", "constraints", at
        for at, activity in enumerate(self._network.activities):
            yield activity, f"activity {activity.action}", "activities", at

    # -- constraints and activities ------------------------------------------------------------------------------

    def edges(self) -> None:
        """Constraints and activities imply their events, and their bounds leave something between them."""
        for edge, name, kind, at in self._edges():
            for event in (edge.source, edge.target):
                missing = self._guards[event] - edge.guard
                if missing:
                    message = f"found {name} without {model.guard_text(missing)} in its guard"
                    raise self._fault(f"{message}, expected all of event {event}'s", kind, at, "guard")
            if edge.lower is not None and edge.upper is not None and edge.lower > edge.upper:
                bounds = f"[{format_number(edge.lower)}, {format_number(edge.upper)}]"
                raise self._fault(f"found bounds {bounds} of {name}, expected a lower bound up to the upper", kind, at)
            if isinstance(edge, model.Activity):
                self._activity(edge, at)

    def _activity(self, activity: model.Activity, at: int) -> None:
        """An activity takes time, and is between the initial state and the goal."""
        if activity.lower <= 0:
            message = f"found lower bound {format_number(activity.lower)} of activity {activity.action}"
            raise self._fault(f"{message}, expected one above 0", "activities", at, "lower")
        if activity.source == activity.target:
            message = f"found activity {activity.action} from {activity.source} to the same event"
            raise self._fault(f"{message}, expected two events", "activities", at, "to")
        for key, event in (("from", activity.source), ("to", activity.target)):
            if event in {model.INITIAL, model.GOAL}:
                message = f"found activity {activity.action} at {event}, expected an event of its own"
                reason = "nothing happens before the initial state or after the goal"
                raise self._fault(f"{message}: {reason}", "activities", at, key)

    # -- choices before what depends on them ---------------------------------------------------------------------

    def containment(self) -> None:
        """No choice depends on itself, and a guard that mentions a choice entails the guard of its event."""
        self._acyclic()
        for guarded in self._guarded():
            for variable, _ in sorted(guarded.guard):
                choice = self._choices[variable]
                if choice.event is None:
                    continue
                missing = self._guards[choice.event] - guarded.guard
                contradicted = {name for name, _ in missing} & {name for name, _ in guarded.guard}
                if contradicted:
                    reason = f"event {choice.event}, where {variable} is chosen, needs {model.guard_text(missing)}"
                    message = f"found guard {{{model.guard_text(guarded.guard)}}} of {guarded.name}, which never holds"
                    raise self._fault(
                        f"{message}: {reason}; expected a guard that can hold", *guarded.path, "guard", variable
                    )
                if missing:
                    message = f"found {variable} in the guard of {guarded.name} without {model.guard_text(missing)}"
                    reason = f"{variable} is chosen at event {choice.event}, which happens only then"
                    raise self._fault(f"{message}, expected that too: {reason}", *guarded.path, "guard", variable)

    def _acyclic(self) -> None:
        needs = model.circular(self._network)
        if needs:
            at, choice = next((at, one) for at, one in enumerate(self._network.choices) if one.name in needs)
            cycle = " needs ".join(_cycle(choice.name, needs))
            message = f"found choice {choice.name!r} at event {choice.event}, whose guard depends on the choice itself"
            raise self._fault(
                f"{message} ({cycle}), expected choices that come one after the other", "choices", at, "at"
            )

    def timeliness(self) -> None:
        """Nothing that depends on a choice is left unordered with it."""
        constraints = self._network.temporal_constraints
        edges = [
            (first, then, each.guard) for each in constraints for then, first, most in each.upper_bounds if most <= 0
        ]

        @cache
        def following(guard: model.Guard) -> dict[str, list[str]]:
            """Where constraints lead that say "not before" and do not contradict a guard."""
            targets = defaultdict[str, list[str]](list)
            for source, target, label in edges:
                if not model.contradicts(guard, label):
                    targets[source].append(target)
            return targets

        led_to = cache(lambda event, guard: reachable(following(guard), event))

        def may_follow(earlier: str, later: str, guard: model.Guard) -> bool:
            return earlier == model.INITIAL or later in led_to(earlier, guard)

        for guarded in self._guarded():
            for variable, _ in sorted(guarded.guard):
                choice = self._choices[variable]
                event = guarded.event
                if choice.event is None or event is None or may_follow(choice.event, event, guarded.guard):
                    continue
                if may_follow(event, choice.event, guarded.guard):
                    when, remedy = "is ordered before", f"let the constraints put {choice.event} before {event}"
                else:
                    when = "may come before"
                    remedy = f"add a constraint from {choice.event} to {event} with lower bound 0"
                message = f"found choice {variable} in the guard of {guarded.name}, which {when} the choice"
                raise self._fault(
                    f"{message}, expected event {choice.event} first: {remedy}", *guarded.path, "guard", variable
                )

    def _fault(self, message: str, *path: Key) -> InputError:
        return InputError(message, self._places.of(*path))


def _cycle(start: str, needs: dict[str, set[str]]) -> Iterable[str]:
    """Choices each of which needs the next, back to one of them."""
    path = [start]
    while (following := min(needs[path[-1]])) not in path:
        path.append(following)
    return [*path[path.index(following) :], following]


FORMAT: Final = "tpnu/1"
SCHEMA_FILE: Final = Path(__file__).with_name("tpnu.schema.json")
"""The JSON Schema of the format."""

_KINDS_OF_PARAMETERS = ("duration", "at-least", "at-most", "hesitation")
_NUMBERS_OF_PARAMETERS = {"default": None, "lower": "-inf", "upper": "inf", "weight": None}
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TpnuDocument:
    """A network as it is written in a file.

    `domain` and `problem` are as written; :meth:`beside` gives their paths. `places` says where everything is.
    """

    network: model.Tpnu
    domain: str
    problem: str
    places: Places = NOWHERE
    parameters: tuple[TeamParameterSpec, ...] = ()
    """Bounds that are to be varied; the network has their nominal values."""

    def beside(self, path: str) -> Path:
        """The path of a file that the document names."""
        return Path(self.places.file or "").parent / path


def read_tpnu(path: str | os.PathLike[str]) -> TpnuDocument:
    """Read a `.tpnu.json` file, without its domain and problem, which :func:`robust.pike.load` reads as well.

    Args:
        path: the file.

    Returns:
        The network, with exact numbers, and the paths of its domain and problem.

    Raises:
        InputError: with line and column, if the file cannot be read or is not of the format.
    """
    return parse_tpnu(read_text(path), os.fspath(path))


def parse_tpnu(text: str, file: str = "<tpnu>") -> TpnuDocument:
    """Read the text of a `.tpnu.json` file; `file` is its name in messages, and what paths are relative to.

    Raises:
        InputError: with line and column, if the text is not of the format.
    """
    value = parse_json(text, file)
    places = Places(file, {path: inner.location for path, inner in walk(value)})
    members = _DOCUMENT.read(value)
    lists = {key: members.get(key, ()) for key in ("choices", "events", "constraints", "activities")}
    return TpnuDocument(
        model.Tpnu(members["name"], **lists),
        members["domain"],
        members["problem"],
        places,
        members.get("parameters", ()),
    )


def write_tpnu(path: str | os.PathLike[str], network: model.Tpnu, *, domain: str, problem: str) -> None:
    """Write a network as a `.tpnu.json` file.

    Args:
        path: the file, which is replaced as a whole or not at all.
        network: the network.
        domain: the path of the domain as it is to be written: relative to the file.
        problem: the path of the problem, likewise.

    Raises:
        InputError: if the file cannot be written, or the network is not one that :func:`tpnu_text` can write.
    """
    atomic_write(path, tpnu_text(network, domain=domain, problem=problem), Location(str(path)))


def tpnu_text(network: model.Tpnu, *, domain: str, problem: str) -> str:
    """The text of the `.tpnu.json` file of a network; reading it gives the same network.

    Raises:
        InputError: if the network has what the format cannot say: a choice that no event decides or without values, a
            guard with two values of one choice, an empty name, or an action that is no PDDL in lower case.
    """
    for choice in network.choices:
        if choice.event is None:
            raise InputError(f"choice {choice.name!r} has no event; expected one to write the plan to a file")
    heads = {"format": FORMAT, "name": network.name, "domain": domain, "problem": problem}
    members = [f"  {_json(key)}: {_json(value)}" for key, value in heads.items()]
    for key, part in _LISTS.items():
        rows = [f"    {part.text(each)}" for each in getattr(network, key)]
        members.append(f"  {_json(key)}: " + ("[\n" + ",\n".join(rows) + "\n  ]" if rows else "[]"))
    text = "{\n" + ",\n".join(members) + "\n}\n"
    if parse_tpnu(text, network.name).network != network:
        expected = "actions in lower case with single blanks, and one value of a choice in each guard"
        raise InputError(f"plan {network.name!r} would not be read as it was written; expected {expected}")
    return text


# -- values ----------------------------------------------------------------------------------------------------------


def _fault(value: Json, expected: str) -> InputError:
    return InputError(f"found {describe(value)}, expected {expected}", value.location)


def _list(reader: Callable[[Json], T]) -> Callable[[Json], tuple[T, ...]]:
    def read(value: Json) -> tuple[T, ...]:
        if not isinstance(value, Array):
            raise _fault(value, "a list in brackets")
        return tuple(reader(item) for item in value.items)

    return read


def _text(value: Json) -> str:
    if not isinstance(value, JsonText):
        raise _fault(value, "a text in quotes")
    if not model.is_name(value.value):
        raise _fault(value, model.PROPER_NAME)
    return value.value


def _text_or_null(value: Json) -> str | None:
    return None if _is_null(value) else _text(value)


def _is_null(value: Json) -> bool:
    return isinstance(value, Constant) and value.value is None


def _format(value: Json) -> str:
    if not isinstance(value, JsonText) or value.value != FORMAT:
        raise _fault(value, f"{FORMAT!r}, the format that this version reads")
    return value.value


def _boolean(value: Json) -> bool:
    if not isinstance(value, Constant) or value.value is None:
        raise _fault(value, "true or false")
    return value.value


def _number(value: Json) -> Fraction:
    if isinstance(value, Numeral):
        return parse_number(value.text, value.location)
    if isinstance(value, JsonText) and is_number(value.value):
        return parse_number(value.value, value.location)
    raise _fault(value, f"{EXPECTED_NUMBER}, fractions in quotes")


def _bound(value: Json) -> Fraction | None:
    if _is_null(value):
        return None
    if isinstance(value, (Numeral, JsonText)):
        return _number(value)
    raise _fault(value, "a number, or null for no bound")


def _number_text(infinite: str | None, value: Json) -> str:
    """The text of a number; null for no bound, where that can be."""
    if infinite is not None and _is_null(value):
        return infinite
    return format_number(_number(value))


def _domain(value: Json) -> tuple[str, ...]:
    values = _list(_text)(value)
    if not values:
        raise _fault(value, "at least one value to choose")
    if isinstance(value, Array):
        for at, (item, text) in enumerate(zip(value.items, values, strict=True)):
            if text in values[:at]:
                raise InputError(f"found a second {shorten(text)}, expected each value once", item.location)
    return values


def _guard(value: Json) -> model.Guard:
    if not isinstance(value, Object):
        raise _fault(value, 'a guard: an object such as {"x": "a"}')
    for key in value.keys:
        _text(key)
    return model.guard({name: _text(member) for name, member in value.members.items()})


def _probability(value: Json) -> tuple[model.Likelihood, ...]:
    """A table for all cases, or a list of tables with guards."""
    rows = value.items if isinstance(value, Array) else None
    if rows == ():
        raise _fault(value, "at least one table of probabilities")
    return (model.Likelihood(_shares(value)),) if rows is None else tuple(map(_LIKELIHOOD.read, rows))


def _shares(value: Json) -> tuple[tuple[str, Fraction], ...]:
    if not isinstance(value, Object):
        raise _fault(value, 'probabilities by value: an object such as {"mug": 0.7, "glass": 0.3}')
    return tuple((_text(key), _number(value.members[key.value])) for key in value.keys)


def _action(value: Json) -> str:
    action = model.as_ground_action(_text(value))
    if action is None:
        raise _fault(value, model.PROPER_ACTION)
    return action


def _json(value: object) -> str:
    """JSON text; guards are objects, and fractions that are no decimals texts."""
    match value:
        case Fraction():
            text = format_number(value)
            return f'"{text}"' if "/" in text else text
        case frozenset():
            return json.dumps(dict(sorted(value)), ensure_ascii=False)
        case tuple() if value and isinstance(value[0], model.Likelihood):
            return _json(value[0].values) if len(value) == 1 else f"[{', '.join(map(_LIKELIHOOD.text, value))}]"
        case tuple() if value and isinstance(value[0], tuple):
            return f"{{{', '.join(f'{_json(name)}: {_json(share)}' for name, share in value)}}}"
        case _:
            return json.dumps(value, ensure_ascii=False)


# -- objects ---------------------------------------------------------------------------------------------------------

Members: TypeAlias = Mapping[str, Callable[[Json], object]]
"""How the value of each key is read."""
_FIELDS: Final = {"at": "event", "from": "source", "to": "target"}
"""The fields that have other names than their keys."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A kind of object: what messages call it, what is made of it, and its members.

    Optional ones may be missing, and are not written if they are None or empty.
    """

    what: str
    required: Members
    optional: Members
    make: Callable[..., Any] = dict
    located: bool = False
    """Whether it keeps its place."""

    def read(self, value: Json) -> Any:
        """What is made of the fields that are there; InputError if keys are unknown or missing, or values wrong."""
        if not isinstance(value, Object):
            raise _fault(value, f"{self.what}: an object in braces")
        known = {**self.required, **self.optional}
        for key in value.keys:
            if key.value not in known:
                hint = did_you_mean(key.value, known)
                raise InputError(f"found key {shorten(key.value)}, expected one of {self.what}{hint}", key.location)
        for name in self.required:
            if name not in value.members:
                message = f"found {self.what} without {name!r}, expected all of {', '.join(self.required)}"
                raise InputError(message, value.location)
        place = {"location": value.location} if self.located else {}
        there = {key: read(value.members[key]) for key, read in known.items() if key in value.members}
        return self.make(**{_FIELDS.get(key, key): member for key, member in there.items()}, **place)

    def text(self, part: object) -> str:
        """The object in one line."""
        values = {key: getattr(part, _FIELDS.get(key, key)) for key in (*self.required, *self.optional)}
        written = (f"{_json(key)}: {_json(value)}" for key, value in values.items() if key in self.required or value)
        return f"{{{', '.join(written)}}}"


_GUARDED: Final[Members] = {"guard": _guard}
_LIKELIHOOD: Final = _Part("a table of probabilities", {"values": _shares}, _GUARDED, model.Likelihood)
_BETWEEN: Final[Members] = {"from": _text, "to": _text, "lower": _bound, "upper": _bound}
_CHOICE: Final[Members] = {"name": _text, "domain": _domain, "controllable": _boolean, "at": _text}
_ACTIVITY: Final[Members] = {"action": _action, **_BETWEEN, "lower": _number}
_LISTS: Final[Mapping[str, _Part]] = {
    "choices": _Part("a choice", _CHOICE, {"probability": _probability}, model.Choice),
    "events": _Part("an event", {"name": _text}, _GUARDED, model.Event),
    "constraints": _Part("a constraint", _BETWEEN, _GUARDED, model.Constraint),
    "activities": _Part("an activity", _ACTIVITY, {"agent": _text_or_null, **_GUARDED}, model.Activity, located=True),
}
_PARAMETER: Final = _Part(
    "a parameter",
    {"name": _text},
    dict.fromkeys(_KINDS_OF_PARAMETERS, _text)
    | {key: partial(_number_text, infinite) for key, infinite in _NUMBERS_OF_PARAMETERS.items()},
    lambda *, location, **members: of_members(members, location),
    located=True,
)
_DOCUMENT: Final = _Part(
    "a plan with choices",
    {"format": _format, **dict.fromkeys(("name", "domain", "problem"), _text), "events": _list(_LISTS["events"].read)},
    {key: _list(part.read) for key, part in _LISTS.items() if key != "events"} | {"parameters": _list(_PARAMETER.read)},
)
