"""Gantt charts of executions as SVG, PNG or PDF: which agent did what when, and what happened meanwhile.

A chart is pure data. Within a lane, bars and marks are packed into as few rows as leave every label readable: what
overlaps, labels included, goes to another row. Executions of plans, and of plans with choices, become such charts.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from math import ceil, inf
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from robust.draw import style
from robust.draw.style import DARK_GREY, HATCHES, LIGHT, STRONG, cut
from robust.errors import InputError
from robust.execute import dispatchable, replan, worlds
from robust.network.differences import delayed
from robust.numbers import format_number, plural, readable
from robust.pike_bridge.model import Constraint, Guard
from robust.pike_bridge.online import progress, world
from robust.plan.model import ActionInstance

_SHAPES: Final = ("D", "o", "^", "s", "v", "P", "X")

_WIDTH = 11.0
_ROW = 0.3
"""Inches of the figure, and of one row of bars."""
_LETTER = 0.063
"""Inches of a letter of a label, roughly, and of the space around it."""
_SMALLEST = 0.04
"""Inches that a bar is drawn wide at least: actions of ε must not vanish."""
_PARAMETERS = 12
"""Parameters that a chart has lanes for; it has none if there are more."""
_WAITING: Final[Mapping[str, Any]] = {"color": style.GREY, "linewidth": 1.2, "linestyle": ":"}
_LATEST: Final[Mapping[str, Any]] = {
    "color": DARK_GREY, "linewidth": 0.9, "marker": "|", "markersize": 7, "markevery": [-1]
}  # fmt: skip
_BEGINNING, _CHOICES = Fraction(0), "choices"
"""When executions begin, and the lane of choices."""
_PROMISES = {
    dispatchable.Guarantee.DYNAMIC: "values with which the plan succeeds",
    dispatchable.Guarantee.WEAK: "values with which the plan may succeed",
}


@dataclass(frozen=True, slots=True)
class Lane:
    """A horizontal lane, such as an agent; bars and marks refer to it by its name, `label` is what is written."""

    name: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class Bar:
    """Something that lasts from `start` to `end` in a lane; None if it had not ended when the chart does.

    Bars of one `kind` have one colour, which the legend explains. A dotted line leads to the bar from `since`, as long
    as its lane waited for it, and a line with an end from the bar to the `latest` moment at which it may have ended.
    """

    lane: str
    start: Fraction
    end: Fraction | None
    label: str
    kind: str
    since: Fraction | None = None
    latest: Fraction | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happens at a moment: in a lane, or (None) to all of them, drawn as a line through the chart."""

    time: Fraction
    lane: str | None
    label: str
    kind: str


@dataclass(frozen=True, slots=True)
class Chart:
    """Lanes from top to bottom, what is in them, what the axis of time is called, and where it begins at the latest."""

    title: str
    lanes: tuple[Lane, ...]
    bars: tuple[Bar, ...]
    marks: tuple[Mark, ...] = ()
    axis: str = "time"
    begins: Fraction | None = None

    @property
    def things(self) -> tuple[Bar | Mark, ...]:
        """All that is in lanes, or in all of them."""
        return (*self.bars, *self.marks)


def draw_chart(chart: Chart, path: str | os.PathLike[str] | None) -> Figure:
    """Draw a chart; the suffix of the file names the format, without one the figure is only returned.

    Raises:
        InputError: if a bar or mark is in no lane, ends before it starts, or the file cannot be written.
    """
    known = {lane.name for lane in chart.lanes}
    for thing in chart.things:
        if thing.lane is not None and thing.lane not in known:
            raise InputError(f"found {thing.label!r} in lane {thing.lane!r}, expected one of the chart's lanes")
    for bar in chart.bars:
        if bar.end is not None and bar.end < bar.start:
            raise InputError(f"found bar {bar.label!r} from {bar.start} to {bar.end}, expected an end after its start")
    return style.save(_ChartDrawing(chart).figure, path)


@dataclass(frozen=True, slots=True)
class _Placed:
    """A bar or mark with its row, counted over all lanes; `outside` if its label is written to the right of it."""

    item: Bar | Mark
    row: int
    outside: bool


class _ChartDrawing:
    def __init__(self, chart: Chart) -> None:
        self._chart = chart
        self._bar_kinds, self._mark_kinds = _numbered(chart.bars), _numbered(chart.marks)
        times = [float(mark.time) for mark in chart.marks]
        times += [float(bar.start) for bar in chart.bars]
        times += [float(time) for bar in chart.bars for time in (bar.end, bar.since, bar.latest) if time is not None]
        times += [] if chart.begins is None else [float(chart.begins)]
        self._first, self._last = min(times, default=0.0), max(times, default=1.0)
        self._margin = 0.35 + _LETTER * max((len(cut(lane.label or lane.name)) for lane in chart.lanes), default=0)
        self._room = _WIDTH - self._margin - 0.2
        self._inches = self._scale()
        self._rows: dict[str, tuple[int, int]] = {}
        self._placed: list[_Placed] = []
        self._header = self._pack_header()
        self._pack_lanes()

    # -- places ------------------------------------------------------------------------------------------------------

    def _scale(self) -> float:
        """Inches of a unit of time: as many as leave room for the labels beside what comes last."""
        scale, before = self._room / ((self._last - self._first) or 1.0), inf
        while scale < before:  # bars that are shorter hold fewer labels
            before = scale
            in_lanes = (thing for thing in self._chart.things if thing.lane is not None)
            scale = min([before, *(self._fits(thing, before) for thing in in_lanes)])
        return scale

    def _fits(self, thing: Bar | Mark, scale: float) -> float:
        """The scale at which a thing fits with its label, which is beside it if it is not inside it at this scale."""
        if isinstance(thing, Mark):
            last = float(thing.time)
        else:
            end = self._last if thing.end is None else float(thing.end)
            if not thing.label or _width(thing.label) <= (end - float(thing.start)) * scale:
                return inf
            last = end if thing.latest is None else max(end, float(thing.latest))
        return (self._room - _width(thing.label) - 0.1) / (last - self._first) if last > self._first else inf

    def _at(self, time: Fraction | float) -> float:
        """Inches from the left end of the axis."""
        return (float(time) - self._first) * self._inches

    def _ends(self, bar: Bar) -> tuple[float, float]:
        left = self._at(bar.start)
        return left, max(self._at(self._last if bar.end is None else bar.end), left + _SMALLEST)

    def _reach(self, bar: Bar) -> tuple[float, float]:
        """From where to where a bar with its lines reaches."""
        left, right = self._ends(bar)
        first = left if bar.since is None else min(left, self._at(bar.since))
        return first, right if bar.latest is None else max(right, self._at(bar.latest) + _SMALLEST)

    def _pack_header(self) -> list[tuple[Mark, int]]:
        """Marks without a lane and the line of the header that each label is on."""
        rows: list[style.Spans] = []
        places = []
        for mark in sorted((mark for mark in self._chart.marks if mark.lane is None), key=lambda mark: mark.time):
            left = self._left_of_header(mark)
            places.append((mark, style.free_row(rows, left, left + self._width_in_header(mark))))
        self._header_rows = len(rows)
        return places

    def _left_of_header(self, mark: Mark) -> float:
        return max(0.0, min(self._at(mark.time), self._room - self._width_in_header(mark)))

    def _in_header(self, mark: Mark) -> str:
        """A label of the header, which may be as long as the chart is wide."""
        return cut(mark.label, int(self._room / _LETTER) - 2)

    def _width_in_header(self, mark: Mark) -> float:
        return _LETTER * (len(self._in_header(mark)) + 1)

    def _pack_lanes(self) -> None:
        top = 0
        for lane in self._chart.lanes:
            rows: list[style.Spans] = []
            items = [thing for thing in self._chart.things if thing.lane == lane.name]
            for item in sorted(items, key=_in_order):
                left, right, outside = self._extent(item)
                self._placed.append(_Placed(item, top + style.free_row(rows, left, right), outside))
            self._rows[lane.name] = (top, max(1, len(rows)))
            top += max(1, len(rows))
        self._count = top

    def _extent(self, item: Bar | Mark) -> tuple[float, float, bool]:
        """From where to where an item with its label reaches, in inches, and whether the label is outside."""
        if isinstance(item, Mark):
            left = self._at(item.time)
            return left, left + _SMALLEST + _width(item.label), True
        left, right = self._ends(item)
        outside = bool(item.label) and _width(item.label) > right - left
        first, last = self._reach(item)
        return first, last + _width(item.label) * outside, outside

    # -- drawing -----------------------------------------------------------------------------------------------------

    def figure(self) -> Figure:
        title = style.wrapped(self._chart.title, 130)
        header = 0.3 + 0.17 * (title.count("\n") + 1) + 0.2 * self._header_rows
        body = _ROW * self._count + 0.15 * len(self._chart.lanes)
        entries = len(self._bar_kinds) + len(self._mark_kinds) + 2  # and lines
        footer = 0.65 + 0.2 * ceil(entries / self._legend_columns)
        height = header + body + footer
        figure = Figure(figsize=(_WIDTH, height))
        place = (self._margin / _WIDTH, footer / height, self._room / _WIDTH, body / height)
        axes = figure.add_axes(place)
        self._draw_lanes(axes)
        for placed in self._placed:
            if isinstance(placed.item, Bar):
                self._draw_bar(axes, placed.item, placed)
            else:
                self._draw_mark(axes, placed.item, placed)
        self._draw_header(axes)
        self._finish(axes)
        self._legend(figure)
        figure.text(0.012, 1 - 0.12 / height, title, fontsize=10, ha="left", va="top")
        return figure

    def _top(self, row: int) -> float:
        """Where a row begins, in inches from the top; there is a gap before each lane."""
        lanes = sum(1 for first, _ in self._rows.values() if first <= row)
        return _ROW * row + 0.15 * (lanes - 0.5)

    def _draw_lanes(self, axes: Axes) -> None:
        axes.set_xlim(0, self._room)
        axes.set_ylim(self._top(self._count - 1) + _ROW + 0.075, 0)
        places, names = [], []
        for index, lane in enumerate(self._chart.lanes):
            first, count = self._rows[lane.name]
            top, bottom = self._top(first) - 0.075, self._top(first + count - 1) + _ROW + 0.075
            if index % 2 == 0:
                axes.axhspan(top, bottom, color="0.965", linewidth=0, zorder=0)
            places.append((top + bottom) / 2)
            names.append(cut(lane.label or lane.name))
        axes.set_yticks(places, names)

    def _draw_bar(self, axes: Axes, bar: Bar, placed: _Placed) -> None:
        left, right = self._ends(bar)
        middle = self._top(placed.row) + _ROW / 2
        kind = self._bar_kinds[bar.kind]
        dashes = "--" if bar.end is None else "-"
        axes.barh(middle, right - left, _ROW * 0.78, left, linestyle=dashes, zorder=2, **_bar_look(kind))
        first, last = self._reach(bar)
        if first < left:
            axes.plot([first, left], [middle, middle], zorder=1.5, **_WAITING)
        if bar.latest is not None and last > right:
            axes.plot([right, self._at(bar.latest)], [middle, middle], zorder=1.5, **_LATEST)
        place = last + 0.04 if placed.outside else (left + right) / 2
        side = "left" if placed.outside else "center"
        ground = {"facecolor": LIGHT[kind % len(LIGHT)], "edgecolor": "none", "pad": 0.8}
        behind = None if placed.outside or kind % len(HATCHES) == 0 else ground
        axes.text(place, middle, cut(bar.label), ha=side, va="center_baseline", fontsize=8, bbox=behind, zorder=4)

    def _draw_mark(self, axes: Axes, mark: Mark, placed: _Placed) -> None:
        kind = self._mark_kinds[mark.kind]
        middle, left = self._top(placed.row) + _ROW / 2, self._at(mark.time)
        look: dict[str, Any] = {"marker": _SHAPES[kind % len(_SHAPES)], "color": STRONG[kind % len(STRONG)]}
        axes.plot(left, middle, markersize=5, markeredgecolor="white", clip_on=False, zorder=5, **look)
        axes.text(left + 0.07, middle, cut(mark.label), va="center_baseline", fontsize=7.5, color="0.2", zorder=4)

    def _draw_header(self, axes: Axes) -> None:
        for mark, row in self._header:
            colour = STRONG[self._mark_kinds[mark.kind] % len(STRONG)]
            axes.axvline(self._at(mark.time), color=colour, linewidth=1, linestyle=(0, (4, 2)), zorder=3)
            place = (self._left_of_header(mark), -0.05 - 0.2 * row)
            axes.text(*place, self._in_header(mark), ha="left", va="bottom", fontsize=7.5, color=colour, clip_on=False)

    def _finish(self, axes: Axes) -> None:
        reach = self._first + self._room / self._inches
        ticks = [tick for tick in MaxNLocator(9).tick_values(self._first, reach) if self._first <= tick <= reach]
        axes.set_xticks([self._at(tick) for tick in ticks], [f"{tick:g}" for tick in ticks])
        axes.set_xlabel(self._chart.axis, fontsize=8.5)
        style.without_frame(axes, ("top", "right", "left"))
        axes.grid(axis="x", color=style.GRID, linewidth=0.7, zorder=1)
        axes.tick_params(labelsize=8.5)
        axes.tick_params(axis="y", length=0)

    def _legend(self, figure: Figure) -> None:
        in_lanes = {mark.kind for mark in self._chart.marks if mark.lane is not None}
        handles: list[Artist] = [Patch(label=kind, **_bar_look(number)) for kind, number in self._bar_kinds.items()]
        for kind, number in self._mark_kinds.items():
            look: dict[str, Any] = {"color": STRONG[number % len(STRONG)], "linewidth": 1, "markersize": 5}
            if kind in in_lanes:
                look |= {"marker": _SHAPES[number % len(_SHAPES)], "linestyle": ""}
            handles.append(Line2D([], [], label=kind, **{"linestyle": "--", **look}))
        if any(bar.since is not None for bar in self._chart.bars):
            handles.append(Line2D([], [], label="waiting", **_WAITING))
        if any(bar.latest is not None for bar in self._chart.bars):
            handles.append(Line2D([], [], label="latest end", **_LATEST))
        figure.legend(handles=handles, loc="lower left", ncols=self._legend_columns, fontsize=7.5, frameon=False)

    @property
    def _legend_columns(self) -> int:
        """How many entries are sure to fit beside one another."""
        widest = max((_LETTER * len(text) for text in (*self._bar_kinds, *self._mark_kinds)), default=0.0)
        return max(1, int((_WIDTH - 0.3) / (widest + 0.65)))


def _in_order(item: Bar | Mark) -> tuple[bool, Fraction]:
    """Bars before marks, each by time."""
    return (True, item.time) if isinstance(item, Mark) else (False, item.start)


def _numbered(items: Iterable[Bar | Mark]) -> Mapping[str, int]:
    """The kinds in order of appearance."""
    return {kind: number for number, kind in enumerate(dict.fromkeys(item.kind for item in items))}


def _bar_look(kind: int) -> dict[str, Any]:
    """How bars of a kind are drawn."""
    face, hatch = LIGHT[kind % len(LIGHT)], HATCHES[kind % len(HATCHES)]
    return {"facecolor": face, "edgecolor": DARK_GREY, "linewidth": 0.7, "hatch": hatch}


def _width(label: str) -> float:
    return _LETTER * (len(cut(label)) + 1)


# -- executions of plans -----------------------------------------------------------------------------------------------


def plot_run(run: replan.ReplanningRun, executor: str, path: Path) -> None:
    """Draw an execution: a lane for each first argument of an action, which is the agent in most domains; below them
    one for each parameter, with the values in which the plan succeeds and those that were observed.
    """
    executed = [execution for segment in run.segments for execution in segment.executed]
    names = dict.fromkeys(parameter.name for segment in run.segments for parameter in segment.plan.parameters)
    shown = names if len(names) <= _PARAMETERS else ()
    lanes = [Lane(name) for name in dict.fromkeys(_lane(execution.instance) for execution in executed)]
    lanes += [Lane(_parameter_lane(name), name) for name in shown]
    kinds = {worlds.InstanceOutcome.DONE: "action", worlds.InstanceOutcome.RUNNING: "running"}
    bars = [
        Bar(
            _lane(execution.instance),
            execution.start,
            execution.end,
            f"{execution.instance.action} {' '.join(execution.instance.arguments[1:])}".strip(),
            kinds.get(execution.outcome, execution.outcome.value),
        )
        for execution in executed
    ]
    marks = [*_marks(run)]
    for segment in run.segments:
        for name in (parameter.name for parameter in segment.plan.parameters if parameter.name in shown):
            bars += _promises(segment, name)
            marks += _observed(segment, name)
    title = f"Execution: {run.status.value} with {plural(run.replans, 're-plan')} ({executor}, seed {run.seed})"
    draw_chart(Chart(title, tuple(lanes), tuple(bars), tuple(marks)), path)


def _lane(instance: ActionInstance) -> str:
    return instance.arguments[0] if instance.arguments else instance.action


def _parameter_lane(name: str) -> str:
    """Not the name of an object."""
    return f"parameter {name}"


def _promises(segment: replan.Segment, name: str) -> Iterator[Bar]:
    """Within which values the plan goes on, from one observation to the next, until the value itself is known."""
    changes = [(segment.start, segment.box, segment.guarantee)]
    changes += [(change.time, change.box, segment.promised) for change in segment.remainders if change.box is not None]
    seen = min((known.time for known in segment.observations if known.what == name), default=segment.end)
    held = [(time, box[name], _PROMISES[worth]) for time, box, worth in changes if time < seen and worth in _PROMISES]
    kept = [next(same) for _, same in groupby(held, key=itemgetter(1, 2))]
    for (time, interval, worth), until in zip(kept, [*(time for time, *_ in kept[1:]), seen], strict=False):
        yield Bar(_parameter_lane(name), time, until, interval.written(format_number), worth)


def _observed(segment: replan.Segment, name: str) -> Iterator[Mark]:
    for observation in segment.observations:
        if observation.what == name:
            outside = "" if observation.inside else ", outside"
            yield Mark(observation.time, _parameter_lane(name), f"{readable(observation.value)}{outside}", "observed")


def _marks(run: replan.ReplanningRun) -> Iterator[Mark]:
    for number, segment in enumerate(run.segments, start=1):
        if number > 1:
            yield Mark(segment.start, None, f"plan {number}", "next plan")
        if segment.given_up is not None:
            yield Mark(segment.given_up, None, str(segment.ending), "given up")


# -- executions of plans with choices ----------------------------------------------------------------------------------


def plot_team_run(record: world.ExecutionRecord, path: Path | None) -> Figure:
    """Draw which agent did what when, and when it had to; with choices, inferences, deadlines and violations."""
    bars: list[Bar] = []
    bounds, deadlines = _kept(record)
    marks = [
        Mark(moment, None, f"{event} by {format_number(moment)}", "deadline")
        for event, moment in _limits(record, deadlines, record.time).items()
    ]
    idle: dict[str, Fraction] = {}
    over = _ends(record)
    for step in record.steps:
        for decision in step.decisions:
            match decision:
                case progress.Dispatched(action, agent, time, end, _, upper):
                    lane, ends = agent or "no agent", (*over.get(end, ()), *over.get(action, ()))
                    until = min((each for each in ends if each >= time), default=None)
                    moments = _latest_moments(_limits(record, bounds, time), bounds)
                    limits = moments.get(end), None if upper is None else time + upper
                    latest = min((limit for limit in limits if limit is not None), default=None)
                    bars.append(
                        Bar(lane, time, until, action, f"activity of {lane}", idle.get(lane, _BEGINNING), latest)
                    )
                    idle[lane] = max(idle.get(lane, _BEGINNING), time if until is None else until)
                case progress.Chosen(choice, value, time, observed):
                    kind = "observed choice" if observed else "choice of the executive"
                    marks.append(Mark(time, _CHOICES, f"{choice} = {value}", kind))
                case progress.Excluded(_, time, lost, _, _):
                    marks.append(Mark(time, _CHOICES, f"not {' or '.join(lost)}", "exclusion"))
                case progress.Violated(atom, _, _, _, time):
                    marks.append(Mark(time, None, f"{atom} broken", "violation"))
                case progress.Failed(time, _):
                    marks.append(Mark(time, None, "failed", "failure"))
                case _:
                    pass  # events and messages are in the timeline
        for choice, values in step.inferred.items():
            if len(values) == 1:
                marks.append(Mark(step.time, _CHOICES, f"{choice} must be {values[0]}", "inference"))
    names = {bar.lane for bar in bars} | {mark.lane for mark in marks if mark.lane is not None}
    lanes = [Lane(name) for name in sorted(names, key=lambda name: (name == _CHOICES, name))]
    title = f"{record.plan.name}: {record.ending.value}"
    return draw_chart(Chart(title, tuple(lanes), tuple(bars), tuple(marks), begins=_BEGINNING), path)


def _ends(record: world.ExecutionRecord) -> dict[str, list[Fraction]]:
    """When events were executed, and actions cancelled; Kirk executes an event again if it was undone."""
    ends: dict[str, list[Fraction]] = {}
    for step in record.steps:
        for decision in step.decisions:
            match decision:
                case progress.Executed(event, time):
                    ends.setdefault(event, []).append(time)
                case progress.Cancel(action, _, time):
                    ends.setdefault(action, []).append(time)
                case _:
                    pass
    return ends


def _kept(record: world.ExecutionRecord) -> tuple[list[Constraint], list[Constraint]]:
    """Bounds between events that were to be executed by what was chosen: all, and those but durations."""
    network = record.plan.network

    def holds(guard: Guard) -> bool:
        return all(record.choices.get(variable) == value for variable, value in guard)

    activated = {event for event, guard in network.guards.items() if holds(guard)}
    all_bounds, others = (
        [each for each in bounds if {each.source, each.target} <= activated and holds(each.guard)]
        for bounds in (network.temporal_constraints, network.constraints)
    )
    return all_bounds, others


def _limits(record: world.ExecutionRecord, bounds: Iterable[Constraint], now: Fraction) -> dict[str, Fraction]:
    """The last moments of events that are limited from those on that had been executed by now."""
    latest: dict[str, Fraction] = {}
    for bound in bounds:
        since = record.schedule.get(bound.source)
        if bound.upper is not None and since is not None and since <= now:
            latest[bound.target] = min(since + bound.upper, latest.get(bound.target, since + bound.upper))
    return latest


def _latest_moments(limits: Mapping[str, Fraction], bounds: Iterable[Constraint]) -> Mapping[str, Fraction]:
    """Until when events have to happen, so that limits are kept if all that follows takes its least time."""
    least = [(each.target, each.source, each.lower) for each in bounds if each.lower is not None and each.lower >= 0]
    backwards = delayed({event: -limit for event, limit in limits.items()}, least)
    return {**limits, **{event: -time for event, time in backwards.items() if time <= 0}}
