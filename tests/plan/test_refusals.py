"""What is wrong with a text is said where it is wrong: texts/refusals.txt; what specifications of parameters do."""

import os
import re
from collections import Counter
from fractions import Fraction
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, InputWarning, Location
from robust.plan import model, parameters, timed
from robust.plan.parameters import ParameterSpec, Target, Wiring, parse_parameter_file, parse_spec, parse_specs, wire
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn, write_stn
from tests.plan.building import TEXTS, error_of, groups, number, reference, refused

HEAD = """(define (domain d)
 (:types truck ship - vehicle place vehicle - object)
 (:constants hub - place big - truck)
 (:predicates (at ?v - vehicle ?p - place) (open ?p - place) (idle))
 (:functions (fuel ?v - vehicle) (total))
 """
DOMAIN = parse_domain(HEAD + "(:synth-parameters ?s))", "d.pddl")
CONDITION = ":parameters (?p - place) :synth-parameters (?s) :precondition (and (idle)\n {})"
STEPS = "parameter p default 1;durative-action instance n0 : (go a b);action instance beep : (beep);\n{}"
PDDL = partial(parse_domain, file="d.pddl"), "d.pddl"
PROBLEM = partial(parse_problem, domain=DOMAIN, file="p.pddl"), "p.pddl"
FRAMES = {
    "structure": (*PDDL, "{}"),
    "declarations": (*PDDL, "(define (domain d) {})"),
    "actions": (*PDDL, f"{HEAD}{{}})"),
    "conditions": (*PDDL, f"{HEAD}(:action a {CONDITION}))"),
    "durative actions": (*PDDL, f"{HEAD}(:durative-action a {{}}))"),
    "unsupported": (*PDDL, f"{HEAD}{{}})"),
    "unsupported functions": (*PDDL, "(define (domain d) {})"),
    "problems": (*PROBLEM, "(define (problem p) {})"),
    "unsupported in problems": (*PROBLEM, "(define (problem p) {})"),
    "facts": (*PROBLEM, "(define (problem p) (:domain d) (:init (open hub)\n {}) (:goal ()))"),
    "structure of problems": (*PROBLEM, "{}"),
    "plans": (partial(parse_stn, file="bad.stn"), "bad.stn", STEPS),
    "timed plans": (partial(timed.parse_timed_plan, file="bad.plan"), "bad.plan", "0: (beep)\n{}\n"),
    "specifications": (parse_spec, "--parameter {!r}: found ", "{}"),
    "specifications of a plan": (lambda t: apply(*t.split(" & "), domain=("s",)), "--parameter {!r}: found ", "{}"),
    "files of parameters": (partial(parse_parameter_file, file="p.toml"), "p.toml", "{}"),
}
ROWS = [(group, line) for group, lines in groups(TEXTS / "refusals.txt").items() for line in lines.splitlines()]


@pytest.mark.parametrize(("group", "row"), ROWS)
def test_text_is_refused(group: str, row: str) -> None:
    """At its mark, in one line, with all parts of the message, and with the exit code for what it is."""
    text, message = row.replace("\\n", "\n").replace("\\a", "\a").split(" => ")
    read, place, frame = FRAMES[group]
    if group == "durative actions" and not text.startswith(":duration"):
        text = f":duration () {text}"
    content = frame.replace("{}", text)
    before, mark, after = content.partition("@")
    if mark:
        place += f":{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}: found "
    else:
        place = place.replace("{!r}", repr(text.split(" & ")[-1]))
    refused(lambda: read(before + after), place, message.split(" | "), 4 if group.startswith("unsupported") else 2)


LONG = "9" * 5000


def test_what_is_too_long_too_deep_or_empty_is_refused():
    for read, text, place, part in (
        (parse_stn, f"action instance n : (n);\nc: n - .zero in [0, {LONG}];", "<plan>:2:21", "at most 300 digits"),
        (parse_parameter_file, f"x = {'[' * 5000}", "<parameters>: ", "not TOML"),
        (parse_domain, "(define " * 120 + "((" + "(" * 30 + ")" * 151, "<domain>:1:961", "at most 120"),
        *((parse_domain, text * 20_000, "<domain>:1:", "found") for text in ("(", ")", "(not ")),
        *((parse_stn, text, "<plan>:", "empty plan") for text in ("", "\n\n", "# nothing\n", "parameter p default 1;")),
        *((timed.parse_timed_plan, text, "<plan>:", "empty plan") for text in ("", "\n\n", "; nothing\n")),
    ):
        refused(partial(read, text), place, [part])


@given(st.text() | st.text(alphabet="0123456789.:()[]; \nab/-") | st.text(alphabet="[].=\"'\n0123456789 parmetslbu"))
def test_random_text_is_refused_or_read(text: str) -> None:
    assert error_of(lambda: parse_stn(text)) is not None
    for read in (timed.parse_timed_plan, parse_spec):
        error_of(lambda read=read: read(text))
    for content in (text, f"[parameters.d]\n{text}", f"[parameters.d]\nlb = {text}", f"[parameters]\n{text} = 1"):
        error_of(lambda content=content: parse_parameter_file(content))


def test_what_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for file, data in {"domain.pddl": b"", "zero": b"a\0b", "latin": b"a\nb\xff"}.items():
        (tmp_path / file).write_bytes(data)
    (tmp_path / "broken-link").symlink_to("nowhere.pddl")
    expected = {
        "domian.pddl": ["domian.pddl: found no such file", "did you mean 'domain.pddl'?"],
        "zzz": ["zzz: found no such file, expected a readable text file"],
        "broken-link": ["broken-link: found a link to a file that does not exist, expected a readable text file"],
        "nowhere/zzz": ["nowhere does not exist either"],
        "": [": found a directory"],
        "zero": ["zero: found binary data, expected a UTF-8 text file"],
        "latin": ["latin: found byte 0xff in line 2, expected a UTF-8 text file"],
        **{name: ["a readable text file"] for name in ("x" * 5000, "a\0b", "zero/inside", "(define\n(domain d))")},
    }
    for name, parts in expected.items():
        refused(lambda name=name: read_text(tmp_path / name), str(Location(str(tmp_path / name))), parts)
    for path in (None, 3, b"domain.pddl", ""):
        place = f"found {repr(path)!r}, expected the path of a readable text file"
        refused(lambda path=path: read_text(path), place, [])
    refuse = Mock(side_effect=PermissionError(13, os.strerror(13)))  # the superuser may read everything
    monkeypatch.setattr("robust.plan.pddl.forms.open", refuse, raising=False)
    refused(lambda: read_text("secret"), "secret: found a file that you may not read", [])


@given(data=st.binary())
def test_random_bytes_are_no_domain(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.pddl"
    path.write_bytes(data)
    assert str(error_of(lambda: parse_domain(read_text(path), str(path)))).startswith(str(path))
    nested = f"(>= {'(- ' * 110}(total){')' * 110} 1)"
    assert "a" in parse_domain(f"{HEAD}(:action a :precondition {nested}))").actions, "deep, but within the limit"


CHARGE = model.Fluent("charge", ("auv",))
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


def test_options_and_files_of_parameters(tmp_path: Path) -> None:
    assert parse_specs(list(SPECS)) == tuple(SPECS.values())
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
    with pytest.raises(InputError, match=r"'fluent:\(go a\)' for an initial value, 'duration:\(go a\)' for durations"):
        parse_specs(["(go a)"])


PLAN = (TEXTS / "wired.stn").read_text(encoding="utf-8")
FLUENTS: dict[model.Fluent, model.Expression] = {CHARGE: number(100), model.Fluent("level"): reference("s")}


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
    bounds = (f"c: n{number}.end - n{number}.start in [dur_go, dur_go];" for number in range(2))
    known = [line for line in lines(wiring) if "dur_go" in line]
    assert known == ["parameter dur_go weight 2 default 5;", *bounds]
    with pytest.warns(InputWarning, match=r"--parameter 'duration:\(beep\)': passed over; no instance .* takes time"):
        assert apply("duration:(beep)").durations == {}


def test_what_else_is_replaced() -> None:
    assert apply("duration:wait").durations == apply("p=duration:n2").durations == {"n2": "p"}
    wiring = apply("duration:n0", "c=fluent:(charge auv)")
    assert (wiring.durations, wiring.fluents) == ({"n0": "dur_n0"}, {CHARGE: "c"})
    assert str(wiring.constraints[0].target) == "n0.end", "it keeps its place"
    together = PLAN + "c: n0.end - n0.start in [0, 8]; c: n0.end - n0.start in [5, inf];"
    assert lines(apply("duration:n0", plan=together)) == lines(apply("duration:n0"))
    twice = ["name 'dur_n0' twice", "NAME=duration:n0"]
    refused(lambda: apply("duration:n0", renamed="dur_n0"), "--parameter 'duration:n0'", twice)
