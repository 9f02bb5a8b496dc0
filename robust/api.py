"""The verbs of the package as functions: check, envelope, region, compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from robust.encode import create_encoding
from robust.encode.interface import EPSILON
from robust.errors import InputError, did_you_mean
from robust.irr.box import Box, EnvelopeResult, Interval, Step
from robust.irr.check import Checker, CheckResult
from robust.irr.compare import Comparing, Comparison
from robust.irr.containment import Containment
from robust.irr.irr import IncrementalRobustification
from robust.irr.methods import ExactSearch
from robust.plan.model import ParametrizedPlan
from robust.qe.compute import RegionResult
from robust.qe.compute import region as _region
from robust.qe.polyhedron import Polyhedron
from robust.smt.export import Exporter
from robust.smt.limits import Deadline, noticing_interrupts


@noticing_interrupts()
def check(
    plan: ParametrizedPlan,
    *,
    at: Mapping[str, Fraction | Interval] | None = None,
    every: bool = False,
    epsilon: Fraction = EPSILON,
    encoding: str = "relational",
    solver: str = "z3",
    timeout: float | None = None,
    smt2: str | Path | None = None,
    on_obligation: Callable[[int, int, str], None] | None = None,
) -> CheckResult:
    """Whether the plan is valid for every schedule that its network allows [docs/semantics.md].

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        at: values, or intervals of values, for parameters; those left out are at their nominal value.
        every: examine all obligations instead of stopping at the first that breaks.
        epsilon: the separation of mutex time points, in the plan's unit of time.
        encoding: `relational` or `positions`.
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
    deadline = Deadline.after(timeout)
    return Checker(
        create_encoding(encoding, plan, epsilon, deadline),
        box,
        solver=solver,
        every=every,
        deadline=deadline,
        exporter=exporter,
        on_obligation=on_obligation,
    ).run()


METHODS = ("widen", "irr", "optimal")


@noticing_interrupts()
def envelope(
    plan: ParametrizedPlan,
    *,
    method: str = "widen",
    beta: Fraction | None = None,
    doubling: bool = False,
    order: Sequence[str] = (),
    contain_nominal: bool = False,
    epsilon: Fraction = EPSILON,
    encoding: str = "relational",
    solver: str = "z3",
    timeout: float | None = None,
    smt2: str | Path | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> EnvelopeResult:
    """A box of parameter values under which the plan stays valid [IRR, Definition 3].

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        method: `widen` (exact: max–min fair, and no valid box contains it), `irr` ([IRR, Algorithm 1]: a search up to
            `beta`) or `optimal` (exact: the greatest Σ weight · width of all boxes).
        beta: for `irr`, the precision in the parameters' units: no face of a complete box can move outwards by it; 1 if
            None.
        doubling: for `irr`, the schedule of the recorded runs (faces up to 2β away).
        order: for `irr`, the turn order of the parameters; for `widen`, parameter by parameter instead of fairly.
        contain_nominal: for `optimal`, only boxes that contain the nominal point.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`.
        timeout: seconds after which the best box so far is returned with status TIMEOUT; None never.
        smt2: a directory to write every query to.
        on_step: called after each step with the best box so far.

    Returns:
        The best box found, inside the envelope if `verified`. It is not if the nominal point itself is outside
        (INVALID), or if time ran out before that was known. Ctrl-C returns the best box so far (INTERRUPTED).

    Raises:
        InputError: wrong options, or no schedule at the nominal point.
        UnsupportedError: an expression that is not linear.
    """
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}{did_you_mean(method, METHODS)}")
    if method != "irr" and (beta is not None or doubling):
        raise InputError(f"found beta or doubling with method {method!r}; expected them with 'irr' only")
    if (contain_nominal and method != "optimal") or (order and method == "optimal"):
        option, owner = ("contain_nominal", "'optimal'") if contain_nominal else ("an order", "'widen' or 'irr'")
        raise InputError(f"found {option} with method {method!r}; expected it with {owner} only")
    deadline = Deadline.after(timeout)
    exporter = Exporter(smt2) if smt2 is not None else None
    formulas = create_encoding(encoding, plan, epsilon, deadline)
    if method == "irr":
        containment = Containment(formulas, solver=solver, exporter=exporter)
        return IncrementalRobustification(
            containment,
            beta=Fraction(1) if beta is None else beta,
            doubling=doubling,
            order=order,
            deadline=deadline,
            on_step=on_step,
        ).run()
    search = ExactSearch(formulas, solver=solver, exporter=exporter, deadline=deadline, on_step=on_step)
    return search.widen(order) if method == "widen" else search.optimal(contain_nominal=contain_nominal)


@noticing_interrupts()
def region(
    plan: ParametrizedPlan,
    *,
    backend: str = "project",
    splitting: str = "full",
    learning: bool = True,
    epsilon: Fraction = EPSILON,
    encoding: str = "relational",
    solver: str = "z3",
    timeout: float | None = None,
    on_piece: Callable[[Polyhedron], None] | None = None,
) -> RegionResult:
    """All parameter values under which the plan is valid, exactly: its robustness envelope [IRR, Definition 2].

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        backend: `project`, `fourier-motzkin`, `loos-weispfenning`, `z3` or `cvc5`.
        splitting: `monolithic`, `partial` or `full`: one elimination problem, two, or one for each obligation.
        learning: tell later problems what earlier ones have excluded.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`, for the queries of our own back ends.
        timeout: seconds after which what has been found is returned with status TIMEOUT; None never.
        on_piece: called with each polyhedron of bad parameter values when it is found.

    Returns:
        The envelope, or, out of time or after Ctrl-C, an outer bound of it.

    Raises:
        InputError: wrong options.
        UnsupportedError: an expression that is not linear, or one that the back end cannot handle.
        SolverError: a solver is not installed.
    """
    return _region(
        plan,
        backend=backend,
        splitting=splitting,
        learning=learning,
        epsilon=epsilon,
        encoding=encoding,
        solver=solver,
        timeout=timeout,
        on_piece=on_piece,
    )


@noticing_interrupts()
def compare(
    plan: ParametrizedPlan,
    *,
    beta: Fraction = Fraction(1),
    epsilon: Fraction = EPSILON,
    encoding: str = "relational",
    solver: str = "z3",
    timeout: float | None = None,
    on_stage: Callable[[str], None] | None = None,
) -> Comparison:
    """The exact envelope beside the boxes of all methods: shares, face gaps with witnesses, times.

    Args:
        plan: the plan, see :func:`robust.plan.load.load_plan`.
        beta: the precision of IRR.
        epsilon: the separation of mutex time points.
        encoding: `relational` or `positions`.
        solver: `z3` or `cvc5`.
        timeout: seconds for all stages, each an equal part of what is left when it begins; None never.
        on_stage: called with the name of each stage.

    Raises:
        InputError: wrong options, or a network without any schedule.
        UnsupportedError: an expression that is not linear.
    """
    return Comparing(
        plan, beta=beta, epsilon=epsilon, encoding=encoding, solver=solver, timeout=timeout, on_stage=on_stage
    ).run()
