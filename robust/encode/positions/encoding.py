"""The encoding over positions: over-all conditions in the states, and all obligations by name [IRR §2]."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import cached_property
from itertools import permutations
from typing import assert_never

from robust.encode.effects import Writes
from robust.encode.interface import EPSILON, Encoding, Obligation, Stage
from robust.encode.network import Difference, Orders, TemporalNetwork, duration_rules
from robust.encode.positions.formulas import Positions, Reader, Setting, State, Trajectory
from robust.encode.positions.projection import Projection
from robust.encode.variables import Auxiliary, Definitions, variable
from robust.plan.model import (
    ActionInstance,
    Comparison,
    Condition,
    DurationConstraint,
    GoalCondition,
    ParametrizedPlan,
    Relation,
    TimedCondition,
    Timing,
    comparisons,
    conjuncts,
    fluents_in,
)
from robust.plan.simulate import mutex_pairs
from robust.smt.limits import NEVER, Deadline
from robust.smt.terms import Formula, Terms

Part = TimedCondition | DurationConstraint | GoalCondition
"""What is proved: each is an obligation."""


class OverAll:
    """Violations of over-all conditions."""

    def __init__(self, trajectory: Trajectory) -> None:
        setting = trajectory.setting
        self._terms = setting.terms
        self._network = setting.network
        self._positions = setting.positions
        self._writes = setting.writes
        self._reader = setting.reader
        self._flows = trajectory.flows
        self._trajectory = trajectory
        self._instants = 0

    def violation(self, instance: ActionInstance, condition: Condition, deadline: Deadline) -> Formula:
        """Some instant of the open interval at which the condition is false.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        parts = list(conjuncts(condition))
        return self._terms.disjunction(
            self._terms.conjunction((inside, case))
            for step, inside in self._steps(instance, deadline)
            for part in parts
            for case in self._in_step(instance, part, step)
        )

    def _steps(self, instance: ActionInstance, deadline: Deadline) -> Iterator[tuple[int, Formula]]:
        """The steps that may lie inside and take time."""
        for step in range(1, self._positions.last):
            deadline.enforce()
            lasting = self._terms.negation(self._positions.same(step + 1))
            inside = self._terms.conjunction((self._flows.acts(instance, step), lasting))
            if inside is not self._terms.false:
                yield step, inside

    def _in_step(self, instance: ActionInstance, condition: Condition, step: int) -> Iterator[Formula]:
        moving = [leaf for leaf in dict.fromkeys(comparisons(condition)) if self._moves(leaf)]
        left = self._trajectory.after[step]
        if not moving:
            # Happenings inside leave no state that does not last through a step inside.
            yield self._false(condition, left, instance)
        elif len(moving) == 1:
            yield self._false_in_interior(instance, condition, moving[0], step)
            if moving[0].relation in (Relation.GREATER, Relation.DIFFERENT):
                yield from self._false_at_ends(instance, condition, step)
        else:
            yield self._false_at_instant(instance, condition, step)
            yield from self._false_at_ends(instance, condition, step)

    def _moves(self, leaf: Comparison) -> bool:
        return any(self._writes.flows.get(fluent) for fluent in fluents_in(leaf.expression))

    def _false(self, condition: Condition, state: State, instance: ActionInstance) -> Formula:
        return self._terms.negation(self._reader.holds(condition, state, instance))

    def _false_in_interior(
        self, instance: ActionInstance, condition: Condition, moving: Comparison, step: int
    ) -> Formula:
        """All else is constant in the interior, so the condition is false there where its only moving part is."""
        broken = self._broken_in_interior(instance, moving, step)
        truth = self._terms.negation(broken)
        holds = self._reader.holds(
            condition, self._trajectory.after[step], instance, lambda leaf: truth if leaf == moving else None
        )
        return self._terms.negation(holds)

    def _broken_in_interior(self, instance: ActionInstance, moving: Comparison, step: int) -> Formula:
        """Whether a linear function leaves a relation to zero somewhere between its limits `left` and `right`."""
        terms = self._terms
        left = self._reader.value(moving.expression, self._trajectory.after[step], instance)
        right = self._reader.value(moving.expression, self._trajectory.before[step + 1], instance)
        both_zero = terms.conjunction((terms.equal(left), terms.equal(right)))
        match moving.relation:
            case Relation.AT_LEAST:
                return terms.disjunction((terms.greater(-left), terms.greater(-right)))
            case Relation.GREATER:
                return terms.disjunction((terms.greater(-left), terms.greater(-right), both_zero))
            case Relation.EQUAL:
                return terms.negation(both_zero)
            case Relation.DIFFERENT:
                falls = terms.conjunction((terms.greater(left), terms.greater(-right)))
                rises = terms.conjunction((terms.greater(-left), terms.greater(right)))
                return terms.disjunction((falls, rises, both_zero))
        assert_never(moving.relation)

    def _false_at_ends(self, instance: ActionInstance, condition: Condition, step: int) -> Iterator[Formula]:
        """At a happening inside the interval the values themselves count: just after it, and just before it."""
        terms, positions, places = self._terms, self._positions, self._network.places
        after_start = terms.greater(positions.time(step) - places[instance.start])
        yield terms.conjunction((after_start, self._false(condition, self._trajectory.after[step], instance)))
        before_end = terms.greater(places[instance.end] - positions.time(step + 1))
        yield terms.conjunction((before_end, self._false(condition, self._trajectory.before[step + 1], instance)))

    def _false_at_instant(self, instance: ActionInstance, condition: Condition, step: int) -> Formula:
        self._instants += 1
        instant = variable(Auxiliary(f"instant in {instance.identifier}", self._instants))
        left = self._trajectory.after[step]
        moved = dict(left.fluents)
        for fluent in {f for leaf in comparisons(condition) for f in fluents_in(leaf.expression)} & moved.keys():
            moved[fluent] += self._flows.until(fluent, step, instant)
        inside = (
            self._terms.greater(instant - self._positions.time(step)),
            self._terms.greater(self._positions.time(step + 1) - instant),
        )
        return self._terms.conjunction((*inside, self._false(condition, State(left.atoms, moved), instance)))


class PositionsEncoding(Encoding):
    """enc_tn, enc_eff and enc_proofs of a plan over positions.

    States are built with the first query that needs them. The violation of a condition is a symbol, which its query
    defines.

    Args:
        plan: the ground, parametrized plan.
        epsilon: the separation of mutex time points.
        deadline: when queries stop being built, with OutOfTimeError.

    Raises:
        UnsupportedError: if an expression is not linear after folding constants; from queries as well.
    """

    name = "positions"

    def __init__(
        self,
        plan: ParametrizedPlan,
        epsilon: Fraction = EPSILON,
        *,
        deadline: Deadline = NEVER,
    ) -> None:
        self.plan = plan
        self.epsilon = epsilon
        self._deadline = deadline
        self.terms = Terms()
        self._definitions = Definitions(self.terms)
        self.network = TemporalNetwork(plan)
        self.places = self.network.places
        self.validity = Projection(self.network, self.terms)
        self._reader = Reader(plan, self.network, self.terms)
        self._writes = Writes(plan)
        self._mutex = tuple(mutex_pairs(plan))
        self._rules = tuple(duration_rules(plan, self._writes))
        self._parts: dict[Formula, tuple[Part, ActionInstance | None]] = {}
        self._defined: dict[Formula, list[Formula]] = {}
        self._assumed: dict[Stage, list[Formula]] = {Stage.DURATION: []}
        durations = list(self._duration_obligations())
        self._assumed[Stage.SEPARATION] = [self.terms.negation(o.violation) for o in durations]
        separations = list(self._separation_obligations())
        respected = [self.terms.negation(o.violation) for o in separations]
        self._assumed[Stage.AGREEMENT] = [*self._assumed[Stage.SEPARATION], *respected]
        self._agreements = list(self._agreement_obligations())
        agreed = [self.terms.negation(o.violation) for o in self._agreements]
        self._assumed[Stage.CONDITION] = [*self._assumed[Stage.AGREEMENT], *agreed]
        conditions = self._condition_obligations()
        self.obligations: tuple[Obligation, ...] = (*durations, *separations, *self._agreements, *conditions)

    # -- queries -------------------------------------------------------------------------------------------------

    def query(self, obligation: Obligation) -> list[Formula]:
        """enc_tn ∧ enc_eff ∧ ¬P and the earlier stages: satisfiable if some schedule breaks the obligation.

        Raises:
            OutOfTimeError: if the encoding's deadline passes.
        """
        formulas = [*self.network_formulas(), *self._assumed[obligation.stage], obligation.violation]
        if obligation.violation in self._parts:
            agreed = self._agreements if obligation.stage is Stage.CONDITION else ()
            formulas += self._axioms
            for one in (obligation, *agreed):
                formulas += self._definition_of(one.violation)
        return [formula for formula in formulas if formula is not self.terms.true]

    def full_query(self, obligation: Obligation) -> list[Formula]:
        """The same: every query is over the whole network."""
        return self.query(obligation)

    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and time variables."""
        return [self.terms.at_least(inequality.expression) for inequality in self.network.inequalities]

    # -- obligations, stage by stage -----------------------------------------------------------------------------

    def _duration_obligations(self) -> Iterator[Obligation]:
        for rule in self._rules:
            holds = self._reader.holds(rule.condition, State({}, {}), rule.instance)
            yield Obligation(rule.name, Stage.DURATION, self.terms.negation(holds))

    def _separation_obligations(self) -> Iterator[Obligation]:
        for first, second in self._mutex:
            gap = self.network.distance(first, second)
            near = (self.terms.greater(gap + self.epsilon), self.terms.greater(-gap + self.epsilon))
            together = self.terms.conjunction(near) if self.epsilon else self.terms.equal(gap)
            yield Obligation(f"separation: {first}, {second}", Stage.SEPARATION, together)

    def _agreement_obligations(self) -> Iterator[Obligation]:
        for instance in self.plan.instances:
            for one in instance.agreements:
                yield self._condition_obligation(instance.label(one), one, instance, Stage.AGREEMENT)

    def _condition_obligations(self) -> Iterator[Obligation]:
        for instance in self.plan.instances:
            for duration in instance.durations:
                if any(map(self._writes.changes, fluents_in(duration.condition.expression))):
                    yield self._condition_obligation(instance.label(duration), duration, instance)
            for timed in instance.conditions:
                yield self._condition_obligation(instance.label(timed), timed, instance)
        for goal in self.plan.goal:
            yield self._condition_obligation(goal.label, goal, None)

    def _condition_obligation(
        self, name: str, part: Part, instance: ActionInstance | None, stage: Stage = Stage.CONDITION
    ) -> Obligation:
        violation = self.terms.fresh_boolean(f"violated: {name} ")
        self._parts[violation] = (part, instance)
        return Obligation(name, stage, violation)

    # -- states, with the first query that needs them -------------------------------------------------------------

    @cached_property
    def _positions(self) -> Positions:
        return Positions(self.network, self._known, self.terms)

    @cached_property
    def _known(self) -> Orders:
        """What holds whatever the parameters are; nothing, where what is assumed contradicts itself."""
        points, network = self.plan.time_points, self.network
        rigid = (Difference(a, b, network.distance(a, b), ()) for a, b in permutations(points, 2))
        durations = (bound for rule in self._rules for bound in rule.bounds)
        bounds = network.bounds((*rigid, *network.differences, *durations))
        known = Orders(points, bounds, [self.epsilon])
        if not known.consistent:
            return Orders(points, ())
        for _ in known.separate(self._mutex, self.epsilon):
            pass
        return known

    @cached_property
    def _trajectory(self) -> Trajectory:
        setting = Setting(
            self.plan, self.network, self._known, self._positions, self._writes, self._reader, self._definitions
        )
        return Trajectory(setting, self._deadline)

    @cached_property
    def _overall(self) -> OverAll:
        return OverAll(self._trajectory)

    @cached_property
    def _axioms(self) -> list[Formula]:
        return list(self._positions.axioms(self._deadline))

    def _definition_of(self, violation: Formula) -> list[Formula]:
        """What a condition's violation is, with the definitions of all symbols that occur in it."""
        if violation not in self._defined:
            formula = self._violation(*self._parts[violation])
            needed = self._definitions.needed_by([formula], self._deadline)
            self._defined[violation] = [self.terms.equivalence(violation, formula), *needed]
        return self._defined[violation]

    def _violation(self, part: Part, instance: ActionInstance | None) -> Formula:
        """The negation of one obligation; `instance` is the part's, a goal has none."""
        if instance is None or isinstance(part, GoalCondition):
            return self.terms.negation(self._reader.holds(part.condition, self._trajectory.final))
        if isinstance(part, TimedCondition) and part.timing is Timing.OVER_ALL:
            return self._overall.violation(instance, part.condition, self._deadline)
        point, positions = instance.at(part.timing), self._positions
        return self.terms.disjunction(
            self.terms.conjunction(
                (positions.at(point, k), self.terms.negation(self._reader.holds(part.condition, before, instance)))
            )
            for k, before in enumerate(self._trajectory.before)
            if k > 0 and point in positions.candidates(k)
        )
