"""The checker as a separate process: the one file that needs nothing of this package."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from robust.errors import RobustError
from robust.smt.limits import Deadline, OutOfTimeError

_PACKAGED = Path(__file__).resolve().with_name("checker.py")
_CHECKOUT = Path(__file__).resolve().parents[2] / "proofs" / "checker" / "check.py"


class CheckerMissingError(RobustError):
    """The installation lacks the checker."""


class Outcome(Enum):
    """What the checker says of a certificate; the values are its exit codes."""

    ESTABLISHED = 0
    REJECTED = 1
    UNREADABLE = 2


@dataclass(frozen=True)
class Verification:
    """The checker's verdict, and what it printed."""

    outcome: Outcome
    lines: tuple[str, ...]


def checker_path() -> Path:
    """Where the checker is: beside this module if the package was built, else in the checkout.

    Raises:
        CheckerMissingError: if it is in neither place.
    """
    for path in (_PACKAGED, _CHECKOUT):
        if path.is_file():
            return path
    raise CheckerMissingError(f"found no checker at {_PACKAGED}; expected an installation that includes it")


def verify(
    certificate: Path,
    files: Mapping[str, Path],
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> Verification:
    """Check a certificate, and that it is about the given files, by kind: `domain`, `problem`, `plan`, `network`.

    Raises:
        CheckerMissingError: if there is no checker, or it ended in a way that it never should.
        OutOfTimeError: if the deadline passes.
    """
    words = [sys.executable, "-I", str(checker_path()), str(certificate)]
    words += [word for name, path in files.items() for word in (f"--{name}", str(path))]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=deadline.remaining)  # noqa: S603 - our own file
    except subprocess.TimeoutExpired:
        raise OutOfTimeError from None
    if done.returncode not in (0, 1, 2) or done.stderr:
        raise CheckerMissingError(f"the checker failed with exit code {done.returncode}; please report this as a bug")
    return Verification(Outcome(done.returncode), tuple(done.stdout.splitlines()))
