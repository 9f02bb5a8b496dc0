"""SMT-first formal verification of temporal plans: validity, robustness envelopes, and why to believe them.

>>> import robust
>>> plan = robust.load_plan("domain.pddl", "problem.pddl", "plan.stn")    # doctest: +SKIP
>>> robust.check(plan).answer                                             # doctest: +SKIP
<Answer.PROVED: 'proved'>
>>> robust.envelope(plan).box                                             # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # true to type checkers; `typing` itself would delay the moment from which Ctrl-C is answered
if TYPE_CHECKING:
    from robust import pike, stnu
    from robust.api import batch, check, compare, envelope, region, repair, risk
    from robust.errors import (
        InputError,
        InputWarning,
        Location,
        RefutedError,
        RobustError,
        SolverError,
        UnsupportedError,
    )
    from robust.execute.convert import Conversion, Mode
    from robust.execute.distances import InvalidPlanError
    from robust.execute.snap import TooFarError
    from robust.execute.validate import Verdict
    from robust.irr.check import Answer, CheckResult, Counterexample
    from robust.irr.compare import Comparison
    from robust.irr.conflicts import RepairStatus
    from robust.irr.repair import Repair
    from robust.irr.search import EnvelopeResult, Step
    from robust.plan.model import ParametrizedPlan
    from robust.presented import Painter, Presented, Presenter
    from robust.probability.distributions import Distribution
    from robust.probability.measure import Bounds
    from robust.probability.risk import RiskResult, RiskStatus
    from robust.qe.box import Box, Interval
    from robust.qe.compute import RegionResult, RegionStatus
    from robust.qe.region import Region
    from robust.reading import convert, load_plan, validate
    from robust.searching import Status
    from robust.show.exports import export
    from robust.sweeps.batch import Batch
    from robust.unified_planning.convert import from_unified_planning, to_unified_planning

__version__ = "0.1.0"

_HOME = {
    "Answer": "robust.irr.check",
    "Batch": "robust.sweeps.batch",
    "Bounds": "robust.probability.measure",
    "Box": "robust.qe.box",
    "CheckResult": "robust.irr.check",
    "Comparison": "robust.irr.compare",
    "Conversion": "robust.execute.convert",
    "Counterexample": "robust.irr.check",
    "Distribution": "robust.probability.distributions",
    "EnvelopeResult": "robust.irr.search",
    "InputError": "robust.errors",
    "InputWarning": "robust.errors",
    "Interval": "robust.qe.box",
    "InvalidPlanError": "robust.execute.distances",
    "Location": "robust.errors",
    "Mode": "robust.execute.convert",
    "ParametrizedPlan": "robust.plan.model",
    "Presented": "robust.presented",
    "RefutedError": "robust.errors",
    "Region": "robust.qe.region",
    "RegionResult": "robust.qe.compute",
    "RegionStatus": "robust.qe.compute",
    "Repair": "robust.irr.repair",
    "RepairStatus": "robust.irr.conflicts",
    "RiskResult": "robust.probability.risk",
    "RiskStatus": "robust.probability.risk",
    "RobustError": "robust.errors",
    "SolverError": "robust.errors",
    "Status": "robust.searching",
    "Step": "robust.irr.search",
    "TooFarError": "robust.execute.snap",
    "UnsupportedError": "robust.errors",
    "Verdict": "robust.execute.validate",
    "batch": "robust.api",
    "check": "robust.api",
    "compare": "robust.api",
    "convert": "robust.reading",
    "envelope": "robust.api",
    "export": "robust.show.exports",
    "from_unified_planning": "robust.unified_planning.convert",
    "load_plan": "robust.reading",
    "region": "robust.api",
    "repair": "robust.api",
    "risk": "robust.api",
    "to_unified_planning": "robust.unified_planning.convert",
    "validate": "robust.reading",
}

__all__ = [
    "Answer",
    "Batch",
    "Bounds",
    "Box",
    "CheckResult",
    "Comparison",
    "Conversion",
    "Counterexample",
    "Distribution",
    "EnvelopeResult",
    "InputError",
    "InputWarning",
    "Interval",
    "InvalidPlanError",
    "Location",
    "Mode",
    "ParametrizedPlan",
    "Presented",
    "RefutedError",
    "Region",
    "RegionResult",
    "RegionStatus",
    "Repair",
    "RepairStatus",
    "RiskResult",
    "RiskStatus",
    "RobustError",
    "SolverError",
    "Status",
    "Step",
    "TooFarError",
    "UnsupportedError",
    "Verdict",
    "__version__",
    "batch",
    "check",
    "compare",
    "convert",
    "envelope",
    "export",
    "from_unified_planning",
    "load_plan",
    "pike",
    "region",
    "repair",
    "risk",
    "stnu",
    "to_unified_planning",
    "validate",
]


def __getattr__(name: str) -> object:
    """Import on first use: starting the command line must not load solvers."""
    if name in {"pike", "stnu"}:
        return import_module(f"robust.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'robust' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def presenter() -> Presenter:
    """What shows results; no result knows it, so that none costs more than itself."""
    from robust.show import presenting  # noqa: PLC0415 - loads what prints

    return presenting


def painter() -> Painter:
    """What draws results."""
    from robust.draw import pictures  # noqa: PLC0415 - loads matplotlib

    return pictures
