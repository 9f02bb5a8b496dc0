"""The ground plan in the terms of `proofs/kernel/coq/Spec.v`: what the verified checker trusts, beside the reader.

Expressions are numbers, `#i` (a parameter), `@p` (a time point) and `(+ a b)`, `(- a b)`, `(* number a)`; those of
conditions and effects also know `=f` (a fluent), and any `(* a b)` and `(/ a b)`.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction

from robust.certify.checker.claims import SEGMENT
from robust.certify.checker.reader import Duty, Effect, Ends, Fact, Ground, Linear, Parameter, Tree, constant
from robust.errors import UnsupportedError


def listed(items: Iterable[object]) -> str:
    """`(a b c)`."""
    return f"({' '.join(map(str, items))})"


def truth(value: object) -> str:
    return "t" if value else "f"


def unsupported(what: str) -> UnsupportedError:
    return UnsupportedError(f"the verified checker does not know {what}; `--checker python` checks the certificate")


class GroundTerms:
    """The sections of the verified checker's input that say what the plan is."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._atoms: dict[str, int] = {}
        self._fluents: dict[str, int] = {}
        self.numbers = {name: number for number, name in enumerate([*ground.parameters, SEGMENT])}
        """Of parameters; the last is how far along a segment."""

    def sections(self) -> list[str]:
        """The plan, section by section, each in a line of its own."""
        ground = self._ground
        effects = [self._effect(point, each) for point, effects in enumerate(ground.effects) for each in effects]
        flows = [listed((s, e, self._fluent(f), self._term(rate, (s, e)))) for s, e, f, rate in ground.flows]
        edges = [listed((a, b, self.expression(w))) for a, b, w in ground.edges]
        duties = [self._duty(each) for each in ground.duties]
        true = [self._atom(atom) for atom, value in ground.model.initial.items() if value is True]
        values = [self.expression(self._initial(fluent)) for fluent in self._fluents]
        parts: dict[str, Sequence[object]] = {
            "parameters": [*ground.parameters],
            "true": true,
            "values": values,
            "effects": effects,
            "flows": flows,
            "constraints": edges,
            "obligations": duties,
            "timed": sorted(ground.timed),
        }
        return [f"({' '.join([name, *map(str, items)])})" for name, items in parts.items()]

    def expression(self, form: Linear) -> str:
        """A linear form over parameters and time points."""
        shown = str(form.get("", Fraction(0)))
        for name, factor in form.items():
            if name:
                variable = name if name[0] == "@" else f"#{self.numbers[name]}"
                shown = f"(+ {shown} {variable if factor == 1 else f'(* {factor} {variable})'})"
        return shown

    def sides(self, facts: Iterable[Fact]) -> str:
        """The sides of a polyhedron."""
        return listed(listed((self.expression(form), truth(strict))) for form, strict in facts)

    def bounds(self) -> str:
        """The declared bounds."""
        return listed(self._bound(each) for each in self._ground.parameters.values())

    @staticmethod
    def _bound(each: Parameter) -> str:
        ends = (each.lower, each.upper)
        return listed(text for end in ends for text in (("-", "f") if end is None else (end, "t")))

    # -- names ---------------------------------------------------------------------------------------------------------

    def _atom(self, name: str) -> int:
        return self._atoms.setdefault(name, len(self._atoms))

    def _fluent(self, name: str) -> int:
        return self._fluents.setdefault(name, len(self._fluents))

    def _initial(self, fluent: str) -> Linear:
        if ("fluent", fluent) in self._ground.varied:
            return {self._ground.varied["fluent", fluent]: Fraction(1)}
        value = self._ground.model.initial.get(fluent)
        if type(value) is not Fraction:
            raise unsupported(f"the value of {fluent}, which has no initial one")
        return constant(value)

    # -- expressions ---------------------------------------------------------------------------------------------------

    def _term(self, tree: Tree, owner: Ends | None) -> str:
        """An expression as it is in the plan."""
        kind, *rest = tree
        if kind == "number":
            return str(rest[0])
        if kind == "parameter":
            return f"#{self.numbers[rest[0]]}"
        if kind == "duration" and owner is not None:
            return f"(- @{owner[1]} @{owner[0]})"
        if kind == "fluent":
            return f"={self._fluent(rest[0])}"
        first, *others = (self._term(each, owner) for each in rest)
        if kind == "-" and not others:
            return f"(- 0 {first})"
        for each in others:
            first = f"({kind} {first} {each})"
        return first

    # -- effects and conditions ----------------------------------------------------------------------------------------

    def _effect(self, point: int, effect: Effect) -> str:
        when = self._condition(effect.when, effect.owner)
        if effect.kind in ("add", "delete"):
            return listed((point, when, effect.kind, self._atom(effect.target)))
        amount = self._term(effect.amount, effect.owner)
        return listed((point, when, effect.kind, self._fluent(effect.target), amount))

    def _condition(self, tree: Tree, owner: Ends | None) -> str:
        if type(tree) is bool:
            return "(always)" if tree else "(not (always))"
        kind, *rest = tree
        if kind == "atom":
            return f"(atom {self._atom(rest[0])})"
        if kind == "not":
            return f"(not {self._condition(rest[0], owner)})"
        if kind in ("and", "or"):
            first, *others = [self._condition(each, owner) for each in rest] or ["(always)"]
            found = first if rest or kind == "and" else f"(not {first})"
            for each in others:
                found = f"({kind} {found} {each})"
            return found
        left, right = rest if kind[0] != "<" else rest[::-1]
        if kind == "=":
            sides = (self._compare(left, right, False, owner), self._compare(right, left, False, owner))
            return f"(and {sides[0]} {sides[1]})"
        return self._compare(left, right, len(kind) == 1, owner)

    def _compare(self, left: Tree, right: Tree, strict: bool, owner: Ends | None) -> str:
        """`left - right` is at least 0, or more."""
        return f"(compare {truth(strict)} {self._term(('-', left, right), owner)})"

    def _duty(self, duty: Duty) -> str:
        condition = self._condition(duty.condition, duty.owner)
        if duty.first is None:
            return f"(goal {condition})"
        if duty.last is None:
            return f"(at {duty.first} {condition})"
        return f"(over {duty.first} {duty.last} {condition})"
