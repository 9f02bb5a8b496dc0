"""Tables for a terminal and as Markdown, and one way to draw all figures. What draws is loaded when it is asked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from math import ceil
from pathlib import Path
from statistics import median
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

from robust.draw.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from robust.options.declare import place_of
from robust.records import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.console import RenderableType

NOTHING = "–"
WIDTH = 120
Cells = tuple[str, ...]
Group = TypeVar("Group")
Name = TypeVar("Name")
Columns = Mapping[str, Callable[[Group], object]]
"""Headings, and what stands below them: a function of whatever a row is about."""


def family(form: str, names: Iterable[Name], value: Callable[[Name, Group], object]) -> Columns[Group]:
    """A column for each name, `value` of which and of whatever a row is about is in it; headings are of that form."""
    return {form.format(name): partial(value, name) for name in names}


def number(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where there is none; large ones without decimals."""
    if value is None:
        return NOTHING
    return f"{value:.0f}" if digits == 0 or abs(value) >= 1000 else f"{value:.{digits}f}"


def cell(value: object) -> str:
    """What a table shows: a dash for nothing, two decimals of a float."""
    return number(value) if value is None or isinstance(value, float) else str(value)


def middle(values: Iterable[float]) -> float | None:
    """The median, None without values."""
    known = list(values)
    return median(known) if known else None


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
        left: headings of what is aligned to the left, the first one if None; all else is to the right.
        whole: whether the first column is never broken, however narrow the terminal.
        styles: colours of the last column, by row.
    """

    title: str
    headings: Cells
    rows: Sequence[Cells | None]
    notes: Sequence[str] = ()
    left: Cells | None = None
    whole: bool = True
    header: bool = True
    styles: Sequence[str] = field(default=())

    @staticmethod
    def of(title: str, columns: Columns[Group], groups: Iterable[Group | None], *notes: str, **look: Any) -> Table:
        """A row for each group; None is a line."""
        rows = [None if one is None else tuple(cell(value(one)) for value in columns.values()) for one in groups]
        return Table(title, tuple(columns), rows, notes, **look)

    def rich(self) -> RenderableType:
        """For a terminal; title and notes may be wider than the table."""
        from rich.console import Group as Together  # noqa: PLC0415
        from rich.markup import escape  # noqa: PLC0415
        from rich.table import Table as RichTable  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        table = RichTable(show_header=self.header)
        left = self.headings[:1] if self.left is None else self.left
        for place, heading in enumerate(self.headings):
            table.add_column(
                escape(heading),
                justify="left" if heading in left else "right",
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
        title = [Text(self.title, style="bold")] if self.title else []
        return Together(*title, table, *map(Text, self.notes))

    @property
    def markdown(self) -> str:
        """Headings and rows, without title and notes."""
        lines = (self.headings, ["---"] * len(self.headings), *(row for row in self.rows if row is not None))
        texts = ([one.replace("|", "\\|").replace("\n", "; ") for one in cells] for cells in lines)
        return "\n".join("| " + " | ".join(cells) + " |" for cells in texts)


def page(*blocks: str) -> str:
    """Headings, paragraphs, lists and tables as Markdown; paragraphs are wrapped, lists are one string a list."""
    wrapped = partial(fill, width=WIDTH, break_long_words=False, break_on_hyphens=False)
    return "\n\n".join(block if block[:1] in {"#", "|", "-"} else wrapped(block) for block in blocks if block)


def bullets(items: Iterable[str]) -> str:
    """A list."""
    return "\n".join(
        fill(item, WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False) for item in items
    )


# -- figures -----------------------------------------------------------------------------------------------------------

# Distinguishable also without colour vision (Okabe and Ito, with a few more).
MIDDLE_GREY, WINE, BROWN = "#7F7F7F", "#882255", "#7F3C00"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, MIDDLE_GREY, WINE, BROWN)
STYLES: dict[str, tuple[str, str, str]] = {
    "irr": (BLUE, "-", "o"),
    "irr-first": (BLUE, ":", "."),
    "widen": (VERMILION, "-", "s"),
    "optimal": (PURPLE, "-", "D"),
    "project": (GREEN, "-", "^"),
    "z3": (WINE, "-", "v"),
    "cvc5": (SKY, "-", "<"),
    "fourier-motzkin": (BROWN, "-", ">"),
    "loos-weispfenning": (ORANGE, "-", "P"),
    "relational": (BLUE, "-", "o"),
    "positions": (VERMILION, "-", "s"),
    "recorded-irr": (BLACK, "--", "o"),
    "recorded-irr-first": (BLACK, ":", "."),
    "recorded-ccmmz": (MIDDLE_GREY, "--", "x"),
}
"""Colour, line and marker of each method; ours are solid, the recorded ones dashed or dotted."""
OTHER = (MIDDLE_GREY, "-", "o")
SHORTEST = 0.005
"""A time of 0 was rounded, and has no place on a logarithmic axis."""
Point = tuple[float, float]


@dataclass(frozen=True)
class Series:
    """Points of one colour, joined by a line or marked, or both; `steps` go up at each point.

    `shades` are numbers that colour each point instead, on a logarithmic scale; `numbers` stand above the points;
    `look` is more for matplotlib.
    """

    points: Sequence[Point]
    label: str | None = None
    colour: str = BLACK
    line: str = ""
    marker: str = ""
    size: float = 5
    steps: bool = False
    shades: Sequence[float] = ()
    numbers: Sequence[str] = ()
    look: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Panel:
    """One of the diagrams side by side, all of which have the same vertical axis.

    `seconds` names an axis of times, `log` others that are logarithmic; `units` formats the numbers along an axis;
    `axes` is more for matplotlib.
    """

    title: str
    series: Sequence[Series]
    x: str
    y: str
    seconds: str = ""
    log: str = ""
    units: Mapping[str, Callable[[float], str]] = field(default_factory=dict)
    axes: Mapping[str, Any] = field(default_factory=dict)


def draw(path: Path, panels: Sequence[Panel], width: float, height: float, *, legend: str = "best") -> None:
    """Write panels of that size, in inches, to the path; its suffix decides the format.

    Args:
        legend: where it is in the first panel, or `below` all, with every label of theirs once.

    Raises:
        InputError: if it cannot be written.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(max(5.5, width * len(panels)), height), layout="constrained")
    fields: list[Axes] = list(figure.subplots(1, len(panels), sharey=True, squeeze=False)[0])
    for axes, panel in zip(fields, panels, strict=True):
        _fill(axes, panel)
    fields[0].set_ylabel(panels[0].y)
    legends = [axes.get_legend_handles_labels() for axes in (fields if legend == "below" else fields[:1])]
    handles = {label: handle for found in legends for handle, label in zip(*found, strict=True)}
    columns = 3 if width * len(panels) > 8 else 2
    look: dict[str, Any] = {"loc": "outside lower center", "ncols": columns} if legend == "below" else {"loc": legend}
    if handles:
        where = figure if legend == "below" else fields[0]
        where.legend(list(handles.values()), list(handles), fontsize=8, framealpha=1, **look)
    atomic_write(path, lambda beside: figure.savefig(beside, dpi=150), place_of("plot"))


def _fill(axes: Axes, panel: Panel) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter  # noqa: PLC0415

    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    for one in panel.series:
        _plot(axes, one)
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        if name in panel.seconds + panel.log:
            (axes.set_xscale if name == "x" else axes.set_yscale)("log")
        elif panel.seconds:
            axis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        if name in panel.seconds:
            least, most = sorted(axis.get_view_interval())
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} s"))
            axis.set_minor_formatter(axis.get_major_formatter() if most < 10 * least else NullFormatter())
        if name in panel.units:
            axis.set_major_formatter(FuncFormatter(lambda value, _, text=panel.units[name]: text(value)))
    axes.set_title(panel.title, fontsize=9, loc="left")
    axes.set(xlabel=panel.x, **panel.axes)


def _plot(axes: Axes, one: Series) -> None:
    if not one.points:
        axes.plot([], [], one.marker + one.line, color=one.colour, label=one.label)
        return
    xs, ys = [x for x, _ in one.points], [y for _, y in one.points]
    if one.shades:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        dots = axes.scatter(xs, ys, c=one.shades, norm=LogNorm(), s=one.size, cmap="viridis")
        axes.figure.colorbar(dots, ax=axes, label=one.label)
        return
    look: dict[str, Any] = {"linestyle": one.line or "none", "marker": one.marker or "none", "markersize": one.size}
    drawstyle = "steps-post" if one.steps else "default"
    axes.plot(xs, ys, color=one.colour, label=one.label, drawstyle=drawstyle, **look, **one.look)
    for place, text in zip(one.points, one.numbers, strict=False):
        axes.annotate(text, place, (0, 6), textcoords="offset points", ha="center", fontsize=7)
