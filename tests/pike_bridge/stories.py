"""The plans that the paper shows: its figures, the kitchen and the wing.

An action `p…` of a figure produces what `c…` consumes, and `t…` threatens that.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from robust.pike_bridge.action_model import Instance, shipped
from robust.pike_bridge.builder import Element, act, build, choose, parallel, sequence
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

_ROLES = {
    "p": ActionText("p", end_effects=("(p)",)),
    "t": ActionText("t", end_effects=("(not (p))",)),
    "c": ActionText("c", at_start=("(p)",)),
}


def _activity(name: str) -> Element:
    return act(f"({name})", 1, 3)


def _optional(choice: str, activity: str) -> Element:
    """The activity if the choice is 1, nothing if it is 2."""
    return choose(choice, {"1": _activity(activity), "2": sequence()})


def _instance(name: str, program: Element) -> Instance:
    network = build(name, program)
    actions = [each.action.strip("()") for each in network.activities]
    texts = [replace(_ROLES.get(one[0], ActionText(one)), name=one) for one in actions]
    return Instance(network, sketched_domain(name, ("(p)",), texts), sketched_problem(name, name, (), ()))


def figure_6a() -> Instance:
    """Two unordered producers before a consumer, without choices."""
    return _instance("figure-6a", sequence(parallel(_activity("p1"), _activity("p2")), _activity("c")))


def figure_6b() -> Instance:
    """The same with a choice around each: the consumer (z = 1) needs x = 1 or y = 1."""
    producers = parallel(_optional("x", "p1"), _optional("y", "p2"))
    return _instance("figure-6b", sequence(producers, _optional("z", "c")))


def figure_7a() -> Instance:
    """The later producer is always activated: its link dominates that of the optional one."""
    return _instance("figure-7a", sequence(_optional("x", "p1"), _activity("p2"), _activity("c")))


def figure_7b() -> Instance:
    """The later producer is optional: no link dominates the other."""
    return _instance("figure-7b", sequence(_activity("p1"), _optional("x", "p2"), _activity("c")))


def figure_8() -> Instance:
    """Several producers one after the other, of which only the last two matter: the last is optional."""
    producers = [_optional("x", "p1"), _activity("p2"), _activity("p3"), _optional("y", "p4")]
    return _instance("figure-8", sequence(*producers, _activity("c")))


def figure_9() -> Instance:
    """A consumer that starts 1 to 3 after its producer has ended, and a threat that must not come between the two."""
    program = parallel(sequence(_activity("p1"), _activity("c")), _activity("t1"))
    instance = _instance("figure-9", program)
    producer, consumer, _ = instance.network.activities
    # Programs bound elements, not what lies between them: so the link itself gets the bounds.
    constraints = tuple(
        replace(one, lower=Fraction(1), upper=Fraction(3))
        if (one.source, one.target) == (producer.target, consumer.source)
        else one
        for one in instance.network.constraints
    )
    return replace(instance, network=replace(instance.network, constraints=constraints))


def figure_11() -> Instance:
    """Two producers, two threats and a consumer, all optional and unordered."""
    parts = {"u": "p1", "v": "p2", "w": "c", "x": "t1", "y": "t2"}
    return _instance("figure-11", parallel(*(_optional(*part) for part in parts.items())))


def figure_13() -> Instance:
    """The threat comes after the second producer, and in any order with the first and the consumer."""
    line = sequence(_optional("y", "p1"), _optional("z", "c"))
    return _instance("figure-13", sequence(_activity("p2"), parallel(_optional("x", "t1"), line)))


def figure_23(choices: int = 3) -> Instance:
    """As many choices one after the other, each between two activities of [2, 4].

    Labeled shortest paths from end to start need one value with completions, and two to the number of choices without.
    """
    steps = [
        choose(f"x{number}", {"1": act(f"(a{number}-1)", 2, 4), "2": act(f"(a{number}-2)", 2, 4)})
        for number in range(1, choices + 1)
    ]
    return _instance(f"figure-23-{choices}", sequence(*steps))


def kitchen():
    """The breakfast plan [PIKE §1.1]. Choices: Alice's xA1 to xA4 (uncontrollable), the robot's xR1 and xR2."""
    return shipped("kitchen")


def wing():
    """The wing of an aeroplane [PIKE §6.1]. Choices: the human's h1 and h2 (uncontrollable), Baxter's b1 and b2."""
    return shipped("wing")
