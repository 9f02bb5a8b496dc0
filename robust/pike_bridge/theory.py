"""Propositional state logic: formulas over assignments to finite-domain variables [PIKE §5.3]."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias, assert_never

from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.model import GOAL, INITIAL, Activity, Assignment, Condition, Guard, Literal, TeamPlan
from robust.plan.model import Atom


@dataclass(frozen=True, slots=True)
class Is:
    """`variable = value`."""

    assignment: Assignment


@dataclass(frozen=True, slots=True)
class Not:
    operand: Formula


@dataclass(frozen=True, slots=True)
class All:
    """A conjunction; true without operands."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """A disjunction; false without operands."""

    operands: tuple[Formula, ...]


Formula: TypeAlias = Is | Not | All | Some


def conjunction(guard: Guard) -> All:
    """The conjunction of a guard's assignments, in sorted order."""
    return All(tuple(Is(assignment) for assignment in sorted(guard)))


def implies(condition: Formula, consequence: Formula) -> Formula:
    return Some((Not(condition), consequence))


@dataclass(frozen=True, slots=True)
class Theory:
    """Constraints over finite-domain variables; conflicts are environments that must not hold.

    A model is an assignment to all variables that satisfies every constraint and resolves every conflict.
    """

    domains: Mapping[str, tuple[str, ...]]
    constraints: tuple[Formula, ...] = ()
    conflicts: tuple[Guard, ...] = ()


def satisfies(scenario: Mapping[str, str], formula: Formula) -> bool:
    """Whether a full assignment satisfies a formula."""
    match formula:
        case Is(assignment):
            return scenario[assignment.variable] == assignment.value
        case Not(operand):
            return not satisfies(scenario, operand)
        case All(operands):
            return all(satisfies(scenario, operand) for operand in operands)
        case Some(operands):
            return any(satisfies(scenario, operand) for operand in operands)
        case _:
            assert_never(formula)


def is_model(scenario: Mapping[str, str], theory: Theory) -> bool:
    """Whether a full assignment is a model of a theory, by looking at each constraint and conflict."""
    return all(satisfies(scenario, constraint) for constraint in theory.constraints) and not any(
        all(scenario[variable] == value for variable, value in conflict) for conflict in theory.conflicts
    )


_LEGAL = re.compile(r"[^a-z0-9_-]+")


def propositional(plan: TeamPlan) -> Instance:
    """The network with its actions renamed, and a domain and a problem that mean the same plan."""
    names = _names(plan)
    activities = tuple(
        replace(activity, action=f"(act-{place})") for place, activity in enumerate(plan.network.activities)
    )
    domain = [
        "(define (domain team)",
        "  (:requirements :strips :negative-preconditions :durative-actions)",
        f"  (:predicates {' '.join(f'({name})' for name in names.values())})",
        *(_action(plan, place, names) for place in range(len(activities))),
        ")",
    ]
    initial = [e.literal for e in plan.effects if e.activity is None and e.event == INITIAL and e.literal.positive]
    goal = [one.literal for one in plan.conditions if one.activity is None and one.first == GOAL]
    problem = [
        "(define (problem team) (:domain team)",
        f"  (:init {_joined(initial, names)})",
        f"  (:goal (and {_joined(goal, names)})))",
    ]
    network = replace(plan.network, activities=activities)
    return Instance(network, "\n".join(domain) + "\n", "\n".join(problem) + "\n")


def _names(plan: TeamPlan) -> dict[Atom, str]:
    """A predicate without arguments for each atom."""
    atoms = {one.literal.atom for one in plan.conditions} | {one.literal.atom for one in plan.effects}
    names: dict[Atom, str] = {}
    taken: set[str] = set()
    for atom in sorted(atoms, key=str):
        base = "p-" + _LEGAL.sub("-", str(atom).lower()).strip("-")
        name, count = base, 1
        while name in taken:
            count += 1
            name = f"{base}-{count}"
        taken.add(name)
        names[atom] = name
    return names


def _action(plan: TeamPlan, place: int, names: dict[Atom, str]) -> str:
    activity = plan.network.activities[place]
    conditions = [
        f"({_when(one, activity)} {_text(one.literal, names)})" for one in plan.conditions if one.activity == place
    ]
    effects = [
        f"(at {'start' if one.event == activity.source else 'end'} {_text(one.literal, names)})"
        for one in plan.effects
        if one.activity == place
    ]
    return (
        f"  (:durative-action act-{place} :parameters () :duration (>= ?duration 0)\n"
        f"    :condition (and {' '.join(conditions)})\n"
        f"    :effect (and {' '.join(effects)}))"
    )


def _when(condition: Condition, activity: Activity) -> str:
    if condition.first != condition.last:
        return "over all"
    return "at start" if condition.first == activity.source else "at end"


def _text(literal: Literal, names: dict[Atom, str]) -> str:
    atom = f"({names[literal.atom]})"
    return atom if literal.positive else f"(not {atom})"


def _joined(literals: Iterable[Literal], names: dict[Atom, str]) -> str:
    return " ".join(_text(literal, names) for literal in literals)
