"""The πTMS: the paper's examples, and Invariant 5.2 by brute force."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.pike_bridge.knowledge.bdd import BddKnowledgeBase
from robust.pike_bridge.knowledge.interface import Exclude, OutOfSpaceError, Require
from robust.pike_bridge.knowledge.network import NodeKind
from robust.pike_bridge.knowledge.tms import Atms, PiTms
from robust.pike_bridge.model import Assignment, guard
from robust.pike_bridge.theory import All, Is, Some, Theory, implies, satisfies
from tests.pike_bridge.knowledge.theories import allowed, commitments, models, prime_implicants, theories

Z1, Z2 = Is(Assignment("z", "1")), Is(Assignment("z", "2"))
P1, P2 = Is(Assignment("s", "eP1")), Is(Assignment("s", "eP2"))
Y1 = Is(Assignment("y", "1"))
EXAMPLE = Theory(
    {"z": ("1", "2"), "y": ("1", "2"), "s": ("eP1", "eP2", "none")}, (implies(Z1, Some((P2, All((P1, Y1))))),)
)
"""Figures 13 and 14."""


def environments(*found):
    return {guard(environment) for environment in found}


def label_of(knowledge, predicate):
    (found,) = [each for each in knowledge.labels() if predicate(each.node.formula)]
    return set(found.environments)


def test_labels_of_figure_14():
    knowledge = PiTms(EXAMPLE)
    three = [set(each.environments) for each in knowledge.labels() if each.node.kind is NodeKind.DERIVED]
    n3 = environments({"s": "eP2"}, {"y": "1", "s": "eP1"})
    n4 = n3 | environments({"z": "2"})
    # Disjunctions in disjunctions are flattened, so that N_3 has no node of its own in this theory.
    assert n4 in three
    assert environments({"y": "1", "s": "eP1"}) in three
    assert set(knowledge.prime_implicants()) == n4
    assert set(PiTms(Theory(EXAMPLE.domains, (Some((P2, All((P1, Y1)))),))).prime_implicants()) == n3


def test_label_of_the_goal_after_a_conflict():
    expected = environments({"z": "2", "s": "eP1"}, {"z": "2", "s": "none"}, {"y": "1", "s": "eP1"})
    knowledge = PiTms(EXAMPLE)
    knowledge.commit([Exclude(guard({"s": "eP2"}))])
    assert set(knowledge.prime_implicants()) == expected
    assert knowledge.implicant_count() == 3
    from_the_start = PiTms(Theory(EXAMPLE.domains, EXAMPLE.constraints, (guard({"s": "eP2"}),)))
    assert set(from_the_start.prime_implicants()) == expected
    goal = label_of(knowledge, lambda formula: isinstance(formula, Some) and Z2 in formula.operands)
    assert goal == expected


def test_consensus_example():
    """[PIKE §5.4]: of four environments, two are replaced by their consensus."""
    domains = dict.fromkeys("xyz", ("1", "2", "3"))
    label = ({"x": "1", "y": "1", "z": "1"}, {"x": "2", "y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})
    formula = Some(tuple(All(tuple(Is(each) for each in guard(environment))) for environment in label))
    assert set(PiTms(Theory(domains, (formula,))).prime_implicants()) == environments(
        {"y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"}
    )
    assert set(Atms(Theory(domains, (formula,))).goal()) == environments(*label)


@settings(max_examples=300)
@given(data=st.data())
def test_the_goal_has_all_prime_implicants(data):
    theory = data.draw(theories())
    left = models(theory)
    knowledge, diagram = PiTms(theory, shortcut=False), BddKnowledgeBase(theory)
    for step in ([], data.draw(commitments(theory.domains)), data.draw(commitments(theory.domains))):
        knowledge.commit(step)
        diagram.commit(step)
        left = [model for model in left if allowed(model, step)]
        found = list(knowledge.prime_implicants())
        assert set(found) == prime_implicants(theory.domains, left)
        assert len(found) == knowledge.implicant_count() == diagram.implicant_count()
        assert sorted(map(sorted, diagram.prime_implicants())) == sorted(map(sorted, found))


@settings(max_examples=150)
@given(data=st.data())
def test_every_node_has_the_label_of_invariant_5_2(data):
    theory = data.draw(theories(most=4))
    knowledge = PiTms(theory, shortcut=False)
    assert sorted(map(str, models(knowledge.simplified))) == sorted(map(str, models(theory)))
    step = data.draw(commitments(theory.domains))
    knowledge.commit(step)
    conflicts = Theory(theory.domains, (), knowledge.simplified.conflicts)
    without = [model for model in models(conflicts) if allowed(model, step)]
    for label in knowledge.labels():
        if label.node.kind is not NodeKind.CONTRADICTION:
            holding = [model for model in without if satisfies(model, label.node.formula)]
            assert label.environments == prime_implicants(theory.domains, holding)


@settings(max_examples=150)
@given(data=st.data())
def test_explanations(data):
    theory = data.draw(theories())
    left = models(theory)
    environment = next(iter(data.draw(commitments(theory.domains))), Require(frozenset())).environment
    consistent = any(allowed(model, [Require(environment)]) for model in left)
    for create in (PiTms, Atms):
        found = create(theory).explain(environment)
        assert (found is not None) == consistent
        if found is not None:
            assert len({each.variable for each in found | environment}) == len(found | environment)


def test_independent_constraints_stay_apart():
    names = [f"v{at}" for at in range(400)]
    pairs = tuple(
        Some((Is(Assignment(first, "1")), Is(Assignment(second, "1"))))
        for first, second in zip(names[::2], names[1::2], strict=True)
    )
    knowledge = PiTms(Theory(dict.fromkeys(names, ("1", "2")), pairs))
    assert knowledge.implicant_count() == 2**200
    assert knowledge.count_models() == 3**200
    assert len(next(knowledge.prime_implicants())) == 200
    assert knowledge.statistics.sizes["factors"] == 200
    across = guard({"v0": "1", "v2": "1"})
    knowledge.commit([Exclude(across)])
    assert knowledge.statistics.sizes["factors"] == 199
    assert knowledge.count_models() == 3**200 // 9 * 5
    assert not knowledge.could_commit([Require(across)])


def test_what_all_environments_agree_on_joins_no_factors():
    first, second = (
        Some((Is(Assignment(one, "1")), Is(Assignment(two, "1")))) for one, two in (("a", "b"), ("c", "d"))
    )
    knowledge = PiTms(Theory(dict.fromkeys("abcd", ("1", "2")), (first, second)))
    knowledge.commit([Require(guard({"a": "1"}))])
    knowledge.commit([Exclude(guard({"a": "1", "c": "1"}))])
    assert knowledge.statistics.sizes["factors"] == 2
    assert set(knowledge.prime_implicants()) == environments({"a": "1", "c": "2", "d": "1"})
    knowledge.commit([Exclude(guard({"a": "2", "d": "1"}))])
    assert knowledge.statistics.sizes["factors"] == 2


def test_statistics_and_the_limit_on_labels():
    knowledge = PiTms(EXAMPLE)
    statistics = knowledge.statistics
    assert statistics.propagations > 0
    assert statistics.sizes["nodes"] > statistics.sizes["variables"] == 3
    assert statistics.sizes["environments"] == 3
    domains = {f"v{at}": ("1", "2", "3") for at in range(9)}
    wide = tuple(
        Some((Is(Assignment("v0", "3")), Is(Assignment(name, "1")), Is(Assignment(name, "2"))))
        for name in domains
        if name != "v0"
    )
    assert PiTms(Theory(domains, wide)).implicant_count() == 1 + 2**8
    assert PiTms(Theory(domains, wide), largest_label=1 + 2**8).goal_size() == 1 + 2**8
    for most in (20, 2**8):
        with pytest.raises(OutOfSpaceError):
            PiTms(Theory(domains, wide), largest_label=most)


def test_what_compiling_costs_is_counted():
    """Figure 14: assumptions of three variables, two derived nodes, and the environments of their labels."""
    knowledge = PiTms(EXAMPLE)
    sizes = knowledge.statistics.sizes
    kinds = [label.node.kind for label in knowledge.labels()]
    assert sizes["nodes"] == len(kinds)
    assert kinds.count(NodeKind.DERIVED) == 2
    assert sizes["justifications"] == 1 + 3  # one for all conjuncts, one for each disjunct
    assert (sizes["conflicts"], sizes["factors"], sizes["environments"]) == (0, 1, 3)
    assert knowledge.statistics.environments_created > 0
    assert knowledge.statistics.seconds > 0
