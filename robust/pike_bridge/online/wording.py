"""Events, times and what a plan demands in the words of its activities, for explanations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import networkx

from robust.pike_bridge.model import (
    GOAL,
    INITIAL,
    Activity,
    Condition,
    Constraint,
    Effect,
    Guard,
    guard_text,
    may_produce,
    may_threaten,
)
from robust.pike_bridge.online.progress import Progress
from robust.plan.numerals import format_number

_MOST = 4
"""So many activities are named one by one."""


class Wording:
    """Names the events of one plan, and tells its demands."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._plan = progress.plan
        self._network = progress.plan.network
        self._names = {INITIAL: "the initial state", GOAL: "the goal"}
        self._name_ends_of_activities()
        self._name_ends_of_plan()
        for choice in self._network.choices:
            if choice.event is not None:
                self._names.setdefault(choice.event, f"the choice of {choice.name}")

    def event(self, name: str) -> str:
        """`start of (get human mug)`; the event's own name if no activity starts or ends there."""
        return self._names.get(name, name)

    def actor(self, activity: int | None, otherwise: str) -> str:
        """The action of an activity by its place, or else what is not an activity."""
        return otherwise if activity is None else self._network.activities[activity].action

    def consumer(self, condition: Condition) -> str:
        """Who has a condition."""
        return self.actor(condition.activity, "the goal")

    def producer(self, effect: Effect) -> str:
        """Who has an effect."""
        return self.actor(effect.activity, "the initial state")

    def condition(self, condition: Condition) -> str:
        """Who needs what, who establishes that, and who undoes it."""
        producers = [
            each
            for each in self._plan.effects
            if may_produce(each, condition)
            and _compatible(each.guard, condition.guard)
            and not self._after(each.event, condition.first)
        ]
        threats = [
            each
            for each in self._plan.effects
            if may_threaten(each, condition)
            and _compatible(each.guard, condition.guard)
            and not self._after(each.event, condition.last)
        ]
        text = f"{self.consumer(condition)} needs {condition.literal}, which "
        if producers:
            text += f"only {self._causes(producers, condition)}"
        else:
            text += "nothing establishes"
        undoing = list(dict.fromkeys(self.producer(each) for each in threats if each.event != INITIAL))
        if producers and undoing:
            text += f"; {listed(undoing)} {'undoes' if len(undoing) == 1 else 'undo'} it"
        return text

    def bound(self, constraint: Constraint, *, upper: bool) -> str:
        """One bound of a constraint, told as a distance from the earlier event to the later."""
        source, target = self.event(constraint.source), self.event(constraint.target)
        bound = constraint.upper if upper else constraint.lower
        if bound is None:
            raise ValueError(f"{constraint} has no such bound")
        if bound < 0:
            source, target, bound, upper = target, source, -bound, not upper
        if not upper and bound == 0:
            text = f"{target} is not before {source}"
        else:
            text = f"at {'most' if upper else 'least'} {format_number(bound)} from {source} to {target}"
        return _given(text, constraint.guard)

    def sequence(self, activities: Sequence[Activity]) -> list[Activity] | None:
        """The order of activities, if the plan demands that they be one after the other whenever all are done."""
        union: Guard = frozenset().union(*(each.guard for each in activities))
        if not _compatible(union, union):
            return None
        graph = networkx.DiGraph()
        graph.add_nodes_from(event.name for event in self._network.events)
        for constraint in self._network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= 0 and constraint.guard <= union:
                graph.add_edge(constraint.source, constraint.target)
        later = {each: networkx.descendants(graph, each.target) | {each.target} for each in activities}
        ordered = sorted(activities, key=lambda each: len(later[each]), reverse=True)
        return ordered if all(other.source in later[one] for one, other in pairwise(ordered)) else None

    def _causes(self, producers: Iterable[Effect], condition: Condition) -> str:
        """`(p1) establishes, if x = 1`; `(p1) if x = 1 and (p2) establish`."""
        causes = list(dict.fromkeys((self.producer(each), each.guard - condition.guard) for each in producers))
        if len(causes) == 1:
            who, label = causes[0]
            return f"{who} establishes" + (f", if {guard_text(label)}" if label else "")
        return listed([who + (f" if {guard_text(label)}" if label else "") for who, label in causes]) + " establish"

    def _after(self, event: str, other: str) -> bool:
        """Whether the plan puts an event later than another, whenever it has it."""
        before, reached, ahead = self._progress.structure.before, {event}, [event]
        while ahead:
            for earlier in before[ahead.pop()]:
                if earlier == other:
                    return True
                if earlier not in reached:
                    reached.add(earlier)
                    ahead.append(earlier)
        return False

    def _name_ends_of_activities(self) -> None:
        ends: dict[str, list[str]] = {}
        for activity in self._network.activities:
            ends.setdefault(activity.source, []).append(f"start of {activity.action}")
            ends.setdefault(activity.target, []).append(f"end of {activity.action}")
        for event, names in ends.items():
            self._names.setdefault(event, " and ".join(dict.fromkeys(names[:2])))

    def _name_ends_of_plan(self) -> None:
        """An event that is before all others, or after them, but for the initial state and the goal."""
        graph = networkx.DiGraph()
        graph.add_nodes_from(event.name for event in self._network.events)
        for constraint in self._network.temporal_constraints:
            if constraint.lower is not None and constraint.lower >= 0:
                graph.add_edge(constraint.source, constraint.target)
        inner = set(graph) - {INITIAL, GOAL}
        if len(inner) < 2 or not networkx.is_directed_acyclic_graph(graph):
            return
        for event in inner:
            if networkx.ancestors(graph, event) <= {INITIAL} and networkx.descendants(graph, event) >= inner - {event}:
                self._names.setdefault(event, f"the beginning ({event})")
            if networkx.descendants(graph, event) <= {GOAL} and networkx.ancestors(graph, event) >= inner - {event}:
                self._names.setdefault(event, f"the end ({event})")


def durations(activities: Iterable[Activity], *, upper: bool = False) -> str:
    """`(get human mug) takes at least 0.5, (pour-coffee human) 0.2`."""

    def parts() -> Iterator[str]:
        for at, activity in enumerate(activities):
            bound = activity.upper if upper else activity.lower
            verb = f"takes at {'most' if upper else 'least'} " if at == 0 else ""
            yield f"{activity.action} {verb}{format_number(bound or Fraction(0))}"

    return ", ".join(parts())


def listed(names: Sequence[str]) -> str:
    """`a, b and c`; of many only the first few."""
    if len(names) > _MOST:
        names = [*names[: _MOST - 1], f"{len(names) - _MOST + 1} more"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _given(text: str, guard: Guard) -> str:
    return f"{text} ({guard_text(guard)})" if guard else text


def _compatible(one: Guard, other: Guard) -> bool:
    both = one | other
    return len({variable for variable, _ in both}) == len(both)
