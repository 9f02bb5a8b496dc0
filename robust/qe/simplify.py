"""Fewer and simpler polyhedra for the same union, possibly only inside a given base."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from robust.qe.constraint import LinearConstraint
from robust.qe.cover import outside
from robust.qe.polyhedron import Polyhedron


def simplify_union(parameters: tuple[str, ...], pieces: Iterable[Polyhedron]) -> tuple[Polyhedron, ...]:
    """Polyhedra with the same union, of which no piece and no constraint can be left out. They may overlap."""
    return _tidy(Polyhedron.universe(parameters), pieces)


def simplify_difference(base: Polyhedron, removed: Iterable[Polyhedron]) -> tuple[Polyhedron, tuple[Polyhedron, ...]]:
    """A base and polyhedra to remove that leave the same points; half-spaces to remove become sides of the base."""
    base = base.simplified()
    pieces = tuple(removed)
    while True:
        pieces = _tidy(base, pieces)
        halves = [piece for piece in pieces if len(piece.constraints) < 2 and not _is_slab(piece)]
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


def _is_slab(piece: Polyhedron) -> bool:
    return len(piece.constraints) == 1 and piece.constraints[0].is_equality


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
    kept = list(piece.simplified().constraints)
    for constraint in list(kept):
        others = [other for other in kept if other is not constraint]
        if base.restricted(others).satisfies(constraint):
            kept = others
    return Polyhedron(base.parameters, tuple(kept))


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
    kept = [half for constraint in piece.constraints for half in constraint.halves()]
    for constraint in list(kept):
        without = [other for other in kept if other is not constraint]
        (side,) = constraint.negation()
        if outside(base.restricted([*without, side]), others) is None:
            kept = without
    return Polyhedron(base.parameters, tuple(kept)).simplified()


def _needed(base: Polyhedron, pieces: Sequence[Polyhedron]) -> list[Polyhedron]:
    """Without the pieces that the others cover together, those with most constraints first."""
    kept = list(pieces)
    for piece in sorted(pieces, key=lambda piece: -len(piece.constraints)):
        others = [other for other in kept if other is not piece]
        if outside(base.intersection(piece), others) is None:
            kept = others
    return kept
