"""Smaller plans that still show something: what a disagreement is reported with, as files that reproduce it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeVar

from robust.errors import RobustError
from robust.pike_bridge.model import Assignment, Condition, Effect, TeamPlan
from robust.pike_bridge.scenarios import restrict
from robust.pike_bridge.validate import validate
from robust.smt.limits import Deadline

T = TypeVar("T")


def shrink(plan: TeamPlan, shows: Callable[[TeamPlan], bool], deadline: Deadline) -> TeamPlan:
    """The plan with as much left out as possible such that `shows` still holds of it, found greedily.

    What is tried: making one choice in advance, and leaving out one activity, condition, effect or constraint. It ends
    when nothing more can go, or at the deadline.
    """
    smaller: TeamPlan | None = plan
    while smaller is not None:
        plan = smaller
        smaller = next((one for one in _smaller(plan) if not deadline.passed and _holds(shows, one)), None)
    return plan


def _holds(shows: Callable[[TeamPlan], bool], plan: TeamPlan) -> bool:
    try:
        validate(plan.network)  # it will be written to a file
        return shows(plan)
    except RobustError:
        return False  # not a plan any more: another one has to do


def _smaller(plan: TeamPlan) -> Iterator[TeamPlan]:
    for choice in plan.network.choices:
        for value in choice.domain:
            yield restrict(plan, frozenset({Assignment(choice.name, value)}))
    for place in range(len(plan.network.activities)):
        yield without_activity(plan, place)
    for at in range(len(plan.conditions)):
        yield replace(plan, conditions=_without(plan.conditions, at))
    for at in range(len(plan.effects)):
        yield replace(plan, effects=_without(plan.effects, at))
    constraints = plan.network.constraints
    for at in range(len(constraints)):
        yield replace(plan, network=replace(plan.network, constraints=_without(constraints, at)))


def _without(items: tuple[T, ...], at: int) -> tuple[T, ...]:
    return items[:at] + items[at + 1 :]


def without_activity(plan: TeamPlan, place: int) -> TeamPlan:
    """The plan without an activity; its events, and the constraint between them, stay."""
    activity = plan.network.activities[place]
    network = replace(
        plan.network,
        activities=_without(plan.network.activities, place),
        constraints=(*plan.network.constraints, activity.duration),
    )

    def renumbered(owner: int | None) -> int | None:
        return owner - 1 if owner is not None and owner > place else owner

    conditions: tuple[Condition, ...] = tuple(
        replace(one, activity=renumbered(one.activity)) for one in plan.conditions if one.activity != place
    )
    effects: tuple[Effect, ...] = tuple(
        replace(one, activity=renumbered(one.activity)) for one in plan.effects if one.activity != place
    )
    return replace(plan, network=network, conditions=conditions, effects=effects)
