"""Whether one game has a strategy: a policy for all situations, situations that no strategy serves, or unknown.

1. *One situation.* For each joint value of people's choices, all activities as long, then as short as they can be: is
   there a correct execution at all, everything known beforehand? If not, values and lengths that do not matter go.
2. *Policies* (:mod:`~robust.pike_bridge.game.plays`), first for the greatest lengths alone. One that is confirmed is a
   strategy. The fault of another adds lengths, and excludes it and its like.
3. *Several situations.* Once no policy is left, choices, supports and orders may differ with lengths, which only makes
   it easier: if there are no schedules even so, no strategy serves these situations together; few are kept by deletion.
4. *Lengths that decide.* Otherwise policies may have to depend on lengths. A fault's negative cycle says how short, or
   how long, an activity would have to be not to have it: its length is cut there, and either part is a case of its own.

What is found is certain either way. It is unknown if nothing is left to cut: what depends on sums of lengths, for
instance, may need more and more cuts.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise, product
from typing import TypeVar

from robust.pike_bridge.game.plays import Fault, Plays, Policy, Share
from robust.pike_bridge.game.rules import Game, GameCase
from robust.pike_bridge.model import Activity, Guard, contradicts
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.presented import VerdictEnum
from robust.searching import Announce, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

NO_EXECUTION = "there is no correct execution at all"
_BASES = 3
"""How many of the lengths found before are tried with another length of one activity."""


class ControllabilityVerdict(VerdictEnum):
    """Whether some strategy succeeds whatever people choose and however long activities take."""

    CONTROLLABLE = "controllable"
    UNCONTROLLABLE = "uncontrollable"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class GameSituation:
    """Values of people's choices, and lengths of contingent activities."""

    values: Guard
    lengths: Mapping[Activity, Fraction]


@dataclass
class GameOutcome:
    """What is known of a game: no strategy serves the `situations`, a single one not even if it is known beforehand.

    `cases` and `policies` are how many there were and how many were tried.
    """

    verdict: ControllabilityVerdict = ControllabilityVerdict.UNKNOWN
    reason: str | None = None
    situations: tuple[GameSituation, ...] = ()
    policy: Policy | None = None
    cases: int = 0
    policies: int = 0


def is_possible(oracle: Oracle, values: Guard, deadline: Deadline) -> bool:
    """Whether a correct execution has these values.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    answer = oracle.decide(values, deadline=deadline)
    if answer.verdict is ExecutionExistence.UNKNOWN:
        raise OutOfTimeError
    return answer.verdict is ExecutionExistence.EXISTS


class DecidingGame:
    """Decides one game as a whole; what is known by now is the `outcome`.

    Args:
        game: the game.
        cases: the joint values of people's choices in question.
        solver: `z3` or `cvc5`.
    """

    def __init__(
        self,
        game: Game,
        cases: Sequence[GameCase],
        *,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_stage: Announce = unheard,
    ) -> None:
        self._game, self._cases = game, list(cases)
        self._solver, self._deadline, self._on_stage = solver, deadline, on_stage
        self.outcome = GameOutcome(cases=len(cases))

    def decide(self) -> GameOutcome:
        """The outcome.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        if not self._cases:
            self.outcome.verdict = ControllabilityVerdict.UNCONTROLLABLE
            self.outcome.reason = NO_EXECUTION
        elif not self._refuted_by_one(self._cases):
            self._by_policies(self._cases)
        return self.outcome

    def _possible(self, oracle: Oracle, values: Guard) -> bool:
        return is_possible(oracle, values, self._deadline)

    # -- one situation -----------------------------------------------------------------------------------------------

    def _refuted_by_one(self, cases: Sequence[GameCase]) -> bool:
        """Whether one situation with extreme lengths has no correct execution."""
        self._on_stage("single situations")
        for extreme in (1, 0):
            lengths = [span[extreme] for span in cases[0].spans]
            oracle = Oracle(self._game.fixed(lengths), solver=self._solver)
            case = next((case for case in cases if not self._possible(oracle, case.values)), None)
            if case is not None:
                situation = self._essential(oracle, case.values, lengths)
                self.outcome.verdict, self.outcome.situations = ControllabilityVerdict.UNCONTROLLABLE, (situation,)
                return True
        return False

    def _essential(self, oracle: Oracle, values: Guard, lengths: Sequence[Fraction]) -> GameSituation:
        """The situation without values and lengths that may be any, and still there is no correct execution."""
        for assignment in sorted(values):
            if not self._possible(oracle, values - {assignment}):
                values = values - {assignment}
        kept = {place: length for (place, _), length in zip(self._game.contingent, lengths, strict=True)}
        for place, activity in self._game.contingent:
            if contradicts(activity.guard, values) or not self._needs(kept, values, place):
                del kept[place]
        activities = self._game.plan.network.activities
        return GameSituation(values, {activities[place]: length for place, length in kept.items()})

    def _needs(self, kept: Mapping[int, Fraction], values: Guard, place: int) -> bool:
        activities = list(self._game.plan.network.activities)
        for at, length in kept.items():
            if at != place:
                activities[at] = replace(activities[at], lower=length, upper=length)
        network = replace(self._game.plan.network, activities=tuple(activities))
        return self._possible(Oracle(replace(self._game.plan, network=network), solver=self._solver), values)

    # -- policies ----------------------------------------------------------------------------------------------------

    def _by_policies(self, cases: list[GameCase]) -> None:
        whole, cuts = cases, list[tuple[int, Fraction]]()
        wanted = {case.values for case in cases}
        lengths: list[Share] = [(Fraction(1),) * len(self._game.contingent)]
        refuting = Plays(self._game, whole, shared=False, solver=self._solver)
        while True:
            self.outcome.cases = len(cases)
            plays = Plays(self._game, cases, shared=True, solver=self._solver)
            for share in lengths:
                plays.add(share, self._deadline)
            faults = self._confirmed(plays)
            if faults is None:
                return
            lengths = list(plays.lengths)
            self._on_stage("several situations")
            if not cuts:
                for share in lengths:
                    refuting.add(share, self._deadline)
            faults += self._sliced(refuting)
            if self.outcome.verdict is not ControllabilityVerdict.UNKNOWN:
                return
            cut = next((each for fault in faults for each in fault.cuts if each not in cuts), None)
            if cut is None:
                self._between(refuting, cuts)
                return
            cuts.append(cut)
            for share in _within_parts(self._game, refuting.lengths[:_BASES], cuts, cut[0]):
                refuting.add(share, self._deadline)
            cases = [case for case in self._game.cases(cuts) if case.values in wanted]

    def _between(self, refuting: Plays, cuts: Sequence[tuple[int, Fraction]]) -> None:
        """The last attempt: lengths between those that were tried, one activity after the other."""
        for number in range(len(self._game.contingent)):
            for share in _within_parts(self._game, refuting.lengths[:_BASES], cuts, number):
                refuting.add(share, self._deadline)
        self._sliced(refuting)
        if self.outcome.verdict is ControllabilityVerdict.UNKNOWN:
            self.outcome.reason = "no policy was found, and no lengths on which one might depend"

    def _confirmed(self, plays: Plays) -> list[Fault] | None:
        """Try policies until one is confirmed, or else none is left: their faults."""
        faults: list[Fault] = []
        while True:
            self._on_stage(f"policies: {self.outcome.policies}")
            if not plays.exist(self._deadline):
                return faults
            found = self._tried(plays, 0)
            if found is None:
                return None
            faults.append(found)
            for share in found.lengths:
                plays.add(share, self._deadline)

    def _tried(self, plays: Plays, at: int) -> Fault | None:
        """The fault of a policy; None if it is confirmed."""
        self.outcome.policies += 1
        found = plays.policy(at, self._deadline)
        if isinstance(found, Fault):
            return found
        self.outcome.verdict, self.outcome.policy = ControllabilityVerdict.CONTROLLABLE, found
        return None

    def _sliced(self, refuting: Plays) -> list[Fault]:
        """Try what each of the lengths has in common, until there is nothing new; no strategy if there is no model."""
        faults: list[Fault] = []
        while refuting.exist(self._deadline):
            fresh = []
            for at in range(len(refuting.lengths)):
                fault = self._tried(refuting, at)
                if fault is None:
                    return faults
                faults.append(fault)
                fresh += fault.lengths
            known = len(refuting.lengths)
            for share in fresh:
                refuting.add(share, self._deadline)
            if len(refuting.lengths) == known:
                return faults
        self.outcome.verdict = ControllabilityVerdict.UNCONTROLLABLE
        self.outcome.situations = self._few(refuting)
        return faults

    def _few(self, refuting: Plays) -> tuple[GameSituation, ...]:
        """Few situations of those that no strategy serves: cases, and lengths, that are not needed go."""
        cases, lengths = list(refuting.cases), list(refuting.lengths)

        def refuted(cases: Sequence[GameCase], lengths: Sequence[Share]) -> bool:
            plays = Plays(self._game, cases, shared=False, solver=self._solver)
            for share in lengths:
                plays.add(share, self._deadline)
            return not plays.exist(self._deadline)

        try:
            lengths = _without(lengths, lambda rest: refuted(cases, rest))
            cases = _without(cases, lambda rest: refuted(rest, lengths))
        except OutOfTimeError:
            pass  # they are more than needed
        return tuple(_situation(self._game, case, share) for case, share in product(cases, lengths))


def _within_parts(
    game: Game, lengths: Sequence[Share], cuts: Sequence[tuple[int, Fraction]], number: int
) -> list[Share]:
    """Lengths of which one activity's is in the middle of a part, or where it is cut."""
    activity = game.contingent[number][1]
    low, high = activity.lower, game.greatest(activity)
    places = sorted({low, high, *(place for at, place in cuts if at == number)})
    places = sorted({*places[1:-1], *((one + other) / 2 for one, other in pairwise(places))})
    shares = [(place - low) / (high - low) for place in places]
    return [(*each[:number], share, *each[number + 1 :]) for each in lengths for share in shares]


Item = TypeVar("Item")


def _without(items: list[Item], suffices: Callable[[list[Item]], bool]) -> list[Item]:
    """The items without those that are not needed, one after the other."""
    for item in list(items):
        rest = [each for each in items if each is not item]
        if rest and suffices(rest):
            items = rest
    return items


def _situation(game: Game, case: GameCase, share: Share) -> GameSituation:
    lengths = {
        each: low + part * (high - low)
        for (_, each), (low, high), part in zip(game.contingent, case.spans, share, strict=True)
        if not contradicts(each.guard, case.values)
    }
    return GameSituation(case.values, lengths)
