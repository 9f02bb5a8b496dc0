"""Published schemas: those that types generate, and all of them schemas.

`python -m tests.show.test_schemas` writes those of types that have changed.
"""

import json
from pathlib import Path

import jsonschema
import pytest

from robust.json_text import schema_of
from robust.show import (
    batch,
    certificates,
    documents,
    execution,
    pike,
    pike_envelopes,
    plan_documents,
    repairs,
    risk,
    schemas,
    stnu,
    validation,
)
from robust.show.schemas import FILES, schema

MODULES = (
    batch,
    certificates,
    documents,
    execution,
    pike,
    pike_envelopes,
    plan_documents,
    repairs,
    risk,
    stnu,
    validation,
)
DOCUMENTS = {one.__struct_config__.tag: one for module in MODULES for one in module.DOCUMENTS}


@pytest.mark.parametrize("name", FILES)
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(schema(name))
    assert schema(name)["title"] == name


@pytest.mark.parametrize("name", DOCUMENTS)
def test_published_schemas_are_those_of_the_types(name):
    assert schema(name) == schema_of(DOCUMENTS[name], name), FILES[name]


if __name__ == "__main__":
    for each, kind in DOCUMENTS.items():
        if schema(each) != (new := schema_of(kind, each)):
            text = json.dumps(new, indent=2, ensure_ascii=False) + "\n"
            Path(schemas.__file__).with_name(FILES[each]).write_text(text, encoding="utf-8")
