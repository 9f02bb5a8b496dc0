"""Rankings of plans, for people and as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from robust.irr.proposals import Tolerance, rounded_percent
from robust.json_text import JsonObject, Rational, Seconds, like, one_of
from robust.numbers import duration, plural, readable
from robust.show import documents
from robust.show.console import Console, Text, printing
from robust.show.documents import bounds_text
from robust.show.tables import show_table, table
from robust.show.text import stopped
from robust.sweeps.rank import Fitness, RankedPlan, Ranking

if TYPE_CHECKING:
    from robust.probability.measure import Bounds

_PLACES = 4


@printing.register(Ranking)
def print_ranking(out: Console, ranking: Ranking, *, quiet: bool) -> None:
    """A row for each plan, the best first; unless `quiet` also what makes each better than the next."""
    random = any(plan.success is not None for plan in ranking.plans)
    columns = ["", "plan", "", "end", "all durations", *["in time"] * random]
    rows = [_cells(number, plan, random) for number, plan in enumerate(ranking.plans, start=1)]
    show_table(out, table(columns, rows, right=("", "end", "all durations")))
    if quiet:
        return
    out.print()
    for sentence in ranking.deciding:
        out.print(Text(f"  {sentence}"), soft_wrap=True)
    ended = "" if ranking.status.value == "complete" else f"{stopped(ranking.status, ranking.reason)}: "
    counted = f"{plural(len(ranking.plans), 'plan')}, each to end by {readable(ranking.latest)}"
    out.print(Text(f"{ended}{counted}; {duration(ranking.seconds)}.", style="dim"), soft_wrap=True)


def _cells(number: int, plan: RankedPlan, random: bool) -> tuple[str, ...]:
    borne = "" if plan.tolerance is None else f"± {rounded_percent(plan.tolerance.ratio)}"
    end = "" if plan.end is None else readable(plan.end)
    success = [] if not random else ["" if plan.success is None else bounds_text(plan.success, _PLACES)]
    fitness = "" if plan.fitness is Fitness.VALID else plan.fitness.value
    return str(number), plan.name, fitness, end, borne, *success


class RankedPlanRecord(JsonObject):
    """
    Attributes:
        name: the file, with its number in a log that holds several plans
        fitness: valid: proved, and can be in time; late: ends too late as planned; wrong: for the reason given;
            unasked: time was over
        end: as planned; null if it cannot be read
        tolerance: how much all durations may be longer or shorter at once, as a share of their nominal values; null if
            that is not one number
        success: the probability that the plan is in time; null without distributions
        reason: why the plan is wrong, or has no tolerance
    """

    name: str
    fitness: Annotated[str, one_of(*(fitness.value for fitness in Fitness))]
    end: Rational | None
    tolerance: Tolerance | None
    success: documents.Range | None
    reason: str | None


class Rank(documents.Noted, tag_field="schema", tag="robust/rank/1"):
    """robust rank --json: several plans of one problem, the best first

    Attributes:
        latest: by when all plans must end
        deciding: for each plan but the last what makes it better than the next
    """

    status: documents.Ended
    epsilon: Rational
    latest: Rational
    plans: list[RankedPlanRecord]
    deciding: list[str]
    seconds: Seconds


@documents.documenting.register(Ranking)
def _(ranking: Ranking) -> documents.Document:
    return documents.document(
        like(Rank, ranking, status=ranking.status.value, plans=[_record(plan) for plan in ranking.plans])
    )


def _record(plan: RankedPlan) -> RankedPlanRecord:
    return like(RankedPlanRecord, plan, fitness=plan.fitness.value, success=_range(plan.success))


def _range(success: Bounds | None) -> documents.Range | None:
    return None if success is None else documents.range_of(success)


documents.has_table(Ranking, "plans", numbers=("end",))
DOCUMENTS: tuple[type[JsonObject], ...] = (Rank,)
