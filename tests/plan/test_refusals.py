"""What is wrong with a text is said where it is wrong, with what was expected instead: texts/refusals.txt."""

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import Location
from robust.plan.parameters import parse_parameter_file, parse_spec
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn
from robust.plan.timed import parse_timed_plan
from tests.plan.building import TEXTS, error_of, groups, refused
from tests.plan.test_parametrize import apply

HEAD = """(define (domain d)
 (:types truck ship - vehicle place vehicle - object)
 (:constants hub - place big - truck)
 (:predicates (at ?v - vehicle ?p - place) (open ?p - place) (idle))
 (:functions (fuel ?v - vehicle) (total))
 """
DOMAIN = parse_domain(HEAD + "(:synth-parameters ?s))", "d.pddl")
CONDITION = ":parameters (?p - place) :synth-parameters (?s) :precondition (and (idle)\n {})"
PLAN = "parameter p default 1;durative-action instance n0 : (go a b);action instance beep : (beep);\n{}"

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
    "plans": (partial(parse_stn, file="bad.stn"), "bad.stn", PLAN),
    "timed plans": (partial(parse_timed_plan, file="bad.plan"), "bad.plan", "0: (beep)\n{}\n"),
    "specifications": (parse_spec, "--parameter {!r}: found ", "{}"),
    "specifications of a plan": (
        lambda text: apply(*text.split(" & "), domain=("s",)),
        "--parameter {!r}: found ",
        "{}",
    ),
    "files of parameters": (partial(parse_parameter_file, file="p.toml"), "p.toml", "{}"),
}


def rows() -> Iterator[object]:
    for group, lines in groups(TEXTS / "refusals.txt").items():
        for line in lines.splitlines():
            text, message = line.split(" => ")
            yield pytest.param(group, text.replace("\\n", "\n").replace("\\a", "\a"), message, id=f"{group}: {text}")


@pytest.mark.parametrize(("group", "text", "message"), list(rows()))
def test_text_is_refused(group: str, text: str, message: str) -> None:
    """At its mark, in one line, with all parts of the message, and with the exit code for what it is."""
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


@pytest.mark.parametrize(
    ("call", "place", "part"),
    [
        (
            lambda: parse_stn(f"action instance n : (n);\nc: n - .zero in [0, {LONG}];"),
            "<plan>:2:21",
            "at most 300 digits",
        ),
        (lambda: parse_parameter_file(f"x = {'[' * 5000}", "p.toml"), "p.toml: ", "not TOML"),
        (lambda: parse_domain("(define " * 120 + "((" + "(" * 30 + ")" * 151), "<domain>:1:961", "at most 120"),
        *((lambda text=text: parse_domain(text), "<domain>:1:", "found") for text in ("(" * 20_000, ")" * 20_000)),
        (lambda: parse_domain("(not " * 20_000 + "(p)"), "<domain>:1:", "found"),
        (
            lambda: apply("duration:n0", renamed="dur_n0"),
            "--parameter 'duration:n0'",
            "name 'dur_n0' twice | NAME=duration:n0",
        ),
        *((lambda text=text: parse_stn(text), "<plan>:", "empty plan") for text in ("", "\n\n", "# nothing\n")),
        (lambda: parse_stn("parameter p default 1;\n"), "<plan>:", "empty plan"),
        *((lambda text=text: parse_timed_plan(text), "<plan>:", "empty plan") for text in ("", "\n\n", "; nothing\n")),
    ],
)
def test_what_is_too_long_too_deep_or_empty_is_refused(call, place: str, part: str) -> None:
    refused(call, place, part.split(" | "))


@given(st.text() | st.text(alphabet="0123456789.:()[]; \nab/-") | st.text(alphabet="[].=\"'\n0123456789 parmetslbu"))
def test_random_text_is_refused_or_read(text: str) -> None:
    assert error_of(lambda: parse_stn(text)) is not None
    for read in (parse_timed_plan, parse_spec):
        error_of(lambda read=read: read(text))
    for content in (text, f"[parameters.d]\n{text}", f"[parameters.d]\nlb = {text}", f"[parameters]\n{text} = 1"):
        error_of(lambda content=content: parse_parameter_file(content))


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("domian.pddl", ["domian.pddl: found no such file", "did you mean 'domain.pddl'?"]),
        ("zzz", ["zzz: found no such file, expected a readable text file"]),
        ("broken-link", ["broken-link: found a link to a file that does not exist, expected a readable text file"]),
        ("nowhere/zzz", ["nowhere does not exist either"]),
        ("", [": found a directory"]),
        ("zero", ["zero: found binary data, expected a UTF-8 text file"]),
        ("latin", ["latin: found byte 0xff in line 2, expected a UTF-8 text file"]),
        *((name, ["a readable text file"]) for name in ("x" * 5000, "a\0b", "zero/inside", "(define\n(domain d))")),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, name: str, parts: list[str]) -> None:
    for file, data in {"domain.pddl": b"", "zero": b"a\0b", "latin": b"a\nb\xff"}.items():
        (tmp_path / file).write_bytes(data)
    (tmp_path / "broken-link").symlink_to("nowhere.pddl")
    refused(lambda: read_text(tmp_path / name), str(Location(str(tmp_path / name))), parts)


@pytest.mark.parametrize("path", [None, 3, b"domain.pddl", ""])
def test_what_is_no_path(path: object) -> None:
    refused(lambda: read_text(path), f"found {repr(path)!r}, expected the path of a readable text file", [])  # type: ignore[arg-type]


def test_no_permission(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:  # the superuser may read everything
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr("robust.plan.pddl.forms.open", refuse, raising=False)
    refused(lambda: read_text("secret"), "secret: found a file that you may not read", [])


@given(data=st.binary())
def test_random_bytes_are_no_domain(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.pddl"
    path.write_bytes(data)
    assert str(error_of(lambda: parse_domain(read_text(path), str(path)))).startswith(str(path))


def test_nesting_within_the_limit_is_read() -> None:
    text = f"(>= {'(- ' * 110}(total){')' * 110} 1)"
    assert "a" in parse_domain(f"{HEAD}(:action a :precondition {text}))").actions
