"""Part of an airplane wing, put together by a human and three robots [PIKE §6.1]. Times are in seconds.

Two robots lift the frame. Then the human and Baxter fasten a rib by two clecos, one after the other. Each time the
human picks the pliers, a cleco, or both, and Baxter brings what is missing: a cleco, the pliers, or nothing.
"""

from __future__ import annotations

from robust.pike_bridge.builder import Element, act, build, choose, parallel, sequence, within
from robust.pike_bridge.generators.action_text import ActionText, domain_text, problem_text
from robust.pike_bridge.instance import Instance

_CLECOS = ("cleco1", "cleco2")
_ACTIONS = (
    ActionText("lift", parameters="?robot - agent", end_effects=("(holds-frame ?robot)",)),
    ActionText(
        "place-rib",
        parameters="?who - agent",
        over_all=("(holds-frame left)", "(holds-frame right)"),
        end_effects=("(rib-placed)",),
    ),
    ActionText(
        "pick",
        parameters="?who - agent ?what - item",
        at_start=("(on-table ?what)",),
        start_effects=("(not (on-table ?what))",),
        end_effects=("(at-hand ?what)",),
    ),
    ActionText("wait", parameters="?who - agent"),
    ActionText(
        "fasten",
        parameters="?cleco - item",
        at_start=("(rib-placed)", "(at-hand pliers)", "(at-hand ?cleco)"),
        over_all=("(holds-frame left)", "(holds-frame right)"),
        start_effects=("(not (at-hand ?cleco))",),
        end_effects=("(fastened ?cleco)", "(not (at-hand pliers))", "(on-table pliers)"),
    ),
    ActionText(
        "lower",
        parameters="?robot - agent",
        at_start=("(fastened cleco1)", "(fastened cleco2)"),
        end_effects=("(not (holds-frame ?robot))",),
    ),
)


def wing() -> Instance:
    """The plan. Choices: the human's h1 and h2 (uncontrollable), Baxter's b1 and b2."""
    lift = parallel(*(act(f"(lift {robot})", 10, 20, agent=robot) for robot in ("left", "right")))
    lower = parallel(*(act(f"(lower {robot})", 5, 10, agent=robot) for robot in ("left", "right")))
    rounds = [_round(number, cleco) for number, cleco in enumerate(_CLECOS, 1)]
    program = sequence(lift, act("(place-rib human)", 10, 30, agent="human"), *rounds, lower)
    network = build("wing", within(program, upper=300))
    declarations = (
        "(:types agent item)",
        f"(:constants human baxter left right - agent pliers {' '.join(_CLECOS)} - item)",
    )
    predicates = (
        "(holds-frame ?robot - agent)",
        "(rib-placed)",
        "(on-table ?what - item)",
        "(at-hand ?what - item)",
        "(fastened ?cleco - item)",
    )
    initial = [f"(on-table {item})" for item in ("pliers", *_CLECOS)]
    goal = [f"(fastened {cleco})" for cleco in _CLECOS]
    return Instance(
        network,
        domain_text("wing", predicates, _ACTIONS, extra=declarations),
        problem_text("rib", "wing", initial, goal),
    )


def _round(number: int, cleco: str) -> Element:
    def pick(who: str, what: str) -> Element:
        return act(f"(pick {who} {what})", 5, 15, agent=who)

    human = choose(
        f"h{number}",
        {
            "pliers": pick("human", "pliers"),
            "cleco": pick("human", cleco),
            "both": sequence(pick("human", "pliers"), pick("human", cleco)),
        },
        controllable=False,
    )
    baxter = choose(
        f"b{number}",
        {
            "cleco": pick("baxter", cleco),
            "pliers": pick("baxter", "pliers"),
            "wait": act("(wait baxter)", 1, 60, agent="baxter"),
        },
    )
    return sequence(parallel(human, baxter), act(f"(fasten {cleco})", 10, 20, agent="human"))
