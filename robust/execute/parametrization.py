"""Parameters of a plan that is being converted [IRR §3, Parametrization].

The original schedule gives every duration and start time its nominal value. A plan file can hold parameters in its
constraints; initial values of fluents, and durations that the domain fixes by `(= ?duration e)`, are parameters of the
problem, and have to be given again when the plan is read (:mod:`robust.plan.parameters`).

This module also computes which durations an instance may have, by its duration constraints or the time-triggered plan,
and which time points an obligation depends on: its own, and those of all changes to variables that it reads.

It also adds what is asked of a plan beyond what it says: to end by a deadline, and sides that move in proportion.
"""

import json
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.errors import InputError, Location
from robust.execute import snap
from robust.execute.distances import DistanceEdge, Original
from robust.network.differences import Distances
from robust.numbers import Number, exact, format_number, is_number, shorten
from robust.plan import load, model, simulate, stn
from robust.plan.parameters import ParameterSpec, Target, wire
from robust.plan.pddl import grounding, syntax
from robust.plan.stn import InstanceDeclaration, ParameterDeclaration, STNConstraint, STNPlan

Variable = model.Atom | model.Fluent


@dataclass(frozen=True, slots=True)
class _Use:
    """Variables that are read, and time points that matter; variables matter through the effects that change them."""

    points: frozenset[model.TimePoint]
    variables: frozenset[Variable]


def influences(plan: model.ParametrizedPlan, obligation: str) -> frozenset[model.TimePoint]:
    """The time points whose distances decide whether a schedule breaks the obligation of a name.

    All time points for a name that is not known here.
    """
    use = next((use for name, use in _obligations(plan) if name == obligation), None)
    if use is None:
        return frozenset(plan.time_points)
    writers: dict[Variable, list[_Use]] = {}
    for variable, written in _writes(plan):
        writers.setdefault(variable, []).append(written)
    points, known = set(use.points), set(use.variables)
    pending = list(use.variables)
    while pending:
        for written in writers.get(pending.pop(), ()):
            points |= written.points
            new = written.variables - known
            known |= new
            pending.extend(new)
    return frozenset(points)


def obligation_names(plan: model.ParametrizedPlan) -> Iterator[str]:
    """The names of all obligations."""
    yield from (name for name, _ in _obligations(plan))
    for instance in plan.instances:
        if instance.durative:
            yield f"{instance.identifier} {instance.action}: non-negative duration"


def _obligations(plan: model.ParametrizedPlan) -> Iterator[tuple[str, _Use]]:
    """The names of obligations with what each reads."""
    for goal in plan.goal:
        yield goal.label, _use((), None, goal.condition)
    for instance in plan.instances:
        for duration in instance.durations:
            yield instance.label(duration), _use(instance.time_points, instance, duration.condition)
        for part in instance.demands:
            over_all = part.timing is model.Timing.OVER_ALL
            points = instance.time_points if over_all else (instance.at(part.timing),)
            yield instance.label(part), _use(points, instance, part.condition)
    for pair in simulate.mutex_pairs(plan):
        yield f"separation: {pair[0]}, {pair[1]}", _Use(frozenset(pair), frozenset())


def _writes(plan: model.ParametrizedPlan) -> Iterator[tuple[Variable, _Use]]:
    """All changes of atoms and fluents: when they happen and what they depend on."""
    for instance in plan.instances:
        for effect in instance.atom_effects:
            yield effect.atom, _use((instance.at(effect.timing),), instance, effect.condition)
        for numeric in instance.numeric_effects:
            point = instance.at(numeric.timing)
            yield numeric.fluent, _use((point,), instance, numeric.condition, numeric.expression)
        for continuous in instance.continuous_effects:
            yield continuous.fluent, _use(instance.time_points, instance, model.Truth(True), continuous.rate)
    for literal in plan.timed_literals:
        yield literal.target, _Use(frozenset({literal.point}), frozenset())


def _use(
    points: Iterable[model.TimePoint],
    instance: model.ActionInstance | None,
    condition: model.Condition,
    *expressions: model.Expression,
) -> _Use:
    used = set(points)
    variables: set[Variable] = {leaf.atom for leaf in model.leaves(condition) if isinstance(leaf, model.Holds)}
    for expression in (*expressions, *(comparison.expression for comparison in model.comparisons(condition))):
        variables.update(model.fluents_in(expression))
        if instance is not None and model.Duration() in expression.variables:
            used |= set(instance.time_points)
    return _Use(frozenset(used), frozenset(variables))


def duration_edges(
    original: Original, instance: model.ActionInstance, pinned: Collection[str]
) -> tuple[DistanceEdge, ...]:
    """Bounds on t_end − t_start; at least 0, or the gap where start and end are mutex.

    A duration constraint `(= ?duration e)`, and any duration of an instance in `pinned`, is the plan's own. Bounds of
    inequalities are read in the state of the original schedule. Strict ones are taken as if they were not, and what is
    not linear in `?duration` is passed over: these are for :mod:`robust.execute.convert` to find out.
    """
    length = original.distance(instance.start, instance.end)
    equal = any(duration.condition.relation is model.Relation.EQUAL for duration in instance.durations)
    if equal or instance.identifier in pinned:
        return DistanceEdge(instance.start, instance.end, length), DistanceEdge(instance.end, instance.start, -length)
    lower, upper = snap.duration_range(instance, snap.read_before(original.execution, instance))
    certain = certain_duration(original, instance)
    edges = (certain._replace(weight=max(certain.weight, lower)),)
    return edges if upper is None else (*edges, DistanceEdge(instance.end, instance.start, -upper))


def settled_durations(original: Original, pinned: Collection[str]) -> frozenset[str]:
    """The instances whose bounds of durations are the same for all schedules and parameter values.

    Not those in `pinned`, nor those with a duration constraint that reads a parameter or a fluent that changes.
    """
    plan = original.plan
    written = model.written_fluents(plan)

    def is_settled(variable: model.NumericVariable) -> bool:
        if isinstance(variable, model.Fluent):
            return variable not in written and not plan.initial_fluents[variable].variables
        return isinstance(variable, model.Duration)

    return frozenset(
        instance.identifier
        for instance in plan.instances
        if instance.identifier not in pinned
        and all(is_settled(variable) for part in instance.durations for variable in part.condition.expression.variables)
    )


def certain_duration(original: Original, instance: model.ActionInstance) -> DistanceEdge:
    """The lower bound of t_end − t_start that holds for every duration: 0, or the gap where start and end are mutex."""
    lower = original.gap if instance.identifier in original.stretched else Fraction(0)
    return DistanceEdge(instance.start, instance.end, lower)


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
        """The parameters that a plan file cannot hold."""
        return (*self.fluents, *self.durations)

    @property
    def pinned_durations(self) -> frozenset[str]:
        """The instances whose duration is a parameter."""
        ends = (constraint.target for constraint in self.constraints if constraint.source != model.ZERO)
        return frozenset(end.instance or "" for end in ends)

    def pinned_starts(self, times: Mapping[model.TimePoint, Fraction]) -> tuple[DistanceEdge, ...]:
        """Bounds that fix the start times that are parameters."""
        starts = [constraint.target for constraint in self.constraints if constraint.source == model.ZERO]
        return tuple(
            bound
            for start in starts
            for bound in (DistanceEdge(model.ZERO, start, times[start]), DistanceEdge(start, model.ZERO, -times[start]))
        )


def parametrization(
    domain: syntax.Domain,
    problem: syntax.Problem,
    plan: STNPlan,
    times: Mapping[model.TimePoint, Fraction],
    specs: Iterable[ParameterSpec],
) -> Parametrization:
    """Apply parameter specifications to a plan without constraints that has a given schedule.

    Raises:
        InputError: for a specification that does not fit the plan, or a nominal value that is not the plan's own.
    """
    declared = load.domain_parameters(domain, plan)
    pairs = [(model.ZERO, instance.start) for instance in plan.instances]
    pairs += [(instance.start, instance.end) for instance in plan.instances if instance.durative]
    lengths = ((target, source, times[target] - times[source]) for source, target in pairs)
    # constraints that leave the schedule as the only one
    rigid = replace(
        plan, constraints=tuple(STNConstraint(target, source, length, length) for target, source, length in lengths)
    )
    wiring = wire(rigid, specs, grounding.initial_fluents(problem), declared)
    known = {parameter.name: parameter for parameter in wiring.parameters}
    parametric = tuple(
        constraint for constraint in wiring.constraints if isinstance(constraint.lower, model.ParameterReference)
    )
    for constraint in parametric:
        _check_nominal(constraint, known, times, plan.file)
    in_problem = set(wiring.fluents.values())
    return Parametrization(
        bare=replace(plan, parameters=tuple(known[name] for name in known if name in declared)),
        parameters=tuple(parameter for parameter in wiring.parameters if parameter.name not in in_problem),
        constraints=parametric,
        fluents=tuple(
            ParameterSpec(Target.FLUENT, str(fluent), name, {word: getattr(known[name], word) for word in _WORDS})
            for fluent, name in wiring.fluents.items()
        ),
        durations=tuple(_duration_specs(domain, plan, wiring.durations)),
    )


def _duration_specs(domain: syntax.Domain, plan: STNPlan, durations: Mapping[str, str]) -> Iterator[ParameterSpec]:
    """What makes parameters of durations that the domain fixes; one that several instances share is named once."""
    uses = Counter(durations.values())
    shared: set[str] = set()
    for instance in plan.instances:
        name = durations.get(instance.identifier)
        if name is not None and _is_fixed(domain, instance):
            if uses[name] == 1:
                yield ParameterSpec(Target.DURATION, instance.identifier, name)
            elif name not in shared:
                shared.add(name)
                yield ParameterSpec(Target.SHARED, instance.action, name)


def _check_nominal(
    constraint: STNConstraint,
    known: Mapping[str, ParameterDeclaration],
    times: Mapping[model.TimePoint, Fraction],
    file: str,
) -> None:
    planned = times[constraint.target] - times[constraint.source]
    for bound in (constraint.lower, constraint.upper):
        if isinstance(bound, model.ParameterReference) and known[bound.name].default not in {None, planned}:
            default = f"default {format_number(known[bound.name].default or Fraction(0))} for parameter {bound.name!r}"
            message = f"found {default}, expected the plan's own {format_number(planned)}, or no default"
            raise InputError(message, known[bound.name].location or Location(file))


def _is_fixed(domain: syntax.Domain, instance: InstanceDeclaration) -> bool:
    """Whether the domain says `(= ?duration e)`, or the same by two inequalities."""
    schema = domain.actions.get(instance.action)
    durations = () if schema is None else schema.durations
    said = {(duration.comparator, duration.timing, duration.bound) for duration in durations}
    return any(
        comparator is syntax.Comparator.EQUAL
        or (comparator is syntax.Comparator.AT_LEAST and (syntax.Comparator.AT_MOST, timing, bound) in said)
        for comparator, timing, bound in said
    )


_WORDS = ("weight", "default", "lower", "upper")


def write_specs(specs: Iterable[ParameterSpec]) -> str:
    """Specifications of durations and fluents as a TOML file that :func:`read_parameter_file` reads."""
    tables = []
    for spec in specs:
        lines = [f"[parameters.{json.dumps(spec.name)}]", f"{spec.target.value} = {json.dumps(spec.subject)}"]
        given = ((word, spec.attributes.get(word)) for word in _WORDS)
        lines += [f'{word} = "{format_number(value)}"' for word, value in given if value is not None]
        tables.append("\n".join(lines) + "\n")
    return "\n".join(tables)


def option_of(spec: ParameterSpec) -> str:
    """The specification of a duration or fluent as the text of an option: what :func:`parse_spec` reads."""
    head = f"{spec.name}={spec.target.value}:{spec.subject}"
    words = (("weight", "weight"), ("lb", "lower"), ("ub", "upper"), ("default", "default"))
    given = ((word, spec.attributes.get(key)) for word, key in words)
    return ",".join((head, *(f"{word}={format_number(value)}" for word, value in given if value is not None)))


DEADLINE = "deadline"
"""The name of the demand."""
_LATER = re.compile(r"\s*\+\s*(?P<percent>[^%]+?)\s*%\s*")


def latest_end(deadline: Number, end: Fraction, place: Location) -> Fraction:
    """The time of a deadline: a number, or `+P%` for P per cent later than a plan ends.

    Raises:
        InputError: for any other text.
    """
    later = _LATER.fullmatch(deadline) if isinstance(deadline, str) else None
    if later is not None and is_number(later["percent"]):
        return end * (1 + exact(later["percent"], place) / 100)
    if isinstance(deadline, str) and (deadline.strip().startswith("+") or not is_number(deadline)):
        message = f"found {shorten(deadline)}, expected a time such as 90, or +10% for later than the plan ends"
        raise InputError(message, place)
    return exact(deadline, place)


def with_deadline(
    plan: stn.STNPlan, deadline: Number | None, place: Location, end: Fraction | None = None
) -> stn.STNPlan:
    """The plan with the demand that every action ends by a time.

    Args:
        plan: the plan, with or without constraints.
        deadline: as :func:`latest_end` reads it; None is none.
        place: where it was given.
        end: when the plan ends; the least time that its network allows at nominal values if not given.

    Raises:
        InputError: for a deadline that cannot be read, or a network without schedule.
    """
    if deadline is None:
        return plan
    latest = latest_end(deadline, earliest_end(plan) if end is None else end, place)
    ends = (stn.STNConstraint(instance.end, model.ZERO, None, latest, name=DEADLINE) for instance in plan.instances)
    return replace(plan, constraints=(*plan.constraints, *ends))


def earliest_end(plan: stn.STNPlan) -> Fraction:
    """The least end of a network at nominal values; InputError if it has no schedule there."""
    nominal = {parameter.name: parameter.default for parameter in plan.parameters}
    points = [model.ZERO, *(point for instance in plan.instances for point in instance.time_points)]
    bounds = [(model.ZERO, point, Fraction(0)) for point in points]

    def number(bound: stn.STNBound) -> Fraction | None:
        return nominal[bound.name] if isinstance(bound, model.ParameterReference) else bound

    for item in plan.constraints:
        lower, upper = number(item.lower), number(item.upper)
        bounds += [] if lower is None else [(item.source, item.target, lower)]
        bounds += [] if upper is None else [(item.target, item.source, -upper)]
    distances = Distances(points, bounds)
    if distances.network.schedule is None or distances.times[model.ZERO]:
        message = "found a network without schedule at nominal values, expected one that ends some time"
        raise InputError(message, Location(plan.file))
    return max(distances.times.values())


def with_relative_widths(plan: model.ParametrizedPlan) -> model.ParametrizedPlan:
    """The plan with weights in proportion to nominal values; a parameter of nominal value 0 keeps its weight."""
    weighted = (replace(known, weight=_relative(known.weight, known.nominal)) for known in plan.parameters)
    return replace(plan, parameters=tuple(weighted))


def with_relative_weights(plan: stn.STNPlan) -> stn.STNPlan:
    """Relative widths as by :func:`with_relative_widths`, of a plan as it is written."""
    weighted = (replace(known, weight=_relative(known.weight, known.default)) for known in plan.parameters)
    return replace(plan, parameters=tuple(weighted))


def _relative(weight: Fraction, nominal: Fraction | None) -> Fraction:
    return weight * abs(nominal) if nominal else weight
