"""What is known of a run afterwards. Times are from the beginning of the run, in the plan's unit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from robust.execute.dispatch.messages import Ending, LeftBox, Observation, Rejected
from robust.execute.dispatch.network import Guarantee
from robust.execute.worlds.world import Executed
from robust.irr.box import Box
from robust.plan.model import ParametrizedPlan


class RunStatus(Enum):
    """How a run ended."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"


@dataclass(frozen=True)
class Segment:
    """The execution of one plan, from `start` to `end`.

    `ending` is why it was given up at `given_up`; None if it was carried out. `executed` are its instances in the order
    of their starts, with times from the beginning of the run.
    """

    plan: ParametrizedPlan
    box: Box
    guarantee: Guarantee
    start: Fraction
    end: Fraction
    executed: tuple[Executed, ...]
    observations: tuple[Observation, ...]
    rejected: tuple[Rejected, ...]
    ending: Ending | None
    given_up: Fraction | None
    planner_seconds: float = 0.0
    preparation_seconds: float = 0.0


@dataclass(frozen=True)
class Run:
    """One run. `reason` says in one line why it failed.

    `inside` says whether every observation was inside its box. `seconds` is wall time.
    """

    status: RunStatus
    reason: str
    segments: tuple[Segment, ...]
    seconds: float
    seed: int | str

    @property
    def replans(self) -> int:
        """How often another plan was begun."""
        return max(0, len(self.segments) - 1)

    @property
    def inside(self) -> bool:
        return not any(isinstance(segment.ending, LeftBox) for segment in self.segments)

    @property
    def end(self) -> Fraction:
        """When the run ended."""
        return self.segments[-1].end if self.segments else Fraction(0)
