"""Executions for people: who did what when, and why plans were given up; and whether boxes are controllable."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from fractions import Fraction

from rich import box as borders
from rich.console import Console
from rich.table import Table
from rich.text import Text

from robust.execute.controllability import ADVERBS, ControllabilityReport, Widest
from robust.execute.controllable_boxes import HORIZON, Loss, Shrunk
from robust.execute.dispatchable import Guarantee
from robust.execute.replan import Run, RunStatus, Segment
from robust.execute.slices import Left, SliceAnswer
from robust.execute.worlds import Outcome
from robust.irr.stops import advice
from robust.numbers import end, format_number, plural, readable
from robust.qe.box import Side, interval_text
from robust.show.console import colour_of, show_table, table
from robust.show.made import summary
from robust.show.text import percentages, print_advice

_GUARANTEES = {
    Guarantee.DYNAMIC: "dynamically controllable: the plan succeeds while observations are inside",
    Guarantee.WEAK: "not dynamically controllable: the plan may fail although observations are inside",
    Guarantee.NONE: "no guarantee",
}
_OUTCOMES = {Outcome.DONE: "end", Outcome.FAILED: "failed", Outcome.STOPPED: "stopped", Outcome.RUNNING: "running"}
_REASONS = 5
"""Reasons of failures that are shown at most."""


# -- for people --------------------------------------------------------------------------------------------------------


def print_run(out: Console, run: Run, executor: str, *, quiet: bool) -> None:
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


def _verdict(run: Run, executor: str) -> Text:
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
    for left in segment.left:
        yield left.time, "left", _left(left)
    for rejected in segment.rejected:
        yield rejected.time, "rejected", rejected.reason
    if segment.ending is not None and segment.given_up is not None:
        yield segment.given_up, "gave up", str(segment.ending)


def _left(left: Left) -> str:
    """What is still unknown, and in which values the plan succeeds."""
    if left.box is None:
        late = left.answer is SliceAnswer.OUT_OF_TIME
        return "not known in time; only the box promised before counts" if late else "nothing of the envelope"
    unknown = [f"{name} in {one.written(format_number)}" for name, one in left.box.intervals.items() if one.width != 0]
    changed = "" if left.kept else "another promise: "
    return f"{changed}{', '.join(unknown)}" if unknown else "all is known"


def print_runs(out: Console, runs: Sequence[Run], executor: str, *, quiet: bool) -> None:
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
