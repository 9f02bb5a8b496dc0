"""Proofs that a problem has no plan, which are quick, and asked for before any planner is.

A planner that looks for a plan where deadlines are out of reach uses up its time, and is none the wiser.

The problem is relaxed to the ground actions that may matter, by what they need and change. Only facts that are needed
positively are kept. Numeric conditions, negations and alternatives that may hold are left out, conditional effects that
add happen, those that delete do not: every plan of the problem is one of what is left.

Lower bounds follow for the times at which pairs of facts can hold together, by h² with durations, deadlines and running
actions. The bound of a pair of facts is the least over all ways to make one of them true while the other one holds, or
both at once; what a way needs are pairs again [Haslum & Geffner, Heuristic planning with time and resources, 2001, §3].
There actions need and keep everything all the time. Here they are those of PDDL 2.1, with starts and ends: that an
action is running is a fact as well, made true by its start and false by its end. What holds when an action ends has
held since its start, or has come to hold while it was running, and only in the first case the duration comes on top.

Soundness. What happens at one moment of a valid plan is not mutex, and can be put in a row: ends, then timed literals
and instantaneous actions, then starts. In this row, whenever two facts hold together, it is not before their bound:

- What holds strictly during an action is not made false while it is running, but perhaps by something that ends at the
  same moment. So no start and no instantaneous action makes it false while the action runs; ends may.
- It holds right after the start, and not because of the start of another action, unless that can make it true.
- That no other copy of an action runs when it ends is only used if no copy can start while it runs, by these bounds.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import repeat
from math import inf, lcm
from operator import lt
from typing import assert_never

from robust.errors import RobustError
from robust.execute.planners.interface import Planner, PlannerAnswer, PlannerStatus
from robust.execute.snap import duration_range
from robust.numbers import format_number
from robust.plan import model
from robust.plan.pddl import declarations, grounding, syntax
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError

Time = float
"""Ticks: whole numbers as `int`, which are exact, and `inf` for never."""

MOST_ACTIONS = 1000
"""Ground actions; what is computed for pairs of facts takes too long for more."""


class TooLargeError(Exception):
    """The problem has more ground actions than are looked at."""


@dataclass(frozen=True, slots=True)
class FactChange:
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
    start: FactChange
    end: FactChange | None
    during: frozenset[int]

    @property
    def until(self) -> frozenset[int]:
        """Facts that hold during the action or just before its end."""
        return self.during if self.end is None else self.during | self.end.needs


@dataclass(frozen=True)
class RelaxedProblem:
    """Facts are atoms by their number; those that always hold or never can are not among them.

    `arrivals` are the moments at which timed literals make facts true. `last` is when a fact ends for good, for those
    that no action can make true again. Times are counted in ticks, `ticks` to a unit of time.
    """

    facts: tuple[model.Atom, ...]
    actions: tuple[RelaxedAction, ...]
    initial: frozenset[int]
    arrivals: tuple[tuple[int, int], ...]
    last: Mapping[int, int]
    goal: model.Condition
    ticks: int

    @cached_property
    def number(self) -> dict[model.Atom, int]:
        return {atom: i for i, atom in enumerate(self.facts)}


def relaxed_problem(domain: syntax.Domain, problem: syntax.Problem, deadline: Deadline) -> RelaxedProblem:
    """The relaxation of a problem.

    Raises:
        TooLargeError: if there are more than :data:`MOST_ACTIONS` ground actions.
        OutOfTimeError: at the deadline.
        RobustError: for an action that cannot be made ground, as one that divides by zero.
    """
    constants = _Constants(domain, problem)
    candidates = []
    for schema in domain.actions.values():
        for arguments in constants.arguments(schema):
            deadline.enforce()
            ground = grounding.ground_action(
                domain, problem, schema.name, schema.name, arguments, schema.durative, None
            )
            shortest = constants.shortest(ground)
            if shortest is not None and constants.allow(ground, at_once=not shortest):
                candidates.append((ground, shortest))
            if len(candidates) > MOST_ACTIONS:
                raise TooLargeError
    goal = model.And(tuple(demand.condition for demand in grounding.ground_goal(domain, problem)))
    facts = _facts(problem, (action for action, _ in candidates), goal)
    number = {atom: i for i, atom in enumerate(facts)}
    # at one moment, the literals that make an atom true count, and come last
    literals: list[_Literal] = []
    for literal in sorted(problem.timed_literals, key=lambda literal: (literal.time, literal.value)):
        if isinstance(literal.target, model.Atom) and literal.target in number:
            literals.append((literal.time, literal.target, bool(literal.value)))
    ticks = lcm(*(shortest.denominator for _, shortest in candidates), *(time.denominator for time, _, _ in literals))
    actions = (_action(action, int(shortest * ticks), number) for action, shortest in candidates)
    added = {effect.atom for action, _ in candidates for effect in action.atom_effects if effect.value}
    return RelaxedProblem(
        facts=tuple(facts),
        actions=tuple(action for action in actions if action is not None),
        initial=frozenset(number[atom] for atom in problem.atoms if atom in number),
        arrivals=tuple((int(time * ticks), number[atom]) for time, atom, value in literals if value),
        last={number[atom]: int(time * ticks) for atom, time in _lasts(literals, number.keys() - added).items()},
        goal=goal,
        ticks=ticks,
    )


_Literal = tuple[Fraction, model.Atom, bool]


class _Constants:
    """Constant predicates and functions: no action and no timed literal changes them."""

    def __init__(self, domain: syntax.Domain, problem: syntax.Problem) -> None:
        changing = {effect.proposition.predicate for action in domain.actions.values() for effect in _literals(action)}
        targets = [literal.target for literal in problem.timed_literals]
        self._changing = changing | {target.predicate for target in targets if isinstance(target, model.Atom)}
        self._moving = domain.written | {target.function for target in targets if isinstance(target, model.Fluent)}
        self._problem, self._hierarchy = problem, domain.types

    def fixed(self, predicate: str) -> bool:
        return predicate not in self._changing

    def holds(self, atom: model.Atom) -> bool:
        return atom in self._problem.atoms

    def value(self, expression: model.Expression) -> model.Expression | None:
        """The expression with numbers for constant functions; None if one has no value."""
        fluents = [fluent for fluent in model.fluents_in(expression) if fluent.function not in self._moving]
        if not self._problem.fluents.keys() >= set(fluents):
            return None
        known: dict[model.NumericVariable, model.Expression] = {}
        known.update((fluent, Polynomial.constant(self._problem.fluents[fluent])) for fluent in fluents)
        return expression.substitute(lambda variable: known.get(variable) or Polynomial.variable(variable))

    def allow(self, action: model.ActionInstance, *, at_once: bool) -> bool:
        """Whether all conditions of an action may be true; without a duration those over all need not be."""
        timings = {model.Timing.AT_START, model.Timing.AT_END} | (set() if at_once else {model.Timing.OVER_ALL})
        return all(self._allow(timed.condition) for timed in action.conditions if timed.timing in timings)

    def _allow(self, condition: model.Condition) -> bool:
        match condition:
            case model.Holds(atom, value):
                return not self.fixed(atom.predicate) or self.holds(atom) is value
            case model.NumericCondition(expression, relation):
                known = self.value(expression)
                return known is None or not known.is_constant or relation.holds(known.constant_term)
            case model.And(operands):
                return all(map(self._allow, operands))
            case model.Or(operands):
                return any(map(self._allow, operands))
            case model.Truth(value):
                return value
            case _:
                assert_never(condition)

    def arguments(self, schema: syntax.ActionSchema) -> Iterator[tuple[str, ...]]:
        """The arguments with which the constant propositions among an action's conditions at start and end hold."""
        places = {parameter.name: i for i, parameter in enumerate(schema.parameters)}
        checks: dict[int, list[syntax.Proposition]] = {}
        for timed in schema.conditions:
            # what holds over all is left for later: without a duration, it need not hold
            for proposition in _propositions(timed.condition) if timed.timing is not model.Timing.OVER_ALL else ():
                if self.fixed(proposition.predicate):
                    place = max((places[term.name] for term in proposition.arguments if term.variable), default=-1)
                    checks.setdefault(place, []).append(proposition)
        choices = declarations.choices(schema.parameters, self._problem.objects, self._hierarchy)

        def holds(proposition: syntax.Proposition, chosen: Sequence[str]) -> bool:
            terms = proposition.arguments
            arguments = tuple(chosen[places[term.name]] if term.variable else term.name for term in terms)
            return self.holds(model.Atom(proposition.predicate, arguments))

        def extended(chosen: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
            if not all(holds(proposition, chosen) for proposition in checks.get(len(chosen) - 1, ())):
                return
            if len(chosen) == len(choices):
                yield chosen
                return
            for name in choices[len(chosen)]:
                yield from extended((*chosen, name))

        return extended(())

    def shortest(self, action: model.ActionInstance) -> Fraction | None:
        """The least duration as far as it is known; None if there is none, so that the action is never executed."""
        known = {constraint: self.value(constraint.condition.expression) for constraint in action.durations}
        values = {constraint: expression for constraint, expression in known.items() if expression is not None}
        if len(values) < len(known):
            return None
        lower, upper = duration_range(action, values.__getitem__)
        return None if upper is not None and upper < lower else lower


def _literals(schema: syntax.ActionSchema) -> Iterator[syntax.LiteralEffect]:
    return (effect for effect in syntax.primitive(schema.effects) if isinstance(effect, syntax.LiteralEffect))


def _propositions(condition: syntax.LiftedCondition) -> Iterator[syntax.Proposition]:
    if isinstance(condition, syntax.Proposition):
        yield condition
    elif isinstance(condition, syntax.Conjunction):
        for operand in condition.operands:
            yield from _propositions(operand)


def _facts(problem: syntax.Problem, actions: Iterable[model.ActionInstance], goal: model.Condition) -> list[model.Atom]:
    """Atoms that some condition needs, and that are not always true."""
    wanted = {leaf.atom for leaf in model.leaves(goal) if isinstance(leaf, model.Holds)}
    changing = {literal.target for literal in problem.timed_literals if not literal.value}
    for action in actions:
        wanted |= {atom for timed in action.conditions for atom in _needed(timed.condition)}
        changing |= {effect.atom for effect in action.atom_effects if not effect.value}
    return sorted(fact for fact in wanted if fact in changing or fact not in problem.atoms)


def _lasts(literals: Iterable[_Literal], atoms: Collection[model.Atom]) -> dict[model.Atom, Fraction]:
    """For atoms that no action adds: when the last timed literal makes them false, unless one makes them true."""
    lasts: dict[model.Atom, Fraction] = {}
    for moment, atom, value in literals:
        if value:
            lasts.pop(atom, None)
        elif atom in atoms:
            lasts[atom] = moment
    return lasts


def _action(ground: model.ActionInstance, shortest: int, number: Mapping[model.Atom, int]) -> RelaxedAction | None:
    """The action by numbers of facts; None if its start makes a condition false that holds during all of it."""

    def needs(timing: model.Timing) -> frozenset[int]:
        timed = (part for part in ground.conditions if part.timing is timing)
        return frozenset(number[atom] for part in timed for atom in _needed(part.condition) if atom in number)

    def change(timing: model.Timing) -> FactChange:
        effects = [effect for effect in ground.atom_effects if effect.timing is timing and effect.atom in number]
        adds = frozenset(number[effect.atom] for effect in effects if effect.value)
        removed = (effect for effect in effects if not effect.value and effect.condition == model.Truth(True))
        deletes = frozenset(number[effect.atom] for effect in removed)
        return FactChange(needs(timing), adds, deletes - adds)

    start = change(model.Timing.AT_START)
    during = needs(model.Timing.OVER_ALL) if shortest else frozenset()
    if during & start.deletes:
        return None
    return RelaxedAction(str(ground), shortest, start, change(model.Timing.AT_END) if ground.durative else None, during)


def _needed(condition: model.Condition) -> Iterator[model.Atom]:
    """The atoms that are true whenever the condition is: its positive conjuncts."""
    return (leaf.atom for leaf in model.conjuncts(condition) if isinstance(leaf, model.Holds) and leaf.value)


NAME = "reachability"
_SHARE = 0.25
_LONGEST = 10.0
"""Largest share of the time for a plan, and largest number of seconds, that a proof may take."""


def unreachable(domain: syntax.Domain, problem: syntax.Problem, deadline: Deadline) -> str | None:
    """Why a problem has no plan, in one line; None if that is not found out, which says nothing.

    The proof is that of :class:`robust.execute.planners.reachability.EarliestTimes`, as far as it gets by the deadline.
    """
    try:
        relaxed = relaxed_problem(domain, problem, deadline)
        times = EarliestTimes(relaxed, deadline)
        while times.endless:
            useful = tuple(action for action in relaxed.actions if action not in times.endless)
            relaxed = replace(relaxed, actions=useful)
            times = EarliestTimes(relaxed, deadline)
    except (TooLargeError, OutOfTimeError, RobustError):
        return None  # it is for the planner to say what is wrong with the problem
    return _reason(relaxed, times) if times.condition(relaxed.goal) == inf else None


def _reason(problem: RelaxedProblem, times: EarliestTimes) -> str:
    def number(ticks: Time) -> str:
        return format_number(Fraction(int(ticks), problem.ticks))

    late = sorted(times.too_late.items(), key=lambda item: str(problem.facts[item[0]]))
    parts = (
        f"{problem.facts[fact]} ends at {number(problem.last[fact])}, "
        f"and what needs it would end at {number(moment)} or later"
        for fact, moment in late
    )
    return f"the goal is out of reach{': ' if late else ', whatever is done'}{'; '.join(parts)}"


@dataclass(frozen=True, slots=True)
class ReachabilityFirst:
    """A planner that is only asked if no proof is found that there is no plan."""

    planner: Planner

    @property
    def name(self) -> str:
        return self.planner.name

    def solve(self, domain: syntax.Domain, problem: syntax.Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`; a proof answers in the name of `reachability`."""
        start = time.monotonic()
        remaining = deadline.remaining
        share = _LONGEST if remaining is None else min(_LONGEST, remaining * _SHARE)
        reason = unreachable(domain, problem, Deadline.after(share))
        if reason is None:
            answer = self.planner.solve(domain, problem, deadline)
        else:
            answer = PlannerAnswer(NAME, PlannerStatus.NO_PLAN, None, message=reason)
        return replace(answer, seconds=time.monotonic() - start)


class EarliestTimes:
    """Lower bounds for all pairs of facts, in ticks; `inf` is never.

    Args:
        problem: what is asked about.
        deadline: when to stop.

    Raises:
        OutOfTimeError: at the deadline.
    """

    def __init__(self, problem: RelaxedProblem, deadline: Deadline) -> None:
        self._problem = problem
        self._atoms = len(problem.facts)
        size = self._atoms + len(problem.actions)
        self._size = size
        self._pair: list[list[Time]] = [[inf] * size for _ in range(size)]
        self._single: list[Time] = [inf] * size
        self._since: list[list[Time]] = [[inf] * size for _ in problem.actions]
        """When an action can have started with a fact that holds right after the start."""
        self._meanwhile: list[list[Time]] = [[inf] * len(problem.actions) for _ in range(size)]
        """When a fact can come to hold while an action is running."""
        self._began: list[Time] = [inf] * len(problem.actions)
        self._last: list[Time] = [problem.last.get(fact, inf) for fact in range(self._atoms)]
        self._last += [min((self._last[fact] for fact in action.until), default=inf) for action in problem.actions]
        self._overlapping: set[int] = set()
        durative = [(action, action.end) for action in problem.actions if action.end is not None]
        begun = frozenset(fact for action, _ in durative for fact in action.start.adds)
        undone = frozenset(fact for _, end in durative for fact in end.deletes)
        self._steps = [_Bounds(number, action, begun, undone) for number, action in enumerate(problem.actions)]
        self._run(deadline)

    @property
    def too_late(self) -> dict[int, Time]:
        """For facts that end for good: how early something could be done that needs them, and is too late."""
        moments: dict[int, Time] = {}
        for step in self._steps:
            for late in (step.late_start, step.late_end):
                for fact in step.all_needs if late < inf else ():
                    if late > self._last[fact]:
                        moments[fact] = min(late, moments.get(fact, inf))
        return moments

    @property
    def endless(self) -> list[RelaxedAction]:
        """Actions that might be started, but cannot end, which makes them useless."""
        return [step.action for step in self._steps if step.is_endless]

    def together(self, facts: Iterable[int]) -> Time:
        """The bound of facts that hold together: that of the worst pair."""
        chosen = tuple(facts)
        return max((self._pair[a][b] for a in chosen for b in chosen), default=0)

    def condition(self, condition: model.Condition) -> Time:
        """When a condition can hold: negations and numbers always, as far as this bound is concerned."""
        number, alternatives, facts = self._problem.number, [], []
        for conjunct in model.conjuncts(condition):
            match conjunct:
                case model.Holds(atom, True) if atom in number:
                    facts.append(number[atom])
                case model.Or(operands):
                    alternatives.append(min(map(self.condition, operands), default=inf))
                case model.Truth(False):
                    return inf
                case _:
                    pass
        return max([self.together(facts), *alternatives])

    # -- the fixpoint ------------------------------------------------------------------------------------------------

    def _run(self, deadline: Deadline) -> None:
        for a in self._problem.initial:
            for b in self._problem.initial:
                self._pair[a][b] = 0
            self._single[a] = 0
        self._changed = set(range(self._size))
        while self._changed:
            changed, self._changed = self._changed, set()
            for arrival, fact in self._problem.arrivals:
                self._arrive(arrival, fact)
            for step in self._steps:
                deadline.enforce()
                if self._is_due(step, changed):
                    self._start(step)
                    self._end(step)
            if not self._changed:
                self._changed = self._let_overlap()

    def _is_due(self, step: _Bounds, changed: set[int]) -> bool:
        """Whether something has changed that the bounds of a step depend on; without needs, that is everything."""
        inputs = (*step.all_needs, self._atoms + step.number)
        return not step.needs or any(fact in changed or fact in self._changed for fact in inputs)

    def _let_overlap(self) -> set[int]:
        """Actions that may be started while they run, found out just now: their ends leave them running."""
        numbers = {step.number for step in self._steps if step.number not in self._overlapping and step.restart < inf}
        self._overlapping |= numbers
        return {self._atoms + number for number in numbers}

    def _arrive(self, time: int, fact: int) -> None:
        if time <= self._last[fact]:
            pairs = zip(self._single, self._last, strict=True)
            self._achieve((fact,), time, [time if single <= time <= last else inf for single, last in pairs])

    def _broken(self, change: FactChange) -> Iterator[int]:
        """The running actions that something breaks: facts that it makes false hold during them."""
        if change.deletes:
            for number, action in enumerate(self._problem.actions):
                if not change.deletes.isdisjoint(action.during):
                    yield self._atoms + number

    def _start(self, step: _Bounds) -> None:
        base = self.together(step.needs)
        latest = step.latest_start(self._last)
        step.late_start = base + step.action.shortest if base > latest else inf
        if base > latest or base == inf:
            return
        values = list(map(max, repeat(base), self._single, *(self._pair[fact] for fact in step.needs)))
        values = [v if v <= last else inf for v, last in zip(values, self._last, strict=True)]
        if latest < inf:
            values = [v if v <= latest else inf for v in values]
        action = step.action
        for fact in action.start.deletes:
            values[fact] = inf
        for running in self._broken(action.start):
            values[running] = inf
        if action.end is None:
            self._achieve(action.start.adds, base, values)
            return
        running = self._atoms + step.number
        step.restart = values[running]
        self._achieve((*action.start.adds, running), base, values)
        since = self._since[step.number]
        for fact in action.start.adds:
            values[fact] = base
        values[running] = base
        if any(map(lt, values, since)):
            self._since[step.number] = list(map(min, values, since))
            self._changed.add(running)
        self._began[step.number] = min(self._began[step.number], base)

    def _end(self, step: _Bounds) -> None:
        change, shortest = step.action.end, step.action.shortest
        began = self._began[step.number]
        if change is None or began == inf:
            return
        number, done = step.number, began + shortest
        since = self._since[number]
        held = [min(since[fact] + shortest, max(self._meanwhile[fact][number], done)) for fact in range(self._size)]
        base = max([done, self.together(step.before_end), *(held[fact] for fact in step.before_end)])
        running = self._atoms + number
        step.is_endless = base == inf
        step.late_end = base if base > self._last[running] else inf
        if base > self._last[running] or base == inf:
            return
        last_end = self._last[running]
        values = list(map(max, repeat(base), held, self._single, *(self._pair[fact] for fact in step.at_end)))
        values = [v if v <= last and v <= last_end else inf for v, last in zip(values, self._last, strict=True)]
        for fact in change.deletes:
            values[fact] = inf
        if number not in self._overlapping:
            values[running] = inf
        self._achieve(change.adds, base, values)

    def _achieve(self, adds: Iterable[int], base: Time, values: list[Time]) -> None:
        """Facts are made true at `base` at the earliest, and at `values` together with the others."""
        chosen = [fact for fact in adds if base <= self._last[fact]]
        for fact in chosen:
            self._lower(fact, values)
            for other in chosen:
                if base < self._pair[fact][other]:
                    self._pair[fact][other] = self._pair[other][fact] = base
                    self._changed |= {fact, other}
            self._single[fact] = min(self._single[fact], base)

    def _lower(self, fact: int, values: list[Time]) -> None:
        row, last = self._pair[fact], self._last[fact]
        if any(map(lt, values, row)):
            for other, value in enumerate(values):
                if value < row[other] and value <= last:
                    row[other] = self._pair[other][fact] = value
                    self._changed |= {fact, other}
        meanwhile = self._meanwhile[fact]
        for number, value in enumerate(values[self._atoms :]):
            if value < meanwhile[number] and value <= last:
                meanwhile[number] = value
                self._changed.add(self._atoms + number)


class _Bounds:
    """Facts about an action that are computed once, and bounds that change.

    Some start makes the facts `begun` true, and some end makes the facts `undone` false.
    """

    def __init__(self, number: int, action: RelaxedAction, begun: frozenset[int], undone: frozenset[int]) -> None:
        self.number = number
        self.action = action
        self.restart: Time = inf
        """When the action can be started while it runs."""
        self.late_start: Time = inf
        self.late_end: Time = inf
        """When its end comes at the earliest if that is too late, as seen from its start, or from its end."""
        self.is_endless = False
        """Whether it may be started, and what its end needs is never the case."""
        self.needs = tuple(action.start.needs | (action.during - action.start.adds - begun))
        self.before_end = tuple(action.until)
        self.at_end = tuple((frozenset() if action.end is None else action.end.needs) | (action.during - undone))
        self.all_needs = action.start.needs | action.until

    def latest_start(self, last: list[Time]) -> Time:
        """When it starts at the latest to end in time."""
        action = self.action
        lasts = [last[fact] - action.shortest for fact in action.until]
        return min([*lasts, *(last[fact] for fact in action.start.needs)], default=inf)
