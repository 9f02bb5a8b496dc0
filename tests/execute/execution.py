"""Plans to be executed, for tests: shipped and benchmark plans with their boxes, and a small world of tasks."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

from robust.api import envelope
from robust.execute.dispatch.network import Dispatchable, make_dispatchable
from robust.execute.worlds.rules import Rule, Rules, Subject
from robust.plan.load import assemble, load_plan
from robust.plan.model import ParametrizedPlan
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn
from robust.qe.box import Box, Interval

ROOT = Path(__file__).parents[2]
DOMAINS = ROOT / "benchmarks" / "domains"
PLANS = (
    ("robot_delivery", "domain", "problem-two-orders", "two-orders-10"),
    ("robot_delivery", "domain", "problem-one-order", "one-order-preparation-3"),
    ("robot_delivery", "domain-battery", "problem-battery", "one-order-battery-6"),
    ("generator", "domain", "problem-5", "plan-5-2"),
    ("generator", "domain", "problem-5", "plan-5-pauses-3"),
    ("solar_rover", "domain-yield", "problem-yield", "plan-yield"),
    ("auv_survey", "domain", "problem-two-vehicles", "two-vehicles-5"),
)

DOMAIN = """
(define (domain tasks)
  (:requirements :typing :durative-actions :fluents :duration-inequalities :timed-initial-literals)
  (:types task)
  (:predicates (free) (ready ?t - task) (done ?t - task) (open))
  (:functions (need ?t - task) (stock))
  (:durative-action work
    :parameters (?t - task)
    :duration (>= ?duration 1)
    :condition (and (at start (ready ?t)) (over all (open)))
    :effect (and (at start (not (ready ?t))) (at end (done ?t))))
  (:durative-action fetch
    :parameters (?t - task)
    :duration (= ?duration 2)
    :condition (at start (>= (stock) (need ?t)))
    :effect (and (at end (decrease (stock) (need ?t))) (at end (ready ?t))))
  (:action call :parameters (?t - task) :precondition (done ?t) :effect (free)))
"""
PROBLEM = """
(define (problem two) (:domain tasks) (:objects a b - task)
  (:init (ready a) (open) (at 60 (not (open))) (= (need a) 3) (= (need b) 4) (= (stock) 10))
  (:goal (and (done a) (done b))))
"""
PLAN = """
parameter first default 10;
durative-action instance w1 : (work a);
durative-action instance f : (fetch b);
durative-action instance w2 : (work b);
action instance c : (call a);
c: w1.end - w1.start in [first, first];
c: f.end - f.start in [2, 2];
c: f.start - w1.end in [0.001, inf];
c: w2.start - f.end in [0.001, inf];
c: w2.end - w2.start in [5, 8];
c: w2.end - .zero in [0, 60];
c: c - w1.end in [0.001, inf];
"""


def tasks(plan: str = PLAN, *specs: str, problem: str = PROBLEM) -> ParametrizedPlan:
    """The small plan: `work a` takes as long as nature wants, `work b` from 5 to 8 as the dispatcher wants."""
    domain = parse_domain(DOMAIN)
    return assemble(domain, parse_problem(problem, domain), parse_stn(plan), parse_specs(specs))


def tasks_dispatchable(box: Mapping[str, tuple[int, int]] | None = None, plan: str = PLAN, *specs: str) -> Dispatchable:
    """That plan with a box."""
    ends = {"first": (4, 20)} if box is None else box
    intervals = {name: Interval(Fraction(low), Fraction(high)) for name, (low, high) in ends.items()}
    return make_dispatchable(tasks(plan, *specs), Box(intervals))


def interval(text: str) -> Interval:
    """An interval as people write it."""
    lower, upper = (None if end == "inf" else Fraction(end) for end in text[1:-1].split(", "))
    return Interval(lower, upper, text[0] == "[", text[-1] == "]")


@cache
def with_box(folder: str, domain: str, problem: str, plan: str) -> Dispatchable:
    """A benchmark plan with its box by exact widening."""
    base = DOMAINS / folder
    loaded = load_plan(base / f"{domain}.pddl", base / f"{problem}.pddl", base / f"{plan}.stn")
    found = envelope(loaded)
    assert found.verified
    return make_dispatchable(loaded, found.box)


def drawn(box: Box, random: Random, *, width: Fraction = Fraction(50)) -> dict[str, Fraction]:
    """A point of a box, often a corner; infinite sides are cut."""
    values = {}
    for name, interval in box.intervals.items():
        lower, upper = interval.lower, interval.upper
        low = lower if lower is not None else (upper if upper is not None else Fraction(0)) - width
        high = upper if upper is not None else low + width
        share = random.choice([Fraction(0), Fraction(1), Fraction(random.randint(1, 99), 100)])
        values[name] = low + (high - low) * share
        if values[name] not in interval:
            values[name] = (low + high) / 2
    return values


def constant(subject: Subject, name: str, value: Fraction | int | str) -> Rule:
    """The rule that something always has this value."""
    return Rule(subject, name, "constant", {"value": Fraction(value)})


def fixed(values: Mapping[str, Fraction]) -> Rules:
    """A world in which parameters have these values."""
    return Rules(tuple(constant(Subject.PARAMETER, name, value) for name, value in values.items()))
