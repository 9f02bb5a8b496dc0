"""Certificates: why a verdict holds, in a form that a small program can check without any solver.

That program, the checker, is run as a process of its own, with limits of time and memory.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path
from typing import Any

from robust import errors, presented
from robust.certify import checker
from robust.processes import Processes
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

FOLDER = Path(checker.__file__).resolve().parent
"""The checker: a package that needs nothing of this one."""

MEMORY_MB = 4096
OUT_OF_TIME = 3
"""The checker's exit code once it has taken the processor time that it may."""
_START = "import runpy, sys; sys.path.insert(0, sys.argv.pop(1)); runpy.run_module('checker', run_name='__main__')"


class CheckerFailedError(errors.RobustError):
    """The checker ended in a way that it never should."""


class CheckerOutcome(presented.VerdictEnum):
    """What the checker says of a certificate; the values are its exit codes."""

    ESTABLISHED = 0
    REJECTED = 1
    UNREADABLE = 2
    UNSUPPORTED = 4


@dataclass(frozen=True, slots=True)
class Demanded:
    """What a certificate has to establish.

    Attributes:
        epsilon: how far apart mutex time points have to be.
        kind: what has to be established, at least.
        box: the box that has to be established, in JSON, or a file of it; parameters that it leaves out have their
            nominal values.
        assume: `NAME=VALUE` of choices: those of an execution that has to be established, or those that are made
            already if it has to be established that there is none.
    """

    epsilon: Fraction
    kind: str | None = None
    box: str | None = None
    assume: Sequence[str] = ()


@dataclass(frozen=True)
class Verification(presented.NoTruthValue, ask="outcome"):
    """The checker's verdict, and its answer: `claim` and `files` (digests) among others, or `reason`."""

    outcome: CheckerOutcome
    answer: Mapping[str, Any]


def verify(certificate: Path, files: Sequence[Path], demanded: Demanded, deadline: Deadline = NEVER) -> Verification:
    """Check a certificate of a domain, a problem and a plan, or of a network.

    Without a deadline, the checker limits its processor time by the sizes of the files.

    Raises:
        CheckerFailedError: if the checker ended in a way that it never should.
        OutOfTimeError: if the deadline passes, or the checker ends because it has taken long enough.
    """
    words = [sys.executable, "-I", "-c", _START, str(FOLDER.parent), str(certificate), *map(str, files)]
    words += ["--json", f"--epsilon={demanded.epsilon}"]
    words += [f"--kind={demanded.kind}"] if demanded.kind is not None else []
    words += [f"--box={demanded.box}"] if demanded.box is not None else []
    words += [f"--assume={text}" for text in demanded.assume]
    if deadline.remaining is not None:
        words.append(f"--seconds={max(ceil(deadline.remaining), 1)}")
    ended = Processes().run(words, deadline, memory_mb=MEMORY_MB)
    if ended.timed_out or ended.exit_code == OUT_OF_TIME:
        raise OutOfTimeError
    if ended.exit_code not in {outcome.value for outcome in CheckerOutcome} or ended.stderr:
        message = f"the checker failed with exit code {ended.exit_code} ({ended.last_line})"
        raise CheckerFailedError(f"{message}; please report this as a bug")
    return Verification(CheckerOutcome(ended.exit_code), json.loads(ended.stdout))
