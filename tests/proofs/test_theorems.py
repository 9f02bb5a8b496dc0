"""Every theorem is decided by both solvers as it is stated, its broken variants are refuted, and the page says so."""

import ast
import re
from pathlib import Path

import pytest

from proofs.run import PAGE
from proofs.theorems._library.catalogue import load_all
from proofs.theorems._library.model import Kind, problems
from proofs.theorems._library.page import page
from proofs.theorems._library.solvers import SOLVERS, Solver

ROOT = Path(__file__).resolve().parents[2]
THEOREMS = load_all()
PROBLEMS = [problem for theorem in THEOREMS for problem in problems(theorem)]


@pytest.fixture(scope="module", params=SOLVERS)
def solver(request):
    with Solver(request.param, limit=60.0) as opened:
        yield opened


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_each_problem_is_decided_as_stated(problem, solver):
    answer = solver.ask(problem)
    assert answer.verdict == problem.expected, problem.words
    if problem.kind in (Kind.BROKEN, Kind.PRINTED):
        assert set(answer.values) == set(problem.show), "a countermodel is told in the theorem's terms"


@pytest.mark.parametrize("theorem", THEOREMS, ids=lambda theorem: theorem.name)
def test_each_theorem_says_what_it_is(theorem):
    said = [theorem.title, theorem.source, theorem.words, theorem.formalisation, theorem.bound]
    said += [one.words for lemma in theorem.lemmas for one in (lemma, *lemma.broken, *lemma.printed)]
    assert all(text.strip() for text in said)
    assert re.match(r"\[(IRR|PIKE), |ours", theorem.source)
    kinds = [problem.kind for problem in problems(theorem)]
    assert kinds.count(Kind.CLAIM) == kinds.count(Kind.ASSUMPTIONS) == len(theorem.lemmas) > 0


def test_problems_have_names_of_their_own():
    found = [problem.name for problem in PROBLEMS]
    assert len(set(found)) == len(found)


def test_countermodels_show_something():
    assert [problem.name for problem in PROBLEMS if problem.kind is Kind.PRINTED and not problem.show] == []


def test_what_is_refuted_is_no_claim_under_another_name():
    claims = {problem.script.split("\n", 1)[1] for problem in PROBLEMS if problem.kind is Kind.CLAIM}
    refuted = {each.script.split("\n", 1)[1] for each in PROBLEMS if each.kind in (Kind.BROKEN, Kind.PRINTED)}
    assert not claims & refuted


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(THEOREMS), "run `python -m proofs --write-docs`"


def test_nothing_imports_the_tool():
    for path in (ROOT / "proofs").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [module for module in modules if module.split(".")[0] == "robust"], path
