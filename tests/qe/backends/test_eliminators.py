"""Every back end eliminates what every other one does: random formulas against z3's decision with quantifiers."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.errors import InputError, UnsupportedError
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.interface import ELIMINATORS, Definition, Query, create_eliminator, without
from robust.qe.eliminate.loos_weispfenning import eliminate as virtual_substitution
from robust.qe.nnf import FALSE, TRUE, Literal, Nnf, conjunction, disjunction, names_in, postorder
from robust.smt.limits import Deadline
from tests.qe.backends.formulas import KEPT, constraints, context, formulas, query, wrong

NEVER = Deadline()
OURS = ("project", "fourier-motzkin", "loos-weispfenning")
FORKED = tuple(name for name in ELIMINATORS if name not in OURS)


def at_most(bound: int, **factors: int) -> LinearConstraint:
    return LinearConstraint.of(factors, "<=", bound)


def eliminate(name: str, asked: Query, known: tuple[tuple[LinearConstraint, ...], ...] = ()) -> list[tuple]:
    return list(create_eliminator(name, context()).eliminate(asked, known, NEVER))


@pytest.mark.parametrize("name", OURS)
@given(formulas(booleans=True))
@settings(max_examples=60, deadline=None)
def test_our_back_ends_eliminate_exactly(name: str, formula: Nnf) -> None:
    asked = query(formula)
    assert wrong(asked, eliminate(name, asked)) is None


@pytest.mark.parametrize("name", FORKED)
@given(formulas())
@settings(max_examples=12, deadline=None)
def test_solvers_eliminate_exactly(name: str, formula: Nnf) -> None:
    asked = query(formula)
    assert wrong(asked, eliminate(name, asked)) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", OURS)
@given(formulas(booleans=True), st.lists(st.lists(constraints(KEPT), min_size=1, max_size=3).map(tuple), max_size=2))
@settings(max_examples=1000, deadline=None)
def test_our_back_ends_exhaustively(name: str, formula: Nnf, known: list[tuple[LinearConstraint, ...]]) -> None:
    asked = query(formula)
    assert wrong(asked, eliminate(name, asked, tuple(known)), known) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", FORKED)
@given(formulas(), st.lists(st.lists(constraints(KEPT), min_size=1, max_size=3).map(tuple), max_size=2))
@settings(max_examples=200, deadline=None)
def test_solvers_exhaustively(name: str, formula: Nnf, known: list[tuple[LinearConstraint, ...]]) -> None:
    asked = query(formula)
    assert wrong(asked, eliminate(name, asked, tuple(known)), known) is None


@pytest.mark.parametrize("name", OURS)
@given(formulas(), st.lists(constraints(), max_size=4).map(tuple), st.lists(constraints(KEPT), min_size=1, max_size=3))
@settings(max_examples=40, deadline=None)
def test_network_and_what_is_known(
    name: str, formula: Nnf, network: tuple[LinearConstraint, ...], known: list[LinearConstraint]
) -> None:
    """Pieces may be silent about what is known, and may not go beyond it."""
    asked = query(formula, network)
    assert wrong(asked, eliminate(name, asked, (tuple(known),)), [tuple(known)]) is None


@pytest.mark.parametrize("name", OURS)
@given(formulas(booleans=True), formulas(booleans=True))
@settings(max_examples=40, deadline=None)
def test_definitions_are_what_they_stand_for(name: str, violation: Nnf, condition: Nnf) -> None:
    """`w` is x + 1 or y; a back end may use that it always is one of them."""
    one = LinearConstraint.of({"w": 1, "x": -1}, "=", 1)
    other = LinearConstraint.of({"w": 1, "y": -1}, "=", 0)
    guard = at_most(0, a=1, x=-1)
    definition = conjunction((disjunction((guard, one)), disjunction((*guard.negation(), other))))
    with_w = disjunction((violation, conjunction((condition, at_most(0, w=1, b=-1)))))
    asked = Query("defined", KEPT, (), with_w, (Definition("w", definition),))
    assert wrong(asked, eliminate(name, asked)) is None


@pytest.mark.parametrize("name", ELIMINATORS)
def test_constants(name: str) -> None:
    assert eliminate(name, query(FALSE)) == []
    assert eliminate(name, query(TRUE)) == [()]
    assert eliminate(name, query(at_most(0, x=1))) == [()]
    assert eliminate(name, query(at_most(0, a=1))) == [(at_most(0, a=1),)]
    assert wrong(query(at_most(0, a=1, x=-1)), eliminate(name, query(at_most(0, a=1, x=-1)))) is None


def test_unknown_back_end_is_told_with_known_ones() -> None:
    with pytest.raises(InputError, match=r"unknown back end 'cvc4'.*cvc5"):
        create_eliminator("cvc4", context())


def test_cvc5_says_who_takes_booleans() -> None:
    with pytest.raises(UnsupportedError, match=r"Boolean symbol 'p'.*back ends 'project'"):
        eliminate("cvc5", query(conjunction((Literal("p", True), at_most(0, a=1)))))


def test_without_excludes() -> None:
    assert without(at_most(0, a=1), [()]) is FALSE
    assert without(at_most(0, a=1), []) == at_most(0, a=1)


def selected(count: int) -> Query:
    """a is above the sum of `count` symbols, each of which is 0, b or 1 as b and a say."""
    definitions = []
    for index in range(count):
        value = {f"v{index}": 1}
        bound = LinearConstraint.of({"b": 1, "a": index + 1}, "<=", index)
        low = disjunction((*bound.negation(), LinearConstraint.of(value, "=", 0)))
        high = disjunction((bound, LinearConstraint.of({**value, "b": -1}, "=", 0), LinearConstraint.of(value, "=", 1)))
        definitions.append(Definition(f"v{index}", conjunction((low, high))))
    total = LinearConstraint.of({"a": -1, **{f"v{index}": 1 for index in range(count)}}, "<", 0)
    return Query("selected", KEPT, (), total, tuple(definitions))


@pytest.mark.parametrize("name", OURS)
def test_values_by_cases(name: str) -> None:
    asked = selected(4)
    assert wrong(asked, eliminate(name, asked)) is None


def test_substitution_does_not_multiply_out_independent_definitions() -> None:
    """Thirty definitions, of which each disjunct needs two: linearly many leaves, not 3^30 cases."""
    parts, definitions = [], []
    for index in range(0, 30, 2):
        names = [f"v{index}", f"v{index + 1}"]
        for name in names:
            at_zero, above = LinearConstraint.of({name: 1}, "=", 0), LinearConstraint.of({name: 1, "b": -1}, "=", index)
            guard = LinearConstraint.of({"a": 1}, "<=", index)
            definitions.append(conjunction((disjunction((guard, at_zero)), disjunction((*guard.negation(), above)))))
        parts.append(LinearConstraint.of({**dict.fromkeys(names, 1), "a": 1, "b": index}, "<", 0))
    asked = []
    result = virtual_substitution(
        conjunction((disjunction(parts), *definitions)),
        [f"v{index}" for index in range(30)],
        lambda case: not asked.append(case),
        NEVER,
    )
    assert names_in(result) <= set(KEPT)
    assert sum(1 for _ in postorder(result)) < 400
    assert not asked
