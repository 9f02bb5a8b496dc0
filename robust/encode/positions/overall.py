"""Over-all conditions: instants strictly between start and end of an instance at which one is false [IRR §2].

The open interval consists of the interiors of steps, in which fluents are linear in time, and of the happenings between
them. In a step's interior each comparison is decided by the limits at both ends; only a disjunction of several
comparisons that change needs an instant of the solver's choice, a Skolem constant for "some instant".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import assert_never

from robust.encode.positions.flows import Flows
from robust.encode.positions.network import Network
from robust.encode.positions.order import Positions
from robust.encode.positions.reading import Reader, State, comparisons, fluents_of
from robust.encode.positions.trajectory import Trajectory
from robust.encode.positions.writes import Writes
from robust.encode.variables import Auxiliary, variable
from robust.plan.model import ActionInstance, Comparison, Condition, Relation, conjuncts
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms


class OverAll:
    """Violations of over-all conditions."""

    def __init__(
        self,
        *,
        network: Network,
        positions: Positions,
        flows: Flows,
        writes: Writes,
        reader: Reader,
        trajectory: Trajectory,
        terms: Terms,
    ) -> None:
        self._network = network
        self._positions = positions
        self._flows = flows
        self._writes = writes
        self._reader = reader
        self._trajectory = trajectory
        self._terms = terms
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
        return any(self._writes.flows.get(fluent) for fluent in fluents_of(leaf.expression))

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
        terms, positions, place = self._terms, self._positions, self._network.place
        after_start = terms.greater(positions.time(step) - place[instance.start])
        yield terms.conjunction((after_start, self._false(condition, self._trajectory.after[step], instance)))
        before_end = terms.greater(place[instance.end] - positions.time(step + 1))
        yield terms.conjunction((before_end, self._false(condition, self._trajectory.before[step + 1], instance)))

    def _false_at_instant(self, instance: ActionInstance, condition: Condition, step: int) -> Formula:
        self._instants += 1
        instant = variable(Auxiliary(f"instant in {instance.identifier}", self._instants))
        left = self._trajectory.after[step]
        moved = dict(left.fluents)
        for fluent in {f for leaf in comparisons(condition) for f in fluents_of(leaf.expression)} & moved.keys():
            moved[fluent] += self._flows.until(fluent, step, instant)
        inside = (
            self._terms.greater(instant - self._positions.time(step)),
            self._terms.greater(self._positions.time(step + 1) - instant),
        )
        return self._terms.conjunction((*inside, self._false(condition, State(left.atoms, moved), instance)))
