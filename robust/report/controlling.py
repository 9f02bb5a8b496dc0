"""`--controllability`: whether a box is weakly, dynamically and strongly controllable, and the part of it that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from robust.errors import RobustError
from robust.execute.controllability.assess import Controllability, Finding, Kind, Verdict
from robust.execute.controllability.shrink import HORIZON, Loss, Shrunk, loss
from robust.irr.box import Box, Side
from robust.irr.widen import Face
from robust.report.numbers import end, exact_end, interval_text, readable
from robust.report.terminal import show_table, table_of
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.plan.model import ParametrizedPlan

_STYLES = {Verdict.CONTROLLABLE: "green", Verdict.NOT_CONTROLLABLE: "bold red", Verdict.UNKNOWN: "yellow"}


@dataclass(frozen=True)
class ControllabilityReport:
    """The verdicts about a box, and the part of it that has the wanted kind of controllability.

    `shrunk` and `lost` are None, with a `failure`, if there is no such part or time ran out. `waits` are who waits for
    which end, if the part is dynamically controllable and that was wanted.
    """

    wanted: Kind
    findings: tuple[Finding, ...]
    box: Box
    shrunk: Shrunk | None
    lost: Loss | None
    failure: str | None
    waits: tuple[str, ...]

    @property
    def was_controllable(self) -> bool:
        """Whether the box itself is as wanted."""
        return any(one.kind is self.wanted and one.verdict is Verdict.CONTROLLABLE for one in self.findings)


def assess(
    plan: ParametrizedPlan, box: Box, wanted: str, *, solver: str, timeout: float | None
) -> ControllabilityReport:
    """Decide all kinds for a box that is inside the envelope, and shrink it to the wanted kind."""
    kind = Kind(wanted)
    deadline = Deadline.after(timeout)
    asked = Controllability(plan, box, solver=solver, deadline=deadline)
    findings = asked.findings()
    try:
        shrunk = asked.shrunk(kind)
        inside = Controllability(plan, shrunk.box, solver=solver, deadline=deadline)
        strategy = inside.waits() if kind is Kind.DYNAMIC else ()
    except OutOfTimeError:
        return ControllabilityReport(kind, findings, box, None, None, "out of time", ())
    except RobustError as error:
        return ControllabilityReport(kind, findings, box, None, None, error.message, ())
    lost = loss(box, shrunk.box)
    return ControllabilityReport(kind, findings, box, shrunk, lost, None, tuple(map(str, strategy)))


# -- for programs ----------------------------------------------------------------------------------------------------


def controllability_answer(report: ControllabilityReport) -> dict[str, Any]:
    """The value of `controllability` in `robust/envelope/1`."""
    return {
        "wanted": report.wanted.value,
        "weak": _finding(report, Kind.WEAK),
        "dynamic": _finding(report, Kind.DYNAMIC),
        "strong": _finding(report, Kind.STRONG),
        "parameters": None if report.shrunk is None else _parameters(report.box, report.shrunk),
        "lost_share": None if report.lost is None or report.lost.share is None else str(report.lost.share),
        "failure": report.failure,
        "waits": list(report.waits),
    }


def _finding(report: ControllabilityReport, kind: Kind) -> dict[str, Any]:
    found = next(one for one in report.findings if one.kind is kind)
    return {"verdict": found.verdict.value, "reason": found.reason, "seconds": round(found.seconds, 6)}


def _parameters(box: Box, shrunk: Shrunk) -> dict[str, Any]:
    lost = loss(box, shrunk.box).faces
    return {
        name: {
            "lower": exact_end(interval.lower, upper=False),
            "upper": exact_end(interval.upper, upper=True),
            "lower_closed": interval.lower is not None and interval.lower_closed,
            "upper_closed": interval.upper is not None and interval.upper_closed,
            "lost_below": exact_end(lost[name, Side.LOWER], upper=True),
            "lost_above": exact_end(lost[name, Side.UPPER], upper=True),
        }
        for name, interval in shrunk.box.intervals.items()
    }


# -- for people ------------------------------------------------------------------------------------------------------


def print_controllability(out: Console, report: ControllabilityReport, *, quiet: bool) -> None:
    """The verdicts, and the part that is controllable where the box is not; unless `quiet` also reasons and waits."""
    out.print()
    for one in report.findings:
        text = Text.assemble((one.verdict.value, _STYLES[one.verdict]), f": {_ADVERB[one.kind]}")
        if one.reason is not None and not quiet:
            text.append(f"; {one.reason}")
        out.print(text, soft_wrap=True)
    if report.failure is not None:
        out.print(Text(f"no {_ADVERB[report.wanted]} controllable part: {report.failure}", "yellow"), soft_wrap=True)
    elif report.shrunk is not None and report.lost is not None and not report.was_controllable:
        _print_part(out, report, report.shrunk, report.lost, quiet)
    if not quiet:
        for line in report.waits:
            out.print(Text(line, style="dim"), soft_wrap=True)


_ADVERB = {Kind.WEAK: "weakly", Kind.DYNAMIC: "dynamically", Kind.STRONG: "strongly"}


def _print_part(out: Console, report: ControllabilityReport, shrunk: Shrunk, lost: Loss, quiet: bool) -> None:
    columns = ("parameter", "box", f"{_ADVERB[report.wanted]} controllable", "lost below", "lost above")
    rows = [
        (
            name,
            interval_text(report.box[name]),
            interval_text(interval),
            _lost(lost.faces, (name, Side.LOWER)),
            _lost(lost.faces, (name, Side.UPPER)),
        )
        for name, interval in shrunk.box.intervals.items()
    ]
    out.print()
    show_table(out, table_of(columns, rows, right=columns[1:]))
    if quiet:
        return
    out.print()
    share = "" if lost.share is None else f"; {float(lost.share):.1%} of the total width is lost"
    largest = f"no {_ADVERB[report.wanted]} controllable part of the box contains this one{share}."
    out.print(Text(largest), soft_wrap=True)
    if shrunk.cut:
        names = ", ".join(dict.fromkeys(name for name, _ in shrunk.cut))
        text = f"{names} may be any finite amount larger: ends were set {readable(HORIZON)} weights from the centre."
        out.print(Text(text), soft_wrap=True)


def _lost(faces: Mapping[Face, Fraction | None], face: Face) -> str:
    return end(faces[face], upper=True)
