"""Answers for people: verdicts, boxes and counterexamples as text and tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from enum import Enum
from fractions import Fraction
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from robust.irr.check import Answer, CheckResult, Counterexample
from robust.irr.stops import Advice
from robust.numbers import approximate, duration, end, plural, readable, readable_values
from robust.plan.model import Fluent, Parameter
from robust.plan.simulate import TraceStep, Violation
from robust.qe.box import Interval
from robust.show.console import colour_of, show_table, table

if TYPE_CHECKING:
    from robust.irr.quantities import Change


# -- check -----------------------------------------------------------------------------------------------------------


def print_check(out: Console, result: CheckResult, *, quiet: bool) -> None:
    """The verdict; unless `quiet` also what breaks and how, and the verdict of each obligation if all were examined.

    A refutation ends with its repair, if there is one.
    """
    out.print(_verdict(result), soft_wrap=True)
    if quiet:
        return
    out.print(_summary(result), soft_wrap=True)
    if result.every:
        _print_broken(out, result)
    for found in list(result.counterexamples.values())[:1]:
        out.print()
        print_counterexample(out, found)
    if result.repair is not None:
        out.print()
        out.print(Text.assemble(("repair: ", "bold"), "; ".join(map(told, result.repair))), soft_wrap=True)


def told(change: Change) -> str:
    """A change of a plan in words, and where."""
    line = change.location.line if change.location is not None else None
    return change.words if line is None else f"{change.words} (line {line})"


def _verdict(result: CheckResult) -> Text:
    text = Text(result.answer.value, style=colour_of(result.answer.value))
    broken = [name for name, answer in result.obligations.items() if answer is Answer.REFUTED]
    match result.answer:
        case Answer.PROVED:
            text.append(": the plan is valid for every schedule that its network allows", style="default")
        case Answer.UNKNOWN:
            stopped = "out of time" if result.timed_out else "interrupted" if result.interrupted else result.reason
            text.append(f": {stopped}" if stopped else "", style="default")
        case Answer.REFUTED if result.reason is not None:
            text.append(f": {result.reason}", style="default")
        case Answer.REFUTED:
            text.append(f": an allowed schedule breaks {'; '.join(broken)}", style="default")
    return text


def _summary(result: CheckResult) -> Text:
    answers = list(result.obligations.values())
    proved = answers.count(Answer.PROVED)
    parts = [f"{proved} of {plural(len(answers), 'obligation')} proved", duration(result.seconds)]
    if proved:
        asked = f"{proved - result.settled} by the solver"
        parts[0] += f" ({result.settled} by shortest paths, {asked})" if result.settled else f" ({asked})"
    if result.counterexamples and Answer.UNKNOWN in answers:
        parts[0] += ", the others not examined"
    values = [f"{name} {_values(interval)}" for name, interval in result.box.intervals.items()]
    if values:
        parts.append(f"with {', '.join(values)}")
    return Text(f"{'; '.join(parts)}.", style="dim")


def _values(interval: Interval) -> str:
    if interval.lower is not None and interval.lower == interval.upper:
        return f"= {readable(interval.lower)}"
    return f"in [{end(interval.lower, upper=False)}, {end(interval.upper, upper=True)}]"


def _print_broken(out: Console, result: CheckResult) -> None:
    """Every obligation that is not proved, with a time and a reason where it breaks."""
    rows = []
    for name, answer in result.obligations.items():
        if answer is not Answer.PROVED:
            found = result.counterexamples.get(name)
            when, why = ("", "") if found is None else _when_and_why(found)
            rows.append((Text(answer.value, style=colour_of(answer.value)), name, when, why))
    if rows:
        out.print()
        show_table(out, table(("verdict", "obligation", "time", "why"), rows, right=("time",)))


def _when_and_why(found: Counterexample) -> tuple[str, str]:
    one = next(one for one in found.simulation.violations if one.obligation == found.obligation)
    return readable(one.time), readable_values(one.detail)


# -- counterexamples -------------------------------------------------------------------------------------------------


def print_counterexample(out: Console, found: Counterexample) -> None:
    """What breaks, when and why, and the schedule in which it does, state by state."""
    when, why = _when_and_why(found)
    out.print(Text.assemble(("broken: ", "bold red"), found.obligation), soft_wrap=True)
    out.print(Text(f"  at time {when}: {why}"), soft_wrap=True)
    if found.parameters:
        values = ", ".join(f"{name} = {readable(value)}" for name, value in found.parameters.items())
        out.print(Text(f"  parameters: {values}"), soft_wrap=True)
    constant = found.simulation.constants
    rows = (
        _violation_cells(step) if isinstance(step, Violation) else _step_cells(step, constant)
        for step in _told(found, constant)
    )
    show_table(out, table(("time", "happens", "changes", "fluents"), rows, right=("time",)))


def _with_violations(found: Counterexample) -> Iterator[TraceStep | Violation]:
    """Steps in order of time, each violation before what happens later."""
    pending = sorted(found.simulation.violations, key=lambda one: one.time)
    for step in found.simulation.trace:
        while pending and pending[0].time < step.time:
            yield pending.pop(0)
        yield step
    yield from pending


def _told(found: Counterexample, left_out: Set[Fluent]) -> Iterator[TraceStep | Violation]:
    """What there is to tell: without steps that change nothing, and timed literals after all else."""
    steps = list(_with_violations(found))
    while isinstance(last := steps[-1], TraceStep) and not any(point.instance for point in last.points):
        steps.pop()
    for step in steps:
        if (
            isinstance(step, Violation)
            or any(point.instance for point in step.points)
            or step.atoms_changed
            or step.fluents.keys() - left_out
        ):
            yield step


def _step_cells(step: TraceStep, left_out: Set[Fluent]) -> tuple[str, ...]:
    changes = [f"{'+' if value else '−'} {atom}" for atom, value in step.atoms_changed]
    fluents = [f"{fluent} = {readable(value)}" for fluent, value in step.fluents.items() if fluent not in left_out]
    points = (str(point) if point.time is None else f"@{readable(point.time)}" for point in step.points)
    return readable(step.time), "\n".join(points), "\n".join(changes), "\n".join(fluents)


def _violation_cells(violation: Violation) -> tuple[Text, ...]:
    texts = (readable(violation.time), violation.obligation, readable_values(violation.detail))
    time, obligation, detail = (Text(text, style="red") for text in texts)
    return time, Text("✗ violated", style="bold red"), obligation, detail


# -- parameters ------------------------------------------------------------------------------------------------------


def percentages(parameter: Parameter, interval: Interval) -> str:
    """How far the ends are from the nominal value in per cent of it, `−12.5 %, +40 %`; nothing if that is 0."""
    sides = [parameter.percent(interval.lower), parameter.percent(interval.upper)]
    shown = (f"{sign}∞" if side is None else percentage(side) for side, sign in zip(sides, "−+", strict=True))
    return ", ".join(shown) if any(side is not None for side in sides) else ""


def percentage(value: Fraction) -> str:
    """`−12.5 %`, `+40 %`, to three digits."""
    rounded = f"{approximate(abs(value)):.3g}" if abs(value) < 1000 else f"{approximate(abs(value)):.0f}"
    return f"{'−' if value < 0 else '+' if value > 0 else ''}{rounded} %"


def stopped(status: Enum, reason: str | None) -> str:
    """Why a search did not come to its end."""
    return {"timeout": "out of time", "interrupted": "interrupted"}.get(status.value) or f"{reason}"


def print_advice(out: Console, advice: Iterable[Advice]) -> None:
    """What to type for parameters without room."""
    for one in advice:
        out.print(Text(str(one), style="yellow"), soft_wrap=True)
