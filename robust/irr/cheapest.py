"""The cheapest changes of a plan under inequalities between them, by exact linear programming.

A bound that is infinite can stay so, and then satisfies or breaks an inequality whatever the other numbers are; which
of these become finite is said beforehand. Where a strict inequality excludes the cheapest changes themselves, the ones
that are found cost a little more.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.irr.conflicts import Candidate, Chosen
from robust.irr.quantities import Changeable, Cost, Quantity, Unchanged, bound_name
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Side
from robust.qe.constraint import LinearConstraint
from robust.qe.simplex import Supremum, feasible_point, maximize

_NOTHING = Fraction(0)
_CLOSE = Fraction(1, 1_000_000)
"""How much more than the infimum is paid, as a share, where the infimum is only approached."""
_FAR = Fraction(1_000_000)
"""Where an infinite bound is looked for that became finite, as a multiple of the greatest number of the plan."""


@dataclass(frozen=True, slots=True)
class Programme:
    """The linear programme of the cheapest changes under some inequalities, of quantities that are `used`, of which
    `new` ones were infinite; `best` is its solution."""

    chosen: Chosen
    used: Sequence[str]
    new: Sequence[str]
    names: Sequence[str]
    constraints: Sequence[LinearConstraint]
    objective: Mapping[str, Fraction]
    best: Supremum

    @property
    def cost(self) -> Cost:
        """What they cost if the number of finite bounds that change does not count."""
        return Cost(len(self.new), -(self.best.value or _NOTHING))


class CheapestChanges:
    """What changes of one plan cost.

    Args:
        plan: the plan.
        quantities: what may be changed, by name.
        counts: whether every change counts, or only bounds that were infinite.
    """

    def __init__(self, plan: ParametrizedPlan, quantities: Mapping[str, Quantity], *, counts: bool) -> None:
        self._plan = plan
        self.quantities = quantities
        self._counts = counts
        numbers = [abs(one.old) for one in quantities.values() if one.old is not None]
        self.greatest = max([Fraction(1), *numbers, *(abs(p.nominal) for p in plan.parameters)])
        """The greatest number of the plan."""
        self._reach = _FAR * self.greatest

    def holds(
        self, choice: LinearConstraint, values: Mapping[str, Fraction], names: Iterable[str] | None = None
    ) -> bool:
        """Whether an inequality holds, where bounds that are not in `values` are what they were, perhaps infinite.

        With `names`, whether it holds because of these being infinite, or does not depend on it.
        """
        endless = [
            factor * self.quantities[name].side.sign
            for name, factor in choice.coefficients
            if name not in values and self.quantities[name].old is None and (names is None or name in names)
        ]
        if endless:
            return all(sign < 0 for sign in endless)
        return names is not None or choice.evaluate(Unchanged(self.quantities, values))

    def candidate(self, chosen: Chosen, free: Collection[str]) -> Candidate[Cost] | None:
        """The cheapest changes of `free` quantities that satisfy inequalities; None if none do."""
        programme = self.programme(chosen, free)
        return None if programme is None else self.solution(programme)

    def programme(self, chosen: Chosen, free: Collection[str]) -> Programme | None:
        """What the cheapest changes of `free` quantities that satisfy inequalities cost; None if none do."""
        constraints = []
        for choice in chosen.values():
            endless = [n for n in choice.parameters if n not in free and self.quantities[n].old is None]
            if not endless:
                old = {n: self.quantities[n].old or _NOTHING for n in choice.parameters if n not in free}
                constraints.append(choice.substitute(old))
            elif not self.holds(choice, {}, endless):
                return None
        mentioned = {name for one in constraints for name in one.parameters}
        # The other bound of a constraint may have to make room, unless it is infinite.
        partners = {other for name in mentioned if (other := self.partner(name)) is not None and other in free}
        used = sorted(mentioned | {name for name in partners if self.quantities[name].old is not None})
        constraints += self._always(used)
        if any(one.is_false for one in constraints):
            return None
        finite = [name for name in used if self.quantities[name].old is not None]
        constraints += [limit for name in finite for limit in self.price(name)]
        names = [*used, *map(cost_name, finite)]
        objective = {cost_name(name): Fraction(-1) for name in finite}
        best = maximize(names, constraints, objective)
        if best is None or best.value is None:
            return None
        return Programme(
            chosen, used, [name for name in used if name not in finite], names, constraints, objective, best
        )

    def solution(self, solved: Programme) -> Candidate[Cost]:
        """Changes that cost that, or little more."""
        best = solved.best
        point = self._point(solved)
        values = {name: point[name] for name in solved.used if point[name] != self.quantities[name].old}
        if not best.attained:
            values = self._without_idle(values, solved.constraints, point)
        count = len(values) if self._counts else solved.cost.count
        return Candidate(solved.chosen, values, Cost(count, solved.cost.total), best.attained)

    def _point(self, solved: Programme) -> Mapping[str, Fraction]:
        """A point that costs as little, or little more; bounds that were infinite are as far out as they can be."""
        names, kept, point = solved.names, solved.constraints, solved.best.point
        outwards = {name: Fraction(self.quantities[name].side.sign) for name in solved.new}
        for goal, best in ((solved.objective, solved.best), (outwards, None)):
            found = best or (maximize(names, kept, goal) if goal else None)
            if found is not None and found.value is not None:
                slack = _NOTHING if found.attained else max(abs(found.value), Fraction(1)) * _CLOSE
                kept = [*kept, LinearConstraint.of(goal, ">=", found.value - slack)]
                point = found.point
        # An optimum is on the boundary, which strict inequalities exclude.
        return point if all(one.evaluate(point) for one in kept) else feasible_point(names, kept) or point

    def _without_idle(
        self, values: Mapping[str, Fraction], constraints: Sequence[LinearConstraint], point: Mapping[str, Fraction]
    ) -> dict[str, Fraction]:
        """Changes without those that only use up what is paid above the infimum, one by one or both of a constraint."""
        kept = dict(values)
        for name in values:
            pair = {name, self.partner(name) or name}
            for idle in ({name}, pair):
                still = {other: value for other, value in kept.items() if other not in idle}
                olds = {other: self.quantities[other].old for other in idle & point.keys()}
                at = {**point, **{other: old for other, old in olds.items() if old is not None}}
                if None not in olds.values() and all(one.evaluate({**at, **still}) for one in constraints):
                    kept, point = still, at
                    break
        return kept

    def partner(self, name: str) -> str | None:
        """The other bound of the same constraint, if it may be changed."""
        one = self.quantities[name]
        other = bound_name(one.constraint, Side.LOWER if one.side is Side.UPPER else Side.UPPER)
        return other if one.kind is Changeable.BOUND and other in self.quantities else None

    def _always(self, names: Collection[str]) -> Iterator[LinearConstraint]:
        """Bounds and nominal values within their limits, lower bounds not above upper ones; the others do not move."""
        for name in names:
            yield from self.limits(self.quantities[name])
        yield from dict.fromkeys(order for name in names for order in self.in_order(name, names))

    def limits(self, one: Quantity) -> Iterator[LinearConstraint]:
        far = self._reach if one.old is None else None
        lower = one.lower if one.lower is not None or far is None else -far
        upper = one.upper if one.upper is not None or far is None else far
        if lower is not None:
            yield LinearConstraint.of({one.name: 1}, ">=", lower)
        if upper is not None:
            yield LinearConstraint.of({one.name: 1}, "<=", upper)

    def in_order(self, name: str, moving: Collection[str]) -> Iterator[LinearConstraint]:
        """The lower bound is not above the upper one, if it is about a bound and both are numbers."""
        if self.quantities[name].kind is Changeable.NOMINAL:
            return
        constraint = self.quantities[name].constraint
        written = self._plan.constraints[constraint]
        form: dict[str, int] = {}
        least = _NOTHING
        for side, bound in ((Side.LOWER, written.lower), (Side.UPPER, written.upper)):
            if (one := bound_name(constraint, side)) in moving:
                form[one] = side.sign
            elif bound is None or not bound.is_constant:
                return
            else:
                least -= side.sign * bound.constant_term
        yield LinearConstraint.of(form, ">=", least)

    def price(self, name: str) -> Iterator[LinearConstraint]:
        """A change costs its amount times its weight, whichever way it goes."""
        one = self.quantities[name]
        old = one.old or _NOTHING
        for sign in (1, -1):
            yield LinearConstraint.of({cost_name(name): 1, name: -sign * one.weight}, ">=", -sign * one.weight * old)


def cost_name(name: str) -> str:
    """The variable that is what a change of a quantity costs."""
    return f"cost of {name}"
