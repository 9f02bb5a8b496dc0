"""The models of an augmented plan, by a formula of its own over all its variables and times; for tests only."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import z3

from robust.pike_bridge.causal import AugmentedPlan
from robust.pike_bridge.model import Guard
from robust.pike_bridge.semantics import Execution
from robust.pike_bridge.theory import All, Formula, Is, Not, Some
from tests.pike_bridge.networks import holds, scenarios


class AugmentedModels:
    """What satisfies the theory and gives the augmented network a schedule: φ′_S of [PIKE, Theorem 4.6]."""

    def __init__(self, augmented: AugmentedPlan) -> None:
        self.augmented = augmented
        self.context = z3.Context()
        self.solver = z3.Solver(ctx=self.context)
        network = augmented.network
        self.values = {
            (choice.name, value): z3.Bool(f"{choice.name}={value}", self.context)
            for choice in network.choices
            for value in choice.domain
        }
        self.times = {event.name: z3.Real(event.name, self.context) for event in network.events}
        for choice in network.choices:
            literals = [(self.values[choice.name, value], 1) for value in choice.domain]
            self.solver.add(z3.PbEq(literals, 1, self.context))
        for constraint in network.temporal_constraints:
            difference = self.times[constraint.target] - self.times[constraint.source]
            if constraint.lower is not None:
                self._if(constraint.guard, difference >= self._number(constraint.lower))
            if constraint.upper is not None:
                self._if(constraint.guard, difference <= self._number(constraint.upper))
        for formula in augmented.theory.constraints:
            self.solver.add(self._formula(formula))
        for conflict in augmented.theory.conflicts:
            self._if(conflict, z3.BoolVal(False, self.context))

    def extend(self, scenario: Mapping[str, str], schedule: Mapping[str, Fraction] | None = None) -> Execution | None:
        """Some execution of the augmented plan that extends a scenario of the original, perhaps with given times."""
        self.solver.push()
        self.solver.add(self._guard(frozenset(scenario.items())))
        for event, time in (schedule or {}).items():
            self.solver.add(self.times[event] == self._number(time))
        found = self._execution() if self.solver.check() == z3.sat else None
        self.solver.pop()
        return found

    def projections(self) -> set[frozenset[tuple[str, str]]]:
        """The scenarios of the original plan that have a model."""
        domains = self.augmented.plan.network.domains
        return {frozenset(each.items()) for each in scenarios(domains) if self.extend(each) is not None}

    def _execution(self) -> Execution:
        model = self.solver.model()
        scenario = {
            name: value
            for (name, value), symbol in self.values.items()
            if z3.is_true(model.eval(symbol, model_completion=True))
        }
        times = {
            event.name: model.eval(self.times[event.name], model_completion=True).as_fraction()
            for event in self.augmented.network.events
            if holds(event.guard, scenario)
        }
        return Execution(scenario, {name: Fraction(time) for name, time in times.items()})

    def _if(self, guard: Guard, consequence: z3.BoolRef) -> None:
        self.solver.add(z3.Implies(self._guard(guard), consequence, self.context))

    def _guard(self, guard: Guard) -> z3.BoolRef:
        return z3.And([z3.BoolVal(True, self.context), *(self.values[tuple(each)] for each in guard)])

    def _number(self, number: Fraction) -> z3.ArithRef:
        return z3.RealVal(str(number), self.context)

    def _formula(self, formula: Formula) -> z3.BoolRef:
        match formula:
            case Is(assignment):
                return self.values[tuple(assignment)]
            case Not(operand):
                return z3.Not(self._formula(operand), self.context)
            case All(operands):
                return z3.And([z3.BoolVal(True, self.context), *map(self._formula, operands)])
            case Some(operands):
                return z3.Or([z3.BoolVal(False, self.context), *map(self._formula, operands)])
