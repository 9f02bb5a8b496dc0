"""From PlanSys2's messages to a monitor: plain Python, without ROS, which the node beside it uses and tests run."""

import json
from collections.abc import Iterator
from fractions import Fraction
from math import floor

from robust import InputError, Location, Monitor, MonitorMessage, Outlook, ParametrizedPlan, load_plan
from robust.execute.logs import ExecutionInfo, action_name, echoed, execution_info
from robust.execute.monitor import MessageKind
from robust.execute.tree_writer import executor_names
from robust.execute.trees import earliest_starts
from robust.plan.pddl.forms import read_plan_text
from robust.plan.stn import is_network
from robust.plan.timed import parse_timed_plan

EXECUTING, FAILED, SUCCEEDED, CANCELLED = 1, 2, 3, 4
ENDS = {FAILED: MessageKind.FAILED, SUCCEEDED: MessageKind.END, CANCELLED: MessageKind.CANCELLED}
STAMPS = ("start_stamp", "status_stamp")


class Feed:
    """Tells a monitor what PlanSys2's executor says about the actions of a plan.

    Args:
        domain: the file of the PDDL domain.
        problem: the file of the problem.
        plan: the plan that the executor was given, as a planner printed it, or a network (.stn).
        parameters: durations that may vary, such as `duration:*`.
        deadline: by when all actions must end, such as `+10%`; None is no demand.
        unit: seconds in a unit of the plan's time. PlanSys2 itself takes the numbers of a plan as seconds.
        lateness: how many seconds messages may be late.
    """

    def __init__(
        self,
        domain: str,
        problem: str,
        plan: str,
        *,
        parameters: tuple[str, ...] = ("duration:*",),
        deadline: str | None = None,
        unit: Fraction = Fraction(1),
        lateness: Fraction = Fraction(1),
    ) -> None:
        self.plan: ParametrizedPlan = load_plan(domain, problem, plan, parameters=parameters, deadline=deadline)
        self.monitor = Monitor(self.plan, lateness=lateness / unit)
        self._unit = unit
        text, file = read_plan_text(plan)
        steps = () if is_network(text, file) else parse_timed_plan(text, file).steps
        self._starts = {f"n{number}": step.time for number, step in enumerate(steps)} or earliest_starts(self.plan)
        self._steps = {name: step for step, name in executor_names(self.plan, self._starts).items()}
        self._zero: Fraction | None = None
        self._told: set[tuple[str, MessageKind]] = set()

    def tell(self, info: ExecutionInfo) -> list[Outlook]:
        """The monitor's answers to one message: none to what it was told before, or what says nothing new."""
        if info.status not in (EXECUTING, *ENDS):
            return []
        step = self._step(info.name)
        start = Fraction(info.start, 10**9)
        if self._zero is None:  # the executor's plan began when its first action should have
            self._zero = start - self._starts[step] * self._unit
        messages = [(MessageKind.START, start)]
        if info.status != EXECUTING:
            messages.append((ENDS[info.status], Fraction(info.stamp, 10**9)))
        answers = []
        for kind, time in messages:
            if (step, kind) not in self._told:
                self._told.add((step, kind))
                at = (time - self._zero) / self._unit
                answers.append(self.monitor.tell(MonitorMessage(kind, step, at)))
        return answers

    def _step(self, name: str) -> str:
        """The step that an executor's name such as `(move r a b):5000` means."""
        if name in self._steps:
            return self._steps[name]
        same = [step for known, step in self._steps.items() if action_name(known) == action_name(name)]
        if len(same) != 1:
            raise InputError(f"found action {name!r}, expected one of {', '.join(self._steps)}")
        return same[0]


def slack(outlook: Outlook) -> str:
    """What the node publishes: how much longer than planned actions may take, as a line of JSON with decimals.

    Numbers are rounded down, in the plan's unit of time; null is no limit.
    """

    def number(value: Fraction | None) -> float | None:
        return None if value is None else floor(value * 1000) / 1000

    running = {each.name: {"slack": number(each.slack), "ends_by": number(each.end[1])} for each in outlook.running}
    startable = {each.name: {"starts_by": number(each.start[1])} for each in outlook.startable}
    answer = {"time": number(outlook.time), "prospect": outlook.prospect.value, "reasons": list(outlook.reasons)}
    return json.dumps({**answer, "refused": outlook.refused, "running": running, "startable": startable})


def recorded(text: str, file: str = "<log>") -> Iterator[ExecutionInfo]:
    """The messages in what `ros2 topic echo /action_execution_info` has printed."""
    for message, line in echoed(text, file):
        info = execution_info(message, Location(file, line))
        if info is not None:
            yield info


def of_ros(message: object) -> ExecutionInfo:
    """What a message of the type plansys2_msgs/msg/ActionExecutionInfo says."""
    begun, changed = (getattr(message, name) for name in STAMPS)
    start, stamp = (time.sec * 10**9 + time.nanosec for time in (begun, changed))
    return ExecutionInfo(message.action_full_name, start, stamp, message.status)
