"""The network with uncertainty of a plan under a box of parameter values."""

from __future__ import annotations

from robust.errors import InputError
from robust.execute.controllable_boxes import ends_of, parametric_stnu
from robust.plan.model import ZERO, ParametrizedPlan, TimePoint
from robust.qe.box import Box
from robust.stnu.network import Link, Network


def network_of(plan: ParametrizedPlan, box: Box, name: str, origin: str = "Z") -> Network:
    """A network that is controllable if a dispatcher can carry out the plan for all values in the box.

    Durations are contingent links. Time zero is `origin`. What no network with uncertainty can express, such as a
    parameter that several links share, is taken to be independent and hidden, so the network may demand more.

    Raises:
        InputError: if an infinite end of the box makes a requirement infinitely strong, a duration may be negative, or
            requirements contradict each other for some values in the box.
        UnsupportedError: for a bound that is not linear in the parameters.
    """
    found = parametric_stnu(plan, box).at(ends_of(box))

    def node(point: TimePoint) -> str:
        return origin if point == ZERO else str(point)

    names = [node(point) for point in found.points]
    if len(set(names)) < len(names):
        raise InputError(f"found a time point called {origin!r} in the plan, expected other names")
    links = tuple(
        Link(node(link.source), node(link.target), link.lower, link.upper, link.is_contingent)
        for link in found.links
        if link.source != link.target and (link.lower is not None or link.upper is not None)
    )
    return Network(name, tuple(names), links, origin)
