"""Repairs of plans: what changes, what for and at what cost, for people and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.text import Text

from robust.irr.conflicts import RepairStatus
from robust.irr.quantities import Cost
from robust.irr.repair import Repair
from robust.json_text import Count, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import duration, plural, readable
from robust.qe.box import Box
from robust.show.console import colour_of
from robust.show.documents import (
    Document,
    Ended,
    Ends,
    Noted,
    PlanChange,
    Solver,
    box_of,
    changes_of,
    document,
)
from robust.show.text import told

if TYPE_CHECKING:
    from rich.console import Console


# -- for people --------------------------------------------------------------------------------------------------------


def print_repair(out: Console, found: Repair, written: Path | None = None, *, quiet: bool) -> None:
    """The changes and what they cost; unless `quiet` with the statements that change and what for."""
    out.print(
        Text.assemble((found.status.value, colour_of(found.status.value)), f": {_verdict(found)}"), soft_wrap=True
    )
    for change in found.changes:
        out.print(Text(f"  {told(change) if quiet else change.words}"), soft_wrap=True)
        if not quiet:
            out.print(Text(f"    in {change}", style="dim"), soft_wrap=True)
            for reason in change.serves:
                out.print(Text(f"    for {reason}", style="dim"), soft_wrap=True)
    for reason in found.contradiction:
        out.print(Text(f"  {reason}"), soft_wrap=True)
    if not quiet:
        checked = "checked again: the repaired plan is proved; " if found.changes else ""
        examined = plural(found.candidates, "plan")
        out.print(Text(f"{checked}{examined} examined; {duration(found.seconds)}.", style="dim"), soft_wrap=True)
    if written is not None:
        out.print(Text(f"plan: {written}"), soft_wrap=True)


def _verdict(found: Repair) -> str:
    match found.status:
        case RepairStatus.UNNEEDED:
            return "the plan is proved as it is"
        case RepairStatus.IMPOSSIBLE:
            return "whatever is changed of what may change, one of these breaks"
        case RepairStatus.UNKNOWN:
            why = "interrupted" if found.interrupted else found.reason or "out of time"
            return f"{why}, no repair found; none costs less than {price(found.bound, found.count)}"
    cost = found.cost or Cost()
    paid = f"{plural(len(found.changes), 'change')} at cost {readable(cost.total)}"
    if found.status is RepairStatus.FEASIBLE:
        return f"{paid}; perhaps not the least, which is not below {price(found.bound, found.count)}"
    if not found.attained:
        return f"{paid}; the least cost {readable(found.bound.total)} is only approached"
    return f"{paid}, the least"


def price(cost: Cost, count: bool) -> str:
    """A cost in words."""
    counted = plural(cost.count, "change" if count else "new bound")
    return f"{counted} and cost {readable(cost.total)}" if count or cost.count else f"cost {readable(cost.total)}"


# -- JSON --------------------------------------------------------------------------------------------------------------


class RepairCost(JsonObject):
    """
    Attributes:
        counted: the changes that count: all of them, or without --count those of bounds that were infinite
        total: the sum of amounts times weights
    """

    counted: Count
    total: Rational


class PlanRepair(Noted, tag_field="schema", tag="robust/repair/1"):
    """robust repair --json: the least change after which a plan is proved, checked again

    Attributes:
        status: how the search ended
        repair: unneeded: proved as it is; feasible: perhaps not the least; impossible: of what may change, nothing
            helps
        required: the values that parameters must be able to have
        cost: null without a repair
        bound: no repair costs less
        gap: the difference of the totals where the counts are equal, else null
        attained: false where the least cost is only approached: then the repair costs a millionth more
        contradiction: if impossible, what no allowed change reconciles
        reason: how a solver failed, else null
        conflicts: polyhedra of bad changes that were met
        candidates: changes that were examined
        written: the file with the repaired plan; null if none was asked for, or there is none
    """

    status: Ended
    repair: Annotated[str, one_of("unneeded", "optimal", "feasible", "impossible", "unknown")]
    change: Annotated[str, one_of("bounds", "nominal", "both")]
    count: bool
    solver: Solver
    epsilon: Rational
    required: dict[str, Ends]
    cost: RepairCost | None
    bound: RepairCost
    gap: Rational | None
    attained: bool
    changes: list[PlanChange]
    contradiction: list[str]
    reason: str | None
    conflicts: Count
    candidates: Count
    seconds: Seconds
    written: str | None


def repair_document(found: Repair, written: Path | None = None) -> Document:
    comparable = found.cost is not None and found.cost.count == found.bound.count
    return document(
        like(
            PlanRepair,
            found,
            status=_ended(found),
            repair=found.status.value,
            required=box_of(Box(found.required)),
            cost=None if found.cost is None else _cost(found.cost),
            bound=_cost(found.bound),
            gap=found.cost.total - found.bound.total if found.cost is not None and comparable else None,
            changes=changes_of(found.changes),
            contradiction=list(found.contradiction),
            written=None if written is None else str(written),
        )
    )


def _ended(found: Repair) -> str:
    if not found.cut_short:
        return "complete"
    if found.reason is not None:
        return "unknown"
    return "interrupted" if found.interrupted else "timeout"


def _cost(cost: Cost) -> RepairCost:
    return RepairCost(counted=cost.count, total=cost.total)


DOCUMENTS: tuple[type[JsonObject], ...] = (PlanRepair,)
