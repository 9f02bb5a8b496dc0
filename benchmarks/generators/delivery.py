"""Robot delivery: the domain of the papers' execution experiments, and generators of problems and plans [IRR §5].

Service robots collect a spindle from the shelf, have a base made around it at the base station in up to six preparation
steps that can run at the same time, mount rings on it at the ring station, one after the other, and deliver it at the
gate of its order before the order's window closes. A robot may dispose of what it holds at any time, and start another
order from scratch.

What the experiments make uncertain can become a parameter by itself. Each preparation step is an action of its own, so
`duration:prepare_S` is the duration of step S. In the variant with a battery, `fluent:(battery_use T)` is what a task T
takes from the battery of a robot when it starts; it only starts if there is as much. Travel takes as long as the
distance. (`fluent:(preparation_time S)` would vary what the model demands of the duration and leave that of the plan.)

Preparation steps have no effects at their start: one that is given up has not happened, and can be started again.

Plans of any number of uncertain durations need no planner [IRR §5, Figure 4]. The hundred problems of Tables 1 and 2
have one robot, two orders, and the goal to fulfil one of them. The nearer order wants one ring, the other three.
Without delay the first is fulfilled after 414 seconds; if it is given up at the end of its preparation, the second is
fulfilled after 729. The windows close at 416 and 731 seconds, each later by a quantile of a half-normal distribution: a
delay that a preparation step does not exceed with the probability of the level.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from math import isqrt
from pathlib import Path
from random import Random
from statistics import NormalDist
from typing import NamedTuple

from robust.errors import InputError
from robust.numbers import format_number
from robust.plan.pddl.write import sketched_problem
from robust.plan.timed import TimedPlan, TimedStep, write_timed_plan


class DeliveryVariant(Enum):
    """What is uncertain."""

    DURATIONS = "durations"
    """How long preparation steps take."""
    BATTERY = "battery"
    """How much actions take from the battery, too."""


PREPARATIONS: Mapping[str, Fraction] = {f"step{i}": Fraction(110 + 10 * i) for i in range(1, 7)}
"""Nominal durations of the preparation steps: 120 to 170 seconds [IRR §5]."""

TASKS: Mapping[str, Fraction] = {
    "moving": Fraction(20),
    "collecting": Fraction(21),
    "assembling": Fraction(22),
    "mounting": Fraction(23),
    "delivering": Fraction(20),
    "disposing": Fraction(21),
    **{step: Fraction(20 + i % 4) for i, step in enumerate(PREPARATIONS)},
}
"""Nominal battery consumption of each task: 20 to 23."""

COLLECTING = Fraction(15)
ASSEMBLING = Fraction(40)
MOUNTING = Fraction(35)
DELIVERING = Fraction(24)
"""Durations in seconds, as in the domain; that disposing takes 10 is the paper's."""

MOST_RINGS = 3

_DOMAIN = Path(__file__).with_name("delivery.pddl")
"""The variant with a battery; the other one is without the lines about it."""
_ABOUT_BATTERIES = re.compile(
    r"\n *(?:\(at start \((?:>=|decrease) \(battery \?r\) \(battery_use \w+\)\)\)"
    r"|\(battery \?r - robot\)|\(battery_use \?t - task\)|moving [a-z ]+ - task)"
)


def delivery_domain(variant: DeliveryVariant) -> str:
    """The domain in PDDL."""
    text = _DOMAIN.read_text(encoding="utf-8")
    return text if variant is DeliveryVariant.BATTERY else _ABOUT_BATTERIES.sub("", text)


def preparation_action(step: str) -> str:
    """The name of the action for a preparation step."""
    return f"prepare_{step}"


# -- problems: places in the plane, orders with windows, robots with batteries -----------------------------------------

Place = tuple[int, int]

SHELF, BASE_STATION, RING_STATION = "shelf", "base_station", "ring_station"
_STATIONS = (SHELF, BASE_STATION, RING_STATION)
_SIDE = 100
"""Random places lie in a square of this side; robots travel one unit of length in a second."""


@dataclass(frozen=True, slots=True)
class Order:
    """A spindle with `rings` rings, wanted before `deadline` (seconds; None: whenever).

    Its base needs the first `steps` preparation steps; the others are done from the beginning.
    """

    rings: int
    deadline: Fraction | None = None
    steps: int = len(PREPARATIONS)

    def __post_init__(self) -> None:
        _check("rings of an order", self.rings, 1, MOST_RINGS)
        _check("preparation steps of an order", self.steps, 0, len(PREPARATIONS))
        if self.deadline is not None and self.deadline <= 0:
            raise InputError(f"found deadline {format_number(self.deadline)} of an order, expected more than 0")


@dataclass(frozen=True, slots=True)
class DeliveryOptions:
    """What a problem is like.

    The goal is that some order is fulfilled, or `every_order`. There are `spindles` on the shelf for each order: so
    often can it be begun. `battery` is the charge of each robot, in the variant that has one. `places` has coordinates
    for `shelf`, `base_station`, `ring_station`, `dock1`… of the robots and `gate1`… of the orders; places without are
    drawn at random.
    """

    variant: DeliveryVariant
    orders: tuple[Order, ...]
    robots: int = 1
    spindles: int = 2
    battery: Fraction = Fraction(360)
    every_order: bool = False
    places: Mapping[str, Place] | None = None

    def __post_init__(self) -> None:
        _check("robots", self.robots, 1, None)
        _check("spindles of an order", self.spindles, 1, None)
        _check("orders", len(self.orders), 1, None)
        if self.battery < 0:
            raise InputError(f"found battery {format_number(self.battery)}, expected at least 0")
        unknown = next((name for name in self.places or {} if name not in self.place_names), None)
        if unknown is not None:
            raise InputError(f"found place {unknown!r}, expected one of {', '.join(self.place_names)}")

    @property
    def place_names(self) -> tuple[str, ...]:
        docks = (dock(i) for i in range(self.robots))
        gates = (gate(i) for i in range(len(self.orders)))
        return (*_STATIONS, *docks, *gates)


def _check(what: str, value: int, least: int, most: int | None) -> None:
    if value < least or (most is not None and value > most):
        expected = f"at least {least}" if most is None else f"{least} to {most}"
        raise InputError(f"found {value} as number of {what}, expected {expected}")


def dock(robot: int) -> str:
    """Where a robot starts; robots and orders count from zero, names from one."""
    return f"dock{robot + 1}"


def gate(order: int) -> str:
    """Where an order is delivered."""
    return f"gate{order + 1}"


def spindle(order: int, number: int) -> str:
    """One of the spindles for an order."""
    return f"spindle{order + 1}_{number + 1}"


def places(options: DeliveryOptions, seed: int) -> dict[str, Place]:
    """Coordinates of all places, no two the same."""
    random = Random(seed)  # noqa: S311 - experiments, not secrets
    chosen = dict(options.places or {})
    for name in options.place_names:
        while name not in chosen:
            place = (random.randint(0, _SIDE), random.randint(0, _SIDE))
            if place not in chosen.values():
                chosen[name] = place
    return chosen


def distance(a: Place, b: Place) -> int:
    """The Euclidean distance, rounded up: integers keep the triangle inequality, and every planner reads them."""
    square = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2
    return isqrt(square - 1) + 1 if square else 0


def delivery_problem(options: DeliveryOptions, seed: int) -> str:
    """The problem in PDDL; the seed decides about the places that the options do not give."""
    where = places(options, seed)
    orders = range(len(options.orders))
    objects = [
        f"{' '.join(f'robot{i + 1}' for i in range(options.robots))} - robot",
        f"{' '.join(where)} - location",
        f"{' '.join(f'order{i + 1}' for i in orders)} - order",
        f"{' '.join(spindle(i, j) for i in orders for j in range(options.spindles))} - spindle",
        f"{' '.join(f'level{i}' for i in range(MOST_RINGS + 1))} - level",
    ]
    facts = [*_stations(), *_robots(options), *_orders(options), *_numbers(options, where)]
    goals = [f"(fulfilled order{i + 1})" for i in orders] if options.every_order else ["(some_fulfilled)"]
    lines = "\n  ".join
    return sketched_problem("delivery", "robot-delivery", [lines(facts)], goals, objects=lines(objects))


def _stations() -> Iterator[str]:
    yield from (f"({name}_at {name})" for name in _STATIONS)
    yield f"(station_free {RING_STATION})"
    yield "(first_level level0)"
    yield from (f"(next_level level{i} level{i + 1})" for i in range(MOST_RINGS))


def _robots(options: DeliveryOptions) -> Iterator[str]:
    for i in range(options.robots):
        yield f"(robot_at robot{i + 1} {dock(i)})"
        yield f"(hand_empty robot{i + 1})"


def _orders(options: DeliveryOptions) -> Iterator[str]:
    for i, order in enumerate(options.orders):
        name = f"order{i + 1}"
        yield f"(gate_at {name} {gate(i)})"
        yield f"(wants {name} level{order.rings})"
        yield f"(window_open {name})"
        if order.deadline is not None:
            yield f"(at {format_number(order.deadline)} (not (window_open {name})))"
        for j in range(options.spindles):
            yield f"(on_shelf {spindle(i, j)})"
            yield f"(spindle_of {spindle(i, j)} {name})"
            yield from (f"(prepared {spindle(i, j)} {step})" for step in list(PREPARATIONS)[order.steps :])


def _numbers(options: DeliveryOptions, where: Mapping[str, Place]) -> Iterator[str]:
    yield from (f"(= (preparation_time {step}) {format_number(time)})" for step, time in PREPARATIONS.items())
    for a, here in where.items():
        yield from (f"(= (distance {a} {b}) {distance(here, there)})" for b, there in where.items() if a != b)
    if options.variant is DeliveryVariant.BATTERY:
        yield from (f"(= (battery robot{i + 1}) {format_number(options.battery)})" for i in range(options.robots))
        yield from (f"(= (battery_use {task}) {format_number(use)})" for task, use in TASKS.items())


# -- plans with any number of uncertain durations ----------------------------------------------------------------------

MOST_PARAMETERS = 1000
_MOST_ROBOTS = 3
_MOVES = 4
"""To the shelf, the base station, the ring station and the gate."""
_PAUSE = Fraction(1, 100)
"""Seconds between an action and the next one that depends on it: more than ε, so that no time points coincide."""


class PlanTexts(NamedTuple):
    """A domain, a problem, a valid time-triggered plan and what of it is uncertain, as `--parametrize` takes it."""

    domain: str
    problem: str
    plan: str
    specs: tuple[str, ...] = ()


def scaling_instance(parameters: int, seed: int) -> PlanTexts:
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
    closing = zip(orders, deadlines, strict=True)
    timed = tuple(replace(order, deadline=Fraction(round(deadline))) for order, deadline in closing)
    options = replace(options, orders=timed)
    uncertain = [preparation_action(step) for step in list(PREPARATIONS)[: max(order.steps for order in orders)]]
    if parameters > len(PREPARATIONS):
        uncertain.append("move")
    return PlanTexts(
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


# -- the hundred problems of the tables --------------------------------------------------------------------------------

LEVELS = tuple(Fraction(5 + 10 * i, 100) for i in range(10))
"""0.05, 0.15, …, 0.95."""

_PLACES = {"dock1": (0, 0), SHELF: (20, 0), BASE_STATION: (35, 0), RING_STATION: (70, 0)}
_GATES = {"gate1": (70, 60), "gate2": (134, 48)}
_CLOSING = (Fraction(416), Fraction(731))


@dataclass(frozen=True, slots=True)
class TableProblem:
    """One of the problems; `levels` and `deadlines` are those of the nearer and the farther order."""

    name: str
    levels: tuple[Fraction, Fraction]
    deadlines: tuple[Fraction, Fraction]
    options: DeliveryOptions
    text: str


def table_problems(
    variant: DeliveryVariant = DeliveryVariant.DURATIONS, *, battery: Fraction = Fraction(360)
) -> tuple[TableProblem, ...]:
    """All hundred, by the level of the nearer order and then by that of the farther one.

    `battery` is the charge at the start in the variant that has one; fulfilling the first order takes 293 of it.
    """
    return tuple(_table_problem(variant, battery, near, far) for near in LEVELS for far in LEVELS)


def half_normal_quantile(level: Fraction, deviation: int) -> Fraction:
    """What the size of a normal deviation from zero does not exceed with probability `level`, to a thousandth."""
    quantile = NormalDist(0, deviation).inv_cdf(float((1 + level) / 2))
    return Fraction(round(quantile * 1000), 1000)


def _table_problem(variant: DeliveryVariant, battery: Fraction, near: Fraction, far: Fraction) -> TableProblem:
    first = _CLOSING[0] + half_normal_quantile(near, 70)
    second = _CLOSING[1] + half_normal_quantile(far, 140)
    orders = (Order(1, first), Order(3, second))
    options = DeliveryOptions(variant, orders, battery=battery, places=_PLACES | _GATES)
    name = f"near{int(near * 100):02}_far{int(far * 100):02}"
    return TableProblem(name, (near, far), (first, second), options, delivery_problem(options, 0))
