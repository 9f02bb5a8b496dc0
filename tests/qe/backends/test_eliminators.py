"""Formulas in negation normal form, and back ends that eliminate from random ones what z3 does with quantifiers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st

from robust.backends import ELIMINATORS
from robust.errors import InputError, UnsupportedError
from robust.qe import nnf
from robust.qe.conjunctions import Conjunction, project, project_at, variables_of
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.eliminate import create_eliminator, loos_weispfenning
from robust.qe.eliminate.interface import Definition, Query, Solvers, without
from robust.qe.eliminate.loos_weispfenning import simplified
from robust.qe.eliminate.z3_tactics import to_z3
from robust.qe.nnf import FALSE, TRUE, BoolLeaf, FormulaReader, Nnf, conjunction, disjunction, names_in, negation
from robust.qe.simplex import feasible_point
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Formula, Terms
from tests.plan.building import drawn

KEPT = ("a", "b")
REALS = ("x", "y", "z")


def context() -> Solvers:
    terms = Terms()
    return Solvers(terms, FormulaReader(terms))


@st.composite
def constraints(draw: st.DrawFn, names: tuple[str, ...] = (*KEPT, *REALS)) -> LinearConstraint:
    used = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    factors = {name: draw(st.sampled_from([1, -1, 1, -1, 2, -2, Fraction(1, 3)])) for name in used}
    sense = draw(st.sampled_from([Sense.AT_MOST, Sense.AT_MOST, Sense.LESS, Sense.EQUAL]))
    return LinearConstraint.of(factors, sense, draw(st.sampled_from([0, 1, -1, 2, 5, Fraction(-3, 2)])))


def formulas(*, booleans: bool = False) -> st.SearchStrategy[Nnf]:
    """Negation normal forms of depth three or so over kept and other symbols."""
    leaves: st.SearchStrategy[Nnf] = constraints()
    if booleans:
        leaves = st.one_of(leaves, leaves, st.builds(BoolLeaf, st.sampled_from(["p", "q"]), st.booleans()))
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.lists(inner, min_size=2, max_size=4).map(conjunction),
            st.lists(inner, min_size=2, max_size=3).map(disjunction),
        ),
        max_leaves=9,
    )


def query(formula: Nnf, network: Conjunction = ()) -> Query:
    return Query("random", KEPT, network, formula)


def wrong(asked: Query, pieces: Iterable[Conjunction], known: Iterable[Conjunction] = ()) -> str | None:
    """Where pieces, together with what was known, differ from the query, if anywhere."""
    formula = asked.formula
    booleans = nnf.booleans_in(formula)
    bound = [(z3.Bool if name in booleans else z3.Real)(name) for name in sorted(asked.eliminated)]
    body = to_z3(formula)
    expected = z3.Exists(bound, body) if bound else body
    pieces, known = list(pieces), list(known)
    assert all(set(c.parameters) <= set(KEPT) for piece in pieces for c in piece)
    union = z3.Or([to_z3(conjunction(piece)) for piece in [*pieces, *known]])
    target = z3.Or(expected, z3.Or([to_z3(conjunction(piece)) for piece in known]))
    solver = z3.SolverFor("LRA")
    solver.add(union != target)
    verdict = solver.check()
    assert verdict != z3.unknown
    return None if verdict == z3.unsat else f"{solver.model()} separates {pieces} from {formula}"


# -- back ends ---------------------------------------------------------------------------------------------------------

NEVER = Deadline()
OURS = ("project", "fourier-motzkin", "loos-weispfenning")
FORKED = tuple(name for name in ELIMINATORS if name not in OURS)


def at_most(bound: int, **factors: int) -> LinearConstraint:
    return LinearConstraint.of(factors, "<=", bound)


def eliminate(name: str, asked: Query, known: tuple[tuple[LinearConstraint, ...], ...] = ()) -> list[tuple]:
    return list(create_eliminator(name, context()).eliminate(asked, known, NEVER))


NETWORKS = st.lists(constraints(), max_size=4).map(tuple)
KNOWN = st.lists(st.lists(constraints(KEPT), min_size=1, max_size=3).map(tuple), max_size=2)
NOTHING = st.just(())


@pytest.mark.parametrize(
    ("name", "count", "network", "known"),
    [
        *((name, 60, NOTHING, NOTHING) for name in OURS),
        *((name, 40, NETWORKS, KNOWN) for name in OURS),
        *((name, 12, NOTHING, NOTHING) for name in FORKED),
        *(pytest.param(name, 1000, NETWORKS, KNOWN, marks=pytest.mark.slow) for name in OURS),
        *(pytest.param(name, 200, NOTHING, KNOWN, marks=pytest.mark.slow) for name in FORKED),
    ],
)
def test_back_ends_eliminate_exactly(name: str, count: int, network: Any, known: Any) -> None:
    """Pieces may be silent about what is known, and may not go beyond it."""

    @settings(drawn(count), derandomize=count < 100)
    @given(formulas(booleans=name in OURS), network, known)
    def run(formula: Nnf, network: Conjunction, known: list[Conjunction]) -> None:
        asked = query(formula, network)
        assert wrong(asked, eliminate(name, asked, tuple(known)), known) is None

    run()


@pytest.mark.parametrize("name", OURS)
@drawn(40)
@given(formulas(booleans=True), formulas(booleans=True))
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


def test_what_a_back_end_does_not_take_is_told() -> None:
    with pytest.raises(InputError, match=r"unknown back end 'cvc4'.*cvc5"):
        create_eliminator("cvc4", context())
    with pytest.raises(
        UnsupportedError, match=r"Boolean symbol 'p'.*back ends 'project', 'z3', 'fourier-motzkin', 'loos-weispfenning'"
    ):
        eliminate("cvc5", query(conjunction((BoolLeaf("p", True), at_most(0, a=1)))))
    with pytest.raises(UnsupportedError, match=r"'project' does not take both quantifiers at once.*back ends 'z3'"):
        create_eliminator("project", context()).eliminate_nested(query(at_most(0, a=1)), query(at_most(0, a=1)), NEVER)


@pytest.mark.parametrize("name", OURS)
def test_values_by_cases(name: str) -> None:
    """a is above the sum of four symbols, each of which is 0, b or 1 as b and a say."""
    definitions = []
    for index in range(4):
        value = {f"v{index}": 1}
        bound = LinearConstraint.of({"b": 1, "a": index + 1}, "<=", index)
        low = disjunction((*bound.negation(), LinearConstraint.of(value, "=", 0)))
        high = disjunction((bound, LinearConstraint.of({**value, "b": -1}, "=", 0), LinearConstraint.of(value, "=", 1)))
        definitions.append(Definition(f"v{index}", conjunction((low, high))))
    total = LinearConstraint.of({"a": -1, **{f"v{index}": 1 for index in range(4)}}, "<", 0)
    asked = Query("selected", KEPT, (), total, tuple(definitions))
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
    result = loos_weispfenning.eliminate(
        conjunction((disjunction(parts), *definitions)),
        [f"v{index}" for index in range(30)],
        lambda case: not asked.append(case),
        NEVER,
    )
    assert names_in(result) <= set(KEPT)
    assert sum(1 for _ in nnf.postorder(result)) < 400
    assert not asked


# -- negation normal forms ---------------------------------------------------------------------------------------------

SYMBOLS = (*KEPT, *REALS)
NUMBERS = st.sampled_from([Fraction(n, 2) for n in range(-6, 12)])
MODELS = st.fixed_dictionaries({**dict.fromkeys(SYMBOLS, NUMBERS), "p": st.booleans(), "q": st.booleans()})


def is_valid(terms: Terms, formula: Formula) -> bool:
    session = Session(terms)
    session.add(terms.negation(formula))
    return session.check("validity") is Satisfiability.UNSATISFIABLE


def holds(formula: Nnf, model: dict[str, Fraction | bool]) -> bool:
    return nnf.layout(formula).truths(model)[-1]


@given(formulas(booleans=True))
@settings(max_examples=80, deadline=None)
def test_reading_what_was_written_is_equivalent(formula: Nnf) -> None:
    terms = Terms()
    written = FormulaReader(terms).write(formula)
    again = FormulaReader(terms)
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
    chosen: dict[LinearConstraint | BoolLeaf, None] = {}
    assert nnf.implicant(formula, model, chosen) is holds(formula, model)
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


def test_constants_fold_and_known_cases_are_excluded() -> None:
    assert without(at_most(0, a=1), [()]) is FALSE
    assert without(at_most(0, a=1), []) == at_most(0, a=1)
    leaf = LinearConstraint.of({"a": 1}, "<=", 3)
    assert conjunction(()) is TRUE
    assert disjunction(()) is FALSE
    assert conjunction((leaf, FALSE)) is FALSE
    assert disjunction((leaf, TRUE)) is TRUE
    assert conjunction((leaf, leaf)) is leaf or conjunction((leaf, leaf)) == leaf
    assert disjunction((BoolLeaf("p", True), BoolLeaf("p", False))) is TRUE
    assert conjunction((leaf, LinearConstraint.of({"a": 1}, "<=", 1))) == LinearConstraint.of({"a": 1}, "<=", 1)
    assert disjunction((leaf, LinearConstraint.of({"a": 1}, "<=", 1))) == leaf


def test_sums_differences_and_multiples_are_read() -> None:
    terms = Terms()
    make, x, y, z = terms.manager, *map(terms.real, "xyz")
    two = terms.number(Fraction(2))

    def read(form: Any) -> Nnf:
        return FormulaReader(terms).read(make.LE(form, terms.number(Fraction(3))))

    assert read(make.Minus(x, make.Minus(y, z))) == LinearConstraint.of({"x": 1, "y": -1, "z": 1}, "<=", 3)
    assert read(make.Plus(x, make.Times(two, two))) == LinearConstraint.of({"x": 1}, "<=", -1)
    assert read(make.Plus(x, make.Times(two, y), two)) == LinearConstraint.of({"x": 1, "y": 2}, "<=", 1)


def test_deep_formulas_are_read() -> None:
    terms = Terms()
    symbols = [terms.manager.Symbol(f"p{i}") for i in range(2)]
    formula = symbols[0]
    for index in range(3000):
        formula = terms.manager.And(symbols[index % 2], terms.manager.Or(symbols[0], formula))
    assert names_in(FormulaReader(terms).read(formula)) == {"p0", "p1"}


def test_other_formulas_are_rejected() -> None:
    terms = Terms()
    real = terms.real("x")
    product = terms.manager.GE(terms.manager.Times(real, real), terms.number(Fraction(0)))
    with pytest.raises(UnsupportedError, match="product"):
        FormulaReader(terms).read(product)
    choice = terms.manager.Ite(terms.manager.Symbol("p"), real, terms.number(Fraction(1)))
    with pytest.raises(UnsupportedError, match="linear real term"):
        FormulaReader(terms).read(terms.manager.GE(choice, real))


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
    result = loos_weispfenning.eliminate(deep(names), ["x"], lambda _: True, Deadline())
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
