"""Refutations of the checker's formulas, as lines of a certificate: clauses, with multiples of facts as lemmas."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm
from typing import Any

from robust.certify.checker.formulas import Formulas
from robust.certify.checker.reader import Linear
from robust.certify.refute import Clause, NotRefutedError, PropositionalSolver
from robust.qe.constraint import Sense
from robust.qe.simplex import Tableau
from robust.smt.limits import Deadline

Line = list[Any]
Fact = tuple[Linear, bool]
"""`form ≥ 0`, or `> 0`; the coefficient of `""` is the constant."""


@dataclass(frozen=True, slots=True)
class Side:
    """`Σ factor · variable + constant ≥ 0`, or `> 0` if strict, over integers."""

    factors: tuple[tuple[str, int], ...]
    constant: int
    strict: bool
    scale: Fraction = Fraction(1)
    """The integers are those of what is meant times this."""

    @staticmethod
    def of(form: Mapping[str, Fraction | int], strict: bool) -> Side:
        scale = lcm(*(Fraction(value).denominator for value in form.values()))
        whole = {name: int(value * scale) for name, value in form.items()}
        divisor = gcd(*whole.values()) or 1
        factors = tuple((name, value // divisor) for name, value in whole.items() if name and value)
        return Side(factors, whole.get("", 0) // divisor, strict, Fraction(scale, divisor))

    def level(self, point: Mapping[str, Fraction]) -> Fraction:
        return sum((factor * point.get(name, Fraction(0)) for name, factor in self.factors), Fraction(self.constant))

    def holds(self, point: Mapping[str, Fraction]) -> bool:
        level = self.level(point)
        return level > 0 or (level == 0 and not self.strict)


@dataclass(frozen=True, slots=True)
class Conflict:
    """Sides that contradict each other: positive multiples of these, by place, add up to less than nothing."""

    multiples: dict[int, int]


def contradiction(sides: Sequence[Side]) -> Conflict | dict[str, Fraction]:
    """A minimal contradictory subset with its multiples [Farkas 1902], or a point that satisfies all."""
    names = list(dict.fromkeys(name for side in sides for name, _ in side.factors))
    place = {name: index for index, name in enumerate(names)}
    tableau = Tableau(len(names))
    for side in sides:
        form = [0] * len(names)
        for name, factor in side.factors:
            form[place[name]] = -factor
        tableau.add(form, Sense.LESS if side.strict else Sense.AT_MOST, side.constant)
    if tableau.restore():
        return dict(zip(names, tableau.point(), strict=True))
    divisor = gcd(*tableau.weights.values())
    return Conflict({slack - len(names): weight // divisor for slack, weight in sorted(tableau.weights.items())})


class KnownFacts:
    """The checker's facts, of which a search takes in only those that it runs into."""

    def __init__(self, facts: Sequence[Fact]) -> None:
        self.sides = [Side.of(form, strict) for form, strict in facts]
        self._active: dict[int, None] = {}

    def imply(self, form: Mapping[str, Fraction]) -> bool:
        """Whether a form is negative nowhere where the facts hold."""
        negated = Side.of({name: -value for name, value in form.items()}, strict=True)
        return not isinstance(self.contradiction([negated]), dict)

    def contradiction(
        self, sides: Sequence[Side]
    ) -> tuple[dict[int, int], list[tuple[int, Fraction]]] | dict[str, Fraction]:
        """Multiples of the sides, by place, and of facts, by number, that contradict each other, or a point where all
        hold."""
        while True:
            active = list(self._active)
            found = contradiction([*sides, *(self.sides[number] for number in active)])
            if isinstance(found, Conflict):
                own = {place: factor for place, factor in found.multiples.items() if place < len(sides)}
                others = [
                    (active[place - len(sides)], factor * self.sides[active[place - len(sides)]].scale)
                    for place, factor in found.multiples.items()
                    if place >= len(sides)
                ]
                return own, others
            broken = [
                number for number, side in enumerate(self.sides) if number not in self._active and not side.holds(found)
            ]
            if not broken:
                return found
            self._active.update(dict.fromkeys(broken[:40]))


@dataclass(frozen=True, slots=True)
class _Lemma:
    clause: Clause
    multipliers: tuple[int, ...]
    facts: tuple[tuple[int, Fraction], ...] = ()


_Origin = int | tuple[int, int] | _Lemma
"""Where a clause comes from: a root by its place, a gate and the number of its clause, or a lemma."""


def is_proposition(name: str) -> bool:
    """Whether a name is that of a truth value, which is in no other comparison."""
    return name.startswith("?")


def refutation(
    formulas: Formulas, facts: KnownFacts, literal: int, deadline: Deadline, also: Iterable[int] = ()
) -> Line:
    """The line that refutes a literal, with what it depends on, and other literals.

    Raises:
        NotRefutedError: if it can be true.
        OutOfTimeError: if the deadline passes.
    """
    search = _Search(formulas, facts, [*formulas.roots(literal), *also], deadline)
    if search.search() is not None:
        raise NotRefutedError("found a formula that can be satisfied, expected one that cannot")
    return search.line()


@dataclass(frozen=True, slots=True)
class Model:
    """How a literal can be true: comparisons that are enough for that, and a point where they hold with all facts."""

    sides: tuple[Side, ...]
    point: Mapping[str, Fraction]


def model(
    formulas: Formulas, facts: KnownFacts, literal: int, deadline: Deadline, assumed: Sequence[Side] = ()
) -> Model | None:
    """How a literal can be true where facts and assumptions hold; None if it cannot.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return _Search(formulas, facts, formulas.roots(literal), deadline, assumed).search()


class _Search:
    def __init__(
        self,
        formulas: Formulas,
        facts: KnownFacts,
        roots: Sequence[int],
        deadline: Deadline,
        assumed: Sequence[Side] = (),
    ) -> None:
        self._circuit = formulas.circuit
        self._facts = facts
        self._roots = roots
        self._assumed = assumed
        self._deadline = deadline
        self._solver = PropositionalSolver()
        self._origins: dict[int, _Origin] = {}
        self._sides: dict[int, Side] = {}
        nodes = list(self._cone())
        for number in nodes:
            if self._circuit.is_gate(number):
                inputs = self._circuit.nodes[number]
                self._add((number, *(-each for each in inputs)), (number, 0))
                for index, each in enumerate(inputs, start=1):
                    self._add((-number, each), (number, index))
        for lemma in self._orders(nodes):
            self._add(lemma.clause, lemma)
        for index, root in enumerate(roots):
            self._add((root,), index)

    def search(self) -> Model | None:
        """A model; None if the clauses that have been added refute the roots."""
        while (truths := self._solver.solve(self._deadline)) is not None:
            self._deadline.enforce()
            literals = self._justification(truths)
            sides = [self._side(literal) for literal in literals]
            found = self._facts.contradiction([*sides, *self._assumed])
            if isinstance(found, dict):
                return Model(tuple(sides), found)
            own, others = found
            own = {place: factor for place, factor in own.items() if place < len(sides)}
            clause = tuple(-literals[place] for place in own)
            self._add(clause, _Lemma(clause, tuple(own.values()), tuple(others)))
        return None

    def _add(self, clause: Clause, origin: _Origin) -> None:
        self._origins[self._solver.add(clause)] = origin

    def _side(self, literal: int) -> Side:
        if literal not in self._sides:
            form, strict = self._circuit.said(literal)
            factors = tuple((name, value) for name, value in form.items() if name)
            self._sides[literal] = Side(factors, form.get("", 0), strict)
        return self._sides[literal]

    def _cone(self) -> Iterable[int]:
        """Every node below the roots."""
        seen = dict.fromkeys(abs(root) for root in self._roots)
        queue = list(seen)
        for number in queue:
            if self._circuit.is_gate(number):
                new = dict.fromkeys(abs(each) for each in self._circuit.nodes[number] if abs(each) not in seen)
                seen.update(new)
                queue += new
        return seen

    def _orders(self, nodes: Iterable[int]) -> Iterator[_Lemma]:
        """Of comparisons of one linear form the tighter implies the looser; stated before the search needs it."""
        forms: dict[tuple[tuple[str, int], ...], list[tuple[int, bool, int]]] = defaultdict(list)
        for number in nodes:
            if not self._circuit.is_gate(number):
                side = self._side(number)
                forms[side.factors].append((side.constant, not side.strict, number))
        for alike in forms.values():
            for (_, _, tight), (_, _, loose) in pairwise(sorted(alike)):
                yield _Lemma((-tight, loose), (1, 1))

    def _justification(self, model: dict[int, bool]) -> list[int]:
        """Literals of comparisons that are enough to make all roots true."""
        chosen: dict[int, None] = {}
        queue = list(self._roots)
        seen = set(queue)
        for literal in queue:
            if not self._circuit.is_gate(abs(literal)):
                if not is_proposition(self._side(literal).factors[0][0]):
                    chosen[literal] = None
                continue
            inputs = self._circuit.nodes[abs(literal)]
            needed = inputs if literal > 0 else (self._false_input(inputs, model, seen),)
            for each in needed:
                if each not in seen:
                    seen.add(each)
                    queue.append(each)
        return list(chosen)

    def _false_input(self, inputs: Sequence[int], model: dict[int, bool], seen: set[int]) -> int:
        """One input that is false, preferably one that is needed anyway or costs no comparison."""
        false = [-literal for literal in inputs if model[abs(literal)] != (literal > 0)]
        return min(false, key=lambda literal: (literal not in seen, self._cost(literal)))

    def _cost(self, literal: int) -> int:
        if self._circuit.is_gate(abs(literal)):
            return 2
        return 0 if is_proposition(self._side(literal).factors[0][0]) else 1

    def line(self) -> Line:
        """The steps that the refutation uses."""
        solver = self._solver
        if solver.refutation is None:
            raise RuntimeError("there is no refutation to write down")
        used: set[int] = set()
        pending = list(solver.refutation.hints)
        while pending:
            number = pending.pop()
            if number not in used:
                used.add(number)
                if number in solver.derivations:
                    pending += solver.derivations[number].hints
        hint: dict[int, int | list[int]] = {}
        line: Line = ["refute"]
        for number in sorted(used):
            derivation, origin = solver.derivations.get(number), self._origins.get(number)
            if derivation is not None:
                line.append([list(derivation.clause), [hint[each] for each in derivation.hints]])
            elif isinstance(origin, int):
                hint[number] = origin
                continue
            elif isinstance(origin, tuple):
                hint[number] = list(origin)
                continue
            elif origin is not None:
                multiples = _whole([*map(Fraction, origin.multipliers), *(factor for _, factor in origin.facts)])
                own, others = multiples[: len(origin.clause)], multiples[len(origin.clause) :]
                facts = [[fact, factor] for (fact, _), factor in zip(origin.facts, others, strict=True)]
                line.append([list(origin.clause), own, facts])
            hint[number] = len(self._roots) + len(line) - 2
        line.append([[], [hint[each] for each in solver.refutation.hints]])
        return line


def _whole(factors: Sequence[Fraction]) -> list[int]:
    """The factors as integers without common divisor."""
    scale = lcm(*(factor.denominator for factor in factors))
    whole = [int(factor * scale) for factor in factors]
    divisor = gcd(*whole) or 1
    return [value // divisor for value in whole]


def implied(facts: KnownFacts, form: Mapping[str, Fraction], *, strictly: bool = False) -> list[tuple[int, Fraction]]:
    """Positive multiples of facts, by number, that leave something not negative of a form.

    Raises:
        NotRefutedError: if the form is negative somewhere where the facts hold, or nothing satisfies them.
    """
    if not form.keys() - {""} and (form.get("", 0) > 0 or (form.get("", 0) == 0 and not strictly)):
        return []
    negated = Side.of({name: -value for name, value in form.items()}, not strictly)
    found = facts.contradiction([negated])
    if isinstance(found, dict) or 0 not in found[0]:
        raise NotRefutedError(f"found {dict(form)} negative somewhere, expected it nowhere")
    unit = found[0][0] * negated.scale
    return [(number, factor / unit) for number, factor in found[1]]
