"""Whether plans with choices are controllable, in people's words: the situations that break them, or a strategy."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated

from robust.irr.conflicts import RepairStatus
from robust.json_text import Count, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import duration, format_number, plural, readable
from robust.pike_bridge.game.controllability import (
    BoundsRepair,
    ExceededLimit,
    MovableBound,
    Strategy,
    TeamControllability,
)
from robust.pike_bridge.game.deciding import ControllabilityVerdict, GameSituation
from robust.pike_bridge.game.dividing import GamePart
from robust.pike_bridge.game.plays import GameBranch, Policy
from robust.pike_bridge.model import contradicts, guard_text
from robust.show.console import Console, printing
from robust.show.documents import Document, Ended, document_of, documenting, has_table

MOST_LINES = 12
"""Of a strategy or a reason that people are shown."""


class TakenLength(JsonObject):
    """how long an activity takes"""

    action: str
    event: Annotated[str, "at which it begins"]
    length: Rational


class BrokenSituation(JsonObject):
    """values of people's choices and lengths of activities; what is not listed may be anything"""

    choices: dict[str, str]
    lengths: list[TakenLength]


class LongPart(JsonObject):
    """the events at which a part of the plan begins and ends, and the situations in which no strategy ends it sooner

    Attributes:
        takes: how long it takes then
    """

    first: str
    last: str
    takes: Rational
    situations: list[BrokenSituation]


class BrokenLimit(JsonObject):
    """the greatest time for several parts of the plan, and parts that take longer together"""

    most: Rational
    needed: Rational
    parts: list[LongPart]


class StrategyBranch(JsonObject):
    """what the strategy chooses

    Attributes:
        part: the number of the part of the plan that it is about
        choices: of people
        longer: activities, by the event at which they begin, that take at least so long in this branch
        chosen: what the executive chooses then
    """

    part: Count
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


class ChangedBound(JsonObject):
    """a bound that is moved"""

    name: str
    meaning: str
    old: Rational
    new: Rational
    cost: Rational


class RepairedBounds(JsonObject):
    """the least change of bounds after which the plan is controllable

    Attributes:
        status: whether it is proved to be the least
        bound: no repair costs less
        conflicts: that were met
    """

    status: Annotated[str, one_of("unneeded", "optimal", "feasible", "impossible", "unknown")]
    cost: Rational
    bound: Rational | None
    changes: list[ChangedBound]
    conflicts: Count


class PikeControllable(JsonObject, tag_field="schema", tag="robust/pike-controllable/1", kw_only=True):
    """what `robust pike check --controllable --json` prints

    Attributes:
        situations: that no strategy serves; a single one not even if it is known beforehand
        exceeded: a limit on parts of the plan that take too long together
        parts: of the plan, which were decided apart
        cases: joint values of people's choices in each part, with the lengths that are told apart
        policies: that were tried
        strategy: one that was found
    """

    status: Ended
    verdict: Annotated[str, one_of("controllable", "uncontrollable", "unknown")]
    reason: str | None
    situations: list[BrokenSituation]
    exceeded: BrokenLimit | None
    parts: Count
    cases: Count
    policies: Count
    strategy: list[StrategyBranch] | None
    limits: list[MovedBound]
    repair: RepairedBounds | None
    seconds: Seconds


has_table(TeamControllability, "situations")


@documenting.register(TeamControllability)
def controllable_document(found: TeamControllability) -> Document:
    """`robust/pike-controllable/1`."""
    return document_of(
        PikeControllable,
        found,
        situations=list(map(_situation, found.situations)),
        exceeded=None if found.exceeded is None else _broken_limit(found.exceeded),
        strategy=None if found.strategy is None else list(_branches(found.strategy)),
        limits=[
            like(MovedBound, each, name=each.parameter.name, meaning=each.parameter.meaning) for each in found.limits
        ],
        repair=None if found.repair is None else _repaired(found.repair),
    )


def _repaired(repair: BoundsRepair) -> RepairedBounds:
    changes = [
        like(ChangedBound, each, name=each.parameter.name, meaning=each.parameter.meaning) for each in repair.changes
    ]
    return like(RepairedBounds, repair, changes=changes)


def _situation(situation: GameSituation) -> BrokenSituation:
    lengths = [TakenLength(each.action, each.source, length) for each, length in situation.lengths.items()]
    return BrokenSituation(dict(sorted(situation.values)), lengths)


def _broken_limit(exceeded: ExceededLimit) -> BrokenLimit:
    parts = [
        LongPart(part.first, part.last, takes, list(map(_situation, each))) for part, takes, each in exceeded.spans
    ]
    return BrokenLimit(exceeded.limit, exceeded.needed, parts)


def _branches(strategy: Strategy) -> Iterator[StrategyBranch]:
    for number, each in enumerate(strategy.parts, start=1):
        policy = each.policy
        for branch in policy.branches:
            longer = {
                activity.source: low
                for (_, activity), (low, _) in zip(policy.game.contingent, branch.case.spans, strict=True)
                if low > activity.lower
            }
            chosen = {name: branch.scenario[name] for name, event in _made(policy).items() if event in branch.points}
            yield StrategyBranch(number, dict(sorted(branch.case.values)), longer, chosen)


def _made(policy: Policy) -> dict[str, str]:
    """The executive's choices with their events."""
    return {each.name: str(each.event) for each in policy.game.choices.values() if each.controllable}


@printing.register(TeamControllability)
def print_controllable(out: Console, found: TeamControllability, *, quiet: bool) -> None:
    """The verdict with its reason; unless `quiet` also what the strategy chooses. How far bounds can move."""
    spans = [] if found.exceeded is None or quiet else [_span_text(*span) for span in found.exceeded.spans]
    for line in headline(found):
        out.line(f"{line.removesuffix('.')}:" if spans else line)
    if found.strategy is not None and not quiet:
        _print_some(out, [line for each in found.strategy.parts for line in _policy_lines(each.policy)])
    _print_some(out, spans)
    for limit in found.limits:
        out.line(_limit_text(limit, rational=found.rules.rational))
    if found.repair is not None:
        out.lines(_repair_lines(found.repair))
    if not quiet:
        cases, policies = plural(found.cases, "case"), plural(found.policies, "policy")
        apart = f"{found.parts} parts, " if found.parts > 1 else ""
        out.print(f"{apart}{cases} of what people choose, {policies} tried, {duration(found.seconds)}.")


def _print_some(out: Console, lines: list[str]) -> None:
    out.lines(f"  {line}" for line in lines[:MOST_LINES])
    if len(lines) > MOST_LINES:
        out.print(f"  ... and {len(lines) - MOST_LINES} more (--json lists them)")


def headline(found: TeamControllability) -> Iterator[str]:
    """The verdict with its reason, in a line, or several for several situations."""
    match found.verdict:
        case ControllabilityVerdict.CONTROLLABLE:
            yield "Controllable: a strategy succeeds whatever people choose and however long activities take."
        case ControllabilityVerdict.UNCONTROLLABLE if found.exceeded is not None:
            most, needed = readable(found.exceeded.limit), readable(found.exceeded.needed)
            known = ", even if all of this is known beforehand" if found.situations else ""
            yield f"Not controllable: a limit of {most} is exceeded by parts of the plan that can take {needed}{known}."
        case ControllabilityVerdict.UNCONTROLLABLE if len(found.situations) == 1:
            words = _words(found.situations[0])
            yield f"Not controllable: no correct execution exists {words}, even if that is known beforehand."
        case ControllabilityVerdict.UNCONTROLLABLE if found.situations:
            yield "Not controllable: no strategy serves all of these, whose differences are not seen in time:"
            for situation in found.situations:
                yield f"  {_words(situation)}"
        case ControllabilityVerdict.UNCONTROLLABLE:
            yield f"Not controllable: {found.reason}."
        case _:
            ended = {"timeout": "out of time", "interrupted": "interrupted"}
            yield f"Undecided: {found.reason or ended.get(found.status, found.status)}."


def _words(situation: GameSituation) -> str:
    """`with xA1 = mug, where (make-coffee human) takes 5`."""
    lengths = [
        f"{each.action} takes {readable(length)}"
        for each, length in situation.lengths.items()
        if not contradicts(each.guard, situation.values)
    ]
    values = [f"with {guard_text(situation.values)}"] if situation.values else []
    return ", ".join([*values, *(["where " + " and ".join(lengths)] if lengths else [])]) or "whatever happens"


def _span_text(part: GamePart, takes: Fraction, situations: tuple[GameSituation, ...]) -> str:
    told = " or ".join(map(_words, situations))
    return f"{part.first} to {part.last} takes {readable(takes)} {told}"


def _policy_lines(policy: Policy) -> list[str]:
    """What a policy chooses, by what it waits for: what all cases that it does not tell apart then have in common."""
    common: dict[tuple[str, object], set[str]] = {}
    chosen: dict[tuple[str, object], str] = {}
    for name, event in _made(policy).items():
        for branch in policy.branches:
            if (point := branch.points.get(event)) is not None:
                seen = set(_seen(policy, branch, event))
                common[name, point] = seen & common.get((name, point), seen)
                chosen[name, point] = f"{name} = {branch.scenario[name]}"
    whens = ((key, ", ".join(sorted(seen))) for key, seen in common.items())
    return list(dict.fromkeys(f"if {when}: {chosen[key]}" if when else chosen[key] for key, when in whens))


def _seen(policy: Policy, branch: GameBranch, event: str) -> Iterator[str]:
    """What an event waits for in a branch, as it turns out."""
    awaited = [sign for waiting, sign in branch.waits if waiting == event]
    values = dict(branch.case.values)
    yield from (f"{sign.choice} = {values[sign.choice]}" for sign in awaited if sign.choice in values)
    for number in {sign.number for sign in awaited if sign.choice is None}:
        low, high = branch.case.spans[number]
        yield f"{policy.game.contingent[number][1].action} takes {readable(low)} to {readable(high)}"


def _repair_lines(repair: BoundsRepair) -> Iterator[str]:
    match repair.status:
        case RepairStatus.UNNEEDED:
            yield "No bound has to be changed."
        case RepairStatus.IMPOSSIBLE:
            yield "No change of these bounds makes the plan controllable."
        case RepairStatus.UNKNOWN:
            yield "No change of these bounds is known to make the plan controllable."
        case RepairStatus.OPTIMAL | RepairStatus.FEASIBLE:
            least = "The least change" if repair.status is RepairStatus.OPTIMAL else "A change, perhaps not the least,"
            yield f"{least} after which the plan is controllable, in all {format_number(repair.cost)}:"
            for each in repair.changes:
                yield f"  {each.parameter.words}: {format_number(each.old)} to {format_number(each.new)}"


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
