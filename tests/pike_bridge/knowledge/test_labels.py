"""The operations on labels against what they mean, and the πTMS: Invariant 5.2 and the examples of the paper."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.pike_bridge.knowledge import labels
from robust.pike_bridge.knowledge.bdd import BddKnowledgeBase
from robust.pike_bridge.knowledge.labels import NodeKind, simplify
from robust.pike_bridge.knowledge.tms import Atms, PiTms
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, guard
from robust.pike_bridge.theory import (
    All,
    Effort,
    Exclude,
    Is,
    KnowledgeStatistics,
    Not,
    OutOfSpaceError,
    Require,
    Some,
    Theory,
    conjunction,
    is_consistent,
)
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import scenarios
from tests.pike_bridge.knowledge.theories import allowed, commitments, models, prime_implicants, satisfies, theories

VOCABULARY = AssignmentVocabulary({"x": ("1", "2", "3"), "y": ("1", "2", "3"), "z": ("1", "2")})
FIELDS = [VOCABULARY.field(variable) for variable in VOCABULARY.variables]
partial = st.lists(st.sampled_from(VOCABULARY.assignments), max_size=3, unique_by=lambda one: one.variable).map(dict)
several = st.lists(partial, max_size=5)


def effort():
    return Effort(KnowledgeStatistics())


def made(environment):
    return VOCABULARY.encode(guard(environment)) & VOCABULARY.made


def label(found):
    result = {}
    for environment in found:
        labels.insert(result, made(environment), sum(VOCABULARY.field(variable) for variable in environment))
    return result


def decoded(found):
    return {VOCABULARY.decode(environment) for environment in labels.environments(found)}


def covered(found):
    """The scenarios of a disjunction of environments."""
    known = [guard(one) for one in found]
    return [each for each in scenarios(VOCABULARY.domains) if any(one <= guard(each) for one in known)]


def prime(found):
    result = {}
    labels.add_and_generate_prime_implicants(result, label(found), FIELDS, effort())
    return result


@given(several)
def test_consensus_to_a_fixed_point_gives_all_prime_implicants(found):
    assert decoded(prime(found)) == prime_implicants(VOCABULARY.domains, covered(found))


@given(several, several)
def test_weaving_keeps_prime_implicants(first, second):
    both = [each for each in covered(first) if each in covered(second)]
    woven = labels.weave(prime(first), prime(second), effort())
    assert decoded(woven) == prime_implicants(VOCABULARY.domains, both)
    assert labels.size(woven) == len(decoded(woven))


@given(several, several)
def test_weaving_in_batches_is_weaving(first, second):
    whole = labels.weave(label(first), label(second), effort())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labels, "BATCH", 1)
        assert decoded(labels.weave(label(first), label(second), effort())) == decoded(whole)


@given(several, partial)
def test_insertion_keeps_what_is_most_general(found, further):
    before = label(found)
    known = decoded(before)
    assert known == {guard(one) for one in found if not any(guard(other) < guard(one) for other in found)}
    inserted = labels.insert(before, made(further), sum(VOCABULARY.field(variable) for variable in further))
    assert inserted == (not any(one <= guard(further) for one in known))
    assert decoded(before) == (
        {one for one in known if not guard(further) <= one} | {guard(further)} if inserted else known
    )
    assert all(before.values())


@given(several, several, partial)
def test_what_is_new_and_needed_is_told(found, further, excluded):
    before = label(found)
    known = decoded(before)
    assert decoded(labels.add_minimally(before, label(further), effort())) == decoded(before) - known
    whole = prime(found)
    known = decoded(whole)
    new = labels.add_and_generate_prime_implicants(whole, label(further), FIELDS, effort())
    assert decoded(new) >= decoded(whole) - known
    scope = sum(VOCABULARY.field(variable) for variable in excluded)
    consistent = {VOCABULARY.decode(one) for one, _ in labels.consistent_with(whole, made(excluded), scope)}
    assert consistent == {one for one in decoded(whole) if is_consistent(one | guard(excluded))}


@given(several, partial)
def test_splitting_keeps_prime_implicants(found, excluded):
    left = [each for each in covered(found) if not guard(excluded) <= guard(each)]
    before = prime(found)
    kept = decoded(before)
    parts = labels.split(before, labels.conflict_of(made(excluded), VOCABULARY), effort())
    assert (decoded(parts), decoded(before)) == (prime_implicants(VOCABULARY.domains, left), kept)


@given(several, partial)
def test_what_manifests_a_conflict_is_dropped(found, excluded):
    before = label(found)
    after = labels.without_manifest(before, labels.conflict_of(made(excluded), VOCABULARY), effort())
    assert decoded(after) == {one for one in decoded(before) if not guard(excluded) <= one}


def test_long_work_looks_at_the_clock():
    many = AssignmentVocabulary({f"v{at}": ("1", "2") for at in range(24)})
    halves = [
        {sum(map(many.field, half)): {many.encode(guard(one)) & many.made for one in scenarios(half)}}
        for half in ({f"v{at}": ("1", "2") for at in range(start, start + 12)} for start in (0, 12))
    ]
    with pytest.raises(OutOfTimeError):
        labels.weave(halves[0], halves[1], Effort(KnowledgeStatistics(), Deadline(0.0)))
    assert labels.weave(labels.true_label(), halves[0], effort()) == halves[0]


@given(theories())
def test_simplification_is_equivalent(theory):
    simplified = simplify(theory, Deadline())
    assert simplified.domains == theory.domains
    assert models(simplified) == models(theory)


def test_simplification_puts_units_into_effect():
    domains = {"x": ("1", "2", "3"), "y": ("1", "2")}
    x1, x2, y1 = (Is(Assignment(*one)) for one in (("x", "1"), ("x", "2"), ("y", "1")))
    theory = Theory(domains, (Not(Some((x1, Not(Some((y1, x2)))))),), (guard({"x": "2", "y": "1"}),))
    simplified = simplify(theory, Deadline())
    assert simplified == Theory(domains, (Some((y1, x2)),), (guard({"x": "1"}), guard({"x": "2", "y": "1"})))
    assert simplify(Theory(domains, (All((x1, x2)),)), Deadline()).constraints == (Some(()),)


Z1, Z2 = Is(Assignment("z", "1")), Is(Assignment("z", "2"))
P1, P2 = Is(Assignment("s", "eP1")), Is(Assignment("s", "eP2"))
Y1 = Is(Assignment("y", "1"))
EXAMPLE = Theory({"z": ("1", "2"), "y": ("1", "2"), "s": ("eP1", "eP2", "none")}, (Some((Not(Z1), P2, All((P1, Y1)))),))
"""Figures 13 and 14."""


def guards(*found):
    return {guard(environment) for environment in found}


def test_labels_of_figure_14():
    knowledge = PiTms(EXAMPLE)
    three = [set(each.environments) for each in knowledge.labels() if each.node.kind is NodeKind.DERIVED]
    n3 = guards({"s": "eP2"}, {"y": "1", "s": "eP1"})
    n4 = n3 | guards({"z": "2"})
    # Disjunctions in disjunctions are flattened, so that N_3 has no node of its own in this theory.
    assert n4 in three
    assert guards({"y": "1", "s": "eP1"}) in three
    assert set(knowledge.prime_implicants()) == n4
    assert set(PiTms(Theory(EXAMPLE.domains, (Some((P2, All((P1, Y1)))),))).prime_implicants()) == n3


def test_label_of_the_goal_after_a_conflict():
    expected = guards({"z": "2", "s": "eP1"}, {"z": "2", "s": "none"}, {"y": "1", "s": "eP1"})
    knowledge = PiTms(EXAMPLE)
    knowledge.commit([Exclude(guard({"s": "eP2"}))])
    assert set(knowledge.prime_implicants()) == expected
    assert knowledge.implicant_count() == 3
    from_the_start = PiTms(Theory(EXAMPLE.domains, EXAMPLE.constraints, (guard({"s": "eP2"}),)))
    assert set(from_the_start.prime_implicants()) == expected
    found = [each for each in knowledge.labels() if isinstance(each.node.formula, Some)]
    assert [set(each.environments) for each in found if Z2 in each.node.formula.operands] == [expected]


def test_consensus_example():
    """[PIKE §5.4]: of four environments, two are replaced by their consensus; the ATMS keeps all."""
    domains = dict.fromkeys("xyz", ("1", "2", "3"))
    label = ({"x": "1", "y": "1", "z": "1"}, {"x": "2", "y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})
    theory = Theory(domains, (Some(tuple(conjunction(guard(environment)) for environment in label)),))
    assert set(PiTms(theory).prime_implicants()) == guards({"y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})
    assert set(Atms(theory).goal()) == guards(*label)


@pytest.mark.parametrize("count", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_the_goal_has_all_prime_implicants(count):
    @settings(max_examples=count)
    @given(data=st.data())
    def drawn(data):
        goal_has_all_prime_implicants(data)

    drawn()


def goal_has_all_prime_implicants(data):
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
    assert set(knowledge.prime_implicants()) == guards({"a": "1", "c": "2", "d": "1"})
    knowledge.commit([Exclude(guard({"a": "2", "d": "1"}))])
    assert knowledge.statistics.sizes["factors"] == 2


def test_the_limit_on_labels():
    domains = {f"v{at}": ("1", "2", "3") for at in range(9)}
    wide = tuple(
        Some((Is(Assignment("v0", "3")), Is(Assignment(name, "1")), Is(Assignment(name, "2"))))
        for name in domains
        if name != "v0"
    )
    assert PiTms(Theory(domains, wide)).implicant_count() == 1 + 2**8
    with pytest.raises(OutOfSpaceError):
        PiTms(Theory(domains, wide), largest_goal=20)
    with pytest.raises(OutOfSpaceError):
        Atms(Theory(domains, wide), largest_label=20)


def test_what_compiling_costs_is_counted():
    """Figure 14: assumptions of three variables, two derived nodes, and the environments of their labels."""
    knowledge = PiTms(EXAMPLE)
    statistics, sizes = knowledge.statistics, knowledge.statistics.sizes
    kinds = [label.node.kind for label in knowledge.labels()]
    assert sizes["nodes"] == len(kinds)
    assert kinds.count(NodeKind.DERIVED) == 2
    assert sizes["justifications"] == 1 + 3  # one for all conjuncts, one for each disjunct
    assert (sizes["variables"], sizes["conflicts"], sizes["factors"]) == (3, 0, 1)
    assert min(sizes["diagram nodes"], sizes["label nodes"]) > 0
    assert min(statistics.propagations, statistics.environments_created, statistics.seconds) > 0
