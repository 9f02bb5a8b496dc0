"""What of an execution is undone when a guess turns out wrong, and the candidate that is left after it."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

from robust.pike_bridge.model import Activity, Constraint, Event, Guard, TeamPlan, guard
from robust.pike_bridge.scenarios import contradicts, restrict


@dataclass(frozen=True, slots=True)
class Recovery:
    """An activity that undoes another one, and takes exactly `duration`."""

    action: str
    agent: str | None
    duration: Fraction


def kept_events(
    plan: TeamPlan, times: Mapping[str, Fraction], begun: Sequence[Activity], observed: Mapping[str, str]
) -> dict[str, Fraction]:
    """The executed events that may stay, with their times; the others are undone.

    Wrong are the events, and the activities that were begun, whose guards the observed choices exclude. Undone are
    wrong events and the starts of wrong activities; events that were executed although another one has to come first,
    which has not been executed or is undone itself; and the starts of activities whose ends are undone.
    """
    guards, known = plan.network.guards, guard(observed)
    wrong = {event for event in times if contradicts(guards[event], known)}
    wrong |= {activity.source for activity in begun if contradicts(activity.guard, known)}
    kept = dict(times)
    while wrong:
        kept = {event: time for event, time in kept.items() if event not in wrong}
        wrong = _too_early(plan, kept, known) | {
            activity.source
            for activity in begun
            if activity.source in kept and activity.target in times and activity.target not in kept
        }
    return kept


def _too_early(plan: TeamPlan, kept: Mapping[str, Fraction], known: Guard) -> set[str]:
    guards = plan.network.guards
    return {
        constraint.target
        for constraint in plan.network.temporal_constraints
        if constraint.target in kept
        and constraint.source not in kept
        and constraint.lower is not None
        and constraint.lower >= 0
        and constraint.guard | guards[constraint.source] <= known | guards[constraint.target]
    }


def recoveries(
    wrong: Iterable[Activity], times: Mapping[str, Fraction], durations: Mapping[str, Fraction], epsilon: Fraction
) -> list[Recovery]:
    """How activities that were begun are undone: the last one first. Those without a duration are undone at once.

    Durations are rounded up to the grid of ε, like all times of executions.
    """
    found = []
    for activity in sorted(wrong, key=lambda each: times[each.source], reverse=True):
        duration = durations.get(activity.action, Fraction(0))
        if duration > 0:
            on_grid = ceil(duration / epsilon) * epsilon
            found.append(Recovery(f"(recover {activity.action.strip('()')})", activity.agent, on_grid))
    return found


def candidate(
    plan: TeamPlan,
    scenario: Mapping[str, str],
    *,
    undo: Sequence[Recovery] = (),
    waiting: Container[str] = (),
    number: int = 0,
) -> TeamPlan:
    """The plan without choices in a scenario; what undoes wrong activities is put before all that is to come.

    Args:
        undo: activities that are executed first, one after the other.
        waiting: events that wait for them; those of other scenarios do not matter.
        number: of the candidate, for the names of events.
    """
    chosen = restrict(plan, guard(scenario))
    if not undo:
        return chosen
    network = chosen.network
    moments = [f"recovery {number}.{place}" for place in range(len(undo) + 1)]
    activities = tuple(
        Activity(one.action, begin, end, one.duration, one.duration, one.agent)
        for one, begin, end in zip(undo, moments, moments[1:], strict=False)
    )
    first = tuple(
        Constraint(moments[-1], event.name, Fraction(0), None) for event in network.events if event.name in waiting
    )
    return replace(
        chosen,
        network=replace(
            network,
            events=(*(Event(name) for name in moments), *network.events),
            constraints=(*network.constraints, *first),
            activities=(*network.activities, *activities),
        ),
    )
