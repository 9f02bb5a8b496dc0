"""Parts of `RESULTS.md` that are measured by runs of their own, from the JSON that these printed.

`python -m benchmarks.parts team-plans FILE.json` writes `parts/1-team-plans.md` from what `robust bench figure20a
--json` printed, and puts all parts at the end of `RESULTS.md`. Likewise `latency` writes `parts/3-latency.md` from
`robust bench figure20b`, and `k-intents` `parts/4-k-intents.md` from `robust bench figure18`. With `execution`, any
number of files of `robust bench table1`, `table2`, `conversions` and `figure4` become `parts/5-execution.md`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from textwrap import fill
from typing import Any

from benchmarks.execution_part import execution
from robust.bench.figure20b import Execution, LatencyReport
from robust.bench.k_intents import KIntentsReport, report_of
from robust.bench.k_intents_tables import (
    IMPROVEMENT_HEADINGS,
    REPLAN_HEADINGS,
    TIME_HEADINGS,
    fit_text,
    improvement_cells,
    replan_cells,
    time_cells,
)
from robust.bench.k_intents_tables import notes as k_intents_notes
from robust.bench.latency_tables import EXECUTED_HEADINGS, STEP_HEADINGS, executed_cells, step_cells
from robust.bench.latency_tables import notes as latency_notes
from robust.bench.team_plans import CONTENDERS, FIGURE20A, TeamReport, TeamRun
from robust.bench.team_tables import (
    IMPLICANT_HEADINGS,
    SIZE_HEADINGS,
    SOLVED_HEADINGS,
    STAGE_HEADINGS,
    compact_runs,
    implicant_cells,
    notes,
    size_cells,
    solved_cells,
    stage_cells,
)

RESULTS = Path(__file__).with_name("RESULTS.md")
PARTS = Path(__file__).with_name("parts")
MARK = "<!-- Parts that are measured by runs of their own: see benchmarks/parts.py -->"


def joined(results: str) -> str:
    """The page with the parts as they are now."""
    own = results.split(MARK, maxsplit=1)[0].rstrip()
    parts = (path.read_text(encoding="utf-8").strip() for path in sorted(PARTS.glob("*.md")))
    return "\n\n".join([own, MARK, *parts]) + "\n"


def team_report(printed: dict[str, Any]) -> TeamReport:
    """The report that was printed as JSON."""
    runs = tuple(TeamRun(**run) for run in printed["runs"])
    names = {run.contender for run in runs}
    return TeamReport(
        schema=FIGURE20A,
        contenders=tuple(each for each in CONTENDERS if each.name in names),
        activities={plan["instance"]: plan["activities"] for plan in printed["plans"]},
        subplans={plan["instance"]: plan["candidate_subplans"] for plan in printed["plans"]},
        runs=runs,
        complete=printed["complete"],
        limit=printed["limit"],
        seed=printed["seed"],
        jobs=printed["jobs"],
    )


def team_plans(report: TeamReport, date: str) -> str:
    """The part about the compilation of random plans with choices [PIKE, Figures 20a and 21]."""
    inner = sorted(sum(run.stages.values()) for run in report.runs if run.contender == "oracle")
    compared = compact_runs(report)
    above = sum(1 for run in compared if (run.prime_implicants or 0) > (run.models or 0))
    intro = (
        f"Random plans of [PIKE §6.2.2], Figures 20a and 21 (`robust bench figure20a`), measured on {date}. The paper "
        "compiled 376 of its 500 plans (75.2 %) within 30 minutes; 94 of them admitted a correct execution. A plan "
        "counts as solved once it is known whether a correct execution exists."
    )
    blocks = ["## Plans with choices", fill(intro, 120), "\n".join(f"- {note}" for note in notes(report))]
    if inner:
        blocks.append(
            fill(
                f"The semantic oracle's own share of its time, without start and reading: {median(inner):.2f} "
                f"s median, {inner[-1]:.2f} s at most.",
                120,
            )
        )
    blocks.append(table(SOLVED_HEADINGS, (solved_cells(report, each) for each in report.contenders)))
    blocks += [
        "Mean seconds of each stage, of the runs that finished:",
        table(STAGE_HEADINGS, (stage_cells(report, each) for each in report.contenders)),
    ]
    for contender in report.contenders:
        blocks += [f"{contender.name}, by candidate subplans:", table(SIZE_HEADINGS, size_cells(report, contender))]
    blocks += [
        "Prime implicants and models, of plans that admit a correct execution. More implicants than models: "
        f"{above} of {len(compared)} plans.",
        table(IMPLICANT_HEADINGS, implicant_cells(report)),
    ]
    return "\n\n".join(blocks)


def latency_report(printed: dict[str, Any]) -> LatencyReport:
    """The report that `robust bench figure20b --json` printed, without the decisions, which are not printed."""
    executions = tuple(
        Execution(
            run["backend"],
            run["instance"],
            run["outcome"],
            run["preparation_seconds"],
            tuple(run["step_seconds"]),
            tuple(run["wake_seconds"]),
            (),
            run["message"],
        )
        for run in printed["executions"]
    )
    return LatencyReport(
        tuple(dict.fromkeys(run.backend for run in executions)),
        printed["problems"],
        printed["decided"],
        tuple(printed["admitting"]),
        executions,
        printed["complete"],
        printed["limit"],
        printed["seed"],
        printed["jobs"],
    )


def latencies(report: LatencyReport, differences: Sequence[str], date: str) -> str:
    """The part about the executive's latency [PIKE, Figure 20b]; `differences` are those between decisions."""
    intro = (
        "One simulated execution of each random plan that admits a correct one [PIKE, Figure 20b], measured on "
        f"{date} by `robust bench figure20b`. `smt` compiles nothing: each question goes to the semantic oracle's "
        "formula, and its preparation is to state that formula and to find one correct execution. The others compile "
        "a knowledge base. Humans choose what remains correct, activities end while that leaves a correct execution."
    )
    same = (
        f"Decisions that differ between back ends: {len(differences)}."
        if differences
        else "All back ends made the same decisions at the same times."
    )
    return "\n\n".join(
        [
            "## Latency of the executive",
            fill(intro, 120),
            fill(same, 120),
            "\n".join(f"- {note}" for note in latency_notes(report)),
            table(EXECUTED_HEADINGS, (executed_cells(report, each) for each in report.backends)),
            table(STEP_HEADINGS, (step_cells(report, each) for each in report.backends)),
        ]
    )


def k_intents(report: KIntentsReport, date: str) -> str:
    """The part about guessing intents [PIKE, Figures 17 and 18]."""
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
    explained = fill(_expected(report), 120)
    return "\n\n".join(
        [
            "## Guessing intents",
            fill(intro, 120),
            "\n".join(f"- {note}" for note in k_intents_notes(report)),
            table(REPLAN_HEADINGS, replan_cells(report)),
            f"- Re-plans, problem by problem: {fit_text(report.fit)}.\n"
            f"- Means of each number of choices: {fit_text(report.fit_of_means)}.",
            fill("Mean times to completion, in units of the plan; computing in seconds:", 120),
            table(TIME_HEADINGS, time_cells(report)),
            fill(saved, 120),
            table(IMPROVEMENT_HEADINGS, improvement_cells(report)),
            explained,
        ]
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


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (headings, ["---"] * len(headings), *rows)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _part(part: str, printed: Sequence[dict[str, Any]], date: str) -> tuple[str, str]:
    """The file of a part, and its text."""
    match part:
        case "execution":
            return "5-execution.md", execution(printed, date)
        case "team-plans":
            return "1-team-plans.md", team_plans(team_report(printed[0]), date)
        case "k-intents":
            return "4-k-intents.md", k_intents(report_of(printed[0]), date)
        case _:
            return "3-latency.md", latencies(latency_report(printed[0]), printed[0]["differences"], date)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.parts", description=__doc__)
    parser.add_argument(
        "part",
        choices=["team-plans", "latency", "k-intents", "execution", "join"],
        help="join: put the parts into the page, no more",
    )
    parser.add_argument("files", type=Path, nargs="*", metavar="FILE.json", help="what the measurement printed")
    options = parser.parse_args(arguments)
    try:
        if options.part != "join":
            if not options.files or (len(options.files) > 1 and options.part != "execution"):
                several = " and more" if options.part == "execution" else ""
                parser.error(f"{options.part} needs FILE.json{several}")
            printed = [json.loads(path.read_text(encoding="utf-8")) for path in options.files]
            name, text = _part(options.part, printed, datetime.now(UTC).date().isoformat())
            (PARTS / name).write_text(text + "\n", encoding="utf-8")
        RESULTS.write_text(joined(RESULTS.read_text(encoding="utf-8")), encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{', '.join(map(str, options.files)) or RESULTS}: {error}")
    print(RESULTS)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
