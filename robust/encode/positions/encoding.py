"""The positions encoding as a whole: named obligations, each with the query that refutes it [IRR §2].

Independent of the relational encoding in all but the plan model, and the slower one: the solver searches the orders of
time points that the network leaves open.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import assert_never

from robust.encode.interface import EPSILON, Obligation, Stage
from robust.encode.positions.definitions import Definitions
from robust.encode.positions.network import KnownOrder, Network
from robust.encode.positions.projection import Projection
from robust.encode.positions.reading import Reader, State, fluents_of
from robust.encode.positions.semantics import Part, Semantics
from robust.encode.positions.writes import Writes
from robust.encode.variables import Auxiliary, Linear, constant, variable
from robust.plan.interference import mutex_pairs
from robust.plan.model import (
    ActionInstance,
    Comparison,
    Duration,
    Fluent,
    NumericVariable,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TimePoint,
)
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms

_NOT_NEGATIVE = Comparison(Polynomial.variable(Duration()), Relation.AT_LEAST)
_LENGTH = Auxiliary("duration", 0)


class PositionsEncoding:
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
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    ) -> None:
        self.plan = plan
        self.epsilon = epsilon
        self._deadline = deadline
        self.terms = Terms()
        self._definitions = Definitions(self.terms)
        self.network = Network(plan)
        self.validity = Projection(self.network, self.terms)
        self._reader = Reader(plan, self.network, self.terms)
        self._writes = Writes(plan)
        self._mutex = tuple(mutex_pairs(plan))
        self._parts: dict[Formula, tuple[Part, ActionInstance | None]] = {}
        self._defined: dict[Formula, list[Formula]] = {}
        self._assumed: dict[Stage, list[Formula]] = {Stage.DURATION: []}
        durations = list(self._duration_obligations())
        self._assumed[Stage.SEPARATION] = [self.terms.negation(o.violation) for o in durations]
        separations = list(self._separation_obligations())
        respected = [self.terms.negation(o.violation) for o in separations]
        self._assumed[Stage.CONDITION] = [*self._assumed[Stage.SEPARATION], *respected]
        self.obligations: tuple[Obligation, ...] = (*durations, *separations, *self._condition_obligations())

    # -- queries -------------------------------------------------------------------------------------------------

    def query(self, obligation: Obligation) -> list[Formula]:
        """enc_tn ∧ enc_eff ∧ ¬P and the earlier stages: satisfiable if some schedule breaks the obligation.

        Raises:
            OutOfTimeError: if the encoding's deadline passes.
        """
        formulas = [*self.network_formulas(), *self._assumed[obligation.stage], obligation.violation]
        if obligation.violation in self._parts:
            formulas += [*self._axioms, *self._definition_of(obligation.violation)]
        return [formula for formula in formulas if formula is not self.terms.true]

    def full_query(self, obligation: Obligation) -> list[Formula]:
        """The same: every query is over the whole network."""
        return self.query(obligation)

    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and time variables."""
        return [self.terms.at_least(statement.expression) for statement in self.network.statements]

    def parameters_in(self, formulas: Iterable[Formula]) -> frozenset[str]:
        """Names of the parameters that occur in formulas."""
        symbols = {symbol for formula in formulas for symbol in self.terms.variables(formula)}
        return frozenset(name for name in self.plan.nominal if self.terms.real(ParameterReference(name)) in symbols)

    def unknowns(self) -> list[Formula]:
        """The symbols of the parameters and of the time variables."""
        parameters = map(ParameterReference, self.plan.nominal)
        return [self.terms.real(unknown) for unknown in (*parameters, *self.network.variables)]

    def schedule(self, values: Mapping[str, Fraction]) -> dict[TimePoint, Fraction]:
        """The time of every time point, from values of :meth:`unknowns` by symbol name."""
        return {
            point: place.evaluate({unknown: values[str(unknown)] for unknown in place.variables})
            for point, place in self.network.place.items()
        }

    # -- obligations, stage by stage -----------------------------------------------------------------------------

    def _duration_obligations(self) -> Iterator[Obligation]:
        for instance in self.plan.instances:
            if instance.durative:
                name = f"{instance.identifier} {instance.action}: non-negative duration"
                yield Obligation(name, Stage.DURATION, self._violates_initially(_NOT_NEGATIVE, instance))
                for part in instance.durations:
                    if not self._reads_the_state(part.condition):
                        violation = self._violates_initially(part.condition, instance)
                        yield Obligation(instance.label(part), Stage.DURATION, violation)

    def _violates_initially(self, condition: Comparison, instance: ActionInstance) -> Formula:
        return self.terms.negation(self._reader.holds(condition, State({}, {}), instance))

    def _reads_the_state(self, condition: Comparison) -> bool:
        return any(map(self._writes.changes, fluents_of(condition.expression)))

    def _separation_obligations(self) -> Iterator[Obligation]:
        for first, second in self._mutex:
            gap = self.network.distance(first, second)
            near = (self.terms.greater(gap + self.epsilon), self.terms.greater(-gap + self.epsilon))
            yield Obligation(f"separation: {first}, {second}", Stage.SEPARATION, self.terms.conjunction(near))

    def _condition_obligations(self) -> Iterator[Obligation]:
        for instance in self.plan.instances:
            for duration in instance.durations:
                if self._reads_the_state(duration.condition):
                    yield self._condition_obligation(instance.label(duration), duration, instance)
            for timed in instance.conditions:
                yield self._condition_obligation(instance.label(timed), timed, instance)
        for goal in self.plan.goal:
            yield self._condition_obligation(goal.label, goal, None)

    def _condition_obligation(self, name: str, part: Part, instance: ActionInstance | None) -> Obligation:
        violation = self.terms.fresh_boolean(f"violated: {name} ")
        self._parts[violation] = (part, instance)
        return Obligation(name, Stage.CONDITION, violation)

    # -- states, with the first query that needs them -------------------------------------------------------------

    @cached_property
    def _semantics(self) -> Semantics:
        known = KnownOrder(self.network, self._duration_bounds(), self._mutex, self.epsilon)
        return Semantics(
            plan=self.plan,
            network=self.network,
            known=known,
            writes=self._writes,
            definitions=self._definitions,
            deadline=self._deadline,
        )

    @cached_property
    def _axioms(self) -> list[Formula]:
        return list(self._semantics.positions.axioms(self._deadline))

    def _definition_of(self, violation: Formula) -> list[Formula]:
        """What a condition's violation is, with the definitions of all symbols that occur in it."""
        if violation not in self._defined:
            formula = self._semantics.violation(*self._parts[violation], self._deadline)
            needed = self._definitions.needed_by([formula], self._deadline)
            self._defined[violation] = [self.terms.equivalence(violation, formula), *needed]
        return self._defined[violation]

    def _duration_bounds(self) -> Iterator[tuple[TimePoint, TimePoint, Linear]]:
        """The bounds between start and end that follow from the assumed durations."""
        for instance in self.plan.instances:
            if instance.durative:
                yield instance.start, instance.end, constant(0)
                for part in instance.durations:
                    if not self._reads_the_state(part.condition):
                        yield from self._bounds_of(part.condition, instance)

    def _bounds_of(
        self, condition: Comparison, instance: ActionInstance
    ) -> Iterator[tuple[TimePoint, TimePoint, Linear]]:
        """`?duration ≥ …` and `?duration ≤ …`, as far as a comparison says so."""

        def value(name: NumericVariable) -> Linear:
            match name:
                case Duration():
                    return variable(_LENGTH)
                case ParameterReference():
                    return variable(name)
                case Fluent():
                    return self._reader.initial(name)
            assert_never(name)

        expression = condition.expression.substitute(value)
        factor = expression.terms.get((_LENGTH,), Fraction(0))
        if not factor or not expression.is_linear or condition.relation is Relation.DIFFERENT:
            return
        bound = variable(_LENGTH) - expression.scaled(1 / factor)
        if factor > 0 or condition.relation is Relation.EQUAL:
            yield instance.start, instance.end, bound
        if factor < 0 or condition.relation is Relation.EQUAL:
            yield instance.end, instance.start, -bound
