"""A small plan, to be made wrong in many ways."""

from dataclasses import dataclass
from pathlib import Path

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


@dataclass(frozen=True)
class Inputs:
    """Where the three texts are."""

    domain: Path
    problem: Path
    plan: Path

    @property
    def files(self) -> tuple[Path, Path, Path]:
        return self.domain, self.problem, self.plan


def write(directory: Path, domain: str = DOMAIN, problem: str = PROBLEM, plan: str = PLAN) -> Inputs:
    inputs = Inputs(directory / "domain.pddl", directory / "problem.pddl", directory / "plan.stn")
    for path, text in zip(inputs.files, (domain, problem, plan), strict=True):
        path.write_text(text, encoding="utf-8")
    return inputs
