"""enc_eff, and the violations of conditions, duration constraints that read the state, and goals over it [IRR §2]."""

from __future__ import annotations

from robust.encode.positions.definitions import Definitions
from robust.encode.positions.flows import Flows
from robust.encode.positions.network import KnownOrder, Network
from robust.encode.positions.order import Positions
from robust.encode.positions.overall import OverAll
from robust.encode.positions.reading import Reader
from robust.encode.positions.trajectory import Trajectory
from robust.encode.positions.writes import Writes
from robust.plan.model import (
    ActionInstance,
    DurationConstraint,
    GoalCondition,
    ParametrizedPlan,
    TimedCondition,
    Timing,
)
from robust.smt.limits import Deadline
from robust.smt.terms import Formula

Part = TimedCondition | DurationConstraint | GoalCondition
"""What is proved: each is an obligation."""


class Semantics:
    """Positions, states at them, and what it means that a part of the plan fails there.

    Raises:
        OutOfTimeError: if the deadline passes.
    """

    def __init__(
        self,
        *,
        plan: ParametrizedPlan,
        network: Network,
        known: KnownOrder,
        writes: Writes,
        definitions: Definitions,
        deadline: Deadline,
    ) -> None:
        self._terms = definitions.terms
        self._reader = Reader(plan, network, self._terms)
        self.positions = Positions(network, known, self._terms)
        flows = Flows(
            network=network,
            known=known,
            positions=self.positions,
            writes=writes,
            reader=self._reader,
            definitions=definitions,
        )
        self._trajectory = Trajectory(
            plan=plan,
            positions=self.positions,
            flows=flows,
            writes=writes,
            reader=self._reader,
            definitions=definitions,
            deadline=deadline,
        )
        self._overall = OverAll(
            network=network,
            positions=self.positions,
            flows=flows,
            writes=writes,
            reader=self._reader,
            trajectory=self._trajectory,
            terms=self._terms,
        )

    def violation(self, part: Part, instance: ActionInstance | None, deadline: Deadline) -> Formula:
        """The negation of one obligation; `instance` is the part's, a goal has none."""
        if instance is None or isinstance(part, GoalCondition):
            return self._terms.negation(self._reader.holds(part.condition, self._trajectory.final))
        if isinstance(part, TimedCondition) and part.timing is Timing.OVER_ALL:
            return self._overall.violation(instance, part.condition, deadline)
        point, positions = instance.at(part.timing), self.positions
        return self._terms.disjunction(
            self._terms.conjunction(
                (positions.at(point, k), self._terms.negation(self._reader.holds(part.condition, before, instance)))
            )
            for k, before in enumerate(self._trajectory.before)
            if k > 0 and point in positions.candidates(k)
        )
