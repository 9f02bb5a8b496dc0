"""Every theorem is decided by both solvers as it is stated, its broken variants are refuted, and the page says so."""

import ast
import re
from pathlib import Path

import pytest

from proofs.run import PAGE
from proofs.theorems._library.catalogue import load_all
from proofs.theorems._library.model import Kind, Scope, problems
from proofs.theorems._library.page import page
from proofs.theorems._library.solvers import SOLVERS, Solver

ROOT = Path(__file__).resolve().parents[2]
THEOREMS = {theorem.name: theorem for theorem in load_all()}
PROBLEMS = [problem for theorem in THEOREMS.values() for problem in problems(theorem)]
CITED = [
    (theorem.name, lemma, result)
    for theorem in THEOREMS.values()
    for lemma in theorem.lemmas
    for result in lemma.statement.cited
]


@pytest.fixture(scope="module", params=SOLVERS)
def solver(request):
    with Solver(request.param, limit=60.0) as opened:
        yield opened


@pytest.mark.parametrize("theorem", THEOREMS.values(), ids=THEOREMS)
def test_each_problem_is_decided_as_stated(theorem, solver):
    for problem in problems(theorem):
        answer = solver.ask(problem)
        assert answer.verdict == problem.expected, (problem.name, problem.words)
        if problem.kind in (Kind.BROKEN, Kind.PRINTED):
            assert set(answer.values) == set(problem.show), "a countermodel is told in the theorem's terms"


def test_each_theorem_says_what_it_is():
    for theorem in THEOREMS.values():
        said = [theorem.title, theorem.source, theorem.words, theorem.formalisation, theorem.bound]
        said += [one.words for lemma in theorem.lemmas for one in (lemma, *lemma.broken, *lemma.printed)]
        assert all(text.strip() for text in said)
        assert re.match(r"\[(IRR|PIKE), |ours", theorem.source)
        kinds = [problem.kind for problem in problems(theorem)]
        assert kinds.count(Kind.CLAIM) == kinds.count(Kind.ASSUMPTIONS) == len(theorem.lemmas) > 0
        text = (ROOT / "proofs" / "theorems" / f"{theorem.name}.py").read_text(encoding="utf-8")
        assert ("bounded" in text.splitlines()[0]) == (theorem.scope is Scope.BOUNDED)


def test_what_is_taken_from_another_theorem_is_what_that_proves_of_the_same_symbols():
    assert {name for name, _, _ in CITED} == {f"pike_theorem_4_{number}" for number in (4, 6, 7)}
    for _, lemma, result in CITED:
        (proving,) = (one for one in THEOREMS[result.theorem].lemmas if one.name == result.lemma)
        assert proving.statement.claim is result.formula
        assert lemma.statement.assumptions[result.words] is result.formula
        there, here = signatures(proving.statement.declarations), signatures(lemma.statement.declarations)
        used = set(re.findall(r"[a-z][a-z-]*", result.formula)) & set(there)
        assert used
        assert {name: there[name] for name in used} == {name: here[name] for name in used}


def signatures(declarations):
    """The sorts of the arguments and of the value of each function, whether it is declared or defined."""
    sorts = {}
    for text in declarations:
        if match := re.match(r"\(declare-fun (\S+) \((.*?)\) (\w+)\)", text):
            sorts[match[1]] = (match[2].split(), match[3])
        elif match := re.match(r"\(define-fun (\S+) \((.*?)\) (\w+)\n", text):
            sorts[match[1]] = (re.findall(r"(\w+)\)", match[2] + ")"), match[3])
    return sorts


def test_no_theorem_rests_on_itself():
    rests = {}
    for name, _, result in CITED:
        rests.setdefault(name, set()).add(result.theorem)
    for name in rests:
        ahead = [name]
        for reached in ahead:
            ahead += [other for other in rests.get(reached, ()) if other not in ahead[1:]]
        assert name not in ahead[1:]


def test_problems_have_names_of_their_own_and_countermodels_show_something():
    assert len({problem.name for problem in PROBLEMS}) == len(PROBLEMS)
    assert [problem.name for problem in PROBLEMS if problem.kind is Kind.PRINTED and not problem.show] == []


def test_what_is_refuted_is_no_claim_under_another_name():
    claims = {problem.script.split("\n", 1)[1] for problem in PROBLEMS if problem.kind is Kind.CLAIM}
    refuted = (problem for problem in PROBLEMS if problem.kind in (Kind.BROKEN, Kind.PRINTED))
    assert not claims & {problem.script.split("\n", 1)[1] for problem in refuted}


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page([*THEOREMS.values()]), "run `python -m proofs --write-docs`"


def test_nothing_imports_the_tool():
    for path in (ROOT / "proofs").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [module for module in modules if module.split(".")[0] == "robust"], path
