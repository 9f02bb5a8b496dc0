"""What `--json` prints of converted plans, executions and certificates, as in :mod:`robust.show.documents`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from msgspec import UNSET, Meta, UnsetType

from robust.codec import Count, JsonObject, Rational, Seconds, about, one_of
from robust.show.documents import (
    Broken,
    Document,
    Ended,
    Ends,
    Rationals,
    Solver,
    box_of,
    broken,
    document,
    exact,
    or_none,
)

if TYPE_CHECKING:
    from robust.execute.convert import Conversion
    from robust.execute.replan import Run, Segment
    from robust.options import ConvertCommand, ExecuteCommand
    from robust.plan.simulate import Violation

# -- convert and execute -----------------------------------------------------------------------------------------------


class Tightened(JsonObject):
    source: str
    target: str
    lower: Annotated[Rational, about("target - source is at least this")]
    own: Annotated[Rational, about("the distance in the time-triggered plan, from the earlier of the two points")]
    obligation: Annotated[str, about("broke without a bound")]


class Files(JsonObject):
    plan: str | UnsetType = UNSET
    parameters: str | UnsetType = UNSET


class Convert(JsonObject, tag_field="schema", tag="robust/convert/1"):
    """robust convert --json: a time-triggered plan with a temporal network"""

    verdict: Annotated[
        str,
        one_of("proved", "refuted", "unknown", "invalid"),
        about(
            "about all schedules of the network at nominal values, always proved in mode causal; invalid: the "
            "time-triggered plan itself breaks obligations"
        ),
    ]
    mode: Annotated[str, one_of("causal", "esterel")]
    solver: Solver
    epsilon: Rational
    stn: Annotated[str | None, about("the plan as text; null if the time-triggered plan is invalid")]
    parameters: Annotated[list[str], about("names of all parameters")]
    parameter_file: Annotated[
        str | None, about("TOML with the parameters that the plan cannot hold by itself, for --parameters")
    ]
    files: Files
    schedule: Annotated[Rationals, about("times of the time-triggered plan by time point")]
    instances: Count
    constraints: Count
    redundant: Annotated[Count, about("edges left out because others imply them")]
    obligations: Count
    tightened: Annotated[list[Tightened], about("bounds needed beyond what keeps atoms true")]
    violations: Annotated[list[Broken], about("what the time-triggered plan breaks")]


def convert(
    options: ConvertCommand,
    found: Conversion | None,
    stn: str | None,
    parameter_file: str | None,
    written: Mapping[str, str],
    *,
    violations: Sequence[Violation] = (),
) -> Document:
    """`found` is None if the time-triggered plan is invalid."""
    return document(
        Convert(
            verdict="invalid" if found is None else found.check.answer.value,
            mode=options.mode,
            solver=options.solver,
            epsilon=str(options.separation),
            stn=stn,
            parameters=[] if found is None else [one.name for one in found.plan.parameters],
            parameter_file=parameter_file,
            files=Files(**written),
            schedule={} if found is None else exact(found.schedule),
            instances=0 if found is None else len(found.stn.instances),
            constraints=0 if found is None else len(found.stn.constraints),
            redundant=0 if found is None else found.redundant,
            obligations=0 if found is None else len(found.check.obligations),
            tightened=[
                Tightened(
                    source=str(one.edge.source),
                    target=str(one.edge.target),
                    lower=str(one.edge.weight),
                    own=str(one.own),
                    obligation=one.obligation,
                )
                for one in (() if found is None else found.tightened)
            ],
            violations=broken(violations),
        )
    )


class ExecutedAction(JsonObject):
    instance: str
    action: str
    start: Rational
    end: Annotated[Rational | None, about("null if it was still running")]
    outcome: Annotated[str, one_of("done", "failed", "stopped", "running")]


class Seen(JsonObject):
    time: Rational
    what: Annotated[str, about("a parameter, or a duration that was not as planned")]
    value: Rational
    inside: bool


class Rejected(JsonObject):
    time: Rational
    reason: str


class ExecutedPlan(JsonObject):
    start: Annotated[Rational, about("when the plan began, from the beginning of the run")]
    end: Rational
    guarantee: Annotated[
        str,
        one_of("dynamic", "weak", "none"),
        about(
            "dynamic: the plan succeeds while observations are inside the box; weak: a schedule that succeeds exists, "
            "but no strategy is certain to find it; none: nothing was proved"
        ),
    ]
    box: dict[str, Ends]
    executed: list[ExecutedAction]
    observations: list[Seen]
    rejected: Annotated[list[Rejected], about("messages that changed nothing")]
    given_up: Annotated[Rational | None, about("when the plan was given up; null if it was carried out")]
    reason: Annotated[str | None, about("why it was given up")]
    planner_seconds: Seconds
    preparation_seconds: Seconds


class ExecutedRun(JsonObject):
    seed: int | str
    status: Annotated[str, one_of("succeeded", "failed")]
    reason: Annotated[str, about("why it failed; empty if it succeeded")]
    replans: Count
    inside: Annotated[bool, about("whether all observations were inside the boxes")]
    end: Rational
    seconds: Seconds
    plans: list[ExecutedPlan]


class Summary(JsonObject):
    """the figures of Tables 1 and 2 of the paper"""

    runs: Count
    succeeded: Count
    coverage: Annotated[float, Meta(ge=0, le=1)] | None
    average_replans: Annotated[Annotated[float, Meta(ge=0)] | None, about("of the runs that succeeded")]
    inside: Annotated[Count, about("runs in which all observations were inside the boxes")]


def summary(runs: Sequence[Run]) -> Summary:
    """Coverage, and the average number of re-plans of successful runs."""
    succeeded = [run for run in runs if run.status.value == "succeeded"]
    return Summary(
        runs=len(runs),
        succeeded=len(succeeded),
        coverage=len(succeeded) / len(runs) if runs else None,
        average_replans=sum(run.replans for run in succeeded) / len(succeeded) if succeeded else None,
        inside=sum(1 for run in runs if run.inside),
    )


class Execute(JsonObject, tag_field="schema", tag="robust/execute/1"):
    """robust execute --json: simulated executions with re-planning"""

    status: Annotated[Ended, about("whether all runs were made")]
    executor: str
    planner: str | None
    plan: str | None
    world: str | None
    epsilon: Rational
    summary: Summary
    runs: list[ExecutedRun]


def execute(options: ExecuteCommand, runs: Sequence[Run], status: str) -> Document:
    return document(
        Execute(
            status=status,
            executor=options.executor,
            planner=options.planner,
            plan=or_none(options.plan),
            world=or_none(options.world),
            epsilon=str(options.separation),
            summary=summary(runs),
            runs=[
                ExecutedRun(
                    seed=run.seed,
                    status=run.status.value,
                    reason=run.reason,
                    replans=run.replans,
                    inside=run.inside,
                    end=str(run.end),
                    seconds=round(run.seconds, 6),
                    plans=[_executed(segment) for segment in run.segments],
                )
                for run in runs
            ],
        )
    )


def _executed(segment: Segment) -> ExecutedPlan:
    return ExecutedPlan(
        start=str(segment.start),
        end=str(segment.end),
        guarantee=segment.guarantee.value,
        box=box_of(segment.box),
        executed=[
            ExecutedAction(
                instance=one.instance.identifier,
                action=str(one.instance),
                start=str(one.start),
                end=or_none(one.end),
                outcome=one.outcome.value,
            )
            for one in segment.executed
        ],
        observations=[
            Seen(time=str(one.time), what=one.what, value=str(one.value), inside=one.inside)
            for one in segment.observations
        ],
        rejected=[Rejected(time=str(one.time), reason=one.reason) for one in segment.rejected],
        given_up=or_none(segment.given_up),
        reason=or_none(segment.ending),
        planner_seconds=round(segment.planner_seconds, 6),
        preparation_seconds=round(segment.preparation_seconds, 6),
    )


# -- certify and verify ------------------------------------------------------------------------------------------------


class Certify(JsonObject, tag_field="schema", tag="robust/certify/1"):
    """robust certify --json: a certificate that has been written and checked."""

    kind: Annotated[str, one_of("plan", "box", "maximal", "region", "knowledge")]
    certificate: str
    bytes: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    checking_s: Seconds
    established: list[str]
    trusted: list[str]
    alethe_holes: Count | None


class Verify(JsonObject, tag_field="schema", tag="robust/verify/1"):
    """robust verify --json: what a certificate establishes."""

    verdict: Annotated[str, one_of("established", "rejected")]
    established: list[str]
    trusted: list[str]
    matched: bool
    reason: str | None
    seconds: Seconds


DOCUMENTS: tuple[type[JsonObject], ...] = (Convert, Execute, Certify, Verify)
"""As in :mod:`robust.show.documents`."""
