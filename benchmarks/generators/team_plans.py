"""Random structured plans with choices, and action models that link their activities [PIKE §6.2.2].

A plan is a sequence of elements, each an activity, a choice or a parallel, whose branches are shorter sequences again.
Conditions at the start of an activity are supported at the end of activities that surely come before it, or from the
beginning, and threatened at the end of activities that surely come before one of those.

Two readings. *Squeeze*: the upper bound on the whole plan is up to 10 % below the least time in which it can be
executed if each choice takes its longest branch; of the shortest branches nothing would be left, by construction.
Links of ε between elements come on top, so that even without squeeze the longest branches do not quite fit.
*Binomials*: the paper gives ranges and no probabilities. With those below the 500 plans of seed 0 have 47.8 activities
on average and 148 at most, and 85 of them (17 %) admit a correct execution; of the paper's, 94 (19 %) did. The shares
of conditions and threats were chosen for that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random
from typing import assert_never

from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import (
    Act,
    Choose,
    Element,
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
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

_BEGINNING = ""
"""Stands for the special activity of the initial state."""


@dataclass(frozen=True, slots=True)
class Shape:
    """The distributions; the probabilities are ours, the ranges the paper's.

    Lengths of sequences are binomial up to `top` at the top and up to `inner` below, but at least 1. Elements are drawn
    with the weights of activity, choice and parallel; deeper than `deepest` everything is an activity.
    """

    top: int = 10
    top_share: float = 0.57
    inner: int = 3
    inner_share: float = 0.5
    top_weights: tuple[float, float, float] = (0.4, 0.35, 0.25)
    inner_weights: tuple[float, float, float] = (0.65, 0.2, 0.15)
    deepest: int = 3
    longest: int = 10
    """Lower bounds of activities are 1 to this, upper bounds up to as much more."""
    squeeze: Fraction = Fraction(1, 10)
    conditions: int = 4
    condition_share: float = 0.4
    producers: int = 4
    producer_share: float = 0.4
    threat_share: float = 0.42


DEFAULT = Shape()
MEDIUM = Shape(top=5, deepest=2, squeeze=Fraction(0), threat_share=0.3)
FEASIBLE = Shape(squeeze=Fraction(0), threat_share=0.02, producer_share=0.9, inner_share=0.6)
"""Many producers, few threats and time enough: about two in three of the larger plans admit correct executions, so many
that no list holds their prime implicants."""

SMALL = replace(FEASIBLE, top=5, deepest=2, conditions=2, producers=2)
"""Few producers as well, so that all models of about one plan in four can be listed."""


def random_plan(seed: int, index: int = 0, shape: Shape = DEFAULT) -> Instance:
    """The plan with that number among those of a seed; always the same."""
    return _Drawing(Random(f"{seed}/{index}"), shape).instance(f"random-{seed}-{index}")  # noqa: S311 - reproducible


class _Drawing:
    def __init__(self, random: Random, shape: Shape) -> None:
        self._random = random
        self._shape = shape
        self._activities = 0
        self._choices = 0

    def instance(self, name: str) -> Instance:
        shape = self._shape
        program = self._sequence(0)
        share = Fraction(self._random.randint(0, 1000), 1000)
        limit = longest(program) * (1 - shape.squeeze * share)
        network = build(name, within(program, upper=limit))
        domain, problem = self._action_model(name, program)
        return Instance(network, domain, problem)

    def _binomial(self, count: int, share: float) -> int:
        return sum(self._random.random() < share for _ in range(count))

    def _sequence(self, depth: int) -> InSequence:
        shape = self._shape
        length = (
            self._binomial(shape.top, shape.top_share) if depth == 0 else self._binomial(shape.inner, shape.inner_share)
        )
        return sequence(*(self._element(depth) for _ in range(max(1, length))))

    def _element(self, depth: int) -> Element:
        shape, random = self._shape, self._random
        weights = shape.top_weights if depth == 0 else shape.inner_weights
        kind = random.choices(("activity", "choice", "parallel"), weights)[0] if depth < shape.deepest else "activity"
        if kind == "activity":
            self._activities += 1
            lower = random.randint(1, shape.longest)
            return act(f"(a{self._activities})", lower, lower + random.randint(0, shape.longest))
        branches = 2 + self._binomial(1, 0.4)
        if kind == "parallel":
            return parallel(*(self._sequence(depth + 1) for _ in range(branches)))
        self._choices += 1
        name = f"x{self._choices}"
        values = {str(value): self._sequence(depth + 1) for value in range(1, branches + 1)}
        return choose(name, values, controllable=random.random() < 0.5)

    def _action_model(self, name: str, program: Element) -> tuple[str, str]:
        shape, random = self._shape, self._random
        actions, earlier = precedence(program)
        conditions: dict[str, list[str]] = {action: [] for action in actions}
        effects: dict[str, list[str]] = {action: [] for action in actions}
        initial: list[str] = []
        predicates: list[str] = []
        for action in actions:
            for _ in range(1 + self._binomial(shape.conditions - 1, shape.condition_share)):
                atom = f"(p{len(predicates) + 1})"
                predicates.append(atom)
                conditions[action].append(atom)
                candidates = [*earlier[action], _BEGINNING]
                wanted = 1 + self._binomial(shape.producers - 1, shape.producer_share)
                producers = random.sample(candidates, min(wanted, len(candidates)))
                for producer in producers:
                    (effects[producer] if producer else initial).append(atom)
                before = {one for producer in producers if producer for one in earlier[producer]}
                threats = [one for one in actions if one in before and one not in producers]
                count = self._binomial(min(len(producers), len(threats)), shape.threat_share)
                for threat in random.sample(threats, count):
                    effects[threat].append(f"(not {atom})")
        texts = [
            ActionText(action.strip("()"), at_start=tuple(conditions[action]), end_effects=tuple(effects[action]))
            for action in actions
        ]
        return sketched_domain(name, predicates, texts), sketched_problem(name, name, initial, ())


def blocks(count: int, *, share: bool = False, slack: Fraction = Fraction(9, 10)) -> Instance:
    """Blocks one after the other, of 13 activities each, for two people and a robot, with one limit over all.

    In each block a person fetches one of three items, another person goes for one of three walks, and the robot fetches
    one of three tools, side by side; the first person then uses item and tool, which have to go together; and the robot
    clears the table. So the robot has to wait for what the person means to do.

    Args:
        share: whether all use the same table, which each clears for the next: an atom is used throughout.
        slack: the limit, as a share of the least time in which all activities can take as long as they may.
    """
    steps: list[Element] = []
    actions: list[ActionText] = []
    atoms: list[str] = []
    clear: list[str] = []
    latest = Fraction(0)
    for block in range(1, count + 1):
        table = "(clear)" if share else f"(clear-{block})"
        clear = list(dict.fromkeys([*clear, table]))
        values = ("1", "2", "3")
        got, found = ({each: f"({name}-{block}-{each})" for each in values} for name in ("item", "tool"))
        atoms += [*got.values(), *found.values()]

        def three(name: str, agent: str, at: int = block) -> dict[str, Element]:
            return {each: act(f"({name}-{at}-{each})", 2, 2 + int(each), agent=agent) for each in ("1", "2", "3")}

        around = parallel(
            choose(f"x{block}", three("get", "anna"), controllable=False),
            choose(f"y{block}", three("walk", "ben"), controllable=False),
            choose(f"z{block}", three("bring", "robot")),
        )
        use = choose(f"u{block}", three("use", "anna"), controllable=False)
        steps += [around, use, act(f"(clear-up-{block})", 1, 2, agent="robot")]
        for each in values:
            needed = (got[each], found[each], table)
            actions += [
                ActionText(f"get-{block}-{each}", end_effects=(got[each],)),
                ActionText(f"walk-{block}-{each}"),
                ActionText(f"bring-{block}-{each}", end_effects=(found[each],)),
                ActionText(f"use-{block}-{each}", at_start=needed, end_effects=(f"(not {table})",)),
            ]
        actions.append(ActionText(f"clear-up-{block}", end_effects=(table,)))
        latest += 5 + 5 + 2
    name = f"blocks-{count}{'-shared' if share else ''}"
    network = build(name, within(sequence(*steps), upper=latest * slack))
    domain = sketched_domain(name, [*atoms, *clear], actions)
    return Instance(network, domain, sketched_problem(name, name, clear, ()))


def longest(element: Element) -> Fraction:
    """The least time in which an element can be executed if each choice takes its longest branch."""
    match element:
        case Act(_, lower):
            return lower
        case InSequence(elements):
            return sum(map(longest, elements), Fraction(0))
        case InParallel(elements):
            return max(map(longest, elements))
        case Choose(branches=branches):
            return max(longest(branch) for _, branch in branches)
        case Within(inner):
            return longest(inner)
        case _:
            assert_never(element)


def precedence(element: Element) -> tuple[list[str], dict[str, list[str]]]:
    """All activities in order, and those that surely come before each of them, if both are executed."""
    match element:
        case Act(action):
            return [action], {action: []}
        case Within(inner):
            return precedence(inner)
        case InSequence(elements) | InParallel(elements):
            parts = [precedence(part) for part in elements]
        case Choose(branches=branches):
            parts = [precedence(part) for _, part in branches]
        case _:
            assert_never(element)
    actions: list[str] = []
    earlier: dict[str, list[str]] = {}
    for inside, before in parts:
        passed = list(actions) if isinstance(element, InSequence) else []
        earlier |= {action: [*passed, *before[action]] for action in inside}
        actions += inside
    return actions, earlier
