"""Certificates for tests: made, taken apart, and judged by the checker in this process."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust import Box, ParametrizedPlan, envelope, region
from robust.certify.checker import __main__ as main
from robust.certify.checker import choices, claims, corners, formulas, proofs, reader
from robust.certify.hints import Line
from robust.certify.produce import PlanCertificate
from robust.certify.tape import write
from robust.encode.encoding import RelationalEncoding
from robust.plan.load import assemble
from robust.plan.parameters import parse_parameter_file, toml_document
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn
from robust.qe.lifted import LiftedRegion, lifted_envelope
from robust.qe.nnf import FormulaReader
from robust.reading import load_plan
from robust.smt.limits import NEVER
from tests.certify.texts import Texts

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
NAVIGATION = tuple(EXAMPLES / "two_sample_navigation" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
GENERATOR = tuple(EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
EPSILON = Fraction(1, 1000)
Holds = Callable[["Checker"], bool]
"""Whether a checker does something right."""


@dataclass(frozen=True)
class Checker:
    """The checker's modules: those of this package, or changed ones."""

    reader: Any
    formulas: Any
    proofs: Any
    corners: Any
    claims: Any
    choices: Any
    main: Any


CHECKER = Checker(reader, formulas, proofs, corners, claims, choices, main)

MALFORMED = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What the checker's command takes for a malformed certificate; anything else is a fault of the checker."""


def put(values: list[Any], place: int, *new: Any) -> list[Any]:
    """The values with others in one place, or none."""
    return [*values[:place], *new, *values[place + 1 :]]


def made(files: Sequence[Path], kind: str, *, box: Box | None = None, epsilon: Fraction = EPSILON) -> list[Line]:
    """The lines of a certificate of the plan in `files`."""
    beside = files[2].with_suffix(".toml")
    plan = load_plan(*files, parameter_file=beside if beside.is_file() else None)
    certificate = PlanCertificate(tuple(files), plan, epsilon)
    if kind == "plan":
        return certificate.of_plan()
    if kind == "shape":
        return certificate.of_shape(envelope(plan, epsilon=epsilon, shape="octagon").shape)
    if kind == "region":
        return certificate.of_region(region(plan, epsilon=epsilon).region)
    return certificate.of_box(box or envelope(plan, epsilon=epsilon).box, maximal=kind == "maximal")


def written(texts: Texts, directory: Path) -> tuple[Path, ...]:
    """The files of a plan."""
    directory.mkdir(exist_ok=True)
    paths = tuple(directory / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def kept(path: Path, content: bytes) -> str:
    """A file with this content."""
    path.write_bytes(content)
    return str(path)


def assembled(texts: Sequence[str]) -> ParametrizedPlan:
    """What this package reads in domain, problem, plan, and perhaps the file of parameters beside it."""
    domain = parse_domain(texts[0])
    specs = parse_parameter_file(texts[3]) if "parameters" in toml_document("".join(texts[3:]), "beside") else ()
    return assemble(domain, parse_problem(texts[1], domain), parse_stn(texts[2]), specs, nominal_needed=False)


def lifted(plan: ParametrizedPlan) -> LiftedRegion | None:
    """The envelope as difference constraints between times, if one order is left and it is not empty."""
    encoding = RelationalEncoding(plan)
    known = lifted_envelope(encoding, FormulaReader(encoding.terms), NEVER)
    return None if known is None or known.is_empty else known


def grounded(files: Iterable[Path]) -> reader.Ground:
    """What the checker reads in the files."""
    return reader.ground(*(path.read_text(encoding="utf-8") for path in files))


def checked(by: Checker, ground: Any, lines: Sequence[Any], epsilon: Fraction = EPSILON) -> Any:
    """The claim that a certificate establishes, with the checker's exceptions."""
    tape = by.proofs.Tape(line if isinstance(line, str) else json.dumps(line) for line in lines[1:])
    _, kind, box = lines[0]
    return by.claims.check(tape, ground, kind, box, epsilon)


def attempted(check: Callable[[], Any], by: Checker = CHECKER) -> Any:
    """What is claimed, or why it is rejected."""
    try:
        return check()
    except (by.proofs.Rejected, by.reader.Unsupported) as error:
        return str(error)
    except MALFORMED as error:
        return type(error).__name__


def judged(lines: Sequence[Any], ground: Any, *, epsilon: Fraction = EPSILON, by: Checker = CHECKER) -> Any:
    """The claim that a certificate establishes, or why it is rejected."""
    return attempted(lambda: checked(by, ground, lines, epsilon), by)


def command(lines: Sequence[Line], path: Path, files: Sequence[Path], **demanded: object) -> tuple[int, dict]:
    """Exit code and answer of the checker's command."""
    write(lines, path)
    return ask(path, files, **demanded)


def ask(path: Path, files: Sequence[Path], *, by: Checker = CHECKER, **demanded: object) -> tuple[int, dict]:
    words = {"kind": None, "box": None, "assume": [], "epsilon": "1/1000", **demanded}
    arguments = Namespace(certificate=str(path), files=[*map(str, files)], **words)
    code, answer = by.main.report(arguments, by.main.Inputs())
    return int(code), dict(answer)
