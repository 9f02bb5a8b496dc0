"""Valid texts are read, whatever their layout; whatever else a file has is an error with a place, never a traceback."""

import os
import re
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import Location
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.grounding import ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.syntax import Comparator, Proposition
from tests.plan.building import EVERYTHING, TOUR, error_of, refused


def with_section(section: str) -> str:
    return f"(define (domain d) (:types t u) (:predicates (p) (q ?x)) (:functions (f) (g ?x)) {section})"


def problem_with(init: str, goal: str = "()") -> str:
    return f"(define (problem p) (:domain everything) (:objects r1 - robot a - place) (:init {init}) (:goal {goal}))"


def test_declarations() -> None:
    domain = parse_domain(EVERYTHING)
    assert (domain.name, domain.parameters, domain.location.line) == ("everything", ("speed",), 2)
    assert domain.types["robot"] == {"robot", "vehicle", "object"}
    assert domain.types["cargo"] == {"cargo", "object"}
    assert domain.constants["hub"].types == ("place",)
    assert [parameter.types for parameter in domain.predicates["holds"].parameters] == [("robot", "place")]
    assert str(domain.predicates["at"]) == "(at ?v ?p)"
    assert (list(domain.functions), domain.written) == (["charge", "distance", "drag", "total"], {"charge", "total"})


def test_actions() -> None:
    actions = parse_domain(EVERYTHING, "d.pddl").actions
    move, toggle = actions["move"], actions["toggle"]
    assert (move.durative, move.synth_parameters, toggle.durative, toggle.synth_parameters) == (
        True,
        ("rate",),
        False,
        (),
    )
    assert ([parameter.name for parameter in move.parameters], str(move.location)) == (
        ["v", "from", "to"],
        "d.pddl:14:3",
    )
    bounds = [(bound.timing, bound.comparator) for bound in move.durations]
    assert bounds == [(Timing.AT_START, Comparator.AT_LEAST), (Timing.AT_END, Comparator.AT_MOST)]
    timings = [timed.timing.value for timed in move.conditions]
    assert timings == ["at start", "over all", "at end", "at end", "over all"]
    assert {timed.timing for timed in toggle.conditions} == {Timing.AT_START}


def test_problem() -> None:
    problem = parse_problem(TOUR, parse_domain(EVERYTHING))
    assert (problem.name, problem.domain, list(problem.objects)) == ("tour", "everything", ["hub", "r1", "a", "b"])
    assert problem.atoms == {Atom("at", ("r1", "a")), Atom("linked", ("a", "b"))}
    assert problem.fluents[Fluent("total")] == Fraction(-1, 1000)
    assert problem.fluents[Fluent("charge", ("r1",))] == Fraction(21, 2)
    opened, charge = Atom("open", ("a",)), Fluent("charge", ("r1",))
    literals = (Fraction(5), opened, True), (Fraction(6), opened, False), (Fraction(7), charge, Fraction(3))
    assert problem.timed_literals == tuple(TimedLiteral(*one) for one in literals)


def test_case_and_layout_do_not_matter() -> None:
    domain = parse_domain(EVERYTHING)
    squeezed = " ".join(line.partition(";")[0] for line in EVERYTHING.splitlines()).replace(" (", "(")
    spread = EVERYTHING.replace("(", " ( ").replace(")", " )\n")
    for variant in (EVERYTHING.upper(), EVERYTHING.replace("\n", "\r\n"), spread, squeezed):
        assert parse_domain(variant) == domain
    assert parse_problem(TOUR.upper(), domain) == parse_problem(TOUR, domain)
    assert parse_domain(EVERYTHING.replace("1e2", "1e3")) != domain


@pytest.mark.parametrize("text", ["5", "5.", ".5", "-0.1", "+3", "1e-3", "1.5E+2", "0.1000000000000000000001", "(- 7)"])
def test_numbers_are_exact(text: str) -> None:
    problem = parse_problem(problem_with(f"(= (total) {text})"), parse_domain(EVERYTHING))
    assert problem.fluents == {Fluent("total"): Fraction(text.strip("()").replace("- ", "-"))}


@pytest.mark.parametrize(
    "section",
    [
        "(:requirements)",
        "(:requirements :strips :time :continuous-effects :timed-initial-literals :adl :negative-preconditions)",
        "(:requirements :duration-inequalities :numeric-fluents :preferences :object-fluents :derived-predicates)",
        "(:action a)",
        "(:action a :parameters () :precondition () :effect ())",
        "(:action a :parameters (?x ?y - (either t u) ?z) :effect (q ?y))",
        "(:action a :effect (and))",
        "(:action a :precondition (and (or) (and) (exists () (p))))",
        "(:action a :parameters (?x) :precondition (forall (?x - t) (exists (?x - u) (q ?x))))",
        "(:action a :synth-parameters ?s ?r - number :effect (increase (f) (* ?s ?r)))",
        "(:action a (:synth-parameters ?s) :effect (increase f ?s))",
        "(:action a :precondition (>=(f)-1))",
        "(:action a :parameters (?x) :precondition (>(g ?x)(-(f))))",
        "(:durative-action a :duration())",
        "(:durative-action a :duration (=?duration 5))",
        "(:durative-action a :duration (and) :condition () :effect ())",
        "(:durative-action a :duration (at start (and (>= ?duration 1) (<= ?duration ?duration))))",
        "(:durative-action a :duration () :condition (forall (?x) (and (at start (q ?x)) (over all (q ?x)))))",
        "(:durative-action a :duration () :effect (when (and) (at start (p))))",
        "(:durative-action a :duration () :effect (when (and (at end (p)) (at end (q x))) (at end (not (p)))))",
    ],
)
def test_accepted(section: str) -> None:
    domain = parse_domain(with_section(section + " (:constants x - t)"))
    assert list(domain.actions) == (["a"] if "action" in section else [])


def test_predicate_called_at_is_no_time() -> None:
    problem = parse_problem(problem_with("(at r1 a) (at 3 (at r1 a))", "(at r1 a)"), parse_domain(EVERYTHING))
    place = Atom("at", ("r1", "a"))
    assert (problem.atoms, [literal.target for literal in problem.timed_literals]) == ({place}, [place])
    condition = "(:constants start end) (:predicates (at ?a ?b)) (:action a :precondition (at start end))"
    (timed,) = parse_domain(f"(define (domain d) {condition})").actions["a"].conditions
    assert isinstance(problem.goal, Proposition)
    assert isinstance(timed.condition, Proposition)


def test_types_that_only_appear_above_others_are_declared() -> None:
    types = parse_domain("(define (domain d) (:types car - vehicle bus - (either vehicle place)))").types
    assert (types["vehicle"], types["bus"]) == ({"vehicle", "object"}, {"bus", "vehicle", "place", "object"})


def test_harmless_repetitions_and_orders() -> None:
    domain = parse_domain("(define (domain d) (:types t t) (:constants a - t) (:predicates (p)))")
    text = "(define (problem p) (:domain d) (:objects a - t) (:init (p) (p)) (:goal (p)) (:length (:serial 5)))"
    problem = parse_problem(text, domain)
    assert (list(problem.objects), problem.atoms) == (["a"], {Atom("p")})
    backwards = "(:action a :precondition (p x)) (:predicates (p ?x - t)) (:constants x - t) (:types t)"
    assert "a" in parse_domain(f"(define (domain d) {backwards})").actions
    for metric in ("total-time", "(total-time)", "(+ (total) (* 2 total-time))"):
        text = problem_with("")[:-1] + f"(:requirements :fluents) (:metric maximize {metric}))"
        assert parse_problem(text, parse_domain(EVERYTHING)).name == "p"


def test_text_of_files_is_normalised(tmp_path: Path) -> None:
    path = tmp_path / "d.pddl"
    path.write_bytes("\ufeffa\r\nb\rc\né".encode())
    assert read_text(path) == read_text(str(path)) == "a\nb\nc\né"
    path.write_text(EVERYTHING)
    domain = read_domain(path)
    assert (domain, domain.location.file) == (parse_domain(EVERYTHING), str(path))
    path.write_text(TOUR)
    assert read_problem(str(path), domain) == parse_problem(TOUR, domain)


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
        *(
            (name, ["expected a readable text file"])
            for name in ("x" * 5000, "a\0b", "zero/inside", "(define\n(domain d))")
        ),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, name: str, parts: list[str]) -> None:
    for file, data in {"domain.pddl": b"", "zero": b"a\0b", "latin": b"a\nb\xff"}.items():
        (tmp_path / file).write_bytes(data)
    (tmp_path / "broken-link").symlink_to("nowhere.pddl")
    refused(lambda: read_text(tmp_path / name), str(Location(str(tmp_path / name))), parts)


@pytest.mark.parametrize("found", [None, 3, b"domain.pddl", ""])
def test_what_is_no_path(found: object) -> None:
    refused(lambda: read_text(found), f"found {repr(found)!r}, expected the path of a readable text file", [])  # type: ignore[arg-type]


def test_no_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:  # the superuser may read everything
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr("robust.plan.pddl.forms.open", refuse, raising=False)
    refused(lambda: read_text("secret"), "secret: found a file that you may not read", [])


TOKENS = re.compile(r"[()]|[^\s()]+")


def read(domain_text: str, problem_text: str) -> None:
    """Read and ground; an error of the package, in one line, is an answer too."""

    def run() -> None:
        domain = parse_domain(domain_text)
        problem = parse_problem(problem_text, domain)
        for name, schema in domain.actions.items():
            arguments = ["r1", "a", "b"] if name == "move" else ["a"]
            ground_action(domain, problem, "n0", name, arguments, schema.durative, None)
        ground_goal(domain, problem)

    error = error_of(run)
    assert error is None or "expected" in str(error)


def words(text: str) -> list[str]:
    return TOKENS.findall(re.sub(";.*", "", text))


@st.composite
def mutations(draw: st.DrawFn, text: str) -> str:
    """The text with a few words deleted, doubled, exchanged or replaced by others of it."""
    tokens = words(text)
    for _ in range(draw(st.integers(1, 3))):
        first, second = (draw(st.integers(0, len(tokens) - 2)) for _ in range(2))
        a, b = tokens[first], tokens[second]
        kinds = (
            {first: st.sampled_from(["", f"{a} {a}", b])}
            if draw(st.booleans())
            else {first: st.just(b), second: st.just(a)}
        )
        for place, new in kinds.items():
            tokens[place] = draw(new)
        tokens = words(" ".join(tokens))
    return " ".join(tokens)


def test_the_unchanged_texts_are_valid() -> None:
    domain = parse_domain(" ".join(words(EVERYTHING)))
    problem = parse_problem(" ".join(words(TOUR)), domain)
    assert ground_action(domain, problem, "n0", "move", ["r1", "a", "b"], True, None).conditions
    assert ground_goal(domain, problem)


@given(mutations(EVERYTHING), mutations(TOUR), st.integers(0, len(EVERYTHING)), st.integers(0, len(TOUR)))
def test_mutated_and_truncated_texts(domain: str, problem: str, domain_length: int, problem_length: int) -> None:
    for text in (domain, EVERYTHING[:domain_length]):
        read(text, TOUR)
    for text in (problem, TOUR[:problem_length]):
        read(EVERYTHING, text)


@given(st.text(), st.lists(st.sampled_from(sorted(set(words(EVERYTHING + TOUR)))), max_size=40))
def test_random_text(text: str, tokens: list[str]) -> None:
    read(text, text)
    for inside in (text, " ".join(tokens)):
        read(f"(define (domain everything) {inside})", TOUR)
        read(EVERYTHING, inside)
        read(EVERYTHING, f"(define (problem p) (:domain everything) (:init {inside}) (:goal {inside}))")


@given(data=st.binary())
def test_random_bytes(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.pddl"
    path.write_bytes(data)
    # No random bytes are a domain.
    assert str(error_of(lambda: parse_domain(read_text(path), str(path)))).startswith(str(path))
