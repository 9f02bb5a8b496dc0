"""Output files, written beside and renamed: neither a full disk nor a kill destroys what was there."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from robust.errors import InputError, Location
from robust.numbers import shorten


def atomic_write(
    path: str | os.PathLike[str], content: str | bytes | Callable[[Path], None], place: Location | None
) -> None:
    """Replace a file by a text, by bytes, or by what a function writes to the path that it is given.

    Raises:
        InputError: if it cannot be written, with the place; what was there is still there then.
        OSError: the same without a place.
    """
    target = Path(path)
    if target.exists() and not target.is_file():  # a device, as in `--output /dev/stdout`, or a pipe
        _write(target, content)
        return
    try:
        # The suffix stays: it is what names a format. A link is followed, so that it stays one.
        target = target.resolve()
        descriptor, name = tempfile.mkstemp(target.suffix, f".{target.stem}.", target.parent)
        beside = Path(name)
        try:
            os.close(descriptor)
            _write(beside, content)
            mask = os.umask(0)
            os.umask(mask)
            beside.chmod(target.stat().st_mode & 0o7777 if target.exists() else 0o666 & ~mask)
            beside.replace(target)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:  # a library for pictures says so if a suffix names no format
        if place is None:
            if isinstance(error, OSError):
                error.filename = str(path)  # not the name beside it
            raise
        reason = ((error.strerror if isinstance(error, OSError) else None) or str(error)).lower()
        raise InputError(f"cannot write {shorten(str(path))}: {reason}", place) from None


def _write(path: Path, content: str | bytes | Callable[[Path], None]) -> None:
    if isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        content(path)
