"""What the solvers were asked, and what it cost."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Statistics:
    """Counts over all sessions that share it: queries by verdict, seconds in solvers, nodes of asserted formulas."""

    queries: int = 0
    satisfiable: int = 0
    unsatisfiable: int = 0
    unknown: int = 0
    seconds: float = 0.0
    nodes: int = 0

    def as_dict(self) -> dict[str, float | int]:
        return {
            "queries": self.queries,
            "satisfiable": self.satisfiable,
            "unsatisfiable": self.unsatisfiable,
            "unknown": self.unknown,
            "seconds": round(self.seconds, 6),
            "nodes": self.nodes,
        }
