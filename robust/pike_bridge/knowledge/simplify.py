"""Equivalent, smaller theories: what follows from single assignments is put into effect before anything is compiled.

Values that cannot hold stay in the domains, and become conflicts of one assignment: so the models, the implicants and
the prime implicants remain those of the theory that was given.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from robust.pike_bridge.knowledge.interface import FALSE, TRUE, is_consistent, normal_form
from robust.pike_bridge.model import Assignment, Guard
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory
from robust.smt.limits import Deadline


def simplify(theory: Theory, deadline: Deadline) -> Theory:
    """An equivalent theory over the same domains, by unit propagation to a fixed point.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    reduction = _Reduction({variable: set(values) for variable, values in theory.domains.items()})
    constraints: list[Formula] = list(theory.constraints)
    conflicts = [each for each in dict.fromkeys(theory.conflicts) if is_consistent(each)]
    while True:
        deadline.enforce()
        removals = reduction.removals
        constraints = list(_top_level(map(reduction.formula, constraints)))
        conflicts = list(reduction.conflicts(conflicts))
        constraints = reduction.learn(constraints, conflicts)
        if reduction.contradictory or FALSE in constraints or frozenset() in conflicts:
            return Theory(theory.domains, (FALSE,))
        if reduction.removals == removals:
            break
    removed = [
        frozenset({Assignment(variable, value)})
        for variable, values in theory.domains.items()
        for value in values
        if value not in reduction.possible[variable]
    ]
    return Theory(theory.domains, tuple(constraints), (*removed, *dict.fromkeys(conflicts)))


@dataclass(slots=True)
class _Reduction:
    possible: dict[str, set[str]]
    removals: int = field(default=0)

    @property
    def contradictory(self) -> bool:
        return not all(self.possible.values())

    def remove(self, assignment: Assignment) -> None:
        values = self.possible[assignment.variable]
        if assignment.value in values:
            values.remove(assignment.value)
            self.removals += 1

    def formula(self, formula: Formula) -> Formula:
        """In negation normal form, with assignments replaced by what is known of them."""
        return normal_form(formula, self._literal)

    def conflicts(self, conflicts: Iterable[Guard]) -> Iterator[Guard]:
        """Those that are not resolved, without assignments that hold anyway."""
        for conflict in conflicts:
            if all(value in self.possible[variable] for variable, value in conflict):
                yield frozenset(each for each in conflict if len(self.possible[each.variable]) > 1)

    def learn(self, constraints: Iterable[Formula], conflicts: Iterable[Guard]) -> list[Formula]:
        """Remove the values that a single constraint or conflict excludes; the constraints that say more than that."""
        for conflict in conflicts:
            if len(conflict) == 1:
                self.remove(*conflict)
        return [constraint for constraint in constraints if not self._restricts(constraint)]

    def _restricts(self, constraint: Formula) -> bool:
        """If a constraint is about one variable alone, as a disjunction of literals, only those values are left."""
        literals = constraint.operands if isinstance(constraint, Some) else (constraint,)
        allowed: set[str] = set()
        variable: str | None = None
        for literal in literals:
            match literal:
                case Is(assignment):
                    values = {assignment.value}
                case Not(Is(assignment)):
                    values = self.possible[assignment.variable] - {assignment.value}
                case _:
                    return False
            if variable not in {None, assignment.variable}:
                return False
            variable = assignment.variable
            allowed |= values
        if variable is None:
            return False
        for value in list(self.possible[variable] - allowed):
            self.remove(Assignment(variable, value))
        return True

    def _literal(self, assignment: Assignment, positive: bool) -> Formula:
        values = self.possible[assignment.variable]
        if assignment.value not in values:
            return FALSE if positive else TRUE
        if len(values) == 1:
            return TRUE if positive else FALSE
        return Is(assignment) if positive else Not(Is(assignment))


def _top_level(constraints: Iterable[Formula]) -> Iterator[Formula]:
    for constraint in constraints:
        yield from constraint.operands if isinstance(constraint, All) else (constraint,)
