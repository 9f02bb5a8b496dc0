"""Plans ready for dispatch: what does not depend on what happens is worked out once, for any number of runs.

DREEX accepts what a box of parameter values allows that is proved to be inside the robustness envelope. Slicing begins
with such a box, and looks for another one in what is left of the envelope (:mod:`robust.execute.slices`). BLEX(x), the
baseline, accepts any duration or consumption within x per cent of what was planned, and proves nothing.

The temporal network becomes tables of bounds and waits that a dispatcher can read quickly. Under a box that is
dynamically controllable, the tables hold all that follows from the constraints and from what nature may still choose,
with the waits of P. Morris (2014): :mod:`robust.network.uncertain`. Under any other box no strategy is certain; the
tables then hold what follows if nature is kind. For BLEX they hold the constraints of the plan as they are written: it
looks no further ahead than from one time point to the next [IRR, Algorithm 2].

Parameters "must be eventually observable" [IRR §3, Parametrization]. A distance between time points that is a parameter
is revealed by the later one: a duration by the action's end, a start time by the start. A consumption or production is
revealed by the level right after the effect, a rate by the level at the action's end, and an initial level at time
zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import TypeVar

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location, did_you_mean
from robust.execute import controllable_boxes as boxes
from robust.execute.slices import Slices
from robust.network import differences, dispatchable, uncertain
from robust.numbers import is_number, parse_number, shorten
from robust.plan import model, timeline
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval
from robust.qe.region import Region

_PLACE = Location("--executor")
_Grouped = TypeVar("_Grouped")


@dataclass(frozen=True, slots=True)
class Dreex:
    """The executor that is guided by an envelope."""


@dataclass(frozen=True, slots=True)
class Blex:
    """The optimistic baseline: `share` is the deviation that it accepts, 0.3 for BLEX(30)."""

    share: Fraction

    def interval(self, value: Fraction) -> Interval:
        """[(1 − x)·v, (1 + x)·v]."""
        ends = sorted((value * (1 - self.share), value * (1 + self.share)))
        return Interval(ends[0], ends[1])

    def box(self, plan: model.ParametrizedPlan) -> Box:
        """The interval of every parameter, around its nominal value."""
        return Box({parameter.name: self.interval(parameter.nominal) for parameter in plan.parameters})


@dataclass(frozen=True, slots=True)
class Slice:
    """The executor that slices the envelope by what was observed, and goes on while something of it is left.

    `seconds` is the wall time that it has after each observation; then it does as DREEX. None is without limit.
    """

    seconds: float | None = 0.05


Executor = Dreex | Slice | Blex


def parse_executor(text: str) -> Executor:
    """`dreex`, `slice`, `slice:2` for 2 seconds, or `blex:30` for 30 per cent; InputError for anything else."""
    name, colon, number = (part.strip() for part in text.lower().partition(":"))
    if not colon and name in {"dreex", "slice"}:
        return Dreex() if name == "dreex" else Slice()
    if name not in {"slice", "blex"}:
        known = did_you_mean(name, ("dreex", "slice", "blex"))
        raise InputError(f"found {shorten(text)}, expected dreex, slice or blex:PER_CENT{known}", _PLACE)
    unit = "of per cent such as blex:30" if name == "blex" else "of seconds such as slice:2"
    if not is_number(number):
        raise InputError(f"found {shorten(text)}, expected a number {unit}", _PLACE)
    value = parse_number(number, _PLACE)
    if name == "slice":
        if value <= 0:
            raise InputError(f"found {shorten(text)}, expected more than 0 seconds", _PLACE)
        return Slice(float(value))
    if not 0 <= value <= 100:
        raise InputError(f"found {shorten(text)}, expected from 0 to 100 per cent", _PLACE)
    return Blex(value / 100)


class Guarantee(Enum):
    """Guarantee at the beginning of an execution, for as long as all observations are inside the box."""

    DYNAMIC = "dynamic"
    """The plan succeeds."""
    WEAK = "weak"
    """For all values there is a schedule that succeeds, but no strategy is certain to find it."""
    NONE = "none"
    """Nothing has been proved."""


@dataclass(frozen=True, slots=True)
class NaturalLink:
    """A distance that is not the dispatcher's to choose: `target` is waited for once `source` has happened.

    `length` is a linear expression over parameters; `allowed` are the lengths that are accepted.
    """

    source: model.TimePoint
    target: model.TimePoint
    length: Polynomial[str]
    allowed: Interval

    @property
    def parameter(self) -> str | None:
        """The parameter that the length reveals, if it is only one."""
        variables = self.length.variables
        return next(iter(variables)) if len(variables) == 1 else None

    def revealed(self, length: Fraction) -> Fraction:
        """The value of the parameter that a length reveals."""
        ((_, factor),) = self.length.coefficients()
        return (length - self.length.constant_term) / factor


Tables = dispatchable.DispatchNetwork[NaturalLink]
"""The network of a plan that is executed."""

# -- from a plan -------------------------------------------------------------------------------------------------------


def dispatch_network(network: boxes.ParametricStnu, box: Box, executor: Executor) -> tuple[Tables, Guarantee]:
    """The tables of a plan under a box, and the guarantee for their executions.

    Raises:
        InputError: if there is no schedule, whatever nature chooses.
    """
    links = [_natural(link, box, executor) for link in network.links if link.is_contingent]
    looks_ahead = not isinstance(executor, Blex)
    answer = _controllable(network, box) if looks_ahead else None
    if answer is not None:
        return dispatchable.strategy(answer, links), Guarantee.DYNAMIC
    tables = dispatchable.DispatchNetwork(
        network.points, links, _possible_edges(network, box, links), (), closed=looks_ahead
    )
    return tables, Guarantee.WEAK if looks_ahead else Guarantee.NONE


def first_windows(
    network: boxes.ParametricStnu, box: Box
) -> Mapping[model.TimePoint, tuple[Fraction, Fraction | None]]:
    """The windows of the tables of a plan under a box when nothing has happened; far quicker than all tables.

    Raises:
        InputError: if there is no schedule, whatever nature chooses.
    """
    answer = _controllable(network, box)
    if answer is None:
        links = [_natural(link, box, Dreex()) for link in network.links if link.is_contingent]
        edges = list(_possible_edges(network, box, links))
        size, scale = len(network.points), lcm(*(weight.denominator for _, _, weight in edges))
        bounds = [(y, x, -int(weight * scale)) for x, y, weight in edges]
    else:
        size, scale = answer.form.size, answer.form.scale
        bounds = dispatchable.strategy_bounds(answer)
    found = differences.windows(range(size), bounds, {}, 0)
    if found is None:
        raise InputError("the network has no schedule; expected one for every value in the box")
    times = ((Fraction(low, scale), None if high is None else Fraction(high, scale)) for low, high in found)
    return dict(zip(network.points, times, strict=False))


def _controllable(network: boxes.ParametricStnu, box: Box) -> uncertain.DynamicAnswer | None:
    """How a plan is dispatched under a box; None if that is not certain to succeed."""
    with suppress(InputError):  # if a face is infinitely far out, or a link may end before it starts: none is certain
        answer = network.dynamic(boxes.ends_of(box))
        return answer if answer.is_controllable else None
    return None


def _natural(link: boxes.ParametricLink, box: Box, executor: Executor) -> NaturalLink:
    length = link.lower or Polynomial({})
    if isinstance(executor, Blex) and length.is_constant:
        allowed = executor.interval(length.constant_term)
    else:
        allowed = _values(length, box)
    return NaturalLink(link.source, link.target, length, allowed)


def _values(length: boxes.Length, box: Box) -> Interval:
    if length.is_constant:
        return Interval(length.constant_term, length.constant_term)
    return box.values_of(length.coefficients(), length.constant_term)


def _possible_edges(
    network: boxes.ParametricStnu, box: Box, links: Sequence[NaturalLink]
) -> Iterable[tuple[int, int, Fraction]]:
    """The edges that hold for some values in the box: each bound is the weakest in the box."""
    index = {point: i for i, point in enumerate(network.points)}
    bounds = [(natural.source, natural.target, natural.allowed.lower, natural.allowed.upper) for natural in links]
    for link in (link for link in network.links if not link.is_contingent):
        lower = None if link.lower is None else _values(link.lower, box).lower
        upper = None if link.upper is None else _values(link.upper, box).upper
        bounds.append((link.source, link.target, lower, upper))
    for source, target, lower, upper in bounds:
        yield from dispatchable.edges_between(index[source], index[target], lower, upper)


class Means(Enum):
    """Ways in which a parameter is revealed."""

    TIME = "time"
    LEVEL = "level"
    INITIAL = "initial level"


@dataclass(frozen=True, slots=True)
class Revelation:
    """`parameter` is known once `point` has happened; `instance` is the one whose time or effect reveals it."""

    parameter: str
    means: Means
    point: model.TimePoint
    instance: str | None


def revelations(plan: model.ParametrizedPlan, links: Iterable[NaturalLink]) -> tuple[Revelation, ...]:
    """The revelations of the parameters of a plan; a parameter may have none."""
    written = model.written_fluents(plan)
    times = ((link.parameter, Means.TIME, link.target, link.target.instance) for link in links)
    levels = (
        (_single(plan, expression, written), Means.LEVEL, point, instance.identifier)
        for instance in plan.instances
        for expression, point in _changes(instance)
    )
    initial = (
        (_parameter(value), Means.INITIAL, model.ZERO, None)
        for fluent, value in plan.initial_fluents.items()
        if fluent in written and value.is_linear
    )
    revealed: list[Revelation] = []
    for kind in (times, levels, initial):
        known = {revelation.parameter for revelation in revealed}
        revealed += [
            Revelation(name, means, point, instance)
            for name, means, point, instance in kind
            if name is not None and name not in known
        ]
    return tuple(dict.fromkeys(revealed))


def _parameter(expression: model.Expression) -> str | None:
    """The parameter in an expression, if it is the only one."""
    names = [variable.name for variable in expression.variables if isinstance(variable, model.ParameterReference)]
    return names[0] if len(names) == 1 else None


def _changes(instance: model.ActionInstance) -> list[tuple[model.Expression, model.TimePoint]]:
    """The expressions of numeric effects and rates of an instance, each with the time point that shows its value."""
    changes = [(effect.expression, instance.at(effect.timing)) for effect in instance.numeric_effects]
    return changes + [(effect.rate, instance.end) for effect in instance.continuous_effects]


def _variables_of(instance: model.ActionInstance) -> frozenset[model.NumericVariable]:
    """The variables that an instance reads."""
    conditions: list[model.Condition] = [duration.condition for duration in instance.durations]
    for parts in (instance.conditions, instance.atom_effects, instance.numeric_effects):
        conditions += [part.condition for part in parts]
    compared = (comparison.expression for condition in conditions for comparison in model.comparisons(condition))
    expressions = [*compared, *(expression for expression, _ in _changes(instance))]
    return frozenset(variable for expression in expressions for variable in expression.variables)


def _single(plan: model.ParametrizedPlan, expression: model.Expression, written: set[model.Fluent]) -> str | None:
    """The parameter of an effect, if it is the only one in it and one value of the effect means one value of it."""

    def static_value(variable: model.NumericVariable) -> model.Expression:
        if isinstance(variable, model.Fluent) and variable not in written and variable in plan.initial_fluents:
            return plan.initial_fluents[variable]
        return Polynomial.variable(variable)

    in_terms = expression.substitute(static_value)
    name = _parameter(in_terms)
    if name is None:
        return None
    parameter = model.ParameterReference(name)
    mentions = [monomial for monomial in in_terms.terms if parameter in monomial]
    linear = len(mentions) == 1 and mentions[0].count(parameter) == 1
    # A factor such as ?duration is known when the effect happens, and not zero in an effect that matters.
    factors = [variable for variable in mentions[0] if variable != parameter]
    return name if linear and all(isinstance(factor, model.Duration) for factor in factors) else None


def _grouped(pairs: Iterable[tuple[model.TimePoint, _Grouped]]) -> Mapping[model.TimePoint, Sequence[_Grouped]]:
    groups: dict[model.TimePoint, list[_Grouped]] = {}
    for point, item in pairs:
        groups.setdefault(point, []).append(item)
    return groups


@dataclass(frozen=True)
class Dispatchable:
    """A plan, the box of accepted parameter values, and what a dispatcher needs of them.

    `guarantee` holds if the box is inside the plan's robustness envelope, which is for the caller to know. `shared` are
    bounds of the network that become stronger when their parameters are observed. `slices` tell what is left of the
    envelope after observations; None leaves it at the box.
    """

    plan: model.ParametrizedPlan
    box: Box
    epsilon: Fraction
    network: Tables
    guarantee: Guarantee
    revelations: tuple[Revelation, ...]
    shared: tuple[boxes.ParametricLink, ...]
    slices: Slices | None = None

    def continued(self, network: boxes.ParametricStnu, box: Box) -> Dispatchable:
        """A copy in the middle of an execution: the network holds the events so far, and the box is another one."""
        tables, guarantee = dispatch_network(network, box, Dreex())
        return replace(self, box=box, network=tables, guarantee=guarantee)

    def sliced(self, region: Region, *, exact: bool, seconds: float | None) -> Dispatchable:
        """A copy that slices a region: the envelope or, if it is not `exact`, a part of it; `seconds` per answer."""
        network = boxes.parametric_stnu(self.plan, self.box)
        return replace(self, slices=Slices(self.plan.parameters, region, exact, network, seconds))

    @cached_property
    def ours(self) -> tuple[int, ...]:
        """The time points that the dispatcher executes, by number; timed literals are not among them."""
        fixed = {model.TimePointKind.ZERO, model.TimePointKind.TIMED_LITERAL}
        return tuple(
            number
            for number, point in enumerate(self.network.points)
            if point.kind not in fixed and point not in self.network.natural
        )

    @cached_property
    def followers(self) -> Mapping[model.TimePoint, Sequence[NaturalLink]]:
        """The natural links that begin with a time point."""
        return _grouped((link.source, link) for link in self.network.natural.values())

    @cached_property
    def literals(self) -> tuple[tuple[Fraction, int], ...]:
        """Time and number of every timed literal, in order."""
        literals = [(point.time, number) for number, point in enumerate(self.network.points) if point.time is not None]
        return tuple(sorted(literals))

    @cached_property
    def expected(self) -> Mapping[model.TimePoint, Sequence[Revelation]]:
        """The observations that are due once a time point has happened, in addition to its time."""
        return _grouped(
            (revelation.point, revelation) for revelation in self.revelations if revelation.means is not Means.TIME
        )

    @cached_property
    def means(self) -> Mapping[str, Means]:
        """The means by which each parameter is revealed; parameters that nothing reveals are missing."""
        return {revelation.parameter: revelation.means for revelation in self.revelations}

    @cached_property
    def reads(self) -> Mapping[str, frozenset[model.NumericVariable]]:
        """The variables that each instance reads."""
        return {instance.identifier: _variables_of(instance) for instance in self.plan.instances}

    @cached_property
    def varying(self) -> Mapping[str, tuple[model.Fluent, ...]]:
        """For each instance the fluents in its effects that nothing changes: what it may consume."""
        changed, varying = model.written_fluents(self.plan), {}
        for instance in self.plan.instances:
            fluents = {fluent for expression, _ in _changes(instance) for fluent in model.fluents_in(expression)}
            varying[instance.identifier] = tuple(sorted(fluents - changed))
        return varying

    @cached_property
    def levels(self) -> Mapping[model.Fluent, Fraction]:
        """Initial values at nominal parameter values."""
        reading = timeline.Reading(timeline.State(frozenset(), {}), self.plan.nominal)
        return {fluent: reading.expression(value) for fluent, value in self.plan.initial_fluents.items()}


def make_dispatchable(
    plan: model.ParametrizedPlan, box: Box | None = None, executor: Executor = Dreex(), *, epsilon: Fraction = EPSILON
) -> Dispatchable:
    """A plan ready for dispatch.

    Args:
        plan: the plan with its network.
        box: the accepted values of each parameter; for BLEX the default is its own, for DREEX the nominal point.
        executor: which deviations of other durations are accepted, and how far ahead is looked.
        epsilon: the separation of mutex time points; overdue observations are noticed after that time.

    Raises:
        InputError: for a box of other parameters, or if there is no schedule.
        UnsupportedError: for a bound of the network that is not linear in the parameters.
    """
    if box is None:
        box = executor.box(plan) if isinstance(executor, Blex) else Box.nominal(plan.parameters)
    _check_box(plan, box)
    parametric = boxes.parametric_stnu(plan, box)
    network, guarantee = dispatch_network(parametric, box, executor)
    shown, shared = revelations(plan, network.natural.values()), tuple(_shared(parametric))
    return Dispatchable(plan, box, epsilon, network, guarantee, shown, shared)


def _check_box(plan: model.ParametrizedPlan, box: Box) -> None:
    names = {parameter.name for parameter in plan.parameters}
    for name in box.intervals:
        if name not in names:
            raise InputError(f"found {name!r} in the box, expected a parameter of the plan{did_you_mean(name, names)}")
    for name in names:
        if name not in box.intervals:
            raise InputError(f"found no interval for parameter {name!r}, expected one for every parameter")


def _shared(network: boxes.ParametricStnu) -> list[boxes.ParametricLink]:
    """Links that say more once their parameters are known: all but lengths that nothing else mentions."""
    variables = [boxes.variables_of(link) for link in network.links]
    mentions = Counter(name for names in variables for name in names)
    return [
        link
        for link, names in zip(network.links, variables, strict=True)
        if names and (not link.is_contingent or any(mentions[name] > 1 for name in names))
    ]
