"""SMT-first formal verification of temporal plans: validity, robustness envelopes, and why to believe them.

>>> import robust
>>> plan = robust.load_plan("domain.pddl", "problem.pddl", "plan.stn")    # doctest: +SKIP
>>> robust.check(plan).answer                                             # doctest: +SKIP
<Answer.PROVED: 'proved'>
>>> robust.envelope(plan).box                                             # doctest: +SKIP

Domain, problem and plan are paths or texts; a plan may be what a planner prints.
Plans: load_plan, convert, validate, export, read_tree, make_tree, from_unified_planning, to_unified_planning.
Questions about one: check, envelope, region, compare, repair, risk; about several: rank, batch.
From runs, and while one goes on: learn, Monitor, replan.
Plans with choices are in robust.pike, networks with uncertainty in robust.stnu.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # true to type checkers; `typing` itself would delay the moment from which Ctrl-C is answered
if TYPE_CHECKING:
    from robust import pike, stnu
    from robust.api import batch, check, compare, envelope, learn, rank, region, repair, risk
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
    from robust.execute.forecast import Prospect
    from robust.execute.learned import Learned
    from robust.execute.messages import MessageKind, MonitorMessage
    from robust.execute.monitor import Monitor, Outlook
    from robust.execute.remaining import MonitorState
    from robust.execute.situation import NewPlan, NoPlanError, RunningStep, RunState
    from robust.execute.snap import TooFarError
    from robust.execute.tree_writer import MadeTree, make_tree
    from robust.execute.trees import BehaviorTree, read_tree
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
    from robust.reading import convert, load_plan, replan, validate
    from robust.searching import Status
    from robust.show.exports import export
    from robust.sweeps.batch import Batch
    from robust.sweeps.rank import Ranking
    from robust.unified_planning.convert import from_unified_planning, to_unified_planning

__version__ = "0.1.0"

_NAMES = {
    "robust.api": "batch check compare envelope learn rank region repair risk",
    "robust.errors": "InputError InputWarning Location RefutedError RobustError SolverError UnsupportedError",
    "robust.execute.convert": "Conversion Mode",
    "robust.execute.distances": "InvalidPlanError",
    "robust.execute.learned": "Learned",
    "robust.execute.forecast": "Prospect",
    "robust.execute.messages": "MessageKind MonitorMessage",
    "robust.execute.monitor": "Monitor Outlook",
    "robust.execute.remaining": "MonitorState",
    "robust.execute.situation": "NewPlan NoPlanError RunningStep RunState",
    "robust.execute.snap": "TooFarError",
    "robust.execute.tree_writer": "MadeTree make_tree",
    "robust.execute.trees": "BehaviorTree read_tree",
    "robust.execute.validate": "Verdict",
    "robust.irr.check": "Answer CheckResult Counterexample",
    "robust.irr.compare": "Comparison",
    "robust.irr.conflicts": "RepairStatus",
    "robust.irr.repair": "Repair",
    "robust.irr.search": "EnvelopeResult Step",
    "robust.plan.model": "ParametrizedPlan",
    "robust.presented": "Presented",
    "robust.probability.distributions": "Distribution",
    "robust.probability.measure": "Bounds",
    "robust.probability.risk": "RiskResult RiskStatus",
    "robust.qe.box": "Box Interval",
    "robust.qe.compute": "RegionResult RegionStatus",
    "robust.qe.region": "Region",
    "robust.reading": "convert load_plan replan validate",
    "robust.searching": "Status",
    "robust.show.exports": "export",
    "robust.sweeps.batch": "Batch",
    "robust.sweeps.rank": "Ranking",
    "robust.unified_planning.convert": "from_unified_planning to_unified_planning",
}
"""Public names by the module that they are from."""
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = [
    "Answer", "Batch", "BehaviorTree", "Bounds", "Box", "CheckResult", "Comparison", "Conversion", "Counterexample",
    "Distribution", "EnvelopeResult", "InputError", "InputWarning", "Interval", "InvalidPlanError", "Learned",
    "Location", "MadeTree", "MessageKind", "Mode", "Monitor", "MonitorMessage", "MonitorState", "NewPlan",
    "NoPlanError", "Outlook", "ParametrizedPlan", "Presented", "Prospect", "Ranking", "RefutedError", "Region",
    "RegionResult", "RegionStatus", "Repair", "RepairStatus", "RiskResult", "RiskStatus", "RobustError", "RunState",
    "RunningStep", "SolverError", "Status", "Step", "TooFarError", "UnsupportedError", "Verdict", "__version__",
    "batch", "check", "compare", "convert", "envelope", "export", "from_unified_planning", "learn", "load_plan",
    "make_tree", "pike", "rank", "read_tree", "region", "repair", "replan", "risk", "stnu", "to_unified_planning",
    "validate",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Import on first use: starting the command line must not load solvers."""
    if name in {"pike", "stnu"}:
        return import_module(f"robust.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'robust' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """What users call, for completion and `help`."""
    return sorted(__all__)


def presenter() -> Presenter:
    """What shows results; no result knows it, so that none costs more than itself."""
    from robust.show import presenting  # noqa: PLC0415 - loads what prints

    return presenting


def painter() -> Painter:
    """What draws results."""
    from robust.draw import pictures  # noqa: PLC0415 - loads matplotlib

    return pictures
