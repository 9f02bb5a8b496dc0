"""Refutations without search: what is known decides comparisons, these decide gates, and values follow one by one.

That is how it is where orders decide which effects have taken place: in nearly all obligations of long plans, and at
schedules that are written down. Unknowns are auxiliary values, of which bounds are derived in the order in which they
depend on each other, and times and parameters, about which there are facts.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice, product
from typing import Any

from robust.certify.checker.formulas import Circuit, add, plus
from robust.certify.checker.reader import Linear
from robust.certify.hints import Fact, KnownFacts, Line

Key = tuple[str, bool]
"""An auxiliary value, and whether from below."""
ALTERNATIVES = 4
"""Combinations of bounds that are tried to contradict one comparison."""


@dataclass(frozen=True, slots=True)
class Place:
    """What a time, an instant or a parameter is, and the numbers of two facts that say it."""

    at_least: int
    at_most: int
    form: Linear


class IndexedFacts(KnownFacts):
    """Facts, by the times in them.

    Args:
        facts: the facts, those of the region first.
        sides: how many these are.
        places: what unknowns are, over others.
    """

    def __init__(self, facts: Sequence[Fact], sides: int, places: Mapping[str, Place]) -> None:
        super().__init__(facts)
        self.facts, self._places = facts, places
        self._about: dict[frozenset[str], list[tuple[int, Linear]]] = {}
        for number, (form, strict) in enumerate(facts):
            reduced = self.reduced(Sum({**form}, strict)).form
            self._about.setdefault(times_in(reduced), []).append((number, reduced))
        self._region = KnownFacts(facts[:sides])
        absurd = self._region.contradiction([])
        self.absurd = None if isinstance(absurd, dict) else absurd[1]
        """Multiples of sides of the region that contradict each other, if it is empty."""
        self._answers: dict[tuple[frozenset[tuple[str, Fraction]], bool], list[tuple[int, Fraction]] | None] = {}

    def about(self, times: frozenset[str]) -> Sequence[tuple[int, Linear]]:
        """The facts about these times, without those that are placed, and their numbers."""
        return self._about.get(times, ())

    def reduced(self, total: "Sum") -> "Sum":
        """The sum, with facts that take away all that is placed."""
        while (name := next((name for name in total.form if name in self._places), None)) is not None:
            place, factor = self._places[name], total.form.pop(name)
            add(total.form, place.form, factor)
            total.use(place.at_most if factor > 0 else place.at_least, abs(factor))
        return total

    def denied(self, form: Linear, strict: bool) -> list[tuple[int, Fraction]] | None:
        """Multiples of sides of the region that contradict an inequality over its unknowns; None if there are none."""
        if not form.keys() - {""}:
            value = form.get("", Fraction(0))
            return [] if value < 0 or (value == 0 and strict) else None
        key = frozenset(form.items()), strict
        if key not in self._answers:
            self._answers[key] = self._region.denial(form, strict=strict)
        return self._answers[key]


@dataclass(slots=True)
class Sum:
    """Comparisons and facts, each so many times, added up."""

    form: Linear
    strict: bool
    literals: dict[int, Fraction] = field(default_factory=dict)
    facts: dict[int, Fraction] = field(default_factory=dict)

    def add(self, fact: Fact, factor: Fraction) -> None:
        add(self.form, fact[0], factor)
        self.strict = self.strict or fact[1]

    def use(self, number: int, factor: Fraction) -> None:
        """Notes a fact that has been added."""
        self.facts[number] = self.facts.get(number, Fraction(0)) + factor


class Evaluation:
    """Tries to refute formulas, of which the first is the one that is not expected to be true.

    Attributes:
        kept: the first one is true, by the others and by facts.
    """

    def __init__(self, circuit: Circuit, literals: Sequence[int], known: IndexedFacts) -> None:
        self.kept = False
        self._circuit, self._literals, self._known = circuit, literals, known
        self._line: Line = ["refute"]
        self._refuted = False
        self._true: dict[int, int] = {}  # by literal, its unit clause
        self._queue: list[int] = []
        self._waiting: dict[Key, list[int]] = {}
        self._bounds: dict[Key, list[int]] = {}  # comparisons that are true
        self._stated: dict[frozenset[str], list[tuple[int, Linear]]] = {}  # those of times and parameters

    def line(self) -> Line | None:
        """The refutation; None if there is none of this kind."""
        for clause, literal in enumerate(self._literals[1:], start=1):
            self._state(literal, clause)
        later = [*self._at_once(self._literals[0], 0)]
        self._settle()
        if not self._refuted:
            self.kept = len(later) == 1 and later[0][1] == 0 and self._decided(later[0][0]) == later[0][0]
            for literal, clause in later:
                self._state(literal, clause)
            self._settle()
        return self._line if self._refuted else None

    def _at_once(self, literal: int, clause: int) -> Iterator[tuple[int, int]]:
        """States what the formula says of times and parameters; the rest, which must not hide what is known."""
        if self._is_gate(literal) and literal > 0:
            for place, each in enumerate(self._circuit.nodes[literal], start=1):
                yield from self._at_once(each, self._derive([each], [clause, [literal, place]]))
        elif self._is_gate(literal) or any(map(_is_auxiliary, self._fact(literal)[0])):
            yield literal, clause
        else:
            self._state(literal, clause)

    # -- clauses -------------------------------------------------------------------------------------------------------

    def _derive(self, clause: list[int], hints: list[Any]) -> int:
        self._line.append([clause, hints])
        self._refuted = self._refuted or not clause
        return self._number()

    def _number(self) -> int:
        return len(self._literals) + len(self._line) - 2

    def _state(self, literal: int, clause: int) -> None:
        if literal not in self._true and not self._refuted:
            if -literal in self._true:
                self._derive([], [clause, self._true[-literal]])
            self._true[literal] = clause
            self._queue.append(literal)

    def _settle(self) -> None:
        """Draws conclusions from what is true."""
        while self._queue and not self._refuted:
            literal = self._queue.pop()
            if not self._is_gate(literal):
                self._compared(literal)
            elif literal > 0:
                for place, each in enumerate(self._circuit.nodes[literal], start=1):
                    self._state(each, self._derive([each], [self._true[literal], [literal, place]]))
            else:
                self._disjunction(literal)

    def _wait(self, literal: int, keys: Sequence[Key]) -> None:
        for key in keys:
            self._waiting.setdefault(key, []).append(literal)

    # -- gates ---------------------------------------------------------------------------------------------------------

    def _disjunction(self, literal: int) -> None:
        """One of the inputs is false: the only one that may be."""
        inputs = self._circuit.nodes[-literal]
        decided = [self._decided(each) for each in inputs]
        if any(found == -each for found, each in zip(decided, inputs, strict=True)):
            return
        hints = [*(self._true[found] for found in decided if found), self._true[literal], [-literal, 0]]
        open_inputs = [each for found, each in zip(decided, inputs, strict=True) if not found]
        if not open_inputs:
            self._derive([], hints)
        elif len(open_inputs) == 1:
            self._state(-open_inputs[0], self._derive([-open_inputs[0]], hints))
        else:
            self._wait(literal, [*dict.fromkeys(key for each in open_inputs for key in self._missing(abs(each)))])

    def _missing(self, number: int) -> Iterator[Key]:
        """Bounds that could decide something."""
        if self._is_gate(number):
            for each in self._circuit.nodes[number]:
                if each not in self._true and -each not in self._true:
                    yield from self._missing(abs(each))
        else:
            keys = ((name, lower) for name in self._fact(number)[0] if _is_auxiliary(name) for lower in (False, True))
            yield from (key for key in keys if key not in self._bounds)

    def _decided(self, literal: int) -> int:
        """The literal, or its negation, whichever is true; 0 if neither is known to be."""
        for each in (literal, -literal):
            if each in self._true:
                return each
        return self._gate(abs(literal)) if self._is_gate(literal) else self._comparison(literal)

    def _gate(self, number: int) -> int:
        inputs = self._circuit.nodes[number]
        decided = []
        for place, each in enumerate(inputs, start=1):
            decided.append(self._decided(each))
            if decided[-1] == -each:
                return self._found(-number, [self._true[-each], [number, place]])
        if 0 in decided:
            return 0
        return self._found(number, [*(self._true[each] for each in inputs), [number, 0]])

    def _found(self, literal: int, hints: list[Any]) -> int:
        self._true[literal] = self._derive([literal], hints)
        return literal

    # -- comparisons ---------------------------------------------------------------------------------------------------

    def _comparison(self, literal: int) -> int:
        for each in (literal, -literal):
            reason = self._contradiction(each)
            if reason is not None:
                return self._found(-each, self._lemma(-each, Fraction(1), reason))
        return 0

    def _lemma(self, literal: int | None, factor: Fraction, reason: Sum) -> list[Any]:
        """The hints for a comparison, or for the empty clause, that what is known contradicts."""
        ours = [(literal, factor)] if literal is not None else []
        literals = [*ours, *((-each, f) for each, f in reason.literals.items())]
        facts = [*reason.facts.items()]
        self._line.append([[each for each, _ in literals], [f for _, f in literals], facts])
        lemma = self._number()
        return [*(self._true[each] for each in reason.literals), lemma]

    def _compared(self, literal: int) -> None:
        """What follows from a comparison that is true."""
        reason = self._contradiction(literal)
        if reason is not None:
            self._derive([], [self._true[literal], *self._lemma(-literal, Fraction(1), reason)])
            return
        form, strict = self._fact(literal)
        names = [name for name in form if _is_auxiliary(name)]
        if not names:
            form = self._known.reduced(Sum(form, strict)).form
            self._stated.setdefault(times_in(form), []).append((literal, form))
        elif len(names) == 1:
            self._bounded((names[0], form[names[0]] > 0), literal)
        else:
            missing = [name for name in names if (name, form[name] < 0) not in self._bounds]
            if len(missing) > 1:
                self._wait(literal, [(name, form[name] < 0) for name in missing[:2]])
                return
            for name in missing or names:
                if (name, form[name] > 0) not in self._bounds:
                    self._bound_of(name, literal)

    def _bound_of(self, name: str, literal: int) -> None:
        """A bound of one value, by bounds of all others in a comparison."""
        form, strict = self._fact(literal)
        total = Sum({**form}, strict, {literal: Fraction(1)})
        for other in [each for each in form if _is_auxiliary(each) and each != name]:
            self._take(total, other, self._bounds[other, form[other] < 0][0])
        bound = self._circuit.compare(total.form, total.strict)
        if bound not in self._true:
            ours = total.form[name] / self._fact(bound)[0][name]
            self._state(bound, self._derive([bound], self._lemma(bound, ours, total)))

    def _bounded(self, key: Key, literal: int) -> None:
        self._bounds.setdefault(key, []).insert(0, literal)
        for each in self._waiting.pop(key, ()):
            self._queue.append(each)

    def _take(self, total: Sum, name: str, bound: int) -> None:
        fact = self._fact(bound)
        factor = abs(total.form[name] / fact[0][name])
        total.add(fact, factor)
        total.literals[bound] = total.literals.get(bound, Fraction(0)) + factor

    def _contradiction(self, literal: int) -> Sum | None:
        """What adds up to less than nothing, with the comparison."""
        form, strict = self._fact(literal)
        names = [name for name in form if _is_auxiliary(name)]
        bounds = [self._bounds.get((name, form[name] < 0), []) for name in names]
        for chosen in islice(product(*bounds), ALTERNATIVES):
            total = Sum({**form}, strict)
            for name, bound in zip(names, chosen, strict=True):
                self._take(total, name, bound)
            if self._completed(total):
                return total
        return None

    def _completed(self, total: Sum) -> bool:
        """Whether facts, and perhaps a comparison of times and parameters that is true, make a sum absurd."""
        times = times_in(self._known.reduced(total).form)
        if not times:
            return self._denied(total, total.form, total.strict)
        name = next(iter(times))
        stated = [(literal, form, True) for literal, form in self._stated.get(times, ())]
        for number, form, is_literal in (*stated, *((n, f, False) for n, f in self._known.about(times))):
            factor = -total.form[name] / form[name]
            fact = self._fact(number) if is_literal else self._known.facts[number]
            left = plus(total.form, form, factor)
            if factor > 0 and not times_in(left) and self._denied(total, left, total.strict or fact[1]):
                total.add(fact, factor)
                if is_literal:
                    total.literals[number] = factor
                else:
                    total.use(number, factor)
                self._known.reduced(total)
                return True
        return False

    def _denied(self, total: Sum, form: Linear, strict: bool) -> bool:
        found = self._known.denied(form, strict)
        for number, factor in found or ():
            total.use(number, factor)
        return found is not None

    # -- the circuit ---------------------------------------------------------------------------------------------------

    def _is_gate(self, literal: int) -> bool:
        return self._circuit.is_gate(abs(literal))

    def _fact(self, literal: int) -> Fact:
        form, strict = self._circuit.said(literal)
        return {name: Fraction(value) for name, value in form.items()}, strict


def times_in(form: Linear) -> frozenset[str]:
    """The unknowns of a form that are no parameters."""
    return frozenset(name for name in form if name and name[0] != "#")


def _is_auxiliary(name: str) -> bool:
    """Whether a name is one of the kernel's auxiliary values: of changes, contributions, or what takes place."""
    return name[:1] in "jkfa" and name != ""
