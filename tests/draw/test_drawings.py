"""Drawings of executions, plans with choices, boxes and regions: every name in them, nothing over another."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.draw.gantt import Bar, Chart, Lane, Mark, _ChartDrawing, draw_chart
from robust.draw.pictures import plot_envelope
from robust.draw.plane import draw_region
from robust.draw.style import EDGE, REMOVED, save
from robust.draw.tpnu import layered, plot_network
from robust.errors import InputError
from robust.irr.search import EnvelopeResult, Step
from robust.pike_bridge.model import Choice, Constraint, Event, Tpnu
from robust.plan.model import Parameter
from robust.qe.box import Box, Interval, Side
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import Status
from tests.cli.running import command, example
from tests.pike_bridge.kitchen import kitchen
from tests.qe.polyhedra import NAMES, cube, eq, le, lt, polygon, rectangle

# -- executions ------------------------------------------------------------------------------------------------------


def chart(seed, count):
    random = Random(seed)  # noqa: S311 - reproducible
    lanes = tuple(Lane(name) for name in ("ada", "bob", "human"))
    bars = []
    for number in range(count):
        start = Fraction(random.randint(0, 3000), 10)
        end = None if number == 0 else start + Fraction(random.randint(0, 400), 10)
        bars.append(Bar(random.choice(lanes).name, start, end, f"(move place-{number})", random.choice("abc")))
    marks = [Mark(Fraction(number * 40), random.choice(["ada", None]), f"seen {number}", "seen") for number in range(5)]
    return Chart("a chart", lanes, tuple(bars), tuple(marks))


@pytest.mark.parametrize(("seed", "count"), [(0, 3), (1, 20), (2, 60)])
def test_nothing_overlaps_and_everything_is_drawn(seed, count, tmp_path):
    drawn = chart(seed, count)
    drawing = _ChartDrawing(drawn)
    rows = {}
    for placed in drawing._placed:
        left, right, _ = drawing._extent(placed.item)
        assert right <= drawing._room + 1e-6
        for other_left, other_right in rows.setdefault(placed.row, []):
            assert right <= other_left or other_right <= left
        rows[placed.row].append((left, right))
    assert len(drawing._placed) == count + sum(1 for mark in drawn.marks if mark.lane)
    file = tmp_path / "chart.svg"
    draw_chart(drawn, file)
    text = file.read_text(encoding="utf-8")
    assert all(bar.label in text for bar in drawn.bars)
    assert all(mark.label in text for mark in drawn.marks)


def test_an_empty_chart_is_drawn(tmp_path):
    draw_chart(Chart("nothing", (Lane("ada"),), ()), tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")


def test_what_cannot_be_drawn_is_refused(tmp_path):
    lanes = (Lane("ada"),)
    with pytest.raises(InputError, match="expected one of the chart's lanes"):
        draw_chart(Chart("", lanes, (Bar("bob", Fraction(0), Fraction(1), "x", "a"),)), tmp_path / "chart.svg")
    with pytest.raises(InputError, match="expected an end after its start"):
        draw_chart(Chart("", lanes, (Bar("ada", Fraction(2), Fraction(1), "x", "a"),)), tmp_path / "chart.svg")


# -- plans with choices ----------------------------------------------------------------------------------------------


def test_everything_is_named(tmp_path):
    path = tmp_path / "plan.SVG"
    plot_network(kitchen(), path, links=[("e3", "e9", "$taken$"), ("e9", "e3", "backwards")])
    text = path.read_text(encoding="utf-8")
    names = [
        "get human mug",
        "pour robot glass",
        "[0.5, 2]",
        "xA2",
        "xA1 = mug",
        "e14",
        "$taken$",
        "backwards",
        "robot",
        "human",
    ]
    assert [name for name in names if name not in text] == []
    assert "[0.001" not in text


@pytest.mark.parametrize(
    "network",
    [
        Tpnu("empty", (), (), (), ()),
        Tpnu("one", (Choice("x", ("a",), False, "e"),), (Event("e"),), (Constraint("e", "e", None, None),), ()),
        Tpnu("cycle", (), (Event("a"), Event("b")), (Constraint("a", "b", 0, 1), Constraint("b", "a", 0, None)), ()),
    ],
)
def test_odd_networks(tmp_path, network):
    plot_network(network, tmp_path / "plan.svg")
    drawn = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert all(f">{event.name}</text>" in drawn for event in network.events)


def test_networks_that_cannot_be_drawn(tmp_path):
    with pytest.raises(InputError, match=r"cannot write .*: format 'nope' is not supported"):
        plot_network(kitchen(), tmp_path / "plan.nope")
    with pytest.raises(InputError, match=r"cannot write .*: no such file or directory"):
        plot_network(kitchen(), tmp_path / "missing" / "plan.png")
    with pytest.raises(InputError, match="causal link at event 'e99'"):
        plot_network(kitchen(), tmp_path / "plan.png", links=[("e99", "e1", "p")])


sizes = st.tuples(st.floats(0.1, 2), st.floats(0.1, 2))


@given(st.lists(sizes, min_size=1, max_size=9), st.data())
def test_layouts_do_not_overlap(sizes, data):
    nodes = dict(enumerate(sizes))
    edges = data.draw(st.lists(st.tuples(st.sampled_from(sorted(nodes)), st.sampled_from(sorted(nodes))), max_size=12))
    layout = layered(nodes, edges, [0.5] * len(edges))
    assert set(layout.places) == set(nodes)
    for one, other in combinations(nodes, 2):
        (x, y), (x2, y2) = layout.places[one], layout.places[other]
        wide, high = (nodes[one][0] + nodes[other][0]) / 2, (nodes[one][1] + nodes[other][1]) / 2
        assert abs(x - x2) >= wide - 1e-9 or abs(y - y2) >= high - 1e-9
    for (source, target), route in zip(edges, layout.routes, strict=True):
        assert (route[0], route[-1]) == (layout.places[source], layout.places[target])
    if all(source < target for source, target in edges):
        assert all(layout.places[source][0] < layout.places[target][0] for source, target in edges)


# -- boxes -----------------------------------------------------------------------------------------------------------


def drawn(path: Path, intervals: dict[str, tuple[Interval, int]], status: Status = Status.COMPLETE) -> str:
    parameters = tuple(Parameter(name, Fraction(nominal)) for name, (_, nominal) in intervals.items())
    box = Box({name: interval for name, (interval, _) in intervals.items()})
    nominal = Box.nominal(parameters)
    trace = tuple(
        Step(number, number / 10, next(iter(intervals), ""), Side.UPPER, Fraction(1), number > 1, one)
        for number, one in enumerate((nominal, box), start=1)
    )
    result = EnvelopeResult(
        status, "irr", "relational", "z3", Fraction(1), parameters, box, 2, 0, 0.2, 0.2, trace=trace
    )
    plot_envelope(result, path)
    return path.read_text(encoding="utf-8")


def test_labels(tmp_path):
    text = drawn(
        tmp_path / "box.svg",
        {
            "small": (Interval(Fraction(9, 2), Fraction(6)), 5),
            "huge": (Interval(Fraction(2), Fraction(300000)), 100000),
            "open_$a^b$": (Interval(Fraction(0), None), 3),
        },
        Status.TIMEOUT,
    )
    for label in ("small = 5", "4.5", "300000", "open_$a^b$ = 3", "∞", "best box so far", "of the bounded"):
        assert f"{label}" in text, label


def test_one_point(tmp_path):
    text = drawn(tmp_path / "box.svg", {"fixed": (Interval(Fraction(7), Fraction(7)), 7)})
    assert "no finite width" in text


def test_unbounded_to_both_sides(tmp_path):
    assert "−∞" in drawn(tmp_path / "box.svg", {"free": (Interval(None, None), 0)})


def test_many_parameters_and_enormous_numbers(tmp_path):
    huge = Fraction(10) ** 250
    many = {
        f"p{index}": (Interval(Fraction(-index), huge if index == 7 else Fraction(index + 1)), 0) for index in range(40)
    }
    assert "p39 = 0" in drawn(tmp_path / "box.svg", many)


def test_no_plot_of_an_invalid_plan(tmp_path):
    assert command("envelope", *example("plan-flexible-wait.stn"), "--plot", tmp_path / "box.svg").code == 1
    assert not (tmp_path / "box.svg").exists()


# -- regions ---------------------------------------------------------------------------------------------------------


PLANE = ("x", "y")
SQUARE = Region.union_of(PLANE, [rectangle(0, 10, 0, 10)])
BOX = Box({"x": Interval(Fraction(2), Fraction(4)), "y": Interval(Fraction(5), None)})


def lines(figure, style="-", colour=EDGE):
    """The strokes of one style as pairs of ends."""
    found = [line for line in figure.axes[0].get_lines() if line.get_color() == colour]
    return {
        tuple(sorted(map(tuple, line.get_xydata().tolist())))
        for line in found
        if line.get_linestyle() == style and len(line.get_xydata()) == 2
    }


def test_seams_are_not_drawn():
    halves = Region.union_of(PLANE, [rectangle(0, 1, 0, 1), rectangle(1, 2, 0, 1)])
    figure = draw_region(halves, PLANE)
    assert ((1.0, 0.0), (1.0, 1.0)) not in lines(figure)
    assert {((0.0, 0.0), (0.0, 1.0)), ((2.0, 0.0), (2.0, 1.0))} <= lines(figure)
    assert len(figure.axes[0].patches) == 3  # two halves, and what is hatched behind them


def test_strict_sides_are_dashed():
    figure = draw_region(Region.union_of(PLANE, [rectangle(0, 1, 0, 1).restricted([lt(1, x=1)])]), PLANE)
    assert lines(figure, "--") == {((1.0, 0.0), (1.0, 1.0))}
    assert len(lines(figure)) == 3


def test_excluded_slabs_stay_visible():
    thin = [polygon(eq(7, y=1)), polygon(le(3, x=1), le("-2999/1000", x=-1))]
    figure = draw_region(Region.difference(rectangle(0, 10, 0, 10), thin), PLANE)
    assert {((0.0, 7.0), (10.0, 7.0))} <= lines(figure, colour=REMOVED)
    assert len(lines(figure, colour=REMOVED)) == 2


def test_unbounded_regions_are_clipped_around_the_overlays():
    half = Region.union_of(PLANE, [polygon(le(0, x=-1))])
    figure = draw_region(half, PLANE, boxes={"box": BOX}, points={"nominal": {"x": Fraction(3), "y": Fraction(6)}})
    assert figure.axes[0].get_xlim() == pytest.approx((-0.32, 4.32))
    assert figure.axes[0].get_ylim() == pytest.approx((4.92, 6.08))
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "valid",
        "edge that belongs to it",
        "box: box",
        "not valid",
        "nominal",
    ]


@pytest.mark.parametrize(
    "region",
    [
        Region.nothing(PLANE),
        Region.universe(PLANE),
        Region.union_of(PLANE, [polygon(eq(1, x=1), eq(2, y=1))]),
        Region.union_of(PLANE, [polygon(eq(1, x=1, y=1))]),
        Region.nothing(["x"]),
        Region.universe(["x"]),
        Region.union_of(["x"], [Polyhedron(("x",), (eq(3, x=1),))]),
        Region.difference(rectangle(0, 1, 0, 1), [rectangle(0, 1, 0, 1)]),
    ],
)
def test_extreme_regions_are_drawn(region, tmp_path):
    save(lambda: draw_region(region, region.parameters), tmp_path / "region.svg")
    assert (tmp_path / "region.svg").read_text().startswith("<?xml")


def test_formats_and_reproducible_files(tmp_path):
    for suffix, magic in ((".svg", b"<?xml"), (".png", b"\x89PNG"), (".pdf", b"%PDF")):
        for name in "ab":
            save(lambda: draw_region(SQUARE, PLANE, boxes={"box": BOX}), tmp_path / f"{name}{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes().startswith(magic)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_slices_and_projections():
    solid = Region.union_of(NAMES, [cube(2).restricted([le(3, x=1, y=1, z=1)])])
    sliced = draw_region(solid, ["z", "x"], at={"y": Fraction(2)})
    assert (sliced.axes[0].get_xlabel(), sliced.axes[0].get_ylabel()) == ("z", "x")
    assert ((0.0, 1.0), (1.0, 0.0)) in lines(sliced)
    projected = draw_region(solid, ["x", "y"])
    assert ((1.0, 2.0), (2.0, 1.0)) in lines(projected)
    bar = draw_region(solid, ["x"], at={"y": Fraction(2), "z": Fraction(1, 2)})
    assert ((0.0, 0.0), (0.5, 0.0)) in lines(bar)


def test_bars_have_filled_and_hollow_ends():
    region = Region.union_of(["x"], [Polyhedron(("x",), (lt(1, x=1), le(0, x=-1))), Polyhedron(("x",), (eq(3, x=1),))])
    figure = draw_region(region, ["x"], boxes={"box": BOX}, points={"nominal": {"x": Fraction(1, 2)}})
    ends = {line.get_xydata()[0][0]: line.get_markerfacecolor() for line in figure.axes[0].get_lines()
            if line.get_marker() == "o" and line.get_color() == EDGE and len(line.get_xydata())}  # fmt: skip
    assert ends == {0.0: EDGE, 1.0: "white", 3.0: EDGE}
