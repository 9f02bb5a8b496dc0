"""Random small polyhedra and regions, and their translation to z3 that shares no code with the package."""

from collections.abc import Iterable
from fractions import Fraction
from functools import partial
from itertools import product

import z3
from hypothesis import strategies as st

from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region

NAMES = ("x", "y", "z")
SYMBOLS = {name: z3.Real(name) for name in NAMES}


def constraint(relation: str, constant: object, **coefficients: object) -> LinearConstraint:
    """`Σ coefficient · parameter` compared with the constant."""
    exact = {name: Fraction(str(value)) for name, value in coefficients.items()}
    return LinearConstraint.of(exact, relation, Fraction(str(constant)))


le, lt, eq = (partial(constraint, relation) for relation in ("<=", "<", "="))


def polygon(*constraints: LinearConstraint) -> Polyhedron:
    return Polyhedron(("x", "y"), constraints)


def rectangle(left: object, right: object, bottom: object, top: object) -> Polyhedron:
    """A closed rectangle."""
    sides = {"x": (left, right), "y": (bottom, top)}
    return polygon(
        *(le(high, **{name: 1}) for name, (_, high) in sides.items()),
        *(le(-Fraction(str(low)), **{name: -1}) for name, (low, _) in sides.items()),
    )


def cube(size: int, names: Iterable[str] = NAMES) -> Polyhedron:
    """`[0, size]` along each parameter."""
    names = tuple(names)
    return Polyhedron(names, tuple(c for n in names for c in (le(size, **{n: 1}), le(0, **{n: -1}))))


@st.composite
def constraints(draw: st.DrawFn, names: tuple[str, ...]) -> LinearConstraint:
    factors = {name: draw(st.integers(-3, 3)) for name in names}
    return constraint(draw(st.sampled_from(["<=", "<=", "<", "<", "="])), draw(st.integers(-4, 6)), **factors)


@st.composite
def polyhedra(draw: st.DrawFn, names: tuple[str, ...], sides: int = 6) -> Polyhedron:
    return Polyhedron(names, tuple(draw(st.lists(constraints(names), max_size=sides))))


@st.composite
def regions(draw: st.DrawFn, names: tuple[str, ...], pieces: int = 3, sides: int = 4) -> Region:
    """Unions and differences."""
    parts = draw(st.lists(polyhedra(names, sides), max_size=pieces))
    if draw(st.booleans()):
        return Region.union_of(names, parts)
    return Region.difference(draw(polyhedra(names, sides)), parts)


spaces = st.integers(1, 3).map(lambda count: NAMES[:count])


def grid(names: tuple[str, ...], step: Fraction = Fraction(1, 2), reach: int = 3) -> list[dict[str, Fraction]]:
    values = [step * i for i in range(-reach, reach + 1)]
    return [dict(zip(names, point, strict=True)) for point in product(values, repeat=len(names))]


def number(value: Fraction) -> z3.ArithRef:
    return z3.Q(value.numerator, value.denominator)


def as_z3(polyhedron: Polyhedron) -> z3.BoolRef:
    literals = []
    for c in polyhedron.constraints:
        form = z3.Sum([z3.RealVal(0), *(number(factor) * z3.Real(name) for name, factor in c.coefficients)])
        right = number(c.constant)
        literals.append({"<=": form <= right, "<": form < right, "=": form == right}[c.relation.value])
    return z3.And(*literals, z3.BoolVal(True))


def region_z3(region: Region) -> z3.BoolRef:
    if region.base is None:
        return z3.Or(*map(as_z3, region.pieces), z3.BoolVal(False))
    return z3.And(as_z3(region.base), *(z3.Not(as_z3(piece)) for piece in region.pieces))


def is_valid(formula: z3.BoolRef) -> bool:
    solver = z3.Solver()
    solver.add(z3.Not(formula))
    verdict = solver.check()
    assert verdict != z3.unknown
    return verdict == z3.unsat


def same(left: z3.BoolRef, right: z3.BoolRef) -> bool:
    return is_valid(left == right)
