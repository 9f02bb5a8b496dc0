"""Questions about a plan in stages: write it as formulas, search, and add what the answer leaves room for.

Formulas take time as well: until there are any, the answer is that nothing is known.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Generic, TypeVar

from robust.encode import create_encoding
from robust.encode.interface import EPSILON, Encoding
from robust.errors import UnsupportedError
from robust.irr.check import Answer, Checker, CheckResult
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box
from robust.searching import Searching
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Exporter

if TYPE_CHECKING:
    from robust.irr.stops import Tolerance

Judged = TypeVar("Judged")


@dataclass(frozen=True, slots=True, kw_only=True)
class Manner:
    """How a plan is asked about: its encoding, the solver, the separation of mutex time points, and until when.

    `exporter` is where queries are written as well, if they are.
    """

    encoding: str = "relational"
    solver: str = "z3"
    epsilon: Fraction = EPSILON
    deadline: Deadline = NEVER
    exporter: Exporter | None = None


class PlanQuestion(ABC, Generic[Judged]):
    """A question about a plan, which can be given up at any stage.

    Args:
        plan: the plan.
        manner: how it is asked about.
    """

    def __init__(self, plan: ParametrizedPlan, manner: Manner) -> None:
        self.plan = plan
        self.manner = manner
        self._started = time.perf_counter()
        self._searching: Searching[Judged] | None = None

    def run(self) -> Judged:
        """The answer; out of time or after Ctrl-C, what is known by then."""
        try:
            self._searching = self.search(self.formulas())
        except (OutOfTimeError, KeyboardInterrupt) as stopped:
            return self.nothing(timed_out=isinstance(stopped, OutOfTimeError))
        return self.completed(self._searching.run())

    def so_far(self, *, timed_out: bool) -> Judged | None:
        """What is known if the question is given up now, out of time or else interrupted."""
        if self._searching is None:
            return self.nothing(timed_out=timed_out)
        return self._searching.so_far(timed_out=timed_out)

    @property
    def seconds(self) -> float:
        """Since the question was made."""
        return time.perf_counter() - self._started

    def tolerance(self, proved: Box | None = None) -> Tolerance | None:
        """λ*, if there are durations, and time for it; some box may be proved already."""
        if not self.plan.lasting:
            return None
        from robust.irr.proposals import tolerance  # noqa: PLC0415 - for plans with durations only

        manner = self.manner
        try:
            return tolerance(self.plan, manner.epsilon, manner.deadline, manner.solver, proved)
        except (OutOfTimeError, KeyboardInterrupt):
            return None

    def formulas(self) -> Encoding:
        """The plan as formulas."""
        return create_encoding(self.manner.encoding, self.plan, self.manner.epsilon, self.manner.deadline)

    @abstractmethod
    def search(self, formulas: Encoding) -> Searching[Judged]:
        """The search for the answer."""

    @abstractmethod
    def nothing(self, *, timed_out: bool) -> Judged:
        """The answer as long as nothing is known."""

    @abstractmethod
    def completed(self, result: Judged) -> Judged:
        """What a search has found, and what follows from it in the time that is left."""


class CheckQuestion(PlanQuestion[CheckResult]):
    """Is the plan valid for every schedule and all values in a box?

    Args:
        plan: the plan.
        manner: how it is asked about.
        box: the parameter values.
        every: whether all obligations are examined, rather than those up to the first that breaks.
        on_obligation: called with the number of obligations examined, their total, and the name of the next.
    """

    def __init__(
        self,
        plan: ParametrizedPlan,
        manner: Manner,
        box: Box,
        *,
        every: bool = False,
        on_obligation: Callable[[int, int, str], None] | None = None,
    ) -> None:
        super().__init__(plan, manner)
        self.box = box
        self.every = every
        self._on_obligation = on_obligation

    def run(self) -> CheckResult:
        try:
            return super().run()
        except UnsupportedError as products:
            return self._with_products(products)

    def _with_products(self, products: UnsupportedError) -> CheckResult:
        """The answer about a plan in which unknowns are multiplied."""
        from robust.irr.corners import CornerChecker  # noqa: PLC0415 - for few plans

        checker = CornerChecker(self.examined, self.box, self._of, self.nothing(timed_out=False))
        self._searching = checker
        return self.completed(checker.run())

    @property
    def examined(self) -> ParametrizedPlan:
        """The plan with the network whose schedules count."""
        return self.plan

    def formulas(self) -> Encoding:
        return self.encoded(self.examined, self.box)

    def encoded(self, plan: ParametrizedPlan, box: Box) -> Encoding:
        """Formulas of a plan over a box."""
        manner = self.manner
        return create_encoding(manner.encoding, plan, manner.epsilon, manner.deadline, ranges=box.ranges)

    def _of(self, plan: ParametrizedPlan, box: Box) -> Checker:
        """A check of what is left of the plan where parameters have values."""
        return self._checker(self.encoded(plan, box), box)

    def search(self, formulas: Encoding) -> Checker:
        return self._checker(formulas, self.box)

    def _checker(self, formulas: Encoding, box: Box) -> Checker:
        return Checker(
            formulas,
            box,
            solver=self.manner.solver,
            every=self.every,
            deadline=self.manner.deadline,
            exporter=self.manner.exporter,
            on_obligation=self._on_obligation,
        )

    def nothing(self, *, timed_out: bool) -> CheckResult:
        return CheckResult(
            Answer.UNKNOWN,
            self.box,
            {},
            {},
            self.seconds,
            interrupted=not timed_out,
            timed_out=timed_out,
            encoding=self.manner.encoding,
            solver=self.manner.solver,
            epsilon=self.manner.epsilon,
            every=self.every,
            plan=self.plan,
        )

    def completed(self, result: CheckResult) -> CheckResult:
        is_nominal = self.box == Box.nominal(self.plan.parameters)
        return replace(result, tolerance=self.tolerance()) if result.answer is Answer.PROVED and is_nominal else result
