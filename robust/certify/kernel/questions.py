"""Refutations of the verified checker's own formulas, which it prints; nothing here is trusted.

`robust-kernel --formulas` prints a line for each formula that the orders of a certificate do not decide: its number,
the formula, and what is true of the auxiliary values in it, in Polish notation.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.certify.checker.formulas import TRUE, Circuit, add
from robust.certify.hints import Fact, KnownFacts, Line, refutation
from robust.certify.kernel.terms import listed, truth
from robust.smt.limits import Deadline

Multiples = Iterable[tuple[int, Fraction | int]]


def multiples(found: Multiples) -> str:
    """Multiples of facts, numbered from 0 here and from 1 there."""
    return listed(f"({number + 1} {factor})" for number, factor in found)


@dataclass(frozen=True, slots=True)
class OpenFormulas:
    """A circuit of formulas, of which all are said to be true."""

    circuit: Circuit
    literals: Sequence[int]

    @staticmethod
    def of(words: Sequence[str]) -> "OpenFormulas":
        """The formulas of a line, its number left out."""
        circuit, literals, rest = Circuit(), list[int](), iter(words)
        for word in rest:
            literals.append(_literal(circuit, word, rest))
        return OpenFormulas(circuit, literals)

    def roots(self, _: int) -> Sequence[int]:
        return self.literals

    def refutation(self, known: KnownFacts, deadline: Deadline) -> str:
        """The verified checker's words for a refutation.

        Raises:
            NotRefutedError: if the formulas can be true.
            OutOfTimeError: if the deadline passes.
        """
        if -TRUE in self.literals:  # false by itself: its unit clause against the gate of truth
            return f"((()) (({self.literals.index(-TRUE) + 1} -1)) ((() (1 (1 0)))))"
        line = self._added_up() or refutation(self, known, TRUE, deadline)  # type: ignore[arg-type]
        roots = (f"({number} {literal})" for number, literal in enumerate(self.literals, start=1))
        return listed((listed(map(self._node, self.circuit.nodes[1:])), listed(roots), listed(_steps(line))))

    def _added_up(self) -> Line | None:
        """The refutation of a comparison whose unknowns all have bounds of their own among the other formulas: one sum.

        That is how it is where orders decide which effects have taken place.
        """
        first, *others = self.literals
        if self.circuit.is_gate(abs(first)):
            return None
        bounds: dict[tuple[str, bool], tuple[int, int, int]] = {}  # by unknown and sign: comparison, root, input or 0
        for root, literal in enumerate(others, start=1):
            whole = literal > 0 and self.circuit.is_gate(literal)
            for place, each in enumerate(self.circuit.nodes[literal] if whole else (literal,), start=1):
                if not self.circuit.is_gate(abs(each)):
                    names = [(name, value) for name, value in self.circuit.said(each)[0].items() if name]
                    if len(names) == 1:
                        bounds[names[0][0], names[0][1] > 0] = (each, root, place if whole else 0)
        form, strict = self.circuit.said(first)
        total, used = {name: Fraction(value) for name, value in form.items()}, {first: Fraction(1)}
        line: Line = ["refute"]
        hints = [0]
        for name in [name for name in total if name]:
            bound = bounds.get((name, total[name] < 0))
            if bound is None:
                return None
            literal, root, place = bound
            side, more = self.circuit.said(literal)
            factor = abs(total[name] / side[name])
            add(total, {each: Fraction(value) for each, value in side.items()}, factor)
            used[literal], strict = factor, strict or more
            if place:
                line.append([[literal], [root, [abs(self.literals[root]), place]]])
            hints.append(len(self.literals) + len(line) - 2 if place else root)
        value = total.pop("", Fraction(0))
        if total or value > 0 or (value == 0 and not strict):
            return None
        line.append([[-literal for literal in used], [*used.values()], []])
        return [*line, [[], [*hints, len(self.literals) + len(line) - 2]]]

    @staticmethod
    def _node(node: tuple[object, ...]) -> str:
        if not node or type(node[0]) is int:
            return listed(node)
        strict, terms = node
        form = dict(terms)  # type: ignore[call-overload]
        constant = form.pop("", 0)
        return listed((truth(strict), constant, *(f"({name} {factor})" for name, factor in form.items())))


def _literal(circuit: Circuit, word: str, rest: Iterator[str]) -> int:
    if word == "1":
        return TRUE
    kind = next(rest)
    if kind == "~":
        found = -_literal(circuit, next(rest), rest)
        next(rest)
    elif kind == "&":
        found = circuit.add((_literal(circuit, next(rest), rest), _literal(circuit, next(rest), rest)))
        next(rest)
    else:
        form = {"": Fraction(next(rest))}
        while (name := next(rest)) != ")":
            form[name] = form.get(name, Fraction(0)) + Fraction(next(rest))
        found = circuit.compare({name: factor for name, factor in form.items() if factor}, kind == ">")
    return found


def _steps(line: Line) -> Iterator[str]:
    """The steps of a refutation as the certificate's lines have them."""
    for clause, *proof in line[1:]:
        if len(proof) == 2:
            factors, facts = proof
            yield listed((listed(clause), listed(factors), multiples(facts)))
        else:
            hints = (hint + 1 if isinstance(hint, int) else listed(hint) for hint in proof[0])
            yield listed((listed(clause), listed(hints)))


def renamed(form: dict[str, Fraction], numbers: dict[str, int]) -> dict[str, Fraction]:
    """A form with parameters as the verified checker names them."""
    return {f"#{numbers[name]}" if name in numbers else name: factor for name, factor in form.items()}


def facts_of(facts: Iterable[Fact], numbers: dict[str, int]) -> list[Fact]:
    return [(renamed(form, numbers), strict) for form, strict in facts]
