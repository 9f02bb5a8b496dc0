"""Every knowledge base against brute force; labels and decision diagrams against what they mean, their orders, and the
πTMS: Invariant 5.2, the examples of the paper, and the goals of random plans against every other algorithm."""

import time
from copy import copy
from itertools import product
from math import prod
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import FEASIBLE, random_plan
from robust.errors import InputError, SolverError
from robust.pike_bridge import knowledge as back_ends
from robust.pike_bridge import theory as shared
from robust.pike_bridge.compile import Compiling
from robust.pike_bridge.knowledge import bdd, create_knowledge_base, goal, labels, sat, tms
from robust.pike_bridge.knowledge.propagation import PropagatedLabels
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, guard
from robust.pike_bridge.theory import All, Exclude, Is, Not, Require, Some, Theory, conjunction, is_consistent
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import candidate_subplan, scenarios
from tests.pike_bridge.knowledge.theories import allowed, commitments, models, prime_implicants, satisfies, theories
from tests.pike_bridge.plans import differences, network
from tests.sampling import often

VOCABULARY = AssignmentVocabulary({"x": ("1", "2", "3"), "y": ("1", "2", "3"), "z": ("1", "2")})
FIELDS = [VOCABULARY.field(variable) for variable in VOCABULARY.variables]
partial = st.lists(st.sampled_from(VOCABULARY.assignments), max_size=3, unique_by=lambda each: each.variable).map(dict)
several = st.lists(partial, max_size=5)


def effort():
    return shared.Effort(shared.KnowledgeStatistics())


def encoded(environment):
    return VOCABULARY.encode(guard(environment)) & VOCABULARY.made


def label(environments):
    result = {}
    for environment in environments:
        labels.insert(result, encoded(environment), sum(map(VOCABULARY.field, environment)))
    return result


def decoded(label):
    return set(map(VOCABULARY.decode, labels.environments(label)))


def covered(environments):
    """The scenarios of a disjunction of environments."""
    known = list(map(guard, environments))
    return [each for each in scenarios(VOCABULARY.domains) if any(some <= guard(each) for some in known)]


def prime(environments):
    result = {}
    labels.add_and_generate_prime_implicants(result, label(environments), FIELDS, effort())
    return result


def implicants(of):
    return prime_implicants(VOCABULARY.domains, of)


@given(several, several, partial)
def test_operations_on_labels_mean_what_they_say(first, second, excluded):
    """Consensus to a fixed point, weaving in batches or not, and conflicts."""
    fact, scope = guard(excluded), sum(map(VOCABULARY.field, excluded))
    conflict = labels.conflict_of(encoded(excluded), VOCABULARY)
    assert decoded(prime(first)) == implicants(covered(first))
    woven = labels.weave(prime(first), prime(second), effort())
    assert decoded(woven) == implicants([each for each in covered(first) if each in covered(second)])
    assert labels.size(woven) == len(decoded(woven))
    whole = labels.weave(label(first), label(second), effort())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labels, "BATCH", 1)
        assert decoded(labels.weave(label(first), label(second), effort())) == decoded(whole)
    before = prime(first)
    kept = decoded(before)
    parts = labels.split(before, conflict, effort())
    left = [each for each in covered(first) if not fact <= guard(each)]
    assert (decoded(parts), decoded(before)) == (implicants(left), kept)
    consistent = {VOCABULARY.decode(each) for each, _ in labels.consistent_with(before, encoded(excluded), scope)}
    assert consistent == {each for each in kept if is_consistent(each | fact)}
    before = label(first)
    kept = {each for each in decoded(before) if not fact <= each}
    assert decoded(labels.without_manifest(before, conflict, effort())) == kept


@given(several, several, partial)
def test_insertion_keeps_what_is_most_general_and_tells_what_is_new(first, second, further):
    before, new = label(first), guard(further)
    known = decoded(before)
    assert known == {guard(each) for each in first if not any(guard(other) < guard(each) for other in first)}
    assert decoded(labels.add_minimally(before, label(second), effort())) == decoded(before) - known
    before = label(first)
    inserted = labels.insert(before, encoded(further), sum(map(VOCABULARY.field, further)))
    assert inserted == (not any(each <= new for each in known))
    assert decoded(before) == ({each for each in known if not new <= each} | {new} if inserted else known)
    assert all(before.values())
    whole = prime(first)
    known = decoded(whole)
    added = labels.add_and_generate_prime_implicants(whole, label(second), FIELDS, effort())
    assert decoded(added) >= decoded(whole) - known


def test_long_work_looks_at_the_clock():
    many = AssignmentVocabulary({f"v{at}": ("1", "2") for at in range(24)})
    halves = [
        {sum(map(many.field, half)): {many.encode(guard(each)) & many.made for each in scenarios(half)}}
        for half in ({f"v{at}": ("1", "2") for at in range(start, start + 12)} for start in (0, 12))
    ]
    with pytest.raises(OutOfTimeError):
        labels.weave(halves[0], halves[1], shared.Effort(shared.KnowledgeStatistics(), Deadline(0.0)))
    assert labels.weave(labels.true_label(), halves[0], effort()) == halves[0]


SIZES = (2, 3, 1, 2)
WORLDS = [dict(enumerate(values)) for values in product(*map(range, SIZES))]
CHOICES = [(variable, number) for variable, size in enumerate(SIZES) for number in range(size)]
numbered = st.lists(st.sampled_from(CHOICES), max_size=3).map(lambda pairs: tuple(sorted(dict(pairs).items())))


def holds(environment, world):
    return all(world[variable] == number for variable, number in environment)


@settings(max_examples=often(100, 200))
@given(st.lists(st.lists(numbered, max_size=4), max_size=3), st.lists(numbered, max_size=3), st.data())
def test_functions_are_those_of_brute_force(disjunctions, conflicts, data):
    functions = goal.Functions(SIZES)
    whole = functions.all([*map(functions.some, disjunctions), *map(functions.excluded, conflicts)])
    left = [
        world
        for world in WORLDS
        if all(any(holds(each, world) for each in several) for several in disjunctions)
        and not any(holds(each, world) for each in conflicts)
    ]
    assert functions.count(whole) == len(left)
    assert (whole == goal.FALSE, whole == goal.TRUE) == (not left, left == WORLDS)
    forbidden = data.draw(st.frozensets(st.sampled_from(CHOICES), max_size=3))
    preferred = data.draw(st.sampled_from(left or WORLDS))
    possible = [world for world in left if not forbidden & set(world.items())]
    model = functions.find(whole, forbidden, preferred)
    assert model is not None or not possible
    if model is not None:
        assert not forbidden & set(model.items())
        assert all(world in left for world in WORLDS if holds(model.items(), world))
        assert preferred not in possible or model.items() <= preferred.items()
    again = functions.all([functions.excluded([choice]) for choice in sorted(forbidden)] + [whole])
    assert functions.count(again) == len(possible)


def test_more_implicants_than_can_be_listed():
    knowledge = Compiling(random_plan(7, 0, FEASIBLE).plan(), "pitms").compile().knowledge
    other = bdd.BddKnowledgeBase(knowledge.theory)
    sizes = {name: len(values) for name, values in knowledge.theory.domains.items()}
    assert knowledge.implicant_count() == other.implicant_count() == 177172312909223106183168
    assert other.count_models() == knowledge.count_models()
    assert len(sizes) > 150
    assert knowledge.statistics.sizes["label nodes"] < 1000
    implicant = next(knowledge.prime_implicants())
    # Whatever extends an implicant is a model, which does not hold of less than a prime one.
    for less in (implicant, *(implicant - {each} for each in implicant)):
        narrowed = copy(other)
        narrowed.commit([Require(less)])
        free = prod(size for name, size in sizes.items() if name not in dict(less))
        assert (narrowed.count_models() == free) == (less == implicant)


def test_orders_of_variables_and_their_space_in_turn_of_which_one_may_be_enough():
    """Elimination puts what hangs on choices after them; force keeps groups together."""
    names = ("x", "y", "z", "s", "t", "u", "alone")
    order = shared.elimination_order(names, [("x", "y"), ("y", "z"), ("s", "x", "y"), ("t", "z"), ("u", "x")])
    place = {variable: at for at, variable in enumerate(order)}
    assert sorted(order) == sorted(names)
    assert place["s"] > max(place["x"], place["y"])
    assert (place["t"], place["u"]) == (place["z"] + 1, place["x"] + 1)
    assert shared.elimination_order((), []) == []
    groups = [("a", "f"), ("f", "b"), ("b", "e"), ("e", "c"), ("c", "d"), ()]
    order = shared.force_order("abcdef", groups)
    spans = [
        sum(abs(names.index(a) - names.index(b)) for a, b in filter(None, groups)) for names in (order, [*"abcdef"])
    ]
    assert sorted(order) == list("abcdef")
    assert spans[0] < spans[1]
    tried = []

    def compile_in(order, space):
        tried.append(("".join(order), space))
        if space < 1_000_000 or tried[-1][0] == elimination:
            raise shared.OutOfSpaceError
        return space

    groups = [("a", "b"), ("b", "c"), ("c", "d"), ("b", "d")]
    elimination, force = ("".join(order("abcd", groups)) for order in (shared.elimination_order, shared.force_order))
    assert elimination != force
    spaces = (shared.FIRST_TRY, shared.FIRST_TRY * shared.MORE)
    assert shared.race("abcd", groups, 5_000_000, compile_in) == spaces[-1] >= 1_000_000
    assert tried == [(name, space) for space in spaces for name in (elimination, force)]
    with pytest.raises(shared.OutOfSpaceError):
        shared.race("abcd", groups, 900_000, compile_in)
    assert tried[-1] == (force, 900_000)
    random = Random(3)  # noqa: S311 - reproducible, not secret
    names = [f"v{at}" for at in range(40)]
    shuffled = random.sample(names, len(names))
    conflicts = tuple(
        guard({shuffled[min(at + far, 39)]: random.choice("123") for far in (0, random.randint(1, 8))})
        for at in range(40)
    )
    theory = Theory(dict.fromkeys(names, ("1", "2", "3")), (), conflicts)
    diagram = bdd.BddKnowledgeBase(theory)
    for knowledge in (tms.PiTms(theory), tms.PiTms(theory, shortcut=False)):
        assert knowledge.implicant_count() == diagram.implicant_count()
        assert knowledge.count_models() == diagram.count_models()


def test_simplification_puts_units_into_effect():
    domains = {"x": ("1", "2", "3"), "y": ("1", "2")}
    x1, x2, y1 = (Is(Assignment(*each)) for each in (("x", "1"), ("x", "2"), ("y", "1")))
    theory = Theory(domains, (Not(Some((x1, Not(Some((y1, x2)))))),), (guard({"x": "2", "y": "1"}),))
    conflicts = (guard({"x": "1"}), guard({"x": "2", "y": "1"}))
    assert labels.simplify(theory, Deadline()) == Theory(domains, (Some((y1, x2)),), conflicts)
    assert labels.simplify(Theory(domains, (All((x1, x2)),)), Deadline()).constraints == (Some(()),)


NOT_Z1, Z2 = Not(Is(Assignment("z", "1"))), Is(Assignment("z", "2"))
P1, P2, Y1 = Is(Assignment("s", "eP1")), Is(Assignment("s", "eP2")), Is(Assignment("y", "1"))
EXAMPLE = Theory({"z": ("1", "2"), "y": ("1", "2"), "s": ("eP1", "eP2", "none")}, (Some((NOT_Z1, P2, All((P1, Y1)))),))
"""Figures 13 and 14."""


def guards(*environments):
    return set(map(guard, environments))


def test_labels_of_figure_14_and_of_the_consensus_example():
    """Assumptions of three variables and two derived nodes; [PIKE §5.4]: two of four environments have a consensus."""
    knowledge = tms.PiTms(EXAMPLE)
    kinds = [each.node.kind for each in knowledge.labels()]
    derived = [set(each.environments) for each in knowledge.labels() if each.node.kind is labels.NodeKind.DERIVED]
    both = guards({"y": "1", "s": "eP1"})
    n3 = both | guards({"s": "eP2"})
    n4 = n3 | guards({"z": "2"})
    # Disjunctions in disjunctions are flattened, so that N_3 has no node of its own in this theory.
    assert len(derived) == 2
    assert n4 in derived
    assert both in derived
    assert set(knowledge.prime_implicants()) == n4
    assert set(tms.PiTms(Theory(EXAMPLE.domains, (Some((P2, All((P1, Y1)))),))).prime_implicants()) == n3
    for kind in (tms.PiTms, PropagatedLabels):  # a link is broken [PIKE §5.5]
        without = kind(EXAMPLE)
        without.commit([Exclude(guard({"s": "eP2"}))])
        assert set(without.prime_implicants()) == both | guards({"z": "2", "s": "eP1"}, {"z": "2", "s": "none"})
    statistics, sizes = knowledge.statistics, knowledge.statistics.sizes
    assert (sizes["nodes"], sizes["justifications"]) == (len(kinds), 1 + 3)  # one for all conjuncts, one each disjunct
    assert (sizes["variables"], sizes["conflicts"], sizes["factors"]) == (3, 0, 1)
    assert min(sizes["diagram nodes"], sizes["label nodes"]) > 0
    assert min(statistics.propagations, statistics.environments_created, statistics.seconds) > 0
    label = ({"x": "1", "y": "1", "z": "1"}, {"x": "2", "y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})
    theory = Theory(dict.fromkeys("xyz", ("1", "2", "3")), (Some(tuple(conjunction(guard(each)) for each in label)),))
    assert set(tms.PiTms(theory).prime_implicants()) == guards({"y": "1", "z": "1"}, {"x": "2", "y": "3"}, {"x": "3"})
    assert set(tms.Atms(theory).goal()) == guards(*label)
    domains = {f"v{at}": ("1", "2", "3") for at in range(9)}
    names = ((Assignment("v0", "3"), Assignment(name, "1"), Assignment(name, "2")) for name in domains if name != "v0")
    wide = Theory(domains, tuple(Some(tuple(map(Is, each))) for each in names))
    assert tms.PiTms(wide).implicant_count() == 1 + 2**8
    for kind, limit in (tms.PiTms, "largest_goal"), (tms.Atms, "largest_label"), (PropagatedLabels, "largest_label"):
        with pytest.raises(shared.OutOfSpaceError):
            kind(wide, **{limit: 20})


@pytest.mark.parametrize("kind", [tms.PiTms, PropagatedLabels])
@settings(max_examples=often(20, 1000))
@given(theories(), st.data())
def test_goal_and_nodes_have_all_prime_implicants(kind, theory, data):
    """Invariant 5.2."""
    left = models(theory)
    knowledge, diagram = kind(theory, shortcut=False), bdd.BddKnowledgeBase(theory)
    assert set(kind(theory).prime_implicants()) == prime_implicants(theory.domains, left)
    assert knowledge.encoded.domains == theory.domains
    assert sorted(map(str, models(knowledge.encoded))) == sorted(map(str, left))
    without = models(Theory(theory.domains, (), knowledge.encoded.conflicts))
    for step in ([], *(data.draw(commitments(theory.domains)) for _ in range(2))):
        knowledge.commit(step)
        diagram.commit(step)
        left, without = ([model for model in worlds if allowed(model, step)] for worlds in (left, without))
        answer = list(knowledge.prime_implicants())
        assert set(answer) == prime_implicants(theory.domains, left)
        assert len(answer) == knowledge.implicant_count() == diagram.implicant_count()
        assert sorted(map(sorted, diagram.prime_implicants())) == sorted(map(sorted, answer))
    for label in knowledge.labels():
        if label.node.kind is not labels.NodeKind.CONTRADICTION:
            holding = [model for model in without if satisfies(model, label.node.formula)]
            assert label.environments == prime_implicants(theory.domains, holding)


def either(*names):
    return Some(tuple(Is(Assignment(name, "1")) for name in names))


def test_factors_stay_apart():
    names = [f"v{at}" for at in range(400)]
    pairs = tuple(map(either, names[::2], names[1::2]))
    knowledge = tms.PiTms(Theory(dict.fromkeys(names, ("1", "2")), pairs))
    assert (knowledge.implicant_count(), knowledge.count_models()) == (2**200, 3**200)
    assert len(next(knowledge.prime_implicants())) == knowledge.statistics.sizes["factors"] == 200
    across = guard({"v0": "1", "v2": "1"})
    knowledge.commit([Exclude(across)])
    assert knowledge.statistics.sizes["factors"] == 199
    assert knowledge.count_models() == 3**200 // 9 * 5
    assert not knowledge.could_commit([Require(across)])
    knowledge = tms.PiTms(Theory(dict.fromkeys("abcd", ("1", "2")), (either("a", "b"), either("c", "d"))))
    knowledge.commit([Require(guard({"a": "1"}))])
    knowledge.commit([Exclude(guard({"a": "1", "c": "1"}))])
    assert knowledge.statistics.sizes["factors"] == 2
    assert set(knowledge.prime_implicants()) == guards({"a": "1", "c": "2", "d": "1"})
    knowledge.commit([Exclude(guard({"a": "2", "d": "1"}))])
    assert knowledge.statistics.sizes["factors"] == 2


NAMES = ("pitms", "pitms-labels", "atms", "bdd", "sat")
X1, Y2 = Is(Assignment("x", "1")), Is(Assignment("y", "2"))
ROOMS = Theory(
    {"x": ("1", "2"), "y": ("1", "2", "3"), "only": ("1",)}, (Some((X1, Y2)),), (guard({"x": "1", "y": "3"}),)
)

for_each = pytest.mark.parametrize("name", NAMES)


def possible(knowledge):
    """The scenarios that a knowledge base allows."""
    return [each for each in scenarios(knowledge.theory.domains) if knowledge.could_commit([Require(guard(each))])]


@for_each
@settings(max_examples=often(15, 500))
@given(theories(), st.booleans(), st.data())
def test_answers_are_those_of_brute_force(name, theory, shortcut, data):
    left = models(theory)
    knowledge = create_knowledge_base(name, theory, shortcut=shortcut)
    for _ in range(3):
        assert (knowledge.satisfiable(), knowledge.count_models()) == (bool(left), len(left))
        step = data.draw(commitments(theory.domains))
        assert knowledge.could_commit(step) == any(allowed(model, step) for model in left)
        knowledge.commit(step)
        left = [model for model in left if allowed(model, step)]
    assert possible(knowledge) == left


@for_each
def test_every_question_is_counted_and_an_expired_deadline_changes_nothing(name):
    with pytest.raises(OutOfTimeError):
        create_knowledge_base(name, ROOMS, deadline=Deadline(0.0))
    knowledge = create_knowledge_base(name, ROOMS)
    before, count = knowledge.statistics.queries, knowledge.count_models()
    step = [Require(guard({"x": "2"})), Exclude(guard({"y": "1"}))]
    for ask, *about in (knowledge.satisfiable,), (knowledge.could_commit, step), (knowledge.count_models,):
        ask(*about)
        with pytest.raises(OutOfTimeError):
            ask(*about, Deadline(0.0))
    with pytest.raises(OutOfTimeError):
        knowledge.commit(step, Deadline(0.0))
    assert knowledge.statistics.queries == before + 4
    assert knowledge.count_models() == count == len(models(ROOMS))
    knowledge.commit(step)
    assert knowledge.count_models() == 1


@pytest.mark.parametrize("name", ["pitms", "pitms-labels", "atms", "bdd"])
def test_compiling_too_much_ends_soon_after_the_deadline(name):
    """Sixty variables in random triples, which no order keeps apart."""
    names, random = [f"v{at}" for at in range(60)], Random(0)  # noqa: S311 - reproducible, not secret
    triples = tuple(
        Not(All(tuple(Is(Assignment(each, random.choice("123"))) for each in random.sample(names, 3))))
        for _ in range(180)
    )
    theory, statistics = Theory(dict.fromkeys(names, ("1", "2", "3", "4")), triples), shared.KnowledgeStatistics()
    started, deadline = time.monotonic(), Deadline.after(0.5)
    with pytest.raises(OutOfTimeError):
        create_knowledge_base(name, theory, shortcut=False, deadline=deadline, statistics=statistics)
    assert time.monotonic() - started < 5.5
    assert statistics.seconds > 0
    assert statistics.sizes


@for_each
def test_contradictory_unknown_deep_and_missing_parts(name):
    knowledge = create_knowledge_base(name, ROOMS)
    both = frozenset({Assignment("x", "1"), Assignment("x", "2")})
    assert not knowledge.could_commit([Require(both)])
    assert knowledge.could_commit([Exclude(both)])
    assert not knowledge.could_commit([Exclude(frozenset())])
    # No conflict is manifested by any one implicant, but they leave no value of y.
    assert not knowledge.could_commit([Exclude(guard({"y": value})) for value in "123"])
    assert not knowledge.could_commit([Require(guard({"only": "1"})), Exclude(guard({"only": "1"}))])
    knowledge.commit([Require(both)])
    assert (knowledge.satisfiable(), knowledge.count_models()) == (False, 0)
    knowledge = create_knowledge_base(name, ROOMS)
    for environment, message in (
        ({"z": "1"}, "a commitment mentions unknown variable 'z'; known are only, x, y"),
        ({"x": "3"}, "a commitment has x = 3, but '3' is not a value of x; known are 1, 2"),
    ):
        for ask, commitment in (knowledge.could_commit, Require), (knowledge.commit, Exclude):
            with pytest.raises(InputError, match=message):
                ask([commitment(guard(environment))])
    for theory, message in (
        (Theory({"x": ()}), "variable 'x' has the values"),
        (Theory({"x": ("1", "1")}), "expected at least one, all different"),
        (Theory({"x": ("1",)}, (Y2,)), "a constraint mentions unknown variable 'y'"),
        (Theory({"x": ("1",)}, (), (guard({"x": "2"}),)), "a conflict has x = 2"),
    ):
        with pytest.raises(InputError, match=message):
            create_knowledge_base(name, theory)
    deep = X1
    for _ in range(3001):
        deep = Not(All((deep,)))
    knowledge = create_knowledge_base(name, Theory({"x": ("1", "2")}, (deep,)))
    assert knowledge.count_models() == 1
    assert knowledge.could_commit([Require(guard({"x": "2"}))])
    for theory, count in (Theory({}), 1), (Theory({}, (Some(()),)), 0), (Theory({"x": ("1", "2", "3")}), 3):
        assert create_knowledge_base(name, theory).count_models() == count


def test_registry():
    assert set(NAMES) <= set(back_ends.knowledge_bases())
    assert [name for name in NAMES if back_ends.reasons_about_time(name)] == ["sat"]
    with pytest.raises(InputError, match="unknown knowledge base 'pitm'; did you mean 'pitms'"):
        create_knowledge_base("pitm", ROOMS)
    with pytest.raises(InputError, match="unknown knowledge base"):
        back_ends.reasons_about_time("dnnf")
    with pytest.raises(InputError, match="knowledge base 'bdd' takes no network"):
        create_knowledge_base("bdd", ROOMS, network=network(""))
    with pytest.raises(SolverError, match="unknown solver 'z4'"):
        create_knowledge_base("sat", ROOMS, solver="z4")


@settings(max_examples=often(30, 60))
@given(differences)
def test_models_are_the_temporally_consistent_scenarios(drawn):
    knowledge = create_knowledge_base("sat", Theory(drawn.domains), network=drawn)
    assert possible(knowledge) == [
        each for each in scenarios(drawn.domains) if candidate_subplan(drawn, each).consistent
    ]


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_choice_may_be_too_slow(solver):
    slow, fast = (guard({"100% sure": value}) for value in ("slow", "fast"))
    bounds = (("a", "b", None, 5), ("a", "b", 6, None, slow))
    late = network("a b", *bounds, choices=[("100% sure", ("slow", "fast"), "a")])
    knowledge = sat.SatKnowledgeBase(Theory(late.domains), late, solver=solver)
    asked = [Require(slow)], [Require(fast)], [Exclude(fast)]
    assert [knowledge.could_commit(each) for each in asked] == [False, True, False]
    knowledge.commit([Exclude(slow)])
    assert knowledge.count_models() == 1
    theory = Theory({"x": ("1", "2")}, (X1,))
    assert not sat.SatKnowledgeBase(theory, network("a b", ("a", "b", 2, 1)), solver=solver).satisfiable()
