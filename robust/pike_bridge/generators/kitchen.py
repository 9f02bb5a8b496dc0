"""Breakfast: the story of [PIKE §1.1, Figures 1, 2 and 5]. Times are in minutes.

Alice takes a mug or a glass and makes coffee or pours juice; the robot fetches what the drink needs. Then she has a
bagel with cream cheese or cereal with milk, and the robot fetches one of the two. Coffee and a bagel together take
longer than the seven minutes that she has.
"""

from __future__ import annotations

from robust.pike_bridge.builder import Act, act, build, choose, parallel, sequence, within
from robust.pike_bridge.generators.action_text import ActionText, domain_text, problem_text
from robust.pike_bridge.instance import Instance

LIMIT = 7
_ACTIONS = (
    ActionText(
        "get",
        parameters="?who - agent ?what - item",
        at_start=("(in-place ?what)",),
        start_effects=("(not (in-place ?what))",),
        end_effects=("(have ?what)",),
    ),
    ActionText(
        "make-coffee",
        parameters="?who - agent",
        at_start=("(have grounds)",),
        end_effects=("(brewed)", "(not (have grounds))"),
    ),
    ActionText(
        "pour-coffee", parameters="?who - agent", at_start=("(have mug)", "(brewed)"), end_effects=("(drink-ready)",)
    ),
    ActionText(
        "pour-juice",
        parameters="?who - agent",
        at_start=("(have glass)", "(have juice)"),
        end_effects=("(drink-ready)",),
    ),
    ActionText(
        "toast-bagel",
        parameters="?who - agent",
        at_start=("(have bagel)",),
        over_all=("(working toaster)",),
        end_effects=("(toasted)",),
    ),
    ActionText(
        "spread",
        parameters="?who - agent",
        at_start=("(toasted)", "(have cream-cheese)"),
        end_effects=("(food-ready)",),
    ),
    ActionText(
        "mix-cereal",
        parameters="?who - agent",
        at_start=("(have cereal)", "(have milk)"),
        end_effects=("(food-ready)",),
    ),
)
_ITEMS = ("mug", "glass", "grounds", "juice", "bagel", "cereal", "cream-cheese", "milk")


def kitchen() -> Instance:
    """The breakfast plan. Choices: Alice's xA1 to xA4 (uncontrollable), the robot's xR1 and xR2."""
    drink = sequence(
        parallel(
            choose("xA1", {item: _get("human", item) for item in ("mug", "glass")}, controllable=False),
            choose("xR1", {item: _get("robot", item) for item in ("grounds", "juice")}),
        ),
        choose(
            "xA2",
            {
                "coffee": sequence(
                    act("(make-coffee human)", 3, 5, agent="human"),
                    act("(pour-coffee human)", "0.2", "0.5", agent="human"),
                ),
                "juice": act("(pour-juice human)", "0.2", "0.5", agent="human"),
            },
            controllable=False,
        ),
    )
    food = sequence(
        parallel(
            choose("xA3", {item: _get("human", item) for item in ("bagel", "cereal")}, controllable=False),
            choose("xR2", {item: _get("robot", item) for item in ("cream-cheese", "milk")}),
        ),
        choose(
            "xA4",
            {
                "bagel": sequence(
                    act("(toast-bagel human)", "2.5", 4, agent="human"), act("(spread human)", "0.5", 1, agent="human")
                ),
                "cereal": act("(mix-cereal human)", "0.5", 1, agent="human"),
            },
            controllable=False,
        ),
    )
    network = build("kitchen", within(sequence(drink, food), upper=LIMIT))
    declarations = (
        "(:types agent item)",
        f"(:constants human robot - agent {' '.join(_ITEMS)} toaster - item)",
    )
    predicates = (
        "(in-place ?what - item)",
        "(have ?what - item)",
        "(working ?what - item)",
        "(brewed)",
        "(toasted)",
        "(drink-ready)",
        "(food-ready)",
    )
    initial = [*(f"(in-place {item})" for item in _ITEMS), "(working toaster)"]
    return Instance(
        network,
        domain_text("kitchen", predicates, _ACTIONS, extra=declarations),
        problem_text("breakfast", "kitchen", initial, ("(drink-ready)", "(food-ready)")),
    )


def _get(who: str, item: str) -> Act:
    return act(f"(get {who} {item})", "0.5", 2, agent=who)
