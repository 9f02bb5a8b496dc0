"""The `.stn` format: what is read, what is refused and where, and that nothing is lost in writing."""

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, RobustError
from robust.numbers import format_number, parse_number
from robust.plan.model import ZERO, ParameterReference, TimePoint, TimePointKind
from robust.plan.stn import (
    InstanceDeclaration,
    ParameterDeclaration,
    STNConstraint,
    STNPlan,
    parse_stn,
    read_stn,
    write_stn,
)

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
    ("$", "2:1", ["found '$'", "expected 'parameter'"]),
    ("parameter ;", "2:11", ["found ';'", "a parameter name"]),
    ("parameter q default 1", "2:22", ["found end of file", "expected", "';'"]),
    ("parameter q default;", "2:20", ["found ';'", "value of 'default'"]),
    ("parameter q default x;", "2:21", ["found 'x'", "a number such as"]),
    ("parameter q default inf;", "2:21", ["found 'inf'", "a number such as"]),
    ("parameter q default 1 default 2;", "2:23", ["found 'default'", "at most once"]),
    ("parameter q wieght 1;", "2:13", ["found 'wieght'", "did you mean 'weight'?"]),
    ("parameter q weight 0;", "2:20", ["weight '0'", "above 0"]),
    ("parameter q weight -1/2;", "2:20", ["weight '-1/2'", "above 0"]),
    ("parameter q lb 2 ub 1;", "2:11", ["'q'", "lower bound 2 above upper bound 1", "lb ≤ ub"]),
    ("parameter q lb 2 default 1.5;", "2:11", ["default 1.5", "[2, inf]"]),
    ("parameter q ub 1 default 1.5;", "2:11", ["default 1.5", "[-inf, 1]"]),
    ("parameter q lb inf;", "2:16", ["found 'inf'", "-inf"]),
    ("parameter q ub -inf;", "2:16", ["found '-inf'", "or inf"]),
    ("parameter p default 2;", "2:11", ["second declaration of parameter 'p'", "line 1"]),
    ("parameter inf default 2;", "2:11", ["found 'inf'", "cannot be told from a bound"]),
    ("parameter -inf default 2;", "2:11", ["found '-inf'", "cannot be told from a bound"]),
    ("parameter Zero default 2;", "2:11", ["found 'Zero'", "cannot be told from a bound"]),
    ("parameter .zero default 2;", "2:11", ["found '.zero'", "cannot be told from a bound"]),
    ("parameter 1e5 default 2;", "2:11", ["found '1e5'", "cannot be told from a bound"]),
    ("parameter 3d default 2;", "2:11", ["found '3d'", "beginning with a letter"]),
    ("parameter dé default 2;", "2:11", ["found 'dé'", "beginning with a letter"]),
    ("durative-action n1 : (go a b);", "2:17", ["found 'n1'", "'instance'"]),
    ("durative-action instance n0 : (go a b);", "2:26", ["second declaration of instance 'n0'", "line 1"]),
    ("durative-action instance n.1 : (go);", "2:27", ["found '.1'", "':'"]),
    ("durative-action instance n1 (go);", "2:29", ["found '('", "':'"]),
    ("durative-action instance n1 : go;", "2:31", ["found 'go'", "'('"]),
    ("durative-action instance n1 : ();", "2:32", ["found ')'", "an action name"]),
    ("durative-action instance n1 : (go ?x);", "2:35", ["found '?x'", "an object or ')'"]),
    ("durative-action instance n1 : (go a", "2:36", ["found end of file", "an object or ')'"]),
    ("durative-action instance n1 : (go a)", "2:37", ["found end of file", "';'"]),
    ("c n0.end - n0.start in [1, 2];", "2:3", ["found 'n0.end'", "':'"]),
    ("c: n0.end - n0.start in [1, 2]", "2:31", ["found end of file", "';'"]),
    ("c: n0.end - n0.start in [1 2];", "2:28", ["found '2'", "','"]),
    ("c: n0.end - n0.start in [1, 2;", "2:30", ["found ';'", "']'"]),
    ("c: n0.end - n0.start [1, 2];", "2:22", ["found '['", "'in'"]),
    ("c: n0.end n0.start in [1, 2];", "2:11", ["found 'n0.start'", "'-'"]),
    ("c: - n0.start in [1, 2];", "2:4", ["found '-'", "a time point"]),
    ("c: n1.end - n0.start in [1, 2];", "2:4", ["'n1.end'", "not declared", "known are beep, n0"]),
    ("c: n0.end - N0.start in [1, 2];", "2:13", ["'N0.start'", "not declared"]),
    ("c: n0 - .zero in [1, 2];", "2:4", ["found time point 'n0'", "'n0.start' or 'n0.end'", "durative"]),
    ("c: n0.stop - .zero in [1, 2];", "2:4", ["found time point 'n0.stop'", "'n0.start' or 'n0.end'"]),
    ("c: beep.start - .zero in [1, 2];", "2:4", ["found time point 'beep.start'", "'beep'", "instantaneous"]),
    ("c: beep-n0.start in [1, 2];", "2:4", ["'beep-n0.start'", "a minus between time points needs blanks"]),
    ("c: n0.end - n0.start in [2, 1];", "2:26", ["lower bound 2 above upper bound 1"]),
    ("c: n0.end - n0.start in [inf, inf];", "2:26", ["found lower bound 'inf'", "'-inf' for none"]),
    ("c: n0.end - n0.start in [+inf, inf];", "2:26", ["found lower bound '+inf'", "'-inf' for none"]),
    ("c: n0.end - n0.start in [1, -inf];", "2:29", ["found upper bound '-inf'", "'inf' for none"]),
    ("c: n0.end - n0.start in [pp, 2];", "2:26", ["found 'pp'", "no such parameter", "did you mean 'p'?"]),
    ("c: n0.end - n0.start in [P, 2];", "2:26", ["found 'P'", "no such parameter"]),
    ("c: n0.end - n0.start in [-p, 2];", "2:26", ["found '-p'", "a fraction a/b, inf, -inf or a parameter name"]),
    ("c: n0.end - n0.start in [1/0, 2];", "2:26", ["found '1/0'", "denominator is not 0"]),
    ("c: n0.end - n0.start in [1.5/2, 2];", "2:26", ["found '1.5/2'", "a fraction a/b"]),
    ("c: n0.end - n0.start in [0, 1e999999999999];", "2:29", ["at most 300 digits"]),
    (f"c: n0.end - n0.start in [0, {'9' * 5000}];", "2:29", ["at most 300 digits"]),
    ("c: n0.end - n0.end in [1, 2];", "2:24", ["interval without 0", "n0.end"]),
    ("c: .zero - .zero in [-inf, -1];", "2:22", ["interval without 0"]),
    ("c: n0.end - n0.end in [1, p];", "2:24", ["interval without 0"]),
]


@pytest.mark.parametrize(("text", "place", "parts"), BAD, ids=[text[:50] for text, _, _ in BAD])
def test_bad_statement(text: str, place: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        parse_stn(PREFIX + text, "bad.stn")
    message = str(caught.value)
    assert message.startswith(f"bad.stn:{place}: found "), message
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize("text", ["", "\n# nothing\n", "parameter p default 1;\n"])
def test_empty_plan(text: str) -> None:
    with pytest.raises(InputError, match="empty plan"):
        parse_stn(text)


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


def test_declaration_comes_before_use() -> None:
    with pytest.raises(InputError, match=r"1:4: .*not declared above"):
        parse_stn("c: n0.end - n0.start in [1, 2]; durative-action instance n0 : (go);")


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing\.stn"):
        read_stn(tmp_path / "missing.stn")


def test_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        read_stn(tmp_path)


# numbers

LIMIT = 10**300 - 1
fractions = st.builds(Fraction, st.integers(-LIMIT, LIMIT), st.integers(1, LIMIT)) | st.fractions(max_denominator=1000)


@given(fractions)
def test_numbers_are_exact(value: Fraction) -> None:
    assert parse_number(format_number(value)) == value


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("1/1000", "0.001"),
        ("-3/2", "-1.5"),
        ("1/3", "1/3"),
        ("-1/6", "-1/6"),
        ("100", "100"),
        ("0", "0"),
        ("7/20", "0.35"),
    ],
)
def test_printed_numbers(value: str, text: str) -> None:
    assert format_number(Fraction(value)) == text


def test_longest_decimal() -> None:
    smallest = Fraction(1, 2**996)
    assert parse_number(format_number(smallest)) == smallest


# round trip and fuzz

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
    reserved = {"inf", "infinity", "nan", "zero"}
    declared = draw(
        st.lists(parameter_names.filter(lambda name: name.lower() not in reserved), unique=True, max_size=4)
    )
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


@given(st.text())
def test_random_text(text: str) -> None:
    with pytest.raises(RobustError):
        parse_stn(text)


@given(st.data())
def test_damaged_plan(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(GOOD)))
    end = data.draw(st.integers(start, len(GOOD)))
    inserted = data.draw(
        st.sampled_from(["", "\0", ";", "(", "1/0", "é", "-", ".", "inf", "#", "9e99999"]) | st.text(max_size=4)
    )
    text = GOOD[:start] + inserted + GOOD[end:]
    problem = _problem(text)
    if problem is None:
        plan = parse_stn(text)
        assert parse_stn(write_stn(plan)) == plan
    else:
        assert "\n" not in str(problem)
        assert problem.location is not None
        assert problem.location.line is not None


def _problem(text: str) -> RobustError | None:
    try:
        parse_stn(text)
    except RobustError as error:
        return error
    return None


@given(st.binary())
def test_random_bytes(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("stn") / "plan.stn"
    path.write_bytes(content)
    with pytest.raises(RobustError):
        read_stn(path)


def test_recorded_plans(dataset: Path) -> None:
    files = sorted(dataset.glob("*/*.stn"))
    assert files
    for file in files:
        plan = read_stn(file)
        assert parse_stn(write_stn(plan)) == plan
        assert all(parameter.default is not None for parameter in plan.parameters)
