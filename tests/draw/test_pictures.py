"""What every picture keeps: no text outside or over another, everything in a legend, and names in words."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from robust.api import compare, risk
from robust.draw import gantt, pictures, plane, tpnu
from robust.draw.gantt import Bar, Chart, Lane, Mark
from robust.draw.style import BOX_LINES, HATCHES, LIGHT, STRONG
from robust.irr.search import EnvelopeResult, Step
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.causal import augment
from robust.pike_bridge.distance_graph import StructuralPrecedence
from robust.plan.model import Parameter
from robust.qe.box import Box, Interval, Side
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.reading import load_plan
from robust.searching import Status
from robust.show.text import Words, named
from tests.cli.running import EXAMPLES, command, example
from tests.draw.pictures import DAY
from tests.qe.polyhedra import eq, le, lt, polygon, rectangle

LONG = "transport the very long-named container_number_17 from warehouse_north_west_2 to warehouse_south_east_4"


def texts_of(figure):
    """The texts that are seen, with where they are in pixels."""
    FigureCanvasAgg(figure).draw()
    renderer = figure.canvas.get_renderer()
    shown = [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip()]
    ticks = [label for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for label in axis.get_ticklabels()]
    # A tick outside of the axes has a label that is not drawn.
    drawn = {id(one) for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for tick in axis._update_ticks()
             for one in (tick.label1, tick.label2)}  # fmt: skip
    every = {id(one) for one in ticks} | {
        id(one) for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)
        for tick in (*axis.majorTicks, *axis.minorTicks) for one in (tick.label1, tick.label2)
    }  # fmt: skip
    return [
        (one.get_text(), one.get_window_extent(renderer)) for one in shown if id(one) not in every or id(one) in drawn
    ]


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
    for axes in figure.axes:
        for label in axes.get_legend_handles_labels()[1]:
            assert " ".join(label.split()) in said
    for text in needed:
        assert text in said


@pytest.mark.parametrize("place", [(0.97, 0.5), (0.1, 0.1)])
def test_what_cannot_be_read_is_noticed(place):
    figure = Figure()
    figure.text(0.1, 0.1, "one text")
    assert_readable(figure, "one text")
    figure.text(*place, "another text")
    with pytest.raises(AssertionError, match=r"is outside of|is over"):
        assert_readable(figure)


# -- boxes -------------------------------------------------------------------------------------------------------------


def found(intervals, nominal=1):
    parameters = tuple(Parameter(name, Fraction(nominal)) for name in intervals)
    box = Box(
        {name: Interval(*(None if end is None else Fraction(end) for end in ends)) for name, ends in intervals.items()}
    )
    steps = (Step(1, 0.1, next(iter(intervals)), Side.UPPER, Fraction(1), True, Box.nominal(parameters)),
             Step(2, 0.2, next(iter(intervals)), Side.UPPER, Fraction(1), True, box))  # fmt: skip
    return EnvelopeResult(
        Status.COMPLETE, "irr", "relational", "z3", Fraction(1), parameters, box, 2, 0, 0.2, 0.2, trace=steps
    )


@pytest.mark.parametrize(
    "intervals",
    [
        {"a": (0, 3)},
        {"a": (1, 1)},
        {"a": (None, None)},
        {"a": (None, 3), "b": (0, None)},
        {"a": (0, 3), "b": ("1/1000", 10**6)},
        {f"p{index}": (1 - index, 1 + 2 * index) for index in range(12)},
        {f"p{index}": (None if index % 3 else 0, 5 + index) for index in range(12)},
    ],
    ids=["one", "point", "unbounded", "half", "orders of magnitude", "twelve", "twelve, unbounded"],
)
@pytest.mark.parametrize("long", [False, True])
def test_boxes(intervals, long):
    words = {name: f"{LONG} ({name})" if long else f"move {name}" for name in intervals}
    result = found(intervals)
    figure = pictures._figure(result, pictures._rows(result, words))
    ends = [end for pair in intervals.values() for end in pair]
    needed = [f"{text} = 1" for text in words.values()]
    assert_readable(figure, "nominal value", *needed, *(["no end on this side"] if None in ends else []))


# -- regions -----------------------------------------------------------------------------------------------------------

PLANE = ("x", "y")
BOX = Box({"x": Interval(Fraction(2), Fraction(4)), "y": Interval(Fraction(5), Fraction(6))})
OPEN = Box({"x": Interval(None, Fraction(4)), "y": Interval(Fraction(5), None)})
POINT = Box({"x": Interval(Fraction(3), Fraction(3)), "y": Interval(Fraction(5), Fraction(5))})
NOMINAL = {"nominal values": {"x": Fraction(3), "y": Fraction(5)}}


@pytest.mark.parametrize(
    "region",
    [
        Region.union_of(PLANE, [rectangle(0, 10, 0, 10)]),
        Region.union_of(PLANE, [rectangle(0, 10, 0, 10).restricted([lt(10, x=1, y=1)])]),
        Region.difference(rectangle(0, 10, 0, 10), [polygon(eq(7, y=1)), rectangle(1, 2, 1, 2)]),
        Region.nothing(PLANE),
        Region.universe(PLANE),
        Region.union_of(PLANE, [polygon(eq(1, x=1), eq(2, y=1))]),
        Region.union_of(PLANE, [polygon(le("1/1000000", x=1), le(0, x=-1))]),
        Region.union_of(["x"], [Polyhedron(("x",), (le(3, x=1),))]),
        Region.nothing(["x"]),
    ],
)
@pytest.mark.parametrize("long", [False, True])
def test_regions(region, long):
    boxes = {"IRR": BOX, "widening": OPEN, "optimal": POINT, "optimal around the nominal values": POINT}
    words = {name: f"{LONG} for {name}" if long else f"move {name}" for name in region.parameters}
    figure = plane.draw_region(region, region.parameters, boxes=boxes, points=NOMINAL, words=words)
    same = "box: optimal around the nominal values (the same as optimal)"
    assert_readable(figure, "Values for which the plan is valid", same, *words.values())


def test_an_empty_region_says_so():
    nothing = plane.draw_region(Region.nothing(PLANE), PLANE, boxes={"IRR": BOX})
    assert_readable(nothing, "none of them in this view")
    something = plane.draw_region(Region.universe(PLANE), PLANE, boxes={"IRR": BOX})
    assert not any("none of them" in text for text, _ in texts_of(something))


def test_fixed_parameters_are_named_with_their_values():
    names = tuple(f"p{index}" for index in range(12))
    region = Region.universe(names)
    words = {name: f"move container_{name} from here to there" for name in names}
    at = {name: Fraction(index, 3) for index, name in enumerate(names[2:])}
    figure = plane.draw_region(region, names[:2], at=at, words=words)
    assert_readable(figure, "move container_p3 from here to there = 1/3", "move container_p11 from here to there = 3")


def test_boxes_are_told_apart_without_colours():
    looks = [(one["linewidth"], one.get("dashes")) for one in BOX_LINES]
    assert len(set(looks)) == len(BOX_LINES)
    # Each is narrower than those that it is drawn over.
    assert sorted(looks, key=lambda look: -look[0]) == looks
    assert len(set(HATCHES)) == len(HATCHES) >= len(LIGHT)
    assert len(set(STRONG)) == len(STRONG)


def test_what_is_outside_of_a_difference_has_no_edge():
    """The corner of the base that is cut away is not drawn, as nothing of the region is near."""
    region = Region.difference(rectangle(0, 10, 0, 10), [polygon(le(-5, x=-1), le(-5, y=-1))])
    figure = plane.draw_region(region, PLANE)
    strokes = [line.get_xydata().tolist() for line in figure.axes[0].get_lines() if len(line.get_xydata()) == 2]
    assert not any(min(x + y for x, y in stroke) > 15 + 1e-9 for stroke in strokes)
    assert not any([10.0, 10.0] in stroke for stroke in strokes)


def test_a_slice_says_which_boxes_do_not_hold_its_values():
    solid = Region.universe(("x", "y", "z"))
    boxes = {"in": Box({**BOX.intervals, "z": Interval(Fraction(0), Fraction(1))}),
             "out": Box({**BOX.intervals, "z": Interval(Fraction(2), Fraction(3))})}  # fmt: skip
    figure = plane.draw_region(solid, PLANE, at={"z": Fraction(1)}, boxes=boxes)
    said = [text for text, _ in texts_of(figure)]
    assert "box: in" in said
    assert "box: out (not in this slice)" in said
    strokes = [line for line in figure.axes[0].get_lines() if line.get_label().startswith("box: out")]
    assert [len(line.get_xydata()) for line in strokes] == [0]


# -- of plans ----------------------------------------------------------------------------------------------------------


def test_names_are_words_of_actions():
    plan = load_plan(*example(directory=EXAMPLES / "delivery"))
    words = Words(plan).parameters
    assert words["dur_n3"] == "prepare_step1 robot1 spindle1_1 base_station"
    assert named("dur_n3", words) == "prepare_step1 robot1 spindle1_1 base_station (dur_n3)"
    assert named("x", None) == "x"


def test_probabilities():
    plan = load_plan(*example())
    both = risk(plan, ["to_ridge=normal::5", "to_crater=normal::5"], within="0.01")
    assert_readable(
        pictures._risk_figure(both), "take-sample scout crater needs (lit crater) all the time", "not valid"
    )
    one = risk(plan, ["to_ridge=normal::5", "to_crater=constant:40"], within="0.01")
    assert_readable(pictures._risk_figure(one), "fixed: drive scout ridge crater = 40")


def test_a_comparison_of_a_plan(tmp_path):
    plan = load_plan(*example())
    plane.plot_comparison(compare(plan), tmp_path / "plan.svg", ())
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert ">drive scout base ridge (to_ridge)</text>" in text


# -- executions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("label", ["move", LONG])
def test_charts(label):
    bars = [
        Bar(lane, Fraction(at), Fraction(at + 3), f"{label} {at}", f"kind {at}") for at in range(9) for lane in "ab"
    ]
    marks = [Mark(Fraction(at), where, f"{label} {at}", f"mark {at}") for at in range(3) for where in ("a", None)]
    chart = Chart(f"{label}: succeeded", (Lane("a"), Lane("b", LONG)), tuple(bars), tuple(marks))
    assert_readable(gantt._ChartDrawing(chart).figure(), "kind 8", "mark 2")


# -- plans with choices ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_plans_with_their_links(name):
    plan = load_team_plan(EXAMPLES / name / f"{name}.tpnu.json")
    links = augment(plan, StructuralPrecedence(plan.network, epsilon=plan.separation)).links
    arrows = [tpnu.DrawnLink(one.producer.event, one.consumer.first, str(one.consumer.literal)) for one in links]
    drawing = tpnu._NetworkDrawing(plan.network, plan.separation, arrows)
    figure = drawing.figure()
    assert_readable(figure, "causal link", "choice of others", *{one.label for one in arrows})
    # No wire is behind a node: they stay between the columns.
    spans = {}
    for node, (x, _) in drawing._layout.places.items():
        half = drawing._sizes[node][0] / 2
        low, high = spans.get(x, (x, x))
        spans[x] = (min(low, x - half), max(high, x + half))
    wiring = drawing._wiring
    for across in (*wiring.rises.values(), *wiring.falls.values()):
        assert not any(low <= across <= high for low, high in spans.values())
    assert len(set(wiring.rises.values()) | set(wiring.falls.values())) == len(wiring.rises) + len(wiring.falls)
    # And everything is within the axes.
    axes = figure.axes[0]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    for line in axes.get_lines():
        for place in line.get_transform().transform(line.get_xydata()):
            x, y = axes.transData.inverted().transform(place)
            assert left <= x <= right
            assert bottom <= y <= top


def test_choices_by_parameters(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(plane, "save", lambda draw, _path: figures.append(draw()))
    kitchen = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
    specifications = ("coffee=duration:make-coffee", "limit=at-most:e1:e44", "cup=duration:(get human mug)")
    asked = [kitchen, *(f"--parameter={text}" for text in specifications), "-q"]
    region = command("pike", "region", *asked, "--axes", "coffee,limit", "--plot", tmp_path / "a.svg")
    envelope = command("pike", "envelope", *asked, "--for-all", "xA1", "--plot", tmp_path / "b.svg")
    assert (region.code, envelope.code) == (0, 0)
    assert_readable(figures[0], "fixed: cup = 0.5", "no correct execution found", "nominal values")
    assert_readable(figures[1], "box", "nominal values")


def test_an_execution_shows_what_is_left_of_each_parameter(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(gantt, "draw_chart", lambda chart, _path: drawn.append(chart))
    (tmp_path / "world.toml").write_text(DAY, encoding="utf-8")
    asked = ("execute", *example(), "--world", tmp_path / "world.toml", "--plot", tmp_path / "a.svg")
    for executor in ("slice:60", "blex:1"):
        command(*asked, "--executor", executor)
    left, blind = drawn
    assert [(lane.name, lane.label) for lane in left.lanes] == [
        ("scout", ""), ("parameter to_ridge", "to_ridge"), ("parameter to_crater", "to_crater")
    ]  # fmt: skip
    promised = [(bar.lane, bar.start, bar.end, bar.label) for bar in left.bars if bar.kind.startswith("values")]
    assert promised == [
        ("parameter to_ridge", 0, 22, "[25, 36]"),
        ("parameter to_crater", 0, 22, "[35, 46]"),
        ("parameter to_crater", 22, 83, "[38, 53]"),
    ]
    assert [(mark.time, mark.lane, mark.label) for mark in left.marks] == [
        (22, "parameter to_ridge", "22, outside"), (83, "parameter to_crater", "49")
    ]  # fmt: skip
    assert not [bar for bar in blind.bars if bar.kind.startswith("values")]
    assert_readable(gantt._ChartDrawing(left).figure(), "values with which the plan succeeds", "observed", "to_crater")
