"""Seeded random instances of what the theorems of [PIKE] are about, small enough for brute force; for tests only.

Bounds are multiples of 1/2 and drawn times of 1/8: what can be strictly before something can be ε = 1/1000 before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
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
from robust.plan.model import Atom
from tests.pike_bridge.networks import Bound, Stn

P, Q = Literal(Atom("p")), Literal(Atom("q"))
STEP = Fraction(1, 8)
HALF = Fraction(1, 2)


def random_plan(random: Random, *, events: int = 5, ordered: bool = False) -> TeamPlan:
    """Events that make an atom or two true or false, and activities that need them, rather late than early."""
    create = _line if ordered else random_network
    network = create(random, events=events, contradictory=0.05)
    literals = (P, P, P, P, P.negation, Q) if ordered else (P, P, P, P.negation, P.negation, Q, Q.negation)
    activities, conditions, effects = [], [], []
    pairs = [(one, other) for one in network.events for other in network.events if _may_be_before(one, other)]
    for at in range(random.choice((1, 2, 2)) if pairs else 0):
        start, end = max(random.choice(pairs), random.choice(pairs), key=lambda pair: pair[0].name)
        label = _refined(random, start.guard | end.guard, network.choices)
        activities.append(Activity(f"(use{at})", start.name, end.name, HALF, None, guard=label))
        first, last = random.choice(((start, start), (end, end), (start, end)))
        wanted = P if ordered else random.choice((P, P, P, P.negation, Q))
        conditions.append(Condition(wanted, first.name, last.name, label, at))
        if random.random() < 0.4:
            effects.append(Effect(random.choice(literals), random.choice((start, end)).name, label, at))
    for event in network.events:
        for _ in range(random.choice((0, 1, 1, 1, 2))):
            effects.append(
                Effect(random.choice(literals), event.name, _refined(random, event.guard, network.choices), None)
            )
    whole = Tpnu(network.name, network.choices, network.events, network.constraints, tuple(activities))
    return TeamPlan(whole, tuple(conditions), tuple(dict.fromkeys(effects)))


def random_network(random: Random, *, events: int = 5, contradictory: float) -> Tpnu:
    """Up to three choices; events with random guards around a reference schedule, which some bounds contradict.

    In some networks nearly all events are ordered, in others few.
    """
    density, tight = random.choice((0.3, 0.5, 0.9)), random.choice((0.1, 0.3, 0.9))
    choices = tuple(
        Choice(name, ("1", "2", "3")[: random.choice((2, 2, 2, 3))], random.random() < 0.5, None)
        for name in "xyz"[: random.choice((1, 2, 2, 3))]
    )
    names = [f"e{at}" for at in range(1, random.randint(3, events) + 1)]
    points = [Event(name, _refined(random, ALWAYS, choices)) for name in names]
    ordered = random.random() < 0.6
    places = {name: Fraction(at if ordered else random.randint(0, 6), 2) for at, name in enumerate(names)}
    constraints = []
    for one in points:
        for other in points:
            if _may_be_before(one, other) and random.random() < density:
                span = places[other.name] - places[one.name]
                if random.random() < contradictory:
                    span += random.choice((-2, -HALF, HALF, 2))
                bounds = ((span, None), (HALF, None), (span, span + 1), (span, span), (None, span))
                lower, upper = random.choice(bounds if random.random() < tight else bounds[:2])
                label = _refined(random, one.guard | other.guard, choices)
                constraints.append(Constraint(one.name, other.name, lower, upper, label))
    return Tpnu("random", choices, tuple(points), tuple(constraints), ())


def random_differences(random: Random) -> Tpnu:
    """A network of random bounds in any direction: in some scenarios they mostly contradict each other."""
    network = random_network(random, events=5, contradictory=0)
    pairs = [(one, other) for one, other in permutations(network.events, 2) if _consistent(one.guard | other.guard)]
    constraints = []
    for _ in range(random.randint(3, 9) if pairs else 0):
        one, other = random.choice(pairs)
        number = Fraction(random.randint(-4, 6), 2)
        lower, upper = random.choice(((number, None), (None, number), (number, number + 1)))
        label = _refined(random, one.guard | other.guard, network.choices)
        constraints.append(Constraint(one.name, other.name, lower, upper, label))
    return replace(network, constraints=tuple(constraints))


def _line(random: Random, *, events: int, contradictory: float) -> Tpnu:
    """A network whose events are mostly one after the other, if they are activated."""
    network = random_network(random, events=events, contradictory=contradictory)
    order = [
        Constraint(one.name, other.name, HALF, None, one.guard | other.guard)
        for one, other in combinations(network.events, 2)
        if _may_be_before(one, other) and random.random() < 0.85
    ]
    kept = tuple(each for each in network.constraints if random.random() < 0.3)
    return replace(network, constraints=(*order, *kept))


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


def _may_be_before(one: Event, other: Event) -> bool:
    return one.name < other.name and _consistent(one.guard | other.guard)


def _consistent(guard: Guard) -> bool:
    return len({variable for variable, _ in guard}) == len(guard)


def _refined(random: Random, label: Guard, choices: tuple[Choice, ...]) -> Guard:
    """The guard, every third time with an assignment more, if it has none to that choice."""
    choice = random.choice(choices)
    if random.random() < 0.65 or any(choice.name == each.variable for each in label):
        return label
    return label | {Assignment(choice.name, random.choice(choice.domain))}
