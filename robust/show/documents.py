"""What `--json` prints, as types: the fields, what they mean, and how they come from results.

The published schemas in :mod:`robust.show.schemas` are those of these types. An object that `--json` prints is one of
:data:`DOCUMENTS`, and names itself in `schema`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from msgspec import UNSET, Meta, UnsetType

from robust.backends import ENCODINGS, OFFERED, SOLVERS
from robust.codec import Count, End, JsonObject, Rational, Seconds, about, one_of, plain
from robust.errors import RobustError
from robust.numbers import exact_end

if TYPE_CHECKING:
    from robust.execute.controllability.assess import ControllabilityReport
    from robust.execute.controllability.boxes import Loss
    from robust.irr import check as checks
    from robust.irr import compare as compares
    from robust.irr.search import EnvelopeResult
    from robust.options import CheckCommand
    from robust.plan.simulate import Violation
    from robust.qe.box import Box, Interval
    from robust.qe.compute import RegionResult
    from robust.smt.session import Statistics as Asked

Document = dict[str, Any]
Solver = Annotated[str, one_of(*SOLVERS)]
Encoding = Annotated[str, one_of(*ENCODINGS)]
Verdict = Annotated[str, one_of("proved", "refuted", "unknown")]
Ended = Annotated[str, one_of("complete", "timeout", "interrupted")]
SearchEnded = Annotated[str, one_of("complete", "timeout", "interrupted", "invalid")]
Kind = Annotated[str, one_of("weak", "dynamic", "strong")]
Rationals = dict[str, Rational]


def document(record: JsonObject) -> Document:
    """What is printed."""
    found: Document = plain(record)
    return found


# -- what several of them hold -----------------------------------------------------------------------------------------


class Ends(JsonObject):
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool


def _ends(interval: Interval) -> dict[str, Any]:
    return {
        "lower": exact_end(interval.lower, upper=False),
        "upper": exact_end(interval.upper, upper=True),
        "lower_closed": interval.lower is not None and interval.lower_closed,
        "upper_closed": interval.upper is not None and interval.upper_closed,
    }


def box_of(box: Box) -> dict[str, Ends]:
    return {name: Ends(**_ends(interval)) for name, interval in box.intervals.items()}


def exact(values: Mapping[Any, Fraction]) -> Rationals:
    return {str(name): str(value) for name, value in values.items()}


def or_none(value: object) -> str | None:
    return None if value is None else str(value)


class Statistics(JsonObject):
    """what the solver was asked, and the size of the formulas asserted"""

    queries: Count
    satisfiable: Count
    unsatisfiable: Count
    unknown: Count
    seconds: Seconds
    nodes: Count


def _statistics(found: Asked) -> Statistics:
    numbers: dict[str, Any] = found.as_dict()
    return Statistics(**numbers)


class Broken(JsonObject):
    obligation: str
    time: Rational
    detail: str


def broken(violations: Sequence[Violation]) -> list[Broken]:
    return [Broken(obligation=one.obligation, time=str(one.time), detail=one.detail) for one in violations]


class Happening(JsonObject):
    time: Rational
    happenings: Annotated[list[str], Meta(min_length=1)]
    atoms: Annotated[dict[str, bool], about("new truth values")]
    fluents: Annotated[Rationals, about("new values")]


class Counterexample(JsonObject):
    """parameter values and an allowed schedule in which an obligation breaks, executed step by step"""

    obligation: Annotated[str, about("what breaks")]
    parameters: Annotated[Rationals, about("values by parameter")]
    schedule: Annotated[Rationals, about("times by time point")]
    violations: Annotated[list[Broken], about("all obligations that this schedule breaks")]
    trace: Annotated[
        list[Happening],
        about(
            "the happenings in order of time, each with the atoms it changed to true or false and the fluents that "
            "changed since the one before"
        ),
    ]


def _counterexample(found: checks.Counterexample) -> Counterexample:
    return Counterexample(
        obligation=found.obligation,
        parameters=exact(found.parameters),
        schedule=exact(found.schedule),
        violations=broken(found.simulation.violations),
        trace=[
            Happening(
                time=str(step.time),
                happenings=[str(point) for point in step.points],
                atoms={str(atom): value for atom, value in step.atoms_changed},
                fluents=exact(step.fluents),
            )
            for step in found.simulation.trace
        ],
    )


# -- check and envelope ------------------------------------------------------------------------------------------------


class Obligation(JsonObject):
    name: str
    verdict: Verdict


class Check(JsonObject, tag_field="schema", tag="robust/check/1"):
    """robust check --json: is a plan valid for every schedule that its network allows?"""

    verdict: Verdict
    encoding: Encoding
    solver: Solver
    epsilon: Rational
    parameters: Annotated[dict[str, Ends], about("the values that the verdict is about")]
    obligations: Annotated[list[Obligation], about("unknown ones were not examined or not decided")]
    counterexample: Annotated[Counterexample | None, about("the first of counterexamples")]
    counterexamples: Annotated[list[Counterexample], about("one for each obligation found to break")]
    reason: Annotated[
        str | None, about("why the plan is refuted without a counterexample: parameter values leave no schedule")
    ]
    interrupted: Annotated[bool, about("stopped by Ctrl-C or SIGTERM")]
    timeout: Annotated[bool, about("stopped by --timeout")]
    seconds: Seconds
    statistics: Statistics


def check(result: checks.CheckResult, options: CheckCommand) -> Document:
    """`counterexample` is the first, `counterexamples` are all that were found."""
    found = [_counterexample(one) for one in result.counterexamples.values()]
    return document(
        Check(
            verdict=result.answer.value,
            encoding=options.encoding,
            solver=options.solver,
            epsilon=str(options.separation),
            parameters=box_of(result.box),
            obligations=[Obligation(name=name, verdict=one.value) for name, one in result.obligations.items()],
            counterexample=found[0] if found else None,
            counterexamples=found,
            reason=result.reason,
            interrupted=result.interrupted and not result.timed_out,
            timeout=result.timed_out,
            seconds=round(result.seconds, 6),
            statistics=_statistics(result.statistics),
        )
    )


class Within(JsonObject):
    nominal: Rational
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool


class Convergence(JsonObject):
    check: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    share: Annotated[float, Meta(ge=0)]


class Finding(JsonObject):
    verdict: Annotated[str, one_of("controllable", "not controllable", "unknown")]
    reason: Annotated[str | None, about("why it is not controllable, or not known to be")]
    seconds: Seconds


class Lost(Ends):
    lost_below: End
    lost_above: End


class Controllability(JsonObject):
    wanted: Annotated[Kind, about("the kind of --controllability")]
    weak: Finding
    dynamic: Finding
    strong: Finding
    parameters: Annotated[
        dict[str, Lost] | None,
        about(
            "the largest part of the box that is controllable as wanted, and how far each end came back; null if "
            "there is none or time ran out"
        ),
    ]
    lost_share: Annotated[
        Rational | None, about("the share of the total width that is lost; null if a width is infinite")
    ]
    failure: Annotated[str | None, about("why there are no parameters")]
    waits: Annotated[
        list[str], about("for dynamic: which time points wait for which observations, and how long at most")
    ]


class Envelope(JsonObject, tag_field="schema", tag="robust/envelope/1"):
    """robust envelope --json: a box of parameter values for which a plan is valid"""

    status: Annotated[
        SearchEnded,
        about(
            "timeout and interrupted: the box is sound if verified, but may not be maximal; invalid: the plan can fail "
            "at the nominal values"
        ),
    ]
    verified: Annotated[
        bool, about("the plan is valid for all values in the box; if false, parameters are merely the nominal values")
    ]
    method: Annotated[str, one_of("widen", "irr", "optimal")]
    encoding: Encoding
    solver: Solver
    beta: Annotated[Rational | None, about("the precision of irr; null for the exact methods")]
    bound: Annotated[
        Rational | None,
        about(
            "for optimal: no box that may be returned has a greater weighted total width; null if not finite or not "
            "known"
        ),
    ]
    parameters: Annotated[dict[str, Within], about("the box, in the plan's order")]
    checks: Annotated[Count, about("boxes tried")]
    unbounded_checks: Annotated[Count, about("further boxes tried to find out whether a direction is unbounded")]
    first_widening_s: Seconds | None
    seconds: Seconds
    reason: Annotated[
        str | None, about("if invalid: the obligation that breaks, or the statements that leave no schedule")
    ]
    values: Annotated[Rationals, about("if invalid: the parameter values at which it breaks")]
    counterexample: Annotated[
        Counterexample | None,
        about("if invalid: a schedule that fails at the nominal values, if there is one and time for it"),
    ]
    convergence: Annotated[
        list[Convergence],
        about("total width of the box after each check as a share of the final one; empty if that is zero or infinite"),
    ]
    statistics: Statistics
    controllability: Annotated[
        Controllability | UnsetType | None,
        about(
            "only with --controllability: what a dispatcher need not know of the values in the box; null if the box is "
            "not verified, or this was interrupted"
        ),
    ] = UNSET


def envelope(
    result: EnvelopeResult,
    counterexample: checks.Counterexample | None,
    report: ControllabilityReport | None,
    *,
    controllability: bool,
) -> Document:
    """`counterexample` shows what breaks at the nominal point if the status is invalid."""
    nominal = {parameter.name: str(parameter.nominal) for parameter in result.parameters}
    seconds = {step.check: step.seconds for step in result.trace}
    about_control = None if report is None else _controllability(report)
    first = result.first_widening_seconds
    return document(
        Envelope(
            status=result.status.value,
            verified=result.verified,
            method=result.method,
            encoding=result.encoding,
            solver=result.solver,
            beta=or_none(result.beta),
            bound=or_none(result.bound),
            parameters={
                name: Within(nominal=nominal[name], **_ends(one)) for name, one in result.box.intervals.items()
            },
            checks=result.checks,
            unbounded_checks=result.unbounded_checks,
            first_widening_s=None if first is None else round(first, 6),
            seconds=round(result.seconds, 6),
            reason=result.reason,
            values=exact(result.values),
            counterexample=None if counterexample is None else _counterexample(counterexample),
            convergence=[
                Convergence(check=number, seconds=round(seconds[number], 6), share=round(float(share), 6))
                for number, share in result.convergence()
            ],
            statistics=_statistics(result.statistics),
            controllability=about_control if controllability else UNSET,
        )
    )


def _controllability(report: ControllabilityReport) -> Controllability:
    findings = {
        one.kind.value: Finding(verdict=one.verdict.value, reason=one.reason, seconds=round(one.seconds, 6))
        for one in report.findings
    }
    share = None if report.lost is None else report.lost.share
    return Controllability(
        wanted=report.wanted.value,
        **findings,
        parameters=None if report.shrunk is None or report.lost is None else _part(report.shrunk.box, report.lost),
        lost_share=or_none(share),
        failure=report.failure,
        waits=list(report.waits),
    )


def _part(box: Box, lost: Loss) -> dict[str, Lost]:
    below = {name: gap for (name, side), gap in lost.faces.items() if side.value == "lower"}
    above = {name: gap for (name, side), gap in lost.faces.items() if side.value == "upper"}
    return {
        name: Lost(
            **_ends(one),
            lost_below=exact_end(below[name], upper=True),
            lost_above=exact_end(above[name], upper=True),
        )
        for name, one in box.intervals.items()
    }


# -- region and compare ------------------------------------------------------------------------------------------------


class Constraint(JsonObject):
    """Σ coefficient · parameter, compared with the constant"""

    coefficients: Rationals
    relation: Annotated[str, one_of("<=", "<", "=")]
    constant: Rational


class Polyhedron(JsonObject):
    constraints: Annotated[list[Constraint], about("all of them hold; none: everything")]


class Region(JsonObject, tag_field="schema", tag="robust/region/1", kw_only=True):
    """robust region --json: the robustness envelope, or an outer bound of it"""

    RULES: ClassVar[Document] = {
        "oneOf": [
            {"properties": {"form": {"const": "union"}}, "required": ["polyhedra"]},
            {"properties": {"form": {"const": "difference"}}, "required": ["base", "minus"]},
        ]
    }

    status: Annotated[
        Ended,
        about(
            "complete: the region is the envelope; otherwise it contains the envelope, and not every point of it is "
            "valid"
        ),
    ]
    meaning: Annotated[str, about("what the region is, in a sentence")]
    parameters: Annotated[list[str], Meta(extra_json_schema={"uniqueItems": True})]
    form: Annotated[str, one_of("union", "difference")]
    polyhedra: Annotated[list[Polyhedron] | UnsetType, about("form union: the region is their union")] = UNSET
    base: Annotated[
        list[Constraint] | UnsetType, about("form difference: the polyhedron from which others are removed")
    ] = UNSET
    minus: Annotated[list[Polyhedron] | UnsetType, about("form difference: what is removed")] = UNSET
    backend: Annotated[str, one_of(*OFFERED)]
    splitting: Annotated[str, one_of("monolithic", "partial", "full")]
    learning: bool
    encoding: Encoding
    solver: Solver
    epsilon: Rational
    pieces: Annotated[Count, about("polyhedra of bad parameter values that were found")]
    seconds: Seconds
    statistics: Statistics


def region(result: RegionResult, epsilon: Fraction) -> Document:
    shown = {key: value for key, value in result.region.as_dict().items() if key != "schema"}
    return document(
        Region(
            status=result.status.value,
            meaning=result.meaning,
            **shown,
            backend=result.backend,
            splitting=result.splitting,
            learning=result.learning,
            encoding=result.encoding,
            solver=result.solver,
            epsilon=str(epsilon),
            pieces=result.pieces,
            seconds=round(result.seconds, 6),
            statistics=_statistics(result.statistics),
        )
    )


class Volume(JsonObject):
    lower: Rational
    upper: End


class Enumerated(JsonObject):
    status: Ended
    meaning: str
    pieces: Count
    seconds: Seconds
    volume: Volume | None


class Share(JsonObject):
    """a ratio between two certified bounds, exact if they are equal; upper is null if unknown"""

    lower: Rational
    upper: Rational | None


class Witness(JsonObject):
    parameters: Rationals
    obligation: str


class Face(JsonObject):
    parameter: str
    side: Annotated[str, one_of("lower", "upper")]
    end: Rational
    closed: bool
    gap: Annotated[
        End, about("how far the face could move outwards alone; an upper bound unless the region is complete")
    ]
    witness: Annotated[
        Witness | None, about("a point beyond the face, within the gap and 1/1000, and what breaks there")
    ]


class ComparedBox(JsonObject):
    method: Annotated[str, one_of("irr", "widen", "optimal", "optimal-nominal")]
    status: SearchEnded
    verified: bool
    reason: str | None
    box: dict[str, Ends]
    volume_ratio: Share | None
    width_ratio: Share | None
    faces: list[Face]
    seconds: Seconds


class Compare(JsonObject, tag_field="schema", tag="robust/compare/1"):
    """robust compare --json: the exact envelope beside the boxes of all methods"""

    status: SearchEnded
    beta: Rational
    parameters: Annotated[Rationals, about("nominal values")]
    region: Enumerated | None
    boxes: list[ComparedBox]
    seconds: Seconds


def compare(result: compares.Comparison) -> Document:
    found, volume = result.region, result.volume
    return document(
        Compare(
            status=result.status.value,
            beta=str(result.beta),
            parameters=exact({one.name: one.nominal for one in result.plan.parameters}),
            region=None
            if found is None
            else Enumerated(
                status=found.status.value,
                meaning=found.meaning,
                pieces=found.pieces,
                seconds=round(found.seconds, 6),
                volume=None
                if volume is None
                else Volume(lower=str(volume.lower), upper=exact_end(volume.upper, upper=True)),
            ),
            boxes=[_compared(entry) for entry in result.entries],
            seconds=round(result.seconds, 6),
        )
    )


def _compared(entry: compares.Entry) -> ComparedBox:
    result = entry.result
    return ComparedBox(
        method=entry.method,
        status=result.status.value,
        verified=result.verified,
        reason=result.reason,
        box=box_of(result.box),
        volume_ratio=_share(entry.volume_share),
        width_ratio=_share(entry.width_share),
        faces=[
            Face(
                parameter=face.parameter,
                side=face.side.value,
                end=str(face.end),
                closed=face.closed,
                gap=exact_end(face.gap, upper=True),
                witness=None if face.witness is None else _witness(face.witness),
            )
            for face in entry.faces
        ],
        seconds=round(result.seconds, 6),
    )


def _witness(witness: compares.Witness) -> Witness:
    return Witness(parameters=exact(witness.values), obligation=witness.obligation)


def _share(share: compares.Share | None) -> Share | None:
    return None if share is None else Share(lower=str(share.lower), upper=or_none(share.upper))


# -- errors ------------------------------------------------------------------------------------------------------------


class Failure(JsonObject):
    kind: Annotated[
        str,
        one_of("input", "usage", "unsupported", "solver", "timeout", "interrupted", "internal"),
        about("timeout and interrupted: before there was anything to answer"),
    ]
    message: str
    file: Annotated[str | None, about("the file or option that the message is about")]
    line: Annotated[int, Meta(ge=1)] | None
    column: Annotated[int, Meta(ge=1)] | None
    exit_code: Annotated[int, one_of(2, 3, 4)]


class Error(JsonObject, tag_field="schema", tag="robust/error/1"):
    """what any command prints with --json where there is no answer; the message is on stderr as well"""

    error: Failure


def error(found: RobustError, kind: str, exit_code: int) -> Document:
    """There is no answer; `kind` says why."""
    place = found.location
    return document(
        Error(
            error=Failure(
                kind=kind,
                message=found.message,
                file=place.file if place else None,
                line=place.line if place else None,
                column=place.column if place else None,
                exit_code=exit_code,
            )
        )
    )


DOCUMENTS: tuple[type[JsonObject], ...] = (
    Check,
    Envelope,
    Region,
    Compare,
    Error,
)
"""Every object whose schema is generated, see `tests/show`."""
