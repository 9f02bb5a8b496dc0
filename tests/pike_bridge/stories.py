"""The plans that the paper shows: its figures, the kitchen and the wing; satisfiability as plans.

An action `p…` of a figure produces what `c…` consumes, and `t…` threatens that.
"""

from dataclasses import replace
from fractions import Fraction
from functools import partial

from robust.pike_bridge.action_model import Instance, shipped
from robust.pike_bridge.builder import ClauseFormula, act, build, choose, parallel, satisfiability, sequence
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

_ROLES = {
    "p": ActionText("p", end_effects=("(p)",)),
    "t": ActionText("t", end_effects=("(not (p))",)),
    "c": ActionText("c", at_start=("(p)",)),
}
P1, P2, P3, P4, T1, T2, C = (act(f"({name})", 1, 3) for name in ("p1", "p2", "p3", "p4", "t1", "t2", "c"))


def _optional(choice, activity):
    """The activity if the choice is 1, nothing if it is 2."""
    return choose(choice, {"1": activity, "2": sequence()})


FIGURES = {
    "6a": sequence(parallel(P1, P2), C),  # two unordered producers before a consumer, without choices
    # with a choice around each: the consumer (z = 1) needs x = 1 or y = 1
    "6b": sequence(parallel(_optional("x", P1), _optional("y", P2)), _optional("z", C)),
    "7a": sequence(_optional("x", P1), P2, C),  # the later producer is always activated: its link dominates the other
    "7b": sequence(P1, _optional("x", P2), C),  # the later producer is optional: no link dominates the other
    # several producers one after the other, of which only the last two matter: the last is optional
    "8": sequence(_optional("x", P1), P2, P3, _optional("y", P4), C),
    "9": parallel(sequence(P1, C), T1),  # a threat must not come between producer and consumer
    # all optional and unordered
    "11": parallel(*(_optional(*part) for part in zip("uvwxy", (P1, P2, C, T1, T2), strict=True))),
    # the threat comes after the second producer, and in any order with the first and the consumer
    "13": sequence(P2, parallel(_optional("x", T1), sequence(_optional("y", P1), _optional("z", C)))),
}


def _instance(name, program):
    network = build(name, program)
    actions = [each.action.strip("()") for each in network.activities]
    texts = [replace(_ROLES.get(action[0], ActionText(action)), name=action) for action in actions]
    return Instance(network, sketched_domain(name, ("(p)",), texts), sketched_problem(name, name, (), ()))


def figure(name):
    """By its number; the consumer of figure 9 starts 1 to 3 after its producer has ended."""
    instance = _instance(f"figure-{name}", FIGURES[name])
    if name != "9":
        return instance
    producer, consumer, _ = instance.network.activities
    # Programs bound elements, not what lies between them: so the link itself gets the bounds.
    link, bounds = (producer.target, consumer.source), {"lower": Fraction(1), "upper": Fraction(3)}
    constraints = (
        replace(each, **bounds) if (each.source, each.target) == link else each for each in instance.network.constraints
    )
    return replace(instance, network=replace(instance.network, constraints=tuple(constraints)))


def figure_23(choices=3):
    """As many choices one after the other, each between two activities of [2, 4].

    Labeled shortest paths from end to start need one value with completions, and two to the number of choices without.
    """
    steps = [
        choose(f"x{number}", {"1": act(f"(a{number}-1)", 2, 4), "2": act(f"(a{number}-2)", 2, 4)})
        for number in range(1, choices + 1)
    ]
    return _instance(f"figure-23-{choices}", sequence(*steps))


kitchen = partial(shipped, "kitchen")
"""The breakfast plan [PIKE §1.1]. Choices: Alice's xA1 to xA4 (uncontrollable), the robot's xR1 and xR2."""
wing = partial(shipped, "wing")
"""The wing of an aeroplane [PIKE §6.1]. Choices: the human's h1 and h2 (uncontrollable), Baxter's b1 and b2."""


def sat_plan(clauses):
    """The plan of a formula, with clauses as in DIMACS files, of no more variables than they mention."""
    variables = max((abs(literal) for clause in clauses for literal in clause), default=0)
    return satisfiability(ClauseFormula(variables, tuple(map(tuple, clauses))))
