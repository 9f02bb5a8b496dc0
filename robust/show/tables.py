"""Output that needs rich: tables, and pages for notebooks."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from io import StringIO
from typing import Any

from rich import box as borders
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.style import Style
from rich.table import Column, Table
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from rich.text import Text

from robust.show.console import Console as Out
from robust.show.console import Text as Line
from robust.show.terminal import rich_text, visible

_MARGIN = 2


class Page(Out):
    """Makes a piece of HTML of what is printed: tables, and texts as they are laid out; all of it is escaped."""

    def __init__(self, width: int) -> None:
        super().__init__(StringIO(), "never", width)
        self._blocks: list[str] = []
        self._lines: list[str] = []

    def print(self, *objects: Any, **_how: Any) -> None:
        """Keep lines of text."""
        self._lines.append(" ".join(self._spans(rich_text(renderable)) for renderable in objects))

    def add_table(self, shown: Table) -> None:
        """Keep a table."""
        self._end_text()
        looks = [f'style="text-align: {column.justify}; padding: 0.15em 1.2em 0.15em 0"' for column in shown.columns]
        head = [
            f"<th {look}>{escape(_plain(column.header))}</th>"
            for look, column in zip(looks, shown.columns, strict=True)
        ]
        rows = [
            "".join(f"<td {look}>{self._cell(cell)}</td>" for look, cell in zip(looks, row, strict=True))
            for row in zip(*(column.cells for column in shown.columns), strict=True)
        ]
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        self._blocks.append(f"<table><thead><tr>{''.join(head)}</tr></thead><tbody>{body}</tbody></table>")

    def html(self) -> str:
        """All printed lines as HTML."""
        self._end_text()
        return f'<div class="robust">{"".join(self._blocks)}</div>'

    def _cell(self, cell: object) -> str:
        return self._spans(rich_text(cell)).replace("\n", "<br/>")

    def _spans(self, text: Text) -> str:
        return "".join(self._span(part.text, part.style) for part in text.render(self.rich) if part.text)

    def _span(self, words: str, style: Style | None) -> str:
        look = style.get_html_style(DEFAULT_TERMINAL_THEME) if style else ""
        printable = escape(visible(words))
        return f'<span style="{escape(look)}">{printable}</span>' if look else printable

    def _end_text(self) -> None:
        """Put the lines since the last table together."""
        lines = "\n".join(self._lines).strip("\n")
        self._lines = []
        if lines:
            self._blocks.append(f'<pre style="white-space: pre-wrap">{lines}</pre>')


# -- tables ------------------------------------------------------------------------------------------------------------


def table(columns: Sequence[str], rows: Iterable[Sequence[str | Line]] = (), *, right: Iterable[str] = ()) -> Table:
    """A table, with numbers to the right."""
    aligned = set(right)
    shown = Table(box=borders.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="bold")
    for column in columns:
        numeric = column in aligned
        shown.add_column(column, justify="right" if numeric else "left", overflow="fold", no_wrap=numeric)
    for row in rows:
        shown.add_row(*map(rich_text, row))
    return shown


def show_table(out: Out, shown: Table) -> None:
    """Print a table without blanks at the ends of lines; row by row, if not even its words have room side by side."""
    if isinstance(out, Page):
        out.add_table(shown)
        return
    lines = _laid_out(out.rich, shown)
    if not _has_every_word(lines, shown):
        widths = _widths(shown, out.width - _MARGIN - 3 * (len(shown.columns) - 1))
        if widths is None:
            _show_rows(out.rich, shown)
            return
        for column, width in zip(shown.columns, widths, strict=True):
            column.width, column.no_wrap = width, False
        lines = _laid_out(out.rich, shown)
    for line in lines:
        out.file.write(f"{line}\n")
    out.file.flush()


def _laid_out(out: Console, shown: Table) -> list[str]:
    """The lines of a table."""
    with out.capture() as capture:
        out.print(Padding(shown, (0, 0, 0, _MARGIN), expand=False))
    return [line.rstrip() for line in capture.get().splitlines()]


def _has_every_word(lines: Sequence[str], shown: Table) -> bool:
    """Whether no word was broken; one may stand in a line that is styled."""
    words = " ".join(_plain(cell) for column in shown.columns for cell in (column.header, *column.cells)).split()
    return not Counter(words) - Counter(Text.from_ansi("\n".join(lines)).plain.split())


def _widths(shown: Table, room: int) -> list[int] | None:
    """Widths at which no word is cut; None if there are none. Long texts get what others leave."""
    sizes = [_sizes(column) for column in shown.columns]
    rest = room - sum(least for least, _ in sizes)
    if rest < 0:
        return None
    widths = [0] * len(sizes)
    order = sorted(range(len(sizes)), key=lambda index: sizes[index][1] - sizes[index][0])
    for done, index in enumerate(order):
        least, most = sizes[index]
        widths[index] = least + min(most - least, rest // (len(sizes) - done))
        rest -= widths[index] - least
    return widths


def _sizes(column: Column) -> tuple[int, int]:
    """The lengths of the longest word, with blanks that a line begins with, and of the longest line."""
    lines = [line for cell in (column.header, *column.cells) for line in _plain(cell).split("\n")]
    words = (cell_len(word) for line in lines for word in re.findall(r"^\s*\S+|\S+", line))
    return max(words, default=0), max(map(cell_len, lines), default=0)


def _plain(cell: object) -> str:
    return cell.plain if isinstance(cell, Text) else str(cell)


def _show_rows(out: Console, shown: Table) -> None:
    """Each row as lines of a column's name and its value, the first one further to the left."""
    for row in zip(*(column.cells for column in shown.columns), strict=True):
        for index, (column, cell) in enumerate(zip(shown.columns, row, strict=True)):
            if value := ", ".join(_plain(cell).split("\n")):
                style = cell.style if isinstance(cell, Text) else ""
                indent = " " * (_MARGIN if index == 0 else 2 * _MARGIN)
                out.print(Text.assemble(indent, (f"{column.header}: ", "bold"), (value, style)), soft_wrap=True)
