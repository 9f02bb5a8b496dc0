"""Regions as JSON documents of the schema `robust/region/1`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from robust.errors import InputError
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron

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
