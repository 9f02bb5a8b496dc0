"""PDDL text of action models without arguments: what generators of plans need, and no more."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import Act, Element, act, build, choose, parallel, sequence, within


@dataclass(frozen=True, slots=True)
class ActionText:
    """A durative action: conditions at its start, over all of it, effects at its start and at its end.

    Each is a literal such as `(have mug)` or `(not (have mug))`.
    """

    name: str
    at_start: tuple[str, ...] = ()
    over_all: tuple[str, ...] = ()
    start_effects: tuple[str, ...] = ()
    end_effects: tuple[str, ...] = ()
    parameters: str = ""
    """As PDDL writes them: `?who - agent`."""


def domain_text(
    name: str, predicates: Iterable[str], actions: Iterable[ActionText], *, extra: Sequence[str] = ()
) -> str:
    """A domain; `extra` are whole declarations, such as types and constants, to come before the predicates."""
    requirements = ":typing :negative-preconditions :durative-actions :duration-inequalities"
    lines = [f"(define (domain {name})", f"  (:requirements {requirements})"]
    lines += [f"  {line}" for line in extra]
    lines += ["  (:predicates", *(f"    {predicate}" for predicate in predicates), "  )"]
    lines += [_action(action) for action in actions]
    return "\n".join([*lines, ")"]) + "\n"


def problem_text(name: str, domain: str, initial: Iterable[str], goal: Iterable[str], *, objects: str = "") -> str:
    """A problem over a domain."""
    lines = [f"(define (problem {name})", f"  (:domain {domain})"]
    if objects:
        lines.append(f"  (:objects {objects})")
    lines += ["  (:init", *(f"    {atom}" for atom in initial), "  )"]
    lines.append(f"  (:goal (and {' '.join(goal)}))")
    return "\n".join([*lines, ")"]) + "\n"


def _action(action: ActionText) -> str:
    conditions = [f"(at start {literal})" for literal in action.at_start]
    conditions += [f"(over all {literal})" for literal in action.over_all]
    effects = [f"(at start {literal})" for literal in action.start_effects]
    effects += [f"(at end {literal})" for literal in action.end_effects]
    return "\n".join(
        (
            f"  (:durative-action {action.name}",
            f"    :parameters ({action.parameters})",
            "    :duration (>= ?duration 0)",
            f"    :condition (and {' '.join(conditions)})",
            f"    :effect (and {' '.join(effects)}))",
        )
    )


_NOTHING = sequence()


def _activity(name: str) -> Element:
    return act(f"({name})", 1, 3)


def _optional(choice: str, element: Element) -> Element:
    """The element if the choice is 1, nothing if it is 2."""
    return choose(choice, {"1": element, "2": _NOTHING})


def _instance(name: str, program: Element, activities: str) -> Instance:
    actions = [_figure_action(activity) for activity in activities.split()]
    return Instance(build(name, program), domain_text(name, ("(p)",), actions), problem_text(name, name, (), ()))


def _figure_action(name: str) -> ActionText:
    match name[0]:
        case "p":
            return ActionText(name, end_effects=("(p)",))
        case "t":
            return ActionText(name, end_effects=("(not (p))",))
        case _:
            return ActionText(name, at_start=("(p)",))


def figure_6a() -> Instance:
    """Two unordered producers before a consumer, without choices."""
    program = sequence(parallel(_activity("p1"), _activity("p2")), _activity("c"))
    return _instance("figure-6a", program, "p1 p2 c")


def figure_6b() -> Instance:
    """The same with a choice around each: the consumer (z = 1) needs x = 1 or y = 1."""
    producers = parallel(_optional("x", _activity("p1")), _optional("y", _activity("p2")))
    return _instance("figure-6b", sequence(producers, _optional("z", _activity("c"))), "p1 p2 c")


def figure_7a() -> Instance:
    """The later producer is always activated: its link dominates that of the optional one."""
    return _instance("figure-7a", sequence(_optional("x", _activity("p1")), _activity("p2"), _activity("c")), "p1 p2 c")


def figure_7b() -> Instance:
    """The later producer is optional: no link dominates the other."""
    return _instance("figure-7b", sequence(_activity("p1"), _optional("x", _activity("p2")), _activity("c")), "p1 p2 c")


def figure_8() -> Instance:
    """Several producers one after the other, of which only the last two matter: the last is optional."""
    producers = [_optional("x", _activity("p1")), _activity("p2"), _activity("p3"), _optional("y", _activity("p4"))]
    return _instance("figure-8", sequence(*producers, _activity("c")), "p1 p2 p3 p4 c")


def figure_9() -> Instance:
    """A consumer that starts 1 to 3 after its producer has ended, and a threat that must not come between the two."""
    program = parallel(sequence(_activity("p1"), _activity("c")), _activity("t1"))
    instance = _instance("figure-9", program, "p1 t1 c")
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
    program = parallel(*(_optional(choice, _activity(activity)) for choice, activity in parts.items()))
    return _instance("figure-11", program, "p1 p2 t1 t2 c")


def figure_13() -> Instance:
    """The threat comes after the second producer, and in any order with the first and the consumer."""
    line = sequence(_optional("y", _activity("p1")), _optional("z", _activity("c")))
    program = sequence(_activity("p2"), parallel(_optional("x", _activity("t1")), line))
    return _instance("figure-13", program, "p1 p2 t1 c")


def figure_23(choices: int) -> Instance:
    """As many choices one after the other, each between two activities of [2, 4].

    Labeled shortest paths from end to start need one value with completions, and two to the number of choices without.
    """
    steps = [
        choose(f"x{number}", {"1": act(f"(a{number}-1)", 2, 4), "2": act(f"(a{number}-2)", 2, 4)})
        for number in range(1, choices + 1)
    ]
    actions = [ActionText(f"a{number}-{value}") for number in range(1, choices + 1) for value in (1, 2)]
    name = f"figure-23-{choices}"
    return Instance(
        build(name, sequence(*steps)), domain_text(name, ("(p)",), actions), problem_text(name, name, (), ())
    )


LIMIT = 7
_KITCHEN_ACTIONS = (
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
        domain_text("kitchen", predicates, _KITCHEN_ACTIONS, extra=declarations),
        problem_text("breakfast", "kitchen", initial, ("(drink-ready)", "(food-ready)")),
    )


def _get(who: str, item: str) -> Act:
    return act(f"(get {who} {item})", "0.5", 2, agent=who)


_CLECOS = ("cleco1", "cleco2")
_WING_ACTIONS = (
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
        domain_text("wing", predicates, _WING_ACTIONS, extra=declarations),
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
