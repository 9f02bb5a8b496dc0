"""`=` between names that objects, constants and functions without arguments share: terms come first."""

from __future__ import annotations

import pytest

from robust.api import check
from robust.irr.check import Answer
from robust.plan import model
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn
from tests.encode.asking import refuted

FIRST, SECOND = "(= f g)", "(= (f) (g))"
DOMAIN = """(define (domain d) (:types t) {} (:predicates (p) (of ?x - t)) (:functions (f) (g) (h ?x - t))
 (:action a :parameters (?x - t) :precondition {} :effect (and (of ?x) {})))"""
PROBLEM = """(define (problem x) (:domain d) (:objects {} o - t)
 (:init (= (f) {}) (= (g) 1) (= (h o) 0)) (:goal (and (of o) {})))"""
STEPS = "action instance n0 : (a o);\nc: n0 - .zero in [1, 2];\n"


def plan(
    condition: str = "()", effect: str = "", goal: str = "", objects: str = "f g", constants: str = "", f: int = 1
) -> model.ParametrizedPlan:
    domain = parse_domain(DOMAIN.format(constants, condition, effect))
    return assemble(domain, parse_problem(PROBLEM.format(objects, f, goal), domain), parse_stn(STEPS))


def holds(text: str, place: str, objects: str, constants: str, f: int) -> bool:
    """Whether a condition holds."""
    texts = {
        "condition": {"condition": text},
        "goal": {"goal": text},
        "effect": {"effect": f"(when {text} (p))", "goal": "(p)"},
        "forall": {"condition": f"(forall (?y - t) {text})"},
        "exists": {"condition": f"(exists (?y - t) (and (= ?y ?x) {text}))"},
    }[place]
    return check(plan(**texts, objects=objects, constants=constants, f=f)).answer is Answer.PROVED


@pytest.mark.parametrize("place", ["condition", "goal", "effect", "forall", "exists"])
@pytest.mark.parametrize(
    ("objects", "constants"),
    [("f g", ""), ("", "(:constants f g - t)"), ("g", "(:constants f - t)"), ("f", "(:constants g - t)")],
)
def test_names_of_objects_are_objects(place: str, objects: str, constants: str) -> None:
    for f in (1, 2):
        assert not holds("(= f g)", place, objects, constants, f)
        assert holds("(= f f)", place, objects, constants, f)
        assert holds("(not (= f g))", place, objects, constants, f)
        assert holds("(= (f) (g))", place, objects, constants, f) == (f == 1)
        assert holds("(= f (g))", place, objects, constants, f) == (f == 1)
        assert holds("(= (f) g)", place, objects, constants, f) == (f == 1)


@pytest.mark.parametrize("place", ["condition", "goal", "effect", "forall", "exists"])
@pytest.mark.parametrize("objects", ["", "f", "g"])
def test_other_names_are_numbers(place: str, objects: str) -> None:
    for f in (1, 2):
        assert holds("(= f g)", place, objects, "", f) == (f == 1)
        assert holds("(= f 1)", place, objects, "", f) == (f == 1)
        assert holds("(= 1 f)", place, objects, "", f) == (f == 1)


def test_other_comparisons_and_effects_are_about_numbers() -> None:
    found = plan("(and (>= f g) (<= (h ?x) f))", "(assign f (+ f g)) (when (= f g) (increase g f))", "(= (f) 2)")
    assert refuted(check(found, every=True)) == []
    (instance,) = found.instances
    assert [str(effect.fluent) for effect in instance.numeric_effects] == ["(f)"], "f and g are two objects"
    assert {one for one, _ in instance.mentioned()} == set()


def test_texts_say_what_was_written() -> None:
    named = plan(goal=f"{FIRST} {SECOND}", objects="").goal
    assert [one.label for one in named[1:]] == [f"goal: {FIRST}", f"goal: {SECOND}"]
