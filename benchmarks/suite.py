"""Data sets of recorded runs: a directory with `recorded-results.json` and the files that it names.

The file is a list of instances. Each has a name (`instance`) and the paths `domain`, `problem` and `plan`, relative to
the directory. Optional: `irr` and `ccmmz`, the recorded runs (`status`, `wall_s`, `memory_mb`, `first_widening_s`,
`checks`), `irr_box` and `ccmmz_box` (`{parameter: [lower, upper]}`, exact numbers as text) and `irr_order` (the order
of turns).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robust.errors import InputError, Location, did_you_mean
from robust.plan.pddl.forms import read_text
from robust.qe.box import Box, Interval

from .engine.measure import Files, parse_end

FILE_NAME = "recorded-results.json"
_FIELDS = ("instance", "domain", "problem", "plan", "irr", "irr_box", "irr_order", "ccmmz", "ccmmz_box")


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run on the machine of the recording; `status` is `ok`, `out of time` or `out of memory`."""

    status: str
    wall_s: float | None = None
    memory_mb: float | None = None
    first_widening_s: float | None = None
    checks: int | None = None

    @property
    def solved(self) -> bool:
        return self.status == "ok"


@dataclass(frozen=True)
class RecordedInstance:
    """One instance; `box` is None where no run of IRR returned one."""

    name: str
    files: Files
    irr: RecordedRun | None = None
    box: Box | None = None
    order: tuple[str, ...] = ()
    ccmmz: RecordedRun | None = None
    ccmmz_box: Box | None = None

    @property
    def order_options(self) -> list[str]:
        """The recorded order of turns as an option."""
        return [f"--order={','.join(self.order)}"] if self.order else []


def read_suite(directory: Path) -> tuple[RecordedInstance, ...]:
    """The instances of a data set.

    Raises:
        InputError: if the directory, its list or a file that the list names is missing or malformed.
    """
    if not directory.is_dir():
        found = "a file" if directory.exists() else "nothing"
        raise InputError(f"found {found}, expected a directory with {FILE_NAME}", Location(str(directory)))
    path = directory / FILE_NAME
    location = Location(str(path))
    try:
        entries = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON: {error.msg}", Location(str(path), error.lineno, error.colno)) from None
    except (ValueError, RecursionError):
        raise InputError("found JSON that is nested too deeply or holds an enormous number", location) from None
    if not isinstance(entries, list) or not entries:
        raise InputError(f"found {_kind(entries)}, expected a list of at least one instance", location)
    instances = tuple(_instance(_Entry.of(entry, index, location), directory) for index, entry in enumerate(entries, 1))
    names = [instance.name for instance in instances]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"found instance {name!r} twice, expected names that differ", location)
    return instances


@dataclass(frozen=True, slots=True)
class _Entry:
    """A JSON object and how to call it in messages."""

    values: Mapping[str, Any]
    called: str
    location: Location

    @staticmethod
    def of(value: object, index: int, location: Location) -> _Entry:
        if not isinstance(value, dict):
            raise InputError(f"instance {index} is {_kind(value)}, expected an object", location)
        name = value.get("instance")
        return _Entry(value, f"instance {index}" + (f" ({name!r})" if isinstance(name, str) else ""), location)

    def error(self, message: str) -> InputError:
        return InputError(f"{self.called}: {message}", self.location)

    def text(self, key: str) -> str:
        if key not in self.values:
            unknown = [found for found in self.values if found not in _FIELDS]
            hint = did_you_mean(key, unknown) if unknown else ""
            raise self.error(f"has no {key!r}, expected a text{hint if hint.startswith('; did') else ''}")
        value = self.values[key]
        if not isinstance(value, str) or not value:
            raise self.error(f"{key!r} is {_kind(value)}, expected a text")
        return value

    def number(self, key: str) -> float | None:
        value = self.values.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value < 0:
            raise self.error(f"{key!r} is {value!r}, expected a number that is not negative")
        return value

    def count(self, key: str) -> int | None:
        value = self.number(key)
        if value is not None and not isinstance(value, int):
            raise self.error(f"{key!r} is {value!r}, expected an integer")
        return value

    def inner(self, key: str) -> _Entry | None:
        value = self.values.get(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.error(f"{key!r} is {_kind(value)}, expected an object")
        return _Entry(value, f"{self.called}, {key!r}", self.location)


def _instance(entry: _Entry, directory: Path) -> RecordedInstance:
    return RecordedInstance(
        name=entry.text("instance"),
        files=(
            _file(entry, "domain", directory),
            _file(entry, "problem", directory),
            _file(entry, "plan", directory),
        ),
        irr=_run(entry.inner("irr")),
        box=_box(entry.inner("irr_box")),
        order=_order(entry),
        ccmmz=_run(entry.inner("ccmmz")),
        ccmmz_box=_box(entry.inner("ccmmz_box")),
    )


def _file(entry: _Entry, key: str, directory: Path) -> Path:
    path = directory / entry.text(key)
    try:
        present = path.is_file()
    except (OSError, ValueError):
        present = False
    if not present:
        raise entry.error(f"{key!r} names {str(path)!r}, expected a file that exists")
    return path


def _run(entry: _Entry | None) -> RecordedRun | None:
    if entry is None:
        return None
    return RecordedRun(
        status=entry.text("status"),
        wall_s=entry.number("wall_s"),
        memory_mb=entry.number("memory_mb"),
        first_widening_s=entry.number("first_widening_s"),
        checks=entry.count("checks"),
    )


def _box(entry: _Entry | None) -> Box | None:
    if entry is None:
        return None
    box = {}
    for name, ends in entry.values.items():
        if not isinstance(ends, list) or [type(end) for end in ends] != [str, str]:
            raise entry.error(f'{name!r} is {json.dumps(ends)[:60]}, expected two numbers as text such as ["1/3", "2"]')
        try:
            box[name] = Interval(parse_end(ends[0]), parse_end(ends[1]))
        except InputError as error:
            raise entry.error(f"{name!r}: {error.message}") from None
    return Box(box)


def _order(entry: _Entry) -> tuple[str, ...]:
    order = entry.values.get("irr_order")
    if order is None:
        return ()
    if not isinstance(order, list) or not all(isinstance(name, str) and name for name in order):
        raise entry.error(f"'irr_order' is {_kind(order)}, expected a list of parameter names")
    return tuple(order)


def _kind(value: object) -> str:
    """What a JSON value is, in words."""
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case dict():
            return "an object"
        case list():
            return "a list" if value else "an empty list"
        case str():
            return "a text" if value else "an empty text"
        case _:
            return "a number"
