"""JSON Schemas (draft 2020-12) of what `--json` prints: the published ones by the value of `schema` in the output, and
those that types generate."""

import json
import re
import sys
from collections.abc import Mapping
from fractions import Fraction
from functools import cache, partial
from importlib.resources import files
from textwrap import dedent
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import UNSET, Struct, UnsetType, defstruct

from robust.json_text import JsonObject, is_result, members_of, wire

FOLDER = files("robust.show") / "schemas"
_ENDING = ".schema.json"
FILES = {
    f"robust/{file.name.removesuffix(_ENDING).removeprefix('certify-')}/1": file.name
    for file in FOLDER.iterdir()
    if file.name.endswith(_ENDING)
}


def schema(name: str) -> dict[str, Any]:
    """The schema of that name, such as `robust/envelope/1`; KeyError for others."""
    text = (FOLDER / FILES[name]).read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


# -- of types ----------------------------------------------------------------------------------------------------------


def schema_of(kind: type[JsonObject], title: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a class; its `RULES` are what types cannot say.

    If it has `DECIMALS`, rationals may also be numbers.

    Descriptions are those of docstrings: of an object the text, of its fields what stands below `Attributes:`.
    """
    (top,), parts = msgspec.json.schema_components(
        [_wire_type(kind)], schema_hook=partial(_schema, getattr(kind, "DECIMALS", False)), ref_template=_PART
    )
    for part in parts.values():
        del part["title"]
        text, _, attributes = part.pop("description", "").partition("Attributes:\n")
        if text.strip():
            part["description"] = " ".join(text.split())
        for name, words in _FIELD.findall(dedent(attributes)):
            if name in part["properties"]:
                part["properties"][name]["description"] = " ".join(words.split())
    body = parts.pop(top["$ref"].rsplit("/", 1)[1]) | getattr(kind, "RULES", {})
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return {**head, **body, **({"$defs": parts} if parts else {})}


_PART = "#/$defs/{name}"
_FIELD = re.compile(r"^(\w+): (.*(?:\n .*)*)", re.MULTILINE)


@cache
def _wire_type(kind: Any) -> Any:
    """A type as msgspec knows it: results are records of what they are in JSON."""
    if (arguments := get_args(kind)) and get_origin(kind) is Annotated:
        return Annotated[(_wire_type(arguments[0]), *arguments[1:])]
    if arguments or not isinstance(kind, type):
        return _generic(kind, tuple(map(_wire_type, arguments))) if arguments else kind
    if (show := wire.dispatch(kind)) is not wire.dispatch(object):
        return _wire_type(get_type_hints(show, localns=_names_for(show), include_extras=True)["return"])
    return _record_type(kind) if issubclass(kind, Struct) or is_result(kind) else kind


def _record_type(kind: Any) -> type[Struct]:
    """The type of a record or a result in JSON."""
    is_record = issubclass(kind, Struct)
    hints = get_type_hints(kind, localns=_names_for(kind), include_extras=True)
    names = [(name, name) for name in kind.__struct_fields__] if is_record else members_of(kind)
    members: list[Any] = [
        (shown, _wire_type(hints[name]), *((UNSET,) if UnsetType in get_args(hints[name]) else ()))
        for name, shown in names
    ]
    config = kind.__struct_config__ if is_record else JsonObject.__struct_config__
    return defstruct(
        kind.__name__,
        members,
        bases=(JsonObject,),
        namespace={"__doc__": kind.__doc__},
        kw_only=True,
        tag=config.tag,
        tag_field=config.tag_field,
    )


def _generic(kind: Any, arguments: tuple[Any, ...]) -> Any:
    """A type with other arguments."""
    origin: Any = get_origin(kind)
    if origin in {Union, UnionType}:
        return Union[arguments]  # noqa: UP007 - of as many as there are
    if origin in {dict, Mapping}:
        return dict[str, arguments[1]]  # type: ignore[valid-type]
    if origin is tuple and arguments[-1] is not ...:
        return origin[arguments]
    return list[arguments[0]]  # type: ignore[valid-type]


def _names_for(kind: Any) -> dict[str, Any]:
    """What the module of a class or function knows, and all classes of the package by name, which are unique: results
    may import their types for type checkers only."""
    modules = [module for name, module in sys.modules.items() if name.startswith("robust.")]
    known = {name: value for module in modules for name, value in vars(module).items() if isinstance(value, type)}
    return known | vars(sys.modules[kind.__module__])


def _schema(decimals: bool, kind: type) -> dict[str, Any]:
    if kind is Fraction:
        return {"type": ["string", "number"] if decimals else "string", "pattern": "^-?[0-9]+(/[1-9][0-9]*)?$"}
    raise NotImplementedError(kind.__name__)
