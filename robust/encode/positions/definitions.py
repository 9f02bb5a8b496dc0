"""Names for parts of formulas: state variables and other symbols that a definition fixes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robust.encode.variables import Auxiliary, Linear, constant, variable
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms

Case = tuple[Formula, Linear]
"""A value, and when it applies."""


class Definitions:
    """Symbols with the formulas that fix them; whoever asserts a symbol asserts :meth:`needed_by` as well."""

    def __init__(self, terms: Terms) -> None:
        self.terms = terms
        self._definition: dict[Formula, Formula] = {}
        self._count = 0

    def truth(self, name: str, formula: Formula) -> Formula:
        """A Boolean symbol for the formula, unless it is a literal or constant already."""
        atom = self.terms.negation(formula) if formula.is_not() else formula
        if atom.is_symbol() or atom.is_bool_constant():
            return formula
        symbol = self.terms.fresh_boolean(f"[{name}] ")
        self._definition[symbol] = self.terms.equivalence(symbol, formula)
        return symbol

    def choice(self, name: str, cases: Iterable[Case]) -> Linear:
        """The value of the case that applies; exactly one does. A new symbol unless the value is known."""
        open_cases = [(condition, value) for condition, value in cases if condition is not self.terms.false]
        for condition, value in open_cases:
            if condition is self.terms.true:
                return value
        values = {value for _, value in open_cases}
        return values.pop() if len(values) == 1 else self.partial(name, open_cases)

    def partial(self, name: str, cases: Iterable[Case]) -> Linear:
        """A new symbol that has the value of each case that applies."""
        self._count += 1
        result = variable(Auxiliary(name, self._count))
        equations = (self.terms.implication(c, self.terms.equal(result - value)) for c, value in cases)
        self._definition[self.terms.real(Auxiliary(name, self._count))] = self.terms.conjunction(equations)
        return result

    def if_else(self, name: str, condition: Formula, value: Linear, otherwise: Linear) -> Linear:
        return self.choice(name, [(condition, value), (self.terms.negation(condition), otherwise)])

    def if_at_all(self, name: str, condition: Formula, value: Linear) -> Linear:
        """The value if the condition holds, else zero."""
        return self.if_else(name, condition, value, constant(0))

    def needed_by(self, formulas: Iterable[Formula], deadline: Deadline) -> Iterator[Formula]:
        """The definitions of all symbols in the formulas, and of those in the definitions, each once.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        queue, seen = list(formulas), set[Formula]()
        while queue:
            deadline.enforce()
            for symbol in self.terms.variables(queue.pop()):
                if symbol in self._definition and symbol not in seen:
                    seen.add(symbol)
                    queue.append(self._definition[symbol])
                    yield self._definition[symbol]
