"""Instances with any number of uncertain durations, with plans that need no planner [IRR §5, Figure 4]."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random
from typing import NamedTuple

from robust.errors import InputError
from robust.execute.delivery.domain import (
    ASSEMBLING,
    COLLECTING,
    DELIVERING,
    MOST_RINGS,
    MOUNTING,
    PREPARATIONS,
    DeliveryVariant,
    delivery_domain,
    preparation_action,
)
from robust.execute.delivery.problem import (
    BASE_STATION,
    RING_STATION,
    SHELF,
    DeliveryOptions,
    Order,
    Place,
    delivery_problem,
    distance,
    dock,
    gate,
    places,
    spindle,
)
from robust.plan.timed import TimedPlan, TimedStep, write_timed_plan

MOST_PARAMETERS = 1000
_MOST_ROBOTS = 3
_MOVES = 4
"""To the shelf, the base station, the ring station and the gate."""
_PAUSE = Fraction(1, 100)
"""Seconds between an action and the next one that depends on it: more than ε, so that no time points coincide."""


class ScalingInstance(NamedTuple):
    """A domain, a problem, a valid time-triggered plan and what of it is uncertain, as `--parametrize` takes it."""

    domain: str
    problem: str
    plan: str
    specs: tuple[str, ...]


def scaling_instance(parameters: int, seed: int) -> ScalingInstance:
    """An instance with so many uncertain durations: of preparation steps, and beyond six of them also of all moves.

    Each order has up to six preparation steps, four moves and one to three rings. Up to three robots share the ring
    station and take orders in turn. The windows close 10 to 60 percent of a plan after the plan fulfils the order.

    Raises:
        InputError: if `parameters` is not from 1 to 1000.
    """
    if not 1 <= parameters <= MOST_PARAMETERS:
        raise InputError(f"found {parameters} parameters, expected 1 to {MOST_PARAMETERS}")
    random = Random(f"{parameters}/{seed}")  # noqa: S311 - experiments, not secrets
    orders = tuple(Order(random.randint(1, MOST_RINGS), steps=steps) for steps in _shares(parameters))
    robots = min(_MOST_ROBOTS, len(orders))
    options = DeliveryOptions(DeliveryVariant.DURATIONS, orders, robots=robots, spindles=1, every_order=True)
    place_seed = random.randrange(2**32)
    schedule = _Schedule(places(options, place_seed))
    ends = [schedule.fulfil(robot % robots, robot, order) for robot, order in enumerate(orders)]
    deadlines = [end + round(max(ends) * random.randint(10, 60) / 100) for end in ends]
    timed = tuple(
        Order(order.rings, Fraction(round(deadline)), order.steps)
        for order, deadline in zip(orders, deadlines, strict=True)
    )
    options = DeliveryOptions(options.variant, timed, robots=robots, spindles=1, every_order=True)
    uncertain = [preparation_action(step) for step in list(PREPARATIONS)[: max(order.steps for order in orders)]]
    if parameters > len(PREPARATIONS):
        uncertain.append("move")
    return ScalingInstance(
        delivery_domain(options.variant),
        delivery_problem(options, place_seed),
        write_timed_plan(TimedPlan(tuple(sorted(schedule.steps, key=lambda step: step.time)))),
        tuple(f"duration:{action}" for action in uncertain),
    )


def _shares(parameters: int) -> Iterator[int]:
    """The preparation steps of each order: as few orders as possible, steps as even as possible."""
    steps, orders = parameters, 1
    if parameters > len(PREPARATIONS):
        orders = -(-parameters // (len(PREPARATIONS) + _MOVES))
        steps = parameters - _MOVES * orders
    return (steps // orders + (i < steps % orders) for i in range(orders))


@dataclass
class _Schedule:
    """Steps as they are added; when and where each robot is free, and when the ring station is."""

    where: dict[str, Place]
    steps: list[TimedStep] = field(default_factory=list)
    free: dict[int, Fraction] = field(default_factory=dict)
    at: dict[int, str] = field(default_factory=dict)
    station_free: Fraction = Fraction(0)

    def fulfil(self, robot: int, order: int, wanted: Order) -> Fraction:
        """Add what fulfils an order, as early as a robot can; returns when it is done."""
        self.at.setdefault(robot, dock(robot))
        name, held = f"robot{robot + 1}", spindle(order, 0)
        self._move(robot, SHELF)
        self._act(robot, "collect", (name, held, SHELF), COLLECTING)
        self._move(robot, BASE_STATION)
        begin = self.free[robot]
        for step in list(PREPARATIONS)[: wanted.steps]:
            end = self._add(begin, preparation_action(step), (name, held, BASE_STATION), PREPARATIONS[step])
            self.free[robot] = max(self.free[robot], end)
        self._act(robot, "assemble", (name, held, BASE_STATION, "level0"), ASSEMBLING)
        self._move(robot, RING_STATION)
        self.free[robot] = max(self.free[robot], self.station_free)
        for level in range(wanted.rings):
            levels = (f"level{level}", f"level{level + 1}")
            self._act(robot, "mount", (name, held, RING_STATION, *levels), MOUNTING)
        self.station_free = self.free[robot]
        self._move(robot, gate(order))
        last = (name, held, f"order{order + 1}", gate(order), f"level{wanted.rings}")
        self._act(robot, "deliver", last, DELIVERING)
        return self.free[robot]

    def _move(self, robot: int, to: str) -> None:
        here = self.at[robot]
        length = Fraction(distance(self.where[here], self.where[to]))
        self._act(robot, "move", (f"robot{robot + 1}", here, to), length)
        self.at[robot] = to

    def _act(self, robot: int, action: str, arguments: tuple[str, ...], duration: Fraction) -> None:
        self.free[robot] = self._add(self.free.get(robot, Fraction(0)), action, arguments, duration)

    def _add(self, begin: Fraction, action: str, arguments: tuple[str, ...], duration: Fraction) -> Fraction:
        """Add a step; returns when the next one may begin."""
        self.steps.append(TimedStep(begin, action, arguments, duration))
        return begin + duration + _PAUSE
