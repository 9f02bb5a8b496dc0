"""Refutations of the verified checker's own formulas, which it prints; nothing here is trusted.

`robust-kernel --formulas` prints a line for each formula that the orders of a certificate do not decide: its number,
the formula, and what is true of the auxiliary values in it, in Polish notation.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.certify.checker.formulas import TRUE, Circuit
from robust.certify.hints import Fact, Line, NotRefutedError, refutation
from robust.certify.kernel.evaluation import Evaluation, IndexedFacts
from robust.certify.kernel.terms import listed, truth, unsupported
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
        """The formulas of a line, its number left out.

        Raises:
            UnsupportedError: if something in them is not linear.
        """
        if "?" in words:
            raise unsupported("a product, or a quotient, that is not linear")
        circuit, literals, rest = Circuit(), list[int](), iter(words)
        for word in rest:
            literals.append(_literal(circuit, word, rest))
        return OpenFormulas(circuit, literals)

    def roots(self, _: int) -> Sequence[int]:
        return self.literals

    def refutation(self, known: IndexedFacts, deadline: Deadline) -> str:
        """The verified checker's words for a refutation.

        Raises:
            NotRefutedError: if the formulas can be true.
            OutOfTimeError: if the deadline passes.
        """
        if -TRUE in self.literals:  # false by itself: its unit clause against the gate of truth
            return f"((()) (({self.literals.index(-TRUE) + 1} -1)) ((() (1 (1 0)))))"
        if known.absurd is not None:  # nothing is true where there is no value
            return f"(() () ((() () {multiples(known.absurd)})))"
        evaluation = Evaluation(self.circuit, self.literals, known)
        line = evaluation.line()
        if evaluation.kept:
            raise NotRefutedError("found a formula that is true, expected one that is false")
        line = line or refutation(self, known, TRUE, deadline)  # type: ignore[arg-type]
        roots = (f"({number} {literal})" for number, literal in enumerate(self.literals, start=1))
        return listed((listed(map(self._node, self.circuit.nodes[1:])), listed(roots), listed(_steps(line))))

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
