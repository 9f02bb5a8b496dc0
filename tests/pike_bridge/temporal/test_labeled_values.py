"""Labeled value sets: the examples of the paper, and a table over all scenarios for everything else."""

from __future__ import annotations

from collections.abc import Iterable
from operator import add

from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.model import Environment, Vocabulary, guard
from robust.pike_bridge.temporal.distance_graph import LabeledNumbers, LabeledValueSet

TWO = Vocabulary({"x": ("1", "2"), "y": ("1", "2")})
DRAWN = Vocabulary({"x": ("1", "2"), "y": ("1", "2", "3"), "z": ("1", "2")})
Pairs = list[tuple[int, Environment]]


def env(vocabulary: Vocabulary = TWO, **assignments: str) -> Environment:
    return vocabulary.encode(guard(assignments))


@st.composite
def environments(draw: st.DrawFn) -> Environment:
    result = 0
    for variable, domain in DRAWN.domains.items():
        value = draw(st.sampled_from((None, *domain)))
        if value is not None:
            result |= DRAWN.assign(variable, value)
    return result


pairs = st.lists(st.tuples(st.integers(-4, 4), environments()), max_size=10)


def worst(known: Iterable[tuple[int, Environment]], environment: Environment) -> int | None:
    """The greatest, over the scenarios of an environment, of the least value that holds; None if some has none."""
    table = list(known)
    least = [
        min((value for value, label in table if scenario & label == label), default=None)
        for scenario in DRAWN.scenarios(environment)
    ]
    found = [value for value in least if value is not None]
    return max(found) if len(found) == len(least) else None


def test_dominated_pairs_are_left_out() -> None:
    # [PIKE §2.1.1]: t < 2 always, t < 1 if x = 1; t < 5 if x = 2 says nothing new.
    values = LabeledNumbers(TWO)
    assert values.add(2, 0)
    assert values.add(1, env(x="1"))
    assert not values.add(5, env(x="2"))
    assert set(values) == {(2, 0), (1, env(x="1"))}


def test_a_dominating_pair_replaces_what_it_dominates() -> None:
    values = LabeledNumbers(TWO, [(2, env(x="1", y="2"))])
    assert values.add(1, env(x="1"))
    assert list(values) == [(1, env(x="1"))]


def test_of_equal_values_the_more_general_is_kept() -> None:
    values = LabeledNumbers(TWO, [(2, env(x="1"))])
    assert values.add(2, 0)
    assert not values.add(2, env(y="1"))
    assert list(values) == [(2, 0)]


def test_query_gives_the_least_value_that_holds_everywhere() -> None:
    values = LabeledNumbers(TWO, [(2, env(x="1")), (3, env(y="2")), (4, 0)])
    assert values.query(0) == 4
    assert values.query(env(y="2")) == 3
    assert values.query(env(x="1", y="2")) == 2
    assert LabeledNumbers(TWO).query(0) is None


def test_addition_of_the_paper() -> None:
    left = LabeledNumbers(TWO, [(2, env(x="1")), (3, env(y="2")), (4, 0)])
    right = LabeledNumbers(TWO, [(1, env(x="2")), (3, 0)])
    assert set(left.combine(right, add)) == {
        (4, env(x="2", y="2")),
        (5, env(x="1")),
        (5, env(x="2")),
        (6, env(y="2")),
        (7, 0),
    }


def test_first_completion_of_appendix_c() -> None:
    values = LabeledNumbers(TWO)
    values.merge_with_completions([(3, env(x="1")), (4, env(x="2"))])
    assert set(values) == {(3, env(x="1")), (4, 0)}


def test_second_completion_of_appendix_c() -> None:
    values = LabeledNumbers(TWO)
    values.merge_with_completions([(-1, env(x="1", y="2")), (-2, env(x="2", y="2"))])
    assert values.query(env(y="2")) == -1
    assert values.query(0) is None


def test_completions_need_every_value_of_the_domain() -> None:
    values = LabeledNumbers(DRAWN, [(1, env(DRAWN, y="1")), (2, env(DRAWN, y="3"))])
    assert list(values.completions("y")) == []
    values.merge_with_completions([(5, env(DRAWN, y="2", x="1"))])
    assert values.query(env(DRAWN, x="1")) == 5


def test_partial_orders_keep_what_they_cannot_compare() -> None:
    divides = LabeledValueSet[int](TWO, lambda first, second: first != second and second % first == 0)
    assert [divides.add(4, 0), divides.add(6, 0), divides.add(12, env(x="1")), divides.add(2, env(x="1"))] == [
        True,
        True,
        False,
        True,
    ]
    assert divides.tightest(0) == [4, 6]
    assert divides.tightest(env(x="1")) == [2]
    assert divides.add(2, 0)
    assert list(divides) == [(2, 0)]


@given(pairs, environments())
def test_query_of_numbers_equals_that_of_the_general_set(drawn: Pairs, environment: Environment) -> None:
    numbers = LabeledNumbers(DRAWN, drawn)
    general = LabeledValueSet[int](DRAWN, lambda first, second: first < second, drawn)
    assert set(numbers) == set(general)
    assert [value for value, _ in numbers] == sorted(value for value, _ in numbers)
    assert numbers.query(environment) == general.query(environment)


@given(pairs)
def test_no_pair_dominates_another(drawn: Pairs) -> None:
    kept = list(LabeledNumbers(DRAWN, drawn))
    for value, label in kept:
        for other, other_label in kept:
            assert (value, label) == (other, other_label) or other < value or label & other_label != label


@given(pairs)
def test_dominance_loses_nothing_in_any_scenario(drawn: Pairs) -> None:
    values = LabeledNumbers(DRAWN, drawn)
    for scenario in DRAWN.scenarios():
        assert values.query(scenario) == worst(drawn, scenario)


@given(pairs, environments())
def test_queries_without_completions_are_sound(drawn: Pairs, environment: Environment) -> None:
    found, bound = LabeledNumbers(DRAWN, drawn).query(environment), worst(drawn, environment)
    assert found is None or (bound is not None and found >= bound)


@given(st.lists(pairs, min_size=1, max_size=3), environments())
def test_queries_with_completions_are_tightest_for_every_environment(
    batches: list[Pairs], environment: Environment
) -> None:
    values = LabeledNumbers(DRAWN)
    for batch in batches:
        values.merge_with_completions(batch)
    assert values.query(environment) == worst([pair for batch in batches for pair in batch], environment)


@given(pairs, st.sampled_from(DRAWN.variables))
def test_completions_are_sound(drawn: Pairs, variable: str) -> None:
    for value, environment in LabeledNumbers(DRAWN, drawn).completions(variable):
        bound = worst(drawn, environment)
        assert bound is not None
        assert bound <= value
        assert not DRAWN.mentions(environment, variable)


@given(pairs, environments())
def test_closing_afterwards_is_as_good_as_at_once(drawn: Pairs, environment: Environment) -> None:
    values = LabeledNumbers(DRAWN, drawn)
    values.close()
    assert values.query(environment) == worst(drawn, environment)


@given(pairs, pairs)
def test_addition_adds_scenario_by_scenario(left: Pairs, right: Pairs) -> None:
    total = LabeledNumbers(DRAWN, left).combine(LabeledNumbers(DRAWN, right), add)
    for scenario in DRAWN.scenarios():
        first, second = worst(left, scenario), worst(right, scenario)
        assert total.query(scenario) == (None if first is None or second is None else first + second)
