"""The scaling experiment in the delivery domain as a figure. Imported only when one is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from robust.bench.plots import save, seconds_tick
from robust.bench.run import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from robust.bench.figure4 import Figure4Report
    from robust.bench.figure4_instances import Origin

# Okabe and Ito.
_STYLES = {
    "irr": ("#0072B2", "o"),
    "widen": ("#D55E00", "s"),
    "optimal": ("#CC79A7", "D"),
    "project": ("#009E73", "^"),
    "z3": ("#882255", "v"),
    "cvc5": ("#56B4E9", "<"),
    "fourier-motzkin": ("#7F3C00", ">"),
    "loos-weispfenning": ("#E69F00", "P"),
}
_OTHER = ("#7F7F7F", "o")


def plot_figure4(report: Figure4Report, path: Path) -> None:
    """One panel for the recorded plans and one for ours: the time of every run over the number of parameters."""
    origins = report.origins
    figure = Figure(figsize=(5.2 * len(origins), 5), layout="constrained")
    panels = figure.subplots(1, len(origins), sharey=True, squeeze=False)[0]
    for axes, origin in zip(panels, origins, strict=True):
        _plot_origin(axes, report, origin)
    panels[0].set_ylabel("time")
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    save(figure, path)


def _plot_origin(axes: Axes, report: Figure4Report, origin: Origin) -> None:
    rows = sorted(report.rows_of(origin), key=lambda row: row.instance.parameters)
    for contender in report.contenders:
        colour, marker = _STYLES.get(contender.name, _OTHER)
        done = [(row.instance.parameters, time) for row in rows if (time := row.seconds(contender.name)) is not None]
        late = [
            (row.instance.parameters, float(row.runs[contender.name]["seconds"]))
            for row in rows
            if row.outcome(contender.name) is Outcome.TIMEOUT
        ]
        label = f"{contender.label}: {len(done)} of {len(rows)}" if len(report.origins) == 1 else contender.label
        axes.plot([], [], marker=marker, color=colour, linestyle="none", markersize=5, label=label)
        if done:
            axes.plot(*zip(*done, strict=True), marker, color=colour, markersize=4, alpha=0.85)
        if late:
            axes.plot(*zip(*late, strict=True), "x", color=colour, markersize=6, clip_on=False)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(seconds_tick))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlabel("parameters (×: out of time)")
    axes.set_title(f"{origin.value} plans: {len(rows)}", fontsize=9, loc="left")
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
