"""Read input files; whatever can go wrong with a file is an error that names it."""

from __future__ import annotations

import os
from pathlib import Path

from robust.errors import InputError, Location, did_you_mean


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of an input file: UTF-8 with or without a byte order mark, any line ends.

    Raises:
        InputError: if the file cannot be read or is no text.
    """
    return _decode(read_bytes(path), Location(os.fspath(path)))


def read_bytes(path: str | os.PathLike[str], expected: str = "a readable text file") -> bytes:
    """What an input file holds.

    Raises:
        InputError: if it cannot be read; the message says that it is `expected`.
    """
    where = Location(os.fspath(path))
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"found no such file, expected {expected}{_similar(Path(path))}", where) from None
    except IsADirectoryError:
        raise InputError(f"found a directory, expected {expected}", where) from None
    except PermissionError:
        raise InputError(f"found a file that you may not read, expected {expected}", where) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read ({reason.lower()}), expected {expected}", where) from None


def _decode(data: bytes, where: Location) -> str:
    if b"\0" in data:
        raise InputError("found binary data, expected a UTF-8 text file", where)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        message = f"found byte 0x{data[error.start]:02x} in line {line}, expected a UTF-8 text file"
        raise InputError(message, where) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _similar(path: Path) -> str:
    """A hint at files of a similar name in the same directory."""
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"; the directory {path.parent} does not exist either" if not path.parent.exists() else ""
    hint = did_you_mean(path.name, names)
    return hint if hint.startswith("; did you mean") else ""
