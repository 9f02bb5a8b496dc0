"""Networks with uncertainty: verdicts, dispatchable networks, executions and repairs, for people and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar

from rich.text import Text

from robust.errors import UNDECIDED, exit_code_of
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import exact_end, format_number, plural, readable
from robust.show.console import colour_of
from robust.show.documents import Document, Ended, Noted, document

if TYPE_CHECKING:
    from rich.console import Console

    from robust.errors import RobustError
    from robust.network.uncertain import Wait
    from robust.stnu.network import Network
    from robust.stnu.repairs import LinkChange, NetworkRepair
    from robust.stnu.verdicts import DispatchResult, NetworkCheck, NetworkExecution

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Dispatched:
    """A dispatchable network and simulated executions of it."""

    found: DispatchResult
    executions: tuple[NetworkExecution, ...]


@dataclass(frozen=True, slots=True)
class Judged(Generic[Result]):
    """One file, and what was found of it, or why nothing was."""

    file: Path
    result: Result | None
    error: RobustError | None = None

    @property
    def word(self) -> str:
        """The verdict in one word."""
        result: Any = self.result.found.checked if isinstance(self.result, Dispatched) else self.result
        if result is None:
            return "error"
        word: str = (result.verdict if hasattr(result, "verdict") else result.status).value
        return word

    @property
    def code(self) -> int:
        """The exit code of a verdict or an error."""
        return exit_code_of(self.word) if self.error is None else self.error.exit_code


# -- for people --------------------------------------------------------------------------------------------------------


def _print_all(
    out: Console, judged: Sequence[Judged[Result]], line: Callable[[Result], str], more: Callable[[Result], None]
) -> None:
    """A line for each file and more below it; several are counted."""
    for row in judged:
        text = Text("" if len(judged) == 1 or row.error is not None else f"{row.file}: ")
        text.append(row.word, style=colour_of(row.word))
        text.append(f": {row.error if row.result is None else line(row.result)}")
        out.print(text, soft_wrap=True)
        if row.result is not None:
            more(row.result)
    if len(judged) > 1:
        counts = Counter(row.word for row in judged)
        out.print(Text(", ".join(f"{count} {word}" for word, count in counts.items()), style="dim"))


def print_checks(out: Console, judged: Sequence[Judged[NetworkCheck]], *, quiet: bool) -> None:
    """The verdicts; unless `quiet` also the cycle that refutes control."""

    def more(result: NetworkCheck) -> None:
        if not quiet and result.cycle:
            for edge in result.cycle:
                out.print(Text(f"  {edge}"), soft_wrap=True)
            finite = [edge.value for edge in result.cycle if edge.value is not None]
            total = "-inf" if len(finite) < len(result.cycle) else format_number(sum(finite, Fraction(0)))
            out.print(Text(f"  a semi-reducible cycle of length {total}, checked", style="dim"), soft_wrap=True)

    _print_all(out, judged, _verdict_line, more)


def _verdict_line(result: NetworkCheck) -> str:
    return result.network.size if result.reason is None else result.reason


def print_dispatches(out: Console, judged: Sequence[Judged[Dispatched]], *, quiet: bool) -> None:
    """The dispatchable networks; unless `quiet` with all requirements, waits and executions."""

    def line(result: Dispatched) -> str:
        dispatched = result.found
        if dispatched.tables is None:
            return _verdict_line(dispatched.checked)
        counted = f"{plural(len(dispatched.requirements), 'requirement')} and {plural(len(dispatched.waits), 'wait')}"
        return f"minimal dispatchable with {counted}, of {dispatched.derived} bounds that follow"

    def more(result: Dispatched) -> None:
        if quiet:
            return
        for link in result.found.network.contingents if result.found.tables is not None else ():
            out.print(Text(f"  {link}"), soft_wrap=True)
        for edge in result.found.requirements:
            out.print(Text(f"  {edge.target} - {edge.source} <= {format_number(edge.bound)}"), soft_wrap=True)
        for wait in result.found.waits:
            out.print(Text(f"  {wait}"), soft_wrap=True)
        for run in result.executions[:1]:
            out.print(Text(f"execution with seed {run.seed}:"), soft_wrap=True)
            for event in run.events:
                text = f"  {readable(event.time):>10}  {event.point}{' (observed)' if event.observed else ''}"
                out.print(Text(text), soft_wrap=True)
        if result.executions:
            failed = sum(bool(run.violated) for run in result.executions)
            counted = f"{plural(len(result.executions), 'execution')}, {failed} with a violated requirement"
            out.print(Text(counted, style="dim"))

    _print_all(out, judged, line, more)


def print_repairs(out: Console, judged: Sequence[Judged[NetworkRepair]], written: str | None, *, quiet: bool) -> None:
    """The changes and what they cost; unless `quiet` with the conflicts that they serve."""

    def line(repair: NetworkRepair) -> str:
        match repair.status.value:
            case "unneeded":
                return "the network is controllable as it is"
            case "impossible":
                return "no change of what may be changed makes the network controllable"
            case "unknown":
                return f"no repair found; none costs less than {readable(repair.bound)}"
        cost = f"{plural(len(repair.changes), 'change')} at cost {readable(repair.cost or Fraction(0))}"
        return cost if not repair.gap else f"{cost}, at most {readable(repair.gap)} above the least"

    def more(repair: NetworkRepair) -> None:
        for change in repair.changes:
            out.print(Text(f"  {change}"), soft_wrap=True)
            for reason in () if quiet else change.serves:
                out.print(Text(f"    for: {reason}", style="dim"), soft_wrap=True)

    _print_all(out, judged, line, more)
    if written is not None:
        out.print(Text(f"network: {written}"), soft_wrap=True)


def _alone(result: Result) -> list[Judged[Result]]:
    """A result by itself, with the name of its network."""
    whole: Any = result.found if isinstance(result, Dispatched) else result
    return [Judged(Path(whole.name), result)]


def print_one_check(out: Console, result: NetworkCheck, *, quiet: bool) -> None:
    """One verdict."""
    print_checks(out, _alone(result), quiet=quiet)


def print_one_dispatch(out: Console, result: DispatchResult, *, quiet: bool) -> None:
    """One dispatchable network, without executions."""
    print_dispatches(out, _alone(Dispatched(result, ())), quiet=quiet)


def print_one_repair(out: Console, result: NetworkRepair, *, quiet: bool) -> None:
    """One repair."""
    print_repairs(out, _alone(result), None, quiet=quiet)


# -- JSON --------------------------------------------------------------------------------------------------------------


class CycleEdge(JsonObject):
    """target - source <= value, an edge of the distance graph

    Attributes:
        value: -inf for the upper-case edge of a contingent link without an upper bound
        case: lower, upper: of a contingent link
        link: what it stands for; a commit(A,C) is the time at which A is settled, before a link to C that may end
            before it starts
    """

    source: str
    target: str
    value: End
    case: Annotated[str, one_of("ordinary", "lower", "upper")]
    link: str


class CheckedNetwork(JsonObject):
    """
    Attributes:
        cycle: of an uncontrollable network: a semi-reducible negative cycle, which an independent function has checked
        reason: the cycle in words, or why there is no verdict
        error: why the file cannot be read, else null; the verdict is unknown then
    """

    file: str
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")]
    cycle: list[CycleEdge]
    reason: str | None
    seconds: Seconds | None
    error: str | None


class StnuCheck(Noted, tag_field="schema", tag="robust/stnu-check/1"):
    """robust stnu check --json: are networks with uncertainty dynamically controllable

    Attributes:
        status: interrupted, timeout: the networks that were judged by then
    """

    status: Ended
    results: list[CheckedNetwork]


def check_document(judged: Sequence[Judged[NetworkCheck]], status: str) -> Document:
    return document(StnuCheck(status=status, results=[_checked(row.file, row.result, row.error) for row in judged]))


def _checked(file: Path, result: NetworkCheck | None, error: RobustError | None) -> CheckedNetwork:
    if result is None:
        return CheckedNetwork(file=str(file), verdict="unknown", cycle=[], reason=None, seconds=None, error=str(error))
    cycle = [like(CycleEdge, edge, value=exact_end(edge.value, upper=False)) for edge in result.cycle]
    verdict = result.verdict.value
    return like(CheckedNetwork, result, file=str(file), verdict=verdict, cycle=cycle, error=None)


class NaturalDuration(JsonObject):
    source: str
    target: str
    lower: End
    upper: End


class OrdinaryEdge(JsonObject):
    """target - source <= bound"""

    source: str
    target: str
    bound: Rational


class ConditionalWait(JsonObject):
    """point waits until delay after activation, or until end has happened

    Attributes:
        delay: null: until the end however long it takes
    """

    point: str
    activation: str
    delay: Rational | None
    end: str


class Happening(JsonObject):
    time: Rational
    point: str
    observed: bool


class SimulatedExecution(JsonObject):
    """
    Attributes:
        lengths: drawn, by the ends of contingent links; where a link may end before it starts, since it was settled
        violated: requirements that do not hold in the end
    """

    seed: int
    lengths: dict[str, Rational]
    events: list[Happening]
    violated: list[str]


class DispatchedNetwork(JsonObject):
    """
    Attributes:
        contingent: the contingent links, as they were
        requirements: the ordinary edges of the minimal dispatchable network, beside the bounds of contingent links
        derived: how many ordinary edges follow from the network
    """

    file: str
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")]
    reason: str | None
    contingent: list[NaturalDuration]
    requirements: list[OrdinaryEdge]
    waits: list[ConditionalWait]
    derived: Count
    executions: list[SimulatedExecution]
    seconds: Seconds | None
    error: str | None


class StnuDispatch(Noted, tag_field="schema", tag="robust/stnu-dispatch/1"):
    """robust stnu dispatch --json: how controllable networks are executed

    Attributes:
        status: interrupted, timeout: the networks that were judged by then
    """

    status: Ended
    results: list[DispatchedNetwork]


def dispatch_document(judged: Sequence[Judged[Dispatched]], status: str) -> Document:
    return document(StnuDispatch(status=status, results=[_dispatched(row) for row in judged]))


def _dispatched(row: Judged[Dispatched]) -> DispatchedNetwork:
    result = None if row.result is None else row.result.found
    links = () if result is None or result.tables is None else result.network.contingents
    contingent = [
        like(NaturalDuration, link, lower=exact_end(link.lower, upper=False), upper=exact_end(link.upper, upper=True))
        for link in links
    ]
    return DispatchedNetwork(
        file=str(row.file),
        verdict="unknown" if result is None else result.checked.verdict.value,
        reason=None if result is None else result.checked.reason,
        contingent=contingent,
        requirements=[] if result is None else [like(OrdinaryEdge, edge) for edge in result.requirements],
        waits=[] if result is None else [_wait(wait) for wait in result.waits],
        derived=0 if result is None else result.derived,
        executions=[] if row.result is None else [_execution(run) for run in row.result.executions],
        seconds=None if result is None else round(result.seconds, 6),
        error=None if row.error is None else str(row.error),
    )


def _wait(wait: Wait) -> ConditionalWait:
    return like(ConditionalWait, wait, point=str(wait.point), activation=str(wait.activation), end=str(wait.end))


def _execution(run: NetworkExecution) -> SimulatedExecution:
    events = [like(Happening, event) for event in run.events]
    return like(SimulatedExecution, run, lengths=dict(run.lengths), events=events, violated=list(run.violated))


class BoundChange(JsonObject):
    """
    Attributes:
        serves: the conflicts that make it necessary
    """

    source: str
    target: str
    contingent: bool
    side: Annotated[str, one_of("lower", "upper")]
    old: Rational
    new: Rational
    cost: Rational
    serves: list[str]


class RepairedNetwork(JsonObject):
    """
    Attributes:
        repair: unneeded: controllable as it is; feasible: perhaps not the cheapest; impossible: of what may be changed,
            nothing helps
        cost: null without a repair
        bound: no repair costs less
        gap: the difference of the two
        conflicts: how many were met; candidates: how many networks were examined
        error: why the file cannot be read, else null
    """

    file: str
    repair: Annotated[str, one_of("unneeded", "optimal", "feasible", "impossible", "unknown")]
    cost: Rational | None
    bound: Rational
    gap: Rational | None
    changes: list[BoundChange]
    conflicts: Count
    candidates: Count
    seconds: Seconds | None
    error: str | None


class StnuRepair(Noted, tag_field="schema", tag="robust/stnu-repair/1"):
    """robust stnu repair --json: the least changes after which networks are controllable

    Attributes:
        status: interrupted, timeout: the networks that were repaired by then
        written: the file with the repaired network; null if none was asked for, or there is none
    """

    status: Ended
    results: list[RepairedNetwork]
    written: str | None


def repair_document(judged: Sequence[Judged[NetworkRepair]], status: str, written: str | None) -> Document:
    results = [_repaired(row) for row in judged]
    return document(StnuRepair(status=status, results=results, written=written))


def _change(change: LinkChange) -> BoundChange:
    link, side, serves = change.link, change.side.value, list(change.serves)
    kind, ends = link.is_contingent, (link.source, link.target)
    return like(BoundChange, change, source=ends[0], target=ends[1], contingent=kind, side=side, serves=serves)


def _repaired(row: Judged[NetworkRepair]) -> RepairedNetwork:
    repair = row.result
    if repair is None:
        return RepairedNetwork(
            file=str(row.file),
            repair="unknown",
            cost=None,
            bound=Fraction(0),
            gap=None,
            changes=[],
            conflicts=0,
            candidates=0,
            seconds=None,
            error=str(row.error),
        )
    changes = [_change(change) for change in repair.changes]
    return like(RepairedNetwork, repair, file=str(row.file), repair=repair.status.value, changes=changes, error=None)


def one_check(result: NetworkCheck) -> Document:
    """The document of one verdict."""
    return check_document(rows := _alone(result), ended(rows))


def one_dispatch(result: DispatchResult) -> Document:
    """The document of one dispatchable network, without executions."""
    return dispatch_document(rows := _alone(Dispatched(result, ())), ended(rows))


def one_repair(result: NetworkRepair) -> Document:
    """The document of one repair."""
    return repair_document(rows := _alone(result), ended(rows), None)


def ended(judged: Sequence[Judged[Any]]) -> str:
    """The status: a result that is not final was interrupted, or ran out of time."""
    short = [row.result for row in judged if row.error is None and row.code == UNDECIDED]
    if not short:
        return "complete"
    return "interrupted" if any(getattr(result, "interrupted", False) for result in short) else "timeout"


class StnuExport(Noted, tag_field="schema", tag="robust/stnu-export/1"):
    """robust convert --stnu FILE --json, of a plan that is a network already

    Attributes:
        written: the file
    """

    written: str
    time_points: Count
    links: Count
    contingent: Count


def export_document(network: Network) -> Document:
    points, links, contingent = map(len, (network.nodes, network.links, network.contingents))
    return document(StnuExport(written=network.name, time_points=points, links=links, contingent=contingent))


DOCUMENTS: tuple[type[JsonObject], ...] = (StnuCheck, StnuDispatch, StnuRepair, StnuExport)
"""As in :mod:`robust.show.documents`."""
