"""unified-planning problems as domains and problems of ours, exactly.

Everything but numbers goes through PDDL text of our own, so that the reader's checks and messages apply. Initial values
and the times and values of timed effects are handed over as fractions: PDDL has no way to write 1/3.

Quality metrics are not read: they do not bear on validity.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from robust.errors import InputError, UnsupportedError
from robust.execute.unified_expressions import constant, expression, name_of, named, number_of, typed
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.pddl.syntax import Domain, Problem

if TYPE_CHECKING:
    import unified_planning.model as up

_NEEDS = ":typing :fluents :adl :durative-actions :duration-inequalities :timed-initial-literals"


def problem_of(problem: up.Problem) -> tuple[Domain, Problem]:
    """Domain and problem that say what a unified-planning problem says.

    Raises:
        InputError: for names that PDDL cannot tell apart, and fluents without initial value.
        UnsupportedError: for what PDDL 2.1 with timed initial literals cannot say.
    """
    _check_supported(problem)
    name = name_of(problem.name or "problem")
    file = f"<unified-planning problem {name}>"
    domain = parse_domain(_domain_text(problem, name), file)
    read = parse_problem(_problem_text(problem, name), domain, file)
    atoms, fluents = _initial_state(problem)
    literals = sorted(_timed_literals(problem), key=lambda literal: literal.time)
    return domain, replace(read, atoms=atoms, fluents=fluents, timed_literals=tuple(literals))


def _check_supported(problem: up.Problem) -> None:
    present = {
        "timed goals": problem.timed_goals,
        "trajectory constraints": problem.trajectory_constraints,
        "processes": problem.processes,
        "events": problem.events,
        "simulated effects": [one for one in problem.actions if _simulated(one)],
    }
    for what, found in present.items():
        if found:
            raise UnsupportedError(f"found {what}, expected a problem without them")
    for what, names in {
        "action": [one.name for one in problem.actions],
        "fluent": [one.name for one in problem.fluents],
        "object": [one.name for one in problem.all_objects],
        "type": [one.name for one in problem.user_types],
    }.items():
        lowered = [name_of(one) for one in names]
        twice = next((one for one in lowered if lowered.count(one) > 1), None)
        if twice is not None:
            raise InputError(f"found two names of {what}s that are both {twice!r} in lower case, expected one")


def _simulated(action: up.Action) -> bool:
    return bool(getattr(action, "simulated_effect", None) or getattr(action, "simulated_effects", None))


# -- the domain --------------------------------------------------------------------------------------------------------


def _domain_text(problem: up.Problem, name: str) -> str:
    types = " ".join(
        f"{name_of(one.name)} - {name_of(one.father.name) if one.father is not None else 'object'}"
        for one in problem.user_types
        if name_of(one.name) != "object"
    )
    predicates = [one for one in problem.fluents if one.type.is_bool_type()]
    functions = [one for one in problem.fluents if one.type.is_int_type() or one.type.is_real_type()]
    other = next((one for one in problem.fluents if one not in predicates and one not in functions), None)
    if other is not None:
        raise UnsupportedError(f"found fluent {other.name!r} of type {other.type}, expected a Boolean or a number")
    return "\n".join(
        (
            f"(define (domain {name})",
            f"(:requirements {_NEEDS})",
            f"(:types {types})",
            f"(:predicates {' '.join(map(_signature, predicates))})",
            f"(:functions {' '.join(map(_signature, functions))})",
            *(_action(one) for one in problem.actions),
            ")",
        )
    )


def _signature(fluent: up.Fluent) -> str:
    return f"({name_of(fluent.name)} {typed(fluent.signature)})"


def _action(action: up.Action) -> str:
    head = f"{name_of(action.name)} :parameters ({typed(action.parameters)})"
    if not hasattr(action, "duration"):
        conditions = " ".join(map(expression, action.preconditions))
        effects = " ".join(_effect(one) for one in action.effects)
        return f"(:action {head} :precondition (and {conditions}) :effect (and {effects}))"
    conditions = " ".join(
        f"({when} {expression(one)})"
        for interval, all_of in action.conditions.items()
        for when in _whens(interval)
        for one in all_of
    )
    effects = " ".join(_timed(one, _when(timing)) for timing, all_of in action.effects.items() for one in all_of)
    continuous = " ".join(
        _continuous(one, interval) for interval, all_of in action.continuous_effects.items() for one in all_of
    )
    return (
        f"(:durative-action {head} :duration {_duration(action.duration)} "
        f":condition (and {conditions}) :effect (and {effects} {continuous}))"
    )


def _duration(interval: up.DurationInterval) -> str:
    lower, upper = expression(interval.lower), expression(interval.upper)
    if lower == upper and not (interval.is_left_open() or interval.is_right_open()):
        return f"(= ?duration {lower})"
    above, below = ">" if interval.is_left_open() else ">=", "<" if interval.is_right_open() else "<="
    return f"(and ({above} ?duration {lower}) ({below} ?duration {upper}))"


def _when(timing: up.Timing) -> str:
    if timing.delay == 0 and not timing.is_global():
        return "at start" if timing.is_from_start() else "at end"
    raise UnsupportedError(f"found a condition or effect at '{timing}', expected the start or the end of its action")


def _whens(interval: up.TimeInterval) -> list[str]:
    """At start, over all, at end: the parts of an interval; ends that belong to it count by themselves."""
    lower, upper = _when(interval.lower), _when(interval.upper)
    if lower == upper:
        return [lower]
    if lower == "at end":
        raise UnsupportedError(f"found a condition over '{interval}', expected an interval from start to end")
    first = [] if interval.is_left_open() else [lower]
    last = [] if interval.is_right_open() else [upper]
    return [*first, "over all", *last]


def _effect(effect: up.Effect, wrap: str = "{}") -> str:
    text = wrap.format(_change(effect))
    if effect.is_conditional():
        text = f"(when {wrap.format(expression(effect.condition))} {text})"
    if effect.is_forall():
        text = f"(forall ({typed(effect.forall)}) {text})"
    return text


def _timed(effect: up.Effect, when: str) -> str:
    return _effect(effect, f"({when} {{}})")


def _change(effect: up.Effect) -> str:
    target, value = expression(effect.fluent), effect.value
    if effect.fluent.type.is_bool_type():
        if not value.is_bool_constant():
            raise UnsupportedError(f"found effect '{effect}', expected one that makes {target} true or false")
        return target if value.is_true() else f"(not {target})"
    word = "assign" if effect.is_assignment() else "increase" if effect.is_increase() else "decrease"
    return f"({word} {target} {expression(value)})"


def _continuous(effect: up.Effect, interval: up.TimeInterval) -> str:
    if "over all" not in _whens(interval) or effect.is_conditional() or effect.is_forall():
        message = f"found continuous effect '{effect}', expected an unconditional one from start to end"
        raise UnsupportedError(message)
    word = "increase" if effect.is_continuous_increase() else "decrease"
    return f"({word} {expression(effect.fluent)} (* #t {expression(effect.value)}))"


# -- the problem -------------------------------------------------------------------------------------------------------


def _problem_text(problem: up.Problem, name: str) -> str:
    objects = " ".join(f"{name_of(one.name)} - {name_of(one.type.name)}" for one in problem.all_objects)
    goal = " ".join(map(expression, problem.goals))
    return f"(define (problem {name}) (:domain {name}) (:objects {objects}) (:init) (:goal (and {goal})))"


def _initial_state(problem: up.Problem) -> tuple[frozenset[Atom], dict[Fluent, Fraction]]:
    from unified_planning.exceptions import UPProblemDefinitionError  # noqa: PLC0415 - an optional dependency

    try:
        values = problem.initial_values
    except UPProblemDefinitionError as error:
        raise InputError(f"found {error}, expected an initial value for every fluent") from error
    atoms = (Atom(*named(fluent)) for fluent, value in values.items() if value.is_bool_constant() and value.is_true())
    numbers = {
        Fluent(*named(fluent)): number_of(value) for fluent, value in values.items() if not value.is_bool_constant()
    }
    return frozenset(atoms), numbers


def _timed_literals(problem: up.Problem) -> Iterator[TimedLiteral]:
    for timing, effects in problem.timed_effects.items():
        if not (timing.is_global() and timing.is_from_start()):
            raise UnsupportedError(f"found a timed effect at '{timing}', expected a time after the plan's start")
        yield from _literals_at(Fraction(timing.delay), effects)


def _literals_at(time: Fraction, effects: Iterable[up.Effect]) -> Iterator[TimedLiteral]:
    for effect in effects:
        if not effect.is_assignment() or effect.is_conditional() or effect.is_forall():
            raise UnsupportedError(f"found timed effect '{effect}', expected an unconditional assignment")
        value = constant(effect.value)
        where = named(effect.fluent)
        yield TimedLiteral(time, Atom(*where) if isinstance(value, bool) else Fluent(*where), value)
