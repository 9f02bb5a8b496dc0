"""Incremental Rectangular-Robustification [IRR §4, Algorithm 1].

Two schedules of the same algorithm:

* the default follows Algorithm 1 with Δ ≥ β/2 in lines 6 and 7, which gives the promised gap: no face of the final box
  can move outwards by β;
* `doubling` is the schedule of the recorded runs: a successful step doubles Δ until it is halved for the first time,
  and the run ends as soon as every Δ < β, so faces can be up to 2β away.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle
from typing import Unpack

from robust.errors import InputError, did_you_mean
from robust.irr.check import require_some_schedule
from robust.irr.containment import Containment, Margins
from robust.irr.search import BoxSearch, Conduct, OutsideError
from robust.plan.model import Parameter
from robust.qe.box import Box, Face, Side

log = logging.getLogger(__name__)

STREAK = 8
"""Successes in a row in one direction after which a query asks whether it is bounded at all."""


@dataclass(slots=True)
class _Turn:
    """The state of one parameter: Δ, the sides not yet at their limit, and those of them still to be tried (Θ).

    `limits` are the declared bounds.
    """

    parameter: Parameter
    limits: Mapping[Side, Fraction | None]
    delta: Fraction
    available: list[Side]
    untried: list[Side]
    halved: bool = False
    streak: int = 0
    """Successes in a row in the direction tried last."""


class IncrementalRobustification(BoxSearch):
    """One run of IRR.

    Args:
        containment: decides boxes.
        beta: the precision β > 0, in the parameters' units.
        doubling: use the schedule of the recorded runs.
        order: the turn order of the parameters; names left out follow in the plan's order.
        conduct: see :class:`Conduct`; `on_step` is called after each check, also the failed ones.

    Raises:
        InputError: if `order` names unknown or repeated parameters.
    """

    def __init__(
        self,
        containment: Containment,
        *,
        beta: Fraction = Fraction(1),
        doubling: bool = False,
        order: Sequence[str] = (),
        **conduct: Unpack[Conduct],
    ) -> None:
        super().__init__(containment, method="irr", **conduct)
        self.beta = self._precision = beta
        self._containment = containment
        self.doubling = doubling
        self._failures: dict[Face, Fraction | None] = {}
        """Where each face was tried last, and could not be."""
        self._parameters = ordered(self.encoding.plan.parameters, order)

    @property
    def checks(self) -> int:
        return len(self._trace)

    # -- Algorithm 1 ---------------------------------------------------------------------------------------------

    def _search(self) -> None:
        refutation = self._containment.refute(self.box, self.deadline)
        if refutation is not None:
            if refutation.facet is not None:
                require_some_schedule(self.encoding, self._containment.open_session(), self.deadline)
            raise OutsideError(refutation.reason, refutation.values)
        self.verified = True
        turns = [self._first_turn(parameter) for parameter in self._parameters]
        least = self._precision / 2
        # The recorded runs try parameters down to β/2 as well, but end as soon as every Δ is below β.
        enough = self._precision if self.doubling else least
        for turn in cycle(turns):
            if not any(other.available and other.delta >= enough for other in turns):
                return
            if turn.available and turn.delta >= least:
                self._attempt(turn)

    def _margins(self) -> Margins:
        """The last attempt of every side that can end has failed; failures of longer steps say nothing of ends."""
        margins = {}
        for (name, side), tried in self._failures.items():
            end = self.box[name].end(side)
            if end is not None and tried is not None:
                margins[name, side] = abs(tried - end)
        return margins

    def _first_turn(self, parameter: Parameter) -> _Turn:
        """Lines 4 and 5; the default schedule has nothing to try where the nominal value is at a declared bound."""
        limits = {Side.UPPER: parameter.upper, Side.LOWER: parameter.lower}
        if self.doubling:
            sides, delta = list(limits), max(parameter.nominal, Fraction(1)) * parameter.weight
        else:
            sides = [side for side, limit in limits.items() if limit != parameter.nominal]
            delta = max(parameter.nominal * parameter.weight, self._precision)
        return _Turn(parameter, limits, delta, sides, list(sides))

    def _attempt(self, turn: _Turn) -> None:
        """Lines 7 to 16 for one parameter: try one side, keep the wider box or note the failure."""
        name, side = turn.parameter.name, turn.untried[0]
        candidate = self._grown(turn, side)
        refutation = self._containment.refute(candidate, self.deadline)
        accepted = refutation is None
        if refutation is None:
            self._accept(candidate)
            self._note_success(turn, side)
        else:
            self._failures[name, side] = candidate[name].end(side)
        number = self.checks + 1
        self._record(number, accepted=accepted, face=(name, side), delta=turn.delta)
        log.info("check %d: %s %s %s", number, name, side.value, "grown" if accepted else "blocked")
        if accepted:
            self._look_for_the_limit(turn, side)
        else:
            turn.streak = 0
            turn.untried.remove(side)
            self._reopen_if_exhausted(turn)

    def _grown(self, turn: _Turn, side: Side) -> Box:
        """Line 10; the default schedule steps exactly onto a declared bound instead of over it."""
        name, limit = turn.parameter.name, turn.limits[side]
        end = self.box[name].end(side)
        if end is None:
            raise ValueError("a side that is unbounded is not tried again")
        moved = end + side.sign * turn.delta
        if limit is not None and not self.doubling and side.sign * moved > side.sign * limit:
            moved = limit
        return self.box.moved((name, side), moved)

    def _note_success(self, turn: _Turn, side: Side) -> None:
        turn.streak += 1
        if self.doubling:
            if not turn.halved:
                turn.delta *= 2
            return
        # Take turns between the sides as well.
        turn.untried.append(turn.untried.pop(0))
        if self.box[turn.parameter.name].end(side) == turn.limits[side]:
            self._close(turn, side)

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
        candidate = self.box.moved((turn.parameter.name, side), turn.limits[side])
        self.unbounded_checks += 1
        if self._containment.contains(candidate, self.deadline):
            self._accept(candidate)
            self._close(turn, side)


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
