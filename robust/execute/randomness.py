"""Distributions of the parameters of a plan, from options and from the rules of a world."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.execute.worlds import Rule, Rules, normal_name
from robust.numbers import shorten
from robust.plan.model import Parameter, ParametrizedPlan
from robust.plan.parameters import names_of
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
    """The distribution of each parameter: what is given, else what the first rule of the world that fits says.

    What is given names a parameter, or durations as `duration:drive`, `drive`, `(drive r1 a b)`, the identifier of a
    step, `duration:*` or, for all parameters, `*`; of several that fit, the one that says most precisely what it is
    about counts. A rule of a world fits that is about the parameter, or about the duration of an instance that the
    parameter is. A parameter without either is as planned.

    Raises:
        InputError: wrong distributions, or names that fit nothing; or nothing is said about any parameter.
    """
    known = _given(given, plan, place_of)
    rules = world or Rules()
    ruled = bool(known)
    for parameter in plan.parameters:
        name = parameter.name
        if name in known:
            continue
        rule = rules.parameter(name)
        if rule is None and name in plan.lasting:
            rule = rules.duration(plan.instance[plan.lasting[name]])
        ruled = ruled or rule is not None
        known[name] = _ruled(rule, parameter, place_of, "distribution" if world is None else "world")
    if not ruled and (plan.parameters or world is not None):
        names = ", ".join(parameter.name for parameter in plan.parameters) or "none"
        message = f"found no distribution of a parameter, expected one; known are {names}"
        raise InputError(message, place_of("distribution" if world is None else "world", None))
    return {parameter.name: known[parameter.name] for parameter in plan.parameters}


def _given(given: Given, plan: ParametrizedPlan, place_of: Places) -> dict[str, Distribution]:
    """The distributions of the parameters that what was given is about."""
    parameters = {parameter.name: parameter for parameter in plan.parameters}
    said: dict[str, tuple[int, str | Distribution, Location]] = {}
    subjects: set[str] = set()
    for text, value in given.items() if isinstance(given, Mapping) else ((text, "") for text in given):
        name, kind, place = text, value, place_of("distribution", str(text))
        if not isinstance(given, Mapping):
            name, equals, kind = (part.strip() for part in text.partition("="))
            if not equals or not name:
                raise InputError(f"found {shorten(text)}, expected NAME=DISTRIBUTION such as a=normal:30:5", place)
        if not isinstance(kind, str | Distribution):
            raise InputError(f"found {shorten(repr(kind))}, expected a distribution such as 'normal:30:5'", place)
        if name in subjects:
            raise InputError(f"found a second distribution of {shorten(name)}, expected one", place)
        subjects.add(name)
        for width, parameter in _subjects(str(name), plan, place):
            if parameter not in said or width < said[parameter][0]:
                said[parameter] = width, kind, place
    distributions = {}
    for name, (_, kind, place) in said.items():
        planned = _planned(parameters[name])
        distributions[name] = kind if isinstance(kind, Distribution) else parse_distribution(kind, planned, place)
    return distributions


def _subjects(name: str, plan: ParametrizedPlan, place: Location) -> Iterator[tuple[int, str]]:
    """The parameters that a name is about, and how little it says about which.

    Raises:
        InputError: if there is none.
    """
    names = [parameter.name for parameter in plan.parameters]
    subject = normal_name(name.removeprefix("duration:"))
    if name in names:
        yield 0, name
        return
    found = [
        (width, parameter)
        for parameter, identifier in plan.lasting.items()
        for width, known in enumerate((*names_of(plan.instance[identifier]), "*"))
        if known == subject and name != "*"
    ]
    found = found or ([(4, one) for one in names] if name == "*" else [])
    if not found:
        steps = {name for step in plan.instances for name in (*names_of(step), "*")}
        remedy = did_you_mean(name, names) if names else "; the plan has none, and --parameter makes some"
        if subject in steps and name != "*":
            raise InputError(f"found no parameter that is a duration of {shorten(subject)}, expected one", place)
        raise InputError(f"found unknown parameter {shorten(name)}{remedy}", place)
    yield from found


def _planned(parameter: Parameter) -> Fraction | None:
    return parameter.nominal if parameter.has_nominal else None


def _ruled(rule: Rule | None, parameter: Parameter, place_of: Places, option: str) -> Distribution:
    """The distribution of a parameter by a rule; without a rule, it has its planned value."""
    planned = _planned(parameter)
    if planned is None:
        message = f"found neither a distribution nor a nominal value of parameter {shorten(parameter.name)}"
        raise InputError(f"{message}, expected one of them", place_of(option, None))
    if rule is None:
        return Distribution("constant", {"value": planned})
    distribution = rule.about(planned)
    require_possible(distribution.kind, distribution.numbers, place_of(option, parameter.name))
    return distribution
