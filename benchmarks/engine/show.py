"""Tables for a terminal and as Markdown, and one style for all figures. What draws is loaded when it is asked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from robust.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.table import Table as RichTable

NOTHING = "–"
WIDTH = 120
Cells = tuple[str, ...]


def number(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where there is none; large ones without decimals."""
    if value is None:
        return NOTHING
    return f"{value:.0f}" if digits == 0 or abs(value) >= 1000 else f"{value:.{digits}f}"


def count(value: int | None) -> str:
    return NOTHING if value is None else str(value)


def quantile(values: Sequence[float], share: float) -> float | None:
    """The least of the ascending values that at least that share of them does not exceed."""
    needed = ceil(Fraction(share).limit_denominator(1000) * len(values))
    return values[max(needed, 1) - 1] if values else None


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes:
        rows: None is a line between others.
        notes: what stands below it.
        align: `<` or `>` for each column, the last one for all further ones.
        whole: whether the first column is never broken, however narrow the terminal.
        styles: colours of the last column, by row.
    """

    title: str
    headings: Cells
    rows: Sequence[Cells | None]
    notes: Sequence[str] = ()
    align: str = "<>"
    whole: bool = True
    header: bool = True
    styles: Sequence[str] = field(default=())

    def rich(self) -> RichTable:
        """For a terminal."""
        from rich.markup import escape  # noqa: PLC0415
        from rich.table import Table as RichTable  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        table = RichTable(
            title=escape(self.title), title_justify="left", caption_justify="left", show_header=self.header
        )
        if self.notes:
            table.caption = escape("\n".join(self.notes))
        for place, heading in enumerate(self.headings):
            side = self.align[min(place, len(self.align) - 1)]
            table.add_column(
                escape(heading),
                justify="left" if side == "<" else "right",
                overflow="fold",
                no_wrap=self.whole and place == 0,
            )
        for place, row in enumerate(self.rows):
            if row is None:
                table.add_section()
            elif self.styles:
                table.add_row(*map(escape, row[:-1]), Text(row[-1], style=self.styles[place]))
            else:
                table.add_row(*map(escape, row))
        return table

    def markdown(self) -> str:
        """Headings and rows, without title and notes."""
        return markdown(self.headings, (row for row in self.rows if row is not None))


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    lines = (headings, ["---"] * len(headings), *rows)
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in lines)


def page(*blocks: str) -> str:
    """Headings, paragraphs, lists and tables as Markdown; paragraphs are wrapped, lists are one string a list."""
    return "\n\n".join(block if block[:1] in {"#", "|", "-"} else paragraph(block) for block in blocks)


def paragraph(text: str) -> str:
    return fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def bullets(items: Iterable[str]) -> str:
    """A list."""
    return "\n".join(
        fill(item, WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False) for item in items
    )


# -- figures -----------------------------------------------------------------------------------------------------------

# Distinguishable also without colour vision (Okabe and Ito, with a few more).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F", "#882255", "#7F3C00")
BLUE, ORANGE, GREEN, PINK, AMBER, SKY, GREY, WINE, BROWN = COLOURS
BLACK = "#000000"
STYLES: dict[str, tuple[str, str, str]] = {
    "irr": (BLUE, "-", "o"),
    "irr-first": (BLUE, ":", "."),
    "widen": (ORANGE, "-", "s"),
    "optimal": (PINK, "-", "D"),
    "project": (GREEN, "-", "^"),
    "z3": (WINE, "-", "v"),
    "cvc5": (SKY, "-", "<"),
    "fourier-motzkin": (BROWN, "-", ">"),
    "loos-weispfenning": (AMBER, "-", "P"),
    "relational": (BLUE, "-", "o"),
    "positions": (ORANGE, "-", "s"),
    "recorded-irr": (BLACK, "--", "o"),
    "recorded-irr-first": (BLACK, ":", "."),
    "recorded-ccmmz": (GREY, "--", "x"),
}
"""Colour, line and marker of each method; ours are solid, the recorded ones dashed or dotted."""
OTHER = (GREY, "-", "o")
SHORTEST = 0.005
"""A time of 0 was rounded, and has no place on a logarithmic axis."""


@contextmanager
def canvas(path: Path, width: float, height: float, panels: int = 1) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure with panels side by side, which is written to the path at the end; the suffix decides the format.

    Raises:
        InputError: if it cannot be written.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(figure.subplots(1, panels, sharey=True, squeeze=False)[0])
    for one in axes:
        one.grid(color="0.92")
        one.set_axisbelow(True)
    yield figure, axes
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise InputError(f"cannot write the plot {str(path)!r}: {(error.strerror or str(error)).lower()}") from None


def seconds_axis(axes: Axes, axis: str = "y") -> None:
    """A logarithmic axis of seconds, and one of whole numbers across it."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter  # noqa: PLC0415

    across = axes.xaxis if axis == "y" else axes.yaxis
    (axes.set_yscale if axis == "y" else axes.set_xscale)("log")
    along = axes.yaxis if axis == "y" else axes.xaxis
    along.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} s"))
    along.set_minor_formatter(NullFormatter())
    across.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def legend_below(figure: Figure, panels: Iterable[Axes], columns: int = 3) -> None:
    """One legend below all panels, with every label once."""
    legends = [axes.get_legend_handles_labels() for axes in panels]
    handles = {label: handle for found in legends for handle, label in zip(*found, strict=True)}
    if handles:
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns, fontsize=8)
