"""Errors that a user can act on.

Every public function of the package raises a subclass of :class:`RobustError`. The message is one line that names the
place, what was found, what was expected and, where there is one, the remedy; `exit_code` is what the command line
returns. What there is to catch::

    RobustError
    ├── InputError            2  wrong files or arguments
    ├── RefutedError          1  what is claimed is false
    │   ├── InvalidPlanError       a time-triggered plan that breaks obligations, which has its `violations`
    │   └── TooFarError            printed times that no exact schedule is near enough to
    ├── UnsupportedError      4  legal, but outside what is decided; or an optional package is missing
    └── SolverError           3  a solver failed, or is not installed
"""

from collections.abc import Iterable
from dataclasses import dataclass

LONGEST_PATH = 4096
"""No system has longer paths; what is longer is cut in messages."""
UNDECIDED, UNSUPPORTED = 3, 4
"""Exit codes: what is asked is not decided, or nothing that is decided here."""
_GOOD = frozenset({"proved", "complete", "valid", "controllable", "succeeded", "unneeded", "optimal"})
_BAD = frozenset({"refuted", "invalid", "uncontrollable", "not controllable", "failed", "impossible"})


def exit_code_of(word: str) -> int:
    """The exit code of a verdict, or of how something ended: 0, 1 where something is refuted, 3 where it is open."""
    return 0 if word in _GOOD else 1 if word in _BAD else UNDECIDED


def worst(codes: Iterable[int]) -> int:
    """The exit code of several answers: refuted, else unreadable, else unsupported, else undecided."""
    present = set(codes)
    return next((code for code in (1, RobustError.exit_code, UNSUPPORTED, UNDECIDED) if code in present), 0)


@dataclass(frozen=True, slots=True)
class Location:
    """A place in an input file, as text one line, whatever the file is called; lines and columns count from one."""

    file: str
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        is_name = self.file.isprintable() and len(self.file) <= LONGEST_PATH
        parts = [self.file if is_name else repr(f"{self.file[:37]}..." if len(self.file) > 40 else self.file)]
        if self.line is not None:
            parts.append(str(self.line))
            if self.column is not None:
                parts.append(str(self.column))
        return ":".join(parts)


class RobustError(Exception):
    """Base of all errors of this package; `exit_code` is what the command line returns for it."""

    exit_code = 2

    def __init__(self, message: str, location: Location | None = None) -> None:
        self.message = message
        self.location = location
        super().__init__(f"{location}: {message}" if location else message)


class InputError(RobustError):
    """The input is wrong: the message says where, what was found and what was expected."""


class RefutedError(RobustError):
    """The input is well-formed, but what it claims is false: a plan breaks an obligation."""

    exit_code = 1


class UnsupportedError(RobustError):
    """The input is legal, but outside what this package decides."""

    exit_code = UNSUPPORTED


class SolverError(RobustError):
    """A solver failed, or is not available."""

    exit_code = UNDECIDED


class InputWarning(UserWarning):
    """The input can be read, but is not what its author is likely to have meant; `warnings` decides what is done."""


class OutputWarning(UserWarning):
    """A file could not be written while something was computed; what was computed is not affected."""


def refused(error: OSError) -> InputError:
    """The error for an operation that the system refused, with the file if it is about one."""
    place = f"{error.filename}: " if error.filename else ""
    return InputError(f"{place}{error.strerror or error}")


def missing(what: str, extra: str) -> UnsupportedError:
    """The error for a package that comes with an extra, and is not installed."""
    return UnsupportedError(f"found no {what}, expected it to be installed: pip install 'robust-plans[{extra}]'")


_EXTRAS = {"matplotlib": "plots", "networkx": "plots", "dd": "bdd"}
"""Packages that are imported where they are needed, and the extras that bring them."""


def from_extra(error: ModuleNotFoundError) -> UnsupportedError | None:
    """The error for a package that comes with an extra; None for any other module that was not found."""
    package = (error.name or "").partition(".")[0]
    return missing(package, _EXTRAS[package]) if package in _EXTRAS else None


def closest(name: str, known: Iterable[str]) -> str:
    """A suffix for an error message that lists what is known: the names closest to an unknown one, if any are close."""
    from difflib import get_close_matches  # noqa: PLC0415 - only for messages

    close = get_close_matches(name, sorted(set(known)), n=2, cutoff=0.6)
    return f"; did you mean {' or '.join(map(repr, close))}?" if close else ""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A suffix for an error message about an unknown name: the closest known names, or what is known at all."""
    candidates = sorted(set(known))
    if close := closest(name, candidates):
        return close
    if candidates and len(candidates) <= 8:
        return f"; known are {', '.join(candidates)}"
    return ""
