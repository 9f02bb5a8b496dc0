"""Sessions: frames, models, statistics, time limits and interruption, for every solver."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest

from robust.encode.variables import Auxiliary, constant, variable
from robust.errors import SolverError
from robust.smt.limits import Deadline
from robust.smt.session import BACKENDS, Session, Statistics, Verdict
from robust.smt.terms import Terms
from tests.smt.hard import hard_session

X, Y = variable(Auxiliary("x", 1)), variable(Auxiliary("y", 2))
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
    verdicts = []
    with session.frame(terms.at_least(Y - X)):
        verdicts.append(session.check("y ≥ x ≥ 0"))
        with session.frame(terms.greater(-Y)):
            verdicts.append(session.check("0 > y ≥ x ≥ 0"))
            assert len(session.assertions) == 3
        verdicts.append(session.check("y ≥ x ≥ 0 again"))
    with session.frame(terms.greater(-Y)):
        verdicts.append(session.check("0 > y, x ≥ 0"))
    sat, unsat = Verdict.SATISFIABLE, Verdict.UNSATISFIABLE
    assert verdicts == [sat, unsat, sat, sat]
    assert session.assertions == [terms.at_least(X)]


@both_solvers
def test_a_frame_is_left_when_its_block_raises(solver, terms) -> None:
    session = Session(terms, solver=solver)

    def fail() -> None:
        with session.frame(terms.false):
            assert session.check("false") is Verdict.UNSATISFIABLE
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert session.check("nothing") is Verdict.SATISFIABLE


@both_solvers
def test_values_are_exact_and_satisfy_the_assertions(solver, terms) -> None:
    session = Session(terms, solver=solver)
    big = Fraction(10**40 + 1, 3**50)
    session.add(terms.equal(X - constant(big)), terms.greater(Y - X), terms.greater(X + Fraction(1, 10**30) - Y))
    assert session.check("values") is Verdict.SATISFIABLE
    x, y = terms.real(Auxiliary("x", 1)), terms.real(Auxiliary("y", 2))
    values = session.values([x, y])
    assert values[x.symbol_name()] == big
    assert big < values[y.symbol_name()] < big + Fraction(1, 10**30)
    assert all(isinstance(value, Fraction) for value in values.values())


@both_solvers
def test_values_of_truths_and_of_symbols_that_were_never_asserted(solver, terms) -> None:
    session = Session(terms, solver=solver)
    truth = terms.fresh_boolean("b")
    session.add(terms.negation(truth))
    with session.frame(terms.at_least(X)):
        assert session.check("a frame's symbol") is Verdict.SATISFIABLE
        assert terms.real(Auxiliary("x", 1)).symbol_name() in session.values([terms.real(Auxiliary("x", 1))])
    assert session.check("after the frame") is Verdict.SATISFIABLE
    values = session.values([truth, terms.real(Auxiliary("x", 1)), terms.real("never")])
    assert values == {truth.symbol_name(): False}


@both_solvers
def test_sessions_over_the_same_terms_are_independent(solver, terms) -> None:
    first, second = Session(terms, solver=solver), Session(terms, solver=solver)
    first.add(terms.greater(X))
    second.add(terms.greater(-X))
    assert first.check("x > 0") is Verdict.SATISFIABLE
    assert second.check("x < 0") is Verdict.SATISFIABLE
    x = terms.real(Auxiliary("x", 1))
    assert first.values([x])[x.symbol_name()] > 0 > second.values([x])[x.symbol_name()]


@both_solvers
def test_statistics_are_shared_and_count_every_query(solver, terms) -> None:
    statistics = Statistics()
    one = Session(terms, solver=solver, statistics=statistics)
    two = Session(terms, solver=solver, statistics=statistics)
    one.add(terms.at_least(X))
    one.check("sat")
    two.add(terms.greater(X), terms.greater(-X))
    two.check("unsat")
    two.check("unsat again")
    assert (statistics.queries, statistics.satisfiable, statistics.unsatisfiable, statistics.unknown) == (3, 1, 2, 0)
    assert statistics.nodes > 0
    assert statistics.seconds > 0
    assert statistics.as_dict()["queries"] == 3


def test_sessions_do_not_share_statistics_unless_told(terms) -> None:
    one, two = Session(terms), Session(terms)
    one.check("nothing")
    assert (one.statistics.queries, two.statistics.queries) == (1, 0)


def test_unknown_solver_names_the_known_ones(terms) -> None:
    with pytest.raises(SolverError, match="z3"):
        Session(terms, solver="z4")


@both_solvers
def test_a_deadline_that_has_passed_answers_unknown_at_once(solver, terms) -> None:
    session = Session(terms, solver=solver)
    session.add(terms.false)
    assert session.check("false", Deadline.after(0)) is Verdict.UNKNOWN
    assert session.check("false", Deadline.after(None)) is Verdict.UNSATISFIABLE


def _processor_seconds() -> float:
    """What this process and its ended children have computed, however busy the machine is."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


@both_solvers
@pytest.mark.parametrize("seconds", [0.05, 0.7])
def test_time_limit_ends_a_hard_query_about_on_time(solver, seconds) -> None:
    session = hard_session(solver)
    started, worked = time.monotonic(), _processor_seconds()
    assert session.check("job shop", Deadline.after(seconds)) is Verdict.UNKNOWN
    assert 0.9 * seconds <= time.monotonic() - started < seconds + PATIENCE
    assert _processor_seconds() - worked < seconds + 1
    assert session.statistics.unknown == 1


@both_solvers
def test_a_session_can_be_used_after_a_time_out(solver) -> None:
    session = hard_session(solver)
    assert session.check("job shop", Deadline.after(0.3)) is Verdict.UNKNOWN
    with session.frame(session.terms.greater(-variable(Auxiliary("start", 0)) - 10000)):
        assert session.check("a start before zero", Deadline.after(30)) is Verdict.UNSATISFIABLE


def test_values_survive_the_copy_that_a_slow_cvc5_query_runs_in(monkeypatch, terms) -> None:
    session = Session(terms, solver="cvc5")
    backend = session._backend
    copies = []
    original = backend._check_in_copy

    def in_copy(deadline, symbols):
        copies.append(symbols)
        return original(deadline, symbols)

    monkeypatch.setattr(backend, "_check_in_copy", in_copy)
    monkeypatch.setattr("robust.smt.session._solve", _unknown_once())
    truth = terms.fresh_boolean("b")
    session.add(terms.equal(X - Fraction(1, 3)), truth)
    assert session.check("in a copy") is Verdict.SATISFIABLE
    x = terms.real(Auxiliary("x", 1))
    assert session.values([x, truth]) == {x.symbol_name(): Fraction(1, 3), truth.symbol_name(): True}
    assert len(copies) == 1
    # The next query is answered in this process, and its values are not those of the copy.
    with session.frame(terms.greater(Y - 5)):
        assert session.check("here") is Verdict.SATISFIABLE
        y = terms.real(Auxiliary("y", 2))
        assert session.values([y])[y.symbol_name()] > 5
    assert len(copies) == 1


def _unknown_once():
    from robust.smt.session import _solve  # noqa: PLC0415 - the function before it is replaced

    parent, calls = os.getpid(), []

    def solve(solver):
        calls.append(solver)
        return Verdict.UNKNOWN if len(calls) == 1 and os.getpid() == parent else _solve(solver)

    return solve


INTERRUPTED = """
import sys, time
from robust.smt.session import Verdict
from tests.smt.hard import hard_session
session = hard_session(sys.argv[1])
print("ready", flush=True)
try:
    print(session.check("job shop"))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@both_solvers
@pytest.mark.parametrize("delay", [0.03, 1.0])
def test_ctrl_c_ends_a_query_within_a_second(solver, delay) -> None:
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, solver],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            time.sleep(delay)
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
            elapsed = time.monotonic() - sent
        finally:
            process.kill()
    assert out == "interrupted\n", err
    assert elapsed < PATIENCE
    assert process.returncode == 0
    assert _processes_of_group(process.pid) == []


def _processes_of_group(group: int) -> list[int]:
    """Processes left behind in the session of a process that has ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text(encoding="utf-8").rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found
