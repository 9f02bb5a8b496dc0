"""Domains and problems as unified-planning problems that Aries solves.

Aries has integers only. Times are counted in ticks, so that durations and timed literals are integers; the numbers of
fluents have to be integers as they are. A function that durations depend on becomes a fluent that is counted in ticks,
beside the one that conditions read. Names get a prefix for their kind, since unified-planning has one name space for
all. Quantifiers are expanded over the objects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, assert_never

import unified_planning.model as up
import unified_planning.shortcuts as ups

from robust.execute.planners.aries_expressions import Bindings, Vocabulary, integer, unsupported
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl.syntax import (
    ActionSchema,
    Comparator,
    ContinuousUpdate,
    Domain,
    ForallEffect,
    LiftedEffect,
    LiteralEffect,
    NumericUpdate,
    Problem,
    Update,
    WhenEffect,
)

Change = tuple[Timing, up.FNode, Any, Update]


def unified_problem(domain: Domain, problem: Problem, ticks: int, horizon: int) -> up.Problem:
    """The problem with `ticks` to a time unit; a duration without upper bound is at most `horizon` time units.

    Timed literals between two ticks are moved so that what holds for a shorter time does not come to hold for longer.

    Raises:
        UnsupportedError: for what Aries does not solve.
    """
    words = Vocabulary(domain, problem, ticks)
    defaults = {words.bool: words.environment.expression_manager.FALSE()}
    unified = up.Problem("p", words.environment, initial_defaults=defaults)
    unified.add_objects(list(words.objects.values()))
    for fluent in (*words.predicates.values(), *words.functions.values(), *words.ticked.values()):
        unified.add_fluent(fluent)
    for schema in domain.actions.values():
        unified.add_action(
            _durative(schema, words, horizon * ticks) if schema.durative else _instantaneous(schema, words)
        )
    _set_initial_state(unified, problem, words)
    for literal in problem.timed_literals:
        _add_timed_literal(unified, literal, problem, words)
    unified.add_goal(words.condition(problem.goal, {}))
    return unified


def pddl_name(name: str) -> str:
    """The name without the prefix of its kind."""
    return name.partition("_")[2]


def _set_initial_state(unified: up.Problem, problem: Problem, words: Vocabulary) -> None:
    for atom in sorted(problem.atoms):
        unified.set_initial_value(words.ground(words.predicates[atom.predicate], atom.arguments), True)
    for fluent, value in problem.fluents.items():
        name = fluent.function
        if name in words.functions:
            number = integer(value, f"{fluent} =", problem.location)
            unified.set_initial_value(words.ground(words.functions[name], fluent.arguments), number)
        if name in words.ticked:
            number = integer(value * words.ticks, f"{fluent} in ticks of 1/{words.ticks} =", problem.location)
            unified.set_initial_value(words.ground(words.ticked[name], fluent.arguments), number)


def _add_timed_literal(unified: up.Problem, literal: TimedLiteral, problem: Problem, words: Vocabulary) -> None:
    exact = literal.time * words.ticks
    match literal.target:
        case Atom(predicate, arguments):
            tick = int(-(-exact // 1) if literal.value else exact // 1)
            target = words.ground(words.predicates[predicate], arguments)
            if tick:
                unified.add_timed_effect(ups.GlobalStartTiming(tick), target, bool(literal.value))
            else:
                unified.set_initial_value(target, bool(literal.value))
        case Fluent():
            raise unsupported(f"a number that changes at a time, {literal.target}", problem.location)
        case _:
            assert_never(literal.target)


def _instantaneous(schema: ActionSchema, words: Vocabulary) -> up.InstantaneousAction:
    action = up.InstantaneousAction(f"a_{schema.name}", _parameters(schema, words), words.environment)
    bindings = _bindings(schema, action, words)
    for one in schema.conditions:
        action.add_precondition(words.condition(one.condition, bindings))
    for _, target, value, update in _changes(schema.effects, bindings, words):
        _add(update, action)(target, value)
    return action


def _durative(schema: ActionSchema, words: Vocabulary, longest: int) -> up.DurativeAction:
    action = up.DurativeAction(f"a_{schema.name}", _parameters(schema, words), words.environment)
    bindings = _bindings(schema, action, words)
    action.set_duration_constraint(_duration(schema, bindings, words, longest))
    for one in schema.conditions:
        action.add_condition(_interval(one.timing), words.condition(one.condition, bindings))
    for timing, target, value, update in _changes(schema.effects, bindings, words):
        _add(update, action)(ups.EndTiming() if timing is Timing.AT_END else ups.StartTiming(), target, value)
    return action


def _parameters(schema: ActionSchema, words: Vocabulary) -> dict[str, Any]:
    return {f"v_{one.name}": words.type(one) for one in schema.parameters}


def _bindings(schema: ActionSchema, action: up.Action, words: Vocabulary) -> Bindings:
    make = words.environment.expression_manager.ParameterExp
    return {one.name: make(action.parameter(f"v_{one.name}")) for one in schema.parameters}


def _duration(schema: ActionSchema, bindings: Bindings, words: Vocabulary, longest: int) -> up.DurationInterval:
    """The bounds as a closed interval; strict ones are left to the check of the plan."""
    lower, upper = [], []
    for one in schema.durations:
        if one.timing is not Timing.AT_START:
            raise unsupported("a duration constraint at the end", one.location)
        bound = words.duration(one.bound, bindings)
        if one.comparator in (Comparator.EQUAL, Comparator.AT_LEAST, Comparator.GREATER):
            lower.append(bound)
        if one.comparator in (Comparator.EQUAL, Comparator.AT_MOST, Comparator.LESS):
            upper.append(bound)
    if len(lower) > 1 or len(upper) > 1:
        raise unsupported(f"more than one bound on one side of the duration of {schema.name!r}", schema.location)
    make = words.environment.expression_manager.Int
    return ups.ClosedDurationInterval(lower[0] if lower else make(0), upper[0] if upper else make(longest))


def _changes(effects: tuple[LiftedEffect, ...], bindings: Bindings, words: Vocabulary) -> Iterator[Change]:
    for effect in effects:
        match effect:
            case LiteralEffect(timing, proposition, value):
                yield timing, words.condition(proposition, bindings), value, Update.ASSIGN
            case NumericUpdate(timing, update, target, expression):
                yield timing, words.number(target, bindings), words.number(expression, bindings), update
            case ForallEffect(variables, inner):
                for bound in words.expansions(variables, bindings):
                    yield from _changes(inner, bound, words)
            case WhenEffect(_, _, location):
                raise unsupported("a conditional effect", location)
            case ContinuousUpdate(_, _, _, location):
                raise unsupported("a continuous effect", location)
            case _:
                assert_never(effect)


def _add(update: Update, action: up.Action) -> Callable[..., None]:
    methods = {
        Update.ASSIGN: "add_effect",
        Update.INCREASE: "add_increase_effect",
        Update.DECREASE: "add_decrease_effect",
    }
    if update not in methods:
        raise unsupported(f"an effect {update.value!r}", None)
    method: Callable[..., None] = getattr(action, methods[update])
    return method


def _interval(timing: Timing) -> up.Timing | up.TimeInterval:
    match timing:
        case Timing.AT_START:
            return ups.StartTiming()
        case Timing.AT_END:
            return ups.EndTiming()
        case Timing.OVER_ALL:
            return ups.OpenTimeInterval(ups.StartTiming(), ups.EndTiming())
        case _:
            assert_never(timing)
