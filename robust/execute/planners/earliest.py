"""Proofs that a problem has no plan, which are quick, and asked for before any planner is.

A planner that looks for a plan where deadlines are out of reach uses up its time, and is none the wiser.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import repeat
from math import inf
from operator import lt

from robust.errors import RobustError
from robust.execute.planners.interface import Planner, PlannerAnswer, PlannerStatus
from robust.execute.planners.relaxed import (
    Change,
    RelaxedAction,
    RelaxedProblem,
    Time,
    TooLargeError,
    earliest,
    relaxed_problem,
)
from robust.numbers import format_number
from robust.plan.model import And, Condition, Holds, Or, Truth
from robust.plan.pddl.syntax import Domain, Problem
from robust.smt.limits import Deadline, OutOfTimeError

NAME = "reachability"
_SHARE = 0.25
_LONGEST = 10.0
"""Of the time for a plan, no more than this share, and no more than so many seconds."""


def unreachable(domain: Domain, problem: Problem, deadline: Deadline) -> str | None:
    """Why a problem has no plan, in one line; None if that is not found out, which says nothing.

    The proof is that of :class:`robust.execute.planners.earliest.EarliestTimes`, as far as it gets by the deadline.
    """
    try:
        relaxed = relaxed_problem(domain, problem, deadline)
        times = EarliestTimes(relaxed, deadline)
    except (TooLargeError, OutOfTimeError, RobustError):
        return None  # it is for the planner to say what is wrong with the problem
    return _reason(relaxed, times) if times.condition(relaxed.goal) == inf else None


def _reason(problem: RelaxedProblem, times: EarliestTimes) -> str:
    late = sorted(times.too_late.items(), key=lambda item: str(problem.facts[item[0]]))
    if not late:
        return "the goal is out of reach, whatever is done"
    parts = [
        f"{problem.facts[fact]} ends at {_number(problem.last[fact], problem)}, "
        f"and what needs it would end at {_number(int(moment), problem)} or later"
        for fact, moment in late
    ]
    return f"the goal is out of reach: {'; '.join(parts)}"


def _number(ticks: int, problem: RelaxedProblem) -> str:
    return format_number(Fraction(ticks, problem.ticks))


@dataclass(frozen=True, slots=True)
class ReachabilityFirst:
    """A planner that is only asked if no proof is found that there is no plan."""

    planner: Planner

    @property
    def name(self) -> str:
        return self.planner.name

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`; a proof answers in the name of `reachability`."""
        start = time.monotonic()
        remaining = deadline.remaining
        share = _LONGEST if remaining is None else min(_LONGEST, remaining * _SHARE)
        reason = unreachable(domain, problem, Deadline.after(share))
        if reason is None:
            return self.planner.solve(domain, problem, deadline)
        return PlannerAnswer(NAME, PlannerStatus.NO_PLAN, None, time.monotonic() - start, reason)


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
        self._last += [self._latest_end(action) for action in problem.actions]
        self._overlapping: set[int] = set()
        durative = [(one, one.end) for one in problem.actions if one.end is not None]
        begun = frozenset(fact for action, _ in durative for fact in action.start.adds)
        undone = frozenset(fact for _, end in durative for fact in end.deletes)
        self._steps = [_Step(number, one, begun, undone) for number, one in enumerate(problem.actions)]
        self._run(deadline)

    @property
    def too_late(self) -> dict[int, Time]:
        """For facts that end for good: how early something could be done that needs them, and is too late."""
        found: dict[int, Time] = {}
        for step in self._steps:
            for late in (step.late_start, step.late_end):
                for fact in step.all_needs if late < inf else ():
                    if late > self._last[fact]:
                        found[fact] = min(late, found.get(fact, inf))
        return found

    def together(self, facts: Iterable[int]) -> Time:
        """The bound of facts that hold together: that of the worst pair."""
        chosen = tuple(facts)
        return max((self._pair[a][b] for a in chosen for b in chosen), default=0)

    def condition(self, condition: Condition) -> Time:
        """When a condition can hold: negations and numbers always, as far as this bound is concerned."""
        number, alternatives, facts = self._problem.number, [], []
        for one in _parts(condition):
            match one:
                case Holds(atom, True) if atom in number:
                    facts.append(number[atom])
                case Holds(atom, True) if atom not in self._problem.ever:
                    return inf
                case Or(operands):
                    alternatives.append(earliest(map(self.condition, operands)))
                case Truth(False):
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

    def _is_due(self, step: _Step, changed: set[int]) -> bool:
        """Whether something has changed that the bounds of a step depend on; without needs, that is everything."""
        inputs = (*step.all_needs, self._atoms + step.number)
        return not step.needs or any(fact in changed or fact in self._changed for fact in inputs)

    def _let_overlap(self) -> set[int]:
        """Actions that may be started while they run, found out just now: their ends leave them running."""
        found = {step.number for step in self._steps if step.number not in self._overlapping and step.restart < inf}
        self._overlapping |= found
        return {self._atoms + number for number in found}

    def _arrive(self, time: int, fact: int) -> None:
        if time <= self._last[fact]:
            values = [
                time if single <= time <= last else inf for single, last in zip(self._single, self._last, strict=True)
            ]
            self._achieve((fact,), time, values)

    def _broken(self, change: Change) -> Iterator[int]:
        """The running actions that something breaks: facts that it makes false hold during them."""
        if change.deletes:
            for number, action in enumerate(self._problem.actions):
                if not change.deletes.isdisjoint(action.during):
                    yield self._atoms + number

    def _start(self, step: _Step) -> None:
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

    def _end(self, step: _Step) -> None:
        change, shortest = step.action.end, step.action.shortest
        began = self._began[step.number]
        if change is None or began == inf:
            return
        number, done = step.number, began + shortest
        since = self._since[number]
        held = [min(since[fact] + shortest, max(self._meanwhile[fact][number], done)) for fact in range(self._size)]
        base = max([done, self.together(step.before_end), *(held[fact] for fact in step.before_end)])
        running = self._atoms + number
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

    # -- deadlines ---------------------------------------------------------------------------------------------------

    def _latest_end(self, action: RelaxedAction) -> Time:
        end = frozenset() if action.end is None else action.end.needs
        return earliest(self._last[fact] for fact in action.during | end)


class _Step:
    """What of an action is looked at again and again.

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
        at_end = frozenset() if action.end is None else action.end.needs
        self.needs = tuple(action.start.needs | (action.during - action.start.adds - begun))
        self.before_end = tuple(at_end | action.during)
        self.at_end = tuple(at_end | (action.during - undone))
        self.all_needs = action.start.needs | action.during | at_end

    def latest_start(self, last: list[Time]) -> Time:
        """When it starts at the latest to end in time."""
        action = self.action
        at_end = frozenset() if action.end is None else action.end.needs
        lasts = [last[fact] - action.shortest for fact in action.during | at_end]
        return earliest([*lasts, *(last[fact] for fact in action.start.needs)])


def _parts(condition: Condition) -> Iterator[Condition]:
    if isinstance(condition, And):
        for operand in condition.operands:
            yield from _parts(operand)
    else:
        yield condition
