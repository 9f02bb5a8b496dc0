"""The part of the results page about execution, from printed JSON: Tables 1 and 2, conversions, Figure 4 [IRR §5]."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import mean, median
from textwrap import fill
from typing import Any

from robust.bench.conversions import SCHEMA as CONVERSIONS
from robust.bench.execution_layout import label
from robust.bench.execution_tables import (
    DREEX,
    FEW_REPLANS,
    TABLE1,
    TABLE2,
    Cell,
    ExecutionReport,
    ExecutionRow,
    TableDesign,
)
from robust.bench.figure4 import SCHEMA as FIGURE4
from robust.bench.figure4_work import BASELINE, CONTENDERS, OURS
from robust.bench.removals import Kind, Removal
from robust.bench.run import Outcome
from robust.bench.tables import NOTHING

WIDTH = 120
Printed = Mapping[str, Any]

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


def execution(printed: Iterable[Printed], date: str) -> str:
    """The part, from what `table1`, `table2`, `conversions` and `figure4` printed; a table may be there more than once.

    Raises:
        ValueError: for JSON of another kind.
    """
    blocks = [
        "## Execution",
        _paragraph(
            f"Tables 1 and 2 and Figure 4 of [IRR §5], measured on {date} (`robust bench table1`, `table2`, "
            "`conversions` and `figure4`). Each cell is ours and then the paper's."
        ),
    ]
    for one in printed:
        match one.get("schema"):
            case TABLE1.schema:
                blocks += _table(TABLE1, one)
            case TABLE2.schema:
                blocks += _table(TABLE2, one)
            case schema if schema == CONVERSIONS:
                blocks += _conversions(one)
            case schema if schema == FIGURE4:
                blocks += _figure4(one)
            case schema:
                raise ValueError(f"found schema {schema!r}, expected that of table1, table2, conversions or figure4")
    return "\n\n".join(blocks)


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    lines = (headings, ["---"] * len(headings), *rows)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _paragraph(text: str) -> str:
    return fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def _list(items: Iterable[str]) -> str:
    return "\n".join(
        fill(item, WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False) for item in items
    )


# -- tables 1 and 2 ----------------------------------------------------------------------------------------------------


def table_report(design: TableDesign, printed: Printed) -> ExecutionReport:
    """The report that was printed as JSON."""
    rows = tuple(ExecutionRow(**row) for row in printed["rows"])
    return ExecutionReport(
        design,
        tuple(dict.fromkeys(row.executor for row in rows)),
        rows,
        tuple((one["task"], one["reason"]) for one in printed["failures"]),
        printed["complete"],
        printed["settings"],
    )


def _table(design: TableDesign, printed: Printed) -> list[str]:
    report = table_report(design, printed)
    columns = [one for one in design.columns if report.cell(DREEX, one) is not None]
    battery = report.settings["battery"]
    title = f"### Table {design.number}: {design.title}, planner {report.settings['planner']}"
    blocks = [
        title + (f", battery {battery}" if battery else ""),
        _paragraph(_settings(report)),
        "Coverage with its 95 % interval, and re-plans of successful runs:",
        markdown(
            ("executor", *columns),
            ((label(one), *(_cell(report.cell(one, column)) for column in columns)) for one in report.executors),
        ),
        "Cases that only DREEX solves : only the other one solves, and McNemar's exact p:",
        markdown(
            ("against", *columns),
            ((label(one), *(_pair(report.cell(one, column)) for column in columns)) for one in report.executors[1:]),
        ),
        _list((*_claims(report, columns), *_differences(report, columns))),
    ]
    failed = _failures(report)
    if failed:
        blocks += ["Why runs failed, in runs of each executor:", failed]
    return blocks


def _settings(report: ExecutionReport) -> str:
    settings = report.settings
    running = "are waited for" if settings["drain"] else "are stopped"
    missing = "" if report.complete and not report.failures else " NOT all cases were run."
    return (
        f"{settings['problems']} problems, {settings['runs']} simulated world each, seed {settings['seed']}; at most "
        f"{settings['planner_s']:g} s for each plan; actions that run when a plan is given up {running}. In one case "
        "all executors begin with the same plan, nature draws the same values for the same actions, and who comes to "
        f"the same state gets the same plan.{missing}"
    )


def _cell(cell: Cell | None) -> str:
    if cell is None:
        return NOTHING
    lower, upper = (round(100 * end) for end in cell.coverage.interval())
    replans = NOTHING if cell.replans is None else f"{cell.replans.value:.1f}"
    theirs = NOTHING if cell.paper.replans is None else f"{cell.paper.replans:.1f}"
    coverage = f"{100 * float(cell.coverage.share):.1f} % [{lower}–{upper}] / {cell.paper.coverage:.1f} %"
    return f"{coverage}; {replans} / {theirs}"


def _pair(cell: Cell | None) -> str:
    if cell is None or cell.against is None:
        return NOTHING
    p = float(cell.against.p_value)
    return f"{cell.against.first} : {cell.against.second}, {'< 0.0001' if p < 0.0001 else f'{p:.4f}'}"


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
    cells = {(one, c): cell for one in report.executors for c in columns if (cell := report.cell(one, c)) is not None}
    distance = {key: 100 * float(cell.coverage.share) - cell.paper.coverage for key, cell in cells.items()}
    dreex = [value for (executor, _), value in distance.items() if executor == DREEX]
    others = [value for (executor, _), value in distance.items() if executor != DREEX]
    found = [
        f"Percentage points from the paper: DREEX {_range(dreex)}" + (f", BLEX {_range(others)}." if others else ".")
    ]
    found.append(
        "Ours, because the paper does not give its own: the places, the least duration, the battery, the planner, and "
        "what becomes of an action that runs when a plan is given up."
    )
    charge = CHARGES.get(report.settings["battery"] or "")
    if charge is not None:
        found.append(f"The charge was fixed before the runs, {charge}.")
    exact = [row for row in report.rows if row.executor == "blex:0" and row.succeeded]
    if exact:
        some = sum(row.replans > 0 for row in exact)
        found.append(
            f"BLEX(0) succeeds in {len(exact)} runs, {some} of them with re-plans. It gives up a plan at the first "
            "deviation, but an action that ended too early has ended: its effects hold, and the next plan goes on from "
            "there. The paper does not say what becomes of such an action."
        )
    asked = Counter(_category(row.reason) for row in report.rows if not row.succeeded)
    late = sum(count for reason, count in asked.items() if reason.endswith("timeout"))
    found.append(
        f"{late} of {sum(asked.values())} failed runs ended because the planner ran out of time where no proof says "
        "that there is no plan: there may have been one, and who re-plans more often asks more often."
    )
    return found


def _range(values: Sequence[float]) -> str:
    return f"{min(values):+.1f} to {max(values):+.1f} (mean {sum(values) / len(values):+.1f})"


def _failures(report: ExecutionReport) -> str:
    found = {one: Counter[str]() for one in report.executors}
    for row in report.rows:
        if not row.succeeded:
            found[row.executor][_category(row.reason)] += 1
    reasons = sorted({reason for counts in found.values() for reason in counts})
    if not reasons:
        return ""
    rows = ((label(one), *(str(counts[reason]) for reason in reasons)) for one, counts in found.items())
    return markdown(("executor", *reasons), rows)


def _category(reason: str) -> str:
    """Who said that there is no plan, and how; or why there was no other plan."""
    answer = _ANSWER.search(reason)
    if answer is not None:
        return f"{answer['who']}: {answer['what']}"
    return next((name for start, name in _OTHERS.items() if start in reason), "other")


# -- conversions -------------------------------------------------------------------------------------------------------


def _conversions(printed: Printed) -> list[str]:
    rows = printed["rows"]
    sources = tuple(dict.fromkeys(row["source"] for row in rows))
    facts = {
        "plans": lambda of: str(len(of)),
        "proved valid": lambda of: str(sum(row["proved"] for row in of)),
        "allow the plan itself": lambda of: str(sum(row["allowed"] for row in of)),
        "with a removable bound": lambda of: str(sum(bool(row["removable"]) for row in of)),
        "steps, median": lambda of: f"{median(row['steps'] for row in of):g}",
        "seconds to convert, median": lambda of: f"{median(row['convert_s'] for row in of):.2f}",
        "seconds to convert, longest": lambda of: f"{max(row['convert_s'] for row in of):.2f}",
    }
    of_source = {source: [row for row in rows if row["source"] == source] for source in sources}
    bounds = Counter[tuple[str, str]]()
    for row in rows:
        for one in row["bounds"]:
            bounds[one["kind"], one["removal"]] += one["bounds"]
    missing = "" if printed["complete"] else " NOT all plans were converted."
    blocks = [
        "### Conversions",
        _paragraph(
            f"{len(rows)} time-triggered plans, each converted to the least constrained network; then each bound was "
            f"removed in turn, and the plan proved or refuted without it. {len(printed['failures'])} plans could not "
            f"be had or converted.{missing}"
        ),
        markdown(("", *sources), ((name, *(fact(of_source[one]) for one in sources)) for name, fact in facts.items())),
        markdown(
            ("bounds by what they are for", *(one.value for one in Removal)),
            (
                (kind.value, *(str(bounds[kind.value, one.value]) for one in Removal))
                for kind in Kind
                if any(bounds[kind.value, one.value] for one in Removal)
            ),
        ),
    ]
    return blocks + (
        [_list(f"{one['task']}: {one['reason']}" for one in printed["failures"])] if printed["failures"] else []
    )


# -- figure 4 ----------------------------------------------------------------------------------------------------------


def _figure4(printed: Printed) -> list[str]:
    rows = printed["rows"]
    origins = tuple(dict.fromkeys(row["origin"] for row in rows))
    names = {one.name for row in rows for one in CONTENDERS if one.name in row["runs"]}
    ours, theirs = printed["limit_s"], printed["baseline_limit_s"]
    cells = []
    for contender in (one for one in CONTENDERS if one.name in names):
        line = [contender.label]
        for origin in origins:
            runs = [
                row["runs"][contender.name] for row in rows if row["origin"] == origin and contender.name in row["runs"]
            ]
            times = [run["seconds"] for run in runs if run["status"] == Outcome.COMPLETE.value]
            longest = f", {median(times):.2f} s, {max(times):.2f} s" if times else ""
            line.append(f"{len(times)} of {len(runs)}{longest}")
        cells.append(line)
    missing = "" if printed["complete"] and not printed["failures"] else " NOT all runs were made."
    intro = (
        f"Plans of the delivery domain with 1 to {max(row['parameters'] for row in rows)} parameters: those of the "
        "data set, and our own. The paper's IRR solved 15 of its instances within an hour, and CCMMZ 3. A run is a "
        f"whole process of at most {_seconds(ours)} for {_names(OURS)}, and {_seconds(theirs)} for {_names(BASELINE)}, "
        f"which stand for what CCMMZ computes. Each cell: solved, median and longest time.{missing}"
    )
    return [
        "### Figure 4: scaling in the delivery domain",
        _paragraph(intro),
        markdown(("method", *origins), cells),
        _unbounded(rows),
        _controllability(rows),
    ]


def _seconds(limit: float | None) -> str:
    return "any time" if limit is None else f"{limit:g} s"


def _names(contenders: Iterable[Any]) -> str:
    return ", ".join(one.label for one in contenders)


def _unbounded(rows: Sequence[Printed]) -> str:
    boxes = [run for row in rows if (run := row["runs"].get("widen")) is not None and run["box"] is not None]
    ends, infinite, capped = (
        sum(len(run[key]) * factor for run in boxes) for key, factor in (("box", 2), ("unbounded", 1), ("capped", 1))
    )
    return _paragraph(
        f"Of the {ends} ends of the {len(boxes)} boxes of exact widening, {infinite} are infinite, and {capped} are "
        "durations that nothing bounds above but the number in the duration constraint of their action. The JSON names "
        "each such direction."
    )


def _controllability(rows: Sequence[Printed]) -> str:
    found = [row["controllability"] for row in rows if row["controllability"] is not None]
    if not found:
        return "Controllability was not asked for."
    dynamic = Counter(one["dynamic"] or one["status"] for one in found)
    strong = Counter(one["strong"] or one["status"] for one in found)
    kept = [one["kept"] for one in found if one["kept"] is not None]
    text = (
        f"Of {len(found)} boxes of exact widening: dynamically controllable: {_counts(dynamic)}; strongly: "
        f"{_counts(strong)}."
    )
    if kept:
        text += (
            f" Made dynamically controllable, they keep {100 * sum(kept) / len(kept):.1f} % of their widths on average."
        )
    return _paragraph(text)


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counter.most_common())
