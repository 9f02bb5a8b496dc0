"""`--plot`: files in all formats that show what they should."""

from fractions import Fraction
from pathlib import Path

import pytest

from robust.irr.search import EnvelopeResult, Status, Step
from robust.plan.model import Parameter
from robust.qe.box import Box, Interval, Side
from robust.show.plots import plot_envelope
from tests.cli.running import command, example

STARTS = {".svg": b"<?xml", ".png": b"\x89PNG", ".pdf": b"%PDF", ".PNG": b"\x89PNG"}


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


@pytest.mark.parametrize("suffix", STARTS)
def test_formats(tmp_path, suffix):
    path = tmp_path / f"box{suffix}"
    ended = command("envelope", *example(), "--plot", path, "--method", "irr", "--beta", "5")
    assert (ended.code, ended.err) == (0, "")
    assert path.read_bytes().startswith(STARTS[suffix])


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
    ended = command("envelope", *example("plan-flexible-wait.stn"), "--plot", tmp_path / "box.svg")
    assert ended.code == 1
    assert not (tmp_path / "box.svg").exists()
