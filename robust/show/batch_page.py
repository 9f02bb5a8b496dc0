"""A table of many plans as one static page: no network, sorted by its headings, readable without scripts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from html import escape
from string import Template

from robust.show.batch import NAMES, STYLES, answer_lines, ratio, summary_lines
from robust.sweeps.batch import Batch, BatchRow, PlanRun


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
    """The page."""
    title = f"robust batch {found.verb}"
    head = ["plan"]
    for one in found.asked:
        before = f"{NAMES[one.name]}: " if found.verb == "compare" else ""
        head += [f"{before}{word}" for word in ("answer", "seconds", "what it says")]
    head += ["volume IRR/CCMMZ", "width IRR/CCMMZ"] if found.verb == "compare" else []
    return _PAGE.substitute(
        title=escape(title),
        suite=escape(found.suite),
        summary="".join(f"<li>{escape(line)}</li>" for line in summary_lines(found)),
        head="".join(f'<th scope="col"><button type="button">{escape(cell)}</button></th>' for cell in head),
        rows="\n".join(f"<tr>{''.join(cell.html for cell in _cells(found, row))}</tr>" for row in found.rows),
    )


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
    kind = _COLOURS.get(STYLES.get(run.status, ""), "open")
    return [Cell(run.status, kind=kind), Cell(f"{run.seconds:.2f}", run.seconds, kind="number"), said]


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>$title</title>
<style>
body { font: 15px/1.45 sans-serif; margin: 1.5em auto; max-width: 90em; padding: 0 1em; color: #111; background: #fff }
.wide { overflow-x: auto }
table { border-collapse: collapse }
th, td { padding: .3em .7em; border-bottom: 1px solid #ccc; text-align: left; vertical-align: top }
th button { font: inherit; font-weight: bold; border: 0; padding: 0; background: none; text-align: left }
th[aria-sort=ascending] button::after { content: " ▲" }
th[aria-sort=descending] button::after { content: " ▼" }
td.number { text-align: right; font-variant-numeric: tabular-nums }
td.good { color: #00674a } td.bad { color: #a33f00; font-weight: bold } td.open { color: #6b5300 }
pre { margin: .3em 0; white-space: pre-wrap; background: #f4f4f4; padding: .4em }
</style>
</head>
<body>
<h1>$title</h1>
<p>$suite</p>
<ul>$summary</ul>
<div class="wide"><table>
<thead><tr>$head</tr></thead>
<tbody>
$rows
</tbody>
</table></div>
<script>
"use strict";
const body = document.querySelector("tbody"), heads = [...document.querySelectorAll("th")];
const key = cell => "order" in cell.dataset ? Number(cell.dataset.order) : cell.textContent;
const compare = (a, b) => typeof a === "number" && typeof b === "number" ? a - b
  : String(a).localeCompare(String(b), "en", {numeric: true});
heads.forEach((head, place) => head.querySelector("button").addEventListener("click", () => {
  const down = head.getAttribute("aria-sort") === "ascending";
  heads.forEach(one => one.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const rows = [...body.rows].sort((a, b) => compare(key(a.cells[place]), key(b.cells[place])));
  body.append(...(down ? rows.reverse() : rows));
}));
</script>
</body>
</html>
""")
