"""Data sets of recorded runs: a directory with `recorded-results.json` and the files that it names.

The file is a list of instances. Each has a name (`instance`) and the paths `domain`, `problem` and `plan`, relative to
the directory. Optional: `irr` and `ccmmz`, the recorded runs (`status`, `wall_s`, `memory_mb`, `first_widening_s`,
`checks`), `irr_box` and `ccmmz_box` (`{parameter: [lower, upper]}`, exact numbers as text) and `irr_order` (the order
of turns). In `robot-delivery/instances.json` there may be plans of the delivery domain, of which nothing is recorded
but the number of `parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from msgspec import Meta

from robust.errors import InputError, Location
from robust.json_text import Count, Seconds, from_json
from robust.numbers import parse_end
from robust.plan.pddl.forms import read_text
from robust.qe.box import Box, Interval

from .engine.measure import Files

FILE_NAME = "recorded-results.json"
DELIVERIES = Path("robot-delivery", "instances.json")
Name = Annotated[str, Meta(min_length=1)]
Ends = Mapping[str, tuple[str, str]]


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run on the machine of the recording; `status` is `ok`, `out of time` or `out of memory`."""

    status: Name
    wall_s: Seconds | None = None
    memory_mb: Seconds | None = None
    first_widening_s: Seconds | None = None
    checks: Count | None = None

    @property
    def solved(self) -> bool:
        return self.status == "ok"


@dataclass(frozen=True, slots=True)
class Listed:
    """Names of files in a data set."""

    instance: Name
    domain: Name
    problem: Name
    plan: Name

    def files(self, directory: Path, place: Location) -> Files:
        """The files themselves.

        Raises:
            InputError: if one does not exist.
        """
        paths = (directory / self.domain, directory / self.problem, directory / self.plan)
        for path in paths:
            try:
                present = path.is_file()
            except (OSError, ValueError):
                present = False
            if not present:
                raise InputError(f"{self.instance!r} names {str(path)!r:.200}, expected a file that exists", place)
        return paths


@dataclass(frozen=True, slots=True)
class _Recorded(Listed):
    irr: RecordedRun | None = None
    ccmmz: RecordedRun | None = None
    irr_box: Ends | None = None
    ccmmz_box: Ends | None = None
    irr_order: tuple[Name, ...] | None = None


@dataclass(frozen=True, slots=True)
class Delivery(Listed):
    """A plan of the delivery domain."""

    parameters: Count


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


Entry = TypeVar("Entry", bound=Listed)


def directory_with(name: str | Path, given: Path) -> Path:
    """Where the list of a data set lies: in the directory, or one level below or above.

    Raises:
        InputError: if it is in none of them, or in several below.
    """
    if not given.is_dir():
        found = "a file" if given.exists() else "nothing"
        raise InputError(f"found {found}, expected a directory with {name}", Location(str(given)))
    if (given / name).is_file():
        return given
    below = sorted(path for path in given.iterdir() if (path / name).is_file())
    near = below or [path for path in (given.resolve().parent,) if (path / name).is_file()]
    if len(near) == 1:
        return near[0]
    found = f"{name} in {' and in '.join(path.name for path in near)}" if near else f"no {name}"
    raise InputError(f"found {found}, expected a directory with it, or one level below or above", Location(str(given)))


def read_suite(directory: Path) -> tuple[RecordedInstance, ...]:
    """The instances of a data set.

    Raises:
        InputError: if the directory, its list or a file that the list names is missing or malformed.
    """
    directory = directory_with(FILE_NAME, directory)
    place = Location(str(directory / FILE_NAME))
    instances = []
    for one in _entries(_Recorded, place):
        files = one.files(directory, place)
        box, ccmmz_box = (_box(ends, one.instance, place) for ends in (one.irr_box, one.ccmmz_box))
        instances.append(RecordedInstance(one.instance, files, one.irr, box, one.irr_order or (), one.ccmmz, ccmmz_box))
    return tuple(instances)


def read_deliveries(directory: Path) -> tuple[tuple[Delivery, Files], ...]:
    """The plans of the delivery domain in a data set.

    Raises:
        InputError: if there are none, or a file is missing or malformed.
    """
    directory = directory_with(DELIVERIES, directory)
    place = Location(str(directory / DELIVERIES))
    return tuple((one, one.files(directory, place)) for one in _entries(Delivery, place))


def _entries(kind: type[Entry], place: Location) -> Sequence[Entry]:
    listed: Any = list[kind]  # type: ignore[valid-type]
    found: Sequence[Entry] = from_json(listed, read_text(Path(place.file)), place)
    names = [one.instance for one in found]
    if not names:
        raise InputError("found an empty list, expected at least one instance", place)
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"found instance {name!r} twice, expected names that differ", place)
    return found


def _box(ends: Ends | None, called: str, place: Location) -> Box | None:
    if ends is None:
        return None
    try:
        return Box({name: Interval(parse_end(lower), parse_end(upper)) for name, (lower, upper) in ends.items()})
    except InputError as error:
        raise InputError(f"box of {called!r}: {error.message}", place) from None
