"""What `--json` prints of converted plans, executions and certificates, as in :mod:`robust.show.documents`.

Executions for people: who did what when, and why plans were given up; and whether boxes are controllable.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

from msgspec import UNSET, Meta, UnsetType
from rich import box as borders
from rich.console import Console
from rich.table import Table
from rich.text import Text

from robust.execute.controllability import ADVERBS, ControllabilityReport, Widest
from robust.execute.controllable_boxes import HORIZON, Loss, Shrunk
from robust.execute.dispatchable import Guarantee
from robust.execute.parametrization import option_of, write_specs
from robust.execute.replan import ReplanningRun, RunStatus, Segment
from robust.execute.slices import Remainder, SliceAnswer
from robust.execute.worlds import InstanceOutcome
from robust.irr.stops import advice
from robust.json_text import Count, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import end, format_number, plural, readable
from robust.plan.stn import write_stn
from robust.qe.box import Side, interval_text
from robust.show.console import colour_of, show_table, table
from robust.show.documents import (
    Broken,
    Document,
    Ended,
    Ends,
    Noted,
    Rationals,
    Solver,
    box_of,
    broken,
    document,
    exact,
)
from robust.show.text import percentages, print_advice

if TYPE_CHECKING:
    from rich.console import Console

    from robust.execute.convert import Conversion
    from robust.execute.replan import ReplanningRun, Segment
    from robust.options.batch import ConvertCommand, ExecuteCommand
    from robust.plan.simulate import Violation

# -- convert and execute -----------------------------------------------------------------------------------------------


class Tightened(JsonObject):
    """
    Attributes:
        lower: target - source is at least this
        own: the distance in the time-triggered plan, from the earlier of the two points
        obligation: broke without a bound
    """

    source: str
    target: str
    lower: Rational
    own: Rational
    obligation: str


class Files(JsonObject):
    plan: str | UnsetType = UNSET
    parameters: str | UnsetType = UNSET
    stnu: str | UnsetType = UNSET


class Convert(Noted, tag_field="schema", tag="robust/convert/1"):
    """robust convert --json: a time-triggered plan with a temporal network

    Attributes:
        verdict: about all schedules of the network at nominal values, always proved in mode causal; invalid: the
            time-triggered plan itself breaks obligations
        stn: the plan as text; null if the time-triggered plan is invalid
        parameters: names of all parameters
        parameter_file: TOML with the parameters that the plan cannot hold by itself, for --parameters
        schedule: times of the time-triggered plan by time point
        redundant: edges left out because others imply them
        tightened: bounds needed beyond what keeps atoms true
        violations: what the time-triggered plan breaks
    """

    verdict: Annotated[str, one_of("proved", "refuted", "unknown", "invalid")]
    mode: Annotated[str, one_of("causal", "esterel")]
    solver: Solver
    epsilon: Rational
    stn: str | None
    parameters: list[str]
    parameter_file: str | None
    files: Files
    schedule: Rationals
    instances: Count
    constraints: Count
    redundant: Count
    obligations: Count
    tightened: list[Tightened]
    violations: list[Broken]


def converted(found: Conversion, written: Mapping[str, str] = MappingProxyType({})) -> Document:
    """Of a conversion, and by kind the files that were written."""
    return document(
        Convert(
            verdict=found.check.answer.value,
            mode=found.mode.value,
            solver=found.solver,
            epsilon=found.epsilon,
            stn=write_stn(found.stn),
            parameters=[one.name for one in found.plan.parameters],
            parameter_file=write_specs(found.beside) or None,
            files=Files(**written),
            schedule=exact(found.schedule),
            instances=len(found.stn.instances),
            constraints=len(found.stn.constraints),
            redundant=found.redundant,
            obligations=len(found.check.obligations),
            tightened=[
                like(Tightened, one, source=str(one.edge.source), target=str(one.edge.target), lower=one.edge.weight)
                for one in found.tightened
            ],
            violations=[],
        )
    )


def unconverted(options: ConvertCommand, violations: Sequence[Violation]) -> Document:
    """Of a time-triggered plan that is invalid."""
    return document(
        Convert(
            verdict="invalid",
            mode=options.mode,
            solver=options.solver,
            epsilon=options.separation,
            stn=None,
            parameters=[],
            parameter_file=None,
            files=Files(),
            schedule={},
            instances=0,
            constraints=0,
            redundant=0,
            obligations=0,
            tightened=[],
            violations=broken(violations),
        )
    )


def print_conversion(out: Console, found: Conversion, *, quiet: bool) -> None:
    """Unless `quiet` how the plan was made, then the plan."""
    for line in () if quiet else conversion_lines(found):
        out.print(line, soft_wrap=True)
    if not quiet:
        out.print()
    out.print(write_stn(found.stn).rstrip("\n"), soft_wrap=True)


def conversion_lines(found: Conversion, written: Mapping[str, str] = MappingProxyType({})) -> list[str]:
    """How a plan was made, where it was written, and what reading it needs."""
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
    if "stnu" in written:
        lines.append(f"network with uncertainty: {written['stnu']}")
    if "parameters" in written:
        lines.append(f"parameters: {written['parameters']}, found there by whoever reads the plan")
    elif found.beside:
        given = " ".join(f"--parameter {shlex.quote(option_of(spec))}" for spec in found.beside)
        lines.append(f"reading this plan needs {given}")
    return lines


class ExecutedAction(JsonObject):
    """
    Attributes:
        end: null if it was still running
    """

    instance: str
    action: str
    start: Rational
    end: Rational | None
    outcome: Annotated[str, one_of("done", "failed", "stopped", "running")]


class Seen(JsonObject):
    """
    Attributes:
        what: a parameter, or a duration that was not as planned
    """

    time: Rational
    what: str
    value: Rational
    inside: bool


class Rejected(JsonObject):
    time: Rational
    reason: str


class WhatIsLeft(JsonObject):
    """
    Attributes:
        after: what was observed
        answer: promised: the plan succeeds while what is still unknown is inside the box
        box: the promise, with the values that were seen; null if there is none
        kept: whether it holds what was promised before
    """

    time: Rational
    after: str
    answer: Annotated[str, one_of("promised", "nothing is left", "out of time")]
    box: dict[str, Ends] | None
    kept: bool
    seconds: Seconds


class ExecutedPlan(JsonObject):
    """
    Attributes:
        start: when the plan began, from the beginning of the run
        guarantee: dynamic: the plan succeeds while observations are inside the box; weak: a schedule that succeeds
            exists, but no strategy is certain to find it; none: nothing was proved
        left: what was left of the envelope after each observation, with executor slice
        rejected: messages that changed nothing
        given_up: when the plan was given up; null if it was carried out
        reason: why it was given up
    """

    start: Rational
    end: Rational
    guarantee: Annotated[str, one_of("dynamic", "weak", "none")]
    box: dict[str, Ends]
    executed: list[ExecutedAction]
    observations: list[Seen]
    left: list[WhatIsLeft]
    rejected: list[Rejected]
    given_up: Rational | None
    reason: str | None
    planner_seconds: Seconds
    preparation_seconds: Seconds


class ExecutedRun(JsonObject):
    """
    Attributes:
        reason: why it failed; empty if it succeeded
        inside: whether all observations were inside the boxes
    """

    seed: int | str
    status: Annotated[str, one_of("succeeded", "failed")]
    reason: str
    replans: Count
    inside: bool
    end: Rational
    seconds: Seconds
    plans: list[ExecutedPlan]


class Summary(JsonObject):
    """the figures of Tables 1 and 2 of the paper

    Attributes:
        average_replans: of the runs that succeeded
        inside: runs in which all observations were inside the boxes
    """

    runs: Count
    succeeded: Count
    coverage: Annotated[float, Meta(ge=0, le=1)] | None
    average_replans: Annotated[float, Meta(ge=0)] | None
    inside: Count


def summary(runs: Sequence[ReplanningRun]) -> Summary:
    """Coverage, and the average number of re-plans of successful runs."""
    succeeded = [run for run in runs if run.status.value == "succeeded"]
    return Summary(
        runs=len(runs),
        succeeded=len(succeeded),
        coverage=len(succeeded) / len(runs) if runs else None,
        average_replans=sum(run.replans for run in succeeded) / len(succeeded) if succeeded else None,
        inside=sum(1 for run in runs if run.inside),
    )


class Execute(Noted, tag_field="schema", tag="robust/execute/1"):
    """robust execute --json: simulated executions with re-planning

    Attributes:
        status: whether all runs were made
    """

    status: Ended
    executor: str
    planner: str | None
    plan: str | None
    world: str | None
    epsilon: Rational
    summary: Summary
    runs: list[ExecutedRun]


def execute(options: ExecuteCommand, runs: Sequence[ReplanningRun], status: str) -> Document:
    return document(
        like(
            Execute,
            options,
            status=status,
            epsilon=options.separation,
            summary=summary(runs),
            runs=[like(ExecutedRun, run, plans=[_executed(segment) for segment in run.segments]) for run in runs],
        )
    )


def _executed(segment: Segment) -> ExecutedPlan:
    return like(
        ExecutedPlan,
        segment,
        box=box_of(segment.box),
        executed=[
            like(ExecutedAction, one, instance=one.instance.identifier, action=str(one.instance))
            for one in segment.executed
        ],
        observations=[like(Seen, one) for one in segment.observations],
        left=[
            like(WhatIsLeft, one, answer=one.answer.value, box=None if one.box is None else box_of(one.box))
            for one in segment.remainders
        ],
        rejected=[like(Rejected, one) for one in segment.rejected],
        reason=None if segment.ending is None else str(segment.ending),
    )


# -- certify and verify ------------------------------------------------------------------------------------------------


class Certify(Noted, tag_field="schema", tag="robust/certify/1"):
    """robust certify --json: a certificate that has been written and checked."""

    kind: Annotated[str, one_of("plan", "box", "maximal", "region", "execution", "knowledge")]
    certificate: str
    bytes: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    checking_s: Seconds
    claim: str
    epsilon: str
    files: dict[str, str]
    obligations: Count
    refuted: Count
    alethe_holes: Count | None


class Proved(JsonObject):
    """The values of a parameter that have been proved."""

    lower: str
    upper: str
    lower_closed: bool
    upper_closed: bool


class Verify(JsonObject, tag_field="schema", tag="robust/verify/1"):
    """robust verify --json: what a certificate establishes of files with these digests."""

    verdict: Annotated[str, one_of("established", "rejected")]
    kind: str | None
    claim: str | None
    epsilon: str | None
    box: dict[str, Proved] | None
    files: dict[str, str]
    obligations: Count | None
    refuted: Count | None
    reason: str | None
    seconds: Seconds


DOCUMENTS: tuple[type[JsonObject], ...] = (Convert, Execute, Certify, Verify)
"""As in :mod:`robust.show.documents`."""

_GUARANTEES = {
    Guarantee.DYNAMIC: "dynamically controllable: the plan succeeds while observations are inside",
    Guarantee.WEAK: "not dynamically controllable: the plan may fail although observations are inside",
    Guarantee.NONE: "no guarantee",
}
_OUTCOMES = {
    InstanceOutcome.DONE: "end",
    InstanceOutcome.FAILED: "failed",
    InstanceOutcome.STOPPED: "stopped",
    InstanceOutcome.RUNNING: "running",
}
_REASONS = 5
"""Reasons of failures that are shown at most."""


# -- for people --------------------------------------------------------------------------------------------------------


def print_run(out: Console, run: ReplanningRun, executor: str, *, quiet: bool) -> None:
    """How a run ended; unless `quiet` also its timeline."""
    out.print(_verdict(run, executor), soft_wrap=True)
    if quiet:
        return
    for number, segment in enumerate(run.segments, start=1):
        out.print()
        out.print(f"plan {number}, from {readable(segment.start)}: {_GUARANTEES[segment.guarantee]}", soft_wrap=True)
        for parameter in segment.plan.parameters:
            interval = segment.box[parameter.name]
            percent = percentages(parameter, interval)
            out.print(
                f"  {parameter.name} in {interval.written(format_number)}{percent and f' ({percent})'}", soft_wrap=True
            )
        print_advice(out, advice(segment.plan, segment.box))
        for time, what, detail in sorted(_events(segment), key=lambda event: event[0]):
            out.print(f"{readable(time):>10}  {what:<9} {detail}", soft_wrap=True)


def _verdict(run: ReplanningRun, executor: str) -> Text:
    succeeded = run.status is RunStatus.SUCCEEDED
    text = Text(run.status.value, style="green" if succeeded else "bold red")
    text.append(f" at {readable(run.end)} with {plural(run.replans, 're-plan')} ({executor}, seed {run.seed})", "none")
    if run.reason:
        text.append(f": {run.reason}", "none")
    return text


def _events(segment: Segment) -> Iterator[tuple[Fraction, str, str]]:
    for one in segment.executed:
        name = f"{one.instance.identifier} {one.instance}"
        if not one.instance.durative:
            yield one.start, "do", name
            continue
        yield one.start, "start", name
        if one.end is not None:
            yield one.end, _OUTCOMES[one.outcome], name
    for seen in segment.observations:
        yield seen.time, "observed", f"{seen.what} = {readable(seen.value)}{'' if seen.inside else ', outside'}"
    for left in segment.remainders:
        yield left.time, "left", _left(left)
    for rejected in segment.rejected:
        yield rejected.time, "rejected", rejected.reason
    if segment.ending is not None and segment.given_up is not None:
        yield segment.given_up, "gave up", str(segment.ending)


def _left(left: Remainder) -> str:
    """What is still unknown, and in which values the plan succeeds."""
    if left.box is None:
        late = left.answer is SliceAnswer.OUT_OF_TIME
        return "not known in time; only the box promised before counts" if late else "nothing of the envelope"
    unknown = [f"{name} in {one.written(format_number)}" for name, one in left.box.intervals.items() if one.width != 0]
    changed = "" if left.kept else "another promise: "
    return f"{changed}{', '.join(unknown)}" if unknown else "all is known"


def print_runs(out: Console, runs: Sequence[ReplanningRun], executor: str, *, quiet: bool) -> None:
    """How many runs succeeded; unless `quiet` also why the others failed."""
    found = summary(runs)
    row = (
        executor,
        str(found.runs),
        str(found.succeeded),
        "" if found.coverage is None else f"{100 * found.coverage:.1f} %",
        "" if found.average_replans is None else f"{found.average_replans:.2f}",
        str(found.inside),
    )
    columns = ("executor", "runs", "succeeded", "coverage", "re-plans of these", "always inside the box")
    shown = Table(box=borders.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        shown.add_column(column, justify="left" if column == "executor" else "right")
    shown.add_row(*row)
    out.print(shown)
    if quiet:
        return
    reasons = Counter(_kind(run.reason) for run in runs if run.reason)
    for reason, count in reasons.most_common(_REASONS):
        out.print(f"failed {plural(count, 'time')}: {reason}", soft_wrap=True)
    if len(reasons) > _REASONS:
        out.print(f"and {len(reasons) - _REASONS} other reasons")


def _kind(reason: str) -> str:
    """A reason without the numbers of one run: what was outside of the box, and what came of it."""
    first, _, rest = reason.partition("; ")
    subject, equals, _ = first.partition(" = ")
    shown = f"{subject} left its interval" if equals else first
    return f"{shown}; {rest}" if rest else shown


# -- controllability ---------------------------------------------------------------------------------------------------


def print_controllability(out: Console, report: ControllabilityReport, *, quiet: bool) -> None:
    """The verdicts, and the part that is controllable where the box is not; unless `quiet` also reasons and waits."""
    out.print()
    for one in report.findings:
        text = Text.assemble((one.verdict.value, colour_of(one.verdict.value)), f": {ADVERBS[one.kind]}")
        if one.reason is not None and not quiet:
            text.append(f"; {one.reason}")
        out.print(text, soft_wrap=True)
    if report.failure is not None:
        out.print(Text(f"no {ADVERBS[report.wanted]} controllable part: {report.failure}", "yellow"), soft_wrap=True)
    elif report.shrunk is not None and report.lost is not None and not report.was_controllable:
        _print_part(out, report, report.shrunk, report.lost, quiet)
        if report.widest is not None:
            _print_widest(out, report.widest, ADVERBS[report.wanted], quiet)
    if not quiet:
        for line in report.waits:
            out.print(Text(line, style="dim"), soft_wrap=True)


def _print_part(out: Console, report: ControllabilityReport, shrunk: Shrunk, lost: Loss, quiet: bool) -> None:
    columns = ("parameter", "box", f"{ADVERBS[report.wanted]} controllable", "lost below", "lost above")
    rows = [
        (
            name,
            interval_text(report.box[name]),
            interval_text(interval),
            *(end(lost.faces[name, side], upper=True) for side in Side),
        )
        for name, interval in shrunk.box.intervals.items()
    ]
    out.print()
    show_table(out, table(columns, rows, right=columns[1:]))
    if quiet:
        return
    out.print()
    share = "" if lost.share is None else f"; {float(lost.share):.1%} of the total width is lost"
    largest = f"no {ADVERBS[report.wanted]} controllable part of the box contains this one{share}."
    out.print(Text(largest), soft_wrap=True)
    if shrunk.cut:
        names = ", ".join(dict.fromkeys(name for name, _ in shrunk.cut))
        text = f"{names} may be any finite amount larger: ends were set {readable(HORIZON)} weights from the centre."
        out.print(Text(text), soft_wrap=True)


def _print_widest(out: Console, widest: Widest, adverb: str, quiet: bool) -> None:
    """The widest box that is controllable and, unless `quiet`, what stops each of its ends."""
    out.print()
    where = "no wider one is in the envelope" if widest.bound is not None else "no box in the envelope contains it"
    out.print(f"the widest {adverb} controllable box: {where} that is {adverb} controllable", soft_wrap=True)
    for name, interval in widest.box.intervals.items():
        out.print(Text(f"  {name} in {interval_text(interval)}"), soft_wrap=True)
        for side, word in ((Side.LOWER, "below"), (Side.UPPER, "above")):
            stop = widest.stops.get((name, side))
            if stop is not None and not quiet:
                out.print(Text(f"    {word}: {stop.short}", "dim"), soft_wrap=True)
