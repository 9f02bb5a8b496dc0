"""The state of a simulated world, moved forward from event to event as the model says [docs/semantics.md].

It is a convenience of the simulation: whether a whole execution was valid is for :mod:`robust.plan.simulate` to say.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from robust.plan.model import (
    ActionInstance,
    Assignment,
    Atom,
    Comparison,
    Condition,
    Duration,
    Fluent,
    TimedCondition,
    TimedLiteral,
    Timing,
)
from robust.plan.timeline import Reading, State, leaves


class WorldState:
    """Atoms, fluents and the moment; `flows` are the rates of running instances by their identifier."""

    def __init__(self, atoms: Iterable[Atom], fluents: Mapping[Fluent, Fraction], time: Fraction = Fraction(0)) -> None:
        self.atoms = set(atoms)
        self.fluents = dict(fluents)
        self.time = time
        self.flows: dict[str, tuple[tuple[Fluent, Fraction], ...]] = {}

    def snapshot(self) -> State:
        """A copy that does not change any more."""
        return State(frozenset(self.atoms), dict(self.fluents))

    def advance(self, time: Fraction) -> None:
        """Let time pass: fluents change continuously."""
        if self.flows and time > self.time:
            for flow in self.flows.values():
                for fluent, rate in flow:
                    self.fluents[fluent] += rate * (time - self.time)
        self.time = max(self.time, time)

    def unmet(
        self, instance: ActionInstance, timing: Timing, duration: Fraction | None = None
    ) -> TimedCondition | None:
        """The first condition of an instance, of that timing, that does not hold now.

        Conditions that read `?duration` hold until the duration is known.
        """
        parts = [one for one in instance.conditions if one.timing is timing]
        if duration is None:
            parts = [one for one in parts if not _reads_duration(one.condition)]
        if not parts:
            return None
        reading = self._reading(duration)
        return next((one for one in parts if not reading.holds(one.condition)), None)

    def apply(self, instance: ActionInstance, timing: Timing, duration: Fraction | None = None) -> None:
        """The effects of an instance at one of its time points; all of them read the state before any."""
        reading = self._reading(duration)
        adds = [one for one in instance.atom_effects if one.timing is timing and reading.holds(one.condition)]
        changes = [
            (one, reading.expression(one.expression))
            for one in instance.numeric_effects
            if one.timing is timing and reading.holds(one.condition)
        ]
        self.atoms.difference_update([one.atom for one in adds if not one.value])
        self.atoms.update([one.atom for one in adds if one.value])
        for effect, value in sorted(changes, key=lambda change: change[0].operator is Assignment.INCREASE):
            if effect.operator is Assignment.ASSIGN:
                self.fluents[effect.fluent] = value
            else:
                self.fluents[effect.fluent] = reading.variable(effect.fluent) + value

    def begin_flows(self, instance: ActionInstance, duration: Fraction | None) -> None:
        """Continuous effects set in; their rates stay as they are now."""
        if instance.continuous_effects:
            reading = self._reading(duration)
            flow = tuple((one.fluent, reading.expression(one.rate)) for one in instance.continuous_effects)
            self.flows[instance.identifier] = flow

    def end_flows(self, instance: ActionInstance) -> None:
        self.flows.pop(instance.identifier, None)

    def pass_literal(self, literal: TimedLiteral) -> None:
        """A timed initial literal takes effect."""
        match literal.target:
            case Fluent():
                self.fluents[literal.target] = Fraction(literal.value)
            case atom if literal.value:
                self.atoms.add(atom)
            case atom:
                self.atoms.discard(atom)

    def _reading(self, duration: Fraction | None) -> Reading:
        return Reading(State(frozenset(self.atoms), self.fluents), {}, duration)


def _reads_duration(condition: Condition) -> bool:
    return any(isinstance(leaf, Comparison) and Duration() in leaf.expression.variables for leaf in leaves(condition))
