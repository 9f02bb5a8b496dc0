"""Sessions: frames, models, statistics, time limits and interruption, for every solver."""

import faulthandler
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from fractions import Fraction
from functools import partial
from itertools import combinations
from pathlib import Path

import pytest

from robust.encode.interface import Auxiliary, constant, variable
from robust.errors import SolverError
from robust.smt.limits import Deadline
from robust.smt.session import BACKENDS, Satisfiability, Session, Statistics
from robust.smt.terms import Terms
from tests.children import is_running

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
    session = Session(terms, solver=solver)
    session.add(terms.at_least(X))
    with session.frame(terms.at_least(Y - X)):
        assert session.check("y ≥ x ≥ 0") is SAT
        with session.frame(terms.greater(-Y)):
            assert session.check("0 > y ≥ x ≥ 0") is UNSAT
            assert len(session.assertions) == 3
        assert session.check("y ≥ x ≥ 0 again") is SAT
    with suppress(ZeroDivisionError), session.frame(terms.false):
        assert session.check("false") is UNSAT
        raise ZeroDivisionError
    with session.frame(terms.greater(-Y)):
        assert session.check("0 > y, x ≥ 0") is SAT
    assert session.assertions == [terms.at_least(X)]


@both_solvers
def test_values_are_exact_and_satisfy_the_assertions(solver, terms) -> None:
    session = Session(terms, solver=solver)
    big = Fraction(10**40 + 1, 3**50)
    session.add(terms.equal(X - constant(big)), terms.greater(Y - X), terms.greater(X + Fraction(1, 10**30) - Y))
    assert session.check("values") is SAT
    x, y = session.values(map(terms.real, (X_NAME, Y_NAME))).values()
    assert isinstance(x, Fraction)
    assert isinstance(y, Fraction)
    assert big == x < y < big + Fraction(1, 10**30)


@both_solvers
def test_values_of_truths_and_of_symbols_that_were_never_asserted(solver, terms) -> None:
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
    above, below = (session.values([terms.real(X_NAME)]).popitem()[1] for session in (first, second))
    assert above > 0 > below
    second.add(terms.greater(X))
    second.check("unsat")
    second.check("unsat again")
    counts = shared.as_dict()
    assert counts.pop("nodes") > 0
    assert counts.pop("seconds") > 0
    assert counts == {"queries": 4, "satisfiable": 2, "unsatisfiable": 2, "unknown": 0}
    assert Session(terms, solver=solver).statistics == Statistics()


@both_solvers
def test_a_deadline_that_has_passed_answers_unknown_at_once(solver, terms) -> None:
    with pytest.raises(SolverError, match=solver):
        Session(terms, solver=f"{solver}0")
    session = Session(terms, solver=solver)
    session.add(terms.false)
    assert session.check("false", Deadline.after(0)) is UNKNOWN
    assert session.check("false", Deadline.after(None)) is UNSAT


# -- a query that no solver answers within minutes ------------------------------------------------------------------


def hard_session(solver: str) -> Session:
    """A session whose next check takes minutes: twenty starts, each a unit from each other, in less than 19 units."""
    terms, starts = Terms(), [variable(Auxiliary("start", index)) for index in range(20)]
    session = Session(terms, solver=solver)
    session.add(*map(terms.at_least, starts), *(terms.greater(constant(19) - start) for start in starts))
    for a, b in combinations(starts, 2):
        session.add(terms.disjunction((terms.at_least(a - b - 1), terms.at_least(b - a - 1))))
    return session


@both_solvers
@pytest.mark.parametrize("seconds", [0.05, 0.7])
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
    session, x = Session(terms, solver="cvc5"), terms.real(X_NAME)
    session.add(terms.equal(X - Fraction(1, 3)))
    assert session.check("one") is SAT
    with monkeypatch.context() as patch:
        patch.setattr("robust.smt.session._solve", lambda _solver: dying(death))
        assert session.check("two") is UNKNOWN
    assert session.statistics.failures == [f"cvc5 {why}, asked: two"]
    with session.frame(terms.greater(X - 1)):
        assert session.check("three") is UNSAT
    assert session.failure is None
    assert session.check("four") is SAT
    assert session.values([x]) == {x.symbol_name(): Fraction(1, 3)}
    assert session.statistics.as_dict().keys() == Statistics().as_dict().keys()


def dying(death: Callable[[], object]) -> None:
    """Ends this process, which must not be that of the tests."""
    assert os.getppid() == TESTS
    faulthandler.disable()
    death()


TESTS = os.getpid()


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
@pytest.mark.parametrize("delay", [0.03, 1.0])
def test_ctrl_c_ends_a_query_within_a_second(solver, delay) -> None:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-c", INTERRUPTED, solver]
    with subprocess.Popen(
        command, env=environment, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            time.sleep(delay)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert (out, process.returncode) == ("interrupted\n", 0), err
    members = (int(path.name) for path in Path("/proc").glob("[0-9]*") if _group(path) == process.pid)
    assert not any(map(is_running, members)), "nothing is left in its session"


def _group(process: Path) -> int | None:
    with suppress(OSError):
        return int((process / "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[2])
    return None
