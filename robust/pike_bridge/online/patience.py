"""Patience: nothing that people may still decide is excluded before the last moment at which all of it can be kept.

PIKE makes its own choices as soon as it can [PIKE §3], and may restrict people by that [PIKE §2.2]. A patient executive
does what excludes nothing; an act that does not is withheld. What decides when it is not any longer:

- *Open* are the choices of others that are not known and may still come up. An *intent* assigns values to them, with
  the guards of the events at which they are made: jointly as far as these agree with each other, and singly where no
  joint one is left. It is *kept* as long as some continuation has it in which everything that is not the executive's is
  later than now.
- An act, an executable event with values of the choices that the executive makes there, *excludes* a kept intent if no
  such continuation does the act now. X are the events of which every act excludes one.
- A choice that no continuation makes before all of X is not waited for: whoever makes it waits for the executive.
- L(i), for an intent, is the greatest time at which neither its choices nor X need have happened. At the least of them
  one intent is lost by waiting. If that would be so without X, it lapses by itself. Otherwise acts are compared with
  waiting by how many intents are kept; if none keeps more, the executive waits.

L supposes that nobody hesitates later on; with a margin the executive stops waiting that much earlier.

Where several events can be executed at one time, PIKE takes any, and the paper suggests to rank them by "which event
would leave the greatest flexibility for the remainder of the execution" [PIKE §3]. *Flexibility* is what is still open:
how many values of people's open choices some continuation has that does the act now, then how many values of the team's
own open choices. What leaves the same is taken in the order of the plan. In a plan that is decided part by part only
choices of the parts under way are counted one by one; those of later parts count as far as they differ in what they
demand.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from itertools import chain, product
from math import prod
from operator import itemgetter
from typing import NamedTuple

from robust.numbers import format_number
from robust.pike_bridge.model import ALWAYS, Assignment, Guard, contradicts, guard_text
from robust.pike_bridge.online.continuations import Continuation
from robust.pike_bridge.online.progress import Excluded, Progress
from robust.pike_bridge.online.semantic import Reasoner, SemanticReasoner
from robust.pike_bridge.semantics import holds
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

JOINT = 64
"""The most joint intents that are all kept; if there are more, every single value is."""
_REMEMBERED = 96
"""Continuations."""
_FIRST = 3
"""Intents that are asked about one by one, before several are at once."""
_NAMED = 3
"""The most intents that a message names."""


@dataclass(frozen=True, slots=True)
class DueAct:
    """An event that is to be executed now, with values of the choices made there; what that excludes, if anything."""

    event: str
    values: Guard = ALWAYS
    excluded: Excluded | None = None


class Opening(NamedTuple):
    """A choice that is open and not the executive's, and the event at which it is made."""

    name: str
    domain: tuple[str, ...]
    event: str


@dataclass(frozen=True, slots=True)
class Intent:
    """Values of open choices, and the events at which they are made; `guard` has what activates these as well."""

    values: Guard
    events: frozenset[str]
    guard: Guard


@dataclass(eq=False)
class Patience:
    """What a patient executive does next, or how long it waits.

    Args:
        progress: what has happened, which others keep up to date.
        patience: how long before the last moment waiting ends; None: nothing is waited for [PIKE §3].
        reasoner: its view is asked; if it is not given, one is made when there is something to ask.
        solver: of that reasoner.
        deadline: questions raise OutOfTimeError if it passes.
        alarm_time: seconds of processor time for how long all can wait; then a lower bound will do.

    After :meth:`decide` has found nothing to do, `withheld` are the events that could be executed but are not, and
    `alarm` is when that is to be thought over if nothing happens before (None: never); `early` tells whether it is a
    lower bound of the time at which it need be.
    """

    progress: Progress
    patience: Fraction | None
    _: KW_ONLY
    reasoner: Reasoner | None = None
    solver: str = "z3"
    deadline: Deadline = NEVER
    alarm_time: float | None = None

    def __post_init__(self) -> None:
        self.margin = self.patience or Fraction(0)
        self.withheld: frozenset[str] = frozenset()
        self.alarm: Fraction | None = None
        self.early = False
        self._view: SemanticReasoner | None = None
        """What is asked; another one when other parts of the plan are under way."""
        self._found: list[Continuation] = []
        """Continuations in which everything that is not the executive's is later than now."""
        self._stale: list[Continuation] = []
        """Those at other times, which may be such continuations at later ones."""
        self._refused: set[tuple[Guard, str | None]] = set()
        """Where no such continuation is, as long as nothing happens, not even time."""
        self._moment: object = None

    def decide(self, executable: Iterable[str], alternatives: Callable[[str], Sequence[str]]) -> DueAct | None:
        """What to do now; None: nothing.

        Args:
            executable: events in the order in which they are tried, found one by one.
            alternatives: the values of each choice, in the order in which they are tried.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        self.withheld, self.alarm, self.early = frozenset(), None, False
        candidates = iter(executable)
        first = next(candidates, None)
        if first is None:
            return None
        waiting = [] if self.patience is None else openings(self.view.progress)
        if not waiting:
            return DueAct(first)
        progress = self.view.progress
        moment = progress.moment, id(progress)
        if moment != self._moment:
            self._moment, self._refused = moment, set()
        known = [] if progress.void else [*self._found, *self._stale][:_REMEMBERED]
        self._found, self._stale = [], []
        for continuation in known:
            (self._found if continuation.lasts() else self._stale).append(continuation)
        everything = kept = self._kept(waiting)
        acts: dict[str, list[Guard]] = {}
        for event in chain((first,), candidates):
            acts[event] = list(self._values(event, alternatives))
            values = self._free(event, acts[event], kept)
            if values is not None:
                return DueAct(event, values)
        while True:
            shown = {opening.event for opening in waiting if self._seen_before(opening.event, acts)}
            others = [opening.event for opening in waiting if opening.event not in shown]
            events = shown | self.view.coming_before(others, acts.keys(), self.deadline)
            reached = [opening for opening in waiting if opening.event in events]
            if len(reached) == len(waiting):
                return self._at_last(acts, kept, everything)
            waiting, kept = reached, self._kept(reached)
            for event, environments in acts.items():
                values = self._free(event, environments, kept)
                if values is not None:
                    reason = f"nobody decides {self._undecided(everything, waiting)} while this is withheld"
                    return self._announced((event, values), everything, (), reason)

    def opening(self) -> Fraction | None:
        """When something that is not withheld is executable, if nothing happens before.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return self.view.next_execution(self.withheld, self.deadline)

    # -- intents -----------------------------------------------------------------------------------------------------

    def _kept(self, choices: Sequence[Opening]) -> list[Intent]:
        """Joint intents that are kept, and single values that are in none of them but are kept by themselves."""
        kept: list[Intent] = []
        progress = self.view.progress
        for several in (intents(choices, progress), values_of(choices, progress)):
            new = [each for each in several if not any(each.values <= other.values for other in kept)]
            open_still = [each for each in new if not self._known_in(each.guard, None)]
            lost = _lost(open_still, lambda each: self._found_in(each.guard, None))
            kept += [each for each in new if each not in lost]
        return kept

    # -- acts --------------------------------------------------------------------------------------------------------

    def _values(self, event: str, alternatives: Callable[[str], Sequence[str]]) -> Iterator[Guard]:
        """The values of the executive's choices that are made at an event."""
        progress = self.progress
        made = progress.structure.made_at.get(event, ())
        choices = (choice for choice in progress.plan.network.choices if choice.controllable)
        names = [each.name for each in choices if each.name in made and each.name not in progress.chosen]
        for values in product(*map(alternatives, names)):
            yield frozenset(map(Assignment, names, values))

    def _free(self, event: str, environments: Iterable[Guard], kept: Sequence[Intent]) -> Guard | None:
        """Values with which the event excludes nothing that is kept; None if there are none."""
        return next((values for values in environments if self._keeps_all(kept, event, values)), None)

    def _keeps_all(self, kept: Sequence[Intent], event: str, values: Guard) -> bool:
        """Whether an act leaves a continuation with each of several intents, or with anything, if there are none."""
        if not kept:
            return self._keeps(ALWAYS, event, values)
        if any(contradicts(intent.guard, values) for intent in kept):
            return False
        unknown = [each for each in kept if not self._known_in(each.guard | values, event)]
        # The first choices are excluded most easily.
        return all(self._keeps(each.guard, event, values) for each in unknown[:_FIRST]) and not _lost(
            unknown[_FIRST:],
            lambda each: not contradicts(each.guard, values) and self._keeps(each.guard, event, values),
            first=True,
        )

    def _keeps(self, intent: Guard, event: str, values: Guard) -> bool:
        """Whether an act leaves a continuation with an intent."""
        both = intent | values
        return not contradicts(intent, values) and (self._known_in(both, event) or self._found_in(both, event))

    def _known_in(self, environment: Guard, event: str | None) -> bool:
        """Whether a continuation is known that shows it, perhaps at another time; those that do are looked at first."""
        for at, known in enumerate(self._found):
            if holds(environment, known.scenario) and (event is None or known.executes(event)):
                self._found.insert(0, self._found.pop(at))
                return True
        place = next((at for at, known in enumerate(self._stale) if holds(environment, known.scenario)), None)
        again = None if place is None else self._stale.pop(place).retimed(late=True)
        if again is None:
            return False
        self._found.insert(0, again)
        return event is None or again.executes(event)

    def _found_in(self, environment: Guard, event: str | None) -> bool:
        """Whether the solver finds a continuation that shows it."""
        if (environment, event) in self._refused:
            return False
        continuation = self.view.continuation(environment, event, self.deadline)
        if continuation is None:
            self._refused.add((environment, event))
            return False
        self._found.insert(0, continuation)
        return True

    # -- waiting -----------------------------------------------------------------------------------------------------

    def _at_last(self, acts: Mapping[str, list[Guard]], kept: list[Intent], everything: list[Intent]) -> DueAct | None:
        """Wait, unless that loses more than an act does."""
        now, withheld = self.progress.now, frozenset(acts)
        staying = self._waits(kept, withheld, now + self.margin)
        if len(staying) == len(kept):
            least = self._least_in_time(staying, withheld)
            self.withheld, self.alarm = withheld, None if least is None else least - self.margin
            return None
        due = {
            intent: self.view.latest(intent.guard, intent.events | withheld, self.deadline) or now
            for intent in kept
            if intent not in staying
        }
        contested = [each for each, last in due.items() if self._waits([each], frozenset(), last)]
        over = min(due.values())
        act = self._best(acts, [*staying, *contested], len(staying))
        if act is None:
            self.withheld, self.alarm = withheld, self._over(withheld, staying, over)
            return None
        spared = [intent.values for intent in contested if self._keeps(intent.guard, *act)]
        return self._announced(act, everything, spared, _hurry(self._texts(spared), over))

    def _best(
        self, acts: Mapping[str, list[Guard]], intents: Sequence[Intent], staying: int
    ) -> tuple[str, Guard] | None:
        """The act that keeps most intents; None if waiting keeps as many, and does not lose everything."""

        def worth(act: tuple[str, Guard]) -> tuple[bool, int]:
            number = sum(self._keeps(intent.guard, *act) for intent in intents)
            return number > 0 or self._keeps(ALWAYS, *act), number

        best = max(((event, values) for event, several in acts.items() for values in several), key=worth)
        if worth(best)[1] > staying:
            return best
        if staying or self.view.all_later(ALWAYS, acts.keys(), self.progress.now, self.deadline) is not None:
            return None
        return best

    def _waits(
        self, intents: Iterable[Intent], others: frozenset[str], moment: Fraction
    ) -> dict[Intent, Fraction | None]:
        """The intents that may come after a moment, together with other events, and how late they may at least; None if
        they can wait forever.
        """
        waits = {each: self._known_wait(each, others, moment) for each in intents}
        short = [each for each, wait in waits.items() if wait is not None and wait <= moment]
        lost = _lost(short, lambda each: self._later(each, others, moment) is not None)
        waits |= {each: self._known_wait(each, others, moment) for each in short}
        return {each: wait for each, wait in waits.items() if each not in lost}

    def _known_wait(self, intent: Intent, others: frozenset[str], moment: Fraction) -> Fraction | None:
        """How long an intent and other events can wait, as far as known continuations tell; a moment, if not longer;
        None: forever.
        """
        longest = moment
        for known in self._found:
            if holds(intent.guard, known.scenario):
                wait = known.latest(intent.events | others)
                if wait is None:
                    return None
                longest = max(longest, wait)
        return longest

    def _later(
        self, intent: Intent, others: frozenset[str], moment: Fraction, *, beyond: bool = True
    ) -> Continuation | None:
        """A continuation that the solver finds in which an intent and other events are after a moment; unless `beyond`,
        they may be at that moment.
        """
        found = self.view.all_later(intent.guard, intent.events | others, moment, self.deadline, beyond=beyond)
        again = None if found is None else found.retimed(late=True)
        if again is not None:
            self._found.insert(0, again)
        return found

    def _seen_before(self, event: str, withheld: Collection[str]) -> bool:
        """Whether an event happens before each of those that are withheld in a known continuation."""
        guard = self.view.progress.structure.guards[event]
        schedules = (each.schedule for each in self._found if holds(guard, each.scenario))
        return any(
            all(schedule[other] > schedule[event] for other in withheld if other in schedule) for schedule in schedules
        )

    def _least_in_time(self, waits: Mapping[Intent, Fraction | None], withheld: frozenset[str]) -> Fraction | None:
        """The least L of intents that can all wait, or a time before which all can wait, if that takes too long."""
        everything, self.deadline = self.deadline, self.deadline.within(self.alarm_time)
        try:
            return self._least(waits, withheld)
        except OutOfTimeError as stopped:
            if self.alarm_time is None or stopped.reason is not None:
                raise
            everything.enforce()
        finally:
            self.deadline = everything
        self.early = True
        soon = self.progress.now + self.margin + self.progress.grid
        known = (self._known_wait(each, withheld, soon) for each in waits)
        return min((wait for wait in known if wait is not None), default=None)

    def _least(self, waits: Mapping[Intent, Fraction | None], withheld: frozenset[str]) -> Fraction | None:
        """The least L of intents, given how late each can be at least; None if all can wait forever."""
        bounded = [(wait, each) for each, wait in waits.items() if wait is not None]
        left = [each for _, each in sorted(bounded, key=itemgetter(0))]  # the first is likely to have the least
        least: Fraction | None = None
        while left:
            longest = self._longest(left.pop(0), withheld)
            least = min((each for each in (least, longest) if each is not None), default=None)
            if least is not None:
                left = self._shorter(left, withheld, least)
        return least

    def _longest(self, intent: Intent, withheld: frozenset[str]) -> Fraction | None:
        """L of one intent."""
        wait = self._known_wait(intent, withheld, self.progress.now)
        while wait is not None:
            later = self._later(intent, withheld, wait)
            if later is None:
                return wait
            wait = later.latest(intent.events | withheld)
        return None

    def _shorter(self, intents: Iterable[Intent], withheld: frozenset[str], moment: Fraction) -> list[Intent]:
        """The intents whose L is before a moment, in their order."""
        waits = ((each, self._known_wait(each, withheld, self.progress.now)) for each in intents)
        short = [each for each, wait in waits if wait is not None and wait < moment]
        lost = _lost(short, lambda each: self._later(each, withheld, moment, beyond=False) is not None)
        return [each for each in short if each in lost]

    def _over(self, withheld: frozenset[str], staying: Mapping[Intent, Fraction | None], over: Fraction) -> Fraction:
        """Just after a moment at which intents lapse, unless it is time for the others before."""
        alarm = over + self.progress.grid
        least = self._least(staying, withheld) if self.margin else None
        return alarm if least is None else min(alarm, least - self.margin)

    # -- words -------------------------------------------------------------------------------------------------------

    def _announced(
        self, act: tuple[str, Guard], everything: Sequence[Intent], spared: Sequence[Guard], reason: str
    ) -> DueAct:
        """An act with what it excludes, and what is spared by it."""
        event, values = act
        progress = self.view.progress
        lost = [intent.values for intent in everything if not self._keeps(intent.guard, event, values)]
        named = frozenset[Assignment]().union(*lost)
        single = [
            each.values
            for each in values_of(openings(progress), progress)
            if each.values <= named and not self._keeps(each.guard, event, values)
        ]
        joint = [each for each in lost if not any(value <= each for value in single)]
        excluded, kept = self._texts([*single, *joint]), self._texts(spared)
        return DueAct(event, values, Excluded(event, self.progress.now, excluded, kept, reason) if excluded else None)

    def _texts(self, values: Iterable[Guard]) -> tuple[str, ...]:
        """Values of choices in words."""
        meant = (meaning for each in values for meaning in self._meaning(each))
        return tuple(dict.fromkeys(guard_text(each) for each in meant))

    def _meaning(self, values: Guard) -> list[Guard]:
        return [values] if self.reasoner is None else self.reasoner.meaning(values)

    def _undecided(self, everything: Sequence[Intent], waiting: Sequence[Opening]) -> str:
        left = [
            frozenset(each for each in intent.values if each.variable not in {one.name for one in waiting})
            for intent in everything
        ]
        names = {variable for each in left for meaning in self._meaning(each) for variable, _ in meaning}
        return " or ".join(sorted(names)) or "anything"

    # -- helpers -----------------------------------------------------------------------------------------------------

    @property
    def view(self) -> SemanticReasoner:
        """The reasoning about what is under way, which knows all that has happened."""
        if self.reasoner is None:
            self.reasoner = SemanticReasoner(self.progress, solver=self.solver)
        view = self.reasoner.under_way()
        if self._view is not view:
            self._view, self._found, self._stale = view, [], []
        return view


def openings(progress: Progress) -> list[Opening]:
    """The choices that are open and not the executive's."""
    return [
        Opening(choice.name, choice.domain, choice.event)
        for choice in progress.plan.network.choices
        if not choice.controllable
        and choice.name not in progress.chosen
        and choice.event is not None
        and choice.event in progress.pending
    ]


def intents(choices: Sequence[Opening], progress: Progress) -> list[Intent]:
    """What people may mean: joint values of choices, as many as can be made together, so that each value is in one.

    Choices that are not made together, because of the guards of their events, are in different intents. If there are
    more than :data:`JOINT`, each value is an intent of its own.
    """
    single = values_of(choices, progress)
    if prod(len(choice.domain) for choice in choices) > JOINT:
        return single
    maximal: dict[Intent, None] = {}
    for start in single:
        if not any(start.values <= intent.values for intent in maximal):
            joint = [start]
            for choice in choices:
                joint = [more for each in joint for more in _extended(each, choice, progress)]
            maximal.update(dict.fromkeys(joint))
    return list(maximal)


def _lost(several: Sequence[Intent], keeps: Callable[[Intent], bool], *, first: bool = False) -> set[Intent]:
    """The intents that something does not keep, which keeps all parts of what it keeps; only the `first`, if so wanted.

    It is asked about as many at once as can be meant together, and about halves of them where that is too much.
    """
    lost: set[Intent] = set()
    left = _together(several)
    while left:
        joint, members = left.pop()
        if keeps(joint):
            continue
        if len(members) == 1:
            lost.update(members)
            if first:
                break
        middle = (len(members) + 1) // 2
        left += [*_together(members[:middle]), *_together(members[middle:])] if len(members) > 1 else []
    return lost


def _together(several: Iterable[Intent]) -> list[tuple[Intent, list[Intent]]]:
    """Intents that can be meant together, joined; with what each of them is made of."""
    groups: list[tuple[Intent, list[Intent]]] = []
    for intent in several:
        for at, (joint, members) in enumerate(groups):
            if not contradicts(joint.guard, intent.guard):
                values, events, label = (
                    joint.values | intent.values,
                    joint.events | intent.events,
                    joint.guard | intent.guard,
                )
                groups[at] = Intent(values, events, label), [*members, intent]
                break
        else:
            groups.append((intent, [intent]))
    return groups


def values_of(choices: Iterable[Opening], progress: Progress) -> list[Intent]:
    """Each value of each choice, where the choice may still come up."""
    nothing = Intent(ALWAYS, frozenset(), ALWAYS)
    extended = (each for choice in choices for each in _extended(nothing, choice, progress) if each != nothing)
    return [each for each in extended if progress.compatible(each.guard)]


def _extended(intent: Intent, choice: Opening, progress: Progress) -> list[Intent]:
    """An intent with each value of one more choice; the intent itself if it has one, or the two exclude each other."""
    extended = []
    if choice.name not in dict(intent.values):
        for value in choice.domain:
            values = frozenset({Assignment(choice.name, value)})
            label = values | progress.structure.guards[choice.event]
            if not contradicts(values, label) and not contradicts(intent.guard, label):
                extended.append(Intent(intent.values | values, intent.events | {choice.event}, intent.guard | label))
    return extended or [intent]


def _hurry(spared: Sequence[str], over: Fraction) -> str:
    """Why an act cannot be put off beyond a moment."""
    moment = format_number(over)
    if not spared:
        return f"nothing correct would be left after {moment}"
    named = list(spared[:_NAMED])
    more = [f"{len(spared) - _NAMED} more"] if len(spared) > _NAMED else []
    return f"after {moment} it would be too late for {' and for '.join([*named, *more])}"


# -- flexibility -------------------------------------------------------------------------------------------------------

Flexibility = tuple[int, int]
"""How many values of people's open choices are left, and of the team's."""


def ranked_events(events: Sequence[str], view: SemanticReasoner, deadline: Deadline) -> Sequence[str]:
    """Executable events, those first that leave the most.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    left = {event: flexibility(view, event, frozenset(), deadline) for event in events}
    return sorted(events, key=lambda event: left[event], reverse=True)


def ranked_values(choice: str, values: Sequence[str], view: SemanticReasoner, deadline: Deadline) -> Sequence[str]:
    """Values of one of the team's choices, those first that leave the most.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    if choice not in view.progress.plan.network.domains:
        return values
    made = {value: frozenset({Assignment(choice, value)}) for value in values}
    left = {value: flexibility(view, None, made[value], deadline) for value in values}
    return sorted(values, key=lambda value: left[value], reverse=True)


def flexibility(view: SemanticReasoner, event: str | None, made: Guard, deadline: Deadline) -> Flexibility:
    """What is left open if an event, if given, is executed now, and choices are made as given.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    view.catch_up()

    def left(environments: Iterable[Guard]) -> int:
        return sum(view.continuation(each | made, event, deadline) is not None for each in environments)

    progress = view.progress
    people = (intent.guard for intent in values_of(openings(progress), progress))
    return left(people), left(_own(view, {variable for variable, _ in made}))


def _own(view: SemanticReasoner, made: set[str]) -> Iterator[Guard]:
    """Each value of each open choice of the team but those that are made."""
    progress = view.progress
    guards = progress.structure.guards
    for choice in progress.plan.network.choices:
        if choice.controllable and choice.name not in progress.chosen and choice.name not in made:
            where = frozenset[Assignment]() if choice.event is None else guards[choice.event]
            for value in choice.domain:
                yield where | {Assignment(choice.name, value)}
