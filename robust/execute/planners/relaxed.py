"""Planning problems without what makes them hard: the ground actions that may matter, by what they need and change.

Only facts that are needed positively are kept. Numeric conditions, negations and alternatives that may hold are left
out, conditional effects that add happen, those that delete do not: every plan of the problem is one of what is left.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import inf, lcm
from typing import assert_never

from robust.errors import Location
from robust.plan.model import (
    ActionInstance,
    And,
    Atom,
    AtomEffect,
    Comparison,
    Condition,
    Duration,
    Expression,
    Fluent,
    Holds,
    Or,
    Relation,
    Timing,
    Truth,
    conjuncts,
)
from robust.plan.pddl.conditions import primitive
from robust.plan.pddl.declarations import fits
from robust.plan.pddl.grounding import ground_action, ground_goal
from robust.plan.pddl.syntax import (
    ActionSchema,
    Conjunction,
    Domain,
    LiftedCondition,
    LiteralEffect,
    Problem,
    Proposition,
)
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline

Time = float
"""Ticks: whole numbers as `int`, which are exact, and `inf` for never."""

MOST_ACTIONS = 1000
"""Ground actions; what is computed for pairs of facts takes too long for more."""


class TooLargeError(Exception):
    """The problem has more ground actions than are looked at."""


@dataclass(frozen=True, slots=True)
class Change:
    """One end of an action, by numbers of facts: what holds just before it, and what it makes true and false."""

    needs: frozenset[int]
    adds: frozenset[int]
    deletes: frozenset[int]


@dataclass(frozen=True, slots=True)
class RelaxedAction:
    """A ground action. `end` is None if it is instantaneous; `during` holds strictly between start and end.

    `shortest` is the least duration in ticks. At zero there may be nothing in between, and `during` is empty.
    """

    name: str
    shortest: int
    start: Change
    end: Change | None
    during: frozenset[int]


@dataclass(frozen=True)
class RelaxedProblem:
    """Facts are atoms by their number; those that always hold or never can are not among them.

    `arrivals` are the moments at which timed literals make facts true. `last` is when a fact ends for good, for those
    that no action can make true again. Times are counted in ticks, `ticks` to a unit of time.
    """

    facts: tuple[Atom, ...]
    actions: tuple[RelaxedAction, ...]
    initial: frozenset[int]
    arrivals: tuple[tuple[int, int], ...]
    last: Mapping[int, int]
    goal: Condition
    ever: Collection[Atom]
    ticks: int

    @cached_property
    def number(self) -> dict[Atom, int]:
        return {atom: i for i, atom in enumerate(self.facts)}


def relaxed_problem(domain: Domain, problem: Problem, deadline: Deadline) -> RelaxedProblem:
    """The relaxation of a problem.

    Raises:
        TooLargeError: if there are more than :data:`MOST_ACTIONS` ground actions.
        OutOfTimeError: at the deadline.
        RobustError: for an action that cannot be made ground, as one that divides by zero.
    """
    constants = _Constants(domain, problem)
    candidates = []
    for schema in domain.actions.values():
        for arguments in _arguments(schema, domain, problem, constants):
            deadline.enforce()
            ground = ground_action(domain, problem, schema.name, schema.name, arguments, schema.durative, _NOWHERE)
            shortest = constants.shortest(ground)
            if shortest is not None:
                candidates.append((ground, shortest))
            if len(candidates) > MOST_ACTIONS:
                raise TooLargeError
    goal = And(tuple(one.condition for one in ground_goal(domain, problem)))
    return _Builder(problem, constants, goal).build(candidates)


_NOWHERE: Location | None = None
_Candidate = tuple[ActionInstance, Fraction]


class _Constants:
    """What nothing changes: predicates and functions that no action and no timed literal has an effect on."""

    def __init__(self, domain: Domain, problem: Problem) -> None:
        changing = {effect.proposition.predicate for one in domain.actions.values() for effect in _literals(one)}
        changing |= {one.target.predicate for one in problem.timed_literals if isinstance(one.target, Atom)}
        self._changing = changing
        self._moving = {one.target.function for one in problem.timed_literals if isinstance(one.target, Fluent)}
        self._moving |= domain.written
        self._problem = problem

    def fixed(self, predicate: str) -> bool:
        return predicate not in self._changing

    def holds(self, atom: Atom) -> bool:
        return atom in self._problem.atoms

    def value(self, expression: Expression) -> Expression | None:
        """The expression with numbers for constant functions; None if one has no value."""
        fluents = {one for one in expression.variables if isinstance(one, Fluent) and one.function not in self._moving}
        values = self._problem.fluents
        if not fluents <= values.keys():
            return None
        return expression.substitute(
            lambda one: (
                Polynomial.constant(values[one])
                if isinstance(one, Fluent) and one in fluents
                else Polynomial.variable(one)
            )
        )

    def may_hold(self, compared: Comparison) -> bool:
        """Whether a comparison may be true at some time: only those of constants are decided."""
        value = self.value(compared.expression)
        if value is None or not value.is_constant:
            return True
        number = value.constant_term
        match compared.relation:
            case Relation.AT_LEAST:
                return number >= 0
            case Relation.GREATER:
                return number > 0
            case Relation.EQUAL:
                return number == 0
            case Relation.DIFFERENT:
                return number != 0

    def shortest(self, action: ActionInstance) -> Fraction | None:
        """The least duration as far as it is known; None if there is none, so that the action is never executed."""
        lower, upper = Fraction(0), None
        for one in action.durations:
            expression = self.value(one.condition.expression)
            if expression is None:
                return None
            if expression.variables != frozenset((Duration(),)) or not expression.is_linear:
                continue
            factor = dict(expression.coefficients())[Duration()]
            bound = -expression.constant_term / factor
            if factor > 0 or one.condition.relation is Relation.EQUAL:
                lower = max(lower, bound)
            if factor < 0 or one.condition.relation is Relation.EQUAL:
                upper = bound if upper is None else min(upper, bound)
        return None if upper is not None and upper < lower else lower


def _literals(schema: ActionSchema) -> Iterator[LiteralEffect]:
    return (one for one in primitive(schema.effects) if isinstance(one, LiteralEffect))


def _arguments(
    schema: ActionSchema, domain: Domain, problem: Problem, constants: _Constants
) -> Iterator[tuple[str, ...]]:
    """The arguments with which the constant propositions among an action's conditions at start and end hold."""
    places = {parameter.name: i for i, parameter in enumerate(schema.parameters)}
    checks: dict[int, list[Proposition]] = {}
    for timed in schema.conditions:
        # what holds over all is left for later: without a duration, it need not hold
        for one in _propositions(timed.condition) if timed.timing is not Timing.OVER_ALL else ():
            if constants.fixed(one.predicate):
                place = max((places[term.name] for term in one.arguments if term.variable), default=-1)
                checks.setdefault(place, []).append(one)
    choices = [
        [one.name for one in problem.objects.values() if fits(one.types, parameter.types, domain.types)]
        for parameter in schema.parameters
    ]

    def fulfilled(chosen: Sequence[str]) -> bool:
        return all(
            constants.holds(
                Atom(one.predicate, tuple(chosen[places[t.name]] if t.variable else t.name for t in one.arguments))
            )
            for one in checks.get(len(chosen) - 1, ())
        )

    def extended(chosen: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        if not fulfilled(chosen):
            return
        if len(chosen) == len(choices):
            yield chosen
            return
        for name in choices[len(chosen)]:
            yield from extended((*chosen, name))

    return extended(())


def _propositions(condition: LiftedCondition) -> Iterator[Proposition]:
    if isinstance(condition, Proposition):
        yield condition
    elif isinstance(condition, Conjunction):
        for operand in condition.operands:
            yield from _propositions(operand)


@dataclass
class _Builder:
    """Finds out which facts and actions matter, and numbers them."""

    problem: Problem
    constants: _Constants
    goal: Condition
    ever: set[Atom] = field(default_factory=set)
    """What may be true at some time, as far as this can be seen without time and deletions."""

    def build(self, candidates: list[_Candidate]) -> RelaxedProblem:
        possible = self._possible(candidates)
        effects = [effect for action, _ in possible for effect in action.atom_effects]
        added = {one.atom for one in effects if one.value}
        facts = self._facts(possible, {one.atom for one in effects if not one.value})
        number = {atom: i for i, atom in enumerate(facts)}
        ticks = lcm(*(shortest.denominator for _, shortest in possible), *(t.denominator for t, _, _ in self._literals))
        actions = (_action(action, int(shortest * ticks), number) for action, shortest in possible)
        return RelaxedProblem(
            facts=facts,
            actions=tuple(one for one in actions if one is not None),
            initial=frozenset(number[atom] for atom in self.problem.atoms if atom in number),
            arrivals=tuple(
                (int(t * ticks), number[one]) for t, one, value in self._literals if value and one in number
            ),
            last={number[one]: int(t * ticks) for one, t in self._lasts(number.keys() - added).items()},
            goal=self.goal,
            ever=frozenset(self.ever),
            ticks=ticks,
        )

    @cached_property
    def _literals(self) -> list[tuple[Fraction, Atom, bool]]:
        """Timed literals about atoms; at one moment, those that make an atom true count, and come last."""
        found = [
            (one.time, one.target, bool(one.value))
            for one in self.problem.timed_literals
            if isinstance(one.target, Atom)
        ]
        return sorted(found, key=lambda one: (one[0], one[2]))

    def _facts(self, possible: list[_Candidate], deleted: set[Atom]) -> tuple[Atom, ...]:
        """What is needed by something, may be true, and is not always true."""
        deleted = deleted | {atom for _, atom, value in self._literals if not value}
        wanted = {
            atom for action, _ in possible for timed in action.conditions for atom in _needed(timed.condition)
        } | _mentioned(self.goal)
        return tuple(sorted(one for one in wanted & self.ever if one in deleted or one not in self.problem.atoms))

    def _possible(self, candidates: list[_Candidate]) -> list[_Candidate]:
        """The actions whose conditions may hold, without regard to time and deletions.

        Those of its end may come to hold because of its start. An action that cannot end is never started.
        """
        begin = set(self.problem.atoms) | {atom for _, atom, value in self._literals if value}
        while True:
            self.ever = set(begin)
            self._grow(candidates)
            possible = [one for one in candidates if self._may_happen(one, Timing.AT_END)]
            if len(possible) == len(candidates):
                return possible
            candidates = possible

    def _grow(self, candidates: list[_Candidate]) -> None:
        """Add what the actions can make true to what may be true."""
        waiting = [(one, timing) for one in candidates for timing in (Timing.AT_START, Timing.AT_END)]
        while True:
            left = []
            for candidate, timing in waiting:
                if self._may_happen(candidate, timing):
                    effects = candidate[0].atom_effects
                    self.ever |= {one.atom for one in effects if one.value and one.timing is timing}
                else:
                    left.append((candidate, timing))
            if len(left) == len(waiting):
                return
            waiting = left

    def _may_happen(self, candidate: _Candidate, timing: Timing) -> bool:
        """Whether all conditions up to the start or the end of an action may hold at some time."""
        action, shortest = candidate
        timings = {Timing.AT_START}
        if timing is Timing.AT_END:
            timings |= {Timing.AT_END, Timing.OVER_ALL} if shortest else {Timing.AT_END}
        return all(self._may_hold(timed.condition) for timed in action.conditions if timed.timing in timings)

    def _may_hold(self, condition: Condition) -> bool:
        match condition:
            case Holds(atom, value):
                always = self.constants.fixed(atom.predicate) and self.constants.holds(atom)
                return atom in self.ever if value else not always
            case Comparison():
                return self.constants.may_hold(condition)
            case And(operands):
                return all(map(self._may_hold, operands))
            case Or(operands):
                return any(map(self._may_hold, operands))
            case Truth(value):
                return value
            case _:
                assert_never(condition)

    def _lasts(self, atoms: Collection[Atom]) -> dict[Atom, Fraction]:
        """For atoms that no action adds: when the last timed literal makes them false, unless one makes them true."""
        lasts: dict[Atom, Fraction] = {}
        for time, atom, value in self._literals:
            if value:
                lasts.pop(atom, None)
            elif atom in atoms:
                lasts[atom] = time
        return lasts


def _action(ground: ActionInstance, shortest: int, number: Mapping[Atom, int]) -> RelaxedAction | None:
    """The action by numbers of facts; None if its start makes a condition false that holds during all of it."""

    def needs(timing: Timing) -> frozenset[int]:
        timed = (one for one in ground.conditions if one.timing is timing)
        return frozenset(number[atom] for one in timed for atom in _needed(one.condition) if atom in number)

    def change(timing: Timing) -> Change:
        effects = [one for one in ground.atom_effects if one.timing is timing and one.atom in number]
        adds = frozenset(number[one.atom] for one in effects if one.value)
        deletes = frozenset(number[one.atom] for one in effects if _surely_deletes(one))
        return Change(needs(timing), adds, deletes - adds)

    start = change(Timing.AT_START)
    during = needs(Timing.OVER_ALL) if shortest else frozenset()
    if during & start.deletes:
        return None
    return RelaxedAction(str(ground), shortest, start, change(Timing.AT_END) if ground.durative else None, during)


def _surely_deletes(effect: AtomEffect) -> bool:
    return not effect.value and effect.condition == Truth(True)


def _needed(condition: Condition) -> Iterator[Atom]:
    """The atoms that are true whenever the condition is: its positive conjuncts."""
    return (one.atom for one in conjuncts(condition) if isinstance(one, Holds) and one.value)


def _mentioned(condition: Condition) -> set[Atom]:
    match condition:
        case Holds(atom):
            return {atom}
        case And(operands) | Or(operands):
            return {atom for operand in operands for atom in _mentioned(operand)}
        case _:
            return set()


def earliest(times: Iterable[Time]) -> Time:
    """The least of some times; never, if there are none."""
    return min(times, default=inf)
