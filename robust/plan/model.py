"""The parametrized planning problem ⟨Γ, P⟩ with its parametrized STN plan, grounded [IRR, Definitions 1 and 2].

Everything here is plain, frozen data: what readers produce, and what simulator and encoders consume. Only the action
instances that the plan uses are ground. Numeric expressions are polynomials over fluents, parameters and `?duration`.

A plan has variants: with values for what is unknown, and within narrower bounds for some of its parameters.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import Enum, StrEnum
from fractions import Fraction
from functools import cache, cached_property, lru_cache
from itertools import combinations
from typing import Any, Protocol, TypeVar

from robust import errors, numbers
from robust.plan.polynomial import Polynomial


@dataclass(frozen=True, slots=True, order=True)
class Atom:
    """A ground proposition such as `(at rover base)`; names are lower case."""

    predicate: str
    arguments: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"({' '.join((self.predicate, *self.arguments))})"


@dataclass(frozen=True, slots=True, order=True)
class Fluent:
    """A ground numeric fluent such as `(charge auv)`; names are lower case."""

    function: str
    arguments: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"({' '.join((self.function, *self.arguments))})"


@dataclass(frozen=True, slots=True, order=True)
class ParameterReference:
    """A use of the parameter of that name in an expression."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Duration:
    """`?duration`: t_end − t_start of the action instance that the expression belongs to."""

    def __str__(self) -> str:
        return "?duration"


NumericVariable = Fluent | ParameterReference | Duration
Expression = Polynomial[NumericVariable]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter γ of Γ: its nominal value π(γ), its weight ω_γ > 0 and its declared bounds (None: unbounded).

    Without a nominal value (`has_nominal` is False), `nominal` is some value within the bounds, to begin searches with.
    """

    name: str
    nominal: Fraction
    weight: Fraction = Fraction(1)
    lower: Fraction | None = None
    upper: Fraction | None = None
    location: errors.Location | None = field(default=None, compare=False)
    has_nominal: bool = True

    def percent(self, end: Fraction | None) -> Fraction | None:
        """How far an end of an interval is from the nominal value, in per cent of it.

        None if the end is infinite, or if the nominal value is zero or there is none.
        """
        if end is None or not self.nominal or not self.has_nominal:
            return None
        return (end - self.nominal) / abs(self.nominal) * 100


class TimePointKind(StrEnum):
    __hash__ = str.__hash__  # that of enumerations is slow, and time points are keys everywhere
    ZERO = "zero"
    START = "start"
    END = "end"
    INSTANT = "instant"
    TIMED_LITERAL = "timed literal"


@dataclass(frozen=True, slots=True)
class TimePoint:
    """A time point of the plan: zero, start or end of an instance, an instantaneous action, a timed initial literal."""

    kind: TimePointKind
    instance: str | None = None
    time: Fraction | None = None

    def __str__(self) -> str:
        match self.kind:
            case TimePointKind.ZERO:
                return ".zero"
            case TimePointKind.START | TimePointKind.END:
                return f"{self.instance}.{self.kind.value}"
            case TimePointKind.INSTANT:
                return f"{self.instance}"
            case TimePointKind.TIMED_LITERAL:
                return f"@{self.time}"

    def __lt__(self, other: TimePoint) -> bool:
        return str(self) < str(other)


ZERO = TimePoint(TimePointKind.ZERO)
_time_point = lru_cache(maxsize=1 << 14)(TimePoint)
"""One object for each, so that tables of time points seldom compare more than identity."""


class Relation(Enum):
    """How the polynomial of a comparison relates to zero."""

    AT_LEAST = ">="
    GREATER = ">"
    EQUAL = "="
    DIFFERENT = "!="

    def holds(self, value: Fraction) -> bool:
        """Whether `value relation 0`."""
        match self:
            case Relation.AT_LEAST:
                return value >= 0
            case Relation.GREATER:
                return value > 0
            case Relation.EQUAL:
                return value == 0
            case Relation.DIFFERENT:
                return value != 0


@dataclass(frozen=True, slots=True)
class Truth:
    """Always true, or always false."""

    value: bool


@dataclass(frozen=True, slots=True)
class Holds:
    """The atom has the given truth value."""

    atom: Atom
    value: bool = True


@dataclass(frozen=True, slots=True)
class NumericCondition:
    """`expression relation 0`."""

    expression: Expression
    relation: Relation


@dataclass(frozen=True, slots=True)
class And:
    """All of them."""

    operands: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """At least one of them."""

    operands: tuple[Condition, ...]


Leaf = Truth | Holds | NumericCondition
Condition = Leaf | And | Or
"""Conditions are in negation normal form, quantifiers expanded over the problem's objects; `And(())` does not occur."""


class Timing(Enum):
    AT_START = "at start"
    OVER_ALL = "over all"
    AT_END = "at end"


@dataclass(frozen=True, slots=True)
class TimedCondition:
    """One conjunct of an action's condition; an instantaneous action's conditions are AT_START.

    `text` is the ground condition in PDDL syntax, for names of obligations and for messages.
    """

    timing: Timing
    condition: Condition
    text: str


@dataclass(frozen=True, slots=True)
class Agreement(TimedCondition):
    """The rule that no fluent gets two values at a time point: no assignment takes place together with another change.

    It follows from the effects of an action, and `text` says which fluents it is about.
    """


@dataclass(frozen=True, slots=True)
class DurationConstraint:
    """`?duration relation bound`, as the comparison it amounts to; `timing` says when fluents in it are read."""

    timing: Timing
    condition: NumericCondition
    text: str


@dataclass(frozen=True, slots=True)
class AtomEffect:
    """Add (`value`) or delete an atom if `condition` holds just before; at one time point an add wins over a delete."""

    timing: Timing
    atom: Atom
    value: bool
    condition: Condition = Truth(True)


class AssignmentKind(Enum):
    ASSIGN = "assign"
    INCREASE = "increase"


@dataclass(frozen=True, slots=True)
class NumericEffect:
    """Assign or increase a fluent by an expression read just before (decreases are negated increases)."""

    timing: Timing
    fluent: Fluent
    operator: AssignmentKind
    expression: Expression
    condition: Condition = Truth(True)


@dataclass(frozen=True, slots=True)
class ContinuousEffect:
    """The fluent changes by `rate` per unit of time during the open interval (start, end) of the instance."""

    fluent: Fluent
    rate: Expression


@dataclass(frozen=True, slots=True)
class Mention:
    """A name in the text of an action that its ground form has lost: it cancels, or constants decide without it.

    At a start or an end it is read there, as far as interference goes, whatever its value. A fluent with `needs_value`
    is evaluated all the same, and has to have an initial value; what the equality of objects decides is not evaluated.
    """

    timing: Timing
    name: Atom | Fluent
    needs_value: bool = True


def concerned(obligation: str) -> tuple[str, ...]:
    """What the obligation of that name is about: identifiers of instances, beside timed literals, or `goal:`."""
    points = re.fullmatch(r"separation: (\S+), (\S+)|effects of (\S+) agree|(\S+) .*", obligation, re.DOTALL)
    names = points.groups() if points else ()
    return tuple(dict.fromkeys(re.sub(r"\.(start|end)$", "", name) for name in names if name))


class NamedAction:
    """What names of actions and identifiers of instances say by themselves."""

    __slots__ = ()
    identifier: str
    action: str
    arguments: tuple[str, ...]
    durative: bool

    @property
    def start(self) -> TimePoint:
        """The start, or the only time point of an instantaneous action."""
        return _time_point(TimePointKind.START if self.durative else TimePointKind.INSTANT, self.identifier)

    @property
    def end(self) -> TimePoint:
        """The end, or the only time point of an instantaneous action."""
        return _time_point(TimePointKind.END, self.identifier) if self.durative else self.start

    @property
    def time_points(self) -> tuple[TimePoint, ...]:
        return (self.start, self.end) if self.durative else (self.start,)

    def __str__(self) -> str:
        return f"({' '.join((self.action, *self.arguments))})"


@dataclass(frozen=True, slots=True)
class ActionInstance(NamedAction):
    """One ground action of the plan, named `identifier`.

    What conditions and effects mention is read; `mentions` is what the text of the action reads beside that.
    """

    identifier: str
    action: str
    arguments: tuple[str, ...]
    durative: bool
    durations: tuple[DurationConstraint, ...] = ()
    conditions: tuple[TimedCondition, ...] = ()
    atom_effects: tuple[AtomEffect, ...] = ()
    numeric_effects: tuple[NumericEffect, ...] = ()
    continuous_effects: tuple[ContinuousEffect, ...] = ()
    mentions: frozenset[Mention] = frozenset()
    location: errors.Location | None = field(default=None, compare=False)

    @property
    def fixing(self) -> tuple[DurationConstraint, ...]:
        """The constraints that leave one duration: equalities, and inequalities from both sides with the same bound."""
        above = [bound for bound in self.durations if bound.condition.relation is Relation.AT_LEAST]
        known = {(bound.timing, bound.condition.expression) for bound in above}
        tight = {bound for bound in above if (bound.timing, -bound.condition.expression) in known}
        return tuple(b for b in self.durations if b.condition.relation is Relation.EQUAL or b in tight)

    @property
    def agreements(self) -> tuple[Agreement, ...]:
        """What the numeric effects demand of the state before their time point, where conditions do not exclude it."""
        apart: dict[Timing, list[tuple[Fluent, Condition]]] = {}
        for effect, other in conflicts(self.numeric_effects):
            condition = junction((negation(effect.condition), negation(other.condition)), every=False)
            if condition != Truth(True):
                apart.setdefault(effect.timing, []).append((effect.fluent, condition))
        agreements = []
        for timing, demands in apart.items():
            fluents = ", ".join(dict.fromkeys(str(fluent) for fluent, _ in demands))
            together = junction((condition for _, condition in demands), every=True)
            agreements.append(Agreement(timing, together, f"one change only of {fluents}"))
        return tuple(agreements)

    @property
    def parts(self) -> tuple[TimedCondition | DurationConstraint | AtomEffect | NumericEffect, ...]:
        """All that reads a condition at some time."""
        return (*self.durations, *self.conditions, *self.atom_effects, *self.numeric_effects)

    @property
    def demands(self) -> tuple[TimedCondition, ...]:
        """The conditions, and that effects agree."""
        return (*self.conditions, *self.agreements)

    def at(self, timing: Timing) -> TimePoint:
        """The time point at which an AT_START or AT_END condition or effect happens."""
        return self.end if timing is Timing.AT_END else self.start

    def mentioned(self) -> Iterator[tuple[Atom | Fluent, TimePoint]]:
        """What is read by mention only, and where; over-all conditions are no reads."""
        for mention in self.mentions:
            if mention.timing is not Timing.OVER_ALL:
                yield mention.name, self.at(mention.timing)

    def label(self, part: TimedCondition | DurationConstraint) -> str:
        """The name of the obligation that `part` gives rise to."""
        if isinstance(part, DurationConstraint):
            return f"{self.identifier} {self.action}: duration {part.text}"
        if isinstance(part, Agreement):
            return f"effects of {self.at(part.timing)} agree"
        timing = f"{part.timing.value} " if self.durative else ""
        return f"{self.identifier} {self.action}: {timing}{part.text}"


@dataclass(frozen=True, slots=True)
class TimedLiteral:
    """A timed initial literal: at `time`, an atom gets a truth value or a fluent a number."""

    time: Fraction
    target: Atom | Fluent
    value: bool | Fraction

    @property
    def point(self) -> TimePoint:
        return TimePoint(TimePointKind.TIMED_LITERAL, time=self.time)


Bound = Polynomial[NumericVariable]
"""A bound of a temporal constraint: a polynomial over parameters only."""


@dataclass(frozen=True, slots=True)
class TemporalConstraint:
    """`lower ≤ t_target − t_source ≤ upper`; None is an infinite bound. Written `c: target - source in [l, u]`.

    `name` is what demands it, if that is no statement of the plan.
    """

    source: TimePoint
    target: TimePoint
    lower: Bound | None
    upper: Bound | None
    location: errors.Location | None = field(default=None, compare=False)
    name: str | None = field(default=None, compare=False)

    def __str__(self) -> str:
        """The constraint as plan files write it, with its line; or its name, and the time point."""
        if self.name is not None:
            return f"{self.name}: {self.target} at most {'inf' if self.upper is None else as_written(self.upper)}"
        lower = "-inf" if self.lower is None else as_written(self.lower)
        upper = "inf" if self.upper is None else as_written(self.upper)
        line = f" (line {self.location.line})" if self.location and self.location.line else ""
        return f"c: {self.target} - {self.source} in [{lower}, {upper}]{line}"


def as_written(bound: Bound) -> str:
    """A bound as plan files have it: a number, or an expression over parameters."""
    return numbers.format_number(bound.constant_term) if bound.is_constant else str(bound)


@dataclass(frozen=True, slots=True)
class GoalCondition:
    """One conjunct of the goal, evaluated in the state after all time points; `text` as in :class:`TimedCondition`."""

    condition: Condition
    text: str

    @property
    def label(self) -> str:
        return f"goal: {self.text}"


SHOWN = 15
"""Parameters, steps and constraints of a plan that its text lists."""


@dataclass(frozen=True, repr=False)
class ParametrizedPlan:
    """⟨Γ, P⟩ with π_Γ: all that decides whether, and for which parameter values, the plan is valid.

    `initial_fluents` maps every fluent that has a value at time zero to a polynomial over parameters.
    """

    name: str
    parameters: tuple[Parameter, ...]
    instances: tuple[ActionInstance, ...]
    constraints: tuple[TemporalConstraint, ...]
    initial_atoms: frozenset[Atom]
    initial_fluents: Mapping[Fluent, Expression]
    timed_literals: tuple[TimedLiteral, ...]
    goal: tuple[GoalCondition, ...]

    @cached_property
    def instance(self) -> Mapping[str, ActionInstance]:
        """Instances by identifier."""
        return {instance.identifier: instance for instance in self.instances}

    @cached_property
    def lasting(self) -> Mapping[str, str]:
        """The identifier of the first instance whose duration a parameter is, by parameter."""
        ends = {(instance.start, instance.end): instance.identifier for instance in self.instances}
        alone: dict[Bound | None, str] = {
            Polynomial.variable(ParameterReference(parameter.name)): parameter.name for parameter in self.parameters
        }
        owners: dict[str, str] = {}
        for item in self.constraints:
            if item.lower in alone and item.lower == item.upper and (item.source, item.target) in ends:
                owners.setdefault(alone[item.lower], ends[item.source, item.target])
        return owners

    @cached_property
    def time_points(self) -> tuple[TimePoint, ...]:
        """Zero, the time points of all instances in the plan's order, then the timed literals' by time."""
        of_instances = [point for instance in self.instances for point in instance.time_points]
        times = sorted({literal.time for literal in self.timed_literals})
        return (ZERO, *of_instances, *(TimePoint(TimePointKind.TIMED_LITERAL, time=time) for time in times))

    @property
    def nominal(self) -> dict[str, Fraction]:
        """π: the nominal value of every parameter."""
        return {parameter.name: parameter.nominal for parameter in self.parameters}

    @property
    def has_nominal(self) -> bool:
        """Whether every parameter has a nominal value."""
        return all(parameter.has_nominal for parameter in self.parameters)

    @property
    def _parts(self) -> dict[str, list[str]]:
        """A line for each parameter, step and constraint."""
        values = (numbers.readable(each.nominal) if each.has_nominal else "?" for each in self.parameters)
        return {
            "parameter": [f"{each.name} = {value}" for each, value in zip(self.parameters, values, strict=True)],
            "step": [f"{instance.identifier}: {instance}" for instance in self.instances],
            "constraint": [str(constraint) for constraint in self.constraints],
        }

    def __repr__(self) -> str:
        counts = ", ".join(numbers.plural(len(lines), noun) for noun, lines in self._parts.items())
        return f"<plan {self.name!r}: {counts}>"

    def __str__(self) -> str:
        """On a screen: the first parameters, steps and constraints."""
        text = [f"plan {self.name!r}"]
        for noun, lines in self._parts.items():
            text += ["", f"{numbers.plural(len(lines), noun)}:", *(f"  {line}" for line in lines[:SHOWN])]
            if len(lines) > SHOWN:
                text.append(f"  … and {len(lines) - SHOWN} more")
        return "\n".join(text)


def leaves(condition: Condition) -> Iterator[Leaf]:
    """The atoms, comparisons and constants of a condition, from left to right."""
    pending = [condition]
    while pending:
        node = pending.pop()
        if isinstance(node, And | Or):
            pending.extend(reversed(node.operands))
        else:
            yield node


def junction(operands: Iterable[Condition], *, every: bool) -> Condition:
    """Conjunction (`every`) or disjunction, flattened and simplified."""
    kind = And if every else Or
    kept: dict[Condition, None] = {}
    for operand in operands:
        if isinstance(operand, Truth):
            if operand.value != every:
                return operand
        elif isinstance(operand, kind):
            kept.update(dict.fromkeys(operand.operands))
        else:
            kept[operand] = None
    if not kept:
        return Truth(every)
    return kind(tuple(kept)) if len(kept) > 1 else next(iter(kept))


_NEGATED = {
    Relation.AT_LEAST: Relation.GREATER,
    Relation.GREATER: Relation.AT_LEAST,
    Relation.EQUAL: Relation.DIFFERENT,
    Relation.DIFFERENT: Relation.EQUAL,
}


def negation(condition: Condition) -> Condition:
    """The negation of a condition, in negation normal form again."""
    match condition:
        case Truth(value):
            return Truth(not value)
        case Holds(atom, value):
            return Holds(atom, not value)
        case NumericCondition(expression, relation):
            equality = relation in (Relation.EQUAL, Relation.DIFFERENT)
            return NumericCondition(expression if equality else -expression, _NEGATED[relation])
        case And(operands):
            return Or(tuple(map(negation, operands)))
        case Or(operands):
            return And(tuple(map(negation, operands)))


def conflicts(effects: Iterable[NumericEffect]) -> Iterator[tuple[NumericEffect, NumericEffect]]:
    """The pairs of effects of one action that would give a fluent two values: two assignments, or one and an increase.

    Values do not matter [Fox and Long 2003, §8]. Pairs whose conditions plainly exclude each other are left out.
    """
    changes: dict[tuple[Timing, Fluent], list[NumericEffect]] = {}
    for effect in effects:
        changes.setdefault((effect.timing, effect.fluent), []).append(effect)
    for together in changes.values():
        for effect, other in combinations(together, 2):
            if AssignmentKind.ASSIGN in (effect.operator, other.operator) and not _exclude(
                effect.condition, other.condition
            ):
                yield effect, other


def _exclude(one: Condition, other: Condition) -> bool:
    """Whether a conjunct of one condition is the negation of some of the other's."""
    pairs = ((one, other), (other, one))
    return any(set(conjuncts(negation(part))) <= set(conjuncts(b)) for a, b in pairs for part in conjuncts(a))


def comparisons(condition: Condition) -> Iterator[NumericCondition]:
    """The comparisons in a condition, each as often as it occurs."""
    return (leaf for leaf in leaves(condition) if isinstance(leaf, NumericCondition))


def fluents_in(expression: Expression) -> Iterator[Fluent]:
    """The fluents that an expression mentions, each once."""
    return (variable for variable in expression.variables if isinstance(variable, Fluent))


def names_in(condition: Condition) -> Iterator[Atom | Fluent]:
    """The atoms and fluents that a condition mentions."""
    for leaf in leaves(condition):
        match leaf:
            case Holds(atom):
                yield atom
            case NumericCondition(expression):
                yield from fluents_in(expression)


def written_fluents(plan: ParametrizedPlan) -> set[Fluent]:
    """The fluents that change."""
    effects = {effect.fluent for instance in plan.instances for effect in instance.numeric_effects}
    flows = {effect.fluent for instance in plan.instances for effect in instance.continuous_effects}
    timed = {literal.target for literal in plan.timed_literals if isinstance(literal.target, Fluent)}
    return effects | flows | timed


def conjuncts(condition: Condition) -> Iterator[Condition]:
    """The top-level conjuncts of a condition."""
    if isinstance(condition, And):
        for operand in condition.operands:
            yield from conjuncts(operand)
    else:
        yield condition


Values = Mapping[NumericVariable, Fraction | Expression]

_Part = TypeVar("_Part")
_READING = {"durations", "conditions", "atom_effects", "numeric_effects", "continuous_effects"} | {
    "condition", "operands", "expression", "rate",
}  # fmt: skip
"""Fields of instances, their parts and conditions that read variables, or hold what does."""


@cache
def _reading(kind: type) -> Sequence[str]:
    """The fields of a class of parts that read variables."""
    return [field.name for field in fields(kind) if field.name in _READING]


def with_values(part: _Part, values: Values) -> _Part:
    """An instance, or a part of one, with these variables replaced by their values, in conditions and effects."""

    def value(variable: NumericVariable) -> Expression:
        known = values.get(variable)
        if isinstance(known, Polynomial):
            return known
        return Polynomial.variable(variable) if known is None else Polynomial.constant(known)

    whole: Any = part
    if isinstance(whole, Polynomial):
        whole = whole if values.keys().isdisjoint(whole.variables) else whole.substitute(value)
    elif isinstance(whole, tuple):
        members = tuple(with_values(member, values) for member in whole)
        whole = members if any(new is not old for new, old in zip(members, whole, strict=True)) else whole
    else:
        every = ((name, getattr(whole, name)) for name in _reading(whole.__class__))
        changed = {name: new for name, old in every if (new := with_values(old, values)) is not old}
        whole = replace(whole, **changed) if changed else whole
    replaced: _Part = whole
    return replaced


class HasPlan(Protocol):
    """A result with a plan, as conversions and repairs are."""

    @property
    def plan(self) -> ParametrizedPlan | None: ...


def plan_itself(plan: ParametrizedPlan | HasPlan) -> ParametrizedPlan:
    """A plan as it is, or that of a result.

    Raises:
        InputError: for anything else.
    """
    found = plan if isinstance(plan, ParametrizedPlan) else getattr(plan, "plan", None)
    if not isinstance(found, ParametrizedPlan):
        message = f"found {numbers.shorten(repr(plan))}, expected a plan of load_plan() or convert()"
        raise errors.InputError(message, errors.Location("plan"))
    return found


def at_values(plan: ParametrizedPlan, values: Mapping[str, Fraction]) -> ParametrizedPlan:
    """The plan at values of some of its parameters, which are none any more."""
    if not values:
        return plan
    known: Values = {ParameterReference(name): value for name, value in values.items()}

    def bound(weight: Bound | None) -> Bound | None:
        return None if weight is None else with_values(weight, known)

    constraints = (replace(item, lower=bound(item.lower), upper=bound(item.upper)) for item in plan.constraints)
    return replace(
        plan,
        parameters=tuple(parameter for parameter in plan.parameters if parameter.name not in values),
        instances=with_values(plan.instances, known),
        constraints=tuple(constraints),
        initial_fluents={fluent: with_values(value, known) for fluent, value in plan.initial_fluents.items()},
        goal=with_values(plan.goal, known),
    )


def within(plan: ParametrizedPlan, ranges: Mapping[str, tuple[Fraction | None, Fraction | None]]) -> ParametrizedPlan:
    """The plan with these bounds of parameters in place of the declared ones; None is no bound."""
    bounded = (replace(known, lower=low, upper=high) for known in plan.parameters for low, high in [ranges[known.name]])
    return replace(plan, parameters=tuple(bounded))
