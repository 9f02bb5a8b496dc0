"""Drawings: written in every format, with every name, and without overlap."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.pike_bridge.model import Choice, Constraint, Event, Tpnu
from robust.show.network import layered, plot_network
from tests.pike_bridge.kitchen import kitchen


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf", ".SVG"])
def test_formats(tmp_path, suffix):
    path = tmp_path / f"plan{suffix}"
    plot_network(kitchen(), path, links=[("e3", "e9", "(taken mug)"), ("e9", "e3", "backwards")])
    assert path.stat().st_size > 1000


def test_everything_is_named(tmp_path):
    path = tmp_path / "plan.svg"
    plot_network(kitchen(), path, links=[("e3", "e9", "$taken$")])
    text = path.read_text(encoding="utf-8")
    for name in (
        "get human mug",
        "pour robot glass",
        "[0.5, 2]",
        "xA2",
        "xA1 = mug",
        "e14",
        "$taken$",
        "robot",
        "human",
    ):
        assert name in text
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
    plot_network(network, tmp_path / "plan.png")


def test_errors(tmp_path):
    with pytest.raises(InputError, match=r"expected a name that ends in .svg, .png, .pdf"):
        plot_network(kitchen(), tmp_path / "plan.jpg")
    with pytest.raises(InputError, match="cannot write the drawing: no such file or directory"):
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
