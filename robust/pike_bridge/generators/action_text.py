"""PDDL text of action models without arguments: what generators of plans need, and no more."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


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
