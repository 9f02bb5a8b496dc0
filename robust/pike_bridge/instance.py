"""A generated plan with choices: its network, and its action model as PDDL."""

from __future__ import annotations

import os
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from robust.errors import InputError
from robust.pike_bridge.action_model import team_plan_of
from robust.pike_bridge.document import write_tpnu
from robust.pike_bridge.model import EPSILON, TeamPlan, Tpnu


@dataclass(frozen=True, slots=True)
class Instance:
    """What `.tpnu.json` and two PDDL files say together."""

    network: Tpnu
    domain: str
    problem: str

    @property
    def name(self) -> str:
        return self.network.name

    def plan(self, epsilon: Fraction = EPSILON) -> TeamPlan:
        """The plan with the conditions and effects of its activities."""
        return team_plan_of(self.network, self.domain, self.problem, epsilon=epsilon)

    def write(self, directory: str | os.PathLike[str], name: str = "plan") -> Path:
        """Write `NAME.tpnu.json`, `domain.pddl` and `problem.pddl`; the path of the first.

        Raises:
            InputError: if the directory or a file in it cannot be written.
        """
        place = Path(directory)
        try:
            place.mkdir(parents=True, exist_ok=True)
            (place / "domain.pddl").write_text(self.domain, encoding="utf-8")
            (place / "problem.pddl").write_text(self.problem, encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write to {str(place)!r}: {(error.strerror or str(error)).lower()}") from None
        path = place / f"{name}.tpnu.json"
        write_tpnu(path, self.network, domain="domain.pddl", problem="problem.pddl")
        return path
