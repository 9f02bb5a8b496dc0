"""Gantt charts: what is refused, and that nothing overlaps."""

from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError
from robust.show.gantt import Bar, Chart, Lane, Mark, _Drawing, draw_chart

F = Fraction


def chart(seed, count):
    random = Random(seed)  # noqa: S311 - reproducible
    lanes = tuple(Lane(name) for name in ("ada", "bob", "human"))
    bars = []
    for number in range(count):
        start = F(random.randint(0, 3000), 10)
        end = None if number == 0 else start + F(random.randint(0, 400), 10)
        bars.append(Bar(random.choice(lanes).name, start, end, f"(move place-{number})", random.choice("abc")))
    marks = [Mark(F(number * 40), random.choice(["ada", None]), f"seen {number}", "seen") for number in range(5)]
    return Chart("a chart", lanes, tuple(bars), tuple(marks))


@pytest.mark.parametrize(("seed", "count"), [(0, 3), (1, 20), (2, 60)])
def test_nothing_overlaps_and_everything_is_drawn(seed, count, tmp_path):
    drawn = chart(seed, count)
    drawing = _Drawing(drawn)
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
        draw_chart(Chart("", lanes, (Bar("bob", F(0), F(1), "x", "a"),)), tmp_path / "chart.svg")
    with pytest.raises(InputError, match="expected an end after its start"):
        draw_chart(Chart("", lanes, (Bar("ada", F(2), F(1), "x", "a"),)), tmp_path / "chart.svg")
    with pytest.raises(InputError, match="cannot write"):
        draw_chart(Chart("", lanes, ()), tmp_path / "chart.nope")
    with pytest.raises(InputError, match="cannot write"):
        draw_chart(Chart("", lanes, ()), tmp_path / "absent" / "chart.svg")
