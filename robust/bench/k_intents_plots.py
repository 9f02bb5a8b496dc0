"""PIKE and Kirk on the k-intents domain as figures. Imported only when one is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from robust.bench.plots import save

if TYPE_CHECKING:
    from robust.bench.k_intents import KIntentsReport

# Okabe and Ito.
_KIRK, _PIKE, _LINE = "#0072B2", "#D55E00", "#000000"


def plot_figure17(report: KIntentsReport, path: Path) -> None:
    """Re-plans over the number of intents, a dot for each problem, and their mean by the number of human choices."""
    figure = Figure(figsize=(6.5, 4.4), layout="constrained")
    axes = figure.subplots()
    runs = report.compared
    axes.plot(
        [run.intents for run in runs],
        [run.kirk.replans for run in runs],
        ".",
        color=_KIRK,
        alpha=0.25,
        markersize=5,
        label="Kirk",
    )
    intents = sorted({run.intents for run in runs})
    expected = {run.intents: float(run.wrong_guesses) for run in runs}
    axes.plot(intents, [expected[each] for each in intents], "-", color=_LINE, linewidth=0.8, label="Kirk, expected")
    ends = [intents[0], intents[-1]]
    most = max(run.pike.replans for run in runs)
    axes.plot(ends, [most, most], ":", color=_PIKE, linewidth=2, label="PIKE, most")
    axes.set(xscale="log", xlabel="number of intents k", ylabel="re-plans")
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="upper left")
    save(figure, path)


def plot_figure18(report: KIntentsReport, path: Path) -> None:
    """PIKE's time to completion over Kirk's, shaded by the number of intents; the line is where they are the same."""
    figure = Figure(figsize=(5.8, 4.6), layout="constrained")
    axes = figure.subplots()
    runs = report.compared
    dots = axes.scatter(
        [float(run.kirk.time) for run in runs],
        [float(run.pike.time) for run in runs],
        c=[run.intents for run in runs],
        norm=LogNorm(),
        s=6,
        cmap="viridis",
    )
    ends = [0.0, max(float(run.kirk.time) for run in runs)]
    axes.plot(ends, ends, color=_LINE, linewidth=0.6, linestyle=":", label="as long")
    figure.colorbar(dots, ax=axes, label="number of intents k")
    axes.set(xlabel="Kirk: time to completion", ylabel="PIKE: time to completion")
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="upper left")
    save(figure, path)
