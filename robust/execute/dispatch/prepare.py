"""Which observation reveals each parameter [IRR §3, Parametrization: "such quantities must be eventually observable"].

A distance between time points that is a parameter is revealed by the later one: a duration by the action's end, a start
time by the start. A consumption or production is revealed by the level right after the effect, a rate by the level at
the action's end, and an initial level at time zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property

from robust.encode.interface import EPSILON
from robust.errors import InputError, did_you_mean
from robust.execute.controllability.strong import ParametricLink, ParametricStnu, parametric_stnu
from robust.execute.dispatch.network import (
    Blex,
    DispatchNetwork,
    Dreex,
    Executor,
    Guarantee,
    NaturalLink,
    dispatch_network,
)
from robust.irr.box import Box
from robust.plan.model import (
    ZERO,
    Duration,
    Expression,
    Fluent,
    NumericVariable,
    ParameterReference,
    ParametrizedPlan,
    TimePoint,
    TimePointKind,
)
from robust.plan.polynomial import Polynomial


class Means(Enum):
    """How a parameter is revealed."""

    TIME = "time"
    LEVEL = "level"
    RATE = "rate"
    INITIAL = "initial level"


@dataclass(frozen=True, slots=True)
class Revelation:
    """`parameter` is known once `point` has happened; `instance` is the one whose time or effect reveals it."""

    parameter: str
    means: Means
    point: TimePoint
    instance: str | None

    def __str__(self) -> str:
        match self.means:
            case Means.TIME:
                how = f"the time of {self.point}"
            case Means.LEVEL | Means.RATE:
                how = f"the level right after {self.point}"
            case Means.INITIAL:
                how = "the level at the beginning"
        return f"{self.parameter} is revealed by {how}"


@dataclass(frozen=True)
class Observability:
    """All revelations, and the parameters that nothing reveals, with the reason."""

    revelations: tuple[Revelation, ...]
    hidden: dict[str, str]

    @property
    def by_level(self) -> tuple[Revelation, ...]:
        """Those that have to be observed beside the times."""
        return tuple(one for one in self.revelations if one.means is not Means.TIME)


def observability(plan: ParametrizedPlan, links: Iterable[NaturalLink]) -> Observability:
    """What reveals each parameter of a plan."""
    links = tuple(links)
    found = [
        Revelation(link.parameter, Means.TIME, link.target, link.target.instance)
        for link in links
        if link.parameter is not None
    ]
    timed = {one.parameter for one in found}
    found += [one for one in _levels(plan) if one.parameter not in timed]
    known = {one.parameter for one in found}
    found += [one for one in _initial(plan) if one.parameter not in known]
    known = {one.parameter for one in found}
    hidden = {one.name: _reason(plan, links, one.name) for one in plan.parameters if one.name not in known}
    return Observability(tuple(dict.fromkeys(found)), hidden)


def _written(plan: ParametrizedPlan) -> set[Fluent]:
    """The fluents that change."""
    effects = {effect.fluent for one in plan.instances for effect in one.numeric_effects}
    flows = {effect.fluent for one in plan.instances for effect in one.continuous_effects}
    timed = {one.target for one in plan.timed_literals if isinstance(one.target, Fluent)}
    return effects | flows | timed


def _levels(plan: ParametrizedPlan) -> Iterator[Revelation]:
    written = _written(plan)
    for instance in plan.instances:
        for effect in instance.numeric_effects:
            name = _single(plan, effect.expression, written)
            if name is not None:
                yield Revelation(name, Means.LEVEL, instance.at(effect.timing), instance.identifier)
        for flow in instance.continuous_effects:
            name = _single(plan, flow.rate, written)
            if name is not None:
                yield Revelation(name, Means.RATE, instance.end, instance.identifier)


def _single(plan: ParametrizedPlan, expression: Expression, written: set[Fluent]) -> str | None:
    """The parameter of an effect, if it is the only one in it and one value of the effect means one value of it."""
    in_terms = with_static_values(plan, expression, written)
    names = [variable.name for variable in in_terms.variables if isinstance(variable, ParameterReference)]
    if len(names) != 1:
        return None
    mentions = [monomial for monomial in in_terms.terms if ParameterReference(names[0]) in monomial]
    linear = len(mentions) == 1 and mentions[0].count(ParameterReference(names[0])) == 1
    # A factor such as ?duration is known when the effect happens, and not zero in an effect that matters.
    factors = [variable for variable in mentions[0] if variable != ParameterReference(names[0])]
    return names[0] if linear and all(isinstance(one, Duration) for one in factors) else None


def with_static_values(plan: ParametrizedPlan, expression: Expression, written: set[Fluent]) -> Expression:
    """An expression with the initial values of fluents that never change, which may be parameters."""

    def value(variable: NumericVariable) -> Expression:
        if isinstance(variable, Fluent) and variable not in written and variable in plan.initial_fluents:
            return plan.initial_fluents[variable]
        return Polynomial.variable(variable)

    return expression.substitute(value)


def _initial(plan: ParametrizedPlan) -> Iterator[Revelation]:
    written = _written(plan)
    for fluent, value in plan.initial_fluents.items():
        names = [variable.name for variable in value.variables if isinstance(variable, ParameterReference)]
        if fluent in written and len(names) == 1 and value.is_linear:
            yield Revelation(names[0], Means.INITIAL, ZERO, None)


def _reason(plan: ParametrizedPlan, links: Iterable[NaturalLink], name: str) -> str:
    for link in links:
        if name in link.length.variables:
            return f"{name} is only one part of the distance from {link.source} to {link.target}"
    reference = ParameterReference(name)
    if any(reference in effect.expression.variables for one in plan.instances for effect in one.numeric_effects):
        return f"{name} stands in effects with other unknowns"
    return f"{name} stands in conditions or bounds only, which no time and no level shows"


@dataclass(frozen=True)
class Dispatchable:
    """A plan, the box of accepted parameter values, and what a dispatcher needs of them.

    `guarantee` says what is known if the box is inside the plan's robustness envelope; whoever computed the box knows
    that. `shared` are bounds of the network that become stronger when their parameters are observed.
    """

    plan: ParametrizedPlan
    box: Box
    executor: Executor
    epsilon: Fraction
    network: DispatchNetwork
    guarantee: Guarantee
    observability: Observability
    shared: tuple[ParametricLink, ...]

    @cached_property
    def ours(self) -> tuple[int, ...]:
        """The time points that the dispatcher executes, by number; timed literals are not among them."""
        fixed = {TimePointKind.ZERO, TimePointKind.TIMED_LITERAL}
        return tuple(
            number
            for number, point in enumerate(self.network.points)
            if point.kind not in fixed and point not in self.network.natural
        )

    @cached_property
    def followers(self) -> Mapping[TimePoint, tuple[NaturalLink, ...]]:
        """The natural links that begin with a time point."""
        found: dict[TimePoint, list[NaturalLink]] = {}
        for link in self.network.natural.values():
            found.setdefault(link.source, []).append(link)
        return {point: tuple(links) for point, links in found.items()}

    @cached_property
    def literals(self) -> tuple[tuple[Fraction, int], ...]:
        """Time and number of every timed literal, in order."""
        found = [(point.time, number) for number, point in enumerate(self.network.points) if point.time is not None]
        return tuple(sorted(found))

    @cached_property
    def expected(self) -> Mapping[TimePoint, tuple[Revelation, ...]]:
        """What should be observed once a time point has happened."""
        found: dict[TimePoint, list[Revelation]] = {}
        for one in self.observability.by_level:
            found.setdefault(one.point, []).append(one)
        return {point: tuple(ones) for point, ones in found.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What people should know before execution begins: parameters that nothing reveals."""
        return tuple(f"{reason}: it cannot be observed" for reason in self.observability.hidden.values())


def make_dispatchable(
    plan: ParametrizedPlan,
    box: Box | None = None,
    executor: Executor = Dreex(),  # noqa: B008 - immutable
    *,
    epsilon: Fraction = EPSILON,
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
    parametric = parametric_stnu(plan, box)
    network, guarantee = dispatch_network(parametric, box, executor)
    return Dispatchable(
        plan,
        box,
        executor,
        epsilon,
        network,
        guarantee,
        observability(plan, network.natural.values()),
        tuple(_shared(parametric)),
    )


def _check_box(plan: ParametrizedPlan, box: Box) -> None:
    names = {parameter.name for parameter in plan.parameters}
    for name in box.intervals:
        if name not in names:
            raise InputError(f"found {name!r} in the box, expected a parameter of the plan{did_you_mean(name, names)}")
    for name in names:
        if name not in box.intervals:
            raise InputError(f"found no interval for parameter {name!r}, expected one for every parameter")


def _shared(network: ParametricStnu) -> list[ParametricLink]:
    """Links that say more once their parameters are known: all but lengths that nothing else mentions."""

    def variables(link: ParametricLink) -> set[str]:
        return {name for bound in (link.lower, link.upper) if bound is not None for name in bound.variables}

    found = []
    for link in network.links:
        used = variables(link)
        elsewhere = any(used & variables(other) for other in network.links if other is not link)
        if used and (elsewhere or not link.is_contingent):
            found.append(link)
    return found
