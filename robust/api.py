"""The verbs of the package as functions: load, check, envelope."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from robust.encode.encoding import EPSILON, RelationalEncoding
from robust.errors import InputError, did_you_mean
from robust.irr.box import Box, Interval
from robust.irr.check import Checker, CheckResult
from robust.irr.containment import Containment
from robust.irr.irr import IncrementalRobustification
from robust.irr.result import EnvelopeResult, Step
from robust.plan.model import ParametrizedPlan
from robust.smt.export import Exporter
from robust.smt.limits import Deadline


def check(
    plan: ParametrizedPlan,
    *,
    at: Mapping[str, Fraction | Interval] | None = None,
    every: bool = False,
    epsilon: Fraction = EPSILON,
    solver: str = "z3",
    timeout: float | None = None,
    smt2: str | Path | None = None,
    on_obligation: Callable[[int, int, str], None] | None = None,
) -> CheckResult:
    """Whether the plan is valid for every schedule that its network allows [DESIGN §4].

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        at: values, or intervals of values, for parameters; those left out are at their nominal value.
        every: examine all obligations instead of stopping at the first that breaks.
        epsilon: the separation of mutex time points, in the plan's unit of time.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is undecided is UNKNOWN; None never.
        smt2: a directory to write every query to.
        on_obligation: called with the number of obligations examined, their total, and the name of the next.

    Returns:
        A verdict with a confirmed counterexample where it is REFUTED. Ctrl-C returns what is known by then.

    Raises:
        InputError: wrong options, or a network without any schedule.
        UnsupportedError: an expression that is not linear.
    """
    box = Box.nominal(plan.parameters)
    for name, value in (at or {}).items():
        if name not in box.intervals:
            raise InputError(f"unknown parameter {name!r}{did_you_mean(name, box.intervals)}")
        box = box.replace(name, value if isinstance(value, Interval) else Interval(value, value))
    exporter = Exporter(smt2) if smt2 is not None else None
    return Checker(
        RelationalEncoding(plan, epsilon),
        box,
        solver=solver,
        every=every,
        deadline=Deadline.after(timeout),
        exporter=exporter,
        on_obligation=on_obligation,
    ).run()


def envelope(
    plan: ParametrizedPlan,
    *,
    beta: Fraction = Fraction(1),
    doubling: bool = False,
    order: Sequence[str] = (),
    epsilon: Fraction = EPSILON,
    solver: str = "z3",
    timeout: float | None = None,
    smt2: str | Path | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> EnvelopeResult:
    """A box of parameter values under which the plan stays valid, by IRR [IRR §4, Algorithm 1].

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        beta: the precision, in the parameters' units: no face of a complete box can move outwards by it.
        doubling: the schedule of the recorded runs (faces up to 2β away).
        order: the turn order of the parameters.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        timeout: seconds after which the best box so far is returned with status TIMEOUT; None never.
        smt2: a directory to write every query to.
        on_step: called after each containment check with the best box so far.

    Returns:
        The best box found, inside the envelope if `verified`. It is not if the nominal point itself is outside
        (INVALID), or if time ran out before that was known. Ctrl-C returns the best box so far (INTERRUPTED).

    Raises:
        InputError: wrong options, or no schedule at the nominal point.
        UnsupportedError: an expression that is not linear.
    """
    deadline = Deadline.after(timeout)
    exporter = Exporter(smt2) if smt2 is not None else None
    containment = Containment(RelationalEncoding(plan, epsilon), solver=solver, exporter=exporter)
    return IncrementalRobustification(
        containment, beta=beta, doubling=doubling, order=order, deadline=deadline, on_step=on_step
    ).run()
