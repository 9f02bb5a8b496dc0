"""Answers about many plans and many runs, for people and as JSON: batches of plans (as CSV as well), rankings of plans,
and durations learnt from logs.
"""

import csv
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from io import StringIO
from operator import attrgetter
from statistics import median
from typing import Annotated, Any

from msgspec import UNSET, UnsetType

from robust.execute.learned import Learned, LearntAction
from robust.irr.stops import rounded_percent
from robust.json_text import Count, JsonObject, Rational, Seconds, like, on_wire, one_of, wire
from robust.numbers import duration, plural, readable
from robust.probability.measure import Bounds
from robust.qe.box import Box, interval_text
from robust.qe.region import Region
from robust.show import documents
from robust.show.console import Console, Text, colour_of, printing
from robust.show.documents import ENDS, Document, Ended, Noted, document_of, documenting, has_table
from robust.show.regions import in_form, region_lines
from robust.show.tables import show_table, table
from robust.show.text import stopped
from robust.sweeps.batch import CCMMZ, IRR, REGION, Batch, BatchRow, PlanRun, Solved, box_of
from robust.sweeps.rank import Fitness, RankedPlan, Ranking

NAMES = {IRR: "IRR", CCMMZ: "CCMMZ", REGION: "region"}
"""What is compared, as people call it."""
FIRST = 3
"""Lines of an answer that tables show."""
_NOTHING = "–"


# -- answers as text ---------------------------------------------------------------------------------------------------


def answer_lines(run: PlanRun) -> list[str]:
    """The box or the region of an answer, or the line that it has instead."""
    if run.message is not None:
        return [run.message]
    first = [] if run.tolerance is None else [f"all durations ± {rounded_percent(Fraction(run.tolerance))} at once"]
    if run.box is not None:
        return [*first, *(f"{name} ∈ {text}" for name, text in box_texts(run).items())] or ["no parameters"]
    if run.region is not None:
        return list(region_lines(in_form(Region.from_dict(run.region), None), exact=True))
    return first


def box_texts(run: PlanRun) -> dict[str, str]:
    """Intervals for people, by parameter."""
    intervals = box_of(run.box or {}).intervals
    return {name: interval_text(interval) for name, interval in intervals.items()}


def first_lines(run: PlanRun) -> str:
    """The first lines of an answer, as many as fit into a table."""
    lines = answer_lines(run)
    more = [] if len(lines) <= FIRST else [f"… and {plural(len(lines) - FIRST, 'more line')}"]
    return "\n".join([*lines[:FIRST], *more])


def ratio(value: Fraction | None) -> str:
    """A share in per cent."""
    return _NOTHING if value is None else f"{float(value) * 100:.3g} %"


# -- for people --------------------------------------------------------------------------------------------------------


@printing.register(Batch)
def print_batch(out: Console, batch: Batch, *, quiet: bool) -> None:
    """A line for each plan, and unless `quiet` what they come to."""
    compared = batch.verb == "compare"
    (_print_compared if compared else _print_answers)(out, batch)
    if not quiet:
        out.print()
        out.lines(summary_lines(batch))


def _print_answers(out: Console, batch: Batch) -> None:
    rows = [(row.instance.name, *_outcome(run), first_lines(run)) for row in batch.plans for run in row.runs.values()]
    show_table(out, table(("plan", "answer", "time", "what it says"), rows, right=("time",)))


def _print_compared(out: Console, batch: Batch) -> None:
    names = [asked.name for asked in batch.asked]
    head = ("plan", *(word for name in names for word in (NAMES[name], "time")), "volume", "width")
    rows: list[Sequence[str | Text]] = []
    for row in batch.plans:
        cells = [cell for name in names for cell in _outcome(row.runs.get(name))]
        rows.append((row.instance.name, *cells, ratio(row.volume_ratio), ratio(row.width_ratio)))
    show_table(out, table(head, rows, right=("time", "volume", "width")))
    for row in batch.plans:
        for message in dict.fromkeys(run.message for run in row.runs.values() if run.message is not None):
            out.line(f"{row.instance.name}: {message}")


def _outcome(run: PlanRun | None) -> tuple[Text, str]:
    """The status and the time of an answer."""
    if run is None:
        return Text(_NOTHING), _NOTHING
    return Text(run.status, style=colour_of(run.status)), duration(run.seconds)


def summary_lines(batch: Batch) -> list[str]:
    """The summary of a batch: the comparison, or counts by status, and then notes."""
    lines = []
    if batch.verb == "compare":
        lines += [_solved_line(batch, asked.name) for asked in batch.asked]
        lines += _both_lines(batch)
    else:
        counts = Counter(run.status for row in batch.plans for run in row.runs.values())
        said = ", ".join(f"{count} {word}" for word, count in counts.most_common())
        lines.append(
            f"{len(batch.plans)} of {plural(batch.total, 'plan')}: {said or 'none'}; {duration(batch.seconds)}."
        )
    return [*lines, *batch.notes]


def _solved_line(batch: Batch, name: str) -> str:
    solved, total = batch.solved(name), batch.total
    middle = "" if solved.median_s is None else f", median {duration(solved.median_s)}"
    alone = f"; {solved.alone} of them alone" if solved.alone else ""
    return f"{NAMES[name]} answers {solved.plans} of {total} in {duration(solved.seconds)}{middle}{alone}."


def _both_lines(batch: Batch) -> list[str]:
    """Lines about plans that both answer: times, and volumes."""
    both = [row for row in batch.plans if all(name in row.runs and row.runs[name].solved for name in (IRR, CCMMZ))]
    if not both:
        return []
    irr, ccmmz = (sum(row.runs[name].seconds for row in both) for name in (IRR, CCMMZ))
    lines = [f"The {plural(len(both), 'plan')} that both answer: IRR {duration(irr)}, CCMMZ {duration(ccmmz)}."]
    shares = volume_shares(batch)
    if shares:
        least, most = shares[0], shares[-1]
        lines.append(
            f"Volume of IRR's box as a share of CCMMZ's, of {plural(len(shares), 'plan')} with both: median "
            f"{ratio(median(shares))}, least {ratio(least)}, most {ratio(most)}."
        )
    lines.append("In the table: volume and width of IRR's box as shares of CCMMZ's; – where one is infinite or zero.")
    return lines


def volume_shares(batch: Batch) -> list[Fraction]:
    """The known shares of volume, in ascending order."""
    return sorted(share for row in batch.plans if (share := row.volume_ratio) is not None)


# -- JSON --------------------------------------------------------------------------------------------------------------

Status = Annotated[
    str, one_of("proved", "refuted", "unknown", "complete", "timeout", "interrupted", "invalid", "error", "unsupported")
]
BatchEnded = Annotated[str, one_of("complete", "timeout", "interrupted", "lost")]


class Answered(JsonObject):
    """what a process of its own answered

    Attributes:
        status: the verdict of a check, how a search ended, or that there is no answer
        exit_code: of `robust` for this plan
        seconds: of the whole process
        cpu_s: the same on processors
        memory_mb: the most that the process had in memory
        search_s: of the search in it
        first_widening_s: when the box was more than a point, since the search began
        message: what breaks, or what is wrong
        tolerance: how much all durations that are parameters may be longer or shorter at once, as a share of their
            nominal values; null where that is not known or was not asked for
        box: values for all of which the plan is valid; null where none was found or asked for
        region: as of `robust region --json`; null where it is not complete or was not asked for
    """

    status: Status
    exit_code: Annotated[int, one_of(0, 1, 2, 3, 4)]
    seconds: Seconds
    cpu_s: Seconds
    memory_mb: Seconds
    search_s: Seconds | None
    first_widening_s: Seconds | None
    message: str | None
    tolerance: Rational | None
    box: Box | None
    region: dict[str, Any] | None


class BatchPlan(JsonObject):
    """
    Attributes:
        instance: its name in the suite
        domain: relative to the folder of the suite, as the other files
    """

    instance: str
    domain: str
    problem: str
    plan: str
    answer: Answered


class Ran(JsonObject, kw_only=True):
    """a batch, as far as it got

    Attributes:
        suite: the folder or list
        status: timeout: of all plans; lost: the cluster went away
        total: plans of the suite; of those that are not in `plans` nothing is known
        exit_code: 1 if a plan is refuted; else 2 if one cannot be read; else 4 if one is unsupported; else 3 if one is
            undecided or missing; else 0
        notes: what was resumed, and what is missing and how to get it
    """

    suite: str
    status: BatchEnded
    total: Count
    exit_code: Annotated[int, one_of(0, 1, 2, 3, 4)]
    seconds: Seconds
    notes: list[str]


class BatchDocument(Ran, tag_field="schema", tag="robust/batch/1"):
    """robust batch check|envelope|region --json: one question about many plans

    Attributes:
        counts: how many plans by status
    """

    verb: Annotated[str, one_of("check", "envelope", "region")]
    counts: dict[str, Count]
    plans: list[BatchPlan]


class ComparedPlan(JsonObject, kw_only=True):
    """
    Attributes:
        irr: the box of IRR; null if that is not done
        ccmmz: the box of greatest total width, which CCMMZ asks for
        region: the exact region, where it was asked for
        volume_ratio: the volume of IRR's box as a share of that of CCMMZ's, over the parameters that are not single
            values in both; null unless both are complete and have finite volumes
        width_ratio: the same of total widths
    """

    instance: str
    domain: str
    problem: str
    plan: str
    irr: Answered | None
    ccmmz: Answered | None
    region: Answered | UnsetType | None = UNSET
    volume_ratio: Rational | None
    width_ratio: Rational | None


class Shares(JsonObject):
    """
    Attributes:
        plans: of how many the share is known
    """

    plans: Count
    least: Rational | None
    median: Rational | None
    most: Rational | None


class BatchCompareDocument(Ran, tag_field="schema", tag="robust/batch-compare/1"):
    """robust batch compare --json: CCMMZ against IRR on many plans

    Attributes:
        solved: by what was asked
        volume_ratio: over all plans
    """

    solved: dict[str, Solved]
    volume_ratio: Shares
    plans: list[ComparedPlan]


@documenting.register(Batch)
def batch_document(batch: Batch) -> Document:
    """The document that `robust batch --json` prints."""
    if batch.verb != "compare":
        runs = [(row, run) for row in batch.plans for run in row.runs.values()]
        counts = Counter(run.status for _, run in runs)
        plans = [like(BatchPlan, row.instance, instance=row.instance.name, answer=_answered(run)) for row, run in runs]
        return document_of(BatchDocument, batch, counts=counts, plans=plans)
    shares = volume_shares(batch)
    return document_of(
        BatchCompareDocument,
        batch,
        solved={asked.name: batch.solved(asked.name) for asked in batch.asked},
        volume_ratio=Shares(
            plans=len(shares),
            least=shares[0] if shares else None,
            median=median(shares) if shares else None,
            most=shares[-1] if shares else None,
        ),
        plans=[_compared(batch, row) for row in batch.plans],
    )


has_table(Batch, "plans", numbers=(*ENDS, "volume_ratio", "width_ratio"))


def _answered(run: PlanRun) -> Answered:
    tolerance = None if run.tolerance is None else Fraction(run.tolerance)
    return like(Answered, run, tolerance=tolerance, box=None if run.box is None else box_of(run.box))


def _compared(batch: Batch, row: BatchRow) -> ComparedPlan:
    answers = {asked.name: None for asked in batch.asked} | {name: _answered(run) for name, run in row.runs.items()}
    return like(
        ComparedPlan,
        row.instance,
        instance=row.instance.name,
        irr=answers[IRR],
        ccmmz=answers[CCMMZ],
        region=answers.get(REGION, UNSET),
        volume_ratio=row.volume_ratio,
        width_ratio=row.width_ratio,
    )


# -- CSV ---------------------------------------------------------------------------------------------------------------

Column = Callable[[PlanRun], object]


def exact_box(run: PlanRun) -> str | None:
    """The box in one cell, exactly: `a [1/3, 7/2); b [0, inf)`."""
    if run.box is None:
        return None
    return "; ".join(f"{name} {interval}" for name, interval in box_of(run.box).intervals.items())


_SAID = ("status", "exit_code", "seconds", "cpu_s", "memory_mb", "search_s", "message", "tolerance")
_RUN: Mapping[str, Column] = {
    **{name: attrgetter(name) for name in _SAID},
    "box": exact_box,
    "polyhedra": lambda run: None if run.region is None else len(Region.from_dict(run.region).pieces),
}
"""What is said of each answer."""


def csv_text(batch: Batch) -> str:
    """A head, and a line for each plan; of a comparison, columns are those of each answer with its name before them."""
    compared = batch.verb == "compare"
    names = [asked.name for asked in batch.asked]
    head = ["instance", "domain", "problem", "plan"]
    head += [f"{name}_{column}" if compared else column for name in names for column in _RUN]
    head += ["volume_ratio", "width_ratio"] if compared else []
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    for row in batch.plans:
        plan = row.instance
        cells: list[object] = [plan.name, plan.domain, plan.problem, plan.plan]
        for name in names:
            run = row.runs.get(name)
            cells += [None if run is None else value(run) for value in _RUN.values()]
        cells += [row.volume_ratio, row.width_ratio] if compared else []
        writer.writerow(["" if cell is None else cell for cell in cells])
    return text.getvalue()


# -- rankings ----------------------------------------------------------------------------------------------------------

_PLACES = 4


@printing.register(Ranking)
def print_ranking(out: Console, ranking: Ranking, *, quiet: bool) -> None:
    """A row for each plan, the best first; unless `quiet` also what makes each better than the next."""
    random = any(plan.success is not None for plan in ranking.plans)
    columns = ["", "plan", "", "end", "all durations", *["in time"] * random]
    rows = [_ranked_cells(number, plan, random) for number, plan in enumerate(ranking.plans, start=1)]
    show_table(out, table(columns, rows, right=("", "end", "all durations")))
    if quiet:
        return
    out.print()
    for sentence in ranking.deciding:
        out.line(f"  {sentence}")
    ended = "" if ranking.status.value == "complete" else f"{stopped(ranking.status, ranking.reason)}: "
    counted = f"{plural(len(ranking.plans), 'plan')}, each to end by {readable(ranking.latest)}"
    out.line(f"{ended}{counted}; {duration(ranking.seconds)}.", "dim")


def _ranked_cells(number: int, plan: RankedPlan, random: bool) -> tuple[str, ...]:
    borne = "" if plan.tolerance is None else f"± {rounded_percent(plan.tolerance.ratio)}"
    end = "" if plan.end is None else readable(plan.end)
    success = [] if not random else ["" if plan.success is None else documents.bounds_text(plan.success, _PLACES)]
    fitness = "" if plan.fitness is Fitness.VALID else plan.fitness.value
    return str(number), plan.name, fitness, end, borne, *success


wire.register(Bounds, documents.range_of)


class Rank(Noted, tag_field="schema", tag="robust/rank/1"):
    """robust rank --json: several plans of one problem, the best first

    Attributes:
        latest: by when all plans must end
        deciding: for each plan but the last what makes it better than the next
    """

    status: Ended
    epsilon: Rational
    latest: Rational
    plans: list[RankedPlan]
    deciding: list[str]
    seconds: Seconds


@documenting.register(Ranking)
def _(ranking: Ranking) -> Document:
    return document_of(Rank, ranking)


has_table(Ranking, "plans", numbers=("end",))


# -- durations learnt from logs ----------------------------------------------------------------------------------------


@printing.register(Learned)
def print_learned(out: Console, learned: Learned, *, quiet: bool) -> None:
    """A row for each action; unless `quiet` also what limits mean, and what is not known."""
    columns = ["action", "runs", "failed", "from", "to", "longest", "later runs"]
    rows = [_learnt_cells(name, action) for name, action in learned.actions.items()]
    show_table(out, table(columns, rows, right=("runs", "failed", "from", "to", "longest")))
    if quiet:
        return
    actions = learned.actions.values()
    out.print()
    for sentence in _sentences(learned):
        out.line(f"  {sentence}")
    counted = f"{plural(sum(action.runs for action in actions), 'run')} of {plural(len(actions), 'action')}"
    out.line(f"{counted}; {duration(learned.seconds)}.", "dim")


def _learnt_cells(name: str, action: LearntAction) -> tuple[str, ...]:
    longest = "" if action.longest is None else readable(action.longest)
    upper = "?" if action.upper is None else readable(action.upper)
    drift = action.drift
    change = "" if drift is None or not drift.found else f"differ: {readable(drift.earlier)} → {readable(drift.later)}"
    return name, str(action.runs), str(action.failed or ""), readable(action.lower), upper, longest, change


def _sentences(learned: Learned) -> list[str]:
    actions = learned.actions.values()
    cover, confidence = (f"{float(100 * share):g} %" for share in (learned.cover, learned.confidence))
    promised = [action for action in actions if action.upper is not None]
    sentences = [f"to: covers {cover} of future runs with {confidence} confidence, if they are as those in the logs."]
    if len(promised) < len(actions):
        missing = plural(len(actions) - len(promised), "action")
        needed = f"a limit needs {next(iter(actions)).needed}, of the later half where runs differ"
        sentences.append(f"?: {missing} with too few runs: {needed}.")
    if drifting := sum(action.drift is not None and action.drift.found for action in actions):
        what = "medians of the earlier and the later half; limits hold for the later half by itself too"
        sentences.append(f"later runs of {plural(drifting, 'action')} differ: {what}.")
    for count, what in (
        (sum(action.failed for action in actions), "failed: no limit counts failures"),
        (sum(action.unfinished for action in actions), "did not end in the logs"),
        (sum(action.clock_resets for action in actions), "took unknown time: the clock was set back"),
    ):
        if count:
            sentences.append(f"{plural(count, 'run')} {what}.")
    return sentences


on_wire("LearntAction", values=None)


class Learn(Noted, tag_field="schema", tag="robust/learn/1"):
    """robust learn --json: durations of actions, learnt from logs

    Attributes:
        cover: the share of future runs that limits cover
        confidence: with which they do
    """

    cover: Rational
    confidence: Rational
    actions: dict[str, LearntAction]
    seconds: Seconds


@documenting.register(Learned)
def _(learned: Learned) -> Document:
    return document_of(Learn, learned)


has_table(Learned, "actions", named="action", numbers=("lower", "upper", "longest", "drift_earlier", "drift_later"))
