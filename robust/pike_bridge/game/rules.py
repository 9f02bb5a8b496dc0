"""The game that a plan with choices is: who decides what, and who sees what when.

*Nature*, people included, decides the value of each uncontrollable choice, and how long each *contingent* activity
takes within its bounds: every activity whose bounds differ, except those of agents that are *free*, which end when they
are told to. The *executive* decides when every other event happens, starts of people's activities and events of choices
included (people begin, and choose, when they are asked to), and the values of controllable choices.

- *What is seen.* The end of a contingent activity when it happens, and until then that it has not ended; the value of a
  choice at its event. Intentions and lengths are not seen beforehand.
- *Ties.* The executive may act at the moment of an observation. Several acts at one moment have an order, and a later
  one may use what an earlier one revealed; no two justify each other. "Before" is ε before, also for ends to come.
- *Guards.* An event happens only after the events of all choices in its guard, or together with them: before, it is not
  known to be wanted. Two contingent activities that end at one event cannot both be served: their ends differ for some
  lengths, whatever is done.
- *Hesitation.* None: who is asked answers at once. With a hesitation H, asking is an event of its own, and the choice
  follows within H, as nature likes. Constraints stay with the choice.
- *Rational people* choose only joint values that some correct execution has, with the most favourable lengths.

A *situation* is a value of each uncontrollable choice and a length of each contingent activity. A *strategy* maps what
has been seen by now to what happens now: if two situations have shown no difference until some time, it does the same
in both up to then. The plan is *controllable* if some strategy gives a correct execution [PIKE, Definitions 2.5 to 2.8]
in every situation. Without choices this is dynamic controllability (Morris, Muscettola and Vidal, 2001), with people's
choices alone that of conditional networks with uncertainty (Hunsberger, Posenato and Combi, 2012) with instantaneous
reaction; values that the executive chooses, supports and orders are decided by the strategy, too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from robust.errors import InputError, UnsupportedError
from robust.network.differences import Distances
from robust.pike_bridge import model
from robust.pike_bridge.model import ALWAYS, INITIAL, Activity, Choice, Constraint, Event, Guard, TeamPlan, contradicts

MOST_CASES = 512
"""Joint values of people's choices, each of which the strategy serves with a schedule of its own."""
Span = tuple[Fraction, Fraction]
"""Between which lengths."""


@dataclass(frozen=True, slots=True)
class GameRules:
    """Whose activities end when they are told to; whether people are rational; how long they hesitate at most."""

    free: tuple[str, ...] = ()
    rational: bool = False
    hesitate: Fraction | None = None


STRICT = GameRules()


@dataclass(frozen=True, slots=True)
class GameCase:
    """Values of people's choices, as far as these come up, and a span of lengths of each contingent activity."""

    values: Guard
    spans: tuple[Span, ...]


@dataclass(frozen=True, slots=True)
class Sign:
    """What a strategy can wait for before it does something.

    It is the value of a choice, or whether the contingent activity with some number takes longer than `beyond`.
    """

    choice: str | None = None
    number: int = -1
    beyond: Fraction = Fraction(0)


class Game:
    """A plan under rules; `plan` has what the rules add.

    Raises:
        InputError: if choices depend on one another in a cycle.
        UnsupportedError: if the plan is outside of what the game can say.
    """

    def __init__(self, plan: TeamPlan, rules: GameRules) -> None:
        self.rules = rules
        self.plan = _with_rules(plan, rules)
        network = self.plan.network
        self.guards = network.guards
        self.choices = {choice.name: choice for choice in network.choices}
        self.contingent = tuple(
            (place, each)
            for place, each in enumerate(network.activities)
            if each.lower != each.upper and each.agent not in rules.free
        )
        """With their places in the network."""
        self.ends = {each.target for _, each in self.contingent}
        made = {choice.event for choice in network.choices if choice.controllable}
        self.decided = tuple(event for event in self.guards if event not in self.ends or event in made)
        """Events at which the executive decides something: when, or which value."""
        ours = [each for place, each in enumerate(network.activities) if (place, each) not in self.contingent]
        self.requirements = (*network.constraints, *(each.duration for each in ours))
        self.clashes = tuple(
            one.guard | other.guard
            for (_, one), (_, other) in combinations(self.contingent, 2)
            if one.target == other.target and not contradicts(one.guard, other.guard)
        )
        """Guards under which two contingent activities end at one event."""
        self._far = 1 + sum(map(abs, network.bounds), Fraction(0))
        self._gaps: dict[Guard, Distances[str]] = {}
        self._check()

    def _check(self) -> None:
        if cycle := model.circular(self.plan.network):
            raise InputError(f"found choices that depend on one another in a cycle: {', '.join(cycle)}; expected none")
        problem = next(self._unsupported(), None)
        if problem is not None:
            raise UnsupportedError(f"controllability: {problem}")

    def _unsupported(self) -> Iterator[str]:
        if INITIAL not in self.guards:
            yield f"found no event {INITIAL}, expected one before all others"
        for choice in self.choices.values():
            if choice.event is None:
                yield f"choice {choice.name} is made at no event; expected one, at which its value is seen"
        for _, each in self.contingent:
            if self.guards[each.target] != each.guard:
                yield f"{each.target}, the end of {each.action}, can happen without it; expected an event of its own"

    @property
    def people(self) -> list[Choice]:
        """The choices that are not the executive's."""
        return [choice for choice in self.choices.values() if not choice.controllable]

    def cases(self, cuts: Sequence[tuple[int, Fraction]] = ()) -> list[GameCase]:
        """The joint values of people's choices that can come up, with lengths cut where a strategy may tell them apart.

        Raises:
            UnsupportedError: if there are too many.
        """
        values, waiting = [ALWAYS], {choice.name: choice for choice in self.people}
        while waiting:
            choice = next(each for each in waiting.values() if not self._needs(each) & waiting.keys())
            del waiting[choice.name]
            values = [extended for each in values for extended in self._extended(each, choice)]
            if len(values) > MOST_CASES:
                raise UnsupportedError(
                    f"controllability: people's choices have more than {MOST_CASES} joint values; expected fewer"
                )
        return [GameCase(each, spans) for each in values for spans in self._spans(each, cuts)]

    def _needs(self, choice: Choice) -> set[str]:
        return {variable for variable, _ in self.guards[str(choice.event)]}

    def _extended(self, values: Guard, choice: Choice) -> list[Guard]:
        known = dict(values)
        asked = all(
            self.choices[name].controllable or known.get(name) == value
            for name, value in self.guards[str(choice.event)]
        )
        return [values | {model.Assignment(choice.name, value)} for value in choice.domain] if asked else [values]

    def _spans(self, values: Guard, cuts: Sequence[tuple[int, Fraction]]) -> list[tuple[Span, ...]]:
        whole = tuple((each.lower, self.greatest(each)) for _, each in self.contingent)
        parts = [whole]
        for number, beyond in sorted(set(cuts)):
            if not contradicts(values, self.contingent[number][1].guard):
                parts = [part for one in parts for part in _cut(one, number, beyond)]
        return parts

    def greatest(self, activity: Activity) -> Fraction:
        """The greatest length; of an unbounded one a length that exceeds all that could be waited for."""
        return activity.lower + self._far if activity.upper is None else activity.upper

    def gap(self, first: str, second: str, guard: Guard) -> Fraction | None:
        """How much later the second event certainly is, wherever a guard holds; None: not certainly later."""
        if guard not in self._gaps:
            bounds = (
                (each.source, each.target, each.lower)
                for each in self.plan.network.temporal_constraints
                if each.lower is not None and each.lower >= 0 and each.guard <= guard
            )
            self._gaps[guard] = Distances(self.guards, bounds)
        known = self._gaps[guard]
        return None if known.network.schedule is None else known.least(first, second)

    def fixed(self, lengths: Sequence[Fraction]) -> TeamPlan:
        """The plan in which contingent activities take so long."""
        network = self.plan.network
        activities = list(network.activities)
        for (place, each), length in zip(self.contingent, lengths, strict=True):
            activities[place] = replace(each, lower=length, upper=length)
        return replace(self.plan, network=replace(network, activities=tuple(activities)))


def _with_rules(plan: TeamPlan, rules: GameRules) -> TeamPlan:
    """The plan with events of asking, and with its guards as orders."""
    network = plan.network
    events, asking = list(network.events), []
    for choice in network.choices if rules.hesitate is not None else ():
        if not choice.controllable and choice.event is not None:
            guard = network.guards[choice.event]
            ask = Event(asked(choice.event), guard)
            if ask not in events:
                events.append(ask)
                asking.append(
                    Activity(f"(ask {choice.name})", ask.name, choice.event, Fraction(0), rules.hesitate, None, guard)
                )
    made = {choice.name: choice.event for choice in network.choices}
    known = {Constraint(INITIAL, each.source, Fraction(0), None, each.guard) for each in asking}
    known |= {
        Constraint(str(made[variable]), event.name, Fraction(0), None, event.guard)
        for event in events
        for variable, _ in event.guard
        if made[variable] is not None and made[variable] != event.name
    }
    known -= set(network.constraints)
    constraints = (*network.constraints, *sorted(known, key=lambda each: (each.source, each.target)))
    activities = (*network.activities, *asking)
    whole = replace(network, events=tuple(events), constraints=constraints, activities=activities)
    return replace(plan, network=whole)


def asked(event: str) -> str:
    """The event at which people are asked to make the choices of an event, if they may hesitate."""
    return f"{event}?"


def _cut(spans: tuple[Span, ...], number: int, beyond: Fraction) -> list[tuple[Span, ...]]:
    """The spans, in two if a length lies inside of the numbered one."""
    low, high = spans[number]
    if not low < beyond < high:
        return [spans]
    return [(*spans[:number], part, *spans[number + 1 :]) for part in ((low, beyond), (beyond, high))]
