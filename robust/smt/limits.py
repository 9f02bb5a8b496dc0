"""Time limits that are shared by everything that a computation starts."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Deadline:
    """A moment on the monotonic clock, or never; whoever works towards it asks `remaining` before each query."""

    moment: float | None = None

    @staticmethod
    def after(seconds: float | None) -> Deadline:
        """The moment `seconds` from now; None is never."""
        return Deadline(None if seconds is None else time.monotonic() + seconds)

    @property
    def remaining(self) -> float | None:
        """Seconds left, at least zero; None without a limit."""
        return None if self.moment is None else max(0.0, self.moment - time.monotonic())

    @property
    def passed(self) -> bool:
        return self.moment is not None and time.monotonic() >= self.moment
