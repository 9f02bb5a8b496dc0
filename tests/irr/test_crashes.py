"""A solver that kills its process at one question: that question is unknown, and nothing else is lost."""

from __future__ import annotations

import faulthandler
import os
from collections.abc import Callable

import pytest

from robust.api import check, envelope, region
from robust.encode import create_encoding
from robust.irr.check import Answer
from robust.irr.containment import Containment
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.compute import RegionStatus
from robust.qe.eliminate import cvc5_native, z3_tactics
from robust.qe.nnf import ExpressionReader
from robust.searching import Status
from robust.smt import session as sessions
from robust.smt.limits import NEVER
from robust.smt.session import Session
from tests.cli.running import answer_of, assert_one_line, command, example
from tests.irr.building import ask_solvers

FILES = example()
BY_CVC5 = {"solver": "cvc5", "encoding": "positions"}
OPTIONS = ("--solver", "cvc5", "--encoding", "positions")
TESTS = os.getpid()


def die() -> None:
    """As cvc5 does, in a copy of this process."""
    assert os.getpid() != TESTS
    faulthandler.disable()
    os.abort()


@pytest.fixture
def plan() -> ParametrizedPlan:
    return load_plan(*FILES)


@pytest.fixture
def dies_at(monkeypatch) -> Callable[[Callable[[str], bool]], list[str]]:
    """Makes cvc5 abort at the questions that are said; the questions asked so far."""

    def arrange(fatal: Callable[[str], bool]) -> list[str]:
        asked: list[str] = []
        check_, solve = Session.check, sessions._solve

        def noted(self: Session, question: str, deadline=NEVER, effort=0):
            asked.append(question)
            return check_(self, question, deadline, effort)

        ask_solvers(monkeypatch)
        monkeypatch.setattr(Session, "check", noted)

        def solved(solver):
            # What is asked of z3, by the way, is asked in this process.
            return die() if os.getpid() != TESTS and fatal(asked[-1]) else solve(solver)

        monkeypatch.setattr(sessions, "_solve", solved)
        return asked

    return arrange


def reason(question: str) -> str:
    return f"cvc5 ended with signal SIGABRT, asked: {question}"


# -- check -----------------------------------------------------------------------------------------------------------


def fatal_obligation(plan: ParametrizedPlan) -> str:
    """One in the middle that a solver has to prove."""
    encoding = create_encoding("positions", plan)
    names = [one.name for one in encoding.obligations if one.violation is not encoding.terms.false]
    return names[len(names) // 2]


def test_check_answers_the_other_obligations(plan, dies_at):
    fatal = fatal_obligation(plan)
    dies_at(fatal.__eq__)
    found = check(plan, **BY_CVC5)
    assert (found.answer, found.reason, found.timed_out) == (Answer.UNKNOWN, reason(fatal), False)
    unknown = {name for name, answer in found.obligations.items() if answer is not Answer.PROVED}
    assert unknown == {fatal}
    assert check(plan, **BY_CVC5, timeout=600).reason == reason(fatal)
    ended = command("check", *FILES, *OPTIONS)
    assert (ended.code, ended.out.splitlines()[0]) == (3, f"unknown: {reason(fatal)}")
    ended = command("check", *FILES, *OPTIONS, "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["verdict"], answer["reason"]) == (3, "unknown", reason(fatal))
    assert (answer["timeout"], answer["interrupted"]) == (False, False)


def test_check_refutes_all_the_same(dies_at):
    files = example("plan-flexible-wait.stn")
    plan = load_plan(*files)
    refuted = check(plan, every=True, **BY_CVC5).counterexamples
    fatal = next(name for name in fatal_order(plan) if name not in refuted)
    dies_at(fatal.__eq__)
    found = check(plan, every=True, **BY_CVC5)
    assert (found.answer, found.obligations[fatal]) == (Answer.REFUTED, Answer.UNKNOWN)
    assert found.counterexamples.keys() == refuted.keys()
    assert command("check", *files, *OPTIONS).code == 1


def fatal_order(plan: ParametrizedPlan) -> list[str]:
    encoding = create_encoding("positions", plan)
    return [one.name for one in encoding.obligations if one.violation is not encoding.terms.false]


def test_check_counts_its_failures(plan, dies_at):
    asked = dies_at(lambda _question: True)
    found = check(plan, **BY_CVC5)
    assert found.reason == f"{reason(asked[0])} (and {len(asked) - 1} more)"
    assert len(asked) > 2


# -- boxes and regions -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "number"), [("irr", 0), ("irr", 20), ("widen", 12), ("widen", 24), ("optimal", 12), ("optimal", 24)]
)
def test_boxes_so_far_are_kept(plan, dies_at, method, number):
    """Whatever the question is that it dies at: the box was proved, and nothing says that it is maximal."""
    asked: list[str] = []
    asked = dies_at(lambda _question: len(asked) > number)
    found = envelope(plan, method=method, **BY_CVC5)
    assert len(asked) > number
    assert found.status is Status.UNKNOWN
    assert found.reason.startswith(reason(""))
    assert found.cut_short
    if found.verified:
        assert Containment(create_encoding("relational", plan)).refute(found.box, NEVER) is None


@pytest.mark.slow
def test_some_box_is_found_before_it_dies(plan, dies_at):
    last: int | None = None
    asked = dies_at(lambda _question: last is not None and len(asked) > last)
    whole = envelope(plan, **BY_CVC5)
    last = len(asked) * 2 // 3
    asked.clear()
    found = envelope(plan, **BY_CVC5)
    assert found.verified
    assert whole.status is Status.COMPLETE
    first = found.box
    asked.clear()
    ended = command("envelope", *FILES, *OPTIONS)
    assert ended.code == 3
    assert "cvc5 ended with signal SIGABRT, asked: " in ended.out
    assert "the best box so far; sound, not maximal" in ended.out
    asked.clear()
    answer = answer_of(command("envelope", *FILES, *OPTIONS, "--json"))
    assert (answer["status"], answer["verified"]) == ("unknown", True)
    assert answer["reason"] == found.reason
    assert {name: ends["lower"] for name, ends in answer["parameters"].items()} == {
        name: str(interval.lower) for name, interval in first.intervals.items()
    }


def test_regions_so_far_are_kept(plan, dies_at):
    whole = region(plan)
    asked: list[str] = []
    asked = dies_at(lambda _question: len(asked) > 12)
    found = region(plan, **BY_CVC5)
    assert found.status is RegionStatus.UNKNOWN
    assert found.reason.startswith(reason(""))
    assert not found.is_exact
    assert whole.region.is_subset_of(found.region)
    asked.clear()
    ended = command("region", *FILES, *OPTIONS)
    assert (ended.code, "SIGABRT" in ended.out, "an outer bound" in ended.out) == (3, True, True)
    asked.clear()
    answer = answer_of(command("region", *FILES, *OPTIONS, "--json"))
    assert (answer["status"], answer["reason"]) == ("unknown", found.reason)
    asked.clear()
    assert command("compare", *FILES, *OPTIONS).code == 3


@pytest.mark.parametrize(("backend", "eliminator"), [("cvc5", cvc5_native.Cvc5Disjuncts), ("z3", z3_tactics.Z3Tactic)])
def test_a_back_end_of_elimination_that_dies(plan, monkeypatch, backend, eliminator):
    """The process that eliminates dies at the third problem."""
    whole, problems = region(plan), []
    eliminate, reader = eliminator.eliminate, ExpressionReader.read

    def counted(self, query, *rest):
        problems.append(query.name)
        return eliminate(self, query, *rest)

    monkeypatch.setattr(eliminator, "eliminate", counted)
    monkeypatch.setattr(ExpressionReader, "read", lambda *a: die() if len(problems) > 2 else reader(*a))
    found = region(plan, backend=backend)
    assert (found.status, found.reason) == (RegionStatus.UNKNOWN, "quantifier elimination ended with signal SIGABRT")
    assert whole.region.is_subset_of(found.region)


def test_certificates_say_why_there_is_none(dies_at, tmp_path):
    dies_at(lambda _question: True)
    ended = command("certify", *FILES, *OPTIONS, "--kind", "maximal", "--output", tmp_path / "plan.cert")
    assert_one_line(ended, 3)
    assert "cvc5 ended with signal SIGABRT" in ended.err
