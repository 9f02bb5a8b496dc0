"""Rank events and values by the flexibility that they leave for the rest of an execution.

Where several events can be executed at one time, PIKE takes any, and the paper suggests to rank them by "which event
would leave the greatest flexibility for the remainder of the execution" [PIKE §3]. Here flexibility is what is still
open: how many values of people's open choices some continuation has that does the act now, then how many values of the
team's own open choices. What leaves the same is taken in the order of the plan.

In a plan that is decided part by part only choices of the parts under way are counted one by one; those of later parts
count as far as they differ in what they demand.
"""

from collections.abc import Iterable, Iterator, Sequence

from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.online.patience import openings, values_of
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.smt.limits import Deadline

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
