"""The searches for a box behind one interface: what each needs, and how its outcome becomes a result."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from robust.encode.interface import Encoding
from robust.irr.box import Box, EnvelopeResult, Side, Status, Step
from robust.irr.containment import DiscoveredBadSet, require_some_schedule
from robust.irr.irr import ordered
from robust.irr.optimal import EmptyEnvelopeError, OptimalBox
from robust.irr.widen import Face, Widening
from robust.qe.compute import RegionStatus, region
from robust.qe.polyhedron import Polyhedron
from robust.smt.export import Exporter
from robust.smt.limits import Deadline, OutOfTimeError

ENUMERATION = 20.0
"""Seconds at most that the optimal box spends on knowing the envelope before it starts."""


class ExactSearch:
    """Exact widening or the optimal box over a discovered bad set.

    Args:
        encoding: the plan's formulas.
        solver: `z3` or `cvc5`.
        exporter: where queries are written, if anywhere.
        deadline: when to stop with the best box so far.
        on_step: called with every box that is known to be inside.
    """

    def __init__(
        self,
        encoding: Encoding,
        *,
        solver: str = "z3",
        exporter: Exporter | None = None,
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
        on_step: Callable[[Step], None] | None = None,
    ) -> None:
        self._encoding = encoding
        self._parameters = encoding.plan.parameters
        self._bad = DiscoveredBadSet(encoding, solver=solver, exporter=exporter)
        self._deadline = deadline
        self._on_step = on_step
        self._started = time.perf_counter()
        self._box = Box.nominal(self._parameters)
        self._verified = False
        self._trace: list[Step] = []
        self._best: OptimalBox | None = None
        self._first_widening: float | None = None

    def widen(self, order: Sequence[str] = ()) -> EnvelopeResult:
        """The max–min fair maximal box; with an order, as far as possible parameter by parameter in that order."""
        groups = None
        if order:
            names = [parameter.name for parameter in ordered(self._parameters, order)]
            groups = [[(name, side) for side in (Side.UPPER, Side.LOWER)] for name in names]

        def search() -> None:
            self._require_nominal()
            self._widening(groups).run()

        return self._run("widen", search)

    def optimal(self, *, contain_nominal: bool = False) -> EnvelopeResult:
        """The box of greatest weighted width, anywhere in the envelope or around the nominal point."""

        def search() -> None:
            pieces: list[Polyhedron] = []
            if contain_nominal or self._bad.piece_in(self._box, self._deadline) is None:
                # A good box at once, and the pieces that shape it.
                self._require_nominal()
                widening = self._widening(None)
                widening.run()
                pieces = widening.pieces
            pieces = [*pieces, *self._enumerated()]
            self._best = OptimalBox(
                self._bad,
                self._parameters,
                pieces=pieces,
                contain_nominal=contain_nominal,
                solver=self._bad.solver,
                deadline=self._deadline,
            )
            self._keep(self._best.run())

        return self._run("optimal", search)

    def _enumerated(self) -> list[Polyhedron]:
        """Bad polyhedra by enumeration, for a while: they are larger than what single boxes run into."""
        remaining = self._deadline.remaining
        found = region(
            self._encoding.plan,
            epsilon=self._encoding.epsilon,
            solver=self._bad.solver,
            encoding=self._encoding.name,
            timeout=ENUMERATION if remaining is None else min(ENUMERATION, remaining / 2),
        )
        if found.status is RegionStatus.INTERRUPTED:
            raise KeyboardInterrupt
        difference = found.region.as_difference()
        outside = difference.base.complement() if difference.base is not None else []
        return [*outside, *difference.pieces]

    def _run(self, method: str, search: Callable[[], None]) -> EnvelopeResult:
        try:
            search()
        except OutOfTimeError:
            return self._result(method, Status.TIMEOUT)
        except KeyboardInterrupt:
            return self._result(method, Status.INTERRUPTED)
        except _InvalidError as invalid:
            return self._result(method, Status.INVALID, invalid.reason)
        except EmptyEnvelopeError:
            return self._result(method, Status.INVALID, "the envelope is empty: no parameter values are inside")
        return self._result(method, Status.COMPLETE)

    def _require_nominal(self) -> None:
        piece = self._bad.piece_in(self._box, self._deadline)
        if piece is not None:
            if piece in self._bad.existence:
                require_some_schedule(self._encoding, self._bad.open_session(), self._deadline)
            raise _InvalidError(self._bad.reasons[piece])
        self._verified = True

    def _widening(self, groups: Sequence[Sequence[Face]] | None) -> Widening:
        return Widening(self._bad, self._parameters, groups=groups, deadline=self._deadline, on_box=self._keep)

    def _keep(self, box: Box) -> None:
        seconds = time.perf_counter() - self._started
        if self._first_widening is None and any(interval.width != 0 for interval in box.intervals.values()):
            self._first_widening = seconds
        self._box = box
        self._verified = True
        step = Step(self._bad.checks, seconds, None, None, None, accepted=True, box=box)
        self._trace.append(step)
        if self._on_step is not None:
            self._on_step(step)

    def _result(self, method: str, status: Status, reason: str | None = None) -> EnvelopeResult:
        return EnvelopeResult(
            status=status,
            method=method,
            encoding=self._encoding.name,
            solver=self._bad.solver,
            beta=None,
            parameters=self._parameters,
            box=self._box,
            checks=self._bad.checks,
            unbounded_checks=0,
            first_widening_seconds=self._first_widening,
            seconds=time.perf_counter() - self._started,
            verified=self._verified,
            trace=tuple(self._trace),
            reason=reason,
            values=self._encoding.plan.nominal if status is Status.INVALID else {},
            statistics=self._bad.statistics,
            bound=self._best.bound if self._best is not None else None,
        )


class _InvalidError(Exception):
    """The nominal point is outside the envelope."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason
