"""Ways of writing PDDL that others read: what they are taken for, and what is said about it."""

import pytest

from robust.errors import InputWarning
from robust.plan.pddl.reader import parse_domain, parse_problem

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
