"""Time-triggered plans: what is read, what is refused and where, and that nothing is lost in writing."""

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, RobustError
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan, read_timed_plan, write_timed_plan

GOOD = """\
; Plan found in 0.1 s

0.000: (Load Truck-1 crate_2) [5.0]
  5.001 :(beep)  ; at once
1/3: ( load ) [ 1e-3 ]\r
"""


def test_plan() -> None:
    plan = parse_timed_plan(GOOD, "p.plan")
    assert plan == TimedPlan(
        (
            TimedStep(Fraction(0), "load", ("truck-1", "crate_2"), Fraction(5)),
            TimedStep(Fraction(5001, 1000), "beep", ()),
            TimedStep(Fraction(1, 3), "load", (), Fraction(1, 1000)),
        )
    )
    assert [str(step.location) for step in plan.steps] == ["p.plan:3:1", "p.plan:4:3", "p.plan:5:1"]
    assert write_timed_plan(plan) == "0: (load truck-1 crate_2) [5]\n5.001: (beep)\n1/3: (load) [0.001]\n"


BAD = [
    ("Solution found", "2:1", ["found 'Solution found'", "a step such as"]),
    ("(beep)", "2:1", ["found '(beep)'", "a step such as"]),
    ("1.0: beep", "2:1", ["found '1.0: beep'", "a step such as"]),
    ("1.0: (beep) [5", "2:1", ["a step such as"]),
    ("1.0: (beep) 5", "2:1", ["a step such as"]),
    ("1.0: (beep) [5] x", "2:1", ["a step such as"]),
    ("1: (a) 2: (b)", "2:1", ["a step such as"]),
    ("x: (beep)", "2:1", ["found 'x' as time", "a number ≥ 0"]),
    ("  -1: (beep)", "2:3", ["found time '-1'", "a number ≥ 0"]),
    ("1: (beep) []", "2:12", ["found '' as duration", "a number ≥ 0"]),
    ("1: (beep) [x]", "2:12", ["found 'x' as duration"]),
    ("1: (beep) [-1]", "2:12", ["found duration '-1'"]),
    ("1: (beep) [1/0]", "2:12", ["denominator is not 0"]),
    ("1: (beep) [inf]", "2:12", ["found 'inf' as duration"]),
    ("1: ()", "2:5", ["an empty action"]),
    ("1: (beep ?x)", "2:5", ["found '?x'", "objects"]),
]


@pytest.mark.parametrize(("line", "place", "parts"), BAD, ids=[line for line, _, _ in BAD])
def test_bad_line(line: str, place: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        parse_timed_plan(f"0: (beep)\n{line}\n", "bad.plan")
    message = str(caught.value)
    assert message.startswith(f"bad.plan:{place}: found "), message
    for part in parts:
        assert part in message


@pytest.mark.parametrize("text", ["", "\n\n", "; nothing\n"])
def test_empty_plan(text: str) -> None:
    with pytest.raises(InputError, match="empty plan"):
        parse_timed_plan(text)


def test_file(tmp_path: Path) -> None:
    file = tmp_path / "a.plan"
    file.write_text("0: (beep)\n", encoding="utf-8")
    assert read_timed_plan(file) == parse_timed_plan("0: (beep)")
    with pytest.raises(InputError):
        read_timed_plan(tmp_path / "b.plan")


symbols = st.from_regex(r"[a-z][a-z0-9_-]{0,6}", fullmatch=True)
amounts = st.fractions(min_value=0, max_denominator=10**6)
steps = st.builds(TimedStep, amounts, symbols, st.lists(symbols, max_size=3).map(tuple), st.none() | amounts)


@given(st.lists(steps, min_size=1, max_size=5).map(lambda some: TimedPlan(tuple(some))))
def test_round_trip(plan: TimedPlan) -> None:
    assert parse_timed_plan(write_timed_plan(plan)) == plan


@given(st.text() | st.text(alphabet="0123456789.:()[]; \nab/-"))
def test_random_text(text: str) -> None:
    try:
        parse_timed_plan(text)
    except RobustError as error:
        message = str(error)
    else:
        message = ""
    assert "\n" not in message
