"""PDDL text to checked domains and problems."""

from __future__ import annotations

import os
from collections.abc import Iterable

from robust.errors import Location, did_you_mean
from robust.plan.pddl import declarations
from robust.plan.pddl.actions import action, written_functions
from robust.plan.pddl.check import Scope, Vocabulary, unsupported
from robust.plan.pddl.conditions import condition, expression
from robust.plan.pddl.files import read_text
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, read_forms
from robust.plan.pddl.initial import InitialState
from robust.plan.pddl.syntax import ActionSchema, Domain, LiftedCondition, Problem, Signature

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


def read_domain(path: str | os.PathLike[str]) -> Domain:
    """Read a domain file."""
    return parse_domain(read_text(path), os.fspath(path))


def read_problem(path: str | os.PathLike[str], domain: Domain) -> Problem:
    """Read a problem file of `domain`."""
    return parse_problem(read_text(path), domain, os.fspath(path))


def parse_domain(text: str, file: str = "<domain>") -> Domain:
    """Read a domain; `file` is its name in messages."""
    name, definition = _definition(text, file, "domain")
    sections = _sections(definition, _DOMAIN_SECTIONS)
    declarations.check_requirements(_items(sections, ":requirements"))
    hierarchy = declarations.types(_items(sections, ":types"))
    constants = declarations.objects(_items(sections, ":constants"), hierarchy, {})
    predicates = declarations.predicates(_items(sections, ":predicates"), hierarchy)
    functions = declarations.functions(_items(sections, ":functions"), hierarchy, predicates)
    parameters = declarations.synth_parameters(_items(sections, ":synth-parameters"), ())
    vocabulary = Vocabulary(hierarchy, constants, predicates, functions)
    actions: dict[str, ActionSchema] = {}
    for form in definition:
        if form.head in _REPEATABLE:
            schema = action(form, vocabulary, parameters)
            other = actions.setdefault(schema.name, schema)
            if other is not schema:
                expected = f"one declaration; the first is at {other.location}"
                raise fault(form, expected, found=f"a second action '{schema.name}'")
    return Domain(
        name=name.text,
        parameters=parameters,
        types=hierarchy,
        constants=constants,
        predicates=predicates,
        functions=functions,
        actions=actions,
        written=frozenset(written_functions(actions)),
        location=name.location,
    )


def parse_problem(text: str, domain: Domain, file: str = "<problem>") -> Problem:
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
    return Problem(
        name=name.text,
        domain=domain.name,
        objects=objects,
        atoms=initial.true_atoms(),
        fluents=initial.fluents,
        timed_literals=initial.timed_literals(),
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
    if not isinstance(name, Word) or name.kind not in (Kind.NAME, Kind.NUMBER):
        raise fault(header, f"({kind} NAME)")
    return name, [_section(item) for item in define.items[2:]]


def _section(item: Item) -> Form:
    if isinstance(item, Form) and item.items and isinstance(item.items[0], Word) and item.items[0].kind is Kind.KEYWORD:
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


def _check_domain_name(form: Form, domain: Domain) -> None:
    name = form.items[1] if len(form.items) == 2 else None
    if not isinstance(name, Word):
        raise fault(form, "(:domain NAME)")
    if name.text != domain.name:
        expected = f"'{domain.name}', the domain of {domain.location.file}"
        raise fault(name, expected, found=f"a problem for domain '{name.text}'")


def _goal(form: Form, scope: Scope) -> LiftedCondition:
    if len(form.items) != 2:
        raise fault(form.items[2] if len(form.items) > 2 else form, "one condition in (:goal ...)")
    return condition(form.items[1], scope)


def _check_metric(form: Form, vocabulary: Vocabulary) -> None:
    """The metric is not used, but a misspelt one is worth a message."""
    direction = form.items[1] if len(form.items) > 1 else form
    if not isinstance(direction, Word) or direction.text not in ("minimize", "maximize"):
        raise fault(direction, "'minimize' or 'maximize'")
    if len(form.items) != 3:
        raise fault(form, "(:metric minimize EXPRESSION)")
    functions = {"total-time": Signature("total-time", (), form.location), **vocabulary.functions}
    scope = Scope(Vocabulary(vocabulary.types, vocabulary.objects, vocabulary.predicates, functions), {}, {})
    for item in _all_forms(form.items[2]):
        if item.head == "is-violated":
            raise unsupported(item, "a preference", "leave it out of the metric")
    expression(form.items[2], scope)


def _all_forms(item: Item) -> Iterable[Form]:
    todo = [item]
    while todo:
        current = todo.pop()
        if isinstance(current, Form):
            yield current
            todo.extend(current.items)
