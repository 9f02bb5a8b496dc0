"""Answers for programs: what `--json` prints. The schemas are in :mod:`robust.report.schemas`.

Rationals are strings (`"1/3"`), unbounded ends `"inf"` and `"-inf"`; seconds and shares are JSON numbers.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.errors import RobustError
from robust.report.numbers import exact_end

if TYPE_CHECKING:
    from robust.irr.box import EnvelopeResult, Interval
    from robust.irr.check import CheckResult, Counterexample

ENVELOPE = "robust/envelope/1"
CHECK = "robust/check/1"
ERROR = "robust/error/1"


def check_answer(
    result: CheckResult, encoding: str = "relational", *, solver: str, epsilon: Fraction, timed_out: bool
) -> dict[str, Any]:
    """`robust/check/1`; `counterexample` is the first, `counterexamples` are all that were found."""
    found = [counterexample_answer(one) for one in result.counterexamples.values()]
    return {
        "schema": CHECK,
        "verdict": result.answer.value,
        "encoding": encoding,
        "solver": solver,
        "epsilon": str(epsilon),
        "parameters": {name: _interval(interval) for name, interval in result.box.intervals.items()},
        "obligations": [{"name": name, "verdict": answer.value} for name, answer in result.obligations.items()],
        "counterexample": found[0] if found else None,
        "counterexamples": found,
        "reason": result.reason,
        "interrupted": result.interrupted and not timed_out,
        "timeout": timed_out,
        "seconds": round(result.seconds, 6),
        "statistics": result.statistics.as_dict(),
    }


def envelope_answer(result: EnvelopeResult, counterexample: Counterexample | None = None) -> dict[str, Any]:
    """`robust/envelope/1`; `counterexample` shows what breaks at the nominal point if the status is invalid."""
    nominal = {parameter.name: parameter.nominal for parameter in result.parameters}
    return {
        "schema": ENVELOPE,
        "status": result.status.value,
        "verified": result.verified,
        "method": result.method,
        "encoding": result.encoding,
        "solver": result.solver,
        "beta": None if result.beta is None else str(result.beta),
        "bound": None if result.bound is None else str(result.bound),
        "parameters": {
            name: {"nominal": str(nominal[name]), **_interval(interval)}
            for name, interval in result.box.intervals.items()
        },
        "checks": result.checks,
        "unbounded_checks": result.unbounded_checks,
        "first_widening_s": _rounded(result.first_widening_seconds),
        "seconds": round(result.seconds, 6),
        "reason": result.reason,
        "values": {name: str(value) for name, value in result.values.items()},
        "counterexample": None if counterexample is None else counterexample_answer(counterexample),
        "convergence": _convergence(result),
        "statistics": result.statistics.as_dict(),
    }


def counterexample_answer(found: Counterexample) -> dict[str, Any]:
    """Parameter values, a schedule, what it breaks, and the states that it passes through."""
    simulation = found.simulation
    return {
        "obligation": found.obligation,
        "parameters": {name: str(value) for name, value in found.parameters.items()},
        "schedule": {str(point): str(time) for point, time in found.schedule.items()},
        "violations": [
            {"obligation": one.obligation, "time": str(one.time), "detail": one.detail} for one in simulation.violations
        ],
        "trace": [
            {
                "time": str(step.time),
                "happenings": [str(point) for point in step.points],
                "atoms": {str(atom): value for atom, value in step.atoms_changed},
                "fluents": {str(fluent): str(value) for fluent, value in step.fluents.items()},
            }
            for step in simulation.trace
        ],
    }


def error_answer(error: RobustError, kind: str, exit_code: int) -> dict[str, Any]:
    """`robust/error/1`: there is no answer; `kind` says why."""
    place = error.location
    return {
        "schema": ERROR,
        "error": {
            "kind": kind,
            "message": error.message,
            "file": place.file if place else None,
            "line": place.line if place else None,
            "column": place.column if place else None,
            "exit_code": exit_code,
        },
    }


def _interval(interval: Interval) -> dict[str, Any]:
    return {
        "lower": exact_end(interval.lower, upper=False),
        "upper": exact_end(interval.upper, upper=True),
        "lower_closed": interval.lower is not None and interval.lower_closed,
        "upper_closed": interval.upper is not None and interval.upper_closed,
    }


def _convergence(result: EnvelopeResult) -> list[dict[str, Any]]:
    """Total width after each check as a share of the final one [IRR §5]; empty if that is zero or infinite."""
    seconds = {step.check: step.seconds for step in result.trace}
    return [
        {"check": check, "seconds": round(seconds[check], 6), "share": round(float(share), 6)}
        for check, share in result.convergence()
    ]


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 6)
