"""Parameters by option and by TOML file: the specifications themselves, and what they do to a plan."""

import re
from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest

from robust.errors import InputError, InputWarning
from robust.plan import parameters
from robust.plan.model import Expression, Fluent
from robust.plan.parameters import ParameterSpec, Target, Wiring, parse_specs, wire
from robust.plan.stn import parse_stn, write_stn
from tests.plan.building import TEXTS, number, reference

CHARGE = Fluent("charge", ("auv",))
DURATION, START, FLUENT, EXISTING = Target.DURATION, Target.START, Target.FLUENT, Target.EXISTING
BOUNDS = {"weight": Fraction(1, 3), "lower": None, "upper": Fraction(1000), "default": Fraction(1, 10)}
SPECS = {
    "duration:n3": ParameterSpec(DURATION, "n3"),
    "d=duration:n3": ParameterSpec(DURATION, "n3", "d"),
    " n3.d = duration: n3 ": ParameterSpec(DURATION, "n3", "n3.d"),
    "start:N-3,lb=0": ParameterSpec(START, "N-3", None, {"lower": Fraction(0)}),
    "fluent:(Charge  AUV)": ParameterSpec(FLUENT, "(charge auv)"),
    "c=fluent:(charge auv), weight=1/3,lb=-inf,ub=1e3,default=0.1": ParameterSpec(FLUENT, "(charge auv)", "c", BOUNDS),
    "duration:*": ParameterSpec(DURATION, "*"),
    "duration:( Go  A b )": ParameterSpec(DURATION, "(go a b)"),
    "d=shared:go": ParameterSpec(Target.SHARED, "go", "d"),
    "dur_1": ParameterSpec(EXISTING, "dur_1"),
    "n3.rate,ub=+inf": ParameterSpec(EXISTING, "n3.rate", None, {"upper": None}),
}


def test_specifications() -> None:
    assert parse_specs(list(SPECS)) == tuple(SPECS.values())


def test_parameter_file(tmp_path: Path) -> None:
    bounds = {"weight": Fraction(2), "lower": Fraction(1, 3), "upper": Fraction(1, 10), "default": Fraction(105, 10000)}
    assert parameters.read_parameter_file(TEXTS / "parameters.toml") == (
        ParameterSpec(DURATION, "n3", "d3", bounds),
        ParameterSpec(START, "n3", "launch"),
        ParameterSpec(FLUENT, "(charge auv)", "endurance", {"lower": None}),
        ParameterSpec(EXISTING, "n3.rate", None, {"upper": None}),
    )
    file = tmp_path / "bytes.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError):
        parameters.read_parameter_file(file)
    assert parameters.parse_parameter_file("") == ()


PLAN = (TEXTS / "wired.stn").read_text(encoding="utf-8")
FLUENTS: dict[Fluent, Expression] = {CHARGE: number(100), Fluent("level"): reference("s")}


def apply(*specs: str, plan: str = PLAN, domain: tuple[str, ...] = (), renamed: str = "spare") -> Wiring:
    """The wiring of a plan whose spare parameter may have another name."""
    return wire(parse_stn(plan.replace("parameter spare", f"parameter {renamed}")), parse_specs(specs), FLUENTS, domain)


def lines(wiring: Wiring) -> list[str]:
    plan = parse_stn("action instance x : (x);")
    text = write_stn(type(plan)(wiring.parameters, plan.instances, wiring.constraints))
    return [line for line in text.splitlines() if "instance" not in line]


GIVEN = lines(apply())


@pytest.mark.parametrize("effect", re.split(r"\n(?![+-])", (TEXTS / "wiring.txt").read_text(encoding="utf-8").strip()))
def test_effect(effect: str) -> None:
    """Specifications, and what they take from the plan and add to it."""
    specs, *changes = effect.splitlines()
    expected = Counter(GIVEN)
    for change in changes:
        expected[change[2:]] += 1 if change[0] == "+" else -1
    assert Counter(lines(apply(*specs.split(" ")))) == +expected


def test_one_parameter_for_all_instances_of_an_action() -> None:
    wiring = apply("shared:go,weight=2", plan=PLAN.replace("6.5", "5"))
    assert wiring.durations == {"n0": "dur_go", "n1": "dur_go"}
    assert [line for line in lines(wiring) if "dur_go" in line] == [
        "parameter dur_go weight 2 default 5;",
        "c: n0.end - n0.start in [dur_go, dur_go];",
        "c: n1.end - n1.start in [dur_go, dur_go];",
    ]


def test_instantaneous_actions_are_passed_over_with_a_word() -> None:
    with pytest.warns(InputWarning, match=r"--parameter 'duration:\(beep\)': passed over; no instance .* takes time"):
        assert apply("duration:(beep)").durations == {}


def test_what_else_is_replaced() -> None:
    assert apply("duration:wait").durations == apply("p=duration:n2").durations == {"n2": "p"}
    wiring = apply("duration:n0", "c=fluent:(charge auv)")
    assert (wiring.durations, wiring.fluents) == ({"n0": "dur_n0"}, {CHARGE: "c"})
    assert str(wiring.constraints[0].target) == "n0.end", "it keeps its place"
    together = PLAN + "c: n0.end - n0.start in [0, 8]; c: n0.end - n0.start in [5, inf];"
    assert lines(apply("duration:n0", plan=together)) == lines(apply("duration:n0"))
