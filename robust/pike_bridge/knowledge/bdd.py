"""A static order of variables in which those that occur together are close to each other."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from math import prod
from typing import Any, Protocol, TypeAlias, assert_never

from robust.pike_bridge.knowledge.interface import (
    Commitment,
    KnowledgeBase,
    KnowledgeStatistics,
    OutOfSpaceError,
    assignments_of,
    check_theory,
    fold,
    is_consistent,
    narrowing,
)
from robust.pike_bridge.knowledge.labels import NOTHING, UNIT, Families, evaluate
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory
from robust.smt.limits import Deadline

ROUNDS = 40


def force_order(variables: Sequence[str], groups: Sequence[Collection[str]]) -> list[str]:
    """An order that keeps each group within a small span.

    The FORCE heuristic (Aloul, Markov and Sakallah, 2003): move each variable to the mean of the centres of its groups,
    sort, and repeat; the order with the least sum of spans is the result.
    """
    order = list(variables)
    best, least = order, _spans(order, groups)
    by_variable: dict[str, list[int]] = {variable: [] for variable in variables}
    for index, group in enumerate(groups):
        for variable in group:
            by_variable[variable].append(index)
    for _ in range(ROUNDS):
        place = {variable: at for at, variable in enumerate(order)}
        centres = [sum(place[variable] for variable in group) / len(group) if group else 0.0 for group in groups]
        target = {
            variable: sum(centres[index] for index in indices) / len(indices) if indices else float(place[variable])
            for variable, indices in by_variable.items()
        }
        order = sorted(order, key=lambda variable: (target[variable], place[variable]))
        total = _spans(order, groups)
        if total >= least:
            break
        best, least = order, total
    return best


def _spans(order: Sequence[str], groups: Sequence[Collection[str]]) -> int:
    place = {variable: at for at, variable in enumerate(order)}
    return sum(max(map(place.__getitem__, group)) - min(map(place.__getitem__, group)) for group in groups if group)


class Functions(Protocol):
    """Functions over finite-domain variables, which can be compared, hashed, and conjoined by `&`."""

    def top(self, function: Any) -> int | None:
        """The first variable that a function depends on; None for constants."""

    def cofactors(self, function: Any, variable: int) -> list[Any]:
        """What is left of a function for each value of a variable."""

    def is_false(self, function: Any) -> bool:
        """Whether a function is the constant."""


def primes(root: Any, functions: Functions, families: Families, deadline: Deadline) -> int:
    """The prime implicants of a function, as one of the families.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    known: dict[Any, int] = {}

    def step(function: Any) -> int | list[Any]:
        variable = functions.top(function)
        if variable is None:
            return NOTHING if functions.is_false(function) else UNIT
        parts = functions.cofactors(function, variable)
        always = reduce(lambda first, second: first & second, parts)
        missing = [each for each in (always, *parts) if each not in known]
        if missing:
            return missing
        without = known[always]
        assigned = tuple(families.difference(known[part], without, deadline) for part in parts)
        return families.branch(variable, without, assigned)

    return evaluate(root, known, step, deadline)


NEVER = Deadline()
LARGEST_DIAGRAM = 5_000_000
"""Nodes; conjunction with one more constraint of this size takes seconds, which no deadline can cut short."""
GLANCE = 32
"""Conflicts of a question between two looks at the number of nodes, which takes longer than most conjunctions."""

Node: TypeAlias = Any
"""A function in `dd`, which has no types."""


def create_manager() -> Any:
    """A manager of decision diagrams without dynamic reordering, which may take longer than any deadline."""
    try:
        from dd import cudd as module  # noqa: PLC0415 - a binding that is not built everywhere
    except ImportError:
        from dd import autoref as module  # noqa: PLC0415
    manager = module.BDD()
    manager.configure(reordering=False)
    return manager


class Diagrams:
    """Diagrams of formulas about finite-domain variables, whose values are numbered in binary."""

    def __init__(self, domains: Mapping[str, tuple[str, ...]], order: Sequence[str]) -> None:
        self.manager = create_manager()
        self.order = tuple(order)
        self._domains = domains
        self.digits: dict[str, tuple[str, ...]] = {}
        """The binary variables of each variable; none if it has only one value."""
        self._values: dict[Assignment, Node] = {}
        self._places: dict[str, int] = {}
        position = 0
        for place, variable in enumerate(order):
            count = (len(domains[variable]) - 1).bit_length()
            self.digits[variable] = tuple(f"b{position + at}" for at in range(count))
            self._places |= dict.fromkeys(self.digits[variable], place)
            position += count
            self.manager.declare(*self.digits[variable])
            for number, value in enumerate(domains[variable]):
                self._values[Assignment(variable, value)] = self.manager.cube(self._code(variable, number))

    def valid(self, variable: str) -> Node:
        """That the digits are the number of some value."""
        return self.any(self._values[Assignment(variable, value)] for value in self._domains[variable])

    def environment(self, assignments: Iterable[Assignment]) -> Node:
        """The conjunction of assignments."""
        return reduce(
            lambda first, second: first & second, map(self._values.__getitem__, assignments), self.manager.true
        )

    def any(self, parts: Iterable[Node]) -> Node:
        """The disjunction of diagrams."""
        return reduce(lambda first, second: first | second, parts, self.manager.false)

    def formula(self, formula: Formula) -> Node:
        """The diagram of a formula."""
        return fold(formula, self._combine)

    def top(self, node: Node) -> int | None:
        """The place of the first variable that a diagram depends on; None for constants."""
        place = self.depth(node)
        return None if place == len(self.order) else place

    def is_false(self, node: Node) -> bool:
        """Whether the diagram has no models."""
        return bool(node == self.manager.false)

    def cofactors(self, node: Node, place: int) -> list[Node]:
        """What is left of a diagram for each value of the variable at that place of the order."""
        variable = self.order[place]
        if not self.digits[variable]:
            return [node]
        numbers = range(len(self._domains[variable]))
        return [self.manager.let(self._code(variable, number), node) for number in numbers]

    def depth(self, node: Node) -> int:
        """The place of the first variable that a diagram depends on; after all of them for constants."""
        return len(self.order) if node in (self.manager.true, self.manager.false) else self._places[node.var]

    def _code(self, variable: str, number: int) -> dict[str, bool]:
        return {digit: bool(number >> at & 1) for at, digit in enumerate(self.digits[variable])}

    def _combine(self, formula: Formula, parts: list[Node]) -> Node:
        match formula:
            case Is(assignment):
                return self._values[assignment]
            case Not():
                return ~parts[0]
            case All():
                return reduce(lambda first, second: first & second, parts, self.manager.true)
            case Some():
                return self.any(parts)
            case _:
                assert_never(formula)


class BddKnowledgeBase(KnowledgeBase):
    """One decision diagram, into which constraints are conjoined one at a time; questions conjoin a few more.

    Args:
        theory: what is compiled.
        deadline: for compiling; looked at between constraints.
        statistics: counters to add to.
        largest_diagram: the number of nodes that the manager may hold.

    Raises:
        InputError: if the theory mentions an unknown variable or value, or a variable without values.
        OutOfTimeError: if the deadline passes, or the diagram gets too large.
    """

    name = "bdd"

    def __init__(
        self,
        theory: Theory,
        *,
        deadline: Deadline = NEVER,
        statistics: KnowledgeStatistics | None = None,
        largest_diagram: int = LARGEST_DIAGRAM,
    ) -> None:
        check_theory(theory)
        self.theory = theory
        self.statistics = statistics or KnowledgeStatistics()
        self._largest_diagram = largest_diagram
        started = time.perf_counter()
        try:
            deadline.enforce()
            self._root = self._compile(deadline)
        finally:
            self.statistics.seconds += time.perf_counter() - started

    def satisfiable(self, deadline: Deadline = NEVER) -> bool:
        return self._ask((), deadline)

    def could_commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> bool:
        return self._ask(commitments, deadline)

    def commit(self, commitments: Sequence[Commitment], deadline: Deadline = NEVER) -> None:
        deadline.enforce()
        self._root = self._narrowed(commitments, deadline)
        self.statistics.sizes["diagram nodes"] = len(self._root)

    def find_model(
        self, commitments: Sequence[Commitment], preferred: Mapping[str, str], deadline: Deadline = NEVER
    ) -> Mapping[str, str] | None:
        """One variable after the other keeps its preferred value, if it can."""
        deadline.enforce()
        self.statistics.queries += 1
        root = self._narrowed(commitments, deadline)
        false = self._diagrams.manager.false
        if root == false:
            return None
        model = {}
        for variable, values in self.theory.domains.items():
            first = preferred.get(variable)
            for value in values if first is None else (first, *values):
                rest = root & self._diagrams.environment([Assignment(variable, value)])
                if rest != false:
                    root, model[variable] = rest, value
                    break
        return model

    def count_models(self, deadline: Deadline = NEVER) -> int:
        """Exact: CUDD's own count is a floating-point number."""
        deadline.enforce()
        self.statistics.queries += 1
        known: dict[Node, int] = {}
        depth = self._diagrams.depth
        sizes = [len(self.theory.domains[variable]) for variable in self._diagrams.order]

        def step(node: Node) -> int | list[Node]:
            place = depth(node)
            if place == len(sizes):
                return int(node == self._diagrams.manager.true)
            parts = self._diagrams.cofactors(node, place)
            missing = [part for part in parts if part not in known]
            return missing or sum(known[part] * prod(sizes[place + 1 : depth(part)]) for part in parts)

        return evaluate(self._root, known, step, deadline) * prod(sizes[: depth(self._root)])

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has, computed without listing them.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        families, implicants = self._primes(deadline)
        return families.count(implicants, deadline)

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before they are found.
        """
        families, implicants = self._primes(deadline)
        order, domains = self._diagrams.order, self.theory.domains
        for made in families.environments(implicants):
            yield frozenset(Assignment(order[at], domains[order[at]][number]) for at, number in made)

    def _primes(self, deadline: Deadline) -> tuple[Families, int]:
        deadline.enforce()
        families = Families()
        found = primes(self._root, self._diagrams, families, deadline)
        self.statistics.sizes["implicant diagram nodes"] = len(families)
        return families, found

    def models(self, deadline: Deadline = NEVER) -> Iterator[Mapping[str, str]]:
        deadline.enforce()
        self.statistics.queries += 1
        return self._enumerate(deadline)

    def _enumerate(self, deadline: Deadline) -> Iterator[Mapping[str, str]]:
        false = self._diagrams.manager.false
        stack: list[tuple[Node, tuple[str, ...]]] = [(self._root, ())]
        while stack:
            deadline.enforce()
            node, values = stack.pop()
            if node == false:
                continue
            if len(values) == len(self._diagrams.order):
                yield dict(zip(self._diagrams.order, values, strict=True))
                continue
            parts = self._diagrams.cofactors(node, len(values))
            domain = self.theory.domains[self._diagrams.order[len(values)]]
            stack += [(part, (*values, value)) for part, value in zip(parts, domain, strict=True)]

    def _compile(self, deadline: Deadline) -> Node:
        conflicts = [each for each in dict.fromkeys(self.theory.conflicts) if is_consistent(each)]
        mentioned = [{one.variable for one in assignments_of(each)} for each in self.theory.constraints]
        excluded = [{one.variable for one in each} for each in conflicts]
        order = force_order(tuple(self.theory.domains), [*mentioned, *excluded])
        self._diagrams = Diagrams(self.theory.domains, order)
        place = {variable: at for at, variable in enumerate(order)}

        # From the last variables to the first, so that what is built already stays as it is below the new constraint.
        work: list[tuple[int, int, Formula | frozenset[Assignment] | str]] = []
        work += [
            (_first(group, place), 2, formula)
            for group, formula in zip(mentioned, self.theory.constraints, strict=True)
        ]
        work += [(_first(group, place), 1, conflict) for group, conflict in zip(excluded, conflicts, strict=True)]
        work += [(place[variable], 0, variable) for variable in order if self._diagrams.digits[variable]]
        work.sort(key=lambda item: (-item[0], item[1]))
        root = self._diagrams.manager.true
        for _, _, item in work:
            root &= self._part(item)
            self._look(deadline)
            self.statistics.sizes["diagram nodes"] = len(root)
        return root

    def _part(self, item: Formula | frozenset[Assignment] | str) -> Node:
        match item:
            case str():
                return self._diagrams.valid(item)
            case frozenset():
                return ~self._diagrams.environment(item)
            case _:
                return self._diagrams.formula(item)

    def _ask(self, commitments: Sequence[Commitment], deadline: Deadline) -> bool:
        deadline.enforce()
        self.statistics.queries += 1
        return bool(self._narrowed(commitments, deadline) != self._diagrams.manager.false)

    def _narrowed(self, commitments: Sequence[Commitment], deadline: Deadline) -> Node:
        asked = narrowing(commitments, self.theory)
        if not asked.consistent:
            return self._diagrams.manager.false
        root = self._root & self._diagrams.environment(Assignment(*item) for item in asked.required.items())
        for number, conflict in enumerate(asked.conflicts):
            deadline.enforce()
            if number % GLANCE == GLANCE - 1:
                self._look(deadline)
            root &= ~self._diagrams.environment(conflict)
        return root

    def _look(self, deadline: Deadline) -> None:
        deadline.enforce()
        if len(self._diagrams.manager) > self._largest_diagram:
            raise OutOfSpaceError


def _first(group: Collection[str], place: Mapping[str, int]) -> int:
    return min((place[variable] for variable in group), default=len(place))
