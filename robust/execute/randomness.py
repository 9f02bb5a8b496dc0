"""Distributions of the parameters of a plan, from options and from the rules of a world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.execute.worlds import Rule, Rules
from robust.numbers import shorten
from robust.plan.model import Parameter, ParametrizedPlan
from robust.probability.distributions import Distribution, parse_distribution, require_possible

Given = Mapping[str, str | Distribution] | Sequence[str]
"""Distributions by parameter, or texts `NAME=normal:30:5`."""
Places = Callable[[str, str | None], Location]
"""The place that an error names, from the name of an option and a text in it."""


def _plainly(name: str, text: str | None) -> Location:
    return Location(name if text is None else f"{name} {shorten(text)}")


def distributions_of(
    plan: ParametrizedPlan, given: Given, world: Rules | None = None, place_of: Places = _plainly
) -> dict[str, Distribution]:
    """The distribution of each parameter: what is given, else what the first rule that fits says.

    A rule fits that is about the parameter, or about the duration of an instance that the parameter is. With a world,
    a parameter without a rule is as planned.

    Raises:
        InputError: wrong distributions, of unknown parameters, or none of a parameter.
    """
    parameters = {parameter.name: parameter for parameter in plan.parameters}
    known = _given(given, parameters, place_of)
    lasting, ruled = _lengths(plan), bool(known)
    for name, parameter in parameters.items():
        if name in known:
            continue
        if world is None:
            message = f"found no distribution of parameter {shorten(name)}, expected one of each"
            raise InputError(f"{message}; {name}=constant:VALUE fixes it", place_of("distribution", None))
        rule = world.parameter(name)
        if rule is None and name in lasting:
            rule = world.duration(plan.instance[lasting[name]])
        ruled = ruled or rule is not None
        known[name] = _ruled(rule, parameter, place_of)
    if world is not None and not ruled:
        message = f"found no rule about a parameter, expected one; known are {', '.join(parameters) or 'none'}"
        raise InputError(message, place_of("world", None))
    return {name: known[name] for name in parameters}


def _given(given: Given, parameters: Mapping[str, Parameter], place_of: Places) -> dict[str, Distribution]:
    """The distributions that were given, at most one for each parameter."""
    distributions: dict[str, Distribution] = {}
    for text, value in given.items() if isinstance(given, Mapping) else ((text, "") for text in given):
        name, kind, place = text, value, place_of("distribution", str(text))
        if not isinstance(given, Mapping):
            name, equals, kind = (part.strip() for part in text.partition("="))
            if not equals or not name:
                raise InputError(f"found {shorten(text)}, expected NAME=DISTRIBUTION such as a=normal:30:5", place)
        if name not in parameters:
            none = "; the plan has none, and --parameter makes some"
            remedy = did_you_mean(str(name), parameters) if parameters else none
            raise InputError(f"found unknown parameter {shorten(str(name))}{remedy}", place)
        if name in distributions:
            raise InputError(f"found a second distribution of {shorten(name)}, expected one", place)
        if not isinstance(kind, str | Distribution):
            raise InputError(f"found {shorten(repr(kind))}, expected a distribution such as 'normal:30:5'", place)
        planned = _planned(parameters[name])
        distributions[name] = kind if isinstance(kind, Distribution) else parse_distribution(kind, planned, place)
    return distributions


def _planned(parameter: Parameter) -> Fraction | None:
    return parameter.nominal if parameter.has_nominal else None


def _ruled(rule: Rule | None, parameter: Parameter, place_of: Places) -> Distribution:
    """The distribution of a parameter by a rule; without a rule, it has its planned value."""
    planned = _planned(parameter)
    if planned is None:
        message = f"found no nominal value of parameter {shorten(parameter.name)}, expected one: worlds are about plans"
        raise InputError(message, place_of("world", None))
    if rule is None:
        return Distribution("constant", {"value": planned})
    distribution = rule.about(planned)
    require_possible(distribution.kind, distribution.numbers, place_of("world", parameter.name))
    return distribution


def _lengths(plan: ParametrizedPlan) -> dict[str, str]:
    """The instance whose duration a parameter is, by parameter."""
    ends = {(action.start, action.end): action.identifier for action in plan.instances}
    owners: dict[str, str] = {}
    for constraint in plan.constraints:
        length, instance = constraint.lower, ends.get((constraint.source, constraint.target))
        fixed = length is not None and length == constraint.upper and len(length.variables) == 1
        if instance is not None and length is not None and fixed:
            ((unknown, factor),) = length.coefficients()
            if factor == 1 and length.constant_term == 0:
                owners.setdefault(str(unknown), instance)
    return owners


def parameters_by_action(plan: ParametrizedPlan) -> dict[str, list[str]]:
    """The parameters that are durations, by `duration:` and an action, a ground action, or an instance."""
    groups: dict[str, list[str]] = {}
    for parameter, identifier in _lengths(plan).items():
        instance = plan.instance[identifier]
        for name in dict.fromkeys((identifier, str(instance), instance.action)):
            groups.setdefault(f"duration:{name}", []).append(parameter)
    return groups
