"""Incremental sessions: assert, push and pop, ask, and read the answer in the caller's terms."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from robust.smt.backends import Value, Verdict, create_backend
from robust.smt.export import Exporter
from robust.smt.interrupts import raise_if_interrupted
from robust.smt.limits import Deadline
from robust.smt.statistics import Statistics
from robust.smt.terms import Formula, Terms

log = logging.getLogger(__name__)

__all__ = ["Session", "Value", "Verdict"]


class Session:
    """A stack of assertions in one solver.

    Several sessions may share a `statistics` and an `exporter`. Ctrl-C ends a running query at once with
    `KeyboardInterrupt`; the session is not to be used after that.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    def __init__(
        self,
        terms: Terms,
        *,
        solver: str = "z3",
        statistics: Statistics | None = None,
        exporter: Exporter | None = None,
    ) -> None:
        self.terms = terms
        self.solver = solver
        self.statistics = statistics or Statistics()
        self._exporter = exporter
        self._backend = create_backend(solver, terms)
        self._frames: list[list[Formula]] = [[]]
        self._symbols: list[set[Formula]] = [set()]

    def add(self, *formulas: Formula) -> None:
        """Assert formulas in the current frame; constants that are true cost nothing."""
        for formula in formulas:
            if formula is not self.terms.true:
                self._frames[-1].append(formula)
                self._symbols[-1] |= self.terms.variables(formula)
                self._backend.add(formula)
                self.statistics.nodes += self.terms.size(formula)

    def add_all(self, formulas: Iterable[Formula], deadline: Deadline) -> None:
        """As :meth:`add` for many formulas, whose translation may take long.

        Raises:
            OutOfTimeError: if the deadline passes; the session is not to be used after that.
        """
        for formula in formulas:
            deadline.enforce()
            self.add(formula)

    @contextmanager
    def frame(self, *formulas: Formula) -> Iterator[None]:
        """Assert formulas for the duration of the block."""
        self._frames.append([])
        self._symbols.append(set())
        self._backend.push()
        try:
            self.add(*formulas)
            yield
        finally:
            self._frames.pop()
            self._symbols.pop()
            self._backend.pop()

    @property
    def assertions(self) -> list[Formula]:
        return [formula for frame in self._frames for formula in frame]

    def check(self, question: str, deadline: Deadline = Deadline()) -> Verdict:  # noqa: B008 - immutable
        """Whether the assertions have a model; `question` names the query in logs and exported files."""
        raise_if_interrupted()
        if deadline.passed:
            return Verdict.UNKNOWN
        started = time.perf_counter()
        verdict = self._backend.check(deadline, self._asserted_symbols)
        seconds = time.perf_counter() - started
        self._count(verdict, seconds)
        log.debug("%s: %s in %.4f s", question, verdict.value, seconds)
        if self._exporter is not None:
            self._exporter.write(self.terms, self.assertions, question, verdict.value)
        return verdict

    def values(self, symbols: Iterable[Formula]) -> dict[str, Value]:
        """Values by symbol name in the model of the last satisfiable check; symbols never asserted are left out."""
        asserted = self._asserted_symbols()
        return self._backend.values([symbol for symbol in symbols if symbol in asserted])

    def _asserted_symbols(self) -> set[Formula]:
        return set().union(*self._symbols)

    def _count(self, verdict: Verdict, seconds: float) -> None:
        self.statistics.queries += 1
        self.statistics.seconds += seconds
        match verdict:
            case Verdict.SATISFIABLE:
                self.statistics.satisfiable += 1
            case Verdict.UNSATISFIABLE:
                self.statistics.unsatisfiable += 1
            case Verdict.UNKNOWN:
                self.statistics.unknown += 1
