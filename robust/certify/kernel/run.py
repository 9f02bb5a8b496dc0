"""What checkers say of a certificate; the verified one, `robust-kernel`, is run as a process of its own, on files that
are made here from the certificate and from the files that it is about."""

import json
import shutil
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robust.certify import MEMORY_MB, CheckerFailedError, CheckerOutcome, Demanded, Verification, verify
from robust.certify.checker.__main__ import (
    CHOICES,
    FORMAT,
    MALFORMED,
    Inputs,
    ends_of,
    lines_of,
    network_files,
    plain,
    require,
    require_choices,
)
from robust.certify.checker.claims import Claim, box_of, meaning, nominal
from robust.certify.checker.proofs import Rejected, Tape, demand
from robust.certify.checker.reader import Ground, Unsupported, ground
from robust.certify.hints import NotRefutedError
from robust.certify.kernel.claims import Ask, Translation
from robust.certify.kernel.team import TeamTranslation
from robust.certify.kernel.terms import unsupported
from robust.errors import InputError, UnsupportedError
from robust.processes import Processes
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

NAME = "robust-kernel"
UNKNOWN = "unreadable: unsupported: "
UNREADABLE = (OSError, EOFError, zlib.error, UnicodeError)


def found() -> str | None:
    """The verified checker on the PATH, if it is there."""
    return shutil.which(NAME)


TRUSTED = {
    "python": "proofs/checker (1,600 lines), Python",
    "kernel": "Spec.v, Pddl.v and Claims.v; what takes texts apart (reader.py, terms.py, text.ml, pddl.ml) and prints "
    "the claim (main.ml); Coq, OCaml",
}
"""What has to be trusted if a checker says that something is established."""
TRUSTED_OF_CHOICES = {
    "python": TRUSTED["python"],
    "kernel": "Choices.v and Spec.v; what reads networks and their PDDL (reader.py, choices.py, team.py, text.ml, "
    "team.ml) and prints the claim; Coq, OCaml",
}
"""The same of plans with choices."""


PATIENCE = 10
"""Seconds for a checker that was not asked for."""


@dataclass(frozen=True, slots=True)
class Opinion:
    """What one checker says of a certificate, after how many seconds."""

    checker: str
    verification: Verification
    seconds: float


def opinions(
    checker: str | None, certificate: Path, files: Sequence[Path], demanded: Demanded, deadline: Deadline = NEVER
) -> list[Opinion]:
    """What the checkers say that are asked for: `python`, `kernel`, `both`, or both if the verified one is there.

    In the last case the checker in Python decides; the verified one says for `PATIENCE` seconds what it can. Errors
    are those of :func:`verify_by_kernel`.
    """
    optional = checker is None and found() is not None
    names = ("python", "kernel") if checker == "both" or optional else (checker or "python",)
    said = []
    for name in names:
        started = time.perf_counter()
        if optional and name == "kernel":
            answer = _if_in_time(certificate, files, demanded, deadline)
        else:
            answer = (verify if name == "python" else verify_by_kernel)(certificate, files, demanded, deadline)
        said.append(Opinion(name, answer, time.perf_counter() - started))
        if answer.outcome is CheckerOutcome.UNREADABLE:
            break
    return said


def _if_in_time(certificate: Path, files: Sequence[Path], demanded: Demanded, deadline: Deadline) -> Verification:
    try:
        return verify_by_kernel(certificate, files, demanded, deadline.within(PATIENCE))
    except OutOfTimeError:
        return _refused(CheckerOutcome.UNSUPPORTED, f"not established within {PATIENCE} seconds", Inputs())


def verify_by_kernel(
    certificate: Path, files: Sequence[Path], demanded: Demanded, deadline: Deadline = NEVER
) -> Verification:
    """As :func:`robust.certify.verify`, by the checker that Coq proves right.

    Raises:
        InputError: if `robust-kernel` is not on the PATH.
        CheckerFailedError: if it ended in a way that it never should.
        OutOfTimeError: if the deadline passes.
    """
    program = found()
    if program is None:
        raise InputError(
            f"found no {NAME} on the PATH, expected the verified checker: `make -C proofs/kernel install PREFIX=DIR` "
            "builds it with Coq 8.16; or use `--checker python`"
        )
    inputs = Inputs()
    try:
        answer = _Asked(program, deadline).answer(certificate, files, inputs, demanded)
    except UNREADABLE as error:
        return _refused(CheckerOutcome.UNREADABLE, error, inputs)
    except (Unsupported, UnsupportedError) as error:
        return _refused(CheckerOutcome.UNSUPPORTED, error, inputs)
    except (Rejected, NotRefutedError) as error:
        return _refused(CheckerOutcome.REJECTED, error, inputs)
    except MALFORMED as error:
        return _refused(CheckerOutcome.REJECTED, f"malformed ({type(error).__name__})", inputs)
    return Verification(CheckerOutcome.ESTABLISHED, {"verdict": "established", "files": dict(inputs), **answer})


def _refused(outcome: CheckerOutcome, reason: object, inputs: Inputs) -> Verification:
    return Verification(outcome, {"verdict": outcome.name.lower(), "reason": plain(str(reason)), "files": dict(inputs)})


def _reading(plan: Ground) -> str:
    """What parameters mean that only the file beside the plan says, and what is read otherwise than it is written."""
    means, guessed = [meaning(plan, *each) for each in plan.varied.items()], sorted(plan.model.guessed)
    where, read = f", where {', '.join(means)}" if means else "", f", reading {', '.join(guessed)}" if guessed else ""
    return where + read


def _answer(claim: Claim, text: str, checked: str) -> dict[str, Any]:
    return {
        "kind": claim.kind,
        "epsilon": str(claim.epsilon),
        "claim": plain(text),
        "box": None if claim.box is None else {name: ends_of(values) for name, values in claim.box.items()},
        "obligations": int(checked.split()[1]),
    }


class _Asked:
    """The verified checker, as often as it is needed."""

    def __init__(self, program: str, deadline: Deadline) -> None:
        self._program, self._deadline = program, deadline

    def answer(self, certificate: Path, files: Sequence[Path], inputs: Inputs, demanded: Demanded) -> dict[str, Any]:
        """What it establishes, of the plan as the checker in Python reads it."""
        lines, epsilon = lines_of(certificate), demanded.epsilon
        first = json.loads(next(lines, "null"))
        demand(type(first) is list and len(first) == 3 and first[0] == FORMAT, f"expected a certificate of {FORMAT}")
        _, kind, stated = first
        demand(len(files) == (1 if kind in CHOICES else 3), f"a certificate of kind {kind} is about other files")
        if kind in CHOICES:
            team = TeamTranslation(network_files(inputs, files[0]), epsilon, self._deadline)
            claim, words = team.claim(Tape(lines), kind, stated)
            require_choices(claim, demanded)
            *_, checked = self._lines(inputs, partial(team.file, words, kind))
            return _answer(claim, claim.text, checked)
        if kind == "corners":
            raise unsupported("boxes at corners of rates")
        domain, problem, text = (
            inputs.text(name, path) for name, path in zip(("domain", "problem", "plan"), files, strict=True)
        )
        beside = files[2].with_suffix(".toml")
        plan = ground(domain, problem, text, inputs.text("parameters", beside) if beside.is_file() else "")
        claim = Claim(kind, epsilon)
        if kind in ("plan", "box", "maximal"):
            claim.box = nominal(plan) if kind == "plan" else box_of(plan, stated)
        require(plan, claim, demanded)
        translation = Translation(plan, epsilon, self._deadline)
        established, *_, checked = self._lines(inputs, partial(translation.file, Tape(lines), kind, stated))
        return _answer(claim, established.removeprefix("established: ") + _reading(plan), checked)

    def _lines(self, inputs: Inputs, file: Callable[[list[str], Ask], str]) -> list[str]:
        """What it prints of its input, which is made with the digests of files and with what prints its formulas."""
        digests = [f"({name} sha256 {digest})" for name, digest in inputs.items()]
        with TemporaryDirectory(prefix="robust-kernel-") as directory:
            path = Path(directory) / "certificate.kernel"
            whole = file(digests, partial(self._run, path, words=("--formulas",)))
            return self._run(path, whole).splitlines()

    def _run(self, path: Path, text: str, words: Sequence[str] = ()) -> str:
        path.write_text(text, encoding="ascii")
        ended = Processes().run([self._program, *words, str(path)], self._deadline, memory_mb=MEMORY_MB)
        if ended.timed_out:
            raise OutOfTimeError
        if ended.exit_code == 1:
            raise Rejected("what the certificate says is not enough")
        if ended.exit_code or ended.stderr:
            if ended.last_line.startswith(UNKNOWN):
                raise unsupported(ended.last_line.removeprefix(UNKNOWN))
            if ended.last_line.startswith("unreadable: "):
                raise Rejected(ended.last_line.removeprefix("unreadable: "))
            message = f"{NAME} failed with exit code {ended.exit_code} ({ended.last_line})"
            raise CheckerFailedError(f"{message}; please report this as a bug")
        return ended.stdout
