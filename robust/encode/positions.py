"""The encoding over positions: enc_valid, over-all conditions in the states, and all obligations by name [IRR §2].

enc_valid is ∃t. enc_tn, decided by elimination of the times, one after the other [IRR §4, line 1]. Fourier–Motzkin
elimination of a variable of a difference network joins every lower bound with every upper bound, which are edges of a
graph: `t_target − t_source ≥ weight`, weight over parameters. Between two nodes there may be many weights; those that
never matter within the box in question are redundant. What remains on loops are the facets.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from itertools import permutations
from typing import assert_never

from robust.encode import interface
from robust.encode.network import Difference, Orders, TemporalNetwork, Writes, duration_rules
from robust.encode.trajectories import Positions, PositionState, Reader, Setting, Trajectory
from robust.plan import model, simulate
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Formula, Satisfiability, Session, Terms

CROWDED = 6
"""With more weights than this between two nodes a solver is asked which of them are redundant."""


class Projection:
    """Decides boxes against enc_valid by elimination within the box; facets found are kept and tried first."""

    def __init__(self, network: TemporalNetwork, terms: Terms) -> None:
        self._terms = terms
        self._edges: list[Difference] = []
        self.facets: list[interface.Facet] = []
        for inequality in network.inequalities:
            if interface.is_over_parameters(inequality.expression):
                self.facets.append(interface.Facet(inequality.expression, inequality.origins))
            else:
                self._edges.append(inequality.as_difference())

    def broken_facet(
        self, box: interface.Grid, make_session: Callable[[], Session], deadline: Deadline
    ) -> interface.Facet | Satisfiability | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time.

        `make_session` opens a solver session over the same terms, only if it comes to that.
        """
        if (known := self.known_facet(box)) is not None:
            return known
        try:
            broken = _Elimination(self._edges, box, self._terms, make_session, deadline).broken_loop()
        except OutOfTimeError:
            return Satisfiability.UNKNOWN
        if broken is not None:
            self.facets.append(broken)
        return broken

    def known_facet(self, box: interface.Grid) -> interface.Facet | None:
        """A facet that some point of the box breaks, of those that a search has met."""
        return next((facet for facet in self.facets if facet.breaks_in(box)), None)

    def contradiction(self, values: Mapping[str, Fraction]) -> interface.Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""
        ranges = {name: (value, value) for name, value in values.items()}
        broken = self.broken_facet(interface.Grid(ranges), lambda: Session(self._terms), NEVER)
        return broken if isinstance(broken, interface.Facet) else None


class _Elimination:
    """One elimination of all time variables; redundancy is judged within the box only."""

    def __init__(
        self,
        edges: list[Difference],
        box: interface.Grid,
        terms: Terms,
        make_session: Callable[[], Session],
        deadline: Deadline,
    ) -> None:
        self._box = box
        self._terms = terms
        self._make_session = make_session
        self._deadline = deadline
        self._session: Session | None = None
        self._outgoing: dict[model.TimePoint, dict[model.TimePoint, list[Difference]]] = defaultdict(dict)
        self._incoming: dict[model.TimePoint, set[model.TimePoint]] = defaultdict(set)
        self._broken: interface.Facet | None = None
        for edge in edges:
            self._join(edge.source, edge.target, [edge])

    def broken_loop(self) -> interface.Facet | None:
        """The first facet that breaks in the box.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        waiting = {node for node in (*self._outgoing, *self._incoming) if node != model.ZERO}
        while waiting and self._broken is None:
            # The variable with the fewest joins; by name among equals, so that runs repeat.
            node = min(waiting, key=lambda n: (len(self._outgoing[n]) * len(self._incoming[n]), n))
            waiting.remove(node)
            self._eliminate(node)
        return self._broken

    def _eliminate(self, node: model.TimePoint) -> None:
        after = self._outgoing.pop(node)
        before = {source: self._outgoing[source].pop(node) for source in self._incoming.pop(node)}
        for target in after:
            self._incoming[target].discard(node)
        for source, firsts in before.items():
            for target, seconds in after.items():
                self._join(source, target, list(self._sums(firsts, seconds)))
                if self._broken is not None:
                    return

    def _sums(self, firsts: list[Difference], seconds: list[Difference]) -> Iterator[Difference]:
        for first in firsts:
            self._deadline.enforce()
            for second in seconds:
                origins = tuple(dict.fromkeys((*first.origins, *second.origins)))
                yield Difference(first.source, second.target, first.weight + second.weight, origins)

    def _join(self, source: model.TimePoint, target: model.TimePoint, edges: list[Difference]) -> None:
        if source == target:
            facets = (interface.Facet(-edge.weight, edge.origins) for edge in edges)
            self._broken = self._broken or next((facet for facet in facets if facet.breaks_in(self._box)), None)
            return
        known = self._outgoing[source].setdefault(target, [])
        self._incoming[target].add(source)
        for edge in edges:
            self._deadline.enforce()
            if not any(self._is_covered(edge, by) for by in known):
                known[:] = [*(other for other in known if not self._is_covered(other, edge)), edge]
        if len(known) > CROWDED:
            self._outgoing[source][target] = list(self._without_redundant(known))

    def _is_covered(self, edge: Difference, by: Difference) -> bool:
        """Whether the weight of `by` is at least as great all over the box."""
        margin = interface.least(by.weight - edge.weight, self._box.ranges)
        return margin is not None and margin >= 0

    def _without_redundant(self, edges: list[Difference]) -> Iterator[Difference]:
        """Leave out every edge whose weight nowhere in the box exceeds all the others that are left."""
        session = self._session = self._session or self._open_session()
        remaining = list(edges)
        for edge in edges:
            others = [other for other in remaining if other is not edge]
            with session.frame(*(self._terms.greater(edge.weight - other.weight) for other in others)):
                verdict = session.check("enc_valid: a redundant bound", self._deadline)
            if verdict is Satisfiability.UNKNOWN:
                raise OutOfTimeError
            if verdict is Satisfiability.UNSATISFIABLE:
                remaining = others
            else:
                yield edge

    def _open_session(self) -> Session:
        session = self._make_session()
        for name, (low, high) in self._box.ranges.items():
            value = interface.variable(model.ParameterReference(name))
            if low is not None:
                session.add(self._terms.at_least(value - low))
            if high is not None:
                session.add(self._terms.at_least(-value + high))
        return session


Part = model.TimedCondition | model.DurationConstraint | model.GoalCondition
"""What is proved: each is an obligation."""


class PositionedOverAll:
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

    def violation(self, instance: model.ActionInstance, condition: model.Condition, deadline: Deadline) -> Formula:
        """Some instant of the open interval at which the condition is false.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        parts = list(model.conjuncts(condition))
        return self._terms.disjunction(
            self._terms.conjunction((inside, case))
            for step, inside in self._steps(instance, deadline)
            for part in parts
            for case in self._in_step(instance, part, step)
        )

    def _steps(self, instance: model.ActionInstance, deadline: Deadline) -> Iterator[tuple[int, Formula]]:
        """The steps that may lie inside and take time."""
        for step in range(1, self._positions.last):
            deadline.enforce()
            lasting = self._terms.negation(self._positions.same(step + 1))
            inside = self._terms.conjunction((self._flows.acts(instance, step), lasting))
            if inside is not self._terms.false:
                yield step, inside

    def _in_step(self, instance: model.ActionInstance, condition: model.Condition, step: int) -> Iterator[Formula]:
        moving = [leaf for leaf in dict.fromkeys(model.comparisons(condition)) if self._moves(leaf)]
        left = self._trajectory.after[step]
        if not moving:
            # Happenings inside leave no state that does not last through a step inside.
            yield self._false(condition, left, instance)
        elif len(moving) == 1:
            yield self._false_in_interior(instance, condition, moving[0], step)
            if moving[0].relation in (model.Relation.GREATER, model.Relation.DIFFERENT):
                yield from self._false_at_ends(instance, condition, step)
        else:
            yield self._false_at_instant(instance, condition, step)
            yield from self._false_at_ends(instance, condition, step)

    def _moves(self, leaf: model.NumericCondition) -> bool:
        return any(self._writes.flows.get(fluent) for fluent in model.fluents_in(leaf.expression))

    def _false(self, condition: model.Condition, state: PositionState, instance: model.ActionInstance) -> Formula:
        return self._terms.negation(self._reader.holds(condition, state, instance))

    def _false_in_interior(
        self, instance: model.ActionInstance, condition: model.Condition, moving: model.NumericCondition, step: int
    ) -> Formula:
        """All else is constant in the interior, so the condition is false there where its only moving part is."""
        broken = self._broken_in_interior(instance, moving, step)
        truth = self._terms.negation(broken)
        holds = self._reader.holds(
            condition, self._trajectory.after[step], instance, lambda leaf: truth if leaf == moving else None
        )
        return self._terms.negation(holds)

    def _broken_in_interior(self, instance: model.ActionInstance, moving: model.NumericCondition, step: int) -> Formula:
        """Whether a linear function leaves a relation to zero somewhere between its limits `left` and `right`."""
        terms = self._terms
        left = self._reader.value(moving.expression, self._trajectory.after[step], instance)
        right = self._reader.value(moving.expression, self._trajectory.before[step + 1], instance)
        both_zero = terms.conjunction((terms.equal(left), terms.equal(right)))
        match moving.relation:
            case model.Relation.AT_LEAST:
                return terms.disjunction((terms.greater(-left), terms.greater(-right)))
            case model.Relation.GREATER:
                return terms.disjunction((terms.greater(-left), terms.greater(-right), both_zero))
            case model.Relation.EQUAL:
                return terms.negation(both_zero)
            case model.Relation.DIFFERENT:
                falls = terms.conjunction((terms.greater(left), terms.greater(-right)))
                rises = terms.conjunction((terms.greater(-left), terms.greater(right)))
                return terms.disjunction((falls, rises, both_zero))
        assert_never(moving.relation)

    def _false_at_ends(
        self, instance: model.ActionInstance, condition: model.Condition, step: int
    ) -> Iterator[Formula]:
        """At a happening inside the interval the values themselves count: just after it, and just before it."""
        terms, positions, places = self._terms, self._positions, self._network.places
        after_start = terms.greater(positions.time(step) - places[instance.start])
        yield terms.conjunction((after_start, self._false(condition, self._trajectory.after[step], instance)))
        before_end = terms.greater(places[instance.end] - positions.time(step + 1))
        yield terms.conjunction((before_end, self._false(condition, self._trajectory.before[step + 1], instance)))

    def _false_at_instant(self, instance: model.ActionInstance, condition: model.Condition, step: int) -> Formula:
        self._instants += 1
        instant = interface.variable(interface.Auxiliary(f"instant in {instance.identifier}", self._instants))
        left = self._trajectory.after[step]
        moved = dict(left.fluents)
        for fluent in {
            f for leaf in model.comparisons(condition) for f in model.fluents_in(leaf.expression)
        } & moved.keys():
            moved[fluent] += self._flows.until(fluent, step, instant)
        inside = (
            self._terms.greater(instant - self._positions.time(step)),
            self._terms.greater(self._positions.time(step + 1) - instant),
        )
        return self._terms.conjunction((*inside, self._false(condition, PositionState(left.atoms, moved), instance)))


class PositionsEncoding(interface.Encoding):
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
        self, plan: model.ParametrizedPlan, epsilon: Fraction = interface.EPSILON, *, deadline: Deadline = NEVER
    ) -> None:
        self.plan = plan
        self.epsilon = epsilon
        self._deadline = deadline
        self.terms = Terms()
        self._definitions = interface.Definitions(self.terms)
        self.network = TemporalNetwork(plan)
        self.places = self.network.places
        self.validity = Projection(self.network, self.terms)
        self._reader = Reader(plan, self.network, self.terms)
        self._writes = Writes(plan)
        self._mutex = tuple(simulate.mutex_pairs(plan))
        self._rules = tuple(duration_rules(plan, self._writes))
        self._parts: dict[Formula, tuple[Part, model.ActionInstance | None]] = {}
        self._defined: dict[Formula, list[Formula]] = {}
        self._assumed: dict[interface.Stage, list[Formula]] = {interface.Stage.DURATION: []}
        durations = list(self._duration_obligations())
        self._assumed[interface.Stage.SEPARATION] = [
            self.terms.negation(o.violation) for o in durations if o.violation is not None
        ]
        separations = list(self._separation_obligations())
        respected = [self.terms.negation(o.violation) for o in separations if o.violation is not None]
        self._assumed[interface.Stage.AGREEMENT] = [*self._assumed[interface.Stage.SEPARATION], *respected]
        self._agreements = list(self._agreement_obligations())
        agreed = [self.terms.negation(o.violation) for o in self._agreements]
        self._assumed[interface.Stage.CONDITION] = [*self._assumed[interface.Stage.AGREEMENT], *agreed]
        conditions = self._condition_obligations()
        self.obligations: tuple[interface.Obligation, ...] = (*durations, *separations, *self._agreements, *conditions)

    # -- queries -------------------------------------------------------------------------------------------------

    def query(self, obligation: interface.Obligation) -> list[Formula]:
        """enc_tn ∧ enc_eff ∧ ¬P and the earlier stages: satisfiable if some schedule breaks the obligation.

        Raises:
            OutOfTimeError: if the encoding's deadline passes.
        """
        formulas = [*self.network_formulas(), *self._assumed[obligation.stage], self.violation(obligation)]
        if obligation.violation in self._parts:
            agreed = self._agreements if obligation.stage is interface.Stage.CONDITION else ()
            formulas += self._axioms
            for part in (obligation, *agreed):
                formulas += self._definition_of(part.violation)
        return [formula for formula in formulas if formula is not self.terms.true]

    def full_query(self, obligation: interface.Obligation) -> list[Formula]:
        """The query itself: it is over the whole network already."""
        return self.query(obligation)

    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and time variables."""
        return [self.terms.at_least(inequality.expression) for inequality in self.network.inequalities]

    # -- obligations, stage by stage -----------------------------------------------------------------------------

    def _duration_obligations(self) -> Iterator[interface.Obligation]:
        for rule in self._rules:
            holds = self._reader.holds(rule.condition, PositionState({}, {}), rule.instance)
            yield self.obligation(rule.name, interface.Stage.DURATION, self.terms.negation(holds))

    def _separation_obligations(self) -> Iterator[interface.Obligation]:
        for first, second in self._mutex:
            gap = self.network.distance(first, second)
            near = (self.terms.greater(gap + self.epsilon), self.terms.greater(-gap + self.epsilon))
            together = self.terms.conjunction(near) if self.epsilon else self.terms.equal(gap)
            yield self.obligation(f"separation: {first}, {second}", interface.Stage.SEPARATION, together)

    def _agreement_obligations(self) -> Iterator[interface.Obligation]:
        for instance in self.plan.instances:
            for agreement in instance.agreements:
                yield self._condition_obligation(
                    instance.label(agreement), agreement, instance, interface.Stage.AGREEMENT
                )

    def _condition_obligations(self) -> Iterator[interface.Obligation]:
        for instance in self.plan.instances:
            for duration in instance.durations:
                if any(map(self._writes.changes, model.fluents_in(duration.condition.expression))):
                    yield self._condition_obligation(instance.label(duration), duration, instance)
            for timed in instance.conditions:
                yield self._condition_obligation(instance.label(timed), timed, instance)
        for goal in self.plan.goal:
            yield self._condition_obligation(goal.label, goal, None)

    def _condition_obligation(
        self,
        name: str,
        part: Part,
        instance: model.ActionInstance | None,
        stage: interface.Stage = interface.Stage.CONDITION,
    ) -> interface.Obligation:
        violation = self.terms.fresh_boolean(f"violated: {name} ")
        self._parts[violation] = (part, instance)
        return interface.Obligation(name, stage, violation)

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
    def _overall(self) -> PositionedOverAll:
        return PositionedOverAll(self._trajectory)

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

    def _violation(self, part: Part, instance: model.ActionInstance | None) -> Formula:
        """The negation of one obligation; `instance` is the part's, a goal has none."""
        if instance is None or isinstance(part, model.GoalCondition):
            return self.terms.negation(self._reader.holds(part.condition, self._trajectory.final))
        if isinstance(part, model.TimedCondition) and part.timing is model.Timing.OVER_ALL:
            return self._overall.violation(instance, part.condition, self._deadline)
        point, positions = instance.at(part.timing), self._positions
        return self.terms.disjunction(
            self.terms.conjunction(
                (positions.at(point, k), self.terms.negation(self._reader.holds(part.condition, before, instance)))
            )
            for k, before in enumerate(self._trajectory.before)
            if k > 0 and point in positions.candidates(k)
        )
