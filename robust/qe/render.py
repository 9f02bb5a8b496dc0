"""Regions as text, LaTeX, SMT-LIB and sympy expressions."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.errors import InputError
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.estimate import Part
from robust.qe.polyhedron import Polyhedron

if TYPE_CHECKING:
    import sympy


LATEX = {"≤": r"\le", "≥": r"\ge", "<": "<", ">": ">", "=": "="}
SIMPLE_SYMBOL = r"[A-Za-z~!@$%^&*_+=<>.?/-][A-Za-z0-9~!@$%^&*_+=<>.?/-]*"


def to_text(parts: Sequence[Part]) -> str:
    """One line for each polyhedron."""
    lines: list[str] = []
    for base, removed in parts:
        lines.append(f"{'∪ ' if lines else ''}{{ {base} }}")
        lines += [f"∖ {{ {piece} }}" for piece in removed]
    return "\n".join(lines) or "∅"


def to_latex(parts: Sequence[Part]) -> str:
    """A formula in mathematical mode; `\\bot` and `\\top` for nothing and everything."""
    texts = []
    for base, removed in parts:
        outside = [rf"\neg \left({_latex_conjunction(piece)}\right)" for piece in removed]
        shown = [] if removed and not base.constraints else [_latex_conjunction(base)]
        texts.append(r" \land ".join([*shown, *outside]))
    if len(texts) > 1:
        texts = [rf"\left({text}\right)" for text in texts]
    return r" \lor ".join(texts) or r"\bot"


def _latex_conjunction(piece: Polyhedron) -> str:
    return r" \land ".join(_latex(constraint) for constraint in piece.constraints) or r"\top"


def _latex(constraint: LinearConstraint) -> str:
    if not constraint.coefficients:
        return r"\top" if constraint.is_true else r"\bot"
    left, relation, right = constraint.oriented()
    text = signed_sum([(_latex_name(name), factor) for name, factor in left], "-", str)
    number = (
        str(right)
        if right.denominator == 1
        else rf"{'-' if right < 0 else ''}\frac{{{abs(right.numerator)}}}"
        rf"{{{right.denominator}}}"
    )
    return f"{text} {LATEX[relation]} {number}"


def signed_sum(terms: Iterable[tuple[str, Fraction]], minus: str, number: Callable[[Fraction], str]) -> str:
    """`2 a - b`, with that sign for minus; factors of 1 are left out."""
    text = ""
    for name, factor in terms:
        sign = (minus if factor < 0 else "") if not text else (f" {minus} " if factor < 0 else " + ")
        text += sign + ("" if abs(factor) == 1 else f"{number(abs(factor))} ") + name
    return text


def _latex_name(name: str) -> str:
    if len(name) == 1 and name.isalpha():
        return name
    escaped = re.sub(r"([#$%&_{}])", r"\\\1", name.replace("\\", r"\backslash "))
    return rf"\mathit{{{escaped}}}"


def to_smtlib(parameters: Sequence[str], parts: Sequence[Part], name: str) -> str:
    """`(define-fun name ((x Real) …) Bool …)`."""
    arguments = " ".join(f"({_symbol(parameter)} Real)" for parameter in parameters)
    texts = []
    for base, removed in parts:
        literals = [_smt(constraint) for constraint in base.constraints]
        literals += [f"(not {_junction('and', [_smt(c) for c in piece.constraints], 'true')})" for piece in removed]
        texts.append(_junction("and", literals, "true"))
    return f"(define-fun {_symbol(name)} ({arguments}) Bool\n  {_junction('or', texts, 'false')})\n"


def _junction(operator: str, operands: list[str], neutral: str) -> str:
    if len(operands) < 2:
        return operands[0] if operands else neutral
    return f"({operator} {' '.join(operands)})"


def _smt(constraint: LinearConstraint) -> str:
    if not constraint.coefficients:
        return "true" if constraint.is_true else "false"
    terms = [
        _symbol(name) if factor == 1 else f"(* {_number(factor)} {_symbol(name)})"
        for name, factor in constraint.coefficients
    ]
    return f"({constraint.relation.value} {_junction('+', terms, '0.0')} {_number(constraint.constant)})"


def _number(value: Fraction | int) -> str:
    size = f"{abs(value.numerator)}.0" if value.denominator == 1 else f"(/ {abs(value.numerator)} {value.denominator})"
    return f"(- {size})" if value < 0 else size


def _symbol(name: str) -> str:
    return name if re.fullmatch(SIMPLE_SYMBOL, name) else f"|{name}|"


def to_sympy(parts: Sequence[Part]) -> sympy.Basic:
    """A Boolean expression over real symbols."""
    import sympy  # noqa: PLC0415 - takes half a second to import

    def junction(piece: Polyhedron) -> sympy.Basic:
        return sympy.And(*(relational(constraint) for constraint in piece.constraints))

    def relational(constraint: LinearConstraint) -> sympy.Basic:
        form = sum(
            (_rational(factor) * sympy.Symbol(name, real=True) for name, factor in constraint.coefficients),
            sympy.Integer(0),
        )
        relation = {Sense.AT_MOST: sympy.Le, Sense.LESS: sympy.Lt, Sense.EQUAL: sympy.Eq}[constraint.relation]
        return relation(form, _rational(constraint.constant))

    def _rational(value: Fraction | int) -> sympy.Basic:
        return sympy.Rational(value.numerator, value.denominator)

    return sympy.Or(
        *(sympy.And(junction(base), *(sympy.Not(junction(piece)) for piece in removed)) for base, removed in parts)
    )


SCHEMA = "robust/region/1"


def write_region(parameters: tuple[str, ...], pieces: Iterable[Polyhedron], base: Polyhedron | None) -> dict[str, Any]:
    """A document with rationals as strings."""
    document: dict[str, Any] = {"schema": SCHEMA, "parameters": list(parameters)}
    polyhedra = [{"constraints": _write(piece)} for piece in pieces]
    if base is None:
        return {**document, "form": "union", "polyhedra": polyhedra}
    return {**document, "form": "difference", "base": _write(base), "minus": polyhedra}


def read_region(
    document: Mapping[str, Any],
) -> tuple[tuple[str, ...], tuple[Polyhedron, ...], Polyhedron | None]:
    """Parameters, pieces and base of a document.

    Raises:
        InputError: if a key is missing or of the wrong kind, or the schema or form is unknown.
    """
    if not isinstance(document, Mapping):
        raise InputError(f"cannot read a region from {document!r}: expected a JSON object")
    if document.get("schema", SCHEMA) != SCHEMA:
        raise InputError(f"cannot read a region of schema {document['schema']!r}; expected {SCHEMA!r}")
    parameters = tuple(str(name) for name in _list(document, "parameters"))
    form = document.get("form", "union")
    if form == "union":
        return parameters, _pieces(parameters, document, "polyhedra"), None
    if form == "difference":
        base = Polyhedron(parameters, _read(_list(document, "base")))
        return parameters, _pieces(parameters, document, "minus"), base
    raise InputError(f"cannot read a region of form {form!r}; expected 'union' or 'difference'")


def _write(polyhedron: Polyhedron) -> list[dict[str, Any]]:
    return [constraint.as_dict() for constraint in polyhedron.constraints]


def _pieces(parameters: tuple[str, ...], document: Mapping[str, Any], key: str) -> tuple[Polyhedron, ...]:
    return tuple(Polyhedron(parameters, _read(_list(polyhedron, "constraints"))) for polyhedron in _list(document, key))


def _read(constraints: list[Any]) -> tuple[LinearConstraint, ...]:
    return tuple(LinearConstraint.from_dict(constraint) for constraint in constraints)


def _list(document: Any, key: str) -> list[Any]:
    value = document.get(key) if isinstance(document, Mapping) else None
    if not isinstance(value, list):
        raise InputError(f"cannot read a region: expected a list under {key!r}, found {value!r}")
    return value
