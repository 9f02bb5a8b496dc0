"""Decision diagrams against brute force, their orders, and the goals of random plans against every other algorithm."""

from copy import copy
from dataclasses import replace
from itertools import product
from math import prod
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.generators.team_plans import FEASIBLE, random_plan
from robust.pike_bridge.compile import Compiling
from robust.pike_bridge.knowledge import create_knowledge_base
from robust.pike_bridge.knowledge.bdd import BddKnowledgeBase
from robust.pike_bridge.knowledge.goal import FALSE, NOTHING, TRUE, UNIT, Families, Functions
from robust.pike_bridge.knowledge.labels import TruthMaintenance, encode, environments, split
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, guard
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.pike_bridge.theory import (
    FIRST_TRY,
    MORE,
    All,
    Effort,
    Exclude,
    KnowledgeStatistics,
    OutOfSpaceError,
    Require,
    Theory,
    elimination_order,
    force_order,
    race,
)
from robust.smt.limits import Deadline
from tests.pike_bridge.knowledge.theories import allowed, models, theories

SIZES = (2, 3, 1, 2)
WORLDS = [dict(enumerate(values)) for values in product(*map(range, SIZES))]
CHOICES = [(variable, number) for variable, size in enumerate(SIZES) for number in range(size)]


@st.composite
def made(draw):
    """A consistent environment, by numbers."""
    return tuple(sorted(dict(draw(st.lists(st.sampled_from(CHOICES), max_size=3))).items()))


def holds(environment, world):
    return all(world[variable] == number for variable, number in environment)


def test_families():
    families = Families()
    first = families.branch(0, UNIT, (UNIT, NOTHING))
    assert families.branch(0, UNIT, (NOTHING, NOTHING)) == UNIT
    assert families.branch(0, UNIT, (UNIT, NOTHING)) == first
    assert set(families.environments([first])) == {(), ((0, 0),)}
    other = families.branch(1, NOTHING, (UNIT, UNIT))
    assert sorted(families.environments([first, other])) == [((0, 0), (1, 0)), ((0, 0), (1, 1)), ((1, 0),), ((1, 1),)]
    assert families.count(families.difference(first, UNIT, Deadline()), Deadline()) == 1
    assert families.difference(UNIT, first, Deadline()) == NOTHING


@settings(max_examples=200)
@given(st.lists(st.lists(made(), max_size=4), max_size=3), st.lists(made(), max_size=3), st.data())
def test_functions_are_those_of_brute_force(disjunctions, conflicts, data):
    functions = Functions(SIZES)
    whole = functions.all([*map(functions.some, disjunctions), *map(functions.excluded, conflicts)])
    left = [
        world
        for world in WORLDS
        if all(any(holds(each, world) for each in one) for one in disjunctions)
        and not any(holds(each, world) for each in conflicts)
    ]
    assert functions.count(whole) == len(left)
    assert (whole == FALSE, whole == TRUE) == (not left, left == WORLDS)
    forbidden = data.draw(st.frozensets(st.sampled_from(CHOICES), max_size=3))
    preferred = data.draw(st.sampled_from(left or WORLDS))
    possible = [world for world in left if not forbidden & set(world.items())]
    found = functions.find(whole, forbidden, preferred)
    assert found is None or not forbidden & set(found.items())
    assert found is not None or not possible
    if found is not None:
        assert all(world in left for world in WORLDS if holds(found.items(), world))
        assert preferred not in possible or found.items() <= preferred.items()
    again = functions.all([functions.excluded([choice]) for choice in sorted(forbidden)] + [whole])
    assert functions.count(again) == len(possible)


@settings(max_examples=100)
@given(theories(), st.data())
def test_the_goal_is_that_of_explicit_labels(theory, data):
    """The πTMS as the paper has it: the goal is a node, whose label is propagated to [PIKE, Algorithms 6 and 7]."""
    whole = Theory(theory.domains, (All(theory.constraints),), theory.conflicts)
    vocabulary, effort = AssignmentVocabulary(theory.domains), Effort(KnowledgeStatistics())
    network = encode(whole)
    maintenance = TruthMaintenance(network, vocabulary, consensus=True, resolve=split)
    maintenance.run(effort)
    (node,) = network.constraints
    expected = {vocabulary.decode(each) for each in environments(maintenance.label(node, effort))}
    if frozenset() in theory.conflicts:
        expected = set()
    found = list(PiTms(theory, shortcut=data.draw(st.booleans())).prime_implicants())
    assert (set(found), len(found)) == (expected, len(expected))


def plan(seed: int, top: int):
    return random_plan(seed, 0, replace(FEASIBLE, top=top)).plan()


@settings(max_examples=4)
@given(st.integers(0, 10_000), st.integers(2, 6))
def test_random_plans_have_the_same_answers_from_every_algorithm(seed, top):
    """Before and after commitments: the πTMS, the library's diagrams, the solver, and for choices the oracle."""
    drawn, random = plan(seed, top), Random(seed)  # noqa: S311 - reproducible, not secret
    bases = [Compiling(drawn, name).compile().knowledge for name in ("pitms", "bdd", "sat")]
    labels, diagram, _ = bases
    domains = bases[0].theory.domains
    oracle = Oracle(drawn)

    def one(names) -> frozenset[Assignment]:
        few = random.sample(list(names), min(len(names), random.randint(1, 2)))
        return guard({name: random.choice(domains[name]) for name in few})

    for _ in range(6):
        assert len({base.satisfiable() for base in bases}) == 1
        assert labels.count_models() == diagram.count_models()
        assert labels.implicant_count() == diagram.implicant_count()
        step = [Require(one(domains)), *(Exclude(one(domains)) for _ in range(random.randint(0, 6)))]
        answers = {base.could_commit(step) for base in bases}
        assert len(answers) == 1
        if answers == {True} and random.random() < 0.7:
            for base in bases:
                base.commit(step)
    fresh = Compiling(drawn, "pitms").compile().knowledge
    for _ in range(6):
        asked = one(drawn.network.domains) if drawn.network.domains else frozenset()
        exists = oracle.decide(asked).verdict is ExecutionExistence.EXISTS
        assert fresh.could_commit([Require(asked)]) == exists


def test_more_implicants_than_can_be_listed():
    compiled = Compiling(random_plan(7, 0, FEASIBLE).plan(), "pitms").compile()
    knowledge = compiled.knowledge
    assert isinstance(knowledge, PiTms)
    assert knowledge.implicant_count() == 177172312909223106183168
    other = BddKnowledgeBase(knowledge.theory)
    assert (other.implicant_count(), other.count_models()) == (knowledge.implicant_count(), knowledge.count_models())
    assert len(knowledge.theory.domains) > 150
    assert knowledge.statistics.sizes["label nodes"] < 1000
    some = next(knowledge.prime_implicants())
    sizes = {name: len(values) for name, values in knowledge.theory.domains.items()}
    # Whatever extends an implicant is a model, which does not hold of less than a prime one.
    for less in (some, *(some - {each} for each in some)):
        narrowed = copy(other)
        narrowed.commit([Require(less)])
        free = prod(size for name, size in sizes.items() if name not in {each.variable for each in less})
        assert (narrowed.count_models() == free) == (less == some)


def test_elimination_puts_what_hangs_on_choices_after_them():
    groups = [("x", "y"), ("y", "z"), ("s", "x", "y"), ("t", "z"), ("u", "x")]
    order = elimination_order(("x", "y", "z", "s", "t", "u", "alone"), groups)
    place = {variable: at for at, variable in enumerate(order)}
    assert sorted(order) == sorted(("x", "y", "z", "s", "t", "u", "alone"))
    assert place["s"] > max(place["x"], place["y"])
    assert place["t"] == place["z"] + 1
    assert place["u"] == place["x"] + 1
    assert elimination_order((), []) == []


def test_groups_are_kept_together():
    groups = [("a", "f"), ("f", "b"), ("b", "e"), ("e", "c"), ("c", "d"), ()]
    order = force_order("abcdef", groups)
    assert sorted(order) == list("abcdef")

    def spans(names):
        return sum(abs(names.index(one) - names.index(other)) for one, other in filter(None, groups))

    assert spans(order) < spans(list("abcdef"))


def test_orders_get_more_space_in_turn():
    tried = []

    def compile_in(order, space):
        tried.append(("".join(order), space))
        if space < 1_000_000 or tried[-1][0] == elimination:
            raise OutOfSpaceError
        return space

    groups = [("a", "b"), ("b", "c"), ("c", "d"), ("b", "d")]
    elimination, force = ("".join(order("abcd", groups)) for order in (elimination_order, force_order))
    assert elimination != force
    spaces = (FIRST_TRY, FIRST_TRY * MORE)
    assert race("abcd", groups, 5_000_000, compile_in) == spaces[-1] >= 1_000_000
    assert tried == [(name, space) for space in spaces for name in (elimination, force)]
    with pytest.raises(OutOfSpaceError):
        race("abcd", groups, 900_000, compile_in)
    assert tried[-1] == (force, 900_000)


def test_what_takes_too_much_space_one_way_may_not_the_other():
    """Conflicts in a band of variables, written in no order."""
    random = Random(3)  # noqa: S311 - reproducible, not secret
    names = [f"v{at}" for at in range(40)]
    shuffled = random.sample(names, len(names))
    conflicts = tuple(
        guard({shuffled[min(at + far, 39)]: random.choice("123") for far in (0, random.randint(1, 8))})
        for at in range(40)
    )
    theory = Theory(dict.fromkeys(names, ("1", "2", "3")), (), conflicts)
    diagram = BddKnowledgeBase(theory)
    for knowledge in (PiTms(theory), create_knowledge_base("pitms", theory, shortcut=False)):
        assert knowledge.implicant_count() == diagram.implicant_count()
        assert knowledge.count_models() == diagram.count_models()


@settings(max_examples=60)
@given(theories(), st.data())
def test_models_are_found_around_conflicts(theory, data):
    knowledge, left = PiTms(theory), models(theory)
    wanted = data.draw(st.sampled_from(left)) if left else {}
    some = data.draw(st.lists(st.sampled_from(sorted(wanted)), max_size=3, unique=True)) if wanted else []
    step = [Exclude(guard({name: wanted[name]})) for name in some]
    assert knowledge.could_commit(step) == any(allowed(model, step) for model in left)
