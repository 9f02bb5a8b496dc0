"""Where each obligation breaks, against checks of single points, which share none of the elimination."""

from collections import Counter
from fractions import Fraction
from random import Random

import pytest

from robust.api import check, region
from robust.irr.check import Answer
from robust.qe.compute import what_breaks
from robust.reading import load_plan
from tests.cli.running import EXAMPLES, example


@pytest.mark.parametrize("name", ["two_sample_navigation", "generator", "delivery"])
def test_what_breaks_is_what_checks_refute(name):
    plan = load_plan(*example(directory=EXAMPLES / name))
    breaks, exact = what_breaks(plan), region(plan).region
    assert breaks.complete
    assert not what_breaks(plan, timeout=0.0).complete
    random, met = Random(5), Counter()  # noqa: S311 - reproducible
    for _ in range(40):
        point = {one.name: one.nominal + Fraction(random.randint(-60, 60)) for one in plan.parameters}
        result = check(plan, at=point, every=True)
        refuted = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
        named = [one for one in breaks.obligations if any(point in piece for piece in one.pieces)]
        demands = {one.obligation for one in named if one.demand}
        if result.reason is not None:
            met["no schedule"] += 1
            assert point not in exact
        elif demands:
            met["demand"] += 1
            assert demands <= refuted
        else:
            met["several" if len(refuted) > 1 else "one" if refuted else "valid"] += 1
            assert {one.obligation for one in named} == refuted
            assert (point in exact) is (not refuted)
    assert met.keys() >= {"valid", *(("no schedule",) if name == "delivery" else ("one", "several"))}
    assert sum(met.values()) == 40
