"""Temporal plan networks with choices (TPNU) and the conditions and effects of their activities, as frozen data.

Source: [PIKE, Definitions 2.1 to 2.9]. Times are exact, in the time unit of the plan.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from math import gcd, lcm
from operator import or_
from typing import Final, NamedTuple, TypeAlias

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import plural, shorten
from robust.plan.model import Atom

INITIAL = "e_initial"
"""The event at which the initial state is established; every other event is later."""
GOAL = "e_goal"
"""The event at which the goal must hold; every other event is earlier."""
EPSILON = Fraction(1, 1000)
"""How much earlier is "before", for a producer, its consumer and what threatens them, unless it is given."""


_GROUND_ACTION = re.compile(r"\( *[^ ()]+(?: +[^ ()]+)* *\)")
_CONTROL_CHARACTER = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")
PROPER_NAME = "a text that is not empty and has no control characters"
PROPER_ACTION = "a ground action such as '(get human mug)'"


def is_name(text: str) -> bool:
    """Whether it is a :data:`PROPER_NAME`: messages of one line show names."""
    return bool(text) and _CONTROL_CHARACTER.search(text) is None


def as_ground_action(text: str) -> str | None:
    """A ground action in lower case with single blanks; None if it is none."""
    if not is_name(text) or not _GROUND_ACTION.fullmatch(text):
        return None
    return f"({' '.join(word for word in text.lower().strip('()').split(' ') if word)})"


class Assignment(NamedTuple):
    """`variable = value`, of a choice variable."""

    variable: str
    value: str

    def __str__(self) -> str:
        return f"{self.variable} = {self.value}"


Guard: TypeAlias = frozenset[Assignment]
"""A conjunction of assignments; the empty guard is true [PIKE, Definition 2.3]."""

ALWAYS: Guard = frozenset()


def guard(assignments: Mapping[str, str]) -> Guard:
    """The conjunction of `variable = value` for each entry."""
    return frozenset(Assignment(variable, value) for variable, value in assignments.items())


def guard_text(conjunction: Guard) -> str:
    """For messages and drawings: `x = 1, y = 2`, sorted; the empty guard as an empty text."""
    return ", ".join(str(assignment) for assignment in sorted(conjunction))


def contradicts(one: Guard, other: Guard) -> bool:
    """Whether no scenario entails both: some choice has different values in them."""
    values = dict(one)
    return any(values.get(variable, value) != value for variable, value in other)


@dataclass(frozen=True, slots=True)
class Likelihood:
    """How likely the values of an uncontrollable choice are where a guard holds."""

    values: tuple[tuple[str, Fraction], ...]
    """Each value of the choice with its probability; they add up to 1."""
    guard: Guard = ALWAYS


@dataclass(frozen=True, slots=True)
class Choice:
    """A choice variable, decided by the executive (controllable) or by a human or nature, at an event at the latest."""

    name: str
    domain: tuple[str, ...]
    controllable: bool
    event: str | None
    """variable-at-event [PIKE, Definition 2.1]; None for variables of augmented plans, which no event decides."""
    probability: tuple[Likelihood, ...] = ()
    """The first row whose guard holds counts, and the last one always does; none: nothing is known."""


@dataclass(frozen=True, slots=True)
class Event:
    """A point in time, which is scheduled if and only if its guard holds."""

    name: str
    guard: Guard = ALWAYS


@dataclass(frozen=True, slots=True)
class Constraint:
    """If the guard holds, lower ≤ t(target) − t(source) ≤ upper; None is no bound on that side."""

    source: str
    target: str
    lower: Fraction | None
    upper: Fraction | None
    guard: Guard = ALWAYS

    @property
    def upper_bounds(self) -> Iterator[tuple[str, str, Fraction]]:
        """What it says as upper bounds: an event, another one, and how much later than the first that is at most."""
        if self.upper is not None:
            yield self.source, self.target, self.upper
        if self.lower is not None:
            yield self.target, self.source, -self.lower


@dataclass(frozen=True, slots=True)
class Activity:
    """A ground action from `source` to `target`, which takes between `lower` and `upper`, if the guard holds."""

    action: str
    """As PDDL writes it, in lower case: `(get human mug)`."""
    source: str
    target: str
    lower: Fraction
    upper: Fraction | None
    agent: str | None = None
    guard: Guard = ALWAYS
    location: Location | None = field(default=None, compare=False)

    @property
    def duration(self) -> Constraint:
        """The temporal constraint of the activity."""
        return Constraint(self.source, self.target, self.lower, self.upper, self.guard)


@dataclass(frozen=True, slots=True)
class Tpnu:
    """A temporal plan network under uncertainty ⟨V, E, C, A⟩ [PIKE, Definition 2.1]."""

    name: str
    choices: tuple[Choice, ...]
    events: tuple[Event, ...]
    constraints: tuple[Constraint, ...]
    activities: tuple[Activity, ...]

    @property
    def temporal_constraints(self) -> tuple[Constraint, ...]:
        """All of them, the durations of activities included."""
        return self.constraints + tuple(activity.duration for activity in self.activities)

    @property
    def bounds(self) -> list[Fraction]:
        """The bounds of all temporal constraints, but for those that are 0."""
        return [bound for each in self.temporal_constraints for bound in (each.lower, each.upper) if bound]

    @property
    def domains(self) -> dict[str, tuple[str, ...]]:
        """The values of each choice variable."""
        return {choice.name: choice.domain for choice in self.choices}

    @property
    def uncontrollable(self) -> tuple[str, ...]:
        """The choices of people and nature."""
        return tuple(choice.name for choice in self.choices if not choice.controllable)

    @property
    def guards(self) -> dict[str, Guard]:
        """The guard of each event."""
        return {event.name: event.guard for event in self.events}


def circular(network: Tpnu) -> dict[str, set[str]]:
    """Choices that depend on themselves, through the guards of events where choices are made, and what each needs."""
    guards = network.guards
    needs = {
        choice.name: set() if choice.event is None else {variable for variable, _ in guards[choice.event]}
        for choice in network.choices
    }
    while free := {name for name, needed in needs.items() if not needed}:
        needs = {name: needed - free for name, needed in needs.items() if name not in free}
    return needs


def check_choice(
    domains: Mapping[str, Sequence[str]], name: str, value: str | None = None, place: Location | None = None
) -> None:
    """InputError, at a place, unless there is such a choice, and it can have the value, if one is given."""
    if name not in domains:
        suggestion = did_you_mean(name, domains)
        raise InputError(f"found unknown choice {shorten(name)}, expected one of the plan{suggestion}", place)
    if value is not None and value not in domains[name]:
        raise InputError(f"found {name} = {shorten(value)}, expected one of {', '.join(domains[name])}", place)


@dataclass(frozen=True, slots=True, order=True)
class Literal:
    """A ground atom that is true or false."""

    atom: Atom
    positive: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.positive else f"(not {self.atom})"

    @property
    def negation(self) -> Literal:
        return Literal(self.atom, not self.positive)


@dataclass(frozen=True, slots=True)
class Condition:
    """A literal that must hold, if the guard does, just before `first` and until just before `last`.

    For conditions at the start or at the end of an activity the two events are the same; for conditions over all of an
    activity they are its start and its end.
    """

    literal: Literal
    first: str
    last: str
    guard: Guard
    activity: int | None
    """The place in `Tpnu.activities` of the activity that has the condition; None for the goal."""


@dataclass(frozen=True, slots=True)
class Effect:
    """A literal that holds from an event on, if the guard holds, until another effect contradicts it."""

    literal: Literal
    event: str
    guard: Guard
    activity: int | None
    """The place in `Tpnu.activities` of the activity that has the effect; None for the initial state."""


@dataclass(frozen=True, slots=True)
class TeamPlan:
    """A TPNU with what its activities need and do; the initial state and the goal are effects and conditions, too.

    A condition is met if some activated effect with its literal, the producer, is before `first`, and each activated
    effect with the opposite literal, a threat, is before the producer or after `last` [PIKE §4.3]. Before is at least ε
    before or, if ε is 0, strictly before. Two things do not threaten a condition: effects of the same activity at the
    event `last`; and, for a condition over all, the effects that the same activity has at `first` may also be its
    producer.
    """

    network: Tpnu
    conditions: tuple[Condition, ...]
    effects: tuple[Effect, ...]
    epsilon: Fraction = EPSILON

    def __repr__(self) -> str:
        sizes = plural(len(self.network.choices), "choice"), plural(len(self.network.events), "event")
        return f"<plan {self.name!r}: {', '.join(sizes)}>"

    @property
    def name(self) -> str:
        """The name of the network."""
        return self.network.name

    def actor(self, activity: int | None, otherwise: str = "the goal") -> str:
        """The action that has a condition or an effect, by the activity's place; what it is of otherwise."""
        return otherwise if activity is None else self.network.activities[activity].action

    @property
    def separation(self) -> Fraction:
        """ε or, if that is 0, so little that just those scenarios have executions which are separated by it.

        In the plan's unit of time.

        All bounds are multiples of some number g. A cycle of bounds and orders visits each event once at most, so that
        its orders are possible, strictly, if and only if its bounds leave g, which is more than all orders need.
        """
        if self.epsilon:
            return self.epsilon
        return (common_measure(self.network.bounds) or Fraction(1)) / (len(self.network.events) + 1)


def common_measure(numbers: Iterable[Fraction]) -> Fraction:
    """The greatest number that all numbers are multiples of; 0 if there is none that is not 0."""
    known = tuple(numbers)
    denominator = lcm(*(each.denominator for each in known))
    return Fraction(gcd(*(int(each * denominator) for each in known)), denominator)


def may_produce(effect: Effect, condition: Condition) -> bool:
    """Whether the effect can support the condition in some order of the events, whatever the network says."""
    if effect.literal != condition.literal:
        return False
    return effect.event not in {condition.first, condition.last} or starts_with(effect, condition)


def starts_with(effect: Effect, condition: Condition) -> bool:
    """Whether the condition is over all of an activity whose own effect at its start this is."""
    return condition.first != condition.last and effect.event == condition.first and _is_own(effect, condition)


def may_threaten(effect: Effect, condition: Condition) -> bool:
    """Whether the effect contradicts the condition and is not one of those that cannot harm it."""
    if effect.literal != condition.literal.negation:
        return False
    return not (_is_own(effect, condition) and effect.event == condition.last)


def _is_own(effect: Effect, condition: Condition) -> bool:
    """Whether one activity has both."""
    return effect.activity is not None and effect.activity == condition.activity


Environment: TypeAlias = int
"""A conjunction of assignments, as a bit mask of some :class:`AssignmentVocabulary`."""

EMPTY: Final[Environment] = 0
"""The environment that assigns nothing: true."""


def entails(specific: Environment, general: Environment) -> bool:
    """Whether every scenario of the first environment is one of the second's."""
    return specific & general == general


def union(environments: Iterable[Environment]) -> Environment:
    """All the bits of some environments, which need not be consistent with each other."""
    return reduce(or_, environments, EMPTY)


class AssignmentVocabulary:
    """The assignments to a fixed list of variables, and their environments."""

    def __init__(self, domains: Mapping[str, Sequence[str]]) -> None:
        self.variables: Final = tuple(domains)
        self.domains: Final = {variable: tuple(values) for variable, values in domains.items()}
        self.assignments: Final = tuple(
            Assignment(variable, value) for variable, values in self.domains.items() for value in values
        )
        self.width: Final = len(self.assignments)
        self.made: Final = (1 << self.width) - 1
        """The bits of assignments made, without those of assignments excluded."""
        self._bits: dict[Assignment, Environment] = {}
        self._fields: dict[str, int] = {}
        position = 0
        for variable, values in self.domains.items():
            self._fields[variable] = field = (1 << len(values)) - 1 << position
            for value in values:
                self._bits[Assignment(variable, value)] = 1 << position | (field ^ 1 << position) << self.width
                position += 1

    def assign(self, variable: str, value: str) -> Environment:
        """The environment of one assignment; KeyError if there is no such assignment."""
        return self._bits[Assignment(variable, value)]

    def field(self, variable: str) -> int:
        """The bits of all assignments to a variable, among `made`."""
        return self._fields[variable]

    def encode(self, assignments: Guard | Iterable[Assignment]) -> Environment:
        """The conjunction of assignments, which may be inconsistent; KeyError for an unknown one."""
        return union(self._bits[assignment] for assignment in assignments)

    def decode(self, environment: Environment) -> Guard:
        """The assignments that an environment makes."""
        return frozenset(self.assignments[position] for position in bits(environment & self.made))

    def consistent(self, environment: Environment) -> bool:
        """Whether no variable has two values."""
        return not environment & environment >> self.width & self.made

    def assigned(self, environment: Environment) -> tuple[str, ...]:
        """The variables that have a value, in the order of the vocabulary."""
        return tuple(self.assignments[position].variable for position in bits(environment & self.made))

    def mentions(self, environment: Environment, variable: str) -> bool:
        """Whether the environment assigns the variable."""
        return bool(environment & self._fields[variable])

    def without(self, environment: Environment, variable: str) -> Environment:
        """The environment with the assignment to a variable, if any, removed."""
        field = self._fields[variable]
        return environment & ~(field | field << self.width)


def bits(mask: int) -> Iterator[int]:
    """The positions of the bits that are set, from the lowest."""
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
