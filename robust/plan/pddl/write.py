"""PDDL as text: conditions for names of obligations, domains and problems for planners and for generators of plans.

Reading the text of a domain gives an equal domain (:mod:`robust.plan.pddl.reader`). Numbers of a problem are decimals.
A number without a finite decimal, such as 1/3, or with more than `_PLACES` places is rounded: times of timed literals
so that no condition holds for longer than it does, other numbers to the nearest. A planner may then miss a plan; a plan
that is not valid for the exact numbers is refuted when it is checked.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import assert_never

from robust import errors, numbers
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl import syntax

Bindings = Mapping[str, str]
_UNBOUND: Bindings = {}

_REQUIREMENTS = ":typing :fluents :adl :durative-actions :duration-inequalities :timed-initial-literals"
_CONTINUOUS = ":continuous-effects"
_PLACES = 9
_TIME_PLACES = 3
"""Planners print times with three places; a limit between two of them is of no use to them."""


# -- lifted conditions and expressions --------------------------------------------------------------------------------


def condition_text(  # noqa: PLR0911 (one return for each kind of condition)
    condition: syntax.LiftedCondition, bindings: Bindings = _UNBOUND
) -> str:
    """The condition in PDDL; variables that `bindings` does not have stay variables."""
    match condition:
        case syntax.Proposition(predicate, arguments):
            return _form(predicate, *[_term(argument, bindings) for argument in arguments])
        case syntax.Equality(left, right):
            return _form("=", _term(left, bindings), _term(right, bindings))
        case syntax.NumericComparison(comparator, left, right):
            return _form(comparator.value, expression_text(left, bindings), expression_text(right, bindings))
        case syntax.NameEquality(objects):
            return condition_text(objects, bindings)
        case syntax.Negation(operand):
            return _form("not", condition_text(operand, bindings))
        case syntax.Conjunction(operands):
            return conjunction_text(condition_text(operand, bindings) for operand in operands)
        case syntax.Disjunction(operands):
            return _form("or", *[condition_text(operand, bindings) for operand in operands])
        case syntax.Implication(premise, conclusion):
            return _form("imply", condition_text(premise, bindings), condition_text(conclusion, bindings))
        case syntax.Quantification(universal, variables, operand):
            hidden = {variable.name for variable in variables}
            inner = {name: value for name, value in bindings.items() if name not in hidden}
            listed = " ".join(
                f"?{variable.name}" if variable.types == (syntax.OBJECT,) else _typed([variable], "?")
                for variable in variables
            )
            return _form("forall" if universal else "exists", f"({listed})", condition_text(operand, inner))
        case _:
            assert_never(condition)


def expression_text(expression: syntax.NumericExpression, bindings: Bindings = _UNBOUND) -> str:
    """The expression in PDDL."""
    match expression:
        case syntax.Number(_, text):
            return text
        case syntax.FunctionTerm(function, arguments):
            return _form(function, *[_term(argument, bindings) for argument in arguments])
        case syntax.DurationTerm():
            return "?duration"
        case syntax.ParameterTerm(name):
            return f"?{name}"
        case syntax.Arithmetic(operator, operands):
            return _form(operator.value, *[expression_text(operand, bindings) for operand in operands])
        case _:
            assert_never(expression)


def duration_text(bound: syntax.DurationBound, bindings: Bindings = _UNBOUND) -> str:
    """The duration constraint in PDDL, without its time specifier."""
    return _form(bound.comparator.value, "?duration", expression_text(bound.bound, bindings))


def type_text(types: Sequence[str]) -> str:
    return types[0] if len(types) == 1 else _form("either", *types)


def _form(head: str, *operands: str) -> str:
    return f"({' '.join([head, *operands])})"


def _term(term: syntax.Term, bindings: Bindings) -> str:
    return bindings.get(term.name, f"?{term.name}") if term.variable else term.name


# -- the frame of a file, which every writer of PDDL shares -----------------------------------------------------------


def define(kind: str, name: str, sections: Iterable[str]) -> str:
    """A file with a `domain` or a `problem`; empty sections are left out."""
    return "\n".join([f"(define ({kind} {name})", *filter(None, sections)]) + ")\n"


def section(keyword: str, items: Iterable[str]) -> str:
    """`(keyword item ...)`; nothing if there is no item."""
    body = " ".join(filter(None, items))
    return f"({keyword} {body})" if body else ""


def conjunction_text(parts: Iterable[str]) -> str:
    return _form("and", *parts)


def timed(timing: Timing, text: str) -> str:
    return _form(timing.value, text)


def action_text(
    name: str, condition: str, effects: Iterable[str], *, parameters: str = "", duration: str | None = None
) -> str:
    """An action; durative if it has a `duration`."""
    keywords = (":action", ":precondition") if duration is None else (":durative-action", ":condition")
    lines = [
        f"({keywords[0]} {name}",
        f" :parameters ({parameters})",
        *([] if duration is None else [f" :duration {duration}"]),
        f" {keywords[1]} {condition}",
        f" :effect {conjunction_text(effects)})",
    ]
    return "\n".join(lines)


# -- domains and problems as they were read ---------------------------------------------------------------------------


def domain_text(domain: syntax.Domain) -> str:
    """The domain in PDDL.

    Raises:
        UnsupportedError: for synthesis parameters, which no planner reads.
    """
    actions = domain.actions.values()
    parameters = [*domain.parameters, *(name for schema in actions for name in schema.synth_parameters)]
    if parameters:
        expected = "a domain without: write their values in"
        raise errors.UnsupportedError(
            f"found synthesis parameter {parameters[0]!r}, expected {expected}", domain.location
        )
    continuous = any(isinstance(effect, syntax.ContinuousUpdate) for schema in actions for effect in schema.effects)
    sections = [
        section(":requirements", [_REQUIREMENTS, _CONTINUOUS if continuous else ""]),
        section(":types", _types(domain.types)),
        section(":constants", [_typed(domain.constants.values())]),
        section(":predicates", map(_signature, domain.predicates.values())),
        section(":functions", map(_signature, domain.functions.values())),
        *map(_action, actions),
    ]
    return define("domain", domain.name, sections)


def problem_text(problem: syntax.Problem, domain: syntax.Domain) -> str:
    """The problem in PDDL; it asks for a short makespan, since planners need a metric to prefer one plan to another."""
    facts = [
        *(str(atom) for atom in sorted(problem.atoms)),
        *(f"(= {fluent} {decimal(value, _PLACES)})" for fluent, value in problem.fluents.items()),
        *map(_timed_literal, problem.timed_literals),
    ]
    sections = [
        f"(:domain {problem.domain})",
        section(":objects", [_typed(item for name, item in problem.objects.items() if name not in domain.constants)]),
        f"(:init {' '.join(facts)})",
        f"(:goal {condition_text(problem.goal)})",
        "(:metric minimize (total-time))",
    ]
    return define("problem", problem.name, sections)


def decimal(value: Fraction, places: int, *, up: bool | None = None) -> str:
    """The value with at most `places` decimals; rounded up, down, or (None) to the nearest where it has more."""
    scaled = value * 10**places
    whole = round(scaled) if up is None else -(-scaled // 1) if up else scaled // 1
    return numbers.format_number(Fraction(whole, 10**places))


def _timed_literal(literal: TimedLiteral) -> str:
    match literal.target:
        case Atom():
            fact = str(literal.target) if literal.value else f"(not {literal.target})"
        case Fluent():
            fact = f"(= {literal.target} {decimal(Fraction(literal.value), _PLACES)})"
        case _:
            assert_never(literal.target)
    return f"(at {decimal(literal.time, _TIME_PLACES, up=literal.value is True)} {fact})"


def _types(types: Mapping[str, frozenset[str]]) -> Iterable[str]:
    """Each type with its direct ancestors: those that are no ancestors of another one."""
    for name in filter(syntax.OBJECT.__ne__, types):
        above = types[name] - {name}
        direct = sorted(parent for parent in above if not any(parent in types[other] for other in above - {parent}))
        yield f"{name} - {type_text(direct or (syntax.OBJECT,))}"


def _typed(names: Iterable[syntax.TypedName], mark: str = "") -> str:
    return " ".join(f"{mark}{item.name} - {type_text(item.types)}" for item in names)


def _signature(signature: syntax.Signature) -> str:
    return section(signature.name, [_typed(signature.parameters, "?")]) or f"({signature.name})"


def _action(schema: syntax.ActionSchema) -> str:
    parameters = _typed(schema.parameters, "?")
    effects = [_effect(effect, schema.durative) for effect in schema.effects]
    if not schema.durative:
        condition = _together([condition_text(part.condition) for part in schema.conditions])
        return action_text(schema.name, condition, effects, parameters=parameters)
    conditions = conjunction_text(timed(part.timing, condition_text(part.condition)) for part in schema.conditions)
    bounds = [_when(bound.timing, duration_text(bound), bound.timing is Timing.AT_END) for bound in schema.durations]
    return action_text(schema.name, conditions, effects, parameters=parameters, duration=_together(bounds))


def _together(texts: list[str]) -> str:
    """A conjunction; not all planners read one of a single part."""
    return texts[0] if len(texts) == 1 else conjunction_text(texts)


def _effect(effect: syntax.LiftedEffect, durative: bool) -> str:
    match effect:
        case syntax.LiteralEffect(timing, proposition, value):
            text = condition_text(proposition)
            return _when(timing, text if value else f"(not {text})", durative)
        case syntax.NumericUpdate(timing, update, target, expression):
            return _when(timing, _form(update.value, expression_text(target), expression_text(expression)), durative)
        case syntax.ContinuousUpdate(update, target, rate):
            return _form(update.value, expression_text(target), f"(* #t {expression_text(rate)})")
        case syntax.ForallEffect(variables, effects):
            return f"(forall ({_typed(variables, '?')}) {_all(effects, durative)})"
        case syntax.WhenEffect(condition, effects, _, remembered):
            simple = syntax.primitive(effects)
            timings = (part.timing for part in simple if not isinstance(part, syntax.ContinuousUpdate))
            guard = _when(next(timings, Timing.AT_START), condition_text(condition), durative)
            if remembered is not None:
                early = _when(Timing.AT_START, condition_text(remembered), durative)
                empty = isinstance(condition, syntax.Conjunction) and not condition.operands
                guard = early if empty else f"(and {early} {guard})"
            return f"(when {guard} {_all(effects, durative)})"
        case _:
            assert_never(effect)


def _all(effects: Iterable[syntax.LiftedEffect], durative: bool) -> str:
    return conjunction_text(_effect(effect, durative) for effect in effects)


def _when(timing: Timing, text: str, durative: bool) -> str:
    return timed(timing, text) if durative else text


# -- action models that a program sketches ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ActionText:
    """A durative action: conditions at its start, over all of it and at its end, effects at its start and at
    its end.

    Each is a literal such as `(have mug)` or `(not (have mug))`.
    """

    name: str
    at_start: tuple[str, ...] = ()
    over_all: tuple[str, ...] = ()
    at_end: tuple[str, ...] = ()
    start_effects: tuple[str, ...] = ()
    end_effects: tuple[str, ...] = ()
    parameters: str = ""
    """As PDDL writes them: `?who - agent`."""

    def __str__(self) -> str:
        conditions = zip(Timing, (self.at_start, self.over_all, self.at_end), strict=True)
        effects = ((Timing.AT_START, self.start_effects), (Timing.AT_END, self.end_effects))
        demanded, caused = (
            [timed(timing, literal) for timing, literals in parts for literal in literals]
            for parts in (conditions, effects)
        )
        condition = conjunction_text(demanded)
        return action_text(self.name, condition, caused, parameters=self.parameters, duration="(>= ?duration 0)")


def sketched_domain(name: str, predicates: Iterable[str], actions: Iterable[ActionText]) -> str:
    """A domain with these predicates and actions."""
    requirements = "(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)"
    return define("domain", name, [requirements, section(":predicates", predicates), *map(str, actions)])


def sketched_problem(name: str, domain: str, initial: Iterable[str], goal: Iterable[str], *, objects: str = "") -> str:
    """A problem over a domain."""
    sections = [f"(:domain {domain})", section(":objects", [objects]), f"(:init {' '.join(initial)})"]
    return define("problem", name, [*sections, f"(:goal {conjunction_text(goal)})"])
