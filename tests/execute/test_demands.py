"""Deadlines, and widths in proportion to nominal values: what is asked of a plan in addition to what it says."""

from fractions import Fraction
from pathlib import Path

import pytest

import robust
from robust import Answer, InputError, Location
from robust.execute.demands import earliest_end, latest_end, with_deadline
from robust.plan.stn import parse_stn, write_stn
from tests.execute.plans import durative

PLACE = Location("--deadline")
NETWORK = """\
parameter k default 3;
durative-action instance n0 : (one);
durative-action instance n1 : (two);
c: n0.end - n0.start in [2, 9];
c: n1.end - n1.start in [k, k];
c: n1.start - n0.end in [1, inf];
"""
DOMAIN = (
    "(define (domain chain) (:requirements :typing :durative-actions) (:predicates (open) (first) (second))"
    + durative("one", "2", "(at start (open))", "(at end (first))")
    + durative("two", "3", "(at start (first))", "(at end (second))")
    + ")"
)
PROBLEM = "(define (problem chain) (:domain chain) (:init (open)) (:goal (second)))"
STEPS = "0.001: (one) [2]\n2.002: (two) [3]\n"


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """A domain, a problem and steps."""
    paths = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan.log")]
    for path, text in zip(paths, (DOMAIN, PROBLEM, STEPS), strict=True):
        path.write_text(text)
    return paths


@pytest.mark.parametrize(("text", "latest"), [("90", 90), ("+10%", 22), (" + 2.5 % ", "20.5"), (7, 7), ("1/3", "1/3")])
def test_deadlines_are_times_or_relative_to_the_end(text: str | int, latest: int | str) -> None:
    assert latest_end(text, Fraction(20), PLACE) == Fraction(latest)


@pytest.mark.parametrize("text", ["soon", "+10", "10%", "+ten%", ""])
def test_other_deadlines_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"--deadline: found .*, expected"):
        latest_end(text, Fraction(20), PLACE)


def test_a_network_ends_at_the_earliest_with_nominal_values() -> None:
    network = parse_stn(NETWORK)
    assert earliest_end(network) == 6
    late = with_deadline(network, "+50%", PLACE)
    assert [str(bound.upper) for bound in late.constraints[3:]] == ["9", "9"]
    assert parse_stn(write_stn(late)).constraints == late.constraints
    assert "c: n1.end - .zero in [-inf, 9];  # deadline" in write_stn(late)
    with pytest.raises(InputError, match="without schedule at nominal values"):
        earliest_end(parse_stn(NETWORK + "c: n1.end - .zero in [0, 5];"))


def test_steps_end_when_they_are_planned(files: list[Path]) -> None:
    plan = robust.load_plan(*files, parameters=["duration:*"], deadline="+20%", widths="relative")
    assert [parameter.weight for parameter in plan.parameters] == [2, 3]
    assert plan.constraints[-1].upper.constant_term == Fraction("5.002") * Fraction(6, 5)
    result = robust.envelope(plan)
    stretch = 1 + result.tolerance.ratio
    assert [result.box[name].upper for name in ("dur_n0", "dur_n1")] == [2 * stretch, 3 * stretch]
    assert result.tolerance.ratio == (Fraction("5.002") * Fraction(6, 5) - Fraction("5.001")) / 5
    assert {stop.statements[-1] for (_, side), stop in result.stops.items() if side.value == "upper"} == {
        "deadline: n1.end at most 6.0024"
    }
    converted = robust.convert(*files, parameters=["duration:*"], deadline="+20%", widths="relative")
    assert converted.plan.constraints == plan.constraints
    assert [parameter.weight for parameter in converted.stn.parameters] == [2, 3]


def test_a_deadline_before_the_planned_end_is_met_by_starting_earlier(files: list[Path]) -> None:
    files[2].write_text("5: (one) [2]\n9: (two) [3]\n")
    assert robust.check(robust.load_plan(*files, deadline=6)).answer is Answer.PROVED
    with pytest.raises(InputError, match=r"no schedule: .*deadline: n1.end at most 5"):
        robust.load_plan(*files, deadline=5)
