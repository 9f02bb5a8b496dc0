"""Output of a command: answers on stdout; notes on the input and progress on stderr.

The reader of stdout may leave at any time, as in `robust ... | head`, and a disk may be full. Work goes on then, so
that files are written, and the exit code says at the end that the answer has not arrived. Nothing follows the work
where stderr is no terminal.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, InputWarning, OutputWarning
from robust.numbers import one_line

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.live import Live
    from rich.table import Table

    from robust.irr.search import Step
    from robust.probability.measure import Bounds
    from robust.qe.box import Side


READER_LEFT = 141
"""The exit code where the reader of stdout has left: that of a process that SIGPIPE ends."""


class _Stdout:
    failure: OSError | None = None


@contextmanager
def answering() -> Iterator[None]:
    """Within it, output that cannot be written is dropped, which :func:`output_failure` remembers."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        if error.filename is not None:  # of some file
            raise
        drop_output(error)


def drop_output(error: OSError) -> None:
    """Send what is still written to stdout nowhere."""
    _Stdout.failure = _Stdout.failure or error
    _send_nowhere(1 if sys.stdout is None else sys.stdout.fileno())


def output_failure() -> OSError | None:
    """The reason why stdout could not be written since the last call; buffered output is written now."""
    with answering():
        pass
    failure, _Stdout.failure = _Stdout.failure, None
    return failure


def _send_nowhere(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def print_json(answer: Mapping[str, Any]) -> None:
    """Print one object, as an answer; halves of characters, which names of files may hold, are question marks."""
    with answering():
        print(json.dumps(_whole(answer), indent=2))


def _whole(value: Any) -> Any:
    match value:
        case str():
            return value.encode("utf-8", "replace").decode("utf-8")
        case Mapping():
            return {_whole(key): _whole(item) for key, item in value.items()}
        case list() | tuple():
            return [_whole(item) for item in value]
    return value


# -- what is to be said of the input -----------------------------------------------------------------------------------


def complain(message: str) -> None:
    """One line on stderr, whatever file names and input texts contain; nothing where it cannot be written."""
    try:
        print(f"robust: {one_line(message)}", file=sys.stderr, flush=True)
    except OSError:
        _send_nowhere(sys.stderr.fileno())


@contextmanager
def noting_warnings(unwritten: Callable[[InputError], None], *, shown: bool) -> Iterator[None]:
    """Within it, each different :class:`InputWarning` is one line on stderr, or nothing if they are not to be shown;
    files that could not be written are told to `unwritten`."""
    said: set[str] = set()
    with warnings.catch_warnings():
        for kind in (InputWarning, OutputWarning):
            warnings.simplefilter("always", kind)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            text = str(message)
            if issubclass(category, OutputWarning):
                if text not in said:
                    said.add(text)
                    unwritten(InputError(text))
            elif not issubclass(category, InputWarning):
                usual(message, category, *place, **more)
            elif shown and text not in said:
                said.add(text)
                complain(f"warning: {text}")

        warnings.showwarning = show
        yield


# -- progress ----------------------------------------------------------------------------------------------------------

_ROWS = 12
"""Parameters shown at most: the display must fit on a screen."""


class Display:
    """A few lines that follow the work and disappear at its end."""

    def __init__(self, *, shown: bool, what: str, color: str = "auto") -> None:
        self.is_shown = shown and sys.stderr is not None and sys.stderr.isatty()
        self._started = time.monotonic()
        self._what = what
        self._color = color
        self._step: Step | None = None
        self._live: Live | None = None

    def start(self) -> None:
        """Show it, if there is a terminal to show it on."""
        if not self.is_shown:
            return
        from rich.live import Live

        from robust.show.console import console

        out = console(sys.stderr, self._color).rich
        self._live = Live(get_renderable=self._render, console=out, transient=True, refresh_per_second=8)
        self._live.start()

    def stop(self) -> None:
        """Leave the terminal as it was."""
        live, self._live = self._live, None
        if live is not None:
            live.stop()

    def say(self, what: str) -> None:
        self._what = what

    def obligation(self, done: int, total: int, name: str) -> None:
        """For `robust.check`."""
        self._what = f"obligation {done + 1} of {total}: {name}"

    def batch(self, done: int, total: int, line: str) -> None:
        """For benchmarks: one line for each run stays, the display shows how many there were."""
        self._what = f"{done} of {total} done"
        if self._live is not None:
            self._live.console.print(line)

    def bounds(self, bounds: Bounds) -> None:
        """For `robust.risk`."""
        from robust.show.documents import bounds_text

        self._what = f"probability of success: {bounds_text(bounds, 4)}"

    def step(self, step: Step) -> None:
        """For `robust.envelope`."""
        self._step = step

    def _render(self) -> RenderableType:
        from rich.console import Group
        from rich.text import Text

        from robust.numbers import duration, plural

        elapsed = duration(time.monotonic() - self._started)
        if self._step is None:
            return Text(f"{self._what} ... {elapsed}", style="dim", no_wrap=True, overflow="ellipsis")
        step = self._step
        line = f"{plural(step.check, 'check')}, {elapsed}"
        if step.parameter is not None and step.side is not None:
            line += f"; last: {step.parameter} {step.side.value} {'grown' if step.accepted else 'blocked'}"
        return Group(_box(step), Text(f"{line}; Ctrl-C keeps this box", style="dim", no_wrap=True, overflow="ellipsis"))


def _box(step: Step) -> Table:
    """The best box so far; the parameter tried last, with its Δ, is marked."""
    from rich.table import Table
    from rich.text import Text

    from robust.qe.box import interval_text

    table = Table(box=None, pad_edge=False, show_header=False)
    for name, interval in list(step.box.intervals.items())[:_ROWS]:
        tried = name == step.parameter
        table.add_row(
            Text(name, style="bold" if tried else ""),
            Text(interval_text(interval)),
            Text(_delta(step.delta, step.side) if tried else "", style="dim"),
        )
    if len(step.box.intervals) > _ROWS:
        table.add_row(Text(f"and {len(step.box.intervals) - _ROWS} more", style="dim"))
    return table


def _delta(delta: Fraction | None, side: Side | None) -> str:
    if delta is None or side is None:
        return ""
    from robust.numbers import readable
    from robust.qe.box import Side

    return f"Δ = {readable(delta)} {'↑' if side is Side.UPPER else '↓'}"
