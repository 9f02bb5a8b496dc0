"""Parameters of a plan that is being converted [IRR §3, Parametrization].

The original schedule gives every duration and start time its nominal value. A plan file can hold parameters in its
constraints; initial values of fluents, and durations that the domain fixes by `(= ?duration e)`, are parameters of the
problem, and have to be named again to whoever reads the plan (:mod:`robust.plan.parametrize`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.errors import InputError, Location
from robust.execute.distances import Edge
from robust.plan.load import domain_parameters
from robust.plan.model import ZERO, ParameterReference, TimePoint
from robust.plan.numerals import format_number
from robust.plan.parametrize import ParameterSpec, Target
from robust.plan.pddl.grounding import initial_fluents
from robust.plan.pddl.syntax import Comparator, Domain, Problem
from robust.plan.stn import InstanceDeclaration, ParameterDeclaration, STNConstraint, STNPlan
from robust.plan.wiring import wire


@dataclass(frozen=True)
class Parametrization:
    """Where parameters go.

    `bare` is the plan without constraints, with the parameters that stand in the domain. `parameters` are all that the
    plan file has, and `constraints` those of its constraints that have parameters. `fluents` and `durations` have to be
    given with the plan file whenever it is read.
    """

    bare: STNPlan
    parameters: tuple[ParameterDeclaration, ...]
    constraints: tuple[STNConstraint, ...]
    fluents: tuple[ParameterSpec, ...]
    durations: tuple[ParameterSpec, ...]

    @property
    def beside(self) -> tuple[ParameterSpec, ...]:
        """What the plan file cannot say."""
        return (*self.fluents, *self.durations)

    @property
    def pinned_durations(self) -> frozenset[str]:
        """The instances whose duration is a parameter."""
        return frozenset(one.target.instance or "" for one in self.constraints if one.source != ZERO)

    def says_all_about(self, constraint: STNConstraint) -> bool:
        """Whether a parameter says what the distance between these two time points is."""
        pair = {constraint.source, constraint.target}
        return any({one.source, one.target} == pair for one in self.constraints)

    def pinned_starts(self, times: Mapping[TimePoint, Fraction]) -> tuple[Edge, ...]:
        """Bounds that fix the start times that are parameters."""
        starts = [one.target for one in self.constraints if one.source == ZERO]
        return tuple(
            bound for start in starts for bound in (Edge(ZERO, start, times[start]), Edge(start, ZERO, -times[start]))
        )


def parametrization(
    domain: Domain,
    problem: Problem,
    plan: STNPlan,
    times: Mapping[TimePoint, Fraction],
    specs: Iterable[ParameterSpec],
) -> Parametrization:
    """What specifications make of a plan without constraints that has this schedule.

    Raises:
        InputError: for a specification that does not fit the plan, or a nominal value that is not the plan's own.
    """
    declared = domain_parameters(domain, plan)
    rigid = replace(plan, constraints=_rigid(plan.instances, times))
    wiring = wire(rigid, specs, initial_fluents(domain, problem), declared)
    known = {parameter.name: parameter for parameter in wiring.parameters}
    parametric = tuple(one for one in wiring.constraints if isinstance(one.lower, ParameterReference))
    for one in parametric:
        _check_nominal(one, known, times, plan.file)
    in_problem = set(wiring.fluents.values())
    return Parametrization(
        bare=replace(plan, parameters=tuple(one for one in wiring.parameters if one.name in declared)),
        parameters=tuple(one for one in wiring.parameters if one.name not in in_problem),
        constraints=parametric,
        fluents=tuple(_fluent_spec(str(fluent), known[name]) for fluent, name in wiring.fluents.items()),
        durations=tuple(
            ParameterSpec(Target.DURATION, one.identifier, wiring.durations[one.identifier])
            for one in plan.instances
            if one.identifier in wiring.durations and _is_fixed(domain, one)
        ),
    )


def _rigid(instances: Sequence[InstanceDeclaration], times: Mapping[TimePoint, Fraction]) -> tuple[STNConstraint, ...]:
    """Constraints that leave the schedule as the only one."""
    pairs = [(ZERO, one.start) for one in instances] + [(one.start, one.end) for one in instances if one.durative]
    return tuple(
        STNConstraint(target, source, times[target] - times[source], times[target] - times[source])
        for source, target in pairs
    )


def _check_nominal(
    constraint: STNConstraint,
    known: Mapping[str, ParameterDeclaration],
    times: Mapping[TimePoint, Fraction],
    file: str,
) -> None:
    own = times[constraint.target] - times[constraint.source]
    for bound in (constraint.lower, constraint.upper):
        if isinstance(bound, ParameterReference) and known[bound.name].default not in {None, own}:
            found = f"default {format_number(known[bound.name].default or Fraction(0))} for parameter {bound.name!r}"
            message = f"found {found}, expected the plan's own {format_number(own)}, or no default"
            raise InputError(message, known[bound.name].location or Location(file))


def _is_fixed(domain: Domain, instance: InstanceDeclaration) -> bool:
    """Whether the domain says `(= ?duration e)`."""
    schema = domain.actions.get(instance.action)
    return schema is not None and any(bound.comparator is Comparator.EQUAL for bound in schema.durations)


def _fluent_spec(fluent: str, parameter: ParameterDeclaration) -> ParameterSpec:
    attributes = {
        "weight": parameter.weight,
        "default": parameter.default,
        "lower": parameter.lower,
        "upper": parameter.upper,
    }
    return ParameterSpec(Target.FLUENT, fluent, parameter.name, attributes)


def write_specs(specs: Iterable[ParameterSpec]) -> str:
    """Specifications of durations and fluents as a TOML file that :func:`read_parameter_file` reads."""
    tables = []
    for spec in specs:
        lines = [f"[parameters.{json.dumps(spec.name)}]", f"{spec.target.value} = {json.dumps(spec.subject)}"]
        given = ((word, spec.attributes.get(word)) for word in ("weight", "default", "lower", "upper"))
        lines += [f'{word} = "{format_number(value)}"' for word, value in given if value is not None]
        tables.append("\n".join(lines) + "\n")
    return "\n".join(tables)


def option_of(spec: ParameterSpec) -> str:
    """The specification of a duration or fluent as the text of an option: what :func:`parse_spec` reads."""
    head = f"{spec.name}={spec.target.value}:{spec.subject}"
    words = (("weight", "weight"), ("lb", "lower"), ("ub", "upper"), ("default", "default"))
    given = ((word, spec.attributes.get(key)) for word, key in words)
    return ",".join((head, *(f"{word}={format_number(value)}" for word, value in given if value is not None)))
