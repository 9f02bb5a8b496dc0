"""Points inside regions, by exact random walks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from math import floor
from random import Random

from robust.qe.bounds import Part
from robust.qe.polyhedron import Polyhedron
from robust.qe.reduction import NormalForm

STEPS = 12
"""Steps of the walk between points that are returned."""
CHANCES = 20
"""Rejected points for each requested one before the region is split into a union."""
FAR = Fraction(100)
"""Where a walk stops in an unbounded direction, in its own steps."""


def sample(
    parts: Sequence[Part], pieces: Callable[[], Sequence[Polyhedron]], count: int, seed: int
) -> list[dict[str, Fraction]]:
    """`count` points of a union of parts, of which `pieces` is the (possibly costly) description as a union."""
    random = Random(seed)  # noqa: S311 - reproducible samples, no secrets
    if any(removed for _, removed in parts):
        found = _walks([base for base, _ in parts], random)
        chosen = []
        for _, point in zip(range(count * CHANCES), found, strict=False):
            if any(point in base and not any(point in piece for piece in removed) for base, removed in parts):
                chosen.append(point)
            if len(chosen) == count:
                return chosen
        return [point for _, point in zip(range(count), _walks(pieces(), random), strict=False)]
    return [point for _, point in zip(range(count), _walks([base for base, _ in parts], random), strict=False)]


def _walks(pieces: Iterable[Polyhedron], random: Random) -> Iterator[dict[str, Fraction]]:
    """Points of the union of the pieces without end; none if it is empty."""
    walks = [_walk(form, random) for form in (piece.normal_form for piece in pieces) if form is not None]
    while walks:
        yield next(random.choice(walks))


def _walk(form: NormalForm, random: Random) -> Iterator[dict[str, Fraction]]:
    """Points of the relative interior of a polyhedron: steps in random directions, to a random place of the chord."""
    current = {name: form.interior[name] for name in form.free}
    while True:
        for _ in range(STEPS if form.free else 0):
            current = _step(form, current, random)
        yield form.complete(current)


def _step(form: NormalForm, start: dict[str, Fraction], random: Random) -> dict[str, Fraction]:
    along = set(random.sample(form.free, random.randint(1, len(form.free))))
    direction = {name: Fraction(random.randint(-8, 8) if name in along else 0) for name in form.free}
    least, most = -FAR, FAR
    for constraint in form.inequalities:
        speed = constraint.value(direction)
        if speed:
            reach = (constraint.constant - constraint.value(start)) / speed
            least, most = (least, min(most, reach)) if speed > 0 else (max(least, reach), most)
    length = least + (most - least) * Fraction(random.randint(1, 255), 256)
    target = {name: value + length * direction[name] for name, value in start.items()}
    return _rounded(form, target)


def _rounded(form: NormalForm, point: dict[str, Fraction]) -> dict[str, Fraction]:
    """A nearby point with small denominators, or the point itself; the walk would make them grow without end."""
    for bits in (4, 10, 20, 40):
        scale = 1 << bits
        rounded = {name: Fraction(floor(value * scale), scale) for name, value in point.items()}
        if all(constraint.value(rounded) < constraint.constant for constraint in form.inequalities):
            return rounded
    return point
