"""`robust pike run --explain`: the reasons of decisions and inferences, below them in the timeline and in JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from robust.pike_bridge.online.inquiry import WhyChosen, WhyExecuted, WhyNot, continuation_answer

if TYPE_CHECKING:
    from robust.pike_bridge.online.inquiry import Reason
    from robust.pike_bridge.online.world import Step


def decision_reason(step: Step, at: int) -> dict[str, Any]:
    """The `why` of a decision by its place in the step; nothing if there is none."""
    reason = _of_decision(step, at)
    return {} if reason is None else {"why": _answer(reason)}


def step_why(step: Step) -> dict[str, Any]:
    """The `why` of a step: the continuation that supports it, and its inferences; nothing if it was not asked for."""
    if step.reasons is None:
        return {}
    inferences = {choice: _answer(reason) for choice, reason in step.reasons.inferences.items()}
    return {"why": {"continuation": continuation_answer(step.reasons.continuation), "inferences": inferences}}


class Telling:
    """Reasons in a timeline, none of them told twice."""

    def __init__(self) -> None:
        self._inferred: dict[str, str] = {}
        self._said: set[str] = set()

    def order(self, step: Step) -> Iterator[str]:
        """The choices that the step has narrowed, those first whose reasons others rest on."""
        return iter(step.inferred if step.reasons is None else step.reasons.inferences)

    def of_decision(self, step: Step, at: int) -> Iterator[str]:
        """The lines below a decision, by its place in the step."""
        match _of_decision(step, at):
            case WhyChosen() as reason if self._inferred.get(reason.choice) == reason.value:
                yield "; ".join(["as inferred", *self._new(reason.parts)])
            case WhyChosen() as reason:
                yield from reason.excluding
                yield from self._joined(reason.parts)
            case WhyExecuted() as reason:
                yield from self._joined(reason.parts)
            case WhyNot() as reason:
                yield from reason.lines
            case None:
                pass

    def of_inference(self, step: Step, choice: str) -> Iterator[str]:
        """The lines below an inference."""
        reason = None if step.reasons is None else step.reasons.inferences.get(choice)
        if isinstance(reason, WhyChosen):
            if reason.value is not None:
                self._inferred[choice] = reason.value
            yield from reason.excluding

    def _joined(self, parts: tuple[str, ...]) -> Iterator[str]:
        """One line, if anything is new."""
        new = "; ".join(self._new(parts))
        if new:
            yield new

    def _new(self, lines: tuple[str, ...]) -> Iterator[str]:
        for line in lines:
            if line not in self._said:
                self._said.add(line)
                yield line


def _of_decision(step: Step, at: int) -> Reason | None:
    return None if step.reasons is None else step.reasons.decisions[at]


def _answer(reason: Reason) -> dict[str, Any]:
    """Without its continuation, which is that of the step."""
    return {key: value for key, value in reason.as_dict().items() if key != "continuation"}
