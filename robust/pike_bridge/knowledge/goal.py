"""The goal of the πTMS [PIKE §5.3], all constraints and conflicts, and its label, as decision diagrams of our own.

Variables and their values are numbered. :class:`Functions` are truth values over variables, :class:`Families` are sets
of environments, and the prime implicants of a function are a family. Equal nodes have one number, all algorithms
remember what they found, and none recurses.

Where a plan is feasible in many ways, the label has too many environments to be listed, but environments that begin and
end alike share nodes: 10²³ prime implicants take hundreds of nodes. Constraints and conflicts that share no variables,
not even through others, are parts with prime implicants of their own; those of the goal are the products of these.

The size of diagrams depends on the order of variables, so two orders are tried.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from math import prod
from typing import Final, NamedTuple, TypeAlias

from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import Key, Narrowing, OutOfSpaceError, connected, evaluate, race
from robust.smt.limits import NEVER, Deadline

Choice: TypeAlias = tuple[int, int]
"""A variable and one of its values, both by number."""

FALSE: Final = 0
TRUE: Final = 1
"""The constant functions."""
_LEAF: Final = sys.maxsize
"""In place of a variable, after all of them."""
_UNKNOWN: Final = -1


class Functions:
    """Truth values that depend on variables, each function by a number.

    Args:
        sizes: how many values each variable has.
        largest: how many nodes and results may be remembered; OutOfSpaceError beyond.
    """

    def __init__(self, sizes: Sequence[int], largest: int = sys.maxsize) -> None:
        self.sizes = tuple(sizes)
        self.largest = largest
        self._variables = [_LEAF, _LEAF]
        self._parts: list[tuple[int, ...]] = [(), ()]
        self._numbers: dict[tuple[int, tuple[int, ...]], int] = {}
        self._conjunctions: dict[tuple[int, int], int] = {}
        self._negations: dict[int, int] = {FALSE: TRUE, TRUE: FALSE}
        self._primes: dict[int, int] = {FALSE: NOTHING, TRUE: UNIT}
        self.families = Families()

    def branch(self, variable: int, parts: tuple[int, ...]) -> int:
        """The function that is one of the parts, by the value of a variable; these depend on later variables only."""
        if parts.count(parts[0]) == len(parts):
            return parts[0]
        number = self._numbers.get((variable, parts))
        if number is None:
            number = self._numbers[variable, parts] = len(self._parts)
            self._variables.append(variable)
            self._parts.append(parts)
        return number

    def assigned(self, variable: int, number: int) -> int:
        """The function that is true where a variable has a value."""
        return self.branch(variable, tuple(int(each == number) for each in range(self.sizes[variable])))

    def excluded(self, environment: Iterable[Choice]) -> int:
        """The function that is true where not all assignments of a consistent environment hold."""
        function = FALSE
        for variable, number in sorted(environment, reverse=True):
            parts = [TRUE] * self.sizes[variable]
            parts[number] = function
            function = self.branch(variable, tuple(parts))
        return function

    def some(self, environments: Iterable[Collection[Choice]], deadline: Deadline = NEVER) -> int:
        """The function that is true where all assignments of at least one environment hold."""

        def step(remaining: frozenset[tuple[Choice, ...]]) -> int | list[frozenset[tuple[Choice, ...]]]:
            if () in remaining or not remaining:
                return TRUE if remaining else FALSE
            variable = min(one[0][0] for one in remaining)
            parts = []
            for number in range(self.sizes[variable]):
                kept = (one for one in remaining if one[0][0] != variable or one[0][1] == number)
                parts.append(frozenset(made[1:] if made[0][0] == variable else made for made in kept))
            missing = [part for part in parts if part not in known]
            return missing or self.branch(variable, tuple(known[part] for part in parts))

        known: dict[frozenset[tuple[Choice, ...]], int] = {}
        return evaluate(frozenset(tuple(sorted(environment)) for environment in environments), known, step, deadline)

    def all(self, functions: Sequence[int], deadline: Deadline = NEVER) -> int:
        """The conjunction; neighbours are joined first, so that they should be about much the same variables.

        Raises:
            OutOfTimeError: if the deadline passes, or there is too much to remember.
        """
        conjuncts = list(functions) or [TRUE]
        while len(conjuncts) > 1:
            pairs = zip(conjuncts[::2], conjuncts[1::2], strict=False)
            odd = conjuncts[-1:] if len(conjuncts) % 2 else []
            conjuncts = [self.both(first, second, deadline) for first, second in pairs] + odd
        return conjuncts[0]

    def both(self, first: int, second: int, deadline: Deadline = NEVER) -> int:
        """The conjunction of two; errors as of :meth:`all`."""
        known = self._meet(first, second)
        pair = (min(first, second), max(first, second))
        return evaluate(pair, self._conjunctions, self._both, deadline) if known == _UNKNOWN else known

    def negated(self, function: int, deadline: Deadline = NEVER) -> int:
        """The negation; errors as of :meth:`all`."""

        def step(one: int) -> int | list[int]:
            missing = [part for part in self._parts[one] if part not in self._negations]
            self._look(len(self._negations))
            return missing or self.branch(
                self._variables[one], tuple(self._negations[part] for part in self._parts[one])
            )

        return evaluate(function, self._negations, step, deadline)

    def either(self, first: int, second: int, deadline: Deadline = NEVER) -> int:
        """The disjunction of two; errors as of :meth:`all`."""
        neither = self.both(self.negated(first, deadline), self.negated(second, deadline), deadline)
        return self.negated(neither, deadline)

    def left(self, function: int, variable: int, number: int) -> int:
        """What is left of a function that depends on no earlier variable, once this one has a value."""
        return self._at(function, variable)[number]

    def projected(self, function: int, onto: Functions, places: Mapping[int, int], deadline: Deadline = NEVER) -> int:
        """Whether the variables without a place can be such that a function is true, in other diagrams.

        Args:
            onto: the diagrams of the result.
            places: the variables of the result that are some of these.
        """
        known = {FALSE: FALSE, TRUE: TRUE}

        def step(one: int) -> int | list[int]:
            variable, parts = self._variables[one], self._parts[one]
            missing = [part for part in parts if part not in known]
            if missing:
                return missing
            cases = [known[part] for part in parts]
            if variable in places:
                values = (onto.assigned(places[variable], number) for number in range(len(cases)))
                cases = [onto.both(value, case, deadline) for value, case in zip(values, cases, strict=True)]
            return reduce(lambda one, other: onto.either(one, other, deadline), cases)

        return evaluate(function, known, step, deadline)

    def _both(self, pair: tuple[int, int]) -> int | list[tuple[int, int]]:
        first, second = pair
        variable = min(self._variables[first], self._variables[second])
        pairs = list(zip(self._at(first, variable), self._at(second, variable), strict=True))
        parts = [self._meet(*each) for each in pairs]
        missing = [(min(each), max(each)) for each, known in zip(pairs, parts, strict=True) if known == _UNKNOWN]
        self._look(len(self._conjunctions))
        return missing or self.branch(variable, tuple(parts))

    def _look(self, remembered: int) -> None:
        if len(self._parts) + remembered > self.largest:
            raise OutOfSpaceError

    def _meet(self, first: int, second: int) -> int:
        """The conjunction if it is known already."""
        if first > second:
            first, second = second, first
        if first in (FALSE, second):
            return first
        return second if first == TRUE else self._conjunctions.get((first, second), _UNKNOWN)

    def _at(self, function: int, variable: int) -> tuple[int, ...]:
        """What is left of a function for each value of a variable that nothing before it depends on."""
        if self._variables[function] == variable:
            return self._parts[function]
        return (function,) * self.sizes[variable]

    def size(self, functions: Iterable[int]) -> int:
        """How many nodes some functions have together."""
        seen = set(functions)
        stack = list(seen)
        while stack:
            new = set(self._parts[stack.pop()]) - seen
            seen |= new
            stack += new
        return len(seen)

    def find(
        self, function: int, forbidden: Collection[Choice], preferred: Mapping[int, int], deadline: Deadline = NEVER
    ) -> dict[int, int] | None:
        """Assignments that a function is true of, whatever variables without one are; None if there are none.

        Args:
            forbidden: what none of them may be.
            preferred: a value of every variable, which it gets if that is possible, given those of earlier variables.
        """
        stack: list[tuple[int, tuple[Choice, ...]]] = [(function, ())]
        refuted: set[int] = {FALSE}
        while stack:
            deadline.enforce()
            one, made = stack.pop()
            if one == TRUE:
                return dict(made)
            if one not in refuted:
                refuted.add(one)  # when it is met again: all that is on top of the stack is looked at before
                variable = self._variables[one]
                first = preferred[variable]
                choices = [(variable, number) for number in range(self.sizes[variable]) if number != first]
                for choice in (*reversed(choices), (variable, first)):
                    if choice not in forbidden:
                        stack.append((self._parts[one][choice[1]], (*made, choice)))
        return None

    def count(self, function: int, deadline: Deadline = NEVER) -> int:
        """The number of assignments to all variables for which a function is true."""
        return count_models(
            function,
            {FALSE: 0, TRUE: 1},
            lambda node: min(self._variables[node], len(self.sizes)),
            self._parts.__getitem__,
            sizes=self.sizes,
            deadline=deadline,
        )

    def primes(self, function: int, deadline: Deadline = NEVER) -> int:
        """The prime implicants of a function, as one of `families`; errors as of :meth:`all`."""

        def split(one: int) -> tuple[int, Sequence[int], int]:
            parts = self._parts[one]
            always = self.all(sorted(set(parts)), deadline)
            self._look(len(self._conjunctions) + self.families.remembered)
            return self._variables[one], parts, always

        return self.families.primes(function, self._primes, split, deadline)


def count_models(
    root: Key,
    known: dict[Key, int],
    place: Callable[[Key], int],
    parts: Callable[[Key], Sequence[Key]],
    *,
    sizes: Sequence[int],
    deadline: Deadline,
) -> int:
    """The number of assignments to all variables for which a function, a diagram of any kind, is true.

    Args:
        known: the counts of the constants.
        place: which variable a function depends on first; after all of them for the constants.
        parts: what remains of a function for each value of that variable.
    """

    def step(function: Key) -> int | list[Key]:
        missing = [part for part in parts(function) if part not in known]
        after = place(function) + 1
        return missing or sum(known[part] * prod(sizes[after : place(part)]) for part in parts(function))

    return evaluate(root, known, step, deadline) * prod(sizes[: place(root)])


NOTHING: Final = 0
"""The empty set."""
UNIT: Final = 1
"""The set of the empty environment."""


class Branching(NamedTuple):
    """Environments that do not assign a variable, and those that do, by value."""

    variable: int
    unassigned: int
    assigned: tuple[int, ...]


_CONSTANT: Final = Branching(_LEAF, NOTHING, ())
"""In place of the constants."""


class Families:
    """Sets of environments, each by a number."""

    def __init__(self) -> None:
        self._branchings: list[Branching] = [_CONSTANT, _CONSTANT]
        self._numbers: dict[Branching, int] = {}
        self._differences: dict[tuple[int, int], int] = {}
        self._counts: dict[int, int] = {NOTHING: 0, UNIT: 1}

    def __len__(self) -> int:
        return len(self._branchings)

    @property
    def remembered(self) -> int:
        """How many sets and differences of two are known."""
        return len(self._branchings) + len(self._differences)

    def branch(self, variable: int, unassigned: int, assigned: tuple[int, ...]) -> int:
        """The set with these parts, which mention later variables only."""
        if not any(assigned):
            return unassigned
        branching = Branching(variable, unassigned, assigned)
        if branching not in self._numbers:
            self._numbers[branching] = len(self._branchings)
            self._branchings.append(branching)
        return self._numbers[branching]

    def difference(self, first: int, second: int, deadline: Deadline) -> int:
        """The environments of the first set that are not in the second."""
        known = self._known_difference(first, second)
        return evaluate((first, second), self._differences, self._difference, deadline) if known == _UNKNOWN else known

    def primes(
        self,
        root: Key,
        known: dict[Key, int],
        split: Callable[[Key], tuple[int, Sequence[Key], Key]],
        deadline: Deadline,
    ) -> int:
        """The prime implicants of a function, which may be of any kind of diagram.

        Those that do not assign its first variable are the prime implicants of what holds whatever that is. Those that
        do are the prime implicants of what remains for a value, without these (Coudert and Madre, 1992).

        Args:
            known: the prime implicants of some functions, the constants among them; all new ones are added.
            split: the first variable of a function, what remains for each value, and what holds whatever the value is.
        """

        def step(function: Key) -> int | list[Key]:
            variable, parts, always = split(function)
            missing = [part for part in (always, *parts) if part not in known]
            if missing:
                return missing
            without = known[always]
            assigned = (self.difference(known[part], without, deadline) for part in parts)
            return self.branch(variable, without, tuple(assigned))

        return evaluate(root, known, step, deadline)

    def count(self, family: int, deadline: Deadline) -> int:
        """How many environments a set has."""

        def step(one: int) -> int | list[int]:
            branching = self._branchings[one]
            parts = (branching.unassigned, *branching.assigned)
            missing = [part for part in parts if part not in self._counts]
            return missing or sum(map(self._counts.__getitem__, parts))

        return evaluate(family, self._counts, step, deadline)

    def environments(self, families: Sequence[int]) -> Iterator[tuple[Choice, ...]]:
        """Each union of one environment of each set, once; no two of the sets are about the same variable."""
        stack: list[tuple[tuple[int, ...], tuple[Choice, ...]]] = [(tuple(families), ())]
        while stack:
            remaining, made = stack.pop()
            if not remaining:
                yield made
                continue
            one, *others = remaining
            rest = tuple(others)
            if one == UNIT:
                stack.append((rest, made))
            elif one != NOTHING:
                branching = self._branchings[one]
                stack.append(((branching.unassigned, *rest), made))
                for number, part in reversed(list(enumerate(branching.assigned))):
                    stack.append(((part, *rest), (*made, (branching.variable, number))))

    def _known_difference(self, first: int, second: int) -> int:
        if first in (NOTHING, second):
            return NOTHING
        return first if second == NOTHING else self._differences.get((first, second), _UNKNOWN)

    def _difference(self, pair: tuple[int, int]) -> int | list[tuple[int, int]]:
        first, second = pair
        minuend, subtrahend = self._branchings[first], self._branchings[second]
        if minuend.variable < subtrahend.variable:
            pairs = [(minuend.unassigned, second)]
        elif subtrahend.variable < minuend.variable:
            pairs = [(first, subtrahend.unassigned)]
        else:
            pairs = [
                (minuend.unassigned, subtrahend.unassigned),
                *zip(minuend.assigned, subtrahend.assigned, strict=True),
            ]
        known = [self._known_difference(*each) for each in pairs]
        missing = [each for each, value in zip(pairs, known, strict=True) if value == _UNKNOWN]
        if missing:
            return missing
        unassigned, *assigned = known
        if subtrahend.variable < minuend.variable:
            return unassigned
        return self.branch(minuend.variable, unassigned, tuple(assigned) or minuend.assigned)


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
        """Whether some model satisfies what is asked, of which only the parts that it is about need be searched.

        The search is led by conflicts: one that a model of the parts manifests is resolved in each way in turn. So
        variables that no conflict is about are never decided upon, as they would be if conflicts were conjoined.
        """
        required = self.diagrams.choices(asked.required.items())
        conflicts = [self.diagrams.choices(conflict) for conflict in asked.conflicts]
        mentioned = {variable for choices in (required, *conflicts) for variable, _ in choices}
        relevant = [part for part in self.parts if part.function == FALSE or part.variables & mentioned]
        begin = dict.fromkeys(range(len(self.diagrams.functions.sizes)), 0) | dict(required)
        stack = [frozenset(other for choice in required for other in self._others(choice))]
        while stack:
            deadline.enforce()
            forbidden = stack.pop()
            model = self._model(relevant, begin, forbidden, deadline)
            if model is None:
                continue
            conflict = next((conflict for conflict in conflicts if model.items() >= set(conflict)), None)
            if conflict is None:
                return True
            earlier: set[Choice] = set()
            for choice in conflict:
                stack.append(forbidden | earlier | {choice})
                earlier.update(self._others(choice))
        return False

    def _model(
        self, parts: Iterable[Part], begin: Mapping[int, int], forbidden: frozenset[Choice], deadline: Deadline
    ) -> dict[int, int] | None:
        """A model of the parts; what no part says is as in the beginning, if that is not forbidden."""
        functions, model = self.diagrams.functions, dict(begin)
        for variable in {variable for variable, _ in forbidden}:
            values = [number for number in range(functions.sizes[variable]) if (variable, number) not in forbidden]
            if not values:
                return None
            if model[variable] not in values:
                model[variable] = values[0]
        for part in parts:
            part_model = functions.find(part.function, forbidden, model, deadline)
            if part_model is None:
                return None
            model |= part_model
        return model

    def _others(self, choice: Choice) -> Iterator[Choice]:
        """All other values of a variable."""
        variable, number = choice
        return ((variable, each) for each in range(self.diagrams.functions.sizes[variable]) if each != number)

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
        for environment in self.diagrams.functions.families.environments(self.label(deadline)):
            deadline.enforce()
            yield frozenset(self.diagrams.decode(environment))

    def label(self, deadline: Deadline) -> list[int]:
        """The prime implicants of each part, as families; what was found for another goal need not be found again."""
        return [self.diagrams.functions.primes(part.function, deadline) for part in self.parts]

    def size(self) -> int:
        """How many nodes the functions have."""
        return self.diagrams.functions.size(part.function for part in self.parts)

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
        open_choices = list(conflict)
        for part in parts:
            own = [choice for choice in open_choices if choice[0] in part.variables]
            if not own:
                continue
            resolved = functions.both(part.function, functions.excluded(own), deadline)
            if resolved == part.function:
                return parts  # as in all of its models
            if resolved == FALSE:  # in none: so the other parts must
                open_choices = [choice for choice in open_choices if choice not in own]
        new = Part(frozenset(variable for variable, _ in open_choices), functions.excluded(open_choices))
        return self._joined(parts, new, deadline)


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
        return [self._choices[Assignment(*assignment)] for assignment in assignments]

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
    """The goal that all constraints and conflicts justify.

    Args:
        labels: of the nodes of the constraints.

    Raises:
        OutOfTimeError: if the deadline passes, or the diagrams of both orders get too large.
    """
    groups = [{assignment.variable for environment in label for assignment in environment} for label in labels]
    groups += [{assignment.variable for assignment in conflict} for conflict in conflicts]

    def compile_in(order: Sequence[str], space: int) -> Goal:
        return _compile(ChoiceDiagrams(domains, order, space), labels, conflicts, deadline)

    goal = race(tuple(domains), groups, largest, compile_in)
    goal.diagrams.functions.largest = largest
    return goal


def _compile(
    diagrams: ChoiceDiagrams, labels: Sequence[Sequence[Guard]], conflicts: Sequence[Guard], deadline: Deadline
) -> Goal:
    functions = diagrams.functions
    parts: list[Part] = []
    for label in labels:
        environments = [diagrams.choices(environment) for environment in label]
        mentioned = frozenset(variable for environment in environments for variable, _ in environment)
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
