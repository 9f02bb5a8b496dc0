"""How conditions and expressions read a state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import assert_never

from robust.encode.positions.network import Network
from robust.encode.variables import Linear, variable
from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    ActionInstance,
    And,
    Atom,
    Comparison,
    Condition,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    ParameterReference,
    ParametrizedPlan,
    Truth,
)
from robust.smt.terms import Formula, Terms


@dataclass(frozen=True, slots=True)
class State:
    """The written atoms and fluents that matter at one moment; the others keep their initial values."""

    atoms: Mapping[Atom, Formula]
    fluents: Mapping[Fluent, Linear]


class Reader:
    """Evaluates conditions and expressions of a plan in states."""

    def __init__(self, plan: ParametrizedPlan, network: Network, terms: Terms) -> None:
        self._plan = plan
        self._network = network
        self._terms = terms

    def atom(self, atom: Atom, state: State) -> Formula:
        known = state.atoms.get(atom)
        return self._terms.truth(atom in self._plan.initial_atoms) if known is None else known

    def fluent(self, fluent: Fluent, state: State) -> Linear:
        known = state.fluents.get(fluent)
        return self.initial(fluent) if known is None else known

    def initial(self, fluent: Fluent) -> Linear:
        """The initial value.

        Raises:
            InputError: if there is none.
        """
        if fluent not in self._plan.initial_fluents:
            raise InputError(f"{fluent} has no initial value; expected (= {fluent} NUMBER) in the problem's :init")
        return self._plan.initial_fluents[fluent].substitute(self._parameter)

    @staticmethod
    def _parameter(name: NumericVariable) -> Linear:
        if not isinstance(name, ParameterReference):
            raise TypeError(f"an initial value can only mention parameters, not {name}")
        return variable(name)

    def duration(self, instance: ActionInstance | None) -> Linear:
        if instance is None:
            raise UnsupportedError("?duration has no meaning outside a durative action")
        return self._network.distance(instance.start, instance.end)

    def value(self, expression: Expression, state: State, instance: ActionInstance | None) -> Linear:
        """The value of an expression; `instance` is the one whose `?duration` it mentions."""

        def value(name: NumericVariable) -> Linear:
            match name:
                case Fluent():
                    return self.fluent(name, state)
                case ParameterReference():
                    return variable(name)
                case Duration():
                    return self.duration(instance)
            assert_never(name)

        return expression.substitute(value)

    def holds(
        self,
        condition: Condition,
        state: State,
        instance: ActionInstance | None = None,
        leaf: Callable[[Comparison], Formula | None] = lambda _: None,
    ) -> Formula:
        """The truth of a condition; where `leaf` returns a formula, it stands for that comparison's truth."""
        match condition:
            case Truth(value):
                return self._terms.truth(value)
            case Holds(atom, value):
                truth = self.atom(atom, state)
                return truth if value else self._terms.negation(truth)
            case Comparison(expression, relation):
                replaced = leaf(condition)
                if replaced is not None:
                    return replaced
                return self._terms.compare(self.value(expression, state, instance), relation)
            case And(operands):
                return self._terms.conjunction(self.holds(part, state, instance, leaf) for part in operands)
            case Or(operands):
                return self._terms.disjunction(self.holds(part, state, instance, leaf) for part in operands)
        assert_never(condition)


def comparisons(condition: Condition) -> Iterator[Comparison]:
    """The comparisons in a condition, each as often as it occurs."""
    pending = [condition]
    while pending:
        node = pending.pop()
        match node:
            case And(operands) | Or(operands):
                pending.extend(operands)
            case Comparison():
                yield node
            case Holds() | Truth():
                pass
            case _:
                assert_never(node)


def fluents_of(expression: Expression) -> Iterator[Fluent]:
    """The fluents that an expression mentions."""
    return (name for name in expression.variables if isinstance(name, Fluent))
