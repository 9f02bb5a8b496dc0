"""Small random plans and networks, from seeds and for hypothesis, and random times for them.

Events are shared, literals negative, and conditions over all of an activity. Bounds are multiples of 1/2 and drawn
times of 1/8: what can be strictly before something can be ε = 1/1000 before it.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import combinations, permutations
from pathlib import Path

from hypothesis import strategies as st

from robust.pike_bridge import model
from robust.pike_bridge.builder import act, build, choose, parallel, sequence, within
from robust.pike_bridge.model import ALWAYS, Assignment, Constraint, Effect, Event, Literal, guard
from robust.pike_bridge.theory import is_consistent
from robust.plan.model import Atom

P, Q = Literal(Atom("p")), Literal(Atom("q"))
STEP = Fraction(1, 8)
HALF = Fraction(1, 2)


@dataclass(frozen=True)
class Style:
    """What random plans are like: what effects are about; then how many events have a guard, or effects with more of
    one; how many pairs of events have a constraint, or are ordered by number; and how many effects and choices."""

    literals: tuple[Literal, ...]
    guarded: float = 0.35
    densities: tuple[float, ...] = (0.3, 0.5, 0.9)
    certain: float = 0.0
    effects: tuple[int, ...] = (0, 1, 1, 1, 2)
    choices: tuple[int, ...] = (1, 2, 2, 3)


MIXED = Style((P, P, P, P.negation, P.negation, Q, Q.negation))
ORDERED = Style((P, P, P, P, P.negation, Q), certain=0.85, densities=(0.1, 0.3))
"""There are many producers, and one dominates another."""
CONTESTED = Style((P, P, P.negation), guarded=0.1, densities=(0.1, 0.3, 0.4), effects=(0, 1, 1, 1), choices=(1, 1, 2))
"""Threats may come on either side of links."""


def random_plan(random, *, events=5, style=None):
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
        activities.append(model.Activity(f"(use{at})", start.name, end.name, HALF, None, guard=label))
        first, last = random.choice(((start, start), (end, end), (start, end)))
        known = [each.literal for each in effects if each.event not in {first.name, last.name}]
        wanted = random.choice(known if known and random.random() < 0.9 else style.literals)
        conditions.append(model.Condition(wanted, first.name, last.name, label, at))
        if random.random() < 0.4:
            effects.append(Effect(random.choice(style.literals), random.choice((start, end)).name, label, at))
    if random.random() < 0.2:
        goal = random.choice(network.events)
        conditions.append(model.Condition(random.choice(style.literals), goal.name, goal.name, goal.guard, None))
    whole = replace(network, activities=tuple(activities))
    return model.TeamPlan(whole, tuple(conditions), tuple(dict.fromkeys(effects)))


def random_network(random, *, events=5, contradictory, style=MIXED):
    """Up to three choices; events with random guards around a reference schedule, which some bounds contradict."""
    density, tight = random.choice(style.densities), random.choice((0.1, 0.3, 0.9))
    choices = tuple(
        model.Choice(name, ("1", "2", "3")[: random.choice((2, 2, 2, 3))], random.random() < 0.5, None)
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
    return model.Tpnu("random", choices, tuple(points), tuple(constraints), ())


def random_differences(random):
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


seeds = st.randoms(use_true_random=False)
differences = seeds.map(random_differences)
plans = seeds.map(random_plan)
tiny_plans = seeds.map(partial(random_plan, events=4))


def network(events, *constraints, choices=(), activities=()):
    """By hand: events by name, perhaps with what guards assign; constraints; choices with their values and events."""
    labels = events if isinstance(events, dict) else {name: {} for name in events.split()}
    return model.Tpnu(
        "by hand",
        tuple(model.Choice(name, tuple(values), True, event) for name, values, event in choices),
        tuple(Event(name, guard(label)) for name, label in labels.items()),
        tuple(constraint(*each) for each in constraints),
        tuple(activities),
    )


def constraint(source, target, lower, upper, label=ALWAYS):
    lower, upper = (None if bound is None else Fraction(bound) for bound in (lower, upper))
    return Constraint(source, target, lower, upper, guard(dict(label)))


@st.composite
def elements(draw, size=6, names=None):
    """Sequences, parallel branches and up to three choices, nested or not, of up to so many activities."""
    names = names or iter("xyz")
    if size <= 1:
        lower = draw(st.integers(1, 4))
        return act("(move)", lower, draw(st.none() | st.integers(lower, 6))) if size else sequence()
    left = draw(st.integers(0, size - 1))
    first, second = draw(elements(left, names)), draw(elements(size - max(left, 1), names))
    kind = draw(st.sampled_from(("sequence", "parallel", "choice", "choice")))
    if kind == "choice" and (name := next(names, None)) is not None:
        whole = choose(name, {"1": first, "2": second}, controllable=draw(st.booleans()))
    else:
        whole = parallel(first, second) if kind == "parallel" else sequence(first, second)
    bound = draw(st.none() | st.none() | st.integers(2, 8))
    return within(whole, upper=bound) if draw(st.booleans()) else within(whole, lower=bound)


def programs(activities=6):
    sizes = st.integers(1, activities)
    return sizes.flatmap(elements).map(lambda whole: build("program", whole, epsilon=Fraction(1, 4)))


networks = st.one_of(differences, programs())


def random_schedule(stn, random):
    """Random times that satisfy all constraints, if there is room for each event in turn."""
    left, times = stn.copy(), {}
    for event in random.sample(stn.events, len(stn.events)):
        anchor = next(iter(times), None)
        if anchor is None:
            times[event] = Fraction(random.randint(0, 16), 8)
            continue
        room = list(_room(left.bounds.get((event, anchor)), left.bounds.get((anchor, event)), random))
        if not room:
            return None
        difference = random.choice(room)
        left.apart(anchor, event, difference)
        times[event] = times[anchor] + difference
    return times


def random_times(stn, random):
    """Times that need not satisfy anything."""
    return {event: Fraction(random.randint(0, 8), 2) for event in stn.events}


def _room(back, forth, random):
    """Multiples of the step within bounds on t(anchor) − t(event) and t(event) − t(anchor), at most 3 wide if open."""
    if back is None and forth is None:
        back, forth = (Fraction(random.randint(0, 3)), 0), (Fraction(random.randint(0, 3)), 0)
    low = (forth[0] - 3, 0) if back is None else (-back[0], -back[1])
    high = (low[0] + 3, 0) if forth is None else forth
    first = low[0] // STEP
    steps = (first * STEP + STEP * count for count in range(int((high[0] - first * STEP) // STEP) + 1))
    return (number for number in steps if low <= (number, 0) <= high)


def _refined(random, label, choices, share):
    """The guard, sometimes with an assignment more, if it has none to that choice."""
    choice = random.choice(choices)
    if random.random() > share or any(choice.name == each.variable for each in label):
        return label
    return label | {Assignment(choice.name, random.choice(choice.domain))}


DOMAIN, PROBLEM = (
    (Path(__file__).parent / "data" / "kitchen" / f"{name}.pddl").read_text(encoding="utf-8")
    for name in ("domain", "problem")
)


def kitchen():
    taking = {vessel: act(f"(get human {vessel})", "0.5", 2, agent="human") for vessel in ("mug", "glass")}
    pouring = {vessel: act(f"(pour robot {vessel})", 1, 3, agent="robot") for vessel in ("mug", "glass")}
    making = {food: act(f"(make human {food})", 2, 4, agent="human") for food in ("bagel", "cereal")}
    return build(
        "kitchen",
        sequence(
            choose("xA1", taking, controllable=False),
            parallel(choose("xR1", pouring), choose("xA2", making, controllable=False)),
        ),
    )
