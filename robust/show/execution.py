"""Conversions, executions and controllability, for people and as JSON."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import ceil, floor
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from msgspec import UNSET, Meta, UnsetType, field
from rich import box as borders
from rich.table import Table

from robust.backends import CONVERSIONS
from robust.execute import causal, convert, dispatchable, slices, worlds
from robust.execute.controllability import ADVERBS, ControllabilityReport, Widest
from robust.execute.controllable_boxes import HORIZON, Loss, Shrunk
from robust.execute.forecast import Prospect, Window
from robust.execute.monitor import Outlook, StepOutlook, SuccessOutlook
from robust.execute.parametrization import option_of, write_specs
from robust.execute.replan import ReplanningRun, RunStatus, Segment
from robust.irr.stops import advice
from robust.json_text import Count, JsonObject, Rational, Seconds, like, on_wire, one_of, wire
from robust.numbers import end, format_number, plural, readable
from robust.plan.stn import write_stn
from robust.qe.box import Box, Side, interval_text
from robust.show import documents
from robust.show.console import Console, Text, colour_of, printing
from robust.show.documents import Document, Ended, Noted, Rationals, Solver, document, document_of, has_table
from robust.show.tables import show_table, table
from robust.show.text import percentages, print_advice

if TYPE_CHECKING:
    from robust.execute.dispatcher import MessageRejected, Observation
    from robust.execute.tree_writer import MadeTree
    from robust.options.batch import ConvertCommand, ExecuteCommand
    from robust.plan.simulate import Violation


_GUARANTEES = {
    dispatchable.Guarantee.DYNAMIC: "dynamically controllable: the plan succeeds while observations are inside",
    dispatchable.Guarantee.WEAK: "not dynamically controllable: the plan may fail although observations are inside",
    dispatchable.Guarantee.NONE: "no guarantee",
}
_OUTCOMES = {
    worlds.InstanceOutcome.DONE: "end",
    worlds.InstanceOutcome.FAILED: "failed",
    worlds.InstanceOutcome.STOPPED: "stopped",
    worlds.InstanceOutcome.RUNNING: "running",
}
_REASONS = 5
"""Reasons of failures that are shown at most."""


# -- convert -----------------------------------------------------------------------------------------------------------


class TighteningRecord(JsonObject):
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
    tree: str | UnsetType = UNSET


class Convert(Noted, kw_only=True, tag_field="schema", tag="robust/convert/1"):
    """robust convert --json: a time-triggered plan with a temporal network

    Attributes:
        verdict: about all schedules of the network at nominal values, always proved but in mode esterel; invalid: the
            time-triggered plan itself breaks obligations
        stn: the plan as text; null if the time-triggered plan is invalid
        parameters: names of all parameters
        parameter_file: TOML with the parameters that the plan cannot hold by itself, for --parameters
        schedule: times of the time-triggered plan by time point
        redundant: edges left out because others imply them
        tightened: bounds needed beyond what keeps atoms true
        violations: what the time-triggered plan breaks
        unkept: with --tree: constraints of the network that the tree cannot keep
    """

    verdict: Annotated[str, one_of("proved", "refuted", "unknown", "invalid")]
    mode: Annotated[str, one_of(*CONVERSIONS)]
    solver: Solver
    epsilon: Rational
    stn: str | None = None
    parameters: list[str]
    parameter_file: str | None = None
    files: Files = field(default_factory=Files)
    schedule: Rationals = field(default_factory=dict)
    instances: Count = 0
    constraints: Count = 0
    redundant: Count = 0
    obligations: Count = 0
    tightened: list[causal.Tightening] = field(default_factory=list)
    violations: list[Violation] = field(default_factory=list)
    unkept: list[str] | UnsetType = UNSET


@documents.documenting.register(convert.Conversion)
def converted(
    conversion: convert.Conversion, written: Mapping[str, str] = MappingProxyType({}), made: MadeTree | None = None
) -> Document:
    """The document of a conversion, with the files that were written, by kind, and the tree that is among them."""
    return document_of(
        Convert,
        conversion,
        verdict=conversion.check.answer,
        stn=write_stn(conversion.stn),
        parameters=[parameter.name for parameter in conversion.plan.parameters],
        parameter_file=write_specs(conversion.beside) or None,
        files=Files(**written),
        instances=len(conversion.stn.instances),
        constraints=len(conversion.stn.constraints),
        obligations=len(conversion.check.obligations),
        unkept=UNSET if made is None else list(map(str, made.unkept)),
        notes=UNSET,
    )


class TreeExport(Noted, tag_field="schema", tag="robust/tree/1"):
    """robust convert --tree FILE --json, of a plan that is a network already

    Attributes:
        verdict: about all executions of the tree; no other tree is written
        written: the file
        orders: pairs of time points that nodes of the tree put in order
        unkept: constraints of the plan's network that the tree cannot keep, and the proof does not need
    """

    verdict: Annotated[str, one_of("proved")]
    written: str
    steps: Count
    orders: Count
    unkept: list[str]


def tree_document(made: MadeTree, file: str) -> Document:
    """The document of a tree that was written."""
    verdict, tree, unkept = made.check.answer.value, made.tree, list(map(str, made.unkept))
    return document(
        TreeExport(verdict=verdict, written=file, steps=len(tree.steps), orders=len(tree.orders), unkept=unkept)
    )


def tree_lines(made: MadeTree, file: str) -> list[str]:
    """Lines on a tree that was written."""
    size = f"{plural(len(made.tree.steps), 'step')}, {plural(len(made.tree.orders), 'order')}"
    return [
        f"tree: {file}, {size}, all executions are valid",
        *(f"not kept by the tree: {item}" for item in made.unkept),
    ]


@wire.register(causal.Tightening)
def _(tightening: causal.Tightening) -> TighteningRecord:
    edge = tightening.edge
    return like(TighteningRecord, tightening, source=str(edge.source), target=str(edge.target), lower=edge.weight)


has_table(convert.Conversion, "tightened", numbers=("lower", "own"))


def unconverted(options: ConvertCommand, violations: Sequence[Violation]) -> Document:
    """The document of a time-triggered plan that is invalid."""
    return document_of(
        Convert, options, verdict="invalid", epsilon=options.separation, parameters=[], violations=violations
    )


@printing.register(convert.Conversion)
def print_conversion(out: Console, conversion: convert.Conversion, *, quiet: bool) -> None:
    """Unless `quiet` how the plan was made, then the plan."""
    out.lines(() if quiet else conversion_lines(conversion))
    if not quiet:
        out.print()
    out.line(write_stn(conversion.stn).rstrip("\n"))


def conversion_lines(conversion: convert.Conversion, written: Mapping[str, str] = MappingProxyType({})) -> list[str]:
    """Lines on how a plan was converted, where it was written, and which parameters must be given to read it."""
    instances, constraints = len(conversion.stn.instances), len(conversion.stn.constraints)
    size = f"{plural(instances, 'instance')}, {plural(constraints, 'constraint')}"
    lines = [f"{conversion.check.answer.value}: {size}, {plural(len(conversion.stn.parameters), 'parameter')}"]
    broken = next(iter(conversion.check.counterexamples), None)
    if broken is not None:
        lines.append(f"an allowed schedule breaks {broken}; --mode room gives a network that is proved")
    for needed in conversion.tightened:
        edge = needed.edge
        lines.append(f"needed: {edge.target} - {edge.source} >= {format_number(edge.weight)} for {needed.obligation}")
    if "plan" in written:
        lines.append(f"plan: {written['plan']}")
    if "stnu" in written:
        lines.append(f"network with uncertainty: {written['stnu']}")
    if "parameters" in written:
        lines.append(f"parameters: {written['parameters']}, found there by whoever reads the plan")
    elif conversion.beside:
        given = " ".join(f"--parameter {shlex.quote(option_of(spec))}" for spec in conversion.beside)
        lines.append(f"reading this plan needs {given}")
    return lines


# -- execute -----------------------------------------------------------------------------------------------------------


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


@wire.register(worlds.ExecutedInstance)
def _(executed: worlds.ExecutedInstance) -> ExecutedAction:
    return like(ExecutedAction, executed, instance=executed.instance.identifier, action=str(executed.instance))


on_wire("MessageRejected", message=None)


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
    box: Box
    executed: list[worlds.ExecutedInstance]
    observations: list[Observation]
    left: list[slices.Remainder]
    rejected: list[MessageRejected]
    given_up: Rational | None
    reason: str | None
    planner_seconds: Seconds
    preparation_seconds: Seconds


@wire.register(Segment)
def _(segment: Segment) -> ExecutedPlan:
    reason = None if segment.ending is None else str(segment.ending)
    return like(ExecutedPlan, segment, left=segment.remainders, reason=reason)


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
    plans: list[Segment]


@wire.register(ReplanningRun)
def _(run: ReplanningRun) -> ExecutedRun:
    return like(ExecutedRun, run, plans=run.segments)


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
    runs: list[ReplanningRun]


def execute(options: ExecuteCommand, runs: Sequence[ReplanningRun], status: str) -> Document:
    """The document that `robust execute --json` prints."""
    epsilon = options.separation
    return document_of(Execute, options, status=status, epsilon=epsilon, summary=summary(runs), runs=list(runs))


def print_run(out: Console, run: ReplanningRun, executor: str, *, quiet: bool) -> None:
    """Print how a run ended; unless `quiet` also its timeline."""
    out.line(_verdict(run, executor))
    if quiet:
        return
    for number, segment in enumerate(run.segments, start=1):
        out.print()
        out.line(f"plan {number}, from {readable(segment.start)}: {_GUARANTEES[segment.guarantee]}")
        for parameter in segment.plan.parameters:
            interval = segment.box[parameter.name]
            percent = percentages(parameter, interval)
            out.line(f"  {parameter.name} in {interval.written(format_number)}{percent and f' ({percent})'}")
        print_advice(out, advice(segment.plan, segment.box))
        for time, what, detail in sorted(_events(segment), key=lambda event: event[0]):
            out.line(f"{readable(time):>10}  {what:<9} {detail}")


def _verdict(run: ReplanningRun, executor: str) -> Text:
    succeeded = run.status is RunStatus.SUCCEEDED
    text = Text(run.status.value, style="green" if succeeded else "bold red")
    text.append(f" at {readable(run.end)} with {plural(run.replans, 're-plan')} ({executor}, seed {run.seed})", "none")
    if run.reason:
        text.append(f": {run.reason}", "none")
    return text


def _events(segment: Segment) -> Iterator[tuple[Fraction, str, str]]:
    for executed in segment.executed:
        name = f"{executed.instance.identifier} {executed.instance}"
        if not executed.instance.durative:
            yield executed.start, "do", name
            continue
        yield executed.start, "start", name
        if executed.end is not None:
            yield executed.end, _OUTCOMES[executed.outcome], name
    for observed in segment.observations:
        where = "" if observed.inside else ", outside"
        yield observed.time, "observed", f"{observed.what} = {readable(observed.value)}{where}"
    for remainder in segment.remainders:
        yield remainder.time, "left", _remainder(remainder)
    for rejected in segment.rejected:
        yield rejected.time, "rejected", rejected.reason
    if segment.ending is not None and segment.given_up is not None:
        yield segment.given_up, "gave up", str(segment.ending)


def _remainder(remainder: slices.Remainder) -> str:
    """The parameters that are still unknown, and the values for which the plan succeeds."""
    if remainder.box is None:
        late = remainder.answer is slices.SliceAnswer.OUT_OF_TIME
        return "not known in time; only the box promised before counts" if late else "nothing of the envelope"
    unknown = [
        f"{name} in {interval.written(format_number)}"
        for name, interval in remainder.box.intervals.items()
        if interval.width != 0
    ]
    changed = "" if remainder.kept else "another promise: "
    return f"{changed}{', '.join(unknown)}" if unknown else "all is known"


def print_runs(out: Console, runs: Sequence[ReplanningRun], executor: str, *, quiet: bool) -> None:
    """Print how many runs succeeded; unless `quiet` also why the others failed."""
    figures = summary(runs)
    row = (
        executor,
        str(figures.runs),
        str(figures.succeeded),
        "" if figures.coverage is None else f"{100 * figures.coverage:.1f} %",
        "" if figures.average_replans is None else f"{figures.average_replans:.2f}",
        str(figures.inside),
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
        out.line(f"failed {plural(count, 'time')}: {reason}")
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
    for finding in report.findings:
        text = Text.assemble((finding.verdict.value, colour_of(finding.verdict.value)), f": {ADVERBS[finding.kind]}")
        if finding.reason is not None and not quiet:
            text.append(f"; {finding.reason}")
        out.line(text)
    if report.failure is not None:
        out.line(f"no {ADVERBS[report.wanted]} controllable part: {report.failure}", "yellow")
    elif report.shrunk is not None and report.lost is not None and not report.was_controllable:
        _print_part(out, report, report.shrunk, report.lost, quiet)
        if report.widest is not None:
            _print_widest(out, report.widest, ADVERBS[report.wanted], quiet)
    if not quiet:
        out.lines(report.waits, "dim")


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
    out.line(largest)
    if shrunk.cut:
        names = ", ".join(dict.fromkeys(name for name, _ in shrunk.cut))
        text = f"{names} may be any finite amount larger: ends were set {readable(HORIZON)} weights from the centre."
        out.line(text)


def _print_widest(out: Console, widest: Widest, adverb: str, quiet: bool) -> None:
    """The widest box that is controllable and, unless `quiet`, what stops each of its ends."""
    out.print()
    where = "no wider one is in the envelope" if widest.bound is not None else "no box in the envelope contains it"
    out.line(f"the widest {adverb} controllable box: {where} that is {adverb} controllable")
    for name, interval in widest.box.intervals.items():
        out.line(f"  {name} in {interval_text(interval)}")
        for side, word in ((Side.LOWER, "below"), (Side.UPPER, "above")):
            stop = widest.stops.get((name, side))
            if stop is not None and not quiet:
                out.line(f"    {word}: {stop.short}", "dim")


# -- plans that run ----------------------------------------------------------------------------------------------------


class Planned(JsonObject):
    """
    Attributes:
        status: asked: a planner is asked, the run goes on; found: the run goes on with this plan; failed: no plan, for
            a reason; overtaken: what happened meanwhile is not in the plan, another one is asked for
        begins: nothing that the plan adds starts before
        limit_s: seconds after which there is an answer
        plans: how many valid plans came back; this one bears most
        tolerance: λ*, by what share all durations may be longer or shorter at once; null if no number says it
        plan: with domain and problem it is a plan as all commands read them
        parameters: for --parameters
    """

    status: Annotated[str, one_of("asked", "found", "failed", "overtaken")]
    reason: str | UnsetType = UNSET
    begins: Rational | UnsetType = UNSET
    limit_s: Seconds | UnsetType = UNSET
    planner: str | UnsetType = UNSET
    seconds: Seconds | UnsetType = UNSET
    plans: Count | UnsetType = UNSET
    tolerance: Rational | UnsetType | None = UNSET
    domain: str | UnsetType = UNSET
    problem: str | UnsetType = UNSET
    plan: str | UnsetType = UNSET
    parameters: str | UnsetType = UNSET


class Watch(JsonObject, tag_field="schema", tag="robust/watch/1"):
    """robust watch: a line for each message, and one before the first

    Attributes:
        message: the number of the message, by which it can be taken back; 0 before the first
        time: what time it is at least
        prospect: done: all has happened; on track: it succeeds if steps take as long as planned; at risk: only if some
            take less; broken: whatever happens
        reasons: what contradicts itself, of a plan that is broken or at risk
        warnings: what fails unless it happens in time
        running: steps that have started and not ended
        startable: steps that may start now
        coming: the first of the other steps to come
        refused: why the message changed nothing
        assumed: what the answer rests on although it does not fit what was said, such as ends of steps without starts
        replan: whether only another plan helps
        promise: as long as the durations of all steps that have not ended are within, the plan succeeds
        success: bounds of the probability of success, and for what time they were worked out
        reordered: whether the plan goes on in another order than its own
        exact: whether windows and slack are all that is left; else they are what is promised, and more may be left
        planning: news of another plan
        error: why the line was no message; there is nothing else then
    """

    DECIMALS: ClassVar = True
    message: Count | UnsetType = UNSET
    time: Rational | UnsetType = UNSET
    prospect: Annotated[str, one_of(*(prospect.value for prospect in Prospect))] | UnsetType = UNSET
    reasons: list[str] | UnsetType = UNSET
    warnings: list[str] | UnsetType = UNSET
    running: list[StepOutlook] | UnsetType = UNSET
    startable: list[StepOutlook] | UnsetType = UNSET
    coming: list[StepOutlook] | UnsetType = UNSET
    refused: str | UnsetType | None = UNSET
    assumed: list[str] | UnsetType = UNSET
    replan: bool | UnsetType = UNSET
    promise: Mapping[str, tuple[Fraction, Fraction | None]] | UnsetType | None = UNSET
    success: SuccessOutlook | UnsetType | None = UNSET
    reordered: bool | UnsetType = UNSET
    exact: bool | UnsetType = UNSET
    planning: Planned | UnsetType = UNSET
    error: str | UnsetType = UNSET


def outlook_line(outlook: Outlook, numbers: str, coming: int, news: Mapping[str, Any] | None = None) -> Document:
    """What `robust watch` prints; decimals are rounded such that what they promise holds."""
    planning = UNSET if news is None else Planned(**news)
    known = {"prospect": outlook.prospect.value, "coming": list(outlook.coming[:coming]), "planning": planning}
    said = document_of(Watch, outlook, **known)
    if numbers == "decimal":
        said["time"] = _decimal(said["time"], up=False)
        for look in (*said["running"], *said["startable"], *said["coming"]):
            for name in ("start", "end"):
                look[name] = [_decimal(time, up=not late) for late, time in enumerate(look[name])]
            for name in ("since", "slack", "left"):
                look[name] = _decimal(look[name], up=False)
        for step, interval in (said["promise"] or {}).items():
            said["promise"][step] = [_decimal(end, up=not late) for late, end in enumerate(interval)]
        for name in ("lower", "upper", "time") if said["success"] else ():
            said["success"][name] = _decimal(said["success"][name], up=name == "upper")
        for name in ("begins", "tolerance"):
            if name in said.get("planning", {}):
                said["planning"][name] = _decimal(said["planning"][name], up=name == "begins")
    return said


@documents.documenting.register(Outlook)
def outlook_document(outlook: Outlook) -> Document:
    """`robust/watch/1`, all steps to come included."""
    return outlook_line(outlook, "exact", len(outlook.coming))


has_table(
    Outlook,
    numbers=("since", "slack", "left"),
    rows=lambda said: [
        {**look, "state": state} for state in ("running", "startable", "coming") for look in said.get(state, ())
    ],
)


@printing.register(Outlook)
def print_outlook(out: Console, outlook: Outlook, *, quiet: bool) -> None:
    """Print what is ahead; unless `quiet` also of each step that has not ended."""
    order = ", in another order of steps" if outlook.reordered else ""
    out.print(f"{outlook.prospect.value} at {readable(outlook.time)}{order}")
    reasons = [f"refused: {outlook.refused}"] if outlook.refused else []
    out.lines((*reasons, *outlook.assumed, *outlook.reasons, *outlook.warnings))
    if outlook.success is not None:
        lower, upper = outlook.success.lower, outlook.success.upper
        out.line(f"P(success) in [{readable(lower)}, {readable(upper)}], as known at {readable(outlook.success.time)}")
    looks = (*outlook.running, *outlook.startable, *outlook.coming)
    if quiet or not looks:
        return
    out.print()
    shown = table(("step", "action", "starts", "ends", "slack", "may still take"))
    for look in looks:
        starts = f"{readable(look.since)}, runs" if look.since is not None else _window_text(look.start)
        rooms = ("no limit" if room is None else readable(room) for room in (look.slack, look.left))
        shown.add_row(look.step, look.name, starts, _window_text(look.end), *rooms)
    show_table(out, shown)


def _window_text(window: Window) -> str:
    low, high = window
    return f"from {readable(low)}" if high is None else f"{readable(low)} to {readable(high)}"


def not_a_message(error: str) -> Document:
    """What `robust watch` prints for a line that it cannot read."""
    return document(Watch(error=error))


def _decimal(number: str | None, *, up: bool) -> float | None:
    if number is None:
        return None
    value = Fraction(number) * 10**6
    return (ceil(value) if up else floor(value)) / 10**6
