"""Large plans, cut at joins into games that are decided apart, and what the bounds between joins leave them.

Parts meet at nodes, events without guard that every other one is ordered with (:mod:`robust.pike_bridge.online.parts`).
Nothing that is seen after a node can be used before it, so a strategy of the plan is one for each part, which begins
when the part before it has ended. Of a part only its *span* matters: the least time within which a strategy ends it
whatever happens. Nature can make each part take its span, or as little less as it likes; so there is a strategy of the
plan just if there is one of each part, and the spans fit into each bound between nodes. Lower bounds between nodes
would make the executive wait, perhaps for what later parts are like: no part ends within them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from robust.network.uncertain import DynamicAnswer, Stnu, UncertainLink, Way, dynamic, total, weight_in
from robust.pike_bridge.game.plays import Policy
from robust.pike_bridge.game.rules import Game, GameRules
from robust.pike_bridge.model import GOAL, INITIAL, Constraint, TeamPlan, common_measure
from robust.pike_bridge.online.parts import Division
from robust.pike_bridge.online.progress import Structure
from robust.plan.model import ZERO
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True)
class GamePart:
    """What happens from one node to another, as a plan of its own that begins with the first node.

    `events` are those of the whole plan in it, with the last node and without the first.
    """

    first: str
    last: str
    plan: TeamPlan
    rules: GameRules
    events: frozenset[str]
    begins: Fraction = Fraction(0)
    """How much later than its initial event, at which what is true before it becomes so, it begins."""

    def game(self, span: Fraction | None = None) -> Game:
        """The part's game; if a span is given, it has to be done within that."""
        network = self.plan.network
        bounds = () if span is None else (Constraint(INITIAL, self.last, None, self.begins + span),)
        whole = replace(network, constraints=(*network.constraints, *bounds))
        return Game(replace(self.plan, network=whole), self.rules)


@dataclass(frozen=True)
class PartPolicy:
    """A policy for a part of a plan, and the span in which it certainly ends the part, if that is limited."""

    part: GamePart
    policy: Policy
    span: Fraction | None = None


@dataclass(frozen=True, slots=True)
class SpanLimit:
    """The greatest time from the beginning of the first of some parts, by their numbers, to the end of the last."""

    parts: range
    most: Fraction


class GameParts:
    """The parts of a game in their order, if they are decided `apart`, and the limits on several of them together."""

    def __init__(self, game: Game, *, apart: bool = True) -> None:
        self._game = game
        self._division = Division(game.plan, Structure(game.plan))
        bounds = list(self._bounds())
        cuts = self._cuts(bounds) if apart else []
        self.parts = [self._part(bounds, *ranks) for ranks in pairwise(cuts)] if len(cuts) > 2 else [_whole(game)]
        number = {rank: at for at, rank in enumerate(cuts)}
        across = [each for each in bounds if each.upper is not None and {each.first, each.last} <= number.keys()]
        spans = [(range(number[each.first], number[each.last]), each.upper) for each in across]
        self.limits = [SpanLimit(parts, most) for parts, most in spans if len(parts) > 1 and most is not None]
        self.grain = common_measure((game.plan.separation, *game.plan.network.bounds)) / (len(self.parts) + 1)
        """Spans that are known as exactly as this decide about limits."""

    def _bounds(self) -> Iterator["_NodeBound"]:
        rank = self._division.rank
        for each in self._division.between if self._division.nodes else ():
            one, other = rank[each.source], rank[each.target]
            if one < other:
                yield _NodeBound(one, other, each.lower, each.upper)
            else:
                lower, upper = (None if bound is None else -bound for bound in (each.upper, each.lower))
                yield _NodeBound(other, one, lower, upper)

    def _cuts(self, bounds: Sequence["_NodeBound"]) -> list[int]:
        """The ranks of the nodes at which the game is cut, its beginning and its end."""
        last = len(self._division.nodes) - 1
        cuts = {rank for rank in range(1, last) if self._is_blind(rank)} | {0, last}
        while True:
            between = {
                rank
                for each in bounds
                if (each.lower or 0) > 0 or not {each.first, each.last} <= cuts
                for rank in range(each.first + 1, each.last)
            }
            if not between & cuts:
                return sorted(cuts)
            cuts -= between

    def _is_blind(self, rank: int) -> bool:
        """Whether what is true from the start comes before a node, and all that can be seen after it is seen later."""
        game, division = self._game, self._division
        shown = {str(choice.event) for choice in game.people} | game.ends
        coming = [event for event in shown if division.part_of[event] >= rank]
        node = division.nodes[rank]
        return division.orders.apart(INITIAL, node) and all(division.orders.apart(node, event) for event in coming)

    def _part(self, bounds: Sequence["_NodeBound"], first: int, last: int) -> GamePart:
        division, nodes, rules = self._division, self._division.nodes, self._game.rules
        more = [
            Constraint(nodes[each.first], nodes[each.last], each.lower, each.upper)
            for each in bounds
            if first <= each.first and each.last <= last
        ]
        begins = self._game.plan.separation if first else Fraction(0)
        more += [Constraint(INITIAL, nodes[first], begins, begins)] if first else []
        plan, _, _ = division.window(first, last, more, gridded=False)
        agents = {each.agent for each in plan.network.activities}
        own = replace(rules, free=tuple(each for each in rules.free if each in agents), hesitate=None)
        events = frozenset(event for event, part in division.part_of.items() if first <= part < last)
        return GamePart(nodes[first], nodes[last], plan, own, events - {INITIAL}, begins)


class _NodeBound(NamedTuple):
    """A bound between two nodes, by their ranks."""

    first: int
    last: int
    lower: Fraction | None
    upper: Fraction | None


def _whole(game: Game) -> GamePart:
    events = frozenset(game.guards) - {INITIAL}
    return GamePart(INITIAL, GOAL, game.plan, replace(game.rules, hesitate=None), events)


def least_span(policy: Policy, part: GamePart, deadline: Deadline) -> Fraction | None:
    """The least time in which a policy certainly ends a part; None if that may take for ever.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    span = Fraction(0)
    while True:
        answer = within(policy, part, span, deadline)
        if answer.cycle is None:
            return span
        stnu, needed = answer.form.stnu, list[Fraction]()
        for piece in answer.cycle.pieces:
            infinite, length = total(piece, weight_in(stnu))
            count = sum(step.link >= len(policy.answer.form.stnu.links) and step.way is Way.AT_MOST for step in piece)
            if count and not infinite:
                needed.append(span - length / count)
        if not needed:
            return None
        span = min(needed)


def within(policy: Policy, part: GamePart, span: Fraction, deadline: Deadline = NEVER) -> DynamicAnswer:
    """Whether a policy ends a part in some time, as controllability of its network with this limit."""
    stnu = policy.answer.form.stnu
    ends = sorted({branch.points[part.last] for branch in policy.branches})
    limits = (UncertainLink(ZERO, end, None, part.begins + span) for end in ends)
    return dynamic(Stnu(stnu.points, (*stnu.links, *limits)), deadline)
