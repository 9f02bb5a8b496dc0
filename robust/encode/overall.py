"""Over-all conditions in the relational encoding.

An over-all condition must hold throughout the open interval between start and end of an instance. Between two
happenings every fluent is linear in time, so a condition with at most one comparison of changing fluents needs a look
at the breakpoints only: the happenings that touch what it mentions. Any other condition is examined at a free instant
inside the interval, which the solver places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robust.encode.effects import Flow, names_in
from robust.encode.state import Moment, Side, States, after, before
from robust.encode.variables import Auxiliary
from robust.plan.model import (
    ActionInstance,
    And,
    Atom,
    Comparison,
    Condition,
    Fluent,
    Or,
    ParametrizedPlan,
    Relation,
    TimePoint,
    comparisons,
)
from robust.smt.terms import Formula


class OverAll:
    """Violations of over-all conditions."""

    def __init__(self, plan: ParametrizedPlan, states: States) -> None:
        self._states = states
        self._clock = states.clock
        self._writes = states.writes
        self._terms = states.terms
        self._rank = {point: index for index, point in enumerate(plan.time_points)}
        self._instants = 0

    def violation(self, instance: ActionInstance, condition: Condition) -> Formula:
        """Some instant strictly between start and end at which the condition is false."""
        changing = [leaf for leaf in comparisons(condition) if self._flows(leaf)]
        if not changing:
            cases = self._in_some_state(instance, condition)
        elif len(changing) == 1 and changing[0].relation is not Relation.DIFFERENT:
            cases = self._at_breakpoints(instance, condition, changing[0])
        else:
            cases = self._at_some_instant(instance, condition)
        nonempty = self._clock.earlier(instance.start, instance.end)
        return self._terms.conjunction((nonempty, self._terms.disjunction(cases)))

    # -- the three ways ------------------------------------------------------------------------------------------

    def _in_some_state(self, instance: ActionInstance, condition: Condition) -> Iterator[Formula]:
        """Nothing in the condition changes between happenings: look at the state that each one leaves."""
        yield self._false(condition, after(instance.start), instance)
        for point in self._breakpoints(condition):
            yield self._inside(instance, point, lambda at: self._false(condition, after(at), instance))

    def _at_breakpoints(self, instance: ActionInstance, condition: Condition, leaf: Comparison) -> Iterator[Formula]:
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

    def _at_some_instant(self, instance: ActionInstance, condition: Condition) -> Iterator[Formula]:
        """The solver chooses the instant; what happenings inside leave behind is looked at as well."""
        self._instants += 1
        instant = Auxiliary(f"instant in {instance.identifier}", self._instants)
        inside = self._terms.conjunction(
            (
                self._clock.passed(instance.start, Moment(Side.BEFORE, instant=instant)),
                self._terms.negation(self._clock.passed(instance.end, Moment(Side.AFTER, instant=instant))),
            )
        )
        false = self._false(condition, Moment(Side.BEFORE, instant=instant), instance)
        yield self._terms.conjunction((inside, false))
        for point, jumps in self._breakpoints(condition).items():
            if jumps:
                yield self._inside(instance, point, lambda at: self._false(condition, after(at), instance))

    # -- parts ---------------------------------------------------------------------------------------------------

    def _false(self, condition: Condition, moment: Moment, instance: ActionInstance) -> Formula:
        return self._terms.negation(self._states.condition(condition, moment, instance))

    def _is_inside(self, instance: ActionInstance, point: TimePoint) -> Formula:
        clock = self._clock
        return self._terms.conjunction((clock.earlier(instance.start, point), clock.earlier(point, instance.end)))

    def _inside(self, instance: ActionInstance, point: TimePoint, false: Callable[[TimePoint], Formula]) -> Formula:
        """`false(point)`, if the point lies strictly inside; not even built where the network excludes that."""
        inside = self._is_inside(instance, point)
        return inside if inside is self._terms.false else self._terms.conjunction((inside, false(point)))

    def _breakpoints(self, condition: Condition) -> dict[TimePoint, bool]:
        """The happenings that can change a condition's truth: whether it jumps there, or a fluent only bends."""
        jumps: dict[TimePoint, bool] = {}
        for name in names_in(condition):
            match name:
                case Atom():
                    jumps.update((write.point, True) for write in self._writes.of_atom.get(name, ()))
                case Fluent():
                    jumps.update((write.point, True) for write in self._writes.of_fluent.get(name, ()))
                    for flow in self._writes.flows.get(name, ()):
                        for point in flow.instance.time_points:
                            jumps.setdefault(point, False)
        return dict(sorted(jumps.items(), key=lambda item: self._rank[item[0]]))

    def _flows(self, leaf: Comparison) -> list[Flow]:
        return [
            flow for name in names_in(leaf) if isinstance(name, Fluent) for flow in self._writes.flows.get(name, ())
        ]

    def _may_be_least(self, point: TimePoint, leaf: Comparison) -> bool:
        """Whether the left side of `leaf` can have a local minimum where a flow starts or ends at `point`.

        Where the slope only drops it cannot: an inequality that holds around the point then holds there too.
        """
        if leaf.relation is Relation.EQUAL or not leaf.expression.is_linear:
            return True
        factors = {name: factor for name, factor in leaf.expression.coefficients() if isinstance(name, Fluent)}
        for flow in self._flows(leaf):
            rate = flow.effect.rate
            if point in flow.instance.time_points:
                if not rate.is_constant:
                    return True
                bend = factors[flow.effect.fluent] * rate.constant_term
                if (bend if point == flow.instance.start else -bend) > 0:
                    return True
        return False


def _weaken(condition: Condition, leaf: Comparison) -> Condition:
    """The condition with a strict inequality of `leaf` made non-strict."""
    if condition == leaf and leaf.relation is Relation.GREATER:
        return Comparison(leaf.expression, Relation.AT_LEAST)
    match condition:
        case And(operands):
            return And(tuple(_weaken(operand, leaf) for operand in operands))
        case Or(operands):
            return Or(tuple(_weaken(operand, leaf) for operand in operands))
        case _:
            return condition
