"""What `--json` prints, as types: the fields, what they mean, and how they come from results.

The published schemas in :mod:`robust.show.schemas` are those of these types. An object that `--json` prints is one of
:data:`DOCUMENTS`, and names itself in `schema`.

Probabilities as text: decimals rounded outwards, so that what is printed is as certain as what was found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import UNSET, Meta, UnsetType

from robust.backends import ENCODINGS, SOLVERS
from robust.errors import RobustError
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, one_of, plain
from robust.numbers import exact_end
from robust.qe.box import Side

if TYPE_CHECKING:
    from robust.execute.controllability import ControllabilityReport, Widest
    from robust.execute.controllable_boxes import Loss
    from robust.irr import check as checks
    from robust.irr.quantities import QuantityChange
    from robust.irr.search import EnvelopeResult
    from robust.irr.stops import Stop
    from robust.plan.model import Parameter
    from robust.plan.simulate import Violation
    from robust.probability.measure import Bounds
    from robust.qe.box import Box, Face, Interval

DIGITS = 9
"""Decimals of probabilities in JSON, rounded outwards."""


def decimal(value: Fraction, places: int, *, up: bool) -> str:
    """A probability as a decimal, rounded up or down."""
    scaled = value * 10**places
    whole = -floor(-scaled) if up else floor(scaled)
    return f"{whole // 10**places}.{whole % 10**places:0{places}d}"


def places_for(within: Fraction) -> int:
    """Decimals for people: one more than is asked for."""
    places = 4
    while Fraction(1, 10 ** (places - 1)) > within and places < DIGITS:
        places += 1
    return places


def bounds_text(bounds: Bounds, places: int) -> str:
    """`0.8588 to 0.8590`, rounded outwards; `0.5275` where both are the same."""
    lower, upper = decimal(bounds.lower, places, up=False), decimal(bounds.upper, places, up=True)
    if bounds.width < Fraction(1, 10**DIGITS):
        return f"{float(bounds.lower):.{places}f}"
    return lower if lower == upper else f"{lower} to {upper}"


def greatest_text(result: EnvelopeResult, probability: Bounds) -> str:
    """How probable a box is, and how much more probable another may be."""
    own = f"probability of the box: {bounds_text(probability, 4)}"
    if result.bound is None:
        return f"{own}; {'' if result.cut_short else 'a local optimum: '}how probable others may be is not known"
    return f"{own}; no box has more than {decimal(min(Fraction(1), result.bound), 4, up=True)}"


Probability = Annotated[str, Meta(pattern=r"^[01]\.[0-9]+$", description="a decimal")]


class Range(JsonObject):
    """bounds, rounded outwards: the probability is certainly between them"""

    lower: Probability
    upper: Probability


def range_of(bounds: Bounds) -> Range:
    """Bounds as decimals."""
    return Range(lower=decimal(bounds.lower, DIGITS, up=False), upper=decimal(bounds.upper, DIGITS, up=True))


Document = dict[str, Any]
Solver = Annotated[str, one_of(*SOLVERS)]
Encoding = Annotated[str, one_of(*ENCODINGS)]
Verdict = Annotated[str, one_of("proved", "refuted", "unknown")]
Ended = Annotated[str, one_of("complete", "timeout", "interrupted", "unknown")]
SearchEnded = Annotated[str, one_of("complete", "timeout", "interrupted", "invalid", "unknown")]
Kind = Annotated[str, one_of("weak", "dynamic", "strong")]
Rationals = dict[str, Rational]


def document(record: JsonObject) -> Document:
    """What is printed."""
    found: Document = plain(record)
    return found


class Noted(JsonObject, kw_only=True):
    """An answer about a plan; `notes` are what was done to read it, if anything but reading it was done.

    Attributes:
        notes: what was picked, skipped and moved to read the plan, and where its parameters were found
    """

    notes: list[str] | UnsetType = UNSET


# -- what several of them hold -----------------------------------------------------------------------------------------


class Ends(JsonObject):
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool


def ends_of(interval: Interval) -> dict[str, Any]:
    """The fields of :class:`Ends`."""
    return {
        "lower": exact_end(interval.lower, upper=False),
        "upper": exact_end(interval.upper, upper=True),
        "lower_closed": interval.lower is not None and interval.lower_closed,
        "upper_closed": interval.upper is not None and interval.upper_closed,
    }


def box_of(box: Box) -> dict[str, Ends]:
    return {name: Ends(**ends_of(interval)) for name, interval in box.intervals.items()}


def exact(values: Mapping[Any, Fraction]) -> Rationals:
    """With what the values are of as text."""
    return {str(name): value for name, value in values.items()}


class Statistics(JsonObject):
    """what the solver was asked, and the size of the formulas asserted"""

    queries: Count
    satisfiable: Count
    unsatisfiable: Count
    unknown: Count
    seconds: Seconds
    nodes: Count


class Broken(JsonObject):
    obligation: str
    time: Rational
    detail: str


def broken(violations: Sequence[Violation]) -> list[Broken]:
    return [like(Broken, one) for one in violations]


class Happening(JsonObject):
    """
    Attributes:
        atoms: new truth values
        fluents: new values
    """

    time: Rational
    happenings: Annotated[list[str], Meta(min_length=1)]
    atoms: dict[str, bool]
    fluents: Rationals


class Counterexample(JsonObject):
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
    parameters: Rationals
    schedule: Rationals
    violations: list[Broken]
    trace: list[Happening]


def _counterexample(found: checks.Counterexample) -> Counterexample:
    constant = found.simulation.constants
    return like(
        Counterexample,
        found,
        schedule=exact({point: when for point, when in found.schedule.items() if point.instance}),
        violations=broken(found.simulation.violations),
        trace=[
            Happening(
                time=step.time,
                happenings=[str(point) for point in step.points],
                atoms={str(atom): value for atom, value in step.atoms_changed},
                fluents=exact({one: value for one, value in step.fluents.items() if one not in constant}),
            )
            for step in found.simulation.trace
        ],
    )


# -- check and envelope ------------------------------------------------------------------------------------------------


class Obligation(JsonObject):
    name: str
    verdict: Verdict


class PlanChange(JsonObject):
    """
    Attributes:
        statement: of the plan, as it was written
        line: where it stands, if in a file
        part: which of its numbers changes
        cost: the amount times the weight; null for a bound that was infinite
        words: the change, for people
        serves: the obligations, or statements of the network, that break without the change
    """

    statement: str
    line: int | None
    part: Annotated[str, one_of("lower", "upper", "default")]
    old: End
    new: Rational
    cost: Rational | None
    words: str
    serves: list[str]


def changes_of(found: Sequence[QuantityChange]) -> list[PlanChange]:
    """Changes of a plan."""
    return [
        like(
            PlanChange,
            one,
            line=one.location.line if one.location is not None else None,
            old=exact_end(one.old, upper=one.part == "upper"),
            serves=list(one.serves),
        )
        for one in found
    ]


class Check(Noted, tag_field="schema", tag="robust/check/1"):
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
        interrupted: stopped by Ctrl-C or SIGTERM
        timeout: stopped by --timeout
    """

    verdict: Verdict
    encoding: Encoding
    solver: Solver
    epsilon: Rational
    parameters: dict[str, Ends]
    obligations: list[Obligation]
    settled: Count
    counterexample: Counterexample | None
    counterexamples: list[Counterexample]
    reason: str | None
    repair: list[PlanChange] | None
    interrupted: bool
    timeout: bool
    seconds: Seconds
    statistics: Statistics


def check(result: checks.CheckResult) -> Document:
    """`counterexample` is the first, `counterexamples` are all that were found."""
    found = [_counterexample(one) for one in result.counterexamples.values()]
    return document(
        like(
            Check,
            result,
            verdict=result.answer.value,
            parameters=box_of(result.box),
            obligations=[Obligation(name=name, verdict=one.value) for name, one in result.obligations.items()],
            counterexample=found[0] if found else None,
            counterexamples=found,
            repair=None if result.repair is None else changes_of(result.repair),
            interrupted=result.interrupted and not result.timed_out,
            timeout=result.timed_out,
            statistics=like(Statistics, result.statistics),
        )
    )


class Within(JsonObject):
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


class Advice(JsonObject):
    """
    Attributes:
        parameters: those without room
        reason: how plan and domain both fix a duration
        options: values of --parameter that give room
    """

    parameters: list[str]
    reason: str
    options: list[str]


class Convergence(JsonObject):
    check: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    share: Annotated[float, Meta(ge=0)]


class Finding(JsonObject):
    """
    Attributes:
        reason: why it is not controllable, or not known to be
    """

    verdict: Annotated[str, one_of("controllable", "not controllable", "unknown")]
    reason: str | None
    seconds: Seconds


class Lost(Ends):
    lost_below: End
    lost_above: End


class Stopped(Ends):
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
    found: dict[str, Any] = {}
    for key, side in (("stopped_below", Side.LOWER), ("stopped_above", Side.UPPER)):
        stop = stops.get((name, side))
        found[key] = None if stop is None else str(stop)
        found[f"all_{key}"] = [] if stop is None else list(stop.every)
    return found


class Controllability(JsonObject):
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

    wanted: Kind
    weak: Finding
    dynamic: Finding
    strong: Finding
    parameters: dict[str, Lost] | None
    lost_share: Rational | None
    widest: dict[str, Stopped] | None
    failure: str | None
    waits: list[str]


class Envelope(Noted, tag_field="schema", tag="robust/envelope/1"):
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
        convergence: total width of the box after each check as a share of the final one; empty if that is zero or
            infinite
        controllability: only with --controllability: what a dispatcher need not know of the values in the box; null if
            the box is not verified, or this was interrupted
    """

    status: SearchEnded
    verified: bool
    method: Annotated[str, one_of("widen", "irr", "optimal", "risk")]
    encoding: Encoding
    solver: Solver
    beta: Rational | None
    bound: Rational | None
    parameters: dict[str, Within]
    checks: Count
    unbounded_checks: Count
    first_widening_s: Seconds | None
    seconds: Seconds
    reason: str | None
    values: Rationals
    counterexample: Counterexample | None
    advice: list[Advice]
    convergence: list[Convergence]
    statistics: Statistics
    controllability: Controllability | UnsetType | None = UNSET
    probability: Range | UnsetType = UNSET


@dataclass(frozen=True)
class Beside:
    """What a command finds out in addition to a box: `counterexample` shows what breaks at the nominal point,
    `controllability` what a dispatcher need not know of the values in the box, `probability` how probable they are."""

    counterexample: checks.Counterexample | None = None
    controllability: ControllabilityReport | None = None
    probability: Bounds | None = None


NOTHING_BESIDE = Beside()


def envelope(result: EnvelopeResult, beside: Beside = NOTHING_BESIDE, *, controllability: bool = False) -> Document:
    """With `controllability`, it is null where it was asked for and is not known; else it is left out then."""
    seconds = {step.check: step.seconds for step in result.trace}
    report, shown = beside.controllability, beside.counterexample
    first = result.first_widening_seconds
    return document(
        like(
            Envelope,
            result,
            parameters={one.name: _within(result, one) for one in result.parameters},
            advice=[like(Advice, one) for one in result.advice],
            first_widening_s=None if first is None else round(first, 6),
            counterexample=None if shown is None else _counterexample(shown),
            convergence=[
                Convergence(check=number, seconds=round(seconds[number], 6), share=round(float(share), 6))
                for number, share in result.convergence()
            ],
            statistics=like(Statistics, result.statistics),
            controllability=_controllability(report) if report is not None else None if controllability else UNSET,
            probability=UNSET if beside.probability is None else range_of(beside.probability),
        )
    )


def _within(result: EnvelopeResult, parameter: Parameter) -> Within:
    interval = result.box[parameter.name]
    return Within(
        nominal=parameter.nominal if parameter.has_nominal else None,
        **ends_of(interval),
        percent_below=parameter.percent(interval.lower),
        percent_above=parameter.percent(interval.upper),
        **_stops_of(result.stops, parameter.name),
    )


def _controllability(report: ControllabilityReport) -> Controllability:
    return like(
        Controllability,
        report,
        **{one.kind.value: like(Finding, one) for one in report.findings},
        parameters=None if report.shrunk is None or report.lost is None else _part(report.shrunk.box, report.lost),
        lost_share=None if report.lost is None else report.lost.share,
        widest=None if report.widest is None else _stopped(report.widest),
    )


def _stopped(widest: Widest) -> dict[str, Stopped]:
    return {
        name: Stopped(**ends_of(one), **_stops_of(widest.stops, name)) for name, one in widest.box.intervals.items()
    }


def _part(box: Box, lost: Loss) -> dict[str, Lost]:
    below = {name: gap for (name, side), gap in lost.faces.items() if side.value == "lower"}
    above = {name: gap for (name, side), gap in lost.faces.items() if side.value == "upper"}
    return {
        name: Lost(
            **ends_of(one),
            lost_below=exact_end(below[name], upper=True),
            lost_above=exact_end(above[name], upper=True),
        )
        for name, one in box.intervals.items()
    }


# -- errors ------------------------------------------------------------------------------------------------------------


class Failure(JsonObject):
    """
    Attributes:
        kind: timeout and interrupted: before there was anything to answer
        file: the file or option that the message is about
    """

    kind: Annotated[str, one_of("input", "usage", "unsupported", "solver", "timeout", "interrupted", "internal")]
    message: str
    file: str | None
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


DOCUMENTS: tuple[type[JsonObject], ...] = (Check, Envelope, Error)
"""Every object whose schema is generated, see `tests/show`."""
