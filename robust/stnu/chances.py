"""How likely a network with random lengths can be executed: it is a plan whose actions are its time points."""

from collections.abc import Callable
from fractions import Fraction

from robust.errors import UnsupportedError
from robust.numbers import Number, exact
from robust.plan.model import ZERO, ActionInstance, Parameter, ParameterReference, ParametrizedPlan, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.probability.distributions import Distribution
from robust.probability.measure import Bounds
from robust.probability.risk import Risk, RiskResult
from robust.stnu.files import Source, network_of
from robust.stnu.network import Network

WITHIN = Fraction(1, 1000)
"""How close bounds of probabilities are to be, unless it is said."""


def as_plan(network: Network) -> tuple[ParametrizedPlan, dict[str, Distribution]]:
    """A network as a plan without conditions and effects, whose parameters are lengths, and their distributions.

    Raises:
        UnsupportedError: for a contingent link without a distribution, or none at all.
    """
    names = {node: f"n{number}" for number, node in enumerate(network.nodes)}
    instances = {node: ActionInstance(names[node], node, (), durative=False) for node in network.nodes}
    points = {node: instance.start for node, instance in instances.items()}
    nothing = Polynomial.constant(0)
    constraints = [TemporalConstraint(ZERO, point, nothing, None) for point in points.values()]
    if network.origin is not None:
        after = (points[node] for node in network.nodes if node != network.origin)
        constraints += [TemporalConstraint(points[network.origin], point, nothing, None) for point in after]
    parameters, distributions = [], dict[str, Distribution]()
    for link in network.links:
        source, target = points[link.source], points[link.target]
        if not link.is_contingent:
            lower, upper = (None if end is None else Polynomial.constant(end) for end in (link.lower, link.upper))
            constraints.append(TemporalConstraint(source, target, lower, upper, link.place))
            continue
        if link.distribution is None:
            message = f"found contingent link {link} without a distribution, expected all lengths to be random"
            raise UnsupportedError(message, link.place)
        parameters.append(Parameter(link.ends, link.distribution.centre))
        distributions[link.ends] = link.distribution
        length = Polynomial.variable(ParameterReference(link.ends))
        constraints.append(TemporalConstraint(source, target, length, length, link.place))
    if not parameters:
        raise UnsupportedError(f"{network.name}: found no random length, expected a network with distributions")
    plan = ParametrizedPlan(
        network.name, tuple(parameters), tuple(instances.values()), tuple(constraints), frozenset(), {}, (), ()
    )
    return plan, distributions


def searching_risk(
    network: Source,
    *,
    within: Number = WITHIN,
    timeout: float | None = None,
    on_bounds: Callable[[Bounds], None] | None = None,
) -> Risk:
    """The search behind :func:`risk`."""
    plan, distributions = as_plan(network_of(network))
    return Risk(plan, distributions, within=exact(within), timeout=timeout, on_bounds=on_bounds)


def risk(network: Source, *, within: Number = WITHIN, timeout: float | None = None) -> RiskResult:
    """The probability that all requirements can be met when lengths of contingent links are random and independent.

    Args:
        network: a network, or the path of one, all of whose contingent links have distributions.
        within: how close the bounds of the probability are to be.
        timeout: seconds after which the bounds so far are returned.

    Returns:
        Bounds of the probability that a schedule exists and, where longest paths decide, also of the probabilities that
        an executor who sees lengths as they end, and one with a fixed schedule, succeeds.

    Raises:
        InputError: if there is anything wrong in the file.
        UnsupportedError: for a contingent link without a distribution, or none at all.
    """
    return searching_risk(network, within=within, timeout=timeout).run()
