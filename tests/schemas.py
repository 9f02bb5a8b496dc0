"""JSON Schemas (draft 2020-12) of what `--json` prints, by the value of `schema` in the output."""

import json
from importlib.resources import files
from typing import Any

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
