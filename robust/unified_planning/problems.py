"""Problems of unified-planning as domains and problems, read from PDDL text of our own, so that the reader's checks and
messages apply. Initial values and the times and values of timed effects are handed over as fractions: PDDL has no way
to write 1/3.

Quality metrics are not read: they do not bear on validity.

What PDDL has no words for becomes *parts*: what an action does or needs at its start + k, or over an interval that ends
there, is an action of its own, whose time points are tied to those of the action; so is a goal at a time, tied to the
beginning. Bounds of types become conditions of the actions that change a fluent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, UnsupportedError, missing
from robust.numbers import format_number
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.pddl import reader, syntax

if TYPE_CHECKING:
    import unified_planning.model as up

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*")


def name_of(text: str) -> str:
    """The name in lower case; InputError for one that PDDL cannot have."""
    if _NAME.fullmatch(text) is None:
        raise InputError(f"found the name {text!r}, expected letters, digits, '_' and '-'")
    return text.lower()


def typed(variables: Iterable[Any]) -> str:
    """Parameters or variables, each with its type."""
    return " ".join(f"?{name_of(variable.name)} - {_type(variable)}" for variable in variables)


def _type(variable: Any) -> str:
    if not variable.type.is_user_type():
        raise UnsupportedError(f"found parameter {variable.name!r} of type {variable.type}, expected objects")
    return name_of(variable.type.name)


def named(fluent: up.FNode) -> tuple[str, tuple[str, ...]]:
    """Name and arguments of a ground fluent."""
    return name_of(fluent.fluent().name), tuple(name_of(argument.object().name) for argument in fluent.args)


def constant(value: up.FNode) -> bool | Fraction:
    """A truth value or a number."""
    return bool(value.bool_constant_value()) if value.is_bool_constant() else number_of(value)


def number_of(value: up.FNode) -> Fraction:
    """The exact value of a number."""
    if not (value.is_int_constant() or value.is_real_constant()):
        raise UnsupportedError(f"found the value '{value}', expected a truth value or a number")
    return Fraction(value.constant_value())


def expression(root: up.FNode) -> str:
    """A condition or a numeric expression; without recursion, whatever its depth."""
    results: list[str] = []
    pending: list[tuple[up.FNode, bool]] = [(root, False)]
    while pending:
        node, is_done = pending.pop()
        if not is_done:
            pending.append((node, True))
            pending.extend((argument, False) for argument in reversed(node.args))
            continue
        first = len(results) - len(node.args)
        parts, results = results[first:], results[:first]
        results.append(_text(node, parts))
    return results[0]


def _text(node: up.FNode, parts: list[str]) -> str:
    for test, write in _WRITERS.items():
        if getattr(node, test)():
            return f"({' '.join((write, *parts))})" if isinstance(write, str) else write(node, parts)
    raise UnsupportedError(f"found the expression '{node}', expected one that PDDL 2.1 can say")


def _number(node: up.FNode, _parts: list[str]) -> str:
    return _rational(number_of(node))


def _quantified(node: up.FNode, parts: list[str]) -> str:
    word = "forall" if node.is_forall() else "exists"
    return f"({word} ({typed(node.variables())}) {parts[0]})"


_WRITERS: dict[str, str | Callable[[Any, list[str]], str]] = {
    "is_and": "and",
    "is_or": "or",
    "is_not": "not",
    "is_implies": "imply",
    "is_equals": "=",
    "is_le": "<=",
    "is_lt": "<",
    "is_plus": "+",
    "is_times": "*",
    "is_minus": "-",
    "is_div": "/",
    "is_iff": lambda _, parts: f"(and (imply {parts[0]} {parts[1]}) (imply {parts[1]} {parts[0]}))",
    "is_forall": _quantified,
    "is_exists": _quantified,
    "is_fluent_exp": lambda node, parts: f"({' '.join((name_of(node.fluent().name), *parts))})",
    "is_parameter_exp": lambda node, _: f"?{name_of(node.parameter().name)}",
    "is_variable_exp": lambda node, _: f"?{name_of(node.variable().name)}",
    "is_object_exp": lambda node, _: name_of(node.object().name),
    "is_bool_constant": lambda node, _: "(and)" if node.is_true() else "(or)",
    "is_int_constant": _number,
    "is_real_constant": _number,
}
"""PDDL's word for each kind of expression, or what writes it, by the method that recognizes it."""


_NEEDS = ":typing :fluents :adl :durative-actions :duration-inequalities :timed-initial-literals"


def problem_of(problem: up.Problem, *, bounded: bool = False) -> tuple[syntax.Domain, syntax.Problem]:
    """Domain and problem of a unified-planning problem; if `bounded`, bounds of types are conditions.

    Raises:
        InputError: for names that PDDL cannot tell apart, and fluents without initial value.
        UnsupportedError: for what PDDL 2.1 with timed initial literals cannot say.
    """
    _check_supported(problem)
    name = re.sub(r"^-|[^a-z0-9_-]", "_", (problem.name or "problem").lower())  # that of a file, from ANML
    file = f"<unified-planning problem {name}>"
    domain = reader.parse_domain(_domain_text(problem, name, bounded=bounded), file)
    read = reader.parse_problem(_problem_text(problem, name), domain, file)
    atoms, fluents = _initial_state(problem)
    literals = sorted(_timed_literals(problem), key=lambda literal: literal.time)
    return domain, replace(read, atoms=atoms, fluents=fluents, timed_literals=tuple(literals))


def type_bounds(problem: up.Problem) -> dict[str, tuple[Fraction | None, Fraction | None]]:
    """The least and the greatest value, None for none, of the fluents that change and whose type has either."""
    static = problem.get_static_fluents()
    bounds = {}
    for fluent in problem.fluents:
        if fluent not in static and (fluent.type.is_int_type() or fluent.type.is_real_type()):
            ends = fluent.type.lower_bound, fluent.type.upper_bound
            lower, upper = (None if end is None else Fraction(end) for end in ends)
            if lower is not None or upper is not None:
                bounds[fluent.name] = lower, upper
    return bounds


def _check_supported(problem: up.Problem) -> None:
    model = module_of("unified_planning.model")
    if not isinstance(problem, model.Problem):
        raise UnsupportedError(f"found a {type(problem).__name__}, expected a Problem of unified-planning")
    if problem.kind.has_hierarchical() or problem.kind.has_contingent():
        raise UnsupportedError(f"found a {type(problem).__name__}, expected a problem without tasks and unknown facts")
    simulated = ("simulated_effect", "simulated_effects")
    present = {
        "trajectory constraints": problem.trajectory_constraints,
        "processes": problem.processes,
        "events": problem.events,
        "simulated effects": [
            action for action in problem.actions if any(getattr(action, name, 0) for name in simulated)
        ],
    }
    for what, items in present.items():
        if items:
            raise UnsupportedError(f"found {what}, expected a problem without them")
    for what, names in {
        "action": [action.name for action in problem.actions],
        "fluent": [fluent.name for fluent in problem.fluents],
        "object": [thing.name for thing in problem.all_objects],
        "type": [kind.name for kind in problem.user_types],
    }.items():
        lowered = [name_of(name) for name in names]
        twice = next((name for name in lowered if lowered.count(name) > 1), None)
        if twice is not None:
            raise InputError(f"found two names of {what}s that are both {twice!r} in lower case, expected one")


# -- the domain --------------------------------------------------------------------------------------------------------


def _domain_text(problem: up.Problem, name: str, *, bounded: bool) -> str:
    types = " ".join(
        f"{name_of(kind.name)} - {name_of(kind.father.name) if kind.father is not None else 'object'}"
        for kind in problem.user_types
        if name_of(kind.name) != "object"
    )
    constants = " ".join(f"{name_of(thing.name)} - {name_of(thing.type.name)}" for thing in problem.all_objects)
    predicates = [fluent for fluent in problem.fluents if fluent.type.is_bool_type()]
    functions = [fluent for fluent in problem.fluents if fluent.type.is_int_type() or fluent.type.is_real_type()]
    bounds = type_bounds(problem) if bounded else {}
    other = next((fluent for fluent in problem.fluents if fluent not in predicates and fluent not in functions), None)
    if other is not None:
        raise UnsupportedError(f"found fluent {other.name!r} of type {other.type}, expected a Boolean or a number")
    lines = (
        f"(define (domain {name})",
        f"(:requirements {_NEEDS})",
        f"(:types {types})",
        f"(:constants {constants})",  # since actions may name any object
        f"(:predicates {' '.join(map(_signature, predicates))})",
        f"(:functions {' '.join(map(_signature, functions))})",
        *(text for action in problem.actions for text in _actions(action, bounds)),
        *(text for part in timed_goals(problem) for text in [part.text("")]),
    )
    return "\n".join((*lines, ")"))


def _signature(fluent: up.Fluent) -> str:
    return f"({name_of(fluent.name)} {typed(fluent.signature)})"


_Bounds = Mapping[str, tuple[Fraction | None, Fraction | None]]


@dataclass(frozen=True)
class ActionPart:
    """What an action does or needs at other times than its start and its end, as an action of its own.

    `begin` and `end` are timings of the action or of the plan; without an end it is a point in time.
    """

    name: str
    begin: up.Timing
    end: up.Timing | None
    conditions: str
    effects: str

    def text(self, parameters: str) -> str:
        head = f"{self.name} :parameters ({parameters})"
        if self.end is None:
            return f"(:action {head} :precondition (and {self.conditions}) :effect (and {self.effects}))"
        return (
            f"(:durative-action {head} :duration (>= ?duration 0) "
            f":condition (and {self.conditions}) :effect (and {self.effects}))"
        )


def _actions(action: up.Action, bounds: _Bounds) -> Iterator[str]:
    """An action, and its parts."""
    parameters = typed(action.parameters)
    head = f"{name_of(action.name)} :parameters ({parameters})"
    if not hasattr(action, "duration"):
        needed = " ".join((*map(expression, action.preconditions), *_kept_within(action.effects, bounds)))
        done = " ".join(_effect(effect) for effect in action.effects)
        yield f"(:action {head} :precondition (and {needed}) :effect (and {done}))"
        return
    conditions = [
        f"({when} {expression(item)})"
        for interval, all_of in action.conditions.items()
        if not _is_apart(interval.lower, interval.upper)
        for when in _whens(interval)
        for item in all_of
    ]
    effects = []
    for timing, changes in action.effects.items():
        if not _is_apart(timing):
            conditions += [f"({_when(timing)} {kept})" for kept in _kept_within(changes, bounds)]
            effects += [_effect(effect, f"({_when(timing)} {{}})") for effect in changes]
    for interval, flows in action.continuous_effects.items():
        if not _is_apart(interval.lower, interval.upper):
            effects += [_continuous(flow, interval) for flow in flows]
            conditions += [f"(over all {kept})" for flow in flows for kept in _within(flow.fluent, bounds)]
    yield (
        f"(:durative-action {head} :duration {_duration(action.duration)} "
        f":condition (and {' '.join(conditions)}) :effect (and {' '.join(effects)}))"
    )
    for part in parts_of(action, bounds):
        yield part.text(parameters)


def _is_apart(*timings: up.Timing) -> bool:
    """Whether one of them is neither the start nor the end of its action."""
    return any(timing.delay != 0 for timing in timings)


def parts_of(action: up.Action, bounds: _Bounds) -> list[ActionPart]:
    """What the action does or needs at other times than its start and its end."""
    if not hasattr(action, "duration"):
        return []
    points: dict[up.Timing, tuple[list[str], list[str]]] = {}
    spans: dict[tuple[up.Timing, up.Timing], tuple[list[str], list[str]]] = {}
    for timing, changes in action.effects.items():
        if _is_apart(timing):
            conditions, effects = points.setdefault(timing, ([], []))
            conditions += _kept_within(changes, bounds)
            effects += [_effect(effect) for effect in changes]
    for interval, needed in action.conditions.items():
        if not _is_apart(interval.lower, interval.upper):
            continue
        if interval.lower == interval.upper:
            points.setdefault(interval.lower, ([], []))[0].extend(map(expression, needed))
        else:
            conditions, _ = spans.setdefault((interval.lower, interval.upper), ([], []))
            conditions += [f"({when} {expression(item)})" for when in _open_whens(interval) for item in needed]
    for interval, flows in action.continuous_effects.items():
        if _is_apart(interval.lower, interval.upper):
            conditions, effects = spans.setdefault((interval.lower, interval.upper), ([], []))
            effects += [_flow(flow) for flow in flows]
            conditions += [f"(over all {kept})" for flow in flows for kept in _within(flow.fluent, bounds)]
    places = [*((timing, None, *said) for timing, said in points.items())]
    places += [(*span, *said) for span, said in spans.items()]
    for timing in (timing for begin, end, *_ in places for timing in (begin, end) if timing is not None):
        if timing.is_global():
            raise UnsupportedError(f"found '{timing}' in action {action.name!r}, expected times from its start or end")
    return [
        ActionPart(f"{name_of(action.name)}--part{number}", begin, end, " ".join(needed), " ".join(done))
        for number, (begin, end, needed, done) in enumerate(places)
    ]


def timed_goals(problem: up.Problem) -> list[ActionPart]:
    """Goals at times from the beginning of the plan on."""
    parts = []
    for number, (interval, goals) in enumerate(problem.timed_goals.items()):
        for timing in (interval.lower, interval.upper):
            if not (timing.is_global() and timing.is_from_start()):
                raise UnsupportedError(f"found a timed goal over '{interval}', expected times after the plan's start")
        name = f"timed-goal--part{number}"
        if interval.lower == interval.upper:
            parts.append(ActionPart(name, interval.lower, None, " ".join(map(expression, goals)), ""))
        else:
            needed = " ".join(f"({when} {expression(item)})" for when in _open_whens(interval) for item in goals)
            parts.append(ActionPart(name, interval.lower, interval.upper, needed, ""))
    return parts


def _open_whens(interval: up.TimeInterval) -> list[str]:
    first = [] if interval.is_left_open() else ["at start"]
    last = [] if interval.is_right_open() else ["at end"]
    return [*first, "over all", *last]


def _within(fluent: up.FNode, bounds: _Bounds, change: str = "{}") -> list[str]:
    """That a fluent is within the bounds of its type, or will be after a change."""
    lower, upper = bounds.get(fluent.fluent().name, (None, None))
    value = change.format(expression(fluent))
    parts = [] if lower is None else [f"(>= {value} {_rational(lower)})"]
    return parts if upper is None else [*parts, f"(<= {value} {_rational(upper)})"]


def _kept_within(effects: Iterable[up.Effect], bounds: _Bounds) -> list[str]:
    """Conditions just before the effects of a time point, by which bounds of types hold after them."""
    kept, changed = [], set[str]()
    for effect in effects:
        name = effect.fluent.fluent().name
        if name not in bounds:
            continue
        if name in changed:
            raise UnsupportedError(f"found two effects at once on fluent {name!r}, whose type is bounded, expected one")
        changed.add(name)
        value = expression(effect.value)
        word = "" if effect.is_assignment() else "+" if effect.is_increase() else "-"
        change = value if effect.is_assignment() else f"({word} {{}} {value})"
        text = f"(and {' '.join(_within(effect.fluent, bounds, change))})"
        if effect.is_conditional():
            text = f"(imply {expression(effect.condition)} {text})"
        kept.append(f"(forall ({typed(effect.forall)}) {text})" if effect.is_forall() else text)
    return kept


def _rational(value: Fraction) -> str:
    text = format_number(value)
    return f"(/ {value.numerator} {value.denominator})" if "/" in text else text


def _duration(interval: up.DurationInterval) -> str:
    lower, upper = expression(interval.lower), expression(interval.upper)
    if lower == upper and not (interval.is_left_open() or interval.is_right_open()):
        return f"(= ?duration {lower})"
    above, below = ">" if interval.is_left_open() else ">=", "<" if interval.is_right_open() else "<="
    return f"(and ({above} ?duration {lower}) ({below} ?duration {upper}))"


def _when(timing: up.Timing) -> str:
    if timing.delay == 0 and not timing.is_global():
        return "at start" if timing.is_from_start() else "at end"
    raise UnsupportedError(f"found a condition or effect at '{timing}', expected the start or the end of its action")


def _whens(interval: up.TimeInterval) -> list[str]:
    """At start, over all, at end: the parts of an interval; ends that belong to it count by themselves."""
    lower, upper = _when(interval.lower), _when(interval.upper)
    if lower == upper:
        return [lower]
    if lower == "at end":
        raise UnsupportedError(f"found a condition over '{interval}', expected an interval from start to end")
    return _open_whens(interval)


def _effect(effect: up.Effect, wrap: str = "{}") -> str:
    text = wrap.format(_change(effect))
    if effect.is_conditional():
        text = f"(when {wrap.format(expression(effect.condition))} {text})"
    if effect.is_forall():
        text = f"(forall ({typed(effect.forall)}) {text})"
    return text


def _change(effect: up.Effect) -> str:
    target, value = expression(effect.fluent), effect.value
    if effect.fluent.type.is_bool_type():
        if not value.is_bool_constant():
            raise UnsupportedError(f"found effect '{effect}', expected one that makes {target} true or false")
        return target if value.is_true() else f"(not {target})"
    word = "assign" if effect.is_assignment() else "increase" if effect.is_increase() else "decrease"
    return f"({word} {target} {expression(value)})"


def _continuous(effect: up.Effect, interval: up.TimeInterval) -> str:
    if "over all" not in _whens(interval) or effect.is_conditional() or effect.is_forall():
        message = f"found continuous effect '{effect}', expected an unconditional one from start to end"
        raise UnsupportedError(message)
    return _flow(effect)


def _flow(effect: up.Effect) -> str:
    word = "increase" if effect.is_continuous_increase() else "decrease"
    return f"({word} {expression(effect.fluent)} (* #t {expression(effect.value)}))"


# -- the problem -------------------------------------------------------------------------------------------------------


def _problem_text(problem: up.Problem, name: str) -> str:
    goal = " ".join(map(expression, problem.goals))
    return f"(define (problem {name}) (:domain {name}) (:init) (:goal (and {goal})))"


def _initial_state(problem: up.Problem) -> tuple[frozenset[Atom], dict[Fluent, Fraction]]:
    from unified_planning.exceptions import UPProblemDefinitionError  # noqa: PLC0415 - an optional dependency

    try:
        values = problem.initial_values
    except UPProblemDefinitionError as error:
        raise InputError(f"found {error}, expected an initial value for every fluent") from error
    atoms = (Atom(*named(fluent)) for fluent, value in values.items() if value.is_bool_constant() and value.is_true())
    numbers = {
        Fluent(*named(fluent)): number_of(value) for fluent, value in values.items() if not value.is_bool_constant()
    }
    return frozenset(atoms), numbers


def _timed_literals(problem: up.Problem) -> Iterator[TimedLiteral]:
    for timing, effects in problem.timed_effects.items():
        if not (timing.is_global() and timing.is_from_start()):
            raise UnsupportedError(f"found a timed effect at '{timing}', expected a time after the plan's start")
        for effect in effects:
            if not effect.is_assignment() or effect.is_conditional() or effect.is_forall():
                raise UnsupportedError(f"found timed effect '{effect}', expected an unconditional assignment")
            value = constant(effect.value)
            where = named(effect.fluent)
            target = Atom(*where) if isinstance(value, bool) else Fluent(*where)
            yield TimedLiteral(Fraction(timing.delay), target, value)


def module_of(name: str) -> ModuleType:
    """A module of unified-planning; UnsupportedError if it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise missing("unified-planning", "up") from error
