"""Ctrl-C that cannot get lost.

Python drops an exception that a signal raises while an object is being finalised, and the many formulas of a solver are
finalised by and by. So the signal is noted as well, and whoever polls raises what was lost.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class _Notes:
    noticed = False


@contextmanager
def noticing_interrupts() -> Iterator[None]:
    """Note Ctrl-C within the block; it still raises KeyboardInterrupt at once wherever Python can.

    Does nothing outside of the main thread, and where the program handles the signal in its own way.
    """
    usual = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or usual is not signal.default_int_handler:
        yield
        return
    _Notes.noticed = False
    signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        _Notes.noticed = False
        signal.signal(signal.SIGINT, usual)


def _note(number: int, frame: FrameType | None) -> None:
    _Notes.noticed = True
    signal.default_int_handler(number, frame)


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed in the block of :func:`noticing_interrupts` that is running."""
    if _Notes.noticed:
        raise KeyboardInterrupt
