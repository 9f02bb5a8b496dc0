"""Networks with uncertainty: verdicts, dispatchable networks, executions and repairs, for people and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar

from msgspec import field

from robust.errors import UNDECIDED, exit_code_of
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, one_of, wire
from robust.network.uncertain import Wait
from robust.numbers import exact_end, format_number, plural, readable
from robust.show.console import Console, Text, colour_of, printing
from robust.show.documents import CHANGE, Document, Ended, Noted, document, documenting, has_table
from robust.stnu.network import Edge, Link
from robust.stnu.verdicts import DispatchResult, LinkChange, NetworkCheck, NetworkRepair

if TYPE_CHECKING:
    from robust.errors import RobustError
    from robust.stnu.network import Network
    from robust.stnu.verdicts import NetworkExecution, Requirement

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class SimulatedDispatch:
    """A dispatchable network and simulated executions of it."""

    dispatch: DispatchResult
    executions: tuple[NetworkExecution, ...]


@dataclass(frozen=True, slots=True)
class JudgedNetwork(Generic[Result]):
    """One file, and what came of it, or why nothing did."""

    file: Path
    result: Result | None
    error: RobustError | None = None

    @property
    def word(self) -> str:
        """The verdict in one word."""
        result: Any = self.result.dispatch.checked if isinstance(self.result, SimulatedDispatch) else self.result
        if result is None:
            return "error"
        word: str = (result.verdict if hasattr(result, "verdict") else result.status).value
        return word

    @property
    def code(self) -> int:
        """The exit code of a verdict or an error."""
        return exit_code_of(self.word) if self.error is None else self.error.exit_code

    @property
    def named(self) -> dict[str, Any]:
        """The file and the error, as in JSON."""
        return {"file": str(self.file), "error": None if self.error is None else str(self.error)}


# -- for people --------------------------------------------------------------------------------------------------------


def _print_all(
    out: Console, judged: Sequence[JudgedNetwork[Result]], line: Callable[[Result], str], more: Callable[[Result], None]
) -> None:
    """A line for each file and more below it; several are counted."""
    for network in judged:
        text = Text("" if len(judged) == 1 or network.error is not None else f"{network.file}: ")
        text.append(network.word, style=colour_of(network.word))
        text.append(f": {network.error if network.result is None else line(network.result)}")
        out.line(text)
        if network.result is not None:
            more(network.result)
    if len(judged) > 1:
        counts = Counter(network.word for network in judged)
        out.print(Text(", ".join(f"{count} {word}" for word, count in counts.items()), style="dim"))


def print_checks(out: Console, judged: Sequence[JudgedNetwork[NetworkCheck]], *, quiet: bool) -> None:
    """The verdicts; unless `quiet` also the cycle that refutes control."""

    def more(result: NetworkCheck) -> None:
        if not quiet and result.cycle:
            for edge in result.cycle:
                out.line(f"  {edge}")
            finite = [edge.value for edge in result.cycle if edge.value is not None]
            total = "-inf" if len(finite) < len(result.cycle) else format_number(sum(finite, Fraction(0)))
            out.line(f"  a semi-reducible cycle of length {total}, checked", "dim")

    _print_all(out, judged, _verdict_line, more)


def _verdict_line(result: NetworkCheck) -> str:
    return result.network.size if result.reason is None else result.reason


def print_dispatches(out: Console, judged: Sequence[JudgedNetwork[SimulatedDispatch]], *, quiet: bool) -> None:
    """The dispatchable networks; unless `quiet` with all requirements, waits and executions."""

    def line(simulated: SimulatedDispatch) -> str:
        dispatch = simulated.dispatch
        if dispatch.tables is None:
            return _verdict_line(dispatch.checked)
        counted = f"{plural(len(dispatch.requirements), 'requirement')} and {plural(len(dispatch.waits), 'wait')}"
        return f"minimal dispatchable with {counted} from {plural(dispatch.derived, 'implied bound')}"

    def more(simulated: SimulatedDispatch) -> None:
        if quiet:
            return
        dispatch, executions = simulated.dispatch, simulated.executions
        for link in dispatch.network.contingents if dispatch.tables is not None else ():
            out.line(f"  {link}")
        for edge in dispatch.requirements:
            out.line(f"  {edge.target} - {edge.source} <= {format_number(edge.bound)}")
        for wait in dispatch.waits:
            out.line(f"  {wait}")
        for run in executions[:1]:
            out.line(f"execution with seed {run.seed}:")
            for event in run.events:
                text = f"  {readable(event.time):>10}  {event.point}{' (observed)' if event.observed else ''}"
                out.line(text)
        if executions:
            failed = sum(bool(run.violated) for run in executions)
            counted = f"{plural(len(executions), 'execution')}, {failed} with a violated requirement"
            out.print(Text(counted, style="dim"))

    _print_all(out, judged, line, more)


def print_repairs(
    out: Console, judged: Sequence[JudgedNetwork[NetworkRepair]], written: str | None, *, quiet: bool
) -> None:
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
            out.line(f"  {change}")
            for reason in () if quiet else change.serves:
                out.line(f"    for: {reason}", "dim")

    _print_all(out, judged, line, more)
    if written is not None:
        out.line(f"network: {written}")


def _alone(result: Result) -> list[JudgedNetwork[Result]]:
    """A result by itself, with the name of its network."""
    named: Any = result.dispatch if isinstance(result, SimulatedDispatch) else result
    return [JudgedNetwork(Path(named.name), result)]


@printing.register(NetworkCheck)
def _(out: Console, result: NetworkCheck, *, quiet: bool) -> None:
    print_checks(out, _alone(result), quiet=quiet)


@printing.register(DispatchResult)
def _(out: Console, result: DispatchResult, *, quiet: bool) -> None:
    print_dispatches(out, _alone(SimulatedDispatch(result, ())), quiet=quiet)


@printing.register(NetworkRepair)
def _(out: Console, result: NetworkRepair, *, quiet: bool) -> None:
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


class CheckedNetwork(JsonObject, kw_only=True):
    """
    Attributes:
        cycle: of an uncontrollable network: a semi-reducible negative cycle, which an independent function has checked
        reason: the cycle in words, or why there is no verdict
        error: why the file cannot be read, else null; the verdict is unknown then
    """

    file: str
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")] = "unknown"
    cycle: list[Edge] = field(default_factory=list)
    reason: str | None = None
    seconds: Seconds | None = None
    error: str | None


class StnuCheck(Noted, tag_field="schema", tag="robust/stnu-check/1"):
    """robust stnu check --json: are networks with uncertainty dynamically controllable

    Attributes:
        status: interrupted, timeout: the networks that were judged by then
    """

    status: Ended
    results: list[CheckedNetwork]


@wire.register(Edge)
def _(edge: Edge) -> CycleEdge:
    return like(CycleEdge, edge, value=exact_end(edge.value, upper=False))


def check_document(judged: Sequence[JudgedNetwork[NetworkCheck]], status: str) -> Document:
    """The document that `robust stnu check --json` prints."""
    return document(
        StnuCheck(status=status, results=[like(CheckedNetwork, each.result, **each.named) for each in judged])
    )


class LinkRecord(JsonObject):
    source: str
    target: str
    lower: End
    upper: End


@wire.register(Link)
def _(link: Link) -> LinkRecord:
    return like(LinkRecord, link, lower=exact_end(link.lower, upper=False), upper=exact_end(link.upper, upper=True))


class WaitRecord(JsonObject):
    """point waits until delay after activation, or until end has happened

    Attributes:
        delay: null: until the end however long it takes
    """

    point: str
    activation: str
    delay: Rational | None
    end: str


@wire.register(Wait)
def _(wait: Wait) -> WaitRecord:
    return like(WaitRecord, wait, point=str(wait.point), activation=str(wait.activation), end=str(wait.end))


class DispatchedNetwork(JsonObject, kw_only=True):
    """
    Attributes:
        contingent: the contingent links, as they were
        requirements: the ordinary edges of the minimal dispatchable network, beside the bounds of contingent links
        derived: how many ordinary edges follow from the network
    """

    file: str
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")] = "unknown"
    reason: str | None = None
    contingent: list[Link] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    waits: list[Wait] = field(default_factory=list)
    derived: Count = 0
    executions: list[NetworkExecution] = field(default_factory=list)
    seconds: Seconds | None = None
    error: str | None


class StnuDispatch(Noted, tag_field="schema", tag="robust/stnu-dispatch/1"):
    """robust stnu dispatch --json: how controllable networks are executed

    Attributes:
        status: interrupted, timeout: the networks that were judged by then
    """

    status: Ended
    results: list[DispatchedNetwork]


def dispatch_document(judged: Sequence[JudgedNetwork[SimulatedDispatch]], status: str) -> Document:
    """The document that `robust stnu dispatch --json` prints."""
    return document(StnuDispatch(status=status, results=[_dispatched(network) for network in judged]))


def _dispatched(judged: JudgedNetwork[SimulatedDispatch]) -> DispatchedNetwork:
    if judged.result is None:
        return DispatchedNetwork(**judged.named)
    dispatch = judged.result.dispatch
    return like(
        DispatchedNetwork,
        dispatch,
        **judged.named,
        verdict=dispatch.checked.verdict,
        reason=dispatch.checked.reason,
        contingent=() if dispatch.tables is None else dispatch.network.contingents,
        executions=judged.result.executions,
    )


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


class RepairedNetwork(JsonObject, kw_only=True):
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
    repair: Annotated[str, one_of("unneeded", "optimal", "feasible", "impossible", "unknown")] = "unknown"
    cost: Rational | None = None
    bound: Rational = Fraction(0)
    gap: Rational | None = None
    changes: list[LinkChange] = field(default_factory=list)
    conflicts: Count = 0
    candidates: Count = 0
    seconds: Seconds | None = None
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


@wire.register(LinkChange)
def _(change: LinkChange) -> BoundChange:
    link = change.link
    ends = {"source": link.source, "target": link.target, "contingent": link.is_contingent}
    return like(BoundChange, change, **ends)


def repair_document(
    judged: Sequence[JudgedNetwork[NetworkRepair]], status: str, written: str | None = None
) -> Document:
    """The document that `robust stnu repair --json` prints."""
    return document(StnuRepair(status=status, results=[_repaired(network) for network in judged], written=written))


def _repaired(judged: JudgedNetwork[NetworkRepair]) -> RepairedNetwork:
    if judged.result is None:
        return RepairedNetwork(**judged.named)
    return like(RepairedNetwork, judged.result, **judged.named, repair=judged.result.status)


@documenting.register(NetworkCheck)
def _(result: NetworkCheck) -> Document:
    return check_document(judged := _alone(result), ended(judged))


@documenting.register(DispatchResult)
def _(result: DispatchResult) -> Document:
    return dispatch_document(judged := _alone(SimulatedDispatch(result, ())), ended(judged))


@documenting.register(NetworkRepair)
def _(result: NetworkRepair) -> Document:
    return repair_document(judged := _alone(result), ended(judged))


has_table(NetworkCheck, "results", 0, "cycle", numbers=("value",))
has_table(DispatchResult, "results", 0, "requirements", numbers=("bound",))
has_table(NetworkRepair, "results", 0, "changes", numbers=CHANGE)


def ended(judged: Sequence[JudgedNetwork[Any]]) -> str:
    """The status of a command: a result that is not final was interrupted, or is out of time."""
    short = [network.result for network in judged if network.error is None and network.code == UNDECIDED]
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
