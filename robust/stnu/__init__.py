"""Simple temporal networks with uncertainty, of any tool: are they controllable, how are they executed and repaired?

>>> from robust import stnu
>>> network = stnu.load("network.stnu")              # doctest: +SKIP
>>> stnu.check(network).verdict                      # doctest: +SKIP
<Verdict.CONTROLLABLE: 'controllable'>
>>> stnu.repair(network).changes                     # doctest: +SKIP
"""

from __future__ import annotations

from robust.stnu.check import CheckResult, Verdict, check, refutes
from robust.stnu.dispatch import DispatchResult, Execution, dispatch
from robust.stnu.files import load, write
from robust.stnu.network import Edge, Link, Network, Side
from robust.stnu.repair import Change, Repair, RepairStatus, repair

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
