"""False claims with synthesised certificates: none is accepted, and nothing ends in an unexpected exception."""

from __future__ import annotations

import pytest

from robust.certify.checker import proofs
from tests.certify.adversary import cases, run


def test_no_false_claim_is_accepted() -> None:
    outcome = run(2_000, plans=25)
    assert outcome.accepted == []
    assert sum(outcome.rejected.values()) > 1_900
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


@pytest.mark.parametrize("name", ["imply", "lemma", "demand"])
def test_a_checker_that_believes_more_is_found_out(name, monkeypatch) -> None:
    """The adversary is no decoration: without one of the checks it gets false claims through."""
    if name == "imply":
        monkeypatch.setattr(proofs.Facts, "imply", lambda *_, **__: None)
    elif name == "lemma":
        monkeypatch.setattr(proofs, "lemma", lambda *_: None)
    else:
        monkeypatch.setattr(proofs, "demand", lambda *_: None)
    assert run(2_000, plans=25).accepted
