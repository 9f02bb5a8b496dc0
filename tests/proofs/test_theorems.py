"""Every theorem is decided by both solvers as it is stated, its broken variants are refuted, and the page says so."""

import ast
import re
from pathlib import Path

import pytest

from proofs.run import PAGE
from proofs.theorems._library.catalogue import load_all, names
from proofs.theorems._library.model import Kind, problems
from proofs.theorems._library.page import page
from proofs.theorems._library.solvers import SOLVERS, Solver

ROOT = Path(__file__).resolve().parents[2]
THEOREMS = load_all()
PROBLEMS = [problem for theorem in THEOREMS for problem in problems(theorem)]
EXPECTED = {
    "breakpoints",
    "encoding_equivalence",
    "exact_widening",
    "halving_gap",
    "irr_theorem_1",
    "irr_theorem_2",
    "obligation_splitting",
    "pike_could_commit",
    "pike_figure_12",
    "pike_invariant_5_2",
    "pike_k_intents",
    "pike_k_intents_kirk",
    "pike_lemma_5_1",
    "pike_observation_2",
    "pike_precedence",
    "pike_theorem_3_1",
    "pike_theorem_3_2",
    "pike_theorem_4_1",
    "pike_theorem_4_2",
    "pike_theorem_4_3",
    "pike_theorem_4_4",
    "pike_theorem_4_5",
    "pike_theorem_4_6",
    "pike_theorem_4_7",
    "pike_theorem_c_1",
}


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


def test_the_list_is_complete():
    assert set(names()) == EXPECTED


@pytest.mark.parametrize("theorem", THEOREMS, ids=lambda theorem: theorem.name)
def test_each_theorem_says_what_it_is(theorem):
    for text in (theorem.title, theorem.source, theorem.words, theorem.formalisation, theorem.bound):
        assert text.strip()
    assert re.match(r"\[(IRR|PIKE), |ours", theorem.source)
    assert theorem.lemmas
    kinds = [problem.kind for problem in problems(theorem)]
    assert kinds.count(Kind.CLAIM) == kinds.count(Kind.ASSUMPTIONS) == len(theorem.lemmas)
    assert all(lemma.broken for lemma in theorem.lemmas)
    assert all(
        lemma.words.strip() and all(v.words.strip() for v in (*lemma.broken, *lemma.printed))
        for lemma in theorem.lemmas
    )


def test_problems_have_names_of_their_own():
    found = [problem.name for problem in PROBLEMS]
    assert len(set(found)) == len(found)


def test_countermodels_show_something():
    assert [problem.name for problem in PROBLEMS if problem.kind is Kind.PRINTED and not problem.show] == []


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_a_broken_variant_differs_from_the_claim(problem):
    """What is refuted is not the claim itself under another name."""
    claims = {other.script.split("\n", 1)[1] for other in PROBLEMS if other.kind is Kind.CLAIM}
    if problem.kind in (Kind.BROKEN, Kind.PRINTED):
        assert problem.script.split("\n", 1)[1] not in claims


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(THEOREMS), "run `python -m proofs --write-docs`"


def test_nothing_imports_the_tool():
    for path in (ROOT / "proofs").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = {
                ast.Import: lambda n: [alias.name for alias in n.names],
                ast.ImportFrom: lambda n: [n.module or ""],
            }.get(type(node), lambda n: [])(node)
            assert not [module for module in modules if module.split(".")[0] == "robust"], path
