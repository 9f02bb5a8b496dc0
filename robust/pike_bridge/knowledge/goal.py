"""The goal of the πTMS [PIKE §5.3]: all constraints and conflicts, and its label, as decision diagrams.

The label has too many environments to be listed where a plan is feasible in many ways, but those that begin and end
alike share nodes: 10²³ prime implicants take hundreds of nodes. Constraints and conflicts that share no variables, not
even through others, are parts with prime implicants of their own, and those of all are the products of these.

How large diagrams get hangs on the order of variables, so that two are tried.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Final

from robust.pike_bridge.knowledge.diagrams import FALSE, TRUE, Choice, Functions
from robust.pike_bridge.knowledge.interface import Narrowing
from robust.pike_bridge.knowledge.orders import connected, race
from robust.pike_bridge.model import Assignment, Guard
from robust.smt.limits import Deadline

LARGEST_GOAL: Final = 8_000_000
"""Nodes and results of operations that are remembered."""


@dataclass(frozen=True, slots=True)
class Part:
    """Independent constraints and conflicts."""

    variables: frozenset[int]
    """All of the constraints and conflicts."""
    function: int
    """That they hold."""


FALSITY: Final = Part(frozenset(), FALSE)


@dataclass(frozen=True, slots=True)
class Goal:
    """Parts of one set of diagrams; committing gives another goal, which shares them.

    All methods raise OutOfTimeError if the deadline passes, or the diagrams get too large.
    """

    diagrams: ChoiceDiagrams
    parts: tuple[Part, ...]

    def narrowed(self, asked: Narrowing, deadline: Deadline) -> Goal:
        """What is left of the goal once commitments hold."""
        functions = self.diagrams.functions
        parts = self.parts if asked.consistent else (FALSITY,)
        if FALSITY not in parts:
            for variable, number in self.diagrams.choices(asked.required.items()):
                literal = Part(frozenset({variable}), functions.assigned(variable, number))
                parts = self._joined(parts, literal, deadline)
            for conflict in asked.conflicts:
                parts = self._excluding(parts, self.diagrams.choices(conflict), deadline)
        return Goal(self.diagrams, (FALSITY,) if any(part.function == FALSE for part in parts) else parts)

    def possible(self, asked: Narrowing, deadline: Deadline) -> bool:
        """Whether some model satisfies what is asked, of which only the parts that it is about need be searched."""
        question = self._asked(asked)
        mentioned = {variable for conflict in question.conflicts for variable, _ in conflict}
        mentioned |= question.required.keys()
        relevant = [part for part in self.parts if part.function == FALSE or part.variables & mentioned]
        return _ModelSearch(self.diagrams.functions, relevant, question, deadline).succeeds()

    def count(self, deadline: Deadline) -> int:
        """How many models there are."""
        functions = self.diagrams.functions
        free = prod(functions.sizes)
        models = 1
        for part in self.parts:
            own = prod(functions.sizes[variable] for variable in part.variables)
            models *= functions.count(part.function, deadline) * own // prod(functions.sizes)
            free //= own
        return models * free

    def implicant_count(self, deadline: Deadline) -> int:
        """How many prime implicants there are."""
        families = self.diagrams.functions.families
        return prod(families.count(family, deadline) for family in self.label(deadline))

    def prime_implicants(self, deadline: Deadline) -> Iterator[Guard]:
        """Each prime implicant, once."""
        for made in self.diagrams.functions.families.environments(self.label(deadline)):
            deadline.enforce()
            yield frozenset(self.diagrams.decode(made))

    def label(self, deadline: Deadline) -> list[int]:
        """The prime implicants of each part, as families; what was found for another goal need not be found again."""
        return [self.diagrams.functions.primes(part.function, deadline) for part in self.parts]

    def size(self) -> int:
        """How many nodes the functions have."""
        return self.diagrams.functions.size(part.function for part in self.parts)

    def _asked(self, asked: Narrowing) -> _Question:
        choices = self.diagrams.choices
        required = dict(choices(asked.required.items()))
        values = dict.fromkeys(range(len(self.diagrams.functions.sizes)), 0) | required
        return _Question(required, [choices(conflict) for conflict in asked.conflicts], values)

    def _joined(self, parts: Iterable[Part], new: Part, deadline: Deadline) -> tuple[Part, ...]:
        """Parts with one more, which those that it shares variables with become one with."""
        apart = []
        for part in parts:
            if part.variables & new.variables:
                both = self.diagrams.functions.both(part.function, new.function, deadline)
                new = Part(part.variables | new.variables, both)
            else:
                apart.append(part)
        return (*apart, new)

    def _excluding(self, parts: tuple[Part, ...], conflict: Sequence[Choice], deadline: Deadline) -> tuple[Part, ...]:
        """Parts with one more conflict; it joins no parts that it does not have to."""
        functions = self.diagrams.functions
        left = list(conflict)
        for part in parts:
            own = [each for each in left if each[0] in part.variables]
            if not own:
                continue
            resolved = functions.both(part.function, functions.excluded(own), deadline)
            if resolved == part.function:
                return parts  # as in all of its models
            if resolved == FALSE:  # in none: so the other parts must
                left = [each for each in left if each not in own]
        new = Part(frozenset(variable for variable, _ in left), functions.excluded(left))
        return self._joined(parts, new, deadline)


@dataclass(frozen=True, slots=True)
class _Question:
    """What is asked, by numbers."""

    required: Mapping[int, int]
    conflicts: Sequence[Sequence[Choice]]
    begin: Mapping[int, int]
    """A value of every variable, with which the search begins."""


@dataclass(slots=True)
class _ModelSearch:
    """A search for a model, led by conflicts: one that a model of the parts manifests is resolved in each way in turn.

    So variables that no conflict is about are never decided upon, as they would be if conflicts were conjoined.
    """

    functions: Functions
    parts: Sequence[Part]
    question: _Question
    deadline: Deadline

    def succeeds(self) -> bool:
        """Whether there is a model."""
        required = [choice for item in self.question.required.items() for choice in self._others(*item)]
        stack = [frozenset(required)]
        while stack:
            self.deadline.enforce()
            forbidden = stack.pop()
            model = self._model(forbidden)
            if model is None:
                continue
            conflict = next((each for each in self.question.conflicts if _manifests(model, each)), None)
            if conflict is None:
                return True
            earlier: set[Choice] = set()
            for choice in conflict:
                stack.append(forbidden | earlier | {choice})
                earlier.update(self._others(*choice))
        return False

    def _model(self, forbidden: frozenset[Choice]) -> dict[int, int] | None:
        """Of the parts, with what no part says as in the beginning, if that is not forbidden."""
        model = dict(self.question.begin)
        for variable in {variable for variable, _ in forbidden}:
            left = [number for number in range(self.functions.sizes[variable]) if (variable, number) not in forbidden]
            if not left:
                return None
            if model[variable] not in left:
                model[variable] = left[0]
        for part in self.parts:
            found = self.functions.find(part.function, forbidden, model, self.deadline)
            if found is None:
                return None
            model |= found
        return model

    def _others(self, variable: int, number: int) -> Iterator[Choice]:
        """All other values of a variable."""
        return ((variable, each) for each in range(self.functions.sizes[variable]) if each != number)


def _manifests(model: Mapping[int, int], conflict: Sequence[Choice]) -> bool:
    return all(model[variable] == number for variable, number in conflict)


class ChoiceDiagrams:
    """Functions of the variables of a theory, in some order."""

    def __init__(self, domains: Mapping[str, tuple[str, ...]], order: Sequence[str], largest: int) -> None:
        self.functions = Functions([len(domains[variable]) for variable in order], largest)
        self._choices = {
            Assignment(variable, value): (place, number)
            for place, variable in enumerate(order)
            for number, value in enumerate(domains[variable])
        }
        self._assignments = {choice: assignment for assignment, choice in self._choices.items()}

    def choices(self, assignments: Iterable[tuple[str, str]]) -> list[Choice]:
        """Assignments by their numbers."""
        return [self._choices[Assignment(*each)] for each in assignments]

    def decode(self, choices: Iterable[Choice]) -> Iterator[Assignment]:
        """Assignments from their numbers."""
        return map(self._assignments.__getitem__, choices)


def compile_goal(
    domains: Mapping[str, tuple[str, ...]],
    labels: Sequence[Sequence[Guard]],
    conflicts: Sequence[Guard],
    deadline: Deadline,
    largest: int = LARGEST_GOAL,
) -> Goal:
    """The goal that all constraints and conflicts justify, and its label.

    Args:
        labels: of the nodes of the constraints.

    Raises:
        OutOfTimeError: if the deadline passes, or the diagrams of both orders get too large.
    """
    groups = [{each.variable for environment in label for each in environment} for label in labels]
    groups += [{each.variable for each in conflict} for conflict in conflicts]

    def compile_in(order: Sequence[str], space: int) -> Goal:
        return _compile(ChoiceDiagrams(domains, order, space), labels, conflicts, deadline)

    goal = race(tuple(domains), groups, largest, compile_in)
    goal.diagrams.functions.largest = largest
    goal.label(deadline)
    return goal


def _compile(
    diagrams: ChoiceDiagrams, labels: Sequence[Sequence[Guard]], conflicts: Sequence[Guard], deadline: Deadline
) -> Goal:
    functions = diagrams.functions
    parts: list[Part] = []
    for label in labels:
        environments = [diagrams.choices(each) for each in label]
        mentioned = frozenset(variable for each in environments for variable, _ in each)
        parts.append(Part(mentioned, functions.some(environments, deadline)))
    for conflict in conflicts:
        choices = diagrams.choices(conflict)
        parts.append(Part(frozenset(variable for variable, _ in choices), functions.excluded(choices)))
    independent = []
    for group in connected((part for part in parts if part.function != TRUE), lambda part: part.variables):
        group.sort(key=lambda part: min(part.variables, default=0))
        function = functions.all([part.function for part in group], deadline)
        independent.append(Part(frozenset().union(*(part.variables for part in group)), function))
    return Goal(diagrams, (FALSITY,) if any(part.function == FALSE for part in independent) else tuple(independent))
