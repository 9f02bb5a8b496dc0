"""unified-planning expressions as PDDL text, with exact numbers; names in lower case."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, UnsupportedError
from robust.plan.numerals import format_number

if TYPE_CHECKING:
    import unified_planning.model as up

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*")
_JUNCTIONS = {
    "is_and": "and",
    "is_or": "or",
    "is_not": "not",
    "is_implies": "imply",
    "is_equals": "=",
    "is_le": "<=",
    "is_lt": "<",
    "is_plus": "+",
    "is_times": "*",
    "is_minus": "-",
    "is_div": "/",
}


def name_of(text: str) -> str:
    """The name in lower case; InputError for one that PDDL cannot have."""
    if _NAME.fullmatch(text) is None:
        raise InputError(f"found the name {text!r}, expected letters, digits, '_' and '-'")
    return text.lower()


def typed(variables: Iterable[Any]) -> str:
    """Parameters or variables, each with its type."""
    return " ".join(f"?{name_of(one.name)} - {_type(one)}" for one in variables)


def _type(variable: Any) -> str:
    if not variable.type.is_user_type():
        raise UnsupportedError(f"found parameter {variable.name!r} of type {variable.type}, expected objects")
    return name_of(variable.type.name)


def named(fluent: up.FNode) -> tuple[str, tuple[str, ...]]:
    """Name and arguments of a ground fluent."""
    return name_of(fluent.fluent().name), tuple(name_of(one.object().name) for one in fluent.args)


def constant(value: up.FNode) -> bool | Fraction:
    """A truth value or a number."""
    return bool(value.bool_constant_value()) if value.is_bool_constant() else number_of(value)


def number_of(value: up.FNode) -> Fraction:
    """A number, exactly."""
    if not (value.is_int_constant() or value.is_real_constant()):
        raise UnsupportedError(f"found the value '{value}', expected a truth value or a number")
    return Fraction(value.constant_value())


def expression(root: up.FNode) -> str:
    """A condition or a numeric expression; without recursion, whatever its depth."""
    results: list[str] = []
    pending: list[tuple[up.FNode, bool]] = [(root, False)]
    while pending:
        node, is_done = pending.pop()
        if not is_done:
            pending.append((node, True))
            pending.extend((one, False) for one in reversed(node.args))
            continue
        cut = len(results) - len(node.args)
        parts, results = results[cut:], results[:cut]
        results.append(_text(node, parts))
    return results[0]


def _text(node: up.FNode, parts: list[str]) -> str:
    for test, word in _JUNCTIONS.items():
        if getattr(node, test)():
            return f"({' '.join((word, *parts))})"
    for test, write in _LEAVES.items():
        if getattr(node, test)():
            return write(node, parts)
    raise UnsupportedError(f"found the expression '{node}', expected one that PDDL 2.1 can say")


def _number(node: up.FNode, _parts: list[str]) -> str:
    value = number_of(node)
    text = format_number(value)
    return f"(/ {value.numerator} {value.denominator})" if "/" in text else text


def _quantified(node: up.FNode, parts: list[str]) -> str:
    word = "forall" if node.is_forall() else "exists"
    return f"({word} ({typed(node.variables())}) {parts[0]})"


_LEAVES: dict[str, Callable[[Any, list[str]], str]] = {
    "is_iff": lambda _, parts: f"(and (imply {parts[0]} {parts[1]}) (imply {parts[1]} {parts[0]}))",
    "is_forall": _quantified,
    "is_exists": _quantified,
    "is_fluent_exp": lambda node, parts: f"({' '.join((name_of(node.fluent().name), *parts))})",
    "is_parameter_exp": lambda node, _: f"?{name_of(node.parameter().name)}",
    "is_variable_exp": lambda node, _: f"?{name_of(node.variable().name)}",
    "is_object_exp": lambda node, _: name_of(node.object().name),
    "is_bool_constant": lambda node, _: "(and)" if node.is_true() else "(or)",
    "is_int_constant": _number,
    "is_real_constant": _number,
}
