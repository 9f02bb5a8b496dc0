"""Hypothesis strategies for small team plans, with shared events, threats, negative literals, conditions over all."""

from __future__ import annotations

from fractions import Fraction
from itertools import count

from hypothesis import strategies as st

from robust.pike_bridge import builder
from robust.pike_bridge.model import (
    ALWAYS,
    EPSILON,
    GOAL,
    INITIAL,
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

ATOMS = (Atom("p"), Atom("q"))
literals = st.builds(Literal, st.sampled_from((ATOMS[0], ATOMS[0], ATOMS[1])), st.booleans())


@st.composite
def choices(draw: st.DrawFn, most: int) -> tuple[Choice, ...]:
    sizes = draw(st.lists(st.sampled_from((2, 2, 3)), max_size=most))
    return tuple(
        Choice(name, tuple(str(value + 1) for value in range(size)), draw(st.booleans()), None)
        for name, size in zip("xyz", sizes, strict=False)
    )


@st.composite
def guards(draw: st.DrawFn, variables: tuple[Choice, ...], most: int = 1) -> Guard:
    if not variables:
        return frozenset()
    chosen = draw(st.lists(st.sampled_from(variables), max_size=most, unique_by=lambda choice: choice.name))
    return frozenset(Assignment(choice.name, draw(st.sampled_from(choice.domain))) for choice in chosen)


@st.composite
def networks(draw: st.DrawFn, events: int) -> Tpnu:
    """Arbitrary networks around a reference schedule, in which several activities may share an event."""
    variables = draw(choices(3 if events > 3 else 2))
    points = [Event(f"e{at}", draw(guards(variables))) for at in range(1, events + 1)]
    reference = {event.name: draw(st.integers(0, 4)) for event in points}
    pairs = [
        (source, target)
        for source in points
        for target in points
        if source.name < target.name and is_consistent(source.guard | target.guard)
    ]
    if not pairs:
        return Tpnu("arbitrary", variables, tuple(points), (), ())
    activities, constraints = [], []
    for at in range(draw(st.integers(2, 4))):
        source, target = draw(st.sampled_from(pairs))
        label = source.guard | target.guard
        extra = draw(guards(variables))
        label = label | extra if is_consistent(label | extra) else label
        span = max(1, reference[target.name] - reference[source.name])
        upper = draw(st.sampled_from((None, None, span, span + 1)))
        lower = draw(st.integers(1, span))
        activities.append(Activity(f"(act{at})", source.name, target.name, Fraction(lower), _exact(upper), guard=label))
    for _ in range(draw(st.integers(0, 3))):
        source, target = draw(st.sampled_from(pairs))
        span = reference[target.name] - reference[source.name]
        lower = draw(st.sampled_from((None, span, span - 1, Fraction(span) - Fraction(1, 2))))
        upper = draw(st.sampled_from((None, None, span, span + 2)))
        constraints.append(
            Constraint(source.name, target.name, _exact(lower), _exact(upper), source.guard | target.guard)
        )
    return Tpnu("arbitrary", variables, tuple(points), tuple(constraints), tuple(activities))


def _exact(number: int | Fraction | None) -> Fraction | None:
    return None if number is None else Fraction(number)


@st.composite
def programs(draw: st.DrawFn, most_activities: int = 5) -> Tpnu:
    """Networks written with the builder: sequences, parallel branches and choices."""
    left = [draw(st.integers(2, most_activities))]
    names = count(1)
    variables = iter("xyz")

    def activity() -> builder.Element:
        left[0] -= 1
        lower = draw(st.integers(1, 2))
        upper = draw(st.sampled_from((lower, lower + 1, None)))
        return builder.act(f"(act{next(names)})", lower, upper)

    def element(depth: int) -> builder.Element:
        kind = draw(st.sampled_from(("act", "act", "choose", "parallel", "skip"))) if depth else "act"
        if kind == "act" and left[0] > 0:
            return activity()
        if kind == "choose" and (name := next(variables, None)) is not None:
            return builder.choose(name, {"1": element(depth - 1), "2": element(depth - 1)})
        if kind == "parallel":
            return builder.parallel(element(depth - 1), element(depth - 1))
        return builder.sequence()

    top: builder.Element = builder.parallel(element(2), element(2)) if draw(st.booleans()) else element(2)
    upper = draw(st.sampled_from((None, None, 3, 5)))
    return builder.build("program", builder.within(builder.sequence(top, element(1)), upper=upper))


@st.composite
def with_knowledge(draw: st.DrawFn, network: Tpnu, *, ends: bool | None = None) -> TeamPlan:
    """Random conditions and effects for the activities of a network, perhaps an initial state and a goal."""
    ends = draw(st.booleans()) if ends is None else ends
    initial = draw(st.lists(literals, min_size=1, max_size=2)) if ends else []
    effects: list[Effect] = []
    conditions: list[Condition] = []
    for at, activity in enumerate(network.activities):
        for _ in range(draw(st.integers(0, 2))):
            event = draw(st.sampled_from((activity.source, activity.target, activity.target)))
            effects.append(Effect(draw(literals), event, activity.guard, at))
    known = [effect.literal for effect in effects] + initial
    wanted = st.one_of(st.sampled_from(known), st.sampled_from(known), literals) if known else literals
    for at, activity in enumerate(network.activities):
        start, end = activity.source, activity.target
        for _ in range(draw(st.sampled_from((0, 0, 1, 1, 2)))):
            first, last = draw(st.sampled_from(((start, start), (start, start), (end, end), (start, end))))
            conditions.append(Condition(draw(wanted), first, last, activity.guard, at))
    plan = TeamPlan(network, tuple(conditions), tuple(effects))
    return _between_ends(plan, initial, draw(st.lists(wanted, max_size=1))) if ends else plan


def _between_ends(plan: TeamPlan, initial: list[Literal], goal: list[Literal]) -> TeamPlan:
    network = plan.network
    ordered = [
        *(Constraint(INITIAL, event.name, EPSILON, None, event.guard) for event in network.events),
        *(Constraint(event.name, GOAL, EPSILON, None, event.guard) for event in network.events),
    ]
    return TeamPlan(
        Tpnu(
            network.name,
            network.choices,
            (Event(INITIAL), *network.events, Event(GOAL)),
            (*network.constraints, *ordered, Constraint(INITIAL, GOAL, EPSILON, None)),
            network.activities,
        ),
        (*plan.conditions, *(Condition(literal, GOAL, GOAL, frozenset(), None) for literal in goal)),
        (*plan.effects, *(Effect(literal, INITIAL, frozenset(), None) for literal in initial)),
    )


@st.composite
def tiny_plans(draw: st.DrawFn) -> TeamPlan:
    """Plans of at most five events, all orders of which can be tried."""
    ends = draw(st.booleans())
    network = draw(networks(events=draw(st.integers(2, 3 if ends else 5))))
    return draw(with_knowledge(network, ends=ends))


@st.composite
def team_plans(draw: st.DrawFn) -> TeamPlan:
    """Plans of up to six activities."""
    network = draw(st.one_of(programs(), networks(events=5)))
    return draw(with_knowledge(network))


@st.composite
def contested_plans(draw: st.DrawFn) -> TeamPlan:
    """One or two conditions about one atom that nearly every event makes true or false, and few other constraints."""
    variables = draw(choices(2))
    names = [f"e{at}" for at in range(1, draw(st.integers(4, 5)) + 1)]
    points = [Event(name, draw(guards(variables)) if draw(st.booleans()) else ALWAYS) for name in names]
    places = {event.name: draw(st.integers(0, 3)) for event in points}
    pairs = [
        (one, other)
        for one in points
        for other in points
        if places[one.name] < places[other.name] and is_consistent(one.guard | other.guard)
    ]
    constraints = [
        Constraint(one.name, other.name, Fraction(1), _exact(draw(st.sampled_from((None, None, 1, 3)))), label)
        for one, other in pairs
        if draw(st.booleans())
        for label in (one.guard | other.guard,)
    ]
    effects = []
    for event in points:
        for _ in range(draw(st.sampled_from((0, 1, 1, 1, 2)))):
            extra = event.guard | draw(guards(variables))
            label = extra if is_consistent(extra) and draw(st.booleans()) else event.guard
            effects.append(Effect(Literal(ATOMS[0], draw(st.booleans())), event.name, label, None))
    activities, conditions = [], []
    for at in range(draw(st.sampled_from((1, 1, 2))) if pairs else 0):
        start, end = draw(st.sampled_from(pairs))
        label = start.guard | end.guard
        activities.append(Activity(f"(use{at})", start.name, end.name, Fraction(1), None, guard=label))
        first, last = draw(st.sampled_from(((start, end), (start, end), (start, start), (end, end))))
        conditions.append(Condition(Literal(ATOMS[0]), first.name, last.name, label, at))
        if draw(st.booleans()):
            at_start, positive = draw(st.booleans()), draw(st.booleans())
            effects.append(Effect(Literal(ATOMS[0], positive), (start if at_start else end).name, label, at))
    network = Tpnu("contested", variables, tuple(points), tuple(constraints), tuple(activities))
    return TeamPlan(network, tuple(conditions), tuple(effects))
