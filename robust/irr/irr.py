"""Incremental Rectangular-Robustification [IRR §4, Algorithm 1].

Two schedules of the same algorithm:

* the default follows Algorithm 1 with Δ ≥ β/2 in lines 6 and 7, which gives the promised gap: no face of the final box
  can move outwards by β;
* `doubling` is the schedule of the recorded runs: a successful step doubles Δ until it is halved for the first time,
  and the run ends as soon as every Δ < β, so faces can be up to 2β away.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle

from robust.errors import InputError, did_you_mean
from robust.irr.box import Box, EnvelopeResult, Interval, Side, Status, Step
from robust.irr.containment import Containment, Refutation, require_some_schedule
from robust.plan.model import Parameter
from robust.smt.limits import Deadline, OutOfTimeError

log = logging.getLogger(__name__)

_SIDES = (Side.UPPER, Side.LOWER)

STREAK = 8
"""After so many successes in a row in one direction, ask whether it is bounded at all."""


@dataclass(slots=True)
class _Turn:
    """The state of one parameter: Δ, the sides not yet at their limit, and those of them still to be tried (Θ)."""

    parameter: Parameter
    delta: Fraction
    available: list[Side]
    untried: list[Side]
    halved: bool = False
    streak: int = 0
    """Successes in a row in the direction tried last."""


class IncrementalRobustification:
    """One run of IRR.

    Args:
        containment: decides boxes.
        beta: the precision β > 0, in the parameters' units.
        doubling: use the schedule of the recorded runs.
        order: the turn order of the parameters; names left out follow in the plan's order.
        deadline: when to stop with the best box so far.
        on_step: called after each check, also the failed ones.

    Raises:
        InputError: if β is not positive or `order` names unknown or repeated parameters.
    """

    def __init__(
        self,
        containment: Containment,
        *,
        beta: Fraction = Fraction(1),
        doubling: bool = False,
        order: Sequence[str] = (),
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
        on_step: Callable[[Step], None] | None = None,
    ) -> None:
        if beta <= 0:
            raise InputError(f"beta is {beta}; expected a positive number")
        self._containment = containment
        self._parameters = ordered(containment.encoding.plan.parameters, order)
        self._beta = beta
        self._doubling = doubling
        self._deadline = deadline
        self._on_step = on_step
        self._started = time.perf_counter()
        self._box = Box.nominal(containment.encoding.plan.parameters)
        self._trace: list[Step] = []
        self._unbounded_checks = 0
        self._first_widening: float | None = None
        self._verified = False

    def run(self) -> EnvelopeResult:
        """Search until done, out of time or interrupted by Ctrl-C; a `verified` box is inside the envelope.

        Raises:
            InputError: if the network has no schedule, whatever the parameter values.
        """
        try:
            refutation = self._containment.refute(self._box, self._deadline)
            if refutation is not None:
                if refutation.facet is not None:
                    session = self._containment.open_session()
                    require_some_schedule(self._containment.encoding, session, self._deadline)
                return self._result(Status.INVALID, refutation)
            self._verified = True
            self._search()
        except OutOfTimeError:
            return self._result(Status.TIMEOUT)
        except KeyboardInterrupt:
            return self._result(Status.INTERRUPTED)
        return self._result(Status.COMPLETE)

    # -- Algorithm 1 ---------------------------------------------------------------------------------------------

    def _search(self) -> None:
        turns = [self._first_turn(parameter) for parameter in self._parameters]
        least = self._beta / 2
        # The recorded runs try parameters down to β/2 as well, but end as soon as every Δ is below β.
        enough = self._beta if self._doubling else least
        for turn in cycle(turns):
            if not any(other.available and other.delta >= enough for other in turns):
                return
            if turn.available and turn.delta >= least:
                self._attempt(turn)

    def _first_turn(self, parameter: Parameter) -> _Turn:
        """Lines 4 and 5; the default schedule has nothing to try where the nominal value is at a declared bound."""
        sides = [side for side in _SIDES if self._doubling or _declared(parameter, side) != parameter.nominal]
        return _Turn(parameter, self._first_delta(parameter), sides, list(sides))

    def _first_delta(self, parameter: Parameter) -> Fraction:
        """Line 4."""
        if self._doubling:
            return max(parameter.nominal, Fraction(1)) * parameter.weight
        return max(parameter.nominal * parameter.weight, self._beta)

    def _attempt(self, turn: _Turn) -> None:
        """Lines 7 to 16 for one parameter: try one side, keep the wider box or note the failure."""
        side = turn.untried[0]
        candidate = self._grown(turn, side)
        accepted = self._is_inside(candidate)
        if accepted:
            self._box = candidate
            self._note_success(turn, side)
        self._record(turn, side, accepted)
        if accepted:
            self._look_for_the_limit(turn, side)
        else:
            self._note_failure(turn, side)

    def _grown(self, turn: _Turn, side: Side) -> Box:
        """Line 10; the default schedule steps exactly onto a declared bound instead of over it."""
        limit = None if self._doubling else _declared(turn.parameter, side)
        interval = self._box[turn.parameter.name]
        end = _end(interval, side)
        step = turn.delta if side is Side.UPPER else -turn.delta
        moved = end + step
        if limit is not None:
            moved = min(moved, limit) if side is Side.UPPER else max(moved, limit)
        return self._box.replace(turn.parameter.name, _with_end(interval, side, moved))

    def _note_success(self, turn: _Turn, side: Side) -> None:
        turn.streak += 1
        if self._first_widening is None:
            self._first_widening = time.perf_counter() - self._started
        if self._doubling:
            if not turn.halved:
                turn.delta *= 2
        else:
            # Take turns between the sides as well.
            turn.untried.append(turn.untried.pop(0))
        if not self._doubling and _end(self._box[turn.parameter.name], side) == _declared(turn.parameter, side):
            self._close(turn, side)

    def _note_failure(self, turn: _Turn, side: Side) -> None:
        turn.streak = 0
        turn.untried.remove(side)
        self._reopen_if_exhausted(turn)

    def _close(self, turn: _Turn, side: Side) -> None:
        """The side is at its limit for good."""
        turn.streak = 0
        turn.available.remove(side)
        turn.untried.remove(side)
        if turn.available:
            self._reopen_if_exhausted(turn)

    def _reopen_if_exhausted(self, turn: _Turn) -> None:
        """Lines 15 and 16."""
        if not turn.untried:
            turn.delta /= 2
            turn.halved = True
            turn.untried = list(turn.available)

    def _look_for_the_limit(self, turn: _Turn, side: Side) -> None:
        """Guarantee termination where the envelope is unbounded: one query settles a direction that keeps growing."""
        if turn.streak == 0 or turn.streak % STREAK or side not in turn.available:
            return
        interval = self._box[turn.parameter.name]
        candidate = self._box.replace(turn.parameter.name, _with_end(interval, side, _declared(turn.parameter, side)))
        self._unbounded_checks += 1
        if self._is_inside(candidate):
            self._box = candidate
            self._close(turn, side)

    def _is_inside(self, box: Box) -> bool:
        return self._containment.refute(box, self._deadline) is None

    # -- reporting -----------------------------------------------------------------------------------------------

    def _record(self, turn: _Turn, side: Side, accepted: bool) -> None:
        seconds = time.perf_counter() - self._started
        name = turn.parameter.name
        step = Step(len(self._trace) + 1, seconds, name, side, turn.delta, accepted, self._box)
        self._trace.append(step)
        log.info("check %d: %s %s %s", step.check, name, side.value, "grown" if accepted else "blocked")
        if self._on_step is not None:
            self._on_step(step)

    def _result(self, status: Status, refutation: Refutation | None = None) -> EnvelopeResult:
        return EnvelopeResult(
            status=status,
            method="irr",
            encoding=self._containment.encoding.name,
            solver=self._containment.solver,
            beta=self._beta,
            parameters=self._containment.encoding.plan.parameters,
            box=self._box,
            checks=len(self._trace),
            unbounded_checks=self._unbounded_checks,
            first_widening_seconds=self._first_widening,
            seconds=time.perf_counter() - self._started,
            verified=self._verified,
            trace=tuple(self._trace),
            reason=refutation.reason if refutation else None,
            values=refutation.values if refutation else {},
            statistics=self._containment.statistics,
        )


def ordered(parameters: Sequence[Parameter], order: Sequence[str]) -> list[Parameter]:
    """The parameters in an order; names left out follow in the plan's order.

    Raises:
        InputError: if the order names unknown or repeated parameters.
    """
    known = {parameter.name: parameter for parameter in parameters}
    for name in order:
        if name not in known:
            raise InputError(f"the order names unknown parameter {name!r}{did_you_mean(name, known)}")
        if order.count(name) > 1:
            raise InputError(f"the order names parameter {name!r} more than once; expected each at most once")
    return [*(known[name] for name in order), *(known[name] for name in known if name not in order)]


def _declared(parameter: Parameter, side: Side) -> Fraction | None:
    return parameter.upper if side is Side.UPPER else parameter.lower


def _end(interval: Interval, side: Side) -> Fraction:
    end = interval.upper if side is Side.UPPER else interval.lower
    if end is None:
        raise ValueError("a side that is unbounded is not tried again")
    return end


def _with_end(interval: Interval, side: Side, end: Fraction | None) -> Interval:
    return Interval(interval.lower, end) if side is Side.UPPER else Interval(end, interval.upper)


def accepted_boxes(result: EnvelopeResult) -> Iterator[Box]:
    """Every box that a run accepted, in order."""
    return (step.box for step in result.trace if step.accepted)
