"""Forms to the initial state: atoms, numbers and timed initial literals."""

from __future__ import annotations

from fractions import Fraction

from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.pddl.check import Scope, function, proposition
from robust.plan.pddl.conditions import check_operands
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, number
from robust.plan.pddl.syntax import FunctionTerm, Proposition


class InitialState:
    """Collects the elements of `:init` and refuses contradictions."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._atoms: dict[Atom, bool] = {}
        self.fluents: dict[Fluent, Fraction] = {}
        self._timed: dict[tuple[Fraction, Atom | Fluent], bool | Fraction] = {}

    def true_atoms(self) -> frozenset[Atom]:
        return frozenset(atom for atom, value in self._atoms.items() if value)

    def timed_literals(self) -> tuple[TimedLiteral, ...]:
        """By time; at one time in the order of the file."""
        literals = [TimedLiteral(time, target, value) for (time, target), value in self._timed.items()]
        return tuple(sorted(literals, key=lambda literal: literal.time))

    def add(self, item: Item) -> None:
        """Add one element: `(p a)`, `(not (p a))`, `(= (f a) 3)` or `(at 5 element)`."""
        if not isinstance(item, Form):
            raise fault(item, "an initial fact in parentheses")
        if item.head == "at" and len(item.items) > 1 and _is_number(item.items[1]):
            self._add_timed(item)
            return
        target, value = self._fact(item)
        if isinstance(target, Fluent) and not isinstance(value, bool):
            before: bool | Fraction = self.fluents.setdefault(target, value)
        elif isinstance(target, Atom) and isinstance(value, bool):
            before = self._atoms.setdefault(target, value)
        _check_same(item, target, value, before)

    def _add_timed(self, form: Form) -> None:
        moment, *inside = form.rest
        time = _value(moment)
        if time < 0:
            raise fault(moment, "a time of at least zero")
        if len(inside) != 1 or not isinstance(inside[0], Form):
            raise fault(form, "one fact in parentheses after the time, as in (at 5 (open door))")
        target, value = self._fact(inside[0])
        _check_same(form, target, value, self._timed.setdefault((time, target), value))

    def _fact(self, form: Form) -> tuple[Atom | Fluent, bool | Fraction]:
        if form.head == "=":
            return self._number(form)
        if form.head != "not":
            return _atom(proposition(form, self._scope)), True
        check_operands(form, 1, "a proposition")
        inner = form.items[1]
        if not isinstance(inner, Form):
            raise fault(inner, "a proposition in parentheses")
        return _atom(proposition(inner, self._scope)), False

    def _number(self, form: Form) -> tuple[Fluent, Fraction]:
        if len(form.rest) != 2:
            raise fault(form, "a numeric function and its value, as in (= (f) 3)")
        left, right = form.rest
        if isinstance(left, Word) and left.kind is Kind.NAME:
            left = Form((left,), left.location)
        if not isinstance(left, Form):
            raise fault(left, "a numeric function, as in (= (f) 3)")
        return _fluent(function(left, self._scope)), _value(right)


def _is_number(item: Item) -> bool:
    return isinstance(item, Word) and item.kind is Kind.NUMBER


def _value(item: Item) -> Fraction:
    """A number, possibly written `(- 3)`."""
    if isinstance(item, Word) and item.kind is Kind.NUMBER:
        return number(item)
    if isinstance(item, Form) and item.head == "-" and len(item.rest) == 1:
        return -_value(item.rest[0])
    expected = "a finite number" if isinstance(item, Word) and item.text in ("nan", "inf", "-inf") else "a number"
    raise fault(item, expected)


def _check_same(form: Form, target: Atom | Fluent, value: bool | Fraction, before: bool | Fraction) -> None:
    if value != before:
        expected = f"the value given before, {str(before).lower()}"
        raise fault(form, expected, found=f"{target} = {str(value).lower()}")


def _atom(used: Proposition) -> Atom:
    return Atom(used.predicate, tuple(term.name for term in used.arguments))


def _fluent(used: FunctionTerm) -> Fluent:
    return Fluent(used.function, tuple(term.name for term in used.arguments))
