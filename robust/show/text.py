"""Plans in words, and verdicts and counterexamples for people.

Names such as `dur_n3` and `n3 move: at start (at rover base)` say where something stands in the files; people know the
actions. Where an action occurs more than once, its occurrences are counted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

from robust.irr.check import Answer, CheckResult, Counterexample
from robust.numbers import approximate, duration, end, format_number, plural, readable, readable_values
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import TraceStep, Violation
from robust.qe.box import Interval
from robust.show.console import Console, Text, colour_of, printing

if TYPE_CHECKING:
    from robust.irr import stops
    from robust.irr.quantities import QuantityChange

MANY = 8
"""Values that are shown one by one."""
_NO_PLAN = model.ParametrizedPlan("", (), (), (), frozenset(), {}, (), ())
_WHEN = {
    model.Timing.AT_START: "when it starts",
    model.Timing.OVER_ALL: "all the time",
    model.Timing.AT_END: "when it ends",
}


class Words:
    """Descriptions of the names in one plan.

    Args:
        plan: the plan.
        epsilon: the separation of mutex time points, where it is to be named.
    """

    def __init__(self, plan: model.ParametrizedPlan, epsilon: Fraction | None = None) -> None:
        self._plan = plan
        self._epsilon = epsilon

    @cached_property
    def actions(self) -> Mapping[str, str]:
        """By identifier: `move dock pharmacy`, and `(2nd)` and the like where the plan has it more than once."""
        texts = {instance.identifier: str(instance)[1:-1] for instance in self._plan.instances}
        every = list(texts.values())
        seen: dict[str, int] = {}
        names = {}
        for identifier, text in texts.items():
            seen[text] = seen.get(text, 0) + 1
            names[identifier] = text if every.count(text) == 1 else f"{text} ({_ordinal(seen[text])})"
        return names

    @cached_property
    def parameters(self) -> Mapping[str, str]:
        """By name, all different: a duration is its action, others say what they are; the name where nothing does."""
        names = {}
        for parameter in self._plan.parameters:
            uses = dict.fromkeys(self._uses(parameter.name))
            names[parameter.name] = next(iter(uses)) if len(uses) == 1 else parameter.name
        texts = list(names.values())
        return {name: text if texts.count(text) == 1 else f"{text} ({name})" for name, text in names.items()}

    def told(self, text: str) -> str:
        """A text with actions for identifiers: `n3 drive: at end (up)` becomes `drive r1 a b (n3): at end (up)`."""
        return self._identifiers.sub(self._told, text) if self.actions else text

    @cached_property
    def _identifiers(self) -> re.Pattern[str]:
        names = "|".join(re.escape(name) for name in sorted(self.actions, key=len, reverse=True))
        return re.compile(rf"(?<![\w.(-])({names})(?:\.(start|end)\b|( \S+(?=: ))|(?![\w.(-]))")

    def _told(self, match: re.Match[str]) -> str:
        identifier, end, action = match.groups()
        text = f"{self.actions[identifier]} ({identifier})"
        if action is not None and action.strip() != self._plan.instance[identifier].action:
            text += action
        return text if end is None else f"{end} of {text}"

    def _uses(self, name: str) -> Iterator[str]:
        """Each use of a parameter in the plan, as text."""
        itself = Polynomial.variable(model.ParameterReference(name))
        mentioned = False
        for constraint in self._plan.constraints:
            ends = constraint.lower == itself, constraint.upper == itself
            if any(ends):
                yield self._between(constraint.source, constraint.target, ends)
            elif any(
                bound is not None and model.ParameterReference(name) in bound.variables
                for bound in (constraint.lower, constraint.upper)
            ):
                mentioned = True
        if mentioned:
            yield name
        for fluent, value in self._plan.initial_fluents.items():
            if value == itself:
                yield f"{str(fluent)[1:-1]} at the beginning"

    def _between(self, source: model.TimePoint, target: model.TimePoint, ends: tuple[bool, bool]) -> str:
        """A description of the time between two time points, or of a bound of it."""
        kinds = source.kind, target.kind
        if source.instance == target.instance and kinds == (model.TimePointKind.START, model.TimePointKind.END):
            least, most, what = "shortest ", "longest ", self.actions[f"{target.instance}"]
        elif source == model.ZERO:
            least, most, what = "earliest ", "latest ", self.point(target)
        else:
            least, most, what = "least ", "greatest ", f"time from {self.point(source)} to {self.point(target)}"
        return f"{ {(True, False): least, (False, True): most}.get(ends, '') }{what}"

    def point(self, point: model.TimePoint) -> str:
        """`end of move dock pharmacy`."""
        match point.kind:
            case model.TimePointKind.ZERO:
                return "beginning"
            case model.TimePointKind.TIMED_LITERAL:
                return f"timed event at {format_number(point.time or Fraction(0))}"
            case model.TimePointKind.INSTANT:
                return self.actions[f"{point.instance}"]
        return f"{point.kind.value} of {self.actions[f'{point.instance}']}"

    def statement(self, one: model.TemporalConstraint) -> str:
        """A constraint of the network, with its line."""
        lower, upper = (None if bound is None else model.as_written(bound) for bound in (one.lower, one.upper))
        line = f" (line {one.location.line})" if one.location and one.location.line else ""
        if lower is not None and lower == upper:
            demand = f"is {lower}"
        else:
            demand = (
                " and ".join(filter(None, (lower and f"at least {lower}", upper and f"at most {upper}"))) or "is any"
            )
        what = self._between(one.source, one.target, (True, True))
        if one.source.instance == one.target.instance:
            what = f"duration of {what}"
        return f"{what}: {demand}{line}"

    def obligation(self, name: str) -> str:
        """The demand of an obligation; the name itself if it is not one of the plan's obligations."""
        return self._obligations.get(name) or self._separation(name) or name

    @cached_property
    def _obligations(self) -> Mapping[str, str]:
        texts = {goal.label: f"the goal {goal.text} must hold at the end" for goal in self._plan.goal}
        for instance in self._plan.instances:
            action = self.actions[instance.identifier]
            texts[f"{instance.identifier} {instance.action}: non-negative duration"] = (
                f"{action} must not end before it starts"
            )
            for constraint in instance.durations:
                texts[instance.label(constraint)] = (
                    f"the duration of {action} must be as the domain says: {constraint.text}"
                )
            for condition in instance.demands:
                texts[instance.label(condition)] = (
                    f"{action} needs {condition.text}{self._when(instance.durative, condition)}"
                )
        return texts

    @staticmethod
    def _when(durative: bool, condition: model.TimedCondition) -> str:
        return f" {_WHEN[condition.timing]}" if durative else ""

    def _separation(self, name: str) -> str | None:
        pair = self._separated(name)
        apart = f"at least {format_number(self._epsilon)} apart" if self._epsilon else "at different times"
        return f"{' and '.join(map(self.point, pair))} must be {apart}" if pair else None

    def _separated(self, name: str) -> tuple[model.TimePoint, ...]:
        """The two time points that an obligation separates; none if it is another one."""
        kind, _, pair = name.partition(": ")
        known = {str(point): point for point in self._plan.time_points}
        points = tuple(known[text] for text in pair.split(", ") if text in known)
        return points if kind == "separation" and len(points) == 2 else ()

    def concerned(self, name: str) -> tuple[str, ...]:
        """The identifiers of the instances that an obligation is about; none for goals."""
        known = name in self._obligations or self._separated(name)
        return tuple(identifier for identifier in model.concerned(name) if known and identifier in self._plan.instance)


def words_of(plan: model.ParametrizedPlan | None) -> Words:
    """The words of a plan; names stay as they are where it is not known."""
    return Words(_NO_PLAN if plan is None else plan)


def named(name: str, words: Mapping[str, str] | None) -> str:
    """A parameter for an axis: its words, with the name to type in parentheses."""
    text = (words or {}).get(name, name)
    return text if name in text else f"{text} ({name})"


def _ordinal(number: int) -> str:
    suffix = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{suffix}"


# -- check -----------------------------------------------------------------------------------------------------------


@printing.register(CheckResult)
def print_check(out: Console, result: CheckResult, *, quiet: bool) -> None:
    """The verdict; unless `quiet` also what breaks and how, and the verdict of each obligation if all were examined.

    A refutation ends with its repair, if there is one.
    """
    words = words_of(result.plan)
    out.line(_verdict(result, words))
    if quiet:
        return
    out.line(_summary(result, words))
    print_tolerance(out, result.tolerance)
    if result.every:
        _print_broken(out, result, words)
    for counterexample in list(result.counterexamples.values())[:1]:
        out.print()
        print_counterexample(out, counterexample, words)
    if result.repair is not None:
        out.print()
        out.line(Text.assemble(("repair: ", "bold"), "; ".join(map(change_text, result.repair))))


def print_tolerance(out: Console, tolerance: stops.Tolerance | None) -> None:
    """λ* in one line, if it is known."""
    if tolerance is not None:
        out.line(Text.assemble(("tolerance", "bold"), f": {tolerance}"))


def change_text(change: QuantityChange) -> str:
    """A change of a plan in words, and where."""
    line = change.location.line if change.location is not None else None
    return change.words if line is None else f"{change.words} (line {line})"


def _verdict(result: CheckResult, words: Words) -> Text:
    text = Text(result.answer.value, style=colour_of(result.answer.value))
    broken = [words.told(name) for name, answer in result.obligations.items() if answer is Answer.REFUTED]
    match result.answer:
        case Answer.PROVED:
            about = (
                "every schedule that its network allows" if result.tree is None else f"every execution of {result.tree}"
            )
            text.append(f": the plan is valid for {about}", style="default")
        case Answer.UNKNOWN:
            stopped = "out of time" if result.timed_out else "interrupted" if result.interrupted else result.reason
            text.append(f": {stopped}" if stopped else "", style="default")
        case Answer.REFUTED if result.reason is not None:
            text.append(f": {words.told(result.reason)}", style="default")
        case Answer.REFUTED:
            allowed = "an allowed schedule" if result.tree is None else f"an execution of {result.tree}"
            text.append(f": {allowed} breaks {'; '.join(broken)}", style="default")
    return text


def _summary(result: CheckResult, words: Words) -> Text:
    answers = list(result.obligations.values())
    proved = answers.count(Answer.PROVED)
    parts = [f"{proved} of {plural(len(answers), 'obligation')} proved", duration(result.seconds)]
    if proved:
        asked = f"{proved - result.settled} by the solver"
        parts[0] += f" ({result.settled} by shortest paths, {asked})" if result.settled else f" ({asked})"
    if result.counterexamples and Answer.UNKNOWN in answers:
        parts[0] += ", the others not examined"
    values = [f"{named(name, words.parameters)} {_values(interval)}" for name, interval in result.box.intervals.items()]
    if values:
        parts.append(f"with {_first(values)}")
    return Text(f"{'; '.join(parts)}.", style="dim")


def _first(values: Sequence[str]) -> str:
    more = [f"{len(values) - MANY} more (--json lists them)"] if len(values) > MANY else []
    return ", ".join([*values[:MANY], *more])


def _values(interval: Interval) -> str:
    if interval.lower is not None and interval.lower == interval.upper:
        return f"= {readable(interval.lower)}"
    return f"in [{end(interval.lower, upper=False)}, {end(interval.upper, upper=True)}]"


def _print_broken(out: Console, result: CheckResult, words: Words) -> None:
    """Every obligation that is not proved, with a time and a reason where it breaks."""
    rows = []
    for name, answer in result.obligations.items():
        if answer is not Answer.PROVED:
            counterexample = result.counterexamples.get(name)
            when, why = ("", "") if counterexample is None else _when_and_why(counterexample)
            rows.append((Text(answer.value, style=colour_of(answer.value)), words.told(name), when, why))
    if rows:
        from robust.show.tables import show_table, table  # noqa: PLC0415 - rich takes long to load

        out.print()
        show_table(out, table(("verdict", "obligation", "time", "why"), rows, right=("time",)))


def _when_and_why(example: Counterexample) -> tuple[str, str]:
    violations = example.simulation.violations
    violation = next(violation for violation in violations if violation.obligation == example.obligation)
    return readable(violation.time), readable_values(violation.detail)


# -- counterexamples -------------------------------------------------------------------------------------------------


def print_counterexample(out: Console, example: Counterexample, words: Words) -> None:
    """Print what breaks, when and why, and the schedule that breaks it, state by state."""
    when, why = _when_and_why(example)
    out.line(Text.assemble(("broken: ", "bold red"), words.told(example.obligation)))
    out.line(f"  at time {when}: {why}")
    values = [f"{named(name, words.parameters)} = {readable(value)}" for name, value in example.parameters.items()]
    if values:
        out.line(f"  parameters: {_first(values)}")
    from robust.show.tables import show_table, table  # noqa: PLC0415 - as above

    constant = example.simulation.constants
    rows = (
        _violation_cells(step, words) if isinstance(step, Violation) else _step_cells(step, constant, words)
        for step in _shown_steps(example, constant)
    )
    show_table(out, table(("time", "happens", "changes", "fluents"), rows, right=("time",)))


def _with_violations(example: Counterexample) -> Iterator[TraceStep | Violation]:
    """Steps in order of time, each violation before what happens later."""
    pending = sorted(example.simulation.violations, key=lambda violation: violation.time)
    for step in example.simulation.trace:
        while pending and pending[0].time < step.time:
            yield pending.pop(0)
        yield step
    yield from pending


def _shown_steps(example: Counterexample, left_out: Set[model.Fluent]) -> Iterator[TraceStep | Violation]:
    """The steps to show: none that change nothing, and no timed literals after everything else."""
    steps = list(_with_violations(example))
    while isinstance(last := steps[-1], TraceStep) and not any(point.instance for point in last.points):
        steps.pop()
    for step in steps:
        if (
            isinstance(step, Violation)
            or any(point.instance for point in step.points)
            or step.atoms_changed
            or step.fluents.keys() - left_out
        ):
            yield step


def _step_cells(step: TraceStep, left_out: Set[model.Fluent], words: Words) -> tuple[str, ...]:
    changes = [f"{'+' if value else '−'} {atom}" for atom, value in step.atoms_changed]
    fluents = [f"{fluent} = {readable(value)}" for fluent, value in step.fluents.items() if fluent not in left_out]
    points = (words.told(str(point)) if point.time is None else f"@{readable(point.time)}" for point in step.points)
    return readable(step.time), "\n".join(points), "\n".join(changes), "\n".join(fluents)


def _violation_cells(violation: Violation, words: Words) -> tuple[Text, ...]:
    texts = (readable(violation.time), words.told(violation.obligation), readable_values(violation.detail))
    time, obligation, detail = (Text(text, style="red") for text in texts)
    return time, Text("✗ violated", style="bold red"), obligation, detail


# -- parameters ------------------------------------------------------------------------------------------------------


def percentages(parameter: model.Parameter, interval: Interval) -> str:
    """Deviations of the ends from the nominal value in per cent, `−12.5 %, +40 %`; empty if that value is 0."""
    sides = [parameter.percent(interval.lower), parameter.percent(interval.upper)]
    shown = (f"{sign}∞" if side is None else percentage(side) for side, sign in zip(sides, "−+", strict=True))
    return ", ".join(shown) if any(side is not None for side in sides) else ""


def percentage(value: Fraction) -> str:
    """`−12.5 %`, `+40 %`, to three digits."""
    rounded = f"{approximate(abs(value)):.3g}" if abs(value) < 1000 else f"{approximate(abs(value)):.0f}"
    return f"{'−' if value < 0 else '+' if value > 0 else ''}{rounded} %"


def stopped(status: Enum, reason: str | None) -> str:
    """The reason why a search did not come to its end."""
    return {"timeout": "out of time", "interrupted": "interrupted"}.get(status.value) or f"{reason}"


def print_advice(out: Console, advice: Iterable[stops.Advice]) -> None:
    """Print which options to use for parameters without room."""
    for hint in advice:
        out.line(str(hint), "yellow")
