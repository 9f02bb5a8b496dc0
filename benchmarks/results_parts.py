"""The parts of `RESULTS.md` that are measured by runs of their own, from the reports of these."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import mean, median
from typing import Any

from .engine.show import Table, bullets, markdown, page
from .irr.contenders import BASELINE, OURS
from .irr.conversions import ConversionReport, Kind, Removal
from .irr.figure4 import Figure4Report
from .irr.tables import DREEX, FEW_REPLANS, Cell, ExecutionReport, label
from .pike.figure17_18 import KIntentsReport, fit_text
from .pike.figure20a_21 import TeamReport
from .pike.figure20b import LatencyReport

Printed = Mapping[str, Any]
"""What a command printed."""


def team_plans(report: TeamReport, _: Printed, date: str) -> str:
    """The compilation of random plans with choices [PIKE, Figures 20a and 21]."""
    inner = sorted(sum(run.stages.values()) for run in report.of("oracle"))
    intro = (
        f"Random plans of [PIKE §6.2.2], Figures 20a and 21 (`robust bench figure20a`), measured on {date}. The paper "
        "compiled 376 of its 500 plans (75.2 %) within 30 minutes; 94 of them admitted a correct execution. A plan "
        "counts as solved once it is known whether a correct execution exists."
    )
    blocks = ["## Plans with choices", intro, "\n".join(f"- {note}" for note in report.notes)]
    if inner:
        blocks.append(
            f"The semantic oracle's own share of its time, without start and reading: {median(inner):.2f} s median, "
            f"{inner[-1]:.2f} s at most."
        )
    blocks += [
        report.solved.markdown(),
        "Mean seconds of each stage, of the runs that finished:",
        report.stages.markdown(),
    ]
    for contender in report.contenders:
        blocks += [f"{contender}, by candidate subplans:", report.sizes(contender).markdown()]
    more = f"More implicants than models: {report.more_implicants} of {len(report.compact)} plans."
    blocks += [
        f"Prime implicants and models, of plans that admit a correct execution. {more}",
        report.implicants().markdown(),
    ]
    return page(*blocks)


def latencies(report: LatencyReport, printed: Printed, date: str) -> str:
    """The executive's latency [PIKE, Figure 20b]; decisions are not printed, only where they differ."""
    intro = (
        "One simulated execution of each random plan that admits a correct one [PIKE, Figure 20b], measured on "
        f"{date} by `robust bench figure20b`. `smt` compiles nothing: each question goes to the semantic oracle's "
        "formula, and its preparation is to state that formula and to find one correct execution. The others compile "
        "a knowledge base. Humans choose what remains correct, activities end while that leaves a correct execution."
    )
    differing = len(printed["differences"])
    same = (
        f"Decisions that differ between back ends: {differing}."
        if differing
        else "All back ends made the same decisions at the same times."
    )
    notes = "\n".join(f"- {note}" for note in report.notes)
    tables = (report.executed.markdown(), report.steps.markdown())
    return page("## Latency of the executive", intro, same, notes, *tables)


def k_intents(report: KIntentsReport, _: Printed, date: str) -> str:
    """Guessing intents [PIKE, Figures 17 and 18]."""
    intro = (
        "Problems of the k-intents domain [PIKE §6.2.1], Figures 17 and 18 (`robust bench figure17` and `figure18`), "
        f"measured on {date}. Kirk guesses one intent, executes the candidate subplan for it, and plans anew when a "
        "human chooses otherwise, after a recovery of half the least duration of the wrong activity. PIKE and Kirk "
        "meet the same humans, who choose uniformly, and the same durations, uniform between their bounds. The "
        "expected number of re-plans is that of wrong guesses, 1 − 1/N for each choice with N options."
    )
    saved = (
        "What PIKE saves, as the mean of all problems. The time of the plan is exact: Kirk is later by its recoveries. "
        "With computing, the seconds in which each of the two decides, plans anew and finds out when to look again are "
        "added, one second to a unit of the plan; what is done before execution is not. The paper's figures are those "
        "of its own implementation."
    )
    return page(
        "## Guessing intents",
        intro,
        "\n".join(f"- {note}" for note in report.remarks),
        report.replans().markdown(),
        f"- Re-plans, problem by problem: {fit_text(report.fit)}.\n"
        f"- Means of each number of choices: {fit_text(report.fit_of_means)}.",
        "Mean times to completion, in units of the plan; computing in seconds:",
        report.times.markdown(),
        saved,
        report.improvements().markdown(),
        _expected(report),
    )


def _expected(report: KIntentsReport) -> str:
    """What the domain's numbers say about the improvement, and what it would take to be the paper's.

    With w = 1/4 on average, a recovery takes (1 + w) / 2 = 5/8 and two activities 2 · (3/2 + w) = 7/2 if durations are
    uniform, or 2 · (1 + w) = 5/2 if they are least.
    """
    choices = sum(run.choices for run in report.compared)
    wrong = float(sum(run.wrong_guesses for run in report.compared)) / choices if choices else 0.0
    uniform, least = (wrong * 0.625 / (two + wrong * 0.625) for two in (3.5, 2.5))
    return (
        f"On average {wrong:.3f} of the guesses are wrong. A recovery takes 0.625 on average, and two activities 3.5, "
        f"so that long problems save {uniform:.1%} of Kirk's time. If all activities took their least time it would be "
        f"{least:.1%}: the paper does not say which durations its simulation draws."
    )


# -- execution ---------------------------------------------------------------------------------------------------------

CHARGES = {
    "520": "so that about one run in ten leaves the first envelope, as in the paper: 293 for the nearer order, and 2.5 "
    "deviations for each of its 14 actions. So DREEX's own re-plans are no evidence here",
    "420": "as what the farther order takes, 339, and three deviations of the sum of its 16 consumptions",
}
"""Why the robot of table 2 begins with a charge, which the paper does not give."""
_ANSWER = re.compile(r"(?P<who>[a-z]+): (?P<what>no plan|timeout|crashed|nonsense)\b")
_OTHERS = {
    "gave up after": "too many re-plans",
    "broke ": "the simulator finds an obligation broken",
    "waits for ever": "waits for ever",
}


def execution(reports: Sequence[Any], date: str) -> str:
    """Tables 1 and 2, conversions and Figure 4 [IRR §5]; a table may be there more than once."""
    blocks = [
        "## Execution",
        f"Tables 1 and 2 and Figure 4 of [IRR §5], measured on {date} (`robust bench table1`, `table2`, "
        "`conversions` and `figure4`). Each cell is ours and then the paper's.",
    ]
    for report in reports:
        match report:
            case ExecutionReport():
                blocks += _table(report)
            case ConversionReport():
                blocks += _conversions(report)
            case _:
                blocks += _figure4(report)
    return page(*(block for block in blocks if block))


def _table(report: ExecutionReport) -> list[str]:
    design, settings = report.DESIGN, report.facts
    battery = settings["battery"]
    missing = "" if report.complete and not report.failures else " NOT all cases were run."
    ran = [place for place, one in enumerate(design.columns, 1) if report.cell(DREEX, one) is not None]
    columns = [design.columns[place - 1] for place in ran]

    def shown(table: Table) -> str:
        places = (0, *ran)
        kept = [tuple(row[place] for place in places) for row in table.rows if row is not None]
        return markdown([table.headings[place] for place in places], kept)

    title = f"### Table {design.number}: {design.title}, planner {settings['planner']}"
    return [
        title + (f", battery {battery}" if battery else ""),
        f"{settings['problems']} problems, {settings['runs']} simulated world each, seed {settings['seed']}; at most "
        f"{settings['planner_s']:g} s for each plan; actions that run when a plan is given up "
        f"{'are waited for' if settings['drain'] else 'are stopped'}. In one case all executors begin with the same "
        "plan, nature draws the same values for the same actions, and who comes to the same state gets the same "
        f"plan.{missing}",
        "Coverage with its 95 % interval, and re-plans of successful runs:",
        shown(report.coverage(lambda cell: f"{cell.covers}; {cell.replanned(1)}")),
        "Cases that only DREEX solves : only the other one solves, and McNemar's exact p:",
        shown(report.pairs),
        bullets((*_claims(report, columns), *_differences(report, columns))),
        *_reasons(report),
    ]


def _claims(report: ExecutionReport, columns: Sequence[str]) -> list[str]:
    """What the paper claims of DREEX, and what became of the guarantee."""
    above = [one for one in columns if report.is_above(one)]
    few = [one for one in columns if report.has_few_replans(one)]
    tested = sum(row.promises for row in report.rows)
    broken = sum(row.broken for row in report.rows)
    replans = [row.replans for row in report.rows if row.executor == DREEX and row.succeeded]
    together = f": {sum(replans)} in {len(replans)} successful runs, {mean(replans):.4f} on average" if replans else ""
    return [
        f"DREEX covers more than every other executor in {len(above)} of {len(columns)} columns, and takes fewer than "
        f"{FEW_REPLANS} re-plans on average in {len(few)}{together}.",
        f"The promise of a dynamically controllable box (all is observed inside, so the plan succeeds) was put to the "
        f"test by {tested} plans and kept by {tested - broken}.",
    ]


def _differences(report: ExecutionReport, columns: Sequence[str]) -> list[str]:
    """What differs from the paper, and what is known of why."""
    cells: dict[tuple[str, str], Cell] = {
        (one, column): cell
        for one in report.executors
        for column in columns
        if (cell := report.cell(one, column)) is not None
    }
    distance = {key: 100 * float(cell.coverage.share) - cell.paper.coverage for key, cell in cells.items()}
    dreex = [value for (executor, _), value in distance.items() if executor == DREEX]
    others = [value for (executor, _), value in distance.items() if executor != DREEX]
    found = [
        f"Percentage points from the paper: DREEX {_range(dreex)}" + (f", BLEX {_range(others)}." if others else "."),
        "Ours, because the paper does not give its own: the places, the least duration, the battery, the planner, and "
        "what becomes of an action that runs when a plan is given up.",
    ]
    charge = CHARGES.get(report.facts["battery"] or "")
    if charge is not None:
        found.append(f"The charge was fixed before the runs, {charge}.")
    exact = [row for row in report.rows if row.executor == "blex:0" and row.succeeded]
    if exact:
        found.append(
            f"BLEX(0) succeeds in {len(exact)} runs, {sum(row.replans > 0 for row in exact)} of them with re-plans. It "
            "gives up a plan at the first deviation, but an action that ended too early has ended: its effects hold, "
            "and the next plan goes on from there. The paper does not say what becomes of such an action."
        )
    failed = [_category(row.reason) for row in report.rows if not row.succeeded]
    found.append(
        f"{sum(reason.endswith('timeout') for reason in failed)} of {len(failed)} failed runs ended because the "
        "planner ran out of time where no proof says that there is no plan: there may have been one, and who re-plans "
        "more often asks more often."
    )
    return found


def _range(values: Sequence[float]) -> str:
    return f"{min(values):+.1f} to {max(values):+.1f} (mean {sum(values) / len(values):+.1f})"


def _reasons(report: ExecutionReport) -> list[str]:
    """Why runs failed, if some did."""
    found = {
        one: Counter(_category(row.reason) for row in report.rows if row.executor == one and not row.succeeded)
        for one in report.executors
    }
    reasons = sorted({reason for counts in found.values() for reason in counts})
    if not reasons:
        return []
    rows = ((label(one), *(str(counts[reason]) for reason in reasons)) for one, counts in found.items())
    return ["Why runs failed, in runs of each executor:", markdown(("executor", *reasons), rows)]


def _category(reason: str) -> str:
    """Who said that there is no plan, and how; or why there was no other plan."""
    answer = _ANSWER.search(reason)
    if answer is not None:
        return f"{answer['who']}: {answer['what']}"
    return next((name for start, name in _OTHERS.items() if start in reason), "other")


def _conversions(report: ConversionReport) -> list[str]:
    missing = "" if report.complete else " NOT all plans were converted."
    numbers = {kind: [sum(row.count(kind, one) for row in report.rows) for one in Removal] for kind in Kind}
    return [
        "### Conversions",
        f"{len(report.rows)} time-triggered plans, each converted to the least constrained network; then each bound "
        f"was removed in turn, and the plan proved or refuted without it. {len(report.failures)} plans could not be "
        f"had or converted.{missing}",
        report.plans.markdown(),
        markdown(
            ("bounds by what they are for", *(one.value for one in Removal)),
            ((kind.value, *map(str, found)) for kind, found in numbers.items() if any(found)),
        ),
        bullets(f"{one.task}: {one.reason}" for one in report.failures),
    ]


def _figure4(report: Figure4Report) -> list[str]:
    rows, origins = report.rows, report.origins
    cells = []
    for contender in report.contenders:
        line = [contender.label]
        for origin in origins:
            runs = [row for row in report.rows_of(origin) if contender.name in row.runs]
            times = report.times(origin, contender.name)
            longest = f", {median(times):.2f} s, {max(times):.2f} s" if times else ""
            line.append(f"{len(times)} of {len(runs)}{longest}")
        if any(contender.name in row.runs for row in rows):
            cells.append(line)
    missing = "" if report.complete and not report.failures else " NOT all runs were made."
    limits = (report.options.limit, report.options.baseline_limit)
    ours, theirs = ("any time" if limit is None else f"{limit:g} s" for limit in limits)
    intro = (
        f"Plans of the delivery domain with 1 to {max(row.parameters for row in rows)} parameters: those of the "
        "data set, and our own. The paper's IRR solved 15 of its instances within an hour, and CCMMZ 3. A run is a "
        f"whole process of at most {ours} for {', '.join(one.label for one in OURS)}, and {theirs} for "
        f"{', '.join(one.label for one in BASELINE)}, which stand for what CCMMZ computes. Each cell: solved, median "
        f"and longest time.{missing}"
    )
    boxes = [run for row in rows if (run := row.runs.get("widen")) is not None and run.box is not None]
    ends = sum(2 * len(run.box or ()) for run in boxes)
    infinite, capped = sum(len(run.unbounded) for run in boxes), sum(len(run.capped) for run in boxes)
    unbounded = (
        f"Of the {ends} ends of the {len(boxes)} boxes of exact widening, {infinite} are infinite, and {capped} are "
        "durations that nothing bounds above but the number in the duration constraint of their action. The JSON names "
        "each such direction."
    )
    return [
        "### Figure 4: scaling in the delivery domain",
        intro,
        markdown(("method", *(origin.value for origin in origins)), cells),
        unbounded,
        _controllability(report),
    ]


def _controllability(report: Figure4Report) -> str:
    found = [row.controllability for row in report.rows if row.controllability is not None]
    if not found:
        return "Controllability was not asked for."
    dynamic = Counter(one.dynamic or one.status for one in found)
    strong = Counter(one.strong or one.status for one in found)
    kept = [one.kept for one in found if one.kept is not None]
    text = f"Of {len(found)} boxes of exact widening: dynamically controllable: {_counts(dynamic)}; strongly: "
    text += f"{_counts(strong)}."
    if kept:
        text += f" Made dynamically controllable, they keep {100 * mean(kept):.1f} % of their widths on average."
    return text


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counter.most_common())
