"""Which time points an obligation depends on: its own, and those of all changes that what it reads comes from."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import assert_never

from robust.errors import InputError, Location
from robust.execute.distances import Edge, Original
from robust.numbers import format_number
from robust.plan.load import domain_parameters
from robust.plan.model import (
    ZERO,
    ActionInstance,
    Atom,
    Comparison,
    Condition,
    Duration,
    DurationConstraint,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TimePoint,
    Timing,
)
from robust.plan.parameters import ParameterSpec, Target, wire
from robust.plan.pddl.grounding import initial_fluents
from robust.plan.pddl.syntax import Comparator, Domain, Problem
from robust.plan.simulate import mutex_pairs
from robust.plan.stn import InstanceDeclaration, ParameterDeclaration, STNConstraint, STNPlan
from robust.plan.timeline import leaves

Variable = Atom | Fluent


@dataclass(frozen=True, slots=True)
class _Use:
    """What is read, and where: `points` matter by themselves, `variables` by who changes them."""

    points: frozenset[TimePoint]
    variables: frozenset[Variable]


def influences(plan: ParametrizedPlan, obligation: str) -> frozenset[TimePoint]:
    """The time points on whose distances it depends whether a schedule breaks the obligation of that name.

    All time points for a name that is not known here.
    """
    use = _obligation(plan, obligation)
    if use is None:
        return frozenset(plan.time_points)
    writers = _writers(plan)
    points, known = set(use.points), set(use.variables)
    pending = list(use.variables)
    while pending:
        for written in writers.get(pending.pop(), ()):
            points |= written.points
            new = written.variables - known
            known |= new
            pending.extend(new)
    return frozenset(points)


def _obligation(plan: ParametrizedPlan, name: str) -> _Use | None:
    for goal in plan.goal:
        if goal.label == name:
            return _use((), None, [goal.condition], ())
    for instance in plan.instances:
        for part in instance.durations:
            if instance.label(part) == name:
                return _use(instance.time_points, instance, [part.condition], ())
        for condition in instance.conditions:
            if instance.label(condition) == name:
                over_all = condition.timing is Timing.OVER_ALL
                points = instance.time_points if over_all else (instance.at(condition.timing),)
                return _use(points, instance, [condition.condition], ())
    pair = next((pair for pair in mutex_pairs(plan) if f"separation: {pair[0]}, {pair[1]}" == name), None)
    return None if pair is None else _Use(frozenset(pair), frozenset())


def _writers(plan: ParametrizedPlan) -> dict[Variable, list[_Use]]:
    """For every atom and fluent, the changes of it: when they happen and what they depend on."""
    found: dict[Variable, list[_Use]] = {}
    for instance in plan.instances:
        for effect in instance.atom_effects:
            use = _use((instance.at(effect.timing),), instance, [effect.condition], ())
            found.setdefault(effect.atom, []).append(use)
        for numeric in instance.numeric_effects:
            use = _use((instance.at(numeric.timing),), instance, [numeric.condition], [numeric.expression])
            found.setdefault(numeric.fluent, []).append(use)
        for continuous in instance.continuous_effects:
            use = _use(instance.time_points, instance, (), [continuous.rate])
            found.setdefault(continuous.fluent, []).append(use)
    for literal in plan.timed_literals:
        found.setdefault(literal.target, []).append(_Use(frozenset({literal.point}), frozenset()))
    return found


def _use(
    points: Iterable[TimePoint],
    instance: ActionInstance | None,
    conditions: Iterable[Condition],
    expressions: Iterable[Expression],
) -> _Use:
    used = set(points)
    variables: set[Variable] = set()
    for condition in conditions:
        variables |= {leaf.atom for leaf in leaves(condition) if isinstance(leaf, Holds)}
    for expression in (*expressions, *_compared(conditions)):
        variables |= {variable for variable in expression.variables if isinstance(variable, Fluent)}
        if instance is not None and any(isinstance(variable, Duration) for variable in expression.variables):
            used |= set(instance.time_points)
    return _Use(frozenset(used), frozenset(variables))


def _compared(conditions: Iterable[Condition]) -> Iterator[Expression]:
    for condition in conditions:
        for leaf in leaves(condition):
            if isinstance(leaf, Comparison):
                yield leaf.expression


def duration_edges(original: Original, instance: ActionInstance, pinned: Collection[str]) -> tuple[Edge, ...]:
    """Bounds on t_end − t_start; at least 0, or ε where start and end are mutex.

    A duration constraint `(= ?duration e)`, and any duration of an instance in `pinned`, is the plan's own. Bounds of
    inequalities are read in the state of the original schedule. Strict ones are taken as if they were not, and what is
    not linear in `?duration` is passed over: these are for :mod:`robust.execute.convert` to find out.
    """
    own = original.distance(instance.start, instance.end)
    equal = any(one.condition.relation is Relation.EQUAL for one in instance.durations)
    if equal or instance.identifier in pinned:
        return Edge(instance.start, instance.end, own), Edge(instance.end, instance.start, -own)
    lower = certain_duration(original, instance).weight
    upper: Fraction | None = None
    for is_lower, bound in _bounds(original, instance):
        if is_lower:
            lower = max(lower, bound)
        else:
            upper = bound if upper is None else min(upper, bound)
    edges = (Edge(instance.start, instance.end, lower),)
    return edges if upper is None else (*edges, Edge(instance.end, instance.start, -upper))


def settled_durations(original: Original, pinned: Collection[str]) -> frozenset[str]:
    """The instances whose bounds of durations are the same for all schedules and parameter values.

    Not those in `pinned`, nor those with a duration constraint that reads a parameter or a fluent that changes.
    """
    plan = original.plan
    written = {literal.target for literal in plan.timed_literals}
    for instance in plan.instances:
        written |= {effect.fluent for effect in instance.numeric_effects}
        written |= {effect.fluent for effect in instance.continuous_effects}

    def is_settled(variable: NumericVariable) -> bool:
        match variable:
            case Duration():
                return True
            case ParameterReference():
                return False
            case Fluent():
                return variable not in written and not plan.initial_fluents[variable].variables
            case _:
                assert_never(variable)

    return frozenset(
        one.identifier
        for one in plan.instances
        if one.identifier not in pinned
        and all(is_settled(variable) for part in one.durations for variable in part.condition.expression.variables)
    )


def certain_duration(original: Original, instance: ActionInstance) -> Edge:
    """The lower bound of t_end − t_start that holds for every duration: 0, or ε where start and end are mutex."""
    lower = original.epsilon if (instance.start, instance.end) in original.mutex else Fraction(0)
    return Edge(instance.start, instance.end, lower)


def _bounds(original: Original, instance: ActionInstance) -> Iterator[tuple[bool, Fraction]]:
    """Lower (True) and upper bounds."""
    for constraint in instance.durations:
        if constraint.condition.relation is Relation.DIFFERENT:
            continue
        value, slope = _in_duration(original, instance, constraint)
        if slope:
            yield slope > 0, -value / slope


def _in_duration(
    original: Original, instance: ActionInstance, constraint: DurationConstraint
) -> tuple[Fraction, Fraction]:
    """The constraint's expression as `value + slope · ?duration`; the slope is 0 if it is not of this form."""
    expression = constraint.condition.expression
    reading = original.execution.reading(original.before(instance.at(constraint.timing)), instance)
    value, slope = Fraction(0), Fraction(0)
    for monomial, factor in expression.terms.items():
        degree = sum(1 for variable in monomial if isinstance(variable, Duration))
        if degree > 1:
            return Fraction(0), Fraction(0)
        for variable in monomial:
            factor *= 1 if isinstance(variable, Duration) else reading.variable(variable)  # noqa: PLW2901 - a product
        value, slope = (value, slope + factor) if degree else (value + factor, slope)
    return value, slope


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
