"""JSON Schemas (draft 2020-12) of what `--json` prints, by the value of `schema` in the output."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

FILES = {
    "robust/check/1": "check.schema.json",
    "robust/envelope/1": "envelope.schema.json",
    "robust/error/1": "error.schema.json",
    "robust/region/1": "region.schema.json",
    "robust/compare/1": "compare.schema.json",
    "robust/certify/1": "certify.schema.json",
    "robust/verify/1": "certify-verify.schema.json",
    "robust/convert/1": "convert.schema.json",
    "robust/execute/1": "execute.schema.json",
    "robust/pike-check/1": "pike-check.schema.json",
    "robust/pike-compile/1": "pike-compile.schema.json",
    "robust/pike-cross/1": "pike-cross.schema.json",
    "robust/pike-run/1": "pike-run.schema.json",
    "robust/pike-stdio/1": "pike-stdio.schema.json",
    "robust/pike-stdio-input/1": "pike-stdio-input.schema.json",
    "robust/pike-plot/1": "pike-plot.schema.json",
}


def schema(name: str) -> dict[str, Any]:
    """The schema of that name, such as `robust/envelope/1`; KeyError for others."""
    text = resources.files(__name__).joinpath(FILES[name]).read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded
