"""Formulas in negation normal form, and back ends that eliminate from random ones what z3 does with quantifiers."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import combinations, pairwise, product
from random import Random
from typing import Any

import pytest
import z3
from hypothesis import given, settings
from hypothesis import strategies as st
from pysmt import shortcuts
from pysmt.typing import REAL, FunctionType

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
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session, Terms
from tests.plan.building import drawn

KEPT, REALS = ("a", "b"), ("x", "y", "z")
SYMBOLS = (*KEPT, *REALS)
OURS = ("project", "fourier-motzkin", "loos-weispfenning")
FORKED = tuple(name for name in ELIMINATORS if name not in OURS)


def solvers() -> Solvers:
    terms = Terms()
    return Solvers(terms, FormulaReader(terms))


def side(sense: str | Sense, bound: int | Fraction, **factors: int | Fraction) -> LinearConstraint:
    return LinearConstraint.of(factors, sense, bound)


@st.composite
def constraints(draw: st.DrawFn, names: tuple[str, ...] = SYMBOLS) -> LinearConstraint:
    used = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    factors = {name: draw(st.sampled_from([1, -1, 1, -1, 2, -2, Fraction(1, 3)])) for name in used}
    sense = draw(st.sampled_from([Sense.AT_MOST, Sense.AT_MOST, Sense.LESS, Sense.EQUAL]))
    return side(sense, draw(st.sampled_from([0, 1, -1, 2, 5, Fraction(-3, 2)])), **factors)


def formulas(*, booleans: bool = True) -> st.SearchStrategy[Nnf]:
    """Negation normal forms of depth three or so over kept and other symbols."""
    leaves: st.SearchStrategy[Nnf] = constraints()
    if booleans:
        leaves = st.one_of(leaves, leaves, st.builds(BoolLeaf, st.sampled_from(["p", "q"]), st.booleans()))

    def joined(inner: st.SearchStrategy[Nnf]) -> st.SearchStrategy[Nnf]:
        operands = st.lists(inner, min_size=2, max_size=3)
        return st.one_of(st.lists(inner, min_size=2, max_size=4).map(conjunction), operands.map(disjunction))

    return st.recursive(leaves, joined, max_leaves=9)


def query(formula: Nnf, network: Conjunction = (), *definitions: Definition) -> Query:
    return Query("random", KEPT, network, formula, definitions)


def eliminate(name: str, asked: Query, known: tuple[Conjunction, ...] = ()) -> list[Conjunction]:
    return list(create_eliminator(name, solvers()).eliminate(asked, known, NEVER))


def assert_exact(name: str, asked: Query, known: tuple[Conjunction, ...] = ()) -> None:
    """Pieces may be silent about what is known, and may not go beyond it: z3, with quantifiers, finds no difference."""
    pieces = eliminate(name, asked, known)
    booleans = nnf.booleans_in(asked.formula)
    bound = [(z3.Bool if symbol in booleans else z3.Real)(symbol) for symbol in sorted(asked.eliminated)]
    body = to_z3(asked.formula)
    expected = z3.Exists(bound, body) if bound else body
    assert all(set(c.parameters) <= set(KEPT) for piece in pieces for c in piece)
    covered = [to_z3(conjunction(piece)) for piece in known]
    solver = z3.SolverFor("LRA")
    solver.add(z3.Or([*(to_z3(conjunction(piece)) for piece in pieces), *covered]) != z3.Or(expected, *covered))
    assert solver.check() == z3.unsat, f"{pieces} {asked.formula}"


NETWORKS = st.lists(constraints(), max_size=4).map(tuple)
KNOWN = st.lists(st.lists(constraints(KEPT), min_size=1, max_size=3).map(tuple), max_size=2)
NOTHING = st.just(())


@pytest.mark.parametrize(
    ("name", "count", "network", "known"),
    [
        *((name, 15, *rest) for name in OURS for rest in ((NOTHING, NOTHING), (NETWORKS, KNOWN))),
        *((name, 8, NOTHING, NOTHING) for name in FORKED),
        *(pytest.param(name, 1000, NETWORKS, KNOWN, marks=pytest.mark.slow) for name in OURS),
        *(pytest.param(name, 200, NOTHING, KNOWN, marks=pytest.mark.slow) for name in FORKED),
    ],
)
def test_back_ends_eliminate_exactly(name: str, count: int, network: Any, known: Any) -> None:
    @settings(drawn(count), derandomize=count < 100)
    @given(formulas(booleans=name in OURS), network, known)
    def run(formula: Nnf, network: Conjunction, known: list[Conjunction]) -> None:
        assert_exact(name, query(formula, network), tuple(known))

    run()


@pytest.mark.parametrize("name", OURS)
@drawn(12, 20)
@given(formulas(), formulas())
def test_definitions_are_what_they_stand_for(name: str, violation: Nnf, condition: Nnf) -> None:
    """`w` is x + 1 or y; a back end may use that it always is one of them."""
    guard = side("<=", 0, a=1, x=-1)
    first, second = disjunction((guard, side("=", 1, w=1, x=-1))), side("=", 0, w=1, y=-1)
    definition = Definition("w", conjunction((first, disjunction((*guard.negation(), second)))))
    guarded = conjunction((condition, side("<=", 0, w=1, b=-1)))
    assert_exact(name, query(disjunction((violation, guarded)), (), definition))


def test_what_is_no_linear_arithmetic_is_named() -> None:
    applied = shortcuts.Function(shortcuts.Symbol("f", FunctionType(REAL, [REAL])), [shortcuts.Symbol("x", REAL)])
    with pytest.raises(UnsupportedError, match=r"found f\(x\), expected a formula of linear real arithmetic"):
        solvers().reader.read(shortcuts.Equals(applied, applied))


@pytest.mark.parametrize("name", ELIMINATORS)
def test_constants_and_values_by_cases(name: str) -> None:
    """a is above the sum of four symbols, each of which is 0, b or 1 as b and a say."""
    assert eliminate(name, query(FALSE)) == []
    assert eliminate(name, query(TRUE)) == [()]
    assert eliminate(name, query(side("<=", 0, x=1))) == [()]
    assert eliminate(name, query(side("<=", 0, a=1))) == [(side("<=", 0, a=1),)]
    assert_exact(name, query(side("<=", 0, a=1, x=-1)))
    if name not in OURS:
        return
    definitions, symbols = [], [f"v{index}" for index in range(4)]
    for index, symbol in enumerate(symbols):
        bound = side("<=", index, b=1, a=index + 1)
        low = disjunction((*bound.negation(), side("=", 0, **{symbol: 1})))
        high = disjunction((bound, side("=", 0, **{symbol: 1, "b": -1}), side("=", 1, **{symbol: 1})))
        definitions.append(Definition(symbol, conjunction((low, high))))
    assert_exact(name, query(side("<", 0, a=-1, **dict.fromkeys(symbols, 1)), (), *definitions))


def test_what_a_back_end_does_not_take_is_told() -> None:
    leaf = query(side("<=", 0, a=1))
    with pytest.raises(InputError, match=r"unknown back end 'cvc4'.*cvc5"):
        create_eliminator("cvc4", solvers())
    able = r"Boolean symbol 'p'.*back ends 'project', 'z3', 'fourier-motzkin', 'loos-weispfenning'"
    with pytest.raises(UnsupportedError, match=able):
        eliminate("cvc5", query(conjunction((BoolLeaf("p", True), leaf.formula))))
    with pytest.raises(UnsupportedError, match=r"'project' does not take both quantifiers at once.*back ends 'z3'"):
        create_eliminator("project", solvers()).eliminate_nested(leaf, leaf, NEVER)


def test_substitution_does_not_multiply_out_independent_definitions() -> None:
    """Thirty definitions, of which each disjunct needs two: linearly many leaves, not 3^30 cases."""
    parts, definitions, asked = [], [], []
    for index in range(0, 30, 2):
        names = [f"v{index}", f"v{index + 1}"]
        guard = side("<=", index, a=1)
        for name in names:
            zero, above = side("=", 0, **{name: 1}), side("=", index, **{name: 1, "b": -1})
            definitions.append(conjunction((disjunction((guard, zero)), disjunction((*guard.negation(), above)))))
        parts.append(side("<", 0, a=1, b=index, **dict.fromkeys(names, 1)))
    formula, symbols = conjunction((disjunction(parts), *definitions)), [f"v{index}" for index in range(30)]
    result = loos_weispfenning.eliminate(formula, symbols, lambda case: not asked.append(case), NEVER)
    assert names_in(result) <= set(KEPT)
    assert sum(1 for _ in nnf.postorder(result)) < 400
    assert not asked


NUMBERS = st.sampled_from([Fraction(n, 2) for n in range(-6, 12)])
MODELS = st.fixed_dictionaries({**dict.fromkeys(SYMBOLS, NUMBERS), "p": st.booleans(), "q": st.booleans()})


def assert_valid(context: Solvers, formula: Any) -> None:
    session = Session(context.terms)
    session.add(context.terms.negation(formula))
    assert session.check("validity") is Satisfiability.UNSATISFIABLE


def holds(formula: Nnf, model: dict[str, Fraction | bool]) -> bool:
    return nnf.layout(formula).truths(model)[-1]


@drawn(40, 60)
@given(formulas(), MODELS)
def test_formulas_are_read_negated_simplified_and_implied(formula: Nnf, model: dict[str, Fraction | bool]) -> None:
    truth = holds(formula, model)
    assert holds(negation(formula), model) is not truth
    assert holds(simplified(formula), model) is truth
    context = solvers()
    written, again = context.reader.write(formula), FormulaReader(context.terms)
    for same in (written, context.terms.negation(written)):
        assert_valid(context, context.terms.equivalence(same, again.write(again.read(same))))
    chosen: dict[LinearConstraint | BoolLeaf, None] = {}
    assert nnf.implicant(formula, model, chosen) is truth
    assert all(holds(leaf, model) for leaf in chosen)
    if chosen:
        assert_valid(context, context.reader.write(disjunction((negation(conjunction(chosen)), formula))))


@drawn(40, 80)
@given(st.lists(constraints(), min_size=1, max_size=7).map(tuple))
def test_projection_at_a_point_is_inside_the_exact_one(conjuncts: tuple[LinearConstraint, ...]) -> None:
    point = feasible_point(SYMBOLS, conjuncts)
    exact = project(conjuncts, REALS, NEVER)
    assert (exact is None) == (point is None)
    if point is not None and exact is not None:
        near = project_at(conjuncts, REALS, point)
        assert set(variables_of((*near, *exact))) <= set(KEPT)
        assert all(constraint.evaluate(point) for constraint in (*near, *exact))
        context = solvers()
        assert_valid(context, context.reader.write(disjunction((negation(conjunction(near)), conjunction(exact)))))


def below(bound: int, sense: str = "<=") -> LinearConstraint:
    return side(sense, bound, a=1)


def test_constants_fold_and_known_cases_are_excluded() -> None:
    leaf, tighter = below(3), below(1)
    assert without(leaf, [()]) is FALSE
    assert without(leaf, []) == leaf
    assert conjunction(()) is TRUE
    assert disjunction(()) is FALSE
    assert conjunction((leaf, FALSE)) is FALSE
    assert disjunction((leaf, TRUE)) is TRUE
    assert conjunction((leaf, leaf)) == disjunction((leaf, tighter)) == leaf
    assert conjunction((leaf, tighter)) == tighter
    assert disjunction((BoolLeaf("p", True), BoolLeaf("p", False))) is TRUE
    # What is assumed decides constraints.
    assert simplified(below(2), (below(1),)) is TRUE
    assert simplified(below(1, ">"), (below(1),)) is FALSE
    assert simplified(below(0), (below(1),)) == below(0)
    assert simplified(disjunction((below(1), below(0, ">")))) is TRUE
    assert simplified(conjunction((below(1), below(1, "=")))) == below(1, "=")
    assert simplified(disjunction((below(1), below(1, "=")))) == below(1)
    # Of what comes to light in the second operand the first one hears as well.
    first = disjunction((below(3), side("<=", 0, b=1)))
    second = disjunction((conjunction((below(5), below(6, ">"))), below(2)))
    assert simplified(conjunction((first, second))) == below(2)


def test_formulas_of_others_are_read_or_rejected() -> None:
    terms = Terms()
    make, x, y, z = terms.manager, *map(terms.real, "xyz")
    two, p = terms.number(Fraction(2)), make.Symbol("p")

    def read(form: Any) -> Nnf:
        return FormulaReader(terms).read(make.LE(form, terms.number(Fraction(3))))

    assert read(make.Minus(x, make.Minus(y, z))) == side("<=", 3, x=1, y=-1, z=1)
    assert read(make.Plus(x, make.Times(two, two))) == side("<=", -1, x=1)
    assert read(make.Plus(x, make.Times(two, y), two)) == side("<=", 1, x=1, y=2)
    with pytest.raises(UnsupportedError, match="product"):
        read(make.Times(x, x))
    with pytest.raises(UnsupportedError, match="linear real term"):
        read(make.Ite(p, x, two))
    formula = p
    for index in range(3000):
        formula = make.And(p if index % 2 else make.Symbol("q"), make.Or(p, formula))
    assert names_in(FormulaReader(terms).read(formula)) == {"p", "q"}


DEEP = 3000


def deep(names: tuple[str, ...]) -> Nnf:
    """Conjunctions in disjunctions in conjunctions, one constraint each, deeper than the recursion limit."""
    node: Nnf = side("<=", 0, x=1, a=-1)
    for index in range(DEEP):
        leaf = side(">=", index, **{names[index % len(names)]: 1, "b": index + 1})
        node = (conjunction if index % 2 else disjunction)((leaf, node))
    return node


def test_deep_formulas_are_simplified_and_eliminated() -> None:
    formula = deep(("a",))
    assert simplified(formula, (side("<", DEEP - 1, a=1, b=DEEP),)) is FALSE
    assert names_in(simplified(formula)) == {"a", "b", "x"}
    with pytest.raises(OutOfTimeError):
        simplified(formula, deadline=Deadline.after(0))
    for names in (("a",), ("a",) * 99 + ("x",)):
        assert "x" not in names_in(loos_weispfenning.eliminate(deep(names), ["x"], lambda _: True, NEVER))


Point = dict[str, Fraction]


def around(values: Iterable[Fraction]) -> list[Fraction]:
    """The values, one between each two neighbours, and one beyond either end."""
    known = sorted(set(values)) or [Fraction(0)]
    between = [(low + high) / 2 for low, high in pairwise(known)]
    return [known[0] - 1, *known, *between, known[-1] + 1]


def exists(formula: Nnf, point: Point) -> bool:
    """Whether some x and y satisfy the formula, by brute force, which asks no solver.

    Truth only changes at lines p · x + q · y = r: it is enough to try where they meet, between and beyond.
    """
    lines = set()
    for leaf in nnf.postorder(formula):
        if isinstance(leaf, LinearConstraint):
            factors = dict.fromkeys("abxy", Fraction(0)) | dict(leaf.coefficients)
            known = sum(factors[name] * value for name, value in point.items())
            lines.add((factors["x"], factors["y"], leaf.constant - known))
    meeting = [r / p for p, q, r in lines if p and not q]
    for (p, q, r), (s, t, u) in combinations(sorted(lines), 2):
        if determinant := p * t - q * s:
            meeting.append((r * t - q * u) / determinant)
    return any(
        holds(formula, {**point, "x": x, "y": y})
        for x in around(meeting)
        for y in around((r - p * x) / q for p, q, r in lines if q)
    )


def drawn_formula(random: Random, leaves: int) -> Nnf:
    if leaves == 1:
        names = random.sample("abxyxy", random.randint(1, 3))
        factors = {name: random.choice([1, -1, 1, -1, 2, -2, 3]) for name in names}
        return side(random.choice(["<=", "<=", "<", ">", "="]), random.randint(-3, 5), **factors)
    first = random.randint(1, leaves - 1)
    parts = drawn_formula(random, first), drawn_formula(random, leaves - first)
    return random.choice([conjunction, conjunction, disjunction])(parts)


def points(random: Random, pieces: Iterable[Iterable[LinearConstraint]]) -> Iterator[Point]:
    """A few anywhere, and some on the borders of pieces."""
    borders = [constraint for piece in pieces for constraint in piece]
    for border in (*[None] * 12, *borders):
        point = {name: Fraction(random.randint(-12, 12), 2) for name in KEPT}
        if border is not None:
            (name, factor), *others = border.coefficients or (("a", Fraction(1)),)
            point[name] = (border.constant - sum(other * point[each] for each, other in others)) / factor
        yield point


NESTED = [name for name in ELIMINATORS if name.startswith("z3")]


@pytest.mark.parametrize(("name", "nested"), [*product(ELIMINATORS, [False]), *product(NESTED, [True])])
@pytest.mark.parametrize("count", [9, pytest.param(500, marks=pytest.mark.slow)])
def test_pieces_hold_where_brute_force_finds_values(name: str, nested: bool, count: int) -> None:
    """`∃x, y. one`, or of back ends that take it as one formula: `∃x, y. one, or no x, y with the other`."""
    random, seen = Random(count), set()  # noqa: S311 - reproducible, not secret
    for number in range(count):
        one, other = (drawn_formula(random, random.randint(1, 4)) for _ in range(2))
        one = one if nested else drawn_formula(random, random.randint(2, 6))
        nesting = create_eliminator(name, solvers()).eliminate_nested
        pieces = list(nesting(query(one), query(other), NEVER)) if nested else eliminate(name, query(one))
        union = disjunction(map(conjunction, pieces))
        for point in points(random, pieces):
            expected = exists(one, point) or (nested and not exists(other, point))
            assert holds(union, point) is expected, f"formulas {number} at {point}: {one}; {other}"
            seen.add(expected)
    assert seen == {True, False}
    # Brute force knows strict borders, a < x < b, by hand; its negation has every x from b on.
    between = conjunction((side("<", 0, a=1, x=-1), side("<", 0, x=1, b=-1)))
    for a, b in ((0, 1), (0, 0), (1, 0)):
        point = {"a": Fraction(a), "b": Fraction(b)}
        assert exists(between, point) is (a < b)
        assert exists(negation(between), point)
