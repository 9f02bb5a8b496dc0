"""Simple temporal networks with uncertainty, of any tool: are they controllable, how are they executed and repaired?

>>> from robust import stnu
>>> network = stnu.load("network.stnu")              # doctest: +SKIP
>>> stnu.check(network).verdict                      # doctest: +SKIP
<NetworkVerdict.CONTROLLABLE: 'controllable'>
>>> stnu.repair(network).changes                     # doctest: +SKIP
"""

from robust.irr.conflicts import RepairStatus
from robust.qe.box import Side
from robust.stnu.chances import risk
from robust.stnu.files import load, write
from robust.stnu.network import Edge, Link, Network, with_quantile
from robust.stnu.verdicts import DispatchResult, check, dispatch, refutes, repair
from robust.stnu.verdicts import LinkChange as Change
from robust.stnu.verdicts import NetworkCheck as CheckResult
from robust.stnu.verdicts import NetworkExecution as Execution
from robust.stnu.verdicts import NetworkRepair as Repair
from robust.stnu.verdicts import NetworkVerdict as Verdict

__all__ = [
    "Change", "CheckResult", "DispatchResult", "Edge", "Execution", "Link", "Network", "Repair", "RepairStatus", "Side",
    "Verdict", "check", "dispatch", "load", "refutes", "repair", "risk", "with_quantile", "write",
]  # fmt: skip


def __dir__() -> list[str]:
    """What users call, for completion."""
    return __all__
