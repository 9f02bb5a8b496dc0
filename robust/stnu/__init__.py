"""Simple temporal networks with uncertainty, of any tool: are they controllable, how are they executed and repaired?

>>> from robust import stnu
>>> network = stnu.load("network.stnu")              # doctest: +SKIP
>>> stnu.check(network).verdict                      # doctest: +SKIP
<Verdict.CONTROLLABLE: 'controllable'>
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
    from robust.stnu.repairs import Change, Repair, repair
    from robust.stnu.verdicts import CheckResult, DispatchResult, Execution, Verdict, check, dispatch, refutes

_HOME = {
    "Change": "robust.stnu.repairs",
    "CheckResult": "robust.stnu.verdicts",
    "DispatchResult": "robust.stnu.verdicts",
    "Edge": "robust.stnu.network",
    "Execution": "robust.stnu.verdicts",
    "Link": "robust.stnu.network",
    "Network": "robust.stnu.network",
    "Repair": "robust.stnu.repairs",
    "RepairStatus": "robust.irr.conflicts",
    "Side": "robust.qe.box",
    "Verdict": "robust.stnu.verdicts",
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
    return getattr(import_module(_HOME[name]), name)
