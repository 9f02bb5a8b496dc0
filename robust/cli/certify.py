"""`robust certify` and `robust verify`: certificate files, and what they establish."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.cli.build import action
from robust.errors import InputError, Location, RefutedError
from robust.numbers import parse_end, shorten
from robust.options import CertifyCommand, VerifyCommand
from robust.plan.load import load_plan
from robust.plan.pddl.forms import read_bytes, read_text
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from rich.console import Console

    from robust.certify.document import CertificateWriter
    from robust.cli.guard import Run
    from robust.plan.model import ParametrizedPlan
    from robust.qe.region import Region

PLAN_FILES = ("domain", "problem", "plan")
CERTIFICATE = "a certificate as `robust certify` writes it"
GZIP = b"\x1f\x8b"


@action(CertifyCommand)
def certify(options: CertifyCommand, run: Run) -> int:
    """Write a certificate that a plan is valid, or that a plan with choices has no correct execution, and check it."""

    def work() -> tuple[int, int | None, float, int, tuple[str, ...], float]:
        deadline = Deadline.after(run.remaining)
        started = time.perf_counter()
        holes = None
        if len(options.files) == 1:
            writer = _knowledge(options, deadline)
        else:
            writer, holes = _plan(options, deadline, run)
        size = writer.save(options.output)
        seconds = time.perf_counter() - started
        return size, holes, seconds, *_checked(options.output, _inputs(options), deadline)

    size, holes, seconds, code, lines, checking = run.only(work)
    if code:
        raise InputError(f"the checker does not accept the certificate: {lines[0]}; please report this as a bug")

    from robust.show import documents, made

    answer = made.Certify(
        kind="knowledge" if len(options.files) == 1 else options.kind,
        certificate=str(options.output),
        bytes=size,
        seconds=round(seconds, 6),
        checking_s=round(checking, 6),
        established=_said(lines, "established"),
        trusted=_said(lines, "trusted"),
        alethe_holes=holes,
    )

    def tell(_out: Console) -> None:
        print(f"certificate: {options.output}, {size} bytes, checked")
        if not options.quiet:
            print("\n".join(lines))
            if holes is not None:
                print(f"alethe: {options.alethe}, {holes} holes")

    run.answer(lambda: documents.document(answer), tell)
    return 0


@action(VerifyCommand)
def verify(options: VerifyCommand, run: Run) -> int:
    """Say what a certificate establishes, and what is still trusted; 1 if it is rejected."""
    place = Location(str(options.certificate))
    if not read_bytes(options.certificate, CERTIFICATE).startswith(GZIP):
        raise InputError(f"found a file that is not compressed by gzip, expected {CERTIFICATE}", place)
    inputs = _inputs(options)
    for file in inputs.values():
        read_bytes(file)
    code, lines, seconds = run.only(lambda: _checked(options.certificate, inputs, Deadline.after(run.remaining)))
    if code == 2:
        raise InputError(f"cannot read ({lines[0].removeprefix('unreadable: ')}), expected {CERTIFICATE}", place)
    if not code and len(options.files) == 3:
        code, lines = _matched(options, lines, Deadline.after(run.remaining))

    from robust.show import documents, made

    answer = made.Verify(
        verdict="rejected" if code else "established",
        established=_said(lines, "established"),
        trusted=_said(lines, "trusted"),
        matched=bool(_said(lines, "matched")),
        reason=lines[0].removeprefix("rejected: ") if code else None,
        seconds=round(seconds, 6),
    )
    run.answer(lambda: documents.document(answer), lambda _out: print("\n".join(lines)))
    return code


def _checked(certificate: Path, files: Mapping[str, Path], deadline: Deadline) -> tuple[int, tuple[str, ...], float]:
    from robust.certify.verify import verify

    started = time.perf_counter()
    found = verify(certificate, files, deadline)
    return found.outcome.value, found.lines, time.perf_counter() - started


def _matched(options: VerifyCommand, lines: tuple[str, ...], deadline: Deadline) -> tuple[int, tuple[str, ...]]:
    """The verdict once the certificate has been held against what this package makes of the files."""
    from robust.certify.document import mismatch

    plan = load_plan(*options.files, parameters=options.parameter, parameter_file=options.parameters)
    found = mismatch(options.certificate, plan, deadline)
    if found is not None:
        return 1, (f"rejected: {options.certificate}: {found}",)
    return 0, (*lines, "matched: ground plan and formulas are what robust makes of these files")


def _said(lines: tuple[str, ...], what: str) -> list[str]:
    return [line.removeprefix(f"{what}: ") for line in lines if line.startswith(f"{what}: ")]


def _inputs(options: CertifyCommand | VerifyCommand) -> dict[str, Path]:
    """All input files by what they are, with the domain and the problem that a network names."""
    files = options.files
    if len(files) not in (0, 1, 3):
        raise InputError(f"found {len(files)} files, expected DOMAIN PROBLEM PLAN or one NETWORK")
    named = {"network": files[0]} if len(files) == 1 else dict(zip(PLAN_FILES, files, strict=False))
    if len(files) == 1:
        from robust.pike_bridge.files import read_tpnu

        document = read_tpnu(files[0])
        named |= {"domain": document.beside(document.domain), "problem": document.beside(document.problem)}
    if options.parameters is not None:
        named["parameters"] = options.parameters
    return named


def _knowledge(options: CertifyCommand, deadline: Deadline) -> CertificateWriter:
    from robust.certify.produce import FormulaCertificate, digests
    from robust.certify.refute import NotRefutedError
    from robust.pike_bridge.action_model import load_team_plan
    from robust.pike_bridge.semantics import Semantics

    semantics = Semantics(load_team_plan(options.files[0], epsilon=options.separation))
    inputs = digests(_inputs(options))
    certificate = FormulaCertificate(semantics.terms, name="correct execution", inputs=inputs)
    try:
        certificate.add(semantics.formulas, deadline)
    except NotRefutedError:
        raise RefutedError(
            "the plan has a correct execution, so that its knowledge base is not empty; expected a plan without any",
            Location(str(options.files[0])),
        ) from None
    return certificate.writer


def _plan(options: CertifyCommand, deadline: Deadline, run: Run) -> tuple[CertificateWriter, int | None]:
    from robust.certify.produce import PlanCertificate, digests
    from robust.encode import create_encoding

    named = _inputs(options)
    plan = load_plan(*options.files, parameters=options.parameter, parameter_file=options.parameters)
    encoding = create_encoding(options.encoding, plan, options.separation, deadline)
    box = None if options.kind == "region" else _box(options, plan, deadline)
    certificate = PlanCertificate(
        encoding,
        kind=options.kind,
        inputs=digests(named),
        box=box,
        solver=options.solver,
        deadline=deadline,
        on_obligation=run.display.obligation,
    )
    if box is None:
        certificate.add_region(_region(options, plan, deadline))
    else:
        certificate.add_box()
    if options.kind == "maximal":
        certificate.add_witnesses()
    if options.alethe is None or box is None:
        return certificate.writer, None
    from robust.certify.verify import export

    return certificate.writer, export(encoding, box, options.alethe, deadline)


def _region(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline) -> Region:
    from robust.api import region

    found = region(
        plan, epsilon=options.separation, encoding=options.encoding, solver=options.solver, timeout=deadline.remaining
    )
    if not found.is_exact:
        raise OutOfTimeError(found.reason)
    return found.region


def _box(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline) -> Box:
    """The nominal point, the box in a file, or the one that exact widening finds."""
    nominal = Box.nominal(plan.parameters)
    if options.kind == "plan":
        return nominal
    if options.box is not None:
        return read_box(options.box, nominal)
    from robust.api import envelope
    from robust.irr.search import Status

    found = envelope(
        plan, epsilon=options.separation, encoding=options.encoding, solver=options.solver, timeout=deadline.remaining
    )
    if found.status is Status.INVALID:
        raise RefutedError(f"the nominal point is outside of the envelope: {found.reason}; expected a valid plan")
    if found.status is not Status.COMPLETE:
        raise OutOfTimeError(found.reason)
    return found.box


def read_box(path: Path, nominal: Box) -> Box:
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
