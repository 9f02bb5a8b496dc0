"""The checker that Coq proves right, where it is built: it says the same of certificates as the one in Python."""

import json
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

from benchmarks.suite import read_suite
from robust.certify.checker.proofs import Tape
from robust.certify.hints import NotRefutedError
from robust.certify.kernel.claims import Translation
from robust.errors import RefutedError
from robust.smt.limits import NEVER
from tests.certify import tools
from tests.certify.texts import Texts

KERNEL = Path(__file__).parents[2] / "proofs" / "kernel" / "robust-kernel"
pytestmark = pytest.mark.skipif(not KERNEL.exists(), reason="make -C proofs/kernel has not built it")
ALL = ("plan", "box", "maximal", "shape", "region")


def kernel(path, *words):
    return subprocess.run([KERNEL, *words, path], capture_output=True, text=True, check=False)


def said(ground, lines, path):
    """What the kernel says of a certificate."""

    def ask(text):
        path.write_text(text)
        return kernel(path, "--formulas").stdout

    tape = Tape(map(json.dumps, lines[1:]))
    path.write_text(Translation(ground, Fraction(1, 1000), NEVER).file(tape, *lines[0][1:], ["a plan"], ask))
    return kernel(path)


@pytest.mark.parametrize("kind", ALL)
def test_generator(kind, tmp_path):
    lines, ground = tools.made(tools.GENERATOR, kind), tools.grounded(tools.GENERATOR)
    answer = said(ground, lines, tmp_path / "generator.kernel")
    assert answer.returncode == 0, answer
    claim = tools.judged(lines, ground)
    assert claim.kind == kind
    assert answer.stdout.startswith("established: ")
    assert f"checked: {claim.obligations} obligations" in answer.stdout
    if kind in ("plan", "box", "maximal"):
        assert answer.stdout.startswith(f"established: {claim.text}, epsilon = 1/1000\n")


DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g))
 (:durative-action a :parameters () :duration (= ?duration 2) :condition (over all (>= (f) LEVEL))
  :effect (and (when (at start (p)) (at start (assign (f) (+ (g) 3)))) (at end (increase (g) (f)))
   (when (at start (OTHER)) (at start (increase (f) (* 2 (g))))) (when (at end (>= (f) 4)) (at end (q))))))"""
PROBLEM = "(define (problem x) (:domain d) (:init (= (f) 1) (= (g) 1) (p)) (:goal (and (q) (>= (g) 5))))"
PLAN = """parameter k default 5 lb 0 ub 9; durative-action instance i : (a);
c: i.start - .zero in [0, k]; c: i.end - i.start in [2, 2];"""


def reading_plan(level, other, directory):
    """A plan whose effects have conditions, read fluents, and assign."""
    domain = DOMAIN.replace("LEVEL", level).replace("OTHER", other)
    return tools.written(Texts(domain, PROBLEM, PLAN), directory)


@pytest.mark.parametrize("kind", ["plan", "box"])
def test_effects_that_read(kind, tmp_path):
    files = reading_plan("4", "q", tmp_path / "good")
    lines, path = tools.made(files, kind), tmp_path / "reading.kernel"
    answer = said(tools.grounded(files), lines, path)
    assert answer.stdout.startswith("established: "), answer
    assert f"checked: {tools.judged(lines, tools.grounded(files)).obligations} obligations" in answer.stdout


@pytest.mark.parametrize(("level", "other"), [("4.01", "q"), ("4", "p")])
def test_wrong_levels_and_conflicts_are_not_established(level, other, tmp_path):
    """A certificate of the plan as it was says nothing of a level above, or of an assignment with an increase."""
    lines = tools.made(reading_plan("4", "q", tmp_path / "good"), "plan")
    files = reading_plan(level, other, tmp_path / "wrong")
    with pytest.raises(NotRefutedError):
        said(tools.grounded(files), lines, tmp_path / "wrong.kernel")
    with pytest.raises(RefutedError):
        tools.made(files, "plan")


@pytest.mark.parametrize("every", [9, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans_of_divers(every, dataset, tmp_path):
    """Robots under water, which assign a fluent."""
    for files in [one.files for one in read_suite(dataset) if "auv" in str(one.files[2])][::every]:
        for kind in ("plan", "box"):
            answer = said(tools.grounded(files), tools.made(files, kind), tmp_path / "auv.kernel")
            assert answer.stdout.startswith("established: "), (files, kind, answer)
