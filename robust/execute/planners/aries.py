"""Aries, a constraint-based temporal planner of the extra `planners` (package up-aries).

The problem is handed over in the wire format of unified-planning, and the plan is read from what Aries prints: there is
one process, no server and no port. Aries counts time in tenths; here a unit of its time is a tick of ours, so that its
tenths, by which it separates what depends on each other, are the separation of mutex time points.
"""

from __future__ import annotations

import importlib
import tempfile
import time
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Protocol

from robust.encode.interface import EPSILON
from robust.errors import InputError, RobustError, UnsupportedError
from robust.execute.planners.command import judged
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.execute.planners.output import check, plan_texts
from robust.execute.planners.process import MEMORY_MB, Ended, run
from robust.plan.numerals import format_number
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
from robust.smt.limits import Deadline

_SEPARATION = Fraction(1, 10)
"""The least time between two dependent time points of Aries, in its units."""

HORIZON = 10**5
"""Time units; no plan is longer. Aries itself would stop at 10,000 ticks, and counts their tenths in 32 bits."""


@dataclass(frozen=True, slots=True)
class AriesPlanner:
    """The first plan that Aries finds. Its strategies race in threads, so the same problem may have another plan."""

    executable: str
    epsilon: Fraction = EPSILON
    name: str = "aries"
    memory_mb: int = MEMORY_MB

    @property
    def ticks(self) -> int:
        """Ticks in a unit of the plan's time."""
        return int(_SEPARATION / self.epsilon)

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        start = time.monotonic()
        message = _serialized(domain, problem, self.ticks)
        with tempfile.TemporaryDirectory(prefix="robust-planner-") as name:
            folder = Path(name)
            (folder / "problem.bin").write_bytes(message)
            command = (self.executable, "--log-level", "error", "solve", "problem.bin")
            variables = {"ARIES_PLANNING_HORIZON": str(HORIZON * self.ticks), "RUST_BACKTRACE": "0"}
            ended = run(command, folder, deadline, memory_mb=self.memory_mb, variables=variables)
        answer = judged(self.name, ended, self._plan(ended.stdout, domain, problem), _verdict)
        return replace(answer, seconds=time.monotonic() - start)

    def _plan(self, text: str, domain: Domain, problem: Problem) -> tuple[TimedPlan | None, str]:
        """The plan that was printed, in our names and unit; or what is wrong with it."""
        candidate = next(plan_texts(text), None)
        if candidate is None:
            return None, ""
        try:
            plan = _in_units(parse_timed_plan(candidate, f"<plan of {self.name}>"), domain, self.ticks)
            check(plan, domain, problem, self.epsilon)
        except RobustError as error:
            return None, " ".join(str(error).split())
        return plan, ""


def aries_planner(*, epsilon: Fraction = EPSILON) -> AriesPlanner:
    """Aries, with plans whose dependent time points are at least `epsilon` apart.

    Raises:
        UnsupportedError: if the package is not installed, or not for this machine.
        InputError: if `epsilon` is not between 1/20,000 and 1/10: a tick has to fit into 32 bits.
    """
    if not Fraction(1, 20_000) <= epsilon <= _SEPARATION:
        raise InputError(f"found ε = {format_number(epsilon)}, expected 1/20000 to 1/10 for aries")
    try:
        solver = importlib.import_module("up_aries.solver")
        executable: str = solver._find_executable()
    except ImportError as error:
        expected = "it to be installed: pip install 'robust[planners]'"
        raise UnsupportedError(f"found no planner aries (package up-aries), expected {expected}") from error
    except OSError as error:
        raise UnsupportedError(
            f"found no planner aries for this machine ({error}), expected another planner"
        ) from error
    return AriesPlanner(executable, epsilon)


class _Message(Protocol):
    def SerializeToString(self) -> bytes: ...  # noqa: N802 - protobuf's name


def _serialized(domain: Domain, problem: Problem, ticks: int) -> bytes:
    from robust.execute.planners.aries_problem import unified_problem  # noqa: PLC0415 - needs unified-planning

    writer = importlib.import_module("unified_planning.grpc.proto_writer").ProtobufWriter()
    message: _Message = writer.convert(unified_problem(domain, problem, ticks, HORIZON))
    return message.SerializeToString()


def _in_units(plan: TimedPlan, domain: Domain, ticks: int) -> TimedPlan:
    """The plan with PDDL's names, and times in the problem's unit; instantaneous actions have no duration."""
    from robust.execute.planners.aries_problem import pddl_name  # noqa: PLC0415 - needs unified-planning

    steps = []
    for one in plan.steps:
        schema = domain.actions.get(pddl_name(one.action))
        durative = one.duration is not None and (schema is None or schema.durative)
        duration = one.duration / ticks if durative and one.duration is not None else None
        arguments = tuple(map(pddl_name, one.arguments))
        steps.append(TimedStep(one.time / ticks, pddl_name(one.action), arguments, duration, one.location))
    return TimedPlan(tuple(steps), plan.file)


def _verdict(ended: Ended) -> PlannerStatus | None:
    if "NO PLAN" in ended.stdout:
        return PlannerStatus.NO_PLAN
    return PlannerStatus.CRASHED if ended.stderr.startswith("Error:") else None
