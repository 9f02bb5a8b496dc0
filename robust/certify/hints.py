"""Refutations of the checker's formulas, as lines of a certificate: clauses, with multiples of facts as lemmas.

The propositional solver learns clauses from conflicts (first UIP) [Marques-Silva and Sakallah 1999; Moskewicz et al.
2001] and records why: each derived clause comes with the clauses that unit propagation needs, in that order, so that
a proof is checked in time linear in its size. Hints are as in LRAT [Cruz-Filipe et al. 2017].
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from itertools import pairwise
from math import gcd, lcm
from typing import Any

from robust.certify.checker.formulas import Formulas
from robust.certify.checker.reader import Linear
from robust.encode.interface import constant, variable
from robust.errors import RobustError
from robust.plan.model import ParameterReference
from robust.qe import constraint as constraints
from robust.qe import simplex
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Formula, Satisfiability, Session, Terms

Clause = tuple[int, ...]
"""Literals: a positive number is a variable, its negative the negation."""

DECAY = 1.05


@dataclass(frozen=True, slots=True)
class Derivation:
    """A clause and the numbers of the clauses from which unit propagation derives it; the last one is the conflict."""

    clause: Clause
    hints: tuple[int, ...]


class PropositionalSolver:
    """Clauses are added one at a time, between calls of `solve`; each gets the next number.

    `refutation` is the derivation of the empty clause, once there is one.
    """

    def __init__(self) -> None:
        self.clauses: list[Clause] = []
        self.derivations: dict[int, Derivation] = {}
        self.refutation: Derivation | None = None
        self._value: dict[int, bool] = {}
        self._level: dict[int, int] = {}
        self._reason: dict[int, int | None] = {}
        self._unit: dict[int, int] = {}
        self._trail: list[int] = []
        self._limits: list[int] = []
        self._next = 0
        self._watching: dict[int, list[int]] = defaultdict(list)
        self._watched: dict[int, list[int]] = {}
        self._activity: dict[int, float] = {}
        self._step = 1.0
        self._queue: list[tuple[float, int]] = []
        self._phase: dict[int, bool] = {}

    # -- clauses -----------------------------------------------------------------------------------------------------

    def add(self, literals: Iterable[int]) -> int:
        """Add a clause and return its number; the search starts anew from what is known for sure."""
        self._retreat(0)
        clause = tuple(dict.fromkeys(literals))
        number = self._store(clause)
        if any(-literal in clause for literal in clause) or self.refutation is not None:
            return number
        open_literals = [literal for literal in clause if self._truth(literal) is None]
        if any(self._truth(literal) for literal in clause):
            self._watch(number, clause)
        elif not open_literals:
            self._refute(number)
        elif len(open_literals) == 1:
            self._assign_for_sure(open_literals[0], number)
            self._watch(number, clause)
        else:
            self._watch(number, tuple(open_literals))
        return number

    def _store(self, clause: Clause) -> int:
        self.clauses.append(clause)
        for literal in clause:
            if abs(literal) not in self._activity:
                self._activity[abs(literal)] = 0.0
                heappush(self._queue, (0.0, abs(literal)))
        return len(self.clauses) - 1

    def _watch(self, number: int, clause: Sequence[int]) -> None:
        if len(clause) > 1:
            self._watched[number] = list(clause)
            for literal in clause[:2]:
                self._watching[literal].append(number)

    def _derive(self, clause: Clause, hints: Sequence[int]) -> int:
        number = self._store(clause)
        self.derivations[number] = Derivation(clause, tuple(hints))
        return number

    def _refute(self, conflict: int) -> None:
        hints = [self._unit[abs(literal)] for literal in self.clauses[conflict]]
        self.refutation = Derivation((), (*hints, conflict))

    # -- search ------------------------------------------------------------------------------------------------------

    def solve(self, deadline: Deadline) -> dict[int, bool] | None:
        """A truth value for every variable that satisfies all clauses; None if there is a refutation.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        while self.refutation is None:
            conflict = self._propagate()
            if conflict is None:
                variable = self._choose()
                if variable is None:
                    return dict(self._value)
                self._limits.append(len(self._trail))
                self._assign(variable if self._phase.get(variable, False) else -variable, None)
            elif not self._limits:
                self._refute(conflict)
            else:
                deadline.enforce()
                self._learn(conflict)
        return None

    def _choose(self) -> int | None:
        while self._queue:
            activity, variable = heappop(self._queue)
            if variable not in self._value and -activity == self._activity[variable]:
                return variable
        return None

    def _truth(self, literal: int) -> bool | None:
        value = self._value.get(abs(literal))
        return None if value is None else value == (literal > 0)

    def _assign(self, literal: int, reason: int | None) -> None:
        variable = abs(literal)
        self._value[variable] = literal > 0
        self._level[variable] = len(self._limits)
        self._reason[variable] = reason
        self._trail.append(literal)

    def _assign_for_sure(self, literal: int, reason: int) -> None:
        """At level zero every literal becomes a clause of its own, which later hints name."""
        others = [self._unit[abs(other)] for other in self.clauses[reason] if other != literal]
        self._unit[abs(literal)] = self._derive((literal,), (*others, reason)) if others else reason
        self._assign(literal, reason)

    def _propagate(self) -> int | None:
        """Assign what follows; the number of a clause that is false, if one is."""
        while self._next < len(self._trail):
            false = -self._trail[self._next]
            self._next += 1
            watching = self._watching[false]
            kept: list[int] = []
            for position, number in enumerate(watching):
                clause = self._watched[number]
                if clause[0] == false:
                    clause[0], clause[1] = clause[1], false
                first = self._truth(clause[0])
                if first or not self._move_watch(number, clause):
                    kept.append(number)
                    if first:
                        continue
                    if first is False:
                        self._watching[false] = kept + watching[position + 1 :]
                        return number
                    if self._limits:
                        self._assign(clause[0], number)
                    else:
                        self._assign_for_sure(clause[0], number)
            self._watching[false] = kept
        return None

    def _move_watch(self, number: int, clause: list[int]) -> bool:
        for index in range(2, len(clause)):
            if self._truth(clause[index]) is not False:
                clause[1], clause[index] = clause[index], clause[1]
                self._watching[clause[1]].append(number)
                return True
        return False

    def _retreat(self, level: int) -> None:
        if len(self._limits) <= level:
            return
        start = self._limits[level]
        for literal in self._trail[start:]:
            variable = abs(literal)
            self._phase[variable] = literal > 0
            del self._value[variable]
            heappush(self._queue, (-self._activity[variable], variable))
        del self._trail[start:]
        del self._limits[level:]
        self._next = min(self._next, start)

    # -- learning ----------------------------------------------------------------------------------------------------

    def _learn(self, conflict: int) -> None:
        """Derive the first unique implication point's clause, retreat and assert it."""
        now = len(self._limits)
        learnt: list[int] = []
        seen: set[int] = set()
        units: dict[int, None] = {}
        used = [conflict]
        pending, reason, place = 0, conflict, len(self._trail)
        while True:
            for literal in self.clauses[reason]:
                variable = abs(literal)
                if variable in seen or self._truth(literal):
                    continue
                seen.add(variable)
                self._bump(variable)
                if self._level[variable] == 0:
                    units[self._unit[variable]] = None
                elif self._level[variable] == now:
                    pending += 1
                else:
                    learnt.append(literal)
            place -= 1
            while abs(self._trail[place]) not in seen:
                place -= 1
            pending -= 1
            if not pending:
                break
            antecedent = self._reason[abs(self._trail[place])]
            if antecedent is None:
                raise RuntimeError("a decision cannot be resolved away")
            reason = antecedent
            used.append(reason)
        point = -self._trail[place]
        self._step *= DECAY
        number = self._derive((point, *learnt), (*units, *reversed(used)))
        back = max((self._level[abs(literal)] for literal in learnt), default=0)
        self._retreat(back)
        if learnt:
            learnt.sort(key=lambda literal: -self._level[abs(literal)])
            self._watch(number, (point, *learnt))
        else:
            self._unit[abs(point)] = number
        self._assign(point, number)

    def _bump(self, variable: int) -> None:
        self._activity[variable] += self._step
        if self._activity[variable] > 1e100:
            self._step *= 1e-100
            self._activity = {name: value * 1e-100 for name, value in self._activity.items()}
            self._queue = sorted((-value, name) for name, value in self._activity.items())


class NotRefutedError(RobustError):
    """The formula has a model, so that there is nothing to certify."""


Line = list[Any]
Fact = tuple[Linear, bool]
"""`form ≥ 0`, or `> 0`; the coefficient of `""` is the constant."""


@dataclass(frozen=True, slots=True)
class LinearSide:
    """`Σ factor · variable + constant ≥ 0`, or `> 0` if strict, over integers."""

    factors: tuple[tuple[str, int], ...]
    constant: int
    strict: bool
    scale: Fraction = Fraction(1)
    """The integers are those of what is meant times this."""

    @staticmethod
    def of(form: Mapping[str, Fraction | int], strict: bool) -> LinearSide:
        scale = lcm(*(Fraction(value).denominator for value in form.values()))
        whole = {name: int(value * scale) for name, value in form.items()}
        divisor = gcd(*whole.values()) or 1
        factors = tuple((name, value // divisor) for name, value in whole.items() if name and value)
        return LinearSide(factors, whole.get("", 0) // divisor, strict, Fraction(scale, divisor))

    @property
    def fact(self) -> Fact:
        form = {name: Fraction(value) for name, value in (*self.factors, ("", self.constant)) if value}
        return form, self.strict

    def holds(self, point: Mapping[str, Fraction]) -> bool:
        zero = Fraction(0)
        level = self.constant + sum((factor * point.get(name, zero) for name, factor in self.factors), zero)
        return level > 0 or (level == 0 and not self.strict)


def compared(said: tuple[dict[str, int], bool]) -> LinearSide:
    """What a literal of a comparison says."""
    form, strict = said
    return LinearSide(tuple((name, value) for name, value in form.items() if name), form.get("", 0), strict)


@dataclass(frozen=True, slots=True)
class Conflict:
    """Sides that contradict each other: positive multiples of these, by place, add up to less than nothing."""

    multiples: dict[int, int]


def contradiction(sides: Sequence[LinearSide]) -> Conflict | dict[str, Fraction]:
    """A minimal contradictory subset with its multiples [Farkas 1902], or a point that satisfies all."""
    names = list(dict.fromkeys(name for side in sides for name, _ in side.factors))
    place = {name: index for index, name in enumerate(names)}
    tableau = simplex.Tableau(len(names))
    for side in sides:
        form = [0] * len(names)
        for name, factor in side.factors:
            form[place[name]] = -factor
        tableau.add(form, constraints.Sense.LESS if side.strict else constraints.Sense.AT_MOST, side.constant)
    if tableau.restore():
        return dict(zip(names, tableau.point(), strict=True))
    divisor = gcd(*tableau.weights.values())
    return Conflict({slack - len(names): weight // divisor for slack, weight in sorted(tableau.weights.items())})


class KnownFacts:
    """The checker's facts, of which a search takes in only those that it runs into."""

    def __init__(self, facts: Sequence[Fact]) -> None:
        self.sides = [LinearSide.of(form, strict) for form, strict in facts]
        self._active: dict[int, None] = {}
        self.lemmas: dict[Clause, _Lemma] = {}
        """Of one circuit, by its literals: what searches have found, for those that come after them."""

    def imply(self, form: Mapping[str, Fraction]) -> bool:
        """Whether a form is negative nowhere where the facts hold."""
        negated = LinearSide.of({name: -value for name, value in form.items()}, strict=True)
        return not isinstance(self.contradiction([negated]), dict)

    def contradiction(
        self, sides: Sequence[LinearSide]
    ) -> tuple[dict[int, int], list[tuple[int, Fraction]]] | dict[str, Fraction]:
        """Multiples of the sides, by place, and of facts, by number, that contradict each other, or a point where all
        hold."""
        while True:
            active = list(self._active)
            answer = contradiction([*sides, *(self.sides[number] for number in active)])
            if isinstance(answer, Conflict):
                given = {place: factor for place, factor in answer.multiples.items() if place < len(sides)}
                facts = ((active[p - len(sides)], f) for p, f in answer.multiples.items() if p >= len(sides))
                return given, [(number, factor * self.sides[number].scale) for number, factor in facts]
            unused = (number for number in range(len(self.sides)) if number not in self._active)
            broken = [number for number in unused if not self.sides[number].holds(answer)]
            if not broken:
                return answer
            self._active.update(dict.fromkeys(broken[:40]))

    def denial(self, form: Mapping[str, Fraction], *, strict: bool) -> list[tuple[int, Fraction]] | None:
        """Positive multiples of facts, by number, that contradict `form ≥ 0`, or `> 0`; None if there are none."""
        side = LinearSide.of(form, strict)
        answer = self.contradiction([side])
        if isinstance(answer, dict) or 0 not in answer[0]:
            return None
        unit = answer[0][0] * side.scale
        return [(number, factor / unit) for number, factor in answer[1]]


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
    also = list(also)
    search = _Search(formulas, facts, [*formulas.roots(literal), *also], deadline)
    if also:
        search.learn_from_others()
    if search.search() is not None:
        raise NotRefutedError("found a formula that can be satisfied, expected one that cannot")
    return search.line()


@dataclass(frozen=True, slots=True)
class Model:
    """How a literal can be true: comparisons that are enough for that, and a point where they hold with all facts."""

    sides: tuple[LinearSide, ...]
    point: Mapping[str, Fraction]


class SolverModels:
    """Models of literals that z3 finds, for which no proof is wanted: the circuit below them is written down once.

    Args:
        formulas: the checker's formulas.
        facts: what holds.
        literals: those that are asked about.
    """

    def __init__(self, formulas: Formulas, facts: KnownFacts, literals: Sequence[int]) -> None:
        self._formulas = formulas
        self._facts = facts
        self._terms = Terms()
        definitions = [each for defining in formulas.definitions.values() for each in defining]
        self._nodes = sorted(_below(formulas, [*literals, *definitions]))
        gates = formulas.circuit
        self._sides = {number: compared(gates.said(number)) for number in self._nodes if not gates.is_gate(number)}
        self._names = dict.fromkeys(name for side in (*self._sides.values(), *facts.sides) for name, _ in side.factors)
        self._written: dict[int, Formula] = {}
        for number in self._nodes:
            side, inputs = self._sides.get(number), gates.nodes[number]
            whole = self._terms.conjunction(map(self._formula, inputs)) if side is None else self._comparison(side)
            self._written[number] = whole
        self._session = Session(self._terms)
        self._session.add(*map(self._comparison, facts.sides), *map(self._formula, definitions))

    def model(
        self, literals: Sequence[int], deadline: Deadline, assumed: Sequence[LinearSide] = ()
    ) -> tuple[int, Model] | None:
        """The first of the literals that are true in some model where facts and assumptions hold, and how.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        some = self._terms.disjunction(map(self._formula, literals))
        with self._session.frame(some, *map(self._comparison, assumed)):
            verdict = self._session.check("a model for a certificate", deadline)
            if verdict is Satisfiability.UNKNOWN:
                raise OutOfTimeError(self._session.failure)
            if verdict is Satisfiability.UNSATISFIABLE:
                return None
            values = self._session.values(self._terms.real(ParameterReference(name)) for name in self._names)
        point = {name: Fraction(values.get(name, 0)) for name in self._names}
        truths: dict[int, bool] = {}
        for number in self._nodes:
            side, inputs = self._sides.get(number), self._formulas.circuit.nodes[number]
            all_hold = all(truths[abs(each)] == (each > 0) for each in inputs) if side is None else side.holds(point)
            truths[number] = all_hold
        found = next(each for each in literals if truths[abs(each)] == (each > 0))
        search = _Search(self._formulas, self._facts, self._formulas.roots(found), deadline, assumed)
        return found, Model(tuple(search.sides_of(truths)), point)

    def _formula(self, literal: int) -> Formula:
        return self._written[literal] if literal > 0 else self._terms.negation(self._written[-literal])

    def _comparison(self, side: LinearSide) -> Formula:
        form = constant(side.constant)
        for name, factor in side.factors:
            form += variable(ParameterReference(name)).scaled(Fraction(factor))
        return self._terms.greater(form) if side.strict else self._terms.at_least(form)


def _below(formulas: Formulas, roots: Iterable[int]) -> Iterable[int]:
    """Every node below the roots."""
    seen = dict.fromkeys(abs(root) for root in roots)
    queue = list(seen)
    for number in queue:
        if formulas.circuit.is_gate(number):
            new = dict.fromkeys(abs(literal) for literal in formulas.circuit.nodes[number] if abs(literal) not in seen)
            seen.update(new)
            queue += new
    return seen


def model(
    formulas: Formulas, facts: KnownFacts, literal: int, deadline: Deadline, assumed: Sequence[LinearSide] = ()
) -> Model | None:
    """How a literal can be true where facts and assumptions hold; None if it cannot.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    search = _Search(formulas, facts, formulas.roots(literal), deadline, assumed)
    try:
        return search.search(ROUNDS)
    except _TooLongError:
        found = SolverModels(formulas, facts, [literal]).model([literal], deadline, assumed)
        return None if found is None else found[1]


ROUNDS = 20
"""Contradictions that a search for a model finds by itself; z3 is asked after that, because no proof is wanted."""


class _TooLongError(Exception):
    """A search has found as many contradictions as it may."""


class _Search:
    def __init__(
        self,
        formulas: Formulas,
        facts: KnownFacts,
        roots: Sequence[int],
        deadline: Deadline,
        assumed: Sequence[LinearSide] = (),
    ) -> None:
        self._circuit = formulas.circuit
        self._facts = facts
        self._roots = roots
        self._assumed = assumed
        self._deadline = deadline
        self._solver = PropositionalSolver()
        self._origins: dict[int, _Origin] = {}
        self._sides: dict[int, LinearSide] = {}
        nodes = list(_below(formulas, roots))
        self._cone = set(nodes)
        self._shares = False
        for number in nodes:
            if self._circuit.is_gate(number):
                inputs = self._circuit.nodes[number]
                self._add((number, *(-literal for literal in inputs)), (number, 0))
                for index, literal in enumerate(inputs, start=1):
                    self._add((-number, literal), (number, index))
        for lemma in self._orders(nodes):
            self._add(lemma.clause, lemma)
        for index, root in enumerate(roots):
            self._add((root,), index)

    def search(self, rounds: int | None = None) -> Model | None:
        """A model; None if the clauses that have been added refute the roots.

        Raises:
            _TooLongError: if that takes more than some rounds.
        """
        while (truths := self._solver.solve(self._deadline)) is not None:
            self._deadline.enforce()
            if rounds is not None:
                rounds -= 1
                if rounds < 0:
                    raise _TooLongError
            literals = self._justification(truths)
            sides = [self._side(literal) for literal in literals]
            answer = self._facts.contradiction([*sides, *self._assumed])
            if isinstance(answer, dict):
                return Model(tuple(sides), answer)
            multiples = {place: factor for place, factor in answer[0].items() if place < len(sides)}
            clause = tuple(-literals[place] for place in multiples)
            lemma = _Lemma(clause, tuple(multiples.values()), tuple(answer[1]))
            self._add(clause, lemma)
            if self._shares:
                self._facts.lemmas.setdefault(clause, lemma)
        return None

    def learn_from_others(self) -> None:
        """Take in what earlier searches with these facts have found, and share what this one finds.

        All other literals of a region are the same from obligation to obligation, and so are most contradictions.
        """
        self._shares = True
        for clause, lemma in self._facts.lemmas.items():
            if all(abs(literal) in self._cone for literal in clause):
                self._add(clause, lemma)

    def _add(self, clause: Clause, origin: _Origin) -> None:
        self._origins[self._solver.add(clause)] = origin

    def _side(self, literal: int) -> LinearSide:
        if literal not in self._sides:
            self._sides[literal] = compared(self._circuit.said(literal))
        return self._sides[literal]

    def sides_of(self, truths: dict[int, bool]) -> Iterator[LinearSide]:
        """Comparisons that are enough to make all roots true."""
        return map(self._side, self._justification(truths))

    def _orders(self, nodes: Iterable[int]) -> Iterator[_Lemma]:
        """Tighter comparisons of one linear form imply looser ones; stated before the search needs it."""
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
            for operand in needed:
                if operand not in seen:
                    seen.add(operand)
                    queue.append(operand)
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
            if (derivation := solver.derivations.get(number)) is not None:
                line.append([list(derivation.clause), [hint[number] for number in derivation.hints]])
            elif isinstance(origin := self._origins[number], _Lemma):
                multiples = _whole([*map(Fraction, origin.multipliers), *(factor for _, factor in origin.facts)])
                ours, others = multiples[: len(origin.clause)], multiples[len(origin.clause) :]
                facts = [[fact, factor] for (fact, _), factor in zip(origin.facts, others, strict=True)]
                line.append([list(origin.clause), ours, facts])
            else:
                hint[number] = list(origin) if isinstance(origin, tuple) else origin
                continue
            hint[number] = len(self._roots) + len(line) - 2
        line.append([[], [hint[number] for number in solver.refutation.hints]])
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
    found = facts.denial({name: -value for name, value in form.items()}, strict=not strictly)
    if found is None:
        raise NotRefutedError(f"found {dict(form)} negative somewhere, expected it nowhere")
    return found
