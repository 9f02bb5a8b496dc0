"""What all pictures share: colours, texts, and how a figure becomes an SVG, PNG or PDF file.

Colours are those of Okabe and Ito: distinguishable without colour vision, and in grey.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from robust.files import atomic_write
from robust.options.declare import place_of

if TYPE_CHECKING:
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


def save(draw: Callable[[], Figure], path: str | os.PathLike[str], *, longest: float | None = None) -> None:
    """Draw a figure and write it; the suffix of the file names the format, and equal figures make equal files.

    Args:
        draw: makes the figure.
        path: the file.
        longest: pixels of a side, beyond which resolution is reduced.

    Raises:
        InputError: if the file cannot be written, or its suffix names no format.
    """
    import matplotlib as mpl  # noqa: PLC0415 - takes half a second

    # Texts stay texts in an SVG; names must not be read as formulas.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "robust", "text.parse_math": False}):
        figure = draw()
        dpi = 160.0 if longest is None else min(160.0, longest / max(figure.get_size_inches()))
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(path).suffix.lower())
        atomic_write(path, lambda beside: figure.savefig(beside, dpi=dpi, metadata=metadata), place_of("plot"))


def without_frame(axes: Axes, sides: Iterable[str] = ("top", "right")) -> None:
    """Leave out sides of the frame, and keep the grid behind what is drawn."""
    for side in sides:
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)


def cut(label: str, longest: int = 44) -> str:
    """A text of at most so many letters."""
    return label if len(label) <= longest else f"{label[: longest - 3]}..."
