"""Refutations of the verified checker's own formulas, which it prints; nothing here is trusted.

`robust-kernel --formulas` prints a line for each formula that the orders of a certificate do not decide: its number,
the formula, and what is true of the auxiliary values in it, in Polish notation.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from robust.certify.checker.formulas import TRUE, Circuit, add, plus
from robust.certify.checker.reader import Linear
from robust.certify.hints import Fact, KnownFacts, Line, refutation
from robust.certify.kernel.terms import listed, truth, unsupported
from robust.smt.limits import Deadline

Multiples = Iterable[tuple[int, Fraction | int]]


def multiples(found: Multiples) -> str:
    """Multiples of facts, numbered from 0 here and from 1 there."""
    return listed(f"({number + 1} {factor})" for number, factor in found)


class IndexedFacts(KnownFacts):
    """Facts, by the unknowns in them."""

    def __init__(self, facts: Sequence[Fact]) -> None:
        super().__init__(facts)
        self._about: dict[frozenset[str], list[tuple[int, Fact]]] = {}
        for number, fact in enumerate(facts):
            self._about.setdefault(frozenset(fact[0].keys() - {""}), []).append((number, fact))

    def about(self, form: Linear) -> Sequence[tuple[int, Fact]]:
        """The facts about the unknowns of a form, with their numbers."""
        return self._about.get(frozenset(form.keys() - {""}), ())


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
        line = Evaluation(self, known).line() or refutation(self, known, TRUE, deadline)  # type: ignore[arg-type]
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


class Evaluation:
    """Refutes formulas without search, where each comparison in the first one is decided by bounds of its unknowns, by
    other comparisons that are said to be true, and by facts: then gates are, from below, and the formula is false.

    That is how it is where orders decide which effects have taken place, in nearly all obligations of long plans.
    """

    def __init__(self, formulas: "OpenFormulas", known: IndexedFacts) -> None:
        self._circuit, self._literals, self._known = formulas.circuit, formulas.literals, known
        self._line: Line = ["refute"]
        self._decided: dict[int, tuple[int, int] | None] = {}  # the literal that is true, and its clause
        self._bounds: dict[tuple[str, bool], tuple[int, int]] = {}  # by unknown and sign: comparison and clause
        self._others: list[tuple[int, int]] = []
        for root, literal in enumerate(self._literals):
            self._state(literal, root)

    def line(self) -> Line | None:
        """The refutation; None if there is none of this kind."""
        first = self._literals[0]
        decided = self._decide(abs(first))
        if decided is None or decided[0] != -first:
            return None
        self._derive([], [0, decided[1]])
        return self._line

    def _derive(self, clause: list[int], hints: list[Any]) -> int:
        self._line.append([clause, hints])
        return self._number()

    def _number(self) -> int:
        return len(self._literals) + len(self._line) - 2

    def _state(self, literal: int, clause: int) -> None:
        """What is true with a literal: of a conjunction, all of it."""
        if self._circuit.is_gate(abs(literal)):
            for place, each in enumerate(self._circuit.nodes[literal] if literal > 0 else (), start=1):
                self._state(each, self._derive([each], [clause, [literal, place]]))
            return
        names = [(name, value) for name, value in self._circuit.said(literal)[0].items() if name]
        if len(names) == 1:
            self._bounds[names[0][0], names[0][1] > 0] = (literal, clause)
        else:
            self._others.append((literal, clause))

    def _decide(self, number: int) -> tuple[int, int] | None:
        if number not in self._decided:
            self._decided[number] = None
            gate = self._circuit.is_gate(number)
            self._decided[number] = self._gate(number) if gate else self._comparison(number)
        return self._decided[number]

    def _gate(self, number: int) -> tuple[int, int] | None:
        inputs = self._circuit.nodes[number]
        clauses = []
        for place, each in enumerate(inputs, start=1):
            decided = self._decide(abs(each))
            if decided is not None and decided[0] == -each:
                return -number, self._derive([-number], [decided[1], [number, place]])
            clauses.append(None if decided is None else decided[1])
        if None in clauses:
            return None
        return number, self._derive([number], [*clauses, [number, 0]])

    def _comparison(self, number: int) -> tuple[int, int] | None:
        for literal in (number, -number):
            clause = self._contradicted(literal)
            if clause is not None:
                return -literal, clause
        return None

    def _contradicted(self, literal: int) -> int | None:
        """The clause that a comparison is false, if it contradicts what is known."""
        total, strict = self._fact(literal)
        used = dict[int, tuple[Fraction, int]]()
        for name in [name for name in total if name]:
            bound = self._bounds.get((name, total[name] < 0))
            if bound is not None:
                side, more = self._fact(bound[0])
                factor = abs(total[name] / side[name])
                add(total, side, factor)
                used[bound[0]], strict = (factor, bound[1]), strict or more
        facts: list[tuple[int, Fraction]] = []
        if total.keys() - {""}:
            partner = self._opposite(total)
            if partner is None:
                return None
            number, (side, more), clause, factor = partner
            add(total, side, factor)
            strict = strict or more
            if clause is None:
                facts.append((number, factor))
            else:
                used[number] = (factor, clause)
        value = total.pop("", Fraction(0))
        if total or value > 0 or (value == 0 and not strict):
            return None
        self._line.append([[-literal, *(-each for each in used)], [1, *(factor for factor, _ in used.values())], facts])
        return self._derive([-literal], [*(clause for _, clause in used.values()), self._number()])

    def _opposite(self, total: Linear) -> tuple[int, Fact, int | None, Fraction] | None:
        """A comparison that is true, with its clause, or a fact, that takes away all unknowns; and how often."""
        stated = [(literal, self._fact(literal), clause) for literal, clause in self._others]
        alike = [(number, fact, None) for number, fact in self._known.about(total)]
        best = None
        for number, fact, clause in (*stated, *alike):
            form = fact[0]
            name = next(name for name in total if name)
            factor = -total[name] / form[name] if form.get(name) else Fraction(0)
            left = plus(total, form, factor)
            if factor > 0 and not left.keys() - {""}:
                least = left.get("", Fraction(0))
                if best is None or least < best[0]:
                    best = least, (number, fact, clause, factor)
        return None if best is None else best[1]

    def _fact(self, literal: int) -> Fact:
        form, strict = self._circuit.said(literal)
        return {name: Fraction(value) for name, value in form.items()}, strict


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
