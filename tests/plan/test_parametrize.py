"""Parameters by option and by TOML file: the specifications themselves, and what they do to a plan."""

import re
from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.plan.model import Expression, Fluent, ParameterReference
from robust.plan.parameters import (
    ParameterSpec,
    Target,
    Wiring,
    parse_parameter_file,
    parse_spec,
    parse_specs,
    read_parameter_file,
    wire,
)
from robust.plan.polynomial import Polynomial
from robust.plan.stn import parse_stn, write_stn
from tests.plan.building import error_of, refused

CHARGE = Fluent("charge", ("auv",))

DURATION, START, FLUENT, EXISTING = Target.DURATION, Target.START, Target.FLUENT, Target.EXISTING
BOUNDS = {"weight": Fraction(1, 3), "lower": None, "upper": Fraction(1000), "default": Fraction(1, 10)}
GOOD_SPECS = {
    "duration:n3": ParameterSpec(DURATION, "n3"),
    "d=duration:n3": ParameterSpec(DURATION, "n3", "d"),
    " n3.d = duration: n3 ": ParameterSpec(DURATION, "n3", "n3.d"),
    "start:N-3,lb=0": ParameterSpec(START, "N-3", None, {"lower": Fraction(0)}),
    "fluent:(Charge  AUV)": ParameterSpec(FLUENT, "(charge auv)"),
    "c=fluent:(charge auv), weight=1/3,lb=-inf,ub=1e3,default=0.1": ParameterSpec(FLUENT, "(charge auv)", "c", BOUNDS),
    "dur_1": ParameterSpec(EXISTING, "dur_1"),
    "n3.rate,ub=+inf": ParameterSpec(EXISTING, "n3.rate", None, {"upper": None}),
}


@pytest.mark.parametrize("text", GOOD_SPECS)
def test_specification(text: str) -> None:
    assert parse_spec(text) == GOOD_SPECS[text]


BAD_SPECS = [
    ("", ["found ''", "a parameter name"]),
    ("inf", ["found 'inf'", "cannot be told from a bound"]),
    ("dur_1=5", ["found 'dur_1=5'", "[NAME=]duration:ID"]),
    ("duratoin:n3", ["found 'duratoin'", "did you mean 'duration'?"]),
    ("zero=duration:n3", ["found 'zero'", "cannot be told from a bound"]),
    ("fluent:charge", ["found 'charge'", "such as '(charge auv)'"]),
    ("d,weight", ["found 'weight'", "weight=W"]),
    ("d,wieght=2", ["found 'wieght=2'", "did you mean 'weight'"]),
    ("d,weight=0", ["found weight '0'", "above 0"]),
    ("d,lb=inf", ["found 'inf' as 'lb'", "or -inf"]),
    ("d,ub=-inf", ["found '-inf' as 'ub'", "or inf"]),
    ("d,default=inf", ["found 'inf' as 'default'"]),
    ("d,lb=1/0", ["found '1/0'", "denominator is not 0"]),
    ("d,lb=1,lb=1", ["second value for 'lb'"]),
    ("d,lb=9e999", ["found '9e999'", "300 digits"]),
]


@pytest.mark.parametrize(("text", "parts"), BAD_SPECS, ids=[text for text, _ in BAD_SPECS])
def test_bad_specification(text: str, parts: list[str]) -> None:
    refused(lambda: parse_spec(text), f"--parameter {text!r}: found ", parts)


def test_parameter_file(tmp_path: Path) -> None:
    file = tmp_path / "parameters.toml"
    file.write_text(
        """
        [parameters.d3]
        duration = "n3"
        weight = 2
        lower = "1/3"
        ub = 0.1
        default = 1_0.5e-3
        [parameters.launch]
        start = "n3"
        [parameters.endurance]
        fluent = "(CHARGE auv)"
        lb = "-inf"
        [parameters."n3.rate"]
        upper = inf
        """,
        encoding="utf-8",
    )
    bounds = {"weight": Fraction(2), "lower": Fraction(1, 3), "upper": Fraction(1, 10), "default": Fraction(105, 10000)}
    assert read_parameter_file(file) == (
        ParameterSpec(DURATION, "n3", "d3", bounds),
        ParameterSpec(START, "n3", "launch"),
        ParameterSpec(FLUENT, "(charge auv)", "endurance", {"lower": None}),
        ParameterSpec(EXISTING, "n3.rate", None, {"upper": None}),
    )
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError):
        read_parameter_file(file)
    assert parse_parameter_file("") == ()


BAD_FILES = [
    ("[parameters.d\n", "p.toml:1:14: ", ["not TOML"]),
    ("[parameters]\nd = 5", "p.toml: [parameters.d]: ", ["found '5'", "expected a table"]),
    ("parameters = 5", "p.toml: ", ["'parameters'", "[parameters.NAME]"]),
    ("[paramters.d]", "p.toml: ", ["found key 'paramters'", "did you mean 'parameters'?"]),
    ("[parameters.d]\nduration = 3", "p.toml: [parameters.d]: ", ["found '3' as 'duration'", "in quotes"]),
    ("[parameters.d]\nduration = 'n3'\nstart = 'n3'", "p.toml: [parameters.d]: ", ["duration and start"]),
    ("[parameters.d]\nlength = 'n3'", "p.toml: [parameters.d]: ", ["found key 'length'", "duration"]),
    ("[parameters.n3.rate]\nweight = 2", "p.toml: [parameters.n3]: ", ["[parameters.'n3.rate']"]),
    ("[parameters.inf]\nweight = 2", "p.toml: [parameters.inf]: ", ["cannot be told from a bound"]),
    ("[parameters.d]\nweight = true", "p.toml: [parameters.d]: ", ["found true as 'weight'"]),
    ("[parameters.d]\nweight = [1]", "p.toml: [parameters.d]: ", ["found a list as 'weight'"]),
    ("[parameters.d]\nweight = 1979-05-27", "p.toml: [parameters.d]: ", ["found a date as 'weight'"]),
    ("[parameters.d]\nweight = nan", "p.toml: [parameters.d]: ", ["found 'nan' as 'weight'"]),
    ("[parameters.d]\nlb = 1\nlower = 1", "p.toml: [parameters.d]: ", ["second value for 'lower'"]),
    ("[parameters.d]\nfluent = 'charge'", "p.toml: [parameters.d]: ", ["found 'charge'"]),
    (f"x = {'[' * 5000}", "p.toml: ", ["not TOML"]),
]


@pytest.mark.parametrize(("text", "place", "parts"), BAD_FILES, ids=[text[:40] for text, _, _ in BAD_FILES])
def test_bad_parameter_file(text: str, place: str, parts: list[str]) -> None:
    refused(lambda: parse_parameter_file(text, "p.toml"), place, parts)


@given(st.text() | st.text(alphabet="[].=\"'\n0123456789 parmetslbu"))
def test_random_texts(text: str) -> None:
    error_of(lambda: parse_spec(text))
    for content in (text, f"[parameters.d]\n{text}", f"[parameters.d]\nlb = {text}", f"[parameters]\n{text} = 1"):
        error_of(lambda content=content: parse_parameter_file(content))


PLAN = """\
parameter p default 7 weight 3;
parameter spare lb 0;
durative-action instance n0 : (go a b);
durative-action instance n1 : (go b c);
durative-action instance n2 : (wait);
action instance beep : (beep);
c: n0.end - n0.start in [5, 5];
c: n0.start - .zero in [0, 0];
c: n1.start - n1.end in [-6.5, -6.5];
c: n2.end - n2.start in [p, p];
c: beep - n2.end in [1/1000, inf];
c: n1.start - .zero in [1, 9];
"""
FLUENTS: dict[Fluent, Expression] = {
    CHARGE: Polynomial.constant(100),
    Fluent("level"): Polynomial.variable(ParameterReference("s")),
}


def apply(*specs: str, plan: str = PLAN, domain: tuple[str, ...] = ()) -> Wiring:
    return wire(parse_stn(plan), parse_specs(specs), FLUENTS, domain)


def lines(wiring: Wiring) -> list[str]:
    plan = parse_stn("action instance x : (x);")
    text = write_stn(type(plan)(wiring.parameters, plan.instances, wiring.constraints))
    return [line for line in text.splitlines() if "instance" not in line]


GIVEN = lines(wire(parse_stn(PLAN), (), FLUENTS))

EFFECTS = """
duration:n0
- c: n0.end - n0.start in [5, 5];
+ parameter dur_n0 weight 1 default 5;
+ c: n0.end - n0.start in [dur_n0, dur_n0];
d=duration:n1,weight=2,lb=1
- c: n1.start - n1.end in [-6.5, -6.5];
+ parameter d weight 2 default 6.5 lb 1;
+ c: n1.end - n1.start in [d, d];
duration:GO
- c: n0.end - n0.start in [5, 5];
- c: n1.start - n1.end in [-6.5, -6.5];
+ parameter dur_n0 weight 1 default 5;
+ parameter dur_n1 weight 1 default 6.5;
+ c: n0.end - n0.start in [dur_n0, dur_n0];
+ c: n1.end - n1.start in [dur_n1, dur_n1];
start:n0
- c: n0.start - .zero in [0, 0];
+ parameter start_n0 weight 1 default 0;
+ c: n0.start - .zero in [start_n0, start_n0];
start:n1,default=2
- c: n1.start - .zero in [1, 9];
+ parameter start_n1 weight 1 default 2;
+ c: n1.start - .zero in [start_n1, start_n1];
start:beep,default=2
+ parameter start_beep weight 1 default 2;
+ c: beep - .zero in [start_beep, start_beep];
spare=duration:n0,ub=10
- parameter spare weight 1 lb 0;
- c: n0.end - n0.start in [5, 5];
+ parameter spare weight 1 default 5 lb 0 ub 10;
+ c: n0.end - n0.start in [spare, spare];
duration:wait,ub=9
- parameter p weight 3 default 7;
+ parameter p weight 3 default 7 ub 9;
p=duration:n2
p,default=8,ub=9
- parameter p weight 3 default 7;
+ parameter p weight 3 default 8 ub 9;
dur_n1,weight=4 duration:go
- c: n0.end - n0.start in [5, 5];
- c: n1.start - n1.end in [-6.5, -6.5];
+ parameter dur_n0 weight 1 default 5;
+ parameter dur_n1 weight 4 default 6.5;
+ c: n0.end - n0.start in [dur_n0, dur_n0];
+ c: n1.end - n1.start in [dur_n1, dur_n1];
spare,lb=-inf
- parameter spare weight 1 lb 0;
+ parameter spare weight 1;
c=fluent:(charge\tauv)
+ parameter c weight 1 default 100;
"""


@pytest.mark.parametrize("effect", re.split(r"\n(?![+-])", EFFECTS.strip()))
def test_effect(effect: str) -> None:
    """Specifications, and what they take from the plan and add to it."""
    specs, *changes = effect.splitlines()
    expected = Counter(GIVEN)
    for change in changes:
        expected[change[2:]] += 1 if change[0] == "+" else -1
    assert Counter(lines(apply(*specs.split(" ")))) == +expected


def test_what_else_is_replaced() -> None:
    assert apply("duration:wait").durations == apply("p=duration:n2").durations == {"n2": "p"}
    wiring = apply("duration:n0", "c=fluent:(charge auv)")
    assert (wiring.durations, wiring.fluents) == ({"n0": "dur_n0"}, {CHARGE: "c"})
    assert str(wiring.constraints[0].target) == "n0.end", "it keeps its place"
    together = PLAN + "c: n0.end - n0.start in [0, 8]; c: n0.end - n0.start in [5, inf];"
    assert lines(apply("duration:n0", plan=together)) == lines(apply("duration:n0"))


MISFITS = [
    (["duration:n9"], ["found 'n9'", "known are beep, go, n0, n1, n2, wait"]),
    (["duration:beep"], ["'beep', which is instantaneous"]),
    (["d=duration:go"], ["one name for 2 instances of 'go' (n0, n1)"]),
    (["d=duration:n2"], ["the duration of n2 with parameter 'p'"]),
    (
        ["start:beep"],
        ["no fixed value for the start of beep", "--parameter start:beep,default=D, or c: beep - .zero in"],
    ),
    (["start:n1"], ["no fixed value for the start of n1", "c: n1.start - .zero in [D, D]"]),
    (["start:go"], ["found 'go'", "an instance of the plan"]),
    (["fluent:(charge rov)"], ["found (charge rov)", "did you mean '(charge auv)'?"]),
    (["fluent:(level)"], ["(level) with parameter 's'"]),
    (["q,weight=2"], ["found 'q'", "a parameter of the plan or the domain", "known are p, s, spare"]),
    (["n0,weight=2"], ["found 'n0'", "write duration:n0"]),
    (["p=duration:n0"], ["found name 'p' twice", "NAME=duration:n0"]),
    (["d=duration:n0", "d=duration:n1"], ["found name 'd' twice"]),
    (["duration:n0", "duration:go"], ["the duration of n0 with parameter 'dur_n0'"]),
    (["p,weight=2", "p,lb=0"], ["parameter 'p' twice"]),
    (["p,lb=8"], ["default 7", "[8, inf]"]),
    (["p,lb=8,ub=7,default=8"], ["lower bound 8 above upper bound 7"]),
    (["duration:n0,ub=4"], ["default 5", "[-inf, 4]"]),
]


@pytest.mark.parametrize(("specs", "parts"), MISFITS, ids=[" ".join(specs) for specs, _ in MISFITS])
def test_misfit(specs: list[str], parts: list[str]) -> None:
    refused(lambda: apply(*specs, domain=("s",)), f"--parameter {specs[-1]!r}: found ", parts)


def test_generated_name_that_the_plan_uses() -> None:
    plan = PLAN.replace("parameter spare", "parameter dur_n0")
    parts = ["found generated name 'dur_n0' twice", "write NAME=duration:n0"]
    refused(lambda: apply("duration:n0", plan=plan), "--parameter 'duration:n0'", parts)
