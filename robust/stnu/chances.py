"""How likely a network with random lengths can be executed: it is a plan whose actions are its time points."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import product

from robust.errors import UnsupportedError
from robust.numbers import Number, exact
from robust.plan.model import (
    ZERO,
    ActionInstance,
    Bound,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    TemporalConstraint,
)
from robust.plan.polynomial import Polynomial
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds
from robust.probability.risk import Risk, RiskResult
from robust.searching import Status
from robust.stnu.files import Source, network_of
from robust.stnu.network import Link, Network

WITHIN = Fraction(1, 1000)
"""How close bounds of probabilities are to be, unless it is said."""


OPEN = 4
"""Contingent links without a distribution at most: twice as many copies of the network for each."""


def open_links(network: Network) -> list[Link]:
    """The contingent links with an interval, but no distribution of their lengths."""
    contingent = (link for link in network.links if link.is_contingent and link.distribution is None)
    return [link for link in contingent if link.lower != link.upper]


def as_plan(network: Network) -> tuple[ParametrizedPlan, dict[str, Distribution]]:
    """A network as a plan without conditions and effects, whose parameters are random lengths, and their distributions.

    Where contingent links have intervals but no distributions, a schedule has to exist whatever their lengths are. The
    lengths for which one exists are convex, so that it is enough if one exists at each corner of the intervals: the
    plan has a copy of the network for each.

    Raises:
        UnsupportedError: if no length is random, or too many links have no distribution.
    """
    unknown = open_links(network)
    endless = next((link for link in unknown if link.lower is None or link.upper is None), None)
    if endless is not None:
        message = f"found contingent link {endless} without a distribution, expected one, or two ends"
        raise UnsupportedError(message, endless.place)
    if len(unknown) > OPEN:
        found = f"found {len(unknown)} contingent links without distributions, like {unknown[0]}"
        raise UnsupportedError(f"{found}, expected at most {OPEN}; give the others distributions", unknown[0].place)
    random = {link.ends: link.distribution for link in network.links if link.is_contingent}
    distributions = {ends: known for ends, known in random.items() if known is not None}
    if not distributions:
        raise UnsupportedError(f"{network.name}: found no random length, expected a network with distributions")
    instances, constraints = list[ActionInstance](), list[TemporalConstraint]()
    for number, lengths in enumerate(product(*((link.lower, link.upper) for link in unknown))):
        copy = _copied(
            network, f"_{number}" if unknown else "", dict(zip((k.ends for k in unknown), lengths, strict=True))
        )
        instances += copy[0]
        constraints += copy[1]
    parameters = tuple(Parameter(ends, known.centre) for ends, known in distributions.items())
    plan = ParametrizedPlan(network.name, parameters, tuple(instances), tuple(constraints), frozenset(), {}, (), ())
    return plan, distributions


def _copied(
    network: Network, suffix: str, lengths: Mapping[str, Fraction | None]
) -> tuple[list[ActionInstance], list[TemporalConstraint]]:
    """The steps and constraints of a copy of a network in which some links have these lengths."""
    names = {node: f"n{number}{suffix}" for number, node in enumerate(network.nodes)}
    instances = {node: ActionInstance(names[node], node, (), durative=False) for node in network.nodes}
    points = {node: instance.start for node, instance in instances.items()}
    nothing = Polynomial.constant(0)
    constraints = [TemporalConstraint(ZERO, point, nothing, None) for point in points.values()]
    if network.origin is not None:
        after = (points[node] for node in network.nodes if node != network.origin)
        constraints += [TemporalConstraint(points[network.origin], point, nothing, None) for point in after]
    for link in network.links:
        if link.is_contingent and link.distribution is not None:
            lower: Bound | None = Polynomial.variable(ParameterReference(link.ends))
            upper = lower
        else:
            ends = [lengths[link.ends]] * 2 if link.ends in lengths and link.is_contingent else [link.lower, link.upper]
            lower, upper = (None if end is None else Polynomial.constant(end) for end in ends)
        constraints.append(TemporalConstraint(points[link.source], points[link.target], lower, upper, link.place))
    return list(instances.values()), constraints


class WorstCaseRisk(Risk):
    """The probability that a schedule exists whatever the lengths of links without distributions are.

    What executors can do is not known: a copy of the network for each corner would let them know these lengths before.
    """

    def _result(self, status: Status, reason: str | None = None) -> RiskResult:
        return replace(super()._result(status, reason), probabilities=None)


def searching_risk(
    network: Source,
    *,
    within: Number = WITHIN,
    timeout: float | None = None,
    on_bounds: Callable[[Bounds], None] | None = None,
) -> Risk:
    """The search behind :func:`risk`."""
    known = network_of(network)
    plan, distributions = as_plan(known)
    search = WorstCaseRisk if open_links(known) else Risk
    return search(plan, distributions, within=exact(within), timeout=timeout, on_bounds=on_bounds)


def risk(network: Source, *, within: Number = WITHIN, timeout: float | None = None) -> RiskResult:
    """The probability that all requirements can be met when lengths of contingent links are random and independent.

    Contingent links with an interval but no distribution may have any length in it: success means that a schedule
    exists for all of them, which is the probability for the worst lengths.

    Args:
        network: a network, or the path of one.
        within: how close the bounds of the probability are to be.
        timeout: seconds after which the bounds so far are returned.

    Returns:
        Bounds of the probability that a schedule exists and, where longest paths decide, also of the probabilities that
        an executor who sees lengths as they end, and one with a fixed schedule, succeeds.

    Raises:
        InputError: if there is anything wrong in the file.
        UnsupportedError: if no length is random, or more than :data:`OPEN` contingent links have no distribution.
    """
    return searching_risk(network, within=within, timeout=timeout).run()
