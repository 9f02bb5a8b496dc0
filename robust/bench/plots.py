"""The reports as figures. Imported only when one is asked for: matplotlib is slow to import."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from robust.bench.run import Outcome
from robust.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from robust.bench.recorded import RecordedReport
    from robust.bench.scaling import ScalingReport, Series

# Distinguishable also without colour vision (Okabe and Ito).
OURS = "#0072B2"
IRR = "#E69F00"
CCMMZ = "#009E73"


@dataclass(frozen=True, slots=True)
class _Line:
    label: str
    colour: str
    style: str
    times: list[float]


def plot_recorded(report: RecordedReport, path: Path) -> None:
    """How many instances are solved within which time: ours, recorded IRR, recorded CCMMZ."""
    figure = Figure(figsize=(8, 4.8), layout="constrained")
    axes = figure.add_subplot()
    ours = [row.ours for row in report.rows]
    irr = [run for row in report.rows if (run := row.instance.irr) is not None]
    ccmmz = [run for row in report.rows if (run := row.instance.ccmmz) is not None]
    first = _times(run.first_widening_wall_s for run in ours)
    lines = [
        _Line("robust, first widening", OURS, "--", first),
        _Line("robust, complete", OURS, "-", _times(run.seconds for run in ours if run.outcome is Outcome.COMPLETE)),
        _Line("IRR (recorded), first widening", IRR, "--", _times(run.first_widening_s for run in irr)),
        _Line("IRR (recorded), complete", IRR, "-", _times(run.wall_s for run in irr if run.solved)),
        _Line("CCMMZ (recorded)", CCMMZ, "-", _times(run.wall_s for run in ccmmz if run.solved)),
    ]
    longest = max([line.times[-1] for line in lines if line.times], default=1.0) * 1.6
    for line in lines:
        _solved_over_time(axes, line, longest)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(seconds_tick))
    axes.set_xlim(right=longest)
    axes.set_ylim(0, report.instances * 1.04)
    axes.axhline(report.instances, color="0.75", linewidth=0.8, zorder=0)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("time limit per instance")
    axes.set_ylabel(f"instances solved, of {report.instances}")
    axes.set_title(
        "Instances solved within a time limit (ours and recorded: different machines)", fontsize=10, loc="left"
    )
    axes.grid(which="major", color="0.92")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", fontsize=8, framealpha=1)
    save(figure, path)


def plot_scaling(report: ScalingReport, path: Path) -> None:
    """Seconds over the size of the instance, one panel for each series."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    panels = figure.subplots(1, len(report.series), sharey=True, squeeze=False)[0]
    for axes, series in zip(panels, report.series, strict=True):
        _plot_series(axes, report, series)
    panels[0].set_ylim(0, 1.1 * max(row.ours.seconds for row in report.rows))
    panels[0].set_ylabel("seconds")
    panels[0].legend(loc="upper left", fontsize=8, framealpha=1)
    save(figure, path)


def _plot_series(axes: Axes, report: ScalingReport, series: Series) -> None:
    rows = report.rows_of(series)
    done = [row for row in rows if row.ours.outcome is Outcome.COMPLETE]
    late = [row for row in rows if row.ours.outcome is Outcome.TIMEOUT]
    sizes = [series.size(row) for row in done]
    axes.plot(sizes, [row.ours.seconds for row in done], "o-", color=OURS, label="whole process")
    searches = [row.ours.search_s if row.ours.search_s is not None else float("nan") for row in done]
    axes.plot(sizes, searches, "s--", color=OURS, markerfacecolor="white", label="search only")
    if late:
        seconds = [row.ours.seconds for row in late]
        axes.plot([series.size(row) for row in late], seconds, "x", color="#D55E00", label="out of time", clip_on=False)
    for row in done:
        place = (series.size(row), row.ours.seconds)
        axes.annotate(f"{row.ours.checks}", place, xytext=(0, 6), textcoords="offset points", ha="center", fontsize=7)
    axes.set_title(f"{series.title}\n(numbers: containment checks)", fontsize=9, loc="left")
    axes.set_xlabel(series.axis)
    axes.set_xticks([series.size(point) for point in series.points])
    axes.grid(color="0.92")
    axes.set_axisbelow(True)


def _times(values: Iterable[float | None]) -> list[float]:
    """The known times in ascending order; a time of 0 was rounded, and has no place on a logarithmic axis."""
    return sorted(max(value, 0.005) for value in values if value is not None)


def _solved_over_time(axes: Axes, line: _Line, end: float) -> None:
    if not line.times:
        return
    total = len(line.times)
    times, counts = [line.times[0], *line.times, end], [0, *range(1, total + 1), total]
    label = f"{line.label}: {total}"
    axes.step(times, counts, where="post", label=label, color=line.colour, linestyle=line.style, linewidth=1.6)


def seconds_tick(value: float, _position: object = None) -> str:
    """A tick of a logarithmic axis of seconds."""
    return f"{value:g} s"


def save(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the suffix."""
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise InputError(f"cannot write the plot {str(path)!r}: {(error.strerror or str(error)).lower()}") from None
