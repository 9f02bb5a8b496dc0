"""Plans with choices for people and programs: answers, sizes, and simulated executions with their reasons."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

from msgspec import UNSET, Meta, UnsetType

from robust.json_text import Count, JsonObject, Rational, Seconds, on_wire, one_of
from robust.numbers import duration, format_number, plural, readable
from robust.pike_bridge import action_model, model, semantics
from robust.pike_bridge.compile import ConditionLinks, FormulaLabel, PikeCheck, PlanDistances, Sizes
from robust.pike_bridge.cross_check import CrossCheck, Crossed, Disagreement
from robust.pike_bridge.likelihood import OPEN, ChanceBounds, TeamChance
from robust.pike_bridge.online import executive
from robust.show.console import Console, printing
from robust.show.documents import Document, Ended, Rationals, Verdict, document, document_of, documenting, has_table

Stages = Annotated[dict[str, Seconds], Meta(description="by stage")]


class PikeChecked(JsonObject, tag_field="schema", tag="robust/pike-check/1", kw_only=True):
    """what `robust pike check --json` prints

    Attributes:
        verdict: proved: a correct execution exists under the assumptions
        schedule: times of the activated events, the earliest first
        scenarios: with --all-scenarios: every team scenario that admits a correct execution
        because: if refuted: lines that say what contradicts itself; none could be left out
        complete: whether no scenario that was asked for is missing
    """

    verdict: Verdict
    backend: str
    scenario: dict[str, str] | None
    schedule: Rationals | None
    scenarios: list[dict[str, str]] | UnsetType = UNSET
    because: list[str] | UnsetType = UNSET
    complete: bool
    interrupted: bool
    seconds: Stages


class PikeCompile(JsonObject, tag_field="schema", tag="robust/pike-compile/1", kw_only=True):
    """what `robust pike compile --json` prints

    Attributes:
        implicants: with --implicants
        causal_links: with --show links
        labels: with --show labels
        distances: with --show distances
    """

    status: Ended
    backend: str
    temporal: Annotated[str, one_of("lazy", "apsp")]
    solver: str
    satisfiable: bool | None
    candidate_subplans: Count | None
    choices: Count | UnsetType = UNSET
    events: Count | UnsetType = UNSET
    activities: Count | UnsetType = UNSET
    conditions: Count | UnsetType = UNSET
    choice_variables: Count | UnsetType = UNSET
    links: Count | UnsetType = UNSET
    added_orderings: Count | UnsetType = UNSET
    propositional_constraints: Count | UnsetType = UNSET
    temporal_conflicts: Count | UnsetType = UNSET
    prime_implicants: Count | None
    models: Count | None
    seconds: Stages
    statistics: dict[str, Any]
    implicants: list[dict[str, str]] | UnsetType = UNSET
    causal_links: list[ConditionLinks] | UnsetType = UNSET
    labels: list[FormulaLabel] | UnsetType = UNSET
    distances: PlanDistances | UnsetType = UNSET


class PikeCross(JsonObject, tag_field="schema", tag="robust/pike-cross/1"):
    """what `robust pike check --cross --json` prints

    Attributes:
        questions: asked of each back end
        witness: the file of a small plan that shows the first disagreement
    """

    status: Ended
    agree: bool | None
    scenarios: Count | None
    questions: dict[str, Count]
    out_of_time: list[str]
    disagreements: list[Disagreement]
    witness: str | None


on_wire("ChanceBounds")


class PikeIntent(JsonObject):
    """a value that people may choose

    Attributes:
        probability: that they do, by the tables of the plan and what is assumed
        lower: how likely success is at least if they do; null if they never do
        upper: how likely it is at most; the same number if time sufficed
    """

    choice: str
    value: str
    probability: Rational
    lower: Rational | None
    upper: Rational | None


class PikeChance(JsonObject, tag_field="schema", tag="robust/pike-chance/1"):
    """what `robust pike chance --json` prints

    Attributes:
        order: the choices in the order in which they are taken
        success: how likely a correct execution is left, if people's choices come first where the plan leaves that open
        hasty: the same if the team's choices come first there
        uniform: choices of people whose values count as equally likely, as the plan says nothing about them
    """

    status: Ended
    backend: str
    order: list[str]
    success: ChanceBounds
    hasty: ChanceBounds
    intents: list[PikeIntent]
    uniform: list[str]
    seconds: Seconds


on_wire("Moment")


class PikePatience(JsonObject, tag_field="schema", tag="robust/pike-patience/1"):
    """what `robust pike check --patience --json` prints

    Attributes:
        feasible: whether a correct execution exists under the assumptions
        moments: of each value that a choice of others may have: until when it can be chosen; null if that is any time
    """

    status: Ended
    feasible: bool | None
    moments: list[executive.Moment]


class PikePlot(JsonObject, tag_field="schema", tag="robust/pike-plot/1"):
    """what `robust pike plot --json` prints"""

    plot: str
    events: Count
    activities: Count
    choices: Count
    links: Count | None


class PikeNew(JsonObject, tag_field="schema", tag="robust/pike-new/1"):
    """what `robust pike new --json` prints

    Attributes:
        name: of the plan
        files: that were written, the plan first
    """

    name: str
    files: list[str]
    choices: Count
    events: Count
    activities: Count


has_table(PikeCheck, "scenarios")
has_table(Crossed, "disagreements")
has_table(TeamChance, "intents", numbers=("probability", "lower", "upper"))
has_table(executive.Moments, "moments", numbers=("latest",))
STAGES = ("precedence", "links", "conflicts", "knowledge")


# -- check -------------------------------------------------------------------------------------------------------------


@documenting.register(PikeCheck)
def check_document(result: PikeCheck) -> Document:
    """`robust/pike-check/1`."""
    execution = result.execution
    return document_of(
        PikeChecked,
        result,
        scenario=None if execution is None else execution.scenario,
        schedule=None if execution is None else dict(in_order(execution.schedule)),
        scenarios=UNSET if result.scenarios is None else result.scenarios,
        because=[line.strip() for line in result.because] or UNSET,
        seconds=_rounded(result.seconds or {}),
    )


def _rounded(seconds: Mapping[str, float]) -> dict[str, float]:
    return {stage: round(spent, 6) for stage, spent in seconds.items()}


def in_order(schedule: Mapping[str, Fraction]) -> list[tuple[str, Fraction]]:
    """Events by time."""
    return sorted(schedule.items(), key=lambda item: (item[1], item[0]))


@printing.register(PikeCheck)
def print_check(out: Console, result: PikeCheck, *, quiet: bool) -> None:
    """The verdict; unless `quiet` also the execution and the scenarios."""
    out.print(_check_headline(result))
    if quiet:
        return
    for line in result.because:
        out.print(f"  {line}")
    if result.execution is not None:
        for line in execution_lines(result.execution, result.plan):
            out.print(f"  {line}")
    missing = "" if result.complete else " so far"
    if result.scenarios or (missing and result.scenarios is not None):
        out.print(f"{plural(len(result.scenarios), 'team scenario')}{missing}:")
        for scenario in result.scenarios:
            out.print(f"  {scenario_text(scenario)}")


def _check_headline(result: PikeCheck) -> str:
    match result.verdict.value:
        case "proved":
            return "A correct execution exists."
        case "refuted":
            return "No correct execution exists."
        case _:
            return f"Undecided: {'interrupted' if result.interrupted else result.reason or 'out of time'}."


def scenario_text(scenario: Mapping[str, str]) -> str:
    """`x = 1, y = 2`."""
    return ", ".join(f"{name} = {value}" for name, value in scenario.items()) or "no choices"


def execution_lines(execution: semantics.Execution, plan: model.TeamPlan | None) -> Iterable[str]:
    """The choices, and the activities by the time at which they start."""
    yield scenario_text(execution.scenario)
    if plan is None:
        return
    schedule = execution.schedule
    rows = [
        (schedule[activity.source], schedule[activity.target], activity)
        for activity in plan.network.activities
        if all(execution.scenario[variable] == value for variable, value in activity.guard)
    ]
    for start, end, activity in sorted(rows, key=lambda row: row[:2]):
        agent = "" if activity.agent is None else f"  [{activity.agent}]"
        yield f"{format_number(start)} – {format_number(end)}  {activity.action}{agent}"


# -- compile -----------------------------------------------------------------------------------------------------------


@documenting.register(Sizes)
def compile_document(sizes: Sizes) -> Document:
    """`robust/pike-compile/1`."""
    known = {**vars(sizes), **sizes.counts, "seconds": _rounded(sizes.seconds)}
    del known["counts"], known["reason"]
    listings = ("implicants", "causal_links", "labels", "distances")
    return document(PikeCompile(**known | {name: UNSET for name in listings if known[name] is None}))


@printing.register(Sizes)
def print_sizes(out: Console, sizes: Sizes, *, quiet: bool) -> None:
    """Print whether the plan was compiled; unless `quiet` also the sizes."""
    out.print(_compile_headline(sizes))
    if quiet:
        return
    for name, value in _facts(sizes).items():
        out.print(f"  {name}: {value}")
    for implicant in sizes.implicants or ():
        out.line(f"  {_environment(implicant)}")
    out.lines(chain(_link_lines(sizes), _label_lines(sizes), _distance_lines(sizes)))


def _environment(values: Mapping[str, str]) -> str:
    return "{" + ", ".join(f"{name} = {value}" for name, value in values.items()) + "}"


def _where(values: Mapping[str, str]) -> str:
    return f" if {scenario_text(values)}" if values else ""


def _at(event: str, actions: Sequence[str]) -> str:
    return f"{event}, {' and '.join(actions)}" if actions else event


_AWAY = {"before": "is put before it", "after": "is put after its consumer", "never": "excludes it"}


def _link_lines(sizes: Sizes) -> Iterator[str]:
    """Each condition, the links that may support it, and the threats of each."""
    for each in sizes.causal_links or ():
        place = each.first if each.first == each.last else f"{each.first} to {each.last}"
        yield f"{each.condition} at {_at(place, each.actions or ['the goal'])}{_where(each.label)}:"
        for link in each.producers:
            ordered = ", put before" if link.ordered else ""
            yield f"  from {_at(link.event, link.actions)}{_where(link.label)}{ordered}"
            for threat in link.threats:
                away = _AWAY.get(threat.resolution, f"is before it or after its consumer: {threat.variable}")
                yield f"    {_at(threat.event, threat.actions)}{_where(threat.label)} {away}"
        if not each.producers:
            yield "  from nothing"


def _label_lines(sizes: Sizes) -> Iterator[str]:
    for label in sizes.labels or ():
        yield f"{label.kind} {label.formula}: {', '.join(map(_environment, label.environments)) or 'nowhere'}"


def _distance_lines(sizes: Sizes) -> Iterator[str]:
    if sizes.distances is not None:
        for conflict in sizes.distances.conflicts:
            yield f"no schedule{_where(conflict)}"
        for pair in sizes.distances.pairs:
            values = "; ".join(f"{readable(value.bound)}{_where(value.label)}" for value in pair.values)
            yield f"{pair.source} to {pair.target}: at most {values}"


def _compile_headline(sizes: Sizes) -> str:
    ended = "out of time" if sizes.status == "timeout" else sizes.reason or sizes.status
    if sizes.satisfiable is None:
        reached = [stage for stage in STAGES if stage in sizes.seconds]
        after = f" in stage {reached[-1]!r}" if reached else ""
        return f"Not compiled: {ended}{after}."
    known = f"Compiled: {'a' if sizes.satisfiable else 'no'} correct execution exists"
    return f"{known}." if sizes.status == "complete" else f"{known}; {ended} before all was counted and listed."


def _facts(sizes: Sizes) -> Mapping[str, str]:
    counts = {
        "candidate subplans": sizes.candidate_subplans,
        **{name.replace("_", " "): value for name, value in sizes.counts.items()},
        "prime implicants": sizes.prime_implicants,
        "models": sizes.models,
    }
    times = {f"{stage}, time": duration(spent) for stage, spent in sizes.seconds.items()}
    known = {name: f"{value:,}" for name, value in counts.items() if value is not None}
    if sizes.models is None and sizes.satisfiable is not None and sizes.status == "complete" and sizes.backend == "sat":
        known["models"] = "not counted: a solver lists them one by one (--models)"
    return known | times


# -- cross-check -------------------------------------------------------------------------------------------------------


@documenting.register(Crossed)
def cross_document(crossed: Crossed) -> Document:
    """`robust/pike-cross/1`."""
    outcome = CrossCheck() if crossed.outcome is None else crossed.outcome
    return document_of(
        PikeCross,
        outcome,
        status=crossed.status,
        agree=None if crossed.outcome is None else outcome.agree,
        scenarios=None if crossed.outcome is None else outcome.scenarios,
        witness=None if crossed.written is None else str(crossed.written),
    )


@printing.register(Crossed)
def print_cross(out: Console, crossed: Crossed, *, quiet: bool) -> None:
    """Print whether all agree; unless `quiet` also how many questions they were asked."""
    outcome = crossed.outcome
    if outcome is None:
        out.print("Undecided: out of time before the oracle had found every scenario.")
        return
    asked = sum(outcome.questions.values())
    if outcome.agree:
        out.print(f"All agree: {plural(outcome.scenarios, 'team scenario')}, {plural(asked, 'question')}.")
    else:
        several = len(outcome.disagreements) > 1
        out.print(f"{plural(len(outcome.disagreements), 'disagreement')} with the oracle{', the smallest' * several}:")
        out.print(f"  {outcome.smallest}")
    if not quiet:
        for name, count in outcome.questions.items():
            late = "; out of time" if name in outcome.out_of_time else ""
            out.print(f"  {name}: {plural(count, 'question')}{late}")
    if crossed.written is not None:
        out.print(f"The smallest plan found that shows it: {crossed.written}")


# -- chance ------------------------------------------------------------------------------------------------------------


@documenting.register(TeamChance)
def chance_document(result: TeamChance) -> Document:
    """`robust/pike-chance/1`."""
    intents = [
        PikeIntent(each.choice, each.value, each.probability, *(each.success or (None, None)))
        for each in result.intents
    ]
    return document_of(PikeChance, result, intents=intents)


@printing.register(TeamChance)
def print_chance(out: Console, result: TeamChance, *, quiet: bool) -> None:
    """Print how likely success is; unless `quiet` also by what people may choose."""
    if result.cut_short:
        out.print(f"Undecided: {'interrupted' if result.status == 'interrupted' else result.reason or 'out of time'}.")
    if result.success != OPEN:
        out.print(f"Success is {percent(result.success)} likely.")
    if quiet or not result.intents:
        return
    if result.hasty != result.success:
        out.print(
            f"If the team's choices do not wait for people's where the plan leaves that open: {percent(result.hasty)}."
        )
    rows = [
        (f"{each.choice} = {each.value}", _share(each.probability), percent(each.success)) for each in result.intents
    ]
    if rows:
        widths = [max(len(row[column]) for row in rows) for column in (0, 1)]
        out.print("What people may choose, how likely that is, and success if they do:")
        for name, share, success in rows:
            out.line(f"  {name:<{widths[0]}}  {share:>{widths[1]}}  {success}")
    if result.uniform:
        out.print(f"The plan has no probabilities of {', '.join(result.uniform)}: all values count as equally likely.")


def percent(chance: ChanceBounds | None) -> str:
    """A probability, or the bounds that are known."""
    if chance is None:
        return "–"
    low, high = map(_share, chance)
    return low if chance.lower == chance.upper else f"{low} to {high}"


def _share(probability: Fraction) -> str:
    """In per cent; what is neither impossible nor certain does not look as if it were."""
    text = f"{float(probability):.2%}"
    if 0 < probability < 1 and text in {"0.00%", "100.00%"}:
        return "less than 0.01%" if text == "0.00%" else "more than 99.99%"
    return text


# -- patience ----------------------------------------------------------------------------------------------------------


@documenting.register(executive.Moments)
def patience_document(found: executive.Moments) -> Document:
    """`robust/pike-patience/1`."""
    return document_of(PikePatience, found)


@printing.register(executive.Moments)
def print_patience(out: Console, result: executive.Moments, *, quiet: bool) -> None:
    """Print whether a correct execution exists; unless `quiet` also until when each value can be chosen."""
    if result.feasible is None:
        out.print("Undecided: out of time.")
        return
    out.print("A correct execution exists." if result.feasible else "No correct execution exists.")
    if quiet:
        return
    width = max((len(f"{moment.choice} = {moment.value}") for moment in result.moments), default=0)
    for moment in result.moments:
        until = "at any time" if moment.latest is None else f"until {readable(moment.latest)}"
        out.print(f"  {f'{moment.choice} = {moment.value}':<{width}}  {until if moment.possible else 'never'}")
    if result.cut_short:
        out.print("Out of time before all were found." if result.status == "timeout" else "Interrupted.")


# -- plot --------------------------------------------------------------------------------------------------------------


def print_plot(out: Console, drawn: PikePlot, *, quiet: bool) -> None:
    """Print what was drawn, unless `quiet`."""
    if not quiet:
        links = "" if drawn.links is None else f", {plural(drawn.links, 'labeled causal link')}"
        counts = {"event": drawn.events, "activity": drawn.activities, "choice": drawn.choices}
        out.print(f"{drawn.plot}: {', '.join(plural(count, noun) for noun, count in counts.items())}{links}")


# -- new --------------------------------------------------------------------------------------------------------------


def new_document(instance: action_model.Instance, path: Path) -> Document:
    """`robust/pike-new/1`."""
    network = instance.network
    return document(
        PikeNew(
            name=instance.name,
            files=[str(path), *(str(path.with_name(file)) for file in ("domain.pddl", "problem.pddl"))],
            choices=len(network.choices),
            events=len(network.events),
            activities=len(network.activities),
        )
    )


def print_new(out: Console, instance: action_model.Instance, path: Path, *, quiet: bool) -> None:
    """The files that were written; unless `quiet` also commands to try next."""
    network = instance.network
    activities = plural(len(network.activities), "activity")
    text = f"{path}: {plural(len(network.choices), 'choice')}, {activities}; beside it domain.pddl and problem.pddl"
    out.line(text)
    if quiet:
        return
    file = shlex.quote(str(path))
    parameter = shlex.quote(f"duration:{network.activities[0].action}") if network.activities else "SPEC"
    for text in (
        f"check {file} --all-scenarios",
        f"run {file} --explain",
        f"region {file} --parameter {parameter}",
        f"plot {file} -o {shlex.quote(str(path.with_name('plan.svg')))}",
    ):
        out.line(f"  robust pike {text}")
