"""Files that survive crashes: output files that are replaced at once, and files of records that only grow.

Output files are written under another name and renamed: neither a full disk nor a kill destroys the old content. An
answer is not lost because a file cannot be written: commands print the answer first, and files that are written during
a computation (:class:`Folder`) are given up with a warning.

Files of records have a JSON object on each line, after a header that names the kind of file. A record is on the disk
when :meth:`RecordFile.append` returns. A last line without its end was cut off by a crash before it was reported, and
is dropped. One process at a time writes; readers may look at any time. Where records are chained, each line carries a
checksum of all lines up to it, so that no other damage goes unnoticed.
"""

import fcntl
import json
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeAlias

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
                error.filename = str(path)  # not the temporary name
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
    from tempfile import mkstemp  # noqa: PLC0415 - most commands write no file

    # The suffix stays: it is what names a format. A link is followed, so that it stays one.
    target = target.resolve()
    descriptor, name = mkstemp(target.suffix, f".{target.stem}.", target.parent)
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


_DIGITS = 16
"""Length of each checksum."""
_CHAINED = re.compile(rf'(.*), "checksum": "([0-9a-f]{{{_DIGITS}}})"}}', re.DOTALL)
Accept: TypeAlias = Callable[[int, str], None]
"""Takes a line by its number, the header as number 1; raises InputError, about the line, if it is not as expected."""


@dataclass(frozen=True, slots=True)
class RecordFormat:
    """The format of one kind of files.

    Attributes:
        name: what messages call such a file: `journal`.
        header: its first record, whose `schema` says what the file is; what else is in it the reader compares.
        chained: whether lines carry checksums.
    """

    name: str
    header: Mapping[str, Any]
    chained: bool = False

    @property
    def expected(self) -> str:
        """The expectation in messages about files of another kind."""
        return f"a {self.name} ({self.header['schema']}); choose a new file, or one of these"


@contextmanager
def in_line(file: str, number: int) -> Iterator[None]:
    """Errors about the text of one line say which line of the file it is; lines count from 1."""
    try:
        yield
    except InputError as error:
        column = error.location.column if error.location is not None else None
        raise InputError(error.message, Location(file, number, column)) from None


def read_records(path: str | os.PathLike[str], form: RecordFormat, accept: Accept) -> None:
    """Hand each line to `accept`, without its checksum; the file may be in use.

    Raises:
        InputError: if the file cannot be read, is not of that format or damaged, or if a line is not accepted; the
            message has the line.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read the {form.name}: {reason}", Location(str(path))) from None
    _Chain(str(path), form).read(data, accept)


class RecordFile:
    """A file of records that this process alone may write, until it is closed or the process is no more."""

    def __init__(self, path: str | os.PathLike[str], form: RecordFormat, accept: Accept) -> None:
        """Open a file of records, or begin one; its records are handed to `accept` as by :func:`read_records`.

        What was cut off is removed once everything else has been accepted.

        Raises:
            InputError: if it cannot be opened, is in use, is not of that format, is damaged, or is not accepted.
        """
        self.path = Path(path)
        self._form = form
        try:
            if self.path.exists() and not self.path.is_file():  # a device may have no end
                raise self._error(f"found no regular file, expected {form.expected}")
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise self._error(f"cannot open the {form.name}: {(error.strerror or str(error)).lower()}") from None
        try:
            self._lock()
            self._open(accept)
        except BaseException:
            os.close(self._file)
            raise

    def append(self, record: Mapping[str, Any]) -> None:
        """Add a record, which is not empty; when this returns, it is on disk.

        Raises:
            InputError: if it cannot be written; then the file is as it was.
        """
        line, checksum = self._chain.line(record)
        try:
            remaining = memoryview(line)
            while remaining:
                remaining = remaining[os.write(self._file, remaining) :]
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, self._chain.length)
            raise self._error(f"cannot be written: {error.strerror}") from error
        self._chain.length += len(line)
        self._chain.checksum = checksum

    def close(self) -> None:
        """Release the file, so that other processes can open it."""
        os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            name = self._form.name
            raise self._error(
                f"found a {name} that another process writes, expected one that is free; wait, or choose another file"
            ) from None

    def _open(self, accept: Accept) -> None:
        self._chain = _Chain(str(self.path), self._form)
        content = self.path.read_bytes()
        self._chain.read(content, accept)
        if self._chain.length < len(content):
            os.ftruncate(self._file, self._chain.length)
        if not self._chain.length:
            self.append(self._form.header)
            self._synchronize_directory()

    def _synchronize_directory(self) -> None:
        """Make sure that a new file is found after a crash of the machine."""
        directory = os.open(self.path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)

    def _error(self, message: str) -> InputError:
        return InputError(message, Location(str(self.path)))


class _Chain:
    """The lines of a file, one after the other; `length` and `checksum` are those of all complete ones so far."""

    def __init__(self, file: str, form: RecordFormat) -> None:
        self.length = 0
        self.checksum = ""
        self._file = file
        self._form = form

    def line(self, record: Mapping[str, Any]) -> tuple[bytes, str]:
        """A record as the next line, and the checksum after it."""
        text = json.dumps(record)
        checksum = ""
        if self._form.chained:
            checksum = self._next_checksum(text[:-1])
            text = f'{text[:-1]}, "checksum": "{checksum}"}}'
        return f"{text}\n".encode(), checksum

    def read(self, content: bytes, accept: Accept) -> None:
        """Hand on all complete lines of a file that begins as such files do."""
        *complete, rest = content.split(b"\n")
        if not complete and not self.line(self._form.header)[0].startswith(rest):
            raise InputError(f"found something else, expected {self._form.expected}", Location(self._file, 1))
        for number, line in enumerate(complete, 1):
            with in_line(self._file, number):
                text = self._decoded(line)
                if number == 1:
                    self._check_schema(text)
                accept(number, self._unchained(text) if self._form.chained else text)
            self.length += len(line) + 1

    def _decoded(self, line: bytes) -> str:
        try:
            return line.decode()
        except UnicodeDecodeError:
            raise InputError("found bytes that are no UTF-8, expected a JSON object") from None

    def _check_schema(self, text: str) -> None:
        try:
            header = json.loads(text)
        except (ValueError, RecursionError):
            raise InputError(f"found a line that is not JSON, expected {self._form.expected}") from None
        schema = header.get("schema") if isinstance(header, dict) else None
        if schema != self._form.header["schema"]:
            what = "no schema" if schema is None else f"schema {schema!r:.60}"
            raise InputError(f"found {what}, expected {self._form.expected}")

    def _unchained(self, text: str) -> str:
        match = _CHAINED.fullmatch(text)
        if match is None:
            raise InputError("found no field 'checksum', expected one at the end", Location(self._file, 1, 1))
        body, checksum = match.groups()
        expected = self._next_checksum(body)
        if checksum != expected:
            raise InputError(
                f"found checksum {checksum!r}, expected {expected}: the {self._form.name} was changed here"
            )
        self.checksum = expected
        return f"{body}}}"

    def _next_checksum(self, body: str) -> str:
        from hashlib import sha256  # noqa: PLC0415 - most commands append to no file of records

        return sha256(f"{self.checksum}\n{body}".encode()).hexdigest()[:_DIGITS]
