"""Obligations that shortest paths prove: no solver is needed for what the order of time points settles.

No-moving-targets orders every reader of an atom or fluent against every writer of it, and contrary writers against each
other. Where the network keeps all these orders, a name has the same history in every schedule: by induction over time,
whatever is read at starts, at ends and by the goal is what it is in any one of them. So one run through the plan and
the orders prove all of it, as long as no amount depends on a parameter, on a duration that varies or on continuous
change. What does is unsteady, and so is all that is computed from it.

Over-all conditions are no readers, so their writers need not be ordered against them. A literal p over (s, e) holds in
all schedules iff t_s ≥ t_e in all of them, or each contrary writer d has t_d ≥ t_e in all of them or a supporter g
after d with t_g ≤ t_s in all of them; what is false initially counts as a contrary writer before everything.

Parameters count with all values that their declared bounds allow, so what is proved here is proved for every box.
"""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby, pairwise, product

from robust.encode import network
from robust.network.differences import DifferenceNetwork, Distances, reachable
from robust.plan import model
from robust.plan.polynomial import Polynomial

Name = model.Atom | model.Fluent
FINALLY = -1
"""The point after all others."""


@dataclass(frozen=True, slots=True)
class Write:
    """What one effect does to a name at a point, if its condition holds; `amount` is a truth value or an expression."""

    point: int
    name: Name
    amount: bool | model.Expression
    assigns: bool
    condition: model.Condition
    instance: int | None


class Accesses:
    """The reads and writes of a plan, by number of the time point; over-all conditions read nothing.

    `starts` and `ends` are those of the instances, by their number. `moving` are the fluents that change continuously.
    """

    def __init__(self, plan: model.ParametrizedPlan) -> None:
        self.plan = plan
        self.index = {point: number for number, point in enumerate(plan.time_points)}
        self.starts = [self.index[instance.start] for instance in plan.instances]
        self.ends = [self.index[instance.end] for instance in plan.instances]
        self.readers: dict[Name, set[int]] = defaultdict(set)
        self.writes: dict[Name, list[Write]] = defaultdict(list)
        self.moving = {change.fluent for instance in plan.instances for change in instance.continuous_effects}
        for number, instance in enumerate(plan.instances):
            for name, points in network.reads(instance):
                self.readers[name].update(self.index[point] for point in points)
            self._write(number, instance)
        for literal in plan.timed_literals:
            value = literal.value
            amount = value if isinstance(value, bool) else Polynomial.constant(value)
            write = Write(self.index[literal.point], literal.target, amount, True, model.Truth(True), None)
            self.writes[literal.target].append(write)

    def _write(self, number: int, instance: model.ActionInstance) -> None:
        for added in instance.atom_effects:
            point = self.index[instance.at(added.timing)]
            self.writes[added.atom].append(Write(point, added.atom, added.value, True, added.condition, number))
        for effect in instance.numeric_effects:
            point, assigns = self.index[instance.at(effect.timing)], effect.operator is model.AssignmentKind.ASSIGN
            write = Write(point, effect.fluent, effect.expression, assigns, effect.condition, number)
            self.writes[effect.fluent].append(write)


class Settled:
    """What the orders of a network prove of a plan.

    Args:
        plan: the ground plan.
        paths: its network, whose points are the plan's time points by number; it must have a schedule.
        scale: how many units of the network are one unit of time.
        apart: the separation of mutex points in units of the network.
    """

    def __init__(self, plan: model.ParametrizedPlan, paths: DifferenceNetwork, scale: int, apart: int) -> None:
        self.plan = plan
        self.paths = paths
        self._scale = scale
        self._apart = max(apart, 1)
        """What orders and separates two points: where ε is 0 they must not be at the same time either."""
        self.accesses = Accesses(plan)
        if paths.schedule is None:
            raise ValueError("a network without schedule settles nothing")
        self._times = paths.schedule
        self.unsteady = self._all_unsteady()
        durations = [self._duration(number) for number in range(len(plan.instances))]
        self.history = _History(plan, self.accesses.writes, self.unsteady, self._times, durations)

    # -- which names have one history ----------------------------------------------------------------------------------

    def _all_unsteady(self) -> set[Name]:
        accesses = self.accesses
        unsteady: set[Name] = set(accesses.moving)
        unsteady.update(
            name for name in accesses.writes if isinstance(name, model.Fluent) and name not in self.plan.initial_fluents
        )
        unsteady.update(name for name in accesses.writes if not self._is_ordered(name))
        unsteady.update(fluent for fluent, value in self.plan.initial_fluents.items() if not value.is_constant)
        readers: dict[Name, list[Name]] = defaultdict(list)
        for name, writes in accesses.writes.items():
            for write in writes:
                expression = None if isinstance(write.amount, bool) else write.amount
                for read in (*model.names_in(write.condition), *(model.fluents_in(expression) if expression else ())):
                    readers[read].append(name)
                if not self._is_known(write.condition, write.instance, expression):
                    unsteady.add(name)
        return reachable(readers, *unsteady)

    def _is_ordered(self, name: Name) -> bool:
        """Whether all points that may not touch a name at the same time are apart, each pair in one order."""
        return all(self._are_apart(*pair) for pair in self.neighbours(name))

    def neighbours(self, name: Name) -> Iterator[tuple[int, int]]:
        """Pairs of points, the earlier one first, that must be apart because of a name; if they are, all of them are.

        Accesses by time are cut into runs that commute: reads, adds, deletes, increases. If each is apart from the
        next run, all of them are.
        """
        kinds = self._kinds(name)
        runs: list[list[int]] = []
        last = ""
        for point in sorted(kinds, key=lambda number: (self._times[number], number)):
            if kinds[point] != last or last == "assign":
                runs.append([])
            last = kinds[point]
            runs[-1].append(point)
        return (pair for before, after in pairwise(runs) for pair in product(before, after))

    def _kinds(self, name: Name) -> dict[int, str]:
        """What each point does to a name; one that does several things commutes with nothing, like an assignment."""
        kinds: dict[int, str] = {}
        writes = self.accesses.writes[name]
        seen = [(write.point, _kind(write)) for write in writes]
        for point, kind in (*seen, *((point, "read") for point in self.accesses.readers.get(name, ()))):
            kinds[point] = kind if kinds.get(point, kind) == kind else "assign"
        return kinds

    def _are_apart(self, first: int, second: int) -> bool:
        points = self.plan.time_points
        if points[first].time is not None and points[second].time is not None:
            return True
        return self.paths.at_least(first, second, self._apart)

    def _is_known(
        self, condition: model.Condition, instance: int | None, expression: model.Expression | None = None
    ) -> bool:
        """Whether a condition and an expression mention nothing but fluents and durations that are fixed."""
        expressions = [comparison.expression for comparison in model.comparisons(condition)]
        if expression is not None:
            expressions.append(expression)
        variables = {
            variable for part in expressions for variable in part.variables if not isinstance(variable, model.Fluent)
        }
        return all(
            isinstance(variable, model.Duration) and self._duration(instance) is not None for variable in variables
        )

    def _are_steady(self, names: Iterable[Name]) -> bool:
        known = self.plan.initial_fluents
        return all(name not in self.unsteady and (isinstance(name, model.Atom) or name in known) for name in names)

    def _duration(self, instance: int | None) -> Fraction | None:
        """The duration of an instance if all schedules agree on it."""
        if instance is None:
            return None
        start, end = self.accesses.starts[instance], self.accesses.ends[instance]
        if self.paths.component[start] != self.paths.component[end]:
            return None
        return Fraction(self._times[end] - self._times[start], self._scale)

    # -- obligations ---------------------------------------------------------------------------------------------------

    def is_separated(self, first: int, second: int) -> bool:
        """Whether two points are ε apart, in one order in all schedules."""
        return any(self.paths.at_least(*pair, self._apart) for pair in ((first, second), (second, first)))

    def holds_at(self, condition: model.Condition, point: int, instance: int | None = None) -> bool:
        """Whether a condition that is read at a point, or FINALLY, holds there in all schedules."""
        if not self._is_known(condition, instance) or not self._are_steady(model.names_in(condition)):
            return False
        return self.history.before(point).holds(condition, self._duration(instance))

    def holds_duration(self, condition: model.NumericCondition, point: int, instance: int) -> bool:
        """Whether a constraint on the duration of an instance, whose fluents are read at a point, always holds."""
        expression = condition.expression
        fluents = set(model.fluents_in(expression))
        if not self._are_steady(fluents) or not expression.is_linear:
            return False
        if not all(isinstance(variable, model.Fluent | model.Duration) for variable in expression.variables):
            return False
        state = self.history.before(point)
        start, end = self.accesses.starts[instance], self.accesses.ends[instance]
        shortest, longest = self.paths.least(start, end), self.paths.least(end, start)
        first = None if shortest is None else state.value(expression, Fraction(shortest, self._scale))
        last = None if longest is None else state.value(expression, Fraction(-longest, self._scale))
        return _holds_between(condition.relation, expression.terms.get((model.Duration(),), Fraction(0)), first, last)

    def holds_throughout(self, condition: model.Condition, instance: int) -> bool:
        """Whether an over-all condition of an instance holds in all schedules."""
        start, end = self.accesses.starts[instance], self.accesses.ends[instance]
        if self.paths.at_least(end, start, 0):
            return True
        match condition:
            case model.Truth(value):
                return value
            case model.And(operands):
                return all(self.holds_throughout(operand, instance) for operand in operands)
            case model.Or(operands):
                return any(self.holds_throughout(operand, instance) for operand in operands)
            case model.Holds(atom, value):
                return atom not in self.unsteady and self._is_protected(atom, value, start, end)
            case model.NumericCondition():
                return self._is_kept(condition, instance, start, end)

    def _is_protected(self, atom: model.Atom, value: bool, start: int, end: int) -> bool:
        after = self.paths.at_least
        times, writes = self._times, self.history.truths.get(atom, {})
        supporters = [point for point, given in writes.items() if given is value and after(point, start, 0)]
        latest = max((times[point] for point in supporters), default=None)
        if latest is None and (atom in self.plan.initial_atoms) is not value:
            return False
        return all(
            given is value or (latest is not None and times[point] < latest) or after(end, point, 0)
            for point, given in writes.items()
        )

    def _is_kept(self, condition: model.NumericCondition, instance: int, start: int, end: int) -> bool:
        """A comparison, in all states between the writes that may come inside; each in order with each other."""
        fluents = set(model.fluents_in(condition.expression))
        if not self._is_known(condition, instance) or not self._are_steady(fluents):
            return False
        after = self.paths.at_least
        inside: list[int] = []
        before: set[int] = set()
        for point in {write.point for fluent in fluents for write in self.accesses.writes.get(fluent, ())}:
            if after(point, start, 0):
                before.add(point)
            elif not after(end, point, 0):
                if not after(start, point, 0) or not after(point, end, 0):
                    return False
                inside.append(point)
        inside.sort(key=self._times.__getitem__)
        if not all(after(first, second, 0) for first, second in pairwise(inside)):
            return False
        duration = self._duration(instance)
        for number in range(len(inside) + 1):
            past = before.union(inside[:number])
            if not self.history.among(past).holds(condition, duration):
                return False
        return True


@dataclass(frozen=True, slots=True)
class _State:
    """What the names that are steady are at some moment of every schedule."""

    truth: Callable[[model.Atom], bool]
    number: Callable[[model.Fluent], Fraction]

    def value(self, expression: model.Expression, duration: Fraction | None) -> Fraction:
        values: dict[model.NumericVariable, Fraction] = {}
        for variable in expression.variables:
            if isinstance(variable, model.Fluent):
                values[variable] = self.number(variable)
            elif isinstance(variable, model.Duration) and duration is not None:
                values[variable] = duration
        return expression.evaluate(values)

    def holds(self, condition: model.Condition, duration: Fraction | None) -> bool:
        match condition:
            case model.Truth(value):
                return value
            case model.Holds(atom, value):
                return self.truth(atom) is value
            case model.NumericCondition(expression, relation):
                return relation.holds(self.value(expression, duration))
            case model.And(operands):
                return all(self.holds(operand, duration) for operand in operands)
            case model.Or(operands):
                return any(self.holds(operand, duration) for operand in operands)


class _History:
    """What becomes of the steady names, in any one schedule and so in all of them.

    `truths` are the values that atoms are given, by point: of effects whose condition holds; an add wins over a delete
    at the same point.
    """

    def __init__(
        self,
        plan: model.ParametrizedPlan,
        writes: Mapping[Name, Sequence[Write]],
        unsteady: Set[Name],
        times: Sequence[int],
        durations: Sequence[Fraction | None],
    ) -> None:
        self.truths: dict[model.Atom, dict[int, bool]] = defaultdict(dict)
        self._plan = plan
        self._times = times
        self._amounts: dict[model.Fluent, list[tuple[int, bool, Fraction]]] = defaultdict(list)
        self._moments: dict[Name, list[int]] = defaultdict(list)
        """The times at which a name is written, and beside them what it is from then on."""
        self._truths_after: dict[model.Atom, list[bool]] = defaultdict(list)
        self._numbers_after: dict[model.Fluent, list[Fraction]] = defaultdict(list)
        steady = (write for name, written in writes.items() if name not in unsteady for write in written)
        # In the order of time, and at one point assignments before increases.
        ordered = sorted(steady, key=lambda write: (times[write.point], not write.assigns))
        for _, simultaneous in groupby(ordered, key=lambda write: times[write.point]):
            self._take_place(list(simultaneous), durations)

    def _take_place(self, writes: Sequence[Write], durations: Sequence[Fraction | None]) -> None:
        """Writes of one time, which all read the state just before."""
        state = self.before(writes[0].point)
        done: list[tuple[Write, bool | Fraction]] = []
        for write in writes:
            duration = None if write.instance is None else durations[write.instance]
            if write.condition == model.Truth(True) or state.holds(write.condition, duration):
                read = write.amount
                done.append((write, read if isinstance(read, bool) else state.value(read, duration)))
        for write, amount in done:
            if isinstance(write.name, model.Atom):
                given = self.truths[write.name]
                given[write.point] = bool(amount) or given.get(write.point, False)
                self._truths_after[write.name].append(given[write.point])
            else:
                old = Fraction(0) if write.assigns else self._number(write.name, len(self._moments[write.name]))
                self._amounts[write.name].append((write.point, write.assigns, Fraction(amount)))
                self._numbers_after[write.name].append(old + amount)
            self._moments[write.name].append(self._times[write.point])

    def _number(self, fluent: model.Fluent, count: int) -> Fraction:
        """A fluent after its first writes, as many as are said."""
        return self._numbers_after[fluent][count - 1] if count else self._initially(fluent)

    def _initially(self, fluent: model.Fluent) -> Fraction:
        return self._plan.initial_fluents[fluent].constant_term

    def before(self, point: int) -> _State:
        """The state that a point reads; FINALLY, the last one."""

        def count(name: Name) -> int:
            moments = self._moments.get(name, ())
            return len(moments) if point == FINALLY else bisect_left(moments, self._times[point])

        def truth(atom: model.Atom) -> bool:
            past = count(atom)
            return self._truths_after[atom][past - 1] if past else atom in self._plan.initial_atoms

        return _State(truth, lambda fluent: self._number(fluent, count(fluent)))

    def among(self, points: Set[int]) -> _State:
        """The fluents when just the writes of these points have taken place; it says nothing of atoms."""

        def number(fluent: model.Fluent) -> Fraction:
            value = self._initially(fluent)
            for point, assigns, amount in self._amounts.get(fluent, ()):
                if point in points:
                    value = amount if assigns else value + amount
            return value

        return _State(lambda atom: atom in self._plan.initial_atoms, number)


def _kind(write: Write) -> str:
    if isinstance(write.amount, bool):
        return "add" if write.amount else "delete"
    return "assign" if write.assigns else "increase"


def _holds_between(relation: model.Relation, slope: Fraction, first: Fraction | None, last: Fraction | None) -> bool:
    """Whether a linear function holds between two ends of its variable, where it is given; None is infinitely far."""
    if slope == 0:
        value = first if first is not None else last
        return value is not None and relation.holds(value)
    low, high = (first, last) if slope > 0 else (last, first)
    match relation:
        case model.Relation.AT_LEAST:
            return low is not None and low >= 0
        case model.Relation.GREATER:
            return low is not None and low > 0
        case model.Relation.EQUAL:
            return low == high == 0
        case model.Relation.DIFFERENT:
            return (low is not None and low > 0) or (high is not None and high < 0)


def settle(plan: model.ParametrizedPlan, epsilon: Fraction) -> Settled | None:
    """What the network of a plan settles, for all values of its parameters; None if it has no schedule."""
    bounds = network.least_bounds(network.differences_of(plan), network.declared_ranges(plan))
    distances = Distances(plan.time_points, bounds, [epsilon])
    paths, scale = distances.network, distances.scale
    if paths.schedule is None or paths.schedule[0] != 0:
        return None
    return Settled(plan, paths, scale, int(epsilon * scale))


def proved(
    plan: model.ParametrizedPlan, epsilon: Fraction, pairs: Iterable[tuple[model.TimePoint, model.TimePoint]]
) -> frozenset[str]:
    """The names of the obligations that shortest paths prove for all schedules and all declared parameter values.

    `pairs` are the mutex pairs of the plan.
    """
    settled = settle(plan, epsilon)
    return frozenset() if settled is None else frozenset(name for name, holds in _verdicts(settled, pairs) if holds)


def is_proved(
    plan: model.ParametrizedPlan, epsilon: Fraction, pairs: Iterable[tuple[model.TimePoint, model.TimePoint]]
) -> bool:
    """Whether shortest paths prove all obligations."""
    settled = settle(plan, epsilon)
    return settled is not None and all(holds for _, holds in _verdicts(settled, pairs))


def _verdicts(settled: Settled, pairs: Iterable[tuple[model.TimePoint, model.TimePoint]]) -> Iterator[tuple[str, bool]]:
    plan, index = settled.plan, settled.accesses.index
    for first, second in pairs:
        yield f"separation: {first}, {second}", settled.is_separated(index[first], index[second])
    for number, instance in enumerate(plan.instances):
        start, end = settled.accesses.starts[number], settled.accesses.ends[number]
        if instance.durative:
            name = f"{instance.identifier} {instance.action}: non-negative duration"
            yield name, settled.paths.at_least(start, end, 0)
        for duration in instance.durations:
            point = end if duration.timing is model.Timing.AT_END else start
            yield instance.label(duration), settled.holds_duration(duration.condition, point, number)
        for timed in instance.demands:
            if timed.timing is model.Timing.OVER_ALL:
                yield instance.label(timed), settled.holds_throughout(timed.condition, number)
            else:
                point = end if timed.timing is model.Timing.AT_END else start
                yield instance.label(timed), settled.holds_at(timed.condition, point, number)
    for goal in plan.goal:
        yield goal.label, settled.holds_at(goal.condition, FINALLY)
