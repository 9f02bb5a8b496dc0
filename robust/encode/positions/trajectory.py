"""enc_eff of the positions encoding: the states before and after each position, with frame axioms per step [IRR §2].

Positions that share a time form one happening. All of it reads the state before its first position; deletes take place
before adds, assignments before increases [Fox and Long 2003, §8]. So next to the state after the happening so far, what
it has added, deleted, assigned and increased is carried from position to position.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from robust.encode.positions.definitions import Case, Definitions
from robust.encode.positions.flows import Flows
from robust.encode.positions.order import Positions
from robust.encode.positions.reading import Reader, State
from robust.encode.positions.writes import AtomWrite, FluentWrite, Writes
from robust.encode.variables import Linear, constant
from robust.plan.model import Atom, Fluent, ParametrizedPlan
from robust.smt.limits import Deadline
from robust.smt.terms import Formula


@dataclass(slots=True)
class _Happening:
    """What the happening so far has done to one position: its effects before they are applied."""

    added: dict[Atom, Formula] = field(default_factory=dict)
    deleted: dict[Atom, Formula] = field(default_factory=dict)
    base: dict[Fluent, Linear] = field(default_factory=dict)
    """The last value assigned, or the value before."""
    increase: dict[Fluent, Linear] = field(default_factory=dict)


class Trajectory:
    """`before[k]`: the state that position k reads; `after[k]`: with the effects of its happening so far.

    `after[0]` is the initial state; before a time between positions k and k + 1 the state is `after[k]` with
    continuous change.

    Raises:
        OutOfTimeError: if the deadline passes.
    """

    def __init__(
        self,
        *,
        plan: ParametrizedPlan,
        positions: Positions,
        flows: Flows,
        writes: Writes,
        reader: Reader,
        definitions: Definitions,
        deadline: Deadline,
    ) -> None:
        self._positions = positions
        self._flows = flows
        self._writes = writes
        self._reader = reader
        self._definitions = definitions
        self._terms = definitions.terms
        initial = State(
            {atom: self._terms.truth(atom in plan.initial_atoms) for atom in writes.of_atom},
            {fluent: reader.initial(fluent) for fluent in writes.fluents},
        )
        self.before: list[State] = [initial]
        self.after: list[State] = [initial]
        happening = _Happening()
        for position in range(1, positions.last + 1):
            deadline.enforce()
            self.before.append(self._before(position))
            happening = self._happening(position, happening)
            self.after.append(self._after(position, happening))

    @property
    def final(self) -> State:
        """The state after all time points."""
        return self.after[-1]

    # -- steps ---------------------------------------------------------------------------------------------------

    def _before(self, position: int) -> State:
        """Frame axioms, with continuous change; within a happening, the state before its first position."""
        same, previous = self._positions.same(position), self.before[-1]
        left = self.after[-1]
        atoms = {atom: self._if(same, previous.atoms[atom], truth) for atom, truth in left.atoms.items()}
        fluents = {}
        for fluent, value in left.fluents.items():
            arrived = value + self._flows.over_step(fluent, position - 1)
            name = f"{fluent} before position {position}"
            fluents[fluent] = self._definitions.if_else(name, same, previous.fluents[fluent], arrived)
        named = {a: self._definitions.truth(f"{a} before position {position}", t) for a, t in atoms.items()}
        return State(named, fluents)

    def _after(self, position: int, happening: _Happening) -> State:
        before = self.before[position]
        atoms = {}
        for atom, truth in before.atoms.items():
            kept = self._terms.conjunction((truth, self._terms.negation(happening.deleted[atom])))
            after = self._terms.disjunction((happening.added[atom], kept))
            atoms[atom] = self._definitions.truth(f"{atom} after position {position}", after)
        return State(atoms, {fluent: base + happening.increase[fluent] for fluent, base in happening.base.items()})

    # -- effects -------------------------------------------------------------------------------------------------

    def _happening(self, position: int, sofar: _Happening) -> _Happening:
        """The effects of a position, together with those of earlier positions of the same time."""
        same, before = self._positions.same(position), self.before[position]
        result = _Happening()
        for atom, writes in self._writes.of_atom.items():
            fired = [(write.value, self._fired(write, position)) for write in writes]
            for value, effects, old in ((True, result.added, sofar.added), (False, result.deleted, sofar.deleted)):
                already = self._terms.conjunction((same, old.get(atom, self._terms.false)))
                here = self._terms.disjunction(happens for written, happens in fired if written is value)
                effects[atom] = self._terms.disjunction((already, here))
        for fluent in self._writes.fluents:
            effects_here = self._writes.of_fluent.get(fluent, ())
            increases = [write for write in effects_here if not write.assigns]
            assignments = [write for write in effects_here if write.assigns]
            old_base = sofar.base.get(fluent, before.fluents[fluent])
            base = (
                self._definitions.if_else(
                    f"{fluent} assigned until position {position}", same, old_base, before.fluents[fluent]
                )
                if assignments
                else before.fluents[fluent]
            )
            result.base[fluent] = self._assigned(fluent, assignments, position, base)
            old_increase = sofar.increase.get(fluent, constant(0))
            name = f"{fluent} increased until position {position}"
            result.increase[fluent] = self._definitions.if_at_all(name, same, old_increase)
            result.increase[fluent] += self._increased(fluent, increases, position)
        return result

    def _fired(self, write: AtomWrite | FluentWrite, position: int) -> Formula:
        """Whether a write takes place at a position."""
        here = self._positions.at(write.point, position)
        if here is self._terms.false:
            return here
        condition = self._reader.holds(write.condition, self.before[position], write.instance)
        return self._terms.conjunction((here, condition))

    def _assigned(self, fluent: Fluent, assignments: list[FluentWrite], position: int, otherwise: Linear) -> Linear:
        """The value of the last assignment of a position that takes place; `otherwise` if none does."""
        cases: list[Case] = []
        later: Formula = self._terms.false
        for write in reversed(assignments):
            fired = self._fired(write, position)
            if fired is not self._terms.false:
                last = self._terms.conjunction((fired, self._terms.negation(later)))
                cases.append((last, self._amount(write, position)))
                later = self._terms.disjunction((fired, later))
        cases.append((self._terms.negation(later), otherwise))
        return self._definitions.choice(f"{fluent} assigned at position {position}", cases)

    def _increased(self, fluent: Fluent, increases: list[FluentWrite], position: int) -> Linear:
        total = constant(0)
        for write in increases:
            fired = self._fired(write, position)
            if fired is not self._terms.false:
                name = f"{fluent} increased at position {position}"
                total += self._definitions.if_at_all(name, fired, self._amount(write, position))
        return total

    def _amount(self, write: FluentWrite, position: int) -> Linear:
        return self._reader.value(write.amount, self.before[position], write.instance)

    def _if(self, condition: Formula, then: Formula, otherwise: Formula) -> Formula:
        if then is otherwise:
            return then
        conjunction, negation = self._terms.conjunction, self._terms.negation
        return self._terms.disjunction((conjunction((condition, then)), conjunction((negation(condition), otherwise))))
