"""Simple temporal networks with uncertainty, of any tool: are they controllable, how are they executed and repaired?

>>> from robust import stnu
>>> network = stnu.load("network.stnu")              # doctest: +SKIP
>>> stnu.check(network).verdict                      # doctest: +SKIP
<NetworkVerdict.CONTROLLABLE: 'controllable'>
>>> stnu.repair(network).changes                     # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robust.irr.conflicts import RepairStatus
    from robust.qe.box import Side
    from robust.stnu.files import load, write
    from robust.stnu.network import Edge, Link, Network
    from robust.stnu.repairs import LinkChange as Change
    from robust.stnu.repairs import NetworkRepair as Repair
    from robust.stnu.repairs import repair
    from robust.stnu.verdicts import DispatchResult, check, dispatch, refutes
    from robust.stnu.verdicts import NetworkCheck as CheckResult
    from robust.stnu.verdicts import NetworkExecution as Execution
    from robust.stnu.verdicts import NetworkVerdict as Verdict

_HOME = {
    "Change": "robust.stnu.repairs:LinkChange",
    "CheckResult": "robust.stnu.verdicts:NetworkCheck",
    "DispatchResult": "robust.stnu.verdicts",
    "Edge": "robust.stnu.network",
    "Execution": "robust.stnu.verdicts:NetworkExecution",
    "Link": "robust.stnu.network",
    "Network": "robust.stnu.network",
    "Repair": "robust.stnu.repairs:NetworkRepair",
    "RepairStatus": "robust.irr.conflicts",
    "Side": "robust.qe.box",
    "Verdict": "robust.stnu.verdicts:NetworkVerdict",
    "check": "robust.stnu.verdicts",
    "dispatch": "robust.stnu.verdicts",
    "load": "robust.stnu.files",
    "refutes": "robust.stnu.verdicts",
    "repair": "robust.stnu.repairs",
    "write": "robust.stnu.files",
}

__all__ = [
    "Change",
    "CheckResult",
    "DispatchResult",
    "Edge",
    "Execution",
    "Link",
    "Network",
    "Repair",
    "RepairStatus",
    "Side",
    "Verdict",
    "check",
    "dispatch",
    "load",
    "refutes",
    "repair",
    "write",
]


def __getattr__(name: str) -> object:
    """Import on first use: a verdict needs no solver."""
    if name not in _HOME:
        raise AttributeError(f"module 'robust.stnu' has no attribute {name!r}")
    module, _, own_name = _HOME[name].partition(":")
    return getattr(import_module(module), own_name or name)
