"""Times and effects: enc_tn, durations that no state decides, and what is known of the order of time points [IRR §2].

Both encodings start from here: what depends on times and parameters alone is said once. Equalities of the network are
solved instead of asserted: each time point is a linear expression over the parameters and the few time points that
nothing ties down. In plans whose schedule is fixed up to the parameters no time variable is left at all.

Mutex pairs of time points [Fox and Long 2003, §8] come from the effects of a plan by what they change.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

from robust.encode import interface
from robust.network.differences import DifferenceNetwork, Distances
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.smt.session import Formula, Terms

ZERO_RATE = Polynomial.constant(0)


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """An atom gets a truth value at `point` if `condition` held just before; no instance: a timed literal."""

    point: model.TimePoint
    value: bool
    condition: model.Condition
    instance: model.ActionInstance | None


@dataclass(frozen=True, slots=True)
class FluentWrite:
    """A fluent is assigned or increased at `point` if `condition` held just before; no instance: a timed literal."""

    point: model.TimePoint
    assigns: bool
    amount: model.Expression
    condition: model.Condition
    instance: model.ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect of an instance, with a rate other than zero."""

    instance: model.ActionInstance
    effect: model.ContinuousEffect


class Writes:
    """All effects of a plan: on atoms, on fluents in the order of the plan's time points, and continuous ones."""

    def __init__(self, plan: model.ParametrizedPlan) -> None:
        self.of_atom: dict[model.Atom, list[AtomWrite]] = defaultdict(list)
        self.of_fluent: dict[model.Fluent, list[FluentWrite]] = defaultdict(list)
        self.flows: dict[model.Fluent, list[Flow]] = defaultdict(list)
        for instance in plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                self.of_atom[effect.atom].append(AtomWrite(point, effect.value, effect.condition, instance))
            for numeric in instance.numeric_effects:
                point, assigns = instance.at(numeric.timing), numeric.operator is model.AssignmentKind.ASSIGN
                write = FluentWrite(point, assigns, numeric.expression, numeric.condition, instance)
                self.of_fluent[numeric.fluent].append(write)
            for continuous in instance.continuous_effects:
                if continuous.rate != ZERO_RATE:
                    self.flows[continuous.fluent].append(Flow(instance, continuous))
        for literal in plan.timed_literals:
            match literal.target:
                case model.Atom():
                    timed = AtomWrite(literal.point, bool(literal.value), model.Truth(True), None)
                    self.of_atom[literal.target].append(timed)
                case model.Fluent():
                    amount: model.Expression = Polynomial.constant(Fraction(literal.value))
                    assigned = FluentWrite(literal.point, True, amount, model.Truth(True), None)
                    self.of_fluent[literal.target].append(assigned)
        rank = {point: index for index, point in enumerate(plan.time_points)}
        for writes in self.of_fluent.values():
            writes.sort(key=lambda write: rank[write.point])

    def changes(self, fluent: model.Fluent) -> bool:
        """Whether anything in the plan changes the fluent."""
        return fluent in self.of_fluent or fluent in self.flows


def mutex_pairs(plan: model.ParametrizedPlan) -> tuple[tuple[model.TimePoint, model.TimePoint], ...]:
    """The time points that must be ε apart, in the plan's order: PDDL 2.1's rule of no moving targets.

    Reads are all that a text mentions, even where it cancels; over-all conditions are no reads; a continuous effect
    writes at both ends of its action; increases and decreases of one fluent commute.
    """
    rank = {point: index for index, point in enumerate(plan.time_points)}
    pairs = {
        (min(pair, key=rank.__getitem__), max(pair, key=rank.__getitem__))
        for pair in _conflicts(plan)
        if pair[0] != pair[1] and not all(point.kind is model.TimePointKind.TIMED_LITERAL for point in pair)
    }
    return tuple(sorted(pairs, key=lambda pair: (rank[pair[0]], rank[pair[1]])))


def _conflicts(plan: model.ParametrizedPlan) -> Iterator[tuple[model.TimePoint, model.TimePoint]]:
    writes = Writes(plan)
    readers = defaultdict[model.Atom | model.Fluent, set[model.TimePoint]](set)
    flowing = defaultdict[model.Fluent, set[model.TimePoint]](set)
    for instance in plan.instances:
        for name, points in reads(instance):
            readers[name].update(points)
        for continuous in instance.continuous_effects:
            flowing[continuous.fluent].update(instance.time_points)
    for atom, changes in writes.of_atom.items():
        adders = {write.point for write in changes if write.value}
        deleters = {write.point for write in changes if not write.value}
        yield from product(adders, deleters)
        yield from product(adders | deleters, readers[atom])
    for fluent in writes.of_fluent | flowing:
        discrete = writes.of_fluent.get(fluent, [])
        touched = {write.point for write in discrete} | flowing[fluent]
        yield from product({write.point for write in discrete if write.assigns}, touched)
        yield from product(touched, readers[fluent])


def reads(instance: model.ActionInstance) -> Iterator[tuple[model.Atom | model.Fluent, tuple[model.TimePoint, ...]]]:
    """The atoms and fluents that an instance reads, with the time points of the reads."""
    for part in instance.parts:
        if part.timing is not model.Timing.OVER_ALL:
            for name in model.names_in(part.condition):
                yield name, (instance.at(part.timing),)
    for numeric in instance.numeric_effects:
        for fluent in model.fluents_in(numeric.expression):
            yield fluent, (instance.at(numeric.timing),)
    for continuous in instance.continuous_effects:
        for fluent in model.fluents_in(continuous.rate):
            yield fluent, instance.time_points
    for name, point in instance.mentioned():
        yield name, (point,)


def changes(plan: model.ParametrizedPlan) -> Iterator[tuple[model.Atom | model.Fluent, model.TimePoint]]:
    """The atoms and fluents that a plan may change, with the time points of the changes."""
    for instance in plan.instances:
        for effect in instance.atom_effects:
            yield effect.atom, instance.at(effect.timing)
        for numeric in instance.numeric_effects:
            yield numeric.fluent, instance.at(numeric.timing)
        for continuous in instance.continuous_effects:
            for point in instance.time_points:
                yield continuous.fluent, point
    for literal in plan.timed_literals:
        yield literal.target, literal.point


Bound = tuple[model.TimePoint, model.TimePoint, Fraction]
"""(a, b, w): t_b − t_a ≥ w."""


@dataclass(frozen=True, slots=True)
class Difference:
    """`t_target − t_source ≥ weight`, weight over parameters, with the statements that it is the sum of.

    `is_default` marks `t_τ ≥ 0`, which holds for every time point unsaid.
    """

    source: model.TimePoint
    target: model.TimePoint
    weight: interface.Linear
    origins: tuple[str, ...]
    is_default: bool = False


@dataclass(frozen=True, slots=True)
class Inequality:
    """`expression ≥ 0` with the statement that it comes from; for `t_τ ≥ 0`, which τ."""

    expression: interface.Linear
    origins: tuple[str, ...]
    not_before_zero: model.TimePoint | None = None

    def as_difference(self) -> Difference:
        """Between the free time points that it mentions, at most two and of opposite sign, or one of them and zero."""
        source = target = model.ZERO
        weight = interface.constant(-self.expression.constant_term)
        for unknown, factor in self.expression.coefficients():
            if not isinstance(unknown, interface.TimeVariable):
                weight -= interface.variable(unknown).scaled(factor)
            elif factor < 0:
                source = unknown.point
            else:
                target = unknown.point
        return Difference(source, target, weight, self.origins)


class TemporalNetwork:
    """The network of a plan, with its rigid part solved.

    `places` gives every time point as a linear expression; `differences` is the whole network as lower bounds;
    `inequalities` is what remains to be asserted: together with the definitions in `places` it is enc_tn.
    """

    def __init__(self, plan: model.ParametrizedPlan) -> None:
        self.plan = plan
        self.ranges = declared_ranges(plan)
        self.differences = tuple(differences_of(plan))
        self.places = _places(plan)

    @cached_property
    def inequalities(self) -> tuple[Inequality, ...]:
        """What remains to be asserted of the network beside :attr:`places`."""
        return tuple(self._inequalities())

    def distance(self, source: model.TimePoint, target: model.TimePoint) -> interface.Linear:
        """t_target − t_source."""
        return self.places[target] - self.places[source]

    def slack(self, difference: Difference) -> interface.Linear:
        """What must be at least zero for the difference to hold."""
        return self.distance(difference.source, difference.target) - difference.weight

    def bounds(self, differences: Iterable[Difference]) -> Iterator[Bound]:
        """What the differences say for all declared parameter values, where they say anything."""
        return least_bounds(differences, self.ranges)

    def _inequalities(self) -> Iterator[Inequality]:
        # Said before unsaid: what is left out as implied must not be a statement of the plan.
        said = [Inequality(self.slack(d), d.origins) for d in self.differences if not d.is_default]
        unsaid = [Inequality(self.slack(d), d.origins, d.target) for d in self.differences if d.is_default]
        seen: set[interface.Linear] = set()
        for inequality in (*said, *unsaid, *self.bounds_of_parameters()):
            expression = inequality.expression
            trivial = expression.is_constant and expression.constant_term >= 0
            if not trivial and expression not in seen:
                seen.add(expression)
                yield inequality

    def bounds_of_parameters(self) -> Iterator[Inequality]:
        """The declared bounds."""
        for parameter in self.plan.parameters:
            value = interface.variable(model.ParameterReference(parameter.name))
            if parameter.lower is not None:
                yield Inequality(value - parameter.lower, (f"parameter {parameter.name} lb {parameter.lower}",))
            if parameter.upper is not None:
                yield Inequality(-value + parameter.upper, (f"parameter {parameter.name} ub {parameter.upper}",))


def declared_ranges(plan: model.ParametrizedPlan) -> dict[str, interface.Range]:
    """The declared bounds of parameters."""
    return {parameter.name: (parameter.lower, parameter.upper) for parameter in plan.parameters}


def least_bounds(differences: Iterable[Difference], ranges: Mapping[str, interface.Range]) -> Iterator[Bound]:
    """What differences say for all parameter values in these ranges, where they say anything."""
    for difference in differences:
        weight = interface.least(difference.weight, ranges)
        if weight is not None:
            yield difference.source, difference.target, weight


def differences_of(plan: model.ParametrizedPlan) -> Iterator[Difference]:
    """The whole network of a plan as lower bounds.

    Beside its statements, no time point is before zero, and timed literals happen at their times.
    """
    for point in plan.time_points[1:]:
        yield Difference(model.ZERO, point, interface.constant(0), (f"{point} ≥ 0",), is_default=True)
        if point.time is not None:
            time, origins = interface.constant(point.time), (f"timed initial literal {point}",)
            yield Difference(model.ZERO, point, time, origins)
            yield Difference(point, model.ZERO, -time, origins)
    for item in plan.constraints:
        origins = (str(item),)
        if item.lower is not None:
            yield Difference(item.source, item.target, interface.over_parameters(item.lower), origins)
        if item.upper is not None:
            yield Difference(item.target, item.source, -interface.over_parameters(item.upper), origins)


def _places(plan: model.ParametrizedPlan) -> dict[model.TimePoint, interface.Linear]:
    """Tie time points together along equalities, breadth first from zero, then from each point not reached yet."""
    ties: dict[model.TimePoint, list[tuple[model.TimePoint, interface.Linear]]] = {
        point: [] for point in plan.time_points
    }
    equalities = [
        (model.ZERO, point, interface.constant(point.time)) for point in plan.time_points if point.time is not None
    ]
    for item in plan.constraints:
        if item.lower is not None and item.lower == item.upper:
            equalities.append((item.source, item.target, interface.over_parameters(item.lower)))
    for source, target, length in equalities:
        ties[source].append((target, length))
        ties[target].append((source, -length))
    places: dict[model.TimePoint, interface.Linear] = {}
    for root in plan.time_points:
        if root not in places:
            places[root] = (
                interface.constant(0) if root == model.ZERO else interface.variable(interface.TimeVariable(root))
            )
            component = [root]
            for point in component:
                for neighbour, length in ties[point]:
                    if neighbour not in places:
                        places[neighbour] = places[point] + length
                        component.append(neighbour)
    return places


# -- durations that depend on no state --------------------------------------------------------------------------------

_LENGTH = interface.Auxiliary("duration", 0)


@dataclass(frozen=True, slots=True)
class DurationRule:
    """A duration constraint that does not depend on the state.

    `bounds` are the lower bounds between start and end that follow from it; together they say all of it if `exact`.
    """

    name: str
    instance: model.ActionInstance
    condition: model.NumericCondition
    bounds: tuple[Difference, ...]
    exact: bool


def is_never_negative(slack: interface.Linear) -> bool:
    """Whether equalities of the network alone keep the inequality that has this slack."""
    return slack.is_constant and slack.constant_term >= 0


def duration_rules(plan: model.ParametrizedPlan, writes: Writes) -> Iterator[DurationRule]:
    """The rules of all durative instances: not negative, and what the domain says of `?duration`."""
    positive = model.NumericCondition(Polynomial.variable(model.Duration()), model.Relation.AT_LEAST)
    for instance in plan.instances:
        if instance.durative:
            yield _rule(plan, f"{instance.identifier} {instance.action}: non-negative duration", instance, positive)
            for duration in instance.durations:
                if not any(map(writes.changes, model.fluents_in(duration.condition.expression))):
                    yield _rule(plan, instance.label(duration), instance, duration.condition)


def _rule(
    plan: model.ParametrizedPlan, name: str, instance: model.ActionInstance, condition: model.NumericCondition
) -> DurationRule:
    def value(unknown: model.NumericVariable) -> interface.Linear:
        match unknown:
            case model.Duration():
                return interface.variable(_LENGTH)
            case model.ParameterReference():
                return interface.variable(unknown)
            case model.Fluent():
                return interface.initial_value(plan, unknown)

    expression = condition.expression.substitute(value)
    factor, relation = expression.terms.get((_LENGTH,), Fraction(0)), condition.relation
    if not factor or not expression.is_linear or relation is model.Relation.DIFFERENT:
        return DurationRule(name, instance, condition, (), False)
    limit = interface.variable(_LENGTH) - expression.scaled(1 / factor)
    bounds = []
    if factor > 0 or relation is model.Relation.EQUAL:
        bounds.append(Difference(instance.start, instance.end, limit, (name,)))
    if factor < 0 or relation is model.Relation.EQUAL:
        bounds.append(Difference(instance.end, instance.start, -limit, (name,)))
    return DurationRule(name, instance, condition, tuple(bounds), relation is not model.Relation.GREATER)


# -- what is known of the order ----------------------------------------------------------------------------------------


class Orders(Distances[model.TimePoint]):
    """Greatest known lower bounds between time points; more bounds, of given weights, may be learnt."""

    @property
    def consistent(self) -> bool:
        """False if the bounds contradict each other; they mean nothing then."""
        return self.network.schedule is not None

    def least(self, source: model.TimePoint, target: model.TimePoint) -> Fraction | None:
        """The greatest known w with t_target − t_source ≥ w; None if nothing is known."""
        return super().least(source, target) if self.consistent else None

    def learn(self, source: model.TimePoint, target: model.TimePoint, weight: Fraction) -> bool:
        """Add t_target − t_source ≥ weight and its consequences.

        Returns False, and changes nothing, if that was known or contradicts what is known.
        """
        bound = self.in_units(source, target, weight)
        if not self.consistent or self.network.at_least(*bound):
            return False
        back = self.network.least(bound[1], bound[0])
        if back is not None and back + bound[2] > 0:
            return False
        self.bounds.append(bound)
        self.network = DifferenceNetwork(len(self.index), self.bounds)
        return True

    def separate(
        self, pairs: Iterable[tuple[model.TimePoint, model.TimePoint]], epsilon: Fraction
    ) -> Iterator[tuple[model.TimePoint, model.TimePoint]]:
        """Learn that pairs are `epsilon` apart where their order is known up to less; repeat until nothing is new.

        Yields the earlier and the later of such a pair.
        """
        ordered = [pair for first, second in pairs for pair in ((first, second), (second, first))]
        learning = True
        while learning:
            learning = False
            for first, second in ordered:
                known = self.least(first, second)
                if known is not None and -epsilon < known < epsilon:
                    learning |= self.learn(first, second, epsilon)
                    yield first, second

    def surely_before(self, first: model.TimePoint, second: model.TimePoint) -> bool:
        """Whether t_first < t_second in every schedule."""
        return self.consistent and self.network.at_least(self.index[first], self.index[second], 1)

    def surely_not_after(self, first: model.TimePoint, second: model.TimePoint) -> bool:
        """Whether t_first ≤ t_second in every schedule."""
        return self.consistent and self.network.at_least(self.index[first], self.index[second], 0)


class IndependentParts:
    """A conjunction of `expression ≥ 0` split into parts that share no unknown."""

    def __init__(self, terms: Terms, expressions: Iterable[interface.Linear]) -> None:
        self._terms = terms
        self._leader: dict[str, str] = {}
        expressions = list(dict.fromkeys(expressions))
        for expression in expressions:
            names = [str(unknown) for unknown in expression.variables]
            for name in names:
                self._join(names[0], name)
        self._parts: dict[str, list[Formula]] = defaultdict(list)
        for expression in expressions:
            formula = terms.at_least(expression)
            name = next((str(unknown) for unknown in expression.variables), "")
            self._parts[self._find(name)].append(formula)

    def touching(self, formulas: Iterable[Formula]) -> list[Formula]:
        """The inequalities of every part that shares an unknown with the formulas, and those without unknowns."""
        names = {symbol.symbol_name() for formula in formulas for symbol in self._terms.variables(formula)}
        leaders = dict.fromkeys([self._find(""), *(self._find(name) for name in sorted(names))])
        return [formula for leader in leaders for formula in self._parts.get(leader, ())]

    def _find(self, name: str) -> str:
        while (leader := self._leader.get(name, name)) != name:
            self._leader[name] = self._leader.get(leader, leader)
            name = leader
        return name

    def _join(self, left: str, right: str) -> None:
        self._leader[self._find(left)] = self._find(right)
