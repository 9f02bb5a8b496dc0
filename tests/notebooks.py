"""Notebooks are stored with what their cells print and show: `python -m tests.notebooks` runs all and stores it."""

import ast
import io
import json
import re
import sys
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.cli.running import REPOSITORY, environment, ran

NOTEBOOKS = sorted((REPOSITORY / "docs/notebooks").glob("*.ipynb"))
FORMS = {"text/html": "_repr_html_", "image/svg+xml": "_repr_svg_"}


def shown(value):
    """What a notebook shows of a value, by kind of content; a result with a table is the screen that it prints."""
    kinds = {"text/plain": str(value) if hasattr(value, "_repr_html_") else repr(value)}
    for kind, method in FORMS.items():
        if callable(getattr(value, method, None)) and (text := getattr(value, method)()) is not None:
            kinds[kind] = text
    return {kind: text.splitlines(keepends=True) for kind, text in kinds.items()}


def outputs_of(cells):
    """The outputs of code cells, run one after the other in this process."""
    names, found = {"__name__": "__main__"}, []
    for number, source in enumerate(cells, start=1):
        body, printed, last = ast.parse(source).body, io.StringIO(), None
        with redirect_stdout(printed):
            if body and isinstance(body[-1], ast.Expr):
                last = ast.Expression(body.pop().value)
            exec(compile(ast.Module(body, []), "<cell>", "exec"), names)  # noqa: S102 - our own documentation
            value = None if last is None else eval(compile(last, "<cell>", "eval"), names)  # noqa: S307 - likewise
        outputs = []
        if printed.getvalue():
            outputs.append(
                {"name": "stdout", "output_type": "stream", "text": printed.getvalue().splitlines(keepends=True)}
            )
        if value is not None:
            result = {"data": shown(value), "metadata": {}}
            outputs.append({"execution_count": number, **result, "output_type": "execute_result"})
        found.append(outputs)
    return found


def executed(notebook, folder):
    """The notebook with outputs, and how the process ended that ran it in a folder, where warnings are errors."""
    document = json.loads(notebook.read_text(encoding="utf-8"))
    cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    script = "import json, sys, tests.notebooks as n; print(json.dumps(n.outputs_of(json.loads(sys.argv[1]))))"
    paths = {"MPLBACKEND": "agg", "PYTHONPATH": str(REPOSITORY)}
    sources = json.dumps(["".join(cell["source"]) for cell in cells])
    ended = ran(sys.executable, "-W", "error", "-c", script, sources, cwd=folder, env=environment(**paths), timeout=300)
    if ended.code == 0:
        for number, (cell, outputs) in enumerate(zip(cells, json.loads(ended.out), strict=True), start=1):
            cell["execution_count"], cell["outputs"] = number, outputs
    return document, ended


def texts(document):
    """What cells print and show as text, one after the other, without what depends on the machine."""
    parts = []
    for output in (output for cell in document["cells"] for output in cell.get("outputs", ())):
        lines = output["text"] if output["output_type"] == "stream" else output["data"]["text/plain"]
        parts.append(re.sub(r"\d[\d.]* ?(ms|s)\b|0x[0-9a-f]+|seconds=[\d.e-]+", "...", "".join(lines)))
    return parts


def main():
    for notebook in map(Path, sys.argv[1:] or NOTEBOOKS):
        with TemporaryDirectory() as folder:
            document, ended = executed(notebook, folder)
        if ended.code:
            raise SystemExit(f"{notebook}: {ended.err}")
        notebook.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
