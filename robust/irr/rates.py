"""Rates: parameters that multiply times that vary, and the corners of their values at which a plan is decided.

With rates fixed, a plan is linear in its other parameters and in time, and containment decides it. With a schedule and
all other parameters fixed, every numeric value is affine in each rate: as long as no rate is multiplied by itself, and
none decides which effects happen or what the network allows. What is affine in each rate is least, and greatest, at a
corner of the rates' box. So if all comparisons that depend on rates are demands that have to hold at once, a box is
inside the envelope if and only if it is at each corner of its rates. Where all comparisons fall as a rate rises, or all
rise, only one of its ends counts: the other cannot break anything.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from robust.errors import UnsupportedError
from robust.network.differences import reachable
from robust.plan import model
from robust.plan.model import Fluent, NumericVariable, ParameterReference, ParametrizedPlan, Relation
from robust.qe.box import Box, Side

Dependence = dict[str, tuple[int, frozenset[int]]]
"""Of a value on rates: the degree, cut off at 2, and the signs with which it may move as a rate rises."""
_NEVER, _UP, _ANY = frozenset[int](), frozenset({1}), frozenset({1, -1})


Ends = tuple[tuple[str, tuple[Side, ...]], ...]
"""Rates, and the sides at which each can break something."""


@dataclass(frozen=True)
class Rates:
    """The parameters that are taken at corners, and for each set of their ends the demands that these can break.

    Demands are known by the names of their obligations; those that are in none do not depend on rates. `usual` are
    values of parameters for what does not depend on them.
    """

    names: tuple[str, ...]
    demands: Mapping[Ends, frozenset[str]]
    usual: Mapping[str, Fraction]

    @property
    def dependent(self) -> frozenset[str]:
        """The demands that some rate can break."""
        return frozenset[str]().union(*self.demands.values())

    @property
    def reason(self) -> str:
        """Why there are corners."""
        return f"at the ends of {', '.join(self.names)}: each multiplies a time that varies"

    def breaking(self, name: str) -> tuple[Side, ...]:
        """The sides at which a rate can break something."""
        found = {side for ends in self.demands for rate, sides in ends if rate == name for side in sides}
        return tuple(side for side in Side if side in found)

    def corners(self, box: Box) -> dict[tuple[Fraction, ...], frozenset[str]]:
        """The values of rates at which the box is decided, in the order of names, with the demands to look at.

        Rates that matter to none of these have some value of the box, and so do those that go on without end.
        """
        found: dict[tuple[Fraction, ...], frozenset[str]] = {}
        for ends, demands in self.demands.items():
            known = dict(ends)
            values: list[dict[Fraction, None]] = []
            for name in self.names:
                finite = (end for side in known.get(name, ()) if (end := box[name].end(side)) is not None)
                values.append(dict.fromkeys(finite) or {box[name].some_value(): None})
            for corner in product(*values):
                found[corner] = found.get(corner, frozenset()) | demands
        return found

    def kindest(self, box: Box) -> dict[tuple[Fraction, ...], frozenset[str]]:
        """The values of rates at which demands break only where they break all over the box, with these demands.

        Of demands that both ends of some rate can break nothing is said, nor where the kind end is not finite.
        """
        found: dict[tuple[Fraction, ...], frozenset[str]] = {}
        for ends, demands in self.demands.items():
            kind = {name: box[name].end(sides[0].opposite) for name, sides in ends if len(sides) == 1}
            finite = {name: value for name, value in kind.items() if value is not None}
            if len(finite) == len(ends):
                corner = tuple(finite.get(name, self.usual[name]) for name in self.names)
                found[corner] = found.get(corner, frozenset()) | demands
        return found

    def values(self, corner: Sequence[Fraction], demands: frozenset[str]) -> dict[str, Fraction]:
        """The values at a corner of rates that matter to some of these demands, and the usual ones of the others."""
        known = {rate for ends, names in self.demands.items() if not names.isdisjoint(demands) for rate, _ in ends}
        pairs = zip(self.names, corner, strict=True)
        return {name: value if name in known else self.usual[name] for name, value in pairs}

    def is_decided(self, box: Box) -> bool:
        """Whether all sides that count are finite."""
        return self.endless(box) is None

    def endless(self, box: Box) -> str | None:
        """A rate that has no end in the box where it can break something."""
        return next((name for name in self.names for side in self.breaking(name) if box[name].end(side) is None), None)


def rates_of(plan: ParametrizedPlan) -> Rates:
    """The parameters whose corners decide boxes of a plan, for which products of two unknowns are in the way.

    Raises:
        UnsupportedError: for a plan that corners do not decide, with the place.
    """
    plan = _without_statics(plan)
    rates = _multiplied(plan)
    if not rates:
        raise UnsupportedError("found no parameter that multiplies time, expected a rate whose ends decide")
    return _Corners(plan, rates).rates()


def multiplied(plan: ParametrizedPlan) -> tuple[str, ...]:
    """Parameters that bound no time, and reach a continuous rate or a product."""
    return _multiplied(_without_statics(plan))


def _without_statics(plan: ParametrizedPlan) -> ParametrizedPlan:
    """The plan with the initial values of fluents that nothing changes in their place."""
    written = model.written_fluents(plan)
    static: dict[NumericVariable, Fraction | model.Expression] = {
        name: value for name, value in plan.initial_fluents.items() if name not in written
    }
    instances, goal = model.with_values(plan.instances, static), model.with_values(plan.goal, static)
    initial = {name: model.with_values(value, static) for name, value in plan.initial_fluents.items()}
    return replace(plan, instances=instances, goal=goal, initial_fluents=initial)


def _multiplied(plan: ParametrizedPlan) -> tuple[str, ...]:
    bounds = [end for item in plan.constraints for end in (item.lower, item.upper) if end is not None]
    temporal = {v.name for bound in bounds for v in bound.variables if isinstance(v, ParameterReference)}
    sources: dict[NumericVariable, set[NumericVariable]] = {
        name: set(value.variables) for name, value in plan.initial_fluents.items()
    }
    products: set[NumericVariable] = set()

    def note(expression: model.Expression) -> None:
        for monomial in expression.terms:
            if len(monomial) > 1:
                products.update(monomial)

    for instance in plan.instances:
        for effect in instance.numeric_effects:
            sources.setdefault(effect.fluent, set()).update(effect.expression.variables)
            note(effect.expression)
        for flow in instance.continuous_effects:
            products.update(flow.rate.variables)
        for demand in _demands(instance):
            for comparison in model.comparisons(demand.condition):
                note(comparison.expression)
    reached = reachable(sources, *products)
    names = {name.name for name in reached if isinstance(name, ParameterReference)} - temporal
    return tuple(parameter.name for parameter in plan.parameters if parameter.name in names)


def _demands(instance: model.ActionInstance) -> tuple[model.TimedCondition | model.DurationConstraint, ...]:
    return (*instance.demands, *instance.durations)


class _Corners:
    """Whether a plan is affine in each rate, and which ends of the rates can break it."""

    def __init__(self, plan: ParametrizedPlan, rates: Sequence[str]) -> None:
        self._plan = plan
        self._rates = rates
        self._of_fluent: dict[Fluent, Dependence] = {}
        for fluent, value in plan.initial_fluents.items():
            self._of_fluent[fluent] = self._dependence(value)
        while self._spread():
            pass

    def _spread(self) -> bool:
        """Let effects pass on what they depend on; whether anything has changed."""
        changed = False
        for instance in self._plan.instances:
            effects = [(effect.fluent, effect.expression) for effect in instance.numeric_effects]
            effects += [(flow.fluent, flow.rate) for flow in instance.continuous_effects]
            for fluent, expression in effects:
                known = self._of_fluent.setdefault(fluent, {})
                for name, (degree, trend) in self._dependence(expression).items():
                    before = known.get(name, (0, _NEVER))
                    after = max(before[0], degree), before[1] | trend
                    changed |= before != after
                    known[name] = after
        return changed

    def _dependence(self, expression: model.Expression) -> Dependence:
        found: Dependence = {}
        for monomial, factor in expression.terms.items():
            parts = [self._of_variable(variable) for variable in monomial]
            for name in {name for part in parts for name in part}:
                degree = min(2, sum(part[name][0] for part in parts if name in part))
                others = [v for v, part in zip(monomial, parts, strict=True) if name not in part]
                trend = next(part[name][1] for part in parts if name in part)
                if degree > 1 or any(not isinstance(other, model.Duration) for other in others):
                    trend = _ANY
                trend = trend if factor > 0 else frozenset(-sign for sign in trend)
                before = found.get(name, (0, _NEVER))
                found[name] = max(before[0], degree), before[1] | trend
        return found

    def _of_variable(self, variable: NumericVariable) -> Dependence:
        if isinstance(variable, ParameterReference):
            return {variable.name: (1, _UP)} if variable.name in self._rates else {}
        return self._of_fluent.get(variable, {}) if isinstance(variable, Fluent) else {}

    def rates(self) -> Rates:
        """Which ends of rates can break which demands.

        Raises:
            UnsupportedError: if corners do not decide.
        """
        demands: dict[Ends, set[str]] = {}
        for instance in self._plan.instances:
            conditions = [effect.condition for effect in instance.atom_effects]
            conditions += [effect.condition for effect in instance.numeric_effects]
            for condition in conditions:
                if any(self._dependence(each.expression) for each in model.comparisons(condition)):
                    what = f"{instance.identifier} {instance.action}: a rate decides whether an effect happens"
                    raise UnsupportedError(f"{what}, expected effects that rates do not decide", instance.location)
            for demand in _demands(instance):
                name = instance.label(demand)
                demands.setdefault(self._ends(demand.condition, name), set()).add(name)
        for goal in self._plan.goal:
            demands.setdefault(self._ends(goal.condition, goal.label), set()).add(goal.label)
        demands.pop((), None)
        broken = {ends: frozenset(names) for ends, names in demands.items()}
        return Rates(tuple(self._rates), broken, self._plan.nominal)

    def _ends(self, condition: model.Condition, name: str) -> Ends:
        breaking: dict[str, set[Side]] = {}
        for part in model.conjuncts(condition):
            for comparison in model.comparisons(part):
                found = self._dependence(comparison.expression)
                if not found:
                    continue
                if part is not comparison or comparison.relation is Relation.DIFFERENT:
                    raise UnsupportedError(f"{name}: rates in one of several alternatives; expected demands without")
                if any(degree > 1 for degree, _ in found.values()):
                    raise UnsupportedError(f"{name}: a rate is multiplied by itself; expected each once in a product")
                for rate, (_, trend) in found.items():
                    sides = breaking.setdefault(rate, set())
                    both = comparison.relation is Relation.EQUAL
                    sides |= {Side.LOWER} if both or 1 in trend else set()
                    sides |= {Side.UPPER} if both or -1 in trend else set()
        ends = ((rate, breaking[rate]) for rate in self._rates if rate in breaking)
        return tuple((rate, tuple(side for side in Side if side in sides)) for rate, sides in ends)


def part_of(
    plan: ParametrizedPlan, values: Mapping[str, Fraction], counts: Callable[[str], bool] = lambda _: True
) -> ParametrizedPlan:
    """The plan at values of some parameters with those of its demands that count; what the others read stays read."""
    fixed = model.at_values(plan, values)
    instances = tuple(_with_demands(each, counts) for each in fixed.instances)
    return replace(fixed, instances=instances, goal=tuple(part for part in fixed.goal if counts(part.label)))


def _with_demands(instance: model.ActionInstance, counts: Callable[[str], bool]) -> model.ActionInstance:
    """An instance with some of its conditions; the others are mentioned, so that interference stays what it is."""
    kept, mentions = [], set(instance.mentions)
    for part in instance.conditions:
        if counts(instance.label(part)):
            kept.append(part)
            continue
        mentions |= {model.Mention(part.timing, name) for name in model.names_in(part.condition)}
    return replace(instance, conditions=tuple(kept), mentions=frozenset(mentions))
