"""Negation normal forms: reading, writing, negation, implicants, projections of conjunctions."""

from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import UnsupportedError
from robust.qe.conjunctions import project, project_at, variables_of
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.loos_weispfenning import eliminate, simplified
from robust.qe.nnf import (
    FALSE,
    TRUE,
    Literal,
    Nnf,
    Reader,
    conjunction,
    disjunction,
    implicant,
    layout,
    names_in,
    negation,
)
from robust.qe.simplex import feasible_point
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms
from tests.qe.backends.formulas import KEPT, REALS, constraints, context, formulas

SYMBOLS = (*KEPT, *REALS)
NUMBERS = st.sampled_from([Fraction(n, 2) for n in range(-6, 12)])
MODELS = st.fixed_dictionaries({**dict.fromkeys(SYMBOLS, NUMBERS), "p": st.booleans(), "q": st.booleans()})


def is_valid(terms: Terms, formula: Formula) -> bool:
    session = Session(terms)
    session.add(terms.negation(formula))
    return session.check("validity") is Verdict.UNSATISFIABLE


def holds(formula: Nnf, model: dict[str, Fraction | bool]) -> bool:
    return layout(formula).truths(model)[-1]


@given(formulas(booleans=True))
@settings(max_examples=80, deadline=None)
def test_reading_what_was_written_is_equivalent(formula: Nnf) -> None:
    terms = Terms()
    written = Reader(terms).write(formula)
    again = Reader(terms)
    assert is_valid(terms, terms.equivalence(written, again.write(again.read(written))))
    assert is_valid(terms, terms.equivalence(terms.negation(written), again.write(again.read(terms.negation(written)))))


@given(formulas(booleans=True), MODELS)
@settings(deadline=None)
def test_negation_and_simplification(formula: Nnf, model: dict[str, Fraction | bool]) -> None:
    assert holds(negation(formula), model) is not holds(formula, model)
    assert holds(simplified(formula), model) is holds(formula, model)


@given(formulas(booleans=True), MODELS)
@settings(max_examples=60, deadline=None)
def test_implicants_are_true_and_imply(formula: Nnf, model: dict[str, Fraction | bool]) -> None:
    chosen: dict[LinearConstraint | Literal, None] = {}
    assert implicant(formula, model, chosen) is holds(formula, model)
    assert all(holds(leaf, model) for leaf in chosen)
    if chosen:
        made = context()
        claim = disjunction((negation(conjunction(chosen)), formula))
        assert is_valid(made.terms, made.reader.write(claim))


@given(st.lists(constraints(), min_size=1, max_size=7).map(tuple))
@settings(max_examples=150, deadline=None)
def test_projection_at_a_point_is_inside_the_exact_one(conjuncts: tuple[LinearConstraint, ...]) -> None:
    point = feasible_point(SYMBOLS, conjuncts)
    exact = project(conjuncts, REALS, Deadline())
    if point is None:
        assert exact is None
        return
    assert exact is not None
    near = project_at(conjuncts, REALS, point)
    assert set(variables_of((*near, *exact))) <= set(KEPT)
    assert all(constraint.evaluate(point) for constraint in (*near, *exact))
    made = context()
    claim = disjunction((negation(conjunction(near)), conjunction(exact)))
    assert is_valid(made.terms, made.reader.write(claim))


def test_constants_fold() -> None:
    leaf = LinearConstraint.of({"a": 1}, "<=", 3)
    assert conjunction(()) is TRUE
    assert disjunction(()) is FALSE
    assert conjunction((leaf, FALSE)) is FALSE
    assert disjunction((leaf, TRUE)) is TRUE
    assert conjunction((leaf, leaf)) is leaf or conjunction((leaf, leaf)) == leaf
    assert disjunction((Literal("p", True), Literal("p", False))) is TRUE
    assert conjunction((leaf, LinearConstraint.of({"a": 1}, "<=", 1))) == LinearConstraint.of({"a": 1}, "<=", 1)
    assert disjunction((leaf, LinearConstraint.of({"a": 1}, "<=", 1))) == leaf


def test_sums_differences_and_multiples_are_read() -> None:
    terms = Terms()
    make, x, y, z = terms.manager, *map(terms.real, "xyz")
    two = terms.number(Fraction(2))

    def read(form: Any) -> Nnf:
        return Reader(terms).read(make.LE(form, terms.number(Fraction(3))))

    assert read(make.Minus(x, make.Minus(y, z))) == LinearConstraint.of({"x": 1, "y": -1, "z": 1}, "<=", 3)
    assert read(make.Plus(x, make.Times(two, two))) == LinearConstraint.of({"x": 1}, "<=", -1)
    assert read(make.Plus(x, make.Times(two, y), two)) == LinearConstraint.of({"x": 1, "y": 2}, "<=", 1)


def test_deep_formulas_are_read() -> None:
    terms = Terms()
    symbols = [terms.manager.Symbol(f"p{i}") for i in range(2)]
    formula = symbols[0]
    for index in range(3000):
        formula = terms.manager.And(symbols[index % 2], terms.manager.Or(symbols[0], formula))
    assert names_in(Reader(terms).read(formula)) == {"p0", "p1"}


def test_other_formulas_are_rejected() -> None:
    terms = Terms()
    real = terms.real("x")
    product = terms.manager.GE(terms.manager.Times(real, real), terms.number(Fraction(0)))
    with pytest.raises(UnsupportedError, match="product"):
        Reader(terms).read(product)
    choice = terms.manager.Ite(terms.manager.Symbol("p"), real, terms.number(Fraction(1)))
    with pytest.raises(UnsupportedError, match="linear real term"):
        Reader(terms).read(terms.manager.GE(choice, real))


DEEP = 3000
"""Deeper than the interpreter's recursion limit."""


def deep(names: tuple[str, ...]) -> Nnf:
    """Conjunctions in disjunctions in conjunctions, one constraint each."""
    node: Nnf = LinearConstraint.of({"x": 1, "a": -1}, "<=", 0)
    for index in range(DEEP):
        leaf = LinearConstraint.of({names[index % len(names)]: 1, "b": index + 1}, ">=", index)
        node = (conjunction if index % 2 else disjunction)((leaf, node))
    return node


def test_deep_formulas_are_simplified() -> None:
    formula = deep(("a",))
    assert simplified(formula, (LinearConstraint.of({"a": 1, "b": DEEP}, "<", DEEP - 1),)) is FALSE
    assert names_in(simplified(formula)) == {"a", "b", "x"}


@pytest.mark.parametrize("names", [("a",), ("a",) * 99 + ("x",)])
def test_symbols_are_eliminated_from_deep_formulas(names: tuple[str, ...]) -> None:
    result = eliminate(deep(names), ["x"], lambda _: True, Deadline())
    assert "x" not in names_in(result)


def test_what_is_assumed_decides_constraints() -> None:
    def below(bound: int, sense: str = "<=") -> LinearConstraint:
        return LinearConstraint.of({"a": 1}, sense, bound)

    other = LinearConstraint.of({"b": 1}, "<=", 0)
    assert simplified(below(2), (below(1),)) is TRUE
    assert simplified(below(1, ">"), (below(1),)) is FALSE
    assert simplified(below(0), (below(1),)) == below(0)
    assert simplified(disjunction((below(1), below(0, ">")))) is TRUE
    assert simplified(conjunction((below(1), below(1, "=")))) == below(1, "=")
    assert simplified(disjunction((below(1), below(1, "=")))) == below(1)
    # Of what comes to light in the second operand the first one hears as well.
    first, second = disjunction((below(3), other)), disjunction((conjunction((below(5), below(6, ">"))), below(2)))
    assert simplified(conjunction((first, second))) == below(2)


def test_simplification_keeps_to_its_deadline() -> None:
    with pytest.raises(OutOfTimeError):
        simplified(deep(("a",)), deadline=Deadline.after(0))
