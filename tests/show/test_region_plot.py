"""Drawings: what is drawn where, and the files."""

import subprocess
import sys
from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.qe.box import Box, Interval
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.show.region_plot import draw_region, plot_region
from tests.qe.polyhedra import NAMES, cube, eq, le, lt, polygon, rectangle

PLANE = ("x", "y")
SQUARE = Region.union_of(PLANE, [rectangle(0, 10, 0, 10)])
BOX = Box({"x": Interval(Fraction(2), Fraction(4)), "y": Interval(Fraction(5), None)})


def lines(figure, style="-", colour="#08519c"):
    """The strokes of one style as pairs of ends."""
    found = [line for line in figure.axes[0].get_lines() if line.get_color() == colour]
    return {
        tuple(sorted(map(tuple, line.get_xydata().tolist())))
        for line in found
        if line.get_linestyle() == style and len(line.get_xydata()) == 2
    }


def test_seams_are_not_drawn():
    halves = Region.union_of(PLANE, [rectangle(0, 1, 0, 1), rectangle(1, 2, 0, 1)])
    figure = draw_region(halves)
    assert ((1.0, 0.0), (1.0, 1.0)) not in lines(figure)
    assert {((0.0, 0.0), (0.0, 1.0)), ((2.0, 0.0), (2.0, 1.0))} <= lines(figure)
    assert len(figure.axes[0].patches) == 2


def test_strict_sides_are_dashed():
    figure = draw_region(Region.union_of(PLANE, [rectangle(0, 1, 0, 1).restricted([lt(1, x=1)])]))
    assert lines(figure, "--") == {((1.0, 0.0), (1.0, 1.0))}
    assert len(lines(figure)) == 3


def test_excluded_slabs_stay_visible():
    thin = [polygon(eq(7, y=1)), polygon(le(3, x=1), le("-2999/1000", x=-1))]
    figure = draw_region(Region.difference(rectangle(0, 10, 0, 10), thin))
    assert {((0.0, 7.0), (10.0, 7.0))} <= lines(figure, colour="#cb181d")
    assert len(lines(figure, colour="#cb181d")) == 2


def test_unbounded_regions_are_clipped_around_the_overlays():
    half = Region.union_of(PLANE, [polygon(le(0, x=-1))])
    figure = draw_region(half, boxes={"box": BOX}, points={"nominal": {"x": Fraction(3), "y": Fraction(6)}})
    assert figure.axes[0].get_xlim() == pytest.approx((-0.32, 4.32))
    assert figure.axes[0].get_ylim() == pytest.approx((4.92, 6.08))
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["box", "nominal"]
    assert draw_region(half, view={"x": (Fraction(-1), Fraction(1))}).axes[0].get_xlim() == (-1, 1)


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
    plot_region(region, tmp_path / "region.svg", title="extreme")
    assert (tmp_path / "region.svg").read_text().startswith("<?xml")


def test_formats_and_reproducible_files(tmp_path):
    for suffix, magic in ((".svg", b"<?xml"), (".png", b"\x89PNG"), (".pdf", b"%PDF")):
        plot_region(SQUARE, tmp_path / f"a{suffix}", boxes={"box": BOX})
        plot_region(SQUARE, tmp_path / f"b{suffix}", boxes={"box": BOX})
        assert (tmp_path / f"a{suffix}").read_bytes().startswith(magic)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_slices_and_projections():
    solid = Region.union_of(NAMES, [cube(2).restricted([le(3, x=1, y=1, z=1)])])
    sliced = draw_region(solid, axes=["z", "x"], at={"y": Fraction(2)})
    assert (sliced.axes[0].get_xlabel(), sliced.axes[0].get_ylabel()) == ("z", "x")
    assert ((0.0, 1.0), (1.0, 0.0)) in lines(sliced)
    projected = draw_region(solid, axes=["x", "y"])
    assert ((1.0, 2.0), (2.0, 1.0)) in lines(projected)
    bar = draw_region(solid, axes=["x"], at={"y": Fraction(2), "z": Fraction(1, 2)})
    assert ((0.0, 0.0), (0.5, 0.0)) in lines(bar)


def test_bars_have_filled_and_hollow_ends():
    region = Region.union_of(["x"], [Polyhedron(("x",), (lt(1, x=1), le(0, x=-1))), Polyhedron(("x",), (eq(3, x=1),))])
    figure = draw_region(region, boxes={"box": BOX}, points={"nominal": {"x": Fraction(1, 2)}})
    ends = {line.get_xydata()[0][0]: line.get_markerfacecolor() for line in figure.axes[0].get_lines()
            if line.get_marker() == "o" and line.get_color() == "#08519c"}  # fmt: skip
    assert ends == {0.0: "#08519c", 1.0: "white", 3.0: "#08519c"}


def test_errors(tmp_path):
    with pytest.raises(InputError, match=r"suffix '\.gif'; expected \.svg, \.png, \.pdf"):
        plot_region(SQUARE, tmp_path / "a.gif")
    with pytest.raises(InputError, match="cannot write the drawing"):
        plot_region(SQUARE, tmp_path / "missing" / "a.png")
    with pytest.raises(InputError, match="expected one or two"):
        draw_region(Region.universe(NAMES))
    with pytest.raises(InputError, match="expected one or two"):
        draw_region(SQUARE, axes=["x"], at={"x": Fraction(1)})
    with pytest.raises(InputError, match="'nominal' has no value for parameter 'y'"):
        draw_region(SQUARE, points={"nominal": {"x": Fraction(1)}})


def test_importing_regions_does_not_import_what_is_heavy():
    imports = "import sys, robust.qe.region, robust.show.region_plot"
    code = f"{imports}; print('matplotlib' in sys.modules, 'sympy' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["False", "False"]
