"""Plans ready for dispatch: what does not depend on what happens is worked out once, for any number of runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from robust.encode.interface import EPSILON
from robust.errors import InputError, did_you_mean
from robust.execute.controllability.parametric import ParametricLink, ParametricStnu, parametric_stnu
from robust.execute.dispatch.executors import Blex, Dreex, Executor
from robust.execute.dispatch.network import DispatchNetwork, Guarantee, NaturalLink, dispatch_network
from robust.execute.dispatch.observability import Observability, Revelation, observability
from robust.irr.box import Box
from robust.plan.model import ParametrizedPlan, TimePoint, TimePointKind


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
