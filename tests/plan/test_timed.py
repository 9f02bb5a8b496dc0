"""Plans in what planners print: layouts, logs with several plans, and how exactly numbers were printed."""

from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.plan.timed import parse_timed_plan, plans_in, write_timed_plan

LAYOUTS = {
    "POPF": """
Number of literals: 28
(b 8.0)
; Plan found with metric 9
; Time 0.02
0.000: (go a b)  [5.000]
5.001: (beep)  [0.001]

 * All goal deadlines now no later than 148.019
b (8.000 | 5.000)b (G)""",
    "OPTIC": """
;;;; Solution Found
; States evaluated: 6
; Cost: 9.001
; Time 0.00
0.000: (go a b)  [5.000]
5.001: (beep)  [0.001]
""",
    "TFD": "0.00000000: (go a b) [5.00000000]\n5.00100000: (beep) [0.00100000]\n",
    "LPG": """; Version LPG-td-1.4

Plan computed:
   Time: (ACTION) [action Duration; action Cost]
 0.0000: (GO A B) [D:5.00; C:0.10]
 5.0010: (BEEP) [D:0.0010; C:0.10]


Solution number: 1
""",
    "PlanSys2": """[INFO] [1700000000.12] [executor]: plan:
[planner_node-1] 0.000:\t(go a b)\t[5.000]
[planner_node-1] 5.001:\t(beep)\t[0.001]
""",
    "unified-planning": "TimeTriggeredPlan:\n    0.0: go(a, b) [5.0]\n    5.001: beep [0.001]\n",
    "Aries": "==== Plan (cost: 5.001) ====\n  0: (go a b) [5]\n  5.001: (beep) [0.001]\n",
    "colours": "\x1b[01;34mplan\x1b[0m\n\x1b[1m0: (go a b) [5]\x1b[0m\n5.001: (beep) [0.001]",
}


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
def test_layouts_of_planners(text: str) -> None:
    assert write_timed_plan(parse_timed_plan(text)) == "0: (go a b) [5]\n5.001: (beep) [0.001]\n"


def test_steps_of_a_sequence_are_numbered() -> None:
    assert write_timed_plan(parse_timed_plan("SequentialPlan:\n    go(a, b)\n    beep\n")) == "0: (go a b)\n1: (beep)\n"


SEVERAL = "0: (a) [1]\nlooking on\n0: (b) [2]\n; Time 0.3\n0: (c) [3]\n; not the end\n\n1: (d)\nCost: 3\n"


@pytest.mark.parametrize(
    ("number", "steps", "note"),
    [
        (None, "0: (c) [3]\n1: (d)\n", "picked plan 3 of 3 (lines 5 to 8); skipped 2 lines that are no step"),
        (2, "0: (b) [2]\n", "picked plan 2 of 3 (line 3); skipped 2 lines that are no step"),
    ],
)
def test_the_last_plan_of_a_log_counts(number: int | None, steps: str, note: str) -> None:
    plan = parse_timed_plan(SEVERAL, number=number)
    assert (write_timed_plan(plan), plan.note) == (steps, note)


def test_a_number_that_no_plan_has() -> None:
    with pytest.raises(InputError, match="a\\.log: found 3 plans, expected one with number 4"):
        parse_timed_plan(SEVERAL, "a.log", 4)


def test_what_is_wrong_stands_beside_the_plans_before_it() -> None:
    error, *plans = plans_in("0: (a) [1]\nlooking on\n0: (b) [2]\n2.0: (c", "<plan of p>")
    assert str(error).startswith("<plan of p>:4:1: found '2.0: (c'")
    assert [write_timed_plan(plan) for plan in plans] == ["0: (a) [1]\n"]


@pytest.mark.parametrize(
    ("texts", "units"),
    [
        (["12", "12.001", "1e-3", "1/3"], [1, Fraction(1, 1000), Fraction(1, 1000), 0]),
        (["195.01100000", "0.53846200", "0.00100000"], [Fraction(1, 10**3), Fraction(1, 10**6), Fraction(1, 10**8)]),
        (["195.01100000", "329.16486000"], [Fraction(1, 10**8), Fraction(1, 10**8)]),
    ],
    ids=["last digit", "six digits and zeros", "more than six digits"],
)
def test_units(texts: list[str], units: list[Fraction]) -> None:
    plan = parse_timed_plan("".join(f"{text}: (a) [{text}]\n" for text in texts))
    assert plan.units == tuple((unit, unit) for unit in units)
