"""Parts of `RESULTS.md` that are measured by runs of their own, from the JSON that these printed.

`python -m benchmarks.parts team-plans FILE.json` writes `parts/1-team-plans.md` from what `robust bench figure20a
--json` printed, and puts all parts at the end of `RESULTS.md`. With `latency`, the plans that admit a correct execution
there are executed, and `parts/3-latency.md` is written.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from textwrap import fill
from typing import Any

from robust.bench.latency import Latency, measure_latencies
from robust.bench.team_plans import CONTENDERS, FIGURE20A, TeamReport, TeamRun
from robust.bench.team_tables import (
    IMPLICANT_HEADINGS,
    SIZE_HEADINGS,
    SOLVED_HEADINGS,
    STAGE_HEADINGS,
    compact_runs,
    implicant_cells,
    notes,
    quantile,
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


def latencies(found: Sequence[Latency], date: str) -> str:
    """The part about the executive's latency [PIKE, Figure 20b]."""
    worst = sorted(max(each.steps) for each in found)
    ahead = sorted(max(each.wakes) for each in found)
    steps = sorted(seconds for each in found for seconds in each.steps)
    prepared = sorted(each.preparation for each in found)
    endings = {outcome: sum(each.outcome == outcome for each in found) for outcome in ("succeeded", "failed", "none")}
    intro = (
        "One simulated execution of each random plan that admits a correct one [PIKE, Figure 20b], measured on "
        f"{date} by `python -m benchmarks.parts latency FILE.json`: nothing is compiled, each question goes to the "
        "semantic oracle's formula. Humans choose what remains correct; activities take any time that leaves a correct "
        "execution when they begin. The paper: at most 0.5 s in 85.3 % of 75 executions, after compilation."
    )
    kinds = ", ".join(f"{count} {outcome}" for outcome, count in endings.items() if count)
    quick = sum(seconds < 0.1 for seconds in worst)
    summary = (
        f"{len(found)} executions: {kinds}; {len(steps)} steps. The slowest step of an execution stays under 0.1 s in "
        f"{quick} of {len(found)}. An execution fails where durations that nobody controls, each possible by itself, "
        "do not go together. Steps include what a second reasoner is told, which advises the simulated team."
    )
    rows = [
        ("preparation, each execution", *_spread(prepared)),
        ("slowest step of each execution", *_spread(worst)),
        ("all steps", *_spread(steps)),
        ("slowest search for the next time, of each execution", *_spread(ahead)),
    ]
    spread = table(("milliseconds", "median", "90 %", "greatest"), rows)
    return "\n\n".join(["## Latency of the executive", fill(intro, 120), fill(summary, 120), spread])


def _spread(seconds: Sequence[float]) -> tuple[str, str, str]:
    """Median, 90 % and greatest of ascending seconds, in milliseconds."""
    most = quantile(seconds, 0.9) or 0.0
    return f"{median(seconds) * 1000:.2f}", f"{most * 1000:.2f}", f"{seconds[-1] * 1000:.2f}"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (headings, ["---"] * len(headings), *rows)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _measured(report: TeamReport) -> list[Latency]:
    """Executions of all plans of the report that admit a correct one."""
    indices = [place for place, name in enumerate(report.activities) if report.verdict(name)]
    return measure_latencies(indices, seed=report.seed, on_result=_progress)


def _progress(latency: Latency) -> None:
    print(f"{latency.instance}: {latency.outcome}, {max(latency.steps):.3f} s at most", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.parts", description=__doc__)
    parser.add_argument(
        "part", choices=["team-plans", "latency", "join"], help="join: put the parts into the page, no more"
    )
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE.json", help="what the measurement printed")
    options = parser.parse_args(arguments)
    try:
        if options.part != "join":
            if options.file is None:
                parser.error(f"{options.part} needs FILE.json")
            report = team_report(json.loads(options.file.read_text(encoding="utf-8")))
            date = datetime.now(UTC).date().isoformat()
            if options.part == "team-plans":
                name, text = "1-team-plans.md", team_plans(report, date)
            else:
                name, text = "3-latency.md", latencies(_measured(report), date)
            (PARTS / name).write_text(text + "\n", encoding="utf-8")
        RESULTS.write_text(joined(RESULTS.read_text(encoding="utf-8")), encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{options.file or RESULTS}: {error}")
    print(RESULTS)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
