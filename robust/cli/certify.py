"""`robust certify` and `robust verify`: certificate files, and what they establish."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from robust import json_text, records
from robust.certify import CheckerOutcome, Demanded, Verification
from robust.certify import verify as checked
from robust.cli.guard import Run, action
from robust.errors import InputError, Location, RefutedError, UnsupportedError
from robust.numbers import exact_end, quoted, shorten
from robust.options.batch import CertifyCommand, VerifyCommand
from robust.options.declare import place_of, refuse_replacing, settings
from robust.plan.load import domain_parameters
from robust.plan.parameters import ParameterSpec, Target, specifications, wire
from robust.plan.pddl.forms import read_bytes, read_plan_text, read_text
from robust.plan.stn import is_network, parse_stn, write_stn
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.certify.kernel.run import Opinion
    from robust.execute.convert import Conversion
    from robust.irr.search import EnvelopeResult
    from robust.irr.templates import Shape
    from robust.plan.model import ParametrizedPlan
    from robust.qe.region import Region
    from robust.show.console import Console
    from robust.show.documents import CheckedBy

CERTIFICATE = "a certificate as `robust certify` writes it"
GZIP = b"\x1f\x8b"
LARGEST = 2**27
"""Bytes of a certificate."""


@action(CertifyCommand)
def certify(options: CertifyCommand, run: Run) -> int:
    """Write a certificate that a plan is valid, or what executions a plan with choices has, and check it."""
    _files(options)
    written: dict[Path, str | bytes] = {}

    def work(folder: Path) -> tuple[int | None, float, Verification, float]:
        from robust.certify.tape import packed

        deadline = Deadline.after(run.remaining)
        started = time.perf_counter()
        files = options.files
        if len(files) == 3 and (network := _network(options, run)):
            written.update(network)
            for path, text in network.items():
                (folder / path.name).write_text(text, encoding="utf-8")
            files = (*files[:2], folder / next(iter(network)).name)
        lines, holes = _lines(options.changed(files=files), deadline, run)
        written[options.output] = packed(lines)
        produced = time.perf_counter()
        certificate = folder / "certificate"
        certificate.write_bytes(packed(lines))
        kind = {"corners": "box"}.get(lines[0][1], lines[0][1])
        report = checked(certificate, files, Demanded(options.separation, kind, assume=options.assume), deadline)
        return holes, produced - started, report, time.perf_counter() - produced

    with TemporaryDirectory(prefix="robust-certificate-") as folder:
        holes, seconds, report, checking = run.only(lambda: work(Path(folder)))
    size = len(written[options.output])
    if report.outcome.value:
        reason = report.answer["reason"]
        raise InputError(f"the checker does not accept the certificate: {reason}; please report this as a bug")

    from robust.show import documents

    answer = documents.Certify(
        certificate=str(options.output),
        bytes=size,
        seconds=round(seconds, 6),
        checking_s=round(checking, 6),
        alethe_holes=holes,
        **{key: report.answer[key] for key in ("kind", "claim", "epsilon", "files", "obligations", "refuted")},
    )

    def tell(out: Console) -> None:
        out.line(f"certificate: {options.output}, {size} bytes, checked")
        if not options.quiet:
            out.line("\n".join(_shown(report)))
            if holes is not None:
                out.line(f"alethe: {options.alethe}, {holes} holes")

    run.answer(lambda: documents.document(answer), tell)
    for path, content in written.items():
        run.write(partial(records.atomic_write, path, content, place_of("output")))
    return 0


@action(VerifyCommand)
def verify(options: VerifyCommand, run: Run) -> int:
    """Say what a certificate establishes of the files; 1 if it is rejected, or if less than is asked for."""
    place = Location(str(options.certificate))
    if not run.only(lambda: read_bytes(options.certificate, CERTIFICATE, LARGEST)).startswith(GZIP):
        raise InputError(f"found a file that is not compressed by gzip, expected {CERTIFICATE}", place)
    for file in _files(options):
        run.only(partial(read_text, file))
    run.only(partial(_require_network, options))
    run.only(partial(specifications, (), None, options.files[-1]))  # reads what is beside it
    box = run.only(lambda: demanded_box(options.box))

    def work() -> list[Opinion]:
        from robust.certify.kernel.run import opinions

        demanded = Demanded(options.separation, options.kind, box, options.assume)
        return opinions(options.checker, options.certificate, options.files, demanded, Deadline.after(run.remaining))

    opinions = run.only(work)

    from robust.certify.kernel.run import TRUSTED, TRUSTED_OF_CHOICES
    from robust.show import documents

    trusted = TRUSTED if len(options.files) == 3 else TRUSTED_OF_CHOICES

    for opinion in opinions:
        answer, outcome = opinion.verification.answer, opinion.verification.outcome
        if outcome is CheckerOutcome.UNREADABLE:
            raise InputError(f"cannot read ({answer['reason']}), expected {CERTIFICATE}", place)
        if outcome is CheckerOutcome.UNSUPPORTED and (opinion.checker != "kernel" or options.checker is not None):
            names = ", ".join(map(quoted, options.files))
            raise UnsupportedError(f"the checker of certificates does not read one of {names}: {answer['reason']}")
    deciding = [each for each in opinions if options.checker is not None or each.checker == "python"]
    rejecting = [each for each in deciding if each.verification.outcome is CheckerOutcome.REJECTED]
    report = (rejecting or opinions)[0].verification
    checkers = [
        documents.CheckedBy(
            checker=each.checker,
            verdict=each.verification.answer["verdict"],
            reason=each.verification.answer.get("reason"),
            trusts=trusted[each.checker],
            seconds=round(each.seconds, 6),
        )
        for each in opinions
    ]
    said = ("kind", "claim", "epsilon", "box", "obligations", "refuted", "reason")
    document = documents.Verify(
        verdict=report.answer["verdict"],
        files=report.answer["files"],
        checkers=checkers,
        seconds=round(sum(each.seconds for each in opinions), 6),
        **{key: report.answer.get(key) for key in said},
    )
    lines = [*_shown(report), *(map(_spoken, checkers) if len(opinions) > 1 or not rejecting else ())]
    run.answer(lambda: documents.document(document), lambda out: out.line("\n".join(lines)))
    return int(report.outcome.value)


def _spoken(by: CheckedBy) -> str:
    """Who has checked it, and what has to be trusted."""
    if by.verdict == "established":
        return f"by {by.checker}, trusting {by.trusts}"
    return f"by {by.checker}: {by.verdict}, {by.reason}"


def _shown(report: Verification) -> list[str]:
    """The checker's answer, as it prints it itself."""
    answer = report.answer
    if report.outcome.value:
        return [f"{answer['verdict']}: {answer['reason']}"]
    digests = [f"of {kind}: sha256 {digest}" for kind, digest in answer["files"].items()]
    refuted = answer.get("refuted")
    counts = f"checked: {answer['obligations']} obligations"
    counts += "" if refuted is None else f", {refuted} of them not constant"
    return [f"{answer['verdict']}: {answer['claim']}", *digests, counts]


def _files(options: CertifyCommand | VerifyCommand) -> tuple[Path, ...]:
    if len(options.files) not in (1, 3):
        raise InputError(f"found {len(options.files)} files, expected DOMAIN PROBLEM PLAN or one NETWORK")
    return options.files


def _require_network(options: VerifyCommand) -> None:
    """InputError if the plan is one of steps: a certificate is about the network that is made of them."""
    plan = options.files[-1]
    if len(options.files) == 3 and not is_network(read_text(plan), str(plan)):
        beside = options.certificate.with_suffix(".stn")
        written = str(beside) if beside.is_file() else "the .stn file that `robust certify` wrote"
        place = Location(str(plan))
        raise InputError(f"found a plan of steps, expected the network of the certificate: {written}", place)


def _network(options: CertifyCommand, run: Run) -> dict[Path, str]:
    """What is written beside the certificate, because it is about that: a network that is made of steps, or that other
    parameters than its own are put into, first; and a file of those that are not in the network."""
    from robust.execute.parametrization import with_deadline, with_relative_weights, write_specs

    plan = options.files[2]
    specs, beside = specifications(options.parameter, options.parameters, plan)
    text, file = read_plan_text(plan)
    demanding = options.deadline is not None or options.relative
    if is_network(text, file) and not specs and not demanding and str(plan) != "-":
        return {}
    target = options.output.with_suffix(".stn")
    parameters = target.with_suffix(".toml")
    _refuse(options, (target, parameters), (plan, beside, options.parameters))
    notes: list[str] = [] if beside is None else [f"took the parameters of {beside}"]
    if not is_network(text, file):
        conversion, more = _network_of_steps(options, run, text, file, specs)
        network, named = _parametrized(options, write_stn(conversion.stn), file, conversion.beside)
        notes += more
    elif specs or demanding:
        asked = with_deadline(parse_stn(text, file), options.deadline, place_of("deadline"))
        network, named = _parametrized(options, write_stn(asked), file, specs)
        network = write_stn(with_relative_weights(parse_stn(network, file))) if options.relative else network
    else:
        network, named = text, ()
    contents = {target: network}
    if named or parameters.exists():  # which is found there by whoever reads the network
        contents[parameters] = write_specs(named)
    about = " and ".join(map(str, contents))
    run.note(f"{file}: {'; '.join((*notes, f'the certificate is about {about}'))}")
    return contents


def _refuse(options: CertifyCommand, written: Sequence[Path], read: Sequence[Path | None]) -> None:
    """InputError if what is written beside the certificate would replace that, a file that is read, or any other one
    without --force."""
    taken = next((path for path in written if path in (options.output, *read)), None)
    if taken is not None:
        message = f"found {taken}, which belongs to another plan than the certificate; expected another name"
        raise InputError(message, place_of("output"))
    refuse_replacing(written, place_of("output"), force=options.force)


def _parametrized(
    options: CertifyCommand, text: str, file: str, specs: Sequence[ParameterSpec]
) -> tuple[str, Sequence[ParameterSpec]]:
    """A network with all its parameters, and what those stand for that are not only in the network."""
    from dataclasses import replace

    from robust.plan.pddl.grounding import initial_fluents
    from robust.reading import domain_and_problem

    domain, problem = domain_and_problem(*options.files[:2])
    stn = parse_stn(text, file)
    needed = options.kind != "region"
    fluents = initial_fluents(problem)
    wiring = wire(stn, specs, fluents, domain_parameters(domain, stn), nominal_needed=needed)
    named = [ParameterSpec(Target.DURATION, instance, name) for instance, name in wiring.durations.items()]
    named += [ParameterSpec(Target.FLUENT, str(fluent), name) for fluent, name in wiring.fluents.items()]
    return write_stn(replace(stn, parameters=wiring.parameters, constraints=wiring.constraints)), named


def _network_of_steps(
    options: CertifyCommand, run: Run, text: str, file: str, specs: Sequence[ParameterSpec]
) -> tuple[Conversion, Sequence[str]]:
    from robust.execute.convert import ConversionEnd, convert
    from robust.plan.timed import parse_timed_plan
    from robust.reading import conversion_settings, domain_and_problem

    parsed = domain_and_problem(*options.files[:2])
    timed = parse_timed_plan(text, file, options.plan_number)
    remaining = None if run.remaining is None else run.remaining / 2
    settings = conversion_settings(options, specs, remaining, run.display.say)
    conversion = convert(*parsed, timed, settings)
    if conversion.ended is ConversionEnd.INTERRUPTED:
        raise KeyboardInterrupt
    return conversion, conversion.notes(timed)


def _lines(options: CertifyCommand, deadline: Deadline, run: Run) -> tuple[list[Any], int | None]:
    from robust.certify.produce import PlanCertificate
    from robust.reading import load_plan

    if len(options.files) == 1:
        return _of_choices(options, deadline), None
    plan = load_plan(*options.files, nominal_needed=options.kind != "region")
    certificate = PlanCertificate(
        options.files,
        plan,
        options.separation,
        encoding=options.encoding,
        solver=options.solver,
        deadline=deadline,
        on_obligation=run.display.obligation,
    )
    if options.kind == "region":
        return certificate.of_region(_region(options, plan, deadline)), None
    if options.kind == "shape":
        return certificate.of_shape(_shape(options, plan, deadline)), None
    box = _box(options, plan, deadline)
    plain = options.kind in (None, "plan")
    lines = certificate.of_plan() if plain else certificate.of_box(box, maximal=options.kind == "maximal")
    if options.alethe is None:
        return lines, None
    from robust.certify.produce import export
    from robust.encode import create_encoding

    encoding = create_encoding(options.encoding, plan, options.separation, deadline)
    return lines, export(encoding, box, options.alethe, deadline)


def _of_choices(options: CertifyCommand, deadline: Deadline) -> list[Any]:
    """The certificate that a plan with choices has a correct execution, or that it has none: as asked for, or true."""
    from robust.certify.produce import execution, knowledge
    from robust.pike import assumed
    from robust.pike_bridge.action_model import load_team_plan
    from robust.pike_bridge.semantics import ExecutionExistence, Oracle

    (network,) = options.files
    plan = load_team_plan(network, epsilon=options.separation)
    choices = {assignment.variable: assignment.value for assignment in sorted(assumed(plan, options.assume))}
    if options.kind == "knowledge":
        return knowledge(network, options.separation, deadline, choices)
    decision = Oracle(plan, solver=options.solver).decide(assumed(plan, options.assume), deadline=deadline)
    if decision.verdict is ExecutionExistence.UNKNOWN:
        raise OutOfTimeError
    if decision.witness is not None:
        return execution(network, options.separation, decision.witness.scenario, decision.witness.schedule)
    if options.kind is None:
        return knowledge(network, options.separation, deadline, choices)
    reason = "there is no correct execution of the plan with choices; `--kind knowledge` certifies that"
    raise RefutedError(reason, Location(str(network)))


def _region(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline) -> Region:
    from robust.api import region

    result = region(
        plan, epsilon=options.separation, encoding=options.encoding, solver=options.solver, timeout=deadline.remaining
    )
    if result.sliced:
        raise UnsupportedError(f"the envelope is known by bounds only ({result.reason}), expected --kind box")
    if not result.is_exact:
        raise OutOfTimeError(result.reason)
    return result.region if result.lifted is None else result.lifted


def _box(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline) -> Box:
    """The nominal point, the box in a file, or the one that exact widening finds."""
    nominal = Box.nominal(plan.parameters)
    if options.kind in (None, "plan"):
        return nominal
    if options.box is not None:
        return read_box(options.box, nominal)
    return _envelope(options, plan, deadline, "box").box


def _shape(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline) -> Shape:
    shape = _envelope(options, plan, deadline, options.shape).shape
    if shape is None:
        raise UnsupportedError("found no parameters, expected some that a shape bounds")
    return shape


def _envelope(options: CertifyCommand, plan: ParametrizedPlan, deadline: Deadline, shape: str) -> EnvelopeResult:
    from robust.api import envelope
    from robust.searching import Status

    result = envelope(
        plan,
        epsilon=options.separation,
        encoding=options.encoding,
        solver=options.solver,
        shape=shape,
        timeout=deadline.remaining,
    )
    if result.status is Status.INVALID:
        raise RefutedError(f"the nominal point is outside of the envelope: {result.reason}; expected a valid plan")
    if result.status is not Status.COMPLETE:
        raise OutOfTimeError(result.reason)
    return result


def demanded_box(texts: Sequence[str]) -> str | None:
    """The box that the checker is asked about: the name of a file, or values of parameters in the same format."""
    files = [text for text in texts if "=" not in text or Path(text).is_file()]
    if files:
        if len(texts) > 1:
            expected = "one FILE, or NAME=LOW:HIGH, which may be repeated"
            raise InputError(f"found {shorten(files[0])} and something else, expected {expected}", place_of("box"))
        read_bytes(Path(files[0]))
        return str(Path(files[0]).absolute())
    shown = {
        name: {"lower": exact_end(interval.lower, upper=False), "upper": exact_end(interval.upper, upper=True)}
        for name, interval in settings(texts, None, "box").items()
    }
    return json.dumps({"parameters": shown}) if texts else None


def read_box(path: Path, nominal: Box) -> Box:
    """The parameters of a JSON answer of `robust envelope` or `robust check`, or just those.

    Raises:
        InputError: where the file is not JSON, or not such an answer about these parameters.
    """
    place, text = Location(str(path)), read_text(path)
    expected = "a box as `robust envelope --json` prints it"
    json_text.parse_json(text, str(path))  # which says where it is none
    document = json.loads(text)
    answer = document if isinstance(document, dict) else {}
    ends = answer.get("parameters", answer)
    if not isinstance(ends, dict) or not isinstance(document, dict):
        raise InputError(f"found {shorten(json.dumps(document))}, expected {expected}", place)
    if not answer.get("verified", True):
        raise InputError("the envelope has no verified box; give one that has", place)
    missing = nominal.intervals.keys() ^ ends.keys()
    if missing:
        raise InputError(f"found parameters that differ from the plan's in {sorted(missing)[0]!r}", place)
    return Box({name: _interval(name, ends[name], place, expected) for name in nominal.intervals})


def _interval(name: str, ends: Any, place: Location, expected: str) -> Interval:
    try:
        return Interval.from_dict(ends)
    except (ValueError, AttributeError, TypeError, KeyError):
        found = shorten(json.dumps(ends))
        raise InputError(f"found {found} as the ends of {name!r}, expected {expected}", place) from None
