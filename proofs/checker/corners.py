"""Rates that multiply times that vary: a box of values is good if it is at each corner of its rates.

With the times and all other parameters fixed, every numeric value is a polynomial in the rates. If no rate is
multiplied by itself, it is affine in each, so that over a box of rates it is least, and greatest, at a corner. So a
comparison that holds at each corner holds all over the box. What the network allows, and what happens, may not depend
on rates.
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import product
from typing import Any

from .proofs import demand
from .reader import Ground, Linear, Tree, conjuncts, constant

Degrees = dict[str, int]
"""By rate, how often it is a factor at most: 0 is left out, 2 is too often."""
COMPARISONS = (">=", ">", "<=", "<", "=")


class RateDegrees:
    """How values depend on rates, whatever the times are."""

    def __init__(self, ground: Ground, rates: list[str]) -> None:
        self.rates = rates
        self.fluents: dict[str, Degrees] = {
            subject: {name: 1} for (kind, subject), name in ground.varied.items() if kind == "fluent" and name in rates
        }
        changes = [(each.target, each.amount) for effects in ground.effects for each in effects]
        changes = [change for change in changes if type(change[1]) is tuple]
        changes += [(fluent, rate) for _, _, fluent, rate in ground.flows]
        while any(self.spread(fluent, amount) for fluent, amount in changes):
            pass

    def spread(self, fluent: str, amount: Tree) -> bool:
        """Let a fluent depend on what a change of it depends on; whether that is new."""
        before = self.fluents.get(fluent, {})
        self.fluents[fluent] = after = most([before, self.of(amount)])
        return before != after

    def of(self, tree: Tree) -> Degrees:
        if type(tree) is bool or tree[0] in ("number", "duration", "atom"):
            return {}
        kind, *rest = tree
        if kind == "parameter":
            return {rest[0]: 1} if rest[0] in self.rates else {}
        if kind == "fluent":
            return self.fluents.get(rest[0], {})
        parts = [self.of(each) for each in rest]
        if kind == "/":
            return most([parts[0], *(dict.fromkeys(part, 2) for part in parts[1:])])
        if kind == "*":
            return {name: min(2, sum(part.get(name, 0) for part in parts)) for part in parts for name in part}
        return most(parts)


def most(parts: list[Degrees]) -> Degrees:
    return {name: max(part.get(name, 0) for part in parts) for part in parts for name in part}


def require_affine(ground: Ground, rates: list[str]) -> None:
    """Rejected if what is not affine in each rate, or no comparison that has to hold, depends on rates."""
    degrees = RateDegrees(ground, rates)
    demand(all(w.keys().isdisjoint(rates) for *_, w in ground.edges), "a rate bounds a time")
    whens = [each.when for effects in ground.effects for each in effects]
    demand(not any(map(degrees.of, whens)), "a rate decides whether an effect happens")
    for duty in ground.duties:
        for part in conjuncts(duty.condition):
            found = degrees.of(part)
            demand(not found or part[0] in COMPARISONS, f"{duty.label}: a rate in one of several alternatives")
            demand(max(found.values(), default=0) < 2, f"{duty.label}: a rate is multiplied by itself")


def corners(box: Mapping[str, Any], rates: list[str]) -> Iterator[dict[str, Linear]]:
    """The values of rates at the corners of the closure of a box."""
    demand(all(None not in (box[name].lower, box[name].upper) for name in rates), "a rate has no end")
    ends: list[dict[Fraction, None]] = [dict.fromkeys((box[name].lower, box[name].upper)) for name in rates]
    for values in product(*ends):
        yield dict(zip(rates, map(constant, values)))
