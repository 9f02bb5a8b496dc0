"""False claims with synthesised certificates: none is accepted, and nothing ends in an unexpected exception."""

from __future__ import annotations

import pytest

from robust.certify.checker import proofs, reader
from robust.certify.checker.formulas import Formulas
from tests.certify import forgeries, tools
from tests.certify.adversary import cases, run
from tests.certify.bank import free, meanings


def test_no_false_claim_is_accepted() -> None:
    outcome = run(1_000, plans=25)
    assert outcome.accepted == []
    assert sum(outcome.rejected.values()) > 950
    assert len(outcome.rejected) > 15, "the attempts fail for few reasons only"


@pytest.mark.slow
def test_no_false_claim_of_very_many_is_accepted() -> None:
    for seed in range(10):
        assert run(10_000, plans=40, seed=1_000 * (seed + 1)).accepted == []


def test_honest_certificates_of_the_cases_are_accepted() -> None:
    """Otherwise nothing would follow from the rejections."""
    kinds = set()
    for case in cases(12):
        for lines in case.honest:
            if not isinstance(case.attempt(lines), str):
                kinds.add(lines[0][1])
    assert kinds >= {"box", "maximal", "region"}


@pytest.mark.parametrize("case", [*forgeries.honest()], ids=lambda case: case[0])
def test_what_forgeries_are_made_of_is_accepted(case) -> None:
    _, texts, lines = case
    assert not isinstance(tools.judged(lines, reader.ground(*texts)), str)


@pytest.mark.parametrize("case", [*forgeries.made_up()], ids=lambda case: case[0])
def test_a_forgery_is_rejected(case) -> None:
    _, texts, lines = case
    assert isinstance(tools.judged(lines, reader.ground(*texts)), str)


@pytest.mark.parametrize("case", [*forgeries.without_meaning()], ids=lambda case: case[0])
def test_what_has_no_meaning_is_not_given_one(case) -> None:
    with pytest.raises(reader.Unsupported):
        assert [make() for _, make in Formulas(reader.ground(*case[1]), tools.EPSILON).obligations()]


def test_formulas_over_all_times_say_of_each_schedule_what_the_simulator_says() -> None:
    """Conditional effects, assignments and flows in any order; and a parameter that is an initial value."""
    judged = [*free(1_000, 60), *meanings()]
    assert len(judged) > 40
    assert all(holds(tools.CHECKER) for _, holds in judged)


def test_false_orders_leave_a_value_without_a_last_assignment() -> None:
    """All assignments come before others, by orders that contradict each other: no exception but a rejection."""
    texts = forgeries.two_actions(["(at end (assign (f) 2))"], "(> (f) 1)")
    ground = reader.ground(*texts)
    formulas = Formulas(ground, tools.EPSILON)
    ends = [number for number, effects in enumerate(ground.effects) if effects]
    formulas.known.update({(a, b): tools.EPSILON for a in ends for b in ends if a != b})
    assert all(make() for _, make in formulas.obligations())


@pytest.mark.parametrize("name", ["imply", "lemma", "demand"])
def test_a_checker_that_believes_more_is_found_out(name, monkeypatch) -> None:
    """The adversary is no decoration: without one of the checks it gets false claims through."""
    if name == "imply":
        monkeypatch.setattr(proofs.Facts, "imply", lambda *_, **__: None)
    elif name == "lemma":
        monkeypatch.setattr(proofs, "lemma", lambda *_: None)
    else:
        monkeypatch.setattr(proofs, "demand", lambda *_: None)
    assert any(run(200, plans=5, seed=seed).accepted for seed in range(50))
