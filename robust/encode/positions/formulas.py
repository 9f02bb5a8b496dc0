"""States over positions: symbols for parts of formulas, conditions read in a state, effects and continuous change."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import assert_never

from robust.encode.positions.network import KnownOrder, Network, Positions
from robust.encode.variables import Auxiliary, Linear, constant, over_parameters, variable
from robust.errors import InputError, UnsupportedError
from robust.plan.model import (
    ActionInstance,
    And,
    Assignment,
    Atom,
    Comparison,
    Condition,
    ContinuousEffect,
    Duration,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    ParameterReference,
    ParametrizedPlan,
    TimePoint,
    Truth,
    comparisons,
    fluents_in,
)
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms

Case = tuple[Formula, Linear]
"""A value, and when it applies."""


class Definitions:
    """Symbols with the formulas that fix them; whoever asserts a symbol asserts :meth:`needed_by` as well."""

    def __init__(self, terms: Terms) -> None:
        self.terms = terms
        self._definition: dict[Formula, Formula] = {}
        self._count = 0

    def truth(self, name: str, formula: Formula) -> Formula:
        """A Boolean symbol for the formula, unless it is a literal or constant already."""
        atom = self.terms.negation(formula) if formula.is_not() else formula
        if atom.is_symbol() or atom.is_bool_constant():
            return formula
        symbol = self.terms.fresh_boolean(f"[{name}] ")
        self._definition[symbol] = self.terms.equivalence(symbol, formula)
        return symbol

    def choice(self, name: str, cases: Iterable[Case]) -> Linear:
        """The value of the case that applies; exactly one does. A new symbol unless the value is known."""
        open_cases = [(condition, value) for condition, value in cases if condition is not self.terms.false]
        for condition, value in open_cases:
            if condition is self.terms.true:
                return value
        values = {value for _, value in open_cases}
        return values.pop() if len(values) == 1 else self.partial(name, open_cases)

    def partial(self, name: str, cases: Iterable[Case]) -> Linear:
        """A new symbol that has the value of each case that applies."""
        self._count += 1
        result = variable(Auxiliary(name, self._count))
        equations = (self.terms.implication(c, self.terms.equal(result - value)) for c, value in cases)
        self._definition[self.terms.real(Auxiliary(name, self._count))] = self.terms.conjunction(equations)
        return result

    def if_else(self, name: str, condition: Formula, value: Linear, otherwise: Linear) -> Linear:
        return self.choice(name, [(condition, value), (self.terms.negation(condition), otherwise)])

    def if_at_all(self, name: str, condition: Formula, value: Linear) -> Linear:
        """The value if the condition holds, else zero."""
        return self.if_else(name, condition, value, constant(0))

    def needed_by(self, formulas: Iterable[Formula], deadline: Deadline) -> Iterator[Formula]:
        """The definitions of all symbols in the formulas, and of those in the definitions, each once.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        queue, seen = list(formulas), set[Formula]()
        while queue:
            deadline.enforce()
            for symbol in self.terms.variables(queue.pop()):
                if symbol in self._definition and symbol not in seen:
                    seen.add(symbol)
                    queue.append(self._definition[symbol])
                    yield self._definition[symbol]


@dataclass(frozen=True, slots=True)
class State:
    """The written atoms and fluents that matter at one moment; the others keep their initial values."""

    atoms: Mapping[Atom, Formula]
    fluents: Mapping[Fluent, Linear]


class Reader:
    """Evaluates conditions and expressions of a plan in states."""

    def __init__(self, plan: ParametrizedPlan, network: Network, terms: Terms) -> None:
        self._plan = plan
        self._network = network
        self._terms = terms

    def atom(self, atom: Atom, state: State) -> Formula:
        known = state.atoms.get(atom)
        return self._terms.truth(atom in self._plan.initial_atoms) if known is None else known

    def fluent(self, fluent: Fluent, state: State) -> Linear:
        known = state.fluents.get(fluent)
        return self.initial(fluent) if known is None else known

    def initial(self, fluent: Fluent) -> Linear:
        """The initial value.

        Raises:
            InputError: if there is none.
        """
        if fluent not in self._plan.initial_fluents:
            raise InputError(f"{fluent} has no initial value; expected (= {fluent} NUMBER) in the problem's :init")
        return over_parameters(self._plan.initial_fluents[fluent])

    def duration(self, instance: ActionInstance | None) -> Linear:
        if instance is None:
            raise UnsupportedError("?duration has no meaning outside a durative action")
        return self._network.distance(instance.start, instance.end)

    def value(self, expression: Expression, state: State, instance: ActionInstance | None) -> Linear:
        """The value of an expression; `instance` is the one whose `?duration` it mentions."""

        def value(name: NumericVariable) -> Linear:
            match name:
                case Fluent():
                    return self.fluent(name, state)
                case ParameterReference():
                    return variable(name)
                case Duration():
                    return self.duration(instance)
            assert_never(name)

        return expression.substitute(value)

    def holds(
        self,
        condition: Condition,
        state: State,
        instance: ActionInstance | None = None,
        leaf: Callable[[Comparison], Formula | None] = lambda _: None,
    ) -> Formula:
        """The truth of a condition; where `leaf` returns a formula, it stands for that comparison's truth."""
        match condition:
            case Truth(value):
                return self._terms.truth(value)
            case Holds(atom, value):
                truth = self.atom(atom, state)
                return truth if value else self._terms.negation(truth)
            case Comparison(expression, relation):
                replaced = leaf(condition)
                if replaced is not None:
                    return replaced
                return self._terms.compare(self.value(expression, state, instance), relation)
            case And(operands):
                return self._terms.conjunction(self.holds(part, state, instance, leaf) for part in operands)
            case Or(operands):
                return self._terms.disjunction(self.holds(part, state, instance, leaf) for part in operands)
        assert_never(condition)


@dataclass(frozen=True, slots=True)
class AtomWrite:
    """At `point` the atom gets a truth value if `condition` holds just before; no instance: a timed literal."""

    point: TimePoint
    value: bool
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class FluentWrite:
    """At `point` the fluent is assigned or increased if `condition` holds just before."""

    point: TimePoint
    assigns: bool
    amount: Expression
    condition: Condition
    instance: ActionInstance | None


@dataclass(frozen=True, slots=True)
class Flow:
    """A continuous effect, numbered `index` among those of its instance."""

    instance: ActionInstance
    index: int
    effect: ContinuousEffect


class Writes:
    """All effects of a plan.

    `fluents` are those that are both written and read anywhere: nothing depends on the values of others.
    """

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.of_atom: dict[Atom, list[AtomWrite]] = defaultdict(list)
        self.of_fluent: dict[Fluent, list[FluentWrite]] = defaultdict(list)
        self.flows: dict[Fluent, list[Flow]] = defaultdict(list)
        for instance in plan.instances:
            for effect in instance.atom_effects:
                point = instance.at(effect.timing)
                self.of_atom[effect.atom].append(AtomWrite(point, effect.value, effect.condition, instance))
            for numeric in instance.numeric_effects:
                point, assigns = instance.at(numeric.timing), numeric.operator is Assignment.ASSIGN
                write = FluentWrite(point, assigns, numeric.expression, numeric.condition, instance)
                self.of_fluent[numeric.fluent].append(write)
            for index, continuous in enumerate(instance.continuous_effects):
                self.flows[continuous.fluent].append(Flow(instance, index, continuous))
        always = Truth(True)
        for literal in plan.timed_literals:
            if isinstance(literal.target, Atom):
                self.of_atom[literal.target].append(AtomWrite(literal.point, bool(literal.value), always, None))
            else:
                amount: Expression = Polynomial.constant(Fraction(literal.value))
                self.of_fluent[literal.target].append(FluentWrite(literal.point, True, amount, always, None))
        read = set(_fluents_read(plan))
        self.fluents = tuple(f for f in dict.fromkeys((*self.of_fluent, *self.flows)) if f in read)

    def changes(self, fluent: Fluent) -> bool:
        return fluent in self.of_fluent or fluent in self.flows


def _fluents_read(plan: ParametrizedPlan) -> Iterator[Fluent]:
    conditions: list[Condition] = [goal.condition for goal in plan.goal]
    for instance in plan.instances:
        conditions += [part.condition for part in instance.conditions]
        conditions += [part.condition for part in instance.durations]
        conditions += [effect.condition for effect in instance.atom_effects]
        conditions += [numeric.condition for numeric in instance.numeric_effects]
        for numeric in instance.numeric_effects:
            yield from fluents_in(numeric.expression)
    for condition in conditions:
        for comparison in comparisons(condition):
            yield from fluents_in(comparison.expression)


@dataclass(frozen=True)
class Setting:
    """What formulas about states are made of."""

    plan: ParametrizedPlan
    network: Network
    known: KnownOrder
    positions: Positions
    writes: Writes
    reader: Reader
    definitions: Definitions

    @property
    def terms(self) -> Terms:
        return self.definitions.terms


class Flows:
    """What continuous effects contribute, step by step; step k leads from position k to position k + 1."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._terms = setting.terms
        self._positions = setting.positions
        self._definitions = setting.definitions
        self._rate = cache(self._rate_of)
        self._sofar = cache(self._sofar_at)

    def acts(self, instance: ActionInstance, step: int) -> Formula:
        """Whether a step lies between start and end of an instance."""
        ended = self._positions.by(instance.end, step)
        return self._terms.conjunction((self._positions.by(instance.start, step), self._terms.negation(ended)))

    def over_step(self, fluent: Fluent, step: int) -> Linear:
        """By how much a fluent changes in a step."""
        total = constant(0)
        for flow in self._setting.writes.flows.get(fluent, ()):
            acts = self.acts(flow.instance, step)
            if acts is not self._terms.false:
                name = f"{flow.instance.identifier} {fluent} in step {step}"
                total += self._definitions.if_at_all(name, acts, self._contribution(flow, step))
        return total

    def until(self, fluent: Fluent, step: int, instant: Linear) -> Linear:
        """By how much a fluent changes from the beginning of a step until an instant inside it."""
        total = constant(0)
        for flow in self._setting.writes.flows.get(fluent, ()):
            acts = self.acts(flow.instance, step)
            if acts is not self._terms.false:
                amount = self._product(flow, instant - self._positions.time(step))
                name = f"{flow.instance.identifier} {fluent} in step {step} until {instant}"
                total += self._definitions.if_at_all(name, acts, amount)
        return total

    def _contribution(self, flow: Flow, step: int) -> Linear:
        if self._rate(flow).is_constant:
            length = self._positions.time(step + 1) - self._positions.time(step)
            return self._product(flow, length)
        return self._sofar(flow, step + 1) - self._sofar(flow, step)

    def _sofar_at(self, flow: Flow, position: int) -> Linear:
        """Rate times the time since the start, at a position from the start's to the end's; anything at others."""
        start, end = flow.instance.start, flow.instance.end
        cases: list[Case] = []
        for point in self._positions.candidates(position):
            if not (self._setting.known.is_before(point, start) or self._setting.known.is_before(end, point)):
                amount = self._product(flow, self._setting.network.distance(start, point))
                cases.append((self._positions.at(point, position), amount))
        name = f"{flow.instance.identifier} {flow.effect.fluent} until position {position}"
        return cases[0][1] if len(cases) == 1 else self._definitions.partial(name, cases)

    def _product(self, flow: Flow, time: Linear) -> Linear:
        amount = self._rate(flow) * time
        if not amount.is_linear:
            raise UnsupportedError(
                f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                f"{flow.effect.fluent}: rate {flow.effect.rate} times an elapsed time that is not constant; "
                "expected a constant rate, or a fixed schedule"
            )
        return amount

    def _rate_of(self, flow: Flow) -> Linear:
        for fluent in fluents_in(flow.effect.rate):
            if self._setting.writes.changes(fluent):
                raise UnsupportedError(
                    f"{flow.instance.identifier} {flow.instance.action}: non-linear continuous effect on "
                    f"{flow.effect.fluent}: its rate reads {fluent}, which the plan changes; expected a constant rate"
                )
        return self._setting.reader.value(flow.effect.rate, State({}, {}), flow.instance)


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

    def __init__(self, setting: Setting, flows: Flows, deadline: Deadline) -> None:
        self._terms = setting.terms
        self._positions = setting.positions
        self._writes = writes = setting.writes
        self._reader = reader = setting.reader
        self._definitions = setting.definitions
        self._flows = flows
        initial = State(
            {atom: self._terms.truth(atom in setting.plan.initial_atoms) for atom in writes.of_atom},
            {fluent: reader.initial(fluent) for fluent in writes.fluents},
        )
        self.before: list[State] = [initial]
        self.after: list[State] = [initial]
        happening = _Happening()
        for position in range(1, setting.positions.last + 1):
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
