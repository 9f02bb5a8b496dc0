"""PDDL domains and problems from their text: sections, actions and the initial state.

Forms become checked data (:mod:`robust.plan.pddl.syntax`). Conditions, durations and effects are read by
:mod:`robust.plan.pddl.conditions`, declarations by :mod:`robust.plan.pddl.declarations`.
"""

import os
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import TypeVar

from robust.errors import Location, did_you_mean
from robust.plan.model import Atom, Fluent, TimedLiteral, Timing
from robust.plan.pddl import conditions, declarations, syntax
from robust.plan.pddl.declarations import Scope, Vocabulary, function, proposition, unsupported
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, is_word, number, read_forms, read_text, walk

T = TypeVar("T")

_PARTS = {
    False: (":parameters", ":synth-parameters", ":precondition", ":effect"),
    True: (":parameters", ":synth-parameters", ":duration", ":condition", ":effect"),
}


def action(form: Form, vocabulary: Vocabulary, parameters: tuple[str, ...]) -> syntax.ActionSchema:
    """An action; `parameters` are the synthesis parameters of the domain, which its own ones and variables hide."""
    durative = form.head == ":durative-action"
    name = form.items[1] if len(form.items) > 1 else None
    if not is_word(name, Kind.NAME):
        raise fault(name or form, f"the name of an action after '{form.head}'")
    parts = _parts(form, durative)
    variables = declarations.variables(_list(parts, ":parameters"), vocabulary.types)
    own = declarations.synth_parameters(_list(parts, ":synth-parameters"), [variable.name for variable in variables])
    of_domain = Scope(vocabulary, {}, {**dict.fromkeys(parameters, False), **dict.fromkeys(own, True)}, durative)
    scope = of_domain.bind(variables)
    if durative and ":duration" not in parts:
        raise fault(form, "':duration' in a durative action, as in :duration (= ?duration 5)")
    return syntax.ActionSchema(
        name=name.text,
        durative=durative,
        parameters=variables,
        synth_parameters=own,
        durations=tuple(_read(parts, ":duration", lambda item: conditions.duration_bounds(item, scope))),
        conditions=tuple(_conditions(parts, scope)),
        effects=tuple(
            _read(parts, ":effect", lambda item: conditions.effects(item, scope, None if durative else Timing.AT_START))
        ),
        location=form.location,
    )


def _parts(form: Form, durative: bool) -> dict[str, tuple[Item, ...]]:
    """What follows each keyword: one item, but any number of parameters to synthesise."""
    allowed = _PARTS[durative]
    parts: dict[str, tuple[Item, ...]] = {}
    keyword: Word | None = None
    for item in form.items[2:]:
        section = _synth_section(item)
        if section is not None:
            _check_keyword(section, allowed, parts)
            parts[section.text] = item.rest if isinstance(item, Form) else ()
            keyword = None
        elif is_word(item, Kind.KEYWORD):
            _check_complete(keyword, parts, item)
            _check_keyword(item, allowed, parts)
            keyword, parts[item.text] = item, ()
        elif keyword is None or (parts[keyword.text] and keyword.text != ":synth-parameters"):
            raise fault(item, f"a keyword ({', '.join(sorted(set(allowed) - set(parts)))}) or ')'")
        else:
            parts[keyword.text] = (*parts[keyword.text], item)
    _check_complete(keyword, parts, form)
    return parts


def _synth_section(item: Item) -> Word | None:
    """The keyword of `(:synth-parameters ?s ...)` written as a form of its own."""
    if isinstance(item, Form) and item.head == ":synth-parameters" and isinstance(item.items[0], Word):
        return item.items[0]
    return None


def _check_keyword(word: Word, allowed: tuple[str, ...], parts: Mapping[str, object]) -> None:
    if word.text not in allowed:
        twins = {":condition": ":precondition", ":precondition": ":condition"}
        twin = twins.get(word.text, "")
        hint = f"; did you mean '{twin}'?" if twin in allowed else did_you_mean(word.text, allowed)
        raise fault(word, "a keyword of this kind of action", hint=hint)
    if word.text in parts:
        raise fault(word, "each keyword once", found=f"a second '{word.text}'")


def _check_complete(keyword: Word | None, parts: Mapping[str, tuple[Item, ...]], following: Item) -> None:
    if keyword is not None and not parts[keyword.text] and keyword.text != ":synth-parameters":
        found = "the end of the action" if isinstance(following, Form) else f"'{following.text}'"
        raise fault(keyword, f"a form in parentheses after '{keyword.text}'", found=found)


def _list(parts: Mapping[str, tuple[Item, ...]], keyword: str) -> tuple[Item, ...]:
    """The items of a list in parentheses; parameters to synthesise may stand without."""
    items = parts.get(keyword, ())
    if keyword == ":synth-parameters" or not items:
        return items
    if not isinstance(items[0], Form):
        raise fault(items[0], f"a list in parentheses after '{keyword}'")
    return items[0].items


def _read(parts: Mapping[str, tuple[Item, ...]], keyword: str, read: Callable[[Item], list[T]]) -> list[T]:
    items = parts.get(keyword)
    return read(items[0]) if items else []


def _conditions(parts: Mapping[str, tuple[Item, ...]], scope: Scope) -> list[syntax.TimedLiftedCondition]:
    if scope.durative:
        return _read(parts, ":condition", lambda item: conditions.timed_conditions(item, scope))
    untimed = _read(parts, ":precondition", lambda item: [conditions.condition(item, scope)])
    return [syntax.TimedLiftedCondition(Timing.AT_START, part) for part in untimed]


class InitialState:
    """Collects the elements of `:init` and refuses contradictions."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._values: dict[tuple[Fraction | None, Atom | Fluent], bool | Fraction] = {}
        """What is said of an atom or fluent, initially (None) or at a time."""

    @property
    def atoms(self) -> frozenset[Atom]:
        """The atoms that are true initially."""
        return frozenset(
            name for (time, name), value in self._values.items() if time is None and isinstance(name, Atom) and value
        )

    @property
    def fluents(self) -> dict[Fluent, Fraction]:
        """The initial values of fluents."""
        return {
            name: Fraction(value)
            for (time, name), value in self._values.items()
            if time is None and isinstance(name, Fluent)
        }

    @property
    def timed_literals(self) -> tuple[TimedLiteral, ...]:
        """Timed initial literals by time; at one time in the order of the file."""
        timed = [TimedLiteral(time, name, value) for (time, name), value in self._values.items() if time is not None]
        return tuple(sorted(timed, key=lambda literal: literal.time))

    def add(self, item: Item) -> None:
        """Add one element: `(p a)`, `(not (p a))`, `(= (f a) 3)` or `(at 5 element)`."""
        if not isinstance(item, Form):
            raise fault(item, "an initial fact in parentheses")
        is_timed = item.head == "at" and len(item.items) > 1 and is_word(item.items[1], Kind.NUMBER)
        fact, time = _timed(item) if is_timed else (item, None)
        target, value = self._fact(fact)
        before = self._values.setdefault((time, target), value)
        if value != before:
            expected = f"the value given before, {str(before).lower()}"
            raise fault(item, expected, found=f"{target} = {str(value).lower()}")

    def _fact(self, form: Form) -> tuple[Atom | Fluent, bool | Fraction]:
        if form.head == "=":
            return self._number(form)
        value = form.head != "not"
        used = proposition(form, self._scope) if value else conditions.negated(form, self._scope)
        return Atom(used.predicate, _names(used.arguments)), value

    def _number(self, form: Form) -> tuple[Fluent, Fraction]:
        if len(form.rest) != 2:
            raise fault(form, "a numeric function and its value, as in (= (f) 3)")
        left, right = form.rest
        if isinstance(left, Word):
            if left.kind is not Kind.NAME:
                raise fault(left, "a numeric function, as in (= (f) 3)")
            left = Form((left,), left.location)
        used = function(left, self._scope)
        return Fluent(used.function, _names(used.arguments)), _value(right)


def _timed(form: Form) -> tuple[Form, Fraction]:
    """The fact of a timed initial literal, and its time."""
    moment, *inside = form.rest
    time = _value(moment)
    if time < 0:
        raise fault(moment, "a time of at least zero")
    if len(inside) != 1 or not isinstance(inside[0], Form):
        raise fault(form, "one fact in parentheses after the time, as in (at 5 (open door))")
    return inside[0], time


def _value(item: Item) -> Fraction:
    """A number, possibly written `(- 3)`."""
    if is_word(item, Kind.NUMBER):
        return number(item)
    if isinstance(item, Form) and item.head == "-" and len(item.rest) == 1:
        return -_value(item.rest[0])
    expected = "a finite number" if isinstance(item, Word) and item.text in ("nan", "inf", "-inf") else "a number"
    raise fault(item, expected)


def _names(terms: Iterable[syntax.Term]) -> tuple[str, ...]:
    return tuple(term.name for term in terms)


_REPEATABLE = frozenset((":action", ":durative-action"))
_DOMAIN_SECTIONS = frozenset(
    (":requirements", ":types", ":constants", ":predicates", ":functions", ":synth-parameters", *_REPEATABLE)
)
_PROBLEM_SECTIONS = frozenset((":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length"))
_UNSUPPORTED = {
    ":process": ("a process", "make it a durative action with a continuous effect"),
    ":event": ("an event", "make it an action or a timed initial literal"),
    ":derived": ("a derived predicate", "write its definition where it is used"),
    ":axiom": ("an axiom", "write its definition where it is used"),
    ":constraints": ("trajectory constraints", "state them as over all conditions or as goals"),
    ":task": ("a task of a hierarchical domain", "describe the actions only"),
    ":method": ("a method of a hierarchical domain", "describe the actions only"),
    ":htn": ("a task network", "describe the plan in an .stn file"),
}


def read_domain(path: str | os.PathLike[str]) -> syntax.Domain:
    """Read a domain file."""
    return parse_domain(read_text(path), os.fspath(path))


def read_problem(path: str | os.PathLike[str], domain: syntax.Domain) -> syntax.Problem:
    """Read a problem file of `domain`."""
    return parse_problem(read_text(path), domain, os.fspath(path))


def parse_domain(text: str, file: str = "<domain>") -> syntax.Domain:
    """Read a domain; `file` is its name in messages."""
    name, definition = _definition(text, file, "domain")
    sections = _sections(definition, _DOMAIN_SECTIONS)
    declarations.check_requirements(_items(sections, ":requirements"))
    hierarchy = declarations.types(_items(sections, ":types"))
    constants = declarations.objects(_items(sections, ":constants"), hierarchy, {})
    predicates = declarations.signatures(_items(sections, ":predicates"), "predicate", hierarchy)
    functions = declarations.functions(_items(sections, ":functions"), hierarchy, predicates)
    parameters = declarations.synth_parameters(_items(sections, ":synth-parameters"), ())
    vocabulary = Vocabulary(hierarchy, constants, predicates, functions)
    actions: dict[str, syntax.ActionSchema] = {}
    for form in definition:
        if form.head in _REPEATABLE:
            schema = action(form, vocabulary, parameters)
            other = actions.setdefault(schema.name, schema)
            if other is not schema:
                expected = f"one declaration; the first is at {other.location}"
                raise fault(form, expected, found=f"a second action '{schema.name}'")
    return syntax.Domain(
        name=name.text,
        parameters=parameters,
        types=hierarchy,
        constants=constants,
        predicates=predicates,
        functions=functions,
        actions=actions,
        written=frozenset(
            effect.target.function
            for schema in actions.values()
            for effect in syntax.primitive(schema.effects)
            if not isinstance(effect, syntax.LiteralEffect)
        ),
        location=name.location,
    )


def parse_problem(text: str, domain: syntax.Domain, file: str = "<problem>") -> syntax.Problem:
    """Read a problem of `domain`; `file` is its name in messages."""
    name, definition = _definition(text, file, "problem")
    sections = _sections(definition, _PROBLEM_SECTIONS)
    for required in (":domain", ":init", ":goal"):
        if required not in sections:
            raise fault(name, f"a section ({required} ...) in the problem", found=f"problem '{name.text}' without it")
    _check_domain_name(sections[":domain"], domain)
    declarations.check_requirements(_items(sections, ":requirements"))
    objects = declarations.objects(_items(sections, ":objects"), domain.types, domain.constants)
    vocabulary = Vocabulary(domain.types, objects, domain.predicates, domain.functions)
    scope = Scope(vocabulary, {}, dict.fromkeys(domain.parameters, False))
    initial = InitialState(scope)
    for item in _items(sections, ":init"):
        initial.add(item)
    if ":metric" in sections:
        _check_metric(sections[":metric"], vocabulary)
    return syntax.Problem(
        name=name.text,
        domain=domain.name,
        objects=objects,
        atoms=initial.atoms,
        fluents=initial.fluents,
        timed_literals=initial.timed_literals,
        goal=_goal(sections[":goal"], scope),
        location=name.location,
    )


def _definition(text: str, file: str, kind: str) -> tuple[Word, list[Form]]:
    """The name and the sections of `(define (kind name) ...)`."""
    items = read_forms(text, file)
    expected = f"(define ({kind} ...) ...)"
    if not items:
        raise fault(Location(file, 1, 1), expected, found="an empty file")
    define = items[0]
    if not isinstance(define, Form) or define.head != "define":
        raise fault(define, expected)
    if len(items) > 1:
        raise fault(items[1], f"the end of the file after the {kind}")
    header = define.items[1] if len(define.items) > 1 else None
    if not isinstance(header, Form) or header.head not in ("domain", "problem"):
        raise fault(header or define, f"({kind} ...) after 'define'")
    if header.head != kind:
        raise fault(header, f"a {kind}; are the files in the right order?", found=f"a {header.head}")
    name = header.items[1] if len(header.items) == 2 else None
    if not is_word(name, Kind.NAME, Kind.NUMBER):
        raise fault(header, f"({kind} NAME)")
    return name, [_section(item) for item in define.items[2:]]


def _section(item: Item) -> Form:
    if isinstance(item, Form) and item.items and is_word(item.items[0], Kind.KEYWORD):
        return item
    raise fault(item, "a section such as (:requirements ...) or (:init ...)")


def _sections(definition: Iterable[Form], known: Iterable[str]) -> dict[str, Form]:
    """Sections by keyword; of repeatable ones the last."""
    sections: dict[str, Form] = {}
    for form in definition:
        keyword = form.head
        if keyword in _UNSUPPORTED:
            raise unsupported(form, *_UNSUPPORTED[keyword])
        if keyword not in known:
            raise fault(form.items[0], "a section", hint=did_you_mean(keyword, known))
        if keyword in sections and keyword not in _REPEATABLE:
            expected = f"one; the first is at {sections[keyword].location}"
            raise fault(form, expected, found=f"a second section '{keyword}'")
        sections[keyword] = form
    return sections


def _items(sections: dict[str, Form], keyword: str) -> tuple[Item, ...]:
    return sections[keyword].rest if keyword in sections else ()


def _check_domain_name(form: Form, domain: syntax.Domain) -> None:
    name = form.items[1] if len(form.items) == 2 else None
    if not isinstance(name, Word):
        raise fault(form, "(:domain NAME)")
    if name.text != domain.name:
        expected = f"'{domain.name}', the domain of {domain.location.file}"
        raise fault(name, expected, found=f"a problem for domain '{name.text}'")


def _goal(form: Form, scope: Scope) -> syntax.LiftedCondition:
    if len(form.items) != 2:
        raise fault(form.items[2] if len(form.items) > 2 else form, "one condition in (:goal ...)")
    return conditions.condition(form.items[1], scope)


def _check_metric(form: Form, vocabulary: Vocabulary) -> None:
    """The metric is not used, but a misspelt one is worth a message."""
    direction = form.items[1] if len(form.items) > 1 else form
    if not isinstance(direction, Word) or direction.text not in ("minimize", "maximize"):
        raise fault(direction, "'minimize' or 'maximize'")
    if len(form.items) != 3:
        raise fault(form, "(:metric minimize EXPRESSION)")
    functions = {"total-time": syntax.Signature("total-time", (), form.location), **vocabulary.functions}
    scope = Scope(Vocabulary(vocabulary.types, vocabulary.objects, vocabulary.predicates, functions), {}, {})
    for item in walk(form.items[2]):
        if isinstance(item, Form) and item.head == "is-violated":
            raise unsupported(item, "a preference", "leave it out of the metric")
    conditions.expression(form.items[2], scope)
