"""The relational encoding as a whole: named obligations, each with the query that refutes it.

`enc_proofs` is examined in stages, by ∀X(A → P₁ ∧ P₂) ≡ ∀X(A → P₁) ∧ ∀X(A ∧ P₁ → P₂): durations first, then
ε-separation, then whether effects agree, then conditions and the goal. Each stage may assume the ones before it, which
decides most orders.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache

from robust.encode.effects import Writes, mutex_pairs
from robust.encode.interface import EPSILON, Encoding, Obligation, Stage
from robust.encode.network import IndependentParts, Orders, TemporalNetwork, duration_rules
from robust.encode.overall import OverAll
from robust.encode.settled import proved
from robust.encode.state import FINALLY, Clock, Moment, States, before
from robust.encode.validity import Validity
from robust.encode.variables import Linear
from robust.errors import UnsupportedError
from robust.plan.model import ZERO, ActionInstance, Condition, ParametrizedPlan, TimePoint, Timing
from robust.smt.terms import Formula, Terms


class RelationalEncoding(Encoding):
    """enc_tn, enc_eff and enc_proofs of a plan without positions.

    Args:
        plan: the ground, parametrized plan.
        epsilon: the separation of mutex time points.

    Raises:
        UnsupportedError: if an expression is not linear after folding constants.
    """

    name = "relational"

    def __init__(self, plan: ParametrizedPlan, epsilon: Fraction = EPSILON) -> None:
        self.plan = plan
        self.epsilon = epsilon
        self.terms = Terms()
        self.network = TemporalNetwork(plan)
        self.places = self.network.places
        writes = Writes(plan)
        self._rules = tuple(duration_rules(plan, writes))
        self.validity = Validity(self.network, self._rules, self.terms)
        self._mutex = mutex_pairs(plan)
        self._proved = proved(plan, epsilon, self._mutex)
        self._orders = self._known_orders()
        self._states = States(plan, writes, Clock(self.network, self._orders, self.terms))
        self._overall = OverAll(plan, self._states)
        self._assumed: dict[Stage, list[Linear]] = {Stage.DURATION: []}
        # Each stage's obligations are built before the orders learn them, and after they learnt the earlier stages'.
        durations = list(self._duration_obligations())
        self._assumed[Stage.SEPARATION] = list(self._learn_durations())
        separations = list(self._separation_obligations())
        self._assumed[Stage.AGREEMENT] = [*self._assumed[Stage.SEPARATION], *self._learn_separations()]
        self._assumed[Stage.CONDITION] = self._assumed[Stage.AGREEMENT]
        agreements = list(self._by_instance(self._agreements_of))
        self._agreed = [self.terms.negation(one.violation) for one in agreements if one.violation != self.terms.false]
        conditions = (*self._by_instance(self._conditions_of), *self._goals())
        self.obligations: tuple[Obligation, ...] = (*durations, *separations, *agreements, *conditions)
        self._slices = cache(self._make_slices)

    # -- queries -------------------------------------------------------------------------------------------------

    def query(self, obligation: Obligation) -> list[Formula]:
        """Satisfiable, for parameter values within enc_valid, if some schedule breaks the obligation.

        Only the part of the network that the violation touches: the rest has a schedule whenever enc_valid holds. For
        the same reason a violation over parameters alone needs no network.
        """
        formulas = self._about_states(obligation)
        if len(formulas) == 1 and len(self.parameters_in(formulas)) == len(self.terms.variables(obligation.violation)):
            return formulas
        return [*self._slices(obligation.stage).touching(formulas), *formulas]

    def full_query(self, obligation: Obligation) -> list[Formula]:
        """As :meth:`query` over the whole network: a model gives a time to every time point."""
        assumed = map(self.terms.at_least, self._assumed[obligation.stage])
        return [*self.network_formulas(), *assumed, *self._about_states(obligation)]

    def _about_states(self, obligation: Obligation) -> list[Formula]:
        """The violation, that effects agree if that may be assumed, and the definitions of what occurs in these."""
        agreed = self._agreed if obligation.stage is Stage.CONDITION else ()
        formulas = [obligation.violation, *agreed]
        return [*formulas, *self._states.definitions.needed_by(formulas)]

    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and free time points."""
        return [self.terms.at_least(inequality.expression) for inequality in self.network.inequalities]

    # -- obligations, stage by stage -----------------------------------------------------------------------------

    def _duration_obligations(self) -> Iterator[Obligation]:
        for rule in self._rules:
            violation = self.terms.false
            if rule.name not in self._proved:
                holds = self._states.condition(rule.condition, before(rule.instance.start), rule.instance)
                violation = self.terms.negation(holds)
            yield Obligation(rule.name, Stage.DURATION, violation)

    def _separation_obligations(self) -> Iterator[Obligation]:
        for first, second in self._mutex:
            name = f"separation: {first}, {second}"
            violation = self.terms.false
            if name not in self._proved and not self._is_separated(first, second):
                gap = self.network.distance(first, second)
                near = (self.terms.greater(-gap + self.epsilon), self.terms.greater(gap + self.epsilon))
                violation = self.terms.conjunction(near) if self.epsilon else self.terms.equal(gap)
            yield Obligation(name, Stage.SEPARATION, violation)

    def _by_instance(self, obligations_of: Callable[[ActionInstance], Iterator[Obligation]]) -> Iterator[Obligation]:
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

    def _agreements_of(self, instance: ActionInstance) -> Iterator[Obligation]:
        for one in instance.agreements:
            read = before(instance.at(one.timing))
            yield self._condition(instance.label(one), one.condition, read, instance, Stage.AGREEMENT)

    def _conditions_of(self, instance: ActionInstance) -> Iterator[Obligation]:
        unconditional = [rule.condition for rule in self._rules if rule.instance is instance]
        for duration in instance.durations:
            if duration.condition not in unconditional:
                read = before(instance.at(duration.timing))
                yield self._condition(instance.label(duration), duration.condition, read, instance)
        for timed in instance.conditions:
            moment = None if timed.timing is Timing.OVER_ALL else before(instance.at(timed.timing))
            yield self._condition(instance.label(timed), timed.condition, moment, instance)

    def _condition(
        self,
        name: str,
        condition: Condition,
        moment: Moment | None,
        instance: ActionInstance | None = None,
        stage: Stage = Stage.CONDITION,
    ) -> Obligation:
        """That a condition holds at a moment, or throughout an instance."""
        violation = self.terms.false
        if name not in self._proved:
            if moment is None and instance is not None:
                violation = self._overall.violation(instance, condition)
            else:
                violation = self.terms.negation(self._states.condition(condition, moment or FINALLY, instance))
        return Obligation(name, stage, violation)

    # -- what is known of the order, and what a stage assumes -----------------------------------------------------

    def _known_orders(self) -> Orders:
        learnt = [weight for rule in self._rules for _, _, weight in self.network.bounds(rule.bounds)]
        bounds = self.network.bounds(self.network.differences)
        return Orders(self.plan.time_points, bounds, [self.epsilon, *learnt])

    def _is_separated(self, first: TimePoint, second: TimePoint) -> bool:
        bounds = (self._orders.least(first, second), self._orders.least(second, first))
        return any(bound is not None and bound >= self.epsilon and bound > 0 for bound in bounds)

    def _learn_durations(self) -> Iterator[Linear]:
        """All bounds are assumed, also those that the network implies: its slices may leave out what implies them."""
        for rule in self._rules:
            for learnt in self.network.bounds(rule.bounds):
                self._orders.learn(*learnt)
            for slack in map(self.network.slack, rule.bounds):
                if not slack.is_constant or slack.constant_term < 0:
                    yield slack

    def _learn_separations(self) -> Iterator[Linear]:
        """A mutex pair whose order is known up to less than ε is ε apart in that order."""
        for first, second in self._orders.separate(self._mutex, self.epsilon):
            yield self.network.distance(first, second) - self.epsilon

    def _make_slices(self, stage: Stage) -> IndependentParts:
        """enc_tn with what the stage assumes; `t ≥ 0` is left out where an earlier time point implies it."""
        supported = set() if stage is Stage.DURATION else self._supported_points()
        network = [i.expression for i in self.network.inequalities if i.not_before_zero not in supported]
        return IndependentParts(self.terms, [*network, *self._assumed[stage]])

    def _supported_points(self) -> set[TimePoint]:
        """Time points that follow another one, other than zero, in every schedule that respects durations.

        Ties are counted in the plan's order only, so that no two points support each other in a circle.
        """
        rank = {point: index for index, point in enumerate(self.plan.time_points)}
        differences = [*self.network.differences, *(bound for rule in self._rules for bound in rule.bounds)]
        return {
            target
            for source, target, weight in self.network.bounds(differences)
            if source != ZERO and (weight > 0 or (weight == 0 and rank[source] < rank[target]))
        }
