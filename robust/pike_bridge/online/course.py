"""What has happened in the field, as it follows from own acts and from reports, and the plan that it shows.

Acts and reports are gone through in the order of their times, whatever order they came in. The plan that they show is
the one that somebody would have written who had known what would happen: bounds, effects that are missing or were seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction

from robust.pike_bridge import model
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.semantics import holds
from robust.plan.model import Atom

COMPLETED = said.Completion.kind()


@dataclass(frozen=True, slots=True)
class FieldNote:
    """A report that was taken: when what it says happened, and the places of the activities that it is about."""

    report: said.Report
    at: Fraction
    places: tuple[int, ...] = ()
    acts: frozenset[str] = frozenset()
    """What the executive had done when it was told."""


def outcomes(report: said.Report) -> Mapping[str, str]:
    """The values of people's choices that a report tells."""
    if isinstance(report, said.Outcome):
        return {report.choice: report.value}
    return report.outcomes if isinstance(report, said.Completion) else {}


@dataclass
class Course:
    """What has happened: at first what the executive did and chose itself."""

    plan: model.TeamPlan
    """As it was written."""
    structure: said.Structure
    times: dict[str, Fraction]
    chosen: dict[str, str]
    reported: set[str] = field(default_factory=set)
    begun: dict[int, Fraction] = field(default_factory=dict)
    ended: dict[int, tuple[str, Fraction]] = field(default_factory=dict)
    seen: list[tuple[Fraction, model.Literal]] = field(default_factory=list)
    inferred: set[str] = field(default_factory=set)
    """Choices of people that only what was seen tells."""

    def __post_init__(self) -> None:
        self._relevant = frozenset(condition.literal.atom for condition in self.plan.conditions)
        self._acts = frozenset(self.times)

    def take(self, notes: Sequence[FieldNote], held: Set[int], now: Fraction) -> None:
        """Derive what has happened by now from notes, in the order of their times.

        Args:
            held: the activities whose early end counts when their least duration is over.
        """
        notes = sorted(notes, key=lambda note: note.at)
        for note in notes:
            self.chosen |= outcomes(note.report)
        for note in notes:
            match note.report:
                case said.Outcome(choice):
                    event = next(each.event for each in self.plan.network.choices if each.name == choice)
                    if note.report.at is not None and event is not None and not self.structure.ends[event]:
                        self._backdate(event, note.at)
                case said.Began():
                    for place in note.places:
                        self.begun[place] = note.at
                        self._backdate(self.plan.network.activities[place].source, note.at)
                case said.Completion() | said.NotAchieved():
                    begun_since = self._acts - note.acts  # what began only after it was told has not ended by it
                    for place in note.places:
                        if self.plan.network.activities[place].source not in begun_since:
                            self.ended[place] = note.report.kind(), note.at
        self._note_guards()
        self._note_ends(held, now)
        self._note_guards()
        for note in notes:
            if isinstance(note.report, said.Estimate):
                self._note_seen(note.report, note)

    def _note_guards(self) -> None:
        """Guards of what has happened hold."""
        for event in self.times:
            for variable, value in self.structure.guards[event]:
                self.chosen.setdefault(variable, value)

    def _backdate(self, event: str, at: Fraction) -> None:
        """An event that the executive has not executed was at a time, and what has to be before it was before; unless
        what is known of choices excludes it."""
        if model.contradicts(model.guard(self.chosen), self.structure.guards[event]):
            return
        latest = {event: at}
        for each in self._backwards(event):
            if each in latest and each not in self.times:
                self.times[each] = max(latest[each], Fraction(0))
                self.reported.add(each)
                for bound in self.structure.incoming[each]:
                    if bound.lower is not None and bound.lower >= 0 and bound.source in self.structure.not_before[each]:
                        latest[bound.source] = min(latest.get(bound.source, at), latest[each] - bound.lower)

    def _backwards(self, event: str) -> list[str]:
        """The event and all that are not after it, each before those that it must not be after."""
        order: list[str] = []
        remaining = self.structure.preceding(event)
        while remaining:
            free = [each for each in remaining if not any(each in self.structure.not_before[o] for o in remaining)]
            order += sorted(free)
            remaining -= set(free)
        return order

    def _note_ends(self, held: Set[int], now: Fraction) -> None:
        """Events where activities end, once all that have begun and end there have ended."""
        activities = self.plan.network.activities
        in_order = sorted(self.ended, key=lambda place: self.ended[place][1])
        targets = dict.fromkeys(activities[place].target for place in in_order)
        for target in (target for target in targets if target not in self._acts):
            there = [
                place
                for place, each in enumerate(activities)
                if each.target == target and each.source in self.times and holds(each.guard, self.chosen)
            ]
            if there and all(self._has_ended(place) for place in there):
                counting = (self.counts_from(place) for place in there if place in held)
                time = max([self.ended[place][1] for place in there] + list(counting))
                if time <= now:
                    self.times[target] = time
                    self.reported.add(target)
        self.ended = {place: end for place, end in self.ended.items() if self._has_ended(place)}

    def _has_ended(self, place: int) -> bool:
        """Whether an activity that has begun, as far as is known now, has ended since."""
        begun = self.begun.get(place, self.times.get(self.plan.network.activities[place].source))
        return place in self.ended and begun is not None and begun <= self.ended[place][1]

    def facts(self, until: Fraction, later: Set[str] = frozenset()) -> dict[Atom, bool]:
        """What was true at a time of what conditions are about, by what was done and seen; not by what came later."""
        changes = sorted(self._changes_of_state(later), key=lambda change: change[:2])
        known = {literal.atom: literal.positive for time, _, literal in changes if time <= until}
        return dict.fromkeys(sorted(self._relevant), False) | known

    def _changes_of_state(self, later: Set[str]) -> Iterator[tuple[Fraction, int, model.Literal]]:
        """When literals began to hold; at one time deletions first, and what was seen last."""
        for effect in self.plan.effects:
            happened = effect.event in self.times and effect.event not in later and holds(effect.guard, self.chosen)
            if happened and effect.literal.atom in self._relevant and not self._is_lost(effect.activity, effect.event):
                yield self.times[effect.event], int(effect.literal.positive), effect.literal
        for time, literal in self.seen:
            yield time, 2, literal

    def _is_lost(self, place: int | None, event: str) -> bool:
        """Whether an activity, if given, has ended at an event without what it does and needs there."""
        if place is None or place not in self.ended or self.ended[place][0] == COMPLETED:
            return False
        return event == self.plan.network.activities[place].target

    def unexpected(self, estimate: said.Estimate, note: FieldNote) -> list[model.Literal]:
        """What conditions are about and is not as it should be."""
        later = {event for event in self._acts if self.times[event] == note.at and event not in note.acts}
        known = self.facts(note.at, later)
        seen = dict.fromkeys(estimate.true, True) | dict.fromkeys(estimate.false, False)
        if estimate.complete:
            seen = {atom: atom in estimate.true for atom in self._relevant}
        return [
            model.Literal(atom, positive)
            for atom, positive in sorted(seen.items())
            if atom in self._relevant and known[atom] != positive
        ]

    def _note_seen(self, estimate: said.Estimate, note: FieldNote) -> None:
        """What was seen otherwise than it should be; and choices of people that all its possible causes need."""
        for literal in self.unexpected(estimate, note):
            self.seen.append((note.at, literal))
            guards = [
                effect.guard | self.structure.guards[effect.event]
                for effect in self.plan.effects
                if effect.literal == literal and effect.event not in note.acts
                if effect.event not in self.reported or self.times[effect.event] > note.at
            ]
            guards = [label for label in guards if all(self.chosen.get(name, value) == value for name, value in label)]
            common = frozenset.intersection(*guards) if guards else model.ALWAYS
            for name, value in common:
                if name in self.plan.network.uncontrollable and name not in self.chosen:
                    self.chosen[name] = value
                    self.inferred.add(name)

    def as_it_shows(self, past: Set[str], now: Fraction) -> model.TeamPlan:
        """The plan as it would have been written by somebody who had known what would happen."""
        network = self.plan.network
        events = list(network.events)
        effects = [effect for effect in self.plan.effects if not self._is_lost(effect.activity, effect.event)]
        names = {event.name for event in events}
        for number, (time, literal) in enumerate(self.seen):
            name = f"seen {number}"
            while name in names:
                name += "'"
            events.append(model.Event(name))
            effects.append(model.Effect(literal, name, model.ALWAYS, None))
            self.times[name] = time
            self.reported.add(name)
        conditions = (
            condition
            for condition in self.plan.conditions
            if condition.last not in past and not self._is_lost(condition.activity, condition.last)
        )
        constraints = (each for each in network.constraints if not {each.source, each.target} <= past)
        activities = (self._with_bounds(place, now) for place in range(len(network.activities)))
        shown = replace(network, events=tuple(events), constraints=tuple(constraints), activities=tuple(activities))
        return replace(self.plan, network=shown, conditions=tuple(conditions), effects=tuple(effects))

    def _with_bounds(self, place: int, now: Fraction) -> model.Activity:
        """An activity with bounds that what happened keeps to."""
        activity = self.plan.network.activities[place]
        source, target = (self.times.get(event) for event in (activity.source, activity.target))
        if source is None:
            return activity
        late = self.begun.get(place, source) - source
        lower, upper = activity.lower + late, None if activity.upper is None else activity.upper + late
        if target is not None:
            lasted = target - source
            return replace(activity, lower=min(lower, lasted), upper=None if upper is None else max(upper, lasted))
        return replace(activity, lower=lower, upper=None if upper is None or now - source > upper else upper)

    def counts_from(self, place: int) -> Fraction:
        """When the least duration of an activity is over."""
        activity = self.plan.network.activities[place]
        return self.begun.get(place, self.times[activity.source]) + activity.lower

    def early(self) -> set[int]:
        """Activities that were completed before their least duration was over."""
        ended = self.ended.items()
        return {place for place, (how, at) in ended if how == COMPLETED and at < self.counts_from(place)}
