"""The probability that a plan that runs succeeds in the order that it follows, by what is known: certified bounds.

Durations are independent of each other, and those that run are known to have lasted for a while. Where the rest of the
plan is a network of least distances, durations and deadlines, the laws of its longest paths bound the probability that
all of them are in time (:mod:`robust.probability.lateness`): from above for whoever knows all durations beforehand,
from below for an executor that starts each step as soon as all that it waits for has happened. What is promised is
kept with a probability that is a lower bound, too, wherever there is a promise.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor

from robust.execute.forecast import Forecaster, PathForecaster, PlanForecast, Prospect, Window
from robust.execute.messages import StepProgress
from robust.network.slack import OutsideFragmentError
from robust.probability.distributions import UNIT, Distribution, Enclosure
from robust.probability.lateness import LatenessGraph, PathEdge, graph_of
from robust.probability.lattice import Node
from robust.probability.measure import Bounds, interval_probability
from robust.probability.random_durations import RandomDuration
from robust.probability.success import GivenDurations
from robust.qe.box import Interval
from robust.smt.limits import Deadline, OutOfTimeError

PLACES = 10**6
"""Bounds are rounded outwards to multiples of one part of this."""
WITHIN = 1e-2
"""How close bounds are to be."""
WORK = 400_000
"""How many places of laws are computed for a bound, at most."""
UNKNOWN = Bounds(Fraction(0), Fraction(1))


@dataclass(frozen=True)
class RunChances:
    """Bounds of the probability of success at a moment.

    Args:
        distributions: those of durations, by step; of the others nothing is known.
        progress: how far each step is.
        now: nothing that is not known happened before.
    """

    distributions: Mapping[str, Distribution]
    progress: Mapping[str, StepProgress]
    now: Fraction

    def bounds(self, forecaster: Forecaster, forecast: PlanForecast, deadline: Deadline) -> Bounds | None:
        """What is certified by the deadline; None if nothing is."""
        if forecast.prospect is Prospect.BROKEN:
            return Bounds(Fraction(0), Fraction(0))
        known = UNKNOWN
        if isinstance(forecaster, PathForecaster):
            known = self.by_paths(forecaster, deadline)
        if forecast.promise is not None:
            known = known.within(Bounds(self._promised(forecast.promise), Fraction(1)))
        elif forecast.prospect is Prospect.ON_TRACK and known == UNKNOWN:
            return None
        return Bounds(Fraction(floor(known.lower * PLACES), PLACES), Fraction(ceil(known.upper * PLACES), PLACES))

    def lasted(self, step: str) -> Interval:
        """What is known of the duration of a step that has not ended."""
        start = self.progress[step].start
        return Interval(None if start is None else max(Fraction(0), self.now - start), None)

    def _promised(self, promise: Mapping[str, Window]) -> Fraction:
        """The least probability that all steps take as long as is promised, given how long they have run."""
        kept = Fraction(1)
        for step, lengths in promise.items():
            if step not in self.distributions:
                return Fraction(0)
            inside = interval_probability(Interval(*lengths), self.distributions[step])[0]
            known = interval_probability(self.lasted(step), self.distributions[step])[1]
            kept *= Fraction(inside, known) if known else 0
        return kept

    def by_paths(self, forecaster: PathForecaster, deadline: Deadline) -> Bounds:
        """What the laws of longest paths certify by the deadline."""
        rest = _Rest(forecaster, self)
        for exact in (True, False) if rest.is_random else (False,):
            with suppress(OutsideFragmentError):
                return rest.bounds(rest.graph(exact=exact), deadline, exact=exact)
        return UNKNOWN


class _Rest:
    """What is demanded of the rest of a plan, in time from the first moment on that still counts: zero."""

    def __init__(self, forecaster: PathForecaster, chances: RunChances) -> None:
        known, demands = chances.distributions, list(forecaster.demands())
        begun = (distance for source, _, distance, step in demands if step is not None and not source)
        zero = min((chances.now, *begun))
        self.links: dict[Node, tuple[Node, Fraction, str]] = {}
        self.durations: dict[str, Distribution] = {}
        self.intervals: dict[str, Interval] = {}
        self.lasted: list[Enclosure] = []
        self.is_random = True
        """Whether all durations have distributions."""
        self._distances: list[PathEdge] = []
        self._due: dict[Node, tuple[Fraction, str]] = {}
        for source, target, distance, step in demands:
            length = distance + (0 if target else zero) - (0 if source else zero)
            if step is None:
                self._demand(source, target, length)
                continue
            lasted, (least, most) = chances.lasted(step), forecaster.lengths(step)
            if step not in known:
                self.is_random = False
                self._demand(source, target, length + least)
                continue
            self.links[target] = source, length, step
            self.durations[step] = known[step].settled
            self.intervals[step] = Interval(max(least, lasted.lower or least), most)
            self.lasted.append(interval_probability(lasted, known[step]))

    def _demand(self, source: int, target: int, length: Fraction) -> None:
        """Demand a distance: of a duration, of a point by a deadline, or between two points."""
        start, offset, step = self.links.get(target, (None, Fraction(0), ""))
        back = self.links.get(source, (None, Fraction(0), ""))
        if start == source:
            ends = self.intervals[step]
            self.intervals[step] = Interval(max(ends.lower or Fraction(0), length - offset), ends.upper)
        elif target and back[0] == target:
            ends = self.intervals[back[2]]
            most = -length - back[1]
            self.intervals[back[2]] = Interval(ends.lower, most if ends.upper is None else min(ends.upper, most))
        elif not target:
            if source not in self._due or -length < self._due[source][0]:
                self._due[source] = -length, ""
        elif source or length >= 0:
            self._distances.append(PathEdge(source, target, length))

    def graph(self, *, exact: bool) -> LatenessGraph:
        """The graph; one of which it is known that nothing else is demanded, if `exact`.

        Raises:
            OutsideFragmentError: if there is none.
        """
        if any(ends.upper is not None and ends.upper < (ends.lower or 0) for ends in self.intervals.values()):
            raise OutsideFragmentError("some duration cannot be as it has to be")
        durations = {step: RandomDuration(step, known, self.intervals[step]) for step, known in self.durations.items()}
        limits = [edge for edge in self._distances if edge.constant < 0]
        distances = [edge for edge in self._distances if edge.constant >= 0]
        graph = graph_of(distances, limits if exact else (), self.links, self._due, durations)
        if graph.latest <= 0 or (exact and any(not wait.target for wait in graph.waiting)):
            raise OutsideFragmentError("what runs has to wait for something else at its end")
        return graph

    def bounds(self, graph: LatenessGraph, deadline: Deadline, *, exact: bool) -> Bounds:
        """Bounds of the probability that durations are in time, given how long they have lasted."""
        given = GivenDurations(self.durations, self.intervals, graph)
        with suppress(OutOfTimeError):
            for is_policy in (True, False) if exact else (False,):
                given.run(lambda: None, is_policy, WITHIN, deadline, work=WORK)
        lower = given.bounds(is_policy=True)[0] if exact else Fraction(0)
        upper = given.bounds(is_policy=False)[1]
        for least, most in self.lasted:
            lower = lower * UNIT / most if most else Fraction(0)
            upper = upper * UNIT / least if least else Fraction(1)
        return Bounds(min(lower, Fraction(1)), min(upper, Fraction(1)))
