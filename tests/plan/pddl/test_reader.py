"""Valid texts are read, whatever their layout; what they say is in the syntax tree."""

from fractions import Fraction

import pytest

from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.syntax import Comparator, ContinuousUpdate, Number, Proposition, Update
from tests.plan.pddl.sources import DOMAIN, PROBLEM


def with_section(section: str) -> str:
    return f"(define (domain d) (:types t u) (:predicates (p) (q ?x)) (:functions (f) (g ?x)) {section})"


def problem_with(init: str, goal: str = "()") -> str:
    return f"(define (problem p) (:domain everything) (:objects r1 - robot a - place) (:init {init}) (:goal {goal}))"


def test_declarations() -> None:
    domain = parse_domain(DOMAIN)
    assert domain.name == "everything"
    assert domain.parameters == ("speed",)
    assert domain.types["robot"] == {"robot", "vehicle", "object"}
    assert domain.types["cargo"] == {"cargo", "object"}
    assert domain.constants["hub"].types == ("place",)
    assert [parameter.types for parameter in domain.predicates["holds"].parameters] == [("robot", "place")]
    assert str(domain.predicates["at"]) == "(at ?v ?p)"
    assert list(domain.functions) == ["charge", "distance", "drag", "total"]
    assert domain.written == {"charge", "total"}
    assert domain.location.line == 2


def test_actions() -> None:
    actions = parse_domain(DOMAIN, "d.pddl").actions
    move, toggle = actions["move"], actions["toggle"]
    assert (move.durative, toggle.durative) == (True, False)
    assert [parameter.name for parameter in move.parameters] == ["v", "from", "to"]
    assert (move.synth_parameters, toggle.synth_parameters) == (("rate",), ())
    assert str(move.location) == "d.pddl:14:3"
    assert [(bound.timing, bound.comparator) for bound in move.durations] == [
        (Timing.AT_START, Comparator.AT_LEAST),
        (Timing.AT_END, Comparator.AT_MOST),
    ]
    timings = [timed.timing.value for timed in move.conditions]
    assert timings == ["at start", "over all", "at end", "at end", "over all"]
    assert {timed.timing for timed in toggle.conditions} == {Timing.AT_START}


def test_problem() -> None:
    problem = parse_problem(PROBLEM, parse_domain(DOMAIN))
    assert (problem.name, problem.domain) == ("tour", "everything")
    assert list(problem.objects) == ["hub", "r1", "a", "b"]
    assert problem.atoms == {Atom("at", ("r1", "a")), Atom("linked", ("a", "b"))}
    assert problem.fluents[Fluent("total")] == Fraction(-1, 1000)
    assert problem.fluents[Fluent("charge", ("r1",))] == Fraction(21, 2)
    assert problem.timed_literals == (
        TimedLiteral(Fraction(5), Atom("open", ("a",)), value=True),
        TimedLiteral(Fraction(6), Atom("open", ("a",)), value=False),
        TimedLiteral(Fraction(7), Fluent("charge", ("r1",)), value=Fraction(3)),
    )


def test_case_and_layout_do_not_matter() -> None:
    domain = parse_domain(DOMAIN)
    squeezed = " ".join(line.partition(";")[0] for line in DOMAIN.splitlines()).replace(" (", "(")
    for variant in (
        DOMAIN.upper(),
        DOMAIN.replace("\n", "\r\n"),
        DOMAIN.replace("(", " ( ").replace(")", " )\n"),
        squeezed,
    ):
        assert parse_domain(variant) == domain
    assert parse_problem(PROBLEM.upper(), domain) == parse_problem(PROBLEM, domain)
    assert parse_domain(DOMAIN.replace("1e2", "1e3")) != domain


def test_files(tmp_path) -> None:
    (tmp_path / "d.pddl").write_bytes(b"\xef\xbb\xbf" + DOMAIN.replace("\n", "\r\n").encode())
    (tmp_path / "p.pddl").write_text(PROBLEM)
    domain = read_domain(tmp_path / "d.pddl")
    assert domain == parse_domain(DOMAIN)
    assert domain.location.file == str(tmp_path / "d.pddl")
    assert read_problem(str(tmp_path / "p.pddl"), domain) == parse_problem(PROBLEM, domain)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5", Fraction(5)),
        ("5.", Fraction(5)),
        (".5", Fraction(1, 2)),
        ("-0.1", Fraction(-1, 10)),
        ("+3", Fraction(3)),
        ("1e-3", Fraction(1, 1000)),
        ("1.5E+2", Fraction(150)),
        ("0.1000000000000000000001", Fraction("0.1000000000000000000001")),
        ("(- 7)", Fraction(-7)),
    ],
)
def test_numbers_are_exact(text: str, value: Fraction) -> None:
    problem = parse_problem(problem_with(f"(= (total) {text})"), parse_domain(DOMAIN))
    assert problem.fluents == {Fluent("total"): value}


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


@pytest.mark.parametrize(
    ("effect", "rate"),
    [
        ("(increase (f) #t)", "1"),
        ("(increase (f) (* #t 2))", "2"),
        ("(decrease (f) (* 2 #t))", "2"),
        ("(increase (f) (* 1 #t))", "1"),
        ("(over all (p))", None),
    ],
)
def test_continuous_effects(effect: str, rate: str | None) -> None:
    part = ":condition" if rate is None else ":effect"
    schema = parse_domain(with_section(f"(:durative-action a :duration () {part} {effect})")).actions["a"]
    found = [one for one in schema.effects if isinstance(one, ContinuousUpdate)]
    assert [one.rate.text for one in found if isinstance(one.rate, Number)] == ([] if rate is None else [rate])
    assert all(one.update is (Update.DECREASE if "decrease" in effect else Update.INCREASE) for one in found)


def test_predicate_called_at_is_no_time() -> None:
    domain = parse_domain(DOMAIN)
    problem = parse_problem(problem_with("(at r1 a) (at 3 (at r1 a))", "(at r1 a)"), domain)
    assert problem.atoms == {Atom("at", ("r1", "a"))}
    assert [literal.target for literal in problem.timed_literals] == [Atom("at", ("r1", "a"))]
    assert isinstance(problem.goal, Proposition)
    text = (
        "(define (domain d) (:constants start end) (:predicates (at ?a ?b)) (:action a :precondition (at start end)))"
    )
    assert isinstance(parse_domain(text).actions["a"].conditions[0].condition, Proposition)


def test_type_that_only_appears_above_others_is_declared() -> None:
    domain = parse_domain("(define (domain d) (:types car - vehicle bus - (either vehicle place)))")
    assert domain.types["vehicle"] == {"vehicle", "object"}
    assert domain.types["bus"] == {"bus", "vehicle", "place", "object"}


def test_harmless_repetitions() -> None:
    domain = parse_domain("(define (domain d) (:types t t) (:constants a - t) (:predicates (p)))")
    text = "(define (problem p) (:domain d) (:objects a - t) (:init (p) (p)) (:goal (p)) (:length (:serial 5)))"
    problem = parse_problem(text, domain)
    assert (list(problem.objects), problem.atoms) == (["a"], {Atom("p")})


def test_declarations_may_follow_their_use() -> None:
    domain = parse_domain(
        "(define (domain d) (:action a :precondition (p x)) (:predicates (p ?x - t)) (:constants x - t) (:types t))"
    )
    assert "a" in domain.actions


@pytest.mark.parametrize(
    ("metric", "section"),
    [("total-time", ""), ("(total-time)", ""), ("(+ (total) (* 2 total-time))", "(:requirements :fluents)")],
)
def test_metric_is_accepted(metric: str, section: str) -> None:
    text = problem_with("")[:-1] + f"{section} (:metric maximize {metric}))"
    assert parse_problem(text, parse_domain(DOMAIN)).name == "p"
