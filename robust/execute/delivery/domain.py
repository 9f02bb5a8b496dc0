"""The domain in PDDL, in its two variants [IRR §5].

Service robots collect a spindle from the shelf, have a base made around it at the base station in up to six preparation
steps that can run at the same time, mount rings on it at the ring station, one after the other, and deliver it at the
gate of its order before the order's window closes. A robot may dispose of what it holds at any time, and start another
order from scratch.

What the experiments make uncertain can become a parameter by itself. Each preparation step is an action of its own, so
`duration:prepare_S` is the duration of step S. In the variant with a battery, `fluent:(battery_use T)` is what a task T
takes from the battery of a robot when it starts; it only starts if there is as much. Travel takes as long as the
distance. (`fluent:(preparation_time S)` would vary what the model demands of the duration and leave that of the plan.)

Preparation steps have no effects at their start: one that is given up has not happened, and can be started again.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from fractions import Fraction


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
DISPOSING = Fraction(10)
"""Durations in seconds; the last one is the paper's."""

MOST_RINGS = 3

_HEAD = """\
(define (domain robot-delivery)
(:requirements :typing :fluents :durative-actions :timed-initial-literals)
(:types robot location spindle order level task - object
        step - task)
(:constants {constants})
(:predicates
  (robot_at ?r - robot ?l - location)
  (hand_empty ?r - robot)
  (holding ?r - robot ?p - spindle)
  (shelf_at ?l - location)
  (base_station_at ?l - location)
  (ring_station_at ?l - location)
  (gate_at ?o - order ?l - location)
  (on_shelf ?p - spindle)              ; not collected yet
  (spindle_of ?p - spindle ?o - order) ; what is made of it fits this order
  (prepared ?p - spindle ?s - step)    ; the step has been done for its base
  (rings ?p - spindle ?n - level)      ; it has a base with so many rings
  (first_level ?n - level)
  (next_level ?m ?n - level)
  (wants ?o - order ?n - level)
  (station_free ?l - location)
  (window_open ?o - order)
  (fulfilled ?o - order)
  (some_fulfilled))
(:functions
  (distance ?a ?b - location)
  (preparation_time ?s - step){functions})
"""
_BATTERY_FUNCTIONS = """
  (battery ?r - robot)
  (battery_use ?t - task)"""


def delivery_domain(variant: DeliveryVariant) -> str:
    """The domain in PDDL."""
    battery = variant is DeliveryVariant.BATTERY
    names = [f"{' '.join(PREPARATIONS)} - step"]
    if battery:
        names.append(f"{' '.join(task for task in TASKS if task not in PREPARATIONS)} - task")
    head = _HEAD.format(constants="\n            ".join(names), functions=_BATTERY_FUNCTIONS if battery else "")
    steps = [_preparation(step, battery) for step in PREPARATIONS]
    return "\n".join([head, _move(battery), _collect(battery), *steps, *_after_preparation(battery), ")", ""])


def preparation_action(step: str) -> str:
    """The name of the action for a preparation step."""
    return f"prepare_{step}"


def _move(battery: bool) -> str:
    return _action(
        "move",
        "?r - robot ?from ?to - location",
        "(distance ?from ?to)",
        ["(at start (robot_at ?r ?from))"],
        ["(at start (not (robot_at ?r ?from)))", "(at end (robot_at ?r ?to))"],
        "moving" if battery else None,
    )


def _collect(battery: bool) -> str:
    return _action(
        "collect",
        "?r - robot ?p - spindle ?l - location",
        COLLECTING,
        [
            "(at start (shelf_at ?l))",
            "(at start (on_shelf ?p))",
            "(at start (hand_empty ?r))",
            "(over all (robot_at ?r ?l))",
        ],
        ["(at start (not (on_shelf ?p)))", "(at start (not (hand_empty ?r)))", "(at end (holding ?r ?p))"],
        "collecting" if battery else None,
    )


def _preparation(step: str, battery: bool) -> str:
    return _action(
        preparation_action(step),
        "?r - robot ?p - spindle ?l - location",
        f"(preparation_time {step})",
        ["(at start (base_station_at ?l))", "(over all (robot_at ?r ?l))", "(over all (holding ?r ?p))"],
        [f"(at end (prepared ?p {step}))"],
        step if battery else None,
    )


def _after_preparation(battery: bool) -> list[str]:
    return [
        _action(
            "assemble",
            "?r - robot ?p - spindle ?l - location ?n - level",
            ASSEMBLING,
            [
                "(at start (base_station_at ?l))",
                "(at start (first_level ?n))",
                *(f"(at start (prepared ?p {step}))" for step in PREPARATIONS),
                "(over all (robot_at ?r ?l))",
                "(over all (holding ?r ?p))",
            ],
            ["(at end (rings ?p ?n))"],
            "assembling" if battery else None,
        ),
        _action(
            "mount",
            "?r - robot ?p - spindle ?l - location ?m ?n - level",
            MOUNTING,
            [
                "(at start (ring_station_at ?l))",
                "(at start (next_level ?m ?n))",
                "(at start (rings ?p ?m))",
                "(at start (station_free ?l))",
                "(over all (robot_at ?r ?l))",
                "(over all (holding ?r ?p))",
            ],
            [
                "(at start (not (rings ?p ?m)))",
                "(at start (not (station_free ?l)))",
                "(at end (rings ?p ?n))",
                "(at end (station_free ?l))",
            ],
            "mounting" if battery else None,
        ),
        _action(
            "deliver",
            "?r - robot ?p - spindle ?o - order ?l - location ?n - level",
            DELIVERING,
            [
                "(at start (gate_at ?o ?l))",
                "(at start (spindle_of ?p ?o))",
                "(at start (wants ?o ?n))",
                "(at start (rings ?p ?n))",
                "(at start (holding ?r ?p))",
                "(over all (robot_at ?r ?l))",
                "(over all (window_open ?o))",
            ],
            [
                "(at start (not (holding ?r ?p)))",
                "(at end (hand_empty ?r))",
                "(at end (fulfilled ?o))",
                "(at end (some_fulfilled))",
            ],
            "delivering" if battery else None,
        ),
        _action(
            "dispose",
            "?r - robot ?p - spindle ?l - location",
            DISPOSING,
            ["(at start (holding ?r ?p))", "(over all (robot_at ?r ?l))"],
            ["(at start (not (holding ?r ?p)))", "(at end (hand_empty ?r))"],
            "disposing" if battery else None,
        ),
    ]


def _action(  # noqa: PLR0917 - the parts of an action in the order of PDDL
    name: str, parameters: str, duration: str | Fraction, conditions: list[str], effects: list[str], task: str | None
) -> str:
    """A durative action; `task` is what it uses the battery for, if it does."""
    if task is not None:
        conditions = [*conditions, f"(at start (>= (battery ?r) (battery_use {task})))"]
        effects = [*effects, f"(at start (decrease (battery ?r) (battery_use {task})))"]
    lines = "\n    ".join
    return (
        f"(:durative-action {name}\n  :parameters ({parameters})\n  :duration (= ?duration {duration})\n"
        f"  :condition (and\n    {lines(conditions)})\n  :effect (and\n    {lines(effects)}))"
    )
