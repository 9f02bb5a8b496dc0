"""Every theorem is decided as it is stated, the page says so, and the command has its verdict, codes and output."""

import ast
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from proofs import run
from proofs.run import PAGE
from proofs.theorems._library import catalogue
from proofs.theorems._library.catalogue import load_all
from proofs.theorems._library.model import Kind, Lemma, Problem, Scope, Statement, Theorem, Variant, problems
from proofs.theorems._library.page import page
from proofs.theorems._library.solvers import SOLVERS, Solver, read_values
from proofs.theorems._library.terms import const, integer, num

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
    rests = {name: {result.theorem for other, _, result in CITED if other == name} for name, _, _ in CITED}
    for name in rests:
        ahead = [name]
        for reached in ahead:
            ahead += [other for other in rests.get(reached, ()) if other not in ahead[1:]]
        assert name not in ahead[1:]


def test_problems_have_names_of_their_own_and_what_is_refuted_is_no_claim_under_another_name():
    assert len({problem.name for problem in PROBLEMS}) == len(PROBLEMS)
    assert [problem.name for problem in PROBLEMS if problem.kind is Kind.PRINTED and not problem.show] == []
    scripts = [(problem.kind, problem.script.split("\n", 1)[1]) for problem in PROBLEMS]
    claims = {script for kind, script in scripts if kind is Kind.CLAIM}
    assert not claims & {script for kind, script in scripts if kind in (Kind.BROKEN, Kind.PRINTED)}


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page([*THEOREMS.values()]), "run `python -m proofs --write-docs`"


def test_nothing_imports_the_tool():
    for path in (ROOT / "proofs").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [module for module in modules if module.split(".")[0] == "robust"], path


HALF = {"x": "-1/2"}
PLAIN = Statement((const("x", "Real"),), {"positive": "(< 0.0 x)"}, "(<= 0.0 x)", {"x": "x"})
BROKEN = PLAIN.without("positive")


@pytest.fixture
def outcome(monkeypatch, capsys):
    """Exit code and output of the command, if there is one theorem: this statement with this broken variant."""

    def command(statement, broken, *words):
        lemma = Lemma("one", "Words.", statement, (Variant("broken.", broken),))
        theorem = Theorem("plain", "Plain", "ours", "Words.", "Words.", Scope.GENERAL, "any.", (lemma,))
        monkeypatch.setattr(run, "names", lambda: [theorem.name])
        monkeypatch.setattr(run, "load", lambda _: theorem)
        return run.main([*words]), *capsys.readouterr()

    return command


def test_a_theorem_that_holds(outcome):
    code, out, _ = outcome(PLAIN, BROKEN.with_also("one", "(= x (- 1.0))"), "--models")
    assert (code, out.count("z3: x = ")) == (0, 2)
    assert all(text in out for text in ("1 unsat", "plain.one.assumptions: assumptions alone"))
    code, out, _ = outcome(PLAIN, BROKEN.with_also("one", "(= x (- (/ 1.0 2.0)))"), "--json")
    answers = json.loads(out)["theorems"][0]["problems"][-1]["answers"]
    assert (code, {name: answer["model"] for name, answer in answers.items()}) == (0, {"z3": HALF, "cvc5": HALF})


@pytest.mark.parametrize(
    ("statement", "broken"),
    [(BROKEN, BROKEN), (PLAIN, PLAIN), (PLAIN.with_also("impossible", "(< x 0.0)"), BROKEN)],
    ids=["the claim does not hold", "the broken variant holds", "the assumptions contradict each other"],
)
def test_what_is_not_as_stated_fails(statement, broken, outcome):
    code, out, errors = outcome(statement, broken)
    assert (code, "expected" in out, "not everything is as stated" in errors) == (1, True, True)


def test_smt2_files_are_written_with_their_status_and_unknown_names_and_partial_pages_refused(tmp_path, capsys):
    assert run.main(["pike_lemma_5_1", "--smt2", str(tmp_path / "new")]) == 0
    texts = {path.stem: path.read_text(encoding="utf-8") for path in (tmp_path / "new").iterdir()}
    assert texts.keys() == {problem.name for problem in problems(catalogue.load("pike_lemma_5_1"))}
    assert all(text.rstrip().endswith("(check-sat)") for text in texts.values())
    assert "(set-info :status unsat)" in texts["pike_lemma_5_1.consensus"]
    assert [run.main(words) for words in (["nonsense"], ["pike_lemma_5_1", "--write-docs"])] == [2, 2]
    assert "unknown theorem nonsense; known are" in capsys.readouterr().err


def verdict(solver, script, **show):
    answer = solver.ask(Problem("p", Kind.BROKEN, "words", f"(set-logic ALL){script}", show))
    return answer.verdict, answer.values


def test_a_solver_that_takes_too_long_is_ended_and_asked_again():
    hard = "(declare-const x Int)(declare-const y Int)(declare-const z Int)"
    hard += "(assert (= (+ (* x x x) (* y y y) (* z z z)) 114))"
    with Solver("z3", limit=0.5) as solver:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert verdict(solver, hard)[0] == "timeout"
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 5
        solver._limit = 60.0
        assert verdict(solver, "(declare-const x Real)(assert (= x 2.0))", x="x") == ("sat", {"x": "2"})


@pytest.mark.parametrize("name", ["z3", "cvc5"])
def test_a_script_with_an_error_is_no_verdict(name):
    with Solver(name, limit=60.0) as solver:
        assert verdict(solver, "(assert (undeclared))")[0] not in ("sat", "unsat")


def test_values_are_fractions_and_statements_know_their_assumptions_and_broken_variants():
    assert read_values("((x (- (/ 1.0 2.0))) ((f a) true) (n (- 3)))") == ["-1/2", "true", "-3"]
    assert (num("-1/3"), integer(-2)) == ("(- (/ 1.0 3.0))", "(- 2)")
    with pytest.raises(ValueError, match="no broken variant"):
        Lemma("one", "Words.", PLAIN, ())
    refused = (PLAIN.without, "x"), (PLAIN.with_changed, "x", "true"), (PLAIN.with_also, "positive", "true")
    for change, *words in refused:
        with pytest.raises(KeyError):
            change(*words)


def test_the_proofs_run_from_what_a_wheel_has_of_them(tmp_path):
    included = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    shipped = included["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for source, target in shipped.items():
        if target.split("/")[0] == "proofs":
            (tmp_path / target).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / source).is_dir() else shutil.copy
            copy(ROOT / source, tmp_path / target)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for words, code in (("pike_theorem_4_6", 0), ("--write-docs", 2)):
        command = [sys.executable, "-m", "proofs", words]
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path, env=environment)
        assert done.returncode == code, done.stderr
    assert done.stderr.endswith("--write-docs is for a checkout of the source\n")


def test_ctrl_c_ends_the_command_and_its_solvers():
    words, pipe = [sys.executable, "-m", "proofs"], subprocess.PIPE
    command = subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, cwd=ROOT, start_new_session=True)
    first = command.stdout.readline()
    os.killpg(command.pid, signal.SIGINT)
    out, errors = command.communicate(timeout=60)
    assert (first.startswith("theorem"), command.returncode, errors) == (True, 130, "interrupted\n")
    assert "Traceback" not in out
