"""Whether a plan with choices is dynamically controllable, part by part.

Each part (:mod:`~robust.pike_bridge.game.dividing`) is decided without the limits that it shares with others
(:mod:`~robust.pike_bridge.game.deciding`). The span of a part lies between one that is refuted and one within which a
policy ends the part; both are narrowed only until it is known whether the spans fit into each limit.

*Rational people.* What they may choose in one part can depend on what they choose in others, if the limits are so tight
that not all of it fits, however favourable. More to choose from is never easier: a strategy for all is one for them. A
refutation counts only if they may choose all that it is made of; otherwise the plan is decided as a whole.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import accumulate, product
from math import prod

from robust.errors import UnsupportedError
from robust.irr.conflicts import RepairStatus
from robust.pike_bridge.envelopes.parameters import TeamParameter
from robust.pike_bridge.game.deciding import (
    NO_EXECUTION,
    ControllabilityVerdict,
    DecidingGame,
    GameOutcome,
    GameSituation,
    is_possible,
)
from robust.pike_bridge.game.dividing import GamePart, GameParts, PartPolicy, SpanLimit, least_span
from robust.pike_bridge.game.plays import Policy
from robust.pike_bridge.game.rules import STRICT, Game, GameCase, GameRules
from robust.pike_bridge.model import ALWAYS, INITIAL, Assignment, Guard, TeamPlan
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.semantics import Oracle
from robust.searching import Announce, Searching, Status, Stoppable, unheard
from robust.smt.limits import NEVER, Deadline

_MOST_JOINT = 64
"""Joint values of people's choices in several parts, of which it is asked whether rational people may choose them."""


@dataclass(frozen=True, slots=True)
class MovableBound:
    """The value to which a bound must, or may, be moved, if all else stays as it is.

    Attributes:
        least: whether it is a least value: smaller ones make it harder.
        holds: the last value that is known to be enough; None: none is known.
        fails: the first one that is known not to be; None: none is known.
    """

    parameter: TeamParameter
    least: bool
    holds: Fraction | None
    fails: Fraction | None


@dataclass(frozen=True, slots=True)
class EasedBound:
    """A bound that is moved, and what that costs."""

    parameter: TeamParameter
    old: Fraction
    new: Fraction
    cost: Fraction


@dataclass(frozen=True, slots=True)
class BoundsRepair:
    """The least change of bounds after which a plan is controllable; no other one costs less than `bound`, if given."""

    status: RepairStatus
    changes: tuple[EasedBound, ...]
    bound: Fraction | None
    conflicts: int

    @property
    def cost(self) -> Fraction:
        return sum((change.cost for change in self.changes), Fraction(0))


@dataclass(frozen=True)
class Strategy:
    """What the executive does in each part of the plan; it has all the time that the limits leave for that."""

    parts: tuple[PartPolicy, ...]
    limits: tuple[SpanLimit, ...] = ()


@dataclass(frozen=True, slots=True)
class ExceededLimit:
    """A limit on several parts that is shorter than what nature can make them take.

    `spans` has the situations in which no strategy ends a part in less, and how long it then takes.
    """

    limit: Fraction
    spans: tuple[tuple[GamePart, Fraction, tuple[GameSituation, ...]], ...]

    @property
    def needed(self) -> Fraction:
        return sum((span for _, span, _ in self.spans), Fraction(0))


@dataclass
class TeamControllability(Stoppable, ask="verdict"):
    """The answer; if it is no, no strategy serves the `situations`: a single one not even if it is known beforehand.

    `status` and `reason` say what ended the search.
    """

    verdict: ControllabilityVerdict = ControllabilityVerdict.UNKNOWN
    status: str = "complete"
    reason: str | None = None
    situations: tuple[GameSituation, ...] = ()
    exceeded: ExceededLimit | None = None
    """Why not, if parts of the plan take too long together. If each of them does in a single situation, all of these
    are the one of the plan; otherwise there are no other `situations`."""
    strategy: Strategy | None = field(default=None, repr=False)
    parts: int = 0
    """How many were decided apart."""
    cases: int = 0
    """Joint values of people's choices, each with the lengths that the strategy tells apart."""
    policies: int = 0
    """How many strategies were tried."""
    seconds: float = 0.0
    limits: list[MovableBound] = field(default_factory=list)
    """How far bounds can move, where that was asked for."""
    repair: BoundsRepair | None = None
    """The least change of bounds, where that was asked for."""
    rules: GameRules = STRICT


class _PartSearch:
    """A part of a plan, and between which values its span is known to lie.

    Attributes:
        holds: what the policy needs; None: it may take for ever.
        fails: what is not enough, which the `situations` show once it was refuted.
    """

    def __init__(self, whole: "DecidingControllability", part: GamePart, grain: Fraction) -> None:
        self._whole, self.part, self._grain = whole, part, grain
        self._game = part.game()
        self.cases = whole.possible_cases(self._game)
        self.outcome = whole.decide_game(self._game, self.cases)
        self.holds: Fraction | None = None
        self.fails: Fraction | None = None
        self.situations: tuple[GameSituation, ...] = ()
        self._given_up = False
        self._probes = 0

    @property
    def least(self) -> Fraction:
        """What nature can make the part take, or as little less as it likes."""
        return max(self.fails or Fraction(0), Fraction(0))

    @property
    def is_open(self) -> bool:
        """Whether the span may be found more exactly."""
        exact = self.holds is not None and self.fails is not None and self.holds - self.fails <= self._grain
        return not exact and not self._given_up

    def tighten(self, policy: Policy) -> None:
        """Know what a policy needs."""
        span = least_span(policy, self.part, self._whole.deadline)
        if span is not None:
            self.holds, self.outcome.policy = span, policy

    def look_ahead(self) -> None:
        """Know what is needed in single situations, with all activities as long as they can be."""
        lengths = [self._game.greatest(activity) for _, activity in self._game.contingent]
        progress = Progress(self._game.fixed(lengths), times={INITIAL: Fraction(0)})
        reasoner = SemanticReasoner(progress, solver=self._whole.solver)
        found = (reasoner.soonest(self.part.last, case.values, self._whole.deadline, late=False) for case in self.cases)
        longest = max((each for each in found if each is not None), default=self.part.begins)
        self.fails = longest - self.part.begins - self._grain

    def refute(self, span: Fraction) -> None:
        """Show by situations that a span is not enough, which is known to be so."""
        if not self.situations or span < self.least:
            self.situations = self._whole.decide_game(self.part.game(span), self.cases).situations

    def narrow(self, most: Fraction) -> None:
        """Narrow the span down: first just below what is known to do, then by bisection."""
        fails = self.least
        if self.holds is None:
            span = most
        elif self._probes:
            span = fails + max((self.holds - fails) / 2 // self._grain, 1) * self._grain
        else:
            span = self.holds - self._grain
        self._probes += 1
        outcome = self._whole.decide_game(self.part.game(span), self.cases)
        if outcome.policy is not None:
            self.tighten(outcome.policy)
        elif outcome.verdict is ControllabilityVerdict.UNCONTROLLABLE:
            self.fails, self.situations = span, outcome.situations
        else:
            self._given_up = True


@dataclass
class DecidingControllability(Searching[TeamControllability]):
    """Decides whether a plan is controllable.

    Args:
        plan: the plan.
        rules: who decides what.
        solver: `z3` or `cvc5`.
    """

    plan: TeamPlan
    rules: GameRules = STRICT
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Announce = unheard

    def __post_init__(self) -> None:
        super().__init__()
        self._known = TeamControllability(rules=self.rules)
        self._stage = ""

    def _result(self, status: Status, reason: str | None = None) -> TeamControllability:
        self._known.status, self._known.seconds = status.value, self._seconds()
        self._known.reason = reason or self._known.reason
        return self._known

    def _search(self) -> None:
        try:
            game = Game(self.plan, self.rules)
            self._decide(game, GameParts(game))
        except UnsupportedError as unsupported:
            self._known.reason = unsupported.message

    def possible_cases(self, game: Game) -> list[GameCase]:
        """The joint values of people's choices that a strategy has to serve.

        Raises:
            UnsupportedError: if there are too many.
            OutOfTimeError: if the deadline passes.
        """
        cases = game.cases()
        if not self.rules.rational:
            return cases
        self.on_stage(f"{self._stage}what people may choose")
        oracle = Oracle(game.plan, solver=self.solver)
        return [case for case in cases if is_possible(oracle, case.values, self.deadline)]

    def decide_game(self, game: Game, cases: Sequence[GameCase]) -> GameOutcome:
        """Decide a game as a whole.

        Raises:
            OutOfTimeError: if the deadline passes.
        """

        def announce(stage: str) -> None:
            self.on_stage(f"{self._stage}{stage}")

        deciding = DecidingGame(game, cases, solver=self.solver, deadline=self.deadline, on_stage=announce)
        try:
            return deciding.decide()
        finally:
            self._known.policies += deciding.outcome.policies

    # -- parts ---------------------------------------------------------------------------------------------------------

    def _decide(self, game: Game, parts: GameParts) -> None:
        known, searches = self._known, list[_PartSearch]()
        known.parts = len(parts.parts)
        for number, part in enumerate(parts.parts, start=1):
            self._stage = f"part {number} of {known.parts}: " if known.parts > 1 else ""
            search = _PartSearch(self, part, parts.grain)
            searches.append(search)
            known.cases += search.outcome.cases
            if search.outcome.verdict is ControllabilityVerdict.UNCONTROLLABLE:
                known.verdict, known.reason = search.outcome.verdict, search.outcome.reason
                known.situations = search.outcome.situations
                return
        unknown = next((search.outcome for search in searches if search.outcome.policy is None), None)
        if unknown is not None:
            known.reason = unknown.reason
        elif self._fits(game, parts, searches):
            known.verdict = ControllabilityVerdict.CONTROLLABLE
            found = [(search.part, search.outcome.policy, search.holds) for search in searches]
            policies = (PartPolicy(part, policy, span) for part, policy, span in found if policy is not None)
            known.strategy = Strategy(tuple(policies), tuple(parts.limits))

    def _fits(self, game: Game, parts: GameParts, searches: Sequence[_PartSearch]) -> bool:
        """Whether the spans are known to fit into all limits; if not, it is said what else is known."""
        for search in {at: searches[at] for limit in parts.limits for at in limit.parts}.values():
            if search.outcome.policy is not None:
                search.tighten(search.outcome.policy)
        while (limit := next((each for each in parts.limits if not _is_met(each, searches)), None)) is not None:
            inside = [searches[at] for at in limit.parts]
            unseen = [search for search in inside if search.fails is None]
            coming = [search for search in inside if search.is_open]
            certain = sum((search.least for search in inside), Fraction(0))
            if certain >= limit.most and (certain or limit.most < 0):
                self._exceeded(game, limit, inside)
                return False
            if not unseen and not coming:
                self._known.reason = "the least spans of some parts are not known exactly enough"
                return False
            search = max(unseen or coming, key=lambda each: (each.holds or limit.most) - each.least)
            self._stage = f"the span from {search.part.first} to {search.part.last}: "
            if search in unseen:
                self.on_stage(f"{self._stage}single situations")
                search.look_ahead()
            else:
                search.narrow(limit.most)
        return True

    def _exceeded(self, game: Game, limit: SpanLimit, inside: Sequence[_PartSearch]) -> None:
        """A limit that is exceeded, unless people would have to be irrational for that."""
        known = self._known
        inside = sorted(inside, key=lambda each: each.least, reverse=True)
        sums = list(accumulate((each.least for each in inside), initial=Fraction(0)))
        inside = inside[: next((count for count, each in enumerate(sums) if each > 0 and each >= limit.most), 0)]
        for search in inside:
            search.refute(limit.most if len(inside) == 1 else search.least)
        if self.rules.rational:
            oracle = Oracle(game.plan, solver=self.solver)
            if not is_possible(oracle, ALWAYS, self.deadline):
                known.verdict, known.reason = ControllabilityVerdict.UNCONTROLLABLE, NO_EXECUTION
                return
            if not self._may_choose(oracle, inside):
                known.cases = 0
                self._decide(game, GameParts(game, apart=False))
                return
        known.verdict = ControllabilityVerdict.UNCONTROLLABLE
        if len(inside) == 1:
            known.situations = inside[0].situations
            return
        spans = [(each.part, _span(each), each.situations) for each in inside]
        known.exceeded = ExceededLimit(limit.most, tuple(spans))
        if all(len(each.situations) == 1 for each in inside):
            single = [each.situations[0] for each in inside]
            lengths = {activity: length for each in single for activity, length in each.lengths.items()}
            known.situations = (GameSituation(_union(each.values for each in single), lengths),)

    def _may_choose(self, oracle: Oracle, inside: Sequence[_PartSearch]) -> bool:
        """Whether rational people may choose the values of the situations that refute spans, in all combinations."""
        options = [{each.values for each in search.situations} for search in inside]
        if prod(map(len, options)) > _MOST_JOINT:
            return False
        return all(is_possible(oracle, _union(each), self.deadline) for each in product(*options))


def _union(guards: Iterable[Guard]) -> Guard:
    return frozenset[Assignment]().union(*guards)


def _span(search: _PartSearch) -> Fraction:
    """What a part takes, exactly if that is known."""
    return search.least if search.is_open or search.holds is None else search.holds


def _is_met(limit: SpanLimit, searches: Sequence[_PartSearch]) -> bool:
    spans = [searches[at].holds for at in limit.parts]
    return None not in spans and sum((span for span in spans if span is not None), Fraction(0)) <= limit.most
