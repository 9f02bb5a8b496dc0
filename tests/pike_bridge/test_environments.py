"""Environments as bits, and values labeled with them, against sets of scenarios."""

from itertools import product
from operator import add

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.distance_graph import LabeledValueSet
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, bits, contradicts, entails, guard, union
from robust.pike_bridge.theory import is_consistent

DOMAINS = {"w": ("only",), "x": ("1", "2"), "y": ("1", "2", "3"), "z": ("1", "2")}
VOCABULARY = AssignmentVocabulary(DOMAINS)
SCENARIOS = [frozenset(map(Assignment, DOMAINS, values)) for values in product(*DOMAINS.values())]
ENCODED = [VOCABULARY.encode(scenario) for scenario in SCENARIOS]
conjunctions = st.frozensets(st.sampled_from(VOCABULARY.assignments), max_size=4)


def meaning(assignments):
    return {scenario for scenario in SCENARIOS if assignments <= scenario}


def env(**assignments):
    return VOCABULARY.encode(guard(assignments))


@given(conjunctions)
def test_coding_loses_nothing(assignments):
    environment = VOCABULARY.encode(assignments)
    assert VOCABULARY.decode(environment) == assignments
    assert VOCABULARY.consistent(environment) == is_consistent(assignments) == bool(meaning(assignments))
    assert list(VOCABULARY.assigned(environment)) == sorted(variable for variable, _ in assignments)
    for variable in DOMAINS:
        assert VOCABULARY.mentions(environment, variable) == (variable in dict(assignments))
        rest = VOCABULARY.without(environment, variable)
        assert rest == VOCABULARY.encode({one for one in assignments if one.variable != variable})


@given(conjunctions, conjunctions)
def test_operations(one, other):
    first, second = VOCABULARY.encode(one), VOCABULARY.encode(other)
    assert VOCABULARY.encode(one | other) == first | second
    assert union([first, second]) == first | second
    if is_consistent(one) and is_consistent(other):
        assert entails(first, second) == (other <= one)
        # An assignment to a variable with one value holds in every scenario, said or not.
        said = other - {Assignment("w", "only")}
        assert (said <= one) == (meaning(one) <= meaning(other))


def test_single_assignments():
    assert [VOCABULARY.decode(VOCABULARY.assign(*one)) for one in VOCABULARY.assignments] == [
        {one} for one in VOCABULARY.assignments
    ]
    assert [bin(VOCABULARY.field(variable)) for variable in DOMAINS] == ["0b1", "0b110", "0b111000", "0b11000000"]
    with pytest.raises(KeyError):
        VOCABULARY.assign("x", "3")
    with pytest.raises(KeyError):
        VOCABULARY.encode({Assignment("v", "1")})


@given(st.integers(0, 2**70))
def test_bits(mask):
    assert list(bits(mask)) == [at for at in range(71) if mask >> at & 1]


def test_contradictions():
    for other, expected in ({"x": "2", "y": "1"}, True), ({"y": "1"}, False), ({}, False):
        assert contradicts(guard({"x": "1"}), guard(other)) is expected


def values(*pairs):
    return LabeledValueSet(VOCABULARY, pairs)


environments = st.fixed_dictionaries(
    {}, optional={variable: st.sampled_from(domain) for variable, domain in DOMAINS.items()}
).map(lambda made: env(**made))
drawn_pairs = st.lists(st.tuples(st.integers(-4, 4), environments), max_size=10)


def worst(known, environment):
    """The greatest, over the scenarios of an environment, of the least value that holds; None if some has none."""
    least = [
        min((value for value, label in known if scenario & label == label), default=None)
        for scenario in ENCODED
        if scenario & environment == environment
    ]
    found = [value for value in least if value is not None]
    return max(found) if len(found) == len(least) else None


@pytest.mark.parametrize(
    ("before", "new", "added", "after"),
    [
        # [PIKE §2.1.1]: t < 2 always, t < 1 if x = 1; t < 5 if x = 2 says nothing new.
        ([(2, 0)], (1, env(x="1")), True, [(1, env(x="1")), (2, 0)]),
        ([(1, env(x="1")), (2, 0)], (5, env(x="2")), False, [(1, env(x="1")), (2, 0)]),
        ([(2, env(x="1", y="2"))], (1, env(x="1")), True, [(1, env(x="1"))]),
        ([(2, env(x="1"))], (2, 0), True, [(2, 0)]),
        ([(2, 0)], (2, env(y="1")), False, [(2, 0)]),
    ],
)
def test_dominance(before, new, added, after):
    known = values(*before)
    assert (known.add(*new), list(known)) == (added, after)


def test_addition_of_the_paper():
    total = values((2, env(x="1")), (3, env(y="2")), (4, 0)).combine(values((1, env(x="2")), (3, 0)), add)
    assert set(total) == {(4, env(x="2", y="2")), (5, env(x="1")), (5, env(x="2")), (6, env(y="2")), (7, 0)}


def test_completions_of_appendix_c():
    known = values((3, env(x="1")), (4, env(x="2")))
    known.complete()
    assert list(known) == [(3, env(x="1")), (4, 0)]
    known = values((-1, env(x="1", z="2")), (-2, env(x="2", z="2")))
    known.complete()
    assert (known.query(env(z="2")), known.query(0)) == (-1, None)


@given(drawn_pairs, environments)
def test_no_pair_dominates_another_and_nothing_is_lost_in_any_scenario(pairs, environment):
    known = values(*pairs)
    kept = list(known)
    assert [value for value, _ in kept] == sorted(value for value, _ in kept)
    for value, label in kept:
        for other, other_label in kept:
            assert (value, label) == (other, other_label) or other < value or label & other_label != label
    assert all(known.query(scenario) == worst(pairs, scenario) for scenario in ENCODED)
    found, bound = known.query(environment), worst(pairs, environment)
    assert found is None or (bound is not None and found >= bound)


@given(st.lists(drawn_pairs, min_size=1, max_size=3), environments)
def test_queries_with_completions_are_tightest_for_every_environment(batches, environment):
    everything = [pair for batch in batches for pair in batch]
    step_by_step, at_once = values(), values(*everything)
    for batch in batches:
        step_by_step.complete(step_by_step.merge(batch))
    at_once.complete()
    assert step_by_step.query(environment) == at_once.query(environment) == worst(everything, environment)


@given(drawn_pairs, st.sampled_from(VOCABULARY.variables))
def test_completions_are_sound(pairs, variable):
    """[PIKE, Theorem C.1]"""
    for value, environment in values(*pairs).completions(variable):
        bound = worst(pairs, environment)
        assert bound is not None
        assert bound <= value
        assert variable not in VOCABULARY.assigned(environment)


@given(drawn_pairs, drawn_pairs)
def test_addition_adds_scenario_by_scenario(left, right):
    total = values(*left).combine(values(*right), add)
    for scenario in ENCODED:
        first, second = worst(left, scenario), worst(right, scenario)
        assert total.query(scenario) == (None if first is None or second is None else first + second)
