"""Satisfiability as plans with choices [PIKE, Appendix B, Figure 22].

A formula in conjunctive normal form is a list of clauses, a clause a list of literals: `3` for the third variable,
`-3` for its negation, as in DIMACS files. It is satisfiable if and only if its plan admits a correct execution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from random import Random

from robust.errors import InputError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import act, build, choose, parallel, sequence
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

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
            f"v{variable}", {"true": act(f"(assign-{variable})", 1, 2), "false": act(f"(assign-not-{variable})", 1, 2)}
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
