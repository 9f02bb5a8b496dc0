"""Regions: unions and differences of polyhedra, their simplification, and regions as text and in other languages.

All of it rests on one question, whether a polyhedron is covered by others, which is answered by splitting it along
their sides, or by asking a solver.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, SolverError
from robust.numbers import plural
from robust.plan.model import ParameterReference
from robust.qe.box import Box, require_complete
from robust.qe.conjunctions import without_spare
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.estimate import VolumeBounds, sample, volume_bounds
from robust.qe.polyhedron import Point, Polyhedron, check_known, check_names, check_same, union_volume
from robust.smt.session import Formula, Satisfiability, Session, Terms

if TYPE_CHECKING:
    import sympy

SPLITS = 8
"""Splits after which a solver is asked: by then they have taken about as long as a query does (10 to 20 ms).

Points outside are nearly always found within a few splits; proofs that there are none may need very many.
"""

LONG = 60
"""Pieces up to which a region is made a short union."""


class OutOfWorkError(Exception):
    """The limit on the number of splits was reached."""


def outside(piece: Polyhedron, cover: Sequence[Polyhedron]) -> dict[str, Fraction] | None:
    """A point of the piece that no polyhedron of the cover contains; None if there is none."""
    try:
        return outside_by_splitting(piece, cover, limit=SPLITS)
    except OutOfWorkError:
        return outside_by_solver(piece, cover)


def outside_by_splitting(
    piece: Polyhedron, cover: Sequence[Polyhedron], *, limit: int | None = None
) -> dict[str, Fraction] | None:
    """A point of the piece outside of the cover, found by exact linear programming alone.

    Raises:
        OutOfWorkError: after `limit` splits.
    """
    if piece.is_empty:
        return None
    pending = [(piece, 0)]
    splits = 0
    while pending:
        current, position = pending.pop()
        while position < len(cover) and current.is_disjoint_from(cover[position]):
            position += 1
        if position == len(cover):
            return current.some_point()
        splits += 1
        if limit is not None and splits > limit:
            raise OutOfWorkError
        pending += [(rest, position + 1) for rest in current.minus(cover[position])]
    return None


def outside_by_solver(piece: Polyhedron, cover: Sequence[Polyhedron]) -> dict[str, Fraction] | None:
    """A point of the piece outside of the cover, found by one query to a solver and checked exactly.

    Raises:
        SolverError: if the solver gives up or its point is wrong.
    """
    terms = Terms()
    session = Session(terms)
    session.add(piece.to_formula(terms), *(terms.negation(other.to_formula(terms)) for other in cover))
    match session.check("is a polyhedron covered by others"):
        case Satisfiability.UNSATISFIABLE:
            return None
        case Satisfiability.UNKNOWN:
            raise SolverError(f"z3 could not decide whether a polyhedron is covered by {len(cover)} others")
        case Satisfiability.SATISFIABLE:
            values = session.values(terms.real(ParameterReference(name)) for name in piece.parameters)
            point = {name: Fraction(values.get(name, 0)) for name in piece.parameters}
            if point not in piece or any(point in other for other in cover):
                raise SolverError(f"z3 returned a point that does not solve its query: {point}")
            return point


def simplify_difference(base: Polyhedron, removed: Iterable[Polyhedron]) -> tuple[Polyhedron, tuple[Polyhedron, ...]]:
    """A base and polyhedra to remove that leave the same points; half-spaces to remove become sides of the base."""
    base = base.simplified()
    pieces = tuple(removed)
    while True:
        pieces = _tidy(base, pieces)
        halves = [p for p in pieces if len(p.constraints) < 2 and not any(c.is_equality for c in p.constraints)]
        if not halves:
            return _widened(base, pieces), pieces
        sides = [side for piece in halves for constraint in piece.constraints for side in constraint.negation()]
        if any(not piece.constraints for piece in halves):
            sides = [LinearConstraint.false()]
        base = base.restricted(sides).simplified()
        pieces = tuple(piece for piece in pieces if piece not in halves)


def _widened(base: Polyhedron, removed: Sequence[Polyhedron]) -> Polyhedron:
    """The base without the sides beyond which everything is removed anyway."""
    for constraint in base.constraints:
        others = [other for other in base.constraints if other != constraint]
        beyond = (Polyhedron(base.parameters, (*others, side)) for side in constraint.negation())
        if all(outside(part, removed) is None for part in beyond):
            base = Polyhedron(base.parameters, tuple(others))
    return base


def absorb(pieces: Iterable[Polyhedron]) -> list[Polyhedron]:
    """Without empty pieces and pieces inside another one."""
    kept: list[Polyhedron] = []
    for piece in pieces:
        if not piece.is_empty and not any(piece.is_subset_of(other) for other in kept):
            kept = [other for other in kept if not other.is_subset_of(piece)]
            kept.append(piece)
    return kept


def _tidy(base: Polyhedron, pieces: Iterable[Polyhedron]) -> tuple[Polyhedron, ...]:
    """Simplify the union of the pieces as far as it lies in the base; outside, the result may differ."""
    current = absorb(_relevant(base, piece) for piece in pieces)
    current = _merged(base, current)
    current = [_relaxed(base, piece, current) for piece in current]
    current = _merged(base, absorb(current))
    return tuple(_relevant(base, piece) for piece in _needed(base, current))


def _relevant(base: Polyhedron, piece: Polyhedron) -> Polyhedron:
    """A piece with only those constraints that matter inside the base; nothing if it misses the base."""
    inside = base.intersection(piece)
    if inside.is_empty:
        return Polyhedron.nothing(base.parameters)
    if not base.constraints:
        return piece.simplified()
    sides = piece.simplified().constraints
    needed = without_spare(sides, lambda side, others: base.restricted(others).satisfies(side))
    return Polyhedron(base.parameters, tuple(needed))


def _merged(base: Polyhedron, pieces: list[Polyhedron]) -> list[Polyhedron]:
    """Replace pairs by the polyhedron around them that their common sides make, where the union covers it."""
    failed: set[frozenset[Polyhedron]] = set()
    while True:
        for left, right in combinations(pieces, 2):
            pair = frozenset((left, right))
            if pair in failed:
                continue
            around = _envelope(base, left, right)
            others = [piece for piece in pieces if piece is not left and piece is not right]
            if around is not None and outside(base.intersection(around), [left, right, *others]) is None:
                pieces = absorb([_relevant(base, around), *others])
                break
            failed.add(pair)
        else:
            return pieces


def _envelope(base: Polyhedron, left: Polyhedron, right: Polyhedron) -> Polyhedron | None:
    """The polyhedron of the sides of each piece that hold in the other; None if that cannot be their union.

    If the union of two polyhedra is convex, it is this one.
    """
    if base.intersection(left).closure().is_disjoint_from(base.intersection(right).closure()):
        return None
    sides: list[LinearConstraint] = []
    for piece, other in ((left, right), (right, left)):
        inside = base.intersection(other)
        for constraint in piece.constraints:
            for half in constraint.halves():
                if inside.satisfies(half):
                    sides.append(half)
                elif half.is_strict and inside.satisfies(half.closed()):
                    sides.append(half.closed())
    return Polyhedron(base.parameters, tuple(sides))


def _relaxed(base: Polyhedron, piece: Polyhedron, pieces: Sequence[Polyhedron]) -> Polyhedron:
    """A piece without the sides beyond which the other pieces take over."""
    others = [other for other in pieces if other is not piece]
    halves = [half for constraint in piece.constraints for half in constraint.halves()]

    def is_spare(half: LinearConstraint, rest: list[LinearConstraint]) -> bool:
        return outside(base.restricted([*rest, *half.negation()]), others) is None

    return Polyhedron(base.parameters, tuple(without_spare(halves, is_spare))).simplified()


def _needed(base: Polyhedron, pieces: Sequence[Polyhedron]) -> list[Polyhedron]:
    """Without the pieces that the others cover together, those with most constraints first."""
    order = sorted(pieces, key=lambda piece: -len(piece.constraints))
    return without_spare(pieces, lambda piece, others: outside(base.intersection(piece), others) is None, order)


@dataclass(frozen=True)
class Region:
    """The union of `pieces` if `base` is None, else `base` without the union of `pieces`.

    Pieces may overlap or be empty. Objects are equal if their parts are; `equals` compares the sets of points.
    Without parameters a region is true (it has the one empty point) or false. Points and ends are exact, in the units
    of the parameters.

    Raises:
        InputError: if the base or a piece is over other parameters; likewise from each method that takes another
            region.
    """

    parameters: tuple[str, ...]
    pieces: tuple[Polyhedron, ...]
    base: Polyhedron | None = None

    def __post_init__(self) -> None:
        names = tuple(self.parameters)
        check_names(names)
        object.__setattr__(self, "parameters", names)
        object.__setattr__(self, "pieces", tuple(_over(names, piece) for piece in self.pieces))
        if self.base is not None:
            object.__setattr__(self, "base", _over(names, self.base))

    @staticmethod
    def union_of(parameters: Iterable[str], pieces: Iterable[Polyhedron]) -> Region:
        """The union of polyhedra."""
        return Region(tuple(parameters), tuple(pieces))

    @staticmethod
    def difference(base: Polyhedron, minus: Iterable[Polyhedron]) -> Region:
        """The points of `base` that are in no polyhedron of `minus`."""
        return Region(base.parameters, tuple(minus), base)

    @staticmethod
    def universe(parameters: Iterable[str]) -> Region:
        """Every point."""
        names = tuple(parameters)
        return Region(names, (Polyhedron.universe(names),))

    @staticmethod
    def nothing(parameters: Iterable[str]) -> Region:
        """No point."""
        return Region(tuple(parameters), ())

    @staticmethod
    def of_box(parameters: Iterable[str], box: Box) -> Region:
        """The points of a box; parameters that it does not name are unbounded."""
        names = tuple(parameters)
        return Region(names, (Polyhedron.of_box(names, box),))

    @property
    def form(self) -> str:
        """`union` or `difference`."""
        return "union" if self.base is None else "difference"

    def parts(self) -> list[tuple[Polyhedron, tuple[Polyhedron, ...]]]:
        """Polyhedra, each with the polyhedra to remove from it, whose union is the region."""
        if self.base is None:
            return [(piece, ()) for piece in self.pieces]
        return [(self.base, self.pieces)]

    def as_union(self, *, disjoint: bool = False) -> Region:
        """The region as a union of polyhedra; with `disjoint`, of polyhedra that have no point in common.

        Without it the pieces are as large as possible and may overlap.
        """
        if self.base is None and not disjoint:
            return self
        return Region(self.parameters, tuple(self._united(disjoint=disjoint) or ()))

    def short_union(self, most: int) -> Region | None:
        """The region as a simplified union; None if that takes more than `most` polyhedra at any moment."""
        pieces = None if len(self.pieces) > LONG else self._united(most=most)
        return None if pieces is None else Region(self.parameters, tuple(pieces)).simplified()

    def _united(self, *, disjoint: bool = False, most: int | None = None) -> list[Polyhedron] | None:
        """The polyhedra of a union; None if there are more than `most` at any moment."""
        current: list[Polyhedron] = []
        for base, removed in self.parts():
            rest = [base]
            for piece in (*removed, *(current if disjoint else ())):
                rest = [part for old in rest for part in _without(old, piece, disjoint=disjoint)]
                rest = rest if disjoint else absorb(rest)
                if most is not None and len(rest) > most:
                    return None
            current += [part for part in rest if not part.is_empty]
        return None if most is not None and len(current) > most else current

    def as_difference(self) -> Region:
        """The region as one polyhedron minus a union: everything outside is removed."""
        if self.base is not None:
            return self
        if len(self.pieces) == 1:
            return Region(self.parameters, (), self.pieces[0])
        return Region(self.parameters, self.complement().as_union().pieces, Polyhedron.universe(self.parameters))

    def __contains__(self, point: Point) -> bool:
        """
        Raises:
            InputError: if the point has no value of some parameter.
        """
        require_complete(point, self.parameters)
        return any(point in base and not any(point in piece for piece in removed) for base, removed in self.parts())

    @property
    def is_empty(self) -> bool:
        """Whether there is no point."""
        return self.some_point() is None

    @property
    def is_universal(self) -> bool:
        """Whether every point is in it."""
        return self.point_outside() is None

    def some_point(self) -> dict[str, Fraction] | None:
        """A point of the region, or None."""
        return _first(outside(base, removed) for base, removed in self.parts())

    def point_outside(self, of: Region | None = None) -> dict[str, Fraction] | None:
        """A point that is not in the region, but in `of` (default: anywhere); None if there is none."""
        within = Region.universe(self.parameters) if of is None else of
        check_same(self.parameters, within.parameters)
        for base, removed in within.parts():
            point = outside(base, (*removed, *(self.pieces if self.base is None else (self.base,))))
            if point is None and self.base is not None:
                point = _first(outside(base.intersection(piece), removed) for piece in self.pieces)
            if point is not None:
                return point
        return None

    def is_subset_of(self, other: Region) -> bool:
        """Whether every point is a point of the other region: exact, strict sides included."""
        return other.point_outside(self) is None

    def equals(self, other: Region) -> bool:
        """Whether both have the same points."""
        return self.is_subset_of(other) and other.is_subset_of(self)

    def contains_box(self, box: Box) -> bool:
        """Whether every point of the box is in the region; open, closed and infinite ends are respected."""
        return Region.of_box(self.parameters, box).is_subset_of(self)

    def complement(self) -> Region:
        """Everything else: a union becomes a difference and a difference a union."""
        if self.base is None:
            return Region(self.parameters, self.pieces, Polyhedron.universe(self.parameters))
        inside = tuple(piece for piece in map(self.base.intersection, self.pieces) if not piece.is_empty)
        return Region(self.parameters, (*self.base.complement(), *inside))

    def union(self, other: Region) -> Region:
        """The points of either, as a union."""
        check_same(self.parameters, other.parameters)
        return Region(self.parameters, (*self.as_union().pieces, *other.as_union().pieces))

    def intersection(self, other: Region) -> Region:
        """The points of both: a difference if both are, or if that needs no more polyhedra; else a union."""
        check_same(self.parameters, other.parameters)
        bases = [(left, right) for left in self.parts() for right in other.parts()]
        if len(bases) == 1 and (self.base is not None or other.base is not None):
            (first, removed), (second, also_removed) = bases[0]
            return Region(self.parameters, (*removed, *also_removed), first.intersection(second))
        met = [left.intersection(right) for left in self.as_union().pieces for right in other.as_union().pieces]
        return Region(self.parameters, tuple(piece for piece in met if not piece.is_empty))

    def minus(self, other: Region) -> Region:
        """The points of this region that are not in the other one."""
        return self.intersection(other.complement())

    def simplified(self) -> Region:
        """The region in its form, without redundant constraints and polyhedra.

        Polyhedra are absorbed by others, merged in pairs, and freed of sides beyond which others take over, so they may
        overlap.
        """
        if self.base is None:
            return Region(self.parameters, _tidy(Polyhedron.universe(self.parameters), self.pieces))
        base, removed = simplify_difference(self.base, self.pieces)
        return Region(self.parameters, removed, base)

    def slice(self, values: Point) -> Region:
        """Fix some parameters at values; the region over the rest, in the same form.

        Raises:
            InputError: if a name is not a parameter.
        """
        check_known(values, self.parameters)
        rest = tuple(name for name in self.parameters if name not in values)
        base = None if self.base is None else self.base.slice(values)
        return Region(rest, tuple(piece.slice(values) for piece in self.pieces), base)

    def project(self, names: Iterable[str]) -> Region:
        """The values of the named parameters that some values of the others complete to a point; a union.

        Raises:
            InputError: if a name is not a parameter.
        """
        kept = tuple(names)
        check_known(kept, self.parameters)
        return Region(kept, tuple(absorb(piece.project(kept) for piece in self.as_union().pieces)))

    def volume(self) -> Fraction | None:
        """The exact volume over all parameters, in the product of their units; None if infinite.

        Meant for up to 3 parameters: the time grows quickly with the dimension; see `volume_bounds`.
        """
        if self.base is None:
            return union_volume(self.pieces)
        if not self.base.is_bounded:
            return union_volume(self.as_union().pieces)
        whole, lost = self.base.volume(), union_volume([self.base.intersection(piece) for piece in self.pieces])
        return None if whole is None or lost is None else whole - lost

    def volume_bounds(self, *, boxes: int = 1000) -> VolumeBounds:
        """Certified bounds on the volume from at most this many boxes; more boxes never make them worse."""
        return volume_bounds(self.parts(), boxes)

    def sample(self, count: int, *, seed: int = 0) -> list[dict[str, Fraction]]:
        """Points of the region, not uniformly distributed, the same for the same seed; none if it is empty."""
        return sample(self.parts(), lambda: self.as_union().pieces, count, seed)

    def to_formula(self, terms: Terms) -> Formula:
        """The region over the symbols of parameter references."""
        return terms.disjunction(
            terms.conjunction((base.to_formula(terms), *(terms.negation(piece.to_formula(terms)) for piece in removed)))
            for base, removed in self.parts()
        )

    def to_sympy(self) -> sympy.Basic:
        """A Boolean expression over real sympy symbols named after the parameters."""
        import sympy  # noqa: PLC0415 - takes half a second to import

        def rational(value: Fraction | int) -> sympy.Basic:
            return sympy.Rational(value.numerator, value.denominator)

        def relational(constraint: LinearConstraint) -> sympy.Basic:
            terms = (rational(factor) * sympy.Symbol(name, real=True) for name, factor in constraint.coefficients)
            relation = {Sense.AT_MOST: sympy.Le, Sense.LESS: sympy.Lt, Sense.EQUAL: sympy.Eq}[constraint.relation]
            return relation(sum(terms, sympy.Integer(0)), rational(constraint.constant))

        def junction(piece: Polyhedron) -> sympy.Basic:
            return sympy.And(*map(relational, piece.constraints))

        return sympy.Or(
            *(sympy.And(junction(base), *(sympy.Not(junction(p)) for p in removed)) for base, removed in self.parts())
        )

    def to_latex(self) -> str:
        r"""A formula for LaTeX's mathematical mode; `\bot` and `\top` for nothing and everything."""
        texts = []
        for base, removed in self.parts():
            outside = [rf"\neg \left({_latex_conjunction(piece)}\right)" for piece in removed]
            shown = [] if removed and not base.constraints else [_latex_conjunction(base)]
            texts.append(r" \land ".join([*shown, *outside]))
        if len(texts) > 1:
            texts = [rf"\left({text}\right)" for text in texts]
        return r" \lor ".join(texts) or r"\bot"

    def to_smtlib(self, name: str = "region") -> str:
        """A `define-fun` of a predicate over the parameters, in SMT-LIB 2.6."""
        arguments = " ".join(f"({_symbol(parameter)} Real)" for parameter in self.parameters)
        texts = []
        for base, removed in self.parts():
            literals = [*map(_smt, base.constraints), *(f"(not {_smt_conjunction(piece)})" for piece in removed)]
            texts.append(_junction("and", literals, "true"))
        return f"(define-fun {_symbol(name)} ({arguments}) Bool\n  {_junction('or', texts, 'false')})\n"

    def as_dict(self) -> dict[str, Any]:
        """The region's part of a `robust/region/1` document, which may be extended by other keys."""
        document: dict[str, Any] = {"schema": SCHEMA, "parameters": list(self.parameters), "form": self.form}
        pieces = [{"constraints": _written(piece)} for piece in self.pieces]
        if self.base is None:
            return {**document, "polyhedra": pieces}
        return {**document, "base": _written(self.base), "minus": pieces}

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> Region:
        """Read what `as_dict` writes; other keys are left alone.

        Raises:
            InputError: if a key is missing or of the wrong kind, or the schema or form is unknown.
        """
        if not isinstance(document, Mapping):
            raise InputError(f"cannot read a region from {document!r}: expected a JSON object")
        if document.get("schema", SCHEMA) != SCHEMA:
            raise InputError(f"cannot read a region of schema {document['schema']!r}; expected {SCHEMA!r}")
        parameters = tuple(str(name) for name in _list(document, "parameters"))
        form = document.get("form", "union")
        if form not in {"union", "difference"}:
            raise InputError(f"cannot read a region of form {form!r}; expected 'union' or 'difference'")

        def polyhedron(document: Any, key: str) -> Polyhedron:
            return Polyhedron(parameters, tuple(map(LinearConstraint.from_dict, _list(document, key))))

        base = polyhedron(document, "base") if form == "difference" else None
        listed = _list(document, "polyhedra" if base is None else "minus")
        return Region(parameters, tuple(polyhedron(piece, "constraints") for piece in listed), base)

    def __repr__(self) -> str:
        size = f"{plural(len(self.parameters), 'parameter')}, {self.form}, {plural(len(self.pieces), 'piece')}"
        return f"<Region: {size}; print() shows it>"

    def __str__(self) -> str:
        """One line for each polyhedron."""
        lines: list[str] = []
        for base, removed in self.parts():
            lines.append(f"{'∪ ' if lines else ''}{{ {base} }}")
            lines += [f"∖ {{ {piece} }}" for piece in removed]
        return "\n".join(lines) or "∅"


def _first(points: Iterable[dict[str, Fraction] | None]) -> dict[str, Fraction] | None:
    """The first point that there is."""
    return next((point for point in points if point is not None), None)


def _over(parameters: tuple[str, ...], polyhedron: Polyhedron) -> Polyhedron:
    """The polyhedron with the parameters in this order."""
    check_same(parameters, polyhedron.parameters)
    return polyhedron if polyhedron.parameters == parameters else Polyhedron(parameters, polyhedron.constraints)


def _without(piece: Polyhedron, removed: Polyhedron, *, disjoint: bool) -> Sequence[Polyhedron]:
    if disjoint:
        return piece.minus(removed)
    if piece.is_disjoint_from(removed):
        return [piece]
    beyond = [piece.restricted([side]) for c in removed.simplified().constraints for side in c.negation()]
    return [part for part in beyond if not part.is_empty]


_LATEX = {"≤": r"\le", "≥": r"\ge", "<": "<", ">": ">", "=": "="}
_SIMPLE_SYMBOL = r"[A-Za-z~!@$%^&*_+=<>.?/-][A-Za-z0-9~!@$%^&*_+=<>.?/-]*"


def _latex_conjunction(piece: Polyhedron) -> str:
    return r" \land ".join(_latex(constraint) for constraint in piece.constraints) or r"\top"


def _latex(constraint: LinearConstraint) -> str:
    if not constraint.coefficients:
        return r"\top" if constraint.is_true else r"\bot"
    left, relation, right = constraint.oriented()
    text = signed_sum([(_latex_name(name), factor) for name, factor in left], "-", str)
    number = (
        str(right)
        if right.denominator == 1
        else rf"{'-' if right < 0 else ''}\frac{{{abs(right.numerator)}}}"
        rf"{{{right.denominator}}}"
    )
    return f"{text} {_LATEX[relation]} {number}"


def signed_sum(terms: Iterable[tuple[str, Fraction]], minus: str, number: Callable[[Fraction], str]) -> str:
    """`2 a - b`, with that sign for minus; factors of 1 are left out."""
    text = ""
    for name, factor in terms:
        sign = (minus if factor < 0 else "") if not text else (f" {minus} " if factor < 0 else " + ")
        text += sign + ("" if abs(factor) == 1 else f"{number(abs(factor))} ") + name
    return text


def _latex_name(name: str) -> str:
    if len(name) == 1 and name.isalpha():
        return name
    escaped = re.sub(r"([#$%&_{}])", r"\\\1", name.replace("\\", r"\backslash "))
    return rf"\mathit{{{escaped}}}"


def _smt_conjunction(piece: Polyhedron) -> str:
    return _junction("and", [*map(_smt, piece.constraints)], "true")


def _junction(operator: str, operands: list[str], neutral: str) -> str:
    if len(operands) < 2:
        return operands[0] if operands else neutral
    return f"({operator} {' '.join(operands)})"


def _smt(constraint: LinearConstraint) -> str:
    if not constraint.coefficients:
        return "true" if constraint.is_true else "false"
    terms = [
        _symbol(name) if factor == 1 else f"(* {_number(factor)} {_symbol(name)})"
        for name, factor in constraint.coefficients
    ]
    return f"({constraint.relation.value} {_junction('+', terms, '0.0')} {_number(constraint.constant)})"


def _number(value: Fraction | int) -> str:
    size = f"{abs(value.numerator)}.0" if value.denominator == 1 else f"(/ {abs(value.numerator)} {value.denominator})"
    return f"(- {size})" if value < 0 else size


def _symbol(name: str) -> str:
    return name if re.fullmatch(_SIMPLE_SYMBOL, name) else f"|{name}|"


SCHEMA = "robust/region/1"


def _written(polyhedron: Polyhedron) -> list[dict[str, Any]]:
    return [constraint.as_dict() for constraint in polyhedron.constraints]


def _list(document: Any, key: str) -> list[Any]:
    value = document.get(key) if isinstance(document, Mapping) else None
    if not isinstance(value, list):
        raise InputError(f"cannot read a region: expected a list under {key!r}, found {value!r}")
    return value
