"""Whether plans with choices are controllable, in people's words: the situations that break them, or a strategy."""

from collections.abc import Iterator
from typing import Annotated

from robust.json_text import Count, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import duration, format_number, plural, readable
from robust.pike_bridge.game.controllability import (
    ControllabilityVerdict,
    GameSituation,
    MovableBound,
    TeamControllability,
)
from robust.pike_bridge.game.plays import GameBranch
from robust.pike_bridge.game.rules import Game
from robust.pike_bridge.model import contradicts, guard_text
from robust.show.console import Console, printing
from robust.show.documents import Document, Ended, document, documenting, has_table

MOST_BRANCHES = 12
"""That people are shown."""


class TakenLength(JsonObject):
    """how long an activity takes"""

    action: str
    event: Annotated[str, "at which it begins"]
    length: Rational


class BrokenSituation(JsonObject):
    """values of people's choices and lengths of activities; what is not listed may be anything"""

    choices: dict[str, str]
    lengths: list[TakenLength]


class StrategyBranch(JsonObject):
    """what the strategy chooses

    Attributes:
        choices: of people
        longer: activities, by the event at which they begin, that take at least so long in this branch
        chosen: what the executive chooses then
    """

    choices: dict[str, str]
    longer: dict[str, Rational]
    chosen: dict[str, str]


class MovedBound(JsonObject):
    """how far a bound can move, all others as they are

    Attributes:
        least: whether smaller values make it harder
        holds: the last value that is known to be enough
        fails: the first value that is known not to be
    """

    name: str
    meaning: str
    least: bool
    holds: Rational | None
    fails: Rational | None


class PikeControllable(JsonObject, tag_field="schema", tag="robust/pike-controllable/1", kw_only=True):
    """what `robust pike check --controllable --json` prints

    Attributes:
        situations: that no strategy serves; a single one not even if it is known beforehand
        cases: joint values of people's choices, with the lengths that are told apart
        policies: that were tried
        strategy: one that was found
    """

    status: Ended
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")]
    reason: str | None
    situations: list[BrokenSituation]
    cases: Count
    policies: Count
    strategy: list[StrategyBranch] | None
    limits: list[MovedBound]
    seconds: Seconds


has_table(TeamControllability, "situations")


@documenting.register(TeamControllability)
def controllable_document(found: TeamControllability) -> Document:
    """`robust/pike-controllable/1`."""
    game, strategy = found.game, found.strategy
    return document(
        like(
            PikeControllable,
            found,
            verdict=found.verdict.value,
            situations=[] if game is None else [_situation(game, each) for each in found.situations],
            strategy=None if strategy is None else [_branch(strategy.game, each) for each in strategy.branches],
            limits=[
                like(MovedBound, each, name=each.parameter.name, meaning=each.parameter.meaning)
                for each in found.limits
            ],
            seconds=round(found.seconds, 6),
        )
    )


def _situation(game: Game, situation: GameSituation) -> BrokenSituation:
    activities = game.plan.network.activities
    lengths = [
        TakenLength(activities[place].action, activities[place].source, length)
        for place, length in situation.lengths.items()
    ]
    return BrokenSituation(dict(sorted(situation.values)), lengths)


def _branch(game: Game, branch: GameBranch) -> StrategyBranch:
    longer = {
        activity.source: low
        for (_, activity), (low, _) in zip(game.contingent, branch.case.spans, strict=True)
        if low > activity.lower
    }
    return StrategyBranch(dict(sorted(branch.case.values)), longer, _chosen(game, branch))


def _chosen(game: Game, branch: GameBranch) -> dict[str, str]:
    """What the executive chooses in a branch, where it comes to that."""
    return {
        choice.name: branch.scenario[choice.name]
        for choice in game.choices.values()
        if choice.controllable and choice.event in branch.points
    }


@printing.register(TeamControllability)
def print_controllable(out: Console, found: TeamControllability, *, quiet: bool) -> None:
    """The verdict with its reason; unless `quiet` also what the strategy chooses. How far bounds can move."""
    for line in headline(found):
        out.print(line, soft_wrap=True)
    if found.strategy is not None and not quiet:
        for line in _strategy_lines(found.strategy.game, found.strategy.branches):
            out.print(f"  {line}", soft_wrap=True)
    for limit in found.limits:
        out.print(_limit_text(limit, rational=found.game is not None and found.game.rules.rational), soft_wrap=True)
    if not quiet:
        cases, policies = plural(found.cases, "case"), plural(found.policies, "policy").replace("policys", "policies")
        out.print(f"{cases} of what people choose, {policies} tried, {duration(found.seconds)}.")


def headline(found: TeamControllability) -> Iterator[str]:
    """The verdict with its reason, in a line, or several for several situations."""
    game = found.game
    match found.verdict:
        case ControllabilityVerdict.CONTROLLABLE:
            yield "Controllable: a strategy succeeds whatever people choose and however long activities take."
        case ControllabilityVerdict.UNCONTROLLABLE if game is not None and len(found.situations) == 1:
            words = _words(game, found.situations[0])
            yield f"Not controllable: no correct execution exists {words}, even if that is known beforehand."
        case ControllabilityVerdict.UNCONTROLLABLE if game is not None and found.situations:
            yield "Not controllable: no strategy serves all of these, whose differences are not seen in time:"
            for situation in found.situations:
                yield f"  {_words(game, situation)}"
        case ControllabilityVerdict.UNCONTROLLABLE:
            yield f"Not controllable: {found.reason}."
        case _:
            ended = {"timeout": "out of time", "interrupted": "interrupted"}
            yield f"Undecided: {found.reason or ended.get(found.status, found.status)}."


def _words(game: Game, situation: GameSituation) -> str:
    """`with xA1 = mug, where (make-coffee human) takes 5`."""
    activities = game.plan.network.activities
    lengths = [
        f"{activities[place].action} takes {readable(length)}"
        for place, length in situation.lengths.items()
        if not contradicts(activities[place].guard, situation.values)
    ]
    values = [f"with {guard_text(situation.values)}"] if situation.values else []
    return ", ".join([*values, *(["where " + " and ".join(lengths)] if lengths else [])]) or "whatever happens"


def _strategy_lines(game: Game, branches: tuple[GameBranch, ...]) -> Iterator[str]:
    lines: dict[str, None] = {}
    for branch in branches:
        told = _branch(game, branch)
        longer = [
            f"{activity.action} takes {readable(low)} to {readable(high)}"
            for (_, activity), (low, high) in zip(game.contingent, branch.case.spans, strict=True)
            if (low, high) != (activity.lower, game.greatest(activity))
        ]
        chosen = ", ".join(f"{name} = {value}" for name, value in told.chosen.items())
        when = ", ".join([guard_text(branch.case.values), *longer]).strip(", ")
        if chosen:
            lines[f"if {when}: {chosen}" if when else chosen] = None
    yield from list(lines)[:MOST_BRANCHES]
    if len(lines) > MOST_BRANCHES:
        yield f"... and {len(lines) - MOST_BRANCHES} more (--json lists them)"


def _limit_text(limit: MovableBound, *, rational: bool) -> str:
    name = limit.parameter.words
    if limit.holds is None:
        tried = "" if limit.fails is None else f", not even {format_number(limit.fails)}"
        return f"{name}: no value is known to be enough{tried}."
    bound = "must be at least" if limit.least else "may be at most"
    if limit.fails is None:
        return f"{name}: {bound} {format_number(limit.holds)}; nothing beyond was refuted."
    not_enough = "is not enough" if limit.least else "is too much"
    if rational:  # who may have more to choose from with more time
        return f"{name}: {format_number(limit.holds)} is enough; {format_number(limit.fails)} {not_enough}."
    return f"{name} {bound} {format_number(limit.holds)}; {format_number(limit.fails)} {not_enough}."
