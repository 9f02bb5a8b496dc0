"""Families of plans with choices: k intents [PIKE §6.2.1, Figure 16], and satisfiability [PIKE, Appendix B, Figure 22].

In the k-intents domain a human chooses, a robot must choose the same, again and again.

A formula in conjunctive normal form is a list of clauses, a clause a list of literals: `3` for the third variable,
`-3` for its negation, as in DIMACS files. It is satisfiable if and only if its plan admits a correct execution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log, prod
from random import Random

from robust.errors import InputError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import Element, act, build, choose, parallel, sequence
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

LARGEST = 10_000
"""Numbers of intents are drawn up to this; the paper's range is in a figure only."""


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


def random_k_intents(seed: int, index: int = 0, largest: int = LARGEST) -> KIntents:
    """A problem with a random number of intents, uniform on a logarithmic scale, and a random order of its choices."""
    random = Random(f"k-intents/{seed}/{index}")  # noqa: S311 - reproducible
    wanted = 2 ** random.uniform(1, log(largest, 2))
    structure = closest_factors(wanted)
    random.shuffle(structure)
    return k_intents(structure, seed=random.randrange(2**32))


def closest_factors(wanted: float) -> list[int]:
    """Twos and threes whose product is closest to a number of at least 2; of equally close ones the smaller."""
    twos = range(int(log(wanted, 2)) + 2)
    threes = range(int(log(wanted, 3)) + 2)
    candidates = [(a, b) for a in twos for b in threes if a + b > 0]
    a, b = min(candidates, key=lambda each: (abs(2 ** each[0] * 3 ** each[1] - wanted), 2 ** each[0] * 3 ** each[1]))
    return [2] * a + [3] * b


# -- satisfiability ----------------------------------------------------------------------------------------------------

Clause = Sequence[int]


def sat_plan(clauses: Sequence[Clause], name: str = "sat") -> Instance:
    """A choice for each variable, then an activity for each clause that needs one of its literals.

    Raises:
        InputError: if a literal is 0.
    """
    if any(literal == 0 for clause in clauses for literal in clause):
        raise InputError("found the literal 0; expected variables counted from 1, negated ones negative")
    variables = sorted({abs(literal) for clause in clauses for literal in clause})
    assign = [
        choose(
            f"v{variable}",
            {"true": act(f"(assign-{variable})", 1, 2), "false": act(f"(assign-not-{variable})", 1, 2)},
        )
        for variable in variables
    ]
    tests = [act(f"(clause-{number})", 1, 2) for number in range(1, len(clauses) + 1)]
    program = sequence(*([parallel(*assign)] if assign else []), *([parallel(*tests)] if tests else []))
    actions = [
        ActionText(_action(literal), end_effects=tuple(_holds(number) for number in _where(literal, clauses)))
        for variable in variables
        for literal in (variable, -variable)
    ]
    actions += [ActionText(f"clause-{number}", at_start=(_holds(number),)) for number in range(1, len(clauses) + 1)]
    predicates = [_holds(number) for number in range(1, len(clauses) + 1)]
    return Instance(
        build(name, program), sketched_domain(name, predicates, actions), sketched_problem(name, name, (), ())
    )


def assignment(scenario: Mapping[str, str]) -> dict[int, bool]:
    """The truth values that a team scenario of such a plan stands for."""
    return {int(choice.removeprefix("v")): value == "true" for choice, value in scenario.items()}


def satisfies(values: Mapping[int, bool], clauses: Sequence[Clause]) -> bool:
    """Whether truth values satisfy every clause."""
    return all(any(values[abs(literal)] is (literal > 0) for literal in clause) for clause in clauses)


def random_clauses(seed: int, *, variables: int, clauses: int, width: int = 3) -> list[list[int]]:
    """Random k-SAT: each clause over `width` different variables, each negated or not.

    Raises:
        InputError: if there are fewer variables than a clause needs.
    """
    if not 0 < width <= variables:
        raise InputError(f"the width of clauses is {width}; expected at least 1 and at most {variables}, the variables")
    random = Random(seed)  # noqa: S311 - reproducible
    return [
        [random.choice((variable, -variable)) for variable in random.sample(range(1, variables + 1), width)]
        for _ in range(clauses)
    ]


def _action(literal: int) -> str:
    return f"assign-{literal}" if literal > 0 else f"assign-not-{-literal}"


def _holds(number: int) -> str:
    return f"(clause-holds-{number})"


def _where(literal: int, clauses: Sequence[Clause]) -> list[int]:
    """The clauses, counted from 1, that a literal makes true."""
    return [number for number, clause in enumerate(clauses, 1) if literal in clause]
