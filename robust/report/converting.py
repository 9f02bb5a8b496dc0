"""`robust convert`: from options to a plan file."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, Location, RefutedError
from robust.numbers import format_number, shorten
from robust.plan.stn import write_stn
from robust.report import options
from robust.report.guard import GivenUpError, Guard
from robust.report.numbers import plural
from robust.report.output import answering, print_json
from robust.report.progress import Display

if TYPE_CHECKING:
    from robust.execute.convert import Conversion

CONVERT = "robust/convert/1"


@dataclass(frozen=True)
class ConvertRequest:
    """The options as they were typed."""

    files: tuple[Path, Path, Path]
    output: Path | None = None
    mode: str = "causal"
    specs: tuple[str, ...] = ()
    epsilon: str = "1/1000"
    solver: str = "z3"
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


def run_convert(request: ConvertRequest, guard: Guard) -> int:
    """Convert, write and print; 0, or 1 if the time-triggered plan is invalid.

    Raises:
        RobustError: wrong input, input that is not supported, or no proof.
        GivenUpError: if interrupted.
    """
    _check_output(request.output)
    epsilon = options.not_negative(request.epsilon, "--epsilon")
    limit = options.seconds(request.timeout, "--timeout")
    try:
        with Display(shown=request.progress, what="reading") as display, guard.working(limit):
            found = _converted(request, display, epsilon, guard.remaining(limit))
    except KeyboardInterrupt:
        raise GivenUpError from None
    except RefutedError as error:
        if not request.json:
            raise
        print_json(_invalid(request, epsilon, error))
        return error.exit_code
    written = _write(request, found)
    if request.json:
        print_json(_answer(request, epsilon, found, written))
    else:
        _print(request, found, written)
    return 0


def _converted(request: ConvertRequest, display: Display, epsilon: Fraction, timeout: float | None) -> Conversion:
    from robust.execute.convert import Mode, convert  # noqa: PLC0415 - imports solvers
    from robust.plan.parameters import parse_specs  # noqa: PLC0415 - likewise
    from robust.plan.pddl.reader import read_domain, read_problem  # noqa: PLC0415 - likewise
    from robust.plan.timed import read_timed_plan  # noqa: PLC0415 - likewise

    domain_file, problem_file, plan_file = request.files
    specs = parse_specs(request.specs)
    domain = read_domain(domain_file)
    problem = read_problem(problem_file, domain)
    return convert(
        domain,
        problem,
        read_timed_plan(plan_file),
        mode=Mode(request.mode),
        specs=specs,
        epsilon=epsilon,
        solver=request.solver,
        timeout=timeout,
        on_progress=display.say,
    )


# -- files -------------------------------------------------------------------------------------------------------------


def _check_output(path: Path | None) -> None:
    """InputError unless a plan can be written there: better known before anything is proved."""
    if path is None:
        return
    place = Location("--output")
    if not path.parent.is_dir():
        raise InputError(f"found no directory {shorten(str(path.parent))}, expected one to write the plan to", place)
    if path.suffix == ".toml":
        raise InputError(f"found {shorten(str(path))}, expected a plan's name: parameters go to .toml files", place)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"cannot write {shorten(str(path))}, expected a file that can be written", place)


def _write(request: ConvertRequest, found: Conversion) -> Mapping[str, str]:
    """Write the files that are asked for: the plan, and the parameters that it cannot hold by itself; their names."""
    from robust.execute.parametrization import write_specs  # noqa: PLC0415 - imports the grammar

    if request.output is None:
        return {}
    beside = write_specs(found.beside)
    request.output.write_text(write_stn(found.stn), encoding="utf-8")
    written = {"plan": str(request.output)}
    if beside:
        parameters = request.output.with_suffix(".toml")
        parameters.write_text(beside, encoding="utf-8")
        written["parameters"] = str(parameters)
    return written


# -- answers -----------------------------------------------------------------------------------------------------------


def _print(request: ConvertRequest, found: Conversion, written: Mapping[str, str]) -> None:
    with answering():
        if not written:
            sys.stdout.write(write_stn(found.stn))
    stream = sys.stdout if written else sys.stderr
    if request.quiet:
        return
    for line in _summary(found, written):
        print(line, file=stream)


def _summary(found: Conversion, written: Mapping[str, str]) -> list[str]:
    instances, constraints = len(found.stn.instances), len(found.stn.constraints)
    size = f"{plural(instances, 'instance')}, {plural(constraints, 'constraint')}"
    lines = [f"{found.check.answer.value}: {size}, {plural(len(found.stn.parameters), 'parameter')}"]
    broken = next(iter(found.check.counterexamples), None)
    if broken is not None:
        lines.append(f"an allowed schedule breaks {broken}; --mode causal gives a network that is proved")
    for one in found.tightened:
        lines.append(
            f"needed: {one.edge.target} - {one.edge.source} >= {format_number(one.edge.weight)} for {one.obligation}"
        )
    if "plan" in written:
        lines.append(f"plan: {written['plan']}")
    if "parameters" in written:
        lines.append(f"parameters: {written['parameters']}, for --parameters")
    elif found.beside:
        from robust.execute.parametrization import option_of  # noqa: PLC0415 - imports the grammar

        given = " ".join(f"--parameter {shlex.quote(option_of(spec))}" for spec in found.beside)
        lines.append(f"reading this plan needs {given}")
    return lines


def _answer(
    request: ConvertRequest, epsilon: Fraction, found: Conversion, written: Mapping[str, str]
) -> dict[str, Any]:
    from robust.execute.parametrization import write_specs  # noqa: PLC0415 - imports the grammar

    return {
        **_head(request, epsilon, found.check.answer.value),
        "stn": write_stn(found.stn),
        "parameters": [one.name for one in found.plan.parameters],
        "parameter_file": write_specs(found.beside) or None,
        "files": dict(written),
        "schedule": {str(point): str(time) for point, time in found.schedule.items()},
        "instances": len(found.stn.instances),
        "constraints": len(found.stn.constraints),
        "redundant": found.redundant,
        "obligations": len(found.check.obligations),
        "tightened": [
            {
                "source": str(one.edge.source),
                "target": str(one.edge.target),
                "lower": str(one.edge.weight),
                "own": str(one.own),
                "obligation": one.obligation,
            }
            for one in found.tightened
        ],
        "violations": [],
    }


def _invalid(request: ConvertRequest, epsilon: Fraction, error: RefutedError) -> dict[str, Any]:
    from robust.execute.distances import InvalidPlanError  # noqa: PLC0415 - imports the grammar

    found = error.violations if isinstance(error, InvalidPlanError) else ()
    violations = [{"obligation": one.obligation, "time": str(one.time), "detail": one.detail} for one in found]
    return {
        **_head(request, epsilon, "invalid"),
        "stn": None,
        "parameters": [],
        "parameter_file": None,
        "files": {},
        "schedule": {},
        "instances": 0,
        "constraints": 0,
        "redundant": 0,
        "obligations": 0,
        "tightened": [],
        "violations": violations,
    }


def _head(request: ConvertRequest, epsilon: Fraction, verdict: str) -> dict[str, Any]:
    return {
        "schema": CONVERT,
        "verdict": verdict,
        "mode": request.mode,
        "solver": request.solver,
        "epsilon": str(epsilon),
    }
