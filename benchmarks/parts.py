"""Parts of `RESULTS.md` that are measured by runs of their own, from the JSON that these printed.

`python -m benchmarks.parts team-plans FILE.json` writes `parts/1-team-plans.md` from what `robust bench figure20a
--json` printed, and puts all parts at the end of `RESULTS.md`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from textwrap import fill
from typing import Any

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
                f"The semantic oracle's own share of its time, without start and reading: {inner[len(inner) // 2]:.2f} "
                f"s median, {inner[-1]:.2f} s at most.",
                120,
            )
        )
    blocks.append(_table(SOLVED_HEADINGS, (solved_cells(report, each) for each in report.contenders)))
    blocks += [
        "Mean seconds of each stage, of the runs that finished:",
        _table(STAGE_HEADINGS, (stage_cells(report, each) for each in report.contenders)),
    ]
    for contender in report.contenders:
        blocks += [f"{contender.name}, by candidate subplans:", _table(SIZE_HEADINGS, size_cells(report, contender))]
    blocks += [
        "Prime implicants and models, of plans that admit a correct execution. More implicants than models: "
        f"{above} of {len(compared)} plans.",
        _table(IMPLICANT_HEADINGS, implicant_cells(report)),
    ]
    return "\n\n".join(blocks)


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (headings, ["---"] * len(headings), *rows)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.parts", description=__doc__)
    parser.add_argument("part", choices=["team-plans", "join"], help="join: put the parts into the page, no more")
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE.json", help="what the measurement printed")
    options = parser.parse_args(arguments)
    try:
        if options.part == "team-plans":
            if options.file is None:
                parser.error("team-plans needs FILE.json")
            printed = json.loads(options.file.read_text(encoding="utf-8"))
            text = team_plans(team_report(printed), datetime.now(UTC).date().isoformat())
            (PARTS / "1-team-plans.md").write_text(text + "\n", encoding="utf-8")
        RESULTS.write_text(joined(RESULTS.read_text(encoding="utf-8")), encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{options.file or RESULTS}: {error}")
    print(RESULTS)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
