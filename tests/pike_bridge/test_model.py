"""Environments as bits, against sets of scenarios."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.model import EMPTY, Assignment, Vocabulary, bits, entails
from robust.pike_bridge.theory import is_consistent

DOMAINS = {"x": ("1", "2"), "y": ("1", "2", "3"), "z": ("only",)}
VOCABULARY = Vocabulary(DOMAINS)
SCENARIOS = [frozenset(map(Assignment, DOMAINS, values)) for values in product(*DOMAINS.values())]
conjunctions = st.frozensets(st.sampled_from(VOCABULARY.assignments), max_size=4)


def meaning(assignments):
    return {scenario for scenario in SCENARIOS if assignments <= scenario}


@given(conjunctions)
def test_coding_loses_nothing(assignments):
    environment = VOCABULARY.encode(assignments)
    assert VOCABULARY.decode(environment) == assignments
    assert VOCABULARY.consistent(environment) == is_consistent(assignments) == bool(meaning(assignments))
    assert list(VOCABULARY.assigned(environment)) == sorted(variable for variable, _ in assignments)
    assert {variable for variable in DOMAINS if VOCABULARY.mentions(environment, variable)} == {
        variable for variable, _ in assignments
    }


@given(conjunctions, conjunctions)
def test_operations(one, other):
    first, second = VOCABULARY.encode(one), VOCABULARY.encode(other)
    assert VOCABULARY.encode(one | other) == first | second
    assert VOCABULARY.disjoint(first, second) == (not meaning(one) & meaning(other))
    if is_consistent(one) and is_consistent(other):
        assert entails(first, second) == (other <= one)
        # An assignment to a variable with one value holds in every scenario, said or not.
        said = other - {Assignment("z", "only")}
        assert (said <= one) == (meaning(one) <= meaning(other))


@given(conjunctions.filter(is_consistent))
def test_scenarios(assignments):
    environment = VOCABULARY.encode(assignments)
    scenarios = [VOCABULARY.decode(scenario) for scenario in VOCABULARY.scenarios(environment)]
    assert len(scenarios) == len(set(scenarios)) == VOCABULARY.count(environment)
    assert set(scenarios) == meaning(assignments)
    for variable in DOMAINS:
        rest = VOCABULARY.without(environment, variable)
        assert VOCABULARY.decode(rest) == {one for one in assignments if one.variable != variable}
        assert rest == VOCABULARY.encode(VOCABULARY.decode(rest))


def test_single_assignments():
    assert [VOCABULARY.decode(VOCABULARY.assign(*one)) for one in VOCABULARY.assignments] == [
        {one} for one in VOCABULARY.assignments
    ]
    assert VOCABULARY.text(VOCABULARY.encode({Assignment("y", "3"), Assignment("x", "1")})) == "{x = 1, y = 3}"
    assert VOCABULARY.text(EMPTY) == "{}"
    assert [bin(VOCABULARY.field(variable)) for variable in DOMAINS] == ["0b11", "0b11100", "0b100000"]
    with pytest.raises(KeyError):
        VOCABULARY.assign("x", "3")
    with pytest.raises(KeyError):
        VOCABULARY.encode({Assignment("w", "1")})


@given(st.integers(0, 2**70))
def test_bits(mask):
    assert list(bits(mask)) == [at for at in range(71) if mask >> at & 1]
