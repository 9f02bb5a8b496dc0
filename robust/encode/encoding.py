"""The relational encoding as a whole: named obligations, each with the query that refutes it.

`enc_proofs` is examined in stages, by ∀X(A → P₁ ∧ P₂) ≡ ∀X(A → P₁) ∧ ∀X(A ∧ P₁ → P₂): durations first, then
ε-separation, then whether effects agree, then conditions and the goal. Each stage may assume the ones before it, which
decides most orders.

An over-all condition must hold throughout the open interval between start and end of an instance. Between two
happenings every fluent is linear in time, so a condition with at most one comparison of changing fluents needs a look
at the breakpoints only: the happenings that touch what it mentions. Any other condition is examined at a free instant
inside the interval, which the solver places.

An order atom `t_a < t_b` that the network decides for all parameter values is a constant; the others become linear
atoms. All knowledge about the order of time points comes through :class:`MomentOrder`, and :class:`States` says which
conditions are true and which values fluents have at any moment.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cache, cached_property

from robust.encode import interface, settled
from robust.encode import network as networks
from robust.encode.interface import EPSILON, Auxiliary, Encoding, Linear, Obligation, Range, Stage, constant, variable
from robust.encode.network import Flow, FluentWrite, IndependentParts, Orders, TemporalNetwork, Writes
from robust.encode.validity import Validity
from robust.errors import UnsupportedError
from robust.plan import model
from robust.smt.session import Formula, Terms


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
        self.definitions = interface.Definitions(self.terms)
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

    def _happened(self, write: networks.AtomWrite | FluentWrite, moment: StateMoment) -> Formula:
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
        initial = interface.initial_value(self.plan, fluent)
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


class OverAll:
    """Violations of over-all conditions."""

    def __init__(self, plan: model.ParametrizedPlan, states: States) -> None:
        self._states = states
        self._clock = states.clock
        self._writes = states.writes
        self._terms = states.terms
        self._rank = {point: index for index, point in enumerate(plan.time_points)}
        self._instants = 0

    def violation(self, instance: model.ActionInstance, condition: model.Condition) -> Formula:
        """Some instant strictly between start and end at which the condition is false."""
        changing = [leaf for leaf in model.comparisons(condition) if self._flows(leaf)]
        if not changing:
            cases = self._in_some_state(instance, condition)
        elif len(changing) == 1 and changing[0].relation is not model.Relation.DIFFERENT:
            cases = self._at_breakpoints(instance, condition, changing[0])
        else:
            cases = self._at_some_instant(instance, condition)
        nonempty = self._clock.earlier(instance.start, instance.end)
        return self._terms.conjunction((nonempty, self._terms.disjunction(cases)))

    # -- the three ways ------------------------------------------------------------------------------------------

    def _in_some_state(self, instance: model.ActionInstance, condition: model.Condition) -> Iterator[Formula]:
        """Nothing in the condition changes between happenings: look at the state that each one leaves."""
        yield self._false(condition, after(instance.start), instance)
        for point in self._breakpoints(condition):
            yield self._inside(instance, point, lambda at: self._false(condition, after(at), instance))

    def _at_breakpoints(
        self, instance: model.ActionInstance, condition: model.Condition, leaf: model.NumericCondition
    ) -> Iterator[Formula]:
        """One comparison bends: limits at both ends, values at the breakpoints inside.

        At the open ends a strict inequality may reach its bound, unless it stays there throughout.
        """
        start, end = after(instance.start), before(instance.end)
        weak = _weaken(condition, leaf)
        yield self._false(weak, start, instance)
        yield self._false(weak, end, instance)
        breakpoints = self._breakpoints(condition)
        for point, jumps in breakpoints.items():
            if jumps or condition is not leaf or self._may_be_least(point, leaf):
                yield self._inside(instance, point, lambda at: self._false(condition, before(at), instance))
            if jumps:
                yield self._inside(instance, point, lambda at: self._false(condition, after(at), instance))
        if weak != condition:
            quiet = (self._terms.negation(self._is_inside(instance, point)) for point in breakpoints)
            ends = (self._false(condition, start, instance), self._false(condition, end, instance))
            yield self._terms.conjunction((*ends, *quiet))

    def _at_some_instant(self, instance: model.ActionInstance, condition: model.Condition) -> Iterator[Formula]:
        """The solver chooses the instant; what happenings inside leave behind is looked at as well."""
        self._instants += 1
        instant = Auxiliary(f"instant in {instance.identifier}", self._instants)
        inside = self._terms.conjunction(
            (
                self._clock.passed(instance.start, StateMoment(MomentSide.BEFORE, instant=instant)),
                self._terms.negation(self._clock.passed(instance.end, StateMoment(MomentSide.AFTER, instant=instant))),
            )
        )
        false = self._false(condition, StateMoment(MomentSide.BEFORE, instant=instant), instance)
        yield self._terms.conjunction((inside, false))
        for point, jumps in self._breakpoints(condition).items():
            if jumps:
                yield self._inside(instance, point, lambda at: self._false(condition, after(at), instance))

    # -- parts ---------------------------------------------------------------------------------------------------

    def _false(self, condition: model.Condition, moment: StateMoment, instance: model.ActionInstance) -> Formula:
        return self._terms.negation(self._states.condition(condition, moment, instance))

    def _is_inside(self, instance: model.ActionInstance, point: model.TimePoint) -> Formula:
        clock = self._clock
        return self._terms.conjunction((clock.earlier(instance.start, point), clock.earlier(point, instance.end)))

    def _inside(
        self, instance: model.ActionInstance, point: model.TimePoint, false: Callable[[model.TimePoint], Formula]
    ) -> Formula:
        """`false(point)`, if the point lies strictly inside; not even built where the network excludes that."""
        inside = self._is_inside(instance, point)
        return inside if inside is self._terms.false else self._terms.conjunction((inside, false(point)))

    def _breakpoints(self, condition: model.Condition) -> dict[model.TimePoint, bool]:
        """The happenings that can change a condition's truth: whether it jumps there, or a fluent only bends."""
        jumps: dict[model.TimePoint, bool] = {}
        for name in model.names_in(condition):
            match name:
                case model.Atom():
                    jumps.update((write.point, True) for write in self._writes.of_atom.get(name, ()))
                case model.Fluent():
                    jumps.update((write.point, True) for write in self._writes.of_fluent.get(name, ()))
                    for flow in self._writes.flows.get(name, ()):
                        for point in flow.instance.time_points:
                            jumps.setdefault(point, False)
        return dict(sorted(jumps.items(), key=lambda item: self._rank[item[0]]))

    def _flows(self, leaf: model.NumericCondition) -> list[Flow]:
        return [
            flow
            for name in model.names_in(leaf)
            if isinstance(name, model.Fluent)
            for flow in self._writes.flows.get(name, ())
        ]

    def _may_be_least(self, point: model.TimePoint, leaf: model.NumericCondition) -> bool:
        """Whether the left side of `leaf` can have a local minimum where a flow starts or ends at `point`.

        Where the slope only drops it cannot: an inequality that holds around the point then holds there too.
        """
        if leaf.relation is model.Relation.EQUAL or not leaf.expression.is_linear:
            return True
        factors = {name: factor for name, factor in leaf.expression.coefficients() if isinstance(name, model.Fluent)}
        for flow in self._flows(leaf):
            rate = flow.effect.rate
            if point in flow.instance.time_points:
                if not rate.is_constant:
                    return True
                bend = factors[flow.effect.fluent] * rate.constant_term
                if (bend if point == flow.instance.start else -bend) > 0:
                    return True
        return False


def _weaken(condition: model.Condition, leaf: model.NumericCondition) -> model.Condition:
    """The condition with a strict inequality of `leaf` made non-strict."""
    if condition == leaf and leaf.relation is model.Relation.GREATER:
        return model.NumericCondition(leaf.expression, model.Relation.AT_LEAST)
    match condition:
        case model.And(operands):
            return model.And(tuple(_weaken(operand, leaf) for operand in operands))
        case model.Or(operands):
            return model.Or(tuple(_weaken(operand, leaf) for operand in operands))
        case _:
            return condition


class RelationalEncoding(Encoding):
    """enc_tn, enc_eff and enc_proofs of a plan without positions.

    Args:
        plan: the ground, parametrized plan.
        epsilon: the separation of mutex time points.
        ranges: the parameter values that are asked about; all that are declared if not given.

    Raises:
        UnsupportedError: if an expression is not linear after folding constants.
    """

    name = "relational"

    def __init__(
        self, plan: model.ParametrizedPlan, epsilon: Fraction = EPSILON, ranges: Mapping[str, Range] | None = None
    ) -> None:
        self._settling = plan if ranges is None else model.within(plan, ranges)
        self.plan = plan
        self.epsilon = epsilon
        self.terms = Terms()
        self.network = TemporalNetwork(plan)
        self.places = self.network.places
        writes = Writes(plan)
        self._rules = tuple(networks.duration_rules(plan, writes))
        self.validity = Validity(self.network, self._rules, self.terms)
        self._writes = writes

    @cached_property
    def obligations(self) -> tuple[Obligation, ...]:  # type: ignore[override]
        """All obligations by stage; formulas are built when they are asked for."""
        plan = self.plan
        self._mutex = networks.mutex_pairs(plan)
        self._proved = settled.proved(self._settling, self.epsilon, self._mutex)
        self._orders = self._known_orders()
        self._states = States(plan, self._writes, MomentOrder(self.network, self._orders, self.terms))
        self._overall = OverAll(plan, self._states)
        self._assumed: dict[Stage, list[Linear]] = {Stage.DURATION: []}
        # Each stage's obligations are built before the orders learn them, and after they learnt the earlier stages'.
        durations = list(self._duration_obligations())
        self._assumed[Stage.SEPARATION] = list(self._learn_durations())
        separations = list(self._separation_obligations())
        self._assumed[Stage.AGREEMENT] = [*self._assumed[Stage.SEPARATION], *self._learn_separations()]
        self._assumed[Stage.CONDITION] = self._assumed[Stage.AGREEMENT]
        agreements = list(self._by_instance(self._agreements_of))
        self._agreed = [self.terms.negation(a.violation) for a in agreements if a.violation is not None]
        conditions = (*self._by_instance(self._conditions_of), *self._goals())
        self._slices = cache(self._make_slices)
        return (*durations, *separations, *agreements, *conditions)

    # -- queries -------------------------------------------------------------------------------------------------

    def query(self, obligation: Obligation) -> list[Formula]:
        """Satisfiable, for parameter values within enc_valid, if some schedule breaks the obligation.

        Only the part of the network that the violation touches: the rest has a schedule whenever enc_valid holds. For
        the same reason a violation over parameters alone needs no network.
        """
        formulas = self._about_states(obligation)
        if len(formulas) == 1 and len(self.parameters_in(formulas)) == len(self.terms.variables(formulas[0])):
            return formulas
        return [*self._slices(obligation.stage).touching(formulas), *formulas]

    def full_query(self, obligation: Obligation) -> list[Formula]:
        """The formulas of :meth:`query` over the whole network: a model gives a time to every time point."""
        assumed = map(self.terms.at_least, self._assumed[obligation.stage])
        return [*self.network_formulas(), *assumed, *self._about_states(obligation)]

    def _about_states(self, obligation: Obligation) -> list[Formula]:
        """The violation, that effects agree if that may be assumed, and the definitions of what occurs in these."""
        agreed = self._agreed if obligation.stage is Stage.CONDITION else ()
        formulas = [self.violation(obligation), *agreed]
        return [*formulas, *self._states.definitions.needed_by(formulas)]

    def valid_formulas(self, kept: Iterable[Obligation]) -> list[Formula]:
        """Satisfiable if some schedule of the network keeps these obligations, for some parameter values.

        The converse holds but for conditions over all instants of continuous change, of which only one is looked at.
        """
        held = [self.terms.negation(known.violation) for known in kept if known.violation is not None]
        return [*self.network_formulas(), *held, *self.definitions(held)]

    def definitions(self, formulas: Iterable[Formula]) -> list[Formula]:
        """What the symbols mean that formulas speak of."""
        return list(self._states.definitions.needed_by(formulas))

    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and free time points."""
        return [self.terms.at_least(inequality.expression) for inequality in self.network.inequalities]

    # -- obligations, stage by stage -----------------------------------------------------------------------------

    def _duration_obligations(self) -> Iterator[Obligation]:
        for rule in self._rules:
            if rule.exact and all(map(networks.is_never_negative, map(self.network.slack, rule.bounds))):
                yield Obligation(rule.name, Stage.DURATION, None)
            else:
                read = before(rule.instance.start)
                yield self._condition(rule.name, rule.condition, read, rule.instance, Stage.DURATION)

    def _separation_obligations(self) -> Iterator[Obligation]:
        for first, second in self._mutex:
            name = f"separation: {first}, {second}"
            if name in self._proved or self._is_separated(first, second):
                yield Obligation(name, Stage.SEPARATION, None)
                continue
            gap = self.network.distance(first, second)
            near = (self.terms.greater(-gap + self.epsilon), self.terms.greater(gap + self.epsilon))
            yield self.obligation(
                name, Stage.SEPARATION, self.terms.conjunction(near) if self.epsilon else self.terms.equal(gap)
            )

    def _by_instance(
        self, obligations_of: Callable[[model.ActionInstance], Iterator[Obligation]]
    ) -> Iterator[Obligation]:
        for instance in self.plan.instances:
            try:
                yield from obligations_of(instance)
            except UnsupportedError as error:
                if error.location is not None:
                    raise
                what = f"{instance.identifier} {instance.action}: {error.message}"
                raise UnsupportedError(what, instance.location) from error

    def _goals(self) -> Iterator[Obligation]:
        for goal in self.plan.goal:
            yield self._condition(goal.label, goal.condition, FINALLY)

    def _agreements_of(self, instance: model.ActionInstance) -> Iterator[Obligation]:
        for agreement in instance.agreements:
            read = before(instance.at(agreement.timing))
            yield self._condition(instance.label(agreement), agreement.condition, read, instance, Stage.AGREEMENT)

    def _conditions_of(self, instance: model.ActionInstance) -> Iterator[Obligation]:
        unconditional = [rule.condition for rule in self._rules if rule.instance is instance]
        for duration in instance.durations:
            if duration.condition not in unconditional:
                read = before(instance.at(duration.timing))
                yield self._condition(instance.label(duration), duration.condition, read, instance)
        for timed in instance.conditions:
            moment = None if timed.timing is model.Timing.OVER_ALL else before(instance.at(timed.timing))
            yield self._condition(instance.label(timed), timed.condition, moment, instance)

    def _condition(
        self,
        name: str,
        condition: model.Condition,
        moment: StateMoment | None,
        instance: model.ActionInstance | None = None,
        stage: Stage = Stage.CONDITION,
    ) -> Obligation:
        """The formula that a condition holds at a moment, or throughout an instance."""
        if name in self._proved:
            return Obligation(name, stage, None)
        if moment is None and instance is not None:
            return self.obligation(name, stage, self._overall.violation(instance, condition))
        holds = self._states.condition(condition, moment or FINALLY, instance)
        return self.obligation(name, stage, self.terms.negation(holds))

    # -- what is known of the order, and what a stage assumes -----------------------------------------------------

    def _known_orders(self) -> Orders:
        learnt = [weight for rule in self._rules for _, _, weight in self.network.bounds(rule.bounds)]
        bounds = self.network.bounds(self.network.differences)
        return Orders(self.plan.time_points, bounds, [self.epsilon, *learnt])

    def _is_separated(self, first: model.TimePoint, second: model.TimePoint) -> bool:
        bounds = (self._orders.least(first, second), self._orders.least(second, first))
        return any(bound is not None and bound >= self.epsilon and bound > 0 for bound in bounds)

    def _learn_durations(self) -> Iterator[Linear]:
        """All bounds are assumed, also those that the network implies: its slices may leave out what implies them."""
        for rule in self._rules:
            for bound, slack in zip(rule.bounds, map(self.network.slack, rule.bounds), strict=True):
                if not networks.is_never_negative(slack):
                    yield slack
                    for learnt in () if rule.name in self._proved else self.network.bounds((bound,)):
                        self._orders.learn(*learnt)

    def _learn_separations(self) -> Iterator[Linear]:
        """A mutex pair whose order is known up to less than ε is ε apart in that order."""
        pairs = (pair for pair in self._mutex if f"separation: {pair[0]}, {pair[1]}" not in self._proved)
        for first, second in self._orders.separate(pairs, self.epsilon):
            yield self.network.distance(first, second) - self.epsilon

    def _make_slices(self, stage: Stage) -> IndependentParts:
        """enc_tn with what the stage assumes; `t ≥ 0` is left out where an earlier time point implies it."""
        supported = set() if stage is Stage.DURATION else self._supported_points()
        network = [i.expression for i in self.network.inequalities if i.not_before_zero not in supported]
        return IndependentParts(self.terms, [*network, *self._assumed[stage]])

    def _supported_points(self) -> set[model.TimePoint]:
        """Time points that follow another one, other than zero, in every schedule that respects durations.

        Ties are counted in the plan's order only, so that no two points support each other in a circle.
        """
        rank = {point: index for index, point in enumerate(self.plan.time_points)}
        differences = [*self.network.differences, *(bound for rule in self._rules for bound in rule.bounds)]
        return {
            target
            for source, target, weight in self.network.bounds(differences)
            if source != model.ZERO and (weight > 0 or (weight == 0 and rank[source] < rank[target]))
        }
