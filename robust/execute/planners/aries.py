"""Aries, a constraint-based temporal planner of the extra `planners` (package up-aries).

The problem is handed over in the wire format of unified-planning, and the plan is read from what Aries prints: there is
one process, no server and no port. Aries counts time in tenths; here a unit of its time is a tick of ours, so that its
tenths, by which it separates what depends on each other, are the separation of mutex time points.
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, reduce
from itertools import product
from pathlib import Path
from typing import Any, assert_never

import unified_planning.model as up
import unified_planning.shortcuts as ups
from unified_planning.environment import Environment

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location, UnsupportedError, missing
from robust.execute.planners.interface import MEMORY_MB, PlannerAnswer, PlannerStatus, judged, valid_plans
from robust.numbers import format_number
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl import declarations, syntax
from robust.plan.timed import TimedPlan, TimedStep
from robust.processes import ProcessEnd, Processes
from robust.smt.limits import Deadline

Bindings = Mapping[str, up.FNode]
"""Variables with what stands for them: a parameter of an action, or an object."""


def unsupported(what: str, location: Location | None) -> UnsupportedError:
    return UnsupportedError(f"found {what}, which Aries does not solve; expected another planner, as kairos", location)


def integer(value: Fraction, what: str, location: Location | None) -> int:
    """The number as an integer; UnsupportedError if it is none."""
    if value.denominator != 1:
        raise unsupported(f"{what} {format_number(value)}, not an integer", location)
    return value.numerator


class AriesTranslation:
    """A problem in terms of unified-planning; functions become fluents when they are first mentioned.

    A duration without upper bound is at most `longest` ticks. `ticked` are functions of time, counted in ticks: a
    function that durations mention as well as conditions is two.
    """

    def __init__(self, domain: syntax.Domain, problem: syntax.Problem, ticks: int, longest: int) -> None:
        self._problem = problem
        self._longest = longest
        self._domain = domain
        self.ticks = ticks
        self.environment = Environment()
        self.environment.credits_stream = None
        self.manager = self.environment.expression_manager
        self.bool = self.environment.type_manager.BoolType()
        self._types = self._all_types(domain)
        objects = problem.objects.items()
        self.objects = {name: up.Object(f"o_{name}", self.type(typed), self.environment) for name, typed in objects}
        self.predicates = {
            name: self._fluent("p", signature, self.bool) for name, signature in domain.predicates.items()
        }
        self.functions: dict[str, up.Fluent] = {}
        self.ticked: dict[str, up.Fluent] = {}

    def _all_types(self, domain: syntax.Domain) -> dict[str, up.types.Type]:
        """Types from the root down; each has one parent."""
        types: dict[str, up.types.Type] = {}
        manager = self.environment.type_manager
        for name, ancestors in sorted(domain.types.items(), key=lambda item: len(item[1])):
            above = [ancestor for ancestor in ancestors if ancestor != name]
            parent = max(above, key=lambda name: len(domain.types[name]), default=None)
            if parent is not None and domain.types[parent] != frozenset(above):
                raise unsupported(f"type {name!r} with more than one parent", domain.location)
            types[name] = manager.UserType(f"t_{name}", None if parent is None else types[parent])
        return types

    def type(self, declared: syntax.TypedName) -> up.types.Type:
        if len(declared.types) > 1:
            raise unsupported(f"{declared.name!r} of more than one type", declared.location)
        return self._types[declared.types[0]]

    def _fluent(self, kind: str, signature: syntax.Signature, value: up.types.Type) -> up.Fluent:
        typed = signature.parameters
        parameters = [up.Parameter(f"x_{name.name}", self.type(name), self.environment) for name in typed]
        return up.Fluent(f"{kind}_{signature.name}", value, parameters, self.environment)

    def ground(self, fluent: up.Fluent, arguments: Iterable[str]) -> up.FNode:
        return fluent(*(self.objects[name] for name in arguments))

    def condition(self, condition: syntax.LiftedCondition, bindings: Bindings) -> up.FNode:  # noqa: PLR0911 - one for each kind
        manager = self.manager
        match condition:
            case syntax.Proposition(predicate, arguments):
                return self.predicates[predicate](*(self._term(argument, bindings) for argument in arguments))
            case syntax.Equality(left, right):
                return manager.Equals(self._term(left, bindings), self._term(right, bindings))
            case syntax.NumericComparison(comparator, left, right):
                compare = getattr(manager, _COMPARISONS[comparator])
                return compare(self.number(left, bindings), self.number(right, bindings))
            case syntax.NameEquality():
                return self.condition(condition.meant(self._problem.objects), bindings)
            case syntax.Negation(operand):
                return manager.Not(self.condition(operand, bindings))
            case syntax.Conjunction(operands):
                return manager.And([self.condition(part, bindings) for part in operands])
            case syntax.Disjunction(operands):
                return manager.Or([self.condition(part, bindings) for part in operands])
            case syntax.Implication(premise, conclusion):
                return manager.Or(manager.Not(self.condition(premise, bindings)), self.condition(conclusion, bindings))
            case syntax.Quantification(universal, variables, operand):
                parts = [self.condition(operand, bound) for bound in self.expansions(variables, bindings)]
                return manager.And(parts) if universal else manager.Or(parts)
            case _:
                assert_never(condition)

    def expansions(self, variables: Sequence[syntax.TypedName], bindings: Bindings) -> Iterator[Bindings]:
        """The bindings with every choice of objects for the variables of a quantifier."""
        names = [variable.name for variable in variables]
        for chosen in product(*declarations.choices(variables, self._problem.objects, self._domain.types)):
            objects = (self.manager.ObjectExp(self.objects[name]) for name in chosen)
            yield {**bindings, **dict(zip(names, objects, strict=True))}

    def _term(self, term: syntax.Term, bindings: Bindings) -> up.FNode:
        return bindings[term.name] if term.variable else self.manager.ObjectExp(self.objects[term.name])

    def number(self, expression: syntax.NumericExpression, bindings: Bindings, *, timed: bool = False) -> up.FNode:
        """An expression of a condition or effect; `timed` ones are in ticks: numbers, functions, sums, differences."""
        match expression:
            case syntax.Number(value, _, location):
                return self.manager.Int(integer(value * (self.ticks if timed else 1), "the number", location))
            case syntax.FunctionTerm(function, arguments, location):
                if timed and function in self._domain.written:
                    raise unsupported(f"a duration that depends on ({function} …), which changes", location)
                known, kind = (self.ticked, "d") if timed else (self.functions, "f")
                if function not in known:
                    number = self.environment.type_manager.IntType()
                    known[function] = self._fluent(kind, self._domain.functions[function], number)
                return known[function](*(self._term(argument, bindings) for argument in arguments))
            case syntax.DurationTerm(location):
                raise unsupported("?duration in an expression", location)
            case syntax.ParameterTerm(name, _, location):
                raise unsupported(f"synthesis parameter {name!r}", location)
            case syntax.Arithmetic(syntax.Operator.TIMES | syntax.Operator.DIVIDED, _, location) if timed:
                raise unsupported("a product or quotient in a duration", location)
            case syntax.Arithmetic(operator, operands):
                values = [self.number(operand, bindings, timed=timed) for operand in operands]
                combined = getattr(self.manager, _ARITHMETIC[operator])
                return reduce(combined, values if len(values) > 1 else [self.manager.Int(0), *values])
            case _:
                assert_never(expression)

    def unified(self) -> up.Problem:
        """The problem with `ticks` to a time unit.

        Timed literals between two ticks are moved so that what holds for a shorter time does not come to hold for
        longer.

        Raises:
            UnsupportedError: for what Aries does not solve.
        """
        unified = up.Problem("p", self.environment, initial_defaults={self.bool: self.manager.FALSE()})
        unified.add_objects(list(self.objects.values()))
        for schema in self._domain.actions.values():
            unified.add_action(self._action(schema))
        unified.add_goal(self.condition(self._problem.goal, {}))
        for fluent in (*self.predicates.values(), *self.functions.values(), *self.ticked.values()):
            unified.add_fluent(fluent)
        self._set_initial_state(unified)
        for literal in self._problem.timed_literals:
            self._add_timed_literal(unified, literal)
        return unified

    def _set_initial_state(self, unified: up.Problem) -> None:
        for atom in sorted(self._problem.atoms):
            unified.set_initial_value(self.ground(self.predicates[atom.predicate], atom.arguments), True)
        for fluent, value in self._problem.fluents.items():
            in_ticks = f"{fluent} in ticks of 1/{self.ticks} ="
            for known, unit, what in ((self.functions, 1, f"{fluent} ="), (self.ticked, self.ticks, in_ticks)):
                if fluent.function in known:
                    number = integer(value * unit, what, self._problem.location)
                    unified.set_initial_value(self.ground(known[fluent.function], fluent.arguments), number)

    def _add_timed_literal(self, unified: up.Problem, literal: TimedLiteral) -> None:
        exact = literal.time * self.ticks
        match literal.target:
            case Atom(predicate, arguments):
                tick = int(-(-exact // 1) if literal.value else exact // 1)
                target = self.ground(self.predicates[predicate], arguments)
                if tick:
                    unified.add_timed_effect(ups.GlobalStartTiming(tick), target, bool(literal.value))
                else:
                    unified.set_initial_value(target, bool(literal.value))
            case Fluent():
                raise unsupported(f"a number that changes at a time, {literal.target}", self._problem.location)
            case _:
                assert_never(literal.target)

    def _action(self, schema: syntax.ActionSchema) -> up.Action:
        kind = up.DurativeAction if schema.durative else up.InstantaneousAction
        parameters = {f"v_{parameter.name}": self.type(parameter) for parameter in schema.parameters}
        action: Any = kind(f"a_{schema.name}", parameters, self.environment)
        make = self.manager.ParameterExp
        bindings = {parameter.name: make(action.parameter(f"v_{parameter.name}")) for parameter in schema.parameters}
        if schema.durative:
            action.set_duration_constraint(self._duration(schema, bindings))
        for part in schema.conditions:
            condition = self.condition(part.condition, bindings)
            if schema.durative:
                action.add_condition(_TIMES[part.timing], condition)
            else:
                action.add_precondition(condition)
        for timing, target, value, update in self._changes(schema.effects, bindings):
            when = (_TIMES[timing],) if schema.durative else ()
            getattr(action, _ADDING[update])(*when, target, value)
        return action

    def _duration(self, schema: syntax.ActionSchema, bindings: Bindings) -> up.DurationInterval:
        """The bounds as a closed interval; strict ones are left to the check of the plan."""
        lower, upper = [], []
        for duration in schema.durations:
            if duration.timing is not Timing.AT_START:
                raise unsupported("a duration constraint at the end", duration.location)
            bound = self.number(duration.bound, bindings, timed=True)
            if duration.comparator in (syntax.Comparator.EQUAL, syntax.Comparator.AT_LEAST, syntax.Comparator.GREATER):
                lower.append(bound)
            if duration.comparator in (syntax.Comparator.EQUAL, syntax.Comparator.AT_MOST, syntax.Comparator.LESS):
                upper.append(bound)
        if len(lower) > 1 or len(upper) > 1:
            raise unsupported(f"more than one bound on one side of the duration of {schema.name!r}", schema.location)
        make = self.manager.Int
        return ups.ClosedDurationInterval(lower[0] if lower else make(0), upper[0] if upper else make(self._longest))

    def _changes(self, effects: tuple[syntax.LiftedEffect, ...], bindings: Bindings) -> Iterator[Change]:
        for effect in effects:
            match effect:
                case syntax.LiteralEffect(timing, proposition, value):
                    yield timing, self.condition(proposition, bindings), value, syntax.Update.ASSIGN
                case syntax.NumericUpdate(timing, update, target, expression):
                    if update not in _ADDING:
                        raise unsupported(f"an effect {update.value!r}", None)
                    yield timing, self.number(target, bindings), self.number(expression, bindings), update
                case syntax.ForallEffect(variables, inner):
                    for bound in self.expansions(variables, bindings):
                        yield from self._changes(inner, bound)
                case syntax.WhenEffect(_, _, location):
                    raise unsupported("a conditional effect", location)
                case syntax.ContinuousUpdate(_, _, _, location):
                    raise unsupported("a continuous effect", location)
                case _:
                    assert_never(effect)


_ARITHMETIC = {
    syntax.Operator.PLUS: "Plus",
    syntax.Operator.TIMES: "Times",
    syntax.Operator.DIVIDED: "Div",
    syntax.Operator.MINUS: "Minus",
}
_COMPARISONS = {
    syntax.Comparator.LESS: "LT",
    syntax.Comparator.AT_MOST: "LE",
    syntax.Comparator.EQUAL: "Equals",
    syntax.Comparator.AT_LEAST: "GE",
    syntax.Comparator.GREATER: "GT",
}
"""Methods of unified-planning's expression manager."""


Change = tuple[Timing, up.FNode, Any, syntax.Update]


def pddl_name(name: str) -> str:
    """The name without the prefix of its kind."""
    return name.partition("_")[2]


_ADDING = {
    syntax.Update.ASSIGN: "add_effect",
    syntax.Update.INCREASE: "add_increase_effect",
    syntax.Update.DECREASE: "add_decrease_effect",
}
"""The method of an action for each kind of effect that Aries solves."""
_TIMES = {
    Timing.AT_START: ups.StartTiming(),
    Timing.AT_END: ups.EndTiming(),
    Timing.OVER_ALL: ups.OpenTimeInterval(ups.StartTiming(), ups.EndTiming()),
}

_SEPARATION = Fraction(1, 10)
"""The least time between two dependent time points of Aries, in its units."""

HORIZON = 10**5
"""Time units; no plan is longer. Aries itself would stop at 10,000 ticks, and counts their tenths in 32 bits."""


@dataclass(frozen=True, slots=True)
class AriesPlanner:
    """The first plan that Aries finds. Its strategies race in threads, so the same problem may have another plan."""

    executable: str
    epsilon: Fraction = EPSILON
    name: str = "aries"

    @property
    def ticks(self) -> int:
        """Ticks in a unit of the plan's time."""
        return int(_SEPARATION / self.epsilon)

    def solve(self, domain: syntax.Domain, problem: syntax.Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        writer = importlib.import_module("unified_planning.grpc.proto_writer").ProtobufWriter()
        translation = AriesTranslation(domain, problem, self.ticks, HORIZON * self.ticks)
        message: bytes = writer.convert(translation.unified()).SerializeToString()
        with tempfile.TemporaryDirectory(prefix="robust-planner-") as name:
            folder = Path(name)
            (folder / "problem.bin").write_bytes(message)
            command = (self.executable, "--log-level", "error", "solve", "problem.bin")
            variables = {"ARIES_PLANNING_HORIZON": str(HORIZON * self.ticks), "RUST_BACKTRACE": "0"}
            run = partial(Processes().run, folder=folder, memory_mb=MEMORY_MB, scratch=folder)
            ended = run(command, deadline, variables=variables)
        in_units = partial(_in_units, domain=domain, ticks=self.ticks)
        printed = valid_plans(ended.stdout, domain, problem, self.epsilon, self.name, renamed=in_units)
        return judged(self.name, ended, printed, _verdict)


def aries_planner(*, epsilon: Fraction = EPSILON) -> AriesPlanner:
    """Aries, with plans whose dependent time points are at least `epsilon` apart.

    Raises:
        UnsupportedError: if the package is not installed, or not for this machine.
        InputError: if `epsilon` is not between 1/20,000 and 1/10: a tick has to fit into 32 bits.
    """
    if not Fraction(1, 20_000) <= epsilon <= _SEPARATION:
        raise InputError(f"found ε = {format_number(epsilon)}, expected 1/20000 to 1/10 for aries")
    try:
        solver = importlib.import_module("up_aries.solver")
        executable: str = solver._find_executable()
    except ImportError as error:
        raise missing("planner aries (package up-aries)", "planners") from error
    except OSError as error:
        message = f"found no planner aries for this machine ({error}), expected another planner"
        raise UnsupportedError(message) from error
    return AriesPlanner(executable, epsilon)


def _in_units(plan: TimedPlan, domain: syntax.Domain, ticks: int) -> TimedPlan:
    """The plan with PDDL's names, and times in the problem's unit; instantaneous actions have no duration."""

    steps = []
    for step in plan.steps:
        schema = domain.actions.get(pddl_name(step.action))
        durative = step.duration is not None and (schema is None or schema.durative)
        duration = step.duration / ticks if durative and step.duration is not None else None
        arguments = tuple(map(pddl_name, step.arguments))
        steps.append(TimedStep(step.time / ticks, pddl_name(step.action), arguments, duration, step.location))
    return TimedPlan(tuple(steps), plan.file)


def _verdict(ended: ProcessEnd) -> PlannerStatus | None:
    if "NO PLAN" in ended.stdout:
        return PlannerStatus.NO_PLAN
    return PlannerStatus.CRASHED if ended.stderr.startswith("Error:") else None
