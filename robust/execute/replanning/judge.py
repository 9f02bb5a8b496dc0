"""What really happened, judged by the concrete simulator: one plan of all that was executed, on the original problem.

It shares nothing with the world that simulated the run but the values that were drawn and the times.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.execute.worlds.world import Executed, Outcome
from robust.plan.model import ActionInstance, Fluent, GoalCondition, ParametrizedPlan, TimedLiteral, TimePoint, Timing
from robust.plan.model import Atom as _Atom
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Simulation, simulate


@dataclass(frozen=True)
class Beginning:
    """Where a run began, and what it was for."""

    atoms: frozenset[_Atom]
    fluents: Mapping[Fluent, Fraction]
    literals: tuple[TimedLiteral, ...]
    goal: tuple[GoalCondition, ...]


def judged(beginning: Beginning, executed: Sequence[Executed], epsilon: Fraction) -> Simulation:
    """The execution of everything that was executed, at the times at which it was.

    Durations that were not the dispatcher's to choose are facts, and break no duration constraint. An instance that
    failed or was stopped has its effects at the start, and continuous ones until it ended, and no conditions.
    """
    instances: list[ActionInstance] = []
    schedule: dict[TimePoint, Fraction] = {}
    for number, one in enumerate(executed):
        instance = _as_it_was(one, f"{number}.{one.instance.identifier}")
        instances.append(instance)
        schedule[instance.start] = one.start
        if instance.durative:
            schedule[instance.end] = one.start if one.end is None else one.end
    plan = ParametrizedPlan(
        name="execution",
        parameters=(),
        instances=tuple(instances),
        constraints=(),
        initial_atoms=beginning.atoms,
        initial_fluents={fluent: Polynomial.constant(value) for fluent, value in beginning.fluents.items()},
        timed_literals=beginning.literals,
        goal=beginning.goal,
    )
    return simulate(plan, {}, schedule, epsilon=epsilon)


def _as_it_was(one: Executed, identifier: str) -> ActionInstance:
    instance = replace(one.instance, identifier=identifier)
    if one.natural:
        instance = replace(instance, durations=())
    if one.outcome is Outcome.DONE:
        return instance
    return replace(
        instance,
        durations=(),
        conditions=(),
        atom_effects=tuple(effect for effect in instance.atom_effects if effect.timing is Timing.AT_START),
        numeric_effects=tuple(effect for effect in instance.numeric_effects if effect.timing is Timing.AT_START),
    )
