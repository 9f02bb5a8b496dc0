"""What an executive is told, what it announces, and what has happened so far [PIKE §2.2 and Algorithm 1]."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

from robust.errors import InputError, Location
from robust.json_text import JsonTypes, Tagged, named
from robust.network.differences import reachable
from robust.numbers import Number, exact, format_number, shorten
from robust.pike_bridge import model, semantics
from robust.plan.model import Atom


class Timed(Tagged):
    """Something that may be told later; `at` is when it was, in the plan's unit: any number, floats as they print.

    Raises:
        InputError: if it is none.
    """

    __slots__ = ()
    at: Fraction | None

    def __post_init__(self) -> None:
        if self.at is not None:
            object.__setattr__(self, "at", exact(self.at, Location("at")))


@dataclass(frozen=True, slots=True)
class Outcome(Timed):
    """A human or nature has decided an uncontrollable choice: U(t) of [PIKE §2.2]; times are in the plan's unit."""

    choice: str
    value: str
    at: Fraction | None = None
    """When that was, if it is told later."""

    def __str__(self) -> str:
        return f"{self.choice} = {self.value}{_at(self.at)}"


@dataclass(frozen=True, slots=True)
class Completion(Timed):
    """A dispatched activity has ended: A(t) of [PIKE §2.2]; times are in the plan's unit.

    `event`, its end, is needed only if several of the same action run.
    """

    action: str
    event: str | None = None
    goal: str | None = None
    """Of the dispatch; then neither `event` nor the order of dispatches matters."""
    at: Fraction | None = None
    """When that was, if it is told later."""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    """Values of people's choices that show in it."""

    def __str__(self) -> str:
        shown = "".join(f", {name} = {value}" for name, value in self.outcomes.items())
        return f"{self.action} has ended{f' at {self.event}' if self.event else ''}{_at(self.at)}{shown}"


@dataclass(frozen=True, slots=True)
class Began(Timed):
    """Somebody has begun an activity, perhaps before it was dispatched; `at` is in the plan's unit of time."""

    KIND = "started"

    action: str
    event: str | None = None
    """Its end, if there are several of the action."""
    goal: str | None = None
    at: Fraction | None = None

    def __str__(self) -> str:
        return f"{self.action} has begun{_at(self.at)}"


@dataclass(frozen=True, slots=True)
class NotAchieved(Timed):
    """An activity has ended without what it does at its end: it failed, was aborted by its agent, or cancelled.

    `at` is in the plan's unit of time.
    """

    action: str
    event: str | None = None
    goal: str | None = None
    at: Fraction | None = None

    def __str__(self) -> str:
        return f"{self.action} {'has' if self.kind() == 'failed' else 'was'} {self.kind()}{_at(self.at)}"


class ActivityFailed(NotAchieved):
    """It failed."""

    __slots__ = ()
    KIND = "failed"


class ActivityAborted(NotAchieved):
    """Its agent has given it up."""

    __slots__ = ()
    KIND = "aborted"


class ActivityCancelled(NotAchieved):
    """It was cancelled, as the executive had asked."""

    __slots__ = ()
    KIND = "cancelled"


@dataclass(frozen=True, slots=True)
class Estimate(Timed):
    """What is seen of the state now, or was at `at`, in the plan's unit of time: P(t) of [PIKE §2.2].

    If `complete`, every atom that is not said to be true is false.
    """

    true: frozenset[Atom] = frozenset()
    false: frozenset[Atom] = frozenset()
    complete: bool = False
    at: Fraction | None = None

    def __str__(self) -> str:
        literals = [*sorted(map(str, self.true)), *(f"(not {atom})" for atom in sorted(map(str, self.false)))]
        return f"seen: {', '.join(literals) or 'nothing'}{', all else is false' if self.complete else ''}"


@dataclass(frozen=True, slots=True)
class Retract(Tagged):
    """An earlier message was wrong: one that is equal to this one."""

    message: Report

    def __str__(self) -> str:
        return f"not so: {self.message}"


NOT_ACHIEVED = (ActivityFailed, ActivityAborted, ActivityCancelled)
Ending: TypeAlias = Completion | ActivityFailed | ActivityAborted | ActivityCancelled
Report: TypeAlias = Outcome | Began | Ending | Estimate
"""What happened, as far as somebody knows."""
Message: TypeAlias = Report | Retract


def require_step(now: Number, messages: Iterable[Message]) -> Fraction:
    """The time of a step; InputError unless it is a number, and each message is one."""
    for message in messages:
        if not isinstance(message, Message):
            raise InputError(
                f"found {shorten(str(message))}, expected messages such as pike.Outcome", Location("messages")
            )
    return exact(now, Location("now"))


def _at(time: Fraction | None) -> str:
    return "" if time is None else f" at {format_number(time)}"


@dataclass(frozen=True, slots=True)
class Executed(Tagged):
    """An event has its time; `reported` says that the world decided it, by ending an activity."""

    event: str
    time: Fraction
    reported: bool = False


@dataclass(frozen=True, slots=True)
class Dispatched(Tagged):
    """An activity begins now: its agent is to do it."""

    action: str
    agent: str | None
    time: Fraction
    end: str
    """The event at which it ends."""
    lower: Fraction
    upper: Fraction | None
    goal: str = ""
    """What messages about this dispatch may name."""


@dataclass(frozen=True, slots=True)
class Cancel(Tagged):
    """An activity that runs is not needed any more: its agent is to stop."""

    action: str
    agent: str | None
    time: Fraction
    goal: str


@dataclass(frozen=True, slots=True)
class Deviated(Tagged):
    """An activity took less or more time than its bounds allow, or takes more by now; the rest has been judged anew.

    `duration` is what it took or has taken by now.
    """

    action: str
    time: Fraction
    duration: Fraction
    lower: Fraction
    upper: Fraction | None
    counts: Fraction | None = None
    """When its end counts, which was early, if it does not yet."""


@dataclass(frozen=True, slots=True)
class Resumed(Tagged):
    """What has happened is not a correct beginning any more, but the rest of the plan is correct from here on.

    `released` are choices of the executive that are open again.
    """

    time: Fraction
    released: tuple[str, ...]
    planned: bool = False
    """Whether a planner has made another plan, and not what was left of this one goes on."""


@dataclass(frozen=True, slots=True)
class Chosen(Tagged):
    """A choice has its value; `observed` says that it was not ours to make."""

    choice: str
    value: str
    time: Fraction
    observed: bool = False


@dataclass(frozen=True, slots=True)
class Excluded(Tagged):
    """What is executed next leaves some values of open choices impossible that are not the executive's to make."""

    event: str
    time: Fraction
    lost: tuple[str, ...]
    """The values, as `x = 1` or, of several that are impossible together only, `x = 1, y = 2`."""
    spared: tuple[str, ...]
    """What waiting would make impossible instead, in the same form."""
    reason: str
    """Why it could not wait."""


@dataclass(frozen=True, slots=True)
class Violated(Tagged):
    """Something that later activities rely on is not so any more: causal links are broken.

    It need not be the end: other support may be left.
    """

    atom: Atom
    expected: bool
    """What the atom was supposed to be."""
    producer: str
    """The event that had made it so."""
    consumers: tuple[str, ...]
    """The actions that relied on it, or `the goal`."""
    time: Fraction


@dataclass(frozen=True, slots=True)
class Rejected(Tagged):
    """A message that changes nothing, and why."""

    message: str
    reason: str
    time: Fraction


@dataclass(frozen=True, slots=True)
class Failed(Tagged):
    """No correct execution is left: from now on nothing is dispatched."""

    time: Fraction
    reason: str


@dataclass(frozen=True, slots=True)
class Succeeded(Tagged):
    """Every activated event has been executed, correctly."""

    time: Fraction
    scenario: tuple[model.Assignment, ...] = field(default=(), metadata=named("choices"))
    """What was chosen, by whomever."""


Decision: TypeAlias = (
    Executed | Dispatched | Cancel | Deviated | Resumed | Chosen | Excluded | Violated | Rejected | Failed | Succeeded
)


def goal_of(place: int) -> str:
    """The goal id of the activity at a place of the plan, which is dispatched once at most."""
    return f"goal-{place + 1}"


def parse_atom(text: str, location: Location | None = None) -> Atom:
    """`(predicate argument ...)`; upper and lower case are the same.

    Raises:
        InputError: for any other text.
    """
    match = _ATOM.fullmatch(text.strip())
    if match is None:
        raise InputError(f"found {shorten(text)}, expected an atom such as '(at cup table)'", location)
    predicate, *arguments = match.group(1).lower().split()
    return Atom(predicate, tuple(arguments))


_ATOM = re.compile(r"\(\s*([^\s()]+(?:\s+[^\s()]+)*)\s*\)")
JSON = JsonTypes({Atom: parse_atom})
"""Messages and decisions as JSON objects, and back."""


@dataclass
class Progress:
    """What has happened: facts that only ever grow.

    `pending` holds the events that may still be executed, in the order of the plan.
    """

    plan: model.TeamPlan
    now: Fraction = Fraction(0)
    times: dict[str, Fraction] = field(default_factory=dict)
    chosen: dict[str, str] = field(default_factory=dict)
    """Choices that were made or observed."""
    void: set[tuple[model.Effect, model.Condition]] = field(default_factory=set)
    """Broken causal links, as effects with conditions that they do not support any more."""
    reported: set[str] = field(default_factory=set)
    """Events that the world has decided. What has an earlier time is before them, even by less than ε, because it is
    known which came first; ε is for what is still to come."""
    pending: dict[str, None] = field(init=False)

    def __post_init__(self) -> None:
        self.structure = Structure(self.plan)
        guards = self.structure.guards
        self.pending = {event: None for event in guards if event not in self.times and self.compatible(guards[event])}

    def copy(self) -> Progress:
        """What later steps leave as it is."""
        copied = self.rewound(self.now, self.times, self.chosen)
        copied.pending = dict(self.pending)
        return copied

    def rewound(self, now: Fraction, times: Mapping[str, Fraction], chosen: Mapping[str, str]) -> Progress:
        """The progress as if only some of it had happened by now; broken links stay broken."""
        return Progress(self.plan, now, dict(times), dict(chosen), set(self.void), set(self.reported))

    def settled(self, earlier: str, later: str) -> bool:
        """Whether an event was before a reported one, by however little."""
        times = self.times
        return later in self.reported and earlier in times and later in times and times[earlier] < times[later]

    def close(self, events: Iterable[str]) -> bool:
        """Whether one of the events was reported less than ε after another one."""
        epsilon, times = self.plan.separation, self.times
        return any(
            0 < times[event] - time < epsilon for event in events if event in self.reported for time in times.values()
        )

    @property
    def moment(self) -> tuple[object, ...]:
        """What is another one whenever anything has happened, if only that time has passed."""
        return self.now, len(self.times), len(self.chosen), len(self.void)

    @property
    def grid(self) -> Fraction:
        """What all bounds of the plan and its ε are multiples of, and so all times at which anything changes."""
        return self.structure.grid

    def compatible(self, guard: model.Guard) -> bool:
        """Whether no choice is known to be otherwise."""
        return all(self.chosen.get(variable, value) == value for variable, value in guard)

    def certain(self, guard: model.Guard, given: model.Guard = model.ALWAYS) -> bool:
        """Whether the guard holds by what is known, and what is given."""
        return all(self.chosen.get(each.variable) == each.value or each in given for each in guard)

    def external(self, event: str) -> list[model.Guard]:
        """The remaining environments in which the event is not ours to execute [PIKE §3, constraint 2].

        It is not at the end of an activity, which the world reports; and as long as an uncontrollable choice that is
        made there, or that its guard mentions, has not been observed.
        """
        if any(choice not in self.chosen for choice in self.structure.awaited[event]):
            return [model.ALWAYS]
        return [label for label in self.structure.ends[event] if self.compatible(label)]

    def theirs(self, event: str, scenario: Mapping[str, str]) -> bool:
        """Whether the event is not the executive's to execute in a scenario."""
        return any(semantics.holds(label, scenario) for label in self.external(event))

    def ours(self, event: str) -> bool:
        """Whether the executive may execute the event in some scenario."""
        guard = self.structure.guards[event]
        return not any(self.certain(label, guard) for label in self.external(event))

    @property
    def frontier(self) -> Iterator[str]:
        """Pending events before which no other pending event must be executed for certain.

        Whatever pending events are not among them come, if at all, no earlier than some event that is.
        """
        return (event for event in self.pending if self.comes_next(event))

    def comes_next(self, event: str | None) -> bool:
        """Whether an event is in the :attr:`frontier`."""
        return event in self.pending and self.pending.keys().isdisjoint(self.structure.not_before[event])

    def lower_bounds(self, event: str) -> Iterator[tuple[str, Fraction]]:
        """Events with how much later the event is at least, by single constraints that hold whenever it is executed."""
        guard = self.structure.guards[event]
        for constraint in self.structure.incoming[event]:
            if constraint.lower is not None and self.certain(constraint.guard, guard):
                yield constraint.source, constraint.lower

    def blocked(self, event: str) -> bool:
        """Whether the event cannot be executed now, as far as single constraints tell that hold whenever it is."""
        return self.awaits(event) or any(
            self.now - self.times[earlier] < lower if earlier in self.times else lower > 0
            for earlier, lower in self.lower_bounds(event)
        )

    def awaits(self, event: str) -> bool:
        """Whether the event comes after one that is not the executive's to execute, whenever it is executed; as far as
        single constraints tell.
        """
        held, waiting = {event}, [event]
        while waiting:
            for earlier, lower in self.lower_bounds(waiting.pop()):
                if lower >= 0 and earlier in self.pending and earlier not in held:
                    if not self.ours(earlier):
                        return True
                    held.add(earlier)
                    waiting.append(earlier)
        return False

    def earliest(self, event: str) -> Fraction | None:
        """When single constraints to executed events allow the event; None if they allow it any time."""
        bounds = (self.times[each] + lower for each, lower in self.lower_bounds(event) if each in self.times)
        return max(bounds, default=None)


class Structure:
    """What of a plan does not change while it is executed, indexed for execution."""

    def __init__(self, plan: model.TeamPlan) -> None:
        network = plan.network
        self.guards: dict[str, model.Guard] = network.guards
        self.incoming: dict[str, list[model.Constraint]] = {event.name: [] for event in network.events}
        """Every bound on an event as a constraint whose target it is."""
        for constraint in network.temporal_constraints:
            self.incoming[constraint.target].append(constraint)
            self.incoming[constraint.source].append(_reversed(constraint))
        controllable = {choice.name: choice.controllable for choice in network.choices}
        self.made_at: dict[str, list[str]] = defaultdict(list)
        """The choices that are made at each event."""
        for choice in network.choices:
            if choice.event is not None:
                self.made_at[choice.event].append(choice.name)
        self.awaited: dict[str, tuple[str, ...]] = {
            name: tuple(
                variable
                for variable in dict.fromkeys(
                    [*(variable for variable, _ in sorted(guard)), *self.made_at.get(name, ())]
                )
                if not controllable[variable]
            )
            for name, guard in self.guards.items()
        }
        self.ends: dict[str, list[model.Guard]] = {event.name: [] for event in network.events}
        """The guards of the activities that end at each event."""
        for activity in network.activities:
            self.ends[activity.target].append(activity.guard)
        self.not_before: dict[str, tuple[str, ...]] = self._not_before()
        """Events that are executed no later than an event, whenever that is; no two are so for one another."""
        self.before = {event: tuple(self._earlier(event, above=True)) for event in self.guards}
        """Events that are executed strictly earlier than an event, whenever that is."""
        self.grid: Fraction = model.common_measure((plan.separation, *network.bounds))
        """What ε and all bounds are multiples of, and so all times at which anything becomes possible or impossible, as
        long as the reported ones are."""

    def preceding(self, event: str) -> set[str]:
        """The event, and all that are executed no later than it, whenever it is."""
        return reachable(self.not_before, event)

    def _earlier(self, event: str, *, above: bool) -> Iterator[str]:
        """Events that are put before an event, or at its time unless `above`, by single constraints, whenever it is."""
        guard = self.guards[event]
        for constraint in self.incoming[event]:
            activated, lower = constraint.guard | self.guards[constraint.source] <= guard, constraint.lower
            if activated and lower is not None and (lower > 0 or (lower == 0 and not above)):
                yield constraint.source

    def _not_before(self) -> dict[str, tuple[str, ...]]:
        earlier = {event: tuple(dict.fromkeys(self._earlier(event, above=False))) for event in self.guards}
        known = {event: reachable(earlier, event) for event in self.guards}
        return {event: tuple(each for each in earlier[event] if event not in known[each]) for event in self.guards}


def _reversed(constraint: model.Constraint) -> model.Constraint:
    lower = None if constraint.upper is None else -constraint.upper
    upper = None if constraint.lower is None else -constraint.lower
    return model.Constraint(constraint.target, constraint.source, lower, upper, constraint.guard)


class ExecutionMonitor:
    """Knows the latest planned effect on each atom, and the conditions that rely on it."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._effects: dict[str, list[model.Effect]] = defaultdict(list)
        for effect in progress.plan.effects:
            self._effects[effect.event].append(effect)
        self._conditions: dict[model.Literal, list[model.Condition]] = defaultdict(list)
        for condition in progress.plan.conditions:
            self._conditions[condition.literal].append(condition)
        self._latest: dict[Atom, model.Effect] = {}
        self._producers: dict[model.Literal, list[model.Effect]] = defaultdict(list)
        self._broken: set[model.Effect] = set()

    def executed(self, event: str) -> None:
        """Its effects are what is expected of their atoms from now on."""
        happening = [effect for effect in self._effects[event] if self._progress.certain(effect.guard)]
        # Deletions first, as PDDL has it where one activity does both.
        for effect in sorted(happening, key=lambda effect: effect.literal.positive):
            self._latest[effect.literal.atom] = effect
            self._producers[effect.literal].append(effect)

    def compare(self, estimate: Estimate) -> Iterator[tuple[Violated, list[tuple[model.Effect, model.Condition]]]]:
        """Each expectation that is contradicted and that a later condition may rely on, and the links that break."""
        for atom, effect in self._latest.items():
            absent = atom in estimate.false or (estimate.complete and atom not in estimate.true)
            contradicted = absent if effect.literal.positive else atom in estimate.true
            if contradicted and effect not in self._broken:
                producers = self._producers[effect.literal]
                links = [(producer, condition) for producer in producers for condition in self._relying(producer)]
                if links:
                    self._broken.add(effect)
                    yield self._announcement(effect, [condition for _, condition in links]), links

    def _relying(self, effect: model.Effect) -> Iterator[model.Condition]:
        for condition in self._conditions[effect.literal]:
            open_still = condition.last in self._progress.pending and self._progress.compatible(condition.guard)
            if open_still and model.may_produce(effect, condition):
                yield condition

    def _announcement(self, effect: model.Effect, conditions: Iterable[model.Condition]) -> Violated:
        consumers = (self._progress.plan.actor(condition.activity) for condition in conditions)
        return Violated(
            effect.literal.atom,
            effect.literal.positive,
            effect.event,
            tuple(dict.fromkeys(consumers)),
            self._progress.now,
        )
