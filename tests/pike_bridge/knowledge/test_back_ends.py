"""Every knowledge base against brute force, and the errors that all of them share."""

import time
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError, SolverError
from robust.pike_bridge.knowledge import create_knowledge_base, knowledge_bases, reasons_about_time
from robust.pike_bridge.knowledge.sat import SatKnowledgeBase
from robust.pike_bridge.model import Assignment, guard
from robust.pike_bridge.theory import All, Exclude, Is, KnowledgeStatistics, Not, Require, Some, Theory
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.brute_force import candidate_subplan, scenarios
from tests.pike_bridge.knowledge.theories import allowed, commitments, models, theories
from tests.pike_bridge.plans import differences, network

NAMES = ("pitms", "atms", "bdd", "sat")
EXPIRED = Deadline(0.0)
ROOMS = Theory(
    {"x": ("1", "2"), "y": ("1", "2", "3"), "only": ("1",)},
    (Some((Is(Assignment("x", "1")), Is(Assignment("y", "2")))),),
    (guard({"x": "1", "y": "3"}),),
)

each = pytest.mark.parametrize("name", NAMES)


@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])
@each
def test_answers_are_those_of_brute_force(name, count):
    @settings(max_examples=count)
    @given(data=st.data())
    def drawn(data):
        compare_with_brute_force(name, data)

    drawn()


def compare_with_brute_force(name, data):
    theory = data.draw(theories())
    left = models(theory)
    knowledge = create_knowledge_base(name, theory, shortcut=data.draw(st.booleans()))
    for _ in range(3):
        assert knowledge.satisfiable() == bool(left)
        assert knowledge.count_models() == len(left)
        step = data.draw(commitments(theory.domains))
        assert knowledge.could_commit(step) == any(allowed(model, step) for model in left)
        knowledge.commit(step)
        left = [model for model in left if allowed(model, step)]
    assert [one for one in scenarios(theory.domains) if knowledge.could_commit([Require(guard(one))])] == left


@each
def test_every_question_is_counted_and_an_expired_deadline_changes_nothing(name):
    with pytest.raises(OutOfTimeError):
        create_knowledge_base(name, ROOMS, deadline=EXPIRED)
    knowledge = create_knowledge_base(name, ROOMS)
    before, count = knowledge.statistics.queries, knowledge.count_models()
    step = [Require(guard({"x": "2"})), Exclude(guard({"y": "1"}))]
    questions = (
        knowledge.satisfiable,
        lambda *deadline: knowledge.could_commit(step, *deadline),
        knowledge.count_models,
    )
    for ask in questions:
        ask()
        with pytest.raises(OutOfTimeError):
            ask(EXPIRED)
    with pytest.raises(OutOfTimeError):
        knowledge.commit(step, EXPIRED)
    assert knowledge.statistics.queries == before + 4
    assert knowledge.count_models() == count == len(models(ROOMS))
    knowledge.commit(step)
    assert knowledge.count_models() == 1


@pytest.mark.parametrize("name", ["pitms", "atms", "bdd"])
def test_compiling_too_much_ends_soon_after_the_deadline(name):
    """Sixty variables in random triples, which no order keeps apart."""
    names = [f"v{at}" for at in range(60)]
    random = Random(0)  # noqa: S311 - reproducible, not secret
    triples = [
        Not(All(tuple(Is(Assignment(one, random.choice("123"))) for one in random.sample(names, 3))))
        for _ in range(180)
    ]
    theory, statistics = Theory(dict.fromkeys(names, ("1", "2", "3", "4")), tuple(triples)), KnowledgeStatistics()
    started, deadline = time.monotonic(), Deadline.after(1.0)
    with pytest.raises(OutOfTimeError):
        create_knowledge_base(name, theory, shortcut=False, deadline=deadline, statistics=statistics)
    assert time.monotonic() - started < 6
    assert statistics.seconds > 0
    assert statistics.sizes


@each
def test_contradictory_commitments(name):
    knowledge = create_knowledge_base(name, ROOMS)
    both = frozenset({Assignment("x", "1"), Assignment("x", "2")})
    assert not knowledge.could_commit([Require(both)])
    assert knowledge.could_commit([Exclude(both)])
    assert not knowledge.could_commit([Exclude(frozenset())])
    # No conflict is manifested by any one implicant, but they leave no value of y.
    assert not knowledge.could_commit([Exclude(guard({"y": value})) for value in "123"])
    assert not knowledge.could_commit([Require(guard({"only": "1"})), Exclude(guard({"only": "1"}))])
    knowledge.commit([Require(both)])
    assert not knowledge.satisfiable()
    assert knowledge.count_models() == 0


@each
@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({"z": "1"}, "a commitment mentions unknown variable 'z'; known are only, x, y"),
        ({"x": "3"}, "a commitment has x = 3, but '3' is not a value of x; known are 1, 2"),
    ],
)
def test_unknown_commitments(name, environment, message):
    knowledge = create_knowledge_base(name, ROOMS)
    with pytest.raises(InputError, match=message):
        knowledge.could_commit([Require(guard(environment))])
    with pytest.raises(InputError, match=message):
        knowledge.commit([Exclude(guard(environment))])


@each
@pytest.mark.parametrize(
    ("theory", "message"),
    [
        (Theory({"x": ()}), "variable 'x' has the values"),
        (Theory({"x": ("1", "1")}), "expected at least one, all different"),
        (Theory({"x": ("1",)}, (Is(Assignment("y", "1")),)), "a constraint mentions unknown variable 'y'"),
        (Theory({"x": ("1",)}, (), (guard({"x": "2"}),)), "a conflict has x = 2"),
    ],
)
def test_wrong_theories(name, theory, message):
    with pytest.raises(InputError, match=message):
        create_knowledge_base(name, theory)


@each
def test_formulas_may_be_deep(name):
    deep = Is(Assignment("x", "1"))
    for _ in range(3001):
        deep = Not(All((deep,)))
    knowledge = create_knowledge_base(name, Theory({"x": ("1", "2")}, (deep,)))
    assert knowledge.count_models() == 1
    assert knowledge.could_commit([Require(guard({"x": "2"}))])


@each
def test_theories_without_constraints_or_variables(name):
    assert create_knowledge_base(name, Theory({})).count_models() == 1
    assert create_knowledge_base(name, Theory({}, (Some(()),))).count_models() == 0
    assert create_knowledge_base(name, Theory({"x": ("1", "2", "3")})).count_models() == 3


def test_registry():
    assert set(NAMES) <= set(knowledge_bases())
    assert [name for name in NAMES if reasons_about_time(name)] == ["sat"]
    with pytest.raises(InputError, match="unknown knowledge base 'pitm'; did you mean 'pitms'"):
        create_knowledge_base("pitm", ROOMS)
    with pytest.raises(InputError, match="unknown knowledge base"):
        reasons_about_time("dnnf")
    with pytest.raises(InputError, match="knowledge base 'bdd' takes no network"):
        create_knowledge_base("bdd", ROOMS, network=network(""))
    with pytest.raises(SolverError, match="unknown solver 'z4'"):
        create_knowledge_base("sat", ROOMS, solver="z4")


@settings(max_examples=60)
@given(differences)
def test_models_are_the_temporally_consistent_scenarios(drawn):
    knowledge = create_knowledge_base("sat", Theory(drawn.domains), network=drawn)
    expected = [each for each in scenarios(drawn.domains) if candidate_subplan(drawn, each).consistent]
    assert [one for one in scenarios(drawn.domains) if knowledge.could_commit([Require(guard(one))])] == expected


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_choice_may_be_too_slow(solver):
    late = network(
        "a b",
        ("a", "b", None, 5),
        ("a", "b", 6, None, {"100% sure": "slow"}),
        choices=[("100% sure", ("slow", "fast"), "a")],
    )
    knowledge = SatKnowledgeBase(Theory(late.domains), late, solver=solver)
    assert not knowledge.could_commit([Require(guard({"100% sure": "slow"}))])
    assert knowledge.could_commit([Require(guard({"100% sure": "fast"}))])
    assert not knowledge.could_commit([Exclude(guard({"100% sure": "fast"}))])
    knowledge.commit([Exclude(guard({"100% sure": "slow"}))])
    assert knowledge.count_models() == 1


def test_constraints_and_time_together():
    theory = Theory({"x": ("1", "2")}, (Is(Assignment("x", "1")),))
    assert not SatKnowledgeBase(theory, network("a b", ("a", "b", 2, 1))).satisfiable()
