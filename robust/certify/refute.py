"""A propositional solver that records why: conflict-driven clause learning with a hint for every derived clause.

Each derived clause comes with the clauses that unit propagation needs, in that order, so that checking a proof takes
time linear in its size. First-UIP learning [Marques-Silva and Sakallah 1999; Moskewicz et al. 2001], hints as in LRAT
[Cruz-Filipe et al. 2017].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush

from robust.errors import RobustError
from robust.smt.limits import Deadline

Clause = tuple[int, ...]
"""Literals: a positive number is a variable, its negative the negation."""

DECAY = 1.05


@dataclass(frozen=True, slots=True)
class Derivation:
    """A clause and the numbers of the clauses from which unit propagation derives it; the last one is the conflict."""

    clause: Clause
    hints: tuple[int, ...]


@dataclass
class PropositionalSolver:
    """Clauses are added one at a time, between calls of `solve`; each gets the next number."""

    clauses: list[Clause] = field(default_factory=list)
    derivations: dict[int, Derivation] = field(default_factory=dict)
    refutation: Derivation | None = None
    """The derivation of the empty clause, once there is one."""

    def __post_init__(self) -> None:
        self._value: dict[int, bool] = {}
        self._level: dict[int, int] = {}
        self._reason: dict[int, int | None] = {}
        self._unit: dict[int, int] = {}
        self._trail: list[int] = []
        self._limits: list[int] = []
        self._next = 0
        self._watching: dict[int, list[int]] = defaultdict(list)
        self._watched: dict[int, list[int]] = {}
        self._activity: dict[int, float] = {}
        self._step = 1.0
        self._queue: list[tuple[float, int]] = []
        self._phase: dict[int, bool] = {}

    # -- clauses -----------------------------------------------------------------------------------------------------

    def add(self, literals: Iterable[int]) -> int:
        """Add a clause and return its number; the search starts anew from what is known for sure."""
        self._retreat(0)
        clause = tuple(dict.fromkeys(literals))
        number = self._store(clause)
        if any(-literal in clause for literal in clause) or self.refutation is not None:
            return number
        open_literals = [literal for literal in clause if self._truth(literal) is None]
        if any(self._truth(literal) for literal in clause):
            self._watch(number, clause)
        elif not open_literals:
            self._refute(number)
        elif len(open_literals) == 1:
            self._assign_for_sure(open_literals[0], number)
            self._watch(number, clause)
        else:
            self._watch(number, tuple(open_literals))
        return number

    def _store(self, clause: Clause) -> int:
        self.clauses.append(clause)
        for literal in clause:
            if abs(literal) not in self._activity:
                self._activity[abs(literal)] = 0.0
                heappush(self._queue, (0.0, abs(literal)))
        return len(self.clauses) - 1

    def _watch(self, number: int, clause: Sequence[int]) -> None:
        if len(clause) > 1:
            self._watched[number] = list(clause)
            for literal in clause[:2]:
                self._watching[literal].append(number)

    def _derive(self, clause: Clause, hints: Sequence[int]) -> int:
        number = self._store(clause)
        self.derivations[number] = Derivation(clause, tuple(hints))
        return number

    def _refute(self, conflict: int) -> None:
        hints = [self._unit[abs(literal)] for literal in self.clauses[conflict]]
        self.refutation = Derivation((), (*hints, conflict))

    # -- search ------------------------------------------------------------------------------------------------------

    def solve(self, deadline: Deadline) -> dict[int, bool] | None:
        """A truth value for every variable that satisfies all clauses; None if there is a refutation.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        while self.refutation is None:
            conflict = self._propagate()
            if conflict is None:
                variable = self._choose()
                if variable is None:
                    return dict(self._value)
                self._limits.append(len(self._trail))
                self._assign(variable if self._phase.get(variable, False) else -variable, None)
            elif not self._limits:
                self._refute(conflict)
            else:
                deadline.enforce()
                self._learn(conflict)
        return None

    def _choose(self) -> int | None:
        while self._queue:
            activity, variable = heappop(self._queue)
            if variable not in self._value and -activity == self._activity[variable]:
                return variable
        return None

    def _truth(self, literal: int) -> bool | None:
        value = self._value.get(abs(literal))
        return None if value is None else value == (literal > 0)

    def _assign(self, literal: int, reason: int | None) -> None:
        variable = abs(literal)
        self._value[variable] = literal > 0
        self._level[variable] = len(self._limits)
        self._reason[variable] = reason
        self._trail.append(literal)

    def _assign_for_sure(self, literal: int, reason: int) -> None:
        """At level zero every literal becomes a clause of its own, which later hints name."""
        others = [self._unit[abs(other)] for other in self.clauses[reason] if other != literal]
        self._unit[abs(literal)] = self._derive((literal,), (*others, reason)) if others else reason
        self._assign(literal, reason)

    def _propagate(self) -> int | None:
        """Assign what follows; the number of a clause that is false, if one is."""
        while self._next < len(self._trail):
            false = -self._trail[self._next]
            self._next += 1
            watching = self._watching[false]
            kept: list[int] = []
            for position, number in enumerate(watching):
                clause = self._watched[number]
                if clause[0] == false:
                    clause[0], clause[1] = clause[1], false
                first = self._truth(clause[0])
                if first or not self._move_watch(number, clause):
                    kept.append(number)
                    if first:
                        continue
                    if first is False:
                        self._watching[false] = kept + watching[position + 1 :]
                        return number
                    if self._limits:
                        self._assign(clause[0], number)
                    else:
                        self._assign_for_sure(clause[0], number)
            self._watching[false] = kept
        return None

    def _move_watch(self, number: int, clause: list[int]) -> bool:
        for index in range(2, len(clause)):
            if self._truth(clause[index]) is not False:
                clause[1], clause[index] = clause[index], clause[1]
                self._watching[clause[1]].append(number)
                return True
        return False

    def _retreat(self, level: int) -> None:
        if len(self._limits) <= level:
            return
        start = self._limits[level]
        for literal in self._trail[start:]:
            variable = abs(literal)
            self._phase[variable] = literal > 0
            del self._value[variable]
            heappush(self._queue, (-self._activity[variable], variable))
        del self._trail[start:]
        del self._limits[level:]
        self._next = min(self._next, start)

    # -- learning ----------------------------------------------------------------------------------------------------

    def _learn(self, conflict: int) -> None:
        """Derive the first unique implication point's clause, retreat and assert it."""
        now = len(self._limits)
        learnt: list[int] = []
        seen: set[int] = set()
        units: dict[int, None] = {}
        used = [conflict]
        pending, reason, place = 0, conflict, len(self._trail)
        while True:
            for literal in self.clauses[reason]:
                variable = abs(literal)
                if variable in seen or self._truth(literal):
                    continue
                seen.add(variable)
                self._bump(variable)
                if self._level[variable] == 0:
                    units[self._unit[variable]] = None
                elif self._level[variable] == now:
                    pending += 1
                else:
                    learnt.append(literal)
            place -= 1
            while abs(self._trail[place]) not in seen:
                place -= 1
            pending -= 1
            if not pending:
                break
            found = self._reason[abs(self._trail[place])]
            if found is None:
                raise RuntimeError("a decision cannot be resolved away")
            reason = found
            used.append(reason)
        point = -self._trail[place]
        self._step *= DECAY
        number = self._derive((point, *learnt), (*units, *reversed(used)))
        back = max((self._level[abs(literal)] for literal in learnt), default=0)
        self._retreat(back)
        if learnt:
            learnt.sort(key=lambda literal: -self._level[abs(literal)])
            self._watch(number, (point, *learnt))
            self._assign(point, number)
        else:
            self._unit[abs(point)] = number
            self._assign(point, number)

    def _bump(self, variable: int) -> None:
        self._activity[variable] += self._step
        if self._activity[variable] > 1e100:
            self._activity = {each: value * 1e-100 for each, value in self._activity.items()}
            self._step *= 1e-100
            self._queue = []
            for each, value in self._activity.items():
                heappush(self._queue, (-value, each))


class NotRefutedError(RobustError):
    """The formula has a model, so that there is nothing to certify."""
