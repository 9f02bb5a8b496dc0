"""Back ends against the oracle on many random plans: what they were asked, and the plans on which one differs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Final

from robust.pike_bridge.cross_check import BACKENDS, Crossing, Disagreement, cross_check, subjects
from robust.pike_bridge.model import EPSILON
from robust.pike_bridge.random_plans import DEFAULT, Shape, random_plan
from robust.presented import Presented
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

SHAPES: Final[Mapping[str, Shape]] = {
    "small": Shape(top=3, inner=2, deepest=2, squeeze=Fraction(0), threat_share=0.3),
    "medium": Shape(top=5, deepest=2, squeeze=Fraction(0), threat_share=0.3),
    "paper": DEFAULT,
}
"""Sizes of random plans; a hundred small ones are compared within a minute."""
EACH = 20.0
"""Seconds that a back end has for a plan."""


@dataclass
class RandomCrossed(Presented, ask="agree"):
    """The outcome: how many plans were compared, and where a back end differs from the oracle."""

    seed: int
    sizes: str
    wanted: int
    plans: int = 0
    feasible: int = 0
    """Plans that admit a correct execution."""
    scenarios: int = 0
    questions: Counter[str] = field(default_factory=Counter)
    out_of_time: Counter[str] = field(default_factory=Counter)
    """By back end, on how many plans it did not finish."""
    disagreements: list[tuple[int, Disagreement]] = field(default_factory=list)
    """With the number of the plan."""
    written: Path | None = None
    status: str = "complete"

    @property
    def cut_short(self) -> bool:
        """Whether something ended it before all plans were compared."""
        return self.status != "complete"

    @property
    def agree(self) -> bool:
        return not self.disagreements

    @property
    def smallest(self) -> tuple[int, Disagreement] | None:
        """The one that takes least to tell."""
        return min(self.disagreements, key=lambda each: len(str(each[1])), default=None)


@dataclass
class RandomCrossing:
    """Compares all back ends with the oracle on random plans of a seed.

    Args:
        number: of plans.
        sizes: one of :data:`SHAPES`.
        witness: where a small plan is written on which the first back end that differs still does.
        epsilon: how much earlier is "before".
        on_stage: called with the number of each plan that begins.
    """

    number: int
    seed: int = 0
    sizes: str = "small"
    witness: Path | None = None
    epsilon: Fraction = EPSILON
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Callable[[str], None] | None = None

    def __post_init__(self) -> None:
        self._known = RandomCrossed(self.seed, self.sizes, self.number)

    def run(self) -> RandomCrossed:
        """Compare; a deadline or Ctrl-C ends it with what is known."""
        known = self._known
        try:
            for index in range(self.number):
                if self.on_stage is not None:
                    self.on_stage(f"plan {index + 1} of {self.number}")
                self._compare(index)
        except OutOfTimeError:
            known.status = "timeout"
        except KeyboardInterrupt:
            known.status = "interrupted"
        return known

    def so_far(self, *, timed_out: bool) -> RandomCrossed | None:
        """What is known by now."""
        self._known.status = "timeout" if timed_out else "interrupted"
        return self._known

    def _compare(self, index: int) -> None:
        known = self._known
        plan = random_plan(self.seed, index, SHAPES[self.sizes]).plan(self.epsilon)
        asked = tuple(subjects(BACKENDS))
        outcome = cross_check(plan, asked, solver=self.solver, seed=self.seed, deadline=self.deadline, limit=EACH)
        known.plans += 1
        known.scenarios += outcome.scenarios
        known.feasible += outcome.scenarios > 0
        known.questions.update(outcome.questions)
        known.out_of_time.update(outcome.out_of_time)
        known.disagreements += [(index, each) for each in outcome.disagreements]
        if not outcome.agree and self.witness is not None and known.written is None:
            shrinking = Crossing(plan, self.witness, self.seed, self.solver, self.deadline, self.on_stage)
            known.written = shrinking.run().written
