"""Suites of plans: a folder, or a list of lines, JSON or CSV.

In a folder, each file whose suffix says that it is a plan is one. Its problem and its domain are the PDDL files beside
it, or in the nearest folder above within the suite, whose names fit: without words such as `plan`, `problem` and
`domain`, the name of the PDDL file is the beginning of that of the plan, `plan_05_1.stn` of `problem_05.pddl`, and
`problem.pddl` fits all. The longest such name counts; a plan for which two fit equally well, or none, is named as one
whose files are not known.
"""

import csv
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from robust.errors import InputError, Location
from robust.json_text import Array, JsonText, Object, describe, parse_json
from robust.numbers import plural, shorten
from robust.plan.pddl.forms import read_text

PLAN_SUFFIXES = (".stn", ".plan", ".log", ".sol", ".soln", ".solution")
"""Of plans in a folder."""
NAMES = ("instance", "name")
"""Keys of JSON and columns of CSV that name a plan; the first that is there counts."""
PLANS = ("plan", "log")
"""Keys of JSON and columns of CSV that name the file of a plan."""
_WORDS = frozenset(
    ["domain", "problem", "prob", "pfile", "p", "plan", "instance", "task", "solution", "sol", "log", "output"]
)
"""What names of files say of their kind; the rest says what belongs together."""
_PARTS = re.compile(r"[a-z]+|[0-9]+")
_DEFINED = re.compile(r"\(\s*define\s*\(\s*(domain|problem)\b", re.IGNORECASE)
_COMMENT = re.compile(r";[^\n]*")


@dataclass(frozen=True, slots=True)
class SuitePlan:
    """A plan of a suite, by a name that no other one has; `trouble` says in one line why its files are not known.

    Names of files are as the suite has them, relative to its folder.
    """

    name: str
    domain: str
    problem: str
    plan: str
    trouble: str | None = None


@dataclass(frozen=True, slots=True)
class Suite:
    """Plans, and the folder that their files are relative to."""

    folder: Path
    instances: tuple[SuitePlan, ...]


def read_suite(path: Path) -> Suite:
    """The plans of a folder, or of a list: JSON or CSV by its suffix, else lines of DOMAIN PROBLEM PLAN.

    Raises:
        InputError: if there is none, or the list is malformed; the message has the line.
    """
    if path.is_dir():
        plans = list(_in_folder(path))
        if not plans:
            expected = f"files that end in {', '.join(PLAN_SUFFIXES)}, or a file with a list"
            raise InputError(f"found no plan, expected {expected}", Location(str(path)))
        return Suite(path, _distinct(plans))
    if not path.exists():
        raise InputError("found no such file or folder, expected a folder of plans or a list", Location(str(path)))
    readers = {".json": _from_json, ".csv": _from_csv}
    return Suite(path.parent, _distinct(readers.get(path.suffix.lower(), _from_lines)(path)))


def listed_files(path: Path) -> list[tuple[Path, Path, Path]]:
    """Domain, problem and plan on each line of a list; relative to it, quoted as in a shell, `#` before comments.

    Raises:
        InputError: if a line has other than three files, or there is none; the message has the line.
    """
    listed = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        place = Location(str(path), number)
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise InputError(f"found {shorten(line)}, expected quotes in pairs ({error})", place) from None
        if words and len(words) != 3:
            raise InputError(f"found {plural(len(words), 'file')}, expected DOMAIN PROBLEM PLAN", place)
        if words:
            domain, problem, plan = (path.parent / word for word in words)
            listed.append((domain, problem, plan))
    if not listed:
        raise InputError("found no plan, expected lines of DOMAIN PROBLEM PLAN", Location(str(path)))
    return listed


def _distinct(instances: Iterable[SuitePlan]) -> tuple[SuitePlan, ...]:
    """With a number behind names that were there before."""
    taken: dict[str, int] = {}
    distinct = []
    for instance in instances:
        count = taken[instance.name] = taken.get(instance.name, 0) + 1
        distinct.append(instance if count == 1 else replace(instance, name=f"{instance.name} ({count})"))
    return tuple(distinct)


# -- lists -------------------------------------------------------------------------------------------------------------


def _from_lines(path: Path) -> Iterator[SuitePlan]:
    for files in listed_files(path):
        domain, problem, plan = (os.path.relpath(file, path.parent) for file in files)
        yield SuitePlan(plan, domain, problem, plan)


def _from_json(path: Path) -> list[SuitePlan]:
    """A list of objects with `domain`, `problem` and `plan` or `log`; `instance` or `name` if they have one."""
    top = parse_json(read_text(path), str(path))
    if not isinstance(top, Array) or not top.items:
        place = Location(str(path), top.location.line, top.location.column)
        raise InputError(f"found {describe(top)}, expected a list of objects with domain, problem and plan", place)
    plans = []
    for item in top.items:
        if not isinstance(item, Object):
            raise InputError(f"found {describe(item)}, expected an object with domain, problem and plan", item.location)
        texts = {}
        for key in ("domain", "problem", *PLANS, *NAMES):
            value = item.members.get(key)
            if value is not None and not (isinstance(value, JsonText) and value.value):
                raise InputError(f"found {describe(value)} as {key}, expected a text", value.location)
            texts[key] = value.value if value is not None else None
        plans.append(_entry(texts, item.location))
    return plans


def _from_csv(path: Path) -> list[SuitePlan]:
    """A head with the keys of JSON, and a line for each plan."""
    rows = csv.DictReader(read_text(path).split("\n"), strict=True)
    plans = []
    try:
        for row in rows:
            place = Location(str(path), rows.line_num)
            if None in row:
                raise InputError(f"found more cells than the {len(rows.fieldnames or ())} of the head", place)
            plans.append(_entry(row, place))
    except csv.Error as error:
        raise InputError(f"found no CSV ({error})", Location(str(path), rows.reader.line_num)) from None
    if not plans:
        raise InputError("found no plan, expected a head with domain,problem,plan and lines below", Location(str(path)))
    return plans


def _entry(texts: Mapping[str, str | None], place: Location) -> SuitePlan:
    """A plan of a list, of texts by key; its name is that of the plan's file if it has none."""
    plan = next((texts[key] for key in PLANS if texts.get(key)), None)
    domain, problem = texts.get("domain"), texts.get("problem")
    for key, text in (("domain", domain), ("problem", problem), ("plan", plan)):
        if not text:
            raise InputError(f"found no {key}, expected domain, problem and plan", place)
    name = next((texts[key] for key in NAMES if texts.get(key)), None)
    return SuitePlan(name or plan or "", domain or "", problem or "", plan or "")


# -- folders -----------------------------------------------------------------------------------------------------------


Defined = Callable[[Path], Mapping[str, Sequence[Path]]]
"""The PDDL files of a folder by what they define."""


def _in_folder(folder: Path) -> Iterator[SuitePlan]:
    defined = cache(_defined)
    for directory, inner, files in os.walk(folder):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        for file in sorted(files):
            if file.lower().endswith(PLAN_SUFFIXES) and not file.startswith("."):
                yield _found(folder, Path(directory, file), defined)


def _found(folder: Path, plan: Path, defined: Defined) -> SuitePlan:
    name = os.path.relpath(plan, folder)
    above = [plan.parent, *plan.parent.parents]
    del above[above.index(folder) + 1 :]
    files = {}
    for kind in ("domain", "problem"):
        fitting: Sequence[Path] = ()
        for directory in above:
            if fitting := _best(plan, defined(directory).get(kind, ())):
                break
        if len(fitting) != 1:
            names = ", ".join(file.name for file in fitting) or "none"
            where = "of a fitting name beside it or above"
            trouble = f"found {names}, expected one {kind} {where}; a list may say which"
            return SuitePlan(name, "", "", name, trouble)
        files[kind] = os.path.relpath(fitting[0], folder)
    return SuitePlan(name, files["domain"], files["problem"], name)


def _best(plan: Path, candidates: Iterable[Path]) -> list[Path]:
    """The one whose name fits best, or those of which none does."""
    words = _parts(plan)
    fitting = {file: parts for file in candidates if _fits(parts := _parts(file), words)}
    best = [path for path, parts in fitting.items() if all(set(parts) >= set(other) for other in fitting.values())]
    return best or list(fitting)


def _fits(parts: Sequence[str], plan: Sequence[str]) -> bool:
    """Whether they are the beginning of what the plan has, or words of it."""
    return plan[: len(parts)] == parts or (set(parts) <= set(plan) and not any(part.isdigit() for part in parts))


def _parts(file: Path) -> tuple[str, ...]:
    """`plan_g01_w05.stn` has g, 01, w, 05."""
    return tuple(part for part in _PARTS.findall(file.stem.lower()) if part not in _WORDS)


def _defined(directory: Path) -> Mapping[str, Sequence[Path]]:
    """Those that cannot be read define nothing."""
    files: dict[str, tuple[Path, ...]] = {}
    for file in sorted(directory.glob("*.[pP][dD][dD][lL]")):
        try:
            match = _DEFINED.search(_COMMENT.sub("", read_text(file)))
        except InputError:
            continue
        if match is not None:
            kind = match[1].lower()
            files[kind] = (*files.get(kind, ()), file)
    return files
