"""What a correct execution is, as formulas over choices and event times [PIKE, Definitions 2.5 and 2.6]."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import combinations

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Assignment, Choice, Condition, Constraint, Effect, Guard, Literal, TeamPlan
from robust.plan.polynomial import Polynomial
from robust.smt.session import Value
from robust.smt.terms import Formula, Terms


class Semantics:
    """The formulas of one plan, and how its choices and times are read from their models.

    A choice with two values is one boolean. A guard is a conjunction, and the time of an event that is not activated
    does not matter.

    Args:
        terms: where formulas are built; plans that share them, and have events of the same names, share formulas.

    Raises:
        InputError: if a guard, a constraint, a condition or an effect mentions an unknown choice, value or event.
    """

    def __init__(self, plan: TeamPlan, terms: Terms | None = None) -> None:
        self.terms = terms or Terms()
        self._plan = plan
        self._choices = plan.network.choices
        self._values: dict[Assignment, Formula] = {}
        domains = [formula for choice in self._choices for formula in self._declare(choice)]
        self._times = {event.name: Polynomial.variable(f"time of {event.name}") for event in plan.network.events}
        self._orders: dict[tuple[str, str], Formula] = {}
        self._effects: dict[Literal, list[Effect]] = {}
        for effect in plan.effects:
            self._effects.setdefault(effect.literal, []).append(effect)
        self.formulas: tuple[Formula, ...] = (
            *domains,
            *(self._constraint(each) for each in plan.network.temporal_constraints),
            *(self._condition(each) for each in plan.conditions),
        )
        self.choices: frozenset[Formula] = frozenset().union(*map(self.terms.variables, self._values.values()))
        """The symbols of choices."""

    def guard(self, conjunction: Guard) -> Formula:
        """All assignments of a guard; InputError if one is unknown."""
        return self.terms.conjunction(self._assignment(each) for each in sorted(conjunction))

    def scenario(self, values: Mapping[str, str]) -> Formula:
        """A full assignment."""
        return self.guard(frozenset(Assignment(variable, value) for variable, value in values.items()))

    def unless(self, guard: Guard, consequence: Formula) -> Formula:
        """The consequence, unless the guard does not hold."""
        return self.terms.implication(self.guard(guard), consequence)

    def at(self, event: str, time: Fraction) -> Formula:
        """The event's time, outright."""
        return self.terms.equal(self._time(event) - time)

    def not_before(self, event: str, time: Fraction) -> Formula:
        """The event is at this time or later."""
        return self.terms.at_least(self._time(event) - time)

    def chosen(self, values: Mapping[str, Value]) -> dict[str, str]:
        """The scenario of a model; a choice that no formula mentions gets its first value."""
        return {choice.name: self._chosen(choice, values) for choice in self._choices}

    def times(self, events: Iterable[str]) -> list[Formula]:
        """The symbols of the events' times."""
        return [self.terms.real(f"time of {event}") for event in events]

    def time(self, event: str, values: Mapping[str, Value]) -> Fraction:
        """The event's time in a model; zero if no formula mentions it."""
        return Fraction(values.get(f"time of {event}", Fraction(0)))

    def _declare(self, choice: Choice) -> Iterator[Formula]:
        """Symbols for a choice's values; what makes exactly one of them true."""
        match choice.domain:
            case (only,):
                self._values[Assignment(choice.name, only)] = self.terms.true
            case (first, second):
                symbol = self.terms.fresh_boolean(f"{choice.name}={first} ")
                self._values[Assignment(choice.name, first)] = symbol
                self._values[Assignment(choice.name, second)] = self.terms.negation(symbol)
            case values:
                symbols = [self.terms.fresh_boolean(f"{choice.name}={value} ") for value in values]
                self._values.update(zip((Assignment(choice.name, value) for value in values), symbols, strict=True))
                yield self.terms.disjunction(symbols)
                for one, other in combinations(symbols, 2):
                    yield self.terms.disjunction((self.terms.negation(one), self.terms.negation(other)))

    def _chosen(self, choice: Choice, values: Mapping[str, Value]) -> str:
        for value in choice.domain:
            symbol = self._values[Assignment(choice.name, value)]
            if symbol is self.terms.true:
                return value
            negative = symbol.is_not()
            name = (symbol.arg(0) if negative else symbol).symbol_name()
            if name in values and values[name] != negative:
                return value
        return choice.domain[0]

    def _assignment(self, assignment: Assignment) -> Formula:
        if assignment not in self._values:
            known = [str(each) for each in self._values]
            raise InputError(f"unknown assignment {assignment}{did_you_mean(str(assignment), known)}")
        return self._values[assignment]

    def _time(self, event: str) -> Polynomial[str]:
        if event not in self._times:
            raise InputError(f"unknown event {event}{did_you_mean(event, self._times)}")
        return self._times[event]

    def _constraint(self, constraint: Constraint) -> Formula:
        difference = self._time(constraint.target) - self._time(constraint.source)
        bounds = []
        if constraint.lower is not None:
            bounds.append(self.terms.at_least(difference - constraint.lower))
        if constraint.upper is not None:
            bounds.append(self.terms.at_least(-difference + constraint.upper))
        return self.unless(constraint.guard, self.terms.conjunction(bounds))

    def _condition(self, condition: Condition) -> Formula:
        """Some activated producer is before the condition, and every activated threat is before or after both."""
        threats = [
            effect
            for effect in self._effects.get(condition.literal.negation, [])
            if not self._exempt(effect, condition) and _compatible(condition.guard, effect.guard)
        ]
        supports = (
            self._support(producer, threats, condition)
            for producer in self._effects.get(condition.literal, [])
            if _compatible(condition.guard, producer.guard)
        )
        return self.unless(condition.guard, self.terms.disjunction(supports))

    def _support(self, producer: Effect, threats: list[Effect], condition: Condition) -> Formula:
        return self.terms.conjunction(
            (
                self.guard(producer.guard),
                self._in_time(producer, condition),
                *(
                    self.unless(
                        threat.guard,
                        self.terms.disjunction(
                            (self._before(threat.event, producer.event), self._before(condition.last, threat.event))
                        ),
                    )
                    for threat in threats
                    if _compatible(producer.guard, threat.guard)
                ),
            )
        )

    def _in_time(self, producer: Effect, condition: Condition) -> Formula:
        over_all = condition.first != condition.last
        own = producer.activity is not None and producer.activity == condition.activity
        if over_all and own and producer.event == condition.first:
            return self.terms.true
        return self._before(producer.event, condition.first)

    def _exempt(self, threat: Effect, condition: Condition) -> bool:
        own = threat.activity is not None and threat.activity == condition.activity
        return own and threat.event == condition.last

    def _before(self, earlier: str, later: str) -> Formula:
        order = (earlier, later)
        if order not in self._orders:
            self._orders[order] = self.terms.greater(self._time(later) - self._time(earlier))
        return self._orders[order]


def _compatible(one: Guard, other: Guard) -> bool:
    """Whether no choice has different values in the two guards."""
    values = dict(one)
    return all(values.get(variable, value) == value for variable, value in other)
