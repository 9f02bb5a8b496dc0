"""Simulated executions for people and programs: who did what when, what was observed, and why plans were given up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from rich import box as borders
from rich.console import Console
from rich.table import Table
from rich.text import Text

from robust.execute.dispatch.messages import Observation, interval_text
from robust.execute.dispatch.network import Guarantee
from robust.execute.replan import Run, RunStatus, Segment
from robust.execute.worlds.world import Executed, Outcome
from robust.irr.box import Interval
from robust.plan.model import ActionInstance
from robust.report.gantt import Bar, Chart, Lane, Mark, draw_chart
from robust.report.numbers import exact_end, plural, readable

EXECUTE = "robust/execute/1"
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
        for name, interval in segment.box.intervals.items():
            out.print(f"  {name} in {interval_text(interval)}", soft_wrap=True)
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
    for rejected in segment.rejected:
        yield rejected.time, "rejected", rejected.reason
    if segment.ending is not None and segment.given_up is not None:
        yield segment.given_up, "gave up", str(segment.ending)


def print_runs(out: Console, runs: Sequence[Run], executor: str, *, quiet: bool) -> None:
    """How many runs succeeded; unless `quiet` also why the others failed."""
    found = summary(runs)
    table = Table(box=borders.SIMPLE_HEAD, pad_edge=False)
    for column in ("executor", "runs", "succeeded", "coverage", "re-plans of these", "always inside the box"):
        table.add_column(column, justify="left" if column == "executor" else "right")
    replans = found["average_replans"]
    table.add_row(
        executor,
        str(found["runs"]),
        str(found["succeeded"]),
        "" if found["coverage"] is None else f"{100 * found['coverage']:.1f} %",
        "" if replans is None else f"{replans:.2f}",
        str(found["inside"]),
    )
    out.print(table)
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


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """The figures of Tables 1 and 2 of the paper: coverage, and the average number of re-plans of successful runs."""
    succeeded = [run for run in runs if run.status is RunStatus.SUCCEEDED]
    return {
        "runs": len(runs),
        "succeeded": len(succeeded),
        "coverage": len(succeeded) / len(runs) if runs else None,
        "average_replans": sum(run.replans for run in succeeded) / len(succeeded) if succeeded else None,
        "inside": sum(1 for run in runs if run.inside),
    }


# -- for programs ------------------------------------------------------------------------------------------------------


def run_answer(run: Run) -> dict[str, Any]:
    """One run in `robust/execute/1`."""
    return {
        "seed": run.seed,
        "status": run.status.value,
        "reason": run.reason,
        "replans": run.replans,
        "inside": run.inside,
        "end": str(run.end),
        "seconds": round(run.seconds, 6),
        "plans": [_segment_answer(segment) for segment in run.segments],
    }


def _segment_answer(segment: Segment) -> dict[str, Any]:
    return {
        "start": str(segment.start),
        "end": str(segment.end),
        "guarantee": segment.guarantee.value,
        "box": {name: _interval(interval) for name, interval in segment.box.intervals.items()},
        "executed": [_executed(one) for one in segment.executed],
        "observations": [_observation(one) for one in segment.observations],
        "rejected": [{"time": str(one.time), "reason": one.reason} for one in segment.rejected],
        "given_up": None if segment.given_up is None else str(segment.given_up),
        "reason": None if segment.ending is None else str(segment.ending),
        "planner_seconds": round(segment.planner_seconds, 6),
        "preparation_seconds": round(segment.preparation_seconds, 6),
    }


def _interval(interval: Interval) -> dict[str, Any]:
    return {
        "lower": exact_end(interval.lower, upper=False),
        "upper": exact_end(interval.upper, upper=True),
        "lower_closed": interval.lower is not None and interval.lower_closed,
        "upper_closed": interval.upper is not None and interval.upper_closed,
    }


def _executed(one: Executed) -> dict[str, Any]:
    return {
        "instance": one.instance.identifier,
        "action": str(one.instance),
        "start": str(one.start),
        "end": None if one.end is None else str(one.end),
        "outcome": one.outcome.value,
    }


def _observation(one: Observation) -> dict[str, Any]:
    return {"time": str(one.time), "what": one.what, "value": str(one.value), "inside": one.inside}


# -- as a drawing ------------------------------------------------------------------------------------------------------


def plot_run(run: Run, executor: str, path: Path) -> None:
    """A Gantt chart: a lane for each first argument of an action, which most domains give to who acts."""
    executed = [one for segment in run.segments for one in segment.executed]
    lanes = tuple(Lane(name) for name in dict.fromkeys(_lane(one.instance) for one in executed))
    kinds = {Outcome.DONE: "action", Outcome.RUNNING: "running"}
    bars = tuple(
        Bar(
            _lane(one.instance),
            one.start,
            one.end,
            f"{one.instance.action} {' '.join(one.instance.arguments[1:])}".strip(),
            kinds.get(one.outcome, one.outcome.value),
        )
        for one in executed
    )
    title = f"{run.status.value} with {plural(run.replans, 're-plan')} ({executor}, seed {run.seed})"
    draw_chart(Chart(title, lanes, bars, tuple(_marks(run))), path)


def _lane(instance: ActionInstance) -> str:
    return instance.arguments[0] if instance.arguments else instance.action


def _marks(run: Run) -> Iterator[Mark]:
    for number, segment in enumerate(run.segments, start=1):
        if number > 1:
            yield Mark(segment.start, None, f"plan {number}", "next plan")
        if segment.given_up is not None:
            yield Mark(segment.given_up, None, str(segment.ending), "given up")
