"""Results on disk as they arrive: one JSON object a line, so that a run that ends early can be resumed.

The first line says what the file is. Every other line is a result with the key of its task. Lines are appended in one
write and forced to disk. A last line without its end was torn by a crash: it is dropped, its task is done again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import robust
from robust.errors import InputError, Location

SCHEMA = "robust/sweep-store/2"


class Store:
    """The results of a file, by key; only one process at a time may have it open.

    Raises:
        InputError: if the file cannot be written, is no store, was written by another version, or is in use.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._results: dict[str, Any] = {}
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise InputError(f"cannot open the store: {_reason(error)}", Location(str(path))) from None
        try:
            self._lock()
            self._read()
        except BaseException:
            os.close(self._file)
            raise

    @property
    def results(self) -> Mapping[str, Any]:
        return self._results

    def add(self, key: str, label: str, result: Any) -> bool:
        """Keep a result; False, and nothing is written, if there is one with that key already.

        Raises:
            InputError: if it cannot be written.
        """
        if key in self._results:
            return False
        self._append({"key": key, "task": label, "result": result})
        self._results[key] = result
        return True

    def close(self) -> None:
        os.close(self._file)

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                "the store is in use by another run; wait for it, or choose another file", Location(str(self.path))
            ) from None

    def _read(self) -> None:
        content = self._content()
        whole = content.rfind(b"\n") + 1
        header = _line({"schema": SCHEMA, "robust": robust.__version__})
        if whole == 0 and not header.startswith(content):
            raise self._not_a_store(1, "something else")
        for number, line in enumerate(content[:whole].splitlines(), 1):
            self._take(number, line)
        if whole < len(content):
            os.ftruncate(self._file, whole)
        if whole == 0:
            self._append({"schema": SCHEMA, "robust": robust.__version__})

    def _content(self) -> bytes:
        parts = []
        while part := os.read(self._file, 1 << 20):
            parts.append(part)
        return b"".join(parts)

    def _take(self, number: int, line: bytes) -> None:
        try:
            value = json.loads(line)
        except ValueError:
            raise self._not_a_store(number, "a line that is not JSON") from None
        if not isinstance(value, dict):
            raise self._not_a_store(number, "a line that is no JSON object")
        if number == 1:
            self._check_header(value)
        elif not isinstance(value.get("key"), str) or "result" not in value:
            raise self._not_a_store(number, "an object without 'key' and 'result'")
        else:
            self._results.setdefault(value["key"], value["result"])

    def _check_header(self, value: Mapping[str, Any]) -> None:
        if value.get("schema") != SCHEMA:
            raise self._not_a_store(1, f"schema {value.get('schema')!r}")
        if value.get("robust") != robust.__version__:
            raise InputError(
                f"found results of robust {value.get('robust')}, expected those of {robust.__version__}; "
                "choose another file, so that results of different versions are not mixed",
                Location(str(self.path), 1),
            )

    def _not_a_store(self, number: int, found: str) -> InputError:
        what = f"found {found}, expected a store of results ({SCHEMA}); choose a new file"
        return InputError(what, Location(str(self.path), number))

    def _append(self, value: Mapping[str, Any]) -> None:
        line = _line(value)
        try:
            written = os.write(self._file, line)
            os.fsync(self._file)
        except OSError as error:
            raise InputError(f"cannot write the store: {_reason(error)}", Location(str(self.path))) from None
        if written < len(line):
            raise InputError("cannot write the store: the disk is full", Location(str(self.path)))


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
