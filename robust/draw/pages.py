"""Pages for a browser: one file each, without a network, whatever names from files are written into it.

The table of many plans is sorted by its headings, and readable without scripts.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from robust.draw.style import LIGHT, STRONG
from robust.show.batch import NAMES, answer_lines, ratio, summary_lines
from robust.show.console import colour_of
from robust.sweeps.batch import Batch, BatchRow, PlanRun


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


# -- a table of many plans ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell: what is shown, by what it is sorted (a number, or its text), and lines to be unfolded."""

    text: str
    order: float | None = None
    more: Sequence[str] = ()
    kind: str = ""

    @property
    def html(self) -> str:
        order = "" if self.order is None else f' data-order="{self.order!r}"'
        kind = f' class="{self.kind}"' if self.kind else ""
        shown = escape(self.text)
        if self.more:
            lines = escape("\n".join(self.more))
            shown = f"<details><summary>{shown}</summary><pre>{lines}</pre></details>"
        return f"<td{order}{kind}>{shown}</td>"


_COLOURS = {"green": "good", "bold red": "bad"}
_NOTHING = Cell("–", -1.0)
"""Before all numbers."""


def batch_page(found: Batch) -> str:
    """The page of a batch."""
    head = ["plan"]
    for one in found.asked:
        before = f"{NAMES[one.name]}: " if found.verb == "compare" else ""
        head += [f"{before}{word}" for word in ("answer", "seconds", "what it says")]
    head += ["volume IRR/CCMMZ", "width IRR/CCMMZ"] if found.verb == "compare" else []
    headings = "".join(f'<th scope="col"><button type="button">{escape(cell)}</button></th>' for cell in head)
    rows = "\n".join(f"<tr>{''.join(cell.html for cell in _cells(found, row))}</tr>" for row in found.plans)
    summary = "".join(f"<li>{escape(line)}</li>" for line in summary_lines(found))
    title = f"robust batch {found.verb}"
    body = f"""<header><h1>{escape(title)}</h1><p>{escape(found.suite)}</p></header>
<ul>{summary}</ul>
<table class="sorted"><thead><tr>{headings}</tr></thead>
<tbody>
{rows}
</tbody></table>"""
    return self_contained(title, body, scripts=["batch.js"])


def _cells(found: Batch, row: BatchRow) -> list[Cell]:
    one = row.instance
    cells = [Cell(one.name, more=[one.domain, one.problem, one.plan])]
    for asked in found.asked:
        cells += _answer(row.runs.get(asked.name))
    if found.verb == "compare":
        cells += [_share(row.volume_ratio), _share(row.width_ratio)]
    return cells


def _share(share: Fraction | None) -> Cell:
    return _NOTHING if share is None else Cell(ratio(share), float(share), [str(share)], "number")


def _answer(run: PlanRun | None) -> list[Cell]:
    if run is None:
        return [_NOTHING] * 3
    lines = answer_lines(run)
    said = Cell(lines[0], more=lines) if len(lines) > 1 else Cell("".join(lines))
    kind = _COLOURS.get(colour_of(run.status), "open")
    return [Cell(run.status, kind=kind), Cell(f"{run.seconds:.2f}", run.seconds, kind="number"), said]
