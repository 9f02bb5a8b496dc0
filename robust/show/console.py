"""Consoles for answers: styled lines on a terminal, plain text elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from functools import cached_property, singledispatch
from typing import TYPE_CHECKING, Any, TextIO

from robust.errors import exit_code_of

if TYPE_CHECKING:
    from rich.console import Console as RichConsole
    from rich.text import Text as RichText

WIDE = 160
"""Columns where the output is no terminal: nothing is to be cut, and lines are to stay readable."""
NARROW = 80
"""Columns below which lines are broken between words; else terminals do that, and copied lines stay whole."""
_COLORS: Mapping[str, Mapping[str, Any]] = {
    "auto": {},  # where there is a terminal, and as NO_COLOR and FORCE_COLOR say
    "always": {"force_terminal": True, "color_system": "standard", "no_color": False},
    "never": {"color_system": None},
}
_FORCING = ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE")
"""Variables with which rich takes any output for a terminal."""


class Text:
    """Words with styles, as rich's texts are; rich is not loaded before it has to show them."""

    __slots__ = ("parts", "style")

    def __init__(self, text: str = "", style: str = "") -> None:
        self.style = style
        """Of all words, also of those that are appended."""
        self.parts = [(text, "")]

    @staticmethod
    def assemble(*parts: str | tuple[str, str]) -> Text:
        """A text of parts, of which some have a style."""
        text = Text()
        text.parts = [(part, "") if isinstance(part, str) else part for part in parts]
        return text

    def append(self, text: str, style: str = "") -> None:
        """Add words at the end."""
        self.parts.append((text, style))

    @property
    def plain(self) -> str:
        return "".join(text for text, _ in self.parts)

    def __rich__(self) -> RichText:
        from rich.text import Text as RichText  # noqa: PLC0415 - only where there are styles to show

        return RichText.assemble(*self.parts, style=self.style)


class Console:
    """Prints lines to a stream; what is more than plain lines is left to rich.

    Args:
        stream: where to print.
        color: `auto`, `always` or `never`.
        width: columns; if not given, those of the terminal or of the variable COLUMNS, else :data:`WIDE`.
    """

    def __init__(self, stream: TextIO, color: str = "auto", width: int | None = None) -> None:
        self.file = stream
        self._color = color
        columns = os.environ.get("COLUMNS", "")
        if width is None and not stream.isatty():
            width = int(columns) if columns.isdigit() else WIDE
        self._width = width
        forced = color == "always" or any(name in os.environ for name in _FORCING)
        self._plain = width is not None and width >= NARROW and not stream.isatty() and not forced

    @cached_property
    def rich(self) -> RichConsole:
        """The corresponding console of rich."""
        from robust.show.terminal import rich_console  # noqa: PLC0415 - rich takes longer to load than most checks

        return rich_console(self.file, self._width, NARROW, _COLORS[self._color])

    @property
    def width(self) -> int:
        return self._width or self.rich.width

    def print(self, *objects: Any, **how: Any) -> None:
        """Print texts in one line, or what rich can show."""
        if self._plain and len(objects) < 2 and isinstance(text := objects[0] if objects else "", str | Text):
            line = text if isinstance(text, str) else text.plain
            fits = how.get("soft_wrap") or len(line) <= self.width
            if fits and not how.get("markup") and all(part.isprintable() for part in line.split("\n")):
                self.file.write(f"{line}\n")
                self.file.flush()
                return
        self.rich.print(*objects, **how)

    def line(self, text: str | Text, style: str = "") -> None:
        """Print a line, however long it is."""
        self.print(Text(text, style) if style and isinstance(text, str) else text, soft_wrap=True)

    def lines(self, texts: Iterable[str | Text], style: str = "") -> None:
        """Print lines, however long they are."""
        for text in texts:
            self.line(text, style)


def console(stream: TextIO | None = None, color: str = "auto", width: int | None = None) -> Console:
    """A console for a stream, by default standard output; text of users is never taken for markup."""
    return Console(stream or sys.stdout, color, width)


def colour_of(word: str) -> str:
    """The style of a verdict, or of how something ended: green, red where something is refuted, yellow where open."""
    return {0: "green", 1: "bold red"}.get(exit_code_of(word), "yellow")


@singledispatch
def printing(result: object) -> Any:
    """Print a result to a console, `quiet` or not: `printing.dispatch(type(result))(out, result, quiet=quiet)`."""
    raise TypeError(f"found {type(result).__name__}, expected a result that can be printed")
