"""Boxes where rates and durations vary at once: products of two unknowns, decided at the corners of the rates.

With rates fixed, a plan is linear in its other parameters and in time, and containment decides it. With a schedule and
all other parameters fixed, every numeric value is affine in each rate: as long as no rate is multiplied by itself, and
none decides which effects happen or what the network allows. What is affine in each rate is least, and greatest, at a
corner of the rates' box. So if all comparisons that depend on rates are demands that have to hold at once, a box is
inside the envelope if and only if it is at each corner of its rates. Where all comparisons fall as a rate rises, or all
rise, only one of its ends counts: the other cannot break anything.

The widest box is looked for on a grid of four significant digits of each nominal value: all sides move at once, in
proportion to the weights of their parameters, then those that can go on alone. So each side of the result, moved by one
step of the grid, takes in a point that breaks the plan; :func:`inner_box` executes it.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Unpack

from robust.encode import create_encoding
from robust.encode.interface import Encoding, Facet
from robust.errors import UnsupportedError
from robust.irr.check import Checker, Counterexample, require_some_schedule
from robust.irr.containment import Containment, Margins, Refutation
from robust.irr.search import (
    BoxSearch,
    Conduct,
    EnvelopeResult,
    IncrementalRobustification,
    InnerBox,
    OuterPoint,
    OutsideError,
)
from robust.irr.stops import Stop
from robust.plan import model
from robust.plan.model import Fluent, NumericVariable, Parameter, ParameterReference, ParametrizedPlan, Relation
from robust.qe.box import Box, Face, Side
from robust.smt import limits
from robust.smt.session import Exporter

log = logging.getLogger(__name__)

DIGITS = 4
"""Significant digits of the grid."""
FARTHEST = 1000
"""How far a side is looked for, in multiples of the nominal value."""
UNLIMITED = Stop(f"nothing up to {FARTHEST} times the nominal value")


Dependence = dict[str, tuple[int, frozenset[int]]]
"""Of a value on rates: the degree, cut off at 2, and the signs with which it may move as a rate rises."""
_NEVER, _UP, _ANY = frozenset[int](), frozenset({1}), frozenset({1, -1})


Ends = tuple[tuple[str, tuple[Side, ...]], ...]
"""Rates, and the sides at which each can break something."""


@dataclass(frozen=True)
class Rates:
    """The parameters that are taken at corners, and for each set of their ends the demands that these can break.

    Demands are known by the names of their obligations; those that are in none do not depend on rates.
    """

    names: tuple[str, ...]
    demands: Mapping[Ends, frozenset[str]]

    def breaking(self, name: str) -> tuple[Side, ...]:
        """The sides at which a rate can break something."""
        found = {side for ends in self.demands for rate, sides in ends if rate == name for side in sides}
        return tuple(side for side in Side if side in found)

    def corners(self, box: Box) -> dict[tuple[Fraction, ...], frozenset[str]]:
        """The values of rates at which the box is decided, in the order of names, with the demands to look at.

        Rates that matter to none of these have some value. A side of the box that can break something is finite.
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

    def is_decided(self, box: Box) -> bool:
        """Whether all sides that count are finite."""
        return all(box[name].end(side) is not None for name in self.names for side in self.breaking(name))


def rates_of(plan: ParametrizedPlan) -> Rates:
    """The parameters whose corners decide boxes of a plan, for which products of two unknowns are in the way.

    Raises:
        UnsupportedError: for a plan that corners do not decide, with the place.
    """
    written = model.written_fluents(plan)
    static: dict[NumericVariable, Fraction | model.Expression] = {
        name: value for name, value in plan.initial_fluents.items() if name not in written
    }
    instances, goal = model.with_values(plan.instances, static), model.with_values(plan.goal, static)
    initial = {name: model.with_values(value, static) for name, value in plan.initial_fluents.items()}
    plan = replace(plan, instances=instances, goal=goal, initial_fluents=initial)
    rates = _multiplied(plan)
    if not rates:
        raise UnsupportedError("found no parameter that multiplies time, expected a rate whose ends decide")
    return _Corners(plan, rates).rates()


def _multiplied(plan: ParametrizedPlan) -> tuple[str, ...]:
    """Parameters that bound no time, and reach a continuous rate or a product."""
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
    reached, pending = set[NumericVariable](), list(products)
    while pending:
        name = pending.pop()
        if name not in reached:
            reached.add(name)
            pending.extend(sources.get(name, ()))
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
        return Rates(tuple(self._rates), {ends: frozenset(names) for ends, names in demands.items()})

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


def _with_demands(instance: model.ActionInstance, counts: Callable[[str], bool]) -> model.ActionInstance:
    """An instance with some of its conditions; the others are mentioned, so that interference stays what it is."""
    kept, mentions = [], set(instance.mentions)
    for part in instance.conditions:
        if counts(instance.label(part)):
            kept.append(part)
            continue
        for leaf in model.leaves(part.condition):
            if isinstance(leaf, model.Holds):
                mentions.add(model.Mention(part.timing, leaf.atom))
            elif isinstance(leaf, model.NumericCondition):
                mentions |= {model.Mention(part.timing, fluent) for fluent in model.fluents_in(leaf.expression)}
    return replace(instance, conditions=tuple(kept), mentions=frozenset(mentions))


class CornerContainment(Containment):
    """Decides boxes at the corners of their rates, each by a plan that is linear."""

    def __init__(
        self, encoding: Encoding, rates: Rates, *, solver: str = "z3", exporter: Exporter | None = None
    ) -> None:
        super().__init__(encoding, solver=solver, exporter=exporter)
        self.rates = rates
        self._at: dict[tuple[tuple[Fraction, ...], frozenset[str]], Containment] = {}

    @property
    def refutations(self) -> Sequence[Refutation]:
        """The points that were found to break the plan."""
        return self._refuted

    @property
    def reason(self) -> str:
        """Why no exact method found the box."""
        return f"at the ends of {', '.join(self.rates.names)}: each multiplies a time that varies"

    def contains(self, box: Box, deadline: limits.Deadline) -> bool:
        return self.rates.is_decided(box) and self.refute(box, deadline) is None

    def refute(self, box: Box, deadline: limits.Deadline) -> Refutation | None:
        for known in reversed(self._refuted):
            if box.includes(known.values):
                return known
        found = self._apart.refute(self._rest(box), deadline)
        if found is not None:
            values = {name: box[name].some_value() for name in self.rates.names}
            return self._noted(Refutation(found.reason, {**found.values, **values}, found.facet))
        corners = self.rates.corners(box)
        for corner in sorted(corners, key=self._rank):
            limits.raise_if_interrupted()
            met = self._containment(corner, corners[corner], deadline)._broken_in(self._rest(box), deadline)
            if met is not None:
                found = met()
                values = dict(zip(self.rates.names, corner, strict=True))
                return self._noted(Refutation(found.reason, {**found.values, **values}))
        self._at = {key: known for key, known in self._at.items() if key[0] in corners}
        return None

    def _noted(self, refutation: Refutation) -> Refutation:
        self._refuted.append(refutation)
        return refutation

    @cached_property
    def _apart(self) -> Containment:
        """What does not depend on rates: the network, and demands at any values of them."""
        dependent = frozenset[str]().union(*self.rates.demands.values())
        return self._of(self.encoding.plan.nominal, lambda name: name not in dependent)

    def _containment(
        self, corner: tuple[Fraction, ...], demands: frozenset[str], deadline: limits.Deadline
    ) -> Containment:
        """What demands need at a corner."""
        deadline.enforce()
        if (corner, demands) not in self._at:
            values = dict(zip(self.rates.names, corner, strict=True))
            self._at[corner, demands] = self._of(values, demands.__contains__)
        return self._at[corner, demands]

    def _of(self, values: Mapping[str, Fraction], counts: Callable[[str], bool]) -> Containment:
        """The plan at values of rates with some of its demands; what the others read stays read."""
        fixed = model.at_values(self.encoding.plan, {name: values[name] for name in self.rates.names})
        instances = tuple(_with_demands(each, counts) for each in fixed.instances)
        goal = tuple(part for part in fixed.goal if counts(part.label))
        plan = replace(fixed, instances=instances, goal=goal)
        return Containment(
            create_encoding(self.encoding.name, plan, self.encoding.epsilon),
            solver=self.solver,
            statistics=self.statistics,
        )

    def ended_by_network(self, box: Box, reach: Margins, deadline: limits.Deadline) -> dict[Face, Facet | None]:
        return {}  # obligations and the network end sides alike

    def ended_by(self, box: Box, reach: Margins, deadline: limits.Deadline) -> dict[Face, tuple[str, ...]]:
        ended: dict[Face, tuple[str, ...]] = {}
        for face, step in reach.items():
            end = box[face[0]].end(face[1])
            met = None if end is None else self.refute(box.moved(face, end + face[1].sign * step), deadline)
            ended[face] = () if met is None else (met.reason,)
        return ended

    def _rank(self, corner: tuple[Fraction, ...]) -> int:
        """Corners like the one that was refuted last come first."""
        if not self._refuted:
            return 0
        last, nominal = self._refuted[-1].values, self.encoding.plan.nominal
        pairs = zip(self.rates.names, corner, strict=True)
        return sum((value > nominal[name]) != (last[name] > nominal[name]) for name, value in pairs)

    def _rest(self, box: Box) -> Box:
        return Box({name: interval for name, interval in box.intervals.items() if name not in self.rates.names})


class CornerWidening(BoxSearch):
    """Widening on a grid, by a containment that decides at corners of rates.

    Args:
        corners: decides boxes.
        conduct: see :class:`Conduct`; `on_step` is called with every box that is inside.
    """

    def __init__(self, corners: CornerContainment, **conduct: Unpack[Conduct]) -> None:
        super().__init__(corners, method="widen", **conduct)
        self._corners = corners
        self.fallback = corners.reason
        self._checks = 0
        parameters = self.encoding.plan.parameters
        self._parameters = {parameter.name: parameter for parameter in parameters}
        self.steps = {parameter.name: _step(parameter) for parameter in parameters}

    @property
    def checks(self) -> int:
        return self._checks

    def _search(self) -> None:
        refutation = self._corners.refute(self.box, self.deadline)
        if refutation is not None:
            if refutation.facet is not None:
                require_some_schedule(self.encoding, self._questions.open_session(), self.deadline)
            raise OutsideError(refutation.reason, refutation.values)
        self.verified = True
        faces = product((parameter.name for parameter in self.encoding.plan.parameters), Side)
        active = [face for face in faces if not self._released(face)]
        while active:
            self._together(active)
            active = [face for face in active if self._alone(face)]

    def _margins(self) -> Margins:
        return {}

    def _released(self, face: Face) -> bool:
        """Move a side that can break nothing to its end at once; or one that nothing breaks at all, however far."""
        name, side = face
        limit = self._limit(face)
        end = self.box[name].end(side)
        if end == limit:
            return True
        if name in self._corners.rates.names and side in self._corners.rates.breaking(name):
            return False
        return self._try(self.box.moved(face, limit)) is None

    def _limit(self, face: Face) -> Fraction | None:
        parameter = self._parameters[face[0]]
        return parameter.upper if face[1] is Side.UPPER else parameter.lower

    def _place(self, face: Face, distance: Fraction) -> Fraction:
        """Where a side is that moves so far from the nominal value: on the grid, at the declared bound at most."""
        name, side = face
        nominal, step, limit = self._parameters[name].nominal, self.steps[name], self._limit(face)
        end = step * (
            math.floor((nominal + distance) / step) if side.sign > 0 else math.ceil((nominal - distance) / step)
        )
        if limit is not None and side.sign * end >= side.sign * limit:
            end = limit
        known = self.box[name].end(side)
        return end if known is None or side.sign * end > side.sign * known else known

    def _moved(self, faces: Sequence[Face], scale: Fraction) -> Box:
        box = self.box
        for face in faces:
            box = box.moved(face, self._place(face, scale * self._parameters[face[0]].weight))
        return box

    def _together(self, faces: Sequence[Face]) -> None:
        """Move sides at once as far as the grid allows: doubling, then bisection."""
        reached = min(abs(self._end(face) - self._parameters[face[0]].nominal) / self._weight(face) for face in faces)
        finest = min(self.steps[name] / self._weight((name, side)) for name, side in faces)
        farthest = max(
            FARTHEST * max(abs(self._parameters[n].nominal), self.steps[n]) / self._weight((n, s)) for n, s in faces
        )
        good, step, bad = reached, max(reached, finest), None
        while bad is None and good < farthest:
            candidate = self._moved(faces, good + step)
            if self._try(candidate) is None:
                good, step = good + step, 2 * step
            else:
                bad = good + step
        while bad is not None and bad - good > finest:
            middle = (good + bad) / 2
            if self._moved(faces, middle) == self.box or self._try(self._moved(faces, middle)) is None:
                good = middle
            else:
                bad = middle

    def _alone(self, face: Face) -> bool:
        """Move one side by a step; False if it cannot, now or ever."""
        name, end = face[0], self._end(face)
        if end == self._limit(face):
            return False
        if abs(end) > FARTHEST * max(abs(self._parameters[name].nominal), self.steps[name]):
            self._stops[face] = UNLIMITED
            return False
        moved = self._next(face, end)
        refutation = self._try(self.box.moved(face, moved))
        if refutation is None:
            return True
        self._stops[face] = Stop(refutation.reason)
        return False

    def _next(self, face: Face, end: Fraction) -> Fraction:
        name, side = face
        step, limit = self.steps[name], self._limit(face)
        moved = step * ((math.floor(end / step) + 1) if side.sign > 0 else (math.ceil(end / step) - 1))
        return limit if limit is not None and side.sign * moved > side.sign * limit else moved

    def _end(self, face: Face) -> Fraction:
        end = self.box[face[0]].end(face[1])
        if end is None:
            raise ValueError("a side that is unbounded does not move")
        return end

    def _weight(self, face: Face) -> Fraction:
        return self._parameters[face[0]].weight

    def _try(self, box: Box) -> Refutation | None:
        self._checks += 1
        refutation = self._corners.refute(box, self.deadline) if self._corners.rates.is_decided(box) else _INFINITE
        if refutation is None:
            self._accept(box)
        self._record(self._checks, accepted=refutation is None)
        return refutation


_INFINITE = Refutation("a rate without an end", {})


def _step(parameter: Parameter) -> Fraction:
    """A step of the grid: one in the last of the significant digits of the nominal value."""
    size = abs(parameter.nominal) or parameter.weight
    exponent = math.floor(math.log10(size)) if size else 0
    while Fraction(10) ** exponent > size:
        exponent -= 1
    return Fraction(10) ** (exponent - DIGITS + 1)


def searching_corners(
    encoding: Encoding,
    method: str,
    *,
    beta: Fraction,
    doubling: bool,
    order: Sequence[str],
    solver: str,
    **conduct: Unpack[Conduct],
) -> tuple[BoxSearch, CornerContainment] | None:
    """A search for a box of a plan with products of two unknowns; None if there are none in the way.

    Args:
        encoding: the plan's formulas.
        method: `widen` without an order, or `irr`.
        beta: the precision of `irr`.
        doubling: whether `irr` doubles its steps until the first failure.
        order: parameters in the order in which `irr` takes them.
        solver: `z3` or `cvc5`.
        conduct: see :class:`Conduct`.

    Raises:
        UnsupportedError: if there are products that corners do not decide, or with other methods.
    """
    try:
        encoding.obligations  # noqa: B018 - which is where products are met
    except UnsupportedError as products:
        if method not in {"widen", "irr"} or (method == "widen" and order):
            raise
        try:
            rates = rates_of(encoding.plan)
        except UnsupportedError as undecided:
            raise UnsupportedError(f"{products.message}; {undecided.message}", products.location) from None
        corners = CornerContainment(encoding, rates, solver=solver)
        if method == "widen":
            return CornerWidening(corners, **conduct), corners
        search = IncrementalRobustification(corners, beta=beta, doubling=doubling, order=order, **conduct)
        search.fallback = corners.reason
        return search, corners
    return None


def inner_box(corners: CornerContainment, result: EnvelopeResult, deadline: limits.Deadline) -> InnerBox:
    """How far the sides of a box are from points that break the plan, each executed if there is time."""
    nearest: dict[Face, tuple[Fraction, Refutation]] = {}
    for refutation in corners.refutations:
        outside = [name for name, interval in result.box.intervals.items() if refutation.values[name] not in interval]
        if len(outside) != 1:
            continue
        (name,) = outside
        value = refutation.values[name]
        for side in Side:
            end = result.box[name].end(side)
            if end is not None and side.sign * value > side.sign * end:
                gap = abs(value - end)
                if (name, side) not in nearest or gap < nearest[name, side][0]:
                    nearest[name, side] = gap, refutation
    points = []
    for (name, side), (gap, refutation) in nearest.items():
        shown = None
        try:
            shown = None if refutation.facet is not None else _executed(corners, refutation, deadline)
        except (limits.OutOfTimeError, KeyboardInterrupt):
            log.info("no time was left to execute what is beyond the sides")
        points.append(OuterPoint(name, side, gap, shown))
    return InnerBox(corners.rates.names, tuple(points))


def _executed(corners: CornerContainment, refutation: Refutation, deadline: limits.Deadline) -> Counterexample | None:
    """A schedule at a point with which the obligation breaks, confirmed by the simulator."""
    encoding = corners.encoding
    fixed = create_encoding("relational", model.at_values(encoding.plan, refutation.values), encoding.epsilon)
    checked = Checker(fixed, Box({}), solver=corners.solver, deadline=deadline).run()
    shown = next(iter(checked.counterexamples.values()), None)
    return None if shown is None else replace(shown, parameters=refutation.values)
