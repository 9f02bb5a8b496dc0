"""`--outcome` and `--disturb`: what is known beforehand of a simulated execution."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import parse_number, shorten
from robust.pike_bridge.compile import checked_assumptions
from robust.pike_bridge.model import Literal, TeamPlan
from robust.pike_bridge.online.world import Disturbance, Human, Pace, Story
from robust.plan.model import Atom

_ATOM = re.compile(r"\(\s*([^\s()]+(?:\s+[^\s()]+)*)\s*\)")
_NEGATION = re.compile(r"\(\s*not\s*(\(.*\))\s*\)", re.IGNORECASE)


def story(
    plan: TeamPlan, *, human: str, pace: str, outcomes: Sequence[str], disturbances: Sequence[str], delay: Fraction
) -> Story:
    """The story of a simulated execution.

    Raises:
        InputError: if a choice, a value, an atom or a time is not what it should be.
    """
    return Story(
        human=Human(human),
        pace=Pace(pace),
        outcomes=dict(_outcome(plan, text) for text in outcomes),
        disturbances=tuple(_disturbance(plan, text) for text in disturbances),
        delay=delay,
    )


def _outcome(plan: TeamPlan, text: str) -> tuple[str, tuple[str, Fraction | None]]:
    """`NAME=VALUE`, or `NAME=VALUE@TIME`."""
    place = Location(f"--outcome {shorten(text)}")
    assignment, at, time = (part.strip() for part in text.partition("@"))
    name, equals, value = (part.strip() for part in assignment.partition("="))
    if not equals or not name or not value:
        raise InputError(f"found {shorten(text)}, expected NAME=VALUE or NAME=VALUE@TIME", place)
    checked_assumptions(plan, {name: value})
    if next(each.controllable for each in plan.network.choices if each.name == name):
        raise InputError(f"{name} is for the executive to choose; expected an uncontrollable choice", place)
    return name, (value, _time(time, place) if at else None)


def _disturbance(plan: TeamPlan, text: str) -> Disturbance:
    """`(atom)@TIME` or `(not (atom))@TIME`."""
    place = Location(f"--disturb {shorten(text)}")
    literal, at, time = (part.strip() for part in text.rpartition("@"))
    literal, time = (literal, time) if at else (text, "")
    negated = _NEGATION.fullmatch(literal)
    atom = _ATOM.fullmatch(negated.group(1) if negated else literal)
    if atom is None or not time:
        raise InputError(f"found {shorten(text)}, expected '(atom)@TIME' or '(not (atom))@TIME'", place)
    predicate, *arguments = atom.group(1).lower().split()
    wanted = Atom(predicate, tuple(arguments))
    known = {str(effect.literal.atom) for effect in plan.effects}
    if str(wanted) not in known:
        raise InputError(f"nothing in the plan is about {wanted}{did_you_mean(str(wanted), known)}", place)
    return Disturbance(_time(time, place), Literal(wanted, negated is None))


def _time(text: str, place: Location) -> Fraction:
    time = parse_number(text, place)
    if time < 0:
        raise InputError(f"found time {shorten(text)}, expected 0 or later", place)
    return time
