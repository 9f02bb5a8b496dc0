"""Forms to effects, with every name checked."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from robust.plan.model import Timing
from robust.plan.pddl.check import Scope, bare_function, count, function, proposition, unsupported
from robust.plan.pddl.conditions import (
    arithmetic,
    check_operands,
    condition,
    conjunction,
    expression,
    preference,
    quantified,
    specified_time,
    timed_conditions,
)
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, quote
from robust.plan.pddl.syntax import (
    Arithmetic,
    ContinuousUpdate,
    DurationTerm,
    ForallEffect,
    FunctionTerm,
    LiftedCondition,
    LiftedEffect,
    LiteralEffect,
    Number,
    NumericExpression,
    NumericUpdate,
    Operator,
    Update,
    WhenEffect,
)

_UPDATES = frozenset(update.value for update in Update)
_TIMED_EFFECT = "a timed effect: (at start ...) or (at end ...)"


def effects(  # noqa: PLR0911 (one return for each kind of form)
    item: Item, scope: Scope, when: Timing | None
) -> list[LiftedEffect]:
    """The effects in `item`; `when` is their time if it is known: it is not at the top of a durative action."""
    if not isinstance(item, Form):
        raise fault(item, "an effect in parentheses")
    if not item.items:
        return []
    specified = specified_time(item)
    if specified is not None:
        return _timed(item, scope, when, specified)
    match item.head:
        case "and":
            return [effect for inner in item.rest for effect in effects(inner, scope, when)]
        case "forall":
            variables = quantified(item, scope, "an effect")
            inside = effects(item.items[2], scope.bind(variables), when)
            return [ForallEffect(variables, tuple(inside), item.location)]
        case "when":
            return [_conditional(item, scope, when)]
        case "preference":
            raise preference(item)
        case "or" | "imply" | "exists":
            raise fault(item, "an effect; effects are deterministic: and, forall, when, not, assign, increase, ...")
        case head if head in _UPDATES:
            return [_update(item, scope, when)]
        case _:
            return [_literal(item, scope, when)]


def _timed(form: Form, scope: Scope, outside: Timing | None, when: Timing) -> list[LiftedEffect]:
    if outside is not None:
        raise fault(form, "an effect without a time specifier here")
    if when is Timing.OVER_ALL:
        hint = "; continuous effects are written without one, as in (increase (f) (* #t 2))"
        raise fault(form, _TIMED_EFFECT, hint=hint)
    return effects(form.items[2], scope, when)


def _literal(form: Form, scope: Scope, when: Timing | None) -> LiteralEffect:
    if when is None:
        raise fault(form, _TIMED_EFFECT)
    if form.head != "not":
        return LiteralEffect(when, proposition(form, scope), value=True)
    check_operands(form, 1, "a proposition")
    inner = form.items[1]
    if not isinstance(inner, Form):
        raise fault(inner, "a proposition in parentheses")
    return LiteralEffect(when, proposition(inner, scope), value=False)


def _update(form: Form, scope: Scope, when: Timing | None) -> NumericUpdate | ContinuousUpdate:
    if len(form.rest) != 2:
        found = f"'{form.head}' with {count(len(form.rest), 'operand')}"
        raise fault(form, "a numeric function and an expression", found=found)
    update = Update(form.head)
    target = _target(form.items[1], scope)
    right = form.items[2]
    if not _mentions_time(right):
        if when is None:
            raise fault(form, f"{_TIMED_EFFECT}, or a continuous one that mentions #t")
        return NumericUpdate(when, update, target, expression(right, scope), form.location)
    if not scope.durative:
        raise fault(right, "no #t: an instantaneous action has no continuous effects")
    if when is not None:
        expected = f"no #t in an effect {when.value}; continuous effects are written without a time specifier"
        raise fault(right, expected)
    if update not in (Update.INCREASE, Update.DECREASE):
        raise fault(form, "increase or decrease for a continuous effect")
    rate = _rate(right, scope)
    for used in _walk(rate):
        if isinstance(used, DurationTerm):
            raise fault(used.location, "a rate of change that does not depend on the duration", found="'?duration'")
    return ContinuousUpdate(update, target, rate, form.location)


def _target(item: Item, scope: Scope) -> FunctionTerm:
    if isinstance(item, Form):
        return function(item, scope)
    if item.kind is Kind.NAME:
        return bare_function(item, scope)
    raise fault(item, "a numeric function to change, as in (increase (f) 1)")


def _mentions_time(item: Item) -> bool:
    if isinstance(item, Word):
        return item.kind is Kind.TIME
    return any(_mentions_time(inner) for inner in item.items)


def _walk(of: NumericExpression) -> Iterator[NumericExpression]:
    todo = [of]
    while todo:
        node = todo.pop()
        yield node
        if isinstance(node, Arithmetic):
            todo.extend(node.operands)


def _rate(item: Item, scope: Scope) -> NumericExpression:
    """The factor of #t in an expression that is linear in it and zero without it."""
    expected = "a rate times #t, as in (* #t 2)"
    if isinstance(item, Word):
        return Number(Fraction(1), "1", item.location)
    timed = [_mentions_time(inner) for inner in item.rest]
    rates = [
        _rate(inner, scope) if has else expression(inner, scope) for inner, has in zip(item.rest, timed, strict=True)
    ]
    match item.head:
        case "*" if timed.count(True) == 1:
            return _product(rates, timed, item)
        case "/" if timed == [True, False]:
            return arithmetic(Operator.DIVIDED, rates, item)
        case "+" | "-" if timed and all(timed) and (item.head == "+" or len(timed) <= 2):
            return arithmetic(Operator(item.head), rates, item)
        case _:
            raise fault(item, expected)


def _product(factors: list[NumericExpression], timed: list[bool], form: Form) -> NumericExpression:
    one = Fraction(1)
    kept = [
        factor
        for factor, has in zip(factors, timed, strict=True)
        if not (has and isinstance(factor, Number) and factor.value == one)
    ]
    if not kept:
        return Number(one, "1", form.location)
    return kept[0] if len(kept) == 1 else arithmetic(Operator.TIMES, kept, form)


def _conditional(form: Form, scope: Scope, when: Timing | None) -> WhenEffect:
    check_operands(form, 2, "parts, a condition and an effect")
    inside = effects(form.items[2], scope, when)
    for effect in primitive(inside):
        if isinstance(effect, ContinuousUpdate):
            remedy = "split the action in two, each with its own continuous effect"
            raise unsupported(form, "a conditional continuous effect", remedy)
    if when is not None:
        return WhenEffect(condition(form.items[1], scope), tuple(inside), form.location)
    return WhenEffect(_condition_at(form, inside, scope), tuple(inside), form.location)


def _condition_at(form: Form, inside: list[LiftedEffect], scope: Scope) -> LiftedCondition:
    """The timed condition of a `when`, which must have the timing of the effects."""
    timed = timed_conditions(form.items[1], scope)
    timings = {part.timing for part in timed}
    timings |= {effect.timing for effect in primitive(inside) if not isinstance(effect, ContinuousUpdate)}
    if len(timings) > 1 or Timing.OVER_ALL in timings:
        names = " and ".join(sorted(quote(part.value) for part in timings))
        remedy = "give condition and effects one timing, and remember an earlier condition in a predicate of its own"
        raise unsupported(form, f"a conditional effect that mixes {names}", remedy)
    return conjunction([part.condition for part in timed], form)


def primitive(
    of: list[LiftedEffect] | tuple[LiftedEffect, ...],
) -> Iterator[LiteralEffect | NumericUpdate | ContinuousUpdate]:
    """All effects that are not themselves made of effects."""
    for effect in of:
        if isinstance(effect, (ForallEffect, WhenEffect)):
            yield from primitive(effect.effects)
        else:
            yield effect
