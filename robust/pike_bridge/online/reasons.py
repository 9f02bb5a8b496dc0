"""Answers to *why* and *why not*, as data, in words, and for JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, TypeAlias

from robust.pike_bridge.execution import Execution
from robust.pike_bridge.online.statements import OF_PLAN, Fact, Kind
from robust.pike_bridge.online.wording import durations, listed
from robust.plan.numerals import format_number


@dataclass(frozen=True, slots=True)
class Conflict:
    """Facts that contradict each other, with what the plan demands; without any one of them they would not.

    `sequence`: the plan puts the activities whose least durations are among them one after the other.
    """

    facts: tuple[Fact, ...]
    sequence: bool = False

    @property
    def clauses(self) -> tuple[str, ...]:
        """All but choices and what was asked: first what has happened, then what the plan demands."""
        return (*self._happened(), *self._demanded())

    @property
    def text(self) -> str:
        return "\n".join([self.choices, *self.clauses] if self.choices else self.clauses)

    def as_dict(self) -> list[dict[str, str]]:
        """The `conflict` of `robust/pike-run/1`."""
        return [each.as_dict() for each in self.facts]

    @property
    def choices(self) -> str:
        """The choices that it rests on: `xA1 = mug, xA2 = coffee`."""
        return ", ".join(each.text for each in self.facts if each.kind in {Kind.CHOICE, Kind.INFERENCE})

    def _happened(self) -> Iterator[str]:
        yield from (each.text for each in self.facts if each.kind is Kind.LINK)
        for kinds in ({Kind.EVENT, Kind.TIME}, {Kind.REPORT}):
            texts = [each.text for each in self.facts if each.kind in kinds]
            if texts:
                yield ", ".join(texts)

    def _demanded(self) -> Iterator[str]:
        demands = [each for each in self.facts if each.kind in OF_PLAN]
        yield from (each.text for each in demands if each.kind is Kind.CONDITION)
        least = [each.activity for each in demands if each.kind is Kind.DURATION and each.activity]
        bounds = [each for each in demands if each.kind is Kind.BOUND]
        total = sum((each.lower for each in least), Fraction(0))
        exceeded = self.sequence and len(bounds) == 1 and bounds[0].limit is not None and total > bounds[0].limit
        if least:
            yield durations(least) + (f": {format_number(total)} in all" if exceeded and len(least) > 1 else "")
        yield from (each.text for each in demands if each.kind is Kind.DURATION and not each.activity)
        yield from (f"but {each.text}" if exceeded else each.text for each in bounds)
        if [each.kind for each in demands] == [Kind.ORDER]:
            yield "the plan demands another order of events"


@dataclass(frozen=True, slots=True)
class Support:
    """A causal link of a continuation: who establishes what, and for whom."""

    literal: str
    producer: str
    consumer: str
    time: Fraction
    """When it is established."""

    def as_dict(self) -> dict[str, str]:
        return {
            "literal": self.literal,
            "producer": self.producer,
            "consumer": self.consumer,
            "time": str(self.time),
        }


@dataclass(frozen=True, slots=True)
class WhyExecuted:
    """Why an event was, or may be, executed: a continuation in which it is, and what it is good for there.

    Attributes:
        event: the event; `name` says what happens there.
        needs: what activities that begin there, or have conditions there, were given by other activities.
        serves: what its activities establish for others.
        latest: until when it can be executed; None if that is not limited.
        continuation: choices, and times of all their events; None if none is left.
    """

    event: str
    name: str
    needs: tuple[Support, ...]
    serves: tuple[Support, ...]
    latest: Fraction | None
    continuation: Execution | None

    @property
    def parts(self) -> tuple[str, ...]:
        """What is to be said, apart."""
        needed = _grouped((each.producer, each) for each in self.needs)
        found = [*support_parts(self.serves), *(f"uses {what} from {whom}" for whom, what in needed)]
        if self.latest is not None:
            found.append(f"not later than {format_number(self.latest)}")
        return tuple(found)

    @property
    def text(self) -> str:
        return "; ".join(self.parts) or f"nothing speaks against {self.name}"

    def as_dict(self) -> dict[str, Any]:
        """A reason of `robust/pike-run/1`."""
        return {
            "kind": "execution",
            "event": self.event,
            "text": self.text,
            "needs": [each.as_dict() for each in self.needs],
            "serves": [each.as_dict() for each in self.serves],
            "latest": None if self.latest is None else str(self.latest),
            "continuation": continuation_answer(self.continuation),
        }


@dataclass(frozen=True, slots=True)
class WhyChosen:
    """Why a choice has a value, or must have it.

    Attributes:
        possible: the values that would have been possible as well, in the order of preference.
        impossible: for each other value why it is not.
        serves: what the activities of the value establish for others.
    """

    choice: str
    value: str | None
    """None if several values are possible."""
    possible: tuple[str, ...]
    impossible: Mapping[str, Conflict]
    serves: tuple[Support, ...] = ()
    continuation: Execution | None = None

    @property
    def excluding(self) -> tuple[str, ...]:
        """Why it has no other value."""
        return tuple(
            line for value, conflict in self.impossible.items() for line in impossible_lines(f"not {value}", conflict)
        )

    @property
    def parts(self) -> tuple[str, ...]:
        """What its value is good for, and what else would have been possible."""
        found = support_parts(self.serves)
        if self.possible:
            also = listed(self.possible)
            verb = "is" if len(self.possible) == 1 else "are"
            found.append(f"{also} {verb} possible" + (", too" if self.value else ""))
        return tuple(found)

    @property
    def text(self) -> str:
        return "\n".join((*self.excluding, "; ".join(self.parts)) if self.parts else self.excluding)

    def as_dict(self) -> dict[str, Any]:
        """A reason of `robust/pike-run/1`."""
        return {
            "kind": "choice",
            "choice": self.choice,
            "value": self.value,
            "text": self.text,
            "possible": list(self.possible),
            "impossible": {value: conflict.as_dict() for value, conflict in self.impossible.items()},
            "serves": [each.as_dict() for each in self.serves],
            "continuation": continuation_answer(self.continuation),
        }


class Obstacle(Enum):
    """Why something is not done, or cannot be."""

    NONE = "possible"
    DONE = "done"
    EXCLUDED = "excluded"
    AWAITED = "awaited"
    EARLY = "early"
    CONFLICT = "conflict"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why an event is not executed now, a choice has not a value, or no correct execution is left.

    Attributes:
        subject: what was asked about, in words.
        reason: why not, in words, but for the conflict.
        earliest: from when on it is not too early any more, as far as is known.
        conflict: what contradicts it.
        continuation: a correct execution with it, if it is possible.
    """

    subject: str
    obstacle: Obstacle
    reason: str = ""
    earliest: Fraction | None = None
    conflict: Conflict | None = None
    continuation: Execution | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        if self.conflict is None:
            return (self.reason,)
        return tuple(impossible_lines(self.reason, self.conflict))

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def as_dict(self) -> dict[str, Any]:
        """A reason of `robust/pike-run/1`."""
        return {
            "kind": "obstacle",
            "subject": self.subject,
            "obstacle": self.obstacle.value,
            "text": self.text,
            "earliest": None if self.earliest is None else str(self.earliest),
            "conflict": None if self.conflict is None else self.conflict.as_dict(),
            "continuation": continuation_answer(self.continuation),
        }


Reason: TypeAlias = WhyExecuted | WhyChosen | WhyNot


def continuation_answer(execution: Execution | None) -> dict[str, Any] | None:
    """A continuation for JSON, in the order of time."""
    if execution is None:
        return None
    schedule = sorted(execution.schedule.items(), key=lambda item: (item[1], item[0]))
    return {"scenario": dict(execution.scenario), "schedule": {event: str(time) for event, time in schedule}}


def impossible_lines(head: str, conflict: Conflict) -> Iterator[str]:
    """A heading with the choices that it rests on, then one line for each other fact."""
    given = f", as {conflict.choices}" if conflict.choices else ""
    if conflict.clauses:
        yield f"{head}{given}:"
        yield from (f"  {clause}" for clause in conflict.clauses)
    else:
        yield f"{head}{given or ': the plan never allows it'}"


def support_parts(supports: tuple[Support, ...]) -> list[str]:
    """`establishes (have mug) for (pour-coffee human)`, and so on, one for each consumer."""
    return [f"establishes {what} for {who}" for who, what in _grouped((each.consumer, each) for each in supports)]


def _grouped(links: Iterable[tuple[str, Support]]) -> list[tuple[str, str]]:
    """For each of the other ends of links the literals, listed."""
    literals: dict[str, list[str]] = {}
    for end, link in links:
        known = literals.setdefault(end, [])
        if link.literal not in known:
            known.append(link.literal)
    return [(end, listed(names)) for end, names in literals.items()]
