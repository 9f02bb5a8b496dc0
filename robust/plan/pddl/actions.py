"""Forms to actions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

from robust.errors import did_you_mean
from robust.plan.model import Timing
from robust.plan.pddl import declarations
from robust.plan.pddl.check import Scope, Vocabulary
from robust.plan.pddl.conditions import condition, duration_bounds, timed_conditions
from robust.plan.pddl.effects import effects
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault
from robust.plan.pddl.syntax import (
    ActionSchema,
    ForallEffect,
    LiftedEffect,
    LiteralEffect,
    TimedLiftedCondition,
    WhenEffect,
)

T = TypeVar("T")

_PARTS = {
    False: (":parameters", ":synth-parameters", ":precondition", ":effect"),
    True: (":parameters", ":synth-parameters", ":duration", ":condition", ":effect"),
}


def action(form: Form, vocabulary: Vocabulary, parameters: tuple[str, ...]) -> ActionSchema:
    """An action; `parameters` are the synthesis parameters of the domain."""
    durative = form.head == ":durative-action"
    name = form.items[1] if len(form.items) > 1 else None
    if not isinstance(name, Word) or name.kind is not Kind.NAME:
        raise fault(name or form, f"the name of an action after '{form.head}'")
    parts = _parts(form, durative)
    variables = declarations.variables(_list(parts, ":parameters"), vocabulary.types)
    for variable in variables:
        if variable.name in parameters:
            found = f"variable '?{variable.name}'"
            raise fault(variable.location, "a name that is no synthesis parameter of the domain", found=found)
    own = declarations.synth_parameters(
        _list(parts, ":synth-parameters"), {*parameters, *(variable.name for variable in variables)}
    )
    scope = Scope(
        vocabulary,
        variables={variable.name: variable for variable in variables},
        parameters={**dict.fromkeys(parameters, False), **dict.fromkeys(own, True)},
        durative=durative,
    )
    if durative and ":duration" not in parts:
        raise fault(form, "':duration' in a durative action, as in :duration (= ?duration 5)")
    return ActionSchema(
        name=name.text,
        durative=durative,
        parameters=variables,
        synth_parameters=own,
        durations=tuple(_read(parts, ":duration", lambda item: duration_bounds(item, scope))),
        conditions=tuple(_conditions(parts, scope)),
        effects=tuple(
            _read(parts, ":effect", lambda item: effects(item, scope, None if durative else Timing.AT_START))
        ),
        location=form.location,
    )


def _parts(form: Form, durative: bool) -> dict[str, tuple[Item, ...]]:
    """What follows each keyword: one item, but any number of parameters to synthesise."""
    allowed = _PARTS[durative]
    parts: dict[str, tuple[Item, ...]] = {}
    keyword: Word | None = None
    for item in form.items[2:]:
        section = _synth_section(item)
        if section is not None:
            _check_keyword(section, allowed, parts)
            parts[section.text] = item.rest if isinstance(item, Form) else ()
            keyword = None
        elif isinstance(item, Word) and item.kind is Kind.KEYWORD:
            _check_complete(keyword, parts, item)
            _check_keyword(item, allowed, parts)
            keyword, parts[item.text] = item, ()
        elif keyword is None or (parts[keyword.text] and keyword.text != ":synth-parameters"):
            raise fault(item, f"a keyword ({', '.join(sorted(set(allowed) - set(parts)))}) or ')'")
        else:
            parts[keyword.text] = (*parts[keyword.text], item)
    _check_complete(keyword, parts, form)
    return parts


def _synth_section(item: Item) -> Word | None:
    """The keyword of `(:synth-parameters ?s ...)` written as a form of its own."""
    if isinstance(item, Form) and item.head == ":synth-parameters" and isinstance(item.items[0], Word):
        return item.items[0]
    return None


def _check_keyword(word: Word, allowed: tuple[str, ...], parts: Mapping[str, object]) -> None:
    if word.text not in allowed:
        twins = {":condition": ":precondition", ":precondition": ":condition"}
        twin = twins.get(word.text, "")
        hint = f"; did you mean '{twin}'?" if twin in allowed else did_you_mean(word.text, allowed)
        raise fault(word, "a keyword of this kind of action", hint=hint)
    if word.text in parts:
        raise fault(word, "each keyword once", found=f"a second '{word.text}'")


def _check_complete(keyword: Word | None, parts: Mapping[str, tuple[Item, ...]], following: Item) -> None:
    if keyword is not None and not parts[keyword.text] and keyword.text != ":synth-parameters":
        found = "the end of the action" if isinstance(following, Form) else f"'{following.text}'"
        raise fault(keyword, f"a form in parentheses after '{keyword.text}'", found=found)


def _list(parts: Mapping[str, tuple[Item, ...]], keyword: str) -> tuple[Item, ...]:
    """The items of a list in parentheses; parameters to synthesise may stand without."""
    found = parts.get(keyword, ())
    if keyword == ":synth-parameters" or not found:
        return found
    if not isinstance(found[0], Form):
        raise fault(found[0], f"a list in parentheses after '{keyword}'")
    return found[0].items


def _read(parts: Mapping[str, tuple[Item, ...]], keyword: str, read: Callable[[Item], list[T]]) -> list[T]:
    found = parts.get(keyword)
    return read(found[0]) if found else []


def _conditions(parts: Mapping[str, tuple[Item, ...]], scope: Scope) -> list[TimedLiftedCondition]:
    if scope.durative:
        return _read(parts, ":condition", lambda item: timed_conditions(item, scope))
    untimed = _read(parts, ":precondition", lambda item: [condition(item, scope)])
    return [TimedLiftedCondition(Timing.AT_START, part) for part in untimed]


def written_functions(actions: Mapping[str, ActionSchema]) -> Iterator[str]:
    """The functions that some action changes."""
    todo: list[LiftedEffect] = [effect for schema in actions.values() for effect in schema.effects]
    while todo:
        effect = todo.pop()
        if isinstance(effect, (ForallEffect, WhenEffect)):
            todo.extend(effect.effects)
        elif not isinstance(effect, LiteralEffect):
            yield effect.target.function
