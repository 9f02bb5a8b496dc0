"""Planners as small scripts, and a small problem for them."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

from robust.plan.pddl.reader import parse_domain, parse_problem

DOMAIN = """(define (domain errands)
(:requirements :typing :fluents :durative-actions :timed-initial-literals)
(:types place)
(:predicates (at ?p - place) (done ?p - place) (open))
(:functions (distance ?a ?b - place))
(:durative-action go :parameters (?a ?b - place) :duration (= ?duration (distance ?a ?b))
 :condition (at start (at ?a)) :effect (and (at start (not (at ?a))) (at end (at ?b))))
(:durative-action shop :parameters (?p - place) :duration (and (>= ?duration 2) (<= ?duration 5))
 :condition (and (over all (at ?p)) (over all (open))) :effect (at end (done ?p))))
"""
PROBLEM = """(define (problem one) (:domain errands) (:objects home market - place)
(:init (at home) (open) (at 20 (not (open))) (= (distance home market) 7.5) (= (distance market home) 7.5))
(:goal (done market)))
"""
VALID = "0.000: (GO HOME MARKET) [7.500]\n7.501: (shop market)  [2.000]\n"
BETTER = "0: (go home market) [7.5]\n7.5: (shop market) [2]\n"
TOO_LATE = "0.000: (go home market) [7.5]\n18.5: (shop market) [2.0]\n"

errands = parse_domain(DOMAIN)
errand = parse_problem(PROBLEM, errands)


@dataclass(frozen=True)
class Fake:
    """A script in a folder; `command` is the template that starts it."""

    folder: Path

    def command(self, body: str, arguments: str = "{domain} {problem} {output} {timeout}") -> str:
        script = self.folder / "fake.py"
        script.write_text(f"import os, signal, subprocess, sys, time\n{dedent(body)}", encoding="utf-8")
        return f"command:{shlex.quote(sys.executable)} -I {shlex.quote(str(script))} {arguments}"

    def printing(self, text: str, then: str = "") -> str:
        return self.command(f"print({text!r}, flush=True)\n{dedent(then)}")
