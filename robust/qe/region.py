"""Regions of parameter space: finite unions of polyhedra, or a polyhedron without such a union."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.qe import render
from robust.qe.bounds import VolumeBounds, volume_bounds
from robust.qe.constraint import LinearConstraint
from robust.qe.cover import outside
from robust.qe.document import read_region, write_region
from robust.qe.polyhedron import BoxLike, Point, Polyhedron, check_known, check_names, check_same
from robust.qe.sampling import sample
from robust.qe.simplify import absorb, simplify_difference, simplify_union
from robust.qe.volume import union_volume
from robust.smt.terms import Formula, Terms

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class Region:
    """The union of `pieces` if `base` is None, else `base` without the union of `pieces`.

    Pieces may overlap or be empty. Objects are equal if their parts are; `equals` compares the sets of points.
    Without parameters a region is true (it has the one empty point) or false.

    Raises:
        InputError: if the base or a piece is over other parameters.
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
    def of_box(parameters: Iterable[str], box: BoxLike) -> Region:
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
        """The same points as a union; with `disjoint`, of polyhedra that have no point in common.

        Without it the pieces are as large as possible and may overlap.
        """
        if self.base is None and not disjoint:
            return self
        current: list[Polyhedron] = []
        for base, removed in self.parts():
            rest = [base]
            for piece in (*removed, *(current if disjoint else ())):
                rest = [part for old in rest for part in _without(old, piece, disjoint=disjoint)]
                rest = rest if disjoint else absorb(rest)
            current += [part for part in rest if not part.is_empty]
        return Region(self.parameters, tuple(current))

    def as_difference(self) -> Region:
        """The same points as one polyhedron without a union: everything outside is removed."""
        if self.base is not None:
            return self
        if len(self.pieces) == 1:
            return Region(self.parameters, (), self.pieces[0])
        return Region(self.parameters, self.complement().as_union().pieces, Polyhedron.universe(self.parameters))

    def __contains__(self, point: Point) -> bool:
        return any(point in base and not any(point in piece for piece in removed) for base, removed in self.parts())

    @property
    def is_empty(self) -> bool:
        return self.some_point() is None

    @property
    def is_universal(self) -> bool:
        return self.point_outside() is None

    def some_point(self) -> dict[str, Fraction] | None:
        """A point of the region, or None."""
        found = (outside(base, removed) for base, removed in self.parts())
        return next((point for point in found if point is not None), None)

    def point_outside(self, of: Region | None = None) -> dict[str, Fraction] | None:
        """A point that is not in the region, but in `of` (default: anywhere); None if there is none."""
        within = Region.universe(self.parameters) if of is None else of
        check_same(self.parameters, within.parameters)
        for base, removed in within.parts():
            if self.base is None:
                found = outside(base, (*removed, *self.pieces))
            else:
                found = outside(base, (*removed, self.base))
                for piece in self.pieces:
                    if found is None:
                        found = outside(base.intersection(piece), removed)
            if found is not None:
                return found
        return None

    def is_subset_of(self, other: Region) -> bool:
        """Whether every point is a point of the other region: exact, strict sides included."""
        return other.point_outside(self) is None

    def equals(self, other: Region) -> bool:
        """Whether both have the same points."""
        return self.is_subset_of(other) and other.is_subset_of(self)

    def contains_box(self, box: BoxLike) -> bool:
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
        """The same points in the same form with no constraint or polyhedron that could be left out.

        Polyhedra are absorbed by others, merged in pairs, and freed of sides beyond which others take over, so they may
        overlap.
        """
        if self.base is None:
            return Region(self.parameters, simplify_union(self.parameters, self.pieces))
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
        return render.to_sympy(self.parts())

    def to_latex(self) -> str:
        """A formula for LaTeX's mathematical mode."""
        return render.to_latex(self.parts())

    def to_smtlib(self, name: str = "region") -> str:
        """A `define-fun` of a predicate over the parameters, in SMT-LIB 2.6."""
        return render.to_smtlib(self.parameters, self.parts(), name)

    def as_dict(self) -> dict[str, Any]:
        """The region's part of a `robust/region/1` document, which may be extended by other keys."""
        return write_region(self.parameters, self.pieces, self.base)

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> Region:
        """Read what `as_dict` writes; other keys are left alone.

        Raises:
            InputError: if the document is not a region.
        """
        return Region(*read_region(document))

    def __str__(self) -> str:
        return render.to_text(self.parts())


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


__all__ = ["LinearConstraint", "Point", "Polyhedron", "Region"]
