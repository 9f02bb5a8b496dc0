"""Simulated executions of plans with choices, for people and programs: timelines with their reasons."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import zip_longest
from statistics import median
from typing import Any

from robust.numbers import duration, plural, readable
from robust.pike_bridge.likelihood import chance_answer
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online import world
from robust.pike_bridge.online.inquiry import Explanation, WhyChosen, WhyExcluded, WhyExecuted, WhyNot, answer
from robust.show.console import Console, Text, colour_of, printing
from robust.show.documents import documenting, has_table
from robust.show.pike import percent

has_table(world.ExecutionRecord, "steps", numbers=("time",))


@documenting.register(world.ExecutionRecord)
def run_document(record: world.ExecutionRecord) -> dict[str, Any]:
    """`robust/pike-run/1`."""
    return {
        "schema": "robust/pike-run/1",
        "status": record.ending.value,
        "seed": record.seed,
        "reasoner": record.reasoner,
        "backend": record.backend,
        "time": str(record.time),
        "choices": dict(record.choices),
        "schedule": {event: str(time) for event, time in sorted(record.schedule.items(), key=lambda item: item[1])},
        "steps": [_step_answer(step) for step in record.steps],
        "conflict": [fact.as_dict() for fact in record.conflict],
        **({"faults": list(record.faults)} if record.faults else {}),
        **({"budget": asdict(record.thrift)} if record.thrift.anything else {}),
        **({} if record.replans is None else {"replans": record.replans, "recovered": str(record.recovered)}),
    }


def _step_answer(step: world.ExecutionStep) -> dict[str, Any]:
    document: dict[str, Any] = {
        "time": str(step.time),
        "messages": [str(message) for message in step.messages],
        "decisions": [
            dict(zip(("what", "text"), _told(decision), strict=True))
            | ({"why": reason.as_dict()} if reason is not None else {})
            for decision, reason in _with_reasons(step)
        ],
        "possible": {choice: list(values) for choice, values in step.inferred.items()},
        "seconds": round(step.seconds, 6),
    }
    if step.guess:
        document["guess"] = dict(step.guess)
    if step.success is not None:
        document["chance"] = chance_answer(step.success, step.intents)
    if step.reasons is not None:
        inferences = {choice: reason.as_dict() for choice, reason in step.reasons.inferences.items()}
        document["why"] = {"continuation": answer(step.reasons.continuation), "inferences": inferences}
    return document


def _with_reasons(step: world.ExecutionStep) -> Iterator[tuple[said.Decision, Explanation | None]]:
    """Each decision of a step with its reason, if there is one."""
    return zip_longest(step.decisions, step.reasons.decisions if step.reasons else ())


def _told(decision: said.Decision) -> tuple[str, str]:  # noqa: PLR0911 - one for each kind
    """A decision or an observation, for people: a kind and a text."""
    match decision:
        case said.Executed(event, _, reported):
            return "event", f"{event}, reported" if reported else event
        case said.Dispatched(action, agent, _, _, lower, upper):
            limits = f"takes {readable(lower)} to {'any time' if upper is None else readable(upper)}"
            return "begin", f"{f'{agent}: ' if agent else ''}{action}, {limits}"
        case said.Chosen(choice, value, _, observed):
            return "observed" if observed else "chosen", f"{choice} = {value}"
        case said.Cancel(action, agent):
            return "cancel", f"{f'{agent}: ' if agent else ''}{action}"
        case said.Deviated(action, _, lasted, lower, upper, counts):
            bounds = f"instead of {readable(lower)} to {'any time' if upper is None else readable(upper)}"
            late = "" if counts is None else f"; counts as ended at {readable(counts)}"
            return "deviated", f"{action}: {readable(lasted)} {bounds}{late}"
        case said.Resumed(_, released, planned):
            again = f"; open again: {', '.join(released)}" if released else ""
            return "resumed", "another plan" if planned else f"the rest of the plan is correct from here{again}"
        case said.Excluded(_, _, lost, _, reason):
            return "excluded", f"{' and '.join(lost)}: {reason}"
        case said.Violated(atom, expected, producer, consumers, _):
            state, needed = "false" if expected else "true", ", ".join(consumers)
            since = f"since {producer} should have made it otherwise"
            return "broken", f"{atom} is {state} {since}; needed by {needed}"
        case said.Rejected(message, reason, _):
            return "rejected", f"{message}: {reason}"
        case said.Failed(_, reason):
            return "failed", reason
        case said.Succeeded():
            return "succeeded", "every activated event has been executed"


@printing.register(world.ExecutionRecord)
def print_run(out: Console, record: world.ExecutionRecord, *, quiet: bool) -> None:
    """Print how a run ended; unless `quiet` also the timeline, and contradictions that were not explained."""
    ending = record.ending.value

    headline = Text(ending, style=colour_of(ending))
    slowest = max((step.seconds for step in record.steps), default=0.0)
    typical = median(step.seconds for step in record.steps) if record.steps else 0.0
    headline.append(
        f" at {readable(record.time)} (seed {record.seed}); decisions took {duration(typical)} each, "
        f"{duration(slowest)} at most",
        "none",
    )
    if record.replans is not None:
        headline.append(f"; {plural(record.replans, 're-plan')}, recovery took {readable(record.recovered)}", "none")
    out.line(headline)
    if quiet:
        return
    if record.thrift.anything:
        thrift = record.thrift
        text = (
            f"{thrift.undecided} of {thrift.steps} steps were not decided within their budget, and went on in the next"
        )
        if thrift.followed:
            text += f"; {plural(thrift.followed, 'event')} executed so that a known execution stays possible"
        if thrift.stretched:
            text += f"; the budget is too small: {plural(thrift.stretched, 'step')} had to take more"
        out.line(f"{text}.")
    reasons = _Reasons()
    for step in record.steps:
        _print_step(out, step, reasons)
    if record.conflict and not record.explained:
        out.print()
        out.print("These facts contradict each other; without any one of them a correct execution would be left:")
        for fact in record.conflict:
            out.line(f"  {fact.text}")
    if record.faults:
        out.print()
        out.print("The executive took this for a success, but what activities need and do says otherwise:")
        for fault in record.faults:
            out.line(f"  {fault}")


def _print_step(out: Console, step: world.ExecutionStep, reasons: _Reasons) -> None:
    """What was decided, and what follows."""
    for decision, reason in _with_reasons(step):
        what, text = _told(decision)
        if what != "event":
            out.line(f"{readable(step.time):>10}  {what:<9} {text}")
            _print_lines(out, reasons.of_decision(reason))
    inferences = step.reasons.inferences if step.reasons else {}
    for choice in inferences or step.inferred:  # those first whose reasons others rest on
        values = step.inferred[choice]
        verb = "must be" if len(values) == 1 else "may still be"
        out.line(f"{'':>10}  so        {choice} {verb} {' or '.join(values)}")
        _print_lines(out, reasons.of_inference(choice, inferences.get(choice)))
    if step.guess:
        guess = ", ".join(f"{name} = {value}" for name, value in step.guess.items())
        out.line(f"{readable(step.time):>10}  guess     {guess}")
    if step.success is not None:
        out.line(f"{'':>10}  likely    success {percent(step.success)}")
        likely = (f"{each.choice} = {each.value} {float(each.probability):.0%}" for each in step.intents)
        _print_lines(out, [", ".join(likely)] if step.intents else [])


def _print_lines(out: Console, lines: Iterable[str]) -> None:
    out.lines((f"{'':>24}{line}" for line in lines), "dim")


class _Reasons:
    """Reasons in a timeline, none of them told twice."""

    def __init__(self) -> None:
        self._inferred: dict[str, str] = {}
        self._said: set[str] = set()

    def of_decision(self, reason: Explanation | None) -> Iterator[str]:
        """The lines below a decision."""
        match reason:
            case WhyChosen() if self._inferred.get(reason.choice) == reason.value:
                yield "; ".join(["as inferred", *self._new(reason.parts)])
            case WhyChosen() | WhyExecuted():
                yield from reason.excluding if isinstance(reason, WhyChosen) else ()
                new = "; ".join(self._new(reason.parts))
                if new:
                    yield new
            case WhyNot() | WhyExcluded():
                yield from reason.lines

    def of_inference(self, choice: str, reason: Explanation | None) -> Iterator[str]:
        """The lines below an inference."""
        if isinstance(reason, WhyChosen):
            if reason.value is not None:
                self._inferred[choice] = reason.value
            yield from reason.excluding

    def _new(self, lines: tuple[str, ...]) -> Iterator[str]:
        for line in lines:
            if line not in self._said:
                self._said.add(line)
                yield line
