"""Problems of the domain: places in the plane, orders with windows, robots with batteries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from random import Random

from robust.errors import InputError
from robust.execute.delivery.domain import MOST_RINGS, PREPARATIONS, TASKS, DeliveryVariant
from robust.numbers import format_number

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
    root = isqrt(square)
    return root if root * root == square else root + 1


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
    return (
        "(define (problem delivery)\n(:domain robot-delivery)\n"
        f"(:objects\n  {lines(objects)})\n(:init\n  {lines(facts)})\n(:goal (and {' '.join(goals)})))\n"
    )


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
