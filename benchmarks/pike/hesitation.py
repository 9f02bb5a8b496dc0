"""`robust bench hesitation`: humans who know what they want, but take their time; who gets there in the end.

Each execution has an intent, values of all choices of the humans with which a correct execution exists, and a delay:
each choice is made exactly that long after it is possible. The executive is eager, as the paper's, or patient, and is
told of choices when they are made. *Knowing* is a bound on both: whether some correct execution has the intent and the
delays at all, so that who knew the intent beforehand, and everything else, could succeed. Activities take their least
time.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from random import Random
from typing import Any, ClassVar

from robust.errors import InputError
from robust.execute.drive import run_in_world
from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.model import ALWAYS, Assignment, Constraint, Guard, TeamPlan, guard
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Pace, SimulatedTeam, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.smt.limits import Deadline, OutOfTimeError

from ..catalogue import HesitationOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table, middle
from ..engine.show import number as rounded
from ..generators.team_plans import random_plan
from .baselines import Timed

STORIES: Mapping[str, tuple[str, ...]] = {
    "kitchen": ("0.1", "0.25", "0.5", "0.75", "1"),
    "wing": ("1", "5", "10", "15", "20"),
}
"""Plans with names, and delays; every intent that is possible is tried."""
DELAYS = ("0", "1", "5")
"""For random plans, of which one intent is tried, drawn by their number."""
RANDOM = "random plans"


@dataclass(frozen=True, slots=True)
class Hesitation:
    """One intent and delay.

    Attributes:
        outcomes: of the eager executive and the patient one, whether they succeeded; None: out of time.
        known: whether some correct execution has the intent and the delays.
        slowest: seconds of the slowest step of each.
        middle: seconds of the median step of each.
    """

    plan: str
    delay: Fraction
    intent: Mapping[str, str]
    known: bool | None
    outcomes: tuple[bool | None, bool | None]
    slowest: tuple[float, float]
    middle: tuple[float, float]


class Hesitant(SimulatedTeam):
    """Makes every choice the same time after it is possible."""

    def _drawn(self, greatest: Fraction) -> Fraction:
        return greatest


def measure(name: str, number: int, delay: Fraction, seed: int, limit: float) -> Hesitation:
    """One intent of one plan, by both executives.

    Args:
        name: of the story, or of the random plans.
        number: of the intent, or of the random plan.
    """
    deadline = Deadline.after(limit)
    if name == RANDOM:
        plan = random_plan(seed, number).plan()
        found = drawn_intent(plan, Random(f"{seed}/{number}"), deadline)  # noqa: S311 - reproducible
        name = f"random_{seed}_{number:03}"
    else:
        plan = shipped(name).plan()
        found = possible_intents(plan)[number]
    runs = [_execute(plan, found, delay, patience, limit) for patience in (None, Fraction(0))]
    (eager, slow, typical), (patient, slower, usual) = runs
    known = can_be(plan, guard(found), delay, deadline)
    return Hesitation(name, delay, found, known, (eager, patient), (slow, slower), (typical, usual))


def _execute(
    plan: TeamPlan, intent: Mapping[str, str], delay: Fraction, patience: Fraction | None, limit: float
) -> tuple[bool | None, float, float]:
    """Whether it succeeded, and seconds of its slowest and median step."""
    deadline = Deadline.after(limit)
    gc.collect()
    executive = PlanExecutive(plan, SemanticReasoner, patience=patience, deadline=deadline)
    timed = Timed(executive)
    gc.freeze()  # what is there already is not looked at again by garbage collection, whose pauses would count
    try:
        executive.prepare()
        story = Story(pace=Pace.LEAST, outcomes={each: (value, None) for each, value in intent.items()}, delay=delay)
        run_in_world(timed, Hesitant(plan, executive, SemanticReasoner(executive.progress), story))
        succeeded = isinstance(executive.outcome, said.Succeeded)
    except OutOfTimeError:
        return None, 0.0, 0.0
    finally:
        gc.unfreeze()
    return succeeded, max(timed.steps), middle(timed.steps) or 0.0


def possible_intents(plan: TeamPlan) -> list[dict[str, str]]:
    """The joint values of the humans' choices with which a correct execution exists."""
    theirs = [each for each in plan.network.choices if not each.controllable]
    oracle = Oracle(plan)
    joint = product(*(each.domain for each in theirs))
    named = (dict(zip((each.name for each in theirs), values, strict=True)) for values in joint)
    return [each for each in named if oracle.decide(guard(each)).verdict is ExecutionExistence.EXISTS]


def drawn_intent(plan: TeamPlan, random: Random, deadline: Deadline) -> dict[str, str]:
    """Values of the humans' choices, drawn choice by choice, with which these come up in a correct execution.

    Activities take their least time in it. Choices that come up in none together with those before are left out.
    """
    oracle, guards = Oracle(_swift(plan)), plan.network.guards
    intent, come_up = ALWAYS, ALWAYS
    for choice in plan.network.choices:
        if not choice.controllable and choice.event is not None:
            for value in random.sample(choice.domain, len(choice.domain)):
                made = frozenset({Assignment(choice.name, value)})
                whole = come_up | made | guards[choice.event]
                if oracle.decide(whole, deadline=deadline).verdict is ExecutionExistence.EXISTS:
                    intent, come_up = intent | made, whole
                    break
    return {each.variable: each.value for each in intent}


def can_be(plan: TeamPlan, intent: Guard, delay: Fraction, deadline: Deadline) -> bool | None:
    """Whether a correct execution has the intent, each choice a delay after it is possible, and least durations."""
    not_before, guards = said.Progress(plan).structure.not_before, plan.network.guards
    late = tuple(
        Constraint(earlier, each.event, delay, None, guards[earlier] | guards[each.event])
        for each in plan.network.choices
        if not each.controllable and each.event is not None
        for earlier in not_before[each.event]
    )
    network = replace(plan.network, constraints=(*plan.network.constraints, *late))
    verdict = Oracle(_swift(replace(plan, network=network))).decide(intent, deadline=deadline).verdict
    return None if verdict is ExecutionExistence.UNKNOWN else verdict is ExecutionExistence.EXISTS


def _swift(plan: TeamPlan) -> TeamPlan:
    """The plan with activities that take their least time."""
    least = tuple(replace(each, upper=each.lower) for each in plan.network.activities)
    return replace(plan, network=replace(plan.network, activities=least))


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Group:
    """The executions of one kind of plans with one delay."""

    name: str
    delay: Fraction
    runs: Sequence[Hesitation]

    def succeeded(self, place: int) -> str:
        """How often the eager or the patient executive did, of how many."""
        return f"{sum(run.outcomes[place] is True for run in self.runs)} of {len(self.runs)}"

    def slowest(self, place: int) -> str:
        """Milliseconds of the slowest step of all."""
        return rounded(1000 * max(run.slowest[place] for run in self.runs), 1)

    def typical(self, place: int) -> str:
        """The median of the medians."""
        return rounded(1000 * (middle([run.middle[place] for run in self.runs]) or 0), 1)


COLUMNS: Columns[Group] = {
    "plans": lambda one: one.name,
    "each choice later by": lambda one: f"{float(one.delay):g}",
    "eager": lambda one: one.succeeded(0),
    "patient": lambda one: one.succeeded(1),
    "knowing": lambda one: f"{sum(run.known is True for run in one.runs)} of {len(one.runs)}",
    "eager, ms: median step": lambda one: one.typical(0),
    "slowest": lambda one: one.slowest(0),
    "patient, ms: median step": lambda one: one.typical(1),
    "slowest step": lambda one: one.slowest(1),
}


class HesitationReport(Report[Hesitation]):
    """Executions with humans who hesitate (`robust bench hesitation`). They mean something with which a correct
    execution exists, do not change their mind, and make each choice a time after it is possible. Activities take their
    least time. An eager executive acts as soon as it can, as the paper's does; a patient one waits for what can still
    be chosen. *Knowing* is a bound: whether some correct execution has intent and delays at all. One intent of each
    random plan, all of a story. Seconds are of the processor.
    """

    TITLE = "Humans who hesitate"
    SETTINGS: ClassVar[Mapping[str, str]] = {name: name for name in ("seed", "limit", "jobs", "problems")}
    ROWS = "executions"

    @property
    def groups(self) -> list[Group]:
        """By kind of plan and delay."""
        found: dict[tuple[str, Fraction], list[Hesitation]] = {}
        for run in self.rows:
            found.setdefault((run.plan if run.plan in STORIES else RANDOM, run.delay), []).append(run)
        return [Group(*key, runs) for key, runs in sorted(found.items())]

    def sound(self) -> bool:
        """Whether nobody succeeded where that is impossible; who does not succeed is not wrong."""
        return not any(run.known is False and True in run.outcomes for run in self.rows)

    def remarks(self) -> Sequence[str]:
        late = sum(None in run.outcomes for run in self.rows)
        lost = sum(run.outcomes == (True, False) for run in self.rows)
        return [
            f"{self.options.problems} plans of seed {self.options.seed}; limit {self.options.limit:g} s for each",
            f"the eager executive succeeds and the patient one does not in {lost} executions",
            *([f"out of time: {late} executions"] if late else []),
        ]

    def contents(self) -> list[Table]:
        return [Table.of("Executions with humans who hesitate", COLUMNS, self.groups)]


def _search(options: HesitationOptions, _: object) -> list[int]:
    """The numbers of the random plans that admit a correct execution."""
    if options.problems < 1:
        raise InputError(f"problems is {options.problems}; expected at least 1")
    plans = ((number, random_plan(options.seed, number).plan()) for number in range(options.problems))
    return [number for number, plan in plans if Oracle(plan).decide().verdict is ExecutionExistence.EXISTS]


def _tasks(options: HesitationOptions, admitting: list[int]) -> list[Task]:
    chosen = STORIES if options.stories is None else {name: STORIES[name] for name in options.stories}
    intents = [(name, len(possible_intents(shipped(name).plan())), delays) for name, delays in chosen.items()]
    named = [(name, number, delay) for name, count, delays in intents for number in range(count) for delay in delays]
    named += [(RANDOM, number, delay) for number in admitting for delay in DELAYS]
    return [
        Task(f"{name} {number}, {delay}", (name, number, Fraction(delay), options.seed, options.limit or 60.0))
        for name, number, delay in named
    ]


def _describe(run: Hesitation) -> str:
    told: Mapping[Any, str] = {True: "succeeded", False: "failed", None: "out of time"}
    return f"eager {told[run.outcomes[0]]}, patient {told[run.outcomes[1]]}"


HESITATION = Experiment("hesitation", HesitationOptions, _tasks, measure, HesitationReport, _describe, prepare=_search)
