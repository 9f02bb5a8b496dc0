"""Whether a network is well-formed [PIKE, Definition 2.1], with messages that say where its parts are written."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from robust.errors import InputError, Location, did_you_mean
from robust.json_text import JsonPath, Key
from robust.numbers import format_number, shorten
from robust.pike_bridge import model


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
"""Of plans that were built in memory."""


def validate(network: model.Tpnu, places: Places = NOWHERE) -> None:
    """Check a network; `places` says where its parts are written.

    Raises:
        InputError: at the first thing that is wrong.
    """
    checks = _Checks(network, places)
    checks.names()
    checks.choices()
    checks.guards()
    checks.edges()
    checks.containment()
    checks.timeliness()


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
        """Names are unique, and all that is mentioned exists."""
        self._unique("choice", "choices", [choice.name for choice in self._network.choices])
        self._unique("event", "events", [event.name for event in self._network.events])
        for at, choice in enumerate(self._network.choices):
            if choice.event is not None:
                self._event(choice.event, "choices", at, "at")
        for edge, _, kind, at in self._edges():
            self._event(edge.source, kind, at, "from")
            self._event(edge.target, kind, at, "to")
        for at, event in enumerate(self._network.events):
            if event.name in {model.INITIAL, model.GOAL} and event.guard:
                message = (
                    f"found guard {{{model.guard_text(event.guard)}}} of {event.name}, expected none: it always happens"
                )
                raise self._fault(message, "events", at, "guard")

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

    def choices(self) -> None:
        """Each choice has values, all different."""
        for at, choice in enumerate(self._network.choices):
            if not choice.domain or len(set(choice.domain)) < len(choice.domain):
                found = ", ".join(choice.domain) or "no values"
                message = f"found {found} for choice {choice.name!r}, expected at least one value and each once"
                raise self._fault(message, "choices", at, "domain")

    # -- guards --------------------------------------------------------------------------------------------------

    def guards(self) -> None:
        """Guards mention choices and values that exist, and only one value of each choice."""
        for one in self._guarded():
            values: dict[str, str] = {}
            for variable, value in sorted(one.guard):
                self._assignment(one, variable, value)
                other = values.setdefault(variable, value)
                if other != value:
                    message = f"found {variable} = {other} and {variable} = {value} in the guard of {one.name}"
                    raise self._fault(f"{message}, expected one value of a choice", *one.path, "guard")

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
            self._edge(edge, name, kind, at)
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

    def _edge(self, edge: model.Constraint | model.Activity, name: str, kind: str, at: int) -> None:
        for event in (edge.source, edge.target):
            missing = self._guards[event] - edge.guard
            if missing:
                message = (
                    f"found {name} without {model.guard_text(missing)} in its guard, expected all of event {event}'s"
                )
                raise self._fault(message, kind, at, "guard")
        if edge.lower is not None and edge.upper is not None and edge.lower > edge.upper:
            bounds = f"[{format_number(edge.lower)}, {format_number(edge.upper)}]"
            raise self._fault(f"found bounds {bounds} of {name}, expected a lower bound up to the upper", kind, at)

    # -- choices before what depends on them ---------------------------------------------------------------------

    def containment(self) -> None:
        """No choice is asked for only after itself, and whoever asks for a choice asks for its event."""
        self._acyclic()
        for one in self._guarded():
            for variable, _ in sorted(one.guard):
                choice = self._choices[variable]
                if choice.event is None:
                    continue
                missing = self._guards[choice.event] - one.guard
                contradicted = {name for name, _ in missing} & {name for name, _ in one.guard}
                if contradicted:
                    reason = f"event {choice.event}, where {variable} is chosen, needs {model.guard_text(missing)}"
                    message = (
                        f"found guard {{{model.guard_text(one.guard)}}} of {one.name}, which never holds: {reason}"
                    )
                    raise self._fault(f"{message}; expected a guard that can hold", *one.path, "guard", variable)
                if missing:
                    message = f"found {variable} in the guard of {one.name} without {model.guard_text(missing)}"
                    reason = f"{variable} is chosen at event {choice.event}, which happens only then"
                    raise self._fault(f"{message}, expected that too: {reason}", *one.path, "guard", variable)

    def _acyclic(self) -> None:
        """Remove choices whose event depends on no choice that is left, until none is left."""
        needs = {
            name: {variable for variable, _ in self._guards[choice.event]} if choice.event is not None else set()
            for name, choice in self._choices.items()
        }
        while free := {name for name, needed in needs.items() if not needed}:
            needs = {name: needed - free for name, needed in needs.items() if name not in free}
        if needs:
            at, choice = next((at, one) for at, one in enumerate(self._network.choices) if one.name in needs)
            cycle = " needs ".join(_cycle(choice.name, needs))
            message = f"found choice {choice.name!r} at event {choice.event}, whose guard depends on the choice itself"
            raise self._fault(
                f"{message} ({cycle}), expected choices that come one after the other", "choices", at, "at"
            )

    def timeliness(self) -> None:
        """Nothing that depends on a choice is left unordered with it."""
        order = _EventOrder(self._network)
        for one in self._guarded():
            for variable, _ in sorted(one.guard):
                choice = self._choices[variable]
                if choice.event is None or one.event is None or order.may_follow(choice.event, one.event, one.guard):
                    continue
                if order.may_follow(one.event, choice.event, one.guard):
                    when, remedy = "is ordered before", f"let the constraints put {choice.event} before {one.event}"
                else:
                    when = "may come before"
                    remedy = f"add a constraint from {choice.event} to {one.event} with lower bound 0"
                message = f"found choice {variable} in the guard of {one.name}, which {when} the choice"
                raise self._fault(
                    f"{message}, expected event {choice.event} first: {remedy}", *one.path, "guard", variable
                )

    def _fault(self, message: str, *path: Key) -> InputError:
        return InputError(message, self._places.of(*path))


def _cycle(start: str, needs: dict[str, set[str]]) -> Iterable[str]:
    """Choices each of which needs the next, back to one of them."""
    path = [start]
    while (following := min(needs[path[-1]])) not in path:
        path.append(following)
    return [*path[path.index(following) :], following]


class _EventOrder:
    """Which events are led to from an event by constraints that say "not before" and do not contradict a guard."""

    def __init__(self, network: model.Tpnu) -> None:
        self._edges = [(*pair, each.guard) for each in network.temporal_constraints for pair in _not_before(each)]
        self._under: dict[model.Guard, dict[str, list[str]]] = {}
        self._led_to: dict[tuple[model.Guard, str], set[str]] = {}

    def may_follow(self, earlier: str, later: str, guard: model.Guard) -> bool:
        if guard not in self._under:
            following = self._under[guard] = defaultdict(list)
            for source, target, label in self._edges:
                if not model.contradicts(guard, label):
                    following[source].append(target)
        if (guard, earlier) not in self._led_to:
            self._led_to[guard, earlier] = model.reachable(self._under[guard], earlier)
        return earlier == model.INITIAL or later in self._led_to[guard, earlier]


def _not_before(constraint: model.Constraint) -> Iterator[tuple[str, str]]:
    if constraint.lower is not None and constraint.lower >= 0:
        yield constraint.source, constraint.target
    if constraint.upper is not None and constraint.upper <= 0:
        yield constraint.target, constraint.source
