"""The state of the relational encoding: truth of conditions and values of fluents at any moment of a plan.

An order atom `t_a < t_b` that the network decides for all parameter values is a constant here; the others become linear
atoms. All knowledge about the order of time points in the relational encoding comes through :class:`MomentOrder`.
"""

from dataclasses import dataclass
from enum import Enum

from robust.encode.interface import Auxiliary, Definitions, Linear, constant, initial_value, variable
from robust.encode.network import AtomWrite, Flow, FluentWrite, Orders, TemporalNetwork, Writes
from robust.errors import UnsupportedError
from robust.plan import model
from robust.smt.terms import Formula, Terms


class MomentSide(Enum):
    BEFORE = "before"
    AFTER = "after"


@dataclass(frozen=True, slots=True)
class StateMoment:
    """Just before or just after all that happens at the time of a time point, or a free instant, or the very end.

    With neither `point` nor `instant` it is the state after all time points.
    """

    side: MomentSide
    point: model.TimePoint | None = None
    instant: Auxiliary | None = None

    def __str__(self) -> str:
        if self.instant is not None:
            return f"{self.side.value} {self.instant}"
        return f"{self.side.value} {self.point}" if self.point else "finally"


FINALLY = StateMoment(MomentSide.AFTER)


def before(point: model.TimePoint) -> StateMoment:
    return StateMoment(MomentSide.BEFORE, point)


def after(point: model.TimePoint) -> StateMoment:
    return StateMoment(MomentSide.AFTER, point)


class MomentOrder:
    """Order atoms under what is known of the network."""

    def __init__(self, network: TemporalNetwork, orders: Orders, terms: Terms) -> None:
        self.network = network
        self.orders = orders
        self.terms = terms

    def time(self, moment: StateMoment) -> Linear:
        """The time of a moment other than the very end."""
        if moment.instant is not None:
            return variable(moment.instant)
        if moment.point is None:
            raise ValueError("the very end has no time")
        return self.network.places[moment.point]

    def earlier(self, first: model.TimePoint, second: model.TimePoint) -> Formula:
        """t_first < t_second."""
        if self.orders.surely_before(first, second):
            return self.terms.true
        if self.orders.surely_not_after(second, first):
            return self.terms.false
        return self.terms.greater(self.network.distance(first, second))

    def not_later(self, first: model.TimePoint, second: model.TimePoint) -> Formula:
        """t_first ≤ t_second."""
        return self.terms.negation(self.earlier(second, first))

    def passed(self, point: model.TimePoint, moment: StateMoment) -> Formula:
        """Whether what happens at `point` belongs to the past of `moment`."""
        if moment.instant is not None:
            gap = variable(moment.instant) - self.network.places[point]
            return self.terms.greater(gap) if moment.side is MomentSide.BEFORE else self.terms.at_least(gap)
        if moment.point is None:
            return self.terms.true
        if moment.side is MomentSide.BEFORE:
            return self.earlier(point, moment.point)
        return self.not_later(point, moment.point)


class States:
    """Truth of conditions and values of fluents at any moment.

    Whoever asserts a formula from here must assert what it needs of `definitions` too.
    """

    def __init__(self, plan: model.ParametrizedPlan, writes: Writes, clock: MomentOrder) -> None:
        self.plan = plan
        self.clock = clock
        self.terms = clock.terms
        self.writes = writes
        self.definitions = Definitions(self.terms)
        self._values: dict[tuple[model.Fluent, StateMoment], Linear] = {}
        self._truths: dict[tuple[model.Atom, StateMoment], Formula] = {}
        self._open_values: dict[tuple[model.Fluent, StateMoment], Auxiliary | None] = {}
        self._open_truths: dict[tuple[model.Atom, StateMoment], Formula | None] = {}

    # -- conditions ----------------------------------------------------------------------------------------------

    def condition(
        self, condition: model.Condition, moment: StateMoment, instance: model.ActionInstance | None = None
    ) -> Formula:
        """The truth of a condition at a moment; `instance` is the one whose `?duration` it mentions."""
        match condition:
            case model.Truth(value):
                return self.terms.truth(value)
            case model.Holds(atom, value):
                truth = self.atom(atom, moment)
                return truth if value else self.terms.negation(truth)
            case model.NumericCondition(expression, relation):
                return self.terms.compare(self.expression(expression, moment, instance), relation)
            case model.And(operands):
                return self.terms.conjunction(self.condition(operand, moment, instance) for operand in operands)
            case model.Or(operands):
                return self.terms.disjunction(self.condition(operand, moment, instance) for operand in operands)

    def expression(
        self, expression: model.Expression, moment: StateMoment, instance: model.ActionInstance | None
    ) -> Linear:
        """The value of a numeric expression at a moment, over parameters and time variables."""

        def value(name: model.NumericVariable) -> Linear:
            match name:
                case model.Fluent():
                    return self.fluent(name, moment)
                case model.ParameterReference():
                    return variable(name)
                case model.Duration():
                    return self.duration(instance)

        return expression.substitute(value)

    def duration(self, instance: model.ActionInstance | None) -> Linear:
        if instance is None:
            raise UnsupportedError("?duration has no meaning outside a durative action")
        return self.clock.network.distance(instance.start, instance.end)

    # -- atoms ---------------------------------------------------------------------------------------------------

    def atom(self, atom: model.Atom, moment: StateMoment) -> Formula:
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
            self.definitions.define(name, self.terms.equivalence(name, truth))
            truth = name
        self._truths[key] = truth
        return truth

    def _atom(self, atom: model.Atom, moment: StateMoment) -> Formula:
        writes = [(write, self._happened(write, moment)) for write in self.writes.of_atom.get(atom, ())]
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

    def _happened(self, write: AtomWrite | FluentWrite, moment: StateMoment) -> Formula:
        """Whether a write lies in the past of a moment and took effect."""
        passed = self.clock.passed(write.point, moment)
        if passed is self.terms.false or write.condition == model.Truth(True):
            return passed
        return self.terms.conjunction((passed, self.condition(write.condition, before(write.point), write.instance)))

    # -- fluents -------------------------------------------------------------------------------------------------

    def fluent(self, fluent: model.Fluent, moment: StateMoment) -> Linear:
        """The value of a fluent at a moment."""
        key = (fluent, moment)
        if key in self._values:
            return self._values[key]
        if key in self._open_values:
            opened = self._open_values[key] or self.definitions.auxiliary(f"{fluent} {moment}")
            self._open_values[key] = opened
            return variable(opened)
        self._open_values[key] = None
        value = self._fluent(fluent, moment)
        name = self._open_values.pop(key)
        if name is not None:
            self.definitions.define(self.terms.real(name), self.terms.equal(variable(name) - value))
            value = variable(name)
        self._values[key] = value
        return value

    def _fluent(self, fluent: model.Fluent, moment: StateMoment) -> Linear:
        initial = initial_value(self.plan, fluent)
        assignments = [
            (write, done)
            for write in self.writes.of_fluent.get(fluent, ())
            if write.assigns and (done := self._happened(write, moment)) is not self.terms.false
        ]
        cases: list[tuple[Formula, Linear]] = []
        nothing_assigned = self.terms.negation(self.terms.disjunction(done for _, done in assignments))
        if nothing_assigned is not self.terms.false:
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
                assigned = self.expression(write.amount, before(write.point), write.instance)
                cases.append((last, assigned + self._change(fluent, write, moment)))
        return self.definitions.choice(f"{fluent} {moment}", cases)

    def _change(self, fluent: model.Fluent, since: FluentWrite | None, moment: StateMoment) -> Linear:
        """What increases and continuous effects add between an assignment (or the beginning) and a moment."""
        total = constant(0)
        for write in self.writes.of_fluent.get(fluent, ()):
            if not write.assigns:
                counts = self._happened(write, moment)
                if since is not None:
                    # Simultaneous increases come after the assignment.
                    counts = self.terms.conjunction((counts, self.clock.not_later(since.point, write.point)))
                if counts is not self.terms.false:
                    amount = self.expression(write.amount, before(write.point), write.instance)
                    total += self.definitions.choice(f"{write.point} {fluent}", [(counts, amount)], constant(0))
        for flow in self.writes.flows.get(fluent, ()):
            total += self._flowed(flow, moment)
            if since is not None:
                total -= self._flowed(flow, before(since.point))
        return total

    def _flowed(self, flow: Flow, moment: StateMoment) -> Linear:
        """What a continuous effect has contributed by a moment: rate · (t − t_s), t clamped to [t_s, t_e]."""
        instance, rate = flow.instance, self._rate(flow)
        started, ended = self.clock.passed(instance.start, moment), self.clock.passed(instance.end, moment)
        running = self.terms.conjunction((started, self.terms.negation(ended)))
        cases = [(ended, rate * self.duration(instance))]
        if running is not self.terms.false:
            cases.append((running, rate * (self.clock.time(moment) - self.clock.network.places[instance.start])))
        for condition, amount in cases:
            if condition is not self.terms.false and not amount.is_linear:
                raise UnsupportedError(
                    f"{instance.identifier} {instance.action}: non-linear continuous effect on {flow.effect.fluent}: "
                    f"rate {flow.effect.rate} times an elapsed time that is not constant; "
                    "expected a constant rate, or a fixed schedule",
                    instance.location,
                )
        return self.definitions.choice(f"{instance.identifier} {flow.effect.fluent} {moment}", cases, constant(0))

    def _rate(self, flow: Flow) -> Linear:
        changing = [name for name in model.fluents_in(flow.effect.rate) if self.writes.changes(name)]
        if changing:
            raise UnsupportedError(
                f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                f"{flow.effect.fluent}: its rate reads {changing[0]}, which the plan changes; expected a constant rate",
                flow.instance.location,
            )
        return self.expression(flow.effect.rate, before(flow.instance.start), None)
