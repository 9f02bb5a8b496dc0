"""What the files say in the words of the verified checker, which it trusts: texts taken apart, and linear forms.

Expressions of the network and of certificates are numbers, `#i` (a parameter), `@p` (a time point) and `(+ a b)`,
`(- a b)`, `(* number a)`.
"""

from collections.abc import Iterable
from fractions import Fraction

from robust.certify.checker.claims import SEGMENT
from robust.certify.checker.reader import NUMBER, Fact, Ground, Linear, Parameter, Tree, number
from robust.errors import UnsupportedError


def listed(items: Iterable[object]) -> str:
    """`(a b c)`."""
    return f"({' '.join(map(str, items))})"


def truth(value: object) -> str:
    return "t" if value else "f"


def unsupported(what: str) -> UnsupportedError:
    return UnsupportedError(f"the verified checker does not know {what}; `--checker python` checks the certificate")


class PlanTerms:
    """The sections of the verified checker's input that say what the plan is, and expressions over its parameters."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self.numbers = {name: number for number, name in enumerate([*ground.parameters, SEGMENT])}
        """Of parameters; the last is how far along a segment."""

    def sections(self) -> list[str]:
        """The trees of domain, problem and plan, and which parameters are durations or initial values, line by line."""
        ground = self._ground
        statements = (match.groupdict() for match in ground.statements if not match["parameter"])
        parts = {
            "parameters": [*ground.parameters],
            "pddl": [self._tree(section) for section in ground.model.sections],
            "plan": [_statement(**words) for words in statements],
            "beside": [listed((*what, name)) for what, name in ground.varied.items()],
        }
        return [listed((name, *items)) for name, items in parts.items()]

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

    def _tree(self, tree: Tree) -> str:
        """A text; an undeclared predicate of one type is the one that it is read as."""
        if type(tree) is not list:
            return _word(tree)
        model, words = self._ground.model, [*map(self._tree, tree)]
        if words and words[0] in model.split and words[0] not in model.predicates | model.functions:
            words[0] = model.split[words[0]]
        return listed(words)


def _word(text: str) -> str:
    """A word, or a number as a fraction."""
    return str(number(text)) if NUMBER.fullmatch(text) else text


def _statement(kind: str | None, instance: str, call: str, **network: str) -> str:
    """A step, or a constraint of the network, of a plan."""
    if kind:
        return listed((kind, instance, listed(call.lower().split())))
    return listed((network["target"], network["source"], _word(network["low"]), _word(network["high"])))
