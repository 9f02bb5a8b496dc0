"""Answers to questions about a plan as JSON: robust check, envelope and compare."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import UNSET, Meta, UnsetType

from robust import numbers
from robust.irr import search, stops, templates
from robust.irr.check import CheckResult, Counterexample
from robust.irr.compare import Comparison, Entry, FaceWitness, RatioBounds
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, on_wire, one_of, wire
from robust.qe.box import Box, Side
from robust.show import documents, regions

if TYPE_CHECKING:
    from robust.execute.controllability import ControllabilityReport, Finding, Widest
    from robust.execute.controllable_boxes import Loss
    from robust.irr.stops import Advice, Stop
    from robust.plan.model import Parameter
    from robust.plan.simulate import Violation
    from robust.qe.box import Face
    from robust.smt.session import Statistics

# -- check -----------------------------------------------------------------------------------------------------------


class HappeningRecord(JsonObject):
    """
    Attributes:
        atoms: new truth values
        fluents: new values
    """

    time: Rational
    happenings: Annotated[list[str], Meta(min_length=1)]
    atoms: dict[str, bool]
    fluents: documents.Rationals


class CounterexampleRecord(JsonObject):
    """parameter values and an allowed schedule in which an obligation breaks, executed step by step

    Attributes:
        obligation: what breaks
        parameters: values by parameter
        schedule: times by time point of an action; those of the beginning and of timed literals never vary
        violations: all obligations that this schedule breaks
        trace: the happenings in order of time, each with the atoms it changed to true or false and the fluents that
            changed since the one before; constant fluents are left out
    """

    obligation: str
    parameters: documents.Rationals
    schedule: documents.Rationals
    violations: list[Violation]
    trace: list[HappeningRecord]


@wire.register(Counterexample)
def _(example: Counterexample) -> CounterexampleRecord:
    simulation = example.simulation
    return like(
        CounterexampleRecord,
        example,
        schedule={point: time for point, time in example.schedule.items() if point.instance},
        violations=simulation.violations,
        trace=[
            HappeningRecord(
                time=step.time,
                happenings=[str(point) for point in step.points],
                atoms={str(atom): value for atom, value in step.atoms_changed},
                fluents={str(name): value for name, value in step.fluents.items() if name not in simulation.constants},
            )
            for step in simulation.trace
        ],
    )


class ObligationRecord(JsonObject):
    name: str
    verdict: documents.Verdict


class Check(documents.Noted, tag_field="schema", tag="robust/check/1"):
    """robust check --json: is a plan valid for every schedule that its network allows?

    Attributes:
        parameters: the values that the verdict is about
        obligations: unknown ones were not examined or not decided
        settled: how many of them shortest paths prove, without the solver
        counterexample: the first of counterexamples
        counterexamples: one for each obligation found to break
        reason: why the plan is refuted without a counterexample: parameter values leave no schedule; if unknown: how a
            solver failed
        repair: the least change of bounds after which the plan is proved, if it is refuted and that was found soon
        tolerance: how much all durations that are parameters may be longer or shorter at once, as a share of their
            nominal values, and the chain of steps that ends it; null if there are none, or if that is not known
        tree: the file of the behavior tree whose executions it is about, instead of all schedules of the plan's
            network; null without --tree
        interrupted: stopped by Ctrl-C or SIGTERM
        timeout: stopped by --timeout
    """

    verdict: documents.Verdict
    encoding: documents.Encoding
    solver: documents.Solver
    epsilon: Rational
    parameters: Box
    obligations: list[ObligationRecord]
    settled: Count
    counterexample: Counterexample | None
    counterexamples: list[Counterexample]
    reason: str | None
    repair: list[documents.PlanChange] | None
    tolerance: stops.Tolerance | None
    tree: str | None
    interrupted: bool
    timeout: bool
    seconds: Seconds
    statistics: Statistics


@documents.documenting.register(CheckResult)
def check(result: CheckResult) -> documents.Document:
    """`counterexample` is the first, `counterexamples` are all that were found."""
    examples = list(result.counterexamples.values())
    return documents.document_of(
        Check,
        result,
        verdict=result.answer,
        parameters=result.box,
        obligations=[ObligationRecord(name=name, verdict=answer.value) for name, answer in result.obligations.items()],
        counterexample=examples[0] if examples else None,
        counterexamples=examples,
        repair=None if result.repair is None else documents.changes_of(result.repair),
        interrupted=result.interrupted and not result.timed_out,
        timeout=result.timed_out,
    )


documents.has_table(CheckResult, "obligations")


class ParameterRecord(JsonObject):
    """
    Attributes:
        nominal: null if the parameter has none
        percent_below: how far the lower end is from the nominal value, in per cent of it; below zero if it is lower;
            null if infinite, or if the nominal value is zero or there is none
        percent_above: the same of the upper end
        stopped_below: what ends the box there: the obligation that would break, the statements of the network that
            would leave no schedule, the declared bound, or why that is not known; null if unbounded or not verified
        stopped_above: the same of the upper end
        all_stopped_below: all obligations that would break there, in the plan's order, of which `stopped_below` is the
            first; or the one other thing that ends the box
        all_stopped_above: the same of the upper end
    """

    nominal: Rational | None
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool
    percent_below: Rational | None
    percent_above: Rational | None
    stopped_below: str | None
    stopped_above: str | None
    all_stopped_below: list[str]
    all_stopped_above: list[str]


class Convergence(JsonObject):
    check: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    share: Annotated[float, Meta(ge=0)]


on_wire("Finding", kind=None)


class Lost(documents.Ends):
    lost_below: End
    lost_above: End


class Stopped(documents.Ends):
    """
    Attributes:
        stopped_below: what breaks, or what a dispatcher could no longer do, beyond that end; null if unbounded
        stopped_above: the same of the upper end
        all_stopped_below: all obligations that break beyond that end, in the plan's order, or the one other reason
        all_stopped_above: the same of the upper end
    """

    stopped_below: str | None
    stopped_above: str | None
    all_stopped_below: list[str]
    all_stopped_above: list[str]


def _stops_of(stops: Mapping[Face, Stop], name: str) -> dict[str, Any]:
    """The fields of :class:`Stopped` about what ends both sides of a parameter."""
    fields: dict[str, Any] = {}
    for key, side in (("stopped_below", Side.LOWER), ("stopped_above", Side.UPPER)):
        stop = stops.get((name, side))
        fields[key] = None if stop is None else str(stop)
        fields[f"all_{key}"] = () if stop is None else stop.every
    return fields


class ControllabilityRecord(JsonObject):
    """
    Attributes:
        wanted: the kind of --controllability
        parameters: the largest part of the box that is controllable as wanted, and how far each end came back; null if
            there is none or time ran out
        lost_share: the share of the total width that is lost; null if a width is infinite
        widest: the widest box in the envelope that is controllable as wanted, which holds the part; with optimal, of
            the greatest weighted total width; null if the box itself is controllable, or time ran out
        failure: why there are no parameters
        waits: for dynamic: which time points wait for which observations, and how long at most
    """

    wanted: documents.Kind
    weak: Finding
    dynamic: Finding
    strong: Finding
    parameters: dict[str, Lost] | None
    lost_share: Rational | None
    widest: dict[str, Stopped] | None
    failure: str | None
    waits: list[str]


class ShapeFace(documents.Ends):
    """
    Attributes:
        coefficients: of a linear form of the parameters, which is between the ends
    """

    coefficients: documents.Rationals


class ShapeRecord(JsonObject):
    """
    Attributes:
        name: octagon, or the file of the template
        faces: bounds on linear forms; the plan is valid for all values between all of them
    """

    name: str
    faces: list[ShapeFace]


def _shape(shape: templates.Shape) -> ShapeRecord:
    faces = [
        like(ShapeFace, documents.ends_of(interval), coefficients=dict(shape.directions[name]))
        for name, interval in shape.bounded.items()
    ]
    return ShapeRecord(name=shape.name, faces=faces)


class Envelope(documents.Noted, tag_field="schema", tag="robust/envelope/1"):
    """robust envelope --json: a box of parameter values for which a plan is valid

    Attributes:
        status: timeout, interrupted and unknown (a solver failed): the box is sound if verified, but may not be
            maximal; invalid: the plan can fail at the nominal values
        verified: the plan is valid for all values in the box; if false, there are none in it: both ends are the nominal
            values, and open
        beta: the precision of irr; null for the exact methods
        bound: for optimal: no box that may be returned has a greater weighted total width; for risk: none is more
            probable; null if not finite or not known
        probability: only for risk: that all parameters are in the box
        parameters: the box, in the plan's order
        checks: boxes tried
        unbounded_checks: further boxes tried to find out whether a direction is unbounded
        reason: if invalid: the obligation that breaks, or the statements that leave no schedule; if unknown: how a
            solver failed
        values: if invalid: the parameter values at which it breaks
        counterexample: if invalid: a schedule that fails at the nominal values, if there is one and time for it
        advice: what to type for parameters that an action's own duration leaves no room
        tolerance: how much all durations that are parameters may be longer or shorter at once, as a share of their
            nominal values, and the chain of steps that ends it; null if there are none, or if that is not known
        fallback: why shortest paths alone do not find the widest box, where a solver had to; null where they do, or
            were not asked
        convergence: total width of the box after each check as a share of the final one; empty if that is zero or
            infinite
        inner: where rates and times vary together: how far the box, which is sound, may be from the widest; else null
        shape: only with --shape: bounds on linear forms, a set around the box
        controllability: only with --controllability: what a dispatcher need not know of the values in the box; null if
            the box is not verified, or this was interrupted
    """

    status: documents.SearchEnded
    verified: bool
    method: Annotated[str, one_of("widen", "irr", "optimal", "risk")]
    encoding: documents.Encoding
    solver: documents.Solver
    beta: Rational | None
    bound: Rational | None
    parameters: dict[str, ParameterRecord]
    checks: Count
    unbounded_checks: Count
    first_widening_s: Seconds | None
    seconds: Seconds
    reason: str | None
    values: documents.Rationals
    counterexample: Counterexample | None
    advice: list[Advice]
    tolerance: stops.Tolerance | None
    fallback: str | None
    convergence: list[Convergence]
    statistics: Statistics
    inner: search.InnerBox | None
    shape: ShapeRecord | UnsetType = UNSET
    controllability: ControllabilityRecord | UnsetType | None = UNSET
    probability: documents.Range | UnsetType = UNSET


@documents.documenting.register(search.EnvelopeResult)
def envelope(
    result: search.EnvelopeResult, beside: regions.Beside = regions.NOTHING_BESIDE, *, controllability: bool = False
) -> documents.Document:
    """With `controllability`, it is null where it was asked for and is not known; else it is left out then."""
    seconds = {step.check: step.seconds for step in result.trace}
    report, first = beside.controllability, result.first_widening_seconds
    return documents.document_of(
        Envelope,
        result,
        parameters={parameter.name: _parameter(result, parameter) for parameter in result.parameters},
        first_widening_s=None if first is None else round(first, 6),
        counterexample=beside.counterexample,
        convergence=[
            Convergence(check=number, seconds=round(seconds[number], 6), share=round(float(share), 6))
            for number, share in result.convergence()
        ],
        shape=UNSET if result.shape is None else _shape(result.shape),
        controllability=_controllability(report) if report is not None else None if controllability else UNSET,
        probability=UNSET if beside.probability is None else documents.range_of(beside.probability),
    )


documents.has_table(search.EnvelopeResult, "parameters", named="parameter", numbers=documents.SIDES)


def _parameter(result: search.EnvelopeResult, parameter: Parameter) -> ParameterRecord:
    interval = result.box[parameter.name]
    return like(
        ParameterRecord,
        documents.ends_of(interval),
        nominal=parameter.nominal if parameter.has_nominal else None,
        percent_below=parameter.percent(interval.lower),
        percent_above=parameter.percent(interval.upper),
        **_stops_of(result.stops, parameter.name),
    )


def _controllability(report: ControllabilityReport) -> ControllabilityRecord:
    return like(
        ControllabilityRecord,
        report,
        **{finding.kind.value: finding for finding in report.findings},
        parameters=None if report.shrunk is None or report.lost is None else _part(report.shrunk.box, report.lost),
        lost_share=None if report.lost is None else report.lost.share,
        widest=None if report.widest is None else _stopped(report.widest),
    )


def _stopped(widest: Widest) -> dict[str, Stopped]:
    return {
        name: like(Stopped, documents.ends_of(interval), **_stops_of(widest.stops, name))
        for name, interval in widest.box.intervals.items()
    }


def _part(box: Box, lost: Loss) -> dict[str, Lost]:
    return {
        name: like(
            Lost,
            documents.ends_of(interval),
            lost_below=numbers.exact_end(lost.faces[name, Side.LOWER], upper=True),
            lost_above=numbers.exact_end(lost.faces[name, Side.UPPER], upper=True),
        )
        for name, interval in box.intervals.items()
    }


# -- compare -----------------------------------------------------------------------------------------------------------


class Volume(JsonObject):
    lower: Rational
    upper: End


class Enumerated(JsonObject):
    status: documents.Ended
    meaning: str
    pieces: Count
    seconds: Seconds
    volume: Volume | None


on_wire("FaceWitness", values="parameters")


class FaceRecord(JsonObject):
    """
    Attributes:
        percent: how far it is from the nominal value, in per cent of it; null if that is zero
        gap: how far the face could move outwards alone; an upper bound unless the region is complete
        witness: a point beyond the face, within the gap and 1/1000, and what breaks there
    """

    parameter: str
    side: Annotated[str, one_of("lower", "upper")]
    end: Rational
    percent: Rational | None
    closed: bool
    gap: End
    witness: FaceWitness | None


class ComparedBox(JsonObject):
    """
    Attributes:
        volume_ratio: a ratio between two certified bounds, exact if they are equal; upper is null if unknown
        width_ratio: the same of total widths
    """

    method: Annotated[str, one_of("irr", "widen", "optimal", "optimal-nominal")]
    status: documents.SearchEnded
    verified: bool
    reason: str | None
    box: Box
    volume_ratio: RatioBounds | None
    width_ratio: RatioBounds | None
    faces: list[FaceRecord]
    seconds: Seconds


class Compare(documents.Noted, tag_field="schema", tag="robust/compare/1"):
    """robust compare --json: the exact envelope beside the boxes of all methods

    Attributes:
        parameters: nominal values
    """

    status: documents.SearchEnded
    beta: Rational
    parameters: documents.Rationals
    region: Enumerated | None
    boxes: list[ComparedBox]
    seconds: Seconds


@documents.documenting.register(Comparison)
def compare(result: Comparison) -> documents.Document:
    """The document of a comparison."""
    volume = None
    if result.volume is not None:
        volume = Volume(lower=result.volume.lower, upper=numbers.exact_end(result.volume.upper, upper=True))
    return documents.document_of(
        Compare,
        result,
        parameters={parameter.name: parameter.nominal for parameter in result.plan.parameters},
        region=None if result.region is None else like(Enumerated, result.region, volume=volume),
        boxes=[_compared(entry) for entry in result.entries],
    )


documents.has_table(Comparison, "boxes", numbers=documents.ENDS)


def _compared(entry: Entry) -> ComparedBox:
    parameters = {parameter.name: parameter for parameter in entry.result.parameters}
    faces = [
        like(
            FaceRecord,
            face,
            percent=parameters[face.parameter].percent(face.end),
            gap=numbers.exact_end(face.gap, upper=True),
        )
        for face in entry.faces
    ]
    return like(
        ComparedBox,
        entry.result,
        method=entry.method,
        volume_ratio=entry.volume_share,
        width_ratio=entry.width_share,
        faces=faces,
    )
