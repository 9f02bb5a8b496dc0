"""Lines on a terminal, as rich prints them."""

from collections.abc import Iterable, Mapping
from typing import Any, TextIO

from rich.console import Console
from rich.segment import Segment
from rich.text import Text

_MARGIN = 2


def rich_console(stream: TextIO, width: int | None, narrow: int, colors: Mapping[str, Any]) -> Console:
    """A console of rich that prints what it is given, and no markup."""
    shown = _RichConsole(file=stream, width=width, markup=False, highlight=False, emoji=False, **colors)
    shown.narrow = narrow
    return shown


class _RichConsole(Console):
    narrow = 0
    """Columns below which lines are broken between words."""

    def on_broken_pipe(self) -> None:
        """Leave it to the caller, who knows the exit code; rich would end the process with its own."""
        raise BrokenPipeError

    def _render_buffer(self, buffer: Iterable[Segment]) -> str:
        """Whatever names of files hold: no control characters and nothing that cannot be encoded, but line ends."""
        return super()._render_buffer(
            part if part.control or part.text.isprintable() else Segment(visible(part.text), part.style)
            for part in buffer
        )

    def print(self, *objects: Any, **how: Any) -> None:
        """Print as rich does; on a narrow terminal, lines that may be longer than it are broken between words."""
        if how.get("soft_wrap") and not how.get("no_wrap") and self.width < self.narrow:
            for renderable in objects:
                for line in rich_text(renderable).split("\n", allow_blank=True):
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


def rich_text(shown: object) -> Text:
    """An object to be shown, as a text of rich."""
    if hasattr(shown, "__rich__"):
        shown = shown.__rich__()
    return shown if isinstance(shown, Text) else Text(str(shown))


def visible(text: str) -> str:
    """The text, with spaces for what a terminal would not show as it is."""
    return "".join(char if char.isprintable() or char == "\n" else " " for char in text)
