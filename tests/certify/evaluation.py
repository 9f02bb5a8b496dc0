"""What the checker's formulas say of single schedules, where times and parameters are free in the formulas.

In a certificate the checker's formulas are about all schedules at once, so that they hold conditions, cases and orders
that are constant where the times are given. Here they are evaluated without any solver, for schedules of which the
simulator knows what they break.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import pairwise
from typing import Any

from robust.plan.model import ParametrizedPlan, TimePoint
from tests.certify import tools
from tests.certify.tools import CHECKER, Checker
from tests.sampling import Network

Values = dict[str, Fraction]


class UndefinedError(Exception):
    """No value of an auxiliary name is as its definition says."""


class Evaluation:
    """Truth of literals at values of the free names; those of auxiliary names follow from their definitions."""

    def __init__(self, formulas: Any, values: Mapping[str, Fraction]) -> None:
        self.formulas, self.values = formulas, dict(values)
        self.truths: dict[int, bool] = {}

    def true(self, literal: int) -> bool:
        number = abs(literal)
        if number not in self.truths:
            node = self.formulas.circuit.nodes[number]
            if self.formulas.circuit.is_gate(number):
                self.truths[number] = all(map(self.true, node))
            else:
                strict, terms = node
                level = sum((factor * self.value(name) for name, factor in terms), Fraction(0))
                self.truths[number] = level > 0 or (level == 0 and not strict)
        return self.truths[number] == (literal > 0)

    def value(self, name: str) -> Fraction:
        if name and name not in self.values:
            for candidate in self._candidates(name):
                trial = Evaluation(self.formulas, {**self.values, name: candidate})
                if all(map(trial.true, self.formulas.definitions[name])):
                    self.values[name] = candidate
                    break
            else:
                raise UndefinedError(name)
        return self.values[name] if name else Fraction(1)

    def _candidates(self, name: str) -> Iterator[Fraction]:
        """What the name is if a comparison of its definition is an equation."""
        waiting, seen = [abs(each) for each in self.formulas.definitions[name]], set[int]()
        while waiting:
            number = waiting.pop()
            if number in seen:
                continue
            seen.add(number)
            node = self.formulas.circuit.nodes[number]
            if self.formulas.circuit.is_gate(number):
                waiting += map(abs, node)
            elif name in dict(node[1]):
                rest = sum((factor * self.value(each) for each, factor in node[1] if each != name), Fraction(0))
                yield -rest / dict(node[1])[name]


def free_formulas(ground: Any, plan: ParametrizedPlan, parameters: Values | None, by: Checker = CHECKER) -> Any:
    """Formulas over all times and parameters; with parameters also with all orders that the network then implies."""
    formulas = by.formulas.Formulas(ground, tools.EPSILON)
    if parameters is not None:
        network = Network(plan, parameters)
        for a, row in enumerate(network.distances):
            for b, most in enumerate(row):
                if most is not None and a != b:  # t_b - t_a is at most that
                    formulas.known[b, a] = Fraction(-most, network.scale)
    return formulas


def broken_freely(
    formulas: Any, plan: ParametrizedPlan, parameters: Values, schedule: Mapping[TimePoint, Fraction]
) -> tuple[set[str], set[str]]:
    """Labels of the obligations that the schedule breaks; and of those that it may break at instants not looked at."""
    times = {f"@{number}": schedule[point] for number, point in enumerate(plan.time_points) if number}
    happenings = sorted({Fraction(0), *schedule.values()})
    found, open_ones = set[str](), set[str]()
    for number, (label, make) in enumerate(formulas.obligations()):
        literal, instant = make(), f"!{number}"
        if instant in formulas.instants:
            open_ones.add(label)
            between = [(low + high) / 2 for low, high in pairwise(happenings)]
            places = [*happenings, *between]
        else:
            places = [Fraction(0)]
        evaluations = (Evaluation(formulas, {**parameters, **times, instant: place}) for place in places)
        if any(each.true(literal) for each in evaluations):
            found.add(label)
    return found, open_ones - found
