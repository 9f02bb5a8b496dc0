"""Output files, written beside and renamed: neither a full disk nor a kill destroys what was there.

What cannot be written is no reason to lose an answer: commands print it first, and what is written while they compute
(:class:`Folder`) is given up with a warning.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

from robust.errors import InputError, Location, OutputWarning
from robust.numbers import quoted


def atomic_write(
    path: str | os.PathLike[str], content: str | bytes | Callable[[Path], None], place: Location | None
) -> None:
    """Replace a file by a text, by bytes, or by what a function writes to the path that it is given.

    Raises:
        InputError: if it cannot be written, with the place; what was there is still there then.
        OSError: the same without a place.
    """
    try:
        _replace(Path(path), content)
    except (OSError, ValueError) as error:  # a library for pictures says so if a suffix names no format
        if place is None:
            if isinstance(error, OSError):
                error.filename = str(path)  # not the name beside it
            raise
        reason = ((error.strerror if isinstance(error, OSError) else None) or str(error)).lower()
        raise InputError(f"cannot write {quoted(path)}: {reason}", place) from None


def unwritten(error: InputError) -> None:
    """Say that a file was not written, and go on: the command line makes an error of it, Python a warning."""
    warnings.warn(OutputWarning(str(error)), stacklevel=3)


class Folder:
    """A folder for files that are written while something is computed.

    Raises:
        InputError: if it is not there and cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str], what: str) -> None:
        self._path = Path(path)
        self._what = what
        try:
            self._path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self._error(error).message}; expected a directory", Location(str(path))) from None

    def write(self, name: str, text: str) -> Path:
        """Write a file, as far as that is possible; see :func:`unwritten`."""
        path = self._path / name
        try:
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            unwritten(self._error(error))
        return path

    def _error(self, error: OSError) -> InputError:
        reason = (error.strerror or str(error)).lower()
        return InputError(f"cannot write {self._what} there: {reason}", Location(str(self._path)))


def _replace(target: Path, content: str | bytes | Callable[[Path], None]) -> None:
    if target.exists() and not target.is_file():  # a device, as in `--output /dev/stdout`, or a pipe
        _write(target, content)
        return
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


def _write(path: Path, content: str | bytes | Callable[[Path], None]) -> None:
    if isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        content(path)
