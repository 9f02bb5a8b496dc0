"""What shortest paths prove, the solver proves: drawn plans, each obligation asked without that knowledge."""

from collections import Counter
from fractions import Fraction

import pytest
from hypothesis import Phase, given, settings

from robust.encode import create_encoding, encoding
from robust.encode.effects import mutex_pairs
from robust.encode.settled import proved
from robust.errors import UnsupportedError
from robust.smt.session import Satisfiability, Session
from tests.strategies import plans

EPSILON = Fraction(1, 1000)


def compare(plan, monkeypatch, seen):
    """Each obligation that paths prove is true in all schedules, by the solver alone."""
    names = proved(plan, EPSILON, mutex_pairs(plan))
    with monkeypatch.context() as patch:
        patch.setattr(encoding, "proved", lambda *_: frozenset())
        try:
            alone = create_encoding("relational", plan, EPSILON)
        except UnsupportedError:
            return
    assert names <= {obligation.name for obligation in alone.obligations}
    for obligation in alone.obligations:
        if obligation.name in names:
            session = Session(alone.terms)
            session.add(*alone.full_query(obligation))
            assert session.check("proved by paths") is Satisfiability.UNSATISFIABLE, obligation.name
        seen[obligation.name in names] += 1


@pytest.mark.parametrize("count", [100, pytest.param(4000, marks=pytest.mark.slow)])
def test_the_solver_proves_what_paths_prove(count, monkeypatch):
    seen = Counter()

    @settings(phases=[Phase.generate], max_examples=count, deadline=None, database=None, derandomize=True)
    @given(plans(linear=True))
    def drawn(plan):
        compare(plan, monkeypatch, seen)

    drawn()
    assert seen[True] > count
    assert seen[False] > count / 10
