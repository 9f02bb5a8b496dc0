"""Domains and problems as PDDL text for planners: the way back from :mod:`robust.plan.pddl.reader`.

Reading the text of a domain gives an equal domain. Numbers of a problem are decimals. One without a finite decimal, as
1/3, or with more than `_PLACES` places, is rounded: times of timed literals so that what holds for a shorter time is
not made to hold for longer, other numbers to the nearest. A planner may then miss a plan; one that is not valid for the
exact numbers is found out by the check of its plan.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import assert_never

from robust.errors import UnsupportedError
from robust.numbers import format_number
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl.conditions import primitive
from robust.plan.pddl.declarations import type_text
from robust.plan.pddl.syntax import (
    OBJECT,
    ActionSchema,
    ContinuousUpdate,
    Domain,
    ForallEffect,
    LiftedCondition,
    LiftedEffect,
    LiteralEffect,
    NumericUpdate,
    Problem,
    Signature,
    TypedName,
    WhenEffect,
)
from robust.plan.pddl.text import condition_text, duration_text, expression_text

_REQUIREMENTS = ":typing :fluents :adl :durative-actions :duration-inequalities :timed-initial-literals"
_CONTINUOUS = ":continuous-effects"
_PLACES = 9
_TIME_PLACES = 3
"""Planners print times with three places; a limit between two of them is of no use to them."""


def domain_text(domain: Domain) -> str:
    """The domain in PDDL.

    Raises:
        UnsupportedError: for synthesis parameters, which no planner reads.
    """
    parameters = [*domain.parameters, *(name for one in domain.actions.values() for name in one.synth_parameters)]
    if parameters:
        expected = "a domain without: write their values in"
        raise UnsupportedError(f"found synthesis parameter {parameters[0]!r}, expected {expected}", domain.location)
    continuous = any(isinstance(one, ContinuousUpdate) for schema in domain.actions.values() for one in schema.effects)
    sections = [
        f"(:requirements {_REQUIREMENTS}{f' {_CONTINUOUS}' if continuous else ''})",
        _section(":types", _types(domain.types)),
        _section(":constants", _typed(domain.constants.values())),
        _section(":predicates", " ".join(map(_signature, domain.predicates.values()))),
        _section(":functions", " ".join(map(_signature, domain.functions.values()))),
        *map(_action, domain.actions.values()),
    ]
    body = "\n".join(section for section in sections if section)
    return f"(define (domain {domain.name})\n{body})\n"


def problem_text(problem: Problem, domain: Domain) -> str:
    """The problem in PDDL, with a time to be short as its metric: planners need one to prefer one plan to another."""
    objects = [one for name, one in problem.objects.items() if name not in domain.constants]
    facts = [
        *(str(atom) for atom in sorted(problem.atoms)),
        *(f"(= {fluent} {decimal(value, _PLACES)})" for fluent, value in problem.fluents.items()),
        *map(_timed_literal, problem.timed_literals),
    ]
    sections = [
        f"(:domain {problem.domain})",
        _section(":objects", _typed(objects)),
        f"(:init {' '.join(facts)})",
        f"(:goal {_condition(problem.goal)})",
        "(:metric minimize (total-time))",
    ]
    return f"(define (problem {problem.name})\n" + "\n".join(section for section in sections if section) + ")\n"


def decimal(value: Fraction, places: int, *, up: bool | None = None) -> str:
    """The value with at most so many decimals; rounded up, down, or (None) to the nearest where it has more."""
    scaled = value * 10**places
    whole = round(scaled) if up is None else -(-scaled // 1) if up else scaled // 1
    return format_number(Fraction(whole, 10**places))


def _timed_literal(literal: TimedLiteral) -> str:
    match literal.target:
        case Atom():
            fact = str(literal.target) if literal.value else f"(not {literal.target})"
        case Fluent():
            fact = f"(= {literal.target} {decimal(Fraction(literal.value), _PLACES)})"
        case _:
            assert_never(literal.target)
    return f"(at {decimal(literal.time, _TIME_PLACES, up=literal.value is True)} {fact})"


def _section(keyword: str, body: str) -> str:
    return f"({keyword} {body})" if body else ""


def _types(types: Mapping[str, frozenset[str]]) -> str:
    """Each type with its direct ancestors: those that are no ancestors of another one."""
    texts = []
    for name in (one for one in types if one != OBJECT):
        above = types[name] - {name}
        direct = sorted(one for one in above if not any(one in types[other] for other in above - {one}))
        texts.append(f"{name} - {type_text(direct or (OBJECT,))}")
    return " ".join(texts)


def _typed(names: Iterable[TypedName], mark: str = "") -> str:
    return " ".join(f"{mark}{one.name} - {type_text(one.types)}" for one in names)


def _signature(signature: Signature) -> str:
    return f"({' '.join(filter(None, (signature.name, _typed(signature.parameters, '?'))))})"


def _action(schema: ActionSchema) -> str:
    head = f"{schema.name}\n :parameters ({_typed(schema.parameters, '?')})"
    effects = " ".join(_effects(schema.effects, schema.durative))
    if not schema.durative:
        condition = _together([_condition(one.condition) for one in schema.conditions])
        return f"(:action {head}\n :precondition {condition}\n :effect (and {effects}))"
    conditions = " ".join(_at(one.timing, _condition(one.condition)) for one in schema.conditions)
    durations = _together(
        [_when(one.timing, duration_text(one, {}), one.timing is Timing.AT_END) for one in schema.durations]
    )
    return (
        f"(:durative-action {head}\n :duration {durations}\n :condition (and {conditions})\n :effect (and {effects}))"
    )


def _together(texts: list[str]) -> str:
    """A conjunction; not all planners read one of a single part."""
    return texts[0] if len(texts) == 1 else f"(and {' '.join(texts)})"


def _at(timing: Timing, text: str) -> str:
    return f"({timing.value} {text})"


def _effects(effects: Iterable[LiftedEffect], durative: bool) -> Iterator[str]:
    return (_effect(one, durative) for one in effects)


def _effect(effect: LiftedEffect, durative: bool) -> str:
    match effect:
        case LiteralEffect(timing, proposition, value):
            text = condition_text(proposition, {})
            return _when(timing, text if value else f"(not {text})", durative)
        case NumericUpdate(timing, update, target, expression):
            change = f"({update.value} {expression_text(target, {})} {expression_text(expression, {})})"
            return _when(timing, change, durative)
        case ContinuousUpdate(update, target, rate):
            return f"({update.value} {expression_text(target, {})} (* #t {expression_text(rate, {})}))"
        case ForallEffect(variables, effects):
            return f"(forall ({_typed(variables, '?')}) {_all(effects, durative)})"
        case WhenEffect(condition, effects):
            return f"(when {_conditional(condition, effects, durative)} {_all(effects, durative)})"
        case _:
            assert_never(effect)


def _all(effects: Iterable[LiftedEffect], durative: bool) -> str:
    return f"(and {' '.join(_effects(effects, durative))})"


def _conditional(condition: LiftedCondition, effects: tuple[LiftedEffect, ...], durative: bool) -> str:
    """The condition of a conditional effect; its timing is that of what it guards."""
    timing = next((one.timing for one in primitive(effects) if not isinstance(one, ContinuousUpdate)), Timing.AT_START)
    return _when(timing, _condition(condition), durative)


def _when(timing: Timing, text: str, durative: bool) -> str:
    return _at(timing, text) if durative else text


def _condition(condition: LiftedCondition) -> str:
    return condition_text(condition, {})
