"""Compilation of plans with choices as figures. Imported only when one is asked for."""

from __future__ import annotations

from math import log10
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from robust.bench.plots import save
from robust.bench.team_tables import compact_runs

if TYPE_CHECKING:
    from robust.bench.team_plans import TeamReport

# Okabe and Ito.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")


def plot_figure20a(report: TeamReport, path: Path) -> None:
    """Seconds over candidate subplans, one panel for each back end; crosses at the limit ran out of time."""
    figure = Figure(figsize=(max(5.5, 3.2 * len(report.contenders)), 4.2), layout="constrained")
    panels = figure.subplots(1, len(report.contenders), sharex=True, sharey=True, squeeze=False)[0]
    for place, (axes, contender) in enumerate(zip(panels, report.contenders, strict=True)):
        runs = report.of(contender)
        for satisfiable, marker, label in ((True, "o", "admits one"), (False, ".", "admits none")):
            chosen = [run for run in runs if run.satisfiable is satisfiable]
            axes.plot(
                [report.subplans[run.instance] for run in chosen],
                [run.seconds for run in chosen],
                marker,
                color=_COLOURS[place % len(_COLOURS)],
                markerfacecolor="none" if satisfiable else None,
                markersize=5 if satisfiable else 3,
                label=label,
            )
        late = [run for run in runs if not run.solved]
        axes.plot([report.subplans[run.instance] for run in late], [report.limit] * len(late), "x", color="black")
        axes.axhline(report.limit, color="black", linewidth=0.6, linestyle=":")
        axes.set(xscale="log", yscale="log", title=f"{contender.name}: {len(runs) - len(late)} of {len(runs)}")
        axes.set_xlabel("candidate subplans")
        axes.grid(visible=True, linewidth=0.3)
    panels[0].set_ylabel("seconds from files to answer")
    panels[0].legend(title="correct execution", loc="upper left", fontsize="small")
    save(figure, path)


def plot_figure21(report: TeamReport, path: Path) -> None:
    """Prime implicants over models; the line is where they are as many."""
    figure = Figure(figsize=(5.5, 4.6), layout="constrained")
    axes = figure.subplots()
    runs = compact_runs(report)
    # Logarithms taken here, because the numbers may be larger than any float.
    models = [log10(run.models or 1) for run in runs]
    axes.plot(
        models, [log10(run.prime_implicants or 1) for run in runs], "o", color=_COLOURS[0], markerfacecolor="none"
    )
    if models:
        ends = [0.0, max(models)]
        axes.plot(ends, ends, color="black", linewidth=0.6, linestyle=":", label="as many implicants as models")
        axes.legend(loc="upper left")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"$10^{{{value:g}}}$"))
    axes.set(xlabel="models", ylabel="prime implicants")
    axes.grid(visible=True, linewidth=0.3)
    save(figure, path)
