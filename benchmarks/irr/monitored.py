"""`python -m benchmarks.irr.monitored`: the worlds of Table 2, in which a monitor follows what is executed.

What may start by what the monitor says starts as soon as it may. The monitor hears of starts and ends, and of each
level that an action has changed. Where it says that nothing is left, what runs is waited for, and the planner is asked
for another plan, as `robust execute` does. Both meet the same worlds and have the same plans in the same states.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from time import process_time

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

from ..catalogue import BATTERY
from ..generators import delivery
from .tables import TABLE2_DESIGN, RememberingPlanner, uncertain_rules, uncertain_specs


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
        problem, origin, replans = (
            remaining_problem(problem, world.state.snapshot(), begin),
            origin + begin,
            replans + 1,
        )
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


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.irr.monitored", description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=4, help="how many of the hundred problems")
    parser.add_argument("--seed", type=int, default=0, help="which simulated world")
    parser.add_argument("--battery", type=Fraction, default=BATTERY, help="the charge at the beginning")
    parser.add_argument("--planner-limit", type=float, default=7, help="seconds for each plan")
    options = parser.parse_args(arguments)
    succeeded, answers = {"monitor": 0, "execute": 0}, list[float]()
    for number in sorted(i * 37 % 100 for i in range(options.problems)):
        ours, theirs = missions(number, options.battery, options.planner_limit)
        seed = f"{number}/{options.seed}"
        try:
            run = follow(ours, seed, first_plan(ours))
            other = execute(theirs, seed, first_plan(theirs))
        except NoPlanError as error:
            print(f"{number}: {error}", flush=True)
            continue
        answers += run.seconds
        reasons = {"monitor": (run.fault, run.replans), "execute": (other.reason, other.replans)}
        for who, (reason, _) in reasons.items():
            succeeded[who] += not reason
        texts = (f"{who} {reason or 'succeeded'}, {count} re-plans" for who, (reason, count) in reasons.items())
        print(f"{number}: {'; '.join(texts)}", flush=True)
    answers.sort()
    if answers:
        middle, late = (1000 * answers[int(len(answers) * share)] for share in (0.5, 0.99))
        print(f"{len(answers)} answers, median {middle:.1f} ms, 99 % {late:.1f} ms of processor time")
    print("succeeded: " + ", ".join(f"{who} {count}" for who, count in succeeded.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
