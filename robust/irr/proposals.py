"""Widest boxes by shortest paths: what obligations ask of the ends of a box, in the slack graph of a plan's network.

With a valid nominal point and ε > 0 the points (γ, t) that a box and the network allow are convex, and contain one
schedule in which mutex points are ε apart. Where they must be so everywhere, their order cannot change: each mutex pair
is one difference constraint, which the nominal schedule chooses, and so is each literal that has to hold over all of an
action. With these orders, whatever is read at starts, at ends and by the goal is one truth value or one number; where
effects depend on durations it is a linear form over parameters, and a comparison of it a linear form over faces.

:func:`propose` finds the box, and says why not where this is not all there is to a plan; nobody believes the box until
:func:`is_inside` has proved it.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import groupby, pairwise
from math import ceil

from robust.encode import create_encoding
from robust.encode.interface import Linear, constant, is_over_parameters, over_parameters, variable
from robust.encode.network import TemporalNetwork, mutex_pairs
from robust.encode.settled import FINALLY, Settled, Write
from robust.irr.containment import Containment
from robust.irr.stops import NO_SCHEDULE, Stop, Tolerance
from robust.network import slack as slacks
from robust.network.differences import DifferenceNetwork, Distances
from robust.network.slack import FaceBound, FaceStop, LinearForm, OutsideFragmentError, SlackGraph, SlackRequirement
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Face, Interval, Side
from robust.smt.limits import Deadline, OutOfTimeError, raise_if_interrupted
from robust.smt.session import Statistics

DECLARED = "declared bound"
EFFORT = 2.0
"""Seconds for a box that is there in case that a longer search is cut short."""


class _Varying:
    """Conditions and numbers in the only order of a plan's happenings, as linear expressions over parameters."""

    def __init__(self, plan: model.ParametrizedPlan, network: TemporalNetwork, settled: Settled) -> None:
        self._plan = plan
        self._settled = settled
        self._times = settled.paths.times
        self._lengths = [network.distance(instance.start, instance.end) for instance in plan.instances]
        self._moments: dict[model.Fluent, list[int]] = defaultdict(list)
        self._after: dict[model.Fluent, list[Linear]] = defaultdict(list)
        writes = [write for written in settled.accesses.writes.values() for write in written]
        numeric = [write for write in writes if isinstance(write.name, model.Fluent)]
        ordered = sorted(numeric, key=lambda write: (self._times[write.point], not write.assigns))
        for _, together in groupby(ordered, key=lambda write: self._times[write.point]):
            self._take_place(list(together))
        for write in writes:
            self.truth(write.condition, write.point, write.instance)

    def _take_place(self, writes: Sequence[Write]) -> None:
        amounts = [self._amount(write) for write in writes]
        for write, amount in zip(writes, amounts, strict=True):
            if amount is not None and isinstance(write.name, model.Fluent):
                known = self._after[write.name]
                old = constant(0) if write.assigns else known[-1] if known else self._initially(write.name)
                known.append(old + amount)
                self._moments[write.name].append(self._times[write.point])

    def _amount(self, write: Write) -> Linear | None:
        """What is assigned or added; None if the effect does not take place."""
        if self.truth(write.condition, write.point, write.instance) is False:
            return None
        if isinstance(write.amount, bool):
            raise TypeError("a number is no truth value")
        return self.expression(write.amount, write.point, write.instance)

    def _initially(self, fluent: model.Fluent) -> Linear:
        if fluent not in self._plan.initial_fluents:
            raise OutsideFragmentError(f"{fluent} has no initial value")
        return over_parameters(self._plan.initial_fluents[fluent])

    def length(self, instance: int | None) -> Linear | None:
        """The duration of an instance where parameters alone decide it."""
        if instance is None or not is_over_parameters(self._lengths[instance]):
            return None
        return self._lengths[instance]

    def fluent(self, fluent: model.Fluent, point: int) -> Linear:
        """The number that a point reads; FINALLY the last one."""
        moments = self._moments[fluent]
        count = len(moments)
        if point != FINALLY:
            count = sum(1 for moment in moments if moment < self._times[point])
        return self._after[fluent][count - 1] if count else self._initially(fluent)

    def expression(self, expression: model.Expression, point: int, instance: int | None) -> Linear:
        """The value that a point reads."""

        def value(unknown: model.NumericVariable) -> Linear:
            match unknown:
                case model.Fluent():
                    return self.fluent(unknown, point)
                case model.ParameterReference():
                    return variable(unknown)
                case model.Duration():
                    length = self.length(instance)
                    if length is None:
                        raise OutsideFragmentError("an amount depends on a duration that is free")
                    return length

        found = expression.substitute(value)
        if not found.is_linear:
            raise OutsideFragmentError(f"{expression} is not linear")
        return found

    def truth(self, condition: model.Condition, point: int, instance: int | None) -> bool:
        """The truth of a condition that no parameter decides."""
        match condition:
            case model.Truth(value):
                return value
            case model.Holds(atom, value):
                return self._settled.history.before(point).truth(atom) is value
            case model.NumericCondition(expression, relation):
                found = self.expression(expression, point, instance)
                if not found.is_constant:
                    raise OutsideFragmentError("a comparison with parameters decides about effects or alternatives")
                return relation.holds(found.constant_term)
            case model.And(operands):
                return all(self.truth(operand, point, instance) for operand in operands)
            case model.Or(operands):
                return any(self.truth(operand, point, instance) for operand in operands)


class SlackPlan:
    """A plan's network and obligations as bounds, requirements and forms of a slack graph.

    Args:
        plan: the plan, with nominal values.
        epsilon: the separation of mutex time points.

    Raises:
        OutsideFragmentError: if shortest paths do not decide about the plan.
    """

    def __init__(self, plan: model.ParametrizedPlan, epsilon: Fraction) -> None:
        if not epsilon:
            raise OutsideFragmentError("ε is 0")
        if any(instance.continuous_effects for instance in plan.instances):
            raise OutsideFragmentError("continuous effects")
        self.plan = plan
        self._number = {parameter.name: number for number, parameter in enumerate(plan.parameters)}
        self._network = TemporalNetwork(plan)
        given = [(each.source, each.target, self._nominal(each.weight)) for each in self._network.differences]
        parts = [part.condition.expression for instance in plan.instances for part in instance.durations]
        factors = [factor for part in parts for factor in part.terms.values()]
        limits = [self._nominal(over_parameters(value)) for value in plan.initial_fluents.values()]
        distances = Distances(plan.time_points, given, [epsilon, *factors, *limits])
        self.scale, paths = distances.scale, distances.network
        self._apart = int(epsilon * self.scale)
        if paths.schedule is None or paths.schedule[0]:
            raise OutsideFragmentError(NO_SCHEDULE)
        self.times = paths.schedule
        self.settled = Settled(model.at_values(plan, plan.nominal), paths, self.scale, self._apart)
        if self.settled.unsteady:
            raise OutsideFragmentError(f"the order of what happens to {min(map(str, self.settled.unsteady))} is open")
        self.bounds = [
            FaceBound(*bound, self._face(difference.weight), "; ".join(difference.origins))
            for bound, difference in zip(distances.bounds, self._network.differences, strict=True)
        ]
        self._check_uses()
        self._requirements: dict[tuple[int, int, int], SlackRequirement] = {}
        self.forms: list[LinearForm] = []
        self._varying = _Varying(plan, self._network, self.settled)
        self._demand_bounds()
        self._demand_separations()
        for number in range(len(plan.instances)):
            self._demand_durations(number)
        for number in range(len(plan.instances)):
            self._demand_conditions(number)
        for goal in plan.goal:
            self._demand(goal.condition, FINALLY, None, goal.label)

    @cached_property
    def _mutex(self) -> set[frozenset[model.TimePoint]]:
        return {frozenset(pair) for pair in mutex_pairs(self.plan)}

    def _nominal(self, expression: Linear) -> Fraction:
        if expression.is_constant:
            return expression.constant_term
        nominal = self.plan.nominal
        return expression.evaluate({unknown: nominal[str(unknown)] for unknown in expression.variables})

    def _face(self, weight: Linear) -> slacks.FaceNumber | None:
        """The face that loosens a bound: the lower end of what it adds, the upper end of what it takes away."""
        uses = list(weight.coefficients())
        if not uses:
            return None
        if len(uses) > 1 or abs(uses[0][1]) != 1:
            raise OutsideFragmentError("a bound of the network with several parameters")
        return 2 * self._number[str(uses[0][0])] + (uses[0][1] < 0)

    def _check_uses(self) -> None:
        """One parameter is used by one distance, or in one direction only."""
        uses: dict[int, list[FaceBound]] = defaultdict(list)
        for bound in self.bounds:
            if bound.face is not None:
                uses[bound.face >> 1].append(bound)
        for number, using in uses.items():
            both = len({bound.face for bound in using}) > 1
            if both and len({frozenset((bound.source, bound.target)) for bound in using}) > 1:
                raise OutsideFragmentError(f"{self.plan.parameters[number].name} is used by several distances")

    # -- what is demanded ----------------------------------------------------------------------------------------------

    def _require(self, source: int, target: int, weight: int, name: str, *, exact: bool = True) -> None:
        """t_target − t_source ≥ weight."""
        known = self._requirements.setdefault(
            (source, target, weight), SlackRequirement(source, target, weight, [], exact)
        )
        known.names.append(name)
        known.exact |= exact

    def requirements(self, *, exact: bool = False) -> list[SlackRequirement]:
        """The strongest requirement between each pair of points, perhaps only among those that are exact."""
        strongest: dict[tuple[int, int], SlackRequirement] = {}
        for requirement in self._requirements.values():
            pair = (requirement.source, requirement.target)
            if (requirement.exact or not exact) and (
                pair not in strongest or strongest[pair].weight < requirement.weight
            ):
                strongest[pair] = requirement
        return list(strongest.values())

    def open_requirements(self) -> list[SlackRequirement]:
        """The requirements that some movement may break."""
        return [r for r in self.requirements() if not self._certain.at_least(r.source, r.target, r.weight)]

    @cached_property
    def _certain(self) -> DifferenceNetwork:
        """What the network says wherever faces may move to."""
        limits: dict[slacks.FaceNumber, Fraction] = {}
        for form in self.forms:
            for face, factor in form.factors.items():
                limits[face] = min(form.budget / factor, limits.get(face, form.budget / factor))
        bounds = []
        for bound in self.bounds:
            if bound.face is None:
                bounds.append((bound.source, bound.target, bound.weight))
            elif bound.face in limits:
                bounds.append((bound.source, bound.target, bound.weight - ceil(limits[bound.face])))
        return DifferenceNetwork(len(self.times), bounds)

    def _demand_separations(self) -> None:
        points = self.plan.time_points
        for name in list(self.settled.accesses.writes):
            for first, second in self.settled.neighbours(name):
                if points[first].time is None or points[second].time is None:
                    one, other = (points[number] for number in sorted((first, second)))
                    self._require(first, second, self._apart, f"separation: {one}, {other}")

    def _demand_durations(self, number: int) -> None:
        instance = self.plan.instances[number]
        start, end = self.settled.accesses.starts[number], self.settled.accesses.ends[number]
        length = self._varying.length(number)
        if not instance.durative:
            return
        name = f"{instance.identifier} {instance.action}: non-negative duration"
        if length is not None:
            self._compare(length, model.Relation.AT_LEAST, name)
        else:
            self._require(start, end, 0, name)
        for duration in instance.durations:
            expression, relation = duration.condition.expression, duration.condition.relation
            point = end if duration.timing is model.Timing.AT_END else start
            name = instance.label(duration)
            if length is not None:
                self._compare(self._varying.expression(expression, point, number), relation, name)
                continue
            factor = expression.terms.get((model.Duration(),), Fraction(0))
            rest = expression - Polynomial({(model.Duration(),): factor})
            limit = self._varying.expression(rest, point, number).scaled(-1 / factor) if factor else None
            if limit is None or not limit.is_constant or relation not in _WEAK:
                raise OutsideFragmentError(f"{name} compares a free duration with parameters, or strictly")
            weight = limit.constant_term * self.scale
            if weight.denominator > 1:
                raise OutsideFragmentError(f"{name} is finer than all other numbers")
            if relation is model.Relation.EQUAL or factor > 0:
                self._require(start, end, int(weight), name)
            if relation is model.Relation.EQUAL or factor < 0:
                self._require(end, start, -int(weight), name)

    def _demand_conditions(self, number: int) -> None:
        instance = self.plan.instances[number]
        start, end = self.settled.accesses.starts[number], self.settled.accesses.ends[number]
        for part in instance.demands:
            if part.timing is model.Timing.OVER_ALL:
                self._keep(part.condition, start, end, number, instance.label(part))
            else:
                point = end if part.timing is model.Timing.AT_END else start
                self._demand(part.condition, point, number, instance.label(part))

    def _demand(self, condition: model.Condition, point: int, instance: int | None, name: str) -> None:
        """A condition that is read at a point."""
        for part in model.conjuncts(condition):
            if isinstance(part, model.NumericCondition):
                self._compare(self._varying.expression(part.expression, point, instance), part.relation, name)
            elif not self._varying.truth(part, point, instance):
                raise OutsideFragmentError(f"{name!r} breaks as planned")

    def _compare(self, expression: Linear, relation: model.Relation, name: str) -> None:
        nominal = self._nominal(expression)
        if not relation.holds(nominal):
            raise OutsideFragmentError(f"{name!r} breaks as planned")
        if expression.is_constant:
            return
        if relation not in _WEAK:
            raise OutsideFragmentError(f"{name!r} is a strict comparison with parameters")
        for sign in (1, -1) if relation is model.Relation.EQUAL else (1,):
            factors = {
                2 * self._number[str(unknown)] + (sign * factor < 0): abs(factor)
                for unknown, factor in expression.coefficients()
            }
            self.forms.append(LinearForm(factors, nominal * self.scale, name))

    def _demand_bounds(self) -> None:
        for number, parameter in enumerate(self.plan.parameters):
            for face, end in ((2 * number, parameter.lower), (2 * number + 1, parameter.upper)):
                if end is not None:
                    room = (end - parameter.nominal) * (1 if face & 1 else -1)
                    if room < 0:
                        raise OutsideFragmentError(f"the nominal value of {parameter.name} is out of bounds")
                    self.forms.append(LinearForm({face: Fraction(1)}, room * self.scale, DECLARED))

    # -- over all ------------------------------------------------------------------------------------------------------

    def _keep(self, condition: model.Condition, start: int, end: int, number: int, name: str) -> None:
        """A condition over all of an instance."""
        if self.times[start] >= self.times[end] and condition != model.Truth(True):
            raise OutsideFragmentError(f"{name!r} is about no time as planned")
        match condition:
            case model.Truth(True):
                return
            case model.And(operands):
                for operand in operands:
                    self._keep(operand, start, end, number, name)
            case model.Holds(atom, value):
                self._protect(atom, value, start, end, name)
            case model.NumericCondition():
                self._keep_comparison(condition, start, end, number, name)
            case _:
                raise OutsideFragmentError(f"{name!r} has alternatives")

    def _protect(self, atom: model.Atom, value: bool, start: int, end: int, name: str) -> None:
        """Contrary writers are not before the end, or else before a supporter that is not after the start."""
        times, writes = self.times, self.settled.history.truths.get(atom, {})
        contrary = [point for point, given in writes.items() if given is not value]
        past = [times[point] for point in contrary if times[point] < times[end]]
        for point in contrary:
            if times[point] >= times[end] and point != end:
                self._require(end, point, 0, name)
        if past or (atom in self.plan.initial_atoms) is not value:
            last = max(past, default=-1)
            supporters = [point for point, given in writes.items() if given is value and last < times[point]]
            supporters = [point for point in supporters if times[point] <= times[start]]
            if not supporters:
                raise OutsideFragmentError(f"{name!r} breaks as planned")
            if not any(point == start or self._certain.at_least(point, start, 0) for point in supporters):
                first = min(supporters, key=times.__getitem__)
                self._require(first, start, 0, name, exact=len(supporters) == 1)

    def _keep_comparison(self, condition: model.NumericCondition, start: int, end: int, number: int, name: str) -> None:
        """Each state between writes in which a comparison is false is over by the start, or begins at the end."""
        fluents = list(model.fluents_in(condition.expression))
        writes = {write.point for fluent in fluents for write in self.settled.accesses.writes.get(fluent, ())}
        times = self.times
        points = sorted(writes, key=times.__getitem__)
        named = self.plan.time_points
        for pair in pairwise(points):
            apart = frozenset(named[point] for point in pair) in self._mutex
            if not apart and not self._certain.at_least(*pair, 0):
                raise OutsideFragmentError(f"{name!r} is about changes in any order")
        for first, later in zip((None, *points), (*points, None), strict=True):
            point = FINALLY if later is None else later
            value = self._varying.expression(condition.expression, point, number)
            if not value.is_constant:
                raise OutsideFragmentError(f"{name!r} compares varying amounts over all of an action")
            if condition.relation.holds(value.constant_term):
                continue
            if later is not None and times[later] <= times[start]:
                if later != start:
                    self._require(later, start, 0, name)
            elif first is not None and times[first] >= times[end]:
                if first != end:
                    self._require(end, first, 0, name)
            else:
                raise OutsideFragmentError(f"{name!r} breaks as planned")

    # -- boxes ---------------------------------------------------------------------------------------------------------

    def graph(self, weights: Mapping[str, Fraction]) -> SlackGraph:
        """The slack graph in which faces move as fast as these weights say, and not where there is none."""
        speeds = [weights.get(parameter.name, Fraction(0)) * self.scale for parameter in self.plan.parameters]
        moving = [speed for speed in speeds for _ in Side]
        return SlackGraph(len(self.times), self.times, self.bounds, self.open_requirements(), self.forms, moving)

    def box(self, graph: SlackGraph) -> Box:
        """Where the faces are."""
        intervals = {}
        for number, parameter in enumerate(self.plan.parameters):
            low, high = graph.moved.get(2 * number), graph.moved.get(2 * number + 1)
            intervals[parameter.name] = Interval(
                None if low is None else parameter.nominal - low / self.scale,
                None if high is None else parameter.nominal + high / self.scale,
            )
        return Box(intervals)


_WEAK = (model.Relation.AT_LEAST, model.Relation.EQUAL)


@dataclass(frozen=True)
class Proposal:
    """The widest box, not proved yet, and what ends its finite sides unless it is a declared bound."""

    box: Box
    stops: Mapping[Face, Stop]


def propose(plan: model.ParametrizedPlan, epsilon: Fraction, deadline: Deadline) -> Proposal:
    """The max–min fair box that contains the nominal point.

    Raises:
        OutsideFragmentError: if shortest paths do not find it.
        OutOfTimeError: if the deadline passes first.
    """
    slack = SlackPlan(plan, epsilon)
    graph = slack.graph({parameter.name: parameter.weight for parameter in plan.parameters})
    for _ in graph.events():
        raise_if_interrupted()
        deadline.enforce()
    stops: dict[Face, Stop] = {}
    for face, stop in graph.stops.items():
        name = plan.parameters[face >> 1].name
        stops[name, Side.UPPER if face & 1 else Side.LOWER] = _stop(stop)
    return Proposal(slack.box(graph), stops)


def _stop(stop: FaceStop) -> Stop:
    for tie in stop.ties:
        if isinstance(tie, LinearForm) and tie.chain:
            return Stop(NO_SCHEDULE, tuple(dict.fromkeys(tie.statements)))
    names = dict.fromkeys(name for tie in stop.ties for name in tie.names)
    first, *others = names
    return Stop(first, also=tuple(others))


def is_inside(
    plan: model.ParametrizedPlan,
    box: Box,
    epsilon: Fraction,
    deadline: Deadline,
    *,
    solver: str = "z3",
    statistics: Statistics | None = None,
) -> bool:
    """Whether a box is inside the envelope: proved of the plan within the box, where shortest paths say most.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    declared = ((known.name, Interval(known.lower, known.upper)) for known in plan.parameters)
    if not all(box[name].is_within(bounds) for name, bounds in declared):
        return False
    from robust.irr.corners import corner_containment  # noqa: PLC0415 - where a box is to be proved only

    encoding = create_encoding("relational", model.within(plan, box.ranges), epsilon, deadline)
    known = corner_containment(encoding, solver=solver, statistics=statistics)
    return (known or Containment(encoding, solver=solver, statistics=statistics)).contains(box, deadline)


def known_box(plan: model.ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> Box | None:
    """A box inside the envelope, proved within a tenth of the time and `EFFORT`; None if none was found."""
    if not plan.has_nominal:
        return None
    soon = Deadline.after(EFFORT if deadline.remaining is None else min(EFFORT, deadline.remaining / 10))
    try:
        box = propose(plan, epsilon, soon).box
        return box if is_inside(plan, box, epsilon, soon, solver=solver) else None
    except (OutsideFragmentError, OutOfTimeError):
        return None


# -- one number --------------------------------------------------------------------------------------------------------


def tolerance(
    plan: model.ParametrizedPlan, epsilon: Fraction, deadline: Deadline, solver: str, proved: Box | None = None
) -> Tolerance | None:
    """λ* of a plan, proved; None if no parameter is a duration other than 0, or if shortest paths do not decide it.

    Some box may be proved already.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    durations = {name: plan.nominal[name] for name in plan.lasting if plan.nominal[name] > 0}
    if not durations:
        return None
    try:
        slack = SlackPlan(plan, epsilon)
        first = next(slack.graph(durations).events(), None)
    except OutsideFragmentError:
        return None
    if first is None:
        return None
    ratio, stop = first
    box = Box.nominal(plan.parameters)
    for name, nominal in durations.items():
        box = box.replace(name, Interval(nominal * (1 - ratio), nominal * (1 + ratio)))
    known = proved is not None and all(box[name].is_within(proved[name]) for name in box.intervals)
    if not known and not is_inside(plan, box, epsilon, deadline, solver=solver):
        return None
    return Tolerance(ratio, True, tuple(_chain(plan, stop)))


def _chain(plan: model.ParametrizedPlan, stop: FaceStop) -> Iterator[str]:
    """The steps of a path or a circle, and what demands that it is no longer."""
    points = [plan.time_points[number] for number in stop.chain]
    steps = dict.fromkeys(point.instance for point in points if point.instance is not None)
    yield from (f"{str(plan.instance[step])[1:-1]} ({step})" for step in steps)
    tie = stop.ties[0]
    yield tie.statements[-1] if isinstance(tie, LinearForm) and tie.statements else tie.names[0]
