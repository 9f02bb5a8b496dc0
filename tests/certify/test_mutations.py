"""Changed certificates: each is rejected, or still establishes something true."""

import pytest

from tests.certify.mutations import CASES, ELSEWHERE, REJECTED, TRUE, outcomes, run, table


@pytest.mark.parametrize("case", CASES)
def test_changed_certificates_are_rejected_or_true(case, tmp_path):
    made = CASES[case](tmp_path / "original.cert")
    found = outcomes(tmp_path / "original.cert", *made, count=100, seed=1)
    rejected = sum(count for (_, outcome), count in found.items() if outcome == REJECTED)
    assert sum(found.values()) == 100
    assert rejected > 50


@pytest.mark.slow
def test_ten_thousand_changed_certificates_are_rejected_or_true(tmp_path):
    found = run(10_000, tmp_path, seed=2)
    print(table(found))
    assert sum(found.values()) == 10_000
    assert {outcome for _, outcome in found} == {REJECTED, ELSEWHERE, TRUE}
    assert all(found[way, REJECTED] for way, _ in found)
