"""Files of plans: what is read, what is refused and where, and that nothing is lost in writing."""

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robust.numbers import format_number, parse_number
from robust.plan.model import ZERO, ParameterReference, TimePoint, TimePointKind
from robust.plan.stn import (
    InstanceDeclaration,
    ParameterDeclaration,
    STNConstraint,
    STNPlan,
    is_parameter_name,
    parse_stn,
    write_stn,
)
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan, read_timed_plan, write_timed_plan
from tests.plan.building import error_of, refused

GOOD = """\
# a comment
parameter dur_0 weight 2 default 112.5 lb 1e-3 ub 1000/3;
durative-action instance n0 : (Do_Hover AUV wp-1);   # trailing comment
action instance Beep-1 : (beep);
c: n0.end - n0.start in [dur_0,dur_0];
parameter n0.rate ub inf lb -inf;
c: n0.start - .zero in [0, +inf];
c:n0.end-n0.start in[-inf,n0.rate];
c: Beep-1 - n0.end in [1/1000, inf];
c: .zero - Beep-1 in [-1e2, -.5];
"""

N0_START, N0_END = TimePoint(TimePointKind.START, "n0"), TimePoint(TimePointKind.END, "n0")
BEEP = TimePoint(TimePointKind.INSTANT, "Beep-1")


def test_everything_the_format_has() -> None:
    dur, rate = ParameterReference("dur_0"), ParameterReference("n0.rate")
    assert parse_stn(GOOD) == STNPlan(
        parameters=(
            ParameterDeclaration("dur_0", Fraction(2), Fraction(225, 2), Fraction(1, 1000), Fraction(1000, 3)),
            ParameterDeclaration("n0.rate"),
        ),
        instances=(
            InstanceDeclaration("n0", "do_hover", ("auv", "wp-1"), durative=True),
            InstanceDeclaration("Beep-1", "beep", (), durative=False),
        ),
        constraints=(
            STNConstraint(N0_END, N0_START, dur, dur),
            STNConstraint(N0_START, ZERO, Fraction(0), None),
            STNConstraint(N0_END, N0_START, None, rate),
            STNConstraint(BEEP, N0_END, Fraction(1, 1000), None),
            STNConstraint(ZERO, BEEP, Fraction(-100), Fraction(-1, 2)),
        ),
    )


def test_locations_and_name() -> None:
    plan = parse_stn(GOOD, "plans/mission_1.stn")
    assert plan.name == "mission_1"
    assert str(plan.parameters[0].location) == "plans/mission_1.stn:2:11"
    assert str(plan.instances[1].location) == "plans/mission_1.stn:4:17"
    assert str(plan.constraints[2].location) == "plans/mission_1.stn:8:1"


def test_written_text() -> None:
    assert (
        write_stn(parse_stn(GOOD))
        == """\
parameter dur_0 weight 2 default 112.5 lb 0.001 ub 1000/3;
parameter n0.rate weight 1;
durative-action instance n0 : (do_hover auv wp-1);
action instance Beep-1 : (beep);
c: n0.end - n0.start in [dur_0, dur_0];
c: n0.start - .zero in [0, inf];
c: n0.end - n0.start in [-inf, n0.rate];
c: Beep-1 - n0.end in [0.001, inf];
c: .zero - Beep-1 in [-100, -0.5];
"""
    )


PREFIX = "parameter p default 1;durative-action instance n0 : (go a b);action instance beep : (beep);\n"

BAD = [
    # after PREFIX, so all of these are in line 2
    ("paramter q;", "2:1", ["'paramter'", "'parameter'", "did you mean 'parameter'?"]),
    ("parameter ;", "2:11", ["found ';'", "a parameter name"]),
    ("parameter q default 1", "2:22", ["found end of file", "expected", "';'"]),
    ("parameter q default;", "2:20", ["found ';'", "value of 'default'"]),
    ("parameter q default x;", "2:21", ["found 'x'", "a number such as"]),
    ("parameter q default 1 default 2;", "2:23", ["found 'default'", "at most once"]),
    ("parameter q wieght 1;", "2:13", ["found 'wieght'", "did you mean 'weight'?"]),
    ("parameter q weight 0;", "2:20", ["weight '0'", "above 0"]),
    ("parameter q ub 1 default 1.5;", "2:11", ["default 1.5", "[-inf, 1]"]),
    ("parameter q lb inf;", "2:16", ["found 'inf'", "-inf"]),
    ("parameter q ub -inf;", "2:16", ["found '-inf'", "or inf"]),
    ("parameter p default 2;", "2:11", ["second declaration of parameter 'p'", "line 1"]),
    ("parameter dé default 2;", "2:11", ["found 'dé'", "beginning with a letter"]),
    ("durative-action n1 : (go a b);", "2:17", ["found 'n1'", "'instance'"]),
    ("durative-action instance n0 : (go a b);", "2:26", ["second declaration of instance 'n0'", "line 1"]),
    ("durative-action instance n.1 : (go);", "2:27", ["found '.1'", "':'"]),
    ("durative-action instance n1 : go;", "2:31", ["found 'go'", "'('"]),
    ("durative-action instance n1 : ();", "2:32", ["found ')'", "an action name"]),
    ("durative-action instance n1 : (go a", "2:36", ["found end of file", "an object or ')'"]),
    ("c n0.end - n0.start in [1, 2];", "2:3", ["found 'n0.end'", "':'"]),
    ("c: n0.end - n0.start in [1 2];", "2:28", ["found '2'", "','"]),
    ("c: n0.end - n0.start in [1, 2;", "2:30", ["found ';'", "']'"]),
    ("c: n0.end - n0.start [1, 2];", "2:22", ["found '['", "'in'"]),
    ("c: n0.end n0.start in [1, 2];", "2:11", ["found 'n0.start'", "'-'"]),
    ("c: - n0.start in [1, 2];", "2:4", ["found '-'", "a time point"]),
    ("c: n0.end - N0.start in [1, 2];", "2:13", ["'N0.start'", "not declared"]),
    ("c: n0 - .zero in [1, 2];", "2:4", ["found time point 'n0'", "'n0.start' or 'n0.end'", "durative"]),
    ("c: beep.start - .zero in [1, 2];", "2:4", ["found time point 'beep.start'", "'beep'", "instantaneous"]),
    ("c: beep-n0.start in [1, 2];", "2:4", ["'beep-n0.start'", "a minus between time points needs blanks"]),
    ("c: n0.end - n0.start in [inf, inf];", "2:26", ["found lower bound 'inf'", "'-inf' for none"]),
    ("c: n0.end - n0.start in [1, -inf];", "2:29", ["found upper bound '-inf'", "'inf' for none"]),
    ("c: n0.end - n0.start in [pp, 2];", "2:26", ["found 'pp'", "no such parameter", "did you mean 'p'?"]),
    ("c: n0.end - n0.start in [-p, 2];", "2:26", ["found '-p'", "a fraction a/b, inf, -inf or a parameter name"]),
    ("c: n0.end - n0.start in [1/0, 2];", "2:26", ["found '1/0'", "denominator is not 0"]),
    (f"c: n0.end - n0.start in [0, {'9' * 5000}];", "2:29", ["at most 300 digits"]),
    ("c: n0.end - n0.end in [1, p];", "2:24", ["interval without 0"]),
]


@pytest.mark.parametrize(("text", "place", "parts"), BAD, ids=[text[:50] for text, _, _ in BAD])
def test_bad_statement(text: str, place: str, parts: list[str]) -> None:
    refused(lambda: parse_stn(PREFIX + text, "bad.stn"), f"bad.stn:{place}: found ", parts)


@pytest.mark.parametrize(
    "text",
    [
        "c: n0.end - n0.end in [-1, 1];",
        "c: n0.end-.zero in [3, 3];",
        "c: .zero-n0.end in [-3, -3];",
        "c:beep - n0.end in [p, 3];",
        "parameter weight weight 1;",
        "parameter inf.x default 0;",
        "action instance 0 : (beep); c: 0 - .zero in [0, 1];",
        "c\n:\nn0.end # why\n- n0.start\tin [ 1 , 2 ] ;\r\n",
    ],
)
def test_good_statement(text: str) -> None:
    plan = parse_stn(PREFIX + text)
    assert parse_stn(write_stn(plan)) == plan


LIMIT = 10**300 - 1
fractions = st.builds(Fraction, st.integers(-LIMIT, LIMIT), st.integers(1, LIMIT)) | st.fractions(max_denominator=1000)


@given(fractions)
@example(Fraction(1, 2**996))
def test_numbers_are_exact(value: Fraction) -> None:
    assert parse_number(format_number(value)) == value


def test_printed_numbers() -> None:
    texts = {"1/1000": "0.001", "-3/2": "-1.5", "1/3": "1/3", "-1/6": "-1/6", "100": "100", "0": "0", "7/20": "0.35"}
    assert {value: format_number(Fraction(value)) for value in texts} == texts


names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}(-[a-z0-9]{1,3})?", fullmatch=True)
parameter_names = st.tuples(names, st.sampled_from(["", ".rate", ".x-1"])).map("".join)
symbols = st.from_regex(r"[a-z][a-z0-9_-]{0,6}", fullmatch=True)
weights = st.fractions(min_value=0, max_denominator=10**6).filter(bool)
numbers = st.fractions(max_denominator=10**6) | st.decimals(allow_nan=False, allow_infinity=False, places=4).map(
    Fraction
)


@st.composite
def parameters(draw: st.DrawFn, name: str) -> ParameterDeclaration:
    values = sorted(draw(st.tuples(numbers, numbers, numbers)))
    lower, default, upper = (value if draw(st.booleans()) else None for value in values)
    return ParameterDeclaration(name, draw(weights), default, lower, upper)


@st.composite
def plans(draw: st.DrawFn) -> STNPlan:
    declared = draw(st.lists(parameter_names.filter(is_parameter_name), unique=True, max_size=4))
    identifiers = draw(st.lists(names | st.integers(0, 99).map(str), min_size=1, max_size=4, unique=True))
    instances = [
        InstanceDeclaration(one, draw(symbols), tuple(draw(st.lists(symbols, max_size=3))), draw(st.booleans()))
        for one in identifiers
    ]
    points = st.sampled_from([ZERO, *(point for one in instances for point in (one.start, one.end))])
    references = st.sampled_from(declared).map(ParameterReference) if declared else st.none()
    constraints = []
    for _ in range(draw(st.integers(0, 5))):
        target, source = draw(points), draw(points)
        lower, upper = sorted((draw(numbers), draw(numbers)))
        if target == source:
            lower, upper = min(lower, Fraction(0)), max(upper, Fraction(0))
        low, up = draw(st.just(lower) | st.none() | references), draw(st.just(upper) | st.none() | references)
        constraints.append(STNConstraint(target, source, low, up))
    return STNPlan(tuple(draw(parameters(name)) for name in declared), tuple(instances), tuple(constraints))


@given(plans())
def test_round_trip(plan: STNPlan) -> None:
    text = write_stn(plan)
    assert parse_stn(text) == plan
    assert write_stn(parse_stn(text)) == text


@given(st.data())
def test_damaged_plan(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(GOOD)))
    end = data.draw(st.integers(start, len(GOOD)))
    inserted = data.draw(
        st.sampled_from(["", "\0", ";", "(", "1/0", "é", "-", ".", "inf", "#", "9e99999"]) | st.text(max_size=4)
    )
    text = GOOD[:start] + inserted + GOOD[end:]
    error = error_of(lambda: parse_stn(text))
    if error is None:
        plan = parse_stn(text)
        assert parse_stn(write_stn(plan)) == plan
    else:
        assert error.location is not None
        assert error.location.line is not None


TIMED = """\
; Plan found in 0.1 s

0.000: (Load Truck-1 crate_2) [5.0]
  5.001 :(beep)  ; at once
1/3: ( load ) [ 1e-3 ]\r
"""


def test_timed_plan(tmp_path: Path) -> None:
    file = tmp_path / "p.plan"
    file.write_text(TIMED, encoding="utf-8")
    plan = read_timed_plan(file)
    assert plan == parse_timed_plan(TIMED)
    load, beep = (
        TimedStep(Fraction(0), "load", ("truck-1", "crate_2"), Fraction(5)),
        TimedStep(Fraction("5.001"), "beep", ()),
    )
    assert plan == TimedPlan((load, beep, TimedStep(Fraction(1, 3), "load", (), Fraction(1, 1000))))
    assert [str(step.location) for step in plan.steps] == [f"{file}:{place}" for place in ("3:1", "4:3", "5:1")]
    assert write_timed_plan(plan) == "0: (load truck-1 crate_2) [5]\n5.001: (beep)\n1/3: (load) [0.001]\n"


BAD_LINES = [
    ("1.0: (beep) [5] x", "2:1", ["a step such as"]),
    ("1: (a) 2: (b)", "2:1", ["a step such as"]),
    ("x: (beep)", "2:1", ["found 'x' as time", "a number ≥ 0"]),
    ("  -1: (beep)", "2:3", ["found time '-1'", "a number ≥ 0"]),
    ("1: (beep) [-1]", "2:12", ["found duration '-1'"]),
    ("1: (beep) [1/0]", "2:12", ["denominator is not 0"]),
    ("1: (beep) [inf]", "2:12", ["found 'inf' as duration"]),
    ("1: ()", "2:5", ["an empty action"]),
    ("1: (beep ?x)", "2:5", ["found '?x'", "objects"]),
]


@pytest.mark.parametrize(("line", "place", "parts"), BAD_LINES, ids=[line for line, _, _ in BAD_LINES])
def test_bad_line(line: str, place: str, parts: list[str]) -> None:
    refused(lambda: parse_timed_plan(f"0: (beep)\n{line}\n", "bad.plan"), f"bad.plan:{place}: found ", parts)


amounts = st.fractions(min_value=0, max_denominator=10**6)
steps = st.builds(TimedStep, amounts, symbols, st.lists(symbols, max_size=3).map(tuple), st.none() | amounts)


@given(st.lists(steps, min_size=1, max_size=5).map(lambda some: TimedPlan(tuple(some))))
def test_round_trip_of_timed_plans(plan: TimedPlan) -> None:
    assert parse_timed_plan(write_timed_plan(plan)) == plan


@pytest.mark.parametrize("text", ["", "\n\n", "# nothing\n", "parameter p default 1;\n"])
def test_empty_plan(text: str) -> None:
    refused(lambda: parse_stn(text), "<plan>:", ["empty plan"])
    if "p" not in text:
        refused(lambda: parse_timed_plan(text.replace("#", ";")), "<plan>:", ["empty plan"])


@given(st.text() | st.text(alphabet="0123456789.:()[]; \nab/-"))
def test_random_text(text: str) -> None:
    assert error_of(lambda: parse_stn(text)) is not None
    error_of(lambda: parse_timed_plan(text))
