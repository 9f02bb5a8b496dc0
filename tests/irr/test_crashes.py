"""A solver that kills its process at one question: that question is unknown, and nothing else is lost."""

import faulthandler
import os
from collections.abc import Callable

import pytest

from robust import Answer, ParametrizedPlan, RegionStatus, Status, check, envelope, region
from robust.encode import create_encoding
from robust.irr.containment import Containment
from robust.qe.eliminate import cvc5_native, z3_tactics
from robust.qe.nnf import ExpressionReader
from robust.smt import session as sessions
from robust.smt.limits import NEVER
from robust.smt.session import Session
from tests.cli.running import answer_of, assert_one_line, command, example
from tests.irr.building import ask_solvers, shipped

FILES = example()
BY_CVC5 = {"solver": "cvc5", "encoding": "positions"}
OPTIONS = ("--solver", "cvc5", "--encoding", "positions")
ABORTED = "cvc5 ended with signal SIGABRT, asked: "
TESTS = os.getpid()
PLAN = shipped("two_sample_navigation")


def die() -> None:
    """As cvc5 does, in a copy of this process."""
    assert os.getpid() != TESTS
    faulthandler.disable()
    os.abort()


@pytest.fixture
def dies_at(monkeypatch) -> Callable[[Callable[[list[str]], bool]], list[str]]:
    """Makes cvc5 abort where the questions asked so far, which come back, say so."""

    def arrange(fatal: Callable[[list[str]], bool]) -> list[str]:
        asked: list[str] = []
        check_, solve = Session.check, sessions._solve

        def noted(self: Session, question: str, deadline=NEVER, effort=0):
            asked.append(question)
            return check_(self, question, deadline, effort)

        ask_solvers(monkeypatch)
        monkeypatch.setattr(Session, "check", noted)
        # What is asked of z3, by the way, is asked in this process.
        monkeypatch.setattr(sessions, "_solve", lambda s: die() if os.getpid() != TESTS and fatal(asked) else solve(s))
        return asked

    return arrange


def asked_of_solvers(plan: ParametrizedPlan) -> list[str]:
    """Obligations that a solver has to prove."""
    encoding = create_encoding("positions", plan)
    return [one.name for one in encoding.obligations if one.violation is not None]


def test_check_answers_the_other_obligations(dies_at):
    names = asked_of_solvers(PLAN)
    fatal = names[len(names) // 2]
    dies_at(lambda asked: asked[-1] == fatal)
    result = check(PLAN, **BY_CVC5, timeout=600)
    assert (result.answer, result.reason, result.timed_out) == (Answer.UNKNOWN, ABORTED + fatal, False)
    assert {name for name, answer in result.obligations.items() if answer is not Answer.PROVED} == {fatal}
    ended = command("check", *FILES, *OPTIONS)
    assert (ended.code, ended.out.splitlines()[0]) == (3, f"unknown: {ABORTED}{fatal}")
    ended = command("check", *FILES, *OPTIONS, "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["verdict"], answer["reason"]) == (3, "unknown", ABORTED + fatal)
    assert (answer["timeout"], answer["interrupted"]) == (False, False)


def test_check_refutes_all_the_same(dies_at):
    plan = shipped("two_sample_navigation", plan="plan-flexible-wait.stn")
    refuted = check(plan, every=True).counterexamples
    fatal = next(name for name in asked_of_solvers(plan) if name not in refuted)
    dies_at(lambda asked: asked[-1] == fatal)
    result = check(plan, every=True, **BY_CVC5)
    assert (result.answer, result.obligations[fatal]) == (Answer.REFUTED, Answer.UNKNOWN)
    assert result.counterexamples.keys() == refuted.keys()
    assert command("check", *example("plan-flexible-wait.stn"), *OPTIONS).code == 1


def test_failures_are_counted_and_certificates_say_why_there_is_none(dies_at, tmp_path):
    asked = dies_at(lambda _: True)
    assert check(PLAN, **BY_CVC5).reason == f"{ABORTED}{asked[0]} (and {len(asked) - 1} more)"
    assert len(asked) > 2
    ended = command("certify", *FILES, *OPTIONS, "--kind", "maximal", "--output", tmp_path / "plan.cert")
    assert_one_line(ended, 3)
    assert "cvc5 ended with signal SIGABRT" in ended.err


@pytest.mark.parametrize(
    ("method", "number"), [("irr", 0), ("irr", 20), ("widen", 12), ("widen", 24), ("optimal", 12), ("optimal", 24)]
)
def test_boxes_so_far_are_kept(dies_at, method, number):
    """Whatever the question is that it dies at: the box was proved, and nothing says that it is maximal."""
    asked = dies_at(lambda asked: len(asked) > number)
    result = envelope(PLAN, method=method, **BY_CVC5)
    assert len(asked) > number
    assert (result.status, result.cut_short) == (Status.UNKNOWN, True)
    assert result.reason.startswith(ABORTED)
    if result.verified:
        assert Containment(create_encoding("relational", PLAN)).refute(result.box, NEVER) is None


def test_regions_so_far_are_kept(dies_at):
    whole = region(PLAN).region
    asked = dies_at(lambda asked: len(asked) > 6)
    result = region(PLAN, **BY_CVC5)
    assert (result.status, result.is_exact) == (RegionStatus.UNKNOWN, False)
    assert result.reason.startswith(ABORTED)
    assert whole.is_subset_of(result.region)
    asked.clear()
    ended = command("region", *FILES, *OPTIONS)
    assert (ended.code, "SIGABRT" in ended.out, "an outer bound" in ended.out) == (3, True, True)
    answer = result.as_dict()
    assert (answer["status"], answer["reason"]) == ("unknown", result.reason)
    assert command("compare", *FILES, *OPTIONS).code == 3


@pytest.mark.parametrize(("backend", "eliminator"), [("cvc5", cvc5_native.Cvc5Disjuncts), ("z3", z3_tactics.Z3Tactic)])
def test_a_back_end_of_elimination_that_dies(monkeypatch, backend, eliminator):
    """The process that eliminates dies at the third problem."""
    whole, problems = region(PLAN).region, []
    eliminate, reader = eliminator.eliminate, ExpressionReader.read

    def counted(self, query, *rest):
        problems.append(query.name)
        return eliminate(self, query, *rest)

    monkeypatch.setattr(eliminator, "eliminate", counted)
    monkeypatch.setattr(ExpressionReader, "read", lambda *a: die() if len(problems) > 2 else reader(*a))
    result = region(PLAN, backend=backend)
    assert (result.status, result.reason) == (RegionStatus.UNKNOWN, "quantifier elimination ended with signal SIGABRT")
    assert whole.is_subset_of(result.region)
