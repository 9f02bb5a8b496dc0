"""Executions that wait: what is done until it is known what someone has chosen is the same, whatever that will be.

There is one copy of the plan for each combination of choices, and any two of them go together until a choice that they
differ in is made. What is done differently, or at another time, comes at least ε after such a choice; what the choice
itself activates may begin at once. Choices that nobody asked about are made like those of the executive: they may
depend on what is known, and on nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations as pairs

from robust.pike_bridge.envelopes.parameters import ParametricPlan
from robust.pike_bridge.envelopes.pieces import ParametricSemantics, Question, Statement
from robust.pike_bridge.model import ALWAYS, Assignment, Choice, Event, Guard, reachable
from robust.plan.model import ParameterReference
from robust.qe.nnf import Leaf, Reader
from robust.smt.terms import Formula, Terms


def waiting_question(parametric: ParametricPlan, alternatives: Sequence[Guard], assume: Guard = ALWAYS) -> Question:
    """For which parameter values can one wait, and have a correct execution whichever alternative is chosen?

    Args:
        alternatives: combinations of values, of which any two have different values of some choice.
        assume: choices that are made already, and known from the beginning.
    """
    return _Waiting(parametric, alternatives, assume).question()


class _Order:
    """Which events are no later than others, whatever the parameters are, by lower bounds that are not negative."""

    def __init__(self, parametric: ParametricPlan) -> None:
        network = parametric.plan.network
        self._guards = network.guards
        least = {ParameterReference(one.name): one.lower for one in parametric.declared if one.lower is not None}
        self._after: dict[str, list[tuple[str, Guard]]] = {}
        for one, (lower, _) in zip(network.temporal_constraints, parametric.bounds, strict=True):
            # Bounds are numbers to which parameters are added.
            if lower is not None and lower.variables <= least.keys() and lower.evaluate(least) >= 0:
                label = one.guard | self._guards[one.target]
                self._after.setdefault(one.source, []).append((one.target, label))

    def no_later(self, event: str, other: str) -> bool:
        """Whether the event is not after the other one whenever both are executed."""
        both = self._guards[event] | self._guards[other]
        after = {each: [target for target, label in found if label <= both] for each, found in self._after.items()}
        return other in reachable(after, event)


class _Waiting:
    def __init__(self, parametric: ParametricPlan, alternatives: Sequence[Guard], assume: Guard) -> None:
        self._plan = parametric.plan
        self._terms = Terms()
        self._reader = Reader(self._terms)
        self._alternatives = alternatives
        self._order = _Order(parametric)
        self._statements: dict[Leaf, Statement] = {}
        self._decided_at: dict[str, list[Choice]] = {}
        asked = {one.variable for each in alternatives for one in each}
        for choice in self._plan.network.choices:
            if choice.event is not None and choice.name not in asked:
                self._decided_at.setdefault(choice.event, []).append(choice)
        self._copies: list[ParametricSemantics] = []
        alike = {event.name: self._alike(event.name) for event in self._plan.network.events}
        for number, alternative in enumerate(alternatives):
            self._copies.append(
                ParametricSemantics(
                    parametric,
                    self._terms,
                    self._reader,
                    copies={event: f" ({first[number]})" for event, first in alike.items()},
                    given=alternative | assume,
                    shared={
                        choice.name: self._copies[alike[event][number]]
                        for event, choices in self._decided_at.items()
                        for choice in choices
                        if alike[event][number] < number and not self._plan.network.guards[event]
                    },
                )
            )

    def _alike(self, event: str) -> list[int]:
        """For each copy the first one of those which all have the event, if they do, at one time.

        So it is if the event is never after what tells two copies apart.
        """
        groups: list[list[int]] = []
        found = []
        for number in range(len(self._alternatives)):
            group = next((each for each in groups if all(self._untold(event, one, number) for one in each)), None)
            if group is None:
                groups.append(group := [])
            group.append(number)
            found.append(group[0])
        return found

    def _untold(self, event: str, one: int, other: int) -> bool:
        """Whether an event is never after a choice by which two copies are told apart."""
        names = self._telling(one, other)
        told_at = (choice.event for choice in self._plan.network.choices if choice.name in names)
        return all(each is None or self._order.no_later(event, each) for each in told_at)

    def question(self) -> Question:
        """The formulas of all copies, and what joins them."""
        formulas: list[Formula] = []
        for copy in self._copies:
            formulas += copy.formulas
            self._statements |= copy.statements
        for one, other in self._neighbours():
            formulas += self._together(one, other)
        terms = self._terms
        return Question(
            terms,
            self._reader,
            tuple(dict.fromkeys(formulas)),  # those of what copies share are the same
            self._statements,
            frozenset(),
            lambda _values: ALWAYS,
            lambda _label: terms.true,
        )

    def _neighbours(self) -> Iterator[tuple[int, int]]:
        """The pairs that have to go together for all pairs to do so.

        Two copies go together if both do with a third one that differs from each of them in some of the choices only in
        which they differ from each other: until one of these is made, all three are alike.
        """
        numbers = range(len(self._copies))
        telling = {(one, other): self._telling(one, other) for one in numbers for other in numbers if one != other}
        for one, other in pairs(numbers, 2):
            apart = telling[one, other]
            if not any(
                telling[one, third] < apart and telling[third, other] < apart
                for third in numbers
                if third not in {one, other}
            ):
                yield one, other

    def _telling(self, one: int, other: int) -> frozenset[str]:
        """The choices by which two copies are told apart."""
        values, others = dict(self._alternatives[one]), dict(self._alternatives[other])
        return frozenset(name for name in values.keys() & others.keys() if values[name] != others[name])

    def _together(self, one: int, other: int) -> Iterator[Formula]:
        """What both copies do alike until they can be told apart."""
        names = self._telling(one, other)
        telling = [choice for choice in self._plan.network.choices if choice.name in names]
        for event in self._plan.network.events:
            yield self._event_together(event, one, other, telling)

    def _event_together(self, event: Event, one: int, other: int, telling: Sequence[Choice]) -> Formula:
        terms, first, second = self._terms, self._copies[one], self._copies[other]
        here, there = first.active(event.name), second.active(event.name)
        neither = terms.conjunction((terms.negation(here), terms.negation(there)))
        if neither is terms.true:
            return neither
        same = [terms.equal(first.clock(event.name) - second.clock(event.name))]
        for choice in self._decided_at.get(event.name, ()):
            for value in choice.domain:
                made, other = (each.guard([Assignment(choice.name, value)]) for each in (first, second))
                same.append(terms.true if made is other else terms.equivalence(made, other))
        if here is there and all(each is terms.true for each in same):
            return terms.true
        alike = [here, there, *same]
        apart = (self._after(first, event, telling, there), self._after(second, event, telling, here))
        return terms.disjunction((neither, terms.conjunction(alike), terms.conjunction(apart)))

    def _after(
        self, copy: ParametricSemantics, event: Event, telling: Sequence[Choice], active_in_other: Formula
    ) -> Formula:
        """That in one copy the event comes after a choice that tells both copies apart, if it comes at all."""
        terms, epsilon = self._terms, self._plan.epsilon
        if copy.active(event.name) is terms.false:
            return terms.true
        ways = [terms.negation(copy.active(event.name))]
        for choice in telling:
            if choice.event is None or choice.event == event.name:
                continue
            later = copy.difference(choice.event, event.name)
            known = copy.active(choice.event)
            apart = terms.at_least(later - epsilon) if epsilon else terms.greater(later)
            at_once = terms.at_least(later)
            ways.append(terms.conjunction((known, apart)))
            ways.append(terms.conjunction((known, terms.negation(active_in_other), at_once)))
        return terms.disjunction(ways)
