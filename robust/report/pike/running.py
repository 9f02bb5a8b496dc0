"""`robust pike run`: a simulated execution as a timeline, JSON or a Gantt chart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from robust.report import options
from robust.report.guard import Cause, GivenUpError, Guard
from robust.report.numbers import duration, readable
from robust.report.output import answering, print_json
from robust.report.pike.requests import check_backend, guarded
from robust.report.progress import Display
from robust.report.terminal import console
from robust.smt.limits import Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.online.world import Record, Rehearsal, Step
    from robust.report.gantt import Chart

SCHEMA = "robust/pike-run/1"
_CODES = {"succeeded": 0, "failed": 1}
_STYLES = {"succeeded": "green", "failed": "bold red"}


@dataclass(frozen=True)
class PikeRunRequest:
    """The options as they were typed."""

    file: Path
    human: str = "rational"
    pace: str = "cooperative"
    outcomes: tuple[str, ...] = ()
    disturbances: tuple[str, ...] = ()
    delay: str = "0"
    seed: int = 0
    infer: bool = True
    explain: bool = False
    plot: Path | None = None
    backend: str = "smt"
    solver: str = "z3"
    epsilon: str = "1/1000"
    timeout: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class _Run:
    request: PikeRunRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    delay: Fraction
    limit: float | None
    rehearsal: Rehearsal | None = None

    def execute(self) -> Record:
        from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415 - imports the grammar
        from robust.pike_bridge.online.world import Rehearsal  # noqa: PLC0415 - imports solvers
        from robust.report.pike.stories import story  # noqa: PLC0415

        request = self.request
        check_backend(request.backend)
        plan = load_team_plan(request.file, epsilon=self.epsilon)
        told = story(
            plan,
            human=request.human,
            pace=request.pace,
            outcomes=request.outcomes,
            disturbances=request.disturbances,
            delay=self.delay,
        )
        self.display.say("executing")
        self.rehearsal = Rehearsal(
            plan,
            told,
            seed=request.seed,
            infer=request.infer,
            explain=request.explain,
            solver=request.solver,
            backend=request.backend,
            deadline=Deadline.after(self.guard.remaining(self.limit)),
        )
        try:
            return self.rehearsal.run()
        except OutOfTimeError:  # while the back end was compiling
            self.guard.cause = self.guard.cause or Cause.TIMEOUT
            raise GivenUpError from None

    def known(self) -> Record | None:
        from robust.pike_bridge.online.world import Ending  # noqa: PLC0415 - imported by then, or nothing is known

        if self.rehearsal is None or not self.rehearsal.started:
            return None
        return self.rehearsal.so_far(Ending.TIMEOUT if self.guard.cause is Cause.TIMEOUT else Ending.INTERRUPTED)

    def show(self, record: Record) -> None:
        if self.request.json:
            print_json(run_answer(record, self.request))
            return
        with answering():
            _print(console(), record, self.request)


def run_pike_run(request: PikeRunRequest, guard: Guard) -> int:
    """Execute, and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted or out of time before the first step.
    """
    picture = options.plot_file(request.plot)
    with Display(shown=request.progress, what="reading") as display:
        run = _Run(
            request,
            guard,
            display,
            epsilon=options.positive(request.epsilon, "--epsilon"),
            delay=options.not_negative(request.delay, "--delay"),
            limit=options.seconds(request.timeout, "--timeout"),
        )
        record = guarded(guard, run.limit, display, run.execute, run.known, run.show)
        if picture is not None and run.rehearsal is not None:
            from robust.report.gantt import draw_chart  # noqa: PLC0415 - imports matplotlib

            draw_chart(run_chart(run.rehearsal.plan, record), picture)
    run.show(record)
    return _CODES.get(record.ending.value, 3)


def run_answer(record: Record, request: PikeRunRequest) -> dict[str, Any]:
    """`robust/pike-run/1`."""
    return {
        "schema": SCHEMA,
        "status": record.ending.value,
        "seed": request.seed,
        "backend": request.backend,
        "time": str(record.time),
        "choices": dict(record.choices),
        "schedule": {event: str(time) for event, time in sorted(record.schedule.items(), key=lambda item: item[1])},
        "steps": [_step_answer(step) for step in record.steps],
        "conflict": [{"about": fact.kind.value, "fact": fact.text} for fact in record.conflict],
    }


def _step_answer(step: Step) -> dict[str, Any]:
    from robust.report.pike.explaining import decision_reason, step_why  # noqa: PLC0415 - imports solvers

    return {
        "time": str(step.time),
        "messages": [str(message) for message in step.messages],
        "decisions": [
            {"what": what, "text": text, **decision_reason(step, at)} for at, (what, text) in enumerate(_lines(step))
        ],
        "possible": {choice: list(values) for choice, values in step.inferred.items()},
        "seconds": round(step.seconds, 6),
        **step_why(step),
    }


def _lines(step: Step) -> Iterator[tuple[str, str]]:
    """What was decided or noticed, for people: a kind and a text."""
    from robust.pike_bridge.online import progress as said  # noqa: PLC0415

    for decision in step.decisions:
        match decision:
            case said.Executed(event, _, reported):
                yield ("event", f"{event}, reported" if reported else event)
            case said.Dispatched(action, agent, _, _, lower, upper):
                limits = f"takes {readable(lower)} to {'any time' if upper is None else readable(upper)}"
                yield ("begin", f"{f'{agent}: ' if agent else ''}{action}, {limits}")
            case said.Chosen(choice, value, _, observed):
                yield ("observed" if observed else "chosen", f"{choice} = {value}")
            case said.Violated(atom, expected, producer, consumers, _):
                yield ("broken", _broken_text(str(atom), expected, producer, consumers))
            case said.Rejected(message, reason, _):
                yield ("rejected", f"{message}: {reason}")
            case said.Failed(_, reason):
                yield ("failed", reason)
            case said.Succeeded():
                yield ("succeeded", "every activated event has been executed")


def _broken_text(atom: str, expected: bool, producer: str, consumers: tuple[str, ...]) -> str:
    state = "false" if expected else "true"
    return f"{atom} is {state} since {producer} should have made it otherwise; needed by {', '.join(consumers)}"


def _print(out: Console, record: Record, request: PikeRunRequest) -> None:
    ending = record.ending.value
    from robust.report.pike.explaining import Telling  # noqa: PLC0415 - imports solvers

    headline = Text(ending, style=_STYLES.get(ending, "yellow"))
    slowest = max((step.seconds for step in record.steps), default=0.0)
    typical = median(step.seconds for step in record.steps) if record.steps else 0.0
    headline.append(
        f" at {readable(record.time)} (seed {request.seed}); decisions took {duration(typical)} each, "
        f"{duration(slowest)} at most",
        "none",
    )
    out.print(headline, soft_wrap=True)
    if request.quiet:
        return
    telling = Telling()
    for step in record.steps:
        for at, (what, text) in enumerate(_lines(step)):
            if what != "event":
                out.print(Text(f"{readable(step.time):>10}  {what:<9} {text}"), soft_wrap=True)
                _print_lines(out, telling.of_decision(step, at))
        for choice in telling.order(step):
            values = step.inferred[choice]
            verb = "must be" if len(values) == 1 else "may still be"
            out.print(Text(f"{'':>10}  so        {choice} {verb} {' or '.join(values)}"), soft_wrap=True)
            _print_lines(out, telling.of_inference(step, choice))
    if record.conflict and not request.explain:
        out.print()
        out.print("These facts contradict each other; without any one of them a correct execution would be left:")
        for fact in record.conflict:
            out.print(Text(f"  {fact.text}"), soft_wrap=True)


def _print_lines(out: Console, lines: Iterable[str]) -> None:
    for line in lines:
        out.print(Text(f"{'':>24}{line}", style="dim"), soft_wrap=True)


def run_chart(plan: TeamPlan, record: Record) -> Chart:
    """Who did what when, with choices, inferences and violations."""
    from robust.pike_bridge.online import progress as said  # noqa: PLC0415
    from robust.report.gantt import Bar, Chart, Lane, Mark  # noqa: PLC0415 - only for pictures

    lanes: dict[str, Lane] = {}
    bars: list[Bar] = []
    marks: list[Mark] = []
    for step in record.steps:
        for decision in step.decisions:
            match decision:
                case said.Dispatched(action, agent, time, end, _, _):
                    name = agent or "no agent"
                    lanes.setdefault(name, Lane(name))
                    bars.append(Bar(name, time, record.schedule.get(end), action, "activity"))
                case said.Chosen(choice, value, time, observed):
                    lanes.setdefault("choices", Lane("choices"))
                    kind = "observed choice" if observed else "choice of the executive"
                    marks.append(Mark(time, "choices", f"{choice} = {value}", kind))
                case said.Violated(atom, _, _, _, time):
                    marks.append(Mark(time, None, f"{atom} broken", "violation"))
                case said.Failed(time, _):
                    marks.append(Mark(time, None, "failed", "failure"))
                case _:
                    pass  # events and messages are in the timeline
        for choice, values in step.inferred.items():
            if len(values) == 1:
                lanes.setdefault("choices", Lane("choices"))
                marks.append(Mark(step.time, "choices", f"{choice} must be {values[0]}", "inference"))
    return Chart(f"{plan.name}: {record.ending.value}", tuple(_sorted(lanes)), tuple(bars), tuple(marks))


def _sorted(lanes: Mapping[str, Any]) -> list[Any]:
    """Agents by name, choices last."""
    return [lanes[name] for name in sorted(lanes, key=lambda name: (name == "choices", name))]
