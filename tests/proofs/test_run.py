"""The command: its verdict, its exit codes, what it writes, and how it ends."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from proofs import run
from proofs.theorems._library import catalogue
from proofs.theorems._library.model import Kind, Lemma, Problem, Scope, Statement, Theorem, Variant, problems
from proofs.theorems._library.solvers import Solver, read_values
from proofs.theorems._library.terms import const, integer, num

ROOT = Path(__file__).resolve().parents[2]
PLAIN = Statement((const("x", "Real"),), {"positive": "(< 0.0 x)"}, "(<= 0.0 x)", {"x": "x"})


def theorem(statement: Statement, broken: Statement) -> Theorem:
    lemma = Lemma("one", "Words.", statement, (Variant("broken.", broken),))
    return Theorem("plain", "Plain", "ours", "Words.", "Words.", Scope.GENERAL, "any.", (lemma,))


def problem(script: str, **show: str) -> Problem:
    return Problem("p", Kind.BROKEN, "words", script, show)


def use(monkeypatch, stated: Theorem) -> None:
    monkeypatch.setattr(run, "names", lambda: [stated.name])
    monkeypatch.setattr(run, "load", lambda _: stated)


def test_a_theorem_that_holds(monkeypatch, capsys):
    use(monkeypatch, theorem(PLAIN, PLAIN.without("positive")))
    assert run.main([]) == 0
    assert "1 unsat" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("statement", "broken"),
    [
        (PLAIN.without("positive"), PLAIN.without("positive")),
        (PLAIN, PLAIN),
        (PLAIN.with_also("impossible", "(< x 0.0)"), PLAIN.without("positive")),
    ],
    ids=["the claim does not hold", "the broken variant holds", "the assumptions contradict each other"],
)
def test_what_is_not_as_stated_fails(statement, broken, monkeypatch, capsys):
    use(monkeypatch, theorem(statement, broken))
    assert run.main([]) == 1
    told = capsys.readouterr()
    assert "expected" in told.out
    assert "not everything is as stated" in told.err


def test_json_has_the_countermodel(monkeypatch, capsys):
    use(monkeypatch, theorem(PLAIN, PLAIN.without("positive").with_also("one", "(= x (- (/ 1.0 2.0)))")))
    assert run.main(["--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    broken = document["theorems"][0]["problems"][-1]
    assert {name: answer["model"] for name, answer in broken["answers"].items()} == {
        "z3": {"x": "-1/2"},
        "cvc5": {"x": "-1/2"},
    }


def test_smt2_files_are_written_with_their_status(tmp_path):
    assert run.main(["pike_lemma_5_1", "--smt2", str(tmp_path / "new")]) == 0
    files = sorted((tmp_path / "new").iterdir())
    assert {path.stem for path in files} == {each.name for each in problems(catalogue.load("pike_lemma_5_1"))}
    assert files[0].read_text(encoding="utf-8").rstrip().endswith("(check-sat)")
    assert "(set-info :status unsat)" in (tmp_path / "new/pike_lemma_5_1.consensus.smt2").read_text(encoding="utf-8")


def test_unknown_names_and_partial_pages_are_refused(capsys):
    assert run.main(["nonsense"]) == 2
    assert run.main(["pike_lemma_5_1", "--write-docs"]) == 2
    assert "unknown theorem nonsense; known are" in capsys.readouterr().err


HARD = (
    "(declare-const x Int)(declare-const y Int)(declare-const z Int)(assert (= (+ (* x x x) (* y y y) (* z z z)) 114))"
)


def test_a_solver_that_takes_too_long_is_ended_and_asked_again():
    with Solver("z3", limit=1.0) as solver:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert solver.ask(problem(f"(set-logic ALL){HARD}")).verdict == "timeout"
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 5
        solver._limit = 60.0
        assert solver.ask(problem("(set-logic ALL)(declare-const x Real)(assert (= x 2.0))", x="x")).values == {
            "x": "2"
        }


@pytest.mark.parametrize("name", ["z3", "cvc5"])
def test_a_script_with_an_error_is_no_verdict(name):
    with Solver(name, limit=60.0) as solver:
        assert solver.ask(problem("(set-logic ALL)(assert (undeclared))")).verdict not in ("sat", "unsat")


def test_values_are_read_as_fractions():
    assert read_values("((x (- (/ 1.0 2.0))) ((f a) true) (n (- 3)))") == ["-1/2", "true", "-3"]
    assert (num("-1/3"), integer(-2)) == ("(- (/ 1.0 3.0))", "(- 2)")


def test_a_lemma_needs_a_broken_variant():
    with pytest.raises(ValueError, match="no broken variant"):
        Lemma("one", "Words.", PLAIN, ())


def test_statements_know_their_assumptions():
    with pytest.raises(KeyError):
        PLAIN.without("unheard of")
    with pytest.raises(KeyError):
        PLAIN.with_changed("unheard of", "true")
    with pytest.raises(KeyError):
        PLAIN.with_also("positive", "true")


def test_the_proofs_run_from_what_a_wheel_has_of_them(tmp_path):
    included = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    shipped = included["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for source, target in shipped.items():
        if target.split("/")[0] == "proofs":
            (tmp_path / target).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / source).is_dir() else shutil.copy
            copy(ROOT / source, tmp_path / target)
    for words, code in (([], 0), (["--write-docs"], 2)):
        done = subprocess.run(
            [sys.executable, "-m", "proofs", *words, *(() if words else ("pike_theorem_4_6",))],
            check=False,
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
        )
        assert done.returncode == code, done.stderr
    assert done.stderr.endswith("--write-docs is for a checkout of the source\n")


def test_models_of_assumptions_are_shown_too(monkeypatch, capsys):
    use(monkeypatch, theorem(PLAIN, PLAIN.without("positive").with_also("one", "(= x (- 1.0))")))
    assert run.main(["--models"]) == 0
    told = capsys.readouterr().out
    assert "plain.one.assumptions: assumptions alone" in told
    assert told.count("z3: x = ") == 2


def test_ctrl_c_ends_the_command_and_its_solvers(tmp_path):
    command = subprocess.Popen(
        [sys.executable, "-m", "proofs"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    )
    first = command.stdout.readline()
    os.killpg(command.pid, signal.SIGINT)
    out, errors = command.communicate(timeout=60)
    assert first.startswith("theorem")
    assert command.returncode == 130
    assert errors == "interrupted\n"
    assert "Traceback" not in out
