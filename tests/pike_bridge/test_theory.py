"""Formulas over assignments, against Python's own connectives over all scenarios."""

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.model import ALWAYS, Assignment, guard
from robust.pike_bridge.theory import All, Is, Not, Some, Theory, conjunction, implies, is_model, satisfies

DOMAINS = {"x": ("1", "2"), "y": ("1", "2", "3")}
SCENARIOS = [dict(zip(DOMAINS, values, strict=True)) for values in product(*DOMAINS.values())]
ASSIGNMENTS = [Assignment(variable, value) for variable, values in DOMAINS.items() for value in values]

# Each formula with the set of scenarios that it should be true in.
EVERY = frozenset(range(len(SCENARIOS)))


def _where(assignment):
    return frozenset(at for at in EVERY if SCENARIOS[at][assignment.variable] == assignment.value)


meanings = st.recursive(
    st.sampled_from(ASSIGNMENTS).map(lambda one: (Is(one), _where(one))),
    lambda inner: st.one_of(
        inner.map(lambda one: (Not(one[0]), EVERY - one[1])),
        st.lists(inner, max_size=3).map(
            lambda many: (All(tuple(one for one, _ in many)), EVERY.intersection(*(where for _, where in many)))
        ),
        st.lists(inner, max_size=3).map(
            lambda many: (Some(tuple(one for one, _ in many)), frozenset().union(*(where for _, where in many)))
        ),
        st.tuples(inner, inner).map(lambda two: (implies(two[0][0], two[1][0]), (EVERY - two[0][1]) | two[1][1])),
    ),
)


@given(meanings)
def test_satisfies(meaning):
    formula, where = meaning
    assert {at for at in EVERY if satisfies(SCENARIOS[at], formula)} == where


@given(st.lists(meanings, max_size=3), st.lists(st.frozensets(st.sampled_from(ASSIGNMENTS), max_size=2), max_size=2))
def test_models(constraints, conflicts):
    theory = Theory(DOMAINS, tuple(formula for formula, _ in constraints), tuple(conflicts))
    expected = EVERY.intersection(*(where for _, where in constraints))
    for conflict in conflicts:
        expected -= EVERY.intersection(*map(_where, conflict))
    assert {at for at in EVERY if is_model(SCENARIOS[at], theory)} == expected


def test_conjunction_is_sorted():
    assert conjunction(guard({"y": "2", "x": "1"})) == All((Is(Assignment("x", "1")), Is(Assignment("y", "2"))))
    assert conjunction(ALWAYS) == All(())
