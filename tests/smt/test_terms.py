"""Formulas: constants are folded, what is built means what it says."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.encode.interface import Auxiliary, constant, variable
from robust.errors import UnsupportedError
from robust.plan.model import Relation
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Terms
from tests.plan.building import drawn

X, Y = Auxiliary("x", 1), Auxiliary("y", 2)
SMALL = st.fractions(-3, 3, max_denominator=3)


@pytest.fixture
def terms() -> Terms:
    return Terms()


@pytest.mark.parametrize("value", [Fraction(-1, 7), Fraction(0), Fraction(2)])
def test_comparisons_of_constants_are_decided(terms, value) -> None:
    expected = [value >= 0, value > 0, value == 0, value != 0]
    relations = (Relation.AT_LEAST, Relation.GREATER, Relation.EQUAL, Relation.DIFFERENT)
    assert [relation.holds(value) for relation in relations] == expected
    for expression in (constant(value), variable(X) - variable(X) + value):
        assert [terms.compare(expression, relation) for relation in relations] == list(map(terms.truth, expected))


def test_the_same_comparison_is_the_same_formula(terms) -> None:
    one = terms.greater(variable(X) - variable(Y) + 1)
    assert terms.greater(constant(1) - variable(Y) + variable(X)) is one
    assert terms.at_least(variable(X) - variable(Y) + 1) is not one


def test_constants_and_repetitions_fold(terms) -> None:
    a, b, true, false = terms.fresh_boolean("a"), terms.fresh_boolean("b"), terms.true, terms.false
    for formula, folded in (
        (terms.conjunction([]), true),
        (terms.disjunction([]), false),
        (terms.conjunction([true, a, true, a]), a),
        (terms.disjunction([a, false, a]), a),
        (terms.conjunction(iter([a, false, b])), false),
        (terms.disjunction([a, true, b]), true),
        (terms.negation(terms.negation(a)), a),
        (terms.negation(true), false),
        (terms.negation(false), true),
        (terms.implication(true, b), b),
        (terms.implication(false, b), true),
        (terms.implication(a, true), true),
        (terms.implication(a, false), terms.negation(a)),
    ):
        assert formula is folded
    assert set(terms.conjunction([a, b, a]).args()) == {a, b}


def test_fresh_truths_are_distinct_and_symbols_are_not(terms) -> None:
    assert terms.fresh_boolean("a") is not terms.fresh_boolean("a")
    assert terms.real(X) is terms.real(Auxiliary("x", 1))
    assert terms.real(X) is not terms.real(Auxiliary("x", 2))


def test_products_of_unknowns_are_refused_by_name(terms) -> None:
    with pytest.raises(UnsupportedError, match="non-linear"):
        terms.at_least(variable(X) * variable(Y))
    assert terms.at_least(constant(2) * variable(X)) is terms.at_least(variable(X).scaled(2))


def test_variables_and_size(terms) -> None:
    x, y = terms.real(X), terms.real(Y)
    formula = terms.conjunction([terms.greater(variable(X)), terms.greater(variable(X) - variable(Y))])
    assert terms.variables(formula) == {x, y}
    assert terms.variables(terms.true) == frozenset()
    assert terms.size(terms.true) == 1
    assert terms.size(terms.greater(variable(X))) == 3
    assert terms.size(formula) > terms.size(formula.arg(1))


def test_deep_formulas_do_not_hit_the_recursion_limit(terms) -> None:
    formula = terms.at_least(variable(X))
    for index in range(5000):
        other = terms.fresh_boolean("d")
        formula = terms.conjunction([formula, other]) if index % 2 else terms.disjunction([formula, other])
    assert terms.size(formula) > 10_000
    session = Session(terms)
    session.add(formula)
    assert session.check("deep") is Satisfiability.SATISFIABLE


@drawn(40)
@given(st.tuples(SMALL, SMALL, SMALL, SMALL, SMALL), st.sampled_from(Relation), st.sampled_from(["z3", "cvc5"]))
def test_a_comparison_means_what_it_says(numbers, relation, solver) -> None:
    a, b, c, x, y = numbers
    expression = variable(X).scaled(a) + variable(Y).scaled(b) + c
    terms = Terms()
    session = Session(terms, solver=solver)
    session.add(terms.equal(variable(X) - x), terms.equal(variable(Y) - y))
    session.add(terms.compare(expression, relation))
    expected = Satisfiability.SATISFIABLE if relation.holds(a * x + b * y + c) else Satisfiability.UNSATISFIABLE
    assert session.check("comparison") is expected
