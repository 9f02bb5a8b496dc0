"""Probabilities of success: JSON, and texts for people."""

from fractions import Fraction
from typing import Annotated

from msgspec import UNSET, UnsetType

from robust.json_text import Count, JsonObject, Rational, Seconds, like, on_wire, one_of, wire
from robust.numbers import duration, plural
from robust.probability import measure, packing
from robust.probability.risk import METHODS, BlameShare, RiskResult, RiskStatus
from robust.qe.box import Box
from robust.searching import Status
from robust.show import documents
from robust.show.console import Console, Text, printing
from robust.show.documents import bounds_text, decimal, places_for
from robust.show.tables import show_table, table
from robust.show.text import stopped, words_of

# -- JSON --------------------------------------------------------------------------------------------------------------


class KeptBox(JsonObject):
    """
    Attributes:
        complete: false: the search for the box was cut short; it is inside, but not maximal
        probability: that all parameters are in it
        parameters: the box
    """

    method: Annotated[str, one_of(*METHODS)]
    complete: bool
    probability: measure.Bounds
    parameters: Box


on_wire("BlameShare", name="obligation")
wire.register(measure.Bounds, documents.range_of)


class Disjoint(JsonObject):
    """boxes of good values without common points, which bound the probability from below"""

    boxes: Count


class LateAt(JsonObject):
    """
    Attributes:
        obligation: what is broken
        estimate: share of draws in which nothing is later
        certified: the probability that some chain to it is late; null if not known
    """

    obligation: str
    estimate: float
    certified: measure.Bounds | None


class LateAlong(JsonObject):
    """
    Attributes:
        parameter: a duration
        estimate: share of draws in which the chain of actions that is latest has it
        certified: the probability that some chain that has it is late; null if not known
    """

    parameter: str
    estimate: float
    certified: measure.Bounds | None


class LateDocument(JsonObject):
    """what is late in random draws: statistics, no proof

    Attributes:
        gain: share of draws that would succeed with one unit of time more
        certified_gain: by how much more probable success is with it; null if not known
    """

    draws: Count
    gain: float
    certified_gain: measure.Bounds | None
    by_obligation: list[LateAt]
    by_duration: list[LateAlong]


class FactorDocument(JsonObject):
    """
    Attributes:
        scales: durations that are multiplied by it
        shifts: what one unit adds to durations
    """

    name: str
    distribution: str
    scales: list[str]
    shifts: dict[str, Rational]


class JointDurations(JsonObject):
    """jointly normal durations whose covariances are no factors"""

    names: list[str]
    matrix: list[list[Rational]]


class RiskAnswer(documents.Noted, tag_field="schema", tag="robust/risk/1", kw_only=True):
    """robust risk --json: the probability that a plan succeeds when its parameters are random

    Attributes:
        status: complete: the bounds are as close as asked; wide: they are not, although nothing ended the search;
            otherwise what ended it. They hold in any case
        probability: that the plan succeeds whatever schedule its network allows; a parameter outside of its declared
            bounds counts as failure
        within: how close the bounds were to be
        distributions: by parameter, as on the command line, before factors change them
        box: the most probable of `boxes`
        boxes: what the boxes of each method keep
        by_obligation: what takes the rest; null if that is not known
        cells: parts of parameter space that were looked at
        disjoint: only with many parameters
        estimate: only with many parameters, or --draws
        probabilities: only where longest paths decide about the plan
        late: likewise
        factors: only if durations share any
        joints: only if durations are correlated in other ways
        reason: only if unknown: how a solver failed
    """

    status: Annotated[str, one_of("complete", "wide", "timeout", "interrupted", "unknown")]
    probability: measure.Bounds
    within: Rational
    distributions: dict[str, str]
    box: KeptBox | None
    boxes: list[KeptBox]
    by_obligation: list[BlameShare] | None
    cells: Count
    disjoint: Disjoint | UnsetType = UNSET
    estimate: packing.SampledEstimate | UnsetType = UNSET
    probabilities: measure.SuccessProbabilities | UnsetType = UNSET
    late: LateDocument | UnsetType = UNSET
    factors: list[FactorDocument] | UnsetType = UNSET
    joints: list[JointDurations] | UnsetType = UNSET
    reason: str | UnsetType = UNSET
    seconds: Seconds


@documents.documenting.register(RiskResult)
def _(result: RiskResult) -> documents.Document:
    boxes = {
        kept.method: KeptBox(
            method=kept.method,
            complete=kept.result.status is Status.COMPLETE,
            probability=kept.probability,
            parameters=kept.result.box,
        )
        for kept in result.kept
    }
    return documents.document_of(
        RiskAnswer,
        result,
        distributions={name: str(distribution) for name, distribution in result.distributions.items()},
        box=None if result.best is None else boxes[result.best.method],
        boxes=list(boxes.values()),
        by_obligation=result.shares,
        disjoint=Disjoint(boxes=len(result.disjoint)) if result.disjoint else UNSET,
        estimate=UNSET if result.estimate is None else result.estimate,
        probabilities=UNSET if result.probabilities is None else result.probabilities,
        late=UNSET if result.late is None else _late_document(result.late),
        factors=[
            FactorDocument(
                name=factor.name,
                distribution=str(factor.distribution),
                scales=sorted(factor.scales),
                shifts=dict(factor.shifts),
            )
            for factor in result.factors
        ]
        or UNSET,
        joints=[JointDurations(names=list(names), matrix=[list(row) for row in rows]) for names, rows in result.joints]
        or UNSET,
        reason=UNSET if result.reason is None else result.reason,
    )


def _late_document(late: packing.LatenessDraws) -> LateDocument:
    return LateDocument(
        draws=late.draws,
        gain=late.gain,
        certified_gain=late.certified_gain,
        by_obligation=[like(LateAt, share, obligation=share.name) for share in late.points],
        by_duration=[like(LateAlong, share, parameter=share.name) for share in late.durations],
    )


documents.has_table(RiskResult, "by_obligation", numbers=documents.ENDS)


# -- text --------------------------------------------------------------------------------------------------------------

_NAMES = {"irr": "IRR, β = 1", "widen": "exact widening", "optimal": "greatest total width"}
_WIDE = "too many parameters for closer bounds"
_SLICED = "closer bounds take more slices of the rates that multiply times that vary"


@printing.register(RiskResult)
def print_risk(out: Console, result: RiskResult, *, quiet: bool) -> None:
    """The bounds; unless `quiet` also what takes the rest, and what boxes keep."""
    places = places_for(result.within)
    out.print(Text.assemble("probability of success: ", (bounds_text(result.probability, places), "bold")))
    if result.estimate is not None:
        out.line(_estimate(result.estimate, places))
    if result.probabilities is not None:
        known = result.probabilities
        for name, bounds, best in (
            ("an executor that sees durations as they end", known.dynamic, known.best_dynamic),
            ("one fixed schedule", known.strong, known.best_strong),
        ):
            beyond = best.upper - bounds.upper > result.within
            most = f"; the best one at most {decimal(best.upper, places, up=True)}" if beyond else ""
            out.print(f"{name}: {bounds_text(bounds, places)}{most}")
    if quiet:
        return
    if result.late is not None:
        _print_late(out, result, result.late, places)
    if result.shares:
        out.print()
        out.print("What fails, each value counted for the first that breaks:")
        show_table(out, table(("obligation", "probability"), _share_rows(result, places)))
    if result.kept:
        out.print()
        out.print("What boxes keep:")
        rows = [
            (
                f"{_NAMES[kept.method]}{' so far' if kept.result.cut_short else ''}",
                bounds_text(kept.probability, places),
                _of_success(kept.probability, result),
            )
            for kept in result.kept
        ]
        show_table(out, table(("box", "probability", "of success"), rows))
    out.print()
    out.line(_summary(result))


SHOWN = 8
"""Rows of what is late."""


def _print_late(out: Console, result: RiskResult, late: packing.LatenessDraws, places: int) -> None:
    """What is late in draws, and on whose account."""
    if not late.durations:
        return
    words = words_of(result.plan)
    out.print()
    gain = "" if late.certified_gain is None else f" (certified: {bounds_text(late.certified_gain, places)})"
    out.line(
        f"What is late in {late.draws} random draws; one unit of time more would save {late.gain:.{places}f} of them"
        f"{gain}:"
    )
    told = [(words.told(share.name), share) for share in late.points[:SHOWN]]
    told += [(words.parameters.get(share.name, share.name), share) for share in late.durations[:SHOWN]]
    rows = [
        (name, f"{share.estimate:.{places}f}", "" if share.certified is None else bounds_text(share.certified, places))
        for name, share in told
    ]
    headings = ("broken, or on a chain", "latest in draws", "some chain is late (certified)")
    shown = 3 if any(certified for *_, certified in rows) else 2
    show_table(out, table(headings[:shown], [row[:shown] for row in rows]))


def _estimate(estimate: packing.SampledEstimate, places: int) -> Text:
    share = f"{estimate.successes / estimate.draws:.{places}f}"
    ends = f"{estimate.lower:.{places}f} to {estimate.upper:.{places}f}"
    confidence = f"{float(estimate.confidence):.1%} confidence (Clopper-Pearson)"
    return Text(f"estimate: {share}, from {estimate.draws} random points; {ends} with {confidence}; no proof")


def _share_rows(result: RiskResult, places: int) -> list[tuple[str, str]]:
    """Rows for shares that matter, the greatest first; negligible ones are counted."""
    shares, within, words = result.shares or (), result.within, words_of(result.plan)
    shown = [share for share in shares if share.probability.upper >= within]
    shown.sort(key=lambda share: share.probability.upper, reverse=True)
    rows = [(words.told(share.name), bounds_text(share.probability, places)) for share in shown]
    if rest := len(shares) - len(shown):
        rows.append((f"{plural(rest, 'other')}, each", f"at most {decimal(within, places, up=True)}"))
    return rows


def _of_success(kept: measure.Bounds, result: RiskResult) -> str:
    """The share of all successes that lies in a box."""
    total = result.probability
    if not total.lower:
        return ""
    low, high = kept.lower / total.upper, min(Fraction(1), kept.upper / total.lower)
    left, right = f"{float(low):.1%}", f"{float(high):.1%}"
    return left if left == right else f"{left} to {right}"


def _summary(result: RiskResult) -> Text:
    text = Text()
    if result.status is RiskStatus.COMPLETE:
        text.append("complete", style="green")
        text.append(": certified bounds")
    else:
        wide = result.status is RiskStatus.WIDE
        why = _SLICED if result.region is not None and result.region.sliced else _WIDE
        text.append(why if wide else stopped(result.status, result.reason), style="yellow")
        text.append(": certified bounds so far")
    text.append(f", a value outside of declared bounds fails; {plural(result.cells, 'cell')}")
    if count := len(result.disjoint):
        text.append(f", {count} {'box' if count == 1 else 'boxes'} without common points")
    text.append(f", {duration(result.seconds)}.")
    return text
