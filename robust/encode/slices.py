"""The independent parts of a conjunction of inequalities."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from robust.encode.variables import Linear
from robust.smt.terms import Formula, Terms


class Slices:
    """A conjunction of `expression ≥ 0` split into parts that share no unknown."""

    def __init__(self, terms: Terms, expressions: Iterable[Linear]) -> None:
        self._terms = terms
        self._leader: dict[str, str] = {}
        expressions = list(dict.fromkeys(expressions))
        for expression in expressions:
            names = [str(unknown) for unknown in expression.variables]
            for name in names:
                self._join(names[0], name)
        self._parts: dict[str, list[Formula]] = defaultdict(list)
        for expression in expressions:
            formula = terms.at_least(expression)
            name = next((str(unknown) for unknown in expression.variables), "")
            self._parts[self._find(name)].append(formula)

    def touching(self, formulas: Iterable[Formula]) -> list[Formula]:
        """The inequalities of every part that shares an unknown with the formulas, and those without unknowns."""
        names = {symbol.symbol_name() for formula in formulas for symbol in self._terms.variables(formula)}
        leaders = dict.fromkeys([self._find(""), *(self._find(name) for name in sorted(names))])
        return [formula for leader in leaders for formula in self._parts.get(leader, ())]

    def _find(self, name: str) -> str:
        while (leader := self._leader.get(name, name)) != name:
            self._leader[name] = self._leader.get(leader, leader)
            name = leader
        return name

    def _join(self, left: str, right: str) -> None:
        self._leader[self._find(left)] = self._find(right)
