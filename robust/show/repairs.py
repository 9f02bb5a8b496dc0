"""Repairs of plans: what changes, what for and at what cost, for people and as JSON."""

from pathlib import Path
from typing import Annotated

from robust.irr.conflicts import RepairStatus
from robust.irr.quantities import Cost
from robust.irr.repair import Repair
from robust.json_text import Count, JsonObject, Rational, Seconds, one_of, wire
from robust.numbers import duration, plural, readable
from robust.qe.box import Interval
from robust.show import documents
from robust.show.console import Console, Text, colour_of, printing
from robust.show.text import change_text, words_of

# -- for people --------------------------------------------------------------------------------------------------------


@printing.register(Repair)
def print_repair(out: Console, repair: Repair, written: Path | None = None, *, quiet: bool) -> None:
    """The changes and what they cost; unless `quiet` with the statements that change and what for."""
    out.line(Text.assemble((repair.status.value, colour_of(repair.status.value)), f": {_verdict(repair)}"))
    words = words_of(repair.plan)
    for change in repair.changes:
        out.line(f"  {change_text(change) if quiet else change.words}")
        if not quiet:
            out.line(f"    in {change}", "dim")
            for reason in change.serves:
                out.line(f"    for {words.told(reason)}", "dim")
    for reason in repair.contradiction:
        out.line(f"  {words.told(reason)}")
    if not quiet:
        checked = "checked again: the repaired plan is proved; " if repair.changes else ""
        examined = plural(repair.candidates, "plan")
        out.line(f"{checked}{examined} examined; {duration(repair.seconds)}.", "dim")
    if written is not None:
        out.line(f"plan: {written}")


def _verdict(repair: Repair) -> str:
    match repair.status:
        case RepairStatus.UNNEEDED:
            return "the plan is proved as it is"
        case RepairStatus.IMPOSSIBLE:
            return "whatever is changed of what may change, one of these breaks"
        case RepairStatus.UNKNOWN:
            why = "interrupted" if repair.interrupted else repair.reason or "out of time"
            return f"{why}, no repair found; none costs less than {price(repair.bound, repair.count)}"
    cost = repair.cost or Cost()
    paid = f"{plural(len(repair.changes), 'change')} at cost {readable(cost.total)}"
    if repair.status is RepairStatus.FEASIBLE:
        return f"{paid}; perhaps not the least, which is not below {price(repair.bound, repair.count)}"
    if not repair.attained:
        return f"{paid}; the least cost {readable(repair.bound.total)} is only approached"
    return f"{paid}, the least"


def price(cost: Cost, count: bool) -> str:
    """A cost in words."""
    counted = plural(cost.count, "change" if count else "new bound")
    return f"{counted} and cost {readable(cost.total)}" if count or cost.count else f"cost {readable(cost.total)}"


# -- JSON --------------------------------------------------------------------------------------------------------------


class CostRecord(JsonObject):
    """
    Attributes:
        counted: the changes that count: all of them, or without --count those of bounds that were infinite
        total: the sum of amounts times weights
    """

    counted: Count
    total: Rational


class PlanRepair(documents.Noted, tag_field="schema", tag="robust/repair/1"):
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

    status: documents.Ended
    repair: Annotated[str, one_of("unneeded", "optimal", "feasible", "impossible", "unknown")]
    change: Annotated[str, one_of("bounds", "nominal", "both")]
    count: bool
    solver: documents.Solver
    epsilon: Rational
    required: dict[str, Interval]
    cost: CostRecord | None
    bound: CostRecord
    gap: Rational | None
    attained: bool
    changes: list[documents.PlanChange]
    contradiction: list[str]
    reason: str | None
    conflicts: Count
    candidates: Count
    seconds: Seconds
    written: str | None


@wire.register(Cost)
def _(cost: Cost) -> CostRecord:
    return CostRecord(counted=cost.count, total=cost.total)


@documents.documenting.register(Repair)
def repair_document(repair: Repair, written: Path | None = None) -> documents.Document:
    """With the file that the repaired plan was written to."""
    cost = repair.cost
    return documents.document_of(
        PlanRepair,
        repair,
        status=_ended(repair),
        repair=repair.status,
        gap=cost.total - repair.bound.total if cost is not None and cost.count == repair.bound.count else None,
        changes=documents.changes_of(repair.changes),
        written=None if written is None else str(written),
    )


documents.has_table(Repair, "changes", numbers=documents.CHANGE)


def _ended(repair: Repair) -> str:
    if not repair.cut_short:
        return "complete"
    if repair.reason is not None:
        return "unknown"
    return "interrupted" if repair.interrupted else "timeout"
