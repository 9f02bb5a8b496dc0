"""`robust certify` and `robust verify`: from options to certificate files, and from those to what they establish."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.bench.run import parse_end
from robust.errors import InputError, Location, RefutedError
from robust.irr.box import Box, Interval
from robust.numbers import shorten
from robust.plan.pddl.forms import read_bytes, read_text
from robust.report import options
from robust.report.guard import GivenUpError, Guard
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.certify.document import CertificateWriter
    from robust.encode.interface import Encoding
    from robust.plan.model import ParametrizedPlan
    from robust.qe.region import Region

CERTIFY = "robust/certify/1"
VERIFY = "robust/verify/1"
PLAN_FILES = ("domain", "problem", "plan")
CERTIFICATE = "a certificate as `robust certify` writes it"
GZIP = b"\x1f\x8b"


@dataclass(frozen=True)
class CertifyRequest:
    """The options as they were typed; one file is a plan with choices, three are a domain, a problem and a plan."""

    files: tuple[Path, ...]
    output: Path
    kind: str = "plan"
    box: Path | None = None
    alethe: Path | None = None
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    epsilon: str = "1/1000"
    encoding: str = "relational"
    solver: str = "z3"
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass(frozen=True)
class VerifyRequest:
    """The options as they were typed."""

    certificate: Path
    files: tuple[Path, ...] = ()
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    timeout: str | None = None
    json: bool = False


def run_certify(request: CertifyRequest, guard: Guard) -> int:
    """Write a certificate, have the checker read it, and say what it establishes.

    Raises:
        RobustError: wrong input, a claim that does not hold, or one that cannot be certified.
        GivenUpError: if interrupted or out of time.
    """
    epsilon = options.not_negative(request.epsilon, "--epsilon")
    limit = options.seconds(request.timeout, "--timeout")
    with Display(shown=request.progress, what="reading") as display, guard.working(limit):
        try:
            deadline = Deadline.after(guard.remaining(limit))
            started = time.perf_counter()
            if len(request.files) == 1:
                writer, holes = _knowledge(request, epsilon, deadline), None
            else:
                writer, holes = _plan(request, epsilon, deadline, display)
            size = writer.save(request.output)
            seconds = time.perf_counter() - started
            code, lines, checking = _checked(request.output, _inputs(request), deadline)
        except (KeyboardInterrupt, OutOfTimeError):
            raise GivenUpError from None
    if code:
        raise InputError(f"the checker does not accept the certificate: {lines[0]}; please report this as a bug")
    if request.json:
        print_json(
            {
                "schema": CERTIFY,
                "kind": "knowledge" if len(request.files) == 1 else request.kind,
                "certificate": str(request.output),
                "bytes": size,
                "seconds": round(seconds, 6),
                "checking_s": round(checking, 6),
                "established": _said(lines, "established"),
                "trusted": _said(lines, "trusted"),
                "alethe_holes": holes,
            }
        )
        return 0
    with answering():
        print(f"certificate: {request.output}, {size} bytes, checked")  # noqa: T201 - the answer
        if not request.quiet:
            print("\n".join(lines))  # noqa: T201 - the answer
            if holes is not None:
                print(f"alethe: {request.alethe}, {holes} holes")  # noqa: T201 - the answer
    return 0


def run_verify(request: VerifyRequest, guard: Guard) -> int:
    """Check a certificate in a process of its own; 0 established, 1 rejected.

    Raises:
        InputError: if the certificate or a file cannot be read.
        GivenUpError: if interrupted or out of time.
    """
    limit = options.seconds(request.timeout, "--timeout")
    place = Location(str(request.certificate))
    if not read_bytes(request.certificate, CERTIFICATE).startswith(GZIP):
        raise InputError(f"found a file that is not compressed by gzip, expected {CERTIFICATE}", place)
    inputs = _inputs(request)
    for file in inputs.values():
        read_bytes(file)
    with guard.working(limit):
        try:
            code, lines, seconds = _checked(request.certificate, inputs, Deadline.after(guard.remaining(limit)))
        except (KeyboardInterrupt, OutOfTimeError):
            raise GivenUpError from None
    if code == 2:
        raise InputError(f"cannot read ({lines[0].removeprefix('unreadable: ')}), expected {CERTIFICATE}", place)
    if not code and len(request.files) == 3:
        code, lines = _matched(request, lines, Deadline.after(guard.remaining(limit)))
    if request.json:
        print_json(
            {
                "schema": VERIFY,
                "verdict": "rejected" if code else "established",
                "established": _said(lines, "established"),
                "trusted": _said(lines, "trusted"),
                "matched": bool(_said(lines, "matched")),
                "reason": lines[0].removeprefix("rejected: ") if code else None,
                "seconds": round(seconds, 6),
            }
        )
    else:
        with answering():
            print("\n".join(lines))  # noqa: T201 - the answer
    return code


def _checked(certificate: Path, files: Mapping[str, Path], deadline: Deadline) -> tuple[int, tuple[str, ...], float]:
    from robust.certify.verify import verify  # noqa: PLC0415 - heavy

    started = time.perf_counter()
    found = verify(certificate, files, deadline)
    return found.outcome.value, found.lines, time.perf_counter() - started


def _matched(request: VerifyRequest, lines: tuple[str, ...], deadline: Deadline) -> tuple[int, tuple[str, ...]]:
    """The verdict once the certificate has been held against what this package makes of the files."""
    from robust.certify.document import mismatch  # noqa: PLC0415 - heavy
    from robust.plan.load import load_plan  # noqa: PLC0415

    plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
    found = mismatch(request.certificate, plan, deadline)
    if found is not None:
        return 1, (f"rejected: {request.certificate}: {found}",)
    return 0, (*lines, "matched: ground plan and formulas are what robust makes of these files")


def _said(lines: tuple[str, ...], what: str) -> list[str]:
    return [line.removeprefix(f"{what}: ") for line in lines if line.startswith(f"{what}: ")]


def _named(files: tuple[Path, ...]) -> dict[str, Path]:
    """Files by what they are."""
    if len(files) not in (0, 1, 3):
        raise InputError(f"found {len(files)} files, expected DOMAIN PROBLEM PLAN or one NETWORK")
    return {"network": files[0]} if len(files) == 1 else dict(zip(PLAN_FILES, files, strict=False))


def _inputs(request: CertifyRequest | VerifyRequest) -> dict[str, Path]:
    """All input files by what they are, with the domain and the problem that a network names."""
    named = _named(request.files)
    if len(request.files) == 1:
        from robust.pike_bridge.files import read_tpnu  # noqa: PLC0415 - heavy

        document = read_tpnu(request.files[0])
        named |= {"domain": document.beside(document.domain), "problem": document.beside(document.problem)}
    if request.parameter_file is not None:
        named["parameters"] = request.parameter_file
    return named


def _knowledge(request: CertifyRequest, epsilon: Fraction, deadline: Deadline) -> CertificateWriter:
    from robust.certify.produce import FormulaCertificate, digests  # noqa: PLC0415 - heavy
    from robust.certify.refute import NotRefutedError  # noqa: PLC0415
    from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415
    from robust.pike_bridge.semantics import Semantics  # noqa: PLC0415

    semantics = Semantics(load_team_plan(request.files[0], epsilon=epsilon))
    inputs = digests(_inputs(request))
    certificate = FormulaCertificate(semantics.terms, name="correct execution", inputs=inputs)
    try:
        certificate.add(semantics.formulas, deadline)
    except NotRefutedError:
        raise RefutedError(
            "the plan has a correct execution, so that its knowledge base is not empty; expected a plan without any",
            Location(str(request.files[0])),
        ) from None
    if request.alethe is not None:
        raise InputError("found --alethe with a plan with choices; expected it with DOMAIN PROBLEM PLAN")
    return certificate.writer


def _plan(
    request: CertifyRequest, epsilon: Fraction, deadline: Deadline, display: Display
) -> tuple[CertificateWriter, int | None]:
    from robust.certify.produce import PlanCertificate, digests  # noqa: PLC0415 - heavy
    from robust.encode import create_encoding  # noqa: PLC0415 - heavy
    from robust.plan.load import load_plan  # noqa: PLC0415

    named = _inputs(request)
    plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
    if request.kind in ("plan", "region") and request.box is not None:
        raise InputError(f"found --box with --kind {request.kind}; expected it with box or maximal")
    encoding = create_encoding(request.encoding, plan, epsilon, deadline)
    box = None if request.kind == "region" else _box(request, plan, epsilon, deadline)
    certificate = PlanCertificate(
        encoding,
        kind=request.kind,
        inputs=digests(named),
        box=box,
        solver=request.solver,
        deadline=deadline,
        on_obligation=display.obligation,
    )
    if box is None:
        certificate.add_region(_region(request, plan, epsilon, deadline))
    else:
        certificate.add_box()
    if request.kind == "maximal":
        certificate.add_witnesses()
    return certificate.writer, _alethe(request, encoding, box, deadline)


def _alethe(request: CertifyRequest, encoding: Encoding, box: Box | None, deadline: Deadline) -> int | None:
    if request.alethe is None:
        return None
    from robust.certify.verify import export  # noqa: PLC0415 - imports cvc5

    if box is None:
        raise InputError("found --alethe with --kind region; expected it with plan, box or maximal")
    return export(encoding, box, request.alethe, deadline)


def _region(request: CertifyRequest, plan: ParametrizedPlan, epsilon: Fraction, deadline: Deadline) -> Region:
    from robust.api import region  # noqa: PLC0415 - heavy

    found = region(plan, epsilon=epsilon, encoding=request.encoding, solver=request.solver, timeout=deadline.remaining)
    if not found.is_exact:
        raise OutOfTimeError
    return found.region


def _box(request: CertifyRequest, plan: ParametrizedPlan, epsilon: Fraction, deadline: Deadline) -> Box:
    """The nominal point, the box in a file, or the one that exact widening finds."""
    nominal = Box.nominal(plan.parameters)
    if request.kind == "plan":
        return nominal
    if request.box is not None:
        return _read_box(request.box, nominal)
    from robust.api import envelope  # noqa: PLC0415 - heavy
    from robust.irr.box import Status  # noqa: PLC0415

    found = envelope(
        plan, epsilon=epsilon, encoding=request.encoding, solver=request.solver, timeout=deadline.remaining
    )
    if found.status is Status.INVALID:
        raise RefutedError(f"the nominal point is outside of the envelope: {found.reason}; expected a valid plan")
    if found.status is not Status.COMPLETE:
        raise OutOfTimeError
    return found.box


def _read_box(path: Path, nominal: Box) -> Box:
    """The parameters of a JSON answer of `robust envelope` or `robust check`, or just those."""
    place = Location(str(path))
    try:
        document = json.loads(read_text(path))
        ends: Mapping[str, Any] = document.get("parameters", document)
        missing = nominal.intervals.keys() ^ ends.keys()
        if missing:
            raise InputError(f"found parameters that differ from the plan's in {sorted(missing)[0]!r}", place)
        return Box({name: _interval(ends[name]) for name in nominal.intervals})
    except (ValueError, AttributeError, TypeError, KeyError, RecursionError) as error:
        raise InputError(
            f"found {shorten(type(error).__name__)}, expected a box as `robust envelope --json` prints it", place
        ) from None


def _interval(ends: Mapping[str, Any]) -> Interval:
    lower, upper = parse_end(ends["lower"]), parse_end(ends["upper"])
    return Interval(lower, upper, bool(ends.get("lower_closed", True)), bool(ends.get("upper_closed", True)))
