"""Published schemas: those that types generate, and all of them schemas.

`python -m tests.show.test_schemas` writes those of types that have changed.
"""

import json
import pkgutil
from importlib import import_module
from pathlib import Path

import jsonschema
import pytest
from msgspec import StructMeta

from robust import show
from tests.schemas import FILES, FOLDER, schema, schema_of

MODULES = [import_module(module.name) for module in pkgutil.iter_modules(show.__path__, "robust.show.")]
KINDS = {kind for module in MODULES for kind in vars(module).values() if isinstance(kind, StructMeta)}
DOCUMENTS = {tag: kind for kind in sorted(KINDS, key=str) if (tag := kind.__struct_config__.tag)}


@pytest.mark.parametrize("name", FILES)
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(schema(name))
    assert schema(name)["title"] == name


@pytest.mark.parametrize("name", DOCUMENTS)
def test_published_schemas_are_those_of_the_types(name):
    assert schema(name) == schema_of(DOCUMENTS[name], name), FILES[name]


if __name__ == "__main__":
    for name, kind in DOCUMENTS.items():
        if schema(name) != (new := schema_of(kind, name)):
            text = json.dumps(new, indent=2, ensure_ascii=False) + "\n"
            Path(str(FOLDER / FILES[name])).write_text(text, encoding="utf-8")
