"""Continuous change over the steps between positions.

In each step a fluent changes by the rates of the continuous effects that act in it, times the step's length. Rates are
numbers; with a rate over parameters the product is linear only where the time since the effect's start is a number.
"""

from __future__ import annotations

from functools import cache

from robust.encode.positions.definitions import Case, Definitions
from robust.encode.positions.network import KnownOrder, Network
from robust.encode.positions.order import Positions
from robust.encode.positions.reading import Reader, State, fluents_of
from robust.encode.positions.writes import Flow, Writes
from robust.encode.variables import Linear, constant
from robust.errors import UnsupportedError
from robust.plan.model import ActionInstance, Fluent
from robust.smt.terms import Formula, Terms


class Flows:
    """What continuous effects contribute, step by step; step k leads from position k to position k + 1."""

    def __init__(
        self,
        *,
        network: Network,
        known: KnownOrder,
        positions: Positions,
        writes: Writes,
        reader: Reader,
        definitions: Definitions,
    ) -> None:
        self._network = network
        self._known = known
        self._positions = positions
        self._writes = writes
        self._reader = reader
        self._definitions = definitions
        self._terms: Terms = definitions.terms
        self._rate = cache(self._rate_of)
        self._sofar = cache(self._sofar_at)

    def acts(self, instance: ActionInstance, step: int) -> Formula:
        """Whether a step lies between start and end of an instance."""
        ended = self._positions.by(instance.end, step)
        return self._terms.conjunction((self._positions.by(instance.start, step), self._terms.negation(ended)))

    def over_step(self, fluent: Fluent, step: int) -> Linear:
        """By how much a fluent changes in a step."""
        total = constant(0)
        for flow in self._writes.flows.get(fluent, ()):
            acts = self.acts(flow.instance, step)
            if acts is not self._terms.false:
                name = f"{flow.instance.identifier} {fluent} in step {step}"
                total += self._definitions.if_at_all(name, acts, self._contribution(flow, step))
        return total

    def until(self, fluent: Fluent, step: int, instant: Linear) -> Linear:
        """By how much a fluent changes from the beginning of a step until an instant inside it."""
        total = constant(0)
        for flow in self._writes.flows.get(fluent, ()):
            acts = self.acts(flow.instance, step)
            if acts is not self._terms.false:
                amount = self._product(flow, instant - self._positions.time(step))
                name = f"{flow.instance.identifier} {fluent} in step {step} until {instant}"
                total += self._definitions.if_at_all(name, acts, amount)
        return total

    def _contribution(self, flow: Flow, step: int) -> Linear:
        if self._rate(flow).is_constant:
            length = self._positions.time(step + 1) - self._positions.time(step)
            return self._product(flow, length)
        return self._sofar(flow, step + 1) - self._sofar(flow, step)

    def _sofar_at(self, flow: Flow, position: int) -> Linear:
        """Rate times the time since the start, at a position from the start's to the end's; anything at others."""
        start, end = flow.instance.start, flow.instance.end
        cases: list[Case] = []
        for point in self._positions.candidates(position):
            if not (self._known.is_before(point, start) or self._known.is_before(end, point)):
                amount = self._product(flow, self._network.distance(start, point))
                cases.append((self._positions.at(point, position), amount))
        name = f"{flow.instance.identifier} {flow.effect.fluent} until position {position}"
        return cases[0][1] if len(cases) == 1 else self._definitions.partial(name, cases)

    def _product(self, flow: Flow, time: Linear) -> Linear:
        amount = self._rate(flow) * time
        if not amount.is_linear:
            raise UnsupportedError(
                f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                f"{flow.effect.fluent}: rate {flow.effect.rate} times an elapsed time that is not constant; "
                "expected a constant rate, or a fixed schedule"
            )
        return amount

    def _rate_of(self, flow: Flow) -> Linear:
        for fluent in fluents_of(flow.effect.rate):
            if self._writes.changes(fluent):
                raise UnsupportedError(
                    f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                    f"{flow.effect.fluent}: its rate reads {fluent}, which the plan changes; expected a constant rate"
                )
        return self._reader.value(flow.effect.rate, State({}, {}), flow.instance)
