"""Positions in the order of time points, and states over them: what is read, effects and continuous change [IRR §2].

Position 1 is the earliest time point's, position H the latest's; simultaneous time points keep the plan's order. The
choice is a Boolean per time point and position, "by then it has happened", so formulas stay polynomial and the solver
searches the orders.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import assert_never

from robust.encode.interface import Auxiliary, Case, Definitions, Linear, constant, initial_value, variable
from robust.encode.network import AtomWrite, Flow, FluentWrite, Orders, TemporalNetwork, Writes
from robust.errors import UnsupportedError
from robust.plan import model
from robust.smt.limits import Deadline
from robust.smt.session import Formula, Terms


class Positions:
    """Which time point has which position, and the time of each position.

    What `known` says of the order is taken as given: whoever asserts :meth:`axioms` asserts what it was learnt from.
    """

    def __init__(self, network: TemporalNetwork, known: Orders, terms: Terms) -> None:
        self._network = network
        self._known = known
        self._terms = terms
        self.points = network.plan.time_points[1:]
        self.last = len(self.points)
        """H."""
        self._rank = {point: index for index, point in enumerate(self.points)}
        self._first = {p: 1 + sum(self._surely_precedes(q, p) for q in self.points if q != p) for p in self.points}
        self._final = {
            p: self.last - sum(self._surely_precedes(p, q) for q in self.points if q != p) for p in self.points
        }
        self.by = cache(self._by)
        self.at = cache(self._at)
        self.candidates = cache(self._candidates)
        self.time = cache(self._time)
        self.same = cache(self._same)

    # -- the order -----------------------------------------------------------------------------------------------

    def _surely_precedes(self, first: model.TimePoint, second: model.TimePoint) -> bool:
        if self._rank[first] < self._rank[second]:
            return self._known.surely_not_after(first, second)
        return self._known.surely_before(first, second)

    def precedes(self, first: model.TimePoint, second: model.TimePoint) -> Formula:
        """Whether `first` has the earlier position: the order of times, and among equal times the plan's order."""
        if self._rank[first] > self._rank[second]:
            return self._terms.negation(self.precedes(second, first))
        if self._surely_precedes(first, second):
            return self._terms.true
        if self._surely_precedes(second, first):
            return self._terms.false
        return self._terms.at_least(self._network.distance(first, second))

    def _by(self, point: model.TimePoint, position: int) -> Formula:
        """Whether the time point has this position or an earlier one."""
        if position < self._first[point]:
            return self._terms.false
        if position >= self._final[point]:
            return self._terms.true
        return self._terms.fresh_boolean(f"[{point} by {position}]")

    def _at(self, point: model.TimePoint, position: int) -> Formula:
        """Whether the time point has this position."""
        return self._terms.conjunction((self.by(point, position), self._terms.negation(self.by(point, position - 1))))

    def _candidates(self, position: int) -> tuple[model.TimePoint, ...]:
        """The time points that may have a position."""
        return tuple(point for point in self.points if self._first[point] <= position <= self._final[point])

    # -- the times -----------------------------------------------------------------------------------------------

    def _time(self, position: int) -> Linear:
        """The time of a position."""
        candidates = self.candidates(position)
        if len(candidates) == 1:
            return self._network.places[candidates[0]]
        return variable(Auxiliary("time at position", position))

    def _same(self, position: int) -> Formula:
        """Whether a position has the time of the one before it: both belong to one happening."""
        if position == 1:
            return self._terms.false
        pairs = [(a, b) for a in self.candidates(position - 1) for b in self.candidates(position) if a != b]
        if all(self._known.surely_before(a, b) for a, b in pairs):
            return self._terms.false
        return self._terms.equal(self.time(position) - self.time(position - 1))

    def axioms(self, deadline: Deadline) -> Iterator[Formula]:
        """What ties positions to times, a formula per time point and per position.

        Positions that increase strictly along a total order of H time points and lie in 1…H are that order.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        for point in self.points:
            parts = [self._monotone(point)]
            for other in self.points[: self._rank[point]]:
                deadline.enforce()
                first = self.precedes(other, point)
                parts.append(self._terms.implication(first, self._strictly(other, point)))
                parts.append(self._terms.implication(self._terms.negation(first), self._strictly(point, other)))
            yield self._terms.conjunction(parts)
        for position in range(1, self.last + 1):
            deadline.enforce()
            yield self._terms.conjunction(self._timing(position))

    def _monotone(self, point: model.TimePoint) -> Formula:
        positions = range(self._first[point], self._final[point])
        return self._terms.conjunction(
            self._terms.implication(self.by(point, k), self.by(point, k + 1)) for k in positions
        )

    def _strictly(self, earlier: model.TimePoint, later: model.TimePoint) -> Formula:
        """The position of one time point is less than the other's."""
        positions = range(self._first[later], self._final[later] + 1)
        return self._terms.conjunction(
            self._terms.implication(self.by(later, k), self.by(earlier, k - 1)) for k in positions
        )

    def _timing(self, position: int) -> Iterator[Formula]:
        time = self.time(position)
        for point in self.candidates(position):
            here = self._terms.equal(time - self._network.places[point])
            yield self._terms.implication(self.at(point, position), here)
        if position > 1:
            yield self._terms.at_least(time - self.time(position - 1))


@dataclass(frozen=True, slots=True)
class PositionState:
    """The written atoms and fluents that matter at one moment; the others keep their initial values."""

    atoms: Mapping[model.Atom, Formula]
    fluents: Mapping[model.Fluent, Linear]


class Reader:
    """Evaluates conditions and expressions of a plan in states."""

    def __init__(self, plan: model.ParametrizedPlan, network: TemporalNetwork, terms: Terms) -> None:
        self._plan = plan
        self._network = network
        self._terms = terms

    def value(
        self, expression: model.Expression, state: PositionState, instance: model.ActionInstance | None
    ) -> Linear:
        """The value of an expression; `instance` is the one whose `?duration` it mentions."""

        def value(name: model.NumericVariable) -> Linear:
            match name:
                case model.Fluent():
                    known = state.fluents.get(name)
                    return initial_value(self._plan, name) if known is None else known
                case model.ParameterReference():
                    return variable(name)
                case model.Duration() if instance is None:
                    raise UnsupportedError("?duration has no meaning outside a durative action")
                case model.Duration():
                    return self._network.distance(instance.start, instance.end)
            assert_never(name)

        return expression.substitute(value)

    def holds(
        self,
        condition: model.Condition,
        state: PositionState,
        instance: model.ActionInstance | None = None,
        leaf: Callable[[model.NumericCondition], Formula | None] = lambda _: None,
    ) -> Formula:
        """The truth of a condition; where `leaf` returns a formula, it stands for that comparison's truth."""
        match condition:
            case model.Truth(value):
                return self._terms.truth(value)
            case model.Holds(atom, value):
                truth = state.atoms.get(atom, self._terms.truth(atom in self._plan.initial_atoms))
                return truth if value else self._terms.negation(truth)
            case model.NumericCondition(expression, relation):
                replaced = leaf(condition)
                if replaced is not None:
                    return replaced
                return self._terms.compare(self.value(expression, state, instance), relation)
            case model.And(operands):
                return self._terms.conjunction(self.holds(part, state, instance, leaf) for part in operands)
            case model.Or(operands):
                return self._terms.disjunction(self.holds(part, state, instance, leaf) for part in operands)
        assert_never(condition)


def relevant_fluents(plan: model.ParametrizedPlan, writes: Writes) -> tuple[model.Fluent, ...]:
    """The fluents that are both written and read: nothing depends on the values of others."""
    read = set(_fluents_read(plan))
    return tuple(f for f in dict.fromkeys((*writes.of_fluent, *writes.flows)) if f in read)


def _fluents_read(plan: model.ParametrizedPlan) -> Iterator[model.Fluent]:
    conditions: list[model.Condition] = [goal.condition for goal in plan.goal]
    for instance in plan.instances:
        conditions += [part.condition for part in instance.parts]
        for numeric in instance.numeric_effects:
            yield from model.fluents_in(numeric.expression)
    for condition in conditions:
        for comparison in model.comparisons(condition):
            yield from model.fluents_in(comparison.expression)


@dataclass(frozen=True)
class Setting:
    """What formulas about states are made of."""

    plan: model.ParametrizedPlan
    network: TemporalNetwork
    known: Orders
    positions: Positions
    writes: Writes
    reader: Reader
    definitions: Definitions

    @property
    def terms(self) -> Terms:
        return self.definitions.terms


class Flows:
    """What continuous effects contribute, step by step; step k leads from position k to position k + 1."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._terms = setting.terms
        self._positions = setting.positions
        self._definitions = setting.definitions
        self._rate = cache(self._rate_of)
        self._sofar = cache(self._sofar_at)

    def acts(self, instance: model.ActionInstance, step: int) -> Formula:
        """Whether a step lies between start and end of an instance."""
        ended = self._positions.by(instance.end, step)
        return self._terms.conjunction((self._positions.by(instance.start, step), self._terms.negation(ended)))

    def over_step(self, fluent: model.Fluent, step: int) -> Linear:
        """By how much a fluent changes in a step."""
        return self._change(fluent, step, "", lambda flow: self._contribution(flow, step))

    def until(self, fluent: model.Fluent, step: int, instant: Linear) -> Linear:
        """By how much a fluent changes from the beginning of a step until an instant inside it."""
        elapsed = instant - self._positions.time(step)
        return self._change(fluent, step, f" until {instant}", lambda flow: self._product(flow, elapsed))

    def _change(self, fluent: model.Fluent, step: int, until: str, amount: Callable[[Flow], Linear]) -> Linear:
        """What the flows that act in a step add to a fluent, each so much."""
        total = constant(0)
        for flow in self._setting.writes.flows.get(fluent, ()):
            acts = self.acts(flow.instance, step)
            if acts is not self._terms.false:
                name = f"{flow.instance.identifier} {fluent} in step {step}{until}"
                total += self._definitions.choice(name, [(acts, amount(flow))], constant(0))
        return total

    def _contribution(self, flow: Flow, step: int) -> Linear:
        if self._rate(flow).is_constant:
            length = self._positions.time(step + 1) - self._positions.time(step)
            return self._product(flow, length)
        return self._sofar(flow, step + 1) - self._sofar(flow, step)

    def _sofar_at(self, flow: Flow, position: int) -> Linear:
        """Rate times the time since the start, at a position from the start's to the end's; anything at others."""
        start, end = flow.instance.start, flow.instance.end
        cases: list[Case] = []
        for point in self._positions.candidates(position):
            if not (self._setting.known.surely_before(point, start) or self._setting.known.surely_before(end, point)):
                amount = self._product(flow, self._setting.network.distance(start, point))
                cases.append((self._positions.at(point, position), amount))
        name = f"{flow.instance.identifier} {flow.effect.fluent} until position {position}"
        return cases[0][1] if len(cases) == 1 else self._definitions.partial(name, cases)

    def _product(self, flow: Flow, time: Linear) -> Linear:
        amount = self._rate(flow) * time
        if not amount.is_linear:
            raise UnsupportedError(
                f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                f"{flow.effect.fluent}: rate {flow.effect.rate} times an elapsed time that is not constant; "
                "expected a constant rate, or a fixed schedule"
            )
        return amount

    def _rate_of(self, flow: Flow) -> Linear:
        for fluent in model.fluents_in(flow.effect.rate):
            if self._setting.writes.changes(fluent):
                raise UnsupportedError(
                    f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                    f"{flow.effect.fluent}: its rate reads {fluent}, which the plan changes; expected a constant rate"
                )
        return self._setting.reader.value(flow.effect.rate, PositionState({}, {}), flow.instance)


@dataclass(slots=True)
class _Happening:
    """What the happening so far has done to one position: its effects before they are applied."""

    added: dict[model.Atom, Formula] = field(default_factory=dict)
    deleted: dict[model.Atom, Formula] = field(default_factory=dict)
    base: dict[model.Fluent, Linear] = field(default_factory=dict)
    """The last value assigned, or the value before."""
    increase: dict[model.Fluent, Linear] = field(default_factory=dict)


class Trajectory:
    """`before[k]`: the state that position k reads; `after[k]`: with the effects of its happening so far.

    `after[0]` is the initial state; before a time between positions k and k + 1 the state is `after[k]` with
    continuous change.

    Raises:
        OutOfTimeError: if the deadline passes.
    """

    def __init__(self, setting: Setting, deadline: Deadline) -> None:
        self._terms = setting.terms
        self._positions = setting.positions
        self._writes = writes = setting.writes
        self._reader = setting.reader
        self._definitions = setting.definitions
        self.setting = setting
        self.flows = Flows(setting)
        self._fluents = relevant_fluents(setting.plan, writes)
        initial = PositionState(
            {atom: self._terms.truth(atom in setting.plan.initial_atoms) for atom in writes.of_atom},
            {fluent: initial_value(setting.plan, fluent) for fluent in self._fluents},
        )
        self.before: list[PositionState] = [initial]
        self.after: list[PositionState] = [initial]
        happening = _Happening()
        for position in range(1, setting.positions.last + 1):
            deadline.enforce()
            self.before.append(self._before(position))
            happening = self._happening(position, happening)
            self.after.append(self._after(position, happening))

    @property
    def final(self) -> PositionState:
        """The state after all time points."""
        return self.after[-1]

    # -- steps ---------------------------------------------------------------------------------------------------

    def _before(self, position: int) -> PositionState:
        """Frame axioms, with continuous change; within a happening, the state before its first position."""
        same, previous = self._positions.same(position), self.before[-1]
        left = self.after[-1]
        atoms = {atom: self._if(same, previous.atoms[atom], truth) for atom, truth in left.atoms.items()}
        fluents = {}
        for fluent, value in left.fluents.items():
            arrived = value + self.flows.over_step(fluent, position - 1)
            name = f"{fluent} before position {position}"
            fluents[fluent] = self._definitions.choice(name, [(same, previous.fluents[fluent])], arrived)
        named = {a: self._definitions.truth(f"{a} before position {position}", t) for a, t in atoms.items()}
        return PositionState(named, fluents)

    def _after(self, position: int, happening: _Happening) -> PositionState:
        before = self.before[position]
        atoms = {}
        for atom, truth in before.atoms.items():
            kept = self._terms.conjunction((truth, self._terms.negation(happening.deleted[atom])))
            after = self._terms.disjunction((happening.added[atom], kept))
            atoms[atom] = self._definitions.truth(f"{atom} after position {position}", after)
        return PositionState(
            atoms, {fluent: base + happening.increase[fluent] for fluent, base in happening.base.items()}
        )

    # -- effects -------------------------------------------------------------------------------------------------

    def _happening(self, position: int, sofar: _Happening) -> _Happening:
        """The effects of a position, together with those of earlier positions of the same time."""
        same, before = self._positions.same(position), self.before[position]
        result = _Happening()
        for atom, writes in self._writes.of_atom.items():
            fired = [(write.value, self._fired(write, position)) for write in writes]
            for value, effects, old in ((True, result.added, sofar.added), (False, result.deleted, sofar.deleted)):
                already = self._terms.conjunction((same, old.get(atom, self._terms.false)))
                here = self._terms.disjunction(happens for written, happens in fired if written is value)
                effects[atom] = self._terms.disjunction((already, here))
        for fluent in self._fluents:
            effects_here = self._writes.of_fluent.get(fluent, ())
            increases = [write for write in effects_here if not write.assigns]
            assignments = [write for write in effects_here if write.assigns]
            old_base = sofar.base.get(fluent, before.fluents[fluent])
            base = before.fluents[fluent]
            if assignments:
                name = f"{fluent} assigned until position {position}"
                base = self._definitions.choice(name, [(same, old_base)], base)
            result.base[fluent] = self._assigned(fluent, assignments, position, base)
            old_increase = sofar.increase.get(fluent, constant(0))
            name = f"{fluent} increased until position {position}"
            result.increase[fluent] = self._definitions.choice(name, [(same, old_increase)], constant(0))
            result.increase[fluent] += self._increased(fluent, increases, position)
        return result

    def _fired(self, write: AtomWrite | FluentWrite, position: int) -> Formula:
        """Whether a write takes place at a position."""
        here = self._positions.at(write.point, position)
        if here is self._terms.false:
            return here
        condition = self._reader.holds(write.condition, self.before[position], write.instance)
        return self._terms.conjunction((here, condition))

    def _assigned(
        self, fluent: model.Fluent, assignments: list[FluentWrite], position: int, otherwise: Linear
    ) -> Linear:
        """The value of the last assignment of a position that takes place; `otherwise` if none does."""
        cases: list[Case] = []
        later: Formula = self._terms.false
        for write in reversed(assignments):
            fired = self._fired(write, position)
            if fired is not self._terms.false:
                last = self._terms.conjunction((fired, self._terms.negation(later)))
                cases.append((last, self._amount(write, position)))
                later = self._terms.disjunction((fired, later))
        cases.append((self._terms.negation(later), otherwise))
        return self._definitions.choice(f"{fluent} assigned at position {position}", cases)

    def _increased(self, fluent: model.Fluent, increases: list[FluentWrite], position: int) -> Linear:
        total = constant(0)
        for write in increases:
            fired = self._fired(write, position)
            if fired is not self._terms.false:
                name = f"{fluent} increased at position {position}"
                total += self._definitions.choice(name, [(fired, self._amount(write, position))], constant(0))
        return total

    def _amount(self, write: FluentWrite, position: int) -> Linear:
        return self._reader.value(write.amount, self.before[position], write.instance)

    def _if(self, condition: Formula, then: Formula, otherwise: Formula) -> Formula:
        if then is otherwise:
            return then
        conjunction, negation = self._terms.conjunction, self._terms.negation
        return self._terms.disjunction((conjunction((condition, then)), conjunction((negation(condition), otherwise))))
