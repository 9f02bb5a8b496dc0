"""Ways of writing PDDL that others read: what they are taken for, and what is said about it."""

import pytest

from robust.errors import InputError, InputWarning
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn

DOMAIN = (
    "(define (domain d) (:types truck ship place crate) (:predicates (idle ?t - truck) (in ?x - (either crate place)))"
)


def test_objects_declared_twice_are_of_both_types():
    domain = parse_domain(DOMAIN + "(:constants a - truck))", "d.pddl")
    text = "(define (problem p) (:domain d) (:objects a - ship) (:init (idle a)) (:goal (idle a)))"
    with pytest.warns(InputWarning, match=r"p\.pddl:1:43: found object 'a' with another type, took both; .*d\.pddl:1:"):
        problem = parse_problem(text, domain, "p.pddl")
    assert set(problem.objects["a"].types) == {"truck", "ship"}


def test_types_declared_twice_are_below_both():
    text = (
        "(define (domain d) (:types a b - object c - a c - b) (:predicates (p ?x - a) (q ?x - b)) (:constants k - c))"
    )
    with pytest.warns(InputWarning, match=r"d\.pddl:1:47: found a second, different type 'c', took both"):
        domain = parse_domain(text, "d.pddl")
    problem = "(define (problem p) (:domain d) (:init (p k) (q k)) (:goal (p k)))"
    assert len(parse_problem(problem, domain, "p.pddl").atoms) == 2


def test_predicates_that_are_split_by_type_are_the_one_that_is_declared():
    text = "(define (problem p) (:domain d) (:objects k - crate) (:init (in_crate k)) (:goal (in k)))"
    with pytest.warns(InputWarning, match="found undeclared predicate 'in_crate', took it for 'in' of type 'crate'"):
        problem = parse_problem(text, parse_domain(DOMAIN + ")", "d.pddl"), "p.pddl")
    (atom,) = problem.atoms
    assert str(atom) == "(in k)"


@pytest.mark.parametrize(
    ("written", "found"),
    [
        ("(:types goods place) (:predicates (at ?g -goods ?p - place))", "-goods"),
        ("(:types goods place -object) (:predicates (at ?g - goods ?p - place))", "-object"),
        ("(:types goods place) (:predicates (at ?g - goods ?p - place)) (:functions (f) -number)", "-number"),
    ],
)
def test_a_type_need_not_have_a_blank_before_it(written, found):
    text = f"(define (domain d) {written} (:constants g - goods p - place))"
    with pytest.warns(InputWarning, match=rf"d\.pddl:1:\d+: found '{found}', took it for '- {found[1:]}'"):
        domain = parse_domain(text, "d.pddl")
    assert [one.types for one in domain.predicates["at"].parameters] == [("goods",), ("place",)]


SHADOWED = """(define (domain d) (:types lamp) (:predicates (lit ?l - lamp)) (:functions (level)) (:synth-parameters ?s)
 (:action outer :effect (assign (level) ?s))
 (:action lamp :parameters (?s - lamp) :effect (lit ?s))
 (:action own :synth-parameters (?s) :effect (assign (level) ?s)))"""


def test_names_of_an_action_hide_synthesis_parameters_of_the_domain():
    domain = parse_domain(SHADOWED, "d.pddl")
    text = "(define (problem p) (:domain d) (:objects l - lamp) (:init (= (level) 0)) (:goal (lit l)))"
    plan = parse_stn(
        "parameter s default 1; parameter c.s default 2; action instance a : (outer);"
        "action instance b : (lamp l); action instance c : (own);"
    )
    found = assemble(domain, parse_problem(text, domain, "p.pddl"), plan)
    outer, lamp, own = found.instances
    assert [str(one.numeric_effects[0].expression) for one in (outer, own)] == ["s", "c.s"]
    assert str(lamp.atom_effects[0].atom) == "(lit l)"
    with pytest.raises(InputError, match=r"found '\?s', expected a number; it is a variable for objects"):
        parse_domain(SHADOWED.replace("(lit ?s)", "(assign (level) ?s)"), "d.pddl")
