"""Random worlds that report everything: late, twice, wrongly, taken back; and by brute force what is left at each step.

    python -m tests.pike_bridge.online.field_worlds [FIRST [COUNT]]

What has happened is told here once more, by the words of docs/executives.md, without the code of executives; what is
left is found by trying each producer of each condition, and each side of each threat. All times are multiples of ε.
"""

import sys
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from operator import itemgetter
from random import Random

from robust.pike import FieldExecutive, JournalStep
from robust.pike_bridge.model import ALWAYS, Effect, Event, Literal, guard
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.semantic import SemanticReasoner
from tests.pike_bridge.brute_force import extending, holds
from tests.pike_bridge.online.examples import contested

QUARTER = Fraction(1, 4)
KINDS = (
    *(
        each.kind()
        for each in (said.Outcome, said.Began, said.Completion, *said.NOT_ACHIEVED, said.Estimate, said.Retract)
    ),
    *("late", "repeated", "rejected"),
)
"""What is counted of messages."""


def decided_in_time(random, *, effects=False):
    """A small plan with correct executions; it is known, as in files, whether activities take place when they begin.

    Args:
        effects: whether it is known as well, as in files, which effects an event has when it happens.
    """
    while True:
        plan = contested(random.randint(0, 4000))
        guards = plan.network.guards
        known = all(activity.guard <= guards[activity.source] for activity in plan.network.activities)
        if effects and not all(each.guard <= guards[each.event] for each in plan.effects):
            continue
        if known and plan.network.activities and correct_scenarios(plan, {}, {}, Fraction(0)):
            return plan


# -- what is left ------------------------------------------------------------------------------------------------------


class Distances:
    """The greatest t(second) − t(first) for each pair of events, in units of ε; `None` is time 0."""

    def __init__(self, events):
        self.events, self.most, self.consistent = (None, *events), {}, True

    def copy(self):
        other = Distances(())
        other.events, other.most, other.consistent = self.events, dict(self.most), self.consistent
        return other

    def at_most(self, first, second, bound):
        if first == second:
            self.consistent &= bound >= 0
        elif bound < self.most.get((first, second), bound + 1):
            into = [(a, d) for a in self.events if (d := self._get(a, first)) is not None]
            onwards = [(b, d) for b in self.events if (d := self._get(second, b)) is not None]
            for a, before in into:
                for b, after in onwards:
                    length = before + bound + after
                    if a == b:
                        self.consistent &= length >= 0
                    elif length < self.most.get((a, b), length + 1):
                        self.most[a, b] = length
        return self

    def _get(self, first, second):
        return 0 if first == second else self.most.get((first, second))


def correct_scenarios(plan, chosen, times, now):
    """The scenarios with what was chosen of which a correct execution has the times, and all else now or later."""
    return [
        scenario for scenario in map(dict, extending(plan.network, guard(chosen))) if left(plan, scenario, times, now)
    ]


def left(plan, scenario, times, now):
    def units(number):
        scaled = number / plan.separation
        assert scaled.denominator == 1, number
        return scaled.numerator

    network = plan.network
    known = Distances(event.name for event in network.events if holds(event.guard, scenario))
    for event in known.events[1:]:
        known.at_most(event, None, -units(times.get(event, now)))
        if event in times:
            known.at_most(None, event, units(times[event]))
    for each in network.temporal_constraints:
        if {each.source, each.target} <= set(known.events) and holds(each.guard, scenario):
            if each.upper is not None:
                known.at_most(each.source, each.target, units(each.upper))
            if each.lower is not None:
                known.at_most(each.target, each.source, -units(each.lower))
    effects = [each for each in plan.effects if each.event in known.events and holds(each.guard, scenario)]
    conditions = [each for each in plan.conditions if holds(each.guard, scenario)]
    return known.consistent and _met(conditions, effects, known)


def _met(conditions, effects, known):
    """Whether the conditions can be met one after the other, each by some producer."""
    if not conditions:
        return True
    condition, *others = conditions

    def own(effect, event):
        return condition.activity is not None and (effect.activity, effect.event) == (condition.activity, event)

    threats = [e.event for e in effects if e.literal == condition.literal.negation and not own(e, condition.last)]
    for producer in (each for each in effects if each.literal == condition.literal):
        starts = condition.first != condition.last and own(producer, condition.first)
        ordered = known if starts else known.copy().at_most(condition.first, producer.event, -1)
        if ordered.consistent and _without(threats, producer.event, condition, others, effects, ordered):
            return True
    return False


def _without(threats, producer, condition, others, effects, known):
    """Whether each threat can be before the producer or after the condition, and the other conditions can be met."""
    if not threats:
        return _met(others, effects, known)
    threat, *more = threats
    for first, second in ((producer, threat), (threat, condition.last)):
        ordered = known.copy().at_most(first, second, -1)
        if ordered.consistent and _without(more, producer, condition, others, effects, ordered):
            return True
    return False


# -- what has happened -------------------------------------------------------------------------------------------------


class Account:
    """What has happened, by all that was reported and done."""

    def __init__(self, plan, *, waits):
        self.plan, self.waits = plan, waits
        self.acts, self.own, self.notes = {}, {}, []
        self.past, self.held, self.judged = frozenset(), set(), set()
        self.inferred = {}

    def hear(self, now, messages, decisions):
        """Messages that were taken, and what was done thereupon."""
        refused = Counter(each.message for each in decisions if isinstance(each, said.Rejected))
        for message in messages:
            if refused[str(message)]:
                refused[str(message)] -= 1
            elif isinstance(message, said.Retract):
                self.notes.remove(next(note for note in reversed(self.notes) if note[1] == message.message))
            else:
                at = now if message.at is None else message.at
                self.notes.append((at, message, set(self.acts)))
        self._judge_early_ends(now)
        for decision in decisions:
            match decision:
                case said.Resumed(_, released):
                    self.past = frozenset(self.course(now).times)
                    self.own = {name: value for name, value in self.own.items() if name not in released}
                case said.Executed(event, time, False):
                    self.acts[event] = time
                case said.Chosen(choice, value, _, False):
                    self.own[choice] = value

    def _judge_early_ends(self, now):
        """They count at once if something is left then or nothing is left anyway, else when the least time is over."""
        early = self.course(now).early
        new, self.judged = early - self.judged, early | self.held
        if new and (self.waits or not self.scenarios(now)):
            self.held |= new
            if not self.waits and not self.scenarios(now):
                self.held -= new

    def infer(self, now, chosen):
        """Take over what was inferred from what was seen."""
        self.inferred = {}
        course = self.course(now)
        self.inferred = {name: value for name, value in chosen.items() if name not in course.chosen}
        assert self.inferred.items() <= course.inferred.items()

    def scenarios(self, now):
        course = self.course(now)
        return correct_scenarios(course.shown, course.chosen, course.times, now)

    def mended(self, now):
        """What is left from here on, whatever has happened."""
        past, own = self.past, self.own
        self.past = frozenset(self.course(now).times)
        acted_upon = {
            name for event, label in self.plan.network.guards.items() if event in self.past for name, _ in label
        }
        self.own = {name: value for name, value in own.items() if name in acted_upon}
        found = self.scenarios(now)
        self.past, self.own = past, own
        return found

    def course(self, now):
        return _Course(self, now)


class _Course:
    def __init__(self, account, now):
        plan = account.plan
        self.plan, self.network, self.guards = plan, plan.network, plan.network.guards
        self.times, self.chosen, self.begun, self.ended = dict(account.acts), dict(account.own), {}, {}
        notes = sorted(account.notes, key=itemgetter(0))
        for _, note, _ in notes:
            if isinstance(note, said.Outcome | said.Completion):
                self.chosen |= {note.choice: note.value} if isinstance(note, said.Outcome) else note.outcomes
        for at, note, acts in notes:
            self._note(at, note, account.acts.keys() - acts)
        self._hold_guards()
        self._end(account, now)
        self.early = {
            place
            for place, (at, completed) in self.ended.items()
            if completed and at < self._since(place) + self.network.activities[place].lower
        }
        self._hold_guards()
        self.seen, self.inferred = [], {}
        """What was seen that was not expected, and what it may show of people's choices."""
        for at, note, acts in notes:
            if isinstance(note, said.Estimate):
                self._see(at, note, account.acts.keys() - acts)
        self.chosen = account.inferred | self.chosen
        self.shown = self._as_it_shows(account.past, now)

    def _note(self, at, note, later):
        if isinstance(note, said.Outcome):
            [event] = [each.event for each in self.network.choices if each.name == note.choice]
            if note.at is not None and event is not None and event not in {a.target for a in self.network.activities}:
                self._was(event, at)
            return
        if isinstance(note, said.Estimate):
            return
        [place] = [place for place, each in enumerate(self.network.activities) if each.action == note.action]
        if isinstance(note, said.Began):
            self.begun[place] = at
            self._was(self.network.activities[place].source, at)
        elif self.network.activities[place].source not in later:
            self.ended[place] = at, isinstance(note, said.Completion)

    def _was(self, event, at):
        """It was then, unless we know better, and what is before it whenever it is was not later than it had to be."""
        possible = all(self.chosen.get(name, value) == value for name, value in self.guards[event])
        if event in self.times or not possible:
            return
        latest, changed = {event: max(at, Fraction(0))}, True
        while changed:
            changed = False
            for each in self.network.temporal_constraints:
                for earlier, later, lower in (
                    (each.source, each.target, each.lower),
                    (each.target, each.source, None if each.upper is None else -each.upper),
                ):
                    certain = each.guard | self.guards[earlier] <= self.guards.get(later, ALWAYS)
                    if certain and lower is not None and lower >= 0 and later in latest and earlier not in self.times:
                        time = max(latest[later] - lower, Fraction(0))
                        if time < latest.get(earlier, time + 1):
                            latest[earlier], changed = time, True
        self.times |= latest

    def _hold_guards(self):
        for event in self.times:
            for name, value in self.guards[event]:
                self.chosen.setdefault(name, value)

    def _since(self, place):
        return self.begun[place] if place in self.begun else self.times[self.network.activities[place].source]

    def _sure(self, label):
        return all(self.chosen.get(name) == value for name, value in label)

    def _end(self, account, now):
        """An event happens when the last activity has ended that ends there."""
        activities = self.network.activities
        for target in dict.fromkeys(activities[place].target for place in self.ended):
            there = [
                place
                for place, each in enumerate(activities)
                if each.target == target and each.source in self.times and self._sure(each.guard)
            ]
            if target in account.acts or not there or not all(map(self._over, there)):
                continue
            time = max(self.ended[place][0] for place in there)
            for place in account.held.intersection(there):
                time = max(time, self._since(place) + activities[place].lower)
            if time <= now:
                self.times[target] = time
        self.ended = {place: end for place, end in self.ended.items() if self._over(place)}

    def _over(self, place):
        """Whether it ended, and not before it began."""
        known = place in self.begun or self.network.activities[place].source in self.times
        return known and place in self.ended and self._since(place) <= self.ended[place][0]

    def _lost(self, effect):
        place = effect.activity
        return (
            place in self.ended and not self.ended[place][1] and effect.event == self.network.activities[place].target
        )

    def _true(self, atom, at, later):
        """Whether an atom was true at a time, before some acts."""
        known = [(time, 2, number, literal) for number, (time, literal) in enumerate(self.seen)]
        for effect in self.plan.effects:
            happened = effect.event in self.times and not (effect.event in later and self.times[effect.event] == at)
            if happened and self._sure(effect.guard) and not self._lost(effect):
                known.append((self.times[effect.event], int(effect.literal.positive), 0, effect.literal))
        known = [each for each in known if each[3].atom == atom and each[0] <= at]
        return max(known, key=lambda each: each[:3])[3].positive if known else False

    def _see(self, at, estimate, later):
        relevant = {condition.literal.atom for condition in self.plan.conditions}
        claims = {atom: False for atom in relevant if estimate.complete}
        claims |= dict.fromkeys(estimate.false, False) | dict.fromkeys(estimate.true, True)
        unexpected = [
            Literal(atom, positive)
            for atom, positive in sorted(claims.items())
            if atom in relevant and positive != self._true(atom, at, later)
        ]
        for literal in unexpected:
            self.seen.append((at, literal))
            causes = [
                effect.guard | self.guards[effect.event]
                for effect in self.plan.effects
                if effect.literal == literal
                and (effect.event in later or effect.event not in self.times or self.times[effect.event] > at)
            ]
            causes = [label for label in causes if all(self.chosen.get(name, value) == value for name, value in label)]
            people = {each.name for each in self.network.choices if not each.controllable}
            for name, value in frozenset.intersection(*causes) if causes else ():
                if name in people:
                    self.inferred.setdefault(name, value)

    def _as_it_shows(self, past, now):
        failed = {place for place, (_, completed) in self.ended.items() if not completed}
        activities = self.network.activities
        events, effects = list(self.network.events), [each for each in self.plan.effects if not self._lost(each)]
        for number, (time, literal) in enumerate(self.seen):
            events.append(Event(f"seen {number}"))
            effects.append(Effect(literal, f"seen {number}", ALWAYS, None))
            self.times[f"seen {number}"] = time
        conditions = [
            each
            for each in self.plan.conditions
            if each.last not in past and not (each.activity in failed and each.last == activities[each.activity].target)
        ]
        bounds = [each for each in self.network.constraints if not {each.source, each.target} <= past]
        lasting = tuple(self._lasting(place, now) for place in range(len(activities)))
        network = replace(self.network, events=tuple(events), constraints=tuple(bounds), activities=lasting)
        return replace(self.plan, network=network, conditions=tuple(conditions), effects=tuple(effects))

    def _lasting(self, place, now):
        """The activity with bounds that agree with how long it took, or has taken."""
        each = self.network.activities[place]
        if each.source not in self.times:
            return each
        source, target = self.times[each.source], self.times.get(each.target)
        late = self._since(place) - source
        lower, upper = each.lower + late, None if each.upper is None else each.upper + late
        if target is not None:
            lower, upper = min(lower, target - source), upper and max(upper, target - source)
        elif upper is not None and now - source > upper:
            upper = None
        return replace(each, lower=lower, upper=upper)


# -- what is reported --------------------------------------------------------------------------------------------------


class World:
    """Activities that take too little or too long, fail, or begin unasked; atoms that change by themselves; people."""

    def __init__(self, plan, random):
        self.plan, self.random = plan, random
        self.agenda, self.told, self.asked, self.begun = [], [], set(), set()

    def report(self, happens, message):
        delay = self.random.choice((0, 0, 0, Fraction(1, 2)))
        told = replace(message, at=happens) if delay or self.random.random() < 0.3 else message
        self.agenda.append((happens + delay, len(self.agenda), told))

    def messages(self, now):
        """What is told now; sometimes once more, and sometimes earlier words are taken back, and said again later."""
        random = self.random
        due = sorted((each for each in self.agenda if each[0] <= now), key=itemgetter(0, 1))
        self.agenda = [each for each in self.agenda if each not in due]
        messages = [message for _, _, message in due]
        if self.told and random.random() < 0.1:
            wrong = random.choice(self.told)
            messages.append(said.Retract(wrong))
            if random.random() < 0.7:
                self.agenda.append((now + random.choice((0, QUARTER, 1)), len(self.agenda), wrong))
        if messages and random.random() < 0.2:
            messages.append(random.choice(messages))
        elif self.told and random.random() < 0.05:
            messages.append(random.choice(self.told))
        self.told += [message for message in messages if not isinstance(message, said.Retract)]
        return messages

    def go_on(self, chosen, now, decisions):
        """What the world does from now on."""
        random, plan = self.random, self.plan
        for decision in decisions:
            if isinstance(decision, said.Dispatched):
                self.carry_out(int(decision.goal.removeprefix("goal-")) - 1, now, decision.goal)
        for choice in plan.network.choices:
            open_now = choice.event is None or choice.event in chosen.progress.frontier
            if not choice.controllable and choice.name not in self.asked and open_now:
                self.asked.add(choice.name)
                values = (
                    choice.domain if random.random() < 0.2 else chosen.possible_values(choice.name) or choice.domain
                )
                self.report(now + random.choice((0, Fraction(1, 2))), said.Outcome(choice.name, random.choice(values)))
        if plan.effects and random.random() < 0.15:
            literal = random.choice([effect.literal for effect in plan.effects])
            seen = {("true" if literal.positive else "false"): frozenset({literal.atom})}
            self.report(now, said.Estimate(**seen, complete=random.random() < 0.2))
        for place, activity in enumerate(plan.network.activities):
            if place not in self.begun and activity.source in chosen.progress.pending and random.random() < 0.1:
                self.carry_out(place, now, None, unasked=True)

    def carry_out(self, place, now, goal, *, unasked=False):
        random, activity = self.random, self.plan.network.activities[place]
        if place in self.begun and random.random() < 0.7:
            return
        self.begun.add(place)
        begins = now + random.choice((0, QUARTER))
        if unasked or random.random() < 0.2:
            self.report(begins, said.Began(activity.action, goal=goal))
        else:
            begins = now
        longest = activity.upper if activity.upper is not None else activity.lower + 2
        lasts = random.choice((activity.lower, activity.lower, longest, activity.lower / 2, longest * 5 / 4))
        kind = said.Completion if random.random() < 0.85 else random.choice(said.NOT_ACHIEVED)
        message = kind(activity.action, None if random.random() < 0.7 else activity.target, goal)
        people = [each for each in self.plan.network.choices if not each.controllable]
        if kind is said.Completion and people and random.random() < 0.2:
            shown = random.choice(people)
            message = replace(message, outcomes={shown.name: random.choice(shown.domain)})
        self.report(begins + lasts, message)


def carried_out(plan, random, *, check=None, **options):
    """An execution in a random world, and its account; with `check`, what is called after each step."""
    chosen, world = FieldExecutive(plan, SemanticReasoner, **options), World(plan, random)
    account, now = Account(plan, waits=options.get("early") == "wait"), Fraction(0)
    chosen.steps = []
    for _ in range(40):
        messages = world.messages(now)
        decisions = chosen.step(now, messages)
        chosen.steps.append(JournalStep(now, tuple(messages), tuple(decisions)))
        if check is not None:
            check(chosen, account, chosen.steps[-1])
        if isinstance(chosen.outcome, said.Succeeded):
            break
        world.go_on(chosen, now, decisions)
        moments = [each[0] for each in world.agenda] + ([] if chosen.wake is None else [chosen.wake])
        if not moments:
            break
        now = max(now, min(moments))
    return chosen, account


def check_by_brute_force(chosen, account, step):
    """What has happened is what its account says, and so is what is left: whether anything is, and which values are."""
    now, progress = step.time, chosen.progress
    account.hear(now, step.messages, step.decisions)
    account.infer(now, progress.chosen)
    course = account.course(now)
    planned = account.plan.network.guards.keys()
    assert {event: progress.times[event] for event in planned & progress.times.keys()} == {
        event: course.times[event] for event in planned & course.times.keys()
    }
    assert progress.chosen == course.chosen
    scenarios = correct_scenarios(course.shown, course.chosen, course.times, now)
    if isinstance(chosen.outcome, said.Failed):
        assert not scenarios
        assert not account.mended(now)
        return
    assert scenarios
    if isinstance(chosen.outcome, said.Succeeded):
        assert any(
            {name for name, label in course.shown.network.guards.items() if holds(label, each)} == course.times.keys()
            for each in scenarios
        )
        return
    for choice in account.plan.network.choices:
        possible = {each[choice.name] for each in scenarios}
        assert set(chosen.possible_values(choice.name)) == possible, choice.name


def judged(seed, counts):
    """One execution, compared at each step; what was reported is counted by kinds."""
    random = Random(f"reports/{seed}")  # noqa: S311 - reproducible
    seen = set()

    def check(chosen, account, step):
        counts["steps"] += 1
        refused = sum(isinstance(each, said.Rejected) for each in step.decisions)
        counts["rejected"] += refused
        for message in step.messages:
            counts[type(message).kind()] += 1
            counts["late"] += getattr(message, "at", None) is not None
            counts["repeated"] += str(message) in seen
            seen.add(str(message))
        for decision in step.decisions:
            if isinstance(decision, said.Resumed | said.Deviated | said.Failed | said.Succeeded):
                counts["→ " + type(decision).kind()] += 1
        check_by_brute_force(chosen, account, step)

    early, patience = random.choice(("accept", "accept", "wait")), random.choice((None, Fraction(0)))
    carried_out(decided_in_time(random), random, check=check, early=early, patience=patience)
    counts["executions"] += 1


def main(first=0, count=1000):
    counts = Counter()
    for seed in range(first, first + count):
        try:
            judged(seed, counts)
        except Exception as error:  # each difference is told, and counted
            counts["differences"] += 1
            sys.stdout.write(f"{seed}: {error!r}\n")
            sys.stdout.flush()
    sys.stdout.writelines(f"{name}: {number}\n" for name, number in sorted(counts.items()))
    return int(counts["differences"] > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
