"""Conversion to the least constrained network: only what keeps every condition true, in the order of the plan.

Three kinds of edges, and nothing else:

- durations (:mod:`robust.execute.durations`);
- mutex pairs, separated by ε in the order of the plan. No-moving-targets makes every writer of an atom mutex with
  every reader and every contrary writer of it, and the same for fluents. So these edges alone settle which value each
  condition at a start or an end, each conditional effect and the goal reads, unless it depends on durations or
  continuous change;
- over-all conditions, which do not count as readers: the atom keeps its value from its achiever to the end. Contrary
  writers are ordered with the achiever already, so what is to be said is: achiever before start, later threats after
  end.

Timed literals have fixed times: their orders become bounds from zero.

Which achiever? If nothing had made the atom false by then, the initial state: that costs no edge. Otherwise any
achiever since the last contrary writer will do, and each keeps the same threats out, so every choice costs one edge.
One that comes before the start anyway costs none; else the most recent is taken, as the Esterel transformer does:
where the transformer's network is valid, this one then allows all of its schedules.

What depends on numbers that vary with the schedule, and over-all conditions that different literals keep true in
turn, is left to :mod:`robust.execute.tighten`; so is finding the edges of over-all conditions that are true without
them, because their literals are true by turns whatever the order is.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from robust.execute.distances import Edge, Paths, edge
from robust.execute.durations import certain_duration, duration_edges, settled_durations
from robust.execute.original import Original, Write
from robust.plan.model import (
    ZERO,
    ActionInstance,
    And,
    Comparison,
    Condition,
    Holds,
    Or,
    TimePoint,
    Timing,
    Truth,
)


@dataclass(frozen=True, slots=True)
class CausalNetwork:
    """A network in parts; the original schedule satisfies all of them.

    `points` are zero and the time points of instances; `certain` holds whatever the parameters are, and may imply
    others; `durations` are the bounds of durations, `links` are the edges that protect over-all conditions, and `edges`
    are these and the separations of mutex pairs.
    """

    points: tuple[TimePoint, ...]
    certain: tuple[Edge, ...]
    durations: tuple[Edge, ...]
    edges: tuple[Edge, ...]
    links: frozenset[Edge]


def causal_network(original: Original, pinned: Collection[str] = ()) -> CausalNetwork:
    """The network that keeps conditions over atoms true; instances in `pinned` keep the durations of the plan.

    It need not keep conditions over numbers: see :func:`robust.execute.tighten.tighten`.
    """
    durative = [instance for instance in original.plan.instances if instance.durative]
    points = tuple(point for point in original.plan.time_points if point.time is None)
    certain = (
        *(Edge(ZERO, point, Fraction(0)) for point in points if point != ZERO),
        *(certain_duration(original, instance) for instance in durative),
    )
    durations = tuple(bound for instance in durative for bound in duration_edges(original, instance, pinned))
    settled = settled_durations(original, pinned)
    orders = [edge(a, b, original.epsilon) for a, b in original.mutex if a.instance is None or a.instance != b.instance]
    paths = Paths(points, (*certain, *orders))
    links = [link for instance in durative for link in _over_all_edges(original, instance, paths)]
    known = tuple(bound for bound in durations if bound.source.instance in settled)
    edges = tuple(dict.fromkeys((*orders, *links)))
    return CausalNetwork(points, (*certain, *known), durations, edges, frozenset(links) - frozenset(orders))


def _over_all_edges(original: Original, instance: ActionInstance, paths: Paths) -> Iterator[Edge]:
    for part in instance.conditions:
        if part.timing is Timing.OVER_ALL:
            cost = partial(_cost, original, instance, paths)
            for literal in _kept(original, instance, part.condition, cost) or ():
                yield from _protection(original, instance, literal, paths)


def _cost(original: Original, instance: ActionInstance, paths: Paths, literals: tuple[Holds, ...]) -> int:
    """How many edges it takes to protect literals."""
    return sum(len(list(_protection(original, instance, literal, paths))) for literal in literals)


def _kept(
    original: Original, instance: ActionInstance, condition: Condition, cost: Callable[[tuple[Holds, ...]], int]
) -> tuple[Holds, ...] | None:
    """Literals that hold from start to end and make the condition true, of least cost; None if no literals do.

    Conjuncts that no literals keep true are passed over. Comparisons are taken for true where all of the condition
    needs them, for false where there is an alternative.
    """
    match condition:
        case Truth(value):
            return () if value else None
        case Comparison():
            return ()
        case Holds():
            return (condition,) if _holds_throughout(original, instance, condition) else None
        case And(operands):
            parts = [_kept(original, instance, operand, cost) for operand in operands]
            return tuple(literal for part in parts if part is not None for literal in part)
        case Or(operands):
            alternatives = [_kept(original, instance, one, cost) for one in operands if not isinstance(one, Comparison)]
            return min((one for one in alternatives if one), key=cost, default=None)


def _holds_throughout(original: Original, instance: ActionInstance, literal: Holds) -> bool:
    """Whether the literal holds from right after the start up to the end."""
    start, end = original.times[instance.start], original.times[instance.end]
    return all(
        (literal.atom in happening.after.atoms) is literal.value
        for happening in original.execution.happenings
        if start <= happening.time < end or happening.time == start
    )


def _protection(original: Original, instance: ActionInstance, literal: Holds, paths: Paths) -> Iterator[Edge]:
    """Achiever before start, contrary writers not before the end unless they are before the achiever."""
    start, end = original.times[instance.start], original.times[instance.end]
    writes = original.writes(literal.atom)
    contrary = [one for one in writes if one.value is not literal.value]
    broken = max((one.time for one in contrary if one.time <= start), default=None)
    initially = (literal.atom in original.plan.initial_atoms) is literal.value
    if broken is not None or not initially:
        supports = [one for one in writes if one.value is literal.value and one.time <= start]
        achievers = [one for one in supports if broken is None or broken < one.time]
        yield from _after_achiever(instance.start, achievers, paths)
    for one in contrary:
        if one.time >= end and one.point != instance.end:
            yield edge(instance.end, one.point, Fraction(0))


def _after_achiever(start: TimePoint, achievers: Sequence[Write], paths: Paths) -> Iterator[Edge]:
    """The edge from one of the achievers, by time, to the start; none if one of them is not after it anyway."""
    links = [edge(one.point, start, Fraction(0)) for one in achievers]
    if links and not any(_is_implied(link, paths) for link in links):
        yield links[-1]


def _is_implied(link: Edge, paths: Paths) -> bool:
    known = paths.implied(link.source, link.target)
    return known is not None and known >= link.weight
