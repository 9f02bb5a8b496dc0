"""What is done with one plan of the scaling experiment, on whatever machine: one method, or controllability."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, assert_never

from robust.api import envelope
from robust.bench.contenders import IRR, OPTIMAL, REGIONS, WIDEN, CheckRun, RegionRun, cost_as_dict
from robust.bench.figure4_instances import Instance
from robust.bench.process import Processes
from robust.bench.run import EnvelopeRun, box_as_dict
from robust.errors import RobustError
from robust.execute.controllability.assess import Controllability, Kind
from robust.irr.box import Box, Side
from robust.plan.load import load_plan
from robust.plan.model import ActionInstance, Duration, ParameterReference, ParametrizedPlan, Relation
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline, OutOfTimeError

OURS = (IRR, WIDEN)
BASELINE = (OPTIMAL, *REGIONS)
"""What CCMMZ computed: exact regions, by several back ends, and the widest box."""
CONTENDERS = OURS + BASELINE
CONTROLLABILITY = "controllability"
_BY_NAME = {one.name: one for one in CONTENDERS}


@dataclass(frozen=True, slots=True)
class Figure4Task:
    """A method by its name, or CONTROLLABILITY, on one plan; `limit` in seconds."""

    instance: Instance
    method: str
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.instance.name}, {self.method}"


def do(task: Figure4Task) -> dict[str, Any]:
    """Run a method as a whole process, or ask about controllability in this one.

    Raises:
        RobustError: if the plan cannot be read.
    """
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        files = task.instance.write(Path(directory))
        if task.method == CONTROLLABILITY:
            return _controllability(files, task.instance.options, task.limit)
        run = _BY_NAME[task.method].run(Processes(), files, limit=task.limit, extra=task.instance.options)
        facts: dict[str, Any] = {**cost_as_dict(run), "box": None, "unbounded": [], "capped": [], "polyhedra": None}
        match run:
            case EnvelopeRun() if run.box:
                box = Box(run.box)
                facts |= {"box": box_as_dict(run.box), "unbounded": unbounded(box)}
                facts["capped"] = only_capped(_plan(files, task.instance.options), box)
            case EnvelopeRun():
                pass
            case RegionRun():
                facts["polyhedra"] = run.polyhedra
            case CheckRun():
                pass
            case _:
                assert_never(run)
        return facts


def _plan(files: tuple[Path, Path, Path], options: tuple[str, ...]) -> ParametrizedPlan:
    return load_plan(*files, parameters=[one.removeprefix("--parameter=") for one in options])


def unbounded(box: Box) -> list[str]:
    """The directions in which a box has no end: `above a`, `below b`."""
    above = [f"above {name}" for name, interval in box.intervals.items() if interval.upper is None]
    return above + [f"below {name}" for name, interval in box.intervals.items() if interval.lower is None]


def only_capped(plan: ParametrizedPlan, box: Box) -> list[str]:
    """Parameters that are durations, and that nothing but a number in their own duration constraint bounds above."""
    caps: dict[str, set[Fraction]] = {}
    for constraint in plan.constraints:
        instance = plan.instance.get(constraint.target.instance or "")
        if instance is None or constraint.source.instance != instance.identifier or constraint.lower is None:
            continue
        for name in box.intervals:
            if constraint.lower == constraint.upper == Polynomial.variable(ParameterReference(name)):
                caps.setdefault(name, set()).update(_greatest_durations(instance))
    return [f"above {name}" for name, values in caps.items() if values and box[name].upper == min(values)]


def _greatest_durations(instance: ActionInstance) -> Iterator[Fraction]:
    """The numbers in constraints `(<= ?duration number)`, which are kept as `number − ?duration ≥ 0`."""
    for part in instance.durations:
        expression = part.condition.expression
        number = expression.constant_term
        shape = Polynomial.constant(number) - Polynomial.variable(Duration())
        if part.condition.relation is Relation.AT_LEAST and expression == shape:
            yield number


def _controllability(files: tuple[Path, Path, Path], options: tuple[str, ...], limit: float | None) -> dict[str, Any]:
    """Is the box of exact widening dynamically controllable, and what is left of it once it is?"""
    deadline = Deadline.after(limit)
    plan = _plan(files, options)
    found = envelope(plan, timeout=limit)
    facts = {"status": found.status.value, **dict.fromkeys(("dynamic", "strong", "kept", "bounded", "cut", "reason"))}
    if not found.verified:
        return {**facts, "reason": found.reason}
    try:
        questions = Controllability(plan, found.box, deadline=deadline)
        dynamic, strong = questions.finding(Kind.DYNAMIC), questions.finding(Kind.STRONG)
        facts |= {"dynamic": dynamic.verdict.value, "strong": strong.verdict.value, "reason": dynamic.reason}
        shrunk = questions.shrunk(Kind.DYNAMIC)
    except OutOfTimeError:
        return {**facts, "status": "timeout"}
    except RobustError as error:
        return {**facts, "reason": str(error)}
    cut = {name for name, side in shrunk.cut if side is Side.UPPER}
    return {**facts, **_loss(found.box, shrunk.box, cut)}


def _loss(box: Box, part: Box, cut: set[str]) -> Mapping[str, Any]:
    """How much of the finite widths is `kept`, on average; how many faces that were infinite have become `bounded`.

    A face in `cut` may be at any finite place, so that it was not lost.
    """
    shares = []
    bounded = 0
    for name, interval in box.intervals.items():
        width, left = interval.width, part.intervals[name].width
        if width is not None and width > 0:
            shares.append((left or Fraction(0)) / width)
        elif width is None and left is not None and name not in cut:
            bounded += 1
    kept = float(sum(shares) / len(shares)) if shares else None
    return {"kept": None if kept is None else round(kept, 4), "bounded": bounded, "cut": len(cut)}
