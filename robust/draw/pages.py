"""Pages for a browser: one file each, without a network, whatever names from files are written into it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from robust.draw.style import LIGHT, STRONG


def self_contained(title: str, body: str, *, scripts: Sequence[str] = (), data: Mapping[str, Any] | None = None) -> str:
    """A whole page.

    Args:
        title: as text.
        body: as HTML, in which names from files are escaped.
        scripts: files of `robust/draw/web`, in the order in which they are run.
        data: what the scripts read from the element `data`, as JSON.
    """
    parts = [] if data is None else [f'<script type="application/json" id="data">{_json(data)}</script>']
    parts += [f"<script>\n{part(name)}</script>" for name in scripts]
    return Template(part("page.html")).substitute(
        title=escape(title), style=_palette() + part("page.css"), body=body, scripts="\n".join(parts)
    )


def part(name: str) -> str:
    """A file of `robust/draw/web`."""
    return files("robust.draw.web").joinpath(name).read_text(encoding="utf-8")


def _json(data: Mapping[str, Any]) -> str:
    """JSON that ends no element and begins no comment, wherever the names in it come from."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c").replace("&", "\\u0026")


def _palette() -> str:
    """The colours of all pictures as variables."""
    named = [f"--strong-{at}:{colour}" for at, colour in enumerate(STRONG)]
    named += [f"--light-{at}:{colour}" for at, colour in enumerate(LIGHT)]
    return f":root{{{';'.join(named)}}}\n"
