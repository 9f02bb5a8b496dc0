"""Continuations that are known, and all that are like them, so that what was found once is not asked again.

A solver's model is one schedule. The executions with its choices that keep its orders, of those on which conditions may
rest, are correct as well: they are the schedules of difference constraints. The least times of these say what can be
done now, and the greatest how long all can wait, without a question to a solver.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm

from robust.network.differences import UNBOUNDED, delay, following
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.semantics import Execution, holds


@dataclass(frozen=True, slots=True)
class Continuation(Execution):
    """A correct execution that agrees with what has happened; choices that do not matter may be missing from it."""

    alike: Alike = field(compare=False, repr=False)

    def retimed(self, *, late: bool = False) -> Continuation | None:
        """The one that is like it at the least times from now on; None if there is none.

        If `late`, what is not the executive's to execute is later than now.
        """
        schedule = self.alike.least(late=late)
        return None if schedule is None else Continuation(self.scenario, schedule, self.alike)

    def latest(self, events: Iterable[str]) -> Fraction | None:
        """The greatest time at which none of the events, of those that it has, need have happened in those that are
        like it; None if there is no such time.
        """
        times = (self.alike.greatest.get(event) for event in events)
        return min((time for time in times if time is not None), default=None)

    def ours(self, event: str) -> bool:
        """Whether the event is the executive's to execute in it."""
        return event not in self.alike.theirs

    def executes(self, event: str) -> bool:
        """Whether the executive executes the event now in it."""
        return self.schedule.get(event) == self.alike.progress.now and self.ours(event)

    def lasts(self) -> bool:
        """Whether it still agrees with what has happened, and what is not the executive's to execute is later than now.

        What broken links mean is not looked at.
        """
        progress = self.alike.progress
        later = progress.now + progress.plan.separation
        return (
            self.alike.agrees
            and all(self.schedule.get(event) == time for event, time in progress.times.items())
            and all(
                time >= later or (time >= progress.now and self.ours(event))
                for event, time in self.schedule.items()
                if event in progress.pending
            )
        )


class Alike:
    """The executions with the choices of one that keep its orders, whatever has happened since.

    Args:
        execution: a correct one.
        orders: pairs of events; where the first is before the second, conditions may rest on it.
    """

    def __init__(self, progress: Progress, execution: Execution, orders: Iterable[tuple[str, str]]) -> None:
        self.progress, self._scenario = progress, execution.scenario
        self._place = {name: at for at, name in enumerate(sorted(execution.schedule, key=execution.schedule.get))}  # type: ignore[arg-type]
        bounds = list(self._kept(execution, orders))
        self._scale = lcm(*(weight.denominator for *_, weight in bounds))
        scaled = [(one, other, int(weight * self._scale)) for one, other, weight in bounds]
        self._later = following(len(self._place), scaled)
        self._earlier = following(len(self._place), [(other, one, weight) for one, other, weight in scaled])
        self._theirs: tuple[int, frozenset[str]] = (-1, frozenset())
        """By the number of choices that are known."""
        self._greatest: tuple[int, Mapping[str, Fraction]] = (-1, {})
        """By the number of events that are executed."""

    def _kept(self, execution: Execution, orders: Iterable[tuple[str, str]]) -> Iterator[tuple[int, int, Fraction]]:
        """By places: how much later the second event is than the first at least."""
        place, times, separation = self._place, execution.schedule, self.progress.plan.separation
        for constraint in self.progress.plan.network.temporal_constraints:
            if holds(constraint.guard, execution.scenario):
                yield from ((place[other], place[one], -most) for one, other, most in constraint.upper_bounds)
        for earlier, later in orders:
            if earlier in times and later in times and times[later] - times[earlier] >= separation:
                yield place[earlier], place[later], separation

    @property
    def agrees(self) -> bool:
        """Whether no choice is known to be otherwise."""
        return all(self._scenario.get(name) == value for name, value in self.progress.chosen.items())

    @property
    def theirs(self) -> frozenset[str]:
        """The events that are not the executive's to execute, by what is known of choices."""
        known = len(self.progress.chosen)
        if self._theirs[0] != known:
            self._theirs = known, frozenset(e for e in self._place if self.progress.theirs(e, self._scenario))
        return self._theirs[1]

    def least(self, *, late: bool) -> dict[str, Fraction] | None:
        """The least times from now on, after what has happened, as :meth:`Continuation.retimed` says."""
        executed, now = self.progress.times, self.progress.now
        if not self.agrees or not executed.keys() <= self._place.keys():
            return None
        later = now + self.progress.plan.separation
        self._rescale((now, later, *executed.values()))
        theirs = self.theirs if late else frozenset[str]()
        given = {name: executed.get(name, later if name in theirs else now) for name in self._place}
        scale = self._scale
        least = [time.numerator * (scale // time.denominator) for time in given.values()]
        times = list(least)
        if delay(times, self._later, range(len(times))) is not None:
            return None
        moved = {name for name, before, time in zip(self._place, least, times, strict=True) if before != time}
        if not executed.keys().isdisjoint(moved):
            return None
        return given | {name: Fraction(times[self._place[name]], scale) for name in moved}

    @property
    def greatest(self) -> Mapping[str, Fraction]:
        """The greatest time of each event after what has happened, if there is one."""
        executed = self.progress.times
        if self._greatest[0] != len(executed):
            self._rescale(executed.values())
            times = [-UNBOUNDED] * len(self._place)
            for name, time in executed.items():
                times[self._place[name]] = -time.numerator * (self._scale // time.denominator)
            delay(times, self._earlier, [at for at in range(len(times) - 1, -1, -1) if times[at] > -UNBOUNDED])
            found = {
                e: Fraction(-time, self._scale)
                for e, time in zip(self._place, times, strict=True)
                if time > -UNBOUNDED // 2
            }
            self._greatest = len(executed), found
        return self._greatest[1]

    def _rescale(self, times: Iterable[Fraction]) -> None:
        """Let times be integers, too."""
        scale = lcm(self._scale, *(time.denominator for time in times))
        if scale != self._scale:
            factor, self._scale = scale // self._scale, scale
            for steps in (*self._later, *self._earlier):
                steps[:] = [(target, weight * factor, origin) for target, weight, origin in steps]
