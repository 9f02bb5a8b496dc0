"""Files of plans and what planners print: what is read, and that nothing is lost in writing."""

from fractions import Fraction
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st

from robust.numbers import format_number, parse_number
from robust.plan import stn
from robust.plan.model import ZERO, ParameterReference, TimePoint, TimePointKind
from robust.plan.stn import InstanceDeclaration, ParameterDeclaration, STNConstraint, STNPlan, parse_stn, write_stn
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan, plans_in, read_timed_plan, write_timed_plan
from tests.plan.building import TEXTS, error_of, groups, refused

GOOD = (TEXTS / "format.stn").read_text(encoding="utf-8")
WRITTEN = (TEXTS / "written.stn").read_text(encoding="utf-8")


def test_everything_the_format_has_and_other_good_statements() -> None:
    start, end = TimePoint(TimePointKind.START, "n0"), TimePoint(TimePointKind.END, "n0")
    beep = TimePoint(TimePointKind.INSTANT, "Beep-1")
    dur, rate = ParameterReference("dur_0"), ParameterReference("n0.rate")
    plan = parse_stn(GOOD, "plans/mission_1.stn")
    bounds = Fraction(2), Fraction(225, 2), Fraction(1, 1000), Fraction(1000, 3)
    assert plan.parameters == (ParameterDeclaration("dur_0", *bounds), ParameterDeclaration("n0.rate"))
    hover = InstanceDeclaration("n0", "do_hover", ("auv", "wp-1"), durative=True)
    assert plan.instances == (hover, InstanceDeclaration("Beep-1", "beep", (), durative=False))
    assert plan.constraints == (
        STNConstraint(end, start, dur, dur),
        STNConstraint(start, ZERO, Fraction(0), None),
        STNConstraint(end, start, None, rate),
        STNConstraint(beep, end, Fraction(1, 1000), None),
        STNConstraint(ZERO, beep, Fraction(-100), Fraction(-1, 2)),
    )
    assert write_stn(plan) == WRITTEN
    assert plan.name == "mission_1"
    places = [str(item.location) for item in (plan.parameters[0], plan.instances[1], plan.constraints[2])]
    assert places == [f"plans/mission_1.stn:{place}" for place in ("2:11", "4:17", "8:1")]
    declarations = "parameter p default 1;durative-action instance n0 : (go a b);action instance beep : (beep);"
    for text in (
        "c: n0.end - n0.end in [-1, 1];",
        "c: n0.end-.zero in [3, 3];",
        "c: .zero-n0.end in [-3, -3];",
        "c:beep - n0.end in [p, 3];",
        "parameter weight weight 1;",
        "parameter inf.x default 0;",
        "action instance 0 : (beep); c: 0 - .zero in [0, 1];",
        "c\n:\nn0.end # why\n- n0.start\tin [ 1 , 2 ] ;\r\n",
    ):
        plan = parse_stn(declarations + text)
        assert parse_stn(write_stn(plan)) == plan, text


LIMIT = 10**300 - 1
fractions = st.builds(Fraction, st.integers(-LIMIT, LIMIT), st.integers(1, LIMIT)) | st.fractions(max_denominator=1000)


@given(fractions)
@example(Fraction(1, 2**996))
def test_numbers_are_exact_and_printed_shortly(value: Fraction) -> None:
    assert parse_number(format_number(value)) == value
    texts = {"1/1000": "0.001", "-3/2": "-1.5", "1/3": "1/3", "-1/6": "-1/6", "100": "100", "0": "0", "7/20": "0.35"}
    assert {value: format_number(Fraction(value)) for value in texts} == texts


names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}(-[a-z0-9]{1,3})?", fullmatch=True)
parameter_names = st.tuples(names, st.sampled_from(["", ".rate", ".x-1"])).map("".join).filter(stn.is_parameter_name)
symbols = st.from_regex(r"[a-z][a-z0-9_-]{0,6}", fullmatch=True)
weights = st.fractions(min_value=0, max_denominator=10**6).filter(bool)
decimals = st.decimals(allow_nan=False, allow_infinity=False, places=4)
numbers = st.fractions(max_denominator=10**6) | decimals.map(Fraction)


@st.composite
def declarations(draw: st.DrawFn, name: str) -> ParameterDeclaration:
    values = sorted(draw(st.tuples(numbers, numbers, numbers)))
    lower, default, upper = (value if draw(st.booleans()) else None for value in values)
    return ParameterDeclaration(name, draw(weights), default, lower, upper)


@st.composite
def plans(draw: st.DrawFn) -> STNPlan:
    declared = draw(st.lists(parameter_names, unique=True, max_size=4))
    identifiers = draw(st.lists(names | st.integers(0, 99).map(str), min_size=1, max_size=4, unique=True))
    instances = [
        InstanceDeclaration(name, draw(symbols), tuple(draw(st.lists(symbols, max_size=3))), draw(st.booleans()))
        for name in identifiers
    ]
    points = st.sampled_from([ZERO, *(point for instance in instances for point in (instance.start, instance.end))])
    references = st.sampled_from(declared).map(ParameterReference) if declared else st.none()
    constraints = []
    for _ in range(draw(st.integers(0, 5))):
        target, source = draw(points), draw(points)
        lower, upper = sorted((draw(numbers), draw(numbers)))
        if target == source:
            lower, upper = min(lower, Fraction(0)), max(upper, Fraction(0))
        low, up = draw(st.just(lower) | st.none() | references), draw(st.just(upper) | st.none() | references)
        constraints.append(STNConstraint(target, source, low, up))
    return STNPlan(tuple(draw(declarations(name)) for name in declared), tuple(instances), tuple(constraints))


amounts = st.fractions(min_value=0, max_denominator=10**6)
steps = st.builds(TimedStep, amounts, symbols, st.lists(symbols, max_size=3).map(tuple), st.none() | amounts)


@given(plans(), st.lists(steps, min_size=1, max_size=5).map(lambda some: TimedPlan(tuple(some))))
def test_round_trips(plan: STNPlan, timed: TimedPlan) -> None:
    text = write_stn(plan)
    assert parse_stn(text) == plan
    assert write_stn(parse_stn(text)) == text
    assert parse_timed_plan(write_timed_plan(timed)) == timed


@given(st.data())
def test_damaged_plan(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(GOOD)))
    end = data.draw(st.integers(start, len(GOOD)))
    pieces = ["", "\0", ";", "(", "1/0", "é", "-", ".", "inf", "#", "9e99999"]
    text = GOOD[:start] + data.draw(st.sampled_from(pieces) | st.text(max_size=4)) + GOOD[end:]
    error = error_of(lambda: parse_stn(text))
    if error is None:
        assert parse_stn(write_stn(parse_stn(text))) == parse_stn(text)
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
    load = TimedStep(Fraction(0), "load", ("truck-1", "crate_2"), Fraction(5))
    beep, late = TimedStep(Fraction("5.001"), "beep", ()), TimedStep(Fraction(1, 3), "load", (), Fraction(1, 1000))
    assert plan == parse_timed_plan(TIMED) == TimedPlan((load, beep, late))
    assert [str(step.location) for step in plan.steps] == [f"{file}:{place}" for place in ("3:1", "4:3", "5:1")]
    assert write_timed_plan(plan) == "0: (load truck-1 crate_2) [5]\n5.001: (beep)\n1/3: (load) [0.001]\n"


def test_layouts_of_planners() -> None:
    for headline, text in groups(TEXTS / "layouts.txt").items():
        written = write_timed_plan(parse_timed_plan(text))
        assert written == "0: (go a b) [5]\n5.001: (beep) [0.001]\n", headline
    numbered = parse_timed_plan("SequentialPlan:\n    go(a, b)\n    beep\n")
    assert write_timed_plan(numbered) == "0: (go a b)\n1: (beep)\n"


def test_the_last_plan_of_a_log_counts_and_what_is_wrong_stands_beside_those_before_it() -> None:
    log = "0: (a) [1]\nlooking on\n0: (b) [2]\n; Time 0.3\n0: (c) [3]\n; not the end\n\n1: (d)\nCost: 3\n"
    last, second = parse_timed_plan(log), parse_timed_plan(log, number=2)
    assert write_timed_plan(last) == "0: (c) [3]\n1: (d)\n"
    assert last.note == "picked plan 3 of 3 (lines 5 to 8); skipped 2 lines that are no step"
    assert write_timed_plan(second) == "0: (b) [2]\n"
    assert second.note == "picked plan 2 of 3 (line 3); skipped 2 lines that are no step"
    refused(lambda: parse_timed_plan(log, "a.log", 4), "a.log: found 3 plans, expected one with number 4", [])
    error, *plans = plans_in("0: (a) [1]\nlooking on\n0: (b) [2]\n2.0: (c", "<plan of p>")
    assert str(error).startswith("<plan of p>:4:1: found '2.0: (c'")
    assert [write_timed_plan(plan) for plan in plans] == ["0: (a) [1]\n"]
    # Units of the last digit; of six digits and zeros; of more than six digits.
    for texts, units in (
        ("12 12.001 1e-3 1/3", ["1", "0.001", "0.001", "0"]),
        ("195.01100000 0.53846200 0.00100000", ["0.001", "0.000001", "0.00000001"]),
        ("195.01100000 329.16486000", ["0.00000001"] * 2),
    ):
        plan = parse_timed_plan("".join(f"{text}: (a) [{text}]\n" for text in texts.split()))
        assert plan.units == tuple((Fraction(unit),) * 2 for unit in units)
