"""The operations on labels, one at a time, against what they mean."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.pike_bridge.knowledge import labels
from robust.pike_bridge.knowledge.bdd import NOTHING, UNIT, Families, force_order
from robust.pike_bridge.knowledge.interface import Effort, KnowledgeStatistics
from robust.pike_bridge.knowledge.labels import (
    add_and_generate_prime_implicants,
    add_minimally,
    conflict,
    consensus,
    consistent_with,
    count_models,
    environments,
    insert,
    models,
    size,
    split,
    true_label,
    weave,
    without_manifest,
)
from robust.pike_bridge.knowledge.network import simplify
from robust.pike_bridge.model import Assignment, Vocabulary, guard
from robust.pike_bridge.theory import All, Is, Not, Some, Theory, is_consistent
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.knowledge.theories import listed, prime_implicants, scenarios, theories
from tests.pike_bridge.knowledge.theories import models as brute_force

VOCABULARY = Vocabulary({"x": ("1", "2", "3"), "y": ("1", "2", "3"), "z": ("1", "2")})
FIELDS = [VOCABULARY.field(variable) for variable in VOCABULARY.variables]
partial = st.lists(st.sampled_from(VOCABULARY.assignments), max_size=3, unique_by=lambda one: one.variable).map(dict)
several = st.lists(partial, max_size=5)


def effort() -> Effort:
    return Effort(KnowledgeStatistics())


def made(environment):
    return VOCABULARY.encode(guard(environment)) & VOCABULARY.made


def label(found):
    result = {}
    for environment in found:
        insert(result, made(environment), sum(VOCABULARY.field(variable) for variable in environment))
    return result


def decoded(found):
    return {VOCABULARY.decode(environment) for environment in environments(found)}


def covered(found):
    """The scenarios of a disjunction of environments."""
    known = [guard(one) for one in found]
    return [each for each in scenarios(VOCABULARY.domains) if any(one <= guard(each) for one in known)]


def prime(found):
    result = {}
    add_and_generate_prime_implicants(result, label(found), FIELDS, effort())
    return result


@given(several)
def test_consensus_to_a_fixed_point_gives_all_prime_implicants(found):
    assert decoded(prime(found)) == prime_implicants(VOCABULARY.domains, covered(found))


@given(several, several)
def test_weaving_keeps_prime_implicants(first, second):
    both = [each for each in covered(first) if each in covered(second)]
    woven = weave(prime(first), prime(second), effort())
    assert decoded(woven) == prime_implicants(VOCABULARY.domains, both)
    assert size(woven) == len(decoded(woven))


@given(several, several)
def test_weaving_in_batches_is_weaving(first, second):
    whole = weave(label(first), label(second), effort())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labels, "BATCH", 1)
        assert decoded(weave(label(first), label(second), effort())) == decoded(whole)


@given(several, partial)
def test_insertion_keeps_what_is_most_general(found, further):
    before = label(found)
    known = decoded(before)
    assert known == {guard(one) for one in found if not any(guard(other) < guard(one) for other in found)}
    inserted = insert(before, made(further), sum(VOCABULARY.field(variable) for variable in further))
    assert inserted == (not any(one <= guard(further) for one in known))
    assert decoded(before) == (
        {one for one in known if not guard(further) <= one} | {guard(further)} if inserted else known
    )
    assert all(before.values())


@given(several, several, partial)
def test_what_is_new_and_needed_is_told(found, further, excluded):
    before = label(found)
    known = decoded(before)
    added = add_minimally(before, label(further), effort())
    assert decoded(added) == decoded(before) - known
    whole = prime(found)
    known = decoded(whole)
    new = add_and_generate_prime_implicants(whole, label(further), FIELDS, effort())
    assert decoded(new) >= decoded(whole) - known
    allowed = {one for one in decoded(whole) if is_consistent(one | guard(excluded))}
    assert decoded(consistent(whole, excluded)) == allowed


def consistent(found, environment):
    result = {}
    scope = sum(VOCABULARY.field(variable) for variable in environment)
    for one, own in consistent_with(found, made(environment), scope):
        result.setdefault(own, set()).add(one)
    return result


@given(several, partial)
def test_splitting_keeps_prime_implicants(found, excluded):
    left = [each for each in covered(found) if not guard(excluded) <= guard(each)]
    before = prime(found)
    kept = decoded(before)
    assert decoded(split(before, conflict(made(excluded), VOCABULARY), effort())) == prime_implicants(
        VOCABULARY.domains, left
    )
    assert decoded(before) == kept


@given(several, partial)
def test_what_manifests_a_conflict_is_dropped(found, excluded):
    before = label(found)
    after = without_manifest(before, conflict(made(excluded), VOCABULARY), effort())
    assert decoded(after) == {one for one in decoded(before) if not guard(excluded) <= one}


@given(several)
def test_counting_and_listing_models(found):
    whole = sum(FIELDS)
    expected = covered(found)
    assert count_models(label(found), whole, VOCABULARY, Deadline()) == len(expected)
    assert listed(models([(whole, label(found))], VOCABULARY, Deadline())) == listed(expected)


def test_the_consensus_of_the_paper():
    """[PIKE §5.4]: over x, {y = 1, z = 1} and nothing else, because y = 1 contradicts y = 3."""
    found = label([{"x": "1", "y": "1", "z": "1"}, {"x": "2", "y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"}])
    assert decoded(consensus(found, FIELDS[0], effort())) == {guard({"y": "1", "z": "1"})}
    added = add_and_generate_prime_implicants({}, found, FIELDS, effort())
    assert decoded(added) == {guard(one) for one in ({"y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})}


def test_long_work_looks_at_the_clock():
    many = Vocabulary({f"v{at}": ("1", "2") for at in range(24)})
    halves = [
        {
            sum(many.field(name) for name in names): {
                many.encode(guard(dict(zip(names, values, strict=True)))) & many.made
                for values in ((f"{1 + (number >> at & 1)}" for at in range(12)) for number in range(4096))
            }
        }
        for names in (many.variables[:12], many.variables[12:])
    ]
    with pytest.raises(OutOfTimeError):
        weave(halves[0], halves[1], Effort(KnowledgeStatistics(), Deadline(0.0)))
    assert weave(true_label(), halves[0], effort()) == halves[0]


@given(theories())
def test_simplification_is_equivalent(theory):
    simplified = simplify(theory, Deadline())
    assert simplified.domains == theory.domains
    assert listed(brute_force(simplified)) == listed(brute_force(theory))


def test_simplification_puts_units_into_effect():
    domains = {"x": ("1", "2", "3"), "y": ("1", "2")}
    x1, x2, y1 = (Is(Assignment(*one)) for one in (("x", "1"), ("x", "2"), ("y", "1")))
    theory = Theory(domains, (Not(Some((x1, Not(Some((y1, x2)))))),), (guard({"x": "2", "y": "1"}),))
    simplified = simplify(theory, Deadline())
    assert simplified == Theory(domains, (Some((y1, x2)),), (guard({"x": "1"}), guard({"x": "2", "y": "1"})))
    assert simplify(Theory(domains, (All((x1, x2)),)), Deadline()).constraints == (Some(()),)


def test_families():
    families = Families()
    first = families.branch(0, UNIT, (UNIT, NOTHING))
    assert families.branch(0, UNIT, (NOTHING, NOTHING)) == UNIT
    assert families.branch(0, UNIT, (UNIT, NOTHING)) == first
    assert set(families.environments(first)) == {(), ((0, 0),)}
    assert families.count(families.difference(first, UNIT, Deadline()), Deadline()) == 1
    assert families.difference(UNIT, first, Deadline()) == NOTHING


def test_groups_are_kept_together():
    groups = [("a", "f"), ("f", "b"), ("b", "e"), ("e", "c"), ("c", "d"), ()]
    order = force_order("abcdef", groups)
    assert sorted(order) == list("abcdef")

    def spans(names):
        return sum(abs(names.index(one) - names.index(other)) for one, other in filter(None, groups))

    assert spans(order) < spans(list("abcdef"))
