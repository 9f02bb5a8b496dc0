"""Whether a plan with choices is dynamically controllable: a strategy, situations that no strategy serves, or unknown.

1. *One situation.* For each joint value of people's choices, all activities as long, then as short as they can be: is
   there a correct execution at all, everything known beforehand? If not, values and lengths that do not matter go.
2. *Policies* (:mod:`~robust.pike_bridge.game.plays`), first for the greatest lengths alone. One that is confirmed is a
   strategy. The fault of another adds lengths, and excludes it and its like.
3. *Several situations.* Once no policy is left, choices, supports and orders may differ with lengths, which only makes
   it easier: if there are no schedules even so, no strategy serves these situations together; few are kept by deletion.
4. *Lengths that decide.* Otherwise policies may have to depend on lengths. A fault's negative cycle says how short, or
   how long, an activity would have to be not to have it: its length is cut there, and either part is a case of its own.

What is found is certain either way. It is unknown if time runs out, or nothing is left to cut: what depends on sums of
lengths, for instance, may need more and more cuts.

*Limits.* More time for a requirement, and a narrower range of a contingent length, never hurt: a bound that is a
parameter is moved by bisection, on the grid of the plan's numbers, to where controllability ends. Rational people may
have more values to choose from with more time, so that for them only the two values are known between which it ends.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise, product
from typing import TypeVar

from robust.errors import InputError, Location, UnsupportedError
from robust.pike_bridge.envelopes.parameters import ParametricPlan, TeamParameter, TeamParameterKind
from robust.pike_bridge.game.plays import Fault, Plays, Share, Strategy
from robust.pike_bridge.game.rules import STRICT, Game, GameCase, GameRules
from robust.pike_bridge.model import ALWAYS, Guard, TeamPlan, common_measure, contradicts
from robust.pike_bridge.semantics import ExecutionExistence, Oracle, restrict
from robust.presented import VerdictEnum
from robust.searching import Announce, Searching, Status, Stoppable, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

_BASES = 3
"""How many of the lengths found before are tried with another length of one activity."""


class ControllabilityVerdict(VerdictEnum):
    """Whether some strategy succeeds whatever people choose and however long activities take."""

    CONTROLLABLE = "controllable"
    UNCONTROLLABLE = "uncontrollable"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class GameSituation:
    """Values of people's choices, and lengths of contingent activities, by their places in the game's network."""

    values: Guard
    lengths: Mapping[int, Fraction]


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


@dataclass
class TeamControllability(Stoppable, ask="verdict"):
    """The answer; if it is no, no strategy serves the `situations`: a single one not even if it is known beforehand.

    `status` and `reason` say what ended the search.
    """

    verdict: ControllabilityVerdict = ControllabilityVerdict.UNKNOWN
    status: str = "complete"
    reason: str | None = None
    situations: tuple[GameSituation, ...] = ()
    strategy: Strategy | None = field(default=None, repr=False)
    cases: int = 0
    """Joint values of people's choices, each with the lengths that the strategy tells apart."""
    policies: int = 0
    """How many strategies were tried."""
    seconds: float = 0.0
    limits: list[MovableBound] = field(default_factory=list)
    """How far bounds can move, where that was asked for."""
    game: Game | None = field(default=None, repr=False)


@dataclass
class DecidingControllability(Searching[TeamControllability]):
    """Decides it.

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
        self._known = TeamControllability()

    def _result(self, status: Status, reason: str | None = None) -> TeamControllability:
        self._known.status, self._known.seconds = status.value, self._seconds()
        self._known.reason = reason or self._known.reason
        return self._known

    def _search(self) -> None:
        known = self._known
        try:
            game = known.game = Game(self.plan, self.rules)
            cases = self._cases(game)
        except UnsupportedError as unsupported:
            known.reason = unsupported.message
            return
        known.cases = len(cases)
        if not cases:
            known.verdict, known.reason = ControllabilityVerdict.UNCONTROLLABLE, "there is no correct execution at all"
        elif not self._refuted_by_one(game, cases):
            self._by_policies(game, cases)

    def _cases(self, game: Game) -> list[GameCase]:
        cases = game.cases()
        if not self.rules.rational:
            return cases
        self.on_stage("what people may choose")
        oracle = Oracle(game.plan, solver=self.solver)
        return [case for case in cases if self._possible(oracle, case.values)]

    def _possible(self, oracle: Oracle, values: Guard) -> bool:
        answer = oracle.decide(values, deadline=self.deadline)
        if answer.verdict is ExecutionExistence.UNKNOWN:
            raise OutOfTimeError
        return answer.verdict is ExecutionExistence.EXISTS

    # -- one situation -----------------------------------------------------------------------------------------------

    def _refuted_by_one(self, game: Game, cases: Sequence[GameCase]) -> bool:
        """Whether one situation with extreme lengths has no correct execution."""
        self.on_stage("single situations")
        for extreme in (1, 0):
            lengths = [span[extreme] for span in cases[0].spans]
            oracle = Oracle(game.fixed(lengths), solver=self.solver)
            case = next((case for case in cases if not self._possible(oracle, case.values)), None)
            if case is not None:
                situation = self._essential(game, oracle, case.values, lengths)
                self._known.verdict, self._known.situations = ControllabilityVerdict.UNCONTROLLABLE, (situation,)
                return True
        return False

    def _essential(self, game: Game, oracle: Oracle, values: Guard, lengths: Sequence[Fraction]) -> GameSituation:
        """The situation without values and lengths that may be any, and still there is no correct execution."""
        for assignment in sorted(values):
            if not self._possible(oracle, values - {assignment}):
                values = values - {assignment}
        kept = {place: length for (place, _), length in zip(game.contingent, lengths, strict=True)}
        for place, activity in game.contingent:
            if contradicts(activity.guard, values) or not self._needs(game, kept, values, place):
                del kept[place]
        return GameSituation(values, kept)

    def _needs(self, game: Game, kept: Mapping[int, Fraction], values: Guard, place: int) -> bool:
        activities = list(game.plan.network.activities)
        for at, length in kept.items():
            if at != place:
                activities[at] = replace(activities[at], lower=length, upper=length)
        network = replace(game.plan.network, activities=tuple(activities))
        return self._possible(Oracle(replace(game.plan, network=network), solver=self.solver), values)

    # -- policies ----------------------------------------------------------------------------------------------------

    def _by_policies(self, game: Game, cases: list[GameCase]) -> None:
        whole, cuts = cases, list[tuple[int, Fraction]]()
        wanted = {case.values for case in cases}
        lengths: list[Share] = [(Fraction(1),) * len(game.contingent)]
        refuting = Plays(game, whole, shared=False, solver=self.solver)
        while True:
            self._known.cases = len(cases)
            plays = Plays(game, cases, shared=True, solver=self.solver)
            for share in lengths:
                plays.add(share, self.deadline)
            faults = self._confirmed(plays)
            if faults is None:
                return
            lengths = list(plays.lengths)
            self.on_stage("several situations")
            if not cuts:
                for share in lengths:
                    refuting.add(share, self.deadline)
            faults += self._sliced(game, refuting)
            if self._known.verdict is not ControllabilityVerdict.UNKNOWN:
                return
            cut = next((each for fault in faults for each in fault.cuts if each not in cuts), None)
            if cut is None:
                self._between(game, refuting, cuts)
                return
            cuts.append(cut)
            for share in _within_parts(game, refuting.lengths[:_BASES], cuts, cut[0]):
                refuting.add(share, self.deadline)
            cases = [case for case in game.cases(cuts) if case.values in wanted]

    def _between(self, game: Game, refuting: Plays, cuts: Sequence[tuple[int, Fraction]]) -> None:
        """The last attempt: lengths between those that were tried, one activity after the other."""
        for number in range(len(game.contingent)):
            for share in _within_parts(game, refuting.lengths[:_BASES], cuts, number):
                refuting.add(share, self.deadline)
        self._sliced(game, refuting)
        if self._known.verdict is ControllabilityVerdict.UNKNOWN:
            self._known.reason = "no policy was found, and no lengths on which one might depend"

    def _confirmed(self, plays: Plays) -> list[Fault] | None:
        """Try policies until one is confirmed, or else none is left: their faults."""
        faults: list[Fault] = []
        while True:
            self.on_stage(f"policies: {self._known.policies}")
            if not plays.exist(self.deadline):
                return faults
            found = self._tried(plays, 0)
            if found is None:
                return None
            faults.append(found)
            for share in found.lengths:
                plays.add(share, self.deadline)

    def _tried(self, plays: Plays, at: int) -> Fault | None:
        """The fault of a policy; None if it is confirmed."""
        self._known.policies += 1
        found = plays.policy(at, self.deadline)
        if isinstance(found, Fault):
            return found
        self._known.verdict, self._known.strategy = ControllabilityVerdict.CONTROLLABLE, found
        return None

    def _sliced(self, game: Game, refuting: Plays) -> list[Fault]:
        """Try what each of the lengths has in common, until there is nothing new; no strategy if there is no model."""
        faults: list[Fault] = []
        while refuting.exist(self.deadline):
            fresh = []
            for at in range(len(refuting.lengths)):
                fault = self._tried(refuting, at)
                if fault is None:
                    return faults
                faults.append(fault)
                fresh += fault.lengths
            known = len(refuting.lengths)
            for share in fresh:
                refuting.add(share, self.deadline)
            if len(refuting.lengths) == known:
                return faults
        self._known.verdict = ControllabilityVerdict.UNCONTROLLABLE
        self._known.situations = self._few(game, refuting)
        return faults

    def _few(self, game: Game, refuting: Plays) -> tuple[GameSituation, ...]:
        """Few situations of those that no strategy serves: cases, and lengths, that are not needed go."""
        cases, lengths = list(refuting.cases), list(refuting.lengths)

        def refuted(cases: Sequence[GameCase], lengths: Sequence[Share]) -> bool:
            plays = Plays(game, cases, shared=False, solver=self.solver)
            for share in lengths:
                plays.add(share, self.deadline)
            return not plays.exist(self.deadline)

        try:
            lengths = _without(lengths, lambda rest: refuted(cases, rest))
            cases = _without(cases, lambda rest: refuted(rest, lengths))
        except OutOfTimeError:
            pass  # they are more than needed
        return tuple(_situation(game, case, share) for case, share in product(cases, lengths))


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
        place: low + part * (high - low)
        for (place, each), (low, high), part in zip(game.contingent, case.spans, share, strict=True)
        if not contradicts(each.guard, case.values)
    }
    return GameSituation(case.values, lengths)


# -- limits ------------------------------------------------------------------------------------------------------------


@dataclass
class FindingLimits(Searching[TeamControllability]):
    """Decides whether a plan is controllable, and how far bounds of it can move.

    Args:
        plan: the plan; each of its parameters is a bound that moves while all others stay as they are.
        rules: who decides what.
        assume: choices that are made already.
        solver: `z3` or `cvc5`.

    Raises:
        InputError: if a parameter is no single bound, or of both sides' activities.
    """

    plan: ParametricPlan
    rules: GameRules = STRICT
    assume: Guard = ALWAYS
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Announce = unheard

    def __post_init__(self) -> None:
        super().__init__()
        self._asked = [(each, self._is_least(each)) for each in self.plan.parameters]
        self._nominal = self._deciding({})
        self._limits: list[MovableBound] = []

    def _result(self, status: Status, reason: str | None = None) -> TeamControllability:
        known = self._nominal._result(status, reason)
        known.limits, known.seconds = self._limits, self._seconds()
        return known

    def _search(self) -> None:
        self._nominal._search()
        for parameter, least in self._asked:
            self._limits.append(self._limit(parameter, least))

    def _deciding(self, values: Mapping[str, Fraction]) -> DecidingControllability:
        plan = restrict(self.plan.at({**self.plan.nominal, **values}), self.assume)
        return DecidingControllability(plan, self.rules, self.solver, self.deadline, self.on_stage)

    def _is_least(self, parameter: TeamParameter) -> bool:
        """Whether smaller values make it harder."""
        network = self.plan.plan.network
        if parameter.kind not in {TeamParameterKind.AT_LEAST, TeamParameterKind.AT_MOST}:
            message = f"found {parameter.kind.value} as {parameter.name}, expected at-least or at-most"
            raise InputError(message, Location("parameters"))
        activities = [
            network.activities[place - len(network.constraints)]
            for place in parameter.places
            if place >= len(network.constraints)
        ]
        nature = {each.lower != each.upper and each.agent not in self.rules.free for each in activities} or {False}
        if len(nature) > 1:
            message = f"{parameter.name} is of activities of both sides, expected either nature's or the executive's"
            raise InputError(message, Location("parameters"))
        return (parameter.kind is TeamParameterKind.AT_LEAST) == (nature == {True})

    def _limit(self, parameter: TeamParameter, least: bool) -> MovableBound:
        """Bisection on the grid of the plan's numbers, from the nominal value towards where the verdict is another."""
        plan, name = self.plan.plan, parameter.name
        grid = common_measure((plan.separation, *plan.network.bounds))
        hardest, easiest = self._range(parameter)
        if not least:
            hardest, easiest = easiest, hardest
        holds: Fraction | None = None
        fails: Fraction | None = None

        def is_enough(value: Fraction) -> bool:
            nonlocal holds, fails
            deciding = self._deciding({name: value})
            self.on_stage(f"{name} = {value}")
            deciding._search()
            verdict = deciding._known.verdict
            if verdict is ControllabilityVerdict.CONTROLLABLE:
                holds = value
            elif verdict is ControllabilityVerdict.UNCONTROLLABLE:
                fails = value
            return verdict is ControllabilityVerdict.CONTROLLABLE

        try:
            if is_enough(easiest) and not is_enough(hardest):
                good, bad = easiest, hardest
                while abs(good - bad) > grid:
                    middle = bad + round((good - bad) / grid / 2) * grid
                    good, bad = (middle, bad) if is_enough(middle) else (good, middle)
        except OutOfTimeError:
            self._limits.append(MovableBound(parameter, least, holds, fails))
            raise
        return MovableBound(parameter, least, holds, fails)

    def _range(self, parameter: TeamParameter) -> tuple[Fraction, Fraction]:
        """The least and the greatest value that are tried: the other bound, or so great that more is no help."""
        most = sum(map(abs, self.plan.plan.network.bounds), Fraction(1))
        [side] = parameter.kind.sides
        others = [self.plan.bounds[place][1 - side] for place in parameter.places]
        numbers = [each.constant_term for each in others if each is not None and each.is_constant]
        if side:
            return max(numbers, default=Fraction(0)), most
        return Fraction(0), min(numbers, default=most)
