"""Plans with choices of k intents [PIKE §6.2.1, Figure 16]: a human chooses, a robot must choose the same, again and
again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from random import Random

from robust.errors import InputError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import Element, act, build, choose, sequence
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem


@dataclass(frozen=True, slots=True)
class KIntents:
    """A problem: N_i options for the i-th pair of choices."""

    structure: tuple[int, ...]
    instance: Instance

    @property
    def intents(self) -> int:
        """k: the number of intent scenarios."""
        return prod(self.structure)

    @property
    def recovery(self) -> dict[str, Fraction]:
        """How long it takes to undo each action that was begun by mistake: half of its least duration."""
        return {activity.action: activity.lower / 2 for activity in self.instance.network.activities}


def k_intents(structure: Sequence[int], seed: int = 0) -> KIntents:
    """The problem of a structure; the seed decides the durations [1 + w, 2 + w], 0 ≤ w ≤ 1/2, one w for each pair.

    Raises:
        InputError: if the structure is empty or has an entry below 1.
    """
    if not structure or min(structure) < 1:
        raise InputError(f"the structure is {list(structure)}; expected numbers of at least 1")
    random = Random(f"{seed}/{list(structure)}")  # noqa: S311 - reproducible
    steps: list[Element] = []
    actions: list[ActionText] = []
    predicates: list[str] = []
    for place, count in enumerate(structure, 1):
        options = range(1, count + 1)
        lower = 1 + Fraction(random.randint(0, 500), 1000)
        upper = lower + 1
        human = {str(j): act(f"(h-{place}-{j})", lower, upper, agent="human") for j in options}
        robot = {str(j): act(f"(r-{place}-{j})", lower, upper, agent="robot") for j in options}
        steps += [choose(f"y{place}", human, controllable=False), choose(f"x{place}", robot)]
        for j in options:
            atom = f"(p-{place}-{j})"
            predicates.append(atom)
            actions += [
                ActionText(f"h-{place}-{j}", end_effects=(atom,)),
                ActionText(f"r-{place}-{j}", at_start=(atom,)),
            ]
    name = "k-intents-" + "-".join(map(str, structure))
    instance = Instance(
        build(name, sequence(*steps)), sketched_domain(name, predicates, actions), sketched_problem(name, name, (), ())
    )
    return KIntents(tuple(structure), instance)
