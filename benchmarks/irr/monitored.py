"""`robust bench monitored`: the worlds of Table 2, in which a monitor follows what is executed.

What may start by what the monitor says starts as soon as it may. The monitor hears of starts and ends, and of each
level that an action has changed. Where it says that nothing is left, what runs is waited for, and the planner is asked
for another plan, as `robust execute` does. Both meet the same worlds and have the same plans in the same states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from time import process_time
from typing import ClassVar

from robust.errors import RobustError
from robust.execute import dispatcher, drive
from robust.execute.forecast import Prospect
from robust.execute.messages import MessageKind
from robust.execute.monitor import Monitor, Outlook
from robust.execute.planners import create_planner
from robust.execute.replan import (
    REPLANS,
    Mission,
    Prepared,
    ReplanningOptions,
    beginning,
    execute,
    first_plan,
    judged,
    prepare_timed,
)
from robust.execute.situation import NoPlanError, origin_after, plans_for, remaining_problem
from robust.execute.worlds import ExecutedInstance, Luck, SimulatedWorld
from robust.plan import timeline
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.smt.limits import Deadline

from ..catalogue import MonitoredOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import NOTHING, Columns, Table, number
from ..generators import delivery
from .tables import TABLE2_DESIGN, RememberingPlanner, problems_of, uncertain_rules, uncertain_specs


@dataclass
class Follower:
    """Carries a plan out as its monitor says; an executive for :func:`robust.execute.drive.run_in_world`.

    `ended` once all is done, or nothing is left and nothing runs any more.
    """

    monitor: Monitor
    world: SimulatedWorld
    seconds: list[float] = field(default_factory=list)
    """Processor time of each answer."""

    def __post_init__(self) -> None:
        self.outlook: Outlook = self.monitor.outlook()
        self._levels = dict(self.world.state.fluents)

    def _say(self, kind: MessageKind, what: str = "", *, at: Fraction, observed: Fraction | None = None) -> None:
        started = process_time()
        self.outlook = self.monitor.say(kind.value, what, at=at, observed=observed)
        self.seconds.append(process_time() - started)
        if self.outlook.refused is not None:
            raise RobustError(f"found {self.outlook.refused!r}, expected a monitor that takes what happens")

    def step(self, now: Fraction, messages: Sequence[dispatcher.Message]) -> Sequence[dispatcher.Decision]:
        """Tell what happened; start what may start."""
        kinds = {dispatcher.Completed: MessageKind.END, dispatcher.DispatchFailed: MessageKind.FAILED}
        for message in messages:
            if isinstance(message, dispatcher.InstanceEvent) and type(message) in kinds:
                self._say(kinds[type(message)], message.instance, at=message.time)
        self._observe(now)
        self._say(MessageKind.TICK, at=now)
        ready = () if self.outlook.replan else self.outlook.startable[:1]  # levels are looked at before the next one
        decisions = []
        for look in ready:
            self._say(MessageKind.START, look.step, at=now)
            decisions.append(dispatcher.Dispatch(self.monitor.plan.instance[look.step].start, now))
        self._started = bool(ready)
        return decisions

    def _observe(self, now: Fraction) -> None:
        for fluent, level in self.world.state.fluents.items():
            if self._levels.get(fluent) != level:
                self._levels[fluent] = level
                self._say(MessageKind.VALUE, str(fluent), at=now, observed=level)

    @property
    def wake(self) -> Fraction | None:
        return self.monitor.time if self._started else self.outlook.wake

    @property
    def ended(self) -> bool:
        stuck = self.outlook.replan and not self.monitor.state.running
        return self.outlook.prospect is Prospect.DONE or stuck


@dataclass(frozen=True)
class MonitoredRun:
    """How a run ended: why it failed, else empty; how many other plans were begun; processor times of answers."""

    fault: str
    replans: int
    seconds: Sequence[float]


def follow(mission: Mission, seed: str, prepared: Prepared) -> MonitoredRun:
    """A run of a mission in which a monitor says what may start, and when another plan is needed."""
    luck, problem, origin, replans = Luck(mission.rules, seed), mission.problem, Fraction(0), 0
    executed: list[ExecutedInstance] = []
    seconds: list[float] = []
    start = None
    epsilon = mission.options.epsilon
    while True:
        world = SimulatedWorld(prepared.dispatchable, luck, levels_known=start is not None)
        start = start or beginning(prepared.dispatchable.plan, world)
        follower = Follower(Monitor(prepared.dispatchable.plan, epsilon, seconds=None), world, seconds)
        last = drive.run_in_world(follower, world)
        for each in world.executed.values():
            each.start, each.end = each.start + origin, None if each.end is None else each.end + origin
        executed += world.executed.values()
        violations = judged(start, executed, epsilon).violations
        reading = timeline.Reading(world.state.snapshot(), {})
        if all(reading.holds(demand.condition) for demand in start.goal):
            return MonitoredRun("; ".join(each.detail for each in violations[:1]), replans, seconds)
        if replans == mission.replans:
            return MonitoredRun(f"gave up after {replans} re-plans", replans, seconds)
        begin = origin_after(last, problem.timed_literals, epsilon)
        world.pass_until(begin)
        problem = remaining_problem(problem, world.state.snapshot(), begin)
        origin, replans = origin + begin, replans + 1
        try:
            _, (timed, *_) = plans_for(
                mission.planner, mission.domain, problem, Deadline.after(mission.planner_seconds)
            )
            prepared = prepare_timed(mission.domain, problem, timed, mission.options)
        except (NoPlanError, RobustError) as error:
            return MonitoredRun(f"{'; '.join(follower.outlook.reasons)}; {error}", replans, seconds)


def missions(number: int, battery: Fraction, planner_seconds: float) -> tuple[Mission, Mission]:
    """A problem of table 2, for the monitor and for the dispatcher, who asks one planner with the same answers."""
    posed = delivery.table_problems(delivery.DeliveryVariant.BATTERY, battery=battery)[number]
    domain = parse_domain(delivery.delivery_domain(posed.options.variant))
    problem = parse_problem(posed.text, domain)
    planner = RememberingPlanner(create_planner(TABLE2_DESIGN.planner))
    found = [
        Mission(
            domain,
            problem,
            planner,
            uncertain_rules(2, 1),
            ReplanningOptions(specs=specs, timeout=30),
            replans=REPLANS,
            planner_seconds=planner_seconds,
            drain=TABLE2_DESIGN.drain,
        )
        for specs in ((), uncertain_specs(2, 1))
    ]
    return found[0], found[1]


@dataclass(frozen=True, slots=True)
class MonitoredRow:
    """A problem in one world: why each run failed, else empty; and processor times of the monitor's answers.

    Where there is no first plan, both have failed, and nothing was answered.
    """

    problem: int
    seed: int
    fault: str
    replans: int
    dreex_fault: str
    dreex_replans: int
    answers_s: tuple[float, ...] = ()


def run_problem(problem: int, seed: int, battery: Fraction, planner_s: float) -> MonitoredRow:
    """A problem of table 2 with the monitor and with DREEX."""
    ours, theirs = missions(problem, battery, planner_s)
    world = f"{problem}/{seed}"
    try:
        run = follow(ours, world, first_plan(ours))
        other = execute(theirs, world, first_plan(theirs))
    except NoPlanError as error:
        return MonitoredRow(problem, seed, str(error), 0, str(error), 0)
    answers = tuple(round(one, 6) for one in run.seconds)
    return MonitoredRow(problem, seed, run.fault, run.replans, other.reason, other.replans, answers)


def _milliseconds(answers: Sequence[float], share: float) -> str:
    """The time that this share of the answers took at most."""
    return number(1000 * sorted(answers)[int(len(answers) * share)], 1) if answers else NOTHING


COLUMNS: Columns[MonitoredRow] = {
    "problem": lambda row: row.problem,
    "monitor": lambda row: row.fault or "succeeded",
    "re-plans": lambda row: row.replans,
    "DREEX": lambda row: row.dreex_fault or "succeeded",
    "its re-plans": lambda row: row.dreex_replans,
    "answers": lambda row: len(row.answers_s),
    "median ms": lambda row: _milliseconds(row.answers_s, 0.5),
    "99 % ms": lambda row: _milliseconds(row.answers_s, 0.99),
}


class MonitoredReport(Report[MonitoredRow]):
    """The worlds of Table 2 with a monitor that says what may start, and with DREEX (`robust bench monitored`)."""

    TITLE = "A monitor in the worlds of Table 2"
    SETTINGS: ClassVar[Mapping[str, str]] = {
        "planner_s": "planner_limit",
        "battery": "battery",
        "seed": "seed",
        "jobs": "jobs",
    }

    def sound(self) -> bool:
        """Whether the monitor succeeds wherever DREEX does."""
        return all(row.dreex_fault or not row.fault for row in self.rows)

    def remarks(self) -> Sequence[str]:
        options = self.options
        return [
            f"planner {TABLE2_DESIGN.planner}, at most {options.planner_limit:g} s for each plan; battery "
            f"{options.battery}; seed {options.seed}; processor time of each answer"
        ]

    def contents(self) -> list[Table]:
        return [Table.of(self.TITLE, COLUMNS, self.rows, left=("monitor", "DREEX"))]

    def conclusions(self) -> Sequence[str]:
        """Successes, and how long answers took."""
        answers = [one for row in self.rows for one in row.answers_s]
        ours, theirs = (sum(not getattr(row, name) for row in self.rows) for name in ("fault", "dreex_fault"))
        times = f"median {_milliseconds(answers, 0.5)} ms, 99 % at most {_milliseconds(answers, 0.99)} ms"
        return [
            f"The monitor succeeds in {ours} of {len(self.rows)} runs, DREEX in {theirs}.",
            f"{len(answers)} answers: {times}.",
        ]


def _prepare(options: MonitoredOptions, _: object) -> None:
    problems_of(options.problems)  # or an error
    create_planner(TABLE2_DESIGN.planner)  # before anything runs for long


def _tasks(options: MonitoredOptions, _: object) -> list[Task]:
    return [
        Task(f"problem {problem}", (problem, options.seed, options.battery, options.planner_limit))
        for problem in problems_of(options.problems)
    ]


def _describe(row: MonitoredRow) -> str:
    return f"monitor {row.fault or 'succeeded'}, DREEX {row.dreex_fault or 'succeeded'}"


MONITORED = Experiment("monitored", MonitoredOptions, _tasks, run_problem, MonitoredReport, _describe, prepare=_prepare)
