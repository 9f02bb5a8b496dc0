"""The comparisons of methods, back ends and encodings as figures. Imported only when one is asked for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter, PercentFormatter

from robust.bench.plots import save, seconds_tick

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from robust.bench.figure3 import Curve, Figure3Report
    from robust.bench.figure5 import Figure5Report, Schedule
    from robust.bench.growth import GrowthReport, Ladder

_SHORTEST = 0.005
"""A time of 0 was rounded, and has no place on a logarithmic axis."""

# Okabe and Ito; ours are solid, the recorded ones dashed or dotted.
_STYLES: dict[str, tuple[str, str, str]] = {
    "irr": ("#0072B2", "-", "o"),
    "irr-first": ("#0072B2", ":", "."),
    "widen": ("#D55E00", "-", "s"),
    "optimal": ("#CC79A7", "-", "D"),
    "project": ("#009E73", "-", "^"),
    "z3": ("#882255", "-", "v"),
    "cvc5": ("#56B4E9", "-", "<"),
    "fourier-motzkin": ("#7F3C00", "-", ">"),
    "loos-weispfenning": ("#E69F00", "-", "P"),
    "relational": ("#0072B2", "-", "o"),
    "positions": ("#D55E00", "-", "s"),
    "recorded-irr": ("#000000", "--", "o"),
    "recorded-irr-first": ("#000000", ":", "."),
    "recorded-ccmmz": ("#7F7F7F", "--", "x"),
}
_OTHER = ("#7F7F7F", "-", "o")


def plot_figure3(report: Figure3Report, path: Path) -> None:
    """One panel for each domain: the time of each instance solved, in ascending order for each method [IRR Fig. 3]."""
    domains = report.domains
    figure = Figure(figsize=(max(5.5, 4.2 * len(domains)), 5.6), layout="constrained")
    panels = figure.subplots(1, len(domains), sharey=True, squeeze=False)[0]
    for axes, domain in zip(panels, domains, strict=True):
        for curve in report.curves(domain):
            _plot_curve(axes, curve)
        count = len(report.rows_of(domain))
        _scale_times(axes)
        axes.set_xlim(0.5, count + 0.5)
        axes.set_title(f"{domain}: {count}", fontsize=9, loc="left")
        axes.set_xlabel("instances solved")
        axes.grid(color="0.92")
    panels[0].set_ylabel("time for each (ours and recorded: different machines)")
    _add_legend(figure, panels)
    save(figure, path)


def _scale_times(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(seconds_tick))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _add_legend(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend below all panels, with every label once."""
    legends = [axes.get_legend_handles_labels() for axes in panels]
    handles = {label: handle for found in legends for handle, label in zip(*found, strict=True)}
    if handles:
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=3, fontsize=8)


def _plot_curve(axes: Axes, curve: Curve) -> None:
    if not curve.times:
        return
    colour, style, marker = _STYLES.get(curve.name, _OTHER)
    times = [max(time, _SHORTEST) for time in curve.times]
    numbers = range(1, len(times) + 1)
    axes.plot(
        numbers, times, color=colour, linestyle=style, marker=marker, markersize=3.5, linewidth=1.2, label=curve.label
    )


def plot_figure5(report: Figure5Report, path: Path) -> None:
    """One panel for each schedule: the convergence of every run after each step, the poorest and the best."""
    figure = Figure(figsize=(5.2 * len(report.schedules), 4), layout="constrained")
    panels = figure.subplots(1, len(report.schedules), sharey=True, squeeze=False)[0]
    for axes, schedule in zip(panels, report.schedules, strict=True):
        _plot_schedule(axes, report, schedule)
    panels[0].set_ylabel("convergence")
    panels[0].yaxis.set_major_formatter(PercentFormatter(1.0))
    if panels[0].get_legend_handles_labels()[0]:
        panels[0].legend(loc="lower right", fontsize=8, framealpha=1)
    save(figure, path)


def _plot_schedule(axes: Axes, report: Figure5Report, schedule: Schedule) -> None:
    rows = report.rows_of(schedule)
    axes.set_title(f"{schedule.label}, {len(rows)} runs", fontsize=9, loc="left")
    axes.set_xlabel("steps")
    axes.grid(color="0.92")
    axes.set_axisbelow(True)
    if not rows:
        return
    dots = [dot for row in rows for dot in row.run.convergence]
    axes.plot(*zip(*dots, strict=True), ".", color="#D55E00", markersize=2.5, label="a run after a step")
    steps = range(1, max(row.steps for row in rows) + 1)
    summary = report.summary(schedule, steps)
    axes.plot(steps, [one.poorest for one in summary], color="#7B2D8B", linewidth=1.4, label="poorest")
    axes.plot(steps, [one.best for one in summary], color="black", linestyle="--", linewidth=1.2, label="best")
    axes.set_ylim(-0.02, 1.04)


def plot_growth(report: GrowthReport, path: Path) -> None:
    """One panel for each series: seconds over size for each alternative, and where it ran out of time."""
    figure = Figure(figsize=(max(5.5, 4.4 * len(report.ladders)), 4.2), layout="constrained")
    panels = figure.subplots(1, len(report.ladders), sharey=True, squeeze=False)[0]
    for axes, ladder in zip(panels, report.ladders, strict=True):
        _plot_ladder(axes, report, ladder)
    panels[0].set_ylabel("time")
    _add_legend(figure, panels)
    save(figure, path)


def _plot_ladder(axes: Axes, report: GrowthReport, ladder: Ladder) -> None:
    for contender in report.contenders:
        colour, style, marker = _STYLES.get(contender.name, _OTHER)
        done = [(row.size, row.run.seconds) for row in report.rows_of(ladder, contender) if row.run and row.done]
        late = [(row.size, row.run.seconds) for row in report.rows_of(ladder, contender) if row.run and not row.done]
        if done:
            sizes, times = zip(*done, strict=True)
            axes.plot(sizes, times, color=colour, linestyle=style, marker=marker, markersize=4, label=contender.name)
        for size, seconds in late:
            axes.plot([size], [seconds], marker="x", color=colour, markersize=7, linestyle="none", clip_on=False)
    _scale_times(axes)
    axes.set_xlabel(f"{ladder.axis} (×: stopped)")
    axes.set_title(fill(ladder.title, 52), fontsize=8, loc="left")
    axes.grid(color="0.92")
