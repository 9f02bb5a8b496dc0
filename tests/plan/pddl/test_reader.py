"""Valid texts are read, whatever their layout and dialect; all else is an error with a place, never a traceback."""

import re
from fractions import Fraction
from functools import partial
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError, InputWarning, Location
from robust.plan import load, model, stn
from robust.plan.model import Atom, AtomEffect, Condition, Fluent, Holds, NumericEffect, TimedLiteral, Timing, Truth
from robust.plan.pddl import forms, grounding, reader, syntax
from tests.pddl_text import condition_text
from tests.plan import building
from tests.plan.building import EVERYTHING, TEXTS, TOUR, P, Q, at_least, error_of, number, reference, run

DOMAIN = reader.parse_domain(EVERYTHING, "d.pddl")


def problem_with(init: str, goal: str = "()") -> str:
    return f"(define (problem p) (:domain everything) (:objects r1 - robot a - place) (:init {init}) (:goal {goal}))"


def test_domain_and_problem_whatever_their_case_and_layout() -> None:
    assert (DOMAIN.name, DOMAIN.parameters, DOMAIN.location.line) == ("everything", ("speed",), 2)
    assert DOMAIN.types["robot"] == {"robot", "vehicle", "object"}
    assert DOMAIN.types["cargo"] == {"cargo", "object"}
    assert DOMAIN.constants["hub"].types == ("place",)
    assert [parameter.types for parameter in DOMAIN.predicates["holds"].parameters] == [("robot", "place")]
    assert str(DOMAIN.predicates["at"]) == "(at ?v ?p)"
    assert (list(DOMAIN.functions), DOMAIN.written) == (["charge", "distance", "drag", "total"], {"charge", "total"})
    move, toggle = DOMAIN.actions["move"], DOMAIN.actions["toggle"]
    assert (move.durative, move.synth_parameters, str(move.location)) == (True, ("rate",), "d.pddl:14:3")
    assert (toggle.durative, toggle.synth_parameters) == (False, ())
    assert [parameter.name for parameter in move.parameters] == ["v", "from", "to"]
    bounds = [(bound.timing, bound.comparator) for bound in move.durations]
    assert bounds == [(Timing.AT_START, syntax.Comparator.AT_LEAST), (Timing.AT_END, syntax.Comparator.AT_MOST)]
    timings = [timed.timing.value for timed in move.conditions]
    assert timings == ["at start", "over all", "at end", "at end", "over all"]
    assert {timed.timing for timed in toggle.conditions} == {Timing.AT_START}
    problem = reader.parse_problem(TOUR, DOMAIN)
    assert (problem.name, problem.domain, list(problem.objects)) == ("tour", "everything", ["hub", "r1", "a", "b"])
    assert problem.atoms == {Atom("at", ("r1", "a")), Atom("linked", ("a", "b"))}
    assert problem.fluents[Fluent("total")] == Fraction(-1, 1000)
    assert problem.fluents[Fluent("charge", ("r1",))] == Fraction(21, 2)
    opened, charge = Atom("open", ("a",)), Fluent("charge", ("r1",))
    literals = (Fraction(5), opened, True), (Fraction(6), opened, False), (Fraction(7), charge, Fraction(3))
    assert problem.timed_literals == tuple(TimedLiteral(*literal) for literal in literals)
    squeezed = " ".join(line.partition(";")[0] for line in EVERYTHING.splitlines()).replace(" (", "(")
    spread = EVERYTHING.replace("(", " ( ").replace(")", " )\n")
    for variant in (EVERYTHING.upper(), EVERYTHING.replace("\n", "\r\n"), spread, squeezed):
        assert reader.parse_domain(variant) == DOMAIN
    assert reader.parse_problem(TOUR.upper(), DOMAIN) == reader.parse_problem(TOUR, DOMAIN)
    assert reader.parse_domain(EVERYTHING.replace("1e2", "1e3")) != DOMAIN


@pytest.mark.parametrize("section", (TEXTS / "accepted.txt").read_text(encoding="utf-8").splitlines())
def test_accepted(section: str) -> None:
    before = "(:types t t u) (:predicates (p) (q ?x)) (:functions (f) (g ?x))"
    domain = reader.parse_domain(f"(define (domain d) {before} {section} (:constants x - t))")
    assert list(domain.actions) == (["a"] if "action" in section else [])


def test_numbers_are_exact_and_a_predicate_called_at_is_no_time() -> None:
    for text in ("5", "5.", ".5", "-0.1", "+3", "1e-3", "1.5E+2", "0.1000000000000000000001", "(- 7)"):
        problem = reader.parse_problem(problem_with(f"(= (total) {text})"), DOMAIN)
        assert problem.fluents == {Fluent("total"): Fraction(text.strip("()").replace("- ", "-"))}
    problem = reader.parse_problem(problem_with("(at r1 a) (at 3 (at r1 a))", "(at r1 a)"), DOMAIN)
    place = Atom("at", ("r1", "a"))
    assert (problem.atoms, [literal.target for literal in problem.timed_literals]) == ({place}, [place])
    condition = "(:constants start end) (:predicates (at ?a ?b)) (:action a :precondition (at start end))"
    (timed,) = reader.parse_domain(f"(define (domain d) {condition})").actions["a"].conditions
    assert isinstance(problem.goal, syntax.Proposition)
    assert isinstance(timed.condition, syntax.Proposition)


def test_harmless_repetitions_orders_and_types_that_only_appear_above_others() -> None:
    types = reader.parse_domain("(define (domain d) (:types car - vehicle bus - (either vehicle place)))").types
    assert (types["vehicle"], types["bus"]) == ({"vehicle", "object"}, {"bus", "vehicle", "place", "object"})
    domain = reader.parse_domain("(define (domain d) (:types t t) (:constants a - t) (:predicates (p)))")
    text = "(define (problem p) (:domain d) (:objects a - t) (:init (p) (p)) (:goal (p)) (:length (:serial 5)))"
    problem = reader.parse_problem(text, domain)
    assert (list(problem.objects), problem.atoms) == (["a"], {Atom("p")})
    backwards = "(:action a :precondition (p x)) (:predicates (p ?x - t)) (:constants x - t) (:types t)"
    assert "a" in reader.parse_domain(f"(define (domain d) {backwards})").actions
    for metric in ("total-time", "(total-time)", "(+ (total) (* 2 total-time))"):
        text = problem_with("")[:-1] + f"(:requirements :fluents) (:metric maximize {metric}))"
        assert reader.parse_problem(text, DOMAIN).name == "p"


def test_text_of_files_is_normalised_and_without_comments_valid(tmp_path: Path) -> None:
    domain = reader.parse_domain(" ".join(words(EVERYTHING)))
    problem = reader.parse_problem(" ".join(words(TOUR)), domain)
    assert grounding.ground_action(domain, problem, "n0", "move", ["r1", "a", "b"], True, None).conditions
    assert grounding.ground_goal(domain, problem)
    path = tmp_path / "d.pddl"
    path.write_bytes("\ufeffa\r\nb\rc\né".encode())
    assert forms.read_text(path) == forms.read_text(str(path)) == "a\nb\nc\né"
    path.write_text(EVERYTHING)
    domain = reader.read_domain(path)
    assert (domain, domain.location.file) == (DOMAIN, str(path))
    path.write_text(TOUR)
    assert reader.read_problem(str(path), domain) == reader.parse_problem(TOUR, domain)


def read(domain_text: str, problem_text: str) -> None:
    """Read and ground; an error of the package, in one line, is an answer too."""

    def ground() -> None:
        domain = reader.parse_domain(domain_text)
        problem = reader.parse_problem(problem_text, domain)
        for name, schema in domain.actions.items():
            arguments = ["r1", "a", "b"] if name == "move" else ["a"]
            grounding.ground_action(domain, problem, "n0", name, arguments, schema.durative, None)
        grounding.ground_goal(domain, problem)

    error = error_of(ground)
    assert error is None or "expected" in str(error)


def words(text: str) -> list[str]:
    return re.findall(r"[()]|[^\s()]+", re.sub(";.*", "", text))


@st.composite
def mutations(draw: st.DrawFn, text: str) -> str:
    """The text with a few words deleted, doubled, exchanged or replaced by others of it."""
    tokens = words(text)
    for _ in range(draw(st.integers(1, 3))):
        first, second = (draw(st.integers(0, len(tokens) - 2)) for _ in range(2))
        a, b = tokens[first], tokens[second]
        if draw(st.booleans()):
            tokens[first] = draw(st.sampled_from(["", f"{a} {a}", b]))
        else:
            tokens[first], tokens[second] = b, a
        tokens = words(" ".join(tokens))
    return " ".join(tokens)


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


def test_objects_of_two_types_predicates_split_by_type_and_types_below_two_others() -> None:
    def parsed(domain: str, problem: str, warning: str) -> syntax.Problem:
        text = f"(define (problem p) (:domain d) {problem})"
        with pytest.warns(InputWarning, match=warning):
            return reader.parse_problem(text, reader.parse_domain(f"(define (domain d) {domain})", "d.pddl"), "p.pddl")

    trucks = "(:types truck ship place crate) (:predicates (idle ?t - truck) (in ?x - (either crate place)))"
    both = r"p\.pddl:1:43: found object 'a' with another type, took both; .*d\.pddl:1:"
    idle = "(:objects a - ship) (:init (idle a)) (:goal (idle a))"
    problem = parsed(f"{trucks} (:constants a - truck)", idle, both)
    assert (problem.atoms, set(problem.objects["a"].types)) == ({Atom("idle", ("a",))}, {"truck", "ship"})
    undeclared = "found undeclared predicate 'in_crate', took it for 'in' of type 'crate'"
    problem = parsed(trucks, "(:objects k - crate) (:init (in_crate k)) (:goal (in k))", undeclared)
    assert problem.atoms == {Atom("in", ("k",))}
    second = r"d\.pddl:1:47: found a second, different type 'c', took both"
    two = "(:types a b - object c - a c - b) (:predicates (p ?x - a) (q ?x - b))"
    problem = parsed(two, "(:objects k - c) (:init (p k) (q k)) (:goal (p k))", second)
    assert problem.atoms == {Atom("p", ("k",)), Atom("q", ("k",))}


@pytest.mark.parametrize("word", ["-goods", "-object", "-number"])
def test_a_type_need_not_have_a_blank_before_it(word: str) -> None:
    declared = "(:types goods place - object) (:predicates (at ?g - goods ?p - place)) (:functions (f) - number)"
    text = f"(define (domain d) {declared} (:constants g - goods p - place))".replace(f"- {word[1:]}", word, 1)
    with pytest.warns(InputWarning, match=rf"d\.pddl:1:\d+: found '{word}', took it for '- {word[1:]}'"):
        domain = reader.parse_domain(text, "d.pddl")
    assert [parameter.types for parameter in domain.predicates["at"].parameters] == [("goods",), ("place",)]


SHADOWED = (TEXTS / "shadowed.pddl").read_text(encoding="utf-8")


def test_names_of_an_action_hide_synthesis_parameters_of_the_domain() -> None:
    domain = reader.parse_domain(SHADOWED, "d.pddl")
    text = "(define (problem p) (:domain d) (:objects l - lamp) (:init (= (level) 0)) (:goal (lit l)))"
    steps = "".join(f"action instance {step};" for step in ("a : (outer)", "b : (lamp l)", "c : (own)"))
    plan = stn.parse_stn("parameter s default 1; parameter c.s default 2;" + steps)
    outer, lamp, own = load.assemble(domain, reader.parse_problem(text, domain, "p.pddl"), plan).instances
    assert [str(instance.numeric_effects[0].expression) for instance in (outer, own)] == ["s", "c.s"]
    assert str(lamp.atom_effects[0].atom) == "(lit l)"
    with pytest.raises(InputError, match=r"found '\?s', expected a number; it is a variable for objects"):
        reader.parse_domain(SHADOWED.replace("(lit ?s)", "(assign (level) ?s)"), "d.pddl")


# `=` between names that objects, constants and functions without arguments share: objects come first.
NAMED = """(define (domain d) (:types t) {} (:predicates (p) (of ?x - t)) (:functions (f) (g) (h ?x - t))
 (:action a :parameters (?x - t) :precondition {} :effect (and (of ?x) {})))"""
OBJECTS = (
    "(define (problem x) (:domain d) (:objects {} o - t) (:init (= (f) {}) (= (g) 1) (= (h o) 0)) (:goal (and {})))"
)
PLACES = {
    "condition": {"condition": "{}"},
    "goal": {"goal": "{}"},
    "effect": {"effect": "(when {} (p))", "goal": "(p)"},
    "forall": {"condition": "(forall (?y - t) {})"},
    "exists": {"condition": "(exists (?y - t) (and (= ?y ?x) {}))"},
}
AS_NUMBERS = {"(= (f) (g))": None, "(= f (g))": None, "(= (f) g)": None}
AS_OBJECTS = {"(= f g)": False, "(= f f)": True, "(not (= f g))": True, **AS_NUMBERS}


def named(condition="()", effect="", goal="", objects="f g", constants="", f=1):
    domain = reader.parse_domain(NAMED.format(constants, condition, effect))
    problem = reader.parse_problem(OBJECTS.format(objects, f, goal), domain)
    return load.assemble(domain, problem, stn.parse_stn("action instance n : (a o);"))


@pytest.mark.parametrize(
    ("objects", "constants", "texts"),
    [
        ("f g", "", AS_OBJECTS),
        ("", "(:constants f g - t)", AS_OBJECTS),
        ("g", "(:constants f - t)", AS_OBJECTS),
        ("f", "(:constants g - t)", AS_OBJECTS),
        *((objects, "", dict.fromkeys(["(= f g)", "(= f 1)", "(= 1 f)"])) for objects in ("", "f", "g")),
    ],
)
@pytest.mark.parametrize("place", PLACES)
def test_equality_of_names(place: str, objects: str, constants: str, texts: dict[str, bool | None]) -> None:
    """Of objects only where both are, else of numbers: true if f is 1."""
    for (text, truth), f in product(texts.items(), (1, 2)):
        parts = {part: frame.format(text) for part, frame in PLACES[place].items()}
        simulation = run(named(**parts, objects=objects, constants=constants, f=f), {"n": 1})
        assert simulation.valid == (f == 1 if truth is None else truth), text


def test_other_comparisons_and_effects_are_about_numbers_and_goals_are_named_as_written() -> None:
    plan = named("(and (>= f g) (<= (h ?x) f))", "(assign f (+ f g)) (when (= f g) (increase g f))", "(= (f) 2)")
    assert run(plan, {"n": 1}).valid
    (instance,) = plan.instances
    assert [str(effect.fluent) for effect in instance.numeric_effects] == ["(f)"], "f and g are two objects"
    assert list(instance.mentioned()) == []
    goals = named(goal="(= f g) (= (f) (g))", objects="").goal
    assert [goal.label for goal in goals] == ["goal: (= f g)", "goal: (= (f) (g))"]


GIVEN = reader.parse_domain(EVERYTHING)
TO_SOLVE = reader.parse_problem(TOUR, GIVEN)
PLACE = Location("plan.stn", 3, 1)
GROUPS = building.groups(building.TEXTS / "grounding.txt")
INCREASE = model.AssignmentKind.INCREASE
TOTAL, CHARGE = Fluent("total"), Fluent("charge", ("r1",))


def ground(body: str, *, durative: bool = False, init: str = "", **options: object) -> model.ActionInstance:
    """The only instance of an action with that body; objects are a, b of type t and c of type u."""
    kind = ":durative-action" if durative else ":action"
    domain = reader.parse_domain(
        "(define (domain d) (:types t u) (:constants a b - t c - u) (:predicates (p) (q) (r ?x))"
        "(:functions (f) (g) (h ?x) (k))"
        f"(:synth-parameters ?s) (:action other :effect (increase (k) 1)) ({kind} act {body}))"
    )
    problem = reader.parse_problem(f"(define (problem x) (:domain d) (:init (= (g) 4) {init}) (:goal ()))", domain)
    arguments = ["a"] if ":parameters (?x" in body else []
    return grounding.ground_action(domain, problem, "n1", "act", arguments, durative, PLACE, **options)


def precondition(text: str) -> list[tuple[Condition, str]]:
    instance = ground(f":precondition {text}")
    assert {timed.timing for timed in instance.conditions} <= {Timing.AT_START}
    return [(timed.condition, timed.text) for timed in instance.conditions]


def rows(group: str) -> list[list[str]]:
    return [row.split(" => ") for row in GROUPS[group].splitlines()]


def test_conjuncts_are_apart_and_have_their_text() -> None:
    conjunction = "(and (P) (and (NOT (q)) (forall (?x - T) (or (r ?x) (> (h ?x) .5)))) (P) (forall (?x) (p)))"
    each = "(or (r a) (> (h a) .5))", "(or (r b) (> (h b) .5))"
    assert [text for _, text in precondition(conjunction)] == ["(p)", "(not (q))", *each]
    nested = "(imply (p) (exists (?y - t) (forall (?z ?y - (either t u)) (not (= ?y ?z)))))"
    written, level = nested.replace("?z ?y - ", "?z - (either t u) ?y - "), "(>= (- (f)) (/ ?s 2))"
    assert [text for _, text in precondition(f"(and {nested} {level})")] == [written, level]


def test_durative_action() -> None:
    move = grounding.ground_action(GIVEN, TO_SOLVE, "n0", "MOVE", ["R1", "A", "b"], True, PLACE)
    assert (str(move), move.identifier, move.durative, move.location) == ("(move r1 a b)", "n0", True, PLACE)
    least = at_least(building.DURATION, building.value(Fluent("distance", ("a", "b"))).scaled(Fraction(1, 2)))
    most = at_least(reference("speed") + 100, building.DURATION)
    assert [(bound.timing, bound.text, bound.condition) for bound in move.durations] == [
        (Timing.AT_START, "(>= ?duration (/ (distance a b) (drag)))", least),
        (Timing.AT_END, "(<= ?duration (+ 1e2 ?speed))", most),
    ]
    by_text = {timed.text: timed for timed in move.conditions}
    level = by_text["(>= (charge r1) (* ?duration ?rate))"]
    expected = at_least(building.value(CHARGE), building.DURATION * reference("n0.rate"))
    assert (level.timing, level.condition) == (Timing.OVER_ALL, expected)
    assert "(not (= a b))" not in by_text
    at_end = [timed.text for timed in move.conditions if timed.timing is Timing.AT_END]
    assert at_end[:3] == ["(open hub)", "(open a)", "(open b)"]
    flows = building.flow(CHARGE, reference("n0.rate").scaled(Fraction(-1, 2))), building.flow(TOTAL, 1)
    assert move.continuous_effects == flows
    busy, hub = Holds(Atom("busy")), Atom("open", ("hub",))
    at_end = NumericEffect(Timing.AT_END, TOTAL, INCREASE, building.DURATION, busy)
    assert move.numeric_effects == (NumericEffect(Timing.AT_START, TOTAL, INCREASE, number(-3)), at_end)
    assert set(move.atom_effects) >= {
        AtomEffect(Timing.AT_START, Atom("at", ("r1", "a")), False),
        AtomEffect(Timing.AT_START, hub, False, Holds(hub)),
        AtomEffect(Timing.AT_END, busy.atom, False, busy),
    }


def numeric(text: str) -> str:
    (effect,) = ground(f":effect {text}", init="(= (h a) 2) (at 4 (= (h b) 1))").numeric_effects
    assert (effect.timing, effect.fluent, effect.condition) == (Timing.AT_START, Fluent("f"), Truth(True))
    return f"{effect.operator.value} {effect.expression}"


def rate(text: str) -> str:
    (effect,) = ground(f":duration () :effect {text}", durative=True).continuous_effects
    assert effect.fluent == Fluent("f")
    return str(effect.rate)


READINGS = {
    "conditions": lambda text: " and ".join(condition_text(part) for part, _ in precondition(text)) or "nothing",
    "numeric effects": numeric,
    "rates": rate,
    "fluents read": lambda body: grounding.fluents_read(ground(body, durative=True)),
}


@pytest.mark.parametrize(("group", "text", "expected"), [(group, *row) for group in READINGS for row in rows(group)])
def test_what_is_read(group: str, text: str, expected: str) -> None:
    if group == "fluents read":
        expected = {Fluent(name) for name in expected.split() if name != "nothing"}
    assert READINGS[group](text) == expected


def test_conditional_quantified_and_repeated_effects() -> None:
    nested = "(forall (?x - t) (when (and (r ?x) (not (= ?x b))) (when (p) (and (q) (increase (h ?x) 1)))))"
    instance, of_a = ground(f":effect {nested}"), Holds(Atom("r", ("a",)))
    guard = model.And((Holds(P), of_a)), model.And((of_a, Holds(P)))
    assert [(effect.atom, effect.condition in guard) for effect in instance.atom_effects] == [(Q, True)]
    assert [effect.fluent for effect in instance.numeric_effects] == [Fluent("h", ("a",))]
    assert ground(":effect (when (= a b) (q))").atom_effects == ()
    assert ground(":effect (when (= a a) (q))").atom_effects == (AtomEffect(Timing.AT_START, Q, True),)
    assert len(ground(":effect (and (p) (p) (not (q)))").atom_effects) == 2
    assert len(ground(":effect (forall (?x) (increase (f) 1))").numeric_effects) == 3, "equal increases add up"
    assert len(ground(":effect (and (when (p) (assign (f) 1)) (when (q) (assign (f) 2)))").numeric_effects) == 2


@pytest.mark.parametrize(("text", "culprit"), rows("divisions by what may change"))
def test_division_by_what_may_change(text: str, culprit: str) -> None:
    """A second name after the culprit's is that of a fluent whose initial value is a parameter."""
    parts = [f"non-linear because {culprit.removesuffix(' g')} may vary", "expected a divisor that no action"]
    parametrized = {Fluent("g")} if culprit.endswith(" g") else set()
    call = partial(ground, f":effect {text}", init="(= (h a) 2) (at 4 (= (h a) 1))", parametrized=parametrized)
    building.refused(call, "<domain>:1:", parts, exit_code=4)


@pytest.mark.parametrize(("action", "message"), [*rows("refused effects"), *rows("refused instances")])
def test_what_is_refused(action: str, message: str) -> None:
    if action[0] == "(":
        building.refused(lambda: ground(f":effect {action}"), "<domain>:1:", [message])
        return
    name, *arguments, kind = action.split()
    call = partial(grounding.ground_action, GIVEN, TO_SOLVE, "n0", name, arguments, kind == "durative", PLACE)
    building.refused(call, "plan.stn:3:1: found ", [message])


def test_goal() -> None:
    goal = grounding.ground_goal(GIVEN, TO_SOLVE)
    assert [(part.condition, part.text) for part in goal] == [
        (Holds(Atom("at", ("r1", "b"))), "(at r1 b)"),
        (at_least(building.value(CHARGE), reference("speed")), "(>= (charge r1) ?speed)"),
    ]
    assert goal[0].label == "goal: (at r1 b)"


@pytest.mark.parametrize("opening", ["(not ", "(and ", "(or (q) ", "(imply (q) ", "(forall (?y) ", "(exists (?y - u) "])
def test_deep_conditions_are_ground(opening: str) -> None:
    levels = 100 if opening != "(forall (?y) " else 5  # three objects: 3⁵ copies
    for condition, _ in precondition(opening * levels + "(p)" + ")" * levels):
        assert Holds(P) in (condition, *getattr(condition, "operands", ()))
    guarded = ground(":effect " + "(when (p) " * 100 + "(q)" + ")" * 100).atom_effects
    assert guarded == (AtomEffect(Timing.AT_START, Q, True, Holds(P)),)
