"""Where answers are printed: colours if wanted, tables, and lines that stay readable where there is little room."""

from __future__ import annotations

import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from io import StringIO
from typing import Any, TextIO

from rich import box as borders
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.segment import Segment
from rich.style import Style
from rich.table import Column, Table
from rich.terminal_theme import DEFAULT_TERMINAL_THEME
from rich.text import Text

from robust.errors import exit_code_of

WIDE = 160
"""Columns where the output is no terminal: nothing is to be cut, and lines are to stay readable."""
NARROW = 80
"""Columns below which lines are broken between words; else terminals do that, and copied lines stay whole."""
_MARGIN = 2
_COLORS: Mapping[str, Mapping[str, Any]] = {
    "auto": {},  # where there is a terminal, and as NO_COLOR and FORCE_COLOR say
    "always": {"force_terminal": True, "color_system": "standard", "no_color": False},
    "never": {"color_system": None},
}


def console(stream: TextIO | None = None, color: str = "auto", width: int | None = None) -> Console:
    """Where to print: texts of users are never taken for markup.

    Args:
        stream: standard output, if not given.
        color: `auto`, `always` or `never`.
        width: columns; if not given, those of the terminal or of the variable COLUMNS, else :data:`WIDE`.
    """
    stream = stream or sys.stdout
    if width is None and not stream.isatty() and not os.environ.get("COLUMNS", "").isdigit():
        width = WIDE
    return _Console(file=stream, width=width, markup=False, highlight=False, emoji=False, **_COLORS[color])


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the caller, who knows the exit code; rich would end the process with its own."""
        raise BrokenPipeError

    def _render_buffer(self, buffer: Iterable[Segment]) -> str:
        """Whatever names of files hold: no control characters and nothing that cannot be encoded, but line ends."""
        return super()._render_buffer(
            part if part.control or part.text.isprintable() else Segment(_visible(part.text), part.style)
            for part in buffer
        )

    def print(self, *objects: Any, **how: Any) -> None:
        """As by rich; lines that may be longer than the terminal are broken between words if it is narrow."""
        if how.get("soft_wrap") and not how.get("no_wrap") and self.width < NARROW:
            for one in objects:
                for line in (one if isinstance(one, Text) else Text(str(one))).split("\n", allow_blank=True):
                    self._print_broken(line)
            return
        super().print(*objects, **how)

    def _print_broken(self, line: Text) -> None:
        """A line, what follows in others a little further to the right."""
        indent = len(line.plain) - len(line.plain.lstrip(" "))
        parts = line[indent:].wrap(self, max(self.width - indent - _MARGIN, 10)) if line.plain.strip() else [Text()]
        for index, part in enumerate(parts):
            part.rstrip()
            super().print(Text(" " * (indent + _MARGIN * (index > 0))).append_text(part), soft_wrap=True)


class Page(_Console):
    """Makes a piece of HTML of what is printed: tables, and texts as they are laid out; all of it is escaped."""

    def __init__(self, width: int) -> None:
        super().__init__(file=StringIO(), width=width, markup=False, highlight=False, emoji=False, color_system=None)
        self._blocks: list[str] = []
        self._lines: list[str] = []

    def print(self, *objects: Any, **_how: Any) -> None:
        """Keep lines of text."""
        self._lines.append(" ".join(self._spans(one if isinstance(one, Text) else Text(str(one))) for one in objects))

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
        """Everything that was printed."""
        self._end_text()
        return f'<div class="robust">{"".join(self._blocks)}</div>'

    def _cell(self, cell: object) -> str:
        return self._spans(cell if isinstance(cell, Text) else Text(str(cell))).replace("\n", "<br/>")

    def _spans(self, text: Text) -> str:
        return "".join(self._span(part.text, part.style) for part in text.render(self) if part.text)

    def _span(self, words: str, style: Style | None) -> str:
        look = style.get_html_style(DEFAULT_TERMINAL_THEME) if style else ""
        printable = escape(_visible(words))
        return f'<span style="{escape(look)}">{printable}</span>' if look else printable

    def _end_text(self) -> None:
        """Put the lines since the last table together."""
        found = "\n".join(self._lines).strip("\n")
        self._lines = []
        if found:
            self._blocks.append(f'<pre style="white-space: pre-wrap">{found}</pre>')


def _visible(text: str) -> str:
    return "".join(char if char.isprintable() or char == "\n" else " " for char in text)


# -- tables ------------------------------------------------------------------------------------------------------------


def colour_of(word: str) -> str:
    """The style of a verdict, or of how something ended: green, red where something is refuted, yellow where open."""
    return {0: "green", 1: "bold red"}.get(exit_code_of(word), "yellow")


def table(columns: Sequence[str], rows: Iterable[Sequence[str | Text]] = (), *, right: Iterable[str] = ()) -> Table:
    """A table, with numbers to the right."""
    aligned = set(right)
    found = Table(box=borders.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="bold")
    for column in columns:
        found.add_column(column, justify="right" if column in aligned else "left", overflow="fold")
    for row in rows:
        found.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
    return found


def show_table(out: Console, shown: Table) -> None:
    """Print a table without blanks at the ends of lines; row by row, if not even its words have room side by side."""
    if isinstance(out, Page):
        out.add_table(shown)
        return
    lines = _laid_out(out, shown)
    if not _has_every_word(lines, shown):
        widths = _widths(shown, out.width - _MARGIN - 3 * (len(shown.columns) - 1))
        if widths is None:
            _show_rows(out, shown)
            return
        for column, width in zip(shown.columns, widths, strict=True):
            column.width = width
        lines = _laid_out(out, shown)
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
    found = Counter(Text.from_ansi("\n".join(lines)).plain.split())
    return not Counter(words) - found


def _widths(shown: Table, room: int) -> list[int] | None:
    """Widths at which no word is cut; None if there are none. Long texts get what others leave."""
    sizes = [_sizes(column) for column in shown.columns]
    left = room - sum(least for least, _ in sizes)
    if left < 0:
        return None
    found: list[int] = []
    for least, most in sorted(sizes, key=lambda size: size[1] - size[0]):
        found.append(least + min(most - least, left // (len(sizes) - len(found))))
        left -= found[-1] - least
    order = sorted(range(len(sizes)), key=lambda index: sizes[index][1] - sizes[index][0])
    return [width for _, width in sorted(zip(order, found, strict=True))]


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
