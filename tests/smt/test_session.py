"""Sessions, for every solver: frames, models, statistics, time limits, interruption; formulas; exported queries."""

import faulthandler
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from fractions import Fraction
from functools import partial
from itertools import combinations
from pathlib import Path

import cvc5
import pytest
import z3
from hypothesis import given
from hypothesis import strategies as st

from robust.api import check, envelope
from robust.encode.interface import Auxiliary, constant, variable
from robust.errors import SolverError, UnsupportedError
from robust.plan.model import ZERO, Or, Parameter, ParameterReference, Relation
from robust.smt.limits import Deadline, current_question, one_question
from robust.smt.session import BACKENDS, Exporter, Satisfiability, Session, Statistics, Terms, smtlib
from tests.children import is_running
from tests.plan.building import ALL, END, F, above, action, between, different, drawn, flow, plan_of, reference, value

X_NAME, Y_NAME = Auxiliary("x", 1), Auxiliary("y", 2)
X, Y = variable(X_NAME), variable(Y_NAME)
SAT, UNSAT, UNKNOWN = Satisfiability.SATISFIABLE, Satisfiability.UNSATISFIABLE, Satisfiability.UNKNOWN
PATIENCE = 15
"""Seconds of delay to forgive a busy machine; the queries in question take minutes."""
both_solvers = pytest.mark.parametrize("solver", sorted(BACKENDS))


@pytest.fixture
def terms() -> Terms:
    return Terms()


@both_solvers
def test_frames_nest_and_leave_nothing_behind(solver, terms) -> None:
    """A deadline that has passed answers unknown at once, and spoils nothing."""
    with pytest.raises(SolverError, match=solver):
        Session(terms, solver=f"{solver}0")
    session = Session(terms, solver=solver)
    session.add(terms.at_least(X))
    with session.frame(terms.at_least(Y - X)):
        assert session.check("y ≥ x ≥ 0") is SAT
        with session.frame(terms.greater(-Y)):
            assert session.check("0 > y ≥ x ≥ 0") is UNSAT
            assert len(session.assertions) == 3
        assert session.check("y ≥ x ≥ 0 again") is SAT
    with suppress(ZeroDivisionError), session.frame(terms.false):
        assert session.check("false", Deadline.after(0)) is UNKNOWN
        assert session.check("false", Deadline.after(None)) is UNSAT
        raise ZeroDivisionError
    with session.frame(terms.greater(-Y)):
        assert session.check("0 > y, x ≥ 0") is SAT
    assert session.assertions == [terms.at_least(X)]


@both_solvers
def test_values_are_exact_and_those_of_what_is_asserted(solver, terms) -> None:
    session, big = Session(terms, solver=solver), Fraction(10**40 + 1, 3**50)
    session.add(terms.equal(X - constant(big)), terms.greater(Y - X), terms.greater(X + Fraction(1, 10**30) - Y))
    assert session.check("values") is SAT
    x, y = session.values(map(terms.real, (X_NAME, Y_NAME))).values()
    assert {type(x), type(y)} == {Fraction}
    assert big == x < y < big + Fraction(1, 10**30)
    session = Session(terms, solver=solver)
    truth, x = terms.fresh_boolean("b"), terms.real(X_NAME)
    session.add(terms.negation(truth))
    with session.frame(terms.at_least(X)):
        assert session.check("a frame's symbol") is SAT
        assert session.values([x]).keys() == {x.symbol_name()}
    assert session.check("after the frame") is SAT
    assert session.values([truth, x, terms.real("never")]) == {truth.symbol_name(): False}


@both_solvers
def test_sessions_share_nothing_but_terms_unless_told(solver, terms) -> None:
    shared = Statistics()
    first, second = (Session(terms, solver=solver, statistics=shared) for _ in range(2))
    first.add(terms.greater(X))
    second.add(terms.greater(-X))
    assert (first.check("x > 0"), second.check("x < 0")) == (SAT, SAT)
    over, under = (session.values([terms.real(X_NAME)]).popitem()[1] for session in (first, second))
    assert over > 0 > under
    second.add(terms.greater(X))
    assert (second.check("unsat"), second.check("unsat again")) == (UNSAT, UNSAT)
    counts = shared.as_dict()
    assert min(counts.pop("nodes"), counts.pop("seconds")) > 0
    assert counts == {"queries": 4, "satisfiable": 2, "unsatisfiable": 2, "unknown": 0}
    assert Session(terms, solver=solver).statistics == Statistics()


def hard_session(solver: str) -> Session:
    """A session whose next check takes minutes: twenty starts, each a unit from each other, in less than 19 units."""
    terms, starts = Terms(), [variable(Auxiliary("start", index)) for index in range(20)]
    session = Session(terms, solver=solver)
    session.add(*map(terms.at_least, starts), *(terms.greater(constant(19) - start) for start in starts))
    for a, b in combinations(starts, 2):
        session.add(terms.disjunction((terms.at_least(a - b - 1), terms.at_least(b - a - 1))))
    return session


@both_solvers
@pytest.mark.parametrize("seconds", [0.05, 0.4])
def test_time_limit_ends_a_hard_query_about_on_time(solver, seconds) -> None:
    session = hard_session(solver)
    started, worked = time.monotonic(), os.times()
    assert session.check("twenty starts", Deadline.after(seconds)) is UNKNOWN
    assert 0.9 * seconds <= time.monotonic() - started < seconds + PATIENCE
    used = zip(os.times()[:4], worked[:4], strict=True)  # of this process and its ended children
    assert sum(now - before for now, before in used) < seconds + 1
    assert session.statistics.unknown == 1
    with session.frame(session.terms.greater(-variable(Auxiliary("start", 0)) - 10000)):
        assert session.check("a start before zero", Deadline.after(30)) is UNSAT, "it can be used afterwards"


def test_what_is_left_of_processor_time_is_not_taken_for_an_interruption():
    """A busy machine gives other processes the time that z3 has by the clock."""

    class Untouched(Deadline):
        remaining = 0.2

    assert hard_session("z3").check("twenty starts", Untouched()) is UNKNOWN


@pytest.mark.parametrize(
    ("death", "why"),
    [
        (os.abort, "ended with signal SIGABRT"),
        (partial(signal.raise_signal, signal.SIGSEGV), "ended with signal SIGSEGV"),
        (partial(signal.raise_signal, signal.SIGKILL), "ended with signal SIGKILL; it may have run out of memory"),
        (partial(os._exit, 7), "ended without an answer, with exit code 7"),
        (partial(int, "x"), "failed: ValueError: invalid literal for int() with base 10: 'x'"),
    ],
    ids=["abort", "segmentation fault", "kill", "exit", "exception"],
)
def test_a_crash_of_cvc5_is_one_question_without_an_answer(monkeypatch, terms, death, why) -> None:
    tests = os.getpid()

    def dying(_solver: object) -> None:
        assert os.getppid() == tests, "it must not be the process of the tests that ends"
        faulthandler.disable()
        death()

    session, x = Session(terms, solver="cvc5"), terms.real(X_NAME)
    session.add(terms.equal(X - Fraction(1, 3)))
    assert session.check("one") is SAT
    with monkeypatch.context() as patch:
        patch.setattr("robust.smt.session._solve", dying)
        assert session.check("two") is UNKNOWN
    assert session.statistics.failures == [f"cvc5 {why}, asked: two"]
    with session.frame(terms.greater(X - 1)):
        assert session.check("three") is UNSAT
    assert session.failure is None
    assert session.check("four") is SAT
    assert session.values([x]) == {x.symbol_name(): Fraction(1, 3)}
    assert session.statistics.as_dict().keys() == Statistics().as_dict().keys()


INTERRUPTED = """
import sys
from tests.smt.test_session import hard_session
session = hard_session(sys.argv[1])
print("ready", flush=True)
try:
    print(session.check("twenty starts"))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@both_solvers
@pytest.mark.parametrize("delay", [0.03, 0.4])
def test_ctrl_c_ends_a_query_within_a_second(solver, delay) -> None:
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED, solver], env=environment, **pipes) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            time.sleep(delay)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert (out, process.returncode) == ("interrupted\n", 0), err
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            session = int((path / "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[2])
            assert session != process.pid or not is_running(int(path.name)), "nothing is left in its session"


def test_constants_and_repetitions_fold_and_products_are_refused(terms) -> None:
    relations = (Relation.AT_LEAST, Relation.GREATER, Relation.EQUAL, Relation.DIFFERENT)
    for number in (Fraction(-1, 7), Fraction(0), Fraction(2)):
        expected = [number >= 0, number > 0, number == 0, number != 0]
        assert [relation.holds(number) for relation in relations] == expected
        for expression in (constant(number), X - X + number):
            assert [terms.compare(expression, relation) for relation in relations] == list(map(terms.truth, expected))
    a, b, true, false = terms.fresh_boolean("a"), terms.fresh_boolean("b"), terms.true, terms.false
    for formula, folded in (
        (terms.conjunction([]), true),
        (terms.disjunction([]), false),
        (terms.conjunction([true, a, true, a]), a),
        (terms.disjunction([a, false, a]), a),
        (terms.conjunction(iter([a, false, b])), false),
        (terms.disjunction([a, true, b]), true),
        (terms.negation(terms.negation(a)), a),
        (terms.negation(true), false),
        (terms.negation(false), true),
        (terms.implication(true, b), b),
        (terms.implication(false, b), true),
        (terms.implication(a, true), true),
        (terms.implication(a, false), terms.negation(a)),
    ):
        assert formula is folded
    assert set(terms.conjunction([a, b, a]).args()) == {a, b}
    comparison = terms.greater(X - Y + 1)
    assert terms.greater(constant(1) - Y + X) is comparison
    assert terms.at_least(X - Y + 1) is not comparison
    assert terms.fresh_boolean("a") is not terms.fresh_boolean("a")
    assert terms.real(X_NAME) is terms.real(Auxiliary("x", 1))
    assert terms.real(X_NAME) is not terms.real(Auxiliary("x", 2))
    with pytest.raises(UnsupportedError, match="non-linear"):
        terms.at_least(X * Y)
    assert terms.at_least(constant(2) * X) is terms.at_least(X.scaled(2))


def test_variables_and_size_even_of_deep_formulas(terms) -> None:
    formula = terms.conjunction([terms.greater(X), terms.greater(X - Y)])
    assert terms.variables(formula) == {terms.real(X_NAME), terms.real(Y_NAME)}
    assert terms.variables(terms.true) == frozenset()
    assert (terms.size(terms.true), terms.size(terms.greater(X))) == (1, 3)
    assert terms.size(formula) > terms.size(formula.arg(1))
    formula = terms.at_least(X)
    for index in range(5000):
        other = terms.fresh_boolean("d")
        formula = terms.conjunction([formula, other]) if index % 2 else terms.disjunction([formula, other])
    assert terms.size(formula) > 10_000
    session = Session(terms)
    session.add(formula)
    assert session.check("deep") is SAT


SMALL = st.fractions(-3, 3, max_denominator=3)


@drawn(40)
@given(st.tuples(*[SMALL] * 5), st.sampled_from(Relation), st.sampled_from(["z3", "cvc5"]))
def test_a_comparison_means_what_it_says(numbers, relation, solver) -> None:
    a, b, c, x, y = numbers
    terms = Terms()
    session = Session(terms, solver=solver)
    session.add(terms.equal(X - x), terms.equal(Y - y), terms.compare(X.scaled(a) + Y.scaled(b) + c, relation))
    assert session.check("comparison") is (SAT if relation.holds(a * x + b * y + c) else UNSAT)


def agree(text: str) -> str:
    """The verdict, which an exported file itself and the parsers of z3 and cvc5 must agree on."""
    (claimed,) = (line.removeprefix("; answer: ") for line in text.splitlines() if line.startswith("; answer: "))
    by_z3, by_cvc5, answer = z3.Solver(), cvc5.Solver(cvc5.TermManager()), ""
    by_z3.from_string(text)
    parser = cvc5.InputParser(by_cvc5)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "exported")
    while not (command := parser.nextCommand()).isNull():
        answer += str(command.invoke(by_cvc5, parser.getSymbolManager()))
    assert str(by_z3.check()) == answer.strip() == claimed
    return claimed


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_every_exported_query_is_read_and_answered_alike(tmp_path, solver) -> None:
    k = reference("k")
    i = action("i", flow(F, -1), (ALL, Or((above(value(F), 1), different(value(F), -1)))))
    j = action("j", flow(F, 2), (END, above(value(F), 1)))
    lengths = (between(i.start, i.end, 1, k + 1), between(j.start, j.end, 4, 6))
    constraints = (between(ZERO, i.start, 1, 1), between(ZERO, j.start, 0, k), *lengths)
    plan = plan_of(i, j, f=3, constraints=constraints, parameters=(Parameter("k", Fraction(3)),))
    check(plan, every=True, solver=solver, smt2=tmp_path / "check")
    envelope(plan, method="irr", beta=Fraction(1, 2), solver=solver, smt2=tmp_path / "envelope")
    files = sorted(tmp_path.rglob("*.smt2"))
    assert {agree(path.read_text(encoding="utf-8")) for path in files} == {"sat", "unsat"}
    assert [path.name[:5] for path in sorted((tmp_path / "check").iterdir())][:2] == ["00001", "00002"]


@pytest.mark.parametrize(
    "name",
    ["k", "i0.k", "2k", "let", "and", "true", "Real", "check-sat", "_", "!", "as", "BINARY", "-k", "k:k", "é", "k#"],
)
def test_any_parameter_name_can_be_exported(tmp_path, terms, name) -> None:
    expression = variable(ParameterReference(name)) - Fraction(1, 3)
    session = Session(terms, exporter=Exporter(tmp_path))
    session.add(terms.greater(expression), terms.fresh_boolean("[(p a) before i.start]"))
    session.check("a name")
    session.add(terms.greater(-expression))
    session.check("a name, contradicted")
    assert [agree(path.read_text(encoding="utf-8")) for path in sorted(tmp_path.iterdir())] == ["sat", "unsat"]


def test_scripts_of_nothing_of_exact_numbers_and_of_questions_of_several_lines(tmp_path, terms) -> None:
    """Files are numbered and named after the question."""
    exporter = Exporter(tmp_path / "new" / "directory")
    first = exporter.write(terms, [], "i0 act: over all (>= (f) 1)", "sat")
    second = exporter.write(terms, [], "x" * 200, "unknown")
    assert (first.name, second.name) == ("00001-i0-act-over-all-f-1.smt2", f"00002-{'x' * 60}.smt2")
    tiny, x = Fraction(-1, 3**40), variable(Auxiliary("x", 1))
    text = smtlib(terms, [terms.greater(x), terms.greater(-x)], "first\nsecond (assert true)", "unsat")
    assert text.splitlines()[:3] == ["; first", "; second (assert true)", "; answer: unsat"]
    assert agree(text) == "unsat"
    assert agree(smtlib(Terms(), [], "nothing", "sat")) == "sat"
    for relation, answer in ((terms.equal, "sat"), (terms.greater, "unsat")):
        text = smtlib(terms, [terms.equal(x.scaled(tiny) - tiny * 2), relation(x - 2)], "exact", answer)
        assert agree(text) == answer


def test_ctrl_c_while_a_context_is_freed_leaves_no_pointer_to_it(terms, monkeypatch) -> None:
    """What is finalised after a context asks it whether it is still there; a signal is raised once freeing returns."""
    with one_question():
        question = current_question()
        assert question is not None
        question.first = False
        Session(terms, solver="z3")
        context = question.context
    pointer, freed = context.ref(), []

    def interrupted(freed_pointer: object) -> None:
        freed.append((freed_pointer, context.ref()))
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, suppress(KeyboardInterrupt):
        patched.setattr(z3, "Z3_del_context", interrupted)
        context.__del__()
    assert freed == [(pointer, None)]
    context.ctx = pointer
