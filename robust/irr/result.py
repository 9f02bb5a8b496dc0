"""What a search for a box returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from robust.irr.box import Box
from robust.plan.model import Parameter
from robust.smt.statistics import Statistics


class Status(Enum):
    """How a search ended."""

    COMPLETE = "complete"
    TIMEOUT = "timeout"
    INTERRUPTED = "interrupted"
    INVALID = "invalid"


class Side(Enum):
    """A face of a box: the least or the greatest value of a parameter."""

    LOWER = "lower"
    UPPER = "upper"


@dataclass(frozen=True, slots=True)
class Step:
    """One containment check of a search: its number, seconds since the start, what was tried and what came of it.

    Searches that move all faces at once have no single `parameter`, `side` and `delta`.
    """

    check: int
    seconds: float
    parameter: str | None
    side: Side | None
    delta: Fraction | None
    accepted: bool
    box: Box
    """The best box after the step."""


@dataclass(frozen=True)
class EnvelopeResult:
    """A decoupled robustness envelope and how it was found.

    `reason` and `values` explain INVALID: what breaks at the nominal point, with which parameter values. `checks`
    counts the rectangles tried as in [IRR §5]; queries about unbounded directions are in `unbounded_checks`. `verified`
    is False if not even the nominal point is known to be inside: INVALID, or stopped before that was decided.
    """

    status: Status
    method: str
    encoding: str
    solver: str
    beta: Fraction | None
    parameters: tuple[Parameter, ...]
    box: Box
    checks: int
    unbounded_checks: int
    first_widening_seconds: float | None
    seconds: float
    verified: bool = True
    trace: tuple[Step, ...] = ()
    reason: str | None = None
    values: Mapping[str, Fraction] = field(default_factory=dict)
    bound: Fraction | None = None
    statistics: Statistics = field(default_factory=Statistics)

    def convergence(self) -> tuple[tuple[int, Fraction], ...]:
        """[IRR §5, Convergence]: after each check, Σ(u − l) as a share of the final one, between 0 and 1.

        Empty if a side is infinite or the final box is a point.
        """
        final = self.box.total_width
        if not final:
            return ()
        widths = ((step.check, step.box.total_width) for step in self.trace)
        return tuple((check, width / final) for check, width in widths if width is not None)
