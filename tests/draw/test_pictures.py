"""Pictures of boxes, regions, plans with choices and executions: all is named, and every text can be read."""

import json
import re
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from random import Random
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from benchmarks.generators.team_plans import blocks
from robust import EnvelopeResult, InputError, Region, Status, Step, compare, load_plan, pike, risk
from robust.draw import gantt, layers, pictures, plane, style, tpnu
from robust.draw.gantt import Bar, Chart, Lane, Mark
from robust.irr.search import InnerBox
from robust.pike_bridge import action_model, causal, distance_graph
from robust.pike_bridge.builder import k_intents
from robust.pike_bridge.model import EPSILON, Choice, Constraint, Event, Tpnu
from robust.pike_bridge.online.world import Rehearsal
from robust.plan.model import Parameter
from robust.qe.box import Box, Interval, Side
from robust.qe.polyhedron import Polyhedron
from robust.show.text import Words, named
from tests.cli.running import EXAMPLES, command, example
from tests.draw.browser import browser, press, settle
from tests.draw.pictures import DAY
from tests.pike_bridge.plans import kitchen
from tests.qe.polyhedra import NAMES, cube, eq, le, lt, polygon, rectangle

LONG = "transport the very long-named container_number_17 from warehouse_north_west_2 to warehouse_south_east_4"
long_or_short = pytest.mark.parametrize("long", [False, True])


def texts_of(figure):
    """The texts that are seen, with where they are in pixels."""
    FigureCanvasAgg(figure).draw()
    renderer = figure.canvas.get_renderer()
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    every, drawn = set(), set()  # a tick outside of the axes has a label that is not drawn
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        every |= {id(label) for label in axis.get_ticklabels()}
        drawn |= {id(label) for tick in axis._update_ticks() for label in (tick.label1, tick.label2)}
        ticks = (*axis.majorTicks, *axis.minorTicks)
        every |= {id(label) for tick in ticks for label in (tick.label1, tick.label2)}
    seen = [text for text in shown if id(text) not in every or id(text) in drawn]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in seen]


def assert_readable(figure, *needed):
    """Every text is inside, none is over another, each labelled thing is in a legend, and there is a title."""
    texts = texts_of(figure)
    frame = figure.bbox
    for text, box in texts:
        inside = frame.x0 - 1 <= box.x0 and box.x1 <= frame.x1 + 1 and frame.y0 - 1 <= box.y0 and box.y1 <= frame.y1 + 1
        assert inside, f"{text!r} at {box} is outside of {frame}"
    for (text, box), (other, beside) in combinations(texts, 2):
        across = min(box.x1, beside.x1) - max(box.x0, beside.x0)
        up = min(box.y1, beside.y1) - max(box.y0, beside.y0)
        assert across <= 1.5 or up <= 1.5, f"{text!r} is over {other!r} by {across} and {up} pixels"
    said = " ".join(" ".join(text.split()) for text, _ in texts)
    labels = [" ".join(label.split()) for axes in figure.axes for label in axes.get_legend_handles_labels()[1]]
    assert [text for text in (*labels, *needed) if text not in said] == []


@pytest.mark.parametrize("place", [(0.97, 0.5), (0.1, 0.1)])
def test_what_cannot_be_read_is_noticed(place):
    figure = Figure()
    figure.text(0.1, 0.1, "one text")
    assert_readable(figure, "one text")
    figure.text(*place, "another text")
    with pytest.raises(AssertionError, match=r"is outside of|is over"):
        assert_readable(figure)


def envelope_of(intervals, status=Status.COMPLETE):
    """A result of (lower, upper) or (lower, upper, nominal value), which is 1 otherwise."""
    parameters = tuple(Parameter(name, Fraction(*ends[2:] or (1,))) for name, ends in intervals.items())
    ends = {name: [None if end is None else Fraction(end) for end in ends[:2]] for name, ends in intervals.items()}
    box = Box({name: Interval(*pair) for name, pair in ends.items()})
    boxes = (Box.nominal(parameters), box)
    trace = tuple(
        Step(at, at / 10, next(iter(intervals)), Side.UPPER, Fraction(1), True, boxes[at - 1]) for at in (1, 2)
    )
    return EnvelopeResult(status, "irr", "relational", "z3", Fraction(1), parameters, box, 2, 0, 0.2, 0.2, trace=trace)


@pytest.mark.parametrize(
    ("intervals", "needed"),
    [
        ({"a": (0, 3)}, ()),
        ({"a": (1, 1)}, ("no finite width",)),
        ({"a": (None, None)}, ("−∞", "∞")),
        ({"a": (None, 3), "b": (0, None)}, ()),
        ({"a": (0, 3), "b": ("1/1000", 10**6)}, ()),
        ({f"p{index}": (1 - index, 1 + 2 * index) for index in range(12)}, ()),
        ({f"p{index}": (None if index % 3 else 0, 5 + index) for index in range(12)}, ()),
    ],
    ids=["one", "point", "unbounded", "half", "orders of magnitude", "twelve", "twelve, unbounded"],
)
@long_or_short
def test_boxes(intervals, needed, long):
    words = {name: f"{LONG} ({name})" if long else f"move {name}" for name in intervals}
    result = envelope_of(intervals)
    figure = pictures._figure(result, pictures._rows(result, words))
    unbounded = ["no end on this side"] if None in [end for pair in intervals.values() for end in pair] else []
    assert_readable(figure, "nominal value", *(f"{text} = 1" for text in words.values()), *unbounded, *needed)


@pytest.mark.parametrize(
    ("intervals", "needed"),
    [
        (
            {"small": ("9/2", 6, 5), "huge": (2, 300000, 100000), "open_$a^b$": (0, None, 3)},
            ("small = 5", "4.5", "300000", "open_$a^b$ = 3", "∞", "best box so far", "of the bounded"),
        ),
        ({f"p{at}": (-at, 10**250 if at == 7 else at + 1, 0) for at in range(40)}, ("p39 = 0",)),
    ],
    ids=["labels", "many parameters and enormous numbers"],
)
def test_files_of_boxes(intervals, needed, tmp_path):
    pictures.plot_envelope(envelope_of(intervals, Status.TIMEOUT), tmp_path / "box.svg")
    text = (tmp_path / "box.svg").read_text(encoding="utf-8")
    assert [label for label in needed if label not in text] == []


def test_an_inner_box_is_called_so(tmp_path):
    result = replace(envelope_of({"rate": (0, 3)}), method="widen", beta=None, inner=InnerBox(("rate",), ()))
    pictures.plot_envelope(result, tmp_path / "box.svg")
    assert "this box (inner box; complete)" in (tmp_path / "box.svg").read_text(encoding="utf-8")


def test_no_plot_of_an_invalid_plan(tmp_path):
    assert command("envelope", *example("plan-flexible-wait.stn"), "--plot", tmp_path / "box.svg").code == 1
    assert not (tmp_path / "box.svg").exists()


PLANE = ("x", "y")
SQUARE = Region.union_of(PLANE, [rectangle(0, 10, 0, 10)])
BOX = Box({"x": Interval(Fraction(2), Fraction(4)), "y": Interval(Fraction(5), Fraction(6))})
HALF = Box({"x": Interval(Fraction(2), Fraction(4)), "y": Interval(Fraction(5), None)})
OPEN = Box({"x": Interval(None, Fraction(4)), "y": Interval(Fraction(5), None)})
POINT = Box({"x": Interval(Fraction(3), Fraction(3)), "y": Interval(Fraction(5), Fraction(5))})
NOMINAL = {"nominal values": {"x": Fraction(3), "y": Fraction(5)}}


def segment(*sides):
    return Region.union_of(["x"], [Polyhedron(("x",), sides)])


@pytest.mark.parametrize(
    "region",
    [
        SQUARE,
        Region.union_of(PLANE, [rectangle(0, 10, 0, 10).restricted([lt(10, x=1, y=1)])]),
        Region.difference(rectangle(0, 10, 0, 10), [polygon(eq(7, y=1)), rectangle(1, 2, 1, 2)]),
        Region.difference(rectangle(0, 1, 0, 1), [rectangle(0, 1, 0, 1)]),
        Region.nothing(PLANE),
        Region.universe(PLANE),
        Region.union_of(PLANE, [polygon(eq(1, x=1), eq(2, y=1))]),
        Region.union_of(PLANE, [polygon(eq(1, x=1, y=1))]),
        Region.union_of(PLANE, [polygon(le("1/1000000", x=1), le(0, x=-1))]),
        segment(le(3, x=1)),
        segment(eq(3, x=1)),
        Region.universe(["x"]),
        Region.nothing(["x"]),
    ],
)
@long_or_short
def test_regions(region, long):
    boxes = {"IRR": BOX, "widening": OPEN, "optimal": POINT, "optimal around the nominal values": POINT}
    words = {name: f"{LONG} for {name}" if long else f"move {name}" for name in region.parameters}
    figure = plane.draw_region(region, region.parameters, boxes=boxes, points=NOMINAL, words=words)
    same = "box: optimal around the nominal values (the same as optimal)"
    assert_readable(figure, "Values for which the plan is valid", same, *words.values())


def lines(figure, style="-", colour=style.EDGE):
    """The strokes of one style as pairs of ends."""
    return {
        tuple(sorted(map(tuple, line.get_xydata().tolist())))
        for line in figure.axes[0].get_lines()
        if (line.get_color(), line.get_linestyle(), len(line.get_xydata())) == (colour, style, 2)
    }


def test_edges():
    """No seams are drawn, strict sides are dashed, excluded slabs stay visible."""
    halves = plane.draw_region(Region.union_of(PLANE, [rectangle(0, 1, 0, 1), rectangle(1, 2, 0, 1)]), PLANE)
    assert ((1.0, 0.0), (1.0, 1.0)) not in lines(halves)
    assert {((0.0, 0.0), (0.0, 1.0)), ((2.0, 0.0), (2.0, 1.0))} <= lines(halves)
    assert len(halves.axes[0].patches) == 3  # two halves, and what is hatched behind them
    strict = plane.draw_region(Region.union_of(PLANE, [rectangle(0, 1, 0, 1).restricted([lt(1, x=1)])]), PLANE)
    assert (lines(strict, "--"), len(lines(strict))) == ({((1.0, 0.0), (1.0, 1.0))}, 3)
    thin = [polygon(eq(7, y=1)), polygon(le(3, x=1), le("-2999/1000", x=-1))]
    slabs = lines(plane.draw_region(Region.difference(rectangle(0, 10, 0, 10), thin), PLANE), colour=style.REMOVED)
    assert ((0.0, 7.0), (10.0, 7.0)) in slabs
    assert len(slabs) == 2


def test_what_is_outside_of_a_difference_has_no_edge():
    """The corner of the base that is cut away is not drawn, as nothing of the region is near."""
    figure = plane.draw_region(Region.difference(rectangle(0, 10, 0, 10), [polygon(le(-5, x=-1), le(-5, y=-1))]), PLANE)
    strokes = [line.get_xydata().tolist() for line in figure.axes[0].get_lines() if len(line.get_xydata()) == 2]
    assert not any(min(x + y for x, y in stroke) > 15 + 1e-9 or [10.0, 10.0] in stroke for stroke in strokes)


def test_unbounded_regions_are_clipped_around_the_overlays():
    half = Region.union_of(PLANE, [polygon(le(0, x=-1))])
    figure = plane.draw_region(
        half, PLANE, boxes={"box": HALF}, points={"nominal": {"x": Fraction(3), "y": Fraction(6)}}
    )
    assert figure.axes[0].get_xlim() == pytest.approx((-0.32, 4.32))
    assert figure.axes[0].get_ylim() == pytest.approx((4.92, 6.08))
    legend = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert legend == ["valid", "edge that belongs to it", "box: box", "not valid", "nominal"]


def test_formats_and_reproducible_files(tmp_path):
    for suffix, magic in ((".svg", b"<?xml"), (".png", b"\x89PNG"), (".pdf", b"%PDF")):
        for name in "ab":
            style.save(lambda: plane.draw_region(SQUARE, PLANE, boxes={"box": HALF}), tmp_path / f"{name}{suffix}")
        first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in "ab")
        assert first.startswith(magic)
        assert first == second


def test_slices_and_projections():
    solid = Region.union_of(NAMES, [cube(2).restricted([le(3, x=1, y=1, z=1)])])
    sliced = plane.draw_region(solid, ["z", "x"], at={"y": Fraction(2)})
    assert (sliced.axes[0].get_xlabel(), sliced.axes[0].get_ylabel()) == ("z", "x")
    assert ((0.0, 1.0), (1.0, 0.0)) in lines(sliced)
    assert ((1.0, 2.0), (2.0, 1.0)) in lines(plane.draw_region(solid, ["x", "y"]))
    bar = plane.draw_region(solid, ["x"], at={"y": Fraction(2), "z": Fraction(1, 2)})
    assert ((0.0, 0.0), (0.5, 0.0)) in lines(bar)


def test_bars_have_filled_and_hollow_ends():
    region = Region.union_of(["x"], [Polyhedron(("x",), (lt(1, x=1), le(0, x=-1))), Polyhedron(("x",), (eq(3, x=1),))])
    figure = plane.draw_region(region, ["x"], boxes={"box": HALF}, points={"nominal": {"x": Fraction(1, 2)}})
    dots = [line for line in figure.axes[0].get_lines() if (line.get_marker(), line.get_color()) == ("o", style.EDGE)]
    ends = {dot.get_xydata()[0][0]: dot.get_markerfacecolor() for dot in dots if len(dot.get_xydata())}
    assert ends == {0.0: style.EDGE, 1.0: "white", 3.0: style.EDGE}


def test_an_empty_region_says_so():
    nothing = plane.draw_region(Region.nothing(PLANE), PLANE, boxes={"IRR": BOX})
    assert_readable(nothing, "none of them in this view")
    something = plane.draw_region(Region.universe(PLANE), PLANE, boxes={"IRR": BOX})
    assert not any("none of them" in text for text, _ in texts_of(something))


def test_fixed_parameters_are_named_with_their_values():
    names = tuple(f"p{index}" for index in range(12))
    words = {name: f"move container_{name} from here to there" for name in names}
    at = {name: Fraction(index, 3) for index, name in enumerate(names[2:])}
    figure = plane.draw_region(Region.universe(names), names[:2], at=at, words=words)
    assert_readable(figure, "move container_p3 from here to there = 1/3", "move container_p11 from here to there = 3")


def test_boxes_are_told_apart_without_colours():
    looks = [(one["linewidth"], one.get("dashes")) for one in style.BOX_LINES]
    assert len(set(looks)) == len(style.BOX_LINES)
    # Each is narrower than those that it is drawn over.
    assert sorted(looks, key=lambda look: -look[0]) == looks
    assert len(set(style.HATCHES)) == len(style.HATCHES) >= len(style.LIGHT)
    assert len(set(style.STRONG)) == len(style.STRONG)


def test_a_slice_says_which_boxes_do_not_hold_its_values():
    boxes = {name: Box({**BOX.intervals, "z": Interval(Fraction(low), Fraction(low + 1))})
             for name, low in (("in", 0), ("out", 2))}  # fmt: skip
    figure = plane.draw_region(Region.universe(("x", "y", "z")), PLANE, at={"z": Fraction(1)}, boxes=boxes)
    assert {"box: in", "box: out (not in this slice)"} <= {text for text, _ in texts_of(figure)}
    strokes = [line for line in figure.axes[0].get_lines() if line.get_label().startswith("box: out")]
    assert [len(line.get_xydata()) for line in strokes] == [0]


def test_names_are_words_of_actions(tmp_path):
    words = Words(load_plan(*example(directory=EXAMPLES / "delivery"))).parameters
    assert words["dur_n3"] == "prepare_step1 robot1 spindle1_1 base_station"
    assert named("dur_n3", words) == "prepare_step1 robot1 spindle1_1 base_station (dur_n3)"
    assert named("x", None) == "x"
    plane.plot_comparison(compare(load_plan(*example())), tmp_path / "plan.svg", ())
    assert ">drive scout base ridge (to_ridge)</text>" in (tmp_path / "plan.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("crater", "needed"),
    [
        ("normal::5", ("take-sample scout crater needs (lit crater) all the time", "not valid")),
        ("constant:40", ("fixed: drive scout ridge crater = 40",)),
    ],
)
def test_probabilities(crater, needed):
    result = risk(load_plan(*example()), ["to_ridge=normal::5", f"to_crater={crater}"], within="0.01")
    assert_readable(pictures._risk_figure(result), *needed)


def test_probabilities_of_many_random_durations():
    workshop = [str(EXAMPLES / "workshop" / name) for name in ("domain.pddl", "problem.pddl", "plan.log")]
    plan = load_plan(*workshop, parameters=["duration:*"], deadline="+10%")
    figure = pictures._risk_figure(risk(plan, {"*": "truncated-normal::15%"}, within="0.05", draws=500))
    assert_readable(figure, "What is late", "paint bob table", "share of draws in which it is latest")
    assert figure.axes[0].patches


@pytest.mark.parametrize(("seed", "count"), [(0, 3), (1, 20), (2, 60)])
def test_nothing_overlaps_and_everything_is_drawn(seed, count, tmp_path):
    random = Random(seed)  # noqa: S311 - reproducible
    lanes = tuple(Lane(name) for name in ("ada", "bob", "human"))
    bars = []
    for number in range(count):
        start = Fraction(random.randint(0, 3000), 10)
        end = None if number == 0 else start + Fraction(random.randint(0, 400), 10)
        bars.append(Bar(random.choice(lanes).name, start, end, f"(move place-{number})", random.choice("abc")))
    marks = [Mark(Fraction(number * 40), random.choice(["ada", None]), f"seen {number}", "seen") for number in range(5)]
    chart = Chart("a chart", lanes, tuple(bars), tuple(marks))
    drawing = gantt._ChartDrawing(chart)
    rows = {}
    for placed in drawing._placed:
        left, right, _ = drawing._extent(placed.item)
        assert right <= drawing._room + 1e-6
        assert all(right <= other_left or other_right <= left for other_left, other_right in rows.get(placed.row, ()))
        rows.setdefault(placed.row, []).append((left, right))
    assert len(drawing._placed) == count + sum(1 for mark in marks if mark.lane)
    gantt.draw_chart(chart, tmp_path / "chart.svg")
    text = (tmp_path / "chart.svg").read_text(encoding="utf-8")
    assert all(item.label in text for item in (*bars, *marks))


@pytest.mark.parametrize("label", ["move", LONG])
def test_charts(label):
    bars = [
        Bar(lane, Fraction(at), Fraction(at + 3), f"{label} {at}", f"kind {at}") for at in range(9) for lane in "ab"
    ]
    marks = [Mark(Fraction(at), where, f"{label} {at}", f"mark {at}") for at in range(3) for where in ("a", None)]
    chart = Chart(f"{label}: succeeded", (Lane("a"), Lane("b", LONG)), tuple(bars), tuple(marks))
    assert_readable(gantt._ChartDrawing(chart).figure(), "kind 8", "mark 2")


def test_what_is_cancelled_ends_then(monkeypatch):
    """Kirk stops what was begun by mistake; everything else ends at the events of its schedule."""
    charts = []
    monkeypatch.setattr(gantt, "draw_chart", lambda chart, _path: charts.append(chart))
    record = pike.run(k_intents((2,)).instance, reasoner="kirk", outcome={"y1": "2"}, pace="random")
    gantt.plot_team_run(record, None)
    wrong, recovery, *right = charts[0].bars
    assert (wrong.label, recovery.label, [bar.label for bar in right]) == (
        "(h-1-1)",
        "(recover h-1-1)",
        ["(h-1-2)", "(r-1-2)"],
    )
    assert wrong.start == wrong.end == recovery.start
    assert recovery.end - recovery.start == record.recovered
    ends = {each.action: record.schedule.get(each.target) for each in record.plan.network.activities}
    assert [bar.end for bar in right] == [ends[bar.label] for bar in right]


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_runs_begin_at_0_and_show_what_waits_and_until_when(name, tmp_path):
    plan = action_model.load_team_plan(EXAMPLES / name / f"{name}.tpnu.json")
    record = Rehearsal(plan, seed=1, infer=False).run()
    figure = gantt.plot_team_run(record, tmp_path / "run.svg")
    agents = {activity.agent for activity in plan.network.activities}
    assert_readable(figure, "deadline", "waiting", "latest end", *(f"activity of {agent}" for agent in agents))
    axes = figure.axes[0]
    assert axes.get_xticklabels()[0].get_text() == "0"
    assert axes.get_xticks()[0] == 0
    colours = {patch.get_facecolor() for patch in axes.patches if patch.get_linewidth()}
    assert len(colours) == len(agents)


def test_latest_ends_keep_deadlines(monkeypatch):
    """An activity has to end so early that all that follows can take its least time, 0.001 between events included."""
    charts = []
    monkeypatch.setattr(gantt, "draw_chart", lambda chart, _path: charts.append(chart))
    record = pike.run(EXAMPLES / "kitchen" / "kitchen.tpnu.json", outcome={"xA1": "mug"}, seed=0)
    gantt.plot_team_run(record, None)
    latest = {bar.label: bar.latest for bar in charts[0].bars}
    assert all(bar.end <= bar.latest for bar in charts[0].bars)
    assert latest["(mix-cereal human)"] == Fraction("7.001") - Fraction("0.001")
    assert latest["(get human cereal)"] == latest["(mix-cereal human)"] - Fraction("0.5") - 4 * Fraction("0.001")
    assert latest["(get human mug)"] == record.schedule["e3"] + 2  # by its own duration


def test_empty_charts_are_drawn_and_impossible_ones_refused(tmp_path):
    lanes = (Lane("ada"),)
    gantt.draw_chart(Chart("nothing", lanes, ()), tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")
    for lane, start, message in (("bob", 0, "expected one of the chart's lanes"), ("ada", 2, "an end after its start")):
        with pytest.raises(InputError, match=message):
            gantt.draw_chart(Chart("", lanes, (Bar(lane, Fraction(start), Fraction(1), "x", "a"),)), tmp_path / "a.svg")


def test_an_execution_shows_what_is_left_of_each_parameter(tmp_path, monkeypatch):
    charts = []
    monkeypatch.setattr(gantt, "draw_chart", lambda chart, _path: charts.append(chart))
    (tmp_path / "world.toml").write_text(DAY, encoding="utf-8")
    for executor in ("slice:60", "blex:1"):
        world = ("--world", tmp_path / "world.toml", "--plot", tmp_path / "a.svg")
        command("execute", *example(), *world, "--executor", executor)
    left, blind = charts
    ridge, crater = "parameter to_ridge", "parameter to_crater"
    assert [(lane.name, lane.label) for lane in left.lanes] == [
        ("scout", ""), (ridge, "to_ridge"), (crater, "to_crater")]  # fmt: skip
    promised = [(bar.lane, bar.start, bar.end, bar.label) for bar in left.bars if bar.kind.startswith("values")]
    assert promised == [(ridge, 0, 22, "[25, 36]"), (crater, 0, 22, "[35, 46]"), (crater, 22, 83, "[38, 53]")]
    marks = [(mark.time, mark.lane, mark.label) for mark in left.marks]
    assert marks == [(22, ridge, "22, outside"), (83, crater, "49")]
    assert not [bar for bar in blind.bars if bar.kind.startswith("values")]
    assert_readable(gantt._ChartDrawing(left).figure(), "values with which the plan succeeds", "observed", "to_crater")


ONE = Choice("x", ("a",), False, "e")


@pytest.mark.parametrize(
    "network",
    [
        Tpnu("empty", (), (), (), ()),
        Tpnu("one", (ONE,), (Event("e"),), (Constraint("e", "e", None, None),), ()),
        Tpnu("cycle", (), (Event("a"), Event("b")), (Constraint("a", "b", 0, 1), Constraint("b", "a", 0, None)), ()),
    ],
)
def test_odd_networks(tmp_path, network):
    tpnu.plot_network(network, tmp_path / "plan.svg")
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert all(f">{event.name}</text>" in text for event in network.events)


def test_files_of_networks(tmp_path):
    path = tmp_path / "plan.SVG"
    tpnu.plot_network(kitchen(), path, links=[("e3", "e9", "$taken$"), ("e9", "e3", "backwards")])
    text = path.read_text(encoding="utf-8")
    names = ("get human mug", "pour robot glass", "[0.5, 2]", "xA2", "xA1 = mug", "e14", "$taken$", "backwards")
    assert [name for name in (*names, "robot", "human") if name not in text] == []
    assert "[0.001" not in text
    for file, links, message in (
        ("plan.nope", (), r"cannot write .*: format 'nope' is not supported"),
        ("missing/plan.png", (), r"cannot write .*: no such file or directory"),
        ("plan.png", [("e99", "e1", "p")], "causal link at event 'e99'"),
    ):
        with pytest.raises(InputError, match=message):
            tpnu.plot_network(kitchen(), tmp_path / file, links=links)


sizes = st.tuples(st.floats(0.1, 2), st.floats(0.1, 2))


@given(st.lists(sizes, min_size=1, max_size=9), st.data())
def test_layouts_do_not_overlap(sizes, data):
    nodes = dict(enumerate(sizes))
    edges = data.draw(st.lists(st.tuples(st.sampled_from(sorted(nodes)), st.sampled_from(sorted(nodes))), max_size=12))
    layout = layers.layered(nodes, edges, [0.5] * len(edges))
    assert set(layout.places) == set(nodes)
    for one, other in combinations(nodes, 2):
        (x, y), (x2, y2) = layout.places[one], layout.places[other]
        wide, high = (nodes[one][0] + nodes[other][0]) / 2, (nodes[one][1] + nodes[other][1]) / 2
        assert abs(x - x2) >= wide - 1e-9 or abs(y - y2) >= high - 1e-9
    for (source, target), route in zip(edges, layout.routes, strict=True):
        assert (route[0], route[-1]) == (layout.places[source], layout.places[target])
    if all(source < target for source, target in edges):
        assert all(layout.places[source][0] < layout.places[target][0] for source, target in edges)


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_plans_with_their_links(name):
    plan = action_model.load_team_plan(EXAMPLES / name / f"{name}.tpnu.json")
    links = causal.augment(plan, distance_graph.StructuralPrecedence(plan.network, epsilon=plan.separation)).links
    arrows = [tpnu.DrawnLink(one.producer.event, one.consumer.first, one.text) for one in links]
    assert any(" if " in arrow.label for arrow in arrows)
    drawing = tpnu._NetworkDrawing(plan.network, plan.separation, arrows)
    figure = drawing.figure()
    assert_readable(figure, "causal link", "choice of others", *{one.label for one in arrows})
    assert len(drawing.tiles) > 2
    for tile in drawing.tiles:
        # No wire is behind a node: they stay between the columns.
        spans = {}
        for node, (x, _) in tile.layout.places.items():
            half = tile.sizes[node][0] / 2
            low, high = spans.get(x, (x, x))
            spans[x] = (min(low, x - half), max(high, x + half))
        rises, falls = tile.wiring.rises.values(), tile.wiring.falls.values()
        assert not any(low <= across <= high for across in (*rises, *falls) for low, high in spans.values())
        assert len({*rises, *falls}) == len(rises) + len(falls)
    # And everything is within the axes of its piece.
    for axes in figure.axes:
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        for line in axes.get_lines():
            for place in line.get_transform().transform(line.get_xydata()):
                x, y = axes.transData.inverted().transform(place)
                assert left - 1e-9 <= x <= right + 1e-9
                assert bottom - 1e-9 <= y <= top + 1e-9


def test_a_large_plan_fits_a_page_in_tiles_that_fold(tmp_path):
    network = blocks(4).network
    drawing = tpnu._NetworkDrawing(network, EPSILON)
    figure = drawing.figure()
    assert figure.get_size_inches()[0] <= 11
    assert_readable(figure, *(activity.action.strip("()") for activity in network.activities), "to e144", "from e1")
    told = json.loads(re.findall(r"pieces = (\[.*\]);$", drawing.script(), re.MULTILINE)[0])
    assert any("choice of x1" in piece["folded"] for piece in told)
    tpnu.plot_network(network, tmp_path / "plan.svg")
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    ids = {group.get("id") for group in ElementTree.fromstring(text).iter()}  # noqa: S314 - our own
    assert {piece["name"] for piece in told} <= ids
    assert "http" not in text.split("<script>")[1].replace("http://www.w3.org/2000/svg", "")


@pytest.mark.parametrize(("width", "columns"), [(500, 1), (1600, 2)])
def test_tiles_follow_the_window_and_fold(width, columns, tmp_path):
    with browser(width=width) as window:
        tpnu.plot_network(blocks(3).network, tmp_path / "plan.svg")
        window.get((tmp_path / "plan.svg").as_uri())
        settle(window)
        right = "return document.documentElement.getBoundingClientRect().right"
        assert window.execute_script(right) <= max(width, 680) + 1  # one tile is as wide as that
        heights = "return [...document.querySelectorAll('text')].map(each => each.getBoundingClientRect().height)"
        assert min(each for each in window.execute_script(heights) if each) > 8
        lefts = "return [...document.querySelectorAll('.fold')].map(mark => mark.getBoundingClientRect().x)"
        assert max(map(round, window.execute_script(lefts))) // 500 == columns - 1
        high = "return document.documentElement.getBoundingClientRect().height"
        before = window.execute_script(high)
        window.execute_script("document.querySelector('.fold').focus()")
        press(window, " ")
        folded = "return [...document.querySelectorAll('.folded')].filter(box => box.style.display !== 'none').length"
        assert window.execute_script(folded) == 1
        assert window.execute_script(high) < before or columns > 1
        press(window, " ")
        assert (window.execute_script(folded), window.execute_script(high)) == (0, before)


def test_choices_by_parameters(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(plane, "save", lambda draw, _path: figures.append(draw()))
    specifications = ("coffee=duration:make-coffee", "limit=at-most:e1:e44", "cup=duration:(get human mug)")
    asked = [EXAMPLES / "kitchen" / "kitchen.tpnu.json", *(f"--parameter={text}" for text in specifications), "-q"]
    assert command("pike", "region", *asked, "--axes", "coffee,limit", "--plot", tmp_path / "a.svg").code == 0
    assert command("pike", "envelope", *asked, "--for-all", "xA1", "--plot", tmp_path / "b.svg").code == 0
    assert_readable(figures[0], "fixed: cup = 0.5", "no correct execution found", "nominal values")
    assert_readable(figures[1], "box", "nominal values")
