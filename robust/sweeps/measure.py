"""Whole processes of `robust`, as a user runs them, and the boxes that they answer as exact text."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

from robust.numbers import parse_end
from robust.processes import Ended, Processes
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline

COMMAND = (sys.executable, "-m", "robust")
"""The command line of this package, as found by this interpreter."""

Ends = tuple[str, str]
"""An interval as exact text: `1/3`, `7/4 (open)`, `-inf`; equal ends have equal texts."""
OPEN = " (open)"
"""What such a text ends in where the interval has not its end."""


def measured(command: Sequence[str], *, limit: float | None = None, processes: Processes | None = None) -> Ended:
    """Run a process to the end, or to the limit in seconds; it ends with this one, and when this one is interrupted.

    Raises:
        StoppedError: if `processes` are stopped.
    """
    return (processes or Processes()).run(command, Deadline.after(limit))


def complaint(found: Ended) -> str:
    """The last line on stderr, or what is known without one."""
    lines = [line.strip() for line in found.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {found.exit_code} without a message"


def ends_of(interval: Interval) -> Ends:
    """The interval as text."""
    lower = "-inf" if interval.lower is None else str(interval.lower) + ("" if interval.lower_closed else OPEN)
    upper = "inf" if interval.upper is None else str(interval.upper) + ("" if interval.upper_closed else OPEN)
    return lower, upper


def box_of(texts: Mapping[str, Ends]) -> Box:
    """The box of such texts."""

    def interval(lower: str, upper: str) -> Interval:
        closed = {"lower_closed": not lower.endswith(OPEN), "upper_closed": not upper.endswith(OPEN)}
        return Interval(parse_end(lower.removesuffix(OPEN)), parse_end(upper.removesuffix(OPEN)), **closed)

    return Box({name: interval(*ends) for name, ends in texts.items()})
