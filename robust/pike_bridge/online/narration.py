"""The reasons of one step of an executive, found after it was taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robust.pike_bridge.execution import Execution
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.inquiry import Inquiry
from robust.pike_bridge.online.messages import Chosen, Decision, Dispatched, Executed, Failed
from robust.pike_bridge.online.reasons import Reason
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class StepReasons:
    """Why each decision of a step was taken (None: it was reported, or speaks for itself), and each inference.

    One continuation supports all that was executed.
    """

    continuation: Execution | None = None
    decisions: tuple[Reason | None, ...] = ()
    inferences: Mapping[str, Reason] = field(default_factory=dict)


def step_reasons(
    executive: PlanExecutive,
    decisions: Sequence[Decision],
    inferred: Mapping[str, tuple[str, ...]],
    *,
    solver: str = "z3",
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
) -> StepReasons:
    """The reasons of the step that an executive has just taken.

    Args:
        executive: it has taken no step since.
        decisions: what it has decided.
        inferred: values that open choices may still have, where that has changed.
        solver: `z3` or `cvc5`.
        deadline: for all of it.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """
    inquiry = Inquiry(executive.progress, solver=solver, deadline=deadline)
    begun = _begun(decisions)
    reasons = tuple(_reason(inquiry, each, begun) for each in decisions)
    return StepReasons(inquiry.continuation, reasons, inquiry.inferred(inferred))


def _begun(decisions: Sequence[Decision]) -> Mapping[str, str]:
    """At which event each dispatched activity began, by the event at which it ends."""
    found, event = {}, ""
    for decision in decisions:
        match decision:
            case Executed(name, _, _):
                event = name
            case Dispatched():
                found[decision.end] = event
            case _:
                pass
    return found


def _reason(inquiry: Inquiry, decision: Decision, begun: Mapping[str, str]) -> Reason | None:
    match decision:
        case Dispatched():
            return inquiry.executed(begun[decision.end])
        case Chosen(choice, value, _, observed=False):
            return inquiry.chosen(Assignment(choice, value))
        case Failed():
            return inquiry.failed()
        case _:
            return None
