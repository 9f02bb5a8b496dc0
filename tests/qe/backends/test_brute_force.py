"""Elimination back ends against brute force, which asks no solver: a back end that is wrong fails here.

What is left after elimination is compared with the formula at points, where a case distinction decides it: truth only
changes at the lines on which constraints are equalities, so that it is enough to try where lines meet, between these
places and beyond them.
"""

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import combinations, pairwise
from random import Random

import pytest

from robust.backends import ELIMINATORS
from robust.qe import nnf
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate import create_eliminator
from robust.qe.eliminate.interface import Query, Solvers
from robust.qe.nnf import FormulaReader, Nnf, conjunction, disjunction, negation
from robust.smt.limits import NEVER
from robust.smt.terms import Terms

KEPT, BOUND = ("a", "b"), ("x", "y")
Point = Mapping[str, Fraction]


# -- brute force -----------------------------------------------------------------------------------------------------


def holds(formula: Nnf, point: Point) -> bool:
    return nnf.layout(formula).truths(dict(point))[-1]


def lines_at(formula: Nnf, point: Point) -> set[tuple[Fraction, Fraction, Fraction]]:
    """The constraints as p · x + q · y = r."""
    found = set()
    for leaf in nnf.postorder(formula):
        if isinstance(leaf, LinearConstraint):
            factors = dict(leaf.coefficients)
            known = sum((factor * point[name] for name, factor in factors.items() if name in point), Fraction(0))
            found.add((*(factors.get(name, Fraction(0)) for name in BOUND), leaf.constant - known))
    return found


def around(values: Iterable[Fraction]) -> list[Fraction]:
    """The values, one between each two neighbours, and one beyond either end."""
    known = sorted(set(values)) or [Fraction(0)]
    between = [(low + high) / 2 for low, high in pairwise(known)]
    return [known[0] - 1, *known, *between, known[-1] + 1]


def exists(formula: Nnf, point: Point) -> bool:
    """Whether some x and y satisfy the formula."""
    lines = lines_at(formula, point)
    meeting = [r / p for p, q, r in lines if p and not q]
    for (p, q, r), (s, t, u) in combinations(sorted(lines), 2):
        if determinant := p * t - q * s:
            meeting.append((r * t - q * u) / determinant)
    return any(
        holds(formula, {**point, "x": x, "y": y})
        for x in around(meeting)
        for y in around((r - p * x) / q for p, q, r in lines if q)
    )


# -- formulas --------------------------------------------------------------------------------------------------------


def drawn_constraint(random: Random) -> LinearConstraint:
    names = random.sample([*KEPT, *BOUND, *BOUND], random.randint(1, 3))
    factors = {name: random.choice([1, -1, 1, -1, 2, -2, 3]) for name in names}
    return LinearConstraint.of(factors, random.choice(["<=", "<=", "<", ">", "="]), random.randint(-3, 5))


def drawn_formula(random: Random, leaves: int) -> Nnf:
    if leaves == 1:
        return drawn_constraint(random)
    first = random.randint(1, leaves - 1)
    parts = drawn_formula(random, first), drawn_formula(random, leaves - first)
    return random.choice([conjunction, conjunction, disjunction])(parts)


def points(random: Random, pieces: Iterable[Iterable[LinearConstraint]]) -> Iterator[Point]:
    """A few anywhere, and some on the borders of pieces."""
    for _ in range(12):
        yield {name: Fraction(random.randint(-12, 12), 2) for name in KEPT}
    for constraint in (constraint for piece in pieces for constraint in piece):
        (name, factor), *others = constraint.coefficients or (("a", Fraction(1)),)
        point = {each: Fraction(random.randint(-12, 12), 2) for each in KEPT}
        rest = sum((other * point[each] for each, other in others), Fraction(0))
        yield {**point, name: (constraint.constant - rest) / factor}


# -- comparisons -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "nested"),
    [*((name, False) for name in ELIMINATORS), *((name, True) for name in ELIMINATORS if name.startswith("z3"))],
)
@pytest.mark.parametrize("count", [15, pytest.param(500, marks=pytest.mark.slow)])
def test_pieces_hold_where_brute_force_finds_values(name: str, nested: bool, count: int) -> None:
    """`∃x, y. one`, or of back ends that take it as one formula: `∃x, y. one, or no x, y with the other`."""
    random, seen = Random(count), set()  # noqa: S311 - reproducible, not secret
    for number in range(count):
        one, other = (drawn_formula(random, random.randint(1, 4)) for _ in range(2))
        one = one if nested else drawn_formula(random, random.randint(2, 6))
        eliminator = create_eliminator(name, Solvers(terms := Terms(), FormulaReader(terms)))
        first, second = Query("one", KEPT, (), one), Query("other", KEPT, (), other)
        pieces = list(
            eliminator.eliminate_nested(first, second, NEVER) if nested else eliminator.eliminate(first, (), NEVER)
        )
        union = disjunction(map(conjunction, pieces))
        for point in points(random, pieces):
            expected = exists(one, point) or (nested and not exists(other, point))
            assert holds(union, point) is expected, f"formulas {number} at {point}: {one}; {other}"
            seen.add(expected)
    assert seen == {True, False}


def test_brute_force_knows_strict_borders() -> None:
    """a < x < b, by hand; its negation has every x from b on."""
    between = conjunction(
        (LinearConstraint.of({"a": 1, "x": -1}, "<", 0), LinearConstraint.of({"x": 1, "b": -1}, "<", 0))
    )
    for a, b in ((0, 1), (0, 0), (1, 0)):
        point = {"a": Fraction(a), "b": Fraction(b)}
        assert exists(between, point) is (a < b)
        assert exists(negation(between), point)
