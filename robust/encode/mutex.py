"""Mutex pairs of time points: PDDL 2.1's rule of no moving targets [Fox and Long 2003, §8]."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import product

from robust.plan.model import (
    ActionInstance,
    Assignment,
    Atom,
    Comparison,
    Condition,
    Fluent,
    Holds,
    ParametrizedPlan,
    TimePoint,
    TimePointKind,
    Timing,
    fluents_in,
    leaves,
)


@dataclass(slots=True)
class _Accesses:
    """Who touches what: time points by atom or fluent."""

    readers: dict[Atom | Fluent, set[TimePoint]] = field(default_factory=lambda: defaultdict(set))
    adders: dict[Atom, set[TimePoint]] = field(default_factory=lambda: defaultdict(set))
    deleters: dict[Atom, set[TimePoint]] = field(default_factory=lambda: defaultdict(set))
    increasers: dict[Fluent, set[TimePoint]] = field(default_factory=lambda: defaultdict(set))
    assigners: dict[Fluent, set[TimePoint]] = field(default_factory=lambda: defaultdict(set))


@dataclass(frozen=True, slots=True)
class MutexPair:
    """Two time points that must be ε apart, in the plan's order; `reason` is an atom or fluent that both touch."""

    first: TimePoint
    second: TimePoint
    reason: Atom | Fluent

    @property
    def label(self) -> str:
        return f"separation: {self.first}, {self.second}"


def mutex_pairs(plan: ParametrizedPlan) -> tuple[MutexPair, ...]:
    """All mutex pairs of the plan's time points, each once.

    A condition's reads are syntactic; over-all conditions are no reads; a continuous effect writes at both ends of its
    action; increases and decreases of one fluent commute.
    """
    accesses = _accesses(plan)
    rank = {point: index for index, point in enumerate(plan.time_points)}
    reasons: dict[tuple[TimePoint, TimePoint], Atom | Fluent] = {}
    for reason, first, second in _conflicts(accesses):
        timed = first.kind is second.kind is TimePointKind.TIMED_LITERAL
        if first != second and not timed:
            pair = (first, second) if rank[first] < rank[second] else (second, first)
            reasons.setdefault(pair, reason)
    ordered = sorted(reasons, key=lambda pair: (rank[pair[0]], rank[pair[1]]))
    return tuple(MutexPair(first, second, reasons[first, second]) for first, second in ordered)


def _conflicts(accesses: _Accesses) -> Iterator[tuple[Atom | Fluent, TimePoint, TimePoint]]:
    for atom in accesses.adders.keys() | accesses.deleters.keys():
        adders, deleters = accesses.adders.get(atom, set()), accesses.deleters.get(atom, set())
        for first, second in product(adders, deleters):
            yield atom, first, second
        for first, second in product(adders | deleters, accesses.readers.get(atom, ())):
            yield atom, first, second
    for fluent in accesses.increasers.keys() | accesses.assigners.keys():
        assigners = accesses.assigners.get(fluent, set())
        writers = assigners | accesses.increasers.get(fluent, set())
        for first, second in product(assigners, writers):
            yield fluent, first, second
        for first, second in product(writers, accesses.readers.get(fluent, ())):
            yield fluent, first, second


def _accesses(plan: ParametrizedPlan) -> _Accesses:
    accesses = _Accesses()
    for instance in plan.instances:
        _reads(instance, accesses)
        _writes(instance, accesses)
    for literal in plan.timed_literals:
        if isinstance(literal.target, Fluent):
            accesses.assigners[literal.target].add(literal.point)
        else:
            (accesses.adders if literal.value else accesses.deleters)[literal.target].add(literal.point)
    return accesses


def _reads(instance: ActionInstance, accesses: _Accesses) -> None:
    def read(names: Iterable[Atom | Fluent], *points: TimePoint) -> None:
        for name in names:
            accesses.readers[name].update(points)

    for timed in instance.conditions:
        if timed.timing is not Timing.OVER_ALL:
            read(names_in(timed.condition), instance.at(timed.timing))
    for duration in instance.durations:
        read(names_in(duration.condition), instance.at(duration.timing))
    for added in instance.atom_effects:
        read(names_in(added.condition), instance.at(added.timing))
    for numeric in instance.numeric_effects:
        point = instance.at(numeric.timing)
        read(names_in(numeric.condition), point)
        read(fluents_in(numeric.expression), point)
    for continuous in instance.continuous_effects:
        read(fluents_in(continuous.rate), *instance.time_points)


def _writes(instance: ActionInstance, accesses: _Accesses) -> None:
    for effect in instance.atom_effects:
        (accesses.adders if effect.value else accesses.deleters)[effect.atom].add(instance.at(effect.timing))
    for numeric in instance.numeric_effects:
        assigns = numeric.operator is Assignment.ASSIGN
        (accesses.assigners if assigns else accesses.increasers)[numeric.fluent].add(instance.at(numeric.timing))
    for continuous in instance.continuous_effects:
        accesses.increasers[continuous.fluent].update(instance.time_points)


def names_in(condition: Condition) -> Iterator[Atom | Fluent]:
    """Atoms and fluents that a condition mentions."""
    for leaf in leaves(condition):
        match leaf:
            case Holds(atom):
                yield atom
            case Comparison(expression):
                yield from fluents_in(expression)
