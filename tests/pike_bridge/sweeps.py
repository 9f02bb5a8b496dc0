"""Seeded random instances of what the theorems of [PIKE] are about, small enough for brute force; for tests only.

Bounds are multiples of 1/2 and drawn times of 1/8: what can be strictly before something can be ε = 1/1000 before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations, permutations
from random import Random

from robust.pike_bridge.model import (
    ALWAYS,
    Activity,
    Assignment,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Guard,
    Literal,
    TeamPlan,
    Tpnu,
)
from robust.pike_bridge.theory import is_consistent
from robust.plan.model import Atom
from tests.pike_bridge.brute_force import Bound, Stn

P, Q = Literal(Atom("p")), Literal(Atom("q"))
STEP = Fraction(1, 8)
HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Style:
    """What random plans are like."""

    literals: tuple[Literal, ...]
    """What effects are about."""
    guarded: float = 0.35
    """How many events have a guard, or have effects with more of one than they have."""
    densities: tuple[float, ...] = (0.3, 0.5, 0.9)
    """How many pairs of events have a constraint."""
    certain: float = 0.0
    """How many pairs of events are ordered by their numbers."""
    effects: tuple[int, ...] = (0, 1, 1, 1, 2)
    """How many effects an event may have."""
    choices: tuple[int, ...] = (1, 2, 2, 3)
    """How many choices there may be."""


MIXED = Style((P, P, P, P.negation, P.negation, Q, Q.negation))
ORDERED = Style((P, P, P, P, P.negation, Q), certain=0.85, densities=(0.1, 0.3))
"""There are many producers, and one dominates another."""
CONTESTED = Style((P, P, P.negation), guarded=0.1, densities=(0.1, 0.3, 0.4), effects=(0, 1, 1, 1), choices=(1, 1, 2))
"""Threats may come on either side of links."""


def random_plan(random: Random, *, events: int = 5, style: Style | None = None) -> TeamPlan:
    """Events that make an atom or two true or false, and activities that need them, rather late than early."""
    style = style or random.choice((MIXED, ORDERED, CONTESTED, CONTESTED))
    network = random_network(random, events=events, contradictory=0.05, style=style)
    effects = [
        Effect(
            random.choice(style.literals), each.name, _refined(random, each.guard, network.choices, style.guarded), None
        )
        for each in network.events
        for _ in range(random.choice(style.effects))
    ]
    activities, conditions = [], []
    pairs = [(one, other) for one, other in combinations(network.events, 2) if is_consistent(one.guard | other.guard)]
    for at in range(random.choice((1, 2, 2)) if pairs else 0):
        start, end = max(random.choice(pairs), random.choice(pairs), key=lambda pair: pair[0].name)
        label = _refined(random, start.guard | end.guard, network.choices, style.guarded)
        activities.append(Activity(f"(use{at})", start.name, end.name, HALF, None, guard=label))
        first, last = random.choice(((start, start), (end, end), (start, end)))
        known = [each.literal for each in effects if each.event not in {first.name, last.name}]
        wanted = random.choice(known if known and random.random() < 0.9 else style.literals)
        conditions.append(Condition(wanted, first.name, last.name, label, at))
        if random.random() < 0.4:
            effects.append(Effect(random.choice(style.literals), random.choice((start, end)).name, label, at))
    whole = replace(network, activities=tuple(activities))
    return TeamPlan(whole, tuple(conditions), tuple(dict.fromkeys(effects)))


def random_network(random: Random, *, events: int = 5, contradictory: float, style: Style = MIXED) -> Tpnu:
    """Up to three choices; events with random guards around a reference schedule, which some bounds contradict."""
    density, tight = random.choice(style.densities), random.choice((0.1, 0.3, 0.9))
    choices = tuple(
        Choice(name, ("1", "2", "3")[: random.choice((2, 2, 2, 3))], random.random() < 0.5, None)
        for name in "xyz"[: random.choice(style.choices)]
    )
    names = [f"e{at}" for at in range(1, random.randint(3, events) + 1)]
    points = [Event(name, _refined(random, ALWAYS, choices, style.guarded)) for name in names]
    by_number = random.random() < 0.6
    places = {name: Fraction(at if by_number else random.randint(0, 6), 2) for at, name in enumerate(names)}
    constraints = []
    for one, other in combinations(points, 2):
        both = one.guard | other.guard
        if is_consistent(both) and random.random() < style.certain:
            constraints.append(Constraint(one.name, other.name, HALF, None, both))
        if is_consistent(both) and random.random() < density:
            span = places[other.name] - places[one.name]
            if random.random() < contradictory:
                span += random.choice((-2, -HALF, HALF, 2))
            bounds = ((span, None), (HALF, None), (span, span + 1), (span, span), (None, span))
            lower, upper = random.choice(bounds if random.random() < tight else bounds[:2])
            label = _refined(random, both, choices, style.guarded)
            constraints.append(Constraint(one.name, other.name, lower, upper, label))
    return Tpnu("random", choices, tuple(points), tuple(constraints), ())


def random_differences(random: Random) -> Tpnu:
    """A network of random bounds in any direction: in some scenarios they mostly contradict each other."""
    network = random_network(random, events=5, contradictory=0)
    pairs = [(one, other) for one, other in permutations(network.events, 2) if is_consistent(one.guard | other.guard)]
    constraints = []
    for _ in range(random.randint(3, 9) if pairs else 0):
        one, other = random.choice(pairs)
        number = Fraction(random.randint(-4, 6), 2)
        lower, upper = random.choice(((number, None), (None, number), (number, number + 1)))
        label = _refined(random, one.guard | other.guard, network.choices, 0.35)
        constraints.append(Constraint(one.name, other.name, lower, upper, label))
    return replace(network, constraints=tuple(constraints))


def random_schedule(stn: Stn, random: Random) -> dict[str, Fraction] | None:
    """Random times that satisfy all constraints, if there is room for each event in turn."""
    left = stn.copy()
    times: dict[str, Fraction] = {}
    for event in random.sample(stn.events, len(stn.events)):
        anchor = next(iter(times), None)
        if anchor is None:
            times[event] = Fraction(random.randint(0, 16), 8)
            continue
        room = list(_room(left.bounds.get((event, anchor)), left.bounds.get((anchor, event)), random))
        if not room:
            return None
        difference = random.choice(room)
        left.at_most(anchor, event, (difference, 0)).at_most(event, anchor, (-difference, 0))
        times[event] = times[anchor] + difference
    return times


def random_times(stn: Stn, random: Random) -> dict[str, Fraction]:
    """Times that need not satisfy anything."""
    return {event: Fraction(random.randint(0, 8), 2) for event in stn.events}


def _room(back: Bound | None, forth: Bound | None, random: Random) -> Iterator[Fraction]:
    """Multiples of the step within bounds on t(anchor) − t(event) and t(event) − t(anchor), at most 3 wide if open."""
    if back is None and forth is None:
        back, forth = (Fraction(random.randint(0, 3)), 0), (Fraction(random.randint(0, 3)), 0)
    low = (-back[0], -back[1]) if back is not None else None
    if low is None:
        assert forth is not None
        low = (forth[0] - 3, 0)
    high = forth if forth is not None else (low[0] + 3, 0)
    number = low[0] // STEP * STEP
    while (number, 0) <= high:
        if (number, 0) >= low:
            yield number
        number += STEP


def _refined(random: Random, label: Guard, choices: tuple[Choice, ...], share: float) -> Guard:
    """The guard, sometimes with an assignment more, if it has none to that choice."""
    choice = random.choice(choices)
    if random.random() > share or any(choice.name == each.variable for each in label):
        return label
    return label | {Assignment(choice.name, random.choice(choice.domain))}
