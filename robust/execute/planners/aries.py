"""Conditions and expressions as unified-planning objects, in the part of PDDL that Aries solves."""

from __future__ import annotations

import importlib
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from itertools import product
from pathlib import Path
from typing import Any, Protocol, assert_never

import unified_planning.model as up
import unified_planning.shortcuts as ups
from unified_planning.environment import Environment

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location, RobustError, UnsupportedError
from robust.execute.planners.command import MEMORY_MB, Ended, judged, run
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, check, plan_texts
from robust.numbers import format_number
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl.conditions import primitive
from robust.plan.pddl.declarations import fits
from robust.plan.pddl.syntax import (
    ActionSchema,
    Arithmetic,
    Comparator,
    Conjunction,
    ContinuousUpdate,
    Disjunction,
    Domain,
    DurationTerm,
    Equality,
    ForallEffect,
    FunctionTerm,
    Implication,
    LiftedCondition,
    LiftedEffect,
    LiteralEffect,
    Negation,
    Number,
    NumericComparison,
    NumericExpression,
    NumericUpdate,
    Operator,
    ParameterTerm,
    Problem,
    Proposition,
    Quantification,
    Signature,
    Term,
    TypedName,
    Update,
    WhenEffect,
)
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
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


class Vocabulary:
    """Types, objects and fluents of a problem; `ticked` are functions of time, counted in ticks."""

    def __init__(self, domain: Domain, problem: Problem, ticks: int) -> None:
        self._problem = problem
        self._hierarchy = domain.types
        self.ticks = ticks
        self.environment = Environment()
        self.environment.credits_stream = None
        self._manager = self.environment.expression_manager
        self.bool = self.environment.type_manager.BoolType()
        number = self.environment.type_manager.IntType()
        self._types = self._all_types(domain)
        self.objects = {
            one.name: up.Object(f"o_{one.name}", self.type(one), self.environment) for one in problem.objects.values()
        }
        self.predicates = {one.name: self._fluent("p", one, self.bool) for one in domain.predicates.values()}
        self.functions = {
            name: self._fluent("f", domain.functions[name], number) for name in _functions_elsewhere(domain, problem)
        }
        self.ticked = {
            name: self._fluent("d", domain.functions[name], number) for name in _functions_in_durations(domain)
        }

    def _all_types(self, domain: Domain) -> dict[str, up.types.Type]:
        """Types from the root down; each has one parent."""
        types: dict[str, up.types.Type] = {}
        manager = self.environment.type_manager
        for name, ancestors in sorted(domain.types.items(), key=lambda item: len(item[1])):
            above = [one for one in ancestors if one != name]
            parent = max(above, key=lambda one: len(domain.types[one]), default=None)
            if parent is not None and domain.types[parent] != frozenset(above):
                raise unsupported(f"type {name!r} with more than one parent", domain.location)
            types[name] = manager.UserType(f"t_{name}", None if parent is None else types[parent])
        return types

    def type(self, declared: TypedName) -> up.types.Type:
        if len(declared.types) > 1:
            raise unsupported(f"{declared.name!r} of more than one type", declared.location)
        return self._types[declared.types[0]]

    def _fluent(self, kind: str, signature: Signature, value: up.types.Type) -> up.Fluent:
        parameters = [up.Parameter(f"x_{one.name}", self.type(one), self.environment) for one in signature.parameters]
        return up.Fluent(f"{kind}_{signature.name}", value, parameters, self.environment)

    def ground(self, fluent: up.Fluent, arguments: Iterable[str]) -> up.FNode:
        return fluent(*(self.objects[name] for name in arguments))

    def condition(self, condition: LiftedCondition, bindings: Bindings) -> up.FNode:  # noqa: PLR0911 - one for each kind
        manager = self._manager
        match condition:
            case Proposition(predicate, arguments):
                return self.predicates[predicate](*(self._term(one, bindings) for one in arguments))
            case Equality(left, right):
                return manager.Equals(self._term(left, bindings), self._term(right, bindings))
            case NumericComparison(comparator, left, right):
                return self._comparison(comparator, self.number(left, bindings), self.number(right, bindings))
            case Negation(operand):
                return manager.Not(self.condition(operand, bindings))
            case Conjunction(operands):
                return manager.And([self.condition(one, bindings) for one in operands])
            case Disjunction(operands):
                return manager.Or([self.condition(one, bindings) for one in operands])
            case Implication(premise, conclusion):
                return manager.Or(manager.Not(self.condition(premise, bindings)), self.condition(conclusion, bindings))
            case Quantification(universal, variables, operand):
                parts = [self.condition(operand, bound) for bound in self.expansions(variables, bindings)]
                return manager.And(parts) if universal else manager.Or(parts)
            case _:
                assert_never(condition)

    def _comparison(self, comparator: Comparator, left: up.FNode, right: up.FNode) -> up.FNode:
        manager = self._manager
        match comparator:
            case Comparator.LESS:
                return manager.LT(left, right)
            case Comparator.AT_MOST:
                return manager.LE(left, right)
            case Comparator.EQUAL:
                return manager.Equals(left, right)
            case Comparator.AT_LEAST:
                return manager.GE(left, right)
            case Comparator.GREATER:
                return manager.GT(left, right)
            case _:
                assert_never(comparator)

    def expansions(self, variables: Iterable[TypedName], bindings: Bindings) -> Iterator[Bindings]:
        """The bindings with every choice of objects for the variables of a quantifier."""
        names = tuple(variables)
        choices = [
            [
                self._manager.ObjectExp(self.objects[one.name])
                for one in self._problem.objects.values()
                if fits(one.types, variable.types, self._hierarchy)
            ]
            for variable in names
        ]
        for chosen in product(*choices):
            yield {**bindings, **{one.name: value for one, value in zip(names, chosen, strict=True)}}

    def number(self, expression: NumericExpression, bindings: Bindings) -> up.FNode:
        """An expression of a condition or effect."""
        return self._expression(expression, bindings, self.functions, 1)

    def duration(self, expression: NumericExpression, bindings: Bindings) -> up.FNode:
        """An expression of time, in ticks: a number, a function, or a sum or difference of them."""
        for one in _nodes(expression):
            if isinstance(one, Arithmetic) and one.operator in (Operator.TIMES, Operator.DIVIDED):
                raise unsupported("a product or quotient in a duration", one.location)
        return self._expression(expression, bindings, self.ticked, self.ticks)

    def _term(self, term: Term, bindings: Bindings) -> up.FNode:
        return bindings[term.name] if term.variable else self._manager.ObjectExp(self.objects[term.name])

    def _expression(
        self, expression: NumericExpression, bindings: Bindings, functions: Mapping[str, up.Fluent], factor: int
    ) -> up.FNode:
        match expression:
            case Number(value, _, location):
                return self._manager.Int(integer(value * factor, "the number", location))
            case FunctionTerm(function, arguments):
                return functions[function](*(self._term(one, bindings) for one in arguments))
            case DurationTerm(location):
                raise unsupported("?duration in an expression", location)
            case ParameterTerm(name, _, location):
                raise unsupported(f"synthesis parameter {name!r}", location)
            case Arithmetic(operator, operands):
                values = [self._expression(one, bindings, functions, factor) for one in operands]
                return self._arithmetic(operator, values)
            case _:
                assert_never(expression)

    def _arithmetic(self, operator: Operator, values: list[up.FNode]) -> up.FNode:
        manager = self._manager
        match operator:
            case Operator.PLUS:
                return manager.Plus(values)
            case Operator.TIMES:
                return manager.Times(values)
            case Operator.DIVIDED:
                return manager.Div(*values)
            case Operator.MINUS:
                return reduce(manager.Minus, values if len(values) > 1 else [manager.Int(0), *values])
            case _:
                assert_never(operator)


def _functions_in_durations(domain: Domain) -> list[str]:
    """The functions that durations depend on; UnsupportedError for one that an action changes."""
    names = set()
    for schema in domain.actions.values():
        for bound in schema.durations:
            for term in _functions(bound.bound):
                if term.function in domain.written:
                    raise unsupported(f"a duration that depends on ({term.function} …), which changes", bound.location)
                names.add(term.function)
    return sorted(names)


def _functions_elsewhere(domain: Domain, problem: Problem) -> list[str]:
    """The functions that conditions, effects and the goal depend on."""
    conditions = [problem.goal, *(one.condition for schema in domain.actions.values() for one in schema.conditions)]
    names = {term.function for condition in conditions for term in _functions_of_condition(condition)}
    for schema in domain.actions.values():
        for effect in primitive(schema.effects):
            if isinstance(effect, NumericUpdate):
                names |= {effect.target.function, *(term.function for term in _functions(effect.expression))}
    return sorted(names)


def _functions_of_condition(condition: LiftedCondition) -> Iterator[FunctionTerm]:
    todo = [condition]
    while todo:
        match todo.pop():
            case NumericComparison(_, left, right):
                yield from _functions(left)
                yield from _functions(right)
            case Negation(operand) | Quantification(_, _, operand):
                todo.append(operand)
            case Conjunction(operands) | Disjunction(operands):
                todo.extend(operands)
            case Implication(premise, conclusion):
                todo += [premise, conclusion]
            case Proposition() | Equality():
                pass


def _functions(expression: NumericExpression) -> Iterator[FunctionTerm]:
    return (one for one in _nodes(expression) if isinstance(one, FunctionTerm))


def _nodes(expression: NumericExpression) -> Iterator[NumericExpression]:
    todo = [expression]
    while todo:
        node = todo.pop()
        yield node
        if isinstance(node, Arithmetic):
            todo.extend(node.operands)


Change = tuple[Timing, up.FNode, Any, Update]


def unified_problem(domain: Domain, problem: Problem, ticks: int, horizon: int) -> up.Problem:
    """The problem with `ticks` to a time unit; a duration without upper bound is at most `horizon` time units.

    Timed literals between two ticks are moved so that what holds for a shorter time does not come to hold for longer.

    Raises:
        UnsupportedError: for what Aries does not solve.
    """
    words = Vocabulary(domain, problem, ticks)
    defaults = {words.bool: words.environment.expression_manager.FALSE()}
    unified = up.Problem("p", words.environment, initial_defaults=defaults)
    unified.add_objects(list(words.objects.values()))
    for fluent in (*words.predicates.values(), *words.functions.values(), *words.ticked.values()):
        unified.add_fluent(fluent)
    for schema in domain.actions.values():
        unified.add_action(
            _durative(schema, words, horizon * ticks) if schema.durative else _instantaneous(schema, words)
        )
    _set_initial_state(unified, problem, words)
    for literal in problem.timed_literals:
        _add_timed_literal(unified, literal, problem, words)
    unified.add_goal(words.condition(problem.goal, {}))
    return unified


def pddl_name(name: str) -> str:
    """The name without the prefix of its kind."""
    return name.partition("_")[2]


def _set_initial_state(unified: up.Problem, problem: Problem, words: Vocabulary) -> None:
    for atom in sorted(problem.atoms):
        unified.set_initial_value(words.ground(words.predicates[atom.predicate], atom.arguments), True)
    for fluent, value in problem.fluents.items():
        name = fluent.function
        if name in words.functions:
            number = integer(value, f"{fluent} =", problem.location)
            unified.set_initial_value(words.ground(words.functions[name], fluent.arguments), number)
        if name in words.ticked:
            number = integer(value * words.ticks, f"{fluent} in ticks of 1/{words.ticks} =", problem.location)
            unified.set_initial_value(words.ground(words.ticked[name], fluent.arguments), number)


def _add_timed_literal(unified: up.Problem, literal: TimedLiteral, problem: Problem, words: Vocabulary) -> None:
    exact = literal.time * words.ticks
    match literal.target:
        case Atom(predicate, arguments):
            tick = int(-(-exact // 1) if literal.value else exact // 1)
            target = words.ground(words.predicates[predicate], arguments)
            if tick:
                unified.add_timed_effect(ups.GlobalStartTiming(tick), target, bool(literal.value))
            else:
                unified.set_initial_value(target, bool(literal.value))
        case Fluent():
            raise unsupported(f"a number that changes at a time, {literal.target}", problem.location)
        case _:
            assert_never(literal.target)


def _instantaneous(schema: ActionSchema, words: Vocabulary) -> up.InstantaneousAction:
    action = up.InstantaneousAction(f"a_{schema.name}", _parameters(schema, words), words.environment)
    bindings = _bindings(schema, action, words)
    for one in schema.conditions:
        action.add_precondition(words.condition(one.condition, bindings))
    for _, target, value, update in _changes(schema.effects, bindings, words):
        _add(update, action)(target, value)
    return action


def _durative(schema: ActionSchema, words: Vocabulary, longest: int) -> up.DurativeAction:
    action = up.DurativeAction(f"a_{schema.name}", _parameters(schema, words), words.environment)
    bindings = _bindings(schema, action, words)
    action.set_duration_constraint(_duration(schema, bindings, words, longest))
    for one in schema.conditions:
        action.add_condition(_interval(one.timing), words.condition(one.condition, bindings))
    for timing, target, value, update in _changes(schema.effects, bindings, words):
        _add(update, action)(ups.EndTiming() if timing is Timing.AT_END else ups.StartTiming(), target, value)
    return action


def _parameters(schema: ActionSchema, words: Vocabulary) -> dict[str, Any]:
    return {f"v_{one.name}": words.type(one) for one in schema.parameters}


def _bindings(schema: ActionSchema, action: up.Action, words: Vocabulary) -> Bindings:
    make = words.environment.expression_manager.ParameterExp
    return {one.name: make(action.parameter(f"v_{one.name}")) for one in schema.parameters}


def _duration(schema: ActionSchema, bindings: Bindings, words: Vocabulary, longest: int) -> up.DurationInterval:
    """The bounds as a closed interval; strict ones are left to the check of the plan."""
    lower, upper = [], []
    for one in schema.durations:
        if one.timing is not Timing.AT_START:
            raise unsupported("a duration constraint at the end", one.location)
        bound = words.duration(one.bound, bindings)
        if one.comparator in (Comparator.EQUAL, Comparator.AT_LEAST, Comparator.GREATER):
            lower.append(bound)
        if one.comparator in (Comparator.EQUAL, Comparator.AT_MOST, Comparator.LESS):
            upper.append(bound)
    if len(lower) > 1 or len(upper) > 1:
        raise unsupported(f"more than one bound on one side of the duration of {schema.name!r}", schema.location)
    make = words.environment.expression_manager.Int
    return ups.ClosedDurationInterval(lower[0] if lower else make(0), upper[0] if upper else make(longest))


def _changes(effects: tuple[LiftedEffect, ...], bindings: Bindings, words: Vocabulary) -> Iterator[Change]:
    for effect in effects:
        match effect:
            case LiteralEffect(timing, proposition, value):
                yield timing, words.condition(proposition, bindings), value, Update.ASSIGN
            case NumericUpdate(timing, update, target, expression):
                yield timing, words.number(target, bindings), words.number(expression, bindings), update
            case ForallEffect(variables, inner):
                for bound in words.expansions(variables, bindings):
                    yield from _changes(inner, bound, words)
            case WhenEffect(_, _, location):
                raise unsupported("a conditional effect", location)
            case ContinuousUpdate(_, _, _, location):
                raise unsupported("a continuous effect", location)
            case _:
                assert_never(effect)


def _add(update: Update, action: up.Action) -> Callable[..., None]:
    methods = {
        Update.ASSIGN: "add_effect",
        Update.INCREASE: "add_increase_effect",
        Update.DECREASE: "add_decrease_effect",
    }
    if update not in methods:
        raise unsupported(f"an effect {update.value!r}", None)
    method: Callable[..., None] = getattr(action, methods[update])
    return method


def _interval(timing: Timing) -> up.Timing | up.TimeInterval:
    match timing:
        case Timing.AT_START:
            return ups.StartTiming()
        case Timing.AT_END:
            return ups.EndTiming()
        case Timing.OVER_ALL:
            return ups.OpenTimeInterval(ups.StartTiming(), ups.EndTiming())
        case _:
            assert_never(timing)


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
    memory_mb: int = MEMORY_MB

    @property
    def ticks(self) -> int:
        """Ticks in a unit of the plan's time."""
        return int(_SEPARATION / self.epsilon)

    def solve(self, domain: Domain, problem: Problem, deadline: Deadline) -> PlannerAnswer:
        """See :class:`robust.execute.planners.interface.Planner`."""
        start = time.monotonic()
        message = _serialized(domain, problem, self.ticks)
        with tempfile.TemporaryDirectory(prefix="robust-planner-") as name:
            folder = Path(name)
            (folder / "problem.bin").write_bytes(message)
            command = (self.executable, "--log-level", "error", "solve", "problem.bin")
            variables = {"ARIES_PLANNING_HORIZON": str(HORIZON * self.ticks), "RUST_BACKTRACE": "0"}
            ended = run(command, folder, deadline, memory_mb=self.memory_mb, variables=variables)
        answer = judged(self.name, ended, self._plan(ended.stdout, domain, problem), _verdict)
        return replace(answer, seconds=time.monotonic() - start)

    def _plan(self, text: str, domain: Domain, problem: Problem) -> tuple[TimedPlan | None, str]:
        """The plan that was printed, in our names and unit; or what is wrong with it."""
        candidate = next(plan_texts(text), None)
        if candidate is None:
            return None, ""
        try:
            plan = _in_units(parse_timed_plan(candidate, f"<plan of {self.name}>"), domain, self.ticks)
            check(plan, domain, problem, self.epsilon)
        except RobustError as error:
            return None, " ".join(str(error).split())
        return plan, ""


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
        expected = "it to be installed: pip install 'robust[planners]'"
        raise UnsupportedError(f"found no planner aries (package up-aries), expected {expected}") from error
    except OSError as error:
        raise UnsupportedError(
            f"found no planner aries for this machine ({error}), expected another planner"
        ) from error
    return AriesPlanner(executable, epsilon)


class _Message(Protocol):
    def SerializeToString(self) -> bytes: ...  # noqa: N802 - protobuf's name


def _serialized(domain: Domain, problem: Problem, ticks: int) -> bytes:

    writer = importlib.import_module("unified_planning.grpc.proto_writer").ProtobufWriter()
    message: _Message = writer.convert(unified_problem(domain, problem, ticks, HORIZON))
    return message.SerializeToString()


def _in_units(plan: TimedPlan, domain: Domain, ticks: int) -> TimedPlan:
    """The plan with PDDL's names, and times in the problem's unit; instantaneous actions have no duration."""

    steps = []
    for one in plan.steps:
        schema = domain.actions.get(pddl_name(one.action))
        durative = one.duration is not None and (schema is None or schema.durative)
        duration = one.duration / ticks if durative and one.duration is not None else None
        arguments = tuple(map(pddl_name, one.arguments))
        steps.append(TimedStep(one.time / ticks, pddl_name(one.action), arguments, duration, one.location))
    return TimedPlan(tuple(steps), plan.file)


def _verdict(ended: Ended) -> PlannerStatus | None:
    if "NO PLAN" in ended.stdout:
        return PlannerStatus.NO_PLAN
    return PlannerStatus.CRASHED if ended.stderr.startswith("Error:") else None
