"""The latency of executives as a figure. Imported only when one is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from robust.bench.figure20b import REACTIVE
from robust.bench.plots import save

if TYPE_CHECKING:
    from robust.bench.figure20b import LatencyReport

# Okabe and Ito.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")


def plot_figure20b(report: LatencyReport, path: Path) -> None:
    """The share of executions over the seconds of their slowest step, one line for each back end."""
    figure = Figure(figsize=(5.5, 4.2), layout="constrained")
    axes = figure.subplots()
    for place, backend in enumerate(report.backends):
        runs = report.of(backend)
        slowest = sorted(run.slowest for run in runs if run.slowest is not None)
        shares = [(at + 1) / len(runs) for at in range(len(slowest))]
        axes.step(slowest, shares, where="post", color=_COLOURS[place % len(_COLOURS)], label=backend)
    axes.axvline(REACTIVE, color="black", linewidth=0.6, linestyle=":")
    axes.set(xscale="log", xlabel="seconds of the slowest step", ylabel="share of executions", ylim=(0, 1.02))
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="lower right")
    save(figure, path)
