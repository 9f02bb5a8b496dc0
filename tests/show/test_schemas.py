"""Published schemas: those that types generate, and all of them schemas."""

import inspect

import jsonschema
import pytest

from robust.codec import schema_of
from robust.show import documents, made, pike
from robust.show.schemas import FILES, schema

DOCUMENTS = {one.__struct_config__.tag: one for one in (*documents.DOCUMENTS, *made.DOCUMENTS, *pike.DOCUMENTS)}


@pytest.mark.parametrize("name", FILES)
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(schema(name))
    assert schema(name)["title"] == name


@pytest.mark.parametrize("name", DOCUMENTS)
def test_published_schemas_are_those_of_the_types(name):
    """After a change of a type, write what `schema_of` returns to the file that is named here."""
    assert schema(name) == schema_of(DOCUMENTS[name], name, inspect.getdoc(DOCUMENTS[name])), FILES[name]
