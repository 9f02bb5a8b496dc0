"""PDDL domains and problems as data: lifted, checked, names in lower case, variables without their question mark.

Equality ignores locations: two files that say the same are equal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from robust.errors import Location
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing

OBJECT = "object"
"""The type that every object has."""


@dataclass(frozen=True, slots=True)
class TypedName:
    """A declared variable, constant or object; it has one of `types`."""

    name: str
    types: tuple[str, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Signature:
    """A declared predicate or function."""

    name: str
    parameters: tuple[TypedName, ...]
    location: Location = field(compare=False)

    def __str__(self) -> str:
        return f"({' '.join((self.name, *(f'?{parameter.name}' for parameter in self.parameters)))})"


@dataclass(frozen=True, slots=True)
class Term:
    """A variable or the name of an object."""

    name: str
    variable: bool
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Number:
    """A number, exact; `text` is how it was written."""

    value: Fraction
    text: str = field(compare=False)
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class FunctionTerm:
    """The value of a numeric function."""

    function: str
    arguments: tuple[Term, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class DurationTerm:
    """`?duration`."""

    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class ParameterTerm:
    """A synthesis parameter: of the domain, or (`local`) of the action, which has one for every instance."""

    name: str
    local: bool
    location: Location = field(compare=False)


class Operator(Enum):
    PLUS = "+"
    MINUS = "-"
    TIMES = "*"
    DIVIDED = "/"


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """MINUS has one or two operands, DIVIDED two, the others at least one."""

    operator: Operator
    operands: tuple[NumericExpression, ...]
    location: Location = field(compare=False)


NumericExpression = Number | FunctionTerm | DurationTerm | ParameterTerm | Arithmetic


def subexpressions(expression: NumericExpression) -> Iterator[NumericExpression]:
    """An expression and all expressions inside it."""
    pending = [expression]
    while pending:
        current = pending.pop()
        yield current
        if isinstance(current, Arithmetic):
            pending.extend(current.operands)


class Comparator(Enum):
    LESS = "<"
    AT_MOST = "<="
    EQUAL = "="
    AT_LEAST = ">="
    GREATER = ">"


@dataclass(frozen=True, slots=True)
class Proposition:
    """The use of a predicate."""

    predicate: str
    arguments: tuple[Term, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Equality:
    """Two terms denote the same object."""

    left: Term
    right: Term
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class NumericComparison:
    """`left comparator right`."""

    comparator: Comparator
    left: NumericExpression
    right: NumericExpression
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class NameEquality:
    """`=` between two names of functions, which are objects where a problem declares both: terms come first."""

    objects: Equality
    numbers: NumericComparison

    def meant(self, declared: Mapping[str, TypedName]) -> Equality | NumericComparison:
        """What is compared where these objects are declared."""
        return self.objects if {self.objects.left.name, self.objects.right.name} <= declared.keys() else self.numbers


@dataclass(frozen=True, slots=True)
class Negation:
    """`not`."""

    operand: LiftedCondition
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Conjunction:
    """`and`."""

    operands: tuple[LiftedCondition, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Disjunction:
    """`or`."""

    operands: tuple[LiftedCondition, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Implication:
    """`imply`."""

    premise: LiftedCondition
    conclusion: LiftedCondition
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Quantification:
    """`forall` (`universal`) or `exists`."""

    universal: bool
    variables: tuple[TypedName, ...]
    operand: LiftedCondition
    location: Location = field(compare=False)


LiftedCondition = (
    Proposition
    | Equality
    | NumericComparison
    | NameEquality
    | Negation
    | Conjunction
    | Disjunction
    | Implication
    | Quantification
)


@dataclass(frozen=True, slots=True)
class TimedLiftedCondition:
    """One conjunct of an action's condition."""

    timing: Timing
    condition: LiftedCondition


@dataclass(frozen=True, slots=True)
class DurationBound:
    """`?duration comparator bound`."""

    timing: Timing
    comparator: Comparator
    bound: NumericExpression
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class LiteralEffect:
    """A proposition becomes true (`value`) or false."""

    timing: Timing
    proposition: Proposition
    value: bool


class Update(Enum):
    ASSIGN = "assign"
    INCREASE = "increase"
    DECREASE = "decrease"
    SCALE_UP = "scale-up"
    SCALE_DOWN = "scale-down"


@dataclass(frozen=True, slots=True)
class NumericUpdate:
    """`(update target expression)`."""

    timing: Timing
    update: Update
    target: FunctionTerm
    expression: NumericExpression
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class ContinuousUpdate:
    """`(update target (* #t rate))` with an update that is INCREASE or DECREASE."""

    update: Update
    target: FunctionTerm
    rate: NumericExpression
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class ForallEffect:
    """Effects for every choice of objects."""

    variables: tuple[TypedName, ...]
    effects: tuple[LiftedEffect, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class WhenEffect:
    """Effects that happen only if `condition` holds just before; all have the timing of the condition.

    If there is something `remembered`, they are effects at the end, and that must have held just before the start.
    """

    condition: LiftedCondition
    effects: tuple[LiftedEffect, ...]
    location: Location = field(compare=False)
    remembered: LiftedCondition | None = None


LiftedEffect = LiteralEffect | NumericUpdate | ContinuousUpdate | ForallEffect | WhenEffect


def primitive(effects: Iterable[LiftedEffect]) -> Iterator[LiteralEffect | NumericUpdate | ContinuousUpdate]:
    """All effects that are not themselves made of effects."""
    for effect in effects:
        if isinstance(effect, (ForallEffect, WhenEffect)):
            yield from primitive(effect.effects)
        else:
            yield effect


@dataclass(frozen=True, slots=True)
class ActionSchema:
    """An action; everything in an instantaneous one is AT_START."""

    name: str
    durative: bool
    parameters: tuple[TypedName, ...]
    synth_parameters: tuple[str, ...]
    durations: tuple[DurationBound, ...]
    conditions: tuple[TimedLiftedCondition, ...]
    effects: tuple[LiftedEffect, ...]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Domain:
    """A planning domain; `types` maps every type to all types that its objects have (itself and its ancestors).

    `parameters` are the domain's synthesis parameters; `written` are the functions that some action changes.
    """

    name: str
    parameters: tuple[str, ...]
    types: Mapping[str, frozenset[str]]
    constants: Mapping[str, TypedName]
    predicates: Mapping[str, Signature]
    functions: Mapping[str, Signature]
    actions: Mapping[str, ActionSchema]
    written: frozenset[str]
    location: Location = field(compare=False)


@dataclass(frozen=True, slots=True)
class Problem:
    """A planning problem; `objects` include the domain's constants."""

    name: str
    domain: str
    objects: Mapping[str, TypedName]
    atoms: frozenset[Atom]
    fluents: Mapping[Fluent, Fraction]
    timed_literals: tuple[TimedLiteral, ...]
    goal: LiftedCondition
    location: Location = field(compare=False)
