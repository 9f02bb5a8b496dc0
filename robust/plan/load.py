"""From files to the parametrized planning problem: domain, problem, plan and parameter specifications put together.

:func:`rewritten` is a way back: it changes numbers in the text of a plan, and leaves comments, order and blanks.
"""

import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from os import PathLike

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import format_number
from robust.plan import model
from robust.plan.parameters import ParameterSpec, Wiring, referenced_parameters, wire
from robust.plan.pddl import grounding, syntax
from robust.plan.polynomial import Polynomial
from robust.plan.stn import ParameterDeclaration, STNBound, STNPlan, check_interval, check_range, parse_stn

File = str | PathLike[str]


def assemble(
    domain: syntax.Domain,
    problem: syntax.Problem,
    stn: STNPlan,
    specs: Iterable[ParameterSpec] = (),
    *,
    nominal_needed: bool = True,
    may_be_empty: bool = False,
) -> model.ParametrizedPlan:
    """Ground what the plan uses and make the specified quantities parameters; InputError if the parts do not fit.

    A duration that a specification makes a parameter γ replaces the instance's own constraint `(= ?duration e)` by
    `(= ?duration γ)`: it is the model's duration that varies. Inequalities on the duration stay as they are, except for
    two that leave one duration only, which are an equality.
    """
    if not (stn.instances or may_be_empty):
        raise InputError("empty plan: found no action instance, expected at least one", Location(stn.file))
    _check_references(stn)
    fluents = grounding.initial_fluents(problem)
    declared = domain_parameters(domain, stn)
    wiring = wire(stn, specs, fluents, declared, nominal_needed=nominal_needed)
    varied = wiring.fluents.keys()  # must stay symbolic even where grounding would need a constant
    instances = [
        grounding.ground_action(
            domain,
            problem,
            instance.identifier,
            instance.action,
            instance.arguments,
            instance.durative,
            instance.location,
            parametrized=varied,
            duration=wiring.durations.get(instance.identifier),
        )
        for instance in stn.instances
    ]
    goal = grounding.ground_goal(domain, problem, parametrized=varied)
    _check_used(stn, wiring, declared, fluents)
    parameters = _parameters(stn, wiring, declared, nominal_needed=nominal_needed)
    values = {**fluents, **{fluent: _reference(name) for fluent, name in wiring.fluents.items()}}
    _check_initial_values(instances, grounding.fluents_in_goal(domain, problem), values, Location(stn.file))
    return model.ParametrizedPlan(
        name=stn.name,
        parameters=parameters,
        instances=tuple(instances),
        constraints=tuple(
            model.TemporalConstraint(
                bound.source, bound.target, _bound(bound.lower), _bound(bound.upper), bound.location, bound.name
            )
            for bound in wiring.constraints
        ),
        initial_atoms=problem.atoms,
        initial_fluents=values,
        timed_literals=problem.timed_literals,
        goal=goal,
    )


def _check_references(stn: STNPlan) -> None:
    """What the reader guarantees and a plan built by a program may lack: unique names, all declared, sane numbers."""
    names = [parameter.name for parameter in stn.parameters]
    declared = {"instance": [instance.identifier for instance in stn.instances], "parameter": names}
    for kind, declarations in declared.items():
        name, count = Counter(declarations).most_common(1)[0] if declarations else ("", 0)
        if count > 1:
            raise InputError(f"found {count} declarations of {kind} {name!r}, expected one", Location(stn.file))
    points = {model.ZERO, *(point for instance in stn.instances for point in (instance.start, instance.end))}
    for parameter in stn.parameters:
        check_range(parameter)
    for constraint in stn.constraints:
        check_interval(constraint)
        for point in (constraint.target, constraint.source):
            if point not in points:
                message = f"found time point '{point}', expected one of the plan's instances"
                raise InputError(message + did_you_mean(str(point), map(str, points)), constraint.location)
        for name in sorted(referenced_parameters([constraint], ()) - set(names)):
            hint = did_you_mean(name, names)
            raise InputError(f"found bound {name!r}, expected a declared parameter{hint}", constraint.location)


def domain_parameters(domain: syntax.Domain, stn: STNPlan) -> dict[str, str]:
    """The plan's names for all synthesis parameters of the domain, with what declares them.

    An action that the domain lacks is passed over here: grounding reports it.
    """
    declared = dict.fromkeys(domain.parameters, f"domain {domain.name}")
    for instance in stn.instances:
        schema = domain.actions.get(instance.action)
        for name in schema.synth_parameters if schema else ():
            declared[f"{instance.identifier}.{name}"] = f"action {instance.action} of instance {instance.identifier}"
    return declared


def _check_used(
    stn: STNPlan, wiring: Wiring, declared: Mapping[str, str], fluents: Mapping[model.Fluent, model.Expression]
) -> None:
    used = referenced_parameters(wiring.constraints, fluents.values())
    used.update(declared, wiring.durations.values(), wiring.fluents.values())
    for parameter in wiring.parameters:
        if parameter.name not in used:
            known = [name for name in declared if name not in {one.name for one in stn.parameters}]
            message = f"found parameter {parameter.name!r} without a use, expected one in a bound or in the domain"
            remedy = did_you_mean(parameter.name, known) or "; remove the declaration"
            raise InputError(message + remedy, parameter.location)


def _parameters(
    stn: STNPlan, wiring: Wiring, declared: Mapping[str, str], *, nominal_needed: bool
) -> tuple[model.Parameter, ...]:
    """All parameters with their nominal values."""
    declarations = {parameter.name: parameter for parameter in wiring.parameters}
    for name, origin in declared.items():
        if name not in declarations:
            if nominal_needed:
                message = f"found no nominal value for parameter {name!r} of {origin}, expected {_remedy(name)}"
                raise InputError(message, Location(stn.file))
            declarations[name] = ParameterDeclaration(name, location=Location(stn.file))
    parameters = tuple(map(_parameter, declarations.values()))
    if nominal_needed:
        require_nominal_values(parameters)
    return parameters


def _parameter(declaration: ParameterDeclaration) -> model.Parameter:
    nominal, lower, upper = declaration.default, declaration.lower, declaration.upper
    if nominal is None:
        nominal = Fraction(0) if lower is None else max(lower, Fraction(0))
        nominal = nominal if upper is None else min(upper, nominal)
    given = declaration.default is not None
    return model.Parameter(declaration.name, nominal, declaration.weight, lower, upper, declaration.location, given)


def require_nominal_values(parameters: Iterable[model.Parameter]) -> None:
    """InputError for a parameter without a nominal value."""
    for parameter in parameters:
        if not parameter.has_nominal:
            message = f"found parameter {parameter.name!r} without a nominal value, expected {_remedy(parameter.name)}"
            raise InputError(message, parameter.location)


def _remedy(name: str) -> str:
    option = shlex.quote(f"{name},default=VALUE")
    return f"'parameter {name} default VALUE;' in the plan or the option --parameter {option}"


def _reference(name: str) -> model.Expression:
    variable: model.NumericVariable = model.ParameterReference(name)
    return Polynomial.variable(variable)


def _bound(bound: STNBound) -> model.Bound | None:
    match bound:
        case None:
            return None
        case model.ParameterReference(name):
            return _reference(name)
        case _:
            return Polynomial.constant(bound)


def _check_initial_values(
    instances: Iterable[model.ActionInstance],
    goal: Iterable[tuple[str, frozenset[model.Fluent]]],
    values: Mapping[model.Fluent, model.Expression],
    plan: Location,
) -> None:
    """InputError for a fluent that is evaluated and has no value at time zero: an unknown number is not zero."""
    for instance in instances:
        for fluent in sorted(grounding.fluents_read(instance) - values.keys()):
            reader = f"instance {instance.identifier} {instance} reads it"
            raise _no_value(fluent, reader, values, instance.location or plan)
    for text, read in goal:
        for fluent in sorted(read - values.keys()):
            raise _no_value(fluent, f"the goal {text} reads it", values, plan)


def _no_value(
    fluent: model.Fluent, reader: str, values: Mapping[model.Fluent, model.Expression], place: Location
) -> InputError:
    remedy = f"add (= {fluent} VALUE) to the problem's :init"
    message = f"found no initial value of {fluent}, expected one because {reader}: {remedy}"
    return InputError(message + did_you_mean(str(fluent), map(str, values)), place)


_COMMENT = re.compile(r"#[^\n]*")
_INTERVAL = re.compile(r"c\s*:[^\[;]*\[\s*(?P<lower>[^\s,]+)\s*,\s*(?P<upper>[^\s\]]+)\s*\]")
_DEFAULT = re.compile(r"[^;]*?\sdefault\s+(?P<default>[^\s;]+)")


@dataclass(frozen=True, slots=True)
class BoundNumber:
    """A number in the text: of the statement at `location` the `lower` or `upper` bound, or the `default`."""

    location: Location | None
    part: str


def rewritten(text: str, file: str, numbers: Mapping[BoundNumber, Fraction]) -> str:
    """The text of a plan with other numbers.

    Raises:
        InputError: if a number does not stand in the file, because something else says it.
    """
    # Of the same length, so that positions stay what they are.
    bare = _COMMENT.sub(lambda comment: " " * len(comment.group()), text)
    spans = sorted(((_span(bare, file, number), value) for number, value in numbers.items()), reverse=True)
    for (start, end), value in spans:
        text = f"{text[:start]}{format_number(value)}{text[end:]}"
    parse_stn(text, file)
    return text


def _span(bare: str, file: str, number: BoundNumber) -> tuple[int, int]:
    place = number.location
    pattern = _DEFAULT if number.part == "default" else _INTERVAL
    if place is not None and place.file == file and place.line is not None and place.column is not None:
        begin = sum(len(line) for line in bare.splitlines(keepends=True)[: place.line - 1]) + place.column - 1
        match = pattern.match(bare, begin)
        if match is not None:
            return match.span(number.part)
    raise InputError(
        f"found no {number.part} value to replace in this file, expected it in a statement of the plan, not in options",
        Location(file),
    )
