"""The state of the relational encoding: truth of conditions and values of fluents at any moment of a plan.

An order atom `t_a < t_b` that the network decides for all parameter values is a constant here; the others become linear
atoms. All knowledge about the order of time points in the relational encoding comes through :class:`Clock`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from robust.encode.network import Orders, TemporalNetwork
from robust.encode.variables import Auxiliary, Linear, constant, variable
from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    ActionInstance,
    And,
    Assignment,
    Atom,
    Comparison,
    Condition,
    ContinuousEffect,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    ParameterReference,
    ParametrizedPlan,
    TimePoint,
    Truth,
)
from robust.plan.polynomial import Polynomial
from robust.smt.terms import Formula, Terms


class Side(Enum):
    BEFORE = "before"
    AFTER = "after"


@dataclass(frozen=True, slots=True)
class Moment:
    """Just before or just after all that happens at the time of a time point, or a free instant, or the very end.

    With neither `point` nor `instant` it is the state after all time points.
    """

    side: Side
    point: TimePoint | None = None
    instant: Auxiliary | None = None

    def __str__(self) -> str:
        if self.instant is not None:
            return f"{self.side.value} {self.instant}"
        return f"{self.side.value} {self.point}" if self.point else "finally"


FINALLY = Moment(Side.AFTER)


def before(point: TimePoint) -> Moment:
    return Moment(Side.BEFORE, point)


def after(point: TimePoint) -> Moment:
    return Moment(Side.AFTER, point)


class Clock:
    """Order atoms under what is known of the network."""

    def __init__(self, network: TemporalNetwork, orders: Orders, terms: Terms) -> None:
        self.network = network
        self.orders = orders
        self.terms = terms

    def time(self, moment: Moment) -> Linear:
        """The time of a moment other than the very end."""
        if moment.instant is not None:
            return variable(moment.instant)
        if moment.point is None:
            raise ValueError("the very end has no time")
        return self.network.position(moment.point)

    def earlier(self, first: TimePoint, second: TimePoint) -> Formula:
        """t_first < t_second."""
        if self.orders.surely_before(first, second):
            return self.terms.true
        if self.orders.surely_not_after(second, first):
            return self.terms.false
        return self.terms.greater(self.network.position(second) - self.network.position(first))

    def not_later(self, first: TimePoint, second: TimePoint) -> Formula:
        """t_first ≤ t_second."""
        return self.terms.negation(self.earlier(second, first))

    def passed(self, point: TimePoint, moment: Moment) -> Formula:
        """Whether what happens at `point` belongs to the past of `moment`."""
        if moment.instant is not None:
            gap = variable(moment.instant) - self.network.position(point)
            return self.terms.greater(gap) if moment.side is Side.BEFORE else self.terms.at_least(gap)
        if moment.point is None:
            return self.terms.true
        if moment.side is Side.BEFORE:
            return self.earlier(point, moment.point)
        return self.not_later(point, moment.point)


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """An atom gets a truth value at `point` if `condition` held just before."""

    point: TimePoint
    value: bool
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class NumericWrite:
    """A fluent is assigned or increased at `point` if `condition` held just before."""

    point: TimePoint
    operator: Assignment
    expression: Expression
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect of an instance."""

    instance: ActionInstance
    effect: ContinuousEffect


class States:
    """Truth of conditions and values of fluents at any moment.

    `definition` maps the name of an auxiliary symbol to the formula that fixes it; whoever asserts a formula from here
    must assert the definitions of its symbols too (see :meth:`definitions_of`).
    """

    def __init__(self, plan: ParametrizedPlan, clock: Clock) -> None:
        self.plan = plan
        self.clock = clock
        self.terms = clock.terms
        self.definition: dict[str, Formula] = {}
        self.atom_writes: dict[Atom, list[AtomWrite]] = defaultdict(list)
        self.numeric_writes: dict[Fluent, list[NumericWrite]] = defaultdict(list)
        self.flows: dict[Fluent, list[Flow]] = defaultdict(list)
        self._values: dict[tuple[Fluent, Moment], Linear] = {}
        self._truths: dict[tuple[Atom, Moment], Formula] = {}
        self._open_values: dict[tuple[Fluent, Moment], Linear | None] = {}
        self._open_truths: dict[tuple[Atom, Moment], Formula | None] = {}
        self._count = 0
        self._collect_writes()

    # -- conditions ----------------------------------------------------------------------------------------------

    def condition(self, condition: Condition, moment: Moment, instance: ActionInstance | None = None) -> Formula:
        """The truth of a condition at a moment; `instance` is the one whose `?duration` it mentions."""
        match condition:
            case Truth(value):
                return self.terms.truth(value)
            case Holds(atom, value):
                truth = self.atom(atom, moment)
                return truth if value else self.terms.negation(truth)
            case Comparison(expression, relation):
                return self.terms.compare(self.expression(expression, moment, instance), relation)
            case And(operands):
                return self.terms.conjunction(self.condition(operand, moment, instance) for operand in operands)
            case Or(operands):
                return self.terms.disjunction(self.condition(operand, moment, instance) for operand in operands)

    def expression(self, expression: Expression, moment: Moment, instance: ActionInstance | None) -> Linear:
        """The value of a numeric expression at a moment, over parameters and time variables."""

        def value(name: NumericVariable) -> Linear:
            match name:
                case Fluent():
                    return self.fluent(name, moment)
                case ParameterReference():
                    return variable(name)
                case Duration():
                    return self.duration(instance)

        return expression.substitute(value)

    def duration(self, instance: ActionInstance | None) -> Linear:
        if instance is None:
            raise UnsupportedError("?duration has no meaning outside a durative action")
        return self.clock.network.position(instance.end) - self.clock.network.position(instance.start)

    # -- atoms ---------------------------------------------------------------------------------------------------

    def atom(self, atom: Atom, moment: Moment) -> Formula:
        """The truth of an atom at a moment: its last writer decides, an add wins over a simultaneous delete."""
        key = (atom, moment)
        if key in self._truths:
            return self._truths[key]
        if key in self._open_truths:
            # Conditional effects refer to each other in a circle that time breaks: name the truth, define it below.
            opened = self._open_truths[key] or self.terms.fresh_boolean(f"[{atom} {moment}]")
            self._open_truths[key] = opened
            return opened
        self._open_truths[key] = None
        truth = self._atom(atom, moment)
        name = self._open_truths.pop(key)
        if name is not None:
            self.definition[name.symbol_name()] = self.terms.equivalence(name, truth)
            truth = name
        self._truths[key] = truth
        return truth

    def _atom(self, atom: Atom, moment: Moment) -> Formula:
        writes = [(write, self._happened(write, moment)) for write in self.atom_writes.get(atom, ())]
        deletes = [(write.point, done) for write, done in writes if not write.value and done is not self.terms.false]
        cases = []
        if atom in self.plan.initial_atoms:
            cases.append(self.terms.negation(self.terms.disjunction(done for _, done in deletes)))
        for write, done in writes:
            if write.value and done is not self.terms.false:
                undone = self.terms.disjunction(
                    self.terms.conjunction((deleted, self.clock.earlier(write.point, point)))
                    for point, deleted in deletes
                )
                cases.append(self.terms.conjunction((done, self.terms.negation(undone))))
        return self.terms.disjunction(cases)

    def _happened(self, write: AtomWrite | NumericWrite, moment: Moment) -> Formula:
        """Whether a write lies in the past of a moment and took effect."""
        passed = self.clock.passed(write.point, moment)
        if passed is self.terms.false or write.condition == Truth(True):
            return passed
        return self.terms.conjunction((passed, self.condition(write.condition, before(write.point), write.instance)))

    # -- fluents -------------------------------------------------------------------------------------------------

    def fluent(self, fluent: Fluent, moment: Moment) -> Linear:
        """The value of a fluent at a moment."""
        key = (fluent, moment)
        if key in self._values:
            return self._values[key]
        if key in self._open_values:
            opened = self._open_values[key] or variable(self._auxiliary(f"{fluent} {moment}"))
            self._open_values[key] = opened
            return opened
        self._open_values[key] = None
        value = self._fluent(fluent, moment)
        name = self._open_values.pop(key)
        if name is not None:
            self._define(name, self.terms.equal(name - value))
            value = name
        self._values[key] = value
        return value

    def _fluent(self, fluent: Fluent, moment: Moment) -> Linear:
        if fluent not in self.plan.initial_fluents:
            raise InputError(f"{fluent} has no initial value; expected (= {fluent} NUMBER) in the problem's :init")
        assignments = [
            (write, done)
            for write in self.numeric_writes.get(fluent, ())
            if write.operator is Assignment.ASSIGN and (done := self._happened(write, moment)) is not self.terms.false
        ]
        cases: list[tuple[Formula, Linear]] = []
        nothing_assigned = self.terms.negation(self.terms.disjunction(done for _, done in assignments))
        if nothing_assigned is not self.terms.false:
            initial = self.expression(self.plan.initial_fluents[fluent], moment, None)
            cases.append((nothing_assigned, initial + self._change(fluent, None, moment)))
        for index, (write, done) in enumerate(assignments):
            overridden = self.terms.disjunction(
                # Of simultaneous assignments the one that the plan names last counts.
                self.terms.conjunction((other_done, self.clock.not_later(write.point, other.point)))
                if rank > index
                else self.terms.conjunction((other_done, self.clock.earlier(write.point, other.point)))
                for rank, (other, other_done) in enumerate(assignments)
                if rank != index
            )
            last = self.terms.conjunction((done, self.terms.negation(overridden)))
            if last is not self.terms.false:
                assigned = self.expression(write.expression, before(write.point), write.instance)
                cases.append((last, assigned + self._change(fluent, write, moment)))
        return self._choose(f"{fluent} {moment}", cases)

    def _change(self, fluent: Fluent, since: NumericWrite | None, moment: Moment) -> Linear:
        """What increases and continuous effects add between an assignment (or the beginning) and a moment."""
        total = constant(0)
        for write in self.numeric_writes.get(fluent, ()):
            if write.operator is Assignment.INCREASE:
                counts = self._happened(write, moment)
                if since is not None:
                    # Simultaneous increases come after the assignment.
                    counts = self.terms.conjunction((counts, self.clock.not_later(since.point, write.point)))
                if counts is not self.terms.false:
                    amount = self.expression(write.expression, before(write.point), write.instance)
                    total += self._choose(f"{write.point} {fluent}", [(counts, amount)], otherwise=constant(0))
        for flow in self.flows.get(fluent, ()):
            total += self._flowed(flow, moment)
            if since is not None:
                total -= self._flowed(flow, before(since.point))
        return total

    def _flowed(self, flow: Flow, moment: Moment) -> Linear:
        """What a continuous effect has contributed by a moment: rate · (t − t_s), t clamped to [t_s, t_e]."""
        instance, rate = flow.instance, self._rate(flow)
        started, ended = self.clock.passed(instance.start, moment), self.clock.passed(instance.end, moment)
        running = self.terms.conjunction((started, self.terms.negation(ended)))
        cases = [(ended, rate * self.duration(instance))]
        if running is not self.terms.false:
            cases.append((running, rate * (self.clock.time(moment) - self.clock.network.position(instance.start))))
        for condition, amount in cases:
            if condition is not self.terms.false and not amount.is_linear:
                raise UnsupportedError(
                    f"{instance.identifier} {instance.action}: non-linear continuous effect on {flow.effect.fluent}: "
                    f"rate {flow.effect.rate} times an elapsed time that is not constant; "
                    "expected a constant rate, or a fixed schedule",
                    instance.location,
                )
        return self._choose(f"{instance.identifier} {flow.effect.fluent} {moment}", cases, otherwise=constant(0))

    def _rate(self, flow: Flow) -> Linear:
        changing = [name for name in flow.effect.rate.variables if isinstance(name, Fluent) and self.is_written(name)]
        if changing:
            raise UnsupportedError(
                f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                f"{flow.effect.fluent}: its rate reads {changing[0]}, which the plan changes; expected a constant rate",
                flow.instance.location,
            )
        return self.expression(flow.effect.rate, before(flow.instance.start), None)

    # -- bookkeeping ---------------------------------------------------------------------------------------------

    def is_written(self, fluent: Fluent) -> bool:
        """Whether anything in the plan changes the fluent."""
        return bool(self.numeric_writes.get(fluent) or self.flows.get(fluent))

    def definitions_of(self, formulas: Iterable[Formula]) -> list[Formula]:
        """The definitions that the formulas need, transitively."""
        needed: dict[str, Formula] = {}
        queue = list(formulas)
        while queue:
            for symbol in self.terms.variables(queue.pop()):
                name = symbol.symbol_name()
                if name in self.definition and name not in needed:
                    needed[name] = self.definition[name]
                    queue.append(self.definition[name])
        return list(needed.values())

    def _choose(self, name: str, cases: list[tuple[Formula, Linear]], otherwise: Linear | None = None) -> Linear:
        """The value of the case that applies (exactly one does); a new auxiliary unless that is known."""
        cases = [(condition, value) for condition, value in cases if condition is not self.terms.false]
        for condition, value in cases:
            if condition is self.terms.true:
                return value
        if otherwise is not None:
            cases.append((self.terms.negation(self.terms.disjunction(c for c, _ in cases)), otherwise))
        values = {value for _, value in cases}
        if len(values) == 1:
            return values.pop()
        result = variable(self._auxiliary(name))
        self._define(result, *(self.terms.implication(c, self.terms.equal(result - value)) for c, value in cases))
        return result

    def _auxiliary(self, name: str) -> Auxiliary:
        self._count += 1
        return Auxiliary(name, self._count)

    def _define(self, name: Linear, *formulas: Formula) -> None:
        self.definition[str(name)] = self.terms.conjunction(formulas)

    def _collect_writes(self) -> None:
        for instance in self.plan.instances:
            for effect in instance.atom_effects:
                write = AtomWrite(instance.at(effect.timing), effect.value, effect.condition, instance)
                self.atom_writes[effect.atom].append(write)
            for numeric in instance.numeric_effects:
                self.numeric_writes[numeric.fluent].append(
                    NumericWrite(
                        instance.at(numeric.timing),
                        numeric.operator,
                        numeric.expression,
                        numeric.condition,
                        instance,
                    )
                )
            for continuous in instance.continuous_effects:
                if continuous.rate != Polynomial.constant(0):
                    self.flows[continuous.fluent].append(Flow(instance, continuous))
        for literal in self.plan.timed_literals:
            match literal.target:
                case Atom():
                    timed = AtomWrite(literal.point, bool(literal.value), Truth(True), None)
                    self.atom_writes[literal.target].append(timed)
                case Fluent():
                    amount: Expression = Polynomial.constant(Fraction(literal.value))
                    assigned = NumericWrite(literal.point, Assignment.ASSIGN, amount, Truth(True), None)
                    self.numeric_writes[literal.target].append(assigned)
        rank = {point: index for index, point in enumerate(self.plan.time_points)}
        for writes in self.numeric_writes.values():
            writes.sort(key=lambda write: rank[write.point])
