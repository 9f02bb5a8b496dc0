"""Refutations of formulas of linear arithmetic: clauses, theory lemmas with multipliers, and a propositional proof.

Lazily [de Moura, Rueß and Sorea 2002]: the propositional solver proposes truth values, exact simplex says which of the
linear atoms that matter contradict each other, and that becomes a lemma. Only what the proof uses is kept.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from robust.certify.circuit import Circuit, Conjunction
from robust.certify.linear import Atom, constraint, contradiction
from robust.certify.propositional import Clause, PropositionalSolver
from robust.errors import RobustError
from robust.smt.limits import Deadline


class NotRefutedError(RobustError):
    """The formula has a model, so that there is nothing to certify."""


@dataclass(frozen=True, slots=True)
class GateClause:
    """Clause number `index` of those that define a gate."""

    gate: int
    index: int


@dataclass(frozen=True, slots=True)
class RootClause:
    """The literal of one conjunct of the formula; `index` is its place among them."""

    index: int


@dataclass(frozen=True, slots=True)
class Lemma:
    """A clause of linear atoms: the multiples of the negated literals add up to a contradiction."""

    clause: Clause
    multipliers: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Derived:
    """A clause that unit propagation derives from the steps numbered by `hints`; empty in the last step."""

    clause: Clause
    hints: tuple[int, ...]


Step = GateClause | RootClause | Lemma | Derived
Refutation = tuple[Step, ...]
"""Steps in an order in which each uses earlier ones only; the last one derives the empty clause."""


def gate_clauses(number: int, gate: Conjunction) -> list[Clause]:
    """What defines a conjunction: first the clause of all inputs, then one for each of them."""
    return [(number, *(-literal for literal in gate.inputs)), *((-number, literal) for literal in gate.inputs)]


class Refuter:
    """Refutes conjunctions of literals of one circuit, one after the other."""

    def __init__(self, circuit: Circuit) -> None:
        self._circuit = circuit

    def refute(self, roots: Sequence[int], deadline: Deadline) -> Refutation:
        """Why the roots cannot all be true.

        Raises:
            NotRefutedError: if they can.
            OutOfTimeError: if the deadline passes.
        """
        return _Search(self._circuit, roots, deadline).run()


class _Search:
    def __init__(self, circuit: Circuit, roots: Sequence[int], deadline: Deadline) -> None:
        self._circuit = circuit
        self._roots = roots
        self._deadline = deadline
        self._solver = PropositionalSolver()
        self._origins: dict[int, Step] = {}
        nodes = list(self._cone())
        for number in nodes:
            node = circuit.node(number)
            if isinstance(node, Conjunction):
                for index, clause in enumerate(gate_clauses(number, node)):
                    self._add(clause, GateClause(number, index))
        for lemma in self._orders(nodes):
            self._add(lemma.clause, lemma)
        for index, root in enumerate(roots):
            self._add((root,), RootClause(index))

    def run(self) -> Refutation:
        while (model := self._solver.solve(self._deadline)) is not None:
            self._deadline.enforce()
            literals = self._justification(model)
            found = contradiction([constraint(self._atom(literal), literal > 0) for literal in literals])
            if found is None:
                raise NotRefutedError("found a formula that can be satisfied, expected one that cannot")
            clause = tuple(-literals[index] for index in found.indices)
            self._add(clause, Lemma(clause, found.multipliers))
        return self._trimmed()

    def _add(self, clause: Clause, origin: Step) -> None:
        self._origins[self._solver.add(clause)] = origin

    def _atom(self, literal: int) -> Atom:
        node = self._circuit.node(literal)
        if not isinstance(node, Atom):
            raise TypeError(f"{node} is not a linear atom")
        return node

    def _cone(self) -> Iterable[int]:
        """Every node below the roots."""
        seen = dict.fromkeys(abs(root) for root in self._roots)
        queue = list(seen)
        for number in queue:
            node = self._circuit.node(number)
            if isinstance(node, Conjunction):
                new = [abs(literal) for literal in node.inputs if abs(literal) not in seen]
                seen.update(dict.fromkeys(new))
                queue += dict.fromkeys(new)
        return seen

    def _orders(self, nodes: Iterable[int]) -> Iterator[Lemma]:
        """Of atoms over one linear form the tighter implies the looser; stated before the search needs it."""
        forms: dict[tuple[tuple[str, int], ...], list[tuple[int, bool, int]]] = defaultdict(list)
        for number in nodes:
            node = self._circuit.node(number)
            if isinstance(node, Atom):
                forms[node.coefficients].append((node.bound, not node.strict, number))
        for alike in forms.values():
            for (_, _, tight), (_, _, loose) in pairwise(sorted(alike)):
                yield Lemma((-tight, loose), (1, 1))

    def _justification(self, model: dict[int, bool]) -> list[int]:
        """Literals of atoms that are enough to make all roots true."""
        chosen: dict[int, None] = {}
        queue = list(self._roots)
        seen = set(queue)
        for literal in queue:
            node = self._circuit.node(literal)
            needed: Iterable[int]
            match node:
                case Atom():
                    if not node.is_proposition:
                        chosen[literal] = None
                    continue
                case Conjunction(inputs):
                    needed = inputs if literal > 0 else (self._false_input(inputs, model, seen),)
            for each in needed:
                if each not in seen:
                    seen.add(each)
                    queue.append(each)
        return list(chosen)

    def _false_input(self, inputs: Sequence[int], model: dict[int, bool], seen: set[int]) -> int:
        """One input that is false, preferably one that is needed anyway or costs no atom."""
        false = [-literal for literal in inputs if model[abs(literal)] != (literal > 0)]
        return min(false, key=lambda literal: (literal not in seen, self._cost(literal)))

    def _cost(self, literal: int) -> int:
        node = self._circuit.node(literal)
        return 2 if isinstance(node, Conjunction) else 0 if node.is_proposition else 1

    def _trimmed(self) -> Refutation:
        """The steps that the refutation uses, renumbered."""
        solver = self._solver
        if solver.refutation is None:
            raise RuntimeError("there is no refutation to trim")
        used: set[int] = set()
        pending = list(solver.refutation.hints)
        while pending:
            number = pending.pop()
            if number not in used:
                used.add(number)
                if number in solver.derivations:
                    pending += solver.derivations[number].hints
        place = {number: index for index, number in enumerate(sorted(used))}
        steps: list[Step] = []
        for number in place:
            derivation = solver.derivations.get(number)
            if derivation is None:
                steps.append(self._origins[number])
            else:
                steps.append(Derived(derivation.clause, tuple(place[hint] for hint in derivation.hints)))
        return (*steps, Derived((), tuple(place[hint] for hint in solver.refutation.hints)))
