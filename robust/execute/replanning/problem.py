"""The problem that is left when a plan is given up: the state reached is the initial state, and time begins anew."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

from robust.plan.model import TimedLiteral
from robust.plan.pddl.syntax import Problem
from robust.plan.timeline import State


def origin_after(now: Fraction, literals: Iterable[TimedLiteral], epsilon: Fraction) -> Fraction:
    """When the next plan may begin: ε after the last event, and after any timed literal that comes just before then.

    What starts at time zero of the next plan may be mutex with what has just happened.
    """
    origin = now + epsilon
    for literal in sorted(literals, key=lambda one: one.time):
        if origin - epsilon < literal.time <= origin:
            origin = literal.time + epsilon
    return origin


def remaining_problem(problem: Problem, state: State, origin: Fraction) -> Problem:
    """The problem from `origin` on, in the time of `problem`, with the state that is reached there.

    Timed literals that are still to come keep their moments; those that have passed are part of the state. Deadlines
    that are timed literals move with them.
    """
    later = tuple(replace(one, time=one.time - origin) for one in problem.timed_literals if one.time > origin)
    return replace(problem, atoms=frozenset(state.atoms), fluents=dict(state.fluents), timed_literals=later)
