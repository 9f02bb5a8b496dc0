"""Environments as bits and values labeled with them; labeled shortest paths, precedence by structure, schedules of
scenarios and temporal conflicts [PIKE, Theorem 4.1]: against sets of scenarios and brute force.

Structure is sound in every scenario, and complete where nothing depends on choices.
"""

from fractions import Fraction
from itertools import product
from operator import add

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.pike_bridge.builder import act, build, choose, sequence
from robust.pike_bridge.distance_graph import KnownOrders, LabeledValueSet, StructuralPrecedence
from robust.pike_bridge.labeled_apsp import LabeledDistances, most_general, schedule, temporal_conflicts
from robust.pike_bridge.model import EPSILON, Assignment, AssignmentVocabulary, bits, contradicts, entails, guard, union
from robust.pike_bridge.theory import Is, Theory, is_consistent
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge import brute_force as brute
from tests.pike_bridge import stories
from tests.pike_bridge.brute_force import distances, extending
from tests.pike_bridge.knowledge.theories import is_model, theories
from tests.pike_bridge.plans import network as handmade
from tests.pike_bridge.plans import networks
from tests.sampling import often


def figure_23(count):
    """One choice after the other, each of two activities of [2, 4]."""
    return handmade(
        " ".join(f"e{at}" for at in range(count + 1)),
        *((f"e{at}", f"e{at + 1}", 2, 4, {f"x{at}": value}) for at in range(count) for value in "12"),
        choices=[(f"x{at}", "12", f"e{at}") for at in range(count)],
    )


@pytest.mark.parametrize("count", [1, 2, 3, 7, 12])
def test_completions_leave_one_value_in_figure_23_and_its_program(count):
    table = LabeledDistances(figure_23(count))
    assert table.labeled(f"e{count}", "e0") == ((Fraction(-2 * count), 0),)
    assert table.labeled("e0", f"e{count}") == ((Fraction(4 * count), 0),)
    length = count * (2 + 2 * EPSILON) + (count - 1) * EPSILON
    assert LabeledDistances(stories.figure_23(count).network).labeled(f"e{6 * count}", "e1") == ((-length, 0),)
    if count < 8:
        without = LabeledDistances(figure_23(count), completions=False)
        assert len(without.labeled(f"e{count}", "e0")) == 2**count


def active_pairs(network, environment):
    return product([event.name for event in network.events if event.guard <= environment], repeat=2)


@given(networks, st.booleans())
def test_distances_conflicts_and_schedules_are_exact_in_each_scenario(network, completions):
    table = LabeledDistances(network, completions=completions)
    conflicts = [table.vocabulary.decode(conflict) for conflict in table.conflicts]
    assert not any(one < other for one, other in product(conflicts, repeat=2))
    by_scenario = {scenario: distances(network, scenario) for scenario in extending(network)}
    for scenario, shortest in by_scenario.items():
        environment = table.vocabulary.encode(scenario)
        assert table.conflicting(environment) == (shortest is None)
        assert any(conflict <= scenario for conflict in conflicts) == (shortest is None)
        for pair in active_pairs(network, scenario) if shortest is not None else ():
            assert table.query(*pair, environment) == shortest.get(pair)
        times = schedule(network, scenario)
        assert isinstance(times, frozenset) == (shortest is None)
        if shortest is None:
            assert times <= scenario
            assert all(by_scenario[each] is None for each in extending(network, times))
        else:
            assert set(times) == {event.name for event in network.events if event.guard <= scenario}
            assert min(times.values(), default=0) == 0
            assert not brute.broken_constraints(network, dict(scenario), times)
    for environment in brute.environments(network) if completions else ():
        encoded = table.vocabulary.encode(environment)
        shortest = [by_scenario[scenario] for scenario in extending(network, environment)]
        assert table.conflicting(encoded) == all(entry is None for entry in shortest)
        for pair in () if table.conflicting(encoded) else active_pairs(network, environment):
            lengths = [entry.get(pair) for entry in shortest if entry is not None]
            assert table.query(*pair, encoded) == (None if None in lengths else max(lengths))


@settings(max_examples=often(18, 35))
@given(networks)
def test_precedence_is_sound_and_with_completions_complete(network):
    brute.check_precedence(network, LabeledDistances(network), complete=True)
    brute.check_precedence(network, LabeledDistances(network, completions=False), complete=False)
    brute.check_precedence(network, StructuralPrecedence(network), complete=False)


@settings(max_examples=often(18, 100))
@given(networks)
def test_chains_of_single_bounds_hold_in_every_scenario(network):
    chains, exact = KnownOrders(network, Fraction(0)), brute.ExactPrecedence(network)
    known = [distances(network, scenario) for scenario in brute.scenarios(network.domains)]
    for one, other in product(network.guards, repeat=2):
        if one != other:
            assert exact.precedes(one, other, 0) or not chains.apart(one, other)
            lengths = [each.get((other, one), 0) for each in known if each is not None]
            assert not chains.ordered(one, other) or max(lengths, default=0) <= 0
            assert chains.ordered(one, other) or not chains.apart(one, other)


def test_structure_orders_what_is_in_and_around_choices():
    branches = {"1": sequence(act("(one)", 1, 2), act("(other)", 1, 2)), "2": act("(slow)", 3, 5)}
    network = build("plan", sequence(act("(before)", 1, 2), choose("x", branches), act("(after)", 1, 2)))
    structure = StructuralPrecedence(network)
    before, one, other, slow, after = (activity.source for activity in network.activities)
    for first, second in ((before, one), (before, slow), (one, other), (other, after), (slow, after), (before, after)):
        assert structure.precedes(first, second, 0)
        assert not structure.precedes(second, first, 0)
    assert not structure.precedes(one, slow, 0)
    # Contexts that are impossible order nothing.
    first, second = (structure.vocabulary.assign("x", value) for value in "12")
    assert not structure.precedes(one, other, second)
    assert structure.conflicting(first | second)
    # No constraint leads from a to b in every scenario, but one in each.
    for values, ordered in ("12", True), ("1", False):
        bounds = (("a", "b", value, None, {"x": value}) for value in values)
        network = handmade("a b", *bounds, choices=[("x", "12", None)])
        assert StructuralPrecedence(network).precedes("a", "b", 0) == ordered


@pytest.mark.parametrize("kind", [LabeledDistances, StructuralPrecedence])
def test_deadlines_and_unknown_events(kind):
    with pytest.raises(OutOfTimeError):
        kind(figure_23(3), Deadline.after(0)).precedes("e1", "e2", 0)
    with pytest.raises(KeyError):
        kind(figure_23(1)).precedes("e1", "nowhere", 0)


def test_the_earliest_schedule_and_single_environments():
    network = handmade("a b c", ("a", "b", "1/3", 2), ("b", "c", "1/2", None))
    assert schedule(network, frozenset()) == {"a": Fraction(0), "b": Fraction(1, 3), "c": Fraction(5, 6)}
    with pytest.raises(KeyError):
        schedule(network, guard({"x": "1"}))
    assert most_general([0b111, 0b011, 0b100, 0b110, 0b011]) == [0b011, 0b100]
    coded = (VOCABULARY.assign(*each) for each in VOCABULARY.assignments)
    assert list(map(VOCABULARY.decode, coded)) == [{each} for each in VOCABULARY.assignments]
    assert [bin(VOCABULARY.field(variable)) for variable in DOMAINS] == ["0b1", "0b110", "0b111000", "0b11000000"]
    with pytest.raises(KeyError):
        VOCABULARY.assign("x", "3")
    with pytest.raises(KeyError):
        VOCABULARY.encode({Assignment("v", "1")})
    for other, expected in ({"x": "2", "y": "1"}, True), ({"y": "1"}, False), ({}, False):
        assert contradicts(guard({"x": "1"}), guard(other)) is expected


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_what_a_theory_leaves_open_has_conflicts(solver):
    """That of a plan that is never possible is empty."""
    network = handmade("a b", ("a", "b", None, 4), ("a", "b", 5, None, {"x": "2"}), choices=[("x", "12", None)])
    assert temporal_conflicts(network, Theory(network.domains), solver=solver) == (guard({"x": "2"}),)
    assert temporal_conflicts(network, Theory(network.domains, (Is(Assignment("x", "1")),)), solver=solver) == ()
    assert temporal_conflicts(handmade("a b", ("a", "b", 3, 2)), Theory({}), solver=solver) == (frozenset(),)
    with pytest.raises(OutOfTimeError):
        temporal_conflicts(network, Theory(network.domains), Deadline.after(0), solver=solver)


@given(networks, st.data())
@settings(max_examples=often(20, 40))
def test_models_that_resolve_the_conflicts_are_those_with_a_schedule(network, data):
    """The theory is about the network's choices and one more."""
    theory = data.draw(theories(of={**network.domains, "own": ("a", "b", "c")}))
    conflicts = temporal_conflicts(network, theory)
    for conflict in conflicts:
        assert all(distances(network, scenario) is None for scenario in extending(network, conflict))
        assert not any(other < conflict for other in conflicts)
    for scenario in extending(network):
        if any(is_model({**dict(scenario), "own": own}, theory) for own in theory.domains["own"]):
            assert any(conflict <= scenario for conflict in conflicts) == (distances(network, scenario) is None)


DOMAINS = {"w": ("only",), "x": ("1", "2"), "y": ("1", "2", "3"), "z": ("1", "2")}
VOCABULARY = AssignmentVocabulary(DOMAINS)
SCENARIOS = [frozenset(map(Assignment, DOMAINS, values)) for values in product(*DOMAINS.values())]
ENCODED = [VOCABULARY.encode(scenario) for scenario in SCENARIOS]
conjunctions = st.frozensets(st.sampled_from(VOCABULARY.assignments), max_size=4)


def meaning(assignments):
    return {scenario for scenario in SCENARIOS if assignments <= scenario}


@given(conjunctions, conjunctions, st.integers(0, 2**70))
def test_environments_are_conjunctions(first, second, mask):
    assert list(bits(mask)) == [at for at in range(71) if mask >> at & 1]
    coded, other = VOCABULARY.encode(first), VOCABULARY.encode(second)
    assert VOCABULARY.decode(coded) == first
    assert VOCABULARY.consistent(coded) == is_consistent(first) == bool(meaning(first))
    assert list(VOCABULARY.assigned(coded)) == sorted(variable for variable, _ in first)
    for variable in DOMAINS:
        assert VOCABULARY.mentions(coded, variable) == (variable in dict(first))
        rest = {each for each in first if each.variable != variable}
        assert VOCABULARY.without(coded, variable) == VOCABULARY.encode(rest)
    assert VOCABULARY.encode(first | second) == union([coded, other]) == coded | other
    if is_consistent(first) and is_consistent(second):
        assert entails(coded, other) == (second <= first)
        # An assignment to a variable with one value holds in every scenario, said or not.
        said = second - {Assignment("w", "only")}
        assert (said <= first) == (meaning(first) <= meaning(second))


def values(*pairs):
    return LabeledValueSet(VOCABULARY, pairs)


optional = {variable: st.sampled_from(domain) for variable, domain in DOMAINS.items()}
environments = st.fixed_dictionaries({}, optional=optional).map(guard).map(VOCABULARY.encode)
drawn_pairs = st.lists(st.tuples(st.integers(-4, 4), environments), max_size=10)


def worst(known, environment):
    """The greatest, over the scenarios of an environment, of the least value that holds; None if some has none."""
    least = [
        min((value for value, label in known if scenario & label == label), default=None)
        for scenario in ENCODED
        if scenario & environment == environment
    ]
    return None if None in least or not least else max(least)


@given(drawn_pairs, environments, st.sampled_from(VOCABULARY.variables))
def test_no_pair_dominates_another_and_nothing_is_lost_in_any_scenario(pairs, environment, variable):
    known = values()
    for pair in pairs:
        before = list(known)
        assert known.add(*pair) == (list(known) != before)
    kept = list(known)
    assert kept == list(values(*pairs))
    assert [value for value, _ in kept] == sorted(value for value, _ in kept)
    for (value, label), (other, other_label) in product(kept, repeat=2):
        assert (value, label) == (other, other_label) or other < value or label & other_label != label
    assert all(known.query(scenario) == worst(pairs, scenario) for scenario in ENCODED)
    answer, bound = known.query(environment), worst(pairs, environment)
    assert answer is None or (bound is not None and answer >= bound)
    # Completions are sound [PIKE, Theorem C.1].
    for value, label in known.completions(variable):
        bound = worst(pairs, label)
        assert bound is not None
        assert bound <= value
        assert variable not in VOCABULARY.assigned(label)


def test_examples_of_labeled_value_sets():
    """The sum of [PIKE §2.1.1]; the completions of [PIKE §C.1], with y = 2 and without."""
    small = AssignmentVocabulary({"x": ("1", "2"), "y": ("1", "2")})

    def of(*pairs):
        return LabeledValueSet(small, [(value, small.encode(guard(label))) for value, label in pairs])

    total = of((2, {"x": "1"}), (3, {"y": "2"}), (4, {})).combine(of((1, {"x": "2"}), (3, {})), add)
    assert set(total) == set(of((4, {"x": "2", "y": "2"}), (5, {"x": "1"}), (5, {"x": "2"}), (6, {"y": "2"}), (7, {})))
    either = of((3, {"x": "1"}), (4, {"x": "2"}))
    assert either.query(0) is None
    either.complete()
    assert set(either) == set(of((3, {"x": "1"}), (4, {})))
    known = of((-1, {"x": "1", "y": "2"}), (-2, {"x": "2", "y": "2"}))
    known.complete()
    assert known.query(small.encode(guard({"y": "2"}))) == -1


@given(st.lists(drawn_pairs, min_size=1, max_size=3), environments)
def test_queries_with_completions_are_tightest_for_every_environment(batches, environment):
    everything = [pair for batch in batches for pair in batch]
    step_by_step, at_once = values(), values(*everything)
    for batch in batches:
        step_by_step.complete(step_by_step.merge(batch))
    at_once.complete()
    assert step_by_step.query(environment) == at_once.query(environment) == worst(everything, environment)


@given(drawn_pairs, drawn_pairs)
def test_addition_adds_scenario_by_scenario(left, right):
    total = values(*left).combine(values(*right), add)
    for scenario in ENCODED:
        first, second = worst(left, scenario), worst(right, scenario)
        assert total.query(scenario) == (None if first is None or second is None else first + second)
