"""What all pictures share: colours and what they mean, texts, and how a figure becomes an SVG, PNG or PDF file.

Colours are those of Okabe and Ito: distinguishable without colour vision, and in grey. Nothing is distinguished by
colour alone: lines differ in width and dashes, areas in hatching.
"""

from __future__ import annotations

import json
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.options.declare import place_of
from robust.records import atomic_write

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VERMILION, BLUE, GREEN, PURPLE, ORANGE, SKY, BLACK = STRONG = (
    "#D55E00",
    "#0072B2",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#000000",
)
LIGHT = ("#A6D8F5", "#F7CE7B", "#9FDCC6", "#E8B9D3", "#F5EE9B", "#F2AE7E", "#A8C8E8")
"""For areas: black text is readable on them."""
DARK_GREY, GREY, SHADE, PALE = "0.25", "0.45", "0.72", "0.93"
GRID = "0.9"

VALID, EDGE, REMOVED = LIGHT[0], BLUE, VERMILION
"""Where a plan is valid, what bounds that, and what is cut out of it but too thin to be seen."""
BOX_LINES: tuple[Mapping[str, Any], ...] = (
    {"color": ORANGE, "linewidth": 6.0},
    {"color": GREEN, "linewidth": 3.4, "dashes": (3, 1.6)},
    {"color": PURPLE, "linewidth": 2.2},
    {"color": BLACK, "linewidth": 1.3, "dashes": (1.5, 2)},
    {"color": SKY, "linewidth": 1.0},
)
"""Outlines of boxes over one another: each is narrower than those before it, so that all are seen."""
HATCHES = ("", "///", "\\\\\\", "xx", "--", "||", "++", "..")
"""Of areas and bars, beside their colours."""
NOMINAL: Mapping[str, Any] = {
    "marker": "D", "markersize": 6, "color": "white", "markeredgecolor": BLACK, "markeredgewidth": 1.3, "linestyle": ""
}  # fmt: skip
"""The mark of nominal values."""


def save(
    draw: Callable[[], Figure],
    path: str | os.PathLike[str] | None,
    *,
    longest: float | None = None,
    script: Callable[[], str] | None = None,
) -> Figure:
    """Draw a figure and write it; the suffix of the file names the format, and equal figures make equal files.

    Args:
        draw: makes the figure.
        path: the file; None: it is only returned.
        longest: pixels of a side, beyond which resolution is reduced.
        script: makes what an SVG runs in a browser.

    Raises:
        InputError: if the file cannot be written, or its suffix names no format.
    """
    import matplotlib as mpl  # noqa: PLC0415 - takes half a second

    # Texts stay texts in an SVG; names must not be read as formulas.
    looks: Any = {"svg.fonttype": "none", "svg.hashsalt": "robust", "text.parse_math": False, "hatch.linewidth": 0.4}
    with mpl.rc_context(looks):
        figure = draw()
        if path is None:
            _keep_texts(figure)
            return figure
        dpi = 160.0 if longest is None else min(160.0, longest / max(figure.get_size_inches()))
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(path).suffix.lower())

        def write(beside: Path) -> None:
            figure.savefig(beside, dpi=dpi, metadata=metadata)
            if script is not None and beside.suffix.lower() == ".svg":
                text = beside.read_text(encoding="utf-8")
                running = f"<script><![CDATA[\n{script()}]]></script>\n</svg>"
                beside.write_text(running.join(text.rsplit("</svg>", 1)), encoding="utf-8")

        atomic_write(path, write, place_of("plot"))
    return figure


def _keep_texts(figure: Figure) -> None:
    """Keep names from being read as formulas when the figure is drawn later, and let notebooks show it."""
    from matplotlib.text import Text  # noqa: PLC0415 - as above

    for text in figure.findobj(Text):
        text.set_parse_math(False)
    if "IPython" in sys.modules:
        import_module("matplotlib.pyplot")  # which tells IPython


Spans = list[tuple[float, float]]


def free_row(rows: list[Spans], left: float, right: float) -> int:
    """Take room in the first row in which nothing overlaps, perhaps a new one; which row that is."""
    fits = (row for row, taken in enumerate(rows) if all(right <= start or end <= left for start, end in taken))
    row = next(fits, len(rows))
    if row == len(rows):
        rows.append([])
    rows[row].append((left, right))
    return row


def without_frame(axes: Axes, sides: Iterable[str] = ("top", "right")) -> None:
    """Leave out sides of the frame, and keep the grid behind what is drawn."""
    for side in sides:
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)


def entries(axes: Iterable[Axes]) -> dict[str, Artist]:
    """What a legend of these axes says, by label: each once."""
    handles: dict[str, Artist] = {}
    for canvas in axes:
        for handle, label in zip(*canvas.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    return handles


def cut(label: str, longest: int = 44) -> str:
    """A text of at most `longest` letters, without its middle: the ends of names distinguish more of them."""
    if len(label) <= longest:
        return label
    tail = (longest - 3) // 2
    return f"{label[: longest - 3 - tail]}...{label[len(label) - tail :]}"


def wrapped(text: str, width: int) -> str:
    """A text in lines of at most `width` letters; words without blanks are broken as well."""
    return "\n".join(line for part in text.split("\n") for line in textwrap.wrap(part, width) or [""])


def box_line(order: int, count: int) -> dict[str, Any]:
    """How the outline of one of several boxes is drawn; a single one need not leave room for others."""
    return {**BOX_LINES[order % len(BOX_LINES)], **({"linewidth": 2.4} if count == 1 else {})}


def hatch_outside(axes: Axes, label: str) -> None:
    """Hatch what nothing else is drawn over."""
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - takes half a second

    looks: Any = {"facecolor": "white", "edgecolor": "0.6", "linewidth": 0, "hatch": "////", "zorder": 0}
    axes.add_patch(Rectangle((0, 0), 1, 1, transform=axes.transAxes, label=label, **looks))


_ESCAPED = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&"}


def part(name: str) -> str:
    """A file of `robust/draw/web`."""
    return files("robust.draw").joinpath("web", name).read_text(encoding="utf-8")


def script_json(data: Any) -> str:
    """JSON that ends no element and begins no comment, wherever the names in it come from."""
    return json.dumps(data, ensure_ascii=True, separators=(",", ":")).translate(_ESCAPED)
