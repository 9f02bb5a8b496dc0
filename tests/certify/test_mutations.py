"""Changed certificates: each is rejected, or still establishes something true."""

import time
from random import Random

import pytest

from robust.certify.matching import mismatch
from robust.smt.limits import Deadline
from tests.certify import tools

CASES = {
    "navigation, maximal": (tools.NAVIGATION, "maximal", "relational"),
    "generator, maximal": (tools.GENERATOR, "maximal", "relational"),
    "navigation, plan": (tools.NAVIGATION, "plan", "positions"),
}


@pytest.fixture(scope="module", params=CASES)
def original(request, tmp_path_factory):
    files, kind, encoding = CASES[request.param]
    path = tmp_path_factory.mktemp("certificates") / "original.cert"
    plan, _ = tools.certificate(files, path, kind=kind, encoding=encoding)
    assert tools.rejection(path) is None
    return plan, path


def judge(plan, path, count, seed):
    """How many changed certificates were rejected; a false one that is not ends the test."""
    random = Random(seed)
    data, lines = path.read_bytes(), tools.lines_of(path)
    changed = path.with_name("changed.cert")
    rejected, judged = 0, set()
    for number in range(count):
        mutant = tools.mutated(data, lines, random)
        changed.write_bytes(mutant)
        started = time.perf_counter()
        reason = tools.rejection(changed)
        assert time.perf_counter() - started < 10, f"mutant {number} of seed {seed}: the checker takes too long"
        if reason is not None:
            rejected += 1
            continue
        if mutant in judged:
            continue
        judged.add(mutant)
        assert tools.formulas_are_unsatisfiable(changed), f"mutant {number} of seed {seed}: a formula has a model"
        if mismatch(changed, plan, Deadline()) is not None:
            rejected += 1
        else:
            assert tools.claim_is_true(changed, plan), f"mutant {number} of seed {seed}: the claim is false"
    return rejected


def test_changed_certificates_are_rejected_or_true(original):
    assert judge(*original, 150, seed=1) > 75


@pytest.mark.slow
def test_ten_thousand_changed_certificates_are_rejected_or_true(original):
    assert judge(*original, 3400, seed=2) > 1700
