"""Programs and the networks built of them, against the meaning of a program said by recursion."""

from dataclasses import dataclass
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.builder import (
    Act,
    Choose,
    InParallel,
    InSequence,
    Within,
    act,
    build,
    choose,
    parallel,
    sequence,
    within,
)
from robust.pike_bridge.model import EPSILON, Choice, Constraint, Event, guard
from robust.pike_bridge.scenarios import candidate_subplans
from robust.pike_bridge.validate import validate
from tests.pike_bridge.brute_force import candidate_subplan, holds, scenarios


@st.composite
def elements(draw, depth=2, names=None):
    names = iter("xyz") if names is None else names
    kind = draw(st.sampled_from(("act", "choose", "parallel", "sequence", "within"))) if depth else "act"
    inner = elements(depth - 1, names) if depth else st.nothing()
    if kind == "choose" and (name := next(names, None)) is not None:
        return choose(name, {value: draw(inner) for value in "12"}, controllable=draw(st.booleans()))
    if kind == "parallel":
        return parallel(*(draw(inner) for _ in range(draw(st.integers(0, 2)))))
    if kind == "sequence":
        return sequence(*(draw(inner) for _ in range(draw(st.integers(0, 3)))))
    if kind == "within":
        return within(draw(inner), lower=draw(st.none() | st.integers(0, 9)))
    return act("(wait)", draw(st.integers(1, 3)), None)


def shortest(element, scenario):
    """How long an element takes at least."""
    match element:
        case Act(_, lower):
            return lower
        case InSequence(parts):
            return sum((shortest(part, scenario) for part in parts), EPSILON * max(0, len(parts) - 1))
        case InParallel(parts):
            return max((shortest(part, scenario) + 2 * EPSILON for part in parts), default=EPSILON)
        case Choose(name, branches):
            return shortest(dict(branches)[scenario[name]], scenario) + 2 * EPSILON
        case Within(inner, lower):
            return max(shortest(inner, scenario), lower or 0)


def subplans(element):
    """[PIKE §6.2.2]: products of sequential and parallel structure, sums of choices."""
    match element:
        case Act():
            return 1
        case InSequence(parts) | InParallel(parts):
            count = 1
            for part in parts:
                count *= subplans(part)
            return count
        case Choose(_, branches):
            return sum(subplans(branch) for _, branch in branches)
        case Within(inner):
            return subplans(inner)


def activities(element, scenario):
    match element:
        case Act():
            return 1
        case InSequence(parts) | InParallel(parts):
            return sum(activities(part, scenario) for part in parts)
        case Choose(name, branches):
            return activities(dict(branches)[scenario[name]], scenario)
        case Within(inner):
            return activities(inner, scenario)


@dataclass
class Ends:
    """The events at which a plan starts and ends: those of two activities around it."""

    start: str
    end: str


@given(elements())
def test_every_candidate_subplan_means_the_program(element):
    # A sum of nothing happens in no time, so that a program of moments is one moment.
    if isinstance(element, Within) and element.lower and shortest(element.element, dict.fromkeys("xyz", "1")) == 0:
        return
    network = build("p", sequence(act("(begin)", 1, 1), element, act("(end)", 1, 1)))
    validate(network)
    assert candidate_subplans(network) == subplans(element)
    begin, end = network.activities[0], network.activities[-1]
    for scenario in scenarios(network.domains):
        stn = candidate_subplan(network, scenario)
        active = [one for one in network.activities if holds(one.guard, scenario)]
        assert len(active) == activities(element, scenario) + 2
        if stn.consistent:
            least = -stn.bounds[end.source, begin.target][0]
            assert least == shortest(element, scenario) + 2 * EPSILON


def test_the_network_of_a_choice():
    network = build("p", choose("x", {"a": act("(GO)", "0.5", 2, agent="robot"), "b": sequence()}, controllable=False))
    a, b = guard({"x": "a"}), guard({"x": "b"})
    assert network.choices == (Choice("x", ("a", "b"), False, "e1"),)
    assert network.events == (Event("e1"), Event("e2", a), Event("e3", a), Event("e4", b), Event("e5"))
    assert network.constraints == (
        Constraint("e1", "e2", EPSILON, None, a),
        Constraint("e3", "e5", EPSILON, None, a),
        Constraint("e1", "e4", EPSILON, None, b),
        Constraint("e4", "e5", EPSILON, None, b),
        Constraint("e1", "e5", EPSILON, None),
    )
    (activity,) = network.activities
    assert (activity.action, activity.source, activity.target, activity.guard) == ("(go)", "e2", "e3", a)
    assert (activity.lower, activity.upper, activity.agent) == (Fraction(1, 2), 2, "robot")


def test_bounds_around_an_element():
    network = build("p", within(act("(go)", 1, 2), lower="1/3", upper=5), epsilon=Fraction(1, 10))
    assert network.constraints == (Constraint("e1", "e2", Fraction(1, 3), Fraction(5)),)


def test_mistakes():
    branches = {"a": sequence()}
    with pytest.raises(InputError, match="'x' is made twice"):
        build("p", sequence(choose("x", branches), choose("x", branches)))
    with pytest.raises(InputError, match="'x' has no branches"):
        build("p", choose("x", {}))
    with pytest.raises(InputError, match="expected a number"):
        act("(go)", "soon", None)
