"""A small plan, and one table of what makes it wrong; `tests/recordings` has what is said of each."""

from pathlib import Path
from typing import NamedTuple

DOMAIN = """\
(define (domain delivery)
  (:requirements :typing :durative-actions :fluents)
  (:types place)
  (:predicates (at ?p - place) (ready))
  (:functions (fuel) (toll ?p - place))
  (:durative-action go
    :parameters (?from ?to - place)
    :duration (= ?duration 5)
    :condition (and (at start (at ?from)) (at start (>= (fuel) 1)))
    :effect (and (at start (not (at ?from))) (at end (at ?to)) (at end (decrease (fuel) 1)))))
"""
PROBLEM = """\
(define (problem one_trip)
  (:domain delivery)
  (:objects a b - place)
  (:init (at a) (= (fuel) 3))
  (:goal (at b)))
"""
PLAN = """\
parameter leave default 2 lb 0 ub 9;
durative-action instance g : (go a b);
c: g.start - .zero in [leave, leave];
c: g.end - g.start in [5, 5];
"""


RIGHT = {"domain.pddl": DOMAIN, "problem.pddl": PROBLEM, "plan.stn": PLAN}


class Inputs(NamedTuple):
    """Where the three texts are."""

    files: tuple[Path, ...]


def write(directory: Path, domain: str = DOMAIN, problem: str = PROBLEM, plan: str = PLAN) -> Inputs:
    inputs = Inputs(tuple(directory / name for name in RIGHT))
    for path, text in zip(inputs.files, (domain, problem, plan), strict=True):
        path.write_text(text, encoding="utf-8")
    return inputs


class BadInput(NamedTuple):
    """`old` in one of the three files becomes `new`."""

    name: str
    file: str
    old: str
    new: str


_ACTION = "(:durative-action go"
_LATE = "c: g.end - g.start in [5, 5];\nc: g.end - .zero in [0, 1];"

BAD_INPUTS = (
    BadInput("unbalanced parenthesis", "domain.pddl", "(ready))", "(ready)"),
    BadInput("too many parentheses", "problem.pddl", "(:goal (at b)))", "(:goal (at b))))"),
    BadInput("unknown requirement", "domain.pddl", ":fluents)", ":fluents :magic)"),
    BadInput("unknown type", "domain.pddl", "?to - place", "?to - plaice"),
    BadInput("unknown predicate", "domain.pddl", "(at start (at ?from))", "(at start (att ?from))"),
    BadInput("unknown predicate in the goal", "problem.pddl", "(:goal (at b))", "(:goal (on b))"),
    BadInput("unknown function", "domain.pddl", "(decrease (fuel) 1)", "(decrease (feul) 1)"),
    BadInput("unknown object", "problem.pddl", "(:goal (at b))", "(:goal (at c))"),
    BadInput("unknown object in the plan", "plan.stn", "(go a b)", "(go a c)"),
    BadInput("unknown action", "plan.stn", "(go a b)", "(fly a b)"),
    BadInput("arity of a predicate", "domain.pddl", "(at end (at ?to))", "(at end (at ?to ?to))"),
    BadInput("arity of an action", "plan.stn", "(go a b)", "(go a)"),
    BadInput("undeclared time point", "plan.stn", "g.end - g.start", "h.end - g.start"),
    BadInput("undeclared parameter", "plan.stn", "in [leave, leave]", "in [leave, late]"),
    BadInput("a parameter named inf", "plan.stn", "parameter leave", "parameter inf"),
    BadInput("lower above upper", "plan.stn", "in [5, 5]", "in [6, 5]"),
    BadInput("crossed bounds", "plan.stn", "lb 0 ub 9", "lb 9 ub 0"),
    BadInput("nominal value outside", "plan.stn", "default 2", "default 20"),
    BadInput("no nominal value", "plan.stn", " default 2", ""),
    BadInput("not a number", "plan.stn", "in [5, 5]", "in [5, 5x]"),
    BadInput("missing semicolon", "plan.stn", "(go a b);", "(go a b)"),
    BadInput("instantaneous", "plan.stn", "durative-action instance", "action instance"),
    BadInput("no initial value", "problem.pddl", " (= (fuel) 3)", ""),
    BadInput("another domain", "problem.pddl", "(:domain delivery)", "(:domain taxi)"),
    BadInput("no schedule", "plan.stn", "c: g.end - g.start in [5, 5];", _LATE),
    BadInput("process", "domain.pddl", _ACTION, f"(:process burn)\n  {_ACTION}"),
    BadInput("event", "domain.pddl", _ACTION, f"(:event burn)\n  {_ACTION}"),
    BadInput("non-linear effect", "domain.pddl", "(at end (decrease (fuel) 1))", "(decrease (fuel) (* #t (fuel)))"),
)
